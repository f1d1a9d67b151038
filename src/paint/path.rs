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
