//! Maps far finer than the pixels: our averages against a picture of very many samples.

use anisomap::analyse::{Flip, PIXELS_PER_DEGREE};
use anisomap::map::{AnisoMap, Size};
use anisomap::mesh::{self, Mesh};
use anisomap::preview::{Look, Picture, Quality, Scene, Subject, render, render_reference};
use anisomap::progress::Progress;
use anisomap::recipe::{Recipe, preset};

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

/// FLIP from the truth of the filter that pictures are drawn with, and of naive averaging to about a texel a pixel.
fn against_the_truth(preset: &str, mesh: &Mesh, samples: u32) -> (f64, f64) {
    let recipe = recipe(preset);
    let map = filled(&recipe, 4096);
    let naive = averaged_naively(&map, 128);
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
    let unfiltered = Scene {
        quality: Quality {
            mips: false,
            ..scene.quality
        },
        ..scene.clone()
    };
    let naive = render(subject(&naive), &unfiltered, &looks, size, &none);
    let [truth, ours, naive] = [truth, ours, naive].map(|p| p.expect("a picture").remove(0));
    let flip = |p: &Picture| {
        Flip::new(&truth, p, PIXELS_PER_DEGREE)
            .expect("one size")
            .mean()
    };
    (flip(&ours), flip(&naive))
}

#[test]
fn minified_maps_are_three_times_nearer_to_the_truth_than_naive_averages() {
    // With 4x4 samples the outline, which no filter of maps helps, is small beside what the filters do.
    for (preset, mesh) in [
        ("turned_disc", mesh::disc()),
        ("vinyl_record", mesh::disc()),
        ("pot", mesh::pot()),
    ] {
        let (ours, naive) = against_the_truth(preset, &mesh, 4);
        println!("{preset}: FLIP {ours:.5}, naively averaged {naive:.5}");
        assert!(ours < naive / 3.0, "{preset}: {ours} {naive}");
        assert!(
            naive > 0.005,
            "{preset}: naive averaging is to be seen: {naive}"
        );
    }
}
