//! Every control has a name for screen readers and can be reached with the keyboard.

use super::*;
use crate::gui::properties::Leaf;
use egui_kittest::kittest::NodeT;

/// Roles that a user acts on.
const CONTROLS: [Role; 13] = [
    Role::Button,
    Role::CheckBox,
    Role::RadioButton,
    Role::ComboBox,
    Role::Slider,
    Role::SpinButton,
    Role::TextInput,
    Role::Link,
    Role::Tab,
    Role::ListItem,
    Role::MenuItem,
    Role::Canvas,
    Role::ColorWell,
];

/// The controls that have no name, as text.
fn unnamed(window: &Window) -> Vec<String> {
    let nodes = window.query_all_by(|node| CONTROLS.contains(&node.role()));
    let named = |node: &egui_kittest::Node<'_>| {
        let label = node.accesskit_node().label();
        label.is_some_and(|l| !l.trim().is_empty())
    };
    nodes
        .filter(|n| !named(n))
        .map(|n| format!("{:?} at {:?}", n.accesskit_node().role(), n.rect()))
        .collect()
}

fn assert_named(window: &Window, place: &str) {
    let nodes = window.query_all_by(|node| CONTROLS.contains(&node.role()));
    assert!(nodes.count() > 5, "{place}: the controls are found");
    assert_eq!(unnamed(window), Vec::<String>::new(), "{place}");
}

#[test]
fn every_control_of_the_window_has_a_name() {
    let (mut window, _folder) = window();
    assert_named(&window, "at the start");
    for leaf in [Leaf::Brush, Leaf::Layer, Leaf::Document, Leaf::History] {
        window.state_mut().properties.leaf = leaf;
        for layer in 0..2 {
            window.state_mut().desk.studio.select(layer);
            window.run_steps(2);
            assert_named(&window, &format!("{leaf:?} of layer {layer}"));
        }
    }
    for kind in ToolKind::ALL {
        window.state_mut().desk.hand.take(kind);
        window.run_steps(2);
        assert_named(&window, kind.name());
    }
    press(&mut window, "Y");
    assert_named(&window, "two models");
    window.state_mut().properties.leaf = Leaf::Layer;
    press(&mut window, "Ctrl+Shift+G");
    window.run_steps(2);
    button(&window, "Add line");
    window.run_steps(3);
    assert_named(&window, "guides");
}

#[test]
fn every_control_of_the_dialogs_has_a_name() {
    for keys in ["Ctrl+N", "Ctrl+O", "Ctrl+P", "Ctrl+Shift+E", "Ctrl+,", "F1"] {
        let (mut window, _folder) = window();
        press(&mut window, keys);
        window.run_steps(3);
        assert!(window.state().dialog.is_some(), "{keys}");
        assert_named(&window, keys);
    }
}

#[test]
fn the_keyboard_goes_from_control_to_control_and_comes_back() {
    let (mut window, _folder) = window();
    let focused = |w: &Window| w.ctx.memory(|m| m.focused());
    press(&mut window, "F6");
    let first = focused(&window);
    assert!(first.is_some());
    press(&mut window, "Tab");
    let second = focused(&window);
    assert!(second.is_some() && second != first, "Tab goes on");
    assert!(window.state().desk.panels, "and hides nothing meanwhile");
    // The tools stand one below the other: Space takes the second.
    press(&mut window, "Space");
    window.run_steps(2);
    assert_eq!(window.state().desk.hand.kind(), ToolKind::ALL[1]);
    press(&mut window, "Escape");
    assert_eq!(focused(&window), None);
}

#[test]
fn every_list_opens_by_the_hand_by_the_keyboard_and_by_a_screen_reader() {
    let (mut window, _folder) = window();
    window.state_mut().properties.leaf = Leaf::Layer;
    window.run_steps(2);
    let mask = |w: &mut Window| {
        let combo = w.get_by_role_and_label(Role::ComboBox, "Mask");
        combo.scroll_to_me();
        w.run_steps(4);
    };
    let is_open = |w: &Window| w.query_by_label("painted, all hidden").is_some();
    type Way = fn(&mut Window);
    let ways: [(&str, Way); 3] = [
        ("screen reader", |w| {
            w.get_by_role_and_label(Role::ComboBox, "Mask")
                .click_accesskit();
        }),
        ("hand", |w| {
            w.get_by_role_and_label(Role::ComboBox, "Mask").click();
        }),
        ("keyboard", |w| {
            w.get_by_role_and_label(Role::ComboBox, "Mask").focus();
            w.step();
            press(w, "Enter");
        }),
    ];
    for (way, open) in ways {
        mask(&mut window);
        assert!(!is_open(&window), "{way}");
        open(&mut window);
        window.run_steps(3);
        assert!(is_open(&window), "{way}");
        press(&mut window, "Escape");
        window.run_steps(3);
    }
}

#[test]
fn the_split_is_moved_with_arrow_keys() {
    let (mut window, _folder) = window();
    let before = window.state().desk.split;
    window
        .get_by_role_and_label(Role::Slider, "Split between the map and the 3D view")
        .focus();
    window.run_steps(2);
    for (key, sign) in [(Key::ArrowRight, 1.0), (Key::ArrowLeft, -1.0)] {
        let from = window.state().desk.split;
        window.key_press(key);
        window.run_steps(2);
        let moved = window.state().desk.split - from;
        assert!(moved * sign > 0.01, "{key:?} {moved}");
    }
    assert!((window.state().desk.split - before).abs() < 1e-4);
}

#[test]
fn handles_of_panels_are_moved_with_arrow_keys() {
    let (mut window, _folder) = window();
    let edge = |w: &Window, name: &str| {
        let rect = w.get_by_label(name).rect();
        (rect.center().x, rect.center().y)
    };
    for (name, keys, is_down) in [
        (
            "Width of the panels",
            [Key::ArrowLeft, Key::ArrowRight],
            false,
        ),
        (
            "Height of the list of layers",
            [Key::ArrowUp, Key::ArrowDown],
            true,
        ),
    ] {
        window.get_by_label(name).focus();
        window.run_steps(2);
        let start = edge(&window, name);
        for (key, sign) in keys.into_iter().zip([-1.0, 1.0]) {
            let from = edge(&window, name);
            window.key_press(key);
            window.run_steps(3);
            let to = edge(&window, name);
            let moved = if is_down {
                to.1 - from.1
            } else {
                to.0 - from.0
            };
            // The list of so few layers has little to go.
            let step = if is_down { 1.0..17.0 } else { 15.0..17.0 };
            assert!(step.contains(&(moved * sign)), "{name} {key:?}: {moved}");
        }
        assert_eq!(edge(&window, name), start, "{name}");
        // It ends where the panel does.
        for _ in 0..40 {
            window.key_press(keys[0]);
            window.run_steps(1);
        }
        let far = edge(&window, name);
        let way = (far.0 - start.0).abs() + (far.1 - start.1).abs();
        assert!(way > 1.0 && way < 400.0, "{name}: {way}");
        window.key_press(keys[1]);
        window.run_steps(3);
        assert_ne!(edge(&window, name), far, "{name} comes back at once");
    }
}

#[test]
fn escape_closes_an_open_list_before_the_dialog_that_it_is_in() {
    let (mut window, _folder) = window();
    press(&mut window, "Ctrl+Shift+E");
    window.run_steps(3);
    let list = "Size of the files in texels";
    window
        .get_by_role_and_label(Role::ComboBox, list)
        .click_accesskit();
    window.run_steps(3);
    let is_open = |w: &Window| w.query_by_label_contains("512x512").is_some();
    assert!(is_open(&window));
    press(&mut window, "Escape");
    window.run_steps(2);
    assert!(!is_open(&window) && window.state().dialog.is_some());
    press(&mut window, "Escape");
    assert!(window.state().dialog.is_none());
}
