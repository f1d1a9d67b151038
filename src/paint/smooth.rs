//! What the smooth brush sees: the mean of a texel's surroundings, of widths and of double angles.

use super::composite::Planes;
use super::laid::Ground;
use super::skin::NO_CHART;
use crate::map::{Rect, Wrap, settle};
use rayon::prelude::*;
use std::collections::BTreeMap;

/// Samples to each side at most; a wider look takes every second texel, every third, and so on.
const SAMPLES_MAX: f32 = 16.0;

/// A tent across and a tent down, of finite reach.
pub(super) struct Kernel {
    across: Tent,
    down: Tent,
    wrap: Wrap,
    width: u32,
    height: u32,
}

/// Weights of every `step`th texel, falling evenly to zero past the reach.
struct Tent {
    step: u32,
    weights: Vec<f32>,
}

impl Tent {
    fn new(reach: f32) -> Self {
        let step = (reach / SAMPLES_MAX).ceil().max(1.0);
        let n = (reach / step).floor() as i32;
        let weights = (-n..=n).map(|i| 1.0 - i.abs() as f32 * step / (reach + step));
        let weights: Vec<f32> = weights.collect();
        let sum: f32 = weights.iter().sum();
        Self {
            step: step as u32,
            weights: weights.iter().map(|w| w / sum).collect(),
        }
    }

    /// How many texels it reaches to each side.
    fn reach(&self) -> u32 {
        (self.weights.len() as u32 / 2) * self.step
    }
}

/// Means of the texels of a rectangle.
pub(super) struct Mean {
    rect: Rect,
    planes: [Vec<f32>; 4],
}

impl Mean {
    pub(super) fn planes(&self) -> Planes<'_> {
        Planes {
            rect: self.rect,
            planes: self.planes.each_ref().map(Vec::as_slice),
        }
    }
}

impl Kernel {
    /// A kernel that reaches so far in surface units.
    pub(super) fn new(reach: f32, ground: &Ground) -> Self {
        let grid = &ground.grid;
        Self {
            across: Tent::new(reach / grid.texel.x),
            down: Tent::new(reach / grid.texel.y),
            wrap: ground.wrap,
            width: grid.width,
            height: grid.height,
        }
    }

    /// The rectangle that must be known for the means of `rect`: past an edge where the map repeats, all there is.
    pub(super) fn grown(&self, rect: Rect) -> Rect {
        let grow = |from: u32, n: u32, by: u32, all: u32, repeats: bool| {
            if repeats && (from < by || from + n + by > all) {
                return (0, all);
            }
            let low = from.saturating_sub(by);
            (low, (from + n + by).min(all) - low)
        };
        let (x, width) = grow(
            rect.x,
            rect.width,
            self.across.reach(),
            self.width,
            self.wrap.repeats_u(),
        );
        let (y, height) = grow(
            rect.y,
            rect.height,
            self.down.reach(),
            self.height,
            self.wrap.repeats_v(),
        );
        Rect {
            x,
            y,
            width,
            height,
        }
    }

    /// The means of the texels of `rect`, from planes that hold [`Kernel::grown`] of it.
    pub(super) fn mean(&self, rect: Rect, from: &Planes<'_>) -> Mean {
        let planes = from
            .planes
            .map(|plane| self.plane_mean(rect, from.rect, plane));
        let mut mean = Mean { rect, planes };
        mean.settle();
        mean
    }

    /// The same, each texel's of the texels of its own chart alone: what lies beside a chart in the layout may be far from it on
    /// the mesh. `charts` tells the charts of a rectangle's texels in row order.
    pub(super) fn mean_apart(
        &self,
        rect: Rect,
        from: &Planes<'_>,
        charts: impl Fn(Rect) -> Vec<u32>,
    ) -> Mean {
        let own = charts(rect);
        let mut planes = from.planes.map(|plane| crop(from.rect, plane, rect));
        for (chart, part) in parts(rect, &own) {
            let held = self.grown(part);
            let is_of = charts(held);
            let is_of: Vec<f32> = is_of
                .iter()
                .map(|c| if *c == chart { 1.0 } else { 0.0 })
                .collect();
            let weight = self.plane_mean(part, held, &is_of);
            for (to, plane) in planes.iter_mut().zip(from.planes) {
                let mut masked = crop(from.rect, plane, held);
                masked.iter_mut().zip(&is_of).for_each(|(m, of)| *m *= of);
                let sum = self.plane_mean(part, held, &masked);
                for i in 0..part.texels() {
                    let (x, y) = (i as u32 % part.width, i as u32 / part.width);
                    let at = rect.index(part.x + x, part.y + y);
                    if own[at] == chart {
                        to[at] = sum[i] / weight[i];
                    }
                }
            }
        }
        let mut mean = Mean { rect, planes };
        mean.settle();
        mean
    }

    fn plane_mean(&self, rect: Rect, held: Rect, plane: &[f32]) -> Vec<f32> {
        let n = rect.width as usize;
        let (left, up) = (self.across.reach(), self.down.reach());
        let rows = rect.height + 2 * up;
        let mut middle = vec![0.0f32; rows as usize * n];
        let across = middle.par_chunks_mut(n).enumerate();
        across.for_each_init(Vec::new, |padded, (j, out)| {
            let y = self
                .wrap
                .row(i64::from(rect.y) + j as i64 - i64::from(up), self.height);
            let row = held.index(held.x, y);
            padded.clear();
            padded.extend((0..rect.width + 2 * left).map(|i| {
                let x = i64::from(rect.x) + i64::from(i) - i64::from(left);
                plane[row + (self.wrap.column(x, self.width) - held.x) as usize]
            }));
            for (k, weight) in self.across.weights.iter().enumerate() {
                let shifted = &padded[k * self.across.step as usize..];
                add(out, shifted, *weight);
            }
        });
        let mut mean = vec![0.0f32; rect.texels()];
        mean.par_chunks_mut(n).enumerate().for_each(|(j, out)| {
            for (k, weight) in self.down.weights.iter().enumerate() {
                add(
                    out,
                    &middle[(j + k * self.down.step as usize) * n..],
                    *weight,
                );
            }
        });
        mean
    }
}

/// A rectangle of a plane.
fn crop(held: Rect, plane: &[f32], rect: Rect) -> Vec<f32> {
    let n = rect.width as usize;
    let rows = rect.y..rect.y + rect.height;
    rows.flat_map(|y| {
        let start = held.index(rect.x, y);
        &plane[start..start + n]
    })
    .copied()
    .collect()
}

/// The charts of a rectangle's texels, each with the part of the rectangle that holds it.
fn parts(rect: Rect, charts: &[u32]) -> BTreeMap<u32, Rect> {
    let mut parts: BTreeMap<u32, Rect> = BTreeMap::new();
    for (i, chart) in charts.iter().enumerate().filter(|(_, c)| **c != NO_CHART) {
        let texel = Rect {
            x: rect.x + i as u32 % rect.width,
            y: rect.y + i as u32 / rect.width,
            width: 1,
            height: 1,
        };
        let part = parts.entry(*chart).or_insert(texel);
        *part = part.hull(texel);
    }
    parts
}

fn add(out: &mut [f32], row: &[f32], weight: f32) {
    for (o, r) in out.iter_mut().zip(row) {
        *o += r * weight;
    }
}

impl Mean {
    fn settle(&mut self) {
        let [ax, ay, c, s] = &mut self.planes;
        for i in 0..ax.len() {
            let texel = settle(ax[i], ay[i], c[i], s[i]);
            (ax[i], ay[i]) = (texel.alpha_x, texel.alpha_y);
            (c[i], s[i]) = (texel.axis.cos2, texel.axis.sin2);
        }
    }
}
