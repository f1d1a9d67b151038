//! Patterns: what a surface's finish looks like, one file each with its parameters, its meaning and its fill.
//!
//! A pattern works in **surface units**: the height of one turn of UV is 1, its width is the recipe's aspect. Positions
//! run from the lower left, x along +U, y up, so a circle is round on the surface and sizes do not change with the map's.
//! A pattern is prepared once for a surface and then filled rectangle by rectangle; every rectangle comes out exactly as
//! the whole would. Structure finer than a texel is not sampled: its mean goes into the alphas (as slope variance), so a
//! map of any size has the same lobes.

mod constant;

pub use constant::Constant;

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
    const fn new(
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
    const fn alpha(key: &'static str, doc: &'static str) -> Self {
        Self::new(key, "slope width", 1e-3..=1.5, doc)
    }

    /// An angle, counter-clockwise from +U.
    const fn angle(key: &'static str, doc: &'static str) -> Self {
        Self::new(key, "degrees", -360.0..=360.0, doc)
    }

    /// A part of one.
    const fn fraction(key: &'static str, doc: &'static str) -> Self {
        Self::new(key, "", 0.0..=1.0, doc)
    }
}

/// Every pattern that a layer or a mask can hold; the variant's name is the name of its table in a recipe.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Pattern {
    /// One texel everywhere.
    Constant(Constant),
}

impl Pattern {
    /// The names, as recipes write them.
    pub const NAMES: [&str; 1] = ["constant"];

    /// The name of its table in a recipe.
    pub fn name(&self) -> &'static str {
        match self {
            Self::Constant(_) => "constant",
        }
    }

    /// Its numeric parameters with units and ranges.
    pub fn parameters(&self) -> &'static [Parameter] {
        match self {
            Self::Constant(_) => Constant::PARAMETERS,
        }
    }

    /// Checks every parameter against its range.
    ///
    /// # Errors
    /// [`Error::Invalid`] whose `what` is the key inside the pattern's table.
    pub fn validate(&self) -> Result<()> {
        match self {
            Self::Constant(p) => check(p, Constant::PARAMETERS),
        }
    }

    /// Does once what needs the whole.
    ///
    /// # Errors
    /// When a parameter is out of range.
    pub fn prepare(&self, surface: &Surface) -> Result<Box<dyn Fill>> {
        self.validate()?;
        Ok(match self {
            Self::Constant(p) => Box::new(p.prepare(surface)),
        })
    }
}

/// Holds every number of `pattern` against the table of its parameters.
fn check(pattern: &impl Serialize, parameters: &[Parameter]) -> Result<()> {
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
    if parameter.range.contains(&number) {
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

    /// One of each pattern, with its defaults.
    pub(super) fn all() -> Vec<Pattern> {
        Pattern::NAMES
            .iter()
            .map(|name| toml::from_str(&format!("[{name}]")).unwrap())
            .collect()
    }
}
