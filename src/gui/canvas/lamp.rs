//! The ball by which the light of the lit map is moved.

use super::CanvasPane;
use crate::gui::icons::Icon;
use crate::gui::theme::Palette;
use crate::gui::widgets::overlay_text;
use eframe::egui::{
    self, Align2, Color32, Event, Painter, PointerButton, Pos2, Rect, Response, Stroke, Ui, vec2,
};
use glam::{Vec2, Vec3};

/// Radius of the ball by which the light is moved, points.
const LAMP: f32 = 24.0;

impl CanvasPane {
    /// The lamp of the lit view: a ball in the corner, lit from where the sun on it stands.
    pub(super) fn light_handle(&self, ui: &Ui, painter: &Painter, response: &Response) {
        let (centre, sun) = (self.lamp_centre(), self.light_place());
        let hot = self.holding_light || response.hover_pos().is_some_and(|p| self.is_lamp(p));
        painter.circle_filled(
            centre,
            LAMP + 5.0,
            Color32::from_black_alpha(if hot { 200 } else { 130 }),
        );
        let ring = if hot {
            Palette::of(ui).accent
        } else {
            Color32::from_white_alpha(90)
        };
        painter.circle_stroke(centre, LAMP, Stroke::new(1.0, ring));
        painter.line_segment(
            [centre, sun],
            Stroke::new(1.0, Color32::from_white_alpha(60)),
        );
        let colour = if hot {
            Palette::of(ui).accent
        } else {
            Color32::from_rgb(0xf3, 0xea, 0xd8)
        };
        Icon::Sun.paint(
            painter,
            Rect::from_center_size(sun, vec2(17.0, 17.0)),
            colour,
        );
        if hot {
            overlay_text(
                painter,
                centre + vec2(0.0, LAMP + 9.0),
                Align2::CENTER_TOP,
                "drag the light",
            );
        }
    }

    pub(super) fn lamp_centre(&self) -> Pos2 {
        self.rect.right_top() + vec2(-LAMP - 14.0, LAMP + 14.0)
    }

    pub(super) fn is_lamp(&self, at: Pos2) -> bool {
        self.kind.is_lit() && at.distance(self.lamp_centre()) < LAMP + 5.0
    }

    pub(super) fn light_place(&self) -> Pos2 {
        let flat = Vec2::new(self.light.x, self.light.y) / self.light.length().max(1e-6);
        self.lamp_centre() + vec2(flat.x, -flat.y) * LAMP
    }

    /// Moves the light while its ball is dragged, or Shift and the right button are; `true` while it is.
    pub(super) fn hold_light(&mut self, ui: &Ui, response: &Response) -> bool {
        if !self.kind.is_lit() {
            self.holding_light = false;
            return false;
        }
        let by_chord =
            response.dragged_by(PointerButton::Secondary) && ui.input(|i| i.modifiers.shift);
        // Where the button went down, not where the pointer is by the end of the frame.
        let pressed = ui.input(|i| i.events.iter().find_map(|e| button(e, true)));
        let taken = response.contains_pointer() && pressed.is_some_and(|at| self.is_lamp(at));
        self.holding_light = (self.holding_light || taken) && ui.input(|i| i.pointer.any_down());
        // Let go in the frame in which it was taken, it moved all the same.
        if !self.holding_light && !taken && !by_chord {
            return false;
        }
        let released = ui.input(|i| i.events.iter().rev().find_map(|e| button(e, false)));
        let released = released.filter(|_| !self.holding_light);
        let pointer = released.or_else(|| ui.input(|i| i.pointer.interact_pos()));
        let flat = if by_chord {
            let moved = response.drag_delta() / (0.4 * self.rect.size().min_elem().max(1.0));
            Vec2::new(self.light.x + moved.x, self.light.y - moved.y)
        } else {
            let from = pointer.map_or(egui::Vec2::ZERO, |p| (p - self.lamp_centre()) / LAMP);
            Vec2::new(from.x, -from.y)
        };
        let flat = flat.clamp_length_max(0.98);
        self.light = Vec3::new(flat.x, flat.y, (1.0 - flat.length_squared()).sqrt());
        true
    }
}

/// Where an event presses the first button, or lets it go.
fn button(event: &Event, is_pressed: bool) -> Option<Pos2> {
    match event {
        Event::PointerButton {
            pos,
            button: PointerButton::Primary,
            pressed,
            ..
        } if *pressed == is_pressed => Some(*pos),
        _ => None,
    }
}
