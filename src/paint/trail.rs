//! From the points of a stroke to the pieces that cover texels: lines, dabs or scratches, each with its direction.
//!
//! Points come one at a time, as a pen gives them. How the path turns at a point is known when the next one is there; so the
//! pieces before the last point but one are final, and those after it stand for what the stroke would be if it ended now.

use super::{Brush, Scratch, Tool};
use crate::math::sin_cos;
use crate::pattern::{hash, unit};
use glam::{Vec2, Vec3};
use std::f32::consts::TAU;
use std::ops::{Add, Mul, Sub};

/// The most pieces of a stroke, copies included: what comes after them is not painted.
const PIECES_MAX: usize = 1 << 20;

/// Positions in UV's surface units, or in space.
pub(super) trait Vector:
    Copy + Add<Output = Self> + Sub<Output = Self> + Mul<f32, Output = Self>
{
    /// What tells the surface's side where the path alone does not: a normal.
    type Side: Copy + std::fmt::Debug;
    const ZERO: Self;
    fn dot(self, other: Self) -> f32;
    /// A quarter turn counter-clockwise in the surface.
    fn across(self, side: Self::Side) -> Self;
    fn mix_sides(a: Self::Side, b: Self::Side, t: f32) -> Self::Side;
}

impl Vector for Vec2 {
    type Side = ();
    const ZERO: Self = Self::ZERO;
    fn dot(self, other: Self) -> f32 {
        self.x * other.x + self.y * other.y
    }
    fn across(self, (): ()) -> Self {
        self.perp()
    }
    fn mix_sides((): (), (): (), _: f32) {}
}

impl Vector for Vec3 {
    type Side = Self;
    const ZERO: Self = Self::ZERO;
    fn dot(self, other: Self) -> f32 {
        self.x * other.x + self.y * other.y + self.z * other.z
    }
    fn across(self, side: Self) -> Self {
        side.cross(self)
    }
    fn mix_sides(a: Self, b: Self, t: f32) -> Self {
        (a + (b - a) * t).normalize_or(a)
    }
}

/// A point of the path with what the brush makes of its pressure.
#[derive(Clone, Copy, Debug)]
pub(super) struct Node<V: Vector> {
    pub(super) at: V,
    pub(super) side: V::Side,
    pub(super) radius: f32,
    pub(super) flow: f32,
}

impl<V: Vector> Node<V> {
    fn mix(a: Self, b: Self, t: f32) -> Self {
        let mix = |p: f32, q: f32| p + (q - p) * t;
        Self {
            at: a.at + (b.at - a.at) * t,
            side: V::mix_sides(a.side, b.side, t),
            radius: mix(a.radius, b.radius),
            flow: mix(a.flow, b.flow),
        }
    }
}

/// What a point adds to a path.
#[derive(Clone, Copy, Debug)]
pub(super) enum Step<V: Vector> {
    /// It goes on to here.
    To(Node<V>),
    /// It stays, and the pressure at its last place is this one's.
    Press(Node<V>),
}

/// A straight part of a stroke: a line between two nodes, or a dab where both are the same. Its direction is `along` in the
/// middle, and turns to `start` and `end` toward its ends; all three point to the same side.
#[derive(Clone, Copy, Debug)]
pub(super) struct Piece<V: Vector> {
    pub(super) ends: [Node<V>; 2],
    pub(super) start: V,
    pub(super) along: V,
    pub(super) end: V,
}

impl<V: Vector> Piece<V> {
    fn dab(node: Node<V>, direction: V) -> Self {
        Self {
            ends: [node; 2],
            start: direction,
            along: direction,
            end: direction,
        }
    }
}

/// What becomes of a path.
#[derive(Clone, Copy, Debug)]
enum Kind {
    Line,
    Dabs { spacing: f32, jitter: f32 },
    Scratches(Scratch),
}

/// Makes pieces of points.
#[derive(Clone, Debug)]
pub(super) struct Trail<V: Vector> {
    kind: Kind,
    /// Whether a point alone is a dab.
    clicks: bool,
    radius: f32,
    seed: u32,
    /// The most pieces.
    most: usize,
    state: State,
    /// The direction of the line before the last.
    before: Option<V>,
    first: Option<Node<V>>,
    second: Option<Node<V>>,
}

/// How far along the path dabs and scratches are.
#[derive(Clone, Copy, Debug, Default)]
struct State {
    travelled: f64,
    /// Where the next dab stands.
    next: f64,
    /// Its number.
    number: u32,
    made: usize,
}

impl<V: Vector> Trail<V> {
    pub(super) fn new(brush: &Brush, seed: u32) -> Self {
        let kind = match brush.tool {
            Tool::Scratch(scratch) => Kind::Scratches(scratch),
            _ if brush.spacing > 0.0 => Kind::Dabs {
                spacing: brush.spacing,
                jitter: brush.jitter,
            },
            _ => Kind::Line,
        };
        Self {
            kind,
            clicks: !brush.tool.follows_stroke(),
            radius: brush.radius,
            seed: hash(seed, 0x7061_696e),
            most: PIECES_MAX / brush.symmetry.copies() as usize,
            state: State::default(),
            before: None,
            first: None,
            second: None,
        }
    }

    /// Goes on by a step, and calls `out` with the pieces that are final now.
    pub(super) fn step(&mut self, step: &Step<V>, out: impl FnMut(Piece<V>)) {
        match *step {
            Step::To(node) => self.push(node, out),
            Step::Press(node) => self.press(node.radius, node.flow),
        }
    }

    /// Adds a point, which is not at the place of the last, and calls `out` with the pieces that are final now.
    pub(super) fn push(&mut self, node: Node<V>, mut out: impl FnMut(Piece<V>)) {
        let (Some(a), Some(b)) = (self.first, self.second) else {
            match self.first {
                None => self.first = Some(node),
                Some(_) => self.second = Some(node),
            }
            return;
        };
        let (along, next) = (direction(a, b), direction(b, node));
        let start = self.before.map_or(along, |before| bisector(along, before));
        let mut state = self.state;
        self.line(
            [a, b],
            [start, along, bisector(along, next)],
            &mut state,
            &mut out,
        );
        self.state = state;
        self.before = Some(along);
        (self.first, self.second) = (Some(b), Some(node));
    }

    /// Puts the last point's pressure up, and what follows from it.
    fn press(&mut self, radius: f32, flow: f32) {
        if let Some(last) = self.second.as_mut().or(self.first.as_mut()) {
            (last.radius, last.flow) = (radius, flow);
        }
    }

    /// Calls `out` with the pieces after the final ones, of a stroke that ends here.
    pub(super) fn tail(&self, mut out: impl FnMut(Piece<V>)) {
        match (self.first, self.second) {
            (Some(a), Some(b)) => {
                let along = direction(a, b);
                let start = self.before.map_or(along, |before| bisector(along, before));
                self.line(
                    [a, b],
                    [start, along, along],
                    &mut self.state.clone(),
                    &mut out,
                );
            }
            (Some(a), None) if self.clicks => out(Piece::dab(a, V::ZERO)),
            _ => {}
        }
    }

    /// The pieces of one line of the path.
    fn line(
        &self,
        ends: [Node<V>; 2],
        [start, along, end]: [V; 3],
        state: &mut State,
        out: &mut impl FnMut(Piece<V>),
    ) {
        let whole = Piece {
            ends,
            start,
            along,
            end,
        };
        let step = ends[1].at - ends[0].at;
        let length = step.dot(step).sqrt();
        let far = state.travelled + f64::from(length);
        if matches!(self.kind, Kind::Line) {
            state.made += 1;
            if state.made <= self.most {
                out(whole);
            }
        }
        while !matches!(self.kind, Kind::Line) && state.made < self.most {
            let place = state.next + self.stray(state.number);
            if place > far {
                break;
            }
            let t = ((place - state.travelled) / f64::from(length.max(f32::MIN_POSITIVE))) as f32;
            let t = t.clamp(0.0, 1.0);
            let node = Node::mix(ends[0], ends[1], t);
            let (piece, step) = self.mark(node, whole.direction(t, length), state.number);
            out(piece);
            state.next += f64::from(step);
            state.number += 1;
            state.made += 1;
        }
        state.travelled = far;
    }

    /// How far the nth mark stands from its even place along the path.
    fn stray(&self, n: u32) -> f64 {
        match self.kind {
            Kind::Scratches(scratch) => {
                f64::from(self.random(n, 0) * 2.0 * self.radius / scratch.density)
            }
            _ => 0.0,
        }
    }

    /// The nth dab or scratch, and the way to the next.
    fn mark(&self, node: Node<V>, direction: V, n: u32) -> (Piece<V>, f32) {
        let side = direction.across(node.side);
        match self.kind {
            Kind::Scratches(scratch) => {
                let step = 2.0 * self.radius / scratch.density;
                (self.scratch(&scratch, node, [direction, side], n), step)
            }
            Kind::Dabs { spacing, jitter } => {
                let angle = sin_cos(self.random(n, 1) * TAU);
                let off = jitter * node.radius * self.random(n, 2).sqrt();
                let node = Node {
                    at: node.at + direction * (off * angle.1) + side * (off * angle.0),
                    ..node
                };
                // However small pressure makes the dabs, they do not stand closer than in a line a hundredth as broad.
                let step = 2.0 * spacing * node.radius.max(0.01 * self.radius);
                (Piece::dab(node, direction), step)
            }
            Kind::Line => unreachable!("a line has no marks"),
        }
    }

    fn scratch(&self, scratch: &Scratch, node: Node<V>, [along, side]: [V; 2], n: u32) -> Piece<V> {
        let lean = (2.0 * self.random(n, 3) - 1.0) * scratch.spread.to_radians();
        let (sin, cos) = sin_cos(lean);
        let direction = along * cos + side * sin;
        let middle = node.at + side * ((2.0 * self.random(n, 4) - 1.0) * node.radius);
        let half = 0.5 * scratch.length * (0.5 + self.random(n, 5));
        let end = |sign: f32| Node {
            at: middle + direction * (sign * half),
            radius: 0.5 * scratch.width,
            ..node
        };
        Piece {
            ends: [end(-1.0), end(1.0)],
            ..Piece::dab(node, direction)
        }
    }

    /// A random number in [0, 1) of the nth mark, for one of several uses.
    fn random(&self, n: u32, purpose: u32) -> f32 {
        unit(hash(n, hash(purpose, self.seed)))
    }
}

impl<V: Vector> Piece<V> {
    /// How steeply the direction turns toward its ends: it is that of the middle but within a radius of the ends, so that a
    /// bend is smooth and a long line stays straight.
    pub(super) fn turning(&self, length: f32) -> f32 {
        let radius = self.ends[0].radius.max(self.ends[1].radius);
        (length / radius.min(0.5 * length).max(f32::MIN_POSITIVE)).min(1e6)
    }

    /// The direction at the part `t` of the way.
    fn direction(&self, t: f32, length: f32) -> V {
        let k = self.turning(length);
        let (a, b) = ((1.0 - t * k).max(0.0), (1.0 - (1.0 - t) * k).max(0.0));
        let v = self.along + (self.start - self.along) * a + (self.end - self.along) * b;
        v * (1.0 / v.dot(v).sqrt().max(f32::MIN_POSITIVE))
    }
}

/// The unit vector from one node to the next; zero where they are too near.
fn direction<V: Vector>(a: Node<V>, b: Node<V>) -> V {
    let d = b.at - a.at;
    let length = d.dot(d).sqrt();
    if length > 0.0 {
        d * (1.0 / length)
    } else {
        V::ZERO
    }
}

/// The direction between two that meet, as lines: on the side of `along`. Where they stand at right angles, `along` itself.
fn bisector<V: Vector>(along: V, other: V) -> V {
    let cos = along.dot(other);
    let v = if cos >= 0.0 {
        along + other
    } else {
        along - other
    };
    let length = v.dot(v).sqrt();
    if cos.abs() < 1e-3 || length == 0.0 {
        along
    } else {
        v * (1.0 / length)
    }
}
