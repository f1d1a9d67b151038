//! A closed cylinder around the y axis.

use super::Mesh;
use super::grid::{AROUND, Vertex, along_u, ring};
use glam::{Vec2, Vec3};
use std::f32::consts::PI;

/// Radius of the cylinder.
pub const RADIUS: f32 = 1.0;
/// Height of the cylinder, centred on the origin.
pub const HEIGHT: f32 = 2.0;

/// The cylinder. Its side is the whole map: u once around with u = 1/2 at +z, v from the lower edge to the upper, and
/// `aspect` = 2 pi [`RADIUS`] / [`HEIGHT`]. The two ends are closed, so that no view looks through it; each shows the whole
/// map once more, planar as on the disc and with U along +x. The layout therefore overlaps itself; the pot's does not.
pub fn cylinder() -> Mesh {
    let ring = ring();
    let half = 0.5 * HEIGHT * Vec3::Y;
    let mut mesh = Mesh::empty("cylinder", 2.0 * PI * RADIUS / HEIGHT);
    mesh.push_grid(AROUND, 1, |i, j| Vertex {
        position: ring[i] * RADIUS + half * (2.0 * j as f32 - 1.0),
        normal: ring[i],
        tangent: along_u(ring[i]),
        uv: Vec2::new(i as f32 / AROUND as f32, j as f32),
    });
    let edge = &ring[..AROUND as usize];
    let planar = Vec2::splat(0.5 / RADIUS);
    mesh.push_fan(
        half,
        edge.iter().map(|d| *d * RADIUS + half),
        (Vec3::X, Vec3::NEG_Z),
        Vec2::splat(0.5),
        planar,
    );
    mesh.push_fan(
        -half,
        edge.iter().rev().map(|d| *d * RADIUS - half),
        (Vec3::X, Vec3::Z),
        Vec2::splat(0.5),
        planar,
    );
    mesh
}
