//! Maps to files, one module a format.
//!
//! Each file appears whole or not at all, and is the same to the byte for any number of threads.

pub mod codes;
pub mod exr;
pub mod gltf;
pub mod laid;
pub mod png;

use crate::convention::MapInfo;
use crate::error::{Error, Result};
use crate::filter::{Combed, Line, comb};
use crate::map::AnisoMap;
use serde::Serialize;
use std::collections::BTreeSet;
use std::ffi::OsString;
use std::fs::File;
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, OnceLock, PoisonError};
use tempfile::NamedTempFile;

/// A map on its way out: what every format needs, and what several of them share.
#[derive(Debug)]
pub struct Export<'a> {
    map: &'a AnisoMap,
    info: &'a MapInfo,
    combed: OnceLock<Combed<'a>>,
}

impl<'a> Export<'a> {
    /// Wraps a map and what is known about it.
    pub fn new(map: &'a AnisoMap, info: &'a MapInfo) -> Self {
        Self {
            map,
            info,
            combed: OnceLock::new(),
        }
    }

    /// The map.
    pub fn map(&self) -> &'a AnisoMap {
        self.map
    }

    /// What is known about it.
    pub fn info(&self) -> &'a MapInfo {
        self.info
    }

    /// Its x axes as arrows; combed at the first call.
    pub fn combed(&self) -> &Combed<'a> {
        self.combed.get_or_init(|| comb(self.map, Line::X))
    }
}

/// A file that was written.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Written {
    /// Where.
    pub path: PathBuf,
    /// Its size.
    pub bytes: u64,
}

/// `folder/name` and `_alpha.exr` to `folder/name_alpha.exr`. A dot in the name stays.
pub fn beside(stem: &Path, suffix: &str) -> PathBuf {
    let mut name = OsString::from(stem.as_os_str());
    name.push(suffix);
    PathBuf::from(name)
}

/// Where a file really is or would be, for those who mean to write what a link leads to and not to replace the link.
pub fn real_path(path: &Path) -> PathBuf {
    let folder = path.parent().unwrap_or(Path::new(""));
    let beyond = || path.read_link().map(|to| folder.join(to)); // a link to what is not there yet
    let real = path.canonicalize().or_else(|_| beyond());
    real.unwrap_or_else(|_| path.to_owned())
}

/// Writes a file that appears whole or not at all: under a temporary name in the same folder, synced to disk, then renamed.
/// An existing file is replaced, by one that the same people may read and write; no folder is made.
///
/// # Errors
/// [`Error::Write`] with `path` when the folder is missing or not writable, the disk is full, or `path` is a folder. Nothing
/// is left behind then.
pub fn write_atomic(
    path: &Path,
    write: impl FnOnce(&mut BufWriter<&File>) -> io::Result<()>,
) -> Result<Written> {
    write_beside(path, write).map_err(Error::write(path))
}

fn write_beside(
    path: &Path,
    write: impl FnOnce(&mut BufWriter<&File>) -> io::Result<()>,
) -> io::Result<Written> {
    if path.is_dir() {
        return Err(io::Error::new(
            io::ErrorKind::IsADirectory,
            "it is a folder; give the name of a file",
        ));
    }
    let folder = match path.parent() {
        Some(folder) if folder != Path::new("") => folder,
        _ => Path::new("."),
    };
    let mut builder = tempfile::Builder::new();
    builder.prefix(".anisomap-").suffix(".part");
    // A temporary file is private by default; the result should be as readable as any other file of the user's.
    #[cfg(unix)]
    builder.permissions(std::os::unix::fs::PermissionsExt::from_mode(0o666));
    let unfinished = Unfinished::create(&builder, folder).map_err(|e| {
        // tempfile puts its own path into the message; the user knows only theirs.
        let text = match e.kind() {
            io::ErrorKind::NotFound if !folder.is_dir() => "its folder is not there".to_owned(),
            io::ErrorKind::NotFound => "its folder takes no new files".to_owned(),
            kind => kind.to_string(),
        };
        io::Error::new(e.kind(), text)
    })?;
    let file = unfinished.file();
    if let Ok(before) = std::fs::metadata(path) {
        // Where the system refuses, the file is as private as any new one.
        let _ = file.set_permissions(before.permissions());
    }
    let mut buffered = BufWriter::with_capacity(1 << 18, file);
    write(&mut buffered)?;
    buffered.flush()?;
    drop(buffered);
    file.sync_all()?;
    let bytes = file.metadata()?.len();
    unfinished.persist(path)?;
    Ok(Written {
        path: path.to_owned(),
        bytes,
    })
}

/// The files that are being written now, under their temporary names.
static UNFINISHED: Mutex<BTreeSet<PathBuf>> = Mutex::new(BTreeSet::new());

/// A temporary file that [`clear_unfinished`] knows of from its first to its last moment.
struct Unfinished(Option<NamedTempFile>);

impl Unfinished {
    fn create(builder: &tempfile::Builder<'_, '_>, folder: &Path) -> io::Result<Self> {
        let mut all = UNFINISHED.lock().unwrap_or_else(PoisonError::into_inner);
        let file = builder.tempfile_in(folder)?;
        all.insert(file.path().to_owned());
        Ok(Self(Some(file)))
    }

    fn file(&self) -> &File {
        self.0.as_ref().expect("taken at the end only").as_file()
    }

    fn persist(mut self, path: &Path) -> io::Result<()> {
        let mut all = UNFINISHED.lock().unwrap_or_else(PoisonError::into_inner);
        let file = self.0.take().expect("taken here only");
        all.remove(file.path());
        file.persist(path).map(drop).map_err(|e| e.error)
    }
}

impl Drop for Unfinished {
    fn drop(&mut self) {
        if let Some(file) = self.0.take() {
            let mut all = UNFINISHED.lock().unwrap_or_else(PoisonError::into_inner);
            all.remove(file.path());
            drop(file);
        }
    }
}

/// Removes every file that is being written, for a program that is about to exit in the middle of the work. While what it
/// returns is held no file begins or ends, so exit before it is dropped: work that goes on would fail.
#[must_use = "files may begin again once it is dropped"]
pub fn clear_unfinished() -> impl Drop {
    let all = UNFINISHED.lock().unwrap_or_else(PoisonError::into_inner);
    for path in all.iter() {
        // What is gone needs no removing, and nobody is left to be told of what cannot be.
        let _ = std::fs::remove_file(path);
    }
    all
}

#[cfg(test)]
pub(crate) mod samples {
    use crate::map::{AnisoMap, DEFAULT_TEXEL, Size, Texel, Wrap};
    use crate::math::Axis;

    /// A turned disc whose widths change from texel to texel.
    pub(crate) fn disc((width, height): (u32, u32), wrap: Wrap) -> AnisoMap {
        let size = Size::new(width, height).unwrap();
        let mut map = AnisoMap::constant(size, wrap, DEFAULT_TEXEL);
        let mut region = map.region_mut();
        for i in 0..size.texels() {
            let (x, y) = ((i % width as usize) as f32, (i / width as usize) as f32);
            let angle = (0.5 * height as f32 - y).atan2(x - 0.5 * width as f32);
            region.set(
                i,
                Texel {
                    alpha_x: 0.06 + 0.02 * (0.8 * x).sin(),
                    alpha_y: 0.3 + 0.1 * (0.5 * y).cos(),
                    axis: Axis::from_radians(angle + 1.57),
                },
            );
        }
        map
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs;

    #[test]
    fn a_file_appears_whole_or_not_at_all() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.txt");
        let written = write_atomic(&path, |f| f.write_all(b"first")).unwrap();
        assert_eq!((written.bytes, written.path.as_path()), (5, path.as_path()));
        let failed = write_atomic(&path, |f| {
            f.write_all(b"half of the sec")?;
            Err(io::Error::other("disk full"))
        });
        assert!(failed.unwrap_err().to_string().contains("disk full"));
        assert_eq!(fs::read(&path).unwrap(), b"first");
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1);
    }

    #[cfg(unix)]
    #[test]
    fn others_may_read_what_was_written() {
        use std::os::unix::fs::PermissionsExt;
        let folder = tempfile::tempdir().unwrap();
        let (ours, plain) = (folder.path().join("a"), folder.path().join("b"));
        write_atomic(&ours, |f| f.write_all(b"x")).unwrap();
        fs::write(&plain, b"x").unwrap();
        let mode = |p: &Path| fs::metadata(p).unwrap().permissions().mode();
        assert_eq!(mode(&ours), mode(&plain));
    }

    #[cfg(unix)]
    #[test]
    fn who_may_read_a_file_may_read_the_one_in_its_place() {
        use std::os::unix::fs::PermissionsExt;
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a");
        for mode in [0o600, 0o644, 0o666, 0o755] {
            fs::write(&path, b"x").unwrap();
            fs::set_permissions(&path, fs::Permissions::from_mode(mode)).unwrap();
            write_atomic(&path, |f| f.write_all(b"y")).unwrap();
            let now = fs::metadata(&path).unwrap().permissions().mode();
            assert_eq!(now & 0o777, mode, "{mode:o}");
        }
    }

    #[test]
    fn targets_that_cannot_be_written_are_named() {
        let folder = tempfile::tempdir().unwrap();
        let e = write_atomic(folder.path(), |_| Ok(())).unwrap_err();
        assert_eq!(e.exit_code(), 3);
        assert!(e.to_string().contains("folder"), "{e}");
        let missing = folder.path().join("no").join("a.exr");
        let e = write_atomic(&missing, |_| Ok(())).unwrap_err().to_string();
        assert!(e.contains("a.exr") && !e.contains(".part"), "{e}");
        assert!(e.contains("its folder is not there"), "{e}");
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 0);
    }

    #[cfg(target_os = "linux")]
    #[test]
    fn a_folder_that_takes_no_files_is_not_called_missing() {
        // The kernel answers as if /proc were not there.
        let e = write_atomic(Path::new("/proc/x.png"), |_| Ok(())).unwrap_err();
        assert!(!e.to_string().contains("not there"), "{e}");
    }

    #[test]
    fn suffixes_keep_dots_in_names() {
        assert_eq!(
            beside(Path::new("out/pot.v2"), "_alpha.exr"),
            Path::new("out/pot.v2_alpha.exr")
        );
    }
}
