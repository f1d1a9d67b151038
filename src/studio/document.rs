//! The recipe that is being worked on, its file, and whether the file says the same.

use super::journal::Base;
use super::welcome::WELCOME;
use super::{Edit, Touched};
use crate::error::{Error, Result};
use crate::export::laid::bring;
use crate::export::{real_path, write_atomic};
use crate::map::Size;
use crate::recipe::{BYTES_MAX, Files, PRESETS, Recipe, RecipeFile, Stamp, name_from};
use std::collections::BTreeMap;
use std::fs;
use std::io::Write;
use std::path::{Path, PathBuf};

/// A recipe and its file.
pub struct Document {
    /// The text as it was read or last saved, and its recipe.
    file: RecipeFile,
    recipe: Recipe,
    path: Option<PathBuf>,
    /// The file's own when it was read or last saved.
    stamp: Option<Stamp>,
    revision: u64,
    saved: u64,
    brought: Brought,
    /// Whether the recipe may name files outside its folder.
    allow_outside: bool,
}

impl Document {
    /// A document of a file, or of a recipe that has none yet: then `path` is `None`.
    pub fn new(file: RecipeFile, path: Option<PathBuf>) -> Self {
        Self {
            recipe: file.recipe().clone(),
            stamp: file.stamp(),
            file,
            path,
            revision: 0,
            saved: 0,
            brought: Brought::new(),
            allow_outside: false,
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
        Ok(Self {
            stamp: base.stamp,
            revision: base.unsaved,
            ..Self::new(file, base.path.clone())
        })
    }

    /// What a journal of this document starts from: the document as it is now.
    ///
    /// # Errors
    /// When the recipe cannot be written as text.
    pub fn base(&self) -> Result<Base> {
        // Whoever recovers it may do so from another folder.
        let absolute = |path: &PathBuf| std::path::absolute(path).unwrap_or(path.clone());
        Ok(Base {
            text: self.text()?,
            path: self.path.as_ref().map(absolute),
            title: self.title(),
            unsaved: self.revision - self.saved,
            stamp: self.stamp,
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
        self.file.files(self.allow_outside)
    }

    /// The files that the recipe names and may not, since they lie outside its folder; each once.
    pub(super) fn outside_files(&self) -> Vec<String> {
        outside(&self.recipe, &self.files())
    }

    /// What was allowed stands for the files that were told then: a recipe that names others outside has to be asked about anew.
    pub(super) fn allow_only_known(&mut self, recipe: &Recipe) {
        let files = self.file.files(false);
        let known = outside(&self.recipe, &files);
        if !outside(recipe, &files)
            .iter()
            .all(|name| known.contains(name))
        {
            self.allow_outside = false;
        }
    }

    /// Lets the recipe name files outside its folder from now on.
    pub(super) fn allow_outside(&mut self) {
        self.allow_outside = true;
    }

    /// The recipe as it is now, at another size, as what its files are made of.
    ///
    /// # Errors
    /// As [`RecipeFile::update`].
    pub fn at_size(&self, size: Size) -> Result<RecipeFile> {
        let mut file = self.file.understood();
        let mut recipe = Recipe {
            version: file.recipe().version,
            ..self.recipe.clone()
        };
        if size != recipe.size {
            recipe.aspect = Some(recipe.aspect_at(recipe.size));
            recipe.size = size;
        }
        if *file.recipe() != recipe {
            file.update(recipe)?;
        }
        Ok(file)
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

    /// Whether another program has changed its file since it was read or last saved: then saving would undo that. A file
    /// that is gone, or holds the same under a later time, is not changed.
    pub fn changed_on_disk(&self) -> bool {
        let Some(path) = &self.path else { return false };
        let now = Stamp::of(path);
        if now.is_none() || now == self.stamp {
            return false;
        }
        fs::read(path).is_ok_and(|bytes| bytes != self.file.to_toml().as_bytes())
    }

    /// Takes over its file as another program has made it, after the recipe became what that says: it is saved.
    pub(super) fn take_file(&mut self, file: RecipeFile) {
        self.stamp = file.stamp();
        self.file = file;
        self.saved = self.revision;
    }

    /// Writes it to a file, whole or not at all; that file is its own from now on. Files that it names are named by the way to
    /// them from there; those that a recipe of another folder may not name are copied beside it, over no other file. Where the path is a link, what it leads to is written.
    ///
    /// # Errors
    /// [`Error::Write`] when the folder or disk takes no file, [`Error::File`] when it is too long to be read again, and as
    /// [`RecipeFile::update`]. The document is as before.
    pub fn save(&mut self, path: &Path) -> Result<()> {
        self.save_within(BYTES_MAX, path, &[], &Brought::new())
    }

    /// As [`Document::save`]; files that are named elsewhere, as by what was undone, come along. What was copied before is not
    /// copied again.
    pub(super) fn save_with(
        &mut self,
        path: &Path,
        named: &[String],
        before: &Brought,
    ) -> Result<()> {
        self.save_within(BYTES_MAX, path, named, before)
    }

    /// Whether a path leads to the document's own file.
    pub fn is_its_file(&self, path: &Path) -> bool {
        let real = |path: &Path| path.canonicalize().ok();
        let own = self.path.as_deref();
        own == Some(path) || own.is_some_and(|own| real(own).is_some() && real(own) == real(path))
    }

    /// What the recipe is called once it is saved under a path. A name that came with a preset or the first scene, or was that
    /// of the file, follows the file: what is exported must not be taken for another's.
    pub(super) fn name_for(&self, path: &Path) -> String {
        let name = &self.recipe.name;
        let was = match &self.path {
            Some(own) => name_from(own),
            None => self.file.recipe().name.clone(),
        };
        if *name == was || name.is_empty() {
            name_from(path)
        } else {
            name.clone()
        }
    }

    /// What the recipe is described as once it is saved: what a preset or the first scene says of itself is not true of what
    /// was made of it.
    fn description(&self) -> String {
        let description = &self.recipe.description;
        let built_in = PRESETS.iter().any(|p| p.description() == *description);
        let is_new = self.path.is_none() && self.is_changed();
        if description == WELCOME || (is_new && built_in) {
            String::new()
        } else {
            description.clone()
        }
    }

    fn save_within(
        &mut self,
        bytes_max: u64,
        path: &Path,
        named: &[String],
        before: &Brought,
    ) -> Result<()> {
        if self.is_read_only() && self.is_its_file(path) {
            let problem = "it is of a newer version, and saving would lose what is not known here";
            return Err(Error::file(path, problem).with_hint("Save it under another name"));
        }
        let mut file = self.file.understood();
        let recipe = Recipe {
            version: file.recipe().version,
            name: self.name_for(path),
            description: self.description(),
            ..self.recipe.clone()
        };
        file.update(recipe)?;
        let folder = folder_of(path);
        let names = file.recipe().files();
        let names = names.chain(named.iter().map(String::as_str));
        let (way, copies) = bring(&self.files(), before, names, &folder, &[], &|| true)?;
        let brought = way.as_ref().map_or(Brought::new(), |w| w.copied.clone());
        let file = file.moved_by(way.as_ref(), &folder).saved_as(path);
        let text = file.to_toml();
        if text.len() as u64 > bytes_max {
            let problem = format!(
                "it would be {} bytes long, and could not be opened again; allowed: {bytes_max}",
                text.len()
            );
            return Err(Error::file(path, problem)
                .with_hint("Take strokes away, or put some layers into another recipe"));
        }
        write_atomic(&real_path(path), |to| to.write_all(text.as_bytes()))?;
        copies.keep();
        self.recipe = file.recipe().clone();
        self.file = file;
        self.path = Some(path.to_owned());
        self.stamp = Stamp::of(path);
        self.saved = self.revision;
        self.brought = brought;
        Ok(())
    }

    /// The files that were copied beside the recipe when it was last saved: where they are from, and what it calls them.
    pub fn brought(&self) -> &BTreeMap<PathBuf, String> {
        &self.brought
    }
}

/// Files that were copied, and what they are called since.
pub(super) type Brought = BTreeMap<PathBuf, String>;

/// The folder that a file lies in.
pub(super) fn folder_of(path: &Path) -> PathBuf {
    let parent = path.parent().filter(|p| !p.as_os_str().is_empty());
    parent.unwrap_or(Path::new(".")).to_owned()
}

/// The files that a recipe names and may not; each once.
fn outside(recipe: &Recipe, files: &Files) -> Vec<String> {
    let outside = recipe.files().filter(|name| files.is_outside(name));
    let mut names: Vec<String> = outside.map(str::to_owned).collect();
    names.sort_unstable();
    names.dedup();
    names
}

#[cfg(test)]
mod tests {
    use super::*;

    const TEXT: &str = "version = 1\nname = 'a' # mine\n";

    fn read(path: &Path) -> Document {
        Document::new(RecipeFile::read(path).unwrap(), Some(path.to_owned()))
    }

    fn change(document: &mut Document) {
        let recipe = Recipe {
            seed: document.recipe().seed + 1,
            ..document.recipe().clone()
        };
        let recipe = Box::new(recipe);
        document.apply(Edit::SetRecipe { recipe }).unwrap();
    }

    #[test]
    fn what_another_program_writes_is_seen() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.toml");
        fs::write(&path, TEXT).unwrap();
        let mut document = read(&path);
        assert!(!document.changed_on_disk());
        change(&mut document);
        assert!(!document.changed_on_disk());
        fs::write(&path, "version = 1\nname = 'b' # theirs\n").unwrap();
        assert!(document.changed_on_disk());
        // Written by both, it is the document's own.
        document.save(&path).unwrap();
        assert!(!document.changed_on_disk() && !document.is_changed());
        let text = fs::read(&path).unwrap();
        fs::write(&path, "version = 1\n").unwrap();
        assert!(document.changed_on_disk());
        fs::write(&path, text).unwrap();
        assert!(!document.changed_on_disk(), "it says the same");
        fs::remove_file(&path).unwrap();
        assert!(!document.changed_on_disk(), "nothing would be lost");
        assert!(
            !Document::new(RecipeFile::parse(TEXT, "a", None).unwrap(), None).changed_on_disk()
        );
    }

    #[test]
    fn a_journal_knows_the_file_that_its_document_had() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.toml");
        fs::write(&path, TEXT).unwrap();
        let mut document = read(&path);
        change(&mut document);
        let base = document.base().unwrap();
        let json = serde_json::to_string(&base).unwrap();
        let base: Base = serde_json::from_str(&json).unwrap();
        assert_eq!(base.unsaved, 1);
        let back = Document::from_base(&base).unwrap();
        assert!(back.is_changed() && !back.changed_on_disk());
        assert_eq!(back.recipe(), document.recipe());
        fs::write(&path, "version = 1\nname = 'newer'\n").unwrap();
        assert!(Document::from_base(&base).unwrap().changed_on_disk());
    }

    #[test]
    fn a_journal_tells_the_whole_path() {
        let file = RecipeFile::parse(TEXT, "a.toml", None).unwrap();
        let base = Document::new(file, Some("a.toml".into())).base().unwrap();
        assert!(base.path.unwrap().is_absolute());
    }

    #[cfg(unix)]
    #[test]
    fn saving_through_a_link_keeps_the_link_and_the_rights() {
        use std::os::unix::fs::PermissionsExt;
        let folder = tempfile::tempdir().unwrap();
        let (real, link) = (
            folder.path().join("deep/real.toml"),
            folder.path().join("link.toml"),
        );
        fs::create_dir(folder.path().join("deep")).unwrap();
        fs::write(&real, TEXT).unwrap();
        fs::set_permissions(&real, fs::Permissions::from_mode(0o600)).unwrap();
        std::os::unix::fs::symlink("deep/real.toml", &link).unwrap();
        let mut document = read(&link);
        change(&mut document);
        document.save(&link).unwrap();
        assert!(link.is_symlink());
        assert!(fs::read_to_string(&real).unwrap().contains("seed = 1"));
        let mode = fs::metadata(&real).unwrap().permissions().mode();
        assert_eq!(mode & 0o777, 0o600);
        assert!(!document.changed_on_disk());
    }

    #[test]
    fn what_could_not_be_opened_again_is_not_saved() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.toml");
        fs::write(&path, TEXT).unwrap();
        let mut document = read(&path);
        change(&mut document);
        let error = document
            .save_within(20, &path, &[], &Brought::new())
            .unwrap_err()
            .to_string();
        assert!(error.contains("allowed: 20"), "{error}");
        assert_eq!(fs::read_to_string(&path).unwrap(), TEXT);
        assert!(document.is_changed());
        document
            .save_within(1000, &path, &[], &Brought::new())
            .unwrap();
    }

    #[test]
    fn what_is_understood_of_a_newer_file_goes_under_another_name_only() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.toml");
        let newer = "version = 2\nglitter = 0.5\nseed = 7\n";
        fs::write(&path, newer).unwrap();
        let mut document = read(&path);
        assert!(document.is_read_only());
        let around = folder
            .path()
            .join("../")
            .join(folder.path().file_name().unwrap());
        for own in [path.clone(), around.join("a.toml")] {
            let error = document.save(&own).unwrap_err().to_string();
            assert!(error.contains("another name"), "{error}");
        }
        assert_eq!(fs::read_to_string(&path).unwrap(), newer);
        let copy = folder.path().join("b.toml");
        document.save(&copy).unwrap();
        assert!(!document.is_read_only() && document.ignored().is_empty());
        let back = read(&copy);
        assert_eq!((back.recipe().seed, back.recipe().version), (7, 1));
        assert_eq!(back.recipe().name, "b");
        change(&mut document);
        assert_eq!(fs::read_to_string(&path).unwrap(), newer);
    }

    #[test]
    fn a_name_that_nobody_chose_follows_the_file() {
        let folder = tempfile::tempdir().unwrap();
        let saved = |document: &mut Document, name: &str| {
            document.save(&folder.path().join(name)).unwrap();
            document.recipe().name.clone()
        };
        let preset = RecipeFile::parse(TEXT, "preset a", None).unwrap();
        let mut document = Document::new(preset, None);
        assert_eq!(saved(&mut document, "pot.toml"), "pot");
        assert_eq!(saved(&mut document, "pot.toml"), "pot");
        assert_eq!(saved(&mut document, "lid.toml"), "lid");
        let text = fs::read_to_string(folder.path().join("lid.toml")).unwrap();
        assert!(
            text.contains("name = 'lid' # mine") || text.contains("name = \"lid\" # mine"),
            "{text}"
        );
        // One that was chosen stays.
        let recipe = Recipe {
            name: "mine".to_owned(),
            ..document.recipe().clone()
        };
        let recipe = Box::new(recipe);
        document.apply(Edit::SetRecipe { recipe }).unwrap();
        assert_eq!(saved(&mut document, "other.toml"), "mine");
    }

    #[test]
    fn files_are_made_at_any_size_of_the_same_surface() {
        let text = "version = 1\nsize = [64, 32]\n";
        let document = Document::new(RecipeFile::parse(text, "a.toml", None).unwrap(), None);
        let small = document.at_size(Size::new(8, 8).unwrap()).unwrap();
        assert_eq!(small.recipe().aspect, Some(2.0));
        let same = document.at_size(document.recipe().size).unwrap();
        assert_eq!(same.to_toml(), text, "what generate reads");
    }
}
