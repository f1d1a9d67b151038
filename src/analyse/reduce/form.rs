//! What is kept of a map: how its texels lie, which of their numbers change from texel to texel, and how those are stored.

use super::files::round;
use crate::analyse::by_stretches;
use crate::convention::storage::{
    AxisEncoding, AxisStorage, Depth, Storage, WidthEncoding, WidthStorage,
};
use crate::error::Result;
use crate::filter::{Disc, reduce};
use crate::map::{AnisoMap, Size, SlopeCovariance, Texel};
use crate::math::Axis;
use crate::recipe::Radius;
use glam::{DVec2, Vec2};
use serde::Serialize;
use std::borrow::Cow;
use std::fmt;

/// How the texels lie on the surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Shape {
    /// One texel for all of it: no map.
    Constant(Texel),
    /// A table from a centre outward.
    Radial(Radius, u32),
    /// A map of this size; of one row a strip along u, of one column a strip along v.
    Grid(Size),
}

/// Which widths change from texel to texel.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Widths {
    /// Both.
    Each,
    /// One that is both: round lobes.
    Round,
    /// alpha_x; alpha_y is one for all.
    X,
    /// alpha_y; alpha_x is one for all.
    Y,
    /// Neither.
    Same,
}

impl Widths {
    /// Whether alpha_x is stored, or what is both.
    pub(super) fn keep_x(self) -> bool {
        matches!(self, Self::Each | Self::Round | Self::X)
    }

    /// Whether alpha_y is stored.
    pub(super) fn keep_y(self) -> bool {
        matches!(self, Self::Each | Self::Y)
    }
}

/// The width of a round lobe in place of two.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Rounding {
    /// That of the same peak.
    Peak,
    /// That of the same mean slope variance, which is what Phong's models take the two for.
    Variance,
}

impl Rounding {
    fn width(self, alpha_x: f32, alpha_y: f32) -> f32 {
        let square = match self {
            Self::Peak => alpha_x * alpha_y,
            Self::Variance => 0.5 * (alpha_x * alpha_x + alpha_y * alpha_y),
        };
        // The root of a square may be an ulp above the largest width.
        square.sqrt().min(crate::map::ALPHA_MAX)
    }
}

/// Whether the axis changes from texel to texel.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Axes {
    /// It does.
    Each,
    /// It is one for all.
    Same,
}

/// How the numbers of a texel are stored, each for itself.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Channels {
    /// alpha_x, or the one width of round lobes.
    pub x: WidthStorage,
    /// alpha_y.
    pub y: WidthStorage,
    /// The axis.
    pub axis: AxisStorage,
}

impl Channels {
    /// To the bit.
    pub(super) const FULL: Self = Self {
        x: Storage::FULL.widths,
        y: Storage::FULL.widths,
        axis: Storage::FULL.axis,
    };

    /// Each with its own bits. Integers are even steps of a width's logarithm, and the axis is a double angle, so that whoever
    /// reads the files may filter them.
    pub(super) fn new(x: Depth, y: Depth, axis: Depth) -> Self {
        let width = |depth: Depth| match depth.top() {
            Some(_) => WidthStorage::new(depth, WidthEncoding::Log),
            None => WidthStorage {
                depth,
                ..Storage::FULL.widths
            },
        };
        Self {
            x: width(x),
            y: width(y),
            axis: AxisStorage::new(axis, AxisEncoding::Double),
        }
    }
}

/// What is kept.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Form {
    /// How the texels lie.
    pub shape: Shape,
    /// What is kept of their widths.
    pub widths: Widths,
    /// What is kept of their axes.
    pub axes: Axes,
    /// How it is stored; what is not kept stands there as floats, alpha_y of round lobes as alpha_x.
    pub channels: Channels,
}

impl Form {
    /// Every number of a shape, to the bit.
    pub(super) fn full(shape: Shape) -> Self {
        Self {
            shape,
            widths: Widths::Each,
            axes: Axes::Each,
            channels: Channels::FULL,
        }
    }

    /// Part of the numbers of a shape; forms that store the same are equal.
    pub(super) fn new(shape: Shape, widths: Widths, axes: Axes, channels: Channels) -> Self {
        let kept = |keep: bool, own: WidthStorage| if keep { own } else { Channels::FULL.x };
        let x = kept(widths.keep_x(), channels.x);
        Self {
            shape,
            widths,
            axes,
            channels: Channels {
                x,
                y: match widths {
                    Widths::Round => x,
                    _ => kept(widths.keep_y(), channels.y),
                },
                axis: match axes {
                    Axes::Each => channels.axis,
                    Axes::Same => Channels::FULL.axis,
                },
            },
        }
    }

    /// Texels, or samples of a table; 0 without a map.
    pub fn texels(&self) -> u64 {
        match self.shape {
            Shape::Constant(_) => 0,
            Shape::Radial(_, samples) => u64::from(samples),
            Shape::Grid(size) => size.texels() as u64,
        }
    }

    /// Bytes of one texel in memory.
    pub fn bytes_per_texel(&self) -> u64 {
        let Channels { x, y, axis } = self.channels;
        let of = |keep: bool, numbers: usize, depth: Depth| match keep {
            true => (numbers * depth.bytes()) as u64,
            false => 0,
        };
        of(self.widths.keep_x(), 1, x.depth)
            + of(self.widths.keep_y(), 1, y.depth)
            + of(self.axes == Axes::Each, axis.encoding.numbers(), axis.depth)
    }

    /// Bytes of the whole in memory, not compressed.
    pub fn bytes(&self) -> u64 {
        self.texels() * self.bytes_per_texel()
    }

    /// The depth of a master EXR that holds the form: a map or strip of floats with nothing left out.
    pub(super) fn master(&self) -> Option<Depth> {
        let Channels { x, y, axis } = self.channels;
        let whole = self.widths == Widths::Each && self.axes == Axes::Each;
        let alike = x.depth == y.depth && x.depth == axis.depth && x.depth.top().is_none();
        let is_master = whole && alike && matches!(self.shape, Shape::Grid(_));
        is_master.then_some(x.depth)
    }

    /// One word for the shape.
    pub fn kind(&self) -> &'static str {
        match self.shape {
            Shape::Constant(_) => "constants",
            Shape::Radial(..) => "radial strip",
            Shape::Grid(size) if size.height() == 1 && size.width() > 1 => "strip along u",
            Shape::Grid(size) if size.width() == 1 && size.height() > 1 => "strip along v",
            Shape::Grid(_) => "map",
        }
    }
}

impl fmt::Display for Form {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.kind())?;
        match self.shape {
            Shape::Constant(t) => {
                return write!(
                    f,
                    " alpha_x {:.4}, alpha_y {:.4}, {:.2} degrees",
                    t.alpha_x,
                    t.alpha_y,
                    t.axis.degrees()
                );
            }
            // A table of nothing that changes has no length.
            Shape::Radial(..) if self.bytes_per_texel() == 0 => {}
            Shape::Radial(_, samples) => write!(f, " of {samples}")?,
            Shape::Grid(size) => write!(f, " {size}")?,
        }
        match self.widths {
            Widths::Each => {}
            Widths::Round => f.write_str(", isotropic")?,
            Widths::X => f.write_str(", constant alpha_y")?,
            Widths::Y => f.write_str(", constant alpha_x")?,
            Widths::Same => f.write_str(", constant widths")?,
        }
        if self.axes == Axes::Same && self.widths != Widths::Round {
            f.write_str(", one direction")?;
        }
        match self.stored().as_str() {
            "" => Ok(()),
            stored => write!(f, ", {stored}"),
        }
    }
}

impl Form {
    /// How its numbers are stored, as [`Storage`] says it, or channel by channel where the widths differ; empty without any.
    pub fn stored(&self) -> String {
        let Channels { x, y, axis } = self.channels;
        let alike = (x.depth, x.encoding) == (y.depth, y.encoding);
        let widths = match self.widths {
            Widths::Each if !alike => format!("alpha_x {x}, alpha_y {y}"),
            Widths::Each | Widths::Round | Widths::X => x.to_string(),
            Widths::Y => y.to_string(),
            Widths::Same => String::new(),
        };
        let storage = Storage { widths: x, axis };
        match (self.widths, self.axes) {
            (_, Axes::Same) => widths,
            (Widths::Same, Axes::Each) => axis.to_string(),
            (Widths::Each, Axes::Each) if !alike => format!("{widths}, axis {axis}"),
            (Widths::Y, Axes::Each) => Storage { widths: y, axis }.to_string(),
            (_, Axes::Each) => storage.to_string(),
        }
    }
}

/// The texels of a shape before anything is left out.
pub(super) fn base<'a>(map: &'a AnisoMap, aspect: f32, shape: Shape) -> Result<Cow<'a, AnisoMap>> {
    Ok(match shape {
        Shape::Constant(texel) => {
            Cow::Owned(AnisoMap::constant(Size::new(1, 1)?, map.wrap(), texel))
        }
        Shape::Radial(radius, samples) => Cow::Owned(radius.disc(aspect).table(map, samples)?),
        Shape::Grid(size) if size == map.size() => Cow::Borrowed(map),
        Shape::Grid(size) => Cow::Owned(reduce(map, size)?),
    })
}

/// A form with its numbers: what goes into the files, and the map that whoever reads them gets.
pub(super) struct Kept {
    pub(super) form: Form,
    /// What stands for numbers that are the same everywhere.
    pub(super) same: Texel,
    /// The numbers before they were stored, of a table before it was laid; none where the map has them.
    numbers: Option<AnisoMap>,
    /// What is drawn and exported.
    pub(super) map: AnisoMap,
}

impl Kept {
    /// Leaves out of a shape's texels what the form leaves out. `full` is the map that they are those of, and `whole` what is
    /// typical of it: in a table a few texels around the centre would count like many far out.
    pub(super) fn new(
        base: &AnisoMap,
        mut form: Form,
        rounding: Rounding,
        (full, aspect): (&AnisoMap, f32),
        whole: Texel,
    ) -> Result<Self> {
        let same = match form.shape {
            Shape::Constant(texel) => texel,
            Shape::Grid(_) => whole,
            // The axis is told against the outward direction.
            Shape::Radial(..) => Texel {
                axis: typical(base).axis,
                ..whole
            },
        };
        let mut numbers = base.clone();
        leave_out(&mut numbers, form, rounding, same);
        if form.bytes_per_texel() == 0 {
            // A table of nothing but numbers that are the same everywhere has no length.
            numbers = AnisoMap::constant(Size::new(1, 1)?, base.wrap(), same);
        }
        let as_it_is =
            matches!(form.shape, Shape::Constant(_)) || form.master() == Some(Depth::F32);
        if as_it_is {
            return Ok(Self {
                form,
                same,
                numbers: None,
                map: numbers,
            });
        }
        form.channels = ranged(form, &numbers);
        let mut map = match form.master() {
            Some(_) => halved(&numbers)?,
            None => stored(form, &numbers),
        };
        if let Shape::Radial(radius, _) = form.shape {
            map = radius.disc(aspect).lay(&map, full.size(), full.wrap());
        }
        Ok(Self {
            form,
            same,
            numbers: Some(numbers),
            map,
        })
    }

    /// The numbers before they were stored, of the shape's own size.
    pub(super) fn numbers(&self) -> &AnisoMap {
        self.numbers.as_ref().unwrap_or(&self.map)
    }
}

/// The form's channels with integers over just the widths that there are.
fn ranged(form: Form, numbers: &AnisoMap) -> Channels {
    let own = |storage: WidthStorage, plane: &[f32]| match storage.depth.top() {
        None => storage,
        Some(_) => {
            let (low, high) = range(plane);
            storage.over(low, high)
        }
    };
    Channels {
        x: own(form.channels.x, numbers.alpha_x()),
        y: own(form.channels.y, numbers.alpha_y()),
        ..form.channels
    }
}

/// What a reader gets of numbers that are stored channel by channel.
fn stored(form: Form, numbers: &AnisoMap) -> AnisoMap {
    let Channels { x, y, axis } = form.channels;
    let mut map = numbers.clone();
    let region = map.region_mut();
    if form.widths.keep_x() {
        x.unpack(&x.pack(numbers.alpha_x()), region.alpha_x);
    }
    if form.widths.keep_y() {
        y.unpack(&y.pack(numbers.alpha_y()), region.alpha_y);
    }
    if form.widths == Widths::Round {
        region.alpha_y.copy_from_slice(region.alpha_x);
    }
    if form.axes == Axes::Each {
        let codes = axis.pack(numbers.cos2(), numbers.sin2());
        axis.unpack(&codes, region.cos2, region.sin2);
    }
    map
}

/// The map as a master file of halves gives it back.
fn halved(map: &AnisoMap) -> Result<AnisoMap> {
    let half = |plane: &[f32]| {
        plane
            .iter()
            .map(|x| half::f16::from_f32(*x).to_f32())
            .collect()
    };
    let planes = [map.alpha_x(), map.alpha_y(), map.cos2(), map.sin2()].map(half);
    Ok(AnisoMap::from_planes(map.size(), map.wrap(), planes)?.0)
}

/// Puts one value where the form keeps only one.
fn leave_out(map: &mut AnisoMap, form: Form, rounding: Rounding, same: Texel) {
    let region = map.region_mut();
    match form.widths {
        Widths::Each => {}
        Widths::Round => {
            for (x, y) in region.alpha_x.iter_mut().zip(region.alpha_y.iter_mut()) {
                let alpha = rounding.width(*x, *y);
                (*x, *y) = (alpha, alpha);
            }
        }
        Widths::X => region.alpha_y.fill(same.alpha_y),
        Widths::Y => region.alpha_x.fill(same.alpha_x),
        Widths::Same => {
            region.alpha_x.fill(same.alpha_x);
            region.alpha_y.fill(same.alpha_y);
        }
    }
    if form.axes == Axes::Same {
        region.cos2.fill(same.axis.cos2);
        region.sin2.fill(same.axis.sin2);
    }
}

/// The smallest and the largest of a plane of widths.
fn range(plane: &[f32]) -> (f32, f32) {
    let all = || plane.iter().copied();
    (
        all().fold(f32::INFINITY, f32::min),
        all().fold(0.0, f32::max),
    )
}

/// The texel that stands for all of them where numbers are left out: the geometric means of the widths, and the mean axis,
/// each texel counted by how far it is from round. Its numbers are short ones, since they will stand in a recipe.
pub(super) fn typical(map: &AnisoMap) -> Texel {
    let sums = Sums::of(map);
    short(Texel {
        alpha_x: (sums.ln_x / sums.count).exp() as f32,
        alpha_y: (sums.ln_y / sums.count).exp() as f32,
        axis: sums.mean_axis(),
    })
}

/// The mean lobe of the whole map.
pub(super) fn mean_lobe(map: &AnisoMap) -> Texel {
    let sums = Sums::of(map);
    let [uu, uv, vv] = sums.covariance.map(|s| (s / sums.count) as f32);
    let lobe = SlopeCovariance { uu, uv, vv };
    short(lobe.to_texel(sums.ln_x > sums.ln_y, sums.mean_axis()))
}

/// Sums over a map in f64, since a map has millions of texels.
#[derive(Default)]
struct Sums {
    count: f64,
    ln_x: f64,
    ln_y: f64,
    axis: DVec2,
    covariance: [f64; 3],
}

impl Sums {
    fn of(map: &AnisoMap) -> Self {
        let parts = by_stretches(map.size().texels(), |stretch| {
            let mut part = Self::default();
            stretch.for_each(|i| part.add(map.texel_at(i)));
            part
        });
        parts.into_iter().fold(Self::default(), Self::merged)
    }

    fn add(&mut self, texel: Texel) {
        let lobe = SlopeCovariance::from(texel);
        // A little for round texels too, so that a map of nothing else has an axis.
        let weight = f64::from((texel.alpha_x - texel.alpha_y).abs()) + 1e-6;
        self.count += 1.0;
        self.ln_x += f64::from(texel.alpha_x).ln();
        self.ln_y += f64::from(texel.alpha_y).ln();
        self.axis += texel.axis.double_angle().as_dvec2() * weight;
        let covariance = [lobe.uu, lobe.uv, lobe.vv];
        for (sum, part) in self.covariance.iter_mut().zip(covariance) {
            *sum += f64::from(part);
        }
    }

    fn merged(self, later: Self) -> Self {
        let ([a, b, c], [d, e, f]) = (self.covariance, later.covariance);
        Self {
            count: self.count + later.count,
            ln_x: self.ln_x + later.ln_x,
            ln_y: self.ln_y + later.ln_y,
            axis: self.axis + later.axis,
            covariance: [a + d, b + e, c + f],
        }
    }

    fn mean_axis(&self) -> Axis {
        Axis::from_double_angle(self.axis.normalize_or_zero().as_vec2()).unwrap_or_default()
    }
}

/// Widths of five digits and an angle of hundredths of a degree: what a recipe holds as a number.
fn short(texel: Texel) -> Texel {
    let width = |alpha: f32| round(alpha).clamp(crate::map::ALPHA_MIN, crate::map::ALPHA_MAX);
    Texel {
        alpha_x: width(texel.alpha_x),
        alpha_y: width(texel.alpha_y),
        axis: Axis::from_degrees(round_degrees(texel.axis)),
    }
}

/// The axis as a recipe says it.
pub(super) fn round_degrees(axis: Axis) -> f32 {
    let degrees = (axis.degrees() * 100.0).round() / 100.0;
    if degrees >= 180.0 { 0.0 } else { degrees }
}

/// A radial shape around a centre, reaching to the map's farthest corner.
pub(super) fn radial(center: Vec2, aspect: f32, samples: u32) -> Shape {
    let disc = Disc::around(center, aspect);
    let radius = Radius {
        center: center.into(),
        reach: round(disc.reach),
    };
    Shape::Radial(radius, samples)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::map::{DEFAULT_TEXEL, Wrap};

    fn map() -> AnisoMap {
        let size = Size::new(8, 4).unwrap();
        let mut map = AnisoMap::constant(size, Wrap::Repeat, DEFAULT_TEXEL);
        for i in 0..32 {
            let texel = Texel {
                alpha_x: 0.05 + 0.01 * i as f32,
                alpha_y: 0.4,
                axis: Axis::from_degrees(40.0 + i as f32),
            };
            map.region_mut().set(i, texel);
        }
        map
    }

    fn kept(form: Form) -> Kept {
        let map = map();
        Kept::new(&map, form, Rounding::Peak, (&map, 2.0), typical(&map)).unwrap()
    }

    fn grid() -> Shape {
        Shape::Grid(Size::new(8, 4).unwrap())
    }

    const ALL_U8: [Depth; 3] = [Depth::U8; 3];

    fn form(widths: Widths, axes: Axes, [x, y, axis]: [Depth; 3]) -> Form {
        Form::new(grid(), widths, axes, Channels::new(x, y, axis))
    }

    #[test]
    fn bytes_are_those_of_what_is_kept() {
        let full = Form::full(grid());
        assert_eq!((full.bytes(), full.master()), (32 * 16, Some(Depth::F32)));
        for (form, bytes, told) in [
            (form(Widths::Each, Axes::Each, ALL_U8), 4, "u8-log"),
            (
                form(Widths::Round, Axes::Same, ALL_U8),
                1,
                "isotropic, u8-log",
            ),
            (
                form(Widths::Same, Axes::Each, ALL_U8),
                2,
                "constant widths, u8-double",
            ),
            (
                form(Widths::Each, Axes::Each, [Depth::U16, Depth::U8, Depth::U8]),
                5,
                "alpha_x u16-log, alpha_y u8-log, axis u8-double",
            ),
            (
                form(Widths::X, Axes::Same, [Depth::F32, Depth::U8, Depth::U8]),
                4,
                "constant alpha_y, one direction, f32",
            ),
            (
                form(Widths::Y, Axes::Each, [Depth::U8, Depth::U16, Depth::U8]),
                4,
                "constant alpha_x, u16-log/u8-double",
            ),
        ] {
            assert_eq!(form.bytes(), 32 * bytes, "{form}");
            assert_eq!(form.to_string(), format!("map 8x4, {told}"));
            assert_eq!(form.master(), None, "{form}");
        }
        assert_eq!(Form::full(Shape::Constant(DEFAULT_TEXEL)).bytes(), 0);
    }

    #[test]
    fn what_is_not_stored_tells_no_forms_apart() {
        let [fine, coarse] = [[Depth::U8, Depth::U16, Depth::F32], ALL_U8];
        let same = |widths, axes| form(widths, axes, fine) == form(widths, axes, coarse);
        assert!(same(Widths::X, Axes::Same) && same(Widths::Round, Axes::Same));
        assert!(!same(Widths::Y, Axes::Same) && !same(Widths::X, Axes::Each));
    }

    #[test]
    fn what_is_left_out_is_the_same_everywhere_and_the_rest_is_kept() {
        let fine = [Depth::U16; 3];
        let one = kept(form(Widths::Each, Axes::Same, fine));
        assert!(one.map.cos2().iter().all(|c| *c == one.same.axis.cos2));
        assert!((one.map.texel_at(9).alpha_x / map().texel_at(9).alpha_x - 1.0).abs() < 1e-3);
        let same = kept(form(Widths::Same, Axes::Each, fine));
        assert!(same.map.alpha_x().iter().all(|a| *a == same.same.alpha_x));
        assert!(same.map.texel_at(3).axis.angle_to(map().texel_at(3).axis) < 1e-3);
        let round = kept(form(Widths::Round, Axes::Same, fine));
        assert_eq!(round.map.alpha_x(), round.map.alpha_y());
        let x = kept(form(Widths::X, Axes::Each, fine));
        assert!(x.map.alpha_y().iter().all(|a| *a == x.same.alpha_y));
        assert!((x.map.texel_at(9).alpha_x / map().texel_at(9).alpha_x - 1.0).abs() < 1e-4);
        assert_eq!(kept(Form::full(grid())).map, map());
    }

    #[test]
    fn each_channel_has_bits_and_a_range_of_its_own() {
        let kept = kept(form(
            Widths::Each,
            Axes::Each,
            [Depth::U8, Depth::F32, Depth::F16],
        ));
        let Channels { x, y, .. } = kept.form.channels;
        assert_eq!((x.low, y.depth), (0.05, Depth::F32));
        assert!((x.high - 0.36).abs() < 1e-6, "{x:?}");
        let (was, is) = (map(), &kept.map);
        assert_eq!(was.alpha_y(), is.alpha_y());
        for i in 0..32 {
            let (was, is) = (was.texel_at(i), is.texel_at(i));
            let off = (is.alpha_x / was.alpha_x - 1.0).abs();
            assert!(off <= x.relative_error(was.alpha_x) + 1e-6, "{i}: {off}");
            assert!(was.axis.angle_to(is.axis) <= kept.form.channels.axis.angle_error() + 1e-6);
        }
    }
}
