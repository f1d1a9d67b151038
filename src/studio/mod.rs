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

mod canvas;
mod document;
mod edit;
mod history;
mod journal;
mod keeper;
mod layers;
mod locate;
mod making;
mod memory;
mod paths;
mod pen;
mod pick;
mod ready;
mod saving;
mod stepping;
pub mod view;
mod viewport;
mod welcome;

pub use document::Document;
pub use edit::{Edit, Header, LayerHead, Touched};
pub use history::{History, Step};
pub use journal::{Base, Journal, LeftBehind, left_behind};
pub use layers::free_name;
pub use memory::{
    bytes_free, bytes_needed, document_warning, memory_warning, mesh_warning, picture_warning,
    pictures_bytes,
};
pub use pick::{Hit, pick};
pub use ready::CoverageOrder;
pub use saving::{Copied, CopyOrder};
pub use viewport::{Quality, Show, Viewport};
pub use welcome::welcome;

use crate::error::{Error, Result};
use crate::generate::scene;
use crate::map::{AnisoMap, DEFAULT_TEXEL, Rect, Size, Wrap};
use crate::mesh::{self, Body, Mesh};
use crate::preview::{Prepared, Scene, Timings};
use crate::progress::Progress;
use crate::recipe::{self, Recipe, RecipeFile, Stamp};
use canvas::Canvas;
use keeper::Keeper;
use making::{Job, Shown, broken_off};
use pen::CATCH_UP;
use std::borrow::Cow;
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::sync::mpsc::TryRecvError;
use std::time::Duration;

/// The mesh of a recipe that names none.
pub const DEFAULT_MESH: &str = "torus";

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
    known: Option<(String, Option<Stamp>, Arc<Body>)>,
    /// Why the mesh of the recipe is not shown.
    no_mesh: Option<Arc<Error>>,
    /// What was told of layers and a mesh that are not shown.
    told: Vec<String>,
    /// Of the map, while it is new.
    averages: Option<view::Averages>,
    scene: Scene,
    viewport: Viewport,
    timings: Arc<Timings>,
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
        let timings = Arc::new(Timings::on());
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
            no_mesh: None,
            told: Vec::new(),
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
        let stamp = self.document.files().stamp_of_mesh(word);
        self.known = Some((word.to_owned(), stamp, body));
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

    fn mesh_name(&self) -> &str {
        self.recipe().mesh.as_deref().unwrap_or(DEFAULT_MESH)
    }

    /// The subject, to be changed: waits until nobody draws it.
    fn subject_mut(&mut self) -> &mut Prepared<'static> {
        self.viewport.outdate();
        Arc::get_mut(&mut self.subject)
            .expect("only the refining thread shares it, and it has ended")
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
        let late = self.spent.saturating_sub(CATCH_UP);
        self.viewport
            .draw(&self.subject, &self.scene, moves, late, &self.timings)
    }

    /// Has the picture drawn better in the background.
    pub fn refine(&mut self) {
        if self.job.is_none() {
            self.viewport.refine(&self.subject);
        }
    }

    /// Bytes that map, caches and history hold, about.
    pub fn bytes(&self) -> usize {
        let texels = self.map().size().texels();
        // Planes, the same side by side, and a third of the levels' 24 bytes.
        texels * (16 + 16 + 8) + self.canvas.bytes() + self.history.bytes()
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

/// Does work on threads of its own. On the common ones, what the artist waits for would stand in line behind it.
pub fn apart<T: Send>(work: impl FnOnce() -> T + Send) -> T {
    match rayon::ThreadPoolBuilder::new().build() {
        Ok(pool) => pool.install(work),
        Err(_) => work(), // no thread is left: late is better than never
    }
}

#[cfg(test)]
mod tests;
