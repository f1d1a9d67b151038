//! Files that a document reads: missing, changed, outside its folder, copied along.

use super::*;
use crate::gui::desk::Wanted;
use crate::gui::intake::Part;
use anisomap::studio::hand::ToolKind;
use std::path::PathBuf;

const TEXTURED: &str = "version = 1
size = 64
[[layers]]
name = 'ground'
[layers.brushed]
[[layers]]
name = 'told'
[layers.image.textures]
first.file = 'r.png'
[[layers]]
name = 'paint'
[layers.strokes]
";

fn grey(path: &Path, value: u8) {
    let grey = image::GrayImage::from_pixel(8, 8, image::Luma([value]));
    grey.save(path).unwrap();
}

/// A window with a recipe that reads a texture in its folder.
fn opened(text: &str) -> (Window, TempDir) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("small.toml");
    std::fs::write(&path, text).unwrap();
    grey(&folder.path().join("r.png"), 128);
    (open_at(folder.path(), &path), folder)
}

fn open_at(config: &Path, path: &Path) -> Window {
    let file = RecipeFile::read(path).unwrap();
    let settings = Settings {
        hint_closed: true,
        ..Settings::default()
    };
    let folders = Folders::below(&config.join("config"));
    let mut app = App::new((file, Some(path.to_owned())), settings, Some(folders)).unwrap();
    app.desk.native_dialogs = false;
    window_of(app, vec2(1200.0, 760.0))
}

/// Steps until something holds, for a few seconds.
#[track_caller]
fn wait(window: &mut Window, mut done: impl FnMut(&mut Window) -> bool) {
    for _ in 0..600 {
        window.step();
        if done(window) {
            return settle(window);
        }
        std::thread::sleep(Duration::from_millis(10));
    }
    panic!("{:?}", window.state().desk.messages.texts());
}

fn enter(window: &mut Window, path: &Path) {
    field(window, "Path").click();
    window.step();
    press(window, "Ctrl+A");
    field(window, "Path").type_text(&path.display().to_string());
    window.run_steps(2);
}

fn texture(window: &Window) -> String {
    let layers = &window.state().desk.studio.recipe().layers;
    match &layers[1].source {
        Source::Image(image) => image.files().next().unwrap().clone(),
        _ => panic!("no image"),
    }
}

#[test]
fn a_layer_whose_file_is_missing_is_marked_and_its_file_is_found() {
    let (window, folder) = opened(TEXTURED);
    drop(window);
    let elsewhere = tempfile::tempdir().unwrap();
    let moved = elsewhere.path().join("moved.png");
    std::fs::rename(folder.path().join("r.png"), &moved).unwrap();
    let mut window = open_at(folder.path(), &folder.path().join("small.toml"));
    window.get_by_label("Layer told, not shown");
    let told = window.state().desk.messages.texts().join("\n");
    assert!(told.contains("r.png is not there"), "{told}");
    // A stroke on another layer is painted and kept.
    let before = map(&window);
    stroke(&mut window, (0.35, 0.5), (0.65, 0.6));
    settle(&mut window);
    assert!(map(&window) != before);
    window.state_mut().desk.studio.select(1);
    window.run_steps(2);
    button(&window, "Find the file\u{2026}");
    window.run_steps(3);
    window.get_by_label_contains("which file is to take its place");
    enter(&mut window, &moved);
    button(&window, "Take it");
    wait(&mut window, |w| texture(w) == "moved.png");
    window.get_by_label("Layer told");
    assert!(folder.path().join("moved.png").is_file());
    // What was told of it goes with its cause.
    assert!(window.state().desk.messages.texts().is_empty());
    window.state_mut().desk.studio.undo().unwrap();
    assert_eq!(texture(&window), "r.png");
}

#[test]
fn what_textures_mean_is_changed_afterwards() {
    let (mut window, _folder) = opened(TEXTURED);
    window.state_mut().desk.studio.select(1);
    window.run_steps(2);
    button(&window, "Convention\u{2026}");
    wait(&mut window, |w| {
        matches!(w.state().dialog, Some(Dialog::Import(_)))
    });
    window.run_steps(3);
    window.get_by_label("Convention of told");
    window.get_by_label("What the numbers mean").click();
    window.run_steps(3);
    let steps = window.state().desk.studio.history().len().0;
    let before = map(&window);
    let inverted = window.get_by_role_and_label(Role::CheckBox, "Inverted");
    inverted.click();
    window.run_steps(3);
    button(&window, "Apply");
    window.run_steps(3);
    settle(&mut window);
    assert_eq!(window.state().desk.studio.history().len().0, steps + 1);
    assert!(window.state().dialog.is_none());
    // A stored half is a half either way; what it was is what it is.
    let Source::Image(image) = &window.state().desk.studio.recipe().layers[1].source else {
        panic!("no image");
    };
    assert!(image.textures.as_ref().unwrap().convention.inverted);
    assert_eq!(before.len(), map(&window).len());
}

#[test]
fn a_recipe_that_names_files_outside_its_folder_is_asked_about_once() {
    let (window, folder) = opened(TEXTURED);
    drop(window);
    let inner = folder.path().join("inner");
    std::fs::create_dir(&inner).unwrap();
    let path = inner.join("a.toml");
    std::fs::write(&path, TEXTURED.replace("'r.png'", "'../r.png'")).unwrap();
    let mut window = open_at(folder.path(), &path);
    window.run_steps(3);
    window.get_by_label("../r.png");
    assert!(window.state().desk.messages.texts().is_empty());
    button(&window, "Allow for this document");
    wait(&mut window, |w| {
        w.state().desk.studio.left_out("told").is_none()
    });
    assert!(window.state().dialog.is_none());
    // Refused, the document is shown without.
    let mut window = open_at(folder.path(), &path);
    window.run_steps(3);
    button(&window, "Do not read them");
    window.run_steps(3);
    assert!(window.state().dialog.is_none());
    assert!(window.state().desk.studio.left_out("told").is_some());
}

#[test]
fn a_texture_that_another_program_writes_is_shown_anew() {
    let (mut window, folder) = opened(TEXTURED);
    let before = map(&window);
    grey(&folder.path().join("r.png"), 30);
    wait(&mut window, |w| map(w) != before);
    let told = window.state().desk.messages.texts().join("\n");
    assert!(told.contains("read again"), "{told}");
}

#[test]
fn a_document_saved_elsewhere_takes_its_files_along() {
    let (mut window, folder) = opened(TEXTURED);
    let to = folder.path().join("new/deep");
    press(&mut window, "Ctrl+Shift+S");
    enter(&mut window, &to.join("b.toml"));
    button(&window, "Save");
    window.run_steps(3);
    // The folder is not there: the dialog stays, and makes it and saves when that is wanted.
    assert!(matches!(window.state().dialog, Some(Dialog::File(_))) && !to.exists());
    button(&window, "Make it and save");
    wait(&mut window, |_| to.join("b.toml").is_file());
    assert!(to.join("r.png").is_file());
    let file = RecipeFile::read(to.join("b.toml")).unwrap();
    assert!(!file.names_outside());
}

/// Saves into another folder, where the texture has to be copied first.
fn begin_saving(window: &mut Window, folder: &Path) -> PathBuf {
    let to = folder.join("elsewhere");
    std::fs::create_dir(&to).unwrap();
    stroke(window, (0.35, 0.5), (0.65, 0.6));
    let ctx = window.ctx.clone();
    window.state_mut().save(&ctx, &to.join("b.toml"));
    assert!(window.state().is_saving());
    to
}

#[test]
fn closing_while_a_document_is_saved_waits_for_that() {
    let (mut window, folder) = opened(TEXTURED);
    let to = begin_saving(&mut window, folder.path());
    press(&mut window, "Ctrl+Q");
    wait(&mut window, |w| w.state().is_closing());
    assert!(window.state().dialog.is_none(), "nothing is left to ask");
    assert!(to.join("r.png").is_file());
    assert_eq!(
        RecipeFile::read(to.join("b.toml")).unwrap().recipe(),
        window.state().desk.studio.recipe()
    );
}

#[test]
fn a_file_that_comes_in_while_a_document_is_saved_lies_beside_it_or_is_told_of() {
    let (mut window, folder) = opened(TEXTURED);
    let mesh = tempfile::tempdir().unwrap();
    let mesh = mesh.path().join("part.obj");
    std::fs::write(
        &mesh,
        "v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 0 1\nf 1/1 2/2 3/3\n",
    )
    .unwrap();
    let to = begin_saving(&mut window, folder.path());
    let ctx = window.ctx.clone();
    window.state_mut().take_in(&ctx, Part::Mesh, &mesh);
    wait(&mut window, |w| {
        !w.state().is_saving() && !w.state().is_reading()
    });
    let state = window.state();
    let told = state.desk.messages.texts().join("\n");
    match state.desk.studio.recipe().mesh.as_deref() {
        Some(name) => assert!(to.join(name).is_file(), "{name} {told}"),
        None => assert!(told.contains("take it in once more"), "{told}"),
    }
    assert!(to.join("b.toml").is_file() && to.join("r.png").is_file());
}

#[test]
fn the_recipe_beside_an_export_opens_and_changed_files_are_asked_about() {
    let (mut window, folder) = opened(TEXTURED);
    let out = folder.path().join("out");
    export_to(&mut window, &out);
    let copy = RecipeFile::read(out.join("small.toml")).unwrap();
    assert!(!copy.names_outside() && out.join("r.png").is_file());
    press(&mut window, "Escape");
    window.run_steps(2);
    std::fs::write(out.join("small.exr"), "another's").unwrap();
    press(&mut window, "Ctrl+E");
    window.run_steps(3);
    window.get_by_label_contains("changed since");
    assert_eq!(std::fs::read(out.join("small.exr")).unwrap(), b"another's");
    button(&window, "Replace it");
    wait_for_export(&mut window);
    assert!(std::fs::read(out.join("small.exr")).unwrap().len() > 100);
}

#[test]
fn nothing_is_asked_of_a_document_without_a_folder() {
    let (mut window, _folder) = window();
    for wanted in [Wanted::Find("a.png".to_owned()), Wanted::Convention(0)] {
        window.state_mut().desk.wanted = Some(wanted);
        window.run_steps(2);
        assert!(window.state().dialog.is_none());
    }
}

/// Enter, and nothing else, as often as somebody may press it.
fn enter_key(window: &mut Window) {
    press(window, "Enter");
    window.run_steps(3);
}

#[test]
fn an_enter_too_many_does_not_write_over_another_file() {
    let (mut window, folder) = opened(TEXTURED);
    let theirs = folder.path().join("theirs.toml");
    std::fs::write(&theirs, "theirs").unwrap();
    press(&mut window, "Ctrl+Shift+S");
    enter(&mut window, &theirs);
    for _ in 0..3 {
        enter_key(&mut window);
    }
    assert_eq!(std::fs::read_to_string(&theirs).unwrap(), "theirs");
    window.get_by_label_contains("is there already");
    button(&window, "Replace it");
    wait(&mut window, |_| RecipeFile::read(&theirs).is_ok());
}

#[test]
fn what_is_typed_to_be_opened_stays_where_no_such_file_is() {
    let (mut window, folder) = opened(TEXTURED);
    press(&mut window, "Ctrl+O");
    window.run_steps(2);
    // It is selected, so that another path takes its place.
    let nowhere = folder.path().join("nowhere.obj");
    field(&window, "Path").type_text(&nowhere.display().to_string());
    window.run_steps(2);
    enter_key(&mut window);
    window.get_by_label_contains("There is no file");
    assert!(matches!(window.state().dialog, Some(Dialog::File(_))));
    // A name alone is one in the folder that the dialog began with; what begins anew is meant as it begins.
    for typed in [
        "small.toml".to_owned(),
        format!("/tmp/{}/small.toml", folder.path().display()),
    ] {
        field(&window, "Path").click();
        window.step();
        press(&mut window, "Ctrl+A");
        field(&window, "Path").type_text(&typed);
        window.run_steps(2);
        enter_key(&mut window);
        wait(&mut window, |w| w.state().dialog.is_none());
        let open = window.state().desk.studio.document().path().unwrap();
        assert_eq!(open.file_name().unwrap(), "small.toml");
        press(&mut window, "Ctrl+O");
        window.run_steps(2);
    }
}

#[test]
fn an_export_and_a_preset_need_no_pointer() {
    let (mut window, folder) = opened(TEXTURED);
    window.state_mut().desk.settings.export.folder = Some(folder.path().join("out"));
    press(&mut window, "Ctrl+Shift+E");
    window.run_steps(3);
    enter_key(&mut window);
    wait_for_export(&mut window);
    assert!(folder.path().join("out/small.exr").is_file());
    window.run_steps(2);
    enter_key(&mut window);
    assert!(window.state().dialog.is_none(), "closed");
    press(&mut window, "Ctrl+P");
    window.run_steps(3);
    field(&window, "Search").type_text("vinyl");
    window.run_steps(2);
    enter_key(&mut window);
    enter_key(&mut window);
    wait(&mut window, |w| {
        w.state().desk.studio.document().title().contains("vinyl")
    });
}

#[test]
fn escape_from_the_folder_of_an_export_leads_back_to_it() {
    let (mut window, _folder) = opened(TEXTURED);
    press(&mut window, "Ctrl+Shift+E");
    window.run_steps(3);
    button(&window, "Browse\u{2026}");
    window.run_steps(3);
    assert!(matches!(
        window.state().dialog,
        Some(Dialog::ExportFolder(..))
    ));
    press(&mut window, "Escape");
    window.run_steps(2);
    assert!(matches!(window.state().dialog, Some(Dialog::Export(_))));
}

#[test]
fn what_a_mask_hides_is_told_and_its_brush_is_changed_by_the_swap() {
    let (mut window, _folder) = opened(TEXTURED);
    window
        .state_mut()
        .desk
        .studio
        .add_painted_mask(2, false)
        .unwrap();
    window.run_steps(2);
    assert!(window.state().desk.studio.is_mask_selected());
    let before = window.state().desk.hand.brush().clone();
    press(&mut window, "X");
    assert_eq!(window.state().desk.hand.kind(), ToolKind::Erase);
    press(&mut window, "X");
    assert_eq!(*window.state().desk.hand.brush(), before);
    // The mask that came again is painted on again.
    press(&mut window, "Ctrl+Z");
    press(&mut window, "Ctrl+Y");
    assert!(window.state().desk.studio.is_mask_selected());
    window.state_mut().desk.studio.select_mask(false);
    stroke(&mut window, (0.35, 0.5), (0.65, 0.6));
    let told = window.state().desk.messages.texts().join("\n");
    assert!(
        told.contains("The mask of paint hides this stroke"),
        "{told}"
    );
}
