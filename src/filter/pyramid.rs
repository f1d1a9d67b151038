//! The mip pyramid of a map, in slope covariance.
//!
//! The mean lobe of a footprint has the mean covariance (Olano and Baker 2010, "LEAN mapping"), so a level is a box average
//! of [`SlopeCovariance`], and a fetch between texels and levels is a weighted sum of it. Averaging widths and directions
//! instead keeps the peak and loses the shape: brushed metal seen from afar must grow rough across its grooves.

use super::fetch::{CHUNK, Room, Texels, blend_planes};
use crate::map::{AnisoMap, Rect, Region, Size, SlopeCovariance, Texel, gathered};
use crate::math;
use fearless_simd::{Simd, dispatch};
use fearless_simd_macros::simd;
use glam::Vec2;
use rayon::prelude::*;
use std::borrow::Cow;
use std::ops::{Add, Mul, Range};

/// How much longer than wide a footprint may be; a longer one is taken as wider.
const RATIO_MAX: f32 = 8.0;
/// Larger maps are read from their planes: a copy would cost gigabytes.
const PACKED_MAX: usize = 1 << 24;

/// A map and its levels, each half the size of the one before, down to 1x1. Costs a third of the map's texels at 12 bytes,
/// and for maps up to 4096x4096 all of them again at eight bytes, so that a fetch meets two lines of the cache and not eight.
pub struct Pyramid<'a> {
    base: Cow<'a, AnisoMap>,
    /// For plain fetches; none of a map that is too large.
    texels: Option<Texels>,
    /// From half size on.
    levels: Vec<Level>,
}

struct Level {
    size: Size,
    /// Which texels of the level below each column and each row covers, and how much of each.
    columns: Vec<(usize, Vec<f32>)>,
    rows: Vec<(usize, Vec<f32>)>,
    texels: Vec<Mean>,
}

/// What is averaged over texels.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Mean {
    covariance: SlopeCovariance,
    /// 1/(alpha_x alpha_y): how high a lobe is.
    height: f32,
}

impl Mean {
    #[inline(always)]
    fn of(texel: Texel) -> Self {
        Self {
            covariance: texel.into(),
            height: 1.0 / (texel.alpha_x * texel.alpha_y),
        }
    }

    /// How much higher the mean of the lobes is than the one lobe of their mean covariance: 1 where all are alike.
    #[inline(always)]
    fn variety(&self) -> f32 {
        let SlopeCovariance { uu, uv, vv } = self.covariance;
        // The product of the widths is twice the root of the determinant.
        2.0 * (uu * vv - uv * uv).max(0.0).sqrt() * self.height
    }
}

impl Add for Mean {
    type Output = Self;
    #[inline(always)]
    fn add(self, o: Self) -> Self {
        Self {
            covariance: self.covariance + o.covariance,
            height: self.height + o.height,
        }
    }
}

impl Mul<f32> for Mean {
    type Output = Self;
    #[inline(always)]
    fn mul(self, f: f32) -> Self {
        Self {
            covariance: self.covariance * f,
            height: self.height * f,
        }
    }
}

impl<'a> Pyramid<'a> {
    /// Averages `base` down to one texel. Sides that are odd are halved downward (5 to 2) with box weights, so every texel
    /// counts the same.
    pub fn new(base: impl Into<Cow<'a, AnisoMap>>) -> Self {
        let base = base.into();
        let mut levels: Vec<Level> = Vec::new();
        let mut size = base.size();
        while size.texels() > 1 {
            let mut next = Level::half_of(size);
            let whole = next.size.rect();
            next.fill_from(levels.last(), &base, &[whole], size);
            size = next.size;
            levels.push(next);
        }
        Self {
            texels: (base.size().texels() <= PACKED_MAX).then(|| Texels::new(&base)),
            base,
            levels,
        }
    }

    /// Changes texels of a rectangle of the map and of the levels above it: afterwards all is as if it were made anew from
    /// the changed map, provided that `change` writes inside the rectangle only. A map that was borrowed is copied first.
    ///
    /// # Panics
    /// When the rectangle reaches outside the map, or the map afterwards has another size or wrap.
    pub fn change(&mut self, rect: Rect, change: impl FnOnce(&mut AnisoMap)) {
        let (size, wrap) = (self.base.size(), self.base.wrap());
        assert!(
            size.rect().intersection(rect) == Some(rect),
            "a rectangle inside the map"
        );
        change(self.base.to_mut());
        assert!(
            self.base.size() == size && self.base.wrap() == wrap,
            "a map of the same size and wrap"
        );
        self.follow(vec![rect]);
    }

    /// Writes rectangles of the map, which lie inside it, and brings the levels above them up to date.
    ///
    /// # Panics
    /// When a rectangle reaches outside the map.
    pub fn write(&mut self, regions: &[Region]) {
        let whole = self.base.size().rect();
        let rects: Vec<Rect> = regions.iter().map(Region::rect).collect();
        assert!(
            rects.iter().all(|r| whole.intersection(*r) == Some(*r)),
            "rectangles inside the map"
        );
        self.base.to_mut().write_regions(regions);
        self.follow(rects);
    }

    /// Brings everything over some rectangles of the map up to date.
    fn follow(&mut self, mut rects: Vec<Rect>) {
        if let Some(texels) = &mut self.texels {
            texels.lay(&self.base, &rects);
        }
        let mut size = self.base.size();
        for i in 0..self.levels.len() {
            let (below, above) = self.levels.split_at_mut(i);
            let next = &mut above[0];
            for rect in &mut rects {
                *rect = next.above(*rect, size);
            }
            if i == FEW_FROM {
                rects = gathered(&rects);
            }
            next.fill_from(below.last(), &self.base, &rects, size);
            size = next.size;
        }
    }

    /// The map itself.
    pub fn base(&self) -> &AnisoMap {
        &self.base
    }

    /// The mean lobe of the whole map, in the (u, v) frame.
    pub fn mean(&self) -> SlopeCovariance {
        match self.levels.last() {
            Some(top) => top.texels[0].covariance,
            None => self.base.texel_at(0).into(),
        }
    }

    /// The map at `uv` (v up) as a pixel sees it whose steps to the right and downward move the texture coordinate by
    /// `duv_dx` and `duv_dy`.
    ///
    /// A footprint smaller than a texel is a plain bilinear fetch ([`AnisoMap::sample`]). A larger one is averaged in
    /// covariance: the level follows its short side, up to nine fetches its long side. Derivatives that are not finite
    /// are taken as a footprint over the whole map.
    pub fn sample(&self, uv: Vec2, duv_dx: Vec2, duv_dy: Vec2) -> Texel {
        let size = Vec2::new(self.base.width() as f32, self.base.height() as f32);
        let nearest = self.base.sample(uv.x, uv.y);
        let (major, minor, along) = ellipse(duv_dx * size, duv_dy * size);
        if major <= 1.0 {
            return nearest;
        }
        let x_is_wide = nearest.alpha_x > nearest.alpha_y;
        if !major.is_finite() {
            return self.mean().to_texel(x_is_wide, nearest.axis);
        }
        let width = minor.max(major / RATIO_MAX).max(1.0);
        let level = math::ln(width) * std::f32::consts::LOG2_E;
        // Fetches one width apart along the long side, each weighted with the part of it that it stands for: the sum
        // changes continuously with the footprint.
        let half = 0.5 * major / width;
        let reach = (half - 0.5).ceil().max(0.0) as i32;
        let step = along / size * width;
        let mut sum = SlopeCovariance::default();
        for tap in -reach..=reach {
            let share = ((half + 0.5 - (tap as f32).abs()).min(1.0)) / (2.0 * half);
            sum += self.fetch(uv + step * tap as f32, level) * share;
        }
        sum.to_texel(x_is_wide, nearest.axis)
    }

    /// The bilinear blend of alphas and double-angle vectors at each texture coordinate: alpha_x, alpha_y, cos 2θ, sin 2θ, a
    /// vector that is not yet of unit length. [`AnisoMap::sample`] before its end, to 2e-6 of a width and 2e-6 rad.
    ///
    /// # Panics
    /// When the slices have different lengths.
    pub fn fetch_plain(&self, room: &mut Room, u: &[f32], v: &[f32], out: [&mut [f32]; 4]) {
        let all = u.len();
        let alike = out.iter().all(|c| c.len() == all) && v.len() == all;
        assert!(alike, "one length");
        let mut rest = out;
        for (u, v) in u.chunks(CHUNK).zip(v.chunks(CHUNK)) {
            let out = rest.each_mut().map(|c| {
                c.split_off_mut(..u.len())
                    .expect("as long as the coordinates")
            });
            room.places.find(&self.base, u, v);
            match &self.texels {
                Some(texels) => texels.blend(room, out),
                None => blend_planes(&self.base, &room.places, out),
            }
        }
    }

    /// How different the lobes under each footprint are: how much higher the mean of the lobes is than the one lobe of their mean
    /// covariance, 1 where all are alike; 0 where the footprint is no larger than a texel and a plain fetch does.
    ///
    /// `change` holds the steps of the texture coordinate to the right and downward, (u, v) each. Asked of the level whose
    /// texels are as large as the footprint's long side, at the texel around the coordinate.
    ///
    /// # Panics
    /// When the slices have different lengths.
    pub fn varieties(&self, [u, v]: [&[f32]; 2], change: [[&[f32]; 2]; 2], out: &mut [f32]) {
        let all = [u, v].into_iter().chain(change.into_iter().flatten());
        assert!(all.into_iter().all(|s| s.len() == out.len()), "one length");
        dispatch!(math::level(), simd => varieties(simd, self, [u, v], change, out));
    }

    /// Between two levels; 0 is the map.
    fn fetch(&self, uv: Vec2, level: f32) -> SlopeCovariance {
        let level = level.clamp(0.0, self.levels.len() as f32);
        let low = level.floor();
        let t = level - low;
        let a = self.bilinear(uv, low as usize);
        if t > 0.0 {
            a * (1.0 - t) + self.bilinear(uv, low as usize + 1) * t
        } else {
            a
        }
    }

    fn bilinear(&self, uv: Vec2, level: usize) -> SlopeCovariance {
        let Some(level) = level.checked_sub(1).map(|i| &self.levels[i]) else {
            return self.base.sample(uv.x, uv.y).into();
        };
        let foot = self.base.wrap().footprint(level.size, uv.x, uv.y);
        foot.index
            .iter()
            .zip(foot.weight)
            .fold(SlopeCovariance::default(), |sum, (&i, w)| {
                sum + level.texels[i].covariance * w
            })
    }
}

/// [`Pyramid::varieties`]
#[simd]
fn varieties<S: Simd>(
    _: S,
    pyramid: &Pyramid<'_>,
    [u, v]: [&[f32]; 2],
    [dx, dy]: [[&[f32]; 2]; 2],
    out: &mut [f32],
) {
    let n = out.len();
    let (w, h) = (pyramid.base.width() as f32, pyramid.base.height() as f32);
    let (dx, dy) = (dx.map(|s| &s[..n]), dy.map(|s| &s[..n]));
    for i in 0..n {
        let (ax, ay, bx, by) = (dx[0][i] * w, dx[1][i] * h, dy[0][i] * w, dy[1][i] * h);
        let (xx, yy, xy) = (ax * ax + bx * bx, ay * ay + by * by, ax * ay + bx * by);
        let difference = xx - yy;
        out[i] = (0.5 * (xx + yy + (difference * difference + 4.0 * xy * xy).sqrt())).sqrt();
    }
    let wrap = pyramid.base.wrap();
    let place = |t: f32, texels: u32, repeats: bool| {
        let t = if t.abs() < f32::INFINITY { t } else { 0.0 };
        let t = if repeats { t - t.floor() } else { t };
        // Casts saturate.
        ((t * texels as f32) as u32).min(texels - 1) as usize
    };
    for i in 0..n {
        let major = out[i];
        if major <= 1.0 {
            out[i] = 0.0;
            continue;
        }
        // The next power of two, by the exponent's bits; NaN and infinity are past the last level.
        let level = (major.to_bits() >> 23) as usize - 127;
        let level = level.min(pyramid.levels.len().wrapping_sub(1));
        out[i] = pyramid.levels.get(level).map_or(1.0, |level| {
            let (width, height) = (level.size.width(), level.size.height());
            let column = place(u[i], width, wrap.repeats_u());
            let row = place(1.0 - v[i], height, wrap.repeats_v());
            level.texels[row * width as usize + column].variety()
        });
    }
}

/// Lengths of the long and the short side of the ellipse that the unit circle of pixels becomes, and the unit vector along
/// the long side.
fn ellipse(dx: Vec2, dy: Vec2) -> (f32, f32, Vec2) {
    let (xx, yy) = (dx.x * dx.x + dy.x * dy.x, dx.y * dx.y + dy.y * dy.y);
    let xy = dx.x * dx.y + dy.x * dy.y;
    let double = Vec2::new(xx - yy, 2.0 * xy);
    let major = (0.5 * (xx + yy + double.length())).sqrt();
    let area = dx.perp_dot(dy).abs();
    let minor = if major > 0.0 { area / major } else { 0.0 };
    let axis = math::Axis::from_double_angle(double / double.length());
    (
        if major.is_nan() { f32::INFINITY } else { major },
        minor,
        axis.map_or(Vec2::X, math::Axis::direction),
    )
}

/// Which source texels one texel of the smaller grid covers, and how much of each.
fn box_weights(from: u32, to: u32) -> Vec<(usize, Vec<f32>)> {
    let ratio = f64::from(from) / f64::from(to);
    (0..to)
        .map(|i| {
            let (start, end) = (f64::from(i) * ratio, f64::from(i + 1) * ratio);
            let first = start.floor();
            let last = (end.ceil()).min(f64::from(from));
            let weights = (first as u32..last as u32)
                .map(|j| {
                    let covered = end.min(f64::from(j + 1)) - start.max(f64::from(j));
                    (covered / ratio) as f32
                })
                .collect();
            (first as usize, weights)
        })
        .collect()
}

impl Level {
    /// A level over one of `size`, yet to be filled.
    fn half_of(size: Size) -> Self {
        let (width, height) = ((size.width() / 2).max(1), (size.height() / 2).max(1));
        let half = Size::new(width, height).expect("smaller than a checked size, and not 0");
        Self {
            size: half,
            columns: box_weights(size.width(), width),
            rows: box_weights(size.height(), height),
            texels: vec![Mean::default(); half.texels()],
        }
    }

    /// The texels that cover any of a rectangle of the level of `size` below.
    fn above(&self, rect: Rect, size: Size) -> Rect {
        // One more on each side: weights are formed in floating point.
        let range = |start: u32, length: u32, from: u32, to: u32| {
            let place = |i: u32| (u64::from(i) * u64::from(to) / u64::from(from)) as u32;
            let first = place(start).saturating_sub(1).min(to - 1);
            (first, (place(start + length) + 1).min(to - 1))
        };
        let (left, right) = range(rect.x, rect.width, size.width(), self.size.width());
        let (top, bottom) = range(rect.y, rect.height, size.height(), self.size.height());
        Rect {
            x: left,
            y: top,
            width: right - left + 1,
            height: bottom - top + 1,
        }
    }

    /// Averages rectangles of the level from the level of `size` below, or from the map.
    fn fill_from(&mut self, below: Option<&Self>, base: &AnisoMap, rects: &[Rect], size: Size) {
        let halves =
            size.width() == 2 * self.size.width() && size.height() == 2 * self.size.height();
        match below {
            None if halves => self.fill_halves(rects, base),
            None => self.fill(rects, size, |i| Mean::of(base.texel_at(i))),
            Some(level) => self.fill(rects, size, |i| level.texels[i]),
        }
    }

    /// Averages rectangles of the level from one of `size` below.
    fn fill(&mut self, rects: &[Rect], size: Size, source: impl Fn(usize) -> Mean + Sync) {
        let row_sum = |y: usize, (x, weights): &(usize, Vec<f32>)| {
            let start = y * size.width() as usize + x;
            weights
                .iter()
                .enumerate()
                .fold(Mean::default(), |sum, (k, &w)| sum + source(start + k) * w)
        };
        let (weights, rows) = (&self.columns, &self.rows);
        each_row(&mut self.texels, self.size, rects, |y, columns, line| {
            let (y, weights_down) = &rows[y as usize];
            for (texel, column) in line.iter_mut().zip(&weights[columns]) {
                *texel = Mean::default();
                for (k, &w) in weights_down.iter().enumerate() {
                    *texel = *texel + row_sum(y + k, column) * w;
                }
            }
        });
    }

    /// [`Level::fill`] from a map of exactly twice the size: each texel is the mean of four.
    fn fill_halves(&mut self, rects: &[Rect], base: &AnisoMap) {
        let width = base.width() as usize;
        let planes = [base.alpha_x(), base.alpha_y(), base.cos2(), base.sin2()];
        each_row(&mut self.texels, self.size, rects, |y, columns, line| {
            let row = |below: usize| {
                let start = (2 * y as usize + below) * width;
                planes.map(|p| &p[start + 2 * columns.start..start + 2 * columns.end])
            };
            let rows = [row(0), row(1)];
            dispatch!(math::level(), simd => mean_of_four(simd, rows, line));
        });
    }
}

/// The mean of two texels of each of two rows, in the order of [`Level::fill`].
#[simd]
fn mean_of_four<S: Simd>(_: S, rows: [[&[f32]; 4]; 2], out: &mut [Mean]) {
    let n = out.len();
    let rows = rows.map(|planes| planes.map(|p| &p[..2 * n]));
    for (i, out) in out.iter_mut().enumerate() {
        let mut all = Mean::default();
        for [ax, ay, c, s] in rows {
            let mut sum = Mean::default();
            for k in [2 * i, 2 * i + 1] {
                let axis = math::Axis {
                    cos2: c[k],
                    sin2: s[k],
                };
                let texel = Texel {
                    alpha_x: ax[k],
                    alpha_y: ay[k],
                    axis,
                };
                sum = sum + Mean::of(texel) * 0.5;
            }
            all = all + sum * 0.5;
        }
        *out = all;
    }
}

/// Rows that one thread works on at a time.
const BAND: usize = 32;
/// The level from which on few large rectangles cost less than many small ones.
const FEW_FROM: usize = 3;

/// Calls `work` with every part of a row of a level that lies in any of some rectangles: its number, its columns, its texels.
fn each_row(
    texels: &mut [Mean],
    size: Size,
    rects: &[Rect],
    work: impl Fn(u32, Range<usize>, &mut [Mean]) + Sync,
) {
    let width = size.width() as usize;
    texels
        .par_chunks_mut(width * BAND)
        .zip((0..size.height()).into_par_iter().step_by(BAND))
        .for_each(|(band, first)| {
            for (y, columns) in rows_in(rects, first, band.len() / width) {
                let start = (y - first) as usize * width;
                work(
                    y,
                    columns.clone(),
                    &mut band[start + columns.start..start + columns.end],
                );
            }
        });
}

/// The parts of `rows` rows from `first` on that lie in any of some rectangles.
pub(super) fn rows_in(
    rects: &[Rect],
    first: u32,
    rows: usize,
) -> impl Iterator<Item = (u32, Range<usize>)> {
    rects.iter().flat_map(move |r| {
        let (top, bottom) = (r.y.max(first), (r.y + r.height).min(first + rows as u32));
        let columns = r.x as usize..(r.x + r.width) as usize;
        (top..bottom.max(top)).map(move |y| (y, columns.clone()))
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::map::{DEFAULT_TEXEL, Wrap};
    use crate::math::Axis;

    fn grooved(width: u32, height: u32, wrap: Wrap) -> AnisoMap {
        let mut map = AnisoMap::constant(Size::new(width, height).unwrap(), wrap, DEFAULT_TEXEL);
        let mut region = map.region_mut();
        for i in 0..(width * height) as usize {
            let wobble = ((i * 7919) % 31) as f32;
            region.set(
                i,
                Texel {
                    alpha_x: 0.05 + 0.002 * wobble,
                    alpha_y: 0.3,
                    axis: Axis::from_degrees(20.0 + wobble),
                },
            );
        }
        map
    }

    fn close(a: SlopeCovariance, b: SlopeCovariance) -> bool {
        (a.uu - b.uu).abs() < 1e-6 && (a.uv - b.uv).abs() < 1e-6 && (a.vv - b.vv).abs() < 1e-6
    }

    #[test]
    fn the_top_is_the_mean_of_every_texel_whatever_the_size() {
        for (w, h) in [(1, 1), (8, 8), (5, 3), (1, 7), (13, 1), (100, 37)] {
            let map = grooved(w, h, Wrap::Repeat);
            let n = (w * h) as usize;
            let mean = (0..n).fold(SlopeCovariance::default(), |s, i| {
                s + SlopeCovariance::from(map.texel_at(i)) * (1.0 / n as f32)
            });
            assert!(close(Pyramid::new(&map).mean(), mean), "{w}x{h}");
        }
    }

    #[test]
    fn box_weights_cover_every_texel_alike() {
        for n in 1..40u32 {
            let to = (n / 2).max(1);
            let mut covered = vec![0.0f32; n as usize];
            for (first, weights) in box_weights(n, to) {
                assert!((weights.iter().sum::<f32>() - 1.0).abs() < 1e-6);
                for (k, w) in weights.iter().enumerate() {
                    covered[first + k] += w;
                }
            }
            let share = to as f32 / n as f32;
            assert!(covered.iter().all(|c| (c - share).abs() < 1e-6), "{n}");
        }
    }

    #[test]
    fn a_small_footprint_is_the_plain_fetch() {
        let map = grooved(16, 16, Wrap::Repeat);
        let pyramid = Pyramid::new(&map);
        let uv = Vec2::new(0.33, 0.71);
        let step = Vec2::new(0.5 / 16.0, 0.0);
        assert_eq!(
            pyramid.sample(uv, step, step.perp()),
            map.sample(uv.x, uv.y)
        );
        assert_eq!(
            pyramid.sample(uv, Vec2::ZERO, Vec2::ZERO),
            map.sample(uv.x, uv.y)
        );
    }

    #[test]
    fn fetching_many_is_fetching_one_whatever_the_place_and_the_wrap() {
        let odd = [
            f32::NAN,
            f32::INFINITY,
            -1e9,
            1e9,
            -1e-9,
            1.0,
            0.0,
            0.5,
            -0.25,
            1.0 - 1e-7,
        ];
        for wrap in [Wrap::Repeat, Wrap::RepeatU, Wrap::Clamp] {
            let map = grooved(19, 7, wrap);
            let mut pyramid = Pyramid::new(&map);
            for _ in 0..2 {
                let strange = |i: usize| odd.get(i).copied().unwrap_or(i as f32 * 0.0137 - 2.0);
                let u: Vec<f32> = (0..999).map(|i| strange(i % 700)).collect();
                let v: Vec<f32> = (0..999).map(|i| strange((i * 7) % 611)).collect();
                let uv = |i: usize| Vec2::new(u[i], v[i]);
                let mut out = [[0.0; 999]; 4];
                pyramid.fetch_plain(&mut Room::new(), &u, &v, out.each_mut().map(|c| &mut c[..]));
                for i in 0..999 {
                    let [x, y, c, s] = out.map(|lane| lane[i]);
                    let want = map.sample(uv(i).x, uv(i).y);
                    let got = crate::map::settle(x, y, c, s);
                    assert!(
                        (got.alpha_x - want.alpha_x).abs() < 1e-6,
                        "{wrap:?} {}",
                        uv(i)
                    );
                    assert!((got.alpha_y - want.alpha_y).abs() < 1e-6);
                    assert!(got.axis.angle_to(want.axis) < 1e-5);
                }
                // The same from the planes.
                pyramid.texels = None;
            }
        }
    }

    #[test]
    fn changing_a_rectangle_is_making_it_anew() {
        for (w, h) in [(64, 64), (37, 100), (5, 3), (1, 9)] {
            for wrap in [Wrap::Repeat, Wrap::Clamp] {
                let mut map = grooved(w, h, wrap);
                let mut pyramid = Pyramid::new(map.clone());
                for k in 0..6 {
                    let (x, y) = (k * 7 % w, k * 11 % h);
                    let rect = Rect {
                        x,
                        y,
                        width: (w - x).min(1 + 5 * k),
                        height: (h - y).min(3),
                    };
                    let paint = |map: &mut AnisoMap| {
                        let mut region = map.region(rect);
                        let texel = Texel {
                            alpha_x: 0.5 + 0.01 * k as f32,
                            ..DEFAULT_TEXEL
                        };
                        (0..rect.texels()).for_each(|i| region.view_mut().set(i, texel));
                        map.write_region(&region);
                    };
                    paint(&mut map);
                    pyramid.change(rect, paint);
                    let anew = Pyramid::new(&map);
                    assert!(pyramid.base() == &map && pyramid.texels == anew.texels);
                    for (level, new) in pyramid.levels.iter().zip(&anew.levels) {
                        assert!(level.texels == new.texels, "{w}x{h} {wrap:?} {rect:?}");
                    }
                }
            }
        }
    }

    #[test]
    fn a_footprint_over_the_whole_map_is_its_mean() {
        let map = grooved(32, 32, Wrap::Repeat);
        let pyramid = Pyramid::new(&map);
        for step in [1.0, 40.0, f32::INFINITY, f32::NAN] {
            let got = pyramid.sample(Vec2::splat(0.3), Vec2::new(step, 0.0), Vec2::new(0.0, step));
            assert!(
                close(got.into(), pyramid.mean()),
                "{step}: {got:?} {:?}",
                pyramid.mean()
            );
        }
    }

    #[test]
    fn sampling_is_continuous_in_the_footprint_and_across_the_seam() {
        let map = grooved(24, 40, Wrap::Repeat);
        let pyramid = Pyramid::new(&map);
        let at = |u: f32, texels: f32| {
            let step = Vec2::new(texels / 24.0, 0.0);
            SlopeCovariance::from(pyramid.sample(
                Vec2::new(u, 0.4),
                step,
                Vec2::new(0.0, texels / 40.0),
            ))
        };
        for k in 1..60 {
            let texels = k as f32 * 0.2;
            let (a, b) = (at(0.3, texels - 1e-4), at(0.3, texels + 1e-4));
            assert!((a.vv - b.vv).abs() < 1e-4, "{texels}");
            let (a, b) = (at(0.0, texels), at(1.0, texels));
            assert!(close(a, b), "{texels}");
        }
    }

    #[test]
    fn a_long_footprint_keeps_what_lies_across_it() {
        // Two halves of the map differ from top to bottom; a footprint along u only must not mix them.
        let mut map = AnisoMap::constant(Size::new(64, 64).unwrap(), Wrap::Clamp, DEFAULT_TEXEL);
        let rough = Texel {
            alpha_x: 0.6,
            alpha_y: 0.6,
            axis: Axis::U,
        };
        for i in 0..64 * 32 {
            map.region_mut().set(i, rough);
        }
        let pyramid = Pyramid::new(&map);
        let texel = pyramid.sample(
            Vec2::new(0.5, 0.45),
            Vec2::new(8.0 / 64.0, 0.0),
            Vec2::new(0.0, 0.5 / 64.0),
        );
        assert!((texel.alpha_x - DEFAULT_TEXEL.alpha_x).abs() < 1e-4);
    }
}
