//! Triangles to fragments: which triangle each sample sees, and that triangle's attributes there. Knows no material.
//!
//! Visibility comes first and attributes are worked out only for what is seen, so hidden surfaces cost one depth test and a
//! finished [`GBuffer`] can be shaded again and again: other light, other model, another map. Coverage is decided in 24.8
//! fixed point with the top-left rule, so that two triangles that share an edge never both own a sample and never leave one
//! out; attributes come from homogeneous edge functions (Olano and Greer 1997, "Triangle scan conversion using 2D
//! homogeneous coordinates"), which need no clipping and give exact derivatives.
//!
//! The same mesh, camera and size give the same bytes with any number of threads.

mod camera;
mod clip;
mod exact;
mod resolve;
mod visibility;

pub use camera::{Camera, Projection, View};
pub use exact::Exact;
pub use resolve::Fragments;

use crate::error::{Error, Result};
use crate::map::Rect;
use crate::mesh::Mesh;
use crate::progress::Progress;
use rayon::prelude::*;

/// Samples along a tile's side: a multiple of every supersampling factor from 1 to 4, so that a tile holds whole pixels.
pub const TILE: u32 = 48;

/// Which triangles are left out.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Cull {
    /// None: open surfaces are seen from both sides.
    #[default]
    None,
    /// Those that wind clockwise as seen from the eye.
    Back,
}

/// What every sample of a window sees, tile by tile: a triangle or nothing, from which [`GBuffer::resolve`] works out the
/// attributes. Four bytes a sample, so it can be kept from picture to picture.
#[derive(Clone, Debug, PartialEq)]
pub struct GBuffer {
    view: View,
    window: Rect,
    vertices: resolve::Vertices,
    tiles: Vec<Tile>,
}

/// One tile of a [`GBuffer`].
#[derive(Clone, Debug)]
pub struct Tile {
    /// The samples it covers, in the whole picture's coordinates. Never larger than [`TILE`] x [`TILE`].
    pub rect: Rect,
    /// The triangle that each sample sees, in rows of [`visibility::STRIDE`]; empty where nothing is near.
    seen: Vec<u32>,
}

impl Tile {
    /// Whether no triangle comes near.
    pub fn is_empty(&self) -> bool {
        self.seen.is_empty()
    }

    fn rows(&self) -> impl Iterator<Item = &[u32]> {
        let width = self.rect.width as usize;
        self.seen
            .chunks(visibility::STRIDE)
            .map(move |row| &row[..width])
    }
}

impl PartialEq for Tile {
    /// Past the width of a tile there is rubbish.
    fn eq(&self, other: &Self) -> bool {
        self.rect == other.rect && self.rows().eq(other.rows())
    }
}

impl GBuffer {
    /// Draws the samples of `window` of a picture of `view.size()` samples. Each sample comes out the same whatever the
    /// window.
    ///
    /// # Errors
    /// When the mesh's arrays do not fit together, or `progress` cancels. One check per 131072 triangles; no steps are
    /// counted.
    ///
    /// # Panics
    /// When the window reaches outside the picture.
    pub fn draw(
        mesh: &Mesh,
        view: &View,
        window: Rect,
        cull: Cull,
        progress: &Progress<'_>,
    ) -> Result<Self> {
        assert!(
            window.intersection(view.size().rect()) == Some(window),
            "a window inside the picture"
        );
        check(mesh)?;
        let vertices = vertices(mesh, view);
        let tiles = visibility::draw(mesh, &vertices.projected, view, window, cull, progress)?;
        Ok(Self {
            view: *view,
            window,
            vertices,
            tiles: tiles
                .into_iter()
                .map(|seen| Tile {
                    rect: seen.rect,
                    seen: seen.triangle,
                })
                .collect(),
        })
    }

    /// The samples that were drawn.
    pub fn window(&self) -> Rect {
        self.window
    }

    /// The tiles, row by row.
    pub fn tiles(&self) -> &[Tile] {
        &self.tiles
    }

    /// The attributes of what a tile sees, in place of what `out` held; with `changes` also how they change from sample to
    /// sample.
    ///
    /// # Panics
    /// When `mesh` is not the one that was drawn, or there are fewer tiles.
    pub fn resolve(&self, mesh: &Mesh, tile: usize, changes: bool, out: &mut Fragments) {
        let tile = &self.tiles[tile];
        let seen = (tile.rect, &tile.seen[..]);
        resolve::resolve(mesh, &self.vertices, &self.view, seen, changes, out);
    }

    /// Every sample of a tile that sees something, with its attributes in f64, in row order.
    ///
    /// # Panics
    /// When `mesh` is not the one that was drawn, or there are fewer tiles.
    pub fn exact<'a>(&'a self, mesh: &'a Mesh, tile: usize) -> impl Iterator<Item = Exact> + 'a {
        exact::samples(mesh, &self.vertices, &self.view, &self.tiles[tile])
    }
}

fn vertices(mesh: &Mesh, view: &View) -> resolve::Vertices {
    let all = || (0..mesh.positions.len()).into_par_iter().with_min_len(2048);
    let projected: Vec<_> = all().map(|i| view.project(mesh.positions[i])).collect();
    resolve::Vertices {
        seen: all().map(|i| resolve::Place::new(projected[i])).collect(),
        rows: all().map(|i| resolve::Row::new(mesh, i)).collect(),
        projected,
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

#[cfg(test)]
mod tests;
