//! The studio without a window: what it shows is always what `generate` makes of its recipe.

use super::*;
use crate::map::Region;
use crate::paint::{Brush, Groove, POINTS_MAX, Point, Smooth, Tool};
use crate::pattern::Pattern;
use crate::recipe::{Channels, LAYERS_MAX, Layer, Mask, MaskSource, Source};
use glam::Vec2;
use std::path::Path;
use std::sync::mpsc::channel;

mod coverage;
mod files;

const RECIPE: &str = "version = 1\nname = 'painted'\nsize = [320, 200]\naspect = 1.6\nseed = 5\n\
    [[layers]] # the base\nname = 'steel'\n[layers.brushed]\nangle = 20\n\
    [[layers]]\nname = 'paint'\nopacity = 0.8\n[layers.strokes]\npacked = []\nbrushes = []\n\
    [[layers]]\nname = 'rings'\nopacity = 0.5\nmask.polygon = [[0, 0], [0.6, 0], [0.6, 1], [0, 1]]\n[layers.radial]\n";

fn studio_of(text: &str) -> Studio {
    let file = RecipeFile::parse(text, "painted.toml", None).unwrap();
    let mut studio = Studio::new(file, None, Options::default()).unwrap();
    studio.settle();
    assert!(studio.take_trouble().is_empty());
    studio
}

fn painted() -> Studio {
    let mut studio = studio_of(RECIPE);
    studio.select(1);
    studio
}

fn brush(tool: Tool, radius: f32) -> Arc<Brush> {
    Arc::new(Brush {
        tool,
        radius,
        ..Brush::default()
    })
}

fn stroke(studio: &mut Studio, brush: Arc<Brush>, points: &[[f32; 2]]) {
    studio.begin_stroke(brush, 7).unwrap();
    for p in points {
        studio.stroke_to(Point::new(Vec2::from(*p), 1.0).unwrap());
    }
    assert!(studio.end_stroke().unwrap());
}

fn some_strokes(studio: &mut Studio) {
    let groove = brush(Tool::Groove(Groove::default()), 0.06);
    stroke(
        studio,
        groove.clone(),
        &[[0.1, 0.2], [0.5, 0.4], [0.9, 0.1], [1.2, 0.3]],
    );
    stroke(studio, groove, &[[0.3, 0.9], [0.35, 0.5], [0.3, 0.1]]);
    let smooth = brush(Tool::Smooth(Smooth { reach: 0.02 }), 0.1);
    stroke(studio, smooth, &[[0.2, 0.2], [0.6, 0.5]]);
    let erase = brush(Tool::Erase, 0.05);
    stroke(studio, erase, &[[0.3, 0.6], [0.4, 0.3]]);
}

/// What `generate` makes of the document as it would be saved.
fn generated(studio: &Studio) -> AnisoMap {
    let text = studio.document().text().unwrap();
    let file = RecipeFile::parse(&text, "saved.toml", None).unwrap();
    let recipe = file.recipe();
    let prepared = recipe
        .prepare(recipe.size, &file.files(false), &Progress::none())
        .unwrap();
    prepared.map(&Progress::none()).unwrap()
}

#[track_caller]
fn assert_shows_its_recipe(studio: &Studio) {
    assert!(
        *studio.map() == generated(studio),
        "the map is not that of the recipe"
    );
}

#[test]
fn what_is_painted_is_what_is_generated() {
    let mut studio = painted();
    assert_shows_its_recipe(&studio);
    some_strokes(&mut studio);
    assert_shows_its_recipe(&studio);
    assert!(studio.document().is_changed());
    assert!(studio.document().text().unwrap().contains("# the base"));
    assert_eq!(studio.history().len(), (4, 0));
}

#[test]
fn a_stroke_that_begins_before_its_layer_is_ready_is_painted_when_it_is() {
    let now = {
        let mut studio = painted();
        some_strokes(&mut studio);
        studio.document().text().unwrap()
    };
    let mut studio = painted();
    studio.viewport_mut().resize(Size::new(128, 128).unwrap());
    studio.draw(false).unwrap();
    studio.options.patience = Duration::ZERO;
    some_strokes(&mut studio);
    // Nothing waited for the layer, and each stroke is in the document as soon as it ends, whether it is shown already or not.
    assert_eq!(studio.history().len(), (4, 0));
    studio.settle();
    assert!(!studio.is_making_ready() && studio.take_trouble().is_empty());
    assert_eq!(studio.history().len(), (4, 0));
    assert_eq!(studio.document().text().unwrap(), now);
    assert_shows_its_recipe(&studio);
    // A stroke still in flight goes on where it was, and one on the mesh comes after those in UV.
    studio.select(0);
    studio.add_paint_layer().unwrap();
    let groove = brush(Tool::Groove(Groove::default()), 0.06);
    stroke(&mut studio, groove.clone(), &[[0.1, 0.5], [0.9, 0.5]]);
    studio.settle();
    studio.begin_mesh_stroke(groove.clone(), 3).unwrap();
    studio.mesh_stroke_along((Vec2::new(20.0, 30.0), 1.0), (Vec2::new(60.0, 35.0), 0.5));
    assert!(studio.is_drawing());
    studio.settle();
    assert!(studio.is_drawing());
    studio.mesh_stroke_along((Vec2::new(60.0, 35.0), 1.0), (Vec2::new(110.0, 40.0), 0.5));
    assert!(studio.end_stroke().unwrap());
    assert_shows_its_recipe(&studio);
    assert!(studio.recipe().layers[1].needs_mesh());
    // What comes after it waits for it, and one that is taken away never comes.
    studio
        .set_header(
            "Seed",
            Header {
                seed: 9,
                ..Header::of(studio.recipe())
            },
        )
        .unwrap();
    studio.settle();
    stroke(&mut studio, groove.clone(), &[[0.2, 0.1], [0.9, 0.9]]);
    assert!(studio.undo().unwrap());
    studio.settle();
    assert_shows_its_recipe(&studio);
    let all = studio.recipe().clone();
    studio.begin_stroke(groove, 1).unwrap();
    studio.stroke_to(Point::new(Vec2::splat(0.5), 1.0).unwrap());
    studio.cancel_stroke();
    studio.settle();
    assert!(!studio.is_drawing() && *studio.recipe() == all);
    assert_shows_its_recipe(&studio);
}

#[test]
fn undo_and_redo_are_exact_with_and_without_kept_tiles() {
    for undo_bytes in [256 << 20, 0] {
        let mut studio = painted();
        studio.options.undo_bytes = undo_bytes;
        let mut maps = vec![studio.map().clone()];
        let groove = brush(Tool::Groove(Groove::default()), 0.06);
        for x in [0.1, 0.4, 0.7] {
            stroke(&mut studio, groove.clone(), &[[x, 0.2], [x + 0.2, 0.8]]);
            maps.push(studio.map().clone());
        }
        for map in maps[..3].iter().rev() {
            assert!(studio.undo().unwrap());
            assert!(studio.map() == map);
        }
        assert!(!studio.undo().unwrap());
        for map in &maps[1..] {
            assert!(studio.redo().unwrap());
            assert!(studio.map() == map);
        }
        assert!(!studio.redo().unwrap());
        assert_shows_its_recipe(&studio);
    }
}

#[test]
fn strokes_on_the_mesh_are_in_the_recipe_and_name_their_mesh() {
    let mut studio = painted();
    studio.viewport_mut().resize(Size::new(128, 128).unwrap());
    studio.draw(false).unwrap();
    let groove = Brush {
        tool: Tool::Groove(Groove::default()),
        radius: 0.08,
        ..Brush::default()
    };
    let before = studio.map().clone();
    studio
        .begin_mesh_stroke(Arc::new(groove.clone()), 3)
        .unwrap();
    studio.mesh_stroke_along((Vec2::new(20.0, 30.0), 1.0), (Vec2::new(110.0, 40.0), 0.5));
    assert!(studio.end_stroke().unwrap());
    assert_eq!(studio.recipe().mesh.as_deref(), Some(DEFAULT_MESH));
    assert!(*studio.map() != before);
    assert_shows_its_recipe(&studio);
    assert!(studio.undo().unwrap());
    assert!(*studio.map() == before);
    studio.redo().unwrap();
    assert_shows_its_recipe(&studio);
    studio.settle();
    assert_shows_its_recipe(&studio);
    // Another mesh shows the same map, is no place for this layer's strokes, and while it loads for none.
    let painted = studio.map().clone();
    studio.set_mesh("sphere").unwrap();
    let groove = Arc::new(groove);
    let loading = studio.begin_mesh_stroke(groove.clone(), 3).unwrap_err();
    assert!(loading.to_string().contains("being loaded"), "{loading}");
    studio.settle();
    assert!(*studio.map() == painted);
    assert_shows_its_recipe(&studio);
    let elsewhere = studio.begin_mesh_stroke(groove, 3).unwrap_err();
    assert!(
        elsewhere.to_string().contains("not on torus"),
        "{elsewhere}"
    );
    assert!(studio.undo().unwrap());
    studio.settle();
    assert!(*studio.map() == painted && studio.recipe().mesh.as_deref() == Some(DEFAULT_MESH));
}

#[test]
fn a_cancelled_stroke_and_one_without_a_direction_leave_nothing() {
    let mut studio = painted();
    let before = studio.map().clone();
    let groove = brush(Tool::Groove(Groove::default()), 0.06);
    studio.begin_stroke(groove.clone(), 1).unwrap();
    for x in [0.2, 0.5, 0.7] {
        studio.stroke_to(Point::new(Vec2::splat(x), 1.0).unwrap());
    }
    assert!(*studio.map() != before);
    studio.cancel_stroke();
    assert!(*studio.map() == before);
    studio.begin_stroke(groove, 1).unwrap();
    studio.stroke_to(Point::new(Vec2::splat(0.5), 1.0).unwrap());
    assert!(!studio.end_stroke().unwrap());
    assert!(*studio.map() == before);
    assert!(!studio.document().is_changed());
}

#[test]
fn a_stroke_in_flight_outlives_a_map_that_is_made_meanwhile() {
    let mut studio = painted();
    studio.add_paint_layer().unwrap();
    let groove = brush(Tool::Groove(Groove::default()), 0.06);
    studio.begin_stroke(groove, 1).unwrap();
    for x in [0.2, 0.5, 0.7] {
        studio.stroke_to(Point::new(Vec2::splat(x), 1.0).unwrap());
        std::thread::sleep(Duration::from_millis(60)); // longer than the map takes
        studio.tick();
    }
    assert!(studio.end_stroke().unwrap());
    studio.settle();
    assert_shows_its_recipe(&studio);
}

#[test]
fn layers_are_edited_and_everything_is_undone() {
    let mut studio = painted();
    some_strokes(&mut studio);
    let before = studio.recipe().clone();
    studio.duplicate_layer(1).unwrap();
    assert_eq!(studio.recipe().layers[2].name(), "paint 2");
    studio.rename_layer(0, "iron").unwrap();
    studio.move_layer(0, 3).unwrap();
    let head = LayerHead {
        opacity: 0.3,
        ..LayerHead::of(&studio.recipe().layers[1])
    };
    studio.set_head(1, "Opacity", head).unwrap();
    studio.seal();
    studio.remove_layer(2).unwrap();
    studio.add_paint_layer().unwrap();
    studio.settle();
    assert_shows_its_recipe(&studio);
    while studio.history().len().0 > 4 {
        studio.undo().unwrap();
    }
    assert_eq!(*studio.recipe(), before);
    studio.settle();
    assert_shows_its_recipe(&studio);
    while studio.redo().unwrap() {}
    studio.settle();
    assert_shows_its_recipe(&studio);
}

#[test]
fn a_dragged_slider_is_one_step() {
    let mut studio = painted();
    for i in 1..=10 {
        let head = LayerHead {
            opacity: i as f32 / 20.0,
            ..LayerHead::of(&studio.recipe().layers[0])
        };
        studio.set_head(0, "Opacity", head).unwrap();
    }
    assert_eq!(studio.history().len(), (1, 0));
    studio.undo().unwrap();
    assert_eq!(studio.recipe().layers[0].opacity, 1.0);
    studio.redo().unwrap();
    assert_eq!(studio.recipe().layers[0].opacity, 0.5);
}

#[test]
fn merged_strokes_look_the_same() {
    let mut studio = studio_of(&RECIPE.replace("opacity = 0.8\n", ""));
    studio.select(1);
    let groove = brush(Tool::Groove(Groove::default()), 0.06);
    stroke(&mut studio, groove.clone(), &[[0.1, 0.2], [0.5, 0.4]]);
    studio.add_paint_layer().unwrap();
    stroke(&mut studio, groove, &[[0.4, 0.2], [0.2, 0.5]]);
    studio.settle();
    let before = studio.map().clone();
    studio.merge_down(2).unwrap();
    studio.settle();
    assert!(*studio.map() == before);
    assert!(
        studio
            .merge_down(1)
            .unwrap_err()
            .to_string()
            .contains("`steel`")
    );
    // What is erased above is what lies below that layer: in one layer it would be what lies below both.
    studio.add_paint_layer().unwrap();
    stroke(
        &mut studio,
        brush(Tool::Erase, 0.06),
        &[[0.1, 0.2], [0.5, 0.4]],
    );
    let erasing = studio.merge_down(2).unwrap_err().to_string();
    assert!(erasing.contains("do not erase"), "{erasing}");
    let lowest = studio.merge_down(0).unwrap_err().to_string();
    assert!(lowest.contains("is the lowest"), "{lowest}");
}

#[test]
fn a_layer_without_strokes_goes_into_any_other_and_what_stands_against_merging_is_said() {
    let mut studio = studio_of(&RECIPE.replace("opacity = 0.8\n", ""));
    studio.select(1);
    let groove = brush(Tool::Groove(Groove::default()), 0.06);
    stroke(&mut studio, groove.clone(), &[[0.1, 0.2], [0.5, 0.4]]);
    let before = studio.map().clone();
    // Above the rings, below them, and with what would otherwise stand against it.
    studio.select(2);
    studio.add_paint_layer().unwrap();
    studio.merge_down(3).unwrap();
    studio.select(1);
    studio.add_paint_layer().unwrap();
    let faint = LayerHead {
        opacity: 0.4,
        ..LayerHead::of(&studio.recipe().layers[2])
    };
    studio.set_head(2, "Opacity", faint).unwrap();
    studio.merge_down(3).unwrap();
    studio.settle();
    let names: Vec<&str> = studio.recipe().layers.iter().map(Layer::name).collect();
    assert_eq!(names, ["steel", "paint", "rings"]);
    assert!(*studio.map() == before);
    assert_shows_its_recipe(&studio);
    studio.select(1);
    studio.add_paint_layer().unwrap();
    stroke(&mut studio, groove, &[[0.4, 0.2], [0.2, 0.5]]);
    let head = LayerHead::of(&studio.recipe().layers[2]);
    type Change = fn(&mut LayerHead);
    let changes: [(Change, &str); 3] = [
        (|h| h.opacity = 0.5, "at 50 % opacity"),
        (|h| h.visible = false, "hidden"),
        (|h| h.channels = Channels::DIRECTION, "not on all channels"),
    ];
    for (change, says) in changes {
        let mut other = head.clone();
        change(&mut other);
        studio.set_head(2, "Other", other).unwrap();
        let refused = studio.merge_down(2).unwrap_err().to_string();
        assert!(refused.contains(says), "{refused}");
        studio.set_head(2, "Back", head.clone()).unwrap();
    }
    let rings = studio.merge_down(3).unwrap_err().to_string();
    assert!(
        rings.contains("masked") || rings.contains("rings"),
        "{rings}"
    );
    studio.merge_down(2).unwrap();
}

#[test]
fn selection_and_solo_follow_their_layers() {
    let mut studio = painted();
    studio.select(0);
    let steel = studio.recipe().layers[0].name().to_owned();
    let top = studio.recipe().layers.len() - 1;
    studio.set_solo(Some(0));
    studio.move_layer(0, top).unwrap();
    assert_eq!((studio.selected(), studio.solo()), (top, Some(top)));
    studio.undo().unwrap();
    assert_eq!((studio.selected(), studio.solo()), (0, Some(0)));
    studio.select(1);
    studio.set_solo(Some(1));
    studio.remove_layer(0).unwrap();
    assert_eq!((studio.selected(), studio.solo()), (0, Some(0)));
    studio.undo().unwrap();
    assert_eq!((studio.selected(), studio.solo()), (1, Some(1)));
    assert_eq!(studio.recipe().layers[0].name(), steel);
    studio.remove_layer(1).unwrap();
    assert_eq!(studio.solo(), None);
}

#[test]
fn a_stroke_without_end_goes_on_in_the_next() {
    let mut studio = studio_of(&RECIPE.replace("[320, 200]", "[16, 10]"));
    studio.select(1);
    let groove = brush(Tool::Groove(Groove::default()), 0.01);
    studio.begin_stroke(groove, 1).unwrap();
    let points = POINTS_MAX as u32 + 10;
    for n in 0..points {
        let at = Vec2::new(0.2 + 0.1 * (n % 2) as f32, 0.5);
        studio.stroke_to(Point::new(at, 1.0).unwrap());
    }
    assert!(studio.end_stroke().unwrap());
    let Source::Strokes(strokes) = &studio.recipe().layers[1].source else {
        panic!()
    };
    let lengths: Vec<usize> = strokes.strokes.iter().map(|s| s.points().len()).collect();
    assert_eq!(lengths, [POINTS_MAX, 11]);
    assert_eq!(studio.take_trouble().len(), 0);
}

#[test]
fn refused_edits_change_nothing() {
    let mut studio = painted();
    let before = studio.recipe().clone();
    let head = LayerHead {
        opacity: 7.0,
        ..LayerHead::of(&before.layers[0])
    };
    assert!(studio.set_head(0, "Opacity", head).is_err());
    assert!(studio.remove_layer(9).is_err());
    assert!(studio.rename_layer(0, "paint").is_err(), "there is one");
    studio.select(0);
    let groove = brush(Tool::Groove(Groove::default()), 0.06);
    let error = studio.begin_stroke(groove, 1).unwrap_err().to_string();
    assert!(
        error.contains("`steel`") && error.contains("Add a paint layer"),
        "{error}"
    );
    let constant = || Layer::new(Source::Pattern(Pattern::Constant(Default::default())));
    while studio.recipe().layers.len() < LAYERS_MAX {
        studio.add_layer(constant()).unwrap();
    }
    assert!(studio.add_layer(constant()).is_err());
    while studio.undo().unwrap() {}
    assert_eq!(*studio.recipe(), before);
    assert!(studio.take_trouble().is_empty());
}

#[test]
fn work_is_recovered_from_the_journal_to_the_last_stroke() {
    let folder = tempfile::tempdir().unwrap();
    let options = Options {
        journals: Some(folder.path().to_owned()),
        ..Options::default()
    };
    let file = RecipeFile::parse(RECIPE, "painted.toml", None).unwrap();
    let mut studio = Studio::new(file, None, options.clone()).unwrap();
    studio.settle();
    studio.select(1);
    some_strokes(&mut studio);
    studio.undo().unwrap();
    studio.add_painted_mask(2, true).unwrap();
    let erase = brush(Tool::Erase, 0.05);
    stroke(&mut studio, erase, &[[0.3, 0.6], [0.4, 0.3]]);
    let mask = Mask::new(MaskSource::Polygon(vec![
        Vec2::ZERO,
        Vec2::new(0.3, 0.1),
        Vec2::new(0.1, 1.0 / 3.0),
    ]));
    let head = LayerHead {
        opacity: 0.1,
        mask: Some(mask),
        ..LayerHead::of(&studio.recipe().layers[0])
    };
    studio.set_head(0, "Opacity", head).unwrap();
    let recipe = studio.recipe().clone();
    drop(studio); // as a kill would, nothing said
    let (mut found, errors) = left_behind(folder.path());
    assert!(errors.is_empty() && found.len() == 1);
    let (mut studio, edits) = Studio::recover(found.remove(0), options).unwrap();
    assert_eq!((edits, studio.recipe()), (8, &recipe));
    assert!(studio.document().is_changed());
    studio.settle();
    assert_shows_its_recipe(&studio);
    let path = folder.path().join("saved.toml");
    studio.save(&path).unwrap();
    assert!(!studio.document().is_changed());
    assert_eq!(RecipeFile::read(&path).unwrap().recipe(), studio.recipe());
    studio.close();
    assert!(left_behind(folder.path()).0.is_empty());
}

/// A studio with one stroke, gone as by a kill, and what it left in a folder.
fn killed_in(folder: &Path) -> LeftBehind {
    let options = Options {
        journals: Some(folder.to_owned()),
        ..Options::default()
    };
    let file = RecipeFile::parse(RECIPE, "painted.toml", None).unwrap();
    let mut studio = Studio::new(file, None, options).unwrap();
    studio.settle();
    studio.select(1);
    let groove = brush(Tool::Groove(Groove::default()), 0.06);
    stroke(&mut studio, groove, &[[0.1, 0.2], [0.5, 0.4]]);
    drop(studio);
    left_behind(folder).0.remove(0)
}

#[test]
fn recovered_work_is_kept_until_it_is_in_another_journal() {
    let folder = tempfile::tempdir().unwrap();
    let blocked = folder.path().join("file");
    std::fs::write(&blocked, "x").unwrap();
    let options = Options {
        journals: Some(blocked.clone()),
        ..Options::default()
    };
    let left = killed_in(folder.path());
    let path = left.path().to_owned();
    let (mut studio, recovered) = Studio::recover(left, options.clone()).unwrap();
    assert_eq!((recovered, studio.take_trouble().len()), (1, 1));
    assert!(path.exists());
    assert!(
        left_behind(folder.path()).0.is_empty(),
        "offered to nobody else"
    );
    drop(studio); // killed again
    let left = left_behind(folder.path()).0.remove(0);
    let (mut studio, _) = Studio::recover(left, options.clone()).unwrap();
    std::fs::remove_file(&blocked).unwrap();
    std::thread::sleep(Duration::from_millis(100));
    studio.rename_layer(0, "iron").unwrap();
    assert!(!path.exists(), "it is all in a journal of the new folder");
    drop(studio);
    let left = left_behind(&blocked).0.remove(0);
    assert_eq!(left.changes(), 2);
    let (studio, recovered) = Studio::recover(left, options).unwrap();
    assert_eq!(recovered, 2);
    assert_eq!(studio.recipe().layers[0].name(), "iron");
}

#[test]
fn work_that_is_recovered_in_part_keeps_its_journal_until_it_is_saved() {
    let folder = tempfile::tempdir().unwrap();
    let options = Options {
        journals: Some(folder.path().to_owned()),
        ..Options::default()
    };
    let mut left = killed_in(folder.path());
    left.edits.insert(1, Edit::RemoveLayer { at: 99 });
    let path = left.path().to_owned();
    let (mut studio, recovered) = Studio::recover(left, options).unwrap();
    assert_eq!((recovered, studio.take_trouble().len()), (1, 1));
    studio.rename_layer(0, "iron").unwrap();
    assert!(path.exists());
    studio.save(&folder.path().join("saved.toml")).unwrap();
    assert!(!path.exists());
    studio.close();
    let there = std::fs::read_dir(folder.path()).unwrap();
    assert_eq!(there.count(), 1, "the recipe alone");
}

#[test]
fn recovering_is_undone_stroke_by_stroke() {
    let folder = tempfile::tempdir().unwrap();
    let left = killed_in(folder.path());
    let (mut studio, _) = Studio::recover(left, Options::default()).unwrap();
    assert_eq!(studio.history().len(), (1, 0));
    studio.settle();
    assert_shows_its_recipe(&studio);
    assert!(studio.undo().unwrap());
    studio.settle();
    assert!(*studio.map() == *painted().map());
}

#[test]
fn a_file_that_another_program_changed_is_one_step() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("painted.toml");
    std::fs::write(&path, RECIPE).unwrap();
    let file = RecipeFile::read(&path).unwrap();
    let mut studio = Studio::new(file, Some(path.clone()), Options::default()).unwrap();
    studio.settle();
    studio.select(1);
    let groove = brush(Tool::Groove(Groove::default()), 0.06);
    stroke(&mut studio, groove.clone(), &[[0.1, 0.2], [0.5, 0.4]]);
    let mine = studio.recipe().clone();
    let theirs = RECIPE.replace("angle = 20", "angle = 70 # theirs")
        + "[material]\ndiffuse = [0.2, 0.3, 0.4]\n[scene]\nexposure = 1.5\n";
    std::fs::write(&path, theirs).unwrap();
    assert!(studio.document().changed_on_disk());
    let read = || RecipeFile::read(&path).unwrap();
    studio.begin_stroke(groove, 2).unwrap();
    studio.stroke_to(Point::new(Vec2::splat(0.5), 1.0).unwrap());
    assert!(!studio.reload(read()).unwrap(), "the pen is down");
    assert!(studio.is_drawing());
    studio.cancel_stroke();
    assert!(studio.reload(read()).unwrap());
    assert!(!studio.document().is_changed() && !studio.document().changed_on_disk());
    assert_eq!(studio.recipe(), read().recipe());
    assert!(studio.document().text().unwrap().contains("# theirs"));
    studio.settle();
    assert_shows_its_recipe(&studio);
    assert_eq!(studio.scene().exposure, 1.5);
    assert_eq!(studio.history().len(), (2, 0));
    assert!(studio.undo().unwrap());
    assert!(studio.document().is_changed());
    assert_eq!(*studio.recipe(), mine);
    studio.settle();
    assert_shows_its_recipe(&studio);
    assert_eq!(studio.scene().exposure, mine.scene.exposure);
    studio.redo().unwrap();
    assert_eq!(studio.recipe(), read().recipe());
    // The same once more is no step.
    assert!(studio.reload(read()).unwrap());
    assert_eq!(studio.history().len(), (2, 0));
    std::fs::write(&path, RECIPE.replace("version = 1", "version = 99")).unwrap();
    let error = studio.reload(read()).unwrap_err().to_string();
    assert!(error.contains("newer version"), "{error}");
}

#[test]
fn undo_after_saving_elsewhere_finds_its_files() {
    let root = tempfile::tempdir().unwrap();
    let (here, there) = (root.path().join("here"), root.path().join("there"));
    std::fs::create_dir_all(&here).unwrap();
    std::fs::create_dir_all(&there).unwrap();
    for name in ["x.exr", "y.exr", "pot.obj", "recipe.toml"] {
        std::fs::write(here.join(name), "").unwrap();
    }
    let text = "version = 1\nmesh = 'pot.obj'\n[[layers]]\nname = 'a'\n[layers.image]\nfile = 'x.exr'\n\
        [[layers]]\nname = 'b'\n[layers.image]\nfile = 'x.exr'\n";
    std::fs::write(here.join("recipe.toml"), text).unwrap();
    let file = RecipeFile::read(here.join("recipe.toml")).unwrap();
    let mut studio = Studio::new(file, Some(here.join("recipe.toml")), Options::default()).unwrap();
    let before = studio.recipe().clone();
    let file = "y.exr".to_owned();
    let other = Source::Image(recipe::Image::master(file));
    studio.set_source(0, "Image", other).unwrap();
    studio.remove_layer(1).unwrap();
    let header = Header {
        mesh: None,
        ..Header::of(studio.recipe())
    };
    studio.set_header("Mesh", header).unwrap();
    studio.undo().unwrap(); // one to be done again
    studio.redo().unwrap();
    studio.undo().unwrap();
    studio.save(&there.join("recipe.toml")).unwrap();
    // The recipe's own folder is all that it may name: what it needs, now or after an undo, lies there.
    let named = |studio: &Studio, name: &str| {
        let files = studio.document().files();
        let real = files.resolve("file", name).unwrap();
        real.strip_prefix(there.canonicalize().unwrap())
            .unwrap()
            .to_owned()
    };
    let images = |studio: &Studio| -> Vec<PathBuf> {
        let layers = studio.recipe().layers.iter();
        let names = layers.map(|layer| match &layer.source {
            Source::Image(image) => named(studio, image.files().next().unwrap()),
            _ => panic!("an image"),
        });
        names.collect()
    };
    assert_eq!(images(&studio), [Path::new("y.exr")]);
    while studio.undo().unwrap() {}
    assert_eq!(images(&studio), [Path::new("x.exr"), Path::new("x.exr")]);
    let mesh = studio.recipe().mesh.clone().unwrap();
    assert_eq!(named(&studio, &mesh), Path::new("pot.obj"));
    while studio.redo().unwrap() {}
    assert_eq!(images(&studio), [Path::new("y.exr")]);
    // Back home everything is called as at first.
    while studio.undo().unwrap() {}
    studio.save(&here.join("again.toml")).unwrap();
    let named = Recipe {
        name: "again".to_owned(), // which follows the file
        ..before
    };
    assert_eq!(*studio.recipe(), named);
}

#[test]
fn a_mistake_in_the_background_is_told() {
    let mut studio = painted();
    studio.work();
    // As when the thread panics: it says nothing more.
    let (_, silent) = channel();
    studio.job.as_mut().unwrap().result = silent;
    studio.settle();
    let told = studio.take_trouble().remove(0);
    assert_eq!(told.exit_code(), 3);
    assert!(told.to_string().contains("broke off"), "{told}");
    let groove = brush(Tool::Groove(Groove::default()), 0.06);
    stroke(&mut studio, groove, &[[0.1, 0.2], [0.5, 0.4]]);
    assert_shows_its_recipe(&studio);
}

#[test]
fn memory_for_undo_is_changed_at_any_time() {
    let mut studio = painted();
    some_strokes(&mut studio);
    studio.set_undo_bytes(0);
    assert_eq!(studio.history().len(), (1, 0));
    some_strokes(&mut studio);
    assert_eq!(studio.history().len(), (1, 0));
    studio.set_undo_bytes(1 << 20);
    some_strokes(&mut studio);
    assert_eq!(studio.history().len(), (5, 0));
}

#[test]
fn a_folder_that_takes_no_file_keeps_the_work() {
    let folder = tempfile::tempdir().unwrap();
    let mut studio = painted();
    some_strokes(&mut studio);
    let recipe = studio.recipe().clone();
    let error = studio
        .save(&folder.path().join("missing/a.toml"))
        .unwrap_err();
    assert_eq!(error.exit_code(), 3, "{error}");
    assert!(studio.document().is_changed() && *studio.recipe() == recipe);
    let blocked = Options {
        journals: Some(folder.path().join("file")),
        ..Options::default()
    };
    std::fs::write(folder.path().join("file"), "x").unwrap();
    let file = RecipeFile::parse(RECIPE, "painted.toml", None).unwrap();
    let mut studio = Studio::new(file, None, blocked).unwrap();
    assert_eq!(studio.take_trouble().len(), 1, "told, and no more");
    studio.settle();
    studio.select(1);
    some_strokes(&mut studio);
    assert_shows_its_recipe(&studio);
}

#[test]
fn a_newer_file_is_looked_at_only() {
    let mut studio = studio_of(&RECIPE.replace("version = 1", "version = 99\nfrobnicate = 3"));
    assert!(studio.document().is_read_only());
    assert_eq!(studio.document().ignored(), ["frobnicate"]);
    studio.select(1);
    assert!(studio.remove_layer(0).is_err());
    assert!(!studio.document().is_changed());
}

/// Strokes on the masks of a pattern, of strokes and of a layer with a partly covering pattern: what is shown is what is
/// generated, and undo is exact.
#[test]
fn painted_masks_show_and_hide() {
    for (at, shows) in [(0, true), (1, false), (2, true), (2, false)] {
        let mut studio = painted();
        some_strokes(&mut studio);
        let plain = studio.map().clone();
        studio.add_painted_mask(at, shows).unwrap();
        assert!(studio.is_mask_selected());
        studio.settle();
        assert_shows_its_recipe(&studio);
        assert_eq!(*studio.map() == plain, shows && at != 2, "{at}");
        let before = studio.map().clone();
        let paint = brush(Tool::Groove(Groove::default()), 0.08);
        let erase = brush(Tool::Erase, 0.06);
        stroke(&mut studio, erase.clone(), &[[0.2, 0.1], [0.7, 0.6]]);
        studio.settle(); // layer 1 looks around itself
        let mut maps = vec![before, studio.map().clone()];
        stroke(&mut studio, paint, &[[0.1, 0.5], [0.6, 0.4], [1.1, 0.5]]);
        studio.settle();
        maps.push(studio.map().clone());
        assert_shows_its_recipe(&studio);
        assert!(maps[1] != maps[2]);
        assert_eq!(maps[0] != maps[1], shows, "what is hidden cannot be hidden");
        for map in maps[..2].iter().rev() {
            assert!(studio.undo().unwrap());
            studio.settle();
            assert!(studio.map() == map);
        }
        for map in &maps[1..] {
            assert!(studio.redo().unwrap());
            studio.settle();
            assert!(studio.map() == map);
        }
        assert!(
            studio
                .document()
                .text()
                .unwrap()
                .contains("[layers.mask.strokes]")
        );
        // Onto the layer again, and the mask still holds.
        studio.select_mask(false);
        if at == 1 {
            let groove = brush(Tool::Groove(Groove::default()), 0.06);
            stroke(&mut studio, groove, &[[0.1, 0.6], [0.8, 0.3]]);
            studio.settle();
            assert_shows_its_recipe(&studio);
        }
        studio.set_head(at, "Mask", inverted(&studio, at)).unwrap();
        studio.settle();
        assert_shows_its_recipe(&studio);
        while studio.history().len().0 > 4 {
            studio.undo().unwrap();
        }
        studio.settle();
        assert!(*studio.map() == plain);
    }
}

fn inverted(studio: &Studio, at: usize) -> LayerHead {
    let mut head = LayerHead::of(&studio.recipe().layers[at]);
    let mask = head.mask.as_mut().unwrap();
    mask.invert = !mask.invert;
    head
}

#[test]
fn a_mask_that_is_not_painted_takes_no_stroke() {
    let mut studio = painted();
    studio.select(2);
    studio.select_mask(true);
    assert!(!studio.is_mask_selected());
    let groove = brush(Tool::Groove(Groove::default()), 0.06);
    let error = studio.begin_stroke(groove, 1).unwrap_err().to_string();
    assert!(
        error.contains("`rings`") && error.contains("painted mask"),
        "{error}"
    );
}

#[test]
fn a_large_map_is_shown_as_a_draft_first() {
    let text = RECIPE.replace("size = [320, 200]", "size = [1600, 1000]");
    let file = RecipeFile::parse(&text, "large.toml", None).unwrap();
    let mut studio = Studio::new(file, None, Options::default()).unwrap();
    let draft = |studio: &mut Studio| {
        loop {
            let tick = studio.tick();
            if tick.new_map && studio.is_draft() {
                break;
            }
            assert!(tick.working.is_some(), "no draft came");
            std::thread::sleep(Duration::from_micros(200));
        }
        assert_eq!(studio.map().size(), Size::new(400, 250).unwrap());
    };
    draft(&mut studio);
    studio.settle();
    assert!(!studio.is_draft());
    assert_shows_its_recipe(&studio);
    // Sliders that are dragged: every edit comes before the draft of the one before it.
    for i in 1..5 {
        let head = LayerHead {
            opacity: i as f32 / 20.0,
            ..LayerHead::of(&studio.recipe().layers[0])
        };
        studio.set_head(0, "Opacity", head).unwrap();
    }
    draft(&mut studio);
    // What is painted on a draft is in the recipe as anything else.
    studio.select(1);
    some_strokes(&mut studio);
    studio.undo().unwrap();
    studio.settle();
    assert_shows_its_recipe(&studio);
}

/// Strokes below a layer of strokes that look around themselves change more than they touch.
#[test]
fn what_strokes_above_see_of_a_stroke_is_brought_up_to_date() {
    let mut studio = painted();
    studio.add_paint_layer().unwrap();
    let smooth = brush(Tool::Smooth(Smooth { reach: 0.1 }), 0.3);
    stroke(&mut studio, smooth, &[[0.3, 0.3], [0.6, 0.5]]);
    studio.settle();
    studio.select(1);
    let groove = brush(Tool::Groove(Groove::default()), 0.06);
    stroke(&mut studio, groove, &[[0.3, 0.2], [0.6, 0.7]]);
    studio.settle();
    assert_shows_its_recipe(&studio);
    studio.undo().unwrap();
    studio.settle();
    assert_shows_its_recipe(&studio);
}

#[test]
fn what_is_dirty_is_all_that_changed() {
    let mut studio = painted();
    let before = studio.map().clone();
    let groove = brush(Tool::Groove(Groove::default()), 0.06);
    stroke(&mut studio, groove, &[[0.9, 0.2], [1.1, 0.4]]);
    let tick = studio.tick();
    assert!(!tick.map.is_empty() && !tick.new_map);
    let mut restored = studio.map().clone();
    for rect in tick.map {
        let region: Region = before.region(rect);
        restored.write_region(&region);
    }
    assert!(restored == before);
}

#[test]
fn the_picture_follows_the_brush_and_ends_as_the_reference() {
    let mut studio = painted();
    let size = Size::new(96, 64).unwrap();
    studio.viewport_mut().resize(size);
    assert_eq!(studio.draw(false).unwrap(), [size.rect()]);
    assert!(studio.draw(false).unwrap().is_empty(), "nothing changed");
    let groove = brush(Tool::Groove(Groove::default()), 0.1);
    stroke(&mut studio, groove, &[[0.1, 0.6], [0.9, 0.6]]);
    assert!(!studio.draw(false).unwrap().is_empty());
    let hurried = studio.viewport().pixels().to_vec();
    studio.refine();
    while !studio.viewport().quality().is_reference {
        studio.tick();
        std::thread::sleep(Duration::from_millis(2));
    }
    assert_ne!(studio.viewport().pixels(), hurried);
    let subject = crate::preview::Subject {
        mesh: studio.mesh(),
        map: studio.map(),
        material: &studio.recipe().material,
    };
    let looks = studio.viewport().show().looks();
    let none = Progress::none();
    let samples = crate::preview::REFERENCE_SAMPLES;
    let reference =
        crate::preview::render_reference(subject, studio.scene(), &looks, size, samples, &none);
    assert_eq!(studio.viewport().pixels(), reference.unwrap()[0].to_srgb8());
    studio.draw(true).unwrap();
    assert_eq!(studio.viewport().quality().samples, 0);
    studio.draw(false).unwrap();
    assert_eq!(studio.viewport().pixels(), hurried);
}

#[test]
fn nobody_waits_for_the_sharp_picture_of_a_large_mesh_that_was_turned() {
    let mut studio = painted();
    studio.viewport_mut().resize(Size::new(96, 64).unwrap());
    studio.draw(false).unwrap();
    let sharp = studio.viewport().pixels().to_vec();
    studio.viewport_mut().many = 1;
    studio.draw(true).unwrap();
    let hurried = studio.viewport().pixels().to_vec();
    assert_ne!(hurried, sharp);
    assert!(studio.draw(false).unwrap().is_empty());
    assert!(studio.draw(false).unwrap().is_empty(), "it goes on");
    assert!(studio.viewport().is_refining());
    while studio.viewport().quality().samples == 0 {
        studio.tick();
        std::thread::sleep(Duration::from_millis(2));
    }
    if studio.viewport().quality().samples == 1 {
        assert_eq!(studio.viewport().pixels(), sharp);
    }
    // What is painted meanwhile is drawn at once, and sharp.
    studio.draw(true).unwrap();
    let groove = brush(Tool::Groove(Groove::default()), 0.1);
    stroke(&mut studio, groove, &[[0.1, 0.6], [0.9, 0.6]]);
    assert!(!studio.draw(false).unwrap().is_empty());
    assert_eq!(studio.viewport().quality().samples, 1);
}
