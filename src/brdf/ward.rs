//! Ward 1992 in its cheap form: the half vector's components in place of the tangent. The default model.
//!
//! ```text
//! f_r = 1/(4 pi alpha_x alpha_y sqrt(n.l n.v)) exp(-e)          e = 2 ((hx/alpha_x)² + (hy/alpha_y)²)/(1 + h.n)
//! ```
//!
//! Source: G. Ward, "Measuring and modeling anisotropic reflection", SIGGRAPH 1992, the approximation of its equation 5.
//! The program shows this form first because it is the one in use wherever Ward's model is told by formula alone.
//!
//! # What the exact exponent changes
//!
//! With c = h.n, e = k 2c²/(1 + c): smaller than the exact k of [`ward_exact`](super::ward_exact), so this form is always
//! the brighter one away from the peak (there they are equal), by the factor exp(k (1-c)(1+2c)/(1+c)), about
//! exp(3/4 k² alpha²). The excess, which a test keeps:
//!
//! | alpha | k = 1 (one width) | k = 4 (two) | k = 9 (three) |
//! |---|---|---|---|
//! | 0.05 | 0.19 % | 3.0 % | 16 % |
//! | 0.1 | 0.75 % | 12 % | 76 % |
//! | 0.2 | 2.9 % | 53 % | 550 % |
//! | 0.5 | 17 % | 424 % | |
//!
//! Albedo grows with it: at normal incidence by 0.06 % at alpha 0.02, 1.4 % at 0.1, 9.3 % at 0.3. The cost is the same, one
//! square root against one division. A preview that must predict a Beckmann renderer takes `ward-exact`.
//!
//! # Where it breaks
//!
//! The albedo falls as cos theta (0.50 at 60°, 0.09 at 85° for small alpha), then rises past 1 near the horizon for wide
//! lobes: 1.34 at 89° with alphas (0.5, 1) seen across. f_r is infinite where n.l n.v = 0; f_r n.l is not, as long as n.v
//! is held above 0.

use super::{guard, guard_f64, lobe, lobe_f64, scaled_lobe};
use glam::{DVec2, DVec3, Vec2, Vec3};
use std::f32::consts::FRAC_1_PI;
use std::f64::consts::FRAC_1_PI as FRAC_1_PI_64;

/// e, with the half vector's length kept: 2 (..H..)/(|H| (|H| + Hz)). At least Hz >= 1e-10 keeps it from 0/0.
#[inline(always)]
fn exponent(h: Vec3, alpha: Vec2) -> f32 {
    let (p, q) = (h.x / alpha.x, h.y / alpha.y);
    let length = (h.x * h.x + h.y * h.y + h.z * h.z).sqrt();
    2.0 * (p * p + q * q) / (length * (length + h.z))
}

fn exponent_f64(h: DVec3, alpha: DVec2) -> f64 {
    let (p, q) = (h.x / alpha.x, h.y / alpha.y);
    let length = (h.x * h.x + h.y * h.y + h.z * h.z).sqrt();
    2.0 * (p * p + q * q) / (length * (length + h.z))
}

/// f_r in 1/sr; see [`evaluate`](super::evaluate).
#[inline(always)]
pub fn evaluate(l: Vec3, v: Vec3, alpha: Vec2) -> f32 {
    let norm = 0.25 * FRAC_1_PI / (alpha.x * alpha.y * (l.z * v.z).sqrt());
    scaled_lobe(norm, exponent(l + v, alpha))
}

/// [`evaluate`] in f64.
pub fn evaluate_f64(l: DVec3, v: DVec3, alpha: DVec2) -> f64 {
    let norm = 0.25 * FRAC_1_PI_64 / (alpha.x * alpha.y * (l.z * v.z).sqrt());
    norm * (-exponent_f64(l + v, alpha)).exp()
}

/// f_r n.l, safe; see [`shade`](super::shade).
#[inline(always)]
pub fn shade(l: Vec3, v: Vec3, alpha: Vec2) -> f32 {
    guard(l, v, alpha, |l, v, alpha| {
        let norm = 0.25 * FRAC_1_PI / (alpha.x * alpha.y);
        norm * (l.z / v.z).sqrt() * lobe(exponent(l + v, alpha))
    })
}

/// [`shade`] in f64.
pub fn shade_f64(l: DVec3, v: DVec3, alpha: DVec2) -> f64 {
    guard_f64(l, v, alpha, |l, v, alpha| {
        let norm = 0.25 * FRAC_1_PI_64 / (alpha.x * alpha.y);
        norm * (l.z / v.z).sqrt() * lobe_f64(exponent_f64(l + v, alpha))
    })
}

#[cfg(test)]
mod tests {
    use super::super::ward_exact;
    use super::*;

    #[test]
    fn the_peak_is_the_norm() {
        let f = evaluate_f64(DVec3::Z, DVec3::Z, DVec2::new(0.05, 0.16));
        assert!((f - FRAC_1_PI_64 / (4.0 * 0.008)).abs() < 1e-12);
    }

    /// The table of the module's head.
    #[test]
    fn the_half_vector_form_is_brighter_by_the_stated_amounts() {
        let excess = |alpha: f64, k: f64| {
            // Light and viewer mirrored at a half vector of slope alpha sqrt(k), seen along it.
            let h = DVec3::new(alpha * k.sqrt(), 0.0, 1.0).normalize();
            let alpha = DVec2::splat(alpha);
            100.0 * (evaluate_f64(h, h, alpha) / ward_exact::evaluate_f64(h, h, alpha) - 1.0)
        };
        for (alpha, k, percent) in [
            (0.05, 1.0, 0.19),
            (0.05, 4.0, 3.0),
            (0.05, 9.0, 16.0),
            (0.1, 1.0, 0.75),
            (0.1, 4.0, 12.0),
            (0.1, 9.0, 76.0),
            (0.2, 1.0, 2.9),
            (0.2, 4.0, 53.0),
            (0.2, 9.0, 550.0),
            (0.5, 1.0, 17.0),
            (0.5, 4.0, 424.0),
        ] {
            let got = excess(alpha, k);
            assert!(
                (got / percent - 1.0).abs() < 0.04,
                "alpha {alpha}, k {k}: {got} %"
            );
        }
    }
}
