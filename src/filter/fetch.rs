//! Texels laid out for fetching many at once.
//!
//! A fetch between texels of a large map waits for memory, so a texel takes eight bytes: 22 bits for each width, with 18 of
//! mantissa, and 20 for the direction. What that costs is far below what any picture shows: 2e-6 of a width, 2e-6 rad of a
//! direction. Numbers of half precision, as files hold them, come back exactly, and so do the axes' own directions.

use super::pyramid::rows_in;
use crate::map::{AnisoMap, Rect, Wrap};
use crate::math;
use fearless_simd::prelude::*;
use fearless_simd::{Simd, dispatch, f32x16, i32x16, u32x16};
use fearless_simd_macros::simd;
use rayon::prelude::*;
use std::f32::consts::FRAC_1_SQRT_2;
use std::ops::Range;

/// Fetches that are made at once.
pub(super) const CHUNK: usize = 256;
/// Of these, how many one vector holds.
const LANES: usize = 16;

/// Bits of a word below the width's.
const LOW: u32 = 10;
/// Bits of a width's mantissa that are left out.
const DROPPED: u32 = 5;
/// The bits of the least width there is, 2^-14; the greatest is just below 4.
const LEAST: u32 = 0x3880_0000;
const GREATEST: u32 = LEAST + (((1 << (32 - LOW)) - 1) << DROPPED);
/// The smaller component of a direction is a whole number of these, from -(2^17 - 1) to 2^17 - 1.
const STEP: f32 = FRAC_1_SQRT_2 / MIDDLE as f32 * 1.000_01;
const MIDDLE: i32 = 1 << 17;

/// A texel: two words, of which the upper bits are a width and the lower ones half of the direction.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Packed([u32; 2]);

impl Packed {
    fn new([alpha_x, alpha_y, cos2, sin2]: [f32; 4]) -> Self {
        // Of a unit vector the smaller component tells the other up to its sign, and without cancellation.
        let swapped = cos2.abs() < sin2.abs();
        let (large, small) = if swapped { (sin2, cos2) } else { (cos2, sin2) };
        let most = MIDDLE - 1;
        let small = ((small / STEP).round() as i32).clamp(-most, most) + MIDDLE;
        let flags = u32::from(swapped) << 1 | u32::from(large < 0.0);
        let direction = (small as u32) << 2 | flags;
        Self([
            width_bits(alpha_x) << LOW | direction >> LOW,
            width_bits(alpha_y) << LOW | direction & ((1 << LOW) - 1),
        ])
    }
}

fn width_bits(alpha: f32) -> u32 {
    let half = 1 << (DROPPED - 1);
    // Positive numbers stand in the order of their bits.
    let bits = alpha.max(f32::from_bits(LEAST)).to_bits() + half;
    (bits.min(GREATEST) - LEAST) >> DROPPED
}

/// Sixteen texels: alpha_x, alpha_y, cos 2θ, sin 2θ.
#[inline(always)]
fn unpack<S: Simd>(simd: S, texels: &[[u32; 2]]) -> [f32x16<S>; 4] {
    let words: &[u32] = bytemuck::cast_slice(&texels[..LANES]);
    let a = u32x16::from_slice(simd, &words[..LANES]);
    let b = u32x16::from_slice(simd, &words[LANES..]);
    let (x, y) = (a.unzip_low(b), a.unzip_high(b));
    let least = u32x16::splat(simd, LEAST);
    let alpha_x = ((x >> LOW) << DROPPED) + least;
    let alpha_y = ((y >> LOW) << DROPPED) + least;
    let low = u32x16::splat(simd, (1 << LOW) - 1);
    let direction = ((x & low) << LOW) | (y & low);
    let whole: i32x16<S> = (direction >> 2).bitcast();
    let small = (whole - i32x16::splat(simd, MIDDLE)).to_float::<f32x16<S>>() * STEP;
    let large = (f32x16::splat(simd, 1.0) - small * small).sqrt();
    let sign = (y & u32x16::splat(simd, 1)) << 31;
    let large: f32x16<S> = (large.bitcast::<u32x16<S>>() | sign).bitcast();
    let straight = (y & u32x16::splat(simd, 2)).simd_eq(u32x16::splat(simd, 0));
    [
        alpha_x.bitcast(),
        alpha_y.bitcast(),
        straight.select(large, small),
        straight.select(small, large),
    ]
}

/// Squares of texels lie together: the fetches of neighbouring pixels, whatever way the map is turned, then meet runs of memory
/// that the machine reads ahead.
const BITS: u32 = 4;
const SIDE: usize = 1 << BITS;

/// A map's texels, packed, in squares of [`SIDE`] row by row; those at the right and the bottom may not be full.
#[derive(PartialEq)]
pub(super) struct Texels {
    packed: Vec<[u32; 2]>,
    /// Texels of a row of squares.
    stride: usize,
}

impl Texels {
    pub(super) fn new(map: &AnisoMap) -> Self {
        let squares = |n: u32| (n as usize).div_ceil(SIDE);
        let stride = squares(map.width()) * SIDE * SIDE;
        let mut texels = Self {
            packed: vec![[0; 2]; stride * squares(map.height())],
            stride,
        };
        texels.lay(map, &[map.size().rect()]);
        texels
    }

    /// Copies rectangles of the map.
    pub(super) fn lay(&mut self, map: &AnisoMap, rects: &[Rect]) {
        let width = map.width() as usize;
        let rows = rows_of(rects);
        let first = rows.start as usize / SIDE;
        self.packed
            .par_chunks_mut(self.stride)
            .enumerate()
            .skip(first)
            .take((rows.end as usize).div_ceil(SIDE).saturating_sub(first))
            .for_each(|(j, squares)| {
                for (y, columns) in rows_in(rects, (j * SIDE) as u32, SIDE) {
                    let start = y as usize * width;
                    for x in columns {
                        let place = across(x as u32) + ((y % SIDE as u32) << BITS);
                        squares[place as usize] = Packed::new(four(map, start + x)).0;
                    }
                }
            });
    }

    /// A blend of four texels for each place.
    pub(super) fn blend(&self, room: &mut Room, out: [&mut [f32]; 4]) {
        let Room {
            places,
            indices,
            corners,
        } = room;
        let level = math::level();
        let stride = self.stride as u32;
        dispatch!(level, simd => corners_of(simd, places, stride, indices));
        let n = out[0].len().min(CHUNK);
        for i in 0..n {
            for k in 0..4 {
                corners[k][i] = self.packed[indices[k][i] as usize];
            }
        }
        dispatch!(level, simd => blend(simd, corners, places, out));
    }
}

/// The rows from the first to the last that rectangles hold.
fn rows_of(rects: &[Rect]) -> Range<u32> {
    let first = rects.iter().map(|r| r.y).min().unwrap_or(0);
    first..rects.iter().map(|r| r.y + r.height).max().unwrap_or(first)
}

/// What a column adds to a texel's index.
#[inline(always)]
fn across(column: u32) -> u32 {
    ((column >> BITS) << (2 * BITS)) + (column & (SIDE as u32 - 1))
}

/// What a row adds.
#[inline(always)]
fn down(row: u32, stride: u32) -> u32 {
    (row >> BITS) * stride + ((row & (SIDE as u32 - 1)) << BITS)
}

/// The indices of the texels around each place: above on the left and the right, below on the left and the right.
#[simd]
fn corners_of<S: Simd>(_: S, places: &Places, stride: u32, out: &mut [[u32; CHUNK]; 4]) {
    let (columns, rows) = (&places.columns, &places.rows);
    for i in 0..CHUNK {
        let (left, right) = (across(columns.low[i]), across(columns.high[i]));
        let (above, below) = (down(rows.low[i], stride), down(rows.high[i], stride));
        out[0][i] = above + left;
        out[1][i] = above + right;
        out[2][i] = below + left;
        out[3][i] = below + right;
    }
}

#[simd]
fn blend<S: Simd>(
    simd: S,
    corners: &[[[u32; 2]; CHUNK]; 4],
    places: &Places,
    out: [&mut [f32]; 4],
) {
    let n = out[0].len().min(CHUNK);
    for start in (0..n).step_by(LANES) {
        let x = f32x16::from_slice(simd, &places.columns.share[start..start + LANES]);
        let y = f32x16::from_slice(simd, &places.rows.share[start..start + LANES]);
        let (left, above) = (1.0 - x, 1.0 - y);
        let a = unpack(simd, &corners[0][start..]);
        let b = unpack(simd, &corners[1][start..]);
        let c = unpack(simd, &corners[2][start..]);
        let d = unpack(simd, &corners[3][start..]);
        for k in 0..4 {
            let (first, second) = (a[k] * above + c[k] * y, b[k] * above + d[k] * y);
            let sum = first * left + second * x;
            let out = &mut out[k][start..n];
            if out.len() >= LANES {
                sum.store_slice(&mut out[..LANES]);
            } else {
                let mut rest = [0.0; LANES];
                sum.store_slice(&mut rest);
                out.copy_from_slice(&rest[..out.len()]);
            }
        }
    }
}

/// The same from the map itself.
pub(super) fn blend_planes(map: &AnisoMap, places: &Places, out: [&mut [f32]; 4]) {
    let width = map.width() as usize;
    let (columns, rows) = (&places.columns, &places.rows);
    for i in 0..out[0].len() {
        let (x, y) = (columns.share[i], rows.share[i]);
        let (left, right) = (columns.low[i] as usize, columns.high[i] as usize);
        let (top, bottom) = (rows.low[i] as usize * width, rows.high[i] as usize * width);
        let row = |start: usize| {
            let (a, b) = (four(map, start + left), four(map, start + right));
            [0, 1, 2, 3].map(|c| (a[c], b[c]))
        };
        let (above, below) = (row(top), row(bottom));
        for c in 0..4 {
            let down = |a: f32, b: f32| a * (1.0 - y) + b * y;
            let (left, right) = (down(above[c].0, below[c].0), down(above[c].1, below[c].1));
            out[c][i] = left * (1.0 - x) + right * x;
        }
    }
}

fn four(map: &AnisoMap, i: usize) -> [f32; 4] {
    [
        map.alpha_x()[i],
        map.alpha_y()[i],
        map.cos2()[i],
        map.sin2()[i],
    ]
}

/// Room to work in for one thread that fetches.
pub struct Room {
    pub(super) places: Places,
    indices: [[u32; CHUNK]; 4],
    corners: [[[u32; 2]; CHUNK]; 4],
}

impl Room {
    /// For any map.
    pub fn new() -> Self {
        Self {
            places: Places::new(),
            indices: [[0; CHUNK]; 4],
            corners: [[[0; 2]; CHUNK]; 4],
        }
    }
}

impl Default for Room {
    fn default() -> Self {
        Self::new()
    }
}

/// Where fetches lie in the map.
pub(super) struct Places {
    columns: Line,
    rows: Line,
}

/// Where fetches lie along one side of the map: between which two texels, and how far from the first.
struct Line {
    low: [u32; CHUNK],
    high: [u32; CHUNK],
    share: [f32; CHUNK],
}

impl Places {
    fn new() -> Self {
        const LINE: Line = Line {
            low: [0; CHUNK],
            high: [0; CHUNK],
            share: [0.0; CHUNK],
        };
        Self {
            columns: LINE,
            rows: LINE,
        }
    }

    /// Takes up to [`CHUNK`] texture coordinates, v up.
    pub(super) fn find(&mut self, map: &AnisoMap, u: &[f32], v: &[f32]) {
        let (w, h, wrap) = (map.width(), map.height(), map.wrap());
        dispatch!(math::level(), simd => find(simd, self, (u, v), (w, h), wrap));
    }
}

#[simd]
fn find<S: Simd>(
    _: S,
    places: &mut Places,
    (u, v): (&[f32], &[f32]),
    (width, height): (u32, u32),
    wrap: Wrap,
) {
    places.columns.find(u, (1.0, 0.0), width, wrap.repeats_u());
    places.rows.find(v, (-1.0, 1.0), height, wrap.repeats_v());
}

impl Line {
    /// The rules of [`Wrap::footprint`] without a branch, for `sign` times each coordinate plus `offset`. Where the side ends,
    /// both texels are the last, or the share is 0.
    #[inline(always)]
    fn find(&mut self, at: &[f32], (sign, offset): (f32, f32), texels: u32, repeats: bool) {
        let n = texels as f32;
        let last = texels as i32 - 1;
        let all = at.len().min(CHUNK);
        let (low, high) = (&mut self.low[..all], &mut self.high[..all]);
        let share = &mut self.share[..all];
        for i in 0..all {
            let t = at[i] * sign + offset;
            let t = if t.abs() < f32::INFINITY { t } else { 0.0 };
            let clamped = if t < 0.0 { 0.0 } else { t };
            let clamped = if clamped > 1.0 { 1.0 } else { clamped };
            let t = if repeats { t - t.floor() } else { clamped };
            let x = t * n - 0.5;
            // Between -0.5 and 32767.5.
            let floor = math::floor_fast(x);
            let whole = math::whole(floor);
            let before = whole < 0;
            share[i] = if before & !repeats { 0.0 } else { x - floor };
            let under = if repeats { last } else { 0 };
            let over = if repeats { 0 } else { last };
            let next = whole + 1;
            low[i] = (if before { under } else { whole }) as u32;
            high[i] = (if next > last { over } else { next }) as u32;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::map::{ALPHA_MAX, ALPHA_MIN, Size, Texel};
    use crate::math::{Axis, levels};
    use half::f16;

    /// Texels to eight bytes and back, a vector's worth at a time.
    fn through(level: fearless_simd::Level, texels: &[[f32; 4]]) -> Vec<[f32; 4]> {
        let packed: Vec<[u32; 2]> = texels.iter().map(|t| Packed::new(*t).0).collect();
        let sixteen = |texels: &[[u32; 2]]| {
            let mut out = [[0.0; LANES]; 4];
            dispatch!(level, simd => all(simd, texels, &mut out));
            [0; LANES].map({
                let mut i = 0;
                move |_| {
                    i += 1;
                    out.map(|lane| lane[i - 1])
                }
            })
        };
        packed.chunks_exact(LANES).flat_map(sixteen).collect()
    }

    #[simd]
    fn all<S: Simd>(simd: S, texels: &[[u32; 2]], out: &mut [[f32; LANES]; 4]) {
        for (lane, out) in unpack(simd, texels).into_iter().zip(out) {
            lane.store_slice(out);
        }
    }

    #[test]
    fn eight_bytes_keep_what_the_top_of_the_file_says_on_every_level() {
        let count = 1 << 14;
        let texels: Vec<[f32; 4]> = (0..count)
            .map(|i| {
                let t = i as f32 / (count - 1) as f32;
                let alpha = ALPHA_MIN * math::exp(t * math::ln(ALPHA_MAX / ALPHA_MIN));
                let axis = Axis::from_radians(t * 77.0);
                let alpha = alpha.clamp(ALPHA_MIN, ALPHA_MAX);
                [alpha, ALPHA_MAX - alpha + ALPHA_MIN, axis.cos2, axis.sin2]
            })
            .collect();
        let mut first = None;
        for (name, level) in levels() {
            let back = through(level, &texels);
            for (got, want) in back.iter().zip(&texels) {
                for c in 0..2 {
                    let error = (got[c] / want[c] - 1.0).abs();
                    assert!(error < 2e-6, "{name} {want:?} {got:?}");
                }
                let axis = |t: &[f32; 4]| Axis {
                    cos2: t[2],
                    sin2: t[3],
                };
                let apart = axis(got).angle_to(axis(want));
                assert!(apart < 2.1e-6, "{name} {want:?} {got:?}: {apart}");
                let length = got[2] * got[2] + got[3] * got[3];
                assert!((length - 1.0).abs() < 3e-7);
            }
            assert!(*first.get_or_insert_with(|| back.clone()) == back, "{name}");
        }
    }

    #[test]
    fn halves_and_quarter_turns_come_back_exactly() {
        let mut texels: Vec<[f32; 4]> = (f16::from_f32(ALPHA_MIN).to_bits() + 1..)
            .map(|bits| f16::from_bits(bits).to_f32())
            .take_while(|alpha| *alpha <= ALPHA_MAX)
            .map(|alpha| [alpha, ALPHA_MAX, 1.0, 0.0])
            .collect();
        let odd = [(0.0, 1.0), (-1.0, 0.0), (0.0, -1.0), (1.0, 0.0)];
        texels.extend(odd.map(|(c, s)| [0.5, 0.25, c, s]));
        texels.resize(texels.len().next_multiple_of(LANES), [1.0, 1.0, 1.0, 0.0]);
        for (name, level) in levels() {
            assert!(through(level, &texels) == texels, "{name}");
        }
    }

    #[test]
    fn numbers_no_map_should_hold_are_pulled_into_range() {
        let odd = [
            f32::NAN,
            f32::INFINITY,
            -f32::INFINITY,
            -1.0,
            0.0,
            1e-30,
            9.0,
            1e30,
        ];
        let texels: Vec<[f32; 4]> = odd
            .into_iter()
            .flat_map(|x| [[x, 0.2, 1.0, 0.0], [0.2, 0.2, x, x]])
            .collect();
        for [x, y, c, s] in through(math::level(), &texels) {
            assert!(x > 0.0 && x < 4.0 && (y - 0.2).abs() < 1e-6);
            assert!((c * c + s * s - 1.0).abs() < 1e-5, "{c} {s}");
        }
    }

    #[test]
    fn packed_texels_and_planes_blend_alike() {
        let size = Size::new(19, 7).unwrap();
        let mut map = AnisoMap::constant(size, Wrap::Repeat, crate::map::DEFAULT_TEXEL);
        let mut region = map.region_mut();
        for i in 0..size.texels() {
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
        let u: Vec<f32> = (0..99).map(|i| i as f32 * 0.37 - 9.0).collect();
        let v: Vec<f32> = (0..99).map(|i| i as f32 * 0.011).collect();
        let mut room = Room::new();
        room.places.find(&map, &u, &v);
        let mut got = [[0.0; 99]; 4];
        let mut want = got;
        Texels::new(&map).blend(&mut room, got.each_mut().map(|c| &mut c[..]));
        blend_planes(&map, &room.places, want.each_mut().map(|c| &mut c[..]));
        for c in 0..4 {
            for i in 0..99 {
                assert!((got[c][i] - want[c][i]).abs() < 6e-6, "{c} {i}");
            }
        }
    }
}
