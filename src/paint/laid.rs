//! A stroke laid on a surface: its pieces, its symmetric copies, and the texels they reach.

use super::cover::{Grid, Shape, bounds};
use super::trail::{Node, Piece, Trail};
use super::{Brush, Point, Points, Stroke, Symmetry};
use crate::map::{Rect, Wrap};
use crate::math::sin_cos;
use crate::pattern::Surface;
use glam::Vec2;
use std::f32::consts::TAU;

/// How many periods from the map a piece is looked for at most.
const PERIODS_MAX: f32 = 16.0;

/// The surface as strokes see it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Ground {
    pub(super) grid: Grid,
    pub(super) wrap: Wrap,
}

impl Ground {
    pub(super) fn new(surface: &Surface) -> Self {
        Self {
            grid: Grid::new(surface),
            wrap: surface.wrap,
        }
    }

    pub(super) fn shape(&self, brush: &Brush) -> Shape {
        Shape::new(brush, self.grid.texel.max_element())
    }

    pub(super) fn node(&self, brush: &Brush, point: Point) -> Node<Vec2> {
        let pressure = point.pressure();
        Node {
            at: point.uv() * self.grid.extent,
            side: (),
            radius: brush.radius_at(pressure),
            flow: brush.flow_at(pressure),
        }
    }

    /// Whole periods by which a box may be moved so that it meets the map, as (across, up).
    pub(super) fn periods(&self, low: Vec2, high: Vec2) -> impl Iterator<Item = (i8, i8)> + use<> {
        let range = |low: f32, high: f32, extent: f32, repeats: bool| {
            if !repeats {
                return 0..=0;
            }
            let most = |x: f32| x.clamp(-PERIODS_MAX, PERIODS_MAX) as i8;
            most((-high / extent).ceil())..=most(((extent - low) / extent).floor())
        };
        let extent = self.grid.extent;
        let across = range(low.x, high.x, extent.x, self.wrap.repeats_u());
        let up = range(low.y, high.y, extent.y, self.wrap.repeats_v());
        up.flat_map(move |y| across.clone().map(move |x| (x, y)))
    }

    /// Whole turns of UV by which places lie away from the map, those not all of which [`Ground::periods`] would find.
    pub(super) fn turns_away(&self, uvs: &[Vec2; 3]) -> Vec2 {
        let away = |[a, b, c]: [f32; 3], repeats: bool| {
            let (low, high) = (a.min(b).min(c), a.max(b).max(c));
            let is_found = low >= -PERIODS_MAX && high <= 1.0 + PERIODS_MAX;
            if is_found || !repeats {
                0.0
            } else {
                (0.5 * (low + high)).floor()
            }
        };
        Vec2::new(
            away(uvs.map(|uv| uv.x), self.wrap.repeats_u()),
            away(uvs.map(|uv| uv.y), self.wrap.repeats_v()),
        )
    }

    pub(super) fn shift(&self, (x, y): (i8, i8)) -> Vec2 {
        Vec2::new(f32::from(x), f32::from(y)) * self.grid.extent
    }

    /// Calls `visit` with the texels that a piece may reach, and the periods it is moved by for them.
    pub(super) fn rects(
        &self,
        piece: &Piece<Vec2>,
        shape: &Shape,
        mut visit: impl FnMut(Rect, (i8, i8)),
    ) {
        let (low, high) = bounds(piece, shape);
        for period in self.periods(low, high) {
            let shift = self.shift(period);
            if let Some(rect) = self.grid.cover(low + shift, high + shift) {
                visit(rect, period);
            }
        }
    }
}

/// A turn or mirroring about a place.
#[derive(Clone, Copy, Debug)]
struct Image {
    x: Vec2,
    y: Vec2,
    center: Vec2,
}

impl Image {
    fn vector(&self, v: Vec2) -> Vec2 {
        Vec2::new(
            self.x.x * v.x + self.y.x * v.y,
            self.x.y * v.x + self.y.y * v.y,
        )
    }

    fn node(&self, node: Node<Vec2>) -> Node<Vec2> {
        Node {
            at: self.center + self.vector(node.at - self.center),
            ..node
        }
    }

    fn piece(&self, piece: &Piece<Vec2>) -> Piece<Vec2> {
        Piece {
            ends: piece.ends.map(|n| self.node(n)),
            start: self.vector(piece.start),
            along: self.vector(piece.along),
            end: self.vector(piece.end),
        }
    }
}

/// The copies that belong to each piece of a stroke, itself left out.
#[derive(Clone, Debug)]
pub(super) struct Copies(Vec<Image>);

impl Copies {
    pub(super) fn new(symmetry: &Symmetry, extent: Vec2) -> Self {
        let image = |x: Vec2, y: Vec2, center: [f32; 2]| Image {
            x,
            y,
            center: Vec2::from(center) * extent,
        };
        let (left, down) = (Vec2::NEG_X, Vec2::NEG_Y);
        Self(match *symmetry {
            Symmetry::None => vec![],
            Symmetry::MirrorU { at } => vec![image(left, Vec2::Y, [at, 0.0])],
            Symmetry::MirrorV { at } => vec![image(Vec2::X, down, [0.0, at])],
            Symmetry::MirrorBoth { at } => vec![
                image(left, Vec2::Y, at),
                image(Vec2::X, down, at),
                image(left, down, at),
            ],
            Symmetry::Radial { count, center } => (1..count)
                .map(|n| {
                    let (sin, cos) = sin_cos(TAU * n as f32 / count as f32);
                    image(Vec2::new(cos, sin), Vec2::new(-sin, cos), center)
                })
                .collect(),
        })
    }

    /// Calls `out` with a piece and its copies.
    pub(super) fn each(&self, piece: Piece<Vec2>, mut out: impl FnMut(Piece<Vec2>)) {
        for image in &self.0 {
            out(image.piece(&piece));
        }
        out(piece);
    }
}

/// The pieces of a stroke in UV with all copies; none of one on the mesh.
pub(super) fn pieces(stroke: &Stroke, ground: &Ground) -> Vec<Piece<Vec2>> {
    let brush = stroke.brush();
    let mut found = Vec::new();
    if let (Points::Uv(points), false) = (stroke.points(), brush.tool.is_everywhere()) {
        let copies = Copies::new(&brush.symmetry, ground.grid.extent);
        let mut trail = Trail::new(brush, stroke.seed());
        for point in points {
            trail.push(ground.node(brush, *point), |p| {
                copies.each(p, |p| found.push(p));
            });
        }
        trail.tail(|p| copies.each(p, |p| found.push(p)));
    }
    found
}
