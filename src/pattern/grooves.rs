//! Grooves: the finish that brushing, turning and drawing leave, as a function of a plane (a, b) that each pattern lays its
//! own way over the surface. Streak noise varies both widths and the direction, and breaks single grooves off.

use super::Surface;
use super::lattice::{Lattice, OCTAVE_VARIANCE, seed32};
use crate::map::{ALPHA_MAX, ALPHA_MIN, RegionMut, Wrap};
use crate::math::{AXIS_MIN_LENGTH, exp, level, sin_cos, smoothstep};
use fearless_simd::{Level, Simd, dispatch};
use fearless_simd_macros::simd;
use glam::Vec2;
use serde::{Deserialize, Serialize};

/// How grooves look, whatever way they run. Widths are root-mean-square values over the surface.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Grooves {
    /// Slope width along the grooves (the narrow way of the lobe).
    pub alpha_along: f32,
    /// Slope width across the grooves.
    pub alpha_across: f32,
    /// Relative spread of `alpha_along` from streak to streak (standard deviation of its logarithm).
    pub spread_along: f32,
    /// Relative spread of `alpha_across`.
    pub spread_across: f32,
    /// Wander of the direction, degrees (standard deviation).
    pub wander: f32,
    /// Share of the surface where a groove is broken off: there the lobe is rounder and the direction less sure.
    pub breaks: f32,
}

impl Default for Grooves {
    fn default() -> Self {
        Self {
            alpha_along: 0.06,
            alpha_across: 0.25,
            spread_along: 0.15,
            spread_across: 0.25,
            wander: 1.5,
            breaks: 0.1,
        }
    }
}

/// A pattern's table of parameters: those of its grooves (their keys after `$prefix`), and its own.
macro_rules! with_grooves {
    ($($prefix:literal)+; $($own:expr),* $(,)?) => {
        &[
            $(
            Parameter::alpha(concat!($prefix, "alpha_along"), "width along the grooves"),
            Parameter::alpha(concat!($prefix, "alpha_across"), "width across the grooves"),
            Parameter::fraction(concat!($prefix, "spread_along"), "relative spread of alpha_along from streak to streak"),
            Parameter::fraction(concat!($prefix, "spread_across"), "relative spread of alpha_across from streak to streak"),
            Parameter::new(concat!($prefix, "wander"), "degrees", 0.0..=30.0, "wander of the direction (standard deviation)"),
            Parameter::fraction(concat!($prefix, "breaks"), "share of the surface where a groove is broken off"),
            )+
            $($own),*
        ]
    };
}
pub(super) use with_grooves;

/// How much rounder a broken groove is: this share of the way to a round lobe of the same area.
const BREAK_STRENGTH: f32 = 0.7;
/// The octaves of the noise: size relative to the streak, weight.
const OCTAVES: [(f32, f32, f32); 3] = [(1.0, 1.0, 0.6), (0.7, 0.5, 0.6), (0.5, 0.25, 0.53)];
/// Texels worked on at once: the arrays of one chunk stay in the first-level cache.
pub(super) const CHUNK: usize = 256;
/// The finest supersampling across the grooves, and along them.
const SAMPLES_MAX: f32 = 64.0;
const SAMPLES_ALONG_MAX: f32 = 16.0;

/// Where the grooves of a prepared pattern lie and how they look.
#[derive(Clone, Debug)]
pub(super) struct Streaks {
    octaves: [Lattice; 3],
    breaks: Lattice,
    ln_along: f32,
    ln_across: f32,
    spread_along: f32,
    spread_across: f32,
    wander: f32,
    break_from: f32,
    /// Points taken per texel, across the grooves and along them, and the steps of the plane between them.
    samples: [usize; 2],
    steps: [Vec2; 2],
}

/// The plane that grooves are laid out in.
#[derive(Clone, Copy, Debug)]
pub(super) struct Plane {
    /// The grooves' direction in the plane.
    pub(super) direction: Vec2,
    /// Length of a streak, in the plane's units along `direction`.
    pub(super) length: f32,
    /// Width of a streak, in the plane's units across `direction`.
    pub(super) width: f32,
    /// Size of the plane, for the directions in which it repeats.
    pub(super) extent: Vec2,
    /// How much lower one turn along a comes back.
    pub(super) twist: f32,
    /// How it repeats.
    pub(super) wrap: Wrap,
    /// What a texel covers of the plane: across the grooves, and along them.
    pub(super) texel: [f32; 2],
}

/// One chunk of texels on its way in: where they lie in the plane, how the grooves run there, and how much they are grooves.
pub(super) struct Chunk {
    pub(super) a: [f32; CHUNK],
    pub(super) b: [f32; CHUNK],
    /// The grooves' direction on the surface, double angle.
    pub(super) cos2: [f32; CHUNK],
    pub(super) sin2: [f32; CHUNK],
    /// 1 where the finish is as stated, 0 where it is round (a pole).
    pub(super) anisotropy: [f32; CHUNK],
    /// Added to the logarithm of both widths.
    pub(super) ln_gain: [f32; CHUNK],
    /// What the texel covers of the plane, relative to what the plane says.
    pub(super) reach: [f32; CHUNK],
}

impl Chunk {
    pub(super) fn new() -> Self {
        let zero = [0.0; CHUNK];
        Self {
            a: zero,
            b: zero,
            cos2: [1.0; CHUNK],
            sin2: zero,
            anisotropy: [1.0; CHUNK],
            ln_gain: zero,
            reach: [1.0; CHUNK],
        }
    }
}

impl Streaks {
    pub(super) fn new(look: &Grooves, plane: &Plane, surface: &Surface, purpose: u32) -> Self {
        let lattice = |length: f32, width: f32, n: u32| {
            Lattice::new(
                plane.direction,
                plane.length * length,
                plane.width * width,
                plane.extent,
                plane.twist,
                plane.wrap,
                seed32(surface.seed, purpose.wrapping_mul(16) + n),
            )
        };
        let octaves = [0, 1, 2].map(|n| lattice(OCTAVES[n].0, OCTAVES[n].1, n as u32));
        let breaks = lattice(0.35, 0.5, 3);
        // Enough points that the finest cells are met at 2/3 of their size; each texel then holds their mean lobe.
        let across = plane.direction.perp() * plane.texel[0];
        let along = plane.direction * plane.texel[1];
        let points = |cells: f32, most: f32| (1.5 * cells).ceil().clamp(1.0, most);
        let samples = [
            points(octaves[2].cells(across).y, SAMPLES_MAX),
            points(breaks.cells(along).x, SAMPLES_ALONG_MAX),
        ];
        let mut streaks = Self {
            octaves,
            breaks,
            ln_along: look.alpha_along.ln(),
            ln_across: look.alpha_across.ln(),
            spread_along: look.spread_along,
            spread_across: look.spread_across,
            wander: look.wander.to_radians(),
            break_from: normal_quantile(1.0 - look.breaks),
            samples: samples.map(|n| n as usize),
            steps: [across / samples[0], along / samples[1]],
        };
        streaks.keep_widths(look, plane.extent);
        streaks
    }

    /// Scales both widths so that their root mean square over the plane is what was asked for: spread and breaks would
    /// otherwise move it. The plane is met at fixed points, so that every size of map gets the same factors.
    fn keep_widths(&mut self, look: &Grooves, extent: Vec2) {
        const POINTS: usize = 2048;
        for _ in 0..3 {
            let mut sum = [0.0f64; 2];
            for n in 0..POINTS {
                // The additive recurrence of the plastic number: even over the unit square.
                let (u, v) = (
                    n as f64 * 0.754_877_666_246_692_7,
                    n as f64 * 0.569_840_290_998_053_2,
                );
                let (a, b) = (u.fract() as f32 * extent.x, v.fract() as f32 * extent.y);
                let [x, y, ..] = self.at(a, b, 1.0, 0.0, 1.0, 0.0);
                sum[0] += f64::from(x * x);
                sum[1] += f64::from(y * y);
            }
            let off = |want: f32, sum: f64| {
                0.5 * (f64::from(want * want) * POINTS as f64 / sum).ln() as f32
            };
            self.ln_along += off(look.alpha_along, sum[0]);
            self.ln_across += off(look.alpha_across, sum[1]);
        }
    }

    /// Fills `n` texels of `out`, beginning at place `at`.
    pub(super) fn fill(
        &self,
        chunk: &Chunk,
        n: usize,
        out: &mut RegionMut<'_>,
        value: &mut [f32],
        at: usize,
    ) {
        let to = at..at + n;
        let planes = [
            &mut out.alpha_x[to.clone()],
            &mut out.alpha_y[to.clone()],
            &mut out.cos2[to.clone()],
            &mut out.sin2[to.clone()],
            &mut value[to],
        ];
        self.fill_planes(level(), chunk, planes);
    }

    fn fill_planes(&self, level: Level, chunk: &Chunk, planes: [&mut [f32]; 5]) {
        if self.samples == [1, 1] {
            dispatch!(level, simd => fill_one(simd, self, chunk, planes));
        } else {
            dispatch!(level, simd => fill_mean(simd, self, chunk, planes));
        }
    }

    /// (alpha along, alpha across, cos 2θ, sin 2θ, value) at one point.
    #[inline(always)]
    fn at(&self, a: f32, b: f32, cos2: f32, sin2: f32, anisotropy: f32, ln_gain: f32) -> [f32; 5] {
        let scale = 1.0 / OCTAVE_VARIANCE.sqrt();
        let (p0, q0) = self.octaves[0].noise(a, b);
        let (p1, q1) = self.octaves[1].noise(a, b);
        let (p2, q2) = self.octaves[2].noise(a, b);
        let (r, t) = self.breaks.noise(a, b);
        // Each of unit variance: the squares of the weights add up to 1.
        let across = scale * (OCTAVES[0].2 * p0 + OCTAVES[1].2 * p1 + OCTAVES[2].2 * p2);
        let turn = scale * (0.8 * q0 + 0.6 * q1);
        let along = scale * (0.6 * t + 0.8 * q2);
        let broken = smoothstep(self.break_from, self.break_from + 0.4, scale * r);
        let la = self.ln_along + self.spread_along * along + ln_gain;
        let lc = self.ln_across + self.spread_across * across + ln_gain;
        let round = 0.5 * BREAK_STRENGTH * broken * (lc - la);
        let x = exp(la + round).clamp(ALPHA_MIN, ALPHA_MAX);
        let y = exp(lc - round).clamp(ALPHA_MIN, ALPHA_MAX);
        // Toward the round lobe that the mean over all directions is.
        let mean = 0.5 * (x * x + y * y);
        let x = (mean + (x * x - mean) * anisotropy).sqrt();
        let y = (mean + (y * y - mean) * anisotropy).sqrt();
        let (s, c) = sin_cos(2.0 * self.wander * turn * (1.0 + broken));
        [
            x,
            y,
            cos2 * c - sin2 * s,
            sin2 * c + cos2 * s,
            (0.5 + 0.2 * across).clamp(0.0, 1.0),
        ]
    }
}

/// One point per texel.
#[simd]
fn fill_one<S: Simd>(_: S, streaks: &Streaks, chunk: &Chunk, out: [&mut [f32]; 5]) {
    let [alpha_x, alpha_y, cos2, sin2, value] = out;
    let n = alpha_x.len().min(CHUNK);
    let (alpha_y, cos2, sin2, value) = (
        &mut alpha_y[..n],
        &mut cos2[..n],
        &mut sin2[..n],
        &mut value[..n],
    );
    for i in 0..n {
        let [x, y, c, s, v] = streaks.at(
            chunk.a[i],
            chunk.b[i],
            chunk.cos2[i],
            chunk.sin2[i],
            chunk.anisotropy[i],
            chunk.ln_gain[i],
        );
        alpha_x[i] = x;
        alpha_y[i] = y;
        cos2[i] = c;
        sin2[i] = s;
        value[i] = v;
    }
}

/// The mean lobe of several points across the grooves.
#[simd]
fn fill_mean<S: Simd>(_: S, streaks: &Streaks, chunk: &Chunk, out: [&mut [f32]; 5]) {
    let [alpha_x, alpha_y, cos2, sin2, value] = out;
    let n = alpha_x.len().min(CHUNK);
    let (alpha_y, cos2, sin2, value) = (
        &mut alpha_y[..n],
        &mut cos2[..n],
        &mut sin2[..n],
        &mut value[..n],
    );
    let (mut trace, mut difference, mut cross, mut sum) = (
        [0.0f32; CHUNK],
        [0.0f32; CHUNK],
        [0.0f32; CHUNK],
        [0.0f32; CHUNK],
    );
    let [across, along] = streaks.samples;
    for k in 0..across * along {
        let middle = |k: usize, n: usize| k as f32 - 0.5 * (n as f32 - 1.0);
        let step = streaks.steps[0] * middle(k % across, across)
            + streaks.steps[1] * middle(k / across, along);
        for i in 0..n {
            let (a, b) = (
                chunk.a[i] + step.x * chunk.reach[i],
                chunk.b[i] + step.y * chunk.reach[i],
            );
            let [x, y, c, s, v] = streaks.at(
                a,
                b,
                chunk.cos2[i],
                chunk.sin2[i],
                chunk.anisotropy[i],
                chunk.ln_gain[i],
            );
            // Twice the slope covariance: trace, uu - vv and 2 uv.
            trace[i] += x * x + y * y;
            difference[i] += (x * x - y * y) * c;
            cross[i] += (x * x - y * y) * s;
            sum[i] += v;
        }
    }
    let scale = 1.0 / (across * along) as f32;
    for i in 0..n {
        let (t, d, e) = (trace[i] * scale, difference[i] * scale, cross[i] * scale);
        let length = (d * d + e * e).sqrt();
        let wide = 0.5 * (t + length);
        // Determinant over the large eigenvalue: the small one without cancellation.
        let narrow = 0.25 * (t * t - length * length).max(0.0) / wide;
        let (wide, narrow) = (wide.sqrt().min(ALPHA_MAX), narrow.sqrt().max(ALPHA_MIN));
        let coherent = length > AXIS_MIN_LENGTH * AXIS_MIN_LENGTH * t;
        // x stays the axis nearer to the grooves, also where a streak happens to be wider along them.
        let x_is_wide = d * chunk.cos2[i] + e * chunk.sin2[i] > 0.0;
        let inverse = if x_is_wide { 1.0 } else { -1.0 } / length.max(1e-20);
        alpha_x[i] = if x_is_wide { wide } else { narrow };
        alpha_y[i] = if x_is_wide { narrow } else { wide };
        cos2[i] = if coherent { d * inverse } else { chunk.cos2[i] };
        sin2[i] = if coherent { e * inverse } else { chunk.sin2[i] };
        value[i] = sum[i] * scale;
    }
}

/// The value a normal variable stays under with probability `p` (logistic approximation, within 0.1 for p in 0.01..0.99).
fn normal_quantile(p: f32) -> f32 {
    if p >= 1.0 {
        return 1e3;
    }
    let p = p.max(1e-3);
    (p / (1.0 - p)).ln() / 1.702
}

/// Calls `f(chunk, n, row, from column)` for every chunk of every row of a rectangle `width` x `height`, with the place in
/// row order at which it begins.
pub(super) fn for_chunks(width: u32, height: u32, mut f: impl FnMut(u32, u32, usize, usize)) {
    for row in 0..height {
        for column in (0..width).step_by(CHUNK) {
            let n = (width - column).min(CHUNK as u32) as usize;
            f(
                column,
                row,
                n,
                row as usize * width as usize + column as usize,
            );
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::map::Size;

    #[test]
    fn widths_are_the_root_mean_square_whatever_the_spread_and_the_breaks() {
        let size = Size::new(256, 256).unwrap();
        let surface = Surface {
            size,
            aspect: 1.0,
            wrap: Wrap::Repeat,
            seed: 3,
        };
        for (spread, breaks) in [(0.0, 0.0), (0.25, 0.1), (0.6, 0.0), (0.2, 0.7)] {
            let look = Grooves {
                spread_along: spread,
                spread_across: spread,
                breaks,
                ..Default::default()
            };
            let plane = Plane {
                direction: Vec2::X,
                length: 0.2,
                width: 0.02,
                extent: Vec2::ONE,
                twist: 0.0,
                wrap: Wrap::Repeat,
                texel: [0.0, 0.0],
            };
            let streaks = Streaks::new(&look, &plane, &surface, 1);
            let (mut along, mut across) = (0.0, 0.0);
            let n = 300;
            for i in 0..n * n {
                let (a, b) = ((i % n) as f32 / n as f32, (i / n) as f32 / n as f32);
                let [x, y, ..] = streaks.at(a, b, 1.0, 0.0, 1.0, 0.0);
                along += x * x;
                across += y * y;
            }
            let rms = |sum: f32| (sum / (n * n) as f32).sqrt();
            assert!(
                (rms(along) / look.alpha_along - 1.0).abs() < 0.03,
                "{spread} {breaks}: {}",
                rms(along)
            );
            assert!(
                (rms(across) / look.alpha_across - 1.0).abs() < 0.03,
                "{spread} {breaks}: {}",
                rms(across)
            );
        }
    }

    #[test]
    fn every_cpu_level_gives_the_same_bits() {
        for (side, samples) in [(4096, 1), (64, 2)] {
            let size = Size::new(side, side).unwrap();
            let surface = Surface {
                size,
                aspect: 1.0,
                wrap: Wrap::Repeat,
                seed: 3,
            };
            let plane = Plane {
                direction: Vec2::X,
                length: 0.3,
                width: 0.01,
                extent: Vec2::ONE,
                twist: 0.0,
                wrap: Wrap::Repeat,
                texel: [surface.texel().y, surface.texel().x],
            };
            let streaks = Streaks::new(&Grooves::default(), &plane, &surface, 1);
            assert!(
                (streaks.samples != [1, 1]) == (samples > 1),
                "{:?}",
                streaks.samples
            );
            let mut chunk = Chunk::new();
            for i in 0..CHUNK {
                chunk.a[i] = 0.003_7 * i as f32;
                chunk.b[i] = 0.001_9 * (i * i % 521) as f32;
            }
            let filled = |level: Level| {
                let mut planes = [[0.0f32; CHUNK]; 5];
                streaks.fill_planes(level, &chunk, planes.each_mut().map(|p| &mut p[..]));
                planes.map(|p| p.map(f32::to_bits))
            };
            assert!(filled(Level::baseline()) == filled(level()));
            #[cfg(any(target_arch = "x86", target_arch = "x86_64"))]
            if let Some(avx2) = level().as_avx2() {
                assert!(filled(Level::Avx2(avx2)) == filled(level()));
            }
        }
    }
}
