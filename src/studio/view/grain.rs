//! The grooves as grain: noise smeared along them (line integral convolution, Cabral and Leedom 1993).
//!
//! Each pixel follows the groove through it some pixels forward and back, and takes the weighted mean of the noise it meets. The
//! noise is fixed to the map, so that panning does not make it crawl, and of two octaves that fade into each other with the zoom,
//! so that its grains keep their size on the canvas. Field and noise are laid out once a pixel, around the rectangle as far as a
//! line goes; a line is followed in steps from its own pixel, so its rounding does not know where the rectangle begins.

use super::Canvas;
use super::camera::Camera2d;
use super::direction;
use super::finish;
use super::levels::Averaged;
use super::sampler::BAND;
use crate::map::Size;
use crate::math;
use fearless_simd::{Simd, dispatch};
use fearless_simd_macros::simd;
use glam::DVec2;
use rayon::prelude::*;
use std::ops::Range;

/// Steps of a pixel that a line is followed to each side. Longer ones would fold the grid of pixels into the picture.
const STEPS: usize = 14;
/// Pixels around the rectangle that its lines may meet.
pub(super) const REACH: u32 = STEPS as u32 + 3;
/// Grains of the finer octave are from 1 to 2 times this many pixels wide, those of the coarser twice that.
const GRAIN: f64 = 0.95;
/// Dark and light.
const DARK: [f32; 3] = [22.0, 23.0, 26.0];
const LIGHT: [f32; 3] = [236.0, 236.0, 233.0];
/// The spread of smeared noise is brought to this, of what lies between middle grey and white.
const CONTRAST: f32 = 0.62;
/// Pixels of a row that are followed side by side.
const LANES: usize = 16;

pub(super) fn draw(canvas: &Canvas<'_>, rgba: &mut [u8]) {
    let ground = Ground::new(canvas);
    let weights = weights();
    let sampler = canvas.sampler(0, false);
    let width = canvas.rect.width as usize;
    let line = 4 * width;
    rgba.par_chunks_mut(line * BAND)
        .enumerate()
        .for_each(|(band, rgba)| {
            let mut smeared = vec![0.0; width.next_multiple_of(LANES)];
            for (k, out) in rgba.chunks_exact_mut(line).enumerate() {
                let j = band * BAND + k;
                ground.smear(j, &weights, &mut smeared);
                ground.tone(j, &smeared, out);
                finish(&sampler, canvas.camera, j, out);
            }
        });
}

/// What the lines run over: the rectangle and [`REACH`] pixels around it.
struct Ground {
    stride: usize,
    /// Unit vectors along the grooves on the canvas, y down; 0 where there is no map.
    grooves: Vec<[f32; 2]>,
    /// How clear the direction is, 0 to 1.
    clear: Vec<f32>,
    noise: Vec<f32>,
}

impl Ground {
    fn new(canvas: &Canvas<'_>) -> Self {
        let sampler = canvas.sampler(REACH, true);
        let around = |length: u32| (length + 2 * REACH) as usize;
        let (stride, rows) = (around(canvas.rect.width), around(canvas.rect.height));
        let left = i64::from(canvas.rect.x) - i64::from(REACH);
        let top = i64::from(canvas.rect.y) - i64::from(REACH);
        let noise = Noise::new(canvas.camera, canvas.map.size(), left, stride);
        let mut ground = Self {
            stride,
            // Lanes past the last pixel of a row are followed too.
            grooves: vec![[0.0; 2]; stride * rows + LANES],
            clear: vec![0.0; stride * rows],
            noise: vec![0.0; stride * rows + LANES],
        };
        let bands = (ground.grooves.par_chunks_mut(stride * BAND))
            .zip(ground.noise.par_chunks_mut(stride * BAND))
            .zip(ground.clear.par_chunks_mut(stride * BAND));
        bands
            .enumerate()
            .for_each(|(band, ((grooves, noisy), clear))| {
                let start = band * BAND;
                let end = (start + BAND).min(rows);
                let part = |k: usize| (k - start) * stride..(k - start + 1) * stride;
                sampler.each_row(start..end, |k, seen| {
                    let (grooves, clear) = (&mut grooves[part(k)], &mut clear[part(k)]);
                    dispatch!(math::level(), simd => along(simd, seen, grooves, clear));
                });
                noise.fill(start..end, top, noisy);
            });
        ground
    }

    /// The noise along the line through each pixel of row `j` of the rectangle.
    fn smear(&self, j: usize, weights: &[f32; STEPS], smeared: &mut [f32]) {
        let start = (j + REACH as usize) * self.stride + REACH as usize;
        for (i, out) in smeared.chunks_exact_mut(LANES).enumerate() {
            let out: &mut [f32; LANES] = out.try_into().expect("a chunk of that length");
            dispatch!(math::level(), simd => follow(simd, self, start + i * LANES, weights, out));
        }
    }

    fn tone(&self, j: usize, smeared: &[f32], out: &mut [u8]) {
        let start = (j + REACH as usize) * self.stride + REACH as usize;
        for (i, pixel) in out.chunks_exact_mut(4).enumerate() {
            let x = smeared[i] * self.clear[start + i];
            let t = 0.5 + 0.5 * x / (1.0 + x * x).sqrt();
            for c in 0..3 {
                pixel[c] = (DARK[c] + (LIGHT[c] - DARK[c]) * t + 0.5) as u8;
            }
            pixel[3] = 255;
        }
    }
}

/// Grooves and their clearness from what pixels see.
#[simd]
fn along<S: Simd>(_: S, seen: &[Averaged], grooves: &mut [[f32; 2]], clear: &mut [f32]) {
    let n = seen.len().min(grooves.len()).min(clear.len());
    for i in 0..n {
        let [xx, yy, c, s] = seen[i];
        let length = (c * c + s * s).sqrt();
        let inverse = -1.0 / if length > 1e-20 { length } else { 1e-20 };
        let (x, y) = math::half_angle(c * inverse, s * inverse);
        let is = if length > 1e-20 { 1.0 } else { 0.0 };
        grooves[i] = [is * x, -is * y];
        let sum = 0.25 * (xx + yy);
        clear[i] = direction::strength(length / if sum > 1e-12 { sum } else { 1e-12 }) * is;
    }
}

/// What the noise after each step counts for, of 1 at the start: a smooth hill.
fn weights() -> [f32; STEPS] {
    let mut weights = [0.0; STEPS];
    for (k, w) in weights.iter_mut().enumerate() {
        let t = (k + 1) as f32 / (STEPS + 1) as f32;
        let c = math::sin_cos(0.5 * std::f32::consts::PI * t).1;
        *w = c * c;
    }
    weights
}

/// Some lines side by side: where each is, seen from its own pixel, and the unit vector that it goes along.
#[derive(Clone, Copy)]
struct Lines {
    x: Lane,
    y: Lane,
    u: Lane,
    v: Lane,
}

type Lane = [f32; LANES];

/// Follows the lines of pixels side by side. Each step is cut into loops of arithmetic, which become vectors, and of fetches.
#[simd]
fn follow<S: Simd>(_: S, ground: &Ground, first: usize, weights: &[f32; STEPS], out: &mut Lane) {
    let mut sum = [0.0; LANES];
    sum.copy_from_slice(&ground.noise[first..first + LANES]);
    for side in [1.0, -1.0] {
        let zero = [0.0; LANES];
        let mut lines = Lines {
            x: zero,
            y: zero,
            u: zero,
            v: zero,
        };
        for i in 0..LANES {
            let [u, v] = ground.grooves[first + i];
            (lines.u[i], lines.v[i]) = (u * side, v * side);
        }
        for weight in weights {
            step(ground, first, &mut lines);
            let met = noise_at(ground, first, &lines);
            for i in 0..LANES {
                sum[i] += met[i] * weight;
            }
        }
    }
    for i in 0..LANES {
        out[i] = sum[i] * GAIN;
    }
}

/// A step along the groove half a step ahead: the midpoint rule.
#[inline(always)]
fn step(ground: &Ground, first: usize, lines: &mut Lines) {
    let stride = ground.stride as i32;
    let last = ground.grooves.len() as i32 - 1;
    let mut at = [0; LANES];
    for i in 0..LANES {
        let column = math::whole(math::round_fast(lines.x[i] + 0.5 * lines.u[i]));
        let row = math::whole(math::round_fast(lines.y[i] + 0.5 * lines.v[i]));
        at[i] = ((first + i) as i32 + row * stride + column).clamp(0, last);
    }
    let (mut a, mut b) = ([0.0; LANES], [0.0; LANES]);
    for i in 0..LANES {
        [a[i], b[i]] = ground.grooves[at[i] as usize];
    }
    for i in 0..LANES {
        let (u, v) = (lines.u[i], lines.v[i]);
        let sign = if a[i] * u + b[i] * v < 0.0 { -1.0 } else { 1.0 };
        let some = a[i] * a[i] + b[i] * b[i] > 0.5;
        lines.u[i] = if some { a[i] * sign } else { u };
        lines.v[i] = if some { b[i] * sign } else { v };
        lines.x[i] += lines.u[i];
        lines.y[i] += lines.v[i];
    }
}

/// The noise where each line is, between pixels.
#[inline(always)]
fn noise_at(ground: &Ground, first: usize, lines: &Lines) -> Lane {
    let stride = ground.stride as i32;
    let last = (ground.noise.len() - ground.stride) as i32 - 2;
    let (mut at, mut fx, mut fy) = ([0; LANES], [0.0; LANES], [0.0; LANES]);
    for i in 0..LANES {
        let (left, upper) = (math::floor_fast(lines.x[i]), math::floor_fast(lines.y[i]));
        (fx[i], fy[i]) = (lines.x[i] - left, lines.y[i] - upper);
        let place = (first + i) as i32 + math::whole(upper) * stride + math::whole(left);
        at[i] = place.clamp(0, last);
    }
    let zero = [0.0; LANES];
    let [mut a, mut b, mut c, mut d] = [zero; 4];
    for i in 0..LANES {
        let at = at[i] as usize;
        let (upper, lower) = (
            &ground.noise[at..at + 2],
            &ground.noise[at + ground.stride..][..2],
        );
        (a[i], b[i], c[i], d[i]) = (upper[0], upper[1], lower[0], lower[1]);
    }
    let mut met = zero;
    for i in 0..LANES {
        let (upper, lower) = (a[i] + (b[i] - a[i]) * fx[i], c[i] + (d[i] - c[i]) * fx[i]);
        met[i] = upper + (lower - upper) * fy[i];
    }
    met
}

/// Brings the spread of the sums to [`CONTRAST`]; measured on a straight field.
const GAIN: f32 = CONTRAST * 0.6;

/// Noise of two octaves, fixed to the map.
struct Noise {
    octaves: [Octave; 2],
}

/// One octave: a quadratic B-spline over random numbers at the corners of a grid.
struct Octave {
    /// Cells of the grid at the upper edge of the canvas, and per pixel.
    origin: f64,
    step: f64,
    seed: u32,
    weight: f32,
    /// For each pixel of a row its first of three cells, counted from `cells.start`, and their weights.
    columns: Vec<(u32, [f32; 3])>,
    cells: Range<i64>,
}

impl Noise {
    fn new(camera: &Camera2d, map: Size, left: i64, columns: usize) -> Self {
        let per_texel = camera.pixels_per_texel();
        let finest = per_texel.max_element();
        // The octave whose cells, of 2^k texels, are GRAIN to 2 GRAIN pixels wide.
        let exact = (GRAIN / finest).log2();
        let k = exact.ceil();
        let t = (k - exact) as f32;
        // The spread of a sum of two is the root of the sum of squares.
        let spread = (t * t + (1.0 - t) * (1.0 - t)).sqrt();
        let origin = camera.texel_at(map, DVec2::ZERO);
        let octave = |k: f64, weight: f32| {
            let cell = k.exp2();
            Octave::new(
                origin / cell,
                DVec2::ONE / (per_texel * cell),
                (k as i32 as u32).wrapping_mul(0x9e37_79b9),
                weight / spread,
                left,
                columns,
            )
        };
        Self {
            octaves: [octave(k, t), octave(k + 1.0, 1.0 - t)],
        }
    }

    /// Rows of pixels, from row `top` of the canvas.
    fn fill(&self, rows: Range<usize>, top: i64, out: &mut [f32]) {
        for octave in &self.octaves {
            octave.add(rows.clone(), top, out);
        }
    }
}

/// The first of the three cells around a place, and their weights.
fn spline(at: f64) -> (i64, [f32; 3]) {
    let middle = at.floor();
    let t = (at - middle) as f32;
    let first = 0.5 * (1.0 - t) * (1.0 - t);
    let last = 0.5 * t * t;
    (middle as i64 - 1, [first, 1.0 - first - last, last])
}

impl Octave {
    fn new(origin: DVec2, step: DVec2, seed: u32, weight: f32, left: i64, columns: usize) -> Self {
        let places: Vec<_> = (left..left + columns as i64)
            .map(|x| spline(origin.x + (x as f64 + 0.5) * step.x))
            .collect();
        let start = places.first().map_or(0, |p| p.0);
        let end = places.last().map_or(0, |p| p.0 + 3);
        let columns = places
            .into_iter()
            .map(|(cell, w)| (u32::try_from(cell - start).unwrap_or(0), w))
            .collect();
        Self {
            origin: origin.y,
            step: step.y,
            seed,
            weight,
            columns,
            cells: start..end,
        }
    }

    fn add(&self, rows: Range<usize>, top: i64, out: &mut [f32]) {
        let count = self.cells.clone().count();
        let mut grid = [vec![0.0; count], vec![0.0; count], vec![0.0; count]];
        let mut known = None;
        let mut blended = vec![0.0; count];
        for (j, out) in rows.zip(out.chunks_mut(self.columns.len())) {
            let y = (top + j as i64) as f64 + 0.5;
            let (first, w) = spline(self.origin + y * self.step);
            if known != Some(first) {
                for (row, cell) in grid.iter_mut().zip(first..) {
                    self.random(cell, row);
                }
                known = Some(first);
            }
            let w = w.map(|w| w * self.weight);
            for i in 0..count {
                blended[i] = grid[0][i] * w[0] + grid[1][i] * w[1] + grid[2][i] * w[2];
            }
            for (out, (cell, w)) in out.iter_mut().zip(&self.columns) {
                let cells = &blended[*cell as usize..][..3];
                *out += cells[0] * w[0] + cells[1] * w[1] + cells[2] * w[2];
            }
        }
    }

    /// Numbers from -1 to 1 for a row of cells.
    fn random(&self, row: i64, out: &mut [f32]) {
        let row = (row as u32).wrapping_mul(0x85eb_ca6b) ^ self.seed;
        let start = self.cells.start as u32;
        for (i, out) in (0u32..).zip(out) {
            let mut h = start.wrapping_add(i).wrapping_mul(0xc2b2_ae35) ^ row;
            h ^= h >> 16;
            h = h.wrapping_mul(0x7feb_352d);
            h ^= h >> 15;
            h = h.wrapping_mul(0x846c_a68b);
            h ^= h >> 16;
            *out = (h >> 8) as f32 / 8_388_608.0 - 1.0;
        }
    }
}
