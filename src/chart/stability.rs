//! What fails where, measured on this machine: the failure modes of [`limits`], the [`envelope`] of f32, and the energy of the
//! models.

use super::energy;
use super::envelope::{self, Envelope, LEVELS};
use super::machine::Machine;
use crate::analyse::limits::{Evidence, LIMITS, Limit, SPECULAR};
use crate::error::Result;
use crate::export::{Written, write_atomic};
use crate::progress::Progress;
use serde::Serialize;
use std::fmt::Write as _;
use std::io;
use std::path::Path;

/// Ratios that the tables tell of.
const RATIOS: [f64; 4] = [1.0, 10.0, 100.0, 1000.0];
/// Views up to this angle count in them: past it the rounding of the directions alone is of the order of the lobe.
const DEGREES: f64 = 85.0;

/// A failure mode with what was measured here.
#[derive(Clone, Debug, Serialize)]
pub struct Row {
    /// Its number in the table.
    pub number: u8,
    /// Its name.
    pub name: &'static str,
    /// What both forms made of the same inputs; infinities are null in JSON.
    pub measured: Evidence,
    /// The two in words, with their unit.
    pub shown: [String; 2],
    /// The bound that ours keeps, in words.
    pub bound: String,
    /// Whether it does on this machine.
    pub holds: bool,
}

impl Row {
    fn new(limit: &Limit) -> Result<Self> {
        let measured = limit.evidence()?;
        Ok(Self {
            number: limit.number,
            name: limit.name,
            measured,
            shown: [measured.naive, measured.ours].map(|x| limit.measure.show(x)),
            bound: limit.measure.show(limit.bound),
            holds: limit.holds(measured),
        })
    }
}

/// What is written beside the numbers as the command that measured them; the folder's name is the user's own business.
const COMMAND: &str = "anisomap chart --stability -o DIR";

/// What was measured and written.
#[derive(Clone, Debug)]
pub struct Stability {
    /// On what.
    pub machine: Machine,
    /// Every failure mode.
    pub rows: Vec<Row>,
    /// Where f32 holds.
    pub envelope: Envelope,
    /// The files.
    pub files: Vec<Written>,
}

impl Stability {
    /// Whether every bound is kept on this machine.
    pub fn holds(&self) -> bool {
        self.rows.iter().all(|r| r.holds)
    }
}

/// Measures all of it, in some seconds, and writes into a folder that is there: `limits.csv` and `limits.md` (the failure
/// modes), `stability.csv` and `stability.png` (the envelope), `energy.csv` and `energy.svg` (albedos).
///
/// # Errors
/// [`crate::Error::Write`], or when `progress` cancels.
pub fn stability(dir: &Path, progress: &Progress<'_>) -> Result<Stability> {
    progress.expect(LIMITS.len() as u64);
    let mut rows = Vec::new();
    for limit in &LIMITS {
        rows.push(Row::new(limit)?);
        progress.step()?;
    }
    let (envelope, files) = envelope::write(dir, progress)?;
    let mut files = files.to_vec();
    let machine = Machine::here();
    files.extend(energy::write(dir, progress)?);
    for (name, text) in [
        ("limits.csv", csv(&rows)),
        ("limits.md", page(&machine, &rows, &envelope)),
    ] {
        let written = write_atomic(&dir.join(name), |file| {
            io::Write::write_all(file, text.as_bytes())
        })?;
        files.push(written);
    }
    Ok(Stability {
        machine,
        rows,
        envelope,
        files,
    })
}

fn csv(rows: &[Row]) -> String {
    let mut text = String::from("number,name,usual_form,ours,bound,holds\n");
    for (row, limit) in rows.iter().zip(&LIMITS) {
        let Evidence { naive, ours } = row.measured;
        let _ = writeln!(
            text,
            "{},{},{naive:e},{ours:e},{:e},{}",
            row.number, row.name, limit.bound, row.holds
        );
    }
    text
}

/// The tables as a short page.
fn page(machine: &Machine, rows: &[Row], envelope: &Envelope) -> String {
    let mut text = format!(
        "# What fails, measured here\n\n{}\n\n\
         Every row runs the form that is usually written and the program's own on the same inputs.\n\n\
         | # | case | the usual form | ours | bound | | where |\n|---|---|---|---|---|---|---|\n",
        machine.signature(COMMAND)
    );
    for (row, limit) in rows.iter().zip(&LIMITS) {
        let _ = writeln!(
            text,
            "| {} | {} | {} | {} | {} | {} | `{}` |",
            row.number,
            limit.case,
            row.shown[0],
            row.shown[1],
            row.bound,
            if row.holds { "holds" } else { "**fails**" },
            limit.place
        );
    }
    text += "\n## Where f32 holds\n\n";
    text += &envelope_table(envelope);
    text += "\n![heat map](stability.png)\n\n## Light given back\n\n![directional albedo](energy.svg)\n";
    text
}

/// The smallest width from which on each model is within each of [`LEVELS`], as Markdown.
pub fn envelope_table(envelope: &Envelope) -> String {
    let mut text = format!(
        "The smallest alpha from which on the light of a texel stays within {:e} and within {:e} of f64, directions rounded to \
         f32 included, up to three widths from the peak and {DEGREES} degrees from the normal, by the ratio of its alphas.\n\n| model |",
        LEVELS[0], LEVELS[1]
    );
    for ratio in RATIOS {
        let _ = write!(text, " ratio {ratio} |");
    }
    text += "\n|---|";
    text += &"---|".repeat(RATIOS.len());
    text += "\n";
    for model in SPECULAR {
        let _ = write!(text, "| `{model}` |");
        for ratio in RATIOS {
            let from =
                LEVELS.map(
                    |level| match envelope.alpha_from(model, ratio, DEGREES, level) {
                        Some(alpha) => format!("{alpha:.3}"),
                        None => "none".to_owned(),
                    },
                );
            let _ = write!(text, " {}, {} |", from[0], from[1]);
        }
        text += "\n";
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn everything_is_measured_and_written() {
        let folder = tempfile::tempdir().unwrap();
        let stability = stability(folder.path(), &Progress::none()).unwrap();
        assert!(stability.holds());
        assert_eq!(stability.files.len(), 6);
        for file in &stability.files {
            assert!(file.bytes > 500, "{file:?}");
        }
        let page = std::fs::read_to_string(folder.path().join("limits.md")).unwrap();
        assert!(!page.contains("**fails**"));
        assert!(page.contains(&Machine::here().signature(COMMAND)));
        for limit in &LIMITS {
            assert!(page.contains(limit.case), "{}", limit.name);
        }
        let csv = std::fs::read_to_string(folder.path().join("limits.csv")).unwrap();
        assert_eq!(csv.lines().count(), LIMITS.len() + 1);
    }

    #[test]
    fn a_broken_bound_is_told() {
        let mut rows = vec![Row::new(&LIMITS[11]).unwrap()];
        rows[0].holds = false;
        let envelope = Envelope { cells: Vec::new() };
        assert!(page(&Machine::here(), &rows, &envelope).contains("**fails**"));
    }
}
