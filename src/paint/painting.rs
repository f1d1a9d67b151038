//! Many strokes on a surface, sorted into tiles so that a rectangle touches only the strokes that reach it.

use super::composite::{Planes, View, Work, apply};
use super::cover::{Cover, SPARE, Shape, Stamp, TILE, bounds};
use super::laid::{Ground, pieces};
use super::skin::Skin;
use super::smooth::Kernel;
use super::solid;
use super::trail::Piece;
use super::{Stroke, Strokes};
use crate::error::{Error, Result};
use crate::map::{DEFAULT_TEXEL, Rect, Region};
use crate::pattern::Surface;
use crate::progress::Progress;
use glam::{IVec2, Vec2, Vec3};
use rayon::prelude::*;
use std::ops::Range;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

/// Strokes prepared for one surface. Strokes are added and taken away at the end in time that depends on their own length alone.
pub struct Painting {
    ground: Ground,
    skin: Option<Arc<Skin>>,
    columns: u32,
    strokes: Vec<Laid>,
    /// For each tile the pieces that may touch it, in the order of their strokes.
    tiles: Vec<Vec<Entry>>,
    /// The strokes that work everywhere, which no tile lists.
    everywhere: Vec<u32>,
    /// The strokes that look around themselves.
    looking: Vec<u32>,
    most: Limits,
    /// How much more it may hold.
    free: Limits,
}

/// A stroke with its pieces.
struct Laid {
    stroke: Arc<Stroke>,
    work: Work,
    shape: Shape,
    pieces: Vec<Piece<Vec2>>,
    solid: Vec<Piece<Vec3>>,
    /// All texels that it may change, in one rectangle; `None` where it changes none.
    bounds: Option<Rect>,
}

/// Some pieces of a stroke, moved by whole periods.
#[derive(Clone, Copy)]
struct Entry {
    stroke: u32,
    first: u32,
    end: u32,
    period: (i8, i8),
}

/// A stroke that looks around itself, and where that matters.
struct Look {
    stroke: usize,
    /// What must be known before it.
    before: Rect,
    /// What of it is needed after it.
    touched: Rect,
}

/// The most pieces of a painting: a gigabyte of them.
const PIECES_MAX: usize = 1 << 24;
/// The most entries of a painting, all tiles together: a gigabyte of them.
const ENTRIES_MAX: usize = 1 << 26;
/// Strokes that are painted in a tile until it is asked whether to go on: a millisecond's work.
const RUNS: usize = 64;
/// Tiles that are visited until it is asked whether to go on.
const VISITS: usize = 1 << 14;
/// Pieces of a stroke that touch one tile are told as one run when no more than this lie between them.
const GAP: u32 = 32;

impl Laid {
    fn new(stroke: &Arc<Stroke>, ground: &Ground, skin: Option<&Skin>) -> Self {
        let brush = stroke.brush();
        let (shape, solid) = match skin.filter(|_| stroke.is_on_mesh()) {
            Some(skin) => {
                let scaled = brush.scaled(skin.scale());
                let pieces = solid::pieces(stroke, &scaled, skin.middle());
                (solid::shape(&scaled, skin), pieces)
            }
            None => (ground.shape(brush), Vec::new()),
        };
        Self {
            stroke: Arc::clone(stroke),
            work: Work::of(&brush.tool),
            shape,
            pieces: pieces(stroke, ground),
            solid,
            bounds: None,
        }
    }

    fn weight(&self) -> usize {
        self.pieces.len() + self.solid.len()
    }

    fn looks(&self) -> bool {
        self.stroke.brush().tool.reach() > 0.0
    }

    fn is_everywhere(&self) -> bool {
        self.stroke.brush().tool.is_everywhere()
    }
}

/// What a painting may hold.
#[derive(Clone, Copy)]
pub(super) struct Limits {
    pub(super) pieces: usize,
    pub(super) entries: usize,
}

impl Limits {
    const USUAL: Self = Self {
        pieces: PIECES_MAX,
        entries: ENTRIES_MAX,
    };
}

/// How many more entries there may be, and who is asked whether to go on.
struct Allowance<'a> {
    entries: usize,
    most: usize,
    visits: usize,
    progress: &'a Progress<'a>,
}

impl<'a> Allowance<'a> {
    fn new(entries: usize, most: usize, progress: &'a Progress<'a>) -> Self {
        Self {
            entries,
            most,
            visits: 0,
            progress,
        }
    }

    /// Counts tiles that are visited, or as much work, and asks now and then.
    fn visit(&mut self, tiles: usize) -> Result<()> {
        self.visits += tiles;
        if self.visits >= VISITS {
            self.visits = 0;
            self.progress.check()?;
        }
        Ok(())
    }

    /// Adds a piece to a tile's list: to the last run, when it goes on there.
    fn add(&mut self, entries: &mut Vec<Entry>, new: Entry) -> Result<()> {
        self.visit(1)?;
        if let Some(last) = entries.last_mut().filter(|last| last.is_before(&new)) {
            last.end = new.end;
            return Ok(());
        }
        self.entries = match self.entries.checked_sub(1) {
            Some(left) => left,
            None => return Err(too_many_entries(self.most)),
        };
        entries.push(new);
        Ok(())
    }
}

impl Entry {
    /// Whether another one goes on where it ends, or little after it.
    fn is_before(&self, next: &Self) -> bool {
        (self.stroke, self.period) == (next.stroke, next.period) && next.first <= self.end + GAP
    }
}

fn too_many_entries(most: usize) -> Error {
    let value = format!(
        "more than {most} tiles of {TILE} x {TILE} texels, each counted for every stroke that reaches it"
    );
    Error::invalid(
        "",
        value,
        "allowed: at most that many in a layer, strokes that come back from beyond an edge included",
    )
    .with_hint(
        "Make the map smaller or the brushes narrower, or spread the strokes over several layers",
    )
}

fn too_many_pieces(most: usize) -> Error {
    let value = format!("more than {most} lines, dabs and scratches");
    Error::invalid("", value, "allowed: at most that many in a layer").with_hint(
        "Space the dabs wider, make fewer copies, or spread the strokes over several layers",
    )
}

impl Painting {
    /// A painting of all strokes of a layer. Strokes on the mesh need it, as the surface lies on it; without they paint nothing.
    ///
    /// # Errors
    /// When the strokes fall into more than 16,777,216 lines, dabs and scratches, copies included, or reach more than 67,108,864
    /// tiles of 64 x 64 texels, each counted once for each stroke that reaches it, and for each repetition of the stroke
    /// beyond an edge that does: [`Error::Invalid`] whose `what` is empty. [`Error::Cancelled`] when `progress`, which is asked
    /// now and then, says so.
    pub fn new(
        surface: &Surface,
        strokes: &Strokes,
        skin: Option<Arc<Skin>>,
        progress: &Progress<'_>,
    ) -> Result<Self> {
        Self::within(Limits::USUAL, surface, strokes, skin, progress)
    }

    /// As [`Painting::new`], with other limits.
    pub(super) fn within(
        most: Limits,
        surface: &Surface,
        strokes: &Strokes,
        skin: Option<Arc<Skin>>,
        progress: &Progress<'_>,
    ) -> Result<Self> {
        let ground = Ground::new(surface);
        let size = surface.size;
        let mut painting = Self {
            ground,
            skin,
            columns: size.width().div_ceil(TILE),
            strokes: Vec::with_capacity(strokes.strokes.len()),
            tiles: vec![
                Vec::new();
                (size.width().div_ceil(TILE) * size.height().div_ceil(TILE)) as usize
            ],
            everywhere: Vec::new(),
            looking: Vec::new(),
            most,
            free: most,
        };
        let weight = AtomicUsize::new(0);
        let mut room = Allowance::new(most.entries, most.entries, progress);
        for some in strokes.strokes.chunks(4096) {
            progress.check()?;
            let skin = painting.skin.as_deref();
            let lay = |stroke| {
                let laid = Laid::new(stroke, &ground, skin);
                let before = weight.fetch_add(laid.weight(), Ordering::Relaxed);
                (before + laid.weight() <= most.pieces).then_some(laid)
            };
            let laid: Option<Vec<Laid>> = some.par_iter().map(lay).collect();
            let laid = laid.ok_or_else(|| too_many_pieces(most.pieces))?;
            for one in laid {
                painting.sort_in(one, &mut room)?;
            }
        }
        painting.free = Limits {
            pieces: most.pieces - weight.into_inner(),
            entries: room.entries,
        };
        Ok(painting)
    }

    /// How many entries all tiles have.
    #[cfg(test)]
    pub(super) fn entries(&self) -> usize {
        self.tiles.iter().map(Vec::len).sum()
    }

    /// How many strokes.
    pub fn len(&self) -> usize {
        self.strokes.len()
    }

    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.strokes.is_empty()
    }

    /// The nth stroke.
    ///
    /// # Panics
    /// When there are not that many.
    pub fn stroke(&self, n: usize) -> &Arc<Stroke> {
        &self.strokes[n].stroke
    }

    /// All texels that the nth stroke may change; `None` where it changes none.
    ///
    /// # Panics
    /// When there are not that many.
    pub fn bounds(&self, n: usize) -> Option<Rect> {
        self.strokes[n].bounds
    }

    /// Rectangles that hold all texels that the nth stroke may change, and less than its bounds do.
    ///
    /// # Panics
    /// When there are not that many.
    pub fn reached(&self, n: usize) -> Vec<Rect> {
        let laid = &self.strokes[n];
        let Some(bounds) = laid.bounds else {
            return Vec::new();
        };
        let number = n as u32;
        let has = |tile: &usize| {
            if laid.is_everywhere() {
                return true;
            }
            let entries = &self.tiles[*tile];
            let from = entries.partition_point(|e| e.stroke < number);
            entries.get(from).is_some_and(|e| e.stroke == number)
        };
        let tiles = self.tiles_of(bounds).filter(has);
        tiles.map(|tile| self.rect_of(tile)).collect()
    }

    /// Whether any of the first `n` strokes may change texels of a rectangle.
    pub fn touches(&self, n: usize, rect: Rect) -> bool {
        let is_one = |first: Option<u32>| first.is_some_and(|stroke| (stroke as usize) < n);
        let mut tiles = self.tiles_of(rect).map(|tile| &self.tiles[tile]);
        is_one(self.everywhere.first().copied())
            || tiles.any(|entries| is_one(entries.first().map(|e| e.stroke)))
    }

    /// Adds a stroke at the end.
    ///
    /// # Errors
    /// When there would be more of the strokes than [`Painting::new`] takes; nothing is added then.
    pub fn push(&mut self, stroke: &Arc<Stroke>) -> Result<()> {
        let laid = Laid::new(stroke, &self.ground, self.skin.as_deref());
        let Some(pieces) = self.free.pieces.checked_sub(laid.weight()) else {
            return Err(too_many_pieces(self.most.pieces));
        };
        let nobody = Progress::none();
        let mut room = Allowance::new(self.free.entries, self.most.entries, &nobody);
        if let Err(error) = self.sort_in(laid, &mut room) {
            self.unlist(self.ground.grid.whole());
            return Err(error);
        }
        let entries = room.entries;
        self.free = Limits { pieces, entries };
        Ok(())
    }

    /// Takes the last stroke away.
    pub fn pop(&mut self) -> Option<Arc<Stroke>> {
        let last = self.strokes.pop()?;
        self.free.pieces += last.weight();
        if let Some(bounds) = last.bounds {
            self.free.entries += self.unlist(bounds);
        }
        Some(last.stroke)
    }

    /// Takes what is not among the strokes out of the lists, its entries out of those of the tiles that a rectangle meets; gives
    /// how many these were.
    fn unlist(&mut self, rect: Rect) -> usize {
        let number = self.strokes.len() as u32;
        for list in [&mut self.everywhere, &mut self.looking] {
            list.truncate(list.partition_point(|n| *n < number));
        }
        let mut gone = 0;
        for tile in self.tiles_of(rect) {
            let entries = &mut self.tiles[tile];
            let kept = entries.partition_point(|e| e.stroke < number);
            gone += entries.len() - kept;
            entries.truncate(kept);
        }
        gone
    }

    /// The numbers of the tiles that a rectangle meets.
    fn tiles_of(&self, rect: Rect) -> impl Iterator<Item = usize> + use<> {
        let columns = self.columns;
        let across = rect.x / TILE..(rect.x + rect.width).div_ceil(TILE);
        let down = rect.y / TILE..(rect.y + rect.height).div_ceil(TILE);
        down.flat_map(move |y| across.clone().map(move |x| (y * columns + x) as usize))
    }

    fn sort_in(&mut self, mut laid: Laid, room: &mut Allowance<'_>) -> Result<()> {
        let number = self.strokes.len() as u32;
        if laid.is_everywhere() {
            laid.bounds = Some(self.ground.grid.whole());
            self.everywhere.push(number);
        }
        self.sort_flat(number, &mut laid, room)?;
        self.sort_solid(number, &mut laid, room)?;
        if laid.looks() && laid.bounds.is_some() {
            self.looking.push(number);
        }
        self.strokes.push(laid);
        Ok(())
    }

    /// Enters the pieces in UV, period by period: so what goes on in a tile follows what it goes on from.
    fn sort_flat(&mut self, stroke: u32, laid: &mut Laid, room: &mut Allowance<'_>) -> Result<()> {
        let Laid {
            pieces,
            shape,
            bounds: all,
            ..
        } = laid;
        let boxes = pieces.iter().map(|piece| bounds(piece, shape));
        let Some((low, high)) = boxes.reduce(|a, b| (a.0.min(b.0), a.1.max(b.1))) else {
            return Ok(());
        };
        let ground = self.ground;
        for period in ground.periods(low, high) {
            let shift = ground.shift(period);
            for (n, piece) in (0..).zip(pieces.iter()) {
                room.visit(1)?;
                let (low, high) = bounds(piece, shape);
                let Some(rect) = ground.grid.cover(low + shift, high + shift) else {
                    continue;
                };
                *all = Some(all.map_or(rect, |all| all.hull(rect)));
                let entry = Entry {
                    stroke,
                    first: n,
                    end: n + 1,
                    period,
                };
                let stamp = Stamp::new(piece, shift);
                sort_piece(&stamp, shape, &ground, rect, |x, y| {
                    room.add(&mut self.tiles[(y * self.columns + x) as usize], entry)
                })?;
            }
        }
        Ok(())
    }

    /// Enters the pieces on the mesh.
    fn sort_solid(&mut self, stroke: u32, laid: &mut Laid, room: &mut Allowance<'_>) -> Result<()> {
        for (n, piece) in (0..).zip(&laid.solid) {
            let skin = self.skin.as_deref().expect("solid pieces come of one");
            // Looking a place up in the mesh takes as long as many tiles.
            room.visit(VISITS / 16)?;
            for (tile, rect) in solid::touched(piece, &laid.shape, skin) {
                laid.bounds = Some(laid.bounds.map_or(rect, |b| b.hull(rect)));
                let entry = Entry {
                    stroke,
                    first: n,
                    end: n + 1,
                    period: (0, 0),
                };
                room.add(&mut self.tiles[tile as usize], entry)?;
            }
        }
        Ok(())
    }

    /// The rectangle that must be known below the layer for `rect` to be painted: larger where a stroke looks around itself.
    /// Beyond an edge where the map repeats that is the map's whole width or height.
    pub fn needs(&self, rect: Rect) -> Rect {
        self.needs_for(0..self.len(), rect)
    }

    /// The same for a range of strokes, over what those before it left.
    pub fn needs_for(&self, range: Range<usize>, rect: Rect) -> Rect {
        self.needed(range, rect).first().map_or(rect, |n| n.before)
    }

    /// Whether any stroke that looks around itself reaches a rectangle.
    pub fn looks(&self, rect: Rect) -> bool {
        self.looking.iter().any(|n| {
            let bounds = self.strokes[*n as usize].bounds;
            bounds.is_some_and(|b| b.intersection(rect).is_some())
        })
    }

    /// The looking strokes of a range that matter for `rect`, first to last.
    fn needed(&self, range: Range<usize>, rect: Rect) -> Vec<Look> {
        let mut needed = rect;
        let mut found = Vec::new();
        for n in self.looking.iter().rev().map(|n| *n as usize) {
            let laid = &self.strokes[n];
            if !range.contains(&n) {
                continue;
            }
            let Some(touched) = laid.bounds.and_then(|b| b.intersection(needed)) else {
                continue;
            };
            let before = needed.hull(self.kernel(laid).grown(touched));
            found.push(Look {
                stroke: n,
                before,
                touched,
            });
            needed = before;
        }
        found.reverse();
        found
    }

    fn kernel(&self, laid: &Laid) -> Kernel {
        Kernel::new(laid.stroke.brush().tool.reach(), &self.ground)
    }

    /// Paints a range of strokes over what is there. `now` holds the texels before them and gets those after, `coverage` likewise;
    /// both in the rectangle of `below`, which holds what lies below the layer. What is right afterwards is `rect`; the
    /// rectangle of the regions is [`Painting::needs`] of it or more. Every few strokes `progress` is asked whether to go on.
    ///
    /// # Errors
    /// [`Error::Cancelled`] when `progress` says so; what is in `now` and `coverage` then means nothing.
    ///
    /// # Panics
    /// When the regions are of different rectangles, or do not hold what `rect` needs.
    pub fn paint(
        &self,
        range: Range<usize>,
        rect: Rect,
        below: &Region,
        now: &mut Region,
        coverage: &mut [f32],
        progress: &Progress<'_>,
    ) -> Result<()> {
        let all = below.rect();
        let looking = self.needed(range.clone(), rect);
        let first = looking.first().map_or(rect, |n| n.before);
        assert!(
            all == now.rect()
                && coverage.len() == all.texels()
                && all.intersection(first) == Some(first),
            "{all:?} must be one rectangle that holds {first:?}"
        );
        let mut view = View::of(now, below, coverage);
        let mut done = range.start;
        for look in looking {
            self.plain(done..look.stroke, look.before, view.reborrow(), progress)?;
            progress.check()?;
            self.smooth(&look, &mut view);
            done = look.stroke + 1;
        }
        self.plain(done..range.end, rect, view, progress)
    }

    /// How much of each texel of a rectangle the strokes have touched, in row order: goes on from what `coverage` holds. Every
    /// few strokes `progress` is asked whether to go on.
    ///
    /// # Errors
    /// [`Error::Cancelled`] when `progress` says so; what is in `coverage` then means nothing.
    ///
    /// # Panics
    /// When `coverage` is of another length.
    pub fn cover(&self, rect: Rect, coverage: &mut [f32], progress: &Progress<'_>) -> Result<()> {
        assert_eq!(coverage.len(), rect.texels(), "a number for each texel");
        if !self.touches(self.len(), rect) {
            return Ok(());
        }
        // Coverage does not depend on what is painted over, nor on what a stroke sees around itself.
        let ground = Region::constant(rect, DEFAULT_TEXEL);
        let mut now = ground.clone();
        let mut view = View::of(&mut now, &ground, coverage);
        let mut covered = Cover::new(IVec2::ZERO, true);
        for tile in self.tiles_of(rect) {
            let Some(part) = self.rect_of(tile).intersection(rect) else {
                continue;
            };
            for (n, (laid, run)) in (1..).zip(self.runs(tile, 0..self.len())) {
                if n % RUNS == 0 {
                    progress.check()?;
                }
                self.cover_tile(laid, run, tile, part, &mut covered);
                if !covered.is_empty() {
                    let below = view.below;
                    apply(laid.work, &covered, part, &mut view, below);
                }
            }
        }
        Ok(())
    }

    /// Strokes that need each texel alone, band by band and tile by tile.
    fn plain(
        &self,
        range: Range<usize>,
        rect: Rect,
        view: View<'_>,
        progress: &Progress<'_>,
    ) -> Result<()> {
        if range.is_empty() {
            return Ok(());
        }
        let work = |(band, mut view): (Rect, View<'_>), cover: &mut Cover| {
            let mut tiles = self.tiles_of(band);
            tiles.try_for_each(|tile| {
                let runs = self.runs(tile, range.clone());
                self.tile((tile, runs), band, &mut view, cover, progress)
            })
        };
        let bands = view.bands(rect);
        if bands.len() == 1 {
            let mut cover = Cover::new(IVec2::ZERO, true);
            let mut bands = bands.into_iter();
            bands.try_for_each(|band| work(band, &mut cover))
        } else {
            bands.into_par_iter().try_for_each_init(
                || Cover::new(IVec2::ZERO, true),
                |cover, band| work(band, cover),
            )
        }
    }

    /// The strokes of one tile in the rows of a band.
    fn tile<'a>(
        &'a self,
        (tile, runs): (usize, impl Iterator<Item = (&'a Laid, &'a [Entry])>),
        band: Rect,
        view: &mut View<'_>,
        cover: &mut Cover,
        progress: &Progress<'_>,
    ) -> Result<()> {
        let Some(rect) = self.rect_of(tile).intersection(band) else {
            return Ok(());
        };
        for (n, (laid, run)) in (1..).zip(runs) {
            if n % RUNS == 0 {
                progress.check()?;
            }
            if laid.looks() {
                continue; // it has its turn in `paint`
            }
            self.cover_tile(laid, run, tile, rect, cover);
            if !cover.is_empty() {
                let below = view.below;
                apply(laid.work, cover, rect, view, below);
            }
        }
        Ok(())
    }

    /// The strokes of a range that may touch a tile, in their order, each with its entries there: none of one that works everywhere.
    fn runs(&self, tile: usize, range: Range<usize>) -> impl Iterator<Item = (&Laid, &[Entry])> {
        let entries = within(&self.tiles[tile], &range, |e| e.stroke);
        let mut here = entries.chunk_by(|a, b| a.stroke == b.stroke).peekable();
        let mut everywhere = within(&self.everywhere, &range, |n| *n).iter().peekable();
        std::iter::from_fn(move || {
            let next = here.peek().map_or(u32::MAX, |run| run[0].stroke);
            let (n, run): (u32, &[Entry]) = match everywhere.next_if(|n| **n < next) {
                Some(n) => (*n, &[]),
                None => (next, here.next()?),
            };
            Some((&self.strokes[n as usize], run))
        })
    }

    fn rect_of(&self, tile: usize) -> Rect {
        let (x, y) = (tile as u32 % self.columns, tile as u32 / self.columns);
        Rect {
            x: x * TILE,
            y: y * TILE,
            width: TILE.min(self.ground.grid.width - x * TILE),
            height: TILE.min(self.ground.grid.height - y * TILE),
        }
    }

    /// What a stroke covers in the part `rect` of a tile.
    fn cover_tile(&self, laid: &Laid, run: &[Entry], tile: usize, rect: Rect, cover: &mut Cover) {
        let whole = self.rect_of(tile);
        cover.clear(IVec2::new(whole.x as i32, whole.y as i32));
        if laid.is_everywhere() {
            cover.fill(laid.stroke.brush().flow);
            return;
        }
        if !laid.solid.is_empty() {
            let skin = self.skin.as_deref().expect("solid pieces come of one");
            let places = skin.places((whole.x / TILE, whole.y / TILE));
            for entry in run {
                for piece in &laid.solid[entry.first as usize..entry.end as usize] {
                    solid::add(cover, piece, &laid.shape, &places);
                }
            }
        }
        for entry in run.iter().filter(|_| laid.solid.is_empty()) {
            let shift = self.ground.shift(entry.period);
            for piece in &laid.pieces[entry.first as usize..entry.end as usize] {
                cover.add(piece, shift, &laid.shape, &self.ground.grid, rect);
            }
        }
    }

    /// A stroke that looks around itself: everything it sees is as it was before it.
    fn smooth(&self, look: &Look, view: &mut View<'_>) {
        let (n, touched) = (look.stroke, look.touched);
        let laid = &self.strokes[n];
        let now = Planes {
            rect: view.rect,
            planes: view.now.each_ref().map(|p| &**p),
        };
        let kernel = self.kernel(laid);
        let skin = self.skin.as_ref().filter(|_| laid.stroke.is_on_mesh());
        let mean = match skin {
            Some(skin) => kernel.mean_apart(touched, &now, |rect| skin.charts(rect)),
            None => kernel.mean(touched, &now),
        };
        let mut cover = Cover::new(IVec2::ZERO, true);
        for tile in self.tiles_of(touched) {
            let (Some(part), entries) =
                (self.rect_of(tile).intersection(touched), &self.tiles[tile])
            else {
                continue;
            };
            let from = entries.partition_point(|e| (e.stroke as usize) < n);
            let to = entries.partition_point(|e| e.stroke as usize <= n);
            self.cover_tile(laid, &entries[from..to], tile, part, &mut cover);
            apply(laid.work, &cover, part, view, mean.planes());
        }
    }
}

/// What a list in the order of strokes has of a range of them.
fn within<'a, T>(all: &'a [T], range: &Range<usize>, stroke: impl Fn(&T) -> u32) -> &'a [T] {
    let from = all.partition_point(|x| (stroke(x) as usize) < range.start);
    let to = all.partition_point(|x| (stroke(x) as usize) < range.end);
    &all[from..to.max(from)]
}

/// Calls `visit(column, row)` for the tiles of `rect` that a piece may touch: fewer than its box has where it lies aslant.
fn sort_piece(
    stamp: &Stamp,
    shape: &Shape,
    ground: &Ground,
    rect: Rect,
    mut visit: impl FnMut(u32, u32) -> Result<()>,
) -> Result<()> {
    let grid = &ground.grid;
    let reach = stamp.reach(shape) + 2.0 * SPARE * shape.texel;
    let right_most = rect.x + rect.width - 1;
    for y in rect.y / TILE..(rect.y + rect.height).div_ceil(TILE) {
        let (top, bottom) = (grid.y(y * TILE), grid.y(y * TILE + TILE - 1));
        let Some((left, right)) = stamp.span(bottom, top, reach) else {
            continue;
        };
        let column = |x: f32| ((x / grid.texel.x).max(0.0) as u32).clamp(rect.x, right_most) / TILE;
        // A texel to spare on both sides.
        for x in column(left - grid.texel.x)..=column(right + grid.texel.x) {
            visit(x, y)?;
        }
    }
    Ok(())
}
