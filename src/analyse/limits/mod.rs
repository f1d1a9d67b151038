//! Where the mathematics of anisotropic reflection fails in practice, and proof on this machine that the program does not.
//!
//! [`LIMITS`] is the table: a row for each failure mode, with the form that is usually written, what becomes of it, the form
//! that the program has instead, and how far that one may be off. Each row measures both by running them: the usual form
//! stands here, ours is the code that fills maps and draws pictures. `docs/limits.md` shows the table, and
//! `anisomap chart --stability` prints what it measures here.

mod edges;
mod frames;
mod shading;
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
    /// How many values are NaN, infinite, negative, or otherwise none.
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
    let mut text = String::from(
        "| # | case | the usual form | here | where | broken above | bound |\n|---|---|---|---|---|---|---|\n",
    );
    for l in &LIMITS {
        let _ = writeln!(
            text,
            "| {} | {} | {} | {} | `{}` | {} | {} |",
            l.number,
            l.case,
            l.naive,
            l.ours,
            l.place,
            l.measure.show(l.broken),
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
        case: "the half vector near the normal, alpha down to 0.001",
        naive: "angles by `acos` and `atan2`, then tan²: a quarter of the light off inside three widths at 0.001",
        ours: "slopes from dot products, never an angle and never 1 - (h.n)²",
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
        naive: "f_r, then times n.l: infinite or NaN where n.l n.v underflows",
        ours: "f_r n.l as one expression, n.v held above 1e-4, 0 at and under the horizon",
        place: "brdf/mod.rs",
        measure: Measure::Count,
        broken: 0.0,
        bound: 0.0,
        evidence: shading::at_the_horizon,
    },
    Limit {
        number: 3,
        name: "bent-normals",
        case: "shading normals bent away from the viewer",
        naive: "the root of a negative n.l n.v: NaN",
        ours: "a test of the signs around every formula; the preview raises n.v at outlines to what the sample shows on the mean",
        place: "brdf/mod.rs, preview/packed.rs",
        measure: Measure::Count,
        broken: 0.0,
        bound: 0.0,
        evidence: shading::bent_normals,
    },
    Limit {
        number: 4,
        name: "opposite",
        case: "light and viewer opposite, l = -v",
        naive: "H = 0 is normalised: NaN",
        ours: "H keeps its length, which cancels",
        place: "brdf/ward.rs, brdf/kernel.rs",
        measure: Measure::Count,
        broken: 0.0,
        bound: 0.0,
        evidence: shading::opposite_directions,
    },
    Limit {
        number: 5,
        name: "grazing-half-vector",
        case: "the half vector at the horizon",
        naive: "`ward-bounded` over Hz⁴, which underflows at Hz of 1e-11: inf times 0",
        ours: "n.v and so Hz held above 1e-4, the quotient taken in two steps, 0 past k = 80",
        place: "brdf/ward_bounded.rs",
        measure: Measure::Count,
        broken: 0.0,
        bound: 0.0,
        evidence: shading::grazing_half_vector,
    },
    Limit {
        number: 6,
        name: "extreme-widths",
        case: "alpha of 0, negative, denormal, 1e-20, 10",
        naive: "1/(4 pi alpha²) is infinite at 1e-20, times 0 a NaN; a negative alpha gives negative light",
        ours: "widths raised to 0.001 where light is computed",
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
        naive: "`exp` gives denormal numbers from k = 87.4 to 103, which many processors take much longer over",
        ours: "0 past k = 80, under 2e-35 of the peak",
        place: "brdf/mod.rs, brdf/kernel.rs",
        measure: Measure::Count,
        broken: 0.0,
        bound: 0.0,
        evidence: shading::underflow,
    },
    Limit {
        number: 8,
        name: "ratio",
        case: "widths a thousand apart, turned",
        naive: "the lobe as a matrix R diag(1/alpha²) Rᵀ: its terms cancel, a fifth of the light off inside two widths at (0.001, 1)",
        ours: "(cos θ, sin θ, 1/alpha_x, 1/alpha_y), never a matrix",
        place: "brdf/kernel.rs",
        measure: Measure::Error,
        broken: 0.1,
        bound: 1e-3,
        evidence: shading::extreme_ratios,
    },
    Limit {
        number: 9,
        name: "halves",
        case: "texels as half floats, alpha down to 0.003",
        naive: "the matrix in halves: not finite where 1/alpha² is over 65504",
        ours: "alphas and the double angle in halves; `inspect` tells where that costs some percent",
        place: "export/exr.rs, import/exr.rs",
        measure: Measure::Error,
        broken: 0.2,
        bound: 0.02,
        evidence: texels::halves,
    },
    Limit {
        number: 10,
        name: "8-bit-widths",
        case: "widths in 8 bits, from alpha 0.01",
        naive: "linear: 20 % off just above 0.01, and under 0.003 nothing is left",
        ours: "square roots in 8 bits, 16 bits where it counts",
        place: "export/png.rs",
        measure: Measure::Error,
        broken: 0.1,
        bound: 0.05,
        evidence: texels::eight_bit_widths,
    },
    Limit {
        number: 11,
        name: "8-bit-directions",
        case: "directions in 8 bits",
        naive: "the angle: 0.35 degrees off, and not to be filtered",
        ours: "the double angle: half of that; no 8-bit angle is written",
        place: "export/png.rs",
        measure: Measure::Degrees,
        broken: 0.3,
        bound: 0.2,
        evidence: texels::eight_bit_directions,
    },
    Limit {
        number: 12,
        name: "wrap",
        case: "between 1 and 179 degrees, inside the map and over its seam",
        naive: "the blend of the angles: 90 degrees off",
        ours: "the blend of (cos 2θ, sin 2θ)",
        place: "map/sample.rs",
        measure: Measure::Degrees,
        broken: 45.0,
        bound: 0.01,
        evidence: texels::wrap,
    },
    Limit {
        number: 13,
        name: "crossings",
        case: "between directions at right angles",
        naive: "a vector of no length is normalised: NaN",
        ours: "where the length is under 0.001 the texel is round, of the same area",
        place: "map/mod.rs",
        measure: Measure::Count,
        broken: 0.0,
        bound: 0.0,
        evidence: texels::crossings,
    },
    Limit {
        number: 14,
        name: "magnified",
        case: "magnified, grooves 30 degrees apart, ratio 5",
        naive: "the blend of covariances swells the thin width by 61 %",
        ours: "widths and double angles are blended",
        place: "map/sample.rs",
        measure: Measure::Error,
        broken: 0.5,
        bound: 1e-6,
        evidence: texels::magnified,
    },
    Limit {
        number: 15,
        name: "minified",
        case: "a whole map in one pixel, grooves within 30 degrees, ratio 5",
        naive: "the mean of widths and double angles: the slope variance along u is 68 % short",
        ours: "the mean of slope covariances, which is exact",
        place: "filter/pyramid.rs",
        measure: Measure::Error,
        broken: 0.5,
        bound: 1e-5,
        evidence: texels::minified,
    },
    Limit {
        number: 16,
        name: "radial-centre",
        case: "around the centre of a turned disc, from two texels on",
        naive: "the blend of angles: 90 degrees off on a whole ray",
        ours: "the blend of double angles: 1.1 degrees at two texels, less beyond",
        place: "map/sample.rs",
        measure: Measure::Degrees,
        broken: 45.0,
        bound: 1.2,
        evidence: texels::radial_centre,
    },
    Limit {
        number: 17,
        name: "loose-frames",
        case: "interpolated normals and tangents: short by 3 %, leaning by 1 degree",
        naive: "used as they come: up to 58 % of the light off two widths from the peak",
        ours: "the frame is made orthonormal at every sample",
        place: "preview/packed.rs, math.rs",
        measure: Measure::Error,
        broken: 0.2,
        bound: 1e-5,
        evidence: frames::loose_frames,
    },
    Limit {
        number: 18,
        name: "no-tangent",
        case: "a tangent that is zero, along the normal, or not finite",
        naive: "it is normalised: NaN",
        ours: "any perpendicular, and a round lobe of the same slope variance",
        place: "preview/packed.rs, math.rs",
        measure: Measure::Error,
        broken: 1.0,
        bound: 1e-5,
        evidence: frames::no_tangent,
    },
    Limit {
        number: 19,
        name: "unreadable-texels",
        case: "NaN, infinite and negative texels in a file",
        naive: "every fetch beside them and every mip level above them is lost",
        ours: "mended and counted as they enter a map; `inspect` tells",
        place: "map/region.rs",
        measure: Measure::Count,
        broken: 0.0,
        bound: 0.0,
        evidence: texels::unreadable_texels,
    },
    Limit {
        number: 20,
        name: "powers",
        case: "powers of h.n at and near h = n, alpha down to 0.001",
        naive: "Ashikhmin and Shirley's exponent is 0/0 at the peak, and h.n near it is nothing but rounding",
        ours: "no such model here; Blinn-Phong takes ln(h.n) = -ln(1 + slope²)/2 from the slopes",
        place: "brdf/blinn_phong.rs",
        measure: Measure::Error,
        broken: 0.1,
        bound: 1e-5,
        evidence: shading::power_of_the_half_vector,
    },
    Limit {
        number: 21,
        name: "clamped-visibility",
        case: "GGX mirrored at 85 degrees, alpha 0.1",
        naive: "V = G/(4 n.l n.v) clamped to 1, as the glTF sample viewer does: 95 % of the light is gone",
        ours: "no clamp; that viewer is darker at outlines",
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
        naive: "inside where no edge function is negative: samples with two owners",
        ours: "24.8 fixed point and the top-left rule",
        place: "raster/visibility.rs",
        measure: Measure::Samples,
        broken: 0.0,
        bound: 0.0,
        evidence: edges::needles,
    },
    Limit {
        number: 23,
        name: "shared-edges",
        case: "corners and edges on the centres of samples",
        naive: "the same test: every sample on an edge has two owners and more",
        ours: "24.8 fixed point and the top-left rule: one owner each",
        place: "raster/visibility.rs",
        measure: Measure::Samples,
        broken: 0.0,
        bound: 0.0,
        evidence: edges::shared_edges,
    },
    Limit {
        number: 24,
        name: "behind-the-eye",
        case: "triangles that reach behind the eye, w through 0",
        naive: "x/w and y/w of each corner: what is behind comes out turned over",
        ours: "cut at the near plane, attributes from homogeneous edge functions",
        place: "raster/clip.rs, raster/resolve.rs",
        measure: Measure::Samples,
        broken: 0.0,
        bound: 0.0,
        evidence: edges::behind_the_eye,
    },
];

#[cfg(test)]
mod tests;
