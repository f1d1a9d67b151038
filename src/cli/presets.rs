//! `anisomap presets`

use super::args::{ListArgs, PresetsAction, PresetsArgs, ShowArgs};
use super::{Outcome, Result, console};
use anisomap::recipe::{PRESETS, preset};
use serde_json::json;

pub(super) fn run(args: PresetsArgs) -> Result {
    match args.action {
        None => list(&args.list),
        Some(PresetsAction::List(args)) => list(&args),
        Some(PresetsAction::Show(args)) => show(&args),
    }
}

fn list(args: &ListArgs) -> Result {
    if args.json {
        let all = PRESETS
            .iter()
            .map(|p| json!({ "name": p.name, "description": p.description() }));
        console::print_json(&all.collect())?;
        return Ok(Outcome::Fine);
    }
    let width = PRESETS.iter().map(|p| p.name.len()).max().unwrap_or(0);
    let line = |p: &anisomap::recipe::Preset| {
        if args.names {
            format!("{}\n", p.name)
        } else {
            format!("{:width$}  {}\n", p.name, p.description())
        }
    };
    console::print(&PRESETS.iter().map(line).collect::<String>())?;
    Ok(Outcome::Fine)
}

fn show(args: &ShowArgs) -> Result {
    let preset = preset(&args.name)?;
    if args.json {
        let file = preset.recipe()?;
        let recipe = serde_json::to_value(file.recipe()).expect("a checked recipe is plain data");
        console::print_json(&recipe)?;
    } else {
        console::print(&nameless(preset.text))?;
    }
    Ok(Outcome::Fine)
}

/// A preset's text without its name: a copy, and all that is made with it, is called what its own file is called.
fn nameless(text: &str) -> String {
    let (head, layers) = text.split_at(text.find("\n[").unwrap_or(text.len()));
    let kept = |line: &&str| !line.starts_with("name = ");
    head.split_inclusive('\n')
        .filter(kept)
        .chain([layers])
        .collect()
}
