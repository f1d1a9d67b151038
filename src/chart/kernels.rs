//! What one evaluation of a model costs and how far it is from f64: models, forms, exponentials, storage of the texels, each with
//! each where it means something. GGX has no exponential; Phong and Blinn-Phong have a power in place of one, and no direction.
//!
//! The points are 32768 pairs of light and view, each with a texel of its own, as a picture meets them: alpha_x 0.05 to 0.15,
//! alpha_y 0.2 to 0.5, any direction, light near the mirrored view. Directions are f32; texels are made in f64 and rounded once
//! to the numbers that a form takes, so errors of storage and of arithmetic are seen together. Errors are relative to the
//! f64 model where the exponent is at most 20; beyond, a lobe has no light. One thread; the least time of many rounds counts,
//! since whatever else the machine does only adds to it.

use super::forms::{
    self, Angle, AngleLibm, Beckmann, BitTrick, BlinnPhong, Bounded, Degree, Directed, Directions,
    DoubleAngle, Duer, Exact, Exponent, Exponential, Factor, Form, Ggx, HalfVector, Libm, Phong,
    Power, Precision, Prepared, Printed, Reciprocal, Reflection, TextbookAngles, TextbookPower,
};
use crate::analyse::limits::SPECULAR;
use crate::brdf::kernel::{self, Batch};
use crate::brdf::{Model, shade_f64};
use crate::convention::storage::{
    AxisCodec, AxisEncoding, AxisStorage, Codes, Depth, Packed, Storage, WidthCodec, WidthEncoding,
    WidthStorage,
};
use crate::error::Result;
use crate::map::{AnisoMap, Size, Texel, Wrap};
use crate::math::{self, Axis};
use crate::progress::Progress;
use fearless_simd::{Level, Simd, dispatch};
use fearless_simd_macros::simd;
use glam::{DVec2, DVec3, Vec3};
use half::slice::HalfFloatSliceExt;
use serde::Serialize;
use std::f64::consts::PI;
use std::hint::black_box;
use std::rc::Rc;
use std::time::{Duration, Instant};

/// Points that are evaluated in a round.
const WIDTH: u32 = 256;
const POINTS: usize = 32_768;
/// Texels that are decoded at once; they stay in the first cache, as in the preview.
const CHUNK: usize = 256;
/// Exponents beyond this one are not compared.
const EXPONENT_COMPARED: f64 = 20.0;

/// A way to evaluate a model, and what was measured of it. A line of `kernels.csv`.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct KernelRow {
    /// As `--model` names it.
    pub model: &'static str,
    /// The numbers that the loop takes of a texel.
    pub form: &'static str,
    /// The exponential.
    pub exp: &'static str,
    /// How the texel is stored; decoded in the loop unless it is the form's own f32 numbers.
    pub storage: String,
    /// Bytes of a stored texel.
    pub bytes: usize,
    /// The CPU level of the loop; `scalar` where it is one call after the other.
    pub level: &'static str,
    /// Least nanoseconds per evaluation.
    pub ns_min: f64,
    /// The median of all rounds.
    pub ns_median: f64,
    /// Largest error relative to f64.
    pub max_rel: f64,
    /// Mean error relative to f64.
    pub mean_rel: f64,
}

impl KernelRow {
    /// Whether it is the program's own kernel, at whatever level, on texels that are ready for it.
    pub(super) fn is_own(&self) -> bool {
        let model: Result<Model> = self.model.parse();
        self.form == Prepared::NAME && model.is_ok_and(|m| self.exp == own_exponential(m))
    }
}

/// How long each case is measured.
#[derive(Clone, Copy, Debug)]
pub(super) struct Effort {
    pub(super) rounds: usize,
    pub(super) time: Duration,
}

/// Light, view and texel of every point.
struct Points {
    directions: [Vec<f32>; 6],
    /// As the map holds them: what is stored.
    map: AnisoMap,
    /// Widths and θ of the same texels.
    texels: Vec<(DVec2, f64)>,
    truth: Vec<[f64; Model::ALL.len()]>,
    compared: Vec<bool>,
}

/// Numbers in [0, 1), the same in every run.
fn random_numbers() -> impl FnMut() -> f32 {
    let mut state = 1u32;
    move || {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        (state >> 8) as f32 / 16_777_216.0
    }
}

impl Points {
    fn new() -> Self {
        let mut random = random_numbers();
        let size = Size::new(WIDTH, POINTS as u32 / WIDTH).expect("a small map");
        let mut points = Self {
            directions: [const { Vec::new() }; 6],
            map: AnisoMap::constant(size, Wrap::Repeat, crate::map::DEFAULT_TEXEL),
            texels: Vec::new(),
            truth: Vec::new(),
            compared: Vec::new(),
        };
        for i in 0..POINTS {
            let up = |z: f32, turn: f32| {
                let (s, c) = math::sin_cos(std::f32::consts::TAU * turn);
                let r = (1.0 - z * z).max(0.0).sqrt();
                Vec3::new(r * c, r * s, z)
            };
            let v = up(0.05 + 0.95 * random(), random());
            let texel = Texel {
                alpha_x: 0.05 + 0.1 * random(),
                alpha_y: 0.2 + 0.3 * random(),
                axis: Axis::from_radians(std::f32::consts::PI * random()),
            };
            let l = Vec3::new(-v.x, -v.y, v.z) + up(0.0, random()) * random();
            let l = l.with_z(l.z.abs().max(0.02)).normalize();
            points.map.region_mut().set(i, texel);
            points.push(l, v, texel);
        }
        points
    }

    fn push(&mut self, l: Vec3, v: Vec3, texel: Texel) {
        let numbers = l.to_array().into_iter().chain(v.to_array());
        for (array, x) in self.directions.iter_mut().zip(numbers) {
            array.push(x);
        }
        let alpha = DVec2::new(f64::from(texel.alpha_x), f64::from(texel.alpha_y));
        let theta = 0.5 * f64::from(texel.axis.sin2).atan2(f64::from(texel.axis.cos2));
        let theta = if theta < 0.0 { theta + PI } else { theta };
        let (s, c) = theta.sin_cos();
        let turned = |d: Vec3| {
            let d = d.as_dvec3();
            DVec3::new(c * d.x + s * d.y, c * d.y - s * d.x, d.z)
        };
        let (l, v) = (turned(l), turned(v));
        let h = l + v;
        let k = ((h.x / alpha.x).powi(2) + (h.y / alpha.y).powi(2)) / (h.z * h.z);
        self.texels.push((alpha, theta));
        self.truth
            .push(Model::ALL.map(|m| shade_f64(m, l, v, alpha)));
        self.compared.push(k <= EXPONENT_COMPARED);
    }

    fn directions(&self) -> Directions<'_> {
        let d = |i: usize| &self.directions[i][..];
        ([0, 1, 2].map(d), [3, 4, 5].map(d))
    }

    /// The numbers of every texel in a form, made in f64 and rounded once.
    fn numbers<const N: usize, F: Form<N>>(&self) -> [Vec<f32>; N] {
        let mut lists = [const { Vec::new() }; N];
        for &(alpha, theta) in &self.texels {
            for (list, x) in lists.iter_mut().zip(F::numbers(alpha, theta)) {
                list.push(x as f32);
            }
        }
        lists
    }

    /// The largest and the mean error relative to f64.
    fn errors(&self, model: Model, out: &[f32]) -> (f64, f64) {
        let which = Model::ALL.iter().position(|m| *m == model).unwrap_or(0);
        let (mut largest, mut sum, mut count) = (0.0f64, 0.0, 0u32);
        for ((truth, got), compared) in self.truth.iter().zip(out).zip(&self.compared) {
            let want = truth[which];
            if *compared && want > 1e-9 {
                let error = (f64::from(*got) / want - 1.0).abs();
                largest = largest.max(error);
                sum += error;
                count += 1;
            }
        }
        (largest, sum / f64::from(count.max(1)))
    }
}

fn slices<const T: usize>(lists: &[Vec<f32>; T]) -> [&[f32]; T] {
    lists.each_ref().map(Vec::as_slice)
}

/// The numbers of a form, a list for each.
type Numbers<const N: usize> = Rc<[Vec<f32>; N]>;

/// Writes the value at every point.
type Run<'a> = Box<dyn Fn(&mut [f32]) + 'a>;

/// A way to be measured.
struct Case<'a> {
    model: Model,
    form: &'static str,
    exp: &'static str,
    storage: String,
    bytes: usize,
    level: &'static str,
    run: Run<'a>,
}

/// Collects cases.
struct Cases<'a> {
    points: &'a Points,
    /// The numbers of [`Prepared`], which the program's own kernels take.
    lobe: &'a [Vec<f32>; 4],
    best: (&'static str, Level),
    all: Vec<Case<'a>>,
}

/// What a chart calls the exponential of the program's own kernel of a model.
fn own_exponential(model: Model) -> &'static str {
    match kernel::exp_degree(model) {
        None => "none",
        Some(kernel::EXP_DEGREE) => Degree::<5>::NAME,
        Some(_) => "degree 7",
    }
}

impl<'a> Cases<'a> {
    /// The cases of a form of a model, one for each exponential, the program's own left out. They share the form's numbers.
    fn form<const N: usize, F, R>(&mut self)
    where
        F: Form<N> + 'a,
        R: Reflection<F::Texel> + 'a,
    {
        let numbers: Numbers<N> = Rc::new(self.points.numbers::<N, F>());
        if F::SCALAR {
            self.add::<N, F, R, Libm>(&numbers);
        } else if own_exponential(R::MODEL) == "none" {
            // Whichever it is, it is not called.
            self.add::<N, F, R, Degree<5>>(&numbers);
        } else {
            self.add::<N, F, R, BitTrick>(&numbers);
            self.add::<N, F, R, Degree<2>>(&numbers);
            self.add::<N, F, R, Degree<3>>(&numbers);
            self.add::<N, F, R, Degree<4>>(&numbers);
            self.add::<N, F, R, Degree<5>>(&numbers);
            self.add::<N, F, R, Libm>(&numbers);
        }
    }

    fn add<const N: usize, F, R, E>(&mut self, numbers: &Numbers<N>)
    where
        F: Form<N> + 'a,
        R: Reflection<F::Texel> + 'a,
        E: Exponential + 'a,
    {
        let own = own_exponential(R::MODEL);
        let exp = if own == "none" { own } else { E::NAME };
        if F::NAME == Prepared::NAME && exp == own {
            return;
        }
        let (name, level) = if F::SCALAR {
            ("scalar", Level::baseline())
        } else {
            self.best
        };
        let (directions, numbers) = (self.points.directions(), Rc::clone(numbers));
        self.all.push(Case {
            model: R::MODEL,
            form: F::NAME,
            exp,
            storage: "f32".into(),
            bytes: 4 * N,
            level: name,
            run: Box::new(move |out| {
                forms::evaluate::<N, F, R, E>(level, directions, slices(&numbers), out);
            }),
        });
    }

    /// Every form of a model with a direction but the textbook's.
    fn directed<R: Directed + 'a>(&mut self) {
        self.form::<3, AngleLibm, R>();
        self.form::<3, Angle, R>();
        self.form::<4, DoubleAngle, R>();
        self.form::<4, Prepared, R>();
        self.form::<5, Factor, R>();
        self.form::<4, Precision, R>();
    }

    /// Every form of a model without one.
    fn round<R>(&mut self)
    where
        R: Reflection<Reciprocal> + Reflection<Exponent> + Reflection<Printed> + 'a,
    {
        self.form::<1, TextbookPower, R>();
        self.form::<4, Prepared, R>();
        self.form::<1, Power, R>();
    }

    /// The program's own kernels at every CPU level.
    fn own(&mut self) {
        let (light, view) = self.points.directions();
        let lobe = slices(self.lobe);
        let batch = Batch { light, view, lobe };
        for model in SPECULAR {
            for (name, level) in math::levels() {
                self.all.push(Case {
                    model,
                    form: Prepared::NAME,
                    exp: own_exponential(model),
                    storage: "f32".into(),
                    bytes: 16,
                    level: name,
                    run: Box::new(move |out| kernel::shade(level, model, &batch, out)),
                });
            }
        }
    }

    /// The program's own kernel on texels that are decoded first.
    fn stored(&mut self, model: Model, storage: Storage) {
        let (name, level) = self.best;
        let packed = storage.pack(&self.points.map);
        let (light, view) = self.points.directions();
        self.all.push(Case {
            model,
            form: "decoded",
            exp: own_exponential(model),
            storage: storage.to_string(),
            bytes: storage.bytes_per_texel(),
            level: name,
            run: Box::new(move |out| {
                let mut desk = Desk::new();
                for (i, out) in out.chunks_mut(CHUNK).enumerate() {
                    let start = i * CHUNK;
                    desk.decode(&packed, start, out.len());
                    let cut = |s: &'a [f32]| &s[start..][..out.len()];
                    let batch = Batch {
                        light: light.map(cut),
                        view: view.map(cut),
                        lobe: desk.lobe.each_ref().map(|s| &s[..out.len()]),
                    };
                    kernel::shade(level, model, &batch, out);
                }
            }),
        });
    }
}

/// Room for a chunk of texels between their storage and the kernel.
struct Desk {
    widths: [f32; 2 * CHUNK],
    axis: [f32; 2 * CHUNK],
    lobe: [[f32; CHUNK]; 4],
}

impl Desk {
    fn new() -> Self {
        Self {
            widths: [0.0; 2 * CHUNK],
            axis: [0.0; 2 * CHUNK],
            lobe: [[0.0; CHUNK]; 4],
        }
    }

    /// Prepares `n` texels from number `start` on.
    fn decode(&mut self, packed: &Packed, start: usize, n: usize) {
        let numbers = packed.storage.axis.encoding.numbers();
        plain(&packed.widths, 2 * start, &mut self.widths[..2 * n]);
        plain(&packed.axis, numbers * start, &mut self.axis[..numbers * n]);
        let level = math::level();
        let codecs = (packed.storage.widths.codec(), packed.storage.axis.codec());
        dispatch!(level, simd => prepare(simd, self, n, numbers, codecs));
    }
}

/// Lobes of stored texels that are plain numbers already.
#[simd]
fn prepare<S: Simd>(
    _: S,
    desk: &mut Desk,
    n: usize,
    numbers: usize,
    (widths, axis): (WidthCodec, AxisCodec),
) {
    let n = n.min(CHUNK);
    let [cos2, sin2, x, y] = desk.lobe.each_mut().map(|lane| &mut lane[..n]);
    apart(&desk.widths, x, y);
    if numbers == 2 {
        apart(&desk.axis, cos2, sin2);
    } else {
        cos2.copy_from_slice(&desk.axis[..n]);
        sin2.fill(0.0);
    }
    widths.decode_all(x);
    widths.decode_all(y);
    axis.decode_all(cos2, sin2);
    for i in 0..n {
        [cos2[i], sin2[i], x[i], y[i]] = kernel::prepare(x[i], y[i], cos2[i], sin2[i]);
    }
}

/// Pairs to lists of their first and second numbers.
#[inline(always)]
fn apart(pairs: &[f32; 2 * CHUNK], first: &mut [f32], second: &mut [f32]) {
    for ((pair, a), b) in pairs.as_chunks::<2>().0.iter().zip(first).zip(second) {
        [*a, *b] = *pair;
    }
}

/// Stored numbers as f32.
fn plain(codes: &Codes, start: usize, out: &mut [f32]) {
    let n = out.len();
    match codes {
        Codes::U8(v) => {
            for (out, x) in out.iter_mut().zip(&v[start..][..n]) {
                *out = f32::from(*x);
            }
        }
        Codes::U16(v) => {
            for (out, x) in out.iter_mut().zip(&v[start..][..n]) {
                *out = f32::from(*x);
            }
        }
        Codes::F16(v) => v[start..][..n].convert_to_f32_slice(out),
        Codes::F32(v) => out.copy_from_slice(&v[start..][..n]),
    }
}

/// Every storage that is worth a look for a model: integers in each encoding, floats as they are; how the direction is stored only
/// where the model asks for it.
fn storages(model: Model) -> Vec<Storage> {
    let has_direction = !matches!(model, Model::Phong | Model::BlinnPhong);
    let axes = if has_direction {
        &AxisEncoding::ALL[..]
    } else {
        &[AxisEncoding::Double]
    };
    let mut all = Vec::new();
    for depth in Depth::ALL {
        let encodings = if depth.top().is_some() {
            &WidthEncoding::ALL[..]
        } else {
            &[WidthEncoding::Linear]
        };
        for &encoding in encodings {
            for &axis in axes {
                all.push(Storage {
                    widths: WidthStorage::new(depth, encoding),
                    axis: AxisStorage::new(depth, axis),
                });
            }
        }
    }
    all
}

/// Measures every way to evaluate a model. One step of `progress` each.
///
/// # Errors
/// When `progress` cancels.
pub(super) fn measure(effort: Effort, progress: &Progress<'_>) -> Result<Vec<KernelRow>> {
    let points = Points::new();
    let lobe = points.numbers::<4, Prepared>();
    let levels = math::levels();
    let mut cases = Cases {
        points: &points,
        lobe: &lobe,
        best: levels[levels.len() - 1],
        all: Vec::new(),
    };
    // Ward's half-vector form is printed without angles.
    cases.form::<3, TextbookAngles, Exact>();
    cases.form::<3, TextbookAngles, Duer>();
    cases.form::<3, TextbookAngles, Bounded>();
    cases.form::<3, TextbookAngles, Beckmann>();
    cases.form::<3, TextbookAngles, Ggx>();
    cases.directed::<HalfVector>();
    cases.directed::<Exact>();
    cases.directed::<Duer>();
    cases.directed::<Bounded>();
    cases.directed::<Beckmann>();
    cases.directed::<Ggx>();
    cases.round::<Phong>();
    cases.round::<BlinnPhong>();
    cases.own();
    for model in SPECULAR {
        for storage in storages(model) {
            cases.stored(model, storage);
        }
    }
    progress.expect(cases.all.len() as u64);
    let mut out = vec![0.0; POINTS];
    let mut rows = Vec::new();
    for case in cases.all {
        let (ns_min, ns_median) = time(effort, || (case.run)(black_box(&mut out)));
        let (max_rel, mean_rel) = points.errors(case.model, &out);
        rows.push(KernelRow {
            model: case.model.name(),
            form: case.form,
            exp: case.exp,
            storage: case.storage,
            bytes: case.bytes,
            level: case.level,
            ns_min,
            ns_median,
            max_rel,
            mean_rel,
        });
        progress.step()?;
    }
    Ok(rows)
}

/// Least and median nanoseconds per point.
fn time(effort: Effort, mut run: impl FnMut()) -> (f64, f64) {
    run();
    let started = Instant::now();
    let mut times = Vec::new();
    while times.len() < effort.rounds.max(1) && (times.len() < 3 || started.elapsed() < effort.time)
    {
        let start = Instant::now();
        run();
        times.push(start.elapsed().as_secs_f64() * 1e9 / POINTS as f64);
    }
    times.sort_by(f64::total_cmp);
    (times[0], times[times.len() / 2])
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::HashSet;

    #[test]
    fn every_form_gives_the_model_and_its_error_is_that_of_its_parts() {
        let effort = Effort {
            rounds: 1,
            time: Duration::ZERO,
        };
        let rows = measure(effort, &Progress::none()).unwrap();
        assert!(rows.len() > 350, "{}", rows.len());
        // Every model in every form, exponential and storage that means something to it.
        for model in SPECULAR {
            let of = |what: fn(&KernelRow) -> &str| -> HashSet<&str> {
                let own = rows.iter().filter(|r| r.model == model.name());
                own.map(what).collect()
            };
            let (forms, exps, storages) = (of(|r| r.form), of(|r| r.exp), of(|r| &r.storage));
            let (form, exp, storage) = match model {
                Model::Phong | Model::BlinnPhong => (4, 7, 8),
                Model::Ggx => (8, 1, 24),
                Model::Beckmann => (8, 7, 24),
                Model::Ward => (7, 6, 24),
                _ => (8, 6, 24),
            };
            assert_eq!(forms.len(), form, "{model}: {forms:?}");
            assert_eq!(exps.len(), exp, "{model}: {exps:?}");
            assert_eq!(storages.len(), storage, "{model}: {storages:?}");
        }
        for row in &rows {
            let name = format!("{row:?}");
            assert!(row.ns_min > 0.0 && row.ns_median >= row.ns_min, "{name}");
            assert!(row.mean_rel > 0.0 && row.max_rel > row.mean_rel, "{name}");
            // Beckmann's shadowing takes the exponential too.
            let times = if row.model == "beckmann" { 2.0 } else { 1.0 };
            let stated = match (row.form, row.exp, row.storage.as_str()) {
                ("decoded", _, storage) if storage.starts_with("u8") => 10.0,
                ("decoded", _, storage) if storage.starts_with("f16") => 0.2,
                ("decoded", _, storage) if storage.starts_with("u16") => 0.02,
                ("textbook angles", ..) => 2e-4,
                (_, "bit trick", _) => 0.031 * times,
                (_, "degree 2", _) => 1.8e-3 * times,
                (_, "degree 3", _) => 1.2e-4 * times,
                ("matrix M", ..) => 5e-5 * times,
                _ if row.model == "beckmann" => 1e-4,
                _ => 2e-5,
            };
            assert!(row.max_rel < stated, "{name}");
        }
        // The program's own kernels give the same bits at every level, so the same error.
        for row in rows.iter().filter(|r| r.level == "baseline") {
            let same =
                |r: &&KernelRow| r.model == row.model && r.form == "prepared" && r.exp == row.exp;
            assert!(rows.iter().filter(same).all(|r| r.max_rel == row.max_rel));
        }
    }
}
