//! OpenEXR files back to maps.
//!
//! The header is read and judged first. The `exr` crate allocates what a header asks for, and its DWA decoder trusts sizes
//! inside the file up to aborting the process, so absurd headers and DWA are refused before it decodes anything. It reads
//! whatever blocks the offset table points at, so every block is asked for its place before it is decoded. B44 is refused
//! because it is lossy where it hurts: 0.5 % of a width and 0.8 degrees of direction.

use super::Imported;
use crate::convention::{Content, MapInfo, MapRecord};
use crate::error::{Error, Result, open_filled};
use crate::map::{AnisoMap, Size, Wrap};
use exr::block::UncompressedBlock;
use exr::block::chunk::{Chunk, TileCoordinates};
use exr::block::reader::{ChunksReader, Reader};
use exr::meta::attribute::{AttributeValue, SampleType};
use exr::meta::header::Header;
use exr::meta::{BlockDescription, MetaData};
use exr::prelude::{Compression, Vec2};
use half::f16;
use rayon::prelude::*;
use std::collections::HashSet;
use std::io::{BufReader, Error as IoError};
use std::path::Path;

/// The channels of the master file.
const MASTER: [&str; 4] = ["alpha.X", "alpha.Y", "axis.X", "axis.Y"];

/// Reads a master file, whoever wrote it: any part that has the channels `alpha.X alpha.Y axis.X axis.Y`, half, float or
/// whole numbers, scan lines or tiles, any compression but DWA and B44.
///
/// # Errors
/// [`Error::Read`] when the file cannot be opened, [`Error::File`] when it is no such file; the message names the channels
/// that were found, or the limit that was passed.
pub fn read_master(path: &Path) -> Result<Imported> {
    let (planes, part) = read_channels(path, MASTER)?;
    finish(path, &part, planes)
}

/// Reads the pair of plain RGB files: R, G of the first are the widths, R, G of the second the direction of the x axis of
/// either sign.
///
/// # Errors
/// As [`read_master`], and when the two differ in size.
pub fn read_rgb_pair(alpha: &Path, direction: &Path) -> Result<Imported> {
    let ([ax, ay], part) = read_channels(alpha, ["R", "G"])?;
    let ([cos, sin], other) = read_channels(direction, ["R", "G"])?;
    for (path, part, want) in [
        (alpha, &part, Content::Alpha),
        (direction, &other, Content::Direction),
    ] {
        if let Some(record) = part.record.as_ref().filter(|r| r.content != want) {
            return Err(Error::file(
                path,
                format!("it holds {:?}, not {want:?}", record.content).to_lowercase(),
            )
            .with_hint("Give the file that ends in _alpha.exr first, then _direction.exr"));
        }
    }
    if part.size != other.size {
        return Err(Error::file(
            direction,
            format!(
                "it is {}, but {} is {}",
                other.size,
                alpha.display(),
                part.size
            ),
        )
        .with_hint("Give the two files of one map"));
    }
    let c2 = cos.iter().zip(&sin).map(|(c, s)| c * c - s * s).collect();
    let s2 = cos.iter().zip(&sin).map(|(c, s)| 2.0 * c * s).collect();
    finish(alpha, &part, [ax, ay, c2, s2])
}

/// The numbers of one channel, and its size. Letters count alike, large or small, where no channel has just that name.
///
/// # Errors
/// As [`read_master`].
pub(super) fn read_channel(path: &Path, name: &str) -> Result<(Vec<f32>, Size)> {
    let names = channels(path)?;
    let same = |n: &&String| n.eq_ignore_ascii_case(name);
    let alike = names.iter().find(same).map_or(name, String::as_str);
    let exact = names.iter().any(|n| n == name);
    let ([plane], part) = read_channels(path, [if exact { name } else { alike }])?;
    Ok((plane, part.size))
}

/// The size of the part that has a channel.
///
/// # Errors
/// As [`read_master`].
pub(super) fn channel_size(path: &Path, name: &str) -> Result<Size> {
    let (file, length) = open_filled(path)?;
    let reader = Reader::read_from_buffered(BufReader::new(file), false);
    let reader = reader.map_err(|e| unreadable(path, &e))?;
    Ok(judge(path, reader.meta_data(), length, &[name])?.1.size)
}

/// The names of the channels of all parts.
///
/// # Errors
/// [`Error::Read`] when the file cannot be opened, [`Error::File`] when it is no OpenEXR file.
pub fn channels(path: &Path) -> Result<Vec<String>> {
    let (file, _) = open_filled(path)?;
    let reader = Reader::read_from_buffered(BufReader::new(file), false);
    let reader = reader.map_err(|e| unreadable(path, &e))?;
    let headers = reader.meta_data().headers.iter();
    let all = headers.flat_map(|h| h.channels.list.iter().map(|c| c.name.to_string()));
    Ok(all.collect())
}

/// Whether a file has the channels of a master file.
///
/// # Errors
/// As [`channels`].
pub fn is_master(path: &Path) -> Result<bool> {
    let names = channels(path)?;
    Ok(MASTER.iter().all(|m| names.iter().any(|n| n == m)))
}

fn finish(path: &Path, part: &Part, planes: [Vec<f32>; 4]) -> Result<Imported> {
    let wrap = part.record.as_ref().map_or(Wrap::default(), |r| r.wrap);
    let (map, mended) = AnisoMap::from_planes(part.size, wrap, planes)?;
    let info = part.record.as_ref().map(MapRecord::info);
    Ok(Imported {
        map,
        mended,
        info: info.unwrap_or_else(|| MapInfo {
            name: super::stem(path),
            aspect: part.size.width() as f32 / part.size.height() as f32,
            ..MapInfo::default()
        }),
    })
}

/// The part of a file that has the channels.
struct Part {
    size: Size,
    record: Option<MapRecord>,
}

/// The most bytes one pixel of a part may have, all channels together: 64 floats.
const PIXEL_BYTES_MAX: usize = 256;
/// The longest side a tile may have.
const TILE_MAX: usize = 8192;
/// Chunks decoded side by side.
const GROUP: usize = 32;

fn read_channels<const N: usize>(path: &Path, names: [&str; N]) -> Result<([Vec<f32>; N], Part)> {
    let (file, length) = open_filled(path)?;
    let bad = |e| unreadable(path, &e);
    let reader = Reader::read_from_buffered(BufReader::new(file), false).map_err(bad)?;
    let (layer, part) = judge(path, reader.meta_data(), length, &names)?;
    let whole = Vec2(0, 0);
    let mut missing = HashSet::new();
    let mut chunks = reader
        .filter_chunks(false, |_, tile, block| {
            block.layer == layer && tile.level_index == whole && missing.insert(tile)
        })
        .map_err(bad)?;
    let places = Place::of(&chunks.meta_data().headers[layer], &names);
    let mut planes = zeros::<N>(path, part.size)?;
    loop {
        let group: Vec<Chunk> = (&mut chunks)
            .take(GROUP)
            .collect::<exr::error::Result<_>>()
            .map_err(bad)?;
        if group.is_empty() {
            return Ok((planes, part));
        }
        let meta = chunks.meta_data();
        // As many blocks are read as there are places, so once each has a place of its own, none is missing.
        for chunk in &group {
            let place = place_of(chunk, meta, layer).map_err(bad)?;
            if !missing.remove(&place) {
                return Err(damaged(path, "a block repeats another or has no place"));
            }
        }
        let blocks: Vec<Block> = group
            .into_par_iter()
            .map(|chunk| Block::decode(chunk, meta, layer, &places))
            .collect::<exr::error::Result<_>>()
            .map_err(bad)?;
        for block in blocks {
            block
                .copy_into(&mut planes, part.size)
                .ok_or_else(|| damaged(path, "a block lies outside the picture"))?;
        }
    }
}

/// A plane of zeros for each channel; an error where the memory for them is not to be had.
fn zeros<const N: usize>(path: &Path, size: Size) -> Result<[Vec<f32>; N]> {
    let mut planes = [const { vec![] }; N];
    for plane in &mut planes {
        plane.try_reserve_exact(size.texels()).map_err(|_| {
            let megabytes = (size.texels() * N * size_of::<f32>()) >> 20;
            Error::file(
                path,
                format!("its {size} texels take {megabytes} MiB of memory, which are not free"),
            )
            .with_hint("Close other programs, or save the map smaller")
        })?;
        plane.resize(size.texels(), 0.0);
    }
    Ok(planes)
}

/// Where a block says that it belongs.
fn place_of(chunk: &Chunk, meta: &MetaData, layer: usize) -> exr::error::Result<TileCoordinates> {
    if chunk.layer_index != layer {
        return Err(exr::error::Error::Invalid("a block of another part".into()));
    }
    meta.headers[layer].get_block_data_indices(&chunk.compressed_block)
}

fn damaged(path: &Path, problem: &str) -> Error {
    Error::file(path, format!("it is damaged or cut short ({problem})"))
        .with_hint("Make or copy the file again")
}

fn unreadable(path: &Path, error: &exr::error::Error) -> Error {
    match error {
        exr::error::Error::Io(e) => Error::read(path)(IoError::new(e.kind(), e.to_string())),
        exr::error::Error::NotSupported(what) => Error::file(
            path,
            format!("it uses a feature that is not supported ({what})"),
        )
        .with_hint("Save it as scan lines with ZIP compression"),
        exr::error::Error::Invalid(what) if what.contains("file identifier") => {
            Error::file(path, "it is not an OpenEXR file")
        }
        other => damaged(path, &other.to_string()),
    }
}

/// Finds the part that has the channels, and refuses what must not be decoded.
fn judge(path: &Path, meta: &MetaData, length: u64, names: &[&str]) -> Result<(usize, Part)> {
    let has_all = |h: &Header| {
        names
            .iter()
            .all(|n| h.channels.list.iter().any(|c| c.name.eq(n)))
    };
    let layer = meta.headers.iter().position(has_all).ok_or_else(|| {
        let found: Vec<String> = meta
            .headers
            .iter()
            .flat_map(|h| h.channels.list.iter().map(|c| c.name.to_string()))
            .take(20)
            .collect();
        let error = Error::file(
            path,
            format!(
                "it has the channels {}; needed: {}",
                found.join(", "),
                names.join(", ")
            ),
        );
        if names == MASTER {
            error.with_hint("Only a master file has them; anisomap generate NAME -o DIR writes one")
        } else {
            error
        }
    })?;
    let header = &meta.headers[layer];
    let size = claimed_size(path, header)?;
    for header in &meta.headers {
        refuse(path, header)?;
    }
    let chunks: u64 = meta.headers.iter().map(|h| h.chunk_count as u64).sum();
    if chunks > length / 8 {
        return Err(damaged(
            path,
            &format!("{length} bytes cannot hold the {chunks} blocks of its header"),
        ));
    }
    if !fits(header, size, length) {
        return Err(damaged(
            path,
            &format!("{length} bytes cannot hold the {size} texels of its header"),
        ));
    }
    let record = record_of(header);
    Ok((layer, Part { size, record }))
}

/// Whether a file of `length` bytes can hold a part, by what its compression makes of one byte at most: Deflate 1032, run
/// lengths 64, PIZ's Huffman runs 455, PXR24's Deflate 1376 since it leaves out a quarter of each float before.
fn fits(header: &Header, size: Size, length: u64) -> bool {
    let ratio = match header.compression {
        Compression::Uncompressed => 1,
        Compression::PXR24 => 1500,
        _ => 1100,
    };
    let bytes = (size.texels() * header.channels.bytes_per_pixel) as u64;
    bytes <= length.saturating_mul(ratio)
}

fn claimed_size(path: &Path, header: &Header) -> Result<Size> {
    let Vec2(width, height) = header.layer_size;
    let side = |n: usize| u32::try_from(n).unwrap_or(u32::MAX);
    Size::new(side(width), side(height)).map_err(|e| {
        let allowed = match e {
            Error::Invalid { allowed, .. } => allowed,
            other => other.to_string(),
        };
        Error::file(
            path,
            format!("its header claims {width}x{height} texels; {allowed}"),
        )
    })
}

fn refuse(path: &Path, header: &Header) -> Result<()> {
    let no = |problem: String, hint: &str| Err(Error::file(path, problem).with_hint(hint));
    if header.deep {
        return no("it holds deep data".to_owned(), "Save it as a flat picture");
    }
    if !matches!(
        header.compression,
        Compression::Uncompressed
            | Compression::RLE
            | Compression::ZIP1
            | Compression::ZIP16
            | Compression::PIZ
            | Compression::PXR24
    ) {
        return no(
            format!(
                "it uses {}; allowed: none, RLE, ZIP, ZIPS, PIZ, PXR24",
                header.compression
            ),
            "Save it with ZIP: DWA and B44 lose what a map is made of",
        );
    }
    if let Some(c) = header
        .channels
        .list
        .iter()
        .find(|c| c.sampling != Vec2(1, 1))
    {
        return no(
            format!("its channel {} has fewer samples than texels", c.name),
            "Save it without subsampling",
        );
    }
    if header.channels.bytes_per_pixel > PIXEL_BYTES_MAX {
        return no(
            format!(
                "it has {} bytes a texel; allowed: at most {PIXEL_BYTES_MAX}",
                header.channels.bytes_per_pixel
            ),
            "Save the map's own channels in a file of their own",
        );
    }
    if let BlockDescription::Tiles(tiles) = header.blocks
        && tiles.tile_size.0.max(tiles.tile_size.1) > TILE_MAX
    {
        return no(
            format!(
                "its tiles are {}x{}; allowed: at most {TILE_MAX} a side",
                tiles.tile_size.0, tiles.tile_size.1
            ),
            "Save it as scan lines",
        );
    }
    Ok(())
}

/// What the file says about itself, if it is one of ours.
fn record_of(header: &Header) -> Option<MapRecord> {
    let attributes = [
        &header.own_attributes.other,
        &header.shared_attributes.other,
    ];
    attributes.into_iter().find_map(|attributes| {
        attributes.iter().find_map(|(name, value)| match value {
            AttributeValue::Text(text) if name.eq(MapRecord::NAME) => {
                MapRecord::from_json(&text.to_string())
            }
            _ => None,
        })
    })
}

/// Where the samples of a channel stand in a line of a block.
#[derive(Clone, Copy)]
struct Place {
    /// Bytes of one pixel's other channels before it; times the block's width, its first byte in the line.
    before: usize,
    sample: SampleType,
}

impl Place {
    fn of(header: &Header, names: &[&str]) -> Vec<Self> {
        let find = |name: &&str| {
            let mut channels = header.channels.channels_with_byte_offset();
            let (before, channel) = channels
                .find(|(_, c)| c.name.eq(name))
                .expect("the part was chosen for having it");
            Self {
                before,
                sample: channel.sample_type,
            }
        };
        names.iter().map(find).collect()
    }

    fn read(self, line: &[u8], width: usize) -> Vec<f32> {
        let bytes = &line[self.before * width..];
        let words = || bytes.as_chunks::<4>().0.iter().take(width);
        match self.sample {
            SampleType::F16 => {
                let halves = bytes.as_chunks::<2>().0.iter().take(width);
                halves.map(|b| f16::from_ne_bytes(*b).to_f32()).collect()
            }
            SampleType::F32 => words().map(|b| f32::from_ne_bytes(*b)).collect(),
            SampleType::U32 => words().map(|b| u32::from_ne_bytes(*b) as f32).collect(),
        }
    }
}

/// The needed channels of a decoded chunk.
struct Block {
    left: usize,
    top: usize,
    /// Per line and channel.
    lines: Vec<Vec<Vec<f32>>>,
}

impl Block {
    fn decode(
        chunk: Chunk,
        meta: &MetaData,
        layer: usize,
        places: &[Place],
    ) -> exr::error::Result<Self> {
        let bytes_per_pixel = meta.headers[layer].channels.bytes_per_pixel;
        let block = UncompressedBlock::decompress_chunk(chunk, meta, false)?;
        let width = block.index.pixel_size.0;
        let lines = block.data.chunks_exact(width * bytes_per_pixel);
        Ok(Self {
            left: block.index.pixel_position.0,
            top: block.index.pixel_position.1,
            lines: lines
                .map(|line| places.iter().map(|p| p.read(line, width)).collect())
                .collect(),
        })
    }

    /// `None` when it lies outside.
    fn copy_into<const N: usize>(&self, planes: &mut [Vec<f32>; N], size: Size) -> Option<()> {
        for (y, line) in (self.top..).zip(&self.lines) {
            let start = y
                .checked_mul(size.width() as usize)?
                .checked_add(self.left)?;
            for (plane, samples) in planes.iter_mut().zip(line) {
                if self.left + samples.len() > size.width() as usize {
                    return None;
                }
                plane
                    .get_mut(start..start + samples.len())?
                    .copy_from_slice(samples);
            }
        }
        Some(())
    }
}
