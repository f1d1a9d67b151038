//! A mesh as glTF buffers: little-endian, v flipped, every normal and tangent of unit length.

use crate::error::Result;
use crate::math::Frame;
use crate::mesh::Mesh;
use glam::{Vec3, Vec4};
use serde_json::{Value, json};

/// One buffer with its views and accessors, and which accessor is which.
#[derive(Default)]
pub(super) struct Buffer {
    pub(super) bytes: Vec<u8>,
    pub(super) views: Vec<Value>,
    pub(super) accessors: Vec<Value>,
}

const FLOAT: u32 = 5126;
const UNSIGNED_SHORT: u32 = 5123;
const UNSIGNED_INT: u32 = 5125;
const ARRAY_BUFFER: u32 = 34962;
const ELEMENT_ARRAY_BUFFER: u32 = 34963;

impl Buffer {
    /// The mesh's vertices and indices, and the primitive that uses them.
    ///
    /// # Errors
    /// Those of [`Mesh::validate`].
    pub(super) fn add_mesh(&mut self, mesh: &Mesh) -> Result<Value> {
        mesh.validate()?;
        let positions = self.add_floats(mesh.positions.iter().map(|p| p.to_array()), "VEC3");
        let (low, high) = bounds(&mesh.positions);
        // As f64, because the shortest text of an f32 names another number.
        self.accessors[positions]["min"] = json!(low.to_array().map(f64::from));
        self.accessors[positions]["max"] = json!(high.to_array().map(f64::from));
        let frames: Vec<(Vec3, Vec4)> = mesh
            .normals
            .iter()
            .zip(&mesh.tangents)
            .map(|(n, t)| frame(*n, *t))
            .collect();
        let normals = self.add_floats(frames.iter().map(|f| f.0.to_array()), "VEC3");
        let tangents = self.add_floats(frames.iter().map(|f| f.1.to_array()), "VEC4");
        let uvs = self.add_floats(mesh.uvs.iter().map(|uv| [uv.x, 1.0 - uv.y]), "VEC2");
        let indices = self.add_indices(mesh);
        Ok(json!({
            "attributes": {
                "POSITION": positions,
                "NORMAL": normals,
                "TANGENT": tangents,
                "TEXCOORD_0": uvs,
            },
            "indices": indices,
            "material": 0,
        }))
    }

    fn add_floats<const N: usize>(
        &mut self,
        vectors: impl ExactSizeIterator<Item = [f32; N]>,
        kind: &str,
    ) -> usize {
        let count = vectors.len();
        let bytes = vectors.flatten().flat_map(f32::to_le_bytes).collect();
        self.add_accessor(bytes, ARRAY_BUFFER, FLOAT, count, kind)
    }

    fn add_indices(&mut self, mesh: &Mesh) -> usize {
        let indices = mesh.triangles.iter().flatten();
        let count = 3 * mesh.triangles.len();
        // 65535 itself is the restart mark.
        let (kind, bytes) = if mesh.positions.len() <= 65_535 {
            let short = indices.flat_map(|i| (*i as u16).to_le_bytes());
            (UNSIGNED_SHORT, short.collect())
        } else {
            (
                UNSIGNED_INT,
                indices.flat_map(|i| i.to_le_bytes()).collect(),
            )
        };
        self.add_accessor(bytes, ELEMENT_ARRAY_BUFFER, kind, count, "SCALAR")
    }

    fn add_accessor(
        &mut self,
        bytes: Vec<u8>,
        target: u32,
        component: u32,
        count: usize,
        kind: &str,
    ) -> usize {
        let view = self.add_view(&bytes, Some(target));
        self.accessors.push(json!({
            "bufferView": view,
            "componentType": component,
            "count": count,
            "type": kind,
        }));
        self.accessors.len() - 1
    }

    /// Appends bytes on a boundary of four; returns the number of their view.
    pub(super) fn add_view(&mut self, bytes: &[u8], target: Option<u32>) -> usize {
        let offset = self.bytes.len();
        self.bytes.extend_from_slice(bytes);
        self.bytes.resize(self.bytes.len().next_multiple_of(4), 0);
        let mut view = json!({
            "buffer": 0,
            "byteOffset": offset,
            "byteLength": bytes.len(),
        });
        if let Some(target) = target {
            view["target"] = json!(target);
        }
        self.views.push(view);
        self.views.len() - 1
    }
}

fn bounds(positions: &[Vec3]) -> (Vec3, Vec3) {
    positions
        .iter()
        .fold((Vec3::INFINITY, Vec3::NEG_INFINITY), |(low, high), p| {
            (low.min(*p), high.max(*p))
        })
}

/// A unit normal, and a unit tangent perpendicular to it with w = +1 or -1, whatever the mesh has.
fn frame(normal: Vec3, tangent: Vec4) -> (Vec3, Vec4) {
    let handedness = if tangent.w < 0.0 { -1.0 } else { 1.0 };
    match Frame::new(normal, tangent) {
        Some((frame, _)) => (frame.normal, frame.tangent.extend(handedness)),
        None => (Vec3::Y, Vec3::X.extend(handedness)),
    }
}
