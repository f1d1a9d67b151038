//! Lambert: the diffuse term, and a model without a specular one.
//!
//! f_r = rho_d/pi, so that light of every direction is returned in the share rho_d. Ambient light is light of constant
//! radiance L_a from everywhere; it needs no model, and its share of the picture is rho_d L_a.
//!
//! As a specular model `lambert` is 0: [`evaluate`](super::evaluate) and [`shade`](super::shade) give the highlight alone,
//! and every picture has the diffuse term beside it.

use std::f64::consts::FRAC_1_PI;

/// The diffuse f_r for rho_d = 1, in 1/sr: 1/pi.
#[inline(always)]
pub fn evaluate() -> f32 {
    std::f32::consts::FRAC_1_PI
}

/// [`evaluate`] in f64.
pub fn evaluate_f64() -> f64 {
    FRAC_1_PI
}

/// The diffuse f_r n.l for rho_d = 1: 0 below the horizon, and where `n_dot_l` is NaN.
#[inline(always)]
pub fn shade(n_dot_l: f32) -> f32 {
    let lit = if n_dot_l > 0.0 { n_dot_l } else { 0.0 };
    std::f32::consts::FRAC_1_PI * lit
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_hemisphere_gets_all_of_it_back() {
        // The integral of n.l/pi over the hemisphere, by the midpoint rule in n.l.
        let n = 1000;
        let albedo: f64 = (0..n)
            .map(|i| (f64::from(i) + 0.5) / f64::from(n))
            .map(|z| f64::from(shade(z as f32)) * 2.0 * std::f64::consts::PI / f64::from(n))
            .sum();
        assert!((albedo - 1.0).abs() < 1e-6, "{albedo}");
        assert_eq!(f64::from(evaluate()), f64::from(evaluate_f64() as f32));
    }

    #[test]
    fn nothing_comes_from_below_or_from_nowhere() {
        assert_eq!(shade(-0.5), 0.0);
        assert_eq!(shade(f32::NAN), 0.0);
    }
}
