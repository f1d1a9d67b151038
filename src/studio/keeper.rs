//! Keeps the work that is not saved in a journal, and begins another when one cannot go on. No journal is removed before its
//! work is in another one or in the document's file, or is not wanted.

use super::journal::{Held, Journal};
use super::{Document, Edit};
use crate::error::{Error, Result};
use std::path::PathBuf;
use std::time::{Duration, Instant};

/// After a journal that could not be begun the next is tried when this many times as long has passed as it took: a full disk
/// may cost a twentieth of the time, and no more.
const PAUSE: u32 = 20;

/// The journal of a document, and what was left of those before.
pub(super) struct Keeper {
    /// Where journals are; `None` keeps none.
    folder: Option<PathBuf>,
    journal: Option<Journal>,
    /// Journals whose work is all in the document, but in no other journal.
    old: Vec<Held>,
    /// A journal that could be recovered in part only: the rest is in it alone.
    rest: Option<Held>,
    retry: Option<Instant>,
}

impl Keeper {
    /// A keeper that has not begun.
    pub(super) fn new(folder: Option<PathBuf>) -> Self {
        Self {
            folder,
            journal: None,
            old: Vec::new(),
            rest: None,
            retry: None,
        }
    }

    /// Begins a journal of the document as it is now, in the place of every other.
    ///
    /// # Errors
    /// When it cannot be begun. What was kept until now is kept on, and [`Keeper::write`] tries again.
    pub(super) fn begin(&mut self, document: &Document) -> Result<()> {
        let Some(folder) = &self.folder else {
            return Ok(());
        };
        let start = Instant::now();
        let begun = document
            .base()
            .and_then(|base| Journal::begin(folder, &base));
        let before = self.journal.take().map(Journal::into_held);
        self.old.extend(before);
        match begun {
            Ok(journal) => {
                self.journal = Some(journal);
                self.old.drain(..).for_each(Held::remove);
                Ok(())
            }
            Err(error) => {
                self.retry =
                    Some(Instant::now() + (start.elapsed() * PAUSE).max(Duration::from_millis(1)));
                let lost = "what is not saved would be lost in a crash: no journal can be written";
                Err(Error::machine(lost)(error)
                    .with_hint("Make room on that disk, or save the work"))
            }
        }
    }

    /// Whether a journal is being written, so that [`Keeper::write`] wants a copy of every edit.
    pub(super) fn is_writing(&self) -> bool {
        self.journal.is_some()
    }

    /// Writes an edit that was just made to the document, or where that fails all of it; gives what went wrong the first time
    /// that it does.
    pub(super) fn write(&mut self, edit: Option<&Edit>, document: &Document) -> Option<Error> {
        if let (Some(journal), Some(edit)) = (&mut self.journal, edit)
            && journal.write(edit).is_ok()
        {
            return None;
        }
        let was_writing = self.is_writing();
        if !was_writing && self.retry.is_some_and(|then| Instant::now() < then) {
            return None;
        }
        // Edits after a gap could not be recovered: anew, from the document as it is.
        self.begin(document).err().filter(|_| was_writing)
    }

    /// Keeps the journal that the document was recovered from: until the work is in another, or where that is not all of it,
    /// until the user has saved or closed.
    pub(super) fn take_up(&mut self, journal: Held, is_whole: bool) {
        if is_whole {
            self.old.push(journal);
        } else {
            self.rest = Some(journal);
        }
    }

    /// Ends: what was kept is saved, or not wanted.
    pub(super) fn end(&mut self) {
        let journal = self.journal.take().map(Journal::into_held);
        let all = journal.into_iter().chain(self.old.drain(..));
        all.chain(self.rest.take()).for_each(Held::remove);
    }
}

#[cfg(test)]
mod tests {
    use super::super::{LeftBehind, Touched, left_behind};
    use super::*;
    use crate::recipe::RecipeFile;
    use std::fs;
    use std::path::Path;

    fn document() -> Document {
        let text = "version = 1\n[[layers]]\n[layers.constant]\n";
        Document::new(RecipeFile::parse(text, "t.toml", None).unwrap(), None)
    }

    /// Another opacity, written as a studio does.
    fn change(keeper: &mut Keeper, document: &mut Document, opacity: f32) -> Option<Error> {
        let head = super::super::LayerHead {
            opacity,
            ..super::super::LayerHead::of(&document.recipe().layers[0])
        };
        let edit = Edit::SetHead {
            at: 0,
            head: Box::new(head),
        };
        let copy = keeper.is_writing().then(|| edit.clone());
        assert_eq!(document.apply(edit).unwrap().1, Touched::Map);
        keeper.write(copy.as_ref(), document)
    }

    #[track_caller]
    fn only_one(folder: &Path) -> LeftBehind {
        let (mut found, errors) = left_behind(folder);
        assert!(errors.is_empty(), "{errors:?}");
        assert_eq!(found.len(), 1);
        found.remove(0)
    }

    /// The document that a journal gives.
    fn read_back(left: LeftBehind) -> Document {
        let (base, edits, _) = left.take_apart();
        let mut document = Document::from_base(&base).unwrap();
        for edit in edits {
            document.apply(edit).unwrap();
        }
        document
    }

    #[cfg(target_os = "linux")]
    #[test]
    fn a_disk_that_fills_is_told_once_and_used_again_when_there_is_room() {
        let root = tempfile::tempdir().unwrap();
        let folder = root.path().join("recovery");
        let (mut document, mut keeper) = (document(), Keeper::new(Some(folder.clone())));
        keeper.begin(&document).unwrap();
        assert!(change(&mut keeper, &mut document, 0.9).is_none());
        // From now on no journal takes a byte, and none can be begun.
        keeper.journal.as_mut().unwrap().fill_disk();
        let aside = root.path().join("aside");
        fs::rename(&folder, &aside).unwrap();
        fs::write(&folder, "").unwrap();
        let told = change(&mut keeper, &mut document, 0.8).unwrap();
        assert_eq!(told.exit_code(), 3);
        assert!(told.to_string().contains("save the work"), "{told}");
        for opacity in [0.7, 0.6] {
            std::thread::sleep(Duration::from_millis(20));
            assert!(change(&mut keeper, &mut document, opacity).is_none());
        }
        assert!(!keeper.is_writing());
        // What was written before is neither removed nor offered.
        assert_eq!(fs::read_dir(&aside).unwrap().count(), 1);
        assert!(left_behind(&aside).0.is_empty());
        fs::remove_file(&folder).unwrap();
        fs::rename(&aside, &folder).unwrap();
        let mut opacity = 0.6;
        while !keeper.is_writing() {
            opacity *= 0.999;
            assert!(change(&mut keeper, &mut document, opacity).is_none());
        }
        assert!(change(&mut keeper, &mut document, 0.5).is_none());
        assert_eq!(
            fs::read_dir(&folder).unwrap().count(),
            1,
            "the old one went"
        );
        drop(keeper);
        assert_eq!(read_back(only_one(&folder)).recipe(), document.recipe());
    }

    #[test]
    fn a_journal_begun_over_unsaved_work_is_offered_without_an_edit() {
        let folder = tempfile::tempdir().unwrap();
        let (mut document, mut keeper) = (document(), Keeper::new(Some(folder.path().to_owned())));
        keeper.begin(&document).unwrap();
        assert!(change(&mut keeper, &mut document, 0.9).is_none());
        keeper.begin(&document).unwrap();
        drop(keeper);
        let left = only_one(folder.path());
        assert_eq!((left.edits.len(), left.changes()), (0, 1));
        let back = read_back(left);
        assert!(back.is_changed());
        assert_eq!(back.recipe(), document.recipe());
    }

    #[cfg(unix)]
    #[test]
    fn a_journal_that_was_removed_is_begun_again() {
        let folder = tempfile::tempdir().unwrap();
        let (mut document, mut keeper) = (document(), Keeper::new(Some(folder.path().to_owned())));
        keeper.begin(&document).unwrap();
        fs::remove_file(keeper.journal.as_ref().unwrap().path()).unwrap();
        assert!(change(&mut keeper, &mut document, 0.9).is_none());
        drop(keeper);
        assert_eq!(only_one(folder.path()).changes(), 1);
    }

    #[test]
    fn what_ends_leaves_nothing() {
        let folder = tempfile::tempdir().unwrap();
        let mut document = document();
        let mut keeper = Keeper::new(Some(folder.path().to_owned()));
        keeper.begin(&document).unwrap();
        change(&mut keeper, &mut document, 0.9);
        drop(keeper);
        for is_whole in [false, true] {
            let left = only_one(folder.path());
            let mut keeper = Keeper::new(Some(folder.path().to_owned()));
            keeper.take_up(left.take_apart().2, is_whole);
            keeper.begin(&document).unwrap();
            let there = fs::read_dir(folder.path()).unwrap().count();
            assert_eq!(there, if is_whole { 1 } else { 2 });
            if is_whole {
                keeper.end();
                assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 0);
            } else {
                keeper.journal.take().unwrap().end();
            }
        }
    }
}
