//! Files to maps, one module a format.
//!
//! Files from elsewhere are not trusted: sizes, counts and offsets are checked before anything is allocated or decoded, and
//! whatever is wrong is an error that names the file and what to do.

pub mod codes;
pub mod exr;
pub mod gltf;
pub mod guess;
pub mod numbers;
pub mod textures;

use crate::convention::MapInfo;
use crate::error::{Error, Result, open_filled};
use crate::map::{AnisoMap, Mended};
use std::io::Read;
use std::path::Path;

/// A map read from a file.
#[derive(Clone, Debug, PartialEq)]
pub struct Imported {
    /// The map.
    pub map: AnisoMap,
    /// What had to be mended for it to be usable.
    pub mended: Mended,
    /// What the file says about it; for a file without a record, its name and an aspect of width over height.
    pub info: MapInfo,
}

/// The largest file that is read into memory whole.
const BYTES_MAX: u64 = 4 << 30;

/// The whole of a file.
fn read_file(path: &Path) -> Result<Vec<u8>> {
    let (mut file, length) = open_filled(path)?;
    if length > BYTES_MAX {
        return Err(Error::file(
            path,
            format!("it has {length} bytes; allowed: at most {BYTES_MAX}"),
        ));
    }
    let mut bytes = vec![];
    file.read_to_end(&mut bytes).map_err(Error::read(path))?;
    Ok(bytes)
}

/// A file's name without folder and extension.
fn stem(path: &Path) -> String {
    let stem = path.file_stem().unwrap_or_default();
    stem.to_string_lossy().into_owned()
}
