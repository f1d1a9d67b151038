//! Holds the documents to the program: parameter tables, presets, and the files that the text names.

use anisomap::analyse::limits;
use anisomap::chart::{envelope_table, stability};
use anisomap::guide::{Guide, Guides, Shape};
use anisomap::pattern::{Parameter, Pattern};
use anisomap::progress::Progress;
use anisomap::recipe::{PRESETS, RecipeFile, Target};
use std::fmt::Write;
use std::fs;
use std::path::{Path, PathBuf};

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).to_owned()
}

/// The tables of every pattern's parameters, as `docs/formats.md` shows them.
fn tables() -> String {
    let mut text = String::new();
    for name in Pattern::NAMES {
        let pattern: Pattern = toml::from_str(&format!("[{name}]")).expect("defaults");
        let outer = toml::Value::try_from(&pattern).expect("plain data");
        let table = &outer[name];
        let _ = writeln!(
            text,
            "#### `{name}`\n\n| key | unit | allowed | default | what it does |\n|---|---|---|---|---|"
        );
        for p in pattern.parameters() {
            let default = p
                .key
                .split('.')
                .try_fold(table, |t, k| t.get(k))
                .expect("every parameter has a default");
            let default = match default {
                toml::Value::Float(f) => format!("{}", *f as f32),
                other => other.to_string(),
            };
            let _ = writeln!(
                text,
                "| `{}` | {} | {} to {} | {default} | {} |",
                p.key,
                p.unit,
                p.range.start(),
                p.range.end(),
                p.doc
            );
        }
        let words: Vec<String> = table
            .as_table()
            .expect("a pattern is a table")
            .iter()
            .filter_map(|(k, v)| Some(format!("`{k}` (default `{}`)", v.as_str()?)))
            .collect();
        if !words.is_empty() {
            let _ = writeln!(
                text,
                "\nWords: {}; a wrong one is answered with the list.",
                words.join(", ")
            );
        }
        text.push('\n');
    }
    text
}

fn updating() -> bool {
    std::env::var_os("ANISOMAP_UPDATE_GOLDEN").is_some()
}

/// Holds what stands between the two markers of a name in a document to `want`, or writes it there.
fn generated(document: &str, name: &str, want: &str) {
    let path = root().join(document);
    let text = fs::read_to_string(&path).expect(document);
    let (begin, end) = (
        format!("<!-- {name} -->\n"),
        format!("<!-- end of {name} -->"),
    );
    let from = text.find(&begin).expect("the first marker") + begin.len();
    let to = text.find(&end).expect("the second marker");
    if updating() {
        fs::write(&path, format!("{}{want}{}", &text[..from], &text[to..])).expect("writable");
        return;
    }
    assert!(
        &text[from..to] == want,
        "{document} is out of date; rewrite it with ANISOMAP_UPDATE_GOLDEN=1 cargo test --test docs"
    );
}

#[test]
fn formats_md_states_every_parameter() {
    generated("docs/formats.md", "parameters", &format!("\n{}", tables()));
}

/// The tables of the guides' numbers.
fn guide_tables() -> String {
    let defaults = |value: toml::Value| {
        move |p: &Parameter| match value.get(p.key) {
            Some(toml::Value::Float(f)) => format!("{}", *f as f32),
            Some(other) => other.to_string(),
            None => String::new(), // not stated, or the shape's own
        }
    };
    let circle = Guide::new(Shape::Ellipse { radii: [0.3; 2] });
    let circle = toml::Value::try_from(circle).expect("plain data");
    let layer = toml::Value::try_from(Guides::default()).expect("plain data");
    let mut text = String::new();
    for (parameters, value) in [(Guides::PARAMETERS, layer), (Guide::PARAMETERS, circle)] {
        let default = defaults(value);
        text.push_str("| key | unit | allowed | default | what it does |\n|---|---|---|---|---|\n");
        for p in parameters {
            let (least, most) = (p.range.start(), p.range.end());
            let _ = writeln!(
                text,
                "| `{}` | {} | {least} to {most} | {} | {} |",
                p.key,
                p.unit,
                default(p),
                p.doc
            );
        }
        text.push('\n');
    }
    text
}

#[test]
fn formats_md_states_every_number_of_a_guide_and_its_example_is_one() {
    generated(
        "docs/formats.md",
        "guides",
        &format!("\n{}", guide_tables()),
    );
    let text = fs::read_to_string(root().join("docs/formats.md")).expect("docs/formats.md");
    let section = text.split("### Guides").nth(1).expect("its section");
    let example = section.split("```").nth(1).expect("an example");
    let recipe = format!(
        "version = 1\n[[layers]]\n{}",
        example.trim_start_matches("toml")
    );
    let file = RecipeFile::parse(&recipe, "example", None).expect("a recipe");
    file.recipe().check().expect("allowed");
    for name in Shape::NAMES {
        assert!(section.contains(&format!("| `{name}` |")), "{name}");
    }
}

/// The mean step of 255 between two pictures of one size.
fn steps_apart(a: &Path, b: &Path) -> f64 {
    let read = |path: &Path| image::open(path).expect("a picture").to_rgb8();
    let (a, b) = (read(a), read(b));
    assert_eq!(a.dimensions(), b.dimensions());
    let sum: u64 = a
        .iter()
        .zip(b.iter())
        .map(|(a, b)| u64::from(a.abs_diff(*b)))
        .sum();
    sum as f64 / a.len() as f64
}

/// The numbers of a drawing, and what stands between them.
fn numbers(svg: &str) -> (Vec<f64>, Vec<&str>) {
    let is_number = |c: char| c.is_ascii_digit() || c == '.';
    let values = svg.split(|c| !is_number(c)).filter_map(|n| n.parse().ok());
    (
        values.collect(),
        svg.split(is_number).filter(|t| !t.is_empty()).collect(),
    )
}

#[test]
fn limits_md_shows_the_tables_and_pictures_of_the_code() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let drawn = stability(folder.path(), &Progress::none()).expect("measured");
    let table = format!("\n{}\n", limits::table());
    generated("docs/limits.md", "limits", &table);
    let table = format!("\n{}\n", envelope_table(&drawn.envelope));
    generated("docs/limits.md", "envelope", &table);
    for name in ["stability.png", "energy.svg"] {
        let (kept, drawn) = (
            root().join("docs/pictures").join(name),
            folder.path().join(name),
        );
        if updating() {
            fs::copy(&drawn, &kept).expect("writable");
        }
        let stale = format!("docs/pictures/{name} is stale: see the end of docs/limits.md");
        if name.ends_with(".png") {
            let mean = steps_apart(&kept, &drawn);
            assert!(mean < 0.5, "{stale} ({mean} steps apart)");
        } else {
            let text = |path: &Path| fs::read_to_string(path).expect("a drawing");
            let (kept, drawn) = (text(&kept), text(&drawn));
            let (kept, drawn) = (numbers(&kept), numbers(&drawn));
            let near = |(a, b): (&f64, &f64)| (a - b).abs() < 0.05;
            assert!(
                kept.1 == drawn.1 && kept.0.iter().zip(&drawn.0).all(near),
                "{stale}"
            );
        }
    }
}

#[test]
fn formats_md_names_every_target_and_every_key_of_a_full_recipe() {
    let text = fs::read_to_string(root().join("docs/formats.md")).expect("docs/formats.md");
    let targets = text.lines().find(|l| l.starts_with("targets = "));
    let targets = targets.expect("an example of targets");
    for target in Target::ALL {
        assert!(targets.contains(target.name()), "{}", target.name());
    }
    let mask = text
        .split("[layers.mask]")
        .nth(1)
        .expect("an example of a mask");
    for key in [
        "invert", "low", "high", "feather", "seed", "polygon", "path",
    ] {
        let mask = mask.split("```").next().unwrap_or_default();
        assert!(mask.contains(&format!("{key} = ")), "{key}");
    }
    let manifest = text
        .split("## Manifest")
        .nth(1)
        .expect("the manifest's section");
    for key in ["recipe", "recipes", "sizes", "seeds", "formats", "mesh"] {
        assert!(manifest.contains(&format!("\n{key} = ")), "{key}");
    }
}

#[test]
fn the_documents_name_only_files_that_exist() {
    for document in [
        "README.md",
        "docs/accuracy.md",
        "docs/architecture.md",
        "docs/decisions.md",
        "docs/formats.md",
        "docs/limits.md",
        "docs/studio.md",
        "docs/wording.md",
    ] {
        let path = root().join(document);
        let text = fs::read_to_string(&path).expect(document);
        for target in text.split("](").skip(1).filter_map(|t| t.split(')').next()) {
            if target.starts_with("http") || target.starts_with('#') {
                continue;
            }
            let file = path
                .parent()
                .expect("a folder")
                .join(target.split('#').next().unwrap_or(target));
            assert!(file.exists(), "{document} names {target}");
        }
    }
}

#[test]
fn the_readme_lists_every_preset() {
    let text = fs::read_to_string(root().join("README.md")).expect("README.md");
    for preset in PRESETS {
        assert!(
            text.contains(&format!("`{}`", preset.name)),
            "README.md does not name {}",
            preset.name
        );
    }
}

/// The README's commands for its pictures, without the program's name and the output's folder.
fn pictures() -> Vec<(String, Vec<String>)> {
    let mut list = vec![
        ("figure3", "preview brushed_aluminium --mesh torus --model phong:mean,ward:mean,ward --size 1800x600"),
        ("pot", "preview pot --mesh pot --model ward"),
    ]
    .into_iter()
    .map(|(name, command)| (name.to_owned(), command.to_owned()))
    .collect::<Vec<_>>();
    for preset in [
        "gold_watch_face",
        "compact_disc",
        "satin",
        "scratched_steel",
    ] {
        list.push((preset.to_owned(), format!("preview {preset} --size 480")));
    }
    list.into_iter()
        .map(|(name, command)| {
            (
                name,
                command.split_whitespace().map(str::to_owned).collect(),
            )
        })
        .collect()
}

#[test]
fn the_readmes_pictures_are_what_its_commands_draw() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    for (name, command) in pictures() {
        let drawn = folder.path().join(format!("{name}.png"));
        let status = std::process::Command::new(env!("CARGO_BIN_EXE_anisomap"))
            .args(&command)
            .arg("-o")
            .arg(&drawn)
            .stdout(std::process::Stdio::null())
            .status()
            .expect("the binary starts");
        assert!(status.success(), "{command:?}");
        let kept = root().join(format!("docs/pictures/{name}.png"));
        // Another machine's mathematics may round a pixel here and there to the next step.
        let mean = steps_apart(&kept, &drawn);
        assert!(
            mean < 0.05,
            "docs/pictures/{name}.png is stale ({mean} steps apart): draw it again by the README's command"
        );
    }
}
