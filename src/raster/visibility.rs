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
use fearless_simd::prelude::*;
use fearless_simd::{Simd, dispatch, f32x16, i32x16, u32x16};
use fearless_simd_macros::simd;
use glam::{DVec2, Vec3};
use rayon::prelude::*;
use std::ops::Range;
use std::sync::atomic::{AtomicUsize, Ordering};

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
/// Times that triangles and some tiles may meet: about 80 bytes each.
const MEETINGS_MAX: usize = 1 << 22;
/// Samples that are decided at once.
const LANES: usize = 16;
/// Samples from one row of a tile to the next: a row of lanes may begin at any of its samples.
pub(super) const STRIDE: usize = TILE as usize + LANES;
/// Rows of a small triangle, at most, and how many of them are drawn without asking whether there are more.
const SMALL_ROWS: i32 = 64;
const SMALL_STEP: usize = 4;
/// Rows of memory of a tile: the last step of a small triangle may begin at its last row.
const MEMORY_ROWS: usize = TILE as usize + SMALL_STEP;
/// Triangles that a tile remembers having drawn; if there are more, it forgets those that none of its samples sees.
const DRAWN_MAX: usize = 2 * (TILE * TILE) as usize;

/// The nearest depth of each sample of a tile so far; larger is nearer. One for each thread that draws tiles.
pub struct Depths(Vec<f32>);

impl Depths {
    /// Room for a tile.
    pub fn new() -> Self {
        Self(vec![0.0; STRIDE * MEMORY_ROWS])
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
    edges: [Edge<i64>; 3],
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

/// A linear function over samples, inside where it is at least 0. From sample to sample an edge function in fixed point changes
/// by whole multiples of [`SUBPIXEL`]: the bits below tell nothing about its sign and are left out.
#[derive(Clone, Copy, Default)]
struct Edge<T> {
    value: T,
    dx: i32,
    dy: i32,
}

impl Edge<i64> {
    /// From one corner to the next, its value that at a sample.
    #[inline(always)]
    fn new(from: &Corner, to: &Corner, (column, row): (i32, i32)) -> Self {
        let (ex, ey) = (to.x - from.x, to.y - from.y);
        // Samples exactly on the edge belong to the triangle where it is a top or left edge.
        let top_left = (ey < 0) | ((ey == 0) & (ex > 0));
        let centre = |sample: i32| (i64::from(sample) << SUBPIXEL_BITS) + SUBPIXEL / 2;
        let value = i64::from(ex) * (centre(row) - i64::from(from.y))
            - i64::from(ey) * (centre(column) - i64::from(from.x))
            - i64::from(!top_left);
        Self {
            value: value >> SUBPIXEL_BITS,
            dx: -ey,
            dy: ex,
        }
    }

    /// The same with its value that at another sample, so many columns and rows away.
    #[inline(always)]
    fn moved(&self, (columns, rows): (i32, i32)) -> i64 {
        self.value + i64::from(self.dx) * i64::from(columns) + i64::from(self.dy) * i64::from(rows)
    }

    /// For so many columns and rows from `away` on. `None` when all of them lie outside; an edge that they all lie inside of is
    /// 0 everywhere.
    #[inline(always)]
    fn near(&self, away: (i32, i32), (columns, rows): (i32, i32)) -> Option<Edge<i32>> {
        let value = self.moved(away);
        let across = i64::from(self.dx) * i64::from(columns - 1);
        let down = i64::from(self.dy) * i64::from(rows - 1);
        if value + across.max(0) + down.max(0) < 0 {
            return None;
        }
        if value + across.min(0) + down.min(0) >= 0 {
            return Some(Edge::default());
        }
        Some(Edge {
            value: value as i32,
            dx: self.dx,
            dy: self.dy,
        })
    }
}

impl Edge<i32> {
    /// Its value so many columns on.
    #[inline(always)]
    fn moved(&self, columns: i32) -> i32 {
        self.value.wrapping_add(self.dx.wrapping_mul(columns))
    }
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
        let first = (columns.0, rows.0);
        Some(Self {
            edges: [
                Edge::new(b, c, first),
                Edge::new(c, a, first),
                Edge::new(a, b, first),
            ],
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

    /// Draws what lies in a tile, and says where that can be.
    #[inline(always)]
    fn draw<S: Simd>(
        &self,
        simd: S,
        rect: Rect,
        triangles: &mut [u32],
        depths: &mut [f32],
    ) -> Option<Drawn> {
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
            return None;
        }
        let drawn = Drawn {
            triangle: self.triangle,
            left: (columns.0 - left) as u8,
            right: (columns.1 - left) as u8,
            top: (rows.0 - top) as u8,
            bottom: (rows.1 - top) as u8,
        };
        let small = (self.columns.1 - self.columns.0 < LANES as i32)
            & (self.rows.1 - self.rows.0 < SMALL_ROWS);
        if small {
            self.draw_small(simd, drawn, (columns.0, rows.0), triangles, depths);
        } else {
            self.draw_large(simd, drawn, (columns.0, rows.0), triangles, depths)?;
        }
        Some(drawn)
    }

    /// One that is no wider than the lanes and so low that its edge functions fit 32 bits all over it, from a sample on.
    #[inline(always)]
    fn draw_small<S: Simd>(
        &self,
        simd: S,
        drawn: Drawn,
        (column, row): (i32, i32),
        triangles: &mut [u32],
        depths: &mut [f32],
    ) {
        let away = (column - self.columns.0, row - self.rows.0);
        let [e0, e1, e2] = &self.edges;
        let mut edges = [
            Steps::new(simd, e0.moved(away) as i32, e0.dx, e0.dy),
            Steps::new(simd, e1.moved(away) as i32, e1.dx, e1.dy),
            Steps::new(simd, e2.moved(away) as i32, e2.dx, e2.dy),
        ];
        let slope = self.slope(simd);
        let across = slope.across(simd, away.0);
        let place = usize::from(drawn.top) * STRIDE + usize::from(drawn.left);
        // Four rows at a time: those past the last are outside. How often the loop turns is then mostly foretold.
        let turns = usize::from(drawn.bottom - drawn.top) / SMALL_STEP + 1;
        let reach = turns * SMALL_STEP * STRIDE;
        let depths = depths[place..][..reach].chunks_exact_mut(SMALL_STEP * STRIDE);
        let triangles = triangles[place..][..reach].chunks_exact_mut(SMALL_STEP * STRIDE);
        let mut row = away.1;
        for (depths, triangles) in depths.zip(triangles) {
            for step in 0..SMALL_STEP {
                let inside = edges[0].at | edges[1].at | edges[2].at;
                slope.put(
                    simd,
                    inside,
                    slope.at(simd, row, across),
                    &mut depths[step * STRIDE..][..LANES],
                    &mut triangles[step * STRIDE..][..LANES],
                );
                for edge in &mut edges {
                    edge.at += edge.down;
                }
                row += 1;
            }
        }
    }

    /// Any other. `None` when no sample can be inside.
    #[inline(always)]
    fn draw_large<S: Simd>(
        &self,
        simd: S,
        drawn: Drawn,
        (column, row): (i32, i32),
        triangles: &mut [u32],
        depths: &mut [f32],
    ) -> Option<()> {
        let away = (column - self.columns.0, row - self.rows.0);
        let blocks = usize::from(drawn.right - drawn.left) / LANES + 1;
        let rows = usize::from(drawn.bottom - drawn.top) + 1;
        let reach = ((blocks * LANES) as i32, rows as i32);
        let e0 = self.edges[0].near(away, reach)?;
        let e1 = self.edges[1].near(away, reach)?;
        let e2 = self.edges[2].near(away, reach)?;
        let slope = self.slope(simd);
        for block in 0..blocks {
            let first = (block * LANES) as i32;
            let across = slope.across(simd, away.0 + first);
            let mut edges = [
                Steps::new(simd, e0.moved(first), e0.dx, e0.dy),
                Steps::new(simd, e1.moved(first), e1.dx, e1.dy),
                Steps::new(simd, e2.moved(first), e2.dx, e2.dy),
            ];
            for row in 0..rows {
                let inside = edges[0].at | edges[1].at | edges[2].at;
                let place = (usize::from(drawn.top) + row) * STRIDE
                    + usize::from(drawn.left)
                    + block * LANES;
                slope.put(
                    simd,
                    inside,
                    slope.at(simd, away.1 + row as i32, across),
                    &mut depths[place..][..LANES],
                    &mut triangles[place..][..LANES],
                );
                for edge in &mut edges {
                    edge.at += edge.down;
                }
            }
        }
        Some(())
    }

    #[inline(always)]
    fn slope<S: Simd>(&self, simd: S) -> Slope<S> {
        Slope {
            depth: self.depth,
            dx: self.depth_dx,
            dy: self.depth_dy,
            low: f32x16::splat(simd, self.depth_range.0),
            high: f32x16::splat(simd, self.depth_range.1),
            triangle: u32x16::splat(simd, self.triangle),
        }
    }
}

/// An edge function over a row of lanes, and its change to the next row. Where it leaves 32 bits it wraps around, at samples
/// that another edge leaves out.
#[derive(Clone, Copy)]
struct Steps<S: Simd> {
    at: i32x16<S>,
    down: i32x16<S>,
}

impl<S: Simd> Steps<S> {
    #[inline(always)]
    fn new(simd: S, value: i32, dx: i32, dy: i32) -> Self {
        Self {
            at: i32x16::splat(simd, value) + i32x16::splat(simd, dx) * lane_numbers(simd),
            down: i32x16::splat(simd, dy),
        }
    }
}

#[inline(always)]
fn lane_numbers<S: Simd>(simd: S) -> i32x16<S> {
    const NUMBERS: [i32; LANES] = [0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15];
    i32x16::from_slice(simd, &NUMBERS)
}

/// The depth of a triangle, spread over lanes.
#[derive(Clone, Copy)]
struct Slope<S: Simd> {
    depth: f32,
    dx: f32,
    dy: f32,
    low: f32x16<S>,
    high: f32x16<S>,
    triangle: u32x16<S>,
}

impl<S: Simd> Slope<S> {
    /// The change from the first column to a row of lanes that begins so many columns on.
    #[inline(always)]
    fn across(&self, simd: S, columns: i32) -> f32x16<S> {
        let columns: f32x16<S> = (i32x16::splat(simd, columns) + lane_numbers(simd)).to_float();
        columns * self.dx
    }

    /// The depth so many rows on.
    #[inline(always)]
    fn at(&self, simd: S, rows: i32, across: f32x16<S>) -> f32x16<S> {
        f32x16::splat(simd, self.depth + self.dy * rows as f32) + across
    }

    /// One row of lanes, inside where a number is not negative: of two at one depth the first drawn stays.
    #[inline(always)]
    fn put(
        &self,
        simd: S,
        inside: i32x16<S>,
        depth: f32x16<S>,
        depths: &mut [f32],
        triangles: &mut [u32],
    ) {
        let depth = depth.simd_lt(self.low).select(self.low, depth);
        let depth = depth.simd_gt(self.high).select(self.high, depth);
        let before = f32x16::from_slice(simd, depths);
        let nearer = inside.simd_ge(0) & depth.simd_gt(before);
        nearer.select(depth, before).store_slice(depths);
        let seen = u32x16::from_slice(simd, triangles);
        nearer.select(self.triangle, seen).store_slice(triangles);
    }
}

/// A triangle that was drawn into a tile, and the first and last column and row of the tile where it may be seen.
#[derive(Clone, Copy, Debug)]
pub(super) struct Drawn {
    pub(super) triangle: u32,
    pub(super) left: u8,
    pub(super) right: u8,
    pub(super) top: u8,
    pub(super) bottom: u8,
}

impl Drawn {
    fn grow(&mut self, other: Self) {
        self.left = self.left.min(other.left);
        self.right = self.right.max(other.right);
        self.top = self.top.min(other.top);
        self.bottom = self.bottom.max(other.bottom);
    }
}

/// Columns or rows of tiles.
type Span = Range<usize>;

/// From the first to the last of two spans, the former of which may be empty.
fn hull(a: &Span, b: &Span) -> Span {
    if a.is_empty() {
        b.clone()
    } else {
        a.start.min(b.start)..a.end.max(b.end)
    }
}

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
        let (mut columns, mut rows) = (0..0, 0..0);
        for (c, r) in &touched {
            if !c.is_empty() && !r.is_empty() {
                columns = hull(&columns, c);
                rows = hull(&rows, r);
            }
        }
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

    /// For some tiles of a window only: `wanted` holds the number of each tile among them, or `u32::MAX`. Each comes out as a window
    /// of its own, of one tile. `None` when triangles and tiles meet more than 2^22 times.
    ///
    /// # Panics
    /// When the window reaches outside the picture, or the corners are of other geometry.
    pub fn some(
        geometry: &Geometry<'_>,
        corners: &Corners,
        window: Rect,
        cull: Cull,
        wanted: &[u32],
    ) -> Option<Vec<Self>> {
        let tiles: Vec<Rect> = window.tiles(TILE).collect();
        assert_eq!(wanted.len(), tiles.len(), "a number for each tile");
        let across = window.width.div_ceil(TILE) as usize;
        let met = AtomicUsize::new(0);
        let level = math::level();
        let triangles = geometry.mesh().triangles.par_chunks(BLOCK).enumerate();
        let meetings: Vec<Vec<(u32, Setup)>> = triangles
            .map(|(block, triangles)| {
                let first = (block * BLOCK) as u32;
                let mut setups = Vec::with_capacity(triangles.len());
                dispatch!(level, simd => set_up_all(simd, (geometry, corners), (triangles, first), cull, &mut setups));
                let mut list = Vec::new();
                for setup in &setups {
                    let (columns, rows) = tiles_of(setup, window);
                    for row in rows {
                        let near = &wanted[row * across..][columns.clone()];
                        let before = list.len();
                        list.extend(near.iter().filter(|n| **n != u32::MAX).map(|n| (*n, *setup)));
                        let more = list.len() - before;
                        if met.fetch_add(more, Ordering::Relaxed) + more > MEETINGS_MAX {
                            return None;
                        }
                    }
                }
                Some(list)
            })
            .collect::<Option<_>>()?;
        let numbered = || tiles.iter().zip(wanted).filter(|(_, n)| **n != u32::MAX);
        let mut rects = vec![window; numbered().count()];
        numbered().for_each(|(tile, n)| rects[*n as usize] = *tile);
        let mut lists = vec![Vec::new(); rects.len()];
        for (n, setup) in meetings.into_iter().flatten() {
            lists[n as usize].push(setup);
        }
        let bins = lists.iter().zip(rects).map(|(setups, rect)| Self {
            across: 1,
            blocks: setups
                .chunks(BLOCK)
                .map(|setups| Block::new(setups.to_vec(), rect))
                .collect(),
        });
        Some(bins.collect())
    }

    /// Whether any triangle comes near tile number `i`.
    fn touch(&self, i: usize) -> bool {
        let place = (i % self.across, i / self.across);
        let mut blocks = self.blocks.iter();
        blocks.any(|b| !b.tile(place.0, place.1).is_empty())
    }

    /// Draws tile number `i` of the window, in place of what it saw.
    pub fn draw(&self, i: usize, tile: &mut Tile, depths: &mut Depths) {
        tile.clear();
        self.draw_over(i, tile, depths);
    }

    /// Draws tile number `i` of the window over what it sees, whose depths these are.
    fn draw_over(&self, i: usize, tile: &mut Tile, depths: &mut Depths) {
        let level = math::level();
        let place = (i % self.across, i / self.across);
        let samples = STRIDE * (tile.rect.height as usize + SMALL_STEP);
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
            if tile.drawn.len() > DRAWN_MAX {
                tile.forget_hidden();
            }
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
        tiles.iter_mut().for_each(Tile::clear);
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
fn draw_all<S: Simd>(
    simd: S,
    setups: &[Setup],
    order: &[u16],
    tile: &mut Tile,
    depths: &mut [f32],
) {
    tile.drawn.reserve(order.len());
    for &i in order {
        let drawn = setups[i as usize].draw(simd, tile.rect, &mut tile.seen, depths);
        if let Some(drawn) = drawn {
            match tile.drawn.last_mut() {
                // Pieces of one that was cut.
                Some(last) if last.triangle == drawn.triangle => last.grow(drawn),
                _ => tile.drawn.push(drawn),
            }
        }
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
        let list = &corners.list;
        let [a, b, c] = triangle;
        let three = [&list[*a as usize], &list[*b as usize], &list[*c as usize]];
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
