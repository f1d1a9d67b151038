//! `anisomap reduce`

use super::args::{ReduceArgs, ReduceOptions};
use super::{Outcome, Result, console, input};
use anisomap::Error;
use anisomap::analyse::reduce::{
    REPORT, Reduction, Request, Saved, Setting, Shape, Verdict, check_output, least,
};
use anisomap::export::{beside, write_atomic};
use anisomap::generate::{looks, make_folder, scene};
use anisomap::mesh::{self, Mesh};
use anisomap::preview::{Look, Scene};
use anisomap::recipe::{Recipe, RecipeFile, Target, read_toml, seen_from};
use glam::Vec3;
use std::fmt::Write as _;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::sync::Arc;

pub(super) fn run(args: ReduceArgs) -> Result {
    console::catch_interrupts();
    let named = meshes(&args.options)?;
    let source = input::source(&args.input, &args.recipe_args, args.map_size)?;
    if let Some(note) = input::mended_note(source.mended) {
        console::complain(&note);
    }
    make_folder(&args.output)?;
    let work = Work {
        recipe: recipe_in(&args.output, &source, &args.input)?,
        named,
        source: &source,
        tolerance: args.tolerance,
        options: &args.options,
        formats: &Target::ALL,
    };
    let reduced = work.reduce(&args.output)?;
    if args.json {
        console::print_json(&reduced.json)?;
    } else {
        console::print(&reduced.text)?;
    }
    Ok(Outcome::Fine)
}

/// The meshes that the user names.
pub(super) fn meshes(options: &ReduceOptions) -> Result<Vec<(String, Mesh)>> {
    let open = |word: &String| mesh::open(word).map(|mesh| (word.clone(), mesh));
    options.mesh.iter().map(open).collect()
}

/// What is reduced, and where it must look the same.
pub(super) struct Work<'a> {
    /// What the reduced recipe keeps, as a file of the output's folder names its files.
    pub(super) recipe: Recipe,
    pub(super) named: Vec<(String, Mesh)>,
    pub(super) source: &'a input::Source,
    pub(super) tolerance: f32,
    pub(super) options: &'a ReduceOptions,
    /// The formats to be judged.
    pub(super) formats: &'a [Target],
}

/// What came of it, told in both ways.
pub(super) struct Reduced {
    pub(super) text: String,
    pub(super) json: serde_json::Value,
    /// The formats that are coarser than the tolerance allows, EXR in halves.
    pub(super) seen_in: Vec<Target>,
    /// Those of them that are so in floats too.
    pub(super) seen_in_floats: Vec<Target>,
    /// Those that could not be judged.
    pub(super) unjudged: Vec<Target>,
    /// The recipe that stands for the reduced map.
    pub(super) recipe: PathBuf,
}

impl Work<'_> {
    /// Finds the least that looks the same and writes it into a folder that is there.
    pub(super) fn reduce(&self, folder: &Path) -> Result<Reduced> {
        let stem = folder.join(&self.recipe.name);
        check_output(&stem)?;
        let material = self.source.material();
        let settings = self.settings()?;
        let own = self.source.recipe.as_ref().map(|(file, _)| file.recipe());
        let shown = looks(&[], own)?;
        let judged = match self.options.model {
            Some(model) => vec![Look { model, mean: false }],
            None => shown.clone(),
        };
        let request = Request {
            map: &self.source.map,
            aspect: self.source.info.aspect,
            material: &material,
            looks: &judged,
            settings: &settings,
            metric: self.options.metric,
            tolerance: self.tolerance,
            size: self.options.size,
            formats: self.formats,
        };
        let reduction = console::with_progress("reducing", |p| least(&request, p))?;
        console::check_cancelled()?;
        if let Some(sentence) = reduction.not_judged() {
            console::complain(&format!("note: {sentence}"));
        }
        let mut saved = reduction.write(&stem, &self.recipe, request.aspect)?;
        let unjudged = if own.is_some() {
            unjudged(&shown, &judged)
        } else {
            Vec::new() // a map shows nothing of its own
        };
        let dropped = [reduction.dropped(&request), unjudged].concat();
        let mut json = reduction.to_json(&request, &saved);
        json["dropped"] = dropped.clone().into();
        json["name"] = self.recipe.name.clone().into();
        let path = beside(&stem, REPORT);
        let written = write_atomic(&path, |f| writeln!(f, "{json:#}"))?;
        saved.files.push(written);
        json["files"] = serde_json::to_value(&saved.files).unwrap_or_default();
        Ok(Reduced {
            text: self.text(&request, &reduction, &saved, &dropped),
            json,
            seen_in: reduction.seen_in,
            seen_in_floats: reduction.seen_in_floats,
            unjudged: reduction
                .unjudged
                .map_or(Vec::new(), |(formats, _)| formats),
            recipe: saved.recipe,
        })
    }

    /// Every mesh under every light.
    fn settings(&self) -> Result<Vec<Setting>> {
        let meshes: Vec<(String, Arc<Mesh>)> = if self.named.is_empty() {
            let mesh = self.source.mesh()?;
            vec![(mesh.name.clone(), Arc::new(mesh))]
        } else {
            let named = self.named.iter();
            named
                .map(|(word, mesh)| (word.clone(), Arc::new(mesh.clone())))
                .collect()
        };
        let mut settings = Vec::new();
        for (mesh_name, mesh) in meshes {
            for (light_name, scene) in self.scenes(&mesh)? {
                settings.push(Setting {
                    mesh_name: mesh_name.clone(),
                    light_name,
                    mesh: mesh.clone(),
                    scene,
                });
            }
        }
        Ok(settings)
    }

    /// The scenes that a mesh is seen in: those of files, one for each light, or the one that `preview` shows.
    fn scenes(&self, mesh: &Mesh) -> Result<Vec<(String, Scene)>> {
        let own = self.source.recipe.as_ref().map(|(file, _)| file.recipe());
        let usual = scene(mesh, own);
        let mut scenes = Vec::new();
        for path in &self.options.scene {
            scenes.push((path.display().to_string(), read_toml::<Scene>(path)?));
        }
        for &light in &self.options.light {
            let mut lit = usual.clone();
            lit.set_directions(&[light]);
            scenes.push((format!("light {}", words(light)), lit));
        }
        if scenes.is_empty() {
            let lit_by_recipe = own.is_some_and(|r| !r.scene.lights.is_empty());
            let name = if lit_by_recipe {
                "the recipe's lights"
            } else {
                "the studio's lights"
            };
            scenes.push((name.to_owned(), usual));
        }
        if let Some(stops) = self.options.exposure {
            scenes
                .iter_mut()
                .for_each(|(_, scene)| scene.exposure = stops);
        }
        Ok(scenes)
    }

    fn text(
        &self,
        request: &Request<'_>,
        reduction: &Reduction,
        saved: &Saved,
        dropped: &[String],
    ) -> String {
        let (t, size) = (request.tolerance, request.size);
        let mut text = format!("{}  {}\n", self.recipe.name, request.map.size());
        let _ = writeln!(
            text,
            "the same is: {} at most {t} on average and {} in 99.9 % of the pixels, at {size}\n",
            request.metric,
            request.tolerance_of_p999()
        );
        text += &tried(reduction);
        let _ = writeln!(text, "\nkept: {}", reduction.form());
        for what in dropped {
            let _ = writeln!(text, "dropped: {what}");
        }
        if dropped.is_empty() {
            text += "dropped: nothing; less is seen\n";
        }
        text += &saving(reduction, saved);
        for (setting, look, error) in reduction.pictures(request) {
            let _ = writeln!(
                text,
                "{}, {look}, exposure {}: mean {:.5}, 99.9 % {:.5}, largest {:.4}",
                setting.name(),
                setting.scene.exposure,
                error.mean,
                error.p999,
                error.max
            );
        }
        text += &outside(&saved.recipe);
        for file in &saved.files {
            let _ = writeln!(
                text,
                "  {}  {}",
                file.path.display(),
                console::bytes(file.bytes)
            );
        }
        text
    }
}

/// Looks that a recipe shows and that nobody looked at, since others were asked for.
fn unjudged(shown: &[Look], judged: &[Look]) -> Vec<String> {
    let others = shown.iter().filter(|look| !judged.contains(look));
    others
        .map(|look| format!("the recipe's model {look}: not judged, as --model names another"))
        .collect()
}

/// What a recipe asks for that names files outside its folder; nothing where it names none.
fn outside(recipe: &Path) -> String {
    match RecipeFile::read(recipe) {
        Ok(file) if file.names_outside() => format!(
            "{} names a mesh outside its folder: to draw it, commands need --allow-outside or another --mesh\n",
            recipe.display()
        ),
        _ => String::new(), // it was read a moment ago
    }
}

/// The table of everything that was tried.
fn tried(reduction: &Reduction) -> String {
    let widths = reduction.trials.iter().map(|t| t.what.chars().count());
    let width = widths.max().unwrap_or(0);
    let mut text = format!(
        "{:width$} {:>9} {:>9} {:>8} {:>8}\n",
        "tried", "bytes", "predicted", "mean", "99.9 %"
    );
    for trial in &reduction.trials {
        let predicted = trial.predicted.map_or("-".to_owned(), |p| match p {
            p if p < 100.0 => format!("{:.1} %", 100.0 * p),
            _ => "> 9999 %".to_owned(),
        });
        let (mean, p999) = trial.error.map_or(("-".to_owned(), "-".to_owned()), |e| {
            (format!("{:.5}", e.mean), format!("{:.5}", e.p999))
        });
        let _ = writeln!(
            text,
            "{:width$} {:>9} {predicted:>9} {mean:>8} {p999:>8}  {}",
            trial.what,
            console::bytes(trial.bytes),
            trial.verdict.words()
        );
    }
    let drawn = reduction
        .trials
        .iter()
        .filter(|t| t.error.is_some())
        .count();
    let _ = writeln!(
        text,
        "predicted: how far the closed forms let a lobe change up to its exponent {:.1}; {} of {} were drawn",
        reduction.k_max,
        drawn,
        reduction.trials.len()
    );
    debug_assert!(reduction.trials.iter().any(|t| t.verdict == Verdict::Taken));
    text
}

fn saving(reduction: &Reduction, saved: &Saved) -> String {
    let (before, after) = (reduction.full_bytes, reduction.form().bytes());
    let share = 100.0 * (1.0 - after as f64 / before as f64);
    let table = match reduction.form().shape {
        Shape::Radial(..) => format!(
            "what reads no tables gets it laid out again, as {} texels\n",
            reduction.map().size()
        ),
        _ => String::new(),
    };
    format!(
        "texels as they are stored: {} in place of {} ({share:.2} % saved); in files: {}\n{table}\
         drawing: {:.2} ms in place of {:.2} ms\n{}",
        console::bytes(after),
        console::bytes(before),
        console::bytes(saved.map_bytes),
        reduction.milliseconds,
        reduction.full_milliseconds,
        measured(reduction),
    )
}

/// How the errors that follow were found.
fn measured(reduction: &Reduction) -> String {
    let Some(n) = reduction.reference_samples else {
        return "not measured: the files give the full map back to the bit, so the pictures are the same:\n".to_owned();
    };
    let wanted = reduction.texels_a_pixel;
    let few = match wanted > n {
        true => format!(
            "note: {wanted} texels of the map lie along a pixel's side, more than the reference can sample; a larger --size tells more\n"
        ),
        false => String::new(),
    };
    format!(
        "{few}measured by the reference, {n}x{n} samples a pixel, from what the files give back:\n"
    )
}

fn words(v: Vec3) -> String {
    let short = |x: f32| format!("{}", (1000.0 * x).round() / 1000.0);
    format!("{},{},{}", short(v.x), short(v.y), short(v.z))
}

/// What the reduced recipe keeps of the input's: all that is known of it but its layers.
pub(super) fn recipe_in(folder: &Path, source: &input::Source, word: &str) -> Result<Recipe> {
    if let Some((file, _)) = &source.recipe {
        return Ok(file.moved(folder)?.recipe().clone());
    }
    let is_file = |mesh: &str| mesh.contains(['/', '\\', '.']);
    let map_folder = Path::new(word).parent().unwrap_or(Path::new("."));
    let mesh = match source.info.mesh.clone() {
        Some(mesh) if is_file(&mesh) => seen_from(folder, &map_folder.join(mesh)).ok(),
        other => other.filter(|name| mesh::builtin(name).is_some()),
    };
    let recipe = Recipe {
        name: source.info.name.clone(),
        mesh,
        wrap: source.map.wrap(),
        size: source.map.size(),
        aspect: Some(source.info.aspect),
        material: source.material(),
        ..Recipe::default()
    };
    if recipe.check().is_ok() {
        return Ok(recipe);
    }
    // The name of a file may be no name of a recipe.
    let plain = RecipeFile::parse("version = 1", word, None)?;
    let renamed = Recipe {
        name: plain.recipe().name.clone(),
        ..recipe
    };
    renamed.check()?;
    Ok(renamed)
}

/// That a tolerance is one at all; how large it may be depends on the metric.
pub(super) fn parse_tolerance(word: &str) -> Result<f32, String> {
    let number = word.trim().parse::<f32>().ok();
    number
        .filter(|t| *t > 0.0 && t.is_finite())
        .ok_or_else(|| "allowed: a number over 0, as in 0.01".to_owned())
}

/// The metric of a word.
pub(super) fn parse_metric(word: &str) -> Result<anisomap::analyse::reduce::Metric, Error> {
    word.parse()
}
