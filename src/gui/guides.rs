//! Guides by hand: their outlines and handles on the canvas, their numbers in the panel.

use super::canvas::extent;
use super::desk::Desk;
use super::icons::Icon;
use super::theme::Palette;
use super::tools::shown;
use super::widgets::{Bar, caption, choices, icon_button};
use anisomap::guide::{Guide, Guides, HandleKind, Mode, Modifiers, Shape};
use anisomap::recipe::{Layer, Source};
use eframe::egui::{self, Color32, Painter, Pos2, Stroke, Ui};
use glam::Vec2;

/// How near the pointer must be to a handle, and to an outline, points.
const NEAR_HANDLE: f32 = 9.0;
const NEAR_OUTLINE: f32 = 6.0;

/// What is being dragged.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Held {
    Handle(HandleKind),
    /// The whole guide, by this place on it as seen from its centre, UV units.
    Body(Vec2),
}

/// The hand on the guides of the selected layer.
#[derive(Default)]
pub(crate) struct GuideHand {
    pub(crate) selected: Option<usize>,
    held: Option<Held>,
}

/// Places on the screen and in UV.
pub(crate) struct Sheet<'a> {
    pub(crate) to_screen: &'a dyn Fn(Vec2) -> Pos2,
    pub(crate) to_uv: &'a dyn Fn(Pos2) -> Vec2,
    /// Points on the screen per surface unit.
    pub(crate) unit: f32,
}

/// The guides of the selected layer, with its place.
fn selected_guides(desk: &Desk) -> Option<(usize, Guides)> {
    let at = desk.studio.selected();
    match &desk.studio.recipe().layers.get(at)?.source {
        Source::Guides(guides) => Some((at, guides.clone())),
        _ => None,
    }
}

fn set(desk: &mut Desk, at: usize, guides: Guides) {
    let done = desk.studio.set_source(at, "Guides", Source::Guides(guides));
    desk.told(done);
}

impl GuideHand {
    /// Follows the pointer over the canvas, and draws the guides.
    pub(crate) fn show(
        &mut self,
        ui: &Ui,
        painter: &Painter,
        response: &egui::Response,
        desk: &mut Desk,
        sheet: &Sheet<'_>,
    ) {
        let Some((at, mut guides)) = selected_guides(desk) else {
            self.selected = None;
            return;
        };
        self.selected = self.selected.filter(|i| *i < guides.guide.len());
        let aspect = extent(desk).x;
        self.press(ui, response, &guides, aspect, sheet);
        if let Some(changed) = self.drag(ui, &guides, aspect, sheet) {
            guides = changed;
            set(desk, at, guides.clone());
        }
        if self.held.is_some() && !ui.input(|i| i.pointer.primary_down()) {
            self.held = None;
            desk.studio.seal();
        }
        self.paint(ui, painter, &guides, aspect, sheet);
    }

    fn press(
        &mut self,
        ui: &Ui,
        response: &egui::Response,
        guides: &Guides,
        aspect: f32,
        sheet: &Sheet<'_>,
    ) {
        let pressed = response.contains_pointer()
            && ui.input(|i| i.pointer.primary_pressed() && !i.modifiers.alt);
        let Some(pointer) = ui.input(|i| i.pointer.interact_pos()).filter(|_| pressed) else {
            return;
        };
        if let Some(i) = self.selected {
            // Those that lie over others come last.
            let mut handles = guides.guide[i].handles(aspect);
            handles.reverse();
            if let Some(handle) = handles
                .iter()
                .find(|h| (sheet.to_screen)(h.at).distance(pointer) < NEAR_HANDLE)
            {
                self.held = Some(Held::Handle(handle.kind));
                return;
            }
        }
        let uv = (sheet.to_uv)(pointer);
        let near = |g: &Guide| g.distance(uv, aspect) * sheet.unit < NEAR_OUTLINE;
        let found = guides.guide.iter().rposition(near);
        self.selected = found.or_else(|| guides.guide.iter().rposition(|g| g.contains(uv, aspect)));
        self.held = self
            .selected
            .map(|i| Held::Body(uv - Vec2::from(guides.guide[i].center())));
    }

    fn drag(&self, ui: &Ui, guides: &Guides, aspect: f32, sheet: &Sheet<'_>) -> Option<Guides> {
        let (held, i) = (self.held?, self.selected?);
        let (pointer, moved, keys) =
            ui.input(|i| (i.pointer.interact_pos(), i.pointer.is_moving(), i.modifiers));
        let uv = (sheet.to_uv)(pointer.filter(|_| moved)?);
        let modifiers = Modifiers {
            snap: keys.command,
            proportional: keys.shift,
        };
        let guide = &guides.guide[i];
        let dragged = match held {
            Held::Handle(kind) => guide.drag(kind, uv, modifiers, aspect),
            Held::Body(by) => guide.drag(HandleKind::Center, uv - by, modifiers, aspect),
        };
        (dragged != *guide).then(|| {
            let mut guides = guides.clone();
            guides.guide[i] = dragged;
            guides
        })
    }

    fn paint(&self, ui: &Ui, painter: &Painter, guides: &Guides, aspect: f32, sheet: &Sheet<'_>) {
        let accent = Palette::of(ui).accent;
        for (i, guide) in guides.guide.iter().enumerate() {
            let selected = self.selected == Some(i);
            let colour = if selected {
                accent
            } else {
                Color32::from_rgb(0x8a, 0xc6, 0xe8)
            };
            for [from, to] in guide.outline(aspect) {
                let ends = [(sheet.to_screen)(from), (sheet.to_screen)(to)];
                painter.line_segment(ends, Stroke::new(3.5, Color32::from_black_alpha(120)));
                painter.line_segment(ends, Stroke::new(1.5, colour));
            }
            if selected {
                self.paint_handles(ui, painter, guide, aspect, sheet, accent);
            }
        }
    }

    fn paint_handles(
        &self,
        ui: &Ui,
        painter: &Painter,
        guide: &Guide,
        aspect: f32,
        sheet: &Sheet<'_>,
        accent: Color32,
    ) {
        let pointer = ui.input(|i| i.pointer.hover_pos());
        let centre = (sheet.to_screen)(guide.center().into());
        for handle in guide.handles(aspect) {
            let at = (sheet.to_screen)(handle.at);
            if handle.kind == HandleKind::Rotation {
                painter.line_segment([centre, at], Stroke::new(1.0, accent.gamma_multiply(0.6)));
            }
            let hot = self.held == Some(Held::Handle(handle.kind))
                || pointer.is_some_and(|p| p.distance(at) < NEAR_HANDLE);
            let fill = if hot {
                accent
            } else {
                Color32::from_rgb(0x20, 0x22, 0x25)
            };
            let stroke = Stroke::new(1.5, if hot { Color32::WHITE } else { accent });
            match handle.kind {
                HandleKind::Rotation | HandleKind::Center => {
                    painter.circle(at, 5.0, fill, stroke);
                }
                HandleKind::Falloff => {
                    painter.circle(at, 3.5, fill, stroke);
                }
                _ => {
                    let square = egui::Rect::from_center_size(at, egui::Vec2::splat(8.0));
                    painter.rect(square, 1.0, fill, stroke, egui::StrokeKind::Middle);
                }
            }
            if hot && self.held.is_none() {
                super::widgets::overlay_text(
                    painter,
                    at + egui::vec2(10.0, 0.0),
                    egui::Align2::LEFT_CENTER,
                    handle_name(handle.kind),
                );
            }
        }
    }

    /// Takes the selected guide away; `true` when there was one.
    pub(crate) fn delete(&mut self, desk: &mut Desk) -> bool {
        let Some((at, mut guides)) = selected_guides(desk) else {
            return false;
        };
        let Some(i) = self.selected.take().filter(|i| *i < guides.guide.len()) else {
            return false;
        };
        guides.guide.remove(i);
        set(desk, at, guides);
        desk.studio.seal();
        true
    }
}

fn handle_name(kind: HandleKind) -> &'static str {
    match kind {
        HandleKind::Center => "move",
        HandleKind::Rotation => "turn; Ctrl by 15\u{b0}",
        HandleKind::Scale => "scale",
        HandleKind::Width => "width; Shift keeps the shape",
        HandleKind::Height => "height; Shift keeps the shape",
        HandleKind::Corner => "corner",
        HandleKind::Pitch => "pitch",
        HandleKind::Point(_) => "point",
        HandleKind::Falloff => "falloff",
    }
}

/// An empty layer of guides.
pub(crate) fn layer() -> Layer {
    Layer {
        name: "guides".to_owned(),
        ..Layer::new(Source::Guides(Guides::default()))
    }
}

/// A shape to begin with, in the middle of the map.
fn first_shape(name: &str) -> Shape {
    match name {
        "line" => Shape::Line {
            points: vec![[0.3, 0.4], [0.7, 0.6]],
            closed: false,
        },
        "curve" => Shape::Curve {
            points: vec![[0.25, 0.4], [0.4, 0.75], [0.6, 0.25], [0.75, 0.6]],
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

const MODES: [(Mode, &str); 4] = [
    (Mode::Concentric, "Concentric"),
    (Mode::Radial, "Radial"),
    (Mode::Constant, "Constant"),
    (Mode::Smooth, "Smooth"),
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
    let mut finished = false;
    caption(ui, "Add a guide");
    ui.horizontal_wrapped(|ui| {
        for name in Shape::NAMES {
            let word = format!("{}{}", name[..1].to_uppercase(), &name[1..]);
            if ui
                .button(word)
                .on_hover_text(format!(
                    "Puts a guide of the shape `{name}` into the middle of the map."
                ))
                .clicked()
            {
                now.guide.push(Guide::new(first_shape(name)));
                hand.selected = Some(now.guide.len() - 1);
                finished = true;
            }
        }
    });
    finished |= list(ui, hand, &mut now);
    if let Some(guide) = hand.selected.and_then(|i| now.guide.get_mut(i)) {
        finished |= guide_rows(ui, guide);
    }
    finished |= layer_rows(ui, &mut now);
    if now != *guides {
        set(desk, at, now);
    }
    if finished {
        desk.studio.seal();
    }
}

fn list(ui: &mut Ui, hand: &mut GuideHand, guides: &mut Guides) -> bool {
    let mut removed = None;
    for (i, guide) in guides.guide.iter().enumerate() {
        ui.horizontal(|ui| {
            let text = format!("{}  {}", i + 1, guide.shape.name());
            if ui
                .selectable_label(hand.selected == Some(i), text)
                .clicked()
            {
                hand.selected = Some(i);
            }
            ui.with_layout(egui::Layout::right_to_left(egui::Align::Center), |ui| {
                let bin = icon_button(
                    ui,
                    Icon::Bin,
                    &format!("Delete guide {}", i + 1),
                    22.0,
                    false,
                );
                if bin.on_hover_text("Takes the guide away.").clicked() {
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

fn row(
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
    let at = MODES
        .iter()
        .position(|(m, _)| *m == guide.mode)
        .unwrap_or(0);
    if let Some(i) = choices(ui, "Mode", &MODES.map(|(_, word)| word), at) {
        guide.mode = MODES[i].0;
        if guide.mode == Mode::Smooth {
            guide.angle = 0.0;
        }
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
        "",
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
            "",
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
    let size = "Surface units: 1 is the height of the map.";
    match shape {
        Shape::Ellipse { radii } => {
            finished |= row(ui, "Radius x", 0.001..=2.0, "", size, &mut radii[0]);
            finished |= row(ui, "Radius y", 0.001..=2.0, "", size, &mut radii[1]);
        }
        Shape::Rectangle {
            size: sides,
            corner,
        } => {
            finished |= row(ui, "Width", 0.001..=4.0, "", size, &mut sides[0]);
            finished |= row(ui, "Height", 0.001..=4.0, "", size, &mut sides[1]);
            finished |= row(ui, "Corner", 0.0..=1.0, "", size, corner);
        }
        Shape::Spiral { radius, pitch } => {
            finished |= row(ui, "Radius", 0.001..=2.0, "", size, radius);
            finished |= row(
                ui,
                "Pitch",
                -0.5..=0.5,
                "",
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
        .on_hover_text(tip)
        .changed()
}

fn layer_rows(ui: &mut Ui, guides: &mut Guides) -> bool {
    let mut finished = false;
    caption(ui, "Whole layer");
    let mut widths = guides.has_widths();
    if ui
        .checkbox(&mut widths, "Lays widths")
        .on_hover_text(
            "Whether the layer sets alpha_x and alpha_y too, and not the direction alone.",
        )
        .changed()
    {
        let (along, across) = guides.widths();
        guides.alpha_along = widths.then_some(along);
        guides.alpha_across = widths.then_some(across);
        finished = true;
    }
    if let (Some(along), Some(across)) = (&mut guides.alpha_along, &mut guides.alpha_across) {
        finished |= row(
            ui,
            "alpha along",
            0.001..=1.5,
            "",
            "Slope width along the lines.",
            along,
        );
        finished |= row(
            ui,
            "alpha across",
            0.001..=1.5,
            "",
            "Slope width across the lines.",
            across,
        );
    }
    finished |= ui
        .checkbox(&mut guides.only_near, "Only near guides")
        .on_hover_text("Whether the layer shows only where guides hold, and not between them.")
        .changed();
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
