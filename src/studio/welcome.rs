//! What the first start shows: the brushed pot of the presets with strokes over it, made as a user would make them.

use crate::error::Result;
use crate::paint::{Brush, Groove, Point, Stroke, Strokes, Tool};
use crate::recipe::{Layer, RecipeFile, Source, preset};
use glam::Vec2;
use std::f32::consts::TAU;
use std::sync::Arc;

/// Where the front of the pot's wall is in its layout, and half of what is painted there, UV units.
const FRONT: Vec2 = Vec2::new(0.5, 0.856);
const HALF: Vec2 = Vec2::new(0.19, 0.085);
/// Ribbons over each other.
const RIBBONS: u32 = 4;
/// Points of a ribbon.
const POINTS: u32 = 64;

/// The scene of the first start, as a document without a file.
///
/// # Errors
/// None: a test makes it.
pub fn welcome() -> Result<RecipeFile> {
    let mut recipe = preset("pot")?.recipe()?.recipe().clone();
    recipe.name = "welcome".to_owned();
    recipe.description =
        "A brushed pot with painted ribbons: paint over it, or begin anew".to_owned();
    let mut strokes = Strokes::default();
    for n in 0..RIBBONS {
        strokes.strokes.push(Arc::new(ribbon(n)?));
    }
    recipe.layers.push(Layer {
        name: "ribbons".to_owned(),
        ..Layer::new(Source::Strokes(strokes))
    });
    RecipeFile::new(recipe, "welcome.toml")
}

/// A wave around the front of the pot.
fn ribbon(n: u32) -> Result<Stroke> {
    let brush = Brush {
        tool: Tool::Groove(Groove {
            along: 0.06,
            across: 0.5,
        }),
        radius: 0.016,
        hardness: 0.7,
        ..Brush::default()
    };
    let height = (n as f32 + 0.5) / RIBBONS as f32 * 2.0 - 1.0;
    let points = (0..=POINTS).filter_map(|i| {
        let t = i as f32 / POINTS as f32;
        let wave = (TAU * (1.5 * t + 0.08 * n as f32)).sin();
        let at = Vec2::new(2.0 * t - 1.0, 0.8 * height + 0.25 * wave) * HALF + FRONT;
        Point::new(at, 1.0)
    });
    Stroke::new(Arc::new(brush), n, points)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::progress::Progress;

    #[test]
    fn the_first_scene_is_a_recipe_that_makes_a_map() {
        let file = welcome().unwrap();
        let recipe = file.recipe();
        recipe.check().unwrap();
        let size = crate::map::Size::new(128, 128).unwrap();
        let none = Progress::none();
        let with = recipe
            .prepare(size, &file.files(false), &none)
            .unwrap()
            .map(&none)
            .unwrap();
        let plain = preset("pot").unwrap().recipe().unwrap();
        let without = plain
            .recipe()
            .prepare(size, &plain.files(false), &none)
            .unwrap()
            .map(&none)
            .unwrap();
        assert_ne!(with.cos2(), without.cos2());
    }
}
