//! Attributes of what is seen, with their exact change from sample to sample.
//!
//! Over a triangle each attribute is N(x, y)/S(x, y), both linear over the samples. A [`Plane`] holds the numerators of a
//! triangle's twelve numbers in one row, so a sample costs a few operations on whole rows; triangles that are thinner than
//! their rounding, or reach behind the eye, take the careful way in f64 instead.

use super::camera::{Vertex, View};
use super::visibility::{NOTHING, STRIDE};
use crate::map::Rect;
use crate::math;
use crate::mesh::Mesh;
use fearless_simd::{Simd, dispatch};
use fearless_simd_macros::simd;
use glam::{DVec2, DVec3, Vec2, Vec3, Vec4};

/// The fragments of a tile, packed: one entry per sample that sees something, in row order. Vectors are kept in fours with a
/// number beside them, which is what vectorised shading reads fastest; the methods take them apart.
///
/// Changes are per sample to the right (`dx`) and downward (`dy`).
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Fragments {
    /// Place in the tile: row * tile width + column.
    pub place: Vec<u16>,
    /// 1, or -1 where the surface is seen from the side its normals point away from.
    pub facing: Vec<f32>,
    /// World position; the layout's handedness.
    pub position: Vec<[f32; 4]>,
    /// Interpolated normal out of the side that the mesh calls outside, not normalised but of some length; u.
    pub normal: Vec<[f32; 4]>,
    /// Interpolated tangent, neither normalised nor orthogonal to the normal; v (up).
    pub tangent: Vec<[f32; 4]>,
    /// Change of `normal`; of u. Empty where changes were not asked for, and so are the next two.
    pub normal_dx: Vec<[f32; 4]>,
    /// Change of `normal`; of u.
    pub normal_dy: Vec<[f32; 4]>,
    /// Change of v to the right, downward.
    pub v_change: Vec<[f32; 2]>,
}

impl Fragments {
    /// How many samples see something.
    pub fn len(&self) -> usize {
        self.place.len()
    }

    /// Whether no sample sees anything.
    pub fn is_empty(&self) -> bool {
        self.place.is_empty()
    }

    /// World position.
    pub fn position(&self, i: usize) -> Vec3 {
        xyz(self.position[i])
    }

    /// Unit normal.
    pub fn normal(&self, i: usize) -> Vec3 {
        xyz(self.normal[i]).normalize()
    }

    /// Interpolated tangent; w: the layout's handedness.
    pub fn tangent(&self, i: usize) -> Vec4 {
        xyz(self.tangent[i]).extend(self.position[i][3])
    }

    /// Texture coordinate, v up.
    pub fn uv(&self, i: usize) -> Vec2 {
        Vec2::new(self.normal[i][3], self.tangent[i][3])
    }

    /// Change of the texture coordinate to the right and downward.
    ///
    /// # Panics
    /// Where changes were not asked for.
    pub fn uv_change(&self, i: usize) -> [Vec2; 2] {
        let [dx, dy] = self.v_change[i];
        [
            Vec2::new(self.normal_dx[i][3], dx),
            Vec2::new(self.normal_dy[i][3], dy),
        ]
    }

    /// Change of the unit normal to the right and downward, at right angles to it.
    ///
    /// # Panics
    /// Where changes were not asked for.
    pub fn normal_change(&self, i: usize) -> [Vec3; 2] {
        let n = self.normal(i);
        let length = xyz(self.normal[i]).length();
        [self.normal_dx[i], self.normal_dy[i]].map(|d| {
            let d = xyz(d) / length;
            d - n * n.dot(d)
        })
    }

    /// Makes room for `n` fragments, whose numbers are yet to be set.
    fn resize(&mut self, n: usize, changes: bool) {
        self.place.resize(n, 0);
        self.facing.resize(n, 0.0);
        self.position.resize(n, [0.0; 4]);
        self.normal.resize(n, [0.0; 4]);
        self.tangent.resize(n, [0.0; 4]);
        let n = if changes { n } else { 0 };
        self.normal_dx.resize(n, [0.0; 4]);
        self.normal_dy.resize(n, [0.0; 4]);
        self.v_change.resize(n, [0.0; 2]);
    }

    #[inline(always)]
    fn name(&mut self, run: std::ops::Range<usize>, place: usize, facing: f32) {
        let facings = self.facing[run.clone()].iter_mut();
        for (i, (at, f)) in self.place[run].iter_mut().zip(facings).enumerate() {
            *at = (place + i) as u16;
            *f = facing;
        }
    }

    /// Sets neighbours one after the other, by their number.
    #[inline(always)]
    fn set(&mut self, run: std::ops::Range<usize>, row: impl Fn(usize) -> Row) {
        let position = self.position[run.clone()].iter_mut();
        let normal = self.normal[run.clone()].iter_mut();
        let tangent = self.tangent[run].iter_mut();
        for (i, ((p, n), t)) in position.zip(normal).zip(tangent).enumerate() {
            [*p, *n, *t] = row(i).groups();
        }
    }

    #[inline(always)]
    fn set_changes(&mut self, run: std::ops::Range<usize>, change: impl Fn(usize) -> [Row; 2]) {
        if self.v_change.is_empty() {
            return;
        }
        let dx = self.normal_dx[run.clone()].iter_mut();
        let dy = self.normal_dy[run.clone()].iter_mut();
        let v = self.v_change[run].iter_mut();
        for (i, ((dx, dy), v)) in dx.zip(dy).zip(v).enumerate() {
            let [x, y] = change(i);
            (*dx, *dy) = (x.groups()[1], y.groups()[1]);
            *v = [x.0[11], y.0[11]];
        }
    }

    /// Gives normals without a direction that of `any`, by the position.
    #[inline(always)]
    fn mend_normals(&mut self, run: std::ops::Range<usize>, any: impl Fn(Vec3) -> Vec3) {
        let positions = &self.position[run.clone()];
        for (normal, position) in self.normal[run].iter_mut().zip(positions) {
            let length = xyz(*normal).length_squared();
            if !(length > 1e-20 && length < f32::INFINITY) {
                let n = any(xyz(*position));
                *normal = [n.x, n.y, n.z, normal[3]];
            }
        }
    }
}

fn xyz([x, y, z, _]: [f32; 4]) -> Vec3 {
    Vec3::new(x, y, z)
}

/// The twelve numbers of a vertex or a fragment: position, handedness, normal, u, tangent, v.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Row([f32; 12]);

impl Row {
    pub(super) fn new(mesh: &Mesh, vertex: usize) -> Self {
        let (p, n) = (mesh.positions[vertex], mesh.normals[vertex]);
        let (t, uv) = (mesh.tangents[vertex], mesh.uvs[vertex]);
        Self([p.x, p.y, p.z, t.w, n.x, n.y, n.z, uv.x, t.x, t.y, t.z, uv.y])
    }

    #[inline(always)]
    fn groups(&self) -> [[f32; 4]; 3] {
        let r = &self.0;
        [
            [r[0], r[1], r[2], r[3]],
            [r[4], r[5], r[6], r[7]],
            [r[8], r[9], r[10], r[11]],
        ]
    }

    /// Each number of the rows through `f`.
    #[inline(always)]
    fn map3(a: &Self, b: &Self, c: &Self, f: impl Fn(f32, f32, f32) -> f32) -> Self {
        let mut row = [0.0; 12];
        for i in 0..12 {
            row[i] = f(a.0[i], b.0[i], c.0[i]);
        }
        Self(row)
    }

    fn position(&self) -> Vec3 {
        xyz(self.groups()[0])
    }

    fn normal(&self) -> Vec3 {
        xyz(self.groups()[1])
    }
}

/// What shading needs of the vertices, in the order of the mesh.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Vertices {
    pub(super) projected: Vec<Option<Vertex>>,
    pub(super) seen: Vec<Place>,
    pub(super) rows: Vec<Row>,
}

/// Where a vertex is in the picture: samples, and 1/w. Not finite or not positive where it is nowhere.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Place {
    at: DVec2,
    inverse: f64,
}

impl Place {
    pub(super) fn new(vertex: Option<Vertex>) -> Self {
        let h = vertex.map_or(DVec3::ZERO, |v| v.h);
        let inverse = 1.0 / h.z;
        Self {
            at: h.truncate() * inverse,
            inverse,
        }
    }
}

/// A triangle's homogeneous edge functions.
pub(super) struct Edges {
    pub(super) corners: [usize; 3],
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
    pub(super) fn new(mesh: &Mesh, vertices: &Vertices, triangle: u32) -> Self {
        let corners = mesh.triangles[triangle as usize].map(|i| i as usize);
        let h = corners.map(|i| vertices.projected[i].map_or(DVec3::ZERO, |v| v.h));
        Self {
            corners,
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

/// A triangle's attributes as linear functions over the samples around its middle.
#[derive(Clone, Copy)]
struct Plane {
    /// The sample that offsets are counted from.
    from: [i32; 2],
    at: Row,
    dx: Row,
    dy: Row,
    /// The denominator and its change.
    sum: [f32; 3],
}

impl Plane {
    /// `None` for a triangle that must be taken carefully. With it whether the corners wind counter-clockwise as seen.
    #[inline(always)]
    fn new(places: [&Place; 3], rows: [&Row; 3]) -> Option<(Self, bool)> {
        let q = places.map(|p| p.at);
        let sides = [q[2] - q[1], q[0] - q[2], q[1] - q[0]];
        let twice = sides[2].perp_dot(-sides[1]);
        let longest = sides[0]
            .length_squared()
            .max(sides[1].length_squared())
            .max(sides[2].length_squared());
        let middle = (q[0] + q[1] + q[2]) * (1.0 / 3.0);
        // NaN and what lies behind the eye fail these too.
        let before = places.iter().all(|p| p.inverse > 0.0);
        let high = twice * twice > LEAST_HEIGHT * LEAST_HEIGHT * longest;
        let near =
            middle.x.abs() < FARTHEST && middle.y.abs() < FARTHEST && longest < FARTHEST * FARTHEST;
        if !(before && high && near) {
            return None;
        }
        let from = [middle.x as i32, middle.y as i32];
        let p = DVec2::new(f64::from(from[0]), f64::from(from[1])) + 0.5;
        let scale = 1.0 / (twice * places[0].inverse);
        let share = places.map(|p| p.inverse * scale);
        let at = |j: usize, k: usize, s: f64| (q[j] - p).perp_dot(q[k] - p) * s;
        let at = [at(1, 2, share[0]), at(2, 0, share[1]), at(0, 1, share[2])];
        let dx = [0, 1, 2].map(|i| -sides[i].y * share[i]);
        let dy = [0, 1, 2].map(|i| sides[i].x * share[i]);
        let plane = Self {
            from,
            at: mix(rows, at),
            dx: mix(rows, dx),
            dy: mix(rows, dy),
            sum: [at, dx, dy].map(|w| (w[0] + w[1] + w[2]) as f32),
        };
        // Rows run downward.
        Some((plane, twice < 0.0))
    }

    /// Neighbours in a row, from a sample on.
    #[inline(always)]
    fn fill(&self, run: std::ops::Range<usize>, (column, row): (i32, i32), out: &mut Fragments) {
        out.set(run.clone(), |i| self.at(column + i as i32, row).0);
        out.set_changes(run, |i| {
            let (at, inverse) = self.at(column + i as i32, row);
            self.change(&at, inverse)
        });
    }

    /// The attributes at a sample, and 1 over the denominator there.
    #[inline(always)]
    fn at(&self, column: i32, row: i32) -> (Row, f32) {
        let x = (column - self.from[0]) as f32;
        let y = (row - self.from[1]) as f32;
        let inverse = 1.0 / (self.sum[0] + self.sum[1] * x + self.sum[2] * y);
        let at = Row::map3(&self.at, &self.dx, &self.dy, |n, dx, dy| {
            (n + dx * x + dy * y) * inverse
        });
        (at, inverse)
    }

    /// The change of the attributes there to the right and downward.
    #[inline(always)]
    fn change(&self, at: &Row, inverse: f32) -> [Row; 2] {
        let along = |n: &Row, sum: f32| Row::map3(n, at, at, |n, a, _| (n - a * sum) * inverse);
        [along(&self.dx, self.sum[1]), along(&self.dy, self.sum[2])]
    }
}

/// A weighted sum of rows.
#[inline(always)]
fn mix(rows: [&Row; 3], weights: [f64; 3]) -> Row {
    let w = weights.map(|w| w as f32);
    Row::map3(rows[0], rows[1], rows[2], |a, b, c| {
        a * w[0] + b * w[1] + c * w[2]
    })
}

/// What is known of a triangle in a tile.
struct Surface {
    plane: Option<Plane>,
    facing: f32,
}

impl Surface {
    #[inline(always)]
    fn new(mesh: &Mesh, vertices: &Vertices, view: &View, triangle: u32) -> Self {
        let corners = mesh.triangles[triangle as usize].map(|i| i as usize);
        let rows = corners.map(|i| &vertices.rows[i]);
        let outside = outward(rows);
        match Plane::new(corners.map(|i| &vertices.seen[i]), rows) {
            Some((plane, counter_clockwise)) => Self {
                plane: Some(plane),
                facing: if counter_clockwise == outside.as_wound {
                    1.0
                } else {
                    -1.0
                },
            },
            None => {
                // A plane is seen from one side, wherever on it one looks.
                let toward = view.toward_any_length(rows[0].position());
                Self {
                    plane: None,
                    facing: if outside.normal.dot(toward) < 0.0 {
                        -1.0
                    } else {
                        1.0
                    },
                }
            }
        }
    }
}

/// The side of a triangle that the vertex normals call outside.
pub(super) struct Outward {
    /// Of any length; zero for a triangle without area.
    pub(super) normal: Vec3,
    /// Whether the triangle winds counter-clockwise seen from there.
    as_wound: bool,
}

#[inline(always)]
pub(super) fn outward(rows: [&Row; 3]) -> Outward {
    let [a, b, c] = rows.map(Row::position);
    let normals: Vec3 = rows.map(Row::normal).into_iter().sum();
    let face = (b - a).cross(c - a);
    let as_wound = face.dot(normals) >= 0.0;
    Outward {
        normal: if as_wound { face } else { -face },
        as_wound,
    }
}

/// The attributes and their change in f64 weights.
fn carefully(
    mesh: &Mesh,
    vertices: &Vertices,
    triangle: u32,
    (column, row): (i32, i32),
) -> (Row, [Row; 2]) {
    let edges = Edges::new(mesh, vertices, triangle);
    let w = edges.weights(f64::from(column) + 0.5, f64::from(row) + 0.5);
    let rows = edges.corners.map(|i| &vertices.rows[i]);
    let mix = |w: [f64; 3]| mix(rows, w);
    (mix(w.at), [mix(w.dx), mix(w.dy)])
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
    mesh: &Mesh,
    vertices: &Vertices,
    view: &View,
    (rect, seen): (Rect, &[u32]),
    changes: bool,
    out: &mut Fragments,
) {
    let width = rect.width as usize;
    let line = |line: &[u32]| line[..width].iter().filter(|t| **t != NOTHING).count();
    out.resize(seen.chunks(STRIDE).map(line).sum(), changes);
    let scene = (mesh, vertices, view);
    dispatch!(math::level(), simd => resolve_all(simd, scene, rect, seen, out));
}

#[simd]
fn resolve_all<S: Simd>(
    _: S,
    (mesh, vertices, view): (&Mesh, &Vertices, &View),
    rect: Rect,
    seen: &[u32],
    out: &mut Fragments,
) {
    let mut surfaces = Surfaces::new();
    let mut next = 0;
    for (y, line) in seen.chunks(STRIDE).enumerate() {
        let line = &line[..rect.width as usize];
        let row = rect.y as i32 + y as i32;
        let mut x = 0;
        while x < line.len() {
            let triangle = line[x];
            let start = x;
            while x < line.len() && line[x] == triangle {
                x += 1;
            }
            if triangle == NOTHING {
                continue;
            }
            let surface = surfaces.get(triangle, || Surface::new(mesh, vertices, view, triangle));
            let run = next..next + (x - start);
            next = run.end;
            let first = (rect.x as i32 + start as i32, row);
            let place = y * rect.width as usize + start;
            out.name(run.clone(), place, surface.facing);
            match &surface.plane {
                Some(plane) => plane.fill(run.clone(), first, out),
                None => {
                    let at = |i: usize| (first.0 + i as i32, first.1);
                    out.set(run.clone(), |i| {
                        carefully(mesh, vertices, triangle, at(i)).0
                    });
                    out.set_changes(run.clone(), |i| {
                        carefully(mesh, vertices, triangle, at(i)).1
                    });
                }
            }
            out.mend_normals(run, |position| {
                let corners = mesh.triangles[triangle as usize];
                let normal = outward(corners.map(|i| &vertices.rows[i as usize])).normal;
                normal
                    .try_normalize()
                    .unwrap_or_else(|| view.toward(position))
            });
        }
    }
}
