//! How far two pictures are apart to somebody who flips between them.
//!
//! LDR-FLIP: Andersson, Nilsson, Akenine-Möller, Oskarsson, Åström and Fairchild, "FLIP: A Difference Evaluator for
//! Alternating Images", Proceedings of the ACM on Computer Graphics and Interactive Techniques 3(2), HPG 2020. Symbols are the
//! paper's. In its order (section 4):
//!
//! 1. colour pipeline: both pictures to the opponent space Y Cx Cz, each channel filtered by the eye's contrast sensitivity
//!    (a Gaussian; a sum of two for blue and yellow), back to linear light and clipped, to L*a*b* with Hunt's adjustment, the
//!    distance HyAB raised to q_c and mapped to \[0, 1\];
//! 2. feature pipeline: edges and points by the first and second derivative of a Gaussian on Y, the larger difference of the
//!    two, raised to q_f;
//! 3. ΔE = ΔE_c raised to 1 - ΔE_f.
//!
//! Every filter here is a product of a function of x and one of y, so it is applied along rows and then along columns: about
//! 550 products a pixel in place of 7000. Beyond the picture its border is repeated. The result is held against NVIDIA's own
//! tool by `.ci/compare_flip.py`.

use crate::error::{Error, Result};
use crate::map::Size;
use crate::math;
use crate::preview::Picture;
use fearless_simd::{Simd, dispatch};
use fearless_simd_macros::simd;
use glam::{DMat3, DVec3};
use rayon::prelude::*;
use std::f64::consts::PI;
use std::ops::Range;

/// The paper's observer: 0.70 m from a display 0.70 m wide with 3840 pixels, in pixels per degree of visual angle.
pub const PIXELS_PER_DEGREE: f32 = 67.020_64;

/// What the observer's distance may be given as.
const PIXELS_PER_DEGREE_RANGE: std::ops::RangeInclusive<f32> = 1.0..=1000.0;

/// q_c, p_c and p_t of the colour pipeline, w and q_f of the feature pipeline (section 4 and table 2).
const Q_C: f32 = 0.7;
const P_C: f32 = 0.4;
const P_T: f32 = 0.95;
const FEATURE_WIDTH: f64 = 0.082;
const Q_F: f32 = 0.5;

/// (a, b) of a Gaussian a sqrt(π/b) exp(-π² d²/b) at d degrees: the contrast sensitivity of a channel (table 1).
type Sensitivity = (f64, f64);
const ACHROMATIC: Sensitivity = (1.0, 0.0047);
const RED_GREEN: Sensitivity = (1.0, 0.0053);
const BLUE_YELLOW: [Sensitivity; 2] = [(34.1, 0.04), (13.5, 0.025)];

/// Pixels that are worked on at once, at most: what bounds the memory (80 bytes each).
const BAND: usize = 1 << 20;
/// The fewest rows of a band, since the rows around it are filtered twice.
const BAND_ROWS: usize = 64;

/// The difference between two pictures, pixel by pixel: 0 where nobody sees any, 1 at most.
#[derive(Clone, Debug, PartialEq)]
pub struct Flip {
    size: Size,
    values: Vec<f32>,
}

impl Flip {
    /// Compares what a display shows of two pictures of one size: light is clipped to \[0, 1\]. `pixels_per_degree` tells how
    /// close the observer is, 1 to 1000; usually [`PIXELS_PER_DEGREE`]. The order of the pictures does not matter. The same bytes
    /// for any number of threads.
    ///
    /// # Errors
    /// When their sizes differ or the observer is out of range.
    pub fn new(first: &Picture, second: &Picture, pixels_per_degree: f32) -> Result<Self> {
        same_size(first, second)?;
        if !PIXELS_PER_DEGREE_RANGE.contains(&pixels_per_degree) {
            let allowed = "allowed: 1 to 1000";
            return Err(Error::invalid(
                "pixels per degree",
                pixels_per_degree,
                allowed,
            ));
        }
        let eye = Eye::new(f64::from(pixels_per_degree));
        let (width, height) = (first.width() as usize, first.height() as usize);
        let mut values = vec![0.0; width * height];
        let rows = (BAND / width).max(BAND_ROWS);
        for (band, out) in values.chunks_mut(rows * width).enumerate() {
            let rows = band * rows..band * rows + out.len() / width;
            let bands = [first, second].map(|p| Band::new(&eye, p, rows.clone()));
            out.par_chunks_mut(width).zip(rows).for_each_init(
                || vec![[0.0; CHUNK]; 2 * FILTERED],
                |seen, (out, y)| {
                    dispatch!(math::level(), simd => compare_row(simd, &eye, &bands, y, seen, out));
                },
            );
        }
        Ok(Self {
            size: first.size(),
            values,
        })
    }

    /// Of the pictures.
    pub fn size(&self) -> Size {
        self.size
    }

    /// The differences in row order, top row first.
    pub fn values(&self) -> &[f32] {
        &self.values
    }

    /// The mean difference: the one number that stands for a pair of pictures.
    pub fn mean(&self) -> f64 {
        mean(&self.values)
    }

    /// The difference that the share `q` of all pixels does not exceed: 0.999 is the 99.9th percentile. `q` is taken as 0 to 1.
    pub fn quantile(&self, q: f64) -> f32 {
        quantile(&self.values, q)
    }

    /// The largest difference.
    pub fn largest(&self) -> f32 {
        self.values.iter().copied().fold(0.0, f32::max)
    }
}

/// Tells when two pictures cannot be compared pixel by pixel.
pub(super) fn same_size(first: &Picture, second: &Picture) -> Result<()> {
    if first.size() == second.size() {
        return Ok(());
    }
    let allowed = format!("allowed: that of the first, {}", first.size());
    Err(Error::invalid(
        "size of the second picture",
        second.size(),
        allowed,
    ))
}

pub(super) fn mean(values: &[f32]) -> f64 {
    values.iter().map(|v| f64::from(*v)).sum::<f64>() / values.len() as f64
}

/// The nearest rank: the smallest value that at least the share `q` does not exceed.
pub(super) fn quantile(values: &[f32], q: f64) -> f32 {
    let mut values = values.to_vec();
    let rank = (q.clamp(0.0, 1.0) * values.len() as f64).ceil() as usize;
    let at = rank.clamp(1, values.len()) - 1;
    *values.select_nth_unstable_by(at, f32::total_cmp).1
}

/// A filter along one line, of odd length, its middle at the pixel.
struct Taps(Vec<f32>);

impl Taps {
    /// `weight` at whole pixels up to `radius`; those too small to change a sum in f32 are left out.
    fn new(radius: i32, weight: impl Fn(f64) -> f64) -> Self {
        let all: Vec<f64> = (-radius..=radius).map(|x| weight(f64::from(x))).collect();
        let largest = all.iter().fold(0.0f64, |m, w| m.max(w.abs()));
        let unseen = |w: &&f64| w.abs() < 1e-9 * largest;
        // The derivative is 0 in the middle too: count from the end only.
        let cut = all.iter().take_while(unseen).count();
        Self(
            all[cut..all.len() - cut]
                .iter()
                .map(|w| *w as f32)
                .collect(),
        )
    }

    fn radius(&self) -> usize {
        self.0.len() / 2
    }
}

/// Everything that depends on the observer alone.
struct Eye {
    /// Of the filters, at most, in pixels.
    reach: usize,
    achromatic: Taps,
    red_green: Taps,
    /// Each with the square root of its share of the sum, since it is applied along rows and along columns.
    blue_yellow: [Taps; 2],
    /// The Gaussian of the feature detectors and its first and second derivative.
    smooth: Taps,
    edge: Taps,
    point: Taps,
    space: Space,
    /// ΔE of the pair of colours that are farthest apart, raised to q_c.
    c_max: f32,
}

impl Eye {
    fn new(pixels_per_degree: f64) -> Self {
        // Section 4.1.1: three standard deviations of the widest filter, for all of them.
        let widest = BLUE_YELLOW[0].1;
        let reach = (3.0 * (widest / (2.0 * PI * PI)).sqrt() * pixels_per_degree).ceil() as i32;
        let gaussian = |b: f64| {
            move |x: f64| {
                let d = x / pixels_per_degree;
                (-PI * PI * d * d / b).exp()
            }
        };
        let sum = |b: f64| (-reach..=reach).map(|x| gaussian(b)(f64::from(x))).sum();
        let single = |(_, b): Sensitivity| {
            let all: f64 = sum(b);
            Taps::new(reach, |x| gaussian(b)(x) / all)
        };
        let height = |(a, b): Sensitivity| a * (PI / b).sqrt();
        let weight = |s: Sensitivity| height(s) * sum(s.1) * sum(s.1);
        let both = weight(BLUE_YELLOW[0]) + weight(BLUE_YELLOW[1]);
        let (smooth, edge, point) = features(pixels_per_degree);
        let space = Space::new();
        let [green, blue] = [[0.0, 1.0, 0.0], [0.0, 0.0, 1.0]].map(|c| space.hunt_lab(c));
        Self {
            reach: (reach as usize).max(smooth.radius()),
            achromatic: single(ACHROMATIC),
            red_green: single(RED_GREEN),
            blue_yellow: BLUE_YELLOW.map(|(a, b)| {
                let scale = (height((a, b)) / both).sqrt();
                Taps::new(reach, |x| gaussian(b)(x) * scale)
            }),
            smooth,
            edge,
            point,
            space,
            c_max: math::pow(hyab(green, blue), Q_C),
        }
    }
}

/// The Gaussian of the feature detectors and its derivatives (section 4.2.1): positive weights sum to 1, negative ones to -1.
fn features(pixels_per_degree: f64) -> (Taps, Taps, Taps) {
    let sd = 0.5 * FEATURE_WIDTH * pixels_per_degree;
    let radius = (3.0 * sd).ceil() as i32;
    let gaussian = |x: f64| (-x * x / (2.0 * sd * sd)).exp();
    let sum = |f: &dyn Fn(f64) -> f64| (-radius..=radius).map(|x| f(f64::from(x))).sum::<f64>();
    let normalised = |f: &dyn Fn(f64) -> f64| {
        let positive = sum(&|x| f(x).max(0.0));
        let negative = -sum(&|x| f(x).min(0.0));
        Taps::new(radius, |x| {
            f(x) / if f(x) < 0.0 { negative } else { positive }
        })
    };
    (
        normalised(&gaussian),
        normalised(&|x| -x * gaussian(x)),
        normalised(&|x| (x * x / (sd * sd) - 1.0) * gaussian(x)),
    )
}

/// Linear Rec. 709 light to CIE XYZ over the white point, and back.
struct Space {
    to_xyz: [[f32; 3]; 3],
    from_xyz: [[f32; 3]; 3],
}

impl Space {
    fn new() -> Self {
        // From the chromaticities of ITU-R BT.709's primaries and of D65 with five digits, as the paper's authors take it.
        let xyz = |x: f64, y: f64| DVec3::new(x / y, 1.0, (1.0 - x - y) / y);
        let primaries = DMat3::from_cols(xyz(0.64, 0.33), xyz(0.30, 0.60), xyz(0.15, 0.06));
        let white = xyz(0.31271, 0.32902);
        let light = primaries * DMat3::from_diagonal(primaries.inverse() * white);
        let over_white = DMat3::from_diagonal(1.0 / white) * light;
        let rows = |m: DMat3| {
            let m = m.transpose().to_cols_array_2d();
            m.map(|row| row.map(|x| x as f32))
        };
        Self {
            to_xyz: rows(over_white),
            from_xyz: rows(over_white.inverse()),
        }
    }

    /// (Y + 16) / 116, Cx and Cz of clipped linear light: without its offset Y is exactly 0 at black, however it is filtered.
    #[inline(always)]
    fn opponent(&self, rgb: [f32; 3]) -> [f32; 3] {
        let [x, y, z] = times(&self.to_xyz, rgb.map(displayed));
        [y, 500.0 * (x - y), 200.0 * (y - z)]
    }

    /// The inverse of [`Self::opponent`].
    #[inline(always)]
    fn light(&self, [y, cx, cz]: [f32; 3]) -> [f32; 3] {
        let xyz = [y + cx * (1.0 / 500.0), y, y - cz * (1.0 / 200.0)];
        times(&self.from_xyz, xyz).map(displayed)
    }

    /// L*a*b* of linear light, its chroma scaled by lightness as Hunt found that it is seen.
    #[inline(always)]
    fn hunt_lab(&self, rgb: [f32; 3]) -> [f32; 3] {
        let [x, y, z] = times(&self.to_xyz, rgb).map(lightness);
        let l = 116.0 * y - 16.0;
        [l, 0.01 * l * 500.0 * (x - y), 0.01 * l * 200.0 * (y - z)]
    }
}

#[inline(always)]
fn times(m: &[[f32; 3]; 3], [a, b, c]: [f32; 3]) -> [f32; 3] {
    [0, 1, 2].map(|i| m[i][0] * a + m[i][1] * b + m[i][2] * c)
}

/// What a display shows of light; NaN is black.
#[inline(always)]
pub(super) fn displayed(c: f32) -> f32 {
    let c = if c > 0.0 { c } else { 0.0 };
    if c < 1.0 { c } else { 1.0 }
}

/// f of CIE L*a*b*: the cube root, a line near black.
#[inline(always)]
fn lightness(t: f32) -> f32 {
    const DELTA: f32 = 6.0 / 29.0;
    const LOWEST: f32 = DELTA * DELTA * DELTA;
    let low = t / (3.0 * DELTA * DELTA) + 4.0 / 29.0;
    let root = math::pow(if t > LOWEST { t } else { LOWEST }, 1.0 / 3.0);
    if t > LOWEST { root } else { low }
}

#[inline(always)]
fn hyab(p: [f32; 3], q: [f32; 3]) -> f32 {
    let (a, b) = (p[1] - q[1], p[2] - q[2]);
    (p[0] - q[0]).abs() + (a * a + b * b).sqrt()
}

/// The planes of a [`Band`]: Y, Cx, Cz twice as the eye filters them along rows, then Y as the feature detectors do.
const PLANES: usize = 7;
/// Results of both filters: Y, Cx, Cz, edges along x and y, points along x and y.
const FILTERED: usize = 7;

/// Some rows of a picture, and as many around them as the filters reach, filtered along the rows.
struct Band {
    width: usize,
    /// The picture's rows that it holds.
    rows: Range<usize>,
    height: usize,
    /// Row by row, in each its planes.
    filtered: Vec<f32>,
}

impl Band {
    fn new(eye: &Eye, picture: &Picture, rows: Range<usize>) -> Self {
        let (width, height) = (picture.width() as usize, picture.height() as usize);
        let rows = rows.start.saturating_sub(eye.reach)..(rows.end + eye.reach).min(height);
        let mut filtered = vec![0.0; rows.len() * PLANES * width];
        filtered
            .par_chunks_mut(PLANES * width)
            .zip(rows.clone())
            .for_each_init(
                || vec![0.0; 3 * (width + 2 * eye.reach)],
                |padded, (out, y)| {
                    let row = &picture.pixels()[y * width..][..width];
                    dispatch!(math::level(), simd => filter_row(simd, eye, row, padded, out));
                },
            );
        Self {
            width,
            rows,
            height,
            filtered,
        }
    }

    /// One plane of row `y`, the border's beyond it, from column `x` on.
    #[inline(always)]
    fn row(&self, plane: usize, y: isize, x: usize) -> &[f32] {
        let y = y.clamp(0, self.height as isize - 1) as usize - self.rows.start;
        &self.filtered[(y * PLANES + plane) * self.width..][..self.width][x..]
    }

    /// A filter along columns at row `y`, added to what `out` holds.
    #[inline(always)]
    fn add(&self, plane: usize, taps: &Taps, (x, y): (usize, usize), out: &mut [f32; CHUNK]) {
        let first = y as isize - taps.radius() as isize;
        for (row, &w) in (first..).zip(&taps.0) {
            add_scaled(out, self.row(plane, row, x), w);
        }
    }
}

/// Pixels of a row that stay in registers and the first cache while every filter passes over them.
const CHUNK: usize = 64;

#[inline(always)]
fn add_scaled(out: &mut [f32; CHUNK], row: &[f32], w: f32) {
    if let Some(row) = row.first_chunk::<CHUNK>() {
        for i in 0..CHUNK {
            out[i] += w * row[i];
        }
    } else {
        for (out, x) in out.iter_mut().zip(row) {
            *out += w * x;
        }
    }
}

/// Filters a row of pixels along itself into its planes. `padded` has room for three lines with the border repeated.
#[simd]
fn filter_row<S: Simd>(_: S, eye: &Eye, row: &[[f32; 3]], padded: &mut [f32], out: &mut [f32]) {
    let (width, reach) = (row.len(), eye.reach);
    let line = width + 2 * reach;
    let (y, rest) = padded.split_at_mut(line);
    let (cx, rest) = rest.split_at_mut(line);
    let (cz, _) = rest.split_at_mut(line);
    for (i, &pixel) in row.iter().enumerate() {
        let opponent = eye.space.opponent(pixel);
        y[reach + i] = opponent[0];
        cx[reach + i] = opponent[1];
        cz[reach + i] = opponent[2];
    }
    for line in [&mut *y, cx, cz] {
        let (first, last) = (line[reach], line[reach + width - 1]);
        line[..reach].fill(first);
        line[reach + width..].fill(last);
    }
    let filters: [(&[f32], &Taps); PLANES] = [
        (y, &eye.achromatic),
        (cx, &eye.red_green),
        (cz, &eye.blue_yellow[0]),
        (cz, &eye.blue_yellow[1]),
        (y, &eye.smooth),
        (y, &eye.edge),
        (y, &eye.point),
    ];
    for ((line, taps), out) in filters.into_iter().zip(out.chunks_exact_mut(width)) {
        let first = reach - taps.radius();
        for (chunk, out) in out.chunks_mut(CHUNK).enumerate() {
            let mut sums = [0.0; CHUNK];
            for (k, &w) in taps.0.iter().enumerate() {
                add_scaled(&mut sums, &line[first + chunk * CHUNK + k..], w);
            }
            out.copy_from_slice(&sums[..out.len()]);
        }
    }
}

/// Filters row `y` of both bands along columns and compares what is seen.
#[simd]
fn compare_row<S: Simd>(
    _: S,
    eye: &Eye,
    bands: &[Band; 2],
    y: usize,
    seen: &mut [[f32; CHUNK]],
    out: &mut [f32],
) {
    let (first, second) = seen.split_at_mut(FILTERED);
    for (chunk, out) in out.chunks_mut(CHUNK).enumerate() {
        let place = (chunk * CHUNK, y);
        for (band, seen) in bands.iter().zip([&mut *first, &mut *second]) {
            for line in seen.iter_mut() {
                line.fill(0.0);
            }
            band.add(0, &eye.achromatic, place, &mut seen[0]);
            band.add(1, &eye.red_green, place, &mut seen[1]);
            band.add(2, &eye.blue_yellow[0], place, &mut seen[2]);
            band.add(3, &eye.blue_yellow[1], place, &mut seen[2]);
            band.add(5, &eye.smooth, place, &mut seen[3]);
            band.add(4, &eye.edge, place, &mut seen[4]);
            band.add(6, &eye.smooth, place, &mut seen[5]);
            band.add(4, &eye.point, place, &mut seen[6]);
        }
        let mut differences = [0.0; CHUNK];
        for i in 0..CHUNK {
            let at = |seen: &[[f32; CHUNK]]| [0, 1, 2, 3, 4, 5, 6].map(|f: usize| seen[f][i]);
            differences[i] = difference(eye, at(first), at(second));
        }
        out.copy_from_slice(&differences[..out.len()]);
    }
}

/// ΔE of a pixel from what both filters made of it in either picture.
#[inline(always)]
fn difference(eye: &Eye, p: [f32; FILTERED], q: [f32; FILTERED]) -> f32 {
    let lab = |s: [f32; FILTERED]| eye.space.hunt_lab(eye.space.light([s[0], s[1], s[2]]));
    let colour = redistributed(hyab(lab(p), lab(q)), eye.c_max);
    let length = |x: f32, y: f32| (x * x + y * y).sqrt();
    let edges = (length(p[3], p[4]) - length(q[3], q[4])).abs();
    let points = (length(p[5], p[6]) - length(q[5], q[6])).abs();
    let larger = if edges > points { edges } else { points };
    let feature = power(larger * std::f32::consts::FRAC_1_SQRT_2, Q_F);
    power(colour, 1.0 - feature)
}

/// HyAB to \[0, 1\]: raised to q_c, its lower part stretched, since most differences lie there (section 4.1.4).
#[inline(always)]
fn redistributed(distance: f32, c_max: f32) -> f32 {
    let e = power(distance, Q_C);
    let knee = P_C * c_max;
    let low = e * (P_T / knee);
    let high = P_T + (e - knee) / (c_max - knee) * (1.0 - P_T);
    if e < knee { low } else { high }
}

/// x^y, 0 for 0.
#[inline(always)]
fn power(x: f32, y: f32) -> f32 {
    const LEAST: f32 = 1e-30;
    let raised = math::pow(if x > LEAST { x } else { LEAST }, y);
    if x > LEAST { raised } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::preview::linear_from_srgb;
    use proptest::prelude::*;

    fn picture((width, height): (u32, u32), colour: impl Fn(u32, u32) -> [f32; 3]) -> Picture {
        let mut picture = Picture::new(Size::new(width, height).unwrap(), [0.0; 3]);
        for y in 0..height {
            for (x, pixel) in picture.row_mut(y).iter_mut().enumerate() {
                *pixel = colour(x as u32, y);
            }
        }
        picture
    }

    fn flat(colour: [f32; 3]) -> Picture {
        picture((64, 64), |_, _| colour)
    }

    fn flip(a: &Picture, b: &Picture) -> Flip {
        Flip::new(a, b, PIXELS_PER_DEGREE).unwrap()
    }

    fn noise(seed: u32) -> Picture {
        picture((150, 90), |x, y| {
            [0, 1, 2].map(|c| {
                let mut h = (x * 977 + y * 131_071 + c * 31 + seed).wrapping_mul(0x9e37_79b9);
                h ^= h >> 15;
                (h.wrapping_mul(0x85eb_ca6b) >> 8) as f32 / 16_777_216.0
            })
        })
    }

    #[test]
    fn the_same_picture_differs_nowhere() {
        let noise = noise(1);
        assert_eq!(flip(&noise, &noise).largest(), 0.0);
        assert_eq!(flip(&noise, &noise).mean(), 0.0);
        let bright = picture((70, 70), |x, _| [1.0 + x as f32, -1.0, f32::NAN]);
        let clipped = flat([1.0, 0.0, 0.0]);
        let clipped = picture((70, 70), |_, _| clipped.pixel(0, 0));
        assert_eq!(flip(&bright, &clipped).largest(), 0.0, "as displayed");
    }

    /// Numbers that NVIDIA's own tool (flip-evaluator 1.7, 67.0206 pixels a degree) gives.
    #[test]
    fn known_pairs_have_their_known_difference() {
        let grey = |byte: u8| flat([linear_from_srgb(f32::from(byte) / 255.0); 3]);
        let pairs = [
            (flat([0.0; 3]), flat([1.0; 3]), 0.967_345),
            (flat([0.0, 1.0, 0.0]), flat([0.0, 0.0, 1.0]), 1.0),
            (grey(128), grey(129), 0.029_862),
        ];
        for (a, b, want) in pairs {
            let got = flip(&a, &b).mean();
            assert!((got - want).abs() < 2e-4, "{got} in place of {want}");
        }
    }

    /// An edge and a dot that appear, pixel by pixel, from the same tool. Its Y carries the offset of -16, which rounds the
    /// faintest of light beside black away; ours keeps it, and the root makes 0.0016 of it.
    #[test]
    fn an_edge_and_a_dot_are_seen_where_they_are() {
        let step = picture((64, 64), |x, _| if x < 32 { [0.0; 3] } else { [1.0; 3] });
        let map = flip(&flat([0.0; 3]), &step);
        let want = [
            0.0, 0.0, 0.0, 0.030_65, 0.184_14, 0.592_12, 0.906_88, 0.992_38, 0.993_94, 0.992_74,
            0.989_66, 0.986_01, 0.983_48, 0.980_02, 0.976_42, 0.973_22,
        ];
        for (got, want) in map.values()[32 * 64 + 24..].iter().zip(want) {
            assert!((got - want).abs() < 2e-3, "{got} in place of {want}");
        }
        let dot = picture((64, 64), |x, y| {
            [if (x, y) == (32, 32) { 1.0 } else { 0.0 }; 3]
        });
        let map = flip(&dot, &flat([0.0; 3]));
        let want = [0.018_02, 0.133_71, 0.480_56, 0.763_49, 0.864_91, 0.763_49];
        for (got, want) in map.values()[32 * 64 + 28..].iter().zip(want) {
            assert!((got - want).abs() < 1e-3, "{got} in place of {want}");
        }
        assert!((map.mean() - 0.003_493_5).abs() < 2e-5, "{}", map.mean());
    }

    #[test]
    fn order_does_not_matter_and_a_turn_turns_the_map() {
        let (a, b) = (noise(1), noise(2));
        assert_eq!(flip(&a, &b), flip(&b, &a));
        let turned = |p: &Picture| picture((90, 150), |x, y| p.pixel(y, x));
        let (map, turned) = (flip(&a, &b), flip(&turned(&a), &turned(&b)));
        for y in 0..90 {
            for x in 0..150 {
                let (p, q) = (map.values()[y * 150 + x], turned.values()[x * 90 + y]);
                assert!((p - q).abs() < 1e-4, "{x} {y}: {p} {q}");
            }
        }
    }

    #[test]
    fn threads_bands_and_levels_do_not_matter() {
        // Taller than the fewest rows of a band, and wide enough for bands to be cut.
        let wide = |seed: f32| picture((40_000 / 2, 140), |x, y| [(x ^ y) as f32 % 7.0 / seed; 3]);
        let (a, b) = (wide(7.0), wide(6.0));
        let on = |n: usize| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(n).build();
            pool.unwrap().install(|| flip(&a, &b))
        };
        assert_eq!(on(1), on(3));
        // Far from the cuts' rows a band of its own sees the same.
        let part = |p: &Picture| picture((20_000, 100), |x, y| p.pixel(x, y + 40));
        let (whole, part) = (on(2), flip(&part(&a), &part(&b)));
        assert_eq!(
            whole.values()[60 * 20_000..][..20_000 * 60],
            part.values()[20 * 20_000..][..20_000 * 60]
        );
    }

    #[test]
    fn tiny_pictures_and_wrong_input() {
        let one = picture((1, 1), |_, _| [0.2; 3]);
        assert_eq!(flip(&one, &one).quantile(0.5), 0.0);
        assert!(Flip::new(&one, &flat([0.0; 3]), PIXELS_PER_DEGREE).is_err());
        for wrong in [0.0, -1.0, f32::NAN, f32::INFINITY, 1e9] {
            assert!(Flip::new(&one, &one, wrong).is_err(), "{wrong}");
        }
        for far in [1.0, 1000.0] {
            let map = Flip::new(&noise(1), &noise(2), far).unwrap();
            assert!(map.values().iter().all(|v| (0.0..=1.0).contains(v)));
        }
    }

    #[test]
    fn quantiles_are_ranks() {
        let values: Vec<f32> = (0..1000).rev().map(|i| i as f32).collect();
        for (q, want) in [
            (0.0, 0.0),
            (0.001, 0.0),
            (0.5, 499.0),
            (0.999, 998.0),
            (1.0, 999.0),
        ] {
            assert_eq!(quantile(&values, q), want, "{q}");
        }
        assert_eq!(mean(&values), 499.5);
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(24))]
        #[test]
        fn any_colours_stay_inside_the_range(a in prop::array::uniform3(-1f32..3.0), b in prop::array::uniform3(-1f32..3.0)) {
            let map = flip(&flat(a), &flat(b));
            prop_assert!(map.values().iter().all(|v| (0.0..=1.0).contains(v)));
        }
    }
}
