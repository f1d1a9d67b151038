//! [`shade`](super::shade) for many pixels at once: one loop per model over slices, compiled for every CPU level.
//!
//! Inputs are packed, one array per component: directions in the tangent frame, and the lobe as a [`prepare`]d texel
//! (cos θ, sin θ, 1/alpha_x, 1/alpha_y), so that nothing in the loop is an angle or a division that could have been made
//! before. The choice of CPU level and of model is made once per batch. What the loops keep:
//!
//! - the half vector is turned to the texel's axis as a whole; Ward's family turns nothing else, since n.l and n.v do not
//!   change by it, and the models without an axis turn nothing at all;
//! - H stays at its own length, and f_r n.l is one expression with sqrt(n.l/n.v) or no root at all;
//! - the exponential is a polynomial of degree 5 ([`exp_5`]): a better one buys nothing, because the rounding of the
//!   exponent is larger than its error;
//! - no fused multiply-add and no reordering, so every level gives the same bits.
//!
//! The results follow [`shade`](super::shade) to the rounding of 1/alpha and of the exponent; both are held against f64. With
//! alphas of 0.05 and more and exponents up to 20 Ward's family is within 1e-5 of it for widths up to 10 apart, 3e-5 beyond.

use super::{ALPHA_FLOOR, COSINE_FLOOR, EXPONENT_MAX, Model, beckmann, blinn_phong, ggx, phong};
use crate::math::{self, half_angle};
use fearless_simd::{Level, Simd, dispatch};
use fearless_simd_macros::simd;
use glam::{Vec2, Vec3};
use std::f32::consts::{FRAC_1_PI, LOG2_E};

/// The degree of the polynomial in [`exp_5`].
pub const EXP_DEGREE: u32 = 5;

/// The degree of the polynomial that [`shade`] takes a model's exponential with, also where it is part of a power; none for a
/// model that has no exponential.
pub fn exp_degree(model: Model) -> Option<u32> {
    match model {
        Model::Ward | Model::WardExact | Model::WardDuer | Model::WardBounded => Some(EXP_DEGREE),
        Model::Beckmann | Model::Phong | Model::BlinnPhong => Some(math::EXP_DEGREE),
        Model::Ggx | Model::Lambert => None,
    }
}

/// What one light does to a batch of pixels. All slices have one length.
#[derive(Clone, Copy, Debug)]
pub struct Batch<'a> {
    /// Unit vectors toward the light, in each pixel's tangent frame: x along the tangent, z along the normal.
    pub light: [&'a [f32]; 3],
    /// Unit vectors toward the viewer, in the same frame.
    pub view: [&'a [f32]; 3],
    /// Prepared texels: cos θ, sin θ, 1/alpha_x, 1/alpha_y; see [`prepare`].
    pub lobe: [&'a [f32]; 4],
}

/// A texel as the kernels take it: (cos θ, sin θ, 1/alpha_x, 1/alpha_y) from the widths and the double angle of unit length.
/// Widths are raised to [`ALPHA_FLOOR`]; one that is NaN stays NaN and is lit as 0.
#[inline(always)]
pub fn prepare(alpha_x: f32, alpha_y: f32, cos2: f32, sin2: f32) -> [f32; 4] {
    let (c, s) = half_angle(cos2, sin2);
    let raised = |a: f32| if a < ALPHA_FLOOR { ALPHA_FLOOR } else { a };
    [c, s, 1.0 / raised(alpha_x), 1.0 / raised(alpha_y)]
}

/// The same from a double angle of any length down to [`AXIS_MIN_LENGTH`](crate::math::AXIS_MIN_LENGTH), with half of the
/// divisions.
#[inline(always)]
pub fn prepare_blend(alpha_x: f32, alpha_y: f32, cos2: f32, sin2: f32) -> [f32; 4] {
    // (|v| + |cos 2θ|, |sin 2θ|) lies along the half angle, and the square of its length is 2 |v| (|v| + |cos 2θ|).
    let length = (cos2 * cos2 + sin2 * sin2).sqrt();
    let along = length + cos2.abs();
    let inverse = 1.0 / (2.0 * length * along).sqrt();
    let (big, small) = (along * inverse, sin2.abs() * inverse);
    let sign = if sin2 < 0.0 { -1.0 } else { 1.0 };
    let right = cos2 >= 0.0;
    let c = if right { big } else { small };
    let s = sign * if right { small } else { big };
    let raised = |a: f32| if a < ALPHA_FLOOR { ALPHA_FLOOR } else { a };
    let (x, y) = (raised(alpha_x), raised(alpha_y));
    let both = 1.0 / (x * y);
    [c, s, y * both, x * both]
}

/// Writes f_r n.l of every pixel to `out`: at least 0 and finite for any numbers whatever, as [`shade`](super::shade).
///
/// # Panics
/// When a slice is not as long as `out`.
pub fn shade(level: Level, model: Model, batch: &Batch<'_>, out: &mut [f32]) {
    let n = out.len();
    let slices = batch.light.iter().chain(&batch.view).chain(&batch.lobe);
    assert!(
        slices.into_iter().all(|s| s.len() == n),
        "slices of one length"
    );
    match model {
        Model::Ward => dispatch!(level, simd => ward(simd, batch, out)),
        Model::WardExact => dispatch!(level, simd => ward_exact(simd, batch, out)),
        Model::WardDuer => dispatch!(level, simd => ward_duer(simd, batch, out)),
        Model::WardBounded => dispatch!(level, simd => ward_bounded(simd, batch, out)),
        Model::Beckmann => dispatch!(level, simd => beckmann(simd, batch, out)),
        Model::Ggx => dispatch!(level, simd => ggx(simd, batch, out)),
        Model::Phong => dispatch!(level, simd => phong(simd, batch, out)),
        Model::BlinnPhong => dispatch!(level, simd => blinn_phong(simd, batch, out)),
        Model::Lambert => out.fill(0.0),
    }
}

/// One pixel of Ward's family: H in the texel's axes with its slopes over the widths, and the cosines.
struct Half {
    /// (Hx/alpha_x)² + (Hy/alpha_y)².
    slopes: f32,
    /// Hx² + Hy².
    flat: f32,
    z: f32,
    /// n.l and n.v, the latter at least [`COSINE_FLOOR`].
    light: f32,
    view: f32,
    /// 1/(alpha_x alpha_y).
    density: f32,
}

/// Calls `form` for every pixel and makes its value safe. Selects only, no branch.
#[inline(always)]
fn each_half(batch: &Batch<'_>, out: &mut [f32], form: impl Fn(Half) -> f32) {
    let n = out.len();
    let [lx, ly, lz] = batch.light.map(|s| &s[..n]);
    let [vx, vy, vz] = batch.view.map(|s| &s[..n]);
    let [c, s, rx, ry] = batch.lobe.map(|s| &s[..n]);
    for i in 0..n {
        let (x, y) = (lx[i] + vx[i], ly[i] + vy[i]);
        // NaN passes through the floor and ends as 0.
        let view = if vz[i] < COSINE_FLOOR {
            COSINE_FLOOR
        } else {
            vz[i]
        };
        let p = (c[i] * x + s[i] * y) * rx[i];
        let q = (c[i] * y - s[i] * x) * ry[i];
        let value = form(Half {
            slopes: p * p + q * q,
            flat: x * x + y * y,
            z: lz[i] + view,
            light: lz[i],
            view,
            density: rx[i] * ry[i],
        });
        let lit = (lz[i] > 0.0) & (vz[i] > 0.0) & (value > 0.0) & (value < f32::INFINITY);
        out[i] = if lit { value } else { 0.0 };
    }
}

/// A scalar form, which is safe already, from l and v, Hx and Hy, and the widths. A trait and no closure: the inliner weighs a
/// closure with the form in it and leaves a long one outside of the loop, which then stays scalar.
trait Form {
    fn light(l: Vec3, v: Vec3, flat: Vec2, alpha: Vec2) -> f32;
}

struct Beckmann;

impl Form for Beckmann {
    #[inline(always)]
    fn light(l: Vec3, v: Vec3, flat: Vec2, alpha: Vec2) -> f32 {
        beckmann::shade_half(l, v, flat, alpha)
    }
}

struct Ggx;

impl Form for Ggx {
    #[inline(always)]
    fn light(l: Vec3, v: Vec3, flat: Vec2, alpha: Vec2) -> f32 {
        ggx::shade_half(l, v, flat, alpha)
    }
}

struct Phong;

impl Form for Phong {
    #[inline(always)]
    fn light(l: Vec3, v: Vec3, _: Vec2, alpha: Vec2) -> f32 {
        phong::shade(l, v, alpha)
    }
}

struct BlinnPhong;

impl Form for BlinnPhong {
    #[inline(always)]
    fn light(l: Vec3, v: Vec3, _: Vec2, alpha: Vec2) -> f32 {
        blinn_phong::shade(l, v, alpha)
    }
}

/// For the models that need l and v themselves in the texel's axes. Hx and Hy are summed up before they are turned: near the
/// peak l and v cancel, and each turned by itself would leave its rounding in place of the difference.
#[inline(always)]
fn each<F: Form>(batch: &Batch<'_>, out: &mut [f32]) {
    let n = out.len();
    let [lx, ly, lz] = batch.light.map(|s| &s[..n]);
    let [vx, vy, vz] = batch.view.map(|s| &s[..n]);
    let [c, s, rx, ry] = batch.lobe.map(|s| &s[..n]);
    for i in 0..n {
        let turned = |x: f32, y: f32| Vec2::new(c[i] * x + s[i] * y, c[i] * y - s[i] * x);
        out[i] = F::light(
            turned(lx[i], ly[i]).extend(lz[i]),
            turned(vx[i], vy[i]).extend(vz[i]),
            turned(lx[i] + vx[i], ly[i] + vy[i]),
            Vec2::new(1.0 / rx[i], 1.0 / ry[i]),
        );
    }
}

/// For the models that know no axis.
#[inline(always)]
fn each_round<F: Form>(batch: &Batch<'_>, out: &mut [f32]) {
    let n = out.len();
    let [lx, ly, lz] = batch.light.map(|s| &s[..n]);
    let [vx, vy, vz] = batch.view.map(|s| &s[..n]);
    let [_, _, rx, ry] = batch.lobe.map(|s| &s[..n]);
    for i in 0..n {
        out[i] = F::light(
            Vec3::new(lx[i], ly[i], lz[i]),
            Vec3::new(vx[i], vy[i], vz[i]),
            Vec2::new(lx[i] + vx[i], ly[i] + vy[i]),
            Vec2::new(1.0 / rx[i], 1.0 / ry[i]),
        );
    }
}

/// e^-k, 0 beyond [`EXPONENT_MAX`].
#[inline(always)]
fn lobe(k: f32) -> f32 {
    let inside = k < EXPONENT_MAX;
    // NaN fails the test too, and the caller's own test then meets the NaN of its other factors or this 0.
    if inside { exp_5(-k) } else { 0.0 }
}

/// e^x for x in [-87, 88] and no clamp: 2^n times a minimax polynomial of degree 5 on |r| <= ln 2 / 2. Relative error 2.5e-7,
/// of which the polynomial has 7.6e-8.
#[inline(always)]
pub fn exp_5(x: f32) -> f32 {
    const ROUND: f32 = 12_582_912.0;
    let shifted = x * LOG2_E + ROUND;
    let n = shifted - ROUND;
    let r = (x - n * 0.693_359_4) - n * -2.121_944_4e-4;
    let p = 8.297_619e-3;
    let p = p * r + 4.191_563e-2;
    let p = p * r + 0.166_675_76;
    let p = p * r + 0.499_988_9;
    let p = p * r + 0.999_999_7;
    let p = p * r + 1.000_000_1;
    f32::from_bits(p.to_bits().wrapping_add(shifted.to_bits() << 23))
}

#[simd]
fn ward<S: Simd>(_: S, batch: &Batch<'_>, out: &mut [f32]) {
    each_half(batch, out, |h| {
        let length = (h.flat + h.z * h.z).sqrt();
        let k = 2.0 * h.slopes / (length * (length + h.z));
        0.25 * FRAC_1_PI * h.density * (h.light / h.view).sqrt() * lobe(k)
    });
}

#[simd]
fn ward_exact<S: Simd>(_: S, batch: &Batch<'_>, out: &mut [f32]) {
    each_half(batch, out, |h| {
        let k = h.slopes / (h.z * h.z);
        0.25 * FRAC_1_PI * h.density * (h.light / h.view).sqrt() * lobe(k)
    });
}

#[simd]
fn ward_duer<S: Simd>(_: S, batch: &Batch<'_>, out: &mut [f32]) {
    each_half(batch, out, |h| {
        let k = h.slopes / (h.z * h.z);
        0.25 * FRAC_1_PI * h.density / h.view * lobe(k)
    });
}

#[simd]
fn ward_bounded<S: Simd>(_: S, batch: &Batch<'_>, out: &mut [f32]) {
    each_half(batch, out, |h| {
        let z2 = h.z * h.z;
        let stretch = (h.flat + z2) / z2 / z2;
        FRAC_1_PI * h.density * stretch * h.light * lobe(h.slopes / z2)
    });
}

#[simd]
fn beckmann<S: Simd>(_: S, batch: &Batch<'_>, out: &mut [f32]) {
    each::<Beckmann>(batch, out);
}

#[simd]
fn ggx<S: Simd>(_: S, batch: &Batch<'_>, out: &mut [f32]) {
    each::<Ggx>(batch, out);
}

#[simd]
fn phong<S: Simd>(_: S, batch: &Batch<'_>, out: &mut [f32]) {
    each_round::<Phong>(batch, out);
}

#[simd]
fn blinn_phong<S: Simd>(_: S, batch: &Batch<'_>, out: &mut [f32]) {
    each_round::<BlinnPhong>(batch, out);
}

#[cfg(test)]
mod tests {
    use super::super::{shade as shade_one, shade_f64};
    use super::*;
    use crate::math::{self, Axis, levels};
    use glam::{DVec2, DVec3};

    const MODELS: [Model; 8] = [
        Model::Ward,
        Model::WardExact,
        Model::WardDuer,
        Model::WardBounded,
        Model::Beckmann,
        Model::Ggx,
        Model::Phong,
        Model::BlinnPhong,
    ];

    /// Pixels in arrays of their own: light 0..3, view 3..6, lobe 6..10.
    struct Pixels {
        arrays: [Vec<f32>; 10],
    }

    impl Pixels {
        fn new(pixels: impl Iterator<Item = [f32; 10]>) -> Self {
            let mut arrays = [const { Vec::new() }; 10];
            for pixel in pixels {
                for (array, x) in arrays.iter_mut().zip(pixel) {
                    array.push(x);
                }
            }
            Self { arrays }
        }

        fn shade(&self, level: Level, model: Model) -> Vec<f32> {
            let a = |i: usize| &self.arrays[i][..];
            let batch = Batch {
                light: [0, 1, 2].map(a),
                view: [3, 4, 5].map(a),
                lobe: [6, 7, 8, 9].map(a),
            };
            let mut out = vec![f32::NAN; self.arrays[0].len()];
            shade(level, model, &batch, &mut out);
            out
        }
    }

    /// Numbers in [0, 1) that depend on `i` alone.
    fn random(i: u32, channel: u32) -> f32 {
        let mut h = (i.wrapping_mul(16).wrapping_add(channel)).wrapping_mul(0x9e37_79b9);
        h ^= h >> 16;
        h = h.wrapping_mul(0x85eb_ca6b);
        h ^= h >> 13;
        h = h.wrapping_mul(0xc2b2_ae35);
        ((h ^ (h >> 16)) >> 8) as f32 / 16_777_216.0
    }

    /// A view, and a light near its mirror direction so that lobes are hit at every exponent; with the texel's angle and
    /// widths.
    fn case(i: u32) -> (Vec3, Vec3, f32, Vec2) {
        let up = |z: f32, turn: f32| {
            let (s, c) = math::sin_cos(std::f32::consts::TAU * turn);
            let r = (1.0 - z * z).max(0.0).sqrt();
            Vec3::new(r * c, r * s, z)
        };
        let v = up(0.05 + 0.95 * random(i, 0), random(i, 1));
        let alpha = |channel| math::exp(0.05f32.ln() + random(i, channel) * 3.0);
        let alpha = Vec2::new(alpha(2), alpha(3));
        let reach = 2.0 * random(i, 4) * alpha.max_element();
        let l = Vec3::new(-v.x, -v.y, v.z) + up(0.0, random(i, 5)) * reach;
        let l = l.with_z(l.z.abs().max(0.02)).normalize();
        (l, v, std::f32::consts::PI * random(i, 6), alpha)
    }

    fn cases(n: u32) -> Pixels {
        Pixels::new((0..n).map(|i| {
            let (l, v, theta, alpha) = case(i);
            let (sin2, cos2) = math::sin_cos(2.0 * theta);
            let [c, s, rx, ry] = prepare(alpha.x, alpha.y, cos2, sin2);
            [l.x, l.y, l.z, v.x, v.y, v.z, c, s, rx, ry]
        }))
    }

    #[test]
    fn exp_5_stays_inside_its_error() {
        for i in 0..200_000 {
            let x = -87.0 + 175.0 * i as f32 / 2e5;
            let want = f64::from(x).exp();
            let error = (f64::from(exp_5(x)) / want - 1.0).abs();
            assert!(error < 2.5e-7, "{x}: {error}");
        }
    }

    #[test]
    fn every_level_gives_the_same_bits() {
        // Odd lengths, so that the loops' tails are met too; and pixels of any bits whatever.
        let strange = Pixels::new((0..4001).map(|i| {
            [0, 1, 2, 3, 4, 5, 6, 7, 8, 9].map(|c| f32::from_bits((random(i, c) * 4.29e9) as u32))
        }));
        for pixels in [cases(4097), strange] {
            for model in MODELS {
                let bits = |level| -> Vec<u32> {
                    pixels
                        .shade(level, model)
                        .iter()
                        .map(|x| x.to_bits())
                        .collect()
                };
                let want = bits(Level::baseline());
                for (name, level) in levels() {
                    assert!(bits(level) == want, "{model} at {name}");
                }
            }
        }
    }

    #[test]
    fn no_bits_whatever_give_a_bad_value() {
        let specials = [
            0.0,
            -0.0,
            1e-45,
            1e-38,
            1.0,
            -1.0,
            3e38,
            f32::INFINITY,
            f32::NEG_INFINITY,
            f32::NAN,
        ];
        let pixels = Pixels::new((0..200_000).map(|i| {
            [0, 1, 2, 3, 4, 5, 6, 7, 8, 9].map(|c| {
                let r = random(i, c);
                if r < 0.6 {
                    f32::from_bits((random(i, c + 3) * 4.29e9) as u32)
                } else {
                    specials[((r - 0.6) * 25.0) as usize % specials.len()]
                }
            })
        }));
        for model in MODELS {
            let out = pixels.shade(math::level(), model);
            assert!(out.iter().all(|x| x.is_finite() && *x >= 0.0), "{model}");
        }
    }

    #[test]
    fn the_batch_follows_the_one() {
        let pixels = cases(100_000);
        for model in MODELS {
            let out = pixels.shade(math::level(), model);
            for (i, got) in out.into_iter().enumerate() {
                let at = |k: usize| pixels.arrays[k][i];
                let (c, s) = (at(6), at(7));
                let turned = |x: f32, y: f32, z: f32| Vec3::new(c * x + s * y, c * y - s * x, z);
                let l = turned(at(0), at(1), at(2));
                let v = turned(at(3), at(4), at(5));
                let want = shade_one(model, l, v, Vec2::new(1.0 / at(8), 1.0 / at(9)));
                // A few roundings, which the exponent multiplies; 1e-6 is no light.
                let few = 6e-5 * want + 1e-6;
                assert!((got - want).abs() <= few, "{model} {i}: {got} {want}");
            }
        }
    }

    #[test]
    fn a_blend_is_prepared_as_what_it_settles_to() {
        for i in 0..5000 {
            let (x, y) = (0.001 + 1.4 * random(i, 0), 0.001 + 1.4 * random(i, 1));
            let axis = Axis::from_radians(7.0 * random(i, 2));
            let length = 0.001 + random(i, 3);
            let want = prepare(x, y, axis.cos2, axis.sin2);
            let got = prepare_blend(x, y, axis.cos2 * length, axis.sin2 * length);
            for k in 0..4 {
                let error = (got[k] - want[k]).abs();
                assert!(error <= 4e-7 * want[k].abs().max(0.5), "{got:?} {want:?}");
            }
        }
    }

    #[test]
    fn ward_holds_the_stated_error() {
        let pixels = cases(200_000);
        for model in [
            Model::Ward,
            Model::WardExact,
            Model::WardDuer,
            Model::WardBounded,
        ] {
            let out = pixels.shade(math::level(), model);
            let mut compared = 0;
            for (i, got) in out.into_iter().enumerate() {
                let at = |k: usize| f64::from(pixels.arrays[k][i]);
                let (c, s) = (at(6), at(7));
                let turned = |x: f64, y: f64, z: f64| DVec3::new(c * x + s * y, c * y - s * x, z);
                let l = turned(at(0), at(1), at(2));
                let v = turned(at(3), at(4), at(5));
                let alpha = DVec2::new(1.0 / at(8), 1.0 / at(9));
                let h = l + v;
                let k = ((h.x / alpha.x).powi(2) + (h.y / alpha.y).powi(2)) / (h.z * h.z);
                if k > 20.0 {
                    continue;
                }
                let want = shade_f64(model, l, v, alpha);
                let error = (f64::from(got) / want - 1.0).abs();
                // Turning H to a groove subtracts its components; a ratio of widths multiplies what that rounds away.
                let ratio = alpha.max_element() / alpha.min_element();
                let stated = if ratio <= 10.0 { 1e-5 } else { 3e-5 };
                assert!(error < stated, "{model} {i}, k {k}, ratio {ratio}: {error}");
                compared += 1;
            }
            assert!(compared > 100_000, "{model}: {compared}");
        }
    }
}
