//! Pixels in which a surface ends, breaks off or turns sharply: there it is samples that count, not filters.
//!
//! Neighbouring samples that do not lie in each other's plane, or whose normals stand at an angle, mark their pixels. What is
//! marked depends on mesh, camera and number of samples alone, never on light or map. Marked pixels are drawn again with
//! [`SAMPLES_MAX`] x [`SAMPLES_MAX`] samples, in tiles of which most pictures want few. What no sample sees, such as a wire
//! between two of them, is not found.

use super::prepared::{Prepared, cull};
use super::shade::{Desk, Lines};
use super::{Picture, SAMPLES_MAX, Scene, Stage, Timings, sample_grid};
use crate::error::Result;
use crate::map::{Rect, Size};
use crate::math;
use crate::progress::Progress;
use crate::raster::{Bins, Corners, Fragments, Geometry, TILE, Tile, View};
use fearless_simd::{Simd, dispatch};
use fearless_simd_macros::simd;
use rayon::prelude::*;
use std::sync::OnceLock;

const SIDE: usize = TILE as usize;
/// Pixels along the side of a tile of marked ones.
const PIXELS: u32 = TILE / SAMPLES_MAX;
/// Pictures of more samples are drawn without: the borders of tiles take two bytes a sample until all tiles are seen.
const SAMPLES_MOST: u64 = 1 << 26;
/// Neighbours are broken off where one lies out of the other's plane by the square of this sine, 17 degrees: half of that is left
/// for interpolated normals, which stand aslant on the facets of coarse meshes. Measured on pots at 128 pixels: 11 degrees
/// mark no pixel that counts, with 29 the error grows by a fifth.
const APART: f32 = 0.087_33;
/// The cosine of the turn from sample to sample that is too sharp, 14 degrees. At 9 degrees pictures are no better; at 23 their
/// error grows by 3 %.
const TURNED: f32 = 0.968_9;
/// A tile that nobody wants.
const UNWANTED: u32 = u32::MAX;

/// What a sample sees: its place, and the unit normal of the side that is seen; 0 where nothing is.
#[derive(Clone, Copy)]
struct Seen {
    position: [f32; 3],
    normal: [f32; 3],
}

impl Seen {
    const NOTHING: Self = Self {
        position: [0.0; 3],
        normal: [0.0; 3],
    };
}

#[inline(always)]
fn dot(a: [f32; 3], b: [f32; 3]) -> f32 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// Whether the surface breaks between two neighbours.
#[inline(always)]
fn breaks(a: Seen, b: Seen) -> bool {
    let d = [
        b.position[0] - a.position[0],
        b.position[1] - a.position[1],
        b.position[2] - a.position[2],
    ];
    let (out, back) = (dot(d, a.normal), dot(d, b.normal));
    let most = APART * dot(d, d);
    let broken = (out * out > most) | (back * back > most) | (dot(a.normal, b.normal) < TURNED);
    let (is_a, is_b) = (dot(a.normal, a.normal) > 0.5, dot(b.normal, b.normal) > 0.5);
    (is_a != is_b) | (is_a & is_b & broken)
}

/// What the samples of a tile see, in rows of [`SIDE`].
pub(super) struct Field {
    position: [[f32; SIDE * SIDE]; 3],
    normal: [[f32; SIDE * SIDE]; 3],
    /// Whether the surface breaks between a sample and the next.
    breaks: [u8; SIDE * SIDE],
}

impl Field {
    pub(super) fn new() -> Self {
        const ZERO: [f32; SIDE * SIDE] = [0.0; SIDE * SIDE];
        Self {
            position: [ZERO; 3],
            normal: [ZERO; 3],
            breaks: [0; SIDE * SIDE],
        }
    }

    fn at(&self, column: usize, row: usize) -> Seen {
        let i = row * SIDE + column;
        Seen {
            position: self.position.each_ref().map(|c| c[i]),
            normal: self.normal.each_ref().map(|c| c[i]),
        }
    }
}

#[simd]
fn spread<S: Simd>(_: S, fragments: &Fragments, rect: Rect, field: &mut Field) {
    let (lanes, rays) = (fragments.lanes(), fragments.rays());
    let (left, top) = (rect.x as f32, rect.y as f32);
    for c in &mut field.normal {
        c.fill(0.0);
    }
    for i in 0..fragments.len() {
        let n = [0, 1, 2].map(|c: usize| lanes.normal[c][i]);
        let inverse = lanes.facing[i] / dot(n, n).sqrt();
        let p = rays.position(lanes.column[i], lanes.row[i], rays.distance(lanes.q[i]));
        let place = (lanes.row[i] - top) as usize * SIDE + (lanes.column[i] - left) as usize;
        field.position[0][place] = p.x;
        field.position[1][place] = p.y;
        field.position[2][place] = p.z;
        field.normal[0][place] = n[0] * inverse;
        field.normal[1][place] = n[1] * inverse;
        field.normal[2][place] = n[2] * inverse;
    }
}

/// Between each sample and the one `step` places on.
#[simd]
fn find_breaks<S: Simd>(_: S, field: &mut Field, step: usize) {
    let n = SIDE * SIDE - step;
    let [px, py, pz] = field
        .position
        .each_ref()
        .map(|c| (&c[..n], &c[step..][..n]));
    let [nx, ny, nz] = field.normal.each_ref().map(|c| (&c[..n], &c[step..][..n]));
    let out = &mut field.breaks[..n];
    for i in 0..n {
        let a = Seen {
            position: [px.0[i], py.0[i], pz.0[i]],
            normal: [nx.0[i], ny.0[i], nz.0[i]],
        };
        let b = Seen {
            position: [px.1[i], py.1[i], pz.1[i]],
            normal: [nx.1[i], ny.1[i], nz.1[i]],
        };
        out[i] = u8::from(breaks(a, b));
    }
}

/// What a tile marks by itself, and what its neighbours are to be compared with.
pub(super) struct Relief {
    /// A bit for each marked pixel, row by row.
    marked: [u64; SIDE],
    /// What its first and last column and its first and last row see; nothing in a tile that sees nothing.
    borders: Option<Box<[[Seen; SIDE]; 4]>>,
}

impl Relief {
    /// Of a tile's fragments.
    pub(super) fn new(fragments: &Fragments, rect: Rect, samples: u32, field: &mut Field) -> Self {
        let mut marked = [0; SIDE];
        if fragments.is_empty() {
            return Self {
                marked,
                borders: None,
            };
        }
        let (width, height) = (rect.width as usize, rect.height as usize);
        let samples = samples as usize;
        let level = math::level();
        dispatch!(level, simd => spread(simd, fragments, rect, field));
        for (dx, dy) in [(1, 0), (0, 1)] {
            dispatch!(level, simd => find_breaks(simd, field, dy * SIDE + dx));
            for y in 0..height - dy {
                let row = &field.breaks[y * SIDE..][..width - dx];
                if row.iter().all(|b| *b == 0) {
                    continue;
                }
                for (x, _) in row.iter().enumerate().filter(|(_, b)| **b != 0) {
                    marked[y / samples] |= 1 << (x / samples);
                    marked[(y + dy) / samples] |= 1 << ((x + dx) / samples);
                }
            }
        }
        let mut borders = Box::new([[Seen::NOTHING; SIDE]; 4]);
        for i in 0..height {
            borders[0][i] = field.at(0, i);
            borders[1][i] = field.at(width - 1, i);
        }
        for i in 0..width {
            borders[2][i] = field.at(i, 0);
            borders[3][i] = field.at(i, height - 1);
        }
        Self {
            marked,
            borders: Some(borders),
        }
    }

    /// Where the surface breaks between a border of this tile and the one of the next tile that it touches.
    fn breaks_toward(&self, next: &Self, sides: (usize, usize)) -> impl Iterator<Item = usize> {
        const NOTHING: [Seen; SIDE] = [Seen::NOTHING; SIDE];
        let border = |relief: &Self, side: usize| match &relief.borders {
            Some(borders) => borders[side],
            None => NOTHING,
        };
        let any = self.borders.is_some() || next.borders.is_some();
        let (a, b) = (border(self, sides.0), border(next, sides.1));
        (0..if any { SIDE } else { 0 }).filter(move |k| breaks(a[*k], b[*k]))
    }
}

/// The marked pixels of a picture.
pub(super) struct Marks {
    width: usize,
    pixels: Vec<bool>,
    /// Tiles of marked pixels in a row.
    across: usize,
    /// The number of each tile among those that are wanted, and those.
    tiles: Vec<u32>,
    wanted: Vec<usize>,
}

impl Marks {
    /// Of a picture of `size` pixels whose tiles of samples these are, row by row.
    fn new(size: Size, samples: u32, reliefs: &[Relief]) -> Self {
        let across = size.width().div_ceil(PIXELS) as usize;
        let down = size.height().div_ceil(PIXELS) as usize;
        let mut marks = Self {
            width: size.width() as usize,
            pixels: vec![false; size.texels()],
            across,
            tiles: vec![UNWANTED; across * down],
            wanted: Vec::new(),
        };
        let side = SIDE / samples as usize;
        let columns = size.width().div_ceil(side as u32) as usize;
        for (i, relief) in reliefs.iter().enumerate() {
            let (x, y) = (i % columns * side, i / columns * side);
            for (row, marked) in relief.marked.iter().enumerate() {
                let mut marked = *marked;
                while marked != 0 {
                    marks.add(x + marked.trailing_zeros() as usize, y + row);
                    marked &= marked - 1;
                }
            }
            let samples = samples as usize;
            if (i + 1) % columns != 0 {
                for k in relief.breaks_toward(&reliefs[i + 1], (1, 0)) {
                    marks.add(x + side - 1, y + k / samples);
                    marks.add(x + side, y + k / samples);
                }
            }
            if let Some(below) = reliefs.get(i + columns) {
                for k in relief.breaks_toward(below, (3, 2)) {
                    marks.add(x + k / samples, y + side - 1);
                    marks.add(x + k / samples, y + side);
                }
            }
        }
        marks
    }

    fn add(&mut self, x: usize, y: usize) {
        self.pixels[y * self.width + x] = true;
        let tile = y / PIXELS as usize * self.across + x / PIXELS as usize;
        if self.tiles[tile] == UNWANTED {
            self.tiles[tile] = self.wanted.len() as u32;
            self.wanted.push(tile);
        }
    }

    /// Whether a sample of the marked pixels' grid lies in one.
    fn holds(&self, column: u32, row: u32) -> bool {
        self.pixels[(row / SAMPLES_MAX) as usize * self.width + (column / SAMPLES_MAX) as usize]
    }
}

/// The scene that marked pixels are drawn in.
pub(super) fn outline_scene(scene: &Scene) -> Scene {
    Scene {
        samples: SAMPLES_MAX,
        ..scene.clone()
    }
}

/// The marks of a picture while its tiles are drawn.
pub(super) struct Finder(Vec<OnceLock<Relief>>);

impl Finder {
    /// For a picture of `size` pixels; `None` where no marked pixels are wanted.
    pub(super) fn new(scene: &Scene, size: Size) -> Option<Self> {
        let grid = sample_grid(size, scene.samples).ok()?;
        let wanted = scene.quality.outlines
            && scene.samples < SAMPLES_MAX
            && grid.texels() as u64 <= SAMPLES_MOST
            && sample_grid(size, SAMPLES_MAX).is_ok();
        let tiles = |n: u32| n.div_ceil(TILE) as usize;
        let empty = || {
            let all = 0..tiles(grid.width()) * tiles(grid.height());
            Self(all.map(|_| OnceLock::new()).collect())
        };
        wanted.then(empty)
    }

    /// Looks at tile number `i`, whose fragments are on the desk.
    pub(super) fn look(&self, i: usize, rect: Rect, samples: u32, desk: &mut Desk) {
        let relief = Relief::new(&desk.fragments, rect, samples, &mut desk.field);
        assert!(self.0[i].set(relief).is_ok(), "each tile is looked at once");
    }

    /// When every tile has been looked at. `None` when nothing is marked.
    ///
    /// # Errors
    /// When the camera's numbers are not allowed.
    pub(super) fn finish(
        self,
        geometry: &Geometry<'_>,
        scene: &Scene,
        size: Size,
        timings: &Timings,
    ) -> Result<Option<Outline>> {
        let reliefs = self.0.into_iter();
        let reliefs: Vec<Relief> = reliefs
            .map(|r| r.into_inner().expect("every tile has been looked at"))
            .collect();
        let marks = Marks::new(size, scene.samples, &reliefs);
        if marks.wanted.is_empty() {
            return Ok(None);
        }
        let view = View::new(&scene.camera, sample_grid(size, SAMPLES_MAX)?)?;
        let window = view.size().rect();
        let corners = timings.time(Stage::Vertex, || Corners::new(geometry, &view));
        let bins = timings.time(Stage::Bin, || {
            Bins::some(geometry, &corners, window, cull(scene), &marks.tiles)
        });
        Ok(bins.map(|bins| Outline {
            tiles: Tile::of(window),
            window,
            marks,
            corners,
            bins,
        }))
    }
}

/// The marked pixels of a picture, ready to be drawn.
pub(super) struct Outline {
    window: Rect,
    marks: Marks,
    corners: Corners,
    /// Those of each wanted tile; empty once tiles are kept.
    bins: Vec<Bins>,
    tiles: Vec<Tile>,
}

impl Outline {
    /// Calls `light` for the marked pixels of each tile that `is_wanted` wants, by its number, with their fragments on the desk.
    /// With `keep`, what the tiles see is kept for the next time.
    ///
    /// # Errors
    /// When `progress` cancels.
    pub(super) fn each(
        &mut self,
        subject: &Prepared<'_>,
        (scene, pictures): (&Scene, &mut [Picture]),
        keep: bool,
        (timings, progress): (&Timings, &Progress<'_>),
        is_wanted: impl Fn(usize) -> bool + Sync,
        light: impl Fn(usize, Rect, &mut Desk, &mut [Lines<'_>]) + Sync,
    ) -> Result<()> {
        let Self {
            window,
            marks,
            corners,
            bins,
            tiles,
        } = self;
        let changes = scene.quality.needs_changes();
        subject.each_tile(
            *window,
            tiles,
            (pictures, SAMPLES_MAX),
            |i| marks.tiles[i] != UNWANTED && is_wanted(marks.tiles[i] as usize),
            |i, tile, desk, lines| {
                let number = marks.tiles[i];
                progress.check()?;
                let rect = tile.rect;
                let tile = if keep {
                    tile
                } else {
                    desk.tile.rect = rect;
                    &mut desk.tile
                };
                if let Some(bins) = bins.get(number as usize) {
                    timings.time(Stage::Raster, || {
                        bins.draw(0, tile, &mut desk.depths);
                        tile.keep(|column, row| marks.holds(column, row));
                    });
                }
                timings.time(Stage::Resolve, || {
                    tile.resolve(&subject.geometry, corners, changes, &mut desk.fragments);
                });
                light(number as usize, rect, desk, lines);
                Ok(())
            },
        )?;
        if keep {
            bins.clear();
        }
        Ok(())
    }

    /// What `look` finds of the fragments of the marked pixels of each tile, whose tiles are kept, and its rectangle in samples.
    ///
    /// # Errors
    /// When `progress` cancels.
    pub(super) fn see<T: Send>(
        &self,
        subject: &Prepared<'_>,
        changes: bool,
        progress: &Progress<'_>,
        look: impl Fn(Rect, &Fragments) -> T + Sync,
    ) -> Result<Vec<T>> {
        let seen = self.marks.wanted.par_iter().map(|tile| {
            progress.check()?;
            Ok(subject.with_desk(|desk| {
                let fragments = &mut desk.fragments;
                let tile = &self.tiles[*tile];
                tile.resolve(&subject.geometry, &self.corners, changes, fragments);
                look(tile.rect, fragments)
            }))
        });
        seen.collect()
    }

    /// The rectangles of its tiles, in samples.
    pub(super) fn rects(&self) -> impl Iterator<Item = Rect> {
        self.marks.wanted.iter().map(|tile| self.tiles[*tile].rect)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::map::{AnisoMap, DEFAULT_TEXEL, Wrap};
    use crate::mesh::{self, Mesh};
    use crate::preview::{Background, Look, Material, Subject};
    use crate::raster;
    use glam::Vec3;

    fn size(width: u32, height: u32) -> Size {
        Size::new(width, height).expect("a size")
    }

    fn outline(mesh: &Mesh, scene: &Scene, size: Size) -> Option<Outline> {
        let geometry = Geometry::new(mesh).expect("a mesh");
        let view = View::new(&scene.camera, sample_grid(size, scene.samples).unwrap()).unwrap();
        let none = Progress::none();
        let window = view.size().rect();
        let buffer = raster::GBuffer::draw(&geometry, &view, window, cull(scene), &none).unwrap();
        let finder = Finder::new(scene, size).expect("wanted");
        let mut desk = Desk::new();
        for (i, tile) in buffer.tiles().iter().enumerate() {
            tile.resolve(&geometry, buffer.corners(), false, &mut desk.fragments);
            finder.look(i, tile.rect, scene.samples, &mut desk);
        }
        let off = Timings::off();
        finder.finish(&geometry, scene, size, &off).unwrap()
    }

    #[test]
    fn marks_are_where_samples_see_different_things_on_whatever_tiles_they_lie() {
        let mesh = mesh::disc();
        for samples in 1..SAMPLES_MAX {
            let scene = Scene {
                samples,
                ..Scene::for_mesh(&mesh)
            };
            let size = size(150, 110);
            let marks = outline(&mesh, &scene, size).expect("a disc ends").marks;
            // The same without tiles: what each sample of the whole picture sees.
            let grid = sample_grid(size, samples).unwrap();
            let view = View::new(&scene.camera, grid).unwrap();
            let geometry = Geometry::new(&mesh).unwrap();
            let none = Progress::none();
            let all = raster::GBuffer::draw(&geometry, &view, grid.rect(), cull(&scene), &none);
            let mut sees = vec![false; grid.texels()];
            for tile in all.unwrap().tiles() {
                for sample in tile.exact(&geometry, &view) {
                    sees[grid.rect().index(sample.column, sample.row)] = true;
                }
            }
            let mut want = vec![false; size.texels()];
            for y in 0..grid.height() {
                for x in 0..grid.width() {
                    for (i, j) in [(x + 1, y), (x, y + 1)] {
                        let inside = i < grid.width() && j < grid.height();
                        let at = |x, y| grid.rect().index(x, y);
                        if inside && sees[at(x, y)] != sees[at(i, j)] {
                            want[size.rect().index(x / samples, y / samples)] = true;
                            want[size.rect().index(i / samples, j / samples)] = true;
                        }
                    }
                }
            }
            assert!(marks.pixels == want, "{samples}");
        }
    }

    #[test]
    fn a_smooth_surface_that_fills_the_picture_has_no_marks() {
        let mesh = mesh::sphere();
        let mut scene = Scene::for_mesh(&mesh);
        scene.camera.eye = scene.camera.target + Vec3::Z * 1.3;
        scene.samples = 1;
        assert!(outline(&mesh, &scene, size(200, 200)).is_none());
    }

    /// Coverage is what the outline shows of an object that only glows.
    fn glowing(mesh: &Mesh, scene: &Scene, size: Size) -> Picture {
        let map = AnisoMap::constant(Size::new(1, 1).unwrap(), Wrap::Repeat, DEFAULT_TEXEL);
        let material = Material {
            ambient: [1.0; 3],
            ..Material::default()
        };
        let subject = Subject {
            mesh,
            map: &map,
            material: &material,
        };
        let scene = Scene {
            lights: Vec::new(),
            background: Background {
                top: [0.0; 3],
                bottom: [0.0; 3],
            },
            ..scene.clone()
        };
        let none = Progress::none();
        let pictures = crate::preview::render(subject, &scene, &[Look::default()], size, &none);
        pictures.expect("a picture").remove(0)
    }

    #[test]
    fn outlines_are_those_of_sixteen_samples_and_the_rest_stays() {
        for mesh in [mesh::torus(), mesh::pot()] {
            let size = size(101, 90);
            let with = |samples: u32, outlines: bool| {
                let mut scene = Scene::for_mesh(&mesh);
                scene.samples = samples;
                scene.quality.outlines = outlines;
                scene
            };
            let sixteen = glowing(&mesh, &with(4, false), size);
            for samples in 1..SAMPLES_MAX {
                let scene = with(samples, true);
                let marks = outline(&mesh, &scene, size).expect("an end").marks;
                let plain = glowing(&mesh, &with(samples, false), size);
                let drawn = glowing(&mesh, &scene, size);
                let all = drawn.pixels().iter().zip(plain.pixels());
                for (i, (drawn, plain)) in all.enumerate() {
                    if marks.pixels[i] && sixteen.pixels()[i][0] > 0.0 {
                        assert_eq!(*drawn, sixteen.pixels()[i], "{i}");
                    } else {
                        assert_eq!(drawn, plain, "{i}");
                    }
                }
            }
        }
    }
}
