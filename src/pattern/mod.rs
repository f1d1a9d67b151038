//! Patterns: what a surface's finish looks like, one file each with its parameters, its meaning and its fill.
//!
//! A pattern works in **surface units**: the height of one turn of UV is 1, its width is the recipe's aspect. Positions
//! run from the lower left, x along +U, y up, so a circle is round on the surface and sizes do not change with the map's.
//! A pattern is prepared once for a surface and then filled rectangle by rectangle; every rectangle comes out exactly as
//! the whole would. Structure finer than a texel is not sampled: its mean goes into the alphas (as slope variance), so a
//! map of any size has the same lobes.

mod brushed;
mod constant;
mod grooves;
mod lattice;
mod pot;
mod radial;
mod scratches;
mod weave;

pub use brushed::Brushed;
pub use constant::Constant;
pub use grooves::Grooves;
pub use pot::{Pot, PotStyle, Turned};
pub use radial::{Radial, RadialStyle};
pub use scratches::Scratches;
pub use weave::{Thread, Weave, WeaveStyle};

pub(crate) use lattice::{hash, unit};

use crate::error::{Error, Result};
use crate::map::{RegionMut, Size, Wrap};
use glam::Vec2;
use serde::{Deserialize, Serialize};
use std::ops::RangeInclusive;

/// What a pattern is filled onto.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Surface {
    /// The whole map's size.
    pub size: Size,
    /// Width over height of one turn of UV on the surface.
    pub aspect: f32,
    /// What lies beyond the edge; patterns that can be are seamless where it repeats.
    pub wrap: Wrap,
    /// The only source of randomness.
    pub seed: u64,
}

impl Surface {
    /// Width and height of one turn of UV, in surface units: (aspect, 1).
    pub fn extent(&self) -> Vec2 {
        Vec2::new(self.aspect, 1.0)
    }

    /// Width and height of a texel, in surface units.
    pub fn texel(&self) -> Vec2 {
        self.extent() / Vec2::new(self.size.width() as f32, self.size.height() as f32)
    }

    /// The centre of the texel at column `x`, row `y`, in surface units.
    pub fn position(&self, x: u32, y: u32) -> Vec2 {
        let (w, h) = (self.size.width() as f32, self.size.height() as f32);
        Vec2::new((x as f32 + 0.5) / w, 1.0 - (y as f32 + 0.5) / h) * self.extent()
    }
}

/// A rectangle of one layer, to be filled.
#[derive(Debug)]
pub struct Patch<'a> {
    /// The texels.
    pub region: RegionMut<'a>,
    /// How much of each texel the layer covers, 0 to 1, row order.
    pub coverage: &'a mut [f32],
    /// The pattern's own value, 0 to 1, row order: what a mask made of the pattern reads.
    pub value: &'a mut [f32],
}

/// A pattern prepared for one surface.
pub trait Fill: Send + Sync {
    /// Fills the whole patch: texels, coverage and value. Pure: the same rectangle gives the same numbers however the map is cut.
    fn fill(&self, patch: &mut Patch<'_>);
}

/// One parameter of a pattern, as tables, messages and panels show it.
#[derive(Clone, Debug, PartialEq)]
pub struct Parameter {
    /// Its key in the recipe; `warp.alpha_along` for one inside a table.
    pub key: &'static str,
    /// Its unit: `degrees`, `surface units`, `slope width`, or empty for a plain number.
    pub unit: &'static str,
    /// What is allowed.
    pub range: RangeInclusive<f64>,
    /// What it does, as a clause.
    pub doc: &'static str,
}

impl Parameter {
    pub(crate) const fn new(
        key: &'static str,
        unit: &'static str,
        range: RangeInclusive<f64>,
        doc: &'static str,
    ) -> Self {
        Self {
            key,
            unit,
            range,
            doc,
        }
    }

    /// A slope width.
    pub(crate) const fn alpha(key: &'static str, doc: &'static str) -> Self {
        Self::new(key, "slope width", 1e-3..=1.5, doc)
    }

    /// An angle, counter-clockwise from +U.
    pub(crate) const fn angle(key: &'static str, doc: &'static str) -> Self {
        Self::new(key, "degrees", -360.0..=360.0, doc)
    }

    /// A part of one.
    pub(crate) const fn fraction(key: &'static str, doc: &'static str) -> Self {
        Self::new(key, "", 0.0..=1.0, doc)
    }
}

/// Every pattern that a layer or a mask can hold; the variant's name is the name of its table in a recipe.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Pattern {
    /// One texel everywhere.
    Constant(Constant),
    /// Straight brushing.
    Brushed(Brushed),
    /// Rings, spokes or a spiral.
    Radial(Radial),
    /// The pot mesh's own finish.
    Pot(Pot),
    /// Single strokes.
    Scratches(Scratches),
    /// Woven cloth.
    Weave(Weave),
}

impl Pattern {
    /// The names, as recipes write them.
    pub const NAMES: [&str; 6] = ["constant", "brushed", "radial", "pot", "scratches", "weave"];

    /// The name of its table in a recipe.
    pub fn name(&self) -> &'static str {
        match self {
            Self::Constant(_) => "constant",
            Self::Brushed(_) => "brushed",
            Self::Radial(_) => "radial",
            Self::Pot(_) => "pot",
            Self::Scratches(_) => "scratches",
            Self::Weave(_) => "weave",
        }
    }

    /// Its numeric parameters with units and ranges.
    pub fn parameters(&self) -> &'static [Parameter] {
        match self {
            Self::Constant(_) => Constant::PARAMETERS,
            Self::Brushed(_) => Brushed::PARAMETERS,
            Self::Radial(_) => Radial::PARAMETERS,
            Self::Pot(_) => Pot::PARAMETERS,
            Self::Scratches(_) => Scratches::PARAMETERS,
            Self::Weave(_) => Weave::PARAMETERS,
        }
    }

    /// Checks every parameter against its range.
    ///
    /// # Errors
    /// [`Error::Invalid`] whose `what` is the key inside the pattern's table.
    pub fn validate(&self) -> Result<()> {
        match self {
            Self::Constant(p) => check(p, Constant::PARAMETERS),
            Self::Brushed(p) => check(p, Brushed::PARAMETERS),
            Self::Radial(p) => check(p, Radial::PARAMETERS),
            Self::Pot(p) => check(p, Pot::PARAMETERS),
            Self::Scratches(p) => check(p, Scratches::PARAMETERS),
            Self::Weave(p) => check(p, Weave::PARAMETERS),
        }
    }

    /// Does once what needs the whole.
    ///
    /// # Errors
    /// When a parameter is out of range, or scratches would cover too many texels.
    pub fn prepare(&self, surface: &Surface) -> Result<Box<dyn Fill>> {
        self.validate()?;
        Ok(match self {
            Self::Constant(p) => Box::new(p.prepare(surface)),
            Self::Brushed(p) => Box::new(p.prepare(surface)),
            Self::Radial(p) => Box::new(p.prepare(surface)),
            Self::Pot(p) => Box::new(p.prepare(surface)),
            Self::Scratches(p) => Box::new(p.prepare(surface)?),
            Self::Weave(p) => Box::new(p.prepare(surface)),
        })
    }
}

/// Holds every number of `pattern` against the table of its parameters.
pub(crate) fn check(pattern: &impl Serialize, parameters: &[Parameter]) -> Result<()> {
    let table = toml::Value::try_from(pattern).expect("a pattern is plain data");
    parameters.iter().try_for_each(|p| {
        match p.key.split('.').try_fold(&table, |t, key| t.get(key)) {
            Some(value) => check_value(value, p),
            None => Ok(()), // an optional parameter that is not given
        }
    })
}

fn check_value(value: &toml::Value, parameter: &Parameter) -> Result<()> {
    let number = match value {
        toml::Value::Integer(i) => *i as f64,
        toml::Value::Float(f) => *f,
        toml::Value::Array(items) => {
            return items
                .iter()
                .try_for_each(|item| check_value(item, parameter));
        }
        _ => return Ok(()), // words are checked by their own types
    };
    // Parameters are f32: what they are held against is rounded the same way.
    let (least, most) = (
        *parameter.range.start() as f32,
        *parameter.range.end() as f32,
    );
    if (least..=most).contains(&(number as f32)) {
        return Ok(());
    }
    let (low, high) = (parameter.range.start(), parameter.range.end());
    let unit = if parameter.unit.is_empty() {
        String::new()
    } else {
        format!(" ({})", parameter.unit)
    };
    // f32 parameters become f64 on the way: show them as they were written.
    Err(Error::invalid(
        parameter.key,
        number as f32,
        format!("allowed: {low} to {high}{unit}"),
    ))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::map::{AnisoMap, DEFAULT_TEXEL, Mended, Region, SlopeCovariance, Texel};

    #[test]
    fn every_parameter_of_every_pattern_exists_and_its_default_is_allowed() {
        for pattern in all() {
            pattern.validate().unwrap();
            let toml::Value::Table(outer) = toml::Value::try_from(&pattern).unwrap() else {
                panic!()
            };
            let table = &outer[pattern.name()];
            for p in pattern.parameters() {
                assert!(
                    p.key.split('.').try_fold(table, |t, k| t.get(k)).is_some(),
                    "{}: no parameter {}",
                    pattern.name(),
                    p.key
                );
                assert!(!p.doc.is_empty());
            }
        }
    }

    #[test]
    fn both_ends_of_every_range_are_allowed_and_what_lies_beyond_is_not() {
        for pattern in all() {
            for p in pattern.parameters() {
                let with = |number: f64| {
                    let toml::Value::Table(mut outer) = toml::Value::try_from(&pattern).unwrap()
                    else {
                        panic!()
                    };
                    let mut place = outer.get_mut(pattern.name()).unwrap();
                    for key in p.key.split('.') {
                        place = place.get_mut(key).unwrap();
                    }
                    *place = match place {
                        toml::Value::Integer(_) => toml::Value::Integer(number as i64),
                        toml::Value::Array(_) => {
                            toml::Value::Array(vec![number.into(), number.into()])
                        }
                        _ => toml::Value::Float(number),
                    };
                    toml::Value::Table(outer)
                        .try_into::<Pattern>()
                        .map(|p| p.validate().is_ok())
                };
                let (low, high) = (*p.range.start(), *p.range.end());
                assert_eq!(with(low), Ok(true), "{} {} = {low}", pattern.name(), p.key);
                assert_eq!(
                    with(high),
                    Ok(true),
                    "{} {} = {high}",
                    pattern.name(),
                    p.key
                );
                assert_ne!(
                    with(high * 1.01 + 1.0),
                    Ok(true),
                    "{} {}",
                    pattern.name(),
                    p.key
                );
                assert_ne!(with(low - 1.0), Ok(true), "{} {}", pattern.name(), p.key);
            }
        }
    }

    /// One of each pattern, with its defaults.
    pub(super) fn all() -> Vec<Pattern> {
        Pattern::NAMES
            .iter()
            .map(|name| toml::from_str(&format!("[{name}]")).unwrap())
            .collect()
    }

    /// The whole map, its coverage and its values, filled in pieces of `side` texels.
    pub(super) fn filled(
        pattern: &Pattern,
        surface: &Surface,
        side: u32,
    ) -> (AnisoMap, Vec<f32>, Vec<f32>) {
        let prepared = pattern.prepare(surface).unwrap();
        let whole = surface.size.rect();
        let mut map = AnisoMap::constant(surface.size, surface.wrap, DEFAULT_TEXEL);
        let (mut coverage, mut value) = (vec![0.0; whole.texels()], vec![0.0; whole.texels()]);
        for rect in whole.tiles(side) {
            let mut region = Region::constant(rect, DEFAULT_TEXEL);
            let (mut c, mut v) = (vec![f32::NAN; rect.texels()], vec![f32::NAN; rect.texels()]);
            prepared.fill(&mut Patch {
                region: region.view_mut(),
                coverage: &mut c,
                value: &mut v,
            });
            map.write_region(&region);
            for y in rect.y..rect.y + rect.height {
                let (to, from, n) = (
                    whole.index(rect.x, y),
                    rect.index(rect.x, y),
                    rect.width as usize,
                );
                coverage[to..to + n].copy_from_slice(&c[from..from + n]);
                value[to..to + n].copy_from_slice(&v[from..from + n]);
            }
        }
        (map, coverage, value)
    }

    fn surface(width: u32, height: u32, wrap: Wrap) -> Surface {
        Surface {
            size: Size::new(width, height).unwrap(),
            aspect: width as f32 / height as f32,
            wrap,
            seed: 5,
        }
    }

    #[test]
    fn pieces_equal_the_whole_and_stay_in_range() {
        for pattern in all() {
            for (width, height, wrap) in [
                (150, 130, Wrap::Repeat),
                (97, 64, Wrap::Clamp),
                (1, 1, Wrap::RepeatU),
            ] {
                let surface = surface(width, height, wrap);
                let whole = filled(&pattern, &surface, 4096);
                assert!(
                    whole == filled(&pattern, &surface, 64),
                    "{} {wrap:?}",
                    pattern.name()
                );
                let (map, coverage, value) = whole;
                assert!(
                    coverage
                        .iter()
                        .chain(&value)
                        .all(|x| (0.0..=1.0).contains(x)),
                    "{}",
                    pattern.name()
                );
                let planes =
                    [map.alpha_x(), map.alpha_y(), map.cos2(), map.sin2()].map(<[f32]>::to_vec);
                let (_, mended) = AnisoMap::from_planes(surface.size, wrap, planes).unwrap();
                assert_eq!(mended, Mended::default(), "{}", pattern.name());
            }
        }
    }

    #[test]
    fn another_seed_gives_another_map_and_the_same_seed_the_same() {
        for pattern in all()
            .into_iter()
            .filter(|p| !matches!(p, Pattern::Constant(_)))
        {
            let one = surface(128, 128, Wrap::Repeat);
            let a = filled(&pattern, &one, 4096);
            assert!(a == filled(&pattern, &one, 4096), "{}", pattern.name());
            assert!(
                a != filled(&pattern, &Surface { seed: 6, ..one }, 4096),
                "{}",
                pattern.name()
            );
        }
    }

    /// The error at the median and at the 95th percentile.
    fn median(mut errors: Vec<f32>) -> (f32, f32) {
        errors.sort_by(f32::total_cmp);
        (errors[errors.len() / 2], errors[errors.len() * 95 / 100])
    }

    #[test]
    fn a_large_map_filtered_down_is_the_small_map() {
        for pattern in all() {
            let (large, large_coverage, _) =
                filled(&pattern, &surface(2048, 2048, Wrap::Repeat), 4096);
            let (small, small_coverage, _) =
                filled(&pattern, &surface(512, 512, Wrap::Repeat), 4096);
            let (mut alpha, mut degrees) = (Vec::new(), Vec::new());
            for i in 0..512 * 512usize {
                let (x, y) = (i % 512 * 4, i / 512 * 4);
                let places = (0..16).map(|k| (y + k / 4) * 2048 + x + k % 4);
                let coverage: f32 = places.clone().map(|p| large_coverage[p]).sum::<f32>() / 16.0;
                assert!(
                    (coverage - small_coverage[i]).abs() < 0.35,
                    "{}: coverage at {i}",
                    pattern.name()
                );
                if coverage < 0.05 || small_coverage[i] < 0.05 {
                    continue;
                }
                let mut mean = SlopeCovariance::default();
                for p in places {
                    mean += SlopeCovariance::from(large.texel_at(p))
                        * (large_coverage[p] / (16.0 * coverage));
                }
                let got = small.texel_at(i);
                let want = mean.to_texel(got.alpha_x > got.alpha_y, got.axis);
                alpha.push(
                    (got.alpha_x / want.alpha_x - 1.0)
                        .abs()
                        .max((got.alpha_y / want.alpha_y - 1.0).abs()),
                );
                degrees.push(got.axis.angle_to(want.axis).to_degrees());
            }
            let ((alpha_median, alpha_95), (angle_median, angle_95)) =
                (median(alpha), median(degrees));
            println!(
                "{}: alpha {alpha_median} (95 %: {alpha_95}), angle {angle_median} (95 %: {angle_95})",
                pattern.name()
            );
            assert!(
                alpha_median < 0.05,
                "{}: alpha {alpha_median}",
                pattern.name()
            );
            assert!(
                angle_median < 2.0,
                "{}: angle {angle_median}",
                pattern.name()
            );
        }
    }

    #[test]
    fn nothing_shows_at_the_edges_of_a_surface_that_repeats() {
        for pattern in all() {
            let n = 256;
            let (map, ..) = filled(&pattern, &surface(n, n, Wrap::Repeat), 4096);
            if matches!(pattern, Pattern::Radial(_) | Pattern::Pot(_)) {
                continue; // a disc has a border, and a pot's islands have theirs
            }
            let step = |a: Texel, b: Texel| {
                f64::from((a.alpha_y / b.alpha_y).ln().abs() + a.axis.angle_to(b.axis))
            };
            let columns = |x: u32| {
                (0..n)
                    .map(|y| step(map.texel(x, y), map.texel((x + 1) % n, y)))
                    .sum::<f64>()
            };
            let rows = |y: u32| {
                (0..n)
                    .map(|x| step(map.texel(x, y), map.texel(x, (y + 1) % n)))
                    .sum::<f64>()
            };
            let worst = |f: &dyn Fn(u32) -> f64| (0..n - 1).map(f).fold(0.0, f64::max);
            assert!(
                columns(n - 1) <= 1.3 * worst(&columns) + 1e-3,
                "{}: seam along v",
                pattern.name()
            );
            assert!(
                rows(n - 1) <= 1.3 * worst(&rows) + 1e-3,
                "{}: seam along u",
                pattern.name()
            );
        }
    }
}
