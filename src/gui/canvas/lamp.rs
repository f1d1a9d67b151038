//! The ball by which the light of the lit map is moved, and the keys that move light and map.

use super::CanvasPane;
use crate::gui::desk::Desk;
use crate::gui::steer::{
    BALL, Steered, ball_centre, ball_rect, focus_frame, focus_text, light_text, on_ball, paint_ball,
};
use anisomap::studio::action::Action;
use anisomap::studio::view::Camera2d;
use eframe::egui::{self, Event, Painter, PointerButton, Pos2, Response, Role, Sense, Ui};
use glam::{DVec2, Vec2, Vec3};

/// How far a step of the keys moves the sun on the ball, as a part of its radius, and the map, as a part of the canvas.
const LIGHT_STEP: f32 = 0.05;
const MAP_STEP: f64 = 0.05;
/// What a step zooms by.
const ZOOM_STEP: f64 = 1.25;

const LIGHT_KEYS: &str = "arrow keys move the light, with Shift finely";
const MAP_KEYS: &str = "arrow keys move the map, with Alt up and down zoom, with Shift finely";

impl CanvasPane {
    /// The lamp of the lit view: a ball in the corner, lit from where the sun on it stands.
    pub(super) fn light_handle(
        &mut self,
        ui: &Ui,
        painter: &Painter,
        response: &Response,
        desk: &mut Desk,
    ) {
        let id = response.id.with("light");
        let ball = ui.interact(ball_rect(self.rect), id, Sense::focusable_noninteractive());
        let goes = desk.tip(Action::FocusControls);
        let tip = format!("The light of the map: drag it. With the focus {LIGHT_KEYS}.\n{goes}");
        let steered = Steered {
            role: Role::Slider,
            name: "Light of the map",
            state: light_text(self.light),
            tip: &tip,
        };
        for step in steered.steps(ui, &ball, desk) {
            let by = step.by * LIGHT_STEP;
            self.move_light(Vec2::new(self.light.x, self.light.y) + by);
        }
        let focused = ball.has_focus();
        let hot =
            self.holding_light || focused || response.hover_pos().is_some_and(|p| self.is_lamp(p));
        paint_ball(
            ui,
            painter,
            self.rect,
            &[self.light.normalize_or(Vec3::Z)],
            hot,
        );
        if focused {
            focus_text(painter, self.rect, LIGHT_KEYS);
        }
        if !self.holding_light {
            ball.on_hover_text(tip);
        }
    }

    /// Moves the light to a place on the ball, or on its rim.
    fn move_light(&mut self, flat: Vec2) {
        let flat = flat.clamp_length_max(0.98);
        self.light = Vec3::new(flat.x, flat.y, (1.0 - flat.length_squared()).sqrt());
    }

    /// Moves the map by the arrow keys while the canvas has the focus.
    pub(super) fn steer(
        &self,
        ui: &Ui,
        response: &Response,
        desk: &mut Desk,
        camera: &mut Camera2d,
    ) {
        let zoom = 100.0 * camera.pixels_per_texel().y;
        let steered = Steered {
            role: Role::Canvas,
            name: "Paint canvas",
            state: format!("zoom {zoom:.0}%"),
            tip: MAP_KEYS,
        };
        let size = DVec2::new(
            f64::from(camera.size.width()),
            f64::from(camera.size.height()),
        );
        for step in steered.steps(ui, response, desk) {
            let by = step.by.as_dvec2();
            *camera = if step.alt {
                camera.zoomed(self.map, 0.5 * size, ZOOM_STEP.powf(by.y))
            } else {
                camera.panned(self.map, DVec2::new(by.x, -by.y) * MAP_STEP * size)
            };
        }
    }

    /// Shows that the keyboard has the canvas.
    pub(super) fn show_focus(&self, ui: &Ui, painter: &Painter, response: &Response) {
        if response.has_focus() {
            focus_frame(ui, painter, self.rect);
            focus_text(painter, self.rect, MAP_KEYS);
        }
    }

    pub(super) fn is_lamp(&self, at: Pos2) -> bool {
        self.kind.is_lit() && on_ball(self.rect, at)
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
            let centre = ball_centre(self.rect);
            let from = pointer.map_or(egui::Vec2::ZERO, |p| (p - centre) / BALL);
            Vec2::new(from.x, -from.y)
        };
        self.move_light(flat);
        true
    }
}

/// Where an event presses the first button, or lets it go.
pub(crate) fn button(event: &Event, is_pressed: bool) -> Option<Pos2> {
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
