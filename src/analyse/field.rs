//! The line field of the grooves: where it jumps at the map's edge, and where it has poles.
//!
//! What a pole is, and its index, stands in `map/winding.rs`. Texels without a direction (ratio up to [`DIRECTED_RATIO`])
//! have no turn, so a pole inside an isotropic patch is none.

use super::{DIRECTED_RATIO, Place};
use crate::error::Result;
use crate::map::{AnisoMap, LOOPS_MAX, Texel, Turning, gather, singularity, turn, turns_around};
use crate::progress::Progress;
use glam::Vec2;
use rayon::prelude::*;
use std::ops::Range;
use std::sync::{Mutex, PoisonError};

/// Rows that one thread takes at a time.
const BAND: u32 = 32;

/// A jump at the edge from this on is counted, in degrees.
pub(super) const JUMP_DEGREES: f32 = 10.0;

/// From this on the turn between two neighbours is an edge between directions and none of a smooth field, in degrees: half of
/// what an axis can turn, where the way around is about to be in doubt.
const EDGE_DEGREES: f32 = 45.0;

/// Half the side of the ring around a pole that is searched for edges, in texels. A pole alone, of index 3/2 at most, turns by
/// less than [`EDGE_DEGREES`] from texel to texel there.
const RING: i64 = 3;

/// What a walk over all neighbours found.
pub(super) struct Field {
    /// Across the left and right edge; none where the map does not repeat there or is narrower than 3 texels.
    pub(super) seam_u: Option<Seam>,
    /// Across the top and bottom edge.
    pub(super) seam_v: Option<Seam>,
    /// The poles.
    pub(super) poles: Poles,
}

/// The jumps of direction across an edge where the map repeats.
#[derive(Debug)]
pub(super) struct Seam {
    /// The mean, in degrees.
    pub(super) mean_degrees: f32,
    /// The largest mean of any pair of neighbouring columns (or rows) inside the map, in degrees.
    pub(super) inside_degrees: f32,
    /// Texels that jump by [`JUMP_DEGREES`] or more.
    pub(super) jumps: u64,
    /// The first of them.
    pub(super) first: Option<Place>,
}

/// The poles of a field.
#[derive(Debug, PartialEq)]
pub(super) enum Poles {
    /// So many loops turn that the field has no smooth part to speak of; the first of them.
    Rough(u64, Place),
    /// From the top; loops closer than three texels are one pole.
    Each(Vec<Pole>),
}

/// A pole.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Pole {
    /// The texel above and to the left of the first loop that turns.
    pub(super) place: Place,
    /// The middle of its loops, in texels from the map's upper left corner.
    pub(super) middle: Vec2,
    /// Twice its index.
    pub(super) halves: i32,
    /// The direction jumps on a ring around it: no point of a smooth field, but a corner of an edge between directions.
    pub(super) is_at_edge: bool,
}

/// Sums of jumps in millionths of a degree: whole numbers, which come together in any order.
#[derive(Clone, Copy, Default)]
struct Jumps {
    millionths: u64,
    pairs: u64,
}

impl Jumps {
    fn add(&mut self, turn: f32) {
        if !turn.is_nan() {
            self.millionths += (degrees(turn) * 1e6) as u64;
            self.pairs += 1;
        }
    }

    fn mean(self) -> f32 {
        if self.pairs == 0 {
            return 0.0;
        }
        (self.millionths as f64 / 1e6 / self.pairs as f64) as f32
    }
}

/// The angle between two axes from the turn of their double-angle vectors.
pub(super) fn degrees(turn: f32) -> f32 {
    0.5 * turn.abs().to_degrees()
}

/// The double-angle vectors of the grooves in a row; NaN where there is no direction.
fn grooves(map: &AnisoMap, row: u32) -> Vec<Vec2> {
    let width = map.width() as usize;
    let start = row as usize * width;
    (start..start + width)
        .map(|i| groove(map.texel_at(i)))
        .collect()
}

/// The double-angle vector of a texel's groove; NaN where it has no direction.
pub(super) fn groove(texel: Texel) -> Vec2 {
    let (x, y) = (texel.alpha_x, texel.alpha_y);
    let sign = if x > DIRECTED_RATIO * y {
        -1.0
    } else if y > DIRECTED_RATIO * x {
        1.0
    } else {
        f32::NAN
    };
    texel.axis.double_angle() * sign
}

/// Turns from each texel of a row to the next one on the right, around the edge where the map repeats.
fn turns_right(row: &[Vec2], repeats: bool) -> Vec<f32> {
    let inside = row.windows(2).map(|p| turn(p[0], p[1]));
    let around = repeats.then(|| turn(row[row.len() - 1], row[0]));
    inside.chain(around).collect()
}

/// What one band of rows found.
struct Band {
    rows: Vec<Jumps>,
    turning: Vec<Turning>,
    turning_count: u64,
    seam_u: (u64, Option<Place>),
    seam_v: (u64, Option<Place>),
}

/// Jumps of a row of turns, and the first, for the seam counts.
fn count_jumps(turns: &[f32], place: impl Fn(u32) -> Place) -> (u64, Option<Place>) {
    let mut found = (0, None);
    for (x, &t) in (0..).zip(turns) {
        if degrees(t) >= JUMP_DEGREES {
            found.0 += 1;
            found.1 = found.1.or(Some(place(x)));
        }
    }
    found
}

fn merge_jumps(a: (u64, Option<Place>), b: (u64, Option<Place>)) -> (u64, Option<Place>) {
    (a.0 + b.0, a.1.or(b.1))
}

fn walk_band(map: &AnisoMap, band: Range<u32>, columns: &Mutex<Vec<Jumps>>) -> Band {
    let (width, height) = (map.width(), map.height());
    let (repeats_u, repeats_v) = (map.wrap().repeats_u(), map.wrap().repeats_v());
    let mut found = Band {
        rows: Vec::new(),
        turning: Vec::new(),
        turning_count: 0,
        seam_u: (0, None),
        seam_v: (0, None),
    };
    let mut mine = vec![Jumps::default(); width as usize];
    let mut upper = grooves(map, band.start);
    let mut upper_right = turns_right(&upper, repeats_u);
    for y in band {
        for (jumps, &t) in mine.iter_mut().zip(&upper_right) {
            jumps.add(t);
        }
        if repeats_u && width > 1 {
            let last = &upper_right[width as usize - 1..];
            let at = |_| Place { x: width - 1, y };
            found.seam_u = merge_jumps(found.seam_u, count_jumps(last, at));
        }
        let next = match y + 1 {
            n if n < height => n,
            _ if repeats_v && height > 1 => 0,
            _ => break,
        };
        let lower = grooves(map, next);
        let lower_right = turns_right(&lower, repeats_u);
        let down: Vec<f32> = upper
            .iter()
            .zip(&lower)
            .map(|(&a, &b)| turn(a, b))
            .collect();
        let mut row = Jumps::default();
        down.iter().for_each(|&t| row.add(t));
        found.rows.push(row);
        if next == 0 {
            found.seam_v = merge_jumps(found.seam_v, count_jumps(&down, |x| Place { x, y }));
        }
        for (i, (&top, &bottom)) in upper_right.iter().zip(&lower_right).enumerate() {
            let right = if i + 1 < down.len() {
                down[i + 1]
            } else {
                down[0]
            };
            let turns = turns_around(top, right, bottom, down[i]);
            if turns != 0 {
                found.turning_count += 1;
                if found.turning.len() <= LOOPS_MAX {
                    let x = u32::try_from(i).expect("a side of a map fits 32 bits");
                    found.turning.push(Turning { x, y, turns });
                }
            }
        }
        (upper, upper_right) = (lower, lower_right);
    }
    let mut total = columns.lock().unwrap_or_else(PoisonError::into_inner);
    for (sum, part) in total.iter_mut().zip(&mine) {
        sum.millionths += part.millionths;
        sum.pairs += part.pairs;
    }
    found
}

/// The last pair of a ring is the seam; the rest is inside.
fn seam(ring: &[Jumps], repeats: bool, (jumps, first): (u64, Option<Place>)) -> Option<Seam> {
    let (edge, inside) = ring.split_last()?;
    (repeats && ring.len() >= 3).then(|| Seam {
        mean_degrees: edge.mean(),
        inside_degrees: inside.iter().map(|j| j.mean()).fold(0.0, f32::max),
        jumps,
        first,
    })
}

/// The poles that loops make.
fn poles(map: &AnisoMap, turning: &[Turning]) -> Vec<Pole> {
    let (size, wrap) = (map.size(), map.wrap());
    let texels = Vec2::new(size.width() as f32, size.height() as f32);
    let pole = |group: &Vec<Turning>| {
        let Turning { x, y, .. } = group[0];
        let middle = singularity(size, wrap, group);
        let halves = middle.twice_index;
        let middle = Vec2::new(middle.u, 1.0 - middle.v) * texels;
        Pole {
            place: Place { x, y },
            middle,
            halves,
            is_at_edge: is_at_edge(map, middle),
        }
    };
    let groups = gather(size, wrap, turning);
    groups.iter().map(pole).collect()
}

/// Whether the direction jumps between neighbours on the ring around a point, given in texels from the upper left corner.
fn is_at_edge(map: &AnisoMap, middle: Vec2) -> bool {
    let (left, top) = (
        middle.x.round() as i64 - RING,
        middle.y.round() as i64 - RING,
    );
    let last = 2 * RING - 1;
    let ring = (0..last)
        .map(|i| (i, 0))
        .chain((0..last).map(|i| (last, i)))
        .chain((0..last).map(|i| (last - i, last)))
        .chain((0..last).map(|i| (0, last - i)));
    let grooves: Vec<Vec2> = ring
        .map(|(x, y)| groove_at(map, left + x, top + y))
        .collect();
    let next = grooves.iter().cycle().skip(1);
    grooves
        .iter()
        .zip(next)
        .any(|(&a, &b)| degrees(turn(a, b)) >= EDGE_DEGREES)
}

/// The groove at a column and row that may lie beyond the map; NaN where the map has none.
fn groove_at(map: &AnisoMap, x: i64, y: i64) -> Vec2 {
    let fold = |i: i64, n: u32, repeats: bool| {
        let n = i64::from(n);
        let i = if repeats { i.rem_euclid(n) } else { i };
        (0..n).contains(&i).then_some(i as u32)
    };
    let x = fold(x, map.width(), map.wrap().repeats_u());
    let y = fold(y, map.height(), map.wrap().repeats_v());
    match (x, y) {
        (Some(x), Some(y)) => groove(map.texel(x, y)),
        _ => Vec2::NAN,
    }
}

/// Walks over all pairs and loops of neighbours.
///
/// # Errors
/// [`Error::Cancelled`](crate::error::Error::Cancelled) when `progress` says so.
pub(super) fn walk(map: &AnisoMap, progress: &Progress<'_>) -> Result<Field> {
    let (width, height) = (map.width(), map.height());
    let columns = Mutex::new(vec![Jumps::default(); width as usize]);
    progress.expect(u64::from(height.div_ceil(BAND)));
    let bands: Vec<Band> = (0..height.div_ceil(BAND))
        .into_par_iter()
        .map(|i| {
            progress.step()?;
            Ok(walk_band(
                map,
                i * BAND..height.min((i + 1) * BAND),
                &columns,
            ))
        })
        .collect::<Result<_>>()?;
    let columns = columns.into_inner().unwrap_or_else(PoisonError::into_inner);

    let mut rows = Vec::new();
    let mut turning = Vec::new();
    let mut count = 0;
    let (mut seam_u, mut seam_v) = ((0, None), (0, None));
    for band in bands {
        rows.extend(band.rows);
        turning.extend(band.turning);
        count += band.turning_count;
        seam_u = merge_jumps(seam_u, band.seam_u);
        seam_v = merge_jumps(seam_v, band.seam_v);
    }
    let poles = match turning.first() {
        Some(&Turning { x, y, .. }) if count > LOOPS_MAX as u64 => {
            Poles::Rough(count, Place { x, y })
        }
        _ => Poles::Each(poles(map, &turning)),
    };
    Ok(Field {
        seam_u: seam(&columns, map.wrap().repeats_u(), seam_u),
        seam_v: seam(&rows, map.wrap().repeats_v(), seam_v),
        poles,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::map::{Size, Wrap};
    use crate::math::Axis;
    use std::f32::consts::TAU;

    /// A map whose groove at (x, y) from the middle, y up, points at `angle(x, y)` radians; isotropic within `cap` texels.
    fn map(
        width: u32,
        height: u32,
        wrap: Wrap,
        cap: f32,
        angle: impl Fn(f32, f32) -> f32,
    ) -> AnisoMap {
        let size = Size::new(width, height).unwrap();
        let mut map = AnisoMap::constant(size, wrap, crate::map::DEFAULT_TEXEL);
        let mut region = map.region_mut();
        for j in 0..height {
            for i in 0..width {
                let x = i as f32 + 0.5 - 0.5 * width as f32;
                let y = 0.5 * height as f32 - j as f32 - 0.5;
                let alpha_y = if x.hypot(y) < cap { 0.1 } else { 0.4 };
                let axis = Axis::from_radians(angle(x, y));
                let texel = Texel {
                    alpha_x: 0.1,
                    alpha_y,
                    axis,
                };
                region.set((j * width + i) as usize, texel);
            }
        }
        map
    }

    fn walk(map: &AnisoMap) -> Field {
        super::walk(map, &Progress::none()).unwrap()
    }

    fn poles(map: &AnisoMap) -> Vec<Pole> {
        match walk(map).poles {
            Poles::Each(poles) => poles,
            Poles::Rough(n, place) => panic!("{n} from {place:?}"),
        }
    }

    #[test]
    fn poles_are_counted_with_their_index() {
        // Twice the index m: the groove turns by m/2 of the azimuth.
        for (factor, index) in [(1.0, 2), (0.5, 1), (-0.5, -1), (-1.0, -2), (1.5, 3)] {
            for size in [40, 41, 64] {
                let m = map(size, size, Wrap::Clamp, 0.0, |x, y| {
                    factor * y.atan2(x) + 0.3
                });
                let found = poles(&m);
                assert_eq!(found.len(), 1, "{factor} at {size}: {found:?}");
                assert_eq!(found[0].halves, index, "{factor} at {size}");
                assert!(!found[0].is_at_edge, "{factor} at {size}");
                let off = found[0].middle - Vec2::splat(0.5 * size as f32);
                assert!(off.length() < 0.8, "{off}");
            }
        }
    }

    #[test]
    fn a_pole_under_an_isotropic_cap_is_none() {
        let m = map(64, 64, Wrap::Clamp, 4.0, |x, y| y.atan2(x));
        assert_eq!(poles(&m), []);
    }

    #[test]
    fn where_directions_meet_at_edges_is_no_smooth_field() {
        // Four sheets whose grooves differ by 50 degrees from one to the next: the last edge closes a turn of 180.
        let sheets = |x: f32, y: f32| {
            let quarter = (y.atan2(x) / TAU).rem_euclid(1.0) * 4.0;
            (50.0 * quarter.floor()).to_radians()
        };
        for wrap in [Wrap::Clamp, Wrap::Repeat] {
            let found = poles(&map(40, 40, wrap, 0.0, sheets));
            let middle = found.iter().find(|p| p.middle == Vec2::splat(20.0));
            assert!(middle.is_some_and(|p| p.is_at_edge), "{found:?}");
        }
    }

    #[test]
    fn a_smooth_field_has_no_poles_and_no_seam() {
        let wave = |x: f32, _| 0.4 * (TAU * x / 100.0).sin();
        let field = walk(&map(100, 80, Wrap::Repeat, 0.0, wave));
        assert_eq!(field.poles, Poles::Each(vec![]));
        let (u, v) = (field.seam_u.unwrap(), field.seam_v.unwrap());
        assert!(u.mean_degrees < 2.0 && u.jumps == 0, "{u:?}");
        assert!(v.mean_degrees < 1e-3 && v.jumps == 0, "{v:?}");
    }

    #[test]
    fn a_seam_is_measured_in_degrees() {
        // The direction climbs by 60 degrees from left to right and jumps back at the edge.
        let ramp = |x: f32, _| (60.0 * x / 200.0).to_radians();
        let field = walk(&map(200, 50, Wrap::RepeatU, 0.0, ramp));
        let u = field.seam_u.unwrap();
        assert!(
            (u.mean_degrees - 59.7).abs() < 0.1 && u.inside_degrees < 0.4,
            "{u:?}"
        );
        assert_eq!((u.jumps, u.first), (50, Some(Place { x: 199, y: 0 })));
        assert!(field.seam_v.is_none());
        assert!(walk(&map(200, 50, Wrap::Clamp, 0.0, ramp)).seam_u.is_none());
    }

    #[test]
    fn the_names_of_the_axes_make_no_jump() {
        let size = Size::new(8, 8).unwrap();
        let mut m = map(8, 8, Wrap::Repeat, 0.0, |_, _| 0.2);
        for i in (0..size.texels()).step_by(3) {
            let Texel {
                alpha_x,
                alpha_y,
                axis,
            } = m.texel_at(i);
            let renamed = Texel {
                alpha_x: alpha_y,
                alpha_y: alpha_x,
                axis: axis.perpendicular(),
            };
            m.region_mut().set(i, renamed);
        }
        let field = walk(&m);
        assert_eq!(field.seam_u.unwrap().jumps, 0);
        assert_eq!(field.poles, Poles::Each(vec![]));
    }

    #[test]
    fn noise_is_called_rough_and_tiny_maps_are_fine() {
        let noise = |x: f32, y: f32| (x * 12.9898 + y * 78.233).sin() * 43_758.547;
        let Poles::Rough(n, _) = walk(&map(256, 256, Wrap::Repeat, 0.0, noise)).poles else {
            panic!("noise is no smooth field");
        };
        assert!(n > 10_000);
        for (w, h) in [(1, 1), (1, 5), (5, 1), (2, 2)] {
            for wrap in [Wrap::Repeat, Wrap::RepeatU, Wrap::Clamp] {
                assert_eq!(poles(&map(w, h, wrap, 0.0, |_, _| 0.5)), []);
            }
        }
    }
}
