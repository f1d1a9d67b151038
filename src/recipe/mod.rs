//! Recipes: what a map is made of, as plain data in a TOML file.
//!
//! A recipe is the document. A preset, a saved project and an entry of a batch are one format: layers from bottom to top,
//! each with one source (a pattern, guides or an image), an optional mask, an opacity and the channels it touches. Positions are
//! in UV or surface units, so that a recipe renders at any size; randomness comes only from the seeds in the file.
//!
//! [`RecipeFile`] reads, overrides and writes the text; [`Recipe::prepare`] and [`Prepared::fill`] make the map.

mod blend;
mod evaluate;
mod file;
mod files;
mod image;
mod layer;
mod left_out;
mod locate;
mod prepare;
mod presets;
mod shelf;
mod stamp;
mod stored;
mod update;

pub use evaluate::{Above, Unmasked};
pub(crate) use file::{BYTES_MAX, name_from};
pub use file::{RecipeFile, read_toml};
pub use files::{Files, seen_from};
pub(crate) use files::{Way, file_of_mesh, is_path, rename_files, rename_mesh};
pub use image::Image;
pub(crate) use layer::below;
pub use layer::{Blend, Channels, Layer, Mask, MaskSource, Source};
pub use left_out::LeftOut;
pub use prepare::Prepared;
pub use presets::{PRESETS, Preset, open, preset};
pub use stamp::Stamp;
pub use stored::{Radius, Stored, StoredWidth};

use crate::brdf::Model;
use crate::error::{Error, Result, in_range as number, nearest_word};
use crate::map::{Size, Wrap};
use serde::{Deserialize, Serialize};
use std::str::FromStr;

/// The version of the format that this library writes, and knows to the last key.
pub const VERSION: u32 = 1;
/// The most layers a recipe may have.
pub const LAYERS_MAX: usize = 256;
/// How many bytes a name may have.
const NAME_BYTES_MAX: usize = 64;
/// The largest seed: what TOML's integers hold.
pub const SEED_MAX: u64 = i64::MAX as u64;

/// What a map is made of.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Recipe {
    /// The version of the format; the only key that must be there. See [`VERSION`].
    pub version: u32,
    /// What it is called, and what files made from it are called. Default: the recipe file's own name.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub name: String,
    /// What it is, in one line.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub description: String,
    /// The map's size in texels when nobody asks for another: `1024` or `[2048, 512]`. Default 1024.
    #[serde(with = "layer::size", default = "default_size")]
    pub size: Size,
    /// Width over height, on the surface, of one turn of UV; 0.01 to 100. Default: the map's own pixel ratio.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub aspect: Option<f32>,
    /// What lies beyond the map's edge. Default `repeat`.
    #[serde(default)]
    pub wrap: Wrap,
    /// What all randomness comes from, 0 to 2^63 - 1. Default 0.
    #[serde(default, deserialize_with = "layer::seed")]
    pub seed: u64,
    /// The mesh it is made for: a built-in's name or a file. Default: the previewer's own.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub mesh: Option<String>,
    /// Formats to write when nobody asks for others. Default: all that [`Target::DEFAULT`] lists.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub targets: Vec<Target>,
    /// Colours.
    #[serde(default)]
    pub material: Material,
    /// Factors over the whole map, for sweeps.
    #[serde(default)]
    pub adjust: Adjust,
    /// How the preview shows it.
    #[serde(default, skip_serializing_if = "Scene::is_default")]
    pub scene: Scene,
    /// From bottom to top.
    #[serde(default)]
    pub layers: Vec<Layer>,
}

fn default_size() -> Size {
    Size::new(1024, 1024).expect("1024 is a size")
}

impl Default for Recipe {
    fn default() -> Self {
        Self {
            version: VERSION,
            name: String::new(),
            description: String::new(),
            size: default_size(),
            aspect: None,
            wrap: Wrap::default(),
            seed: 0,
            mesh: None,
            targets: Vec::new(),
            material: Material::default(),
            adjust: Adjust::default(),
            scene: Scene::default(),
            layers: Vec::new(),
        }
    }
}

/// The colours that no map holds, linear RGB.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Material {
    /// Diffuse reflectance, Ward's rho_d; 0 to 1 each.
    pub diffuse: [f32; 3],
    /// Specular reflectance, Ward's rho_s; 0 to 1 each.
    pub specular: [f32; 3],
    /// What it gives back of the ambient light, k_a; 0 to 1 each.
    pub ambient: [f32; 3],
}

impl Default for Material {
    /// Ward's lightly brushed aluminium (1992, table 1) without its colour, with a little ambient light.
    fn default() -> Self {
        Self {
            diffuse: [0.15; 3],
            specular: [0.19; 3],
            ambient: [0.15; 3],
        }
    }
}

/// What is done to the whole map after its layers: works on every recipe, so it is what sweeps reach for.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Adjust {
    /// Factor on alpha_x, 0.01 to 100.
    pub alpha_x: f32,
    /// Factor on alpha_y, 0.01 to 100.
    pub alpha_y: f32,
    /// Degrees by which every direction is turned counter-clockwise, -360 to 360.
    pub turn: f32,
}

impl Default for Adjust {
    fn default() -> Self {
        Self {
            alpha_x: 1.0,
            alpha_y: 1.0,
            turn: 0.0,
        }
    }
}

/// How the preview shows the recipe when nobody asks otherwise.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Scene {
    /// Models side by side, as `--model` names them. Default: `ward`.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub models: Vec<String>,
    /// Directions toward directional lights, y up; any length but zero. Default: the previewer's own.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub lights: Vec<[f32; 3]>,
    /// Exposure in stops, -16 to 16.
    pub exposure: f32,
}

impl Scene {
    fn is_default(&self) -> bool {
        *self == Self::default()
    }
}

/// A kind of file that a recipe becomes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Target {
    /// The master EXR.
    Exr,
    /// The two EXRs for programs that know only R, G, B.
    RgbExr,
    /// The PNG set, 8 bit.
    Png8,
    /// The PNG set, 16 bit.
    #[serde(alias = "png")]
    Png16,
    /// A mesh with the map, in one binary file.
    Glb,
    /// A mesh with the map, as glTF with its parts beside it.
    Gltf,
    /// A lit picture.
    Preview,
}

impl Target {
    /// Every target, in the order they are written.
    pub const ALL: [Self; 7] = [
        Self::Exr,
        Self::RgbExr,
        Self::Png8,
        Self::Png16,
        Self::Glb,
        Self::Gltf,
        Self::Preview,
    ];
    /// What is written when nobody chooses.
    pub const DEFAULT: [Self; 5] = [
        Self::Exr,
        Self::RgbExr,
        Self::Png16,
        Self::Glb,
        Self::Preview,
    ];

    /// The word for it in recipes and on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Self::Exr => "exr",
            Self::RgbExr => "rgb-exr",
            Self::Png8 => "png8",
            Self::Png16 => "png16",
            Self::Glb => "glb",
            Self::Gltf => "gltf",
            Self::Preview => "preview",
        }
    }
}

impl FromStr for Target {
    type Err = Error;

    /// The word of a target; `png` is `png16`.
    fn from_str(s: &str) -> Result<Self> {
        let word = if s == "png" { "png16" } else { s };
        Self::ALL
            .into_iter()
            .find(|t| t.name() == word)
            .ok_or_else(|| unknown_word("format", s, &Self::ALL.map(Self::name)))
    }
}

/// The error for a word that is none of `words`, with the nearest of them.
fn unknown_word(what: &str, word: &str, words: &[&str]) -> Error {
    let error = Error::invalid(
        what,
        format!("`{word}`"),
        format!("allowed: {}", words.join(", ")),
    );
    match nearest_word(word, words.iter().copied()) {
        Some(near) => error.with_hint(format!("Did you mean `{near}`?")),
        None => error,
    }
}

impl Recipe {
    /// The recipe's aspect, or the pixel ratio of a map of `size`.
    pub fn aspect_at(&self, size: Size) -> f32 {
        self.aspect
            .unwrap_or(size.width() as f32 / size.height() as f32)
    }

    /// Checks every number and word against what is allowed.
    ///
    /// # Errors
    /// [`Error::Invalid`] whose `what` is the whole key: `layers.0.brushed.angle`.
    pub fn check(&self) -> Result<()> {
        check_name(&self.name)?;
        if self.description.lines().count() > 1 {
            return Err(Error::invalid(
                "description",
                format!("{} lines long", self.description.lines().count()),
                "allowed: one line",
            ));
        }
        number("aspect", self.aspect.unwrap_or(1.0), 0.01..=100.0)?;
        check_seed("seed", self.seed)?;
        self.material.check()?;
        self.adjust.check()?;
        self.scene.check()?;
        self.check_layers()
    }

    /// Every file that it names: images, stored maps and meshes.
    pub(crate) fn files(&self) -> impl Iterator<Item = &str> {
        let mesh = self.mesh.iter().filter_map(|m| file_of_mesh(m));
        self.layers.iter().flat_map(Layer::files).chain(mesh)
    }

    fn check_layers(&self) -> Result<()> {
        if self.layers.len() > LAYERS_MAX {
            return Err(Error::invalid(
                "layers",
                format!("a list of {}", self.layers.len()),
                format!("allowed: at most {LAYERS_MAX}"),
            ));
        }
        for (i, layer) in self.layers.iter().enumerate() {
            layer.check(&format!("layers.{i}"))?;
            let same = |l: &&Layer| l.name() == layer.name();
            if self.layers[..i].iter().find(same).is_some() {
                return Err(Error::invalid(
                    format!("layers.{i}.name"),
                    format!("`{}`", layer.name()),
                    "allowed: a name that no other layer has, since a layer's randomness follows its name",
                )
                .with_hint("Give the layer a `name` of its own"));
            }
        }
        Ok(())
    }
}

/// A name becomes the name of files, so it must be harmless as one.
fn check_name(name: &str) -> Result<()> {
    let fine = name.len() <= NAME_BYTES_MAX
        && !name.starts_with(['.', '-', ' '])
        && !name.ends_with([' ', '.'])
        && name
            .chars()
            .all(|c| c.is_alphanumeric() || "._- ".contains(c));
    if fine {
        return Ok(());
    }
    Err(Error::invalid(
        "name",
        format!("{name:?}"),
        "allowed: letters, digits, spaces and `.`, `_`, `-`, 64 bytes at most (a letter outside ASCII has 2 to 4), beginning with a letter, a digit or `_`, since files are named after it",
    ))
}

impl Material {
    /// Checks every number.
    ///
    /// # Errors
    /// When one is not in 0 to 1.
    pub fn check(&self) -> Result<()> {
        for (key, colour) in [
            ("material.diffuse", self.diffuse),
            ("material.specular", self.specular),
            ("material.ambient", self.ambient),
        ] {
            colour
                .into_iter()
                .try_for_each(|c| number(key, c, 0.0..=1.0))?;
        }
        Ok(())
    }
}

impl Adjust {
    fn check(&self) -> Result<()> {
        number("adjust.alpha_x", self.alpha_x, 0.01..=100.0)?;
        number("adjust.alpha_y", self.alpha_y, 0.01..=100.0)?;
        number("adjust.turn", self.turn, -360.0..=360.0)
    }
}

impl Scene {
    fn check(&self) -> Result<()> {
        number("scene.exposure", self.exposure, -16.0..=16.0)?;
        for (i, word) in self.models.iter().enumerate() {
            let base = word.strip_suffix(":mean").unwrap_or(word);
            if base.parse::<Model>().is_err() {
                let names = Model::ALL.map(Model::name);
                return Err(unknown_word(&format!("scene.models.{i}"), word, &names));
            }
        }
        for (i, light) in self.lights.iter().enumerate() {
            let length = light.iter().map(|c| c * c).sum::<f32>();
            if !(length.is_finite() && length > 1e-12) {
                return Err(Error::invalid(
                    format!("scene.lights.{i}"),
                    format!("{light:?}"),
                    "allowed: a direction toward the light, not all zero",
                ));
            }
        }
        Ok(())
    }
}

fn check_seed(what: impl Into<String>, seed: u64) -> Result<()> {
    if seed <= SEED_MAX {
        return Ok(());
    }
    Err(Error::invalid(
        what,
        seed,
        format!("allowed: 0 to {SEED_MAX}"),
    ))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn targets_are_words() {
        for target in Target::ALL {
            assert_eq!(target.name().parse::<Target>().unwrap(), target);
            let quoted = toml::Value::try_from(target).unwrap();
            assert_eq!(quoted.as_str(), Some(target.name()));
        }
        assert_eq!("png".parse::<Target>().unwrap(), Target::Png16);
        let e = "rgb_exr".parse::<Target>().unwrap_err().to_string();
        assert!(e.contains("Did you mean `rgb-exr`"), "{e}");
    }

    #[test]
    fn both_ends_of_every_range_are_allowed() {
        let text = |aspect, factor, turn, stops| {
            format!(
                "version = 1\naspect = {aspect}\n[adjust]\nalpha_x = {factor}\nalpha_y = {factor}\nturn = {turn}\n[scene]\nexposure = {stops}\n"
            )
        };
        for good in [
            text("0.01", "0.01", "-360", "-16"),
            text("100", "100", "360", "16"),
        ] {
            RecipeFile::parse(&good, "t.toml", None).unwrap();
        }
        for bad in [text("0.0099", "1", "0", "0"), text("1", "100.01", "0", "0")] {
            assert!(RecipeFile::parse(&bad, "t.toml", None).is_err());
        }
    }

    #[test]
    fn names_that_would_leave_the_folder_are_refused() {
        for bad in ["../up", "a/b", ".hidden", "a\\b", "a\nb", "nul\0", "-o"] {
            assert!(check_name(bad).is_err(), "{bad:?}");
        }
        for good in [
            "brushed gold v1.2_a-b",
            "_x",
            &"a".repeat(64),
            &"\u{e4}".repeat(32),
        ] {
            assert!(check_name(good).is_ok(), "{good}");
        }
        let e = check_name(&"\u{e4}".repeat(33)).unwrap_err().to_string();
        assert!(
            e.contains("64 bytes") && e.contains("a digit or `_`"),
            "{e}"
        );
    }
}
