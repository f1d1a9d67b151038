//! `anisomap generate`: a recipe to all its files.

use super::args::{GenerateArgs, ReduceOptions};
use super::reduce::{Reduced, Work, meshes, recipe_in};
use super::{Outcome, Result, console, input};
use anisomap::export::beside;
use anisomap::export::exr::Precision;
use anisomap::generate::{Job, MARK, Made, formats, make_folder, yours_lies_there};
use anisomap::map::Mended;
use anisomap::mesh::Mesh;
use anisomap::recipe::{RecipeFile, Target};
use serde_json::json;
use std::fmt::Write as _;
use std::fs;

pub(super) fn run(args: GenerateArgs) -> Result {
    console::catch_interrupts();
    let (file, reduced) = match args.reduce {
        None => (
            input::recipe(&args.recipe, &args.recipe_args, args.size)?,
            None,
        ),
        Some(tolerance) => {
            let done = reduced(&args, tolerance)?;
            (RecipeFile::read(&done.reduced.recipe)?, Some(done))
        }
    };
    let formats = formats(&args.formats, file.recipe(), &Target::DEFAULT);
    let notes = reduced
        .as_ref()
        .map_or(Vec::new(), |done| coarse(&formats, &done.reduced));
    let halves_are_seen = (reduced.as_ref()).is_some_and(|done| {
        let exr = [Target::Exr, Target::RgbExr];
        let reduced = &done.reduced;
        // What nobody could judge is written as exactly as it can be.
        let coarse = |f| reduced.seen_in.contains(f) || reduced.unjudged.contains(f);
        exr.iter().any(|f| formats.contains(f) && coarse(f))
    });
    let job = Job {
        stem: file.recipe().name.clone(),
        formats,
        readme: true,
        copies: false,
        precision: if args.float || halves_are_seen {
            Precision::Float
        } else {
            Precision::Half
        },
        mesh: args.mesh,
        allow_outside: args.recipe_args.allow_outside,
        folder: args.output,
        file,
    };
    let mesh = reduced.as_ref().map(|done| done.mesh.clone());
    let mut made = job.make_on(mesh, &console::Bars)?;
    if let Some(done) = &reduced {
        made.mended = made.mended.plus(done.mended);
    }
    if let Some(note) = input::mended_note(made.mended) {
        console::complain(&note);
    }
    for note in notes {
        console::complain(&note);
    }
    if args.json {
        let mut json = to_json(&made, &job);
        json["reduced"] = serde_json::Value::Null;
        if let Some(done) = reduced {
            json["ignored"] = done.ignored.into();
            json["reduced"] = done.reduced.json;
        }
        console::print_json(&json)?;
    } else {
        let reduced = reduced.map_or(String::new(), |done| format!("{}\n", done.reduced.text));
        console::print(&(reduced + &report(&made, &job)))?;
    }
    Ok(Outcome::Fine)
}

/// A reduction, and what is known of its input that the reduced recipe does not say.
struct Done {
    reduced: Reduced,
    /// The mesh, open: seen from the output's folder it may lie outside, where the reduced recipe alone must not reach.
    mesh: Mesh,
    mended: Mended,
    /// Keys of a newer version.
    ignored: Vec<String>,
}

/// Writes the least that looks the same into the output's folder; the maps are then made from that.
fn reduced(args: &GenerateArgs, tolerance: f32) -> Result<Done> {
    let options = ReduceOptions {
        mesh: args.mesh.iter().cloned().collect(),
        ..ReduceOptions::default()
    };
    let named = meshes(&options)?.pop();
    let source = input::source(&args.recipe, &args.recipe_args, args.size)?;
    let (word, mesh) = match named {
        Some(named) => named,
        None => source.mesh().map(|mesh| (mesh.name.clone(), mesh))?,
    };
    make_folder(&args.output)?;
    let recipe = recipe_in(&args.output, &source, &args.recipe)?;
    let formats = formats(&args.formats, &recipe, &Target::DEFAULT);
    let work = Work {
        recipe,
        named: vec![(word, mesh.clone())],
        source: &source,
        tolerance,
        options: &options,
        formats: &formats,
    };
    // What would be refused after the work is refused before it.
    let copy = beside(&args.output.join(&work.recipe.name), ".toml");
    if fs::read_to_string(&copy).is_ok_and(|there| !there.starts_with(MARK)) {
        return Err(yours_lies_there(&args.output, &copy));
    }
    let own = source.recipe.as_ref();
    Ok(Done {
        reduced: work.reduce(&args.output)?,
        mesh,
        mended: source.mended,
        ignored: own.map_or(Vec::new(), |(file, _)| file.ignored().to_vec()),
    })
}

/// What is to be said of formats that are coarser than the tolerance allows. EXR files have floats then.
fn coarse(formats: &[Target], reduced: &Reduced) -> Vec<String> {
    let seen = formats.iter().filter(|f| reduced.seen_in.contains(f));
    seen.map(|format| {
        let name = format.name();
        let in_floats = reduced.seen_in_floats.contains(format);
        match format {
            Target::Exr | Target::RgbExr if !in_floats => {
                format!("note: halves would be seen, so {name} has 32-bit floats")
            }
            _ => format!("note: {name} is coarser than the tolerance allows"),
        }
    })
    .collect()
}

fn report(made: &Made, job: &Job) -> String {
    let recipe = job.file.recipe();
    let mut text = format!("{}  {}, seed {}\n", recipe.name, recipe.size, recipe.seed);
    let width = made
        .files
        .iter()
        .map(|f| f.path.display().to_string().len());
    let width = width.max().unwrap_or(0);
    for file in &made.files {
        let path = file.path.display().to_string();
        let _ = writeln!(text, "  {path:width$}  {:>9}", console::bytes(file.bytes));
    }
    if let Some(r) = &made.round_trip {
        let _ = writeln!(
            text,
            "read back from the glTF: widths within {:.2} %, directions within {:.2} degrees; the smallest widths within {:.1} %",
            100.0 * r.alpha,
            r.degrees,
            100.0 * r.alpha_elsewhere.max(r.alpha),
        );
        if r.clamped > 0 {
            let _ = writeln!(text, "{} texels are rougher than glTF can say", r.clamped);
        }
    }
    let times: Vec<String> = made
        .times
        .iter()
        .map(|(what, t)| format!("{what} {}", console::seconds(*t)))
        .collect();
    let _ = writeln!(text, "{}", times.join(", "));
    text
}

fn to_json(made: &Made, job: &Job) -> serde_json::Value {
    let recipe = job.file.recipe();
    let seconds: serde_json::Map<_, _> = made
        .times
        .iter()
        .map(|(what, t)| ((*what).replace(' ', "_"), json!(t.as_secs_f64())))
        .collect();
    json!({
        "name": recipe.name,
        "size": [recipe.size.width(), recipe.size.height()],
        "seed": recipe.seed,
        "files": made.files,
        "round_trip": made.round_trip,
        "seconds": seconds,
        "ignored": job.file.ignored(),
        "mended": made.mended,
    })
}
