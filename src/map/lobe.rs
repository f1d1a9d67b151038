//! The lobe of a texel as a covariance of slopes: exact under averaging, so it is what minification works in.

use super::{ALPHA_MAX, ALPHA_MIN, Texel};
use crate::math::Axis;
use glam::Vec2;
use std::ops::{Add, AddAssign, Mul};

/// Sigma = R diag(alpha_x²/2, alpha_y²/2) Rᵀ in the (u, v) frame: exp(-k) of the Ward exponent is a Gaussian of slope with
/// this covariance, and the mean lobe of many texels has the mean covariance (Olano and Baker 2010, LEAN mapping).
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SlopeCovariance {
    /// Variance of the slope along u.
    pub uu: f32,
    /// Covariance.
    pub uv: f32,
    /// Variance of the slope along v.
    pub vv: f32,
}

impl SlopeCovariance {
    /// Back to widths and an axis. `x_is_wide` chooses which of the two axes is called x; a filter asks the texels it
    /// averaged (alpha_x > alpha_y), so that a map keeps its naming. Widths are clamped to the map's range; where they are
    /// equal the axis is `fallback`.
    pub fn to_texel(self, x_is_wide: bool, fallback: Axis) -> Texel {
        let difference = Vec2::new(self.uu - self.vv, 2.0 * self.uv);
        let trace = self.uu + self.vv;
        let wide = 0.5 * (trace + difference.length());
        // The small eigenvalue as determinant over the large one: no cancellation at ratios of 1000.
        let determinant = (self.uu * self.vv - self.uv * self.uv).max(0.0);
        let narrow = if wide > 0.0 { determinant / wide } else { 0.0 };
        let width = |variance: f32| (2.0 * variance).sqrt().clamp(ALPHA_MIN, ALPHA_MAX);
        let (wide, narrow) = (width(wide), width(narrow));
        let axis = if difference.length() > 1e-6 * trace {
            let wide_axis =
                Axis::from_double_angle(difference / difference.length()).unwrap_or(fallback);
            if x_is_wide {
                wide_axis
            } else {
                wide_axis.perpendicular()
            }
        } else {
            fallback
        };
        let (alpha_x, alpha_y) = if x_is_wide {
            (wide, narrow)
        } else {
            (narrow, wide)
        };
        Texel {
            alpha_x,
            alpha_y,
            axis,
        }
    }
}

impl From<Texel> for SlopeCovariance {
    #[inline(always)]
    fn from(texel: Texel) -> Self {
        let (x, y) = (
            0.5 * texel.alpha_x * texel.alpha_x,
            0.5 * texel.alpha_y * texel.alpha_y,
        );
        let (mean, half) = (0.5 * (x + y), 0.5 * (x - y));
        Self {
            uu: mean + half * texel.axis.cos2,
            uv: half * texel.axis.sin2,
            vv: mean - half * texel.axis.cos2,
        }
    }
}

impl Add for SlopeCovariance {
    type Output = Self;
    #[inline(always)]
    fn add(self, o: Self) -> Self {
        Self {
            uu: self.uu + o.uu,
            uv: self.uv + o.uv,
            vv: self.vv + o.vv,
        }
    }
}

impl AddAssign for SlopeCovariance {
    fn add_assign(&mut self, o: Self) {
        *self = *self + o;
    }
}

impl Mul<f32> for SlopeCovariance {
    type Output = Self;
    #[inline(always)]
    fn mul(self, f: f32) -> Self {
        Self {
            uu: self.uu * f,
            uv: self.uv * f,
            vv: self.vv * f,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn crossed_grooves_average_to_a_round_lobe() {
        let at = |d| {
            SlopeCovariance::from(Texel {
                alpha_x: 0.1,
                alpha_y: 0.4,
                axis: Axis::from_degrees(d),
            })
        };
        let mean = ((at(20.0) + at(110.0)) * 0.5).to_texel(false, Axis::V);
        let want = ((0.01f32 + 0.16) / 2.0).sqrt();
        assert!((mean.alpha_x - want).abs() < 1e-4 && (mean.alpha_y - want).abs() < 1e-4);
    }

    proptest! {
        #[test]
        fn there_and_back(ax in 1e-3f32..1.5, ay in 1e-3f32..1.5, degrees in 0.0f32..180.0) {
            let texel = Texel { alpha_x: ax, alpha_y: ay, axis: Axis::from_degrees(degrees) };
            let back = SlopeCovariance::from(texel).to_texel(ax > ay, texel.axis);
            // A ratio of 1500 leaves f32 little of the small width in the covariance.
            let tolerance = 1e-5 + 4e-7 * texel.ratio() * texel.ratio();
            prop_assert!((back.alpha_x / ax - 1.0).abs() < tolerance.max(1e-4) || texel.ratio() > 200.0);
            if texel.ratio() > 1.01 {
                prop_assert!(back.axis.angle_to(texel.axis) < 1e-3);
            }
        }
    }
}
