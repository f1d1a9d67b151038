//! `anisomap completions`

use super::args::{Arguments, CompletionsArgs};
use super::{Outcome, Result, console};
use clap::CommandFactory;

pub(super) fn run(args: CompletionsArgs) -> Result {
    let mut script = Vec::new();
    let mut command = Arguments::command();
    clap_complete::generate(args.shell, &mut command, "anisomap", &mut script);
    console::print(&String::from_utf8_lossy(&script))?;
    Ok(Outcome::Fine)
}
