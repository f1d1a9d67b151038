//! What is kept of a map: how its texels lie, which of their numbers change from texel to texel, and how those are stored.

use super::files::round;
use crate::analyse::by_stretches;
use crate::convention::storage::{
    AxisEncoding, AxisStorage, Codes, Depth, Storage, WidthEncoding, WidthStorage,
};
use crate::error::Result;
use crate::filter::{Disc, reduce};
use crate::map::{AnisoMap, Size, SlopeCovariance, Texel, Wrap};
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
    /// Neither.
    Same,
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

/// What is kept.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Form {
    /// How the texels lie.
    pub shape: Shape,
    /// What is kept of their widths.
    pub widths: Widths,
    /// What is kept of their axes.
    pub axes: Axes,
    /// How it is stored.
    pub storage: Storage,
}

impl Form {
    /// Every number of a shape, to the bit.
    pub(super) fn full(shape: Shape) -> Self {
        Self {
            shape,
            widths: Widths::Each,
            axes: Axes::Each,
            storage: Storage::FULL,
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
        let widths = match self.widths {
            Widths::Each => 2,
            Widths::Round => 1,
            Widths::Same => 0,
        };
        let axes = match self.axes {
            Axes::Each => self.storage.axis.encoding.numbers(),
            Axes::Same => 0,
        };
        (widths * self.storage.widths.depth.bytes() + axes * self.storage.axis.depth.bytes()) as u64
    }

    /// Bytes of the whole in memory, not compressed.
    pub fn bytes(&self) -> u64 {
        self.texels() * self.bytes_per_texel()
    }

    /// Whether the numbers are stored as whole codes, so that they may leave some out; floats are whole maps.
    pub(super) fn is_coded(&self) -> bool {
        self.storage.widths.depth.top().is_some()
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
            Shape::Radial(_, samples) => write!(f, " of {samples}")?,
            Shape::Grid(size) => write!(f, " {size}")?,
        }
        match self.widths {
            Widths::Each => {}
            Widths::Round => f.write_str(", isotropic")?,
            Widths::Same => f.write_str(", constant widths")?,
        }
        if self.axes == Axes::Same && self.widths != Widths::Round {
            f.write_str(", one direction")?;
        }
        match (self.widths, self.axes) {
            (Widths::Same, Axes::Each) => write!(f, ", {}", self.storage.axis),
            (_, Axes::Same) => write!(f, ", {}", self.storage.widths),
            _ => write!(f, ", {}", self.storage),
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
    /// The codes of the widths, where they are stored: one or two of each texel.
    pub(super) widths: Option<(usize, Codes)>,
    /// The codes of the axes.
    pub(super) axes: Option<Codes>,
    /// What stands for numbers that are the same everywhere.
    pub(super) same: Texel,
    /// The map before it was rounded to halves, where it is: the file rounds it by itself.
    pub(super) unrounded: Option<AnisoMap>,
    /// What is drawn and exported.
    pub(super) map: AnisoMap,
}

impl Kept {
    /// Leaves out of a shape's texels what the form leaves out. `full` is the size that a radial table is laid out at.
    pub(super) fn new(
        base: &AnisoMap,
        mut form: Form,
        aspect: f32,
        full: (Size, Wrap),
    ) -> Result<Self> {
        let same = match form.shape {
            Shape::Constant(texel) => texel,
            _ => typical(base),
        };
        let mut kept = Self {
            form,
            widths: None,
            axes: None,
            unrounded: None,
            same,
            map: base.clone(),
        };
        if matches!(form.shape, Shape::Constant(_)) || form.storage == Storage::FULL {
            leave_out(&mut kept.map, form, same);
        } else if form.is_coded() {
            leave_out(&mut kept.map, form, same);
            let (low, high) = range(&kept.map);
            form.storage.widths = form.storage.widths.over(low, high);
            kept.form = form;
            kept.store()?;
        } else {
            kept.map = halved(base)?;
            kept.unrounded = Some(base.clone());
        }
        if let Shape::Radial(radius, _) = form.shape {
            let (size, wrap) = full;
            kept.map = radius.disc(aspect).lay(&kept.map, size, wrap);
        }
        Ok(kept)
    }

    /// Makes codes of the map, and the map that they give back.
    fn store(&mut self) -> Result<()> {
        let Form {
            widths,
            axes,
            storage,
            ..
        } = self.form;
        let packed = storage.pack(&self.map);
        let mut map = packed.unpack(self.map.size(), self.map.wrap())?;
        let region = map.region_mut();
        match widths {
            Widths::Each => self.widths = Some((2, packed.widths)),
            Widths::Round => self.widths = Some((1, every_second(packed.widths))),
            Widths::Same => {
                region.alpha_x.fill(self.same.alpha_x);
                region.alpha_y.fill(self.same.alpha_y);
            }
        }
        match axes {
            Axes::Each => self.axes = Some(packed.axis),
            Axes::Same => {
                region.cos2.fill(self.same.axis.cos2);
                region.sin2.fill(self.same.axis.sin2);
            }
        }
        self.map = map;
        Ok(())
    }
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
fn leave_out(map: &mut AnisoMap, form: Form, same: Texel) {
    let region = map.region_mut();
    match form.widths {
        Widths::Each => {}
        Widths::Round => {
            for (x, y) in region.alpha_x.iter_mut().zip(region.alpha_y.iter_mut()) {
                // The same peak; sqrt of a square may be an ulp above the largest width.
                let alpha = (*x * *y).sqrt().min(crate::map::ALPHA_MAX);
                (*x, *y) = (alpha, alpha);
            }
        }
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

fn every_second(codes: Codes) -> Codes {
    match codes {
        Codes::U8(v) => Codes::U8(v.into_iter().step_by(2).collect()),
        Codes::U16(v) => Codes::U16(v.into_iter().step_by(2).collect()),
        Codes::F16(v) => Codes::F16(v.into_iter().step_by(2).collect()),
        Codes::F32(v) => Codes::F32(v.into_iter().step_by(2).collect()),
    }
}

/// The smallest and the largest width.
fn range(map: &AnisoMap) -> (f32, f32) {
    let all = || map.alpha_x().iter().chain(map.alpha_y()).copied();
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

/// The storages of whole codes that are tried, and halves: widths in steps of their logarithm over just the range there is, the
/// axis as a double angle, so that whoever reads the files may filter them.
pub(super) fn storages() -> Vec<Storage> {
    let coded = |widths, axis| Storage {
        widths: WidthStorage::new(widths, WidthEncoding::Log),
        axis: AxisStorage::new(axis, AxisEncoding::Double),
    };
    vec![
        coded(Depth::U8, Depth::U8),
        coded(Depth::U16, Depth::U8),
        coded(Depth::U8, Depth::U16),
        Storage::new(Depth::F16, WidthEncoding::Linear),
        coded(Depth::U16, Depth::U16),
    ]
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
    use crate::map::DEFAULT_TEXEL;

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
        Kept::new(&map, form, 2.0, (map.size(), map.wrap())).unwrap()
    }

    #[test]
    fn bytes_are_those_of_what_is_kept() {
        let form = Form {
            storage: storages()[0],
            ..Form::full(Shape::Grid(Size::new(8, 4).unwrap()))
        };
        assert_eq!(
            (form.bytes(), Form::full(form.shape).bytes()),
            (32 * 4, 32 * 16)
        );
        let round = Form {
            widths: Widths::Round,
            axes: Axes::Same,
            ..form
        };
        assert_eq!(round.bytes(), 32);
        assert_eq!(Form::full(Shape::Constant(DEFAULT_TEXEL)).bytes(), 0);
        assert_eq!(round.to_string(), "map 8x4, isotropic, u8-log");
    }

    #[test]
    fn what_is_left_out_is_the_same_everywhere_and_the_rest_is_kept() {
        let shape = Shape::Grid(Size::new(8, 4).unwrap());
        let form = Form {
            storage: storages()[4],
            ..Form::full(shape)
        };
        let one = kept(Form {
            axes: Axes::Same,
            ..form
        });
        assert!(one.axes.is_none() && one.widths.as_ref().unwrap().0 == 2);
        assert!(one.map.cos2().iter().all(|c| *c == one.same.axis.cos2));
        assert!((one.map.texel_at(9).alpha_x / map().texel_at(9).alpha_x - 1.0).abs() < 1e-3);
        let same = kept(Form {
            widths: Widths::Same,
            ..form
        });
        assert!(same.widths.is_none());
        assert!(same.map.texel_at(3).axis.angle_to(map().texel_at(3).axis) < 1e-3);
        let round = kept(Form {
            widths: Widths::Round,
            axes: Axes::Same,
            ..form
        });
        assert_eq!(round.widths.as_ref().unwrap().1.len(), 32);
        assert_eq!(round.map.alpha_x(), round.map.alpha_y());
        assert_eq!(kept(Form::full(shape)).map, map());
    }
}
