//! Woven cloth: two sets of threads, each with its own fibres, passing over and under.

use super::lattice::{hash, seed32, unit};
use super::{Fill, Parameter, Patch, Surface};
use crate::map::{ALPHA_MAX, ALPHA_MIN, SlopeCovariance, Texel};
use crate::math::{Axis, exp, floor_fast};
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
        let texels = Vec2::new(surface.size.width() as f32, surface.size.height() as f32);
        let points =
            |threads: f32, texels: f32| ((3.0 * threads / texels).ceil().clamp(2.0, 16.0)) as u32;
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
            points: (points(threads.x, texels.x), points(threads.y, texels.y)),
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
    /// Points taken per texel, across and up.
    points: (u32, u32),
}

impl Cloth {
    /// The texel at a point, and its value.
    fn at(&self, p: Vec2) -> (Texel, f32) {
        let t = p * self.per_unit;
        let cell = Vec2::new(floor_fast(t.x), floor_fast(t.y));
        // Points of the texels at the edge lie a little outside.
        let number = |i: f32, n: usize| (i as i32).rem_euclid(n as i32) as usize;
        let (warp, weft) = (
            number(cell.x, self.warp.len()),
            number(cell.y, self.weft.len()),
        );
        let warp_on_top = !(warp + self.step * weft).is_multiple_of(self.period);
        let inside = t - cell;
        let half = 0.5 * self.weave.gap;
        let in_thread = |x: f32| x >= half && x <= 1.0 - half;
        // Where the upper thread leaves a gap, the lower one may show.
        let over = if warp_on_top {
            in_thread(inside.x)
        } else {
            in_thread(inside.y)
        };
        let under = if warp_on_top {
            in_thread(inside.y)
        } else {
            in_thread(inside.x)
        };
        if !over && !under {
            let alpha = self.weave.gap_alpha;
            return (
                Texel {
                    alpha_x: alpha,
                    alpha_y: alpha,
                    axis: Axis::U,
                },
                0.5,
            );
        }
        if warp_on_top == over {
            (self.warp[warp], 1.0)
        } else {
            (self.weft[weft], 0.0)
        }
    }
}

impl Fill for Cloth {
    fn fill(&self, patch: &mut Patch<'_>) {
        patch.coverage.fill(1.0);
        let rect = patch.region.rect;
        let texel = self.surface.texel();
        let (across, up) = self.points;
        let share = 1.0 / (across * up) as f32;
        for y in 0..rect.height {
            for x in 0..rect.width {
                let centre = self.surface.position(rect.x + x, rect.y + y);
                let mut sum = SlopeCovariance::default();
                let (mut value, mut first, mut same) = (0.0, None, true);
                for n in 0..across * up {
                    let at = Vec2::new((n % across) as f32 + 0.5, (n / across) as f32 + 0.5);
                    let offset = (at / Vec2::new(across as f32, up as f32) - 0.5) * texel;
                    let (t, v) = self.at(centre + offset);
                    same &= *first.get_or_insert(t) == t;
                    sum += SlopeCovariance::from(t) * share;
                    value += v * share;
                }
                let i = (y * rect.width + x) as usize;
                let only = first.expect("at least one point per texel");
                patch.value[i] = value.min(1.0);
                patch.region.set(
                    i,
                    if same {
                        only
                    } else {
                        sum.to_texel(only.alpha_x > only.alpha_y, only.axis)
                    },
                );
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
