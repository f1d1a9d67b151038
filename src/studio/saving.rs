//! The document and its file: saved, read again, recovered from a journal.

use super::document::{Brought, folder_of};
use super::{Document, Edit, History, LeftBehind, Options, Step, Studio};
use crate::error::{Error, Result};
use crate::export::laid::{Copies, bring};
use crate::mesh;
use crate::recipe::{Files, RecipeFile, Way};
use std::path::{Path, PathBuf};

impl Studio {
    /// The work of a journal that was left behind, as a document with unsaved changes; how many there are is given too. Edits
    /// that no longer apply end what is recovered: the journal is then kept until the document is saved or closed.
    ///
    /// # Errors
    /// When the document that the journal starts from cannot be read. The journal is kept.
    pub fn recover(left: LeftBehind, options: Options) -> Result<(Self, u64)> {
        let (base, edits, journal) = left.take_apart();
        let mut document = Document::from_base(&base)?;
        let mut history = History::new(options.undo_bytes);
        let mut failed = None;
        for edit in edits {
            match document.apply(edit) {
                Ok((back, _)) => history.push(Step::new("Recovered work", vec![back], None)),
                Err(error) => {
                    failed = Some(error);
                    break;
                }
            }
        }
        let recovered = document.revision();
        let mut studio = Self::at_rest(document, options)?;
        studio.history = history;
        studio.keeper.take_up(journal, failed.is_none());
        studio.trouble.extend(failed);
        studio.begin_journal();
        studio.work();
        Ok((studio, recovered))
    }

    /// Saves to a file, which is the document's own from now on. Files that the recipe names, now or after an undo, are named
    /// by the way to them from there.
    ///
    /// # Errors
    /// As [`Document::save`]; the work is kept.
    pub fn save(&mut self, path: &Path) -> Result<()> {
        self.save_after(path, None)
    }

    /// What has to be copied before the document can be saved to a file, which may take a while: for a thread of its own. `None`
    /// where nothing has to be.
    pub fn copies_for(&mut self, path: &Path) -> Option<CopyOrder> {
        let files = self.document.files();
        let to = folder_of(path);
        let mut named = self.named_in_history();
        named.extend(self.recipe().files().map(str::to_owned));
        let is_elsewhere = matches!(Way::between(files.folder.as_deref(), &to), Ok(Some(_)));
        (is_elsewhere && !named.is_empty()).then_some(CopyOrder { files, named, to })
    }

    /// The files that steps of the history name, which an undo brings back.
    fn named_in_history(&mut self) -> Vec<String> {
        let edits = self.history.edits_mut();
        let of =
            |e: &mut Edit| -> Vec<String> { e.files().into_iter().map(str::to_owned).collect() };
        edits.flat_map(of).collect()
    }

    /// As [`Studio::save`], after what it needs was copied; that goes again when the saving fails.
    ///
    /// # Errors
    /// As [`Studio::save`].
    pub fn save_after(&mut self, path: &Path, copied: Option<Copied>) -> Result<()> {
        let from = self.document.files().folder;
        let is_shown = self.shown.mesh.as_deref() == Some(self.mesh_name());
        let name = self.recipe().name.clone();
        let named = self.named_in_history();
        let (before, copies) = copied.map_or_else(Default::default, |c| (c.names, c.copies));
        self.document.save_with(path, &named, &before)?;
        copies.keep();
        let renamed = self.document.recipe().name.clone();
        let edits = self.history.edits_mut();
        edits.for_each(|edit| edit.rename(&name, &renamed));
        let to = self.document.files().folder;
        if let Some(mut way) = Way::between(from.as_deref(), &to.unwrap_or_default())? {
            way.copied = self.document.brought().clone();
            self.history.edits_mut().for_each(|edit| edit.follow(&way));
            // The mesh that is shown may be called otherwise now.
            if is_shown {
                self.shown.mesh = Some(self.mesh_name().to_owned());
                self.shown.stamp = self.document.files().stamp_of_mesh(self.mesh_name());
            }
            self.work();
        }
        self.keeper.end();
        self.begin_journal();
        Ok(())
    }

    /// Shows what other programs made of the files that the recipe names; nothing where all are as they were.
    pub fn read_files_again(&mut self) {
        self.work();
    }

    /// Where the files are that the recipe names and may: those that other programs may write anew.
    pub fn files_to_watch(&self) -> Vec<PathBuf> {
        let files = self.document.files();
        let Some(folder) = &files.folder else {
            return Vec::new();
        };
        let names = self.recipe().files();
        let allowed = names.filter(|name| !files.is_outside(name));
        let mut paths: Vec<PathBuf> = allowed.map(|name| folder.join(name)).collect();
        // Whether they are there or not: they may yet be laid there.
        let buffers: Vec<PathBuf> = paths.iter().flat_map(|p| mesh::buffers_of(p)).collect();
        paths.extend(buffers);
        paths.sort_unstable();
        paths.dedup();
        paths
    }

    /// Whether this is what was told of a layer or the mesh that is not shown, and still is so.
    pub fn is_still_told(&self, text: &str) -> bool {
        self.told.iter().any(|told| told == text)
    }

    /// The files that the recipe names and may not, since they lie outside its folder: see [`Studio::allow_outside`].
    pub fn outside_files(&self) -> Vec<String> {
        self.document.outside_files()
    }

    /// Lets this document's recipe name files outside its folder.
    pub fn allow_outside(&mut self) {
        self.document.allow_outside();
        self.work();
    }

    /// Takes over the document's file as another program has made it, as one step of the history: work that the file does not
    /// have is one undo away. The document is then saved. `false`, and nothing done, while a stroke is in flight: try again
    /// when the pen is lifted.
    ///
    /// # Errors
    /// When the file is of a newer version, or the document is.
    pub fn reload(&mut self, file: RecipeFile) -> Result<bool> {
        if self.is_drawing() {
            return Ok(false);
        }
        if file.is_read_only() {
            let ignored = match file.ignored() {
                [] => String::new(),
                keys => format!("; not known here: {}", keys.join(", ")),
            };
            let problem = format!("another program made it a file of a newer version{ignored}");
            return Err(Error::file(file.path(), problem)
                .with_hint("Your work is as it was; save it under another name"));
        }
        self.document.allow_only_known(file.recipe());
        if file.recipe() != self.recipe() {
            let recipe = Box::new(file.recipe().clone());
            self.edit("Read again", vec![Edit::SetRecipe { recipe }], None)?;
        }
        self.document.take_file(file);
        self.begin_journal();
        Ok(true)
    }
}

/// What has to be copied before a document is saved elsewhere; see [`Studio::copies_for`].
pub struct CopyOrder {
    files: Files,
    named: Vec<String>,
    to: PathBuf,
}

/// What was copied. Dropped, it goes again.
#[derive(Debug, Default)]
pub struct Copied {
    names: Brought,
    copies: Copies,
}

impl CopyOrder {
    /// Copies it, as long as it is wanted.
    ///
    /// # Errors
    /// When a file cannot be read or copied, and [`Error::Cancelled`]; nothing is left of it then.
    pub fn carry_out(self, wanted: &dyn Fn() -> bool) -> Result<Copied> {
        let (none, names) = (Brought::new(), self.named.iter().map(String::as_str));
        let (way, copies) = bring(&self.files, &none, names, &self.to, &[], wanted)?;
        let names = way.map_or(none, |way| way.copied);
        Ok(Copied { names, copies })
    }
}
