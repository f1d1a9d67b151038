//! What the first start shows: the pot of the presets in copper, with a braid and turned spots brushed into its wall, made as a
//! user would make them.

use crate::error::Result;
use crate::paint::{Brush, Groove, Point, Stroke, Strokes, Tool};
use crate::recipe::{Layer, Material, Recipe, RecipeFile, Source, preset};
use glam::Vec2;
use std::f32::consts::{PI, TAU};
use std::sync::Arc;

/// How high the middle of the outer wall lies in the pot's layout, UV.
const WALL: f32 = 0.856;
/// Waves of the braid around the pot, and how high they go, UV: nowhere so bent that the strand's inner rim has no direction.
const WAVES: u32 = 8;
const AMPLITUDE: f32 = 0.03;
/// Half of what a crossing takes of a wave: the strand that goes over is drawn again so far.
const CROSSING: f32 = 0.13;
/// Turned spots in a row around the pot, how far their rows are from the braid's middle, and the rings of each, UV.
const SPOTS: u32 = 28;
const ROW: f32 = 0.077;
const RINGS: [f32; 4] = [0.002, 0.007, 0.012, 0.017];

/// Copper, warm and a little worn.
const COPPER: Material = Material {
    diffuse: [0.085, 0.040, 0.024],
    specular: [0.50, 0.30, 0.20],
    ambient: [0.06, 0.03, 0.02],
};
/// Toward the lamps: around the front, so that some of every groove's directions gleam, and one from behind.
const LAMPS: [[f32; 3]; 6] = [
    [-0.5, 0.45, 0.8],
    [0.75, 0.3, 0.6],
    [0.1, 0.9, 0.3],
    [-1.0, 0.2, 0.1],
    [0.3, 0.6, -0.7],
    [0.15, 0.1, 1.0],
];

/// What the first scene says of itself.
pub(super) const WELCOME: &str = "A copper pot with painted strokes: paint over it, or begin anew";

/// The scene of the first start, as a document without a file.
///
/// # Errors
/// None: a test makes it.
pub fn welcome() -> Result<RecipeFile> {
    let mut recipe = preset("pot")?.recipe()?.recipe().clone();
    recipe.name = "welcome".to_owned();
    recipe.description = WELCOME.to_owned();
    recipe.material = COPPER;
    recipe.scene.lights = LAMPS.to_vec();
    recipe.scene.exposure = -0.3;
    let spots = layer("spots", spots(&recipe)?);
    let braid = layer("braid", braid()?);
    recipe.layers.extend([spots, braid]);
    RecipeFile::new(recipe, "welcome.toml")
}

fn layer(name: &str, strokes: Vec<Arc<Stroke>>) -> Layer {
    let source = Strokes {
        strokes,
        mesh: None,
    };
    Layer {
        name: name.to_owned(),
        ..Layer::new(Source::Strokes(source))
    }
}

/// Two strands around the wall, over and under each other.
fn braid() -> Result<Vec<Arc<Stroke>>> {
    let brush = grooves(0.42, 0.0125);
    // Highest and lowest at the cut of the layout: no strand's rim meets it.
    let strand = |phase: f32, u: f32| {
        let height = (TAU * WAVES as f32 * u + phase).cos();
        Vec2::new(u, WALL + AMPLITUDE * height)
    };
    let mut strokes = Vec::new();
    for phase in [0.0, PI] {
        // A little over both ends, or the strands would have caps at the cut of the layout.
        strokes.push(stroke(&brush, 1224, |t| strand(phase, 1.02 * t - 0.01))?);
    }
    // The first lies below the second everywhere: once a wave it comes up.
    let wave = 1.0 / WAVES as f32;
    for n in 0..WAVES {
        let from = (n as f32 + 0.75 - CROSSING) * wave;
        strokes.push(stroke(&brush, 60, |t| {
            strand(0.0, from + 2.0 * CROSSING * wave * t)
        })?);
    }
    Ok(strokes)
}

/// Two rows of spots as a turning tool leaves them: rings in rings.
fn spots(recipe: &Recipe) -> Result<Vec<Arc<Stroke>>> {
    let brush = grooves(0.36, 0.0035);
    let aspect = recipe.aspect_at(recipe.size);
    let mut strokes = Vec::new();
    for row in [WALL - ROW, WALL + ROW] {
        for n in 0..SPOTS {
            let centre = Vec2::new((n as f32 + 0.5) / SPOTS as f32, row);
            for radius in RINGS {
                strokes.push(stroke(&brush, 40, |t| {
                    let (sin, cos) = (TAU * t).sin_cos();
                    centre + Vec2::new(cos / aspect, sin) * radius
                })?);
            }
        }
    }
    Ok(strokes)
}

fn grooves(across: f32, radius: f32) -> Arc<Brush> {
    Arc::new(Brush {
        tool: Tool::Groove(Groove {
            along: 0.05,
            across,
        }),
        radius,
        hardness: 0.9,
        ..Brush::default()
    })
}

/// A stroke through points of a path that begins at 0 and ends at 1.
fn stroke(brush: &Arc<Brush>, points: u32, path: impl Fn(f32) -> Vec2) -> Result<Arc<Stroke>> {
    let on_path = (0..=points).filter_map(|i| Point::new(path(i as f32 / points as f32), 1.0));
    Ok(Arc::new(Stroke::new(brush.clone(), 0, on_path)?))
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

    #[test]
    fn lint_finds_no_seam_in_it() {
        let file = welcome().unwrap();
        let recipe = file.recipe();
        let none = Progress::none();
        let prepared = recipe.prepare(recipe.size, &file.files(false), &none);
        let map = prepared.unwrap().map(&none).unwrap();
        let pot = crate::mesh::builtin("pot").unwrap();
        let marks = crate::analyse::Marks::find(&map, Some(&pot), &none).unwrap();
        let worst = marks
            .seams
            .iter()
            .max_by(|a, b| a.degrees.total_cmp(&b.degrees));
        assert!(worst.is_none_or(|seam| seam.degrees < 2.0), "{worst:?}");
        assert!(marks.texels.is_empty());
    }

    #[test]
    fn the_braid_goes_on_over_the_cut_of_the_layout() {
        let file = welcome().unwrap();
        let size = crate::map::Size::new(1024, 512).unwrap();
        let none = Progress::none();
        let prepared = file.recipe().prepare(size, &file.files(false), &none);
        let map = prepared.unwrap().map(&none).unwrap();
        let (w, h) = (size.width() as usize, size.height() as usize);
        let braid = (WALL - AMPLITUDE - 0.02, WALL + AMPLITUDE + 0.02);
        let rows = ((1.0 - braid.1) * h as f32) as usize..((1.0 - braid.0) * h as f32) as usize;
        let turn = |y: usize, a: usize, b: usize| {
            let (a, b) = (y * w + a, y * w + b);
            let cos = map.cos2()[a] * map.cos2()[b] + map.sin2()[a] * map.sin2()[b];
            0.5 * cos.clamp(-1.0, 1.0).acos().to_degrees()
        };
        // As between the columns where the strands turn elsewhere.
        let most = |a: usize, b: usize| rows.clone().map(|y| turn(y, a, b)).fold(0.0, f32::max);
        let (here, there) = (most(w - 1, 0), most(w / 2 - 1, w / 2));
        assert!(
            here <= there + 1.0,
            "{here} degrees at the cut, {there} elsewhere"
        );
    }
}
