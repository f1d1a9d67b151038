//! A sphere with the layout of a world map.

use super::Mesh;
use super::grid::{AROUND, Vertex, along_u, ring, step};
use crate::math;
use glam::{Vec2, Vec3};
use std::f32::consts::{FRAC_PI_2, PI};

/// Steps from pole to pole.
const ROWS: u32 = 128;

/// The unit sphere, 256 x 128 cells: u is the longitude with u = 1/2 at +z, v the latitude from the lower pole (0) to the
/// upper (1). At the poles U has no direction: the tangent of their vertices is zero, and light treats them as isotropic.
/// `aspect` is 2, that of the equator.
pub fn sphere() -> Mesh {
    let ring = ring();
    let mut mesh = Mesh::empty("sphere", 2.0);
    mesh.push_grid(AROUND, ROWS - 2, |i, j| {
        let v = step(j + 1, ROWS);
        let (sin, cos) = math::sin_cos(v * PI - FRAC_PI_2);
        let normal = (ring[i] * cos + Vec3::Y * sin).normalize();
        Vertex {
            position: normal,
            normal,
            tangent: along_u(ring[i]),
            uv: Vec2::new(step(i, AROUND), v),
        }
    });
    let upper_row = (ROWS - 2) * (AROUND + 1);
    for i in 0..AROUND {
        let bottom = push_pole(&mut mesh, -1.0, i);
        mesh.triangles.push([bottom, i + 1, i]);
        let top = push_pole(&mut mesh, 1.0, i);
        mesh.triangles.push([top, upper_row + i, upper_row + i + 1]);
    }
    mesh
}

/// One pole vertex for each triangle there, its u in the middle of the triangle's.
fn push_pole(mesh: &mut Mesh, y: f32, column: u32) -> u32 {
    mesh.push_vertex(Vertex {
        position: Vec3::Y * y,
        normal: Vec3::Y * y,
        tangent: Vec3::ZERO,
        uv: Vec2::new((column as f32 + 0.5) / AROUND as f32, 0.5 + 0.5 * y),
    })
}
