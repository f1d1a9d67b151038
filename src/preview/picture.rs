//! Pixels in linear light, and their way to eight bits.

use crate::map::Size;
use crate::math;
use rayon::prelude::*;

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
        self.pixels
            .par_iter()
            .flat_map_iter(|p| p.map(|c| (srgb_from_linear(c) * 255.0 + 0.5) as u8))
            .collect()
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
