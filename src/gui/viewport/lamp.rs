//! The ball by which the lights of the 3D view are turned, and the keys that turn lights and camera.

use super::{ViewportPane, turned};
use crate::gui::canvas::button;
use crate::gui::desk::{Desk, Redraw};
use crate::gui::steer::{
    BALL, STEP_DEGREES, Steered, ball_rect, focus_frame, focus_text, light_text, on_ball,
    paint_ball,
};
use anisomap::preview::{Light, Scene};
use anisomap::studio::action::Action;
use anisomap::studio::orbit::{Orbit, turn_lights};
use eframe::egui::{Pos2, Response, Role, Sense, Ui};
use glam::{Vec2, Vec3};

/// How far a step of the keys moves the mesh, in heights of the picture.
const PAN_STEP: f32 = 0.05;

const LIGHT_KEYS: &str = "arrow keys turn the lights, with Shift finely";
const CAMERA_KEYS: &str =
    "arrow keys turn, with Ctrl move, with Alt up and down zoom, with Shift finely";

/// Toward the lights as the camera sees them: right, up, to the viewer.
fn toward(scene: &Scene) -> Vec<Vec3> {
    let [right, up, back] = scene.camera.basis();
    let seen = |v: Vec3| Vec3::new(v.dot(right), v.dot(up), v.dot(back)).normalize_or(Vec3::Z);
    let lights = scene.lights.iter();
    lights
        .map(|light| match light {
            Light::Directional { toward, .. } => seen(*toward),
            Light::Point { position, .. } => seen(*position - scene.camera.target),
        })
        .collect()
}

impl ViewportPane {
    /// Moves the camera by the arrow keys while the 3D view has the focus.
    pub(super) fn steer(&mut self, ui: &Ui, response: &Response, desk: &mut Desk) {
        let orbit = Orbit::of(&desk.studio.scene().camera);
        let frame = desk.tip(Action::FrameAll);
        let steered = Steered {
            role: Role::Canvas,
            name: "3D view",
            state: format!(
                "turned {:.0}\u{b0}, from {:.0}\u{b0} above, distance {:.2}",
                orbit.heading_degrees(),
                orbit.elevation_degrees(),
                orbit.distance()
            ),
            tip: &format!("{CAMERA_KEYS}. {frame}"),
        };
        for step in steered.steps(ui, response, desk) {
            let by = Vec2::new(step.by.x, -step.by.y);
            let scene = turned(desk, |orbit| {
                if step.ctrl {
                    orbit.pan(by * PAN_STEP);
                } else if step.alt {
                    orbit.zoom(step.by.y);
                } else {
                    orbit.turn(by * (STEP_DEGREES / 180.0));
                }
            });
            self.move_to(ui, desk, scene);
        }
    }

    /// Takes another camera in a hurry; the next frame draws it sharply.
    pub(super) fn move_to(&mut self, ui: &Ui, desk: &mut Desk, scene: Scene) {
        if scene != *desk.studio.scene() {
            desk.studio.set_scene(scene);
            self.touch(desk, Redraw::Moving);
            self.moving = true;
            ui.ctx().request_repaint();
        }
    }

    /// Turns the lights while their ball is dragged; `true` while it is.
    pub(super) fn hold_lights(&mut self, ui: &Ui, response: &Response, desk: &mut Desk) -> bool {
        // Where the button went down, not where the pointer is by the end of the frame.
        let pressed = ui.input(|i| i.events.iter().find_map(|e| button(e, true)));
        let is_free =
            !desk.pointer_taken && self.drawing.is_none() && !ui.input(|i| i.modifiers.alt);
        let pressed =
            pressed.filter(|at| is_free && response.contains_pointer() && self.is_ball(desk, *at));
        let Some(from) = self.lights_from.or(pressed) else {
            return false;
        };
        let released = ui.input(|i| i.events.iter().rev().find_map(|e| button(e, false)));
        let to = released.or_else(|| ui.input(|i| i.pointer.interact_pos()));
        let to = to.unwrap_or(from);
        let by = (to - from) / (2.0 * BALL);
        turn(desk, Vec2::new(by.x, by.y));
        self.lights_from = ui.input(|i| i.pointer.primary_down()).then_some(to);
        true
    }

    /// Whether a place lies on the ball of the lights.
    pub(super) fn is_ball(&self, desk: &Desk, at: Pos2) -> bool {
        on_ball(self.rect, at) && !desk.studio.scene().lights.is_empty()
    }

    /// The ball in the corner, with the lights on it.
    pub(super) fn lights(&mut self, ui: &Ui, response: &Response, desk: &mut Desk) {
        let painter = ui.painter_at(self.rect);
        if response.has_focus() {
            focus_frame(ui, &painter, self.rect);
            focus_text(&painter, self.rect, CAMERA_KEYS);
        }
        let lights = toward(desk.studio.scene());
        let Some(first) = lights.first() else { return };
        let id = response.id.with("lights");
        let ball = ui.interact(ball_rect(self.rect), id, Sense::focusable_noninteractive());
        let (goes, back) = (
            desk.tip(Action::FocusControls),
            desk.tip(Action::ResetLight),
        );
        let tip = format!(
            "The lights of the 3D view: drag them, or the right button with Shift anywhere. With the focus {LIGHT_KEYS}.\n{goes}\n{back}"
        );
        let steered = Steered {
            role: Role::Slider,
            name: "Lights of the 3D view",
            state: light_text(*first),
            tip: &tip,
        };
        for step in steered.steps(ui, &ball, desk) {
            turn(
                desk,
                Vec2::new(step.by.x, -step.by.y) * (STEP_DEGREES / 180.0),
            );
            ui.ctx().request_repaint(); // the picture was drawn before
        }
        let is_held = self.lights_from.is_some();
        let pointed = response.hover_pos().is_some_and(|p| self.is_ball(desk, p));
        let hot = is_held || ball.has_focus() || pointed;
        paint_ball(ui, &painter, self.rect, &lights, hot);
        if ball.has_focus() {
            focus_text(&painter, self.rect, LIGHT_KEYS);
        }
        if !is_held {
            ball.on_hover_text(tip);
        }
    }
}

/// Turns the lights by so many heights of the picture, y down.
fn turn(desk: &mut Desk, by: Vec2) {
    if by == Vec2::ZERO {
        return;
    }
    let mut scene = desk.studio.scene().clone();
    let camera = scene.camera;
    turn_lights(&mut scene.lights, &camera, by);
    desk.studio.set_scene(scene);
    desk.redraw = desk.redraw.or(Redraw::Sharp);
}
