//! A flat square.

use super::Mesh;
use super::grid::Vertex;
use glam::{Vec2, Vec3};

/// The square from (-1, -1, 0) to (1, 1, 0), facing the viewer (+z): the whole map, upright, as an image shows it.
pub fn plane() -> Mesh {
    let mut mesh = Mesh::empty("plane", 1.0);
    mesh.push_grid(1, 1, |i, j| {
        let uv = Vec2::new(i as f32, j as f32);
        Vertex {
            position: (2.0 * uv - Vec2::ONE).extend(0.0),
            normal: Vec3::Z,
            tangent: Vec3::X,
            uv,
        }
    });
    mesh
}
