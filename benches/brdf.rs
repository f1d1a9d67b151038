//! What one evaluation of a model costs, and how far it is from f64.
//!
//! Run with `cargo bench --bench brdf`. One line per case and CPU level:
//! `case=ward-map exp=5 level=avx2 threads=1 ns_min=… ns_median=… max_rel=…`. `exp` is the degree of the polynomial that the
//! exponential is taken with, `none` for a model without one; a single call (`scalar`) takes a better one. A case `MODEL-map` evaluates one light on pixels that
//! each have their own directions and their own prepared texel, all f32; the working set (1.4 MB) is larger than a core's
//! first cache. `max_rel` is the largest error relative to f64 of the same f32 inputs where the exponent is at most 20; the
//! alphas are 0.05 and more.

use anisomap::brdf::kernel::{self, Batch, exp_degree};
use anisomap::brdf::{Model, shade, shade_f64};
use anisomap::math::{self, levels, sin_cos};
use fearless_simd::Level;
use glam::{DVec2, DVec3, Vec2, Vec3};
use std::time::Instant;

const PIXELS: usize = 1 << 15;
const ROUNDS: usize = 200;

/// Light 0..3, view 3..6, lobe 6..10.
struct Pixels {
    arrays: [Vec<f32>; 10],
}

impl Pixels {
    fn new() -> Self {
        let mut state = 1u32;
        let mut random = move || {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (state >> 8) as f32 / 16_777_216.0
        };
        let mut arrays = [const { Vec::new() }; 10];
        for _ in 0..PIXELS {
            let up = |z: f32, turn: f32| {
                let (s, c) = sin_cos(std::f32::consts::TAU * turn);
                let r = (1.0 - z * z).max(0.0).sqrt();
                Vec3::new(r * c, r * s, z)
            };
            let v = up(0.05 + 0.95 * random(), random());
            let alpha = Vec2::new(0.05 + 0.1 * random(), 0.2 + 0.3 * random());
            let l = Vec3::new(-v.x, -v.y, v.z) + up(0.0, random()) * random();
            let l = l.with_z(l.z.abs().max(0.02)).normalize();
            let (sin2, cos2) = sin_cos(std::f32::consts::TAU * random());
            let [c, s, rx, ry] = kernel::prepare(alpha.x, alpha.y, cos2, sin2);
            let pixel = [l.x, l.y, l.z, v.x, v.y, v.z, c, s, rx, ry];
            for (array, x) in arrays.iter_mut().zip(pixel) {
                array.push(x);
            }
        }
        Self { arrays }
    }

    fn batch(&self) -> Batch<'_> {
        let a = |i: usize| &self.arrays[i][..];
        Batch {
            light: [0, 1, 2].map(a),
            view: [3, 4, 5].map(a),
            lobe: [6, 7, 8, 9].map(a),
        }
    }

    /// (l, v, alpha) of a pixel in the texel's own axes.
    fn local(&self, i: usize) -> (DVec3, DVec3, DVec2) {
        let at = |k: usize| f64::from(self.arrays[k][i]);
        let (c, s) = (at(6), at(7));
        let turned = |x: f64, y: f64, z: f64| DVec3::new(c * x + s * y, c * y - s * x, z);
        (
            turned(at(0), at(1), at(2)),
            turned(at(3), at(4), at(5)),
            DVec2::new(1.0 / at(8), 1.0 / at(9)),
        )
    }

    /// The largest relative error where the exponent is at most 20.
    fn worst(&self, model: Model, out: &[f32]) -> f64 {
        (0..PIXELS)
            .map(|i| {
                let (l, v, alpha) = self.local(i);
                let h = l + v;
                let k = ((h.x / alpha.x).powi(2) + (h.y / alpha.y).powi(2)) / (h.z * h.z);
                let want = shade_f64(model, l, v, alpha);
                let counts = k <= 20.0 && want > 1e-9;
                if counts {
                    (f64::from(out[i]) / want - 1.0).abs()
                } else {
                    0.0
                }
            })
            .fold(0.0, f64::max)
    }
}

/// Least and median nanoseconds per evaluation.
fn time(mut run: impl FnMut()) -> (f64, f64) {
    let mut times: Vec<f64> = (0..ROUNDS)
        .map(|_| {
            let start = Instant::now();
            run();
            start.elapsed().as_secs_f64() * 1e9 / PIXELS as f64
        })
        .collect();
    times.sort_by(f64::total_cmp);
    (times[0], times[ROUNDS / 2])
}

/// A degree, or that there is no exponential.
fn word(degree: Option<u32>) -> String {
    degree.map_or_else(|| "none".to_owned(), |d| d.to_string())
}

fn batch_case(pixels: &Pixels, model: Model, name: &str, level: Level) {
    let batch = pixels.batch();
    let mut out = vec![0.0; PIXELS];
    let (min, median) =
        time(|| kernel::shade(level, model, &batch, std::hint::black_box(&mut out)));
    println!(
        "case={model}-map exp={} level={name} threads=1 ns_min={min:.3} ns_median={median:.3} max_rel={:.2e}",
        word(exp_degree(model)),
        pixels.worst(model, &out)
    );
}

/// The same work, one call per pixel.
fn scalar_case(pixels: &Pixels, model: Model) {
    let local: Vec<_> = (0..PIXELS)
        .map(|i| pixels.local(i))
        .map(|(l, v, alpha)| (l.as_vec3(), v.as_vec3(), alpha.as_vec2()))
        .collect();
    let mut out = vec![0.0; PIXELS];
    let (min, median) = time(|| {
        for (out, &(l, v, alpha)) in out.iter_mut().zip(&local) {
            *out = std::hint::black_box(shade(model, l, v, alpha));
        }
    });
    println!(
        "case={model}-map exp={} level=scalar threads=1 ns_min={min:.3} ns_median={median:.3} max_rel={:.2e}",
        word(exp_degree(model).map(|_| math::EXP_DEGREE)),
        pixels.worst(model, &out)
    );
}

fn main() {
    let pixels = Pixels::new();
    for model in Model::ALL.into_iter().filter(|m| *m != Model::Lambert) {
        scalar_case(&pixels, model);
        for (name, level) in levels() {
            batch_case(&pixels, model, name, level);
        }
    }
}
