//! OpenEXR: the master file, which is the map itself, and two plain RGB files for programs that know no other channels.
//!
//! One part, scan lines, ZIP over 16 lines, and all that is to be said about the numbers in one text attribute: with two
//! custom attributes the `exr` crate writes them in an order that changes from run to run. Blocks are converted and
//! compressed here, a group at a time on all cores, and handed to the crate as finished chunks: the file needs no copy of
//! the map, and zlib-rs packs several times as fast as the crate's own deflate.

use super::{Export, Written, beside, write_atomic};
use crate::convention::{Content, MapRecord};
use crate::error::Result;
use crate::map::Size;
use crate::progress::Progress;
use exr::block::chunk::{Chunk, CompressedBlock, CompressedScanLineBlock};
use exr::block::writer::ChunksWriter;
use exr::meta::BlockDescription;
use exr::meta::attribute::{AttributeValue, ChannelDescription, LineOrder, SampleType, Text};
use exr::meta::header::Header;
use exr::prelude::Compression;
use flate2::{Compress, Compression as Level, FlushCompress, Status};
use half::f16;
use half::slice::HalfFloatSliceExt;
use rayon::prelude::*;
use std::io;
use std::path::Path;

/// How many bits a sample has.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Precision {
    /// 16-bit half: 0.05 % of a width, 0.02 degrees of direction.
    #[default]
    Half,
    /// 32-bit float: to the bit.
    Float,
}

impl Precision {
    /// zlib's effort. On brushed halves 1 takes two thirds of the time of 2 for files a quarter larger, and 3 takes 1.4 times as
    /// long for files 8 % smaller; the low bits of floats are noise that no effort packs.
    fn effort(self) -> u32 {
        match self {
            Self::Half => 2,
            Self::Float => 1,
        }
    }
}

/// The scan lines a ZIP block holds.
const BLOCK: u32 = 16;
/// Blocks packed side by side before they are written.
const GROUP: usize = 32;

/// Writes the master file: channels `alpha.X alpha.Y axis.X axis.Y`, the axis as (cos 2θ, sin 2θ), so that any reader may
/// filter, crop or tile it. [`crate::import::exr::read_master`] reads it.
///
/// # Errors
/// [`crate::Error::Write`]; see [`write_atomic`].
pub fn write_master(path: &Path, export: &Export<'_>, precision: Precision) -> Result<Written> {
    write_master_with(path, export, precision, &Progress::none())
}

/// As [`write_master`], as long as `progress` does not cancel it.
///
/// # Errors
/// As [`write_master`], and [`crate::Error::Cancelled`].
pub fn write_master_with(
    path: &Path,
    export: &Export<'_>,
    precision: Precision,
    progress: &Progress<'_>,
) -> Result<Written> {
    let map = export.map();
    let record = MapRecord::new(Content::Map, export.info(), map.wrap());
    let width = map.width() as usize;
    let planes = [map.alpha_x(), map.alpha_y(), map.cos2(), map.sin2()];
    Image {
        size: map.size(),
        channels: &["alpha.X", "alpha.Y", "axis.X", "axis.Y"],
        precision,
        record,
    }
    .write(path, progress, |y, rows| {
        let start = y as usize * width;
        for (row, plane) in rows.iter_mut().zip(planes) {
            row.copy_from_slice(&plane[start..start + width]);
        }
    })
}

/// Writes `STEM_alpha.exr` (R = alpha_x, G = alpha_y, B = 0) and `STEM_direction.exr` (R, G = cos θ, sin θ of the x axis,
/// combed, B = 0). [`crate::import::exr::read_rgb_pair`] reads them.
///
/// # Errors
/// [`crate::Error::Write`]; see [`write_atomic`].
pub fn write_rgb_pair(
    stem: &Path,
    export: &Export<'_>,
    precision: Precision,
) -> Result<[Written; 2]> {
    write_rgb_pair_with(stem, export, precision, &Progress::none())
}

/// As [`write_rgb_pair`], as long as `progress` does not cancel it.
///
/// # Errors
/// As [`write_rgb_pair`], and [`crate::Error::Cancelled`].
pub fn write_rgb_pair_with(
    stem: &Path,
    export: &Export<'_>,
    precision: Precision,
    progress: &Progress<'_>,
) -> Result<[Written; 2]> {
    let map = export.map();
    let width = map.width() as usize;
    // Channels of a file stand in the order of the alphabet.
    let image = |content| Image {
        size: map.size(),
        channels: &["B", "G", "R"],
        precision,
        record: MapRecord::new(content, export.info(), map.wrap()),
    };
    let alpha = image(Content::Alpha).write(&beside(stem, "_alpha.exr"), progress, |y, rows| {
        let range = y as usize * width..(y as usize + 1) * width;
        rows[1].copy_from_slice(&map.alpha_y()[range.clone()]);
        rows[2].copy_from_slice(&map.alpha_x()[range]);
    })?;
    let combed = export.combed();
    let direction =
        image(Content::Direction).write(&beside(stem, "_direction.exr"), progress, |y, rows| {
            let [_, sin, cos] = rows else {
                unreachable!("three channels")
            };
            combed.row(y, cos, sin);
        })?;
    Ok([alpha, direction])
}

/// Writes one width or the axis of a reduced map: a channel of its own for each plane, `record` beside them.
/// [`crate::import::codes::read_codes`] reads it.
///
/// # Errors
/// [`crate::Error::Write`]; see [`write_atomic`].
///
/// # Panics
/// When a plane has not as many numbers as `size`, or the channels' names are no ASCII in the order of the alphabet.
pub fn write_part(
    path: &Path,
    size: Size,
    channels: &[(&str, &[f32])],
    record: MapRecord,
    precision: Precision,
) -> Result<Written> {
    assert!(channels.is_sorted_by(|a, b| a.0 < b.0), "in order");
    assert!(channels.iter().all(|c| c.1.len() == size.texels()), "whole");
    let names: Vec<&str> = channels.iter().map(|(name, _)| *name).collect();
    let image = Image {
        size,
        channels: &names,
        precision,
        record,
    };
    let width = size.width() as usize;
    image.write(path, &Progress::none(), |y, rows| {
        let start = y as usize * width;
        for (row, (_, plane)) in rows.iter_mut().zip(channels) {
            row.copy_from_slice(&plane[start..start + width]);
        }
    })
}

/// A file to be written.
struct Image<'a> {
    size: Size,
    /// In the order of the alphabet, as in the file.
    channels: &'a [&'a str],
    precision: Precision,
    record: MapRecord,
}

impl Image<'_> {
    /// Writes it, as long as it is wanted; `fill` puts row `y` (0 is the top) into one slice per channel, which hold zeros or another row before.
    fn write(
        &self,
        path: &Path,
        progress: &Progress<'_>,
        fill: impl Fn(u32, &mut [Vec<f32>]) + Sync,
    ) -> Result<Written> {
        let written = write_atomic(path, |file| {
            exr::block::write(file, vec![self.header()].into(), true, |_, chunks| {
                self.write_chunks(chunks, progress, &fill)
            })
            .map_err(|e| match e {
                exr::error::Error::Io(e) => e,
                other => io::Error::other(other.to_string()),
            })
        });
        match written {
            Ok(written) => Ok(written),
            Err(error) => Err(progress.check().err().unwrap_or(error)),
        }
    }

    fn header(&self) -> Header {
        let sample = match self.precision {
            Precision::Half => SampleType::F16,
            Precision::Float => SampleType::F32,
        };
        let channels = self
            .channels
            .iter()
            .map(|name| ChannelDescription::new(text(name), sample, true))
            .collect();
        let size = (self.size.width() as usize, self.size.height() as usize);
        let mut header = Header::new(text("map"), size, channels).with_encoding(
            Compression::ZIP16,
            BlockDescription::ScanLines,
            LineOrder::Increasing,
        );
        header.own_attributes.layer_name = None;
        header.own_attributes.other.insert(
            text(MapRecord::NAME),
            AttributeValue::Text(text(&self.record.to_json())),
        );
        header
    }

    fn write_chunks(
        &self,
        chunks: &mut impl ChunksWriter,
        progress: &Progress<'_>,
        fill: &(impl Fn(u32, &mut [Vec<f32>]) + Sync),
    ) -> exr::error::UnitResult {
        let blocks: Vec<u32> = (0..self.size.height().div_ceil(BLOCK)).collect();
        progress.expect(blocks.len().div_ceil(GROUP) as u64);
        for group in blocks.chunks(GROUP) {
            progress
                .step()
                .map_err(|e| exr::error::Error::Io(io::Error::other(e.to_string())))?;
            let packed: Vec<Vec<u8>> = group
                .par_iter()
                .map_init(
                    || Packer::new(self),
                    |packer, block| packer.pack(self, *block, fill),
                )
                .collect();
            for (block, compressed_pixels_le) in group.iter().zip(packed) {
                let block_of_lines = CompressedScanLineBlock {
                    y_coordinate: (block * BLOCK) as i32,
                    compressed_pixels_le,
                };
                chunks.write_chunk(
                    *block as usize,
                    Chunk {
                        layer_index: 0,
                        compressed_block: CompressedBlock::ScanLine(block_of_lines),
                    },
                )?;
            }
        }
        Ok(())
    }
}

fn text(ascii: &str) -> Text {
    Text::new_or_none(ascii).expect("channel names and records are ASCII")
}

/// Turns 16 rows into the bytes of a ZIP block; one per thread.
struct Packer {
    rows: Vec<Vec<f32>>,
    halves: Vec<f16>,
    zlib: Compress,
}

impl Packer {
    fn new(image: &Image<'_>) -> Self {
        let width = image.size.width() as usize;
        Self {
            rows: vec![vec![0.0; width]; image.channels.len()],
            halves: vec![f16::ZERO; width],
            zlib: Compress::new(Level::new(image.precision.effort()), true),
        }
    }

    fn pack(
        &mut self,
        image: &Image<'_>,
        block: u32,
        fill: &(impl Fn(u32, &mut [Vec<f32>]) + Sync),
    ) -> Vec<u8> {
        let lines = block * BLOCK..((block + 1) * BLOCK).min(image.size.height());
        let mut raw = Vec::with_capacity(
            lines.len() * image.size.width() as usize * image.channels.len() * 4,
        );
        for y in lines {
            fill(y, &mut self.rows);
            for row in &self.rows {
                match image.precision {
                    Precision::Half => {
                        self.halves.convert_from_f32_slice(row);
                        raw.extend(self.halves.iter().flat_map(|v| v.to_le_bytes()));
                    }
                    Precision::Float => raw.extend(row.iter().flat_map(|v| v.to_le_bytes())),
                }
            }
        }
        let packed = self.deflate(&predicted(&raw));
        // What does not shrink is stored as it is; readers tell by the length.
        if packed.len() < raw.len() {
            packed
        } else {
            raw
        }
    }

    fn deflate(&mut self, bytes: &[u8]) -> Vec<u8> {
        self.zlib.reset();
        let mut packed = Vec::with_capacity(bytes.len() / 2 + 1024);
        loop {
            let done = self.zlib.total_in() as usize;
            let status = self
                .zlib
                .compress_vec(&bytes[done..], &mut packed, FlushCompress::Finish)
                .expect("a fresh stream accepts any bytes");
            if status == Status::StreamEnd {
                return packed;
            }
            packed.reserve(bytes.len() / 2 + 1024);
        }
    }
}

/// What OpenEXR deflates: the even bytes, then the odd ones, each as the difference to the byte before, plus 128.
fn predicted(raw: &[u8]) -> Vec<u8> {
    let (even, odd) = (raw.iter().step_by(2), raw.iter().skip(1).step_by(2));
    let mut bytes: Vec<u8> = even.chain(odd).copied().collect();
    for i in (1..bytes.len()).rev() {
        bytes[i] = bytes[i].wrapping_sub(bytes[i - 1]).wrapping_add(128);
    }
    bytes
}

#[cfg(test)]
mod tests {
    use super::super::samples;
    use super::*;
    use crate::convention::MapInfo;
    use crate::import::exr::{read_master, read_rgb_pair};
    use crate::map::{AnisoMap, DEFAULT_TEXEL, Mended, Texel, Wrap};
    use crate::math::Axis;
    use std::fs;

    fn info() -> MapInfo {
        MapInfo {
            name: "turned \u{65e5} disc".to_owned(),
            aspect: 1.5,
            ..MapInfo::default()
        }
    }

    /// (largest relative error of a width, largest angle in degrees).
    fn distance(a: &AnisoMap, b: &AnisoMap) -> (f32, f32) {
        assert_eq!((a.size(), a.wrap()), (b.size(), b.wrap()));
        (0..a.size().texels()).fold((0.0, 0.0), |(alpha, angle): (f32, f32), i| {
            let (p, q) = (a.texel_at(i), b.texel_at(i));
            let off = |p: f32, q: f32| (p / q - 1.0).abs();
            (
                alpha
                    .max(off(q.alpha_x, p.alpha_x))
                    .max(off(q.alpha_y, p.alpha_y)),
                angle.max(p.axis.angle_to(q.axis).to_degrees()),
            )
        })
    }

    #[test]
    fn a_long_file_ends_where_it_is_not_wanted_any_more() {
        let size = Size::new(4, 20 * BLOCK * GROUP as u32).unwrap();
        let map = AnisoMap::constant(size, Wrap::Repeat, DEFAULT_TEXEL);
        let info = MapInfo::default();
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.exr");
        let export = Export::new(&map, &info);
        let stop = |done: u64, _: u64| done < 3;
        let ended = write_master_with(&path, &export, Precision::Half, &Progress::new(&stop));
        assert!(matches!(ended, Err(crate::Error::Cancelled)));
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 0);
    }

    #[test]
    fn the_master_file_comes_back() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("disc.exr");
        for (size, wrap) in [
            ((75, 50), Wrap::RepeatU),
            ((1, 1), Wrap::Clamp),
            ((3, 33), Wrap::Repeat),
        ] {
            let map = samples::disc(size, wrap);
            let (info, mut bits) = (info(), vec![]);
            for precision in [Precision::Half, Precision::Float] {
                let written = write_master(&path, &Export::new(&map, &info), precision).unwrap();
                assert_eq!(written.bytes, fs::metadata(&path).unwrap().len());
                let back = read_master(&path).unwrap();
                assert_eq!(back.mended, Mended::default());
                assert_eq!(back.info.aspect, 1.5);
                assert_eq!(back.info.name, info.name);
                bits.push(distance(&map, &back.map));
            }
            assert!(bits[0].0 < 5e-4 && bits[0].1 < 0.02, "half: {:?}", bits[0]);
            assert!(bits[1].0 == 0.0 && bits[1].1 < 1e-4, "float: {:?}", bits[1]);
        }
    }

    #[test]
    fn widths_at_the_ends_of_the_range_need_no_mending_after_half() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("ends.exr");
        let texel = Texel {
            alpha_x: crate::map::ALPHA_MIN,
            alpha_y: crate::map::ALPHA_MAX,
            axis: Axis::from_degrees(33.0),
        };
        let map = AnisoMap::constant(Size::new(2, 2).unwrap(), Wrap::Clamp, texel);
        write_master(&path, &Export::new(&map, &info()), Precision::Half).unwrap();
        assert_eq!(read_master(&path).unwrap().mended, Mended::default());
    }

    #[test]
    fn the_rgb_pair_comes_back_and_each_file_says_what_it_is() {
        let folder = tempfile::tempdir().unwrap();
        let map = samples::disc((64, 40), Wrap::Clamp);
        let (info, stem) = (info(), folder.path().join("disc"));
        let [alpha, direction] =
            write_rgb_pair(&stem, &Export::new(&map, &info), Precision::Half).unwrap();
        assert_eq!(direction.path, folder.path().join("disc_direction.exr"));
        let back = read_rgb_pair(&alpha.path, &direction.path).unwrap();
        let (alpha_error, angle) = distance(&map, &back.map);
        assert!(alpha_error < 5e-4 && angle < 0.04, "{alpha_error} {angle}");
        let swapped = read_rgb_pair(&direction.path, &alpha.path)
            .unwrap_err()
            .to_string();
        assert!(swapped.contains("direction, not alpha"), "{swapped}");
        let wrong = read_master(&alpha.path).unwrap_err().to_string();
        assert!(
            wrong.contains("B, G, R") && wrong.contains("alpha.X"),
            "{wrong}"
        );
    }

    #[test]
    fn bytes_are_the_same_for_any_number_of_threads_and_from_run_to_run() {
        let folder = tempfile::tempdir().unwrap();
        // More than one group of blocks.
        let map = samples::disc((48, 700), Wrap::Repeat);
        let info = info();
        let bytes = |threads: usize, round: usize| {
            let pool = rayon::ThreadPoolBuilder::new()
                .num_threads(threads)
                .build()
                .unwrap();
            let stem = folder.path().join(format!("{threads}_{round}"));
            pool.install(|| {
                let export = Export::new(&map, &info);
                let master =
                    write_master(&beside(&stem, ".exr"), &export, Precision::Half).unwrap();
                let [a, d] = write_rgb_pair(&stem, &export, Precision::Float).unwrap();
                [master, a, d].map(|w| fs::read(w.path).unwrap())
            })
        };
        let first = bytes(1, 0);
        for (threads, round) in [(1, 1), (2, 0), (3, 0), (2, 1), (2, 2)] {
            assert!(
                bytes(threads, round) == first,
                "{threads} threads, round {round}"
            );
        }
    }

    #[test]
    fn nothing_is_left_behind_when_writing_fails() {
        let folder = tempfile::tempdir().unwrap();
        let map = AnisoMap::constant(Size::new(4, 4).unwrap(), Wrap::Clamp, DEFAULT_TEXEL);
        let e =
            write_master(folder.path(), &Export::new(&map, &info()), Precision::Half).unwrap_err();
        assert_eq!(e.exit_code(), 3);
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 0);
    }
}
