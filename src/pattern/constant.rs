//! One texel everywhere: a base coat, or a flat region behind a mask.

use super::{Fill, Parameter, Patch, Surface};
use crate::map::Texel;
use crate::math::Axis;
use serde::{Deserialize, Serialize};

/// The same widths and direction at every texel. Its value, for masks, is 1.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Constant {
    /// Slope width along the x axis.
    pub alpha_x: f32,
    /// Slope width across the x axis.
    pub alpha_y: f32,
    /// Angle of the x axis, degrees counter-clockwise from +U.
    pub angle: f32,
}

impl Default for Constant {
    fn default() -> Self {
        Self {
            alpha_x: 0.2,
            alpha_y: 0.2,
            angle: 0.0,
        }
    }
}

impl Constant {
    pub(super) const PARAMETERS: &[Parameter] = &[
        Parameter::alpha("alpha_x", "width along the x axis"),
        Parameter::alpha("alpha_y", "width across the x axis"),
        Parameter::angle("angle", "angle of the x axis"),
    ];

    pub(super) fn prepare(&self, _: &Surface) -> Flat {
        Flat(Texel {
            alpha_x: self.alpha_x,
            alpha_y: self.alpha_y,
            axis: Axis::from_degrees(self.angle),
        })
    }
}

/// A prepared [`Constant`].
pub(super) struct Flat(Texel);

impl Fill for Flat {
    fn fill(&self, patch: &mut Patch<'_>) {
        patch.region.alpha_x.fill(self.0.alpha_x);
        patch.region.alpha_y.fill(self.0.alpha_y);
        patch.region.cos2.fill(self.0.axis.cos2);
        patch.region.sin2.fill(self.0.axis.sin2);
        patch.coverage.fill(1.0);
        patch.value.fill(1.0);
    }
}
