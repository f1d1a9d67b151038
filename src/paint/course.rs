//! The way of a stroke in the making over tiles: what is settled, and what would still change.

use super::cover::{Cover, Shape, TILE};
use super::laid::{Copies, Ground};
use super::painting::hull;
use super::skin::Skin;
use super::solid;
use super::trail::{Node, Piece, Trail, Vector};
use crate::map::Rect;
use glam::{IVec2, Vec2, Vec3};
use std::collections::HashMap;

/// A tile by column and row.
pub(super) type Place = (u32, u32);
type Period = (i8, i8);

/// What pieces are laid on.
pub(super) trait Lay<V: Vector> {
    /// Calls `out` with a piece and the copies that belong to it.
    fn copies(&self, piece: Piece<V>, out: impl FnMut(Piece<V>));
    /// Calls `visit` with the parts of tiles that a piece may change, and the periods it is moved by for them.
    fn parts(&self, piece: &Piece<V>, shape: &Shape, visit: impl FnMut(Place, Rect, Period));
    /// Adds a piece to what is covered in a part of a tile.
    fn add(
        &self,
        cover: &mut Cover,
        piece: &Piece<V>,
        period: Period,
        shape: &Shape,
        at: (Place, Rect),
    );
}

/// The plane of UV, with the copies of a symmetry.
pub(super) struct Plane<'a> {
    pub(super) ground: &'a Ground,
    pub(super) copies: &'a Copies,
}

impl Lay<Vec2> for Plane<'_> {
    fn copies(&self, piece: Piece<Vec2>, out: impl FnMut(Piece<Vec2>)) {
        self.copies.each(piece, out);
    }

    fn parts(
        &self,
        piece: &Piece<Vec2>,
        shape: &Shape,
        mut visit: impl FnMut(Place, Rect, Period),
    ) {
        self.ground.rects(piece, shape, |rect, period| {
            for (place, part) in tiles_of(rect) {
                visit(place, part, period);
            }
        });
    }

    fn add(
        &self,
        cover: &mut Cover,
        piece: &Piece<Vec2>,
        period: Period,
        shape: &Shape,
        (_, part): (Place, Rect),
    ) {
        let shift = self.ground.shift(period);
        cover.add(piece, shift, shape, &self.ground.grid, part);
    }
}

impl Lay<Vec3> for Skin {
    fn copies(&self, piece: Piece<Vec3>, mut out: impl FnMut(Piece<Vec3>)) {
        out(piece);
    }

    fn parts(
        &self,
        piece: &Piece<Vec3>,
        shape: &Shape,
        mut visit: impl FnMut(Place, Rect, Period),
    ) {
        for (_, rect) in solid::touched(piece, shape, self) {
            visit((rect.x / TILE, rect.y / TILE), rect, (0, 0));
        }
    }

    fn add(
        &self,
        cover: &mut Cover,
        piece: &Piece<Vec3>,
        _: Period,
        shape: &Shape,
        (place, _): (Place, Rect),
    ) {
        solid::add(cover, piece, shape, &self.places(place));
    }
}

/// What a stroke covers so far.
pub(super) struct Course<V: Vector> {
    trail: Trail<V>,
    shape: Shape,
    /// By the pieces that will not change any more.
    settled: HashMap<Place, Cover>,
    /// The pieces after those, of a stroke that ends here.
    tail: Vec<Piece<V>>,
    /// Which of them reach a tile.
    tail_in: HashMap<Place, Vec<(u32, Rect, Period)>>,
}

impl<V: Vector> Course<V> {
    pub(super) fn new(trail: Trail<V>, shape: Shape) -> Self {
        Self {
            trail,
            shape,
            settled: HashMap::new(),
            tail: Vec::new(),
            tail_in: HashMap::new(),
        }
    }

    /// Goes on to a node, or gives the last its pressure where it is at the same place.
    pub(super) fn go_on(&mut self, node: Node<V>, stays: bool, on: &impl Lay<V>) -> Dirty {
        let mut dirty = Dirty::default();
        self.mark_tail(&mut dirty);
        if stays {
            self.trail.press(node.radius, node.flow);
        } else {
            let mut done = Vec::new();
            self.trail.push(node, |p| on.copies(p, |p| done.push(p)));
            for piece in &done {
                self.settle(piece, on, &mut dirty);
            }
        }
        self.renew_tail(on);
        self.mark_tail(&mut dirty);
        dirty
    }

    fn settle(&mut self, piece: &Piece<V>, on: &impl Lay<V>, dirty: &mut Dirty) {
        let Self { shape, settled, .. } = self;
        on.parts(piece, shape, |place, part, period| {
            dirty.add(part);
            let cover = settled
                .entry(place)
                .or_insert_with(|| Cover::new(origin(place)));
            on.add(cover, piece, period, shape, (place, part));
        });
    }

    fn renew_tail(&mut self, on: &impl Lay<V>) {
        let Self { trail, tail, .. } = self;
        tail.clear();
        trail.tail(|p| on.copies(p, |p| tail.push(p)));
        self.tail_in.clear();
        for (n, piece) in (0..).zip(&self.tail) {
            on.parts(piece, &self.shape, |place, part, period| {
                let list = self.tail_in.entry(place).or_default();
                list.push((n, part, period));
            });
        }
    }

    fn mark_tail(&self, dirty: &mut Dirty) {
        let mut parts: Vec<Rect> = self
            .tail_in
            .values()
            .flatten()
            .map(|(_, r, _)| *r)
            .collect();
        parts.sort_unstable_by_key(|r| (r.y, r.x));
        parts.into_iter().for_each(|r| dirty.add(r));
    }

    /// What the stroke so far covers in a part of a tile.
    pub(super) fn cover(&self, place: Place, part: Rect, on: &impl Lay<V>, cover: &mut Cover) {
        match self.settled.get(&place) {
            Some(settled) => cover.copy_from(settled),
            None => cover.clear(origin(place)),
        }
        for (n, rect, period) in self.tail_in.get(&place).into_iter().flatten() {
            if rect.intersection(part).is_some() {
                let piece = &self.tail[*n as usize];
                on.add(cover, piece, *period, &self.shape, (place, part));
            }
        }
    }
}

fn origin((x, y): Place) -> IVec2 {
    IVec2::new((x * TILE) as i32, (y * TILE) as i32)
}

/// The tiles that a rectangle meets, each with what they have in common.
pub(super) fn tiles_of(rect: Rect) -> impl Iterator<Item = (Place, Rect)> {
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
pub(super) struct Dirty(pub(super) Vec<Rect>);

impl Dirty {
    pub(super) fn add(&mut self, rect: Rect) {
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
