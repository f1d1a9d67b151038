//! The least that looks the same: no map, a strip, a smaller map, fewer numbers, fewer bits, a cheaper model.
//!
//! Each kind of saving is first tried alone on the full map, but for those that a closed form (`predict`) clears. What passes
//! alone is then combined, from the fewest bytes upward, and each combination is drawn in every one of the user's scenes, since
//! errors add up. The first that passes is drawn once more by the reference (f64, many samples a pixel) beside the full map's
//! reference; only if it is within the tolerance there too it is taken, or else the search goes on. The full map in floats is always
//! left, and has no error. Nothing is refused by a closed form: that of a lobe knows neither the model, which may read the widths
//! as one, nor whether the scene shows any highlight.

mod files;
mod form;
mod formats;
mod measure;
mod predict;
mod report;

pub use files::{REPORT, Saved, check_output};
pub use form::{Axes, Channels, Form, Shape, Widths};
pub use measure::PictureError;

use super::field::{Pole, Poles, walk};
use crate::brdf::Model;
use crate::convention::storage::Depth;
use crate::error::{Error, Result};
use crate::export::exr::Precision;
use crate::map::{AnisoMap, DEFAULT_TEXEL, Size, Texel};
use crate::mesh::Mesh;
use crate::preview::{Look, Scene};
use crate::progress::Progress;
use crate::recipe::{Material, Target};
use form::{Kept, Rounding};
use formats::given_back;
use glam::Vec2;
use measure::Studio;
use predict::{Predictor, is_clear};
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
    /// The formats of files to be judged, if they are files of maps: whether what they give back of the reduced map is seen.
    pub formats: &'a [Target],
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
    /// The closed form says that it is far under the tolerance: it is drawn when it is combined with others.
    Clear,
    /// Its parts, measured alone, add up to half as much again as the tolerance; nothing was drawn.
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
    /// Of the formats asked about those whose files, written and read back, would be seen to differ from the full map: they are
    /// coarser than the tolerance allows. EXR files with halves, which are the usual ones.
    pub seen_in: Vec<Target>,
    /// Those of them that would be seen even if they had floats; formats without a choice among them.
    pub seen_in_floats: Vec<Target>,
    /// The formats that could not be judged, since files of theirs could not be written or read where the system keeps what goes
    /// again, and why the first of them.
    pub unjudged: Option<(Vec<Target>, Error)>,
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
    Search::new(request, progress)?.run()
}

/// So many times the tolerance is over it, with however many samples it was measured.
const FAR: f32 = 1.5;

/// What came of the formats.
#[derive(Default)]
struct Judged {
    seen_in: Vec<Target>,
    seen_in_floats: Vec<Target>,
    unjudged: Option<(Vec<Target>, Error)>,
}

impl Judged {
    /// What came of a format before.
    fn of(&self, format: Target) -> std::result::Result<bool, Trouble> {
        let is_left = |(formats, _): &(Vec<Target>, Error)| formats.contains(&format);
        match self.unjudged.as_ref().is_some_and(is_left) {
            true => Err(Trouble::Again),
            false => Ok(self.seen_in.contains(&format)),
        }
    }

    /// Leaves a format out because of its files; any other trouble ends the search.
    fn leave(&mut self, format: Target, trouble: Trouble) -> Result<()> {
        match (trouble, &mut self.unjudged) {
            (Trouble::Other(error), _) => return Err(error),
            (_, Some((formats, _))) => formats.push(format),
            (Trouble::Files(error), None) => self.unjudged = Some((vec![format], error)),
            (Trouble::Again, None) => unreachable!("its twin was left out"),
        }
        Ok(())
    }
}

/// Why a format was not judged.
enum Trouble {
    /// Its files could not be written or read.
    Files(Error),
    /// Those of its twin could not.
    Again,
    /// It has nothing to do with files.
    Other(Error),
}

impl From<Error> for Trouble {
    fn from(error: Error) -> Self {
        Self::Other(error)
    }
}

/// A part that passed alone, with its share of the tolerance.
type Passed<T> = Vec<(T, f64)>;

struct Search<'a> {
    request: &'a Request<'a>,
    studio: Studio<'a>,
    predictor: Predictor,
    progress: &'a Progress<'a>,
    trials: Vec<Trial>,
    /// Forms that were tried, and what share of the tolerance those that look the same take.
    known: Vec<(Form, Option<f64>)>,
    /// The texels of the shape that was tried last, before anything is left out.
    base: Option<(Shape, AnisoMap)>,
    rounding: Rounding,
    /// What is typical of the full map.
    typical: Texel,
}

/// Models that are cheaper than one, the cheapest first: those that `cargo bench --bench brdf` measures at least a tenth faster.
fn cheaper(model: Model) -> &'static [Model] {
    match model {
        Model::Lambert => &[],
        Model::Ward => &[Model::Lambert, Model::WardExact],
        Model::WardExact | Model::WardDuer | Model::WardBounded | Model::Ggx => &[Model::Lambert],
        Model::Beckmann => &[
            Model::Lambert,
            Model::WardDuer,
            Model::WardExact,
            Model::WardBounded,
            Model::Ggx,
            Model::Ward,
        ],
        Model::BlinnPhong => &[Model::Lambert, Model::WardExact],
        Model::Phong => &[Model::Lambert, Model::WardExact, Model::BlinnPhong],
    }
}

impl<'a> Search<'a> {
    fn new(request: &'a Request<'a>, progress: &'a Progress<'a>) -> Result<Self> {
        let is_round = |l: &Look| matches!(l.model, Model::Phong | Model::BlinnPhong);
        Ok(Self {
            studio: Studio::new(request, progress)?,
            predictor: Predictor::new(request.map, request.material, request.size)?,
            request,
            progress,
            trials: Vec::new(),
            known: Vec::new(),
            base: None,
            rounding: match request.looks.iter().all(is_round) {
                true => Rounding::Variance,
                false => Rounding::Peak,
            },
            typical: form::typical(request.map),
        })
    }

    fn run(&mut self) -> Result<Reduction> {
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

    /// Nothing smaller looks the same: the full map, with a cheaper model if that does.
    fn full(&mut self) -> Result<Reduction> {
        let (form, request) = (
            Form::full(Shape::Grid(self.request.map.size())),
            self.request,
        );
        let kept = self.kept(form)?;
        if let Some(look) = self.cheaper_look(&kept)?
            && let Some(errors) = self.by_reference(&kept, &[look])?
        {
            return self.end(kept, &[look], errors);
        }
        self.log(form, Some(0.0), None, Verdict::Taken);
        let pictures = request.settings.len() * request.looks.len();
        let errors = vec![PictureError::default(); pictures];
        self.end(kept, request.looks, errors)
    }

    fn end(&mut self, kept: Kept, looks: &[Look], errors: Vec<PictureError>) -> Result<Reduction> {
        let full = Form::full(Shape::Grid(self.request.map.size()));
        let measured = kept.form != full || looks != self.request.looks;
        let judged = self.judged(&kept.map, looks)?;
        Ok(Reduction {
            seen_in: judged.seen_in,
            seen_in_floats: judged.seen_in_floats,
            unjudged: judged.unjudged,
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

    /// The formats whose files would be seen to differ, as they usually are and with floats.
    fn judged(&mut self, map: &AnisoMap, looks: &[Look]) -> Result<Judged> {
        let mut judged = Judged::default();
        let formats = self.request.formats;
        let maps = || formats.iter().copied().filter(|f| *f != Target::Preview);
        self.progress.expect(maps().count() as u64);
        for format in maps() {
            // Both hold the same textures.
            let twin = format == Target::Gltf && formats.contains(&Target::Glb);
            let first = match format {
                _ if twin => judged.of(Target::Glb),
                _ => self.is_seen_in(format, Precision::Half, map, looks),
            };
            match first {
                Ok(false) => {}
                Ok(true) => {
                    let chooses = matches!(format, Target::Exr | Target::RgbExr);
                    let in_floats = match chooses {
                        true => self.is_seen_in(format, Precision::Float, map, looks),
                        false => Ok(true),
                    };
                    judged.seen_in.push(format);
                    match in_floats {
                        Ok(false) => {}
                        Ok(true) => judged.seen_in_floats.push(format),
                        Err(trouble) => judged.leave(format, trouble)?,
                    }
                }
                Err(trouble) => judged.leave(format, trouble)?,
            }
            self.progress.step()?;
        }
        Ok(judged)
    }

    fn is_seen_in(
        &mut self,
        format: Target,
        precision: Precision,
        map: &AnisoMap,
        looks: &[Look],
    ) -> std::result::Result<bool, Trouble> {
        self.progress.check()?;
        let (metric, tolerance) = (self.request.metric, self.request.tolerance);
        let stored = given_back(format, precision, map).map_err(Trouble::Files)?;
        if stored == *map || is_clear(metric, self.predictor.of_map(&stored)?, tolerance) {
            return Ok(false);
        }
        let error = self.studio.error(&stored, looks, self.progress)?;
        if error.is_within(self.request.limit()) || !error.is_within(FAR * tolerance) {
            return Ok(!error.is_within(tolerance));
        }
        // Too near to be told with few samples.
        let errors = self
            .studio
            .reference_errors(&stored, looks, self.progress)?;
        Ok(!errors.iter().all(|e| e.is_within(tolerance)))
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

    fn kept(&mut self, form: Form) -> Result<Kept> {
        let (map, aspect, shape) = (self.request.map, self.request.aspect, form.shape);
        let (full, rounding, whole) = ((map, aspect), self.rounding, self.typical);
        if shape == Shape::Grid(map.size()) {
            return Kept::new(map, form, rounding, full, whole);
        }
        let base = match self.base.take() {
            Some((known, base)) if known == shape => base,
            _ => form::base(map, aspect, shape)?.into_owned(),
        };
        let kept = Kept::new(&base, form, rounding, full, whole);
        self.base = Some((shape, base));
        kept
    }

    /// Draws a form with the looks asked for; gives it back with its share of the tolerance if it looks the same.
    fn tried(&mut self, form: Form) -> Result<Option<(Kept, f64)>> {
        if let Some(&(_, share)) = self.known.iter().find(|(known, _)| *known == form) {
            return share.map(|s| Ok((self.kept(form)?, s))).transpose();
        }
        let kept = self.kept(form)?;
        let predicted = self.predictor.of_map(&kept.map)?;
        let share = self.drawn(form, &kept, predicted)?;
        Ok(share.map(|share| (kept, share)))
    }

    /// The share of the tolerance that a form takes, as it is drawn, if it looks the same.
    fn drawn(&mut self, form: Form, kept: &Kept, predicted: f32) -> Result<Option<f64>> {
        self.progress.expect(1);
        let request = self.request;
        let error = self.studio.error(&kept.map, request.looks, self.progress)?;
        let same = error.is_within(request.limit());
        let verdict = if same { Verdict::Same } else { Verdict::Seen };
        self.log(kept.form, Some(predicted), Some(error), verdict);
        self.progress.step()?;
        let share = same.then(|| error.share(request.limit()));
        self.known.push((form, share));
        Ok(share)
    }

    /// The share of the tolerance that a form takes alone, if it looks the same.
    fn alone(&mut self, form: Form) -> Result<Option<f64>> {
        Ok(self.tried(form)?.map(|(_, share)| share))
    }

    /// The same without drawing what its closed form clears. Not for sizes: how large a texel is in the picture depends on the
    /// scene.
    fn alone_or_clear(&mut self, form: Form) -> Result<Option<f64>> {
        if let Some(&(_, share)) = self.known.iter().find(|(known, _)| *known == form) {
            return Ok(share);
        }
        let request = self.request;
        let kept = self.kept(form)?;
        let predicted = self.predictor.of_map(&kept.map)?;
        if is_clear(request.metric, predicted, request.limit()) {
            self.log(form, Some(predicted), None, Verdict::Clear);
            return Ok(Some(0.0));
        }
        self.drawn(form, &kept, predicted)
    }

    /// Tries cheaper models on what looks the same, and has the reference confirm it; without the cheaper model if need be.
    fn confirmed(&mut self, kept: Kept) -> Result<Option<Reduction>> {
        let own = self.request.looks;
        let cheap = self.cheaper_look(&kept)?.map(|look| [look]);
        for looks in cheap.iter().map(<[Look; 1]>::as_slice).chain([own]) {
            if let Some(errors) = self.by_reference(&kept, looks)? {
                return self.end(kept, looks, errors).map(Some);
            }
        }
        Ok(None)
    }

    /// The errors that the reference measures, if they are all within the limit.
    fn by_reference(&mut self, kept: &Kept, looks: &[Look]) -> Result<Option<Vec<PictureError>>> {
        let errors = self
            .studio
            .reference_errors(&kept.map, looks, self.progress)?;
        let limit = self.request.limit();
        let within = errors.iter().all(|e| e.is_within(limit));
        let worst = errors
            .iter()
            .copied()
            .max_by(|a, b| a.share(limit).total_cmp(&b.share(limit)));
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
        Ok(within.then_some(errors))
    }

    /// The cheapest model with which a reduced map looks like the full one with the only look asked for; none where there are
    /// several looks: they are there to be told apart.
    fn cheaper_look(&mut self, kept: &Kept) -> Result<Option<Look>> {
        let request = self.request;
        let &[own] = request.looks else {
            return Ok(None);
        };
        for &model in cheaper(own.model) {
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

    /// No map: one texel, by its mean lobe and by its typical numbers.
    fn constants(&self) -> Vec<Form> {
        let map = self.request.map;
        let mut texels = vec![form::mean_lobe(map), self.typical];
        texels.dedup();
        let shapes = texels.into_iter().map(Shape::Constant);
        shapes.map(Form::full).collect()
    }

    /// Combinations of what passes alone, from the fewest bytes upward, each with what its parts add up to.
    fn combinations(&mut self) -> Result<Vec<(Form, f64)>> {
        let full = Shape::Grid(self.request.map.size());
        let grids = self.grids()?;
        let mut parts = Parts::default();
        self.leave_out(full, 0.0, &mut parts)?;
        self.store(full, &mut parts)?;
        let mut all = combine(&grids, &parts);
        for center in self.centers() {
            all.extend(self.tables(center, &parts)?);
        }
        all.sort_by(|(a, p), (b, q)| a.bytes().cmp(&b.bytes()).then(p.total_cmp(q)));
        let most = Form::full(full).bytes();
        all.retain(|(form, _)| form.bytes() < most);
        Ok(all)
    }

    /// Tries what of the texels of a shape may be left out, each alone; `own` is the share of the tolerance that the shape itself
    /// takes.
    fn leave_out(&mut self, shape: Shape, own: f64, parts: &mut Parts) -> Result<()> {
        let form = |widths, axes| Form::new(shape, widths, axes, Channels::FULL);
        // What a form takes beside its shape.
        let beside = |share: f64| (share * share - own * own).max(0.0).sqrt();
        let round = self.alone_or_clear(form(Widths::Round, Axes::Same))?;
        parts.round = round.map(beside);
        for widths in [Widths::Same, Widths::X, Widths::Y] {
            if let Some(share) = self.alone_or_clear(form(widths, Axes::Each))?.map(beside) {
                parts.widths.push((widths, share));
                if share <= SLIGHT {
                    break; // to keep one of them would spare next to nothing
                }
            }
        }
        parts.widths.push((Widths::Each, 0.0));
        if let Some(share) = self.alone_or_clear(form(Widths::Each, Axes::Same))? {
            parts.axes.push((Axes::Same, beside(share)));
        }
        parts.axes.push((Axes::Each, 0.0));
        Ok(())
    }

    /// Tries in what bits the numbers of a shape may be stored, each channel alone.
    fn store(&mut self, shape: Shape, parts: &mut Parts) -> Result<()> {
        const F32: Depth = Depth::F32;
        parts.x = self.depths(shape, |depth| Channels::new(depth, F32, F32))?;
        parts.y = self.depths(shape, |depth| Channels::new(F32, depth, F32))?;
        parts.axis = self.depths(shape, |depth| Channels::new(F32, F32, depth))?;
        let halves = Channels::new(Depth::F16, Depth::F16, Depth::F16);
        let form = Form::new(shape, Widths::Each, Axes::Each, halves);
        parts.halves = self.alone_or_clear(form)?;
        Ok(())
    }

    /// The depths that pass for one channel, from the fewest bits to the first that takes next to nothing.
    fn depths(
        &mut self,
        shape: Shape,
        channels: impl Fn(Depth) -> Channels,
    ) -> Result<Passed<Depth>> {
        let mut passed = Vec::new();
        for depth in [Depth::U8, Depth::U16, Depth::F16] {
            let form = Form::new(shape, Widths::Each, Axes::Each, channels(depth));
            if let Some(share) = self.alone_or_clear(form)? {
                passed.push((depth, share));
                if share <= SLIGHT {
                    return Ok(passed);
                }
            }
        }
        passed.push((Depth::F32, 0.0));
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

    /// Tables around a centre, in combination. Their numbers are those of the full map, so its depths hold for them, as far as
    /// drawing does not tell otherwise.
    fn tables(&mut self, center: Vec2, full: &Parts) -> Result<Vec<(Form, f64)>> {
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
        let mut parts = Parts {
            x: full.x.clone(),
            y: full.y.clone(),
            axis: full.axis.clone(),
            ..Parts::default()
        };
        self.leave_out(first, share, &mut parts)?;
        Ok(combine(&shapes, &parts))
    }
}

/// What of texels passed alone, with its share of the tolerance.
#[derive(Default)]
struct Parts {
    /// Round lobes, if they pass.
    round: Option<f64>,
    widths: Passed<Widths>,
    axes: Passed<Axes>,
    x: Passed<Depth>,
    y: Passed<Depth>,
    axis: Passed<Depth>,
    /// A master EXR in halves, if it passes.
    halves: Option<f64>,
}

impl Parts {
    /// What may be kept of the texels.
    fn kinds(&self) -> Passed<(Widths, Axes)> {
        let round = self.round.map(|share| ((Widths::Round, Axes::Same), share));
        let pairs = self.widths.iter().flat_map(|&(widths, a)| {
            let with = move |&(axes, b): &(Axes, f64)| ((widths, axes), a.hypot(b));
            self.axes.iter().map(with)
        });
        round.into_iter().chain(pairs).collect()
    }

    /// How what is kept may be stored: for each number of bytes that with the least share.
    fn channels(&self, widths: Widths, axes: Axes) -> Passed<Channels> {
        let any = vec![(Depth::F32, 0.0)];
        let x = if widths.keep_x() { &self.x } else { &any };
        // One width for both takes what both take.
        let y = if widths.keep_y() || widths == Widths::Round {
            &self.y
        } else {
            &any
        };
        let axis = if axes == Axes::Each { &self.axis } else { &any };
        let mut all = Vec::new();
        for &(dx, a) in x {
            for &(dy, b) in y.iter().filter(|y| widths != Widths::Round || y.0 == dx) {
                for &(da, c) in axis {
                    all.push((Channels::new(dx, dy, da), a.hypot(b).hypot(c)));
                }
            }
        }
        let bytes = |channels: Channels| {
            let shape = Shape::Constant(DEFAULT_TEXEL);
            Form::new(shape, widths, axes, channels).bytes_per_texel()
        };
        all.sort_by(|(a, p), (b, q)| bytes(*a).cmp(&bytes(*b)).then(p.total_cmp(q)));
        all.dedup_by_key(|(channels, _)| bytes(*channels));
        all
    }
}

/// A share of the tolerance that is next to nothing.
const SLIGHT: f64 = 0.1;

/// What parts may add up to, as a share of the tolerance, for a combination to be worth drawing: errors may hide each other in
/// part.
const ADDED_MAX: f64 = 1.5;

/// Every combination; errors of parts that have nothing to do with each other add up as squares do.
fn combine(shapes: &Passed<Shape>, parts: &Parts) -> Vec<(Form, f64)> {
    let mut all = Vec::new();
    for (n, &(shape, a)) in shapes.iter().enumerate() {
        let is_table = matches!(shape, Shape::Radial(..));
        for ((widths, axes), b) in parts.kinds() {
            // A map whose texels are alike is none, and has been tried; tables of them are one.
            if (widths, axes) == (Widths::Same, Axes::Same) && !(is_table && n == 0) {
                continue;
            }
            for (channels, c) in parts.channels(widths, axes) {
                let form = Form::new(shape, widths, axes, channels);
                all.push((form, a.hypot(b).hypot(c)));
            }
        }
        if let Some(share) = parts.halves {
            let halves = Channels::new(Depth::F16, Depth::F16, Depth::F16);
            let form = Form::new(shape, Widths::Each, Axes::Each, halves);
            if !all.iter().any(|(other, _)| *other == form) {
                all.push((form, a.hypot(share)));
            }
        }
    }
    all
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::map::Wrap;

    #[test]
    fn metrics_are_words() {
        for metric in Metric::ALL {
            assert_eq!(metric.to_string().parse::<Metric>().unwrap(), metric);
            assert_eq!(serde_json::to_value(metric).unwrap(), metric.name());
        }
        let e = "lumiance".parse::<Metric>().unwrap_err().to_string();
        assert!(e.contains("`luminance`"), "{e}");
    }

    fn some_parts() -> Parts {
        Parts {
            round: Some(0.3),
            widths: vec![(Widths::X, 0.3), (Widths::Each, 0.0)],
            axes: vec![(Axes::Same, 0.4), (Axes::Each, 0.0)],
            x: vec![(Depth::U8, 0.4), (Depth::U16, 0.0)],
            y: vec![(Depth::U8, 0.6), (Depth::F32, 0.0)],
            axis: vec![(Depth::U8, 0.2), (Depth::U16, 0.0)],
            halves: Some(0.1),
        }
    }

    #[test]
    fn combinations_are_each_one_thing_with_the_least_share_for_its_bytes() {
        let shape = Shape::Grid(Size::new(8, 8).unwrap());
        let all = combine(&vec![(shape, 0.0)], &some_parts());
        for (i, (form, _)) in all.iter().enumerate() {
            let told = |other: &(Form, f64)| other.0.to_string() == form.to_string();
            assert!(!all[..i].iter().any(told), "{form}");
        }
        let of = |widths, axes| {
            let all = all
                .iter()
                .filter(move |(f, _)| (f.widths, f.axes) == (widths, axes));
            all.map(|(f, share)| (f.bytes_per_texel(), *share))
                .collect::<Vec<_>>()
        };
        let near = |found: Vec<(u64, f64)>, want: &[(u64, f64)]| {
            let close = |(a, b): (&(u64, f64), &(u64, f64))| a.0 == b.0 && (a.1 - b.1).abs() < 1e-9;
            assert!(
                found.len() == want.len() && found.iter().zip(want).all(close),
                "{found:?} {want:?}"
            );
        };
        // alpha_x alone in 8 and 16 bits; both widths, of which alpha_y has 8 bits or floats.
        near(
            of(Widths::X, Axes::Same),
            &[(1, 0.3f64.hypot(0.4).hypot(0.4)), (2, 0.5)],
        );
        near(
            of(Widths::Each, Axes::Same),
            &[
                (2, 0.4f64.hypot(0.4).hypot(0.6)),
                (3, 0.4f64.hypot(0.6)),
                (5, 0.4f64.hypot(0.4)),
                (6, 0.4),
            ],
        );
        // Round lobes have one width, of a depth that both pass with.
        near(
            of(Widths::Round, Axes::Same),
            &[(1, 0.3f64.hypot(0.4).hypot(0.6))],
        );
        let halves = Channels::new(Depth::F16, Depth::F16, Depth::F16);
        let halves = Form::new(shape, Widths::Each, Axes::Each, halves);
        assert!(all.contains(&(halves, 0.1)));
    }

    #[test]
    fn a_table_alone_may_keep_nothing_of_its_texels() {
        let parts = Parts {
            widths: vec![(Widths::Same, 0.1), (Widths::Each, 0.0)],
            ..some_parts()
        };
        let bytes = |shape| {
            let all = combine(&vec![(shape, 0.0)], &parts);
            all.iter().map(|(form, _)| form.bytes()).min()
        };
        assert_eq!(bytes(form::radial(Vec2::splat(0.5), 1.0, 64)), Some(0));
        assert_eq!(bytes(Shape::Grid(Size::new(8, 8).unwrap())), Some(64));
    }

    #[test]
    fn the_full_map_may_be_seen_with_a_cheaper_model() {
        let map = AnisoMap::constant(Size::new(4, 4).unwrap(), Wrap::Repeat, DEFAULT_TEXEL);
        let mesh = Arc::new(crate::mesh::builtin("sphere").unwrap());
        let settings = [Setting {
            mesh_name: "sphere".to_owned(),
            light_name: "studio".to_owned(),
            scene: Scene::for_mesh(&mesh),
            mesh,
        }];
        let looks = [Look::default()];
        let full = |specular: [f32; 3]| {
            let material = Material {
                specular,
                ..Material::default()
            };
            let request = Request {
                map: &map,
                aspect: 1.0,
                material: &material,
                looks: &looks,
                settings: &settings,
                metric: Metric::Flip,
                tolerance: 0.01,
                size: Size::new(32, 32).unwrap(),
                formats: &[],
            };
            let none = Progress::none();
            let found = Search::new(&request, &none).unwrap().full().unwrap();
            assert_eq!(found.form(), Form::full(Shape::Grid(map.size())));
            let taken = found.trials.last().unwrap().verdict;
            assert_eq!(taken, Verdict::Taken);
            (found.looks[0].model, found.reference_samples)
        };
        // Without highlights nothing tells the models apart.
        assert_eq!(full([0.0; 3]), (Model::Lambert, Some(8)));
        assert_eq!(full([0.3; 3]), (Model::Ward, None));
    }

    #[test]
    fn cheaper_models_lead_nowhere_back() {
        let wards = [Model::Ward, Model::WardDuer];
        assert!(wards.iter().all(|w| cheaper(Model::Beckmann).contains(w)));
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
                formats: &[],
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
            formats: &[],
        };
        let stop = |_: u64, _: u64| false;
        let cancelled = least(&request, &Progress::new(&stop));
        assert!(matches!(cancelled, Err(Error::Cancelled)));
    }
}
