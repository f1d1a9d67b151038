//! A reduced map as files: a recipe that stands for it, and beside it what changes from texel to texel.

use super::form::{Kept, round_degrees};
use super::{Reduction, Shape};
use crate::convention::MapInfo;
use crate::convention::storage::Storage;
use crate::error::{Error, Result};
use crate::export::codes::write_codes;
use crate::export::exr::{Precision, write_master};
use crate::export::{Export, Written, beside, write_atomic};
use crate::map::Size;
use crate::pattern::{Constant, Pattern};
use crate::preview::Look;
use crate::progress::Progress;
use crate::recipe::{Adjust, Image, Layer, Recipe, RecipeFile, Source, Stored};
use std::io::{self, Write};
use std::path::{Path, PathBuf};

/// The first line of a reduced recipe, by which a later run knows that it may be replaced.
const MARK: &str = "# A reduced map, written by anisomap. Copy it before you change it.";

/// How the names of a set's files end: the recipe, the report beside it, and those that may hold texels.
const RECIPE: &str = ".reduced.toml";
/// The report, which whoever calls for it writes.
pub const REPORT: &str = ".reduced.json";
const WIDTHS: &str = ".reduced_widths.png";
const AXIS: &str = ".reduced_axis.png";
const FLOATS: &str = ".reduced.exr";

/// What was written.
#[derive(Debug)]
pub struct Saved {
    /// The recipe that stands for the reduced map.
    pub recipe: PathBuf,
    /// Every file, the recipe first.
    pub files: Vec<Written>,
    /// Bytes of the files that hold texels.
    pub map_bytes: u64,
}

/// A number of five digits.
pub(super) fn round(x: f32) -> f32 {
    format!("{x:.4e}").parse().unwrap_or(x)
}

impl Reduction {
    /// Writes `STEM.reduced.toml` and what it names, reads it back, and makes sure that the map in it is the one that was
    /// measured. `recipe` is what the full map was made of, or what is known of it: all but its layers is kept, and what files
    /// it names are named as from the new file's folder.
    ///
    /// # Errors
    /// [`Error::Write`] when a file cannot be written, [`Error::Invalid`] as [`check_output`]. What was written until then is
    /// removed, so that no half of a set can be read.
    pub fn write(&self, stem: &Path, recipe: &Recipe, aspect: f32) -> Result<Saved> {
        check_output(stem)?;
        clear(stem)?;
        self.write_set(stem, recipe, aspect).inspect_err(|_| {
            // The first error is the one to tell.
            let _ = clear(stem);
        })
    }

    fn write_set(&self, stem: &Path, recipe: &Recipe, aspect: f32) -> Result<Saved> {
        let path = beside(stem, RECIPE);
        let (source, maps) = self.kept.write(stem, recipe)?;
        let map_bytes = maps.iter().map(|f| f.bytes).sum();
        let reduced = Recipe {
            version: Recipe::default().version, // keys of a newer one are not in it
            size: self.size_of_recipe()?,
            aspect: Some(aspect),
            wrap: self.kept.map.wrap(),
            adjust: Adjust::default(),
            scene: self.scene(recipe),
            layers: vec![Layer::new(source)],
            ..recipe.clone()
        };
        let text = RecipeFile::new(reduced, &path)?.to_toml();
        let written = write_atomic(&path, |f| {
            f.write_all(format!("{MARK}\n{}\n{text}", self.told()).as_bytes())
        })?;
        self.verify(&path)?;
        Ok(Saved {
            recipe: path,
            files: [vec![written], maps].concat(),
            map_bytes,
        })
    }

    /// What a reader of the recipe should know.
    fn told(&self) -> String {
        format!("# Kept: {}.", self.kept.form)
    }

    /// A grid is read at its own size; a table is laid out at the full one.
    fn size_of_recipe(&self) -> Result<Size> {
        match self.kept.form.shape {
            Shape::Constant(_) => Size::new(1, 1),
            Shape::Radial(..) | Shape::Grid(_) => Ok(self.kept.map.size()),
        }
    }

    /// The recipe's scene with what the map was judged with, where that is not what the recipe shows.
    fn scene(&self, recipe: &Recipe) -> crate::recipe::Scene {
        let mut scene = recipe.scene.clone();
        let words: Vec<String> = self.looks.iter().map(Look::to_string).collect();
        let default = [Look::default().to_string()];
        if words != scene.models && !(scene.models.is_empty() && words == default) {
            scene.models = words;
        }
        scene
    }

    /// Reads what was written as anybody would, and compares it to the bit.
    fn verify(&self, path: &Path) -> Result<()> {
        let file = RecipeFile::read(path)?;
        let recipe = file.recipe();
        let prepared = recipe.prepare(recipe.size, &file.files(false), &Progress::none())?;
        let map = prepared.map(&Progress::none())?;
        if map == self.kept.map {
            return Ok(());
        }
        Err(
            Error::file(path, "what was read back is not the map that was measured").with_hint(
                "Something changed the files meanwhile, or the disk is at fault: run it again",
            ),
        )
    }
}

/// Whether a reduced map may be written as `STEM.reduced.toml` and what goes with it: where no file of these names lies, or a
/// recipe among them that an earlier reduction wrote.
///
/// # Errors
/// [`Error::Invalid`] when a file of somebody's own lies there, [`Error::Write`] when that cannot be told.
pub fn check_output(stem: &Path) -> Result<()> {
    let path = beside(stem, RECIPE);
    match std::fs::read(&path) {
        Ok(there) if there.starts_with(MARK.as_bytes()) => return Ok(()),
        Ok(_) => return Err(yours(&path)),
        Err(e) if e.kind() == io::ErrorKind::NotFound => {}
        Err(e) => return Err(Error::write(&path)(e)),
    }
    let others = [REPORT, WIDTHS, AXIS, FLOATS].map(|suffix| beside(stem, suffix));
    match others.iter().find(|path| path.symlink_metadata().is_ok()) {
        Some(path) => Err(yours(path)),
        None => Ok(()),
    }
}

/// That a file which no reduced recipe stands beside is never written over.
fn yours(path: &Path) -> Error {
    Error::invalid(
        "the output",
        path.display(),
        "allowed: a folder without a file of yours by that name",
    )
    .with_hint("Name another folder, or move the file away")
}

/// Removes a set, its recipe first: what is left halfway stands for nothing.
fn clear(stem: &Path) -> Result<()> {
    for suffix in [RECIPE, WIDTHS, AXIS, FLOATS, REPORT] {
        let path = beside(stem, suffix);
        match std::fs::remove_file(&path) {
            Err(e) if e.kind() != io::ErrorKind::NotFound => return Err(Error::write(&path)(e)),
            _ => {}
        }
    }
    Ok(())
}

impl Kept {
    /// Writes what changes from texel to texel, and gives the layer that stands for all of it.
    fn write(&self, stem: &Path, recipe: &Recipe) -> Result<(Source, Vec<Written>)> {
        if let Shape::Constant(texel) = self.form.shape {
            let constant = Constant {
                alpha_x: texel.alpha_x,
                alpha_y: texel.alpha_y,
                angle: round_degrees(texel.axis),
            };
            return Ok((Source::Pattern(Pattern::Constant(constant)), Vec::new()));
        }
        if !self.form.is_coded() {
            return self.write_floats(stem, recipe);
        }
        let mut stored = Stored {
            encoding: self.form.storage.widths.encoding,
            low: self.form.storage.widths.low,
            high: self.form.storage.widths.high,
            alpha_x: self.same.alpha_x,
            alpha_y: self.same.alpha_y,
            axis_encoding: self.form.storage.axis.encoding,
            angle: round_degrees(self.same.axis),
            ..Stored::default()
        };
        let size = match self.form.shape {
            Shape::Radial(radius, samples) => {
                stored.radial = Some(radius);
                Size::new(samples, 1)?
            }
            _ => self.map.size(),
        };
        let mut written = Vec::new();
        if let Some((numbers, codes)) = &self.widths {
            let path = beside(stem, WIDTHS);
            stored.widths = Some(name(&path)?);
            written.push(write_codes(&path, size, *numbers, codes)?);
        }
        if let Some(codes) = &self.axes {
            let path = beside(stem, AXIS);
            stored.axis = Some(name(&path)?);
            let numbers = self.form.storage.axis.encoding.numbers();
            written.push(write_codes(&path, size, numbers, codes)?);
        }
        Ok((Source::Stored(stored), written))
    }

    fn write_floats(&self, stem: &Path, recipe: &Recipe) -> Result<(Source, Vec<Written>)> {
        let path = beside(stem, FLOATS);
        let precision = if self.form.storage == Storage::FULL {
            Precision::Float
        } else {
            Precision::Half
        };
        let info = MapInfo {
            name: recipe.name.clone(),
            aspect: recipe.aspect_at(self.map.size()),
            ..MapInfo::default()
        };
        let map = self.unrounded.as_ref().unwrap_or(&self.map);
        let written = write_master(&path, &Export::new(map, &info), precision)?;
        let file = name(&path)?;
        Ok((Source::Image(Image::master(file)), vec![written]))
    }
}

/// The name of a file beside the recipe.
fn name(path: &Path) -> Result<String> {
    let name = path.file_name().and_then(|name| name.to_str());
    name.map(str::to_owned)
        .ok_or_else(|| Error::file(path, "a recipe cannot name it: its path is no Unicode"))
}
