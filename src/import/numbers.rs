//! The numbers of a picture's channels as they are stored: no colour, no gamma, no profile. Whole numbers become 0 to 1.

use super::exr;
use crate::error::{Error, Result, open_filled};
use crate::map::Size;
use image::codecs::png::PngDecoder;
use image::codecs::tiff::TiffDecoder;
use image::{DynamicImage, ImageDecoder, Limits};
use std::io::{BufReader, Cursor, Read, Seek};
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
            Some(magic) if magic == EXR => {
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
            _ => Err(no_picture(path)),
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
        match &self.body {
            Body::Exr(names) => names.clone(),
            Body::Picture(picture) => names(picture.color().channel_count()),
        }
    }

    /// A channel, to be asked for its numbers.
    ///
    /// # Errors
    /// [`Error::File`] when it has no such channel, or cannot be read on.
    pub fn channel(&self, path: &Path, channel: &str) -> Result<Plane<'_>> {
        let picture = match &self.body {
            Body::Exr(_) => {
                let (plane, size) = exr::read_channel(path, channel)?;
                return match size == self.size {
                    true => Ok(Plane(Held::Alone(plane))),
                    false => Err(Error::file(path, "its parts differ in size")),
                };
            }
            Body::Picture(picture) => picture,
        };
        let names = self.channels();
        let at = names.iter().position(|n| n.eq_ignore_ascii_case(channel));
        let at = at.ok_or_else(|| {
            let names = names.join(", ");
            Error::file(
                path,
                format!("it has the channels {names}; needed: {channel}"),
            )
        })?;
        let stored = match picture {
            DynamicImage::ImageLuma8(p) => Stored::Bytes(p),
            DynamicImage::ImageLumaA8(p) => Stored::Bytes(p),
            DynamicImage::ImageRgb8(p) => Stored::Bytes(p),
            DynamicImage::ImageRgba8(p) => Stored::Bytes(p),
            DynamicImage::ImageLuma16(p) => Stored::Words(p),
            DynamicImage::ImageLumaA16(p) => Stored::Words(p),
            DynamicImage::ImageRgb16(p) => Stored::Words(p),
            DynamicImage::ImageRgba16(p) => Stored::Words(p),
            DynamicImage::ImageRgb32F(p) => Stored::Floats(p),
            DynamicImage::ImageRgba32F(p) => Stored::Floats(p),
            other => {
                return Err(
                    Error::file(path, format!("its colours are {:?}", other.color()))
                        .with_hint("Save it with 8 or 16 bits a channel"),
                );
            }
        };
        let every = usize::from(picture.color().channel_count());
        Ok(Plane(Held::Among(stored, at, every)))
    }

    /// The numbers of a channel in row order, top row first.
    ///
    /// # Errors
    /// As [`Numbers::channel`].
    pub fn plane(&self, path: &Path, channel: &str) -> Result<Vec<f32>> {
        let plane = self.channel(path, channel)?;
        Ok((0..self.size.texels()).map(|i| plane.number(i)).collect())
    }
}

/// A channel of a picture.
pub struct Plane<'a>(Held<'a>);

enum Held<'a> {
    /// As the picture holds it, among the others: the place of the first number, and the distance from one to the next.
    Among(Stored<'a>, usize, usize),
    /// Alone.
    Alone(Vec<f32>),
}

/// The numbers of a picture, channel by channel for each texel.
enum Stored<'a> {
    Bytes(&'a [u8]),
    Words(&'a [u16]),
    Floats(&'a [f32]),
}

impl Plane<'_> {
    /// The number of texel `i` in row order, top row first.
    ///
    /// # Panics
    /// Past the last texel.
    pub fn number(&self, i: usize) -> f32 {
        match &self.0 {
            Held::Alone(plane) => plane[i],
            Held::Among(stored, at, every) => {
                let i = at + every * i;
                match stored {
                    Stored::Bytes(raw) => f32::from(raw[i]) / 255.0,
                    Stored::Words(raw) => f32::from(raw[i]) / 65535.0,
                    Stored::Floats(raw) => raw[i],
                }
            }
        }
    }
}

/// What a picture's first bytes say.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct About {
    /// Its size.
    pub size: Size,
    /// The names of its channels: see [`Numbers::channels`].
    pub channels: Vec<String>,
}

/// What a picture says of itself, without its texels being read.
///
/// # Errors
/// As [`Numbers::open`], as far as that is known by then.
pub fn about(path: &Path) -> Result<About> {
    let (mut file, _) = open_filled(path)?;
    let mut magic = Vec::new();
    let mut head = file.by_ref().take(EXR.len() as u64);
    head.read_to_end(&mut magic).map_err(Error::read(path))?;
    if magic == EXR {
        let channels = exr::channels(path)?;
        let first = channels.first().map_or("R", String::as_str);
        let size = exr::channel_size(path, first)?;
        return Ok(About { size, channels });
    }
    file.rewind().map_err(Error::read(path))?;
    let file = BufReader::new(file);
    let mut limits = Limits::default();
    limits.max_alloc = Some(EXTRAS_MAX);
    let (size, colours) = match magic[..] {
        [0x89, b'P', b'N', b'G'] => shape(path, "PNG", || PngDecoder::with_limits(file, limits))?,
        [b'I', b'I', ..] | [b'M', b'M', ..] => shape(path, "TIFF", || {
            let mut decoder = TiffDecoder::new(file)?;
            decoder.set_limits(limits)?;
            Ok(decoder)
        })?,
        _ => return Err(no_picture(path)),
    };
    let channels = names(colours.channel_count());
    Ok(About { size, channels })
}

/// Size and colours of a picture that is not decoded.
fn shape<D: ImageDecoder>(
    path: &Path,
    kind: &str,
    open: impl FnOnce() -> image::ImageResult<D>,
) -> Result<(Size, image::ColorType)> {
    let broken = |e: image::ImageError| Error::file(path, format!("it is no usable {kind}: {e}"));
    let decoder = open().map_err(broken)?;
    let (width, height) = decoder.dimensions();
    let size = Size::new(width, height).map_err(|e| Error::file(path, e.to_string()))?;
    Ok((size, decoder.color_type()))
}

/// What an OpenEXR file begins with.
pub(super) const EXR: [u8; 4] = [0x76, 0x2f, 0x31, 0x01];

fn no_picture(path: &Path) -> Error {
    Error::file(path, "it is no PNG, TIFF or OpenEXR file")
        .with_hint("Save the texture as one of them: JPEG loses what a map is made of")
}

/// The names of a picture's channels.
fn names(count: u8) -> Vec<String> {
    let words: &[&str] = match count {
        1 => &["r"],
        2 => &["r", "a"],
        3 => &["r", "g", "b"],
        _ => &["r", "g", "b", "a"],
    };
    words.iter().map(|w| (*w).to_owned()).collect()
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
