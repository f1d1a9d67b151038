//! Files that a recipe names: missing, moved, changed by other programs, outside its folder.

use super::*;
use crate::convention::MapInfo;
use crate::export::Export;
use crate::export::exr::{Precision, write_master};
use crate::map::Texel;
use crate::recipe::seen_from;
use std::path::PathBuf;

const SQUARE: &str = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\nf 1/1 2/2 3/3\nf 1/1 3/3 4/4\n";

const LAYERS: &str = "version = 1\nsize = 64\nmesh = 'square.obj'\n\
    [[layers]]\nname = 'ground'\n[layers.constant]\n\
    [[layers]]\nname = 'lake'\nopacity = 0.5\n[layers.image]\nfile = 'lake.exr'\n\
    [[layers]]\nname = 'paint'\n[layers.strokes]\npacked = []\nbrushes = []\n";

fn write_map(path: &Path, alpha: f32) {
    let texel = Texel {
        alpha_x: alpha,
        ..DEFAULT_TEXEL
    };
    let map = AnisoMap::constant(Size::new(4, 4).unwrap(), Wrap::Repeat, texel);
    let info = MapInfo::default();
    write_master(path, &Export::new(&map, &info), Precision::Float).unwrap();
}

/// A folder with a recipe, a map and a mesh.
fn folder() -> (tempfile::TempDir, PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.toml");
    std::fs::write(&path, LAYERS).unwrap();
    std::fs::write(folder.path().join("square.obj"), SQUARE).unwrap();
    write_map(&folder.path().join("lake.exr"), 0.1);
    (folder, path)
}

fn opened(path: &Path) -> Studio {
    let file = RecipeFile::read(path).unwrap();
    let mut studio = Studio::new(file, Some(path.to_owned()), Options::default()).unwrap();
    studio.settle();
    studio
}

fn made(studio: &Studio) -> Result<AnisoMap> {
    let recipe = studio.recipe();
    let (files, none) = (studio.document().files(), Progress::none());
    recipe.prepare(recipe.size, &files, &none)?.map(&none)
}

#[test]
fn a_layer_whose_file_is_missing_is_left_out_until_the_file_is_found() {
    let (folder, path) = folder();
    let lake = folder.path().join("lake.exr");
    let whole = opened(&path).map().clone();
    let moved = folder.path().join("moved.exr");
    std::fs::rename(&lake, &moved).unwrap();
    let mut studio = opened(&path);
    // The rest is shown, and so is the mesh.
    assert_eq!(studio.mesh().triangles.len(), 2);
    assert!(*studio.map() != whole && studio.map().alpha_x()[0] == DEFAULT_TEXEL.alpha_x);
    let told = studio.take_trouble();
    assert_eq!(told.len(), 1, "{told:?}");
    assert!(told[0].to_string().contains("lake.exr is not there"));
    let left = studio.left_out("lake").unwrap().clone();
    assert_eq!(left.file.as_deref(), Some("lake.exr"));
    assert!(studio.left_out("ground").is_none() && studio.left_out("paint").is_none());
    // Other layers take strokes, in UV and on the mesh, and it is not told again and again.
    studio.select(2);
    let groove = brush(Tool::Groove(Groove::default()), 0.1);
    let before = studio.map().clone();
    stroke(&mut studio, groove, &[[0.2, 0.5], [0.8, 0.5]]);
    studio.settle();
    assert!(*studio.map() != before);
    studio
        .set_head(
            0,
            "Opacity",
            LayerHead {
                opacity: 0.7,
                ..LayerHead::of(&studio.recipe().layers[0])
            },
        )
        .unwrap();
    studio.settle();
    assert!(studio.take_trouble().is_empty());
    // Files are not written as if it had never been there.
    assert!(made(&studio).unwrap_err().to_string().contains("lake.exr"));
    studio.replace_file("lake.exr", "moved.exr").unwrap();
    studio.settle();
    assert!(studio.left_out("lake").is_none());
    assert!(*studio.map() == made(&studio).unwrap());
    studio.undo().unwrap();
    studio.settle();
    assert_eq!(studio.left_out("lake"), Some(&left));
}

#[test]
fn a_file_that_cannot_be_read_is_named() {
    let (folder, path) = folder();
    std::fs::write(folder.path().join("lake.exr"), "v/1\x01 torn").unwrap();
    let mut studio = opened(&path);
    let left = studio.left_out("lake").unwrap();
    assert_eq!(left.file.as_deref(), Some("lake.exr"));
    assert!(
        !left.is_outside && left.reason.contains("lake.exr"),
        "{left:?}"
    );
    assert_eq!(studio.take_trouble().len(), 1);
}

#[test]
fn a_mesh_that_is_missing_leaves_the_map_and_the_mesh_before() {
    let (folder, path) = folder();
    std::fs::remove_file(folder.path().join("square.obj")).unwrap();
    let mut studio = opened(&path);
    assert!(studio.no_mesh().is_some());
    assert!(*studio.map() == made(&studio).unwrap());
    assert_eq!(studio.take_trouble().len(), 1);
    studio.select(2);
    let groove = brush(Tool::Groove(Groove::default()), 0.1);
    let refused = studio.begin_mesh_stroke(groove.clone(), 1).unwrap_err();
    assert!(refused.to_string().contains("square.obj"), "{refused}");
    stroke(&mut studio, groove, &[[0.2, 0.5], [0.8, 0.5]]);
    std::fs::write(folder.path().join("other.obj"), SQUARE).unwrap();
    studio.replace_file("square.obj", "other.obj").unwrap();
    studio.settle();
    assert!(studio.no_mesh().is_none() && studio.mesh().triangles.len() == 2);
    assert_eq!(studio.recipe().mesh.as_deref(), Some("other.obj"));
}

#[test]
fn files_that_other_programs_write_anew_are_read_anew() {
    let (folder, path) = folder();
    let mut studio = opened(&path);
    let before = studio.map().clone();
    write_map(&folder.path().join("lake.exr"), 0.45);
    let one = SQUARE.replace("f 1/1 3/3 4/4\n", "");
    std::fs::write(folder.path().join("square.obj"), one).unwrap();
    studio.read_files_again();
    studio.settle();
    assert!(*studio.map() != before && *studio.map() == made(&studio).unwrap());
    assert_eq!(studio.mesh().triangles.len(), 1);
    assert!(studio.take_trouble().is_empty());
    // The same files once more change nothing.
    let body = Arc::clone(studio.body());
    studio.read_files_again();
    studio.settle();
    assert!(Arc::ptr_eq(&body, studio.body()));
}

#[test]
fn buffers_of_a_mesh_that_are_written_anew_are_read_anew() {
    const TRIANGLE: &str = r#"{"asset": {"version": "2.0"}, "scenes": [{"nodes": [0]}], "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0, "TEXCOORD_0": 1}}]}],
        "buffers": [{"uri": "part.bin", "byteLength": 60}],
        "bufferViews": [{"buffer": 0, "byteLength": 36}, {"buffer": 0, "byteOffset": 36, "byteLength": 24}],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3", "min": [0, 0, 0], "max": [9, 9, 9]},
            {"bufferView": 1, "componentType": 5126, "count": 3, "type": "VEC2"}]}"#;
    let (folder, path) = folder();
    let buffers = folder.path().join("part.bin");
    let write = |width: f32| {
        let numbers = [0.0, 0.0, 0.0, width, 0.0, 0.0, 0.0, 1.0, 0.0];
        let uvs = [0.0, 0.0, 1.0, 0.0, 0.0, 1.0];
        let bytes = numbers
            .iter()
            .chain(&uvs)
            .flat_map(|n: &f32| n.to_le_bytes());
        std::fs::write(&buffers, bytes.collect::<Vec<u8>>()).unwrap();
    };
    write(1.0);
    std::fs::write(folder.path().join("part.gltf"), TRIANGLE).unwrap();
    let mut studio = opened(&path);
    studio.replace_file("square.obj", "part.gltf").unwrap();
    studio.settle();
    assert!(studio.files_to_watch().contains(&buffers));
    let width = |studio: &Studio| studio.mesh().positions[1].x - studio.mesh().positions[0].x;
    let before = width(&studio);
    assert!(before > 0.0 && studio.take_trouble().is_empty());
    // Times are told in steps of some milliseconds.
    std::thread::sleep(Duration::from_millis(30));
    write(2.0);
    studio.read_files_again();
    studio.settle();
    assert_eq!(width(&studio), 2.0 * before);
    // Others of the same length, older than the file that names them.
    write(3.0);
    let then = std::time::UNIX_EPOCH + Duration::from_secs(1_000_000_000);
    let file = std::fs::File::options().write(true).open(&buffers).unwrap();
    file.set_modified(then).unwrap();
    studio.read_files_again();
    studio.settle();
    assert_eq!(width(&studio), 3.0 * before);
    std::fs::remove_file(&buffers).unwrap();
    assert!(
        studio.files_to_watch().contains(&buffers),
        "it may come back"
    );
    // Under another name, which only the file itself tells.
    let other = folder.path().join("numbers.dat");
    let named = TRIANGLE.replace("part.bin", "numbers.dat");
    std::fs::write(folder.path().join("part.gltf"), named).unwrap();
    write(3.0);
    std::fs::rename(&buffers, &other).unwrap();
    studio.read_files_again();
    studio.settle();
    let watched = studio.files_to_watch();
    assert!(watched.contains(&other) && !watched.contains(&buffers));
    std::thread::sleep(Duration::from_millis(30));
    write(4.0);
    std::fs::rename(&buffers, &other).unwrap();
    studio.read_files_again();
    studio.settle();
    assert_eq!(width(&studio), 4.0 * before);
}

#[test]
fn what_lies_outside_the_folder_is_read_once_that_is_allowed() {
    let (folder, path) = folder();
    let inner = folder.path().join("inner");
    std::fs::create_dir(&inner).unwrap();
    let text = LAYERS
        .replace("'lake.exr'", "'../lake.exr'")
        .replace("'square.obj'", "'../square.obj'");
    let copy = inner.join("a.toml");
    std::fs::write(&copy, text).unwrap();
    let mut studio = opened(&copy);
    assert!(
        studio.take_trouble().is_empty(),
        "the user is asked, not told"
    );
    assert_eq!(studio.outside_files(), ["../lake.exr", "../square.obj"]);
    assert!(studio.left_out("lake").unwrap().is_outside);
    studio.allow_outside();
    studio.settle();
    assert!(studio.outside_files().is_empty() && studio.left_out("lake").is_none());
    assert!(*studio.map() == *opened(&path).map());
    assert_eq!(studio.mesh().triangles.len(), 2);
    // What was allowed were those files: a recipe that comes to name another one is asked about anew.
    let again = std::fs::read_to_string(&copy).unwrap();
    std::fs::write(&copy, again.replace("seed", "# seed")).unwrap();
    assert!(studio.reload(RecipeFile::read(&copy).unwrap()).unwrap());
    assert!(studio.outside_files().is_empty());
    std::fs::write(&copy, again.replace("../lake.exr", "../lake_2.exr")).unwrap();
    assert!(studio.reload(RecipeFile::read(&copy).unwrap()).unwrap());
    assert_eq!(studio.outside_files(), ["../lake_2.exr", "../square.obj"]);
    assert_eq!(
        seen_from(&inner, &folder.path().join("lake.exr")).unwrap(),
        "../lake.exr"
    );
}

#[test]
fn what_textures_mean_is_said_anew_as_one_step() {
    let (folder, path) = folder();
    let grey = image::GrayImage::from_pixel(8, 8, image::Luma([128]));
    grey.save(folder.path().join("r.png")).unwrap();
    let text = format!(
        "{LAYERS}[[layers]]\nname = 'told'\n[layers.image.textures]\nfirst.file = 'r.png'\n"
    );
    std::fs::write(&path, text).unwrap();
    let mut studio = opened(&path);
    let before = studio.map().clone();
    let Source::Image(image) = &studio.recipe().layers[3].source else {
        panic!("no image");
    };
    let mut textures = image.textures.clone().unwrap();
    textures.convention.inverted = !textures.convention.inverted;
    textures.convention.scale = 0.5;
    studio.set_textures(3, textures).unwrap();
    studio.settle();
    assert_eq!(studio.history().len(), (1, 0));
    assert!(*studio.map() != before && *studio.map() == made(&studio).unwrap());
    studio.undo().unwrap();
    studio.settle();
    assert!(*studio.map() == before);
    assert!(studio.set_textures(0, Default::default()).is_err());
}

#[test]
fn nothing_waits_for_a_layer_that_is_made_ready() {
    let mut studio = painted();
    studio.options.patience = Duration::ZERO;
    let groove = brush(Tool::Groove(Groove::default()), 0.06);
    for n in 0..3 {
        let y = 0.3 + 0.2 * n as f32;
        stroke(&mut studio, groove.clone(), &[[0.2, y], [0.8, y]]);
    }
    // Whether it is painted by now or not, a stroke is a step, and is taken back at once.
    assert!(studio.undo().unwrap());
    assert_eq!(studio.history().len(), (2, 1));
    studio.settle();
    assert_shows_its_recipe(&studio);
    studio.redo().unwrap();
    studio.settle();
    assert_eq!(studio.history().len(), (3, 0));
    assert_shows_its_recipe(&studio);
    assert!(studio.take_trouble().is_empty());
}

/// A straight line is ahead of the stroke until it ends; see [`crate::paint::Live::go_on`].
#[test]
fn a_stroke_that_ends_while_its_layer_is_made_ready_keeps_what_was_ahead() {
    let mut studio = painted();
    studio.options.patience = Duration::ZERO;
    let groove = brush(Tool::Groove(Groove::default()), 0.06);
    let point = |x: f32| Point::new(Vec2::new(x, 0.5), 1.0).unwrap();
    studio.begin_stroke(groove.clone(), 1).unwrap();
    studio.stroke_along(&[point(0.2)], &[point(0.5)]);
    studio.stroke_along(&[], &[point(0.8)]);
    assert!(studio.end_stroke().unwrap());
    // It is work that has to be asked about, written down and exported, whatever is ready.
    assert!(studio.document().is_changed());
    assert_eq!(studio.history().len(), (1, 0));
    let Source::Strokes(strokes) = &studio.recipe().layers[studio.selected()].source else {
        panic!("a layer of strokes");
    };
    assert_eq!(strokes.strokes.last().unwrap().points().len(), 2);
    studio.settle();
    assert_shows_its_recipe(&studio);
    assert!(studio.take_trouble().is_empty());
}

#[test]
fn a_document_loses_what_the_first_scene_says_of_itself() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("mine.toml");
    let mut studio = Studio::new(welcome().unwrap(), None, Options::default()).unwrap();
    assert!(!studio.recipe().description.is_empty());
    studio.save(&path).unwrap();
    assert!(studio.recipe().description.is_empty());
    assert!(
        !std::fs::read_to_string(&path)
            .unwrap()
            .contains("description")
    );
}
