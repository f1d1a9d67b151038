//! Stored numbers as a PNG: grey for one number a texel, grey with a second channel for two.

use super::{Written, write_atomic};
use crate::convention::storage::Codes;
use crate::error::{Error, Result};
use crate::map::Size;
use image::codecs::png::{CompressionType, FilterType, PngEncoder};
use image::{ExtendedColorType, ImageEncoder};
use std::io;
use std::path::Path;

/// Writes `numbers` (1 or 2) 8- or 16-bit codes of every texel, in row order, top row first.
/// [`crate::import::codes::read_codes`] reads them.
///
/// # Errors
/// [`Error::Invalid`] when there are not as many codes as that, or they are floats, which no PNG holds; otherwise as
/// [`write_atomic`].
pub fn write_codes(path: &Path, size: Size, numbers: usize, codes: &Codes) -> Result<Written> {
    let (color, bytes): (_, &[u8]) = match (codes, numbers) {
        (Codes::U8(v), 1) => (ExtendedColorType::L8, v),
        (Codes::U8(v), 2) => (ExtendedColorType::La8, v),
        (Codes::U16(v), 1) => (ExtendedColorType::L16, bytemuck::cast_slice(v)),
        (Codes::U16(v), 2) => (ExtendedColorType::La16, bytemuck::cast_slice(v)),
        _ => {
            let value = format!("{numbers} a texel, {} in all", codes.len());
            let allowed = "allowed: one or two whole numbers of 8 or 16 bits";
            return Err(Error::invalid("the numbers of a PNG", value, allowed));
        }
    };
    if codes.len() != numbers * size.texels() {
        let allowed = format!("allowed: {} for {size}", numbers * size.texels());
        return Err(Error::invalid("the numbers of a PNG", codes.len(), allowed));
    }
    write_atomic(path, |file| {
        PngEncoder::new_with_quality(file, CompressionType::Default, FilterType::Adaptive)
            .write_image(bytes, size.width(), size.height(), color)
            .map_err(|e| match e {
                image::ImageError::IoError(e) => e,
                other => io::Error::other(other),
            })
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::import::codes::read_codes;
    use std::fs;

    #[test]
    fn codes_come_back_to_the_bit() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.png");
        let size = Size::new(37, 5).unwrap();
        for numbers in [1, 2] {
            let n = size.texels() * numbers;
            let bytes = Codes::U8((0..n).map(|i| (i * 7) as u8).collect());
            let words = Codes::U16((0..n).map(|i| (i * 1031) as u16).collect());
            for codes in [bytes, words] {
                write_codes(&path, size, numbers, &codes).unwrap();
                let back = read_codes(&path).unwrap();
                assert_eq!(
                    (back.size, back.numbers, &back.codes),
                    (size, numbers, &codes)
                );
            }
        }
        assert!(write_codes(&path, size, 1, &Codes::U8(vec![0; 3])).is_err());
        assert!(write_codes(&path, size, 1, &Codes::F32(vec![0.0; 185])).is_err());
    }

    #[test]
    fn what_is_no_picture_of_numbers_is_refused() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.png");
        fs::write(&path, b"no picture").unwrap();
        assert!(read_codes(&path).unwrap_err().to_string().contains("a.png"));
        image::RgbImage::new(2, 2).save(&path).unwrap();
        let e = read_codes(&path).unwrap_err().to_string();
        assert!(e.contains("Rgb8") && e.contains("grey"), "{e}");
        assert!(read_codes(&folder.path().join("none.png")).is_err());
    }
}
