//! What the built-in shapes are made of: rectangular grids in UV and flat fans.

use super::Mesh;
use crate::math;
use glam::{Vec2, Vec3};
use std::f32::consts::TAU;

/// Segments around the axis of a round shape. The outline of a circle 400 pixels in radius stays within 0.03 pixels.
pub(super) const AROUND: u32 = 256;

/// A vertex of an unmirrored layout.
#[derive(Clone, Copy)]
pub(super) struct Vertex {
    pub(super) position: Vec3,
    pub(super) normal: Vec3,
    /// Unit, or zero where the surface has no direction of its own.
    pub(super) tangent: Vec3,
    pub(super) uv: Vec2,
}

impl Mesh {
    /// A shape without vertices yet.
    pub(super) fn empty(name: &str, aspect: f32) -> Self {
        Self {
            name: name.to_owned(),
            positions: Vec::new(),
            normals: Vec::new(),
            tangents: Vec::new(),
            uvs: Vec::new(),
            triangles: Vec::new(),
            aspect,
        }
    }

    pub(super) fn push_vertex(&mut self, vertex: Vertex) -> u32 {
        let index = self.positions.len() as u32;
        self.positions.push(vertex.position);
        self.normals.push(vertex.normal.normalize_or_zero());
        self.tangents
            .push(vertex.tangent.normalize_or_zero().extend(1.0));
        self.uvs.push(vertex.uv);
        index
    }

    /// (columns + 1) x (rows + 1) vertices from `vertex(column, row)`, two triangles a cell. Columns run along +U and rows
    /// along +V, so that in an unmirrored layout the triangles wind counter-clockwise seen from outside.
    pub(super) fn push_grid(
        &mut self,
        columns: u32,
        rows: u32,
        vertex: impl Fn(usize, usize) -> Vertex,
    ) {
        let first = self.positions.len() as u32;
        for row in 0..=rows {
            for column in 0..=columns {
                self.push_vertex(vertex(column as usize, row as usize));
            }
        }
        for row in 0..rows {
            for column in 0..columns {
                let a = first + row * (columns + 1) + column;
                let (b, c, d) = (a + 1, a + columns + 2, a + columns + 1);
                self.triangles.push([a, b, c]);
                self.triangles.push([a, c, d]);
            }
        }
    }

    /// A flat round piece: a centre and the closed `rim` around it, counter-clockwise seen from outside. `right` and `up`
    /// span its plane; UV is planar, `uv_centre` at the centre and `uv_per_unit` for one unit along each of the two.
    pub(super) fn push_fan(
        &mut self,
        centre: Vec3,
        rim: impl Iterator<Item = Vec3>,
        (right, up): (Vec3, Vec3),
        uv_centre: Vec2,
        uv_per_unit: Vec2,
    ) {
        let vertex = |position: Vec3| {
            let offset = position - centre;
            Vertex {
                position,
                normal: right.cross(up),
                tangent: right,
                uv: uv_centre + Vec2::new(offset.dot(right), offset.dot(up)) * uv_per_unit,
            }
        };
        let middle = self.push_vertex(vertex(centre));
        let ring: Vec<u32> = rim.map(|p| self.push_vertex(vertex(p))).collect();
        for (i, &a) in ring.iter().enumerate() {
            self.triangles.push([middle, a, ring[(i + 1) % ring.len()]]);
        }
    }
}

/// Unit directions away from the y axis at `AROUND + 1` even steps of u, the last one bit for bit the first. u = 0 is at the
/// back (-z), u = 1/2 faces the viewer (+z), and u grows counter-clockwise seen from above.
pub(super) fn ring() -> Vec<Vec3> {
    let at = |i: u32| {
        let (sin, cos) = math::sin_cos(TAU * i as f32 / AROUND as f32);
        Vec3::new(-sin, 0.0, -cos).normalize()
    };
    (0..=AROUND).map(|i| at(i % AROUND)).collect()
}

/// The direction of growing u at a direction of the [`ring`].
pub(super) fn along_u(radial: Vec3) -> Vec3 {
    Vec3::Y.cross(radial)
}

/// i / n in [0, 1].
pub(super) fn step(i: usize, n: u32) -> f32 {
    i as f32 / n as f32
}
