//! Every key of every action, pressed: what it changes, and not merely that nothing breaks.

use super::*;
use crate::gui::properties::Leaf;
use anisomap::recipe::Recipe;
use anisomap::studio::hand::{Hand, Mirror};
use anisomap::studio::settings::Theme;
use anisomap::studio::{Show, Studio};
use eframe::egui::ViewportCommand;
use std::mem::discriminant;

/// A ground and two paint layers, a stroke on each; the upper one is selected.
const STACK: &str = "version = 1
name = \"stack\"
size = 64
[[layers]]
name = \"ground\"
[layers.brushed]
[[layers]]
name = \"lower\"
[layers.strokes]
[[layers]]
name = \"upper\"
[layers.strokes]
";

/// What a key may change.
struct Seen {
    recipe: Recipe,
    hand: Hand,
    history: (usize, usize),
    selected: usize,
    solo: Option<usize>,
    kind: Kind,
    zoom: f64,
    wrap: bool,
    outlines: bool,
    show: Show,
    exposure: f32,
    eye: [f32; 3],
    lights: usize,
    timings: bool,
    panes: Panes,
    panels: bool,
    leaf: Leaf,
    theme: Theme,
    scale: f32,
    focused: bool,
    renaming: bool,
    adjusting: bool,
    drawing: bool,
    dialog: Option<std::mem::Discriminant<Dialog>>,
}

fn see(window: &Window) -> Seen {
    let app = window.state();
    let studio: &Studio = &app.desk.studio;
    Seen {
        recipe: studio.recipe().clone(),
        hand: app.desk.hand.clone(),
        history: studio.history().len(),
        selected: studio.selected(),
        solo: studio.solo(),
        kind: app.canvas.kind,
        zoom: app.canvas.zoom(),
        wrap: app.canvas.wrap,
        outlines: app.canvas.shows_outlines(&app.desk),
        show: studio.viewport().show(),
        exposure: studio.scene().exposure,
        eye: studio.scene().camera.eye.into(),
        lights: studio.scene().lights.len(),
        timings: app.desk.stages.shown,
        panes: app.desk.panes,
        panels: app.desk.panels,
        leaf: app.properties.leaf,
        theme: app.desk.settings.theme,
        scale: app.desk.settings.scale,
        focused: window.ctx.memory(|m| m.focused().is_some()),
        renaming: app.layers.is_renaming(),
        adjusting: app.desk.adjusting.is_some(),
        drawing: app.canvas.is_drawing(),
        dialog: app.dialog.as_ref().map(discriminant),
    }
}

fn names(recipe: &Recipe) -> Vec<&str> {
    recipe.layers.iter().map(|l| l.name()).collect()
}

/// Presses a chord; gives what the window asked the system for.
fn press_and_listen(window: &mut Window, chord: &Chord) -> Vec<ViewportCommand> {
    let (modifiers, key) = key_of(chord);
    let mut commands = Vec::new();
    for pressed in [true, false] {
        // Straight into one frame: what that asks for would be forgotten with the next.
        window.input_mut().events.push(Event::Key {
            key,
            physical_key: None,
            pressed,
            repeat: false,
            modifiers,
        });
        window.step();
        let asked = window.output().viewport_output.values();
        commands.extend(asked.flat_map(|v| v.commands.iter().cloned()));
    }
    commands
}

/// Brings the window to where an action has something to do.
fn prepare(window: &mut Window, action: Action) {
    let rect = window.get_by_label("Paint canvas").rect();
    let app = window.state_mut();
    match action {
        Action::Redo => assert!(app.desk.studio.undo().unwrap()),
        Action::Cancel => {
            window.drag_at(rect.lerp_inside(vec2(0.4, 0.5)));
            window.step();
            window.hover_at(rect.lerp_inside(vec2(0.6, 0.5)));
            window.step();
            assert!(window.state().canvas.is_drawing());
        }
        Action::RaiseLayer | Action::SelectAbove => app.desk.studio.select(1),
        Action::FlowUp => app.desk.hand.change_flow(-5.0),
        Action::ToolGroove => app.desk.hand.take(ToolKind::Comb),
        Action::View1 | Action::ViewLit => app.canvas.kind = Kind::Ratio,
        Action::ShowBoth => app.desk.panes = Panes::Canvas,
        Action::CanvasFit => app.canvas.zoom_by(3.0),
        Action::FrameAll | Action::ResetLight => {
            let mut scene = app.desk.studio.scene().clone();
            scene.camera.eye *= 2.0;
            scene.lights.clear();
            app.desk.studio.set_scene(scene);
        }
        Action::ExportAgain => {
            let out = app.desk.folders.as_ref().unwrap().config.join("out");
            app.desk.settings.export.folder = Some(out);
        }
        _ => {}
    }
    window.step();
    window.step();
}

#[test]
fn every_shortcut_does_what_its_action_says() {
    for action in Action::ALL {
        let folder = tempfile::tempdir().unwrap();
        let mut window = window_of(app(folder.path(), STACK), vec2(1200.0, 760.0));
        stroke(&mut window, (0.35, 0.4), (0.65, 0.5));
        window.state_mut().desk.studio.select(1);
        stroke(&mut window, (0.35, 0.6), (0.65, 0.5));
        window.state_mut().desk.studio.select(2);
        settle(&mut window);
        for chord in window.state().desk.keymap.chords(*action).to_vec() {
            prepare(&mut window, *action);
            let before = see(&window);
            let asked = press_and_listen(&mut window, &chord);
            settle(&mut window);
            let after = see(&window);
            check(*action, &before, &after, &asked, &window);
            // The next key of the same action finds the same.
            window.state_mut().dialog = None;
            window.step();
        }
    }
}

/// Whether an action did what it says. Every action has its arm: a new one does not compile without.
fn check(action: Action, a: &Seen, b: &Seen, asked: &[ViewportCommand], window: &Window) {
    let radius = |s: &Seen| s.hand.brush().radius;
    let hardness = |s: &Seen| s.hand.brush().hardness;
    let flow = |s: &Seen| s.hand.brush().flow;
    let opened = |wanted: fn(&Dialog) -> bool| window.state().dialog.as_ref().is_some_and(wanted);
    let tool = |kind| b.hand.kind() == kind;
    let view = |kind| b.kind == kind;
    let layers = |s: &Seen| s.recipe.layers.len();
    let done = match action {
        // The document has a stroke that is not saved.
        Action::New | Action::Quit => opened(|d| matches!(d, Dialog::Unsaved(_))),
        Action::Open | Action::Save | Action::SaveAs | Action::Import | Action::LoadMesh => {
            opened(|d| matches!(d, Dialog::File(_)))
        }
        Action::Presets => opened(|d| matches!(d, Dialog::Presets(_))),
        Action::Export | Action::ExportAgain => opened(|d| matches!(d, Dialog::Export(_))),
        Action::Undo => b.history == (a.history.0 - 1, 1) && a.recipe != b.recipe,
        Action::Redo => b.history == (a.history.0 + 1, 0) && a.recipe != b.recipe,
        Action::Cancel => a.drawing && !b.drawing && a.recipe == b.recipe,
        Action::Settings => opened(|d| matches!(d, Dialog::Settings)),
        Action::NewPaintLayer => {
            layers(b) == layers(a) + 1 && b.recipe.layers[b.selected].source.name() == "strokes"
        }
        Action::NewGuideLayer => {
            b.recipe.layers[b.selected].source.name() == "guides" && tool(ToolKind::Guide)
        }
        Action::DuplicateLayer => {
            layers(b) == layers(a) + 1
                && b.recipe.layers[3].source == b.recipe.layers[2].source
                && b.selected == 3
        }
        Action::MergeDown => names(&b.recipe) == ["ground", "lower"] && strokes(window) == 2,
        Action::DeleteLayer => names(&b.recipe) == ["ground", "lower"],
        Action::RenameLayer => b.renaming && !a.renaming,
        Action::RaiseLayer => names(&b.recipe) == ["ground", "upper", "lower"],
        Action::LowerLayer => names(&b.recipe) == ["ground", "upper", "lower"],
        Action::SelectAbove => (a.selected, b.selected) == (1, 2),
        Action::SelectBelow => (a.selected, b.selected) == (2, 1),
        Action::ToggleLayer => a.recipe.layers[2].visible && !b.recipe.layers[2].visible,
        Action::SoloLayer => a.solo.is_none() && b.solo == Some(2),
        Action::ToolGroove => tool(ToolKind::Groove) && a.hand.kind() != ToolKind::Groove,
        Action::ToolComb => tool(ToolKind::Comb),
        Action::ToolSmooth => tool(ToolKind::Smooth),
        Action::ToolRoughen => tool(ToolKind::Roughen),
        Action::ToolPolish => tool(ToolKind::Polish),
        Action::ToolSetAlpha => tool(ToolKind::SetAlpha),
        Action::ToolSetDirection => tool(ToolKind::SetDirection),
        Action::ToolErase => tool(ToolKind::Erase),
        Action::ToolFill => tool(ToolKind::Fill),
        Action::ToolPick => tool(ToolKind::Pick),
        Action::ToolScratch => tool(ToolKind::Scratch),
        Action::ToolGuide => tool(ToolKind::Guide),
        Action::SizeDown => radius(b) < radius(a),
        Action::SizeUp => radius(b) > radius(a),
        Action::HardnessDown => hardness(b) < hardness(a),
        Action::HardnessUp => hardness(b) > hardness(a),
        Action::FlowDown => flow(b) < flow(a),
        Action::FlowUp => flow(b) > flow(a),
        Action::DragSize | Action::DragFlow => b.adjusting && !a.adjusting,
        Action::SwapAlphas => {
            use anisomap::paint::Tool;
            let widths = |s: &Seen| match &s.hand.brush().tool {
                Tool::Groove(g) => (g.along, g.across),
                _ => panic!("the groove is in the hand"),
            };
            widths(b) == (widths(a).1, widths(a).0) && widths(a).0 != widths(a).1
        }
        Action::ToggleMirror => a.hand.mirror == Mirror::Off && b.hand.mirror == Mirror::U,
        Action::ToggleRadial => a.hand.copies == 0 && b.hand.copies == 6,
        Action::ToggleStabiliser => a.hand.stabiliser == 0.0 && b.hand.stabiliser > 0.0,
        Action::View1 | Action::ViewLit => view(Kind::Lit) && a.kind == Kind::Ratio,
        Action::View2 | Action::CycleView => view(Kind::AlphaX),
        Action::View3 => view(Kind::AlphaY),
        Action::View4 => view(Kind::Ratio),
        Action::View5 => view(Kind::Direction),
        Action::View6 => view(Kind::Grain),
        Action::View7 => view(Kind::Strokes),
        Action::View8 => view(Kind::Coverage),
        Action::View9 => view(Kind::Lint),
        Action::ToggleWrap => b.wrap && !a.wrap,
        Action::ToggleOutlines => b.outlines && !a.outlines,
        Action::CanvasFit => b.zoom < 0.5 * a.zoom,
        Action::ActualTexels => b.zoom == 1.0 && a.zoom != 1.0,
        Action::ZoomIn => b.zoom > a.zoom,
        Action::ZoomOut => b.zoom < a.zoom,
        Action::FrameAll => b.eye != a.eye,
        Action::NextMesh => b.recipe.mesh.as_deref() == Some("pot"),
        Action::NextModel => a.show != b.show && matches!(b.show, Show::One(_)),
        Action::Compare => matches!(b.show, Show::Pair(..)),
        Action::Difference => matches!(b.show, Show::Difference(..)),
        Action::ExposureDown => b.exposure < a.exposure,
        Action::ExposureUp => b.exposure > a.exposure,
        Action::ResetLight => a.lights == 0 && b.lights > 0,
        Action::ToggleTimings => !a.timings && b.timings,
        Action::Shortcuts => opened(|d| matches!(d, Dialog::Shortcuts(_))),
        Action::ShowBoth => a.panes == Panes::Canvas && b.panes == Panes::Both,
        Action::ShowCanvas => b.panes == Panes::Canvas,
        Action::ShowViewport => b.panes == Panes::Viewport,
        Action::FocusControls => !a.focused && b.focused,
        Action::TogglePanels => a.panels && !b.panels,
        Action::ToggleHistory => b.leaf == Leaf::History && a.leaf != Leaf::History,
        Action::ToggleTheme => a.theme == Theme::Dark && b.theme == Theme::Light,
        Action::FullScreen => asked.contains(&ViewportCommand::Fullscreen(true)),
        Action::ScaleUp => b.scale > a.scale,
        Action::ScaleDown => b.scale < a.scale,
    };
    let keys = window.state().desk.keymap.keys_text(action);
    let told = window.state().desk.messages.texts().join("; ");
    assert!(done, "{} ({keys}); {told}", action.name());
    // Views, tools and panels are no matter of the document.
    let is_edit = matches!(action, Action::Undo | Action::Redo | Action::NextMesh)
        || action.group() == anisomap::studio::action::Group::Layer;
    assert!(
        is_edit || a.recipe == b.recipe,
        "{} changed the document",
        action.name()
    );
    assert!(a.dialog.is_none());
}
