//! `anisomap batch`: many maps from one manifest.
//!
//! Items are spread over worker threads, each with its own share of the cores, rather than over one pool: a pool whose
//! threads wait for a map's bands would begin further maps meanwhile, and hold more of them in memory than there are jobs.

mod manifest;

use super::args::BatchArgs;
use super::{Outcome, Result, console, input};
use anisomap::Error;
use anisomap::export::Written;
use anisomap::export::exr::Precision;
use anisomap::export::png::{Depth, write_readme};
use anisomap::generate::{Job, depths, formats, make_folder};
use anisomap::map::Mended;
use anisomap::recipe::Target;
use indicatif::ProgressBar;
use manifest::{Item, Manifest};
use serde::Serialize;
use serde_json::json;
use std::collections::HashSet;
use std::num::NonZero;
use std::path::Path;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Mutex, PoisonError};
use std::thread;
use std::time::Instant;

/// What a job writes when neither it nor the recipe says.
const FORMATS: [Target; 1] = [Target::Exr];

/// An item that came to nothing.
#[derive(Clone, Serialize)]
struct Failure {
    name: String,
    reason: String,
}

/// An item that was made.
#[derive(Clone, Serialize)]
struct Success {
    name: String,
    files: usize,
    bytes: u64,
    mended: Mended,
    /// The PNG sets among its files.
    #[serde(skip)]
    depths: Vec<Depth>,
}

pub(super) fn run(args: BatchArgs) -> Result {
    console::catch_interrupts();
    console::hide_bars();
    let started = Instant::now();
    let manifest = Manifest::read(&args.manifest, args.limit)?;
    let items = manifest.items();
    make_folder(&args.output)?;
    let results = make_all(&items, &args)?;
    let (mut made, mut failures) = (Vec::new(), Vec::new());
    for result in results.into_iter().flatten() {
        match result {
            Ok(success) => made.push(success),
            Err(failure) => failures.push(failure),
        }
    }
    let depths: Vec<Depth> = made.iter().flat_map(|s| s.depths.clone()).collect();
    let readme = if depths.is_empty() {
        None
    } else {
        Some(write_readme(&args.output, &depths)?)
    };
    let summary = Summary {
        asked: items.len(),
        readme,
        made,
        failures,
        seconds: started.elapsed().as_secs_f64(),
    };
    let mended = summary.made.iter().map(|s| s.mended);
    if let Some(note) = input::mended_note(mended.fold(Mended::default(), Mended::plus)) {
        console::complain(&note);
    }
    summary.print(args.json)?;
    console::check_cancelled()?;
    Ok(if summary.failures.is_empty() {
        Outcome::Fine
    } else {
        Outcome::Wrong
    })
}

type Results = Vec<Option<Result<Success, Failure>>>;

/// Makes every item, in the manifest's order as far as threads allow; the results stand in that order. An item that was not
/// begun when the user cancelled has none.
fn make_all(items: &[Item], args: &BatchArgs) -> Result<Results> {
    let cores = thread::available_parallelism().map_or(1, NonZero::get);
    let jobs = args
        .jobs
        .map_or(cores, usize::from)
        .clamp(1, items.len().max(1));
    let bar = console::bar("making");
    bar.set_length(items.len() as u64);
    let (next, told) = (AtomicUsize::new(0), Mutex::default());
    let results: Mutex<Results> = Mutex::new(vec![None; items.len()]);
    let pools = (0..jobs)
        .map(|_| {
            rayon::ThreadPoolBuilder::new()
                .num_threads((cores / jobs).max(1))
                .build()
        })
        .collect::<Result<Vec<_>, _>>()
        .map_err(Error::machine("no thread can be started"))?;
    thread::scope(|scope| {
        for pool in &pools {
            scope.spawn(|| {
                while let Some((i, item)) = take(&next, items) {
                    let result = pool.install(|| make(item, args));
                    if matches!(&result, Err(None)) {
                        break; // cancelled
                    }
                    let result = result.map_err(|f| f.expect("no failure means cancelled"));
                    tell(&bar, &told, &result);
                    results.lock().unwrap_or_else(PoisonError::into_inner)[i] = Some(result);
                }
            });
        }
    });
    bar.finish_and_clear();
    Ok(results.into_inner().unwrap_or_else(PoisonError::into_inner))
}

fn take<'a>(next: &AtomicUsize, items: &'a [Item]) -> Option<(usize, &'a Item)> {
    if console::is_cancelled() {
        return None;
    }
    let i = next.fetch_add(1, Ordering::Relaxed);
    items.get(i).map(|item| (i, item))
}

/// A failure is told when it happens: a long batch may be stopped because of it. One reason is told once, however many items
/// fail for it.
fn tell(bar: &ProgressBar, told: &Mutex<HashSet<String>>, result: &Result<Success, Failure>) {
    if let Err(failure) = result {
        let mut told = told.lock().unwrap_or_else(PoisonError::into_inner);
        if told.insert(failure.reason.clone()) {
            let line = format!("failed: {}: {}", failure.name, failure.reason);
            bar.suspend(|| console::complain(&line));
        }
    }
    bar.inc(1);
}

/// Makes one item; `Err(None)` when the user cancelled.
fn make(item: &Item, args: &BatchArgs) -> Result<Success, Option<Failure>> {
    let failure = |reason: String| {
        Some(Failure {
            name: item.name.clone(),
            reason,
        })
    };
    let file = item.recipe().map_err(failure)?;
    let job = Job {
        folder: args.output.clone(),
        stem: item.name.clone(),
        formats: formats(&item.formats, file.recipe(), &FORMATS),
        readme: false,
        copies: false,
        precision: Precision::Half,
        mesh: item.mesh.clone(),
        allow_outside: args.allow_outside,
        file,
    };
    match job.make(&console::Bars) {
        Ok(made) => Ok(Success {
            name: item.name.clone(),
            files: made.files.len(),
            bytes: made.files.iter().map(|f| f.bytes).sum(),
            mended: made.mended,
            depths: depths(&job.formats),
        }),
        Err(Error::Cancelled) => Err(None),
        Err(error) => Err(failure(error.to_string())),
    }
}

struct Summary {
    asked: usize,
    /// How to read the PNG sets: one file for all.
    readme: Option<Written>,
    made: Vec<Success>,
    failures: Vec<Failure>,
    seconds: f64,
}

impl Summary {
    fn print(&self, as_json: bool) -> Result<()> {
        let readme = self.readme.iter();
        let own: usize = self.made.iter().map(|s| s.files).sum();
        let files = own + readme.len();
        let bytes: u64 = self.made.iter().map(|s| s.bytes).sum();
        let bytes = bytes + readme.map(|r| r.bytes).sum::<u64>();
        if as_json {
            return console::print_json(&json!({
                "asked": self.asked,
                "made": self.made.len(),
                "failed": self.failures.len(),
                "files": files,
                "bytes": bytes,
                "seconds": self.seconds,
                "items": self.made,
                "failures": self.failures,
            }));
        }
        let mut text = format!(
            "{} of {} made: {files} files, {}, {:.1} s\n",
            self.made.len(),
            self.asked,
            console::bytes(bytes),
            self.seconds
        );
        if !self.failures.is_empty() {
            text += &format!("{} failed:\n", self.failures.len());
        }
        for alike in self.failures.chunk_by(|a, b| a.reason == b.reason) {
            let more = match alike.len() {
                1 => String::new(),
                n => format!(" and {} more", n - 1),
            };
            text += &format!("  {}{more}: {}\n", alike[0].name, alike[0].reason);
        }
        console::print(&text)
    }
}

/// The manifest's own folder, from which it names recipes and meshes.
fn folder_of(manifest: &Path) -> &Path {
    let parent = manifest.parent().filter(|p| !p.as_os_str().is_empty());
    parent.unwrap_or(Path::new("."))
}
