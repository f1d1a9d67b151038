//! Tangents that a file leaves out, made by MikkTSpace, the way glTF 2.0 names and bakers use.
//!
//! MikkTSpace takes dP/dv for the bitangent as it finds it. Ours are the texture coordinates with v up, so B points to
//! image-up, as the glTF sample assets and normal maps have it; with glTF's own v, which runs down, every w would come out
//! reversed and every direction mirrored.

use super::{Mesh, derivatives};
use crate::math::Frame;
use bevy_mikktspace::{Geometry, TangentSpace, generate_tangents};
use glam::{Vec3, Vec4};
use std::collections::HashMap;

/// Most triangles around one point. MikkTSpace walks around a point by recursion and compares all of its triangles with each
/// other: beyond this it would be slow, and far beyond it would overflow the stack.
const MAX_TRIANGLES_AT_A_POINT: u32 = 4096;

/// Triangles to be given tangents, and the tangents of their corners.
struct Corners<'a> {
    mesh: &'a Mesh,
    tangents: Vec<[Vec4; 3]>,
}

impl Corners<'_> {
    fn vertex(&self, face: usize, corner: usize) -> usize {
        self.mesh.triangles[face][corner] as usize
    }
}

impl Geometry for Corners<'_> {
    fn num_faces(&self) -> usize {
        self.mesh.triangles.len()
    }

    fn num_vertices_of_face(&self, _: usize) -> usize {
        3
    }

    fn position(&self, face: usize, corner: usize) -> [f32; 3] {
        self.mesh.positions[self.vertex(face, corner)].into()
    }

    fn normal(&self, face: usize, corner: usize) -> [f32; 3] {
        self.mesh.normals[self.vertex(face, corner)].into()
    }

    fn tex_coord(&self, face: usize, corner: usize) -> [f32; 2] {
        self.mesh.uvs[self.vertex(face, corner)].into()
    }

    fn set_tangent(&mut self, space: Option<TangentSpace>, face: usize, corner: usize) {
        if let Some(space) = space {
            self.tangents[face][corner] = space.tangent_encoded().into();
        }
    }
}

/// Makes the tangents of a mesh that has none. A vertex whose corners differ in tangent is split. Triangles that span no area
/// in UV get zero tangents: they have no direction of their own.
///
/// # Errors
/// What the generator cannot take, as a clause.
pub(super) fn generate(mesh: &mut Mesh) -> Result<(), String> {
    check_points(mesh)?;
    let mut corners = Corners {
        mesh,
        tangents: vec![[Vec4::ZERO; 3]; mesh.triangles.len()],
    };
    generate_tangents(&mut corners).map_err(|e| format!("tangents cannot be made for it: {e}"))?;
    let mut tangents = corners.tangents;
    for (triangle, tangents) in mesh.triangles.iter().zip(&mut tangents) {
        let flat = derivatives(mesh.corners(*triangle), mesh.corner_uvs(*triangle)).is_none();
        for (vertex, tangent) in triangle.iter().zip(tangents) {
            let given = if flat { Vec4::ZERO } else { *tangent };
            *tangent = fitted(mesh.normals[*vertex as usize], given);
        }
    }
    split(mesh, &tangents);
    Ok(())
}

fn check_points(mesh: &Mesh) -> Result<(), String> {
    let mut of_vertex = vec![0u32; mesh.positions.len()];
    for index in mesh.triangles.as_flattened() {
        of_vertex[*index as usize] += 1;
    }
    let mut of_place: HashMap<[u32; 3], u32> = HashMap::with_capacity(mesh.positions.len());
    for (place, corners) in mesh.positions.iter().zip(of_vertex) {
        let count = of_place
            .entry(place.to_array().map(|x| (x + 0.0).to_bits()))
            .or_default();
        *count += corners;
        if *count > MAX_TRIANGLES_AT_A_POINT {
            return Err(format!(
                "more than {MAX_TRIANGLES_AT_A_POINT} triangles meet at {place}, too many to make tangents there"
            ));
        }
    }
    Ok(())
}

/// Writes corner tangents to the vertices; a vertex with more than one tangent is copied for each further one.
fn split(mesh: &mut Mesh, tangents: &[[Vec4; 3]]) {
    const NONE: u32 = u32::MAX;
    let bits = |tangent: Vec4| tangent.to_array().map(f32::to_bits);
    let mut taken = vec![false; mesh.positions.len()];
    // The next copy of each vertex.
    let mut next = vec![NONE; mesh.positions.len()];
    mesh.tangents = vec![Vec4::new(0.0, 0.0, 0.0, 1.0); mesh.positions.len()];
    for (t, tangents) in tangents.iter().enumerate() {
        for (k, &tangent) in tangents.iter().enumerate() {
            let mut at = mesh.triangles[t][k] as usize;
            if !std::mem::replace(&mut taken[at], true) {
                mesh.tangents[at] = tangent;
                continue;
            }
            while bits(mesh.tangents[at]) != bits(tangent) {
                if next[at] == NONE {
                    next[at] = mesh.positions.len() as u32;
                    next.push(NONE);
                    mesh.positions.push(mesh.positions[at]);
                    mesh.normals.push(mesh.normals[at]);
                    mesh.uvs.push(mesh.uvs[at]);
                    mesh.tangents.push(tangent);
                }
                at = next[at] as usize;
            }
            mesh.triangles[t][k] = at as u32;
        }
    }
}

/// Brings tangents from a file into the form [`Mesh`] promises.
pub(super) fn tidy(mesh: &mut Mesh) {
    for (tangent, normal) in mesh.tangents.iter_mut().zip(&mesh.normals) {
        *tangent = fitted(*normal, *tangent);
    }
}

/// A tangent of unit length at right angles to the unit `normal`, w = +1 or -1; zero where it has no direction of its own.
pub(super) fn fitted(normal: Vec3, tangent: Vec4) -> Vec4 {
    let w = if tangent.w < 0.0 { -1.0 } else { 1.0 };
    match Frame::new(normal, tangent) {
        Some((frame, true)) => frame.tangent.extend(w),
        _ => Vec3::ZERO.extend(w),
    }
}
