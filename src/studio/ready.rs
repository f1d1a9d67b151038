//! The layer that is painted on, made ready by a thread of its own; strokes that begin before it is there wait for it.
//!
//! What it takes is told by the document: a layer of a hundred thousand strokes has all of them laid, a mesh of millions of
//! triangles all of them sorted. The pen does not wait: its points are kept, and painted as soon as they can be.

use super::canvas::Ready;
use super::{Studio, apart, broken_off};
use crate::error::{Error, Result};
use crate::map::Rect;
use crate::mesh::Body;
use crate::paint::{Brush, MeshPoints, POINTS_MAX, Point, Stroke, SurfacePoint};
use crate::progress::Progress;
use crate::recipe::{self, Files, Layer, Recipe, Stamp};
use rayon::prelude::*;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, channel};
use std::time::Duration;

/// Where strokes go: a layer by its place or its mask, and whether they lie on the mesh.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Ground {
    layer: usize,
    mask: bool,
    on_mesh: bool,
}

/// What is being made ready.
struct Making {
    ground: Ground,
    revision: u64,
    stop: Arc<AtomicBool>,
    result: Receiver<Result<Ready>>,
}

impl Drop for Making {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Relaxed);
    }
}

/// A stroke that waits until its layer is ready.
struct Waiting {
    ground: Ground,
    brush: Arc<Brush>,
    seed: u32,
    points: PenPoints,
}

/// Where the pen was, and the points ahead of that.
enum PenPoints {
    Uv(Vec<Point>, Vec<Point>),
    Mesh(Vec<SurfacePoint>, Vec<SurfacePoint>),
}

/// What is being made ready, and the stroke that waits for it.
#[derive(Default)]
pub(super) struct Queue {
    making: Option<Making>,
    waiting: Option<Waiting>,
}

impl Queue {
    /// What is being made ready is not wanted any more.
    pub(super) fn stop(&mut self) {
        self.making = None;
    }

    pub(super) fn is_making(&self) -> bool {
        self.making.is_some()
    }
}

/// What a thread needs to make a layer ready.
struct Order {
    recipe: Recipe,
    files: Files,
    before: recipe::Prepared,
    /// The mesh that is shown.
    shown: Option<(String, Option<Stamp>, Arc<Body>)>,
    /// What the recipe calls its own.
    mesh: String,
    ground: Ground,
    budget: usize,
}

impl Order {
    fn with_mesh(&self, stack: recipe::Prepared) -> recipe::Prepared {
        match &self.shown {
            Some((name, stamp, body)) => stack.with_mesh(name, *stamp, body),
            None => stack,
        }
    }

    fn layer(&self) -> &Layer {
        &self.recipe.layers[self.ground.layer]
    }

    /// The stack as the recipe is now; refuses a layer that is left out of it.
    fn stack(&self, progress: &Progress<'_>) -> Result<recipe::Prepared> {
        let before = self.with_mesh(self.before.clone());
        let (size, files) = (before.size(), &self.files);
        let stack = self
            .recipe
            .prepare_readable(&before, size, files, progress)?;
        let stack = self.with_mesh(stack);
        let name = self.layer().name();
        if let Some(left) = stack.left_out().iter().find(|l| l.layer == name) {
            let allowed = "a layer whose files can be read";
            return Err(not_to_paint_on(name, allowed, &left.reason));
        }
        Ok(stack)
    }

    fn carry_out(self, progress: &Progress<'_>) -> Result<Ready> {
        let mut stack = self.stack(progress)?;
        let layer = self.layer();
        let strokes = layer
            .strokes(self.ground.mask)
            .expect("looked at before it was ordered");
        let skin = if self.ground.on_mesh || strokes.need_mesh() {
            let word = strokes.mesh.as_deref().unwrap_or(&self.mesh);
            Some(stack.skin("mesh", word, &self.files)?)
        } else {
            None
        };
        let start = || layer.mask.as_ref().and_then(|m| m.start).unwrap_or(0.0);
        let mask = self.ground.mask.then(start);
        let on = (self.ground.layer, strokes, mask);
        Ready::new(stack, on, skin, self.budget, progress)
    }
}

/// Rows of a coverage that one thread takes at a time.
const BAND: u32 = 64;

/// How much of a layer is seen in each texel of a map, or what its mask holds, to be worked out where nobody waits.
pub struct CoverageOrder(Order);

impl CoverageOrder {
    /// The numbers, 0 to 1, in row order.
    ///
    /// # Errors
    /// When a file of the recipe cannot be read, and [`Error::Cancelled`] when `progress` says so.
    pub fn carry_out(self, progress: &Progress<'_>) -> Result<Vec<f32>> {
        let stack = self.0.stack(progress)?;
        let (at, is_mask) = (self.0.ground.layer, self.0.ground.mask);
        let mask = self.0.layer().mask.as_ref().filter(|_| is_mask);
        let inverted = mask.is_some_and(|m| m.invert);
        let size = stack.size();
        let mut all = vec![0.0; size.texels()];
        let bands = all.par_chunks_mut((size.width() * BAND) as usize);
        bands.enumerate().try_for_each(|(n, band)| {
            progress.check()?;
            let y = n as u32 * BAND;
            let rect = Rect {
                x: 0,
                y,
                width: size.width(),
                height: BAND.min(size.height() - y),
            };
            let found = match is_mask {
                true => stack.mask(at, rect),
                false => stack.coverage(at, rect, progress)?,
            };
            if let Some(found) = found {
                band.copy_from_slice(&found);
            }
            // The mask is shown as it was painted.
            if inverted {
                band.iter_mut().for_each(|m| *m = 1.0 - *m);
            }
            Ok(())
        })?;
        progress.check()?;
        Ok(all)
    }
}

impl Studio {
    /// How much of the selected layer is seen in each texel of the map, 0 to 1: what its source covers, times its mask, times its
    /// opacity, as [`recipe::Prepared::coverage`]; or what its painted mask holds where that is selected. Without the stroke in
    /// flight. `None` for a layer that is not shown: see [`Studio::is_seen`].
    pub fn coverage(&self) -> Option<CoverageOrder> {
        let ground = Ground {
            mask: self.is_mask_selected(),
            ..self.ground(false)
        };
        self.is_seen(ground.layer)
            .then(|| CoverageOrder(self.order(ground)))
    }

    /// Whether a layer is shown: not hidden, by itself or by another one that is shown alone, not see-through, and with all files
    /// that it needs.
    pub fn is_seen(&self, layer: usize) -> bool {
        let Some(found) = self.recipe().layers.get(layer) else {
            return false;
        };
        let is_alone = self.solo.is_none_or(|solo| solo == layer);
        let is_visible = found.visible || self.solo.is_some();
        is_alone && is_visible && found.opacity > 0.0 && self.left_out(found.name()).is_none()
    }

    /// A stroke may come soon, on the mesh or in UV: what it will need is made ready in the background. To be called while a pen
    /// is over a picture; costs nothing when all is ready.
    pub fn expect_stroke(&mut self, on_mesh: bool) {
        let ground = self.ground(on_mesh);
        let idle = self.job.is_none() && !self.is_drawing() && self.queue.making.is_none();
        if idle && !self.is_ready(ground) && self.refusal(ground).is_none() {
            self.make_ready(ground);
        }
    }

    /// Whether a layer is being made ready to be painted on, and strokes may wait for it.
    pub fn is_making_ready(&self) -> bool {
        self.queue.is_making()
    }

    fn ground(&self, on_mesh: bool) -> Ground {
        Ground {
            layer: self.selected,
            mask: self.on_mask,
            on_mesh,
        }
    }

    fn is_ready(&self, ground: Ground) -> bool {
        self.canvas.active() == Some((ground.layer, ground.mask))
            && (!ground.on_mesh || self.canvas.skin().is_some())
    }

    /// Begins a stroke, at once or as soon as its layer is ready.
    pub(super) fn begin(&mut self, brush: Arc<Brush>, seed: u32, on_mesh: bool) -> Result<()> {
        self.cancel_stroke();
        brush.check()?;
        let ground = self.ground(on_mesh);
        if let Some(refusal) = self.refusal(ground) {
            return Err(refusal);
        }
        if !self.is_ready(ground) {
            self.make_ready(ground);
            self.wait_for_making(self.options.patience)?;
        }
        if self.is_ready(ground) {
            return self.begin_now(brush, seed, on_mesh);
        }
        self.queue.waiting = Some(Waiting {
            ground,
            brush,
            seed,
            points: if on_mesh {
                PenPoints::Mesh(Vec::new(), Vec::new())
            } else {
                PenPoints::Uv(Vec::new(), Vec::new())
            },
        });
        Ok(())
    }

    fn begin_now(&mut self, brush: Arc<Brush>, seed: u32, on_mesh: bool) -> Result<()> {
        let skin = self.canvas.skin().filter(|_| on_mesh).cloned();
        self.canvas.begin(brush, seed, skin)
    }

    /// Keeps points of a stroke that waits, and those ahead of them; `false` where none does.
    pub(super) fn keep_uv(&mut self, points: &[Point], ahead: &[Point]) -> bool {
        let Some(open) = &mut self.queue.waiting else {
            return false;
        };
        if let PenPoints::Uv(kept, end) = &mut open.points {
            keep((kept, end), points, ahead);
        }
        true
    }

    /// The same of a stroke on the mesh.
    pub(super) fn keep_on_mesh(&mut self, points: &[SurfacePoint], ahead: &[SurfacePoint]) -> bool {
        let Some(open) = &mut self.queue.waiting else {
            return false;
        };
        if let PenPoints::Mesh(kept, end) = &mut open.points {
            keep((kept, end), points, ahead);
        }
        true
    }

    /// Ends a stroke that waits: it goes into the document at once, so that it is saved, exported and undone as any other, and
    /// the map that shows it is made in the background. `None` where none waits; else whether it painted anything.
    pub(super) fn end_waiting(&mut self) -> Option<Result<bool>> {
        let waiting = self.queue.waiting.take()?;
        Some(self.lay_down(waiting))
    }

    /// Takes a stroke away that waits.
    pub(super) fn cancel_waiting(&mut self) {
        self.queue.waiting = None;
    }

    /// Whether a stroke is in flight that waits.
    pub(super) fn is_keeping(&self) -> bool {
        self.queue.waiting.is_some()
    }

    /// Why no stroke can go there, as far as that can be told at once.
    fn refusal(&self, ground: Ground) -> Option<Error> {
        let shown = self.mesh_name();
        if ground.on_mesh && self.shown.mesh.as_deref() != Some(shown) {
            let allowed = "allowed: the one that is shown";
            let error = Error::invalid("the mesh to paint on", format!("`{shown}`"), allowed);
            return Some(error.with_hint(match self.no_mesh() {
                Some(why) => format!("It is not shown: {why}"),
                None => "It is being loaded".to_owned(),
            }));
        }
        let layer = self.recipe().layers.get(ground.layer);
        if let Some(left) = layer.and_then(|l| self.left_out(l.name())) {
            let allowed = "a layer whose files can be read";
            return Some(not_to_paint_on(&left.layer, allowed, &left.reason));
        }
        let Some(strokes) = layer.and_then(|l| l.strokes(ground.mask)) else {
            let value = layer.map_or("no layer", |l| l.name());
            let (allowed, hint) = match ground.mask {
                false => ("a layer of strokes", "Add a paint layer"),
                true => ("a layer with a painted mask", "Give it one"),
            };
            return Some(not_to_paint_on(value, allowed, hint));
        };
        let name = layer.map_or("", |l| l.name());
        if !self.is_seen(ground.layer) {
            let allowed = "a layer that is shown";
            return Some(not_to_paint_on(name, allowed, "Show it first"));
        }
        let own = strokes.mesh.as_deref().unwrap_or(shown);
        if ground.on_mesh && own != shown {
            let allowed = format!("a layer of strokes that lie on {shown}, not on {own}");
            return Some(not_to_paint_on(name, &allowed, "Add a paint layer"));
        }
        None
    }

    fn order(&self, ground: Ground) -> Order {
        let shown = self.shown.mesh.as_ref();
        Order {
            recipe: self.shown_recipe().into_owned(),
            files: self.document.files(),
            // While the map of another recipe is being worked out the canvas is of the size that is shown.
            before: self.canvas.stack().clone(),
            shown: shown.map(|name| (name.clone(), self.shown.stamp, Arc::clone(&self.body))),
            mesh: self.mesh_name().to_owned(),
            ground,
            budget: self.options.undo_bytes,
        }
    }

    /// Begins to make a layer ready; what is being made for the same already goes on.
    fn make_ready(&mut self, ground: Ground) {
        let revision = self.document.revision();
        let making = self.queue.making.as_ref();
        if making.is_some_and(|m| m.ground == ground && m.revision == revision) {
            return;
        }
        self.queue.making = None;
        let order = self.order(ground);
        let stop = Arc::new(AtomicBool::new(false));
        let (send, result) = channel();
        let held = Arc::clone(&stop);
        let thread = std::thread::Builder::new().name("layer".to_owned());
        let thread = thread.spawn(move || {
            let wanted = |_: u64, _: u64| !held.load(Ordering::Relaxed);
            let progress = Progress::new(&wanted);
            let made = apart(|| order.carry_out(&progress));
            let _ = send.send(made); // nobody may be there any more
        });
        match thread {
            Ok(_) => {
                self.queue.making = Some(Making {
                    ground,
                    revision,
                    stop,
                    result,
                });
            }
            Err(e) => self
                .trouble
                .push(Error::machine("no thread can be started")(e)),
        }
    }

    /// Takes over a layer that is ready, waiting so long for it at most.
    fn wait_for_making(&mut self, patience: Duration) -> Result<()> {
        let Some(making) = &self.queue.making else {
            return Ok(());
        };
        let made = match making.result.recv_timeout(patience) {
            Err(RecvTimeoutError::Timeout) => return Ok(()),
            Err(RecvTimeoutError::Disconnected) => Err(broken_off()),
            Ok(made) => made,
        };
        let revision = making.revision;
        self.queue.making = None;
        let ready = match made {
            Err(Error::Cancelled) => return Ok(()),
            made => made?,
        };
        if revision == self.document.revision() && !self.canvas.is_drawing() {
            // What the tiles hold is dropped with the canvas: the map has to have caught up before.
            self.catch_up(None);
            self.canvas.take_over(ready);
        }
        Ok(())
    }

    /// Takes over what is ready, and paints the stroke that waited for it.
    pub(super) fn follow_making(&mut self) {
        if let Err(error) = self.wait_for_making(Duration::ZERO) {
            // The same would come of it again.
            self.trouble.push(error);
            self.cancel_waiting();
        }
        let Some(ground) = self.queue.waiting.as_ref().map(|w| w.ground) else {
            return;
        };
        if !self.is_ready(ground) {
            match self.refusal(ground) {
                None => return self.make_ready(ground),
                Some(refusal) => {
                    self.cancel_waiting();
                    return self.trouble.push(refusal);
                }
            }
        }
        let stroke = self.queue.waiting.take();
        if let Some(Err(error)) = stroke.map(|stroke| self.paint_kept(stroke)) {
            self.trouble.push(error);
        }
    }

    fn paint_kept(&mut self, stroke: Waiting) -> Result<()> {
        self.begin_now(stroke.brush, stroke.seed, stroke.ground.on_mesh)?;
        match stroke.points {
            PenPoints::Uv(points, ahead) => self.go_on(&points, &ahead),
            PenPoints::Mesh(points, ahead) => self.go_on_mesh(&points, &ahead),
        }
        Ok(())
    }

    fn lay_down(&mut self, waiting: Waiting) -> Result<bool> {
        let Waiting { ground, brush, .. } = &waiting;
        let (layer, mask) = (ground.layer, ground.mask);
        // A tool that follows the stroke has no direction at a point.
        let least = if brush.tool.follows_stroke() { 2 } else { 1 };
        let Some(stroke) = waiting.stroke(extent(&self.body))? else {
            return Ok(false);
        };
        if stroke.points().len() < least {
            return Ok(false);
        }
        let touched = self.add_stroke(layer, mask, Arc::new(stroke))?;
        self.follow(touched);
        Ok(true)
    }
}

impl Waiting {
    /// The stroke that its points make, on a mesh of that extent; `None` where there is no point.
    fn stroke(self, extent: f32) -> Result<Option<Stroke>> {
        let (brush, seed) = (self.brush, self.seed);
        match self.points {
            PenPoints::Uv(points, ahead) if points.is_empty() && ahead.is_empty() => Ok(None),
            PenPoints::Uv(points, ahead) => {
                Stroke::new(brush, seed, points.into_iter().chain(ahead)).map(Some)
            }
            PenPoints::Mesh(points, ahead) => {
                let mut on_mesh = MeshPoints::new(extent);
                for (position, normal, pressure) in points.into_iter().chain(ahead) {
                    on_mesh.push(position, normal, pressure);
                }
                if on_mesh.is_empty() {
                    return Ok(None);
                }
                Stroke::on_mesh(brush, seed, on_mesh).map(Some)
            }
        }
    }
}

/// Adds points to those that wait, as far as a stroke takes them; those ahead take the place of the ones before.
fn keep<P: Copy>((kept, end): (&mut Vec<P>, &mut Vec<P>), points: &[P], ahead: &[P]) {
    let room = POINTS_MAX.saturating_sub(kept.len());
    kept.extend(points.iter().take(room));
    *end = ahead.to_vec();
}

/// The largest coordinate of a mesh.
fn extent(body: &Body) -> f32 {
    let all = body.mesh().positions.iter();
    all.fold(0.0, |m, p| m.max(p.abs().max_element()))
}

/// Why nothing can be painted.
fn not_to_paint_on(layer: &str, allowed: &str, hint: &str) -> Error {
    let (layer, allowed) = (format!("`{layer}`"), format!("allowed: {allowed}"));
    Error::invalid("the layer to paint on", layer, allowed).with_hint(hint)
}
