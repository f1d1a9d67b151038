//! What may change nothing but speed: CPU levels and threads. And where the time went.

use assert_cmd::Command;
use std::path::Path;

/// Draws a pot with every model and gives the picture's bytes and what was printed.
fn preview(folder: &Path, variables: &[(&str, &str)], options: &[&str]) -> (Vec<u8>, String) {
    let path = folder.join("p.png");
    let mut command = Command::new(env!("CARGO_BIN_EXE_anisomap"));
    command
        .envs(variables.iter().copied())
        .args(["preview", "pot", "-o"])
        .arg(&path);
    command.args(["--size", "480x80", "--map-size", "64", "--model"]);
    command.arg("phong,blinn-phong,ward,ward-exact:mean,ward-duer,ward-bounded,beckmann,ggx");
    let output = command
        .args(options)
        .assert()
        .success()
        .get_output()
        .stdout
        .clone();
    let bytes = std::fs::read(&path).expect("a picture");
    (bytes, String::from_utf8(output).expect("text"))
}

#[test]
fn levels_and_threads_change_no_byte_of_a_picture() {
    let folder = tempfile::tempdir().expect("a folder");
    let (want, _) = preview(folder.path(), &[], &[]);
    for threads in ["1", "2", "5"] {
        let (got, _) = preview(folder.path(), &[("RAYON_NUM_THREADS", threads)], &[]);
        assert!(got == want, "{threads} threads");
    }
    for (name, _) in anisomap::math::levels() {
        let (got, _) = preview(folder.path(), &[("ANISOMAP_SIMD", name)], &[]);
        assert!(got == want, "{name}");
    }
}

#[test]
fn levels_and_threads_change_no_byte_of_a_field_between_guides() {
    let folder = tempfile::tempdir().expect("a folder");
    let generate = |variable: (&str, &str)| {
        let mut command = Command::new(env!("CARGO_BIN_EXE_anisomap"));
        command.env(variable.0, variable.1).arg("generate");
        command.args(["flower_medallion", "--size", "150", "--formats", "exr"]);
        command.args(["--set", "layers.engraving.guides.grid=99", "-o"]);
        command.arg(folder.path()).assert().success();
        std::fs::read(folder.path().join("flower_medallion.exr")).expect("a map")
    };
    let want = generate(("RAYON_NUM_THREADS", "1"));
    assert!(generate(("RAYON_NUM_THREADS", "3")) == want);
    for (name, _) in anisomap::math::levels() {
        assert!(generate(("ANISOMAP_SIMD", name)) == want, "{name}");
    }
}

#[test]
fn preview_tells_where_the_time_went() {
    let folder = tempfile::tempdir().expect("a folder");
    let stages = [
        "prepare", "raster", "resolve", "frame", "fetch", "shade", "gather",
    ];
    let (_, text) = preview(folder.path(), &[], &["--timings"]);
    let (_, silent) = preview(folder.path(), &[], &[]);
    let (_, json) = preview(folder.path(), &[], &["--timings", "--json"]);
    let report: serde_json::Value = serde_json::from_str(&json).expect("JSON");
    for stage in stages {
        let line = text.lines().find(|l| l.starts_with(stage)).expect("a line");
        let time = line
            .strip_suffix(" ms")
            .and_then(|l| l.split_whitespace().last());
        let time: f64 = time.and_then(|t| t.parse().ok()).expect("milliseconds");
        assert!(time >= 0.0);
        assert!(
            report["timings"][stage].as_f64().expect("a number") > 0.0,
            "{stage}"
        );
        assert!(!silent.contains(stage));
    }
}
