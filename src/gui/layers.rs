//! The stack of layers, the uppermost first.

use super::about;
use super::desk::Desk;
use super::icons::Icon;
use super::theme::Palette;
use super::tools::tips;
use super::widgets::{HEADING, Tip, heading, icon_button};
use anisomap::recipe::{Layer, LeftOut, Source};
use anisomap::studio::action::Action;
use anisomap::studio::parameters::default_pattern;
use eframe::egui::{
    self, Align2, CornerRadius, FontId, Id, Key, Rect, Response, Role, Sense, Stroke, StrokeKind,
    TextEdit, Ui, WidgetInfo, pos2, vec2,
};

/// Height of a layer's row.
const ROW: f32 = 32.0;

/// How high the list of so many layers is, with its heading.
pub(crate) fn list_height(layers: usize) -> f32 {
    HEADING + (layers.max(2) as f32) * (ROW + 1.0) + 6.0
}

/// What the list remembers.
#[derive(Default)]
pub(crate) struct LayersPanel {
    /// The layer that is being renamed, and the text so far.
    renaming: Option<(usize, String, bool)>,
}

/// What the list shows of a layer: a layer itself may hold a hundred thousand strokes.
struct Line {
    name: String,
    visible: bool,
    opacity: f32,
    is_masked: bool,
    /// Whether the mask is one to be painted on.
    takes_paint: bool,
    icon: Icon,
    /// Why it is not shown, where a file of its is missing.
    missing: Option<String>,
}

impl Line {
    fn of(layer: &Layer, missing: Option<&LeftOut>) -> Self {
        Self {
            name: layer.name().to_owned(),
            visible: layer.visible,
            opacity: layer.opacity,
            is_masked: layer.mask.is_some(),
            takes_paint: layer
                .mask
                .as_ref()
                .is_some_and(|m| m.source.name() == "strokes"),
            icon: source_icon(&layer.source),
            missing: missing.map(|left| left.reason.clone()),
        }
    }
}

/// A layer that is being dragged.
#[derive(Clone, Copy)]
struct Dragged(usize);

impl LayersPanel {
    pub(crate) fn show(&mut self, ui: &mut Ui, desk: &mut Desk) {
        heading(ui, "Layers", |ui| self.buttons(ui, desk));
        let count = desk.studio.recipe().layers.len();
        if count == 0 {
            super::widgets::body(ui, |ui| {
                ui.label(
                    egui::RichText::new("No layers. Paint on the canvas, or add a pattern with +.")
                        .color(Palette::of(ui).weak),
                );
            });
            return;
        }
        ui.spacing_mut().item_spacing.y = 1.0;
        let mut dropped = None;
        for at in (0..count).rev() {
            if let Some(from) = self.row(ui, desk, at) {
                dropped = Some((from, at));
            }
        }
        if let Some((from, to)) = dropped {
            let moved = desk.studio.move_layer(from, to);
            desk.told(moved);
        }
    }

    /// Begins to rename the selected layer.
    pub(crate) fn rename(&mut self, desk: &Desk) {
        let at = desk.studio.selected();
        if let Some(layer) = desk.studio.recipe().layers.get(at) {
            self.renaming = Some((at, layer.name().to_owned(), true));
        }
    }

    /// Whether a layer is being renamed.
    #[cfg(test)]
    pub(crate) fn is_renaming(&self) -> bool {
        self.renaming.is_some()
    }

    fn buttons(&mut self, ui: &mut Ui, desk: &mut Desk) {
        let solo = desk.studio.solo().is_some();
        for (icon, action, on) in [
            (Icon::Bin, Action::DeleteLayer, false),
            (Icon::Merge, Action::MergeDown, false),
            (Icon::Copy, Action::DuplicateLayer, false),
            (Icon::Solo, Action::SoloLayer, solo),
        ] {
            let button = icon_button(ui, icon, action.name(), 24.0, on);
            if button.on_hover_text(desk.tip(action)).clicked() {
                desk.ask(action);
            }
        }
        let tip = tips(
            desk,
            "Adds a layer above the selected one: strokes, guides, a pattern or a map.",
            &[Action::NewPaintLayer, Action::NewGuideLayer],
        );
        let plus = icon_button(ui, Icon::Plus, "Add layer", 24.0, false).on_hover_text(tip);
        egui::Popup::menu(&plus).show(|ui| add_menu(ui, desk));
    }

    /// One layer. Gives the layer that was dropped on it.
    fn row(&mut self, ui: &mut Ui, desk: &mut Desk, at: usize) -> Option<usize> {
        let layer = &desk.studio.recipe().layers[at];
        let layer = Line::of(layer, desk.studio.left_out(layer.name()));
        let selected = desk.studio.selected() == at;
        let (rect, response) =
            ui.allocate_exact_size(vec2(ui.available_width(), ROW), Sense::click_and_drag());
        response.widget_info(|| {
            WidgetInfo::selected(
                Role::ListItem,
                true,
                selected,
                match layer.missing {
                    Some(_) => format!("Layer {}, not shown", layer.name),
                    None => format!("Layer {}", layer.name),
                },
            )
        });
        let framed = (selected && layer.takes_paint).then(|| desk.studio.is_mask_selected());
        paint_row(ui, rect, &response, &layer, selected, framed);
        let over_part = self.parts(ui, desk, at, &layer, rect);
        if response.clicked() || response.drag_started() {
            desk.studio.select(at);
        }
        if response.double_clicked() {
            self.rename(desk);
        }
        response.context_menu(|ui| row_menu(ui, desk, at));
        response.dnd_set_drag_payload(Dragged(at));
        let over = response
            .dnd_hover_payload::<Dragged>()
            .filter(|d| d.0 != at);
        if let Some(dragged) = over {
            let y = if dragged.0 < at {
                rect.top()
            } else {
                rect.bottom()
            };
            let line = Stroke::new(2.0, Palette::of(ui).accent);
            ui.painter().hline(rect.x_range(), y, line);
        }
        let tip = match &layer.missing {
            Some(reason) => format!("Not shown: {reason}. Its properties find the file again."),
            None => tips(
                desk,
                "Click selects, drag reorders, a double click renames, the right button has more.",
                &[
                    Action::SelectAbove,
                    Action::SelectBelow,
                    Action::RaiseLayer,
                    Action::LowerLayer,
                    Action::RenameLayer,
                ],
            ),
        };
        let released = response
            .dnd_release_payload::<Dragged>()
            .map(|d| d.0)
            .filter(|from| *from != at);
        // A tip that is open stays as long as the pointer is over its control: the row's would keep those of its parts away.
        if !response.dragged() && !over_part {
            response.on_hover_text(tip);
        }
        released
    }

    /// The parts of a row that are controls of their own; `true` while the pointer is over one.
    fn parts(&mut self, ui: &mut Ui, desk: &mut Desk, at: usize, layer: &Line, rect: Rect) -> bool {
        let eye =
            Rect::from_center_size(pos2(rect.left() + 18.0, rect.center().y), vec2(24.0, 24.0));
        let mut child = ui.new_child(egui::UiBuilder::new().max_rect(eye));
        let icon = if layer.visible {
            Icon::Eye
        } else {
            Icon::EyeOff
        };
        let button = icon_button(
            &mut child,
            icon,
            &format!("Visible {}", layer.name),
            24.0,
            false,
        );
        let tip = tips(
            desk,
            "Shows or hides this layer.",
            &[Action::ToggleLayer, Action::SoloLayer],
        );
        let button = button.on_hover_text(tip);
        let mut over = button.contains_pointer();
        if button.clicked() {
            desk.edit_head(
                at,
                if layer.visible {
                    "Hide layer"
                } else {
                    "Show layer"
                },
                |h| h.visible = !h.visible,
            );
        }
        if layer.takes_paint {
            over |= thumbnails(ui, desk, at, layer, rect);
        }
        let left = if layer.is_masked { 86.0 } else { 62.0 };
        let name = Rect::from_min_max(
            pos2(rect.left() + left, rect.top() + 4.0),
            pos2(rect.right() - 44.0, rect.bottom() - 4.0),
        );
        match &mut self.renaming {
            Some((renamed, text, fresh)) if *renamed == at => {
                let id = Id::unique("rename layer");
                let response = ui
                    .put(
                        name,
                        TextEdit::singleline(text).id(id).margin(vec2(4.0, 3.0)),
                    )
                    .accessible_name("Layer name")
                    .tip("The layer's name; Enter takes it, Escape leaves it.");
                over |= response.contains_pointer();
                if std::mem::take(fresh) {
                    response.request_focus();
                }
                if response.lost_focus() {
                    let (_, text, _) = self.renaming.take().expect("it is being renamed");
                    if !ui.input(|i| i.key_pressed(Key::Escape)) && !text.trim().is_empty() {
                        let renamed = desk.studio.rename_layer(at, text.trim());
                        desk.told(renamed);
                    }
                }
            }
            _ => {
                let palette = Palette::of(ui);
                let colour = if layer.visible {
                    palette.text
                } else {
                    palette.weak
                };
                let mut job = egui::text::LayoutJob::simple_singleline(
                    layer.name.clone(),
                    FontId::proportional(13.0),
                    colour,
                );
                job.wrap = egui::text::TextWrapping::truncate_at_width(name.width());
                let galley = ui.painter().layout_job(job);
                ui.painter().galley(
                    pos2(name.left(), name.center().y - 0.5 * galley.size().y),
                    galley,
                    colour,
                );
            }
        }
        over
    }
}

/// A click on the one or the other says where strokes go: to the layer, or to its mask. `true` while the pointer is over one.
fn thumbnails(ui: &Ui, desk: &mut Desk, at: usize, layer: &Line, row: Rect) -> bool {
    let mut over = false;
    for mask in [false, true] {
        let id = Id::unique(("thumbnail", at, mask));
        let response = ui.interact(thumbnail(row, mask), id, Sense::click());
        let (name, what) = (&layer.name, if mask { "the mask of" } else { "the layer" });
        let chosen = desk.studio.selected() == at && desk.studio.is_mask_selected() == mask;
        response.widget_info(|| {
            WidgetInfo::selected(
                Role::Button,
                true,
                chosen,
                format!("Paint on {what} {name}"),
            )
        });
        let tip = if mask {
            let view = desk.keymap.keys_text(Action::View8);
            format!(
                "Strokes go to the mask: brushes show the layer, the eraser hides it. The coverage view ({view}) shows the mask."
            )
        } else {
            "Strokes go to the layer itself.".to_owned()
        };
        let response = response.on_hover_text(tip);
        over |= response.contains_pointer();
        if response.clicked() {
            desk.studio.select(at);
            desk.studio.select_mask(mask);
        }
    }
    over
}

/// Where a layer's own icon is, and that of its mask.
fn thumbnail(row: Rect, mask: bool) -> Rect {
    let x = row.left() + if mask { 68.0 } else { 44.0 };
    Rect::from_center_size(pos2(x, row.center().y), vec2(22.0, 22.0))
}

/// `framed` says which of both is painted on, where there are two: the mask or not.
fn paint_row(
    ui: &Ui,
    rect: Rect,
    response: &Response,
    layer: &Line,
    selected: bool,
    framed: Option<bool>,
) {
    let palette = Palette::of(ui);
    let painter = ui.painter();
    if selected {
        painter.rect_filled(
            rect,
            CornerRadius::ZERO,
            palette
                .accent_ground
                .gamma_multiply(if ui.visuals().dark_mode { 0.75 } else { 1.0 }),
        );
        let bar = Rect::from_min_size(rect.min, vec2(3.0, rect.height()));
        painter.rect_filled(bar, CornerRadius::ZERO, palette.accent);
    } else if response.hovered() {
        painter.rect_filled(rect, CornerRadius::ZERO, palette.hover.gamma_multiply(0.6));
    }
    if response.has_focus() {
        painter.rect_stroke(
            rect,
            CornerRadius::ZERO,
            Stroke::new(1.0, palette.accent),
            StrokeKind::Inside,
        );
    }
    let icon = thumbnail(rect, false).shrink(2.0);
    match layer.missing {
        Some(_) => Icon::Warning.paint(painter, icon, palette.warning),
        None => layer.icon.paint(painter, icon, palette.weak),
    }
    if let Some(mask) = framed {
        painter.rect_stroke(
            thumbnail(rect, mask),
            CornerRadius::same(2),
            Stroke::new(1.5, palette.accent),
            StrokeKind::Inside,
        );
    }
    let right = pos2(rect.right() - 10.0, rect.center().y);
    let text = format!("{:.0}%", layer.opacity * 100.0);
    painter.text(
        right,
        Align2::RIGHT_CENTER,
        text,
        FontId::proportional(12.0),
        palette.weak,
    );
    if layer.is_masked {
        let mask = thumbnail(rect, true).shrink(3.0);
        Icon::Mask.paint(painter, mask, palette.weak);
    }
}

/// What a source is shown as.
fn source_icon(source: &Source) -> Icon {
    match source.name() {
        "strokes" => Icon::Groove,
        "guides" => Icon::Guide,
        "image" | "stored" => Icon::Picture,
        "radial" => Icon::Radial,
        "scratches" => Icon::Scratch,
        "weave" => Icon::Wrap,
        "constant" => Icon::Fill,
        _ => Icon::Smooth,
    }
}

/// What can be added.
fn add_menu(ui: &mut Ui, desk: &mut Desk) {
    for action in [Action::NewPaintLayer, Action::NewGuideLayer] {
        menu_item(ui, desk, action);
    }
    ui.separator();
    for name in anisomap::pattern::Pattern::NAMES {
        let text = format!("{}{}", name[..1].to_uppercase(), &name[1..]);
        if ui
            .button(text)
            .on_hover_text(format!("Adds a pattern: {}.", about::pattern(name)))
            .clicked()
        {
            let added = default_pattern(name)
                .and_then(|p| desk.studio.add_layer(Layer::new(Source::Pattern(p))));
            desk.told(added);
        }
    }
    ui.separator();
    menu_item(ui, desk, Action::Import);
}

fn row_menu(ui: &mut Ui, desk: &mut Desk, at: usize) {
    desk.studio.select(at);
    for action in [
        Action::RenameLayer,
        Action::DuplicateLayer,
        Action::MergeDown,
        Action::SoloLayer,
        Action::RaiseLayer,
        Action::LowerLayer,
        Action::DeleteLayer,
    ] {
        menu_item(ui, desk, action);
    }
}

/// A line of a menu, with its key.
pub(crate) fn menu_item(ui: &mut Ui, desk: &mut Desk, action: Action) {
    let keys = desk
        .keymap
        .chords(action)
        .first()
        .map(ToString::to_string)
        .unwrap_or_default();
    let button = egui::Button::new(action.name()).shortcut_text(keys);
    if ui.add(button).on_hover_text(desk.tip(action)).clicked() {
        desk.ask(action);
        ui.close();
    }
}
