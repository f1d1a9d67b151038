//! The window's mind without a window: the document, its edits with undo and journal, the composite map with its caches, the 3D
//! picture, and what is worked out in the background. It knows no toolkit; the window turns events into calls of [`Studio`], and so
//! do benches and tests.
//!
//! Everything that somebody waits for (a dab, a stroke's end, undo of a stroke) is done at once, and only where it shows.
//! Everything that needs the whole map (a pattern's parameter, another size, a mesh from a file) is worked out by a thread of its
//! own from a copy of the recipe, and taken over by [`Studio::tick`] when it is there; meanwhile the old map stands.

pub mod action;
pub mod hand;
pub mod keymap;
pub mod orbit;
pub mod parameters;
pub mod settings;

pub mod beside;
mod canvas;
mod document;
mod edit;
mod history;
mod journal;
mod keeper;
mod layers;
mod locate;
mod memory;
mod paths;
mod pick;
mod ready;
pub mod view;
mod viewport;
mod welcome;

pub use document::Document;
pub use edit::{Edit, Header, LayerHead, Touched};
pub use history::{History, Step};
pub use journal::{Base, Journal, LeftBehind, left_behind};
pub use layers::free_name;
use layers::label;
pub use memory::{bytes_free, bytes_needed, memory_warning, mesh_warning};
pub use pick::{Hit, pick};
pub use ready::CoverageOrder;
pub use viewport::{Quality, Show, Viewport};
pub use welcome::welcome;

use crate::error::{Error, Result};
use crate::filter::Pyramid;
use crate::generate::scene;
use crate::map::{AnisoMap, DEFAULT_TEXEL, Rect, Size, Wrap};
use crate::mesh::{self, Body, Mesh};
use crate::paint::{Brush, Live, Point};
use crate::preview::{Prepared, Scene, Timings};
use crate::progress::Progress;
use crate::raster::Geometry;
use crate::recipe::{self, Recipe, RecipeFile, Way};
use canvas::Canvas;
use glam::{Vec2, Vec3};
use keeper::Keeper;
use std::borrow::Cow;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU32, Ordering};
use std::sync::mpsc::{Receiver, TryRecvError, channel};
use std::time::{Duration, Instant};

/// The mesh of a recipe that names none.
pub const DEFAULT_MESH: &str = "torus";

/// Pixels between the points of a stroke over the 3D picture.
const PIXELS_A_POINT: f32 = 4.0;

/// How long the interface may be kept waiting while the map catches up with the canvas.
const CATCH_UP: Duration = Duration::from_millis(16);
/// Tiles of the map that are brought up to date at once.
const TILES_AT_ONCE: usize = 4;

/// What a studio needs from its surroundings.
#[derive(Clone, Debug)]
pub struct Options {
    /// The folder of journals; `None` keeps none.
    pub journals: Option<PathBuf>,
    /// Bytes that undo may hold.
    pub undo_bytes: usize,
    /// How long the beginning of a stroke may wait until its layer is ready to be painted on. After that the stroke is kept, and
    /// painted by [`Studio::tick`] as soon as the layer is ready. Without a limit nothing that follows a stroke comes before it.
    pub patience: Duration,
}

impl Default for Options {
    fn default() -> Self {
        Self {
            journals: None,
            undo_bytes: 256 << 20,
            patience: Duration::MAX,
        }
    }
}

/// What [`Studio::tick`] found.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Tick {
    /// Rectangles of the map that changed.
    pub map: Vec<Rect>,
    /// Whether the map is another one altogether, perhaps of another size.
    pub new_map: bool,
    /// Whether the whole 3D picture is new.
    pub picture: bool,
    /// How far the work in the background is, 0 to 1; `None` when there is none.
    pub working: Option<f32>,
}

/// A document with everything that shows it.
pub struct Studio {
    options: Options,
    document: Document,
    history: History,
    keeper: Keeper,
    canvas: Canvas,
    /// Mesh, composite map and colours. Shared with nobody but the thread that refines the picture.
    subject: Arc<Prepared<'static>>,
    /// The subject's mesh.
    body: Arc<Body>,
    /// A mesh that was read already.
    known: Option<(String, Arc<Body>)>,
    /// Of the map, while it is new.
    averages: Option<view::Averages>,
    scene: Scene,
    viewport: Viewport,
    timings: Timings,
    job: Option<Job>,
    queue: ready::Queue,
    /// While a draft is shown: the stack of the whole map before, whose layers serve for the next.
    whole: Option<recipe::Prepared>,
    /// What the canvas and the subject show.
    shown: Shown,
    /// The only layer that is shown, when the user wants to see it alone.
    solo: Option<usize>,
    /// The layer that is painted on and whose properties are shown.
    selected: usize,
    /// Whether its mask is painted on.
    on_mask: bool,
    /// Where the canvas is ahead of the map that is shown.
    behind: canvas::Parts,
    /// How long points of the pen have kept the interface waiting in this frame.
    spent: Duration,
    dirty: Vec<Rect>,
    new_map: bool,
    trouble: Vec<Error>,
}

/// What was last worked out in the background.
#[derive(Clone, Debug, Default, PartialEq)]
struct Shown {
    revision: Option<u64>,
    mesh: Option<String>,
}

/// The layer that edits put in: it is the one to go on with.
fn inserted(edits: &[Edit]) -> Option<usize> {
    edits.iter().rev().find_map(|edit| match edit {
        Edit::InsertLayer { at, .. } => Some(*at),
        _ => None,
    })
}

/// Work in the background.
struct Job {
    stop: Arc<AtomicBool>,
    /// Thousandths.
    done: Arc<AtomicU32>,
    result: Receiver<Result<Made>>,
    revision: u64,
    mesh: String,
    /// Whether a draft of the map comes first, and is still to come.
    drafts: bool,
    /// Whether there were edits since: then it ends with the draft.
    outdated: bool,
}

/// What it gives.
struct Made {
    /// Whether it is smaller than it is to be, and all of it comes later.
    is_draft: bool,
    stack: recipe::Prepared,
    pyramid: Pyramid<'static>,
    averages: view::Averages,
    /// A mesh other than the one that stands.
    body: Option<Shape>,
}

/// A mesh to be looked at and to be drawn.
type Shape = (Arc<Body>, Geometry<'static>);

impl Drop for Job {
    /// Nobody wants its result: it ends when it next asks, and nobody waits for that.
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Relaxed);
    }
}

impl Studio {
    /// A studio that shows a recipe. Its map is worked out in the background: see [`Studio::tick`].
    ///
    /// # Errors
    /// When the recipe's first picture cannot be prepared. A journal that cannot be begun is told by [`Studio::take_trouble`]
    /// instead: it must not keep anybody from working.
    pub fn new(file: RecipeFile, path: Option<PathBuf>, options: Options) -> Result<Self> {
        let mut studio = Self::at_rest(Document::new(file, path), options)?;
        studio.begin_journal();
        studio.work();
        Ok(studio)
    }

    /// A studio that has neither begun a journal nor to work out its map.
    fn at_rest(document: Document, options: Options) -> Result<Self> {
        let stand_in = AnisoMap::constant(Size::new(1, 1)?, Wrap::Repeat, DEFAULT_TEXEL);
        let timings = Timings::on();
        let mesh = Arc::new(mesh::builtin(DEFAULT_MESH).expect("a built-in mesh"));
        let body = Arc::new(Body::new(Arc::clone(&mesh))?);
        let subject = Prepared::new(mesh, stand_in, document.recipe().material, &timings)?;
        let empty = Recipe {
            size: Size::new(1, 1)?,
            ..Recipe::default()
        };
        let stack = empty.prepare(empty.size, &document.files(), &Progress::none())?;
        Ok(Self {
            history: History::new(options.undo_bytes),
            keeper: Keeper::new(options.journals.clone()),
            canvas: Canvas::new(stack),
            scene: scene(subject.mesh(), Some(document.recipe())),
            subject: Arc::new(subject),
            body,
            known: None,
            averages: None,
            viewport: Viewport::new(Size::new(1, 1)?),
            timings,
            job: None,
            queue: ready::Queue::default(),
            whole: None,
            shown: Shown::default(),
            solo: None,
            selected: document.recipe().layers.len().saturating_sub(1),
            behind: canvas::Parts::new(),
            spent: Duration::ZERO,
            dirty: Vec::new(),
            new_map: false,
            trouble: Vec::new(),
            on_mask: false,
            document,
            options,
        })
    }

    /// The work of a journal that was left behind, as a document with unsaved changes; how many there are is given too. Edits
    /// that no longer apply end what is recovered: the journal is then kept until the document is saved or closed.
    ///
    /// # Errors
    /// When the document that the journal starts from cannot be read. The journal is kept.
    pub fn recover(left: LeftBehind, options: Options) -> Result<(Self, u64)> {
        let (base, edits, journal) = left.take_apart();
        let mut document = Document::from_base(&base)?;
        let mut history = History::new(options.undo_bytes);
        let mut failed = None;
        for edit in edits {
            match document.apply(edit) {
                Ok((back, _)) => history.push(Step::new("Recovered work", vec![back], None)),
                Err(error) => {
                    failed = Some(error);
                    break;
                }
            }
        }
        let recovered = document.revision();
        let mut studio = Self::at_rest(document, options)?;
        studio.history = history;
        studio.keeper.take_up(journal, failed.is_none());
        studio.trouble.extend(failed);
        studio.begin_journal();
        studio.work();
        Ok((studio, recovered))
    }

    /// The document.
    pub fn document(&self) -> &Document {
        &self.document
    }

    /// The recipe as it is now.
    pub fn recipe(&self) -> &Recipe {
        self.document.recipe()
    }

    /// What can be undone and redone.
    pub fn history(&self) -> &History {
        &self.history
    }

    /// The composite map as it is shown: that of the recipe, or while work goes on in the background an older one.
    pub fn map(&self) -> &AnisoMap {
        self.subject.map()
    }

    /// The mesh as it is shown.
    pub fn mesh(&self) -> &Mesh {
        self.subject.mesh()
    }

    /// Mesh, map and colours as they are drawn.
    pub fn subject(&self) -> &Arc<Prepared<'static>> {
        &self.subject
    }

    /// The same mesh, to be shared.
    pub fn body(&self) -> &Arc<Body> {
        &self.body
    }

    /// A mesh that was read already, by the word for it: it is not read again when it is to be shown. Where it is shown, as
    /// its file was read before, it takes the place of that.
    pub fn know_mesh(&mut self, word: &str, body: Arc<Body>) {
        self.known = Some((word.to_owned(), body));
        if self.shown.mesh.as_deref() == Some(word) {
            self.shown.mesh = None;
            self.work();
        }
    }

    /// The averages of a map that is new, once, unless it was painted on since.
    pub fn take_averages(&mut self) -> Option<view::Averages> {
        self.averages.take()
    }

    /// The 3D picture.
    pub fn viewport(&self) -> &Viewport {
        &self.viewport
    }

    /// The 3D picture, to be resized or to show something else.
    pub fn viewport_mut(&mut self) -> &mut Viewport {
        &mut self.viewport
    }

    /// How long the stages of drawing took, summed since the start.
    pub fn timings(&self) -> &Timings {
        &self.timings
    }

    /// Camera, lights, exposure: what the 3D picture is lit with.
    pub fn scene(&self) -> &Scene {
        &self.scene
    }

    /// Changes camera, lights or exposure; no matter of the document, so nothing to undo.
    pub fn set_scene(&mut self, scene: Scene) {
        self.scene = scene;
    }

    /// Looks at the mesh as at the start.
    pub fn frame_all(&mut self) {
        self.scene.camera = scene(self.subject.mesh(), Some(self.document.recipe())).camera;
    }

    /// The selected layer's place, counted from the lowest; past the end when there is none.
    pub fn selected(&self) -> usize {
        self.selected
    }

    /// Selects a layer, and no longer the mask of another one.
    pub fn select(&mut self, layer: usize) {
        if layer < self.recipe().layers.len() {
            self.on_mask &= self.selected == layer;
            self.selected = layer;
        }
    }

    /// Whether strokes go onto the mask of the selected layer, and not onto the layer.
    pub fn is_mask_selected(&self) -> bool {
        self.on_mask && self.has_painted_mask()
    }

    /// Lets strokes go onto the mask of the selected layer, which must be a painted one, or onto the layer again. On a mask every
    /// brush lays its coverage, and erasing takes it away.
    pub fn select_mask(&mut self, mask: bool) {
        self.cancel_stroke();
        self.on_mask = mask;
    }

    /// Whether the selected layer has a painted mask.
    pub fn has_painted_mask(&self) -> bool {
        let layer = self.recipe().layers.get(self.selected);
        layer.is_some_and(|l| l.strokes(true).is_some())
    }

    /// The only layer that is shown.
    pub fn solo(&self) -> Option<usize> {
        self.solo
    }

    /// Shows one layer alone, or all again. No matter of the document.
    pub fn set_solo(&mut self, layer: Option<usize>) {
        if self.solo != layer {
            self.cancel_stroke();
            self.solo = layer;
            self.work();
        }
    }

    /// The recipe as it is shown: with one layer alone where the user wants that.
    fn shown_recipe(&self) -> Cow<'_, Recipe> {
        let recipe = self.document.recipe();
        let Some(solo) = self.solo else {
            return Cow::Borrowed(recipe);
        };
        let mut recipe = recipe.clone();
        for (i, layer) in recipe.layers.iter_mut().enumerate() {
            layer.visible = i == solo;
        }
        Cow::Owned(recipe)
    }

    /// What went wrong since the last call and was not the answer to one: a full disk under the journal, a picture that could
    /// not be drawn, a file that is not there.
    pub fn take_trouble(&mut self) -> Vec<Error> {
        std::mem::take(&mut self.trouble)
    }

    /// Makes edits as one step of the history. Steps with the same `key` that follow each other, as those of a slider that is
    /// dragged, are one step until [`Studio::seal`].
    ///
    /// # Errors
    /// As [`Edit::apply`]; then nothing has changed.
    pub fn edit(&mut self, label: &str, edits: Vec<Edit>, key: Option<&str>) -> Result<()> {
        self.cancel_stroke();
        self.land();
        let (back, touched) = self.apply_all(edits)?;
        self.history
            .push(Step::new(label, back, key.map(str::to_owned)));
        self.follow(touched);
        Ok(())
    }

    /// Ends a run of steps with one key.
    pub fn seal(&mut self) {
        self.history.seal();
    }

    /// Takes the last step back; `false` when there is none.
    ///
    /// # Errors
    /// When the document is read-only.
    pub fn undo(&mut self) -> Result<bool> {
        self.cancel_stroke();
        self.land();
        let Some(step) = self.history.take_undo() else {
            return Ok(false);
        };
        let (back, touched) = self.apply_all(step.edits)?;
        self.history.push_redo(Step::new(step.label, back, None));
        self.follow(touched);
        Ok(true)
    }

    /// Takes the last step back for good: what a drag did that is called off. `false` when there is none.
    ///
    /// # Errors
    /// When the document is read-only.
    pub fn take_back(&mut self) -> Result<bool> {
        let was = self.undo()?;
        if was {
            self.history.take_redo();
        }
        Ok(was)
    }

    /// Does the last step again that was taken back; `false` when there is none.
    ///
    /// # Errors
    /// When the document is read-only.
    pub fn redo(&mut self) -> Result<bool> {
        self.cancel_stroke();
        self.land();
        let Some(step) = self.history.take_redo() else {
            return Ok(false);
        };
        let came = inserted(&step.edits);
        let (back, touched) = self.apply_all(step.edits)?;
        self.history.push_undo(Step::new(step.label, back, None));
        self.follow(touched);
        if let Some(at) = came {
            self.select(at);
        }
        Ok(true)
    }

    /// Applies edits to the document and writes them to the journal; what takes them back is given in its own order.
    fn apply_all(&mut self, edits: Vec<Edit>) -> Result<(Vec<Edit>, Vec<Touched>)> {
        let (mut back, mut touched) = (Vec::new(), Vec::new());
        let places = (self.selected, self.solo);
        for edit in edits {
            let selected = edit.place_after(self.selected);
            let solo = self.solo.and_then(|s| edit.place_after(s));
            let copy = self.keeper.is_writing().then(|| edit.clone());
            match self.document.apply(edit) {
                Ok((inverse, what)) => {
                    (self.selected, self.solo) = (selected.unwrap_or(self.selected), solo);
                    back.insert(0, inverse);
                    touched.push(what);
                    self.write_journal(copy.as_ref());
                }
                Err(error) => {
                    for edit in back {
                        let copy = edit.clone();
                        if self.document.apply(edit).is_ok() {
                            self.write_journal(Some(&copy));
                        }
                    }
                    (self.selected, self.solo) = places;
                    return Err(error);
                }
            }
        }
        Ok((back, touched))
    }

    fn write_journal(&mut self, edit: Option<&Edit>) {
        let failed = self.keeper.write(edit, &self.document);
        self.trouble.extend(failed);
    }

    fn begin_journal(&mut self) {
        let failed = self.keeper.begin(&self.document).err();
        self.trouble.extend(failed);
    }

    /// Brings what is shown up to date with edits that were just made, or has it brought.
    fn follow(&mut self, touched: Vec<Touched>) {
        let layers = self.recipe().layers.len();
        if touched.iter().any(|t| *t >= Touched::Map) {
            self.solo = self.solo.filter(|s| *s < layers);
        }
        self.selected = self.selected.min(layers.saturating_sub(1));
        self.on_mask &= self.has_painted_mask();
        for what in touched {
            match what {
                Touched::Nothing => {}
                Touched::Scene => self.follow_scene(),
                Touched::Strokes(layer, mask) => self.follow_strokes(layer, mask),
                Touched::Map => self.shown.revision = None,
                Touched::All => {
                    self.follow_scene();
                    self.shown.revision = None;
                }
            }
        }
        if self.shown.revision.is_none() {
            self.work();
        } else if self.job.is_none() {
            self.shown.revision = Some(self.document.revision());
        }
    }

    fn follow_scene(&mut self) {
        let material = self.recipe().material;
        let trouble = self.subject_mut().set_material(material).err();
        self.trouble.extend(trouble);
        let lit = scene(self.subject.mesh(), Some(self.document.recipe()));
        self.scene.lights = lit.lights;
        self.scene.exposure = lit.exposure;
        if self.shown.mesh.as_deref() != Some(self.mesh_name()) {
            self.shown.revision = None;
        }
    }

    fn mesh_name(&self) -> &str {
        self.recipe().mesh.as_deref().unwrap_or(DEFAULT_MESH)
    }

    /// The subject, to be changed: waits until nobody draws it.
    fn subject_mut(&mut self) -> &mut Prepared<'static> {
        self.viewport.stop_refining();
        Arc::get_mut(&mut self.subject)
            .expect("only the refining thread shares it, and it has ended")
    }

    /// Begins to work out the map of the recipe as it is now; what was being worked out is not wanted any more.
    fn work(&mut self) {
        self.shown.revision = None;
        if let Some(job) = self.job.as_mut().filter(|job| job.drafts) {
            // While a slider is dragged every draft is shown, of what was asked for when it was begun.
            job.outdated = true;
            return;
        }
        self.job = None; // stops it
        self.queue.stop();
        let (send, result) = channel();
        let stop = Arc::new(AtomicBool::new(false));
        let done = Arc::new(AtomicU32::new(0));
        let recipe = self.shown_recipe().into_owned();
        let files = self.document.files();
        let mesh = self.mesh_name().to_owned();
        let new_mesh = (self.shown.mesh.as_ref() != Some(&mesh)).then(|| mesh.clone());
        let before = self.whole.as_ref().unwrap_or(self.canvas.stack()).clone();
        let before = match &self.shown.mesh {
            Some(name) => before.with_mesh(name, &self.body),
            None => before,
        };
        let before = match self.known.take_if(|(word, _)| *word == mesh) {
            Some((word, body)) => before.with_mesh(&word, &body),
            None => before,
        };
        let draft = draft_size(&recipe);
        let thread = std::thread::Builder::new().name("map".to_owned()).spawn({
            let (stop, done) = (stop.clone(), done.clone());
            move || {
                let report = |now: u64, all: u64| {
                    let part = 1000.0 * now as f64 / all.max(1) as f64;
                    done.store(part as u32, Ordering::Relaxed);
                    !stop.load(Ordering::Relaxed)
                };
                let progress = Progress::new(&report);
                let mut before = before;
                let mut body = None;
                if let Some(word) = new_mesh.as_deref() {
                    match apart(|| open_mesh(word, &before, &files)) {
                        Ok((new, geometry)) => {
                            before = before.with_mesh(word, &new);
                            body = Some((new, geometry));
                        }
                        Err(error) => {
                            let _ = send.send(Err(error));
                            return;
                        }
                    }
                }
                if let Some(size) = draft {
                    let none = Progress::none(); // so small that it is shown in any case
                    let body = body.take();
                    let made = apart(|| make(&recipe, (size, true), &files, &before, body, &none));
                    let failed = made.is_err();
                    if send.send(made).is_err() || failed {
                        return;
                    }
                }
                let whole = (recipe.size, false);
                let made = apart(|| make(&recipe, whole, &files, &before, body, &progress));
                let _ = send.send(made); // nobody may be there any more
            }
        });
        match thread {
            Ok(_) => {
                self.job = Some(Job {
                    stop,
                    done,
                    result,
                    revision: self.document.revision(),
                    mesh,
                    drafts: draft.is_some(),
                    outdated: false,
                });
            }
            Err(e) => self
                .trouble
                .push(Error::machine("no thread can be started")(e)),
        }
    }

    /// Takes over what the background has finished. To be called once a frame; costs nothing when there is nothing.
    pub fn tick(&mut self) -> Tick {
        self.spent = Duration::ZERO;
        self.catch_up(Some(CATCH_UP));
        // What is made meanwhile would take the stroke in flight away: it waits until the pen is lifted.
        self.follow_making();
        let job = self.job.as_ref().filter(|_| !self.is_drawing());
        let finished = job.map(|job| match job.result.try_recv() {
            Ok(made) => Some(made),
            Err(TryRecvError::Empty) => None,
            // One that is stopped says so: this one broke.
            Err(TryRecvError::Disconnected) => Some(Err(broken_off())),
        });
        if let Some(Some(made)) = finished {
            self.take_over(made);
        }
        let picture = match self.viewport.take_better() {
            Ok(new) => new,
            Err(error) => {
                self.trouble.push(error);
                false
            }
        };
        Tick {
            map: std::mem::take(&mut self.dirty),
            new_map: std::mem::take(&mut self.new_map),
            picture,
            working: self
                .job
                .as_ref()
                .map(|job| job.done.load(Ordering::Relaxed) as f32 / 1000.0),
        }
    }

    fn take_over(&mut self, made: Result<Made>) {
        match made {
            Ok(made) if made.is_draft => self.take_draft(made),
            made => self.take_whole(made),
        }
    }

    /// Shows a draft until the whole map is there.
    fn take_draft(&mut self, made: Made) {
        let Some(mut job) = self.job.take() else {
            return;
        };
        job.drafts = false;
        let whole = self.canvas.stack().clone();
        self.whole.get_or_insert(whole);
        self.shown.mesh = Some(job.mesh.clone());
        self.show(made);
        if job.outdated {
            drop(job);
            self.work();
        } else {
            self.job = Some(job);
        }
    }

    fn take_whole(&mut self, made: Result<Made>) {
        let Some(job) = self.job.take() else { return };
        if job.revision != self.document.revision() || job.outdated {
            return self.work(); // edited meanwhile
        }
        match made {
            Ok(made) => {
                self.show(made);
                self.whole = None;
                self.shown = Shown {
                    revision: Some(job.revision),
                    mesh: Some(job.mesh.clone()),
                };
            }
            Err(Error::Cancelled) => {}
            Err(error) => {
                // The map that stands stays; the next edit tries again.
                self.shown.revision = Some(job.revision);
                self.trouble.push(error);
            }
        }
    }

    fn show(&mut self, made: Made) {
        let moved = made.body.is_some();
        self.queue.stop();
        let subject = self.subject_mut();
        subject.set_map(made.pyramid);
        if let Some((body, geometry)) = made.body {
            subject.set_mesh(geometry);
            self.body = body;
        }
        self.averages = Some(made.averages);
        self.canvas = Canvas::new(made.stack);
        if moved {
            self.scene = scene(self.subject.mesh(), Some(self.document.recipe()));
        }
        self.behind.clear();
        self.dirty.clear();
        self.new_map = true;
    }

    /// Whether [`Studio::map`] is a draft: the whole map, but of fewer texels than the recipe says, until that is there.
    pub fn is_draft(&self) -> bool {
        self.whole.is_some()
    }

    /// Whether a part of the map is not yet as the canvas has it, or of the picture as the map is: [`Studio::tick`] and
    /// [`Studio::draw`] go on with it.
    pub fn is_behind(&self) -> bool {
        !self.behind.is_empty() || self.viewport.is_behind()
    }

    /// Waits until nothing is worked on in the background, the refining of the picture left out.
    pub fn settle(&mut self) -> Tick {
        let mut all = Tick::default();
        loop {
            self.catch_up(None);
            let tick = self.tick();
            all.map.extend(tick.map);
            all.new_map |= tick.new_map;
            all.picture |= tick.picture;
            if self.job.is_none() && !self.queue.is_making() && self.behind.is_empty() {
                return all;
            }
            std::thread::sleep(Duration::from_millis(1));
        }
    }

    /// Draws the 3D picture where it changed, or all of it; gives the rectangles of pixels that are new.
    ///
    /// # Errors
    /// When the scene holds numbers that are not allowed.
    pub fn draw(&mut self, moves: bool) -> Result<Vec<Rect>> {
        let dirty = self
            .viewport
            .draw(&self.subject, &self.scene, moves, &self.timings)?;
        Ok(dirty)
    }

    /// Has the picture drawn better in the background.
    pub fn refine(&mut self) {
        if self.job.is_none() {
            self.viewport.refine(&self.subject);
        }
    }

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
        if !self.keep_uv(point) {
            self.go_on(point);
        }
    }

    fn go_on(&mut self, point: Point) {
        self.push_point(|live| live.push(point));
        if let Some((brush, seed)) = self.full_stroke() {
            let again = self.begin_stroke(brush, seed.wrapping_add(1));
            if let Err(error) = again {
                return self.trouble.push(error);
            }
            self.push_point(|live| live.push(point));
        }
    }

    /// Lets the stroke in flight go on, and shows what that changes as far as the time allows, all taken together.
    fn push_point(&mut self, push: impl FnOnce(&mut Live) -> Vec<Rect>) {
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
        if !self.keep_on_mesh(position, normal, pressure) {
            self.go_on_mesh(position, normal, pressure);
        }
    }

    fn go_on_mesh(&mut self, position: Vec3, normal: Vec3, pressure: f32) {
        self.push_point(|live| live.push_on_mesh(position, normal, pressure));
        if let Some((brush, seed)) = self.full_stroke() {
            let again = self.begin_mesh_stroke(brush, seed.wrapping_add(1));
            if let Err(error) = again {
                return self.trouble.push(error);
            }
            self.push_point(|live| live.push_on_mesh(position, normal, pressure));
        }
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
        let steps = (from.0.distance(to.0) / PIXELS_A_POINT).ceil().max(1.0) as u32;
        for n in 1..=steps {
            let t = n as f32 / steps as f32;
            if let Some(hit) = self.pick(from.0.lerp(to.0, t)) {
                let pressure = from.1 + (to.1 - from.1) * t;
                self.mesh_stroke_to(hit.position, hit.normal, pressure);
            }
        }
    }

    /// Ends the stroke in flight: it is a step of the history now, or as soon as its layer is ready. `false` when it painted
    /// nothing, as a groove without a direction.
    ///
    /// # Errors
    /// When the layer takes no more strokes; the stroke is then gone.
    pub fn end_stroke(&mut self) -> Result<bool> {
        if self.end_waiting() {
            return Ok(true);
        }
        self.end_now()
    }

    fn end_now(&mut self) -> Result<bool> {
        self.catch_up(Some(CATCH_UP));
        let Some(stroke) = self.canvas.end() else {
            self.cancel_live();
            return Ok(false);
        };
        let (layer, mask) = self.canvas.active().expect("it was painted on");
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
        match self.apply_all(edits) {
            Ok((back, _)) => {
                self.history.push(Step::new(label, back, None));
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

    /// How much of each texel of a rectangle the selected layer's strokes have touched, 0 to 1, or what its mask holds where that is
    /// selected, with the stroke in flight. `None` for a layer that is not being painted on: see [`Studio::coverage`].
    pub fn coverage_in(&mut self, rect: Rect) -> Option<Vec<f32>> {
        let is_shown = self.canvas.active() == Some((self.selected, self.on_mask));
        let rect = rect.intersection(self.map().size().rect())?;
        is_shown.then(|| self.canvas.coverage(rect))?
    }

    /// Bytes that map, caches and history hold, about.
    pub fn bytes(&self) -> usize {
        let texels = self.map().size().texels();
        // Planes, the same side by side, and a third of the levels' 24 bytes.
        texels * (16 + 16 + 8) + self.canvas.bytes() + self.history.bytes()
    }

    /// The strokes of a layer are one more or less than the canvas shows.
    fn follow_strokes(&mut self, layer: usize, mask: bool) {
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
            _ if now + 1 == shown => self.canvas.pop(),
            Some(last) if now == shown + 1 => self.canvas.push(&last),
            _ => {
                self.shown.revision = None;
                return;
            }
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
    fn catch_up(&mut self, time: Option<Duration>) {
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
            self.subject_mut().write_map(&regions);
            self.dirty.extend(parts.iter().map(|(_, rect)| *rect));
            last = begun.elapsed() - before;
        }
    }

    /// Saves to a file, which is the document's own from now on. Files that the recipe names, now or after an undo, are named
    /// by the way to them from there.
    ///
    /// # Errors
    /// As [`Document::save`]; the work is kept.
    pub fn save(&mut self, path: &Path) -> Result<()> {
        self.land();
        let from = self.document.files().folder;
        let is_shown = self.shown.mesh.as_deref() == Some(self.mesh_name());
        let name = self.recipe().name.clone();
        let edits = self.history.edits_mut();
        let of =
            |e: &mut Edit| -> Vec<String> { e.files().into_iter().map(str::to_owned).collect() };
        let named: Vec<String> = edits.flat_map(of).collect();
        self.document.save_with(path, &named)?;
        let renamed = self.document.recipe().name.clone();
        let edits = self.history.edits_mut();
        edits.for_each(|edit| edit.rename(&name, &renamed));
        let to = self.document.files().folder;
        if let Some(mut way) = Way::between(from.as_deref(), &to.unwrap_or_default())? {
            way.copied = self.document.brought().clone();
            self.history.edits_mut().for_each(|edit| edit.follow(&way));
            // The mesh that is shown may be called otherwise now.
            if is_shown {
                self.shown.mesh = Some(self.mesh_name().to_owned());
            }
            self.work();
        }
        self.keeper.end();
        self.begin_journal();
        Ok(())
    }

    /// Takes over the document's file as another program has made it, as one step of the history: work that the file does not
    /// have is one undo away. The document is then saved. `false`, and nothing done, while a stroke is in flight: try again
    /// when the pen is lifted.
    ///
    /// # Errors
    /// When the file is of a newer version, or the document is.
    pub fn reload(&mut self, file: RecipeFile) -> Result<bool> {
        if self.is_drawing() {
            return Ok(false);
        }
        if file.is_read_only() {
            let ignored = match file.ignored() {
                [] => String::new(),
                keys => format!("; not known here: {}", keys.join(", ")),
            };
            let problem = format!("another program made it a file of a newer version{ignored}");
            return Err(Error::file(file.path(), problem)
                .with_hint("Your work is as it was; save it under another name"));
        }
        if file.recipe() != self.recipe() {
            let recipe = Box::new(file.recipe().clone());
            self.edit("Read again", vec![Edit::SetRecipe { recipe }], None)?;
        }
        self.document.take_file(file);
        self.begin_journal();
        Ok(true)
    }

    /// Lets undo hold about this many bytes from now on, and forgets the oldest steps where it holds more.
    pub fn set_undo_bytes(&mut self, bytes: usize) {
        self.options.undo_bytes = bytes;
        self.history.set_budget(bytes);
    }

    /// Ends without anything left to recover: for a document that was saved, or whose changes are not wanted.
    pub fn close(mut self) {
        self.keeper.end();
    }
}

/// What is said of work in the background that ended without a word.
fn broken_off() -> Error {
    let problem = "the work on it broke off by a mistake of this program";
    Error::machine("the map cannot be shown")(problem)
        .with_hint("The recipe is as it was: undo the last change, or save and start again")
}

/// Does work on threads of its own. On the common ones, what the artist waits for would stand in line behind it.
pub fn apart<T: Send>(work: impl FnOnce() -> T + Send) -> T {
    match rayon::ThreadPoolBuilder::new().build() {
        Ok(pool) => pool.install(work),
        Err(_) => work(), // no thread is left: late is better than never
    }
}

/// Texels of a map from which on a draft comes first, and of the draft at most.
const DRAFT: [usize; 2] = [1 << 20, 1 << 18];
/// Strokes that a draft is not worth laying anew for.
const DRAFT_STROKES: usize = 5000;

/// The size of a draft of a recipe's map; `None` where none is needed, or where it would take long itself.
fn draft_size(recipe: &Recipe) -> Option<Size> {
    let layers = || recipe.layers.iter().filter(|l| l.visible);
    let strokes = layers().flat_map(|l| [l.strokes(false), l.strokes(true)].into_iter().flatten());
    let strokes: usize = strokes.map(|s| s.strokes.len()).sum();
    // A field between guides takes its time to solve: a drag shows drafts of smaller maps too.
    let guided =
        layers().any(|l| matches!(&l.source, recipe::Source::Guides(g) if !g.guide.is_empty()));
    let most = if guided { DRAFT[1] } else { DRAFT[0] };
    if recipe.size.texels() <= most || strokes > DRAFT_STROKES {
        return None;
    }
    let smaller = |shift: u32| {
        let side = |n: u32| (n >> shift).max(1);
        Size::new(side(recipe.size.width()), side(recipe.size.height())).ok()
    };
    (1..16)
        .filter_map(smaller)
        .find(|size| size.texels() <= DRAFT[1])
}

/// The map of a recipe, with what is kept of the stack before where layers are the same.
fn make(
    recipe: &Recipe,
    (size, is_draft): (Size, bool),
    files: &recipe::Files,
    before: &recipe::Prepared,
    body: Option<Shape>,
    progress: &Progress<'_>,
) -> Result<Made> {
    let stack = recipe.prepare_after(before, size, files, progress)?;
    let map = stack.map(progress)?;
    progress.check()?;
    Ok(Made {
        is_draft,
        stack,
        averages: view::Averages::new(&map),
        pyramid: Pyramid::new(map),
        body,
    })
}

/// The mesh that a recipe names, or the one that is known by that name.
fn open_mesh(word: &str, known: &recipe::Prepared, files: &recipe::Files) -> Result<Shape> {
    let body = match known.mesh(word) {
        Some(body) => Arc::clone(body),
        None => Arc::new(Body::new(Arc::new(files.mesh("mesh", word)?))?),
    };
    let geometry = Geometry::new(Arc::clone(body.mesh()))?;
    Ok((body, geometry))
}

#[cfg(test)]
mod tests;
