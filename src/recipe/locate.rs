//! Where in a recipe's text a mistake stands, and how it is told.

use super::layer::{LAYER_SOURCES, NO_SOURCE};
use crate::error::{Error, nearest_word};
use crate::pattern::Pattern;
use std::ops::Range;
use toml_edit::{Document, Item, Table, TableLike, Value};

/// One step of a key's path.
pub(super) fn join(path: &str, part: &str) -> String {
    if path.is_empty() {
        part.to_owned()
    } else {
        format!("{path}.{part}")
    }
}

/// The line, from 1, of a byte of the text.
pub(super) fn line_of(text: &str, at: usize) -> usize {
    1 + text.as_bytes()[..at.min(text.len())]
        .iter()
        .filter(|b| **b == b'\n')
        .count()
}

/// What may stand at a path: the key that leads there (list items have none) and the text of the value.
struct Place {
    path: String,
    key: Option<Range<usize>>,
    value: Option<Range<usize>>,
}

/// Every place of a document, outer ones first.
fn places(document: &Document<&str>) -> Vec<Place> {
    let mut found = Vec::new();
    walk_table(document.as_table(), "", &mut found);
    found
}

fn walk_table(table: &dyn TableLike, path: &str, found: &mut Vec<Place>) {
    for (name, item) in table.iter() {
        let key = table.key(name).and_then(toml_edit::Key::span);
        walk_item(item, join(path, name), key, found);
    }
}

fn walk_item(item: &Item, path: String, key: Option<Range<usize>>, found: &mut Vec<Place>) {
    found.push(Place {
        path: path.clone(),
        key,
        value: item.span(),
    });
    match item {
        Item::Table(table) => walk_table(table, &path, found),
        Item::ArrayOfTables(tables) => {
            for (i, table) in tables.iter().enumerate() {
                let path = join(&path, &i.to_string());
                found.push(Place {
                    path: path.clone(),
                    key: None,
                    value: table.span(),
                });
                walk_table(table, &path, found);
            }
        }
        Item::Value(value) => walk_value(value, &path, found),
        Item::None => {}
    }
}

fn walk_value(value: &Value, path: &str, found: &mut Vec<Place>) {
    match value {
        Value::InlineTable(table) => walk_table(table, path, found),
        Value::Array(items) => {
            for (i, item) in items.iter().enumerate() {
                let path = join(path, &i.to_string());
                found.push(Place {
                    path: path.clone(),
                    key: None,
                    value: item.span(),
                });
                walk_value(item, &path, found);
            }
        }
        _ => {}
    }
}

/// The path of the key or value that has exactly this span, or else one that holds it; the innermost each time.
pub(super) fn path_at(document: &Document<&str>, span: &Range<usize>) -> String {
    let holds = |r: &Option<Range<usize>>| {
        r.as_ref()
            .is_some_and(|r| r.start <= span.start && span.end <= r.end)
    };
    let is = |r: &Option<Range<usize>>| r.as_ref() == Some(span);
    let mut places = places(document);
    let exact = places.iter().rposition(|p| is(&p.key) || is(&p.value));
    let inner = exact.or_else(|| {
        places
            .iter()
            .rposition(|p| holds(&p.key) || holds(&p.value))
    });
    inner.map_or(String::new(), |i| places.swap_remove(i).path)
}

/// The line on which a path stands, or the nearest place above it that is in the file.
pub(super) fn line_of_path(document: &Document<&str>, path: &str) -> Option<usize> {
    let places = places(document);
    let mut path = path;
    loop {
        let here = places.iter().find(|p| p.path == path);
        if let Some(span) = here.and_then(|p| p.value.clone().or(p.key.clone())) {
            // The key's own line, where there is one: a value may begin further down.
            let start = here.and_then(|p| p.key.clone()).unwrap_or(span).start;
            return Some(line_of(document.raw(), start));
        }
        path = path.rsplit_once('.')?.0;
    }
}

/// A mistake with the key it is about, where that is known; `text` is a whole clause.
#[derive(Debug)]
pub(super) struct Mistake {
    /// The key's path; empty for the document as a whole.
    pub path: String,
    /// The line in the text.
    pub line: Option<usize>,
    /// What is wrong and what is allowed.
    pub text: String,
    /// What to do.
    pub hint: Option<String>,
    /// Whether a reader that knows less than the file may pass over the key.
    pub unknown: bool,
}

impl Mistake {
    /// The text is no TOML.
    pub(super) fn of_syntax(text: &str, error: &toml_edit::TomlError) -> Self {
        Self {
            path: String::new(),
            line: error.span().map(|s| line_of(text, s.start)),
            text: format!("this is no TOML: {}", one_line(error.message())),
            hint: None,
            unknown: false,
        }
    }

    /// A key, word or type that does not fit.
    pub(super) fn of_shape(document: &Document<&str>, error: &toml_edit::de::Error) -> Self {
        let span = error.span().unwrap_or(0..0);
        let path = if error.span().is_some() {
            path_at(document, &span)
        } else {
            String::new()
        };
        let (text, hint) = reword(&path, &one_line(error.message()));
        let unknown = ["unknown field", "unknown variant", NO_SOURCE]
            .iter()
            .any(|words| error.message().contains(words));
        Self {
            path,
            line: Some(line_of(document.raw(), span.start)),
            text,
            hint,
            unknown,
        }
    }

    /// A number or combination that is not allowed; the error's `what` is the key.
    pub(super) fn of_value(document: &Document<&str>, error: Error) -> Self {
        match error {
            Error::Invalid {
                what,
                value,
                allowed,
                hint,
            } => Self {
                line: line_of_path(document, &what),
                text: format!("{what} is {value}; {allowed}"),
                path: what,
                hint,
                unknown: false,
            },
            other => Self {
                path: String::new(),
                line: None,
                text: other.to_string(),
                hint: None,
                unknown: false,
            },
        }
    }

    /// The mistake as an error of a file.
    pub(super) fn in_file(self, path: &std::path::Path) -> Error {
        let problem = match self.line {
            Some(line) => format!("line {line}: {}", self.text),
            None => self.text,
        };
        let error = Error::file(path, problem);
        match self.hint {
            Some(hint) => error.with_hint(hint),
            None => error,
        }
    }
}

fn one_line(message: &str) -> String {
    message.split_whitespace().collect::<Vec<_>>().join(" ")
}

/// Serde's words in ours: what the key is, what is allowed, the nearest word.
fn reword(path: &str, message: &str) -> (String, Option<String>) {
    let parent = path.rsplit_once('.').map_or("", |(parent, _)| parent);
    let within = if parent.is_empty() {
        String::new()
    } else {
        format!(" in {parent}")
    };
    if let Some(rest) = message.strip_prefix("unknown field ") {
        let (word, words, hint) = words_of(rest);
        return (
            format!("unknown key `{word}`{within}; allowed: {words}"),
            hint,
        );
    }
    if let Some(rest) = message.strip_prefix("unknown variant ") {
        let (word, words, hint) = words_of(rest);
        return (format!("{path} is `{word}`; allowed: {words}"), hint);
    }
    for prefix in ["invalid type: ", "invalid value: ", "invalid length "] {
        if let Some((is, expected)) = message
            .strip_prefix(prefix)
            .and_then(|m| m.split_once(", expected "))
        {
            let is = is.replace("map", "a table").replace("sequence", "a list");
            let is = match prefix {
                "invalid length " => format!("a list of {is}"),
                _ => is,
            };
            let range = range_of(path).unwrap_or_default();
            let text = format!("{path} is the {is}; allowed: {}", plain(expected, &range));
            return (
                text.replace("is the an ", "is an ")
                    .replace("is the a ", "is a "),
                None,
            );
        }
    }
    if let Some(key) = message.strip_prefix("missing field ") {
        let whose = if path.is_empty() { "the recipe" } else { path };
        return (format!("{whose} has no key {key}"), None);
    }
    let whose = if path.is_empty() {
        String::new()
    } else {
        format!("{path}: ")
    };
    (format!("{whose}{message}"), None)
}

/// The range of a pattern's parameter, as ` from 0 to 200`; `path` ends with the pattern's name and the parameter's key.
fn range_of(path: &str) -> Option<String> {
    let (pattern, key) = Pattern::NAMES.iter().find_map(|name| {
        let (_, key) = path.split_once(&format!(".{name}."))?;
        let pattern: Pattern = toml::from_str(&format!("[{name}]")).ok()?;
        Some((pattern, key))
    })?;
    let parameter = pattern.parameters().iter().find(|p| p.key == key)?;
    let range = &parameter.range;
    Some(format!(" from {} to {}", range.start(), range.end()))
}

/// What serde expected, in words for somebody who does not know Rust; `range` follows a number.
fn plain(expected: &str, range: &str) -> String {
    let expected = expected.trim_matches('`');
    match expected {
        "f32" | "f64" => return format!("a number{range}"),
        "i8" | "i16" | "i32" | "i64" => return format!("a whole number{range}"),
        "u8" | "u16" | "u32" | "u64" | "usize" if range.is_empty() => {
            "a whole number, not negative"
        }
        "u8" | "u16" | "u32" | "u64" | "usize" => return format!("a whole number{range}"),
        "a boolean" => "true or false",
        "a string" | "string" | "str" => "text in quotes",
        "a sequence" => "a list",
        e if e.starts_with("struct ") || e == "a map" => "a table",
        e if e.starts_with("an array of length 3") => "a list of 3 numbers",
        e if e.starts_with("a sequence of 2") || e.starts_with("a 2-element") => {
            "a list of 2 numbers"
        }
        e => e,
    }
    .to_owned()
}

/// Takes `` `x`, expected one of `a`, `b` `` apart: the word, the list of words, the nearest.
fn words_of(rest: &str) -> (String, String, Option<String>) {
    let mut quoted = rest.split('`').skip(1).step_by(2);
    let word = quoted.next().unwrap_or_default().to_owned();
    let words: Vec<_> = quoted.collect();
    let hint = nearest_word(&word, words.iter().copied()).map(|w| format!("Did you mean `{w}`?"));
    let list = if words.is_empty() {
        "no key at all".to_owned()
    } else {
        words.join(", ")
    };
    (word, list, hint)
}

/// The table at the end of `parts`, made where it is missing; an error says which part leads nowhere.
pub(super) fn table_at<'a>(
    root: &'a mut Table,
    parts: &[&str],
) -> Result<&'a mut dyn TableLike, Error> {
    let mut table: &mut dyn TableLike = root;
    let mut i = 0;
    while i < parts.len() {
        let item = table.entry(parts[i]).or_insert_with(|| {
            let mut implicit = Table::new();
            implicit.set_implicit(false);
            Item::Table(implicit)
        });
        table = match item {
            Item::Table(t) => t,
            Item::Value(Value::InlineTable(t)) => t,
            Item::ArrayOfTables(list) => {
                i += 1;
                let n = element(list, parts[i - 1], parts.get(i).copied())?;
                list.get_mut(n).expect("found in the list")
            }
            _ => {
                return Err(Error::invalid(
                    parts[..=i].join("."),
                    "not a table",
                    "allowed: keys below a table only",
                ));
            }
        };
        i += 1;
    }
    Ok(table)
}

/// The element of a list of tables, called `key`, that a number or a name means.
fn element(list: &toml_edit::ArrayOfTables, key: &str, part: Option<&str>) -> Result<usize, Error> {
    let one = key.strip_suffix('s').unwrap_or(key); // layers, guide
    let Some(part) = part else {
        return Err(Error::invalid(
            format!("a {one}"),
            "a table of its own",
            "allowed: one of its keys, as in layers.0.opacity",
        ));
    };
    let names: Vec<String> = list.iter().map(name_of).collect();
    if let Ok(n) = part.parse::<usize>()
        && n < list.len()
    {
        return Ok(n);
    }
    if let Some(n) = names.iter().position(|name| name == part) {
        return Ok(n);
    }
    let numbers = match list.len() {
        0 => "nothing, the list is empty".to_owned(),
        1 => "0".to_owned(),
        n => format!("0 to {}", n - 1),
    };
    let named = if names.iter().all(String::is_empty) {
        String::new()
    } else {
        format!(", or a name of {}", names.join(", "))
    };
    let error = Error::invalid(
        format!("the {one}"),
        format!("`{part}`"),
        format!("allowed: {numbers}{named}"),
    );
    Err(match nearest_word(part, names.iter().map(String::as_str)) {
        Some(near) => error.with_hint(format!("Did you mean `{near}`?")),
        None => error,
    })
}

/// The number of the layer called `name`.
pub(super) fn layer_number(root: &Table, name: &str) -> Option<usize> {
    let layers = root.get("layers")?.as_array_of_tables()?;
    layers.iter().position(|table| name_of(table) == name)
}

/// A layer's name in the text, or that of its source.
pub(super) fn name_of(table: &Table) -> String {
    let named = table.get("name").and_then(Item::as_str).map(str::to_owned);
    let source = || {
        let is_source =
            |(key, _): &(&str, &Item)| Pattern::NAMES.contains(key) || LAYER_SOURCES.contains(key);
        table.iter().find(is_source).map(|(key, _)| key.to_owned())
    };
    named.or_else(source).unwrap_or_default()
}
