//! Golden pictures: small, one subject each. `ANISOMAP_UPDATE_GOLDEN=1 cargo test --test preview` rewrites them; look at each
//! before it goes in. A failure leaves what was drawn and the difference in cargo's folder for test files.

use anisomap::map::{AnisoMap, Size, Texel, Wrap};
use anisomap::math::Axis;
use anisomap::mesh::{self, Mesh};
use anisomap::preview::{
    Difference, Look, Material, Measure, Picture, Rig, Scene, Subject, render, render_sheet,
};
use anisomap::progress::Progress;

#[path = "golden/compare.rs"]
mod golden;

fn size(width: u32, height: u32) -> Size {
    Size::new(width, height).expect("a picture's size")
}

/// Grooves along u that wander a little and vary in width, smooth across the wrap.
fn brushed() -> AnisoMap {
    let n = 32u32;
    let mut map = AnisoMap::constant(
        size(n, n),
        Wrap::Repeat,
        Texel {
            alpha_x: 0.08,
            alpha_y: 0.35,
            axis: Axis::U,
        },
    );
    let mut region = map.region_mut();
    for i in 0..n * n {
        let noise = (i / n * 37 % 32) as f32 / 32.0;
        region.set(
            i as usize,
            Texel {
                alpha_x: 0.06 + 0.08 * noise,
                alpha_y: 0.25 + 0.2 * noise,
                axis: Axis::from_degrees(8.0 * noise - 4.0),
            },
        );
    }
    map
}

fn material() -> Material {
    Material {
        diffuse: [0.12, 0.11, 0.10],
        specular: [0.33, 0.28, 0.2],
        ambient: [0.03; 3],
    }
}

fn compare(name: &str, picture: &Picture) {
    golden::compare(&format!("preview/{name}"), picture);
}

fn one(mesh: &Mesh, scene: &Scene, look: &str) -> Picture {
    let looks = Look::list(look).expect("a look");
    let (map, material) = (brushed(), material());
    let subject = Subject {
        mesh,
        map: &map,
        material: &material,
    };
    render(subject, scene, &looks, size(64, 48), &Progress::none())
        .expect("a picture")
        .remove(0)
}

#[test]
fn the_papers_three_tori() {
    let torus = mesh::torus();
    let (map, material) = (brushed(), material());
    let subject = Subject {
        mesh: &torus,
        map: &map,
        material: &material,
    };
    let looks = Look::list("phong:mean,ward:mean,ward").expect("looks");
    let scene = Scene::for_mesh(&torus);
    let sheet = render_sheet(subject, &scene, &looks, size(192, 76), &Progress::none());
    compare("three_tori", &sheet.expect("a sheet"));
}

#[test]
fn a_pot_under_the_key_light() {
    let pot = mesh::pot();
    let scene = Scene::with_rig(&pot, Rig::Key);
    compare("pot_key", &one(&pot, &scene, "ward-bounded:mean"));
}

#[test]
fn a_disc_by_its_lamp() {
    let disc = mesh::disc();
    let scene = Scene::for_mesh(&disc);
    compare("disc", &one(&disc, &scene, "ggx"));
}

#[test]
fn a_difference_with_its_legend() {
    let sphere = mesh::sphere();
    let scene = Scene::for_mesh(&sphere);
    let (a, b) = (
        one(&sphere, &scene, "ward-exact"),
        one(&sphere, &scene, "ward"),
    );
    let difference = Difference::new(&a, &b, Measure::Signed).expect("one size");
    compare("difference", &difference.picture().expect("a picture"));
}
