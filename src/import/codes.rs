//! A PNG of stored numbers, read as they are: no colour, no gamma, no profile.

use super::numbers::decode;
use crate::convention::storage::Codes;
use crate::error::{Error, Result};
use crate::map::Size;
use image::DynamicImage;
use image::codecs::png::PngDecoder;
use std::io::Cursor;
use std::path::Path;

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
    let open = |bytes, limits| PngDecoder::with_limits(Cursor::new(bytes), limits);
    let (size, picture) = decode(path, &bytes, "PNG", open)?;
    let (numbers, codes) = match picture {
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
