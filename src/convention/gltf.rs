//! glTF 2.0 with `KHR_materials_anisotropy`: roughness r and strength s instead of two widths.
//!
//! The extension defines alpha_b = r² across the direction and alpha_t = mix(alpha_b, 1, s²) along it. So a strength can
//! only make one direction rougher, the roughness is that of the smooth one, and no width can be above 1. The direction is
//! that of the stretched highlight, as a vector in (tangent, bitangent) with the bitangent toward image-up.

/// (r, s) of the widths `alpha_t` >= `alpha_b`, both in (0, 1]; larger ones are taken as 1.
#[inline]
pub fn encode(alpha_t: f32, alpha_b: f32) -> (f32, f32) {
    let alpha_b = alpha_b.min(1.0);
    (alpha_b.sqrt(), strength(alpha_t, alpha_b))
}

/// The strength that makes `alpha_t` of a given `alpha_b`; 0 where `alpha_t` is not the larger, or nothing is left to gain.
#[inline]
pub fn strength(alpha_t: f32, alpha_b: f32) -> f32 {
    let room = 1.0 - alpha_b;
    if room > 1e-6 {
        ((alpha_t.min(1.0) - alpha_b).max(0.0) / room).sqrt()
    } else {
        0.0
    }
}

/// (alpha_t, alpha_b) of roughness `r` and strength `s`, both in [0, 1].
#[inline]
pub fn decode(r: f32, s: f32) -> (f32, f32) {
    let alpha_b = r * r;
    (alpha_b + (1.0 - alpha_b) * s * s, alpha_b)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn widths_above_one_are_clamped() {
        assert_eq!(encode(1.4, 0.25), (0.5, 1.0));
        assert_eq!(encode(1.4, 1.2), (1.0, 0.0));
        assert_eq!(decode(1.0, 1.0), (1.0, 1.0));
    }

    proptest! {
        #[test]
        fn there_and_back(alpha_b in 1e-3f32..1.0, t in 0.0f32..1.0) {
            let alpha_t = alpha_b + (1.0 - alpha_b) * t;
            let (r, s) = encode(alpha_t, alpha_b);
            prop_assert!((0.0..=1.0).contains(&r) && (0.0..=1.0).contains(&s));
            let (t2, b2) = decode(r, s);
            prop_assert!((b2 / alpha_b - 1.0).abs() < 1e-6);
            prop_assert!((t2 / alpha_t - 1.0).abs() < 2e-6, "{alpha_t} {t2}");
        }
    }
}
