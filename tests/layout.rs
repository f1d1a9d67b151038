//! Keeps the order of imports: a module uses only modules that stand above it in `src/lib.rs`.

use std::fs;
use std::path::{Path, PathBuf};

/// The order of the data flow; a module may import from those before it.
const ORDER: [&str; 21] = [
    "error",
    "progress",
    "math",
    "brdf",
    "mesh",
    "map",
    "convention",
    "coverage",
    "pattern",
    "guide",
    "paint",
    "filter",
    "import",
    "recipe",
    "raster",
    "preview",
    "export",
    "analyse",
    "generate",
    "chart",
    "studio",
];

fn sources(folder: &Path, found: &mut Vec<PathBuf>) {
    for entry in fs::read_dir(folder).expect("src is readable") {
        let path = entry.expect("an entry").path();
        if path.is_dir() {
            sources(&path, found);
        } else if path.extension().is_some_and(|e| e == "rs") {
            found.push(path);
        }
    }
}

/// The module a file of `src` belongs to: `map/lobe.rs` and `map.rs` are both `map`.
fn module(path: &Path, src: &Path) -> String {
    let relative = path.strip_prefix(src).expect("below src");
    let first = relative
        .components()
        .next()
        .expect("a name")
        .as_os_str()
        .to_string_lossy()
        .into_owned();
    first.trim_end_matches(".rs").to_owned()
}

/// Every first path segment after `prefix` in the code (comments left out), `{a, b}` groups included.
fn names_after(prefix: &str, code: &str) -> Vec<String> {
    let word = |s: &str| {
        s.trim()
            .chars()
            .take_while(|c| c.is_alphanumeric() || *c == '_')
            .collect::<String>()
    };
    let mut names = Vec::new();
    for (at, _) in code.match_indices(prefix) {
        if code[..at].ends_with(|c: char| c.is_alphanumeric() || c == '_') {
            continue;
        }
        let rest = &code[at + prefix.len()..];
        if let Some(group) = rest.strip_prefix('{') {
            let mut depth = 1;
            let mut start = 0;
            for (i, c) in group.char_indices() {
                match c {
                    '{' => depth += 1,
                    '}' => depth -= 1,
                    ',' if depth == 1 => {
                        names.push(word(&group[start..i]));
                        start = i + 1;
                    }
                    _ => {}
                }
                if depth == 0 {
                    names.push(word(&group[start..i]));
                    break;
                }
            }
        } else {
            names.push(word(rest));
        }
    }
    names.retain(|n| !n.is_empty());
    names
}

/// The code without its comments: from `//` on, unless that stands in a string, as a URL's does.
fn without_comments(code: &str) -> String {
    code.lines()
        .map(code_of_line)
        .collect::<Vec<_>>()
        .join("\n")
}

fn code_of_line(line: &str) -> &str {
    let (mut in_string, mut escaped, mut before) = (false, false, ' ');
    for (i, c) in line.char_indices() {
        match c {
            _ if escaped => escaped = false,
            '\\' => escaped = true,
            '"' if before != '\'' => in_string = !in_string,
            '/' if !in_string && line[i..].starts_with("//") => return &line[..i],
            _ => {}
        }
        before = c;
    }
    line
}

/// The modules that a file in `depth` modules below `src` reaches by `super::`: of `src/a/b.rs`, `super::super::x` is
/// `crate::x`. Modules inside a file (its tests) are one deeper, so what they reach through one `super` more counts too.
fn names_through_supers(depth: usize, code: &str) -> Vec<String> {
    [depth, depth + 1]
        .into_iter()
        .flat_map(|n| names_after(&"super::".repeat(n), code))
        .filter(|name| name != "super")
        .collect()
}

/// How many modules deep a file lies: `src/a.rs` and `src/a/mod.rs` 1, `src/a/b.rs` 2.
fn depth(path: &Path, src: &Path) -> usize {
    let relative = path.strip_prefix(src).expect("below src");
    let parts = relative.components().count();
    parts - usize::from(relative.ends_with("mod.rs"))
}

#[test]
fn modules_import_only_from_above() {
    let src = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let mut files = Vec::new();
    sources(&src, &mut files);
    let mut checked = 0;
    for path in files {
        let from = module(&path, &src);
        let code = without_comments(&fs::read_to_string(&path).expect("utf-8"));
        if ["main", "cli", "gui"].contains(&from.as_str()) {
            continue; // the binary; see the next test
        }
        if from == "lib" {
            for name in names_after("pub mod ", &code) {
                assert!(
                    ORDER.contains(&name.as_str()),
                    "lib.rs declares `{name}`, which has no place in the order"
                );
            }
            continue;
        }
        let rank = |m: &str| ORDER.iter().position(|o| *o == m);
        let own = rank(&from)
            .unwrap_or_else(|| panic!("{} belongs to no module of the order", path.display()));
        let mut names = names_after("crate::", &code);
        names.extend(names_through_supers(depth(&path, &src), &code));
        for name in names {
            let Some(used) = rank(&name) else { continue };
            assert!(
                used <= own,
                "{}: `{from}` imports `{name}`, which comes after it",
                path.display()
            );
            checked += 1;
        }
    }
    assert!(
        checked > 100,
        "the test found only {checked} imports: it no longer reads the code"
    );
}

#[test]
fn the_binary_uses_only_public_names_of_the_library() {
    let src = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let mut files = Vec::new();
    for folder in ["cli", "gui"] {
        if src.join(folder).is_dir() {
            sources(&src.join(folder), &mut files);
        }
    }
    files.push(src.join("main.rs"));
    for path in files {
        let code = without_comments(&fs::read_to_string(&path).expect("utf-8"));
        for name in names_after("crate::", &code) {
            assert!(
                !ORDER.contains(&name.as_str()),
                "{} reaches into `{name}`",
                path.display()
            );
        }
        assert!(
            !code.contains("#[path"),
            "{} includes a library file by path",
            path.display()
        );
    }
}

#[test]
fn the_reader_of_imports_reads_them() {
    let names = names_after(
        "crate::",
        "use crate::{map::{Texel, Size}, error};\nlet x = crate::math::exp(1.0);",
    );
    assert_eq!(names, ["map", "error", "math"]);
}

#[test]
fn the_reader_of_imports_is_not_led_astray() {
    let code =
        "let url = \"https://x\"; use crate::map::Size; // crate::cli\nlet c = '\"'; // crate::gui";
    assert_eq!(names_after("crate::", &without_comments(code)), ["map"]);
    let src = Path::new("src");
    assert_eq!(depth(Path::new("src/a.rs"), src), 1);
    assert_eq!(depth(Path::new("src/a/mod.rs"), src), 1);
    assert_eq!(depth(Path::new("src/a/b.rs"), src), 2);
    let supers = names_through_supers(2, "use super::super::export::beside;\nuse super::own;");
    assert!(supers.contains(&"export".to_owned()), "{supers:?}");
    assert!(!supers.contains(&"own".to_owned()));
}
