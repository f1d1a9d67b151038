//! Ward's lobe with Dür's norm: n.l n.v in place of its square root.
//!
//! ```text
//! f_r = 1/(4 pi alpha_x alpha_y n.l n.v) exp(-k)
//! ```
//!
//! Source: A. Dür, "An improved normalization for the Ward reflectance model", Journal of Graphics Tools 11(1), 2006.
//!
//! The albedo stays near 1 to about 80° for alphas up to 0.1, where Ward's own falls as cos theta. Beyond it is unbounded:
//! 6.0 at 89° with alphas (0.1, 0.5) seen across. Under light from everywhere the rim of an object glows with light that
//! never fell on it; [`ward_bounded`](super::ward_bounded) mends that and is otherwise close. f_r n.l is infinite at n.v = 0.

use super::{guard, guard_f64, lobe, lobe_f64, scaled_lobe, slope_exponent, slope_exponent_f64};
use glam::{DVec2, DVec3, Vec2, Vec3};
use std::f32::consts::FRAC_1_PI;
use std::f64::consts::FRAC_1_PI as FRAC_1_PI_64;

/// f_r in 1/sr; see [`evaluate`](super::evaluate).
#[inline(always)]
pub fn evaluate(l: Vec3, v: Vec3, alpha: Vec2) -> f32 {
    let norm = 0.25 * FRAC_1_PI / (alpha.x * alpha.y * (l.z * v.z));
    scaled_lobe(norm, slope_exponent(l + v, alpha))
}

/// [`evaluate`] in f64.
pub fn evaluate_f64(l: DVec3, v: DVec3, alpha: DVec2) -> f64 {
    let norm = 0.25 * FRAC_1_PI_64 / (alpha.x * alpha.y * (l.z * v.z));
    norm * (-slope_exponent_f64(l + v, alpha)).exp()
}

/// f_r n.l, safe; see [`shade`](super::shade).
#[inline(always)]
pub fn shade(l: Vec3, v: Vec3, alpha: Vec2) -> f32 {
    guard(l, v, alpha, |l, v, alpha| {
        let norm = 0.25 * FRAC_1_PI / (alpha.x * alpha.y * v.z);
        norm * lobe(slope_exponent(l + v, alpha))
    })
}

/// [`shade`] in f64.
pub fn shade_f64(l: DVec3, v: DVec3, alpha: DVec2) -> f64 {
    guard_f64(l, v, alpha, |l, v, alpha| {
        let norm = 0.25 * FRAC_1_PI_64 / (alpha.x * alpha.y * v.z);
        norm * lobe_f64(slope_exponent_f64(l + v, alpha))
    })
}

#[cfg(test)]
mod tests {
    use super::super::ward_exact;
    use super::*;

    #[test]
    fn it_is_the_exact_ward_lobe_under_another_norm() {
        let (l, v) = (
            DVec3::new(0.2, -0.3, 0.9).normalize(),
            DVec3::new(-0.4, 0.1, 0.5).normalize(),
        );
        let alpha = DVec2::new(0.2, 0.5);
        let ratio = evaluate_f64(l, v, alpha) / ward_exact::evaluate_f64(l, v, alpha);
        assert!((ratio * (l.z * v.z).sqrt() - 1.0).abs() < 1e-14);
    }
}
