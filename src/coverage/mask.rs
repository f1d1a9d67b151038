//! Filled shapes as masks, drawn by tiny-skia.
//!
//! A mask says where a layer shows, not what a texel means, so tiny-skia's 8-bit edges are enough for it. The whole mask
//! is drawn once, before any rectangle is filled, so every rectangle sees the same edges. It is drawn in tiles of
//! [`TILE`] texels: `Mask::fill_path` moves the path on from tile to tile itself above 8191 texels, and goes astray there.

use crate::error::{Error, Result};
use crate::map::{Rect, Size, Wrap};
use glam::{IVec2, UVec2, Vec2};
use rayon::prelude::*;
use std::fmt;
use svgtypes::{SimplePathSegment, SimplifyingPathParser};
use tiny_skia::{FillRule, Path, PathBuilder, Transform};

const TILE: u32 = 4096;
/// Where coordinates may lie, in UV: one turn beyond the map on each side.
const REACH: std::ops::RangeInclusive<f32> = -1.0..=2.0;
/// The most segments a shape may have.
const SEGMENTS_MAX: usize = 1 << 20;
/// Across a faded edge the mask is kept at no more texels than this: the blur is smooth, and bilinear fetches carry it.
const FEATHER_TEXELS: f32 = 48.0;

/// A closed shape in UV units, v up.
#[derive(Clone, Debug, PartialEq)]
pub struct Outline(Path);

impl Outline {
    /// The inside of a polygon.
    ///
    /// # Errors
    /// [`Error::Invalid`] with an empty `what`: fewer than three points, or a point that is not in -1 ..= 2.
    pub fn from_polygon(points: &[Vec2]) -> Result<Self> {
        if points.len() < 3 {
            return Err(Error::invalid(
                "",
                format!("a list of {} points", points.len()),
                "allowed: at least 3 points, [u, v] each",
            ));
        }
        let mut builder = PathBuilder::new();
        for (i, p) in points.iter().enumerate() {
            check_point(p.x, p.y)?;
            if i == 0 {
                builder.move_to(p.x, p.y);
            } else {
                builder.line_to(p.x, p.y);
            }
        }
        builder.close();
        Self::finish(builder)
    }

    /// The inside (nonzero rule) of SVG path data.
    ///
    /// # Errors
    /// [`Error::Invalid`] with an empty `what`: no path data, or a point that is not in -1 ..= 2.
    pub fn from_svg(data: &str) -> Result<Self> {
        let mut builder = PathBuilder::new();
        for segment in SimplifyingPathParser::from(data) {
            let segment = segment.map_err(|e| {
                Error::invalid(
                    "",
                    format!("{:?} ({e})", shorten(data)),
                    "allowed: SVG path data, as in \"M 0.1 0.1 L 0.9 0.1 L 0.5 0.9 Z\"",
                )
            })?;
            push(&mut builder, segment)?;
        }
        Self::finish(builder)
    }

    fn finish(builder: PathBuilder) -> Result<Self> {
        let few = builder.len() <= SEGMENTS_MAX;
        builder.finish().filter(|_| few).map(Self).ok_or_else(|| {
            Error::invalid(
                "",
                "no shape",
                format!("allowed: a shape of 2 to {SEGMENTS_MAX} segments"),
            )
        })
    }
}

fn push(builder: &mut PathBuilder, segment: SimplePathSegment) -> Result<()> {
    let point = |x: f64, y: f64| {
        let (x, y) = (x as f32, y as f32);
        check_point(x, y).map(|()| (x, y))
    };
    match segment {
        SimplePathSegment::MoveTo { x, y } => {
            let (x, y) = point(x, y)?;
            builder.move_to(x, y);
        }
        SimplePathSegment::LineTo { x, y } => {
            let (x, y) = point(x, y)?;
            builder.line_to(x, y);
        }
        SimplePathSegment::Quadratic { x1, y1, x, y } => {
            let ((x1, y1), (x, y)) = (point(x1, y1)?, point(x, y)?);
            builder.quad_to(x1, y1, x, y);
        }
        SimplePathSegment::CurveTo {
            x1,
            y1,
            x2,
            y2,
            x,
            y,
        } => {
            let ((x1, y1), (x2, y2), (x, y)) = (point(x1, y1)?, point(x2, y2)?, point(x, y)?);
            builder.cubic_to(x1, y1, x2, y2, x, y);
        }
        SimplePathSegment::ClosePath => builder.close(),
    }
    Ok(())
}

fn check_point(u: f32, v: f32) -> Result<()> {
    if REACH.contains(&u) && REACH.contains(&v) {
        return Ok(());
    }
    Err(Error::invalid(
        "",
        format!("a shape with the point [{u}, {v}]"),
        "allowed: UV coordinates from -1 to 2",
    ))
}

fn shorten(text: &str) -> String {
    if text.chars().count() <= 40 {
        return text.to_owned();
    }
    text.chars().take(40).chain("...".chars()).collect()
}

/// A shape drawn for one map: a weight for every texel.
pub struct DrawnMask {
    /// Its own size; smaller than the map's where the edge is faded over many texels.
    grid: UVec2,
    map: UVec2,
    wrap: Wrap,
    /// 0 to 65535, row order, top row first.
    weights: Vec<u16>,
}

impl fmt::Debug for DrawnMask {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "DrawnMask({} for {})", self.grid, self.map)
    }
}

impl DrawnMask {
    /// Draws a shape for a map of `size`, its edge fading over `feather` texels in each direction (0: sharp). Where the
    /// map repeats, what reaches over one edge comes in at the other.
    pub fn draw(outline: &Outline, size: Size, wrap: Wrap, feather: Vec2) -> Self {
        let map = UVec2::new(size.width(), size.height());
        let grid = grid_of(map, feather);
        let feather = feather * grid.as_vec2() / map.as_vec2();
        let mut weights = drawn(outline, grid, wrap);
        // Three box blurs are close to a Gaussian, and their reach adds up to `feather` exactly.
        let reach = (feather / 6.0).round().as_uvec2();
        for _ in 0..3 {
            blur_rows(&mut weights, grid.x as usize, reach.x, wrap.repeats_u());
            blur_columns(&mut weights, grid, reach.y, wrap);
        }
        Self {
            grid,
            map,
            wrap,
            weights,
        }
    }

    /// The memory that such a mask holds.
    pub fn bytes(size: Size, feather: Vec2) -> u64 {
        let grid = grid_of(UVec2::new(size.width(), size.height()), feather);
        u64::from(grid.x) * u64::from(grid.y) * size_of::<u16>() as u64
    }

    /// The weights of a rectangle of the map, 0 to 1, row order.
    ///
    /// # Panics
    /// When `out` has not the rectangle's length.
    pub fn fill(&self, rect: Rect, out: &mut [f32]) {
        assert_eq!(out.len(), rect.texels(), "one weight for each texel");
        for (y, row) in (rect.y..).zip(out.chunks_exact_mut(rect.width as usize)) {
            if self.grid == self.map {
                let start = y as usize * self.grid.x as usize + rect.x as usize;
                for (w, &from) in row.iter_mut().zip(&self.weights[start..]) {
                    *w = f32::from(from) * (1.0 / 65535.0);
                }
            } else {
                self.fetch_row(rect.x, y, row);
            }
        }
    }

    /// Bilinear, for a grid that is coarser than the map.
    fn fetch_row(&self, x0: u32, y: u32, row: &mut [f32]) {
        let scale = self.grid.as_vec2() / self.map.as_vec2();
        let v = (y as f32 + 0.5) * scale.y - 0.5;
        let line = |offset: i64| {
            let j = self.wrap.row(v.floor() as i64 + offset, self.grid.y) as usize;
            &self.weights[j * self.grid.x as usize..][..self.grid.x as usize]
        };
        let (upper, lower, fv) = (line(0), line(1), v - v.floor());
        for (x, w) in (x0..).zip(row) {
            let u = (x as f32 + 0.5) * scale.x - 0.5;
            let (i, fu) = (u.floor() as i64, u - u.floor());
            let (a, b) = (
                self.wrap.column(i, self.grid.x) as usize,
                self.wrap.column(i + 1, self.grid.x) as usize,
            );
            let mix = |p: u16, q: u16, t: f32| f32::from(p) + (f32::from(q) - f32::from(p)) * t;
            let (top, bottom) = (mix(upper[a], upper[b], fu), mix(lower[a], lower[b], fu));
            *w = (top + (bottom - top) * fv) * (1.0 / 65535.0);
        }
    }
}

/// The mask's own size: the map's, or less where the edge is faded over many texels.
fn grid_of(map: UVec2, feather: Vec2) -> UVec2 {
    let keep = (Vec2::splat(FEATHER_TEXELS) / feather.max(Vec2::splat(1e-6))).min(Vec2::ONE);
    (map.as_vec2() * keep)
        .ceil()
        .as_uvec2()
        .clamp(UVec2::ONE, map)
}

/// The shape on a grid, with sharp edges.
fn drawn(outline: &Outline, grid: UVec2, wrap: Wrap) -> Vec<u16> {
    let mut weights = vec![0u16; grid.x as usize * grid.y as usize];
    let turns = |repeats: bool| if repeats { -1..=1 } else { 0..=0 };
    for y in (0..grid.y).step_by(TILE as usize) {
        for x in (0..grid.x).step_by(TILE as usize) {
            let (w, h) = (TILE.min(grid.x - x), TILE.min(grid.y - y));
            let mut tile = tiny_skia::Mask::new(w, h).expect("a tile is not empty");
            for v in turns(wrap.repeats_v()) {
                for u in turns(wrap.repeats_u()) {
                    fill_tile(&mut tile, outline, grid, UVec2::new(x, y), IVec2::new(u, v));
                }
            }
            for (j, row) in (y as usize..).zip(tile.data().chunks_exact(w as usize)) {
                let start = j * grid.x as usize + x as usize;
                for (to, &from) in weights[start..].iter_mut().zip(row) {
                    *to = u16::from(from) * 257;
                }
            }
        }
    }
    weights
}

/// Draws the shape, moved by whole turns of UV, into the tile whose first texel is `corner`.
fn fill_tile(
    tile: &mut tiny_skia::Mask,
    outline: &Outline,
    grid: UVec2,
    corner: UVec2,
    turn: IVec2,
) {
    let (g, c, t) = (grid.as_vec2(), corner.as_vec2(), turn.as_vec2());
    let to_texels = Transform::from_row(
        g.x,
        0.0,
        0.0,
        -g.y, // v runs up, rows run down
        t.x * g.x - c.x,
        (1.0 - t.y) * g.y - c.y,
    );
    let Some(path) = outline.0.clone().transform(to_texels) else {
        return; // flattened to nothing by the transform
    };
    let bounds = path.bounds();
    let inside = bounds.right() > 0.0
        && bounds.bottom() > 0.0
        && bounds.left() < tile.width() as f32
        && bounds.top() < tile.height() as f32;
    if inside {
        tile.fill_path(&path, FillRule::Winding, true, Transform::identity());
    }
}

/// The place in 0..n of index `i`, which may lie outside.
fn fold(i: i64, n: usize, repeats: bool) -> usize {
    let n = i64::try_from(n).expect("a side fits");
    let folded = if repeats {
        i.rem_euclid(n)
    } else {
        i.clamp(0, n - 1)
    };
    usize::try_from(folded).expect("folded into the grid")
}

/// The mean over 2 `reach` + 1 neighbours along each row.
fn blur_rows(weights: &mut [u16], width: usize, reach: u32, repeats: bool) {
    if reach == 0 {
        return;
    }
    let reach = i64::from(reach);
    let count = 2 * reach + 1;
    weights.par_chunks_exact_mut(width).for_each(|row| {
        let from = row.to_vec();
        let at = |i: i64| i64::from(from[fold(i, width, repeats)]);
        let mut sum: i64 = (-reach..=reach).map(at).sum();
        for (i, w) in (0i64..).zip(row) {
            *w = u16::try_from((sum + count / 2) / count).expect("a mean of u16");
            sum += at(i + reach + 1) - at(i - reach);
        }
    });
}

/// The mean over 2 `reach` + 1 neighbours along each column, a whole row of sums at a time.
fn blur_columns(weights: &mut Vec<u16>, grid: UVec2, reach: u32, wrap: Wrap) {
    if reach == 0 {
        return;
    }
    let (width, height) = (grid.x as usize, grid.y as usize);
    let reach = i64::from(reach);
    let count = 2 * reach + 1;
    let line = |j: i64| {
        let start = fold(j, height, wrap.repeats_v()) * width;
        &weights[start..start + width]
    };
    let mut sums = vec![0i64; width];
    for j in -reach..=reach {
        sums.iter_mut()
            .zip(line(j))
            .for_each(|(s, &w)| *s += i64::from(w));
    }
    let mut blurred = Vec::with_capacity(weights.len());
    for j in 0..i64::from(grid.y) {
        let mean = |s: &i64| u16::try_from((s + count / 2) / count).expect("a mean of u16");
        blurred.extend(sums.iter().map(mean));
        let (enter, leave) = (line(j + reach + 1), line(j - reach));
        for ((s, &e), &l) in sums.iter_mut().zip(enter).zip(leave) {
            *s += i64::from(e) - i64::from(l);
        }
    }
    *weights = blurred;
}

#[cfg(test)]
mod tests {
    use super::*;

    fn square(low: f32, high: f32) -> Outline {
        let corners = [(low, low), (high, low), (high, high), (low, high)];
        Outline::from_polygon(&corners.map(Vec2::from)).unwrap()
    }

    fn whole(mask: &DrawnMask, size: Size) -> Vec<f32> {
        let mut out = vec![0.0; size.texels()];
        mask.fill(size.rect(), &mut out);
        out
    }

    #[test]
    fn v_runs_up_and_edges_are_shared_out() {
        let size = Size::new(8, 8).unwrap();
        let lower_left = Outline::from_svg("M 0 0 L 0.5 0 L 0.5 0.3125 L 0 0.3125 Z").unwrap();
        let mask = DrawnMask::draw(&lower_left, size, Wrap::Clamp, Vec2::ZERO);
        let w = whole(&mask, size);
        assert_eq!((w[7 * 8], w[7 * 8 + 3], w[7 * 8 + 4]), (1.0, 1.0, 0.0));
        assert_eq!(w[0], 0.0);
        assert!((w[5 * 8] - 0.5).abs() < 0.02, "row 5 is half inside");
    }

    #[test]
    fn what_leaves_a_repeating_map_comes_back() {
        let size = Size::new(16, 16).unwrap();
        let over = square(0.75, 1.25);
        let repeat = whole(
            &DrawnMask::draw(&over, size, Wrap::Repeat, Vec2::ZERO),
            size,
        );
        let clamp = whole(&DrawnMask::draw(&over, size, Wrap::Clamp, Vec2::ZERO), size);
        assert_eq!(repeat.iter().sum::<f32>(), 64.0);
        assert_eq!(clamp.iter().sum::<f32>(), 16.0);
        assert_eq!(repeat[15 * 16], 1.0, "lower left");
    }

    #[test]
    fn a_faded_edge_is_as_wide_as_it_says_at_any_size() {
        for side in [64u32, 512, 2048] {
            let size = Size::new(side, side).unwrap();
            let feather = Vec2::splat(0.25 * side as f32);
            let mask = DrawnMask::draw(&square(-1.0, 0.5), size, Wrap::Clamp, feather);
            let w = whole(&mask, size);
            let at = |u: f32| {
                w[(side / 2 + side / 4) as usize * side as usize + (u * side as f32) as usize]
            };
            assert!((at(0.5) - 0.5).abs() < 0.06, "{side}: {}", at(0.5));
            assert!(at(0.35) > 0.99 && at(0.66) < 0.01, "{side}");
            assert!(at(0.45) < 0.95 && at(0.45) > 0.5, "{side}");
        }
    }

    #[test]
    fn pieces_equal_the_whole() {
        let size = Size::new(300, 200).unwrap();
        let star =
            Outline::from_svg("M 0.1 0.1 C 0.9 0.2 0.8 1.2 0.3 0.9 A 0.3 0.2 10 1 0 0.1 0.1 Z")
                .unwrap();
        for feather in [0.0, 20.0, 90.0] {
            let mask = DrawnMask::draw(&star, size, Wrap::Repeat, Vec2::splat(feather));
            let w = whole(&mask, size);
            for rect in size.rect().tiles(64) {
                let mut piece = vec![0.0; rect.texels()];
                mask.fill(rect, &mut piece);
                for y in rect.y..rect.y + rect.height {
                    let (a, b) = (size.rect().index(rect.x, y), rect.index(rect.x, y));
                    let n = rect.width as usize;
                    assert_eq!(w[a..a + n], piece[b..b + n]);
                }
            }
        }
    }

    #[test]
    fn a_mask_over_several_tiles_is_one_shape() {
        let size = Size::new(9000, 40).unwrap();
        let mask = DrawnMask::draw(&square(0.25, 0.75), size, Wrap::Clamp, Vec2::ZERO);
        let sum: f64 = whole(&mask, size).into_iter().map(f64::from).sum();
        assert!((sum - 4500.0 * 20.0).abs() < 1.0, "{sum}");
    }

    #[test]
    fn shapes_that_are_none_are_refused() {
        assert!(Outline::from_polygon(&[Vec2::ZERO, Vec2::ONE]).is_err());
        assert!(Outline::from_polygon(&[Vec2::ZERO, Vec2::ONE, Vec2::NAN]).is_err());
        for bad in ["", "M 0 0 L 1", "hello", "M 0 0 L 1e9 1 Z", "M 0 0"] {
            assert!(Outline::from_svg(bad).is_err(), "{bad}");
        }
    }
}
