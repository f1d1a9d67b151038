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
mod resolve;
mod visibility;

pub use camera::{Camera, Projection, View};
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

/// What every sample of a window sees, tile by tile.
#[derive(Clone, Debug, PartialEq)]
pub struct GBuffer {
    window: Rect,
    tiles: Vec<Tile>,
}

/// One tile of a [`GBuffer`].
#[derive(Clone, Debug, PartialEq)]
pub struct Tile {
    /// The samples it covers, in the whole picture's coordinates. Never larger than [`TILE`] x [`TILE`].
    pub rect: Rect,
    /// What is seen there; samples that see nothing have no fragment.
    pub fragments: Fragments,
}

impl GBuffer {
    /// Draws the samples of `window` of a picture of `view.size()` samples. Each sample comes out the same whatever the
    /// window.
    ///
    /// # Errors
    /// When the mesh's arrays do not fit together, or `progress` cancels. One check per 32768 triangles; no steps are
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
        let visibility = visibility::draw(mesh, view, window, cull, progress)?;
        let tiles = visibility
            .par_iter()
            .map(|seen| Tile {
                rect: seen.rect,
                fragments: resolve::resolve(mesh, view, seen),
            })
            .collect();
        Ok(Self { window, tiles })
    }

    /// The samples that were drawn.
    pub fn window(&self) -> Rect {
        self.window
    }

    /// The tiles, row by row.
    pub fn tiles(&self) -> &[Tile] {
        &self.tiles
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
