//! Pixels in linear light, and their way to eight bits.

use crate::map::{Rect, Size};
use crate::math;
use rayon::prelude::*;
use std::sync::OnceLock;

/// A picture in linear light with Rec. 709 primaries: 1 is display white, values above it are kept. Row 0 is the top.
#[derive(Clone, Debug, PartialEq)]
pub struct Picture {
    size: Size,
    pixels: Vec<[f32; 3]>,
}

impl Picture {
    /// A picture of one colour.
    pub fn new(size: Size, colour: [f32; 3]) -> Self {
        Self {
            size,
            pixels: vec![colour; size.texels()],
        }
    }

    /// Width and height in pixels.
    pub fn size(&self) -> Size {
        self.size
    }

    /// Width in pixels.
    pub fn width(&self) -> u32 {
        self.size.width()
    }

    /// Height in pixels.
    pub fn height(&self) -> u32 {
        self.size.height()
    }

    /// Red, green and blue of every pixel in row order.
    pub fn pixels(&self) -> &[[f32; 3]] {
        &self.pixels
    }

    /// The same, to be written.
    pub fn pixels_mut(&mut self) -> &mut [[f32; 3]] {
        &mut self.pixels
    }

    /// One row, top row first.
    ///
    /// # Panics
    /// Below the picture.
    pub fn row(&self, y: u32) -> &[[f32; 3]] {
        let width = self.width() as usize;
        &self.pixels[y as usize * width..][..width]
    }

    /// One row, to be written.
    ///
    /// # Panics
    /// Below the picture.
    pub fn row_mut(&mut self, y: u32) -> &mut [[f32; 3]] {
        let width = self.width() as usize;
        &mut self.pixels[y as usize * width..][..width]
    }

    /// The pixel at column `x` and row `y`.
    ///
    /// # Panics
    /// Outside the picture.
    pub fn pixel(&self, x: u32, y: u32) -> [f32; 3] {
        self.row(y)[x as usize]
    }

    /// Copies `other` into this picture with its upper left corner at (x, y); what reaches outside is left out.
    pub fn paste(&mut self, other: &Self, x: u32, y: u32) {
        let width = other.width().min(self.width().saturating_sub(x)) as usize;
        for row in 0..other.height().min(self.height().saturating_sub(y)) {
            self.row_mut(y + row)[x as usize..][..width].copy_from_slice(&other.row(row)[..width]);
        }
    }

    /// Eight bits a channel, R, G, B in row order: sRGB-encoded and rounded to nearest, clipped at black and white.
    pub fn to_srgb8(&self) -> Vec<u8> {
        let mut bytes = vec![0; self.pixels.len() * 3];
        self.write_srgb8(self.size().rect(), &mut bytes, (self.width(), [0, 0]));
        bytes
    }

    /// Writes a rectangle as [`Picture::to_srgb8`] would into another picture of such bytes, which is `width` pixels wide, with
    /// the rectangle's upper left corner at `place`.
    ///
    /// # Panics
    /// When the rectangle reaches outside the picture, or at its place outside the other.
    pub fn write_srgb8(&self, rect: Rect, bytes: &mut [u8], (width, place): (u32, [u32; 2])) {
        assert!(place[0] + rect.width <= width, "inside the other picture");
        let codes = Codes::get();
        let (first, stride) = (place[1] as usize, width as usize * 3);
        let rows = &mut bytes[first * stride..(first + rect.height as usize) * stride];
        rows.par_chunks_mut(stride)
            .enumerate()
            .with_min_len(16)
            .for_each(|(y, row)| {
                let from = &self.row(rect.y + y as u32)[rect.x as usize..][..rect.width as usize];
                let row = &mut row[place[0] as usize * 3..][..from.len() * 3];
                for (to, pixel) in row.chunks_exact_mut(3).zip(from) {
                    to.copy_from_slice(&pixel.map(|c| codes.of(c)));
                }
            });
    }
}

/// The 8-bit sRGB codes of linear values, by table: a value's code is looked up by its leading bits, then raised past the one
/// threshold that may lie among values with these bits. There is no branch to guess wrong.
struct Codes {
    /// For the leading bits of each value from [`Codes::LOW`] to 1, the code of the least such value.
    first: Vec<u8>,
    /// The least value of the code after each.
    next: [f32; 256],
}

impl Codes {
    /// Bits of a value that are not looked at: those left tell values apart that differ by a 128th, and codes are farther apart.
    const SHIFT: u32 = 16;
    /// Bits of a value below which every code is 0: 2^-13, an eighth of a code.
    const LOW: u32 = (127 - 13) << 23;

    fn get() -> &'static Self {
        static CODES: OnceLock<Codes> = OnceLock::new();
        CODES.get_or_init(|| {
            let code = |bits: u32| (srgb_from_linear(f32::from_bits(bits)) * 255.0 + 0.5) as u8;
            let one = 1.0_f32.to_bits();
            let next = std::array::from_fn(|i| {
                if i == 255 {
                    return f32::INFINITY;
                }
                let (mut low, mut high) = (Self::LOW, one); // bits of positive numbers are in order
                while low < high {
                    let middle = low + (high - low) / 2;
                    if usize::from(code(middle)) > i {
                        high = middle;
                    } else {
                        low = middle + 1;
                    }
                }
                f32::from_bits(low)
            });
            let first = (Self::LOW >> Self::SHIFT..=one >> Self::SHIFT)
                .map(|top| code(top << Self::SHIFT))
                .collect();
            Self { first, next }
        })
    }

    fn of(&self, c: f32) -> u8 {
        // Not a number is the least, too.
        let c = c.max(f32::from_bits(Self::LOW)).min(1.0);
        let code = self.first[((c.to_bits() - Self::LOW) >> Self::SHIFT) as usize];
        code + u8::from(c >= self.next[usize::from(code)])
    }
}

/// Rec. 709 luminance of linear R, G, B.
pub(super) fn luminance([r, g, b]: [f32; 3]) -> f32 {
    0.2126 * r + 0.7152 * g + 0.0722 * b
}

/// IEC 61966-2-1: linear light to the encoded value, both clipped to [0, 1]; NaN is black.
pub fn srgb_from_linear(c: f32) -> f32 {
    if c.is_nan() || c <= 0.0 {
        0.0
    } else if c <= 0.003_130_8 {
        12.92 * c
    } else if c < 1.0 {
        1.055 * math::pow(c, 1.0 / 2.4) - 0.055
    } else {
        1.0
    }
}

/// The inverse of [`srgb_from_linear`].
pub fn linear_from_srgb(c: f32) -> f32 {
    if c.is_nan() || c <= 0.0 {
        0.0
    } else if c <= 0.040_45 {
        c / 12.92
    } else if c < 1.0 {
        math::pow((c + 0.055) / 1.055, 2.4)
    } else {
        1.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_eight_bit_value_comes_back() {
        let mut picture = Picture::new(Size::new(256, 1).unwrap(), [0.0; 3]);
        for (i, p) in picture.pixels_mut().iter_mut().enumerate() {
            *p = [linear_from_srgb(i as f32 / 255.0); 3];
        }
        for (i, c) in picture.to_srgb8().chunks(3).enumerate() {
            assert_eq!(c, [i as u8; 3]);
        }
    }

    #[test]
    fn codes_by_table_are_those_of_the_formula() {
        let codes = Codes::get();
        let formula = |c: f32| (srgb_from_linear(c) * 255.0 + 0.5) as u8;
        for step in 0..200_000 {
            let c = step as f32 / 190_000.0;
            assert_eq!(codes.of(c), formula(c), "{c}");
        }
        for least in &codes.next[..255] {
            for bits in [least.to_bits() - 1, least.to_bits(), least.to_bits() + 1] {
                let c = f32::from_bits(bits);
                assert_eq!(codes.of(c), formula(c), "{c}");
            }
        }
        for c in [
            0.0,
            -0.0,
            -1.0,
            f32::NAN,
            f32::INFINITY,
            f32::MIN_POSITIVE,
            1.0,
        ] {
            assert_eq!(codes.of(c), formula(c), "{c}");
        }
    }

    #[test]
    fn middle_grey_black_white_and_nonsense() {
        assert!((srgb_from_linear(0.18) - 0.461_356).abs() < 1e-5);
        let mut picture = Picture::new(Size::new(2, 1).unwrap(), [-1.0, 0.0, 9.0]);
        picture.pixels_mut()[1] = [f32::NAN, f32::INFINITY, 1.0];
        assert_eq!(picture.to_srgb8(), [0, 0, 255, 0, 255, 255]);
    }

    #[test]
    fn pasting_stays_inside() {
        let mut picture = Picture::new(Size::new(4, 3).unwrap(), [0.0; 3]);
        picture.paste(&Picture::new(Size::new(3, 3).unwrap(), [1.0; 3]), 2, 1);
        let lit = picture.pixels().iter().filter(|p| p[0] == 1.0).count();
        assert_eq!(lit, 4);
        picture.paste(&Picture::new(Size::new(3, 3).unwrap(), [1.0; 3]), 9, 9);
    }
}
