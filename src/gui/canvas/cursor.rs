//! What the pointer carries with it: the brush, its copies, what the held keys do.

use super::stroke::aim;
use super::{CanvasPane, extent};
use crate::gui::desk::Desk;
use crate::gui::pane::ring;
use crate::gui::widgets::overlay_text;
use anisomap::studio::hand::ToolKind;
use anisomap::studio::view::Camera2d;
use eframe::egui::{self, Align2, Color32, Painter, Pos2, Rect, Response, Stroke, Ui, vec2};
use glam::Vec2;

impl CanvasPane {
    pub(super) fn cursor(
        &self,
        ui: &Ui,
        painter: &Painter,
        response: &Response,
        desk: &mut Desk,
        camera: Camera2d,
    ) {
        let pointer = response.hover_pos().or(response.interact_pointer_pos());
        let pointer = desk.adjusting.map_or(pointer, |a| Some(a.from()));
        let Some(pointer) = pointer.filter(|p| self.rect.contains(*p)) else {
            return;
        };
        if desk.hand.kind().paints() {
            desk.studio.expect_stroke(false);
        } else {
            // The hand on the guides says itself what it would do.
            if desk.hand.kind() == ToolKind::Pick {
                ui.ctx().set_cursor_icon(egui::CursorIcon::Crosshair);
            }
            self.hint_of_modifiers(ui, painter, pointer, desk, camera, 0.0);
            return;
        }
        let brush = desk.hand.brush();
        let radius = self.radius(ui, desk, camera);
        let centre = pointer;
        ring(painter, centre, radius, 1.0);
        if desk.adjusting.is_none() {
            self.ghosts(ui, painter, desk, camera, (centre, radius));
        }
        if brush.hardness < 0.99 && radius > 8.0 {
            ring(painter, centre, radius * brush.hardness, 0.45);
        }
        if radius < 3.0 {
            cross(painter, centre);
        }
        if self.drawing.is_none() {
            self.hint_of_modifiers(ui, painter, pointer, desk, camera, radius);
        }
        if let Some(text) = desk.adjusting_text() {
            let below = centre + vec2(0.0, radius + 16.0);
            overlay_text(painter, below, Align2::CENTER_TOP, &text);
        }
    }

    /// The brush's radius in points.
    fn radius(&self, ui: &Ui, desk: &Desk, camera: Camera2d) -> f32 {
        let unit = self.points_per_unit(ui, camera);
        desk.hand.radius_at(1.0 / unit) * unit
    }

    /// Where else a brush at a place paints: a map that repeats goes on at its opposite edge.
    pub(super) fn ghosts(
        &self,
        ui: &Ui,
        painter: &Painter,
        desk: &Desk,
        camera: Camera2d,
        (at, radius): (Pos2, f32),
    ) {
        if self.wrap {
            return; // the copies themselves are shown
        }
        let wrap = desk.studio.recipe().wrap;
        let (u, v) = (wrap.repeats_u(), wrap.repeats_v());
        let uv = camera.uv_at(self.map, self.pixel(ui, at)).as_vec2();
        let place =
            |uv: Vec2| self.screen_at(ui.pixels_per_point(), desk, camera, uv * extent(desk));
        let map = Rect::from_two_pos(place(Vec2::ZERO), place(Vec2::ONE));
        let painter = painter.with_clip_rect(map.intersect(self.rect));
        for i in -1..=1 {
            for j in -1..=1 {
                let by = Vec2::new(
                    if u { i as f32 - uv.x.floor() } else { 0.0 },
                    if v { j as f32 - uv.y.floor() } else { 0.0 },
                );
                let twice = (!u && i != 0) || (!v && j != 0);
                let there = place(uv + by);
                if !twice && by != Vec2::ZERO && map.expand(radius).contains(there) {
                    ring(&painter, there, radius, 0.8);
                }
            }
        }
    }

    /// What the held keys would do now.
    pub(super) fn hint_of_modifiers(
        &self,
        ui: &Ui,
        painter: &Painter,
        pointer: Pos2,
        desk: &Desk,
        camera: Camera2d,
        radius: f32,
    ) {
        let (modifiers, space) = ui.input(|i| (i.modifiers, i.key_down(egui::Key::Space)));
        let of_guides = (desk.hand.kind() == ToolKind::Guide)
            .then(|| desk.guides.hint(modifiers))
            .flatten();
        let text = if let Some(text) = of_guides {
            text
        } else if modifiers.alt {
            "left or middle drag: move the map; right drag: zoom"
        } else if space {
            "drag: move the map"
        } else if !desk.hand.kind().paints() {
            return;
        } else if modifiers.shift {
            if let Some(end) = self.last_end {
                let from = self.screen_at(ui.pixels_per_point(), desk, camera, end);
                let to = if modifiers.command {
                    let aim = aim(end, self.surface_at(ui, desk, camera, pointer), true);
                    self.screen_at(ui.pixels_per_point(), desk, camera, aim)
                } else {
                    pointer
                };
                painter.line_segment([from, to], Stroke::new(3.0, Color32::from_black_alpha(120)));
                painter.line_segment([from, to], Stroke::new(1.0, Color32::WHITE));
            }
            if modifiers.command {
                "click: straight line, by steps of 15\u{b0}"
            } else {
                "click: straight line"
            }
        } else if modifiers.command {
            desk.hand.kind().inverse_name()
        } else {
            return;
        };
        overlay_text(
            painter,
            pointer + vec2(0.0, radius.min(200.0) + 14.0),
            Align2::CENTER_TOP,
            text,
        );
    }

    /// What the pointer over the mesh points at: the brush, as it would paint there.
    pub(super) fn linked(&self, ui: &Ui, painter: &Painter, desk: &Desk, camera: Camera2d) {
        let shown = desk.panes == crate::gui::desk::Panes::Both;
        let Some(uv) = desk.on_mesh.filter(|_| shown) else {
            return;
        };
        let place = uv * extent(desk);
        let at = self.screen_at(ui.pixels_per_point(), desk, camera, place);
        if desk.hand.kind().paints() {
            let radius = self.radius(ui, desk, camera);
            ring(painter, at, radius.max(3.0), 0.8);
        }
        painter.circle_filled(at, 3.0, Color32::from_black_alpha(160));
        painter.circle_filled(at, 1.5, Color32::WHITE);
    }
}

fn cross(painter: &Painter, centre: Pos2) {
    for way in [vec2(1.0, 0.0), vec2(0.0, 1.0)] {
        for side in [-1.0, 1.0] {
            let ends = [centre + way * side * 5.0, centre + way * side * 10.0];
            painter.line_segment(ends, Stroke::new(2.5, Color32::from_black_alpha(120)));
            painter.line_segment(ends, Stroke::new(1.0, Color32::WHITE));
        }
    }
}
