//! A torus around the y axis: u once around the large circle, v once around the tube.

use super::Mesh;
use super::grid::{AROUND, Vertex, along_u, ring, step};
use crate::math;
use glam::{Vec2, Vec3};
use std::f32::consts::{PI, TAU};

/// Radius of the circle in the middle of the tube.
pub const MAJOR_RADIUS: f32 = 1.0;
/// Radius of the tube.
pub const MINOR_RADIUS: f32 = 0.42;

/// Segments around the tube.
const ROWS: u32 = 128;

/// The torus, 256 x 128 cells. u = 1/2 faces +z; v = 0 is the inner equator, v = 1/4 the bottom, v = 1/2 the outer equator,
/// v = 3/4 the top. `aspect` is that of the middle circle, [`MAJOR_RADIUS`] / [`MINOR_RADIUS`]; a turn of U is 1.42 times as
/// wide at the outer equator and 0.58 times at the inner one.
pub fn torus() -> Mesh {
    let ring = ring();
    let tube: Vec<(f32, f32)> = (0..=ROWS)
        .map(|j| math::sin_cos(TAU * (j % ROWS) as f32 / ROWS as f32 + PI))
        .collect();
    let mut mesh = Mesh::empty("torus", MAJOR_RADIUS / MINOR_RADIUS);
    mesh.push_grid(AROUND, ROWS, |i, j| {
        let (sin, cos) = tube[j];
        let normal = ring[i] * cos + Vec3::Y * sin;
        Vertex {
            position: ring[i] * MAJOR_RADIUS + normal * MINOR_RADIUS,
            normal,
            tangent: along_u(ring[i]),
            uv: Vec2::new(step(i, AROUND), step(j, ROWS)),
        }
    });
    mesh
}
