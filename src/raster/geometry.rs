//! A mesh made ready to be drawn again and again: what does not depend on the camera.

use crate::error::{Error, Result};
use crate::mesh::{Held, Mesh};
use fearless_simd::prelude::*;
use fearless_simd::{Simd, f32x8};
use glam::Vec3;
use rayon::prelude::*;
use std::sync::atomic::{AtomicU64, Ordering};

/// A mesh with its attributes in the order in which they are interpolated.
#[derive(Debug)]
pub struct Geometry<'a> {
    mesh: Held<'a>,
    id: u64,
    pub(super) rows: Vec<Row>,
    /// What is known of each triangle.
    pub(super) kinds: Vec<Kind>,
}

impl<'a> Geometry<'a> {
    /// Checks that the mesh's arrays fit together, so that drawing need not.
    ///
    /// # Errors
    /// When there are not as many normals, tangents and uvs as positions, or a triangle names a vertex that is not there.
    pub fn new(mesh: impl Into<Held<'a>>) -> Result<Self> {
        let mesh = mesh.into();
        check(&mesh)?;
        let vertices = (0..mesh.positions.len()).into_par_iter().with_min_len(4096);
        let triangles = mesh.triangles.par_iter().with_min_len(4096);
        static NEXT: AtomicU64 = AtomicU64::new(0);
        Ok(Self {
            id: NEXT.fetch_add(1, Ordering::Relaxed),
            rows: vertices.map(|i| Row::new(&mesh, i)).collect(),
            kinds: triangles.map(|t| Kind::of(&mesh, *t)).collect(),
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

/// A normal this short has lost its direction to the cancelling of its corners' normals.
pub(super) const LEAST_NORMAL: f32 = 1e-10;

/// What is known of a triangle before it is looked at.
#[derive(Clone, Copy, Debug)]
pub(super) struct Kind {
    /// Whether it winds counter-clockwise as seen from the side that its normals call outside.
    pub(super) as_wound: bool,
    /// Whether the normal keeps its direction wherever on it.
    pub(super) steady: bool,
    /// Whether its layout is as it would be on paper, not mirrored.
    pub(super) right_handed: bool,
}

impl Kind {
    fn of(mesh: &Mesh, triangle: [u32; 3]) -> Self {
        let n = triangle.map(|i| mesh.normals[i as usize]);
        let sum = n[0] + n[1] + n[2];
        // No weighted mean comes near zero where all are within a right angle of the sum. NaN fails these, and what overflows.
        let along = |n: Vec3| n.dot(sum) > LEAST_NORMAL && n.length_squared() < 1e30;
        let w = mesh.tangents[triangle[0] as usize].w;
        Self {
            as_wound: outward(mesh, triangle).as_wound,
            steady: n.into_iter().all(along),
            right_handed: w >= 0.0,
        }
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

    /// A weighted sum.
    #[inline(always)]
    pub(super) fn mix<S: Simd>(simd: S, rows: [&Self; 3], weights: [f32; 3]) -> Self {
        let [a, b, c] = rows;
        let mut row = [0.0; 8];
        (a.times(simd, weights[0]) + b.times(simd, weights[1]) + c.times(simd, weights[2]))
            .store_slice(&mut row);
        Self(row)
    }

    #[inline(always)]
    fn times<S: Simd>(&self, simd: S, weight: f32) -> f32x8<S> {
        f32x8::from_slice(simd, &self.0) * weight
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
