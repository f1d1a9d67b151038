//! Triangles to fragments: which triangle each sample sees, and that triangle's attributes there. Knows no material.
//!
//! Visibility comes first and attributes are worked out only for what is seen, so hidden surfaces cost one depth test and a
//! finished [`GBuffer`] can be shaded again and again: other light, other model, another map. Coverage is decided in 24.8
//! fixed point with the top-left rule, so that two triangles that share an edge never both own a sample and never leave one
//! out; attributes come from homogeneous edge functions (Olano and Greer 1997, "Triangle scan conversion using 2D
//! homogeneous coordinates"), which need no clipping and give exact derivatives.
//!
//! The steps: [`Geometry`] once for a mesh; [`Corners`] and a [`Plan`] once for a camera; then tile by tile [`Plan::draw`],
//! whose [`Tile`] is resolved to [`Fragments`] at once, while it is in the cache, or whenever it is wanted.
//!
//! The same mesh, camera and size give the same bytes with any number of threads.

mod camera;
mod clip;
mod exact;
mod geometry;
mod resolve;
mod visibility;

pub use camera::{Camera, Projection, Rays, View};
pub use exact::Exact;
pub use geometry::Geometry;
pub use resolve::{Fragments, Lane, Lanes};
use visibility::Drawn;
pub use visibility::{Bins, Corners, Depths, Plan};

use crate::error::Result;
use crate::map::Rect;
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

/// One tile of a picture: what each of its samples sees.
#[derive(Clone, Debug)]
pub struct Tile {
    /// The samples it covers, in the whole picture's coordinates. Never larger than [`TILE`] x [`TILE`].
    pub rect: Rect,
    /// The triangle that each sample sees, in rows of [`visibility::STRIDE`]; empty where nothing is near.
    seen: Vec<u32>,
    /// The triangles that were drawn and may be seen, each once, in the mesh's order.
    drawn: Vec<Drawn>,
}

impl Default for Tile {
    /// One of no samples.
    fn default() -> Self {
        Self {
            rect: Rect {
                x: 0,
                y: 0,
                width: 0,
                height: 0,
            },
            seen: Vec::new(),
            drawn: Vec::new(),
        }
    }
}

impl Tile {
    /// The tiles of a window, row by row, which see nothing yet.
    pub fn of(window: Rect) -> Vec<Self> {
        let empty = |rect| Self {
            rect,
            seen: Vec::new(),
            drawn: Vec::new(),
        };
        window.tiles(TILE).map(empty).collect()
    }

    /// Draws into the memory of another from now on.
    pub fn take_memory(&mut self, other: Self) {
        (self.seen, self.drawn) = (other.seen, other.drawn);
    }

    /// Sees nothing from now on.
    fn clear(&mut self) {
        self.seen.clear();
        self.drawn.clear();
    }

    /// Keeps in mind only those triangles that some sample sees.
    fn forget_hidden(&mut self) {
        let mut seen: Vec<u32> = self.rows().flatten().copied().collect();
        seen.sort_unstable();
        seen.dedup();
        self.drawn
            .retain(|d| seen.binary_search(&d.triangle).is_ok());
    }

    /// Whether no triangle comes near.
    pub fn is_empty(&self) -> bool {
        self.seen.is_empty()
    }

    /// Leaves out what is seen by samples of which `is_kept` says no, by column and row in the whole picture.
    pub fn keep(&mut self, is_kept: impl Fn(u32, u32) -> bool) {
        let rect = self.rect;
        let lines = self.seen.chunks_mut(visibility::STRIDE);
        for (row, line) in (rect.y..rect.y + rect.height).zip(lines) {
            for (column, triangle) in (rect.x..rect.x + rect.width).zip(line) {
                if !is_kept(column, row) {
                    *triangle = visibility::NOTHING;
                }
            }
        }
    }

    /// How many samples see something.
    pub fn covered(&self) -> usize {
        let seen = |t: &&u32| **t != visibility::NOTHING;
        self.rows().map(|row| row.iter().filter(seen).count()).sum()
    }

    fn rows(&self) -> impl Iterator<Item = &[u32]> {
        let width = self.rect.width as usize;
        self.seen
            .chunks(visibility::STRIDE)
            .take(self.rect.height as usize)
            .map(move |row| &row[..width])
    }

    /// The attributes of what it sees, in place of what `out` held; with `changes` also how they change from sample to
    /// sample.
    ///
    /// # Panics
    /// When it was drawn with other geometry or corners.
    pub fn resolve(
        &self,
        geometry: &Geometry<'_>,
        corners: &Corners,
        changes: bool,
        out: &mut Fragments,
    ) {
        resolve::resolve(geometry, corners, self, changes, out);
    }

    /// Every sample that sees something, with its attributes in f64, in row order.
    ///
    /// # Panics
    /// When it was drawn with other geometry or another view.
    pub fn exact<'a>(
        &'a self,
        geometry: &'a Geometry<'a>,
        view: &'a View,
    ) -> impl Iterator<Item = Exact> + 'a {
        exact::samples(geometry.mesh(), view, self)
    }
}

impl PartialEq for Tile {
    /// Past the width of a tile there is rubbish.
    fn eq(&self, other: &Self) -> bool {
        self.rect == other.rect && self.rows().eq(other.rows())
    }
}

/// What every sample of a window sees, tile by tile. Six bytes a sample, so it can be kept from picture to picture.
#[derive(Clone, Debug)]
pub struct GBuffer {
    corners: Corners,
    tiles: Vec<Tile>,
}

impl GBuffer {
    /// Draws the samples of `window` of a picture of `view.size()` samples. Each sample comes out the same whatever the
    /// window.
    ///
    /// # Errors
    /// When `progress` cancels. One check per tile; no steps are counted.
    ///
    /// # Panics
    /// When the window reaches outside the picture.
    pub fn draw(
        geometry: &Geometry<'_>,
        view: &View,
        window: Rect,
        cull: Cull,
        progress: &Progress<'_>,
    ) -> Result<Self> {
        let corners = Corners::new(geometry, view);
        let mut tiles = Tile::of(window);
        let plan = Plan::new(geometry, &corners, (window, &mut tiles), cull, progress)?;
        tiles
            .par_iter_mut()
            .enumerate()
            .try_for_each_init(Depths::new, |depths, (i, tile)| {
                progress.check()?;
                plan.draw(i, tile, depths);
                Ok(())
            })?;
        Ok(Self { corners, tiles })
    }

    /// What it was drawn with.
    pub fn corners(&self) -> &Corners {
        &self.corners
    }

    /// The tiles, row by row.
    pub fn tiles(&self) -> &[Tile] {
        &self.tiles
    }
}

#[cfg(test)]
mod tests;
