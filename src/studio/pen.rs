//! The stroke in flight, and the map that follows it tile by tile.

use super::layers::label;
use super::{DEFAULT_MESH, Edit, Header, Hit, Step, Studio, Touched, canvas, pick};
use crate::error::Result;
use crate::map::Rect;
use crate::paint::{Brush, Live, POINTS_MAX, Point, Points, Stroke, SurfacePoint};
use crate::preview::Stage;
use crate::recipe::below;
use glam::{Vec2, Vec3};
use std::sync::Arc;
use std::time::{Duration, Instant};

/// Pixels between the points of a stroke over the 3D picture.
const PIXELS_A_POINT: f32 = 4.0;
/// And as a part of the brush's radius, where that is more.
const RADII_A_POINT: f32 = 0.15;

/// How long the interface may be kept waiting while the map catches up with the canvas.
pub(super) const CATCH_UP: Duration = Duration::from_millis(16);
/// Tiles of the map that are brought up to date at once.
const TILES_AT_ONCE: usize = 4;

/// Places of a stroke at which a mask is asked.
const MASK_POINTS: usize = 64;

impl Studio {
    /// Begins a stroke in UV on the selected layer, which must hold strokes.
    ///
    /// # Errors
    /// When the layer holds no strokes or is not shown, the brush does not check, or the document is read-only.
    pub fn begin_stroke(&mut self, brush: Arc<Brush>, seed: u32) -> Result<()> {
        self.begin(brush, seed, false)
    }

    /// Begins a stroke on the mesh. The brush's lengths are in surface units, as those of a stroke in UV.
    ///
    /// # Errors
    /// As [`Studio::begin_stroke`], when the mesh cannot be painted on, or the layer's strokes lie on another one.
    pub fn begin_mesh_stroke(&mut self, brush: Arc<Brush>, seed: u32) -> Result<()> {
        self.begin(brush, seed, true)
    }

    /// Lets the stroke in flight go on to a point of UV.
    pub fn stroke_to(&mut self, point: Point) {
        self.stroke_along(&[point], &[]);
    }

    /// Lets the stroke in flight go on to points of UV, and for now to those `ahead`, in the place of what was ahead before.
    pub fn stroke_along(&mut self, points: &[Point], ahead: &[Point]) {
        if !self.keep_uv(points, ahead) {
            self.go_on(points, ahead);
        }
    }

    pub(super) fn go_on(&mut self, points: &[Point], ahead: &[Point]) {
        self.go_on_with(points, ahead, false, Live::go_on);
    }

    /// Lets the stroke in flight go on; where it takes no more points another goes on from its end.
    fn go_on_with<P>(
        &mut self,
        points: &[P],
        ahead: &[P],
        on_mesh: bool,
        push: impl Fn(&mut Live, &[P], &[P]) -> Vec<Rect>,
    ) {
        let mut rest = points;
        loop {
            let had = self.canvas.live().map_or(0, Live::len);
            let (now, later) = rest.split_at(rest.len().min(POINTS_MAX.saturating_sub(had)));
            let end = if later.is_empty() { ahead } else { &[] };
            self.push_points(|live| push(live, now, end));
            let Some((brush, seed)) = self.full_stroke() else {
                return;
            };
            if let Err(error) = self.begin(brush, seed.wrapping_add(1), on_mesh) {
                return self.trouble.push(error);
            }
            rest = &rest[now.len().saturating_sub(1)..];
        }
    }

    /// Lets the stroke in flight go on, and shows what that changes as far as the time allows, all taken together.
    fn push_points(&mut self, push: impl FnOnce(&mut Live) -> Vec<Rect>) {
        let begun = Instant::now();
        let dirty = self.canvas.go_on(push);
        canvas::add_parts(&mut self.behind, &self.canvas.parts(&dirty));
        // Many points may come in one frame, and share its time.
        if self.spent < CATCH_UP {
            let left = CATCH_UP - self.spent;
            self.catch_up(Some(left.saturating_sub(begun.elapsed())));
        }
        self.spent += begun.elapsed();
    }

    /// Ends the stroke in flight when it takes no more points; another is to go on from where it ended.
    fn full_stroke(&mut self) -> Option<(Arc<Brush>, u32)> {
        let live = self.canvas.live().filter(|live| live.is_full())?;
        let next = (live.brush().clone(), live.seed());
        match self.end_now() {
            Ok(_) => Some(next),
            Err(error) => {
                self.trouble.push(error);
                None
            }
        }
    }

    /// Lets the stroke in flight go on to a place of the mesh: its position, the surface's normal, the pen's pressure from 0
    /// to 1. See [`Studio::pick`].
    pub fn mesh_stroke_to(&mut self, position: Vec3, normal: Vec3, pressure: f32) {
        self.mesh_stroke_through(&[(position, normal, pressure)], &[]);
    }

    fn mesh_stroke_through(&mut self, points: &[SurfacePoint], ahead: &[SurfacePoint]) {
        if !self.keep_on_mesh(points, ahead) {
            self.go_on_mesh(points, ahead);
        }
    }

    pub(super) fn go_on_mesh(&mut self, points: &[SurfacePoint], ahead: &[SurfacePoint]) {
        self.go_on_with(points, ahead, true, Live::go_on_mesh);
    }

    /// What is seen at a place of the 3D picture, in pixels from its upper left corner; `None` past the mesh.
    pub fn pick(&self, place: Vec2) -> Option<Hit> {
        let (place, size) = self.viewport.in_panel(place);
        // The camera drew a picture: its numbers are allowed.
        pick(&self.body, &self.scene.camera, size, place).ok()?
    }

    /// Lets the stroke in flight on the mesh go along a straight line over the 3D picture, from where the pen was to where it
    /// is, each (pixels from the upper left corner, pressure). Where the line leaves the mesh nothing is painted.
    pub fn mesh_stroke_along(&mut self, from: (Vec2, f32), to: (Vec2, f32)) {
        self.mesh_stroke_over(from, &[to], &[]);
    }

    /// The same from a place over others, and for now over those `ahead`, in the place of what was ahead before.
    pub fn mesh_stroke_over(
        &mut self,
        from: (Vec2, f32),
        places: &[(Vec2, f32)],
        ahead: &[(Vec2, f32)],
    ) {
        let points = self.met_along(from, places);
        let end = self.met_along(places.last().copied().unwrap_or(from), ahead);
        self.mesh_stroke_through(&points, &end);
    }

    /// What lines over the 3D picture meet of the mesh, without the place they begin at.
    fn met_along(&self, mut from: (Vec2, f32), places: &[(Vec2, f32)]) -> Vec<SurfacePoint> {
        let mut met = Vec::new();
        for to in places {
            let apart = self.pixels_a_point(from.0);
            let steps = (from.0.distance(to.0) / apart).ceil().max(1.0) as u32;
            for n in 1..=steps {
                let t = n as f32 / steps as f32;
                if let Some(hit) = self.pick(from.0.lerp(to.0, t)) {
                    let pressure = from.1 + (to.1 - from.1) * t;
                    met.push((hit.position, hit.normal, pressure));
                }
            }
            from = *to;
        }
        met
    }

    /// How far apart points of a stroke on the mesh are in the picture, pixels: for a large brush farther than for a small one.
    fn pixels_a_point(&self, place: Vec2) -> f32 {
        let (Some(hit), Some(skin)) = (self.pick(place), self.canvas.skin()) else {
            return PIXELS_A_POINT;
        };
        let radius = self.canvas.live().map_or(0.0, |l| l.brush().radius) * skin.scale();
        (RADII_A_POINT * radius / hit.pixel.max(f32::MIN_POSITIVE)).clamp(PIXELS_A_POINT, 32.0)
    }

    /// Ends the stroke in flight: it is a step of the history now, or as soon as its layer is ready. `false` when it painted
    /// nothing, as a groove without a direction.
    ///
    /// # Errors
    /// When the layer takes no more strokes; the stroke is then gone.
    pub fn end_stroke(&mut self) -> Result<bool> {
        match self.end_waiting() {
            Some(laid) => laid,
            None => self.end_now(),
        }
    }

    /// Whether the mask of the selected layer hides the last stroke on it: nobody sees then that it is there. Of a stroke on the
    /// mesh it is not told.
    pub fn mask_hides_last_stroke(&self) -> bool {
        let at = self.selected;
        let layer = self.recipe().layers.get(at).filter(|_| !self.on_mask);
        let last = layer.and_then(|l| l.strokes(false)?.strokes.last());
        let Some(Points::Uv(points)) = last.map(|stroke| stroke.points()) else {
            return false;
        };
        let size = self.recipe().size;
        let texel = |part: f32, all: u32| {
            let part = part.rem_euclid(1.0) * all as f32;
            (part as u32).min(all - 1)
        };
        let hides = |point: &Point| {
            let rect = Rect {
                x: texel(point.uv().x, size.width()),
                y: texel(1.0 - point.uv().y, size.height()),
                width: 1,
                height: 1,
            };
            let shows = self.canvas.stack().mask(at, rect);
            shows.is_some_and(|shows| shows[0] < 0.02)
        };
        let apart = points.len().div_ceil(MASK_POINTS);
        points.iter().step_by(apart).all(hides)
    }

    pub(super) fn end_now(&mut self) -> Result<bool> {
        self.catch_up(Some(CATCH_UP));
        let stroke = match self.canvas.end() {
            Ok(Some(stroke)) => stroke,
            Ok(None) => {
                self.cancel_live();
                return Ok(false);
            }
            Err((error, rects)) => {
                self.repaint(rects);
                return Err(below("the layer".to_owned())(error));
            }
        };
        let (layer, mask) = self.canvas.active().expect("it was painted on");
        match self.add_stroke(layer, mask, stroke) {
            Ok(_) => {
                if self.canvas.looks_over() {
                    self.work();
                } else if self.job.is_none() && self.shown.revision.is_some() {
                    self.shown.revision = Some(self.document.revision());
                }
                Ok(true)
            }
            Err(error) => {
                let rects = self.canvas.pop();
                self.repaint(rects);
                Err(error)
            }
        }
    }

    /// Puts a stroke into the document, as a step of the history.
    pub(super) fn add_stroke(
        &mut self,
        layer: usize,
        mask: bool,
        stroke: Arc<Stroke>,
    ) -> Result<Vec<Touched>> {
        let on = if mask { " on the mask" } else { "" };
        let tool = stroke.brush().tool.name().replace('_', " ");
        let name = self.recipe().layers.get(layer).map_or("", |l| l.name());
        let label = label(&format!("{tool} stroke{on}"), name);
        let mut edits = Vec::new();
        if stroke.is_on_mesh() && self.recipe().mesh.is_none() {
            // Strokes on a mesh mean nothing without its name.
            let header = Box::new(Header {
                mesh: Some(DEFAULT_MESH.to_owned()),
                ..Header::of(self.recipe())
            });
            edits.push(Edit::SetHeader { header });
        }
        edits.push(Edit::AddStroke {
            layer,
            mask,
            stroke,
        });
        let (back, touched) = self.apply_all(edits)?;
        self.history.push(Step::new(label, back, None));
        Ok(touched)
    }

    /// Whether a stroke is in flight.
    pub fn is_drawing(&self) -> bool {
        self.canvas.is_drawing() || self.is_keeping()
    }

    /// Takes the stroke in flight away.
    pub fn cancel_stroke(&mut self) {
        self.cancel_waiting();
        self.cancel_live();
    }

    fn cancel_live(&mut self) {
        let dirty = self.canvas.cancel();
        self.repaint(dirty);
    }

    /// [`Studio::coverage`] of a rectangle, with the stroke in flight. `None` for a layer that is not being painted on.
    pub fn coverage_in(&mut self, rect: Rect) -> Option<Vec<f32>> {
        let is_shown = self.canvas.active() == Some((self.selected, self.on_mask));
        let rect = rect.intersection(self.map().size().rect())?;
        is_shown.then(|| self.canvas.coverage(rect))?
    }

    /// The strokes of a layer are one more or less than the canvas shows.
    pub(super) fn follow_strokes(&mut self, layer: usize, mask: bool) {
        let found = self.recipe().layers.get(layer);
        let Some(strokes) = found.and_then(|l| l.strokes(mask)) else {
            return;
        };
        if self.canvas.active() != Some((layer, mask)) {
            self.shown.revision = None;
            return;
        }
        let (now, shown) = (strokes.strokes.len(), self.canvas.strokes());
        let last = strokes.strokes.last().cloned();
        let rects = match last {
            _ if now + 1 == shown => Some(self.canvas.pop()),
            Some(last) if now == shown + 1 => self.canvas.push(&last).ok(),
            _ => None,
        };
        let Some(rects) = rects else {
            self.shown.revision = None;
            return;
        };
        self.repaint(rects);
        // What strokes above see of it reaches farther.
        if self.canvas.looks_over() {
            self.shown.revision = None;
        }
    }

    /// Brings rectangles of the composite map up to date with the canvas: at once as far as that takes no time to speak of, the
    /// rest from [`Studio::tick`] to tick.
    fn repaint(&mut self, dirty: Vec<Rect>) {
        canvas::add_parts(&mut self.behind, &self.canvas.parts(&dirty));
        self.catch_up(Some(CATCH_UP));
    }

    /// Brings the map up to date with the canvas, as far as the time allows, and a little in any case.
    pub(super) fn catch_up(&mut self, time: Option<Duration>) {
        let begun = Instant::now();
        let mut last = Duration::ZERO;
        while !self.behind.is_empty() {
            let before = begun.elapsed();
            if time.is_some_and(|time| !last.is_zero() && before + last > time) {
                break;
            }
            let first = self.behind.keys().nth(TILES_AT_ONCE).copied();
            let later = first.map(|n| self.behind.split_off(&n)).unwrap_or_default();
            let parts: Vec<_> = std::mem::replace(&mut self.behind, later)
                .into_iter()
                .collect();
            self.averages = None;
            let regions = self.canvas.compose(&parts);
            let timings = self.timings.clone();
            timings.time(Stage::Prepare, || self.subject_mut().write_map(&regions));
            self.dirty.extend(parts.iter().map(|(_, rect)| *rect));
            last = begun.elapsed() - before;
        }
    }
}
