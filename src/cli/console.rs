//! What reaches the terminal: results on stdout, progress and complaints on stderr.

use super::Result;
use anisomap::Error;
use anisomap::export::clear_unfinished;
use anisomap::generate::Watch;
use anisomap::progress::Progress;
use indicatif::{ProgressBar, ProgressStyle};
use std::io::{self, Write};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Once, OnceLock};
use std::thread;
use std::time::Duration;

static CANCELLED: AtomicBool = AtomicBool::new(false);
static BARS_HIDDEN: AtomicBool = AtomicBool::new(false);

/// Writes a result to stdout. A reader that went away (`| head`) is no error.
pub(super) fn print(text: &str) -> Result<()> {
    let mut out = io::stdout().lock();
    match out.write_all(text.as_bytes()).and_then(|()| out.flush()) {
        Err(e) if e.kind() != io::ErrorKind::BrokenPipe => Err(Error::write("standard output")(e)),
        _ => Ok(()),
    }
}

/// Writes a value to stdout as JSON with a line end.
pub(super) fn print_json(value: &serde_json::Value) -> Result<()> {
    print(&format!("{value:#}\n"))
}

/// Writes a line to stderr, if anybody can still read it.
pub(super) fn complain(line: &str) {
    let _ = writeln!(io::stderr().lock(), "{line}");
}

/// How long work may take to notice that it was cancelled.
const GRACE: Duration = Duration::from_secs(1);
/// What a shell expects of a program that Ctrl-C ended.
const INTERRUPTED: i32 = 130;

/// Makes Ctrl-C stop the work at its next step in place of killing the process, so that unfinished files are cleared away.
/// Work that takes no step for a while, and a user who presses it again, are not kept waiting: the unfinished files go, and
/// the process ends.
pub(super) fn catch_interrupts() {
    static ONCE: Once = Once::new();
    ONCE.call_once(|| {
        // Without a handler Ctrl-C kills the process, as it would anyway: nothing to report.
        let _ = ctrlc::set_handler(|| {
            if CANCELLED.swap(true, Ordering::Relaxed) {
                end(INTERRUPTED);
            }
            thread::spawn(|| {
                thread::sleep(GRACE);
                complain(&format!("error: {}", Error::Cancelled));
                end(i32::from(Error::Cancelled.exit_code()));
            });
        });
    });
}

/// Ends the process from any thread, in the middle of whatever the others do.
fn end(code: i32) -> ! {
    let _no_file_begins_anew = clear_unfinished();
    std::process::exit(code)
}

/// Whether the user pressed Ctrl-C.
pub(super) fn is_cancelled() -> bool {
    CANCELLED.load(Ordering::Relaxed)
}

/// Ends the work when the user pressed Ctrl-C.
pub(super) fn check_cancelled() -> Result<()> {
    if is_cancelled() {
        Err(Error::Cancelled)
    } else {
        Ok(())
    }
}

/// Keeps [`with_progress`] from drawing: a batch has one bar for all its items.
pub(super) fn hide_bars() {
    BARS_HIDDEN.store(true, Ordering::Relaxed);
}

/// Runs work that reports its progress. A bar is drawn on stderr when that is a terminal and the work takes long enough to be
/// worth one.
pub(super) fn with_progress<T>(
    what: &str,
    work: impl FnOnce(&Progress<'_>) -> Result<T>,
) -> Result<T> {
    let started = std::time::Instant::now();
    let bar: OnceLock<ProgressBar> = OnceLock::new();
    let report = |done: u64, total: u64| {
        let hidden = BARS_HIDDEN.load(Ordering::Relaxed);
        if !hidden && started.elapsed() > Duration::from_millis(400) {
            let bar = bar.get_or_init(|| self::bar(what));
            bar.set_length(total);
            bar.set_position(done);
        }
        !is_cancelled()
    };
    let result = work(&Progress::new(&report));
    if let Some(bar) = bar.get() {
        bar.finish_and_clear();
    }
    result
}

/// A bar for each stage of the work.
pub(super) struct Bars;

impl Watch for Bars {
    fn stage<T>(
        &self,
        what: &'static str,
        work: impl FnOnce(&Progress<'_>) -> Result<T>,
    ) -> Result<T> {
        with_progress(what, work)
    }
}

/// A bar on stderr, invisible where that is no terminal.
pub(super) fn bar(what: &str) -> ProgressBar {
    let bar = ProgressBar::new(0).with_message(what.to_owned());
    let style = ProgressStyle::with_template("{msg:16} {wide_bar} {pos}/{len} {eta:>4}")
        .expect("the template is constant");
    bar.set_style(style);
    bar
}

/// `4.9 MB`
pub(super) fn bytes(n: u64) -> String {
    let x = n as f64;
    match n {
        0..1_000 => format!("{n} B"),
        1_000..1_000_000 => format!("{:.1} kB", x / 1e3),
        1_000_000..1_000_000_000 => format!("{:.1} MB", x / 1e6),
        _ => format!("{:.2} GB", x / 1e9),
    }
}

/// `0.12 s`
pub(super) fn seconds(t: Duration) -> String {
    format!("{:.2} s", t.as_secs_f64())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sizes_are_told_in_units_people_use() {
        assert_eq!(bytes(999), "999 B");
        assert_eq!(bytes(4_949_000), "4.9 MB");
        assert_eq!(bytes(1_500_000_000), "1.50 GB");
    }
}
