//! The canvas: the map in two dimensions, and the pen on it.

mod cursor;
mod lamp;
mod outlines;
mod stroke;

use super::desk::Desk;
use super::guides::Sheet;
use super::icons::Icon;
use super::overlay::{Colours, LegendPicture, Overlay, Ranges, lint_legend, needle_shapes};
use super::pane::{put, strip, tab};
use super::theme::Palette;
use super::widgets::{icon_button, overlay_text};
use anisomap::map::{Rect as Texels, Size};
use anisomap::studio::action::Action;
use anisomap::studio::hand::ToolKind;
use anisomap::studio::orbit::Drag;
use anisomap::studio::view::{
    AlphaRange, Averages, Camera2d, Lighting, Probe, RatioRange, View, needles,
};
use eframe::egui::{
    self, Align2, Color32, ColorImage, CornerRadius, Painter, PointerButton, Pos2, Rect, Response,
    Sense, Shape, Stroke, TextureHandle, Ui, pos2, vec2,
};
use glam::{DVec2, Vec2, Vec3};
pub(crate) use lamp::button;
use outlines::Layout;
use stroke::Drawing;

/// What the names of all views and the buttons beside them need, points.
const TABS: f32 = 510.0;

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
    /// Where the last stroke ended, surface units.
    last_end: Option<Vec2>,
    pub(crate) probe: Option<Probe>,
    pub(crate) wrap: bool,
    holding_light: bool,
    layout: Layout,
    pub(crate) overlay: Overlay,
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
            last_end: None,
            probe: None,
            wrap: false,
            holding_light: false,
            layout: Layout::default(),
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
        self.rect = rect;
        ui.painter()
            .rect_filled(rect, CornerRadius::ZERO, Palette::of(ui).backdrop);
        let Some(mut camera) = self.camera_for(ui, rect, desk) else {
            return;
        };
        let before = camera;
        self.navigate(ui, &response, desk, &mut camera);
        self.steer(ui, &response, desk, &mut camera);
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
        self.layout.show(ui, &painter, rect, desk, camera);
        self.frame_of_map(&painter, desk, camera, ui);
        if desk.hand.kind() == ToolKind::Guide {
            self.edit_guides(ui, &painter, &response, desk, camera);
        }
        self.look_under_pointer(&response, desk, camera);
        self.linked(ui, &painter, desk, camera);
        self.legend(ui, &painter, desk);
        if self.kind.is_lit() {
            self.light_handle(ui, &painter, &response, desk);
        }
        self.show_focus(ui, &painter, &response);
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
                    (
                        Icon::Outlines,
                        Action::ToggleOutlines,
                        self.layout.is_shown(desk),
                    ),
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

    /// Shows or hides where the charts of the mesh end.
    pub(crate) fn toggle_outlines(&mut self, desk: &Desk) {
        self.layout.toggle(desk);
    }

    /// Whether it shows where the charts of the mesh end.
    #[cfg(test)]
    pub(crate) fn shows_outlines(&self, desk: &Desk) -> bool {
        self.layout.is_shown(desk)
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
        // With the guide tool it draws, whatever else is held.
        let draws = desk.hand.kind() == ToolKind::Guide
            && response.dragged_by(PointerButton::Primary)
            && !space;
        if pans && !draws && self.drawing.is_none() && !desk.guides.is_held() {
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
        let busy = desk.adjusting.is_some() || ui.input(|i| i.key_down(egui::Key::Space));
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

    /// What the colours mean, in the lower left.
    fn legend(&mut self, ui: &Ui, painter: &Painter, desk: &Desk) {
        let mut corner = self.rect.left_bottom() + vec2(12.0, -12.0);
        if let Some(text) = self.overlay.text(self.kind, desk) {
            let below = overlay_text(painter, corner, Align2::LEFT_BOTTOM, &text);
            corner = below.left_top() - vec2(0.0, 6.0);
        }
        let view = self.kind.view(self.light, self.ranges, desk);
        match self.kind {
            Kind::Lint if self.overlay.has_marks() => lint_legend(painter, corner),
            Kind::Coverage => {
                if let Some(colours) = self.overlay.colours() {
                    self.legend.show(ui, painter, corner, colours);
                }
            }
            _ => self.legend.show(ui, painter, corner, Colours::View(view)),
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
