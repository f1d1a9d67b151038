//! A reduced map as files: a recipe that stands for it, and beside it what changes from texel to texel.

use super::form::{Kept, round_degrees};
use super::{Axes, Channels, Reduction, Shape, Widths};
use crate::convention::storage::{Codes, Depth, WidthStorage};
use crate::convention::{Content, MapInfo, MapRecord};
use crate::error::{Error, Result};
use crate::export::codes::write_codes;
use crate::export::exr::{Precision, write_master, write_part};
use crate::export::{Export, Written, beside, write_atomic};
use crate::map::Size;
use crate::pattern::{Constant, Pattern};
use crate::preview::Look;
use crate::progress::Progress;
use crate::recipe::{Adjust, Image, Layer, Recipe, RecipeFile, Source, Stored, StoredWidth};
use std::io::{self, Write};
use std::path::{Path, PathBuf};

/// The first line of a reduced recipe, by which a later run knows that it may be replaced.
const MARK: &str = "# A reduced map, written by anisomap. Copy it before you change it.";

/// How the names of a set's files end: the recipe, the report beside it, and those that may hold texels.
const RECIPE: &str = ".reduced.toml";
/// The report, which whoever calls for it writes.
pub const REPORT: &str = ".reduced.json";
/// The whole map in floats.
const MASTER: &str = ".reduced.exr";
/// Codes, in PNG files, and floats, in OpenEXR files, of one channel or the axis each.
const PARTS: [&str; 4] = ["widths", "alpha_x", "alpha_y", "axis"];

/// How the name of a part's file ends.
fn part(what: &str, ending: &str) -> String {
    format!(".reduced_{what}.{ending}")
}

/// How the names of all files end, but for the recipe's.
fn others() -> Vec<String> {
    let parts = PARTS
        .iter()
        .flat_map(|what| ["png", "exr"].map(|ending| part(what, ending)));
    let whole = [MASTER, REPORT].map(str::to_owned);
    parts.chain(whole).collect()
}

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
    let mut others = others().into_iter().map(|suffix| beside(stem, &suffix));
    match others.find(|path| path.symlink_metadata().is_ok()) {
        Some(path) => Err(yours(&path)),
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
    for suffix in std::iter::once(RECIPE.to_owned()).chain(others()) {
        let path = beside(stem, &suffix);
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
        let info = MapInfo {
            name: recipe.name.clone(),
            aspect: recipe.aspect_at(self.map.size()),
            ..MapInfo::default()
        };
        match self.form.master() {
            Some(depth) => self.write_master(stem, &info, depth),
            None => self.write_parts(stem, &info),
        }
    }

    fn write_master(
        &self,
        stem: &Path,
        info: &MapInfo,
        depth: Depth,
    ) -> Result<(Source, Vec<Written>)> {
        let path = beside(stem, MASTER);
        let export = Export::new(self.numbers(), info);
        let written = write_master(&path, &export, precision(depth))?;
        Ok((Source::Image(Image::master(name(&path)?)), vec![written]))
    }

    /// A file for each width, or for both where they are one, and one for the axis.
    fn write_parts(&self, stem: &Path, info: &MapInfo) -> Result<(Source, Vec<Written>)> {
        let Channels { x, y, axis } = self.form.channels;
        let numbers = self.numbers();
        let mut stored = Stored {
            alpha_x: self.same.alpha_x,
            alpha_y: self.same.alpha_y,
            axis_encoding: axis.encoding,
            angle: round_degrees(self.same.axis),
            radial: match self.form.shape {
                Shape::Radial(radius, _) => Some(radius),
                _ => None,
            },
            ..Stored::default()
        };
        let mut parts = Parts {
            stem,
            size: numbers.size(),
            record: MapRecord::new(Content::Part, info, numbers.wrap()),
            written: Vec::new(),
        };
        let mut width = |what: &str, channel: &str, storage: WidthStorage, plane: &[f32]| {
            let depth = (storage.depth, 1);
            let file = parts.write(what, depth, &[(channel, plane)], || storage.pack(plane))?;
            Ok::<_, Error>(StoredWidth {
                file,
                encoding: storage.encoding,
                low: storage.low,
                high: storage.high,
            })
        };
        let widths = self.form.widths;
        if widths == Widths::Round {
            let both = width("widths", "alpha", x, numbers.alpha_x())?;
            (stored.encoding, stored.low, stored.high) = (both.encoding, both.low, both.high);
            stored.widths = Some(both.file);
        } else {
            if widths.keep_x() {
                stored.x = Some(width("alpha_x", "alpha.X", x, numbers.alpha_x())?);
            }
            if widths.keep_y() {
                stored.y = Some(width("alpha_y", "alpha.Y", y, numbers.alpha_y())?);
            }
        }
        if self.form.axes == Axes::Each {
            let (cos2, sin2) = (numbers.cos2(), numbers.sin2());
            let channels = [("axis.X", cos2), ("axis.Y", sin2)];
            let depth = (axis.depth, axis.encoding.numbers());
            let file = parts.write("axis", depth, &channels, || axis.pack(cos2, sin2))?;
            stored.axis = Some(file);
        }
        Ok((Source::Stored(stored), parts.written))
    }
}

fn precision(depth: Depth) -> Precision {
    match depth {
        Depth::F32 => Precision::Float,
        _ => Precision::Half,
    }
}

/// The files of a set that hold its numbers.
struct Parts<'a> {
    stem: &'a Path,
    size: Size,
    record: MapRecord,
    written: Vec<Written>,
}

impl Parts<'_> {
    /// Writes channels of this depth, `numbers` of them: codes as a PNG, floats as OpenEXR. Gives the file's name.
    fn write(
        &mut self,
        what: &str,
        (depth, numbers): (Depth, usize),
        channels: &[(&str, &[f32])],
        codes: impl FnOnce() -> Codes,
    ) -> Result<String> {
        let is_coded = depth.top().is_some();
        let ending = if is_coded { "png" } else { "exr" };
        let path = beside(self.stem, &part(what, ending));
        self.written.push(if is_coded {
            write_codes(&path, self.size, numbers, &codes())?
        } else {
            let record = self.record.clone();
            write_part(&path, self.size, channels, record, precision(depth))?
        });
        name(&path)
    }
}

/// The name of a file beside the recipe.
fn name(path: &Path) -> Result<String> {
    let name = path.file_name().and_then(|name| name.to_str());
    name.map(str::to_owned)
        .ok_or_else(|| Error::file(path, "a recipe cannot name it: its path is no Unicode"))
}
