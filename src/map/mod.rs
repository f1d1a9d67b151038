//! The map: per texel the two Ward widths and the direction of the x axis.
//!
//! Row 0 is the top of the image, v = 0 the bottom: texel (x, y) has its centre at
//! u = (x + 0.5) / width, v = 1 - (y + 0.5) / height. Storage is planar f32, because every stage walks whole planes.

mod lobe;
mod region;
mod sample;
mod winding;

pub use lobe::SlopeCovariance;
pub use region::{Rect, Region, RegionMut, SIDE_MAX, Size, TEXELS_MAX};
pub(crate) use region::{crop_plane, gathered};
pub use sample::Footprint;
pub(crate) use winding::{LOOPS_MAX, Turning, gather, singularity, turn, turns_around};
pub use winding::{Singularity, singularities};

use crate::error::Result;
use crate::math::{AXIS_MIN_LENGTH, Axis, choose};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use std::borrow::Cow;

/// The smallest width a map holds and light is computed with; below it f32 lobes overflow.
pub const ALPHA_MIN: f32 = crate::brdf::ALPHA_FLOOR;
/// The largest width a map holds: a slope width of 1.5 is rougher than any measured surface.
pub const ALPHA_MAX: f32 = 1.5;
/// What a texel that cannot be read becomes: isotropic, of middling gloss.
pub const DEFAULT_TEXEL: Texel = Texel {
    alpha_x: 0.2,
    alpha_y: 0.2,
    axis: Axis::U,
};

/// One texel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Texel {
    /// Ward slope width along the x axis, in [`ALPHA_MIN`] ..= [`ALPHA_MAX`].
    pub alpha_x: f32,
    /// Ward slope width across the x axis, same range.
    pub alpha_y: f32,
    /// The x axis.
    pub axis: Axis,
}

impl Texel {
    /// The axis along the grooves: the one with the smaller width.
    pub fn groove(self) -> Axis {
        if self.alpha_x <= self.alpha_y {
            self.axis
        } else {
            self.axis.perpendicular()
        }
    }

    /// Larger width over smaller, at least 1.
    pub fn ratio(self) -> f32 {
        self.alpha_x.max(self.alpha_y) / self.alpha_x.min(self.alpha_y)
    }
}

/// What lies beyond the map's edge.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Wrap {
    /// The map again, in both directions.
    #[default]
    Repeat,
    /// The map again to the left and right; the edge texels above and below. A cylinder's side.
    RepeatU,
    /// The edge texels.
    Clamp,
}

impl Wrap {
    /// Whether the map repeats along u.
    pub fn repeats_u(self) -> bool {
        self != Self::Clamp
    }

    /// Whether the map repeats along v.
    pub fn repeats_v(self) -> bool {
        self == Self::Repeat
    }

    /// The column of the map that stands at column `x`, which may lie outside.
    pub fn column(self, x: i64, width: u32) -> u32 {
        fold(x, width, self.repeats_u())
    }

    /// The row of the map that stands at row `y`, which may lie outside.
    pub fn row(self, y: i64, height: u32) -> u32 {
        fold(y, height, self.repeats_v())
    }
}

fn fold(i: i64, n: u32, repeats: bool) -> u32 {
    let n = i64::from(n);
    let folded = if repeats {
        i.rem_euclid(n)
    } else {
        i.clamp(0, n - 1)
    };
    u32::try_from(folded).expect("folded into the map")
}

/// What was mended when numbers from outside entered a map.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Mended {
    /// Texels with a NaN or an infinity, set to [`DEFAULT_TEXEL`] (alphas) or the u axis (direction).
    pub non_finite: u64,
    /// Texels with an alpha outside [`ALPHA_MIN`] ..= [`ALPHA_MAX`], clamped to it.
    pub out_of_range: u64,
    /// Texels whose axis vector was too short to have a direction, made isotropic with the same area.
    pub no_direction: u64,
    /// Texels whose axis vector was not of unit length (by more than 2 %), normalised.
    pub not_unit: u64,
}

impl Mended {
    /// Texels that had to be changed for the map to be usable; `not_unit` alone is ordinary filtering and does not count.
    pub fn faults(self) -> u64 {
        self.non_finite + self.out_of_range + self.no_direction
    }

    /// Both counts together.
    #[must_use]
    pub fn plus(self, other: Self) -> Self {
        Self {
            non_finite: self.non_finite + other.non_finite,
            out_of_range: self.out_of_range + other.out_of_range,
            no_direction: self.no_direction + other.no_direction,
            not_unit: self.not_unit + other.not_unit,
        }
    }
}

/// Per texel: alpha_x, alpha_y, and (cos 2θ, sin 2θ) of the x axis, as four planes of f32 in row order, top row first.
///
/// Every texel in a map is finite and in range, and every axis is of unit length; [`AnisoMap::from_planes`] sees to it.
#[derive(Clone, Debug, PartialEq)]
pub struct AnisoMap {
    region: Region,
    wrap: Wrap,
}

impl AnisoMap {
    /// A map of one texel value.
    pub fn constant(size: Size, wrap: Wrap, texel: Texel) -> Self {
        Self {
            region: Region::constant(size.rect(), texel),
            wrap,
        }
    }

    /// A map of zeros, whose memory is not touched yet: the threads that fill it do so side by side. Whoever asks for it
    /// writes every texel before anybody else sees it.
    pub(crate) fn unfilled(size: Size, wrap: Wrap) -> Self {
        let plane = || vec![0.0; size.texels()];
        let planes = [plane(), plane(), plane(), plane()];
        Self {
            region: Region::from_planes(size.rect(), planes).expect("planes of the map's size"),
            wrap,
        }
    }

    /// A map from planes `[alpha_x, alpha_y, cos 2θ, sin 2θ]` of width x height numbers each, made safe: see [`Mended`].
    ///
    /// # Errors
    /// When a plane has another length than the size says.
    pub fn from_planes(size: Size, wrap: Wrap, planes: [Vec<f32>; 4]) -> Result<(Self, Mended)> {
        let mut region = Region::from_planes(size.rect(), planes)?;
        let mended = region.sanitise();
        Ok((Self { region, wrap }, mended))
    }

    /// Width and height in texels.
    pub fn size(&self) -> Size {
        self.region.rect().size()
    }

    /// Width in texels.
    pub fn width(&self) -> u32 {
        self.region.rect().width
    }

    /// Height in texels.
    pub fn height(&self) -> u32 {
        self.region.rect().height
    }

    /// What lies beyond the edge.
    pub fn wrap(&self) -> Wrap {
        self.wrap
    }

    /// The plane of alpha_x, top row first.
    pub fn alpha_x(&self) -> &[f32] {
        &self.region.alpha_x
    }

    /// The plane of alpha_y.
    pub fn alpha_y(&self) -> &[f32] {
        &self.region.alpha_y
    }

    /// The plane of cos 2θ.
    pub fn cos2(&self) -> &[f32] {
        &self.region.cos2
    }

    /// The plane of sin 2θ.
    pub fn sin2(&self) -> &[f32] {
        &self.region.sin2
    }

    /// The texel at column `x` and row `y`.
    ///
    /// # Panics
    /// Outside the map.
    pub fn texel(&self, x: u32, y: u32) -> Texel {
        self.region.texel(self.region.rect().index(x, y))
    }

    /// The texel of the nth place in row order.
    ///
    /// # Panics
    /// Outside the map.
    pub fn texel_at(&self, index: usize) -> Texel {
        self.region.texel(index)
    }

    /// A writable view of the whole map. Whoever writes keeps alphas in range and axes at unit length.
    pub fn region_mut(&mut self) -> RegionMut<'_> {
        self.region.view_mut()
    }

    /// Writable views of bands of `rows` whole rows each (the last may be lower), top first, to be filled side by side.
    pub fn bands_mut(&mut self, rows: u32) -> Vec<RegionMut<'_>> {
        self.region.view_mut().into_bands(rows)
    }

    /// A copy of a rectangle.
    ///
    /// # Panics
    /// When `rect` reaches outside the map.
    pub fn region(&self, rect: Rect) -> Region {
        let mut copy = Region::constant(rect, DEFAULT_TEXEL);
        copy.copy_from(&self.region);
        copy
    }

    /// Copies a rectangle into the map, where the two overlap.
    pub fn write_region(&mut self, source: &Region) {
        self.region.copy_from(source);
    }
}

/// Rows of a map that are written side by side.
const BAND: u32 = 64;

impl AnisoMap {
    /// Copies rectangles into the map, where they overlap with it, on all threads of the current pool.
    pub fn write_regions(&mut self, sources: &[Region]) {
        self.bands_mut(BAND).into_par_iter().for_each(|mut band| {
            for source in sources {
                band.copy_from(source);
            }
        });
    }
}

impl<'a> From<&'a AnisoMap> for Cow<'a, AnisoMap> {
    fn from(map: &'a AnisoMap) -> Self {
        Self::Borrowed(map)
    }
}

impl From<AnisoMap> for Cow<'_, AnisoMap> {
    fn from(map: AnisoMap) -> Self {
        Self::Owned(map)
    }
}

/// A blend of two texels as every layer and brush does it, `t` of `b` over `a`.
///
/// Linear are the mean of both widths and their stretch, which is half their difference along the double angle: a texel whose
/// axes change places with its widths is the same texel. Along one line this is linear in both widths. Lines that cross lose
/// stretch, as their grooves mixed would, and where nothing is left of it the texel is round, with the area that both widths blend
/// to: a soft edge between crossing grooves shows no third direction.
pub fn blend(a: Texel, b: Texel, t: f32) -> Texel {
    let numbers = |x: Texel| [x.alpha_x, x.alpha_y, x.axis.cos2, x.axis.sin2];
    let [alpha_x, alpha_y, cos2, sin2] = blend_numbers(numbers(a), numbers(b), t);
    Texel {
        alpha_x,
        alpha_y,
        axis: Axis { cos2, sin2 },
    }
}

/// [`blend`] of alpha_x, alpha_y, cos 2θ, sin 2θ. Every number is worked out and then chosen, so that loops over it take whole
/// vectors.
#[inline(always)]
pub(crate) fn blend_numbers(a: [f32; 4], b: [f32; 4], t: f32) -> [f32; 4] {
    let mix = |a: f32, b: f32| a + (b - a) * t;
    let (x, y) = (mix(a[0], b[0]), mix(a[1], b[1]));
    let (mean, half) = (0.5 * (x + y), 0.5 * (y - x));
    let (from, to) = (0.5 * (a[1] - a[0]), 0.5 * (b[1] - b[0]));
    let along = mix(from * a[2], to * b[2]);
    let beside = mix(from * a[3], to * b[3]);
    let length = (along * along + beside * beside).sqrt();
    // Which axis is x stays as the widths have it.
    let sign = choose(half < 0.0, -1.0, 1.0);
    // Round texels keep a direction: the mean of both.
    let is_stretched = length > 1e-4 * mean;
    let c = choose(is_stretched, sign * along, mix(a[2], b[2]));
    let s = choose(is_stretched, sign * beside, mix(a[3], b[3]));
    let unit = (c * c + s * s).sqrt();
    let scale = 1.0 / unit.max(1e-30);
    let lost = !is_stretched & (unit < AXIS_MIN_LENGTH);
    let (x1, y1) = (mean - sign * length, mean + sign * length);
    let area = (x * y / (x1 * y1)).min(1.0).sqrt();
    // Where no stretch is lost the widths are linear.
    let is_whole = (length - half.abs()).abs() <= 1e-6 * mean;
    [
        choose(is_whole, x, x1 * area),
        choose(is_whole, y, y1 * area),
        choose(lost, 1.0, c * scale),
        choose(lost, 0.0, s * scale),
    ]
}

/// Ends a linear mean of widths and double angles, as a magnified fetch takes it: normalises the double angle, or makes the texel isotropic with the same area where its length fell under
/// [`AXIS_MIN_LENGTH`].
pub fn settle(alpha_x: f32, alpha_y: f32, cos2: f32, sin2: f32) -> Texel {
    let length = (cos2 * cos2 + sin2 * sin2).sqrt();
    if length >= AXIS_MIN_LENGTH {
        Texel {
            alpha_x,
            alpha_y,
            axis: Axis {
                cos2: cos2 / length,
                sin2: sin2 / length,
            },
        }
    } else {
        let alpha = (alpha_x * alpha_y).sqrt();
        Texel {
            alpha_x: alpha,
            alpha_y: alpha,
            axis: Axis::U,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_enters_a_map_is_mended_and_counted() {
        let size = Size::new(3, 2).unwrap();
        let planes = [
            vec![f32::NAN, 0.0, 9.0, 0.1, 0.1, 0.1],
            vec![0.1, 0.1, 0.1, 0.4, 0.1, 0.1],
            vec![1.0, 1.0, 1.0, 0.0, 2.0, f32::INFINITY],
            vec![0.0; 6],
        ];
        let (map, mended) = AnisoMap::from_planes(size, Wrap::Repeat, planes).unwrap();
        assert_eq!(
            mended,
            Mended {
                non_finite: 2,
                out_of_range: 2,
                no_direction: 1,
                not_unit: 1
            }
        );
        assert_eq!(map.texel(0, 0).alpha_x, DEFAULT_TEXEL.alpha_x);
        assert_eq!(map.texel(1, 0).alpha_x, ALPHA_MIN);
        assert_eq!(map.texel(2, 0).alpha_x, ALPHA_MAX);
        assert!(
            (map.texel(0, 1).alpha_x - 0.2).abs() < 1e-6,
            "the same area: sqrt(0.1 * 0.4)"
        );
        assert_eq!(map.texel(1, 1).axis, Axis::U);
        let short =
            AnisoMap::from_planes(size, Wrap::Repeat, [vec![0.1; 5], vec![], vec![], vec![]]);
        assert!(short.is_err());
    }

    #[test]
    fn blend_knows_no_wrap_and_goes_isotropic_where_lines_cross() {
        let at = |degrees| Texel {
            alpha_x: 0.1,
            alpha_y: 0.4,
            axis: Axis::from_degrees(degrees),
        };
        let mid = blend(at(1.0), at(179.0), 0.5);
        assert!(mid.axis.angle_to(Axis::U).to_degrees() < 1e-3);
        assert!((mid.alpha_x - 0.1).abs() < 3e-4, "2 degrees of crossing");
        let crossed = blend(at(0.0), at(90.0), 0.5);
        assert!((crossed.alpha_x - 0.2).abs() < 1e-6 && (crossed.alpha_y - 0.2).abs() < 1e-6);
        // Nearly across: no sharp lobe in a third direction on the way.
        for t in 0..=20 {
            let x = blend(at(0.0), at(86.0), t as f32 / 20.0);
            let third = x.axis.angle_to(Axis::from_degrees(43.0)).to_degrees() < 30.0;
            assert!(!third || x.alpha_y < 1.2 * x.alpha_x, "{t}: {x:?}");
        }
    }

    #[test]
    fn blends_see_what_a_texel_means_and_not_how_it_is_written() {
        let one = Texel {
            alpha_x: 0.1,
            alpha_y: 0.4,
            axis: Axis::from_degrees(30.0),
        };
        let same = Texel {
            alpha_x: 0.4,
            alpha_y: 0.1,
            axis: Axis::from_degrees(120.0),
        };
        for t in [0.1, 0.3, 0.5, 0.7, 0.9] {
            let x = blend(one, same, t);
            let written = if x.alpha_x < x.alpha_y { one } else { same };
            assert!((x.alpha_x - written.alpha_x).abs() < 1e-6);
            assert!((x.alpha_y - written.alpha_y).abs() < 1e-6);
            assert!(x.axis.angle_to(written.axis).to_degrees() < 1e-2);
        }
        // Little by little it comes to what it is blended with, over crossing grooves too.
        let mut x = one;
        let across = Texel {
            axis: Axis::from_degrees(120.0),
            ..one
        };
        for _ in 0..8000 {
            x = blend(x, across, 0.001);
        }
        assert!(
            (x.alpha_x - 0.1).abs() < 1e-3 && (x.alpha_y - 0.4).abs() < 1e-3,
            "{x:?}"
        );
        assert!(x.axis.angle_to(across.axis).to_degrees() < 0.1);
    }

    proptest::proptest! {
        #[test]
        fn blends_stay_between(
            ax in ALPHA_MIN..ALPHA_MAX, ay in ALPHA_MIN..ALPHA_MAX,
            bx in ALPHA_MIN..ALPHA_MAX, by in ALPHA_MIN..ALPHA_MAX,
            d in 0.0f32..180.0, e in 0.0f32..180.0, t in 0.0f32..=1.0,
        ) {
            let a = Texel { alpha_x: ax, alpha_y: ay, axis: Axis::from_degrees(d) };
            let b = Texel { alpha_x: bx, alpha_y: by, axis: Axis::from_degrees(e) };
            let x = blend(a, b, t);
            let (least, most) = (ax.min(ay).min(bx).min(by), ax.max(ay).max(bx).max(by));
            let room = 1e-5 * most;
            for alpha in [x.alpha_x, x.alpha_y] {
                proptest::prop_assert!(alpha >= 0.999 * least - room && alpha <= most + room, "{x:?}");
            }
            proptest::prop_assert!((x.axis.double_angle().length() - 1.0).abs() < 1e-5);
        }
    }

    #[test]
    fn wrap_folds_columns_and_rows() {
        assert_eq!(Wrap::Repeat.column(-1, 4), 3);
        assert_eq!(Wrap::Repeat.row(5, 4), 1);
        assert_eq!(Wrap::RepeatU.row(5, 4), 3);
        assert_eq!(Wrap::Clamp.column(-7, 4), 0);
        assert_eq!(Wrap::Repeat.column(i64::from(u32::MAX) * 4, 1), 0);
    }
}
