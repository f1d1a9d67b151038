//! The recipe that is being worked on, its file, and whether the file says the same.

use super::journal::Base;
use super::{Edit, Touched};
use crate::error::{Error, Result};
use crate::export::write_atomic;
use crate::recipe::{Files, Recipe, RecipeFile};
use std::io::Write;
use std::path::{Path, PathBuf};

/// A recipe and its file.
pub struct Document {
    /// The text as it was read or last saved, and its recipe.
    file: RecipeFile,
    recipe: Recipe,
    path: Option<PathBuf>,
    revision: u64,
    saved: u64,
}

impl Document {
    /// A document of a file, or of a recipe that has none yet: then `path` is `None`.
    pub fn new(file: RecipeFile, path: Option<PathBuf>) -> Self {
        Self {
            recipe: file.recipe().clone(),
            file,
            path,
            revision: 0,
            saved: 0,
        }
    }

    /// The document that a journal starts from.
    ///
    /// # Errors
    /// When the text cannot be read as a recipe.
    pub fn from_base(base: &Base) -> Result<Self> {
        let name = base
            .path
            .clone()
            .unwrap_or_else(|| base.title.clone().into());
        let folder = base.path.as_deref().map(folder_of);
        let file = RecipeFile::parse(&base.text, name, folder)?;
        Ok(Self::new(file, base.path.clone()))
    }

    /// What a journal of this document starts from: the document as it is now.
    ///
    /// # Errors
    /// When the recipe cannot be written as text.
    pub fn base(&self) -> Result<Base> {
        Ok(Base {
            text: self.text()?,
            path: self.path.clone(),
            title: self.title(),
        })
    }

    /// The recipe as it is now.
    pub fn recipe(&self) -> &Recipe {
        &self.recipe
    }

    /// Where its file is; `None` when it has none yet.
    pub fn path(&self) -> Option<&Path> {
        self.path.as_deref()
    }

    /// What it is called: its file's name, or the recipe's.
    pub fn title(&self) -> String {
        let file = self.path.as_deref().and_then(Path::file_name);
        match file {
            Some(name) => name.to_string_lossy().into_owned(),
            None => self.recipe.name.clone(),
        }
    }

    /// Whether there is work in it that its file does not have.
    pub fn is_changed(&self) -> bool {
        self.revision != self.saved
    }

    /// Counts changes: the same number, the same recipe.
    pub fn revision(&self) -> u64 {
        self.revision
    }

    /// Whether its file is of a newer version, and may be looked at only.
    pub fn is_read_only(&self) -> bool {
        self.file.is_read_only()
    }

    /// The keys of a newer file that this version does not know.
    pub fn ignored(&self) -> &[String] {
        self.file.ignored()
    }

    /// Where the recipe's own files are looked for.
    pub fn files(&self) -> Files {
        self.file.files(false)
    }

    /// Applies an edit; gives what takes it back.
    ///
    /// # Errors
    /// As [`Edit::apply`], and when the document is read-only.
    pub fn apply(&mut self, edit: Edit) -> Result<(Edit, Touched)> {
        if self.is_read_only() {
            let problem = "the file is of a newer version and can only be looked at here";
            return Err(Error::file(self.file.path(), problem)
                .with_hint("Open it with the version it was made with"));
        }
        let done = edit.apply(&mut self.recipe)?;
        self.revision += 1;
        Ok(done)
    }

    /// Its text, with every comment of the file it came from.
    ///
    /// # Errors
    /// As [`RecipeFile::update`].
    pub fn text(&self) -> Result<String> {
        let mut file = self.file.clone();
        if file.recipe() != &self.recipe {
            file.update(self.recipe.clone())?;
        }
        Ok(file.to_toml())
    }

    /// Writes it to a file, whole or not at all; that file is its own from now on. Files that it names are named by the way to
    /// them from there.
    ///
    /// # Errors
    /// [`Error::Write`] when the folder or disk takes no file, and as [`RecipeFile::update`]. The document is as before.
    pub fn save(&mut self, path: &Path) -> Result<()> {
        let mut file = self.file.clone();
        file.update(self.recipe.clone())?;
        let file = file.moved(&folder_of(path))?.saved_as(path);
        let text = file.to_toml();
        write_atomic(path, |to| to.write_all(text.as_bytes()))?;
        self.recipe = file.recipe().clone();
        self.file = file;
        self.path = Some(path.to_owned());
        self.saved = self.revision;
        Ok(())
    }
}

/// The folder that a file lies in.
fn folder_of(path: &Path) -> PathBuf {
    let parent = path.parent().filter(|p| !p.as_os_str().is_empty());
    parent.unwrap_or(Path::new(".")).to_owned()
}
