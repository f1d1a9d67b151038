//! What a map is like: its statistics, what is wrong with it, and how far it is from another; and how far apart two pictures
//! are to the eye.
//!
//! Every pass runs over stretches of a fixed number of texels on all cores and combines them in order, with sums in f64 or in
//! whole numbers, so the same map gives the same answer on any number of threads.

mod albedo;
mod colour;
mod compare;
mod field;
mod flip;
mod histogram;
pub mod limits;
mod lint;
mod marks;
pub mod reduce;
mod statistics;

pub use albedo::{ALBEDO_DEGREES_MAX, Albedo, largest_albedo, lint_energy};
pub use colour::ColourDifference;
pub use compare::{AngleErrors, Comparison, Errors, WidthErrors, compare};
pub use flip::{Flip, PIXELS_PER_DEGREE};
pub use lint::{Finding, Severity, lint};
pub use marks::{Border, Marks, Pole, Seam, TexelMark};
pub use statistics::{Directions, Spread, Statistics};

use crate::map::Texel;
use rayon::prelude::*;
use serde::Serialize;
use std::ops::Range;

/// A texel whose widths differ by no more than this factor looks isotropic: under rule A of an invisible error in an 8-bit
/// picture (FLIP at most 0.025, dE76 at most 0.8, measured on a lit sphere).
pub const ISOTROPIC_RATIO: f32 = 1.006;

/// A texel has a direction worth measuring when its widths differ by more than this factor. At less, turning the texel by any
/// angle changes a preview by less than a glance finds (FLIP mean 0.01).
pub const DIRECTED_RATIO: f32 = 1.05;

/// A place in the map.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct Place {
    /// Column, from the left, 0 first.
    pub x: u32,
    /// Row, from the top, 0 first.
    pub y: u32,
}

impl Place {
    fn of(index: usize, width: u32) -> Self {
        let width = width as usize;
        let whole = |i: usize| u32::try_from(i).expect("a side of a map fits 32 bits");
        Self {
            x: whole(index % width),
            y: whole(index / width),
        }
    }
}

/// Texels that one thread takes at a time. Fixed, since the sums depend on where the cuts lie.
const STRETCH: usize = 1 << 18;

/// `work` on each stretch of `texels` texels, the results in order.
fn by_stretches<T: Send>(texels: usize, work: impl Fn(Range<usize>) -> T + Sync) -> Vec<T> {
    (0..texels.div_ceil(STRETCH))
        .into_par_iter()
        .map(|i| work(i * STRETCH..texels.min((i + 1) * STRETCH)))
        .collect()
}

/// The larger and the smaller width.
fn sorted(texel: Texel) -> (f32, f32) {
    (
        texel.alpha_x.max(texel.alpha_y),
        texel.alpha_x.min(texel.alpha_y),
    )
}
