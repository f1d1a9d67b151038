//! Scratches: many single strokes, each with its own direction and widths, over whatever lies below.

use super::lattice::{hash, seed32, unit};
use super::{Fill, Parameter, Patch, Surface};
use crate::coverage::{Grid, Part, Stroke};
use crate::error::{Error, Result};
use crate::map::{ALPHA_MAX, ALPHA_MIN, DEFAULT_TEXEL, Rect, SlopeCovariance, Texel};
use crate::math::{Axis, exp, ln};
use glam::Vec2;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use std::f32::consts::TAU;

/// Single scratches, hundreds to hundreds of thousands. Covers only what they touch; its value, for masks, is that coverage.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Scratches {
    /// How many, for one turn of UV.
    pub count: u32,
    /// Mean length, surface units.
    pub length: f32,
    /// Relative spread of the length (standard deviation of its logarithm).
    pub length_spread: f32,
    /// Mean width, surface units. Thinner than a texel is fainter, not broader.
    pub width: f32,
    /// Relative spread of the width.
    pub width_spread: f32,
    /// Bend over a scratch's length, degrees (standard deviation).
    pub curvature: f32,
    /// Mean direction, degrees counter-clockwise from +U.
    pub angle: f32,
    /// Spread of the direction, degrees to either side; 90 is every direction alike.
    pub angle_spread: f32,
    /// How much of what lies below a scratch replaces, 0 to 1.
    pub depth: f32,
    /// Relative spread of the depth: the faintest scratch has depth x (1 - spread).
    pub depth_spread: f32,
    /// Slope width along a scratch.
    pub alpha_along: f32,
    /// Slope width across a scratch.
    pub alpha_across: f32,
    /// Relative spread of both widths from scratch to scratch.
    pub spread: f32,
}

impl Default for Scratches {
    fn default() -> Self {
        Self {
            count: 1000,
            length: 0.1,
            length_spread: 0.5,
            width: 0.002,
            width_spread: 0.3,
            curvature: 10.0,
            angle: 0.0,
            angle_spread: 90.0,
            depth: 0.8,
            depth_spread: 0.5,
            alpha_along: 0.05,
            alpha_across: 0.35,
            spread: 0.2,
        }
    }
}

/// Side of the tiles that strokes are sorted into, texels.
const TILE: u32 = 64;
/// The most texels that all scratches may touch together: a minute or two of work.
const WORK_MAX: f64 = 2e10;

impl Scratches {
    pub(super) const PARAMETERS: &[Parameter] = &[
        Parameter::new(
            "count",
            "",
            0.0..=1e6,
            "how many scratches, for one turn of UV",
        ),
        Parameter::new("length", "surface units", 1e-3..=10.0, "mean length"),
        Parameter::new(
            "length_spread",
            "",
            0.0..=2.0,
            "relative spread of the length",
        ),
        Parameter::new("width", "surface units", 1e-5..=1.0, "mean width"),
        Parameter::new(
            "width_spread",
            "",
            0.0..=2.0,
            "relative spread of the width",
        ),
        Parameter::new(
            "curvature",
            "degrees",
            0.0..=360.0,
            "bend over a scratch's length (standard deviation)",
        ),
        Parameter::angle("angle", "mean direction"),
        Parameter::new(
            "angle_spread",
            "degrees",
            0.0..=90.0,
            "spread of the direction to either side; 90 is every direction",
        ),
        Parameter::fraction("depth", "how much of what lies below a scratch replaces"),
        Parameter::fraction("depth_spread", "relative spread of the depth"),
        Parameter::alpha("alpha_along", "width along a scratch"),
        Parameter::alpha("alpha_across", "width across a scratch"),
        Parameter::fraction(
            "spread",
            "relative spread of both widths from scratch to scratch",
        ),
    ];

    /// Refuses what would take hours: the texels that all scratches touch together.
    fn check_work(&self, surface: &Surface) -> Result<()> {
        let texel = surface.texel();
        let (longest, shortest) = (texel.max_element(), texel.min_element());
        // A lognormal's mean is e^(s²/2) times its median.
        let mean =
            |median: f32, spread: f32| f64::from(median) * f64::from(0.5 * spread * spread).exp();
        let long = mean(self.length, self.length_spread) / f64::from(shortest) + 2.0;
        let wide = mean(self.width, self.width_spread) / f64::from(longest) + 3.0;
        let touched = f64::from(self.count) * long * wide;
        if touched <= WORK_MAX {
            return Ok(());
        }
        Err(Error::invalid(
            "count",
            format!(
                "{}, which at this length, width and size covers about {touched:.1e} texels",
                self.count
            ),
            format!("allowed: up to {WORK_MAX:.0e} covered texels"),
        )
        .with_hint("Lower count, length or width, or fill a smaller map"))
    }

    pub(super) fn prepare(&self, surface: &Surface) -> Result<Marks> {
        self.check_work(surface)?;
        let grid = Grid {
            size: surface.size,
            extent: surface.extent(),
        };
        let tolerance = 0.125 * grid.texel().min_element().max(1e-5);
        let seed = seed32(surface.seed, 3);
        // Each scratch has its own random numbers, so they may be made side by side and stay in order.
        let marks: Vec<Mark> = (0..self.count)
            .into_par_iter()
            .filter_map(|n| self.mark(surface.extent(), &mut Random::new(seed, n), tolerance))
            .collect();
        let mut marks = Marks {
            grid,
            columns: surface.size.width().div_ceil(TILE),
            tiles: Vec::new(),
            marks,
        };
        marks.sort_into_tiles(surface);
        Ok(marks)
    }

    /// One scratch and its finish.
    fn mark(&self, extent: Vec2, random: &mut Random, tolerance: f32) -> Option<Mark> {
        let stroke = self.stroke(extent, random, tolerance)?;
        let gain = self.spread * random.normal();
        let clamp = |alpha: f32| (alpha * exp(gain)).clamp(ALPHA_MIN, ALPHA_MAX);
        Some(Mark {
            stroke,
            alpha_along: clamp(self.alpha_along),
            alpha_across: clamp(self.alpha_across),
            depth: self.depth * (1.0 - self.depth_spread * random.unit()),
        })
    }

    /// One scratch, in surface units.
    fn stroke(&self, extent: Vec2, random: &mut Random, tolerance: f32) -> Option<Stroke> {
        let middle = Vec2::new(random.unit(), random.unit()) * extent;
        let lean = if self.angle_spread >= 90.0 {
            180.0 * random.unit()
        } else {
            self.angle_spread * 0.5 * random.normal().clamp(-2.0, 2.0)
        };
        let direction = Axis::from_degrees(self.angle + lean).direction();
        let length = (self.length * exp(self.length_spread * random.normal())).min(20.0);
        let width = self.width * exp(self.width_spread * random.normal());
        // A quadratic whose ends turn by `bend` against each other leaves its chord by a quarter of length x bend / 2.
        let bend = (self.curvature * random.normal())
            .clamp(-180.0, 180.0)
            .to_radians();
        let half = 0.5 * length * direction;
        let control = middle + direction.perp() * (0.25 * length * bend);
        Stroke::quadratic(middle - half, control, middle + half, width, tolerance)
    }
}

/// A prepared [`Scratches`]: strokes in order, and for each tile the parts of strokes that may touch it.
pub(super) struct Marks {
    grid: Grid,
    columns: u32,
    tiles: Vec<Vec<Entry>>,
    marks: Vec<Mark>,
}

struct Mark {
    stroke: Stroke,
    alpha_along: f32,
    alpha_across: f32,
    depth: f32,
}

/// What one stroke, moved by whole periods, does in one tile.
#[derive(Clone, Copy)]
struct Entry {
    mark: u32,
    segments: (u8, u8),
    periods: (i8, i8),
}

impl Marks {
    /// Sorts the strokes into tiles, with their copies over the edges where the surface repeats.
    fn sort_into_tiles(&mut self, surface: &Surface) {
        let rows = surface.size.height().div_ceil(TILE);
        self.tiles = vec![Vec::new(); (self.columns * rows) as usize];
        let extent = surface.extent();
        let longest = 0.5 * TILE as f32 * self.grid.texel().min_element();
        // The periods that the box from `low` to `high` reaches into.
        let reached = |low: f32, high: f32, period: f32, repeats: bool| {
            let number = |x: f32| {
                if repeats {
                    (x / period).floor().clamp(-100.0, 100.0) as i8
                } else {
                    0
                }
            };
            number(low)..=number(high)
        };
        for (n, mark) in self.marks.iter().enumerate() {
            mark.stroke
                .boxes(&self.grid, longest, |segment, low, high| {
                    for j in reached(low.y, high.y, extent.y, surface.wrap.repeats_v()) {
                        for i in reached(low.x, high.x, extent.x, surface.wrap.repeats_u()) {
                            let offset = Vec2::new(f32::from(-i), f32::from(-j)) * extent;
                            let Some(touched) = self.grid.cover(low + offset, high + offset) else {
                                continue;
                            };
                            for row in touched.y / TILE..=(touched.y + touched.height - 1) / TILE {
                                for column in
                                    touched.x / TILE..=(touched.x + touched.width - 1) / TILE
                                {
                                    let tile =
                                        &mut self.tiles[(row * self.columns + column) as usize];
                                    enter(tile, n as u32, segment, (-i, -j));
                                }
                            }
                        }
                    }
                });
        }
    }
}

/// Adds a segment to a tile. Strokes come in order, and so do their segments: only the last few entries can be the same copy.
fn enter(tile: &mut Vec<Entry>, mark: u32, segment: u8, periods: (i8, i8)) {
    let same = tile
        .iter_mut()
        .rev()
        .take_while(|e| e.mark == mark)
        .find(|e| e.periods == periods);
    match same {
        Some(entry) => entry.segments.1 = segment,
        None => tile.push(Entry {
            mark,
            segments: (segment, segment),
            periods,
        }),
    }
}

impl Fill for Marks {
    fn fill(&self, patch: &mut Patch<'_>) {
        let rect = patch.region.rect;
        // Scratches crossing in one texel are averaged as the lobes they are; `sum` is weighted by coverage.
        let mut sum = vec![SlopeCovariance::default(); rect.texels()];
        patch.coverage.fill(0.0);
        let mut row = Vec::new();
        let tiles = |low: u32, n: u32| low / TILE..=(low + n - 1) / TILE;
        for j in tiles(rect.y, rect.height) {
            for i in tiles(rect.x, rect.width) {
                let tile = Rect {
                    x: i * TILE,
                    y: j * TILE,
                    width: TILE,
                    height: TILE,
                };
                let Some(part) = tile.intersection(rect) else {
                    continue;
                };
                for entry in &self.tiles[(j * self.columns + i) as usize] {
                    let mark = &self.marks[entry.mark as usize];
                    let shift = Vec2::new(f32::from(entry.periods.0), f32::from(entry.periods.1));
                    let copy = Part {
                        segments: entry.segments,
                        offset: shift * self.grid.extent,
                    };
                    mark.stroke.cover(
                        copy,
                        &self.grid,
                        part,
                        &mut row,
                        |place, coverage, direction| {
                            // From the part's row order to the patch's.
                            let (x, y) = (place as u32 % part.width, place as u32 / part.width);
                            let at = rect.index(part.x + x, part.y + y);
                            let c = coverage * mark.depth;
                            let texel = Texel {
                                alpha_x: mark.alpha_along,
                                alpha_y: mark.alpha_across,
                                axis: Axis::from_vector(direction).unwrap_or_default(),
                            };
                            sum[at] = sum[at] * (1.0 - c) + SlopeCovariance::from(texel) * c;
                            patch.coverage[at] += c * (1.0 - patch.coverage[at]);
                        },
                    );
                }
            }
        }
        for (at, sum) in sum.iter().enumerate() {
            let coverage = patch.coverage[at];
            patch.value[at] = coverage;
            patch.region.set(
                at,
                if coverage > 0.0 {
                    (*sum * (1.0 / coverage)).to_texel(false, Axis::U)
                } else {
                    DEFAULT_TEXEL
                },
            );
        }
    }
}

/// Random numbers of one stroke: counted, so that stroke n does not depend on how many came before.
struct Random {
    seed: u32,
    count: u32,
}

impl Random {
    fn new(seed: u32, stroke: u32) -> Self {
        Self {
            seed: hash(stroke, seed),
            count: 0,
        }
    }

    /// Uniform in [0, 1).
    fn unit(&mut self) -> f32 {
        self.count += 1;
        unit(hash(self.count, self.seed) >> 8)
    }

    /// Normal, mean 0 and deviation 1 (Box and Muller 1958).
    fn normal(&mut self) -> f32 {
        let radius = (-2.0 * ln(self.unit().max(1e-7))).sqrt();
        radius * crate::math::sin_cos(TAU * self.unit()).1
    }
}

#[cfg(test)]
mod tests {
    use super::super::tests::filled;
    use super::super::{Pattern, Surface};
    use super::*;
    use crate::map::{Size, Wrap};

    fn surface(n: u32) -> Surface {
        Surface {
            size: Size::new(n, n).unwrap(),
            aspect: 1.0,
            wrap: Wrap::Repeat,
            seed: 9,
        }
    }

    #[test]
    fn scratches_run_the_way_they_are_told_and_more_cover_more() {
        let few = Scratches {
            count: 60,
            angle: 30.0,
            angle_spread: 4.0,
            curvature: 0.0,
            ..Default::default()
        };
        let (map, coverage, _) = filled(&Pattern::Scratches(few.clone()), &surface(256), 4096);
        let want = Axis::from_degrees(30.0);
        let off = (0..map.size().texels())
            .filter(|i| coverage[*i] > 0.3)
            .map(|i| map.texel_at(i).groove().angle_to(want).to_degrees())
            .fold(0.0f32, f32::max);
        assert!(off < 10.0, "{off}");
        let area = |c: &[f32]| c.iter().sum::<f32>() / c.len() as f32;
        let (_, more, _) = filled(
            &Pattern::Scratches(Scratches { count: 600, ..few }),
            &surface(256),
            4096,
        );
        assert!(area(&coverage) > 1e-3 && area(&more) > 4.0 * area(&coverage));
    }

    #[test]
    fn more_than_can_be_drawn_is_refused_in_words() {
        let endless = Scratches {
            count: 1_000_000,
            length: 10.0,
            width: 1.0,
            ..Default::default()
        };
        let error = Pattern::Scratches(endless)
            .prepare(&surface(1024))
            .err()
            .expect("too much");
        assert!(error.to_string().contains("Lower count"), "{error}");
    }

    #[test]
    fn scratches_go_on_over_the_edges() {
        let long = Scratches {
            count: 3,
            length: 3.0,
            length_spread: 0.0,
            width: 0.02,
            curvature: 60.0,
            angle: 20.0,
            ..Default::default()
        };
        let (_, coverage, _) = filled(&Pattern::Scratches(long), &surface(128), 4096);
        let at = |x: usize, y: usize| coverage[y * 128 + x];
        let covered = (0..128).filter(|y| at(0, *y) > 0.3).count();
        let met = (0..128)
            .filter(|y| at(0, *y) > 0.3 && (0..3).any(|d| at(127, (y + 127 + d) % 128) > 0.1))
            .count();
        assert!(covered > 3 && met == covered, "{met} of {covered} go on");
    }

    #[test]
    fn no_scratches_and_very_long_ones_are_both_fine() {
        for scratches in [
            Scratches {
                count: 0,
                ..Default::default()
            },
            Scratches {
                count: 5,
                length: 10.0,
                width: 1.0,
                ..Default::default()
            },
        ] {
            let (_, coverage, _) = filled(&Pattern::Scratches(scratches.clone()), &surface(64), 32);
            assert_eq!(coverage.iter().all(|c| *c == 0.0), scratches.count == 0);
        }
    }
}
