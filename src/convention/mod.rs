//! What somebody's numbers mean, and how ours become theirs and come back.
//!
//! A texel of ours is two Ward widths and the angle of the x axis. Every other renderer names the same ellipse by its long
//! and short axis, so [`Stretched`] is where each conversion starts; [`LobeFit`] then exchanges Ward's Gaussian lobe for the
//! target's; and one file per target turns the result into the target's parameters.

pub mod gltf;
mod lobe_fit;
mod record;
pub mod storage;
pub mod textures;

pub use lobe_fit::LobeFit;
pub(crate) use record::generator;
pub use record::{Content, MapInfo, MapRecord, Reflectance};

use crate::map::Texel;
use crate::math::Axis;

/// A texel as renderers that know no x axis see it: the larger width, the smaller one, and the axis of the larger, along
/// which highlights stretch. Grooves run across it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stretched {
    /// The larger width.
    pub alpha_t: f32,
    /// The smaller width.
    pub alpha_b: f32,
    /// The axis that `alpha_t` belongs to. Of a texel with equal widths, its x axis.
    pub axis: Axis,
}

impl From<Texel> for Stretched {
    fn from(texel: Texel) -> Self {
        let Texel {
            alpha_x,
            alpha_y,
            axis,
        } = texel;
        if alpha_x >= alpha_y {
            Self {
                alpha_t: alpha_x,
                alpha_b: alpha_y,
                axis,
            }
        } else {
            Self {
                alpha_t: alpha_y,
                alpha_b: alpha_x,
                axis: axis.perpendicular(),
            }
        }
    }
}

impl Stretched {
    /// Back to a texel. Which of the two axes is called x is a matter of naming that other formats do not keep:
    /// `x_is_wide` chooses; `false` is what a groove brush lays down.
    pub fn to_texel(self, x_is_wide: bool) -> Texel {
        if x_is_wide {
            Texel {
                alpha_x: self.alpha_t,
                alpha_y: self.alpha_b,
                axis: self.axis,
            }
        } else {
            Texel {
                alpha_x: self.alpha_b,
                alpha_y: self.alpha_t,
                axis: self.axis.perpendicular(),
            }
        }
    }

    /// How far from round, (alpha_t - alpha_b) / (alpha_t + alpha_b): 0 for equal widths, towards 1 for a line.
    pub fn eccentricity(self) -> f32 {
        (self.alpha_t - self.alpha_b) / (self.alpha_t + self.alpha_b)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn highlights_stretch_across_the_grooves() {
        let brushed = Texel {
            alpha_x: 0.05,
            alpha_y: 0.3,
            axis: Axis::from_degrees(20.0),
        };
        let s = Stretched::from(brushed);
        assert_eq!((s.alpha_t, s.alpha_b), (0.3, 0.05));
        assert!((s.axis.degrees() - 110.0).abs() < 1e-3);
        assert!(s.axis.angle_to(brushed.groove().perpendicular()) < 1e-6);
    }

    proptest! {
        #[test]
        fn either_naming_comes_back(ax in 1e-3f32..1.5, ay in 1e-3f32..1.5, degrees in 0.0f32..180.0) {
            let texel = Texel { alpha_x: ax, alpha_y: ay, axis: Axis::from_degrees(degrees) };
            prop_assert_eq!(Stretched::from(texel).to_texel(ax >= ay), texel);
        }
    }
}
