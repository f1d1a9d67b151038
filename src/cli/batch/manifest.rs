//! The manifest of a batch: jobs, and what they cross.

use super::{FORMATS, folder_of};
use anisomap::generate::{formats, suffixes};
use anisomap::map::Size;
use anisomap::mesh;
use anisomap::recipe::{self, PRESETS, RecipeFile, Target, read_toml};
use anisomap::{Error, Result};
use serde::Deserialize;
use std::collections::{BTreeMap, HashMap, HashSet};
use std::path::{Path, PathBuf};
use std::sync::Arc;

const VERSION: u32 = 1;
/// The most values a range may have.
const STEPS_MAX: u32 = 10_000;
/// The longest name of an item in bytes; with its endings it must be a file's name.
const NAME_BYTES: usize = 160;

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Document {
    version: u32,
    jobs: Vec<JobTable>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct JobTable {
    recipe: Option<String>,
    #[serde(default)]
    recipes: Vec<String>,
    #[serde(default)]
    sizes: Vec<Sides>,
    #[serde(default)]
    seeds: Vec<i64>,
    #[serde(default)]
    formats: Vec<Target>,
    mesh: Option<String>,
    #[serde(default)]
    set: BTreeMap<String, toml::Value>,
    #[serde(default)]
    sweep: BTreeMap<String, Sweep>,
}

#[derive(Clone, Copy, Deserialize)]
#[serde(
    untagged,
    expecting = "N or [W, H], in texels, as in 1024 or [1000, 600]"
)]
enum Sides {
    Square(i64),
    Rectangle([i64; 2]),
}

#[derive(Deserialize)]
#[serde(
    untagged,
    expecting = "a list of values, or a range as in { from = 0.5, to = 2.0, steps = 4 }"
)]
enum Sweep {
    List(Vec<toml::Value>),
    Range(Range),
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Range {
    from: f64,
    to: f64,
    steps: u32,
}

/// A manifest whose numbers were checked and whose recipes were read.
pub(super) struct Manifest {
    items: Vec<Item>,
}

/// One map to be made.
#[derive(Clone)]
pub(super) struct Item {
    /// What its files' names begin with; no other item's is the same.
    pub(super) name: String,
    pub(super) formats: Vec<Target>,
    pub(super) mesh: Option<String>,
    source: Arc<Result<RecipeFile, String>>,
    overrides: Vec<(String, String)>,
}

impl Item {
    /// The recipe with this item's overrides, or why there is none.
    pub(super) fn recipe(&self) -> Result<RecipeFile, String> {
        let mut file = (*self.source).clone()?;
        file.set(&self.overrides).map_err(|e| e.to_string())?;
        Ok(file)
    }

    /// What the names of its files may end with.
    fn suffixes(&self) -> Vec<&'static str> {
        let formats = match &*self.source {
            // Overrides are tried when the item is made; until then one that names formats may name any.
            _ if self
                .overrides
                .iter()
                .any(|(key, _)| key.starts_with("targets")) =>
            {
                Target::ALL.to_vec()
            }
            Ok(file) => formats(&self.formats, file.recipe(), &FORMATS),
            Err(_) => FORMATS.to_vec(),
        };
        suffixes(&formats)
    }
}

impl Manifest {
    /// Reads a manifest and crosses its jobs. Recipes that cannot be used become items that fail, so that the rest is made.
    pub(super) fn read(path: &Path, limit: u64) -> Result<Self> {
        let document: Document = read_toml(path).map_err(|error| match RecipeFile::read(path) {
            Ok(_) => Error::file(path, "this is a recipe, not a manifest")
                .with_hint("Make it with `anisomap generate`, or name it in a manifest's [[jobs]]"),
            Err(_) => error,
        })?;
        if document.version != VERSION {
            let problem = format!("version is {}; allowed: {VERSION}", document.version);
            return Err(Error::file(path, problem));
        }
        let wrong = |i: usize, e: Error| Error::file(path, format!("jobs.{i}: {e}"));
        let jobs = document
            .jobs
            .into_iter()
            .enumerate()
            .map(|(i, table)| Crossed::new(table, path).map_err(|e| wrong(i, e)))
            .collect::<Result<Vec<_>>>()?;
        let count = jobs
            .iter()
            .fold(0u64, |n, job| n.saturating_add(job.count()));
        if count > limit {
            return Err(
                Error::file(path, format!("it asks for {count} maps; allowed: {limit}"))
                    .with_hint(format!("If that is meant, pass --limit {count}")),
            );
        }
        if count == 0 {
            return Err(Error::file(path, "it asks for no map at all")
                .with_hint("Name at least one recipe in a [[jobs]] table"));
        }
        let mut items: Vec<Item> = jobs.iter().flat_map(Crossed::items).collect();
        make_unique(&mut items);
        Ok(Self { items })
    }

    pub(super) fn items(self) -> Vec<Item> {
        self.items
    }
}

/// One value of one crossed key: its part of the name and its override.
#[derive(Clone)]
struct Choice {
    label: String,
    key: String,
    value: String,
}

/// A job ready to be crossed.
struct Crossed {
    recipes: Vec<(String, Arc<Result<RecipeFile, String>>)>,
    /// Every crossed key with its choices, in the order of the name.
    axes: Vec<Vec<Choice>>,
    fixed: Vec<(String, String)>,
    formats: Vec<Target>,
    mesh: Option<String>,
}

impl Crossed {
    fn new(table: JobTable, manifest: &Path) -> Result<Self> {
        let words = table.recipe.iter().chain(&table.recipes);
        let recipes = words.flat_map(|word| opened(word, manifest)).collect();
        let mut axes = Vec::new();
        if !table.sizes.is_empty() {
            axes.push(
                table
                    .sizes
                    .iter()
                    .map(|s| s.choice())
                    .collect::<Result<_>>()?,
            );
        }
        if !table.seeds.is_empty() {
            axes.push(
                table
                    .seeds
                    .iter()
                    .map(|s| seed_choice(*s))
                    .collect::<Result<_>>()?,
            );
        }
        for (key, sweep) in &table.sweep {
            axes.push(sweep.choices(key)?);
        }
        Ok(Self {
            recipes,
            axes,
            fixed: table
                .set
                .iter()
                .map(|(k, v)| (k.clone(), v.to_string()))
                .collect(),
            formats: table.formats,
            mesh: table.mesh.map(|w| mesh_word(&w, manifest)).transpose()?,
        })
    }

    fn count(&self) -> u64 {
        let lengths = self.axes.iter().map(|axis| axis.len() as u64);
        lengths.fold(self.recipes.len() as u64, u64::saturating_mul)
    }

    /// Every combination; the last axis changes fastest.
    fn items(&self) -> Vec<Item> {
        let mut combinations: Vec<Vec<&Choice>> = vec![Vec::new()];
        for axis in &self.axes {
            combinations = combinations
                .iter()
                .flat_map(|chosen| axis.iter().map(move |c| [chosen.as_slice(), &[c]].concat()))
                .collect();
        }
        let item = |(name, source): &(String, _), chosen: &Vec<&Choice>| Item {
            name: item_name(name, chosen),
            formats: self.formats.clone(),
            mesh: self.mesh.clone(),
            source: Arc::clone(source),
            overrides: self.overrides(chosen),
        };
        self.recipes
            .iter()
            .flat_map(|recipe| combinations.iter().map(move |chosen| item(recipe, chosen)))
            .collect()
    }

    fn overrides(&self, chosen: &[&Choice]) -> Vec<(String, String)> {
        let swept = chosen.iter().map(|c| (c.key.clone(), c.value.clone()));
        self.fixed.iter().cloned().chain(swept).collect()
    }
}

type Opened = (String, Arc<Result<RecipeFile, String>>);

/// The recipes that a word means, each with its name.
fn opened(word: &str, manifest: &Path) -> Vec<Opened> {
    if word == "*" {
        return PRESETS
            .iter()
            .flat_map(|p| opened(p.name, manifest))
            .collect();
    }
    let result = if word.contains(['/', '\\', '.']) {
        RecipeFile::read(folder_of(manifest).join(word))
    } else {
        recipe::open(word)
    };
    let stem = || {
        let stem = PathBuf::from(word)
            .file_stem()
            .map(|s| s.to_string_lossy().into_owned());
        safe(&stem.unwrap_or_default())
    };
    let name = match &result {
        Ok(file) => file.recipe().name.clone(),
        Err(_) => stem(),
    };
    vec![(name, Arc::new(result.map_err(|e| e.to_string())))]
}

/// The mesh that a word means, as a word that means it from the working directory. It is opened once, so that a wrong one is
/// told before anything is made.
fn mesh_word(word: &str, manifest: &Path) -> Result<String> {
    let word = if word.contains(['/', '\\', '.']) {
        let path = folder_of(manifest).join(word);
        path.into_os_string().into_string().map_err(|path| {
            Error::file(path, "its name is no Unicode")
                .with_hint("Rename the folder of the manifest")
        })?
    } else {
        word.to_owned()
    };
    match mesh::open(&word) {
        Err(Error::Invalid {
            value,
            allowed,
            hint,
            ..
        }) => Err(Error::Invalid {
            what: "mesh".to_owned(),
            value,
            allowed,
            hint,
        }),
        opened => opened.map(|_| word),
    }
}

impl Sides {
    fn choice(self) -> Result<Choice> {
        let [w, h] = match self {
            Self::Square(n) => [n, n],
            Self::Rectangle(sides) => sides,
        };
        // Through the words of --size, whose checks and messages these are.
        let size: Size = format!("{w}x{h}").parse()?;
        Ok(Choice {
            label: size.to_string(),
            key: "size".to_owned(),
            value: format!("[{w}, {h}]"),
        })
    }
}

fn seed_choice(seed: i64) -> Result<Choice> {
    if seed < 0 {
        return Err(Error::invalid(
            "seeds",
            seed,
            format!("allowed: 0 to {}", i64::MAX),
        ));
    }
    Ok(Choice {
        label: format!("seed{seed}"),
        key: "seed".to_owned(),
        value: seed.to_string(),
    })
}

impl Sweep {
    fn choices(&self, key: &str) -> Result<Vec<Choice>> {
        let choice = |value: String| Choice {
            label: format!("{key}={value}"),
            key: key.to_owned(),
            value,
        };
        match self {
            Self::List(values) if values.is_empty() => Err(Error::invalid(
                format!("sweep.{key}"),
                "an empty list",
                "allowed: at least one value",
            )),
            Self::List(values) => Ok(values.iter().map(|v| choice(v.to_string())).collect()),
            Self::Range(range) => Ok(range.values(key)?.map(|v| choice(v.to_string())).collect()),
        }
    }
}

impl Range {
    /// Both ends and what lies evenly between, to six digits: what stands in the file's name is what is used.
    fn values(&self, key: &str) -> Result<impl Iterator<Item = f64>> {
        let (from, to, steps) = (self.from, self.to, self.steps);
        if !(from.is_finite() && to.is_finite()) {
            return Err(Error::invalid(
                format!("sweep.{key}"),
                format!("{from} to {to}"),
                "allowed: finite numbers",
            ));
        }
        if !(1..=STEPS_MAX).contains(&steps) {
            return Err(Error::invalid(
                format!("sweep.{key}.steps"),
                steps,
                format!("allowed: 1 to {STEPS_MAX}"),
            ));
        }
        let last = f64::from((steps - 1).max(1));
        Ok((0..steps).map(move |i| six_digits(from + (to - from) * f64::from(i) / last)))
    }
}

fn six_digits(x: f64) -> f64 {
    format!("{x:.5e}").parse().unwrap_or(x)
}

fn item_name(recipe: &str, chosen: &[&Choice]) -> String {
    let mut name = recipe.to_owned();
    for choice in chosen {
        name += "-";
        name += &safe(&choice.label);
    }
    if name.len() <= NAME_BYTES {
        return name;
    }
    // Too long for a file's name: the beginning, and a number made of the whole.
    let hash = name.bytes().fold(0xcbf2_9ce4_8422_2325_u64, |h, b| {
        (h ^ u64::from(b)).wrapping_mul(0x0100_0000_01b3)
    });
    let end = (0..=NAME_BYTES - 17)
        .rev()
        .find(|i| name.is_char_boundary(*i))
        .unwrap_or(0);
    format!("{}~{hash:016x}", &name[..end])
}

/// Letters, digits and `.`, `_`, `=`, `-`; everything else is `_`. Quotes are left out.
fn safe(text: &str) -> String {
    let keep = |c: char| {
        if c.is_alphanumeric() || "._=-".contains(c) {
            c
        } else {
            '_'
        }
    };
    text.chars().filter(|c| *c != '"').map(keep).collect()
}

/// Gives items of which a file would be another's the endings -2, -3, ...: `x` with `x_alpha.exr` and an item called
/// `x_alpha` are such. Names are compared without case, as some file systems do.
fn make_unique(items: &mut [Item]) {
    let mut files: HashSet<String> = HashSet::new();
    let mut numbers: HashMap<String, u64> = HashMap::new();
    for item in items {
        let base = item.name.clone();
        let suffixes = item.suffixes();
        let names = |stem: &str| -> Vec<String> {
            let stem = stem.to_lowercase();
            suffixes.iter().map(|s| format!("{stem}{s}")).collect()
        };
        let n = numbers.entry(base.to_lowercase()).or_insert(1);
        let mut wanted = names(&item.name);
        while wanted.iter().any(|name| files.contains(name)) {
            *n += 1;
            item.name = format!("{base}-{n}");
            wanted = names(&item.name);
        }
        files.extend(wanted);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs;

    fn read(text: &str) -> Result<Manifest> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("m.toml");
        fs::write(&path, text).unwrap();
        for own in ["own", "own_alpha", "own_Alpha"] {
            fs::write(folder.path().join(format!("{own}.toml")), "version = 1").unwrap();
        }
        Manifest::read(&path, 1000)
    }

    fn names(text: &str) -> Vec<String> {
        read(text)
            .unwrap()
            .items()
            .into_iter()
            .map(|i| i.name)
            .collect()
    }

    #[test]
    fn jobs_are_crossed_and_named_after_what_they_name() {
        let text = "version = 1\n[[jobs]]\nrecipe = 'pot'\nsizes = [8, [16, 4]]\nseeds = [3]\n[jobs.sweep]\n'adjust.turn' = { from = 0, to = 1, steps = 3 }\nwrap = ['clamp']\n[[jobs]]\nrecipes = ['./own.toml', 'pot']";
        let names = names(text);
        assert_eq!(names.len(), 2 * 3 + 2);
        assert_eq!(names[1], "pot-8x8-seed3-adjust.turn=0.5-wrap=clamp");
        assert_eq!(names[3], "pot-16x4-seed3-adjust.turn=0-wrap=clamp");
        assert_eq!(names[6..], ["own", "pot"]);
    }

    #[test]
    fn names_are_never_the_same_twice() {
        let text = "version = 1\n[[jobs]]\nrecipes = ['pot', 'pot', 'pot']\n[jobs.sweep]\nname = ['a b', 'a+b']";
        let short = names(text);
        assert_eq!(
            short[..3],
            ["pot-name=a_b", "pot-name=a_b-2", "pot-name=a_b-3"]
        );
        let mut unique = short.clone();
        unique.sort();
        unique.dedup();
        assert_eq!(unique.len(), 6);
        let long = format!(
            "version = 1\n[[jobs]]\nrecipe = 'pot'\nsweep.name = ['{}', '{}b']",
            "a".repeat(400),
            "a".repeat(399)
        );
        let long = names(&long);
        assert!(long[0] != long[1] && long.iter().all(|n| n.len() <= NAME_BYTES));
    }

    #[test]
    fn files_are_never_the_same_twice() {
        let all = |recipes: &str| {
            let text = format!(
                "version = 1\n[[jobs]]\nrecipes = [{recipes}]\nformats = ['exr', 'rgb-exr']\n"
            );
            let mut files: Vec<String> = Vec::new();
            for item in read(&text).unwrap().items() {
                files.extend(item.suffixes().iter().map(|s| format!("{}{s}", item.name)));
            }
            files
        };
        for recipes in [
            "'./own.toml', './own_alpha.toml', './own_Alpha.toml'",
            "'./own_alpha.toml', './own.toml'",
        ] {
            let files = all(recipes);
            assert!(files.len() >= 7, "{files:?}");
            let mut unique: Vec<String> = files.iter().map(|f| f.to_lowercase()).collect();
            unique.sort();
            unique.dedup();
            assert_eq!(unique.len(), files.len(), "{files:?}");
        }
        let plain = names(
            "version = 1\n[[jobs]]\nrecipes = ['./own.toml', './own_alpha.toml']\nformats = ['exr']",
        );
        assert_eq!(plain, ["own", "own_alpha"], "nothing in the way");
    }

    #[test]
    fn ranges_are_round_numbers_with_both_ends() {
        let range = Range {
            from: 0.1,
            to: 0.7,
            steps: 4,
        };
        let values: Vec<f64> = range.values("x").unwrap().collect();
        assert_eq!(values, [0.1, 0.3, 0.5, 0.7]);
        let one = Range {
            from: 2.0,
            to: 9.0,
            steps: 1,
        };
        assert_eq!(one.values("x").unwrap().collect::<Vec<_>>(), [2.0]);
    }

    #[test]
    fn a_recipe_that_cannot_be_used_is_an_item_that_fails() {
        let items = read("version = 1\n[[jobs]]\nrecipes = ['pott', 'no/such.toml', 'pot']")
            .unwrap()
            .items();
        assert_eq!(items.len(), 3);
        assert!(
            items[0]
                .recipe()
                .unwrap_err()
                .contains("Did you mean `pot`?")
        );
        assert!(items[1].recipe().is_err() && items[2].recipe().is_ok());
    }

    #[test]
    fn a_manifest_that_makes_no_sense_is_refused() {
        for (text, words) in [
            (
                "version = 1\n[[jobs]]\nrecpie = 'pot'",
                "Did you mean `recipe`?",
            ),
            ("[[jobs]]\nrecipe = 'pot'", "version"),
            ("version = 3\n[[jobs]]\nrecipe = 'pot'", "version is 3"),
            ("version = 1\njobs = []", "no map"),
            (
                "version = 1\n[[jobs]]\nrecipe = 'pot'\nsizes = [0]",
                "jobs.0: size is 0x0",
            ),
            (
                "version = 1\n[[jobs]]\nrecipe = 'pot'\nsizes = ['big']",
                "N or [W, H]",
            ),
            (
                "version = 1\n[[jobs]]\nrecipe = 'pot'\nseeds = [-1]",
                "seeds is -1",
            ),
            (
                "version = 1\n[[jobs]]\nrecipe = 'pot'\nformats = ['exrr']",
                "Did you mean `exr`?",
            ),
            (
                "version = 1\n[[jobs]]\nrecipe = 'pot'\nsweep.size = 3",
                "a list of values",
            ),
            (
                "version = 1\n[[jobs]]\nrecipe = 'pot'\nsweep.x = []",
                "an empty list",
            ),
            (
                "version = 1\n[[jobs]]\nrecipe = 'pot'\nsweep.x = { from = 0, to = 1, steps = 0 }",
                "1 to 10000",
            ),
            (
                "version = 1\n[[jobs]]\nrecipe = 'pot'\n[jobs.sweep]\nx = { from = 0, to = 1, steps = 1000 }\ny = { from = 0, to = 1, steps = 1000 }",
                "asks for 1000000 maps; allowed: 1000",
            ),
        ] {
            let e = read(text)
                .err()
                .unwrap_or_else(|| panic!("{text}"))
                .to_string();
            assert!(e.contains(words), "no `{words}` in: {e}");
        }
    }
}
