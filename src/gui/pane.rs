//! What the two pictures share: the pen, the strip above, circles, pixels that become a texture.

use super::theme::Palette;
use anisomap::map::{Rect as Texels, Size};
use eframe::egui::{
    self, Color32, ColorImage, CornerRadius, Event, Painter, PointerButton, Pos2, Response, Role,
    Sense, Stroke, TextureHandle, TextureOptions, Ui, WidgetInfo, vec2,
};

/// Height of the strip with the views' names.
pub(crate) const STRIP: f32 = 32.0;

/// What the pen, or the left button, does over a picture.
pub(crate) enum Pen {
    /// It comes down here.
    Down(Pos2),
    /// It goes on to here.
    Move(Pos2),
    /// It is lifted.
    Up,
}

/// What the pen did since the last frame, in its order: where a frame takes long, a whole stroke may lie between two.
pub(crate) fn pen(ui: &Ui, response: &Response) -> Vec<Pen> {
    let busy = ui.ctx().dragged_id().is_some_and(|id| id != response.id);
    let layer = ui.layer_id();
    let meant = |at: Pos2| {
        let over = ui.ctx().layer_id_at(at);
        !busy && response.interact_rect.contains(at) && over.is_none_or(|l| l == layer)
    };
    let of = |event: &Event| match *event {
        Event::PointerMoved(at) => Some(Pen::Move(at)),
        Event::PointerButton {
            pos,
            button: PointerButton::Primary,
            pressed,
            ..
        } => match pressed {
            true => meant(pos).then_some(Pen::Down(pos)),
            false => Some(Pen::Up),
        },
        _ => None,
    };
    let events = ui.input(|i| i.events.clone());
    events.iter().filter_map(of).collect()
}

/// The pen's pressure, 1 where the system tells none.
pub(crate) fn pressure(ui: &Ui) -> f32 {
    ui.input(|i| {
        let force = i.events.iter().rev().find_map(|e| match e {
            Event::Touch { force, .. } => *force,
            _ => None,
        });
        force.unwrap_or(1.0)
    })
}

/// A circle that shows on light and dark ground.
pub(crate) fn ring(painter: &Painter, centre: Pos2, radius: f32, strength: f32) {
    painter.circle_stroke(
        centre,
        radius,
        Stroke::new(2.5, Color32::from_black_alpha((120.0 * strength) as u8)),
    );
    let white = Color32::from_white_alpha((235.0 * strength) as u8);
    painter.circle_stroke(centre, radius, Stroke::new(1.0, white));
}

/// The strip above a picture.
pub(crate) fn strip(ui: &mut Ui, contents: impl FnOnce(&mut Ui)) {
    let palette = Palette::of(ui);
    let (rect, _) = ui.allocate_exact_size(vec2(ui.available_width(), STRIP), Sense::hover());
    ui.painter()
        .rect_filled(rect, CornerRadius::ZERO, palette.header);
    let mut child = ui.new_child(
        egui::UiBuilder::new()
            .max_rect(rect.shrink2(vec2(6.0, 3.0)))
            .layout(egui::Layout::left_to_right(egui::Align::Center)),
    );
    child.set_clip_rect(rect.intersect(ui.clip_rect()));
    child.spacing_mut().item_spacing.x = 2.0;
    contents(&mut child);
}

/// A word in a strip that shows something when it is clicked.
pub(crate) fn tab(ui: &mut Ui, name: &str, chosen: bool) -> Response {
    let palette = Palette::of(ui);
    let font = egui::FontId::proportional(12.5);
    let colour = if chosen { palette.text } else { palette.weak };
    let galley = ui.painter().layout_no_wrap(name.to_owned(), font, colour);
    let (rect, response) = ui.allocate_exact_size(galley.size() + vec2(11.0, 9.0), Sense::click());
    response.widget_info(|| WidgetInfo::selected(Role::Tab, true, chosen, name));
    let round = CornerRadius::same(4);
    if chosen {
        ui.painter().rect_filled(rect, round, palette.accent_ground);
    } else if response.hovered() {
        ui.painter().rect_filled(rect, round, palette.hover);
    }
    if response.has_focus() {
        ui.painter().rect_stroke(
            rect,
            round,
            Stroke::new(1.0, palette.accent),
            egui::StrokeKind::Inside,
        );
    }
    ui.painter()
        .galley(rect.center() - 0.5 * galley.size(), galley, colour);
    response
}

/// Puts a rectangle of pixels into a texture of `size`, which is made where it is missing or of another size.
pub(crate) fn put(
    ui: &Ui,
    texture: &mut Option<TextureHandle>,
    name: &str,
    size: Size,
    part: Texels,
    image: ColorImage,
) {
    let sides = [size.width() as usize, size.height() as usize];
    let options = TextureOptions::NEAREST;
    let fits = texture.as_ref().is_some_and(|t| t.size() == sides);
    if part == size.rect() {
        match texture {
            Some(texture) => texture.set(image, options),
            None => *texture = Some(ui.ctx().load_texture(name, image, options)),
        }
    } else if fits && let Some(texture) = texture {
        texture.set_partial([part.x as usize, part.y as usize], image, options);
    }
}
