//! Edits as steps of the history: made, taken back, done again, and followed by what is shown.

use super::{Edit, Step, Studio, Touched};
use crate::error::Result;
use crate::generate::scene;

/// The layer that edits put in: it is the one to go on with.
fn inserted(edits: &[Edit]) -> Option<usize> {
    edits.iter().rev().find_map(|edit| match edit {
        Edit::InsertLayer { at, .. } => Some(*at),
        _ => None,
    })
}

impl Studio {
    /// Makes edits as one step of the history. Steps with the same `key` that follow each other, as those of a slider that is
    /// dragged, are one step until [`Studio::seal`].
    ///
    /// # Errors
    /// As [`Edit::apply`]; then nothing has changed.
    pub fn edit(&mut self, label: &str, edits: Vec<Edit>, key: Option<&str>) -> Result<()> {
        self.cancel_stroke();
        let (back, touched) = self.apply_all(edits)?;
        self.history
            .push(Step::new(label, back, key.map(str::to_owned)));
        self.follow(touched);
        Ok(())
    }

    /// Ends a run of steps with one key.
    pub fn seal(&mut self) {
        self.history.seal();
    }

    /// Takes the last step back; `false` when there is none.
    ///
    /// # Errors
    /// When the document is read-only.
    pub fn undo(&mut self) -> Result<bool> {
        self.cancel_stroke();
        let Some(step) = self.history.take_undo() else {
            return Ok(false);
        };
        let (back, touched) = self.apply_all(step.edits)?;
        self.history.push_redo(Step::new(step.label, back, None));
        self.follow(touched);
        Ok(true)
    }

    /// Takes the last step back for good: what a drag did that is called off. `false` when there is none.
    ///
    /// # Errors
    /// When the document is read-only.
    pub fn take_back(&mut self) -> Result<bool> {
        let was = self.undo()?;
        if was {
            self.history.take_redo();
        }
        Ok(was)
    }

    /// Does the last step again that was taken back; `false` when there is none.
    ///
    /// # Errors
    /// When the document is read-only.
    pub fn redo(&mut self) -> Result<bool> {
        self.cancel_stroke();
        let Some(step) = self.history.take_redo() else {
            return Ok(false);
        };
        let came = inserted(&step.edits);
        let had_mask = self.has_painted_mask();
        let (back, touched) = self.apply_all(step.edits)?;
        self.history.push_undo(Step::new(step.label, back, None));
        self.follow(touched);
        if let Some(at) = came {
            self.select(at);
        } else if !had_mask && self.has_painted_mask() {
            self.select_mask(true); // as when it was made
        }
        Ok(true)
    }

    /// Applies edits to the document and writes them to the journal; what takes them back is given in its own order.
    pub(super) fn apply_all(&mut self, edits: Vec<Edit>) -> Result<(Vec<Edit>, Vec<Touched>)> {
        let (mut back, mut touched) = (Vec::new(), Vec::new());
        let places = (self.selected, self.solo);
        for edit in edits {
            let selected = edit.place_after(self.selected);
            let solo = self.solo.and_then(|s| edit.place_after(s));
            let copy = self.keeper.is_writing().then(|| edit.clone());
            match self.document.apply(edit) {
                Ok((inverse, what)) => {
                    (self.selected, self.solo) = (selected.unwrap_or(self.selected), solo);
                    back.insert(0, inverse);
                    touched.push(what);
                    self.write_journal(copy.as_ref());
                }
                Err(error) => {
                    for edit in back {
                        let copy = edit.clone();
                        if self.document.apply(edit).is_ok() {
                            self.write_journal(Some(&copy));
                        }
                    }
                    (self.selected, self.solo) = places;
                    return Err(error);
                }
            }
        }
        Ok((back, touched))
    }

    fn write_journal(&mut self, edit: Option<&Edit>) {
        let failed = self.keeper.write(edit, &self.document);
        self.trouble.extend(failed);
    }

    pub(super) fn begin_journal(&mut self) {
        let failed = self.keeper.begin(&self.document).err();
        self.trouble.extend(failed);
    }

    /// Brings what is shown up to date with edits that were just made, or has it brought.
    pub(super) fn follow(&mut self, touched: Vec<Touched>) {
        let layers = self.recipe().layers.len();
        if touched.iter().any(|t| *t >= Touched::Map) {
            self.solo = self.solo.filter(|s| *s < layers);
        }
        self.selected = self.selected.min(layers.saturating_sub(1));
        self.on_mask &= self.has_painted_mask();
        for what in touched {
            match what {
                Touched::Nothing => {}
                Touched::Scene => self.follow_scene(),
                Touched::Strokes(layer, mask) => self.follow_strokes(layer, mask),
                Touched::Map => self.shown.revision = None,
                Touched::All => {
                    self.follow_scene();
                    self.shown.revision = None;
                }
            }
        }
        if self.shown.revision.is_none() {
            self.work();
        } else if self.job.is_none() {
            self.shown.revision = Some(self.document.revision());
        }
    }

    fn follow_scene(&mut self) {
        let material = self.recipe().material;
        let trouble = self.subject_mut().set_material(material).err();
        self.trouble.extend(trouble);
        let lit = scene(self.subject.mesh(), Some(self.document.recipe()));
        self.scene.lights = lit.lights;
        self.scene.exposure = lit.exposure;
        if self.shown.mesh.as_deref() != Some(self.mesh_name()) {
            self.shown.revision = None;
        }
    }
}
