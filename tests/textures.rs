//! Textures of other programs as a layer: what is written by a convention comes back by it, through a recipe's text.

use anisomap::analyse::compare;
use anisomap::convention::textures::{Convention, Curve, Encoding};
use anisomap::convention::{LobeFit, MapInfo, Stretched};
use anisomap::export::Export;
use anisomap::export::exr::{Precision, write_rgb_pair};
use anisomap::export::gltf::{GltfOptions, write_gltf};
use anisomap::export::png::{Depth, write_set};
use anisomap::import::gltf::read_gltf;
use anisomap::import::guess::guess;
use anisomap::import::textures::{Channel, Textures};
use anisomap::map::{AnisoMap, DEFAULT_TEXEL, Size, Texel, Wrap};
use anisomap::math::Axis;
use anisomap::mesh::builtin;
use anisomap::progress::Progress;
use anisomap::recipe::{Image, Layer, Material, Recipe, RecipeFile, Source};
use image::{GrayImage, Luma};
use std::fs;
use std::path::Path;

const SIDE: u32 = 48;

/// Every direction, widths from narrow to wide, some of them round.
fn map() -> AnisoMap {
    let mut map = AnisoMap::constant(
        Size::new(SIDE, SIDE).expect("a size"),
        Wrap::Repeat,
        DEFAULT_TEXEL,
    );
    let mut region = map.region_mut();
    for i in 0..(SIDE * SIDE) as usize {
        let (x, y) = (i as f32 % SIDE as f32, (i as f32 / SIDE as f32).floor());
        let alpha_x = 0.05 + 0.004 * y;
        let texel = Texel {
            alpha_x,
            alpha_y: alpha_x * (1.0 + 0.07 * y),
            axis: Axis::from_degrees(180.0 * x / SIDE as f32),
        };
        region.set(i, texel);
    }
    map
}

/// What a recipe of these textures makes, after it was written and read as text.
fn made(folder: &Path, textures: Textures) -> anisomap::Result<AnisoMap> {
    let recipe = Recipe {
        size: Size::new(SIDE, SIDE)?,
        layers: vec![Layer::new(Source::Image(Image::of(textures)))],
        ..Recipe::default()
    };
    let path = folder.join("recipe.toml");
    let text = RecipeFile::new(recipe, "recipe.toml")?.to_toml();
    fs::write(&path, text).expect("the folder is writable");
    let file = RecipeFile::read(&path)?;
    let map = file
        .recipe()
        .prepare(file.recipe().size, &file.files(false), &Progress::none())?;
    map.map(&Progress::none())
}

fn assert_close(folder: &Path, textures: Textures, widths: f32, degrees: f32) {
    let back = made(folder, textures.clone()).expect("it can be read");
    let apart = compare(&map(), &back).expect("one size");
    let width = apart.well_held.max.max(apart.elsewhere.max);
    assert!(width <= widths, "{width} {textures:?}");
    assert!(
        apart.angle.max_degrees <= degrees,
        "{} {textures:?}",
        apart.angle.max_degrees
    );
}

#[test]
fn our_own_files_come_back_by_the_convention_that_is_guessed() {
    let folder = tempfile::tempdir().unwrap();
    let (map, info) = (map(), MapInfo::default());
    let export = Export::new(&map, &info);
    let stem = folder.path().join("m");
    write_set(&stem, &export, Depth::Sixteen).unwrap();
    write_set(&stem, &export, Depth::Eight).unwrap();
    write_rgb_pair(&stem, &export, Precision::Float).unwrap();
    // Half a step: 16 bits of 1.5, 8 bits of a square root at the smallest width, 8 bits of a double angle.
    for (file, widths, degrees) in [
        ("m_alpha_x_16bit.png", 2.4e-4, 0.002),
        ("m_alpha_y_8bit.png", 0.022, 0.17),
    ] {
        let guess = guess(&folder.path().join(file)).unwrap();
        assert_close(folder.path(), guess.textures, widths, degrees);
    }
    // The angle in place of the double one, and arrows of either sign.
    let of = |file: &str, channel: &str| Some(Channel::new(file, channel));
    let sixteen = Textures {
        first: of("m_alpha_x_16bit.png", "r"),
        second: of("m_alpha_y_16bit.png", "r"),
        direction: of("m_direction_16bit.png", "r"),
        direction_v: of("m_direction_16bit.png", "g"),
        convention: Convention {
            encoding: Encoding::Vector,
            ..Convention::named("anisomap PNG, 16 bit").unwrap()
        },
    };
    assert_close(folder.path(), sixteen.clone(), 2.4e-4, 0.002);
    let angle = Textures {
        direction: of("m_angle_16bit.png", "r"),
        direction_v: None,
        convention: Convention {
            encoding: Encoding::Angle,
            angle_range: 180.0 * 65535.0 / 65536.0,
            ..sixteen.convention
        },
        ..sixteen
    };
    assert_close(folder.path(), angle, 2.4e-4, 0.0015);
    let pair = Textures {
        first: of("m_alpha.exr", "R"),
        second: of("m_alpha.exr", "g"),
        direction: of("m_direction.exr", "R"),
        direction_v: of("m_direction.exr", "G"),
        convention: Convention::default(),
    };
    assert_close(folder.path(), pair, 2e-7, 1e-3);
}

#[test]
fn gltf_textures_are_read_as_the_gltf_file_is() {
    let folder = tempfile::tempdir().unwrap();
    let (map, info) = (map(), MapInfo::default());
    let mesh = builtin("plane").unwrap();
    let stem = folder.path().join("g");
    let (material, options) = (Material::default(), GltfOptions::default());
    write_gltf(&stem, &Export::new(&map, &info), &mesh, &material, options).unwrap();
    let text = fs::read_to_string(folder.path().join("g.gltf")).unwrap();
    let json: serde_json::Value = serde_json::from_str(&text).unwrap();
    let of = &json["materials"][0];
    let roughness = of["pbrMetallicRoughness"]["roughnessFactor"]
        .as_f64()
        .unwrap_or(1.0) as f32;
    let strength = of["extensions"]["KHR_materials_anisotropy"]["anisotropyStrength"]
        .as_f64()
        .unwrap() as f32;
    let mut guess = guess(&folder.path().join("g_anisotropy.png")).unwrap();
    assert_eq!(guess.convention, "glTF");
    assert_eq!(
        guess.textures.first,
        Some(Channel::new("g_roughness.png", "g"))
    );
    guess.textures.convention.scale = roughness * roughness;
    guess.textures.convention.strength = strength;
    let apart = compare(
        &read_gltf(&folder.path().join("g.gltf")).unwrap().map,
        &made(folder.path(), guess.textures.clone()).unwrap(),
    )
    .unwrap();
    assert!(
        apart.well_held.max < 1e-5 && apart.elsewhere.max < 1e-5,
        "{apart:?}"
    );
    assert!(apart.angle.max_degrees < 1e-2, "{apart:?}");
    // And as the map, but for what 8 bits lose.
    assert_close(folder.path(), guess.textures, 0.06, 0.35);
}

fn grey(folder: &Path, name: &str, value: impl Fn(usize) -> f32) {
    let picture = GrayImage::from_fn(SIDE, SIDE, |x, y| {
        Luma([(value((y * SIDE + x) as usize).clamp(0.0, 1.0) * 255.0).round() as u8])
    });
    picture
        .save(folder.join(name))
        .expect("the folder is writable");
}

/// Blender's sockets and Painter's channels as eight bits, by the inverse of each program's formula, written here anew.
#[test]
fn other_programs_textures_come_back_within_their_steps() {
    let folder = tempfile::tempdir().unwrap();
    let map = map();
    let highlight = |i: usize| {
        let t = map.texel(i as u32 % SIDE, i as u32 / SIDE);
        let s = Stretched::from(t);
        let ggx = |alpha| LobeFit::WardToGgx.apply(alpha);
        (ggx(s.alpha_t), ggx(s.alpha_b), s.axis.degrees())
    };
    let (a, b) = (folder.path().join("blender"), folder.path().join("painter"));
    fs::create_dir(&a).unwrap();
    fs::create_dir(&b).unwrap();
    let root = |at: f32, ab: f32| (at * ab).sqrt().sqrt();
    grey(&a, "s_Roughness.png", |i| {
        root(highlight(i).0, highlight(i).1)
    });
    grey(&a, "s_Anisotropic.png", |i| {
        (1.0 - highlight(i).1 / highlight(i).0) / 0.9
    });
    // Half a turn more says the same.
    grey(&a, "s_Rotation.png", |i| {
        (highlight(i).2 + 180.0 * (i % 2) as f32) / 360.0
    });
    let guessed = guess(&a.join("s_Rotation.png")).unwrap();
    assert_eq!(guessed.convention, "Blender Principled");
    // Eight bits: half a step is 0.7 degrees of a turn, and of a ratio of widths up to 5 % where it is 4 to 1.
    assert_close(&a, guessed.textures, 0.05, 0.71);
    grey(&b, "s_roughness.png", |i| highlight(i).1.sqrt());
    grey(&b, "s_anisotropyLevel.png", |i| {
        1.0 - highlight(i).1 / highlight(i).0
    });
    // Along T', clockwise, it is smooth.
    grey(&b, "s_anisotropyAngle.png", |i| {
        (90.0 - highlight(i).2).rem_euclid(180.0) / 360.0
    });
    let guessed = guess(&b.join("s_roughness.png")).unwrap();
    assert_eq!(guessed.convention, "Substance Painter");
    assert_close(&b, guessed.textures, 0.05, 0.71);
}

#[test]
fn what_cannot_be_read_is_said_with_its_place() {
    let folder = tempfile::tempdir().unwrap();
    let say = |name: &str, bytes: &[u8]| fs::write(folder.path().join(name), bytes).unwrap();
    grey(folder.path(), "r.png", |_| 0.5);
    GrayImage::new(7, 5)
        .save(folder.path().join("small.png"))
        .unwrap();
    say("empty.png", b"");
    say("text.png", b"no picture");
    let first = "first = { file = 'r.png' }\n";
    for (textures, wanted) in [
        (
            "first = { file = 'no.png' }\n".to_owned(),
            "layers.0.image.textures.first.file is `no.png`",
        ),
        (
            "first = { file = '../r.png' }\n".to_owned(),
            "in the recipe's own folder",
        ),
        (
            "first = { file = 'empty.png' }\n".to_owned(),
            "the file is empty",
        ),
        (
            "first = { file = 'text.png' }\n".to_owned(),
            "no PNG, TIFF or OpenEXR",
        ),
        (
            "first = { file = 'r.png', channel = 'g' }\n".to_owned(),
            "it has the channels r; needed: g",
        ),
        (
            format!("{first}second = {{ file = 'small.png' }}\n"),
            "it is 7x5, but",
        ),
        (
            "second = { file = 'r.png' }\n".to_owned(),
            "layers.0.image.textures.first is missing",
        ),
        (
            format!("{first}direction = {{ file = 'r.png' }}\n"),
            "direction_v is missing",
        ),
        (
            format!("{first}direction_v = {{ file = 'r.png' }}\n"),
            "direction_v is `r.png`",
        ),
        (
            format!("{first}convention.scale = 0\n"),
            "convention.scale is 0",
        ),
        (
            format!("{first}convention.angle_range = 1e9\n"),
            "convention.angle_range is 1000000000",
        ),
        (format!("{first}convention.widths = 'gltff'\n"), "gltf"),
        (format!("{first}convention.scales = 1\n"), "scale"),
        (format!("{first}[layers.image]\nfile = 'r.exr'\n"), "image"),
    ] {
        let text =
            format!("version = 1\nsize = 48\n[[layers]]\n[layers.image.textures]\n{textures}");
        let path = folder.path().join("recipe.toml");
        fs::write(&path, &text).unwrap();
        let made = RecipeFile::read(&path).and_then(|file| {
            let recipe = file.recipe();
            recipe
                .prepare(recipe.size, &file.files(false), &Progress::none())?
                .map(&Progress::none())
        });
        let error = made.err().unwrap_or_else(|| panic!("{text}")).to_string();
        assert!(error.contains(wanted), "{textures}: {error}");
    }
    let both = "version = 1\n[[layers]]\n[layers.image]\nfile = 'a.exr'\n[layers.image.textures]\nfirst = { file = 'r.png' }\n";
    let error = RecipeFile::parse(both, "r.toml", None)
        .err()
        .unwrap()
        .to_string();
    assert!(error.contains("only without `textures`"), "{error}");
}

#[test]
fn a_direction_alone_leaves_the_widths() {
    let folder = tempfile::tempdir().unwrap();
    let flow = image::RgbImage::from_pixel(SIDE, SIDE, image::Rgb([128, 255, 0]));
    flow.save(folder.path().join("hair_flow.png")).unwrap();
    let guess = guess(&folder.path().join("hair_flow.png")).unwrap();
    let made = made(folder.path(), guess.textures).unwrap();
    let t = made.texel(3, 3);
    assert_eq!(
        (t.alpha_x, t.alpha_y),
        (DEFAULT_TEXEL.alpha_x, DEFAULT_TEXEL.alpha_y)
    );
    assert!(t.axis.angle_to(Axis::from_degrees(90.0)).to_degrees() < 0.3);
}

#[test]
fn a_convention_is_written_out_whole() {
    let textures = Textures {
        first: Some(Channel::new("a.png", "r")),
        convention: Convention {
            curve: Curve::Square,
            ..Convention::default()
        },
        ..Textures::default()
    };
    let recipe = Recipe {
        name: "a".to_owned(),
        layers: vec![Layer::new(Source::Image(Image::of(textures)))],
        ..Recipe::default()
    };
    let text = RecipeFile::new(recipe.clone(), "a.toml").unwrap().to_toml();
    for key in [
        "widths",
        "curve",
        "scale",
        "lobe_fit",
        "encoding",
        "angle_range",
        "clockwise",
        "leads",
    ] {
        assert!(text.contains(&format!("{key} = ")), "{key}:\n{text}");
    }
    assert_eq!(
        RecipeFile::parse(&text, "a.toml", None).unwrap().recipe(),
        &recipe
    );
}
