//! What a stroke covers in a tile: per texel the largest coverage of any piece, and the direction of the nearest.
//!
//! Adding pieces is commutative to the bit: of pieces that are equally near, the one with the larger direction counts, number
//! by number and without signs, so that a mirrored stroke is the mirror image. It does not matter in which order a stroke's pieces reach a tile, or whether they came live or from a file.

use super::Brush;
use super::trail::Piece;
use crate::map::Rect;
use crate::math;
use crate::pattern::Surface;
use fearless_simd::{Simd, dispatch};
use fearless_simd_macros::simd;
use glam::{IVec2, Vec2};

/// Side of a tile, texels.
pub(super) const TILE: u32 = 64;
const SIDE: usize = TILE as usize;
/// Texels that are worked on side by side; a tile's rows are whole numbers of them.
pub(super) const LANES: usize = 16;
pub(super) type Lane = [f32; LANES];

/// How coverage falls from the middle of a piece to its rim.
#[derive(Clone, Copy, Debug)]
pub(super) struct Shape {
    /// The part of the radius over which it falls.
    soft: f32,
    /// The least breadth of the fall: a texel.
    pub(super) texel: f32,
    /// Whether pieces are scratches, hard and straight.
    pub(super) scratch: bool,
}

impl Shape {
    pub(super) fn new(brush: &Brush, texel: f32) -> Self {
        let scratch = matches!(brush.tool, super::Tool::Scratch(_));
        Self {
            soft: if scratch { 0.0 } else { 1.0 - brush.hardness },
            texel,
            scratch,
        }
    }

    /// How far from a piece of this radius coverage reaches.
    pub(super) fn reach(&self, radius: f32) -> f32 {
        // The fall is broader than a texel or a texel broad, half of it outside.
        radius.max((1.0 - 0.5 * self.soft) * radius + 0.5 * self.texel)
    }

    /// Coverage at a distance from the middle where texels are so large, and how deep inside the rim that is, in breadths of the
    /// fall.
    #[inline(always)]
    pub(super) fn at(&self, distance: f32, radius: f32, texel: f32) -> (f32, f32) {
        let fall = (self.soft * radius).max(texel);
        let depth = ((1.0 - 0.5 * self.soft) * radius + 0.5 * fall - distance) / fall;
        let s = depth.clamp(0.0, 1.0);
        // A piece thinner than a texel covers a part of it.
        let thin = (2.0 * radius / texel).min(1.0);
        (s * s * (3.0 - 2.0 * s) * thin, depth)
    }
}

/// Coverage of one tile.
#[derive(Clone, Debug)]
pub(super) struct Cover {
    /// First column and row of the tile in the map.
    pub(super) origin: IVec2,
    pub(super) weight: Vec<f32>,
    /// How deep a texel lies in the nearest piece, and the direction there; empty for tools to which it does not matter.
    pub(super) depth: Vec<f32>,
    pub(super) dx: Vec<f32>,
    pub(super) dy: Vec<f32>,
    /// For each row the lanes that may be covered: first and one past the last.
    pub(super) spans: [(u8, u8); SIDE],
}

/// What boxes have to spare for rounding, texels: sixteen turns away f32 rounds by a 64th of a texel of a map of 16384.
pub(super) const SPARE: f32 = 0.05;

/// How much farther away a piece counts beyond the bends at its ends, in breadths of its fall.
pub(super) const BEND: f32 = 0.01;

const NO_SPAN: (u8, u8) = (u8::MAX, 0);

impl Cover {
    /// Nothing yet; of a tool that `follows` the stroke, with the direction.
    pub(super) fn new(origin: IVec2, follows: bool) -> Self {
        let plane = |is_there: bool| vec![0.0; if is_there { SIDE * SIDE } else { 0 }];
        Self {
            origin,
            weight: plane(true),
            depth: plane(follows),
            dx: plane(follows),
            dy: plane(follows),
            spans: [NO_SPAN; SIDE],
        }
    }

    /// Whether directions are kept.
    fn follows(&self) -> bool {
        !self.depth.is_empty()
    }

    /// The direction of [`LANES`] texels, of no length where none is kept.
    pub(super) fn direction(&self, place: usize) -> (&Lane, &Lane) {
        const NONE: &Lane = &[0.0; LANES];
        if self.follows() {
            (lane(&self.dx, place), lane(&self.dy, place))
        } else {
            (NONE, NONE)
        }
    }

    /// Moves to another tile, where nothing is covered yet.
    pub(super) fn clear(&mut self, origin: IVec2) {
        let follows = self.follows();
        self.origin = origin;
        for (row, span) in self.spans.iter_mut().enumerate() {
            let (from, to) = (usize::from(span.0) * LANES, usize::from(span.1) * LANES);
            if from < to {
                let places = row * SIDE + from..row * SIDE + to;
                self.weight[places.clone()].fill(0.0);
                if follows {
                    self.depth[places].fill(0.0);
                }
            }
            *span = NO_SPAN;
        }
    }

    /// Takes over what another tile of the same place and tool holds.
    pub(super) fn copy_from(&mut self, other: &Self) {
        self.clear(other.origin);
        self.spans = other.spans;
        for (row, span) in self.spans.iter().enumerate() {
            let (from, to) = (usize::from(span.0) * LANES, usize::from(span.1) * LANES);
            if from < to {
                let places = row * SIDE + from..row * SIDE + to;
                self.weight[places.clone()].copy_from_slice(&other.weight[places.clone()]);
                if other.follows() {
                    self.depth[places.clone()].copy_from_slice(&other.depth[places.clone()]);
                    self.dx[places.clone()].copy_from_slice(&other.dx[places.clone()]);
                    self.dy[places.clone()].copy_from_slice(&other.dy[places]);
                }
            }
        }
    }

    /// The same coverage everywhere in the tile.
    pub(super) fn fill(&mut self, weight: f32) {
        self.weight.fill(weight);
        self.spans = [(0, (SIDE / LANES) as u8); SIDE];
    }

    /// Whether nothing is covered.
    pub(super) fn is_empty(&self) -> bool {
        self.spans.iter().all(|s| *s == NO_SPAN)
    }

    /// Where another tile differs from this one in what strokes make of it: in coverage, or in the direction of what is covered
    /// where both keep it. `None` where they are alike; told in whole lanes, counted inside the tile.
    pub(super) fn difference(&self, other: &Self) -> Option<Rect> {
        let follows = self.follows() && other.follows();
        let (mut left, mut right) = (SIDE, 0);
        let (mut top, mut bottom) = (SIDE, 0);
        for row in 0..SIDE {
            let (a, b) = (self.spans[row], other.spans[row]);
            let lanes = usize::from(a.0.min(b.0))..usize::from(a.1.max(b.1));
            let differs = |n: &usize| {
                let place = row * SIDE + n * LANES;
                let of = |plane: fn(&Self) -> &[f32]| {
                    (lane(plane(self), place), lane(plane(other), place))
                };
                let weight = of(|c| &c.weight);
                weight.0 != weight.1
                    || follows && leans_otherwise(weight.0, of(|c| &c.dx), of(|c| &c.dy))
            };
            let Some(first) = lanes.clone().find(differs) else {
                continue;
            };
            let last = lanes.rev().find(differs).unwrap_or(first);
            (left, right) = (left.min(first * LANES), right.max((last + 1) * LANES));
            (top, bottom) = (top.min(row), row + 1);
        }
        (top < bottom).then(|| Rect {
            x: left as u32,
            y: top as u32,
            width: (right - left) as u32,
            height: (bottom - top) as u32,
        })
    }

    /// Adds a piece that is moved by `shift`, in the rows and columns of `rect`, which lies in the tile.
    pub(super) fn add(
        &mut self,
        piece: &Piece<Vec2>,
        shift: Vec2,
        shape: &Shape,
        grid: &Grid,
        rect: Rect,
    ) {
        let stamp = Stamp::new(piece, shift);
        let reach = stamp.reach(shape) + SPARE * shape.texel;
        let (top, bottom) = (grid.y(rect.y), grid.y(rect.y + rect.height - 1));
        if stamp.span(bottom, top, reach).is_none() {
            return;
        }
        let first = (rect.x as i32 - self.origin.x) as usize / LANES;
        let last = (rect.x as i32 - self.origin.x) as usize + rect.width as usize;
        let last = last.div_ceil(LANES);
        let columns = (first, last);
        dispatch!(math::level(), simd => add_rows(simd, self, &stamp, shape, grid, rect, columns, reach));
    }
}

/// Where texels lie on the surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Grid {
    pub(super) texel: Vec2,
    pub(super) extent: Vec2,
    pub(super) width: u32,
    pub(super) height: u32,
}

impl Grid {
    pub(super) fn new(surface: &Surface) -> Self {
        Self {
            texel: surface.texel(),
            extent: surface.extent(),
            width: surface.size.width(),
            height: surface.size.height(),
        }
    }

    /// All texels.
    pub(super) fn whole(&self) -> Rect {
        Rect {
            x: 0,
            y: 0,
            width: self.width,
            height: self.height,
        }
    }

    /// Height of the centres of a row of texels, surface units.
    pub(super) fn y(&self, row: u32) -> f32 {
        self.extent.y - (row as f32 + 0.5) * self.texel.y
    }

    /// The texels whose centres may lie in a box, which has [`SPARE`] texels to spare for rounding; `None` outside the map.
    pub(super) fn cover(&self, low: Vec2, high: Vec2) -> Option<Rect> {
        let clamp = |x: f32, n: u32| (x.max(0.0) as u32).min(n);
        let left = clamp((low.x / self.texel.x - 0.5).ceil(), self.width);
        let right = clamp((high.x / self.texel.x + 0.5).floor(), self.width);
        let top = clamp(
            ((self.extent.y - high.y) / self.texel.y - 0.5).ceil(),
            self.height,
        );
        let bottom = clamp(
            ((self.extent.y - low.y) / self.texel.y + 0.5).floor(),
            self.height,
        );
        (right > left && bottom > top).then(|| Rect {
            x: left,
            y: top,
            width: right - left,
            height: bottom - top,
        })
    }
}

/// A piece as the inner loop wants it.
pub(super) struct Stamp {
    a: Vec2,
    d: Vec2,
    inverse: f32,
    radius: [f32; 2],
    flow: [f32; 2],
    turning: f32,
    /// The directions in the bends at both ends, and how far the end lies along the second.
    bends: [Vec2; 2],
    whole: f32,
    start: Vec2,
    along: Vec2,
    end: Vec2,
}

impl Stamp {
    pub(super) fn new(piece: &Piece<Vec2>, shift: Vec2) -> Self {
        let [a, b] = piece.ends;
        let d = b.at - a.at;
        let square = d.dot(d);
        Self {
            a: a.at + shift,
            d,
            inverse: if square > 0.0 { 1.0 / square } else { 0.0 },
            radius: [a.radius, b.radius - a.radius],
            flow: [a.flow, b.flow - a.flow],
            turning: piece.turning(square.sqrt()),
            bends: [piece.start, piece.end],
            whole: d.dot(piece.end),
            start: piece.start - piece.along,
            along: piece.along,
            end: piece.end - piece.along,
        }
    }

    /// How far from its line it covers anything.
    pub(super) fn reach(&self, shape: &Shape) -> f32 {
        shape.reach(self.radius[0].max(self.radius[0] + self.radius[1]))
    }

    /// Where it may cover anything between two heights: left and right end.
    pub(super) fn span(&self, low: f32, high: f32, reach: f32) -> Option<(f32, f32)> {
        let b = self.a + self.d;
        if high < self.a.y.min(b.y) - reach || low > self.a.y.max(b.y) + reach {
            return None;
        }
        let (mut left, mut right) = (self.a.x.min(b.x), self.a.x.max(b.x));
        // The part of the line within reach of the heights, then as far to the sides as the piece is broad.
        if self.d.y.abs() > 1e-12 {
            let at = |height: f32| {
                self.a.x + self.d.x * ((height - self.a.y) / self.d.y).clamp(0.0, 1.0)
            };
            let (p, q) = (at(low - reach), at(high + reach));
            (left, right) = (left.max(p.min(q)), right.min(p.max(q)));
        }
        Some((left - reach, right + reach))
    }
}

#[simd]
#[allow(
    clippy::too_many_arguments,
    reason = "one loop nest, cut out to be compiled once per CPU level"
)]
fn add_rows<S: Simd>(
    _: S,
    cover: &mut Cover,
    stamp: &Stamp,
    shape: &Shape,
    grid: &Grid,
    rect: Rect,
    columns: (usize, usize),
    reach: f32,
) {
    let follows = cover.follows();
    let per_lane = 1.0 / (grid.texel.x * LANES as f32);
    let origin = cover.origin.x as f32;
    for row in rect.y..rect.y + rect.height {
        let y = grid.y(row);
        let Some((left, right)) = stamp.span(y, y, reach) else {
            continue;
        };
        // In lanes from the tile's left edge, half a texel to spare.
        let lane = |x: f32| x * per_lane - (origin + 0.5) * (1.0 / LANES as f32);
        let from = (lane(left).max(columns.0 as f32) as usize).max(columns.0);
        let to = ((lane(right) + 1.0 / LANES as f32).max(0.0) as usize + 1).min(columns.1);
        if from >= to {
            continue;
        }
        let j = (row as i32 - cover.origin.y) as usize;
        let span = &mut cover.spans[j];
        *span = (span.0.min(from as u8), span.1.max(to as u8));
        let qy = y - stamp.a.y;
        for lane in from..to {
            let place = j * SIDE + lane * LANES;
            let x = (cover.origin.x + (lane * LANES) as i32) as f32 + 0.5;
            let at = (x, grid.texel.x, qy);
            if !follows {
                add_weight(stamp, shape, at, lane_mut(&mut cover.weight, place));
                continue;
            }
            add_lane(
                stamp,
                shape,
                at,
                lane_mut(&mut cover.weight, place),
                lane_mut(&mut cover.depth, place),
                lane_mut(&mut cover.dx, place),
                lane_mut(&mut cover.dy, place),
            );
        }
    }
}

/// [`LANES`] texels of a plane.
#[inline(always)]
pub(super) fn lane_mut(plane: &mut [f32], place: usize) -> &mut Lane {
    (&mut plane[place..place + LANES])
        .try_into()
        .expect("a lane's length")
}

/// Whether any texel of a lane that is covered has another direction.
fn leans_otherwise(weight: &Lane, dx: (&Lane, &Lane), dy: (&Lane, &Lane)) -> bool {
    (0..LANES).fold(false, |any, i| {
        let other = (dx.0[i] != dx.1[i]) | (dy.0[i] != dy.1[i]);
        any | ((weight[i] > 0.0) & other)
    })
}

/// [`LANES`] texels of a plane.
#[inline(always)]
pub(super) fn lane(plane: &[f32], place: usize) -> &Lane {
    plane[place..place + LANES]
        .try_into()
        .expect("a lane's length")
}

/// What a piece covers of the `i`th texel of a lane, how deep that lies, and where it is from the piece's first end.
#[inline(always)]
fn covered(p: &Stamp, shape: &Shape, (x, texel, qy): (f32, f32, f32), i: usize) -> (f32, f32, f32) {
    let qx = (x + i as i32 as f32) * texel - p.a.x;
    let t = ((qx * p.d.x + qy * p.d.y) * p.inverse).clamp(0.0, 1.0);
    let (ex, ey) = (qx - p.d.x * t, qy - p.d.y * t);
    let distance = (ex * ex + ey * ey).sqrt();
    let radius = p.radius[0] + p.radius[1] * t;
    let (coverage, deep) = shape.at(distance, radius, shape.texel);
    (coverage * (p.flow[0] + p.flow[1] * t), deep, qx)
}

/// [`add_lane`] without the direction.
#[inline(always)]
fn add_weight(p: &Stamp, shape: &Shape, at: (f32, f32, f32), weight: &mut Lane) {
    for (i, weight) in weight.iter_mut().enumerate() {
        let (w, _, _) = covered(p, shape, at, i);
        *weight = if w > *weight { w } else { *weight };
    }
}

#[inline(always)]
fn add_lane(
    p: &Stamp,
    shape: &Shape,
    at: (f32, f32, f32),
    weight: &mut Lane,
    depth: &mut Lane,
    dx: &mut Lane,
    dy: &mut Lane,
) {
    let (_, _, qy) = at;
    for i in 0..LANES {
        let (w, deep, qx) = covered(p, shape, at, i);
        // The part of the way for the direction is told between the lines that halve the bends at both ends: so it goes on
        // evenly from piece to piece, inside a bend as outside.
        let before = qx * p.bends[0].x + qy * p.bends[0].y;
        let behind = p.whole - (qx * p.bends[1].x + qy * p.bends[1].y);
        let way = (before / (before + behind).max(1e-30)).clamp(0.0, 1.0);
        let (a, b) = (
            (1.0 - way * p.turning).max(0.0),
            (1.0 - (1.0 - way) * p.turning).max(0.0),
        );
        let vx = p.along.x + p.start.x * a + p.end.x * b;
        let vy = p.along.y + p.start.y * a + p.end.y * b;
        // Where two pieces are equally near, at their joint, the one on whose side of the bend the texel lies.
        let outside = (before < 0.0) | (behind < 0.0);
        let near = deep + if outside { 1.0 - BEND } else { 1.0 };
        let (x, y, ox, oy) = (vx.abs(), vy.abs(), dx[i].abs(), dy[i].abs());
        let leans = (y > oy) | ((y == oy) & (vx * vy > dx[i] * dy[i]));
        let larger = (x > ox) | ((x == ox) & leans);
        let nearer = (near > depth[i]) | ((near == depth[i]) & larger);
        let nearer = nearer & (deep > 0.0);
        weight[i] = if w > weight[i] { w } else { weight[i] };
        depth[i] = if nearer { near } else { depth[i] };
        dx[i] = if nearer { vx } else { dx[i] };
        dy[i] = if nearer { vy } else { dy[i] };
    }
}

/// The box that a piece may cover anything in.
pub(super) fn bounds(piece: &Piece<Vec2>, shape: &Shape) -> (Vec2, Vec2) {
    let [a, b] = piece.ends;
    let reach = Vec2::splat(shape.reach(a.radius.max(b.radius)) + SPARE * shape.texel);
    (a.at.min(b.at) - reach, a.at.max(b.at) + reach)
}
