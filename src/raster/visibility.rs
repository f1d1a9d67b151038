//! Which triangle each sample sees: fixed-point edge functions over tiles, nearest depth wins.
//!
//! Three passes, each spread over all cores: corners to fixed point; triangles to [`Setup`]s, a block of them at a time, which
//! each block sorts into the tiles it touches; tiles, each of which draws the blocks' triangles in the mesh's order. A row of
//! [`LANES`] samples is decided at once by whole-number arithmetic, so the same loop compiled for any CPU level gives the same
//! samples.

use super::camera::{Vertex, View};
use super::clip::{GUARD, clip};
use super::geometry::Geometry;
use super::{Cull, TILE, Tile};
use crate::error::Result;
use crate::map::Rect;
use crate::math;
use crate::progress::Progress;
use fearless_simd::{Simd, dispatch};
use fearless_simd_macros::simd;
use glam::{DVec2, Vec3};
use rayon::prelude::*;
use std::ops::Range;

/// Fractional bits of a screen coordinate.
const SUBPIXEL_BITS: u32 = 8;
const SUBPIXEL: i64 = 1 << SUBPIXEL_BITS;
/// Farther out than the guard band reaches: a corner that rounding threw there (planet-sized triangles) is not drawn. The
/// edge functions of what is inside fit 32 bits wherever the edge crosses a tile.
const FAR_OUT: f64 = (40_000 * SUBPIXEL) as f64;
/// No triangle.
pub(super) const NOTHING: u32 = u32::MAX;
/// Vertices that one thread projects at a time.
const RUN: usize = 1 << 11;
/// Triangles of a block.
const BLOCK: usize = 1 << 10;
/// Triangles that are binned at a time, at most.
const BATCH_MAX: usize = 1 << 17;
/// Entries of bins, if every triangle touched every tile.
const ENTRIES_MAX: usize = 1 << 27;
/// Samples that are decided at once.
const LANES: usize = 16;
/// Samples from one row of a tile to the next: a row of lanes may begin at any of its samples.
pub(super) const STRIDE: usize = TILE as usize + LANES;

/// The nearest depth of each sample of a tile so far; larger is nearer. One for each thread that draws tiles.
pub struct Depths(Vec<f32>);

impl Depths {
    /// Room for a tile.
    pub fn new() -> Self {
        Self(vec![0.0; STRIDE * TILE as usize])
    }
}

impl Default for Depths {
    fn default() -> Self {
        Self::new()
    }
}

/// The vertices of a mesh in a picture.
#[derive(Clone, Debug)]
pub struct Corners {
    pub(super) view: View,
    pub(super) list: Vec<Corner>,
}

impl Corners {
    /// Projects every vertex.
    pub fn new(geometry: &Geometry<'_>, view: &View) -> Self {
        let positions = &geometry.mesh().positions;
        let mut list = vec![Corner::NOWHERE; positions.len()];
        let level = math::level();
        list.par_chunks_mut(RUN)
            .zip(positions.par_chunks(RUN))
            .for_each(|(list, positions)| {
                dispatch!(level, simd => project(simd, view, positions, list));
            });
        Self { view: *view, list }
    }
}

#[simd]
fn project<S: Simd>(_: S, view: &View, positions: &[Vec3], out: &mut [Corner]) {
    for (corner, position) in out.iter_mut().zip(positions) {
        *corner = view
            .project(*position)
            .map_or(Corner::NOWHERE, |v| Corner::new(view, &v));
    }
}

/// A vertex in the picture.
#[derive(Clone, Copy, Debug)]
pub(super) struct Corner {
    /// In samples; not finite where it is nowhere.
    pub(super) at: DVec2,
    /// For a perspective view 1/w, else the distance; see [`View::slant`]. Positive where it lies before the eye.
    pub(super) q: f64,
    /// In fixed point; [`Corner::CLIP`] where it has no place of its own, [`Corner::NONE`] where the vertex is not finite.
    x: i32,
    y: i32,
}

impl Corner {
    const CLIP: i32 = i32::MIN;
    const NONE: i32 = i32::MAX;
    const NOWHERE: Self = Self {
        at: DVec2::NAN,
        q: f64::NAN,
        x: Self::NONE,
        y: Self::NONE,
    };

    #[inline(always)]
    fn new(view: &View, vertex: &Vertex) -> Self {
        let at = vertex.h.truncate() * (1.0 / vertex.h.z);
        let (cx, cy) = view.centre();
        // NaN is not inside.
        let inside = vertex.distance >= view.near()
            && (at.x - cx).abs() <= GUARD
            && (at.y - cy).abs() <= GUARD;
        let fixed = |v: f64| (v * SUBPIXEL as f64).round() as i32;
        Self {
            at,
            q: view.slant(vertex),
            x: if inside { fixed(at.x) } else { Self::CLIP },
            y: if inside { fixed(at.y) } else { Self::CLIP },
        }
    }

    /// A corner that clipping made: on the border of what is inside.
    fn clipped(view: &View, vertex: &Vertex) -> Option<Self> {
        let at = vertex.h.truncate() * (1.0 / vertex.h.z);
        let fixed = |v: f64| {
            let v = (v * SUBPIXEL as f64).round();
            (v.abs() <= FAR_OUT).then_some(v as i32)
        };
        Some(Self {
            at,
            q: view.slant(vertex),
            x: fixed(at.x)?,
            y: fixed(at.y)?,
        })
    }
}

/// A triangle ready to be drawn, turned so that its inside is where the edge functions are positive.
#[derive(Clone, Copy)]
struct Setup {
    x: [i32; 3],
    y: [i32; 3],
    /// First and last column and row whose centre may be inside, in samples; may lie outside the window.
    columns: (i32, i32),
    rows: (i32, i32),
    /// Depth at the first column and row, its change per sample, and the least and the greatest there is.
    depth: f32,
    depth_dx: f32,
    depth_dy: f32,
    depth_range: (f32, f32),
    triangle: u32,
}

/// A linear function over samples, inside where it is at least 0.
#[derive(Clone, Copy, Default)]
struct Edge {
    value: i32,
    dx: i32,
    dy: i32,
}

impl Setup {
    #[inline(always)]
    fn new(corners: [&Corner; 3], triangle: u32, cull: Cull, nearer: f64) -> Option<Self> {
        let [a, mut b, mut c] = corners;
        let wide = i64::from;
        let area = |b: &Corner, c: &Corner| {
            wide(b.x - a.x) * wide(c.y - a.y) - wide(c.x - a.x) * wide(b.y - a.y)
        };
        let mut twice = area(b, c);
        // Rows run downward, so a counter-clockwise triangle has a negative area here.
        if twice == 0 || (twice > 0 && cull == Cull::Back) {
            return None;
        }
        if twice < 0 {
            std::mem::swap(&mut b, &mut c);
            twice = -twice;
        }
        // Centres lie at half samples.
        let range = |p: i32, q: i32, r: i32| {
            let half = SUBPIXEL as i32 / 2;
            let low = p.min(q).min(r) - half;
            let high = p.max(q).max(r) - half;
            (-(-low >> SUBPIXEL_BITS), high >> SUBPIXEL_BITS)
        };
        let (columns, rows) = (range(a.x, b.x, c.x), range(a.y, b.y, c.y));
        if columns.0 > columns.1 || rows.0 > rows.1 {
            return None;
        }
        let depths = [a, b, c].map(|corner| corner.q * nearer);
        let (db, dc) = (depths[1] - depths[0], depths[2] - depths[0]);
        let per = SUBPIXEL as f64 / twice as f64;
        let depth_dx = (db * f64::from(c.y - a.y) - dc * f64::from(b.y - a.y)) * per;
        let depth_dy = (dc * f64::from(b.x - a.x) - db * f64::from(c.x - a.x)) * per;
        let offset = |first: i32, at: i32| f64::from(first) + 0.5 - f64::from(at) / SUBPIXEL as f64;
        let depth = depths[0] + depth_dx * offset(columns.0, a.x) + depth_dy * offset(rows.0, a.y);
        Some(Self {
            x: [a.x, b.x, c.x],
            y: [a.y, b.y, c.y],
            columns,
            rows,
            depth: depth as f32,
            depth_dx: depth_dx as f32,
            depth_dy: depth_dy as f32,
            depth_range: (
                depths[0].min(depths[1]).min(depths[2]) as f32,
                depths[0].max(depths[1]).max(depths[2]) as f32,
            ),
            triangle,
        })
    }

    /// The edge opposite corner `i`, its value that at the first of `columns` and `rows`. `None` when all of them lie outside;
    /// an edge that they all lie inside of is 0 everywhere.
    #[inline(always)]
    fn edge(&self, i: usize, columns: (i32, i32), rows: (i32, i32)) -> Option<Edge> {
        let (a, b) = ((i + 1) % 3, (i + 2) % 3);
        let (ex, ey) = (self.x[b] - self.x[a], self.y[b] - self.y[a]);
        // Samples exactly on the edge belong to the triangle where it is a top or left edge.
        let top_left = ey < 0 || (ey == 0 && ex > 0);
        let centre = |sample: i32| (i64::from(sample) << SUBPIXEL_BITS) + SUBPIXEL / 2;
        let value = i64::from(ex) * (centre(rows.0) - i64::from(self.y[a]))
            - i64::from(ey) * (centre(columns.0) - i64::from(self.x[a]))
            - i64::from(!top_left);
        // From sample to sample it changes by whole multiples of SUBPIXEL: the bits below tell nothing about its sign.
        let value = value >> SUBPIXEL_BITS;
        let (across, down) = (
            i64::from(-ey) * i64::from(columns.1 - columns.0),
            i64::from(ex) * i64::from(rows.1 - rows.0),
        );
        if value + across.max(0) + down.max(0) < 0 {
            return None;
        }
        if value + across.min(0) + down.min(0) >= 0 {
            return Some(Edge::default());
        }
        Some(Edge {
            value: value as i32,
            dx: -ey,
            dy: ex,
        })
    }

    #[inline(always)]
    fn draw(&self, rect: Rect, triangles: &mut [u32], depths: &mut [f32]) {
        let (left, top) = (rect.x as i32, rect.y as i32);
        let columns = (
            self.columns.0.max(left),
            self.columns.1.min(left + rect.width as i32 - 1),
        );
        let rows = (
            self.rows.0.max(top),
            self.rows.1.min(top + rect.height as i32 - 1),
        );
        if columns.0 > columns.1 || rows.0 > rows.1 {
            return;
        }
        let blocks = (columns.1 - columns.0) / LANES as i32 + 1;
        let reach = (columns.0, columns.0 + blocks * LANES as i32 - 1);
        let Some(e0) = self.edge(0, reach, rows) else {
            return;
        };
        let Some(e1) = self.edge(1, reach, rows) else {
            return;
        };
        let Some(e2) = self.edge(2, reach, rows) else {
            return;
        };
        let mut values = [e0.value, e1.value, e2.value];
        for row in rows.0..=rows.1 {
            let line = (row - top) as usize * STRIDE + (columns.0 - left) as usize;
            let depth = self.depth + self.depth_dy * (row - self.rows.0) as f32;
            let mut at = values;
            for block in 0..blocks {
                let place = line + block as usize * LANES;
                let first = columns.0 + block * LANES as i32 - self.columns.0;
                self.lanes(
                    at,
                    [e0.dx, e1.dx, e2.dx],
                    (depth, first),
                    &mut depths[place..][..LANES],
                    &mut triangles[place..][..LANES],
                );
                at[0] = at[0].wrapping_add(e0.dx.wrapping_mul(LANES as i32));
                at[1] = at[1].wrapping_add(e1.dx.wrapping_mul(LANES as i32));
                at[2] = at[2].wrapping_add(e2.dx.wrapping_mul(LANES as i32));
            }
            values[0] = values[0].wrapping_add(e0.dy);
            values[1] = values[1].wrapping_add(e1.dy);
            values[2] = values[2].wrapping_add(e2.dy);
        }
    }

    /// One row of lanes: of two at one depth the first drawn stays.
    #[inline(always)]
    fn lanes(
        &self,
        at: [i32; 3],
        dx: [i32; 3],
        (depth, first): (f32, i32),
        depths: &mut [f32],
        triangles: &mut [u32],
    ) {
        let (low, high) = self.depth_range;
        for j in 0..LANES {
            let step = j as i32;
            let e = (at[0].wrapping_add(dx[0].wrapping_mul(step)))
                | (at[1].wrapping_add(dx[1].wrapping_mul(step)))
                | (at[2].wrapping_add(dx[2].wrapping_mul(step)));
            let d = depth + self.depth_dx * (first + step) as f32;
            let d = if d < low { low } else { d };
            let d = if d > high { high } else { d };
            let nearer = (e >= 0) & (d > depths[j]);
            depths[j] = if nearer { d } else { depths[j] };
            triangles[j] = if nearer { self.triangle } else { triangles[j] };
        }
    }
}

/// Columns or rows of tiles.
type Span = Range<usize>;

/// The setups of a block of triangles, and for each tile that any of them touches which ones do.
struct Block {
    setups: Vec<Setup>,
    /// The tiles touched, as columns and rows of tiles.
    columns: Span,
    rows: Span,
    /// Where each of those tiles begins in `order`, and its end.
    starts: Vec<u32>,
    /// Places in `setups`, tile by tile, in order.
    order: Vec<u16>,
}

impl Block {
    fn new(setups: Vec<Setup>, window: Rect) -> Self {
        let touched: Vec<_> = setups.iter().map(|s| tiles_of(s, window)).collect();
        let inside = || {
            let some = |(c, r): &&(Span, Span)| !c.is_empty() && !r.is_empty();
            touched.iter().filter(some)
        };
        let hull = |spans: &mut dyn Iterator<Item = &Span>| -> Span {
            let all = spans.cloned();
            all.reduce(|a, b| a.start.min(b.start)..a.end.max(b.end))
                .unwrap_or(0..0)
        };
        let columns = hull(&mut inside().map(|(c, _)| c));
        let rows = hull(&mut inside().map(|(_, r)| r));
        let across = columns.len();
        let mut block = Self {
            setups,
            starts: vec![0; across * rows.len() + 1],
            order: Vec::new(),
            columns,
            rows,
        };
        let place =
            |c: usize, r: usize| (r - block.rows.start) * across + (c - block.columns.start);
        // Count, add up, fill: a counting sort keeps the order.
        for (columns, rows) in &touched {
            for r in rows.clone() {
                for c in columns.clone() {
                    block.starts[place(c, r) + 1] += 1;
                }
            }
        }
        for i in 1..block.starts.len() {
            block.starts[i] += block.starts[i - 1];
        }
        let mut next = block.starts.clone();
        block.order = vec![0; *next.last().unwrap_or(&0) as usize];
        for (i, (columns, rows)) in touched.iter().enumerate() {
            for r in rows.clone() {
                for c in columns.clone() {
                    let slot =
                        &mut next[(r - block.rows.start) * across + (c - block.columns.start)];
                    block.order[*slot as usize] = i as u16;
                    *slot += 1;
                }
            }
        }
        block
    }

    /// The setups that touch a tile.
    fn tile(&self, column: usize, row: usize) -> &[u16] {
        if !self.columns.contains(&column) || !self.rows.contains(&row) {
            return &[];
        }
        let place = (row - self.rows.start) * self.columns.len() + (column - self.columns.start);
        &self.order[self.starts[place] as usize..self.starts[place + 1] as usize]
    }
}

/// The columns and rows of tiles of the window that a triangle's bounds touch.
fn tiles_of(setup: &Setup, window: Rect) -> (Span, Span) {
    let tiles = |(low, high): (i32, i32), start: u32, length: u32| {
        let low = (low - start as i32).max(0);
        let high = (high - start as i32).min(length as i32 - 1);
        if low > high {
            0..0
        } else {
            low as usize / TILE as usize..high as usize / TILE as usize + 1
        }
    };
    (
        tiles(setup.columns, window.x, window.width),
        tiles(setup.rows, window.y, window.height),
    )
}

/// The triangles of a mesh that may be seen in a window, sorted into its tiles. 80 bytes for each that covers a sample, and two
/// for each tile that it touches.
pub struct Bins {
    across: usize,
    blocks: Vec<Block>,
}

impl Bins {
    /// Sets the triangles up and sorts them.
    ///
    /// # Panics
    /// When the window reaches outside the picture, or the corners are of other geometry.
    pub fn new(geometry: &Geometry<'_>, corners: &Corners, window: Rect, cull: Cull) -> Self {
        let all = 0..geometry.mesh().triangles.len();
        Self::of(geometry, corners, window, cull, all)
    }

    /// The same of some triangles only.
    pub(super) fn of(
        geometry: &Geometry<'_>,
        corners: &Corners,
        window: Rect,
        cull: Cull,
        some: Range<usize>,
    ) -> Self {
        let view = &corners.view;
        assert!(
            window.intersection(view.size().rect()) == Some(window),
            "a window inside the picture"
        );
        let level = math::level();
        let triangles = &geometry.mesh().triangles[some.clone()];
        let blocks = triangles
            .par_chunks(BLOCK)
            .enumerate()
            .map(|(block, triangles)| {
                let first = (some.start + block * BLOCK) as u32;
                let mut setups = Vec::with_capacity(triangles.len());
                dispatch!(level, simd => set_up_all(simd, (geometry, corners), (triangles, first), cull, &mut setups));
                Block::new(setups, window)
            })
            .collect();
        Self {
            across: window.width.div_ceil(TILE) as usize,
            blocks,
        }
    }

    /// Whether any triangle comes near tile number `i`.
    fn touch(&self, i: usize) -> bool {
        let place = (i % self.across, i / self.across);
        let mut blocks = self.blocks.iter();
        blocks.any(|b| !b.tile(place.0, place.1).is_empty())
    }

    /// Draws tile number `i` of the window, in place of what it saw.
    pub fn draw(&self, i: usize, tile: &mut Tile, depths: &mut Depths) {
        tile.seen.clear();
        self.draw_over(i, tile, depths);
    }

    /// Draws tile number `i` of the window over what it sees, whose depths these are.
    fn draw_over(&self, i: usize, tile: &mut Tile, depths: &mut Depths) {
        let level = math::level();
        let place = (i % self.across, i / self.across);
        let samples = STRIDE * tile.rect.height as usize;
        for block in &self.blocks {
            let order = block.tile(place.0, place.1);
            if order.is_empty() {
                continue;
            }
            if tile.seen.is_empty() {
                tile.seen.resize(samples, NOTHING);
                depths.0[..samples].fill(f32::NEG_INFINITY);
            }
            dispatch!(level, simd => draw_all(simd, &block.setups, order, tile, &mut depths.0));
        }
    }
}

/// What tiles are to be drawn from.
pub enum Plan {
    /// These bins: each tile whenever it is wanted.
    Bins(Bins),
    /// Nothing: there were so many triangles that the tiles have been drawn already, some triangles after the other.
    Drawn,
}

impl Plan {
    /// Sorts the triangles into the tiles of a window, or draws the tiles where the bins would be too large: never more than
    /// about 2^27 entries of two bytes at a time.
    ///
    /// # Errors
    /// When `progress` cancels. One check per bins.
    ///
    /// # Panics
    /// When the window reaches outside the picture, the corners are of other geometry, or the tiles are not the window's.
    pub fn new(
        geometry: &Geometry<'_>,
        corners: &Corners,
        (window, tiles): (Rect, &mut [Tile]),
        cull: Cull,
        progress: &Progress<'_>,
    ) -> Result<Self> {
        let triangles = geometry.mesh().triangles.len();
        let batch = (ENTRIES_MAX / tiles.len().max(1)).clamp(BLOCK, BATCH_MAX);
        if triangles <= batch {
            return Ok(Self::Bins(Bins::new(geometry, corners, window, cull)));
        }
        let mut depths: Vec<Depths> = tiles.iter().map(|_| Depths(Vec::new())).collect();
        tiles.iter_mut().for_each(|tile| tile.seen.clear());
        for first in (0..triangles).step_by(batch) {
            progress.check()?;
            let some = first..(first + batch).min(triangles);
            let bins = Bins::of(geometry, corners, window, cull, some);
            tiles
                .par_iter_mut()
                .zip(&mut depths)
                .enumerate()
                .for_each(|(i, (tile, depths))| {
                    if depths.0.is_empty() && bins.touch(i) {
                        *depths = Depths::new();
                    }
                    bins.draw_over(i, tile, depths);
                });
        }
        Ok(Self::Drawn)
    }

    /// Tile number `i` of the window, drawn into `tile`.
    pub fn draw(&self, i: usize, tile: &mut Tile, depths: &mut Depths) {
        if let Self::Bins(bins) = self {
            bins.draw(i, tile, depths);
        }
    }
}

#[simd]
fn draw_all<S: Simd>(_: S, setups: &[Setup], order: &[u16], tile: &mut Tile, depths: &mut [f32]) {
    for &i in order {
        setups[i as usize].draw(tile.rect, &mut tile.seen, depths);
    }
}

#[simd]
fn set_up_all<S: Simd>(
    _: S,
    (geometry, corners): (&Geometry<'_>, &Corners),
    (triangles, first): (&[[u32; 3]], u32),
    cull: Cull,
    setups: &mut Vec<Setup>,
) {
    let nearer = corners.view.nearer();
    for (triangle, index) in triangles.iter().zip(first..) {
        let three = triangle.map(|i| &corners.list[i as usize]);
        let [a, b, c] = three;
        // One comparison for both: what has no place is at the ends of the range.
        let placed = |c: &Corner| c.x != Corner::CLIP && c.x != Corner::NONE;
        if placed(a) & placed(b) & placed(c) {
            setups.extend(Setup::new(three, index, cull, nearer));
        } else if three.iter().all(|c| c.x != Corner::NONE) {
            clip_and_set_up(geometry, &corners.view, *triangle, index, cull, setups);
        }
    }
}

#[cold]
fn clip_and_set_up(
    geometry: &Geometry<'_>,
    view: &View,
    triangle: [u32; 3],
    index: u32,
    cull: Cull,
    setups: &mut Vec<Setup>,
) {
    let vertex = |i: u32| view.project(geometry.mesh().positions[i as usize]);
    let [Some(a), Some(b), Some(c)] = triangle.map(vertex) else {
        return;
    };
    let Some(polygon) = clip(view, [a, b, c]) else {
        return;
    };
    let pieces = polygon.corners();
    for pair in pieces[1..].windows(2) {
        let [Some(a), Some(b), Some(c)] =
            [&pieces[0], &pair[0], &pair[1]].map(|v| Corner::clipped(view, v))
        else {
            continue;
        };
        setups.extend(Setup::new([&a, &b, &c], index, cull, view.nearer()));
    }
}
