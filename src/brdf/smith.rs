//! Height-correlated Smith shadowing for anisotropic slopes, shared by the two microfacet models.
//!
//! ```text
//! G = 1/(1 + L(l) + L(v))          a(w) = wz/s(w),  s(w) = sqrt((alpha_x wx)² + (alpha_y wy)²)
//! Beckmann: L = (exp(-a²)/(a sqrt(pi)) - erfc(a))/2          GGX: L = (sqrt(1 + 1/a²) - 1)/2
//! ```
//!
//! Source: B. Walter et al., "Microfacet models for refraction through rough surfaces", EGSR 2007; E. Heitz, "Understanding
//! the masking-shadowing function in microfacet-based BRDFs", JCGT 3(2), 2014 (correlation and anisotropic a).
//! The common rational fit of Beckmann's L is off by 0.3 %, and the uncorrelated product of two G1 by 32 % in the mirror
//! direction at 85° (GGX, alpha 0.3); neither is used.
//!
//! What the models need is G/(4 n.l n.v). Multiplied through, no small number is divided by:
//!
//! ```text
//! GGX:       1/(2 (n.v sqrt(n.l² + s(l)²) + n.l sqrt(n.v² + s(v)²)))
//! Beckmann:  1/(4 n.l n.v + (2/sqrt(pi)) (g(l) s(l) n.v + g(v) s(v) n.l))       g = exp(-a²) - a sqrt(pi) erfc(a)
//! ```

use crate::math;
use glam::{DVec2, DVec3, Vec2, Vec3};
use std::f64::consts::{FRAC_2_SQRT_PI, PI};

#[inline(always)]
fn squared_spread(w: Vec3, alpha: Vec2) -> f32 {
    let (x, y) = (alpha.x * w.x, alpha.y * w.y);
    x * x + y * y
}

fn squared_spread_f64(w: DVec3, alpha: DVec2) -> f64 {
    let (x, y) = (alpha.x * w.x, alpha.y * w.y);
    x * x + y * y
}

/// G/(4 n.l n.v) of the GGX surface.
#[inline(always)]
pub(super) fn ggx_visibility(l: Vec3, v: Vec3, alpha: Vec2) -> f32 {
    let root = |w: Vec3| (w.z * w.z + squared_spread(w, alpha)).sqrt();
    0.5 / (v.z * root(l) + l.z * root(v))
}

pub(super) fn ggx_visibility_f64(l: DVec3, v: DVec3, alpha: DVec2) -> f64 {
    let root = |w: DVec3| (w.z * w.z + squared_spread_f64(w, alpha)).sqrt();
    0.5 / (v.z * root(l) + l.z * root(v))
}

/// G/(4 n.l n.v) of the Beckmann surface.
#[inline(always)]
pub(super) fn beckmann_visibility(l: Vec3, v: Vec3, alpha: Vec2) -> f32 {
    let sum = beckmann_shadow(l, alpha) * v.z + beckmann_shadow(v, alpha) * l.z;
    1.0 / (4.0 * l.z * v.z + std::f32::consts::FRAC_2_SQRT_PI * sum)
}

/// g(w) s(w).
#[inline(always)]
fn beckmann_shadow(w: Vec3, alpha: Vec2) -> f32 {
    let s = squared_spread(w, alpha).sqrt();
    s * beckmann_gain(w.z / s)
}

pub(super) fn beckmann_visibility_f64(l: DVec3, v: DVec3, alpha: DVec2) -> f64 {
    let shadow = |w: DVec3| {
        let s = squared_spread_f64(w, alpha).sqrt();
        s * beckmann_gain_f64(w.z / s)
    };
    let sum = shadow(l) * v.z + shadow(v) * l.z;
    1.0 / (4.0 * l.z * v.z + FRAC_2_SQRT_PI * sum)
}

/// g(a) = exp(-a²) - a sqrt(pi) erfc(a) for a >= 0, also infinite: from 1 down to 0. Absolute error 6e-7.
#[inline(always)]
fn beckmann_gain(a: f32) -> f32 {
    scaled_beckmann_gain(a) * math::exp(-a * a)
}

/// exp(a²) g(a), which is smooth in t = 1/(1 + 0.4 a), and that maps all of a to (0, 1]: a minimax polynomial of degree 9, error
/// 1.9e-7.
#[inline(always)]
pub(crate) fn scaled_beckmann_gain(a: f32) -> f32 {
    let t = 1.0 / (1.0 + 0.4 * a);
    let p = 0.232_260_8;
    let p = p * t - 1.076_294_7;
    let p = p * t + 1.640_817_2;
    let p = p * t - 0.856_304_2;
    let p = p * t + 0.700_047_7;
    let p = p * t + 0.103_359_67;
    let p = p * t + 0.177_394_84;
    let p = p * t + 0.078_679_64;
    let p = p * t + 3.934_807e-5;
    p * t - 1.960_791e-7
}

fn beckmann_gain_f64(a: f64) -> f64 {
    if a < 6.0 {
        (-a * a).exp() - a * PI.sqrt() * erfc(a)
    } else {
        0.0 // below 1e-17
    }
}

/// The complementary error function for 0 <= x < 6, absolute error 1e-15: a series of positive terms (Abramowitz and
/// Stegun 7.1.6).
fn erfc(x: f64) -> f64 {
    let mut term = x * FRAC_2_SQRT_PI * (-x * x).exp();
    let mut sum = term;
    let mut odd = 1.0;
    while term > 1e-17 * sum {
        odd += 2.0;
        term *= 2.0 * x * x / odd;
        sum += term;
    }
    1.0 - sum
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn erfc_has_its_known_values() {
        for (x, want) in [
            (0.0, 1.0),
            (0.5, 0.479_500_122_186_953_5),
            (1.0, 0.157_299_207_050_285_13),
            (2.0, 0.004_677_734_981_047_266),
            (5.0, 1.537_459_794_428_035e-12),
        ] {
            assert!((erfc(x) - want).abs() < 2e-15, "{x}: {}", erfc(x));
        }
    }

    #[test]
    fn the_fast_gain_follows_the_exact_one() {
        let worst = (0..200_000)
            .map(|i| i as f32 * 4e-5)
            .map(|a| (f64::from(beckmann_gain(a)) - beckmann_gain_f64(f64::from(a))).abs())
            .fold(0.0, f64::max);
        assert!(worst < 6e-7, "{worst}");
        assert!(beckmann_gain(f32::INFINITY).abs() < 1e-30);
        assert_eq!(beckmann_gain_f64(f64::INFINITY), 0.0);
    }

    /// Against the definition, G/(4 n.l n.v) with G from the two L.
    #[test]
    fn the_multiplied_form_is_the_definition() {
        let (l, v) = (
            DVec3::new(0.5, -0.3, 0.2).normalize(),
            DVec3::new(-0.4, 0.8, 0.5).normalize(),
        );
        let alpha = DVec2::new(0.3, 0.8);
        let a = |w: DVec3| w.z / squared_spread_f64(w, alpha).sqrt();
        let ggx = |a: f64| 0.5 * ((1.0 + 1.0 / (a * a)).sqrt() - 1.0);
        let beckmann = |a: f64| 0.5 * ((-a * a).exp() / (a * PI.sqrt()) - erfc(a));
        let visibility = |lambda: &dyn Fn(f64) -> f64| {
            1.0 / (1.0 + lambda(a(l)) + lambda(a(v))) / (4.0 * l.z * v.z)
        };
        assert!((ggx_visibility_f64(l, v, alpha) / visibility(&ggx) - 1.0).abs() < 1e-14);
        assert!((beckmann_visibility_f64(l, v, alpha) / visibility(&beckmann) - 1.0).abs() < 1e-14);
    }
}
