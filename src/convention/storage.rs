//! How a texel may be stored: bits and encoding of the widths and of the direction, what that costs in bytes, and how far the
//! numbers that come back may be from those that went in.
//!
//! Widths are told apart by their ratio, so even steps of the width waste the bits of an integer on rough texels: over the
//! whole range, 8 bits are off by up to 29 % of a width of 0.01 in even steps, 4.8 % in steps of its square root (which is
//! glTF's roughness), and 1.4 % of any width in steps of its logarithm. A direction without a sign is a point of the circle of
//! (cos 2θ, sin 2θ): stored as such, its error is half that of a vector's with the same bits, and nothing wraps. A matrix (slope
//! covariance or its inverse) is no choice here: at widths of 0.01 and 0.5 halves leave nothing of its determinant.

use crate::error::{Error, Result, nearest_word};
use crate::map::{ALPHA_MAX, ALPHA_MIN, AnisoMap, Size, Wrap};
use crate::math::{self, half_angle};
use half::f16;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use std::f32::consts::PI;
use std::fmt;
use std::str::FromStr;

/// Texels that one thread takes at a time.
const BAND_TEXELS: usize = 1 << 15;

/// The bits of one number.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Depth {
    /// 256 even steps of the encoded value.
    U8,
    /// 65,536 even steps.
    U16,
    /// IEEE 754 half precision.
    F16,
    /// IEEE 754 single precision.
    F32,
}

impl Depth {
    /// From the fewest bytes to the most, integers first.
    pub const ALL: [Self; 4] = [Self::U8, Self::U16, Self::F16, Self::F32];

    /// Bytes of one number.
    pub fn bytes(self) -> usize {
        match self {
            Self::U8 => 1,
            Self::U16 | Self::F16 => 2,
            Self::F32 => 4,
        }
    }

    /// The word for it.
    pub fn name(self) -> &'static str {
        match self {
            Self::U8 => "u8",
            Self::U16 => "u16",
            Self::F16 => "f16",
            Self::F32 => "f32",
        }
    }

    /// The largest code of an integer; `None` for floats.
    pub fn top(self) -> Option<u16> {
        match self {
            Self::U8 => Some(255),
            Self::U16 => Some(65_535),
            Self::F16 | Self::F32 => None,
        }
    }

    /// Half the step of a float relative to its value (unit round-off); 0 for integers, whose steps are absolute.
    fn round_off(self) -> f32 {
        match self {
            Self::U8 | Self::U16 => 0.0,
            Self::F16 => 1.0 / 2048.0,
            Self::F32 => 0.5 * f32::EPSILON,
        }
    }
}

/// What is stored of a width.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum WidthEncoding {
    /// The width itself.
    Linear,
    /// Its square root: glTF's and Disney's roughness.
    Sqrt,
    /// Its natural logarithm.
    Log,
}

impl WidthEncoding {
    /// Every encoding.
    pub const ALL: [Self; 3] = [Self::Linear, Self::Sqrt, Self::Log];

    /// The word for it.
    pub fn name(self) -> &'static str {
        match self {
            Self::Linear => "linear",
            Self::Sqrt => "sqrt",
            Self::Log => "log",
        }
    }

    #[inline(always)]
    fn forward(self, alpha: f32) -> f32 {
        match self {
            Self::Linear => alpha,
            Self::Sqrt => alpha.sqrt(),
            Self::Log => math::ln(alpha),
        }
    }

    #[inline(always)]
    fn back(self, value: f32) -> f32 {
        match self {
            Self::Linear => value,
            Self::Sqrt => value * value,
            Self::Log => math::exp(value),
        }
    }
}

/// What is stored of the x axis.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum AxisEncoding {
    /// (cos 2θ, sin 2θ).
    Double,
    /// (cos θ, sin θ) with cos θ >= 0: no sign, so it must be decoded before it is blended.
    Vector,
    /// θ alone, in [0, pi): one number less, and it wraps.
    Angle,
}

impl AxisEncoding {
    /// Every encoding.
    pub const ALL: [Self; 3] = [Self::Double, Self::Vector, Self::Angle];

    /// The word for it.
    pub fn name(self) -> &'static str {
        match self {
            Self::Double => "double",
            Self::Vector => "vector",
            Self::Angle => "angle",
        }
    }

    /// Numbers that it takes.
    pub fn numbers(self) -> usize {
        match self {
            Self::Double | Self::Vector => 2,
            Self::Angle => 1,
        }
    }
}

/// How both widths are stored.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct WidthStorage {
    /// The bits of each.
    pub depth: Depth,
    /// What is stored.
    pub encoding: WidthEncoding,
    /// The width that integers begin at, the code 0; floats do not use it. 0 <= `low` < `high`, and over 0 for `log`.
    pub low: f32,
    /// The width of an integer's largest code.
    pub high: f32,
}

impl WidthStorage {
    /// Over the whole range that a map may hold: 0 to [`ALPHA_MAX`], and from [`ALPHA_MIN`] for the logarithm.
    pub fn new(depth: Depth, encoding: WidthEncoding) -> Self {
        let low = match encoding {
            WidthEncoding::Linear | WidthEncoding::Sqrt => 0.0,
            WidthEncoding::Log => ALPHA_MIN,
        };
        Self {
            depth,
            encoding,
            low,
            high: ALPHA_MAX,
        }
    }

    /// The same over just the widths that there are, which makes an integer's steps finer. Wherever `low` and `high` lie, the
    /// result is a range: one width alone gets a little room above it.
    #[must_use]
    pub fn over(self, low: f32, high: f32) -> Self {
        // `max` lets a NaN go by.
        let low = low.max(ALPHA_MIN).clamp(ALPHA_MIN, ALPHA_MAX);
        Self {
            low,
            high: high.max(1.001 * low).min(1.001 * ALPHA_MAX),
            ..self
        }
    }

    /// Whether the range can be used, as [`WidthStorage::low`] says: asked of every range that was read.
    pub fn is_sound(&self) -> bool {
        let from = if self.encoding == WidthEncoding::Log {
            f32::MIN_POSITIVE
        } else {
            0.0
        };
        self.low >= from && self.high > self.low && self.high <= 1e6
    }

    /// A plane of widths as it is stored, one number each.
    pub fn pack(&self, widths: &[f32]) -> Codes {
        let codec = self.codec();
        codes(self.depth, 1, widths.len(), |i| {
            [codec.encode(widths[i]), 0.0]
        })
    }

    /// The plane that a reader gets of it.
    ///
    /// # Panics
    /// When there are fewer numbers than `widths` is long.
    pub fn unpack(&self, codes: &Codes, widths: &mut [f32]) {
        let codec = self.codec();
        let bands = widths.par_chunks_mut(BAND_TEXELS).enumerate();
        bands.for_each(|(band, widths)| {
            for (j, width) in widths.iter_mut().enumerate() {
                *width = codec.decode(codes.number(band * BAND_TEXELS + j));
            }
        });
    }

    /// The arithmetic of it, worked out once.
    pub fn codec(&self) -> WidthCodec {
        let Some(top) = self.depth.top() else {
            return WidthCodec {
                encoding: self.encoding,
                offset: 0.0,
                step: 1.0,
                top: 0.0,
            };
        };
        let (low, high) = (
            self.encoding.forward(self.low),
            self.encoding.forward(self.high),
        );
        WidthCodec {
            encoding: self.encoding,
            offset: low,
            step: (high - low) / f32::from(top),
            top: f32::from(top),
        }
    }

    /// The largest error of a stored width relative to itself, `alpha` inside the range: half a step of what is stored, through
    /// the encoding's slope. Of a lobe's peak it is twice that, since both widths stand in its norm.
    pub fn relative_error(&self, alpha: f32) -> f32 {
        let value = self.encoding.forward(alpha).abs();
        let half = match self.depth.top() {
            Some(_) => 0.5 * self.codec().step,
            None => value * self.depth.round_off(),
        };
        match self.encoding {
            WidthEncoding::Linear => half / alpha,
            WidthEncoding::Sqrt => (2.0 * value + half) * half / alpha,
            WidthEncoding::Log => half.exp_m1(),
        }
    }
}

/// Widths to stored values and back: branch-free after inlining, for loops over texels.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WidthCodec {
    encoding: WidthEncoding,
    offset: f32,
    step: f32,
    /// The largest code, or 0 for floats.
    top: f32,
}

impl WidthCodec {
    /// The code of a width > 0 as a whole number, clamped to the range; of floats, the value before it is rounded.
    #[inline(always)]
    pub fn encode(&self, alpha: f32) -> f32 {
        let value = self.encoding.forward(alpha);
        if self.top == 0.0 {
            value
        } else {
            math::round_fast(((value - self.offset) / self.step).clamp(0.0, self.top))
        }
    }

    /// The width of a code, inside what a map may hold.
    #[inline(always)]
    pub fn decode(&self, code: f32) -> f32 {
        self.encoding
            .back(self.offset + code * self.step)
            .clamp(ALPHA_MIN, ALPHA_MAX)
    }

    /// [`Self::decode`] in place. The choice of encoding is made once, so that the loop vectorises where the caller's does.
    #[inline(always)]
    pub fn decode_all(&self, codes: &mut [f32]) {
        #[inline(always)]
        fn all(codec: WidthCodec, codes: &mut [f32]) {
            for code in codes {
                *code = codec.decode(*code);
            }
        }
        let with = |encoding| Self { encoding, ..*self };
        match self.encoding {
            WidthEncoding::Linear => all(with(WidthEncoding::Linear), codes),
            WidthEncoding::Sqrt => all(with(WidthEncoding::Sqrt), codes),
            WidthEncoding::Log => all(with(WidthEncoding::Log), codes),
        }
    }
}

/// How the x axis is stored.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct AxisStorage {
    /// The bits of each number.
    pub depth: Depth,
    /// What is stored.
    pub encoding: AxisEncoding,
}

impl AxisStorage {
    /// An axis stored so.
    pub fn new(depth: Depth, encoding: AxisEncoding) -> Self {
        Self { depth, encoding }
    }

    /// Axes as they are stored, one or two numbers each, from planes of cos 2θ and sin 2θ.
    ///
    /// # Panics
    /// When `sin2` is shorter than `cos2`.
    pub fn pack(&self, cos2: &[f32], sin2: &[f32]) -> Codes {
        let codec = self.codec();
        codes(self.depth, self.encoding.numbers(), cos2.len(), |i| {
            codec.encode(cos2[i], sin2[i])
        })
    }

    /// The planes that a reader gets of them.
    ///
    /// # Panics
    /// When there are fewer numbers than the planes hold axes.
    pub fn unpack(&self, codes: &Codes, cos2: &mut [f32], sin2: &mut [f32]) {
        let (codec, numbers) = (self.codec(), self.encoding.numbers());
        let bands = cos2
            .par_chunks_mut(BAND_TEXELS)
            .zip(sin2.par_chunks_mut(BAND_TEXELS));
        bands.enumerate().for_each(|(band, (cos2, sin2))| {
            for (j, (c, s)) in cos2.iter_mut().zip(sin2).enumerate() {
                let i = numbers * (band * BAND_TEXELS + j);
                (*c, *s) = codec.decode([codes.number(i), codes.number(i + numbers - 1)]);
            }
        });
    }

    /// The arithmetic of it, worked out once.
    pub fn codec(&self) -> AxisCodec {
        // Numbers from -1 to 1 lie around the middle code, which is exactly 0: axes along u and v come back as they were.
        // With 255 even steps from -1 to 1 none could.
        let (offset, step) = match (self.depth.top(), self.encoding) {
            (None, _) => (0.0, 1.0),
            (Some(top), AxisEncoding::Angle) => (0.0, PI / f32::from(top)),
            (Some(top), _) => {
                let middle = f32::from(top / 2 + 1);
                (middle, 1.0 / (middle - 1.0))
            }
        };
        AxisCodec {
            encoding: self.encoding,
            whole: self.depth.top().is_some(),
            offset,
            step,
        }
    }

    /// The largest angle in radians between an axis and what comes back: half a step of an angle, or of both numbers of a
    /// vector at once, which turns the axis by half as much when the vector is that of the double angle.
    pub fn angle_error(&self) -> f32 {
        let half = match (self.depth.top(), self.encoding) {
            (Some(_), _) => 0.5 * self.codec().step,
            // The last numbers below pi lie between 2 and 4; those of vectors, where both are large, between 1/2 and 1.
            (None, AxisEncoding::Angle) => 2.0 * self.depth.round_off(),
            (None, _) => 0.5 * self.depth.round_off(),
        };
        match self.encoding {
            AxisEncoding::Angle => half,
            AxisEncoding::Vector => half * std::f32::consts::SQRT_2,
            AxisEncoding::Double => half * std::f32::consts::FRAC_1_SQRT_2,
        }
    }
}

/// Axes to stored values and back: branch-free after inlining, for loops over texels.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AxisCodec {
    encoding: AxisEncoding,
    whole: bool,
    offset: f32,
    step: f32,
}

impl AxisCodec {
    /// The codes of a unit vector (cos 2θ, sin 2θ) as whole numbers; of floats, the values before they are rounded. An angle
    /// is the first of the two.
    #[inline(always)]
    pub fn encode(&self, cos2: f32, sin2: f32) -> [f32; 2] {
        let (a, b) = match self.encoding {
            AxisEncoding::Double => (cos2, sin2),
            AxisEncoding::Vector => half_angle(cos2, sin2),
            AxisEncoding::Angle => {
                let theta = 0.5 * math::atan2(sin2, cos2);
                (if theta < 0.0 { theta + PI } else { theta }, 0.0)
            }
        };
        [self.code(a), self.code(b)]
    }

    /// (cos 2θ, sin 2θ), of unit length, of two codes.
    #[inline(always)]
    pub fn decode(&self, codes: [f32; 2]) -> (f32, f32) {
        let [a, b] = codes.map(|code| (code - self.offset) * self.step);
        let (c, s) = match self.encoding {
            AxisEncoding::Double => (a, b),
            AxisEncoding::Vector => (a * a - b * b, 2.0 * a * b),
            AxisEncoding::Angle => {
                let (s, c) = math::sin_cos(2.0 * a);
                return (c, s);
            }
        };
        let length = (c * c + s * s).sqrt();
        // A vector that is too short to have a direction is no axis: that along u stands for it.
        let usable = length >= math::AXIS_MIN_LENGTH;
        let inverse = if usable { 1.0 / length } else { 0.0 };
        (if usable { c * inverse } else { 1.0 }, s * inverse)
    }

    /// [`Self::decode`] in place, the first codes in `cos2` and the second in `sin2`. The choice of encoding is made once, so that
    /// the loop vectorises where the caller's does.
    #[inline(always)]
    pub fn decode_all(&self, cos2: &mut [f32], sin2: &mut [f32]) {
        #[inline(always)]
        fn all(codec: AxisCodec, cos2: &mut [f32], sin2: &mut [f32]) {
            for (c, s) in cos2.iter_mut().zip(sin2) {
                (*c, *s) = codec.decode([*c, *s]);
            }
        }
        let with = |encoding| Self { encoding, ..*self };
        match self.encoding {
            AxisEncoding::Double => all(with(AxisEncoding::Double), cos2, sin2),
            AxisEncoding::Vector => all(with(AxisEncoding::Vector), cos2, sin2),
            AxisEncoding::Angle => all(with(AxisEncoding::Angle), cos2, sin2),
        }
    }

    #[inline(always)]
    fn code(&self, value: f32) -> f32 {
        if self.whole {
            math::round_fast(value / self.step + self.offset)
        } else {
            value
        }
    }
}

/// How the texels of a map are stored. As words: `u8-log` (then the axis has the same bits, as a double angle), `f32`,
/// `f16/u8-vector`, `u16-sqrt/u8-angle`; [`WidthStorage::low`] and `high` are no part of the name.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Storage {
    /// Both widths.
    pub widths: WidthStorage,
    /// The x axis.
    pub axis: AxisStorage,
}

impl Storage {
    /// What the program itself works with: 16 bytes a texel.
    pub const FULL: Self = Self {
        widths: WidthStorage {
            depth: Depth::F32,
            encoding: WidthEncoding::Linear,
            low: 0.0,
            high: ALPHA_MAX,
        },
        axis: AxisStorage {
            depth: Depth::F32,
            encoding: AxisEncoding::Double,
        },
    };

    /// All numbers with the same bits; the axis as a double angle.
    pub fn new(depth: Depth, encoding: WidthEncoding) -> Self {
        Self {
            widths: WidthStorage::new(depth, encoding),
            axis: AxisStorage::new(depth, AxisEncoding::Double),
        }
    }

    /// Bytes of a texel in memory, and in a file that is not compressed.
    pub fn bytes_per_texel(&self) -> usize {
        2 * self.widths.depth.bytes() + self.axis.encoding.numbers() * self.axis.depth.bytes()
    }

    /// The map as it is stored.
    pub fn pack(&self, map: &AnisoMap) -> Packed {
        let widths = self.widths.codec();
        Packed {
            storage: *self,
            widths: codes(self.widths.depth, 2, map.size().texels(), |i| {
                [
                    widths.encode(map.alpha_x()[i]),
                    widths.encode(map.alpha_y()[i]),
                ]
            }),
            axis: self.axis.pack(map.cos2(), map.sin2()),
        }
    }

    /// What a reader gets of a map that was stored so. The same map gives the same bits, on any number of threads.
    pub fn quantise(&self, map: &AnisoMap) -> AnisoMap {
        if *self == Self::FULL {
            return map.clone();
        }
        self.pack(map)
            .unpack(map.size(), map.wrap())
            .expect("as many codes as texels")
    }
}

/// The numbers of one group of channels, texel by texel.
#[derive(Clone, Debug, PartialEq)]
pub enum Codes {
    /// 8-bit codes.
    U8(Vec<u8>),
    /// 16-bit codes.
    U16(Vec<u16>),
    /// Halves.
    F16(Vec<f16>),
    /// Floats.
    F32(Vec<f32>),
}

impl Codes {
    /// How many numbers there are.
    pub fn len(&self) -> usize {
        match self {
            Self::U8(v) => v.len(),
            Self::U16(v) => v.len(),
            Self::F16(v) => v.len(),
            Self::F32(v) => v.len(),
        }
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The nth as a plain number.
    ///
    /// # Panics
    /// Beyond the last.
    #[inline(always)]
    pub fn number(&self, n: usize) -> f32 {
        match self {
            Self::U8(v) => f32::from(v[n]),
            Self::U16(v) => f32::from(v[n]),
            Self::F16(v) => v[n].to_f32(),
            Self::F32(v) => v[n],
        }
    }
}

/// A map in the form it is stored in.
#[derive(Clone, Debug, PartialEq)]
pub struct Packed {
    /// What the numbers mean.
    pub storage: Storage,
    /// alpha_x and alpha_y of every texel in row order, top row first.
    pub widths: Codes,
    /// The one or two numbers of every texel's axis.
    pub axis: Codes,
}

impl Packed {
    /// The map that a reader gets.
    ///
    /// # Errors
    /// When there are not as many numbers as a map of this size needs.
    pub fn unpack(&self, size: Size, wrap: Wrap) -> Result<AnisoMap> {
        let numbers = self.storage.axis.encoding.numbers();
        let (widths, axis) = (self.storage.widths.codec(), self.storage.axis.codec());
        if self.widths.len() != 2 * size.texels() || self.axis.len() != numbers * size.texels() {
            let found = format!("{} and {} numbers", self.widths.len(), self.axis.len());
            return Err(Error::invalid(
                "a packed map",
                found,
                format!(
                    "allowed: 2 and {numbers} for each of {} texels",
                    size.texels()
                ),
            ));
        }
        let mut map = AnisoMap::unfilled(size, wrap);
        let rows = (BAND_TEXELS / size.width() as usize).max(1) as u32;
        map.bands_mut(rows).into_par_iter().for_each(|band| {
            let start = band.rect.y as usize * size.width() as usize;
            for j in 0..band.rect.texels() {
                let i = start + j;
                band.alpha_x[j] = widths.decode(self.widths.number(2 * i));
                band.alpha_y[j] = widths.decode(self.widths.number(2 * i + 1));
                let second = self.axis.number(numbers * i + numbers - 1);
                (band.cos2[j], band.sin2[j]) = axis.decode([self.axis.number(numbers * i), second]);
            }
        });
        Ok(map)
    }
}

/// The first `numbers` of what `of` gives for every texel, as codes of this depth.
fn codes(
    depth: Depth,
    numbers: usize,
    texels: usize,
    of: impl Fn(usize) -> [f32; 2] + Sync,
) -> Codes {
    // Codes are whole numbers inside their range.
    match depth {
        Depth::U8 => Codes::U8(fill(texels, numbers, |i| of(i).map(|x| x as u8))),
        Depth::U16 => Codes::U16(fill(texels, numbers, |i| of(i).map(|x| x as u16))),
        Depth::F16 => Codes::F16(fill(texels, numbers, |i| of(i).map(f16::from_f32))),
        Depth::F32 => Codes::F32(fill(texels, numbers, of)),
    }
}

fn fill<T: Copy + Default + Send>(
    texels: usize,
    numbers: usize,
    of: impl Fn(usize) -> [T; 2] + Sync,
) -> Vec<T> {
    let mut out = vec![T::default(); texels * numbers];
    out.par_chunks_mut(BAND_TEXELS * numbers)
        .enumerate()
        .for_each(|(band, out)| {
            for (j, texel) in out.chunks_exact_mut(numbers).enumerate() {
                texel.copy_from_slice(&of(band * BAND_TEXELS + j)[..numbers]);
            }
        });
    out
}

impl fmt::Display for WidthStorage {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let plain = self.depth.top().is_none() && self.encoding == WidthEncoding::Linear;
        if plain {
            f.write_str(self.depth.name())
        } else {
            write!(f, "{}-{}", self.depth.name(), self.encoding.name())
        }
    }
}

impl fmt::Display for AxisStorage {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}-{}", self.depth.name(), self.encoding.name())
    }
}

impl fmt::Display for Storage {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let usual = AxisStorage::new(self.widths.depth, AxisEncoding::Double);
        if self.axis == usual {
            self.widths.fmt(f)
        } else {
            write!(f, "{}/{}", self.widths, self.axis)
        }
    }
}

impl FromStr for Storage {
    type Err = Error;

    fn from_str(word: &str) -> Result<Self> {
        let (widths, axis) = match word.split_once('/') {
            Some((widths, axis)) => (widths, Some(axis)),
            None => (word, None),
        };
        let (depth, encoding) = match widths.split_once('-') {
            Some((depth, encoding)) => (find(depth, word)?, find(encoding, word)?),
            None => {
                let depth: Depth = find(widths, word)?;
                if depth.top().is_some() {
                    let hint = format!("Say how: for example `{widths}-log`");
                    return Err(unknown(word).with_hint(hint));
                }
                (depth, WidthEncoding::Linear)
            }
        };
        let axis = match axis.map(|a| a.split_once('-').ok_or_else(|| unknown(word))) {
            Some(parts) => {
                let (depth, encoding) = parts?;
                AxisStorage::new(find(depth, word)?, find(encoding, word)?)
            }
            None => AxisStorage::new(depth, AxisEncoding::Double),
        };
        Ok(Self {
            widths: WidthStorage::new(depth, encoding),
            axis,
        })
    }
}

/// A variant by its word; `whole` is the name that the word is part of.
fn find<T: Named>(word: &str, whole: &str) -> Result<T> {
    let found = T::all().iter().find(|v| v.word() == word);
    found.copied().ok_or_else(|| {
        let words = T::all().iter().map(|v| v.word());
        match nearest_word(word, words) {
            Some(near) => unknown(whole).with_hint(format!("Did you mean `{near}`?")),
            None => unknown(whole),
        }
    })
}

fn unknown(word: &str) -> Error {
    Error::invalid(
        "the storage",
        format!("`{word}`"),
        "allowed: f32, f16, or u8 or u16 with -linear, -sqrt or -log; then, if the axis is stored otherwise, a slash and u8, \
         u16, f16 or f32 with -double, -vector or -angle, as in u8-log/u16-angle",
    )
}

/// A set of variants that have words.
trait Named: Copy + 'static {
    fn all() -> &'static [Self];
    fn word(self) -> &'static str;
}

macro_rules! named {
    ($($type:ty),*) => {$(
        impl Named for $type {
            fn all() -> &'static [Self] {
                &Self::ALL
            }
            fn word(self) -> &'static str {
                self.name()
            }
        }
    )*};
}
named!(Depth, WidthEncoding, AxisEncoding);

#[cfg(test)]
mod tests {
    use super::*;
    use crate::map::Texel;
    use crate::math::Axis;
    use proptest::prelude::*;

    fn widths(word: &str) -> WidthStorage {
        word.parse::<Storage>().unwrap().widths
    }

    fn every() -> Vec<Storage> {
        let mut all = Vec::new();
        for depth in Depth::ALL {
            for encoding in WidthEncoding::ALL {
                for axis in AxisEncoding::ALL {
                    all.push(Storage {
                        widths: WidthStorage::new(depth, encoding),
                        axis: AxisStorage::new(depth, axis),
                    });
                }
            }
        }
        all
    }

    /// One row of texels: widths growing by a ratio, directions all around.
    fn sweep(low: f32, high: f32) -> AnisoMap {
        let size = Size::new(4096, 1).unwrap();
        let texel = Texel {
            alpha_x: low,
            alpha_y: low,
            axis: Axis::U,
        };
        let mut map = AnisoMap::constant(size, Wrap::Repeat, texel);
        let mut region = map.region_mut();
        for i in 0..4096 {
            let t = i as f32 / 4096.0;
            region.set(
                i,
                Texel {
                    alpha_x: low * (high / low).powf(t),
                    alpha_y: high * (low / high).powf(t),
                    axis: Axis::from_degrees(180.0 * t),
                },
            );
        }
        map
    }

    #[test]
    fn half_steps_are_those_of_the_table() {
        // Half a step in percent at alpha .01, .03, .1, .3; linear and sqrt over [0, 1], as glTF has them.
        let unit = |word| WidthStorage {
            low: 0.0,
            high: 1.0,
            ..widths(word)
        };
        let table = [
            (unit("u8-linear"), [19.6, 6.5, 1.96, 0.65]),
            (unit("u8-sqrt"), [3.96, 2.28, 1.24, 0.72]),
            (widths("u8-log"), [1.44, 1.44, 1.44, 1.44]),
            (unit("u16-linear"), [0.0763, 0.0254, 0.00763, 0.00254]),
            (widths("f16"), [0.0488, 0.0488, 0.0488, 0.0488]),
        ];
        for (storage, percent) in table {
            for (alpha, want) in [0.01, 0.03, 0.1, 0.3].into_iter().zip(percent) {
                let bound = 100.0 * storage.relative_error(alpha);
                assert!(
                    (bound / want - 1.0).abs() < 0.02,
                    "{storage} {alpha}: {bound}"
                );
            }
        }
    }

    #[test]
    fn direction_steps_are_those_of_the_table() {
        for (word, degrees) in [
            ("u8-log/u8-angle", 0.353),
            ("u8-log/u8-vector", 0.319),
            ("u8-log/u8-double", 0.160),
            ("u8-log/u16-vector", 0.00124),
            ("u8-log/f16-vector", 0.0198),
            ("u8-log/f16-angle", 0.056),
        ] {
            let storage: Storage = word.parse().unwrap();
            let bound = storage.axis.angle_error().to_degrees();
            assert!((bound / degrees - 1.0).abs() < 0.01, "{word}: {bound}");
        }
    }

    #[test]
    fn no_stored_texel_is_further_off_than_the_bounds_say() {
        let map = sweep(0.004, 1.2);
        for storage in every() {
            let back = storage.quantise(&map);
            let (mut worst, mut turned) = (0.0f32, 0.0f32);
            for i in 0..4096 {
                let (was, is) = (map.texel_at(i), back.texel_at(i));
                let bound = storage.widths.relative_error(was.alpha_x) + 1e-6;
                worst = worst.max((is.alpha_x / was.alpha_x - 1.0).abs() / bound);
                turned = turned.max(was.axis.angle_to(is.axis));
                assert!((is.axis.double_angle().length() - 1.0).abs() < 1e-6);
            }
            let angle = storage.axis.angle_error() + 5e-7;
            assert!(
                worst <= 1.001 && turned <= 1.001 * angle,
                "{storage}: {worst} {turned} {angle}"
            );
            // The bounds are near what is seen, so that nothing is refused for nothing.
            if storage.widths.depth == Depth::U8 {
                assert!(
                    worst > 0.8 && turned > 0.8 * angle,
                    "{storage}: {worst} {turned} {angle}"
                );
            }
        }
    }

    #[test]
    fn axes_along_u_and_v_come_back_as_they_were() {
        for storage in every() {
            let codec = storage.axis.codec();
            let (c, s) = codec.decode(codec.encode(1.0, 0.0));
            assert!((c - 1.0).abs() < 1e-6 && s.abs() < 1e-6, "{storage}");
            let (c, s) = codec.decode(codec.encode(-1.0, 0.0));
            let exact = storage.axis.encoding != AxisEncoding::Angle;
            assert!(
                !exact || ((c + 1.0).abs() < 1e-6 && s.abs() < 1e-6),
                "{storage}"
            );
        }
    }

    #[test]
    fn a_range_of_its_own_makes_steps_finer_and_is_always_a_range() {
        let all = widths("u8-log");
        let own = all.over(0.1, 0.4);
        assert!(own.relative_error(0.2) < 0.2 * all.relative_error(0.2));
        for (low, high) in [
            (0.2, 0.2),
            (0.5, 0.1),
            (-1.0, 9.0),
            (1.5, 1.5),
            (f32::NAN, f32::NAN),
        ] {
            let range = all.over(low, high);
            assert!(range.is_sound(), "{low} {high}: {range:?}");
        }
        let bad = WidthStorage { low: 0.0, ..all };
        assert!(
            !bad.is_sound()
                && !WidthStorage {
                    high: f32::NAN,
                    ..all
                }
                .is_sound()
        );
    }

    #[test]
    fn names_come_back_and_wrong_ones_are_told() {
        for storage in every() {
            assert_eq!(storage.to_string().parse::<Storage>().unwrap(), storage);
        }
        assert_eq!(Storage::FULL.to_string(), "f32");
        assert_eq!(Storage::FULL, "f32".parse().unwrap());
        assert_eq!(Storage::FULL.bytes_per_texel(), 16);
        let bytes = |word: &str| word.parse::<Storage>().unwrap().bytes_per_texel();
        assert_eq!(
            (bytes("u8-log"), bytes("u16-sqrt/u8-angle"), bytes("f16")),
            (4, 5, 8)
        );
        for (word, hint) in [
            ("u8", "u8-log"),
            ("u8-lo", "`log`"),
            ("u32-log", "u8-log/"),
            ("f16/x", "u8-log/"),
        ] {
            let e = word.parse::<Storage>().unwrap_err().to_string();
            assert!(e.contains(&format!("`{word}`")) && e.contains(hint), "{e}");
        }
    }

    #[test]
    fn planes_alone_come_back_as_those_of_a_whole_map() {
        let map = sweep(0.004, 1.2);
        // Floats alone are copied, and not read back.
        for storage in every().into_iter().filter(|s| *s != Storage::FULL) {
            let whole = storage.quantise(&map);
            let n = map.size().texels();
            let (mut widths, mut cos2, mut sin2) = (vec![0.0; n], vec![0.0; n], vec![0.0; n]);
            let codes = storage.widths.pack(map.alpha_y());
            storage.widths.unpack(&codes, &mut widths);
            let codes = storage.axis.pack(map.cos2(), map.sin2());
            storage.axis.unpack(&codes, &mut cos2, &mut sin2);
            assert_eq!(widths, whole.alpha_y(), "{storage}");
            assert_eq!((&*cos2, &*sin2), (whole.cos2(), whole.sin2()), "{storage}");
        }
    }

    #[test]
    fn a_packed_map_of_another_size_is_refused() {
        let packed = Storage::new(Depth::U8, WidthEncoding::Log).pack(&sweep(0.1, 0.2));
        assert!(
            packed
                .unpack(Size::new(64, 64).unwrap(), Wrap::Repeat)
                .is_ok()
        );
        assert!(
            packed
                .unpack(Size::new(64, 65).unwrap(), Wrap::Repeat)
                .is_err()
        );
    }

    proptest! {
        #[test]
        fn what_was_stored_once_is_stored_the_same_again(alpha in 1e-3f32..1.5, degrees in 0.0f32..180.0) {
            let axis = Axis::from_degrees(degrees);
            for storage in every().into_iter().filter(|s| s.widths.depth.top().is_some()) {
                let (w, a) = (storage.widths.codec(), storage.axis.codec());
                let code = w.encode(alpha);
                // A width under the map's floor is read as the floor.
                prop_assert!(w.decode(code) == ALPHA_MIN || w.encode(w.decode(code)) == code, "{storage} {alpha}");
                let codes = a.encode(axis.cos2, axis.sin2);
                let top = f32::from(storage.axis.depth.top().unwrap_or(u16::MAX));
                prop_assert!(codes.iter().all(|c| (0.0..=top).contains(c) && c.fract() == 0.0));
            }
        }
    }
}
