//! PNG sets for programs that read nothing else: widths, angle, double-angle axis and arrow, each a file of its own.
//!
//! All of it is data: linear numbers without gamma, sRGB or colour profile. `README_png.txt` beside them says for every file
//! how to get the numbers back.

use super::{Export, Written, beside, write_atomic};
use crate::error::Result;
use crate::map::{ALPHA_MAX, AnisoMap, Size};
use crate::math::Axis;
use crate::progress::Progress;
use image::codecs::png::{CompressionType, FilterType, PngEncoder};
use image::{ExtendedColorType, ImageEncoder};
use rayon::prelude::*;
use std::io::{self, Write};
use std::path::Path;

/// How many bits a channel has.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Depth {
    /// 8 bits; widths as square roots, which spreads the error evenly (2 % at 0.03).
    Eight,
    /// 16 bits, linear.
    Sixteen,
}

/// One picture of the set.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Picture {
    AlphaX,
    AlphaY,
    Angle,
    Axis,
    Direction,
}

impl Picture {
    /// What a depth has: an angle in 8 bits would be no better than 0.35 degrees and could not be filtered, so there is none.
    fn of(depth: Depth) -> &'static [Self] {
        match depth {
            Depth::Sixteen => &[
                Self::AlphaX,
                Self::AlphaY,
                Self::Angle,
                Self::Axis,
                Self::Direction,
            ],
            Depth::Eight => &[Self::AlphaX, Self::AlphaY, Self::Axis, Self::Direction],
        }
    }

    fn suffix(self, depth: Depth) -> String {
        let what = match self {
            Self::AlphaX => "alpha_x",
            Self::AlphaY => "alpha_y",
            Self::Angle => "angle",
            Self::Axis => "axis",
            Self::Direction => "direction",
        };
        let bits = match depth {
            Depth::Eight => 8,
            Depth::Sixteen => 16,
        };
        format!("_{what}_{bits}bit.png")
    }
}

/// The file beside PNG sets that says how to read them.
pub const README: &str = "README_png.txt";

/// What stands before the files of each depth: the same for every map, so that many may share a folder.
const HEAD: &str = "\
How to read these PNG files
===========================

Every number is linear data: load them as \"non-colour\", \"raw\" or \"linear\", never as sRGB. Row 0 is the top of the
image. v is the stored value divided by its largest, so 0 <= v <= 1.

theta is the angle of the x axis, counter-clockwise from +U (right) toward image-up, seen from outside the surface. An axis
has no sign: theta and theta + 180 degrees are the same. alpha_x is the Ward roughness (slope width) along that axis,
alpha_y the one across it. Grooves run along the axis with the smaller alpha; highlights stretch along the larger.
";

/// How to read the files of 16 bits.
const SIXTEEN: &str = "
The largest stored value of *_16bit.png is 65535.

NAME_alpha_x_16bit.png    grey       alpha_x = 1.5 v. Filter as you like.
NAME_alpha_y_16bit.png    grey       alpha_y = 1.5 v. Filter as you like.
NAME_angle_16bit.png      grey       theta = 180 degrees x stored value / 65536. It wraps from white to black: nearest
                                     (\"closest\") filtering only, no mipmaps, no resizing.
NAME_axis_16bit.png       R, G       R = 0.5 + 0.5 cos(2 theta), G = 0.5 + 0.5 sin(2 theta), B = 0. To decode:
                                     theta = atan2(2 G - 1, 2 R - 1) / 2. May be filtered and resized freely.
NAME_direction_16bit.png  R, G       R = 0.5 + 0.5 cos(theta), G = 0.5 + 0.5 sin(theta), B = 0: an arrow along the axis, its
                                     sign chosen so that neighbours agree wherever the field allows. To decode: normalise
                                     (2 R - 1, 2 G - 1) = (along tangent, along bitangent toward image-up). Linear filtering.
";

/// How to read the files of 8 bits.
const EIGHT: &str = "
The largest stored value of *_8bit.png is 255.

NAME_alpha_x_8bit.png     grey       alpha_x = 1.5 v^2 (square it: 8 bits would be too coarse otherwise).
NAME_alpha_y_8bit.png     grey       alpha_y = 1.5 v^2.
NAME_axis_8bit.png        R, G       R = 0.5 + 0.5 cos(2 theta), G = 0.5 + 0.5 sin(2 theta), B = 0; within 0.2 degrees. To
                                     decode: theta = atan2(2 G - 1, 2 R - 1) / 2. May be filtered and resized freely.
NAME_direction_8bit.png   R, G       R = 0.5 + 0.5 cos(theta), G = 0.5 + 0.5 sin(theta), B = 0: an arrow along the axis, its
                                     sign chosen so that neighbours agree wherever the field allows; within 0.35 degrees. To
                                     decode: normalise (2 R - 1, 2 G - 1) = (along tangent, along bitangent toward image-up).
";

/// Writes [`README`] into a folder with sets of these depths. What one there already says of another depth stays, since sets
/// of many maps share a folder.
///
/// # Errors
/// [`crate::Error::Write`]; see [`write_atomic`].
pub fn write_readme(folder: &Path, depths: &[Depth]) -> Result<Written> {
    let path = folder.join(README);
    let there = std::fs::read_to_string(&path).unwrap_or_default();
    let mut text = HEAD.to_owned();
    for (depth, part) in [(Depth::Sixteen, SIXTEEN), (Depth::Eight, EIGHT)] {
        if depths.contains(&depth) || there.contains(part) {
            text += part;
        }
    }
    write_atomic(&path, |file| file.write_all(text.as_bytes()))
}

/// Writes the pictures of one depth as `STEM_..._8bit.png` or `STEM_..._16bit.png`; [`write_readme`] says how to read them.
///
/// # Errors
/// [`crate::Error::Write`]; see [`write_atomic`].
pub fn write_set(stem: &Path, export: &Export<'_>, depth: Depth) -> Result<Vec<Written>> {
    write_set_with(stem, export, depth, &Progress::none())
}

/// As [`write_set`]; `progress` is asked before each picture.
///
/// # Errors
/// As [`write_set`], and [`crate::Error::Cancelled`].
pub fn write_set_with(
    stem: &Path,
    export: &Export<'_>,
    depth: Depth,
    progress: &Progress<'_>,
) -> Result<Vec<Written>> {
    Picture::of(depth)
        .par_iter()
        .map(|picture| {
            progress.check()?;
            let path = beside(stem, &picture.suffix(depth));
            let pixels = Pixels::draw(*picture, export, depth);
            write_atomic(&path, |file| pixels.encode(file))
        })
        .collect()
}

/// A picture ready to be encoded.
pub(super) struct Pixels {
    size: Size,
    color: ExtendedColorType,
    /// Row order, top first; 16-bit samples in the machine's byte order, as the encoder takes them.
    bytes: Vec<u8>,
}

impl Pixels {
    /// An 8-bit RGB picture, a row at a time.
    pub(super) fn rgb8(size: Size, fill: impl Fn(u32, &mut [[u8; 3]]) + Sync) -> Self {
        let width = size.width() as usize;
        let mut bytes = vec![0; 3 * size.texels()];
        bytes
            .par_chunks_mut(3 * width)
            .enumerate()
            .for_each(|(y, row)| fill(y as u32, row.as_chunks_mut().0));
        Self {
            size,
            color: ExtendedColorType::Rgb8,
            bytes,
        }
    }

    fn draw(picture: Picture, export: &Export<'_>, depth: Depth) -> Self {
        let map = export.map();
        match picture {
            Picture::AlphaX => Self::grey(map, map.alpha_x(), depth),
            Picture::AlphaY => Self::grey(map, map.alpha_y(), depth),
            Picture::Angle => Self::angle(map),
            Picture::Axis => Self::vectors(map, depth, |y, a, b| {
                let width = a.len();
                let range = y as usize * width..(y as usize + 1) * width;
                a.copy_from_slice(&map.cos2()[range.clone()]);
                b.copy_from_slice(&map.sin2()[range]);
            }),
            Picture::Direction => {
                let combed = export.combed();
                Self::vectors(map, depth, |y, a, b| combed.row(y, a, b))
            }
        }
    }

    fn grey(map: &AnisoMap, plane: &[f32], depth: Depth) -> Self {
        let share = |alpha: f32| (alpha * (1.0 / ALPHA_MAX)).clamp(0.0, 1.0);
        let (color, bytes) = match depth {
            Depth::Eight => (
                ExtendedColorType::L8,
                plane.par_iter().map(|a| to_u8(share(*a).sqrt())).collect(),
            ),
            Depth::Sixteen => {
                let samples: Vec<u16> = plane.par_iter().map(|a| to_u16(share(*a))).collect();
                (
                    ExtendedColorType::L16,
                    bytemuck::cast_slice(&samples).to_vec(),
                )
            }
        };
        Self {
            size: map.size(),
            color,
            bytes,
        }
    }

    fn angle(map: &AnisoMap) -> Self {
        let samples: Vec<u16> = map
            .cos2()
            .par_iter()
            .zip(map.sin2())
            .map(|(cos2, sin2)| {
                let (cos2, sin2) = (*cos2, *sin2);
                let turns = Axis { cos2, sin2 }.radians() / std::f32::consts::PI;
                // A circle of 65536 steps: the last one is next to the first.
                ((turns * 65536.0).round() as u32 & 0xffff) as u16
            })
            .collect();
        Self {
            size: map.size(),
            color: ExtendedColorType::L16,
            bytes: bytemuck::cast_slice(&samples).to_vec(),
        }
    }

    /// R and G from vectors of a row with components in -1 ..= 1.
    fn vectors(
        map: &AnisoMap,
        depth: Depth,
        fill: impl Fn(u32, &mut [f32], &mut [f32]) + Sync,
    ) -> Self {
        let width = map.width() as usize;
        match depth {
            Depth::Eight => Self::rgb8(map.size(), |y, row| {
                let (mut a, mut b) = (vec![0.0; width], vec![0.0; width]);
                fill(y, &mut a, &mut b);
                for (x, pixel) in row.iter_mut().enumerate() {
                    *pixel = [to_u8(half_and_half(a[x])), to_u8(half_and_half(b[x])), 0];
                }
            }),
            Depth::Sixteen => {
                let mut samples = vec![0u16; 3 * map.size().texels()];
                samples
                    .par_chunks_mut(3 * width)
                    .enumerate()
                    .for_each(|(y, row)| {
                        let (mut a, mut b) = (vec![0.0; width], vec![0.0; width]);
                        fill(y as u32, &mut a, &mut b);
                        for (x, pixel) in row.chunks_exact_mut(3).enumerate() {
                            pixel[0] = to_u16(half_and_half(a[x]));
                            pixel[1] = to_u16(half_and_half(b[x]));
                        }
                    });
                Self {
                    size: map.size(),
                    color: ExtendedColorType::Rgb16,
                    bytes: bytemuck::cast_slice(&samples).to_vec(),
                }
            }
        }
    }

    /// Writes the PNG: no chunk but the picture's own.
    pub(super) fn encode(&self, to: impl Write) -> io::Result<()> {
        PngEncoder::new_with_quality(to, CompressionType::Fast, FilterType::Up)
            .write_image(
                &self.bytes,
                self.size.width(),
                self.size.height(),
                self.color,
            )
            .map_err(io_error)
    }
}

/// Writes a lit picture as an 8-bit sRGB PNG; see [`to_srgb8`](crate::preview::Picture::to_srgb8).
///
/// # Errors
/// [`Error::Write`](crate::Error::Write) when the file cannot be written.
pub fn write_picture(path: &Path, picture: &crate::preview::Picture) -> Result<Written> {
    let pixels = picture.to_srgb8();
    let (width, height) = (picture.width(), picture.height());
    write_atomic(path, |file| {
        PngEncoder::new(file)
            .write_image(&pixels, width, height, ExtendedColorType::Rgb8)
            .map_err(io_error)
    })
}

/// Writes numbers of 0 to 1 in row order as a 16-bit grey PNG, for programs to read: no curve is applied.
///
/// # Errors
/// [`Error::Write`](crate::Error::Write) when the file cannot be written.
///
/// # Panics
/// When there are not as many numbers as the size says.
pub fn write_grey16(path: &Path, size: Size, values: &[f32]) -> Result<Written> {
    assert_eq!(values.len(), size.texels(), "a number for each pixel");
    let samples: Vec<u16> = values.iter().map(|v| to_u16(v.clamp(0.0, 1.0))).collect();
    let pixels = Pixels {
        size,
        color: ExtendedColorType::L16,
        bytes: bytemuck::cast_slice(&samples).to_vec(),
    };
    write_atomic(path, |file| pixels.encode(file))
}

fn io_error(e: image::ImageError) -> io::Error {
    match e {
        image::ImageError::IoError(e) => e,
        other => io::Error::other(other.to_string()),
    }
}

/// -1 ..= 1 to 0 ..= 1.
pub(super) fn half_and_half(v: f32) -> f32 {
    0.5 + 0.5 * v
}

/// 0 ..= 1 to the nearest of 256 steps.
pub(super) fn to_u8(v: f32) -> u8 {
    (v * 255.0 + 0.5) as u8
}

fn to_u16(v: f32) -> u16 {
    (v * 65535.0 + 0.5) as u16
}

#[cfg(test)]
mod tests {
    use super::super::samples;
    use super::*;
    use crate::convention::MapInfo;
    use crate::map::Wrap;
    use glam::Vec2;
    use std::fs;

    fn read(folder: &Path, name: &str) -> image::DynamicImage {
        image::open(folder.join(name)).unwrap()
    }

    #[test]
    fn every_number_comes_back_by_the_formula_of_the_readme() {
        let folder = tempfile::tempdir().unwrap();
        let map = samples::disc((50, 30), Wrap::Clamp);
        let info = MapInfo::default();
        let export = Export::new(&map, &info);
        let stem = folder.path().join("disc");
        let mut written = write_set(&stem, &export, Depth::Sixteen).unwrap();
        written.extend(write_set(&stem, &export, Depth::Eight).unwrap());
        assert_eq!(written.len(), 9);
        let readme = |depths| {
            let written = write_readme(folder.path(), depths).unwrap();
            fs::read_to_string(written.path).unwrap()
        };
        let told = |text: &str| {
            let names = written.iter().map(|w| w.path.file_name().unwrap());
            let names = names.map(|n| n.to_str().unwrap().replace("disc_", "NAME_"));
            let told: Vec<bool> = names.map(|n| text.contains(&n)).collect();
            told
        };
        // Just what is there is told; a later set of the other depth joins it.
        let eight = readme(&[Depth::Eight]);
        assert!(!eight.contains("16bit"));
        assert_eq!(told(&eight), [[false; 5].as_slice(), &[true; 4]].concat());
        assert_eq!(told(&readme(&[Depth::Sixteen])), [true; 9]);
        let open = |name: &str| read(folder.path(), name);
        let ax = open("disc_alpha_x_16bit.png").into_luma16();
        let ay = open("disc_alpha_y_8bit.png").into_luma8();
        let angle = open("disc_angle_16bit.png").into_luma16();
        let axis = open("disc_axis_8bit.png").into_rgb8();
        let arrow = open("disc_direction_16bit.png").into_rgb16();
        let arrow8 = open("disc_direction_8bit.png").into_rgb8();
        for (x, y) in (0..30).flat_map(|y| (0..50).map(move |x| (x, y))) {
            let t = map.texel(x, y);
            let unit = |n: u16| f32::from(n) / 65535.0;
            let byte = |n: u8| f32::from(n) / 255.0;
            assert!((1.5 * unit(ax[(x, y)].0[0]) - t.alpha_x).abs() < 1.2e-5);
            assert!((1.5 * byte(ay[(x, y)].0[0]).powi(2) / t.alpha_y - 1.0).abs() < 0.02);
            let theta = Axis::from_degrees(180.0 * f32::from(angle[(x, y)].0[0]) / 65536.0);
            assert!(theta.angle_to(t.axis).to_degrees() < 0.002);
            let [r, g, _] = axis[(x, y)].0.map(byte);
            let double = Axis::from_double_angle(Vec2::new(2.0 * r - 1.0, 2.0 * g - 1.0));
            assert!(double.unwrap().angle_to(t.axis).to_degrees() < 0.2);
            let [r, g, b] = arrow[(x, y)].0.map(unit);
            let line = Axis::from_vector(Vec2::new(2.0 * r - 1.0, 2.0 * g - 1.0));
            assert!(line.unwrap().angle_to(t.axis).to_degrees() < 0.002);
            assert_eq!(b, 0.0);
            let [r, g, _] = arrow8[(x, y)].0.map(byte);
            let line = Axis::from_vector(Vec2::new(2.0 * r - 1.0, 2.0 * g - 1.0));
            assert!(line.unwrap().angle_to(t.axis).to_degrees() < 0.35);
        }
    }

    #[test]
    fn the_files_claim_no_colour_space_and_do_not_change_with_the_threads() {
        let folder = tempfile::tempdir().unwrap();
        let map = samples::disc((40, 200), Wrap::Repeat);
        let info = MapInfo::default();
        let set = |threads: usize| -> Vec<Vec<u8>> {
            let pool = rayon::ThreadPoolBuilder::new()
                .num_threads(threads)
                .build()
                .unwrap();
            let written = pool.install(|| {
                write_set(
                    &folder.path().join("m"),
                    &Export::new(&map, &info),
                    Depth::Sixteen,
                )
            });
            written
                .unwrap()
                .iter()
                .map(|w| fs::read(&w.path).unwrap())
                .collect()
        };
        let one = set(1);
        assert!(one == set(2));
        for png in &one[..5] {
            for chunk in [b"gAMA", b"sRGB", b"iCCP", b"cHRM"] {
                assert!(!png.windows(4).any(|w| w == chunk));
            }
        }
    }
}
