//! Triangles with normals, tangents and texture coordinates: built-in shapes, one file each, and meshes from files.
//!
//! World is y up, right-handed; front faces wind counter-clockwise seen from outside. v of a texture coordinate runs up, as
//! in OBJ; glTF's is flipped on load and save.

use glam::{Vec2, Vec3, Vec4};

/// An indexed triangle mesh. All vertex arrays have one length; every index is inside them.
#[derive(Clone, Debug, PartialEq)]
pub struct Mesh {
    /// What it is called in files and captions.
    pub name: String,
    /// Positions.
    pub positions: Vec<Vec3>,
    /// Unit normals, outward.
    pub normals: Vec<Vec3>,
    /// Unit tangents along +U; w = +1 where the layout is not mirrored, so that B = w (N x T) points to image-up. A zero
    /// vector where the surface has no direction of its own (a pole, a degenerate layout).
    pub tangents: Vec<Vec4>,
    /// Texture coordinates, v up.
    pub uvs: Vec<Vec2>,
    /// Vertex indices of each triangle.
    pub triangles: Vec<[u32; 3]>,
    /// The surface's width over its height for one turn of UV: what a recipe's `aspect` should be on this mesh.
    pub aspect: f32,
}
