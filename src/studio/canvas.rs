//! The layer that is painted on, as texels in tiles: what lies below it, what its strokes made of that, and the composite with
//! everything above.
//!
//! Tiles are made where somebody looks and kept where strokes went. Tiles as they were before the last strokes are kept for
//! undo, as far as memory allows; past that a tile is painted again from all its strokes. Tiles are caches: the recipe is the truth, and
//! `generate` makes the same texels of it.

use crate::error::{Error, Result};
use crate::map::{DEFAULT_TEXEL, Rect, Region, Size, crop_plane};
use crate::paint::{Brush, Live, Painting, Skin, Stroke, Strokes};
use crate::pattern::Surface;
use crate::progress::Progress;
use crate::recipe;
use rayon::prelude::*;
use std::collections::{BTreeMap, HashMap, HashSet, VecDeque};
use std::ops::Range;
use std::sync::Arc;

/// Texels along a tile's side.
const SIDE: u32 = 128;

/// The stack of layers, and the one that is painted on.
pub(super) struct Canvas {
    stack: recipe::Prepared,
    active: Option<Active>,
}

/// Bytes that may be kept of what the layers above lay.
const ABOVE_BYTES: usize = 192 << 20;

/// Texels of a layer of strokes, and how much of each the strokes have touched.
#[derive(Clone, PartialEq)]
struct Tile {
    now: Region,
    coverage: Vec<f32>,
}

/// Tiles by number. `None` is a tile that no stroke touched: it is as below.
type Tiles = HashMap<u32, Option<Arc<Tile>>>;

/// Parts of tiles, in the order of the tiles' numbers.
pub(super) type Parts = BTreeMap<u32, Rect>;

struct Active {
    /// The layer's number in the recipe.
    at: usize,
    surface: Surface,
    /// The mesh, once strokes lie on it.
    skin: Option<Arc<Skin>>,
    painting: Painting,
    /// What lies below the layer.
    below: HashMap<u32, Arc<Region>>,
    /// What the layers above lay, as far as memory allows.
    above: HashMap<u32, recipe::Above>,
    above_bytes: usize,
    /// Whether strokes above look around themselves: then a tile does not stand for itself.
    looks_over: bool,
    /// After all strokes.
    tiles: Tiles,
    kept: Kept,
    /// Where the mask of the layer is painted on and not the layer: what it hides and shows.
    mask: Option<MaskOf>,
    live: Option<Flight>,
}

/// A layer made ready to be painted on, which takes a while.
pub(super) struct Ready {
    stack: recipe::Prepared,
    active: Active,
}

impl Ready {
    /// Of the layer `at`, which holds `strokes`, in a stack that is up to date; on a mesh, when there is a skin. Where there is a
    /// `mask` that strokes begin with, `strokes` are those of the layer's mask. Tiles as they were before strokes may hold
    /// `budget` bytes.
    pub(super) fn new(
        stack: recipe::Prepared,
        (at, strokes, mask): (usize, &Strokes, Option<f32>),
        skin: Option<Arc<Skin>>,
        budget: usize,
        progress: &Progress<'_>,
    ) -> Result<Self> {
        let surface = stack.surface();
        let active = Active {
            at,
            surface,
            painting: Painting::new(&surface, strokes, skin.clone(), progress)?,
            skin,
            below: HashMap::new(),
            above: HashMap::new(),
            above_bytes: 0,
            looks_over: stack.looks_over(at),
            tiles: HashMap::new(),
            kept: Kept {
                budget,
                ..Kept::default()
            },
            mask: mask.map(|start| MaskOf {
                start,
                layer: HashMap::new(),
            }),
            live: None,
        };
        Ok(Self { stack, active })
    }
}

/// A layer whose mask is painted on. Then tiles hold the mask as their coverage, over a ground that means nothing.
struct MaskOf {
    /// The mask before the first stroke.
    start: f32,
    /// The layer without its mask, and what lies below it.
    layer: HashMap<u32, recipe::Unmasked>,
}

/// A stroke in flight.
struct Flight {
    live: Live,
    /// The tiles that it changed, as they are with it.
    tiles: HashMap<u32, Tile>,
    /// Where it has changed more since.
    behind: Parts,
}

/// Tiles as they were before and after strokes, as far as memory allows.
#[derive(Default)]
struct Kept {
    /// The tiles that each of the last strokes changed, as they were before it.
    before: VecDeque<Tiles>,
    /// The strokes that were taken back, the next to be done again last, and the tiles that each changed as they were after it.
    after: VecDeque<(Arc<Stroke>, Tiles)>,
    bytes: usize,
    budget: usize,
}

impl Kept {
    fn push_before(&mut self, tiles: Tiles) {
        self.bytes += bytes_of(&tiles);
        self.before.push_back(tiles);
        self.forget();
    }

    fn push_after(&mut self, stroke: Arc<Stroke>, tiles: Tiles) {
        self.bytes += bytes_of(&tiles);
        self.after.push_back((stroke, tiles));
        self.forget();
    }

    fn pop_before(&mut self) -> Option<Tiles> {
        let tiles = self.before.pop_back()?;
        self.bytes -= bytes_of(&tiles);
        Some(tiles)
    }

    /// The tiles after a stroke that is done again; after any other one nothing can be done again.
    fn pop_after(&mut self, stroke: &Arc<Stroke>) -> Option<Tiles> {
        if !matches!(self.after.back(), Some((last, _)) if Arc::ptr_eq(last, stroke)) {
            self.clear_after();
        }
        let (_, tiles) = self.after.pop_back()?;
        self.bytes -= bytes_of(&tiles);
        Some(tiles)
    }

    fn clear_after(&mut self) {
        let all = self.after.drain(..);
        self.bytes -= all.map(|(_, tiles)| bytes_of(&tiles)).sum::<usize>();
    }

    /// What is farthest from now goes first.
    fn forget(&mut self) {
        while self.bytes > self.budget {
            let oldest = if self.before.len() >= self.after.len() {
                self.before.pop_front()
            } else {
                self.after.pop_front().map(|(_, tiles)| tiles)
            };
            let Some(tiles) = oldest else { return };
            self.bytes -= bytes_of(&tiles);
        }
    }
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

    /// The number of the layer that is painted on, and whether it is its mask.
    pub(super) fn active(&self) -> Option<(usize, bool)> {
        self.active.as_ref().map(|a| (a.at, a.mask.is_some()))
    }

    /// Lets a layer be painted on from now on.
    pub(super) fn take_over(&mut self, ready: Ready) {
        self.stack = ready.stack;
        self.active = Some(ready.active);
    }

    /// How many strokes the layer that is painted on has.
    pub(super) fn strokes(&self) -> usize {
        self.active.as_ref().map_or(0, |a| a.painting.len())
    }

    /// Bytes of the tiles.
    pub(super) fn bytes(&self) -> usize {
        self.active.as_ref().map_or(0, |a| {
            let below = a.below.len() * (SIDE * SIDE * 16) as usize;
            let masked = a.mask.iter().flat_map(|m| m.layer.values());
            let masked: usize = masked.map(recipe::Unmasked::bytes).sum();
            bytes_of(&a.tiles) + below + masked + a.above_bytes + a.kept.bytes
        })
    }

    /// Whether strokes above the layer that is painted on look around themselves: what changes is then more than what was painted.
    pub(super) fn looks_over(&self) -> bool {
        self.active.as_ref().is_some_and(|a| a.looks_over)
    }

    /// The tiles that rectangles meet, each with the part of it that they do.
    pub(super) fn parts(&self, rects: &[Rect]) -> Parts {
        let mut parts = Parts::new();
        let size = self.stack.size();
        for rect in rects {
            for number in numbers(size.width().div_ceil(SIDE), *rect) {
                if let Some(part) = tile_of(number, size).intersection(*rect) {
                    let whole = parts.entry(number).or_insert(part);
                    *whole = whole.hull(part);
                }
            }
        }
        parts
    }

    /// The composite of parts of tiles as it is now, with the stroke in flight.
    pub(super) fn compose(&mut self, parts: &[(u32, Rect)]) -> Vec<Region> {
        let Self { stack, active } = self;
        let Some(active) = active else {
            let rects = parts.par_iter().map(|(_, rect)| *rect);
            return rects.map(|rect| stack.region(rect)).collect();
        };
        if active.looks_over && active.mask.is_none() {
            active.fly(stack, None);
            let parts = parts.iter().map(|(_, rect)| *rect);
            return parts
                .map(|rect| active.compose_around(stack, rect))
                .collect();
        }
        let all: Vec<u32> = parts.iter().map(|(number, _)| *number).collect();
        active.fly(stack, Some(&all));
        active.ensure_tiles(stack, &all, active.painting.len());
        active.ensure_above(stack, &all);
        active.ensure_unmasked(stack, &all);
        let parts = parts.par_iter();
        parts
            .map(|(number, part)| active.compose(stack, *number, *part))
            .collect()
    }

    /// How much of the layer that is painted on is seen in each texel of a rectangle, in row order, or what its mask holds where
    /// that is painted on; `None` when none is.
    pub(super) fn coverage(&mut self, rect: Rect) -> Option<Vec<f32>> {
        let active = self.active.as_mut()?;
        active.fly(&self.stack, None);
        active.ensure(&self.stack, rect, active.painting.len());
        let touched = active.touched(rect);
        Some(match active.mask {
            Some(_) => touched,
            None => self.stack.covered(active.at, rect, touched),
        })
    }

    /// A stroke more on the layer that is painted on: gives the rectangles outside which nothing changed.
    ///
    /// # Errors
    /// When the layer is full.
    pub(super) fn push(&mut self, stroke: &Arc<Stroke>) -> Result<Vec<Rect>> {
        let Some(active) = &mut self.active else {
            return Ok(Vec::new());
        };
        active.live = None;
        active.painting.push(stroke)?;
        let n = active.painting.len() - 1;
        if let Some(after) = active.kept.pop_after(stroke) {
            let rects = active.rects_of(&after);
            active.take_over(after);
            return Ok(rects);
        }
        let rects = active.painting.reached(n);
        let mut numbers: Vec<u32> = rects.iter().flat_map(|r| active.numbers(*r)).collect();
        numbers.sort_unstable();
        numbers.dedup();
        // The tiles as they were before it.
        active.ensure_tiles(&self.stack, &numbers, n);
        for number in &numbers {
            let reach = active.painting.needs_for(n..n + 1, active.rect_of(*number));
            active.ensure(&self.stack, reach, n);
        }
        let tiles: Tiles = numbers
            .into_par_iter()
            .map(|number| (number, active.with_one_more(number, n)))
            .collect();
        active.take_over(tiles);
        Ok(rects)
    }

    /// A stroke less.
    pub(super) fn pop(&mut self) -> Vec<Rect> {
        let Some(active) = &mut self.active else {
            return Vec::new();
        };
        let Some(n) = active.painting.len().checked_sub(1) else {
            return Vec::new();
        };
        let reached = active.painting.reached(n);
        let Some(stroke) = active.painting.pop() else {
            return Vec::new();
        };
        let Some(before) = active.kept.pop_before() else {
            // Forgotten: they are painted again when somebody looks.
            let numbers: Vec<u32> = reached.iter().flat_map(|r| active.numbers(*r)).collect();
            for number in numbers {
                active.tiles.remove(&number);
            }
            active.kept.clear_after();
            return reached;
        };
        let rects = active.rects_of(&before);
        let swap = before.into_iter().map(|(number, tile)| {
            let now = active.tiles.insert(number, tile);
            (number, now.expect("a tile that a stroke changed"))
        });
        let after = swap.collect();
        active.kept.push_after(stroke, after);
        rects
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
        self.active
            .as_ref()?
            .live
            .as_ref()
            .map(|flight| &flight.live)
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
            active.live = Some(Flight {
                live,
                tiles: HashMap::new(),
                behind: Parts::new(),
            });
        }
        Ok(())
    }

    /// Lets the stroke in flight go on; gives the rectangles outside which nothing changed. What it changes is made when somebody
    /// looks.
    pub(super) fn go_on(&mut self, push: impl FnOnce(&mut Live) -> Vec<Rect>) -> Vec<Rect> {
        let flight = self.active.as_mut().and_then(|a| a.live.as_mut());
        let dirty = flight.map_or_else(Vec::new, |f| push(&mut f.live));
        let parts = self.parts(&dirty);
        let flight = self.active.as_mut().and_then(|a| a.live.as_mut());
        if let Some(flight) = flight {
            add_parts(&mut flight.behind, &parts);
        }
        dirty
    }

    /// Ends the stroke in flight: when it painted anything it is the layer's last from now on, with the texels that it has.
    ///
    /// # Errors
    /// When the layer is full, with the rectangles that change as the stroke goes.
    pub(super) fn end(&mut self) -> Result<Option<Arc<Stroke>>, (Error, Vec<Rect>)> {
        let Some(active) = self.active.as_mut() else {
            return Ok(None);
        };
        active.fly(&self.stack, None);
        let Some(Flight { live, tiles, .. }) = active.live.take() else {
            return Ok(None);
        };
        let stroke = live.finish().filter(|_| !tiles.is_empty()).map(Arc::new);
        if let Some(stroke) = &stroke {
            if let Err(error) = active.painting.push(stroke) {
                return Err((error, tiles.keys().map(|n| active.rect_of(*n)).collect()));
            }
            active.kept.clear_after();
            let tiles = tiles.into_iter();
            active.take_over(tiles.map(|(n, t)| (n, Some(Arc::new(t)))).collect());
        }
        Ok(stroke)
    }

    /// Takes the stroke in flight away; gives the rectangles that change by it.
    pub(super) fn cancel(&mut self) -> Vec<Rect> {
        let Some(active) = &mut self.active else {
            return Vec::new();
        };
        let tiles = active.live.take().map_or_else(HashMap::new, |l| l.tiles);
        tiles.keys().map(|n| active.rect_of(*n)).collect()
    }
}

/// Adds parts of tiles to others.
pub(super) fn add_parts(to: &mut Parts, parts: &Parts) {
    for (number, part) in parts {
        let whole = to.entry(*number).or_insert(*part);
        *whole = whole.hull(*part);
    }
}

/// The numbers of the tiles that a rectangle meets, where so many lie side by side.
fn numbers(columns: u32, rect: Rect) -> Vec<u32> {
    let across = rect.x / SIDE..(rect.x + rect.width).div_ceil(SIDE);
    let down = rect.y / SIDE..(rect.y + rect.height).div_ceil(SIDE);
    down.flat_map(|y| across.clone().map(move |x| y * columns + x))
        .collect()
}

/// Where a tile of a map lies.
fn tile_of(number: u32, map: Size) -> Rect {
    let columns = map.width().div_ceil(SIDE);
    let tile = Rect {
        x: number % columns * SIDE,
        y: number / columns * SIDE,
        width: SIDE,
        height: SIDE,
    };
    tile.intersection(map.rect()).expect("a tile of the map")
}

fn bytes_of(tiles: &Tiles) -> usize {
    let of = |tile: &Option<Arc<Tile>>| tile.as_ref().map_or(16, |t| t.coverage.len() * 20);
    tiles.values().map(of).sum()
}

impl Active {
    fn numbers(&self, rect: Rect) -> Vec<u32> {
        numbers(self.surface.size.width().div_ceil(SIDE), rect)
    }

    fn rect_of(&self, number: u32) -> Rect {
        tile_of(number, self.surface.size)
    }

    fn rects_of(&self, tiles: &Tiles) -> Vec<Rect> {
        tiles.keys().map(|number| self.rect_of(*number)).collect()
    }

    /// Makes the tiles of a rectangle that are not there, as the first `n` strokes leave them.
    fn ensure(&mut self, stack: &recipe::Prepared, rect: Rect, n: usize) {
        self.ensure_tiles(stack, &self.numbers(rect), n);
    }

    /// Makes those of some tiles that are not there.
    fn ensure_tiles(&mut self, stack: &recipe::Prepared, numbers: &[u32], n: usize) {
        self.ensure_below(stack, numbers);
        let missing: Vec<u32> = numbers
            .iter()
            .copied()
            .filter(|number| !self.tiles.contains_key(number))
            .collect();
        for number in &missing {
            let rect = self.rect_of(*number);
            let reach = self.painting.needs_for(0..n, rect);
            if reach != rect {
                self.ensure_below(stack, &self.numbers(reach));
            }
        }
        let made: Vec<_> = missing
            .into_par_iter()
            .map(|number| (number, self.tile_from_nothing(number, n)))
            .collect();
        self.tiles.extend(made);
    }

    fn ensure_below(&mut self, stack: &recipe::Prepared, numbers: &[u32]) {
        let made: Vec<_> = numbers
            .par_iter()
            .filter(|number| !self.below.contains_key(number))
            .map(|number| {
                let mut region = Region::constant(self.rect_of(*number), DEFAULT_TEXEL);
                if self.mask.is_none() {
                    stack.fill_below(self.at, region.view_mut());
                }
                (*number, Arc::new(region))
            })
            .collect();
        self.below.extend(made);
    }

    /// Makes the layer without its mask in some tiles, where its mask is painted on.
    fn ensure_unmasked(&mut self, stack: &recipe::Prepared, numbers: &[u32]) {
        let Some(mask) = &self.mask else { return };
        let made: Vec<_> = numbers
            .par_iter()
            .filter(|number| !mask.layer.contains_key(number))
            .map(|number| (*number, stack.unmasked(self.at, self.rect_of(*number))))
            .collect();
        if let Some(mask) = &mut self.mask {
            // Made again when it is looked at again.
            if (mask.layer.len() + made.len()) * (SIDE * SIDE * 36) as usize > ABOVE_BYTES {
                let wanted: HashSet<u32> = numbers.iter().copied().collect();
                mask.layer.retain(|number, _| wanted.contains(number));
            }
            mask.layer.extend(made);
        }
    }

    /// Brings tiles up to date with the stroke in flight, or all.
    fn fly(&mut self, stack: &recipe::Prepared, numbers: Option<&[u32]>) {
        let Some(mut flight) = self.live.take() else {
            return;
        };
        let parts: Vec<(u32, Rect)> = match numbers {
            None => std::mem::take(&mut flight.behind).into_iter().collect(),
            Some(numbers) => {
                let parts = numbers.iter().filter_map(|n| flight.behind.remove_entry(n));
                parts.collect()
            }
        };
        let numbers: Vec<u32> = parts.iter().map(|(number, _)| *number).collect();
        self.ensure_tiles(stack, &numbers, self.painting.len());
        for (_, part) in &parts {
            let needs = flight.live.needs(*part);
            if needs != *part {
                self.ensure(stack, needs, self.painting.len());
            }
        }
        let old: Vec<_> = parts
            .into_iter()
            .map(|(number, part)| (number, part, flight.tiles.remove(&number)))
            .collect();
        let live = &flight.live;
        let new: Vec<_> = old
            .into_par_iter()
            .map(|(number, part, tile)| (number, self.in_flight(number, part, live, tile)))
            .collect();
        flight.tiles.extend(new);
        self.live = Some(flight);
    }

    /// What a tile that no stroke touched is covered.
    fn start(&self) -> f32 {
        self.mask.as_ref().map_or(0.0, |m| m.start)
    }

    /// Keeps what the layers above lay in some tiles, where memory allows it.
    fn ensure_above(&mut self, stack: &recipe::Prepared, numbers: &[u32]) {
        let each = stack.bytes_above(self.at) * (SIDE * SIDE) as usize;
        let missing = |a: &Self, number: &u32| !a.above.contains_key(number);
        let more = numbers.iter().filter(|n| missing(self, n)).count() * each;
        if each == 0 || more == 0 {
            return;
        }
        if self.above_bytes + more > ABOVE_BYTES {
            let wanted: HashSet<u32> = numbers.iter().copied().collect();
            self.above.retain(|number, _| wanted.contains(number));
            self.above_bytes = self.above.values().map(recipe::Above::bytes).sum();
        }
        let room = ABOVE_BYTES.saturating_sub(self.above_bytes) / each;
        let wanted: Vec<u32> = numbers
            .iter()
            .copied()
            .filter(|n| missing(self, n))
            .collect();
        let made: Vec<_> = wanted
            .into_par_iter()
            .take(room)
            .map(|number| (number, stack.above(self.at, self.rect_of(number))))
            .collect();
        self.above_bytes += made.iter().map(|(_, above)| above.bytes()).sum::<usize>();
        self.above.extend(made);
    }

    /// The composite of a part of a tile that is there.
    fn compose(&self, stack: &recipe::Prepared, number: u32, part: Rect) -> Region {
        let flying = self.live.as_ref().and_then(|f| f.tiles.get(&number));
        let tile = flying.or(self.tiles[&number].as_deref());
        let above = self.above.get(&number);
        if let Some(mask) = &self.mask {
            let cover = match tile {
                Some(tile) => crop_plane((self.rect_of(number), &tile.coverage), part),
                None => vec![mask.start; part.texels()],
            };
            return stack.fill_masked(self.at, &mask.layer[&number], &cover, part, above);
        }
        let below = &self.below[&number];
        let painted = tile.map_or(&**below, |tile| &tile.now);
        let mut whole = below.crop(part);
        stack.fill_over(self.at, painted, part, &mut whole, above);
        whole
    }

    /// The composite of a rectangle where strokes above look around themselves.
    fn compose_around(&mut self, stack: &recipe::Prepared, rect: Rect) -> Region {
        let needed = stack.needs_over(self.at, rect);
        self.ensure(stack, needed, self.painting.len());
        let (painted, _) = self.shown(needed);
        let mut whole = Region::constant(needed, DEFAULT_TEXEL);
        self.read_below(&mut whole);
        stack.fill_over(self.at, &painted, rect, &mut whole, None);
        whole.crop(rect)
    }

    /// Copies what lies below, which is there.
    fn read_below(&self, to: &mut Region) {
        for number in self.numbers(to.rect()) {
            to.copy_from(&self.below[&number]);
        }
    }

    /// The texels of a rectangle whose tiles are there, and their coverage.
    fn read(&self, rect: Rect) -> (Region, Vec<f32>) {
        let mut now = Region::constant(rect, DEFAULT_TEXEL);
        let mut coverage = vec![self.start(); rect.texels()];
        for number in self.numbers(rect) {
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
        if let Some(flight) = &self.live {
            let tiles = self.numbers(rect);
            for tile in tiles.iter().filter_map(|n| flight.tiles.get(n)) {
                now.copy_from(&tile.now);
                copy_plane((rect, &mut coverage), (tile.now.rect(), &tile.coverage));
            }
        }
        (now, coverage)
    }

    /// How much of each texel of a rectangle whose tiles are there strokes have touched, with the one in flight.
    fn touched(&self, rect: Rect) -> Vec<f32> {
        let mut touched = vec![self.start(); rect.texels()];
        for number in self.numbers(rect) {
            let in_flight = self.live.as_ref().and_then(|f| f.tiles.get(&number));
            if let Some(tile) = in_flight.or(self.tiles[&number].as_deref()) {
                copy_plane((rect, &mut touched), (tile.now.rect(), &tile.coverage));
            }
        }
        touched
    }

    /// A tile, as the stroke in flight left it if it has been there, with what it changes in `part`.
    fn in_flight(&self, number: u32, part: Rect, live: &Live, tile: Option<Tile>) -> Tile {
        let whole = self.rect_of(number);
        let below = &*self.below[&number];
        let stood = self.tiles[&number].as_deref();
        let mut tile = tile.or_else(|| stood.cloned()).unwrap_or_else(|| Tile {
            now: below.clone(),
            coverage: vec![self.start(); whole.texels()],
        });
        let needs = live.needs(part);
        let around = (needs != part).then(|| self.read(needs).0);
        let before = around.as_ref().or(stood.map(|t| &t.now)).unwrap_or(below);
        for y in part.y..part.y + part.height {
            let start = whole.index(part.x, y);
            let row = start..start + part.width as usize;
            match stood {
                Some(stood) => tile.coverage[row.clone()].copy_from_slice(&stood.coverage[row]),
                None => tile.coverage[row].fill(self.start()),
            }
        }
        live.apply(before, below, part, (&mut tile.now, &mut tile.coverage));
        tile
    }

    /// A tile after the first `n` strokes, with what lies below it there.
    fn tile_from_nothing(&self, number: u32, n: usize) -> Option<Arc<Tile>> {
        let rect = self.rect_of(number);
        if !self.painting.touches(n, rect) {
            return None;
        }
        let mut below = Region::constant(self.painting.needs_for(0..n, rect), DEFAULT_TEXEL);
        self.read_below(&mut below);
        let coverage = vec![self.start(); below.rect().texels()];
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
        let nobody = Progress::none();
        self.painting
            .paint(strokes, rect, below, &mut now, &mut coverage, &nobody)
            .expect("nobody cancels");
        let start = self.start();
        let untouched = now == *below && coverage.iter().all(|c| *c == start);
        (!untouched).then(|| {
            let coverage = crop_plane((now.rect(), &coverage), rect);
            let now = if now.rect() == rect {
                now
            } else {
                now.crop(rect)
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
        self.kept.push_before(before);
    }
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
