//! A mesh made ready to be drawn again and again: what does not depend on the camera.

use crate::error::{Error, Result};
use crate::mesh::Mesh;
use fearless_simd::prelude::*;
use fearless_simd::{Simd, f32x8};
use glam::Vec3;
use rayon::prelude::*;
use std::borrow::Cow;
use std::sync::atomic::{AtomicU64, Ordering};

/// A mesh with its attributes in the order in which they are interpolated.
#[derive(Debug)]
pub struct Geometry<'a> {
    mesh: Cow<'a, Mesh>,
    id: u64,
    pub(super) rows: Vec<Row>,
    /// Whether each triangle winds counter-clockwise as seen from the side that its normals call outside.
    pub(super) as_wound: Vec<bool>,
}

impl<'a> Geometry<'a> {
    /// Checks that the mesh's arrays fit together, so that drawing need not.
    ///
    /// # Errors
    /// When there are not as many normals, tangents and uvs as positions, or a triangle names a vertex that is not there.
    pub fn new(mesh: impl Into<Cow<'a, Mesh>>) -> Result<Self> {
        let mesh = mesh.into();
        check(&mesh)?;
        let vertices = (0..mesh.positions.len()).into_par_iter().with_min_len(4096);
        let triangles = mesh.triangles.par_iter().with_min_len(4096);
        static NEXT: AtomicU64 = AtomicU64::new(0);
        Ok(Self {
            id: NEXT.fetch_add(1, Ordering::Relaxed),
            rows: vertices.map(|i| Row::new(&mesh, i)).collect(),
            as_wound: triangles.map(|t| outward(&mesh, *t).as_wound).collect(),
            mesh,
        })
    }

    /// A number that no other geometry of this process has.
    pub fn id(&self) -> u64 {
        self.id
    }

    /// The mesh.
    pub fn mesh(&self) -> &Mesh {
        &self.mesh
    }
}

fn check(mesh: &Mesh) -> Result<()> {
    let n = mesh.positions.len();
    let others = [mesh.normals.len(), mesh.tangents.len(), mesh.uvs.len()];
    if others.iter().any(|&m| m != n) {
        let allowed = "allowed: as many normals, tangents and uvs as positions";
        return Err(Error::invalid(format!("mesh `{}`", mesh.name), n, allowed));
    }
    let outside = |t: &&[u32; 3]| t.iter().any(|&i| i as usize >= n);
    match mesh.triangles.iter().find(outside) {
        Some(t) => Err(Error::invalid(
            format!("a triangle of mesh `{}`", mesh.name),
            format!("{t:?}"),
            format!("allowed: vertex indices below {n}"),
        )),
        None => Ok(()),
    }
}

/// What is interpolated over a triangle: normal, u, tangent, v.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Row(pub(super) [f32; 8]);

impl Row {
    fn new(mesh: &Mesh, vertex: usize) -> Self {
        let (n, t, uv) = (
            mesh.normals[vertex],
            mesh.tangents[vertex],
            mesh.uvs[vertex],
        );
        Self([n.x, n.y, n.z, uv.x, t.x, t.y, t.z, uv.y])
    }

    pub(super) fn normal(&self) -> Vec3 {
        Vec3::new(self.0[0], self.0[1], self.0[2])
    }

    /// A weighted sum.
    #[inline(always)]
    pub(super) fn mix<S: Simd>(simd: S, rows: [&Self; 3], weights: [f64; 3]) -> Self {
        let [a, b, c] = rows;
        let mut row = [0.0; 8];
        (a.times(simd, weights[0]) + b.times(simd, weights[1]) + c.times(simd, weights[2]))
            .store_slice(&mut row);
        Self(row)
    }

    #[inline(always)]
    fn times<S: Simd>(&self, simd: S, weight: f64) -> f32x8<S> {
        f32x8::from_slice(simd, &self.0) * weight as f32
    }
}

/// The side of a triangle that the vertex normals call outside.
pub(super) struct Outward {
    /// Of any length; zero for a triangle without area.
    pub(super) normal: Vec3,
    /// Whether the triangle winds counter-clockwise seen from there.
    pub(super) as_wound: bool,
}

pub(super) fn outward(mesh: &Mesh, triangle: [u32; 3]) -> Outward {
    let [a, b, c] = triangle.map(|i| mesh.positions[i as usize]);
    let normals: Vec3 = triangle.map(|i| mesh.normals[i as usize]).into_iter().sum();
    let face = (b - a).cross(c - a);
    let as_wound = face.dot(normals) >= 0.0;
    Outward {
        normal: if as_wound { face } else { -face },
        as_wound,
    }
}
