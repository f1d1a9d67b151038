//! `anisomap reduce` as the real binary: what it keeps, that it looks the same, and what it says to nonsense.

use anisomap::analyse::Flip;
use anisomap::analyse::PIXELS_PER_DEGREE;
use anisomap::map::{AnisoMap, Size};
use anisomap::mesh;
use anisomap::preview::{Look, Picture, Scene, Subject, render_reference};
use anisomap::progress::Progress;
use anisomap::recipe::{Files, RecipeFile, open};
use assert_cmd::Command;
use glam::Vec3;
use serde_json::Value;
use std::fs;
use std::path::PathBuf;
use tempfile::TempDir;

struct Desk(TempDir);

struct End {
    code: i32,
    out: String,
    err: String,
}

impl Desk {
    fn new() -> Self {
        Self(tempfile::tempdir().expect("a temporary folder"))
    }

    fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    fn write(&self, name: &str, text: &str) {
        fs::write(self.path(name), text).expect("the folder is writable");
    }

    fn run_with(&self, threads: &str, arguments: &str) -> End {
        let output = Command::new(env!("CARGO_BIN_EXE_anisomap"))
            .args(arguments.split_whitespace())
            .env("RAYON_NUM_THREADS", threads)
            .current_dir(self.0.path())
            .output()
            .expect("the binary starts");
        let text = |bytes: &[u8]| String::from_utf8(bytes.to_vec()).expect("UTF-8");
        let end = End {
            code: output.status.code().expect("an exit code, not a signal"),
            out: text(&output.stdout),
            err: text(&output.stderr),
        };
        assert!(!end.err.contains("panicked"), "{arguments}: {}", end.err);
        end
    }

    fn works(&self, arguments: &str) -> String {
        let end = self.run_with("2", arguments);
        assert_eq!(end.code, 0, "{arguments}: {}", end.err);
        end.out
    }

    fn json(&self, arguments: &str) -> Value {
        serde_json::from_str(&self.works(&format!("{arguments} --json"))).expect("JSON")
    }

    fn fails(&self, arguments: &str, words: &[&str]) {
        let end = self.run_with("2", arguments);
        assert_eq!(end.code, 2, "{arguments}: {}{}", end.out, end.err);
        for word in words {
            assert!(
                end.err.contains(word),
                "{arguments}: no `{word}` in {}",
                end.err
            );
        }
    }

    fn files(&self, folder: &str) -> Vec<String> {
        let entries = fs::read_dir(self.path(folder)).expect("a folder");
        let mut names: Vec<String> = entries
            .map(|e| {
                e.expect("an entry")
                    .file_name()
                    .into_string()
                    .expect("a name")
            })
            .collect();
        names.sort();
        names
    }

    /// The map of a recipe that was written.
    fn map(&self, recipe: &str) -> AnisoMap {
        let file = RecipeFile::read(self.path(recipe)).expect("a recipe");
        filled(&file, file.recipe().size, &file.files(false))
    }
}

fn filled(file: &RecipeFile, size: Size, files: &Files) -> AnisoMap {
    let none = Progress::none();
    let prepared = file
        .recipe()
        .prepare(size, files, &none)
        .expect("it prepares");
    prepared.map(&none).expect("nobody cancels")
}

fn number(json: &Value) -> f64 {
    json.as_f64().unwrap_or_else(|| panic!("no number: {json}"))
}

const FLAT: &str = "version = 1\nname = 'flat'\n[[layers]]\n[layers.constant]\nalpha_x = 0.1\nalpha_y = 0.3\nangle = 20\n";

#[test]
fn a_constant_recipe_keeps_no_map() {
    let desk = Desk::new();
    desk.write("flat.toml", FLAT);
    let json = desk.json("reduce ./flat.toml -o out --metric flip --tolerance 0.01 --size 96");
    assert_eq!(json["reduced"]["kind"], "constants");
    assert_eq!(
        (&json["reduced"]["bytes"], &json["reduced"]["file_bytes"]),
        (&0.into(), &0.into())
    );
    assert_eq!(
        desk.files("out"),
        ["flat.reduced.json", "flat.reduced.toml"]
    );
    let text = fs::read_to_string(desk.path("out/flat.reduced.toml")).expect("text");
    assert!(
        text.contains("[layers.constant]") && text.contains("alpha_x = 0.1\n"),
        "{text}"
    );
    // Every command reads it.
    desk.works("inspect out/flat.reduced.toml");
    desk.works("generate out/flat.reduced.toml -o again --formats exr,glb");
    desk.works("preview out/flat.reduced.toml -o flat.png --size 64");
    let report: Value = serde_json::from_str(
        &fs::read_to_string(desk.path("out/flat.reduced.json")).expect("text"),
    )
    .expect("JSON");
    assert_eq!(report["dropped"], json["dropped"]);
    assert!(
        report["dropped"][0]
            .as_str()
            .is_some_and(|d| d.contains("the map"))
    );
}

#[test]
fn the_vinyl_record_keeps_a_radial_strip() {
    let desk = Desk::new();
    let out = desk.works("reduce vinyl_record -o out --metric flip --tolerance 0.01");
    assert!(out.contains("kept: radial strip of"), "{out}");
    let report: Value = serde_json::from_str(
        &fs::read_to_string(desk.path("out/vinyl_record.reduced.json")).expect("text"),
    )
    .expect("JSON");
    assert!(number(&report["reduced"]["bytes"]) < 1e-3 * number(&report["full"]["bytes"]));
    let text = fs::read_to_string(desk.path("out/vinyl_record.reduced.toml")).expect("text");
    assert!(
        text.contains("[layers.stored.radial]") && text.contains("# Kept: radial"),
        "{text}"
    );
    for file in report["files"].as_array().expect("files") {
        assert!(
            out.contains(file["path"].as_str().expect("a path")),
            "{file} is not told in {out}"
        );
    }
}

#[test]
fn brushed_aluminium_drops_half_its_bytes_and_nothing_in_silence() {
    let desk = Desk::new();
    let out =
        "reduce brushed_aluminium -o out --metric flip --tolerance 0.01 --map-size 256 --size 128";
    let json = desk.json(out);
    let (full, kept) = (
        number(&json["full"]["bytes"]),
        number(&json["reduced"]["bytes"]),
    );
    assert_eq!(full, 16.0 * 256.0 * 256.0);
    assert!(kept <= 0.5 * full, "{kept} of {full}");
    let files = json["files"].as_array().expect("files").iter();
    let sizes: u64 = files
        .filter(|f| !f["path"].as_str().unwrap_or_default().ends_with("ml"))
        .filter(|f| !f["path"].as_str().unwrap_or_default().ends_with("json"))
        .map(|f| f["bytes"].as_u64().expect("bytes"))
        .sum();
    assert_eq!(json["reduced"]["file_bytes"].as_u64(), Some(sizes));
    assert!(!json["dropped"].as_array().expect("a list").is_empty());
    let tried = json["tried"].as_array().expect("a list");
    assert_eq!(tried.iter().filter(|t| t["verdict"] == "taken").count(), 1);
    assert!(number(&json["scenes"][0]["error"]["mean"]) <= 0.01);
}

/// A picture by the reference, as the program's own is measured.
fn drawn(map: &AnisoMap, file: &RecipeFile, word: &str, light: Vec3) -> Picture {
    let mesh = mesh::open(word).expect("a mesh");
    let mut scene = Scene::for_mesh(&mesh);
    scene.set_directions(&[light]);
    let subject = Subject {
        mesh: &mesh,
        map,
        material: &file.recipe().material,
    };
    let size = Size::new(64, 64).expect("a size");
    render_reference(
        subject,
        &scene,
        &[Look::default()],
        size,
        8,
        &Progress::none(),
    )
    .expect("it draws")
    .swap_remove(0)
}

#[test]
fn what_was_written_stays_within_the_tolerance_on_every_mesh_and_light() {
    let desk = Desk::new();
    for (preset, tolerance) in [
        ("spun_copper", 0.02),
        ("brushed_aluminium", 0.05),
        ("twill", 0.005),
    ] {
        let lights = "--light=-1,2,3 --light=2,0.5,1";
        desk.works(&format!(
            "reduce {preset} -o out --tolerance {tolerance} --map-size 128 --size 64 --mesh torus --mesh disc {lights}"
        ));
        let full = open(preset).expect("a preset");
        let map = filled(
            &full,
            Size::new(128, 128).expect("a size"),
            &Files::default(),
        );
        let name = format!("out/{preset}.reduced.toml");
        let reduced = desk.map(&name);
        assert!(reduced != map, "{preset}: nothing was reduced");
        for mesh in ["torus", "disc"] {
            for light in [Vec3::new(-1.0, 2.0, 3.0), Vec3::new(2.0, 0.5, 1.0)] {
                let light = light.normalize();
                let (a, b) = (
                    drawn(&map, &full, mesh, light),
                    drawn(&reduced, &full, mesh, light),
                );
                let flip = Flip::new(&a, &b, PIXELS_PER_DEGREE).expect("of one size");
                let (mean, p999) = (flip.mean(), flip.quantile(0.999));
                assert!(mean <= tolerance, "{preset} {mesh} {light}: {mean}");
                assert!(
                    f64::from(p999) <= 3.0 * tolerance,
                    "{preset} {mesh} {light}: {p999}"
                );
            }
        }
    }
}

#[test]
fn a_finished_map_is_reduced_as_well_and_where_all_is_seen_all_is_kept() {
    let desk = Desk::new();
    desk.works("generate twill -o maps --size 32 --formats exr --float");
    let json =
        desk.json("reduce maps/twill.exr -o out --tolerance 1e-7 --metric luminance --size 64");
    assert_eq!(
        (&json["reduced"]["kind"], &json["reduced"]["storage"]),
        (&"map".into(), &"f32".into())
    );
    assert_eq!(json["dropped"].as_array().map(Vec::len), Some(0));
    assert_eq!(json["reference_samples"], Value::Null);
    assert_eq!(
        desk.files("out"),
        [
            "twill.reduced.exr",
            "twill.reduced.json",
            "twill.reduced.toml"
        ]
    );
    // What is no longer a part of it goes when less is kept.
    desk.works("reduce maps/twill.exr -o out --tolerance 0.9 --size 64");
    assert_eq!(
        desk.files("out"),
        ["twill.reduced.json", "twill.reduced.toml"]
    );
    // A recipe of the user's own stays.
    desk.write("out/twill.reduced.toml", FLAT);
    desk.fails(
        "reduce maps/twill.exr -o out --tolerance 0.9 --size 64",
        &["twill.reduced.toml", "yours"],
    );
    assert_eq!(
        fs::read_to_string(desk.path("out/twill.reduced.toml")).expect("text"),
        FLAT
    );
}

#[test]
fn files_of_the_users_own_are_never_written_over() {
    let desk = Desk::new();
    desk.write("flat.toml", FLAT);
    fs::create_dir(desk.path("out")).expect("a folder");
    let reduce = "reduce ./flat.toml -o out --tolerance 0.01 --size 64";
    for suffix in [".json", "_widths.png", "_axis.png", ".exr"] {
        let name = format!("flat.reduced{suffix}");
        desk.write(&format!("out/{name}"), "mine");
        desk.fails(reduce, &[&name, "yours"]);
        desk.fails(
            "generate ./flat.toml -o out --reduce 0.01 --formats exr",
            &[&name, "yours"],
        );
        let there = fs::read_to_string(desk.path("out").join(&name)).expect("text");
        assert_eq!(
            (there.as_str(), desk.files("out")),
            ("mine", vec![name.clone()])
        );
        fs::remove_file(desk.path("out").join(&name)).expect("it is there");
    }
    desk.works(reduce);
    desk.works(reduce);
    // A set that cannot be finished leaves no recipe that could be read.
    desk.works("generate twill -o maps --size 32 --formats exr --float");
    desk.works("reduce maps/twill.exr -o out --tolerance 0.9 --size 64");
    fs::create_dir(desk.path("out/twill.reduced.exr")).expect("a folder");
    let kept = "reduce maps/twill.exr -o out --tolerance 1e-7 --metric luminance --size 64";
    let end = desk.run_with("2", kept);
    assert_eq!(end.code, 3, "{}", end.err);
    assert!(!desk.path("out/twill.reduced.toml").exists());
}

#[test]
fn without_highlights_the_cheapest_model_is_taken() {
    let desk = Desk::new();
    let dull = FLAT.replace(
        "[[layers]]",
        "[material]\nspecular = [0.0, 0.0, 0.0]\n[[layers]]",
    );
    desk.write("dull.toml", &dull);
    let json = desk.json("reduce ./dull.toml -o out --tolerance 0.01 --metric de --size 64");
    assert_eq!(
        (&json["reduced"]["model"], &json["full"]["model"]),
        (&"lambert".into(), &"ward".into())
    );
    let text = fs::read_to_string(desk.path("out/flat.reduced.toml")).expect("text");
    assert!(text.contains("models = [\"lambert\"]"), "{text}");
}

/// A brushed sheet, and what a recipe shows it with.
fn brushed(models: &str) -> String {
    format!(
        "version = 1\nname = 'sheet'\nsize = 64\n[material]\ndiffuse = [0.04, 0.04, 0.04]\nspecular = [0.4, 0.4, 0.4]\n\
         [scene]\nmodels = [{models}]\n[[layers]]\n[layers.brushed]\nangle = 10\n"
    )
}

/// The models that a recipe names.
fn models(desk: &Desk, recipe: &str) -> Vec<String> {
    let file = RecipeFile::read(desk.path(recipe)).expect("a recipe");
    file.recipe().scene.models.clone()
}

/// The 99.9th percentile of FLIP between the map of a recipe and that of its reduction, each drawn as `look` says.
fn p999_between(desk: &Desk, recipe: &str, reduced: &str, look: &str) -> f32 {
    let file = RecipeFile::read(desk.path(recipe)).expect("a recipe");
    let mesh = mesh::open("torus").expect("a mesh");
    let [full, kept] = [recipe, reduced].map(|name| {
        let map = desk.map(name);
        let subject = Subject {
            mesh: &mesh,
            map: &map,
            material: &file.recipe().material,
        };
        let looks = Look::list(look).expect("a look");
        let size = Size::new(96, 96).expect("a size");
        let scene = Scene::for_mesh(&mesh);
        let drawn = render_reference(subject, &scene, &looks, size, 8, &Progress::none());
        drawn.expect("it draws").swap_remove(0)
    });
    Flip::new(&full, &kept, PIXELS_PER_DEGREE)
        .expect("of one size")
        .quantile(0.999)
}

#[test]
fn every_look_of_a_recipe_is_judged() {
    let desk = Desk::new();
    for (shown, judged) in [
        ("'lambert', 'ward'", vec!["lambert", "ward"]),
        (
            "'phong:mean', 'ward:mean', 'ward'",
            vec!["phong:mean", "ward:mean", "ward"],
        ),
    ] {
        desk.write("sheet.toml", &brushed(shown));
        let json = desk.json("reduce ./sheet.toml -o out --tolerance 0.01 --size 96");
        let scenes = json["scenes"].as_array().expect("a list");
        let told: Vec<&str> = scenes.iter().filter_map(|s| s["model"].as_str()).collect();
        assert_eq!(told, judged);
        assert_eq!(json["full"]["model"], judged.join(","));
        for scene in scenes {
            assert!(number(&scene["error"]["mean"]) <= 0.01, "{scene}");
            assert!(number(&scene["error"]["p999"]) <= 0.03, "{scene}");
        }
        assert_eq!(models(&desk, "out/sheet.reduced.toml"), judged);
        for look in judged {
            let p999 = p999_between(&desk, "sheet.toml", "out/sheet.reduced.toml", look);
            assert!(p999 <= 0.03, "{shown}: {look} {p999}");
        }
    }
}

#[test]
fn a_mean_alone_needs_only_the_mean() {
    let desk = Desk::new();
    desk.write("sheet.toml", &brushed("'ward:mean'"));
    let json = desk.json("reduce ./sheet.toml -o out --tolerance 0.01 --size 96");
    assert_eq!(json["reduced"]["kind"], "constants");
    assert_eq!(models(&desk, "out/sheet.reduced.toml"), ["ward:mean"]);
    let p999 = p999_between(&desk, "sheet.toml", "out/sheet.reduced.toml", "ward:mean");
    assert!(p999 <= 0.03, "{p999}");
}

#[test]
fn no_model_of_several_is_lost_and_the_one_asked_for_is_written() {
    let desk = Desk::new();
    // Without highlights every model looks like the cheapest, and yet the recipe's panels stay.
    let dull = brushed("'ward', 'ggx:mean', 'phong'").replace("0.4, 0.4, 0.4", "0, 0, 0");
    desk.write("sheet.toml", &dull);
    let reduce = "reduce ./sheet.toml -o out --tolerance 0.01 --size 64";
    desk.works(reduce);
    let kept = models(&desk, "out/sheet.reduced.toml");
    assert_eq!(kept, ["ward", "ggx:mean", "phong"]);
    desk.write("sheet.toml", &brushed("'ward', 'ggx'"));
    let json = desk.json(&format!("{reduce} --model lambert"));
    assert_eq!(models(&desk, "out/sheet.reduced.toml"), ["lambert"]);
    let dropped = json["dropped"].to_string();
    for model in ["model ward:", "model ggx:"] {
        assert!(dropped.contains(model), "{dropped}");
    }
    let text = desk.works(&format!("{reduce} --model ggx"));
    assert_eq!(models(&desk, "out/sheet.reduced.toml"), ["ggx"]);
    assert!(
        text.contains("model ward: not judged") && !text.contains("model ggx: not"),
        "{text}"
    );
}

#[test]
fn tolerances_are_told_as_they_are_typed() {
    let desk = Desk::new();
    desk.write("flat.toml", FLAT);
    for (typed, thrice) in [("0.03", "0.09"), ("0.0001", "0.0003"), ("0.7", "2.1")] {
        let reduce = format!("reduce ./flat.toml -o out --tolerance {typed} --size 32");
        let text = desk.works(&reduce);
        let told = format!("at most {typed} on average and {thrice} in 99.9 %");
        assert!(text.contains(&told), "{text}");
        let json = desk.json(&reduce)["tolerance"].to_string();
        assert_eq!(json, format!("{{\"mean\":{typed},\"p999\":{thrice}}}"));
    }
}

#[test]
fn what_is_taken_stays_clear_of_the_tolerance() {
    let desk = Desk::new();
    desk.write("sheet.toml", &brushed("'ward'"));
    let reduce = |tolerance: f64| {
        let json = desk.json(&format!(
            "reduce ./sheet.toml -o out --tolerance {tolerance} --size 64"
        ));
        let error = &json["scenes"][0]["error"];
        number(&error["mean"]).max(number(&error["p999"]) / 3.0)
    };
    let taken = reduce(0.02);
    assert!(taken > 0.0);
    // A tolerance that the same form would just keep.
    let close = 1.05 * taken;
    let error = reduce(close);
    assert!(error <= 0.851 * close, "{error} of {close}");
}

#[test]
fn generated_files_are_as_fine_as_the_tolerance_wants() {
    let desk = Desk::new();
    let generate = "generate twill -o out --size 32 --formats exr,png8,glb,preview --reduce";
    let exact = desk.run_with("2", &format!("{generate} 1e-7"));
    assert_eq!(exact.code, 0, "{}", exact.err);
    for note in [
        "exr has 32-bit floats",
        "png8 is coarser than",
        "glb is coarser than",
    ] {
        assert!(exact.err.contains(note), "{note}: {}", exact.err);
    }
    assert!(!exact.err.contains("preview"), "{}", exact.err);
    // The master holds the reduced map to the bit.
    desk.write(
        "master.toml",
        "version = 1\nsize = 32\n[[layers]]\n[layers.image]\nfile = 'out/twill.exr'\n",
    );
    assert!(desk.map("out/twill.reduced.toml") == desk.map("master.toml"));
    let loose = desk.run_with("2", &format!("{generate} 0.5"));
    assert_eq!(
        (loose.code, loose.err.contains("note:")),
        (0, false),
        "{}",
        loose.err
    );
}

#[test]
fn generate_reduces_on_request() {
    let desk = Desk::new();
    desk.write("flat.toml", FLAT);
    let out = desk.works("generate ./flat.toml -o out --reduce 0.01 --formats exr,preview");
    assert!(
        out.contains("dropped: the map") && out.contains("flat.exr"),
        "{out}"
    );
    for name in [
        "flat.exr",
        "flat.reduced.json",
        "flat.reduced.toml",
        "flat.toml",
        "flat_preview.png",
    ] {
        assert!(desk.path("out").join(name).exists(), "{name}");
    }
    let json = desk.json("generate ./flat.toml -o out --reduce 0.01 --formats exr");
    assert_eq!(json["reduced"]["reduced"]["kind"], "constants");
    assert_eq!(json["size"], serde_json::json!([1, 1]));
    assert_eq!(
        desk.json("generate ./flat.toml -o full --size 8 --formats exr")["reduced"],
        Value::Null
    );
    // What is known of the input is told of what becomes of it.
    let newer = format!(
        "{}colour = 1\n",
        FLAT.replace("version = 1", "version = 99\nseed = 7")
    );
    desk.write("newer.toml", &newer);
    let json = desk.json("generate ./newer.toml -o newer --reduce 0.01 --formats exr");
    assert_eq!(json["seed"], 7);
    assert_eq!(json["ignored"].as_array().map(Vec::len), Some(1), "{json}");
    desk.fails(
        "generate ./flat.toml -o out --reduce 0",
        &["--reduce", "over 0"],
    );
    // A folder with the user's own recipe is refused before anything is made.
    fs::create_dir(desk.path("mine")).expect("a folder");
    desk.write("mine/flat.toml", "version = 1\n");
    desk.fails(
        "generate ./flat.toml -o mine --reduce 0.01",
        &["flat.toml", "yours"],
    );
    assert_eq!(desk.files("mine"), ["flat.toml"]);
}

#[test]
fn a_mesh_outside_the_output_is_drawn_and_told() {
    let desk = Desk::new();
    fs::create_dir(desk.path("a")).expect("a folder");
    desk.write(
        "a/tri.obj",
        "v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 0 1\nf 1/1 2/2 3/3\n",
    );
    let recipe = FLAT.replace("[[layers]]", "mesh = 'tri.obj'\n[[layers]]");
    desk.write("a/flat.toml", &recipe);
    let out = desk.works("generate ./a/flat.toml -o o --reduce 0.01 --formats exr,glb,preview");
    assert!(out.contains("--allow-outside"), "{out}");
    let glb = fs::read(desk.path("o/flat.glb")).expect("a GLB");
    let torus = "generate ./a/flat.toml -o t --reduce 0.01 --formats glb --mesh torus";
    desk.works(torus);
    let on_torus = fs::read(desk.path("t/flat.glb")).expect("a GLB");
    assert!(glb.len() < on_torus.len(), "the triangle is not in it");
    let out = desk.works("reduce ./a/flat.toml -o o3 --tolerance 0.01 --size 64");
    assert!(out.contains("names a mesh outside its folder"), "{out}");
    let preview = "preview o3/flat.reduced.toml -o p.png --size 64";
    desk.fails(preview, &["--allow-outside"]);
    desk.works(&format!("{preview} --allow-outside"));
    let inside = desk.works("reduce ./a/flat.toml -o a --tolerance 0.01 --size 64");
    assert!(!inside.contains("outside"), "{inside}");
}

#[test]
fn the_same_files_for_any_number_of_threads() {
    let desk = Desk::new();
    let run = |threads: &str, folder: &str| {
        let arguments = format!(
            "reduce lathe_cut_steel -o {folder} --tolerance 0.03 --map-size 128 --size 64 --mesh disc"
        );
        let end = desk.run_with(threads, &arguments);
        assert_eq!(end.code, 0, "{}", end.err);
    };
    run("1", "a");
    run("2", "b");
    let names = desk.files("a");
    assert_eq!(names, desk.files("b"));
    for name in names.iter().filter(|n| !n.ends_with(".json")) {
        let read = |folder: &str| fs::read(desk.path(folder).join(name)).expect("a file");
        assert!(read("a") == read("b"), "{name}");
    }
}

#[test]
fn a_scene_of_ones_own_is_used() {
    let desk = Desk::new();
    desk.write("flat.toml", FLAT);
    desk.write(
        "shot.toml",
        "camera = { eye = [0, 1, 6], target = [0, 0, 0] }\nexposure = -1\nlights = [{ kind = 'directional', toward = [1, 2, 3], irradiance = [2, 2, 2] }]\n",
    );
    let json = desk.json("reduce ./flat.toml -o out --tolerance 0.01 --scene shot.toml --size 64");
    let scene = &json["scenes"][0];
    assert_eq!(
        (&scene["light"], number(&scene["exposure"])),
        (&"shot.toml".into(), -1.0)
    );
    // A camera that looks away would find anything the same.
    desk.write(
        "away.toml",
        "camera = { eye = [0, 1, 6], target = [0, 1, 12] }\n",
    );
    desk.fails(
        "reduce ./flat.toml -o out --tolerance 0.01 --scene away.toml --size 64",
        &["empty", "camera"],
    );
    desk.write(
        "typo.toml",
        "camera = { eye = [0, 1, 6], target = [0, 1, 0] }\nexposrue = 1\n",
    );
    desk.fails(
        "reduce ./flat.toml -o out --tolerance 0.01 --scene typo.toml --size 64",
        &["typo.toml", "exposrue", "exposure"],
    );
}

#[test]
fn nonsense_is_told_what_is_allowed() {
    let desk = Desk::new();
    desk.write("flat.toml", FLAT);
    for bad in ["0", "-1", "nan", "inf", "-0.0", "little", "1e-60"] {
        let arguments = format!("reduce ./flat.toml -o out --tolerance {bad}");
        desk.fails(&arguments, &["--tolerance", "over 0"]);
    }
    let reduce = "reduce ./flat.toml -o out --tolerance 0.01";
    desk.fails(
        &format!("{reduce} --metric flop"),
        &["flop", "Did you mean `flip`?"],
    );
    desk.fails(&format!("{reduce} --metric psnr"), &["flip, de, luminance"]);
    desk.fails(
        "reduce ./flat.toml -o out --tolerance 2",
        &["tolerance", "to 1 in flip"],
    );
    desk.fails("reduce ./flat.toml -o out", &["--tolerance"]);
    desk.fails(&format!("{reduce} --mesh tours"), &["tours", "torus"]);
    desk.fails(&format!("{reduce} --light 0,0,0"), &["--light"]);
    desk.fails(&format!("{reduce} --size 0"), &["--size"]);
    desk.fails(&format!("{reduce} --model wrad"), &["wrad", "ward"]);
    desk.fails(&format!("{reduce} --scene none.toml"), &["none.toml"]);
    desk.fails(&format!("{reduce} --exposure 99"), &["-16 to 16"]);
    desk.fails("reduce ./none.toml -o out --tolerance 0.01", &["none.toml"]);
    let e = desk.run_with(
        "2",
        "reduce ./flat.toml -o flat.toml --tolerance 0.01 --size 32",
    );
    assert_eq!(e.code, 3, "{}", e.err);
    assert_eq!(
        fs::read_to_string(desk.path("flat.toml")).expect("text"),
        FLAT
    );
}

#[test]
fn a_stored_layer_that_is_damaged_is_told() {
    let desk = Desk::new();
    desk.works("reduce brushed_aluminium -o out --tolerance 0.02 --map-size 64 --size 64");
    let recipe = "out/brushed_aluminium.reduced.toml";
    let text = fs::read_to_string(desk.path(recipe)).expect("text");
    assert!(text.contains("[layers.stored]"), "{text}");
    let changed = |from: &str, to: &str| {
        let changed = text.replacen(from, to, 1);
        assert_ne!(changed, text, "{from}");
        desk.write("out/changed.toml", &changed);
    };
    for (from, to, words) in [
        ("encoding = \"log\"", "encoding = \"lgo\"", ["lgo", "log"]),
        ("low = ", "low = -1.0 #", ["layers.0.stored.low", "0 to 2"]),
        (
            "high = ",
            "high = 0.0001 #",
            ["layers.0.stored.low", "less than"],
        ),
        ("widths = ", "widhts = ", ["widhts", "widths"]),
        (
            "brushed_aluminium.reduced_widths.png",
            "../x.png",
            ["layers.0.stored.widths", "--allow-outside"],
        ),
        (
            "brushed_aluminium.reduced_widths.png",
            "changed.toml",
            ["changed.toml", "PNG"],
        ),
    ] {
        changed(from, to);
        desk.fails("inspect out/changed.toml", &words);
    }
}
