//! The numbers of guides: the bar of the tool, and the panel of a layer of guides.

use super::points::point_rows;
use super::{GuideHand, is_round, lay_widths, selected_guides, set, told};
use crate::gui::about;
use crate::gui::canvas::extent;
use crate::gui::desk::Desk;
use crate::gui::icons::Icon;
use crate::gui::properties::sentence;
use crate::gui::theme::Palette;
use crate::gui::tools::{shown, tips};
use crate::gui::widgets::{Bar, Tip, caption, choices, icon_button};
use anisomap::guide::{Guide, Guides, Mode, Shape};
use anisomap::recipe::{Channels, Source};
use anisomap::studio::action::Action;
use eframe::egui::{self, Ui};

/// Why the guides of the selected layer cannot be seen, where they cannot.
fn unseen(desk: &Desk) -> Option<&'static str> {
    let at = desk.studio.selected();
    let layer = desk.studio.recipe().layers.get(at)?;
    let Source::Guides(guides) = &layer.source else {
        return None;
    };
    if !layer.visible || layer.opacity == 0.0 {
        return Some("This layer is hidden: show it to see what its guides do.");
    }
    if desk.studio.solo().is_some_and(|solo| solo != at) {
        return Some("Another layer is shown alone: what these guides do is not seen.");
    }
    let channels = layer.channels;
    let widths = channels.alpha_x || channels.alpha_y;
    if !channels.direction && !widths {
        return Some("This layer does not touch the direction: its guides do nothing.");
    }
    if !guides.guide.is_empty() && !widths && is_round(desk.studio.map()) {
        return Some(NEEDS_WIDTHS);
    }
    None
}

const NEEDS_WIDTHS: &str = "Both widths are alike here: a direction does not show.";

const HOW: &str = "A drag on the map draws a guide; with Shift held it is even (a circle, a square, a line in steps of 15\u{b0}), with Alt it grows from its middle. A click selects one; handles and outlines drag.";

/// The bar of the tool: what a drag draws, how it leads, and what to know.
pub(crate) fn bar(ui: &mut Ui, desk: &mut Desk, hand: &mut GuideHand) {
    let names = Shape::NAMES.map(sentence);
    let words: Vec<(&str, &str)> = names
        .iter()
        .zip(Shape::NAMES.map(about::shape))
        .map(|(name, about)| (name.as_str(), about))
        .collect();
    let row = egui::vec2(310.0, crate::gui::theme::ROW);
    let chosen = ui.allocate_ui(row, |ui| choices(ui, ("Draw", ""), &words, hand.shape));
    if let Some(i) = chosen.inner {
        hand.shape = i;
    }
    let before = selected_guides(desk)
        .and_then(|(_, guides)| Some(guides.guide.get(hand.selected?)?.mode))
        .unwrap_or(hand.mode);
    let mut mode = before;
    let word = |mode: Mode| MODES.iter().find(|m| m.0 == mode).map_or("", |m| m.1);
    egui::ComboBox::from_id_salt("guide mode")
        .width(96.0)
        .selected_text(word(mode))
        .show_ui(ui, |ui| {
            for (one, word, leads) in MODES {
                ui.selectable_value(&mut mode, one, word)
                    .on_hover_text(leads);
            }
        })
        .response
        .accessible_name("How a guide leads")
        .on_hover_text("Which way the selected guide, and the next one, leads the direction.");
    if mode != before {
        hand.mode = mode;
        let changed =
            hand.selected.is_some() && hand.change(desk, "Lead with", |g| with_mode(g, mode));
        if changed {
            desk.studio.seal();
        }
    }
    let palette = Palette::of(ui);
    match unseen(desk) {
        Some(why) => {
            if why == NEEDS_WIDTHS
                && crate::gui::dialogs::main_button(ui, "Lay widths")
                    .on_hover_text("Lets the layer set alpha_x and alpha_y too.")
                    .clicked()
            {
                give_widths(desk);
            }
            let text = egui::RichText::new(why).color(palette.warning);
            ui.add(egui::Label::new(text).truncate()).on_hover_text(why);
        }
        None => {
            let text = "Drag: draw. Click: select. Shift: even. Alt: from the middle.";
            let text = egui::RichText::new(text).color(palette.weak);
            let how = tips(desk, HOW, &[Action::DeleteLayer, Action::Cancel]);
            ui.add(egui::Label::new(text).truncate()).on_hover_text(how);
        }
    }
}

/// Lets the selected layer of guides lay widths, whatever it touched before.
fn give_widths(desk: &mut Desk) {
    let Some((at, mut guides)) = selected_guides(desk) else {
        return;
    };
    lay_widths(&mut guides, true);
    set(desk, at, "Lay widths", guides);
    desk.edit_head(at, "Channels", |h| h.channels = Channels::ALL);
    desk.studio.seal();
}

/// `true` when it was clicked.
fn near_box(ui: &mut Ui, guides: &mut Guides) -> bool {
    ui.checkbox(&mut guides.only_near, "Only near guides")
        .on_hover_text("Whether the layer shows only where guides hold, and not between them: there the direction is the smoothest that fits all of them.")
        .changed()
}

fn with_mode(guide: &Guide, mode: Mode) -> Guide {
    Guide {
        mode,
        angle: if mode == Mode::Smooth {
            0.0
        } else {
            guide.angle
        },
        ..guide.clone()
    }
}

/// A shape to begin with, in the middle of the map.
fn first_shape(name: &str) -> Shape {
    match name {
        "line" => Shape::Line {
            points: vec![[-0.2, -0.1], [0.2, 0.1]],
            closed: false,
        },
        "curve" => Shape::Curve {
            points: vec![[-0.25, -0.1], [-0.1, 0.25], [0.1, -0.25], [0.25, 0.1]],
            closed: false,
        },
        "rectangle" => Shape::Rectangle {
            size: [0.4, 0.3],
            corner: 0.05,
        },
        "spiral" => Shape::Spiral {
            radius: 0.2,
            pitch: 0.04,
        },
        _ => Shape::Ellipse { radii: [0.2, 0.2] },
    }
}

/// Each with its word and how it leads.
const MODES: [(Mode, &str, &str); 4] = [
    (
        Mode::Concentric,
        "Concentric",
        "Along the outline, and along the lines that follow it inward and outward.",
    ),
    (
        Mode::Radial,
        "Radial",
        "Across the outline, and across the lines that follow it.",
    ),
    (
        Mode::Constant,
        "Constant",
        "One direction, its angle, which turns with the guide.",
    ),
    (
        Mode::Smooth,
        "Smooth",
        "No direction of its own: lets go what guides before it lay, and the field closes smoothly.",
    ),
];

/// The panel of a layer of guides.
pub(crate) fn panel(
    ui: &mut Ui,
    desk: &mut Desk,
    hand: &mut GuideHand,
    at: usize,
    guides: &Guides,
) {
    let mut now = guides.clone();
    let mut what = "Change guides".to_owned();
    let mut finished = layer_rows(ui, &mut now, unseen(desk));
    caption(ui, "Guides");
    let name = Shape::NAMES[hand.shape];
    if ui
        .button(format!("Add {name}"))
        .on_hover_text(
            "Puts a guide of the shape that the bar above says into the middle of the map.",
        )
        .clicked()
    {
        now.guide.push(Guide {
            center: Some([0.5; 2]),
            mode: hand.mode,
            ..Guide::new(first_shape(name))
        });
        hand.select(now.guide.len() - 1);
        what = told(
            "Add",
            &now.guide[now.guide.len() - 1].shape,
            now.guide.len() - 1,
        );
        finished = true;
    }
    let before = now.guide.len();
    finished |= list(ui, desk, hand, &mut now);
    if now.guide.len() < before {
        "Delete guide".clone_into(&mut what);
    }
    if let Some((i, guide)) = hand.selected.and_then(|i| Some((i, now.guide.get_mut(i)?))) {
        let old = guide.clone();
        let aspect = extent(desk).x;
        let rows = ui.scope(|ui| {
            let finished = guide_rows(ui, guide);
            finished | point_rows(ui, guide, (&mut hand.point, &mut hand.listed), aspect)
        });
        finished |= rows.inner;
        if *guide != old {
            what = told("Change", &guide.shape, i);
        }
        if hand.in_panel != Some(i) {
            // One that was selected on the map: its numbers come into sight, as far as there is room from the first on.
            rows.response.scroll_to_me(Some(egui::Align::TOP));
        }
    }
    hand.in_panel = hand.selected;
    if now != *guides {
        set(desk, at, &what, now);
    }
    if finished {
        desk.studio.seal();
    }
}

fn list(ui: &mut Ui, desk: &Desk, hand: &mut GuideHand, guides: &mut Guides) -> bool {
    let mut removed = None;
    let selects =
        "Selects the guide, to be changed by its handles on the map or by the numbers below.";
    for (i, guide) in guides.guide.iter().enumerate() {
        ui.horizontal(|ui| {
            let text = format!("{}  {}", i + 1, guide.shape.name());
            if ui
                .selectable_label(hand.selected == Some(i), text)
                .on_hover_text(selects)
                .clicked()
            {
                hand.select(i);
            }
            ui.with_layout(egui::Layout::right_to_left(egui::Align::Center), |ui| {
                let bin = icon_button(
                    ui,
                    Icon::Bin,
                    &format!("Delete guide {}", i + 1),
                    22.0,
                    false,
                );
                let tip = "Takes this guide away. With the guide tool in the hand the key takes the selected one away.";
                let tip = tips(desk, tip, &[Action::DeleteLayer]);
                if bin.on_hover_text(tip).clicked() {
                    removed = Some(i);
                }
            });
        });
    }
    if let Some(i) = removed {
        guides.guide.remove(i);
        hand.selected = None;
    }
    removed.is_some()
}

pub(super) fn row(
    ui: &mut Ui,
    name: &str,
    range: std::ops::RangeInclusive<f64>,
    unit: &str,
    tip: &str,
    value: &mut f32,
) -> bool {
    let mut number = shown(*value);
    let bar = Bar::new(name, range).unit(unit).show(ui, &mut number);
    if bar.response.changed() {
        *value = number as f32;
    }
    bar.response.on_hover_text(tip);
    bar.finished
}

fn guide_rows(ui: &mut Ui, guide: &mut Guide) -> bool {
    let mut finished = false;
    caption(ui, "Leads the direction");
    let at = MODES.iter().position(|m| m.0 == guide.mode).unwrap_or(0);
    if let Some(i) = choices(
        ui,
        ("Mode", ""),
        &MODES.map(|(_, word, leads)| (word, leads)),
        at,
    ) {
        *guide = with_mode(guide, MODES[i].0);
        finished = true;
    }
    if guide.mode != Mode::Smooth {
        finished |= row(
            ui,
            "Angle",
            -180.0..=180.0,
            "\u{b0}",
            "Turns the direction that the mode gives; of Constant, the direction itself.",
            &mut guide.angle,
        );
    }
    finished |= row(
        ui,
        "Strength",
        0.0..=1.0,
        "",
        "How firmly it holds: 1 is exact, 0.5 yields over about the falloff.",
        &mut guide.strength,
    );
    finished |= row(
        ui,
        "Falloff",
        0.0..=1.0,
        "surface units",
        "How far outside its shape its hold ends, surface units.",
        &mut guide.falloff,
    );
    caption(ui, "Place and size");
    let mut center = guide.center();
    for (i, name) in ["Centre u", "Centre v"].into_iter().enumerate() {
        finished |= row(
            ui,
            name,
            -1.0..=2.0,
            "UV units",
            "Where it stands, UV units.",
            &mut center[i],
        );
    }
    if center != guide.center() {
        guide.center = Some(center);
    }
    finished |= row(
        ui,
        "Rotation",
        -180.0..=180.0,
        "\u{b0}",
        "Turns it about its centre.",
        &mut guide.rotation,
    );
    finished |= row(
        ui,
        "Scale",
        0.1..=10.0,
        "",
        "Sizes it, without its falloff.",
        &mut guide.scale,
    );
    finished | shape_rows(ui, &mut guide.shape)
}

fn shape_rows(ui: &mut Ui, shape: &mut Shape) -> bool {
    let mut finished = false;
    let (unit, size) = (
        "surface units",
        "Surface units: 1 is the height of the map.",
    );
    match shape {
        Shape::Ellipse { radii } => {
            finished |= row(ui, "Radius x", 0.001..=2.0, unit, size, &mut radii[0]);
            finished |= row(ui, "Radius y", 0.001..=2.0, unit, size, &mut radii[1]);
        }
        Shape::Rectangle {
            size: sides,
            corner,
        } => {
            finished |= row(ui, "Width", 0.001..=4.0, unit, size, &mut sides[0]);
            finished |= row(ui, "Height", 0.001..=4.0, unit, size, &mut sides[1]);
            finished |= row(ui, "Corner", 0.0..=1.0, unit, size, corner);
        }
        Shape::Spiral { radius, pitch } => {
            finished |= row(ui, "Radius", 0.001..=2.0, unit, size, radius);
            finished |= row(
                ui,
                "Pitch",
                -0.5..=0.5,
                unit,
                "Outward step of one turn; below 0 it winds the other way.",
                pitch,
            );
        }
        Shape::Line { points, closed } => finished |= closed_row(ui, closed, points.len() >= 3),
        Shape::Curve { points, closed } => {
            let n = points.len();
            let mut now = *closed;
            if closed_row(ui, &mut now, true) {
                // A closed curve ends at its first point, whose own place in the list goes or comes.
                if now && n % 3 == 1 && n >= 7 {
                    points.pop();
                    *closed = true;
                } else if now {
                    let (last, first) = (points[n - 1], points[0]);
                    points.extend([last, first]);
                    *closed = true;
                } else if n % 3 == 0 {
                    points.push(points[0]);
                    *closed = false;
                }
                finished = true;
            }
        }
    }
    finished
}

fn closed_row(ui: &mut Ui, closed: &mut bool, possible: bool) -> bool {
    let enabled = possible || *closed;
    let tip = "Whether the end joins the beginning; what lies inside then belongs to the guide.";
    ui.add_enabled(enabled, egui::Checkbox::new(closed, "Closed"))
        .tip(tip)
        .changed()
}

fn layer_rows(ui: &mut Ui, guides: &mut Guides, unseen: Option<&str>) -> bool {
    let mut finished = false;
    caption(ui, "Whole layer");
    if let Some(why) = unseen {
        let text = egui::RichText::new(why).color(Palette::of(ui).warning);
        ui.add(egui::Label::new(text).wrap());
    }
    let mut widths = guides.has_widths();
    if ui
        .checkbox(&mut widths, "Lays widths")
        .on_hover_text(
            "Whether the layer sets alpha_x and alpha_y too, and not the direction alone.",
        )
        .changed()
    {
        lay_widths(guides, widths);
        finished = true;
    }
    if let (Some(along), Some(across)) = (&mut guides.alpha_along, &mut guides.alpha_across) {
        finished |= row(
            ui,
            "alpha along",
            0.001..=1.5,
            "slope width",
            "Slope width along the lines.",
            along,
        );
        finished |= row(
            ui,
            "alpha across",
            0.001..=1.5,
            "slope width",
            "Slope width across the lines.",
            across,
        );
    }
    finished |= near_box(ui, guides);
    let mut grid = f64::from(guides.grid);
    let bar = Bar::new("Grid", 16.0..=4096.0)
        .integer(true)
        .unit("cells")
        .default(1024.0)
        .show(ui, &mut grid);
    if bar.response.changed() {
        guides.grid = grid as u32;
    }
    bar.response
        .on_hover_text("Cells of the field along the longer side; it is solved once on them.");
    finished | bar.finished
}
