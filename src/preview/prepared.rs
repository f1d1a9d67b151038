//! A subject made ready to be drawn again and again, and the drawing of its tiles.

use super::outline::{Finder, outline_scene};
use super::shade::{Desk, Lines, Shader, split};
use super::{Look, Material, Picture, Scene, Stage, Timings, sample_grid};
use crate::error::Result;
use crate::filter::Pyramid;
use crate::map::{AnisoMap, Rect, Region, Size, gathered};
use crate::mesh::{Held, Mesh};
use crate::progress::Progress;
use crate::raster::{Corners, Cull, Geometry, Plan, TILE, Tile, View};
use rayon::prelude::*;
use std::borrow::Cow;
use std::sync::Mutex;

/// Samples that are drawn at a time: bounds the memory of tiles that are drawn before they are lit.
pub(super) const BAND_SAMPLES: u64 = 1 << 24;
/// Changes of the map that are remembered; who has missed more looks at all of it again.
const CHANGES_MAX: usize = 256;

/// Mesh, map and material, with what is worked out of them once: the mesh's attributes in drawing order, the map's levels,
/// and its texels side by side.
pub struct Prepared<'a> {
    pub(super) geometry: Geometry<'a>,
    pub(super) pyramid: Pyramid<'a>,
    pub(super) material: Material,
    /// How many changes of the map there were, and where the last of them.
    revision: u64,
    changes: Vec<Rect>,
    desks: Desks,
}

impl<'a> Prepared<'a> {
    /// A map that is owned may be changed without a copy. What owns both may be kept for as long as anybody likes.
    ///
    /// # Errors
    /// When the mesh's arrays do not fit together, or the material holds numbers that are not allowed.
    pub fn new(
        mesh: impl Into<Held<'a>>,
        map: impl Into<Cow<'a, AnisoMap>>,
        material: Material,
        timings: &Timings,
    ) -> Result<Self> {
        material.check()?;
        timings.time(Stage::Prepare, || {
            Ok(Self {
                geometry: Geometry::new(mesh)?,
                pyramid: Pyramid::new(map),
                material,
                revision: 0,
                changes: Vec::new(),
                desks: Desks::default(),
            })
        })
    }

    /// The mesh.
    pub fn mesh(&self) -> &Mesh {
        self.geometry.mesh()
    }

    /// The map.
    pub fn map(&self) -> &AnisoMap {
        self.pyramid.base()
    }

    /// The colours.
    pub fn material(&self) -> &Material {
        &self.material
    }

    /// Takes other colours.
    ///
    /// # Errors
    /// When they hold numbers that are not allowed; then nothing changes.
    pub fn set_material(&mut self, material: Material) -> Result<()> {
        material.check()?;
        self.material = material;
        Ok(())
    }

    /// Changes texels of a rectangle of the map, and none outside it. A [`Frame`](super::Frame) that is drawn next lights anew only
    /// what shows them.
    ///
    /// # Panics
    /// When the rectangle reaches outside the map, or the map afterwards has another size or wrap.
    pub fn change_map(&mut self, rect: Rect, change: impl FnOnce(&mut AnisoMap)) {
        self.pyramid.change(rect, change);
        self.remember(&[rect]);
    }

    /// Writes rectangles of the map. A [`Frame`](super::Frame) that is drawn next lights anew only what shows them.
    ///
    /// # Panics
    /// When a rectangle reaches outside the map.
    pub fn write_map(&mut self, regions: &[Region]) {
        self.pyramid.write(regions);
        let rects: Vec<Rect> = regions.iter().map(Region::rect).collect();
        self.remember(&gathered(&rects));
    }

    fn remember(&mut self, changes: &[Rect]) {
        self.revision += changes.len() as u64;
        self.changes.extend_from_slice(changes);
        let over = self.changes.len().saturating_sub(CHANGES_MAX);
        self.changes.drain(..over);
    }

    /// Takes another map. Every [`Frame`](super::Frame) is lit anew.
    pub fn set_map(&mut self, pyramid: Pyramid<'a>) {
        self.pyramid = pyramid;
        self.revision += 1;
        self.changes.clear();
    }

    /// Takes another mesh. Every [`Frame`](super::Frame) is drawn anew.
    pub fn set_mesh(&mut self, geometry: Geometry<'a>) {
        self.geometry = geometry;
    }

    /// Number of changes of the map so far.
    pub(super) fn revision(&self) -> u64 {
        self.revision
    }

    /// Where the map changed since a revision; `None` when that is too long ago.
    pub(super) fn changes_since(&self, revision: u64) -> Option<&[Rect]> {
        let missed = usize::try_from(self.revision - revision).ok()?;
        self.changes.get(self.changes.len().checked_sub(missed)?..)
    }

    /// Draws one picture of `size` pixels per look: [`render`](super::render) without preparing again.
    ///
    /// # Errors
    /// As [`render`](super::render).
    pub fn render(
        &self,
        scene: &Scene,
        looks: &[Look],
        size: Size,
        timings: &Timings,
        progress: &Progress<'_>,
    ) -> Result<Vec<Picture>> {
        // Before memory is asked for.
        scene.check()?;
        sample_grid(size, scene.samples)?;
        let mut pictures = vec![Picture::new(size, [0.0; 3]); looks.len()];
        self.draw(scene, looks, &mut pictures, timings, progress)?;
        Ok(pictures)
    }

    /// Draws one picture per look into `pictures`, all from one visibility pass; what they held is gone.
    ///
    /// # Errors
    /// As [`render`](super::render).
    ///
    /// # Panics
    /// When there are not as many pictures as looks, or they are not of one size.
    pub fn draw(
        &self,
        scene: &Scene,
        looks: &[Look],
        pictures: &mut [Picture],
        timings: &Timings,
        progress: &Progress<'_>,
    ) -> Result<()> {
        assert_eq!(looks.len(), pictures.len(), "a picture for each look");
        scene.check()?;
        let Some(size) = pictures.first().map(Picture::size) else {
            return Ok(());
        };
        assert!(pictures.iter().all(|p| p.size() == size), "one size");
        let view = View::new(&scene.camera, sample_grid(size, scene.samples)?)?;
        let corners = timings.time(Stage::Vertex, || Corners::new(&self.geometry, &view));
        let shaders: Vec<_> = looks
            .iter()
            .map(|look| self.shader(scene, size, *look))
            .collect();
        let outline_scene = outline_scene(scene);
        let changes = scene.quality.needs_changes();
        let bands: Vec<Rect> = bands(view.size(), BAND_SAMPLES).collect();
        let tiles = |band: &Rect| Tile::of(*band).len() as u64;
        progress.expect(bands.iter().map(tiles).sum());
        let finder = Finder::new(scene, size);
        let mut first = 0;
        for band in bands {
            let mut tiles = Tile::of(band);
            let count = tiles.len();
            let plan = timings.time(Stage::Bin, || {
                let window = (band, &mut tiles[..]);
                Plan::new(&self.geometry, &corners, window, cull(scene), progress)
            })?;
            self.each_tile(
                band,
                &mut tiles,
                (pictures, scene.samples),
                |_| true,
                |i, tile, desk, lines| {
                    let rect = tile.rect;
                    // Nobody asks again what it saw: the thread's own tile serves.
                    let tile = if matches!(plan, Plan::Drawn) {
                        tile
                    } else {
                        desk.tile.rect = rect;
                        &mut desk.tile
                    };
                    timings.time(Stage::Raster, || plan.draw(i, tile, &mut desk.depths));
                    timings.time(Stage::Resolve, || {
                        tile.resolve(&self.geometry, &corners, changes, &mut desk.fragments);
                    });
                    if let Some(finder) = &finder {
                        finder.look(first + i, rect, scene.samples, desk);
                    }
                    for (shader, lines) in shaders.iter().zip(lines) {
                        shader.tile(rect, desk, lines, timings);
                    }
                    progress.step()
                },
            )?;
            first += count;
        }
        let outline = finder.map(|f| f.finish(&self.geometry, scene, size, timings));
        match outline.transpose()?.flatten() {
            Some(mut outline) => {
                let light = |_: usize, rect, desk: &mut Desk, lines: &mut [Lines<'_>]| {
                    for (look, lines) in looks.iter().zip(lines) {
                        let shader = self.shader(&outline_scene, size, *look);
                        shader.pixels_of_fragments(rect, desk, lines, timings);
                    }
                };
                let to = (&outline_scene, pictures);
                let watch = (timings, progress);
                outline.each(self, to, false, watch, |_| true, light)
            }
            None => Ok(()),
        }
    }

    /// Work with what a thread works in.
    pub(super) fn with_desk<T>(&self, work: impl FnOnce(&mut Desk) -> T) -> T {
        self.desks.with(work)
    }

    pub(super) fn shader<'s>(&'s self, scene: &'s Scene, size: Size, look: Look) -> Shader<'s> {
        Shader::new(&self.pyramid, &self.material, scene, size.height(), look)
    }

    /// Calls `work` for every tile of a window that is wanted with its number, and with its lines of each picture.
    pub(super) fn each_tile(
        &self,
        window: Rect,
        tiles: &mut [Tile],
        (pictures, samples): (&mut [Picture], u32),
        is_wanted: impl Fn(usize) -> bool + Sync,
        work: impl Fn(usize, &mut Tile, &mut Desk, &mut [Lines<'_>]) -> Result<()> + Sync,
    ) -> Result<()> {
        let across = window.width.div_ceil(TILE) as usize;
        let side = (TILE / samples) as usize;
        let pixels = |n: u32| (n / samples) as usize;
        let columns = pixels(window.x)..pixels(window.x + window.width);
        let rows = pixels(window.y)..pixels(window.y + window.height);
        let width = pictures.first().map_or(0, |p| p.width() as usize);
        // Rows of tiles, each with its rows of pixels in every picture.
        let mut stripes: Vec<Vec<&mut [[f32; 3]]>> =
            (0..rows.len().div_ceil(side)).map(|_| Vec::new()).collect();
        for picture in pictures {
            let pixels = &mut picture.pixels_mut()[rows.start * width..rows.end * width];
            for (stripe, rows) in stripes.iter_mut().zip(pixels.chunks_mut(side * width)) {
                stripe.push(rows);
            }
        }
        stripes
            .into_par_iter()
            .zip(tiles.par_chunks_mut(across))
            .enumerate()
            .try_for_each(|(j, (stripe, tiles))| {
                if !(j * across..j * across + tiles.len()).any(&is_wanted) {
                    return Ok(());
                }
                let mut lines: Vec<Vec<Lines<'_>>> = tiles
                    .iter()
                    .map(|_| Vec::with_capacity(stripe.len()))
                    .collect();
                for rows in stripe {
                    let split = split(rows, width, columns.clone(), side);
                    lines
                        .iter_mut()
                        .zip(split)
                        .for_each(|(tile, lines)| tile.push(lines));
                }
                lines.into_par_iter().zip(tiles).enumerate().try_for_each(
                    |(i, (mut lines, tile))| {
                        let i = j * across + i;
                        if is_wanted(i) {
                            self.desks.with(|desk| work(i, tile, desk, &mut lines))
                        } else {
                            Ok(())
                        }
                    },
                )
            })
    }
}

/// What threads work in, kept for the next picture.
#[derive(Default)]
struct Desks(Mutex<Vec<Desk>>);

impl Desks {
    fn with<T>(&self, work: impl FnOnce(&mut Desk) -> T) -> T {
        let free = || {
            self.0
                .lock()
                .unwrap_or_else(std::sync::PoisonError::into_inner)
        };
        let desk = free().pop();
        let mut desk = desk.unwrap_or_else(Desk::new);
        let done = work(&mut desk);
        free().push(desk);
        done
    }
}

/// Which triangles a scene leaves out.
pub(super) fn cull(scene: &Scene) -> Cull {
    if scene.quality.back_faces {
        Cull::None
    } else {
        Cull::Back
    }
}

/// Rows of whole tiles of about `samples` samples together.
pub(super) fn bands(size: Size, samples: u64) -> impl Iterator<Item = Rect> {
    let tile_row = u64::from(size.width()) * u64::from(TILE);
    let rows = (samples / tile_row).max(1) as u32 * TILE;
    (0..size.height().div_ceil(rows)).map(move |i| Rect {
        x: 0,
        y: i * rows,
        width: size.width(),
        height: rows.min(size.height() - i * rows),
    })
}
