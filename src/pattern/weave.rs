//! Woven cloth: two sets of threads, each with its own fibres, passing over and under.

use super::lattice::{hash, seed32, unit};
use super::{Fill, Parameter, Patch, Surface};
use crate::map::{ALPHA_MAX, ALPHA_MIN, SlopeCovariance, Texel};
use crate::math::{Axis, exp};
use glam::Vec2;
use serde::{Deserialize, Serialize};

/// Which threads pass over which.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum WeaveStyle {
    /// Over one, under one.
    Canvas,
    /// Over `float`, under one, shifted by one thread from row to row: diagonal ribs.
    Twill,
    /// Over `float`, under one, the crossings scattered: a smooth face of warp.
    #[default]
    Satin,
}

/// One set of threads.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Thread {
    /// Direction of the fibres against the thread (its twist), degrees counter-clockwise.
    pub twist: f32,
    /// Slope width along the fibres.
    pub alpha_along: f32,
    /// Slope width across the fibres.
    pub alpha_across: f32,
}

impl Default for Thread {
    fn default() -> Self {
        Self {
            twist: 0.0,
            alpha_along: 0.12,
            alpha_across: 0.45,
        }
    }
}

/// Woven cloth: the warp runs along V (up), the weft along U. Its value, for masks, is 1 on warp, 0 on weft and 0.5 in the gaps.
///
/// On a surface that repeats, the thread counts are rounded so that the weave closes.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Weave {
    /// Which threads pass over which.
    pub style: WeaveStyle,
    /// Warp threads per surface unit.
    pub warp_threads: f32,
    /// Weft threads per surface unit.
    pub weft_threads: f32,
    /// Threads that a warp thread passes over at once. Not for canvas.
    pub float: u32,
    /// Share of a thread's pitch that is gap.
    pub gap: f32,
    /// Slope width, the same every way, of what is seen in the gaps.
    pub gap_alpha: f32,
    /// Relative spread of the widths from thread to thread.
    pub spread: f32,
    /// Wander of the fibres from thread to thread, degrees (standard deviation).
    pub wander: f32,
    /// The threads along V.
    pub warp: Thread,
    /// The threads along U.
    pub weft: Thread,
}

impl Default for Weave {
    fn default() -> Self {
        Self {
            style: WeaveStyle::Satin,
            warp_threads: 40.0,
            weft_threads: 40.0,
            float: 4,
            gap: 0.08,
            gap_alpha: 0.5,
            spread: 0.1,
            wander: 2.0,
            warp: Thread::default(),
            weft: Thread::default(),
        }
    }
}

impl Weave {
    pub(super) const PARAMETERS: &[Parameter] = &[
        Parameter::new(
            "warp_threads",
            "threads per surface unit",
            0.1..=5000.0,
            "warp threads",
        ),
        Parameter::new(
            "weft_threads",
            "threads per surface unit",
            0.1..=5000.0,
            "weft threads",
        ),
        Parameter::new(
            "float",
            "threads",
            1.0..=15.0,
            "threads that a warp thread passes over at once",
        ),
        Parameter::new(
            "gap",
            "",
            0.0..=0.9,
            "share of a thread's pitch that is gap",
        ),
        Parameter::alpha("gap_alpha", "width of what is seen in the gaps"),
        Parameter::fraction(
            "spread",
            "relative spread of the widths from thread to thread",
        ),
        Parameter::new(
            "wander",
            "degrees",
            0.0..=30.0,
            "wander of the fibres from thread to thread (standard deviation)",
        ),
        Parameter::new(
            "warp.twist",
            "degrees",
            -60.0..=60.0,
            "direction of the warp's fibres against the thread",
        ),
        Parameter::alpha("warp.alpha_along", "width along the warp's fibres"),
        Parameter::alpha("warp.alpha_across", "width across the warp's fibres"),
        Parameter::new(
            "weft.twist",
            "degrees",
            -60.0..=60.0,
            "direction of the weft's fibres against the thread",
        ),
        Parameter::alpha("weft.alpha_along", "width along the weft's fibres"),
        Parameter::alpha("weft.alpha_across", "width across the weft's fibres"),
    ];

    pub(super) fn prepare(&self, surface: &Surface) -> Cloth {
        let float = if self.style == WeaveStyle::Canvas {
            1
        } else {
            self.float
        };
        let period = float + 1;
        let step = match self.style {
            WeaveStyle::Satin => satin_step(period),
            _ => 1,
        };
        let extent = surface.extent();
        // Whole repeats of the weave, so that it closes.
        let count = |density: f32, length: f32, repeats: bool| {
            let n = density * length;
            if repeats {
                ((n / period as f32).round().max(1.0)) * period as f32
            } else {
                n
            }
        };
        let threads = Vec2::new(
            count(self.warp_threads, extent.x, surface.wrap.repeats_u()),
            count(self.weft_threads, extent.y, surface.wrap.repeats_v()),
        );
        Cloth {
            weave: self.clone(),
            surface: *surface,
            period: period as usize,
            step: step as usize,
            per_unit: threads / extent,
            warp: self.threads(
                &self.warp,
                Axis::V,
                numbers(threads.x),
                seed32(surface.seed, 4),
            ),
            weft: self.threads(
                &self.weft,
                Axis::U,
                numbers(threads.y),
                seed32(surface.seed, 5),
            ),
        }
    }

    /// The texel of each of `count` threads: the same fibres, a little different from thread to thread.
    fn threads(&self, thread: &Thread, run: Axis, count: u32, seed: u32) -> Vec<Texel> {
        // Three uniforms stand in for a normal: bounded, and smooth enough for threads.
        let normal = |h: u32| {
            let sum: f32 = (0..3).map(|n| unit(hash(n, h) >> 8)).sum();
            2.0 * (sum - 1.5)
        };
        (0..count)
            .map(|n| {
                let gain = exp(self.spread * normal(hash(2 * n, seed)));
                let lean = thread.twist + self.wander * normal(hash(2 * n + 1, seed));
                Texel {
                    alpha_x: (thread.alpha_along * gain).clamp(ALPHA_MIN, ALPHA_MAX),
                    alpha_y: (thread.alpha_across * gain).clamp(ALPHA_MIN, ALPHA_MAX),
                    axis: run.turned(Axis::from_degrees(lean)),
                }
            })
            .collect()
    }
}

/// Threads that can be seen: a whole number where the weave closes, the last one cut where it does not.
fn numbers(threads: f32) -> u32 {
    threads.ceil().max(1.0) as u32
}

/// How far the crossing moves from one thread to the next in a satin of `period` harnesses: prime to the period, and neither
/// neighbour if there is a choice (there is none at 2, 3, 4 and 6, where a twill is the nearest thing).
fn satin_step(period: u32) -> u32 {
    let prime_to = |s: &u32| (2..=*s).all(|d| !s.is_multiple_of(d) || !period.is_multiple_of(d));
    (2..period.saturating_sub(1)).find(prime_to).unwrap_or(1)
}

/// A prepared [`Weave`].
pub(super) struct Cloth {
    weave: Weave,
    surface: Surface,
    period: usize,
    step: usize,
    /// Threads per surface unit.
    per_unit: Vec2,
    /// One texel a thread.
    warp: Vec<Texel>,
    weft: Vec<Texel>,
}

/// How much of one thread a texel's width (or height) meets, as shares of it.
#[derive(Clone, Copy)]
struct Meeting {
    thread: usize,
    /// Of the thread itself.
    body: f32,
    /// Of the gap beside it.
    gap: f32,
}

/// More threads than that in a texel are told by as many, evenly chosen.
const MEETINGS_MAX: i32 = 24;

impl Cloth {
    /// The threads between `from` and `to`, counted in threads, of `count` that follow one another.
    fn meetings(&self, from: f32, to: f32, count: usize, met: &mut Vec<Meeting>) {
        met.clear();
        let (first, last) = (from.floor() as i32, to.ceil() as i32);
        let number = |i: i32| i.rem_euclid(count as i32) as usize;
        let half = 0.5 * self.weave.gap;
        if last - first > MEETINGS_MAX {
            let share = 1.0 / MEETINGS_MAX as f32;
            met.extend((0..MEETINGS_MAX).map(|k| Meeting {
                thread: number(first + (k as f32 * share * (last - first) as f32) as i32),
                body: share * (1.0 - self.weave.gap),
                gap: share * self.weave.gap,
            }));
            return;
        }
        for i in first..last {
            let (low, high) = ((from - i as f32).max(0.0), (to - i as f32).min(1.0));
            let body = (high.min(1.0 - half) - low.max(half)).max(0.0);
            let all = (high - low).max(0.0);
            let share = 1.0 / (to - from);
            met.push(Meeting {
                thread: number(i),
                body: body * share,
                gap: (all - body) * share,
            });
        }
    }

    /// The mean lobe and value of a texel that meets these threads.
    fn mean(&self, columns: &[Meeting], rows: &[Meeting]) -> (Texel, f32) {
        let mut sum = SlopeCovariance::default();
        let mut value = 0.0;
        let mut only: Option<Texel> = None;
        let mut mixed = false;
        let mut add = |texel: Texel, v: f32, area: f32| {
            if area > 1e-6 {
                mixed |= *only.get_or_insert(texel) != texel;
                sum += SlopeCovariance::from(texel) * area;
                value += v * area;
            }
        };
        let alpha = self.weave.gap_alpha;
        let gap = Texel {
            alpha_x: alpha,
            alpha_y: alpha,
            axis: Axis::U,
        };
        for column in columns {
            for row in rows {
                let (warp, weft) = (self.warp[column.thread], self.weft[row.thread]);
                let (both, warp_only) = (column.body * row.body, column.body * row.gap);
                let weft_only = column.gap * row.body;
                // Where both threads are, the upper one is seen; beside it the lower one.
                let warp_on_top =
                    !(column.thread + self.step * row.thread).is_multiple_of(self.period);
                let (warp_area, weft_area) = if warp_on_top {
                    (both + warp_only, weft_only)
                } else {
                    (warp_only, both + weft_only)
                };
                add(warp, 1.0, warp_area);
                add(weft, 0.0, weft_area);
                add(gap, 0.5, column.gap * row.gap);
            }
        }
        let first = only.unwrap_or(gap);
        let texel = if mixed {
            sum.to_texel(first.alpha_x > first.alpha_y, first.axis)
        } else {
            first
        };
        (texel, value.clamp(0.0, 1.0))
    }
}

impl Fill for Cloth {
    fn fill(&self, patch: &mut Patch<'_>) {
        patch.coverage.fill(1.0);
        let rect = patch.region.rect;
        let half = 0.5 * self.surface.texel();
        let across = |x: u32| {
            let centre = self.surface.position(rect.x + x, rect.y).x;
            let ends = [centre - half.x, centre + half.x].map(|p| p * self.per_unit.x);
            let mut met = Vec::new();
            self.meetings(ends[0], ends[1], self.warp.len(), &mut met);
            met
        };
        let columns: Vec<Vec<Meeting>> = (0..rect.width).map(across).collect();
        let mut rows = Vec::new();
        for y in 0..rect.height {
            let centre = self.surface.position(rect.x, rect.y + y).y;
            let ends = [centre - half.y, centre + half.y].map(|p| p * self.per_unit.y);
            self.meetings(ends[0], ends[1], self.weft.len(), &mut rows);
            for (x, column) in columns.iter().enumerate() {
                let (texel, value) = self.mean(column, &rows);
                let i = y as usize * rect.width as usize + x;
                patch.value[i] = value;
                patch.region.set(i, texel);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::tests::filled;
    use super::super::{Pattern, Surface};
    use super::*;
    use crate::map::{Size, Wrap};

    fn value_share(style: WeaveStyle, float: u32) -> f32 {
        let weave = Weave {
            style,
            float,
            gap: 0.0,
            ..Default::default()
        };
        let surface = Surface {
            size: Size::new(240, 240).unwrap(),
            aspect: 1.0,
            wrap: Wrap::Repeat,
            seed: 1,
        };
        let (_, _, value) = filled(&Pattern::Weave(weave), &surface, 4096);
        value.iter().sum::<f32>() / value.len() as f32
    }

    #[test]
    fn each_weave_shows_its_share_of_warp() {
        assert!((value_share(WeaveStyle::Canvas, 4) - 0.5).abs() < 0.01);
        assert!((value_share(WeaveStyle::Twill, 2) - 2.0 / 3.0).abs() < 0.01);
        assert!((value_share(WeaveStyle::Satin, 7) - 7.0 / 8.0).abs() < 0.01);
    }

    #[test]
    fn satin_steps_are_the_weavers() {
        assert_eq!([5, 7, 8, 10, 12].map(satin_step), [2, 2, 3, 3, 5]);
        assert_eq!([2, 3, 4, 6].map(satin_step), [1, 1, 1, 1]);
    }

    #[test]
    fn warp_fibres_run_up_and_weft_fibres_across() {
        let surface = Surface {
            size: Size::new(240, 240).unwrap(),
            aspect: 1.0,
            wrap: Wrap::Repeat,
            seed: 1,
        };
        let weave = Weave {
            wander: 0.0,
            ..Default::default()
        };
        let (map, _, value) = filled(&Pattern::Weave(weave), &surface, 4096);
        for i in 0..map.size().texels() {
            if value[i] == 1.0 {
                assert!(map.texel_at(i).groove().angle_to(Axis::V) < 1e-3);
            } else if value[i] == 0.0 {
                assert!(map.texel_at(i).groove().angle_to(Axis::U) < 1e-3);
            }
        }
    }
}
