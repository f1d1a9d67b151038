//! The real binary, in a folder of its own: what it writes, what it says, how it ends.

use assert_cmd::Command;
use serde_json::Value;
use std::fs;
use std::path::{Path, PathBuf};
use tempfile::TempDir;

/// A folder to work in.
struct Desk {
    folder: TempDir,
}

/// How a command ended.
struct End {
    code: i32,
    out: String,
    err: String,
}

impl Desk {
    fn new() -> Self {
        Self {
            folder: tempfile::tempdir().expect("a temporary folder"),
        }
    }

    fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    fn write(&self, name: &str, text: &str) {
        fs::write(self.path(name), text).expect("the folder is writable");
    }

    fn run(&self, arguments: &str) -> End {
        self.run_words(&arguments.split_whitespace().collect::<Vec<_>>())
    }

    fn run_words(&self, words: &[&str]) -> End {
        let output = Command::new(env!("CARGO_BIN_EXE_anisomap"))
            .args(words)
            .current_dir(self.folder.path())
            .env_remove("DISPLAY")
            .env_remove("WAYLAND_DISPLAY")
            .env_remove("WAYLAND_SOCKET")
            .output()
            .expect("the binary starts");
        let text = |bytes: &[u8]| String::from_utf8(bytes.to_vec()).expect("UTF-8");
        let end = End {
            code: output.status.code().expect("an exit code, not a signal"),
            out: text(&output.stdout),
            err: text(&output.stderr),
        };
        assert!(!end.err.contains("panicked"), "{words:?}: {}", end.err);
        end
    }

    /// Runs what must work.
    fn works(&self, arguments: &str) -> String {
        let end = self.run(arguments);
        assert_eq!(end.code, 0, "{arguments}: {}", end.err);
        end.out
    }

    fn json(&self, arguments: &str) -> Value {
        serde_json::from_str(&self.works(arguments)).expect("JSON")
    }

    /// Runs what must fail with `code` and with every one of `words` in its message, leaving no file named `o...` behind.
    fn fails(&self, arguments: &str, code: i32, words: &[&str]) {
        let end = self.run(arguments);
        assert_eq!(end.code, code, "{arguments}: {}{}", end.out, end.err);
        for word in words {
            assert!(
                end.err.contains(word),
                "{arguments}: no `{word}` in: {}",
                end.err
            );
        }
        let left: Vec<_> = self
            .files("")
            .into_iter()
            .filter(|f| f.starts_with("o"))
            .collect();
        assert!(left.is_empty(), "{arguments} left {left:?}");
    }

    /// Every file below a folder, hidden and unfinished ones too, in order.
    fn files(&self, folder: &str) -> Vec<String> {
        let root = self.path(folder);
        let mut found = Vec::new();
        let mut folders = vec![root.clone()];
        while let Some(folder) = folders.pop() {
            for entry in fs::read_dir(&folder).into_iter().flatten() {
                let path = entry.expect("an entry").path();
                if path.is_dir() {
                    folders.push(path);
                } else {
                    let relative = path.strip_prefix(&root).expect("below the root");
                    found.push(relative.to_string_lossy().into_owned());
                }
            }
        }
        found.sort();
        found
    }
}

fn broken(name: &str) -> String {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/broken");
    folder.join(name).to_string_lossy().into_owned()
}

#[test]
fn generate_writes_and_lists_everything() {
    let desk = Desk::new();
    let out = desk.works("generate pot -o out --size 64");
    let files = desk.files("out");
    for suffix in [
        ".exr",
        "_alpha.exr",
        "_direction.exr",
        "_axis_16bit.png",
        ".glb",
        "_preview.png",
        ".toml",
    ] {
        assert!(
            files.contains(&format!("pot{suffix}")),
            "{suffix} in {files:?}"
        );
    }
    for file in &files {
        assert!(
            out.contains(file.as_str()),
            "{file} is not listed in:\n{out}"
        );
    }
    assert!(
        out.contains("read back from the glTF") && out.contains("degrees"),
        "{out}"
    );
    let report = desk.json("generate pot -o out2 --size 64 --json --formats exr,glb");
    assert_eq!(report["size"], serde_json::json!([64, 64]));
    assert_eq!(report["files"].as_array().expect("a list").len(), 3);
    assert!(report["round_trip"]["degrees"].as_f64().expect("a number") < 0.5);
    assert!(report["seconds"]["fill"].is_number() && report["name"] == "pot");
    assert_eq!(desk.files("out2"), ["pot.exr", "pot.glb", "pot.toml"]);
}

#[test]
fn the_recipe_beside_the_maps_makes_them_again_to_the_byte() {
    let desk = Desk::new();
    desk.works("generate brushed_aluminium -o a --size 40x20 --seed 9 --set adjust.turn=30 --formats exr,png8");
    desk.works("generate a/brushed_aluminium.toml -o b --formats exr,png8");
    let files = desk.files("a");
    assert_eq!(files, desk.files("b"));
    for file in files {
        let read = |folder: &str| fs::read(desk.path(folder).join(&file)).expect("written");
        assert!(read("a") == read("b"), "{file} differs");
    }
}

#[test]
fn the_recipe_beside_the_maps_finds_its_files_and_mesh_again() {
    let desk = Desk::new();
    desk.works("generate pot -o mine --size 16 --formats exr --set name=base");
    desk.write(
        "mine/one.obj",
        "v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 0 1\nf 1/1 2/2 3/3\n",
    );
    let image = "size = 16\n[[layers]]\n[layers.image]\nfile = 'base.exr'\n";
    desk.write("mine/plain.toml", &format!("version = 1\n{image}"));
    desk.write(
        "mine/own.toml",
        &format!("version = 1\nmesh = 'one.obj'\n{image}"),
    );
    for arguments in [
        "mine/own.toml",
        "mine/own.toml --mesh sphere",
        "mine/plain.toml --mesh mine/one.obj",
    ] {
        for folder in ["a", "b"] {
            let _ = fs::remove_dir_all(desk.path(folder));
        }
        desk.works(&format!("generate {arguments} -o a --formats exr,glb"));
        let name = if arguments.contains("own") {
            "own"
        } else {
            "plain"
        };
        let end = desk.run(&format!("generate a/{name}.toml -o b --formats exr,glb"));
        assert_eq!(end.code, 2, "{}", end.err);
        assert!(end.err.contains("--allow-outside"), "{}", end.err);
        let copy = fs::read_to_string(desk.path(&format!("a/{name}.toml"))).expect("written");
        assert!(copy.contains("--allow-outside"), "{copy}");
        desk.works(&format!(
            "generate a/{name}.toml -o b --formats exr,glb --allow-outside"
        ));
        assert_eq!(desk.files("a"), desk.files("b"));
        for file in desk.files("a") {
            let read = |folder: &str| fs::read(desk.path(folder).join(&file)).expect("written");
            assert!(read("a") == read("b"), "{arguments}: {file} differs");
        }
    }
}

#[test]
fn thread_counts_do_not_change_a_byte() {
    let desk = Desk::new();
    let presets = [
        "scratched_steel",
        "pot",
        "vinyl_record",
        "satin",
        "varnished_wood",
    ];
    for threads in ["1", "3"] {
        for preset in presets {
            Command::new(env!("CARGO_BIN_EXE_anisomap"))
                .args(["generate", preset, "--size", "200x130", "-o", threads])
                .current_dir(desk.folder.path())
                .env("RAYON_NUM_THREADS", threads)
                .assert()
                .success();
        }
    }
    assert!(desk.files("1").len() >= 8 * presets.len());
    for file in desk.files("1") {
        let read = |folder: &str| fs::read(desk.path(folder).join(&file)).expect("written");
        assert!(read("1") == read("3"), "{file} differs");
    }
}

#[test]
fn a_recipe_is_never_written_over() {
    let desk = Desk::new();
    let text = "version = 1 # mine\nname = \"own\"\nsize = 4\n";
    desk.write("own.toml", text);
    desk.works("generate ./own.toml -o . --formats exr");
    assert_eq!(
        fs::read_to_string(desk.path("own.toml")).expect("there"),
        text
    );
    let refused = |arguments: &str| {
        let end = desk.run(arguments);
        assert_eq!(end.code, 2, "{}", end.err);
        assert!(
            end.err.contains("own.toml") && end.err.contains("another folder"),
            "{}",
            end.err
        );
        let now = fs::read_to_string(desk.path("own.toml")).expect("there");
        assert_eq!(now, text);
    };
    refused("generate ./own.toml -o . --formats exr --size 8");
    refused("generate pot -o . --set name=own --formats exr");
    // What the tool wrote itself it may replace.
    desk.works("generate pot -o maps --size 4 --formats exr");
    desk.works("generate pot -o maps --size 8 --formats exr");
    let copy = fs::read_to_string(desk.path("maps/pot.toml")).expect("there");
    assert!(
        copy.starts_with("# The recipe of the maps") && copy.contains("[8, 8]"),
        "{copy}"
    );
}

#[test]
fn a_single_texel_is_a_map() {
    let desk = Desk::new();
    desk.works("generate turned_disc -o m --size 1x1");
    desk.works("inspect m/turned_disc.exr");
    desk.works("preview m/turned_disc.exr -o p.png --size 1x1");
}

#[test]
fn presets_are_listed_and_shown() {
    let desk = Desk::new();
    let names = desk.works("presets list --names");
    let names: Vec<_> = names.lines().collect();
    assert!(names.len() >= 14 && names.contains(&"pot"));
    let list = desk.json("presets --json");
    assert_eq!(list.as_array().expect("a list").len(), names.len());
    assert!(list[0]["description"].as_str().expect("text").len() > 10);
    assert!(desk.works("presets").contains("vinyl_record"));
    desk.write("mine.toml", &desk.works("presets show pot"));
    // The copy is called what its file is: it does not write over the preset's maps.
    desk.works("generate ./mine.toml -o maps --size 32 --formats exr");
    assert!(desk.path("maps/mine.exr").exists() && !desk.path("maps/pot.exr").exists());
    assert_eq!(
        desk.json("presets show pot --json")["layers"][0]["name"],
        "finish"
    );
    desk.fails("presets show pott", 2, &["`pott`", "Did you mean `pot`?"]);
    let end = desk.run("presets show maps/mine.toml");
    assert!(
        end.code == 2 && !end.err.contains("or a path"),
        "{}",
        end.err
    );
}

#[test]
fn every_preset_becomes_a_map_in_which_nothing_is_wrong() {
    let desk = Desk::new();
    for name in desk.works("presets list --names").lines() {
        desk.works(&format!("generate {name} -o maps --size 64 --formats exr"));
        let report = desk.json(&format!("inspect maps/{name}.exr --json"));
        assert_eq!(report["name"], name);
        assert_eq!(report["statistics"]["width"], 64);
        assert!(report["findings"].is_array() && report["mended"]["non_finite"] == 0);
    }
}

#[test]
fn preview_draws_recipes_maps_and_differences() {
    let desk = Desk::new();
    desk.works("generate pot -o m --size 64 --formats exr,glb");
    for input in ["pot", "m/pot.toml", "m/pot.exr", "m/pot.glb"] {
        desk.works(&format!(
            "preview {input} -o p.png --size 64x48 --mesh sphere"
        ));
        let (width, height) = image::image_dimensions(desk.path("p.png")).expect("a PNG");
        assert_eq!((width, height), (64, 48), "{input}");
    }
    desk.works(
        "preview pot -o p.png --size 300x100 --map-size 32 --model phong:mean,ward:mean,ward",
    );
    desk.works("preview pot -o q.png --size 90 --map-size 32 --light=-1,2,3 --light 1,1,1 --exposure -2 --samples 1");
    let report = desk
        .json("preview pot -o d.png --size 90 --map-size 32 --model ward,ggx --difference --json");
    assert!(report["difference"]["largest"].as_f64().expect("a number") > 0.0);
    assert_eq!(report["models"], serde_json::json!(["ward", "ggx"]));
}

#[test]
fn a_finished_map_is_drawn_on_the_mesh_and_in_the_colours_it_was_made_with() {
    let desk = Desk::new();
    desk.works("generate pot -o m --size 64 --formats exr,glb");
    let picture = |input: &str| {
        desk.works(&format!("preview {input} -o p.png --size 64x48"));
        image::open(desk.path("p.png")).expect("a PNG").into_rgb8()
    };
    let off = |a: &image::RgbImage, b: &image::RgbImage| {
        let steps = a.as_raw().iter().zip(b.as_raw());
        let sum: u32 = steps.map(|(a, b)| u32::from(a.abs_diff(*b))).sum();
        sum as f32 / a.as_raw().len() as f32
    };
    let recipe = picture("m/pot.toml");
    assert!(
        off(&recipe, &picture("m/pot.exr")) < 0.5,
        "the same but for halves"
    );
    assert!(
        off(&recipe, &picture("m/pot.glb")) < 3.0,
        "the same but for 8 bits and GGX"
    );
    let torus = picture("m/pot.exr --mesh torus");
    assert!(off(&recipe, &torus) > 3.0, "another mesh would show");
    // A mesh file is found from the map, and what is missing or outside costs only itself.
    desk.write(
        "one.obj",
        "v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 0 1\nf 1/1 2/2 3/3\n",
    );
    desk.works("generate pot -o m --size 16 --formats exr --mesh one.obj");
    let end = desk.run("preview m/pot.exr -o p.png --size 16");
    assert_eq!(end.code, 0, "{}", end.err);
    assert!(
        end.err.contains("torus") && end.err.contains("../one.obj"),
        "{}",
        end.err
    );
    let end = desk.run("preview m/pot.exr -o p.png --size 16 --allow-outside");
    assert_eq!((end.code, end.err.as_str()), (0, ""));
}

#[test]
fn a_mesh_without_texture_coordinates_is_projected_when_its_word_says_so() {
    let desk = Desk::new();
    desk.write(
        "bare.obj",
        "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n",
    );
    let brushed = "[[layers]]\n[layers.brushed]\n";
    desk.write(
        "bare.toml",
        &format!("version = 1\nmesh = 'bare.obj'\n{brushed}"),
    );
    desk.write(
        "laid.toml",
        &format!("version = 1\nmesh = 'bare.obj#box'\n{brushed}"),
    );
    let end = desk.run("preview bare.toml -o p.png --size 16");
    assert_eq!(end.code, 2);
    assert!(
        end.err.contains("bare.obj") && end.err.contains("#box"),
        "{}",
        end.err
    );
    desk.works("preview laid.toml -o p.png --size 16");
    desk.works("preview pot --mesh bare.obj#box -o p.png --size 16");
    desk.works("generate laid.toml -o m --size 64 --formats glb,exr");
    // The mesh goes out with its new coordinates, and the recipe beside it still says how they are made.
    let laid = anisomap::mesh::open(&desk.path("bare.obj#box").display().to_string()).unwrap();
    let out = anisomap::mesh::load(&desk.path("m/laid.glb")).unwrap();
    assert_eq!(out.triangles.len(), 4);
    for (a, b) in laid.triangles.iter().zip(&out.triangles) {
        for (a, b) in a.iter().zip(b) {
            let [a, b] = [laid.uvs[*a as usize], out.uvs[*b as usize]];
            assert!((a.x - b.x).abs() + (a.y - b.y).abs() < 1e-6);
        }
    }
    let copy = fs::read_to_string(desk.path("m/laid.toml")).unwrap();
    assert!(copy.contains("../bare.obj#box"), "{copy}");
    desk.works("preview m/laid.toml -o p.png --size 16 --allow-outside");
}

#[test]
fn inspect_ends_with_1_when_something_is_wrong() {
    use exr::prelude::*;
    let desk = Desk::new();
    let plane = |name: &str, value: f32| AnyChannel::new(name, FlatSamples::F32(vec![value; 4]));
    let channels = AnyChannels::sort(SmallVec::from_vec(vec![
        plane("alpha.X", f32::NAN),
        plane("alpha.Y", 0.2),
        plane("axis.X", 1.0),
        plane("axis.Y", 0.0),
    ]));
    let layer = Layer::new(
        (2, 2),
        LayerAttributes::default(),
        Encoding::UNCOMPRESSED,
        channels,
    );
    Image::from_layer(layer)
        .write()
        .to_file(desk.path("nan.exr"))
        .expect("written");
    desk.write(
        "nan.toml",
        "version = 1\nsize = 4\n[[layers]]\nimage.file = 'nan.exr'\n",
    );
    for input in ["nan.exr", "nan.toml"] {
        let end = desk.run(&format!("inspect {input}"));
        assert_eq!(end.code, 1, "{}{}", end.out, end.err);
        assert!(end.out.contains("error"), "{}", end.out);
        // Who does not inspect is told too.
        let end = desk.run(&format!("preview {input} -o p.png --size 8 --json"));
        assert!(
            end.code == 0 && end.err.contains("4 not finite"),
            "{}",
            end.err
        );
        let report: Value = serde_json::from_str(&end.out).expect("JSON");
        assert_eq!(report["mended"]["non_finite"], 4);
    }
    let end = desk.run("generate nan.toml -o maps --formats exr");
    assert!(
        end.code == 0 && end.err.contains("4 not finite"),
        "{}",
        end.err
    );
}

#[test]
fn inspect_warns_of_a_material_that_gives_back_more_light_than_it_gets() {
    let desk = Desk::new();
    desk.write(
        "bright.toml",
        "version = 1\nsize = 16\n[material]\ndiffuse = [0.2, 0.2, 0.2]\nspecular = [0.8, 0.8, 0.8]\n\
         [[layers]]\nconstant = { alpha_x = 0.5, alpha_y = 1.0 }\n",
    );
    let energy = |input: &str| -> Option<Value> {
        let report = desk.json(&format!("inspect {input} --json"));
        let findings = report["findings"].as_array().expect("a list").clone();
        findings.into_iter().find(|f| f["code"] == "energy")
    };
    let found = energy("bright.toml").expect("a finding");
    assert_eq!(
        (&found["severity"], &found["count"]),
        (&"warning".into(), &256.into())
    );
    assert!(
        found["message"].as_str().expect("text").contains("1.27"),
        "{found}"
    );
    // What is written beside the map tells the map's own colours; a model that is bounded does not glow.
    desk.works("generate bright.toml -o maps --formats exr");
    assert!(energy("maps/bright.exr").is_some());
    assert!(energy("bright.toml --set scene.models=['ward-bounded']").is_none());
    assert!(energy("pot --size 32").is_none());
}

/// Elsewhere a window needs no variable, and would open.
#[cfg(target_os = "linux")]
#[test]
fn without_a_display_the_studio_says_so() {
    let desk = Desk::new();
    for words in ["", "gui", "gui pot"] {
        desk.fails(words, 3, &["no window can be opened", "anisomap --help"]);
    }
    desk.fails("gui pott", 2, &["`pott`", "Did you mean `pot`?"]);
    desk.fails("nothing.toml", 2, &["nothing.toml", "No such file"]);
}

#[test]
fn bad_words_on_the_command_line_are_refused_with_the_nearest() {
    let desk = Desk::new();
    desk.fails("genrate pot -o out", 2, &["generate"]);
    desk.fails(
        "generate pott -o out",
        2,
        &["`pott`", "Did you mean `pot`?"],
    );
    desk.fails("generate pot -o out --size 0", 2, &["--size", "1 to 32768"]);
    desk.fails(
        "generate pot -o out --size 1000000000",
        2,
        &["--size", "1 to 32768"],
    );
    desk.fails(
        "generate pot -o out --size 32768",
        2,
        &["16384x16384 in all"],
    );
    desk.fails("generate pot -o out --size 4xx", 2, &["N or WxH"]);
    desk.fails(
        "generate pot -o out --seed -1",
        2,
        &["--seed", "0 to 9223372036854775807"],
    );
    desk.fails(
        "generate pot -o out --formats exr,exrr",
        2,
        &["`exrr`", "Did you mean `exr`?"],
    );
    desk.fails(
        "generate pot -o out --mesh tours",
        2,
        &["`tours`", "Did you mean `torus`?"],
    );
    desk.fails("generate pot -o out --set alpha", 2, &["KEY=VALUE"]);
    desk.fails(
        "generate pot -o out --set adjst.turn=3",
        2,
        &["--set adjst.turn=3", "Did you mean `adjust`?"],
    );
    desk.fails(
        "generate pot -o out --set adjust.alpha_x=0",
        2,
        &["0.01 to 100"],
    );
    desk.fails(
        "generate pot -o out --set adjust.alpha_x=NaN",
        2,
        &["adjust.alpha_x", "a number"],
    );
    desk.fails(
        "generate pot -o out --set layers.0.pot.alpha_along=nan",
        2,
        &["alpha_along is NaN", "0.001 to 1.5"],
    );
    desk.fails(
        "preview pot -o out.png --model wrad",
        2,
        &["`wrad`", "Did you mean `ward`?"],
    );
    desk.fails("preview pot -o out.png --light 0,0,0", 2, &["not all 0"]);
    desk.fails("preview pot -o out.png --samples 9", 2, &["1 to 4"]);
    desk.fails("preview pot -o out.png --difference", 2, &["with two"]);
    desk.fails("preview pot -o out.jpg", 2, &[".png"]);
}

#[test]
fn bad_recipes_name_file_line_key_and_value() {
    let desk = Desk::new();
    for (text, words) in [
        ("size = 8", &["bad.toml", "version"][..]),
        ("version = 1\nsize = [8", &["line 2", "TOML"]),
        (
            "version = 1\n[materail]",
            &["line 2", "`materail`", "Did you mean `material`?"],
        ),
        ("version = 1\nsize = 'big'", &["line 2", "size", "\"big\""]),
        ("version = 1\nsize = 0", &["line 2", "0x0"]),
        (
            "version = 1\nsize = 1000000000",
            &["line 2", "1000000000x1000000000"],
        ),
        ("version = 1\nseed = -3", &["line 2", "-3", "from 0"]),
        (
            "version = 1\n[[layers]]\n[layers.brushed]\nalpha_along = 0",
            &[
                "line 4",
                "layers.0.brushed.alpha_along is 0",
                "0.001 to 1.5",
            ],
        ),
        (
            "version = 1\n[[layers]]\n[layers.brushed]\nalpha_along = nan",
            &["line 4", "alpha_along is NaN"],
        ),
        (
            "version = 1\n[[layers]]\n[layers.brushd]",
            &["line 3", "Did you mean `brushed`?"],
        ),
        ("version = 1\nname = '../../up'", &["line 2", "name"]),
    ] {
        desk.write("bad.toml", text);
        desk.fails("generate bad.toml -o out", 2, words);
        desk.fails("inspect bad.toml", 2, words);
    }
    desk.fails("generate none.toml -o out", 2, &["cannot read none.toml"]);
    fs::create_dir(desk.path("folder.toml")).expect("writable");
    desk.fails(
        "generate folder.toml -o out",
        2,
        &["folder.toml", "a folder"],
    );
    fs::write(desk.path("bytes.toml"), [0xff, 0xd8, 0xff]).expect("writable");
    desk.fails(
        "generate bytes.toml -o out",
        2,
        &["bytes.toml", "UTF-8", "Name a .toml file"],
    );
}

#[test]
fn a_recipe_reads_files_of_its_own_folder_only_unless_allowed() {
    let desk = Desk::new();
    desk.works("generate pot -o maps --size 16 --formats exr --set name=base");
    fs::create_dir(desk.path("mine")).expect("writable");
    fs::copy(desk.path("maps/base.exr"), desk.path("mine/base.exr")).expect("writable");
    let recipe = |file: &str| {
        format!("version = 1\nsize = 16\n[[layers]]\n[layers.image]\nfile = '{file}'\n")
    };
    desk.write("mine/inside.toml", &recipe("base.exr"));
    desk.works("generate mine/inside.toml -o same --formats exr");
    let widths =
        |path: &str| desk.json(&format!("inspect {path} --json"))["statistics"].to_string();
    assert_eq!(widths("same/inside.exr"), widths("maps/base.exr"));
    desk.write("mine/outside.toml", &recipe("../maps/base.exr"));
    let words = [
        "mine/outside.toml: line 5: layers.0.image.file",
        "../maps/base.exr",
        "--allow-outside",
    ];
    desk.fails("generate mine/outside.toml -o out", 2, &words);
    desk.works("generate mine/outside.toml -o allowed --formats exr --allow-outside");
    desk.write(
        "mine/mesh.toml",
        "version = 1\nsize = 4\nmesh = '../secret.glb'\n",
    );
    desk.fails(
        "generate mine/mesh.toml -o out",
        2,
        &[
            "mine/mesh.toml: line 3: mesh",
            "../secret.glb",
            "--allow-outside",
        ],
    );
    desk.write("mine/word.toml", "version = 1\nsize = 4\nmesh = 'tours'\n");
    desk.fails(
        "generate mine/word.toml -o out",
        2,
        &[
            "mine/word.toml: line 3: mesh is `tours`",
            "Did you mean `torus`?",
        ],
    );
    desk.write("mine/missing.toml", &recipe("no.exr"));
    desk.fails(
        "inspect mine/missing.toml",
        2,
        &[
            "mine/missing.toml: line 5: layers.0.image.file is `no.exr`",
            "cannot read mine/no.exr",
        ],
    );
}

#[test]
fn outputs_that_cannot_be_written_end_with_3() {
    let desk = Desk::new();
    desk.write("file", "in the way");
    desk.fails(
        "generate pot -o file --size 4",
        3,
        &["file", "it is a file"],
    );
    desk.fails(
        "generate pot -o file/out --size 4",
        3,
        &["cannot write file/out"],
    );
    desk.fails(
        "preview pot -o none/x.png --map-size 4 --size 8",
        3,
        &["none/x.png", "folder"],
    );
    fs::create_dir(desk.path("dir.png")).expect("writable");
    desk.fails(
        "preview pot -o dir.png --map-size 4 --size 8",
        3,
        &["dir.png", "a folder"],
    );
    fs::create_dir_all(desk.path("way/pot.exr")).expect("writable");
    let end = desk.run("generate pot -o way --size 4 --formats exr");
    assert_eq!((end.code, desk.files("way").len()), (3, 0), "{}", end.err);
}

#[test]
fn a_picture_that_cannot_be_drawn_is_refused_before_the_first_file() {
    let desk = Desk::new();
    let list = |item: &str, n: usize| vec![item; n].join(", ");
    desk.write(
        "lights.toml",
        &format!(
            "version = 1\nsize = 4\n[scene]\nlights = [{}]\n",
            list("[0, 1, 0]", 65)
        ),
    );
    desk.fails("generate lights.toml -o out", 2, &["lights", "at most 64"]);
    desk.write(
        "models.toml",
        &format!(
            "version = 1\nsize = 4\n[scene]\nmodels = [{}]\n",
            list("'ward'", 961)
        ),
    );
    desk.fails(
        "generate models.toml -o out",
        2,
        &["side by side", "1 to 64"],
    );
}

#[test]
fn broken_maps_and_meshes_end_with_2_and_a_sentence() {
    let desk = Desk::new();
    for (file, words) in [
        ("truncated.exr", "cut short"),
        ("other_channels.exr", "alpha.X"),
        ("huge_header.exr", "1000000x1000000"),
        ("dwa.exr", "dwa"),
        ("truncated.glb", "cut short"),
    ] {
        desk.fails(&format!("inspect {}", broken(file)), 2, &[file, words]);
        desk.fails(
            &format!("preview {} -o out.png", broken(file)),
            2,
            &[file, words],
        );
    }
    for (file, words) in [
        ("no_position.glb", "POSITION"),
        ("index_out_of_range.glb", "vertex 900"),
        ("index_out_of_range.obj", "900"),
        ("no_uvs.obj", "texture coordinates"),
        ("truncated.glb", "bytes"),
        ("dwa.exr", "not a mesh"),
    ] {
        let mesh = broken(file);
        desk.fails(
            &format!("preview pot --map-size 8 -o out.png --mesh {mesh}"),
            2,
            &[file, words],
        );
        desk.fails(
            &format!("generate pot --size 8 -o out --mesh {mesh}"),
            2,
            &[file, words],
        );
    }
    desk.fails(
        "preview pot --map-size 8 -o out.png --mesh none.glb",
        2,
        &["cannot read none.glb"],
    );
    for file in ["empty.exr", "empty.glb", "empty.gltf", "empty.toml"] {
        desk.write(file, "");
        desk.fails(&format!("inspect {file}"), 2, &[file, "is empty"]);
        desk.fails(&format!("generate {file} -o out"), 2, &[file, "is empty"]);
    }
    desk.write("empty.obj", "");
    for file in ["empty.glb", "empty.gltf", "empty.obj"] {
        let words = format!("preview pot --map-size 8 -o out.png --mesh {file}");
        desk.fails(&words, 2, &[file, "is empty"]);
    }
    desk.fails("inspect none.exr", 2, &["cannot read none.exr"]);
    desk.fails(
        &format!("inspect {}", broken("no_uvs.obj")),
        2,
        &["no recipe and no map"],
    );
    fs::create_dir(desk.path("dir.exr")).expect("writable");
    desk.fails("inspect dir.exr", 2, &["dir.exr", "folder"]);
    fs::create_dir(desk.path("dir.glb")).expect("writable");
    desk.fails(
        "preview pot -o out.png --mesh dir.glb",
        2,
        &["dir.glb", "folder"],
    );
}

#[test]
fn a_newer_recipe_is_used_as_far_as_it_is_known() {
    let desk = Desk::new();
    desk.write(
        "new.toml",
        "version = 7\nsize = 4\nsparkle = true\n[[layers]]\n[layers.constant]\n",
    );
    let end = desk.run("generate new.toml -o out --formats exr");
    assert_eq!(end.code, 0, "{}", end.err);
    assert!(
        end.err.contains("sparkle") && end.err.contains("newer"),
        "{}",
        end.err
    );
    let copy = fs::read_to_string(desk.path("out/new.toml")).expect("written");
    assert!(copy.contains("sparkle"), "nothing is lost:\n{copy}");
}

#[test]
fn a_batch_of_all_presets_makes_every_combination() {
    let desk = Desk::new();
    desk.write(
        "all.toml",
        "version = 1\n[[jobs]]\nrecipes = ['*']\nsizes = [16, [32, 8]]\nsweep.'adjust.alpha_y' = [0.5, 1, 2]\n",
    );
    let presets = desk.works("presets list --names").lines().count();
    let report = desk.json("batch all.toml -o maps --json");
    assert_eq!(report["made"], presets * 6);
    assert_eq!(
        (&report["failed"], &report["files"]),
        (&0.into(), &(presets * 12).into())
    );
    let files = desk.files("maps");
    assert_eq!(
        files.iter().filter(|f| f.ends_with(".exr")).count(),
        presets * 6
    );
    assert_eq!(files.len(), presets * 12);
    assert!(
        files.contains(&"pot-32x8-adjust.alpha_y=0.5.exr".to_owned()),
        "{files:?}"
    );
    let single = desk.json("inspect maps/pot-16x16-adjust.alpha_y=2.exr --json");
    let plain = desk.json("inspect pot --size 16 --set adjust.alpha_y=2 --json");
    let median = |r: &Value| {
        r["statistics"]["alpha_y"]["p50"]
            .as_f64()
            .expect("a number")
    };
    assert!((median(&single) / median(&plain) - 1.0).abs() < 2e-3);
}

#[test]
fn a_batch_says_once_how_its_png_files_are_read_and_counts_what_is_there() {
    let desk = Desk::new();
    desk.write("s.toml", "version = 1\nsize = 8\n");
    desk.write(
        "m.toml",
        "version = 1\n[[jobs]]\nrecipes = [\"s.toml\"]\nseeds = [1, 2, 3]\nformats = [\"png8\"]\n",
    );
    let report = desk.json("batch m.toml -o out --json");
    let there = fs::read_dir(desk.path("out")).unwrap().count();
    assert_eq!(report["files"], there);
    let readme = fs::read_to_string(desk.path("out/README_png.txt")).unwrap();
    assert!(readme.contains("_8bit.png") && !readme.contains("_16bit"));
}

#[test]
fn one_failure_does_not_stop_a_batch() {
    let desk = Desk::new();
    desk.write("broken.toml", "version = 1\nsizee = 3\n");
    desk.write(
        "m.toml",
        "version = 1\n[[jobs]]\nrecipes = ['pot', './broken.toml', 'satin', 'satn']\nsizes = [8]\nsweep.'layers.0.pot.wear' = [0.1]\n[[jobs]]\nrecipe = 'twill'\nsizes = [8]\n",
    );
    let end = desk.run("batch m.toml -o maps --jobs 2");
    assert_eq!(end.code, 1, "{}", end.err);
    assert!(end.out.starts_with("2 of 5 made: 4 files"), "{}", end.out);
    for words in [
        "3 failed",
        "broken.toml: line 2: unknown key `sizee`",
        "Did you mean `satin`?",
        "layers.0.pot.wear=0.1",
    ] {
        assert!(end.out.contains(words), "no `{words}` in {}", end.out);
    }
    assert!(end.err.contains("failed: broken-8x8"), "{}", end.err);
    let files = desk.files("maps");
    assert_eq!(files.len(), 4, "{files:?}");
    assert!(
        !end.err.contains('\u{1b}'),
        "no bar where stderr is no terminal"
    );
}

#[test]
fn a_batch_is_the_same_with_any_number_of_jobs() {
    let desk = Desk::new();
    desk.write(
        "m.toml",
        "version = 1\n[[jobs]]\nrecipes = ['pot', 'canvas']\nsizes = [70]\nseeds = [1, 2]\nformats = ['exr', 'preview']\nmesh = 'sphere'\n",
    );
    desk.works("batch m.toml -o one --jobs 1");
    desk.works("batch m.toml -o many --jobs 4");
    let files = desk.files("one");
    assert_eq!(files.len(), 12);
    for file in files {
        let read = |folder: &str| fs::read(desk.path(folder).join(&file)).expect("written");
        assert!(read("one") == read("many"), "{file} differs");
    }
}

#[test]
fn bad_manifests_end_with_2_and_write_nothing() {
    let desk = Desk::new();
    for (text, words) in [
        (
            "version = 1\n[[job]]\nrecipe = 'pot'",
            &["line 2", "`job`", "Did you mean `jobs`?"][..],
        ),
        (
            "version = 1\n[[jobs]]\nrecipe = 'pot'\nsizes = [0]",
            &["jobs.0", "0x0"],
        ),
        ("version = 1\njobs = []", &["no map"]),
        (
            "version = 1\n[[jobs]]\nrecipe = 'pot'\n[jobs.sweep]\nseed = { from = 1, to = 9999, steps = 9999 }\n'adjust.turn' = { from = 0, to = 90, steps = 91 }",
            &["909909 maps", "100000", "--limit 909909"],
        ),
    ] {
        desk.write("m.toml", text);
        desk.fails("batch m.toml -o out", 2, words);
    }
    desk.write("recipe.toml", "version = 1\nsize = 8\n");
    let words = ["recipe.toml", "this is a recipe", "anisomap generate"];
    desk.fails("batch recipe.toml -o out", 2, &words);
    desk.fails("batch none.toml -o out", 2, &["cannot read none.toml"]);
    fs::create_dir(desk.path("dir.toml")).expect("writable");
    desk.fails("batch dir.toml -o out", 2, &["a folder"]);
}

#[test]
fn a_batch_makes_its_folder_first_and_ends_with_3_without_one() {
    let desk = Desk::new();
    desk.write(
        "m.toml",
        "version = 1\n[[jobs]]\nrecipe = 'pot'\nsizes = [4]\n",
    );
    desk.write("file", "in the way");
    desk.fails("batch m.toml -o file", 3, &["file", "it is a file"]);
    desk.fails("batch m.toml -o file/out", 3, &["cannot write file/out"]);
}

#[test]
fn a_batch_takes_its_mesh_from_the_manifests_folder() {
    let desk = Desk::new();
    let job = |mesh: &str| {
        format!(
            "version = 1\n[[jobs]]\nrecipe = 'pot'\nsizes = [4]\nformats = ['glb']\nmesh = '{mesh}'\n"
        )
    };
    fs::create_dir(desk.path("mine")).expect("writable");
    desk.write(
        "mine/one.obj",
        "v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 0 1\nf 1/1 2/2 3/3\n",
    );
    desk.write("mine/m.toml", &job("one.obj"));
    desk.works("batch mine/m.toml -o maps");
    desk.write("m.toml", &job("one.obj"));
    desk.fails("batch m.toml -o out", 2, &["m.toml", "jobs.0", "one.obj"]);
    desk.write("m.toml", &job("tours"));
    let words = ["jobs.0: mesh is `tours`", "Did you mean `torus`?"];
    desk.fails("batch m.toml -o out", 2, &words);
    assert!(!desk.path("out").exists());
}

#[test]
fn the_help_of_json_names_every_key() {
    let desk = Desk::new();
    desk.write(
        "m.toml",
        "version = 1\n[[jobs]]\nrecipe = 'pot'\nsizes = [4]\n",
    );
    for (command, arguments) in [
        ("generate", "pot -o maps --size 4 --formats exr"),
        ("preview", "pot -o p.png --map-size 4 --size 8"),
        ("inspect", "pot --size 4"),
        ("batch", "m.toml -o maps"),
    ] {
        let help = desk.works(&format!("{command} --help"));
        let help = help.split("--json").nth(1).expect("the option's help");
        let report = desk.json(&format!("{command} {arguments} --json"));
        for key in report.as_object().expect("an object").keys() {
            assert!(
                help.contains(key.as_str()),
                "{command} --json: {key} in {help}"
            );
        }
    }
}

#[test]
fn completions_are_written_for_every_shell() {
    let desk = Desk::new();
    for shell in ["bash", "zsh", "fish", "powershell", "elvish"] {
        assert!(
            desk.works(&format!("completions {shell}"))
                .contains("anisomap")
        );
    }
    desk.fails("completions fsh", 2, &["fish"]);
}

#[cfg(unix)]
#[test]
fn a_reader_that_goes_away_is_no_error() {
    use std::process::{Command, Stdio};
    let mut child = Command::new(env!("CARGO_BIN_EXE_anisomap"))
        .args(["completions", "zsh"])
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .expect("the binary starts");
    drop(child.stdout.take());
    let output = child.wait_with_output().expect("it ends");
    assert!(output.status.success());
    assert!(
        output.stderr.is_empty(),
        "{}",
        String::from_utf8_lossy(&output.stderr)
    );
}

/// No file may have more than 20 blocks, as on a disk that is full from then on.
#[cfg(target_os = "linux")]
#[test]
fn a_full_disk_and_a_read_only_folder_end_with_3_and_spoil_nothing() {
    let desk = Desk::new();
    fs::create_dir(desk.path("out")).expect("room");
    desk.write("out/pot.exr", "before");
    let run = |words: &str| {
        let output = Command::new("sh")
            .args(["-c", "trap '' XFSZ; ulimit -f 20; exec \"$@\"", "sh"])
            .arg(env!("CARGO_BIN_EXE_anisomap"))
            .args(words.split(' '))
            .current_dir(desk.folder.path())
            .output()
            .expect("the binary starts");
        let told = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!(output.status.code(), Some(3), "{words}: {told}");
        told
    };
    let told = run("generate pot -o out --size 512");
    assert!(told.contains("out/pot.exr"), "{told}");
    for words in [
        "generate pot -o out --size 512 --formats png",
        "generate pot -o out --size 512 --formats glb",
        "preview pot -o out/pot.png --size 256",
    ] {
        run(words);
    }
    // Where no format can be judged, the search is not lost for that: the output is what fails.
    let told = run("reduce scratched_steel -o out --size 256 --tolerance 0.001");
    assert!(told.contains("was not judged"), "{told}");
    let last = told.lines().rfind(|l| l.starts_with("error"));
    assert!(
        last.is_some_and(|l| l.contains("out/scratched_steel")),
        "{told}"
    );
    let there: Vec<_> = fs::read_dir(desk.path("out"))
        .expect("a folder")
        .map(|entry| entry.expect("an entry").file_name())
        .collect();
    assert_eq!(there, ["pot.exr"], "no halves");
    assert_eq!(
        fs::read(desk.path("out/pot.exr")).expect("bytes"),
        b"before"
    );
    let told = desk.run("generate pot -o /sys/maps --size 16");
    assert_eq!(told.code, 3, "{}", told.err);
    assert!(told.err.contains("/sys/maps"), "{}", told.err);
}

/// A device that is full: what is told there is lost.
#[cfg(target_os = "linux")]
#[test]
fn an_answer_that_cannot_be_written_ends_with_3() {
    for words in ["--version", "--help", "help generate", "presets"] {
        let full = fs::OpenOptions::new().write(true).open("/dev/full");
        let output = std::process::Command::new(env!("CARGO_BIN_EXE_anisomap"))
            .args(words.split(' '))
            .stdout(full.expect("a device"))
            .output()
            .expect("the binary starts");
        let told = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(3), "{words}: {told}");
        assert!(told.contains("standard output"), "{words}: {told}");
    }
}

#[cfg(unix)]
#[test]
fn an_interrupted_batch_leaves_whole_files_only() {
    use std::process::{Command, Stdio};
    use std::time::{Duration, Instant};
    let desk = Desk::new();
    desk.write(
        "m.toml",
        "version = 1\n[[jobs]]\nrecipe = 'scratched_steel'\nsizes = [700]\nsweep.seed = { from = 1, to = 500, steps = 500 }\n",
    );
    let child = Command::new(env!("CARGO_BIN_EXE_anisomap"))
        .args(["batch", "m.toml", "-o", "maps"])
        .current_dir(desk.folder.path())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .expect("the binary starts");
    let began = Instant::now();
    // Those that are not whole yet go when the work is cancelled.
    let whole = || {
        let files = desk.files("maps");
        files.iter().filter(|f| !f.ends_with(".part")).count()
    };
    while whole() < 2 && began.elapsed() < Duration::from_secs(30) {
        std::thread::sleep(Duration::from_millis(10));
    }
    let killed = Command::new("kill")
        .args(["-INT", &child.id().to_string()])
        .status();
    assert!(killed.expect("kill is there").success());
    let output = child.wait_with_output().expect("it ends");
    assert_eq!(output.status.code(), Some(1));
    assert!(String::from_utf8_lossy(&output.stderr).contains("cancelled"));
    let files = desk.files("maps");
    assert!(files.len() >= 2 && files.len() < 1000, "{}", files.len());
    assert!(files.iter().all(|f| !f.ends_with(".part")), "{files:?}");
    for exr in files.iter().filter(|f| f.ends_with(".exr")) {
        desk.works(&format!("inspect maps/{exr}"));
    }
}

#[cfg(unix)]
struct Running {
    child: std::process::Child,
}

#[cfg(unix)]
impl Running {
    fn new(desk: &Desk, arguments: &str) -> Self {
        use std::process::{Command, Stdio};
        let child = Command::new(env!("CARGO_BIN_EXE_anisomap"))
            .args(arguments.split_whitespace())
            .current_dir(desk.folder.path())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .expect("the binary starts");
        Self { child }
    }

    fn interrupt(&self) {
        let killed = std::process::Command::new("kill")
            .args(["-INT", &self.child.id().to_string()])
            .status();
        assert!(killed.expect("kill is there").success());
    }

    /// Its exit code and how long it still took, after at most a minute.
    fn end(mut self) -> (Option<i32>, std::time::Duration) {
        let began = std::time::Instant::now();
        while began.elapsed().as_secs() < 60 {
            if let Some(status) = self.child.try_wait().expect("a child") {
                return (status.code(), began.elapsed());
            }
            std::thread::sleep(std::time::Duration::from_millis(5));
        }
        self.child.kill().expect("still there");
        panic!("it did not end");
    }
}

/// A recipe with one mask that takes minutes to draw and is drawn in one step.
#[cfg(unix)]
fn slow_recipe(desk: &Desk) {
    let points: Vec<String> = (0u32..60_000)
        .map(|i| {
            let h = i.wrapping_mul(0x9e37_79b1);
            let (u, v) = (h >> 16, h & 0xffff);
            format!("[{}, {}]", f64::from(u) / 65536.0, f64::from(v) / 65536.0)
        })
        .collect();
    let points = points.join(",");
    let text = format!(
        "version = 1\nsize = 8192\n[[layers]]\n[layers.constant]\n[layers.mask]\npolygon = [{points}]\n"
    );
    desk.write("slow.toml", &text);
}

#[cfg(unix)]
#[test]
fn work_that_takes_no_step_is_ended_soon_after_an_interrupt() {
    let desk = Desk::new();
    slow_recipe(&desk);
    for (times, code) in [(1, 1), (2, 130)] {
        let running = Running::new(&desk, "inspect slow.toml");
        std::thread::sleep(std::time::Duration::from_millis(1500));
        for _ in 0..times {
            running.interrupt();
            std::thread::sleep(std::time::Duration::from_millis(200));
        }
        let (ended, took) = running.end();
        assert_eq!(ended, Some(code));
        assert!(took.as_secs() < 10, "{took:?}");
    }
}

#[cfg(unix)]
#[test]
fn two_interrupts_leave_no_unfinished_file() {
    use std::time::{Duration, Instant};
    let desk = Desk::new();
    let running = Running::new(
        &desk,
        "generate brushed_aluminium -o out --size 4096 --float --formats exr",
    );
    let began = Instant::now();
    let unfinished = |desk: &Desk| desk.files("out").iter().any(|f| f.ends_with(".part"));
    while !unfinished(&desk) && began.elapsed() < Duration::from_secs(60) {
        std::thread::sleep(Duration::from_millis(2));
    }
    running.interrupt();
    running.interrupt();
    let (ended, took) = running.end();
    assert!(ended == Some(130) || ended == Some(1), "{ended:?}");
    assert!(took.as_secs() < 10, "{took:?}");
    assert!(!unfinished(&desk), "{:?}", desk.files("out"));
}

#[test]
fn chart_proves_the_limits_and_writes_what_it_measured() {
    let desk = Desk::new();
    desk.write("file", "in the way");
    desk.fails("chart --stability -o file", 3, &["file", "it is a file"]);
    let report = desk.json("chart --stability -o out/new --json");
    assert_eq!(report["holds"], true);
    let limits = report["limits"].as_array().expect("a list");
    assert!(limits.len() >= 21 && limits.iter().all(|l| l["holds"] == true));
    for name in [
        "limits.csv",
        "limits.md",
        "stability.csv",
        "stability.png",
        "energy.csv",
        "energy.svg",
    ] {
        assert!(desk.path(&format!("out/new/{name}")).is_file(), "{name}");
    }
}
