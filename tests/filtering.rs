//! Maps far finer than the pixels: our averages against a picture of very many samples.

use anisomap::analyse::{Flip, PIXELS_PER_DEGREE};
use anisomap::map::{AnisoMap, Size, Texel, Wrap};
use anisomap::math::Axis;
use anisomap::mesh::{self, Mesh};
use anisomap::preview::{
    Background, Light, Look, Material, Picture, Quality, Scene, Subject, render, render_reference,
};
use anisomap::progress::Progress;
use anisomap::recipe::{Recipe, preset};
use glam::Vec3;

fn recipe(name: &str) -> Recipe {
    let preset = preset(name).expect("a preset");
    preset.recipe().expect("it parses").recipe().clone()
}

fn filled(recipe: &Recipe, side: u32) -> AnisoMap {
    let size = Size::new(side, side).expect("a size");
    let none = Progress::none();
    let prepared = recipe.prepare(size, &Default::default(), &none);
    prepared
        .expect("no files")
        .map(&none)
        .expect("nobody cancels")
}

/// The mean of alphas and of double-angle vectors over squares of texels.
fn averaged_naively(map: &AnisoMap, side: u32) -> AnisoMap {
    let (n, from) = ((map.width() / side) as usize, map.width() as usize);
    let plane = |plane: &[f32]| -> Vec<f32> {
        (0..(side * side) as usize)
            .map(|i| {
                let (x, y) = (i % side as usize * n, i / side as usize * n);
                let row = |j: usize| plane[(y + j) * from + x..][..n].iter().sum::<f32>();
                (0..n).map(row).sum::<f32>() / (n * n) as f32
            })
            .collect()
    };
    let planes = [map.alpha_x(), map.alpha_y(), map.cos2(), map.sin2()].map(plane);
    let size = Size::new(side, side).expect("a size");
    AnisoMap::from_planes(size, map.wrap(), planes)
        .expect("four planes")
        .0
}

/// Pixels that the mesh covers wholly: at the outline it is samples, not filters, that count.
fn covered(mesh: &Mesh, scene: &Scene, size: Size) -> Vec<bool> {
    let lit = Scene {
        lights: Vec::new(),
        background: Background {
            top: [0.0; 3],
            bottom: [0.0; 3],
        },
        samples: 4,
        ..scene.clone()
    };
    let texel = Texel {
        alpha_x: 0.2,
        alpha_y: 0.2,
        axis: Axis::U,
    };
    let map = AnisoMap::constant(Size::new(1, 1).expect("a size"), Wrap::Repeat, texel);
    let material = Material {
        ambient: [1.0; 3],
        ..Material::default()
    };
    let subject = Subject {
        mesh,
        map: &map,
        material: &material,
    };
    let picture = render(subject, &lit, &[Look::default()], size, &Progress::none());
    let picture = picture.expect("a picture").remove(0);
    let whole = |x: i64, y: i64| {
        let (w, h) = (i64::from(size.width()), i64::from(size.height()));
        let inside = (0..w).contains(&x) && (0..h).contains(&y);
        inside && picture.pixel(x as u32, y as u32)[0] > 0.999
    };
    // One pixel inward: at the outline the normal turns by most of a right angle in a pixel.
    let neighbours = |x: i64, y: i64| (-1..=1).all(|j| (-1..=1).all(|i| whole(x + i, y + j)));
    let n = i64::from(size.width());
    (0..size.texels() as i64)
        .map(|i| neighbours(i % n, i / n))
        .collect()
}

/// FLIP from the truth: over the whole picture, and over the pixels that the mesh covers wholly.
struct Errors {
    whole: f64,
    covered: f64,
}

/// The errors of what pictures are drawn with, of naive averaging to about a texel a sample, and of the same with as many samples
/// at outlines as ours.
fn against_the_truth(preset: &str, mesh: &Mesh, samples: u32) -> [Errors; 3] {
    let recipe = recipe(preset);
    let map = filled(&recipe, 4096);
    let naive = averaged_naively(&map, 128 * samples);
    let scene = Scene {
        samples,
        ..Scene::for_mesh(mesh)
    };
    let subject = |map| Subject {
        mesh,
        map,
        material: &recipe.material,
    };
    let (size, looks) = (Size::new(128, 128).expect("a size"), [Look::default()]);
    let none = Progress::none();
    let truth = render_reference(subject(&map), &scene, &looks, size, 24, &none);
    let ours = render(subject(&map), &scene, &looks, size, &none);
    let [naive, alike] = [false, true].map(|outlines| {
        let unfiltered = Scene {
            quality: Quality {
                mips: false,
                outlines,
                ..scene.quality
            },
            ..scene.clone()
        };
        render(subject(&naive), &unfiltered, &looks, size, &none)
    });
    let [truth, ours, naive, alike] =
        [truth, ours, naive, alike].map(|p| p.expect("a picture").remove(0));
    let covered = covered(mesh, &scene, size);
    assert!(covered.iter().filter(|c| **c).count() > 2000);
    let flip = |picture: &Picture| {
        let flip = Flip::new(&truth, picture, PIXELS_PER_DEGREE);
        flip.expect("one size").mean()
    };
    [ours, naive, alike].map(|mut picture| {
        let whole = flip(&picture);
        for (i, pixel) in picture.pixels_mut().iter_mut().enumerate() {
            if !covered[i] {
                *pixel = truth.pixels()[i];
            }
        }
        let covered = flip(&picture);
        Errors { whole, covered }
    })
}

#[test]
fn minified_maps_are_nearer_to_the_truth_than_naive_averages() {
    // The last numbers are for opponents that draw outlines as well as ours: what the filters alone are worth.
    for (preset, mesh, at_most) in [
        ("turned_disc", mesh::disc(), [0.2, 0.13]),
        ("vinyl_record", mesh::disc(), [0.21, 0.19]),
        ("spun_copper", mesh::pot(), [0.2, 0.29]),
        ("pot", mesh::pot(), [0.28, 0.35]),
    ] {
        for (samples, at_most) in [1, 2].into_iter().zip(at_most) {
            let [ours, naive, alike] = against_the_truth(preset, &mesh, samples);
            println!(
                "{preset} {samples}x{samples}: FLIP {:.5}, naively averaged {:.5} ({:.3}), with our outlines {:.5} ({:.3}); \
                 covered {:.5} {:.5} ({:.3}) {:.5} ({:.3})",
                ours.whole,
                naive.whole,
                ours.whole / naive.whole,
                alike.whole,
                ours.whole / alike.whole,
                ours.covered,
                naive.covered,
                ours.covered / naive.covered,
                alike.covered,
                ours.covered / alike.covered,
            );
            assert!(ours.whole < naive.whole / 3.0, "{preset} {samples}");
            assert!(ours.covered < naive.covered / 3.0, "{preset} {samples}");
            assert!(ours.covered < at_most * alike.covered, "{preset} {samples}");
        }
    }
}

/// A highlight far narrower than a pixel, on metal as flat as a mirror: view and lamp alone turn the half vector. Bare samples lose
/// it between them; widened it is there wherever it falls, as bright on the whole as a box of one sample lets it be.
#[test]
fn highlights_narrower_than_a_sample_are_not_lost_on_flat_surfaces() {
    let mesh = mesh::disc();
    let texel = Texel {
        alpha_x: 0.002,
        alpha_y: 0.001,
        axis: Axis::from_degrees(30.0),
    };
    let map = AnisoMap::constant(Size::new(1, 1).expect("a size"), Wrap::Repeat, texel);
    let material = Material {
        ambient: [0.0; 3],
        diffuse: [0.0; 3],
        ..Material::default()
    };
    let subject = Subject {
        mesh: &mesh,
        map: &map,
        material: &material,
    };
    let size = Size::new(64, 64).expect("a size");
    let none = Progress::none();
    let black = Background {
        top: [0.0; 3],
        bottom: [0.0; 3],
    };
    let sum = |picture: Vec<Picture>| -> f64 {
        let pixels = picture[0].pixels().iter();
        pixels.map(|p| f64::from(p[1])).sum()
    };
    let plain = Scene::for_mesh(&mesh);
    let back = (plain.camera.eye - plain.camera.target).normalize();
    let mirrored = Vec3::new(-back.x, -back.y, back.z);
    let (mut errors, mut bare) = ([0.0f64; 2], [0.0f64; 2]);
    for step in 0..8 {
        // Aside by parts of a pixel.
        let toward = mirrored + Vec3::new(0.003, 0.002, 0.0) * step as f32;
        let far = Light::Directional {
            toward,
            irradiance: [1.0; 3],
        };
        let near = Light::Point {
            position: toward * 2.5,
            intensity: [1.0; 3],
        };
        for (i, light) in [far, near].into_iter().enumerate() {
            let scene = Scene {
                lights: vec![light],
                background: black,
                samples: 1,
                ..plain.clone()
            };
            let looks = [Look::default()];
            let truth = render_reference(subject, &scene, &looks, size, 48, &none);
            let plain = Scene {
                quality: Quality::PLAIN,
                ..scene.clone()
            };
            let [ours, plain] = [&scene, &plain].map(|s| render(subject, s, &looks, size, &none));
            let [truth, ours, plain] = [truth, ours, plain].map(|p| sum(p.expect("a picture")));
            errors[i] = errors[i].max((ours / truth - 1.0).abs());
            bare[i] = bare[i].max((plain / truth - 1.0).abs());
        }
    }
    println!("largest error of the light: {errors:?}, of bare samples {bare:?}");
    assert!(errors[0] < 0.18 && errors[1] < 0.54, "{errors:?}");
    assert!(bare.iter().all(|e| *e > 0.95), "{bare:?}");
}
