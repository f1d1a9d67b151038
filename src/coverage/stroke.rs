//! Strokes to f32 coverage. A stroke is built as a tiny-skia path and flattened; each texel then takes the exact distance to
//! the nearest segment, and with it that segment's direction. tiny-skia's own masks are 8-bit with 4x4 samples an edge, too
//! coarse for a map: thin parallel strokes would show bands.

use crate::map::{Rect, Size};
use glam::Vec2;
use tiny_skia::{Path, PathBuilder, PathSegment};

/// How texels lie on the surface: `size` texels over `extent` surface units, row 0 at the top.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Grid {
    /// The whole map's size.
    pub size: Size,
    /// Width and height in surface units.
    pub extent: Vec2,
}

impl Grid {
    /// Width and height of a texel.
    pub fn texel(&self) -> Vec2 {
        self.extent / Vec2::new(self.size.width() as f32, self.size.height() as f32)
    }

    /// The texels that a box in surface units touches; `None` outside the map.
    pub fn cover(&self, low: Vec2, high: Vec2) -> Option<Rect> {
        let texel = self.texel();
        let (w, h) = (self.size.width(), self.size.height());
        let clamp = |x: f32, n: u32| (x.max(0.0) as u32).min(n);
        let left = clamp((low.x / texel.x).floor(), w);
        let right = clamp((high.x / texel.x).floor() + 1.0, w);
        let top = clamp(((self.extent.y - high.y) / texel.y).floor(), h);
        let bottom = clamp(((self.extent.y - low.y) / texel.y).floor() + 1.0, h);
        (right > left && bottom > top).then(|| Rect {
            x: left,
            y: top,
            width: right - left,
            height: bottom - top,
        })
    }
}

/// A stroke of constant width with round ends: at most 65 points.
#[derive(Clone, Debug, PartialEq)]
pub struct Stroke {
    points: Vec<Vec2>,
    width: f32,
}

/// A part of a stroke, and how far it is moved: what a stroke does in one place of a surface that repeats.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Part {
    /// Its first and last segment.
    pub segments: (u8, u8),
    /// Added to every point, surface units.
    pub offset: Vec2,
}

/// Points that a curve is cut into at most.
const PIECES_MAX: f32 = 64.0;

impl Stroke {
    /// A stroke of `width` along the first contour of `path`, its curves flattened to within `tolerance`; all in surface
    /// units. `None` for a path without length.
    pub fn new(path: &Path, width: f32, tolerance: f32) -> Option<Self> {
        let mut points: Vec<Vec2> = Vec::new();
        let vec = |p: tiny_skia::Point| Vec2::new(p.x, p.y);
        for segment in path.segments() {
            match segment {
                PathSegment::MoveTo(_) if !points.is_empty() => break,
                PathSegment::MoveTo(p) | PathSegment::LineTo(p) => points.push(vec(p)),
                PathSegment::QuadTo(q, p) => {
                    let a = *points.last()?;
                    // A quadratic leaves its chord by a quarter of its second difference.
                    let bend = (a - 2.0 * vec(q) + vec(p)).length() / 4.0;
                    let n = pieces(bend, tolerance);
                    points.extend((1..=n).map(|i| {
                        let t = i as f32 / n as f32;
                        a.lerp(vec(q), t).lerp(vec(q).lerp(vec(p), t), t)
                    }));
                }
                PathSegment::CubicTo(q, r, p) => {
                    let a = *points.last()?;
                    let bend = (a - 2.0 * vec(q) + vec(r))
                        .length()
                        .max((vec(q) - 2.0 * vec(r) + vec(p)).length());
                    let n = pieces(0.75 * bend, tolerance);
                    points.extend((1..=n).map(|i| {
                        let t = i as f32 / n as f32;
                        let (b, c, d) = (
                            a.lerp(vec(q), t),
                            vec(q).lerp(vec(r), t),
                            vec(r).lerp(vec(p), t),
                        );
                        b.lerp(c, t).lerp(c.lerp(d, t), t)
                    }));
                }
                PathSegment::Close => points.extend(points.first().copied()),
            }
        }
        points.dedup();
        (points.len() > 1 && points.iter().all(|p| p.is_finite())).then_some(Self { points, width })
    }

    /// A stroke along the quadratic curve from `from` past `control` to `to`.
    pub fn quadratic(
        from: Vec2,
        control: Vec2,
        to: Vec2,
        width: f32,
        tolerance: f32,
    ) -> Option<Self> {
        let mut path = PathBuilder::new();
        path.move_to(from.x, from.y);
        path.quad_to(control.x, control.y, to.x, to.y);
        Self::new(&path.finish()?, width, tolerance)
    }

    /// The whole stroke where it is.
    pub fn whole(&self) -> Part {
        Part {
            segments: (0, (self.points.len() - 2) as u8),
            offset: Vec2::ZERO,
        }
    }

    /// Its length, surface units.
    pub fn length(&self) -> f32 {
        self.points.windows(2).map(|p| p[0].distance(p[1])).sum()
    }

    /// Its width, surface units.
    pub fn width(&self) -> f32 {
        self.width
    }

    /// Calls `visit(segment, low, high)` with boxes in surface units that together hold all that the stroke covers: each of a
    /// piece no longer than `longest`, with a texel to spare.
    pub fn boxes(&self, grid: &Grid, longest: f32, mut visit: impl FnMut(u8, Vec2, Vec2)) {
        let reach = Vec2::splat(0.5 * self.width) + grid.texel();
        for (n, ends) in self.points.windows(2).enumerate() {
            let pieces = (ends[0].distance(ends[1]) / longest).ceil().max(1.0) as u32;
            for k in 0..pieces {
                let at = |k: u32| ends[0].lerp(ends[1], k as f32 / pieces as f32);
                let (a, b) = (at(k), at(k + 1));
                visit(n as u8, a.min(b) - reach, a.max(b) + reach);
            }
        }
    }

    /// Calls `paint(place, coverage, direction)` for every texel of `rect` that a part of the stroke covers: `place` in the
    /// rectangle's row order, coverage in (0, 1], the stroke's unit direction there. A texel is visited once, with the largest coverage of
    /// any segment: a stroke that crosses itself is no denser there. `row` is scratch space, kept between calls.
    pub fn cover(
        &self,
        part: Part,
        grid: &Grid,
        rect: Rect,
        row: &mut Vec<(f32, Vec2)>,
        mut paint: impl FnMut(usize, f32, Vec2),
    ) {
        let (first, last) = (usize::from(part.segments.0), usize::from(part.segments.1));
        let points = &self.points[first..=last + 1];
        let reach = Vec2::splat(0.5 * self.width) + grid.texel();
        let low = points.iter().fold(Vec2::INFINITY, |m, p| m.min(*p)) + part.offset - reach;
        let high = points.iter().fold(Vec2::NEG_INFINITY, |m, p| m.max(*p)) + part.offset + reach;
        let Some(touched) = grid.cover(low, high).and_then(|r| r.intersection(rect)) else {
            return;
        };
        let texel = grid.texel();
        row.clear();
        row.resize(touched.width as usize, (0.0, Vec2::ZERO));
        let segments: Vec<Segment> = points
            .windows(2)
            .map(|p| Segment::new(p[0] + part.offset, p[1] + part.offset, self.width, texel))
            .collect();
        for y in touched.y..touched.y + touched.height {
            let py = grid.extent.y - (y as f32 + 0.5) * texel.y;
            let (mut from, mut to) = (usize::MAX, 0);
            for segment in &segments {
                let Some((left, right)) = segment.span(py, texel) else {
                    continue;
                };
                let begin = ((left / texel.x - 0.5).ceil().max(touched.x as f32) as u32)
                    .max(touched.x)
                    - touched.x;
                let end = ((right / texel.x - 0.5)
                    .floor()
                    .min((touched.x + touched.width) as f32 - 1.0)
                    + 1.0)
                    .max(touched.x as f32) as u32
                    - touched.x;
                for x in begin..end {
                    let p = Vec2::new(((touched.x + x) as f32 + 0.5) * texel.x, py);
                    let c = segment.coverage(p);
                    let cell = &mut row[x as usize];
                    if c > cell.0 {
                        *cell = (c, segment.direction);
                    }
                }
                from = from.min(begin as usize);
                to = to.max(end as usize);
            }
            if from >= to {
                continue;
            }
            let place = rect.index(touched.x, y);
            for (x, cell) in row.iter_mut().enumerate().take(to).skip(from) {
                if cell.0 > 0.0 {
                    paint(place + x, cell.0, cell.1);
                    *cell = (0.0, Vec2::ZERO);
                }
            }
        }
    }
}

fn pieces(bend: f32, tolerance: f32) -> u32 {
    (bend / tolerance).sqrt().ceil().clamp(1.0, PIECES_MAX) as u32
}

/// One straight piece: a capsule.
struct Segment {
    from: Vec2,
    to: Vec2,
    direction: Vec2,
    length: f32,
    /// Half the width.
    radius: f32,
    /// What a texel measures across the piece.
    texel: f32,
}

impl Segment {
    fn new(from: Vec2, to: Vec2, width: f32, texel: Vec2) -> Self {
        let length = from.distance(to);
        let direction = (to - from) / length;
        // What a texel measures across: its box seen along the piece.
        let across =
            direction.perp().abs().dot(texel).max(1e-12) / direction.perp().abs().element_sum();
        Self {
            from,
            to,
            direction,
            length,
            radius: 0.5 * width,
            texel: across,
        }
    }

    /// Where the piece can cover texel centres in the row at height `y`: left and right end, surface units.
    fn span(&self, y: f32, texel: Vec2) -> Option<(f32, f32)> {
        let reach = self.radius + 0.5 * self.texel;
        let (low, high) = (self.from.y.min(self.to.y), self.from.y.max(self.to.y));
        if y < low - reach || y > high + reach {
            return None;
        }
        let slack = 0.01 * texel.x;
        let d = self.to - self.from;
        // The part of the axis within reach of the row, then as far to the sides as the piece leans.
        let (mut left, mut right) = (self.from.x.min(self.to.x), self.from.x.max(self.to.x));
        if d.y.abs() > 1e-12 {
            let at =
                |height: f32| self.from.x + d.x * ((height - self.from.y) / d.y).clamp(0.0, 1.0);
            let (a, b) = (at(y - reach), at(y + reach));
            (left, right) = (left.max(a.min(b)), right.min(a.max(b)));
        }
        Some((left - reach - slack, right + reach + slack))
    }

    /// Coverage of the texel centred at `p`: the part of its breadth that lies in the piece's, seen along the piece. Exact for
    /// pieces that run with the grid, whether they are broader than a texel or thinner.
    fn coverage(&self, p: Vec2) -> f32 {
        let q = p - self.from;
        let along = q.dot(self.direction).clamp(0.0, self.length);
        let distance = (q - self.direction * along).length();
        let common = self.radius + 0.5 * self.texel - distance;
        (common.min(2.0 * self.radius) / self.texel).clamp(0.0, 1.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use tiny_skia::{FillRule, LineCap, Mask, Transform};

    fn grid(n: u32) -> Grid {
        Grid {
            size: Size::new(n, n).unwrap(),
            extent: Vec2::ONE,
        }
    }

    fn line(a: (f32, f32), b: (f32, f32)) -> Path {
        let mut path = PathBuilder::new();
        path.move_to(a.0, a.1);
        path.line_to(b.0, b.1);
        path.finish().unwrap()
    }

    fn ours(stroke: &Stroke, grid: &Grid, rect: Rect) -> Vec<f32> {
        let mut out = vec![0.0; rect.texels()];
        stroke.cover(stroke.whole(), grid, rect, &mut Vec::new(), |i, c, _| {
            out[i] = c;
        });
        out
    }

    #[test]
    fn agrees_with_tiny_skia_within_its_sampling() {
        let n = 128;
        let grid = grid(n);
        for (degrees, width) in [
            (17.0f32, 1.2),
            (17.0, 3.0),
            (52.0, 1.2),
            (80.0, 3.0),
            (123.0, 5.0),
        ] {
            let d = Vec2::from_angle(degrees.to_radians()) * 0.35;
            let path = line((0.5 - d.x, 0.5 - d.y), (0.5 + d.x, 0.5 + d.y));
            let stroke = Stroke::new(&path, width / n as f32, 1e-3).unwrap();
            let got = ours(&stroke, &grid, grid.size.rect());
            let pixels = path
                .transform(Transform::from_row(
                    n as f32,
                    0.0,
                    0.0,
                    -(n as f32),
                    0.0,
                    n as f32,
                ))
                .unwrap()
                .stroke(
                    &tiny_skia::Stroke {
                        width,
                        line_cap: LineCap::Round,
                        ..Default::default()
                    },
                    1.0,
                )
                .unwrap();
            let mut mask = Mask::new(n, n).unwrap();
            mask.fill_path(&pixels, FillRule::Winding, true, Transform::identity());
            let errors: Vec<f32> = got
                .iter()
                .zip(mask.data())
                .map(|(a, b)| a - f32::from(*b) / 255.0)
                .collect();
            let drawn = got.iter().filter(|c| **c > 0.0).count() as f32;
            let rms = (errors.iter().map(|e| e * e).sum::<f32>() / drawn).sqrt();
            let worst = errors.iter().fold(0.0f32, |m, e| m.max(e.abs()));
            assert!(
                rms < 0.06 && worst < 0.2,
                "{degrees} degrees, width {width}: rms {rms}, worst {worst}"
            );
        }
    }

    #[test]
    fn ink_is_the_strokes_area_however_thin() {
        let grid = grid(256);
        for width in [0.1f32, 0.5, 1.0, 4.0] {
            for (a, b) in [((0.1, 0.303), (0.9, 0.303)), ((0.2, 0.1), (0.7, 0.83))] {
                let stroke = Stroke::new(&line(a, b), width / 256.0, 1e-3).unwrap();
                let ink: f32 = ours(&stroke, &grid, grid.size.rect()).iter().sum();
                let length = Vec2::from(a).distance(Vec2::from(b)) * 256.0;
                let want = width * length;
                assert!(
                    (ink / want - 1.0).abs() < 0.05,
                    "width {width}: {ink} for {want}"
                );
            }
        }
    }

    #[test]
    fn a_piece_of_the_map_gets_what_the_whole_gets_and_the_direction_follows_the_curve() {
        let grid = grid(200);
        let mut path = PathBuilder::new();
        path.move_to(0.1, 0.1);
        path.quad_to(0.9, 0.1, 0.9, 0.9);
        let stroke = Stroke::new(&path.finish().unwrap(), 0.02, 1e-4).unwrap();
        let whole = ours(&stroke, &grid, grid.size.rect());
        for rect in grid.size.rect().tiles(64) {
            let piece = ours(&stroke, &grid, rect);
            for y in rect.y..rect.y + rect.height {
                let (a, b) = (rect.index(rect.x, y), grid.size.rect().index(rect.x, y));
                assert_eq!(
                    piece[a..a + rect.width as usize],
                    whole[b..b + rect.width as usize]
                );
            }
        }
        let (mut first, mut last) = (Vec2::ZERO, Vec2::ZERO);
        stroke.cover(
            stroke.whole(),
            &grid,
            grid.size.rect(),
            &mut Vec::new(),
            |i, c, d| {
                if c == 1.0 && i / 200 > 175 && i % 200 < 24 {
                    first = d;
                }
                if c == 1.0 && i / 200 < 24 {
                    last = d;
                }
            },
        );
        assert!(
            first.dot(Vec2::X) > 0.98 && last.dot(Vec2::Y) > 0.98,
            "{first} {last}"
        );
    }

    #[test]
    fn a_path_without_length_or_with_nan_is_no_stroke() {
        let mut dot = PathBuilder::new();
        dot.move_to(0.5, 0.5);
        dot.line_to(0.5, 0.5);
        assert!(
            dot.finish()
                .is_none_or(|p| Stroke::new(&p, 0.1, 1e-3).is_none())
        );
    }
}
