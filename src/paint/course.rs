//! The way of a stroke in the making over tiles: what is settled, and what would still change.

use super::cover::{Cover, Shape, TILE};
use super::laid::{Copies, Ground};
use super::skin::Skin;
use super::solid;
use super::trail::{Piece, Step, Trail, Vector};
use crate::map::Rect;
use glam::{IVec2, Vec2, Vec3};
use rayon::prelude::*;
use std::collections::HashMap;
use std::sync::LazyLock;

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

/// A mesh in space, with the copies of a symmetry.
pub(super) struct Space<'a> {
    pub(super) skin: &'a Skin,
    pub(super) copies: &'a solid::Copies,
}

impl Lay<Vec3> for Space<'_> {
    fn copies(&self, piece: Piece<Vec3>, out: impl FnMut(Piece<Vec3>)) {
        self.copies.each(piece, out);
    }

    fn parts(
        &self,
        piece: &Piece<Vec3>,
        shape: &Shape,
        mut visit: impl FnMut(Place, Rect, Period),
    ) {
        for (_, rect) in solid::touched(piece, shape, self.skin) {
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
        solid::add(cover, piece, shape, &self.skin.places(place));
    }
}

/// What a stroke covers so far.
pub(super) struct Course<V: Vector> {
    trail: Trail<V>,
    shape: Shape,
    /// Whether the direction of a piece matters, and not its coverage alone.
    follows: bool,
    /// By the pieces that will not change any more.
    settled: HashMap<Place, Cover>,
    /// And by the pieces after those, of a stroke that ends here: the tiles that they reach.
    shown: HashMap<Place, Cover>,
    /// Room for tiles, kept from point to point.
    spare: Vec<Cover>,
}

/// A piece in a part of a tile, moved by whole periods.
type Part = (u32, Rect, Period);

/// What a point changes in a tile.
struct Change {
    place: Place,
    settled: Option<Cover>,
    shown: Option<Cover>,
    /// The pieces that are final now, and those after them.
    done: Vec<Part>,
    tail: Vec<Part>,
    /// Room for a tile.
    room: Option<Cover>,
    dirty: Option<Rect>,
}

impl<V: Vector + Send + Sync> Course<V> {
    pub(super) fn new(trail: Trail<V>, shape: Shape, follows: bool) -> Self {
        Self {
            trail,
            shape,
            follows,
            settled: HashMap::new(),
            shown: HashMap::new(),
            spare: Vec::new(),
        }
    }

    /// Goes on by some steps, and for now by those `ahead`, in the place of the ones that were ahead before. Gives the
    /// rectangles of the map outside which nothing changes: parts of single tiles, or of a row of them.
    pub(super) fn go_on(
        &mut self,
        steps: &[Step<V>],
        ahead: &[Step<V>],
        on: &(impl Lay<V> + Sync),
        map: Rect,
    ) -> Vec<Rect>
    where
        V::Side: Send + Sync,
    {
        let (mut done, mut tail) = (Vec::new(), Vec::new());
        for step in steps {
            self.trail.step(step, |p| on.copies(p, |p| done.push(p)));
        }
        let mut trail = self.trail.clone();
        for step in ahead {
            trail.step(step, |p| on.copies(p, |p| tail.push(p)));
        }
        trail.tail(|p| on.copies(p, |p| tail.push(p)));
        let mut changes = self.changes(&done, &tail, on);
        let (shape, follows) = (self.shape, self.follows);
        changes
            .par_iter_mut()
            .for_each(|change| change.make((&done, &tail), &shape, follows, on));
        let mut dirty = Vec::new();
        for change in changes {
            dirty.extend(change.dirty);
            let kept = change.settled.map(|c| (change.place, c));
            self.settled.extend(kept);
            self.shown.extend(change.shown.map(|c| (change.place, c)));
            self.spare.extend(change.room);
        }
        in_rows(dirty)
            .into_iter()
            .filter_map(|r| r.intersection(map))
            .collect()
    }

    /// The tiles that anything may change in.
    fn changes(&mut self, done: &[Piece<V>], tail: &[Piece<V>], on: &impl Lay<V>) -> Vec<Change> {
        let mut changes: HashMap<Place, Change> = HashMap::new();
        let at = |place: Place| Change {
            place,
            settled: None,
            shown: None,
            done: Vec::new(),
            tail: Vec::new(),
            room: None,
            dirty: None,
        };
        for (place, cover) in self.shown.drain() {
            changes.entry(place).or_insert_with(|| at(place)).shown = Some(cover);
        }
        for (pieces, is_done) in [(done, true), (tail, false)] {
            for (n, piece) in (0..).zip(pieces) {
                on.parts(piece, &self.shape, |place, part, period| {
                    let change = changes.entry(place).or_insert_with(|| at(place));
                    let list = if is_done {
                        &mut change.done
                    } else {
                        &mut change.tail
                    };
                    list.push((n, part, period));
                });
            }
        }
        let mut changes: Vec<Change> = changes.into_values().collect();
        for change in &mut changes {
            change.settled = self.settled.remove(&change.place);
            change.room = self.spare.pop();
        }
        changes
    }

    /// What the stroke so far covers in a tile, where it covers anything.
    pub(super) fn cover(&self, place: Place) -> Option<&Cover> {
        self.shown.get(&place).or_else(|| self.settled.get(&place))
    }
}

/// A tile of which nothing is covered.
static BLANK: LazyLock<Cover> = LazyLock::new(|| Cover::new(IVec2::ZERO, false));

impl Change {
    fn make<V: Vector>(
        &mut self,
        (done, tail): (&[Piece<V>], &[Piece<V>]),
        shape: &Shape,
        follows: bool,
        on: &impl Lay<V>,
    ) {
        let place = self.place;
        let goes_over = !self.done.is_empty() && self.shown.is_none();
        let before = self.settled.clone().filter(|_| goes_over);
        let before = self.shown.take().or(before);
        if !self.done.is_empty() {
            let settled = self
                .settled
                .get_or_insert_with(|| Cover::new(origin(place), follows));
            for (n, part, period) in &self.done {
                on.add(settled, &done[*n as usize], *period, shape, (place, *part));
            }
        }
        if !self.tail.is_empty() {
            let room = self.room.take();
            let mut shown = room.unwrap_or_else(|| Cover::new(origin(place), follows));
            match &self.settled {
                Some(settled) => shown.copy_from(settled),
                None => shown.clear(origin(place)),
            }
            for (n, part, period) in &self.tail {
                on.add(
                    &mut shown,
                    &tail[*n as usize],
                    *period,
                    shape,
                    (place, *part),
                );
            }
            self.shown = Some(shown);
        }
        let stood = self.settled.as_ref().filter(|_| self.done.is_empty());
        let was = before.as_ref().or(stood).unwrap_or(&BLANK);
        let now = self.shown.as_ref().or(self.settled.as_ref());
        let dirty = now.unwrap_or(&BLANK).difference(was);
        self.dirty = dirty.map(|r| Rect {
            x: r.x + place.0 * TILE,
            y: r.y + place.1 * TILE,
            ..r
        });
        self.room = before.or(self.room.take());
    }
}

/// Rectangles of tiles beside one another in one.
fn in_rows(mut parts: Vec<Rect>) -> Vec<Rect> {
    parts.sort_unstable_by_key(|r| (r.y / TILE, r.x));
    let mut rows: Vec<Rect> = Vec::new();
    for part in parts {
        match rows.last_mut() {
            Some(last) if last.y / TILE == part.y / TILE && last.x + last.width >= part.x => {
                *last = last.hull(part);
            }
            _ => rows.push(part),
        }
    }
    rows
}

pub(super) fn origin((x, y): Place) -> IVec2 {
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
