//! `anisomap reduce` as the real binary: what it keeps, that it looks the same, and what it says to nonsense.

use anisomap::analyse::{ColourDifference, Flip, PIXELS_PER_DEGREE};
use anisomap::convention::MapInfo;
use anisomap::export::Export;
use anisomap::export::exr::{Precision, write_master};
use anisomap::import::exr::read_master;
use anisomap::import::gltf::read_gltf;
use anisomap::map::{AnisoMap, Size, Texel, Wrap};
use anisomap::math::Axis;
use anisomap::mesh;
use anisomap::preview::{Background, Look, Material, Picture, Scene, Subject, render_reference};
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

/// Rings around a centre, all alike.
const TURNED: &str = "version = 1\nname = 'turned'\nsize = 96\nwrap = 'clamp'\nmesh = 'disc'\n[[layers]]\n[layers.radial]\n\
    cap_radius = 0.0\ncap_fade = 0.0\nalpha_along = 0.05\nalpha_across = 0.4\nspread_along = 0.0\nspread_across = 0.0\nwander = 0.0\nbreaks = 0.0\n";

/// Rings of long lobes.
const SHARP: &str = "version = 1\nname = 'turned'\nsize = 64\n[material]\ndiffuse = [0.02, 0.02, 0.02]\nspecular = [0.4, 0.4, 0.4]\n\
    [[layers]]\n[layers.radial]\nalpha_along = 0.083045\nalpha_across = 0.922722\nspread_along = 0.0\nspread_across = 0.0\n\
    breaks = 0.0\nwander = 0.0\ncap_radius = 0.0\ncap_fade = 0.0\n";

#[test]
fn what_no_scene_or_model_shows_is_dropped_whatever_a_lobe_would_say() {
    let desk = Desk::new();
    desk.write("turned.toml", TURNED);
    let reduce = "reduce ./turned.toml -o out --tolerance 0.01 --size 64";
    // By itself it needs a direction at every point, but no number that changes.
    let json = desk.json(reduce);
    assert_ne!(json["reduced"]["kind"], "constants");
    for unseen in [
        "--model phong",
        "--model blinn-phong",
        "--light=0.2,0.3,-1",
        "--light=0.2,0.3,-1 --metric luminance",
    ] {
        let json = desk.json(&format!("{reduce} {unseen}"));
        assert_eq!(json["reduced"]["kind"], "constants", "{unseen}");
        assert_eq!(json["reduced"]["channels"]["axis"], Value::Null);
    }
    // From behind the cheapest model will do as well.
    let json = desk.json(&format!("{reduce} --light=0.2,0.3,-1"));
    assert_eq!(json["reduced"]["model"], "lambert");
}

#[test]
fn phong_needs_one_width_however_the_lobes_are_turned() {
    let desk = Desk::new();
    let widths = brushed("").replace("angle = 10", "angle = 10\nwander = 20.0");
    desk.write("sheet.toml", &widths.replace("models = []\n", ""));
    let reduce = "reduce ./sheet.toml -o out --tolerance 0.008 --size 64 --model phong";
    let json = desk.json(reduce);
    assert_eq!(json["reduced"]["widths"], "round", "{}", json["reduced"]);
    assert!(number(&json["reduced"]["bytes_per_texel"]) <= 2.0);
    let recipe = fs::read_to_string(desk.path("out/sheet.reduced.toml")).expect("text");
    assert!(
        recipe.contains("widths = \"sheet.reduced_widths.png\""),
        "{recipe}"
    );
}

#[test]
fn rings_that_are_all_alike_need_no_map_but_a_centre() {
    let desk = Desk::new();
    desk.write("turned.toml", TURNED);
    let json = desk.json("reduce ./turned.toml -o out --tolerance 0.02 --size 96 --map-size 256");
    let reduced = &json["reduced"];
    assert_eq!(
        (&reduced["kind"], &reduced["bytes"], &reduced["storage"]),
        (&"radial strip".into(), &0.into(), &Value::Null),
        "{reduced}"
    );
    assert_eq!(
        desk.files("out"),
        ["turned.reduced.json", "turned.reduced.toml"]
    );
    let reduced = desk.map("out/turned.reduced.toml");
    let file = RecipeFile::read(desk.path("turned.toml")).expect("a recipe");
    let full = filled(&file, reduced.size(), &file.files(false));
    let eye = Eye {
        mesh: "disc",
        ..Eye::default()
    };
    let error = eye.error([&full, &reduced], ["ward"; 2]);
    assert!(error.0 <= 0.02 && error.1 <= 0.06, "{error:?}");
}

/// A map of 48x48, each texel by itself.
fn noisy(of: impl Fn(f32, f32) -> Texel) -> AnisoMap {
    let size = Size::new(48, 48).expect("a size");
    let mut map = AnisoMap::constant(size, Wrap::Repeat, of(0.5, 0.5));
    let mut random = Random(7);
    for i in 0..size.texels() {
        let texel = of(random.part(), random.part());
        map.region_mut().set(i, texel);
    }
    map
}

impl Desk {
    /// Writes a map as `NAME.exr` to the bit.
    fn write_map(&self, name: &str, map: &AnisoMap) {
        let info = MapInfo {
            name: name.to_owned(),
            ..MapInfo::default()
        };
        let path = self.path(&format!("{name}.exr"));
        write_master(&path, &Export::new(map, &info), Precision::Float).expect("it is written");
    }

    /// Reduces `NAME.exr`, reads what was written, and holds it against the map it was made of.
    fn reduced(&self, name: &str, map: &AnisoMap, tolerance: f64, metric: &str) -> Value {
        let json = self.json(&format!(
            "reduce ./{name}.exr -o out --tolerance {tolerance} --metric {metric} --size 64 --mesh torus"
        ));
        let back = self.map(&format!("out/{name}.reduced.toml"));
        let eye = Eye {
            metric,
            ..Eye::default()
        };
        let (mean, p999) = eye.error([map, &back], ["ward"; 2]);
        assert!(
            mean <= tolerance && p999 <= 3.0 * tolerance,
            "{mean} {p999}"
        );
        json["reduced"].clone()
    }
}

#[test]
fn each_channel_has_the_depth_that_it_needs() {
    let desk = Desk::new();
    // alpha_x over a wide range, alpha_y over a narrow one, one direction.
    let map = noisy(|a, b| Texel {
        alpha_x: 0.03 * 30f32.powf(a),
        alpha_y: 0.4 + 0.004 * b,
        axis: Axis::from_degrees(30.0),
    });
    desk.write_map("mixed", &map);
    let reduced = desk.reduced("mixed", &map, 2e-4, "luminance");
    let channels = &reduced["channels"];
    assert_eq!(
        (&channels["alpha_x"]["depth"], &channels["alpha_y"]["depth"]),
        (&"u16".into(), &"u8".into()),
        "{reduced}"
    );
    assert_eq!(
        (&channels["axis"], &reduced["axes"]),
        (&Value::Null, &"same".into())
    );
    assert_eq!(reduced["bytes_per_texel"], 3);
    assert_eq!(
        desk.files("out"),
        [
            "mixed.reduced.json",
            "mixed.reduced.toml",
            "mixed.reduced_alpha_x.png",
            "mixed.reduced_alpha_y.png"
        ]
    );
}

#[test]
fn a_width_that_is_one_for_all_is_a_number_and_floats_stand_beside_it() {
    let desk = Desk::new();
    for (name, x_changes) in [("x", true), ("y", false)] {
        let map = noisy(|a, _| {
            let wide = 0.05 * 10f32.powf(a);
            Texel {
                alpha_x: if x_changes { wide } else { 0.4 },
                alpha_y: if x_changes { 0.4 } else { wide },
                axis: Axis::from_degrees(30.0),
            }
        });
        desk.write_map(name, &map);
        let coarse = desk.reduced(name, &map, 0.01, "flip");
        assert_eq!(
            (&coarse["widths"], &coarse["axes"]),
            (&name.into(), &"same".into())
        );
        assert_eq!(coarse["bytes_per_texel"], 1, "{coarse}");
        // Nothing but floats is fine enough, and yet three numbers of four are dropped.
        let fine = desk.reduced(name, &map, 1e-6, "luminance");
        assert_eq!(
            (&fine["widths"], &fine["storage"]),
            (&name.into(), &"f32".into())
        );
        assert_eq!(fine["bytes_per_texel"], 4, "{fine}");
        let file = format!("{name}.reduced_alpha_{name}.exr");
        assert!(desk.files("out").contains(&file), "{:?}", desk.files("out"));
        assert!(desk.map(&format!("out/{name}.reduced.toml")) == map);
    }
    // A file of floats that is damaged is told.
    fs::copy(desk.path("x.exr"), desk.path("out/x.reduced_alpha_x.exr")).expect("a copy");
    desk.fails(
        "inspect out/x.reduced.toml",
        &["x.reduced_alpha_x.exr", "one or two"],
    );
}

/// Somebody else who measures errors.
struct Eye<'a> {
    mesh: &'a str,
    light: Option<Vec3>,
    material: Material,
    metric: &'a str,
    side: u32,
    samples: u32,
}

impl Default for Eye<'_> {
    fn default() -> Self {
        Self {
            mesh: "torus",
            light: None,
            material: Material::default(),
            metric: "flip",
            side: SWEPT,
            samples: 12,
        }
    }
}

impl Eye<'_> {
    /// The error of the second map against the first, each with its model: mean and 99.9th percentile over the pixels that the
    /// mesh touches.
    fn error(&self, maps: [&AnisoMap; 2], models: [&str; 2]) -> (f64, f64) {
        let mesh = mesh::open(self.mesh).expect("a mesh");
        let mut scene = Scene::for_mesh(&mesh);
        if let Some(light) = self.light {
            scene.set_directions(&[light]);
        }
        let size = Size::new(self.side, self.side).expect("a size");
        let draw = |map: &AnisoMap, scene: &Scene, material: &Material, model: &str| {
            let subject = Subject {
                mesh: &mesh,
                map,
                material,
            };
            let looks = Look::list(model).expect("a look");
            let none = Progress::none();
            let drawn = render_reference(subject, scene, &looks, size, self.samples, &none);
            drawn.expect("it draws").swap_remove(0)
        };
        let [first, second] = [0, 1].map(|i| draw(maps[i], &scene, &self.material, models[i]));
        let shadow = Scene {
            lights: Vec::new(),
            background: Background {
                top: [1.0; 3],
                bottom: [1.0; 3],
            },
            ..scene.clone()
        };
        let black = Material {
            diffuse: [0.0; 3],
            specular: [0.0; 3],
            ambient: [0.0; 3],
        };
        let shadow = draw(maps[0], &shadow, &black, "lambert");
        let values = self.values(&first, &second);
        let pairs = values.iter().zip(shadow.pixels());
        let touched = pairs.filter(|(_, p)| p[0] < 0.9999).map(|(v, _)| *v);
        let mut errors: Vec<f32> = touched.collect();
        errors.sort_by(f32::total_cmp);
        let mean = errors.iter().map(|v| f64::from(*v)).sum::<f64>() / errors.len() as f64;
        let at = (0.999 * errors.len() as f64).ceil() as usize - 1;
        (mean, f64::from(errors[at]))
    }

    fn values(&self, first: &Picture, second: &Picture) -> Vec<f32> {
        match self.metric {
            "flip" => {
                let flip = Flip::new(first, second, PIXELS_PER_DEGREE).expect("of one size");
                flip.values().to_vec()
            }
            "de" => {
                let de = ColourDifference::new(first, second).expect("of one size");
                de.values().to_vec()
            }
            _ => {
                let y = |[r, g, b]: [f32; 3]| 0.2126 * r + 0.7152 * g + 0.0722 * b;
                let pairs = first.pixels().iter().zip(second.pixels());
                pairs
                    .map(|(&a, &b)| (y(b) - y(a)).abs() / y(a).max(0.01))
                    .collect()
            }
        }
    }
}

/// Pixels along a side of the sweep's pictures.
const SWEPT: u32 = 96;

/// Numbers that look random and are the same in every run.
struct Random(u64);

impl Random {
    fn next(&mut self) -> u64 {
        self.0 = self
            .0
            .wrapping_mul(6364136223846793005)
            .wrapping_add(1442695040888963407);
        let x = (self.0 ^ (self.0 >> 29)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        x ^ (x >> 32)
    }

    /// 0 to 1.
    fn part(&mut self) -> f32 {
        (self.next() >> 40) as f32 / (1u64 << 24) as f32
    }

    fn of<T: Copy>(&mut self, all: &[T]) -> T {
        all[(self.next() % all.len() as u64) as usize]
    }
}

/// Reduces a random recipe for a random scene, and measures what was written anew: what was reduced how, and the shares of the
/// tolerance that the mean and the 99.9th percentile take.
fn swept(desk: &Desk, n: u64) -> (String, f64) {
    let mut random = Random(n.wrapping_mul(0x9e37_79b9_7f4a_7c15));
    for _ in 0..4 {
        random.next();
    }
    let preset = random.of(&[
        "brushed_aluminium",
        "brushed_aluminium_coarse",
        "canvas",
        "compact_disc",
        "cross_brushed_plate",
        "gold_watch_face",
        "lathe_cut_steel",
        "lightly_brushed_aluminium",
        "pot",
        "rolled_brass",
        "satin",
        "scratched_steel",
        "spun_copper",
        "turned_disc",
        "twill",
        "varnished_wood",
        "vinyl_record",
    ]);
    let factor = |random: &mut Random| 0.4 * 5f32.powf(random.part());
    let (x, y) = (factor(&mut random), factor(&mut random));
    let turn = 180.0 * random.part();
    let mesh = random.of(&["torus", "pot", "sphere", "plane", "cylinder", "disc"]);
    let models = [
        "ward",
        "ward",
        "ward-exact",
        "ward-duer",
        "ward-bounded",
        "beckmann",
        "ggx",
        "phong",
        "blinn-phong",
    ];
    let model = random.of(&models);
    let metric = random.of(&["flip", "flip", "de", "luminance"]);
    let usual = match metric {
        "flip" => 0.01,
        "de" => 0.5,
        _ => 0.02,
    };
    // Short, so that the tolerance is the same number here and there.
    let tolerance: f64 = format!(
        "{:.2e}",
        usual * 0.25 * 16f64.powf(f64::from(random.part()))
    )
    .parse()
    .expect("a number");
    let light = (!random.next().is_multiple_of(3)).then(|| {
        let mut side = || (200.0 * (random.part() - 0.5)).round() / 100.0;
        Vec3::new(side(), side(), side() + 0.4)
    });
    let map_size = random.of(&[64, 96, 128]);
    let presets = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("presets");
    let text = fs::read_to_string(presets.join(format!("{preset}.toml"))).expect("a preset");
    let adjust = format!("\n[adjust]\nalpha_x = {x:.3}\nalpha_y = {y:.3}\nturn = {turn:.1}\n");
    desk.write("swept.toml", &format!("{text}{adjust}"));
    let mut what = format!(
        "reduce ./swept.toml -o out --tolerance {tolerance} --metric {metric} --model {model} --mesh {mesh} \
         --size {SWEPT} --map-size {map_size}"
    );
    if let Some(light) = light {
        what += &format!(" --light={},{},{}", light.x, light.y, light.z);
    }
    let json = desk.json(&what);
    let file = RecipeFile::read(desk.path("swept.toml")).expect("a recipe");
    let size = Size::new(map_size, map_size).expect("a size");
    let full = filled(&file, size, &file.files(false));
    let reduced = desk.map(&format!("out/{preset}.reduced.toml"));
    let kept = json["reduced"]["model"]
        .as_str()
        .expect("a model")
        .to_owned();
    let eye = Eye {
        mesh,
        light: light.map(Vec3::normalize),
        material: file.recipe().material,
        metric,
        ..Eye::default()
    };
    let (mean, p999) = eye.error([&full, &reduced], [model, &kept]);
    let told = json["dropped"].to_string();
    let share = (mean / tolerance).max(p999 / (3.0 * tolerance));
    let drawn = json["tried"].as_array().expect("a list");
    let drawn = drawn.iter().filter(|t| !t["error"].is_null()).count();
    let line = format!(
        "{n}: {preset} {x:.2} {y:.2} {turn:.0}: {what}\n    {drawn} drawn, {told}: mean {mean:.2e} 99.9 % {p999:.2e}"
    );
    fs::remove_dir_all(desk.path("out")).expect("it was written");
    (line, share)
}

/// ANISOMAP_SWEEP=60 tries more, and tells each.
#[test]
fn whatever_is_reduced_stays_within_the_tolerance() {
    let desk = Desk::new();
    let asked = std::env::var("ANISOMAP_SWEEP").ok();
    let cases = asked.as_ref().map_or(7, |n| n.parse().expect("a number"));
    let mut over = Vec::new();
    for n in 0..cases {
        let (line, share) = swept(&desk, n);
        if asked.is_some() {
            println!("{line} {share:.2} of the tolerance");
        }
        if share > 1.0 {
            over.push(format!("{share:.3}: {line}"));
        }
    }
    assert!(
        over.is_empty(),
        "{} of {cases}:\n{}",
        over.len(),
        over.join("\n")
    );
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
fn where_files_cannot_be_read_back_the_formats_are_not_judged() {
    let desk = Desk::new();
    desk.write("flat.toml", FLAT);
    let words =
        "generate ./flat.toml -o out --formats exr,png8,glb,gltf --mesh torus --reduce 0.01 --json";
    let output = Command::new(env!("CARGO_BIN_EXE_anisomap"))
        .args(words.split(' '))
        .env("TMPDIR", desk.path("flat.toml"))
        .current_dir(desk.0.path())
        .output()
        .expect("the binary starts");
    let told = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(0), "{told}");
    assert!(told.contains("exr, png8, glb, gltf"), "{told}");
    assert!(told.contains("not judged"), "{told}");
    let json: Value = serde_json::from_slice(&output.stdout).expect("JSON");
    let reduced = &json["reduced"];
    let all = serde_json::json!(["exr", "png8", "glb", "gltf"]);
    assert_eq!(reduced["unjudged"], all);
    assert_eq!(reduced["seen_in"], serde_json::json!([]));
    // They are as exact as they can be then.
    let path = desk.path("out/flat.exr");
    let file = exr::meta::MetaData::read_from_file(path, false).expect("an OpenEXR file");
    let channels = &file.headers[0].channels.list;
    let full = |c: &exr::meta::attribute::ChannelDescription| {
        c.sample_type == exr::meta::attribute::SampleType::F32
    };
    assert!(channels.iter().all(full), "{channels:?}");
}

#[test]
fn each_format_is_judged_by_what_its_own_files_give_back() {
    let desk = Desk::new();
    // The PNG's roots have no code for these widths; glTF scales its own to the largest.
    desk.write("flat.toml", &FLAT.replace("0.3", "1.4"));
    let generate = |recipe: &str, tolerance: f64| {
        let formats = "--formats exr,png8,png16,glb,gltf --mesh torus";
        let end = desk.run_with(
            "2",
            &format!("generate ./{recipe}.toml -o out {formats} --reduce {tolerance} --json"),
        );
        assert_eq!(end.code, 0, "{}", end.err);
        let json: Value = serde_json::from_str(&end.out).expect("JSON");
        (json["reduced"]["seen_in"].clone(), end.err)
    };
    let (seen, told) = generate("flat", 0.001);
    assert_eq!(seen, serde_json::json!(["png8"]), "{told}");
    assert!(
        told.contains("png8 is coarser") && !told.contains("gl"),
        "{told}"
    );
    // These the PNG holds exactly, but eight bits of a vector turn further than eight of its double angle.
    desk.write("turned.toml", SHARP);
    let tolerance = 0.0165;
    let (seen, told) = generate("turned", tolerance);
    assert_eq!(seen, serde_json::json!(["glb", "gltf"]), "{told}");
    assert!(
        told.contains("glb is coarser") && !told.contains("png8"),
        "{told}"
    );
    // And so it is, as a reader finds them.
    let file = RecipeFile::read(desk.path("turned.toml")).expect("a recipe");
    let full = filled(&file, file.recipe().size, &file.files(false));
    let eye = Eye {
        material: file.recipe().material,
        side: 384,
        samples: 4,
        ..Eye::default()
    };
    let seen = |back: &AnisoMap| {
        let (mean, p999) = eye.error([&full, back], ["ward"; 2]);
        mean > tolerance || p999 > 3.0 * tolerance
    };
    let glb = read_gltf(&desk.path("out/turned.glb")).expect("a GLB").map;
    let exr = read_master(&desk.path("out/turned.exr"));
    assert!(seen(&glb) && !seen(&exr.expect("a master").map));
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
        (
            "[layers.stored.x]",
            "[layers.stored.z]",
            ["`z`", "angle, x, y"],
        ),
        ("encoding = \"log\"", "encoding = \"lgo\"", ["lgo", "log"]),
        ("low = ", "low = -1.0 #", ["layers.0.stored.low", "0 to 2"]),
        (
            "alpha_x.png\"\nencoding = \"log\"\nlow = ",
            "alpha_x.png\"\nencoding = \"log\"\nlow = 1.4 #",
            ["layers.0.stored.x.low", "less than"],
        ),
        ("\nfile = ", "\nfiel = ", ["fiel", "file"]),
        (
            "brushed_aluminium.reduced_alpha_x.png",
            "../x.png",
            ["layers.0.stored.x.file", "--allow-outside"],
        ),
        (
            "brushed_aluminium.reduced_alpha_x.png",
            "brushed_aluminium.reduced_axis.png",
            ["reduced_axis.png", "one"],
        ),
        (
            "brushed_aluminium.reduced_alpha_x.png",
            "changed.toml",
            ["changed.toml", "PNG"],
        ),
        (
            "axis = ",
            "widths = 'w.png'\naxis = ",
            ["layers.0.stored.x", "only without `widths`"],
        ),
    ] {
        changed(from, to);
        desk.fails("inspect out/changed.toml", &words);
    }
}
