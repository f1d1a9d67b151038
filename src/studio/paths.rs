//! Paths in files that hold text: a path that is no Unicode is written as its numbers, and is the same path when it is read.

use serde::{Deserialize, Deserializer, Serialize, Serializer};
use std::path::{Path, PathBuf};

#[derive(Serialize, Deserialize)]
#[serde(untagged)]
enum Written {
    Text(String),
    /// Bytes, or on Windows units of UTF-16.
    Units(Vec<u16>),
}

impl From<&Path> for Written {
    fn from(path: &Path) -> Self {
        match path.to_str() {
            Some(text) => Self::Text(text.to_owned()),
            None => Self::Units(units(path)),
        }
    }
}

impl Written {
    fn path(self) -> Option<PathBuf> {
        match self {
            Self::Text(text) => Some(text.into()),
            Self::Units(units) => from_units(&units),
        }
    }
}

#[cfg(windows)]
fn units(path: &Path) -> Vec<u16> {
    std::os::windows::ffi::OsStrExt::encode_wide(path.as_os_str()).collect()
}

#[cfg(windows)]
fn from_units(units: &[u16]) -> Option<PathBuf> {
    use std::os::windows::ffi::OsStringExt;
    Some(std::ffi::OsString::from_wide(units).into())
}

#[cfg(not(windows))]
fn units(path: &Path) -> Vec<u16> {
    let bytes = path.as_os_str().as_encoded_bytes();
    bytes.iter().map(|b| u16::from(*b)).collect()
}

#[cfg(not(windows))]
fn from_units(units: &[u16]) -> Option<PathBuf> {
    let bytes: Option<Vec<u8>> = units.iter().map(|u| u8::try_from(*u).ok()).collect();
    path_of(bytes?)
}

#[cfg(unix)]
fn path_of(bytes: Vec<u8>) -> Option<PathBuf> {
    use std::os::unix::ffi::OsStringExt;
    Some(std::ffi::OsString::from_vec(bytes).into())
}

#[cfg(not(any(unix, windows)))]
fn path_of(bytes: Vec<u8>) -> Option<PathBuf> {
    String::from_utf8(bytes).ok().map(PathBuf::from)
}

fn read<E: serde::de::Error>(written: Written) -> Result<PathBuf, E> {
    written
        .path()
        .ok_or_else(|| E::custom("these numbers are no path on this system"))
}

/// For `#[serde(with)]` on a path that may be missing.
pub(super) mod maybe {
    use super::{Deserialize, Deserializer, PathBuf, Serialize, Serializer, Written, read};

    pub(in super::super) fn serialize<S: Serializer>(
        path: &Option<PathBuf>,
        to: S,
    ) -> Result<S::Ok, S::Error> {
        path.as_deref().map(Written::from).serialize(to)
    }

    pub(in super::super) fn deserialize<'de, D: Deserializer<'de>>(
        from: D,
    ) -> Result<Option<PathBuf>, D::Error> {
        Option::<Written>::deserialize(from)?.map(read).transpose()
    }
}

/// For `#[serde(with)]` on a list of paths.
pub(super) mod list {
    use super::{Deserialize, Deserializer, PathBuf, Serializer, Written, read};

    pub(in super::super) fn serialize<S: Serializer>(
        paths: &[PathBuf],
        to: S,
    ) -> Result<S::Ok, S::Error> {
        to.collect_seq(paths.iter().map(|p| Written::from(p.as_path())))
    }

    pub(in super::super) fn deserialize<'de, D: Deserializer<'de>>(
        from: D,
    ) -> Result<Vec<PathBuf>, D::Error> {
        let written = Vec::<Written>::deserialize(from)?;
        written.into_iter().map(read).collect()
    }
}
