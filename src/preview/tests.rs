use super::prepared::{BAND_SAMPLES, bands};
use super::*;
use crate::brdf::Model;
use crate::filter::Pyramid;
use crate::map::{Rect, Texel, Wrap};
use crate::math::Axis;
use crate::raster::{Camera, Projection, TILE};
use glam::Vec3;

const WARD: Look = Look {
    model: Model::Ward,
    mean: false,
};

fn size(width: u32, height: u32) -> Size {
    Size::new(width, height).unwrap()
}

fn constant(alpha_x: f32, alpha_y: f32, degrees: f32) -> AnisoMap {
    let texel = Texel {
        alpha_x,
        alpha_y,
        axis: Axis::from_degrees(degrees),
    };
    AnisoMap::constant(size(8, 8), Wrap::Repeat, texel)
}

/// From far along +z, lit from the eye, against black; no diffuse light, no ambient.
fn head_on(mesh: &Mesh) -> Scene {
    let mut scene = Scene::for_mesh(mesh);
    scene.camera = Camera {
        eye: Vec3::new(0.0, 0.0, 10.0),
        target: Vec3::ZERO,
        up: Vec3::Y,
        projection: Projection::Orthographic { extent: 2.2 },
    };
    scene.lights = vec![Light::Directional {
        toward: Vec3::Z,
        irradiance: [1.0; 3],
    }];
    scene.ambient = [0.0; 3];
    scene.background = Background {
        top: [0.0; 3],
        bottom: [0.0; 3],
    };
    scene
}

const SHINY: Material = Material {
    diffuse: [0.0; 3],
    specular: [1.0; 3],
    ambient: [0.0; 3],
};

fn draw(
    mesh: &Mesh,
    map: &AnisoMap,
    material: &Material,
    scene: &Scene,
    looks: &[Look],
) -> Vec<Picture> {
    let subject = Subject {
        mesh,
        map,
        material,
    };
    render(subject, scene, looks, size(96, 96), &Progress::none()).unwrap()
}

fn shiny(mesh: &Mesh, map: &AnisoMap, scene: &Scene) -> Picture {
    draw(mesh, map, &SHINY, scene, &[WARD]).remove(0)
}

fn largest_difference(a: &Picture, b: &Picture) -> f32 {
    a.pixels()
        .iter()
        .zip(b.pixels())
        .flat_map(|(a, b)| [0, 1, 2].map(|c| (a[c] - b[c]).abs()))
        .fold(0.0, f32::max)
}

fn total(picture: &Picture) -> f64 {
    picture.pixels().iter().map(|p| f64::from(p[1])).sum()
}

/// Variances of the light over the picture: along x, along y, and their covariance, y upward.
fn spread(picture: &Picture) -> (f64, f64, f64) {
    let (w, h) = (f64::from(picture.width()), f64::from(picture.height()));
    let (mut xx, mut yy, mut xy) = (0.0, 0.0, 0.0);
    for y in 0..picture.height() {
        for (x, p) in picture.row(y).iter().enumerate() {
            let (dx, dy) = (x as f64 + 0.5 - 0.5 * w, 0.5 * h - f64::from(y) - 0.5);
            xx += dx * dx * f64::from(p[0]);
            yy += dy * dy * f64::from(p[0]);
            xy += dx * dy * f64::from(p[0]);
        }
    }
    let sum = total(picture);
    (xx / sum, yy / sum, xy / sum)
}

#[test]
fn the_sum_is_the_papers() {
    // A plane at rest: one normal, one tangent, an orthographic eye, so the formula has one value.
    let mesh = crate::mesh::plane();
    let mut scene = head_on(&mesh);
    let l = Vec3::new(0.3, 0.2, 0.8).normalize();
    scene.lights = vec![
        Light::Directional {
            toward: l * 7.0,
            irradiance: [2.0, 1.0, 0.5],
        },
        Light::Directional {
            toward: Vec3::NEG_Z,
            irradiance: [100.0; 3],
        },
        Light::Point {
            position: Vec3::new(0.0, 0.0, 50.0),
            intensity: [500.0; 3],
        },
    ];
    scene.ambient = [0.5; 3];
    scene.exposure = 1.0;
    let material = Material {
        diffuse: [0.3, 0.2, 0.1],
        specular: [0.5, 0.6, 0.7],
        ambient: [0.1, 0.2, 0.3],
    };
    let picture = draw(&mesh, &constant(0.3, 0.5, 25.0), &material, &scene, &[WARD]).remove(0);
    // In the frame of the texel; the plane's tangent is +x, its bitangent +y.
    let (sin, cos) = 25f32.to_radians().sin_cos();
    let local = |v: Vec3| Vec3::new(cos * v.x + sin * v.y, cos * v.y - sin * v.x, v.z);
    let k_spec = |l: Vec3| {
        let h = (l + Vec3::Z).normalize();
        let k = (h.x / 0.3f32).powi(2) + (h.y / 0.5f32).powi(2);
        (l.z / (l.z * 1.0).sqrt()) * (-2.0 * k / (1.0 + h.z)).exp()
            / (4.0 * std::f32::consts::PI * 0.3 * 0.5)
    };
    let pixel = picture.pixel(48, 48);
    for c in 0..3 {
        let key = [2.0, 1.0, 0.5][c];
        let lamp = 500.0 / 2500.0;
        let diffuse = material.diffuse[c] / std::f32::consts::PI * (key * l.z + lamp);
        let specular = material.specular[c] * (key * k_spec(local(l)) + lamp * k_spec(Vec3::Z));
        let want = 2.0 * (0.5 * material.ambient[c] + diffuse + specular);
        assert!((pixel[c] / want - 1.0).abs() < 2e-3, "{} {want}", pixel[c]);
    }
}

#[test]
fn the_highlight_stretches_along_the_larger_alpha() {
    let mesh = crate::mesh::sphere();
    let scene = head_on(&mesh);
    let at = |ax, ay, degrees| spread(&shiny(&mesh, &constant(ax, ay, degrees), &scene));
    let (xx, yy, _) = at(0.05, 0.3, 0.0);
    assert!(yy > 8.0 * xx, "{xx} {yy}");
    let (xx, yy, _) = at(0.05, 0.3, 90.0);
    assert!(xx > 8.0 * yy, "{xx} {yy}");
    let (xx, yy, _) = at(0.3, 0.05, 0.0);
    assert!(xx > 8.0 * yy, "{xx} {yy}");
    // Wide along 30 degrees: counter-clockwise from +u toward image-up, seen from outside.
    let (xx, yy, xy) = at(0.2, 0.04, 30.0);
    let angle = 0.5 * (2.0 * xy).atan2(xx - yy).to_degrees();
    assert!((angle - 30.0).abs() < 3.0, "{angle}");
}

#[test]
fn half_a_turn_of_the_axis_changes_nothing() {
    let mesh = crate::mesh::torus();
    let scene = Scene::for_mesh(&mesh);
    let a = shiny(&mesh, &constant(0.05, 0.3, 20.0), &scene);
    let b = shiny(&mesh, &constant(0.05, 0.3, 200.0), &scene);
    assert!(largest_difference(&a, &b) < 1e-4 && total(&a) > 1.0);
}

#[test]
fn the_number_of_threads_changes_no_byte() {
    let mesh = crate::mesh::torus();
    let scene = Scene::for_mesh(&mesh);
    let map = constant(0.05, 0.3, 20.0);
    let looks = Look::list("phong:mean,ward:mean,ward").unwrap();
    let run = |threads| {
        rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .unwrap()
            .install(|| draw(&mesh, &map, &SHINY, &scene, &looks))
    };
    assert!(run(1) == run(2));
}

#[test]
fn the_seam_shows_no_line() {
    // A cylinder turned so that its seam (at -z) faces the eye, under a map that is smooth across it.
    let mesh = crate::mesh::cylinder();
    let n = 64u32;
    let wave = |f: &dyn Fn(f32) -> f32| -> Vec<f32> {
        (0..n * n)
            .map(|i| f((i % n) as f32 / n as f32 * std::f32::consts::TAU))
            .collect()
    };
    let planes = [
        wave(&|t| 0.2 + 0.05 * t.cos()),
        wave(&|t| 0.4 + 0.1 * t.sin()),
        wave(&|t| (0.6 * t.sin()).cos()),
        wave(&|t| (0.6 * t.sin()).sin()),
    ];
    let (map, _) = AnisoMap::from_planes(size(n, n), Wrap::RepeatU, planes).unwrap();
    let mut scene = head_on(&mesh);
    scene.camera.eye = Vec3::new(0.0, 0.0, -10.0);
    scene.lights = vec![Light::Directional {
        toward: Vec3::new(0.2, 0.3, -1.0),
        irradiance: [1.0; 3],
    }];
    let picture = shiny(&mesh, &map, &scene);
    let bend = |x: usize| {
        let row = picture.row(48);
        (row[x - 1][0] - 2.0 * row[x][0] + row[x + 1][0]).abs()
    };
    // The seam lies between columns 47 and 48; nothing there may bend more than the smooth surface around it does.
    let elsewhere = (30..44).chain(52..66).map(bend).fold(0.0, f32::max);
    let seam = (46..50).map(bend).fold(0.0, f32::max);
    assert!(picture.row(48)[48][0] > 0.1);
    assert!(seam <= 1.5 * elsewhere, "{seam} {elsewhere}");
}

#[test]
fn the_mean_of_a_constant_map_is_the_map() {
    let mesh = crate::mesh::torus();
    let scene = Scene::for_mesh(&mesh);
    for degrees in [0.0, 90.0] {
        let looks = Look::list("ward:mean,ward").unwrap();
        let map = constant(0.08, 0.3, degrees);
        let pictures = draw(&mesh, &map, &SHINY, &scene, &looks);
        let brightest = pictures[1].pixels().iter().fold(0.0, |m, p| p[0].max(m));
        assert!(largest_difference(&pictures[0], &pictures[1]) < 1e-3 * brightest);
    }
    // Grooves in every direction have no direction on the whole.
    let round = AnisoMap::from_planes(
        size(2, 1),
        Wrap::Repeat,
        [vec![0.1; 2], vec![0.3; 2], vec![1.0, -1.0], vec![0.0; 2]],
    )
    .unwrap()
    .0;
    let alpha = ((0.01f32 + 0.09) / 2.0).sqrt();
    let look = [Look { mean: true, ..WARD }];
    let mean = draw(&mesh, &round, &SHINY, &scene, &look).remove(0);
    let want = shiny(&mesh, &constant(alpha, alpha, 0.0), &scene);
    assert!(largest_difference(&mean, &want) < 1e-3);
}

#[test]
fn a_highlight_narrower_than_a_pixel_keeps_its_light() {
    let mesh = crate::mesh::sphere();
    let mut scene = head_on(&mesh);
    scene.samples = 1;
    scene.lights = vec![Light::Directional {
        toward: Vec3::new(0.5, 0.31, 0.8),
        irradiance: [1.0; 3],
    }];
    // 96 pixels turn the normal by 0.023 a pixel at least: this lobe is a quarter of that wide.
    let map = constant(0.006, 0.006, 0.0);
    let subject = Subject {
        mesh: &mesh,
        map: &map,
        material: &SHINY,
    };
    let light = |side: u32| {
        let p = render(
            subject,
            &scene,
            &[WARD],
            size(side, side),
            &Progress::none(),
        )
        .unwrap();
        total(&p[0]) / f64::from(side * side)
    };
    let (coarse, fine) = (light(96), light(1536));
    assert!((coarse / fine - 1.0).abs() < 0.1, "{coarse} {fine}");
}

#[test]
fn supersampling_smooths_and_keeps_the_light() {
    let mesh = crate::mesh::torus();
    let map = constant(0.2, 0.4, 0.0);
    let mut scene = Scene::for_mesh(&mesh);
    let mut light = Vec::new();
    for samples in 1..=SAMPLES_MAX {
        scene.samples = samples;
        light.push(total(&shiny(&mesh, &map, &scene)));
    }
    for l in &light {
        assert!((l / light[3] - 1.0).abs() < 0.01, "{light:?}");
    }
}

#[test]
fn both_sides_of_an_open_surface_are_lit_from_the_eyes_side() {
    let mesh = crate::mesh::disc();
    let map = constant(0.2, 0.5, 30.0);
    let mut scene = head_on(&mesh);
    let front = shiny(&mesh, &map, &scene);
    scene.camera.eye = Vec3::new(0.0, 0.0, -10.0);
    assert_eq!(total(&shiny(&mesh, &map, &scene)), 0.0, "lit from behind");
    scene.lights = vec![Light::Directional {
        toward: Vec3::NEG_Z,
        irradiance: [1.0; 3],
    }];
    let back = shiny(&mesh, &map, &scene);
    assert!((total(&back) / total(&front) - 1.0).abs() < 0.01);
}

#[test]
fn without_a_tangent_the_lobe_is_round() {
    let mut mesh = crate::mesh::sphere();
    let scene = head_on(&mesh);
    let alpha = ((0.01f32 + 0.09) / 2.0).sqrt();
    let round = shiny(&mesh, &constant(alpha, alpha, 0.0), &scene);
    mesh.tangents.fill(glam::Vec4::ZERO);
    let lost = shiny(&mesh, &constant(0.1, 0.3, 40.0), &scene);
    assert!(largest_difference(&round, &lost) < 1e-3);
}

#[test]
fn bent_normals_and_grazing_light_stay_finite() {
    let mut mesh = crate::mesh::torus();
    for (i, n) in mesh.normals.iter_mut().enumerate() {
        // Up to 30 degrees off, and some useless.
        *n = (*n + Vec3::new(0.5, -0.3, 0.2) * ((i % 7) as f32 / 7.0)).normalize();
        if i % 101 == 0 {
            *n = Vec3::ZERO;
        }
    }
    let scene = Scene::with_rig(&mesh, Rig::Lamp);
    let map = constant(0.001, 1.5, 10.0);
    for model in Model::ALL {
        let look = Look { model, mean: false };
        let picture = draw(&mesh, &map, &Material::default(), &scene, &[look]).remove(0);
        let fine = |p: &[f32; 3]| p.iter().all(|c| c.is_finite() && *c >= 0.0);
        assert!(picture.pixels().iter().all(fine), "{model}");
    }
}

#[test]
fn every_stock_mesh_lies_whole_in_its_picture() {
    for name in crate::mesh::BUILTIN_NAMES {
        let mesh = crate::mesh::builtin(name).unwrap();
        let mut scene = Scene::for_mesh(&mesh);
        scene.check().unwrap();
        scene.background = Background {
            top: [0.0; 3],
            bottom: [0.0; 3],
        };
        let picture = draw(
            &mesh,
            &constant(0.2, 0.4, 0.0),
            &Material::default(),
            &scene,
            &[WARD],
        )
        .remove(0);
        let lit = |x: u32, y: u32| picture.pixel(x, y)[0] > 0.0;
        let covered = (0..96 * 96).filter(|i| lit(i % 96, i / 96)).count();
        assert!(covered > 96 * 96 / 4, "{name} fills {covered} pixels");
        let edge = (0..96).any(|i| lit(i, 0) || lit(i, 95) || lit(0, i) || lit(95, i));
        assert!(!edge, "{name} reaches the picture's edge");
    }
}

#[test]
fn bands_cover_the_samples_and_begin_at_whole_pixels() {
    for s in [
        size(1, 1),
        size(96, 96),
        size(5000, 7001),
        size(32_768, 8192),
    ] {
        let mut next = 0;
        for band in bands(s, BAND_SAMPLES) {
            assert_eq!((band.x, band.width, band.y), (0, s.width(), next));
            assert_eq!(band.y % TILE, 0);
            assert!(band.texels() as u64 <= BAND_SAMPLES.max(u64::from(s.width() * TILE)));
            next += band.height;
        }
        assert_eq!(next, s.height());
    }
}

#[test]
fn progress_counts_to_its_end_and_cancelling_stops() {
    let mesh = crate::mesh::torus();
    let map = constant(0.2, 0.4, 0.0);
    let material = Material::default();
    let subject = Subject {
        mesh: &mesh,
        map: &map,
        material: &material,
    };
    let scene = Scene::for_mesh(&mesh);
    let last = std::sync::Mutex::new((0, 0));
    let listen = |done: u64, total: u64| {
        *last.lock().unwrap() = (done, total);
        true
    };
    let run = |progress: &Progress<'_>| {
        render_sheet(subject, &scene, &[WARD, WARD], size(64, 48), progress)
    };
    run(&Progress::new(&listen)).unwrap();
    assert_eq!(*last.lock().unwrap(), (4, 4));
    let stop = |_: u64, _: u64| false;
    assert!(matches!(run(&Progress::new(&stop)), Err(Error::Cancelled)));
}

#[test]
fn too_many_samples_are_refused_with_the_picture_size() {
    let e = sample_grid(size(16_384, 16_384), 2)
        .unwrap_err()
        .to_string();
    assert!(
        e.contains("16384x16384") && e.contains("fewer samples"),
        "{e}"
    );
}

#[test]
fn the_reference_is_what_the_picture_tends_to() {
    // Rough enough that no sample misses a highlight, directions that turn across the map.
    let mut map = constant(0.25, 0.5, 0.0);
    for i in 0..64 {
        let texel = Texel {
            alpha_x: 0.2 + 0.01 * (i % 8) as f32,
            alpha_y: 0.5,
            axis: Axis::from_degrees(3.0 * i as f32),
        };
        map.region_mut().set(i, texel);
    }
    let material = Material {
        diffuse: [0.2, 0.1, 0.1],
        specular: [0.5, 0.6, 0.7],
        ambient: [0.1; 3],
    };
    let looks: Vec<Look> = Look::list("ward,ward-bounded,ggx,ward:mean").unwrap();
    for mesh in [crate::mesh::torus(), crate::mesh::pot()] {
        let subject = Subject {
            mesh: &mesh,
            map: &map,
            material: &material,
        };
        let mut scene = Scene::for_mesh(&mesh);
        scene.samples = 4;
        let draw = |samples| {
            let none = Progress::none();
            render_reference(subject, &scene, &looks, size(64, 48), samples, &none).unwrap()
        };
        let fast = |quality| {
            let scene = Scene {
                quality,
                ..scene.clone()
            };
            render(subject, &scene, &looks, size(64, 48), &Progress::none()).unwrap()
        };
        let plain = fast(Quality {
            back_faces: true,
            ..Quality::PLAIN
        });
        let (standard, four, eight) = (fast(Quality::default()), draw(4), draw(8));
        for (i, look) in looks.iter().enumerate() {
            let [plain, standard, four, eight] = [&plain, &standard, &four, &eight].map(|p| &p[i]);
            let mean = |a: &Picture, b: &Picture| {
                let difference = |(a, b): (&[f32; 3], &[f32; 3])| f64::from((a[1] - b[1]).abs());
                let sum: f64 = a.pixels().iter().zip(b.pixels()).map(difference).sum();
                sum / a.pixels().len() as f64
            };
            let name = format!("{} {look}", mesh.name);
            // The same samples, other arithmetic.
            assert!(mean(plain, four) < 1e-5, "{name}: {}", mean(plain, four));
            // More samples move the outline.
            assert!(mean(four, eight) < 4e-3, "{name}: {}", mean(four, eight));
            assert!(
                mean(standard, eight) < 4e-3,
                "{name}: {}",
                mean(standard, eight)
            );
            assert!(mean(four, eight) > 0.0);
        }
    }
}

#[test]
fn the_reference_says_which_numbers_of_samples_fit_its_tiles() {
    let mesh = crate::mesh::plane();
    let map = constant(0.1, 0.1, 0.0);
    let subject = Subject {
        mesh: &mesh,
        map: &map,
        material: &SHINY,
    };
    let scene = head_on(&mesh);
    for samples in [0, 5, 7, 49, u32::MAX] {
        let none = Progress::none();
        let error = render_reference(subject, &scene, &[WARD], size(8, 8), samples, &none);
        assert!(error.unwrap_err().to_string().contains("1, 2, 3, 4, 6, 8"));
    }
}

/// A torus with a map, looked at again and again.
struct Studio {
    mesh: Mesh,
    scene: Scene,
    material: Material,
}

impl Studio {
    fn new() -> Self {
        let mesh = crate::mesh::torus();
        let scene = Scene::for_mesh(&mesh);
        let material = Material {
            diffuse: [0.1, 0.2, 0.3],
            ..SHINY
        };
        Self {
            mesh,
            scene,
            material,
        }
    }

    /// Draws the frame and holds it against a picture drawn anew.
    fn check(&self, frame: &mut Frame, prepared: &Prepared<'_>, look: Look) -> Redrawn {
        let (off, none) = (Timings::off(), Progress::none());
        let done = frame
            .draw(prepared, &self.scene, look, &off, &none)
            .unwrap();
        let map = prepared.map().clone();
        let subject = Subject {
            mesh: &self.mesh,
            map: &map,
            material: prepared.material(),
        };
        let anew = render(subject, &self.scene, &[look], size(120, 90), &none).unwrap();
        assert!(frame.picture() == &anew[0], "{done:?}");
        done
    }
}

fn paint(prepared: &mut Prepared<'_>, rect: Rect) {
    prepared.change_map(rect, |map| {
        let mut region = map.region(rect);
        for i in 0..rect.texels() {
            let texel = Texel {
                alpha_x: 0.6,
                alpha_y: 0.05,
                axis: Axis::from_degrees(i as f32),
            };
            region.view_mut().set(i, texel);
        }
        map.write_region(&region);
    });
}

#[test]
fn a_frame_does_no_more_than_what_changed_and_is_always_the_whole_picture() {
    let mut studio = Studio::new();
    let map = AnisoMap::constant(
        size(512, 512),
        Wrap::Repeat,
        constant(0.1, 0.4, 20.0).texel_at(0),
    );
    let off = Timings::off();
    let mut prepared = Prepared::new(&studio.mesh, map, studio.material, &off).unwrap();
    let mesh = studio.mesh.clone();
    let mut frame = Frame::new(size(120, 90));
    assert_eq!(
        studio.check(&mut frame, &prepared, WARD),
        Redrawn::Everything
    );
    assert_eq!(studio.check(&mut frame, &prepared, WARD), Redrawn::Nothing);
    // Light, exposure, look and colours.
    studio.scene.set_directions(&[Vec3::new(0.3, 0.5, 1.0)]);
    assert_eq!(studio.check(&mut frame, &prepared, WARD), Redrawn::Light);
    studio.scene.exposure = 0.5;
    assert_eq!(studio.check(&mut frame, &prepared, WARD), Redrawn::Light);
    let bounded = Look {
        model: Model::WardBounded,
        mean: false,
    };
    assert_eq!(studio.check(&mut frame, &prepared, bounded), Redrawn::Light);
    prepared.set_material(SHINY).unwrap();
    assert_eq!(studio.check(&mut frame, &prepared, WARD), Redrawn::Light);
    // A dab here, two dabs there, one across the corner of the map, one of a texel.
    let dab = |x, y, width, height| Rect {
        x,
        y,
        width,
        height,
    };
    let mut fewest = usize::MAX;
    for rects in [
        vec![dab(250, 380, 24, 24)],
        vec![dab(10, 10, 40, 8), dab(300, 200, 16, 16)],
        vec![dab(0, 0, 512, 2)],
        vec![dab(511, 511, 1, 1), dab(0, 511, 1, 1)],
        (0..64).map(|i| dab(8 * i, 250, 4, 4)).collect(),
    ] {
        for rect in rects {
            paint(&mut prepared, rect);
        }
        match studio.check(&mut frame, &prepared, WARD) {
            Redrawn::Tiles(n) => fewest = fewest.min(n),
            other => panic!("{other:?}"),
        }
    }
    assert!((1..16).contains(&fewest), "{fewest} of 20 tiles");
    // Fetches reach farther with footprints averaged than without.
    for mips in [false, true] {
        studio.scene.quality.mips = mips;
        assert_eq!(studio.check(&mut frame, &prepared, WARD), Redrawn::Light);
        for y in [100, 300] {
            paint(&mut prepared, dab(40 * y % 512, y, 3, 3));
            assert!(matches!(
                studio.check(&mut frame, &prepared, WARD),
                Redrawn::Tiles(_)
            ));
        }
    }
    // Outlines that are drawn with more samples than the rest, or not.
    for (samples, outlines) in [(1, true), (3, true), (3, false), (2, true)] {
        studio.scene.samples = samples;
        studio.scene.quality.outlines = outlines;
        assert_eq!(
            studio.check(&mut frame, &prepared, WARD),
            Redrawn::Everything
        );
        for k in 0..16 {
            paint(&mut prepared, dab(37 * k % 500, 91 * k % 500, 5, 5));
            assert!(matches!(
                studio.check(&mut frame, &prepared, WARD),
                Redrawn::Tiles(_)
            ));
        }
        studio.scene.exposure += 0.25;
        assert_eq!(studio.check(&mut frame, &prepared, WARD), Redrawn::Light);
    }
    // More than is remembered.
    for i in 0..257 {
        paint(&mut prepared, dab(i, i, 1, 1));
    }
    assert_eq!(studio.check(&mut frame, &prepared, WARD), Redrawn::Light);
    // The mean of the map is everywhere.
    let mean = Look { mean: true, ..WARD };
    assert_eq!(studio.check(&mut frame, &prepared, mean), Redrawn::Light);
    paint(&mut prepared, dab(7, 7, 9, 9));
    assert_eq!(studio.check(&mut frame, &prepared, mean), Redrawn::Light);
    // The camera, in a hurry and at rest; samples; other geometry.
    studio.scene.camera.eye += Vec3::new(0.5, 0.2, 0.0);
    frame
        .draft(&prepared, &studio.scene, WARD, &off, &Progress::none())
        .unwrap();
    assert_eq!(
        studio.check(&mut frame, &prepared, WARD),
        Redrawn::Everything
    );
    studio.scene.samples = 1;
    assert_eq!(
        studio.check(&mut frame, &prepared, WARD),
        Redrawn::Everything
    );
    let other = Prepared::new(&mesh, prepared.map().clone(), SHINY, &off).unwrap();
    assert_eq!(studio.check(&mut frame, &other, WARD), Redrawn::Everything);
    // Cancelled halfway, the next call draws what is missing.
    studio.scene.exposure = -1.0;
    let stop = |done: u64, _: u64| done < 3;
    let cancelled = frame.draw(&other, &studio.scene, WARD, &off, &Progress::new(&stop));
    assert!(matches!(cancelled, Err(Error::Cancelled)));
    assert_eq!(studio.check(&mut frame, &other, WARD), Redrawn::Light);
}

#[test]
fn a_map_of_another_size_or_wrap_is_seen_elsewhere() {
    let mut studio = Studio::new();
    for uv in &mut studio.mesh.uvs {
        *uv = *uv * 3.0 - 1.0;
    }
    let mesh = studio.mesh.clone();
    let map = |side, wrap| {
        let texel = constant(0.1, 0.4, 20.0).texel_at(0);
        Pyramid::new(AnisoMap::constant(size(side, side), wrap, texel))
    };
    let off = Timings::off();
    let first = AnisoMap::clone(map(512, Wrap::Clamp).base());
    let mut prepared = Prepared::new(&mesh, first, studio.material, &off).unwrap();
    let mut frame = Frame::new(size(120, 90));
    for (side, wrap) in [
        (512, Wrap::Clamp),
        (512, Wrap::Repeat),
        (16, Wrap::Repeat),
        (256, Wrap::RepeatU),
    ] {
        prepared.set_map(map(side, wrap));
        studio.check(&mut frame, &prepared, WARD);
        for k in 0..8 {
            let dab = Rect {
                x: 37 * k % (side - 3),
                y: 91 * k % (side - 3),
                width: 3,
                height: 3,
            };
            paint(&mut prepared, dab);
            let redrawn = studio.check(&mut frame, &prepared, WARD);
            assert!(matches!(redrawn, Redrawn::Tiles(_)), "{redrawn:?}");
        }
    }
}

#[test]
fn what_a_limit_leaves_is_lit_by_the_next_drawings() {
    let studio = Studio::new();
    let map = AnisoMap::constant(
        size(256, 256),
        Wrap::Repeat,
        constant(0.1, 0.4, 20.0).texel_at(0),
    );
    let (off, none) = (Timings::off(), Progress::none());
    let mut prepared = Prepared::new(&studio.mesh, map, studio.material, &off).unwrap();
    let all = size(700, 600);
    let mut frame = Frame::new(all);
    let draw = |frame: &mut Frame, prepared: &Prepared<'_>| {
        let limit = Some(std::time::Duration::ZERO);
        frame
            .draw_within(limit, prepared, &studio.scene, WARD, &off, &none)
            .unwrap()
    };
    draw(&mut frame, &prepared);
    assert!(!frame.is_behind(), "the first picture is whole");
    let mut drawings = 0;
    for k in 0..3 {
        let rect = Rect {
            x: 60 * k,
            y: 20 * k,
            width: 100,
            height: 200,
        };
        paint(&mut prepared, rect);
        draw(&mut frame, &prepared);
        assert!(frame.is_behind(), "there are more than 64 tiles");
    }
    while frame.is_behind() {
        draw(&mut frame, &prepared);
        drawings += 1;
        assert!(drawings < 20);
    }
    let looks = [WARD];
    let anew = prepared.render(&studio.scene, &looks, all, &off, &none);
    assert!(*frame.picture() == anew.unwrap()[0]);
    // Changes that go on everywhere keep no tile waiting: those owed longest are lit first.
    for _ in 0..2 * drawings {
        paint(&mut prepared, size(256, 256).rect());
        draw(&mut frame, &prepared);
        assert!(frame.is_behind());
    }
    let anew = prepared.render(&studio.scene, &looks, all, &off, &none);
    assert!(*frame.picture() == anew.unwrap()[0]);
}
