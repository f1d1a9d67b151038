//! The canvas: the map in two dimensions, and the pen on it.

use super::desk::Desk;
use super::guides::Sheet;
use super::icons::Icon;
use super::overlay::{LegendPicture, Overlay, Ranges, needle_shapes};
use super::theme::Palette;
use super::widgets::{icon_button, overlay_text};
use anisomap::map::{Rect as Texels, Size};
use anisomap::paint::Point;
use anisomap::paint::path::{PulledString, snap_angle};
use anisomap::studio::action::Action;
use anisomap::studio::hand::ToolKind;
use anisomap::studio::orbit::{Button, Drag};
use anisomap::studio::view::{
    AlphaRange, Averages, Camera2d, Lighting, Probe, RatioRange, View, needles,
};
use eframe::egui::{
    self, Align2, Color32, ColorImage, CornerRadius, Event, Painter, PointerButton, Pos2, Rect,
    Response, Role, Sense, Shape, Stroke, TextureHandle, TextureOptions, Ui, WidgetInfo, pos2,
    vec2,
};
use glam::{DVec2, Vec2, Vec3};
use std::sync::Arc;

/// Height of the strip with the views' names.
pub(crate) const STRIP: f32 = 32.0;
/// What the names of all views and the buttons beside them need, points.
const TABS: f32 = 510.0;
/// Radius of the ball by which the light is moved, points.
const LAMP: f32 = 24.0;

/// What the canvas shows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Kind {
    Lit,
    AlphaX,
    AlphaY,
    Ratio,
    Direction,
    Grain,
    Strokes,
    Coverage,
    Lint,
}

impl Kind {
    pub(crate) const ALL: [Self; 9] = [
        Self::Lit,
        Self::AlphaX,
        Self::AlphaY,
        Self::Ratio,
        Self::Direction,
        Self::Grain,
        Self::Strokes,
        Self::Coverage,
        Self::Lint,
    ];

    pub(crate) fn action(self) -> Action {
        match self {
            Self::Lit => Action::View1,
            Self::AlphaX => Action::View2,
            Self::AlphaY => Action::View3,
            Self::Ratio => Action::View4,
            Self::Direction => Action::View5,
            Self::Grain => Action::View6,
            Self::Strokes => Action::View7,
            Self::Coverage => Action::View8,
            Self::Lint => Action::View9,
        }
    }
}

/// A stroke in flight.
struct Drawing {
    string: PulledString,
    /// Whole turns of UV that are taken off, so that a stroke on a copy of the map is one on the map.
    turns: Vec2,
    inverse: bool,
    /// Set where the stroke is one straight line: nothing between its ends counts.
    line_from: Option<Vec2>,
}

/// What a drag without a pressed button changes: begun by a key, ended by a click.
#[derive(Clone, Copy)]
pub(crate) enum Adjusting {
    Size {
        from: Pos2,
        radius: f32,
        hardness: f32,
    },
    Flow {
        from: Pos2,
        flow: f32,
    },
}

/// The canvas and what it remembers.
pub(crate) struct CanvasPane {
    pub(crate) kind: Kind,
    camera: Option<Camera2d>,
    /// Nobody moved or zoomed it: the whole map is shown, whatever becomes of the room and of the map.
    fits: bool,
    map: Size,
    averages: Option<Averages>,
    texture: Option<TextureHandle>,
    pixels: Vec<u8>,
    /// What the pixels show; another one is drawn whole.
    drawn: Option<(Camera2d, View)>,
    pub(crate) light: Vec3,
    drawing: Option<Drawing>,
    pub(crate) adjusting: Option<Adjusting>,
    /// Where the last stroke ended, surface units.
    last_end: Option<Vec2>,
    pub(crate) probe: Option<Probe>,
    pub(crate) wrap: bool,
    holding_light: bool,
    overlay: Overlay,
    ranges: Ranges,
    legend: LegendPicture,
    /// Where the canvas is, points.
    pub(crate) rect: Rect,
}

impl Default for CanvasPane {
    fn default() -> Self {
        Self {
            kind: Kind::Lit,
            camera: None,
            fits: true,
            map: Size::new(1, 1).expect("1 is a size"),
            averages: None,
            texture: None,
            pixels: Vec::new(),
            drawn: None,
            light: Lighting::default().toward,
            drawing: None,
            adjusting: None,
            last_end: None,
            probe: None,
            wrap: false,
            holding_light: false,
            overlay: Overlay::default(),
            ranges: Ranges::default(),
            legend: LegendPicture::default(),
            rect: Rect::NOTHING,
        }
    }
}

impl CanvasPane {
    /// Shows the strip and the canvas in all the room there is.
    pub(crate) fn show(&mut self, ui: &mut Ui, desk: &mut Desk) {
        self.strip(ui, desk);
        let (rect, response) = ui.allocate_exact_size(ui.available_size(), Sense::click_and_drag());
        response.widget_info(|| WidgetInfo::labeled(Role::Canvas, true, "Paint canvas"));
        self.rect = rect;
        ui.painter()
            .rect_filled(rect, CornerRadius::ZERO, Palette::of(ui).backdrop);
        let Some(mut camera) = self.camera_for(ui, rect, desk) else {
            return;
        };
        let before = camera;
        self.navigate(ui, &response, desk, &mut camera);
        self.fits &= camera == before;
        self.camera = Some(camera);
        self.paint_with_pen(ui, &response, desk, camera);
        self.draw(ui, desk, camera);
        if let Some(texture) = &self.texture {
            let uv = Rect::from_min_max(pos2(0.0, 0.0), pos2(1.0, 1.0));
            ui.painter().image(texture.id(), rect, uv, Color32::WHITE);
        }
        let painter = ui.painter_at(rect);
        self.draw_overlay(ui, &painter, desk, camera);
        self.frame_of_map(&painter, desk, camera, ui);
        if desk.hand.kind() == ToolKind::Guide {
            self.edit_guides(ui, &painter, &response, desk, camera);
        }
        self.look_under_pointer(&response, desk, camera);
        self.linked(ui, &painter, desk, camera);
        self.legend(ui, &painter, desk);
        if self.kind.is_lit() {
            self.light_handle(ui, &painter, &response);
        }
        self.cursor(ui, &painter, &response, desk, camera);
    }

    fn strip(&mut self, ui: &mut Ui, desk: &mut Desk) {
        strip(ui, |ui| {
            if ui.available_width() < TABS {
                self.view_choice(ui, desk);
            } else {
                self.view_tabs(ui, desk);
            }
            ui.with_layout(egui::Layout::right_to_left(egui::Align::Center), |ui| {
                ui.spacing_mut().item_spacing.x = 2.0;
                for (icon, action, on) in [
                    (Icon::Frame, Action::CanvasFit, false),
                    (Icon::Wrap, Action::ToggleWrap, self.wrap),
                ] {
                    let button = icon_button(ui, icon, action.name(), 24.0, on);
                    if button.on_hover_text(desk.tip(action)).clicked() {
                        desk.ask(action);
                    }
                }
            });
        });
    }

    fn view_tabs(&self, ui: &mut Ui, desk: &mut Desk) {
        for kind in Kind::ALL {
            let action = kind.action();
            let tip = desk.tip(action);
            if tab(ui, action.name(), kind == self.kind)
                .on_hover_text(tip)
                .clicked()
            {
                desk.ask(action);
            }
        }
    }

    /// The same where there is no room for all of them.
    fn view_choice(&self, ui: &mut Ui, desk: &mut Desk) {
        let tip = desk.tip(Action::CycleView);
        egui::ComboBox::from_id_salt("view")
            .selected_text(self.kind.action().name())
            .show_ui(ui, |ui| {
                for kind in Kind::ALL {
                    let action = kind.action();
                    let label = ui.selectable_label(kind == self.kind, action.name());
                    if label.on_hover_text(desk.tip(action)).clicked() {
                        desk.ask(action);
                    }
                }
            })
            .response
            .accessible_name("View")
            .on_hover_text(tip);
    }

    /// The camera of this frame: the one there was, made to fit what changed around it.
    fn camera_for(&mut self, ui: &Ui, rect: Rect, desk: &Desk) -> Option<Camera2d> {
        let scale = ui.pixels_per_point();
        let side = |points: f32| (points * scale).round() as u32;
        let size = Size::new(side(rect.width()), side(rect.height())).ok()?;
        let map = desk.studio.map().size();
        let aspect = self.texel_aspect(desk);
        let mut camera = match self.camera {
            Some(camera) if !self.fits && self.map == map => camera,
            // The same part of another map of the same document.
            Some(camera) if !self.fits && self.map.texels() > 1 => Camera2d {
                zoom: camera.zoom * f64::from(self.map.height()) / f64::from(map.height()),
                ..camera
            },
            _ => fitted(map, size, aspect),
        };
        self.map = map;
        camera.size = size;
        camera.texel_aspect = aspect;
        camera.repeat = self.wrap;
        Some(camera)
    }

    fn texel_aspect(&self, desk: &Desk) -> f64 {
        let map = desk.studio.map().size();
        let aspect = desk.studio.recipe().aspect_at(map);
        f64::from(aspect) * f64::from(map.height()) / f64::from(map.width())
    }

    /// Begins anew with another document.
    pub(crate) fn forget(&mut self) {
        self.camera = None;
        self.fits = true;
        self.averages = None;
        self.drawn = None;
        self.drawing = None;
        self.last_end = None;
    }

    /// Shows the whole map, and goes on to until somebody moves it.
    pub(crate) fn fit(&mut self) {
        self.fits = true;
    }

    /// One texel on one pixel.
    pub(crate) fn actual_texels(&mut self) {
        if let Some(camera) = &mut self.camera {
            camera.zoom = 1.0;
            self.fits = false;
        }
    }

    /// Larger (or smaller) around the middle.
    pub(crate) fn zoom_by(&mut self, factor: f64) {
        if let Some(camera) = self.camera {
            let middle = 0.5
                * DVec2::new(
                    f64::from(camera.size.width()),
                    f64::from(camera.size.height()),
                );
            self.camera = Some(camera.zoomed(self.map, middle, factor));
            self.fits = false;
        }
    }

    /// Canvas pixels per texel.
    pub(crate) fn zoom(&self) -> f64 {
        self.camera.map_or(1.0, |c| c.pixels_per_texel().y)
    }

    fn navigate(&mut self, ui: &Ui, response: &Response, desk: &Desk, camera: &mut Camera2d) {
        let scale = f64::from(ui.pixels_per_point());
        let pixel = |p: Pos2| self.pixel(ui, p);
        let space = ui.input(|i| i.key_down(egui::Key::Space)) && !ui.ctx().text_edit_focused();
        let held = super::viewport::held(ui, response, desk);
        // A flat map cannot be turned: what turns the mesh moves it.
        let pans = matches!(held, Some(Drag::Turn | Drag::Pan))
            || (space && response.dragged_by(PointerButton::Primary));
        if pans && self.drawing.is_none() && !desk.guides.is_held() {
            let delta = response.drag_delta();
            let by = DVec2::new(f64::from(delta.x), f64::from(delta.y)) * scale;
            *camera = camera.panned(self.map, by);
            ui.ctx().set_cursor_icon(egui::CursorIcon::Grabbing);
        } else if held == Some(Drag::Zoom)
            && let Some(from) = ui.input(|i| i.pointer.press_origin())
        {
            let factor = 1.01f64.powf(f64::from(-response.drag_delta().y));
            *camera = camera.zoomed(self.map, pixel(from), factor);
        }
        if let Some(pointer) = response.hover_pos() {
            let (wheel, pinch) = ui.input(|i| (i.smooth_scroll_delta.y, i.zoom_delta()));
            let factor = f64::from(pinch) * 1.0025f64.powf(f64::from(wheel));
            if factor != 1.0 {
                *camera = camera.zoomed(self.map, pixel(pointer), factor);
            }
        }
    }

    /// Canvas pixels of a place on the screen.
    fn pixel(&self, ui: &Ui, at: Pos2) -> DVec2 {
        let scale = ui.pixels_per_point();
        let from = (at - self.rect.min) * scale;
        DVec2::new(f64::from(from.x), f64::from(from.y))
    }

    /// Surface units of a place on the screen.
    fn surface_at(&self, ui: &Ui, desk: &Desk, camera: Camera2d, at: Pos2) -> Vec2 {
        let uv = camera.uv_at(self.map, self.pixel(ui, at)).as_vec2();
        uv * extent(desk)
    }

    /// Points on the screen of a place in surface units.
    fn screen_at(&self, scale: f32, desk: &Desk, camera: Camera2d, place: Vec2) -> Pos2 {
        let pixel = camera.pixel_of_uv(self.map, (place / extent(desk)).as_dvec2());
        self.rect.min + vec2(pixel.x as f32, pixel.y as f32) / scale
    }

    /// Points on the screen per surface unit.
    fn points_per_unit(&self, ui: &Ui, camera: Camera2d) -> f32 {
        let pixels = camera.pixels_per_texel().y * f64::from(self.map.height());
        pixels as f32 / ui.pixels_per_point()
    }

    fn draw(&mut self, ui: &Ui, desk: &mut Desk, camera: Camera2d) {
        let other = self.averages.is_none() || desk.news.new_map;
        let made = desk.studio.take_averages().filter(|_| other);
        let map = desk.studio.map();
        if other {
            self.averages = Some(made.unwrap_or_else(|| Averages::new(map)));
            self.drawn = None;
        }
        let averages = self.averages.as_mut().expect("made above");
        if !other {
            for rect in &desk.news.map {
                averages.update(map, *rect);
            }
        }
        if other {
            self.ranges = Ranges {
                alpha: AlphaRange::of(averages),
                ratio: RatioRange::default(),
            };
        }
        let view = self.kind.view(self.light, self.ranges, desk);
        let whole = [camera.size.rect()];
        let parts: Vec<Texels> = if self.drawn != Some((camera, view)) {
            whole.to_vec()
        } else {
            let of = |rect: &Texels| camera.pixels_of(map.size(), map.wrap(), *rect, view.reach());
            desk.news.map.iter().flat_map(of).collect()
        };
        for part in parts {
            self.draw_part(ui, desk, camera, view, part);
        }
        self.drawn = Some((camera, view));
    }

    fn draw_part(&mut self, ui: &Ui, desk: &Desk, camera: Camera2d, view: View, part: Texels) {
        let Some(averages) = &self.averages else {
            return;
        };
        self.pixels.resize(part.texels() * 4, 0);
        view.draw(desk.studio.map(), averages, &camera, part, &mut self.pixels);
        let sides = [part.width as usize, part.height as usize];
        let image = ColorImage::from_rgba_premultiplied(sides, &self.pixels);
        put(ui, &mut self.texture, "canvas", camera.size, part, image);
    }

    fn frame_of_map(&self, painter: &Painter, desk: &Desk, camera: Camera2d, ui: &Ui) {
        let scale = ui.pixels_per_point();
        let extent = extent(desk);
        let (low, high) = (
            self.screen_at(scale, desk, camera, Vec2::new(0.0, extent.y)),
            self.screen_at(scale, desk, camera, Vec2::new(extent.x, 0.0)),
        );
        let line = Stroke::new(1.0, Palette::of(ui).weak.gamma_multiply(0.6));
        painter.rect_stroke(
            Rect::from_min_max(low, high),
            CornerRadius::ZERO,
            line,
            egui::StrokeKind::Outside,
        );
        let hand = &desk.hand;
        let centre = Vec2::from(hand.symmetry_center) * extent;
        let axes: &[(Vec2, Vec2)] = match hand.symmetry() {
            anisomap::paint::Symmetry::None => &[],
            anisomap::paint::Symmetry::MirrorU { .. } => {
                &[(Vec2::new(centre.x, 0.0), Vec2::new(centre.x, extent.y))]
            }
            anisomap::paint::Symmetry::MirrorV { .. } => {
                &[(Vec2::new(0.0, centre.y), Vec2::new(extent.x, centre.y))]
            }
            anisomap::paint::Symmetry::MirrorBoth { .. } => &[
                (Vec2::new(centre.x, 0.0), Vec2::new(centre.x, extent.y)),
                (Vec2::new(0.0, centre.y), Vec2::new(extent.x, centre.y)),
            ],
            anisomap::paint::Symmetry::Radial { .. } => {
                let at = self.screen_at(scale, desk, camera, centre);
                painter.circle_stroke(at, 5.0, Stroke::new(1.5, Palette::of(ui).accent));
                &[]
            }
        };
        for (a, b) in axes {
            let ends = [
                self.screen_at(scale, desk, camera, *a),
                self.screen_at(scale, desk, camera, *b),
            ];
            let dashes =
                Shape::dashed_line(&ends, Stroke::new(1.0, Palette::of(ui).accent), 6.0, 5.0);
            painter.extend(dashes);
        }
    }

    /// What the pointer over the mesh points at: the brush, as it would paint there.
    fn linked(&self, ui: &Ui, painter: &Painter, desk: &Desk, camera: Camera2d) {
        let shown = desk.panes == super::desk::Panes::Both;
        let Some(uv) = desk.on_mesh.filter(|_| shown) else {
            return;
        };
        let place = uv * extent(desk);
        let at = self.screen_at(ui.pixels_per_point(), desk, camera, place);
        if desk.hand.kind().paints() {
            let radius = desk.hand.brush().radius * self.points_per_unit(ui, camera);
            ring(painter, at, radius.max(3.0), 0.8);
        }
        painter.circle_filled(at, 3.0, Color32::from_black_alpha(160));
        painter.circle_filled(at, 1.5, Color32::WHITE);
    }

    fn look_under_pointer(&mut self, response: &Response, desk: &mut Desk, camera: Camera2d) {
        (self.probe, desk.on_map) = (None, None);
        let Some(pointer) = response.hover_pos() else {
            return;
        };
        let scale = response.ctx.pixels_per_point();
        let from = (pointer - self.rect.min) * scale;
        let uv = camera.uv_at(self.map, DVec2::new(f64::from(from.x), f64::from(from.y)));
        let inside = (0.0..=1.0).contains(&uv.x) && (0.0..=1.0).contains(&uv.y);
        if inside || self.wrap {
            self.probe = Probe::at(desk.studio.map(), uv);
            desk.on_map = Some((uv - uv.floor()).as_vec2());
        }
    }

    // ----- The pen. -----

    fn paint_with_pen(&mut self, ui: &Ui, response: &Response, desk: &mut Desk, camera: Camera2d) {
        if self.adjust(ui, response, desk) || self.hold_light(ui, response) {
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

    fn pick(&mut self, desk: &mut Desk) {
        if let Some(probe) = &self.probe {
            desk.hand
                .pick(probe.alpha_x, probe.alpha_y, probe.angle_degrees);
        }
    }

    fn pen_down(&mut self, ui: &Ui, desk: &mut Desk, camera: Camera2d, pointer: Pos2) {
        if !desk.hand.kind().paints() {
            return;
        }
        let modifiers = ui.input(|i| i.modifiers);
        let uv = camera.uv_at(self.map, self.pixel(ui, pointer)).as_vec2();
        let turns = if self.wrap { uv.floor() } else { Vec2::ZERO };
        let at = (uv - turns) * extent(desk);
        let inverse = modifiers.command && !modifiers.shift;
        if !self.begin(desk, inverse) {
            return;
        }
        let line_from = match self.last_end {
            Some(end) if modifiers.shift => Some(end),
            None if modifiers.shift => Some(at),
            _ => None,
        };
        let string = PulledString::new(at, desk.hand.string_length());
        self.drawing = Some(Drawing {
            string,
            turns,
            inverse,
            line_from,
        });
        match line_from {
            Some(from) => self.draw_line(desk, from, aim(from, at, modifiers.command)),
            None => self.stroke_to(desk, at, pressure(ui)),
        }
    }

    /// Begins a stroke, on a paint layer of its own where the selected one takes none.
    fn begin(&mut self, desk: &mut Desk, inverse: bool) -> bool {
        if !desk.ready_layer() {
            return false;
        }
        let seed = desk.stroke_seed();
        let brush = Arc::new(desk.hand.stroke_brush(inverse));
        let begun = desk.studio.begin_stroke(brush, seed);
        desk.told(begun).is_some()
    }

    fn stroke_to(&mut self, desk: &mut Desk, at: Vec2, pressure: f32) {
        if let Some(point) = Point::new(at / extent(desk), pressure) {
            desk.studio.stroke_to(point);
        }
    }

    /// The stroke in flight as one straight line.
    fn draw_line(&mut self, desk: &mut Desk, from: Vec2, to: Vec2) {
        self.stroke_to(desk, from, 1.0);
        self.stroke_to(desk, to, 1.0);
    }

    /// Every motion counts, not only the last of the frame: a fast curve must not become a polygon.
    fn pen_moves(&mut self, ui: &Ui, desk: &mut Desk, camera: Camera2d, (at, force): (Pos2, f32)) {
        let place = self.surface_at(ui, desk, camera, at);
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
                if self.begin(desk, inverse) {
                    self.draw_line(desk, from, end);
                }
            }
            None => {
                if let Some(next) = drawing.string.pull(place) {
                    self.stroke_to(desk, next, force);
                }
            }
        }
    }

    fn pen_up(&mut self, desk: &mut Desk) {
        let Some(drawing) = self.drawing.take() else {
            return;
        };
        self.last_end = Some(drawing.string.brush());
        desk.end_stroke();
    }

    /// Takes the stroke in flight away; `true` when there was one.
    pub(crate) fn cancel(&mut self, desk: &mut Desk) -> bool {
        let adjusting = self.adjusting.take();
        match adjusting {
            Some(Adjusting::Size {
                radius, hardness, ..
            }) => {
                desk.hand.set_radius(radius);
                desk.hand.brush_mut().hardness = hardness;
            }
            Some(Adjusting::Flow { flow, .. }) => desk.hand.brush_mut().flow = flow,
            None => {}
        }
        if self.drawing.take().is_some() {
            desk.studio.cancel_stroke();
            return true;
        }
        let mut guides = std::mem::take(&mut desk.guides);
        let dragged = guides.cancel(desk);
        desk.guides = guides;
        adjusting.is_some() || dragged
    }

    /// Begins to change size or flow by moving the pointer.
    pub(crate) fn begin_adjusting(&mut self, ui: &Ui, desk: &Desk, flow: bool) {
        let from = ui
            .input(|i| i.pointer.hover_pos())
            .unwrap_or(self.rect.center());
        let brush = desk.hand.brush();
        self.adjusting = Some(if flow {
            Adjusting::Flow {
                from,
                flow: brush.flow,
            }
        } else {
            Adjusting::Size {
                from,
                radius: brush.radius,
                hardness: brush.hardness,
            }
        });
    }

    /// Follows the pointer while size or flow is dragged; `true` while it is.
    fn adjust(&mut self, ui: &Ui, response: &Response, desk: &mut Desk) -> bool {
        let Some(adjusting) = self.adjusting else {
            return false;
        };
        let (pointer, clicked, refused) = ui.input(|i| {
            (
                i.pointer.hover_pos(),
                i.pointer.primary_pressed(),
                i.pointer.secondary_pressed(),
            )
        });
        if refused {
            self.cancel(desk);
            return true;
        }
        if let Some(pointer) = pointer {
            match adjusting {
                Adjusting::Size {
                    from,
                    radius,
                    hardness,
                } => {
                    let way = pointer - from;
                    desk.hand.set_radius(radius * 1.012f32.powf(way.x));
                    desk.hand.brush_mut().hardness = (hardness - way.y / 250.0).clamp(0.0, 1.0);
                }
                Adjusting::Flow { from, flow } => {
                    let value = flow + (pointer.x - from.x) / 250.0;
                    desk.hand.brush_mut().flow = value.clamp(0.0, 1.0);
                }
            }
        }
        if clicked || response.clicked() || ui.input(|i| i.key_pressed(egui::Key::Enter)) {
            self.adjusting = None;
        }
        true
    }

    /// Whether a stroke is being drawn.
    #[cfg(test)]
    pub(crate) fn is_drawing(&self) -> bool {
        self.drawing.is_some()
    }

    fn edit_guides(
        &self,
        ui: &Ui,
        painter: &Painter,
        response: &Response,
        desk: &mut Desk,
        camera: Camera2d,
    ) {
        let extent = extent(desk);
        let pixels = ui.pixels_per_point();
        let to_screen = |uv: Vec2| {
            let pixel = camera.pixel_of_uv(self.map, uv.as_dvec2());
            self.rect.min + vec2(pixel.x as f32, pixel.y as f32) / pixels
        };
        let to_uv = |at: Pos2| camera.uv_at(self.map, self.pixel(ui, at)).as_vec2();
        let busy = self.adjusting.is_some() || ui.input(|i| i.key_down(egui::Key::Space));
        let taken = |at: Pos2| busy || self.is_lamp(at);
        let sheet = Sheet {
            to_screen: &to_screen,
            to_uv: &to_uv,
            unit: self.points_per_unit(ui, camera) * extent.y,
            wrap: self.wrap,
            taken: &taken,
        };
        let mut hand = std::mem::take(&mut desk.guides);
        hand.show(ui, painter, response, desk, &sheet);
        desk.guides = hand;
    }

    // ----- What is drawn over the map. -----

    fn cursor(
        &self,
        ui: &Ui,
        painter: &Painter,
        response: &Response,
        desk: &mut Desk,
        camera: Camera2d,
    ) {
        let pointer = response.hover_pos().or(response.interact_pointer_pos());
        let (centre, pointer) = match (self.adjusting, pointer) {
            (Some(Adjusting::Size { from, .. } | Adjusting::Flow { from, .. }), _) => (from, from),
            (None, Some(pointer)) if self.rect.contains(pointer) => (pointer, pointer),
            _ => return,
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
        let radius = brush.radius * self.points_per_unit(ui, camera);
        ring(painter, centre, radius, 1.0);
        if self.adjusting.is_none() {
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
        if self.adjusting.is_some() {
            let text = match self.adjusting {
                Some(Adjusting::Flow { .. }) => format!("flow {:.0}%", brush.flow * 100.0),
                _ => format!(
                    "size {:.4}  hardness {:.0}%",
                    2.0 * brush.radius,
                    brush.hardness * 100.0
                ),
            };
            overlay_text(
                painter,
                centre + vec2(0.0, radius + 16.0),
                Align2::CENTER_TOP,
                &text,
            );
        }
    }

    /// Where else a brush at a place paints: a map that repeats goes on at its opposite edge.
    fn ghosts(
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
    fn hint_of_modifiers(
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

    /// The lamp of the lit view: a ball in the corner, lit from where the sun on it stands.
    fn light_handle(&self, ui: &Ui, painter: &Painter, response: &Response) {
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

    fn lamp_centre(&self) -> Pos2 {
        self.rect.right_top() + vec2(-LAMP - 14.0, LAMP + 14.0)
    }

    fn is_lamp(&self, at: Pos2) -> bool {
        self.kind.is_lit() && at.distance(self.lamp_centre()) < LAMP + 5.0
    }

    fn light_place(&self) -> Pos2 {
        let flat = Vec2::new(self.light.x, self.light.y) / self.light.length().max(1e-6);
        self.lamp_centre() + vec2(flat.x, -flat.y) * LAMP
    }

    /// Moves the light while its ball is dragged, or Shift and the right button are; `true` while it is.
    fn hold_light(&mut self, ui: &Ui, response: &Response) -> bool {
        if !self.kind.is_lit() {
            self.holding_light = false;
            return false;
        }
        let by_chord =
            response.dragged_by(PointerButton::Secondary) && ui.input(|i| i.modifiers.shift);
        let pressed = ui.input(|i| i.pointer.primary_pressed());
        let pointer = ui.input(|i| i.pointer.interact_pos());
        if pressed && response.contains_pointer() && pointer.is_some_and(|p| self.is_lamp(p)) {
            self.holding_light = true;
        }
        if !ui.input(|i| i.pointer.any_down()) {
            self.holding_light = false;
        }
        if !self.holding_light && !by_chord {
            return false;
        }
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

    /// What the colours mean, in the lower left.
    fn legend(&mut self, ui: &Ui, painter: &Painter, desk: &Desk) {
        let corner = self.rect.left_bottom() + vec2(12.0, -12.0);
        let view = self.kind.view(self.light, self.ranges, desk);
        self.legend.show(ui, painter, corner, view);
        if let Some(text) = self.overlay.text(self.kind, desk) {
            overlay_text(painter, corner, Align2::LEFT_BOTTOM, &text);
        }
    }

    /// Short lines along the grooves, so many points apart.
    fn lines(&self, ui: &Ui, painter: &Painter, desk: &Desk, camera: Camera2d, apart: f64) {
        if let Some(averages) = &self.averages {
            let scale = ui.pixels_per_point();
            let lines = needles(
                desk.studio.map(),
                averages,
                &camera,
                apart * f64::from(scale),
            );
            needle_shapes(painter, self.rect, scale, &lines);
        }
    }

    /// What is drawn over the lit map: lines along the grooves, the layer's coverage, what is wrong.
    fn draw_overlay(&mut self, ui: &Ui, painter: &Painter, desk: &mut Desk, camera: Camera2d) {
        let map_changed = desk.news.new_map || !desk.news.map.is_empty();
        match self.kind {
            Kind::Strokes => {
                // The light steps back behind the lines.
                let veil = Color32::from_black_alpha(130);
                painter.rect_filled(self.rect, CornerRadius::ZERO, veil);
                self.lines(ui, painter, desk, camera, 22.0);
            }
            Kind::Coverage => {
                self.overlay
                    .show_coverage(ui, painter, self.rect, desk, camera);
            }
            Kind::Lint => {
                let busy = self.drawing.is_some();
                self.overlay
                    .show_lint(ui, painter, self.rect, desk, camera, map_changed, busy);
            }
            Kind::Lit if desk.hand.kind() == ToolKind::Guide => {
                // Where they lead does not show in a light from one side.
                self.overlay.rest(map_changed);
                self.lines(ui, painter, desk, camera, 30.0);
            }
            _ => self.overlay.rest(map_changed),
        }
    }
}

impl Kind {
    /// Whether it is the lit map, perhaps with something over it.
    fn is_lit(self) -> bool {
        matches!(
            self,
            Self::Lit | Self::Strokes | Self::Coverage | Self::Lint
        )
    }

    fn view(self, light: Vec3, ranges: Ranges, desk: &Desk) -> View {
        let recipe = desk.studio.recipe();
        match self {
            Self::Lit | Self::Strokes | Self::Coverage | Self::Lint => View::Lit(Lighting {
                toward: light,
                material: recipe.material,
                exposure: desk.studio.scene().exposure,
                ..Lighting::default()
            }),
            Self::AlphaX => View::AlphaX(ranges.alpha),
            Self::AlphaY => View::AlphaY(ranges.alpha),
            Self::Ratio => View::Ratio(ranges.ratio),
            Self::Direction => View::Direction,
            Self::Grain => View::Grain,
        }
    }
}

fn fitted(map: Size, canvas: Size, texel_aspect: f64) -> Camera2d {
    let mut camera = Camera2d::fit(map, canvas, texel_aspect);
    camera.zoom *= 0.94;
    camera
}

/// Width and height of one turn of UV, surface units.
pub(crate) fn extent(desk: &Desk) -> Vec2 {
    Vec2::new(
        desk.studio.recipe().aspect_at(desk.studio.map().size()),
        1.0,
    )
}

/// The end of a straight line toward the pointer, by steps of 15 degrees where the angle snaps.
fn aim(from: Vec2, to: Vec2, snap: bool) -> Vec2 {
    if snap { snap_angle(from, to, 15.0) } else { to }
}

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

fn cross(painter: &Painter, centre: Pos2) {
    for way in [vec2(1.0, 0.0), vec2(0.0, 1.0)] {
        for side in [-1.0, 1.0] {
            let ends = [centre + way * side * 5.0, centre + way * side * 10.0];
            painter.line_segment(ends, Stroke::new(2.5, Color32::from_black_alpha(120)));
            painter.line_segment(ends, Stroke::new(1.0, Color32::WHITE));
        }
    }
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
    let (rect, response) = ui.allocate_exact_size(galley.size() + vec2(14.0, 9.0), Sense::click());
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
