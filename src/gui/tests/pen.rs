//! The pen over the mesh does what it does over the map.

use super::*;
use glam::Vec3;

/// The points of the last stroke on the mesh.
fn last_on_mesh(window: &Window) -> Vec<Vec3> {
    let layers = &window.state().desk.studio.recipe().layers;
    let Source::Strokes(all) = &layers[1].source else {
        panic!("a layer of strokes")
    };
    let stroke = all.strokes.last().expect("a stroke");
    let Points::Mesh(points) = stroke.points() else {
        panic!("it was painted on the mesh")
    };
    (0..points.len()).map(|n| points.get(n).0).collect()
}

/// Drags over the 3D view through places that are parts of its sides.
fn drag_over_mesh(window: &mut Window, places: &[(f32, f32)]) {
    let rect = window.get_by_role_and_label(Role::Canvas, "3D view").rect();
    let at = |(x, y): &(f32, f32)| rect.lerp_inside(vec2(*x, *y));
    let places: Vec<Pos2> = places.iter().map(at).collect();
    drag(window, &places);
    settle(window);
}

#[test]
fn the_stabiliser_calms_strokes_on_the_mesh() {
    let trembling: Vec<_> = (0..=30)
        .map(|i| (0.35 + 0.01 * i as f32, 0.62 + 0.012 * (i % 2) as f32))
        .collect();
    let ways = [0.0, 1.0].map(|stabiliser| {
        let (mut window, _folder) = window();
        window.state_mut().desk.hand.stabiliser = stabiliser;
        drag_over_mesh(&mut window, &trembling);
        let points = last_on_mesh(&window);
        let length: f32 = points.windows(2).map(|p| p[0].distance(p[1])).sum();
        length / points[0].distance(points[points.len() - 1])
    });
    assert!(ways[0] > 1.3 && ways[1] < 1.1, "{ways:?}");
}

#[test]
fn size_is_dragged_over_the_mesh_and_the_click_that_ends_it_paints_nothing() {
    for panes in [Panes::Both, Panes::Viewport] {
        let (mut window, _folder) = window();
        window.state_mut().desk.panes = panes;
        window.state_mut().desk.hand.take(ToolKind::SetAlpha);
        window.run_steps(2);
        let rect = window.get_by_role_and_label(Role::Canvas, "3D view").rect();
        let from = rect.lerp_inside(vec2(0.5, 0.62));
        window.hover_at(from);
        window.step();
        let before = window.state().desk.hand.brush().radius;
        press(&mut window, "F");
        let to = from + vec2(60.0, 0.0);
        window.hover_at(to);
        window.step();
        drag(&mut window, &[to]);
        settle(&mut window);
        let after = window.state().desk.hand.brush().radius;
        assert!(
            (after / before - 1.012f32.powf(60.0)).abs() < 0.01,
            "{before} {after}"
        );
        assert!(window.state().desk.adjusting.is_none() && strokes(&window) == 0);
        // The next one does.
        drag_over_mesh(&mut window, &[(0.45, 0.62), (0.55, 0.62)]);
        land(&mut window);
        assert_eq!(strokes(&window), 1);
    }
}

#[test]
fn a_size_on_the_screen_stays_when_the_view_is_zoomed() {
    let (mut window, _folder) = window();
    let radii = |window: &Window| {
        let Source::Strokes(all) = &window.state().desk.studio.recipe().layers[1].source else {
            panic!("a layer of strokes")
        };
        let radii: Vec<f32> = all.strokes.iter().map(|s| s.brush().radius).collect();
        radii
    };
    for on_screen in [false, true] {
        window.state_mut().desk.hand.on_screen = on_screen;
        for zoom in [1.0, 2.0] {
            window.state_mut().canvas.zoom_by(zoom);
            window.run_steps(2);
            stroke(&mut window, (0.45, 0.5), (0.55, 0.5));
            settle(&mut window);
        }
        window.state_mut().canvas.zoom_by(0.5);
    }
    drag_over_mesh(&mut window, &[(0.45, 0.62), (0.55, 0.62)]);
    let radii = radii(&window);
    assert_eq!(radii.len(), 5);
    assert_eq!(radii[0], radii[1]);
    assert!((radii[2] / radii[3] - 2.0).abs() < 0.01, "{radii:?}");
    // On the mesh, which is seen at another scale, it is as many points.
    assert!(
        radii[4] != radii[2] && radii[4] > 0.005 && radii[4] < 0.5,
        "{radii:?}"
    );
}

#[test]
fn a_straight_line_over_the_mesh_snaps_to_steps_of_15_degrees() {
    let (mut window, _folder) = window();
    let click = |window: &mut Window, place| drag_over_mesh(window, &[place]);
    window.state_mut().desk.hand.take(ToolKind::SetAlpha);
    click(&mut window, (0.4, 0.62));
    let mut ends = Vec::new();
    for modifiers in [Modifiers::SHIFT, Modifiers::SHIFT | Modifiers::COMMAND] {
        hold(&mut window, modifiers);
        // Nearly level.
        click(&mut window, (0.6, 0.625));
        hold(&mut window, Modifiers::NONE);
        ends.push(*last_on_mesh(&window).last().unwrap());
        click(&mut window, (0.4, 0.62));
    }
    assert_eq!(strokes(&window), 5);
    let apart = ends[0].distance(ends[1]);
    assert!(apart > 1e-3, "{ends:?}");
}
