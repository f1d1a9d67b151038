//! The window, driven as a user drives it, without a display.

mod bad_input;
mod fits;
mod guides;
mod names;
mod pen;
mod renderer;
mod shortcuts;
mod sources;
mod steer;
mod tips;
mod views;

use super::app::App;
use super::canvas::Kind;
use super::desk::Panes;
use super::dialogs::Dialog;
use anisomap::export::exr::Precision;
use anisomap::paint::Points;
use anisomap::recipe::{RecipeFile, Source};
use anisomap::studio::action::Action;
use anisomap::studio::hand::ToolKind;
use anisomap::studio::keymap::Chord;
use anisomap::studio::settings::{Folders, Settings};
use eframe::egui::accesskit::Role;
use eframe::egui::{Event, Key, Modifiers, Pos2, Rect, Vec2, vec2};
use egui_kittest::Harness;
use egui_kittest::kittest::Queryable;
use renderer::CpuRenderer;
use std::path::Path;
use std::time::Duration;
use tempfile::TempDir;

type Window = Harness<'static, App>;

const SMALL: &str = "version = 1
name = \"small\"
size = 64
[[layers]]
name = \"ground\"
[layers.brushed]
angle = 30
[[layers]]
name = \"paint\"
[layers.strokes]
";

fn app(folder: &Path, text: &str) -> App {
    let file = RecipeFile::parse(text, "small.toml", None).unwrap();
    let folders = Folders::below(folder);
    let mut app = App::new(
        (file, None),
        Settings {
            hint_closed: true,
            ..Settings::default()
        },
        Some(folders),
    )
    .unwrap();
    app.desk.native_dialogs = false;
    app
}

fn window_of(app: App, size: Vec2) -> Window {
    let mut window = Harness::builder()
        .with_size(size)
        .with_max_steps(64)
        .renderer(CpuRenderer::default())
        .build_ui_state(|ui, app: &mut App| app.frame(ui), app);
    settle(&mut window);
    window
}

fn window() -> (Window, TempDir) {
    let folder = tempfile::tempdir().unwrap();
    let app = app(folder.path(), SMALL);
    (window_of(app, vec2(1200.0, 760.0)), folder)
}

/// Steps until the map is made.
fn settle(window: &mut Window) {
    for _ in 0..400 {
        window.step();
        if window.state().desk.working.is_none() {
            window.step();
            return;
        }
        std::thread::sleep(Duration::from_millis(5));
    }
    panic!("the map is never done");
}

/// The key of a chord as the window gets it.
fn key_of(chord: &Chord) -> (Modifiers, Key) {
    let modifiers = Modifiers {
        ctrl: chord.ctrl,
        command: chord.ctrl,
        alt: chord.alt,
        shift: chord.shift,
        ..Modifiers::NONE
    };
    (modifiers, Key::from_name(&chord.key).unwrap())
}

fn press(window: &mut Window, keys: &str) {
    let (modifiers, key) = key_of(&keys.parse().unwrap());
    window.key_press_modifiers(modifiers, key);
    window.step();
    window.step();
}

/// Holds these keys from now on.
fn hold(window: &mut Window, modifiers: Modifiers) {
    window.event(Event::ModifiersChanged(modifiers));
    window.step();
}

/// Drags over the canvas, from and to as parts of its sides.
fn stroke(window: &mut Window, from: (f32, f32), to: (f32, f32)) {
    let rect = window.get_by_label("Paint canvas").rect();
    stroke_in(window, rect, from, to);
}

/// The same over another part of the window.
fn stroke_in(window: &mut Window, rect: Rect, from: (f32, f32), to: (f32, f32)) {
    let at = |(x, y): (f32, f32)| rect.lerp_inside(vec2(x, y));
    let (from, to) = (at(from), at(to));
    let places: Vec<Pos2> = (0..=8)
        .map(|i| from + (to - from) * (i as f32 / 8.0))
        .collect();
    drag(window, &places);
}

/// Drags through these places, one a frame.
fn drag(window: &mut Window, places: &[Pos2]) {
    window.hover_at(places[0]);
    window.step();
    window.drag_at(places[0]);
    window.step();
    for place in &places[1..] {
        window.hover_at(*place);
        window.step();
    }
    window.drop_at(places[places.len() - 1]);
    window.run_steps(2);
}

/// Steps until the stroke that ended is painted: on a busy machine its layer is not ready at once.
fn land(window: &mut Window) {
    for _ in 0..400 {
        window.step();
        if strokes(window) > 0 {
            break;
        }
        std::thread::sleep(Duration::from_millis(5));
    }
    window.run_steps(2);
}

fn button(window: &Window, label: &str) {
    window.get_by_role_and_label(Role::Button, label).click();
}

fn field<'a>(window: &'a Window, label: &'a str) -> egui_kittest::Node<'a> {
    window.get_by_role_and_label(Role::TextInput, label)
}

fn strokes(window: &Window) -> usize {
    let layers = &window.state().desk.studio.recipe().layers;
    let of = |source: &Source| match source {
        Source::Strokes(strokes) => strokes.strokes.len(),
        _ => 0,
    };
    layers.iter().map(|l| of(&l.source)).sum()
}

/// The map's widths and directions, to be compared.
fn map(window: &Window) -> Vec<f32> {
    let map = window.state().desk.studio.map();
    [map.alpha_x(), map.alpha_y(), map.cos2(), map.sin2()].concat()
}

#[test]
fn a_stroke_is_painted_undone_and_done_again() {
    let (mut window, _folder) = window();
    let before = map(&window);
    stroke(&mut window, (0.35, 0.5), (0.65, 0.5));
    assert_eq!(
        strokes(&window),
        1,
        "{:?}",
        window.state().desk.messages.texts()
    );
    let painted = map(&window);
    assert_ne!(before, painted);
    press(&mut window, "Ctrl+Z");
    assert_eq!(strokes(&window), 0);
    assert!(map(&window) == before, "undo is identity");
    press(&mut window, "Ctrl+Y");
    assert!(map(&window) == painted);
    press(&mut window, "Ctrl+Z");
    press(&mut window, "Ctrl+Shift+Z");
    assert!(map(&window) == painted, "both keys redo");
}

#[test]
fn a_stroke_that_lies_within_one_slow_frame_is_painted_whole() {
    for place in ["Paint canvas", "3D view"] {
        let (mut window, _folder) = window();
        let rect = window.get_by_role_and_label(Role::Canvas, place).rect();
        // Both the map and the torus's front are there.
        let at = |t: f32| rect.lerp_inside(vec2(0.4 + 0.2 * t, 0.62));
        let press = |pos, pressed| Event::PointerButton {
            pos,
            button: eframe::egui::PointerButton::Primary,
            pressed,
            modifiers: Modifiers::NONE,
        };
        let mut events = vec![Event::PointerMoved(at(-0.5)), Event::PointerMoved(at(0.0))];
        events.push(press(at(0.0), true));
        events.extend((1..=8).map(|i| Event::PointerMoved(at(i as f32 / 8.0))));
        events.push(press(at(1.0), false));
        window.input_mut().events = events;
        window.step();
        land(&mut window);
        assert_eq!(
            strokes(&window),
            1,
            "{place}: {:?}",
            window.state().desk.messages.texts()
        );
        if place == "3D view" {
            continue;
        }
        stroke(&mut window, (0.4, 0.62), (0.6, 0.62));
        let Source::Strokes(all) = &window.state().desk.studio.recipe().layers[1].source else {
            panic!()
        };
        let ends = all.strokes.iter().map(|s| match s.points() {
            Points::Uv(points) => [points[0].uv(), points[points.len() - 1].uv()],
            Points::Mesh(_) => panic!("it was painted on the map"),
        });
        let ends: Vec<_> = ends.collect();
        for end in 0..2 {
            let apart = ends[0][end].distance(ends[1][end]);
            assert!(apart < 1e-3, "as in frames of its own: {ends:?}");
        }
    }
}

#[test]
fn a_flick_of_the_light_within_one_slow_frame_moves_it_and_paints_nothing() {
    let (mut window, _folder) = window();
    let before = window.state().canvas.light;
    let rect = window.get_by_label("Paint canvas").rect();
    let ball = rect.right_top() + vec2(-38.0, 38.0);
    let end = ball + vec2(-15.0, 5.0);
    let press = |pos, pressed| Event::PointerButton {
        pos,
        button: eframe::egui::PointerButton::Primary,
        pressed,
        modifiers: Modifiers::NONE,
    };
    window.hover_at(ball);
    window.step();
    window.input_mut().events = vec![
        press(ball, true),
        Event::PointerMoved(end),
        press(end, false),
        Event::PointerMoved(rect.center()),
    ];
    window.step();
    settle(&mut window);
    let after = window.state().canvas.light;
    assert!(after != before && after.x < 0.0, "{before} {after}");
    assert_eq!(strokes(&window), 0);
    window.hover_at(rect.center_top());
    window.step();
    assert_eq!(window.state().canvas.light, after, "it was let go");
}

#[test]
fn keys_between_strokes_of_one_slow_frame_are_obeyed_in_their_turn() {
    let (mut window, _folder) = window();
    let rect = window.get_by_label("Paint canvas").rect();
    let mut events = Vec::new();
    let button = |pos, pressed| Event::PointerButton {
        pos,
        button: eframe::egui::PointerButton::Primary,
        pressed,
        modifiers: Modifiers::NONE,
    };
    for n in 0..3 {
        let at = |t: f32| rect.lerp_inside(vec2(0.35 + 0.3 * t, 0.4 + 0.1 * n as f32));
        events.extend([Event::PointerMoved(at(0.0)), button(at(0.0), true)]);
        events.extend((1..=4).map(|i| Event::PointerMoved(at(0.25 * i as f32))));
        events.push(button(at(1.0), false));
        events.extend([true, false].map(|pressed| Event::Key {
            key: Key::CloseBracket,
            physical_key: None,
            pressed,
            repeat: false,
            modifiers: Modifiers::NONE,
        }));
    }
    let mut turns = 0;
    while turns == 0 || window.state().turns.waits() {
        window.state_mut().turns.take(&mut events);
        window.input_mut().events = std::mem::take(&mut events);
        window.step();
        turns += 1;
    }
    land(&mut window);
    let Source::Strokes(all) = &window.state().desk.studio.recipe().layers[1].source else {
        panic!()
    };
    let radii: Vec<f32> = all.strokes.iter().map(|s| s.brush().radius).collect();
    assert_eq!(radii.len(), 3, "{turns} turns: {radii:?}");
    assert!(
        radii.is_sorted_by(|a, b| a < b),
        "each is larger: {radii:?}"
    );
}

#[test]
fn a_straight_drag_in_whole_pixels_lays_one_direction() {
    for place in ["Paint canvas", "3D view"] {
        let folder = tempfile::tempdir().unwrap();
        let text = SMALL.replace("size = 64", "size = 64\nmesh = \"plane\"");
        let mut window = window_of(app(folder.path(), &text), vec2(1200.0, 760.0));
        let rect = window.get_by_role_and_label(Role::Canvas, place).rect();
        let from = rect.lerp_inside(vec2(0.35, 0.45)).round();
        let way = vec2(150.0, 17.0);
        let places: Vec<Pos2> = (0..=20)
            .map(|i| (from + way * (i as f32 / 20.0)).round())
            .collect();
        drag(&mut window, &places);
        land(&mut window);
        let Source::Strokes(all) = &window.state().desk.studio.recipe().layers[1].source else {
            panic!()
        };
        assert_eq!(all.strokes.len(), 1, "{place}");
        let path: Vec<glam::Vec3> = match all.strokes[0].points() {
            Points::Uv(points) => points.iter().map(|p| p.uv().extend(0.0)).collect(),
            Points::Mesh(points) => (0..points.len()).map(|i| points.get(i).0).collect(),
        };
        let whole = path[path.len() - 1] - path[0];
        for pair in path.windows(2) {
            let off = (pair[1] - pair[0]).angle_between(whole).to_degrees();
            assert!(off < 0.5, "{place}: {off} degrees, {path:?}");
        }
    }
}

#[test]
fn ctrl_paints_the_inverse_and_shift_a_straight_line() {
    let (mut window, _folder) = window();
    stroke(&mut window, (0.35, 0.5), (0.6, 0.5));
    let after_first = map(&window);
    let rect = window.get_by_label("Paint canvas").rect();
    hold(&mut window, Modifiers::SHIFT);
    drag(&mut window, &[rect.lerp_inside(vec2(0.6, 0.7))]);
    hold(&mut window, Modifiers::NONE);
    window.step();
    assert_eq!(strokes(&window), 2);
    assert_ne!(map(&window), after_first);
    hold(&mut window, Modifiers::CTRL | Modifiers::COMMAND);
    stroke(&mut window, (0.35, 0.5), (0.6, 0.5));
    hold(&mut window, Modifiers::NONE);
    let layers = &window.state().desk.studio.recipe().layers;
    let Source::Strokes(all) = &layers[1].source else {
        panic!()
    };
    assert_eq!(all.strokes[2].brush().tool.name(), "erase");
}

#[test]
fn escape_takes_the_stroke_in_flight_away() {
    let (mut window, _folder) = window();
    let before = map(&window);
    let rect = window.get_by_label("Paint canvas").rect();
    window.drag_at(rect.lerp_inside(vec2(0.4, 0.5)));
    window.step();
    window.hover_at(rect.lerp_inside(vec2(0.6, 0.5)));
    window.step();
    assert!(window.state().canvas.is_drawing());
    press(&mut window, "Escape");
    assert!(!window.state().canvas.is_drawing());
    window.drop_at(rect.lerp_inside(vec2(0.6, 0.5)));
    window.step();
    assert!(strokes(&window) == 0 && map(&window) == before);
}

#[test]
fn a_stroke_on_a_pattern_gets_a_layer_and_one_that_paints_nothing_leaves_none() {
    let (mut window, _folder) = window();
    let state = |window: &Window| {
        let studio = &window.state().desk.studio;
        let names = studio.recipe().layers.iter().map(|l| l.name().to_owned());
        (names.collect::<Vec<_>>(), studio.selected())
    };
    window.state_mut().desk.studio.select(0);
    settle(&mut window);
    let before = state(&window);
    // A click gives no direction.
    stroke(&mut window, (0.5, 0.5), (0.5, 0.5));
    settle(&mut window);
    assert_eq!((state(&window), strokes(&window)), (before.clone(), 0));
    let rect = window.get_by_label("Paint canvas").rect();
    window.drag_at(rect.lerp_inside(vec2(0.4, 0.5)));
    window.step();
    window.hover_at(rect.lerp_inside(vec2(0.6, 0.5)));
    window.step();
    assert_eq!(state(&window).0.len(), before.0.len() + 1);
    press(&mut window, "Escape");
    window.drop_at(rect.lerp_inside(vec2(0.6, 0.5)));
    window.step();
    settle(&mut window);
    assert_eq!((state(&window), strokes(&window)), (before.clone(), 0));
    stroke(&mut window, (0.3, 0.4), (0.6, 0.7));
    land(&mut window);
    settle(&mut window);
    assert_eq!(strokes(&window), 1);
    assert_eq!(
        state(&window),
        (vec!["ground".into(), "paint 2".into(), "paint".into()], 1)
    );
}

#[test]
fn a_parameter_is_changed_with_a_bar_and_by_typing() {
    let (mut window, _folder) = window();
    window.get_by_label("Layer ground").click();
    window.run_steps(2);
    let before = map(&window);
    let bar = window.get_by_label("Angle").rect();
    stroke_in(&mut window, bar, (0.5, 0.5), (0.75, 0.5));
    settle(&mut window);
    assert_ne!(map(&window), before);
    assert_eq!(
        window.state().desk.studio.history().len().0,
        1,
        "one drag is one step"
    );
    press(&mut window, "Ctrl+Z");
    settle(&mut window);
    assert!(map(&window) == before);
}

#[test]
fn every_key_of_every_action_reaches_it() {
    let (window, _folder) = window();
    let keymap = &window.state().desk.keymap;
    for action in Action::ALL {
        for chord in keymap.chords(*action) {
            let key = Key::from_name(&chord.key).unwrap_or_else(|| panic!("{chord} is a key"));
            assert_eq!(Key::from_name(key.name()), Some(key));
            assert_eq!(keymap.action(chord), Some(*action));
        }
    }
}

#[test]
fn every_action_can_be_done_at_any_time_without_harm() {
    let (mut window, _folder) = window();
    for action in Action::ALL.iter().filter(|a| **a != Action::Quit) {
        window.state_mut().desk.ask(*action);
        window.run_steps(3);
        window.state_mut().dialog = None;
        window.state_mut().desk.panels = true;
        window.state_mut().desk.panes = Panes::Both;
        settle(&mut window);
    }
}

#[test]
fn layers_are_added_hidden_duplicated_and_taken_away() {
    let (mut window, _folder) = window();
    let names = |w: &Window| {
        w.state()
            .desk
            .studio
            .recipe()
            .layers
            .iter()
            .map(|l| l.name().to_owned())
            .collect::<Vec<_>>()
    };
    press(&mut window, "Ctrl+J");
    settle(&mut window);
    assert_eq!(names(&window).len(), 3);
    press(&mut window, "Delete");
    settle(&mut window);
    assert_eq!(names(&window), ["ground", "paint"]);
    window.get_by_label("Visible ground").click();
    settle(&mut window);
    assert!(!window.state().desk.studio.recipe().layers[0].visible);
    press(&mut window, "Ctrl+[");
    settle(&mut window);
    assert_eq!(names(&window), ["paint", "ground"]);
}

#[test]
fn what_is_saved_is_what_generate_reads() {
    let (mut window, folder) = window();
    stroke(&mut window, (0.35, 0.5), (0.65, 0.6));
    let painted = map(&window);
    press(&mut window, "Ctrl+S");
    assert!(matches!(window.state().dialog, Some(Dialog::File(_))));
    let path = folder.path().join("saved.toml");
    field(&window, "Path").click();
    window.step();
    press(&mut window, "Ctrl+A");
    field(&window, "Path").type_text(&path.display().to_string());
    window.run_steps(2);
    button(&window, "Save");
    window.run_steps(3);
    assert!(
        !window.state().desk.studio.document().is_changed(),
        "{:?}",
        window.state().desk.messages.texts()
    );
    let file = RecipeFile::read(&path).unwrap();
    let recipe = file.recipe();
    let none = anisomap::progress::Progress::none();
    let made = recipe
        .prepare(recipe.size, &file.files(false), &none)
        .unwrap()
        .map(&none)
        .unwrap();
    let made = [made.alpha_x(), made.alpha_y(), made.cos2(), made.sin2()].concat();
    assert!(made == painted, "the saved recipe makes the same bytes");
}

#[test]
fn saving_where_nothing_can_be_saved_keeps_the_work() {
    let (mut window, folder) = window();
    stroke(&mut window, (0.35, 0.5), (0.65, 0.6));
    let file = folder.path().join("file");
    std::fs::write(&file, "x").unwrap();
    let ctx = window.ctx.clone();
    window.state_mut().save(&ctx, &file.join("below.toml"));
    window.step();
    window.run_steps(3);
    let desk = &window.state().desk;
    assert!(desk.studio.document().is_changed());
    assert!(
        desk.messages
            .texts()
            .iter()
            .any(|t| t.contains("cannot write")),
        "{:?}",
        desk.messages.texts()
    );
    button(&window, "Close message");
    window.run_steps(2);
    assert!(window.state().desk.messages.texts().is_empty());
    assert_eq!(strokes(&window), 1);
}

#[test]
fn closing_with_work_that_is_not_saved_asks() {
    let (mut window, _folder) = window();
    stroke(&mut window, (0.35, 0.5), (0.65, 0.6));
    press(&mut window, "Ctrl+Q");
    assert!(matches!(window.state().dialog, Some(Dialog::Unsaved(_))));
    button(&window, "Cancel");
    window.run_steps(2);
    assert!(window.state().dialog.is_none());
    assert_eq!(strokes(&window), 1);
}

#[test]
fn work_that_was_left_behind_is_offered_and_taken_up() {
    let folder = tempfile::tempdir().unwrap();
    let painted = {
        let mut window = window_of(app(folder.path(), SMALL), vec2(1200.0, 760.0));
        stroke(&mut window, (0.35, 0.5), (0.65, 0.6));
        stroke(&mut window, (0.35, 0.4), (0.65, 0.45));
        map(&window)
        // Dropped without an end, as a program that is killed.
    };
    let mut window = window_of(app(folder.path(), SMALL), vec2(1200.0, 760.0));
    assert!(matches!(window.state().dialog, Some(Dialog::Recover(_))));
    button(&window, "Recover");
    window.run_steps(3);
    settle(&mut window);
    assert_eq!(strokes(&window), 2);
    assert!(map(&window) == painted);
    assert!(window.state().desk.studio.document().is_changed());
}

#[test]
fn an_export_writes_its_files_and_tells_what_was_lost() {
    let (mut window, folder) = window();
    let out = folder.path().join("out");
    export_to(&mut window, &out);
    assert!(
        out.join("small.exr").is_file(),
        "{:?}",
        std::fs::read_dir(&out).map(|d| d.flatten().map(|e| e.path()).collect::<Vec<_>>())
    );
    assert!(out.join("small.glb").is_file());
    window.get_by_label_contains("read back");
}

/// Exports into a folder by the dialog, which shows what came of it.
fn export_to(window: &mut Window, out: &Path) {
    press(window, "Ctrl+Shift+E");
    field(window, "Folder").click();
    window.step();
    press(window, "Ctrl+A");
    field(window, "Folder").type_text(&out.display().to_string());
    window.run_steps(2);
    button(window, "Export");
    wait_for_export(window);
}

fn wait_for_export(window: &mut Window) {
    for _ in 0..2000 {
        window.step();
        match &window.state().dialog {
            Some(Dialog::Export(export)) if !export.is_working() => break,
            _ => std::thread::sleep(Duration::from_millis(5)),
        }
    }
    window.step();
}

#[test]
fn an_export_asks_before_it_replaces_what_this_document_did_not_write() {
    let (mut window, folder) = window();
    let out = folder.path().join("out");
    std::fs::create_dir(&out).unwrap();
    std::fs::write(out.join("small.exr"), "another's").unwrap();
    export_to(&mut window, &out);
    // The dialog is smaller now, and comes to rest in the middle.
    window.run_steps(3);
    window.get_by_label_contains("there already");
    assert_eq!(std::fs::read(out.join("small.exr")).unwrap(), b"another's");
    assert!(!out.join("small.glb").exists());
    button(&window, "Replace it");
    wait_for_export(&mut window);
    window.get_by_label_contains(&format!("files in {}", out.display()));
    assert!(std::fs::read(out.join("small.exr")).unwrap().len() > 100);
    // The recipe's copy lies there, as generate leaves it.
    let copy = std::fs::read_to_string(out.join("small.toml")).unwrap();
    assert!(copy.starts_with(anisomap::generate::MARK));
    // Its own files are written again unasked.
    press(&mut window, "Escape");
    window.run_steps(2);
    stroke(&mut window, (0.35, 0.5), (0.65, 0.6));
    press(&mut window, "Ctrl+E");
    wait_for_export(&mut window);
    assert!(window.query_by_label_contains("there already").is_none());
    assert!(std::fs::read_to_string(out.join("small.toml")).unwrap() != copy);
}

#[test]
fn what_the_window_exports_is_what_generate_writes() {
    exports_as_generate_does(Precision::Half);
    exports_as_generate_does(Precision::Float);
}

fn exports_as_generate_does(precision: Precision) {
    let (mut window, folder) = window();
    let path = folder.path().join("small.toml");
    let ctx = window.ctx.clone();
    window.state_mut().save(&ctx, &path);
    let (out, other) = (folder.path().join("out"), folder.path().join("other"));
    let export = &mut window.state_mut().desk.settings.export;
    export.targets = anisomap::recipe::Target::ALL.to_vec();
    export.float = precision == Precision::Float;
    export_to(&mut window, &out);
    let file = RecipeFile::read(&path).unwrap();
    let job = anisomap::generate::Job {
        stem: file.recipe().name.clone(),
        file,
        folder: other.clone(),
        formats: anisomap::recipe::Target::ALL.to_vec(),
        precision,
        mesh: None,
        allow_outside: false,
        readme: true,
        copies: false,
    };
    let made = job.make(&anisomap::generate::Unwatched).unwrap();
    assert!(made.files.len() > 18);
    for written in made.files {
        let name = written.path.file_name().unwrap();
        let ours = std::fs::read(out.join(name)).unwrap();
        assert!(ours == std::fs::read(&written.path).unwrap(), "{name:?}");
    }
}

#[test]
fn a_preset_opens_as_a_document() {
    let (mut window, _folder) = window();
    press(&mut window, "Ctrl+P");
    window.run_steps(2);
    window.get_by_label("Preset canvas").click();
    window.run_steps(2);
    button(&window, "Open as a new document");
    window.run_steps(3);
    settle(&mut window);
    assert_eq!(window.state().desk.studio.recipe().name, "canvas");
}

#[test]
fn a_preset_that_is_looked_for_comes_as_layers_in_one_step() {
    let (mut window, _folder) = window();
    press(&mut window, "Ctrl+P");
    window.run_steps(2);
    field(&window, "Search").type_text("vinyl");
    window.run_steps(2);
    assert!(window.query_by_label("Preset canvas").is_none());
    window.get_by_label("Preset vinyl record").click();
    window.run_steps(2);
    window.get_by_label_contains(
        anisomap::recipe::preset("vinyl_record")
            .unwrap()
            .description(),
    );
    let before = window.state().desk.studio.recipe().clone();
    window.state_mut().desk.studio.select(0);
    button(&window, "Add as layers");
    window.run_steps(3);
    settle(&mut window);
    let studio = &mut window.state_mut().desk.studio;
    let preset = anisomap::recipe::preset("vinyl_record")
        .unwrap()
        .recipe()
        .unwrap();
    let added = preset.recipe().layers.len();
    let after = studio.recipe().layers.clone();
    assert_eq!(after.len(), before.layers.len() + added);
    // Above the selected one, in their order, and the rest over them.
    assert_eq!(after[1].source, preset.recipe().layers[0].source);
    assert_eq!(after.last().unwrap().name(), "paint");
    assert_eq!(studio.selected(), added);
    assert!(studio.undo().unwrap());
    assert_eq!(*studio.recipe(), before);
}

#[test]
fn the_window_stays_still_when_nothing_happens() {
    let (mut window, _folder) = window();
    // The picture gets better up to the reference; then nothing asks for another frame.
    for _ in 0..3000 {
        window.step();
        if window.state().desk.studio.viewport().quality().is_reference {
            break;
        }
        std::thread::sleep(Duration::from_millis(5));
    }
    assert!(window.state().desk.studio.viewport().quality().is_reference);
    window.run_steps(4);
    let delay = window
        .output()
        .viewport_output
        .values()
        .map(|v| v.repaint_delay)
        .min()
        .unwrap();
    assert!(delay > Duration::from_secs(3600), "{delay:?}");
}

#[test]
fn the_picker_gives_the_tool_before_it_back() {
    let (mut window, _folder) = window();
    press(&mut window, "K");
    press(&mut window, "V");
    assert_eq!(window.state().desk.hand.kind(), ToolKind::Pick);
    let at = window.get_by_label("Paint canvas").rect().center();
    window.hover_at(at);
    window.step();
    let probe = window.state().canvas.probe.clone().unwrap();
    window.drag_at(at);
    window.step();
    window.drop_at(at);
    window.run_steps(2);
    let hand = &window.state().desk.hand;
    assert_eq!(hand.kind(), ToolKind::Comb);
    press(&mut window, "B");
    match &window.state().desk.hand.brush().tool {
        anisomap::paint::Tool::Groove(groove) => assert_eq!(groove.along, probe.alpha_x),
        other => panic!("{other:?}"),
    }
}

#[test]
fn held_keys_tell_what_they_do() {
    let (mut window, _folder) = window();
    let canvas = window.get_by_label("Paint canvas").rect();
    let view = window.get_by_role_and_label(Role::Canvas, "3D view").rect();
    for (at, modifiers, wanted) in [
        (
            canvas.center(),
            Modifiers::CTRL | Modifiers::COMMAND,
            "erases",
        ),
        (canvas.center(), Modifiers::SHIFT, "straight line"),
        (canvas.center(), Modifiers::ALT, "move the map"),
        (view.center(), Modifiers::ALT, "turn"),
        (view.center(), Modifiers::SHIFT, "turn the lights"),
    ] {
        window.hover_at(at);
        hold(&mut window, modifiers);
        window.step();
        let shown = texts(&window);
        assert!(
            shown.iter().any(|t| t.contains(wanted)),
            "{wanted}: {shown:?}"
        );
        hold(&mut window, Modifiers::NONE);
        window.step();
    }
}

/// Every text that is painted.
fn texts(window: &Window) -> Vec<String> {
    fn of(shape: &eframe::egui::Shape, found: &mut Vec<String>) {
        match shape {
            eframe::egui::Shape::Text(text) => found.push(text.galley.text().to_owned()),
            eframe::egui::Shape::Vec(shapes) => shapes.iter().for_each(|s| of(s, found)),
            _ => {}
        }
    }
    let mut found = Vec::new();
    for clipped in &window.output().shapes {
        of(&clipped.shape, &mut found);
    }
    found
}

#[test]
fn the_hint_fits_what_is_open_and_never_comes_back() {
    let folder = tempfile::tempdir().unwrap();
    let mut first = app(folder.path(), SMALL);
    first.desk.settings.hint_closed = false;
    let mut window = window_of(first, vec2(1200.0, 760.0));
    window.get_by_label_contains("Turn the torus");
    button(&window, "Close hint");
    window.run_steps(2);
    assert!(window.query_by_label_contains("Turn the torus").is_none());
    let (settings, _) = Settings::load(&Folders::below(folder.path()).settings());
    assert!(settings.hint_closed);
}

#[test]
fn a_file_that_another_program_changes_is_read_again_and_looks_as_before() {
    let (mut window, folder) = window();
    let path = folder.path().join("watched.toml");
    let ctx = window.ctx.clone();
    window.state_mut().save(&ctx, &path);
    window.state_mut().canvas.zoom_by(2.0);
    window.step();
    let zoom = window.state().canvas.zoom();
    let mut scene = window.state().desk.studio.scene().clone();
    scene.camera.eye *= 1.5;
    window.state_mut().desk.studio.set_scene(scene.clone());
    let text = std::fs::read_to_string(&path)
        .unwrap()
        .replace("angle = 30", "angle = 75");
    std::fs::write(&path, text).unwrap();
    for _ in 0..400 {
        window.step();
        if window
            .state()
            .desk
            .messages
            .texts()
            .iter()
            .any(|t| t.contains("read again"))
        {
            break;
        }
        std::thread::sleep(Duration::from_millis(10));
    }
    settle(&mut window);
    let recipe = format!("{:?}", window.state().desk.studio.recipe().layers[0].source);
    assert!(recipe.contains("75"), "{recipe}");
    assert_eq!(window.state().canvas.zoom(), zoom);
    assert_eq!(window.state().desk.studio.scene().camera, scene.camera);
}

#[test]
fn changed_keys_are_read_while_the_window_is_open() {
    let (mut window, folder) = window();
    std::fs::write(folder.path().join("keys.toml"), "[keys]\ntool_comb = 'Z'\n").unwrap();
    for _ in 0..400 {
        window.step();
        if window.state().desk.keymap.keys_text(Action::ToolComb) == "Z" {
            break;
        }
        std::thread::sleep(Duration::from_millis(10));
    }
    press(&mut window, "Z");
    assert_eq!(window.state().desk.hand.kind(), ToolKind::Comb);
}

#[test]
fn a_file_that_was_changed_elsewhere_is_not_written_over_unasked() {
    let (mut window, folder) = window();
    let path = folder.path().join("shared.toml");
    let ctx = window.ctx.clone();
    window.state_mut().save(&ctx, &path);
    stroke(&mut window, (0.35, 0.5), (0.65, 0.6));
    let theirs = format!("{SMALL}# theirs\n");
    std::fs::write(&path, &theirs).unwrap();
    press(&mut window, "Ctrl+S");
    assert!(matches!(window.state().dialog, Some(Dialog::Changed(_))));
    button(&window, "Cancel");
    window.run_steps(2);
    assert_eq!(std::fs::read_to_string(&path).unwrap(), theirs);
    press(&mut window, "Ctrl+S");
    button(&window, "Save over it");
    window.run_steps(2);
    assert!(std::fs::read_to_string(&path).unwrap().contains("packed"));
    assert!(!window.state().desk.studio.document().is_changed());
}

#[test]
fn a_closing_that_was_called_off_does_not_wait_for_the_next_saving() {
    let (mut window, folder) = window();
    stroke(&mut window, (0.35, 0.5), (0.65, 0.6));
    press(&mut window, "Ctrl+Q");
    button(&window, "Save");
    window.run_steps(2);
    assert!(matches!(window.state().dialog, Some(Dialog::File(_))));
    press(&mut window, "Escape");
    window.run_steps(2);
    assert!(window.state().dialog.is_none());
    press(&mut window, "Ctrl+Shift+S");
    let path = folder.path().join("kept.toml");
    let ctx = window.ctx.clone();
    window.state_mut().save(&ctx, &path);
    assert!(path.exists() && !window.state().is_closing());
}

#[test]
fn a_mask_is_painted() {
    let (mut window, _folder) = window();
    let before = map(&window);
    window.state_mut().desk.studio.select(0);
    window.step();
    window
        .get_by_role_and_label(Role::ComboBox, "Mask")
        .scroll_to_me();
    window.run_steps(5);
    let combo = window
        .get_by_role_and_label(Role::ComboBox, "Mask")
        .rect()
        .center();
    window.hover_at(combo);
    window.step();
    window.drag_at(combo);
    window.step();
    window.drop_at(combo);
    window.run_steps(3);
    button(&window, "painted, all hidden");
    window.run_steps(3);
    settle(&mut window);
    assert!(map(&window) != before, "all of the ground is hidden");
    assert!(window.state().desk.studio.is_mask_selected());
    let hidden = map(&window);
    stroke(&mut window, (0.35, 0.5), (0.65, 0.6));
    assert_eq!(strokes(&window), 0, "the stroke went to the mask");
    // The bar has what acts there, and a thumbnail says where strokes go.
    assert!(window.query_by_label("Along").is_none());
    assert!(
        window
            .query_by_role_and_label(Role::RadioButton, "Mask Show")
            .is_some()
    );
    press(&mut window, "8");
    window.run_steps(3);
    button(&window, "Paint on the layer ground");
    window.run_steps(2);
    assert!(!window.state().desk.studio.is_mask_selected());
    button(&window, "Paint on the mask of ground");
    window.run_steps(2);
    assert!(window.state().desk.studio.is_mask_selected());
    assert!(map(&window) != hidden);
    press(&mut window, "Ctrl+Z");
    settle(&mut window);
    assert!(map(&window) == hidden);
}

#[test]
fn the_map_goes_on_to_fit_until_somebody_moves_it() {
    let (mut window, _folder) = window();
    let fitted = window.state().canvas.zoom();
    press(&mut window, "F3");
    window.step();
    let alone = window.state().canvas.zoom();
    assert!(alone > 1.05 * fitted, "with more room: {fitted} {alone}");
    window.set_size(vec2(900.0, 500.0));
    window.run_steps(2);
    let small = window.state().canvas.zoom();
    assert!(small < alone, "{alone} {small}");
    press(&mut window, "Ctrl+Equals");
    let moved = window.state().canvas.zoom();
    window.set_size(vec2(1300.0, 800.0));
    window.run_steps(2);
    assert_eq!(window.state().canvas.zoom(), moved, "as the user left it");
    press(&mut window, "0");
    window.step();
    let again = window.state().canvas.zoom();
    window.set_size(vec2(900.0, 500.0));
    window.run_steps(2);
    assert!(window.state().canvas.zoom() < again);
}

#[test]
fn the_first_stroke_closes_the_hint_which_stays_out_of_other_views() {
    let folder = tempfile::tempdir().unwrap();
    let mut first = app(folder.path(), SMALL);
    first.desk.settings.hint_closed = false;
    let mut window = window_of(first, vec2(1200.0, 760.0));
    window.get_by_label_contains("middle button: Edit > Settings");
    press(&mut window, "5");
    window.step();
    assert!(window.query_by_label_contains("Turn the torus").is_none());
    press(&mut window, "1");
    stroke(&mut window, (0.35, 0.6), (0.65, 0.7));
    window.step();
    assert!(window.query_by_label_contains("Turn the torus").is_none());
    let (settings, _) = Settings::load(&Folders::below(folder.path()).settings());
    assert!(settings.hint_closed);
}

#[test]
fn what_has_no_room_in_a_narrow_3d_strip_is_in_its_menu() {
    let (mut window, _folder) = window();
    window.set_size(vec2(900.0, 600.0));
    window.run_steps(3);
    let view = window.get_by_role_and_label(Role::Canvas, "3D view").rect();
    for name in [
        "Mesh",
        "Model",
        "Lights",
        "Frame all",
        "More of the 3D view",
    ] {
        if let Some(node) = window.query_by_label(name) {
            let rect = node.rect();
            assert!(view.x_range().contains(rect.left()), "{name}: {rect:?}");
            assert!(view.x_range().contains(rect.right()), "{name}: {rect:?}");
        }
    }
    button(&window, "More of the 3D view");
    window.run_steps(2);
    window
        .get_by_role_and_label(Role::RadioButton, "Show Side by side")
        .click();
    window.run_steps(3);
    let show = window.state().desk.studio.viewport().show();
    assert!(matches!(show, anisomap::studio::Show::Pair(..)), "{show:?}");
}

#[test]
fn a_new_document_has_the_aspect_of_its_mesh() {
    let (mut window, _folder) = window();
    press(&mut window, "Ctrl+N");
    for (mesh, aspect) in [("Cylinder", "3.14"), ("Torus", "2.38")] {
        window
            .get_by_role_and_label(Role::RadioButton, &format!("Mesh {mesh}"))
            .click();
        window.run_steps(2);
        let shown = texts(&window);
        assert!(shown.iter().any(|t| t == aspect), "{mesh}: {shown:?}");
    }
    button(&window, "Begin");
    window.run_steps(3);
    settle(&mut window);
    let recipe = window.state().desk.studio.recipe();
    assert_eq!(recipe.aspect, Some(2.381));
    assert_eq!(recipe.mesh.as_deref(), Some("torus"));
    press(&mut window, "Ctrl+N");
    window
        .get_by_role_and_label(Role::RadioButton, "Mesh Own\u{2026}")
        .click();
    window.run_steps(2);
    button(&window, "Begin");
    window.run_steps(3);
    assert!(
        matches!(window.state().dialog, Some(Dialog::File(_))),
        "the mesh is asked for"
    );
}

#[test]
fn the_history_goes_back_to_the_document_as_it_was_opened() {
    let (mut window, _folder) = window();
    stroke(&mut window, (0.35, 0.5), (0.65, 0.6));
    press(&mut window, "H");
    press(&mut window, "Ctrl+J");
    settle(&mut window);
    press(&mut window, "Ctrl+H");
    window.step();
    let shown = texts(&window);
    for wanted in [
        "Groove stroke: paint",
        "Hide layer: paint",
        "Duplicate layer: paint",
        "Opened",
    ] {
        assert!(shown.iter().any(|t| t == wanted), "{wanted}: {shown:?}");
    }
    button(&window, "Opened");
    window.run_steps(2);
    settle(&mut window);
    assert_eq!(strokes(&window), 0);
    assert_eq!(window.state().desk.studio.history().len(), (0, 3));
    button(&window, "Duplicate layer: paint");
    window.run_steps(2);
    assert_eq!(window.state().desk.studio.history().len(), (3, 0));
}

#[test]
fn both_pictures_share_the_pointer() {
    let (mut window, _folder) = window();
    let canvas = window.get_by_label("Paint canvas").rect();
    let view = window.get_by_role_and_label(Role::Canvas, "3D view").rect();
    // On the front of the torus, and not in its hole.
    window.hover_at(view.lerp_inside(vec2(0.5, 0.68)));
    window.run_steps(3);
    let uv = window.state().desk.on_mesh.expect("the mesh is under it");
    assert_eq!(window.state().desk.on_map, None);
    // The same place of the map is seen where the pointer was.
    let places = window.state().desk.studio.seen_at(uv);
    let at = view.lerp_inside(vec2(0.5, 0.68)) - view.min;
    assert!(
        places.iter().any(|p| (p.x - at.x).hypot(p.y - at.y) < 2.0),
        "{places:?}, and not {at:?}"
    );
    window.hover_at(canvas.center());
    window.run_steps(3);
    assert_eq!(window.state().desk.on_mesh, None);
    let uv = window.state().desk.on_map.expect("the map is under it");
    assert!(
        (uv.x - 0.5).abs() < 0.02 && (uv.y - 0.5).abs() < 0.02,
        "{uv}"
    );
}

#[test]
fn a_click_on_a_bar_types_its_number() {
    let (mut window, _folder) = window();
    let size = window.get_by_role_and_label(Role::Slider, "Size").rect();
    window.drag_at(size.center());
    window.step();
    window.drop_at(size.center());
    window.run_steps(3);
    field(&window, "Size").type_text("0.2");
    window.run_steps(2);
    press(&mut window, "Enter");
    window.run_steps(2);
    let radius = window.state().desk.hand.brush().radius;
    assert!((radius - 0.1).abs() < 1e-6, "{radius}");
}

#[test]
fn enter_does_what_most_people_want_of_a_dialog() {
    let (mut window, _folder) = window();
    press(&mut window, "Ctrl+N");
    window.run_steps(2);
    press(&mut window, "Enter");
    window.run_steps(3);
    settle(&mut window);
    assert!(window.state().dialog.is_none());
    assert_eq!(window.state().desk.studio.recipe().name, "untitled");
    // The keys are the window's again.
    press(&mut window, "K");
    assert_eq!(window.state().desk.hand.kind(), ToolKind::Comb);
}
