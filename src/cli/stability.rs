//! `anisomap chart --stability`

use super::{Outcome, Result, console};
use anisomap::chart::{self, Row, Stability};
use anisomap::generate::make_folder;
use serde_json::json;
use std::fmt::Write;
use std::path::Path;

/// Measures what fails where, writes it into a folder that is made where it is missing, and says what was found.
pub(super) fn run(output: &Path, as_json: bool) -> Result {
    make_folder(output)?;
    let found = console::with_progress("measuring", |progress| chart::stability(output, progress))?;
    if as_json {
        console::print_json(&json!({
            "machine": found.machine,
            "holds": found.holds(),
            "limits": found.rows,
            "files": found.files,
        }))?;
    } else {
        console::print(&report(&found))?;
    }
    Ok(if found.holds() {
        Outcome::Fine
    } else {
        Outcome::Wrong
    })
}

fn report(found: &Stability) -> String {
    let mut text = format!("{}\n", found.machine.line());
    let _ = writeln!(
        text,
        "{:>3} {:22}{:>18}{:>18}{:>18}",
        "#", "", "the usual form", "ours", "bound"
    );
    for row in &found.rows {
        text += &line(row);
    }
    text += "\n";
    for file in &found.files {
        let _ = writeln!(
            text,
            "{}  {}",
            file.path.display(),
            console::bytes(file.bytes)
        );
    }
    text
}

fn line(row: &Row) -> String {
    let [naive, ours] = &row.shown;
    let verdict = if row.holds { "" } else { "   FAILS" };
    format!(
        "{:>3} {:22}{naive:>18}{ours:>18}{:>18}{verdict}\n",
        row.number, row.name, row.bound
    )
}
