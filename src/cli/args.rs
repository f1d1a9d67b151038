//! The grammar of the command line, with help and checks beside each option.

use super::reduce::{parse_metric, parse_tolerance};
use anisomap::analyse::reduce::Metric;
use anisomap::brdf::Model;
use anisomap::chart::Part;
use anisomap::map::Size;
use anisomap::preview::Look;
use anisomap::recipe::{SEED_MAX, Target};
use clap::{Args, Parser, Subcommand};
use clap_complete::Shell;
use glam::Vec3;
use std::path::PathBuf;

/// Anisotropy maps for brushed, turned and woven surfaces: per texel the two Ward roughnesses and the direction.
///
/// A recipe (a preset by name, or a .toml file by path) becomes maps, a lit picture, and files for other programs.
#[derive(Parser)]
#[command(name = "anisomap", version)]
#[cfg_attr(not(feature = "gui"), command(arg_required_else_help = true))]
#[command(after_help = "Begin with:  anisomap generate pot -o out\n\
    Exit codes: 0 done; 1 the work found something wrong; 2 bad arguments or input; 3 the machine failed (disk, permissions).")]
pub(super) struct Arguments {
    #[command(subcommand)]
    pub(super) command: Option<Command>,
}

#[derive(Subcommand)]
pub(super) enum Command {
    /// List the built-in recipes, or show one
    Presets(PresetsArgs),
    /// Make maps, a picture and a glTF from a recipe
    Generate(GenerateArgs),
    /// Draw a lit picture of a recipe or a map
    Preview(PreviewArgs),
    /// Tell a map's statistics and what is wrong with it
    Inspect(InspectArgs),
    /// Find the least that looks the same: no map, a strip, a smaller one, fewer bits
    Reduce(ReduceArgs),
    /// Make many maps from a manifest of recipes, sizes, seeds and sweeps
    Batch(BatchArgs),
    /// Measure speed against accuracy on this machine, or what fails where, and draw it
    Chart(ChartArgs),
    /// Write a completion script for a shell
    Completions(CompletionsArgs),
    /// Open the studio: paint, and see the light change under the brush (`anisomap FILE.toml` does, too)
    #[cfg(feature = "gui")]
    Gui(GuiArgs),
}

#[cfg(feature = "gui")]
#[derive(Args)]
pub(super) struct GuiArgs {
    /// A preset by name, a recipe by path; nothing for a scene to begin with. Example: pot, ./my_pot.toml
    #[arg(value_name = "RECIPE|PRESET")]
    pub(super) recipe: Option<String>,
}

#[derive(Args)]
#[command(args_conflicts_with_subcommands = true)]
pub(super) struct PresetsArgs {
    #[command(subcommand)]
    pub(super) action: Option<PresetsAction>,
    #[command(flatten)]
    pub(super) list: ListArgs,
}

#[derive(Subcommand)]
pub(super) enum PresetsAction {
    /// List names and descriptions (what `presets` alone does)
    List(ListArgs),
    /// Write a preset's recipe to standard output
    Show(ShowArgs),
}

#[derive(Args)]
pub(super) struct ListArgs {
    /// Names only, one a line. Example: for p in $(anisomap presets list --names)
    #[arg(long, conflicts_with = "json")]
    pub(super) names: bool,
    /// JSON for scripts: a list of {name, description}. Example: anisomap presets list --json
    #[arg(long)]
    pub(super) json: bool,
}

#[derive(Args)]
pub(super) struct ShowArgs {
    /// The preset. Example: anisomap presets show pot > my_pot.toml
    #[arg(value_name = "NAME")]
    pub(super) name: String,
    /// The recipe as JSON, defaults filled in. Example: anisomap presets show pot --json
    #[arg(long)]
    pub(super) json: bool,
}

/// What is done to a recipe before it is used.
#[derive(Args, Default)]
pub(super) struct RecipeArgs {
    /// Seed of all randomness, in place of the recipe's. Example: --seed 7
    #[arg(long, value_name = "N", allow_negative_numbers = true, value_parser = parse_seed)]
    pub(super) seed: Option<u64>,
    /// Override any key of the recipe, as often as needed; layers go by name or number. Example: --set adjust.alpha_y=1.5
    /// --set layers.0.brushed.angle=30
    #[arg(long, value_name = "KEY=VALUE", value_parser = parse_set)]
    pub(super) set: Vec<(String, String)>,
    /// Let the recipe name files outside its own folder. Example: --allow-outside
    #[arg(long)]
    pub(super) allow_outside: bool,
}

#[derive(Args)]
pub(super) struct GenerateArgs {
    /// A preset by name, or a recipe by path (anything with a slash or a dot). Example: pot, ./my_pot.toml
    #[arg(value_name = "RECIPE|PRESET")]
    pub(super) recipe: String,
    /// Folder for the files; made where it is missing. Example: -o out
    #[arg(short, long, value_name = "DIR")]
    pub(super) output: PathBuf,
    /// Size of the map in texels, in place of the recipe's. Example: --size 2048, --size 2048x512
    #[arg(long, value_name = "N|WxH")]
    pub(super) size: Option<Size>,
    #[command(flatten)]
    pub(super) recipe_args: RecipeArgs,
    /// What to write, with commas between: exr (the master), rgb-exr, png (16 bit), png8, png16, glb, gltf, preview. Default:
    /// the recipe's targets, or exr,rgb-exr,png,glb,preview. Example: --formats exr,glb
    #[arg(long, value_name = "LIST", value_delimiter = ',')]
    pub(super) formats: Vec<Target>,
    /// 32-bit floats in the EXR files in place of 16-bit halves. Example: --float
    #[arg(long)]
    pub(super) float: bool,
    /// Mesh of the glTF and the picture: torus, pot, sphere, plane, cylinder, disc, or a .glb, .gltf or .obj file. Default:
    /// the recipe's, or torus. Example: --mesh sphere
    #[arg(long, value_name = "MESH")]
    pub(super) mesh: Option<String>,
    /// Reduce the map first to the least that looks the same on the mesh, with a mean FLIP error of at most T, and write that:
    /// what `reduce` does. EXR files have floats where halves would be seen. Example: --reduce 0.01
    #[arg(long, value_name = "T", allow_negative_numbers = true, value_parser = parse_tolerance)]
    pub(super) reduce: Option<f32>,
    /// JSON for scripts in place of the table: {name, size, seed, files, round_trip,
    /// seconds, ignored, mended, reduced}. Example: --json
    #[arg(long)]
    pub(super) json: bool,
}

/// The words of `preview --quality`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, clap::ValueEnum)]
pub(super) enum QualityWord {
    Plain,
    #[default]
    Standard,
    Reference,
}

#[derive(Args)]
pub(super) struct PreviewArgs {
    /// A preset by name; a recipe (.toml), a master EXR, or a .glb or .gltf with an anisotropy map by path. Example: pot,
    /// out/pot.exr
    #[arg(value_name = "RECIPE|PRESET|MAP")]
    pub(super) input: String,
    /// The picture, a PNG file. Example: -o pot.png
    #[arg(short, long, value_name = "FILE")]
    pub(super) output: PathBuf,
    /// Mesh to lay the map over: torus, pot, sphere, plane, cylinder, disc, or a .glb, .gltf or .obj file. Default: the
    /// recipe's, the map's own, or torus. Example: --mesh pot
    #[arg(long, value_name = "MESH")]
    pub(super) mesh: Option<String>,
    /// Models side by side, with commas between: ward, ward-exact, ward-duer, ward-bounded, beckmann, ggx, phong,
    /// blinn-phong, lambert; `:mean` after one lights it with the map's mean. Default: the recipe's, or ward. Example:
    /// --model phong:mean,ward:mean,ward
    #[arg(long, value_name = "LIST", value_delimiter = ',')]
    pub(super) model: Vec<Look>,
    /// Size of the picture in pixels. Default: 960x720, wider for several models. Example: --size 1800x600
    #[arg(long, value_name = "N|WxH")]
    pub(super) size: Option<Size>,
    /// Direction toward a light in place of the studio's, y up; as often as needed. Example: --light=-1,2,3 --light 2,0.5,1
    #[arg(long, value_name = "X,Y,Z", allow_hyphen_values = true, value_parser = parse_light)]
    pub(super) light: Vec<Vec3>,
    /// Exposure in stops, -16 to 16, in place of the recipe's. Example: --exposure=-0.5
    #[arg(long, value_name = "STOPS", allow_negative_numbers = true, value_parser = parse_exposure)]
    pub(super) exposure: Option<f32>,
    /// Samples along a pixel's side, 1 to 4: 3 means 3x3 samples a pixel. Default: 2. With `--quality reference` one of 1, 2, 3,
    /// 4, 6, 8, 12, 16, 24, 48; default 8. Example: --samples 3
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=48))]
    pub(super) samples: Option<u32>,
    /// What is spent on a sample: plain (one fetch, one formula), standard (footprints averaged, highlights finer than a
    /// sample widened, outlines with 4x4 samples), or reference (f64, 64 samples a pixel, nothing approximated: slow, to measure
    /// against). Default: standard. Example: --quality reference
    #[arg(
        long,
        value_name = "QUALITY",
        value_enum,
        default_value_t,
        hide_default_value = true
    )]
    pub(super) quality: QualityWord,
    /// Draw how two models differ, in false colour with a legend: red where the second is brighter. Needs two models.
    /// Example: --model ward,ggx --difference
    #[arg(long)]
    pub(super) difference: bool,
    /// Size of the map a recipe is filled at, in place of the recipe's. Example: --map-size 512
    #[arg(long, value_name = "N|WxH")]
    pub(super) map_size: Option<Size>,
    #[command(flatten)]
    pub(super) recipe_args: RecipeArgs,
    /// Say where the time of drawing went, in milliseconds by stage; work side by side counts once for each core. Example:
    /// --timings
    #[arg(long)]
    pub(super) timings: bool,
    /// JSON for scripts: {path, bytes, size, models, difference, mended, timings}. Example: --json
    #[arg(long)]
    pub(super) json: bool,
}

#[derive(Args)]
pub(super) struct InspectArgs {
    /// A preset by name; a recipe (.toml), a master EXR, or a .glb or .gltf with an anisotropy map by path. Example:
    /// out/pot.exr
    #[arg(value_name = "MAP|RECIPE|PRESET")]
    pub(super) input: String,
    /// Size of the map a recipe is filled at, in place of the recipe's. Example: --size 512
    #[arg(long, value_name = "N|WxH")]
    pub(super) size: Option<Size>,
    #[command(flatten)]
    pub(super) recipe_args: RecipeArgs,
    /// JSON for scripts: {name, aspect, wrap, statistics, mended, findings}. Example: anisomap inspect out/pot.exr --json
    #[arg(long)]
    pub(super) json: bool,
}

#[derive(Args)]
#[command(after_long_help = REDUCE_HELP)]
pub(super) struct ReduceArgs {
    /// A preset by name; a recipe (.toml), a master EXR, or a .glb or .gltf with an anisotropy map by path. Example:
    /// vinyl_record, out/pot.exr
    #[arg(value_name = "RECIPE|PRESET|MAP")]
    pub(super) input: String,
    /// Folder for the files; made where it is missing. Example: -o out
    #[arg(short, long, value_name = "DIR")]
    pub(super) output: PathBuf,
    /// The largest mean error over the pixels where the mesh is seen; 99.9 % of them may have three times as much. About the same
    /// to the eye: 0.01 in flip, 0.5 in de, 0.02 in luminance. Example: --tolerance 0.01
    #[arg(long, value_name = "T", allow_negative_numbers = true, value_parser = parse_tolerance)]
    pub(super) tolerance: f32,
    #[command(flatten)]
    pub(super) options: ReduceOptions,
    /// Size of the map a recipe is filled at, in place of the recipe's. Example: --map-size 512
    #[arg(long, value_name = "N|WxH")]
    pub(super) map_size: Option<Size>,
    #[command(flatten)]
    pub(super) recipe_args: RecipeArgs,
    /// JSON for scripts in place of the table: {name, metric, tolerance, picture, reference_samples, k_max, scenes, full,
    /// reduced, seen_in, seen_in_floats, unjudged, dropped, recipe, files, tried}. Example: --json
    #[arg(long)]
    pub(super) json: bool,
}

/// Where the reduced map must look the same, and by what.
#[derive(Args)]
pub(super) struct ReduceOptions {
    /// What errors are measured in: flip (0 to 1, as the eye sees), de (CIEDE2000), luminance (relative, before clipping, for
    /// pictures that are worked on). Default: flip. Example: --metric de
    #[arg(long, value_name = "METRIC", default_value = "flip", hide_default_value = true, value_parser = parse_metric)]
    pub(super) metric: Metric,
    /// A mesh it must look the same on, as often as needed: torus, pot, sphere, plane, cylinder, disc, or a .glb, .gltf or .obj
    /// file. Default: the recipe's, the map's own, or torus. Example: --mesh pot --mesh sphere
    #[arg(long, value_name = "MESH")]
    pub(super) mesh: Vec<String>,
    /// Direction toward a light that it must look the same under, y up, each a scene of its own; as often as needed. Default:
    /// the recipe's lights together, or the studio's. Example: --light=-1,2,3 --light 2,0.5,1
    #[arg(long, value_name = "X,Y,Z", allow_hyphen_values = true, value_parser = parse_light)]
    pub(super) light: Vec<Vec3>,
    /// A scene of your own, a .toml file with camera, lights and exposure; as often as needed. Example: --scene shot.toml
    #[arg(long, value_name = "FILE")]
    pub(super) scene: Vec<PathBuf>,
    /// The one model that it is seen with and that the reduced recipe then names. Default: each of the recipe's, or ward.
    /// Example: --model ggx
    #[arg(long, value_name = "MODEL")]
    pub(super) model: Option<Model>,
    /// Size of the pictures that are compared, in pixels: as large as it will be seen. Default: 384. Example: --size 960x720
    #[arg(
        long,
        value_name = "N|WxH",
        default_value = "384",
        hide_default_value = true
    )]
    pub(super) size: Size,
    /// Exposure in stops, -16 to 16, in place of the recipe's. Example: --exposure=-0.5
    #[arg(long, value_name = "STOPS", allow_negative_numbers = true, value_parser = parse_exposure)]
    pub(super) exposure: Option<f32>,
}

const REDUCE_HELP: &str = "\
It tries, from the fewest bytes upward: no map, a table outward from a centre, strips
along u or v, smaller maps; isotropic, one width or both constant, one direction; 8
and 16 bits, halves, floats for each channel; and a cheaper model. All but what its
closed form clears is drawn in every scene, and what is taken is measured once more
by the reference, from what the files give back.

It writes NAME.reduced.toml, a recipe that stands for the reduced map and that every
command reads, the PNG or EXR files that it names, and NAME.reduced.json, the report.
Where the input's mesh is a file outside DIR, the recipe still names it there, and
drawing it takes --allow-outside or another --mesh; the report says so.

A scene file holds, all but the camera optional:

  camera = { eye = [0, 1, 4], target = [0, 0, 0] }
  lights = [{ kind = \"directional\", toward = [1, 2, 3], irradiance = [2, 2, 2] }]
  exposure = 0.5";

impl Default for ReduceOptions {
    fn default() -> Self {
        Self {
            metric: Metric::default(),
            mesh: Vec::new(),
            light: Vec::new(),
            scene: Vec::new(),
            model: None,
            size: Size::new(384, 384).expect("384 is a size"),
            exposure: None,
        }
    }
}

#[derive(Args)]
#[command(after_long_help = MANIFEST_HELP)]
pub(super) struct BatchArgs {
    /// The manifest, a .toml file; see below for what it holds. Example: nightly.toml
    #[arg(value_name = "MANIFEST")]
    pub(super) manifest: PathBuf,
    /// Folder for the files; made where it is missing. Example: -o out
    #[arg(short, long, value_name = "DIR")]
    pub(super) output: PathBuf,
    /// Maps made at the same time; each then has its share of the cores. Default: one a core. Example: --jobs 2
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    pub(super) jobs: Option<u16>,
    /// The most maps the manifest may ask for; more is taken for a mistake. Example: --limit 500000
    #[arg(long, value_name = "N", default_value_t = 100_000)]
    pub(super) limit: u64,
    /// Let recipes name files outside their own folders. Example: --allow-outside
    #[arg(long)]
    pub(super) allow_outside: bool,
    /// JSON for scripts in place of the summary: {asked, made, failed, files, bytes, seconds,
    /// items, failures}. Example: --json
    #[arg(long)]
    pub(super) json: bool,
}

const MANIFEST_HELP: &str = "\
A manifest is TOML. Every job is crossed: recipes x sizes x seeds x the values
of every swept key.

  version = 1

  [[jobs]]
  # Presets by name, recipes by path from the manifest; \"*\" is all presets.
  recipes = [\"pot\", \"mine/steel.toml\"]
  sizes = [512, [1024, 512]]    # default: the recipe's own
  seeds = [1, 2, 3]             # default: the recipe's own
  formats = [\"exr\", \"png\"]      # as generate --formats; default: exr
  mesh = \"sphere\"               # as generate --mesh, files from the manifest

  [jobs.set]                    # overrides of the whole job, as generate --set
  wrap = \"clamp\"

  [jobs.sweep]                  # lists, or ranges with both ends
  \"adjust.alpha_y\" = [0.5, 1, 2]
  \"adjust.turn\" = { from = 0, to = 90, steps = 4 }

Files are named RECIPE[-WxH][-seedN][-KEY=VALUE]...: only what the job crosses
is in the name, keys in the order of the alphabet; -2, -3, ... follows where two
names would be the same. Beside each map lies the recipe it was made from.

One failure does not stop the rest. Exit codes: 0 all made; 1 some failed;
2 the manifest cannot be used.";

#[derive(Args)]
pub(super) struct ChartArgs {
    /// Folder for the files; made where it is missing. Example: -o out
    #[arg(short, long, value_name = "DIR")]
    pub(super) output: PathBuf,
    /// Measure where the usual mathematics fails and how far ours is off, where f32 holds for each model, and how much light
    /// each gives back. Exit code 1 when a stated bound is not kept. Example: --stability
    #[arg(long, conflicts_with_all = ["only", "quick", "pictures"])]
    pub(super) stability: bool,
    /// Measure only these, with commas between: kernels (one evaluation of a model), pictures (whole frames). Default: both.
    /// Example: --only kernels
    #[arg(long, value_name = "LIST", value_delimiter = ',')]
    pub(super) only: Vec<Part>,
    /// Small pictures and single rounds, in seconds: to see that all works, not to be believed. Example: --quick
    #[arg(long)]
    pub(super) quick: bool,
    /// Keep every picture as PNG, and beside it how far it is from the reference (FLIP as 16-bit grey), in DIR/pictures.
    /// Example: --pictures
    #[arg(long)]
    pub(super) pictures: bool,
    /// JSON for scripts in place of the table: {machine, kernels, pictures, files}, with --stability {holds, limits, files}.
    /// Example: --json
    #[arg(long)]
    pub(super) json: bool,
}

#[derive(Args)]
pub(super) struct CompletionsArgs {
    /// The shell. Example: anisomap completions bash > ~/.local/share/bash-completion/completions/anisomap
    #[arg(value_name = "SHELL")]
    pub(super) shell: Shell,
}

fn parse_seed(word: &str) -> Result<u64, String> {
    let seed = word.trim().parse::<u64>().ok().filter(|s| *s <= SEED_MAX);
    seed.ok_or_else(|| format!("allowed: whole numbers from 0 to {SEED_MAX}"))
}

fn parse_set(word: &str) -> Result<(String, String), String> {
    match word.split_once('=') {
        Some((key, value)) if !key.trim().is_empty() => {
            Ok((key.trim().to_owned(), value.to_owned()))
        }
        _ => Err("allowed: KEY=VALUE, as in adjust.alpha_y=1.5".to_owned()),
    }
}

fn parse_light(word: &str) -> Result<Vec3, String> {
    let numbers: Vec<f32> = word
        .split(',')
        .filter_map(|n| n.trim().parse().ok())
        .collect();
    let direction = match numbers[..] {
        [x, y, z] if word.matches(',').count() == 2 => Vec3::new(x, y, z).try_normalize(),
        _ => None,
    };
    direction.ok_or_else(|| {
        "allowed: three numbers, not all 0, with commas between, as in 1,2,3".to_owned()
    })
}

fn parse_exposure(word: &str) -> Result<f32, String> {
    let stops = word.trim().parse::<f32>().ok();
    stops
        .filter(|s| (-16.0..=16.0).contains(s))
        .ok_or_else(|| "allowed: -16 to 16 stops".to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::CommandFactory;

    #[test]
    fn the_grammar_is_sound() {
        Arguments::command().debug_assert();
    }

    #[test]
    fn every_option_has_help_with_an_example() {
        fn walk(command: &clap::Command, seen: &mut u32) {
            for arg in command.get_arguments() {
                let id = arg.get_id().as_str();
                if ["help", "version"].contains(&id) {
                    continue;
                }
                let help = arg.get_help().map(ToString::to_string).unwrap_or_default();
                assert!(
                    help.contains("Example: "),
                    "{} {id}: {help}",
                    command.get_name()
                );
                *seen += 1;
            }
            command.get_subcommands().for_each(|c| walk(c, seen));
        }
        let mut seen = 0;
        walk(&Arguments::command(), &mut seen);
        assert!(seen > 30, "only {seen} options seen");
    }

    #[test]
    fn words_are_checked() {
        assert_eq!(parse_light("-1, 0,2").unwrap().z, 2.0 / 5f32.sqrt());
        for bad in ["1,2", "0,0,0", "1,2,x", "nan,1,1", "1,2,3,4", ""] {
            assert!(parse_light(bad).is_err(), "{bad}");
        }
        assert!(parse_seed("-1").is_err() && parse_seed("18446744073709551615").is_err());
        assert_eq!(
            parse_set("a.b=x=y").unwrap(),
            ("a.b".to_owned(), "x=y".to_owned())
        );
        assert!(parse_set("=3").is_err() && parse_set("a").is_err());
        assert!(parse_exposure("nan").is_err());
    }
}
