//! What can be taken back, as far as memory allows, and what can be done again.

use super::Edit;
use std::collections::VecDeque;

/// One step: edits that were made together.
#[derive(Clone, Debug)]
pub struct Step {
    /// What the user did, and to what: `Groove stroke: paint`, `Opacity: brushed`.
    pub label: String,
    /// What takes it back (or does it again), in the order in which it is applied.
    pub edits: Vec<Edit>,
    /// Steps that follow each other with the same key, as those of a slider that is dragged, become one.
    key: Option<String>,
    bytes: usize,
}

impl Step {
    /// A step.
    pub fn new(label: impl Into<String>, edits: Vec<Edit>, key: Option<String>) -> Self {
        let bytes = edits.iter().map(Edit::bytes).sum::<usize>() + 128;
        Self {
            label: label.into(),
            edits,
            key,
            bytes,
        }
    }
}

/// The steps before and after now.
#[derive(Debug)]
pub struct History {
    undo: VecDeque<Step>,
    redo: Vec<Step>,
    bytes: usize,
    /// The most bytes that steps may hold before the oldest is forgotten.
    budget: usize,
    /// Whether steps were forgotten: what is taken back by all that are left is not the document as it was opened.
    forgot: bool,
}

impl History {
    /// An empty history that holds about `budget` bytes.
    pub fn new(budget: usize) -> Self {
        Self {
            undo: VecDeque::new(),
            redo: Vec::new(),
            bytes: 0,
            budget,
            forgot: false,
        }
    }

    /// Takes another budget; forgets what is over it.
    pub fn set_budget(&mut self, budget: usize) {
        self.budget = budget;
        self.forget();
    }

    /// Remembers what takes a new step back. What had been taken back before is gone.
    pub fn push(&mut self, step: Step) {
        self.redo.clear();
        match self.undo.back() {
            // What takes the first of them back takes all back.
            Some(last) if last.key.is_some() && last.key == step.key => {}
            _ => self.remember(step),
        }
    }

    /// Ends a run of steps with one key: the next is a step of its own.
    pub fn seal(&mut self) {
        if let Some(last) = self.undo.back_mut() {
            last.key = None;
        }
    }

    /// The step to take back next.
    pub fn take_undo(&mut self) -> Option<Step> {
        let step = self.undo.pop_back()?;
        self.bytes -= step.bytes;
        Some(step)
    }

    /// The step to do again next.
    pub fn take_redo(&mut self) -> Option<Step> {
        self.redo.pop()
    }

    /// Remembers what does a step again that was taken back.
    pub fn push_redo(&mut self, step: Step) {
        self.redo.push(step);
    }

    /// Remembers what takes a step back that was done again.
    pub fn push_undo(&mut self, step: Step) {
        self.remember(step);
    }

    /// Every edit that is remembered, to be changed where that changes nothing but names.
    pub(super) fn edits_mut(&mut self) -> impl Iterator<Item = &mut Edit> {
        let steps = self.undo.iter_mut().chain(&mut self.redo);
        steps.flat_map(|step| &mut step.edits)
    }

    /// The labels of what was done, the oldest first, and of what was taken back, the next to be done again first.
    pub fn labels(&self) -> (impl Iterator<Item = &str>, impl Iterator<Item = &str>) {
        (
            self.undo.iter().map(|s| s.label.as_str()),
            self.redo.iter().rev().map(|s| s.label.as_str()),
        )
    }

    /// How many steps can be taken back and done again.
    pub fn len(&self) -> (usize, usize) {
        (self.undo.len(), self.redo.len())
    }

    /// Whether every step since the beginning can be taken back: none was forgotten for want of memory.
    pub fn is_whole(&self) -> bool {
        !self.forgot
    }

    /// Bytes that it holds, about.
    pub fn bytes(&self) -> usize {
        self.bytes
    }

    fn remember(&mut self, step: Step) {
        self.bytes += step.bytes;
        self.undo.push_back(step);
        self.forget();
    }

    fn forget(&mut self) {
        while self.bytes > self.budget && self.undo.len() > 1 {
            if let Some(oldest) = self.undo.pop_front() {
                self.bytes -= oldest.bytes;
                self.forgot = true;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn step(label: &str, key: Option<&str>) -> Step {
        let edits = vec![Edit::RemoveLayer { at: 0 }];
        Step::new(label, edits, key.map(str::to_owned))
    }

    #[test]
    fn steps_with_one_key_become_one_until_they_are_sealed() {
        let mut history = History::new(1 << 20);
        history.push(step("drag", Some("opacity 0")));
        history.push(step("drag", Some("opacity 0")));
        assert_eq!(history.len(), (1, 0));
        history.seal();
        history.push(step("drag", Some("opacity 0")));
        history.push(step("other", None));
        history.push(step("other", None));
        assert_eq!(history.len(), (4, 0));
    }

    #[test]
    fn the_oldest_are_forgotten_when_memory_runs_out_but_never_the_last() {
        let mut history = History::new(3 * step("a", None).bytes);
        for label in ["a", "b", "c", "d"] {
            history.push(step(label, None));
        }
        let labels: Vec<_> = history.labels().0.map(str::to_owned).collect();
        assert_eq!(labels, ["b", "c", "d"]);
        assert!(!history.is_whole());
        history.set_budget(0);
        assert_eq!(history.len(), (1, 0));
    }

    #[test]
    fn a_new_step_ends_what_could_be_done_again() {
        let mut history = History::new(1 << 20);
        history.push(step("a", None));
        let taken = history.take_undo().unwrap();
        history.push_redo(taken);
        assert_eq!(history.len(), (0, 1));
        history.push(step("b", None));
        assert_eq!(history.len(), (1, 0));
    }
}
