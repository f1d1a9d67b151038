//! Blinn-Phong, normalised: an isotropic lobe around the half vector (Blinn 1977).
//!
//! ```text
//! f_r = (n + 8)/(8 pi) (h.n)^n          n = 2/alpha² - 2, at least 0
//! ```
//!
//! The exponent is the one whose lobe has the same slope width as Ward's near its peak. The model knows one width: where
//! alpha_x and alpha_y differ it takes the isotropic width of the same mean slope variance, alpha² = (alpha_x² + alpha_y²)/2.
//! The norm (n + 8)/(8 pi) is the customary one; it is short of exact by up to 6 % of albedo at normal incidence, never past
//! 1.06, and the albedo then falls as cos². Widths over 1 all mean n = 0, a constant 1/pi.
//!
//! ln(h.n) = -ln(1 + p² + q²)/2 from the slopes p = Hx/Hz, q = Hy/Hz: near the peak h.n itself holds nothing but its rounding.

use super::{guard, guard_f64};
use crate::math;
use glam::{DVec2, DVec3, Vec2, Vec3};

/// The exponent n for two widths; see the module.
#[inline(always)]
pub fn exponent(alpha: Vec2) -> f32 {
    let n = 4.0 / (alpha.x * alpha.x + alpha.y * alpha.y) - 2.0;
    if n < 0.0 { 0.0 } else { n }
}

/// [`exponent`] in f64.
pub fn exponent_f64(alpha: DVec2) -> f64 {
    let n = 4.0 / (alpha.x * alpha.x + alpha.y * alpha.y) - 2.0;
    if n < 0.0 { 0.0 } else { n }
}

/// ln(1 + x), right to the last digits also for small x >= 0.
#[inline(always)]
fn ln_1p(x: f32) -> f32 {
    let y = 1.0 + x;
    // What 1 + x lost in rounding, carried back to first order.
    math::ln(y) + (x - (y - 1.0)) / y
}

/// f_r in 1/sr; see [`evaluate`](super::evaluate).
#[inline(always)]
pub fn evaluate(l: Vec3, v: Vec3, alpha: Vec2) -> f32 {
    let h = l + v;
    let n = exponent(alpha);
    let tan2 = (h.x * h.x + h.y * h.y) / (h.z * h.z);
    (n + 8.0) * (0.125 * std::f32::consts::FRAC_1_PI) * math::exp(-0.5 * n * ln_1p(tan2))
}

/// [`evaluate`] in f64.
pub fn evaluate_f64(l: DVec3, v: DVec3, alpha: DVec2) -> f64 {
    let h = l + v;
    let n = exponent_f64(alpha);
    let tan2 = (h.x * h.x + h.y * h.y) / (h.z * h.z);
    (n + 8.0) * (0.125 * std::f64::consts::FRAC_1_PI) * (-0.5 * n * tan2.ln_1p()).exp()
}

/// f_r n.l, safe; see [`shade`](super::shade).
#[inline(always)]
pub fn shade(l: Vec3, v: Vec3, alpha: Vec2) -> f32 {
    guard(l, v, alpha, |l, v, alpha| evaluate(l, v, alpha) * l.z)
}

/// [`shade`] in f64.
pub fn shade_f64(l: DVec3, v: DVec3, alpha: DVec2) -> f64 {
    guard_f64(l, v, alpha, |l, v, alpha| evaluate_f64(l, v, alpha) * l.z)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_peak_is_the_norm() {
        let f = evaluate_f64(DVec3::Z, DVec3::Z, DVec2::splat(0.1));
        assert!((f - 206.0 / (8.0 * std::f64::consts::PI)).abs() < 1e-10);
    }

    #[test]
    fn unequal_widths_share_their_slope_variance() {
        let n = exponent(Vec2::new(0.1, 0.7));
        assert!((n - exponent(Vec2::splat(0.5))).abs() < 1e-5);
        assert_eq!(exponent(Vec2::splat(1.5)), 0.0);
    }

    #[test]
    fn the_logarithm_keeps_its_digits_near_the_peak() {
        for x in [1e-12f32, 1e-8, 3e-7, 1e-3, 0.5, 7.0, 1e6] {
            let want = f64::from(x).ln_1p();
            assert!((f64::from(ln_1p(x)) / want - 1.0).abs() < 3e-7, "{x}");
        }
    }
}
