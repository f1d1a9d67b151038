//! The connected pieces of a layout, and which of them are mirrored.

use super::{Mesh, derivatives};
use glam::{Vec2, Vec3};
use rayon::prelude::*;
use std::collections::HashMap;

/// The islands of a mesh's layout.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Islands {
    /// For each triangle the number of its island; numbered from 0 in the order of their first triangles.
    pub of_triangle: Vec<u32>,
    /// For each island whether its layout is mirrored: its triangles wind clockwise in UV. Islands whose triangles span no
    /// area in UV count as unmirrored.
    pub mirrored: Vec<bool>,
}

/// A place on the surface and in the layout at once; vertices that differ only in normal or tangent share it.
type Place = [u32; 5];

impl Mesh {
    /// Finds the islands: triangles are connected where they share an edge, in position and in UV, and wind the same way in
    /// UV. A mirrored half that is joined to its twin in UV is therefore an island of its own.
    pub fn islands(&self) -> Islands {
        let mirrored: Vec<bool> = self
            .triangles
            .iter()
            .map(|t| self.is_mirrored(*t))
            .collect();
        let places = self.places();
        let mut parents: Vec<u32> = (0..self.triangles.len() as u32).collect();
        let mut edges: HashMap<(u32, u32, bool), u32> = HashMap::new();
        for (i, triangle) in self.triangles.iter().enumerate() {
            for k in 0..3 {
                let a = places[triangle[k] as usize];
                let b = places[triangle[(k + 1) % 3] as usize];
                let other = *edges
                    .entry((a.min(b), a.max(b), mirrored[i]))
                    .or_insert(i as u32);
                let (a, b) = (root(&mut parents, i as u32), root(&mut parents, other));
                // The smaller number stays the root, so that islands count in the order of their first triangles.
                parents[a.max(b) as usize] = a.min(b);
            }
        }
        number(&mut parents, &mirrored)
    }

    /// The edges at which islands end, in UV: those that one triangle alone has among the triangles that wind as it does.
    pub fn chart_borders(&self) -> Vec<[Vec2; 2]> {
        let places = self.places();
        let edges_of = |t: &[u32; 3]| {
            let mirrored = u64::from(self.is_mirrored(*t));
            let [a, b, c] = t.map(|i| u64::from(places[i as usize]));
            // Places are fewer than 2^31, as vertices are: one bit is left for the winding.
            let key = |a: u64, b: u64| (a.min(b) << 32 | a.max(b)) << 1 | mirrored;
            [key(a, b), key(b, c), key(c, a)]
        };
        let mut edges: Vec<u64> = self.triangles.par_iter().flat_map_iter(edges_of).collect();
        edges.par_sort_unstable();
        let mut uv_of = vec![Vec2::ZERO; places.len()];
        for (place, uv) in places.iter().zip(&self.uvs) {
            uv_of[*place as usize] = *uv;
        }
        let alone = edges.chunk_by(|a, b| a == b).filter(|e| e.len() == 1);
        alone
            .map(|e| [e[0] >> 33, e[0] >> 1 & 0xffff_ffff].map(|place| uv_of[place as usize]))
            .filter(|[a, b]| a != b)
            .collect()
    }

    /// How many triangles have corners whose tangent's w contradicts the winding of the layout. Such triangles are lit with
    /// directions mirrored: 0 in a good mesh.
    pub fn handedness_conflicts(&self) -> usize {
        let conflicts = |t: &&[u32; 3]| {
            let expected = if self.is_mirrored(**t) { -1.0 } else { 1.0 };
            derivatives(self.corners(**t), self.corner_uvs(**t)).is_some()
                && t.iter().any(|i| {
                    let tangent = self.tangents[*i as usize];
                    tangent.truncate() != Vec3::ZERO && tangent.w != expected
                })
        };
        self.triangles.iter().filter(conflicts).count()
    }

    fn is_mirrored(&self, triangle: [u32; 3]) -> bool {
        let [a, b, c] = self.corner_uvs(triangle);
        (b - a).perp_dot(c - a) < 0.0
    }

    /// For each vertex the number of its place.
    fn places(&self) -> Vec<u32> {
        let mut numbers: HashMap<Place, u32> = HashMap::new();
        let mut place = |i: usize| {
            let (p, uv) = (self.positions[i], self.uvs[i]);
            // Adding 0 makes -0 and 0 one place.
            let key = [p.x, p.y, p.z, uv.x, uv.y].map(|x| (x + 0.0).to_bits());
            let next = numbers.len() as u32;
            *numbers.entry(key).or_insert(next)
        };
        (0..self.positions.len()).map(&mut place).collect()
    }
}

/// The root of a triangle's tree, halving the path on the way.
fn root(parents: &mut [u32], mut i: u32) -> u32 {
    while parents[i as usize] != i {
        parents[i as usize] = parents[parents[i as usize] as usize];
        i = parents[i as usize];
    }
    i
}

fn number(parents: &mut [u32], triangle_mirrored: &[bool]) -> Islands {
    let mut islands = Islands {
        of_triangle: Vec::with_capacity(parents.len()),
        mirrored: Vec::new(),
    };
    for (i, mirrored) in triangle_mirrored.iter().enumerate() {
        let first = root(parents, i as u32) as usize;
        let id = if first == i {
            islands.mirrored.push(*mirrored);
            islands.mirrored.len() as u32 - 1
        } else {
            islands.of_triangle[first]
        };
        islands.of_triangle.push(id);
    }
    islands
}
