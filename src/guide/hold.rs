//! What the guides want at a place: how firmly, and which direction.
//!
//! Every guide has at every place a hold c from 0 to 1 (its strength inside its shape or on its line, falling to 0 over its
//! falloff) and a direction t as a double angle. Guides lie over one another as layers do: a guide takes the part c of what
//! those before it hold, so that with A the hold of all and T their directions weighted by their holds,
//!
//! ```text
//! A = A (1 - c) + c,    T = T (1 - c) + c t;    a smooth guide: A = A (1 - c), T = T (1 - c)
//! ```
//!
//! What is left, 1 - A, belongs to the solver. The weight that ties its field to T/A is the odds A / (1 - A) over the
//! falloff squared: the field then yields within the falloff, whatever the grid, and a surface scaled as a whole gives the
//! field scaled as a whole. All of it changes smoothly with the place of a guide: nothing is rasterised.
//!
//! Where the map repeats, a guide is seen again every turn; the holds of its images are one minus the product of what each
//! leaves, and their directions are averaged by hold.

use super::shape::{Guide, Mode, Placement, Segment, Shape, double_angle};
use super::{Guides, WEIGHT_MAX};
use crate::error::{Error, Result};
use crate::map::Wrap;
use crate::math::{exp, level, smoothstep};
use fearless_simd::{Simd, dispatch};
use fearless_simd_macros::simd;
use glam::Vec2;
use std::f32::consts::TAU;

/// Where a map repeats, the most turns of UV that one guide may reach over.
const TURNS_MAX: f32 = 8.0;
/// The most straight pieces that all paths may have together, images counted.
const PIECES_MAX: usize = 1 << 17;
/// The least falloff, in cells: less would make a guide's edge a step that jumps from cell to cell as it moves.
const FALLOFF_CELLS: f32 = 2.0;
/// How near the straight pieces of a curve stay to it, in cells: far less than any falloff.
const ACCURACY_CELLS: f32 = 0.4;
/// How much of its sides a corner of a line is cut by, in cells: through a square corner directions would cancel, and the
/// field beyond it had nowhere to turn.
const CORNER_CELLS: f32 = 2.0;
/// The most evaluations of pieces at cells: about half a minute of two cores.
const WORK_MAX: f64 = 4e10;
/// From this hold on the guides' own direction takes over from the solved one; at 1 it stands alone. See [`Hold::exactness`].
const EXACT_FROM: f32 = 0.9;

/// A box on the surface.
#[derive(Clone, Copy, Debug)]
struct Bounds {
    least: Vec2,
    most: Vec2,
}

impl Bounds {
    fn of(points: impl IntoIterator<Item = Vec2>) -> Self {
        let nothing = Self {
            least: Vec2::INFINITY,
            most: Vec2::NEG_INFINITY,
        };
        points.into_iter().fold(nothing, |b, p| Self {
            least: b.least.min(p),
            most: b.most.max(p),
        })
    }

    fn grown(self, by: f32) -> Self {
        Self {
            least: self.least - by,
            most: self.most + by,
        }
    }

    fn moved(self, by: Vec2) -> Self {
        Self {
            least: self.least + by,
            most: self.most + by,
        }
    }

    /// The area of its part on one turn of UV.
    fn area_within(&self, extent: Vec2) -> f64 {
        let sides = self.most.min(extent) - self.least.max(Vec2::ZERO);
        f64::from(sides.x.max(0.0)) * f64::from(sides.y.max(0.0))
    }

    /// Whether the row at `y` meets it, and which of the ascending `xs` do.
    fn columns(&self, y: f32, xs: &[f32]) -> Option<std::ops::Range<usize>> {
        if y < self.least.y || y > self.most.y {
            return None;
        }
        let from = xs.partition_point(|&x| x < self.least.x);
        let to = xs.partition_point(|&x| x <= self.most.x);
        (from < to).then_some(from..to)
    }
}

/// A guide made ready for one surface and grid.
struct Placed {
    kind: Kind,
    bounds: Bounds,
    strength: f32,
    /// One over the falloff.
    steepness: f32,
    /// Whether it has no direction of its own.
    lets_go: bool,
}

enum Kind {
    Oval(Vec<Oval>),
    Box(Vec<Rectangle>),
    Path(Path),
}

/// One image of an ellipse or of a spiral's disc.
struct Oval {
    bounds: Bounds,
    frame: Frame,
    radii: Vec2,
    /// A spiral's step over a full circle, in surface units; 0 for an ellipse.
    lean: f32,
}

/// One image of a rectangle.
struct Rectangle {
    bounds: Bounds,
    frame: Frame,
    half: Vec2,
    corner: f32,
    /// Over this length its lines turn from side to side.
    softness: f32,
}

/// The pieces of a line or curve, with all their images.
struct Path {
    pieces: Vec<(Bounds, Segment)>,
    closed: bool,
    /// The unit in which nearness is weighed: a fraction of a cell.
    near: f32,
    lead: Lead,
}

/// Where a closed shape's own coordinates lie, and what it does with the direction along its lines.
#[derive(Clone, Copy)]
struct Frame {
    center: Vec2,
    x_axis: Vec2,
    lead: Lead,
}

/// What becomes of the double angle along the lines: `turn` times it, plus `fixed`.
#[derive(Clone, Copy)]
struct Lead {
    turn: Vec2,
    fixed: Vec2,
}

impl Lead {
    /// `along` is the double angle of the axes that the shape's directions are given in.
    fn new(guide: &Guide, place: &Placement, along: Vec2) -> Self {
        let axis = |degrees: f32| {
            let a = crate::math::Axis::from_degrees(degrees);
            a.double_angle()
        };
        match guide.mode {
            Mode::Concentric => Self {
                turn: axis(guide.angle).rotate(along),
                fixed: Vec2::ZERO,
            },
            Mode::Radial => Self {
                turn: -axis(guide.angle).rotate(along),
                fixed: Vec2::ZERO,
            },
            Mode::Constant => Self {
                turn: Vec2::ZERO,
                fixed: axis(guide.angle).rotate(double_angle(place.x_axis)),
            },
            Mode::Smooth => Self {
                turn: Vec2::ZERO,
                fixed: Vec2::ZERO,
            },
        }
    }

    #[inline(always)]
    fn of(self, cos2: f32, sin2: f32) -> (f32, f32) {
        (
            self.turn.x * cos2 - self.turn.y * sin2 + self.fixed.x,
            self.turn.x * sin2 + self.turn.y * cos2 + self.fixed.y,
        )
    }
}

/// The images of a box that meet one turn of UV, as shifts in surface units.
fn images(bounds: Bounds, extent: Vec2, wrap: Wrap, at: &str) -> Result<Vec<Vec2>> {
    let axis = |least: f32, most: f32, extent: f32, repeats: bool| {
        if !repeats {
            let meets = most >= 0.0 && least <= extent;
            return Ok(if meets { vec![0.0] } else { vec![] });
        }
        if most - least > TURNS_MAX * extent {
            return Err(Error::invalid(
                at,
                format!(
                    "{} turns of UV across with its falloff",
                    (most - least) / extent
                ),
                format!("allowed: at most {TURNS_MAX} where the map repeats"),
            )
            .with_hint("Make the guide or its falloff smaller, or set `wrap = \"clamp\"`"));
        }
        let (first, last) = ((-most / extent).ceil(), (1.0 - least / extent).floor());
        Ok((first as i64..=last as i64)
            .map(|i| i as f32 * extent)
            .collect())
    };
    let us = axis(bounds.least.x, bounds.most.x, extent.x, wrap.repeats_u())?;
    let vs = axis(bounds.least.y, bounds.most.y, extent.y, wrap.repeats_v())?;
    let shifts = vs
        .iter()
        .flat_map(|&v| us.iter().map(move |&u| Vec2::new(u, v)));
    Ok(shifts.collect())
}

impl Placed {
    fn new(guide: &Guide, aspect: f32, wrap: Wrap, cell: f32, at: &str) -> Result<Self> {
        let place = guide.placement(aspect);
        let falloff = guide.falloff.max(FALLOFF_CELLS * cell);
        let scale = place.scale;
        let closed = |half: Vec2| {
            let (x, y) = (place.x_axis * half.x, place.x_axis.perp() * half.y);
            let reach = x.abs() + y.abs();
            let around = Bounds::of([place.center - reach, place.center + reach]).grown(falloff);
            let shifts = images(around, place.extent, wrap, at)?;
            let frame = Frame {
                center: place.center,
                x_axis: place.x_axis,
                lead: Lead::new(guide, &place, double_angle(place.x_axis)),
            };
            Ok::<_, Error>(shifts.into_iter().map(move |by| {
                let center = frame.center + by;
                (around.moved(by), Frame { center, ..frame })
            }))
        };
        let oval = |radii: Vec2, lean: f32| {
            let images = closed(radii)?.map(|(bounds, frame)| Oval {
                bounds,
                frame,
                radii,
                lean,
            });
            Ok::<_, Error>(Kind::Oval(images.collect()))
        };
        let kind = match guide.shape {
            Shape::Ellipse { radii } => oval(Vec2::from(radii) * scale, 0.0)?,
            Shape::Spiral { radius, pitch } => {
                oval(Vec2::splat(radius * scale), pitch * scale / TAU)?
            }
            Shape::Rectangle { size, corner } => {
                let half = 0.5 * scale * Vec2::from(size);
                let corner = (corner * scale).min(half.min_element());
                let softness = (0.5 * corner).max(1.5 * cell);
                let images = closed(half)?.map(|(bounds, frame)| Rectangle {
                    bounds,
                    frame,
                    half,
                    corner,
                    softness,
                });
                Kind::Box(images.collect())
            }
            Shape::Line { .. } | Shape::Curve { .. } => {
                Kind::Path(Path::new(guide, &place, wrap, falloff, cell, at)?)
            }
        };
        Ok(Self {
            bounds: kind.bounds(),
            kind,
            strength: guide.strength,
            steepness: 1.0 / falloff,
            lets_go: guide.mode == Mode::Smooth,
        })
    }
}

impl Kind {
    /// Of all images.
    fn bounds(&self) -> Bounds {
        Bounds::of(self.pieces().flat_map(|b| [b.least, b.most]))
    }

    /// Every image, or every piece of every image.
    fn pieces(&self) -> Box<dyn Iterator<Item = &Bounds> + '_> {
        match self {
            Self::Oval(images) => Box::new(images.iter().map(|i| &i.bounds)),
            Self::Box(images) => Box::new(images.iter().map(|i| &i.bounds)),
            Self::Path(path) => Box::new(path.pieces.iter().map(|(b, _)| b)),
        }
    }
}

impl Path {
    fn new(
        guide: &Guide,
        place: &Placement,
        wrap: Wrap,
        falloff: f32,
        cell: f32,
        at: &str,
    ) -> Result<Self> {
        let segments = guide.segments(place.extent.x, ACCURACY_CELLS * cell, CORNER_CELLS * cell);
        let ends = |s: &Segment| [s.from, s.to];
        let around = Bounds::of(segments.iter().flat_map(ends)).grown(falloff);
        let closed = guide.shape.points().is_some_and(|(_, closed)| closed);
        let mut pieces = Vec::new();
        if !segments.is_empty() {
            for by in images(around, place.extent, wrap, at)? {
                pieces.extend(segments.iter().map(|s| {
                    // Inside a closed path every piece has a say; beside an open one only those within the falloff.
                    let own = Bounds::of(ends(s)).grown(falloff);
                    let bounds = if closed { around } else { own };
                    let moved = Segment {
                        from: s.from + by,
                        to: s.to + by,
                        ..*s
                    };
                    (bounds.moved(by), moved)
                }));
            }
        }
        Ok(Self {
            pieces,
            closed,
            near: 0.05 * cell,
            lead: Lead::new(guide, place, Vec2::X),
        })
    }
}

/// One row of places: what all guides together hold there.
#[derive(Default)]
pub(super) struct Row {
    /// A: how much of the place the guides hold, 0 to 1.
    pub(super) hold: Vec<f32>,
    /// T: their directions as double angles, weighted by hold.
    pub(super) cos2: Vec<f32>,
    pub(super) sin2: Vec<f32>,
    /// The sum of hold over falloff squared.
    pub(super) odds: Vec<f32>,
    one: One,
}

/// What one guide holds along a row.
#[derive(Default)]
struct One {
    /// What its images leave: one minus its hold.
    left: Vec<f32>,
    /// Sums of weight and of weighted directions.
    weight: Vec<f32>,
    cos2: Vec<f32>,
    sin2: Vec<f32>,
    /// Of a path: the square of the distance, and how often it winds around the place.
    square: Vec<f32>,
    winding: Vec<f32>,
}

impl Row {
    /// Room for `n` places, nothing held.
    fn clear(&mut self, n: usize) {
        for v in [
            &mut self.hold,
            &mut self.cos2,
            &mut self.sin2,
            &mut self.odds,
        ] {
            v.clear();
            v.resize(n, 0.0);
        }
    }
}

/// The guides made ready for one surface and grid.
pub(super) struct Hold {
    placed: Vec<Placed>,
    /// 1 / (cell² WEIGHT_MAX): the share that keeps odds finite.
    least_left: f32,
}

impl Hold {
    /// `cell` is the larger side of a cell of the grid, in surface units.
    ///
    /// # Errors
    /// When a guide reaches over too many turns of UV, or all have too many pieces.
    pub(super) fn new(guides: &Guides, aspect: f32, wrap: Wrap, cell: f32) -> Result<Self> {
        let mut placed = Vec::new();
        let (mut pieces, mut work) = (0, 0.0);
        for (i, guide) in guides.guide.iter().enumerate() {
            if guide.strength == 0.0 {
                continue;
            }
            let one = Placed::new(guide, aspect, wrap, cell, &format!("guide.{i}"))?;
            pieces += one.kind.pieces().count();
            let extent = Vec2::new(aspect, 1.0);
            let areas = one.kind.pieces().map(|b| b.area_within(extent));
            work += areas.sum::<f64>() / f64::from(cell * cell);
            if pieces > PIECES_MAX || work > WORK_MAX {
                return Err(Error::invalid(
                    format!("guide.{i}.shape"),
                    format!("one that brings all guides to {pieces} straight pieces, weighed {work:.0e} times"),
                    format!("allowed: {PIECES_MAX} pieces, images beyond the edge counted, and {WORK_MAX:.0e} times"),
                )
                .with_hint("Use fewer points, a coarser `grid` or smaller closed paths"));
            }
            placed.push(one);
        }
        Ok(Self {
            placed,
            least_left: cell * cell / WEIGHT_MAX,
        })
    }

    /// Whether no guide holds anything: then there is no field either.
    pub(super) fn is_empty(&self) -> bool {
        self.placed
            .iter()
            .all(|p| p.lets_go || p.kind.pieces().next().is_none())
    }

    /// What the guides hold at the height `y`, at the ascending places `xs`, both in surface units.
    pub(super) fn row(&self, y: f32, xs: &[f32], row: &mut Row) {
        row.clear(xs.len());
        let level = level();
        for placed in &self.placed {
            let Some(range) = placed.bounds.columns(y, xs) else {
                continue;
            };
            let xs = &xs[range.clone()];
            let one = &mut row.one;
            one.clear(xs.len());
            match &placed.kind {
                Kind::Oval(images) => images.iter().for_each(|image| {
                    if let Some(part) = image.bounds.columns(y, xs) {
                        let out = one.part(part.clone());
                        dispatch!(level, simd => oval(simd, image, placed, y, &xs[part], out));
                    }
                }),
                Kind::Box(images) => images.iter().for_each(|image| {
                    if let Some(part) = image.bounds.columns(y, xs) {
                        let out = one.part(part.clone());
                        dispatch!(level, simd => rectangle(simd, image, placed, y, &xs[part], out));
                    }
                }),
                Kind::Path(path) => {
                    for (bounds, segment) in &path.pieces {
                        if let Some(part) = bounds.columns(y, xs) {
                            let out = one.part(part.clone());
                            dispatch!(level, simd => piece(simd, segment, path, placed, y, &xs[part], out));
                        }
                    }
                    let out = one.part(0..xs.len());
                    dispatch!(level, simd => end_path(simd, path, placed, out));
                }
            }
            let out = Sums {
                hold: &mut row.hold[range.clone()],
                cos2: &mut row.cos2[range.clone()],
                sin2: &mut row.sin2[range.clone()],
                odds: &mut row.odds[range],
            };
            dispatch!(level, simd => lay_over(simd, placed, one, out));
        }
    }

    /// The weight that ties the field to T/A, per square surface unit: the odds of the hold over the falloff squared. It ends
    /// at [`WEIGHT_MAX`] per cell, where nothing more can be told from a field that is held fast.
    pub(super) fn weight(&self, hold: f32, odds: f32) -> f32 {
        let left = (1.0 - hold).max(0.0);
        let scale = left + odds * self.least_left;
        if scale > 0.0 { odds / scale } else { 0.0 }
    }

    /// How far the guides' own direction stands for the solved one, 0 to 1: where they hold nearly all, their direction is
    /// known at any place and not only at the grid's, so that a map of any size has it exactly.
    pub(super) fn exactness(hold: f32) -> f32 {
        smoothstep(EXACT_FROM, 1.0, hold)
    }
}

struct Sums<'a> {
    hold: &'a mut [f32],
    cos2: &'a mut [f32],
    sin2: &'a mut [f32],
    odds: &'a mut [f32],
}

/// A part of [`One`].
struct Part<'a> {
    left: &'a mut [f32],
    weight: &'a mut [f32],
    cos2: &'a mut [f32],
    sin2: &'a mut [f32],
    square: &'a mut [f32],
    winding: &'a mut [f32],
}

impl One {
    fn clear(&mut self, n: usize) {
        for (v, value) in [
            (&mut self.left, 1.0),
            (&mut self.weight, 0.0),
            (&mut self.cos2, 0.0),
            (&mut self.sin2, 0.0),
            (&mut self.square, f32::MAX),
            (&mut self.winding, 0.0),
        ] {
            v.clear();
            v.resize(n, value);
        }
    }

    fn part(&mut self, range: std::ops::Range<usize>) -> Part<'_> {
        Part {
            left: &mut self.left[range.clone()],
            weight: &mut self.weight[range.clone()],
            cos2: &mut self.cos2[range.clone()],
            sin2: &mut self.sin2[range.clone()],
            square: &mut self.square[range.clone()],
            winding: &mut self.winding[range],
        }
    }
}

/// The hold at a distance outside the shape, of a guide whose hold is 1 inside it.
#[inline(always)]
fn profile(distance: f32, steepness: f32) -> f32 {
    let u = (distance * steepness).clamp(0.0, 1.0);
    1.0 - u * u * (3.0 - 2.0 * u)
}

/// Adds an image of an ellipse or spiral to a guide's sums.
///
/// Of the ellipse's gauge g = |(x/a, y/b)| the gradient is (x/a², y/b²)/g; the distance outside is taken as g (g - 1) over the
/// length of (x/a², y/b²), exact for a circle and to first order for an ellipse, but not less than that from the box around it.
#[simd]
fn oval<S: Simd>(_: S, image: &Oval, placed: &Placed, y: f32, xs: &[f32], out: Part<'_>) {
    let n = xs.len();
    let (left, weight) = (&mut out.left[..n], &mut out.weight[..n]);
    let (cos2, sin2) = (&mut out.cos2[..n], &mut out.sin2[..n]);
    let Frame {
        center,
        x_axis,
        lead,
    } = image.frame;
    let (a, b) = (image.radii.x, image.radii.y);
    let (rx, ry) = (1.0 / a, 1.0 / b);
    let dy = y - center.y;
    for i in 0..n {
        let dx = xs[i] - center.x;
        let (px, py) = (x_axis.x * dx + x_axis.y * dy, x_axis.x * dy - x_axis.y * dx);
        let (gx, gy) = (px * rx, py * ry);
        let g = (gx * gx + gy * gy).sqrt();
        let (nx, ny) = (gx * rx, gy * ry);
        // The middle itself has no direction.
        let square = (nx * nx + ny * ny).max(1e-30);
        let near = g * (g - 1.0) / square.sqrt();
        let (bx, by) = ((px.abs() - a).max(0.0), (py.abs() - b).max(0.0));
        let distance = near.max((bx * bx + by * by).sqrt());
        let c = placed.strength * profile(distance, placed.steepness);
        let (tc, ts) = ((ny * ny - nx * nx) / square, -2.0 * nx * ny / square);
        // A spiral leans from the tangent toward the radius, clockwise, by atan(step / circumference).
        let r = (px * px + py * py).sqrt();
        let (rr, ll) = (r * r, image.lean * image.lean);
        let k = 1.0 / (rr + ll).max(1e-30);
        let (lc, ls) = ((rr - ll) * k, -2.0 * r * image.lean * k);
        let (tc, ts) = (tc * lc - ts * ls, ts * lc + tc * ls);
        let (tc, ts) = lead.of(tc, ts);
        left[i] *= 1.0 - c;
        weight[i] += c;
        cos2[i] += c * tc;
        sin2[i] += c * ts;
    }
}

/// Adds an image of a rectangle to a guide's sums.
///
/// With q the distances beyond the sides (negative inside), its lines run along the nearer side, and turn from one to the
/// other where the two are equally near: as the softmax of q would, normal (e^(qx/s), e^(qy/s)). Around the outside of a
/// corner they run around it.
#[simd]
fn rectangle<S: Simd>(_: S, image: &Rectangle, placed: &Placed, y: f32, xs: &[f32], out: Part<'_>) {
    let n = xs.len();
    let (left, weight) = (&mut out.left[..n], &mut out.weight[..n]);
    let (cos2, sin2) = (&mut out.cos2[..n], &mut out.sin2[..n]);
    let Frame {
        center,
        x_axis,
        lead,
    } = image.frame;
    let (hx, hy) = (image.half.x - image.corner, image.half.y - image.corner);
    let softer = 1.0 / image.softness;
    let dy = y - center.y;
    for i in 0..n {
        let dx = xs[i] - center.x;
        let (px, py) = (x_axis.x * dx + x_axis.y * dy, x_axis.x * dy - x_axis.y * dx);
        let (qx, qy) = (px.abs() - hx, py.abs() - hy);
        let (ox, oy) = (qx.max(0.0), qy.max(0.0));
        let square = ox * ox + oy * oy;
        let c = placed.strength * profile(square.sqrt() - image.corner, placed.steepness);
        let sign = if px * py < 0.0 { -1.0 } else { 1.0 };
        // tanh and sech of the difference.
        let e = exp((-2.0 * softer * (qx - qy).abs()).max(-80.0));
        let sharp = if qx > qy { 1.0 } else { -1.0 } * (1.0 - e) / (1.0 + e);
        let round = 2.0 * e.sqrt() / (1.0 + e);
        // Around a corner: the normal is q itself.
        let per = 1.0 / square.max(1e-30);
        let (kc, ks) = ((oy * oy - ox * ox) * per, -2.0 * ox * oy * per);
        let m = (ox.min(oy) * softer).clamp(0.0, 1.0);
        let m = m * m * (3.0 - 2.0 * m);
        let tc = -sharp * (1.0 - m) + kc * m;
        let ts = sign * (-round * (1.0 - m) + ks * m);
        // Two unit vectors within a quarter turn of each other were mixed.
        let per = 1.0 / (tc * tc + ts * ts).sqrt().max(1e-15);
        let (tc, ts) = lead.of(tc * per, ts * per);
        left[i] *= 1.0 - c;
        weight[i] += c;
        cos2[i] += c * tc;
        sin2[i] += c * ts;
    }
}

/// Adds a piece of a path to a guide's sums.
///
/// A piece counts as the integral along it of one over the distance to the fourth power: about its length, or the distance
/// where that is less, over the fourth power. On the path its own direction stands alone, and where two parts of it are
/// equally near the direction turns smoothly from one to the other.
#[simd]
fn piece<S: Simd>(
    _: S,
    segment: &Segment,
    path: &Path,
    placed: &Placed,
    y: f32,
    xs: &[f32],
    out: Part<'_>,
) {
    let n = xs.len();
    let (weight, nearest) = (&mut out.weight[..n], &mut out.square[..n]);
    let (cos2, sin2) = (&mut out.cos2[..n], &mut out.sin2[..n]);
    let winding = &mut out.winding[..n];
    let Segment {
        from,
        to,
        axis_from,
        axis_to,
    } = *segment;
    let (vx, vy) = (to.x - from.x, to.y - from.y);
    let length = (vx * vx + vy * vy).sqrt();
    let per = 1.0 / (length * length);
    let (short, unit) = (length / path.near, 1.0 / path.near);
    // Where the row crosses the piece, and which way: up is one turn more for all that lies to the left.
    let crosses = (from.y <= y) != (to.y <= y);
    let turn = if !crosses {
        0.0
    } else if vy > 0.0 {
        1.0
    } else {
        -1.0
    };
    let crossing = if crosses {
        from.x + vx * ((y - from.y) / vy)
    } else {
        0.0
    };
    let open = if path.closed { 0.0 } else { 1.0 };
    let dy = y - from.y;
    for i in 0..n {
        let dx = xs[i] - from.x;
        let t = ((dx * vx + dy * vy) * per).clamp(0.0, 1.0);
        let (ex, ey) = (dx - t * vx, dy - t * vy);
        let square = ex * ex + ey * ey;
        nearest[i] = if square < nearest[i] {
            square
        } else {
            nearest[i]
        };
        let e2 = square * unit * unit + 1.0;
        let e = e2.sqrt();
        // What lies farther than the falloff has no say beside an open path, and none that ends at once.
        let seen = 1.0 - open + open * profile(square.sqrt(), placed.steepness);
        let w = seen * short.min(e) / (e2 * e2);
        weight[i] += w;
        cos2[i] += w * (axis_from.x + t * (axis_to.x - axis_from.x));
        sin2[i] += w * (axis_from.y + t * (axis_to.y - axis_from.y));
        winding[i] += if xs[i] < crossing { turn } else { 0.0 };
    }
}

/// Ends the sums of a path: its hold from the distance, its direction from the weighed pieces.
#[simd]
fn end_path<S: Simd>(_: S, path: &Path, placed: &Placed, out: Part<'_>) {
    let n = out.left.len();
    let (left, weight) = (&mut out.left[..n], &mut out.weight[..n]);
    let (cos2, sin2) = (&mut out.cos2[..n], &mut out.sin2[..n]);
    let (square, winding) = (&out.square[..n], &out.winding[..n]);
    let closed = path.closed;
    for i in 0..n {
        let inside = closed & (winding[i] != 0.0);
        let distance = if inside { 0.0 } else { square[i].sqrt() };
        let c = placed.strength * profile(distance, placed.steepness);
        let per = 1.0 / weight[i].max(1e-30);
        let (tc, ts) = path.lead.of(cos2[i] * per, sin2[i] * per);
        left[i] = 1.0 - c;
        weight[i] = 1.0;
        (cos2[i], sin2[i]) = (tc, ts);
    }
}

/// Lays one guide over those before it.
#[simd]
fn lay_over<S: Simd>(_: S, placed: &Placed, one: &One, out: Sums<'_>) {
    let n = out.hold.len();
    let (hold, odds) = (&mut out.hold[..n], &mut out.odds[..n]);
    let (cos2, sin2) = (&mut out.cos2[..n], &mut out.sin2[..n]);
    let (left, weight) = (&one.left[..n], &one.weight[..n]);
    let (tc, ts) = (&one.cos2[..n], &one.sin2[..n]);
    let own = if placed.lets_go { 0.0 } else { 1.0 };
    let odd = own * placed.steepness * placed.steepness;
    for i in 0..n {
        let c = 1.0 - left[i];
        // The directions of the images, averaged by hold.
        let per = own * c / weight[i].max(1e-30);
        hold[i] = hold[i] * left[i] + own * c;
        cos2[i] = cos2[i] * left[i] + per * tc[i];
        sin2[i] = sin2[i] * left[i] + per * ts[i];
        odds[i] = odds[i] * left[i] + odd * c;
    }
}
