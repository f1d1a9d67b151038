//! Scratches: many single strokes, each with its own direction and widths, over whatever lies below.

use super::lattice::{hash, seed32, unit};
use super::{Fill, Parameter, Patch, Surface};
use crate::coverage::{Grid, Stroke};
use crate::map::{ALPHA_MAX, ALPHA_MIN, DEFAULT_TEXEL, Rect, SlopeCovariance, Texel};
use crate::math::{Axis, exp, ln};
use glam::Vec2;
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

    pub(super) fn prepare(&self, surface: &Surface) -> Marks {
        let grid = Grid {
            size: surface.size,
            extent: surface.extent(),
        };
        let tolerance = 0.125 * grid.texel().min_element().max(1e-5);
        let columns = surface.size.width().div_ceil(TILE);
        let rows = surface.size.height().div_ceil(TILE);
        let mut marks = Marks {
            grid,
            columns,
            tiles: vec![Vec::new(); (columns * rows) as usize],
            marks: Vec::new(),
        };
        for n in 0..self.count {
            let mut random = Random::new(seed32(surface.seed, 3), n);
            let Some(stroke) = self.stroke(surface.extent(), &mut random, tolerance) else {
                continue;
            };
            let gain = self.spread * random.normal();
            let clamp = |alpha: f32| (alpha * exp(gain)).clamp(ALPHA_MIN, ALPHA_MAX);
            let mark = Mark {
                stroke,
                alpha_along: clamp(self.alpha_along),
                alpha_across: clamp(self.alpha_across),
                depth: self.depth * (1.0 - self.depth_spread * random.unit()),
            };
            marks.add(mark, surface);
        }
        marks
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

/// A prepared [`Scratches`]: strokes in order, and for each tile the strokes that may touch it.
pub(super) struct Marks {
    grid: Grid,
    columns: u32,
    tiles: Vec<Vec<u32>>,
    marks: Vec<Mark>,
}

struct Mark {
    stroke: Stroke,
    alpha_along: f32,
    alpha_across: f32,
    depth: f32,
}

impl Marks {
    /// Adds a mark, and its copies over the edges where the surface repeats.
    fn add(&mut self, mark: Mark, surface: &Surface) {
        let extent = surface.extent();
        let (low, high) = mark.stroke.bounds(&self.grid);
        let shifts = |low: f32, high: f32, period: f32, repeats: bool| {
            // A copy is needed for every period that the stroke reaches into.
            let reach = |x: f32| {
                if repeats {
                    (x / period).floor().clamp(-20.0, 20.0) as i32
                } else {
                    0
                }
            };
            -reach(high)..=-reach(low)
        };
        for j in shifts(low.y, high.y, extent.y, surface.wrap.repeats_v()) {
            for i in shifts(low.x, high.x, extent.x, surface.wrap.repeats_u()) {
                let by = Vec2::new(i as f32, j as f32) * extent;
                let Some(touched) = self.grid.cover(low + by, high + by) else {
                    continue;
                };
                let index = self.marks.len() as u32;
                for row in touched.y / TILE..=(touched.y + touched.height - 1) / TILE {
                    for column in touched.x / TILE..=(touched.x + touched.width - 1) / TILE {
                        self.tiles[(row * self.columns + column) as usize].push(index);
                    }
                }
                let stroke = if by == Vec2::ZERO {
                    mark.stroke.clone()
                } else {
                    mark.stroke.translated(by)
                };
                self.marks.push(Mark { stroke, ..mark });
            }
        }
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
                for &n in &self.tiles[(j * self.columns + i) as usize] {
                    let mark = &self.marks[n as usize];
                    mark.stroke
                        .cover(&self.grid, part, &mut row, |place, coverage, direction| {
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
                        });
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
