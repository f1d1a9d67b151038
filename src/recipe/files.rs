//! The files that a recipe names: only from its own folder, unless the user says otherwise. A recipe may come from a
//! stranger, and must not make somebody's private picture part of a map that is passed on.

use super::{Layer, Mask, MaskSource, Recipe, Source, Stamp, unknown_word};
use crate::error::{Error, Result};
use crate::mesh::{self, Mesh, Projection};
use std::collections::BTreeMap;
use std::path::{Component, Path, PathBuf};

/// Where the files that a recipe names may lie.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Files {
    /// The recipe's own folder; without one it may name no files.
    pub folder: Option<PathBuf>,
    /// Whether files outside that folder are allowed.
    pub allow_outside: bool,
}

impl Files {
    /// The path of the file that the recipe calls `name` under `key`.
    ///
    /// # Errors
    /// [`Error::Invalid`] when there is no folder, the file lies outside it and that is not allowed, or it is not there.
    pub fn resolve(&self, key: &str, name: &str) -> Result<PathBuf> {
        let Some(folder) = &self.folder else {
            return Err(Error::invalid(
                key,
                format!("`{name}`"),
                "allowed: no files in a preset or a recipe that was never saved",
            ));
        };
        let path = folder.join(name);
        if self.allow_outside {
            return found(key, name, &path);
        }
        // Judged by its words first, so that nothing is learned about files outside from the message.
        if leaves_folder(name) {
            return Err(outside(key, name));
        }
        let real = found(key, name, &path)?;
        let folder = folder.canonicalize().map_err(Error::read(folder))?;
        if real.starts_with(folder) {
            Ok(real)
        } else {
            Err(outside(key, name)) // a link that leads out
        }
    }
}

impl Files {
    /// The mesh that the recipe calls `word` under `key`: a built-in one, or a file.
    ///
    /// # Errors
    /// For a word that is no shape, as [`Files::resolve`], and as [`mesh::load`].
    pub fn mesh(&self, key: &str, word: &str) -> Result<Mesh> {
        if is_path(word) {
            let (file, projection) = Projection::split(word);
            return mesh::load_with(&self.resolve(key, file)?, projection);
        }
        mesh::builtin(word).ok_or_else(|| unknown_word(key, word, &mesh::BUILTIN_NAMES))
    }
}

impl Files {
    /// Whether a file lies where the recipe may not name it: by its words, or because a link leads out.
    pub(crate) fn is_outside(&self, name: &str) -> bool {
        let leads_out = || {
            let folder = self.folder.as_ref()?;
            let real = folder.join(name).canonicalize().ok()?;
            Some(!real.starts_with(folder.canonicalize().ok()?))
        };
        !self.allow_outside && (leaves_folder(name) || leads_out().unwrap_or(false))
    }

    /// By what a file that the recipe names is known to be as it was, a `.gltf` with its buffers ([`mesh::buffers_of`]); `None`
    /// when it is not there, or may not be named.
    pub fn stamp(&self, name: &str) -> Option<Stamp> {
        let path = self.resolve("file", name).ok()?;
        let buffers = mesh::buffers_of(&path);
        let stamps = buffers.iter().filter_map(|path| Stamp::of(path));
        Some(stamps.fold(Stamp::of(&path)?, Stamp::with))
    }

    /// The same of the file that a word for a mesh means; `None` for a built-in one, too.
    pub fn stamp_of_mesh(&self, word: &str) -> Option<Stamp> {
        self.stamp(file_of_mesh(word)?)
    }
}

/// The real path of a file that is there.
fn found(key: &str, name: &str, path: &Path) -> Result<PathBuf> {
    path.canonicalize().map_err(|e| {
        let allowed = format!("allowed: a file that is there ({})", Error::read(path)(e));
        Error::invalid(key, format!("`{name}`"), allowed)
    })
}

/// The file that a word for a mesh means, without the projection that it is read with.
pub(crate) fn file_of_mesh(word: &str) -> Option<&str> {
    is_path(word).then(|| Projection::split(word).0)
}

/// Whether a word for a mesh means a file.
pub(crate) fn is_path(word: &str) -> bool {
    word.contains(['/', '\\', '.'])
}

/// Whether a name leads out of the folder by its words alone.
pub(crate) fn leaves_folder(name: &str) -> bool {
    let leaves = |c| !matches!(c, Component::Normal(_) | Component::CurDir);
    Path::new(name).components().any(leaves)
}

fn outside(key: &str, name: &str) -> Error {
    Error::invalid(
        key,
        format!("`{name}`"),
        "allowed: a file in the recipe's own folder or below it",
    )
    .with_hint("If you trust the recipe, pass --allow-outside")
}

/// What a recipe in `folder` calls a file: the way there, with `/` between, or the whole path where no way leads there.
///
/// # Errors
/// [`Error::Read`] when folder or file is not there; [`Error::File`] when the file's path is no Unicode.
pub fn seen_from(folder: &Path, file: &Path) -> Result<String> {
    let real = |path: &Path| path.canonicalize().map_err(Error::read(path));
    let (from, to) = (real(folder)?, real(file)?);
    let shared = from
        .components()
        .zip(to.components())
        .take_while(|(a, b)| a == b)
        .count();
    let way = if shared == 0 {
        to // on another drive
    } else {
        let up = from.components().skip(shared).map(|_| Component::ParentDir);
        up.chain(to.components().skip(shared)).collect()
    };
    let words: Option<Vec<&str>> = way.iter().map(|part| part.to_str()).collect();
    match words {
        Some(words) if shared > 0 => Ok(words.join("/")),
        Some(_) => Ok(way.to_string_lossy().into_owned()),
        None => Err(
            Error::file(file, "a recipe cannot name it: its path is no Unicode")
                .with_hint("Rename the file or its folders"),
        ),
    }
}

/// Gives every file that a layer names another name.
pub(crate) fn rename_files(layer: &mut Layer, mut rename: impl FnMut(&mut String)) {
    match &mut layer.source {
        Source::Image(image) => image.files_mut().for_each(&mut rename),
        Source::Stored(stored) => stored.files_mut().for_each(&mut rename),
        Source::Strokes(_) | Source::Pattern(_) | Source::Guides(_) => {}
    }
    for strokes in layer.all_strokes_mut() {
        rename_mesh(&mut strokes.mesh, &mut rename);
    }
}

/// Gives the file of a word for a mesh another name, unless it is a built-in one.
pub(crate) fn rename_mesh(mesh: &mut Option<String>, mut rename: impl FnMut(&mut String)) {
    if let Some(name) = mesh.as_mut().filter(|m| is_path(m)) {
        let (file, projection) = Projection::split(name);
        let mut file = file.to_owned();
        rename(&mut file);
        *name = Projection::join(&file, projection);
    }
}

/// The way of a recipe from one folder to another, on which the files that it names stay where they are.
#[derive(Clone, Debug)]
pub(crate) struct Way {
    from: PathBuf,
    to: PathBuf,
    /// Files that were copied on the way: where they were, and what they are called now.
    pub(crate) copied: BTreeMap<PathBuf, String>,
}

impl Way {
    /// The way between two folders; `None` where names stay as they are: both are the same, or there was none, so that
    /// nothing could be named.
    ///
    /// # Errors
    /// [`Error::Read`] when one of them is not there.
    pub(crate) fn between(from: Option<&Path>, to: &Path) -> Result<Option<Self>> {
        let real = |path: &Path| path.canonicalize().map_err(Error::read(path));
        let Some(from) = from else { return Ok(None) };
        let (from, to) = (real(from)?, real(to)?);
        let copied = BTreeMap::new();
        Ok((from != to).then_some(Self { from, to, copied }))
    }

    /// Renames every file that a recipe names. What is not there keeps its name.
    pub(crate) fn of_recipe(&self, recipe: &mut Recipe) {
        self.of_mesh(&mut recipe.mesh);
        for layer in &mut recipe.layers {
            self.of_layer(layer);
        }
    }

    /// Renames every file that a layer names.
    pub(crate) fn of_layer(&self, layer: &mut Layer) {
        rename_files(layer, |name| self.of_file(name));
    }

    /// Renames the mesh that a painted mask lies on.
    pub(crate) fn of_mask(&self, mask: &mut Mask) {
        if let MaskSource::Strokes(strokes) = &mut mask.source {
            self.of_mesh(&mut strokes.mesh);
        }
    }

    /// Renames a mesh, unless it is a built-in one.
    pub(crate) fn of_mesh(&self, mesh: &mut Option<String>) {
        rename_mesh(mesh, |name| self.of_file(name));
    }

    /// Where a file is that was named before the way.
    pub(crate) fn place_of(&self, name: &str) -> PathBuf {
        self.from.join(name)
    }

    fn of_file(&self, name: &mut String) {
        let before = self.place_of(name).canonicalize().ok();
        if let Some(copy) = before.and_then(|path| self.copied.get(&path)) {
            name.clone_from(copy);
        } else if let Ok(way) = seen_from(&self.to, &self.from.join(&*name)) {
            *name = way;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs;

    #[test]
    fn a_file_is_named_by_the_way_to_it() {
        let root = tempfile::tempdir().unwrap();
        let path = |name: &str| root.path().join(name);
        fs::create_dir_all(path("a/deep")).unwrap();
        fs::create_dir(path("b")).unwrap();
        fs::write(path("a/deep/x.exr"), "x").unwrap();
        for (folder, way) in [
            ("a", "deep/x.exr"),
            ("a/deep", "x.exr"),
            ("b", "../a/deep/x.exr"),
            ("b/../a", "deep/x.exr"),
        ] {
            assert_eq!(
                seen_from(&path(folder), &path("a/deep/x.exr")).unwrap(),
                way
            );
        }
        assert!(seen_from(&path("a"), &path("no.exr")).is_err());
    }

    #[test]
    fn files_stay_in_the_recipes_folder_unless_allowed() {
        let root = tempfile::tempdir().unwrap();
        let inside = root.path().join("in");
        fs::create_dir_all(inside.join("deep")).unwrap();
        fs::write(root.path().join("secret"), "x").unwrap();
        fs::write(inside.join("deep/a.exr"), "x").unwrap();
        let files = |allow_outside| Files {
            folder: Some(inside.clone()),
            allow_outside,
        };
        assert!(files(false).resolve("k", "deep/a.exr").is_ok());
        let absolute = root.path().join("secret");
        let absolute = absolute.to_str().unwrap();
        for name in [
            "../secret",
            "deep/../../secret",
            absolute,
            "../in/deep/a.exr",
        ] {
            let e = files(false).resolve("k", name).unwrap_err();
            assert!(e.to_string().contains("--allow-outside"), "{e}");
            assert!(files(true).resolve("k", name).is_ok(), "{name}");
        }
        let missing = files(false).resolve("k", "no.exr").unwrap_err();
        assert!(missing.to_string().contains("k is `no.exr`"), "{missing}");
        assert!(missing.to_string().contains("cannot read"), "{missing}");
        let unsaved = Files::default().resolve("k", "deep/a.exr").unwrap_err();
        assert!(unsaved.to_string().contains("preset"));
    }

    #[cfg(unix)]
    #[test]
    fn a_link_that_leads_out_is_outside() {
        let root = tempfile::tempdir().unwrap();
        let inside = root.path().join("in");
        fs::create_dir(&inside).unwrap();
        fs::write(root.path().join("secret"), "x").unwrap();
        std::os::unix::fs::symlink(root.path().join("secret"), inside.join("link")).unwrap();
        let files = Files {
            folder: Some(inside),
            allow_outside: false,
        };
        assert!(files.resolve("k", "link").is_err());
    }
}
