//! The journal: every edit is on disk before the next one begins, so that a program that is killed loses at most the stroke
//! in flight.
//!
//! A journal is a text file: a line that names the format, then a record a line, `CRC-32 in hex, a space, JSON`. The first
//! record is the document the edits start from. A line that does not check ends what is readable: a kill in the middle of a
//! line costs that line. The file is locked while its window is open, so that another window knows which ones are left behind.

use super::Edit;
use crate::error::{Error, Result};
use serde::{Deserialize, Serialize};
use std::fs::{self, File, OpenOptions};
use std::io::{self, BufRead, BufReader, Write};
use std::path::{Path, PathBuf};
use std::time::SystemTime;

/// The first line of every journal.
const FORMAT: &str = "anisomap journal 1";
/// How journals end their names.
const SUFFIX: &str = "journal";
/// The largest record that is read, bytes: a document of the largest size that recipes may have, in JSON.
const RECORD_MAX: u64 = 256 << 20;

/// The document that edits start from.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Base {
    /// The recipe's text.
    pub text: String,
    /// Where it was read from or last saved to.
    pub path: Option<PathBuf>,
    /// What it is called.
    pub title: String,
}

#[derive(Serialize)]
#[serde(rename_all = "snake_case")]
enum RecordRef<'a> {
    Base(&'a Base),
    Edit(&'a Edit),
}

#[derive(Deserialize)]
#[serde(rename_all = "snake_case")]
enum Record {
    Base(Box<Base>),
    Edit(Box<Edit>),
}

/// A journal that is being written.
#[derive(Debug)]
pub struct Journal {
    path: PathBuf,
    file: File,
    edits: u64,
}

impl Journal {
    /// Begins a journal in a folder, which is made when it is not there.
    ///
    /// # Errors
    /// [`Error::Write`] when folder or file cannot be written.
    pub fn begin(folder: &Path, base: &Base) -> Result<Self> {
        fs::create_dir_all(folder).map_err(Error::write(folder))?;
        let now = SystemTime::now()
            .duration_since(SystemTime::UNIX_EPOCH)
            .map_or(0, |d| d.as_micros());
        let (path, mut file) = (0..)
            .map(|n| folder.join(format!("{now}-{}-{n}.{SUFFIX}", std::process::id())))
            .find_map(|path| {
                let made = OpenOptions::new().append(true).create_new(true).open(&path);
                match made {
                    Err(e) if e.kind() == io::ErrorKind::AlreadyExists => None,
                    made => Some(
                        made.map(|file| (path.clone(), file))
                            .map_err(Error::write(&path)),
                    ),
                }
            })
            .expect("endless")?;
        let begun = file
            .lock()
            .and_then(|()| file.write_all(format!("{FORMAT}\n").as_bytes()))
            .and_then(|()| append(&mut file, &RecordRef::Base(base)));
        match begun {
            Ok(()) => Ok(Self {
                path,
                file,
                edits: 0,
            }),
            Err(e) => {
                let _ = fs::remove_file(&path); // nothing to recover in it
                Err(Error::write(&path)(e))
            }
        }
    }

    /// Where it is.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// How many edits it holds.
    pub fn edits(&self) -> u64 {
        self.edits
    }

    /// Writes an edit. It is with the system, and so outlives this process, when this returns.
    ///
    /// # Errors
    /// [`Error::Write`] when the disk is full or gone. The journal then ends before this edit.
    pub fn write(&mut self, edit: &Edit) -> Result<()> {
        let length = self
            .file
            .metadata()
            .map_err(Error::write(&self.path))?
            .len();
        append(&mut self.file, &RecordRef::Edit(edit)).map_err(|e| {
            // A half-written line would hide all that follow.
            let _ = self.file.set_len(length);
            Error::write(&self.path)(e)
        })?;
        self.edits += 1;
        Ok(())
    }

    /// Starts over from another document, as after saving: the old journal goes once the new one is there.
    ///
    /// # Errors
    /// [`Error::Write`]; the old journal is then kept.
    pub fn restart(&mut self, base: &Base) -> Result<()> {
        let folder = self.path.parent().unwrap_or(Path::new(".")).to_owned();
        let new = Self::begin(&folder, base)?;
        std::mem::replace(self, new).end();
        Ok(())
    }

    /// Removes the file: nothing is left to recover.
    pub fn end(self) {
        let _ = fs::remove_file(&self.path); // one more question at the next start is all it costs
    }
}

fn append(file: &mut File, record: &RecordRef<'_>) -> io::Result<()> {
    let json = serde_json::to_string(record).map_err(io::Error::other)?;
    let line = format!("{:08x} {json}\n", crc32fast::hash(json.as_bytes()));
    file.write_all(line.as_bytes())
}

/// What a journal holds that nobody has open.
#[derive(Debug)]
pub struct LeftBehind {
    /// The file.
    pub path: PathBuf,
    /// When it was last written.
    pub time: Option<SystemTime>,
    /// The document its edits start from.
    pub base: Base,
    /// The edits that can be read, in order.
    pub edits: Vec<Edit>,
    /// What could not be read, in a sentence for the user.
    pub damage: Option<String>,
    /// Held so that no other window offers it as well.
    lock: File,
}

impl LeftBehind {
    /// Removes the journal, once its work is in another document or is not wanted.
    pub fn discard(self) {
        drop(self.lock);
        let _ = fs::remove_file(&self.path);
    }
}

/// The journals in a folder that no window has open and that hold edits, the newest first, and what is said of those that
/// cannot be read at all. A journal without edits is removed. A folder that is not there holds none.
pub fn left_behind(folder: &Path) -> (Vec<LeftBehind>, Vec<Error>) {
    let (mut found, mut errors) = (Vec::new(), Vec::new());
    let Ok(entries) = fs::read_dir(folder) else {
        return (found, errors);
    };
    for path in entries.flatten().map(|e| e.path()) {
        if path.extension().is_none_or(|e| e != SUFFIX) {
            continue;
        }
        match read(&path) {
            Ok(Some(left)) if left.edits.is_empty() && left.damage.is_none() => left.discard(),
            Ok(Some(left)) => found.push(left),
            Ok(None) => {} // in use
            Err(e) => errors.push(e),
        }
    }
    found.sort_by_key(|left| std::cmp::Reverse(left.time));
    (found, errors)
}

/// Reads a journal; `None` when a window has it open.
fn read(path: &Path) -> Result<Option<LeftBehind>> {
    let lock = File::open(path).map_err(Error::read(path))?;
    if lock.try_lock().is_err() {
        return Ok(None);
    }
    let about = lock.metadata().map_err(Error::read(path))?;
    let mut lines = Lines(BufReader::new(File::open(path).map_err(Error::read(path))?));
    let first = lines.next()?;
    if first.as_deref().is_none_or(str::is_empty) {
        return nothing_in_it(path); // killed while it was begun
    }
    if first.as_deref() != Some(FORMAT) {
        let problem = "this is no journal of a version that can be read";
        return Err(Error::file(path, problem).with_hint("Remove it if you do not need it"));
    }
    let base = match lines.next()?.as_deref().and_then(parse) {
        Some(Record::Base(base)) => *base,
        _ if lines.count()? == 0 => return nothing_in_it(path),
        _ => {
            let problem = "the document that its edits start from cannot be read";
            return Err(Error::file(path, problem).with_hint("Nothing of it can be recovered"));
        }
    };
    let (mut edits, mut damage) = (Vec::new(), None);
    while let Some(line) = lines.next()? {
        match parse(&line) {
            Some(Record::Edit(edit)) => edits.push(*edit),
            _ => {
                let rest = lines.count()?;
                damage = Some(match rest {
                    0 => "The last edit was not written to its end.".to_owned(),
                    n => format!(
                        "After {} edits the journal is damaged: {} more cannot be read.",
                        edits.len(),
                        n + 1
                    ),
                });
                break;
            }
        }
    }
    Ok(Some(LeftBehind {
        path: path.to_owned(),
        time: about.modified().ok(),
        base,
        edits,
        damage,
        lock,
    }))
}

/// Removes a journal that no edit can have reached.
fn nothing_in_it(path: &Path) -> Result<Option<LeftBehind>> {
    fs::remove_file(path).map_err(Error::write(path))?;
    Ok(None)
}

/// The record of a line whose sum checks.
fn parse(line: &str) -> Option<Record> {
    let (sum, json) = line.split_once(' ')?;
    let sum = u32::from_str_radix(sum, 16).ok()?;
    (sum == crc32fast::hash(json.as_bytes())).then_some(())?;
    serde_json::from_str(json).ok()
}

/// Lines of bounded length.
struct Lines(BufReader<File>);

impl Lines {
    /// The next line without its end. A line that is too long or no text is empty: no record.
    fn next(&mut self) -> Result<Option<String>> {
        let mut bytes = Vec::new();
        let mut part = io::Read::take(&mut self.0, RECORD_MAX);
        let n = part
            .read_until(b'\n', &mut bytes)
            .map_err(Error::read("the journal"))?;
        if n == 0 {
            return Ok(None);
        }
        // A line without its end was not written whole.
        let whole = bytes.pop() == Some(b'\n');
        Ok(Some(match String::from_utf8(bytes) {
            Ok(text) if whole => text,
            _ => String::new(),
        }))
    }

    fn count(&mut self) -> Result<usize> {
        let mut n = 0;
        while self.next()?.is_some() {
            n += 1;
        }
        Ok(n)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn base() -> Base {
        Base {
            text: "version = 1\n".to_owned(),
            path: Some(PathBuf::from("a b/ü.toml")),
            title: "ü".to_owned(),
        }
    }

    fn edits() -> Vec<Edit> {
        (0..5).map(|at| Edit::RemoveLayer { at }).collect()
    }

    fn written(folder: &Path) -> PathBuf {
        let mut journal = Journal::begin(folder, &base()).unwrap();
        for edit in edits() {
            journal.write(&edit).unwrap();
        }
        journal.path().to_owned()
    }

    #[test]
    fn what_was_written_is_read_once_nobody_has_it_open() {
        let folder = tempfile::tempdir().unwrap();
        let journal = Journal::begin(folder.path(), &base()).unwrap();
        assert!(left_behind(folder.path()).0.is_empty(), "it is in use");
        drop(journal);
        assert!(left_behind(folder.path()).0.is_empty(), "it holds no edit");
        let path = written(folder.path());
        let (mut found, errors) = left_behind(folder.path());
        assert!(errors.is_empty());
        let left = found.pop().unwrap();
        assert_eq!((left.path.clone(), &left.base), (path.clone(), &base()));
        assert_eq!((&left.edits, &left.damage), (&edits(), &None));
        assert!(
            left_behind(folder.path()).0.is_empty(),
            "another window offers it"
        );
        left.discard();
        assert!(!path.exists());
    }

    #[test]
    fn a_cut_at_any_byte_costs_at_most_the_edit_it_falls_into() {
        let folder = tempfile::tempdir().unwrap();
        let path = written(folder.path());
        let bytes = fs::read(&path).unwrap();
        let text = String::from_utf8(bytes.clone()).unwrap();
        let first_edit = text.match_indices('\n').nth(1).unwrap().0 + 1;
        for cut in first_edit..=bytes.len() {
            fs::write(&path, &bytes[..cut]).unwrap();
            let left = read(&path).unwrap().unwrap();
            let whole = text[first_edit..cut].matches('\n').count();
            assert_eq!(left.edits, edits()[..whole]);
            assert_eq!(left.damage.is_some(), !text[..cut].ends_with('\n'));
        }
    }

    #[test]
    fn damage_ends_what_is_readable_and_is_told() {
        let folder = tempfile::tempdir().unwrap();
        let path = written(folder.path());
        let text = fs::read_to_string(&path).unwrap();
        let mut lines: Vec<&str> = text.lines().collect();
        lines[4] = "00000000 {}";
        fs::write(&path, lines.join("\n") + "\n").unwrap();
        let left = read(&path).unwrap().unwrap();
        assert_eq!(left.edits, edits()[..2]);
        assert!(left.damage.unwrap().contains("3 more cannot be read"));
        drop(left.lock);
        for broken in ["something else\n", "anisomap journal 1\nx y\nz\n"] {
            fs::write(&path, broken).unwrap();
            let (found, errors) = left_behind(folder.path());
            assert!(found.is_empty() && errors.len() == 1, "{broken:?}");
        }
        for begun in [
            "",
            "anisom",
            "anisomap journal 1\n",
            "anisomap journal 1\n12345678 {",
        ] {
            fs::write(&path, begun).unwrap();
            let (found, errors) = left_behind(folder.path());
            assert!(
                found.is_empty() && errors.is_empty() && !path.exists(),
                "{begun:?}"
            );
        }
    }

    #[test]
    fn a_restarted_journal_replaces_the_old_one() {
        let folder = tempfile::tempdir().unwrap();
        let mut journal = Journal::begin(folder.path(), &base()).unwrap();
        journal.write(&Edit::RemoveLayer { at: 0 }).unwrap();
        let old = journal.path().to_owned();
        journal.restart(&base()).unwrap();
        assert!(!old.exists() && journal.path().exists() && journal.edits() == 0);
        journal.end();
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 0);
    }
}
