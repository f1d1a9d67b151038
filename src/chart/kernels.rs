//! What one evaluation of a model costs and how far it is from f64: models, forms, exponentials, storage of the texels.
//!
//! The points are 32768 pairs of light and view, each with a texel of its own, as a picture meets them: alpha_x 0.05 to 0.15,
//! alpha_y 0.2 to 0.5, any direction, light near the mirrored view. Directions are f32; texels are made in f64 and rounded once
//! to the numbers that a form takes, so errors of storage and of arithmetic are seen together. Errors are relative to the
//! f64 model where the exponent is at most 20; beyond, a lobe has no light. One thread; the least time of many rounds counts,
//! since whatever else the machine does only adds to it.

use super::forms::{
    self, BitTrick, Bounded, Degree, Directions, Duer, Exact, Exponential, Family, HalfVector, Libm,
};
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

    /// A number of every texel, made in f64 and rounded once.
    fn numbers<const T: usize>(&self, of: impl Fn(DVec2, f64) -> [f64; T]) -> [Vec<f32>; T] {
        let mut lists = [const { Vec::new() }; T];
        for &(alpha, theta) in &self.texels {
            for (list, x) in lists.iter_mut().zip(of(alpha, theta)) {
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

/// The numbers that each form takes of a texel.
struct Lists {
    angle: [Vec<f32>; 3],
    double: [Vec<f32>; 4],
    prepared: [Vec<f32>; 4],
    factor: [Vec<f32>; 5],
    precision: [Vec<f32>; 4],
}

impl Lists {
    fn new(points: &Points) -> Self {
        Self {
            angle: points.numbers(|a, t| [a.x, a.y, t]),
            double: points.numbers(|a, t| [a.x, a.y, (2.0 * t).cos(), (2.0 * t).sin()]),
            prepared: points.numbers(|a, t| [t.cos(), t.sin(), 1.0 / a.x, 1.0 / a.y]),
            factor: points.numbers(|a, t| {
                let (s, c) = t.sin_cos();
                [c / a.x, s / a.x, -s / a.y, c / a.y, 1.0 / (a.x * a.y)]
            }),
            precision: points.numbers(|a, t| {
                let (s, c) = t.sin_cos();
                let (x, y) = (1.0 / (a.x * a.x), 1.0 / (a.y * a.y));
                [
                    c * c * x + s * s * y,
                    c * s * (x - y),
                    s * s * x + c * c * y,
                    1.0 / (a.x * a.y),
                ]
            }),
        }
    }
}

fn slices<const T: usize>(lists: &[Vec<f32>; T]) -> [&[f32]; T] {
    lists.each_ref().map(Vec::as_slice)
}

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
    lists: &'a Lists,
    best: (&'static str, Level),
    all: Vec<Case<'a>>,
}

impl<'a> Cases<'a> {
    fn add(
        &mut self,
        (model, form, exp): (Model, &'static str, &'static str),
        numbers: usize,
        level: &'static str,
        run: impl Fn(&mut [f32]) + 'a,
    ) {
        self.all.push(Case {
            model,
            form,
            exp,
            storage: "f32".into(),
            bytes: 4 * numbers,
            level,
            run: Box::new(run),
        });
    }

    /// Forms that are written with calls, one point after the other.
    fn scalar(&mut self) {
        let (d, texel) = (self.points.directions(), slices(&self.lists.angle));
        let name = |form| (Model::WardExact, form, Libm::NAME);
        self.add(name("textbook angles"), 3, "scalar", move |out| {
            forms::textbook(d, texel, out);
        });
        self.add(name("angle, scalar"), 3, "scalar", move |out| {
            forms::angle_libm(d, texel, out);
        });
    }

    /// Every form of exact Ward with one exponential.
    fn exact_forms<E: Exponential>(&mut self) {
        let (d, lists, (name, level)) = (self.points.directions(), self.lists, self.best);
        let what = |form| (Model::WardExact, form, E::NAME);
        let texel = slices(&lists.angle);
        self.add(what("angle"), 3, name, move |out| {
            forms::angle::<E>(level, d, texel, out);
        });
        let texel = slices(&lists.double);
        self.add(what("double angle"), 4, name, move |out| {
            forms::double_angle::<E>(level, d, texel, out);
        });
        let texel = slices(&lists.factor);
        self.add(what("W factor"), 5, name, move |out| {
            forms::factor::<E>(level, d, texel, out);
        });
        let texel = slices(&lists.precision);
        self.add(what("matrix M"), 4, name, move |out| {
            forms::precision::<E>(level, d, texel, out);
        });
    }

    /// A model on prepared texels with one exponential.
    fn prepared<F: Family, E: Exponential>(&mut self) {
        let (d, (name, level)) = (self.points.directions(), self.best);
        let texel = slices(&self.lists.prepared);
        self.add((F::MODEL, "prepared", E::NAME), 4, name, move |out| {
            forms::prepared::<F, E>(level, d, texel, out);
        });
    }

    fn family<F: Family>(&mut self) {
        self.prepared::<F, BitTrick>();
        self.prepared::<F, Degree<2>>();
        self.prepared::<F, Degree<3>>();
        self.prepared::<F, Degree<4>>();
        self.prepared::<F, Libm>();
    }

    /// The program's own kernels at every CPU level.
    fn own(&mut self) {
        let (light, view) = self.points.directions();
        let lobe = slices(&self.lists.prepared);
        let batch = Batch { light, view, lobe };
        for model in Model::ALL.into_iter().filter(|m| *m != Model::Lambert) {
            let exp = match model {
                Model::Ggx => "none",
                Model::Ward | Model::WardExact | Model::WardDuer | Model::WardBounded => "degree 5",
                _ => "degree 7",
            };
            for (name, level) in math::levels() {
                self.add((model, "prepared", exp), 4, name, move |out| {
                    kernel::shade(level, model, &batch, out);
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
            exp: if model == Model::Ggx {
                "none"
            } else {
                "degree 5"
            },
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

/// Every storage that is worth a look: integers in each encoding, floats as they are.
pub(super) fn storages() -> Vec<Storage> {
    let mut all = Vec::new();
    for depth in Depth::ALL {
        let encodings = if depth.top().is_some() {
            &WidthEncoding::ALL[..]
        } else {
            &[WidthEncoding::Linear]
        };
        for &encoding in encodings {
            for axis in AxisEncoding::ALL {
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
    let lists = Lists::new(&points);
    let levels = math::levels();
    let mut cases = Cases {
        points: &points,
        lists: &lists,
        best: levels[levels.len() - 1],
        all: Vec::new(),
    };
    cases.scalar();
    cases.exact_forms::<BitTrick>();
    cases.exact_forms::<Degree<2>>();
    cases.exact_forms::<Degree<3>>();
    cases.exact_forms::<Degree<4>>();
    cases.exact_forms::<Degree<5>>();
    cases.exact_forms::<Libm>();
    cases.family::<HalfVector>();
    cases.family::<Exact>();
    cases.family::<Duer>();
    cases.family::<Bounded>();
    cases.own();
    for storage in storages() {
        for model in [Model::Ward, Model::WardExact, Model::Ggx] {
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

    #[test]
    fn every_form_gives_the_model_and_its_error_is_that_of_its_parts() {
        let effort = Effort {
            rounds: 1,
            time: Duration::ZERO,
        };
        let rows = measure(effort, &Progress::none()).unwrap();
        assert!(rows.len() > 120, "{}", rows.len());
        for row in &rows {
            let name = format!("{row:?}");
            assert!(row.ns_min > 0.0 && row.ns_median >= row.ns_min, "{name}");
            assert!(row.mean_rel > 0.0 && row.max_rel > row.mean_rel, "{name}");
            let stated = match (row.form, row.exp, row.storage.as_str()) {
                ("decoded", _, storage) if storage.starts_with("u8") => 10.0,
                ("decoded", _, storage) if storage.starts_with("f16") => 0.2,
                ("decoded", _, storage) if storage.starts_with("u16") => 0.02,
                ("textbook angles", ..) => 2e-4,
                (_, "bit trick", _) => 0.031,
                (_, "degree 2", _) => 1.8e-3,
                (_, "degree 3", _) => 1.2e-4,
                ("matrix M", ..) => 5e-5,
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
