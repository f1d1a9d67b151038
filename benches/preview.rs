//! How fast a picture is drawn: a torus of 65536 triangles under a directional and a point light, exact Ward, one sample a
//! pixel, a 1024x1024 map repeated 4x2 or one constant lobe, 1024x1024 pixels. Every picture is a full redraw: nothing is kept
//! from the one before but the prepared map and the memory.
//!
//! Run with `cargo bench --bench preview`. One line per case:
//! `case=torus-map threads=2 ms_min=… ms_median=…`. `control` is arithmetic without memory, spread as the picture's tiles are:
//! what a second core can bring on this machine. `tone` is the way from linear light to eight bits, which `torus-…` leave out.
//! `covered` counts the pixels that see the torus, and the bench fails where they are not those of the scene. `case=stages` lines say where the time of one thread goes.
//!
//! Words after `--` choose cases by the beginnings of their names: `cargo bench --bench preview -- control torus-map`. Two
//! variables let the picture be compared with another renderer's: `ANISOMAP_BENCH_MAP` names an OpenEXR file with the
//! channels ward.alphaX, ward.alphaY, ward.dirX, ward.dirY (row 0 at v = 0) to be taken for the map, `ANISOMAP_BENCH_PICTURE` a
//! file that the picture with the map is written to, as rows of R, G, B in f32, top row first.

mod common;

use anisomap::brdf::Model;
use anisomap::brdf::kernel::exp_5;
use anisomap::map::{AnisoMap, Size, Texel, Wrap};
use anisomap::math::{Axis, sin_cos};
use anisomap::mesh::Mesh;
use anisomap::preview::{
    Background, Light, Look, Material, Picture, Prepared, Quality, Scene, Stage, Subject, Timings,
};
use anisomap::progress::Progress;
use anisomap::raster::{Camera, Cull, GBuffer, Geometry, Projection, Tile, View};
use common::{is_wanted, milliseconds};
use glam::{Vec2, Vec3};
use rayon::prelude::*;
use std::f32::consts::TAU;

const ROUNDS: usize = 150;
const MAP_SIDE: u32 = 1024;
/// Pixels of 1024x1024 that see the torus when Mesa's llvmpipe draws the scene; ours are that many to 0.1 %, or the two do not draw
/// the same.
const COVERED: usize = 503_098;

/// Around the z axis, u once around the large circle, with texture coordinates repeated 4x2.
fn torus() -> Mesh {
    let (across, along) = (256u32, 128u32);
    let mut mesh = Mesh {
        name: "torus".into(),
        positions: vec![],
        normals: vec![],
        tangents: vec![],
        uvs: vec![],
        triangles: vec![],
        aspect: 1.0,
    };
    for i in 0..=across {
        for j in 0..=along {
            let (u, v) = (i as f32 / across as f32, j as f32 / along as f32);
            let ((su, cu), (sv, cv)) = (sin_cos(TAU * u), sin_cos(TAU * v));
            let normal = Vec3::new(cv * cu, cv * su, sv);
            mesh.positions.push(Vec3::new(cu, su, 0.0) + normal * 0.42);
            mesh.normals.push(normal);
            mesh.tangents.push(Vec3::new(-su, cu, 0.0).extend(1.0));
            mesh.uvs.push(Vec2::new(4.0 * u, 2.0 * v));
        }
    }
    for i in 0..across {
        for j in 0..along {
            let a = i * (along + 1) + j;
            let b = a + along + 1;
            mesh.triangles.push([a, b, b + 1]);
            mesh.triangles.push([a, b + 1, a + 1]);
        }
    }
    mesh
}

fn scene() -> Scene {
    Scene {
        camera: Camera {
            eye: Vec3::new(0.0, -2.75, 2.1),
            target: Vec3::ZERO,
            up: Vec3::Z,
            projection: Projection::Perspective { fov: 50.0 },
        },
        lights: vec![
            Light::Directional {
                toward: Vec3::new(0.35, -0.55, 0.76),
                irradiance: [2.0; 3],
            },
            Light::Point {
                position: Vec3::new(1.6, -1.4, 1.8),
                intensity: [6.0; 3],
            },
        ],
        ambient: [0.0; 3],
        exposure: 0.0,
        background: Background {
            top: [0.0; 3],
            bottom: [0.0; 3],
        },
        samples: 1,
        quality: Quality::PLAIN,
    }
}

const MATERIAL: Material = Material {
    diffuse: [0.15; 3],
    specular: [0.35; 3],
    ambient: [0.0; 3],
};

/// Streaks along u: white noise averaged over a sixteenth of the row.
fn brushed() -> AnisoMap {
    let (n, length) = (MAP_SIDE as usize, MAP_SIDE as usize / 16);
    let size = Size::new(MAP_SIDE, MAP_SIDE).expect("a size");
    let texel = Texel {
        alpha_x: 0.09,
        alpha_y: 0.37,
        axis: Axis::U,
    };
    let mut map = AnisoMap::constant(size, Wrap::Repeat, texel);
    let mut region = map.region_mut();
    let mut state = 7u32;
    for y in 0..n {
        let noise: Vec<f32> = (0..n)
            .map(|_| {
                state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
                (state >> 8) as f32 / 16_777_216.0 - 0.5
            })
            .collect();
        let mut sum: f32 = noise[..length].iter().sum();
        for x in 0..n {
            let s = (0.5 + 0.2 * sum / (length as f32 / 12.0).sqrt()).clamp(0.0, 1.0);
            region.set(
                y * n + x,
                Texel {
                    alpha_x: 0.06 + 0.06 * s,
                    alpha_y: 0.25 + 0.25 * s,
                    axis: Axis::from_radians(0.15 * (s - 0.5)),
                },
            );
            sum += noise[(x + length) % n] - noise[x];
        }
    }
    map
}

/// The map of `ANISOMAP_BENCH_MAP`: alphas and a direction vector; its row 0 is the bottom.
fn read_map(path: &std::ffi::OsStr) -> AnisoMap {
    let image = exr::prelude::read_first_flat_layer_from_file(path).expect("an OpenEXR file");
    let size = image.layer_data.size;
    let channel = |name: &str| -> Vec<f32> {
        let found = image.layer_data.channel_data.list.iter();
        let found = found.into_iter().find(|c| c.name.to_string() == name);
        let samples = &found
            .unwrap_or_else(|| panic!("channel {name}"))
            .sample_data;
        let rows: Vec<f32> = samples.values_as_f32().collect();
        rows.chunks(size.x()).rev().flatten().copied().collect()
    };
    let (x, y) = (channel("ward.dirX"), channel("ward.dirY"));
    let double = |f: fn(f32, f32) -> f32| x.iter().zip(&y).map(|(x, y)| f(*x, *y)).collect();
    let planes = [
        channel("ward.alphaX"),
        channel("ward.alphaY"),
        double(|x, y| x * x - y * y),
        double(|x, y| 2.0 * x * y),
    ];
    let size = Size::new(size.x() as u32, size.y() as u32).expect("a size");
    AnisoMap::from_planes(size, Wrap::Repeat, planes)
        .expect("four planes")
        .0
}

struct Case<'a> {
    name: String,
    prepared: &'a Prepared<'a>,
    look: Look,
    side: u32,
}

impl Case<'_> {
    fn picture(&self) -> Picture {
        Picture::new(Size::new(self.side, self.side).expect("a size"), [0.0; 3])
    }

    fn draw(&self, picture: &mut Picture, timings: &Timings) {
        let pictures = std::slice::from_mut(picture);
        self.prepared
            .draw(&scene(), &[self.look], pictures, timings, &Progress::none())
            .expect("a picture");
    }

    fn stages(&self) {
        if !is_wanted("stages") {
            return;
        }
        let timings = Timings::on();
        let mut picture = self.picture();
        for _ in 0..ROUNDS {
            self.draw(&mut picture, &timings);
        }
        let list: Vec<String> = Stage::ALL
            .into_iter()
            .map(|s| {
                format!(
                    "{}={:.2}",
                    s.name(),
                    timings.milliseconds(s) / ROUNDS as f64
                )
            })
            .collect();
        println!("case=stages of={} threads=1 {}", self.name, list.join(" "));
    }
}

/// Pixels that see the torus, lit or not.
fn covered(mesh: &Mesh, size: Size) -> usize {
    let geometry = Geometry::new(mesh).expect("a mesh that fits together");
    let view = View::new(&scene().camera, size).expect("a camera");
    let window = size.rect();
    let buffer = GBuffer::draw(&geometry, &view, window, Cull::Back, &Progress::none());
    let tiles = buffer.expect("nobody cancels");
    tiles.tiles().iter().map(Tile::covered).sum()
}

/// Runs `work` in pools of one and two threads by turns, so that whatever else the machine does hits both alike.
fn report(name: &str, rounds: usize, mut work: impl FnMut() + Send) {
    if !is_wanted(name) {
        return;
    }
    let pools = [1, 2].map(|n| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(n).build();
        (n, pool.expect("threads"))
    });
    let mut times = [Vec::new(), Vec::new()];
    for _ in 0..rounds {
        for ((_, pool), times) in pools.iter().zip(&mut times) {
            times.push(pool.install(|| milliseconds(&mut work)).0);
        }
    }
    for ((threads, _), mut times) in pools.iter().zip(times) {
        times.sort_by(f64::total_cmp);
        println!(
            "case={name} threads={threads} ms_min={:.3} ms_median={:.3}",
            times[0],
            times[times.len() / 2]
        );
    }
}

/// Arithmetic in registers, cut into as many pieces as a picture has tiles.
fn control() {
    let sum: f32 = (0..484u32)
        .into_par_iter()
        .map(|tile| {
            let mut x = [0.0f32; 16];
            for i in 0..3000 {
                for (lane, x) in x.iter_mut().enumerate() {
                    *x = exp_5(-*x - (tile as usize + i + lane) as f32 * 1e-6);
                }
            }
            x.iter().sum::<f32>()
        })
        .sum();
    std::hint::black_box(sum);
}

fn main() {
    let mesh = torus();
    let map = std::env::var_os("ANISOMAP_BENCH_MAP").map_or_else(brushed, |p| read_map(&p));
    let constant = AnisoMap::constant(
        Size::new(1, 1).expect("a size"),
        Wrap::Repeat,
        Texel {
            alpha_x: 0.09,
            alpha_y: 0.37,
            axis: Axis::U,
        },
    );
    let prepare = |map| {
        let subject = Subject {
            mesh: &mesh,
            map,
            material: &MATERIAL,
        };
        subject
            .prepare(&Timings::off())
            .expect("a mesh that fits together")
    };
    let (mapped, plain) = (prepare(&map), prepare(&constant));
    let look = |mean| Look {
        model: Model::WardExact,
        mean,
    };
    let case = |name: &str, side: u32| Case {
        name: name.into(),
        prepared: &mapped,
        look: look(false),
        side,
    };
    let with_map = case("torus-map", 1024);
    let without = Case {
        name: "torus-constant".into(),
        prepared: &plain,
        look: look(true),
        side: 1024,
    };
    report("control", ROUNDS, control);
    for case in [&with_map, &without] {
        let mut picture = case.picture();
        report(&case.name, ROUNDS, || {
            case.draw(&mut picture, &Timings::off());
        });
    }
    let mut picture = with_map.picture();
    with_map.draw(&mut picture, &Timings::off());
    let pixels = covered(&mesh, picture.size());
    println!("case=covered pixels={pixels}");
    assert!(
        pixels.abs_diff(COVERED) <= COVERED / 1000,
        "{pixels} pixels see the torus, not {COVERED}"
    );
    if let Some(path) = std::env::var_os("ANISOMAP_BENCH_PICTURE") {
        let bytes: Vec<u8> = picture
            .pixels()
            .iter()
            .flatten()
            .flat_map(|c| c.to_le_bytes())
            .collect();
        std::fs::write(path, bytes).expect("a file that can be written");
    }
    report("tone", ROUNDS, || {
        std::hint::black_box(picture.to_srgb8());
    });
    for side in [512, 1024, 2048, 4096] {
        let case = case(&format!("torus-map-{side}"), side);
        let mut picture = case.picture();
        report(&case.name, 9, || case.draw(&mut picture, &Timings::off()));
    }
    let one = rayon::ThreadPoolBuilder::new().num_threads(1).build();
    one.expect("a thread").install(|| {
        with_map.stages();
        without.stages();
    });
}
