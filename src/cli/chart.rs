//! `anisomap chart`

use super::args::ChartArgs;
use super::{Outcome, Result, console, stability};
use anisomap::Error;
use anisomap::chart::{self, Measured, Options};
use anisomap::generate::make_folder;
use serde_json::json;
use std::fmt::Write;

pub(super) fn run(args: ChartArgs) -> Result {
    console::catch_interrupts();
    if args.stability {
        return stability::run(&args.output, args.json);
    }
    if args.pictures && !args.only.is_empty() && !args.only.contains(&chart::Part::Pictures) {
        return Err(Error::invalid(
            "--pictures",
            "given with --only kernels",
            "allowed: where pictures are measured",
        ));
    }
    make_folder(&args.output)?;
    let options = Options {
        command: command(&args),
        parts: args.only,
        is_quick: args.quick,
        keep_pictures: args.pictures,
    };
    let measured = console::with_progress("measuring", |progress| {
        chart::measure(&args.output, &options, progress)
    })?;
    if args.json {
        console::print_json(&json!({
            "machine": measured.machine,
            "kernels": measured.kernels,
            "pictures": measured.pictures,
            "files": measured.files,
        }))?;
    } else {
        console::print(&files(&measured))?;
    }
    Ok(Outcome::Fine)
}

/// The command as it is written beside the numbers; the folder's name is the user's own business.
fn command(args: &ChartArgs) -> String {
    let mut command = String::from("anisomap chart -o DIR");
    if let [part] = args.only[..] {
        let _ = write!(command, " --only {}", part.name());
    }
    if args.quick {
        command += " --quick";
    }
    if args.pictures {
        command += " --pictures";
    }
    command
}

fn files(measured: &Measured) -> String {
    let mut text = format!("{}\n", measured.machine.line());
    // A folder of pictures is told of as one.
    let is_kept = |path: &std::path::Path| path.parent().is_some_and(|p| p.ends_with("pictures"));
    let (kept, files): (Vec<_>, Vec<_>) = measured.files.iter().partition(|f| is_kept(&f.path));
    if let Some(first) = kept.first() {
        let folder = first.path.parent().unwrap_or(&first.path);
        let bytes = console::bytes(kept.iter().map(|f| f.bytes).sum());
        let _ = writeln!(text, "{}  {} files  {bytes}", folder.display(), kept.len());
    }
    for file in files {
        let _ = writeln!(
            text,
            "{}  {}",
            file.path.display(),
            console::bytes(file.bytes)
        );
    }
    text
}
