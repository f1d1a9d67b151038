//! The map at half, quarter, eighth size and so on, for canvases that show it smaller than it is.
//!
//! A texel of a level is the plain mean of the texels below it, so a pixel's box over a level is its box over the map. What is
//! averaged of a map is slope variance: the mean square of alpha_x and of alpha_y, and the double-angle vector of the direction
//! weighted with how anisotropic the texel is. Its sum with the first two is the covariance of the mean lobe (Olano and Baker
//! 2010), and alone it is the direction that the eye would find in the footprint.

use crate::map::{AnisoMap, Rect, Size};
use rayon::prelude::*;
use std::ops::Range;

/// A texel that is isotropic still has its direction averaged, with the weight of one this anisotropic.
const LEAST_WEIGHT: f32 = 1e-3;

/// Rows of numbers that can be averaged.
pub(super) trait Rows<const N: usize>: Sync {
    fn size(&self) -> Size;
    /// Writes the numbers of some columns of a row.
    fn row(&self, y: u32, columns: Range<usize>, out: &mut [[f32; N]]);
}

/// alpha_x², alpha_y², and the double-angle vector of the direction, as long as (alpha_x² - alpha_y²)/4 is large and of its
/// sign: with grooves along x it is turned round.
pub(super) type Averaged = [f32; 4];

impl Rows<4> for AnisoMap {
    fn size(&self) -> Size {
        Self::size(self)
    }

    fn row(&self, y: u32, columns: Range<usize>, out: &mut [Averaged]) {
        let start = y as usize * self.width() as usize;
        let range = start + columns.start..start + columns.end;
        let (ax, ay) = (
            &self.alpha_x()[range.clone()],
            &self.alpha_y()[range.clone()],
        );
        let (c, s) = (&self.cos2()[range.clone()], &self.sin2()[range]);
        for (i, out) in out.iter_mut().enumerate() {
            let (xx, yy) = (ax[i] * ax[i], ay[i] * ay[i]);
            let half = 0.25 * (xx - yy);
            let least = LEAST_WEIGHT * (xx + yy);
            let weight = if half > 0.0 {
                half.max(least)
            } else {
                half.min(-least)
            };
            *out = [xx, yy, c[i] * weight, s[i] * weight];
        }
    }
}

/// A plane of numbers in row order.
pub(super) struct Plane<'a> {
    pub(super) size: Size,
    pub(super) values: &'a [f32],
}

impl Rows<1> for Plane<'_> {
    fn size(&self) -> Size {
        self.size
    }

    fn row(&self, y: u32, columns: Range<usize>, out: &mut [[f32; 1]]) {
        let row = &self.values[y as usize * self.size.width() as usize..][columns];
        for (out, value) in out.iter_mut().zip(row) {
            *out = [*value];
        }
    }
}

/// Averages of N numbers a texel, from half size down to one texel: a third of the texels, at 4 N bytes each.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Levels<const N: usize> {
    size: Size,
    levels: Vec<Level<N>>,
}

#[derive(Clone, Debug, PartialEq)]
struct Level<const N: usize> {
    width: usize,
    height: usize,
    texels: Vec<[f32; N]>,
}

/// Along one side: how many texels of the map a cell of level `level` covers. The last cell may cover fewer.
fn covered(cell: usize, level: usize, texels: usize) -> usize {
    ((cell + 1) << level).min(texels) - (cell << level)
}

impl<const N: usize> Levels<N> {
    pub(super) fn new(source: &impl Rows<N>) -> Self {
        let size = source.size();
        let (mut width, mut height) = (size.width() as usize, size.height() as usize);
        let mut levels = Vec::new();
        while width * height > 1 {
            (width, height) = (width.div_ceil(2), height.div_ceil(2));
            levels.push(Level {
                width,
                height,
                texels: vec![[0.0; N]; width * height],
            });
        }
        let mut all = Self { size, levels };
        all.update(source, size.rect());
        all
    }

    /// Averages again what lies over a rectangle of the map; nothing where the rectangle lies outside.
    pub(super) fn update(&mut self, source: &impl Rows<N>, rect: Rect) {
        assert!(source.size() == self.size, "a map of the same size");
        let Some(rect) = rect.intersection(self.size.rect()) else {
            return;
        };
        let side = |start: u32, length: u32| start as usize..(start + length) as usize;
        let (mut columns, mut rows) = (side(rect.x, rect.width), side(rect.y, rect.height));
        let (w, h) = (self.size.width() as usize, self.size.height() as usize);
        for i in 0..self.levels.len() {
            columns = columns.start / 2..columns.end.div_ceil(2);
            rows = rows.start / 2..rows.end.div_ceil(2);
            let (below, above) = self.levels.split_at_mut(i);
            let next = &mut above[0];
            match below.last() {
                None => next.fill(&columns, &rows, i, (w, h), |y, columns, out| {
                    source.row(u32::try_from(y).expect("a row of the map"), columns, out);
                }),
                Some(level) => next.fill(&columns, &rows, i, (w, h), |y, columns, out| {
                    out.copy_from_slice(&level.texels[y * level.width..][columns]);
                }),
            }
        }
    }

    pub(super) fn count(&self) -> usize {
        self.levels.len()
    }

    /// Width and numbers of level `level`, 1 the first.
    pub(super) fn level(&self, level: usize) -> (usize, &[[f32; N]]) {
        let level = &self.levels[level - 1];
        (level.width, &level.texels)
    }

    /// The first level with no more than so many texels.
    pub(super) fn at_most(&self, texels: usize) -> Option<&[[f32; N]]> {
        self.levels
            .iter()
            .map(|level| &level.texels[..])
            .find(|t| t.len() <= texels)
    }
}

impl<const N: usize> Level<N> {
    /// Averages two by two cells of the level below, which is number `below`; 0 is the map, of `map` texels.
    fn fill(
        &mut self,
        columns: &Range<usize>,
        rows: &Range<usize>,
        below: usize,
        map: (usize, usize),
        row: impl Fn(usize, Range<usize>, &mut [[f32; N]]) + Sync,
    ) {
        // What the left and the upper one of two cells count for.
        let share = |i: usize, texels: usize| {
            let first = covered(2 * i, below, texels) as f32;
            let both = covered(i, below + 1, texels) as f32;
            first / both
        };
        let shares: Vec<f32> = columns.clone().map(|x| share(x, map.0)).collect();
        let cells = |i: usize, texels: usize| texels.div_ceil(1 << below).min(2 * i + 2);
        let under = 2 * columns.start..cells(columns.end - 1, map.0);
        self.texels
            .par_chunks_mut(self.width)
            .enumerate()
            .skip(rows.start)
            .take(rows.len())
            .with_min_len(8)
            .for_each_init(
                || (vec![[0.0; N]; under.len()], vec![[0.0; N]; under.len()]),
                |(upper, lower), (y, out)| {
                    row(2 * y, under.clone(), upper);
                    let last = cells(y, map.1) - 1;
                    row(last, under.clone(), lower);
                    let down = if last > 2 * y { share(y, map.1) } else { 1.0 };
                    for (i, out) in out[columns.clone()].iter_mut().enumerate() {
                        let (left, right) = (2 * i, (2 * i + 1).min(under.len() - 1));
                        for c in 0..N {
                            let across = |row: &[[f32; N]]| {
                                row[left][c] * shares[i] + row[right][c] * (1.0 - shares[i])
                            };
                            out[c] = across(upper) * down + across(lower) * (1.0 - down);
                        }
                    }
                },
            );
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn plane(w: u32, h: u32) -> (Size, Vec<f32>) {
        let size = Size::new(w, h).unwrap();
        let values = (0..size.texels())
            .map(|i| ((i * 37 + i * i * 11) % 101) as f32)
            .collect();
        (size, values)
    }

    #[test]
    fn every_level_holds_plain_means_whatever_the_size() {
        for (w, h) in [(64, 64), (37, 100), (5, 3), (1, 9), (13, 1), (1, 1)] {
            let (size, values) = plane(w, h);
            let levels = Levels::new(&Plane {
                size,
                values: &values,
            });
            for level in 1..=levels.count() {
                let (width, texels) = levels.level(level);
                for (i, got) in texels.iter().enumerate() {
                    let cell = 1usize << level;
                    let (x, y) = (i % width * cell, i / width * cell);
                    let rows = y..(y + cell).min(h as usize);
                    let under: Vec<f32> = rows
                        .flat_map(|y| (x..(x + cell).min(w as usize)).map(move |x| (x, y)))
                        .map(|(x, y)| values[y * w as usize + x])
                        .collect();
                    let want = under.iter().sum::<f32>() / under.len() as f32;
                    assert!((got[0] - want).abs() < 1e-3, "{w}x{h} level {level} {i}");
                }
            }
            assert!(size.texels() == 1 || levels.level(levels.count()).1.len() == 1);
        }
    }

    #[test]
    fn changing_a_rectangle_is_making_them_anew() {
        for (w, h) in [(64, 64), (37, 100), (5, 3), (1, 9)] {
            let (size, mut values) = plane(w, h);
            let mut levels = Levels::new(&Plane {
                size,
                values: &values,
            });
            for k in 0..6 {
                let rect = Rect {
                    x: k * 7 % w,
                    y: k * 11 % h,
                    width: 1 + 5 * k,
                    height: 3,
                };
                let rect = rect.intersection(size.rect()).unwrap();
                for y in rect.y..rect.y + rect.height {
                    for x in rect.x..rect.x + rect.width {
                        values[size.rect().index(x, y)] = (k + x) as f32;
                    }
                }
                let source = Plane {
                    size,
                    values: &values,
                };
                levels.update(&source, rect);
                assert!(levels == Levels::new(&source), "{w}x{h} {rect:?}");
            }
        }
    }
}
