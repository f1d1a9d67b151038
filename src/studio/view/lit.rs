//! The map as a flat surface seen straight from above, under light from one direction.

use super::levels::Averaged;
use crate::brdf::{Model, kernel};
use crate::map::{ALPHA_MAX, ALPHA_MIN};
use crate::math;
use crate::preview::{Material, srgb_from_linear};
use fearless_simd::{Simd, dispatch};
use fearless_simd_macros::simd;
use glam::Vec3;
use std::f32::consts::FRAC_1_PI;
use std::sync::LazyLock;

/// What lights the surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Lighting {
    /// Toward the light: x to the right, y up, z toward the viewer; any length but 0. From below the surface gives none.
    pub toward: Vec3,
    /// Irradiance of a surface that faces the light; 0 to 1e6.
    pub irradiance: f32,
    /// Ambient light; 0 to 1e6.
    pub ambient: f32,
    /// Stops by which the picture is made brighter; -16 to 16.
    pub exposure: f32,
    /// The reflection model.
    pub model: Model,
    /// The surface's colours.
    pub material: Material,
}

impl Default for Lighting {
    /// From the upper left, high enough for narrow lobes to be met.
    fn default() -> Self {
        Self {
            toward: Vec3::new(-0.30, 0.36, 0.88),
            irradiance: 2.6,
            ambient: 1.0,
            exposure: 0.0,
            model: Model::Ward,
            material: Material::default(),
        }
    }
}

/// Pixels at once.
const CHUNK: usize = 256;
type Lane = [f32; CHUNK];

/// What does not change from pixel to pixel.
pub(super) struct Lit {
    model: Model,
    light: [Lane; 3],
    view: [Lane; 3],
    /// Light that every pixel has, and what a unit of reflected light adds: linear RGB, exposure included.
    base: [f32; 3],
    specular: [f32; 3],
}

impl Lit {
    pub(super) fn new(lighting: &Lighting) -> Self {
        let toward = lighting.toward.normalize_or(Vec3::Z);
        let power = |x: f32| {
            if x.is_finite() {
                x.clamp(0.0, 1e6)
            } else {
                0.0
            }
        };
        let stops = if lighting.exposure.is_finite() {
            lighting.exposure.clamp(-16.0, 16.0)
        } else {
            0.0
        };
        let gain = math::exp2(stops);
        let (irradiance, ambient) = (power(lighting.irradiance), power(lighting.ambient));
        let Material {
            diffuse,
            specular,
            ambient: reflected,
        } = lighting.material;
        let facing = irradiance * FRAC_1_PI * toward.z.max(0.0);
        Self {
            model: lighting.model,
            light: toward.to_array().map(|c| [c; CHUNK]),
            view: [0.0, 0.0, 1.0].map(|c| [c; CHUNK]),
            base: [0, 1, 2].map(|c| gain * (diffuse[c] * facing + reflected[c] * ambient)),
            specular: specular.map(|s| gain * irradiance * s),
        }
    }

    pub(super) fn row(&self, seen: &[Averaged], rgba: &mut [u8]) {
        let codes = codes();
        let mut lobe = [[0.0; CHUNK]; 4];
        let mut reflected = [0.0; CHUNK];
        for (seen, rgba) in seen.chunks(CHUNK).zip(rgba.chunks_mut(4 * CHUNK)) {
            let n = seen.len();
            dispatch!(math::level(), simd => lobes(simd, seen, &mut lobe));
            let batch = kernel::Batch {
                light: self.light.each_ref().map(|l| &l[..n]),
                view: self.view.each_ref().map(|l| &l[..n]),
                lobe: lobe.each_ref().map(|l| &l[..n]),
            };
            kernel::shade(math::level(), self.model, &batch, &mut reflected[..n]);
            for (out, &f) in rgba.chunks_exact_mut(4).zip(&reflected) {
                let code = |c: usize| {
                    let light = self.base[c] + self.specular[c] * f;
                    // Casts saturate.
                    codes[((light.sqrt() * CODES as f32) as usize).min(CODES - 1)]
                };
                out.copy_from_slice(&[code(0), code(1), code(2), 255]);
            }
        }
    }
}

/// The mean lobe of what a pixel sees, prepared for the kernels.
#[simd]
fn lobes<S: Simd>(_: S, seen: &[Averaged], lobe: &mut [Lane; 4]) {
    let [cos, sin, rx, ry] = lobe;
    let n = seen.len().min(CHUNK);
    for i in 0..n {
        let [xx, yy, c, s] = seen[i];
        let length = (c * c + s * s).sqrt();
        let mean = 0.25 * (xx + yy);
        // x along the wide axis.
        let inverse = 1.0 / if length > 1e-20 { length } else { 1e-20 };
        let directed = length > 1e-20;
        let (c, s) = (
            if directed { c * inverse } else { 1.0 },
            if directed { s * inverse } else { 0.0 },
        );
        let prepared = kernel::prepare(width(mean + length), width(mean - length), c, s);
        cos[i] = prepared[0];
        sin[i] = prepared[1];
        rx[i] = prepared[2];
        ry[i] = prepared[3];
    }
}

#[inline(always)]
fn width(variance: f32) -> f32 {
    let variance = if variance > 0.0 { variance } else { 0.0 };
    let width = (2.0 * variance).sqrt();
    let width = if width < ALPHA_MIN { ALPHA_MIN } else { width };
    if width > ALPHA_MAX { ALPHA_MAX } else { width }
}

/// Steps of the root of linear light: everywhere finer than an 8-bit code.
const CODES: usize = 4096;

/// The sRGB code of each step.
fn codes() -> &'static [u8; CODES] {
    static TABLE: LazyLock<Box<[u8; CODES]>> = LazyLock::new(|| {
        let mut table = Box::new([0; CODES]);
        for (i, code) in table.iter_mut().enumerate() {
            let root = (i as f32 + 0.5) / CODES as f32;
            *code = (srgb_from_linear(root * root) * 255.0 + 0.5) as u8;
        }
        table
    });
    &TABLE
}
