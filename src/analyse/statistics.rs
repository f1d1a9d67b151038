//! The numbers of a map: ranges, quantiles, and where its directions point.

use super::histogram::Histogram;
use super::{ISOTROPIC_RATIO, by_stretches};
use crate::map::{ALPHA_MAX, ALPHA_MIN, AnisoMap};
use crate::math::Axis;
use glam::{DVec2, Vec2};
use serde::Serialize;
use std::ops::Range;
use std::sync::{Mutex, PoisonError};

/// Buckets per octave: quantiles are right to 0.012 %.
const BITS: u32 = 12;

/// What a map holds.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Statistics {
    /// Columns.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// The width along the x axis.
    pub alpha_x: Spread,
    /// The width across it.
    pub alpha_y: Spread,
    /// Larger width over smaller, from 1.
    pub ratio: Spread,
    /// The x axis, every texel counted alike.
    pub x_axis: Directions,
    /// The axis along the grooves, each texel counted by the difference of its widths: isotropic texels have no say.
    pub groove: Directions,
    /// The share of texels, 0 to 1, with a ratio of at most [`ISOTROPIC_RATIO`].
    pub isotropic_share: f64,
}

/// How a number is spread over the map. The quantiles are right to 0.012 %.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Spread {
    /// The smallest.
    pub min: f32,
    /// 1 % of the texels are not above it.
    pub p01: f32,
    /// 5 %.
    pub p05: f32,
    /// The median.
    pub p50: f32,
    /// 95 %.
    pub p95: f32,
    /// 99 %.
    pub p99: f32,
    /// The largest.
    pub max: f32,
    /// The mean.
    pub mean: f64,
}

/// Where the axes of a map point together, from the mean of their double-angle vectors.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Directions {
    /// The mean axis in degrees, in [0, 180); none where the axes cancel.
    pub mean_degrees: Option<f32>,
    /// Length of the mean vector: 1 all alike, 0 no common direction (or none at all).
    pub coherence: f64,
    /// The angular deviation in degrees: the standard deviation while it is small, at most 40.5 for axes all around.
    pub spread_degrees: f64,
}

impl Directions {
    fn new(sum: DVec2, weight: f64) -> Self {
        let mean = if weight > 0.0 {
            sum / weight
        } else {
            DVec2::ZERO
        };
        // Rounding may leave the mean of equal unit vectors a little long.
        let coherence = mean.length().min(1.0);
        Self {
            mean_degrees: Axis::from_double_angle(Vec2::new(mean.x as f32, mean.y as f32))
                .map(Axis::degrees),
            coherence,
            spread_degrees: (0.5 * (2.0 * (1.0 - coherence)).sqrt()).to_degrees(),
        }
    }
}

/// Minimum, maximum and sum on the way.
#[derive(Clone, Copy)]
struct Running {
    min: f32,
    max: f32,
    sum: f64,
}

impl Running {
    const NONE: Self = Self {
        min: f32::INFINITY,
        max: f32::NEG_INFINITY,
        sum: 0.0,
    };

    #[inline(always)]
    fn add(&mut self, x: f32) {
        self.min = self.min.min(x);
        self.max = self.max.max(x);
        self.sum += f64::from(x);
    }

    fn merge(self, later: Self) -> Self {
        Self {
            min: self.min.min(later.min),
            max: self.max.max(later.max),
            sum: self.sum + later.sum,
        }
    }

    fn spread(self, histogram: &Histogram, texels: usize) -> Spread {
        let quantile = |q| histogram.quantile(q, self.min, self.max);
        Spread {
            min: self.min,
            p01: quantile(0.01),
            p05: quantile(0.05),
            p50: quantile(0.5),
            p95: quantile(0.95),
            p99: quantile(0.99),
            max: self.max,
            mean: self.sum / texels as f64,
        }
    }
}

/// The order-dependent sums of one stretch.
#[derive(Clone, Copy)]
struct Partial {
    /// alpha_x, alpha_y, ratio.
    running: [Running; 3],
    x_axis: DVec2,
    groove: DVec2,
    groove_weight: f64,
    isotropic: u64,
}

impl Partial {
    const NONE: Self = Self {
        running: [Running::NONE; 3],
        x_axis: DVec2::ZERO,
        groove: DVec2::ZERO,
        groove_weight: 0.0,
        isotropic: 0,
    };

    fn merge(self, later: Self) -> Self {
        let [a, b, c] = self.running;
        let [d, e, f] = later.running;
        Self {
            running: [a.merge(d), b.merge(e), c.merge(f)],
            x_axis: self.x_axis + later.x_axis,
            groove: self.groove + later.groove,
            groove_weight: self.groove_weight + later.groove_weight,
            isotropic: self.isotropic + later.isotropic,
        }
    }

    fn of(map: &AnisoMap, stretch: Range<usize>, histograms: &mut [Histogram; 3]) -> Self {
        let mut partial = Self::NONE;
        let alphas = map.alpha_x()[stretch.clone()]
            .iter()
            .zip(&map.alpha_y()[stretch.clone()]);
        let axes = map.cos2()[stretch.clone()].iter().zip(&map.sin2()[stretch]);
        for ((&alpha_x, &alpha_y), (&cos2, &sin2)) in alphas.zip(axes) {
            let ratio = alpha_x.max(alpha_y) / alpha_x.min(alpha_y);
            for (i, x) in [alpha_x, alpha_y, ratio].into_iter().enumerate() {
                partial.running[i].add(x);
                histograms[i].add(x);
            }
            let axis = DVec2::new(f64::from(cos2), f64::from(sin2));
            partial.x_axis += axis;
            // Positive where the x axis is the groove; the perpendicular axis is the opposite double-angle vector.
            let difference = f64::from(alpha_y) - f64::from(alpha_x);
            partial.groove += axis * difference;
            partial.groove_weight += difference.abs();
            partial.isotropic += u64::from(ratio <= ISOTROPIC_RATIO);
        }
        partial
    }
}

impl Statistics {
    /// One pass over the map.
    pub fn of(map: &AnisoMap) -> Self {
        let texels = map.size().texels();
        let alpha = Histogram::new(ALPHA_MIN, ALPHA_MAX, BITS);
        let ratio = Histogram::new(1.0, ALPHA_MAX / ALPHA_MIN, BITS);
        let empty = [alpha.clone(), alpha, ratio];
        // Counts are whole numbers: they may come together in any order.
        let counted = Mutex::new(empty.clone());
        let partials = by_stretches(texels, |stretch| {
            let mut histograms = empty.clone();
            let partial = Partial::of(map, stretch, &mut histograms);
            let mut total = counted.lock().unwrap_or_else(PoisonError::into_inner);
            for (sum, part) in total.iter_mut().zip(&histograms) {
                sum.merge(part);
            }
            partial
        });
        let total = partials.into_iter().fold(Partial::NONE, Partial::merge);
        let [x, y, r] = counted.into_inner().unwrap_or_else(PoisonError::into_inner);
        let count = texels as f64;
        Self {
            width: map.width(),
            height: map.height(),
            alpha_x: total.running[0].spread(&x, texels),
            alpha_y: total.running[1].spread(&y, texels),
            ratio: total.running[2].spread(&r, texels),
            x_axis: Directions::new(total.x_axis, count),
            groove: Directions::new(total.groove, total.groove_weight),
            isotropic_share: total.isotropic as f64 / count,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::map::{Size, Texel, Wrap};

    fn texel(alpha_x: f32, alpha_y: f32, degrees: f32) -> Texel {
        Texel {
            alpha_x,
            alpha_y,
            axis: Axis::from_degrees(degrees),
        }
    }

    #[test]
    fn a_constant_map_is_what_its_texel_is() {
        let size = Size::new(700, 500).unwrap();
        let s = Statistics::of(&AnisoMap::constant(
            size,
            Wrap::Repeat,
            texel(0.1, 0.4, 30.0),
        ));
        assert_eq!(
            (s.alpha_x.min, s.alpha_x.p50, s.alpha_x.max),
            (0.1, 0.1, 0.1)
        );
        assert!((s.ratio.mean - 4.0).abs() < 1e-6);
        for directions in [s.x_axis, s.groove] {
            assert!((directions.mean_degrees.unwrap() - 30.0).abs() < 1e-3);
            assert!(directions.spread_degrees < 0.05);
        }
        assert_eq!(s.isotropic_share, 0.0);
    }

    #[test]
    fn half_the_map_counts_half() {
        let size = Size::new(100, 10).unwrap();
        let mut map = AnisoMap::constant(size, Wrap::Repeat, texel(0.2, 0.2, 0.0));
        let mut region = map.region_mut();
        for i in 0..500 {
            region.set(i, texel(0.3, 0.1, 100.0));
        }
        let s = Statistics::of(&map);
        assert_eq!(s.isotropic_share, 0.5);
        assert!((s.alpha_x.mean - 0.25).abs() < 1e-6);
        assert!(
            (s.alpha_x.p01 / 0.2 - 1.0).abs() < 2e-4 && (s.alpha_x.p99 / 0.3 - 1.0).abs() < 2e-4
        );
        // The grooves run across the x axis of the texels that have any: 100 + 90 = 10 degrees.
        assert!((s.groove.mean_degrees.unwrap() - 10.0).abs() < 1e-3);
        assert!(s.groove.coherence > 0.999_99);
        assert!(s.x_axis.coherence < 0.2);
    }

    #[test]
    fn crossed_axes_have_no_mean() {
        let mut map = AnisoMap::constant(
            Size::new(2, 1).unwrap(),
            Wrap::Repeat,
            texel(0.1, 0.2, 45.0),
        );
        map.region_mut().set(1, texel(0.1, 0.2, 135.0));
        let s = Statistics::of(&map);
        assert_eq!(s.x_axis.mean_degrees, None);
        assert!((s.x_axis.spread_degrees - 40.5).abs() < 0.1);
        let isotropic = AnisoMap::constant(
            Size::new(1, 1).unwrap(),
            Wrap::Repeat,
            texel(0.2, 0.2, 45.0),
        );
        assert_eq!(Statistics::of(&isotropic).groove.mean_degrees, None);
    }

    #[test]
    fn one_thread_and_many_say_the_same() {
        let size = Size::new(1000, 700).unwrap();
        let mut map = AnisoMap::constant(size, Wrap::Repeat, texel(0.2, 0.2, 0.0));
        let mut region = map.region_mut();
        for i in 0..size.texels() {
            let t = (i % 977) as f32 / 977.0;
            region.set(i, texel(0.01 + t, 0.3, 180.0 * t));
        }
        let with = |n| {
            let pool = rayon::ThreadPoolBuilder::new()
                .num_threads(n)
                .build()
                .unwrap();
            pool.install(|| Statistics::of(&map))
        };
        assert_eq!(with(1), with(3));
    }
}
