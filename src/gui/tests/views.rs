//! What the views over the lit map say of themselves.

use super::*;
use anisomap::progress::Progress;
use anisomap::studio::view::Coverage;

/// Steps until a text is shown.
#[track_caller]
fn wait_for(window: &mut Window, text: &str) -> Vec<String> {
    for _ in 0..400 {
        window.step();
        let shown = texts(window);
        if shown.iter().any(|t| t.contains(text)) {
            return shown;
        }
        std::thread::sleep(Duration::from_millis(5));
    }
    panic!("no `{text}` in {:?}", texts(window));
}

#[test]
fn the_lint_view_tells_of_edges_of_the_map_that_the_mesh_does_not_show() {
    let folder = tempfile::tempdir().unwrap();
    let square = "v -1 -1 0\nv 1 -1 0\nv 1 1 0\nv -1 1 0\n\
        vt 0.3 0.3\nvt 0.7 0.3\nvt 0.7 0.7\nvt 0.3 0.7\nf 1/1 2/2 3/3\nf 1/1 3/3 4/4\n";
    std::fs::write(folder.path().join("square.obj"), square).unwrap();
    let unseen = "where the mesh does not show it, the direction jumps by";
    for (mesh, is_seen) in [("square.obj", false), ("plane", true)] {
        let path = folder.path().join("rings.toml");
        let text = format!(
            "version = 1\nname = 'rings'\nsize = 64\nmesh = '{mesh}'\n[[layers]]\nname = 'rings'\n[layers.radial]\n"
        );
        std::fs::write(&path, text).unwrap();
        let settings = Settings {
            hint_closed: true,
            ..Settings::default()
        };
        let file = RecipeFile::read(&path).unwrap();
        let app = App::new((file, Some(path)), settings, None).unwrap();
        let mut window = window_of(app, vec2(1200.0, 760.0));
        press(&mut window, "9");
        let seams = match is_seen {
            true => "seams jump by up to",
            false => "no seam jumps on the mesh",
        };
        let shown = wait_for(&mut window, seams);
        assert_eq!(shown.iter().any(|t| t.contains(unseen)), !is_seen, "{mesh}");
    }
}

#[test]
fn the_coverage_of_any_layer_has_a_legend_and_one_that_is_hidden_says_so() {
    let (mut window, _folder) = window();
    press(&mut window, "8");
    // Numbers that stand nowhere else.
    let has_legend = |shown: &[String]| ["25%", "75%"].iter().all(|n| shown.iter().any(|t| t == n));
    assert!(has_legend(&wait_for(&mut window, "What paint covers")));
    press(&mut window, "PageDown");
    assert!(has_legend(&wait_for(&mut window, "What ground covers")));
    let at = window.state().desk.studio.selected();
    window
        .state_mut()
        .desk
        .edit_head(at, "Opacity", |head| head.opacity = 0.5);
    wait_for(&mut window, "What ground covers, times its opacity of 50%");
    press(&mut window, "H");
    let shown = wait_for(&mut window, "ground is not shown: it covers nothing");
    assert!(!has_legend(&shown), "{shown:?}");
}

#[test]
fn the_coverage_follows_strokes_and_what_is_undone_whatever_takes_longer_than_a_frame() {
    let folder = tempfile::tempdir().unwrap();
    let mask = "[layers.mask]\nlow = 0.4\nhigh = 0.6\n[layers.mask.brushed]\nangle = 10\n";
    let text = SMALL
        .replace("size = 64", "size = 1024")
        .replace("[layers.strokes]", &format!("{mask}[layers.strokes]"));
    let mut window = window_of(app(folder.path(), &text), vec2(1200.0, 760.0));
    press(&mut window, "8");
    wait_for(&mut window, "What paint covers");
    // Steps until nothing is behind, and gives how much is covered.
    let follow = |window: &mut Window| {
        for _ in 0..400 {
            window.step();
            let state = window.state();
            if let Some(shown) = state.canvas.overlay.whole_coverage()
                && !state.desk.studio.is_behind()
            {
                let order = state.desk.studio.coverage().unwrap();
                let values = order.carry_out(&Progress::none()).unwrap();
                let covered = values.iter().filter(|v| **v > 0.0).count();
                assert!(*shown == Coverage::new(shown.size(), values).unwrap());
                return covered;
            }
            std::thread::sleep(Duration::from_millis(5));
        }
        panic!("the coverage is never whole");
    };
    assert_eq!(follow(&mut window), 0);
    stroke(&mut window, (0.35, 0.5), (0.65, 0.5));
    land(&mut window);
    let one = follow(&mut window);
    assert!(one > 1000, "{one}");
    window.state_mut().desk.hand.take(ToolKind::Fill);
    stroke(&mut window, (0.5, 0.6), (0.5, 0.6));
    assert!(follow(&mut window) > one);
    press(&mut window, "Ctrl+Z");
    assert_eq!(follow(&mut window), one);
    press(&mut window, "Ctrl+Z");
    assert_eq!(follow(&mut window), 0);
}
