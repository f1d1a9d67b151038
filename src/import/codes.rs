//! A PNG of stored numbers, read as they are: no colour, no gamma, no profile.

use crate::convention::storage::Codes;
use crate::error::{Error, Result};
use crate::map::Size;
use image::codecs::png::PngDecoder;
use image::{DynamicImage, ImageDecoder, Limits};
use std::io::Cursor;
use std::path::Path;

/// The most memory that a PNG's colour profile and texts may take together.
const EXTRAS_MAX: u64 = 16 << 20;

/// The numbers of a picture, texel by texel.
#[derive(Clone, Debug, PartialEq)]
pub struct Picture {
    /// Its size.
    pub size: Size,
    /// How many numbers a texel has, 1 or 2.
    pub numbers: usize,
    /// 8- or 16-bit codes in row order, top row first.
    pub codes: Codes,
}

/// Reads a grey PNG, with or without a second channel, of 8 or 16 bits.
///
/// # Errors
/// [`Error::Read`] when the file cannot be opened, [`Error::File`] when it is no such PNG.
pub fn read_codes(path: &Path) -> Result<Picture> {
    let bytes = super::read_file(path)?;
    let broken = |e: image::ImageError| Error::file(path, format!("it is no usable PNG: {e}"));
    let mut limits = Limits::default();
    limits.max_alloc = Some(EXTRAS_MAX);
    let mut decoder = PngDecoder::with_limits(Cursor::new(&bytes), limits).map_err(broken)?;
    let (width, height) = decoder.dimensions();
    let size = Size::new(width, height).map_err(|e| Error::file(path, e.to_string()))?;
    // Deflate packs at most 1032 to 1: a small file that claims more is not worth the memory.
    if decoder.total_bytes() > 8 * 1100 * bytes.len() as u64 {
        let problem = format!("it claims {size} texels in {} bytes", bytes.len());
        return Err(Error::file(path, problem));
    }
    let mut limits = Limits::default();
    limits.max_alloc = Some(8 * decoder.total_bytes() + (64 << 20));
    decoder.set_limits(limits).map_err(broken)?;
    let (numbers, codes) = match DynamicImage::from_decoder(decoder).map_err(broken)? {
        DynamicImage::ImageLuma8(p) => (1, Codes::U8(p.into_raw())),
        DynamicImage::ImageLumaA8(p) => (2, Codes::U8(p.into_raw())),
        DynamicImage::ImageLuma16(p) => (1, Codes::U16(p.into_raw())),
        DynamicImage::ImageLumaA16(p) => (2, Codes::U16(p.into_raw())),
        other => {
            let problem = format!("its colours are {:?}", other.color());
            let hint = "Stored numbers are grey, or grey with a second channel, of 8 or 16 bits";
            return Err(Error::file(path, problem).with_hint(hint));
        }
    };
    Ok(Picture {
        size,
        numbers,
        codes,
    })
}
