//! Numbers to colours on log scales: the widths, and their ratio.

use super::Averages;
use super::levels::Averaged;
use super::palette::{self, COLOURS, Table};
use crate::map::{ALPHA_MAX, ALPHA_MIN};
use crate::math;
use fearless_simd::{Simd, dispatch};
use fearless_simd_macros::simd;

/// Which alphas have which colours: logarithmic, the smaller the darker; those beyond an end have its colour.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AlphaRange {
    /// The alpha of the darkest colour, in [`ALPHA_MIN`] up to under `high`.
    pub low: f32,
    /// The alpha of the lightest colour, over `low` to [`ALPHA_MAX`].
    pub high: f32,
}

impl Default for AlphaRange {
    /// What ordinary surfaces have: 0.01 to 1.
    fn default() -> Self {
        Self {
            low: 0.01,
            high: 1.0,
        }
    }
}

impl AlphaRange {
    /// The range from one number of the row ... 0.1, 0.2, 0.5, 1 ... to another that holds the alphas of a map.
    pub fn of(averages: &Averages) -> Self {
        let (mut low, mut high) = (f32::INFINITY, 0.0f32);
        for texel in averages.coarse() {
            low = low.min(texel[0].min(texel[1]));
            high = high.max(texel[0].max(texel[1]));
        }
        if !(low > 0.0 && high.is_finite()) {
            return Self::default();
        }
        // Means of squares.
        let (low, high) = (rounded_down(low.sqrt()), rounded_up(high.sqrt()));
        if high > 1.9 * low {
            Self { low, high }.usable()
        } else {
            Self {
                low: rounded_down(0.7 * low),
                high: rounded_up(1.4 * high),
            }
            .usable()
        }
    }

    /// The nearest range that can be drawn.
    pub(super) fn usable(self) -> Self {
        let (low, high) = (self.low.max(ALPHA_MIN), self.high.min(ALPHA_MAX));
        if low < 0.99 * high {
            Self { low, high }
        } else {
            Self::default()
        }
    }

    /// Where an alpha stands, 0 at the low end, 1 at the high one.
    pub fn place(self, alpha: f32) -> f32 {
        let Self { low, high } = self.usable();
        ((alpha / low).ln() / (high / low).ln()).clamp(0.0, 1.0)
    }
}

/// The numbers 1, 2, 5 times powers of ten.
const ROW: [f32; 11] = [
    0.001, 0.002, 0.005, 0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1.0, 1.5,
];

fn rounded_down(alpha: f32) -> f32 {
    let under = ROW.iter().rev().find(|r| **r <= alpha * 1.001);
    under.copied().unwrap_or(ALPHA_MIN)
}

fn rounded_up(alpha: f32) -> f32 {
    let over = ROW.iter().find(|r| **r >= alpha * 0.999);
    over.copied().unwrap_or(ALPHA_MAX)
}

/// Which ratios alpha_x / alpha_y have which colours: logarithmic around 1, from `1 / most` to `most`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RatioRange {
    /// The ratio of the last colour, over 1 to 1500.
    pub most: f32,
}

impl Default for RatioRange {
    /// 1/10 to 10.
    fn default() -> Self {
        Self { most: 10.0 }
    }
}

impl RatioRange {
    /// The nearest range that can be drawn.
    pub(super) fn usable(self) -> Self {
        if self.most > 1.01 && self.most.is_finite() {
            Self {
                most: self.most.min(ALPHA_MAX / ALPHA_MIN),
            }
        } else {
            Self::default()
        }
    }

    /// Where a ratio stands: 0 for `1 / most`, 0.5 for 1, 1 for `most`.
    pub fn place(self, ratio: f32) -> f32 {
        (0.5 + 0.5 * ratio.ln() / self.usable().most.ln()).clamp(0.0, 1.0)
    }
}

/// Places in a table: `weights` of the logarithms of the mean squares, and an offset.
struct Logarithms {
    weights: [f32; 2],
    offset: f32,
}

/// Pixels at once.
const CHUNK: usize = 256;

#[simd]
fn places<S: Simd>(_: S, seen: &[Averaged], by: &Logarithms, places: &mut [u32]) {
    const LAST: f32 = (COLOURS - 1) as f32;
    let n = seen.len().min(CHUNK);
    let places = &mut places[..n];
    for i in 0..n {
        let log = |x: f32| math::ln(if x > 1e-12 { x } else { 1e-12 });
        let t = by.offset + by.weights[0] * log(seen[i][0]) + by.weights[1] * log(seen[i][1]);
        let t = if t < 0.0 { 0.0 } else { t };
        let t = if t > LAST { LAST } else { t };
        places[i] = math::whole(math::round_fast(t)) as u32;
    }
}

fn colour(seen: &[Averaged], by: &Logarithms, table: &Table, rgba: &mut [u8]) {
    let mut at = [0; CHUNK];
    for (seen, rgba) in seen.chunks(CHUNK).zip(rgba.chunks_mut(4 * CHUNK)) {
        dispatch!(math::level(), simd => places(simd, seen, by, &mut at));
        for (out, &place) in rgba.chunks_exact_mut(4).zip(&at) {
            out.copy_from_slice(&table[place as usize % COLOURS]);
        }
    }
}

/// Widths along x (`axis` 0) or across (1).
pub(super) fn alphas(seen: &[Averaged], axis: usize, range: AlphaRange, rgba: &mut [u8]) {
    let AlphaRange { low, high } = range.usable();
    let scale = (COLOURS - 1) as f32 / (high / low).ln();
    let mut weights = [0.0; 2];
    weights[axis] = 0.5 * scale;
    let offset = -low.ln() * scale;
    colour(
        seen,
        &Logarithms { weights, offset },
        palette::rising(),
        rgba,
    );
}

/// alpha_x / alpha_y.
pub(super) fn ratios(seen: &[Averaged], range: RatioRange, rgba: &mut [u8]) {
    let scale = 0.5 * (COLOURS - 1) as f32 / range.usable().most.ln();
    let by = Logarithms {
        weights: [0.5 * scale, -0.5 * scale],
        offset: 0.5 * (COLOURS - 1) as f32,
    };
    colour(seen, &by, palette::diverging(), rgba);
}
