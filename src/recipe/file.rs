//! The text of a recipe: read strictly, overridden key by key, and written back with every comment in its place.

use super::files::{Way, leaves_folder};
use super::locate::{Mistake, join, layer_number, table_at};
use super::stamp::Stamp;
use super::update::{document_of, update};
use super::{Files, NAME_BYTES_MAX, Recipe, VERSION};
use crate::error::{Error, Result};
use serde::Deserialize;
use std::fs;
use std::path::{Path, PathBuf};
use toml_edit::{Array, Document, DocumentMut, Item, Table, TableLike, Value};

/// The largest recipe that is read or saved, in bytes: a million strokes of fifty points fit, a film renamed to `.toml`
/// does not.
pub(crate) const BYTES_MAX: u64 = 256 << 20;
/// The most unknown keys that a newer file may have: each costs one more reading.
const IGNORED_MAX: usize = 200;
/// The most bytes that all those readings together may take: a second's work.
const REREAD_MAX: usize = 256 << 20;
/// The deepest key that an override may name.
const DEPTH_MAX: usize = 16;

/// A recipe with its text.
#[derive(Clone, Debug)]
pub struct RecipeFile {
    recipe: Recipe,
    document: DocumentMut,
    path: PathBuf,
    folder: Option<PathBuf>,
    ignored: Vec<String>,
    /// The file's own, from before it was read.
    stamp: Option<Stamp>,
}

impl RecipeFile {
    /// Reads a recipe.
    ///
    /// # Errors
    /// [`Error::Read`] when it cannot be read; [`Error::File`] with line, key, value and what is allowed when its content
    /// cannot be used.
    pub fn read(path: impl AsRef<Path>) -> Result<Self> {
        let path = path.as_ref();
        let (text, stamp) = read_text(path)?;
        let parent = path.parent().filter(|p| !p.as_os_str().is_empty());
        let folder = parent.unwrap_or(Path::new(".")).to_owned();
        let file = Self::parse(&text, path, Some(folder))?;
        Ok(Self { stamp, ..file })
    }

    /// A recipe that has no text yet. It may name no files until it has a folder.
    ///
    /// # Errors
    /// When the recipe does not check.
    pub fn new(recipe: Recipe, path: impl AsRef<Path>) -> Result<Self> {
        recipe.check()?;
        Ok(Self {
            document: document_of(&recipe),
            recipe,
            path: path.as_ref().to_owned(),
            folder: None,
            ignored: Vec::new(),
            stamp: None,
        })
    }

    /// A recipe from its text. `path` is what messages call it; without a `folder` the recipe may name no files.
    ///
    /// # Errors
    /// [`Error::File`] with line, key, value and what is allowed.
    pub fn parse(text: &str, path: impl AsRef<Path>, folder: Option<PathBuf>) -> Result<Self> {
        let path = path.as_ref();
        let (mut recipe, ignored) = understand(text).map_err(|m| m.in_file(path))?;
        if recipe.name.is_empty() {
            recipe.name = name_from(path);
        }
        Ok(Self {
            recipe,
            document: text.parse().expect("parsed before"),
            path: path.to_owned(),
            folder,
            ignored,
            stamp: None,
        })
    }

    /// What the text says.
    pub fn recipe(&self) -> &Recipe {
        &self.recipe
    }

    /// What messages call it: its path, or `preset pot`.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Its file's stamp when it was read, which tells whether the file was changed since; `None` when it was not read from one.
    pub fn stamp(&self) -> Option<Stamp> {
        self.stamp
    }

    /// The keys that a newer file has and this version does not know. They are kept in the text.
    pub fn ignored(&self) -> &[String] {
        &self.ignored
    }

    /// Whether the file is of a newer version and must not be written over.
    pub fn is_read_only(&self) -> bool {
        self.recipe.version > VERSION
    }

    /// Where the recipe's own files are looked for.
    pub fn files(&self, allow_outside: bool) -> Files {
        Files {
            folder: self.folder.clone(),
            allow_outside,
        }
    }

    /// The text, with what was overridden and with every comment.
    pub fn to_toml(&self) -> String {
        self.document.to_string()
    }

    /// Gives keys other values: all of them, then one check of the whole. A key is a path with dots; a layer is meant by
    /// its number or its name. A value is TOML; what is no TOML is taken as text.
    ///
    /// # Errors
    /// [`Error::Invalid`] that names the override, with what is allowed. The recipe then stays as it was.
    pub fn set<K: AsRef<str>, V: AsRef<str>>(&mut self, overrides: &[(K, V)]) -> Result<()> {
        if overrides.is_empty() {
            return Ok(());
        }
        let mut document = self.document.clone();
        let mut keys = Vec::new();
        for (key, value) in overrides {
            let (key, value) = (key.as_ref(), value.as_ref());
            let put = put(document.as_table_mut(), key, parse_value(value));
            keys.push((put.map_err(|e| in_override(key, value, &e))?, key, value));
        }
        let text = document.to_string();
        let (mut recipe, ignored) = understand(&text).map_err(|m| blame(&keys, m, &self.path))?;
        if recipe.name.is_empty() {
            recipe.name = name_from(&self.path);
        }
        self.recipe = recipe;
        self.ignored = ignored;
        self.document = document;
        Ok(())
    }

    /// The same recipe as a file of another folder: the mesh and images that it names are named by the way to them from
    /// there. What is not there keeps its name, and so does everything in a file of a newer version.
    ///
    /// # Errors
    /// [`Error::Read`] when `folder` is not there.
    pub fn moved(&self, folder: &Path) -> Result<Self> {
        let way = Way::between(self.folder.as_deref(), folder)?;
        Ok(self.moved_by(way.as_ref(), folder))
    }

    /// As [`RecipeFile::moved`], on a way that may have taken files along.
    pub(crate) fn moved_by(&self, way: Option<&Way>, folder: &Path) -> Self {
        let mut moved = self.clone();
        moved.folder = Some(folder.to_owned());
        if let Some(way) = way.filter(|_| !self.is_read_only()) {
            way.of_recipe(&mut moved.recipe);
            update(moved.document.as_table_mut(), &self.recipe, &moved.recipe);
        }
        moved
    }

    /// The same recipe as the file at `path`, in the folder it is in.
    #[must_use]
    pub fn saved_as(self, path: impl AsRef<Path>) -> Self {
        Self {
            path: path.as_ref().to_owned(),
            ..self
        }
    }

    /// A recipe of this version that says what is understood of this one: of a file of this version the same, of a newer one
    /// without the keys in [`RecipeFile::ignored`] and without its comments.
    #[must_use]
    pub fn understood(&self) -> Self {
        if !self.is_read_only() {
            return self.clone();
        }
        let recipe = Recipe {
            version: VERSION,
            ..self.recipe.clone()
        };
        Self {
            document: document_of(&recipe),
            recipe,
            ignored: Vec::new(),
            ..self.clone()
        }
    }

    /// Whether it names a file outside its own folder, which `--allow-outside` is needed for.
    pub fn names_outside(&self) -> bool {
        self.recipe.files().any(leaves_folder)
    }

    /// An error about a key of the recipe, told with its file and line; any other as it is.
    pub fn explain(&self, error: Error) -> Error {
        let text = self.to_toml();
        match (error, Document::parse(text.as_str())) {
            (error @ Error::Invalid { .. }, Ok(document)) => {
                Mistake::of_value(&document, error).in_file(&self.path)
            }
            (error, _) => error,
        }
    }

    /// Takes over a changed recipe: only the keys whose values differ are touched in the text.
    ///
    /// # Errors
    /// When the file is of a newer version (it would lose what this one does not know), or the recipe does not check.
    pub fn update(&mut self, recipe: Recipe) -> Result<()> {
        if self.is_read_only() {
            let problem = format!("of version {}, newer than {VERSION}", self.recipe.version);
            return Err(Error::file(&self.path, problem).with_hint("Save it under another name"));
        }
        recipe.check()?;
        update(self.document.as_table_mut(), &self.recipe, &recipe);
        self.recipe = recipe;
        Ok(())
    }
}

/// Any other document of the tool's, read as strictly as a recipe: a mistake is told with file, line, key, what is allowed
/// and the nearest word.
///
/// # Errors
/// [`Error::Read`] and [`Error::File`].
pub fn read_toml<T: serde::de::DeserializeOwned>(path: &Path) -> Result<T> {
    let (text, _) = read_text(path)?;
    let document =
        Document::parse(text.as_str()).map_err(|e| Mistake::of_syntax(&text, &e).in_file(path))?;
    T::deserialize(toml_edit::de::Deserializer::from(document.clone()))
        .map_err(|e| Mistake::of_shape(&document, &e).in_file(path))
}

/// A text of bounded length, and the stamp of its file from before it was read.
fn read_text(path: &Path) -> Result<(String, Option<Stamp>)> {
    let meta = fs::metadata(path).map_err(Error::read(path))?;
    if !meta.is_file() {
        let kind = if meta.is_dir() {
            "a folder"
        } else {
            "no plain file"
        };
        return Err(Error::file(path, format!("this is {kind}")).with_hint("Name a .toml file"));
    }
    if meta.len() > BYTES_MAX {
        let problem = format!("{} bytes long; allowed: {BYTES_MAX}", meta.len());
        return Err(Error::file(path, problem));
    }
    let bytes = fs::read(path).map_err(Error::read(path))?;
    if bytes.is_empty() {
        return Err(Error::file(path, "the file is empty"));
    }
    match String::from_utf8(bytes) {
        Ok(text) => Ok((text, Stamp::told(&meta))),
        Err(_) => Err(
            Error::file(path, "this is no text (UTF-8), so it is no TOML")
                .with_hint("Name a .toml file"),
        ),
    }
}

/// A name made of a file's own, with what a name may not have replaced.
pub(crate) fn name_from(path: &Path) -> String {
    let stem = path.file_stem().unwrap_or_default().to_string_lossy();
    let safe = |c: char| {
        if c.is_alphanumeric() || "._-".contains(c) {
            c
        } else {
            '_'
        }
    };
    let mut name = String::new();
    for c in stem.chars().map(safe) {
        if name.len() + c.len_utf8() > NAME_BYTES_MAX {
            break;
        }
        name.push(c);
    }
    let name = name.trim_matches(['.', '-', '_']);
    if name.is_empty() {
        "recipe".to_owned()
    } else {
        name.to_owned()
    }
}

/// The recipe in a text, and the keys that had to be passed over because the text is of a newer version.
fn understand(text: &str) -> std::result::Result<(Recipe, Vec<String>), Mistake> {
    let document = Document::parse(text).map_err(|e| Mistake::of_syntax(text, &e))?;
    match version(&document)? {
        v if v <= VERSION => Ok((strict(&document)?, Vec::new())),
        _ => lenient(text),
    }
}

/// The version alone, before anything else is believed.
fn version(document: &Document<&str>) -> std::result::Result<u32, Mistake> {
    let found = document.get("version");
    let number = found.and_then(Item::as_integer);
    if let Some(v) = number
        .and_then(|v| u32::try_from(v).ok())
        .filter(|v| *v > 0)
    {
        return Ok(v);
    }
    let value = found.map_or(String::new(), |v| v.to_string().trim().to_owned());
    let error = Error::invalid("version", value, "allowed: 1 and later whole numbers");
    let mut mistake = Mistake::of_value(document, error);
    if found.is_none() {
        mistake.text = "the recipe does not say its version".to_owned();
        mistake.hint = Some(format!("Write `version = {VERSION}` as its first line"));
    }
    Err(mistake)
}

fn strict(document: &Document<&str>) -> std::result::Result<Recipe, Mistake> {
    let reader = toml_edit::de::Deserializer::from(document.clone());
    let recipe = Recipe::deserialize(reader).map_err(|e| Mistake::of_shape(document, &e))?;
    match recipe.check() {
        Ok(()) => Ok(recipe),
        Err(e) => Err(Mistake::of_value(document, e)),
    }
}

/// Reads what it knows, taking away one unknown key after the other.
fn lenient(text: &str) -> std::result::Result<(Recipe, Vec<String>), Mistake> {
    let mut text = text.to_owned();
    let mut ignored = Vec::new();
    loop {
        let document = Document::parse(text.as_str()).map_err(|e| Mistake::of_syntax(&text, &e))?;
        let mistake = match strict(&document) {
            Ok(recipe) => return Ok((recipe, ignored)),
            Err(mistake) => mistake,
        };
        let mut shorter = document.clone().into_mut();
        if ignored.len() == IGNORED_MAX.min(REREAD_MAX / text.len().max(1)) {
            let text = format!(
                "more than {} keys are not known to this version, too many for a file of this length",
                ignored.len()
            );
            return Err(Mistake { text, ..mistake });
        }
        if !mistake.unknown || !take_away(shorter.as_table_mut(), &mistake.path) {
            return Err(mistake);
        }
        ignored.push(mistake.path);
        text = shorter.to_string();
    }
}

/// Removes the key, table or list item at a path; `false` when there is none.
fn take_away(root: &mut Table, path: &str) -> bool {
    let parts: Vec<&str> = path.split('.').collect();
    let Some((last, parents)) = parts.split_last() else {
        return false;
    };
    if let Some((list, above)) = parents.split_last()
        && let Ok(table) = table_at(root, above)
        && let Some(item) = table.get_mut(list)
        && let Ok(n) = last.parse::<usize>()
    {
        match item {
            Item::ArrayOfTables(tables) if n < tables.len() => {
                tables.remove(n);
                return true;
            }
            Item::Value(Value::Array(items)) if n < items.len() => {
                items.remove(n);
                return true;
            }
            _ => {}
        }
    }
    table_at(root, parents).is_ok_and(|table| table.remove(last).is_some())
}

/// TOML, or text where it is none: `0.3`, `true`, `[1, 2]`, `repeat_u`.
fn parse_value(text: &str) -> Value {
    text.trim()
        .parse::<Value>()
        .unwrap_or_else(|_| Value::from(text))
}

/// Puts a value at a key; gives back the key with numbers for names.
fn put(root: &mut Table, key: &str, value: Value) -> Result<String> {
    let parts: Vec<&str> = key.split('.').collect();
    let fine = parts.len() <= DEPTH_MAX && parts.iter().all(|p| !p.trim().is_empty());
    let Some((last, parents)) = parts.split_last().filter(|_| fine) else {
        return Err(Error::invalid(
            "the key",
            format!("`{key}`"),
            "allowed: words with dots between, as in adjust.alpha_y",
        ));
    };
    if let Some((list, above)) = parents.split_last()
        && let Ok(n) = last.parse::<usize>()
        && let Some(items) = table_at(root, above)?
            .get_mut(list)
            .and_then(Item::as_array_mut)
    {
        return put_element(items, n, value).map(|()| key.to_owned());
    }
    let resolved = resolved(root, &parts);
    let table = table_at(root, parents)?;
    replace(table, last, value);
    Ok(resolved)
}

fn put_element(items: &mut Array, n: usize, value: Value) -> Result<()> {
    if n >= items.len() {
        return Err(Error::invalid(
            "the place in the list",
            n,
            format!("allowed: 0 to {}", items.len().saturating_sub(1)),
        ));
    }
    items.replace(n, value);
    Ok(())
}

/// The path with the numbers of layers in place of their names, as mistakes will name it.
fn resolved(root: &Table, parts: &[&str]) -> String {
    let mut out = String::new();
    let is_layer = parts.len() > 1 && parts[0] == "layers" && parts[1].parse::<usize>().is_err();
    for (i, part) in parts.iter().enumerate() {
        let number = (is_layer && i == 1)
            .then(|| layer_number(root, part))
            .flatten();
        out = join(&out, &number.map_or((*part).to_owned(), |n| n.to_string()));
    }
    out
}

/// Sets a key, keeping the spaces and the comment around the value that was there.
fn replace(table: &mut dyn TableLike, key: &str, mut value: Value) {
    match table.get_mut(key) {
        Some(Item::Value(old)) => {
            *value.decor_mut() = old.decor().clone();
            *old = value;
        }
        Some(item) => *item = Item::Value(value),
        None => {
            table.insert(key, Item::Value(value));
        }
    }
}

fn in_override(key: &str, value: &str, error: &Error) -> Error {
    Error::invalid(
        format!("--set {key}={value}"),
        "not possible",
        error.to_string(),
    )
}

/// The mistake as an error of the override it is about, or of the last one.
fn blame(keys: &[(String, &str, &str)], mistake: Mistake, path: &Path) -> Error {
    let about = |(resolved, _, _): &&(String, &str, &str)| {
        mistake.path == *resolved
            || mistake.path.starts_with(&format!("{resolved}."))
            || resolved.starts_with(&format!("{}.", mistake.path))
    };
    let Some((_, key, value)) = keys.iter().find(about).or(keys.last()) else {
        return mistake.in_file(path);
    };
    let error = Error::invalid(format!("--set {key}={value}"), "not possible", mistake.text);
    match mistake.hint {
        Some(hint) => error.with_hint(hint),
        None => error,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const GOOD: &str = "# head\nversion = 1 # first\nname = \"two\"\nsize = 64\n\n[[layers]]\nname = \"base\"\n# on the alpha\nconstant.alpha_x = 0.1 # narrow\n\n[[layers]]\nopacity = 0.5\n[layers.constant]\nangle = 30\n";

    fn parse(text: &str) -> Result<RecipeFile> {
        RecipeFile::parse(text, "t.toml", None)
    }

    fn fails(text: &str, words: &[&str]) {
        let e = parse(text).expect_err(text);
        assert_eq!(e.exit_code(), 2);
        for word in words {
            assert!(e.to_string().contains(word), "no `{word}` in: {e}");
        }
        assert!(!e.to_string().contains('\n'), "{e}");
    }

    #[test]
    fn mistakes_name_file_line_key_value_and_the_nearest_word() {
        fails(
            "size = 3",
            &["t.toml", "does not say its version", "`version = 1`"],
        );
        fails("version = 'x'", &["line 1", "version is \"x\""]);
        fails("version = 1\nsize = = 2", &["line 2", "no TOML"]);
        fails(
            "version = 1\nsiez = 2",
            &["line 2", "`siez`", "Did you mean `size`?"],
        );
        fails(
            "version = 1\n\nwrap = 'repaet'",
            &["line 3", "wrap is `repaet`", "`repeat`"],
        );
        fails(
            "version = 1\nsize = 'big'",
            &["line 2", "size", "\"big\"", "N or [W, H]"],
        );
        fails("version = 1\nsize = 0", &["line 2", "0x0", "1 to 32768"]);
        fails(
            "version = 1\nsize = 1000000000",
            &["line 2", "1000000000x", "1 to 32768"],
        );
        fails("version = 1\nsize = -5", &["line 2", "-5x-5"]);
        fails(
            "version = 1\nseed = -1",
            &["line 2", "seed is the integer `-1`", "from 0 to"],
        );
        fails(
            "version = 1\naspect = nan",
            &["line 2", "aspect is NaN", "0.01 to 100"],
        );
        fails(
            "version = 1\nname = '../x'",
            &["line 2", "name is \"../x\""],
        );
        fails(
            "version = 1\n[adjust]\nalpha_x = 0",
            &["line 3", "adjust.alpha_x is 0", "0.01 to 100"],
        );
        fails(
            "version = 1\n[material]\ndiffuse = [1, 2, 0]",
            &["line 3", "material.diffuse is 2"],
        );
        fails(
            "version = 1\n[material]\ndiffuse = [1, 0]",
            &["line 3", "material.diffuse"],
        );
        fails(
            "version = 1\n[scene]\nmodels = ['wrad']",
            &["line 3", "scene.models.0", "`ward`"],
        );
        fails(
            "version = 1\n[scene]\nlights = [[0, 0, 0]]",
            &["line 3", "scene.lights.0"],
        );
        fails(
            "version = 1\n[[layers]]\nname = 'x'",
            &["line 2", "layers.0", "has no source"],
        );
        fails(
            "version = 1\n[[layers]]\n[layers.constnat]",
            &["line 3", "`constnat`", "Did you mean `constant`?"],
        );
        fails(
            "version = 1\n[[layers]]\n[layers.constant]\nalpha_x = 0.0",
            &["line 4", "layers.0.constant.alpha_x is 0", "0.001 to 1.5"],
        );
        fails(
            "version = 1\n[[layers]]\n[layers.constant]\nalpha_x = nan",
            &["line 4", "layers.0.constant.alpha_x is NaN"],
        );
        fails(
            "version = 1\n[[layers]]\n[layers.constant]\nalpha_x = 'wide'",
            &[
                "line 4",
                "layers.0.constant.alpha_x",
                "\"wide\"",
                "a number",
            ],
        );
        fails(
            "version = 1\n[[layers]]\n[layers.pot]\nbands = 5000000000",
            &["line 4", "bands", "a whole number from 0 to 200"],
        );
        fails(
            "version = 1\n[[layers]]\n[layers.mask.weave]\nwarp.twist = 'x'\n[layers.constant]",
            &["line 4", "warp.twist", "a number from -60 to 60"],
        );
        fails(
            "version = 1\n[[layers]]\nconstant = {}\n[[layers]]\nconstant = {}",
            &["layers.1.name", "`constant`", "a `name` of its own"],
        );
    }

    #[test]
    fn a_recipe_without_a_name_has_that_of_its_file() {
        assert_eq!(parse("version = 1").unwrap().recipe().name, "t");
        assert_eq!(name_from(Path::new("/a/.we?ird .toml")), "we_ird");
        assert_eq!(name_from(Path::new("/")), "recipe");
    }

    #[test]
    fn a_newer_file_opens_read_only_and_lists_what_it_ignores() {
        let text = "version = 2\nglow = 3\nsize = 8\n[[layers]]\nblend = 'mix'\n[layers.hologram]\nx = 1\n[[layers]]\nblend = 'screen'\n[layers.constant]\nshine = 4\nalpha_x = 0.3\n";
        let mut file = parse(text).unwrap();
        assert_eq!(file.recipe().size.width(), 8);
        assert_eq!(file.recipe().layers.len(), 1);
        let ignored = file.ignored().join(" ");
        for key in ["glow", "layers.0.hologram", "blend", "shine"] {
            assert!(ignored.contains(key), "{key} in {ignored}");
        }
        assert!(file.is_read_only());
        assert_eq!(file.to_toml(), text, "nothing is lost from the text");
        let recipe = file.recipe().clone();
        assert!(file.update(recipe).is_err());
        fails("version = 2\nsize = 0", &["line 2"]);
        let many: String = (0..500).map(|i| format!("k{i} = 1\n")).collect();
        fails(&format!("version = 2\n{many}"), &["more than 200 keys"]);
        // A long one costs more at each reading, so fewer are passed over.
        let long = format!("version = 2\n{many}# {}\n", "x".repeat(30 << 20));
        fails(&long, &["more than 8 keys"]);
    }

    #[test]
    fn overrides_reach_every_key_and_keep_comments() {
        let mut file = parse(GOOD).unwrap();
        let set = [
            ("adjust.alpha_y", "2"),
            ("layers.base.constant.alpha_x", "0.4"),
            ("layers.1.opacity", "0.25"),
            ("layers.constant.constant.angle", "45"),
            ("material.diffuse", "[0.1, 0.2, 0.3]"),
            ("wrap", "clamp"),
            ("size", "[32, 16]"),
        ];
        file.set(&set).unwrap();
        let recipe = file.recipe();
        assert_eq!(recipe.adjust.alpha_y, 2.0);
        assert_eq!(recipe.size.to_string(), "32x16");
        assert_eq!(recipe.layers[1].opacity, 0.25);
        let text = file.to_toml();
        for kept in [
            "# head",
            "version = 1 # first",
            "# on the alpha",
            "alpha_x = 0.4 # narrow",
        ] {
            assert!(text.contains(kept), "`{kept}` in:\n{text}");
        }
        assert_eq!(parse(&text).unwrap().recipe(), file.recipe());
        file.set(&[("material.diffuse.1", "0.5")]).unwrap();
        assert_eq!(file.recipe().material.diffuse, [0.1, 0.5, 0.3]);
    }

    #[test]
    fn bad_overrides_say_so_and_change_nothing() {
        let file = parse(GOOD).unwrap();
        let fails = |set: &[(&str, &str)], words: &[&str]| {
            let mut copy = file.clone();
            let e = copy.set(set).unwrap_err().to_string();
            for word in words {
                assert!(e.contains(word), "no `{word}` in: {e}");
            }
            assert!(!e.contains("line "), "an override has no line: {e}");
            assert_eq!(
                (copy.recipe(), copy.to_toml()),
                (file.recipe(), file.to_toml())
            );
        };
        fails(
            &[("sized", "3")],
            &[
                "--set sized=3",
                "unknown key `sized`",
                "Did you mean `size`?",
            ],
        );
        fails(
            &[("adjust.alpha_y", "0")],
            &["--set adjust.alpha_y=0", "0.01 to 100"],
        );
        fails(&[("seed", "-4")], &["--set seed=-4", "from 0 to"]);
        fails(
            &[("layers.2.opacity", "1")],
            &["`2`", "0 to 1", "base, constant"],
        );
        fails(&[("layers.bass.opacity", "1")], &["Did you mean `base`?"]);
        fails(
            &[("layers.base.constant.alpha_x", "nan")],
            &["--set layers.base.constant.alpha_x=nan"],
        );
        fails(
            &[("layers.base.opacity", "much"), ("size", "8")],
            &["--set layers.base.opacity=much", "a number"],
        );
        fails(&[("name.x", "1")], &["not a table"]);
        fails(&[("layers.0", "3")], &["layers.0", "layers.0.opacity"]);
        fails(&[("size", "[8, 8, 8]")], &["size is a list of 3", "[W, H]"]);
        fails(&[("size", "[8]")], &["size is a list of 1"]);
        fails(&[("", "1")], &["words with dots"]);
        let deep = ["a"; 100_000].join(".");
        fails(&[(deep.as_str(), "1")], &["words with dots"]);
        fails(
            &[
                ("material.diffuse", "[0, 0, 0]"),
                ("material.diffuse.3", "1"),
            ],
            &["0 to 2"],
        );
        fails(
            &[("material.diffuse.3", "1")],
            &["material.diffuse is a table", "3 numbers"],
        );
    }

    #[test]
    fn a_moved_recipe_names_the_same_files() {
        let root = tempfile::tempdir().unwrap();
        let path = |name: &str| root.path().join(name);
        fs::create_dir(path("mine")).unwrap();
        fs::create_dir(path("out")).unwrap();
        fs::write(path("mine/a.exr"), "x").unwrap();
        fs::write(path("mine/lid.obj"), "x").unwrap();
        for layers in [
            "[[layers]] # kept\nimage.file = 'a.exr' # too\n[[layers]]\nname = 'b'\nimage.file = 'no.exr'\n",
            "layers = [{ image = { file = 'a.exr' } }, { name = 'b', image = { file = 'no.exr' } }]\n# kept\n",
        ] {
            let text = format!("version = 1\nmesh = 'lid.obj'\n{layers}");
            fs::write(path("mine/r.toml"), &text).unwrap();
            let file = RecipeFile::read(path("mine/r.toml")).unwrap();
            assert!(!file.names_outside());
            assert_eq!(file.moved(&path("mine")).unwrap().to_toml(), text);
            let moved = file.moved(&path("out")).unwrap();
            let text = moved.to_toml();
            for part in ["../mine/lid.obj", "../mine/a.exr", "no.exr"] {
                assert!(text.contains(part), "no {part} in {text}");
            }
            assert!(moved.names_outside());
            let back = RecipeFile::parse(&text, "r.toml", Some(path("out"))).unwrap();
            assert_eq!(back.recipe(), moved.recipe());
        }
    }

    #[test]
    fn folders_missing_files_and_bytes_are_refused() {
        let folder = tempfile::tempdir().unwrap();
        let e = RecipeFile::read(folder.path()).unwrap_err();
        assert!(e.to_string().contains("folder"), "{e}");
        let missing = RecipeFile::read(folder.path().join("no.toml")).unwrap_err();
        assert_eq!(missing.exit_code(), 2);
        let path = folder.path().join("b.toml");
        fs::write(&path, [0xff, 0xfe, 0]).unwrap();
        assert!(
            RecipeFile::read(&path)
                .unwrap_err()
                .to_string()
                .contains("UTF-8")
        );
    }
}
