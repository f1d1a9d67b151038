//! The numbers of a picture's channels as they are stored: no colour, no gamma, no profile. Whole numbers become 0 to 1.

use super::exr;
use crate::error::{Error, Result};
use crate::map::Size;
use image::codecs::png::PngDecoder;
use image::codecs::tiff::TiffDecoder;
use image::{DynamicImage, ImageDecoder, Limits};
use std::io::Cursor;
use std::path::Path;

/// The most memory that a picture's colour profile and texts may take together.
const EXTRAS_MAX: u64 = 16 << 20;

/// A picture that can be asked for its channels.
pub struct Numbers {
    size: Size,
    body: Body,
}

enum Body {
    /// PNG and TIFF, in memory.
    Picture(DynamicImage),
    /// OpenEXR, whose channels are read one by one.
    Exr(Vec<String>),
}

/// The endings of the files that [`Numbers::open`] takes.
pub const ENDINGS: [&str; 4] = ["png", "tif", "tiff", "exr"];

impl Numbers {
    /// Opens a PNG or TIFF of 8 or 16 bits or floats, or an OpenEXR file, by what it begins with.
    ///
    /// # Errors
    /// [`Error::Read`] when the file cannot be opened, [`Error::File`] when it is empty, no such picture, damaged or absurdly
    /// large.
    pub fn open(path: &Path) -> Result<Self> {
        let bytes = super::read_file(path)?;
        match bytes.get(..4) {
            _ if bytes.is_empty() => {
                Err(Error::file(path, "the file is empty").with_hint("Copy or export it once more"))
            }
            Some([0x76, 0x2f, 0x31, 0x01]) => {
                drop(bytes);
                let names = exr::channels(path)?;
                let first = names.first().map_or("R", String::as_str);
                let size = exr::channel_size(path, first)?;
                let body = Body::Exr(names);
                Ok(Self { size, body })
            }
            Some([0x89, b'P', b'N', b'G']) => decode(path, &bytes, "PNG", |bytes, limits| {
                PngDecoder::with_limits(Cursor::new(bytes), limits)
            })
            .map(Self::of),
            Some([b'I', b'I', ..] | [b'M', b'M', ..]) => {
                decode(path, &bytes, "TIFF", |bytes, limits| {
                    let mut decoder = TiffDecoder::new(Cursor::new(bytes))?;
                    decoder.set_limits(limits)?;
                    Ok(decoder)
                })
                .map(Self::of)
            }
            _ => Err(Error::file(path, "it is no PNG, TIFF or OpenEXR file")
                .with_hint("Save the texture as one of them: JPEG loses what a map is made of")),
        }
    }

    fn of((size, picture): (Size, DynamicImage)) -> Self {
        let body = Body::Picture(picture);
        Self { size, body }
    }

    /// Its size.
    pub fn size(&self) -> Size {
        self.size
    }

    /// The names of its channels: `r`, `g`, `b`, `a` of a picture, where a grey one has `r` alone; of an OpenEXR file, its own.
    pub fn channels(&self) -> Vec<String> {
        let words: &[&str] = match &self.body {
            Body::Exr(names) => return names.clone(),
            Body::Picture(picture) => match picture.color().channel_count() {
                1 => &["r"],
                2 => &["r", "a"],
                3 => &["r", "g", "b"],
                _ => &["r", "g", "b", "a"],
            },
        };
        words.iter().map(|w| (*w).to_owned()).collect()
    }

    /// The numbers of a channel in row order, top row first.
    ///
    /// # Errors
    /// [`Error::File`] when it has no such channel, or cannot be read on.
    pub fn plane(&self, path: &Path, channel: &str) -> Result<Vec<f32>> {
        match &self.body {
            Body::Exr(_) => {
                let (plane, size) = exr::read_channel(path, channel)?;
                if size == self.size {
                    Ok(plane)
                } else {
                    Err(Error::file(path, "its parts differ in size"))
                }
            }
            Body::Picture(picture) => {
                let names = self.channels();
                let at = names.iter().position(|n| n.eq_ignore_ascii_case(channel));
                let at = at.ok_or_else(|| {
                    let problem = format!(
                        "it has the channels {}; needed: {channel}",
                        names.join(", ")
                    );
                    Error::file(path, problem)
                })?;
                plane_of(picture, at).ok_or_else(|| {
                    Error::file(path, format!("its colours are {:?}", picture.color()))
                        .with_hint("Save it with 8 or 16 bits a channel")
                })
            }
        }
    }
}

/// Decodes a picture of which nothing is believed before its bytes could hold it.
pub(super) fn decode<'a, D: ImageDecoder>(
    path: &Path,
    bytes: &'a [u8],
    kind: &str,
    open: impl FnOnce(&'a [u8], Limits) -> image::ImageResult<D>,
) -> Result<(Size, DynamicImage)> {
    let broken = |e: image::ImageError| Error::file(path, format!("it is no usable {kind}: {e}"));
    let mut limits = Limits::default();
    limits.max_alloc = Some(EXTRAS_MAX + bytes.len() as u64);
    let mut decoder = open(bytes, limits).map_err(broken)?;
    let (width, height) = decoder.dimensions();
    let size = Size::new(width, height).map_err(|e| Error::file(path, e.to_string()))?;
    // Deflate packs at most 1032 to 1, and a bit may become a byte: a small file that claims more is not worth the memory.
    if decoder.total_bytes() > 8 * 1100 * bytes.len() as u64 {
        let problem = format!("it claims {size} texels in {} bytes", bytes.len());
        return Err(Error::file(path, problem));
    }
    let mut limits = Limits::default();
    limits.max_alloc = Some(8 * decoder.total_bytes() + (64 << 20));
    decoder.set_limits(limits).map_err(broken)?;
    let picture = DynamicImage::from_decoder(decoder).map_err(broken)?;
    Ok((size, picture))
}

/// Channel `at` of a picture; `None` where its numbers are of no kind that is known here.
fn plane_of(picture: &DynamicImage, at: usize) -> Option<Vec<f32>> {
    let n = usize::from(picture.color().channel_count());
    let of_bytes = |raw: &[u8]| {
        raw[at..]
            .iter()
            .step_by(n)
            .map(|v| f32::from(*v) / 255.0)
            .collect()
    };
    let of_words = |raw: &[u16]| {
        raw[at..]
            .iter()
            .step_by(n)
            .map(|v| f32::from(*v) / 65535.0)
            .collect()
    };
    let of_floats = |raw: &[f32]| raw[at..].iter().step_by(n).copied().collect();
    Some(match picture {
        DynamicImage::ImageLuma8(p) => of_bytes(p),
        DynamicImage::ImageLumaA8(p) => of_bytes(p),
        DynamicImage::ImageRgb8(p) => of_bytes(p),
        DynamicImage::ImageRgba8(p) => of_bytes(p),
        DynamicImage::ImageLuma16(p) => of_words(p),
        DynamicImage::ImageLumaA16(p) => of_words(p),
        DynamicImage::ImageRgb16(p) => of_words(p),
        DynamicImage::ImageRgba16(p) => of_words(p),
        DynamicImage::ImageRgb32F(p) => of_floats(p),
        DynamicImage::ImageRgba32F(p) => of_floats(p),
        _ => return None,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use image::{GrayImage, ImageFormat, Rgb32FImage, Rgba};
    use std::fs;

    #[test]
    fn numbers_come_as_they_are_stored() {
        let folder = tempfile::tempdir().unwrap();
        let path = |name: &str| folder.path().join(name);
        let rgba = image::ImageBuffer::from_fn(3, 2, |x, y| {
            Rgba([1000 * x as u16, 500 * y as u16, 65535, 7])
        });
        let rgba = DynamicImage::ImageRgba16(rgba);
        rgba.save(path("a.png")).unwrap();
        rgba.save_with_format(path("a.tif"), ImageFormat::Tiff)
            .unwrap();
        for name in ["a.png", "a.tif"] {
            let numbers = Numbers::open(&path(name)).unwrap();
            assert_eq!(numbers.size(), Size::new(3, 2).unwrap());
            assert_eq!(numbers.channels(), ["r", "g", "b", "a"]);
            let red = numbers.plane(&path(name), "R").unwrap();
            assert_eq!(red[2], 2000.0 / 65535.0);
            let green = numbers.plane(&path(name), "g").unwrap();
            assert_eq!((green[0], green[3]), (0.0, 500.0 / 65535.0));
        }
        let floats = Rgb32FImage::from_pixel(2, 2, image::Rgb([-0.5, 2.0, 0.25]));
        let floats = DynamicImage::ImageRgb32F(floats);
        floats
            .save_with_format(path("f.tif"), ImageFormat::Tiff)
            .unwrap();
        let numbers = Numbers::open(&path("f.tif")).unwrap();
        assert_eq!(numbers.plane(&path("f.tif"), "r").unwrap(), [-0.5; 4]);
    }

    #[test]
    fn what_is_no_picture_is_said() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("x.png");
        for (bytes, wanted) in [
            (&b""[..], "the file is empty"),
            (b"\xff\xd8\xff\xe0 jpeg", "no PNG, TIFF or OpenEXR"),
            (b"\x89PNG\r\n\x1a\n", "no usable PNG"),
            (b"II*\0\x08\0\0\0", "no usable TIFF"),
            (b"\x76\x2f\x31\x01", "damaged"),
        ] {
            fs::write(&path, bytes).unwrap();
            let error = Numbers::open(&path).err().unwrap().to_string();
            assert!(error.contains(wanted), "{error}");
        }
        GrayImage::new(2, 2).save(&path).unwrap();
        let error = Numbers::open(&path).unwrap().plane(&path, "g").unwrap_err();
        assert!(
            error
                .to_string()
                .contains("it has the channels r; needed: g"),
            "{error}"
        );
        let whole = fs::read(&path).unwrap();
        for cut in 1..whole.len() - 12 {
            fs::write(&path, &whole[..cut]).unwrap();
            assert!(Numbers::open(&path).is_err(), "{cut} bytes");
        }
    }
}
