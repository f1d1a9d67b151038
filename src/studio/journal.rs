//! The journal: every edit is on disk before the next one begins, so that a program that is killed loses at most the stroke
//! in flight.
//!
//! A journal is a text file: a line that names the format, then a record a line, `CRC-32 in hex, a space, JSON`. The first
//! record is the document the edits start from. A line that does not check ends what is readable: a kill in the middle of a
//! line costs that line.
//!
//! The file is locked while its window is open, so that another window knows which ones are left behind. It gets its name
//! once it is locked and holds the document: under that name nobody ever sees a journal that looks as if nobody had it.
//! Where the file system knows no locks, the process that the name tells is looked for instead.

use super::Edit;
use crate::error::{Error, Result, open_regular};
use crate::recipe::{self, Stamp};
use serde::{Deserialize, Serialize};
use std::fs::{self, File, Metadata, OpenOptions, TryLockError};
use std::io::{self, BufRead, BufReader, Write};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU32, Ordering};
use std::time::{Duration, SystemTime};

/// The first line of every journal.
const FORMAT: &str = "anisomap journal 1";
/// How journals end their names.
const SUFFIX: &str = "journal";
/// How they do until they are whole.
const PART: &str = "part";
/// The age after which a journal that never became whole is nobody's any more.
const PART_AGE: Duration = Duration::from_secs(3600);
/// The largest record, in bytes: a document of the largest size that recipes may have, in JSON, where a line's end and a
/// quotation mark take two.
const RECORD_MAX: u64 = 2 * recipe::BYTES_MAX;

/// The document that edits start from.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Base {
    /// The recipe's text.
    pub text: String,
    /// Where it was read from or last saved to.
    #[serde(with = "super::paths::maybe")]
    pub path: Option<PathBuf>,
    /// What it is called.
    pub title: String,
    /// How many changes it holds that its file does not.
    #[serde(default)]
    pub unsaved: u64,
    /// Its file's stamp when it was read or last saved.
    #[serde(default)]
    pub stamp: Option<Stamp>,
}

/// Who has a file, as far as locks tell.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Holder {
    /// We, from now on and until the file is closed.
    We,
    Another,
    /// The file system knows no locks.
    Unknown,
}

/// Asks for a file. A parameter of what follows, so that tests may have a file system without locks.
type Hold = fn(&File) -> Holder;

fn hold(file: &File) -> Holder {
    match file.try_lock() {
        Ok(()) => Holder::We,
        Err(TryLockError::WouldBlock) => Holder::Another,
        Err(TryLockError::Error(_)) => Holder::Unknown,
    }
}

/// A journal's file, which no other window offers while this lives.
#[derive(Debug)]
pub(super) struct Held {
    path: PathBuf,
    file: File,
}

impl Held {
    /// Removes the file, and only then lets it go.
    pub(super) fn remove(self) {
        let _ = fs::remove_file(&self.path); // one more question at the next start is all it costs
    }
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
pub struct Journal(Held);

impl Journal {
    /// Begins a journal in a folder, which is made when it is not there.
    ///
    /// # Errors
    /// [`Error::Write`] when folder or file cannot be written.
    pub fn begin(folder: &Path, base: &Base) -> Result<Self> {
        Self::begin_with(folder, base, hold)
    }

    fn begin_with(folder: &Path, base: &Base, hold: Hold) -> Result<Self> {
        fs::create_dir_all(folder).map_err(Error::write(folder))?;
        let part = folder.join(new_name());
        let path = part.with_extension(SUFFIX);
        let made = OpenOptions::new().append(true).create_new(true).open(&part);
        let mut file = made.map_err(Error::write(&path))?;
        let _ = hold(&file); // a new file is nobody else's
        let begun = file
            .write_all(format!("{FORMAT}\n").as_bytes())
            .and_then(|()| append(&mut file, &RecordRef::Base(base)))
            .and_then(|()| fs::rename(&part, &path));
        match begun {
            Ok(()) => Ok(Self(Held { path, file })),
            Err(e) => {
                let _ = fs::remove_file(&part); // nothing to recover in it
                Err(Error::write(&path)(e))
            }
        }
    }

    /// Where it is.
    pub fn path(&self) -> &Path {
        &self.0.path
    }

    /// Writes an edit. It is with the system, and so outlives this process, when this returns.
    ///
    /// # Errors
    /// [`Error::Write`] when the disk is full or gone, or the file was removed. The journal then ends before this edit.
    pub fn write(&mut self, edit: &Edit) -> Result<()> {
        let Held { path, file } = &mut self.0;
        let about = file.metadata().map_err(Error::write(&*path))?;
        if is_removed(&about) {
            let gone = io::Error::new(io::ErrorKind::NotFound, "another program removed it");
            return Err(Error::write(&*path)(gone));
        }
        append(file, &RecordRef::Edit(edit)).map_err(|e| {
            // A half-written line would hide all that follow.
            let _ = file.set_len(about.len());
            Error::write(&*path)(e)
        })
    }

    /// Removes the file: nothing is left to recover.
    pub fn end(self) {
        self.0.remove();
    }

    pub(super) fn into_held(self) -> Held {
        self.0
    }

    /// From now on nothing can be written, as on a disk that is full.
    #[cfg(all(test, target_os = "linux"))]
    pub(super) fn fill_disk(&mut self) {
        let full = OpenOptions::new()
            .append(true)
            .open("/dev/full")
            .expect("Linux has it");
        // The lock stays with the file that it was.
        std::mem::forget(std::mem::replace(&mut self.0.file, full));
    }
}

/// A name that no other journal has: when it was begun, by which process, and a number.
fn new_name() -> String {
    static COUNT: AtomicU32 = AtomicU32::new(0);
    let now = SystemTime::now()
        .duration_since(SystemTime::UNIX_EPOCH)
        .map_or(0, |d| d.as_micros());
    let count = COUNT.fetch_add(1, Ordering::Relaxed);
    format!("{now}-{}-{count}.{PART}", std::process::id())
}

/// Whether a file that is open has no name any more.
#[cfg(unix)]
fn is_removed(about: &Metadata) -> bool {
    std::os::unix::fs::MetadataExt::nlink(about) == 0
}

/// Whether a file that is open has no name any more: not to be asked here.
#[cfg(not(unix))]
fn is_removed(_: &Metadata) -> bool {
    false
}

/// Whether the process that a journal's name tells runs, and is one of ours. Where processes cannot be looked up none does:
/// work that is offered twice is better than work that is never offered, and a window whose journal is taken away begins
/// another.
fn is_running(path: &Path) -> bool {
    let stem = path.file_stem().and_then(|s| s.to_str()).unwrap_or("");
    let Some(process) = stem.split('-').nth(1).and_then(|p| p.parse::<u32>().ok()) else {
        return false;
    };
    let name = |process: &str| fs::read_to_string(format!("/proc/{process}/comm")).ok();
    process == std::process::id()
        || name("self").is_some_and(|ours| name(&process.to_string()) == Some(ours))
}

fn append(file: &mut File, record: &RecordRef<'_>) -> io::Result<()> {
    let json = serde_json::to_string(record).map_err(io::Error::other)?;
    let line = format!("{:08x} {json}\n", crc32fast::hash(json.as_bytes()));
    if line.len() as u64 > RECORD_MAX {
        return Err(io::Error::new(
            io::ErrorKind::FileTooLarge,
            format!("a record of {} bytes could not be read back", line.len()),
        ));
    }
    file.write_all(line.as_bytes())
}

/// What a journal holds that nobody has open.
#[derive(Debug)]
pub struct LeftBehind {
    /// When it was last written.
    pub time: Option<SystemTime>,
    /// The document its edits start from.
    pub base: Base,
    /// The edits that can be read, in order.
    pub edits: Vec<Edit>,
    /// What could not be read, in a sentence for the user.
    pub damage: Option<String>,
    /// Held so that no other window offers it as well.
    held: Held,
}

impl LeftBehind {
    /// Where it is.
    pub fn path(&self) -> &Path {
        &self.held.path
    }

    /// How many changes it holds that the document's file does not.
    pub fn changes(&self) -> u64 {
        self.base.unsaved.saturating_add(self.edits.len() as u64)
    }

    /// Removes the journal, once its work is in another document or is not wanted.
    pub fn discard(self) {
        self.held.remove();
    }

    /// What it holds, and its file, to be removed once that is elsewhere.
    pub(super) fn take_apart(self) -> (Base, Vec<Edit>, Held) {
        (self.base, self.edits, self.held)
    }
}

/// The journals in a folder that no window has open and that hold work, the newest first, and what is said of those that
/// cannot be read at all. A journal without work is removed. A folder that is not there holds none.
pub fn left_behind(folder: &Path) -> (Vec<LeftBehind>, Vec<Error>) {
    left_behind_with(folder, hold)
}

fn left_behind_with(folder: &Path, hold: Hold) -> (Vec<LeftBehind>, Vec<Error>) {
    let (mut found, mut errors) = (Vec::new(), Vec::new());
    let Ok(entries) = fs::read_dir(folder) else {
        return (found, errors);
    };
    for path in entries.flatten().map(|e| e.path()) {
        let ending = path.extension().unwrap_or_default();
        if ending == PART {
            remove_if_old(&path);
        }
        if ending != SUFFIX {
            continue;
        }
        match read(&path, hold) {
            Ok(Some(left)) if left.changes() == 0 && left.damage.is_none() => left.discard(),
            Ok(Some(left)) => found.push(left),
            Ok(None) => {} // in use
            Err(e) => errors.push(e),
        }
    }
    found.sort_by_key(|left| std::cmp::Reverse(left.time));
    (found, errors)
}

/// Removes a journal that was never whole, and whose window was killed long ago.
fn remove_if_old(path: &Path) {
    let written = fs::metadata(path).and_then(|about| about.modified()).ok();
    let age = written.and_then(|time| time.elapsed().ok());
    if age.is_some_and(|age| age > PART_AGE) {
        let _ = fs::remove_file(path); // it is looked at again at the next start
    }
}

/// Reads a journal; `None` when a window has it open, or it has just ended.
fn read(path: &Path, hold: Hold) -> Result<Option<LeftBehind>> {
    // The kind is asked first: opening a named pipe would wait for a writer.
    if fs::metadata(path).is_ok_and(|about| !about.is_file()) {
        open_regular(path)?; // says what it is
    }
    let file = match File::open(path) {
        Err(e) if e.kind() == io::ErrorKind::NotFound => return Ok(None),
        file => file.map_err(Error::read(path))?,
    };
    match hold(&file) {
        Holder::We => {}
        Holder::Another => return Ok(None),
        Holder::Unknown if is_running(path) => return Ok(None),
        Holder::Unknown => {}
    }
    let about = file.metadata().map_err(Error::read(path))?;
    if is_removed(&about) {
        return Ok(None);
    }
    let mut lines = Lines(BufReader::new(&file));
    let first = lines.next()?;
    let may_be_begun = about.len() <= FORMAT.len() as u64;
    if may_be_begun && first.as_deref().is_none_or(str::is_empty) {
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
    let (mut edits, mut damage, mut brush) = (Vec::new(), None, None);
    while let Some(line) = lines.next()? {
        match parse(&line) {
            Some(Record::Edit(mut edit)) => {
                edit.share_brush(&mut brush);
                edits.push(*edit);
            }
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
    let path = path.to_owned();
    Ok(Some(LeftBehind {
        time: about.modified().ok(),
        base,
        edits,
        damage,
        held: Held { path, file },
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
struct Lines<'a>(BufReader<&'a File>);

impl Lines<'_> {
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
            ..Base::default()
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
        assert_eq!((left.path(), &left.base), (path.as_path(), &base()));
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
            let left = read(&path, hold).unwrap().unwrap();
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
        let left = read(&path, hold).unwrap().unwrap();
        assert_eq!(left.edits, edits()[..2]);
        assert!(left.damage.unwrap().contains("3 more cannot be read"));
        drop(left.held);
        for broken in [
            "something else\n",
            "something else, and long, without an end",
            "anisomap journal 1\nx y\nz\n",
        ] {
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
    fn another_start_takes_no_journal_that_is_being_begun() {
        let folder = tempfile::tempdir().unwrap();
        // The other window looks around at the very moment between the file's first name and its lock.
        thread_local!(static FOLDER: std::cell::RefCell<PathBuf> = Default::default());
        FOLDER.set(folder.path().to_owned());
        fn late(file: &File) -> Holder {
            let (found, errors) = left_behind(&FOLDER.take());
            assert!(found.is_empty() && errors.is_empty());
            hold(file)
        }
        let mut journal = Journal::begin_with(folder.path(), &base(), late).unwrap();
        assert!(journal.path().exists());
        journal.write(&edits()[0]).unwrap();
        assert!(left_behind(folder.path()).0.is_empty(), "it is in use");
        drop(journal);
        assert_eq!(left_behind(folder.path()).0[0].edits, edits()[..1]);
    }

    #[test]
    fn a_file_system_without_locks_keeps_journals_too() {
        let folder = tempfile::tempdir().unwrap();
        let unknown = |_: &File| Holder::Unknown;
        let mut journal = Journal::begin_with(folder.path(), &base(), unknown).unwrap();
        journal.write(&edits()[0]).unwrap();
        let path = journal.path().to_owned();
        let (found, errors) = left_behind_with(folder.path(), unknown);
        assert!(found.is_empty() && errors.is_empty(), "its process runs");
        drop(journal);
        // No process has this number.
        let other = folder.path().join("1-4294967295-0.journal");
        fs::rename(&path, &other).unwrap();
        let (mut found, errors) = left_behind_with(folder.path(), unknown);
        assert!(errors.is_empty());
        let left = found.remove(0);
        assert_eq!(left.edits, edits()[..1]);
        left.discard();
        assert!(!other.exists());
    }

    #[test]
    fn journals_that_never_were_whole_go_after_a_while() {
        let folder = tempfile::tempdir().unwrap();
        let (new, old) = (folder.path().join("2.part"), folder.path().join("1.part"));
        fs::write(&new, "").unwrap();
        let file = File::create(&old).unwrap();
        file.set_modified(SystemTime::now() - 2 * PART_AGE).unwrap();
        assert!(left_behind(folder.path()).0.is_empty());
        assert!(new.exists() && !old.exists());
    }

    #[cfg(unix)]
    #[test]
    fn a_document_whose_path_is_no_unicode_is_kept() {
        use std::os::unix::ffi::OsStrExt;
        let folder = tempfile::tempdir().unwrap();
        let name = std::ffi::OsStr::from_bytes(b"/nowhere/caf\xe9.toml");
        let base = Base {
            path: Some(name.into()),
            unsaved: 1,
            ..base()
        };
        drop(Journal::begin(folder.path(), &base).unwrap());
        assert_eq!(left_behind(folder.path()).0[0].base, base);
    }
}
