//! Lights, camera and map by keys alone, and what screen readers are told of them.

use super::*;
use anisomap::preview::Light;
use egui_kittest::kittest::NodeT;
use glam::Vec3;

const LIGHT: (Role, &str) = (Role::Slider, "Light of the map");
const LIGHTS: (Role, &str) = (Role::Slider, "Lights of the 3D view");
const MAP: (Role, &str) = (Role::Canvas, "Paint canvas");
const MESH: (Role, &str) = (Role::Canvas, "3D view");

fn is_focused(window: &Window, (role, name): (Role, &str)) -> bool {
    let node = window.get_by_role_and_label(role, name);
    node.accesskit_node().is_focused()
}

/// Goes there with F6 alone.
fn go_to(window: &mut Window, control: (Role, &str)) {
    for _ in 0..8 {
        press(window, "F6");
        window.step(); // the focus is told with the next frame
        if is_focused(window, control) {
            return;
        }
    }
    panic!("F6 does not lead to {control:?}");
}

/// What a screen reader says of it.
fn state(window: &Window, (role, name): (Role, &str)) -> String {
    let node = window.get_by_role_and_label(role, name);
    let keys = node.accesskit_node().description().unwrap_or_default();
    assert!(keys.contains("arrow keys"), "{name}: {keys}");
    node.accesskit_node().value().unwrap_or_default()
}

fn eye(window: &Window) -> (Vec3, Vec3) {
    let camera = window.state().desk.studio.scene().camera;
    (camera.eye, camera.target)
}

fn toward(window: &Window) -> Vec<Vec3> {
    let lights = &window.state().desk.studio.scene().lights;
    let place = |light: &Light| match *light {
        Light::Directional { toward, .. } => toward,
        Light::Point { position, .. } => position,
    };
    lights.iter().map(place).collect()
}

#[test]
fn f6_goes_round_and_leaves_the_document_alone() {
    let (mut window, _folder) = window();
    let recipe = window.state().desk.studio.recipe().clone();
    let tool = window.state().desk.hand.kind();
    for control in [MAP, LIGHT, MESH, LIGHTS] {
        press(&mut window, "F6");
        if control == MAP {
            press(&mut window, "F6"); // the tools came first
        }
        window.step();
        assert!(is_focused(&window, control), "{control:?}");
        for keys in ["Left", "Shift+Up", "Right", "Down"] {
            press(&mut window, keys);
        }
        assert!(is_focused(&window, control), "{control:?} keeps the arrows");
    }
    press(&mut window, "F6");
    window.step();
    let first = window.state().desk.first_control;
    assert_eq!(window.ctx.memory(|m| m.focused()), first);
    let app = window.state();
    assert!(*app.desk.studio.recipe() == recipe && app.desk.hand.kind() == tool);
    // Where the map is no lit one there is no light to be moved.
    press(&mut window, "5");
    window.run_steps(2);
    assert!(window.query_by_role_and_label(LIGHT.0, LIGHT.1).is_none());
}

#[test]
fn the_light_of_the_map_goes_by_arrow_keys() {
    let (mut window, _folder) = window();
    go_to(&mut window, LIGHT);
    let light = |w: &Window| w.state().canvas.light;
    let (before, told) = (light(&window), state(&window, LIGHT));
    press(&mut window, "Right");
    let right = light(&window);
    assert!((right.x - before.x - 0.05).abs() < 1e-5 && (right.y - before.y).abs() < 1e-5);
    assert!((right.length() - 1.0).abs() < 1e-5);
    assert_ne!(state(&window, LIGHT), told);
    press(&mut window, "Shift+Right");
    let fine = light(&window).x - right.x;
    assert!((fine - 0.005).abs() < 1e-5, "{fine}");
    press(&mut window, "Up");
    assert!(light(&window).y > right.y);
    for _ in 0..60 {
        window.key_press(Key::ArrowDown);
        window.step();
    }
    let low = light(&window);
    assert!(low.z > 0.0 && low.y < -0.8, "it stays on the ball: {low}");
    assert!(
        texts(&window)
            .iter()
            .any(|t| t.contains("arrow keys move the light"))
    );
    press(&mut window, "Shift+Home");
    assert!(light(&window).distance(before) < 1e-5, "they are put back");
    assert_eq!(strokes(&window), 0);
}

#[test]
fn a_screen_reader_moves_the_light_without_a_key() {
    use eframe::egui::accesskit::Action as Request;
    let (mut window, _folder) = window();
    go_to(&mut window, LIGHT);
    let before = window.state().canvas.light.x;
    let id = window.ctx.memory(|m| m.focused()).unwrap();
    for (request, sign) in [(Request::Increment, 1.0), (Request::Decrement, -1.0)] {
        let node = window.get_by_role_and_label(LIGHT.0, LIGHT.1);
        let target = node.accesskit_node().locate();
        let from = window.state().canvas.light.x;
        window.event(Event::AccessKitActionRequest(
            eframe::egui::accesskit::ActionRequest {
                action: request,
                target_tree: target.1,
                target_node: target.0,
                data: None,
            },
        ));
        window.run_steps(2);
        let moved = window.state().canvas.light.x - from;
        assert!(sign * moved > 0.04, "{request:?}: {moved}, {id:?}");
    }
    assert!((window.state().canvas.light.x - before).abs() < 1e-5);
}

#[test]
fn the_camera_turns_moves_zooms_and_frames_by_keys() {
    let (mut window, _folder) = window();
    go_to(&mut window, MESH);
    let home = eye(&window);
    let distance = home.0.distance(home.1);
    let told = state(&window, MESH);
    press(&mut window, "Right");
    let turned = eye(&window);
    let flat = |v: Vec3| glam::Vec2::new(v.x, v.z);
    let angle = flat(home.0 - home.1).angle_to(flat(turned.0 - turned.1));
    assert!((angle.abs().to_degrees() - 5.0).abs() < 0.01, "{angle}");
    assert_eq!(turned.1, home.1);
    assert!((turned.0.distance(turned.1) - distance).abs() < 1e-4);
    assert_ne!(state(&window, MESH), told);
    press(&mut window, "Shift+Right");
    let fine = flat(turned.0 - turned.1).angle_to(flat(eye(&window).0 - eye(&window).1));
    assert!((fine.abs().to_degrees() - 0.5).abs() < 0.01, "{fine}");
    press(&mut window, "Up");
    assert!(eye(&window).0.y < turned.0.y, "as a drag upward");
    press(&mut window, "Ctrl+Up");
    let moved = eye(&window);
    assert!(
        moved.1.distance(home.1) > 0.01,
        "the target moved: {moved:?}"
    );
    press(&mut window, "Alt+Up");
    let near = eye(&window);
    assert!(near.0.distance(near.1) < 0.95 * distance && near.1 == moved.1);
    press(&mut window, "Home");
    let back = eye(&window);
    assert!(back.0.distance(home.0) < 1e-4 && back.1.distance(home.1) < 1e-4);
    // What was drawn in a hurry is drawn sharply.
    window.run_steps(3);
    assert!(window.state().desk.studio.viewport().quality().samples > 0);
    assert!(is_focused(&window, MESH));
}

#[test]
fn the_lights_of_the_mesh_turn_by_keys_and_by_their_ball() {
    let (mut window, _folder) = window();
    go_to(&mut window, LIGHTS);
    let (before, camera) = (toward(&window), eye(&window));
    let told = state(&window, LIGHTS);
    press(&mut window, "Left");
    let left = toward(&window);
    let right = window.state().desk.studio.scene().camera.basis()[0];
    assert!(left[0].dot(right) < before[0].dot(right));
    assert!((left[0].length() - before[0].length()).abs() < 1e-4);
    assert_ne!(state(&window, LIGHTS), told);
    press(&mut window, "Right");
    let back = toward(&window)[0].distance(before[0]);
    assert!(back < 1e-4, "{back}");
    // The ball is dragged as that of the map is, and nothing is painted by it.
    let ball = window.get_by_role_and_label(LIGHTS.0, LIGHTS.1).rect();
    window.hover_at(ball.center());
    window.step();
    window.drag_at(ball.center());
    window.step();
    window.hover_at(ball.center() + vec2(12.0, 0.0));
    window.step();
    window.drop_at(ball.center() + vec2(12.0, 0.0));
    window.run_steps(2);
    assert!(toward(&window)[0].dot(right) > before[0].dot(right) + 0.05);
    let after = toward(&window);
    window.hover_at(ball.center() - vec2(60.0, 0.0));
    window.run_steps(2);
    assert_eq!(toward(&window), after, "it was let go");
    assert!(eye(&window) == camera && strokes(&window) == 0);
}

#[test]
fn the_map_moves_and_zooms_by_keys() {
    let (mut window, _folder) = window();
    go_to(&mut window, MAP);
    let middle = window.get_by_role_and_label(MAP.0, MAP.1).rect().center();
    let texel = |w: &mut Window| {
        w.hover_at(middle);
        w.step();
        w.state()
            .canvas
            .probe
            .as_ref()
            .map(|p| (p.texel.x, p.texel.y))
    };
    let (before, zoom) = (texel(&mut window).unwrap(), window.state().canvas.zoom());
    press(&mut window, "Right");
    press(&mut window, "Right");
    let moved = texel(&mut window).unwrap();
    assert!(moved.0 < before.0 && moved.1 == before.1, "{moved:?}");
    let told = state(&window, MAP);
    press(&mut window, "Alt+Up");
    assert!((window.state().canvas.zoom() / zoom - 1.25).abs() < 1e-3);
    assert_ne!(state(&window, MAP), told);
    assert_eq!(texel(&mut window), Some(moved), "around the middle");
}
