//! Attributes of what is seen, with their exact change from sample to sample.

use super::camera::View;
use super::visibility::{NOTHING, Seen};
use crate::mesh::Mesh;
use glam::{DVec3, Vec2, Vec3, Vec4};

/// The fragments of a tile, packed: one entry per sample that sees something, in row order, one array per attribute.
/// Derivatives are per sample to the right (`dx`) and downward (`dy`).
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Fragments {
    /// Place in the tile: row * tile width + column.
    pub place: Vec<u16>,
    /// Index of the triangle in the mesh.
    pub triangle: Vec<u32>,
    /// Larger is nearer: 1/distance for a perspective camera, -distance for an orthographic one.
    pub depth: Vec<f32>,
    /// World position.
    pub position: Vec<Vec3>,
    /// Interpolated normal, of unit length, out of the side that the mesh calls outside.
    pub normal: Vec<Vec3>,
    /// Interpolated tangent, neither normalised nor orthogonal to the normal; w: the layout's handedness.
    pub tangent: Vec<Vec4>,
    /// Texture coordinate, v up.
    pub uv: Vec<Vec2>,
    /// Change of `uv`.
    pub duv_dx: Vec<Vec2>,
    /// Change of `uv`.
    pub duv_dy: Vec<Vec2>,
    /// Change of `normal`, at right angles to it.
    pub dn_dx: Vec<Vec3>,
    /// Change of `normal`.
    pub dn_dy: Vec<Vec3>,
    /// Whether the surface is seen from the side its normals point away from.
    pub back: Vec<bool>,
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

    fn with_capacity(n: usize) -> Self {
        Self {
            place: Vec::with_capacity(n),
            triangle: Vec::with_capacity(n),
            depth: Vec::with_capacity(n),
            position: Vec::with_capacity(n),
            normal: Vec::with_capacity(n),
            tangent: Vec::with_capacity(n),
            uv: Vec::with_capacity(n),
            duv_dx: Vec::with_capacity(n),
            duv_dy: Vec::with_capacity(n),
            dn_dx: Vec::with_capacity(n),
            dn_dy: Vec::with_capacity(n),
            back: Vec::with_capacity(n),
        }
    }
}

/// A triangle's homogeneous edge functions.
struct Edges {
    corners: [usize; 3],
    /// Row i, dotted with (x, y, 1), is corner i's weight over w, up to one common factor.
    rows: [DVec3; 3],
    /// Out of the outside as the vertex normals tell it, any length; zero for a triangle without area.
    outward: Vec3,
}

/// Weights of the three corners at a sample, and their change.
struct Weights {
    at: [f32; 3],
    dx: [f32; 3],
    dy: [f32; 3],
}

impl Edges {
    fn new(mesh: &Mesh, view: &View, triangle: u32) -> Self {
        let corners = mesh.triangles[triangle as usize].map(|i| i as usize);
        let [a, b, c] = corners.map(|i| mesh.positions[i]);
        let h = [a, b, c].map(|p| view.project(p).map_or(DVec3::ZERO, |v| v.h));
        let normals: Vec3 = corners.iter().map(|&i| mesh.normals[i]).sum();
        let face = (b - a).cross(c - a);
        Self {
            corners,
            rows: [h[1].cross(h[2]), h[2].cross(h[0]), h[0].cross(h[1])],
            outward: if face.dot(normals) < 0.0 { -face } else { face },
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
}

fn mix<T>(values: [T; 3], weights: [f32; 3]) -> T
where
    T: std::ops::Mul<f32, Output = T> + std::ops::Add<Output = T>,
{
    let [a, b, c] = values;
    a * weights[0] + b * weights[1] + c * weights[2]
}

/// The attributes of every sample that sees something.
pub(super) fn resolve(mesh: &Mesh, view: &View, seen: &Seen) -> Fragments {
    let covered = seen.triangle.iter().filter(|&&t| t != NOTHING).count();
    let mut fragments = Fragments::with_capacity(covered);
    let mut last: Option<(u32, Edges)> = None;
    for (place, &triangle) in seen.triangle.iter().enumerate() {
        if triangle == NOTHING {
            continue;
        }
        // Neighbours mostly see the same triangle.
        let edges = match last {
            Some((t, ref edges)) if t == triangle => edges,
            _ => &last.insert((triangle, Edges::new(mesh, view, triangle))).1,
        };
        let (column, row) = (
            place as u32 % seen.rect.width,
            place as u32 / seen.rect.width,
        );
        let weights = edges.weights(
            f64::from(seen.rect.x + column) + 0.5,
            f64::from(seen.rect.y + row) + 0.5,
        );
        fragments.place.push(place as u16);
        fragments.triangle.push(triangle);
        fragments.depth.push(seen.depth[place]);
        push_attributes(&mut fragments, mesh, view, edges, &weights);
    }
    fragments
}

fn push_attributes(
    fragments: &mut Fragments,
    mesh: &Mesh,
    view: &View,
    edges: &Edges,
    weights: &Weights,
) {
    let corners = edges.corners;
    let position = mix(corners.map(|i| mesh.positions[i]), weights.at);
    fragments.position.push(position);

    let normals = corners.map(|i| mesh.normals[i]);
    let sum = mix(normals, weights.at);
    let normal = sum
        .try_normalize()
        .or_else(|| edges.outward.try_normalize())
        .unwrap_or_else(|| view.toward(position));
    fragments.normal.push(normal);
    let length = sum.length();
    let change = |weights: [f32; 3]| {
        let d = mix(normals, weights) / length;
        let d = d - normal * normal.dot(d);
        if d.is_finite() { d } else { Vec3::ZERO }
    };
    fragments.dn_dx.push(change(weights.dx));
    fragments.dn_dy.push(change(weights.dy));

    let tangents = corners.map(|i| mesh.tangents[i]);
    fragments.tangent.push(mix(tangents, weights.at));
    let uvs = corners.map(|i| mesh.uvs[i]);
    fragments.uv.push(mix(uvs, weights.at));
    fragments.duv_dx.push(mix(uvs, weights.dx));
    fragments.duv_dy.push(mix(uvs, weights.dy));
    fragments
        .back
        .push(edges.outward.dot(view.toward(position)) < 0.0);
}
