//! What a tool does to texels, to the extent that a stroke covers them.
//!
//! Texels are blended as [`crate::map::blend`] blends them, [`LANES`] at a time. A texel of weight 0 is left as it is, to the bit; at weight 1 it is what the tool lays, to the bit.

use super::cover::{Cover, LANES, Lane, TILE, lane};
use super::{Keep, Tool};
use crate::map::{ALPHA_MAX, ALPHA_MIN, Rect, Region, blend_numbers};
use crate::math::{self, Axis, atan2, sin_cos};
use fearless_simd::{Simd, dispatch};
use fearless_simd_macros::simd;
use std::f32::consts::PI;

/// Planes of a rectangle, in its row order: alpha_x, alpha_y, cos 2θ, sin 2θ.
#[derive(Clone, Copy)]
pub(super) struct Planes<'a> {
    pub(super) rect: Rect,
    pub(super) planes: [&'a [f32]; 4],
}

impl<'a> Planes<'a> {
    pub(super) fn of(region: &'a Region) -> Self {
        Self {
            rect: region.rect(),
            planes: [&region.alpha_x, &region.alpha_y, &region.cos2, &region.sin2],
        }
    }
}

/// A rectangle of a layer at work: all slices in its row order.
pub(super) struct View<'a> {
    pub(super) rect: Rect,
    /// alpha_x, alpha_y, cos 2θ, sin 2θ as the strokes so far left them.
    pub(super) now: [&'a mut [f32]; 4],
    /// The same below the layer, in a rectangle that holds this one.
    pub(super) below: Planes<'a>,
    /// How much of each texel strokes have touched and not erased.
    pub(super) coverage: &'a mut [f32],
}

impl<'a> View<'a> {
    pub(super) fn of(now: &'a mut Region, below: &'a Region, coverage: &'a mut [f32]) -> Self {
        Self {
            rect: now.rect(),
            now: [
                &mut now.alpha_x,
                &mut now.alpha_y,
                &mut now.cos2,
                &mut now.sin2,
            ],
            below: Planes::of(below),
            coverage,
        }
    }

    /// Bands of `rect`, which lies in the view: whole rows of the view, cut where a tile begins.
    pub(super) fn bands(self, rect: Rect) -> Vec<(Rect, Self)> {
        let width = self.rect.width as usize;
        let skip = (rect.y - self.rect.y) as usize * width;
        let mut now = self.now.map(|p| &mut p[skip..]);
        let mut coverage = &mut self.coverage[skip..];
        let mut bands = Vec::new();
        let (mut y, bottom) = (rect.y, rect.y + rect.height);
        while y < bottom {
            let end = (y / TILE + 1).saturating_mul(TILE).min(bottom);
            let n = (end - y) as usize * width;
            let mut first = Vec::with_capacity(4);
            now = now.map(|p| {
                let (a, b) = p.split_at_mut(n);
                first.push(a);
                b
            });
            let (covered, rest) = coverage.split_at_mut(n);
            coverage = rest;
            let height = end - y;
            let view = Self {
                rect: Rect {
                    y,
                    height,
                    ..self.rect
                },
                now: first.try_into().expect("four planes"),
                below: self.below,
                coverage: covered,
            };
            bands.push((Rect { y, height, ..rect }, view));
            y = end;
        }
        bands
    }

    pub(super) fn reborrow(&mut self) -> View<'_> {
        let [a, b, c, d] = &mut self.now;
        View {
            rect: self.rect,
            now: [a, b, c, d],
            below: self.below,
            coverage: self.coverage,
        }
    }
}

/// A tool with its numbers made ready.
#[derive(Clone, Copy, Debug)]
pub(super) enum Work {
    /// These widths, the x axis along the stroke.
    Lay(f32, f32),
    /// The groove along the stroke.
    Comb,
    /// The x axis to this one.
    Turn(Axis),
    Scale(f32, Keep),
    Set {
        alpha_x: Option<f32>,
        alpha_y: Option<f32>,
        axis: Option<Axis>,
    },
    /// Toward other planes: what lies below, or the surroundings' mean.
    Toward {
        erases: bool,
    },
}

impl Work {
    pub(super) fn of(tool: &Tool) -> Self {
        match *tool {
            Tool::Groove(g) => Self::Lay(g.along, g.across),
            Tool::Scratch(s) => Self::Lay(s.along, s.across),
            Tool::Comb => Self::Comb,
            Tool::Smooth(_) => Self::Toward { erases: false },
            Tool::Roughen(r) => Self::Scale(r.factor, r.keep),
            Tool::SetAlpha(s) => Self::Set {
                alpha_x: s.alpha_x,
                alpha_y: s.alpha_y,
                axis: None,
            },
            Tool::SetDirection(d) => Self::Turn(Axis::from_degrees(d.angle)),
            Tool::Erase => Self::Toward { erases: true },
            Tool::Fill(f) => Self::Set {
                alpha_x: f.alpha_x,
                alpha_y: f.alpha_y,
                axis: f.angle.map(Axis::from_degrees),
            },
        }
    }
}

/// Does the work where `cover` says, in the texels of `rect`, which lies in the tile and the view. `toward` is what
/// to go toward where the work is that; it holds `rect`.
pub(super) fn apply(
    work: Work,
    cover: &Cover,
    rect: Rect,
    view: &mut View<'_>,
    toward: Planes<'_>,
) {
    dispatch!(math::level(), simd => apply_rows(simd, work, cover, rect, view, toward));
}

#[simd]
fn apply_rows<S: Simd>(
    _: S,
    work: Work,
    cover: &Cover,
    rect: Rect,
    view: &mut View<'_>,
    toward: Planes<'_>,
) {
    let left = (rect.x as i32 - cover.origin.x) as usize;
    let right = left + rect.width as usize;
    for y in rect.y..rect.y + rect.height {
        let row = (y as i32 - cover.origin.y) as usize;
        let (first, last) = cover.spans[row];
        if first >= last {
            continue;
        }
        for n in usize::from(first)..usize::from(last) {
            let (from, to) = ((n * LANES).max(left), ((n + 1) * LANES).min(right));
            if from >= to {
                continue;
            }
            let place = row * TILE as usize + n * LANES;
            let weight = lane(&cover.weight, place);
            if weight.iter().all(|w| *w == 0.0) {
                continue;
            }
            let skip = from - n * LANES;
            let at = view.rect.index(rect.x + (from - left) as u32, y);
            let size = to - from;
            let mut texels = Texels {
                planes: [1.0; 4].map(|x| [x; LANES]),
                coverage: [0.0; LANES],
            };
            for (to, from) in texels.planes.iter_mut().zip(&view.now) {
                take(to, skip, &from[at..at + size]);
            }
            take(&mut texels.coverage, skip, &view.coverage[at..at + size]);
            let (dx, dy) = cover.direction(place);
            let stroke = (weight, dx, dy);
            if let Work::Toward { .. } = work {
                let mut other = [[1.0; LANES]; 4];
                let at = toward.rect.index(rect.x + (from - left) as u32, y);
                for (to, from) in other.iter_mut().zip(&toward.planes) {
                    take(to, skip, &from[at..at + size]);
                }
                texels.toward(&other, weight);
            } else {
                texels.change(work, stroke);
            }
            texels.touch(matches!(work, Work::Toward { erases: true }), weight);
            for (to, from) in view.now.iter_mut().zip(&texels.planes) {
                give(&mut to[at..at + size], skip, from);
            }
            give(&mut view.coverage[at..at + size], skip, &texels.coverage);
        }
    }
}

/// Copies a part of a row into a lane.
#[inline(always)]
fn take(to: &mut Lane, skip: usize, from: &[f32]) {
    match <&Lane>::try_from(from) {
        Ok(whole) => *to = *whole,
        Err(_) => to[skip..skip + from.len()].copy_from_slice(from),
    }
}

/// Copies a lane back into a part of a row.
#[inline(always)]
fn give(to: &mut [f32], skip: usize, from: &Lane) {
    match <&mut Lane>::try_from(&mut *to) {
        Ok(whole) => *whole = *from,
        Err(_) => {
            let n = to.len();
            to.copy_from_slice(&from[skip..skip + n]);
        }
    }
}

/// Texels at work, side by side.
struct Texels {
    planes: [Lane; 4],
    coverage: Lane,
}

impl Texels {
    #[inline(always)]
    fn change(&mut self, work: Work, (weight, dx, dy): (&Lane, &Lane, &Lane)) {
        match work {
            Work::Lay(along, across) => self.lay([along, across], weight, dx, dy),
            Work::Comb => self.comb(weight, dx, dy),
            Work::Turn(axis) => self.turn(axis, weight),
            Work::Scale(factor, keep) => self.scale(factor, keep, weight),
            Work::Set {
                alpha_x,
                alpha_y,
                axis,
            } => {
                if let Some(alpha) = alpha_x {
                    mix(&mut self.planes[0], alpha, weight);
                }
                if let Some(alpha) = alpha_y {
                    mix(&mut self.planes[1], alpha, weight);
                }
                if let Some(axis) = axis {
                    self.turn(axis, weight);
                }
            }
            Work::Toward { .. } => {}
        }
    }

    #[inline(always)]
    fn lay(&mut self, alphas: [f32; 2], weight: &Lane, dx: &Lane, dy: &Lane) {
        let mut other = [[0.0; LANES]; 4];
        for i in 0..LANES {
            let (c, s) = double_angle(dx[i], dy[i]);
            other[0][i] = alphas[0];
            other[1][i] = alphas[1];
            other[2][i] = c;
            other[3][i] = s;
        }
        self.toward(&other, weight);
    }

    /// Blends toward other texels.
    #[inline(always)]
    fn toward(&mut self, other: &[Lane; 4], weight: &Lane) {
        let [ax, ay, c, s] = &mut self.planes;
        for i in 0..LANES {
            let w = weight[i];
            let settled = blend_numbers(
                [ax[i], ay[i], c[i], s[i]],
                [other[0][i], other[1][i], other[2][i], other[3][i]],
                w,
            );
            // What is there already stays as it is, to the bit.
            let same = (ax[i] == other[0][i])
                & (ay[i] == other[1][i])
                & (c[i] == other[2][i])
                & (s[i] == other[3][i]);
            let w = if same { 0.0 } else { w };
            ax[i] = chosen(w, ax[i], settled[0], other[0][i]);
            ay[i] = chosen(w, ay[i], settled[1], other[1][i]);
            c[i] = chosen(w, c[i], settled[2], other[2][i]);
            s[i] = chosen(w, s[i], settled[3], other[3][i]);
        }
    }

    /// Turns the groove, which lies along the axis with the smaller width, toward the stroke.
    #[inline(always)]
    fn comb(&mut self, weight: &Lane, dx: &Lane, dy: &Lane) {
        let [ax, ay, c, s] = &mut self.planes;
        for i in 0..LANES {
            let (tc, ts) = double_angle(dx[i], dy[i]);
            let sign = if ax[i] <= ay[i] { 1.0 } else { -1.0 };
            (c[i], s[i]) = turned((c[i], s[i]), (sign * tc, sign * ts), weight[i]);
        }
    }

    #[inline(always)]
    fn turn(&mut self, axis: Axis, weight: &Lane) {
        let [_, _, c, s] = &mut self.planes;
        for i in 0..LANES {
            (c[i], s[i]) = turned((c[i], s[i]), (axis.cos2, axis.sin2), weight[i]);
        }
    }

    #[inline(always)]
    fn scale(&mut self, factor: f32, keep: Keep, weight: &Lane) {
        let [ax, ay, _, _] = &mut self.planes;
        for i in 0..LANES {
            let (x, y) = (ax[i], ay[i]);
            let (small, large) = (x.min(y), x.max(y));
            let f = 1.0 + (factor - 1.0) * weight[i];
            let (fx, fy) = match keep {
                Keep::Ratio => {
                    let f = f.clamp(
                        ALPHA_MIN / small,
                        (ALPHA_MAX / large).max(ALPHA_MIN / small),
                    );
                    (f, f)
                }
                Keep::Area => {
                    // Not past round, and neither width past its range.
                    let least = (small / large).sqrt();
                    let f = f.min(ALPHA_MAX / large).min(small / ALPHA_MIN).max(least);
                    if x <= y { (1.0 / f, f) } else { (f, 1.0 / f) }
                }
            };
            let touched = weight[i] > 0.0;
            ax[i] = if touched {
                (x * fx).clamp(ALPHA_MIN, ALPHA_MAX)
            } else {
                x
            };
            ay[i] = if touched {
                (y * fy).clamp(ALPHA_MIN, ALPHA_MAX)
            } else {
                y
            };
        }
    }

    #[inline(always)]
    fn touch(&mut self, erases: bool, weight: &Lane) {
        for i in 0..LANES {
            let c = self.coverage[i];
            self.coverage[i] = if erases {
                c - c * weight[i]
            } else {
                c + (1.0 - c) * weight[i]
            };
        }
    }
}

#[inline(always)]
fn mix(plane: &mut Lane, value: f32, weight: &Lane) {
    for i in 0..LANES {
        let (p, w) = (plane[i], weight[i]);
        plane[i] = chosen(w, p, p + (value - p) * w, value);
    }
}

/// The old number at weight 0, the new at 1, else the blend.
#[inline(always)]
fn chosen(w: f32, old: f32, blend: f32, new: f32) -> f32 {
    let x = if w > 0.0 { blend } else { old };
    if w >= 1.0 { new } else { x }
}

/// (cos 2θ, sin 2θ) of a direction of any length but zero.
#[inline(always)]
fn double_angle(x: f32, y: f32) -> (f32, f32) {
    let square = (x * x + y * y).max(f32::MIN_POSITIVE);
    ((x * x - y * y) / square, 2.0 * x * y / square)
}

/// An axis turned toward another by a part of the angle between them: never through no direction, as a blend would be at right
/// angles.
#[inline(always)]
fn turned((c, s): (f32, f32), (tc, ts): (f32, f32), w: f32) -> (f32, f32) {
    let angle = atan2(c * ts - s * tc, c * tc + s * ts) * w;
    let (sin, cos) = sin_cos(angle.clamp(-PI, PI));
    let (bc, bs) = (c * cos - s * sin, s * cos + c * sin);
    // Rounding would add up over many strokes.
    let scale = 1.5 - 0.5 * (bc * bc + bs * bs);
    (chosen(w, c, bc * scale, tc), chosen(w, s, bs * scale, ts))
}
