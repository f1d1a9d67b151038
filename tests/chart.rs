//! `anisomap chart` from outside: its files, what they hold, and that its pictures are well-formed XML.

use assert_cmd::Command;
use std::fs;
use std::path::Path;

fn anisomap() -> Command {
    Command::cargo_bin("anisomap").expect("the binary")
}

/// The columns of a CSV file by name, every row as long as the head.
fn columns(path: &Path) -> Vec<(String, Vec<String>)> {
    let text = fs::read_to_string(path).expect("the file");
    let mut lines = text.lines().map(|l| l.split(',').map(str::to_owned));
    let head = lines.next().expect("a head");
    let mut columns: Vec<(String, Vec<String>)> = head.map(|name| (name, Vec::new())).collect();
    for line in lines {
        let line: Vec<String> = line.collect();
        assert_eq!(line.len(), columns.len(), "{line:?}");
        for ((_, column), word) in columns.iter_mut().zip(line) {
            column.push(word);
        }
    }
    columns
}

fn words<'a>(columns: &'a [(String, Vec<String>)], name: &str) -> &'a [String] {
    let found = columns.iter().find(|(n, _)| n == name);
    &found.unwrap_or_else(|| panic!("column {name}")).1
}

fn numbers(columns: &[(String, Vec<String>)], name: &str) -> Vec<f64> {
    let number = |w: &String| w.parse().unwrap_or_else(|_| panic!("{name}: {w}"));
    words(columns, name).iter().map(number).collect()
}

/// Reads elements, attributes and entities as XML defines them, as far as a chart has them; panics where it is broken.
fn check_xml(text: &str) -> usize {
    let mut rest = text
        .strip_prefix("<?xml version=\"1.0\" encoding=\"UTF-8\"?>")
        .expect("a head");
    let (mut open, mut elements) = (Vec::new(), 0);
    while let Some(at) = rest.find('<') {
        check_text(&rest[..at]);
        let end = rest[at..].find('>').expect("an end of the tag") + at;
        let tag = &rest[at + 1..end];
        rest = &rest[end + 1..];
        if let Some(name) = tag.strip_prefix('/') {
            assert_eq!(open.pop(), Some(name), "closing tag");
            continue;
        }
        let is_empty = tag.ends_with('/');
        let tag = tag.trim_end_matches('/');
        let (name, attributes) = tag.split_once(' ').unwrap_or((tag, ""));
        assert!(name.bytes().all(|b| b.is_ascii_alphanumeric()), "{tag}");
        // Names and values by turns.
        let parts: Vec<&str> = attributes.split('"').collect();
        assert!(
            parts.len() % 2 == 1 && parts[parts.len() - 1].trim().is_empty(),
            "{tag}"
        );
        for pair in parts.chunks_exact(2) {
            assert!(pair[0].trim().ends_with('='), "{tag}");
            check_text(pair[1]);
            assert!(
                !pair[1].contains("NaN") && !pair[1].contains("inf"),
                "{tag}"
            );
        }
        elements += 1;
        if !is_empty {
            open.push(name);
        }
    }
    assert!(open.is_empty() && rest.trim().is_empty(), "{open:?}");
    elements
}

fn check_text(text: &str) {
    for (at, _) in text.match_indices('&') {
        let entity = text[at..].split(';').next().unwrap_or_default();
        assert!(["&amp", "&lt", "&gt", "&quot"].contains(&entity), "{text}");
    }
    assert!(!text.contains('<') && !text.chars().any(|c| c.is_control() && c != '\n'));
}

#[test]
fn a_quick_chart_writes_all_its_files() {
    let folder = tempfile::tempdir().expect("a folder");
    let out = folder.path().join("made/where missing");
    anisomap()
        .args(["chart", "--quick", "--pictures", "-o"])
        .arg(&out)
        .assert()
        .success();

    let kernels = columns(&out.join("kernels.csv"));
    assert!(words(&kernels, "model").len() > 350);
    for (ns, largest, mean) in three(&kernels, ["ns_min", "max_rel", "mean_rel"]) {
        assert!(ns > 0.0 && largest >= mean && mean > 0.0);
    }
    let pictures = columns(&out.join("pictures.csv"));
    let scenes = words(&pictures, "scene");
    for scene in ["torus", "pot", "disc"] {
        let rows: Vec<usize> = (0..scenes.len()).filter(|&i| scenes[i] == scene).collect();
        for group in ["base", "model", "storage", "filter", "samples"] {
            assert!(
                rows.iter().any(|&i| words(&pictures, "group")[i] == group),
                "{group}"
            );
        }
    }
    for (ms, flip, de) in three(&pictures, ["ms_min", "flip_mean", "de_mean"]) {
        assert!(ms > 0.0 && (0.0..=1.0).contains(&flip) && de >= 0.0);
    }
    for png in words(&pictures, "png") {
        let picture = image::open(out.join(png)).expect("a picture").into_rgb8();
        let map = out.join(png.replace(".png", "-flip.png"));
        let map = image::open(map)
            .expect("a map of differences")
            .into_luma16();
        assert_eq!(picture.dimensions(), map.dimensions());
    }

    let page = fs::read_to_string(out.join("chart.md")).expect("the page");
    assert!(page.contains("`anisomap chart -o DIR --quick --pictures`"));
    assert!(page.contains(env!("CARGO_PKG_VERSION")));
    assert!(
        !page.contains(out.to_str().expect("a plain path")),
        "no word of the machine's folders"
    );
    let charts: Vec<&str> = page
        .split("](")
        .skip(1)
        .map(|rest| rest.split(')').next().unwrap_or_default())
        .collect();
    assert!(charts.len() >= 22, "{charts:?}");
    for chart in charts {
        let text = fs::read_to_string(out.join(chart)).expect("a chart");
        assert!(check_xml(&text) > 80, "{chart}");
    }
}

/// Three columns side by side.
fn three(columns: &[(String, Vec<String>)], names: [&str; 3]) -> Vec<(f64, f64, f64)> {
    let [a, b, c] = names.map(|name| numbers(columns, name));
    a.into_iter()
        .zip(b)
        .zip(c)
        .map(|((a, b), c)| (a, b, c))
        .collect()
}

#[test]
fn one_part_alone_is_told_as_json() {
    let folder = tempfile::tempdir().expect("a folder");
    let output = anisomap()
        .args(["chart", "--quick", "--only", "kernels", "--json", "-o"])
        .arg(folder.path())
        .output()
        .expect("it runs");
    assert!(output.status.success());
    let report: serde_json::Value = serde_json::from_slice(&output.stdout).expect("JSON");
    assert!(report["machine"]["cores"].as_u64() >= Some(1));
    assert!(report["kernels"].as_array().is_some_and(|k| k.len() > 350));
    assert_eq!(report["pictures"], serde_json::json!([]));
    for chart in [
        "kernels-models",
        "kernels-forms-ward-exact",
        "kernels-forms-phong",
        "kernels-storage-ggx",
    ] {
        assert!(
            folder.path().join(format!("{chart}.svg")).is_file(),
            "{chart}"
        );
    }
    assert!(!folder.path().join("pictures.csv").exists());
}

/// The digits of a commit, and whether its sources were changed; none where the build knew none.
fn commit(word: &str) -> Option<(&str, bool)> {
    let digits = word.trim_end_matches("-dirty");
    let is_commit = digits.len() == 12 && digits.bytes().all(|b| b.is_ascii_hexdigit());
    is_commit.then_some((digits, digits.len() != word.len()))
}

/// The commit is that of the build, wherever the binary is run: it is built again whenever HEAD moves.
#[test]
fn the_commit_beside_the_data_is_that_of_the_build() {
    let folder = tempfile::tempdir().expect("a folder");
    let output = anisomap()
        .current_dir(folder.path())
        .args(["chart", "--stability", "--json", "-o", "out"])
        .output()
        .expect("it runs");
    assert!(output.status.success());
    let report: serde_json::Value = serde_json::from_slice(&output.stdout).expect("JSON");
    let word = report["machine"]["commit"].as_str().expect("a word");
    let page = fs::read_to_string(folder.path().join("out/limits.md")).expect("the page");
    assert!(
        page.contains(&format!("(commit {word})"))
            && page.contains("`anisomap chart --stability -o DIR`")
    );
    assert!(word == "unknown" || commit(word).is_some(), "{word}");
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    if !root.join(".git").exists() || std::env::var_os("ANISOMAP_COMMIT").is_some() {
        return;
    }
    let git = |words: &[&str]| {
        let mut command = std::process::Command::new("git");
        for variable in ["GIT_DIR", "GIT_WORK_TREE", "GIT_INDEX_FILE"] {
            command.env_remove(variable); // as a hook has them
        }
        let output = command.arg("-C").arg(root).args(words).output();
        let output = output.ok().filter(|o| o.status.success())?;
        Some(String::from_utf8_lossy(&output.stdout).trim().to_owned())
    };
    let Some(head) = git(&["rev-parse", "HEAD"]) else {
        return;
    };
    let (digits, is_dirty) = commit(word).expect("a commit, as git knows one");
    assert!(head.starts_with(digits), "{word}: {head}");
    let changed = git(&["status", "--porcelain", "--", "src"]).expect("git knows HEAD");
    assert!(is_dirty || changed.is_empty(), "{word}: {changed}");
}

#[test]
fn wrong_words_are_refused() {
    let folder = tempfile::tempdir().expect("a folder");
    let cases: [(&[&str], &str); 5] = [
        (&["--fast"], "--fast"),
        (&["--only", "meshes"], "kernels, pictures"),
        (&["--only", "kernels", "--pictures"], "--pictures"),
        (&["--stability", "--quick"], "--stability"),
        (&["--only", "meshes", "--stability"], "meshes"),
    ];
    for (words, said) in cases {
        let output = anisomap()
            .arg("chart")
            .args(words)
            .arg("-o")
            .arg(folder.path().join("out"))
            .output()
            .expect("it runs");
        assert_eq!(output.status.code(), Some(2), "{words:?}");
        let text = String::from_utf8_lossy(&output.stderr).into_owned();
        assert!(text.contains(said), "{words:?}: {text}");
        assert!(!folder.path().join("out").exists(), "{words:?}");
    }
    let output = anisomap().arg("chart").output().expect("it runs");
    assert_eq!(output.status.code(), Some(2), "no folder");
}

#[test]
fn a_folder_that_cannot_be_made_is_told() {
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("file");
    fs::write(&file, b"x").expect("written");
    let output = anisomap()
        .args(["chart", "--quick", "-o"])
        .arg(file.join("out"))
        .output()
        .expect("it runs");
    assert_eq!(output.status.code(), Some(3));
    assert!(String::from_utf8_lossy(&output.stderr).contains("file"));
}
