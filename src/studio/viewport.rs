//! The 3D picture: drawn at once in a hurry, then better and better while nothing happens, up to the reference.
//!
//! A hurried picture takes one sample a pixel, and a quarter of the pixels while the camera moves. When nothing asks for
//! another one, a thread of its own draws 2x2 samples a pixel, then 4x4, then the f64 reference with 8x8. Whatever is asked for
//! meanwhile stops it. Of a mesh of many triangles that thread draws the sharp picture, too, once the camera stands still: the
//! window goes on to show the hurried one.

use super::apart;
use crate::brdf::Model;
use crate::error::{Error, Result};
use crate::map::{Rect, Size};
use crate::preview::{
    Difference, Frame, Look, Measure, Picture, Prepared, REFERENCE_SAMPLES, Redrawn, Scene, Stage,
    Subject, Timings, render_reference,
};

use crate::progress::Progress;
use glam::Vec2;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU32, Ordering};
use std::sync::mpsc::{Receiver, TryRecvError, channel};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

/// What the picture shows.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Show {
    /// One look.
    One(Look),
    /// Two looks side by side.
    Pair(Look, Look),
    /// How far two looks are apart, in false colour.
    Difference(Look, Look, Measure),
}

impl Default for Show {
    fn default() -> Self {
        Self::One(Look {
            model: Model::Ward,
            mean: false,
        })
    }
}

impl Show {
    /// The looks that are drawn, from left to right.
    pub fn looks(self) -> Vec<Look> {
        match self {
            Self::One(look) => vec![look],
            Self::Pair(a, b) | Self::Difference(a, b, _) => vec![a, b],
        }
    }

    /// The size of a look's picture when the whole has `size`.
    fn panel(self, size: Size) -> Size {
        match self {
            Self::Pair(..) => {
                Size::new((size.width() / 2).max(1), size.height()).expect("half a size is one")
            }
            Self::One(_) | Self::Difference(..) => size,
        }
    }
}

/// How good the picture is by now.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Quality {
    /// Samples along a pixel's side; 0 while the camera moves, when a sample serves four pixels.
    pub samples: u32,
    /// Whether it is the reference, which nothing comes after.
    pub is_reference: bool,
    /// How far the next better picture is, 0 to 1; `None` when nobody draws one.
    pub next: Option<f32>,
}

/// Stages of refinement: samples along a pixel's side, and whether that is the reference.
const STAGES: [(u32, bool); 3] = [(2, false), (4, false), (REFERENCE_SAMPLES, true)];

/// How long pixels that show a change of the map are lit before the rest is left to the next drawing.
const RELIGHT: Duration = Duration::from_millis(12);
/// And where the stroke took more than its own time before.
const RELIGHT_LEAST: Duration = Duration::from_millis(3);

/// From so many triangles on nobody waits for a sharp picture while a hurried one of the same stands.
const MANY: usize = 1 << 20;

/// The 3D picture.
pub struct Viewport {
    /// [`MANY`], or fewer in tests.
    pub(super) many: usize,
    /// Whether the subject is another one than the picture shows.
    is_outdated: bool,
    size: Size,
    show: Show,
    frames: Vec<Frame>,
    /// 8-bit sRGB, three bytes a pixel, row order.
    pixels: Vec<u8>,
    /// What a difference picture's largest colour stands for.
    scale: Option<f32>,
    quality: Quality,
    refining: Option<Refining>,
    /// What the picture shows: when it was drawn, the scene, and how long it took.
    drawn: Option<(Scene, Duration)>,
}

struct Refining {
    thread: Option<JoinHandle<()>>,
    stop: Arc<AtomicBool>,
    /// Thousandths of the stage.
    done: Arc<AtomicU32>,
    pictures: Receiver<Result<Better>>,
}

/// A better picture.
enum Better {
    /// The sharp one, as it is drawn at once elsewhere: what changes of it from now on is drawn by parts.
    Sharp(Vec<Frame>),
    /// That of a stage.
    Stage(usize, Vec<Picture>),
}

impl Refining {
    /// Stops it, and waits until nothing of it is left.
    fn stop(mut self) {
        self.stop.store(true, Ordering::Relaxed);
        if let Some(thread) = self.thread.take() {
            let _ = thread.join(); // it was drawing what nobody wants any more
        }
    }
}

impl Viewport {
    /// A black picture.
    pub fn new(size: Size) -> Self {
        Self {
            many: MANY,
            is_outdated: false,
            size,
            show: Show::default(),
            frames: Vec::new(),
            pixels: vec![0; size.texels() * 3],
            scale: None,
            quality: Quality {
                samples: 0,
                is_reference: false,
                next: None,
            },
            refining: None,
            drawn: None,
        }
    }

    /// Size in pixels.
    pub fn size(&self) -> Size {
        self.size
    }

    /// Takes another size; the picture is black until it is drawn.
    pub fn resize(&mut self, size: Size) {
        if self.size != size {
            self.stop_refining();
            self.size = size;
            self.frames.clear();
            self.drawn = None;
            self.pixels.clear();
            self.pixels.resize(size.texels() * 3, 0);
        }
    }

    /// What is shown.
    pub fn show(&self) -> Show {
        self.show
    }

    /// Shows something else from the next drawing on.
    pub fn set_show(&mut self, show: Show) {
        if self.show != show {
            self.stop_refining();
            self.show = show;
            self.frames.clear();
            self.drawn = None;
        }
    }

    /// The picture: 8-bit sRGB, three bytes a pixel, top row first.
    pub fn pixels(&self) -> &[u8] {
        &self.pixels
    }

    /// A place of the picture as a place of the look's picture that lies there, and the size of that.
    pub(super) fn in_panel(&self, place: Vec2) -> (Vec2, Size) {
        let panel = self.show.panel(self.size);
        let width = panel.width() as f32;
        let left = if matches!(self.show, Show::Pair(..)) && place.x >= width {
            width
        } else {
            0.0
        };
        (place - Vec2::new(left, 0.0), panel)
    }

    /// In a difference picture, the difference that the last colour of the scale stands for.
    pub fn scale(&self) -> Option<f32> {
        self.scale
    }

    /// How good the picture is.
    pub fn quality(&self) -> Quality {
        Quality {
            next: self
                .refining
                .as_ref()
                .map(|r| r.done.load(Ordering::Relaxed) as f32 / 1000.0),
            ..self.quality
        }
    }

    /// How long the last drawing took that somebody waited for.
    pub fn time(&self) -> Option<Duration> {
        self.drawn.as_ref().map(|(_, time)| *time)
    }

    /// Draws what changed at once: one sample a pixel, or less while the camera `moves`. Gives the rectangles of pixels that are
    /// new. Where the map changed, so much less of it as others are `late`: the rest comes with the next drawing.
    ///
    /// # Errors
    /// When the scene holds numbers that are not allowed.
    pub fn draw(
        &mut self,
        subject: &Arc<Prepared<'static>>,
        scene: &Scene,
        moves: bool,
        late: Duration,
        timings: &Timings,
    ) -> Result<Vec<Rect>> {
        let scene = Scene {
            samples: 1,
            ..scene.clone()
        };
        if !moves && self.is_hurried(subject, &scene) {
            self.refine(subject); // or goes on with it
            return Ok(Vec::new());
        }
        self.stop_refining();
        let begun = Instant::now();
        self.is_outdated = false;
        let looks = self.show.looks();
        let panel = self.show.panel(self.size);
        self.frames.resize_with(looks.len(), || Frame::new(panel));
        let mut whole = self.drawn.is_none() || self.quality.samples != 1 || moves;
        let mut dirty = Vec::new();
        let share = looks.len() as u32;
        for (i, (frame, look)) in self.frames.iter_mut().zip(looks).enumerate() {
            let off = i as u32 * panel.width();
            if moves {
                frame.draft(subject, &scene, look, timings, &Progress::none())?;
                continue;
            }
            let limit = Some(RELIGHT.saturating_sub(late).max(RELIGHT_LEAST) / share);
            match frame.draw_within(limit, subject, &scene, look, timings, &Progress::none())? {
                Redrawn::Nothing => {}
                Redrawn::Tiles(_) => {
                    dirty.extend(frame.touched().iter().map(|r| Rect { x: r.x + off, ..*r }));
                }
                Redrawn::Light | Redrawn::Everything => whole = true,
            }
        }
        if whole || (matches!(self.show, Show::Difference(..)) && !dirty.is_empty()) {
            dirty = vec![self.size.rect()];
        }
        let pictures: Vec<&Picture> = self.frames.iter().map(Frame::picture).collect();
        self.scale = timings.time(Stage::Tone, || {
            put(&mut self.pixels, self.size, self.show, &pictures, &dirty)
        })?;
        self.quality = Quality {
            samples: u32::from(!moves),
            is_reference: false,
            next: None,
        };
        self.drawn = Some((scene, begun.elapsed()));
        Ok(dirty)
    }

    /// Whether the hurried picture of a large mesh stands that a sharp one is asked for of.
    fn is_hurried(&self, subject: &Prepared<'_>, scene: &Scene) -> bool {
        let stands = self.drawn.as_ref().is_some_and(|(drawn, _)| drawn == scene);
        stands
            && self.quality.samples == 0
            && !self.is_outdated
            && subject.mesh().triangles.len() >= self.many
    }

    /// Begins to draw better pictures in the background, unless the best stands already or somebody is at it.
    pub fn refine(&mut self, subject: &Arc<Prepared<'static>>) {
        let Some((scene, _)) = &self.drawn else {
            return;
        };
        let sharp_first = self.is_hurried(subject, scene);
        let is_rough = self.quality.samples == 0 && !sharp_first;
        if self.refining.is_some() || self.quality.is_reference || is_rough {
            return;
        }
        let first = STAGES.iter().position(|(s, _)| *s > self.quality.samples);
        let Some(first) = first else { return };
        let (send, pictures) = channel();
        let stop = Arc::new(AtomicBool::new(false));
        let done = Arc::new(AtomicU32::new(0));
        let (subject, scene, looks) = (subject.clone(), scene.clone(), self.show.looks());
        let size = self.show.panel(self.size);
        let thread = std::thread::Builder::new()
            .name("refine".to_owned())
            .spawn({
                let (stop, done) = (stop.clone(), done.clone());
                let draw = move || {
                    if sharp_first {
                        let wanted = |_: u64, _: u64| !stop.load(Ordering::Relaxed);
                        let drawn = sharp(&subject, &scene, &looks, size, &Progress::new(&wanted));
                        let failed = drawn.is_err();
                        if send.send(drawn.map(Better::Sharp)).is_err() || failed {
                            return;
                        }
                    }
                    for stage in first..STAGES.len() {
                        let report = |now: u64, all: u64| {
                            let part = 1000.0 * now as f64 / all.max(1) as f64;
                            done.store(part as u32, Ordering::Relaxed);
                            !stop.load(Ordering::Relaxed)
                        };
                        let drawn = better(
                            &subject,
                            &scene,
                            &looks,
                            size,
                            stage,
                            &Progress::new(&report),
                        );
                        let failed = drawn.is_err();
                        if send.send(drawn.map(|p| Better::Stage(stage, p))).is_err() || failed {
                            return;
                        }
                    }
                };
                move || apart(draw)
            });
        // Without a thread the picture stays as good as it is.
        if let Ok(thread) = thread {
            self.refining = Some(Refining {
                thread: Some(thread),
                stop,
                done,
                pictures,
            });
        }
    }

    /// Takes over a better picture if there is one by now: `true` when all pixels are new.
    ///
    /// # Errors
    /// When drawing it failed.
    pub fn take_better(&mut self) -> Result<bool> {
        let Some(refining) = &self.refining else {
            return Ok(false);
        };
        let (stage, pictures) = match refining.pictures.try_recv() {
            Ok(Ok(Better::Sharp(frames))) => {
                self.frames = frames;
                let pictures: Vec<&Picture> = self.frames.iter().map(Frame::picture).collect();
                let all = [self.size.rect()];
                self.scale = put(&mut self.pixels, self.size, self.show, &pictures, &all)?;
                self.quality.samples = 1;
                return Ok(true);
            }
            Ok(Ok(Better::Stage(stage, pictures))) => (stage, pictures),
            Ok(Err(Error::Cancelled)) | Err(TryRecvError::Disconnected) => {
                self.stop_refining();
                return Ok(false);
            }
            Ok(Err(error)) => {
                self.stop_refining();
                return Err(error);
            }
            Err(TryRecvError::Empty) => return Ok(false),
        };
        let (samples, is_reference) = STAGES[stage];
        let pictures: Vec<&Picture> = pictures.iter().collect();
        let all = [self.size.rect()];
        self.scale = put(&mut self.pixels, self.size, self.show, &pictures, &all)?;
        self.quality.samples = samples;
        self.quality.is_reference = is_reference;
        if is_reference {
            self.stop_refining();
        }
        Ok(true)
    }

    /// Whether pixels still show the map before its last change: the next [`Viewport::draw`] goes on with them.
    pub fn is_behind(&self) -> bool {
        self.frames.iter().any(Frame::is_behind)
    }

    /// Whether a better picture is on its way.
    pub fn is_refining(&self) -> bool {
        self.refining.is_some()
    }

    /// The subject is about to change: stops drawing in the background, and nothing holds it afterwards.
    pub(super) fn outdate(&mut self) {
        self.stop_refining();
        self.is_outdated = true;
    }

    /// Stops drawing in the background; nothing holds the subject afterwards.
    pub fn stop_refining(&mut self) {
        if let Some(refining) = self.refining.take() {
            refining.stop();
        }
    }

    /// Draws anew next time, whatever was kept.
    pub fn forget(&mut self) {
        self.stop_refining();
        self.drawn = None;
    }
}

impl Drop for Viewport {
    fn drop(&mut self) {
        self.stop_refining();
    }
}

/// The looks' pictures with a sample a pixel, each with what it takes to draw parts of it anew.
fn sharp(
    subject: &Prepared<'_>,
    scene: &Scene,
    looks: &[Look],
    size: Size,
    progress: &Progress<'_>,
) -> Result<Vec<Frame>> {
    let draw = |look: &Look| {
        let mut frame = Frame::new(size);
        frame.draw(subject, scene, *look, &Timings::off(), progress)?;
        Ok(frame)
    };
    looks.iter().map(draw).collect()
}

fn better(
    subject: &Prepared<'_>,
    scene: &Scene,
    looks: &[Look],
    size: Size,
    stage: usize,
    progress: &Progress<'_>,
) -> Result<Vec<Picture>> {
    let (samples, is_reference) = STAGES[stage];
    if is_reference {
        let subject = Subject {
            mesh: subject.mesh(),
            map: subject.map(),
            material: subject.material(),
        };
        return render_reference(subject, scene, looks, size, samples, progress);
    }
    let scene = Scene {
        samples,
        ..scene.clone()
    };
    subject.render(&scene, looks, size, &Timings::off(), progress)
}

/// Puts rectangles of the looks' pictures into the whole, and gives the scale of a difference.
fn put(
    pixels: &mut [u8],
    size: Size,
    show: Show,
    pictures: &[&Picture],
    dirty: &[Rect],
) -> Result<Option<f32>> {
    match (show, pictures) {
        (Show::Difference(_, _, measure), [a, b]) => {
            let difference = Difference::new(a, b, measure)?;
            let picture = difference.picture()?;
            picture.write_srgb8(size.rect(), pixels, (size.width(), [0, 0]));
            Ok(Some(difference.scale()))
        }
        _ => {
            let mut left = 0;
            for picture in pictures {
                let own = Rect {
                    x: left,
                    ..picture.size().rect()
                };
                for rect in dirty.iter().filter_map(|r| r.intersection(own)) {
                    let inside = Rect {
                        x: rect.x - left,
                        ..rect
                    };
                    picture.write_srgb8(inside, pixels, (size.width(), [rect.x, rect.y]));
                }
                left += picture.width();
            }
            Ok(None)
        }
    }
}
