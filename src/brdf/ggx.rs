//! Anisotropic GGX (Trowbridge-Reitz): the microfacet model of glTF viewers and most current renderers.
//!
//! ```text
//! f_r = D G/(4 n.l n.v)          D = 1/(pi alpha_x alpha_y ((hx/alpha_x)² + (hy/alpha_y)² + (h.n)²)²),  G height-correlated Smith
//! ```
//!
//! Source: B. Walter et al., "Microfacet models for refraction through rough surfaces", EGSR 2007; E. Heitz, JCGT 3(2), 2014
//! (anisotropic and correlated).
//!
//! The same alphas mean another shape than in Ward's models: the peak is as high as Beckmann's, but the tail falls as the
//! fourth power of the slope instead of a Gaussian (equal small alpha: 0.68, 0.82, 2.2 and 81 times Ward's at k = 1, 2, 4, 9),
//! and its slope variance is infinite. The albedo is below 1 everywhere. f_r n.l stays finite to the horizon.

use super::{guard, guard_f64, smith};
use glam::{DVec2, DVec3, Vec2, Vec3};
use std::f32::consts::FRAC_1_PI;
use std::f64::consts::FRAC_1_PI as FRAC_1_PI_64;

/// D pi alpha_x alpha_y, from H of any length: its fourth power cancels.
#[inline(always)]
fn tail(h: Vec3, alpha: Vec2) -> f32 {
    let (p, q) = (h.x / alpha.x, h.y / alpha.y);
    let z2 = h.z * h.z;
    let t = (h.x * h.x + h.y * h.y + z2) / (p * p + q * q + z2);
    t * t
}

fn tail_f64(h: DVec3, alpha: DVec2) -> f64 {
    let (p, q) = (h.x / alpha.x, h.y / alpha.y);
    let z2 = h.z * h.z;
    let t = (h.x * h.x + h.y * h.y + z2) / (p * p + q * q + z2);
    t * t
}

/// f_r in 1/sr; see [`evaluate`](super::evaluate).
#[inline(always)]
pub fn evaluate(l: Vec3, v: Vec3, alpha: Vec2) -> f32 {
    FRAC_1_PI / (alpha.x * alpha.y) * tail(l + v, alpha) * smith::ggx_visibility(l, v, alpha)
}

/// [`evaluate`] in f64.
pub fn evaluate_f64(l: DVec3, v: DVec3, alpha: DVec2) -> f64 {
    FRAC_1_PI_64 / (alpha.x * alpha.y)
        * tail_f64(l + v, alpha)
        * smith::ggx_visibility_f64(l, v, alpha)
}

/// f_r n.l, safe; see [`shade`](super::shade).
#[inline(always)]
pub fn shade(l: Vec3, v: Vec3, alpha: Vec2) -> f32 {
    shade_half(l, v, Vec2::new(l.x + v.x, l.y + v.y), alpha)
}

/// [`shade`] for a caller that has Hx and Hy.
#[inline(always)]
pub(super) fn shade_half(l: Vec3, v: Vec3, flat: Vec2, alpha: Vec2) -> f32 {
    guard(l, v, alpha, |l, v, alpha| {
        let visible = smith::ggx_visibility(l, v, alpha) * l.z;
        let h = flat.extend(l.z + v.z);
        FRAC_1_PI / (alpha.x * alpha.y) * tail(h, alpha) * visible
    })
}

/// [`shade`] in f64.
pub fn shade_f64(l: DVec3, v: DVec3, alpha: DVec2) -> f64 {
    guard_f64(l, v, alpha, |l, v, alpha| {
        let visible = smith::ggx_visibility_f64(l, v, alpha) * l.z;
        FRAC_1_PI_64 / (alpha.x * alpha.y) * tail_f64(l + v, alpha) * visible
    })
}

#[cfg(test)]
mod tests {
    use super::super::ward_exact;
    use super::*;

    #[test]
    fn the_tail_leaves_a_gaussian_as_stated() {
        let alpha = DVec2::splat(0.005);
        for (k, want) in [(1.0, 0.68), (2.0, 0.82), (4.0, 2.2), (9.0, 81.0)] {
            let h = DVec3::new(0.005 * f64::sqrt(k), 0.0, 1.0).normalize();
            let ratio = evaluate_f64(h, h, alpha) / ward_exact::evaluate_f64(h, h, alpha);
            assert!((ratio / want - 1.0).abs() < 0.05, "k {k}: {ratio}");
        }
    }
}
