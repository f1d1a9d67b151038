//! The least that looks the same: no map, a strip, a smaller map, fewer numbers, fewer bits, a cheaper model.
//!
//! Each kind of saving is first tried alone on the full map, the hopeless ones judged by a closed form (`predict`). What passes
//! alone is then combined, from the fewest bytes upward, and each combination is drawn in every one of the user's scenes, since
//! errors add up. The first that passes is drawn once more by the reference (f64, many samples a pixel) beside the full map's
//! reference; only if it is within the tolerance there too it is taken, or else the search goes on. The full map in floats is always
//! left, and has no error.

mod files;
mod form;
mod measure;
mod predict;
mod report;

pub use files::{REPORT, Saved, check_output};
pub use form::{Axes, Form, Shape, Widths};
pub use measure::PictureError;

use super::field::{Pole, Poles, walk};
use crate::brdf::Model;
use crate::convention::storage::{Depth, Storage, WidthEncoding};
use crate::error::{Error, Result};
use crate::map::{AnisoMap, Size};
use crate::mesh::Mesh;
use crate::preview::{Look, Scene};
use crate::progress::Progress;
use crate::recipe::Material;
use form::Kept;
use glam::Vec2;
use measure::Studio;
use predict::{Predictor, is_clear, is_hopeless};
use serde::Serialize;
use std::fmt;
use std::str::FromStr;
use std::sync::Arc;

/// What two pictures are told apart by.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Metric {
    /// LDR-FLIP, 0 to 1: what an observer sees who flips between the pictures.
    #[default]
    Flip,
    /// The colour difference CIEDE2000; about 1 can just be seen.
    De,
    /// |Y2 - Y1| / max(Y1, 0.01), Y the linear luminance before it is clipped, 1 for white: for pictures that are worked on.
    Luminance,
}

impl Metric {
    /// Every metric, in the order the help lists them.
    pub const ALL: [Self; 3] = [Self::Flip, Self::De, Self::Luminance];

    /// The word for it.
    pub fn name(self) -> &'static str {
        match self {
            Self::Flip => "flip",
            Self::De => "de",
            Self::Luminance => "luminance",
        }
    }

    /// The largest tolerance that says anything.
    fn most(self) -> f32 {
        match self {
            Self::Flip => 1.0,
            Self::De => 100.0,
            Self::Luminance => 100.0,
        }
    }
}

impl fmt::Display for Metric {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

impl FromStr for Metric {
    type Err = Error;

    fn from_str(word: &str) -> Result<Self> {
        let found = Self::ALL.into_iter().find(|m| m.name() == word);
        found.ok_or_else(|| {
            let words = Self::ALL.map(Self::name);
            let error = Error::invalid(
                "the metric",
                format!("`{word}`"),
                format!("allowed: {}", words.join(", ")),
            );
            match crate::error::nearest_word(word, words) {
                Some(near) => error.with_hint(format!("Did you mean `{near}`?")),
                None => error,
            }
        })
    }
}

/// A mesh under lights, seen from somewhere: where the reduced map must look the same.
#[derive(Clone, Debug)]
pub struct Setting {
    /// What the mesh is called in reports.
    pub mesh_name: String,
    /// What the lights are called.
    pub light_name: String,
    /// The mesh.
    pub mesh: Arc<Mesh>,
    /// Camera, lights, exposure. Its samples and quality are for the times that are told; the search has its own.
    pub scene: Scene,
}

impl Setting {
    /// Both names.
    pub fn name(&self) -> String {
        format!("{} under {}", self.mesh_name, self.light_name)
    }
}

/// The share of the tolerance that a measured error may take. Whoever draws the reduced map has fewer samples and rounds to 8 bits:
/// of 185 reductions of random recipes, one in ten was over the tolerance in such pictures while the reference was just under it,
/// by 14 % at most.
const ACCEPTED: f32 = 0.85;

/// What is asked for.
pub struct Request<'a> {
    /// The full map.
    pub map: &'a AnisoMap,
    /// The surface's width over its height for one turn of UV, over 0.
    pub aspect: f32,
    /// The colours it is seen with.
    pub material: &'a Material,
    /// What it is seen with, one at least: it must look the same with each of them.
    pub looks: &'a [Look],
    /// Where it must look the same: in each of them, and in one at least.
    pub settings: &'a [Setting],
    /// What errors are measured in.
    pub metric: Metric,
    /// The largest mean error, over 0; 99.9 % of the pixels may have three times as much.
    pub tolerance: f32,
    /// The size of the pictures.
    pub size: Size,
}

impl Request<'_> {
    /// What is measured must be under this, so that other pictures than the measured ones are under the tolerance.
    fn limit(&self) -> f32 {
        ACCEPTED * self.tolerance
    }

    /// What 99.9 % of the pixels may have: three times the tolerance, as the decimal number that it is.
    pub fn tolerance_of_p999(&self) -> f64 {
        let thrice = 3.0 * f64::from(self.tolerance);
        format!("{thrice:.5e}").parse().unwrap_or(thrice)
    }

    fn check(&self) -> Result<()> {
        let most = self.metric.most();
        if !(self.tolerance > 0.0 && self.tolerance <= most) {
            return Err(Error::invalid(
                "the tolerance",
                self.tolerance,
                format!("allowed: over 0, to {most} in {}", self.metric),
            ));
        }
        if self.looks.is_empty() {
            let allowed = "allowed: one model or more";
            return Err(Error::invalid("the models", "an empty list", allowed));
        }
        if self.settings.is_empty() {
            let allowed = "allowed: one mesh and light or more";
            return Err(Error::invalid("the scenes", "an empty list", allowed));
        }
        self.settings.iter().try_for_each(|s| s.scene.check())
    }
}

/// What came of one thing that was tried.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Verdict {
    /// It is what was taken.
    Taken,
    /// It looks the same.
    Same,
    /// It is seen.
    Seen,
    /// The closed form says that it is far over the tolerance; nothing was drawn.
    Hopeless,
    /// The closed form says that it is far under the tolerance: it is drawn when it is combined with others.
    Clear,
    /// Its parts, measured alone, add up to more than the tolerance; nothing was drawn.
    AddsUp,
    /// It looks the same with the samples of the search, but not by the reference.
    SeenByReference,
}

impl Verdict {
    /// In a few words.
    pub fn words(self) -> &'static str {
        match self {
            Self::Taken => "taken",
            Self::Same => "looks the same",
            Self::Seen => "is seen",
            Self::Hopeless => "far over by its closed form, not drawn",
            Self::Clear => "looks the same by its closed form",
            Self::AddsUp => "its parts add up to more, not drawn",
            Self::SeenByReference => "is seen by the reference",
        }
    }
}

/// One thing that was tried.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Trial {
    /// What.
    pub what: String,
    /// What it is seen with, in the words of `--model`.
    #[serde(rename = "model", serialize_with = "words_of")]
    pub looks: Vec<Look>,
    /// Bytes of the map in memory.
    pub bytes: u64,
    /// By how much the closed form lets a lobe change, relative; none where there is no closed form.
    pub predicted: Option<f32>,
    /// The error where it is worst, if it was drawn.
    pub error: Option<PictureError>,
    /// What came of it.
    pub verdict: Verdict,
}

fn words_of<S: serde::Serializer>(looks: &[Look], s: S) -> std::result::Result<S::Ok, S::Error> {
    s.serialize_str(&words(looks))
}

/// Looks as `--model` names them.
fn words(looks: &[Look]) -> String {
    let words: Vec<String> = looks.iter().map(Look::to_string).collect();
    words.join(",")
}

/// The least that looks the same.
pub struct Reduction {
    kept: Kept,
    /// What it is seen with: what was asked for, or where that is one model alone, a cheaper one.
    pub looks: Vec<Look>,
    /// The error in each setting with each look, the looks of the first setting first, measured by the reference; a full map's is 0
    /// without being measured.
    pub errors: Vec<PictureError>,
    /// Everything that was tried, in order.
    pub trials: Vec<Trial>,
    /// The exponent up to which a lobe shows, which the closed forms start from.
    pub k_max: f32,
    /// Samples along a pixel's side of the reference; none where the full map is kept to the bit and nothing was measured.
    pub reference_samples: Option<u32>,
    /// The depths of exported files, one of [`Depth::U8`], [`Depth::U16`] and [`Depth::F16`] each, in which the reduced map would be
    /// seen to differ from the full one: those formats are coarser than the tolerance allows.
    pub seen_in: Vec<Depth>,
    /// Texels along a pixel's side where one turn of the full map fills the picture: the samples that the reference wants.
    pub texels_a_pixel: u32,
    /// Bytes of the full map in memory.
    pub full_bytes: u64,
    /// Milliseconds of drawing every setting with the full map and the looks asked for.
    pub full_milliseconds: f64,
    /// The same of the reduced map and its looks.
    pub milliseconds: f64,
}

impl Reduction {
    /// What is kept.
    pub fn form(&self) -> Form {
        self.kept.form
    }

    /// The reduced map as whoever reads its files gets it.
    pub fn map(&self) -> &AnisoMap {
        &self.kept.map
    }
}

/// Finds the least that looks the same.
///
/// # Errors
/// When the tolerance, a scene or a mesh cannot be used, and when `progress` cancels.
pub fn least(request: &Request<'_>, progress: &Progress<'_>) -> Result<Reduction> {
    request.check()?;
    let mut search = Search {
        studio: Studio::new(request, progress)?,
        predictor: Predictor::new(request.map, request.material, request.size)?,
        request,
        reads_texels: (request.looks.iter()).any(|l| !l.mean && l.model != Model::Lambert),
        progress,
        trials: Vec::new(),
        known: Vec::new(),
        models: Vec::new(),
    };
    search.run()
}

/// How files hold widths: those of 8 bits their roots, as both glTF and the PNG set do.
const EXPORTED: [(Depth, WidthEncoding); 3] = [
    (Depth::U8, WidthEncoding::Sqrt),
    (Depth::U16, WidthEncoding::Linear),
    (Depth::F16, WidthEncoding::Linear),
];

/// A part that passed alone, with its share of the tolerance.
type Passed<T> = Vec<(T, f64)>;

struct Search<'a> {
    request: &'a Request<'a>,
    studio: Studio<'a>,
    predictor: Predictor,
    /// Whether a look reads the map texel by texel, which is what the closed forms speak of.
    reads_texels: bool,
    progress: &'a Progress<'a>,
    trials: Vec<Trial>,
    /// Forms that were tried, and what share of the tolerance those that look the same take.
    known: Vec<(Form, Option<f64>)>,
    /// Cheaper models that are worth drawing.
    models: Vec<Model>,
}

/// Models that are cheaper than one, the cheapest first: those that `cargo bench --bench brdf` measures at least a tenth faster.
fn cheaper(model: Model) -> &'static [Model] {
    match model {
        Model::Lambert => &[],
        Model::Ward => &[Model::Lambert, Model::WardExact],
        Model::WardExact | Model::WardDuer | Model::WardBounded | Model::Ggx => &[Model::Lambert],
        Model::Beckmann => &[
            Model::Lambert,
            Model::WardExact,
            Model::WardBounded,
            Model::Ggx,
        ],
        Model::BlinnPhong => &[Model::Lambert, Model::WardExact],
        Model::Phong => &[Model::Lambert, Model::WardExact, Model::BlinnPhong],
    }
}

impl Search<'_> {
    fn run(&mut self) -> Result<Reduction> {
        self.models = self.possible_models();
        for form in self.constants() {
            if let Some((kept, _)) = self.tried(form)?
                && let Some(found) = self.confirmed(kept)?
            {
                return Ok(found);
            }
        }
        for (form, adds_up) in self.combinations()? {
            if adds_up > ADDED_MAX {
                self.log(form, None, None, Verdict::AddsUp);
            } else if let Some((kept, _)) = self.tried(form)?
                && let Some(found) = self.confirmed(kept)?
            {
                return Ok(found);
            }
        }
        self.full()
    }

    /// Nothing smaller looks the same: the full map.
    fn full(&mut self) -> Result<Reduction> {
        let form = Form::full(Shape::Grid(self.request.map.size()));
        let kept = self.kept(form)?;
        self.log(form, Some(0.0), None, Verdict::Taken);
        let pictures = self.request.settings.len() * self.request.looks.len();
        let errors = vec![PictureError::default(); pictures];
        self.end(kept, self.request.looks, errors)
    }

    fn end(&mut self, kept: Kept, looks: &[Look], errors: Vec<PictureError>) -> Result<Reduction> {
        let full = Form::full(Shape::Grid(self.request.map.size()));
        let measured = kept.form != full || looks != self.request.looks;
        Ok(Reduction {
            seen_in: self.seen_in(&kept.map, looks)?,
            milliseconds: self.studio.time(&kept.map, looks, self.progress)?,
            kept,
            looks: looks.to_vec(),
            errors,
            trials: std::mem::take(&mut self.trials),
            k_max: self.predictor.k_max(),
            reference_samples: measured.then(|| self.studio.reference_samples()),
            texels_a_pixel: self.studio.texels_a_pixel(),
            full_bytes: full.bytes(),
            full_milliseconds: self.studio.milliseconds,
        })
    }

    /// The depths of files in which a map would be seen to differ.
    fn seen_in(&self, map: &AnisoMap, looks: &[Look]) -> Result<Vec<Depth>> {
        let (metric, tolerance) = (self.request.metric, self.request.tolerance);
        let mut seen = Vec::new();
        for (depth, encoding) in EXPORTED {
            let stored = Storage::new(depth, encoding).pack(map);
            let stored = stored.unpack(map.size(), map.wrap())?;
            if stored == *map || is_clear(metric, self.predictor.of_map(&stored)?, tolerance) {
                continue;
            }
            let error = self.studio.error(&stored, looks, self.progress)?;
            if !error.is_within(tolerance) {
                seen.push(depth);
            }
        }
        Ok(seen)
    }

    fn log(
        &mut self,
        form: Form,
        predicted: Option<f32>,
        error: Option<PictureError>,
        verdict: Verdict,
    ) {
        self.trials.push(Trial {
            what: form.to_string(),
            looks: self.request.looks.to_vec(),
            bytes: form.bytes(),
            predicted,
            error,
            verdict,
        });
    }

    fn kept(&self, form: Form) -> Result<Kept> {
        let (map, aspect) = (self.request.map, self.request.aspect);
        let base = form::base(map, aspect, form.shape)?;
        Kept::new(&base, form, aspect, (map.size(), map.wrap()))
    }

    /// Draws a form with the looks asked for; gives it back with its share of the tolerance if it looks the same.
    fn tried(&mut self, form: Form) -> Result<Option<(Kept, f64)>> {
        if let Some(&(_, share)) = self.known.iter().find(|(known, _)| *known == form) {
            return share.map(|s| Ok((self.kept(form)?, s))).transpose();
        }
        let found = self.newly_tried(form)?;
        self.known.push((form, found.as_ref().map(|(_, s)| *s)));
        Ok(found)
    }

    fn newly_tried(&mut self, form: Form) -> Result<Option<(Kept, f64)>> {
        self.progress.expect(1);
        let kept = self.kept(form)?;
        let predicted = self.predictor.of_map(&kept.map)?;
        let request = self.request;
        if self.reads_texels && is_hopeless(request.metric, predicted, request.limit()) {
            self.log(kept.form, Some(predicted), None, Verdict::Hopeless);
            self.progress.step()?;
            return Ok(None);
        }
        let error = self.studio.error(&kept.map, request.looks, self.progress)?;
        let same = error.is_within(request.limit());
        let verdict = if same { Verdict::Same } else { Verdict::Seen };
        self.log(kept.form, Some(predicted), Some(error), verdict);
        self.progress.step()?;
        Ok(same.then(|| (kept, error.share(request.limit()))))
    }

    /// The share of the tolerance that a form takes alone, if it looks the same.
    fn alone(&mut self, form: Form) -> Result<Option<f64>> {
        Ok(self.tried(form)?.map(|(_, share)| share))
    }

    /// The same without drawing what its closed form clears. Not for sizes: how large a texel is in the picture depends on the
    /// scene.
    fn alone_or_clear(&mut self, form: Form) -> Result<Option<f64>> {
        let request = self.request;
        let predicted = self.predictor.of_map(&self.kept(form)?.map)?;
        if is_clear(request.metric, predicted, request.limit()) {
            self.log(form, Some(predicted), None, Verdict::Clear);
            return Ok(Some(0.0));
        }
        self.alone(form)
    }

    /// Tries cheaper models on what looks the same, and has the reference confirm it; without the cheaper model if need be.
    fn confirmed(&mut self, kept: Kept) -> Result<Option<Reduction>> {
        let own = self.request.looks;
        let cheap = self.cheaper_look(&kept)?.map(|look| [look]);
        for looks in cheap.iter().map(<[Look; 1]>::as_slice).chain([own]) {
            let errors = self
                .studio
                .reference_errors(&kept.map, looks, self.progress)?;
            let tolerance = self.request.limit();
            let within = errors.iter().all(|e| e.is_within(tolerance));
            let worst = errors
                .iter()
                .copied()
                .max_by(|a, b| a.share(tolerance).total_cmp(&b.share(tolerance)));
            self.trials.push(Trial {
                what: format!("{}, by the reference", kept.form),
                looks: looks.to_vec(),
                bytes: kept.form.bytes(),
                predicted: None,
                error: worst,
                verdict: if within {
                    Verdict::Taken
                } else {
                    Verdict::SeenByReference
                },
            });
            if within {
                return self.end(kept, looks, errors).map(Some);
            }
        }
        Ok(None)
    }

    /// The cheapest model with which a reduced map looks like the full one with the only look asked for.
    fn cheaper_look(&mut self, kept: &Kept) -> Result<Option<Look>> {
        let request = self.request;
        let own = request.looks[0];
        for model in self.models.clone() {
            let look = Look { model, ..own };
            let error = self.studio.error(&kept.map, &[look], self.progress)?;
            let same = error.is_within(request.limit());
            self.trials.push(Trial {
                what: format!("model {look} on {}", kept.form),
                looks: vec![look],
                bytes: kept.form.bytes(),
                predicted: self.predictor.of_model(own.model, model),
                error: Some(error),
                verdict: if same { Verdict::Same } else { Verdict::Seen },
            });
            if same {
                return Ok(Some(look));
            }
        }
        Ok(None)
    }

    /// The cheaper models that are not out of the question by their closed form; those that are, are told once. None where there
    /// are several looks: they are there to be told apart.
    fn possible_models(&mut self) -> Vec<Model> {
        let request = self.request;
        let &[own] = request.looks else {
            return Vec::new();
        };
        let full = Form::full(Shape::Grid(request.map.size()));
        let mut possible = Vec::new();
        for &model in cheaper(own.model) {
            let predicted = self.predictor.of_model(own.model, model);
            if !predicted.is_some_and(|p| is_hopeless(request.metric, p, request.limit())) {
                possible.push(model);
                continue;
            }
            self.trials.push(Trial {
                what: format!("model {model}"),
                looks: vec![Look { model, ..own }],
                bytes: full.bytes(),
                predicted,
                error: None,
                verdict: Verdict::Hopeless,
            });
        }
        possible
    }

    /// No map: one texel, by its mean lobe and by its typical numbers.
    fn constants(&self) -> Vec<Form> {
        let map = self.request.map;
        let mut texels = vec![form::mean_lobe(map), form::typical(map)];
        texels.dedup();
        let shapes = texels.into_iter().map(Shape::Constant);
        shapes.map(Form::full).collect()
    }

    /// Combinations of what passes alone, from the fewest bytes upward, each with what its parts add up to.
    fn combinations(&mut self) -> Result<Vec<(Form, f64)>> {
        let full = Shape::Grid(self.request.map.size());
        let grids = self.grids()?;
        let kinds = self.kinds(full)?;
        let storages = self.storages(full)?;
        let mut all = combine(&grids, &kinds, &storages);
        for center in self.centers() {
            all.extend(self.tables(center)?);
        }
        all.sort_by(|(a, p), (b, q)| a.bytes().cmp(&b.bytes()).then(p.total_cmp(q)));
        let most = Form::full(full).bytes();
        all.retain(|(form, _)| form.bytes() < most);
        Ok(all)
    }

    /// What may be left out of every texel of a shape, with nothing left out as the last.
    fn kinds(&mut self, shape: Shape) -> Result<Passed<(Widths, Axes)>> {
        let mut passed = Vec::new();
        for (widths, axes) in [
            (Widths::Round, Axes::Same),
            (Widths::Same, Axes::Each),
            (Widths::Each, Axes::Same),
        ] {
            let form = Form {
                widths,
                axes,
                ..Form::full(shape)
            };
            if let Some(share) = self.alone_or_clear(form)? {
                passed.push(((widths, axes), share));
            }
        }
        passed.push(((Widths::Each, Axes::Each), 0.0));
        Ok(passed)
    }

    /// Storages that pass on a shape, with floats as the last.
    fn storages(&mut self, shape: Shape) -> Result<Passed<Storage>> {
        let mut passed = Vec::new();
        for storage in form::storages() {
            let form = Form {
                storage,
                ..Form::full(shape)
            };
            if let Some(share) = self.alone_or_clear(form)? {
                passed.push((storage, share));
            }
        }
        passed.push((Storage::FULL, 0.0));
        Ok(passed)
    }

    /// Sizes that pass, each got from the one before by halving both sides or one, and strips.
    fn grids(&mut self) -> Result<Passed<Shape>> {
        let full = self.request.map.size();
        let mut passed = vec![(Shape::Grid(full), 0.0)];
        let strips = [Size::new(full.width(), 1)?, Size::new(1, full.height())?];
        for strip in strips.into_iter().filter(|s| *s != full) {
            if let Some(share) = self.alone(Form::full(Shape::Grid(strip)))? {
                passed.push((Shape::Grid(strip), share));
                self.halve(strip, &mut passed)?;
            }
        }
        self.halve(full, &mut passed)?;
        Ok(passed)
    }

    fn halve(&mut self, from: Size, passed: &mut Passed<Shape>) -> Result<()> {
        let mut size = from;
        'smaller: loop {
            let (w, h) = (size.width().div_ceil(2), size.height().div_ceil(2));
            let mut halves = vec![(w, h), (w, size.height()), (size.width(), h)];
            halves.dedup();
            for (w, h) in halves {
                let half = Size::new(w, h)?;
                let known = half == size || passed.iter().any(|(s, _)| *s == Shape::Grid(half));
                if known {
                    continue;
                }
                if let Some(share) = self.alone(Form::full(Shape::Grid(half)))? {
                    passed.push((Shape::Grid(half), share));
                    size = half;
                    continue 'smaller;
                }
            }
            return Ok(());
        }
    }

    /// Where a table outward may have its centre: in the middle of the map, and where its one pole lies.
    fn centers(&self) -> Vec<Vec2> {
        let mut centers = vec![Vec2::splat(0.5)];
        let (w, h) = (self.request.map.width(), self.request.map.height());
        let field = walk(self.request.map, &Progress::none()).expect("nobody cancels");
        if let Poles::Each(poles) = field.poles
            && let [
                Pole {
                    place, halves: 2, ..
                },
            ] = poles[..]
        {
            // The pole lies where four texels meet.
            let pole = Vec2::new(
                (place.x + 1) as f32 / w as f32,
                1.0 - (place.y + 1) as f32 / h as f32,
            );
            if pole.distance(centers[0]) > 2.0 / w.min(h) as f32 {
                centers.push(pole);
            }
        }
        centers
    }

    /// Tables around a centre, in combination.
    fn tables(&mut self, center: Vec2) -> Result<Vec<(Form, f64)>> {
        let (map, aspect) = (self.request.map, self.request.aspect);
        if map.width() < 4 || map.height() < 4 {
            return Ok(Vec::new());
        }
        let Shape::Radial(radius, _) = form::radial(center, aspect, 1) else {
            return Ok(Vec::new());
        };
        // Twice as many samples as the map has texels on the way: fewer would blur its edges a second time.
        let per_unit = (map.width() as f32 / aspect).max(map.height() as f32);
        let most = (2.0 * radius.reach * per_unit).ceil().clamp(1.0, 32_768.0) as u32;
        let first = form::radial(center, aspect, most);
        let Some(share) = self.alone(Form::full(first))? else {
            return Ok(Vec::new());
        };
        let mut shapes = vec![(first, share)];
        let mut samples = most.div_ceil(2);
        while samples > 1 {
            let shape = form::radial(center, aspect, samples);
            let Some(share) = self.alone(Form::full(shape))? else {
                break;
            };
            shapes.push((shape, share));
            samples = samples.div_ceil(2);
        }
        let kinds = self.kinds(first)?;
        let storages = self.storages(first)?;
        // Their shares hold that of the table itself already; drawing will tell.
        let plain = |mut list: Passed<(Widths, Axes)>| {
            list.iter_mut().for_each(|(_, share)| *share = 0.0);
            list
        };
        let storages: Passed<Storage> = storages.into_iter().map(|(s, _)| (s, 0.0)).collect();
        Ok(combine(&shapes, &plain(kinds), &storages))
    }
}

/// What parts may add up to, as a share of the tolerance, for a combination to be worth drawing.
const ADDED_MAX: f64 = 1.1;

/// Every combination; errors of parts that have nothing to do with each other add up as squares do.
fn combine(
    shapes: &Passed<Shape>,
    kinds: &Passed<(Widths, Axes)>,
    storages: &Passed<Storage>,
) -> Vec<(Form, f64)> {
    let mut all = Vec::new();
    for &(shape, a) in shapes {
        for &((widths, axes), b) in kinds {
            for &(storage, c) in storages {
                let form = Form {
                    shape,
                    widths,
                    axes,
                    storage,
                };
                let whole = widths == Widths::Each && axes == Axes::Each;
                let is_table = matches!(shape, Shape::Radial(..));
                // Floats are whole maps in files that every program reads.
                if form.is_coded() || (whole && !is_table) {
                    all.push((form, (a * a + b * b + c * c).sqrt()));
                }
            }
        }
    }
    // Without axes, or without widths, storages that differ in nothing else are one.
    let mut seen: Vec<(Form, f64)> = Vec::new();
    for (form, share) in all {
        let same = |other: &Form| {
            other.shape == form.shape
                && (other.widths, other.axes) == (form.widths, form.axes)
                && (form.widths == Widths::Same || other.storage.widths == form.storage.widths)
                && (form.axes == Axes::Same || other.storage.axis == form.storage.axis)
        };
        if !seen.iter().any(|(other, _)| same(other)) {
            seen.push((form, share));
        }
    }
    seen
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::map::{DEFAULT_TEXEL, Wrap};

    #[test]
    fn metrics_are_words() {
        for metric in Metric::ALL {
            assert_eq!(metric.to_string().parse::<Metric>().unwrap(), metric);
            assert_eq!(serde_json::to_value(metric).unwrap(), metric.name());
        }
        let e = "lumiance".parse::<Metric>().unwrap_err().to_string();
        assert!(e.contains("`luminance`"), "{e}");
    }

    #[test]
    fn combinations_are_each_one_thing_and_floats_are_whole_maps() {
        let shape = Shape::Grid(Size::new(8, 8).unwrap());
        let kinds = [
            (Widths::Round, Axes::Same),
            (Widths::Same, Axes::Each),
            (Widths::Each, Axes::Each),
        ];
        let kinds = kinds.map(|k| (k, 0.3)).to_vec();
        let mut storages: Passed<Storage> =
            form::storages().into_iter().map(|s| (s, 0.4)).collect();
        storages.push((Storage::FULL, 0.0));
        let all = combine(&vec![(shape, 0.0)], &kinds, &storages);
        for (i, (form, share)) in all.iter().enumerate() {
            assert!(
                all[..i]
                    .iter()
                    .all(|(f, _)| f.to_string() != form.to_string()),
                "{form}"
            );
            let whole = form.widths == Widths::Each && form.axes == Axes::Each;
            assert!(form.is_coded() || whole, "{form}");
            assert!(
                (share - 0.5).abs() < 1e-6 || !form.is_coded(),
                "{form} {share}"
            );
        }
        // 8 and 16 bits of one number, the same of the axis alone, and all six of the whole.
        assert_eq!(all.len(), 2 + 2 + 6);
    }

    #[test]
    fn cheaper_models_lead_nowhere_back() {
        for model in [
            Model::Ward,
            Model::Beckmann,
            Model::Phong,
            Model::Ggx,
            Model::Lambert,
        ] {
            assert!(!cheaper(model).contains(&model));
            for other in cheaper(model) {
                assert!(!cheaper(*other).contains(&model), "{model} {other}");
            }
        }
    }

    #[test]
    fn requests_without_sense_are_refused() {
        let map = AnisoMap::constant(Size::new(4, 4).unwrap(), Wrap::Repeat, DEFAULT_TEXEL);
        let mesh = Arc::new(crate::mesh::builtin("sphere").unwrap());
        let settings = [Setting {
            mesh_name: "sphere".to_owned(),
            light_name: "studio".to_owned(),
            scene: Scene::for_mesh(&mesh),
            mesh,
        }];
        let material = Material::default();
        let ask = |tolerance, settings: &[Setting]| {
            let request = Request {
                map: &map,
                aspect: 1.0,
                material: &material,
                looks: &[Look::default()],
                settings,
                metric: Metric::Flip,
                tolerance,
                size: Size::new(16, 16).unwrap(),
            };
            least(&request, &Progress::none()).map_err(|e| e.to_string())
        };
        for bad in [0.0, -1.0, f32::NAN, f32::INFINITY, 1.5] {
            assert!(
                ask(bad, &settings).err().unwrap().contains("tolerance"),
                "{bad}"
            );
        }
        assert!(ask(0.1, &[]).err().unwrap().contains("scenes"));
        let found = ask(0.1, &settings).unwrap();
        assert_eq!(
            (found.form().bytes(), found.form().kind()),
            (0, "constants")
        );
        assert_eq!(found.trials.last().unwrap().verdict, Verdict::Taken);
    }

    #[test]
    fn whoever_cancels_is_obeyed() {
        let map = AnisoMap::constant(Size::new(4, 4).unwrap(), Wrap::Repeat, DEFAULT_TEXEL);
        let mesh = Arc::new(crate::mesh::builtin("sphere").unwrap());
        let request = Request {
            map: &map,
            aspect: 1.0,
            material: &Material::default(),
            looks: &[Look::default()],
            settings: &[Setting {
                mesh_name: "sphere".to_owned(),
                light_name: "studio".to_owned(),
                scene: Scene::for_mesh(&mesh),
                mesh,
            }],
            metric: Metric::Flip,
            tolerance: 0.1,
            size: Size::new(16, 16).unwrap(),
        };
        let stop = |_: u64, _: u64| false;
        let cancelled = least(&request, &Progress::new(&stop));
        assert!(matches!(cancelled, Err(Error::Cancelled)));
    }
}
