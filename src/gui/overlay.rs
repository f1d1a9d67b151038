//! What lies over the canvas: lines along the grooves, a layer's coverage, what is wrong with the map, and the legend of the colours.

use super::canvas::Kind;
use super::desk::Desk;
use super::pane::put;
use super::widgets::overlay_text;
use super::work::{Now, Work};
use anisomap::Error;
use anisomap::map::{Rect as Texels, Size};
use anisomap::progress::Progress;
use anisomap::studio::apart;
use anisomap::studio::view::{
    AlphaRange, Camera2d, Coverage, Legend, LegendShape, LintMarks, MarkedPole, MarkedSeam, Needle,
    RatioRange, View, seam_colour,
};
use eframe::egui::{
    Align2, Color32, ColorImage, CornerRadius, FontId, Painter, Pos2, Rect, Shape, Stroke,
    TextureHandle, TextureOptions, Ui, pos2, vec2,
};
use glam::DVec2;
use std::collections::BTreeMap;
use std::time::{Duration, Instant};

/// The colour of a layer's coverage.
const COVERAGE: [u8; 3] = [0xe2, 0x57, 0x8f];
/// How opaque it is where the layer covers all.
const COVERED: f32 = 0.62;
/// How long a frame works the coverage out anew where the map changed.
const FOLLOW: Duration = Duration::from_millis(8);
/// A mask in grey: what it shows is white.
const SHOWN: [u8; 3] = [255; 3];
/// Size of a legend's strip and wheel, points.
const STRIP: (u32, u32) = (220, 12);
const WHEEL: (u32, u32) = (120, 60);

/// What colours stand for which numbers.
#[derive(Clone, Copy, Default)]
pub(crate) struct Ranges {
    pub(crate) alpha: AlphaRange,
    pub(crate) ratio: RatioRange,
}

/// What a legend is of.
#[derive(Clone, Copy, PartialEq)]
pub(crate) enum Colours {
    View(View),
    /// How much of a layer is seen.
    Coverage,
    /// What a painted mask holds.
    Mask,
}

impl Colours {
    /// Its legend as a picture of a strip or a wheel on a screen of so many pixels a point.
    fn legend(self, scale: f32) -> Option<Legend> {
        let (w, h) = match self {
            Self::View(View::Direction) => WHEEL,
            _ => STRIP,
        };
        let side = |n: u32| (n as f32 * scale).round() as u32;
        let size = Size::new(side(w), side(h)).ok()?;
        match self {
            Self::View(view) => view.legend(size),
            Self::Coverage => Some(Coverage::legend("Coverage", COVERAGE, COVERED, size)),
            Self::Mask => Some(Coverage::legend("Mask", SHOWN, 1.0, size)),
        }
    }
}

/// The picture of a legend, kept as long as the view stays.
#[derive(Default)]
pub(crate) struct LegendPicture {
    shown: Option<(Colours, u32)>,
    legend: Option<Legend>,
    texture: Option<TextureHandle>,
}

impl LegendPicture {
    /// Draws it with its lower left corner at a place.
    pub(crate) fn show(&mut self, ui: &Ui, painter: &Painter, corner: Pos2, colours: Colours) {
        let scale = ui.pixels_per_point();
        let key = (colours, (scale * 100.0) as u32);
        if self.shown != Some(key) {
            self.make(ui, colours, scale);
            self.shown = Some(key);
        }
        if let (Some(legend), Some(texture)) = (&self.legend, &self.texture) {
            paint_legend(painter, corner, legend, texture, scale);
        }
    }

    fn make(&mut self, ui: &Ui, colours: Colours, scale: f32) {
        self.legend = colours.legend(scale);
        self.texture = self.legend.as_ref().map(|legend| {
            let sides = [legend.size.width() as usize, legend.size.height() as usize];
            let image = ColorImage::from_rgba_premultiplied(sides, &legend.rgba);
            ui.ctx()
                .load_texture("legend", image, TextureOptions::LINEAR)
        });
    }
}

fn paint_legend(
    painter: &Painter,
    corner: Pos2,
    legend: &Legend,
    texture: &TextureHandle,
    scale: f32,
) {
    let size = vec2(legend.size.width() as f32, legend.size.height() as f32) / scale;
    let wheel = legend.shape == LegendShape::HalfWheel;
    let margin = if wheel {
        vec2(30.0, 20.0)
    } else {
        vec2(14.0, 8.0)
    };
    let below = if wheel { 8.0 } else { 20.0 };
    let ground = Rect::from_min_max(
        corner - vec2(0.0, size.y + margin.y + below + 16.0),
        corner + vec2(size.x + 2.0 * margin.x, 0.0),
    );
    painter.rect_filled(
        ground,
        CornerRadius::same(5),
        Color32::from_rgba_unmultiplied(12, 13, 15, 200),
    );
    let ink = Color32::from_rgb(0xe8, 0xe9, 0xea);
    let font = FontId::proportional(11.0);
    painter.text(
        ground.left_top() + vec2(10.0, 5.0),
        Align2::LEFT_TOP,
        legend.title,
        font.clone(),
        ink,
    );
    let at = Rect::from_min_size(
        pos2(ground.left() + margin.x, ground.bottom() - below - size.y),
        size,
    );
    let uv = Rect::from_min_max(pos2(0.0, 0.0), pos2(1.0, 1.0));
    painter.image(texture.id(), at, uv, Color32::WHITE);
    for tick in &legend.ticks {
        let place = at.min + vec2(tick.at.x, tick.at.y) / scale;
        if wheel {
            let out = (place - at.center_bottom()).normalized();
            painter.text(
                place + out * 12.0,
                Align2::CENTER_CENTER,
                &tick.label,
                font.clone(),
                ink,
            );
        } else {
            let long = if tick.label.is_empty() { 2.0 } else { 4.0 };
            painter.line_segment([place, place + vec2(0.0, long)], Stroke::new(1.0, ink));
            painter.text(
                place + vec2(0.0, 5.0),
                Align2::CENTER_TOP,
                &tick.label,
                font.clone(),
                ink,
            );
        }
    }
}

/// Lines along the grooves, readable on light and dark ground.
pub(crate) fn needle_shapes(painter: &Painter, rect: Rect, scale: f32, needles: &[Needle]) {
    let place = |p: glam::Vec2| rect.min + vec2(p.x, p.y) / scale;
    let line =
        |needle: &Needle, stroke: Stroke| Shape::line_segment(needle.ends.map(place), stroke);
    painter.extend(
        needles
            .iter()
            .map(|n| line(n, Stroke::new(3.0, Color32::from_black_alpha(110)))),
    );
    painter.extend(needles.iter().map(|n| {
        let strength = (130.0 + 125.0 * n.anisotropy) as u8;
        line(
            n,
            Stroke::new(
                1.8,
                Color32::from_rgba_unmultiplied(0xff, 0xdf, 0xa6, strength),
            ),
        )
    }));
}

/// What is drawn over the lit map.
#[derive(Default)]
pub(crate) struct Overlay {
    texture: Option<TextureHandle>,
    pixels: Vec<u8>,
    /// What the texture shows.
    drawn: Option<(Kind, Camera2d)>,
    coverage: Option<Coverage>,
    /// The layer that the coverage is of, and whether of its mask.
    covers: Option<(usize, bool)>,
    covering: Option<Work<Result<Coverage, Error>>>,
    /// Whether it has to be looked at anew.
    is_uncovered: bool,
    /// Where alone it has to.
    behind: Vec<Texels>,
    marks: Option<LintMarks>,
    work: Option<Work<Result<LintMarks, Error>>>,
    stale: bool,
}

impl Overlay {
    /// The coverage as it is shown; `None` while some of it is still to be worked out.
    #[cfg(test)]
    pub(crate) fn whole_coverage(&self) -> Option<&Coverage> {
        let is_whole = self.behind.is_empty() && !self.is_uncovered && self.covering.is_none();
        self.coverage.as_ref().filter(|_| is_whole)
    }

    /// Nothing is shown; what was found is kept while the map stays.
    pub(crate) fn rest(&mut self, map_changed: bool) {
        if map_changed {
            self.marks = None;
            self.is_uncovered = true;
            self.work = None;
        }
        self.drawn = None;
    }

    pub(crate) fn show_coverage(
        &mut self,
        ui: &Ui,
        painter: &Painter,
        rect: Rect,
        desk: &mut Desk,
        camera: Camera2d,
    ) {
        let layer = (desk.studio.selected(), desk.studio.is_mask_selected());
        self.is_uncovered |= desk.news.new_map || self.covers != Some(layer);
        for rect in &desk.news.map {
            if !self.behind.contains(rect) {
                self.behind.push(*rect);
            }
        }
        self.follow(ui, desk);
        // What is under way of the same layer comes first: while a bar is dragged each would end the one before.
        let is_under_way = self.covering.is_some() && self.covers == Some(layer);
        if self.is_uncovered && !is_under_way && !desk.studio.is_drawing() {
            self.is_uncovered = false;
            self.cover(ui, desk, layer);
        }
        if let Some(work) = &self.covering {
            match work.now() {
                Now::Going => {}
                Now::Came(found) => {
                    self.covering = None;
                    self.coverage = desk.told(found);
                    self.drawn = None;
                    if self.is_uncovered {
                        ui.ctx().request_repaint(); // what came is old already
                    }
                }
                Now::Over => self.covering = None,
            }
        }
        // A map of another size comes with a coverage of its own.
        let map = desk.studio.map().size();
        self.coverage = self.coverage.take().filter(|c| c.size() == map);
        let Some(coverage) = &self.coverage else {
            return;
        };
        if self.drawn != Some((Kind::Coverage, camera)) {
            let part = camera.size.rect();
            self.pixels.resize(part.texels() * 4, 0);
            let (colour, opacity) = match layer.1 {
                true => (SHOWN, 1.0),
                false => (COVERAGE, COVERED),
            };
            let wrap = desk.studio.map().wrap();
            coverage.draw(wrap, &camera, colour, opacity, part, &mut self.pixels);
            self.upload(ui, Kind::Coverage, camera);
        }
        if layer.1 {
            let [low, high] = [DVec2::new(0.0, 1.0), DVec2::new(1.0, 0.0)]
                .map(|uv| camera.pixel_of_uv(map, uv).as_vec2() / ui.pixels_per_point())
                .map(|p| rect.min + vec2(p.x, p.y));
            let mut ground = Rect::from_min_max(low, high);
            let wrap = desk.studio.map().wrap();
            if camera.repeat && wrap.repeats_u() {
                ground = Rect::from_x_y_ranges(rect.x_range(), ground.y_range());
            }
            if camera.repeat && wrap.repeats_v() {
                ground = Rect::from_x_y_ranges(ground.x_range(), rect.y_range());
            }
            painter.rect_filled(ground, CornerRadius::ZERO, Color32::BLACK);
        }
        self.paint(painter, rect);
    }

    /// Works the coverage out anew where the map changed, the last change first: as far as that takes no time to speak of, the
    /// rest in the next frames.
    fn follow(&mut self, ui: &Ui, desk: &mut Desk) {
        let begun = Instant::now();
        while let Some(rect) = self.behind.pop() {
            // Only where it is of use: it is worked out here and now.
            let is_kept = self.coverage.is_some() && self.covering.is_none() && !self.is_uncovered;
            let values = is_kept.then(|| desk.studio.coverage_in(rect)).flatten();
            match (&mut self.coverage, values) {
                (Some(coverage), Some(values)) => {
                    coverage.change(rect, &values);
                    self.drawn = None;
                }
                _ => {
                    // Of another layer, or of what is looked at just now: all of it may be other.
                    self.is_uncovered = true;
                    self.behind.clear();
                }
            }
            if begun.elapsed() >= FOLLOW {
                break;
            }
        }
        if !self.behind.is_empty() {
            ui.ctx().request_repaint();
        }
    }

    #[expect(
        clippy::too_many_arguments,
        reason = "a frame's surroundings, each of another kind"
    )]
    pub(crate) fn show_lint(
        &mut self,
        ui: &Ui,
        painter: &Painter,
        rect: Rect,
        desk: &mut Desk,
        camera: Camera2d,
        map_changed: bool,
        busy: bool,
    ) {
        self.stale |= map_changed || (self.marks.is_none() && self.work.is_none());
        if self.stale && !busy {
            self.stale = false;
            self.look(ui, desk);
        }
        if let Some(work) = &self.work {
            match work.now() {
                Now::Going => {}
                Now::Came(found) => {
                    self.work = None;
                    self.marks = desk.told(found);
                    self.drawn = None;
                }
                Now::Over => self.work = None,
            }
        }
        let Some(marks) = &self.marks else { return };
        if self.drawn != Some((Kind::Lint, camera)) {
            let part = camera.size.rect();
            self.pixels.resize(part.texels() * 4, 0);
            marks.draw_texels(&camera, false, part, &mut self.pixels);
            self.upload(ui, Kind::Lint, camera);
        }
        self.paint(painter, rect);
        self.paint_marks(painter, rect, ui.pixels_per_point(), camera);
    }

    /// Finds what a layer covers, in the background.
    fn cover(&mut self, ui: &Ui, desk: &mut Desk, layer: (usize, bool)) {
        if self.covers != Some(layer) {
            self.coverage = None;
        }
        self.covers = Some(layer);
        self.covering = None;
        let Some(order) = desk.studio.coverage() else {
            self.coverage = None;
            return;
        };
        let size = desk.studio.map().size();
        let begun = Work::begin("coverage", ui.ctx(), move |reins, give| {
            let wanted = |_: u64, _: u64| reins.go_on();
            let progress = Progress::new(&wanted);
            let found = apart(|| order.carry_out(&progress));
            give(found.and_then(|values| Coverage::new(size, values)));
        });
        self.covering = desk.told(begun);
    }

    /// Looks the map over in the background.
    fn look(&mut self, ui: &Ui, desk: &mut Desk) {
        let (map, body) = (desk.studio.map().clone(), desk.studio.body().clone());
        let begun = Work::begin("lint", ui.ctx(), move |reins, give| {
            let wanted = |_: u64, _: u64| reins.go_on();
            let progress = Progress::new(&wanted);
            give(apart(|| {
                LintMarks::find(&map, Some(body.mesh()), &progress)
            }));
        });
        self.work = desk.told(begun);
    }

    fn upload(&mut self, ui: &Ui, kind: Kind, camera: Camera2d) {
        let part = camera.size.rect();
        let image = ColorImage::from_rgba_premultiplied(
            [part.width as usize, part.height as usize],
            &self.pixels,
        );
        put(ui, &mut self.texture, "overlay", camera.size, part, image);
        self.drawn = Some((kind, camera));
    }

    fn paint(&self, painter: &Painter, rect: Rect) {
        if let Some(texture) = &self.texture {
            let uv = Rect::from_min_max(pos2(0.0, 0.0), pos2(1.0, 1.0));
            painter.image(texture.id(), rect, uv, Color32::WHITE);
        }
    }

    fn paint_marks(&self, painter: &Painter, rect: Rect, scale: f32, camera: Camera2d) {
        let Some(marks) = &self.marks else { return };
        let place = |p: glam::Vec2| rect.min + vec2(p.x, p.y) / scale;
        let seams = marks.seams(&camera);
        for seam in &seams {
            let [r, g, b, _] = seam.colour;
            // What can hardly be seen on the mesh is hardly seen here.
            let (width, alpha) = if seam.degrees < 2.0 {
                (1.0, 120)
            } else {
                (3.0, 255)
            };
            let colour = Color32::from_rgba_unmultiplied(r, g, b, alpha);
            painter.line_segment(seam.ends.map(place), Stroke::new(width, colour));
        }
        let poles = marks.poles(&camera);
        let places = poles.iter().map(|p| place(p.at)).collect::<Vec<_>>();
        let heaps = heaps(&places);
        for heap in &heaps {
            paint_heap(painter, heap, &poles);
        }
        let middle = |seam: &MarkedSeam| place((seam.ends[0] + seam.ends[1]) / 2.0);
        let all = seams.iter().map(|s| (middle(s), s.degrees));
        for (at, degrees) in worst_apart(all.filter(|(at, _)| rect.contains(*at))) {
            let text = format!("{degrees:.0}\u{b0}");
            let anchor = if at.x > rect.center().x {
                Align2::RIGHT_CENTER
            } else {
                Align2::LEFT_CENTER
            };
            let beside = if at.x > rect.center().x { -5.0 } else { 5.0 };
            overlay_text(painter, at + vec2(beside, 0.0), anchor, &text);
        }
        let pointer = painter.ctx().input(|i| i.pointer.hover_pos());
        let under = |h: &&Heap| pointer.is_some_and(|p| h.at.distance(p) < h.radius());
        let idle = painter.ctx().dragged_id().is_none();
        if let Some(heap) = heaps.iter().find(under).filter(|_| idle) {
            let right = heap.at.x > rect.center().x;
            let (anchor, beside) = match right {
                true => (Align2::RIGHT_CENTER, -1.0),
                false => (Align2::LEFT_CENTER, 1.0),
            };
            let at = heap.at + vec2(beside * (heap.radius() + 6.0), 0.0);
            overlay_text(painter, at, anchor, &heap.text(&poles));
        }
    }

    /// Whether there are marks, to be explained.
    pub(crate) fn has_marks(&self) -> bool {
        self.marks.is_some()
    }

    /// What the colours over the lit map mean, where they stand for numbers.
    pub(crate) fn colours(&self) -> Option<Colours> {
        let (_, is_mask) = self.covers.filter(|_| self.coverage.is_some())?;
        Some(match is_mask {
            true => Colours::Mask,
            false => Colours::Coverage,
        })
    }

    /// What there is to say of the overlay.
    pub(crate) fn text(&self, kind: Kind, desk: &Desk) -> Option<String> {
        match kind {
            Kind::Coverage => Some(self.coverage_text(desk)),
            Kind::Lint => Some(match (&self.marks, &self.work) {
                (_, Some(_)) => "Looking the map over\u{2026}".to_owned(),
                (Some(marks), None) => summary(marks),
                (None, None) => return None,
            }),
            Kind::Lit => Some("Lit from where the ball's sun stands".to_owned()),
            Kind::Grain => Some("Streaks run along the grooves".to_owned()),
            Kind::Strokes => Some(
                "Lines lie along the grooves: the longer, the more the widths differ".to_owned(),
            ),
            _ => None,
        }
    }
}

impl Overlay {
    /// What the coverage is of, or why there is none.
    fn coverage_text(&self, desk: &Desk) -> String {
        let studio = &desk.studio;
        let at = studio.selected();
        let Some(layer) = studio.recipe().layers.get(at) else {
            return "There is no layer to be covered.".to_owned();
        };
        let name = layer.name();
        if self.coverage.is_none() {
            return match (self.covering.is_some(), studio.is_seen(at)) {
                (true, _) => format!("Looking at {name}\u{2026}"),
                (false, false) => format!("{name} is not shown: it covers nothing"),
                (false, true) => format!("What {name} covers cannot be told"),
            };
        }
        match (self.covers, layer.mask.as_ref()) {
            (Some((_, true)), Some(mask)) if mask.invert => {
                format!("Mask of {name}, inverted: black shows it, white hides it")
            }
            (Some((_, true)), _) => format!("Mask of {name}: white shows it, black hides it"),
            _ => {
                let opacity = format!("its opacity of {:.0}%", 100.0 * layer.opacity);
                match (layer.mask.is_some(), layer.opacity < 1.0) {
                    (false, false) => format!("What {name} covers"),
                    (true, false) => format!("What {name} covers, times its mask"),
                    (false, true) => format!("What {name} covers, times {opacity}"),
                    (true, true) => format!("What {name} covers, times its mask and {opacity}"),
                }
            }
        }
    }
}

/// Points between two seams whose jumps are written beside them.
const APART: f32 = 90.0;
/// Jumps that are written, degrees.
const TOLD: f32 = 2.0;

/// The largest jump of each neighbourhood.
fn worst_apart(seams: impl Iterator<Item = (Pos2, f32)>) -> Vec<(Pos2, f32)> {
    let mut all: Vec<_> = seams.filter(|(_, degrees)| *degrees > TOLD).collect();
    all.sort_by(|a, b| b.1.total_cmp(&a.1));
    let mut told: Vec<(Pos2, f32)> = Vec::new();
    for (at, degrees) in all {
        if told.len() == 24 {
            break;
        }
        if told.iter().all(|(other, _)| other.distance(at) >= APART) {
            told.push((at, degrees));
        }
    }
    told
}

/// What lines and badges of the lint view mean, above a place.
pub(crate) fn lint_legend(painter: &Painter, corner: Pos2) {
    const ROWS: [&str; 5] = [
        "the direction jumps at a seam: 1\u{b0} yellow to 30\u{b0} red",
        "directions turn once, or half, with the way around",
        "directions turn against the way around",
        "several points in one place, and the sum of their indices",
        "texels out of some format's range",
    ];
    let font = FontId::proportional(11.0);
    let ink = Color32::from_rgb(0xe8, 0xe9, 0xea);
    let wide = painter.clip_rect().right() - corner.x - 12.0;
    let galleys = ROWS.map(|row| painter.layout(row.to_owned(), font.clone(), ink, wide - 60.0));
    let high: f32 = galleys.iter().map(|g| g.size().y.max(28.0) + 3.0).sum();
    let across = galleys.iter().map(|g| g.size().x).fold(0.0, f32::max) + 60.0;
    let ground = Rect::from_min_size(corner - vec2(0.0, high + 10.0), vec2(across, high + 10.0));
    if ground.top() < painter.clip_rect().top() + 60.0 {
        return; // it would hide what it explains
    }
    let dark = Color32::from_rgba_unmultiplied(12, 13, 15, 200);
    painter.rect_filled(ground, CornerRadius::same(5), dark);
    let mut top = ground.top() + 5.0;
    for (n, galley) in galleys.into_iter().enumerate() {
        let row = galley.size().y.max(28.0);
        let at = pos2(ground.left() + 24.0, top + 0.5 * row);
        match n {
            0 => {
                for i in 0..32 {
                    let [r, g, b, _] = seam_colour(30.0f32.powf(i as f32 / 31.0));
                    let part = Rect::from_min_size(
                        pos2(at.x - 16.0 + i as f32, at.y - 1.5),
                        vec2(1.0, 3.0),
                    );
                    painter.rect_filled(part, CornerRadius::ZERO, Color32::from_rgb(r, g, b));
                }
            }
            1 => badge(painter, at, POLE, 1, 1),
            2 => badge(painter, at, POLE, 1, -1),
            3 => badge(painter, at, POLE, 2, 0),
            _ => {
                let square = Rect::from_center_size(at, vec2(12.0, 12.0));
                painter.rect_filled(square, CornerRadius::ZERO, Color32::from_rgb(255, 96, 32));
            }
        }
        let place = pos2(ground.left() + 50.0, top + 0.5 * (row - galley.size().y));
        painter.galley(place, galley, ink);
        top += row + 3.0;
    }
}

/// Poles that lie so near each other that their marks would: where they are in the middle, and which they are.
struct Heap {
    at: Pos2,
    poles: Vec<usize>,
}

/// Colours of the marks of poles: of positive ones, of negative ones, of several that cancel.
const POSITIVE: Color32 = Color32::from_rgb(0xff, 0xc8, 0x5a);
const NEGATIVE: Color32 = Color32::from_rgb(0x6a, 0xc4, 0xff);
const BOTH: Color32 = Color32::from_rgb(0xe8, 0xe9, 0xea);
/// Radius of the mark of a pole, points.
const POLE: f32 = 11.0;

impl Heap {
    fn radius(&self) -> f32 {
        POLE + 1.6 * (self.poles.len() as f32).ln()
    }

    /// Twice the sum of the indices.
    fn halves(&self, poles: &[MarkedPole]) -> i32 {
        self.poles.iter().map(|i| poles[*i].halves).sum()
    }

    /// What it is made of.
    fn text(&self, poles: &[MarkedPole]) -> String {
        let sum = index_text(self.halves(poles));
        match self.poles.len() {
            1 => format!("A singular point of index {sum}"),
            n => format!("{n} singular points, whose indices add up to {sum}"),
        }
    }
}

/// An index from twice the number, short enough for its mark: `+1`, `-\u{bd}`, `0`.
fn index_text(halves: i32) -> String {
    let sign = match halves.signum() {
        1 => "+",
        -1 => "-",
        _ => "",
    };
    let whole = match halves.unsigned_abs() / 2 {
        0 if halves != 0 => String::new(),
        n => n.to_string(),
    };
    let half = if halves % 2 == 0 { "" } else { "\u{bd}" };
    format!("{sign}{whole}{half}")
}

/// Brings places together until no two marks lie over each other.
fn heaps(places: &[Pos2]) -> Vec<Heap> {
    // By cells first: there may be thousands.
    let cell = 2.0 * POLE;
    let mut cells: BTreeMap<(i32, i32), Vec<usize>> = BTreeMap::new();
    for (i, at) in places.iter().enumerate() {
        let key = ((at.x / cell).floor() as i32, (at.y / cell).floor() as i32);
        cells.entry(key).or_default().push(i);
    }
    let middle = |poles: &[usize]| {
        let sum = poles.iter().map(|i| places[*i].to_vec2());
        (sum.fold(vec2(0.0, 0.0), |a, b| a + b) / poles.len() as f32).to_pos2()
    };
    let mut heaps: Vec<Heap> = Vec::new();
    let mut waiting: Vec<Vec<usize>> = cells.into_values().collect();
    while let Some(mut poles) = waiting.pop() {
        let here = Heap {
            at: middle(&poles),
            poles: Vec::new(),
        };
        let reach = POLE + 1.6 * (poles.len() as f32).ln();
        let near = |h: &Heap| h.at.distance(here.at) < h.radius() + reach;
        match heaps.iter().position(near) {
            Some(i) => {
                poles.extend(heaps.swap_remove(i).poles);
                waiting.push(poles);
            }
            None => heaps.push(Heap { poles, ..here }),
        }
    }
    heaps
}

fn paint_heap(painter: &Painter, heap: &Heap, poles: &[MarkedPole]) {
    let count = heap.poles.len();
    badge(painter, heap.at, heap.radius(), count, heap.halves(poles));
}

/// The mark of so many poles whose indices add up to half of `halves`: a second ring where there are several.
fn badge(painter: &Painter, at: Pos2, radius: f32, count: usize, halves: i32) {
    let colour = match halves.signum() {
        1 => POSITIVE,
        -1 => NEGATIVE,
        _ => BOTH,
    };
    painter.circle_filled(at, radius, Color32::from_black_alpha(215));
    painter.circle_stroke(at, radius, Stroke::new(1.5, colour));
    if count > 1 {
        painter.circle_stroke(at, radius + 2.5, Stroke::new(1.0, colour));
    }
    let font = FontId::proportional(11.0);
    painter.text(at, Align2::CENTER_CENTER, index_text(halves), font, colour);
}

fn summary(lint: &LintMarks) -> String {
    let marks = lint.marks();
    let poles = match marks.rough {
        Some(loops) => format!("a rough field: {loops} turning points"),
        None => super::messages::count(marks.poles.len(), "singular point"),
    };
    let worst = marks.seams.iter().map(|s| s.degrees).fold(0.0, f32::max);
    let seams = match (marks.seams.is_empty(), lint.unmarked().is_empty()) {
        (true, true) => "no seam jumps".to_owned(),
        (true, false) => "no seam jumps on the mesh".to_owned(),
        (false, _) => format!("seams jump by up to {worst:.1}\u{b0}"),
    };
    let texels = if marks.texels.is_empty() {
        "no texel out of range"
    } else {
        "marked texels are out of some format's range"
    };
    let mut text = format!("{poles}; {seams}; {texels}");
    for unmarked in lint.unmarked() {
        text += &format!("; where the mesh does not show it, {unmarked}");
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_heap_tells_the_sum_of_its_indices() {
        let texts = [0, 1, -1, 2, 3, -4, -5].map(index_text);
        assert_eq!(
            texts,
            [
                "0", "+\u{bd}", "-\u{bd}", "+1", "+1\u{bd}", "-2", "-2\u{bd}"
            ]
        );
        let pole = |halves: i32| MarkedPole {
            at: glam::Vec2::ZERO,
            halves,
            label: String::new(),
        };
        let poles = [pole(2), pole(-1), pole(-1), pole(2)];
        let heap = |poles: &[usize]| Heap {
            at: Pos2::ZERO,
            poles: poles.to_vec(),
        };
        assert_eq!(heap(&[0]).text(&poles), "A singular point of index +1");
        let three = heap(&[0, 1, 2]).text(&poles);
        assert_eq!(three, "3 singular points, whose indices add up to 0");
        assert_eq!(heap(&[0, 1, 2, 3]).halves(&poles), 2);
    }

    #[test]
    fn marks_that_would_pile_up_become_one_with_their_number() {
        let line = |n: i32, apart: f32| -> Vec<Pos2> {
            (0..n).map(|i| pos2(i as f32 * apart, 40.0)).collect()
        };
        let apart = heaps(&line(9, 40.0));
        assert!(apart.len() == 9 && apart.iter().all(|h| h.poles.len() == 1));
        for places in [line(400, 1.0), line(300, 9.0), line(2, 5.0)] {
            let heaps = heaps(&places);
            let all: usize = heaps.iter().map(|h| h.poles.len()).sum();
            assert_eq!(all, places.len());
            for (i, a) in heaps.iter().enumerate() {
                for b in &heaps[..i] {
                    assert!(a.at.distance(b.at) >= a.radius() + b.radius());
                }
            }
        }
    }
}
