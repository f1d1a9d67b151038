//! Directions without a sign, tangent frames, safe normalising, and our own polynomial functions.
//!
//! The polynomials are branch-free and use no fused multiply-add, so a loop over them vectorises and gives the same
//! bits on every CPU level and every platform; the platform's `sin` and `exp` promise neither.

use fearless_simd::Level;
use glam::{Vec2, Vec3, Vec4};
use std::f32::consts::{FRAC_PI_2, LN_2, LOG2_E, PI};
use std::sync::LazyLock;

/// Below this length a blend of double-angle vectors has no direction left.
pub const AXIS_MIN_LENGTH: f32 = 1e-3;

/// A direction without a sign in the tangent plane: an angle modulo pi, held as the unit vector (cos 2θ, sin 2θ).
///
/// θ runs counter-clockwise from +U toward image-up, seen from outside. 10° and 190° are the same axis, and a weighted
/// sum of the vectors is a blend that knows no wrap.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Axis {
    /// cos 2θ.
    pub cos2: f32,
    /// sin 2θ.
    pub sin2: f32,
}

impl Default for Axis {
    fn default() -> Self {
        Self::U
    }
}

impl Axis {
    /// The axis along +U, θ = 0.
    pub const U: Self = Self {
        cos2: 1.0,
        sin2: 0.0,
    };
    /// The axis along image-up, θ = 90°.
    pub const V: Self = Self {
        cos2: -1.0,
        sin2: 0.0,
    };

    /// From θ in radians, any finite value.
    pub fn from_radians(theta: f32) -> Self {
        let (sin2, cos2) = sin_cos(2.0 * theta);
        Self { cos2, sin2 }
    }

    /// From θ in degrees, any finite value. Whole turns are taken off before the conversion, so that 180 is exactly 0.
    pub fn from_degrees(theta: f32) -> Self {
        Self::from_radians(theta.rem_euclid(180.0).to_radians())
    }

    /// The axis along a vector in the tangent plane (+U, up) of any length; `None` where the vector has no direction.
    pub fn from_vector(v: Vec2) -> Option<Self> {
        Self::from_double_angle(
            Vec2::new(v.x * v.x - v.y * v.y, 2.0 * v.x * v.y) / v.length_squared(),
        )
    }

    /// From a blend of (cos 2θ, sin 2θ) vectors, normalised; `None` where it is shorter than [`AXIS_MIN_LENGTH`] or not finite.
    pub fn from_double_angle(v: Vec2) -> Option<Self> {
        let length = v.length();
        (length.is_finite() && length >= AXIS_MIN_LENGTH).then(|| Self {
            cos2: v.x / length,
            sin2: v.y / length,
        })
    }

    /// (cos 2θ, sin 2θ).
    pub fn double_angle(self) -> Vec2 {
        Vec2::new(self.cos2, self.sin2)
    }

    /// The unit vector (cos θ, sin θ) with cos θ >= 0: one of the two that lie along the axis.
    pub fn direction(self) -> Vec2 {
        half_angle(self.cos2, self.sin2).into()
    }

    /// θ in radians, in [0, pi).
    pub fn radians(self) -> f32 {
        let theta = 0.5 * atan2(self.sin2, self.cos2);
        let theta = if theta < 0.0 { theta + PI } else { theta };
        if theta >= PI { 0.0 } else { theta }
    }

    /// θ in degrees, in [0, 180).
    pub fn degrees(self) -> f32 {
        self.radians().to_degrees()
    }

    /// The axis at right angles.
    #[must_use]
    pub fn perpendicular(self) -> Self {
        Self {
            cos2: -self.cos2,
            sin2: -self.sin2,
        }
    }

    /// The axis turned counter-clockwise by the angle of `other`.
    #[must_use]
    pub fn turned(self, other: Self) -> Self {
        Self {
            cos2: self.cos2 * other.cos2 - self.sin2 * other.sin2,
            sin2: self.sin2 * other.cos2 + self.cos2 * other.sin2,
        }
    }

    /// The angle between two axes in radians, in [0, pi/2].
    pub fn angle_to(self, other: Self) -> f32 {
        let cross = self.cos2 * other.sin2 - self.sin2 * other.cos2;
        let dot = self.cos2 * other.cos2 + self.sin2 * other.sin2;
        0.5 * atan2(cross.abs(), dot)
    }
}

/// (cos θ, sin θ) with cos θ >= 0 from (cos 2θ, sin 2θ), unit length in. Branch-free; exact square roots only.
#[inline(always)]
pub fn half_angle(cos2: f32, sin2: f32) -> (f32, f32) {
    // The larger of |cos θ| and |sin θ| comes from the square root, the other from the product 2 sin cos: no cancellation.
    let big = (0.5 * (1.0 + cos2.abs())).sqrt();
    let small = 0.5 * sin2.abs() / big;
    let sign = if sin2 < 0.0 { -1.0 } else { 1.0 };
    if cos2 >= 0.0 {
        (big, sign * small)
    } else {
        (small, sign * big)
    }
}

/// An orthonormal shading frame: tangent, bitangent, normal.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Frame {
    /// Along +U.
    pub tangent: Vec3,
    /// Toward image-up; N x T for an unmirrored layout.
    pub bitangent: Vec3,
    /// Out of the surface.
    pub normal: Vec3,
}

impl Frame {
    /// Normalises `normal`, makes the tangent orthogonal to it, and builds the bitangent with the handedness in
    /// `tangent.w` (negative: mirrored layout). The flag is `false` when the tangent had no direction of its own (zero,
    /// parallel to the normal, not finite) and any perpendicular was taken: such a point must be lit as isotropic.
    /// `None` when the normal itself has no direction.
    pub fn new(normal: Vec3, tangent: Vec4) -> Option<(Self, bool)> {
        let n = normal.try_normalize()?;
        let t = tangent.truncate();
        let t = t
            .is_finite()
            .then(|| (t - n * n.dot(t)).try_normalize())
            .flatten();
        // A tangent closer to the normal than about 0.006 degrees has no digits left.
        let usable = t.filter(|t| {
            let given = tangent.truncate().normalize_or_zero();
            t.dot(given) > 1e-4
        });
        let t = usable.unwrap_or_else(|| n.any_orthonormal_vector());
        let handedness = if tangent.w < 0.0 { -1.0 } else { 1.0 };
        Some((
            Self {
                tangent: t,
                bitangent: n.cross(t) * handedness,
                normal: n,
            },
            usable.is_some(),
        ))
    }

    /// World to local: components along tangent, bitangent, normal.
    pub fn to_local(self, v: Vec3) -> Vec3 {
        Vec3::new(
            v.dot(self.tangent),
            v.dot(self.bitangent),
            v.dot(self.normal),
        )
    }
}

/// The CPU level that loops are run at, found once. `ANISOMAP_SIMD` holds it down to one of [`levels`], to measure or to
/// check that nothing but speed depends on it; any other word has no effect.
pub fn level() -> Level {
    static LEVEL: LazyLock<Level> = LazyLock::new(|| {
        let wanted = std::env::var("ANISOMAP_SIMD").unwrap_or_default();
        let known = levels().into_iter().find(|(name, _)| *name == wanted);
        known.map_or_else(Level::new, |(_, level)| level)
    });
    *LEVEL
}

/// The CPU levels of this machine by name, the narrowest first: all give the same bits.
pub fn levels() -> Vec<(&'static str, Level)> {
    let mut levels = vec![("baseline", Level::baseline())];
    #[cfg(any(target_arch = "x86", target_arch = "x86_64"))]
    {
        let best = Level::new();
        levels.extend(best.as_sse4_2().map(|l| ("sse4.2", Level::Sse4_2(l))));
        levels.extend(best.as_avx2().map(|l| ("avx2", Level::Avx2(l))));
        levels.extend(best.as_avx512().map(|l| ("avx512", Level::Avx512(l))));
    }
    levels
}

/// 1.5 * 2^23: adding it leaves the nearest whole number in the low bits of an f32.
const ROUND: f32 = 12_582_912.0;

/// The nearest whole number, ties to even, for |x| < 2^22. A plain addition, so it vectorises everywhere.
#[inline(always)]
pub fn round_fast(x: f32) -> f32 {
    (x + ROUND) - ROUND
}

/// `a` where `first` holds, else `b`: both are there already, so that a loop over it needs no branch.
#[inline(always)]
pub(crate) fn choose(first: bool, a: f32, b: f32) -> f32 {
    if first { a } else { b }
}

/// The largest whole number at most `x`, for |x| < 2^22. Branch-free.
#[inline(always)]
pub fn floor_fast(x: f32) -> f32 {
    let r = round_fast(x);
    r - if r > x { 1.0 } else { 0.0 }
}

/// A whole number as an integer, for |x| < 2^22. Unlike a cast it has no limits to watch, so it vectorises everywhere.
#[inline(always)]
pub fn whole(x: f32) -> i32 {
    ((x + ROUND).to_bits() as i32).wrapping_sub(ROUND.to_bits() as i32)
}

/// The degree of the polynomial in [`exp`].
pub const EXP_DEGREE: u32 = 7;

/// e^x for x in [-87, 88]; arguments are clamped to that, so the result is always normal and finite. Relative error 2e-7.
#[inline(always)]
pub fn exp(x: f32) -> f32 {
    let x = x.clamp(-87.0, 88.0);
    let shifted = x * LOG2_E + ROUND;
    let n = shifted - ROUND;
    // ln 2 in two parts keeps the remainder exact (Cody and Waite).
    let r = (x - n * 0.693_359_4) - n * -2.121_944_4e-4;
    let p = 1.987_569_1e-4;
    let p = p * r + 1.398_2e-3;
    let p = p * r + 8.333_452e-3;
    let p = p * r + 4.166_579_6e-2;
    let p = p * r + 1.666_666_5e-1;
    let p = p * r + 5e-1;
    let y = p * r * r + r + 1.0;
    // The low bits of `shifted` are n: add them to the exponent of y.
    f32::from_bits(y.to_bits().wrapping_add(shifted.to_bits() << 23))
}

/// The natural logarithm of a normal positive number. Relative error 1e-7 away from 1, absolute 1e-7 near it.
#[inline(always)]
pub fn ln(x: f32) -> f32 {
    // x = m * 2^e with m in [sqrt(1/2), sqrt(2)).
    let bits = x.to_bits().wrapping_sub(0x3f35_04f3);
    let e = ((bits as i32) >> 23) as f32;
    let m = f32::from_bits((bits & 0x007f_ffff).wrapping_add(0x3f35_04f3)) - 1.0;
    let z = m * m;
    let p = 7.037_683_6e-2;
    let p = p * m - 1.151_461e-1;
    let p = p * m + 1.167_699_9e-1;
    let p = p * m - 1.242_014_1e-1;
    let p = p * m + 1.424_932_3e-1;
    let p = p * m - 1.666_805_8e-1;
    let p = p * m + 2.000_071_5e-1;
    let p = p * m - 2.499_999_4e-1;
    let p = p * m + 3.333_333e-1;
    let y = p * m * z + e * -2.121_944_4e-4 - 0.5 * z;
    (m + y) + e * 0.693_359_4
}

/// (sin x, cos x) for |x| up to 1e4 radians. Absolute error 2e-7 for |x| <= 10.
#[inline(always)]
pub fn sin_cos(x: f32) -> (f32, f32) {
    let shifted = x * std::f32::consts::FRAC_2_PI + ROUND;
    let quadrant = shifted.to_bits();
    let n = shifted - ROUND;
    // pi/2 in three parts.
    let r = ((x - n * 1.570_312_5) - n * 4.837_513e-4) - n * 7.549_79e-8;
    let z = r * r;
    let s = ((-1.951_529_6e-4 * z + 8.332_161e-3) * z - 1.666_665_5e-1) * z * r + r;
    let c = ((2.443_315_7e-5 * z - 1.388_731_6e-3) * z + 4.166_664_6e-2) * z * z - 0.5 * z + 1.0;
    let odd = quadrant & 1 != 0;
    let (a, b) = if odd { (c, s) } else { (s, c) };
    let sin_sign = (quadrant & 2) << 30;
    let cos_sign = (quadrant.wrapping_add(1) & 2) << 30;
    (
        f32::from_bits(a.to_bits() ^ sin_sign),
        f32::from_bits(b.to_bits() ^ cos_sign),
    )
}

/// The angle of (x, y) in radians, in [-pi, pi]; 0 at the origin. Absolute error 4e-7.
#[inline(always)]
pub fn atan2(y: f32, x: f32) -> f32 {
    let (ax, ay) = (x.abs(), y.abs());
    let (low, high) = if ax < ay { (ax, ay) } else { (ay, ax) };
    let q = if high > 0.0 { low / high } else { 0.0 };
    // atan on [0, 1]: above tan(pi/8) use atan q = pi/4 + atan((q-1)/(q+1)).
    let wide = q > 0.414_213_57;
    let t = if wide { (q - 1.0) / (q + 1.0) } else { q };
    let z = t * t;
    let p =
        (((8.053_745e-2 * z - 1.387_768_6e-1) * z + 1.997_771_1e-1) * z - 3.333_295e-1) * z * t + t;
    let a = if wide { p + 0.25 * PI } else { p };
    let a = if ay > ax { FRAC_PI_2 - a } else { a };
    let a = if x < 0.0 { PI - a } else { a };
    if y < 0.0 { -a } else { a }
}

/// x^y for positive normal x, through [`exp`] and [`ln`].
#[inline(always)]
pub fn pow(x: f32, y: f32) -> f32 {
    exp(y * ln(x))
}

/// 2^x; see [`exp`].
#[inline(always)]
pub fn exp2(x: f32) -> f32 {
    exp(x * LN_2)
}

/// A cubic step: 0 up to `low`, 1 from `high` on. `low` < `high`.
#[inline(always)]
pub fn smoothstep(low: f32, high: f32, x: f32) -> f32 {
    let t = ((x - low) / (high - low)).clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn worst(
        range: std::ops::Range<f64>,
        f: impl Fn(f32) -> f32,
        g: impl Fn(f64) -> f64,
        relative: bool,
    ) -> f64 {
        (0..200_000)
            .map(|i| range.start + (range.end - range.start) * f64::from(i) / 2e5)
            .map(|x| {
                let x32 = x as f32;
                let want = g(f64::from(x32));
                let error = (f64::from(f(x32)) - want).abs();
                if relative { error / want.abs() } else { error }
            })
            .fold(0.0, f64::max)
    }

    #[test]
    fn polynomials_stay_inside_their_stated_errors() {
        assert!(worst(-86.9..87.9, exp, f64::exp, true) < 2e-7);
        assert!(worst(1.5..1e6, ln, f64::ln, true) < 2e-7);
        assert!(worst(1e-6..2.0, ln, f64::ln, false) < 1e-6);
        assert!(worst(-10.0..10.0, |x| sin_cos(x).0, f64::sin, false) < 2e-7);
        assert!(worst(-10.0..10.0, |x| sin_cos(x).1, f64::cos, false) < 2e-7);
        let circle = |x: f32| atan2(sin_cos(x).0, sin_cos(x).1);
        assert!(worst(-3.1..3.1, circle, |x| x, false) < 6e-7);
    }

    #[test]
    fn exp_never_leaves_the_normal_numbers() {
        assert!(exp(-1e30).is_normal() && exp(f32::NEG_INFINITY).is_normal());
        assert!(exp(1e30).is_finite());
        assert!((exp(0.0) - 1.0).abs() < 1e-7);
    }

    #[test]
    fn whole_numbers_come_out_whole() {
        for i in [-4_194_303, -32_769, -1, 0, 1, 2, 32_768, 4_194_303] {
            assert_eq!(whole(i as f32), i);
        }
    }

    #[test]
    fn axis_forgets_half_turns() {
        assert!(Axis::from_degrees(10.0).angle_to(Axis::from_degrees(190.0)) < 1e-6);
        assert!(
            (Axis::from_degrees(1.0)
                .angle_to(Axis::from_degrees(179.0))
                .to_degrees()
                - 2.0)
                .abs()
                < 1e-4
        );
        assert!((Axis::from_degrees(30.0).degrees() - 30.0).abs() < 1e-4);
        assert_eq!(Axis::from_vector(Vec2::ZERO), None);
        assert_eq!(Axis::from_double_angle(Vec2::new(f32::NAN, 1.0)), None);
        assert_eq!(Axis::from_degrees(180.0), Axis::from_degrees(0.0));
    }

    #[test]
    fn frame_falls_back_when_the_tangent_is_no_use() {
        let n = Vec3::new(0.0, 0.0, 2.0);
        for t in [
            Vec4::ZERO,
            Vec4::new(0.0, 0.0, 1.0, 1.0),
            Vec4::new(f32::NAN, 0.0, 0.0, 1.0),
        ] {
            let (frame, usable) = Frame::new(n, t).expect("a normal");
            assert!(!usable);
            assert!(frame.tangent.is_normalized() && frame.tangent.dot(frame.normal).abs() < 1e-6);
        }
        let (frame, usable) = Frame::new(n, Vec4::new(1.0, 0.0, 0.3, -1.0)).expect("a normal");
        assert!(usable);
        assert!((frame.tangent - Vec3::X).length() < 1e-6);
        assert!((frame.bitangent + Vec3::Y).length() < 1e-6);
        assert!(Frame::new(Vec3::ZERO, Vec4::X).is_none());
    }

    proptest! {
        #[test]
        fn half_angle_doubles_back(theta in -10.0f32..10.0) {
            let axis = Axis::from_radians(theta);
            let d = axis.direction();
            prop_assert!((d.length() - 1.0).abs() < 1e-6 && d.x >= 0.0);
            let back = Axis::from_vector(d).unwrap();
            prop_assert!(back.angle_to(axis) < 1e-6);
            prop_assert!((0.0..180.0).contains(&axis.degrees()));
        }
    }
}
