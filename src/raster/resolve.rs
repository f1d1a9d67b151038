//! Attributes of what is seen, with their exact change from sample to sample.
//!
//! Over a triangle each attribute is N(x, y)/q(x, y), both linear over the samples, with q = 1/w. A [`Plane`] holds the
//! numerators of a triangle, and the samples of a tile that see it take sixteen at a time of each number. Normals and tangents
//! stay numerators, since only their direction counts; positions are left to be found from q. Triangles that are thinner than
//! their rounding, or reach behind the eye, take the careful way in f64 instead.

use super::camera::{Rays, View};
use super::geometry::{Geometry, LEAST_NORMAL, Row, outward};
use super::visibility::{Corner, Corners, Drawn, STRIDE};
use super::{TILE, Tile};
use crate::math;
use crate::mesh::Mesh;
use fearless_simd::prelude::*;
use fearless_simd::{Simd, dispatch, f32x16, u8x16, u32x16};
use fearless_simd_macros::simd;
use glam::{DVec3, Vec2, Vec3, Vec4};
use std::ops::Range;

/// Samples whose numbers are written at once.
const WIDE: usize = 16;
/// Fragments there is room for.
const ROOM: usize = (TILE * TILE) as usize + WIDE;
/// One number of every fragment of a tile; what lies behind the last is rubbish.
pub type Lane = [f32; ROOM];

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

/// Column and row in the tile of each fragment.
struct Places {
    columns: [u8; ROOM],
    rows: [u8; ROOM],
}

/// The fragments of a tile: one for each sample that sees something, triangle by triangle in the mesh's order.
pub struct Fragments {
    count: usize,
    rays: Rays,
    places: Box<Places>,
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
        const ZERO: Lane = [0.0; ROOM];
        Self {
            count: 0,
            rays: Rays::default(),
            places: Box::new(Places {
                columns: [0; ROOM],
                rows: [0; ROOM],
            }),
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

    /// The column in the tile of each.
    pub fn columns(&self) -> &[u8] {
        &self.places.columns[..self.count]
    }

    /// The row in the tile of each.
    pub fn rows(&self) -> &[u8] {
        &self.places.rows[..self.count]
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
        self.rays
            .position(l.column[i], l.row[i], self.rays.distance(l.q[i]))
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
        let (uv, inverse) = (self.uv(i), self.inverse(i));
        let l = &self.lanes;
        [
            (two(&l.uv_change[0], i) - uv * l.q_change[0][i]) * inverse,
            (two(&l.uv_change[1], i) - uv * l.q_change[1][i]) * inverse,
        ]
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
        let mut to = 0;
        for from in 0..self.count {
            if is_kept(from) {
                if to < from {
                    self.places.columns[to] = self.places.columns[from];
                    self.places.rows[to] = self.places.rows[from];
                    self.lanes.each(|lane| lane[to] = lane[from]);
                }
                to += 1;
            }
        }
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
/// A linear function over samples.
#[derive(Clone, Copy)]
struct Linear<T> {
    at: T,
    dx: T,
    dy: T,
}

/// Triangles whose functions are worked out at once.
const BATCH: usize = 16;

/// Triangles that some samples of a tile see, side by side.
struct Batch {
    count: usize,
    triangles: [u32; BATCH],
    runs: [(usize, usize); BATCH],
    given: Given,
    shares: Shares,
}

/// Where the corners of triangles are: column and row in samples, and q.
struct Given {
    x: [[f64; BATCH]; 3],
    y: [[f64; BATCH]; 3],
    q: [[f64; BATCH]; 3],
}

/// What the corners of triangles contribute, as linear functions over the samples around the middle of each.
struct Shares {
    /// The sample that offsets are counted from.
    from: [[f32; BATCH]; 2],
    /// Of each corner, for a perspective view times its q.
    corners: [Linear<[f32; BATCH]>; 3],
    q: Linear<[f32; BATCH]>,
    /// 1 where this way is exact enough; else the triangle must be taken carefully.
    fast: [u32; BATCH],
    /// 1 where the corners wind counter-clockwise as seen.
    counter_clockwise: [u32; BATCH],
}

impl Batch {
    fn new() -> Self {
        const ZERO: [f32; BATCH] = [0.0; BATCH];
        const LINEAR: Linear<[f32; BATCH]> = Linear {
            at: ZERO,
            dx: ZERO,
            dy: ZERO,
        };
        Self {
            count: 0,
            triangles: [0; BATCH],
            runs: [(0, 0); BATCH],
            given: Given {
                x: [[0.0; BATCH]; 3],
                y: [[0.0; BATCH]; 3],
                q: [[0.0; BATCH]; 3],
            },
            shares: Shares {
                from: [ZERO; 2],
                corners: [LINEAR; 3],
                q: LINEAR,
                fast: [0; BATCH],
                counter_clockwise: [0; BATCH],
            },
        }
    }

    #[inline(always)]
    fn add(&mut self, triangle: u32, corners: [&Corner; 3], run: &Range<usize>) {
        let i = self.count;
        self.triangles[i] = triangle;
        self.runs[i] = (run.start, run.end);
        for (k, corner) in corners.into_iter().enumerate() {
            self.given.x[k][i] = corner.at.x;
            self.given.y[k][i] = corner.at.y;
            self.given.q[k][i] = corner.q;
        }
        self.count += 1;
    }
}

#[inline(always)]
fn larger(a: f64, b: f64) -> f64 {
    if a > b { a } else { b }
}

impl Shares {
    #[inline(always)]
    fn work_out(&mut self, given: &Given, perspective: bool) {
        // 1.5 * 2^52: adding it leaves a whole number.
        const ROUND: f64 = 6_755_399_441_055_744.0;
        let (x, y, q) = (&given.x, &given.y, &given.q);
        for j in 0..BATCH {
            let (x0, x1, x2) = (x[0][j], x[1][j], x[2][j]);
            let (y0, y1, y2) = (y[0][j], y[1][j], y[2][j]);
            let (q0, q1, q2) = (q[0][j], q[1][j], q[2][j]);
            let (sx0, sx1, sx2) = (x2 - x1, x0 - x2, x1 - x0);
            let (sy0, sy1, sy2) = (y2 - y1, y0 - y2, y1 - y0);
            let twice = sy2 * sx1 - sx2 * sy1;
            let longest = larger(
                larger(sx0 * sx0 + sy0 * sy0, sx1 * sx1 + sy1 * sy1),
                sx2 * sx2 + sy2 * sy2,
            );
            let (mx, my) = ((x0 + x1 + x2) * (1.0 / 3.0), (y0 + y1 + y2) * (1.0 / 3.0));
            // NaN and what lies behind the eye fail these too.
            let before = (q0 > 0.0) & (q1 > 0.0) & (q2 > 0.0);
            let high = twice * twice > LEAST_HEIGHT * LEAST_HEIGHT * longest;
            let near =
                (mx.abs() < FARTHEST) & (my.abs() < FARTHEST) & (longest < FARTHEST * FARTHEST);
            self.fast[j] = u32::from(before & high & near);
            // Rows run downward.
            self.counter_clockwise[j] = u32::from(twice < 0.0);
            let (fx, fy) = ((mx - 0.5 + ROUND) - ROUND, (my - 0.5 + ROUND) - ROUND);
            self.from[0][j] = fx as f32;
            self.from[1][j] = fy as f32;
            let (px, py) = (fx + 0.5, fy + 0.5);
            let (x0, x1, x2) = (x0 - px, x1 - px, x2 - px);
            let (y0, y1, y2) = (y0 - py, y1 - py, y2 - py);
            let scale = 1.0 / twice;
            let (a0, a1, a2) = (
                (x1 * y2 - y1 * x2) * scale,
                (x2 * y0 - y2 * x0) * scale,
                (x0 * y1 - y0 * x1) * scale,
            );
            let (r0, r1, r2) = (-sy0 * scale, -sy1 * scale, -sy2 * scale);
            let (d0, d1, d2) = (sx0 * scale, sx1 * scale, sx2 * scale);
            self.q.at[j] = (a0 * q0 + a1 * q1 + a2 * q2) as f32;
            self.q.dx[j] = (r0 * q0 + r1 * q1 + r2 * q2) as f32;
            self.q.dy[j] = (d0 * q0 + d1 * q1 + d2 * q2) as f32;
            let w0 = if perspective { q0 } else { 1.0 };
            let w1 = if perspective { q1 } else { 1.0 };
            let w2 = if perspective { q2 } else { 1.0 };
            self.corners[0].at[j] = (a0 * w0) as f32;
            self.corners[1].at[j] = (a1 * w1) as f32;
            self.corners[2].at[j] = (a2 * w2) as f32;
            self.corners[0].dx[j] = (r0 * w0) as f32;
            self.corners[1].dx[j] = (r1 * w1) as f32;
            self.corners[2].dx[j] = (r2 * w2) as f32;
            self.corners[0].dy[j] = (d0 * w0) as f32;
            self.corners[1].dy[j] = (d1 * w1) as f32;
            self.corners[2].dy[j] = (d2 * w2) as f32;
        }
    }
}

/// A triangle's attributes as linear functions over the samples around its middle.
#[derive(Clone, Copy)]
struct Plane {
    /// The sample that offsets are counted from.
    from: [f32; 2],
    rows: Linear<Row>,
    q: Linear<f32>,
    /// The change of the attributes' common denominator.
    q_change: [f32; 2],
}

impl Plane {
    /// Of triangle number `j` of a batch.
    #[inline(always)]
    fn new<S: Simd>(
        simd: S,
        shares: &Shares,
        j: usize,
        rows: [&Row; 3],
        perspective: bool,
    ) -> Self {
        let [a, b, c] = &shares.corners;
        let q = Linear {
            at: shares.q.at[j],
            dx: shares.q.dx[j],
            dy: shares.q.dy[j],
        };
        Self {
            from: [shares.from[0][j], shares.from[1][j]],
            rows: Linear {
                at: Row::mix(simd, rows, [a.at[j], b.at[j], c.at[j]]),
                dx: Row::mix(simd, rows, [a.dx[j], b.dx[j], c.dx[j]]),
                dy: Row::mix(simd, rows, [a.dy[j], b.dy[j], c.dy[j]]),
            },
            q_change: if perspective { [q.dx, q.dy] } else { [0.0; 2] },
            q,
        }
    }

    /// A run of fragments of a tile whose first sample is `corner`.
    #[inline(always)]
    fn fill<S: Simd>(
        &self,
        simd: S,
        run: Range<usize>,
        corner: [i32; 2],
        places: &Places,
        changes: bool,
        out: &mut Lanes,
    ) {
        let corner = [corner[0] as f32, corner[1] as f32];
        let offset = [corner[0] - self.from[0], corner[1] - self.from[1]];
        for start in run.step_by(WIDE) {
            let column = numbers(simd, &places.columns[start..start + WIDE]);
            let row = numbers(simd, &places.rows[start..start + WIDE]);
            (column + corner[0]).store_slice(&mut out.column[start..start + WIDE]);
            (row + corner[1]).store_slice(&mut out.row[start..start + WIDE]);
            let place = [column + offset[0], row + offset[1]];
            self.q.fill(place, &mut out.q, start);
            let rows = &self.rows;
            rows.attribute(0).fill(place, &mut out.normal[0], start);
            rows.attribute(1).fill(place, &mut out.normal[1], start);
            rows.attribute(2).fill(place, &mut out.normal[2], start);
            rows.attribute(3).fill(place, &mut out.uv[0], start);
            rows.attribute(4).fill(place, &mut out.tangent[0], start);
            rows.attribute(5).fill(place, &mut out.tangent[1], start);
            rows.attribute(6).fill(place, &mut out.tangent[2], start);
            rows.attribute(7).fill(place, &mut out.uv[1], start);
            if changes {
                for (k, d) in [&self.rows.dx, &self.rows.dy].into_iter().enumerate() {
                    splat(&mut out.normal_change[k][0], start, d.0[0]);
                    splat(&mut out.normal_change[k][1], start, d.0[1]);
                    splat(&mut out.normal_change[k][2], start, d.0[2]);
                    splat(&mut out.uv_change[k][0], start, d.0[3]);
                    splat(&mut out.uv_change[k][1], start, d.0[7]);
                    splat(&mut out.q_change[k], start, self.q_change[k]);
                }
            }
        }
    }
}

impl Linear<Row> {
    #[inline(always)]
    fn attribute(&self, k: usize) -> Linear<f32> {
        Linear {
            at: self.at.0[k],
            dx: self.dx.0[k],
            dy: self.dy.0[k],
        }
    }
}

impl Linear<f32> {
    #[inline(always)]
    fn fill<S: Simd>(&self, [x, y]: [f32x16<S>; 2], lane: &mut Lane, start: usize) {
        let at = (y * self.dy + self.at) + x * self.dx;
        at.store_slice(&mut lane[start..start + WIDE]);
    }
}

#[inline(always)]
fn numbers<S: Simd>(simd: S, bytes: &[u8]) -> f32x16<S> {
    let mut wide = [0u32; WIDE];
    for j in 0..WIDE {
        wide[j] = u32::from(bytes[j]);
    }
    u32x16::from_slice(simd, &wide).to_float()
}

#[inline(always)]
fn splat(lane: &mut Lane, start: usize, value: f32) {
    for x in &mut lane[start..start + WIDE] {
        *x = value;
    }
}

/// A triangle in f64 weights, sample by sample.
#[cold]
fn fill_carefully<S: Simd>(
    simd: S,
    (geometry, view): (&Geometry<'_>, &View),
    triangle: u32,
    run: Range<usize>,
    (corner, places): ([i32; 2], &Places),
    out: &mut Lanes,
) {
    let edges = Edges::new(geometry.mesh(), view, triangle);
    let rows = edges.corners.map(|i| &geometry.rows[i]);
    for i in run {
        let column = corner[0] + i32::from(places.columns[i]);
        let row = corner[1] + i32::from(places.rows[i]);
        let w = edges.weights(f64::from(column) + 0.5, f64::from(row) + 0.5);
        let distance: f64 = (0..3).map(|k| w.at[k] * edges.distances[k]).sum();
        let (q, share) = view.slant_at(distance);
        let at = Row::mix(simd, rows, w.at.map(|w| (w * share) as f32)).0;
        out.column[i] = column as f32;
        out.row[i] = row as f32;
        out.q[i] = q as f32;
        for k in 0..3 {
            out.normal[k][i] = at[k];
            out.tangent[k][i] = at[4 + k];
        }
        out.uv[0][i] = at[3];
        out.uv[1][i] = at[7];
        for (k, change) in [w.dx, w.dy].into_iter().enumerate() {
            // As if q stood still: the weights' own change holds it already.
            let d = Row::mix(simd, rows, change.map(|w| (w * share) as f32)).0;
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

/// The attributes of every sample of a tile that sees something; their changes where `changes` are asked for.
pub(super) fn resolve(
    geometry: &Geometry<'_>,
    corners: &Corners,
    tile: &Tile,
    changes: bool,
    out: &mut Fragments,
) {
    out.rays = corners.view.rays();
    let scene = (geometry, corners);
    out.count = dispatch!(math::level(), simd => resolve_all(simd, scene, tile, changes, &mut out.places, &mut out.lanes));
}

#[simd]
fn resolve_all<S: Simd>(
    simd: S,
    scene: (&Geometry<'_>, &Corners),
    tile: &Tile,
    changes: bool,
    places: &mut Places,
    out: &mut Lanes,
) -> usize {
    let (geometry, corners) = scene;
    let triangles = &geometry.mesh().triangles;
    let corner = [tile.rect.x as i32, tile.rect.y as i32];
    let mut batch = Batch::new();
    let mut next = 0;
    for drawn in &tile.drawn {
        let run = next..find(simd, &tile.seen, *drawn, next, places);
        next = run.end;
        if run.is_empty() {
            continue;
        }
        let [a, b, c] = triangles[drawn.triangle as usize];
        let list = &corners.list;
        let three = [&list[a as usize], &list[b as usize], &list[c as usize]];
        batch.add(drawn.triangle, three, &run);
        if batch.count == BATCH {
            fill_batch(simd, scene, &mut batch, (corner, places), changes, out);
        }
    }
    fill_batch(simd, scene, &mut batch, (corner, places), changes, out);
    next
}

/// The fragments of a batch's triangles; the batch is empty afterwards.
#[inline(always)]
fn fill_batch<S: Simd>(
    simd: S,
    (geometry, corners): (&Geometry<'_>, &Corners),
    batch: &mut Batch,
    (corner, places): ([i32; 2], &Places),
    changes: bool,
    out: &mut Lanes,
) {
    let mesh = geometry.mesh();
    let careful = (geometry, &corners.view);
    let perspective = corners.view.is_perspective();
    batch.shares.work_out(&batch.given, perspective);
    for j in 0..batch.count {
        let triangle = batch.triangles[j];
        let (start, end) = batch.runs[j];
        let kind = geometry.kinds[triangle as usize];
        let [a, b, c] = mesh.triangles[triangle as usize];
        let fast = batch.shares.fast[j] != 0;
        let outside = if fast {
            (batch.shares.counter_clockwise[j] != 0) == kind.as_wound
        } else {
            is_seen_from_outside(careful, triangle)
        };
        let facing = if outside { 1.0 } else { -1.0 };
        let hand = if kind.right_handed { 1.0 } else { -1.0 };
        for first in (start..end).step_by(WIDE) {
            splat(&mut out.facing, first, facing);
            splat(&mut out.hand, first, hand);
        }
        if fast {
            let rows = &geometry.rows;
            let rows = [&rows[a as usize], &rows[b as usize], &rows[c as usize]];
            let plane = Plane::new(simd, &batch.shares, j, rows, perspective);
            plane.fill(simd, start..end, corner, places, changes, out);
        } else {
            fill_carefully(simd, careful, triangle, start..end, (corner, places), out);
        }
        if !(fast && kind.steady) {
            mend_normals(careful, triangle, start..end, out);
        }
    }
    batch.count = 0;
}

#[cold]
fn is_seen_from_outside((geometry, view): (&Geometry<'_>, &View), triangle: u32) -> bool {
    let mesh = geometry.mesh();
    let vertices = mesh.triangles[triangle as usize];
    // A plane is seen from one side, wherever on it one looks.
    let toward = view.toward_any_length(mesh.positions[vertices[0] as usize]);
    outward(mesh, vertices).normal.dot(toward) >= 0.0
}

/// Writes the places of the samples that see a triangle, from number `next` on, and returns the number after the last.
#[inline(always)]
fn find<S: Simd>(
    simd: S,
    seen: &[u32],
    drawn: Drawn,
    mut next: usize,
    places: &mut Places,
) -> usize {
    let (left, right) = (usize::from(drawn.left), usize::from(drawn.right));
    for first in (left..=right).step_by(WIDE) {
        // Behind the tile's last column there is rubbish.
        let inside = u32::MAX >> (31 - (right - first).min(31));
        for row in drawn.top..=drawn.bottom {
            let line = &seen[usize::from(row) * STRIDE + first..][..WIDE];
            let sees = u32x16::from_slice(simd, line).simd_eq(drawn.triangle);
            let sees = sees.to_bitmask() as u32 & inside;
            let start = sees.trailing_zeros();
            let run = sees.checked_shr(start).unwrap_or(0);
            let columns = &mut places.columns[next..next + WIDE];
            let rows = &mut places.rows[next..next + WIDE];
            if run & (run + 1) == 0 {
                // One run, or none: whole vectors are written, of which so many count.
                let column = u8x16::from_slice(simd, &NUMBERS) + (first as u8 + start as u8);
                column.store_slice(columns);
                u8x16::splat(simd, row).store_slice(rows);
            } else {
                put_apart(sees, (first as u8, row), columns, rows);
            }
            next += sees.count_ones() as usize;
        }
    }
    next
}

const NUMBERS: [u8; WIDE] = [0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15];

/// The places of a row of which something nearer hides the middle.
#[cold]
fn put_apart(mut sees: u32, (first, row): (u8, u8), columns: &mut [u8], rows: &mut [u8]) {
    let mut i = 0;
    while sees != 0 {
        columns[i] = first + sees.trailing_zeros() as u8;
        rows[i] = row;
        sees &= sees - 1;
        i += 1;
    }
}
