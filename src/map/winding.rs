//! Singular points of a line field on a grid.
//!
//! Between neighbouring texels the double-angle vector turns by some angle. Around a loop of four texels the turns add up to
//! a whole number of full ones: 0 nearly everywhere. Where they do not, a singular point lies inside, and half the number is
//! its index: +1 the centre of circles or spokes, +1/2 the end of a fold, -1/2 a three-armed star. Every pair of neighbours
//! is walked both ways by the loops at its sides, so that on a map that repeats all indices add up to 0.

use super::{Size, Wrap};
use crate::math;
use glam::Vec2;
use std::f32::consts::TAU;

/// More turning loops than this are no points but a field that is rough everywhere: scratches, threads, noise.
pub(crate) const LOOPS_MAX: usize = 4096;

/// A singular point of a line field.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Singularity {
    /// Where it is: u, to half a texel.
    pub u: f32,
    /// v, up.
    pub v: f32,
    /// Twice its index: 2 the centre of circles, 1 the end of a fold, -1 a three-armed star, -2 a four-armed one.
    pub twice_index: i32,
}

/// A loop of four texels that turns: its upper left texel and how often.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Turning {
    pub(crate) x: u32,
    pub(crate) y: u32,
    pub(crate) turns: i32,
}

/// The angle from `a` to `b` in radians, in [-pi, pi]; NaN where either has none.
pub(crate) fn turn(a: Vec2, b: Vec2) -> f32 {
    let (cross, dot) = (a.x * b.y - a.y * b.x, a.x * b.x + a.y * b.y);
    let angle = math::atan2(cross, dot);
    if dot.is_nan() { f32::NAN } else { angle }
}

/// Full turns around a loop, counter-clockwise, from the turns along its sides: rightward at the top and bottom, downward on
/// the right and left. A NaN is 0 as a whole number.
pub(crate) fn turns_around(top: f32, right: f32, bottom: f32, left: f32) -> i32 {
    // Right, down, left, up is clockwise; angles count the other way.
    -((top + right - bottom - left) / TAU).round() as i32
}

/// Takes loops within two texels of each other together and adds their turns: groups of loops, those that add up to 0 left
/// out. A point that falls on the corner of four texels, whose turns are half circles of either sign, is thus counted right:
/// around it nothing is in doubt.
pub(crate) fn gather(size: Size, wrap: Wrap, turning: &[Turning]) -> Vec<Vec<Turning>> {
    let apart = |a: u32, b: u32, n: u32, repeats: bool| {
        let d = a.abs_diff(b);
        if repeats { d.min(n - d) } else { d }
    };
    let near = |a: Turning, b: Turning| {
        apart(a.x, b.x, size.width(), wrap.repeats_u()) <= 2
            && apart(a.y, b.y, size.height(), wrap.repeats_v()) <= 2
    };
    let mut seen = vec![false; turning.len()];
    let mut groups = Vec::new();
    for start in 0..turning.len() {
        if seen[start] {
            continue;
        }
        seen[start] = true;
        let mut group = Vec::new();
        let mut open = vec![start];
        while let Some(i) = open.pop() {
            group.push(turning[i]);
            for j in 0..turning.len() {
                if !seen[j] && near(turning[i], turning[j]) {
                    seen[j] = true;
                    open.push(j);
                }
            }
        }
        if group.iter().map(|t| t.turns).sum::<i32>() != 0 {
            groups.push(group);
        }
    }
    groups
}

/// The singular points of a field of double-angle vectors of any length but zero, rows from the top, from the top. `None`
/// where there are too many to be points of a smooth field.
///
/// # Panics
/// When a plane has another length than the size says.
pub fn singularities(
    size: Size,
    wrap: Wrap,
    cos2: &[f32],
    sin2: &[f32],
) -> Option<Vec<Singularity>> {
    assert!(cos2.len() == size.texels() && sin2.len() == size.texels());
    let turning = turning(size, wrap, |x, y| {
        let i = y as usize * size.width() as usize + x as usize;
        Vec2::new(cos2[i], sin2[i])
    });
    if turning.len() > LOOPS_MAX {
        return None;
    }
    let groups = gather(size, wrap, &turning);
    Some(
        groups
            .iter()
            .map(|group| singularity(size, wrap, group))
            .collect(),
    )
}

/// The singular point of a group of loops: their middle, seen from the first, and the sum of their turns.
pub(crate) fn singularity(size: Size, wrap: Wrap, group: &[Turning]) -> Singularity {
    let first = group[0];
    let from_first = |a: u32, b: u32, n: u32, repeats: bool| {
        let d = i64::from(a) - i64::from(b);
        let n = i64::from(n);
        // The shorter way around.
        let d = if repeats && 2 * d > n {
            d - n
        } else if repeats && 2 * d < -n {
            d + n
        } else {
            d
        };
        d as f32
    };
    let (w, h) = (size.width(), size.height());
    let mean = |f: &dyn Fn(&Turning) -> f32| group.iter().map(f).sum::<f32>() / group.len() as f32;
    let x = mean(&|t| from_first(t.x, first.x, w, wrap.repeats_u()));
    let y = mean(&|t| from_first(t.y, first.y, h, wrap.repeats_v()));
    // The corner of four texels.
    Singularity {
        u: ((first.x as f32 + 1.0 + x) / w as f32).rem_euclid(1.0),
        v: (1.0 - (first.y as f32 + 1.0 + y) / h as f32).rem_euclid(1.0),
        twice_index: group.iter().map(|t| t.turns).sum(),
    }
}

fn turning(size: Size, wrap: Wrap, at: impl Fn(u32, u32) -> Vec2) -> Vec<Turning> {
    let (w, h) = (size.width(), size.height());
    let columns = if wrap.repeats_u() { w } else { w - 1 };
    let rows = if wrap.repeats_v() { h } else { h - 1 };
    let mut found = Vec::new();
    for y in 0..rows {
        let below = (y + 1) % h;
        for x in 0..columns {
            let next = (x + 1) % w;
            let (a, b, c, d) = (at(x, y), at(next, y), at(next, below), at(x, below));
            let turns = turns_around(turn(a, b), turn(b, c), turn(d, c), turn(a, d));
            if turns != 0 {
                found.push(Turning { x, y, turns });
                if found.len() > LOOPS_MAX {
                    return found;
                }
            }
        }
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn points_are_found_with_place_and_index() {
        let size = Size::new(60, 40).unwrap();
        // A +1/2 at (0.25, 0.5) and a -1/2 at (0.75, 0.5): half angles of two azimuths.
        let angle = |x: u32, y: u32| {
            let (x, y) = (x as f32 + 0.5, 20.3 - (y as f32 + 0.5));
            y.atan2(x - 15.2) - y.atan2(x - 45.2)
        };
        let plane = |f: fn(f32) -> f32| -> Vec<f32> {
            (0..40)
                .flat_map(|y| (0..60).map(move |x| f(angle(x, y))))
                .collect()
        };
        let found = singularities(size, Wrap::Clamp, &plane(f32::cos), &plane(f32::sin)).unwrap();
        assert_eq!(found.len(), 2, "{found:?}");
        let mut found = found;
        found.sort_by(|a, b| a.u.total_cmp(&b.u));
        for (point, (u, index)) in found.iter().zip([(0.25, 1), (0.75, -1)]) {
            assert_eq!(point.twice_index, index);
            assert!((point.u - u).abs() < 0.02 && (point.v - 0.5).abs() < 0.02);
        }
    }

    #[test]
    fn on_a_torus_indices_add_up_to_nothing_whatever_the_field() {
        let size = Size::new(31, 17).unwrap();
        for seed in 1..20u32 {
            // Waves that close over both edges, rough enough for many points.
            let wave = |x: u32, y: u32| {
                let (u, v) = (x as f32 / 31.0 * TAU, y as f32 / 17.0 * TAU);
                let s = seed as f32;
                (
                    (2.0 * u + s).sin() + (v + u).cos(),
                    (u - 2.0 * v + 3.0 * s).sin() + 0.3,
                )
            };
            let cells = || (0..17).flat_map(|y| (0..31).map(move |x| (x, y)));
            let cos2: Vec<f32> = cells().map(|(x, y)| wave(x, y).0).collect();
            let sin2: Vec<f32> = cells().map(|(x, y)| wave(x, y).1).collect();
            let found = singularities(size, Wrap::Repeat, &cos2, &sin2).unwrap();
            assert_eq!(found.iter().map(|p| p.twice_index).sum::<i32>(), 0);
        }
    }
}
