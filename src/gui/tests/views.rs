//! What the views over the lit map say of themselves.

use super::*;

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
