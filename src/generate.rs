//! A recipe to all its files: what the commands `generate` and `batch` and the studio's export do, the same to the byte.

use crate::analyse::compare;
use crate::convention::{MapInfo, Reflectance};
use crate::error::{Error, Result};
use crate::export::exr::{Precision, write_master_with, write_rgb_pair_with};
use crate::export::gltf::{GltfOptions, GltfReport, write_glb, write_gltf};
use crate::export::laid::{Copies, bring};
use crate::export::png::{Depth, README, write_picture, write_readme, write_set_with};
use crate::export::{Export, Written, beside, write_atomic};
use crate::import::gltf::read_gltf;
use crate::map::{AnisoMap, Mended, Size};
use crate::mesh::{self, Mesh, Projection};
use crate::preview::{Look, Scene, Subject, panel_size, render, render_sheet};
use crate::progress::Progress;
use crate::recipe::{Files, Material, Recipe, RecipeFile, Target, is_path, seen_from};
use glam::Vec3;
use serde::Serialize;
use std::collections::BTreeMap;
use std::fs;
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

/// The first line of a recipe's copy, by which a later run knows that it may be replaced.
pub const MARK: &str =
    "# The recipe of the maps beside it, written by anisomap. Copy it before you change it.";
/// The second, where it is true.
const OUTSIDE: &str =
    "# It names files outside its folder: generate makes the maps again with --allow-outside.";
/// The size of the picture beside the maps.
const PICTURE: (u32, u32) = (960, 720);
/// The mesh of a recipe or map that names none.
pub const MESH: &str = "torus";

/// Who looks on while files are made.
pub trait Watch: Sync {
    /// Runs a stage of the work, which has a name and tells how far it is.
    ///
    /// # Errors
    /// Those of the work.
    fn stage<T>(
        &self,
        what: &'static str,
        work: impl FnOnce(&Progress<'_>) -> Result<T>,
    ) -> Result<T>;
}

/// Nobody looks on.
pub struct Unwatched;

impl Watch for Unwatched {
    fn stage<T>(
        &self,
        _: &'static str,
        work: impl FnOnce(&Progress<'_>) -> Result<T>,
    ) -> Result<T> {
        work(&Progress::none())
    }
}

/// A recipe and what to write of it.
#[derive(Clone, Debug)]
pub struct Job {
    /// The recipe, at the size of the files.
    pub file: RecipeFile,
    /// Where the files are to be; it is made where it is missing.
    pub folder: PathBuf,
    /// What every file's name begins with.
    pub stem: String,
    /// What is written, each once.
    pub formats: Vec<Target>,
    /// Of the EXR files.
    pub precision: Precision,
    /// In place of the recipe's mesh: a built-in, or a file.
    pub mesh: Option<String>,
    /// Whether the recipe may name files outside its folder.
    pub allow_outside: bool,
    /// Whether `README_png.txt` is written beside PNG sets.
    pub readme: bool,
    /// Whether the copy of the recipe gets copies of the files that it reads beside it, so that it can be opened there. Otherwise
    /// it names them where they are.
    pub copies: bool,
}

/// What came of a job.
#[derive(Debug, Default)]
pub struct Made {
    /// The files, in the order they were written.
    pub files: Vec<Written>,
    /// What a glTF lost, where one was written.
    pub round_trip: Option<RoundTrip>,
    /// What reading the recipe's images had to change.
    pub mended: Mended,
    /// What took how long, in the order it was done.
    pub times: Vec<(&'static str, Duration)>,
}

/// What the glTF lost, measured by reading it back.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct RoundTrip {
    /// Largest relative error of a width, where the smaller one is at least 4 % of its largest value in the map.
    pub alpha: f32,
    /// The same in the other texels.
    pub alpha_elsewhere: f32,
    /// Largest error of the direction in degrees, where there is one.
    pub degrees: f32,
    /// Texels whose larger width became 1 because glTF has no larger one.
    pub clamped: u64,
}

/// What somebody asks for, or else the recipe, or else `default`; in the order they are written, each once.
pub fn formats(asked: &[Target], recipe: &Recipe, default: &[Target]) -> Vec<Target> {
    let mut formats = [asked, &recipe.targets, default]
        .into_iter()
        .find(|list| !list.is_empty())
        .unwrap_or_default()
        .to_vec();
    formats.sort_unstable();
    formats.dedup();
    formats
}

/// What follows the stem in the names of the files that these formats become, and of the recipe's copy.
pub fn suffixes(formats: &[Target]) -> Vec<&'static str> {
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

/// The depths of the PNG sets among these formats.
pub fn depths(formats: &[Target]) -> Vec<Depth> {
    let of = |format: &Target| match format {
        Target::Png8 => Some(Depth::Eight),
        Target::Png16 => Some(Depth::Sixteen),
        _ => None,
    };
    formats.iter().filter_map(of).collect()
}

/// That a recipe which somebody wrote is never written over.
pub fn yours_lies_there(folder: &Path, path: &Path) -> Error {
    Error::invalid(
        "the folder for the files",
        folder.display(),
        format!(
            "allowed: a folder without a {} of yours, since the recipe as it was used is written there",
            path.display()
        ),
    )
    .with_hint("Name another folder")
}

impl Job {
    /// Makes every file. Everything that can be refused is refused before the first is written.
    ///
    /// # Errors
    /// When the recipe, its mesh or one of its files cannot be used, a file that it reads or a recipe that somebody wrote
    /// would be written over, a file cannot be written, or the work is cancelled.
    pub fn make(&self, watch: &impl Watch) -> Result<Made> {
        self.make_on(None, watch)
    }

    /// The same on a mesh that is open already, in place of the one that the recipe names.
    ///
    /// # Errors
    /// As [`Job::make`].
    pub fn make_on(&self, open: Option<Mesh>, watch: &impl Watch) -> Result<Made> {
        let recipe = self.file.recipe();
        let files = self.file.files(self.allow_outside);
        let needs_mesh = [Target::Glb, Target::Gltf, Target::Preview];
        let mesh = match open {
            _ if !self.formats.iter().any(|f| needs_mesh.contains(f)) => None,
            None => Some(open_mesh(self.mesh.as_deref(), &self.file, &files)?),
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
        self.refuse_own_files(&files)?;
        make_folder(&self.folder)?;
        let (used, copies) = watch.stage("copying", |progress| self.used_recipe(progress))?;
        let (copy, mesh_word) = self.copy_of_recipe(&used)?;
        let mut made = Made::default();
        let (map, mended) = made.time("fill", || fill(&self.file, &files, watch))?;
        made.mended = mended;
        let info = info(recipe, mesh_word);
        let export = Export::new(&map, &info);
        for &format in &self.formats {
            watch.stage(format.name(), |progress| {
                progress.check()?;
                match (format, &mesh) {
                    (Target::Preview, Some(mesh)) => {
                        self.draw(&mut made, &map, mesh, &looks, progress)
                    }
                    (Target::Glb | Target::Gltf, Some(mesh)) => {
                        self.write_gltf(&mut made, &export, format, mesh)
                    }
                    _ => self.write_map(&mut made, &export, format, progress),
                }
            })?;
        }
        let depths = depths(&self.formats);
        if self.readme && !depths.is_empty() {
            made.files.push(write_readme(&self.folder, &depths)?);
        }
        if let Some(text) = copy {
            let path = self.path(".toml");
            made.files
                .push(write_atomic(&path, |f| f.write_all(text.as_bytes()))?);
        }
        for path in copies.keep() {
            let bytes = fs::metadata(&path).map_err(Error::read(&path))?.len();
            made.files.push(Written { path, bytes });
        }
        Ok(made)
    }

    /// Every file that it writes.
    pub fn paths(&self) -> Vec<PathBuf> {
        let mut paths: Vec<PathBuf> = suffixes(&self.formats)
            .into_iter()
            .map(|suffix| self.path(suffix))
            .collect();
        if self.readme && !depths(&self.formats).is_empty() {
            paths.push(self.folder.join(README));
        }
        paths
    }

    fn stem(&self) -> PathBuf {
        self.folder.join(&self.stem)
    }

    fn path(&self, suffix: &str) -> PathBuf {
        beside(&self.stem(), suffix)
    }

    /// Refuses to write over what the recipe is made of.
    fn refuse_own_files(&self, files: &Files) -> Result<()> {
        let folder = files.folder.clone().unwrap_or_default();
        let read: Vec<PathBuf> = self
            .file
            .recipe()
            .files()
            .map(|name| folder.join(name))
            .chain(
                self.mesh
                    .as_ref()
                    .map(|word| Projection::split(word).0.into()),
            )
            .flat_map(|path| {
                let beside = path.parent().unwrap_or(Path::new("")).to_owned();
                let needed = mesh::companions(&path).unwrap_or_default();
                let needed = needed.into_iter().map(move |file| beside.join(file));
                std::iter::once(path).chain(needed)
            })
            .filter_map(|path| path.canonicalize().ok())
            .filter(|path| path.is_file())
            .collect();
        let paths = self.paths();
        let own = paths
            .iter()
            .find(|path| path.canonicalize().is_ok_and(|p| read.contains(&p)));
        match own {
            None => Ok(()),
            Some(path) => Err(Error::invalid(
                "the folder for the files",
                self.folder.display(),
                format!(
                    "allowed: one where no file that the recipe reads is written over, as {} would be",
                    path.display()
                ),
            )
            .with_hint("Name another folder")),
        }
    }

    /// The recipe as it was used, with the mesh that it was used with, as a file of the maps' folder; with copies of what it
    /// reads where they are wanted, which go again unless they are kept.
    fn used_recipe(&self, progress: &Progress<'_>) -> Result<(RecipeFile, Copies)> {
        let (mut used, copies) = if self.copies {
            let files = self.file.files(self.allow_outside);
            let names = self.file.recipe().files();
            let wanted = || progress.check().is_ok();
            let (way, copies) = bring(
                &files,
                &BTreeMap::new(),
                names,
                &self.folder,
                &self.paths(),
                &wanted,
            )?;
            (self.file.moved_by(way.as_ref(), &self.folder), copies)
        } else {
            (self.file.moved(&self.folder)?, Copies::default())
        };
        if let Some(word) = &self.mesh {
            let word = if is_path(word) {
                let (file, projection) = Projection::split(word);
                let file = seen_from(&self.folder, Path::new(file))?;
                Projection::join(&file, projection)
            } else {
                word.clone()
            };
            used.set(&[("mesh", serde_json::Value::from(word).to_string())])?;
        }
        Ok((used, copies))
    }

    /// The text of the recipe to lie beside the maps, and the mesh in it; no text where just that lies there already. A
    /// recipe that somebody wrote is never written over.
    fn copy_of_recipe(&self, used: &RecipeFile) -> Result<(Option<String>, Option<String>)> {
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

    fn write_map(
        &self,
        made: &mut Made,
        export: &Export<'_>,
        format: Target,
        progress: &Progress<'_>,
    ) -> Result<()> {
        let stem = self.stem();
        let written = made.time(format.name(), || match format {
            Target::Exr => write_master_with(&self.path(".exr"), export, self.precision, progress)
                .map(|w| vec![w]),
            Target::RgbExr => {
                write_rgb_pair_with(&stem, export, self.precision, progress).map(Vec::from)
            }
            Target::Png8 => write_set_with(&stem, export, Depth::Eight, progress),
            _ => write_set_with(&stem, export, Depth::Sixteen, progress),
        })?;
        made.files.extend(written);
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
        made.files.extend(written);
        let round_trip = made.time("read back", || round_trip(&read, export.map(), &report))?;
        made.round_trip = Some(round_trip);
        Ok(())
    }

    fn draw(
        &self,
        made: &mut Made,
        map: &AnisoMap,
        mesh: &Mesh,
        looks: &[Look],
        progress: &Progress<'_>,
    ) -> Result<()> {
        let recipe = self.file.recipe();
        let subject = Subject {
            mesh,
            map,
            material: &recipe.material,
        };
        let scene = scene(mesh, Some(recipe));
        let size = Size::new(PICTURE.0, PICTURE.1)?;
        let written = made.time("preview", || {
            // A single look has no caption.
            let picture = if looks.len() == 1 {
                render(subject, &scene, looks, size, progress)?.swap_remove(0)
            } else {
                render_sheet(subject, &scene, looks, size, progress)?
            };
            write_picture(&self.path("_preview.png"), &picture)
        })?;
        made.files.push(written);
        Ok(())
    }
}

impl Made {
    fn time<T>(&mut self, what: &'static str, work: impl FnOnce() -> Result<T>) -> Result<T> {
        let started = Instant::now();
        let result = work()?;
        self.times.push((what, started.elapsed()));
        Ok(result)
    }
}

/// Makes the folder for the files, and those above it, where they are missing.
///
/// # Errors
/// [`Error::Write`] when it cannot be made, or is a file.
pub fn make_folder(folder: &Path) -> Result<()> {
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

/// The map of a recipe, at the recipe's size, and what reading its images had to change.
///
/// # Errors
/// When the recipe or one of its files cannot be used, with the place in its text, or the work is cancelled.
pub fn fill(file: &RecipeFile, files: &Files, watch: &impl Watch) -> Result<(AnisoMap, Mended)> {
    let recipe = file.recipe();
    let prepared = watch
        .stage("preparing", |progress| {
            recipe.prepare(recipe.size, files, progress)
        })
        .map_err(|e| file.explain(e))?;
    let map = watch.stage("filling", |progress| prepared.map(progress))?;
    Ok((map, prepared.mended()))
}

/// What files say about a recipe's map that was made for `mesh`, named as the files' folder names it.
pub fn info(recipe: &Recipe, mesh: Option<String>) -> MapInfo {
    let Material {
        diffuse,
        specular,
        ambient,
    } = recipe.material;
    MapInfo {
        name: recipe.name.clone(),
        aspect: recipe.aspect_at(recipe.size),
        mesh,
        material: Some(Reflectance {
            diffuse,
            specular,
            ambient,
        }),
    }
}

/// The mesh that somebody names, or else the recipe, or else [`MESH`].
///
/// # Errors
/// When it cannot be read; with the place in the recipe's text where that names it.
pub fn open_mesh(named: Option<&str>, file: &RecipeFile, files: &Files) -> Result<Mesh> {
    match (named, file.recipe().mesh.as_deref()) {
        (Some(word), _) => mesh::open(word),
        (None, Some(word)) => files.mesh("mesh", word).map_err(|e| file.explain(e)),
        (None, None) => mesh::open(MESH),
    }
}

/// The scene for a mesh, with what the recipe says of lights and exposure.
pub fn scene(mesh: &Mesh, recipe: Option<&Recipe>) -> Scene {
    let mut scene = Scene::for_mesh(mesh);
    if let Some(recipe) = recipe {
        let lights: Vec<Vec3> = recipe.scene.lights.iter().map(|l| Vec3::from(*l)).collect();
        if !lights.is_empty() {
            scene.set_directions(&lights);
        }
        scene.exposure = recipe.scene.exposure;
    }
    scene
}

/// The looks that somebody names, or else the recipe, or else Ward's with the map.
///
/// # Errors
/// When the recipe names a model that there is not.
pub fn looks(named: &[Look], recipe: Option<&Recipe>) -> Result<Vec<Look>> {
    if !named.is_empty() {
        return Ok(named.to_vec());
    }
    match recipe.map(|r| &r.scene.models) {
        Some(words) if !words.is_empty() => words.iter().map(|w| w.parse()).collect(),
        _ => Ok(vec![Look::default()]),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeSet;

    fn job(folder: &Path, text: &str, formats: &[Target]) -> Job {
        Job {
            file: RecipeFile::parse(text, "t.toml", Some(folder.to_owned())).unwrap(),
            folder: folder.to_owned(),
            stem: "x".to_owned(),
            formats: formats.to_vec(),
            precision: Precision::Half,
            mesh: None,
            allow_outside: false,
            readme: true,
            copies: false,
        }
    }

    #[test]
    fn every_file_of_every_format_is_known_before_it_is_written() {
        for format in Target::ALL {
            let folder = tempfile::tempdir().unwrap();
            let job = job(folder.path(), "version = 1\nsize = 4\n", &[format]);
            let made = job.make(&Unwatched).unwrap();
            let names = fs::read_dir(folder.path()).unwrap();
            let written: BTreeSet<PathBuf> = names.map(|e| e.unwrap().path()).collect();
            assert_eq!(
                written,
                job.paths().into_iter().collect(),
                "{}",
                format.name()
            );
            assert_eq!(written, made.files.into_iter().map(|f| f.path).collect());
        }
    }

    #[test]
    fn what_a_layer_reads_is_not_written_over() {
        let folder = tempfile::tempdir().unwrap();
        let text = "version = 1\nsize = 4\n";
        job(folder.path(), text, &[Target::Exr])
            .make(&Unwatched)
            .unwrap();
        let path = folder.path().join("x.exr");
        let before = fs::read(&path).unwrap();
        let text = "version = 1\nsize = 8\n[[layers]]\n[layers.image]\nfile = 'x.exr'\n";
        let error = job(folder.path(), text, &[Target::Exr])
            .make(&Unwatched)
            .unwrap_err();
        assert!(error.to_string().contains("x.exr would be"), "{error}");
        assert!(fs::read(&path).unwrap() == before);
        let other = Job {
            stem: "y".to_owned(),
            ..job(folder.path(), text, &[Target::Exr])
        };
        other.make(&Unwatched).unwrap();
    }

    #[test]
    fn the_copy_of_a_recipe_opens_where_it_lies() {
        let root = tempfile::tempdir().unwrap();
        let out = root.path().join("out");
        let text = "version = 1\nsize = 4\n";
        job(root.path(), text, &[Target::Exr])
            .make(&Unwatched)
            .unwrap();
        // The map that is read has the name of the one that is made.
        let text = "version = 1\nsize = 4\n[[layers]]\n[layers.image]\nfile = 'x.exr'\n";
        let job = Job {
            folder: out.clone(),
            copies: true,
            ..job(root.path(), text, &[Target::Exr])
        };
        for _ in 0..2 {
            job.make(&Unwatched).unwrap();
            let copy = RecipeFile::read(out.join("x.toml")).unwrap();
            assert!(!copy.names_outside(), "{}", copy.to_toml());
            fill(&copy, &copy.files(false), &Unwatched).unwrap();
        }
        let names = fs::read_dir(&out).unwrap();
        let mut names: Vec<_> = names.map(|e| e.unwrap().file_name()).collect();
        names.sort();
        assert_eq!(names, ["x.exr", "x.toml", "x_2.exr"]);
        // Without copies it names what it reads where that lies.
        fs::remove_dir_all(&out).unwrap();
        Job {
            copies: false,
            ..job
        }
        .make(&Unwatched)
        .unwrap();
        assert!(
            RecipeFile::read(out.join("x.toml"))
                .unwrap()
                .names_outside()
        );
    }

    #[test]
    fn work_that_is_cancelled_ends_inside_a_stage() {
        struct Stop(&'static str);
        impl Watch for Stop {
            fn stage<T>(
                &self,
                what: &'static str,
                work: impl FnOnce(&Progress<'_>) -> Result<T>,
            ) -> Result<T> {
                let go_on = |_: u64, _: u64| what != self.0;
                work(&Progress::new(&go_on))
            }
        }
        for stage in ["filling", "preview", "exr"] {
            let folder = tempfile::tempdir().unwrap();
            let job = job(
                folder.path(),
                "version = 1\nsize = 64\n",
                &[Target::Exr, Target::Preview],
            );
            let ended = job.make(&Stop(stage));
            assert!(matches!(ended, Err(Error::Cancelled)), "{stage}");
            assert!(!folder.path().join("x_preview.png").exists());
        }
    }
}
