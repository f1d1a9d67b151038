//! Where a place of the map is on the mesh, for the cursor that both pictures share.

use super::{Show, Studio};
use crate::map::Wrap;
use crate::mesh::Mesh;
use crate::raster::View;
use glam::{Vec2, Vec3};
use rayon::prelude::*;

/// A mesh of more triangles is not searched: nobody waits for a cursor.
const TRIANGLES_MAX: usize = 200_000;
/// A layout that lies on itself shows a place several times; so many are told.
const PLACES_MAX: usize = 8;

impl Studio {
    /// Where a place of the map (UV, 0 to 1) is seen in the 3D picture, in pixels from its upper left corner: in each of two
    /// pictures side by side, and several times where the layout lies on itself. Empty where it is hidden, or the mesh is too
    /// large to be searched in passing.
    pub fn seen_at(&self, uv: Vec2) -> Vec<Vec2> {
        let mesh = self.subject().mesh();
        if mesh.triangles.len() > TRIANGLES_MAX || !uv.is_finite() {
            return Vec::new();
        }
        let (_, panel) = self.viewport().in_panel(Vec2::ZERO);
        let Ok(view) = View::new(&self.scene().camera, panel) else {
            return Vec::new();
        };
        let seen = |position: &Vec3| {
            let place = view.place(*position)?;
            let hit = self.pick(place)?;
            let near = 3.0 * hit.pixel;
            (hit.position.distance(*position) <= near).then_some(place)
        };
        let wrap = self.recipe().wrap;
        let places: Vec<Vec2> = positions(mesh, uv, wrap).iter().filter_map(seen).collect();
        match self.viewport().show() {
            Show::Pair(..) => {
                let beside = Vec2::new(panel.width() as f32, 0.0);
                places.iter().flat_map(|p| [*p, *p + beside]).collect()
            }
            _ => places,
        }
    }
}

/// The places of a mesh that show a place of the map, of those that are one on the surface the first.
fn positions(mesh: &Mesh, uv: Vec2, wrap: Wrap) -> Vec<Vec3> {
    let found: Vec<Vec3> = mesh
        .triangles
        .par_iter()
        .with_min_len(8192)
        .filter_map(|triangle| {
            let corners = triangle.map(|i| i as usize);
            let weights = within(corners.map(|i| mesh.uvs[i]), uv, wrap)?;
            let at = corners.iter().zip(weights);
            Some(at.map(|(i, w)| mesh.positions[*i] * w).sum())
        })
        .collect();
    let mut apart: Vec<Vec3> = Vec::new();
    for place in found {
        let same = |other: &Vec3| other.distance(place) < 1e-5 * (1.0 + place.length());
        if apart.len() < PLACES_MAX && !apart.iter().any(same) {
            apart.push(place);
        }
    }
    apart
}

/// The weights of a triangle's corners at a place of the map, in whichever turn of it the triangle lies; along a side that does
/// not repeat there is only the one.
fn within(corners: [Vec2; 3], uv: Vec2, wrap: Wrap) -> Option<[f32; 3]> {
    let [a, b, c] = corners;
    let (low, high) = (a.min(b).min(c), a.max(b).max(c));
    let turns = |low: f32, high: f32, repeats: bool| {
        let (first, last) = (low.ceil(), high.floor());
        if repeats {
            (first, last)
        } else {
            (first.max(0.0), last.min(0.0))
        }
    };
    let (low, high) = (low - uv, high - uv);
    let across = turns(low.x, high.x, wrap.repeats_u());
    let up = turns(low.y, high.y, wrap.repeats_v());
    let (first, last) = (Vec2::new(across.0, up.0), Vec2::new(across.1, up.1));
    if first.x > last.x || first.y > last.y {
        return None;
    }
    let area = (b - a).perp_dot(c - a);
    if area == 0.0 || !area.is_finite() {
        return None;
    }
    let p = uv + first;
    let weights = [(b, c), (c, a), (a, b)].map(|(from, to)| (to - from).perp_dot(p - from) / area);
    weights.iter().all(|w| *w >= -1e-5).then_some(weights)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh;

    #[test]
    fn a_place_of_the_map_is_found_where_the_mesh_shows_it() {
        let torus = mesh::builtin("torus").unwrap();
        for (i, triangle) in torus.triangles.iter().enumerate().step_by(997) {
            let corners = triangle.map(|i| i as usize);
            let middle =
                |of: &dyn Fn(usize) -> Vec3| corners.iter().map(|i| of(*i)).sum::<Vec3>() / 3.0;
            let uv = middle(&|i| torus.uvs[i].extend(0.0)).truncate();
            let wanted = middle(&|i| torus.positions[i]);
            let found = positions(&torus, uv - uv.floor(), Wrap::Repeat);
            let near = found.iter().any(|p| p.distance(wanted) < 1e-3);
            assert!(near, "triangle {i}: {found:?}, and not {wanted}");
        }
        assert!(positions(&torus, Vec2::NAN, Wrap::Repeat).is_empty());
    }

    #[test]
    fn other_turns_count_only_along_sides_that_repeat() {
        let mut plane = mesh::builtin("plane").unwrap();
        let uv = Vec2::new(0.3, 0.4);
        let places = |mesh: &Mesh| {
            let wraps = [Wrap::Repeat, Wrap::RepeatU, Wrap::Clamp];
            wraps.map(|wrap| positions(mesh, uv, wrap).len())
        };
        let moved = |mesh: &mut Mesh, by: Vec2| mesh.uvs.iter_mut().for_each(|uv| *uv += by);
        assert_eq!(places(&plane), [1, 1, 1]);
        moved(&mut plane, Vec2::X);
        assert_eq!(places(&plane), [1, 1, 0]);
        moved(&mut plane, -2.0 * Vec2::ONE);
        assert_eq!(places(&plane), [1, 0, 0]);
    }
}
