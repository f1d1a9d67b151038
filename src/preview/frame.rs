//! A picture that is drawn again and again, at the cost of what changed.
//!
//! | what changed | what is done |
//! |---|---|
//! | size, camera, samples, mesh | everything |
//! | lights, exposure, background, colours, look | every tile is lit anew; what its samples see is kept |
//! | a rectangle of the map | the pixels are lit anew whose fetches may reach it |
//! | nothing | nothing |
//!
//! Pixels at outlines, which take more samples, are drawn in tiles of their own and treated alike.
//!
//! Whatever was done, the picture is bit for bit the one that drawing everything gives.

use super::outline::{Finder, Outline, outline_scene};
use super::prepared::{Prepared, cull};
use super::shade::{Desk, Lines};
use super::{Look, Material, Picture, Quality, SAMPLES_MAX, Scene, Stage, Timings, sample_grid};
use crate::error::Result;
use crate::map::{AnisoMap, Rect, Size, Wrap, gathered};
use crate::math;
use crate::progress::Progress;
use crate::raster::{Corners, Cull, Fragments, Plan, Tile, View};
use fearless_simd::{Simd, dispatch};
use fearless_simd_macros::simd;
use glam::Vec2;
use rayon::prelude::*;
use std::cmp::Reverse;
use std::collections::HashSet;
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

/// Samples of a picture whose visibility is kept: six bytes each. Larger ones are drawn whole every time.
const KEPT_MAX: u64 = 1 << 26;

/// What [`Frame::draw`] had to do.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Redrawn {
    /// The picture stood already.
    Nothing,
    /// Pixels of so many tiles were lit anew.
    Tiles(usize),
    /// All were lit anew, what they see was kept.
    Light,
    /// Everything.
    Everything,
}

/// A picture, what each of its samples sees, and what it was lit with.
pub struct Frame {
    picture: Picture,
    kept: Option<Kept>,
    shown: Option<Shown>,
    touched: Vec<Rect>,
}

/// What does not change with the light.
struct Kept {
    view: View,
    samples: u32,
    cull: Cull,
    /// [`Geometry::id`](crate::raster::Geometry::id).
    geometry: u64,
    corners: Corners,
    tiles: Vec<Tile>,
    /// The pixels that are drawn again with more samples.
    outline: Option<Outline>,
    outlines: bool,
    /// The parts of the map that each tile sees; worked out when the map first changes.
    reaches: Option<Reaches>,
    owed: Option<Owed>,
}

/// What a drawing with a limit left to the next one.
struct Owed {
    /// Where the map changed.
    changes: Vec<Rect>,
    /// For each tile for how many drawings it has been owed; 0 where nothing is.
    tiles: Vec<u8>,
    /// The outline's tiles that are still as before.
    outline: Vec<bool>,
}

/// Tiles that are lit whatever the time.
const TILES_AT_LEAST: usize = 16;

/// What the picture was lit with.
struct Shown {
    scene: Scene,
    look: Look,
    material: Material,
    revision: u64,
}

impl Frame {
    /// A black picture.
    pub fn new(size: Size) -> Self {
        Self {
            picture: Picture::new(size, [0.0; 3]),
            kept: None,
            shown: None,
            touched: Vec::new(),
        }
    }

    /// The picture as it was last drawn.
    pub fn picture(&self) -> &Picture {
        &self.picture
    }

    /// After [`Redrawn::Tiles`], the rectangles of pixels outside which the picture is as before.
    pub fn touched(&self) -> &[Rect] {
        &self.touched
    }

    /// Takes another size; the picture is black until it is drawn again.
    pub fn resize(&mut self, size: Size) {
        if self.picture.size() != size {
            *self = Self::new(size);
        }
    }

    /// Makes the picture that of a subject in a scene, doing no more than it takes.
    ///
    /// # Errors
    /// As [`render`](super::render). The picture may then be part old, part new; the next call draws what is missing.
    pub fn draw(
        &mut self,
        subject: &Prepared<'_>,
        scene: &Scene,
        look: Look,
        timings: &Timings,
        progress: &Progress<'_>,
    ) -> Result<Redrawn> {
        self.draw_within(None, subject, scene, look, timings, progress)
    }

    /// Whether [`Frame::draw_within`] left pixels as they were before a change of the map.
    pub fn is_behind(&self) -> bool {
        self.kept.as_ref().is_some_and(|k| k.owed.is_some())
    }

    /// As [`Frame::draw`], but where the map changed only for about so long: what then still shows the map before is lit by the
    /// next call.
    ///
    /// # Errors
    /// As [`Frame::draw`].
    pub fn draw_within(
        &mut self,
        limit: Option<Duration>,
        subject: &Prepared<'_>,
        scene: &Scene,
        look: Look,
        timings: &Timings,
        progress: &Progress<'_>,
    ) -> Result<Redrawn> {
        scene.check()?;
        let grid = sample_grid(self.picture.size(), scene.samples)?;
        let view = View::new(&scene.camera, grid)?;
        if grid.texels() as u64 > KEPT_MAX {
            (self.kept, self.shown) = (None, None);
            let picture = std::slice::from_mut(&mut self.picture);
            subject.draw(scene, &[look], picture, timings, progress)?;
            return Ok(Redrawn::Everything);
        }
        let is_kept = self.kept.as_ref().is_some_and(|k| {
            k.view == view
                && k.samples == scene.samples
                && k.cull == cull(scene)
                && k.outlines == scene.quality.outlines
                && k.geometry == subject.geometry.id()
        });
        let before = self.shown.take();
        let redrawn = if is_kept {
            let kept = self.kept.as_mut().expect("just looked at");
            let lit_alike = before.filter(|s| {
                s.scene == *scene && s.look == look && s.material == *subject.material()
            });
            let dirty = lit_alike.and_then(|s| subject.changes_since(s.revision));
            // One lobe for the whole surface knows no place.
            let dirty = dirty.filter(|d| d.is_empty() || !look.mean);
            let job = Job {
                subject,
                scene,
                look,
                timings,
                progress,
            };
            match dirty {
                Some([]) if kept.owed.is_none() => Redrawn::Nothing,
                Some(rects) => {
                    let until = limit.map(|limit| Instant::now() + limit);
                    let picture = &mut self.picture;
                    let (tiles, touched) = job.relight_some(kept, rects, picture, until)?;
                    self.touched = touched;
                    Redrawn::Tiles(tiles)
                }
                None => {
                    kept.owed = None;
                    job.relight(kept, &mut self.picture)?;
                    Redrawn::Light
                }
            }
        } else {
            let old = self.kept.take().map_or_else(Vec::new, |k| k.tiles);
            let job = Job {
                subject,
                scene,
                look,
                timings,
                progress,
            };
            self.kept = Some(job.draw(view, old, &mut self.picture)?);
            Redrawn::Everything
        };
        self.shown = Some(Shown {
            scene: scene.clone(),
            look,
            material: *subject.material(),
            revision: subject.revision(),
        });
        Ok(redrawn)
    }

    /// Draws in a hurry, while the camera moves: a quarter of the pixels with one sample each, shown twice as large. The next
    /// [`Frame::draw`] draws everything.
    ///
    /// # Errors
    /// As [`render`](super::render).
    pub fn draft(
        &mut self,
        subject: &Prepared<'_>,
        scene: &Scene,
        look: Look,
        timings: &Timings,
        progress: &Progress<'_>,
    ) -> Result<()> {
        (self.kept, self.shown) = (None, None);
        let size = self.picture.size();
        let half = Size::new(size.width().div_ceil(2), size.height().div_ceil(2))?;
        let scene = Scene {
            samples: 1,
            quality: Quality {
                outlines: false,
                ..scene.quality
            },
            ..scene.clone()
        };
        let small = subject
            .render(&scene, &[look], half, timings, progress)?
            .swap_remove(0);
        for y in 0..size.height() {
            let from = small.row(y / 2);
            for (x, pixel) in self.picture.row_mut(y).iter_mut().enumerate() {
                *pixel = from[x / 2];
            }
        }
        Ok(())
    }
}

/// One call of [`Frame::draw`].
struct Job<'a> {
    subject: &'a Prepared<'a>,
    scene: &'a Scene,
    look: Look,
    timings: &'a Timings,
    progress: &'a Progress<'a>,
}

impl Job<'_> {
    /// Draws everything, into the memory of `old` tiles where they fit.
    fn draw(&self, view: View, old: Vec<Tile>, picture: &mut Picture) -> Result<Kept> {
        let Self {
            subject,
            scene,
            look,
            timings,
            progress,
        } = *self;
        let window = view.size().rect();
        let geometry = &subject.geometry;
        let corners = timings.time(Stage::Vertex, || Corners::new(geometry, &view));
        let mut tiles = Tile::of(window);
        for (tile, old) in tiles.iter_mut().zip(old) {
            tile.take_memory(old);
        }
        let plan = timings.time(Stage::Bin, || {
            let window = (window, &mut tiles[..]);
            Plan::new(geometry, &corners, window, cull(scene), progress)
        })?;
        let shader = subject.shader(scene, picture.size(), look);
        let finder = Finder::new(scene, picture.size());
        let changes = scene.quality.needs_changes();
        progress.expect(tiles.len() as u64);
        let pictures = std::slice::from_mut(&mut *picture);
        subject.each_tile(
            window,
            &mut tiles,
            (pictures, scene.samples),
            |_| true,
            |i, tile, desk, lines| {
                timings.time(Stage::Raster, || plan.draw(i, tile, &mut desk.depths));
                timings.time(Stage::Resolve, || {
                    tile.resolve(geometry, &corners, changes, &mut desk.fragments);
                });
                if let Some(finder) = &finder {
                    finder.look(i, tile.rect, scene.samples, desk);
                }
                shader.tile(tile.rect, desk, &mut lines[0], timings);
                progress.step()
            },
        )?;
        let outline = finder.map(|f| f.finish(geometry, scene, picture.size(), timings));
        let mut outline = outline.transpose()?.flatten();
        if let Some(outline) = &mut outline {
            self.light_outline(outline, picture, |_| true, |_, _| ())?;
        }
        Ok(Kept {
            view,
            samples: scene.samples,
            cull: cull(scene),
            geometry: geometry.id(),
            corners,
            tiles,
            outline,
            outlines: scene.quality.outlines,
            reaches: None,
            owed: None,
        })
    }

    /// Lights every tile.
    fn relight(&self, kept: &mut Kept, picture: &mut Picture) -> Result<()> {
        let shader = self.subject.shader(self.scene, picture.size(), self.look);
        self.each_kept(
            kept,
            picture,
            |_| true,
            |_| true,
            |tile, desk, lines| {
                shader.tile(tile, desk, lines, self.timings);
            },
        )?;
        match &mut kept.outline {
            Some(outline) => self.light_outline(outline, picture, |_| true, |_, _| ()),
            None => Ok(()),
        }
    }

    /// Lights the outline's tiles that are wanted: of each the fragments that `choose` leaves.
    fn light_outline(
        &self,
        outline: &mut Outline,
        picture: &mut Picture,
        is_wanted: impl Fn(usize) -> bool + Sync,
        choose: impl Fn(Rect, &mut Fragments) + Sync,
    ) -> Result<()> {
        let scene = outline_scene(self.scene);
        let shader = self.subject.shader(&scene, picture.size(), self.look);
        let to = (&scene, std::slice::from_mut(picture));
        let watch = (self.timings, self.progress);
        outline.each(
            self.subject,
            to,
            true,
            watch,
            is_wanted,
            |_, rect, desk, lines| {
                choose(rect, &mut desk.fragments);
                shader.pixels_of_fragments(rect, desk, &mut lines[0], self.timings);
            },
        )
    }

    /// Lights the pixels that see any of some rectangles of the map, or that a call before left, counts the tiles where such may
    /// be, and gives them and those of outlines in pixels. Past a point in time the rest is left.
    fn relight_some(
        &self,
        kept: &mut Kept,
        rects: &[Rect],
        picture: &mut Picture,
        until: Option<Instant>,
    ) -> Result<(usize, Vec<Rect>)> {
        let (map, mips) = (self.subject.map(), self.scene.quality.mips);
        let of_map = (map.size(), map.wrap());
        let reaches = kept.reaches.take();
        let reaches = reaches.filter(|r| r.mips == mips && r.of_map == of_map);
        let reaches = match reaches {
            Some(reaches) => reaches,
            None => self.reaches(kept, picture.size())?,
        };
        let owed = kept.owed.take();
        let mut cells = Cells::default();
        for rect in rects {
            let [across, down] = sides(*rect, map.size());
            cells.add(across, down);
        }
        let mut changes = rects.to_vec();
        changes.extend(owed.iter().flat_map(|o| &o.changes));
        let changed: Vec<_> = changes.iter().map(|r| sides(*r, map.size())).collect();
        let age = |i: usize| owed.as_ref().map_or(0, |o| o.tiles[i]);
        let tiles = reaches.tiles.iter().enumerate();
        let touched: Vec<bool> = tiles.map(|(i, r)| r.meets(&cells) || age(i) > 0).collect();
        // The longest owed come first: changes that go on would else keep the same tiles waiting.
        let mut first: Vec<usize> = (0..touched.len()).filter(|i| touched[*i]).collect();
        first.sort_by_key(|i| Reverse(age(*i)));
        let later = first.split_off(first.len().min(match until {
            Some(_) => TILES_AT_LEAST,
            None => usize::MAX,
        }));
        let samples = kept.samples;
        let shader = self.subject.shader(self.scene, picture.size(), self.look);
        let lit = Mutex::new(vec![false; touched.len()]);
        let is_time = || until.is_none_or(|until| Instant::now() < until);
        for (some, is_asked) in [(first, false), (later, true)] {
            if some.is_empty() || is_asked && !is_time() {
                continue;
            }
            let some: HashSet<usize> = some.into_iter().collect();
            self.each_kept(
                kept,
                picture,
                |i| some.contains(&i),
                |i| {
                    let wanted = !is_asked || is_time();
                    if wanted {
                        lit.lock().unwrap_or_else(PoisonError::into_inner)[i] = true;
                    }
                    wanted
                },
                |tile, desk, lines| {
                    let wanted = reaching(map, &desk.fragments, mips, &changed);
                    // What the outline shows is its own to change.
                    keep_pixels(&mut desk.fragments, tile, samples, &wanted, |x, y| {
                        !reaches.is_of_outline(x, y)
                    });
                    shader.pixels_of_fragments(tile, desk, lines, self.timings);
                },
            )?;
        }
        let lit = lit.into_inner().unwrap_or_else(PoisonError::into_inner);
        let pixels = |rect: Rect, samples: u32| Rect {
            x: rect.x / samples,
            y: rect.y / samples,
            width: rect.width / samples,
            height: rect.height / samples,
        };
        let tiles = kept.tiles.iter().zip(&lit).filter(|(_, t)| **t);
        let mut rects: Vec<Rect> = tiles.map(|(tile, _)| pixels(tile.rect, samples)).collect();
        let done = rects.len();
        let left: Vec<u8> = (0..touched.len())
            .map(|i| match touched[i] && !lit[i] {
                true => age(i).saturating_add(1),
                false => 0,
            })
            .collect();
        let mut left_outline = Vec::new();
        if let Some(outline) = &mut kept.outline {
            let was_left = |i| {
                owed.as_ref()
                    .is_some_and(|o| o.outline.get(i) == Some(&true))
            };
            let tiles = reaches.outline.iter().enumerate();
            let wanted: Vec<bool> = tiles.map(|(i, r)| r.meets(&cells) || was_left(i)).collect();
            // One drawing may leave it, not two.
            let is_owed = owed.as_ref().is_some_and(|o| o.outline.contains(&true));
            if is_time() || done < TILES_AT_LEAST || is_owed {
                let choose = |rect, fragments: &mut Fragments| {
                    let wanted = reaching(map, fragments, mips, &changed);
                    keep_pixels(fragments, rect, SAMPLES_MAX, &wanted, |_, _| true);
                };
                self.light_outline(outline, picture, |i| wanted[i], choose)?;
                let lit = outline.rects().zip(&wanted).filter(|(_, wanted)| **wanted);
                rects.extend(lit.map(|(rect, _)| pixels(rect, SAMPLES_MAX)));
            } else {
                left_outline = wanted;
            }
        }
        if left.iter().any(|age| *age > 0) || left_outline.contains(&true) {
            kept.owed = Some(Owed {
                changes: gathered(&changes),
                tiles: left,
                outline: left_outline,
            });
        }
        kept.reaches = Some(reaches);
        Ok((done, rects))
    }

    /// Calls `light` for the tiles that are wanted, and still are when it is their turn, with their fragments on the desk.
    fn each_kept(
        &self,
        kept: &mut Kept,
        picture: &mut Picture,
        is_wanted: impl Fn(usize) -> bool + Sync,
        is_still: impl Fn(usize) -> bool + Sync,
        light: impl Fn(Rect, &mut Desk, &mut Lines<'_>) + Sync,
    ) -> Result<()> {
        let Self {
            subject,
            scene,
            timings,
            progress,
            ..
        } = *self;
        let Kept {
            view,
            corners,
            tiles,
            ..
        } = kept;
        let changes = scene.quality.needs_changes();
        progress.expect(tiles.len() as u64);
        let window = view.size().rect();
        let pictures = std::slice::from_mut(picture);
        subject.each_tile(
            window,
            tiles,
            (pictures, scene.samples),
            is_wanted,
            |i, tile, desk, lines| {
                if is_still(i) {
                    timings.time(Stage::Resolve, || {
                        tile.resolve(&subject.geometry, corners, changes, &mut desk.fragments);
                    });
                    light(tile.rect, desk, &mut lines[0]);
                }
                progress.step()
            },
        )
    }

    /// What parts of the map the tiles see, of a picture of `size` pixels.
    fn reaches(&self, kept: &Kept, size: Size) -> Result<Reaches> {
        let Self {
            subject,
            scene,
            progress,
            ..
        } = *self;
        let changes = scene.quality.needs_changes();
        let cells = kept.tiles.par_iter().map(|tile| {
            progress.check()?;
            Ok(subject.with_desk(|desk| {
                let fragments = &mut desk.fragments;
                tile.resolve(&subject.geometry, &kept.corners, changes, fragments);
                Cells::seen(subject.map(), fragments, scene.quality.mips)
            }))
        });
        let tiles = cells.collect::<Result<_>>()?;
        let mut reaches = Reaches {
            tiles,
            outline: Vec::new(),
            mips: scene.quality.mips,
            of_map: (subject.map().size(), subject.map().wrap()),
            width: size.width() as usize,
            of_outline: Vec::new(),
        };
        if let Some(outline) = &kept.outline {
            let seen = outline.see(subject, changes, progress, |rect, fragments| {
                let pixel = |start: u32, t: u8| ((start + u32::from(t)) / SAMPLES_MAX) as usize;
                let places = fragments.columns().iter().zip(fragments.rows());
                let mut pixels: Vec<usize> = places
                    .map(|(x, y)| pixel(rect.y, *y) * reaches.width + pixel(rect.x, *x))
                    .collect();
                pixels.dedup();
                let cells = Cells::seen(subject.map(), fragments, scene.quality.mips);
                (cells, pixels)
            })?;
            reaches.of_outline.resize(size.texels(), false);
            for (cells, pixels) in seen {
                reaches.outline.push(cells);
                for pixel in pixels {
                    reaches.of_outline[pixel] = true;
                }
            }
        }
        Ok(reaches)
    }
}

/// What parts of the map each tile sees.
struct Reaches {
    tiles: Vec<Cells>,
    /// And each of the outline's, in its marked pixels.
    outline: Vec<Cells>,
    /// Whether footprints are averaged: then fetches reach farther.
    mips: bool,
    /// The size of the map, and what lies past its edges.
    of_map: (Size, Wrap),
    /// The pixels that the outline shows, in rows of `width`; none without an outline.
    of_outline: Vec<bool>,
    width: usize,
}

impl Reaches {
    fn is_of_outline(&self, x: usize, y: usize) -> bool {
        self.of_outline.get(y * self.width + x) == Some(&true)
    }
}

/// Cells along a side of the map.
const CELLS: usize = 64;

/// Some cells of the map, a bit each, in rows from the top.
#[derive(Clone, Debug)]
struct Cells([u64; CELLS]);

impl Default for Cells {
    fn default() -> Self {
        Self([0; CELLS])
    }
}

impl Cells {
    const ALL: Self = Self([u64::MAX; CELLS]);

    fn meets(&self, other: &Self) -> bool {
        self.0.iter().zip(&other.0).any(|(a, b)| a & b != 0)
    }

    /// Adds a rectangle, in parts of the map from its left and its upper edge; what lies outside is taken as wrapped around.
    fn add(&mut self, across: (f32, f32), down: (f32, f32)) {
        let cells = |(low, high): (f32, f32)| {
            let cell = |t: f32| (t * CELLS as f32).floor();
            let (first, last) = (cell(low), cell(high));
            // NaN fails this too, and means all.
            if last - first < CELLS as f32 - 1.0 {
                let first = first.rem_euclid(CELLS as f32) as usize;
                (first, (cell(high) - cell(low)) as usize + 1)
            } else {
                (0, CELLS)
            }
        };
        let (column, columns) = cells(across);
        let (row, rows) = cells(down);
        let bits = if columns == CELLS {
            u64::MAX
        } else {
            ((1 << columns) - 1u64).rotate_left(column as u32)
        };
        for y in row..row + rows {
            self.0[y % CELLS] |= bits;
        }
    }

    /// The cells that fetches for some fragments may reach.
    fn seen(map: &AnisoMap, fragments: &Fragments, mips: bool) -> Self {
        let mut cells = Self::default();
        for i in 0..fragments.len() {
            let [across, down] = Place::of(map, fragments, i, mips).map(|p| p.sides());
            if !(across.0 + across.1 + down.0 + down.1).is_finite() {
                return Self::ALL;
            }
            cells.add(across, down);
        }
        cells
    }
}

/// Where fetches for a fragment reach along one side of the map, in parts of it from its left or its upper edge.
struct Place {
    middle: f32,
    reach: f32,
    repeats: bool,
}

impl Place {
    /// Across and down.
    // Written out twice: a closure over an array is not inlined everywhere, and this is asked of every fragment.
    #[inline(always)]
    fn of(map: &AnisoMap, fragments: &Fragments, i: usize, mips: bool) -> [Self; 2] {
        let size = Vec2::new(map.width() as f32, map.height() as f32);
        let uv = fragments.uv(i);
        let texels = if mips {
            let halved = map.width().is_power_of_two() && map.height().is_power_of_two();
            let [dx, dy] = fragments.uv_change(i);
            reach([dx * size, dy * size], halved)
        } else {
            PLAIN_REACH
        };
        let wrap = map.wrap();
        [
            Self::new(uv.x, texels / size.x, wrap.repeats_u()),
            Self::new(1.0 - uv.y, texels / size.y, wrap.repeats_v()),
        ]
    }

    /// As fetches take it: whole turns go first, and what is not finite is 0.
    #[inline(always)]
    fn new(t: f32, reach: f32, repeats: bool) -> Self {
        let t = math::choose(t.abs() < f32::INFINITY, t, 0.0);
        let turned = t - t.floor();
        Self {
            middle: math::choose(repeats, turned, t.clamp(0.0, 1.0)),
            reach,
            repeats,
        }
    }

    fn sides(&self) -> (f32, f32) {
        let (low, high) = (self.middle - self.reach, self.middle + self.reach);
        if self.repeats {
            (low, high)
        } else {
            (low.clamp(0.0, 1.0), high.clamp(0.0, 1.0))
        }
    }

    /// Whether it reaches an interval; NaN does.
    #[inline(always)]
    fn meets(&self, (low, high): (f32, f32)) -> bool {
        let away = self.middle - 0.5 * (low + high);
        let turned = away - math::round_fast(away);
        let away = math::choose(self.repeats, turned, away);
        let apart = away.abs() > 0.5 * (high - low) + self.reach;
        !apart
    }
}

/// A rectangle of the map as parts of it from its left and its upper edge.
fn sides(rect: Rect, size: Size) -> [(f32, f32); 2] {
    let part = |start: u32, length: u32, all: u32| {
        let place = |t: u32| t as f32 / all as f32;
        (place(start), place(start + length))
    };
    [
        part(rect.x, rect.width, size.width()),
        part(rect.y, rect.height, size.height()),
    ]
}

/// Leaves of a tile's fragments those in whose pixel any is wanted, if `is_open` says so of the pixel's column and row.
fn keep_pixels(
    fragments: &mut Fragments,
    tile: Rect,
    samples: u32,
    is_wanted: &[bool],
    is_open: impl Fn(usize, usize) -> bool,
) {
    if !is_wanted.contains(&true) {
        fragments.keep(|_| false);
        return;
    }
    let pixels = |n: u32| (n / samples) as usize;
    let width = pixels(tile.width);
    let mut wanted = vec![false; width * pixels(tile.height)];
    let places = fragments.columns().iter().zip(fragments.rows());
    let places: Vec<usize> = places
        .map(|(column, row)| pixels(u32::from(*row)) * width + pixels(u32::from(*column)))
        .collect();
    for (&place, is_wanted) in places.iter().zip(is_wanted) {
        wanted[place] |= is_wanted;
    }
    for (place, wanted) in wanted.iter_mut().enumerate().filter(|(_, w)| **w) {
        *wanted = is_open(
            pixels(tile.x) + place % width,
            pixels(tile.y) + place / width,
        );
    }
    fragments.keep(|i| wanted[places[i]]);
}

/// Which fragments' fetches may reach any of some rectangles of the map.
fn reaching(
    map: &AnisoMap,
    fragments: &Fragments,
    mips: bool,
    changed: &[[(f32, f32); 2]],
) -> Vec<bool> {
    let mut out = vec![false; fragments.len()];
    for sides in changed {
        dispatch!(math::level(), simd => mark(simd, (map, fragments), mips, *sides, &mut out));
    }
    out
}

#[simd]
fn mark<S: Simd>(
    _: S,
    (map, fragments): (&AnisoMap, &Fragments),
    mips: bool,
    changed: [(f32, f32); 2],
    out: &mut [bool],
) {
    // No index is out of range then, which whole vectors ask for.
    let n = out.len().min(fragments.lanes().q.len());
    for (i, out) in out[..n].iter_mut().enumerate() {
        let [across, down] = Place::of(map, fragments, i, mips);
        *out |= across.meets(changed[0]) & down.meets(changed[1]);
    }
}

/// Texels that a fetch between four texels may be away from its place.
const PLAIN_REACH: f32 = 1.5;

/// Texels that [`Pyramid::sample`](crate::filter::Pyramid::sample) may reach from its place, for steps to the right and
/// downward in texels: half its long side, and three texels of the coarser of its two levels, each of which is under four
/// times its short side wide. [`Pyramid::varieties`](crate::filter::Pyramid::varieties) asks one texel that is up to four
/// times the long side wide; twice where sides are halved without rest.
#[inline(always)]
fn reach([dx, dy]: [Vec2; 2], halved: bool) -> f32 {
    let long = (dx.length_squared() + dy.length_squared()).sqrt();
    // The long side of the ellipse is at least 1/sqrt 2 of this.
    let short = std::f32::consts::SQRT_2 * dx.perp_dot(dy).abs() / long;
    let width = short.max(long / 8.0).max(1.0);
    let texel = if halved { 2.0 * long } else { 4.0 * long };
    (0.5 * long + 6.5 * width).max(texel).max(PLAIN_REACH)
}
