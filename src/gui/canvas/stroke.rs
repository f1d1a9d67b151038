//! The pen on the canvas: strokes, straight lines, size and flow dragged.

use super::{CanvasPane, extent};
use crate::gui::desk::Desk;
use crate::gui::pane::{Pen, pen, pressure};
use anisomap::paint::Point;
use anisomap::paint::path::{PulledString, Steady, snap_angle};
use anisomap::studio::hand::ToolKind;
use anisomap::studio::orbit::{Button, Drag};
use anisomap::studio::view::Camera2d;
use eframe::egui::{self, Pos2, Response, Ui};
use glam::Vec2;
use std::sync::Arc;

/// A stroke in flight.
pub(super) struct Drawing {
    string: PulledString,
    /// The path of what the string pulls.
    steady: Steady,
    /// Whole turns of UV that are taken off, so that a stroke on a copy of the map is one on the map.
    turns: Vec2,
    inverse: bool,
    /// Set where the stroke is one straight line: nothing between its ends counts.
    line_from: Option<Vec2>,
}

impl CanvasPane {
    pub(super) fn paint_with_pen(
        &mut self,
        ui: &Ui,
        response: &Response,
        desk: &mut Desk,
        camera: Camera2d,
    ) {
        if desk.pointer_taken || self.hold_light(ui, response) {
            return;
        }
        let modifiers = ui.input(|i| i.modifiers);
        let space = ui.input(|i| i.key_down(egui::Key::Space));
        let drag = desk.settings.navigation.drag(
            Button::Left,
            modifiers.command,
            modifiers.alt,
            modifiers.shift,
        );
        let (was_drawing, force) = (self.drawing.is_some(), pressure(ui));
        for pen in pen(ui, response) {
            match pen {
                Pen::Down(at) if !space && drag == Some(Drag::Tool) => {
                    self.pen_down(ui, desk, camera, at);
                }
                Pen::Move(at) => self.pen_moves(ui, desk, camera, (at, force)),
                Pen::Up => self.pen_up(desk),
                Pen::Down(_) => {}
            }
        }
        self.go_along(desk);
        if was_drawing || self.drawing.is_some() {
            if !ui.input(|i| i.pointer.primary_down()) {
                self.pen_up(desk); // lifted where nobody saw it
            }
        } else if desk.hand.kind() == ToolKind::Pick && drag == Some(Drag::Tool) && !space {
            if response.is_pointer_button_down_on() {
                self.pick(desk);
            } else if response.clicked() || response.drag_stopped() {
                desk.hand.end_pick();
            }
        }
    }

    pub(super) fn pick(&mut self, desk: &mut Desk) {
        if let Some(probe) = &self.probe {
            desk.hand
                .pick(probe.alpha_x, probe.alpha_y, probe.angle_degrees);
        }
    }

    pub(super) fn pen_down(&mut self, ui: &Ui, desk: &mut Desk, camera: Camera2d, pointer: Pos2) {
        if !desk.hand.kind().paints() {
            return;
        }
        let modifiers = ui.input(|i| i.modifiers);
        let uv = camera.uv_at(self.map, self.pixel(ui, pointer)).as_vec2();
        let turns = if self.wrap { uv.floor() } else { Vec2::ZERO };
        let at = (uv - turns) * extent(desk);
        let inverse = modifiers.command && !modifiers.shift;
        let point = 1.0 / self.points_per_unit(ui, camera);
        if !self.begin(desk, inverse, point) {
            return;
        }
        let line_from = match self.last_end {
            Some(end) if modifiers.shift => Some(end),
            None if modifiers.shift => Some(at),
            _ => None,
        };
        let string = PulledString::new(at, desk.hand.string_length(point));
        let pixel = point / ui.pixels_per_point();
        self.drawing = Some(Drawing {
            string,
            steady: Steady::new(at, pressure(ui), pixel),
            turns,
            inverse,
            line_from,
        });
        match line_from {
            Some(from) => self.draw_line(desk, from, aim(from, at, modifiers.command)),
            None => self.go_along(desk),
        }
    }

    /// Begins a stroke, on a paint layer of its own where the selected one takes none; a `point` of the screen is so many surface
    /// units broad.
    pub(super) fn begin(&mut self, desk: &mut Desk, inverse: bool, point: f32) -> bool {
        if !desk.ready_layer() {
            return false;
        }
        let seed = desk.stroke_seed();
        let brush = Arc::new(desk.hand.stroke_brush(inverse, point));
        let begun = desk.studio.begin_stroke(brush, seed);
        desk.told(begun).is_some()
    }

    /// Lets the stroke go where the pen went since.
    pub(super) fn go_along(&mut self, desk: &mut Desk) {
        let Some(drawing) = &mut self.drawing else {
            return;
        };
        if drawing.line_from.is_none() {
            let points = points_of(desk, &drawing.steady.take_settled());
            let ahead = points_of(desk, &drawing.steady.ahead());
            desk.studio.stroke_along(&points, &ahead);
        }
    }

    /// The stroke in flight as one straight line.
    pub(super) fn draw_line(&mut self, desk: &mut Desk, from: Vec2, to: Vec2) {
        let points = points_of(desk, &[(from, 1.0), (to, 1.0)]);
        desk.studio.stroke_along(&points, &[]);
    }

    /// Every motion counts, not only the last of the frame: a fast curve must not become a polygon.
    pub(super) fn pen_moves(
        &mut self,
        ui: &Ui,
        desk: &mut Desk,
        camera: Camera2d,
        (at, force): (Pos2, f32),
    ) {
        let place = self.surface_at(ui, desk, camera, at);
        let point = 1.0 / self.points_per_unit(ui, camera);
        let Some(drawing) = &mut self.drawing else {
            return;
        };
        let place = place - drawing.turns * extent(desk);
        match drawing.line_from {
            Some(from) => {
                let snap = ui.input(|i| i.modifiers.command);
                let (inverse, end) = (drawing.inverse, aim(from, place, snap));
                drawing.string = PulledString::new(end, 0.0);
                desk.studio.cancel_stroke();
                if self.begin(desk, inverse, point) {
                    self.draw_line(desk, from, end);
                }
            }
            None => {
                if let Some(next) = drawing.string.pull(place) {
                    drawing.steady.go_on(next, force);
                }
            }
        }
    }

    pub(super) fn pen_up(&mut self, desk: &mut Desk) {
        self.go_along(desk);
        let Some(drawing) = self.drawing.take() else {
            return;
        };
        self.last_end = Some(drawing.string.brush());
        desk.end_stroke();
    }

    /// Takes the stroke in flight away; `true` when there was one.
    pub(crate) fn cancel(&mut self, desk: &mut Desk) -> bool {
        let adjusting = desk.call_off_adjusting();
        if self.drawing.take().is_some() {
            desk.cancel_stroke();
            return true;
        }
        let mut guides = std::mem::take(&mut desk.guides);
        let dragged = guides.cancel(desk);
        desk.guides = guides;
        adjusting || dragged
    }

    /// Whether a stroke is being drawn.
    #[cfg(test)]
    pub(crate) fn is_drawing(&self) -> bool {
        self.drawing.is_some()
    }
}

/// The end of a straight line toward the pointer, by steps of 15 degrees where the angle snaps.
pub(super) fn aim(from: Vec2, to: Vec2, snap: bool) -> Vec2 {
    if snap { snap_angle(from, to, 15.0) } else { to }
}

/// Places in surface units, with the pen's pressure, as points of a stroke.
fn points_of(desk: &Desk, places: &[(Vec2, f32)]) -> Vec<Point> {
    let extent = extent(desk);
    let point = |(at, pressure): &(Vec2, f32)| Point::new(*at / extent, *pressure);
    places.iter().filter_map(point).collect()
}
