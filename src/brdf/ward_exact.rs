//! Ward 1992 with the exact exponent: an anisotropic Gaussian of slope.
//!
//! ```text
//! f_r = 1/(4 pi alpha_x alpha_y sqrt(n.l n.v)) exp(-k)
//! ```
//!
//! Source: G. Ward, "Measuring and modeling anisotropic reflection", SIGGRAPH 1992, equation 4; the form in B. Walter,
//! "Notes on the Ward BRDF", Cornell PCG-05-06, 2005. It costs what the half-vector form of [`ward`](super::ward) costs; the
//! table there says how far apart the two are.
//!
//! exp(-k) is the slope distribution of a Beckmann surface, so lobes of this model have the shape that Beckmann renderers
//! show. Their brightness differs: the albedo here falls as cos theta (0.50 at 60°, 0.09 at 85° for small alpha), where a
//! microfacet model stays near 1. f_r is infinite where n.l n.v = 0; f_r n.l is not, as long as n.v is held above 0.

use super::{guard, guard_f64, lobe, lobe_f64, scaled_lobe, slope_exponent, slope_exponent_f64};
use glam::{DVec2, DVec3, Vec2, Vec3};
use std::f32::consts::FRAC_1_PI;
use std::f64::consts::FRAC_1_PI as FRAC_1_PI_64;

/// f_r in 1/sr; see [`evaluate`](super::evaluate).
#[inline(always)]
pub fn evaluate(l: Vec3, v: Vec3, alpha: Vec2) -> f32 {
    let norm = 0.25 * FRAC_1_PI / (alpha.x * alpha.y * (l.z * v.z).sqrt());
    scaled_lobe(norm, slope_exponent(l + v, alpha))
}

/// [`evaluate`] in f64.
pub fn evaluate_f64(l: DVec3, v: DVec3, alpha: DVec2) -> f64 {
    let norm = 0.25 * FRAC_1_PI_64 / (alpha.x * alpha.y * (l.z * v.z).sqrt());
    norm * (-slope_exponent_f64(l + v, alpha)).exp()
}

/// f_r n.l, safe; see [`shade`](super::shade).
#[inline(always)]
pub fn shade(l: Vec3, v: Vec3, alpha: Vec2) -> f32 {
    guard(l, v, alpha, |l, v, alpha| {
        let norm = 0.25 * FRAC_1_PI / (alpha.x * alpha.y);
        norm * (l.z / v.z).sqrt() * lobe(slope_exponent(l + v, alpha))
    })
}

/// [`shade`] in f64.
pub fn shade_f64(l: DVec3, v: DVec3, alpha: DVec2) -> f64 {
    guard_f64(l, v, alpha, |l, v, alpha| {
        let norm = 0.25 * FRAC_1_PI_64 / (alpha.x * alpha.y);
        norm * (l.z / v.z).sqrt() * lobe_f64(slope_exponent_f64(l + v, alpha))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_width_off_the_peak_the_lobe_is_down_to_1_over_e() {
        let alpha = DVec2::new(0.1, 0.4);
        for slope in [DVec2::new(0.1, 0.0), DVec2::new(0.0, 0.4)] {
            let h = slope.extend(1.0).normalize();
            let (f, peak) = (
                evaluate_f64(h, h, alpha),
                evaluate_f64(DVec3::Z, DVec3::Z, alpha),
            );
            assert!((f * h.z / peak * std::f64::consts::E - 1.0).abs() < 1e-12);
        }
    }
}
