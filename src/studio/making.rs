//! The map, worked out by a thread of its own from a copy of the recipe; first a draft of it where it is large.

use super::canvas::Canvas;
use super::{Studio, apart, view};
use crate::error::{Error, Result};
use crate::filter::Pyramid;
use crate::generate::scene;
use crate::map::Size;
use crate::mesh::Body;
use crate::preview::{Stage, Timings};
use crate::progress::Progress;
use crate::raster::Geometry;
use crate::recipe::{self, Files, LeftOut, Recipe, Stamp, file_of_mesh};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU32, Ordering};
use std::sync::mpsc::{Receiver, channel};

/// What was last worked out in the background.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Shown {
    pub(super) revision: Option<u64>,
    pub(super) mesh: Option<String>,
    /// That of the mesh's file when it was read.
    pub(super) stamp: Option<Stamp>,
}

/// Work in the background.
pub(super) struct Job {
    stop: Arc<AtomicBool>,
    /// Thousandths.
    pub(super) done: Arc<AtomicU32>,
    pub(super) result: Receiver<Result<Made>>,
    revision: u64,
    mesh: String,
    stamp: Option<Stamp>,
    /// Whether a draft of the map comes first, and is still to come.
    drafts: bool,
    /// Whether there were edits since: then it ends with the draft.
    outdated: bool,
}

/// What it gives.
pub(super) struct Made {
    /// Whether it is smaller than it is to be, and all of it comes later.
    is_draft: bool,
    stack: recipe::Prepared,
    pyramid: Pyramid<'static>,
    averages: view::Averages,
    /// A mesh other than the one that stands.
    body: Option<Shape>,
    /// Why the mesh of the recipe is not shown.
    no_mesh: Option<Arc<Error>>,
}

/// What a map is made of, beside the recipe.
struct Ground {
    files: Files,
    before: recipe::Prepared,
    /// A mesh that is to be shown with it.
    body: Option<Shape>,
    no_mesh: Option<Arc<Error>>,
    timings: Arc<Timings>,
}

/// A mesh to be looked at and to be drawn.
pub(super) type Shape = (Arc<Body>, Geometry<'static>);

impl Drop for Job {
    /// Nobody wants its result: it ends when it next asks, and nobody waits for that.
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Relaxed);
    }
}

impl Studio {
    /// Begins to work out the map of the recipe as it is now; what was being worked out is not wanted any more.
    pub(super) fn work(&mut self) {
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
        let stamp = files.stamp_of_mesh(&mesh);
        let stands = self.shown.mesh.as_ref() == Some(&mesh) && self.shown.stamp == stamp;
        let new_mesh = (!stands).then(|| mesh.clone());
        let before = self.whole.as_ref().unwrap_or(self.canvas.stack()).clone();
        let before = match &self.shown.mesh {
            Some(name) => before.with_mesh(name, self.shown.stamp, &self.body),
            None => before,
        };
        let before = match self.known.take_if(|(word, ..)| *word == mesh) {
            Some((word, stamp, body)) => before.with_mesh(&word, stamp, &body),
            None => before,
        };
        let draft = draft_size(&recipe);
        let thread = std::thread::Builder::new().name("map".to_owned()).spawn({
            let (stop, done) = (stop.clone(), done.clone());
            let timings = self.timings.clone();
            move || {
                let report = |now: u64, all: u64| {
                    let part = 1000.0 * now as f64 / all.max(1) as f64;
                    done.store(part as u32, Ordering::Relaxed);
                    !stop.load(Ordering::Relaxed)
                };
                let progress = Progress::new(&report);
                let mut ground = Ground {
                    files,
                    before,
                    body: None,
                    no_mesh: None,
                    timings,
                };
                if let Some(word) = new_mesh.as_deref() {
                    apart(|| ground.open_mesh(word, stamp));
                }
                if let Some(size) = draft {
                    let none = Progress::none(); // so small that it is shown in any case
                    let made = apart(|| ground.make(&recipe, (size, true), &none));
                    if let Ok(made) = &made {
                        ground.before = ground.before.with_files_of(&made.stack);
                    }
                    let failed = made.is_err();
                    if send.send(made).is_err() || failed {
                        return;
                    }
                }
                let whole = (recipe.size, false);
                let made = apart(|| ground.make(&recipe, whole, &progress));
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
                    stamp,
                    drafts: draft.is_some(),
                    outdated: false,
                });
            }
            Err(e) => self
                .trouble
                .push(Error::machine("no thread can be started")(e)),
        }
    }

    pub(super) fn take_over(&mut self, made: Result<Made>) {
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
        let whole = self.whole.take().unwrap_or(self.canvas.stack().clone());
        self.whole = Some(whole.with_files_of(&made.stack));
        self.show_mesh_of(&job, &made);
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
                self.show_mesh_of(&job, &made);
                self.show(made);
                self.whole = None;
                self.shown.revision = Some(job.revision);
            }
            Err(Error::Cancelled) => {}
            Err(error) => {
                // The map that stands stays; the next edit tries again.
                self.shown.revision = Some(job.revision);
                self.trouble.push(error);
            }
        }
    }

    /// What is shown is the mesh of that job, unless it could not be read.
    fn show_mesh_of(&mut self, job: &Job, made: &Made) {
        if made.no_mesh.is_none() {
            self.shown.mesh = Some(job.mesh.clone());
            self.shown.stamp = job.stamp;
        }
    }

    /// The layer of a name that the map is shown without, because of its files.
    pub fn left_out(&self, layer: &str) -> Option<&LeftOut> {
        let all = self.canvas.stack().left_out();
        all.iter().find(|left| left.layer == layer)
    }

    /// Why the mesh of the recipe is not the one that is shown, as a clause, once that is known.
    pub fn no_mesh(&self) -> Option<String> {
        let error = self.no_mesh.as_ref()?;
        let files = self.document.files();
        Some(match file_of_mesh(self.mesh_name()) {
            Some(file) if self.is_outside(file) => {
                format!("{file} lies outside the recipe's folder")
            }
            Some(file) if files.resolve("mesh", file).is_err() => format!("{file} is not there"),
            _ => error.to_string(),
        })
    }

    /// Whether a file that the recipe names lies where it may not name it.
    pub fn is_outside(&self, file: &str) -> bool {
        self.document.files().is_outside(file)
    }

    /// Tells of the mesh and of layers that are not shown, each when it begins. What lies outside the recipe's folder is left
    /// for the user to be asked about.
    fn tell_left_out(&mut self) {
        let mut told = Vec::new();
        for left in self
            .canvas
            .stack()
            .left_out()
            .iter()
            .filter(|l| !l.is_outside)
        {
            let what = format!("the layer `{}`", left.layer);
            told.push(
                Error::invalid(what, "not shown", left.reason.clone())
                    .with_hint("Its properties find the file again"),
            );
        }
        let file = file_of_mesh(self.mesh_name());
        if let Some(why) = self.no_mesh()
            && !file.is_some_and(|file| self.is_outside(file))
        {
            let what = format!("the mesh `{}`", self.mesh_name());
            told.push(
                Error::invalid(what, "not shown", why)
                    .with_hint("The properties of the document find the file again"),
            );
        }
        let before = std::mem::take(&mut self.told);
        for error in told {
            let text = error.to_string();
            if !before.contains(&text) {
                self.trouble.push(error);
            }
            self.told.push(text);
        }
    }

    fn show(&mut self, made: Made) {
        self.no_mesh = made.no_mesh.clone();
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
        self.tell_left_out();
    }

    /// Whether [`Studio::map`] is a draft: the whole map, but of fewer texels than the recipe says, until that is there.
    pub fn is_draft(&self) -> bool {
        self.whole.is_some()
    }
}

/// What is said of work in the background that ended without a word.
pub(super) fn broken_off() -> Error {
    let problem = "the work on it broke off by a mistake of this program";
    Error::machine("the map cannot be shown")(problem)
        .with_hint("The recipe is as it was: undo the last change, or save and start again")
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

impl Ground {
    /// The map of a recipe, with what is kept of the stack before where layers are the same, and without the layers whose files
    /// cannot be read.
    fn make(
        &mut self,
        recipe: &Recipe,
        (size, is_draft): (Size, bool),
        progress: &Progress<'_>,
    ) -> Result<Made> {
        let (before, files) = (&self.before, &self.files);
        let stack = recipe.prepare_readable(before, size, files, progress)?;
        let map = stack.map(progress)?;
        progress.check()?;
        Ok(Made {
            is_draft,
            stack,
            averages: view::Averages::new(&map),
            pyramid: (self.timings).time(Stage::Prepare, || Pyramid::new(map)),
            body: self.body.take(),
            no_mesh: self.no_mesh.clone(),
        })
    }

    /// The mesh that a recipe names, or the one that is known by that name. Where it cannot be read the one before stands.
    fn open_mesh(&mut self, word: &str, stamp: Option<Stamp>) {
        let open = || -> Result<Shape> {
            let body = match self.before.mesh(word, stamp) {
                Some(body) => Arc::clone(body),
                None => Arc::new(Body::new(Arc::new(self.files.mesh("mesh", word)?))?),
            };
            let geometry = Geometry::new(Arc::clone(body.mesh()))?;
            Ok((body, geometry))
        };
        match open() {
            Ok((body, geometry)) => {
                self.before = self.before.clone().with_mesh(word, stamp, &body);
                self.body = Some((body, geometry));
            }
            Err(error) => self.no_mesh = Some(Arc::new(error)),
        }
    }
}
