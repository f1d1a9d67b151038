//! Nothing is cut off, in whatever window and with text of whatever size.

use super::tips::{Control, controls, node};
use super::*;
use crate::gui::import::{ImportDialog, look_at};
use eframe::egui::Shape;
use std::collections::HashSet;

/// Sizes of a window in points: 1440 x 900 with text of twice the size, the smallest window, a large one.
const SIZES: [Vec2; 3] = [vec2(720.0, 450.0), vec2(860.0, 560.0), vec2(1920.0, 1200.0)];

fn rect(window: &Window, control: &Control) -> Rect {
    node(window, control.id).unwrap().rect()
}

/// What of the controls above the pictures lies outside the window or over another one.
fn amiss(window: &Window, place: &str) -> Vec<String> {
    let screen = window.ctx.content_rect();
    let pictures = window.get_by_label("Paint canvas").rect().top();
    let above: Vec<(Control, Rect)> = controls(window)
        .into_iter()
        .map(|c| (rect(window, &c), c))
        .map(|(r, c)| (c, r))
        .filter(|(_, r)| r.bottom() < pictures)
        .collect();
    assert!(above.len() > 10, "{place}");
    let mut wrong = Vec::new();
    for (i, (control, rect)) in above.iter().enumerate() {
        let name = format!("{place}: {:?} {} {rect:?}", control.role, control.name);
        if !screen.contains_rect(*rect) {
            wrong.push(format!("{name} is cut off"));
        }
        let others = above[..i].iter();
        for (other, there) in others.filter(|(_, r)| r.shrink(0.5).intersects(*rect)) {
            // A handle between panels lies half over both.
            let is_handle =
                |c: &Control| matches!(c.role, Role::Splitter) || c.name.contains("Split");
            if !is_handle(control) && !is_handle(other) {
                wrong.push(format!("{name} lies over {} {there:?}", other.name));
            }
        }
    }
    wrong
}

/// The texts that are shown, and where; of those that are `elided` only a part, before an ellipsis.
fn shown(window: &Window, elided: bool) -> Vec<(String, Rect)> {
    fn of(shape: &Shape, elided: bool, found: &mut Vec<(String, Rect)>) {
        match shape {
            Shape::Text(text) if text.galley.elided == elided => {
                let rect = text.galley.rect.translate(text.pos.to_vec2());
                found.push((text.galley.text().to_owned(), rect));
            }
            Shape::Vec(shapes) => shapes.iter().for_each(|s| of(s, elided, found)),
            _ => {}
        }
    }
    let mut found = Vec::new();
    for clipped in &window.output().shapes {
        of(&clipped.shape, elided, &mut found);
    }
    found
}

/// Texts of which only a part is shown, even where the pointer rests on them.
fn cut_short(window: &mut Window, place: &str) -> Vec<String> {
    let mut wrong = Vec::new();
    for (text, at) in shown(window, true) {
        let whole = |window: &Window| {
            let all = shown(window, false).into_iter();
            all.filter(|(t, _)| *t == text).count()
        };
        let before = whole(window);
        window.hover_at(at.center());
        window.run_steps(3);
        if whole(window) <= before {
            wrong.push(format!("{place}: {text:?} is elided at {at:?}"));
        }
        window.hover_at(Pos2::ZERO);
        window.run_steps(2);
    }
    wrong
}

/// A window whose tips come at once.
fn telling() -> (Window, TempDir) {
    let (window, folder) = window();
    window.ctx.all_styles_mut(|style| {
        style.interaction.tooltip_delay = 0.0;
        style.interaction.show_tooltips_only_when_still = false;
    });
    (window, folder)
}

#[test]
fn the_bars_of_every_tool_fit_into_every_window() {
    let (mut window, _folder) = telling();
    let mut wrong = Vec::new();
    for size in SIZES {
        window.set_size(size);
        for on_mask in [false, true] {
            if on_mask && !window.state().desk.studio.is_mask_selected() {
                window
                    .state_mut()
                    .desk
                    .studio
                    .add_painted_mask(1, true)
                    .unwrap();
            }
            window.state_mut().desk.studio.select_mask(on_mask);
            for kind in ToolKind::ALL {
                window.state_mut().desk.hand.take(kind);
                window.run_steps(3);
                let place = format!("{} at {size:?}, mask {on_mask}", kind.name());
                wrong.extend(amiss(&window, &place));
                wrong.extend(cut_short(&mut window, &place));
            }
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn every_dialog_can_be_reached_whole_in_every_window() {
    let (mut window, folder) = telling();
    for kind in ["Roughness", "Anisotropic", "Rotation"] {
        let grey = image::GrayImage::from_pixel(8, 8, image::Luma([128]));
        grey.save(folder.path().join(format!("s_{kind}.png")))
            .unwrap();
    }
    let mut wrong = Vec::new();
    for size in SIZES {
        window.set_size(size);
        for action in [
            Action::New,
            Action::Open,
            Action::Presets,
            Action::Settings,
            Action::Shortcuts,
            Action::Export,
            Action::Import,
        ] {
            window.state_mut().dialog = None;
            window.run_steps(3);
            let below: HashSet<_> = controls(&window).iter().map(|c| c.id).collect();
            if action == Action::Import {
                let seen = look_at(&folder.path().join("s_Rotation.png")).unwrap();
                let import = ImportDialog::new(Box::new(seen));
                window.state_mut().dialog = Some(Dialog::Import(Box::new(import)));
                window.run_steps(3);
                window
                    .get_by_label("What the numbers mean")
                    .click_accesskit();
            } else {
                window.state_mut().desk.ask(action);
            }
            window.run_steps(4);
            let mut own = controls(&window);
            own.retain(|c| !below.contains(&c.id));
            assert!(!own.is_empty(), "{action:?}");
            for control in own {
                node(&window, control.id).unwrap().scroll_to_me();
                window.run_steps(4);
                let (screen, at) = (window.ctx.content_rect(), rect(&window, &control));
                if !screen.contains_rect(at) {
                    let name = &control.name;
                    wrong.push(format!("{action:?} at {size:?}: {name} {at:?}"));
                }
                wrong.extend(cut_short(&mut window, &format!("{action:?} at {size:?}")));
            }
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn the_status_line_says_no_two_things_in_one_place() {
    let (mut window, _folder) = window();
    for size in SIZES {
        window.set_size(size);
        for over_map in [false, true] {
            window.run_steps(3);
            let at = match over_map {
                false => window.ctx.content_rect().left_top(),
                true => window.get_by_label("Paint canvas").rect().center(),
            };
            window.hover_at(at);
            window.run_steps(2);
            let line = window.ctx.content_rect().bottom() - 40.0;
            let labels = window.query_all_by(|node| node.role() == Role::Label);
            let mut said: Vec<Rect> = labels.map(|n| n.rect()).collect();
            said.retain(|r| r.top() > line);
            said.sort_by(|a, b| a.left().total_cmp(&b.left()));
            assert!(said.len() >= 3, "{size:?}: {said:?}");
            for pair in said.windows(2) {
                let apart = pair[1].left() - pair[0].right();
                assert!(apart >= 0.0 || pair[0] == pair[1], "{size:?}: {pair:?}");
            }
            let right = said[said.len() - 1].right();
            assert!(right <= window.ctx.content_rect().right(), "{size:?}");
        }
    }
}
