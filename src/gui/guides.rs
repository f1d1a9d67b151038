//! Guides by hand: drawn, dragged by their handles and deleted on the canvas, their numbers in the panel.

mod panel;
mod points;

use super::canvas::extent;
use super::desk::Desk;
use super::pane::{Pen, pen};
use super::theme::Palette;
use anisomap::guide::{Guide, Guides, Handle, HandleKind, Mode, Modifiers, Shape};
use anisomap::map::AnisoMap;
use anisomap::recipe::{Layer, Source};
use eframe::egui::{self, Color32, CursorIcon, Painter, Pos2, Stroke, Ui};
use glam::Vec2;
pub(crate) use panel::{bar, panel};

/// How near the pointer must be to a handle, and to an outline, points.
const NEAR_HANDLE: f32 = 9.0;
const NEAR_OUTLINE: f32 = 6.0;
/// How near to an outline a place of the mesh must lie that is clicked, surface units.
const NEAR_ON_MESH: f32 = 0.02;
/// How far a press must go before it draws, and how far a hand trembles, points.
const DRAWS: f32 = 5.0;
const TREMBLE: f32 = 2.0;
/// Widths whose ratio stays below this show no direction to speak of.
const ROUND: f32 = 1.25;

/// What is being dragged.
#[derive(Clone, Debug, PartialEq)]
enum Held {
    /// A handle, by this place as seen from it, UV units.
    Handle(HandleKind, Vec2),
    /// The whole guide, by this place on it as seen from its centre, UV units.
    Body(Vec2),
    /// A guide that is being drawn, along this path in UV, and pressed at this place of the screen.
    New(Vec<Vec2>, Pos2),
}

/// A drag that goes on.
#[derive(Debug)]
struct Grip {
    held: Held,
    /// Whole turns of UV that are taken off, so that a drag on a copy of the map is one on the map.
    turns: Vec2,
    /// Where the pointer is, once it has moved.
    now: Option<Pos2>,
    /// Whether it changed anything.
    changed: bool,
}

/// The hand on the guides of the selected layer.
#[derive(Default)]
pub(crate) struct GuideHand {
    pub(crate) selected: Option<usize>,
    /// The point of its line or curve that was last taken hold of: its numbers are in the panel, and of a curve the tangents
    /// there are shown.
    point: usize,
    /// The point that the panel's list was last brought to.
    listed: Option<usize>,
    /// The guide whose numbers the panel showed last.
    in_panel: Option<usize>,
    /// The layer that the selected one is in.
    of_layer: usize,
    /// What a drag draws, as a place in [`Shape::NAMES`], and how it leads.
    pub(crate) shape: usize,
    pub(crate) mode: Mode,
    grip: Option<Grip>,
}

/// Places on the screen and in UV.
pub(crate) struct Sheet<'a> {
    pub(crate) to_screen: &'a dyn Fn(Vec2) -> Pos2,
    pub(crate) to_uv: &'a dyn Fn(Pos2) -> Vec2,
    /// Points on the screen per surface unit.
    pub(crate) unit: f32,
    /// Whether copies of the map are shown.
    pub(crate) wrap: bool,
    /// Whether a press at a place is meant for something else.
    pub(crate) taken: &'a dyn Fn(Pos2) -> bool,
}

/// The guides of the selected layer, with its place.
fn selected_guides(desk: &Desk) -> Option<(usize, Guides)> {
    let at = desk.studio.selected();
    match &desk.studio.recipe().layers.get(at)?.source {
        Source::Guides(guides) => Some((at, guides.clone())),
        _ => None,
    }
}

/// What the history calls a change of the nth guide.
fn told(what: &str, shape: &Shape, i: usize) -> String {
    format!("{what} {} {}", shape.name(), i + 1)
}

/// What dragging a handle does.
fn verb(kind: HandleKind) -> &'static str {
    match kind {
        HandleKind::Center => "Move",
        HandleKind::Rotation => "Turn",
        HandleKind::Scale => "Scale",
        _ => "Reshape",
    }
}

/// Gives a layer other guides; `false` where that was refused.
fn set(desk: &mut Desk, at: usize, what: &str, guides: Guides) -> bool {
    let done = desk.studio.set_source(at, what, Source::Guides(guides));
    desk.told(done).is_some()
}

/// The selected layer of guides, or the uppermost one, which is selected then.
pub(crate) fn find_layer(desk: &mut Desk) {
    if selected_guides(desk).is_none() {
        let layers = &desk.studio.recipe().layers;
        let found = layers.iter().rposition(|l| l.source.name() == "guides");
        if let Some(at) = found {
            desk.studio.select(at);
        }
    }
}

impl GuideHand {
    /// Follows the pointer over the canvas, and draws the guides.
    pub(crate) fn show(
        &mut self,
        ui: &Ui,
        painter: &Painter,
        response: &egui::Response,
        desk: &mut Desk,
        sheet: &Sheet<'_>,
    ) {
        if self.of_layer != desk.studio.selected() && self.grip.is_none() {
            self.selected = None;
            self.of_layer = desk.studio.selected();
        }
        for pen in pen(ui, response) {
            match pen {
                Pen::Down(at) if !(sheet.taken)(at) => self.press(desk, at, sheet),
                Pen::Down(_) => {}
                Pen::Move(at) => self.go_on(at, sheet),
                Pen::Up => {
                    self.follow(ui, desk, sheet);
                    self.lift(desk, sheet);
                }
            }
        }
        if self.grip.is_some() && !ui.input(|i| i.pointer.primary_down()) {
            self.lift(desk, sheet); // lifted where nobody saw it
        }
        self.follow(ui, desk, sheet);
        if let Some((_, guides)) = selected_guides(desk) {
            self.selected = self.selected.filter(|i| *i < guides.guide.len());
            let aspect = extent(desk).x;
            let hot = self.hot(ui, response, &guides, aspect, sheet);
            self.paint(ui, painter, &guides, aspect, sheet, hot);
        } else if response.hovered() {
            ui.ctx().set_cursor_icon(CursorIcon::Crosshair);
        }
    }

    /// Whether something is being dragged.
    pub(crate) fn is_held(&self) -> bool {
        self.grip.is_some()
    }

    fn press(&mut self, desk: &mut Desk, pointer: Pos2, sheet: &Sheet<'_>) {
        let uv = (sheet.to_uv)(pointer);
        let copy = if sheet.wrap { uv.floor() } else { Vec2::ZERO };
        let aspect = extent(desk).x;
        let guides = selected_guides(desk).map(|(_, guides)| guides);
        let met = guides.and_then(|guides| {
            // A guide may reach beyond the map: there its own place comes before that of a copy.
            [Vec2::ZERO, copy].into_iter().find_map(|turns| {
                let (selected, held) = self.meets(&guides, aspect, pointer, turns, sheet)?;
                Some((selected, held, turns))
            })
        });
        let (held, turns) = match met {
            Some((selected, held, turns)) => {
                self.select(selected);
                if let Held::Handle(HandleKind::Point(i), _) = held {
                    self.point = i;
                }
                (held, turns)
            }
            None => (Held::New(vec![uv - copy], pointer), copy),
        };
        desk.studio.seal();
        self.grip = Some(Grip {
            held,
            turns,
            now: None,
            changed: false,
        });
    }

    /// The handle of the selected guide, or the outline of any, that lies at a place of the screen.
    fn meets(
        &self,
        guides: &Guides,
        aspect: f32,
        pointer: Pos2,
        turns: Vec2,
        sheet: &Sheet<'_>,
    ) -> Option<(usize, Held)> {
        let uv = (sheet.to_uv)(pointer) - turns;
        if let Some((i, guide)) = self.selected.and_then(|i| Some((i, guides.guide.get(i)?))) {
            // Those that lie over others come last.
            let handles = self.handles(guide, aspect);
            let away = |at: Vec2| (sheet.to_screen)(at + turns).distance(pointer);
            let near = handles.iter().rev().find(|h| away(h.at) < NEAR_HANDLE);
            if let Some(handle) = near {
                return Some((i, Held::Handle(handle.kind, uv - handle.at)));
            }
        }
        let near = |g: &Guide| g.distance(uv, aspect) * sheet.unit < NEAR_OUTLINE;
        let i = guides.guide.iter().rposition(near)?;
        let by = uv - Vec2::from(guides.guide[i].center());
        Some((i, Held::Body(by)))
    }

    fn go_on(&mut self, pointer: Pos2, sheet: &Sheet<'_>) {
        let Some(grip) = &mut self.grip else { return };
        grip.now = Some(pointer);
        if let Held::New(path, _) = &mut grip.held {
            path.push((sheet.to_uv)(pointer) - grip.turns);
        }
    }

    /// Makes the document say what the drag says by now.
    fn follow(&mut self, ui: &Ui, desk: &mut Desk, sheet: &Sheet<'_>) {
        let Some(grip) = &self.grip else { return };
        let Some(now) = grip.now else { return };
        let keys = ui.input(|i| i.modifiers);
        let modifiers = Modifiers {
            snap: keys.command,
            proportional: keys.shift,
            centered: keys.alt,
        };
        let aspect = extent(desk).x;
        let to = (sheet.to_uv)(now) - grip.turns;
        let done = match &grip.held {
            Held::New(_, from) if !grip.changed && from.distance(now) < DRAWS => return,
            Held::New(path, _) => {
                let name = Shape::NAMES[self.shape];
                let drawn = Guide::drawn(name, path, modifiers, TREMBLE / sheet.unit, aspect);
                let Some(mut guide) = drawn else { return };
                guide.mode = self.mode;
                self.lay(desk, guide)
            }
            Held::Handle(kind, by) => {
                let (kind, to) = (*kind, to - *by);
                self.change(desk, verb(kind), |g| g.drag(kind, to, modifiers, aspect))
            }
            Held::Body(by) => {
                let to = to - *by;
                self.change(desk, "Move", |g| {
                    g.drag(HandleKind::Center, to, modifiers, aspect)
                })
            }
        };
        match (done, &mut self.grip) {
            (true, Some(grip)) => grip.changed = true,
            _ => self.grip = None, // it was told why
        }
    }

    fn change(&self, desk: &mut Desk, what: &str, change: impl FnOnce(&Guide) -> Guide) -> bool {
        let Some((at, mut guides)) = selected_guides(desk) else {
            return false;
        };
        let Some((i, guide)) = self
            .selected
            .and_then(|i| Some((i, guides.guide.get_mut(i)?)))
        else {
            return false;
        };
        *guide = change(guide);
        let what = told(what, &guide.shape, i);
        set(desk, at, &what, guides)
    }

    fn select(&mut self, guide: usize) {
        if self.selected != Some(guide) {
            (self.selected, self.point, self.listed) = (Some(guide), 0, None);
        }
    }

    /// Selects the uppermost guide that a place of the map lies in or near, or none.
    pub(crate) fn select_at(&mut self, desk: &Desk, uv: Vec2) {
        let Some((_, guides)) = selected_guides(desk) else {
            return;
        };
        self.of_layer = desk.studio.selected();
        let aspect = extent(desk).x;
        let holds = |guide: &Guide, uv: Vec2| {
            guide.contains(uv, aspect) || guide.distance(uv, aspect) < NEAR_ON_MESH
        };
        // On a map that repeats a guide leads across its border too.
        let wrap = desk.studio.map().wrap();
        let turns = |t: f32, repeats: bool| {
            let inside = if repeats { t - t.floor() } else { t };
            [0.0, -1.0, 1.0].map(|turn| if repeats { inside + turn } else { inside })
        };
        let (across, along) = (turns(uv.x, wrap.repeats_u()), turns(uv.y, wrap.repeats_v()));
        let found = along
            .into_iter()
            .flat_map(|v| across.map(|u| Vec2::new(u, v)))
            .find_map(|uv| guides.guide.iter().rposition(|g| holds(g, uv)));
        match found {
            Some(guide) => self.select(guide),
            None => self.selected = None,
        }
    }

    /// The place on a curve whose tangents are shown: of its points the one that is meant, or that its tangent hangs on.
    fn knot(&self, points: usize) -> usize {
        knot_of(self.point.min(points.saturating_sub(1)), points)
    }

    /// The handles that are shown: of a curve's tangents those of one point alone.
    fn handles(&self, guide: &Guide, aspect: f32) -> Vec<Handle> {
        let mut handles = guide.handles(aspect);
        if let Shape::Curve { points, .. } = &guide.shape {
            handles.retain(|h| match h.kind {
                HandleKind::Point(i) => {
                    i % 3 == 0 || knot_of(i, points.len()) == self.knot(points.len())
                }
                _ => true,
            });
        }
        handles
    }

    /// Puts the guide that is being drawn over those of the layer, in the place of what it was a moment ago; on a layer of its
    /// own where the selected one has none.
    fn lay(&mut self, desk: &mut Desk, guide: Guide) -> bool {
        let before = self.grip.as_ref().is_some_and(|g| g.changed);
        desk.close_hint();
        match selected_guides(desk) {
            Some(_) if before => self.change(desk, "Draw", |_| guide),
            Some((at, mut guides)) => {
                let i = guides.guide.len();
                let what = told("Draw", &guide.shape, i);
                guides.guide.push(guide);
                self.select(i);
                set(desk, at, &what, guides)
            }
            None => {
                let mut layer = layer(desk);
                let what = told("Draw", &guide.shape, 0);
                if let Source::Guides(guides) = &mut layer.source {
                    guides.guide.push(guide);
                }
                (self.selected, self.point, self.listed) = (Some(0), 0, None);
                let added = desk.studio.add_growing_layer(layer, &what);
                self.of_layer = desk.studio.selected();
                desk.told(added).is_some()
            }
        }
    }

    fn lift(&mut self, desk: &mut Desk, sheet: &Sheet<'_>) {
        let Some(grip) = self.grip.take() else { return };
        desk.studio.seal();
        if let Held::New(path, _) = grip.held
            && !grip.changed
        {
            // A click: what lies under it is meant.
            let aspect = extent(desk).x;
            let guides = selected_guides(desk).map(|(_, guides)| guides);
            self.selected = guides.and_then(|guides| {
                let within = |uv: Vec2| guides.guide.iter().rposition(|g| g.contains(uv, aspect));
                within(path[0])
                    .or_else(|| (sheet.wrap).then(|| within(path[0] + grip.turns)).flatten())
            });
        }
    }

    /// Takes back what the drag did so far; `true` when there was one.
    pub(crate) fn cancel(&mut self, desk: &mut Desk) -> bool {
        let Some(grip) = self.grip.take() else {
            return false;
        };
        if grip.changed {
            let done = desk.studio.take_back();
            desk.told(done);
            if matches!(grip.held, Held::New(..)) {
                self.selected = None;
            }
        }
        true
    }

    /// What the held keys do to the drag that goes on, or would do to one.
    pub(crate) fn hint(&self, keys: egui::Modifiers) -> Option<&'static str> {
        let name = Shape::NAMES[self.shape];
        let from_middle = matches!(name, "line" | "ellipse" | "rectangle");
        let held = self.grip.as_ref().map(|g| &g.held);
        match held {
            Some(Held::Handle(HandleKind::Rotation, _)) if keys.command => {
                Some("steps of 15\u{b0}")
            }
            Some(Held::Handle(HandleKind::Width | HandleKind::Height, _)) if keys.shift => {
                Some("keeps the shape")
            }
            Some(Held::Handle(..) | Held::Body(_)) => None,
            None if keys.alt && !from_middle => Some("Space and a drag: move the map"),
            None if keys.alt => Some("drag: from its middle; Space and a drag: move the map"),
            _ => match name {
                "line" if keys.shift || keys.command => Some("steps of 15\u{b0}"),
                "ellipse" if keys.shift => Some("a circle"),
                "rectangle" if keys.shift => Some("a square"),
                _ if keys.alt && from_middle => Some("from its middle"),
                _ => None,
            },
        }
    }

    /// The guide whose outline lies under the pointer; the pointer says what a drag would do.
    fn hot(
        &self,
        ui: &Ui,
        response: &egui::Response,
        guides: &Guides,
        aspect: f32,
        sheet: &Sheet<'_>,
    ) -> Option<usize> {
        let pointer = response.hover_pos().filter(|_| self.grip.is_none())?;
        let met = self.meets(guides, aspect, pointer, Vec2::ZERO, sheet);
        ui.ctx().set_cursor_icon(match met {
            Some(_) => CursorIcon::Move,
            None => CursorIcon::Crosshair,
        });
        met.map(|(i, _)| i)
    }

    fn paint(
        &self,
        ui: &Ui,
        painter: &Painter,
        guides: &Guides,
        aspect: f32,
        sheet: &Sheet<'_>,
        hot: Option<usize>,
    ) {
        let accent = Palette::of(ui).accent;
        for (i, guide) in guides.guide.iter().enumerate() {
            let selected = self.selected == Some(i);
            let colour = if selected {
                accent
            } else if hot == Some(i) {
                Color32::WHITE
            } else {
                Color32::from_rgb(0x8a, 0xc6, 0xe8)
            };
            for [from, to] in guide.outline(aspect) {
                let ends = [(sheet.to_screen)(from), (sheet.to_screen)(to)];
                painter.line_segment(ends, Stroke::new(3.5, Color32::from_black_alpha(120)));
                painter.line_segment(ends, Stroke::new(1.5, colour));
            }
            if selected {
                self.paint_handles(ui, painter, guide, aspect, sheet, accent);
            }
        }
    }

    fn paint_handles(
        &self,
        ui: &Ui,
        painter: &Painter,
        guide: &Guide,
        aspect: f32,
        sheet: &Sheet<'_>,
        accent: Color32,
    ) {
        let pointer = ui.input(|i| i.pointer.hover_pos());
        let centre = (sheet.to_screen)(guide.center().into());
        let handles = self.handles(guide, aspect);
        let is_curve = matches!(guide.shape, Shape::Curve { .. });
        let near = |h: &&Handle| {
            pointer.is_some_and(|p| p.distance((sheet.to_screen)(h.at)) < NEAR_HANDLE)
        };
        // Of those that lie over each other the one that a press takes hold of.
        let under = handles.iter().rev().find(near).map(|h| h.kind);
        for handle in &handles {
            let at = (sheet.to_screen)(handle.at);
            if handle.kind == HandleKind::Rotation {
                painter.line_segment([centre, at], Stroke::new(1.0, accent.gamma_multiply(0.6)));
            }
            let held = self.grip.as_ref().map(|g| &g.held);
            let hot = match held {
                Some(Held::Handle(kind, _)) => *kind == handle.kind,
                Some(_) => false,
                None => under == Some(handle.kind),
            };
            let fill = if hot {
                accent
            } else {
                Color32::from_rgb(0x20, 0x22, 0x25)
            };
            let stroke = Stroke::new(1.5, if hot { Color32::WHITE } else { accent });
            match handle.kind {
                HandleKind::Point(i) if is_curve && i % 3 != 0 => {
                    // What pulls the curve hangs on the place that it passes.
                    let n = guide.shape.points().map_or(1, |(points, _)| points.len());
                    let knot = knot_of(i, n);
                    let knot = handles.iter().find(|h| h.kind == HandleKind::Point(knot));
                    if let Some(knot) = knot {
                        let line = Stroke::new(1.0, accent.gamma_multiply(0.6));
                        painter.line_segment([(sheet.to_screen)(knot.at), at], line);
                    }
                    let fill = if i == self.point { accent } else { fill };
                    painter.circle(at, 3.0, fill, stroke);
                }
                HandleKind::Rotation | HandleKind::Center => {
                    painter.circle(at, 5.0, fill, stroke);
                }
                HandleKind::Falloff => {
                    painter.circle(at, 3.5, fill, stroke);
                }
                HandleKind::Point(i) if i == self.point => {
                    let square = egui::Rect::from_center_size(at, egui::Vec2::splat(8.0));
                    painter.rect(square, 1.0, accent, stroke, egui::StrokeKind::Middle);
                }
                _ => {
                    let square = egui::Rect::from_center_size(at, egui::Vec2::splat(8.0));
                    painter.rect(square, 1.0, fill, stroke, egui::StrokeKind::Middle);
                }
            }
            if hot && held.is_none() {
                super::widgets::overlay_text(
                    painter,
                    at + egui::vec2(10.0, 0.0),
                    egui::Align2::LEFT_CENTER,
                    handle_name(handle.kind),
                );
            }
        }
    }

    /// Takes the selected guide away; `true` when there was one.
    pub(crate) fn delete(&mut self, desk: &mut Desk) -> bool {
        let Some((at, mut guides)) = selected_guides(desk) else {
            return false;
        };
        let Some(i) = self.selected.take().filter(|i| *i < guides.guide.len()) else {
            return false;
        };
        let gone = guides.guide.remove(i);
        set(desk, at, &told("Delete", &gone.shape, i), guides);
        desk.studio.seal();
        true
    }
}

/// The place on a curve of so many points that the nth of them is, or hangs on.
fn knot_of(i: usize, points: usize) -> usize {
    match i % 3 {
        1 => i - 1,
        2 => (i + 1) % points,
        _ => i,
    }
}

fn handle_name(kind: HandleKind) -> &'static str {
    match kind {
        HandleKind::Center => "move",
        HandleKind::Rotation => "turn; Ctrl by 15\u{b0}",
        HandleKind::Scale => "scale",
        HandleKind::Width => "width; Shift keeps the shape",
        HandleKind::Height => "height; Shift keeps the shape",
        HandleKind::Corner => "corner",
        HandleKind::Pitch => "pitch",
        HandleKind::Point(_) => "point",
        HandleKind::Falloff => "falloff",
    }
}

/// An empty layer of guides. Where what lies below is round it lays widths of its own, or no direction would show; else it
/// leaves alone what is away from its guides.
pub(crate) fn layer(desk: &Desk) -> Layer {
    let mut guides = Guides::default();
    if is_round(desk.studio.map()) {
        lay_widths(&mut guides, true);
    } else {
        guides.only_near = true;
    }
    Layer {
        name: "guides".to_owned(),
        ..Layer::new(Source::Guides(guides))
    }
}

/// Whether most of a map shows no direction, whatever that is.
fn is_round(map: &AnisoMap) -> bool {
    let step = (map.alpha_x().len() / 2048).max(1);
    let pairs = map.alpha_x().iter().zip(map.alpha_y()).step_by(step);
    let (mut round, mut all) = (0, 0);
    for (x, y) in pairs {
        all += 1;
        round += usize::from(x.max(*y) < ROUND * x.min(*y));
    }
    2 * round > all
}

fn lay_widths(guides: &mut Guides, on: bool) {
    let (along, across) = guides.widths();
    guides.alpha_along = on.then_some(along);
    guides.alpha_across = on.then_some(across);
}
