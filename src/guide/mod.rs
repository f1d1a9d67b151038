//! Guides: shapes that an artist moves about, and the smoothest line field between them.
//!
//! A field of lines has no signs, so it is found as its double angle z = (cos 2θ, sin 2θ), in which 10° and 190° are one
//! number and "smooth" is a linear matter: of all fields the one is taken that makes the integral of |∇z|² + w |z - t|²
//! least, with t the direction and w the weight of the guides (Knöppel, Crane, Pinkall and Schröder 2013, "Globally optimal
//! direction fields", on their smoothness energy for n = 2 and soft alignment; the length of z is left free, as there, which
//! keeps it linear and lets the field choose its own singular points). On the flat square that UV is, the connection is
//! trivial and the energy is -Δz + w z = w t, two Poisson problems with one matrix, solved by [`multigrid`](Solver). The
//! simpler choice, z of unit length everywhere, is not convex: it jumps when a guide moves a little, and stays in the first
//! valley found.
//!
//! What a place is to a guide is told in `hold.rs`, and so is why a field changes smoothly with its guides.

mod draw;
mod field;
mod handles;
mod hold;
mod multigrid;
mod shape;

pub use field::{Detail, LineField, Solver};
pub use handles::{Handle, HandleKind, Modifiers};
pub use multigrid::Solved;
pub use shape::{Guide, Mode, POINTS_MAX, Shape};

use crate::error::{Error, Result};
use crate::map::Size;
use crate::pattern::{Parameter, check};
use serde::{Deserialize, Serialize};

/// The most guides of one layer.
pub const GUIDES_MAX: usize = 256;
/// The weight of a place that guides hold wholly, per cell: a field tied by it keeps to its guide within 2 % of what one
/// cell would let it stray.
const WEIGHT_MAX: f32 = 64.0;

/// Guides and the field between them: the source of a layer, which touches only the direction unless it has widths.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Guides {
    /// Cells of the field along the longer side of the surface, 16 to 4096. Default 1024. The field is solved once on it and
    /// sampled, so every size of the map and every part of it agrees.
    pub grid: u32,
    /// The solve ends when a cycle turns no direction by more, degrees, 1e-4 to 1. Default 0.01.
    pub tolerance: f32,
    /// Slope width along the lines. Default: 0.06, and the layer leaves widths alone when neither is given.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub alpha_along: Option<f32>,
    /// Slope width across the lines. Default: 0.25, likewise.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub alpha_across: Option<f32>,
    /// Whether the layer shows only where guides hold, fading with their falloff, and not between them. Default false.
    pub only_near: bool,
    /// The guides; each lies over those before it. Default: none, and the layer shows nothing.
    pub guide: Vec<Guide>,
}

impl Default for Guides {
    fn default() -> Self {
        Self {
            grid: 1024,
            tolerance: 0.01,
            alpha_along: None,
            alpha_across: None,
            only_near: false,
            guide: Vec::new(),
        }
    }
}

impl Guides {
    /// Its own numbers with units and ranges; [`Guide::PARAMETERS`] has those of a guide.
    pub const PARAMETERS: &[Parameter] = &[
        Parameter::new(
            "grid",
            "cells",
            16.0..=4096.0,
            "cells of the field along the longer side",
        ),
        Parameter::new(
            "tolerance",
            "degrees",
            1e-4..=1.0,
            "the solve ends when a cycle turns no direction by more",
        ),
        Parameter::alpha("alpha_along", "width along the lines; default 0.06"),
        Parameter::alpha("alpha_across", "width across the lines; default 0.25"),
    ];

    /// Whether it has widths of its own to lay.
    pub fn has_widths(&self) -> bool {
        self.alpha_along.is_some() || self.alpha_across.is_some()
    }

    /// The widths (along, across) that it lays where the layer touches them.
    pub fn widths(&self) -> (f32, f32) {
        (
            self.alpha_along.unwrap_or(0.06),
            self.alpha_across.unwrap_or(0.25),
        )
    }

    /// Checks every number against its range.
    ///
    /// # Errors
    /// [`Error::Invalid`] whose `what` is the key inside the table: `guide.0.shape.ellipse.radii`.
    pub fn check(&self) -> Result<()> {
        check(
            &Guides {
                guide: Vec::new(),
                ..*self
            },
            Self::PARAMETERS,
        )?;
        if self.guide.len() > GUIDES_MAX {
            return Err(Error::invalid(
                "guide",
                format!("a list of {}", self.guide.len()),
                format!("allowed: at most {GUIDES_MAX}"),
            ));
        }
        for (i, guide) in self.guide.iter().enumerate() {
            guide.check().map_err(|error| match error {
                Error::Invalid {
                    what,
                    value,
                    allowed,
                    hint,
                } => Error::Invalid {
                    what: format!("guide.{i}.{what}"),
                    value,
                    allowed,
                    hint,
                },
                other => other,
            })?;
        }
        Ok(())
    }

    /// The grid on a surface of this aspect, width over height: cells as square as whole numbers of them allow.
    ///
    /// # Errors
    /// When `grid` is out of range.
    pub fn grid_size(&self, aspect: f32) -> Result<Size> {
        grid_size(self.grid, aspect)
    }
}

fn grid_size(cells: u32, aspect: f32) -> Result<Size> {
    let shorter = (f64::from(cells) * f64::from(aspect.min(1.0 / aspect))).round() as u32;
    if aspect >= 1.0 {
        Size::new(cells, shorter.max(1))
    } else {
        Size::new(shorter.max(1), cells)
    }
}

#[cfg(test)]
mod tests;
