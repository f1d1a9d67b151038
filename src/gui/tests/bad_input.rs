//! What is wrong with files is said, and costs no work.

use super::*;
use crate::gui::desk::{Large, LargeThing};
use eframe::egui::DroppedFile;
use std::path::PathBuf;
use std::sync::Arc;

#[derive(Debug)]
struct Dropped(PathBuf);

impl DroppedFile for Dropped {
    fn path(&self) -> &Path {
        &self.0
    }

    fn bytes(&self) -> Result<Vec<u8>, String> {
        std::fs::read(&self.0).map_err(|e| e.to_string())
    }
}

/// Drops files on the window, and waits until they are taken or refused.
fn drop_files(window: &mut Window, paths: &[PathBuf]) {
    let files = paths.iter().map(|p| Arc::new(Dropped(p.clone())) as _);
    window.input_mut().dropped_files = files.collect();
    window.step();
    for _ in 0..400 {
        window.step();
        if !window.state().is_reading() {
            break;
        }
        std::thread::sleep(Duration::from_millis(5));
    }
    settle(window);
}

fn told(window: &Window) -> String {
    window.state().desk.messages.texts().join("\n")
}

/// A window whose document lies in a folder, with a stroke that is not saved.
fn saved_window() -> (Window, TempDir) {
    let (mut window, folder) = window();
    let ctx = window.ctx.clone();
    let path = folder.path().join("small.toml");
    window.state_mut().save(&ctx, &path);
    stroke(&mut window, (0.35, 0.5), (0.65, 0.6));
    (window, folder)
}

#[test]
fn files_of_the_wrong_kind_are_refused_and_the_work_stays() {
    let (mut window, _folder) = saved_window();
    let elsewhere = tempfile::tempdir().unwrap();
    let before = map(&window);
    for (name, bytes, wanted) in [
        ("picture.png", &b"\x89PNG\r\n"[..], "no usable PNG"),
        ("empty.exr", b"", "the file is empty"),
        ("empty.glb", b"", "the file is empty"),
        ("empty.obj", b"", "the file is empty"),
        ("torn.exr", b"v/1\x01\x02\0\0\0ch", "torn.exr"),
        ("bent.obj", b"v 0 0 0\nvt 0 0\nf 1/1 2/1 3/1\n", "position"),
        ("notes.txt", b"hello", "no recipe, map or mesh by its name"),
    ] {
        let path = elsewhere.path().join(name);
        std::fs::write(&path, bytes).unwrap();
        drop_files(&mut window, &[path]);
        assert!(told(&window).contains(wanted), "{name}: {}", told(&window));
        assert!(window.state().dialog.is_none(), "{name}");
    }
    assert_eq!(strokes(&window), 1);
    assert!(map(&window) == before);
    assert!(window.state().desk.studio.document().is_changed());
}

#[test]
fn an_empty_or_broken_recipe_leaves_the_document_open() {
    let (mut window, folder) = window();
    for (name, text) in [
        ("empty.toml", ""),
        ("broken.toml", "version = 1\n[[layers]\n"),
        ("unknown.toml", "version = 1\nsizes = 64\n"),
    ] {
        let path = folder.path().join(name);
        std::fs::write(&path, text).unwrap();
        drop_files(&mut window, &[path]);
        assert!(told(&window).contains(name), "{name}: {}", told(&window));
        assert_eq!(window.state().desk.studio.recipe().name, "small");
    }
}

#[test]
fn several_files_come_in_one_after_the_other() {
    let (mut window, folder) = saved_window();
    let elsewhere = tempfile::tempdir().unwrap();
    let mesh = elsewhere.path().join("square.obj");
    let text =
        "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\nf 1/1 2/2 3/3 4/4\n";
    std::fs::write(&mesh, text).unwrap();
    let map = elsewhere.path().join("lake.exr");
    let own = window.state().desk.studio.map().clone();
    let info = anisomap::convention::MapInfo {
        name: "lake".to_owned(),
        aspect: 1.0,
        mesh: None,
        material: None,
    };
    let export = anisomap::export::Export::new(&own, &info);
    anisomap::export::exr::write_master(&map, &export, Default::default()).unwrap();
    drop_files(&mut window, &[map, mesh]);
    let recipe = window.state().desk.studio.recipe();
    assert_eq!(
        recipe.mesh.as_deref(),
        Some("square.obj"),
        "{}",
        told(&window)
    );
    assert!(
        recipe.layers.iter().any(|l| l.name() == "lake"),
        "{}",
        told(&window)
    );
    assert!(folder.path().join("square.obj").is_file() && folder.path().join("lake.exr").is_file());
}

#[test]
fn textures_come_in_once_it_is_said_what_they_mean() {
    let (mut window, folder) = saved_window();
    let elsewhere = tempfile::tempdir().unwrap();
    for (name, value) in [
        ("s_Roughness.png", 128),
        ("s_Anisotropic.png", 200),
        ("s_Rotation.png", 32),
    ] {
        let grey = image::GrayImage::from_pixel(8, 8, image::Luma([value]));
        grey.save(elsewhere.path().join(name)).unwrap();
    }
    let before = window.state().desk.studio.recipe().layers.len();
    drop_files(&mut window, &[elsewhere.path().join("s_Rotation.png")]);
    assert!(
        matches!(window.state().dialog, Some(Dialog::Import(_))),
        "{}",
        told(&window)
    );
    assert_eq!(window.state().desk.studio.recipe().layers.len(), before);
    window.get_by_label("Import").click();
    window.step();
    for _ in 0..400 {
        window.step();
        if !window.state().is_reading() {
            break;
        }
        std::thread::sleep(Duration::from_millis(5));
    }
    settle(&mut window);
    let recipe = window.state().desk.studio.recipe();
    let layer = recipe.layers.iter().find(|l| l.name() == "s");
    let Some(Source::Image(image)) = layer.map(|l| &l.source) else {
        panic!("no layer: {}", told(&window));
    };
    let textures = image.textures.as_ref().unwrap();
    assert_eq!(
        textures.convention,
        anisomap::convention::textures::Convention::named("Blender Principled").unwrap()
    );
    for name in ["s_Roughness.png", "s_Anisotropic.png", "s_Rotation.png"] {
        assert!(folder.path().join(name).is_file(), "{name}");
    }
    // Undone at once, as any other layer.
    window.state_mut().desk.studio.undo().unwrap();
    assert_eq!(window.state().desk.studio.recipe().layers.len(), before);
}

#[test]
fn a_mesh_without_texture_coordinates_is_given_some_when_that_is_wanted() {
    let (mut window, folder) = saved_window();
    let flat = folder.path().join("flat.obj");
    std::fs::write(&flat, "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n").unwrap();
    drop_files(&mut window, std::slice::from_ref(&flat));
    assert!(matches!(&window.state().dialog, Some(Dialog::NoUvs(p)) if *p == flat));
    button(&window, "Cancel");
    window.run_steps(2);
    assert!(window.state().dialog.is_none());
    assert_eq!(window.state().desk.studio.recipe().mesh, None);
    drop_files(&mut window, &[flat]);
    button(&window, "Project from six sides");
    for _ in 0..400 {
        window.step();
        if window.state().desk.studio.recipe().mesh.is_some() {
            break;
        }
        std::thread::sleep(Duration::from_millis(5));
    }
    let mesh = window.state().desk.studio.recipe().mesh.clone();
    assert_eq!(mesh.as_deref(), Some("flat.obj#box"), "{}", told(&window));
    settle(&mut window);
    assert_eq!(window.state().desk.studio.mesh().triangles.len(), 1);
}

#[test]
fn a_recipe_without_a_file_is_saved_before_a_mesh_comes_in() {
    let (mut window, folder) = window();
    let elsewhere = tempfile::tempdir().unwrap();
    let mesh = elsewhere.path().join("square.obj");
    let text = "v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 0 1\nf 1/1 2/2 3/3\n";
    std::fs::write(&mesh, text).unwrap();
    drop_files(&mut window, &[mesh]);
    assert!(
        matches!(window.state().dialog, Some(Dialog::File(_))),
        "{}",
        told(&window)
    );
    field(&window, "Path").click();
    window.step();
    press(&mut window, "Ctrl+A");
    let path = folder.path().join("here.toml");
    field(&window, "Path").type_text(&path.display().to_string());
    window.run_steps(2);
    button(&window, "Save");
    for _ in 0..400 {
        window.step();
        if window.state().desk.studio.recipe().mesh.is_some() {
            break;
        }
        std::thread::sleep(Duration::from_millis(5));
    }
    let mesh = window.state().desk.studio.recipe().mesh.clone();
    assert_eq!(mesh.as_deref(), Some("square.obj"), "{}", told(&window));
}

#[test]
fn a_recipe_of_a_newer_version_is_shown_and_not_changed() {
    let folder = tempfile::tempdir().unwrap();
    let text = SMALL.replace("version = 1", "version = 2\nglitter = 0.5");
    let mut window = window_of(app(folder.path(), &text), vec2(1200.0, 760.0));
    assert!(told(&window).contains("newer version"), "{}", told(&window));
    assert!(
        told(&window).contains("glitter"),
        "what is ignored is listed"
    );
    let before = map(&window);
    stroke(&mut window, (0.35, 0.5), (0.65, 0.6));
    settle(&mut window);
    assert!(strokes(&window) == 0 && map(&window) == before);
    press(&mut window, "Delete");
    assert_eq!(window.state().desk.studio.recipe().layers.len(), 2);
    // What is understood of it can be kept, once it is said what is lost.
    press(&mut window, "Ctrl+S");
    window.run_steps(2);
    window.get_by_label_contains("what is not known here: glitter");
    button(&window, "Save a copy");
    window.run_steps(2);
    assert!(matches!(window.state().dialog, Some(Dialog::File(_))));
    window.state_mut().dialog = None;
    let ctx = window.ctx.clone();
    let path = folder.path().join("copy.toml");
    window.state_mut().save(&ctx, &path);
    let desk = &window.state().desk;
    assert!(!desk.studio.document().is_read_only(), "{}", told(&window));
    stroke(&mut window, (0.35, 0.5), (0.65, 0.6));
    assert_eq!(strokes(&window), 1);
}

#[test]
fn a_recipe_that_cannot_be_read_is_told_before_anything_is_asked() {
    let (mut window, folder) = saved_window();
    drop_files(&mut window, &[folder.path().join("nope.toml")]);
    assert!(told(&window).contains("nope.toml"), "{}", told(&window));
    assert!(window.state().dialog.is_none());
    assert_eq!(strokes(&window), 1);
}

/// The journal of two strokes, as a kill leaves it, and its folder.
fn left_by_a_kill() -> (TempDir, PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    {
        let mut window = window_of(app(folder.path(), SMALL), vec2(1200.0, 760.0));
        stroke(&mut window, (0.35, 0.5), (0.65, 0.6));
        stroke(&mut window, (0.35, 0.4), (0.65, 0.45));
    }
    let journals = std::fs::read_dir(folder.path().join("recovery")).unwrap();
    let path = journals.flatten().next().unwrap().path();
    (folder, path)
}

#[test]
fn a_torn_journal_gives_what_is_readable() {
    let (folder, journal) = left_by_a_kill();
    let text = std::fs::read_to_string(&journal).unwrap();
    std::fs::write(&journal, &text[..text.len() - 40]).unwrap();
    let mut window = window_of(app(folder.path(), SMALL), vec2(1200.0, 760.0));
    assert!(matches!(window.state().dialog, Some(Dialog::Recover(_))));
    window.get_by_label_contains("1 change, just now");
    window.get_by_label_contains("was not written to its end");
    button(&window, "Recover");
    window.run_steps(3);
    settle(&mut window);
    assert_eq!(strokes(&window), 1);
    assert!(
        told(&window).contains("1 change recovered"),
        "{}",
        told(&window)
    );
}

#[test]
fn a_journal_of_rubbish_is_told_and_the_studio_works() {
    let (folder, journal) = left_by_a_kill();
    std::fs::write(&journal, b"\xff\xfe rubbish, and much more of it\n\0\0").unwrap();
    let mut window = window_of(app(folder.path(), SMALL), vec2(1200.0, 760.0));
    assert!(window.state().dialog.is_none());
    assert!(told(&window).contains("journal"), "{}", told(&window));
    stroke(&mut window, (0.35, 0.5), (0.65, 0.6));
    assert_eq!(strokes(&window), 1);
}

#[test]
fn a_map_that_is_too_large_is_asked_about() {
    let (mut window, _folder) = window();
    let mut header = anisomap::studio::Header::of(window.state().desk.studio.recipe());
    header.size = [16384, 16384];
    window.state_mut().desk.large = Some(Large {
        warning: "takes about 18 GiB".to_owned(),
        what: LargeThing::Header(Box::new(header)),
    });
    window.run_steps(3);
    assert!(matches!(window.state().dialog, Some(Dialog::Large(_))));
    window.get_by_label_contains("takes about 18 GiB");
    button(&window, "Cancel");
    window.run_steps(3);
    assert!(window.state().dialog.is_none());
    assert_eq!(window.state().desk.studio.recipe().size.width(), 64);
}

#[test]
fn a_keys_file_that_is_wrong_leaves_the_keys_as_they_are() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("keys.toml"), "[keys]\nundo = 'Ctrl+S'\n").unwrap();
    let window = window_of(app(folder.path(), SMALL), vec2(1200.0, 760.0));
    assert!(told(&window).contains("keys.toml"), "{}", told(&window));
    let keys = window.state().desk.keymap.keys_text(Action::Undo);
    assert_eq!(keys, "Ctrl+Z");
}
