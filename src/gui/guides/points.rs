//! The points of a line or curve as numbers, and the list that chooses one of them.

use super::knot_of;
use super::panel::row;
use crate::gui::theme::ROW;
use crate::gui::widgets::{Bar, caption};
use anisomap::guide::{Guide, HandleKind, Modifiers, Shape};
use eframe::egui::{ScrollArea, Ui};
use glam::Vec2;

/// The most rows of the list that are shown at a time: a curve may have a thousand points.
const ROWS: usize = 6;

/// What the nth of a path's points is.
fn point_name(shape: &Shape, i: usize) -> String {
    match shape {
        Shape::Curve { points, .. } if !i.is_multiple_of(3) => {
            let place = knot_of(i, points.len()) / 3 + 1;
            match i % 3 {
                1 => format!("after {place}"),
                _ => format!("before {place}"),
            }
        }
        Shape::Curve { .. } => format!("Point {}", i / 3 + 1),
        _ => format!("Point {}", i + 1),
    }
}

/// Where a guide's points are, UV units.
fn places(guide: &Guide, aspect: f32) -> Vec<Vec2> {
    let handles = guide.handles(aspect);
    let points = handles.iter().filter_map(|h| match h.kind {
        HandleKind::Point(_) => Some(h.at),
        _ => None,
    });
    points.collect()
}

/// Rows for the points of a path: which one is meant, its place, and all of them; `true` when a change is complete. `listed` is the
/// point that the list was last brought to.
pub(super) fn point_rows(
    ui: &mut Ui,
    guide: &mut Guide,
    (point, listed): (&mut usize, &mut Option<usize>),
    aspect: f32,
) -> bool {
    let places = places(guide, aspect);
    let Some(last) = places.len().checked_sub(1) else {
        return false;
    };
    *point = (*point).min(last);
    caption(ui, "Points");
    let mut number = (*point + 1) as f64;
    let bar = Bar::new("Number", 1.0..=(last + 1) as f64)
        .integer(true)
        .show(ui, &mut number);
    if bar.response.changed() {
        *point = (number as usize).clamp(1, last + 1) - 1;
    }
    bar.response
        .on_hover_text("Which point the two numbers below are of; on the map it is filled.");
    let mut at = places[*point].to_array();
    let mut finished = false;
    for (value, name) in at.iter_mut().zip(["Point u", "Point v"]) {
        let tip = "Where the point lies, UV units; of a curve's points that hang on another one, where its tangent ends.";
        finished |= row(ui, name, -1.0..=2.0, "UV units", tip, value);
    }
    if at != places[*point].to_array() {
        let kind = HandleKind::Point(*point);
        *guide = guide.drag(kind, at.into(), Modifiers::default(), aspect);
    }
    list(ui, guide, &places, (point, listed));
    finished
}

fn list(
    ui: &mut Ui,
    guide: &Guide,
    places: &[Vec2],
    (point, listed): (&mut usize, &mut Option<usize>),
) {
    let show = |ui: &mut Ui, point: &mut usize, listed: &mut Option<usize>, i: usize| {
        let at = places[i];
        let text = format!("{}:  {:.3}, {:.3}", point_name(&guide.shape, i), at.x, at.y);
        let label = ui.selectable_label(*point == i, text);
        let tip = "Takes this point: its numbers are above. Name, u and v.";
        if label.on_hover_text(tip).clicked() {
            (*point, *listed) = (i, Some(i));
        }
    };
    if places.len() <= ROWS {
        (0..places.len()).for_each(|i| show(ui, point, listed, i));
        return;
    }
    let high = ROW + ui.spacing().item_spacing.y;
    let mut area = ScrollArea::vertical()
        .id_salt("points")
        .max_height(high * ROWS as f32)
        .auto_shrink([false, true]);
    if *listed != Some(*point) {
        // One that was chosen elsewhere comes into sight.
        let above = point.saturating_sub(ROWS / 2);
        area = area.vertical_scroll_offset(above as f32 * high);
        *listed = Some(*point);
    }
    area.show_rows(ui, ROW, places.len(), |ui, shown| {
        for i in shown {
            show(ui, point, listed, i);
        }
    });
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn points_of_a_curve_are_named_by_the_place_they_hang_on() {
        let curve = |n: usize, closed: bool| Shape::Curve {
            points: vec![[0.0; 2]; n],
            closed,
        };
        let names = |shape: &Shape, n: usize| -> Vec<String> {
            (0..n).map(|i| point_name(shape, i)).collect()
        };
        let open = ["Point 1", "after 1", "before 2", "Point 2"];
        assert_eq!(names(&curve(4, false), 4), open);
        let closed = names(&curve(6, true), 6);
        assert_eq!(closed[4..], ["after 2", "before 1"]);
        let line = Shape::Line {
            points: vec![[0.0; 2]; 3],
            closed: false,
        };
        assert_eq!(names(&line, 3), ["Point 1", "Point 2", "Point 3"]);
    }
}
