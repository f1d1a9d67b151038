//! Helpers between the pen and the stroke: steadier lines, straight lines, round angles. Plain functions of plain numbers, in
//! any one unit; pass surface units where circles shall be round on the surface.

use crate::math::{atan2, sin_cos};
use glam::Vec2;
use std::f32::consts::TAU;

/// A string that the pen pulls the brush by: the brush stays behind by its length and moves only when it is taut, so that a
/// trembling hand draws a steady line.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PulledString {
    brush: Vec2,
    length: f32,
}

impl PulledString {
    /// A string of this length, not below 0, whose brush and pen are both here.
    pub fn new(at: Vec2, length: f32) -> Self {
        Self {
            brush: at,
            length: length.max(0.0),
        }
    }

    /// Where the brush is.
    pub fn brush(&self) -> Vec2 {
        self.brush
    }

    /// Moves the pen; the brush's new place when it moved.
    pub fn pull(&mut self, pen: Vec2) -> Option<Vec2> {
        let way = pen - self.brush;
        let taut = way.length() - self.length;
        if taut <= 0.0 || !taut.is_finite() {
            return None;
        }
        // Without a string the brush is at the pen, to the bit.
        self.brush = pen - way.normalize_or_zero() * self.length;
        Some(self.brush)
    }
}

/// How far a place may lie from the path that stands for it, in grains: what rounding two places to whole grains takes apart.
const STRAYS: f32 = 1.25;
/// The longest line that is still being drawn, in grains: over half of it, rounding turns a direction by less than half a degree.
const REACH: f32 = 288.0;
/// How far rounding moves a place that lies between grains both ways.
const ROUNDED: f32 = 0.71;

/// A place of a path with the pen's pressure.
type Place = (Vec2, f32);

/// A path through places that a pointer tells in whole pixels, or in other grains. Taken as they are, such places turn a slow
/// straight stroke by some degrees from place to place; so places that may lie on one line become one, and where the path bends
/// its corners are the middles of what lies around them.
///
/// All but the line that is being drawn is settled; that one begins where the settled path ends, and ends at the pointer.
#[derive(Clone, Debug, PartialEq)]
pub struct Steady {
    grain: f32,
    settled: Vec<Place>,
    /// The last settled place, and those that were told since.
    open: Vec<Place>,
}

impl Steady {
    /// A path that begins here, of places that lie on multiples of `grain`, in the unit of the places.
    pub fn new(at: Vec2, pressure: f32, grain: f32) -> Self {
        Self {
            grain: grain.max(f32::MIN_POSITIVE),
            settled: vec![(at, pressure)],
            open: vec![(at, pressure)],
        }
    }

    /// Goes on to a place.
    pub fn go_on(&mut self, at: Vec2, pressure: f32) {
        match self.open.last_mut() {
            Some(last) if last.0 == at => last.1 = last.1.max(pressure),
            _ => self.open.push((at, pressure)),
        }
        while self.open.len() > 2 && (self.is_long() || !self.is_straight()) {
            self.settle();
        }
    }

    /// The places that are settled since this was last asked.
    pub fn take_settled(&mut self) -> Vec<Place> {
        std::mem::take(&mut self.settled)
    }

    /// The line that is being drawn, after the last settled place.
    pub fn ahead(&self) -> Vec<Place> {
        self.line(&self.open)
    }

    fn is_long(&self) -> bool {
        let end = self.open[self.open.len() - 1].0;
        self.open[0].0.distance(end) > REACH * self.grain
    }

    fn is_straight(&self) -> bool {
        let (from, to) = (self.open[0].0, self.open[self.open.len() - 1].0);
        let (way, square) = (to - from, from.distance_squared(to));
        self.open.iter().all(|(at, _)| {
            let t = (*at - from).dot(way) / square.max(f32::MIN_POSITIVE);
            (from + way * t.clamp(0.0, 1.0)).distance(*at) <= STRAYS * self.grain
        })
    }

    /// Settles the first half of what is open.
    fn settle(&mut self) {
        // The place that bends the path is none of it yet.
        let known = if self.is_straight() {
            self.open.len()
        } else {
            (self.open.len() - 1).max(3)
        };
        let mut along = vec![0.0f32];
        for pair in self.open[..known].windows(2) {
            along.push(along[along.len() - 1] + pair[0].0.distance(pair[1].0));
        }
        let length = along[known - 1];
        let off = |i: &usize| (along[*i] - 0.5 * length).abs();
        let middle = (1..known - 1)
            .min_by(|a, b| off(a).total_cmp(&off(b)))
            .unwrap_or(1);
        let corner = (self.middle(middle, &along), self.open[middle].1);
        let mut part = self.open[..=middle].to_vec();
        part[middle] = corner;
        let line = self.line(&part);
        self.settled.extend(line);
        self.open.splice(..=middle, [corner]);
    }

    /// Where the path goes by a place: the middle of a parabola through those around it, as far to either side.
    fn middle(&self, middle: usize, along: &[f32]) -> Vec2 {
        let here = self.open[middle].0;
        let reach = along[middle].min(along[along.len() - 1] - along[middle]) * 1.001;
        let mut sums = [0.0f32; 5];
        let mut ways = [Vec2::ZERO; 3];
        for (i, s) in along.iter().enumerate() {
            let s = (s - along[middle]) / reach.max(f32::MIN_POSITIVE);
            if s.abs() > 1.0 {
                continue;
            }
            let mut power = 1.0;
            for (k, sum) in sums.iter_mut().enumerate() {
                *sum += power;
                if let Some(way) = ways.get_mut(k) {
                    *way += (self.open[i].0 - here) * power;
                }
                power *= s;
            }
        }
        let moved = if self.is_straight() || sums[0] < 4.5 {
            ways[0] / sums[0]
        } else {
            constant_of_parabola(&sums, &ways)
        };
        here + moved.clamp_length_max(ROUNDED * self.grain)
    }

    /// The places of a straight line after its first: the last, and before it those that tell another pressure than the ends.
    fn line(&self, places: &[Place]) -> Vec<Place> {
        let [(from, first), .., (to, last)] = *places else {
            return Vec::new();
        };
        let (way, square) = (to - from, from.distance_squared(to));
        let mut line: Vec<Place> = Vec::new();
        let mut passed = 0.0;
        for (at, pressure) in &places[1..places.len() - 1] {
            let t = (*at - from).dot(way) / square.max(f32::MIN_POSITIVE);
            let evenly = first + (last - first) * t;
            if (pressure - evenly).abs() > 0.01 && t > passed && t < 1.0 {
                line.push((from + way * t, *pressure));
                passed = t;
            }
        }
        line.push((to, last));
        line
    }
}

/// The value at 0 of the parabola that comes nearest to places, from the sums of the powers 0 to 4 of where they are told, and
/// from those of the places times the powers 0 to 2.
fn constant_of_parabola([n, a, b, c, d]: &[f32; 5], [p, q, r]: &[Vec2; 3]) -> Vec2 {
    // The first unknown of the normal equations, by Cramer's rule.
    let minors = [b * d - c * c, a * d - b * c, a * c - b * b];
    let whole = n * minors[0] - a * minors[1] + b * minors[2];
    if whole.abs() < 1e-6 {
        return *p / *n;
    }
    (*p * minors[0] - *q * minors[1] + *r * minors[2]) / whole
}

/// The end of a straight line from `from` toward `to`, its angle the nearest whole multiple of `step` degrees, its length what
/// of the way to `to` lies along it.
pub fn snap_angle(from: Vec2, to: Vec2, step: f32) -> Vec2 {
    let way = to - from;
    let step = step.to_radians();
    if way == Vec2::ZERO || step.is_nan() || step <= 0.0 {
        return to;
    }
    let angle = (atan2(way.y, way.x) / step).round() * step;
    let (sin, cos) = sin_cos(angle.rem_euclid(TAU));
    let direction = Vec2::new(cos, sin);
    from + direction * way.dot(direction).max(0.0)
}

/// Points of the straight line from `from` to `to`, both ends included, no farther from each other than `spacing`; pressures go
/// evenly from the first to the second. At most 4096 of them.
pub fn straight_line(
    (from, first): (Vec2, f32),
    (to, last): (Vec2, f32),
    spacing: f32,
) -> Vec<(Vec2, f32)> {
    let pieces = (from.distance(to) / spacing.max(f32::MIN_POSITIVE)).ceil();
    let pieces = pieces.clamp(1.0, 4095.0) as u16;
    (0..=pieces)
        .map(|i| {
            let t = f32::from(i) / f32::from(pieces);
            (from.lerp(to, t), first + (last - first) * t)
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The path of places in whole grains.
    fn steadied(places: impl IntoIterator<Item = Vec2>) -> Vec<Vec2> {
        let mut places = places.into_iter().map(Vec2::round);
        let mut steady = Steady::new(places.next().unwrap(), 1.0, 1.0);
        places.for_each(|at| steady.go_on(at, 1.0));
        let settled = steady.take_settled();
        let ahead = steady.ahead();
        settled.into_iter().chain(ahead).map(|(at, _)| at).collect()
    }

    #[test]
    fn a_straight_drag_in_whole_pixels_keeps_its_direction() {
        let to = |length: f32, degrees: f32| {
            let (sin, cos) = sin_cos(degrees.to_radians());
            (Vec2::new(cos, sin) * length).round()
        };
        for length in [60.0f32, 150.0, 400.0, 900.0] {
            for degrees in (0..360).map(|d| d as f32 + 0.37) {
                for step in [1.0f32, 3.0, 7.5, 20.0] {
                    let to = to(length, degrees);
                    let n = (length / step).ceil();
                    let path = steadied((0..=n as u32).map(|i| to * (i as f32 / n)));
                    let wanted = atan2(to.y, to.x);
                    for pair in path.windows(2) {
                        let way = pair[1] - pair[0];
                        let off = (atan2(way.y, way.x) - wanted).to_degrees();
                        let off = off - (off / 360.0).round() * 360.0;
                        assert!(
                            off.abs() <= 0.5,
                            "{off} of {degrees} in {length} by {step}: {path:?}"
                        );
                    }
                }
            }
        }
    }

    #[test]
    fn a_bend_is_followed() {
        for radius in [12.0f32, 30.0, 100.0, 300.0] {
            for step in [1.0f32, 4.0] {
                let n = (TAU * radius / step) as u32;
                let place = |i: u32| {
                    let (sin, cos) = sin_cos(i as f32 * TAU / n as f32);
                    Vec2::new(cos, sin) * radius
                };
                let path = steadied((0..=n).map(place));
                let corners = &path[1..path.len() - 1];
                for corner in corners {
                    let off = (corner.length() - radius).abs();
                    assert!(off <= 0.75, "{off} at a radius of {radius}");
                }
                // The direction at a corner is that of the lines beside it, halved.
                for three in path.windows(3).skip(1) {
                    let [before, after] = [three[1] - three[0], three[2] - three[1]];
                    let way = before.normalize() + after.normalize();
                    let tangent = three[1].perp();
                    let off = way.angle_to(tangent).to_degrees().abs();
                    let most = 14.0 * (12.0 / radius).sqrt();
                    assert!(
                        off <= most,
                        "{off} degrees at a radius of {radius} by {step}"
                    );
                }
            }
        }
    }

    #[test]
    fn corners_pressure_and_the_way_back_stay() {
        let there = (0..=40).map(|i| Vec2::new(i as f32 * 3.0, 0.0));
        let down = (1..=40).map(|i| Vec2::new(120.0, i as f32 * 3.0));
        let path = steadied(there.clone().chain(down));
        let near = |at: Vec2| path.iter().any(|p| p.distance(at) <= 3.0);
        assert!(near(Vec2::new(120.0, 0.0)), "{path:?}");
        assert_eq!(path[path.len() - 1], Vec2::splat(120.0));
        let back = there
            .clone()
            .chain((0..40).rev().map(|i| Vec2::new(i as f32 * 3.0, 0.0)));
        let path = steadied(back);
        assert!(path.iter().any(|p| p.x > 116.0), "{path:?}");
        assert_eq!(path[path.len() - 1], Vec2::ZERO);
        let mut steady = Steady::new(Vec2::ZERO, 0.0, 1.0);
        for (i, at) in there.enumerate().skip(1) {
            steady.go_on(at, if i < 20 { 0.2 } else { 0.8 });
        }
        let path = [steady.take_settled(), steady.ahead()].concat();
        assert!(
            path.iter().any(|(at, p)| at.x < 59.0 && *p == 0.2),
            "{path:?}"
        );
        assert!(
            path.iter().any(|(at, p)| at.x < 63.0 && *p == 0.8),
            "{path:?}"
        );
    }

    #[test]
    fn a_string_follows_only_when_taut() {
        let mut string = PulledString::new(Vec2::ZERO, 1.0);
        assert_eq!(string.pull(Vec2::new(0.6, 0.6)), None);
        assert_eq!(string.pull(Vec2::new(3.0, 0.0)), Some(Vec2::new(2.0, 0.0)));
        assert_eq!(string.pull(Vec2::new(f32::NAN, 0.0)), None);
        assert_eq!(string.brush(), Vec2::new(2.0, 0.0));
        let mut loose = PulledString::new(Vec2::ZERO, 0.0);
        assert_eq!(loose.pull(Vec2::ONE), Some(Vec2::ONE));
    }

    #[test]
    fn angles_snap_to_the_nearest_step() {
        let snapped = snap_angle(Vec2::ONE, Vec2::new(3.0, 1.2), 15.0);
        assert!((snapped - Vec2::new(3.0, 1.0)).length() < 1e-6);
        let diagonal = snap_angle(Vec2::ZERO, Vec2::new(-1.0, -0.9), 45.0);
        assert!((diagonal.x - diagonal.y).abs() < 1e-6 && diagonal.x < -0.9);
        assert_eq!(snap_angle(Vec2::ONE, Vec2::ONE, 45.0), Vec2::ONE);
    }

    #[test]
    fn a_straight_line_has_both_its_ends() {
        let line = straight_line((Vec2::ZERO, 0.0), (Vec2::X, 1.0), 0.3);
        assert_eq!(line.len(), 5);
        assert_eq!((line[0], line[4]), ((Vec2::ZERO, 0.0), (Vec2::X, 1.0)));
        assert_eq!(straight_line((Vec2::X, 1.0), (Vec2::X, 1.0), 0.1).len(), 2);
    }
}
