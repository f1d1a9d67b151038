//! Attributes of what is seen, with their exact change from sample to sample.
//!
//! Over a triangle each attribute is N(x, y)/q(x, y), both linear over the samples, with q = 1/w. A [`Plane`] holds the
//! numerators of a triangle, and a run of samples that see it takes sixteen at a time of each number. Normals and tangents
//! stay numerators, since only their direction counts; positions are left to be found from q. Triangles that are thinner than
//! their rounding, or reach behind the eye, take the careful way in f64 instead.

use super::camera::{Rays, View};
use super::geometry::{Geometry, Row, outward};
use super::visibility::{Corner, Corners, NOTHING, STRIDE};
use super::{TILE, Tile};
use crate::math;
use crate::mesh::Mesh;
use fearless_simd::{Simd, dispatch};
use fearless_simd_macros::simd;
use glam::{DVec2, DVec3, Vec2, Vec3, Vec4};
use std::ops::Range;

/// Samples whose numbers are written at once.
const WIDE: usize = 16;
/// One number of every fragment of a tile; what lies behind the last is rubbish.
pub type Lane = [f32; (TILE * TILE) as usize + WIDE];

/// The numbers of fragments, each in an array of its own.
///
/// Changes are those of the numerators, per sample to the right (`dx`) and downward (`dy`): with u = U/q, du = (dU - u dq)/q.
pub struct Lanes {
    /// Column and row in the whole picture, in samples.
    pub column: Lane,
    /// Row 0 is the top.
    pub row: Lane,
    /// 1, or -1 where the surface is seen from the side its normals point away from.
    pub facing: Lane,
    /// The layout's handedness: 1, or -1 where it is mirrored.
    pub hand: Lane,
    /// Eye-to-target distances per distance, or for an orthographic view the other way round.
    pub q: Lane,
    /// Normal out of the side that the mesh calls outside, of some length.
    pub normal: [Lane; 3],
    /// Tangent, neither normalised nor orthogonal to the normal.
    pub tangent: [Lane; 3],
    /// Texture coordinate, v up, times `q` (an orthographic view: times 1).
    pub uv: [Lane; 2],
    /// Change of `normal` to the right and downward. Set where changes were asked for, and so are the next two.
    pub normal_change: [[Lane; 3]; 2],
    /// Change of `uv`.
    pub uv_change: [[Lane; 2]; 2],
    /// Change of `q` (an orthographic view: 0).
    pub q_change: [Lane; 2],
}

impl Lanes {
    fn each(&mut self, mut change: impl FnMut(&mut Lane)) {
        let Self {
            column,
            row,
            facing,
            hand,
            q,
            normal,
            tangent,
            uv,
            normal_change,
            uv_change,
            q_change,
        } = self;
        [column, row, facing, hand, q]
            .into_iter()
            .chain(normal)
            .chain(tangent)
            .chain(uv)
            .chain(normal_change.as_flattened_mut())
            .chain(uv_change.as_flattened_mut())
            .chain(q_change)
            .for_each(&mut change);
    }
}

/// Neighbours in a row that all see something.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Span {
    /// The first's column in its tile.
    pub column: u16,
    /// Row in the tile.
    pub row: u16,
    /// How many.
    pub count: u16,
}

/// The fragments of a tile: one for each sample that sees something, in row order.
pub struct Fragments {
    count: usize,
    spans: Vec<Span>,
    rays: Rays,
    lanes: Box<Lanes>,
}

impl Default for Fragments {
    fn default() -> Self {
        Self::new()
    }
}

impl Fragments {
    /// Room for a tile.
    pub fn new() -> Self {
        const ZERO: Lane = [0.0; (TILE * TILE) as usize + WIDE];
        Self {
            count: 0,
            spans: Vec::new(),
            rays: Rays::default(),
            lanes: Box::new(Lanes {
                column: ZERO,
                row: ZERO,
                facing: ZERO,
                hand: ZERO,
                q: ZERO,
                normal: [ZERO; 3],
                tangent: [ZERO; 3],
                uv: [ZERO; 2],
                normal_change: [[ZERO; 3]; 2],
                uv_change: [[ZERO; 2]; 2],
                q_change: [ZERO; 2],
            }),
        }
    }

    /// How many samples see something.
    pub fn len(&self) -> usize {
        self.count
    }

    /// Whether no sample sees anything.
    pub fn is_empty(&self) -> bool {
        self.count == 0
    }

    /// Where they are.
    pub fn spans(&self) -> &[Span] {
        &self.spans
    }

    /// Their numbers.
    pub fn lanes(&self) -> &Lanes {
        &self.lanes
    }

    /// How to find positions.
    pub fn rays(&self) -> &Rays {
        &self.rays
    }

    /// Column and row in the whole picture, in samples.
    pub fn place(&self, i: usize) -> (u32, u32) {
        (self.lanes.column[i] as u32, self.lanes.row[i] as u32)
    }

    /// World position.
    pub fn position(&self, i: usize) -> Vec3 {
        let l = &self.lanes;
        let unit = self.rays.unit;
        let distance = if self.rays.perspective {
            unit / l.q[i]
        } else {
            unit * l.q[i]
        };
        self.rays.position(l.column[i], l.row[i], distance)
    }

    /// 1, or -1 where the surface is seen from the side its normals point away from.
    pub fn facing(&self, i: usize) -> f32 {
        self.lanes.facing[i]
    }

    /// Unit normal.
    pub fn normal(&self, i: usize) -> Vec3 {
        three(&self.lanes.normal, i).normalize()
    }

    /// Tangent of some length; w: the layout's handedness.
    pub fn tangent(&self, i: usize) -> Vec4 {
        three(&self.lanes.tangent, i).extend(self.lanes.hand[i])
    }

    /// Texture coordinate, v up.
    #[inline(always)]
    pub fn uv(&self, i: usize) -> Vec2 {
        two(&self.lanes.uv, i) * self.inverse(i)
    }

    /// Change of the texture coordinate to the right and downward. Rubbish where changes were not asked for.
    #[inline(always)]
    pub fn uv_change(&self, i: usize) -> [Vec2; 2] {
        let uv = self.uv(i);
        [0, 1].map(|k| {
            let l = &self.lanes;
            (two(&l.uv_change[k], i) - uv * l.q_change[k][i]) * self.inverse(i)
        })
    }

    /// Change of the unit normal to the right and downward, at right angles to it. Rubbish where changes were not asked for.
    pub fn normal_change(&self, i: usize) -> [Vec3; 2] {
        let n = self.normal(i);
        let length = three(&self.lanes.normal, i).length();
        [0, 1].map(|k| {
            let d = three(&self.lanes.normal_change[k], i) / length;
            d - n * n.dot(d)
        })
    }

    /// Leaves out the fragments of which `is_kept` says no; it is asked in order, each once.
    pub fn keep(&mut self, mut is_kept: impl FnMut(usize) -> bool) {
        let mut spans = Vec::with_capacity(self.spans.len());
        let (mut from, mut to) = (0, 0);
        for span in &self.spans {
            for column in span.column..span.column + span.count {
                if is_kept(from) {
                    join(&mut spans, column.into(), span.row.into(), 1);
                    if to < from {
                        self.lanes.each(|lane| lane[to] = lane[from]);
                    }
                    to += 1;
                }
                from += 1;
            }
        }
        self.spans = spans;
        self.count = to;
    }

    #[inline(always)]
    fn inverse(&self, i: usize) -> f32 {
        if self.rays.perspective {
            1.0 / self.lanes.q[i]
        } else {
            1.0
        }
    }
}

fn three(lanes: &[Lane; 3], i: usize) -> Vec3 {
    Vec3::new(lanes[0][i], lanes[1][i], lanes[2][i])
}

#[inline(always)]
fn two(lanes: &[Lane; 2], i: usize) -> Vec2 {
    Vec2::new(lanes[0][i], lanes[1][i])
}

/// A triangle's homogeneous edge functions.
pub(super) struct Edges {
    pub(super) corners: [usize; 3],
    distances: [f64; 3],
    /// Row i, dotted with (x, y, 1), is corner i's weight over w, up to one common factor.
    rows: [DVec3; 3],
}

/// Weights of the three corners at a sample, and their change.
pub(super) struct Weights {
    pub(super) at: [f64; 3],
    dx: [f64; 3],
    dy: [f64; 3],
}

impl Edges {
    pub(super) fn new(mesh: &Mesh, view: &View, triangle: u32) -> Self {
        let corners = mesh.triangles[triangle as usize].map(|i| i as usize);
        let vertices = corners.map(|i| view.project(mesh.positions[i]));
        let h = vertices.map(|v| v.map_or(DVec3::ZERO, |v| v.h));
        Self {
            corners,
            distances: vertices.map(|v| v.map_or(0.0, |v| v.distance)),
            rows: [h[1].cross(h[2]), h[2].cross(h[0]), h[0].cross(h[1])],
        }
    }

    pub(super) fn weights(&self, x: f64, y: f64) -> Weights {
        let p = DVec3::new(x, y, 1.0);
        let raw = self.rows.map(|r| r.dot(p));
        let sum: f64 = raw.iter().sum();
        let at = raw.map(|r| r / sum);
        if !at.iter().all(|w| w.is_finite()) {
            // Seen edge-on, saved from having no area only by the rounding of its corners.
            return Weights {
                at: [1.0 / 3.0; 3],
                dx: [0.0; 3],
                dy: [0.0; 3],
            };
        }
        let total: DVec3 = self.rows.iter().sum();
        let change = |i: usize, row: f64, all: f64| (row - at[i] * all) / sum;
        // The rounding of corners can put a centre a hair outside: never extrapolate.
        let inside = at.map(|w| w.max(0.0));
        let inside_sum: f64 = inside.iter().sum();
        Weights {
            at: inside.map(|w| w / inside_sum),
            dx: [0, 1, 2].map(|i| change(i, self.rows[i].x, total.x)),
            dy: [0, 1, 2].map(|i| change(i, self.rows[i].y, total.y)),
        }
    }
}

/// The least height in samples of a triangle that is taken the fast way: the rounding of its corners to 1/256 can put a centre
/// out of it by 2 % of that.
const LEAST_HEIGHT: f64 = 0.125;
/// Farther from the picture, in samples, the fast way loses digits.
const FARTHEST: f64 = 1e5;
/// A normal this short has lost its direction to the cancelling of its corners' normals.
const LEAST_NORMAL: f32 = 1e-10;

/// A linear function over samples.
#[derive(Clone, Copy)]
struct Linear<T> {
    at: T,
    dx: T,
    dy: T,
}

/// A triangle's attributes as linear functions over the samples around its middle.
#[derive(Clone, Copy)]
struct Plane {
    /// The sample that offsets are counted from.
    from: [i32; 2],
    rows: Linear<Row>,
    q: Linear<f32>,
    /// The change of the attributes' common denominator.
    q_change: [f32; 2],
    /// Whether the normal keeps its direction wherever on the triangle.
    steady: bool,
}

impl Plane {
    /// `None` for a triangle that must be taken carefully. With it whether the corners wind counter-clockwise as seen.
    #[inline(always)]
    fn new(corners: [&Corner; 3], rows: [&Row; 3], perspective: bool) -> Option<(Self, bool)> {
        let at = corners.map(|c| c.at);
        let sides = [at[2] - at[1], at[0] - at[2], at[1] - at[0]];
        let twice = sides[2].perp_dot(-sides[1]);
        let longest = sides[0]
            .length_squared()
            .max(sides[1].length_squared())
            .max(sides[2].length_squared());
        let middle = (at[0] + at[1] + at[2]) * (1.0 / 3.0);
        // NaN and what lies behind the eye fail these too.
        let before = corners[0].q > 0.0 && corners[1].q > 0.0 && corners[2].q > 0.0;
        let high = twice * twice > LEAST_HEIGHT * LEAST_HEIGHT * longest;
        let near =
            middle.x.abs() < FARTHEST && middle.y.abs() < FARTHEST && longest < FARTHEST * FARTHEST;
        if !(before && high && near) {
            return None;
        }
        let from = [middle.x as i32, middle.y as i32];
        let p = DVec2::new(f64::from(from[0]), f64::from(from[1])) + 0.5;
        let scale = 1.0 / twice;
        let offset = at.map(|c| c - p);
        // The share of each corner, and its change.
        let at = [
            offset[1].perp_dot(offset[2]) * scale,
            offset[2].perp_dot(offset[0]) * scale,
            offset[0].perp_dot(offset[1]) * scale,
        ];
        let dx = sides.map(|s| -s.y * scale);
        let dy = sides.map(|s| s.x * scale);
        let q = corners.map(|c| c.q);
        let sum = |w: [f64; 3]| (w[0] * q[0] + w[1] * q[1] + w[2] * q[2]) as f32;
        let weights = |w: [f64; 3]| {
            if perspective {
                [w[0] * q[0], w[1] * q[1], w[2] * q[2]]
            } else {
                w
            }
        };
        let plane = Self {
            from,
            rows: Linear {
                at: Row::mix(rows, weights(at)),
                dx: Row::mix(rows, weights(dx)),
                dy: Row::mix(rows, weights(dy)),
            },
            q: Linear {
                at: sum(at),
                dx: sum(dx),
                dy: sum(dy),
            },
            q_change: if perspective {
                [sum(dx), sum(dy)]
            } else {
                [0.0; 2]
            },
            steady: is_steady(rows),
        };
        // Rows run downward.
        Some((plane, twice < 0.0))
    }

    /// Neighbours in a row, from a sample on.
    #[inline(always)]
    fn fill(&self, run: Range<usize>, (column, row): (i32, i32), changes: bool, out: &mut Lanes) {
        let y = (row - self.from[1]) as f32;
        let mut base = [0.0; 8];
        for k in 0..8 {
            base[k] = self.rows.at.0[k] + self.rows.dy.0[k] * y;
        }
        let q = self.q.at + self.q.dy * y;
        let dx = &self.rows.dx.0;
        let mut start = run.start;
        while start < run.end {
            let first = (column + (start - run.start) as i32 - self.from[0]) as f32;
            let mut x = [0.0; WIDE];
            for j in 0..WIDE {
                x[j] = first + j as f32;
            }
            let line = |lane: &mut Lane, base: f32, dx: f32| {
                let lane = &mut lane[start..start + WIDE];
                for j in 0..WIDE {
                    lane[j] = base + dx * x[j];
                }
            };
            line(&mut out.column, self.from[0] as f32, 1.0);
            line(&mut out.q, q, self.q.dx);
            line(&mut out.normal[0], base[0], dx[0]);
            line(&mut out.normal[1], base[1], dx[1]);
            line(&mut out.normal[2], base[2], dx[2]);
            line(&mut out.uv[0], base[3], dx[3]);
            line(&mut out.tangent[0], base[4], dx[4]);
            line(&mut out.tangent[1], base[5], dx[5]);
            line(&mut out.tangent[2], base[6], dx[6]);
            line(&mut out.uv[1], base[7], dx[7]);
            if changes {
                for (k, d) in [&self.rows.dx.0, &self.rows.dy.0].into_iter().enumerate() {
                    splat(&mut out.normal_change[k][0], start, d[0]);
                    splat(&mut out.normal_change[k][1], start, d[1]);
                    splat(&mut out.normal_change[k][2], start, d[2]);
                    splat(&mut out.uv_change[k][0], start, d[3]);
                    splat(&mut out.uv_change[k][1], start, d[7]);
                    splat(&mut out.q_change[k], start, self.q_change[k]);
                }
            }
            start += WIDE;
        }
    }
}

/// Whether no weighted mean of the corners' normals can come near zero: all within a right angle of their sum.
#[inline(always)]
fn is_steady(rows: [&Row; 3]) -> bool {
    let n = rows.map(Row::normal);
    let sum = n[0] + n[1] + n[2];
    let least = LEAST_NORMAL;
    // NaN fails these, and what overflows.
    let along = |n: Vec3| n.dot(sum) > least && n.length_squared() < 1e30;
    along(n[0]) && along(n[1]) && along(n[2])
}

#[inline(always)]
fn splat(lane: &mut Lane, start: usize, value: f32) {
    for x in &mut lane[start..start + WIDE] {
        *x = value;
    }
}

/// What is known of a triangle in a tile.
struct Surface {
    plane: Option<Plane>,
    facing: f32,
    hand: f32,
}

impl Surface {
    #[inline(always)]
    fn new(geometry: &Geometry<'_>, corners: &Corners, triangle: u32) -> Self {
        let mesh = geometry.mesh();
        let vertices = mesh.triangles[triangle as usize];
        let as_wound = geometry.as_wound[triangle as usize];
        let rows = vertices.map(|i| &geometry.rows[i as usize]);
        let three = vertices.map(|i| &corners.list[i as usize]);
        let signed = |yes: bool| if yes { 1.0 } else { -1.0 };
        let hand = signed(mesh.tangents[vertices[0] as usize].w >= 0.0);
        match Plane::new(three, rows, corners.view.is_perspective()) {
            Some((plane, counter_clockwise)) => Self {
                plane: Some(plane),
                facing: signed(counter_clockwise == as_wound),
                hand,
            },
            None => {
                // A plane is seen from one side, wherever on it one looks.
                let toward = corners
                    .view
                    .toward_any_length(mesh.positions[vertices[0] as usize]);
                Self {
                    plane: None,
                    facing: signed(outward(mesh, vertices).normal.dot(toward) >= 0.0),
                    hand,
                }
            }
        }
    }
}

/// A triangle in f64 weights, sample by sample.
#[cold]
fn fill_carefully(
    (geometry, view): (&Geometry<'_>, &View),
    triangle: u32,
    run: Range<usize>,
    (column, row): (i32, i32),
    out: &mut Lanes,
) {
    let edges = Edges::new(geometry.mesh(), view, triangle);
    let rows = edges.corners.map(|i| &geometry.rows[i]);
    for (i, column) in run.zip(column..) {
        let w = edges.weights(f64::from(column) + 0.5, f64::from(row) + 0.5);
        let distance: f64 = (0..3).map(|k| w.at[k] * edges.distances[k]).sum();
        let (q, share) = view.slant_at(distance);
        let at = Row::mix(rows, w.at.map(|w| w * share)).0;
        out.column[i] = column as f32;
        out.q[i] = q as f32;
        for k in 0..3 {
            out.normal[k][i] = at[k];
            out.tangent[k][i] = at[4 + k];
        }
        out.uv[0][i] = at[3];
        out.uv[1][i] = at[7];
        for (k, change) in [w.dx, w.dy].into_iter().enumerate() {
            // As if q stood still: the weights' own change holds it already.
            let d = Row::mix(rows, change.map(|w| w * share)).0;
            for c in 0..3 {
                out.normal_change[k][c][i] = d[c];
            }
            out.uv_change[k][0][i] = d[3];
            out.uv_change[k][1][i] = d[7];
            out.q_change[k][i] = 0.0;
        }
    }
}

/// Gives normals without a direction that of the triangle, or that toward the viewer.
#[cold]
fn mend_normals(
    (geometry, view): (&Geometry<'_>, &View),
    triangle: u32,
    run: Range<usize>,
    out: &mut Lanes,
) {
    let mesh = geometry.mesh();
    let vertices = mesh.triangles[triangle as usize];
    let position = mesh.positions[vertices[0] as usize];
    let normal = outward(mesh, vertices).normal.try_normalize();
    let normal = normal.unwrap_or_else(|| view.toward(position)).to_array();
    for i in run {
        let length = three(&out.normal, i).length_squared();
        if !(length > LEAST_NORMAL * LEAST_NORMAL && length < f32::INFINITY) {
            for k in 0..3 {
                out.normal[k][i] = normal[k];
            }
        }
    }
}

/// The surfaces of a tile, found by triangle. Neighbours mostly see the same triangle, rows see those of the row above.
struct Surfaces {
    known: Vec<(u32, Surface)>,
    /// Places in it, by the triangle's hash.
    slots: [u16; Self::SLOTS],
}

impl Surfaces {
    const SLOTS: usize = 1024;
    const EMPTY: u16 = u16::MAX;

    fn new() -> Self {
        Self {
            known: Vec::with_capacity(256),
            slots: [Self::EMPTY; Self::SLOTS],
        }
    }

    /// The surface of a triangle; a tile has fewer samples than 2^16, and so fewer surfaces.
    #[inline(always)]
    fn get(&mut self, triangle: u32, make: impl FnOnce() -> Surface) -> &Surface {
        let slot = &mut self.slots[(triangle.wrapping_mul(0x9e37_79b9) >> 22) as usize];
        let known = self
            .known
            .get(*slot as usize)
            .is_some_and(|(t, _)| *t == triangle);
        if !known {
            *slot = self.known.len() as u16;
            self.known.push((triangle, make()));
        }
        &self.known[*slot as usize].1
    }
}

/// The attributes of every sample of a tile that sees something; their changes where `changes` are asked for.
pub(super) fn resolve(
    geometry: &Geometry<'_>,
    corners: &Corners,
    tile: &Tile,
    changes: bool,
    out: &mut Fragments,
) {
    out.rays = corners.view.rays();
    out.spans.clear();
    let scene = (geometry, corners);
    out.count = dispatch!(math::level(), simd => resolve_all(simd, scene, tile, changes, &mut out.spans, &mut out.lanes));
}

#[simd]
fn resolve_all<S: Simd>(
    _: S,
    (geometry, corners): (&Geometry<'_>, &Corners),
    tile: &Tile,
    changes: bool,
    spans: &mut Vec<Span>,
    out: &mut Lanes,
) -> usize {
    let careful = (geometry, &corners.view);
    let mut surfaces = Surfaces::new();
    let mut next = 0;
    for (y, line) in tile.seen.chunks(STRIDE).enumerate() {
        let width = tile.rect.width as usize;
        let row = tile.rect.y as i32 + y as i32;
        let line_start = next;
        let mut starts = run_starts(&line[..width]);
        while starts != 0 {
            let start = starts.trailing_zeros() as usize;
            starts &= starts - 1;
            let end = (starts.trailing_zeros() as usize).min(width);
            let triangle = line[start];
            if triangle == NOTHING {
                continue;
            }
            join(spans, start, y, end - start);
            let surface = surfaces.get(triangle, || Surface::new(geometry, corners, triangle));
            let run = next..next + (end - start);
            next = run.end;
            let first = (tile.rect.x as i32 + start as i32, row);
            for block in run.clone().step_by(WIDE) {
                splat(&mut out.facing, block, surface.facing);
                splat(&mut out.hand, block, surface.hand);
            }
            match &surface.plane {
                Some(plane) => {
                    plane.fill(run.clone(), first, changes, out);
                    if !plane.steady {
                        mend_normals(careful, triangle, run, out);
                    }
                }
                None => {
                    fill_carefully(careful, triangle, run.clone(), first, out);
                    mend_normals(careful, triangle, run, out);
                }
            }
        }
        out.row[line_start..next].fill(row as f32);
    }
    next
}

/// The columns of a row of a tile where another triangle begins than in the column before, a bit each. Found all at once: a
/// branch for each sample would be foretold wrongly at the end of every run.
#[inline(always)]
fn run_starts(line: &[u32]) -> u64 {
    let mut other = [0u8; TILE as usize];
    let (before, at) = (&line[..line.len() - 1], &line[1..]);
    for ((other, a), b) in other[1..].iter_mut().zip(before).zip(at) {
        *other = u8::from(a != b);
    }
    let bits = |eight: &[u8]| {
        let eight = <[u8; 8]>::try_from(eight).expect("eight bytes");
        // Gathers the lowest bit of each byte in the highest byte.
        u64::from_le_bytes(eight).wrapping_mul(0x0102_0408_1020_4080) >> 56
    };
    other
        .chunks_exact(8)
        .enumerate()
        .fold(1, |starts, (i, eight)| starts | bits(eight) << (8 * i))
}

/// Adds a run to the spans: to the last one where that ends beside it.
#[inline(always)]
fn join(spans: &mut Vec<Span>, column: usize, row: usize, count: usize) {
    let (column, row, count) = (column as u16, row as u16, count as u16);
    match spans.last_mut() {
        Some(last) if last.row == row && last.column + last.count == column => last.count += count,
        _ => spans.push(Span { column, row, count }),
    }
}
