//! What can go wrong, sorted by what the user can do about it.
//!
//! Every message says what is wrong, where, what is allowed, and what to do. The binary turns
//! [`Error::exit_code`] into its own exit code: 2 for bad arguments and bad or missing input,
//! 3 when the machine failed (disk, permissions).

use std::fmt::Display;
use std::fs::File;
use std::io;
use std::ops::RangeInclusive;
use std::path::{Path, PathBuf};

/// The library's result.
pub type Result<T, E = Error> = std::result::Result<T, E>;

/// The one error of the library.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// A number, word or combination that is not allowed. Exit code 2.
    #[error("{what} is {value}; {allowed}{}", hint_text(.hint))]
    Invalid {
        /// The parameter, as the user writes it: `--size`, `layers.0.brushed.angle`.
        what: String,
        /// The value that was given.
        value: String,
        /// What is allowed, as a clause: `allowed: 1 to 32768 texels`.
        allowed: String,
        /// What to do, as a sentence.
        hint: Option<String>,
    },
    /// A file whose content cannot be used. Exit code 2.
    #[error("{}: {problem}{}", .path.display(), hint_text(.hint))]
    File {
        /// The file.
        path: PathBuf,
        /// What is wrong with it, with the line where there is one.
        problem: String,
        /// What to do, as a sentence.
        hint: Option<String>,
    },
    /// An input that is not there or cannot be read. Exit code 2.
    #[error("cannot read {}: {source}", .path.display())]
    Read {
        /// The file or folder.
        path: PathBuf,
        /// What the system said.
        source: io::Error,
    },
    /// An output that cannot be written. Exit code 3.
    #[error("cannot write {}: {source}", .path.display())]
    Write {
        /// The file or folder.
        path: PathBuf,
        /// What the system said.
        source: io::Error,
    },
    /// Something other than a file that the machine does not give: a window, a thread. Exit code 3.
    #[error("{what}: {problem}{}", hint_text(.hint))]
    Machine {
        /// What it does not give, as a clause: `no window can be opened`.
        what: String,
        /// What the system said.
        problem: String,
        /// What to do, as a sentence.
        hint: Option<String>,
    },
    /// The user stopped the work; nothing half-written is left. Exit code 1.
    #[error("cancelled; no unfinished file was left behind")]
    Cancelled,
}

fn hint_text(hint: &Option<String>) -> String {
    hint.as_ref().map(|h| format!(". {h}")).unwrap_or_default()
}

impl Error {
    /// An [`Error::Invalid`] without a hint.
    pub fn invalid(
        what: impl Into<String>,
        value: impl Display,
        allowed: impl Into<String>,
    ) -> Self {
        Self::Invalid {
            what: what.into(),
            value: value.to_string(),
            allowed: allowed.into(),
            hint: None,
        }
    }

    /// An [`Error::File`] without a hint.
    pub fn file(path: impl AsRef<Path>, problem: impl Into<String>) -> Self {
        Self::File {
            path: path.as_ref().to_owned(),
            problem: problem.into(),
            hint: None,
        }
    }

    /// The same error with a sentence that says what to do; kept as it is where the kind of error has no place for one.
    #[must_use]
    pub fn with_hint(mut self, sentence: impl Into<String>) -> Self {
        if let Self::Invalid { hint, .. } | Self::File { hint, .. } | Self::Machine { hint, .. } =
            &mut self
        {
            *hint = Some(sentence.into());
        }
        self
    }

    /// For `map_err` on reading: `fs::read(path).map_err(Error::read(path))`.
    pub fn read(path: impl AsRef<Path>) -> impl FnOnce(io::Error) -> Self {
        let path = path.as_ref().to_owned();
        move |source| Self::Read { path, source }
    }

    /// For `map_err` on writing.
    pub fn write(path: impl AsRef<Path>) -> impl FnOnce(io::Error) -> Self {
        let path = path.as_ref().to_owned();
        move |source| Self::Write { path, source }
    }

    /// For `map_err` on what is no file: `spawn(work).map_err(Error::machine("no thread can be started"))`.
    pub fn machine<E: Display>(what: impl Into<String>) -> impl FnOnce(E) -> Self {
        let what = what.into();
        move |problem| Self::Machine {
            what,
            problem: problem.to_string(),
            hint: None,
        }
    }

    /// The exit code of a program that ends with this error: 1, 2 or 3.
    pub fn exit_code(&self) -> u8 {
        match self {
            Self::Cancelled => 1,
            Self::Invalid { .. } | Self::File { .. } | Self::Read { .. } => 2,
            Self::Write { .. } | Self::Machine { .. } => 3,
        }
    }
}

/// Holds a number against its range, as f32 both: 0.01 as f64 is less than as f32. NaN is in no range.
pub(crate) fn in_range(
    what: impl Into<String>,
    value: f32,
    range: RangeInclusive<f32>,
) -> Result<()> {
    if range.contains(&value) {
        return Ok(());
    }
    Err(Error::invalid(
        what,
        value,
        format!("allowed: {} to {}", range.start(), range.end()),
    ))
}

/// Opens a regular file and tells its length: the one way to the content of any input.
///
/// # Errors
/// [`Error::Read`] when it is not there, is a folder, or is no regular file.
pub(crate) fn open_regular(path: &Path) -> Result<(File, u64)> {
    // The kind is asked first: opening a named pipe would wait for a writer.
    let about = std::fs::metadata(path).map_err(Error::read(path))?;
    if about.is_file() {
        let file = File::open(path).map_err(Error::read(path))?;
        return Ok((file, about.len()));
    }
    let (kind, what) = if about.is_dir() {
        (
            io::ErrorKind::IsADirectory,
            "it is a folder; give the name of a file",
        )
    } else {
        (io::ErrorKind::InvalidInput, "it is not a regular file")
    };
    Err(Error::read(path)(io::Error::new(kind, what)))
}

/// [`open_regular`] for an input that means nothing without a content.
///
/// # Errors
/// As [`open_regular`], and [`Error::File`] for a file of no bytes.
pub(crate) fn open_filled(path: &Path) -> Result<(File, u64)> {
    match open_regular(path)? {
        (_, 0) => {
            Err(Error::file(path, "the file is empty").with_hint("Copy or export it once more"))
        }
        opened => Ok(opened),
    }
}

/// The word of `candidates` that is nearest to `word`, if any is near enough to be what was meant.
pub fn nearest_word<'a>(
    word: &str,
    candidates: impl IntoIterator<Item = &'a str>,
) -> Option<&'a str> {
    let lower = word.to_lowercase().replace(['-', ' '], "_");
    candidates
        .into_iter()
        .map(|c| (strsim::jaro_winkler(&lower, &c.replace('-', "_")), c))
        .filter(|(score, _)| *score > 0.75)
        .max_by(|a, b| a.0.total_cmp(&b.0))
        .map(|(_, c)| c)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn messages_name_the_thing_the_value_and_the_range() {
        let e = Error::invalid("--size", "0", "allowed: 1 to 32768").with_hint("Try --size 1024");
        assert_eq!(
            e.to_string(),
            "--size is 0; allowed: 1 to 32768. Try --size 1024"
        );
        assert_eq!(e.exit_code(), 2);
    }

    #[test]
    fn nearest_word_forgives_typos_and_dashes_but_not_everything() {
        let words = ["brushed_aluminium", "vinyl_record", "pot"];
        assert_eq!(
            nearest_word("brushed-alumnium", words),
            Some("brushed_aluminium")
        );
        assert_eq!(nearest_word("vinyl", words), Some("vinyl_record"));
        assert_eq!(nearest_word("zzz", words), None);
    }
}
