//! The layer that is painted on, as texels in tiles: what lies below it, what its strokes made of that, and the composite with
//! everything above.
//!
//! Tiles are made where somebody looks and kept where strokes went. Tiles as they were before the last strokes are kept for
//! undo, as far as memory allows; past that a tile is painted again from all its strokes. Tiles are caches: the recipe is the truth, and
//! `generate` makes the same texels of it.

use crate::error::Result;
use crate::map::{DEFAULT_TEXEL, Rect, Region};
use crate::paint::{Brush, Live, Painting, Skin, Stroke, Strokes};
use crate::pattern::Surface;
use crate::progress::Progress;
use crate::recipe;
use rayon::prelude::*;
use std::collections::{HashMap, VecDeque};
use std::ops::Range;
use std::sync::Arc;

/// Texels along a tile's side.
const SIDE: u32 = 128;

/// The stack of layers, and the one that is painted on.
pub(super) struct Canvas {
    stack: recipe::Prepared,
    active: Option<Active>,
}

/// Texels of a layer of strokes, and how much of each the strokes have touched.
#[derive(PartialEq)]
struct Tile {
    now: Region,
    coverage: Vec<f32>,
}

/// Tiles by number. `None` is a tile that no stroke touched: it is as below.
type Tiles = HashMap<u32, Option<Arc<Tile>>>;

struct Active {
    /// The layer's number in the recipe.
    at: usize,
    surface: Surface,
    /// The mesh, once strokes lie on it.
    skin: Option<Arc<Skin>>,
    painting: Painting,
    /// What lies below the layer.
    below: HashMap<u32, Arc<Region>>,
    /// After all strokes.
    tiles: Tiles,
    /// The tiles that each of the last strokes changed, as they were before it.
    before: VecDeque<Tiles>,
    before_bytes: usize,
    budget: usize,
    /// The stroke in flight, and the tiles that it changed as they are with it.
    live: Option<(Live, HashMap<u32, Tile>)>,
}

impl Canvas {
    /// A canvas of a stack of which no layer is painted on yet.
    pub(super) fn new(stack: recipe::Prepared) -> Self {
        Self {
            stack,
            active: None,
        }
    }

    pub(super) fn stack(&self) -> &recipe::Prepared {
        &self.stack
    }

    /// The number of the layer that is painted on.
    pub(super) fn active(&self) -> Option<usize> {
        self.active.as_ref().map(|a| a.at)
    }

    /// Makes the layer `at`, which holds `strokes`, the one that is painted on, in a stack that is up to date; on a mesh, when
    /// there is a skin. Tiles as they were before strokes may hold `budget` bytes.
    pub(super) fn activate(
        &mut self,
        stack: recipe::Prepared,
        (at, strokes): (usize, &Strokes),
        skin: Option<Arc<Skin>>,
        budget: usize,
    ) -> Result<()> {
        self.stack = stack;
        self.active = None;
        let surface = self.stack.surface();
        self.active = Some(Active {
            at,
            surface,
            painting: Painting::new(&surface, strokes, skin.clone(), &Progress::none())?,
            skin,
            below: HashMap::new(),
            tiles: HashMap::new(),
            before: VecDeque::new(),
            before_bytes: 0,
            budget,
            live: None,
        });
        Ok(())
    }

    /// How many strokes the layer that is painted on has.
    pub(super) fn strokes(&self) -> usize {
        self.active.as_ref().map_or(0, |a| a.painting.len())
    }

    /// Bytes of the tiles.
    pub(super) fn bytes(&self) -> usize {
        self.active.as_ref().map_or(0, |a| {
            bytes_of(&a.tiles) + a.below.len() * (SIDE * SIDE * 16) as usize + a.before_bytes
        })
    }

    /// The composite of a rectangle as it is now, with the stroke in flight.
    pub(super) fn compose(&mut self, rect: Rect) -> Region {
        let Some(active) = &mut self.active else {
            let mut whole = Region::constant(rect, DEFAULT_TEXEL);
            self.stack.fill(whole.view_mut());
            return whole;
        };
        let needed = self.stack.needs_over(active.at, rect);
        active.ensure(&self.stack, needed, active.painting.len());
        let (painted, _) = active.shown(needed);
        let mut whole = Region::constant(needed, DEFAULT_TEXEL);
        active.read_below(&mut whole);
        self.stack.fill_over(active.at, &painted, rect, &mut whole);
        if needed == rect {
            whole
        } else {
            crop(&whole, rect)
        }
    }

    /// How much of each texel of a rectangle the layer's strokes have touched, in row order; `None` when none is painted on.
    pub(super) fn coverage(&mut self, rect: Rect) -> Option<Vec<f32>> {
        let active = self.active.as_mut()?;
        active.ensure(&self.stack, rect, active.painting.len());
        Some(active.shown(rect).1)
    }

    /// A stroke more on the layer that is painted on: gives the rectangle outside which nothing changed.
    pub(super) fn push(&mut self, stroke: &Arc<Stroke>) -> Option<Rect> {
        let active = self.active.as_mut()?;
        active.live = None;
        active.painting.push(stroke);
        let n = active.painting.len() - 1;
        let Some(bounds) = active.painting.bounds(n) else {
            active.keep(Tiles::new());
            return None;
        };
        // The tiles as they were before it.
        let reach = active.painting.needs_for(n..n + 1, bounds);
        active.ensure(&self.stack, reach, n);
        let tiles: Tiles = numbers(active, bounds)
            .into_par_iter()
            .map(|number| (number, active.with_one_more(number, n)))
            .collect();
        active.take_over(tiles);
        Some(bounds)
    }

    /// A stroke less.
    pub(super) fn pop(&mut self) -> Option<Rect> {
        let active = self.active.as_mut()?;
        let n = active.painting.len().checked_sub(1)?;
        let bounds = active.painting.bounds(n);
        active.painting.pop();
        match active.before.pop_back() {
            Some(before) => {
                active.before_bytes -= bytes_of(&before);
                active.tiles.extend(before);
            }
            // Forgotten: they are painted again when somebody looks.
            None => {
                for number in bounds.map_or_else(Vec::new, |b| numbers(active, b)) {
                    active.tiles.remove(&number);
                }
            }
        }
        bounds
    }

    /// The mesh that is painted on.
    pub(super) fn skin(&self) -> Option<&Arc<Skin>> {
        self.active.as_ref()?.skin.as_ref()
    }

    /// Whether there is a stroke in flight.
    pub(super) fn is_drawing(&self) -> bool {
        self.live().is_some()
    }

    /// The stroke in flight.
    pub(super) fn live(&self) -> Option<&Live> {
        self.active.as_ref()?.live.as_ref().map(|(live, _)| live)
    }

    /// Begins a stroke in flight: on the mesh where there is a `skin`, or else in UV.
    ///
    /// # Errors
    /// When the brush does not check.
    pub(super) fn begin(
        &mut self,
        brush: Arc<Brush>,
        seed: u32,
        skin: Option<Arc<Skin>>,
    ) -> Result<()> {
        if let Some(active) = &mut self.active {
            let live = match skin {
                Some(skin) => Live::on_mesh(brush, seed, skin)?,
                None => Live::new(brush, seed, &active.surface)?,
            };
            active.live = Some((live, HashMap::new()));
        }
        Ok(())
    }

    /// Lets the stroke in flight go on; gives the rectangles outside which nothing changed.
    pub(super) fn go_on(&mut self, push: impl FnOnce(&mut Live) -> Vec<Rect>) -> Vec<Rect> {
        let Some(active) = &mut self.active else {
            return Vec::new();
        };
        let Some((mut live, mut tiles)) = active.live.take() else {
            return Vec::new();
        };
        let dirty = push(&mut live);
        for rect in &dirty {
            active.ensure(&self.stack, live.needs(*rect), active.painting.len());
            let old: Vec<_> = numbers(active, *rect)
                .into_iter()
                .map(|number| (number, tiles.remove(&number)))
                .collect();
            let new: Vec<_> = old
                .into_par_iter()
                .map(|(number, tile)| (number, active.in_flight(number, *rect, &live, tile)))
                .collect();
            tiles.extend(new);
        }
        active.live = Some((live, tiles));
        dirty
    }

    /// Ends the stroke in flight: when it painted anything it is the layer's last from now on, with the texels that it has.
    pub(super) fn end(&mut self) -> Option<Arc<Stroke>> {
        let active = self.active.as_mut()?;
        let (live, tiles) = active.live.take()?;
        let stroke = live.finish();
        if stroke.is_none() || tiles.is_empty() {
            return None;
        }
        let stroke = Arc::new(stroke?);
        active.painting.push(&stroke);
        let tiles = tiles.into_iter();
        active.take_over(tiles.map(|(n, t)| (n, Some(Arc::new(t)))).collect());
        Some(stroke)
    }

    /// Takes the stroke in flight away; gives the rectangles that change by it.
    pub(super) fn cancel(&mut self) -> Vec<Rect> {
        let Some(active) = &mut self.active else {
            return Vec::new();
        };
        let tiles = active.live.take().map_or_else(HashMap::new, |l| l.1);
        tiles.keys().map(|n| active.rect_of(*n)).collect()
    }
}

/// The numbers of the tiles that a rectangle meets.
fn numbers(active: &Active, rect: Rect) -> Vec<u32> {
    let columns = active.columns();
    let across = rect.x / SIDE..(rect.x + rect.width).div_ceil(SIDE);
    let down = rect.y / SIDE..(rect.y + rect.height).div_ceil(SIDE);
    down.flat_map(|y| across.clone().map(move |x| y * columns + x))
        .collect()
}

fn bytes_of(tiles: &Tiles) -> usize {
    let of = |tile: &Option<Arc<Tile>>| tile.as_ref().map_or(16, |t| t.coverage.len() * 20);
    tiles.values().map(of).sum()
}

impl Active {
    fn columns(&self) -> u32 {
        self.surface.size.width().div_ceil(SIDE)
    }

    fn rect_of(&self, number: u32) -> Rect {
        let (x, y) = (
            number % self.columns() * SIDE,
            number / self.columns() * SIDE,
        );
        let tile = Rect {
            x,
            y,
            width: SIDE,
            height: SIDE,
        };
        let map = self.surface.size.rect();
        tile.intersection(map).expect("a tile of the map")
    }

    /// Makes the tiles of a rectangle that are not there, as the first `n` strokes leave them.
    fn ensure(&mut self, stack: &recipe::Prepared, rect: Rect, n: usize) {
        let missing: Vec<u32> = numbers(self, rect)
            .into_iter()
            .filter(|number| !self.tiles.contains_key(number))
            .collect();
        self.ensure_below(stack, rect);
        for number in &missing {
            let reach = self.painting.needs_for(0..n, self.rect_of(*number));
            self.ensure_below(stack, reach);
        }
        let made: Vec<_> = missing
            .into_par_iter()
            .map(|number| (number, self.tile_from_nothing(number, n)))
            .collect();
        self.tiles.extend(made);
    }

    fn ensure_below(&mut self, stack: &recipe::Prepared, rect: Rect) {
        let made: Vec<_> = numbers(self, rect)
            .into_par_iter()
            .filter(|number| !self.below.contains_key(number))
            .map(|number| {
                let mut region = Region::constant(self.rect_of(number), DEFAULT_TEXEL);
                stack.fill_below(self.at, region.view_mut());
                (number, Arc::new(region))
            })
            .collect();
        self.below.extend(made);
    }

    /// Copies what lies below, which is there.
    fn read_below(&self, to: &mut Region) {
        for number in numbers(self, to.rect()) {
            to.copy_from(&self.below[&number]);
        }
    }

    /// The texels of a rectangle whose tiles are there, and their coverage.
    fn read(&self, rect: Rect) -> (Region, Vec<f32>) {
        let mut now = Region::constant(rect, DEFAULT_TEXEL);
        let mut coverage = vec![0.0; rect.texels()];
        for number in numbers(self, rect) {
            match &self.tiles[&number] {
                Some(tile) => {
                    now.copy_from(&tile.now);
                    copy_plane((rect, &mut coverage), (tile.now.rect(), &tile.coverage));
                }
                None => now.copy_from(&self.below[&number]),
            }
        }
        (now, coverage)
    }

    /// The same with the stroke in flight.
    fn shown(&self, rect: Rect) -> (Region, Vec<f32>) {
        let (mut now, mut coverage) = self.read(rect);
        if let Some((_, tiles)) = &self.live {
            for tile in numbers(self, rect).iter().filter_map(|n| tiles.get(n)) {
                now.copy_from(&tile.now);
                copy_plane((rect, &mut coverage), (tile.now.rect(), &tile.coverage));
            }
        }
        (now, coverage)
    }

    /// A tile, as the stroke in flight left it if it has been there, with what it changes in `rect`.
    fn in_flight(&self, number: u32, rect: Rect, live: &Live, tile: Option<Tile>) -> Tile {
        let whole = self.rect_of(number);
        let mut tile = tile.unwrap_or_else(|| {
            let (now, coverage) = self.read(whole);
            Tile { now, coverage }
        });
        if let Some(part) = whole.intersection(rect) {
            let (before, covered) = self.read(live.needs(part));
            let mut below = Region::constant(part, DEFAULT_TEXEL);
            self.read_below(&mut below);
            let mut now = below.clone();
            let mut coverage = crop_plane((before.rect(), covered), part);
            live.apply(&before, &below, &mut now, &mut coverage);
            tile.now.copy_from(&now);
            copy_plane((whole, &mut tile.coverage), (part, &coverage));
        }
        tile
    }

    /// A tile after the first `n` strokes, with what lies below it there.
    fn tile_from_nothing(&self, number: u32, n: usize) -> Option<Arc<Tile>> {
        let rect = self.rect_of(number);
        let mut below = Region::constant(self.painting.needs_for(0..n, rect), DEFAULT_TEXEL);
        self.read_below(&mut below);
        let coverage = vec![0.0; below.rect().texels()];
        self.paint(0..n, rect, &below, (below.clone(), coverage))
    }

    /// A tile with the nth stroke, when it and all around it that the stroke looks at are as before it.
    fn with_one_more(&self, number: u32, n: usize) -> Option<Arc<Tile>> {
        let rect = self.rect_of(number);
        let mut below = Region::constant(self.painting.needs_for(n..n + 1, rect), DEFAULT_TEXEL);
        self.read_below(&mut below);
        self.paint(n..n + 1, rect, &below, self.read(below.rect()))
    }

    /// Strokes over what the ones before them left; `None` when none ever touched the tile.
    fn paint(
        &self,
        strokes: Range<usize>,
        rect: Rect,
        below: &Region,
        (mut now, mut coverage): (Region, Vec<f32>),
    ) -> Option<Arc<Tile>> {
        self.painting
            .paint(strokes, rect, below, &mut now, &mut coverage);
        let untouched = now == *below && coverage.iter().all(|c| *c == 0.0);
        (!untouched).then(|| {
            let coverage = crop_plane((now.rect(), coverage), rect);
            let now = if now.rect() == rect {
                now
            } else {
                crop(&now, rect)
            };
            Arc::new(Tile { now, coverage })
        })
    }

    /// Takes over tiles that a stroke changed, and keeps them as they were before it.
    fn take_over(&mut self, tiles: Tiles) {
        let mut before = Tiles::new();
        for (number, tile) in tiles {
            let old = self.tiles.insert(number, tile);
            let new = &self.tiles[&number];
            match old {
                Some(old) if old == *new => {}
                Some(old) => {
                    before.insert(number, old);
                }
                None => {}
            }
        }
        self.keep(before);
    }

    fn keep(&mut self, before: Tiles) {
        self.before_bytes += bytes_of(&before);
        self.before.push_back(before);
        while self.before_bytes > self.budget
            && let Some(oldest) = self.before.pop_front()
        {
            self.before_bytes -= bytes_of(&oldest);
        }
    }
}

/// A rectangle of a region that holds it.
fn crop(region: &Region, rect: Rect) -> Region {
    let mut part = Region::constant(rect, DEFAULT_TEXEL);
    part.copy_from(region);
    part
}

/// Copies numbers in row order from one rectangle into another, where they overlap.
fn copy_plane((to, numbers): (Rect, &mut [f32]), (from, source): (Rect, &[f32])) {
    let Some(common) = to.intersection(from) else {
        return;
    };
    let n = common.width as usize;
    for y in common.y..common.y + common.height {
        let (i, j) = (to.index(common.x, y), from.index(common.x, y));
        numbers[i..i + n].copy_from_slice(&source[j..j + n]);
    }
}

fn crop_plane((from, source): (Rect, Vec<f32>), rect: Rect) -> Vec<f32> {
    if from == rect {
        return source;
    }
    let mut part = vec![0.0; rect.texels()];
    copy_plane((rect, &mut part), (from, &source));
    part
}
