//! `anisomap generate`: a recipe to all its files.

use super::args::{GenerateArgs, ReduceOptions};
use super::preview::{Shown, looks, scene};
use super::reduce::{Reduced, Work, meshes, recipe_in};
use super::{Outcome, Result, console, input};
use anisomap::Error;
use anisomap::analyse::compare;
use anisomap::export::exr::{Precision, write_master, write_rgb_pair};
use anisomap::export::gltf::{GltfOptions, GltfReport, write_glb, write_gltf};
use anisomap::export::png::{Depth, write_picture, write_set};
use anisomap::export::{Export, Written, beside, write_atomic};
use anisomap::import::gltf::read_gltf;
use anisomap::map::{AnisoMap, Mended, Size};
use anisomap::mesh::{Mesh, Projection};
use anisomap::preview::{Timings, panel_size};
use anisomap::recipe::{RecipeFile, Target, seen_from};
use serde::Serialize;
use serde_json::json;
use std::fmt::Write as _;
use std::fs;
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

/// The first line of a recipe's copy, by which a later run knows that it may be replaced.
const MARK: &str =
    "# The recipe of the maps beside it, written by anisomap. Copy it before you change it.";
/// The second, where it is true.
const OUTSIDE: &str =
    "# It names files outside its folder: generate makes the maps again with --allow-outside.";
/// The size of the picture beside the maps.
const PICTURE: (u32, u32) = (960, 720);

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
    let job = Job {
        stem: file.recipe().name.clone(),
        formats: formats(&args.formats, &file, &Target::DEFAULT),
        precision: if args.float {
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
    let mut made = job.make_on(mesh)?;
    if let Some(done) = &reduced {
        made.mended = made.mended.plus(done.mended);
    }
    if let Some(note) = input::mended_note(made.mended) {
        console::complain(&note);
    }
    if args.json {
        let mut json = made.to_json(&job);
        json["reduced"] = serde_json::Value::Null;
        if let Some(done) = reduced {
            json["ignored"] = done.ignored.into();
            json["reduced"] = done.reduced.json;
        }
        console::print_json(&json)?;
    } else {
        let reduced = reduced.map_or(String::new(), |done| format!("{}\n", done.reduced.text));
        console::print(&(reduced + &made.report(&job)))?;
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
    let work = Work {
        recipe: recipe_in(&args.output, &source, &args.recipe)?,
        named: vec![(word, mesh.clone())],
        source: &source,
        tolerance,
        options: &options,
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

/// That a recipe which somebody wrote is never written over.
fn yours_lies_there(folder: &Path, path: &Path) -> Error {
    Error::invalid(
        "--output",
        folder.display(),
        format!(
            "allowed: a folder without a {} of yours, since the recipe as it was used is written there",
            path.display()
        ),
    )
    .with_hint("Name another folder")
}

/// What the user asks for, or else the recipe, or else `default`; in the order they are written, each once.
pub(super) fn formats(asked: &[Target], file: &RecipeFile, default: &[Target]) -> Vec<Target> {
    let mut formats = [asked, &file.recipe().targets, default]
        .into_iter()
        .find(|list| !list.is_empty())
        .unwrap_or_default()
        .to_vec();
    formats.sort_unstable();
    formats.dedup();
    formats
}

/// What follows the stem in the names of the files that these formats become, and of the recipe's copy.
pub(super) fn suffixes(formats: &[Target]) -> Vec<&'static str> {
    let of = |format: &Target| -> &'static [&'static str] {
        match format {
            Target::Exr => &[".exr"],
            Target::RgbExr => &["_alpha.exr", "_direction.exr"],
            Target::Png8 => &[
                "_alpha_x_8bit.png",
                "_alpha_y_8bit.png",
                "_axis_8bit.png",
                "_direction_8bit.png",
            ],
            Target::Png16 => &[
                "_alpha_x_16bit.png",
                "_alpha_y_16bit.png",
                "_angle_16bit.png",
                "_axis_16bit.png",
                "_direction_16bit.png",
            ],
            Target::Glb => &[".glb"],
            Target::Gltf => &[".gltf", ".bin", "_roughness.png", "_anisotropy.png"],
            Target::Preview => &["_preview.png"],
        }
    };
    let maps = formats.iter().flat_map(of).copied();
    maps.chain([".toml"]).collect()
}

/// A recipe and what to write of it.
pub(super) struct Job {
    pub(super) file: RecipeFile,
    pub(super) folder: PathBuf,
    /// What every file's name begins with.
    pub(super) stem: String,
    pub(super) formats: Vec<Target>,
    pub(super) precision: Precision,
    pub(super) mesh: Option<String>,
    pub(super) allow_outside: bool,
}

/// What came of a job.
pub(super) struct Made {
    pub(super) files: Vec<Written>,
    round_trip: Option<RoundTrip>,
    /// What reading the recipe's images had to change.
    pub(super) mended: Mended,
    /// What took how long, in the order it was done.
    times: Vec<(&'static str, Duration)>,
}

/// What the GLB lost, measured by reading it back.
#[derive(Serialize)]
struct RoundTrip {
    /// Largest relative error of a width, where the smaller one is at least 4 % of its largest value in the map.
    alpha: f32,
    /// The same in the other texels.
    alpha_elsewhere: f32,
    /// Largest error of the direction in degrees, where there is one.
    degrees: f32,
    /// Texels whose larger width became 1 because glTF has no larger one.
    clamped: u64,
}

impl Job {
    /// Makes every file. Everything that can be refused is refused before the first is written.
    pub(super) fn make(&self) -> Result<Made> {
        self.make_on(None)
    }

    /// The same on a mesh that is open already, in place of the one that the recipe names.
    fn make_on(&self, open: Option<Mesh>) -> Result<Made> {
        let recipe = self.file.recipe();
        let files = self.file.files(self.allow_outside);
        let needs_mesh = [Target::Glb, Target::Gltf, Target::Preview];
        let mesh = match open {
            _ if !self.formats.iter().any(|f| needs_mesh.contains(f)) => None,
            None => Some(input::mesh(self.mesh.as_deref(), &self.file, &files)?),
            open => open,
        };
        let looks = looks(&[], Some(recipe))?;
        let size = Size::new(PICTURE.0, PICTURE.1)?;
        if let Some(mesh) = &mesh {
            mesh.validate()?;
        }
        if let (Some(mesh), true) = (&mesh, self.formats.contains(&Target::Preview)) {
            scene(mesh, Some(recipe)).check()?;
            panel_size(size, looks.len())?;
        }
        make_folder(&self.folder)?;
        let (copy, mesh_word) = self.copy_of_recipe()?;
        let mut made = Made {
            files: Vec::new(),
            round_trip: None,
            mended: Mended::default(),
            times: Vec::new(),
        };
        let (map, mended) = made.time("fill", || input::fill(&self.file, &files))?;
        made.mended = mended;
        let info = input::info(recipe, mesh_word);
        let export = Export::new(&map, &info);
        for &format in &self.formats {
            console::check_cancelled()?;
            match (format, &mesh) {
                (Target::Preview, Some(mesh)) => self.draw(&mut made, &map, mesh, &looks)?,
                (Target::Glb | Target::Gltf, Some(mesh)) => {
                    self.write_gltf(&mut made, &export, format, mesh)?;
                }
                _ => self.write_map(&mut made, &export, format)?,
            }
        }
        if let Some(text) = copy {
            let path = self.path(".toml");
            made.files
                .push(write_atomic(&path, |f| f.write_all(text.as_bytes()))?);
        }
        Ok(made)
    }

    fn stem(&self) -> PathBuf {
        self.folder.join(&self.stem)
    }

    fn path(&self, suffix: &str) -> PathBuf {
        beside(&self.stem(), suffix)
    }

    /// The recipe as it was used, with the mesh that it was used with, as a file of the maps' folder.
    fn used_recipe(&self) -> Result<RecipeFile> {
        let mut used = self.file.moved(&self.folder)?;
        if let Some(word) = &self.mesh {
            let word = if word.contains(['/', '\\', '.']) {
                let (file, projection) = Projection::split(word);
                let file = seen_from(&self.folder, Path::new(file))?;
                Projection::join(&file, projection)
            } else {
                word.clone()
            };
            used.set(&[("mesh", serde_json::Value::from(word).to_string())])?;
        }
        Ok(used)
    }

    /// The text of the recipe to lie beside the maps, and the mesh in it; no text where just that lies there already. A
    /// recipe that somebody wrote is never written over.
    fn copy_of_recipe(&self) -> Result<(Option<String>, Option<String>)> {
        let used = self.used_recipe()?;
        let mesh = used.recipe().mesh.clone();
        let text = used.to_toml();
        let heads = [MARK, OUTSIDE].map(|head| format!("{head}\n"));
        let plain = heads.iter().fold(text.as_str(), |text, head| {
            text.strip_prefix(head).unwrap_or(text)
        });
        let heads = &heads[..1 + usize::from(used.names_outside())];
        let marked = format!("{}{plain}", heads.concat());
        self.may_write(&text, marked).map(|copy| (copy, mesh))
    }

    /// `marked`, where a copy of the recipe may be written; `None` where `text` is what lies there.
    fn may_write(&self, text: &str, marked: String) -> Result<Option<String>> {
        let path = self.path(".toml");
        let there = match fs::read_to_string(&path) {
            Ok(there) => there,
            Err(e) if e.kind() == io::ErrorKind::NotFound => return Ok(Some(marked)),
            Err(e) => return Err(Error::write(&path)(e)),
        };
        if there == text {
            return Ok(None);
        }
        if there.starts_with(MARK) && !self.is_own_recipe(&path) {
            return Ok(Some(marked));
        }
        Err(yours_lies_there(&self.folder, &path))
    }

    /// Whether a path leads to the file that the recipe was read from.
    fn is_own_recipe(&self, path: &Path) -> bool {
        let real = |p: &Path| p.canonicalize().ok();
        let own = real(self.file.path());
        own.is_some() && own == real(path)
    }

    fn write_map(&self, made: &mut Made, export: &Export<'_>, format: Target) -> Result<()> {
        let stem = self.stem();
        let written = made.time(format.name(), || match format {
            Target::Exr => {
                write_master(&self.path(".exr"), export, self.precision).map(|w| vec![w])
            }
            Target::RgbExr => write_rgb_pair(&stem, export, self.precision).map(Vec::from),
            Target::Png8 => write_set(&stem, export, Depth::Eight),
            _ => write_set(&stem, export, Depth::Sixteen),
        })?;
        made.add(written);
        Ok(())
    }

    fn write_gltf(
        &self,
        made: &mut Made,
        export: &Export<'_>,
        format: Target,
        mesh: &Mesh,
    ) -> Result<()> {
        let material = self.file.recipe().material;
        let options = GltfOptions::default();
        let (written, report) = made.time(format.name(), || match format {
            Target::Glb => write_glb(&self.path(".glb"), export, mesh, &material, options)
                .map(|(w, report)| (vec![w], report)),
            _ => write_gltf(&self.stem(), export, mesh, &material, options),
        })?;
        let read = written[0].path.clone();
        made.add(written);
        let round_trip = made.time("read back", || round_trip(&read, export.map(), &report))?;
        made.round_trip = Some(round_trip);
        Ok(())
    }

    fn draw(
        &self,
        made: &mut Made,
        map: &AnisoMap,
        mesh: &Mesh,
        looks: &[anisomap::preview::Look],
    ) -> Result<()> {
        let recipe = self.file.recipe();
        let shown = Shown {
            mesh,
            map,
            material: &recipe.material,
            scene: &scene(mesh, Some(recipe)),
            timings: &Timings::off(),
            reference: None,
        };
        let size = Size::new(PICTURE.0, PICTURE.1)?;
        let written = made.time("preview", || {
            let picture = shown.sheet(looks, size)?;
            write_picture(&self.path("_preview.png"), &picture)
        })?;
        made.add(vec![written]);
        Ok(())
    }
}

/// Makes the folder for the files, and those above it, where they are missing.
pub(super) fn make_folder(folder: &Path) -> Result<()> {
    if folder.is_file() {
        let text = "it is a file; give the name of a folder";
        let error = io::Error::new(io::ErrorKind::NotADirectory, text);
        return Err(Error::write(folder)(error));
    }
    fs::create_dir_all(folder).map_err(Error::write(folder))
}

/// Reads a glTF back with the importer and compares it with the map it was made of.
fn round_trip(path: &Path, map: &AnisoMap, report: &GltfReport) -> Result<RoundTrip> {
    let back = read_gltf(path)?;
    let comparison = compare(map, &back.map)?;
    Ok(RoundTrip {
        alpha: comparison.well_held.max,
        alpha_elsewhere: comparison.elsewhere.max,
        degrees: comparison.angle.max_degrees,
        clamped: report.clamped,
    })
}

impl Made {
    fn time<T>(&mut self, what: &'static str, work: impl FnOnce() -> Result<T>) -> Result<T> {
        let started = Instant::now();
        let result = work()?;
        self.times.push((what, started.elapsed()));
        Ok(result)
    }

    /// Files that two formats share (the PNG set's README) are listed once.
    fn add(&mut self, written: Vec<Written>) {
        for file in written {
            if !self.files.iter().any(|f| f.path == file.path) {
                self.files.push(file);
            }
        }
    }

    fn report(&self, job: &Job) -> String {
        let recipe = job.file.recipe();
        let mut text = format!("{}  {}, seed {}\n", recipe.name, recipe.size, recipe.seed);
        let width = self
            .files
            .iter()
            .map(|f| f.path.display().to_string().len());
        let width = width.max().unwrap_or(0);
        for file in &self.files {
            let path = file.path.display().to_string();
            let _ = writeln!(text, "  {path:width$}  {:>9}", console::bytes(file.bytes));
        }
        if let Some(r) = &self.round_trip {
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
        let times: Vec<String> = self
            .times
            .iter()
            .map(|(what, t)| format!("{what} {}", console::seconds(*t)))
            .collect();
        let _ = writeln!(text, "{}", times.join(", "));
        text
    }

    fn to_json(&self, job: &Job) -> serde_json::Value {
        let recipe = job.file.recipe();
        let seconds: serde_json::Map<_, _> = self
            .times
            .iter()
            .map(|(what, t)| ((*what).replace(' ', "_"), json!(t.as_secs_f64())))
            .collect();
        json!({
            "name": recipe.name,
            "size": [recipe.size.width(), recipe.size.height()],
            "seed": recipe.seed,
            "files": self.files,
            "round_trip": self.round_trip,
            "seconds": seconds,
            "ignored": job.file.ignored(),
            "mended": self.mended,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeSet;

    #[test]
    fn every_file_of_every_format_is_known_by_its_suffix() {
        for format in Target::ALL {
            let folder = tempfile::tempdir().unwrap();
            let job = Job {
                file: RecipeFile::parse("version = 1\nsize = 4\n", "t.toml", None).unwrap(),
                folder: folder.path().to_owned(),
                stem: "x".to_owned(),
                formats: vec![format],
                precision: Precision::Half,
                mesh: None,
                allow_outside: false,
            };
            job.make().unwrap();
            let names = fs::read_dir(folder.path()).unwrap();
            let written: BTreeSet<String> = names
                .map(|e| e.unwrap().file_name().into_string().unwrap())
                .filter(|name| name != "README_png.txt") // the same for all maps
                .collect();
            let known = suffixes(&[format]).into_iter().map(|s| format!("x{s}"));
            assert_eq!(written, known.collect(), "{}", format.name());
        }
    }
}
