//! `anisomap inspect`

use super::args::InspectArgs;
use super::{Outcome, Result, console, input};
use anisomap::analyse::{Directions, Finding, Severity, Spread, Statistics, lint, lint_energy};
use anisomap::generate::looks;
use serde_json::json;
use std::fmt::Write;

pub(super) fn run(args: InspectArgs) -> Result {
    console::catch_interrupts();
    let source = input::source(&args.input, &args.recipe_args, args.size)?;
    let statistics = Statistics::of(&source.map);
    console::check_cancelled()?;
    let mut findings = lint(&source.map, source.mended);
    findings.extend(energy(&source)?);
    findings.sort_by_key(|f| std::cmp::Reverse(f.severity));
    if args.json {
        console::print_json(&json!({
            "name": source.info.name,
            "aspect": source.info.aspect,
            "wrap": source.map.wrap(),
            "statistics": statistics,
            "mended": source.mended,
            "findings": findings,
        }))?;
    } else {
        console::print(&report(&source.info.name, &statistics, &findings))?;
    }
    let wrong = findings.iter().any(|f| f.severity == Severity::Error);
    Ok(if wrong { Outcome::Wrong } else { Outcome::Fine })
}

/// Whether the material gives back more than it gets, with the models that the recipe is shown in, or else the default one.
fn energy(source: &input::Source) -> Result<Vec<Finding>> {
    let recipe = source.recipe.as_ref().map(|(file, _)| file.recipe());
    let looks = looks(&[], recipe)?;
    let models: Vec<_> = looks.iter().map(|l| l.model).collect();
    let material = source.known_material();
    Ok(lint_energy(&source.map, material.as_ref(), &models))
}

fn report(name: &str, s: &Statistics, findings: &[Finding]) -> String {
    let mut text = format!("{name}  {}x{}\n\n", s.width, s.height);
    text += "                min      5 %   median     95 %      max     mean\n";
    for (what, spread) in [
        ("alpha_x", &s.alpha_x),
        ("alpha_y", &s.alpha_y),
        ("ratio", &s.ratio),
    ] {
        text += &spread_line(what, spread);
    }
    text += "\n";
    text += &direction_line("x axis", &s.x_axis);
    text += &direction_line("grooves", &s.groove);
    let _ = writeln!(
        text,
        "isotropic  {:.1} % of the texels\n",
        100.0 * s.isotropic_share
    );
    if findings.is_empty() {
        text += "nothing wrong found\n";
    }
    for finding in findings {
        let _ = writeln!(text, "{finding}");
    }
    text
}

fn spread_line(what: &str, s: &Spread) -> String {
    format!(
        "{what:10} {:8.4} {:8.4} {:8.4} {:8.4} {:8.4} {:8.4}\n",
        s.min, s.p05, s.p50, s.p95, s.max, s.mean
    )
}

fn direction_line(what: &str, d: &Directions) -> String {
    match d.mean_degrees {
        Some(mean) => format!(
            "{what:10} {mean:.1} degrees on average, spread {:.1} degrees, coherence {:.2}\n",
            d.spread_degrees, d.coherence
        ),
        None => format!("{what:10} no common direction\n"),
    }
}
