//! A PNG of stored numbers, or an OpenEXR file of floats, read as they are: no colour, no gamma, no profile.

use super::exr;
use super::numbers::{EXR, decode};
use crate::convention::storage::Codes;
use crate::error::{Error, Result};
use crate::map::Size;
use image::DynamicImage;
use image::codecs::png::PngDecoder;
use std::io::Cursor;
use std::path::Path;

/// The largest float that is taken for a width or a part of an axis, of either sign.
const LARGEST: f32 = 1e6;

/// The numbers of a picture, texel by texel.
#[derive(Clone, Debug, PartialEq)]
pub struct Picture {
    /// Its size.
    pub size: Size,
    /// How many numbers a texel has, 1 or 2.
    pub numbers: usize,
    /// 8- or 16-bit codes, or floats, in row order, top row first.
    pub codes: Codes,
}

/// Reads a grey PNG, with or without a second channel, of 8 or 16 bits; or an OpenEXR file of one or two channels, in the order
/// of the alphabet, halves as the floats that they are.
///
/// # Errors
/// [`Error::Read`] when the file cannot be opened, [`Error::File`] when it is no such file.
pub fn read_codes(path: &Path) -> Result<Picture> {
    let bytes = super::read_file(path)?;
    if bytes.starts_with(&EXR) {
        drop(bytes);
        return read_floats(path);
    }
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

fn read_floats(path: &Path) -> Result<Picture> {
    let mut names = exr::channels(path)?;
    names.sort();
    let numbers = names.len();
    if !(1..=2).contains(&numbers) {
        let problem = format!(
            "it has the channels {}; needed: one or two",
            names.join(", ")
        );
        return Err(Error::file(path, problem));
    }
    let (first, size) = exr::read_channel(path, &names[0])?;
    let all = match names.get(1) {
        None => first,
        Some(name) => {
            let (second, other) = exr::read_channel(path, name)?;
            if other != size {
                return Err(Error::file(path, "its parts differ in size"));
            }
            let pairs = first.into_iter().zip(second);
            pairs.flat_map(<[f32; 2]>::from).collect()
        }
    };
    // Nothing after this mends them.
    if all.iter().any(|x| x.is_nan() || x.abs() > LARGEST) {
        let problem = format!("it holds numbers beyond {LARGEST}, or none at all (NaN)");
        return Err(Error::file(path, problem).with_hint("Make or copy the file again"));
    }
    Ok(Picture {
        size,
        numbers,
        codes: Codes::F32(all),
    })
}
