//! Every control says what it does and by which key it is done, where the pointer rests on it and to screen readers.

use super::*;
use crate::gui::desk::{Large, LargeThing};
use crate::gui::dialogs::Then;
use crate::gui::export::ExportDialog;
use crate::gui::files::{FileDialog, Purpose};
use crate::gui::import::{ImportDialog, look_at};
use crate::gui::intake::Part;
use crate::gui::properties::Leaf;
use anisomap::convention::textures::Convention;
use anisomap::guide::{Mode, Shape};
use anisomap::pattern::Pattern;
use anisomap::recipe::{Mask, MaskSource};
use anisomap::studio::keymap::Keymap;
use anisomap::studio::parameters::default_pattern;
use eframe::egui::accesskit::{Action as Deed, NodeId};
use egui_kittest::kittest::NodeT;
use std::collections::{BTreeSet, HashSet};
use std::path::PathBuf;

/// Something that a user acts on, as screen readers know it.
#[derive(Clone, Debug)]
pub(super) struct Control {
    pub(super) id: NodeId,
    pub(super) role: Role,
    pub(super) name: String,
    tip: String,
}

pub(super) fn controls(window: &Window) -> Vec<Control> {
    let nodes = window.query_all_by(|node| node.data().supports_action(Deed::Focus));
    let control = |node: egui_kittest::Node<'_>| {
        let node = node.accesskit_node();
        Control {
            id: node.locate().0,
            role: node.role(),
            name: node.label().unwrap_or_default(),
            tip: node.data().description().unwrap_or_default().to_owned(),
        }
    };
    nodes.map(control).collect()
}

/// The actions whose work a control does: those that are called as it is, and those that change the same.
fn actions(control: &Control, keymap: &Keymap, in_dialog: bool) -> Vec<Action> {
    let name = control.name.as_str();
    let is_called = |action: &Action| {
        let key = keymap.chords(*action).first().map(Chord::to_string);
        let in_menu = format!("{} {}", action.name(), key.unwrap_or_default());
        name == action.name() || name == in_menu
    };
    // In a dialog `Save` is an answer, and `Smooth` a guide's mode in the list of those.
    let by_name = matches!(control.role, Role::Button | Role::Tab)
        && !in_dialog
        && !control.tip.contains("the field closes smoothly");
    let named = Action::ALL.iter().copied().filter(is_called);
    let mut actions: Vec<Action> = named.filter(|_| by_name).collect();
    let begins = |start: &str| name.starts_with(start);
    actions.extend_from_slice(match control.role {
        Role::Slider => match name {
            "Size" => &[Action::SizeDown, Action::SizeUp, Action::DragSize],
            "Hardness" => &[Action::HardnessDown, Action::HardnessUp],
            "Flow" => &[Action::FlowDown, Action::FlowUp, Action::DragFlow],
            "Stabiliser" => &[Action::ToggleStabiliser],
            "Copies around the middle" => &[Action::ToggleRadial],
            "Exposure" => &[Action::ExposureDown, Action::ExposureUp],
            _ => &[],
        },
        Role::RadioButton if begins("Mirror ") => &[Action::ToggleMirror],
        Role::RadioButton if begins("Show ") => &[Action::Compare, Action::Difference],
        Role::RadioButton if begins("Theme ") => &[Action::ToggleTheme],
        Role::RadioButton if begins("Scale ") => &[Action::ScaleUp, Action::ScaleDown],
        Role::ComboBox => match name {
            "View" => &[Action::CycleView],
            "Mesh" => &[Action::NextMesh],
            "Model" => &[Action::NextModel],
            "One model, two, or their difference" => &[Action::Compare, Action::Difference],
            _ => &[],
        },
        Role::Button => match name {
            "Lights" => &[Action::ResetLight],
            "Add layer" => &[Action::NewPaintLayer, Action::NewGuideLayer],
            "Side by side" => &[Action::Compare],
            _ if begins("Visible ") => &[Action::ToggleLayer],
            _ if begins("Paint on the mask ") => &[Action::View8],
            _ if begins("Delete guide ") => &[Action::DeleteLayer],
            _ => &[],
        },
        Role::ListItem if begins("Layer ") && !begins("Layer told") => &[
            Action::SelectAbove,
            Action::SelectBelow,
            Action::RenameLayer,
        ],
        _ => &[],
    });
    actions
}

/// Goes through the window's states, and notes what is wrong with any control.
struct Walk {
    /// What was pointed at already: the same control of another state is not pointed at again.
    met: HashSet<(Role, String, String)>,
    /// Lists that were opened already.
    opened: HashSet<String>,
    /// Controls that lie below the dialog which is open.
    below: HashSet<NodeId>,
    told: BTreeSet<Action>,
    wrong: BTreeSet<String>,
}

impl Walk {
    fn new() -> Self {
        Self {
            met: HashSet::new(),
            opened: HashSet::new(),
            below: HashSet::new(),
            told: BTreeSet::new(),
            wrong: BTreeSet::new(),
        }
    }

    /// Looks at every control that can be reached in this state, and at those in lists that open.
    fn go(&mut self, window: &mut Window, place: &str) {
        let all = self.reachable(window);
        assert!(!all.is_empty(), "{place}: no control was found");
        self.look(window, place, &all);
        for list in all.iter().filter(|c| c.role == Role::ComboBox) {
            if self.opened.insert(list.name.clone()) {
                self.open(window, &format!("{place}, {}", list.name), list.id);
            }
        }
        if window.state().dialog.is_none() {
            self.below = controls(window).iter().map(|c| c.id).collect();
        }
    }

    fn reachable(&self, window: &Window) -> Vec<Control> {
        let in_dialog = window.state().dialog.is_some();
        let all = controls(window).into_iter();
        all.filter(|c| !in_dialog || !self.below.contains(&c.id))
            .collect()
    }

    /// Opens what a control opens, looks at what comes, and closes it again.
    fn open(&mut self, window: &mut Window, place: &str, id: NodeId) {
        let before: HashSet<NodeId> = controls(window).iter().map(|c| c.id).collect();
        click(window, id);
        let mut came = controls(window);
        came.retain(|c| !before.contains(&c.id));
        if came.is_empty() {
            self.wrong.insert(format!("{place}: nothing opens"));
        }
        self.look(window, place, &came);
        click(window, id);
    }

    fn look(&mut self, window: &mut Window, place: &str, all: &[Control]) {
        let in_dialog = window.state().dialog.is_some();
        let mut choices = HashSet::new();
        for control in all {
            let Control {
                role, name, tip, ..
            } = control;
            let mut wrong = |what: &str| {
                self.wrong
                    .insert(format!("{place}: {role:?} `{name}` {what}: {tip}"));
            };
            if *role == Role::Unknown || name.trim().is_empty() {
                wrong("has no name");
            }
            if tip.trim().is_empty() {
                wrong("says nothing");
                continue;
            }
            let keymap = &window.state().desk.keymap;
            let actions = actions(control, keymap, in_dialog);
            if let Some(action) = actions
                .iter()
                .find(|a| !tip.contains(&keymap.keys_text(**a)))
            {
                wrong(&format!("does not tell the key of {}", action.name()));
            }
            if old_key(tip, keymap) {
                wrong("tells a key that nobody set");
            }
            if *role == Role::RadioButton && !choices.insert(tip.clone()) {
                wrong("says the same as another choice");
            }
            self.told.extend(actions);
            // Over a picture a tooltip would hide what is painted on.
            let is_new = self.met.insert((*role, name.clone(), tip.clone()));
            if is_new && *role != Role::Canvas {
                self.point(window, place, control);
            }
        }
    }

    /// Rests the pointer on a control: that shows its tip, or opens its list.
    fn point(&mut self, window: &mut Window, place: &str, control: &Control) {
        let before: HashSet<NodeId> = controls(window).iter().map(|c| c.id).collect();
        let shows = shows_tip(window, control);
        let mut came = controls(window);
        came.retain(|c| !before.contains(&c.id));
        let Control {
            role, name, tip, ..
        } = control;
        if !shows && came.is_empty() {
            self.wrong
                .insert(format!("{place}: {role:?} `{name}` does not show: {tip}"));
        }
        self.look(window, &format!("{place}, {name}"), &came);
    }

    /// Opens a dialog over the window as it is, and looks at it.
    fn dialog(&mut self, window: &mut Window, place: &str, dialog: Dialog) {
        window.state_mut().dialog = None;
        window.run_steps(2);
        self.below = controls(window).iter().map(|c| c.id).collect();
        window.state_mut().dialog = Some(dialog);
        window.run_steps(4);
        self.go(window, place);
    }

    #[track_caller]
    fn end(self) -> BTreeSet<Action> {
        let wrong: Vec<&str> = self.wrong.iter().map(String::as_str).collect();
        assert!(wrong.is_empty(), "{}", wrong.join("\n"));
        self.told
    }
}

/// Whether a tip tells one of the default keys, while all keys are others.
fn old_key(tip: &str, keymap: &Keymap) -> bool {
    let mut rest = tip.to_owned();
    for action in Action::ALL {
        rest = rest.replace(&keymap.keys_text(*action), "");
    }
    let defaults = Keymap::default();
    let chords = Action::ALL.iter().flat_map(|a| defaults.chords(*a));
    // A letter alone may be a word, and a dialog's Escape is nobody's to change.
    let is_function = |key: &str| key.len() > 1 && key.starts_with('F');
    let mut telling = chords.filter(|c| c.ctrl || c.shift || is_function(&c.key));
    telling.any(|chord| tells(&rest, &chord.to_string()))
}

/// Whether a key stands in a text, and not as a part of another.
fn tells(text: &str, key: &str) -> bool {
    text.match_indices(key).any(|(at, _)| {
        let before = text[..at].chars().next_back();
        let after = text[at + key.len()..].chars().next();
        before.is_none_or(|c| !c.is_alphanumeric() && c != '+')
            && after.is_none_or(|c| !c.is_alphanumeric())
    })
}

pub(super) fn node(window: &Window, id: NodeId) -> Option<egui_kittest::Node<'_>> {
    window
        .query_all_by(move |node| node.locate().0 == id)
        .next()
}

fn click(window: &mut Window, id: NodeId) {
    if let Some(node) = node(window, id) {
        node.click_accesskit();
    }
    window.run_steps(3);
}

/// Whether the tip is there once the pointer rests on the control.
fn shows_tip(window: &mut Window, control: &Control) -> bool {
    // The handle of a panel is half below the picture beside it.
    for (scroll, across) in [(false, 0.5), (true, 0.5), (false, 0.8)] {
        let Some(found) = node(window, control.id) else {
            return false;
        };
        if scroll {
            found.scroll_to_me();
            window.run_steps(3);
        }
        let Some(found) = node(window, control.id) else {
            return false;
        };
        let at = found.rect().lerp_inside(vec2(across, 0.5));
        window.hover_at(at);
        window.run_steps(3);
        if texts(window).contains(&control.tip) {
            return true;
        }
    }
    false
}

/// A keymap in which every action has another key than by default.
fn other_keys(folder: &Path) -> Keymap {
    let letters = ('A'..='Z').chain('0'..='9').map(|c| c.to_string());
    let keys: Vec<String> = letters.chain((1..=12).map(|n| format!("F{n}"))).collect();
    let chords = ["Ctrl+Alt+", "Alt+Shift+"]
        .iter()
        .flat_map(|held| keys.iter().map(move |key| format!("{held}{key}")));
    let lines = Action::ALL
        .iter()
        .zip(chords)
        .map(|(action, chord)| format!("{} = '{chord}'\n", action.word()));
    let path = folder.join("others.toml");
    std::fs::write(&path, format!("[keys]\n{}", lines.collect::<String>())).unwrap();
    let keymap = Keymap::load(&path).unwrap();
    assert!(Action::ALL.iter().all(|a| !keymap.chords(*a).is_empty()));
    keymap
}

/// A window with a layer of every kind, saved beside the files that it reads, all keys changed, and tips that come at once.
fn everything() -> (Window, TempDir) {
    let folder = tempfile::tempdir().unwrap();
    let grey = image::GrayImage::from_pixel(8, 8, image::Luma([128]));
    grey.save(folder.path().join("r.png")).unwrap();
    let mut text = String::from("version = 1\nname = 'all'\nsize = 64\n");
    for name in Pattern::NAMES {
        text += &format!("[[layers]]\nname = '{name}'\n[layers.{name}]\n");
    }
    for (name, file) in [
        ("told", "r.png"),
        ("told gone", "gone.png"),
        ("told far", "../far.png"),
    ] {
        text += &format!(
            "[[layers]]\nname = '{name}'\n[layers.image.textures]\nfirst.file = '{file}'\n"
        );
    }
    text += "[[layers]]\nname = 'guides'\n[layers.guides]\n";
    text += "[[layers]]\nname = 'paint'\n[layers.strokes]\n";
    let path = folder.path().join("all.toml");
    std::fs::write(&path, text).unwrap();
    let (file, settings) = (RecipeFile::read(&path).unwrap(), Settings::default());
    let folders = Folders::below(&folder.path().join("config"));
    let mut app = App::new((file, Some(path)), settings, Some(folders)).unwrap();
    app.desk.native_dialogs = false;
    let mut window = window_of(app, vec2(1500.0, 900.0));
    window.state_mut().dialog = None;
    // Changed while the window is open, as a file of keys that is saved changes them.
    window.state_mut().desk.keymap = other_keys(folder.path());
    window.ctx.all_styles_mut(|style| {
        style.interaction.tooltip_delay = 0.0;
        style.interaction.show_tooltips_only_when_still = false;
    });
    window.run_steps(3);
    (window, folder)
}

#[test]
fn a_key_that_was_changed_is_found_in_a_tip() {
    let folder = tempfile::tempdir().unwrap();
    let keymap = other_keys(folder.path());
    let defaults = Keymap::default();
    let keys: Vec<&Chord> = Action::ALL
        .iter()
        .flat_map(|a| defaults.chords(*a))
        .collect();
    for n in 1..=12 {
        let key = format!("F{n}");
        let is_default = keys.iter().any(|c| c.to_string() == key);
        assert_eq!(old_key(&format!("Timings: {key}"), &keymap), is_default);
    }
    for action in Action::ALL {
        let now = keymap.keys_text(*action);
        assert!(!old_key(&format!("{}: {now}", action.name()), &keymap));
    }
    let save = defaults.keys_text(Action::Save);
    assert!(old_key(&format!("Save: {save}"), &keymap));
}

#[test]
fn every_control_of_the_window_tells_what_it_does_and_its_key() {
    let (mut window, folder) = everything();
    let mut walk = Walk::new();
    walk.go(&mut window, "at the start, with the hint");
    window.state_mut().desk.close_hint();
    // Menus, the recent files, and what opens from buttons.
    let other = folder.path().join("other.toml");
    std::fs::write(&other, SMALL).unwrap();
    window.state_mut().desk.settings.remember(&other);
    for menu in ["File", "Edit", "Layer", "View", "3D view", "Window"] {
        let id = of(&window, Role::Button, menu);
        walk.open(&mut window, menu, id);
    }
    for button in ["Add layer", "Lights"] {
        let id = of(&window, Role::Button, button);
        walk.open(&mut window, button, id);
    }
    for kind in ToolKind::ALL {
        window.state_mut().desk.hand.take(kind);
        window.run_steps(2);
        walk.go(&mut window, kind.name());
    }
    window.state_mut().desk.hand.take(ToolKind::Groove);
    window.state_mut().desk.hand.on_screen = true;
    for leaf in [Leaf::Brush, Leaf::Document, Leaf::History] {
        window.state_mut().properties.leaf = leaf;
        window.run_steps(2);
        walk.go(&mut window, &format!("{leaf:?}"));
    }
    for kind in Kind::ALL {
        window.state_mut().canvas.kind = kind;
        window.run_steps(3);
        walk.go(&mut window, &format!("{kind:?}"));
    }
    for action in [Action::Compare, Action::Difference, Action::ToggleTimings] {
        window.state_mut().desk.ask(action);
        window.run_steps(3);
        walk.go(&mut window, action.name());
    }
    window.state_mut().desk.messages.error("something is wrong");
    window.run_steps(2);
    walk.go(&mut window, "a message");
    window.set_size(vec2(900.0, 600.0));
    window.run_steps(3);
    walk.go(&mut window, "a small window");
    let id = of(&window, Role::Button, "More of the 3D view");
    walk.open(&mut window, "More of the 3D view", id);
    let told = walk.end();
    let untold: Vec<&Action> = Action::ALL.iter().filter(|a| !told.contains(a)).collect();
    assert!(untold.is_empty(), "no control tells of {untold:?}");
}

fn of(window: &Window, role: Role, name: &str) -> NodeId {
    let found = window.get_by_role_and_label(role, name);
    found.accesskit_node().locate().0
}

#[test]
fn every_control_of_every_layer_tells_what_it_does_and_its_key() {
    let (mut window, _folder) = everything();
    window.state_mut().desk.close_hint();
    window.state_mut().properties.leaf = Leaf::Layer;
    let mut walk = Walk::new();
    let names: Vec<String> = {
        let layers = &window.state().desk.studio.recipe().layers;
        layers.iter().map(|l| l.name().to_owned()).collect()
    };
    for (i, name) in names.iter().enumerate() {
        window.state_mut().desk.studio.select(i);
        window.run_steps(3);
        walk.go(&mut window, name);
    }
    let at = names.iter().position(|n| n == "guides").unwrap();
    window.state_mut().desk.studio.select(at);
    window.state_mut().desk.hand.take(ToolKind::Guide);
    for (i, shape) in Shape::NAMES.into_iter().enumerate() {
        window.state_mut().desk.guides.shape = i;
        window.state_mut().desk.guides.mode = match i {
            0 => Mode::Smooth,
            _ => Mode::Concentric,
        };
        window.run_steps(2);
        let add = of(&window, Role::Button, &format!("Add {shape}"));
        click(&mut window, add);
        walk.go(&mut window, shape);
    }
    let lay = of(&window, Role::Button, "Lay widths");
    click(&mut window, lay);
    walk.go(&mut window, "guides with widths");
    // Masks: one that is painted, a pattern's, a path.
    window.state_mut().desk.hand.take(ToolKind::Groove);
    window.state_mut().desk.studio.select(0);
    let desk = &mut window.state_mut().desk;
    desk.studio.add_painted_mask(0, true).unwrap();
    window.run_steps(3);
    walk.go(&mut window, "a painted mask");
    let sources = [
        MaskSource::Pattern(default_pattern("radial").unwrap()),
        MaskSource::Path("M 0 0 L 1 0 L 1 1 Z".to_owned()),
    ];
    for source in sources {
        let place = format!("a mask of {}", source.name());
        let mask = Some(Mask::new(source));
        let desk = &mut window.state_mut().desk;
        desk.edit_head(0, "Mask", |head| head.mask = mask);
        window.run_steps(3);
        walk.go(&mut window, &place);
    }
    let desk = &mut window.state_mut().desk;
    desk.edit_head(0, "Seed", |head| head.seed = Some(3));
    window.run_steps(2);
    walk.go(&mut window, "a seed of its own");
    // What stands in the place of a row or a bar for a moment.
    window.state_mut().desk.ask(Action::RenameLayer);
    window.run_steps(3);
    walk.go(&mut window, "a layer that is renamed");
    press(&mut window, "Escape");
    let size = of(&window, Role::Slider, "Size");
    click(&mut window, size);
    assert!(
        window
            .query_by_role_and_label(Role::TextInput, "Size")
            .is_some()
    );
    walk.go(&mut window, "a number that is typed");
    press(&mut window, "Escape");
    window
        .get_by_label("Layer constant")
        .click_button(eframe::egui::PointerButton::Secondary);
    window.run_steps(3);
    walk.go(&mut window, "the menu of a layer");
    walk.end();
}

#[test]
fn every_control_of_every_dialog_tells_what_it_does() {
    let (mut window, folder) = everything();
    window.state_mut().desk.close_hint();
    window.run_steps(2);
    let mut walk = Walk::new();
    for action in [
        Action::New,
        Action::Open,
        Action::SaveAs,
        Action::Presets,
        Action::Settings,
        Action::Shortcuts,
    ] {
        window.state_mut().dialog = None;
        window.run_steps(2);
        walk.below = controls(&window).iter().map(|c| c.id).collect();
        window.state_mut().desk.ask(action);
        window.run_steps(4);
        assert!(window.state().dialog.is_some(), "{action:?}");
        walk.go(&mut window, action.name());
        match action {
            Action::New => {
                let own = of(&window, Role::RadioButton, "Mesh Own\u{2026}");
                click(&mut window, own);
            }
            Action::Presets => {
                let preset = of(&window, Role::Button, "Preset canvas");
                click(&mut window, preset);
            }
            // The file is there already.
            Action::SaveAs => {
                let save = of(&window, Role::Button, "Save");
                click(&mut window, save);
            }
            _ => continue,
        }
        assert!(window.state().dialog.is_some(), "{action:?}");
        walk.go(&mut window, &format!("{}, chosen", action.name()));
    }
    let some = |name: &str| folder.path().join(name);
    let mut nowhere = FileDialog::new(Purpose::SaveAs, some("no/where.toml"));
    nowhere = nowhere.with_note("A note.");
    let map = || LargeThing::File(Part::Map, PathBuf::from("map.exr"));
    let large = Large {
        warning: "It is large".to_owned(),
        what: map(),
    };
    for (place, dialog) in [
        ("no folder", Dialog::File(nowhere)),
        ("unsaved", Dialog::Unsaved(Then::Quit)),
        ("changed", Dialog::Changed(some("all.toml"))),
        ("newer", Dialog::Newer(vec!["layers.gloss".to_owned()])),
        ("large", Dialog::Large(large)),
        ("no layout", Dialog::NoUvs(some("bare.obj"))),
        ("outside", Dialog::Outside(vec!["../far.png".to_owned()])),
    ] {
        walk.dialog(&mut window, place, dialog);
        if place == "no folder" {
            let save = of(&window, Role::Button, "Save");
            click(&mut window, save);
            walk.go(&mut window, "no folder, told");
        }
    }
    importing(&mut walk, &mut window, folder.path());
    walk.end();
}

/// The import of textures, by every convention that has a name, with all that can be told.
fn importing(walk: &mut Walk, window: &mut Window, folder: &Path) {
    for kind in ["Roughness", "Anisotropic", "Rotation"] {
        let grey = image::RgbImage::from_pixel(8, 8, image::Rgb([128, 40, 200]));
        grey.save(folder.join(format!("s_{kind}.png"))).unwrap();
    }
    for (i, named) in Convention::NAMED.iter().enumerate() {
        let mut seen = look_at(&folder.join("s_Rotation.png")).unwrap();
        seen.guess.textures.convention = named.convention;
        let dialog = Dialog::Import(Box::new(ImportDialog::new(Box::new(seen))));
        walk.dialog(window, named.name, dialog);
        if i == 0 {
            let all = window.get_by_label("What the numbers mean");
            let all = all.accesskit_node().locate().0;
            click(window, all);
            walk.go(window, "What the numbers mean");
        }
    }
}

#[test]
fn every_control_of_an_export_tells_what_it_does() {
    let (mut window, folder) = window();
    window.ctx.all_styles_mut(|style| {
        style.interaction.tooltip_delay = 0.0;
        style.interaction.show_tooltips_only_when_still = false;
    });
    window.state_mut().desk.keymap = other_keys(folder.path());
    let mut walk = Walk::new();
    let export = ExportDialog::new(&window.state().desk);
    walk.dialog(&mut window, "export", Dialog::Export(Box::new(export)));
    let export = ExportDialog::new(&window.state().desk);
    let chooser = FileDialog::new(Purpose::ExportFolder, folder.path().to_owned());
    let chooser = Dialog::ExportFolder(Box::new(export), chooser);
    walk.dialog(&mut window, "the folder of an export", chooser);
    let out = folder.path().join("out");
    std::fs::create_dir(&out).unwrap();
    std::fs::write(out.join("small.exr"), "another's").unwrap();
    window.state_mut().dialog = None;
    window.run_steps(2);
    walk.below = controls(&window).iter().map(|c| c.id).collect();
    window.state_mut().desk.ask(Action::Export);
    window.run_steps(3);
    field(&window, "Folder").click();
    window.step();
    press(&mut window, "Ctrl+A");
    field(&window, "Folder").type_text(&out.display().to_string());
    window.run_steps(2);
    button(&window, "Export");
    window.run_steps(4);
    walk.go(&mut window, "an export that would replace files");
    button(&window, "Replace it");
    wait_for_export(&mut window);
    window.run_steps(3);
    walk.go(&mut window, "what an export wrote");
    walk.end();
}

#[test]
fn every_control_of_a_recovery_tells_what_it_does() {
    let folder = tempfile::tempdir().unwrap();
    for _ in 0..2 {
        let mut window = window_of(app(folder.path(), SMALL), vec2(1200.0, 760.0));
        window.state_mut().dialog = None;
        window.run_steps(2);
        stroke(&mut window, (0.35, 0.5), (0.65, 0.6));
    }
    let mut window = window_of(app(folder.path(), SMALL), vec2(1200.0, 760.0));
    window.ctx.all_styles_mut(|style| {
        style.interaction.tooltip_delay = 0.0;
        style.interaction.show_tooltips_only_when_still = false;
    });
    let recover = window.state_mut().dialog.take().unwrap();
    assert!(matches!(recover, Dialog::Recover(_)));
    let mut walk = Walk::new();
    walk.dialog(&mut window, "recovery", recover);
    walk.end();
}
