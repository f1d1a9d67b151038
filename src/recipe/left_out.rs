//! A layer that a map was made without, because a file of its is missing or cannot be read.

use super::{Files, Layer, file_of_mesh};
use crate::error::Error;

/// A layer that a map was made without; see [`super::Recipe::prepare_readable`].
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct LeftOut {
    /// The layer's name.
    pub layer: String,
    /// The file that is in its way, as the recipe names it, where that can be told.
    pub file: Option<String>,
    /// What is wrong, as a clause.
    pub reason: String,
    /// Whether the file lies where the recipe may not name it.
    pub is_outside: bool,
}

impl LeftOut {
    /// A layer that an error stands against, where that is about a file: then the map can be made without it.
    pub(super) fn because(
        layer: &Layer,
        mesh: Option<&str>,
        files: &Files,
        error: Error,
    ) -> Result<Self, Error> {
        let mut names = layer.files();
        names.extend(mesh.filter(|_| layer.needs_mesh()).and_then(file_of_mesh));
        if names.is_empty() || matches!(error, Error::Cancelled) {
            return Err(error);
        }
        let left = |file: Option<&str>, reason: String, is_outside: bool| Self {
            layer: layer.name().to_owned(),
            file: file.map(str::to_owned),
            reason,
            is_outside,
        };
        for name in &names {
            if files.is_outside(name) {
                let reason = format!("{name} lies outside the recipe's folder");
                return Ok(left(Some(name), reason, true));
            }
            if files.resolve("file", name).is_err() {
                let reason = format!("{name} is not there");
                return Ok(left(Some(name), reason, false));
            }
        }
        let at = match &error {
            Error::File { path, .. } | Error::Read { path, .. } => path.canonicalize().ok(),
            _ => None,
        };
        let of_it = |name: &&&str| at.is_some() && files.resolve("file", name).ok() == at;
        let file = names.iter().find(of_it).copied().or(match &names[..] {
            [only] => Some(*only),
            _ => None,
        });
        Ok(left(file, error.to_string(), false))
    }
}
