//! What each canvas pixel sees of the map: the mean over the square that it covers.
//!
//! Shown smaller, a pixel covers many texels and gets their mean, from the level whose cells are half as large as the pixel or
//! more. Shown larger, it covers a part of one texel, or of two where a border runs through it: texels have sharp edges without
//! steps. Everything depends on the pixel's place alone, so a rectangle has the bytes of the whole.

use super::camera::Camera2d;
use super::levels::{Levels, Rows};
use crate::map::{Size, Wrap};
use glam::DVec2;
use rayon::prelude::*;
use std::ops::Range;

/// Rows of pixels that one thread takes at a time.
pub(super) const BAND: usize = 16;

/// The texels, or cells of a level, under each pixel of a row or column, with their shares of it.
struct Taps {
    /// Where each pixel's taps begin; one more than there are pixels.
    starts: Vec<u32>,
    taps: Vec<(u32, f32)>,
    /// How much of the pixel's far end lies in another texel than its near end: where a line between texels may be drawn.
    borders: Vec<bool>,
}

/// One side of the map on the canvas.
#[derive(Clone, Copy)]
struct Side {
    /// Texels at the left edge of pixel 0, and per pixel.
    origin: f64,
    step: f64,
    texels: u32,
    repeats: bool,
    /// The least texels that a pixel's box is wide, around its middle.
    least: f64,
}

impl Side {
    fn taps(self, pixels: Range<i64>, level: usize) -> Taps {
        let mut taps = Taps {
            starts: vec![0],
            taps: Vec::new(),
            borders: Vec::with_capacity(pixels.clone().count()),
        };
        let n = f64::from(self.texels);
        for i in pixels {
            let a = self.origin + i as f64 * self.step;
            let b = self.origin + (i + 1) as f64 * self.step;
            let middle = 0.5 * (a + b);
            let inside = middle >= 0.0 && middle < n;
            taps.borders
                .push(a.floor() != b.floor() && (inside || self.repeats));
            let width = self.step.max(self.least);
            let (a, b) = (middle - 0.5 * width, middle + 0.5 * width);
            if self.repeats && b - a >= n {
                taps.add(0.0, n, n, n, level);
            } else if self.repeats {
                let a = a - (a / n).floor() * n;
                let b = a + width;
                taps.add(a, b.min(n), width, n, level);
                taps.add(0.0, b - n, width, n, level);
            } else if inside {
                let (a, b) = (a.max(0.0), b.min(n));
                taps.add(a, b, b - a, n, level);
            }
            let end = u32::try_from(taps.taps.len()).expect("a few taps a pixel");
            taps.starts.push(end);
        }
        taps
    }
}

impl Taps {
    /// The cells under a stretch of texels, as shares of `whole` texels.
    fn add(&mut self, low: f64, high: f64, whole: f64, n: f64, level: usize) {
        let cell = (1u64 << level) as f64;
        let mut start = low;
        while start < high {
            let i = (start / cell).floor();
            let end = ((i + 1.0) * cell).min(high).min(n);
            let share = ((end - start) / whole) as f32;
            // Rounding leaves slivers of nothing at both ends.
            if share > 1e-6 {
                self.taps.push((i as u32, share));
            }
            if end <= start {
                break;
            }
            start = end;
        }
    }

    fn of(&self, pixel: usize) -> &[(u32, f32)] {
        &self.taps[self.starts[pixel] as usize..self.starts[pixel + 1] as usize]
    }

    /// The cells from the first to the last.
    fn span(&self) -> Range<usize> {
        let cells = || self.taps.iter().map(|t| t.0 as usize);
        match (cells().min(), cells().max()) {
            (Some(first), Some(last)) => first..last + 1,
            _ => 0..0,
        }
    }
}

/// A rectangle of canvas pixels over a map and its levels.
pub(super) struct Sampler<'a, R, const N: usize> {
    source: &'a R,
    levels: &'a Levels<N>,
    level: usize,
    columns: Taps,
    rows: Taps,
    span: Range<usize>,
}

impl<'a, R: Rows<N>, const N: usize> Sampler<'a, R, N> {
    /// For the pixels of `columns` and `rows`, which may lie beside the canvas. With `smooth`, texels that are larger than
    /// pixels blend into each other: a box one texel wide over texels of one value each is their linear interpolation.
    pub(super) fn new(
        source: &'a R,
        levels: &'a Levels<N>,
        wrap: Wrap,
        camera: &Camera2d,
        [columns, rows]: [Range<i64>; 2],
        smooth: bool,
    ) -> Self {
        let size = source.size();
        let [u, v] = sides(size, wrap, camera).map(|side| Side {
            least: if smooth { 1.0 } else { 0.0 },
            ..side
        });
        // Exact halvings, so that the level is the same for every rectangle.
        let finest = u.step.min(v.step).max(1.0);
        let level = (finest.log2().floor() as usize).min(levels.count());
        let columns = u.taps(columns, level);
        Self {
            source,
            levels,
            level,
            span: columns.span(),
            columns,
            rows: v.taps(rows, level),
        }
    }

    /// Whether a pixel of a row sees the map.
    pub(super) fn sees_column(&self, i: usize) -> bool {
        !self.columns.of(i).is_empty()
    }

    /// Whether a row's pixels see the map.
    pub(super) fn sees_row(&self, j: usize) -> bool {
        !self.rows.of(j).is_empty()
    }

    /// Whether a border between texels runs through a column of pixels.
    pub(super) fn column_border(&self, i: usize) -> bool {
        self.columns.borders[i]
    }

    /// Whether a border between texels runs through a row of pixels.
    pub(super) fn row_border(&self, j: usize) -> bool {
        self.rows.borders[j]
    }

    /// Calls `row` with the number of each row that is asked for and what its pixels see; zeros where they see nothing.
    pub(super) fn each_row(&self, rows: Range<usize>, mut row: impl FnMut(usize, &[[f32; N]])) {
        let mut below = vec![[0.0; N]; self.span.len()];
        let mut seen = vec![[0.0; N]; self.columns.borders.len()];
        let mut read = RowsRead::new();
        let mut last: Option<&[(u32, f32)]> = None;
        for j in rows {
            let taps = self.rows.of(j);
            if last != Some(taps) {
                self.down(taps, &mut below, &mut read);
                self.across(&below, &mut seen);
                last = Some(taps);
            }
            row(j, &seen);
        }
    }

    /// Draws all rows into pixels of four bytes: `row` gets its number, what its pixels see, and where they go.
    pub(super) fn draw(&self, rgba: &mut [u8], row: impl Fn(usize, &[[f32; N]], &mut [u8]) + Sync) {
        let line = 4 * self.columns.borders.len();
        rgba.par_chunks_mut(line * BAND)
            .enumerate()
            .for_each(|(band, rgba)| {
                let rows = band * BAND..band * BAND + rgba.len() / line;
                let mut lines = rgba.chunks_exact_mut(line);
                self.each_row(rows, |j, seen| {
                    row(j, seen, lines.next().expect("a line for each row"));
                });
            });
    }

    /// The sum over the rows under a row of pixels.
    fn down(&self, taps: &[(u32, f32)], sum: &mut [[f32; N]], read: &mut RowsRead<N>) {
        sum.fill([0.0; N]);
        for &(y, share) in taps {
            let row = if self.level == 0 {
                read.row(self.source, y, &self.span)
            } else {
                let (width, texels) = self.levels.level(self.level);
                &texels[y as usize * width..][self.span.clone()]
            };
            for (sum, texel) in sum.iter_mut().zip(row) {
                for c in 0..N {
                    sum[c] += texel[c] * share;
                }
            }
        }
    }

    /// The sum over the columns under each pixel.
    fn across(&self, below: &[[f32; N]], seen: &mut [[f32; N]]) {
        for (i, seen) in seen.iter_mut().enumerate() {
            let mut sum = [0.0; N];
            for &(x, share) in self.columns.of(i) {
                let texel = &below[x as usize - self.span.start];
                for c in 0..N {
                    sum[c] += texel[c] * share;
                }
            }
            *seen = sum;
        }
    }
}

/// Both sides of the map on a camera's canvas.
fn sides(map: Size, wrap: Wrap, camera: &Camera2d) -> [Side; 2] {
    let origin = camera.texel_at(map, DVec2::ZERO);
    let per_texel = camera.pixels_per_texel();
    let side = |origin, per_texel: f64, texels, repeats| Side {
        origin,
        step: 1.0 / per_texel,
        texels,
        repeats: repeats && camera.repeat,
        least: 0.0,
    };
    [
        side(origin.x, per_texel.x, map.width(), wrap.repeats_u()),
        side(origin.y, per_texel.y, map.height(), wrap.repeats_v()),
    ]
}

/// The last rows of the map that were read: neighbouring rows of pixels share them.
struct RowsRead<const N: usize> {
    rows: Vec<(u32, Vec<[f32; N]>)>,
    next: usize,
}

impl<const N: usize> RowsRead<N> {
    const KEPT: usize = 4;

    fn new() -> Self {
        Self {
            rows: Vec::new(),
            next: 0,
        }
    }

    fn row(&mut self, source: &impl Rows<N>, y: u32, columns: &Range<usize>) -> &[[f32; N]] {
        let known = self.rows.iter().position(|(row, _)| *row == y);
        let at = known.unwrap_or_else(|| {
            if self.rows.len() < Self::KEPT {
                self.rows.push((y, vec![[0.0; N]; columns.len()]));
                self.next = self.rows.len() - 1;
            } else {
                self.next = (self.next + 1) % Self::KEPT;
            }
            let (row, texels) = &mut self.rows[self.next];
            *row = y;
            source.row(y, columns.clone(), texels);
            self.next
        });
        &self.rows[at].1
    }
}

#[cfg(test)]
mod tests {
    use super::super::levels::Plane;
    use super::*;

    fn seen(w: u32, h: u32, camera: &Camera2d, wrap: Wrap) -> Vec<f32> {
        let size = Size::new(w, h).unwrap();
        let values: Vec<f32> = (0..size.texels()).map(|i| (i * 37 % 101) as f32).collect();
        let source = Plane {
            size,
            values: &values,
        };
        let levels = Levels::new(&source);
        let (cw, ch) = (camera.size.width(), camera.size.height());
        let sampler = Sampler::new(
            &source,
            &levels,
            wrap,
            camera,
            [0..i64::from(cw), 0..i64::from(ch)],
            false,
        );
        let mut out = Vec::new();
        sampler.each_row(0..ch as usize, |_, row| {
            out.extend(row.iter().map(|v| v[0]));
        });
        out
    }

    #[test]
    fn a_pixel_sees_the_mean_of_what_it_covers() {
        // 4 x 4 texels a pixel, whole cells: exactly the means.
        let map = Size::new(64, 32).unwrap();
        let camera = Camera2d::fit(map, Size::new(16, 8).unwrap(), 1.0);
        let got = seen(64, 32, &camera, Wrap::Clamp);
        for (i, got) in got.iter().enumerate() {
            let (x, y) = (i % 16 * 4, i / 16 * 4);
            let sum: usize = (0..16)
                .map(|k| ((y + k / 4) * 64 + x + k % 4) * 37 % 101)
                .sum();
            assert!((got - sum as f32 / 16.0).abs() < 1e-3);
        }
    }

    #[test]
    fn shares_are_whole_at_every_zoom_and_across_the_wrap() {
        let ones = |w: u32, h: u32, camera: &Camera2d| {
            let size = Size::new(w, h).unwrap();
            let values = vec![1.0; size.texels()];
            let source = Plane {
                size,
                values: &values,
            };
            let levels = Levels::new(&source);
            for smooth in [false, true] {
                let pixels = [-9..50, -9..50];
                let sampler = Sampler::new(&source, &levels, Wrap::Repeat, camera, pixels, smooth);
                sampler.each_row(0..59, |_, row| {
                    for v in row {
                        assert!((v[0] - 1.0).abs() < 1e-4, "{camera:?}: {}", v[0]);
                    }
                });
            }
        };
        for zoom in [0.001, 0.013, 0.3, 0.77, 1.0, 1.5, 3.0, 17.3] {
            for texel_aspect in [0.4, 1.0, 3.0] {
                let camera = Camera2d {
                    centre: DVec2::new(0.1, 0.95),
                    zoom,
                    texel_aspect,
                    size: Size::new(41, 41).unwrap(),
                    repeat: true,
                };
                ones(64, 48, &camera);
                ones(37, 100, &camera);
                ones(1, 5, &camera);
            }
        }
    }

    #[test]
    fn nothing_is_seen_beside_a_map_that_ends() {
        let mut camera = Camera2d::fit(Size::new(4, 4).unwrap(), Size::new(8, 4).unwrap(), 1.0);
        let got = seen(4, 4, &camera, Wrap::Repeat);
        assert_eq!(got[1], 0.0);
        assert_eq!(got[3], 37.0);
        camera.repeat = true;
        assert_eq!(seen(4, 4, &camera, Wrap::Repeat)[1], 3.0 * 37.0 % 101.0);
        assert_eq!(seen(4, 4, &camera, Wrap::Clamp)[1], 0.0);
    }
}
