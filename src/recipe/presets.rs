//! The recipes that come with the tool.

use super::RecipeFile;
use crate::error::{Error, Result, nearest_word};
use std::path::PathBuf;

/// A recipe that comes with the tool.
#[derive(Clone, Copy, Debug)]
pub struct Preset {
    /// Its name.
    pub name: &'static str,
    /// Its text.
    pub text: &'static str,
}

/// The preset in `presets/NAME.toml`.
macro_rules! preset_file {
    ($name:literal) => {
        Preset {
            name: $name,
            text: include_str!(concat!("../../presets/", $name, ".toml")),
        }
    };
}

/// Every preset, in the order of their names.
pub const PRESETS: &[Preset] = &[
    preset_file!("brushed_aluminium"),
    preset_file!("brushed_aluminium_coarse"),
    preset_file!("canvas"),
    preset_file!("compact_disc"),
    preset_file!("cross_brushed_plate"),
    preset_file!("flower_medallion"),
    preset_file!("gold_watch_face"),
    preset_file!("lathe_cut_steel"),
    preset_file!("lightly_brushed_aluminium"),
    preset_file!("pot"),
    preset_file!("rolled_aluminium"),
    preset_file!("rolled_brass"),
    preset_file!("satin"),
    preset_file!("scratched_steel"),
    preset_file!("spun_copper"),
    preset_file!("turned_disc"),
    preset_file!("twill"),
    preset_file!("varnished_wood"),
    preset_file!("vinyl_record"),
];

impl Preset {
    /// What it is, in one line: the recipe's `description`, read from the text without the rest.
    pub fn description(&self) -> &'static str {
        let line = self.text.lines().find(|l| l.starts_with("description"));
        line.and_then(|l| l.split('"').nth(1)).unwrap_or_default()
    }

    /// The recipe. It may name no files.
    ///
    /// # Errors
    /// None for the presets that come with the tool; a test reads them all.
    pub fn recipe(&self) -> Result<RecipeFile> {
        RecipeFile::parse(
            self.text,
            PathBuf::from(format!("preset {}", self.name)),
            None,
        )
    }
}

/// The preset called `name`.
///
/// # Errors
/// [`Error::Invalid`] with the nearest name.
pub fn preset(name: &str) -> Result<&'static Preset> {
    named(name, "allowed: a name that `anisomap presets` lists")
}

fn named(name: &str, allowed: &str) -> Result<&'static Preset> {
    PRESETS.iter().find(|p| p.name == name).ok_or_else(|| {
        let names = PRESETS.iter().map(|p| p.name);
        let error = Error::invalid("the preset", format!("`{name}`"), allowed);
        match nearest_word(name, names) {
            Some(near) => error.with_hint(format!("Did you mean `{near}`?")),
            None => error,
        }
    })
}

/// The recipe that a word means: a path where it has a slash or a dot, or else a preset.
///
/// # Errors
/// As [`RecipeFile::read`] and [`preset`].
pub fn open(word: &str) -> Result<RecipeFile> {
    if word.contains(['/', '\\', '.']) {
        RecipeFile::read(word)
    } else {
        let allowed =
            "allowed: a name that `anisomap presets` lists, or a path, which has a slash or a dot";
        named(word, allowed)?.recipe()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeSet;
    use std::fs;
    use std::path::Path;

    #[test]
    fn the_table_is_the_folder() {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("presets");
        let entries = fs::read_dir(folder).into_iter().flatten();
        let files: BTreeSet<String> = entries
            .map(|e| e.unwrap().path())
            .filter(|p| p.extension().is_some_and(|e| e == "toml"))
            .map(|p| p.file_stem().unwrap().to_string_lossy().into_owned())
            .collect();
        let table: Vec<_> = PRESETS.iter().map(|p| p.name.to_owned()).collect();
        assert_eq!(
            table,
            files.into_iter().collect::<Vec<_>>(),
            "in order of names"
        );
    }

    #[test]
    fn every_preset_reads_is_named_after_its_file_and_says_what_it_is() {
        for preset in PRESETS {
            let file = preset.recipe().unwrap();
            assert_eq!(file.recipe().name, preset.name);
            assert_eq!(file.recipe().description, preset.description());
            assert!(preset.description().len() > 10, "{}", preset.name);
            assert!(file.ignored().is_empty());
        }
    }

    #[test]
    fn a_path_has_a_slash_or_a_dot() {
        assert!(matches!(open("x.toml"), Err(Error::Read { .. })));
        assert!(matches!(open("a/b"), Err(Error::Read { .. })));
        assert!(matches!(
            open("nothing_like_it"),
            Err(Error::Invalid { .. })
        ));
    }
}
