//! The guide tool: drawn, constrained, called off, deleted, taken back.

use super::*;
use anisomap::guide::{Guides, Shape};
use egui_kittest::kittest::NodeT;

const ROUND: &str = "version = 1
name = \"round\"
size = 64
[[layers]]
name = \"ground\"
[layers.constant]
alpha_x = 0.2
alpha_y = 0.2
";

fn open(text: &str) -> (Window, TempDir) {
    let folder = tempfile::tempdir().unwrap();
    let app = app(folder.path(), text);
    let mut window = window_of(app, vec2(1200.0, 760.0));
    press(&mut window, "U");
    (window, folder)
}

fn guides(window: &Window) -> Option<Guides> {
    let studio = &window.state().desk.studio;
    match &studio.recipe().layers.get(studio.selected())?.source {
        Source::Guides(guides) => Some(guides.clone()),
        _ => None,
    }
}

#[test]
fn a_drag_draws_a_guide_on_a_layer_of_its_own_and_it_is_seen_at_once() {
    for (i, name) in Shape::NAMES.into_iter().enumerate() {
        let (mut window, _folder) = open(ROUND);
        let before = map(&window);
        window.state_mut().desk.guides.shape = i;
        stroke(&mut window, (0.35, 0.5), (0.6, 0.65));
        settle(&mut window);
        let drawn = guides(&window).expect("a layer of guides");
        assert_eq!(drawn.guide[0].shape.name(), name);
        assert!(drawn.has_widths(), "on a round ground");
        assert!(map(&window) != before, "{name}");
        assert_eq!(window.state().desk.guides.selected, Some(0));
        let labels: Vec<String> = {
            let history = window.state().desk.studio.history();
            history.labels().0.map(str::to_owned).collect()
        };
        assert_eq!(labels, [format!("Draw {name} 1: guides")]);
        press(&mut window, "Ctrl+Z");
        settle(&mut window);
        assert!(guides(&window).is_none(), "one step: layer and guide");
        assert!(map(&window) == before);
        press(&mut window, "Ctrl+Y");
        settle(&mut window);
        assert_eq!(guides(&window).unwrap().guide.len(), 1);
    }
}

#[test]
fn on_grooved_ground_a_guide_turns_the_direction_alone() {
    let (mut window, _folder) = open(SMALL);
    stroke(&mut window, (0.35, 0.5), (0.6, 0.65));
    let drawn = guides(&window).unwrap();
    assert!(!drawn.has_widths() && drawn.only_near, "{drawn:?}");
}

#[test]
fn strokes_under_guides_are_told_once_who_leads() {
    let (mut window, _folder) = open(ROUND);
    stroke(&mut window, (0.35, 0.5), (0.6, 0.65));
    window.state_mut().desk.studio.select(0);
    press(&mut window, "B");
    stroke(&mut window, (0.35, 0.4), (0.6, 0.45));
    stroke(&mut window, (0.35, 0.4), (0.6, 0.45));
    let told = window.state().desk.messages.texts();
    let told = told.iter().filter(|t| t.contains("leads the direction"));
    assert_eq!(told.count(), 1);
}

#[test]
fn keys_constrain_and_escape_calls_off() {
    let (mut window, _folder) = open(ROUND);
    button_of_choice(&window, "Draw Ellipse");
    window.run_steps(2);
    hold(&mut window, Modifiers::SHIFT);
    stroke(&mut window, (0.35, 0.4), (0.6, 0.5));
    hold(&mut window, Modifiers::NONE);
    let Shape::Ellipse { radii } = guides(&window).unwrap().guide[0].shape else {
        panic!()
    };
    assert_eq!(radii[0], radii[1], "Shift: a circle");
    let rect = window.get_by_label("Paint canvas").rect();
    let recipe = window.state().desk.studio.recipe().clone();
    let history = window.state().desk.studio.history().len();
    window.drag_at(rect.lerp_inside(vec2(0.4, 0.7)));
    window.step();
    window.hover_at(rect.lerp_inside(vec2(0.6, 0.8)));
    window.step();
    assert_eq!(guides(&window).unwrap().guide.len(), 2, "as it is dragged");
    press(&mut window, "Escape");
    window.hover_at(rect.lerp_inside(vec2(0.65, 0.85)));
    window.step();
    window.drop_at(rect.lerp_inside(vec2(0.65, 0.85)));
    window.step();
    assert!(*window.state().desk.studio.recipe() == recipe);
    assert_eq!(window.state().desk.studio.history().len(), history);
}

#[test]
fn alt_draws_from_the_middle_whenever_it_is_held_and_space_moves_the_map() {
    let (mut window, _folder) = open(ROUND);
    button_of_choice(&window, "Draw Ellipse");
    window.run_steps(2);
    hold(&mut window, Modifiers::ALT);
    stroke(&mut window, (0.5, 0.5), (0.6, 0.55));
    hold(&mut window, Modifiers::NONE);
    settle(&mut window);
    let drawn = guides(&window).unwrap();
    let centre = Vec2::from(drawn.guide[0].center());
    assert!((centre - vec2(0.5, 0.5)).length() < 0.02, "{centre:?}");
    // Held once the drag has begun it does the same.
    let rect = window.get_by_label("Paint canvas").rect();
    let zoom = window.state().canvas.zoom();
    window.key_down(Key::Space);
    stroke(&mut window, (0.3, 0.3), (0.4, 0.3));
    window.key_up(Key::Space);
    window.step();
    assert_eq!(guides(&window).unwrap().guide.len(), 1, "the map was moved");
    assert_eq!(window.state().canvas.zoom(), zoom);
    assert!(rect.is_positive());
    let history = window.state().desk.studio.history();
    let labels: Vec<&str> = history.labels().0.collect();
    assert_eq!(labels, ["Draw ellipse 1: guides"]);
}

#[test]
fn a_curve_shows_the_tangents_of_one_point_and_the_history_tells_guides_apart() {
    let (mut window, _folder) = open(ROUND);
    button_of_choice(&window, "Draw Curve");
    window.run_steps(2);
    let rect = window.get_by_label("Paint canvas").rect();
    let bow = |t: f32| {
        rect.lerp_inside(vec2(0.3 + 0.4 * t, 0.4 + 0.5 * t * (1.0 - t)))
            .round()
    };
    let places: Vec<Pos2> = (0..=9).map(|i| bow(i as f32 / 9.0)).collect();
    drag(&mut window, &places);
    let Shape::Curve { points, .. } = guides(&window).unwrap().guide[0].shape.clone() else {
        panic!()
    };
    assert!(points.len() <= 7, "{points:?}");
    // Its last point is taken, and moved.
    stroke(&mut window, (0.7, 0.4), (0.75, 0.3));
    button_of_choice(&window, "Draw Line");
    window.run_steps(2);
    stroke(&mut window, (0.3, 0.8), (0.6, 0.85));
    press(&mut window, "Delete");
    window.run_steps(2);
    let history = window.state().desk.studio.history();
    let labels: Vec<&str> = history.labels().0.collect();
    let wanted = [
        "Draw curve 1",
        "Reshape curve 1",
        "Draw line 2",
        "Delete line 2",
    ];
    let wanted = wanted.map(|what| format!("{what}: guides"));
    assert_eq!(labels, wanted);
}

fn button_of_choice(window: &Window, label: &str) {
    window
        .get_by_role_and_label(Role::RadioButton, label)
        .click();
}

#[test]
fn a_click_selects_handles_drag_and_delete_takes_the_guide() {
    let (mut window, _folder) = open(ROUND);
    window.state_mut().desk.guides.shape = 3;
    stroke(&mut window, (0.3, 0.35), (0.7, 0.65));
    let before = guides(&window).unwrap();
    let rect = window.get_by_label("Paint canvas").rect();
    press(&mut window, "Escape");
    assert_eq!(window.state().desk.guides.selected, None);
    // Not its middle, where the handle is that moves it.
    drag(&mut window, &[rect.lerp_inside(vec2(0.42, 0.46))]);
    assert_eq!(window.state().desk.guides.selected, Some(0));
    assert_eq!(guides(&window).unwrap(), before, "a click changes nothing");
    stroke(&mut window, (0.5, 0.5), (0.55, 0.45));
    let moved = guides(&window).unwrap();
    assert_eq!(moved.guide.len(), 1);
    assert_ne!(moved.guide[0].center, before.guide[0].center);
    assert_eq!(moved.guide[0].shape, before.guide[0].shape);
    press(&mut window, "Delete");
    window.run_steps(2);
    assert!(guides(&window).unwrap().guide.is_empty());
    press(&mut window, "Ctrl+Z");
    window.run_steps(2);
    assert_eq!(guides(&window).unwrap(), moved);
}

#[test]
fn guides_that_cannot_be_seen_say_so_and_are_helped() {
    let (mut window, _folder) = open(ROUND);
    stroke(&mut window, (0.35, 0.4), (0.6, 0.5));
    settle(&mut window);
    let at = window.state().desk.studio.selected();
    let mut bare = guides(&window).unwrap();
    (bare.alpha_along, bare.alpha_across) = (None, None);
    let studio = &mut window.state_mut().desk.studio;
    studio
        .set_source(at, "Guides", Source::Guides(bare))
        .unwrap();
    settle(&mut window);
    window.run_steps(2);
    let shown = texts(&window);
    assert!(
        shown
            .iter()
            .any(|t| t.contains("a direction does not show")),
        "{shown:?}"
    );
    button(&window, "Lay widths");
    window.run_steps(2);
    assert!(guides(&window).unwrap().has_widths());
}

/// Types a number into the bar of that name.
fn type_into(window: &mut Window, name: &str, number: &str) {
    let bar = window.get_by_role_and_label(Role::Slider, name);
    bar.scroll_to_me();
    window.run_steps(3);
    window.get_by_role_and_label(Role::Slider, name).click();
    window.run_steps(2);
    press(window, "Ctrl+A");
    field(window, name).type_text(number);
    window.run_steps(2);
    press(window, "Enter");
    window.run_steps(2);
}

#[test]
fn points_of_lines_and_curves_are_moved_by_numbers() {
    let (mut window, _folder) = open(ROUND);
    window.state_mut().properties.leaf = crate::gui::properties::Leaf::Layer;
    let points = |w: &Window| -> Vec<Vec2> {
        let guide = &guides(w).unwrap().guide[0];
        let aspect = w
            .state()
            .desk
            .studio
            .recipe()
            .aspect_at(w.state().desk.studio.map().size());
        let handles = guide.handles(aspect);
        let points = handles.iter().filter_map(|h| match h.kind {
            anisomap::guide::HandleKind::Point(_) => Some(vec2(h.at.x, h.at.y)),
            _ => None,
        });
        points.collect()
    };
    for (shape, count) in [("Draw Line", 2), ("Draw Curve", 4)] {
        button_of_choice(&window, shape);
        window.run_steps(2);
        stroke(&mut window, (0.35, 0.4), (0.6, 0.6));
        window.run_steps(3);
        let before = points(&window);
        assert!(before.len() >= count, "{shape}: {before:?}");
        let last = before.len();
        type_into(&mut window, "Number", &last.to_string());
        type_into(&mut window, "Point u", "0.75");
        type_into(&mut window, "Point v", "0.125");
        let after = points(&window);
        assert!(
            (after[last - 1] - vec2(0.75, 0.125)).length() < 1e-4,
            "{after:?}"
        );
        for (a, b) in after.iter().zip(&before).take(last - 1) {
            assert!((*a - *b).length() < 1e-4, "{shape} moved {b:?} to {a:?}");
        }
        // The list has it, and takes another one.
        window.get_by_label_contains(":  0.750, 0.125");
        let first = |w: &Window, act: fn(&egui_kittest::Node<'_>)| {
            act(&w.query_all_by_label_contains("Point 1:").next().unwrap());
        };
        first(&window, |n| n.scroll_to_me());
        window.run_steps(3);
        first(&window, |n| n.click());
        window.run_steps(2);
        type_into(&mut window, "Point u", "0.25");
        assert!((points(&window)[0].x - 0.25).abs() < 1e-4);
        press(&mut window, "Ctrl+Z");
        assert!((points(&window)[0] - before[0]).length() < 1e-4, "one step");
        press(&mut window, "Delete");
        window.run_steps(2);
    }
}

#[test]
fn a_curve_of_many_points_has_a_list_of_few_rows() {
    let (mut window, _folder) = open(ROUND);
    window.state_mut().properties.leaf = crate::gui::properties::Leaf::Layer;
    button_of_choice(&window, "Draw Line");
    window.run_steps(2);
    stroke(&mut window, (0.35, 0.4), (0.6, 0.6));
    let at = window.state().desk.studio.selected();
    let mut many = guides(&window).unwrap();
    let zigzag = |i: u16| [f32::from(i) / 4000.0, f32::from(i % 2) / 100.0];
    many.guide[0].shape = Shape::Line {
        points: (0..1000).map(zigzag).collect(),
        closed: false,
    };
    let studio = &mut window.state_mut().desk.studio;
    studio
        .set_source(at, "Guides", Source::Guides(many))
        .unwrap();
    settle(&mut window);
    window.run_steps(3);
    let rows = |w: &Window| -> Vec<String> {
        let rows = w.query_all_by_label_contains("Point ");
        let label = |n: egui_kittest::Node<'_>| n.accesskit_node().label().unwrap_or_default();
        rows.map(label).filter(|l| l.contains(":  ")).collect()
    };
    let shown = rows(&window);
    assert!((4..=12).contains(&shown.len()), "{shown:?}");
    type_into(&mut window, "Number", "700");
    window.run_steps(2);
    let shown = rows(&window);
    assert!(
        shown.len() <= 12 && shown.iter().any(|l| l.starts_with("Point 700:")),
        "{shown:?}"
    );
}

#[test]
fn over_the_mesh_the_guide_tool_says_what_it_does_and_a_click_selects() {
    let text = ROUND.replace("size = 64", "size = 64\nmesh = \"plane\"");
    let (mut window, _folder) = open(&text);
    window.state_mut().desk.guides.shape = 3;
    stroke(&mut window, (0.3, 0.35), (0.7, 0.65));
    press(&mut window, "Escape");
    assert_eq!(window.state().desk.guides.selected, None);
    let rect = window.get_by_role_and_label(Role::Canvas, "3D view").rect();
    let (recipe, eye) = (
        window.state().desk.studio.recipe().clone(),
        window.state().desk.studio.scene().camera.eye,
    );
    window.hover_at(rect.center());
    window.run_steps(2);
    let told = |w: &Window| texts(w).join("; ");
    assert!(
        told(&window).contains("guides are drawn on the map; click"),
        "{}",
        told(&window)
    );
    drag(&mut window, &[rect.center()]);
    assert_eq!(window.state().desk.guides.selected, Some(0));
    assert!(
        *window.state().desk.studio.recipe() == recipe,
        "it draws nothing"
    );
    stroke_in(&mut window, rect, (0.5, 0.5), (0.6, 0.55));
    assert!(*window.state().desk.studio.recipe() == recipe);
    assert!(
        window.state().desk.studio.scene().camera.eye != eye,
        "a drag turns"
    );
    press(&mut window, "F4");
    window.run_steps(2);
    let rect = window.get_by_role_and_label(Role::Canvas, "3D view").rect();
    window.hover_at(rect.center());
    window.run_steps(2);
    assert!(
        told(&window).contains("on the map (F2)"),
        "{}",
        told(&window)
    );
}
