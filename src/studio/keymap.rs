//! Which keys reach which [`Action`]: the defaults, and a file of the user's own over them.
//!
//! The file is TOML with one table, a word of an action and its keys on each line; an action that is not in it keeps its
//! default keys, an empty list takes them away:
//!
//! ```toml
//! [keys]
//! undo = "Ctrl+Z"
//! redo = ["Ctrl+Y", "Ctrl+Shift+Z"]
//! quit = []
//! ```

use super::action::{Action, Group};
use crate::error::{Error, Result, nearest_word};
use crate::export::write_atomic;
use crate::recipe::read_toml;
use serde::Deserialize;
use std::collections::BTreeMap;
use std::fmt;
use std::io::Write;
use std::path::Path;
use std::str::FromStr;

/// The keys that a chord may end in, by name. Letters and digits name themselves.
const NAMED: [&str; 40] = [
    "Space",
    "Enter",
    "Escape",
    "Tab",
    "Backspace",
    "Insert",
    "Delete",
    "Home",
    "End",
    "PageUp",
    "PageDown",
    "Up",
    "Down",
    "Left",
    "Right",
    "Minus",
    "Plus",
    "Equals",
    "Comma",
    "Period",
    "Semicolon",
    "Quote",
    "Slash",
    "Backslash",
    "Backtick",
    "OpenBracket",
    "CloseBracket",
    "Questionmark",
    "F1",
    "F2",
    "F3",
    "F4",
    "F5",
    "F6",
    "F7",
    "F8",
    "F9",
    "F10",
    "F11",
    "F12",
];
/// Keys that are shown, and may be written, as what stands on them.
const SIGNS: [(&str, &str); 12] = [
    ("[", "OpenBracket"),
    ("]", "CloseBracket"),
    ("-", "Minus"),
    ("=", "Equals"),
    (",", "Comma"),
    (".", "Period"),
    (";", "Semicolon"),
    ("'", "Quote"),
    ("/", "Slash"),
    ("\\", "Backslash"),
    ("`", "Backtick"),
    ("?", "Questionmark"),
];

/// A key with the modifiers that are held with it.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Chord {
    /// Ctrl, or Command on a Mac.
    pub ctrl: bool,
    /// Alt, or Option on a Mac.
    pub alt: bool,
    /// Shift.
    pub shift: bool,
    /// The name of the key: a capital letter, a digit, or a word such as `Home` and `OpenBracket`.
    pub key: String,
}

impl FromStr for Chord {
    type Err = Error;

    /// Reads `Ctrl+Shift+Z`, `F1`, `[`; modifiers in any order, in any case.
    fn from_str(text: &str) -> Result<Self> {
        let mut chord = Self {
            ctrl: false,
            alt: false,
            shift: false,
            key: String::new(),
        };
        let mut parts: Vec<&str> = text.split('+').map(str::trim).collect();
        let last = parts.pop().unwrap_or_default();
        for part in parts {
            match part.to_ascii_lowercase().as_str() {
                "ctrl" | "control" | "cmd" | "command" => chord.ctrl = true,
                "alt" | "option" => chord.alt = true,
                "shift" => chord.shift = true,
                _ => return Err(no_chord(text).with_hint("Modifiers are Ctrl, Alt and Shift")),
            }
        }
        chord.key = key_name(last).ok_or_else(|| {
            match nearest_word(last, NAMED).filter(|_| last.len() > 1) {
                Some(near) => no_chord(text).with_hint(format!("Did you mean `{near}`?")),
                None => no_chord(text),
            }
        })?;
        Ok(chord)
    }
}

fn no_chord(text: &str) -> Error {
    Error::invalid(
        "key",
        format!("`{text}`"),
        "allowed: a key after any of Ctrl+, Alt+ and Shift+, as in Ctrl+Z, F1, Home or [",
    )
}

/// The one spelling of a key, or `None` for a word that is none.
fn key_name(word: &str) -> Option<String> {
    if let Some((_, name)) = SIGNS.iter().find(|(sign, _)| *sign == word) {
        return Some((*name).to_owned());
    }
    if word.len() == 1 && word.as_bytes()[0].is_ascii_alphanumeric() {
        return Some(word.to_ascii_uppercase());
    }
    let named = NAMED.iter().find(|n| n.eq_ignore_ascii_case(word));
    named.map(|n| (*n).to_owned())
}

impl fmt::Display for Chord {
    /// As a menu shows it: `Ctrl+Shift+Z`, `[`.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (held, name) in [
            (self.ctrl, "Ctrl+"),
            (self.alt, "Alt+"),
            (self.shift, "Shift+"),
        ] {
            if held {
                f.write_str(name)?;
            }
        }
        let sign = SIGNS.iter().find(|(_, name)| *name == self.key);
        f.write_str(sign.map_or(self.key.as_str(), |(sign, _)| sign))
    }
}

/// Which keys reach which action. No chord reaches two.
#[derive(Clone, Debug, PartialEq)]
pub struct Keymap {
    actions: BTreeMap<Chord, Action>,
    /// Keys by action, in the order they were given, for menus.
    chords: BTreeMap<Action, Vec<Chord>>,
}

impl Default for Keymap {
    fn default() -> Self {
        let defaults = Action::ALL.iter().map(|a| (*a, default_chords(*a)));
        Self::new(defaults.collect()).expect("a test holds that the default keys are apart")
    }
}

fn default_chords(action: Action) -> Vec<Chord> {
    let read = |k: &&str| {
        k.parse()
            .expect("a test holds that the default keys are keys")
    };
    action.default_keys().iter().map(read).collect()
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Document {
    #[serde(default)]
    keys: BTreeMap<String, Keys>,
}

/// One key, or a list.
#[derive(Deserialize)]
#[serde(untagged)]
enum Keys {
    One(String),
    Many(Vec<String>),
}

impl Keys {
    fn chords(&self) -> Result<Vec<Chord>> {
        match self {
            Self::One(key) => Ok(vec![key.parse()?]),
            Self::Many(keys) => keys.iter().map(|k| k.parse()).collect(),
        }
    }
}

impl Keymap {
    fn new(chords: BTreeMap<Action, Vec<Chord>>) -> Result<Self> {
        let mut actions = BTreeMap::new();
        for (action, keys) in &chords {
            for chord in keys {
                if let Some(other) = actions
                    .insert(chord.clone(), *action)
                    .filter(|o| o != action)
                {
                    return Err(conflict(chord, *action, other));
                }
            }
        }
        Ok(Self { actions, chords })
    }

    /// Reads a keymap file over the defaults.
    ///
    /// # Errors
    /// [`Error::Read`]; [`Error::File`] when it is not TOML, names no action or no key, or gives one key to two actions, be
    /// one of them by default.
    pub fn load(path: &Path) -> Result<Self> {
        let document: Document = read_toml(path)?;
        Self::over_defaults(&document.keys).map_err(|error| Error::File {
            path: path.to_owned(),
            problem: error.to_string(),
            hint: None,
        })
    }

    fn over_defaults(given: &BTreeMap<String, Keys>) -> Result<Self> {
        let mut chords: BTreeMap<_, _> = Action::ALL
            .iter()
            .map(|a| (*a, default_chords(*a)))
            .collect();
        for (word, keys) in given {
            chords.insert(word.parse()?, keys.chords()?);
        }
        Self::new(chords)
    }

    /// Writes every action with its keys, by group, each with what it does.
    ///
    /// # Errors
    /// [`Error::Write`].
    pub fn save(&self, path: &Path) -> Result<()> {
        let text = self.to_toml();
        write_atomic(path, |out| out.write_all(text.as_bytes()))?;
        Ok(())
    }

    fn to_toml(&self) -> String {
        let mut text = String::from(
            "# Keys of the studio. A line that is taken out goes back to its default.\n[keys]\n",
        );
        for group in Group::ALL {
            text.push_str(&format!("\n# {}\n", group.name()));
            for action in Action::ALL.iter().filter(|a| a.group() == group) {
                let keys: Vec<String> = self
                    .chords(*action)
                    .iter()
                    .map(|c| format!("'{}'", c.written()))
                    .collect();
                text.push_str(&format!(
                    "{} = [{}] # {}\n",
                    action.word(),
                    keys.join(", "),
                    action.doc()
                ));
            }
        }
        text
    }

    /// The action that a chord reaches.
    pub fn action(&self, chord: &Chord) -> Option<Action> {
        self.actions.get(chord).copied()
    }

    /// The keys of an action, the first of them the one that menus show.
    pub fn chords(&self, action: Action) -> &[Chord] {
        self.chords.get(&action).map_or(&[], Vec::as_slice)
    }

    /// The keys of an action as text, `Ctrl+Y or Ctrl+Shift+Z`; empty where it has none.
    pub fn keys_text(&self, action: Action) -> String {
        let keys: Vec<String> = self.chords(action).iter().map(Chord::to_string).collect();
        keys.join(" or ")
    }

    /// What a tooltip says of an action: what it does, and its keys.
    pub fn tooltip(&self, action: Action) -> String {
        match self.keys_text(action) {
            keys if keys.is_empty() => format!("{}.", action.doc()),
            keys => format!("{} ({keys}).", action.doc()),
        }
    }
}

impl Chord {
    /// As the keymap file spells it: no sign that TOML would take for its own.
    fn written(&self) -> String {
        let plain = self.to_string();
        if plain.ends_with(['\'', '\\']) {
            return plain[..plain.len() - 1].to_owned() + &self.key;
        }
        plain
    }
}

fn conflict(chord: &Chord, action: Action, other: Action) -> Error {
    Error::invalid(
        format!("keys.{}", action.word()),
        format!("`{chord}`"),
        format!(
            "which `{}` has as well; allowed: each key once",
            other.word()
        ),
    )
    .with_hint(format!(
        "Give `{}` other keys, or none: {} = []",
        other.word(),
        other.word()
    ))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn load(text: &str) -> Result<Keymap, String> {
        let file = tempfile::NamedTempFile::new().unwrap();
        std::fs::write(file.path(), text).unwrap();
        Keymap::load(file.path()).map_err(|e| e.to_string())
    }

    #[test]
    fn every_default_key_reaches_its_action() {
        let keymap = Keymap::default();
        for action in Action::ALL {
            for key in action.default_keys() {
                assert_eq!(keymap.action(&key.parse().unwrap()), Some(*action), "{key}");
            }
        }
    }

    #[test]
    fn a_file_changes_what_it_names_and_leaves_the_rest() {
        let keymap =
            load("[keys]\nundo = 'ctrl + shift+u'\nredo = ['F5', '[']\nsize_down = []\n").unwrap();
        let reach = |k: &str| keymap.action(&k.parse().unwrap());
        assert_eq!(reach("Shift+Ctrl+U"), Some(Action::Undo));
        assert_eq!(reach("Ctrl+Z"), None);
        assert_eq!(reach("OpenBracket"), Some(Action::Redo));
        assert_eq!(reach("Ctrl+S"), Some(Action::Save));
        assert_eq!(keymap.keys_text(Action::Redo), "F5 or [");
    }

    #[test]
    fn mistakes_are_told_with_what_to_do() {
        let e = load("[keys]\nundoo = 'F5'").unwrap_err();
        assert!(e.contains("Did you mean `undo`"), "{e}");
        let e = load("[keys]\nundo = 'Ctrl+Hoome'").unwrap_err();
        assert!(e.contains("Did you mean `Home`"), "{e}");
        let e = load("[keys]\nundo = 'Hyper+Z'").unwrap_err();
        assert!(e.contains("Ctrl, Alt and Shift"), "{e}");
        let e = load("[keys]\nundo = 'Ctrl+S'").unwrap_err();
        assert!(
            e.contains("undo") && e.contains("`save`") && e.contains("save = []"),
            "{e}"
        );
        assert!(load("[keys]\nundo = 3").is_err());
        assert!(load("[kyes]\n").is_err());
        assert!(load("[keys]\nundo = ''").is_err());
        assert!(load("[keys").is_err());
    }

    #[test]
    fn what_is_written_reads_back() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("keys.toml");
        let keymap = load("[keys]\nundo = ['\\', \"'\", 'Ctrl+Shift+`']").unwrap_or_default();
        keymap.save(&path).unwrap();
        assert_eq!(Keymap::load(&path).unwrap(), keymap);
    }
}
