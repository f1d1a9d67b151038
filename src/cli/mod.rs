//! Commands: each reads, calls the library, and writes.
//!
//! Exit codes: 0 done, 1 the work found something wrong (or was cancelled), 2 bad arguments or invalid or missing input,
//! 3 the machine failed (disk, permissions). Results go to stdout, everything else to stderr.

mod args;
mod batch;
mod chart;
mod completions;
mod console;
mod generate;
mod input;
mod inspect;
mod presets;
mod preview;
mod reduce;
mod stability;

use anisomap::Error;
use args::{Arguments, Command};
use clap::Parser;
use std::ffi::OsString;
use std::io;
use std::path::Path;
use std::process::ExitCode;

/// How a command that did its work ended.
enum Outcome {
    /// Nothing is wrong.
    Fine,
    /// The work is done, and found something wrong. Exit code 1.
    Wrong,
}

type Result<T = Outcome, E = Error> = std::result::Result<T, E>;

/// Parses the arguments, runs the command, and turns its end into an exit code.
pub(crate) fn run() -> ExitCode {
    let arguments = match Arguments::try_parse_from(with_command(std::env::args_os().collect())) {
        Ok(arguments) => arguments,
        Err(said) => return answer(&said),
    };
    match dispatch(arguments.command) {
        Ok(Outcome::Fine) => ExitCode::SUCCESS,
        Ok(Outcome::Wrong) => ExitCode::from(1),
        Err(error) => fail(&error),
    }
}

/// What clap answers in place of arguments: help and the version on stdout, mistakes on stderr.
fn answer(said: &clap::Error) -> ExitCode {
    match said.print() {
        Err(e) if !said.use_stderr() && e.kind() != io::ErrorKind::BrokenPipe => {
            fail(&Error::write("standard output")(e))
        }
        _ => ExitCode::from(u8::try_from(said.exit_code()).unwrap_or(2)),
    }
}

fn fail(error: &Error) -> ExitCode {
    console::complain(&format!("error: {error}"));
    ExitCode::from(error.exit_code())
}

/// A recipe alone, as a desktop gives a file to the program it belongs to, is opened in the studio.
fn with_command(mut words: Vec<OsString>) -> Vec<OsString> {
    let is_recipe = |word: &OsString| Path::new(word).extension().is_some_and(|e| e == "toml");
    if cfg!(feature = "gui") && words.len() == 2 && is_recipe(&words[1]) {
        words.insert(1, "gui".into());
    }
    words
}

fn dispatch(command: Option<Command>) -> Result {
    let Some(command) = command else {
        return studio(None);
    };
    match command {
        Command::Presets(args) => presets::run(args),
        Command::Generate(args) => generate::run(args),
        Command::Preview(args) => preview::run(args),
        Command::Inspect(args) => inspect::run(args),
        Command::Reduce(args) => reduce::run(args),
        Command::Batch(args) => batch::run(args),
        Command::Chart(args) => chart::run(args),
        Command::Completions(args) => completions::run(args),
        #[cfg(feature = "gui")]
        Command::Gui(args) => studio(args.recipe),
    }
}

/// Opens the studio.
#[cfg(feature = "gui")]
fn studio(recipe: Option<String>) -> Result {
    crate::gui::run(recipe).map(|()| Outcome::Fine)
}

/// Without the window there is always a command: clap shows the help where none is given.
#[cfg(not(feature = "gui"))]
fn studio(_recipe: Option<String>) -> Result {
    Ok(Outcome::Fine)
}
