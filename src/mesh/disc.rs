//! A flat disc.

use super::Mesh;
use super::grid::{AROUND, ring};
use glam::{Vec2, Vec3};

/// The disc of radius 1 facing the viewer (+z). UV is planar: the circle inscribed in the unit square, U along +x all over,
/// so the layout has no pole and a radial pattern brings its own directions.
pub fn disc() -> Mesh {
    let ring = ring();
    let mut mesh = Mesh::empty("disc", 1.0);
    // The ring lies in the xz plane, counter-clockwise seen from above: lifted up, its -z is +y.
    mesh.push_fan(
        Vec3::ZERO,
        ring[..AROUND as usize]
            .iter()
            .map(|d| Vec3::new(d.x, -d.z, 0.0)),
        (Vec3::X, Vec3::Y),
        Vec2::splat(0.5),
        Vec2::splat(0.5),
    );
    mesh
}
