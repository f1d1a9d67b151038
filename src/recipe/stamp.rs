//! By what a file is known to be as it was: without reading it again.

use serde::{Deserialize, Serialize};
use std::fs::Metadata;
use std::path::Path;
use std::time::UNIX_EPOCH;

/// When a file was last written, and its length. Two files with different stamps may still hold the same.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Stamp {
    /// Nanoseconds since 1970, negative before.
    nanoseconds: i64,
    bytes: u64,
    /// The same of the files that belong to it, as one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    beside: Option<(i64, u64)>,
}

impl Stamp {
    /// That of the file at a path; `None` when there is none, or the system keeps no times.
    pub fn of(path: &Path) -> Option<Self> {
        Self::told(&std::fs::metadata(path).ok()?)
    }

    /// That of a file with one more that belongs to it.
    pub(super) fn with(self, other: Self) -> Self {
        let (nanoseconds, bytes) = self.beside.unwrap_or_default();
        let mixed = nanoseconds.wrapping_mul(31);
        Self {
            beside: Some((
                mixed.wrapping_add(other.nanoseconds),
                bytes.wrapping_add(other.bytes),
            )),
            ..self
        }
    }

    pub(super) fn told(about: &Metadata) -> Option<Self> {
        let modified = about.modified().ok()?;
        let nanoseconds = match modified.duration_since(UNIX_EPOCH) {
            Ok(after) => i64::try_from(after.as_nanos()).unwrap_or(i64::MAX),
            Err(e) => i64::try_from(e.duration().as_nanos()).map_or(i64::MIN, |n| -n),
        };
        Some(Self {
            nanoseconds,
            bytes: about.len(),
            beside: None,
        })
    }
}
