//! Files that come to lie beside a recipe, which names files of its own folder alone.

use super::write_atomic;
use crate::error::{Error, Result, open_regular};
use crate::mesh;
use crate::recipe::{Files, Way};
use std::collections::BTreeMap;
use std::io::{self, Read};
use std::path::{Path, PathBuf};

/// A path in a folder that nothing has yet: `lid.obj`, `lid_2.obj` and so on.
///
/// # Panics
/// Never: the numbers do not end before the files.
pub fn free_path(folder: &Path, name: &str) -> PathBuf {
    let mut paths = numbered(folder, name);
    paths
        .find(|path| !path.exists())
        .expect("the numbers do not end before the files")
}

/// `lid.obj`, `lid_2.obj` and so on, without end.
fn numbered(folder: &Path, name: &str) -> impl Iterator<Item = PathBuf> {
    let (stem, ending) = match name.rsplit_once('.') {
        Some((stem, ending)) => (stem.to_owned(), format!(".{ending}")),
        None => (name.to_owned(), String::new()),
    };
    let folder = folder.to_owned();
    let first = folder.join(name);
    let others = (2u64..).map(move |n| folder.join(format!("{stem}_{n}{ending}")));
    std::iter::once(first).chain(others)
}

/// A file that lies in a recipe's folder.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Laid {
    /// What the recipe calls it, with `/` between.
    pub name: String,
    /// What to say where it has another name than before.
    pub news: Option<String>,
}

/// Files that were copied, to be taken away again when what they were copied for is not done after all.
#[derive(Debug, Default)]
pub struct Copies {
    files: Vec<PathBuf>,
    folders: Vec<PathBuf>,
}

impl Copies {
    /// What they were copied for is done: they stay.
    pub fn keep(mut self) -> Vec<PathBuf> {
        self.folders.clear();
        std::mem::take(&mut self.files)
    }

    fn copy(&mut self, from: &Path, to: &Path, wanted: &dyn Fn() -> bool) -> Result<()> {
        let (file, _) = open_regular(from)?;
        if let Some(folder) = to.parent().filter(|f| !f.exists()) {
            // Folders that the file needs, the outermost first.
            let missing = folder.ancestors().take_while(|f| !f.exists());
            let mut missing: Vec<PathBuf> = missing.map(Path::to_owned).collect();
            missing.reverse();
            std::fs::create_dir_all(folder).map_err(Error::write(folder))?;
            self.folders.extend(missing);
        }
        let mut file = Wanted { file, wanted };
        let written = write_atomic(to, |out| io::copy(&mut file, out).map(drop));
        if !wanted() {
            return Err(Error::Cancelled);
        }
        written?;
        self.files.push(to.to_owned());
        Ok(())
    }
}

impl Drop for Copies {
    fn drop(&mut self) {
        for file in &self.files {
            let _ = std::fs::remove_file(file); // what cannot be removed is in nobody's way
        }
        for folder in self.folders.iter().rev() {
            let _ = std::fs::remove_dir(folder); // one that is not empty stays
        }
    }
}

/// A file that ends with an error once it is not wanted any more.
struct Wanted<'a, R> {
    file: R,
    wanted: &'a dyn Fn() -> bool,
}

impl<R: Read> Read for Wanted<'_, R> {
    fn read(&mut self, into: &mut [u8]) -> io::Result<usize> {
        if (self.wanted)() {
            self.file.read(into)
        } else {
            Err(io::Error::other("it is not wanted any more"))
        }
    }
}

/// A file as a recipe in `folder` may name it. One from elsewhere is copied there; with those that it needs into a folder of
/// their own, `needed` being seen from its folder. Where another file has its name it gets a number; one that holds the same
/// serves.
///
/// # Errors
/// [`Error::Read`] when it or the folder is not there, [`Error::Write`] when it cannot be copied, [`Error::File`] when its name
/// is no Unicode. Nothing is left of it then.
pub fn lay_beside(path: &Path, needed: &[PathBuf], folder: &Path) -> Result<Laid> {
    let mut copies = Copies::default();
    let laid = lay(path, needed, folder, &[], &|| true, &mut copies)?;
    copies.keep();
    Ok(laid)
}

/// As [`lay_beside`], on no path that is `reserved`, as long as it is wanted.
fn lay(
    path: &Path,
    needed: &[PathBuf],
    folder: &Path,
    reserved: &[PathBuf],
    wanted: &dyn Fn() -> bool,
    copies: &mut Copies,
) -> Result<Laid> {
    let real = path.canonicalize().map_err(Error::read(path))?;
    let home = folder.canonicalize().map_err(Error::read(folder))?;
    if let Some(inside) = inside(path, &home).or_else(|| inside(&real, &home)) {
        let name = words(path, &inside)?;
        return Ok(Laid { name, news: None });
    }
    let own = words(path, Path::new(path.file_name().unwrap_or_default()))?;
    let source = path.parent().unwrap_or(Path::new(""));
    let files: Vec<(PathBuf, PathBuf)> = std::iter::once(PathBuf::from(&own))
        .chain(needed.iter().cloned())
        .map(|file| (source.join(&file), file))
        .collect();
    let alone = needed.is_empty();
    let stem = own.rsplit_once('.').map_or(&*own, |(stem, _)| stem);
    let at = |to: &Path, file: &Path| {
        if alone { to.to_owned() } else { to.join(file) }
    };
    // A link that leads out of the folder would not be read again.
    let is_inside = |path: &Path| {
        path.canonicalize()
            .is_ok_and(|real| real.starts_with(&home))
    };
    let serves = |to: &Path| {
        files.iter().all(|(from, file)| {
            let at = at(to, file);
            is_inside(&at) && same(from, &at)
        })
    };
    let is_free = |to: &Path| !to.exists() && !to.is_symlink();
    let to = numbered(folder, if alone { &own } else { stem })
        .filter(|to| !reserved.contains(to))
        .find(|to| is_free(to) || serves(to))
        .expect("the numbers do not end before the files");
    if is_free(&to) {
        for (from, file) in &files {
            copies.copy(from, &at(&to, file), wanted)?;
        }
    }
    let lies = at(&to, Path::new(&own));
    let name = words(path, lies.strip_prefix(folder).unwrap_or(&lies))?;
    let news =
        (name != own).then(|| format!("{} is kept beside the recipe as {name}", path.display()));
    Ok(Laid { name, news })
}

/// Copies the files that a recipe names into another folder, but for those that were copied `before`, on no path that is `reserved`; gives the way there, or `None` where
/// names stay as they are. What may not be named, or is not there, keeps its name.
///
/// # Errors
/// As [`lay_beside`], and [`Error::Cancelled`] once it is not wanted any more. Nothing is left of it then.
pub(crate) fn bring<'a>(
    files: &Files,
    before: &BTreeMap<PathBuf, String>,
    names: impl Iterator<Item = &'a str>,
    folder: &Path,
    reserved: &[PathBuf],
    wanted: &dyn Fn() -> bool,
) -> Result<(Option<Way>, Copies)> {
    let mut copies = Copies::default();
    let Some(mut way) = Way::between(files.folder.as_deref(), folder)? else {
        return Ok((None, copies));
    };
    way.copied.clone_from(before);
    let home = folder.canonicalize().map_err(Error::read(folder))?;
    for name in names {
        let Ok(real) = files.resolve("file", name) else {
            continue;
        };
        if !real.starts_with(&home) && !way.copied.contains_key(&real) {
            let path = way.place_of(name);
            let needed = mesh::companions(&path).unwrap_or_default();
            let laid = lay(&path, &needed, folder, reserved, wanted, &mut copies)?;
            way.copied.insert(real, laid.name);
        }
    }
    Ok((Some(way), copies))
}

/// A path within a folder as a recipe writes it.
fn words(file: &Path, path: &Path) -> Result<String> {
    let words: Option<Vec<&str>> = path.iter().map(|part| part.to_str()).collect();
    let words = words.filter(|words| !words.iter().any(|w| w.contains('\\')));
    words.map(|words| words.join("/")).ok_or_else(|| {
        Error::file(
            file,
            "a recipe cannot name it: its path is no Unicode, or holds a backslash",
        )
        .with_hint("Rename the file or its folders")
    })
}

/// The way to a file from a folder that it lies in.
fn inside(path: &Path, home: &Path) -> Option<PathBuf> {
    let parent = path.parent()?.canonicalize().ok()?;
    let whole = parent.join(path.file_name()?);
    let stays = whole.canonicalize().ok()?.starts_with(home);
    whole
        .strip_prefix(home)
        .ok()
        .filter(|_| stays)
        .map(Path::to_owned)
}

/// Whether two files hold the same; they are read side by side, a piece at a time.
fn same(one: &Path, other: &Path) -> bool {
    let (Ok((mut a, n)), Ok((mut b, m))) = (open_regular(one), open_regular(other)) else {
        return false;
    };
    let (mut left, mut right) = (vec![0; 1 << 16], vec![0; 1 << 16]);
    let mut rest = n;
    while n == m && rest > 0 {
        let piece = rest.min(1 << 16) as usize;
        let read = a
            .read_exact(&mut left[..piece])
            .and(b.read_exact(&mut right[..piece]));
        if read.is_err() || left[..piece] != right[..piece] {
            return false;
        }
        rest -= piece as u64;
    }
    n == m
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs;

    #[test]
    fn a_number_is_used_again_where_the_same_lies_under_it() {
        let root = tempfile::tempdir().unwrap();
        let (from, to) = (root.path().join("a.png"), root.path().join("to"));
        fs::create_dir(&to).unwrap();
        fs::write(&from, "ours").unwrap();
        fs::write(to.join("a.png"), "another's").unwrap();
        for _ in 0..2 {
            assert_eq!(lay_beside(&from, &[], &to).unwrap().name, "a_2.png");
        }
        fs::write(&from, "more").unwrap();
        assert_eq!(lay_beside(&from, &[], &to).unwrap().name, "a_3.png");
    }

    #[test]
    fn copies_go_when_what_they_were_for_is_not_done() {
        let root = tempfile::tempdir().unwrap();
        let (here, to) = (root.path().join("here"), root.path().join("to"));
        fs::create_dir_all(here.join("deep")).unwrap();
        fs::create_dir(&to).unwrap();
        for name in ["a.png", "deep/b.png"] {
            fs::write(here.join(name), name).unwrap();
        }
        let files = Files {
            folder: Some(here),
            allow_outside: false,
        };
        let names = || ["a.png", "deep/b.png", "missing.png"].into_iter();
        let reserved = [to.join("a.png")];
        let none = BTreeMap::new();
        let bring =
            |wanted: &dyn Fn() -> bool| bring(&files, &none, names(), &to, &reserved, wanted);
        let (way, copies) = bring(&|| true).unwrap();
        let named: Vec<String> = way.unwrap().copied.into_values().collect();
        assert_eq!(named, ["a_2.png", "b.png"]);
        drop(copies);
        assert_eq!(fs::read_dir(&to).unwrap().count(), 0);
        assert!(matches!(bring(&|| false), Err(Error::Cancelled)));
        assert_eq!(fs::read_dir(&to).unwrap().count(), 0);
        let kept = bring(&|| true).unwrap().1.keep();
        assert_eq!(kept, [to.join("a_2.png"), to.join("b.png")]);
    }

    #[cfg(unix)]
    #[test]
    fn names_that_a_recipe_cannot_write_are_refused() {
        use std::os::unix::ffi::OsStrExt;
        let root = tempfile::tempdir().unwrap();
        for name in [&b"a\\b.obj"[..], b"caf\xe9.obj"] {
            let path = root.path().join(std::ffi::OsStr::from_bytes(name));
            fs::write(&path, "v").unwrap();
            let error = lay_beside(&path, &[], root.path()).unwrap_err().to_string();
            assert!(error.contains("Rename"), "{error}");
        }
    }
}
