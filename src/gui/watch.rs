//! Sees when another program changes the document's file. A thread looks once in a while, so that the window may sleep.

use super::work::{Now, Work};
use eframe::egui::Context;
use std::path::{Path, PathBuf};
use std::time::{Duration, SystemTime};

/// How often the file is looked at.
const PAUSE: Duration = Duration::from_millis(700);

/// By what a file's content is told from another.
type Stamp = Option<(SystemTime, u64)>;

/// Looks after one file, or none.
#[derive(Default)]
pub(crate) struct Watch {
    path: Option<PathBuf>,
    known: Stamp,
    work: Option<Work<Stamp>>,
}

impl Watch {
    /// Looks after this file from now on, as it is now.
    pub(crate) fn look_after(&mut self, path: Option<&Path>, ctx: &Context) {
        self.known = path.and_then(stamp);
        if self.path.as_deref() == path && self.work.is_some() {
            return;
        }
        self.path = path.map(Path::to_owned);
        self.work = self.path.clone().and_then(|path| {
            let mut seen = self.known;
            let watch = move |reins: &super::work::Reins, give: &dyn Fn(Stamp) -> bool| {
                while reins.go_on() {
                    std::thread::sleep(PAUSE);
                    let now = stamp(&path);
                    if now != seen {
                        seen = now;
                        if !give(now) {
                            return;
                        }
                    }
                }
            };
            Work::begin("watch", ctx, watch).ok() // unwatched, the file is as before
        });
    }

    /// Whether another program has changed the file since the last call.
    pub(crate) fn changed(&mut self) -> bool {
        let mut changed = false;
        while let Some(work) = &self.work {
            match work.now() {
                Now::Came(stamp) => {
                    // Its own saving is none; a file that is gone for a moment is being replaced.
                    changed |= stamp.is_some() && stamp != self.known;
                    self.known = stamp.or(self.known);
                }
                Now::Over => self.work = None,
                Now::Going => break,
            }
        }
        changed
    }
}

/// Looks after any number of files.
#[derive(Default)]
pub(crate) struct WatchAll {
    paths: Vec<PathBuf>,
    work: Option<Work<()>>,
}

impl WatchAll {
    /// Looks after these files from now on, as they are now.
    pub(crate) fn look_after(&mut self, paths: Vec<PathBuf>, ctx: &Context) {
        if paths == self.paths {
            return;
        }
        self.paths = paths.clone();
        self.work = None;
        if paths.is_empty() {
            return;
        }
        let look = move || -> Vec<Stamp> { paths.iter().map(|path| stamp(path)).collect() };
        let mut told = look();
        let watch = move |reins: &super::work::Reins, give: &dyn Fn(()) -> bool| {
            let mut before = told.clone();
            while reins.go_on() {
                std::thread::sleep(PAUSE);
                let now = look();
                // A file that is still being written waits for its end.
                if now == before && now != told {
                    told.clone_from(&now);
                    if !give(()) {
                        return;
                    }
                }
                before = now;
            }
        };
        self.work = Work::begin("watch files", ctx, watch).ok(); // unwatched, they are as before
    }

    /// Whether another program has changed one of them since the last call.
    pub(crate) fn changed(&mut self) -> bool {
        let mut changed = false;
        while let Some(work) = &self.work {
            match work.now() {
                Now::Came(()) => changed = true,
                Now::Over => self.work = None,
                Now::Going => break,
            }
        }
        changed
    }
}

fn stamp(path: &Path) -> Stamp {
    let about = std::fs::metadata(path).ok()?;
    Some((about.modified().ok()?, about.len()))
}
