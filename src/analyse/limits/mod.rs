//! Where the mathematics of anisotropic reflection fails in practice, and proof on this machine that the program does not.
//!
//! [`LIMITS`] is the table: a row for each failure mode, with the form that is usually written, what becomes of it, the form
//! that the program has instead, and how far that one may be off. Each row measures both by running them: the usual form
//! stands here, ours is the code that fills maps and draws pictures. The functions behind the rows say what becomes of the
//! usual form, and why. `docs/limits.md` shows the table, and `anisomap chart --stability` prints what it measures here.
//!
//! Three things hold for all rows. What is off is told relative to f64 at the very f32 numbers that both forms are given, or
//! against a value that is known. Rows that count bad values count wrong ones too, so that no light at all does not pass for
//! safe light. And a row proves something only where the usual form is off by more than [`Limit::broken`]; a test asks it of
//! every row.

mod edges;
mod frames;
mod shading;
mod stage;
mod texels;

pub(crate) use shading::{SPECULAR, Turned, direction, mirrored, through_kernel};

use crate::error::Result;
use serde::Serialize;
use std::fmt::Write;

/// What both forms made of the same inputs, in the unit of the row's measure.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Evidence {
    /// The usual form; infinite where it gave a NaN or an infinity.
    pub naive: f64,
    /// Ours.
    pub ours: f64,
}

impl Evidence {
    const NONE: Self = Self {
        naive: 0.0,
        ours: 0.0,
    };
}

/// What a row counts or measures.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Measure {
    /// The largest relative error against f64.
    Error,
    /// How many values are NaN, infinite, negative, or otherwise wrong.
    Count,
    /// The largest error of a direction in degrees.
    Degrees,
    /// Samples of a picture that are wrong.
    Samples,
}

impl Measure {
    /// A number of this kind in words.
    pub fn show(self, x: f64) -> String {
        match self {
            _ if !x.is_finite() => "not finite".to_owned(),
            Self::Count => format!("{x} bad"),
            Self::Samples => format!("{x} wrong"),
            Self::Degrees => format!("{} degrees", significant(x)),
            Self::Error if x == 0.0 => "0".to_owned(),
            Self::Error if x >= 9.995 => format!("{x:.0} times"),
            Self::Error if x >= 0.001 => format!("{} %", significant(100.0 * x)),
            Self::Error => format!("{x:.0e}"),
        }
    }
}

/// Two digits that count.
fn significant(x: f64) -> String {
    if x >= 9.95 {
        format!("{x:.0}")
    } else if x >= 0.995 {
        format!("{x:.1}")
    } else {
        format!("{x:.2}")
    }
}

/// A failure mode.
#[derive(Clone, Copy, Debug)]
pub struct Limit {
    /// Its number in the table, from 1.
    pub number: u8,
    /// Its name, for scripts; names are never changed.
    pub name: &'static str,
    /// When it happens.
    pub case: &'static str,
    /// What is usually written, and what becomes of it.
    pub naive: &'static str,
    /// What the program does instead.
    pub ours: &'static str,
    /// Where that lives.
    pub place: &'static str,
    /// What is measured.
    pub measure: Measure,
    /// The usual form counts as broken above this.
    pub broken: f64,
    /// Ours is at most this.
    pub bound: f64,
    evidence: fn() -> Result<Evidence>,
}

impl Limit {
    /// Runs both forms on this machine; a fraction of a second.
    ///
    /// # Errors
    /// When a row that writes and reads a file finds no place for it.
    pub fn evidence(&self) -> Result<Evidence> {
        (self.evidence)()
    }

    /// Whether ours keeps its bound.
    pub fn holds(&self, evidence: Evidence) -> bool {
        evidence.ours <= self.bound
    }

    /// Whether the usual form fails, so that the row shows something.
    pub fn breaks(&self, evidence: Evidence) -> bool {
        evidence.naive > self.broken
    }
}

/// The table as Markdown, with bounds and without what a machine measures.
pub fn table() -> String {
    let mut text = String::from("| # | case | usually | here | bound |\n|---|---|---|---|---|\n");
    for l in &LIMITS {
        let _ = writeln!(
            text,
            "| {} | {} | {} | {} | {} |",
            l.number,
            l.case,
            l.naive,
            l.ours,
            l.measure.show(l.bound)
        );
    }
    text
}

/// |got/want - 1|, infinite where it is no number.
fn relative(got: f32, want: f64) -> f64 {
    let error = (f64::from(got) / want - 1.0).abs();
    if error.is_nan() { f64::INFINITY } else { error }
}

/// Raises `to` to `x`.
fn worst(to: &mut f64, x: f64) {
    *to = to.max(if x.is_nan() { f64::INFINITY } else { x });
}

/// Whether a number is no amount of light.
fn bad(x: f32) -> bool {
    !(0.0..f32::INFINITY).contains(&x)
}

/// Every failure mode: 1 to 21 of shading, texels and frames, 22 to 24 of the rasteriser.
pub static LIMITS: [Limit; 24] = [
    Limit {
        number: 1,
        name: "near-the-normal",
        case: "half vectors near the normal, alpha 0.001",
        naive: "angles by `acos`: 25 % off",
        ours: "slopes from dot products",
        place: "brdf/mod.rs",
        measure: Measure::Error,
        broken: 0.1,
        bound: 1e-5,
        evidence: shading::near_the_normal,
    },
    Limit {
        number: 2,
        name: "horizon",
        case: "light or viewer at the horizon",
        naive: "f_r, then times n.l: NaN",
        ours: "one expression, n.v at least 1e-4",
        place: "brdf/mod.rs",
        measure: Measure::Count,
        broken: 0.0,
        bound: 0.0,
        evidence: shading::at_the_horizon,
    },
    Limit {
        number: 3,
        name: "bent-normals",
        case: "normals bent away from the viewer",
        naive: "root of a negative: NaN",
        ours: "signs tested, n.v raised",
        place: "brdf/mod.rs, preview/packed.rs",
        measure: Measure::Count,
        broken: 0.0,
        bound: 0.0,
        evidence: shading::bent_normals,
    },
    Limit {
        number: 4,
        name: "opposite",
        case: "light and viewer opposite",
        naive: "H = 0 normalised: NaN",
        ours: "H keeps its length",
        place: "brdf/ward.rs, brdf/kernel.rs",
        measure: Measure::Count,
        broken: 0.0,
        bound: 0.0,
        evidence: shading::opposite_directions,
    },
    Limit {
        number: 5,
        name: "grazing-half-vector",
        case: "half vectors at the horizon",
        naive: "divided by Hz⁴: NaN",
        ours: "Hz at least 1e-4",
        place: "brdf/ward_bounded.rs, brdf/kernel.rs",
        measure: Measure::Count,
        broken: 0.0,
        bound: 0.0,
        evidence: shading::grazing_half_vector,
    },
    Limit {
        number: 6,
        name: "extreme-widths",
        case: "alpha 0, negative, 1e-45, 1e30",
        naive: "1/alpha²: infinite, negative",
        ours: "alpha at least 0.001",
        place: "brdf/mod.rs",
        measure: Measure::Count,
        broken: 0.0,
        bound: 0.0,
        evidence: shading::extreme_widths,
    },
    Limit {
        number: 7,
        name: "underflow",
        case: "the far tail of a lobe",
        naive: "denormal numbers, slow",
        ours: "0 past k = 80",
        place: "brdf/mod.rs, brdf/kernel.rs",
        measure: Measure::Count,
        broken: 0.0,
        bound: 0.0,
        evidence: shading::underflow,
    },
    Limit {
        number: 8,
        name: "ratio",
        case: "widths a thousand apart",
        naive: "a matrix: 21 % off",
        ours: "(cos θ, sin θ, 1/alpha_x, 1/alpha_y)",
        place: "brdf/kernel.rs",
        measure: Measure::Error,
        broken: 0.1,
        bound: 1e-3,
        evidence: shading::extreme_ratios,
    },
    Limit {
        number: 9,
        name: "halves",
        case: "half floats, alpha 0.003",
        naive: "a matrix: infinite",
        ours: "widths and double angle",
        place: "export/exr.rs, import/exr.rs",
        measure: Measure::Error,
        broken: 0.2,
        bound: 0.02,
        evidence: texels::halves,
    },
    Limit {
        number: 10,
        name: "8-bit-widths",
        case: "8-bit widths, alpha 0.01",
        naive: "linear: 20 % off",
        ours: "square roots",
        place: "export/png.rs",
        measure: Measure::Error,
        broken: 0.1,
        bound: 0.05,
        evidence: texels::eight_bit_widths,
    },
    Limit {
        number: 11,
        name: "8-bit-directions",
        case: "8-bit directions",
        naive: "angle: 0.35 degrees off",
        ours: "double angle",
        place: "export/png.rs",
        measure: Measure::Degrees,
        broken: 0.3,
        bound: 0.2,
        evidence: texels::eight_bit_directions,
    },
    Limit {
        number: 12,
        name: "wrap",
        case: "from 179 to 1 degree, seams",
        naive: "angles blended: 90 degrees off",
        ours: "double angles blended",
        place: "map/sample.rs, preview/packed.rs",
        measure: Measure::Degrees,
        broken: 45.0,
        bound: 0.01,
        evidence: texels::wrap,
    },
    Limit {
        number: 13,
        name: "crossings",
        case: "directions that cross",
        naive: "no length normalised: NaN",
        ours: "round, of the same area",
        place: "map/mod.rs, preview/packed.rs",
        measure: Measure::Count,
        broken: 0.0,
        bound: 0.0,
        evidence: texels::crossings,
    },
    Limit {
        number: 14,
        name: "magnified",
        case: "magnified grooves, 30 degrees apart",
        naive: "covariances blended: 61 % off",
        ours: "widths, double angles blended",
        place: "map/sample.rs, preview/packed.rs",
        measure: Measure::Error,
        broken: 0.5,
        bound: 3e-6,
        evidence: texels::magnified,
    },
    Limit {
        number: 15,
        name: "minified",
        case: "a map in one pixel",
        naive: "widths, angles averaged: 186 % off",
        ours: "footprint sampled",
        place: "filter/pyramid.rs, preview/packed.rs",
        measure: Measure::Error,
        broken: 0.5,
        bound: 0.01,
        evidence: texels::minified,
    },
    Limit {
        number: 16,
        name: "radial-centre",
        case: "around a disc's centre",
        naive: "angles blended: 90 degrees off",
        ours: "double angles blended",
        place: "map/sample.rs, preview/packed.rs",
        measure: Measure::Degrees,
        broken: 45.0,
        bound: 1.2,
        evidence: texels::radial_centre,
    },
    Limit {
        number: 17,
        name: "loose-frames",
        case: "short or leaning frames",
        naive: "used unmended: 58 % off",
        ours: "made orthonormal per sample",
        place: "preview/packed.rs, math.rs",
        measure: Measure::Error,
        broken: 0.2,
        bound: 1e-5,
        evidence: frames::loose_frames,
    },
    Limit {
        number: 18,
        name: "no-tangent",
        case: "no tangent",
        naive: "normalised: NaN",
        ours: "round, of the same variance",
        place: "preview/packed.rs, math.rs",
        measure: Measure::Error,
        broken: 1.0,
        bound: 1e-5,
        evidence: frames::no_tangent,
    },
    Limit {
        number: 19,
        name: "unreadable-texels",
        case: "NaN and infinities in a file",
        naive: "all around is lost",
        ours: "mended and counted",
        place: "import/exr.rs, map/region.rs",
        measure: Measure::Count,
        broken: 0.0,
        bound: 0.0,
        evidence: texels::unreadable_texels,
    },
    Limit {
        number: 20,
        name: "powers",
        case: "powers of h.n",
        naive: "Ashikhmin-Shirley: 0/0",
        ours: "logarithm from slopes",
        place: "brdf/blinn_phong.rs",
        measure: Measure::Error,
        broken: 0.1,
        bound: 1e-5,
        evidence: shading::power_of_the_half_vector,
    },
    Limit {
        number: 21,
        name: "clamped-visibility",
        case: "GGX mirrored at 85 degrees",
        naive: "V clamped to 1: 95 % gone",
        ours: "no clamp",
        place: "brdf/ggx.rs",
        measure: Measure::Error,
        broken: 0.5,
        bound: 1e-5,
        evidence: shading::clamped_visibility,
    },
    Limit {
        number: 22,
        name: "needles",
        case: "triangles thinner than a sample",
        naive: "samples with two owners",
        ours: "fixed point, top-left rule",
        place: "raster/visibility.rs",
        measure: Measure::Samples,
        broken: 0.0,
        bound: 0.0,
        evidence: edges::needles,
    },
    Limit {
        number: 23,
        name: "shared-edges",
        case: "edges through samples",
        naive: "two owners",
        ours: "fixed point, top-left rule",
        place: "raster/visibility.rs",
        measure: Measure::Samples,
        broken: 0.0,
        bound: 0.0,
        evidence: edges::shared_edges,
    },
    Limit {
        number: 24,
        name: "behind-the-eye",
        case: "triangles behind the eye",
        naive: "x/w: turned over",
        ours: "cut at the near plane",
        place: "raster/clip.rs, raster/resolve.rs",
        measure: Measure::Samples,
        broken: 0.0,
        bound: 0.0,
        evidence: edges::behind_the_eye,
    },
];

#[cfg(test)]
mod tests;
