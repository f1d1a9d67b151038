//! The numbers and words of a pattern as rows of a panel: name, value, range, unit. Generic over the patterns, so that a new
//! one needs no code here but its words.

use crate::error::{Error, Result};
use crate::pattern::{Parameter, Pattern};
use toml::Value;

/// One row: a value of a pattern and what may be done with it.
#[derive(Clone, Debug, PartialEq)]
pub struct Row {
    /// The key in the pattern's table: `angle`, `warp.alpha_along`, `center.0`.
    pub key: String,
    /// What it is called: `Angle`, `Warp alpha along`.
    pub name: String,
    /// Its value.
    pub value: Setting,
}

/// A value and what is allowed.
#[derive(Clone, Debug, PartialEq)]
pub enum Setting {
    /// A number.
    Number {
        /// The number.
        value: f64,
        /// Whether only whole numbers are allowed.
        integer: bool,
        /// Range, unit and meaning.
        parameter: Parameter,
    },
    /// One of some words.
    Word {
        /// The word.
        value: String,
        /// All that are allowed.
        words: &'static [Word],
    },
    /// Yes or no.
    Flag(bool),
}

/// A word that a pattern's key may hold.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Word {
    /// As recipes write it.
    pub word: &'static str,
    /// What it makes, as a clause.
    pub doc: &'static str,
}

const fn word(word: &'static str, doc: &'static str) -> Word {
    Word { word, doc }
}

/// The words that a pattern's key may hold; empty for a key that holds none.
fn words(pattern: &str, key: &str) -> &'static [Word] {
    match (pattern, key) {
        ("radial", "style") => {
            const {
                &[
                    word(
                        "turned",
                        "circles around the centre, as a lathe leaves them",
                    ),
                    word("spokes", "straight lines out from the centre, a sunburst"),
                    word(
                        "spiral",
                        "one groove that winds outward by the pitch a turn",
                    ),
                ]
            }
        }
        ("pot", "style") => {
            const {
                &[
                    word(
                        "around",
                        "grooves around the pot: the highlight is drawn over its whole height",
                    ),
                    word(
                        "along",
                        "grooves up and down: the highlight is drawn around the pot",
                    ),
                ]
            }
        }
        ("weave", "style") => {
            const {
                &[
                    word("canvas", "each thread over one, under one"),
                    word(
                        "twill",
                        "over the float, under one, shifted from row to row: diagonal ribs",
                    ),
                    word(
                        "satin",
                        "over the float, under one, the crossings scattered: a smooth face of warp",
                    ),
                ]
            }
        }
        _ => &[],
    }
}

/// The rows of a pattern, in the order of its table.
pub fn rows(pattern: &Pattern) -> Vec<Row> {
    let table = table(pattern);
    let mut rows = Vec::new();
    for (key, value) in &table {
        collect(pattern, key.clone(), value, &mut rows);
    }
    // Words and switches first, then the numbers in the order in which the pattern lists them.
    let place = |row: &Row| match &row.value {
        Setting::Number { parameter, .. } => {
            1 + pattern
                .parameters()
                .iter()
                .position(|p| p.key == parameter.key)
                .unwrap_or(0)
        }
        _ => 0,
    };
    rows.sort_by_key(place);
    rows
}

/// The pattern with one value changed. A number out of its range is refused.
///
/// # Errors
/// [`Error::Invalid`] with the key, when there is no such key or the value is not allowed.
pub fn with_value(pattern: &Pattern, key: &str, value: Value) -> Result<Pattern> {
    let mut inner = Value::Table(table(pattern));
    let missing = || {
        Error::invalid(
            "the parameter",
            format!("`{key}`"),
            "allowed: one that the pattern has",
        )
    };
    let mut place = &mut inner;
    for part in key.split('.') {
        place = match place {
            Value::Array(items) => part.parse().ok().and_then(|i: usize| items.get_mut(i)),
            other => other.get_mut(part),
        }
        .ok_or_else(missing)?;
    }
    // A whole number stays one: the file would not read back otherwise.
    *place = match (&*place, value) {
        (Value::Integer(_), Value::Float(f)) => Value::Integer(f.round() as i64),
        (_, value) => value,
    };
    let mut outer = toml::Table::new();
    outer.insert(pattern.name().to_owned(), inner);
    let changed: Pattern = Value::Table(outer)
        .try_into()
        .map_err(|e| Error::invalid(key, "not allowed", e.to_string()))?;
    changed.validate()?;
    Ok(changed)
}

/// A pattern with all its defaults.
///
/// # Errors
/// [`Error::Invalid`] when there is none of that name.
pub fn default_pattern(name: &str) -> Result<Pattern> {
    let mut outer = toml::Table::new();
    outer.insert(name.to_owned(), Value::Table(toml::Table::new()));
    Value::Table(outer).try_into().map_err(|_| {
        Error::invalid(
            "the pattern",
            format!("`{name}`"),
            format!("allowed: {}", Pattern::NAMES.join(", ")),
        )
    })
}

fn table(pattern: &Pattern) -> toml::Table {
    let outer = toml::Table::try_from(pattern).expect("a pattern is plain data");
    match outer.into_iter().next() {
        Some((_, Value::Table(inner))) => inner,
        _ => toml::Table::new(),
    }
}

fn collect(pattern: &Pattern, key: String, value: &Value, rows: &mut Vec<Row>) {
    let row = |key: String, value: Setting| Row {
        name: row_name(&key),
        key,
        value,
    };
    match value {
        Value::Table(inner) => {
            for (name, value) in inner {
                collect(pattern, format!("{key}.{name}"), value, rows);
            }
        }
        Value::Array(items) => {
            for (i, item) in items.iter().enumerate() {
                if let Some(setting) = number(pattern, &key, item) {
                    rows.push(row(format!("{key}.{i}"), setting));
                }
            }
        }
        Value::Boolean(flag) => rows.push(row(key, Setting::Flag(*flag))),
        Value::String(word) => {
            let words = words(pattern.name(), &key);
            rows.push(row(
                key,
                Setting::Word {
                    value: word.clone(),
                    words,
                },
            ));
        }
        number_value => {
            if let Some(setting) = number(pattern, &key, number_value) {
                rows.push(row(key, setting));
            }
        }
    }
}

fn number(pattern: &Pattern, key: &str, value: &Value) -> Option<Setting> {
    let parameter = pattern.parameters().iter().find(|p| p.key == key)?.clone();
    let (value, integer) = match value {
        Value::Integer(i) => (*i as f64, true),
        // What an f32 shows, and not what its f64 twin does.
        Value::Float(f) => ((*f as f32).to_string().parse().unwrap_or(*f), false),
        _ => return None,
    };
    Some(Setting::Number {
        value,
        integer,
        parameter,
    })
}

/// `warp.alpha_along` as people read it.
fn row_name(key: &str) -> String {
    let place = |part: &str| match part {
        "0" => "u".to_owned(),
        "1" => "v".to_owned(),
        other => other.replace('_', " "),
    };
    let text = key.split('.').map(place).collect::<Vec<_>>().join(" ");
    let mut letters = text.chars();
    match letters.next() {
        // The alphas are symbols, not words.
        Some(first) if !text.starts_with("alpha") => first.to_uppercase().chain(letters).collect(),
        _ => text,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_value_of_every_pattern_has_a_row_and_every_word_is_known() {
        for name in Pattern::NAMES {
            let pattern = default_pattern(name).unwrap();
            let rows = rows(&pattern);
            for parameter in pattern.parameters() {
                let of = |r: &Row| {
                    r.key == parameter.key || r.key.starts_with(&format!("{}.", parameter.key))
                };
                assert!(rows.iter().any(of), "{name}.{}", parameter.key);
            }
            for row in rows {
                match row.value {
                    Setting::Word { words, .. } => {
                        assert!(!words.is_empty(), "{name}.{}", row.key);
                        for word in words {
                            with_value(&pattern, &row.key, Value::from(word.word)).unwrap();
                            assert!(!word.doc.is_empty() && !word.doc.ends_with('.'));
                        }
                    }
                    Setting::Number { value, .. } => {
                        let same = with_value(&pattern, &row.key, Value::Float(value)).unwrap();
                        assert_eq!(same, pattern, "{name}.{}", row.key);
                    }
                    Setting::Flag(flag) => {
                        with_value(&pattern, &row.key, Value::Boolean(!flag)).unwrap();
                    }
                }
            }
        }
    }

    #[test]
    fn what_is_out_of_range_or_not_there_is_refused() {
        let brushed = default_pattern("brushed").unwrap();
        let e = with_value(&brushed, "angle", Value::Float(1e4))
            .unwrap_err()
            .to_string();
        assert!(e.contains("angle"), "{e}");
        assert!(with_value(&brushed, "angel", Value::Float(1.0)).is_err());
        assert!(with_value(&brushed, "angle", Value::from("x")).is_err());
        assert!(default_pattern("brushd").is_err());
    }

    #[test]
    fn names_are_for_people() {
        assert_eq!(row_name("streak_length"), "Streak length");
        assert_eq!(row_name("alpha_across"), "alpha across");
        assert_eq!(row_name("bottom.ring_spacing"), "Bottom ring spacing");
        assert_eq!(row_name("center.1"), "Center v");
    }
}
