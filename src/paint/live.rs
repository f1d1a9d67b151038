//! A stroke while it is being made: each point costs what it touches, and what is seen is what the finished stroke gives.

use super::composite::{Planes, View, Work, apply};
use super::cover::{Cover, Shape, TILE};
use super::laid::{Copies, Ground};
use super::painting::hull;
use super::smooth::Kernel;
use super::trail::{Piece, Trail};
use super::{Brush, POINTS_MAX, Point, Points, Stroke};
use crate::error::Result;
use crate::map::{Rect, Region};
use crate::pattern::Surface;
use glam::{IVec2, Vec2};
use rayon::prelude::*;
use std::collections::HashMap;
use std::sync::Arc;

/// A stroke in the making.
///
/// An editor keeps the texels as they were before the stroke. After each [`Live::push`] it calls [`Live::apply`] for the
/// rectangles that the push returned; all others stay as they are. [`Live::finish`] gives the stroke for the document.
pub struct Live {
    ground: Ground,
    brush: Arc<Brush>,
    seed: u32,
    shape: Shape,
    points: Vec<Point>,
    trail: Trail<Vec2>,
    copies: Copies,
    /// What the pieces cover that will not change any more, by tile.
    tiles: HashMap<(u32, u32), Cover>,
    /// The pieces after those, of a stroke that ends here.
    tail: Vec<Piece<Vec2>>,
}

impl Live {
    /// A stroke in UV without points yet.
    ///
    /// # Errors
    /// When the brush does not check.
    pub fn new(brush: Arc<Brush>, seed: u32, surface: &Surface) -> Result<Self> {
        brush.check()?;
        let ground = Ground::new(surface);
        Ok(Self {
            shape: ground.shape(&brush),
            trail: Trail::new(&brush, seed),
            copies: Copies::new(&brush.symmetry, ground.grid.extent),
            ground,
            brush,
            seed,
            points: Vec::new(),
            tiles: HashMap::new(),
            tail: Vec::new(),
        })
    }

    /// What it paints with.
    pub fn brush(&self) -> &Arc<Brush> {
        &self.brush
    }

    /// How many points it has.
    pub fn len(&self) -> usize {
        self.points.len()
    }

    /// Whether it has no point yet.
    pub fn is_empty(&self) -> bool {
        self.points.is_empty()
    }

    /// Whether it takes no more points ([`POINTS_MAX`]): time to finish it and begin another at the same place.
    pub fn is_full(&self) -> bool {
        self.points.len() >= POINTS_MAX
    }

    /// The stroke goes on to a point. The rectangles in which something changes; they may overlap.
    pub fn push(&mut self, point: Point) -> Vec<Rect> {
        if self.is_full() {
            return Vec::new();
        }
        let mut dirty = Dirty::default();
        if self.brush.tool.is_everywhere() {
            if self.points.is_empty() {
                dirty.add(self.whole());
            }
            Points::add_uv(&mut self.points, point);
            return dirty.0;
        }
        let before = self.points.last().copied();
        Points::add_uv(&mut self.points, point);
        if before == self.points.last().copied() {
            return Vec::new(); // nothing new
        }
        self.mark_tail(&mut dirty);
        let last = self.points[self.points.len() - 1];
        let node = self.ground.node(&self.brush, last);
        if before.is_some_and(|b| (b.x, b.y) == (last.x, last.y)) {
            self.trail.press(node.radius, node.flow);
        } else {
            let mut done = Vec::new();
            let copies = &self.copies;
            self.trail.push(node, |p| copies.each(p, |p| done.push(p)));
            for piece in &done {
                self.settle(piece, &mut dirty);
            }
        }
        self.tail.clear();
        let (copies, tail) = (&self.copies, &mut self.tail);
        self.trail.tail(|p| copies.each(p, |p| tail.push(p)));
        self.mark_tail(&mut dirty);
        dirty.0
    }

    /// Adds a piece that is final to the tiles.
    fn settle(&mut self, piece: &Piece<Vec2>, dirty: &mut Dirty) {
        let Self {
            ground,
            shape,
            tiles,
            ..
        } = self;
        ground.rects(piece, shape, |rect, period| {
            dirty.add(rect);
            for (place, part) in tiles_of(rect) {
                let tile = tiles
                    .entry(place)
                    .or_insert_with(|| Cover::new(origin(place)));
                tile.add(piece, ground.shift(period), shape, &ground.grid, part);
            }
        });
    }

    fn mark_tail(&self, dirty: &mut Dirty) {
        for piece in &self.tail {
            self.ground
                .rects(piece, &self.shape, |rect, _| dirty.add(rect));
        }
    }

    fn whole(&self) -> Rect {
        Rect {
            x: 0,
            y: 0,
            width: self.ground.grid.width,
            height: self.ground.grid.height,
        }
    }

    /// The rectangle of the texels before the stroke that [`Live::apply`] needs for `rect`: larger for a brush that looks around
    /// itself; past an edge where the map repeats, all there is.
    pub fn needs(&self, rect: Rect) -> Rect {
        match self.kernel() {
            Some(kernel) => hull(rect, kernel.grown(rect)),
            None => rect,
        }
    }

    fn kernel(&self) -> Option<Kernel> {
        let reach = self.brush.tool.reach();
        (reach > 0.0).then(|| Kernel::new(reach, &self.ground))
    }

    /// The texels of `now`'s rectangle with the stroke so far over those of `before`, which holds [`Live::needs`] of it. `below`
    /// is what lies below the layer, and holds it too. `coverage` is that of `now`'s rectangle before the stroke, and becomes that
    /// with it.
    ///
    /// # Panics
    /// When a region does not hold what it must, or coverage is of another length.
    pub fn apply(&self, before: &Region, below: &Region, now: &mut Region, coverage: &mut [f32]) {
        let rect = now.rect();
        let needs = self.needs(rect);
        assert!(
            before.rect().intersection(needs) == Some(needs)
                && below.rect().intersection(rect) == Some(rect)
                && coverage.len() == rect.texels(),
            "{:?} and {:?} must hold {needs:?} and {rect:?}",
            before.rect(),
            below.rect()
        );
        now.copy_from(before);
        let mean = self
            .kernel()
            .map(|kernel| kernel.mean(rect, &Planes::of(before)));
        let toward = mean.as_ref().map_or(Planes::of(below), |m| m.planes());
        let work = Work::of(&self.brush.tool);
        let bands = View::of(now, below, coverage).bands(rect);
        bands.into_par_iter().for_each_init(
            || Cover::new(IVec2::ZERO),
            |cover, (band, mut view)| {
                for (place, part) in tiles_of(band) {
                    self.cover(place, part, cover);
                    if !cover.is_empty() {
                        apply(work, cover, part, &mut view, toward);
                    }
                }
            },
        );
    }

    /// What the stroke so far covers in a part of a tile.
    fn cover(&self, place: (u32, u32), part: Rect, cover: &mut Cover) {
        match self.tiles.get(&place) {
            Some(settled) => cover.copy_from(settled),
            None => cover.clear(origin(place)),
        }
        if self.brush.tool.is_everywhere() && !self.points.is_empty() {
            cover.fill(self.brush.flow);
        }
        for piece in &self.tail {
            self.ground.rects(piece, &self.shape, |rect, period| {
                if rect.intersection(part).is_some() {
                    let shift = self.ground.shift(period);
                    cover.add(piece, shift, &self.shape, &self.ground.grid, part);
                }
            });
        }
    }

    /// The finished stroke; `None` when it paints nothing: there was no point, or only one of a tool that follows the stroke.
    pub fn finish(self) -> Option<Stroke> {
        let least = if self.brush.tool.follows_stroke() {
            2
        } else {
            1
        };
        if self.points.len() < least {
            return None;
        }
        let points = Points::Uv(self.points);
        Some(Stroke::from_parts(self.brush, self.seed, points).expect("within the limits by push"))
    }
}

fn origin((x, y): (u32, u32)) -> IVec2 {
    IVec2::new((x * TILE) as i32, (y * TILE) as i32)
}

/// The tiles that a rectangle meets, by column and row, each with what they have in common.
fn tiles_of(rect: Rect) -> impl Iterator<Item = ((u32, u32), Rect)> {
    let across = rect.x / TILE..(rect.x + rect.width).div_ceil(TILE);
    let down = rect.y / TILE..(rect.y + rect.height).div_ceil(TILE);
    down.flat_map(move |y| across.clone().map(move |x| (x, y)))
        .filter_map(move |(x, y)| {
            let tile = Rect {
                x: x * TILE,
                y: y * TILE,
                width: TILE,
                height: TILE,
            };
            Some(((x, y), tile.intersection(rect)?))
        })
}

/// Rectangles that changed: few, and together not much larger than what did.
#[derive(Default)]
struct Dirty(Vec<Rect>);

impl Dirty {
    fn add(&mut self, rect: Rect) {
        let mut rect = rect;
        // What it is joined with may in turn be joined with others.
        while let Some(n) = self.0.iter().position(|other| {
            let both = (rect.texels() + other.texels()) as f32;
            self.0.len() > 32 || hull(rect, *other).texels() as f32 <= 1.3 * both
        }) {
            rect = hull(rect, self.0.swap_remove(n));
        }
        self.0.push(rect);
    }
}
