//! Attributes of what is seen in f64, sample by sample: slow, and what the fast way is measured against.

use super::geometry::outward;
use super::resolve::Edges;
use super::visibility::NOTHING;
use super::{Tile, View};
use crate::mesh::Mesh;
use glam::{DVec2, DVec3};

/// One sample that sees something, its attributes interpolated in f64.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Exact {
    /// Column in the whole picture, in samples.
    pub column: u32,
    /// Row, 0 is the top.
    pub row: u32,
    /// World position.
    pub position: DVec3,
    /// Unit normal of the side that the mesh calls outside.
    pub normal: DVec3,
    /// Interpolated tangent, neither normalised nor orthogonal to the normal.
    pub tangent: DVec3,
    /// The layout's handedness: the bitangent is N x T times this.
    pub handedness: f64,
    /// Texture coordinate, v up.
    pub uv: DVec2,
    /// 1, or -1 where the surface is seen from the side its normals point away from.
    pub facing: f64,
}

/// Every sample of a tile that sees something, in row order.
pub(super) fn samples<'a>(
    mesh: &'a Mesh,
    view: &'a View,
    tile: &'a Tile,
) -> impl Iterator<Item = Exact> + 'a {
    let rect = tile.rect;
    tile.rows().enumerate().flat_map(move |(y, line)| {
        let row = rect.y + y as u32;
        let seen = line.iter().enumerate().filter(|(_, t)| **t != NOTHING);
        seen.map(move |(x, &triangle)| sample(mesh, view, triangle, (rect.x + x as u32, row)))
    })
}

fn sample(mesh: &Mesh, view: &View, triangle: u32, (column, row): (u32, u32)) -> Exact {
    let edges = Edges::new(mesh, view, triangle);
    let weights = edges
        .weights(f64::from(column) + 0.5, f64::from(row) + 0.5)
        .at;
    let mix3 = |f: &dyn Fn(usize) -> DVec3| -> DVec3 {
        (0..3).map(|k| f(edges.corners[k]) * weights[k]).sum()
    };
    let position = mix3(&|i| mesh.positions[i].as_dvec3());
    let toward = view.toward_any_length(position.as_vec3()).as_dvec3();
    let outside = outward(mesh, mesh.triangles[triangle as usize])
        .normal
        .as_dvec3();
    let normal = mix3(&|i| mesh.normals[i].as_dvec3())
        .try_normalize()
        .or_else(|| outside.try_normalize())
        .or_else(|| toward.try_normalize())
        .unwrap_or(DVec3::Z);
    let pair = mix3(&|i| mesh.uvs[i].as_dvec2().extend(f64::from(mesh.tangents[i].w)));
    Exact {
        column,
        row,
        position,
        normal,
        tangent: mix3(&|i| mesh.tangents[i].truncate().as_dvec3()),
        handedness: if pair.z < 0.0 { -1.0 } else { 1.0 },
        uv: pair.truncate(),
        facing: if outside.dot(toward) < 0.0 { -1.0 } else { 1.0 },
    }
}
