//! Attributes of what is seen, with their exact change from sample to sample.
//!
//! Over a triangle each attribute is N(x, y)/S(x, y), both linear over the samples. A [`Plane`] holds the numerators of a
//! triangle's twelve numbers in one row, so a sample costs a few operations on whole rows; triangles that are thinner than
//! their rounding, or reach behind the eye, take the careful way in f64 instead.

use super::camera::{Vertex, View};
use super::visibility::{NOTHING, STRIDE};
use crate::map::Rect;
use crate::mesh::Mesh;
use glam::{DVec3, Vec2, Vec3, Vec4};

/// The fragments of a tile, packed: one entry per sample that sees something, in row order. Vectors are kept in fours with a
/// number beside them, which is what vectorised shading reads fastest; the methods take them apart.
///
/// Changes are per sample to the right (`dx`) and downward (`dy`).
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Fragments {
    /// Place in the tile: row * tile width + column.
    pub place: Vec<u16>,
    /// Index of the triangle in the mesh.
    pub triangle: Vec<u32>,
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

    fn clear(&mut self) {
        self.place.clear();
        self.triangle.clear();
        self.facing.clear();
        self.position.clear();
        self.normal.clear();
        self.tangent.clear();
        self.normal_dx.clear();
        self.normal_dy.clear();
        self.v_change.clear();
    }

    fn push(&mut self, place: u16, triangle: u32, facing: f32, row: &Row) {
        self.place.push(place);
        self.triangle.push(triangle);
        self.facing.push(facing);
        let [position, normal, tangent] = row.groups();
        self.position.push(position);
        self.normal.push(normal);
        self.tangent.push(tangent);
    }

    fn push_changes(&mut self, dx: &Row, dy: &Row) {
        self.normal_dx.push(dx.groups()[1]);
        self.normal_dy.push(dy.groups()[1]);
        self.v_change.push([dx.0[11], dy.0[11]]);
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

    fn set_normal(&mut self, n: Vec3) {
        self.0[4..7].copy_from_slice(&n.to_array());
    }
}

/// What shading needs of the vertices, in the order of the mesh.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Vertices {
    pub(super) projected: Vec<Option<Vertex>>,
    pub(super) rows: Vec<Row>,
}

/// A triangle's homogeneous edge functions.
struct Edges {
    corners: [usize; 3],
    /// Row i, dotted with (x, y, 1), is corner i's weight over w, up to one common factor.
    rows: [DVec3; 3],
    /// All three corners lie before the eye.
    before: bool,
}

/// Weights of the three corners at a sample, and their change.
struct Weights {
    at: [f32; 3],
    dx: [f32; 3],
    dy: [f32; 3],
}

impl Edges {
    fn new(mesh: &Mesh, vertices: &Vertices, triangle: u32) -> Self {
        let corners = mesh.triangles[triangle as usize].map(|i| i as usize);
        let h = corners.map(|i| vertices.projected[i].map_or(DVec3::ZERO, |v| v.h));
        Self {
            corners,
            rows: [h[1].cross(h[2]), h[2].cross(h[0]), h[0].cross(h[1])],
            before: h.iter().all(|h| h.z > 0.0),
        }
    }

    fn weights(&self, x: f64, y: f64) -> Weights {
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
        let change = |i: usize, row: f64, all: f64| ((row - at[i] * all) / sum) as f32;
        // The rounding of corners can put a centre a hair outside: never extrapolate.
        let inside = at.map(|w| w.max(0.0));
        let inside_sum: f64 = inside.iter().sum();
        Weights {
            at: inside.map(|w| (w / inside_sum) as f32),
            dx: [0, 1, 2].map(|i| change(i, self.rows[i].x, total.x)),
            dy: [0, 1, 2].map(|i| change(i, self.rows[i].y, total.y)),
        }
    }

    /// Twice the area in homogeneous samples.
    fn determinant(&self, h0: DVec3) -> f64 {
        self.rows[0].dot(h0)
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
    /// `None` for a triangle that must be taken carefully.
    fn new(vertices: &Vertices, edges: &Edges) -> Option<Self> {
        if !edges.before {
            return None;
        }
        let h = edges
            .corners
            .map(|i| vertices.projected[i].map_or(DVec3::ZERO, |v| v.h));
        let determinant = edges.determinant(h[0]);
        let high = |i: usize| {
            let slope = edges.rows[i].truncate().length() * h[i].z;
            determinant.abs() > LEAST_HEIGHT * slope
        };
        let middle = h.iter().map(|h| h.truncate() / h.z).sum::<glam::DVec2>() / 3.0;
        if !(high(0) && high(1) && high(2) && middle.abs().max_element() < FARTHEST) {
            return None;
        }
        let from = middle.floor();
        let scale = h[0].z / determinant;
        let p = (from + 0.5).extend(1.0);
        let rows = edges.corners.map(|i| &vertices.rows[i]);
        let mix = |w: [f32; 3]| {
            Row::map3(rows[0], rows[1], rows[2], |a, b, c| {
                a * w[0] + b * w[1] + c * w[2]
            })
        };
        let at = edges.rows.map(|r| r.dot(p) * scale);
        let dx = edges.rows.map(|r| r.x * scale);
        let dy = edges.rows.map(|r| r.y * scale);
        let total = |w: [f64; 3]| (w[0] + w[1] + w[2]) as f32;
        let short = |w: [f64; 3]| w.map(|w| w as f32);
        Some(Self {
            from: [from.x as i32, from.y as i32],
            at: mix(short(at)),
            dx: mix(short(dx)),
            dy: mix(short(dy)),
            sum: [total(at), total(dx), total(dy)],
        })
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

/// What is known of a triangle in a tile.
struct Surface {
    edges: Edges,
    plane: Option<Plane>,
    facing: f32,
    /// Out of the outside as the vertex normals tell it, any length; zero for a triangle without area.
    outward: Vec3,
}

impl Surface {
    fn new(mesh: &Mesh, vertices: &Vertices, view: &View, triangle: u32) -> Self {
        let edges = Edges::new(mesh, vertices, triangle);
        let [a, b, c] = edges.corners.map(|i| mesh.positions[i]);
        let normals: Vec3 = edges.corners.iter().map(|&i| mesh.normals[i]).sum();
        let face = (b - a).cross(c - a);
        let outward = if face.dot(normals) < 0.0 { -face } else { face };
        // A plane is seen from one side, wherever on it one looks.
        let behind = outward.dot(view.toward_any_length(a)) < 0.0;
        Self {
            plane: Plane::new(vertices, &edges),
            edges,
            facing: if behind { -1.0 } else { 1.0 },
            outward,
        }
    }

    /// The attributes and their change in f64 weights.
    fn carefully(&self, vertices: &Vertices, column: i32, row: i32) -> (Row, [Row; 2]) {
        let w = self
            .edges
            .weights(f64::from(column) + 0.5, f64::from(row) + 0.5);
        let rows = self.edges.corners.map(|i| &vertices.rows[i]);
        let mix = |w: [f32; 3]| {
            Row::map3(rows[0], rows[1], rows[2], |a, b, c| {
                a * w[0] + b * w[1] + c * w[2]
            })
        };
        (mix(w.at), [mix(w.dx), mix(w.dy)])
    }

    /// A normal for where the interpolated one has no direction.
    fn any_normal(&self, view: &View, position: Vec3) -> Vec3 {
        let outward = self.outward.try_normalize();
        outward.unwrap_or_else(|| view.toward(position))
    }
}

/// The surfaces of a tile, found by triangle. Neighbours mostly see the same triangle, rows see those of the row above.
struct Surfaces {
    triangle: Vec<u32>,
    surface: Vec<Surface>,
    /// Places in the two, by the triangle's hash.
    slots: [u16; Self::SLOTS],
}

impl Surfaces {
    const SLOTS: usize = 1024;
    const EMPTY: u16 = u16::MAX;

    fn new() -> Self {
        Self {
            triangle: Vec::new(),
            surface: Vec::new(),
            slots: [Self::EMPTY; Self::SLOTS],
        }
    }

    /// The surface of a triangle; a tile has fewer samples than 2^16, and so fewer surfaces.
    fn get(&mut self, triangle: u32, make: impl FnOnce() -> Surface) -> &Surface {
        let slot = &mut self.slots[(triangle.wrapping_mul(0x9e37_79b9) >> 22) as usize];
        let known = *slot != Self::EMPTY && self.triangle[*slot as usize] == triangle;
        if !known {
            *slot = self.surface.len() as u16;
            self.triangle.push(triangle);
            self.surface.push(make());
        }
        &self.surface[*slot as usize]
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
    out.clear();
    let mut surfaces = Surfaces::new();
    for (y, line) in seen.chunks(STRIDE).enumerate() {
        let line = &line[..rect.width as usize];
        let row = rect.y as i32 + y as i32;
        let mut x = 0;
        while x < line.len() {
            let triangle = line[x];
            let run = line[x..].iter().take_while(|t| **t == triangle).count();
            if triangle != NOTHING {
                let make = || Surface::new(mesh, vertices, view, triangle);
                let surface = surfaces.get(triangle, make);
                let place = y * rect.width as usize + x;
                let first = (rect.x as i32 + x as i32, row);
                let run = (triangle, place, run);
                resolve_run(surface, vertices, view, run, first, changes, out);
            }
            x += run;
        }
    }
}

/// Neighbours in a row that see one triangle.
#[inline(always)]
fn resolve_run(
    surface: &Surface,
    vertices: &Vertices,
    view: &View,
    (triangle, place, run): (u32, usize, usize),
    (column, row): (i32, i32),
    changes: bool,
    out: &mut Fragments,
) {
    for i in 0..run {
        let column = column + i as i32;
        let (mut at, change) = match &surface.plane {
            Some(plane) => {
                let (at, inverse) = plane.at(column, row);
                let change = changes.then(|| plane.change(&at, inverse));
                (at, change)
            }
            None => {
                let (at, change) = surface.carefully(vertices, column, row);
                (at, changes.then_some(change))
            }
        };
        let length = at.normal().length_squared();
        if !(length > 1e-20 && length < f32::INFINITY) {
            at.set_normal(surface.any_normal(view, at.position()));
        }
        out.push((place + i) as u16, triangle, surface.facing, &at);
        if let Some([dx, dy]) = change {
            out.push_changes(&dx, &dy);
        }
    }
}
