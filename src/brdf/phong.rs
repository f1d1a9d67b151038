//! Phong, normalised: an isotropic lobe around the mirrored light (Phong 1975).
//!
//! ```text
//! f_r = (n + 2)/(2 pi) max(r.v, 0)^n          r = (-lx, -ly, lz),  n = (2/alpha² - 2)/4, at least 0
//! ```
//!
//! A quarter of Blinn's exponent, since r.v sees twice the angle that h.n does. Unequal widths are taken together as
//! [`blinn_phong`] takes them. The norm makes the albedo 1 at normal incidence; from there it falls
//! about as cos theta, as Ward's does.
//!
//! r.v = 1 - |r - v|²/2, and the difference has all its digits near the peak, where r.v has none to spare: at alpha 0.001 one
//! rounding of r.v is 3 % of the lobe.

use super::{blinn_phong, floors, guard_f64, safe};
use crate::math;
use glam::{DVec2, DVec3, Vec2, Vec3};
use std::f64::consts::TAU;

/// The smallest r.v whose logarithm is taken; far below any that counts.
const TINY: f32 = 1e-30;

/// f_r in 1/sr; see [`evaluate`](super::evaluate).
#[inline(always)]
pub fn evaluate(l: Vec3, v: Vec3, alpha: Vec2) -> f32 {
    let n = 0.25 * blinn_phong::exponent(alpha);
    let cosine = l.z * v.z - (l.x * v.x + l.y * v.y);
    let gap = Vec3::new(l.x + v.x, l.y + v.y, l.z - v.z);
    let u = 0.5 * (gap.x * gap.x + gap.y * gap.y + gap.z * gap.z);
    // ln(1 - u), with what 1 - u lost in rounding carried back to first order.
    let near = u < 0.5;
    let y = if near { 1.0 - u } else { cosine };
    let y = if y < TINY { TINY } else { y };
    let share = if near { 1.0 } else { 0.0 };
    let ln = math::ln(y) + share * ((1.0 - y) - u) / y;
    let f = (n + 2.0) * (0.5 * std::f32::consts::FRAC_1_PI) * math::exp(n * ln);
    if cosine > 0.0 { f } else { 0.0 }
}

/// [`evaluate`] in f64.
pub fn evaluate_f64(l: DVec3, v: DVec3, alpha: DVec2) -> f64 {
    let n = 0.25 * blinn_phong::exponent_f64(alpha);
    let cosine = l.z * v.z - (l.x * v.x + l.y * v.y);
    if cosine <= 0.0 {
        return 0.0;
    }
    let gap = DVec3::new(l.x + v.x, l.y + v.y, l.z - v.z);
    let u = 0.5 * (gap.x * gap.x + gap.y * gap.y + gap.z * gap.z);
    let ln = if u < 0.5 { (-u).ln_1p() } else { cosine.ln() };
    (n + 2.0) / TAU * (n * ln).exp()
}

/// f_r n.l, safe; see [`shade`](super::shade).
#[inline(always)]
pub fn shade(l: Vec3, v: Vec3, alpha: Vec2) -> f32 {
    // No closure around something this long: it would not be inlined, and loops over it would stay scalar.
    let (raised, alpha) = floors(v, alpha);
    safe(l, v, evaluate(l, raised, alpha) * l.z)
}

/// [`shade`] in f64.
pub fn shade_f64(l: DVec3, v: DVec3, alpha: DVec2) -> f64 {
    guard_f64(l, v, alpha, |l, v, alpha| evaluate_f64(l, v, alpha) * l.z)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_lobe_points_along_the_mirrored_light() {
        let l = DVec3::new(0.6, 0.0, 0.8);
        let at = |v| evaluate_f64(l, v, DVec2::splat(0.2));
        let peak = at(DVec3::new(-0.6, 0.0, 0.8));
        assert!((peak - 14.0 / TAU).abs() < 1e-12);
        // n = 12: half-way to the normal the cosine is that of half the angle.
        let v = DVec3::Z;
        assert!((at(v) / peak - 0.8f64.powi(12)).abs() < 1e-12);
    }

    #[test]
    fn behind_the_mirrored_light_there_is_nothing() {
        let grazing = Vec3::new(0.995, 0.0, 0.0999);
        assert_eq!(evaluate(grazing, grazing, Vec2::splat(1.0)), 0.0);
    }
}
