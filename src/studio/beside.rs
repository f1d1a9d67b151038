//! Files that come to lie beside a recipe, which names files of its own folder alone.

use crate::error::{Error, Result, open_regular};
use crate::export::write_atomic;
use std::io;
use std::path::{Path, PathBuf};

/// A path in a folder that nothing has yet: `lid.obj`, `lid_2.obj` and so on.
///
/// # Panics
/// Never: the numbers do not end before the files.
pub fn free_path(folder: &Path, name: &str) -> PathBuf {
    let (stem, ending) = match name.rsplit_once('.') {
        Some((stem, ending)) => (stem, format!(".{ending}")),
        None => (name, String::new()),
    };
    let numbered = (2..).map(|n| folder.join(format!("{stem}_{n}{ending}")));
    std::iter::once(folder.join(name))
        .chain(numbered)
        .find(|path| !path.exists())
        .expect("the numbers do not end before the files")
}

/// A file that lies in a recipe's folder.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Laid {
    /// What the recipe calls it, with `/` between.
    pub name: String,
    /// What to say where it has another name than before.
    pub news: Option<String>,
}

/// A file as a recipe in `folder` may name it. One from elsewhere is copied there; with those that it needs into a folder of
/// their own, `needed` being seen from its folder. Where another file has its name it gets a number; one that holds the same
/// serves.
///
/// # Errors
/// [`Error::Read`] when it or the folder is not there, [`Error::Write`] when it cannot be copied.
pub fn lay_beside(path: &Path, needed: &[PathBuf], folder: &Path) -> Result<Laid> {
    let real = path.canonicalize().map_err(Error::read(path))?;
    let home = folder.canonicalize().map_err(Error::read(folder))?;
    if let Some(inside) = inside(path, &home).or_else(|| inside(&real, &home)) {
        let name = inside.to_string_lossy().replace('\\', "/");
        return Ok(Laid { name, news: None });
    }
    let own = name_of(path);
    let source = path.parent().unwrap_or(Path::new(""));
    let files: Vec<(PathBuf, PathBuf)> = std::iter::once(PathBuf::from(&own))
        .chain(needed.iter().cloned())
        .map(|file| (source.join(&file), file))
        .collect();
    let alone = needed.is_empty();
    let stem = path.file_stem().unwrap_or_default().to_string_lossy();
    let wanted = if alone { &own } else { &*stem };
    let at = |to: &Path, file: &Path| {
        if alone { to.to_owned() } else { to.join(file) }
    };
    let mut to = folder.join(wanted);
    // A link that leads out of the folder would not be read again.
    let is_inside = |path: &Path| {
        path.canonicalize()
            .is_ok_and(|real| real.starts_with(&home))
    };
    let there = |(from, file): &(PathBuf, PathBuf)| {
        let at = at(&to, file);
        is_inside(&at) && same(from, &at)
    };
    if to.exists() && !files.iter().all(there) {
        to = free_path(folder, wanted);
    }
    if !to.exists() {
        for (from, file) in &files {
            copy(from, &at(&to, file))?;
        }
    }
    let lies = at(&to, Path::new(&own));
    let name = lies.strip_prefix(folder).unwrap_or(&lies);
    let name = name.to_string_lossy().replace('\\', "/");
    let news =
        (name != own).then(|| format!("{} is kept beside the recipe as {name}", path.display()));
    Ok(Laid { name, news })
}

fn name_of(path: &Path) -> String {
    let name = path.file_name().unwrap_or_default();
    name.to_string_lossy().into_owned()
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

/// Whether two files hold the same.
fn same(one: &Path, other: &Path) -> bool {
    let length = |p: &Path| std::fs::metadata(p).ok().map(|m| m.len());
    length(one).is_some()
        && length(one) == length(other)
        && matches!((std::fs::read(one), std::fs::read(other)), (Ok(a), Ok(b)) if a == b)
}

fn copy(from: &Path, to: &Path) -> Result<()> {
    let (mut file, _) = open_regular(from)?;
    if let Some(folder) = to.parent() {
        std::fs::create_dir_all(folder).map_err(Error::write(folder))?;
    }
    write_atomic(to, |out| io::copy(&mut file, out).map(drop)).map(drop)
}
