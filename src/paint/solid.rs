//! Strokes on a mesh: coverage from distances in space, directions turned into each texel's own frame.

use super::cover::{BEND, Cover, LANES, Lane, Shape, TILE};
use super::skin::{NOWHERE, Places, Skin};
use super::trail::{Node, Piece, Trail};
use super::{Brush, MeshPoints, Points, Stroke, Symmetry};
use crate::map::Rect;
use crate::math::{self, smoothstep};
use fearless_simd::{Simd, dispatch};
use fearless_simd_macros::simd;
use glam::{Mat3, Vec3};
use std::f32::consts::TAU;

/// A surface is painted where its normal leans no more from the stroke's than this cosine says, and in full from the second
/// on: what a brush reaches through a thin wall or around a rim keeps its own paint.
const FACING: (f32, f32) = (0.0, 0.25);

/// What a piece of a brush covers, whose lengths are in the mesh's units.
pub(super) fn shape(scaled: &Brush, skin: &Skin) -> Shape {
    Shape::new(scaled, skin.texel())
}

pub(super) fn node(brush: &Brush, points: &MeshPoints, n: usize) -> Node<Vec3> {
    let (at, side, pressure) = points.get(n);
    Node {
        at,
        side,
        radius: brush.radius_at(pressure),
        flow: brush.flow_at(pressure),
    }
}

/// A mirroring or a turn in space about a place.
#[derive(Clone, Copy, Debug)]
struct Image {
    turn: Mat3,
    center: Vec3,
}

impl Image {
    fn node(&self, node: Node<Vec3>) -> Node<Vec3> {
        Node {
            at: self.center + self.turn * (node.at - self.center),
            side: self.turn * node.side,
            ..node
        }
    }

    fn piece(&self, piece: &Piece<Vec3>) -> Piece<Vec3> {
        Piece {
            ends: piece.ends.map(|n| self.node(n)),
            start: self.turn * piece.start,
            along: self.turn * piece.along,
            end: self.turn * piece.end,
        }
    }
}

/// The copies that belong to each piece of a stroke on the mesh, itself left out: over the upright plane from the front to the
/// back through the middle of the mesh, over the level plane there, over both, or turned about the upright axis there.
#[derive(Clone, Debug)]
pub(super) struct Copies(Vec<Image>);

impl Copies {
    pub(super) fn new(symmetry: &Symmetry, center: Vec3) -> Self {
        let flip = |x: f32, y: f32| Mat3::from_diagonal(Vec3::new(x, y, 1.0));
        let turns: Vec<Mat3> = match *symmetry {
            Symmetry::None => vec![],
            Symmetry::MirrorU { .. } => vec![flip(-1.0, 1.0)],
            Symmetry::MirrorV { .. } => vec![flip(1.0, -1.0)],
            Symmetry::MirrorBoth { .. } => {
                vec![flip(-1.0, 1.0), flip(1.0, -1.0), flip(-1.0, -1.0)]
            }
            Symmetry::Radial { count, .. } => (1..count)
                .map(|n| {
                    let (sin, cos) = math::sin_cos(TAU * n as f32 / count as f32);
                    Mat3::from_cols(Vec3::new(cos, 0.0, -sin), Vec3::Y, Vec3::new(sin, 0.0, cos))
                })
                .collect(),
        };
        let image = |turn| Image { turn, center };
        Self(turns.into_iter().map(image).collect())
    }

    /// Calls `out` with a piece and its copies.
    pub(super) fn each(&self, piece: Piece<Vec3>, mut out: impl FnMut(Piece<Vec3>)) {
        for image in &self.0 {
            out(image.piece(&piece));
        }
        out(piece);
    }
}

/// The pieces of a stroke on the mesh with all copies, whose brush is `scaled` in the mesh's units; none of one in UV.
pub(super) fn pieces(stroke: &Stroke, scaled: &Brush, middle: Vec3) -> Vec<Piece<Vec3>> {
    let brush = scaled;
    let copies = Copies::new(&brush.symmetry, middle);
    let mut found = Vec::new();
    if let (Points::Mesh(points), false) = (stroke.points(), brush.tool.is_everywhere()) {
        let mut trail = Trail::new(brush, stroke.seed());
        for n in 0..points.len() {
            trail.push(node(brush, points, n), |p| {
                copies.each(p, |p| found.push(p));
            });
        }
        trail.tail(|p| copies.each(p, |p| found.push(p)));
    }
    found
}

/// The texels that a piece may change: for each tile, by number, one rectangle.
pub(super) fn touched(piece: &Piece<Vec3>, shape: &Shape, skin: &Skin) -> Vec<(u32, Rect)> {
    let [a, b] = piece.ends;
    // A scratch is straight and the surface is not: it reaches the surface below it.
    let reach = reach(piece, shape) + lift(piece, shape);
    let reach = Vec3::splat(reach);
    skin.touched(a.at.min(b.at) - reach, a.at.max(b.at) + reach)
}

/// How far along the surface a piece covers anything; texels may be four times as large as on the whole.
fn reach(piece: &Piece<Vec3>, shape: &Shape) -> f32 {
    let [a, b] = piece.ends;
    shape.reach(a.radius.max(b.radius)) + 1.5 * shape.texel
}

/// How far over the surface a piece may run and still paint it: nothing but for scratches.
fn lift(piece: &Piece<Vec3>, shape: &Shape) -> f32 {
    if shape.scratch {
        0.5 * piece.ends[0].at.distance(piece.ends[1].at)
    } else {
        0.0
    }
}

/// A piece as the inner loop wants it.
struct Stamp {
    a: Vec3,
    d: Vec3,
    inverse: f32,
    radius: [f32; 2],
    flow: [f32; 2],
    side: [Vec3; 2],
    turning: f32,
    bends: [Vec3; 2],
    whole: f32,
    start: Vec3,
    along: Vec3,
    end: Vec3,
    reach: f32,
    lift: f32,
    flat: f32,
}

impl Stamp {
    fn new(piece: &Piece<Vec3>, shape: &Shape) -> Self {
        let [a, b] = piece.ends;
        let d = b.at - a.at;
        let square = d.length_squared();
        Self {
            a: a.at,
            d,
            inverse: if square > 0.0 { 1.0 / square } else { 0.0 },
            radius: [a.radius, b.radius - a.radius],
            flow: [a.flow, b.flow - a.flow],
            side: [a.side, b.side - a.side],
            turning: piece.turning(square.sqrt()),
            bends: [piece.start, piece.end],
            whole: d.dot(piece.end),
            start: piece.start - piece.along,
            along: piece.along,
            end: piece.end - piece.along,
            reach: reach(piece, shape) + lift(piece, shape),
            lift: lift(piece, shape),
            flat: if shape.scratch { 1.0 } else { 0.0 },
        }
    }

    /// Whether a ball is near enough to be painted in.
    fn meets(&self, center: Vec3, radius: f32) -> bool {
        let q = center - self.a;
        let t = (q.dot(self.d) * self.inverse).clamp(0.0, 1.0);
        (q - self.d * t).length() <= self.reach + radius
    }
}

/// Adds a piece to what a stroke covers in a tile.
pub(super) fn add(cover: &mut Cover, piece: &Piece<Vec3>, shape: &Shape, places: &[Places]) {
    let stamp = Stamp::new(piece, shape);
    for some in places.iter().filter(|p| stamp.meets(p.center, p.radius)) {
        let mut found = [[0.0; LANES]; 4];
        dispatch!(math::level(), simd => add_lane(simd, &stamp, shape, some, &mut found));
        put(cover, some, &found);
    }
}

/// Coverage, nearness and the two parts of the direction at each place.
#[simd]
fn add_lane<S: Simd>(_: S, p: &Stamp, shape: &Shape, some: &Places, out: &mut [Lane; 4]) {
    let dot = |a: [f32; 3], b: Vec3| a[0] * b.x + a[1] * b.y + a[2] * b.z;
    for i in 0..LANES {
        let n = [some.normal[0][i], some.normal[1][i], some.normal[2][i]];
        let q = [
            some.at[0][i] - p.a.x,
            some.at[1][i] - p.a.y,
            some.at[2][i] - p.a.z,
        ];
        let t = (dot(q, p.d) * p.inverse).clamp(0.0, 1.0);
        let e = [q[0] - p.d.x * t, q[1] - p.d.y * t, q[2] - p.d.z * t];
        let over = e[0] * n[0] + e[1] * n[1] + e[2] * n[2];
        let f = over * p.flat;
        let e = [e[0] - n[0] * f, e[1] - n[1] * f, e[2] - n[2] * f];
        let distance = (e[0] * e[0] + e[1] * e[1] + e[2] * e[2]).sqrt();
        let radius = p.radius[0] + p.radius[1] * t;
        let (coverage, deep) = shape.at(distance, radius, some.size[i]);
        let side = [
            p.side[0].x + p.side[1].x * t,
            p.side[0].y + p.side[1].y * t,
            p.side[0].z + p.side[1].z * t,
        ];
        let facing = n[0] * side[0] + n[1] * side[1] + n[2] * side[2];
        let seen = smoothstep(FACING.0, FACING.1, facing);
        let hidden = (facing <= FACING.0) | (f.abs() > p.lift);
        let before = dot(q, p.bends[0]);
        let behind = p.whole - dot(q, p.bends[1]);
        let way = (before / (before + behind).max(1e-30)).clamp(0.0, 1.0);
        let (a, b) = (
            (1.0 - way * p.turning).max(0.0),
            (1.0 - (1.0 - way) * p.turning).max(0.0),
        );
        let v = [
            p.along.x + p.start.x * a + p.end.x * b,
            p.along.y + p.start.y * a + p.end.y * b,
            p.along.z + p.start.z * a + p.end.z * b,
        ];
        let outside = (before < 0.0) | (behind < 0.0);
        let x = v[0] * some.tangent[0][i] + v[1] * some.tangent[1][i] + v[2] * some.tangent[2][i];
        let y =
            v[0] * some.bitangent[0][i] + v[1] * some.bitangent[1][i] + v[2] * some.bitangent[2][i];
        // At a crease the piece has the direction that the place faces, and that runs along the surface there.
        let square = v[0] * v[0] + v[1] * v[1] + v[2] * v[2];
        let lies = if square > 0.0 {
            (x * x + y * y) / square
        } else {
            1.0
        };
        let near = (deep + if outside { 1.0 - BEND } else { 1.0 }) * seen * lies;
        let w = coverage * (p.flow[0] + p.flow[1] * t) * seen;
        out[0][i] = if hidden { 0.0 } else { w };
        out[1][i] = if hidden | (deep <= 0.0) { 0.0 } else { near };
        out[2][i] = x;
        out[3][i] = y;
    }
}

/// Brings what was found to its texels.
fn put(cover: &mut Cover, some: &Places, [weight, near, x, y]: &[Lane; 4]) {
    for i in 0..LANES {
        if some.texel[i] != NOWHERE && near[i] > 0.0 {
            cover.put(usize::from(some.texel[i]), weight[i], near[i], (x[i], y[i]));
        }
    }
}

impl Cover {
    /// Adds what a piece covers at one place of the tile.
    fn put(&mut self, place: usize, weight: f32, near: f32, (x, y): (f32, f32)) {
        let row = place / TILE as usize;
        let lane = (place % TILE as usize / LANES) as u8;
        let span = &mut self.spans[row];
        *span = (span.0.min(lane), span.1.max(lane + 1));
        self.weight[place] = self.weight[place].max(weight);
        if self.depth.is_empty() {
            return;
        }
        let old = (self.depth[place], self.dx[place], self.dy[place]);
        let key = |x: f32, y: f32| [x.abs(), y.abs(), x * y];
        if near > old.0 || near == old.0 && key(x, y) > key(old.1, old.2) {
            (self.depth[place], self.dx[place], self.dy[place]) = (near, x, y);
        }
    }
}
