//! How far apart two maps are.
//!
//! Which axis of a texel is called x is a matter of naming, so texels are compared by what light sees: the larger width with
//! the larger, the smaller with the smaller, and the axis along the grooves with the same of the other.

use super::histogram::Histogram;
use super::{DIRECTED_RATIO, Place, by_stretches, sorted};
use crate::error::{Error, Result};
use crate::map::AnisoMap;
use serde::Serialize;
use std::ops::Range;
use std::sync::{Mutex, PoisonError};

/// Buckets per octave: quantiles are right to 0.025 %.
const BITS: u32 = 11;

/// Files of 8 bits hold the smaller width well only down to this share of the largest one in the map.
const WELL_HELD: f32 = 0.04;

/// The second map measured against the first, texel by texel.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Comparison {
    /// Columns of both.
    pub width: u32,
    /// Rows of both.
    pub height: u32,
    /// Relative error of the larger width.
    pub large: Errors,
    /// Relative error of the smaller width.
    pub small: Errors,
    /// Both widths, where the first map's smaller one is at least 4 % of its largest value in the map.
    pub well_held: WidthErrors,
    /// Both widths, everywhere else.
    pub elsewhere: WidthErrors,
    /// The axis along the grooves, where the first map's widths differ by more than [`DIRECTED_RATIO`].
    pub angle: AngleErrors,
}

/// Relative errors, |second/first - 1|. The quantiles are right to 0.025 % of themselves.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Errors {
    /// The mean.
    pub mean: f64,
    /// The median.
    pub p50: f32,
    /// 95 % of the texels are not above it.
    pub p95: f32,
    /// 99 %.
    pub p99: f32,
    /// The largest.
    pub max: f32,
    /// The first texel that has the largest; none where no texel differs.
    pub worst: Option<Place>,
}

/// The largest relative error of either width over some of the texels.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct WidthErrors {
    /// How many texels.
    pub texels: u64,
    /// The largest error among them.
    pub max: f32,
}

/// Angles between axes in degrees, 0 to 90.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct AngleErrors {
    /// How many texels have a direction to compare.
    pub texels: u64,
    /// The mean over them.
    pub mean_degrees: f64,
    /// The mean, each texel counted by the difference of its widths.
    pub weighted_mean_degrees: f64,
    /// The median.
    pub p50_degrees: f32,
    /// 99 % of these texels are not above it.
    pub p99_degrees: f32,
    /// The largest.
    pub max_degrees: f32,
    /// The first texel that has the largest; none where no texel differs.
    pub worst: Option<Place>,
}

/// The largest number so far and where it stood first.
#[derive(Clone, Copy)]
struct Largest {
    value: f32,
    index: Option<usize>,
}

impl Largest {
    const NONE: Self = Self {
        value: 0.0,
        index: None,
    };

    fn add(&mut self, value: f32, index: usize) {
        if value > self.value {
            *self = Self {
                value,
                index: Some(index),
            };
        }
    }

    fn merge(self, later: Self) -> Self {
        if later.value > self.value {
            later
        } else {
            self
        }
    }

    fn place(self, width: u32) -> Option<Place> {
        self.index.map(|i| Place::of(i, width))
    }
}

#[derive(Clone, Copy)]
struct Partial {
    large: Largest,
    large_sum: f64,
    small: Largest,
    small_sum: f64,
    well_held: WidthErrors,
    elsewhere: WidthErrors,
    angle: Largest,
    angle_sum: f64,
    angle_texels: u64,
    weighted_sum: f64,
    weight: f64,
}

impl Partial {
    const NONE: Self = Self {
        large: Largest::NONE,
        large_sum: 0.0,
        small: Largest::NONE,
        small_sum: 0.0,
        well_held: WidthErrors::NONE,
        elsewhere: WidthErrors::NONE,
        angle: Largest::NONE,
        angle_sum: 0.0,
        angle_texels: 0,
        weighted_sum: 0.0,
        weight: 0.0,
    };

    fn merge(self, later: Self) -> Self {
        Self {
            large: self.large.merge(later.large),
            large_sum: self.large_sum + later.large_sum,
            small: self.small.merge(later.small),
            small_sum: self.small_sum + later.small_sum,
            well_held: self.well_held.merge(later.well_held),
            elsewhere: self.elsewhere.merge(later.elsewhere),
            angle: self.angle.merge(later.angle),
            angle_sum: self.angle_sum + later.angle_sum,
            angle_texels: self.angle_texels + later.angle_texels,
            weighted_sum: self.weighted_sum + later.weighted_sum,
            weight: self.weight + later.weight,
        }
    }
}

impl WidthErrors {
    const NONE: Self = Self {
        texels: 0,
        max: 0.0,
    };

    fn merge(self, later: Self) -> Self {
        Self {
            texels: self.texels + later.texels,
            max: self.max.max(later.max),
        }
    }
}

/// Errors of the larger width, of the smaller, and angles.
type Histograms = [Histogram; 3];

fn measure(
    (a, b): (&AnisoMap, &AnisoMap),
    threshold: f32,
    stretch: Range<usize>,
    histograms: &mut Histograms,
) -> Partial {
    let mut partial = Partial::NONE;
    for i in stretch {
        let (p, q) = (a.texel_at(i), b.texel_at(i));
        let ((large, small), (large_b, small_b)) = (sorted(p), sorted(q));
        let (e, f) = ((large_b / large - 1.0).abs(), (small_b / small - 1.0).abs());
        histograms[0].add(e);
        histograms[1].add(f);
        partial.large.add(e, i);
        partial.large_sum += f64::from(e);
        partial.small.add(f, i);
        partial.small_sum += f64::from(f);
        let part = if small >= threshold {
            &mut partial.well_held
        } else {
            &mut partial.elsewhere
        };
        part.texels += 1;
        part.max = part.max.max(e).max(f);
        if large > DIRECTED_RATIO * small {
            let angle = p.groove().angle_to(q.groove()).to_degrees();
            let weight = f64::from(large - small);
            histograms[2].add(angle);
            partial.angle.add(angle, i);
            partial.angle_sum += f64::from(angle);
            partial.angle_texels += 1;
            partial.weighted_sum += weight * f64::from(angle);
            partial.weight += weight;
        }
    }
    partial
}

fn errors(histogram: &Histogram, largest: Largest, sum: f64, map: &AnisoMap) -> Errors {
    let quantile = |q| histogram.quantile(q, 0.0, largest.value);
    Errors {
        mean: sum / map.size().texels() as f64,
        p50: quantile(0.5),
        p95: quantile(0.95),
        p99: quantile(0.99),
        max: largest.value,
        worst: largest.place(map.width()),
    }
}

/// Measures `second` against `first`.
///
/// # Errors
/// When the maps differ in size.
pub fn compare(first: &AnisoMap, second: &AnisoMap) -> Result<Comparison> {
    if first.size() != second.size() {
        return Err(Error::invalid(
            "the second map's size",
            second.size(),
            format!("allowed: {}, as the first map's", first.size()),
        )
        .with_hint("Generate or resize one of them to the size of the other"));
    }
    let texels = first.size().texels();
    let largest_small = by_stretches(texels, |stretch| {
        stretch
            .map(|i| sorted(first.texel_at(i)).1)
            .fold(0.0, f32::max)
    })
    .into_iter()
    .fold(0.0, f32::max);
    let threshold = WELL_HELD * largest_small;

    let relative = Histogram::new(1e-9, 2e3, BITS);
    let empty = [relative.clone(), relative, Histogram::new(1e-6, 90.0, BITS)];
    let counted = Mutex::new(empty.clone());
    let partials = by_stretches(texels, |stretch| {
        let mut histograms = empty.clone();
        let partial = measure((first, second), threshold, stretch, &mut histograms);
        let mut total = counted.lock().unwrap_or_else(PoisonError::into_inner);
        for (sum, part) in total.iter_mut().zip(&histograms) {
            sum.merge(part);
        }
        partial
    });
    let total = partials.into_iter().fold(Partial::NONE, Partial::merge);
    let [large, small, angle] = counted.into_inner().unwrap_or_else(PoisonError::into_inner);
    let degrees = |q| angle.quantile(q, 0.0, total.angle.value);
    let mean = |sum: f64, weight: f64| if weight > 0.0 { sum / weight } else { 0.0 };
    Ok(Comparison {
        width: first.width(),
        height: first.height(),
        large: errors(&large, total.large, total.large_sum, first),
        small: errors(&small, total.small, total.small_sum, first),
        well_held: total.well_held,
        elsewhere: total.elsewhere,
        angle: AngleErrors {
            texels: total.angle_texels,
            mean_degrees: mean(total.angle_sum, total.angle_texels as f64),
            weighted_mean_degrees: mean(total.weighted_sum, total.weight),
            p50_degrees: degrees(0.5),
            p99_degrees: degrees(0.99),
            max_degrees: total.angle.value,
            worst: total.angle.place(first.width()),
        },
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::map::{Size, Texel, Wrap};
    use crate::math::Axis;

    fn texel(alpha_x: f32, alpha_y: f32, degrees: f32) -> Texel {
        Texel {
            alpha_x,
            alpha_y,
            axis: Axis::from_degrees(degrees),
        }
    }

    fn constant(t: Texel) -> AnisoMap {
        AnisoMap::constant(Size::new(40, 30).unwrap(), Wrap::Repeat, t)
    }

    #[test]
    fn a_map_is_no_distance_from_itself_under_other_names() {
        let a = constant(texel(0.1, 0.4, 30.0));
        let renamed = constant(texel(0.4, 0.1, 120.0));
        let c = compare(&a, &renamed).unwrap();
        assert_eq!((c.large.max, c.small.max, c.large.worst), (0.0, 0.0, None));
        assert!(c.angle.max_degrees < 1e-4);
        assert_eq!(c.angle.texels, 1200);
        assert_eq!(compare(&a, &a).unwrap().angle.worst, None);
    }

    #[test]
    fn one_changed_texel_is_found_and_measured() {
        let a = constant(texel(0.1, 0.4, 179.0));
        let mut b = a.clone();
        b.region_mut().set(40 * 7 + 3, texel(0.11, 0.38, 2.0));
        let c = compare(&a, &b).unwrap();
        let place = Some(Place { x: 3, y: 7 });
        assert!((c.small.max - 0.1).abs() < 1e-6 && (c.large.max - 0.05).abs() < 1e-6);
        assert_eq!(
            (c.small.worst, c.large.worst, c.angle.worst),
            (place, place, place)
        );
        assert!((c.angle.max_degrees - 3.0).abs() < 1e-3);
        assert!((c.small.mean - 0.1 / 1200.0).abs() < 1e-9);
        assert_eq!(c.small.p99, 0.0);
    }

    #[test]
    fn directions_count_only_where_there_is_one() {
        let a = constant(texel(0.2, 0.205, 0.0));
        let b = constant(texel(0.2, 0.205, 90.0));
        assert_eq!(compare(&a, &b).unwrap().angle.texels, 0);
    }

    #[test]
    fn thin_texels_are_reported_apart() {
        let mut a = constant(texel(0.5, 0.5, 0.0));
        a.region_mut().set(0, texel(0.01, 0.5, 0.0));
        let mut b = a.clone();
        b.region_mut().set(0, texel(0.013, 0.5, 0.0));
        b.region_mut().set(1, texel(0.505, 0.5, 0.0));
        let c = compare(&a, &b).unwrap();
        assert_eq!((c.well_held.texels, c.elsewhere.texels), (1199, 1));
        assert!((c.well_held.max - 0.01).abs() < 1e-5);
        assert!((c.elsewhere.max - 0.3).abs() < 1e-5);
    }

    #[test]
    fn sizes_must_agree() {
        let a = constant(texel(0.1, 0.4, 0.0));
        let b = AnisoMap::constant(
            Size::new(30, 40).unwrap(),
            Wrap::Repeat,
            texel(0.1, 0.4, 0.0),
        );
        let e = compare(&a, &b).unwrap_err().to_string();
        assert!(e.contains("30x40") && e.contains("40x30"), "{e}");
    }
}
