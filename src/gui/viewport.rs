//! The 3D view: the mesh under light, the hand on camera and lamps, and models side by side.

mod lamp;

use super::about;
use super::desk::{Desk, Panes, Redraw};
use super::icons::Icon;
use super::pane::{Pen, pen, pressure, put, ring, strip};
use super::properties::sentence;
use super::theme::Palette;
use super::tools::tips;
use super::widgets::{Bar, choices, icon_button, overlay_text};
use anisomap::brdf::Model;
use anisomap::map::{Rect as Pixels, Size};
use anisomap::paint::path::{PulledString, Steady, snap_angle};
use anisomap::paint::{Point, surface_scale};
use anisomap::preview::{Look, Measure, Rig, Scene, srgb_from_linear};
use anisomap::raster::Camera;
use anisomap::studio::action::Action;
use anisomap::studio::hand::ToolKind;
use anisomap::studio::orbit::{Button, Drag, Orbit, Preset, turn_lights};
use anisomap::studio::view::Probe;
use anisomap::studio::{Hit, Show};
use eframe::egui::{
    self, Align2, Color32, ColorImage, CornerRadius, PointerButton, Pos2, Rect, Response, Sense,
    TextureHandle, Ui, pos2, vec2,
};
use glam::Vec2;
use std::time::{Duration, Instant};

/// Widths of the parts of the strip, points: the buttons on the right, and what stands left of them.
const ICONS: f32 = 86.0;
const MESH: f32 = 98.0;
const MODEL: f32 = 122.0;
const MODE: f32 = 118.0;
const EXPOSURE: f32 = 108.0;
/// How many models are shown.
const MODES: [(&str, &str); 3] = [
    ("One model", "One model over the whole picture."),
    ("Side by side", "Two models side by side."),
    ("Difference", "Where two models differ, in false colour."),
];

/// The built-in meshes, as recipes name them.
pub(crate) const MESHES: [&str; 6] = ["torus", "pot", "sphere", "plane", "cylinder", "disc"];
/// How long nothing must happen before the picture is drawn better.
const REST: Duration = Duration::from_millis(180);

/// A stroke in flight: what the pen pulls, its path in pixels of the picture, and the last settled place with the pen's pressure.
struct Drawing {
    string: PulledString,
    steady: Steady,
    settled: (Vec2, f32),
}

/// The 3D view and what it remembers.
pub(crate) struct ViewportPane {
    texture: Option<TextureHandle>,
    pixels: Vec<Color32>,
    /// When something last changed.
    touched: Instant,
    moving: bool,
    /// Where the pointer was that drags the ball of the lights.
    lights_from: Option<Pos2>,
    /// The second look, kept while one alone is shown.
    other: Look,
    drawing: Option<Drawing>,
    /// Where the last stroke ended, and as seen from where.
    last_end: Option<(Vec2, Camera)>,
    /// What the pointer points at.
    hit: Option<Hit>,
    pub(crate) probe: Option<Probe>,
    /// How long a surface unit is on the mesh.
    unit: Option<f32>,
    pub(crate) rect: Rect,
}

impl Default for ViewportPane {
    fn default() -> Self {
        Self {
            texture: None,
            pixels: Vec::new(),
            touched: Instant::now(),
            moving: false,
            lights_from: None,
            other: Look {
                model: Model::Ward,
                mean: true,
            },
            drawing: None,
            last_end: None,
            hit: None,
            probe: None,
            unit: None,
            rect: Rect::NOTHING,
        }
    }
}

impl ViewportPane {
    pub(crate) fn show(&mut self, ui: &mut Ui, desk: &mut Desk) {
        self.strip(ui, desk);
        let (rect, response) = ui.allocate_exact_size(ui.available_size(), Sense::click_and_drag());
        self.rect = rect;
        ui.painter()
            .rect_filled(rect, CornerRadius::ZERO, Palette::of(ui).backdrop);
        self.look_under_pointer(ui, &response, desk);
        if !self.hold_lights(ui, &response, desk) && !self.paint_with_pen(ui, &response, desk) {
            self.navigate(ui, &response, desk);
        }
        self.steer(ui, &response, desk);
        self.draw(ui, desk, rect);
        if let Some(texture) = &self.texture {
            let uv = Rect::from_min_max(pos2(0.0, 0.0), pos2(1.0, 1.0));
            ui.painter().image(texture.id(), rect, uv, Color32::WHITE);
        }
        self.captions(ui, desk, rect);
        super::timings::show(&ui.painter_at(rect), desk, rect);
        self.linked(ui, desk);
        self.lights(ui, &response, desk);
        self.select_guide(&response, desk);
        self.cursor(ui, &response, desk);
    }

    /// What is shown and how it is lit. What has no room is behind the button with the three dots.
    fn strip(&mut self, ui: &mut Ui, desk: &mut Desk) {
        strip(ui, |ui| {
            let show = desk.studio.viewport().show();
            let is_pair = !matches!(show, Show::One(_));
            let room = ui.available_width();
            // Buttons, then mesh, model, mode, second model, exposure, as long as there is room for the next.
            let mut left = room - ICONS - MESH;
            let mut fits = |width: f32| {
                left -= width;
                left >= 0.0
            };
            let has_model = fits(MODEL);
            let has_mode = has_model && fits(MODE);
            let has_second = has_mode && (!is_pair || fits(MODEL));
            // Where all has room there is no third button.
            let has_exposure = has_second && fits(EXPOSURE - 28.0);
            mesh_choice(ui, desk);
            let mut chosen = show;
            if has_model {
                let mut first = show.looks()[0];
                if look_choice(ui, desk, "Model", &mut first) {
                    chosen = with_first(show, first);
                }
            }
            if has_mode {
                chosen = mode_choice(ui, desk, chosen, self.other);
            }
            if has_second && is_pair {
                let mut second = self.other;
                if look_choice(ui, desk, "Second model", &mut second) {
                    self.other = second;
                    chosen = as_mode(mode_of(chosen), chosen.looks()[0], second);
                }
            }
            ui.with_layout(egui::Layout::right_to_left(egui::Align::Center), |ui| {
                let frame = icon_button(ui, Icon::Frame, Action::FrameAll.name(), 24.0, false);
                if frame.on_hover_text(desk.tip(Action::FrameAll)).clicked() {
                    desk.ask(Action::FrameAll);
                }
                let sun = icon_button(ui, Icon::Sun, "Lights", 24.0, false).on_hover_text(format!(
                    "Ready-made lights and the light from all around. Shift and a drag with the right button turn them; {}",
                    desk.tip(Action::ResetLight)
                ));
                egui::Popup::menu(&sun)
                    .close_behavior(egui::PopupCloseBehavior::CloseOnClickOutside)
                    .show(|ui| lights_menu(ui, desk));
                if has_exposure {
                    exposure(ui, desk, ui.available_width().min(EXPOSURE));
                    return;
                }
                let more = icon_button(ui, Icon::More, "More of the 3D view", 24.0, false)
                    .on_hover_text("What has no room here: models, comparing, exposure.");
                egui::Popup::menu(&more)
                    .close_behavior(egui::PopupCloseBehavior::CloseOnClickOutside)
                    .show(|ui| {
                        ui.set_width(250.0);
                        if !has_model {
                            chosen = look_menu(ui, "Model", chosen, &mut self.other, true);
                        }
                        let tip = tips(desk, "", &[Action::Compare, Action::Difference]);
                        let modes = choices(ui, ("Show", &tip), &MODES, mode_of(chosen));
                        if let Some(mode) = modes {
                            chosen = as_mode(mode, chosen.looks()[0], self.other);
                        }
                        if mode_of(chosen) > 0 {
                            chosen = look_menu(ui, "Second model", chosen, &mut self.other, false);
                        }
                        exposure(ui, desk, 250.0);
                    });
            });
            if chosen != show {
                self.set_show(desk, chosen);
            }
        });
    }

    fn set_show(&mut self, desk: &mut Desk, show: Show) {
        desk.studio.viewport_mut().set_show(show);
        self.touch(desk, Redraw::Sharp);
    }

    fn touch(&mut self, desk: &mut Desk, redraw: Redraw) {
        self.touched = Instant::now();
        desk.redraw = desk.redraw.or(redraw);
    }

    /// The next model in the list.
    pub(crate) fn next_model(&mut self, desk: &mut Desk) {
        let show = desk.studio.viewport().show();
        let mut first = show.looks()[0];
        let at = Model::ALL
            .iter()
            .position(|m| *m == first.model)
            .unwrap_or(0);
        first.model = Model::ALL[(at + 1) % Model::ALL.len()];
        self.set_show(desk, with_first(show, first));
    }

    /// Two models side by side, or one again; or how they differ.
    pub(crate) fn toggle_compare(&mut self, desk: &mut Desk, difference: bool) {
        let show = desk.studio.viewport().show();
        let first = show.looks()[0];
        let mode = match (show, difference) {
            (Show::Pair(..), false) | (Show::Difference(..), true) => 0,
            (_, false) => 1,
            (_, true) => 2,
        };
        self.set_show(desk, as_mode(mode, first, self.other));
    }

    // ----- The pen. -----

    /// Pixels of the picture of a place on the screen.
    fn pixel(&self, ui: &Ui, at: Pos2) -> Vec2 {
        let from = (at - self.rect.min) * ui.pixels_per_point();
        Vec2::new(from.x, from.y)
    }

    fn look_under_pointer(&mut self, ui: &Ui, response: &Response, desk: &mut Desk) {
        if desk.news.new_map {
            self.unit = None;
        }
        (self.hit, self.probe) = (None, None);
        let turning = self.drawing.is_none() && response.is_pointer_button_down_on() && self.moving;
        if let Some(pointer) = response.hover_pos().filter(|_| !turning) {
            self.hit = desk.studio.pick(self.pixel(ui, pointer));
            let uv = self.hit.map(|h| h.uv.as_dvec2());
            self.probe = uv.and_then(|uv| Probe::at(desk.studio.map(), uv));
        }
        let here = self.hit.map(|h| h.uv - h.uv.floor());
        if desk.on_mesh != here {
            desk.on_mesh = here;
            ui.ctx().request_repaint(); // the canvas was drawn before
        }
    }

    /// What the pointer over the canvas points at, where the mesh shows it.
    fn linked(&self, ui: &Ui, desk: &Desk) {
        let Some(uv) = desk.on_map else { return };
        let painter = ui.painter_at(self.rect);
        for place in desk.studio.seen_at(uv) {
            let at = self.rect.min + vec2(place.x, place.y) / ui.pixels_per_point();
            ring(&painter, at, 5.0, 1.0);
            painter.circle_filled(at, 1.5, Color32::WHITE);
        }
    }

    /// Paints where the pointer drags over the mesh; `true` while it does.
    fn paint_with_pen(&mut self, ui: &Ui, response: &Response, desk: &mut Desk) -> bool {
        if desk.pointer_taken {
            return true;
        }
        let (mut taken, force) = (self.drawing.is_some(), pressure(ui));
        for pen in pen(ui, response) {
            match (pen, self.drawing.is_some()) {
                (Pen::Down(at), false) if !ui.input(|i| i.modifiers.alt) => {
                    taken |= self.press(ui, desk, at, force);
                }
                (Pen::Move(at), true) => self.go_on(ui, desk, at, force),
                (Pen::Up, true) => self.pen_up(desk),
                _ => {}
            }
        }
        self.go_along(desk);
        if self.drawing.is_some() && !ui.input(|i| i.pointer.primary_down()) {
            self.pen_up(desk); // lifted where nobody saw it
        }
        taken
    }

    /// The tool meets the mesh, or `false` where it is missed.
    fn press(&mut self, ui: &Ui, desk: &mut Desk, at: Pos2, force: f32) -> bool {
        let Some(hit) = desk.studio.pick(self.pixel(ui, at)) else {
            return false;
        };
        match desk.hand.kind() {
            ToolKind::Pick => {
                if let Some(p) = Probe::at(desk.studio.map(), hit.uv.as_dvec2()) {
                    desk.hand.pick(p.alpha_x, p.alpha_y, p.angle_degrees);
                    desk.hand.end_pick();
                }
                true
            }
            // Guides lie on the map: see `select_guide`.
            ToolKind::Guide => false,
            _ => self.pen_down(ui, desk, hit, (at, force)),
        }
    }

    fn pen_down(&mut self, ui: &Ui, desk: &mut Desk, hit: Hit, (at, force): (Pos2, f32)) -> bool {
        if !desk.ready_layer() {
            return true;
        }
        let modifiers = ui.input(|i| i.modifiers);
        let pixel = self.pixel_in_units(desk, hit); // how broad a pixel is
        let point = pixel * ui.pixels_per_point();
        let inverse = modifiers.command && !modifiers.shift;
        let brush = desk.hand.stroke_brush(inverse, point);
        let seed = desk.stroke_seed();
        if desk.hand.kind() == ToolKind::Fill {
            // The whole map, wherever it is asked for.
            let begun = desk.studio.begin_stroke(brush.into(), seed);
            if let (Some(()), Some(point)) = (desk.told(begun), Point::new(hit.uv, 1.0)) {
                desk.studio.stroke_to(point);
                desk.end_stroke();
            }
            return true;
        }
        let begun = desk.studio.begin_mesh_stroke(brush.into(), seed);
        if desk.told(begun).is_some() {
            let pen = self.pixel(ui, at);
            let camera = desk.studio.scene().camera;
            let line_from = self
                .last_end
                .filter(|(_, seen)| modifiers.shift && *seen == camera);
            // As the canvas does: a straight line, with Ctrl in steps of 15 degrees.
            let aimed = line_from.filter(|_| modifiers.command);
            let place = aimed.map_or(pen, |(from, _)| snap_angle(from, pen, 15.0));
            let here = (place, force);
            let from = line_from.map_or(here, |(place, _)| (place, force));
            let mut drawing = Drawing {
                string: PulledString::new(place, desk.hand.string_length(point) / pixel),
                steady: Steady::new(here.0, here.1, 1.0),
                settled: here,
            };
            drawing.steady.take_settled();
            desk.studio.mesh_stroke_over(from, &[here], &[]);
            self.drawing = Some(drawing);
            self.last_end = Some((here.0, camera));
        }
        true
    }

    fn go_on(&mut self, ui: &Ui, desk: &Desk, at: Pos2, force: f32) {
        let to = self.pixel(ui, at);
        if let Some(drawing) = &mut self.drawing {
            if let Some(next) = drawing.string.pull(to) {
                drawing.steady.go_on(next, force);
            }
            let end = drawing.string.brush();
            self.last_end = Some((end, desk.studio.scene().camera));
        }
    }

    /// Lets the stroke go where the pen went since.
    fn go_along(&mut self, desk: &mut Desk) {
        if let Some(drawing) = &mut self.drawing {
            let settled = drawing.steady.take_settled();
            let ahead = drawing.steady.ahead();
            let from = drawing.settled;
            drawing.settled = settled.last().copied().unwrap_or(from);
            desk.studio.mesh_stroke_over(from, &settled, &ahead);
        }
    }

    fn pen_up(&mut self, desk: &mut Desk) {
        self.go_along(desk);
        if self.drawing.take().is_some() {
            desk.end_stroke();
        }
    }

    /// Takes the stroke in flight away; `true` when there was one.
    pub(crate) fn cancel(&mut self, desk: &mut Desk) -> bool {
        let was = self.drawing.take().is_some();
        if was {
            desk.cancel_stroke();
        }
        was
    }

    /// With the guide tool a click selects the guide that lies where the mesh is met: its numbers are in the panel then.
    fn select_guide(&self, response: &Response, desk: &mut Desk) {
        let with_guides = desk.hand.kind() == ToolKind::Guide && !desk.pointer_taken;
        let on_ball = |at| self.is_ball(desk, at);
        let clicked = response.clicked_by(PointerButton::Primary)
            && !response.interact_pointer_pos().is_some_and(on_ball);
        if let Some(hit) = self.hit.filter(|_| with_guides && clicked) {
            let mut hand = std::mem::take(&mut desk.guides);
            hand.select_at(desk, hit.uv);
            desk.guides = hand;
        }
    }

    /// The brush where it would paint.
    fn cursor(&mut self, ui: &Ui, response: &Response, desk: &mut Desk) {
        let pointer = response.hover_pos().or(response.interact_pointer_pos());
        let pointer = desk.adjusting.map_or(pointer, |a| Some(a.from()));
        let Some(pointer) = pointer.filter(|p| self.rect.contains(*p)) else {
            return;
        };
        if self.lights_from.is_some() || self.is_ball(desk, pointer) {
            return;
        }
        if self.drawing.is_none() {
            self.hint_of_modifiers(ui, desk, pointer);
        }
        let text = desk.adjusting_text();
        let hit = match &text {
            Some(_) => desk.studio.pick(self.pixel(ui, pointer)),
            None => self.hit,
        };
        if let Some(text) = &text {
            let painter = ui.painter_at(self.rect);
            let below = pointer + vec2(0.0, 24.0);
            overlay_text(&painter, below, Align2::CENTER_TOP, text);
        }
        let Some(hit) = hit else { return };
        if !desk.hand.kind().paints() || ui.input(|i| i.modifiers.alt) {
            return;
        }
        desk.studio.expect_stroke(true);
        let point = self.pixel_in_units(desk, hit) * ui.pixels_per_point();
        let brush = desk.hand.brush();
        let radius = desk.hand.radius_at(point) / point;
        let painter = ui.painter_at(self.rect);
        ring(&painter, pointer, radius, 1.0);
        if brush.hardness < 0.99 && radius > 8.0 {
            ring(&painter, pointer, radius * brush.hardness, 0.45);
        }
    }

    /// How many surface units a pixel is broad where the pointer meets the mesh.
    fn pixel_in_units(&mut self, desk: &Desk, hit: Hit) -> f32 {
        let studio = &desk.studio;
        let unit = *self.unit.get_or_insert_with(|| {
            let aspect = studio.recipe().aspect_at(studio.map().size());
            surface_scale(studio.mesh(), Vec2::new(aspect, 1.0))
        });
        hit.pixel.max(1e-9) / unit
    }

    /// Where it is.
    pub(crate) fn rect(&self) -> Rect {
        self.rect
    }

    /// What the held keys would do now.
    fn hint_of_modifiers(&self, ui: &Ui, desk: &Desk, pointer: Pos2) {
        let modifiers = ui.input(|i| i.modifiers);
        let paints = self.hit.is_some() && desk.hand.kind().paints();
        let is_middle = desk.settings.navigation == Preset::Middle;
        let guides = self.hint_of_guides(desk);
        let text = if modifiers.alt {
            "left drag: turn; middle: move; right: zoom"
        } else if modifiers.shift {
            match (paints, is_middle) {
                (true, _) if modifiers.command => "click: straight line in steps of 15 degrees",
                (true, _) => "click: straight line; right drag: turn the lights",
                (false, true) => "middle drag: move; right drag: turn the lights",
                (false, false) => "right drag: turn the lights",
            }
        } else if modifiers.command && paints {
            desk.hand.kind().inverse_name()
        } else if modifiers.command && is_middle {
            "middle drag: zoom"
        } else if desk.hand.kind() == ToolKind::Guide && self.hit.is_some() && !self.moving {
            &guides
        } else {
            return;
        };
        let painter = ui.painter_at(self.rect);
        let below = pointer + vec2(0.0, 24.0);
        overlay_text(&painter, below, Align2::CENTER_TOP, text);
    }

    /// What the guide tool does over the mesh.
    fn hint_of_guides(&self, desk: &Desk) -> String {
        let place = match desk.panes {
            Panes::Both => "on the map".to_owned(),
            _ => format!("on the map ({})", desk.keymap.keys_text(Action::ShowBoth)),
        };
        format!("guides are drawn {place}; click: select the guide that lies here; drag: turn")
    }

    fn navigate(&mut self, ui: &Ui, response: &Response, desk: &mut Desk) {
        let drag = held(ui, response, desk);
        let delta = response.drag_delta() / self.rect.height().max(1.0);
        let by = Vec2::new(delta.x, delta.y);
        let mut scene = None;
        match drag {
            // A drag that begins beside the mesh paints nothing: it turns, as in every viewer.
            Some(Drag::Turn | Drag::Tool) => scene = Some(turned(desk, |o| o.turn(by))),
            Some(Drag::Pan) => scene = Some(turned(desk, |o| o.pan(by))),
            Some(Drag::Zoom) => scene = Some(turned(desk, |o| o.zoom(-20.0 * by.y))),
            Some(Drag::Light) => {
                let mut lit = desk.studio.scene().clone();
                let camera = lit.camera;
                turn_lights(&mut lit.lights, &camera, by);
                scene = Some(lit);
            }
            None => {}
        }
        if response.hovered() {
            let (wheel, pinch) = ui.input(|i| (i.smooth_scroll_delta.y, i.zoom_delta()));
            let steps = wheel / 40.0 + pinch.ln() * 9.0;
            if steps != 0.0 {
                scene = Some(turned(desk, |o| o.zoom(steps)));
            }
        }
        if self.moving && !ui.input(|i| i.pointer.any_down()) {
            self.moving = false;
            self.touch(desk, Redraw::Sharp);
        }
        match scene.filter(|s| s != desk.studio.scene()) {
            Some(scene) if drag == Some(Drag::Light) => {
                desk.studio.set_scene(scene);
                self.touch(desk, Redraw::Sharp);
            }
            Some(scene) => self.move_to(ui, desk, scene),
            None => {}
        }
    }

    fn draw(&mut self, ui: &Ui, desk: &mut Desk, rect: Rect) {
        let scale = ui.pixels_per_point();
        let side = |points: f32| (points * scale).round() as u32;
        let Ok(size) = Size::new(side(rect.width()), side(rect.height())) else {
            return;
        };
        if desk.studio.viewport().size() != size {
            desk.studio.viewport_mut().resize(size);
            self.touch(desk, Redraw::Sharp);
        }
        let mut parts = Vec::new();
        let redraw = std::mem::take(&mut desk.redraw);
        if redraw != Redraw::Nothing {
            self.touched = Instant::now();
            let drawn = desk.studio.draw(redraw == Redraw::Moving);
            parts = desk.told(drawn).unwrap_or_default();
            if parts.is_empty() {
                desk.stages.pass_over(desk.studio.timings());
            } else {
                desk.draw_time = desk.studio.viewport().time();
                desk.stages.take(desk.studio.timings());
            }
        } else if desk.news.picture {
            parts = vec![size.rect()];
        }
        for part in parts {
            self.upload(ui, desk, size, part);
        }
        self.refine_when_idle(ui, desk);
    }

    /// A better picture once nothing has happened for a moment.
    fn refine_when_idle(&mut self, ui: &Ui, desk: &mut Desk) {
        let viewport = desk.studio.viewport();
        if self.moving
            || viewport.is_refining()
            || viewport.quality().is_reference
            || desk.working.is_some()
        {
            return;
        }
        let rested = self.touched.elapsed();
        if ui.input(|i| i.pointer.any_down()) {
            return; // the release repaints
        }
        if rested >= REST {
            desk.studio.refine();
            if desk.studio.viewport().is_refining() {
                ui.ctx().request_repaint_after(Duration::from_millis(60));
            }
        } else {
            ui.ctx().request_repaint_after(REST - rested);
        }
    }

    fn upload(&mut self, ui: &Ui, desk: &Desk, size: Size, part: Pixels) {
        let all = desk.studio.viewport().pixels();
        let line = size.width() as usize * 3;
        self.pixels.clear();
        for y in part.y..part.y + part.height {
            let start = y as usize * line + part.x as usize * 3;
            let row = &all[start..start + part.width as usize * 3];
            self.pixels.extend(
                row.chunks_exact(3)
                    .map(|c| Color32::from_rgb(c[0], c[1], c[2])),
            );
        }
        let image = ColorImage::new(
            [part.width as usize, part.height as usize],
            std::mem::take(&mut self.pixels),
        );
        put(ui, &mut self.texture, "viewport", size, part, image);
    }

    fn captions(&self, ui: &Ui, desk: &Desk, rect: Rect) {
        let painter = ui.painter_at(rect);
        let show = desk.studio.viewport().show();
        let looks = show.looks();
        if let Show::Pair(..) = show {
            let half = rect.width() * 0.5;
            for (i, look) in looks.iter().enumerate() {
                let at = pos2(rect.left() + half * (i as f32 + 0.5), rect.top() + 10.0);
                overlay_text(&painter, at, Align2::CENTER_TOP, &look.caption());
            }
            let x = rect.center().x;
            painter.vline(
                x,
                rect.y_range(),
                egui::Stroke::new(1.0, Color32::from_black_alpha(200)),
            );
        }
        if let (Show::Difference(a, b, measure), Some(scale)) =
            (show, desk.studio.viewport().scale())
        {
            let text = format!("{}  \u{2212}  {}", a.caption(), b.caption());
            let at = rect.center_top() + vec2(0.0, 10.0);
            overlay_text(&painter, at, Align2::CENTER_TOP, &text);
            difference_legend(
                &painter,
                rect.left_bottom() + vec2(12.0, -12.0),
                measure,
                scale,
            );
        }
        if desk.working.is_some() {
            // Left of the ball.
            overlay_text(
                &painter,
                rect.right_top() + vec2(-76.0, 10.0),
                Align2::RIGHT_TOP,
                "making the map",
            );
        }
    }
}

/// What the drag that goes on over a picture does.
pub(crate) fn held(ui: &Ui, response: &Response, desk: &Desk) -> Option<Drag> {
    let buttons = [
        (PointerButton::Primary, Button::Left),
        (PointerButton::Middle, Button::Middle),
        (PointerButton::Secondary, Button::Right),
    ];
    let (_, button) = buttons.into_iter().find(|(b, _)| response.dragged_by(*b))?;
    let keys = ui.input(|i| i.modifiers);
    desk.settings
        .navigation
        .drag(button, keys.command, keys.alt, keys.shift)
}

/// The colours of a difference with their numbers, its lower left corner at a place.
fn difference_legend(painter: &egui::Painter, corner: Pos2, measure: Measure, scale: f32) {
    let (width, high) = ((painter.clip_rect().width() - 60.0).min(220.0), 12.0);
    let ground = Rect::from_min_max(corner - vec2(0.0, 58.0), corner + vec2(width + 32.0, 0.0));
    let dark = Color32::from_rgba_unmultiplied(12, 13, 15, 200);
    painter.rect_filled(ground, CornerRadius::same(5), dark);
    let (ink, font) = (
        Color32::from_rgb(0xe8, 0xe9, 0xea),
        egui::FontId::proportional(11.0),
    );
    let title = match width < 190.0 {
        true => format!("\u{394}E up to {scale}"),
        false => format!("\u{394}E (CIE 1976) up to {scale}: 1 can just be seen"),
    };
    let at = ground.left_top() + vec2(10.0, 5.0);
    painter.text(at, Align2::LEFT_TOP, title, font.clone(), ink);
    let bar = Rect::from_min_size(ground.left_top() + vec2(16.0, 24.0), vec2(width, high));
    let steps = 110;
    for i in 0..steps {
        let t = (i as f32 + 0.5) / steps as f32;
        let [r, g, b] = measure
            .colour(t)
            .map(|c| (srgb_from_linear(c) * 255.0).round() as u8);
        let left = bar.left() + width * i as f32 / steps as f32;
        let part = Rect::from_min_size(
            pos2(left, bar.top()),
            vec2(width / steps as f32 + 0.5, high),
        );
        painter.rect_filled(part, CornerRadius::ZERO, Color32::from_rgb(r, g, b));
    }
    for (t, align) in [
        (0.0, Align2::LEFT_TOP),
        (0.5, Align2::CENTER_TOP),
        (1.0, Align2::RIGHT_TOP),
    ] {
        let at = pos2(bar.left() + width * t, bar.bottom() + 4.0);
        painter.text(at, align, format!("{}", scale * t), font.clone(), ink);
    }
}

fn turned(desk: &Desk, change: impl FnOnce(&mut Orbit)) -> Scene {
    let mut scene = desk.studio.scene().clone();
    let mut orbit = Orbit::of(&scene.camera);
    change(&mut orbit);
    scene.camera = orbit.camera();
    scene
}

fn with_first(show: Show, first: Look) -> Show {
    match show {
        Show::One(_) => Show::One(first),
        Show::Pair(_, b) => Show::Pair(first, b),
        Show::Difference(_, b, measure) => Show::Difference(first, b, measure),
    }
}

fn mode_of(show: Show) -> usize {
    match show {
        Show::One(_) => 0,
        Show::Pair(..) => 1,
        Show::Difference(..) => 2,
    }
}

/// Chooses how many models are shown; gives what is shown then.
fn mode_choice(ui: &mut Ui, desk: &Desk, show: Show, second: Look) -> Show {
    let (now, first) = (mode_of(show), show.looks()[0]);
    let mut chosen = show;
    egui::ComboBox::from_id_salt("compare")
        .width(84.0)
        .selected_text(MODES[now].0)
        .show_ui(ui, |ui| {
            for (i, (mode, about)) in MODES.iter().enumerate() {
                let keys: &[Action] = match i {
                    0 => &[],
                    1 => &[Action::Compare],
                    _ => &[Action::Difference],
                };
                let tip = tips(desk, about, keys);
                let mode = ui.selectable_label(i == now, *mode);
                if mode.on_hover_text(tip).clicked() {
                    chosen = as_mode(i, first, second);
                }
            }
        })
        .response
        .accessible_name("One model, two, or their difference")
        .on_hover_text(tips(
            desk,
            "One model, two side by side, or where they differ.",
            &[Action::Compare, Action::Difference],
        ));
    chosen
}

/// The first or the second model as a menu of its own; gives what is shown then.
fn look_menu(ui: &mut Ui, name: &str, show: Show, second: &mut Look, is_first: bool) -> Show {
    let mut look = if is_first { show.looks()[0] } else { *second };
    let before = look;
    ui.menu_button(format!("{name}: {}", look.caption()), |ui| {
        look_list(ui, &mut look);
    })
    .response
    .on_hover_text("The reflection model, with the map or with its mean lobe all over.");
    if look == before {
        show
    } else if is_first {
        with_first(show, look)
    } else {
        *second = look;
        as_mode(mode_of(show), show.looks()[0], look)
    }
}

fn as_mode(mode: usize, first: Look, second: Look) -> Show {
    match mode {
        0 => Show::One(first),
        1 => Show::Pair(first, second),
        _ => Show::Difference(first, second, Measure::DeltaE),
    }
}

fn mesh_choice(ui: &mut Ui, desk: &mut Desk) {
    let now = desk.studio.mesh().name.clone();
    let mut chosen = None;
    egui::ComboBox::from_id_salt("mesh")
        .width(64.0)
        .selected_text(sentence(&now))
        .show_ui(ui, |ui| {
            for mesh in MESHES {
                let tip = format!("Shows the map on the built-in {mesh}.");
                let label = ui.selectable_label(mesh == now, sentence(mesh));
                if label.on_hover_text(tip).clicked() {
                    chosen = Some(mesh);
                }
            }
            ui.separator();
            let load = ui.button(Action::LoadMesh.name());
            if load.on_hover_text(desk.tip(Action::LoadMesh)).clicked() {
                desk.ask(Action::LoadMesh);
            }
        })
        .response
        .accessible_name("Mesh")
        .on_hover_text(format!(
            "The mesh that the map is shown on. {}",
            desk.tip(Action::NextMesh)
        ));
    if let Some(mesh) = chosen {
        set_mesh(desk, mesh);
    }
}

/// Shows the map on another mesh, which the recipe remembers.
pub(crate) fn set_mesh(desk: &mut Desk, mesh: &str) {
    let set = desk.studio.set_mesh(mesh);
    desk.told(set);
}

/// Chooses a model, with the map or with its mean; `true` when another was chosen.
fn look_choice(ui: &mut Ui, desk: &Desk, name: &str, look: &mut Look) -> bool {
    let before = *look;
    let keys: &[Action] = match name {
        "Model" => &[Action::NextModel],
        _ => &[],
    };
    let tip =
        "The reflection model. Without \u{201c}map\u{201d} it has the map's mean lobe all over.";
    egui::ComboBox::from_id_salt(name)
        .width(88.0)
        .selected_text(look.caption())
        .show_ui(ui, |ui| look_list(ui, look))
        .response
        .accessible_name(name)
        .on_hover_text(tips(desk, tip, keys));
    *look != before
}

fn look_list(ui: &mut Ui, look: &mut Look) {
    for mean in [false, true] {
        for model in Model::ALL {
            if mean && model == Model::Lambert {
                continue;
            }
            let one = Look { model, mean };
            ui.selectable_value(look, one, one.caption())
                .on_hover_text(about::look(one));
        }
        if !mean {
            ui.separator();
        }
    }
}

fn exposure(ui: &mut Ui, desk: &mut Desk, width: f32) {
    let mut stops = f64::from(desk.studio.scene().exposure);
    let bar = Bar::new("Exposure", -6.0..=6.0)
        .default(0.0)
        .width(width)
        .show(ui, &mut stops);
    let tip = format!(
        "Exposure in stops. {} {}",
        desk.tip(Action::ExposureDown),
        desk.tip(Action::ExposureUp)
    );
    let changed = bar.response.changed();
    bar.response.on_hover_text(tip);
    if changed {
        set_exposure(desk, stops as f32);
    }
}

fn lights_menu(ui: &mut Ui, desk: &mut Desk) {
    ui.set_width(220.0);
    for (rig, name, about) in [
        (
            Rig::Studio,
            "Studio",
            "A key light, a weaker one, and one from behind.",
        ),
        (
            Rig::Key,
            "Key light",
            "One light: one highlight, to be measured or compared.",
        ),
        (Rig::Lamp, "Lamp", "A lamp near the surface."),
    ] {
        if ui.button(name).on_hover_text(about).clicked() {
            set_lights(desk, rig);
        }
    }
    let mut ambient = f64::from(desk.studio.scene().ambient[0]);
    let bar = Bar::new("Ambient", 0.0..=4.0)
        .default(1.0)
        .show(ui, &mut ambient);
    let changed = bar.response.changed() || bar.finished;
    bar.response
        .on_hover_text("Light from all around, which the material's ambient colour gives back.");
    if changed {
        let mut scene = desk.studio.scene().clone();
        scene.ambient = [ambient as f32; 3];
        desk.studio.set_scene(scene);
        desk.redraw = desk.redraw.or(Redraw::Sharp);
    }
}

/// Puts ready-made lights where the camera now sees them best.
pub(crate) fn set_lights(desk: &mut Desk, rig: Rig) {
    let mut scene = desk.studio.scene().clone();
    scene.lights = Scene::with_rig(desk.studio.mesh(), rig).lights;
    desk.studio.set_scene(scene);
    desk.redraw = desk.redraw.or(Redraw::Sharp);
}

/// Sets the exposure, within its range.
pub(crate) fn set_exposure(desk: &mut Desk, stops: f32) {
    let mut scene = desk.studio.scene().clone();
    scene.exposure = stops.clamp(-16.0, 16.0);
    desk.studio.set_scene(scene);
    desk.redraw = desk.redraw.or(Redraw::Sharp);
}
