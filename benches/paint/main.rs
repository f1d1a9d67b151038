//! How soon a dab shows: 128x128 texels of a 4096x4096 map change, on a torus of 1024x1024 pixels under the studio lights.
//!
//! Run with `cargo bench --bench paint`. One line per case: `case=reshade-dab threads=2 samples=2 ms_min=… ms_median=… ms_p99=…`.
//! `map` is the change of the map and of its levels, `reshade` the picture after it, `dab` both; `light` lights the whole
//! picture anew and `everything` draws it anew. The picture is held against one drawn anew after all dabs, and after every one
//! of as many again that are not timed.
//!
//! `brush-r64` and `brush-r256` are one soft dab of four channels on a map, without the preview; `stroke-r64` is one more point
//! of a long live stroke. `strokes-100k` opens a layer of 100,000 strokes of radius 10 and length 80 texels at 2048x2048, once
//! from its text and once from the strokes, and fills the map.
//!
//! What somebody at the window waits for is in `studio.rs`: `dab-128`, `dab-1024`, `document`, `open-many` and what follows them.
//!
//! Words after `--` choose cases by the beginnings of their names.

#[path = "../common/mod.rs"]
mod common;
mod studio;

use anisomap::map::{AnisoMap, Rect, Size, Texel, Wrap};
use anisomap::math::Axis;
use anisomap::mesh;
use anisomap::paint::{Brush, Live, Painting, Point, SetAlpha, Stroke, Strokes, Tool};
use anisomap::pattern::Surface;
use anisomap::preview::{Frame, Look, Material, Prepared, Redrawn, Scene, Timings};
use anisomap::progress::Progress;
use anisomap::recipe::{Files, Layer, Recipe, RecipeFile, Source};
use common::{is_wanted, milliseconds};
use glam::Vec2;
use std::sync::Arc;

const MAP_SIDE: u32 = 4096;
const PICTURE_SIDE: u32 = 1024;
const DAB: u32 = 128;
const ROUNDS: u32 = 40;

/// Streaks along u, a new one each row.
fn brushed() -> AnisoMap {
    let size = Size::new(MAP_SIDE, MAP_SIDE).expect("a size");
    let mut planes = [const { Vec::new() }; 4];
    for y in 0..MAP_SIDE {
        let streak = (y.wrapping_mul(2_654_435_761) >> 20) as f32 / 4096.0;
        let axis = Axis::from_degrees(4.0 * streak - 2.0);
        let row = [0.06 + 0.06 * streak, 0.3, axis.cos2, axis.sin2];
        for (plane, value) in planes.iter_mut().zip(row) {
            plane.extend(std::iter::repeat_n(value, MAP_SIDE as usize));
        }
    }
    let map = AnisoMap::from_planes(size, Wrap::Repeat, planes);
    map.expect("four planes").0
}

/// Turns the texels of a square a little, so that every dab changes something.
fn dab(prepared: &mut Prepared<'_>, rect: Rect, round: u32) {
    prepared.change_map(rect, |map| {
        let mut region = map.region(rect);
        for i in 0..rect.texels() {
            let texel = Texel {
                alpha_x: 0.1,
                alpha_y: 0.4,
                axis: Axis::from_degrees(7.0 * round as f32),
            };
            region.view_mut().set(i, texel);
        }
        map.write_region(&region);
    });
}

fn report(name: &str, threads: usize, samples: u32, mut times: Vec<f64>) {
    if !is_wanted(name) || times.is_empty() {
        return;
    }
    times.sort_by(f64::total_cmp);
    let at = |q: f64| times[((times.len() - 1) as f64 * q).round() as usize];
    println!(
        "case={name} threads={threads} samples={samples} ms_min={:.3} ms_median={:.3} ms_p99={:.3}",
        at(0.0),
        at(0.5),
        at(0.99)
    );
}

fn run(threads: usize, samples: u32, map: &AnisoMap) {
    let mesh = mesh::torus();
    let (off, none) = (Timings::off(), Progress::none());
    let material = Material::default();
    let mut prepared =
        Prepared::new(&mesh, map.clone(), material, &off).expect("a mesh that fits together");
    let mut scene = Scene {
        samples,
        ..Scene::for_mesh(&mesh)
    };
    let size = Size::new(PICTURE_SIDE, PICTURE_SIDE).expect("a size");
    let look = Look::default();
    let mut frame = Frame::new(size);
    let mut anew = Frame::new(size);
    let draw = |frame: &mut Frame, prepared: &Prepared<'_>, scene: &Scene| {
        milliseconds(|| {
            frame
                .draw(prepared, scene, look, &off, &none)
                .expect("a picture")
        })
    };
    let [mut everything, mut light, mut maps, mut reshades, mut dabs] = [const { Vec::new() }; 5];
    draw(&mut frame, &prepared, &scene);
    // The parts of the map that each tile sees are worked out when it first changes.
    dab(
        &mut prepared,
        Rect {
            x: 0,
            y: 0,
            width: 1,
            height: 1,
        },
        0,
    );
    draw(&mut frame, &prepared, &scene);
    // In the part of the map that is seen, from the outer rim over the top.
    let rect = |round: u32| Rect {
        x: (256 * (round % 8) + 3072 * u32::from(round % 2 == 1)) % (MAP_SIDE - DAB),
        y: 1024 + 32 * round,
        width: DAB,
        height: DAB,
    };
    for round in 0..ROUNDS {
        let (map_time, ()) = milliseconds(|| dab(&mut prepared, rect(round), round));
        let (time, redrawn) = draw(&mut frame, &prepared, &scene);
        assert!(matches!(redrawn, Redrawn::Tiles(_)), "{redrawn:?}");
        maps.push(map_time);
        reshades.push(time);
        dabs.push(map_time + time);
    }
    // The same dabs once more, turned by other angles. A full redraw between two dabs that are timed would have the second
    // one find nothing of the first in the caches.
    for round in 0..=ROUNDS {
        anew.resize(Size::new(1, 1).expect("a size"));
        anew.resize(size);
        everything.push(draw(&mut anew, &prepared, &scene).0);
        assert!(frame.picture() == anew.picture(), "a dab is a full redraw");
        if round < ROUNDS {
            dab(&mut prepared, rect(round), round + ROUNDS);
            draw(&mut frame, &prepared, &scene);
        }
    }
    for round in 0..8 {
        scene.exposure = 0.1 * round as f32 + 0.05;
        let (time, redrawn) = draw(&mut frame, &prepared, &scene);
        assert_eq!(redrawn, Redrawn::Light);
        light.push(time);
    }
    report("map-dab", threads, samples, maps);
    report("reshade-dab", threads, samples, reshades);
    report("dab", threads, samples, dabs);
    report("light", threads, samples, light);
    report("everything", threads, samples, everything);
}

/// Texels of a map at work, with the coverage of a layer.
struct Canvas {
    map: AnisoMap,
    surface: Surface,
}

impl Canvas {
    fn new(map: AnisoMap) -> Self {
        let surface = Surface {
            size: map.size(),
            aspect: 1.0,
            wrap: map.wrap(),
            seed: 0,
        };
        Self { map, surface }
    }

    /// Milliseconds of the last of some points of a stroke, its texels included.
    fn last_point(&self, radius: u32, points: &[Point]) -> f64 {
        let brush = Brush {
            radius: radius as f32 / MAP_SIDE as f32,
            hardness: 0.0,
            tool: Tool::SetAlpha(SetAlpha {
                alpha_x: Some(0.05),
                alpha_y: Some(0.5),
            }),
            ..Brush::default()
        };
        let mut live = Live::new(Arc::new(brush), 1, &self.surface).expect("a brush");
        let (last, before) = points.split_last().expect("a point");
        for point in before {
            live.push(*point);
        }
        let whole = Rect {
            x: 1024,
            y: 1024,
            width: 1024,
            height: 1024,
        };
        let below = self.map.region(whole);
        let mut now = below.clone();
        let mut coverage = vec![0.0; whole.texels()];
        let (time, ()) = milliseconds(|| {
            for dirty in live.push(*last) {
                live.apply(&below, &below, dirty, (&mut now, &mut coverage));
            }
        });
        assert!(now != below, "a point that paints");
        time
    }
}

fn brushes(threads: usize, canvas: &Canvas) {
    let point = |x: f32, y: f32| {
        let uv = Vec2::new(x, MAP_SIDE as f32 - y) / MAP_SIDE as f32;
        Point::new(uv, 1.0).expect("numbers")
    };
    for radius in [64, 256] {
        // Wherever it lies over the tiles.
        let dab = |i: u16| {
            point(
                1536.0 + f32::from(7 * i % 64),
                1536.0 + f32::from(11 * i % 64),
            )
        };
        let times = (0..100).map(|i| canvas.last_point(radius, &[dab(i)]));
        let times = times.collect();
        report(&format!("brush-r{radius}"), threads, 1, times);
    }
    let long: Vec<Point> = (0..400)
        .map(|i| point(1536.0 - 0.5 * (399 - i) as f32, 1536.0))
        .collect();
    let times = (0..40).map(|_| canvas.last_point(64, &long)).collect();
    report("stroke-r64", threads, 1, times);
}

/// A layer of many short strokes all over the map.
fn many_strokes() -> Recipe {
    let brush = Arc::new(Brush {
        radius: 10.0 / 2048.0,
        ..Brush::default()
    });
    let number = |n: u32| (n.wrapping_mul(2_654_435_761) >> 8) as f32 / (1u32 << 24) as f32;
    let strokes = (0..100_000).map(|n| {
        let middle = Vec2::new(number(3 * n), number(3 * n + 1));
        let way = Vec2::from_angle(6.3 * number(3 * n + 2)) * (80.0 / 2048.0);
        let points =
            (0..20).filter_map(|i| Point::new(middle + way * (i as f32 / 19.0 - 0.5), 1.0));
        Arc::new(Stroke::new(Arc::clone(&brush), n, points).expect("points"))
    });
    let strokes = Strokes {
        strokes: strokes.collect(),
        mesh: None,
    };
    Recipe {
        size: Size::new(2048, 2048).expect("a size"),
        layers: vec![Layer::new(Source::Strokes(strokes))],
        ..Recipe::default()
    }
}

fn documents(threads: usize, recipe: &Recipe) {
    let text = RecipeFile::new(recipe.clone(), "many.toml")
        .expect("a recipe")
        .to_toml();
    let (open, file) =
        milliseconds(|| RecipeFile::parse(&text, "many.toml", None).expect("its text"));
    let prepare = || {
        file.recipe()
            .prepare(recipe.size, &Files::default(), &Progress::none())
    };
    let (prepared_in, prepared) = milliseconds(|| prepare().expect("strokes"));
    let (fill, map) = milliseconds(|| prepared.map(&Progress::none()).expect("a map"));
    assert!(map.alpha_x().iter().any(|a| *a < 0.1));
    report("strokes-100k-open", threads, 1, vec![open]);
    report("strokes-100k-prepare", threads, 1, vec![prepared_in]);
    report("strokes-100k-fill", threads, 1, vec![fill]);
    let Source::Strokes(strokes) = &recipe.layers[0].source else {
        return;
    };
    let surface = Surface {
        size: recipe.size,
        aspect: 1.0,
        wrap: recipe.wrap,
        seed: 0,
    };
    let mut painting = Painting::new(&surface, strokes, None, &Progress::none()).expect("strokes");
    let undo = (0..100).map(|_| {
        milliseconds(|| {
            let last = painting.pop().expect("a stroke");
            painting.push(&last).expect("room");
        })
        .0
    });
    report("strokes-100k-pop-push", threads, 1, undo.collect());
}

fn main() {
    // A brush's time is not to hold that of getting memory from the system anew for every dab: glibc keeps what was freed once
    // it has seen a block as large as this one come and go.
    drop(std::hint::black_box(Vec::<u8>::with_capacity(31 << 20)));
    studio::run();
    let map = brushed();
    let canvas = Canvas::new(map.clone());
    for threads in [1, 2] {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
        let pool = pool.expect("threads");
        if is_wanted("brush") || is_wanted("stroke-r64") {
            pool.install(|| brushes(threads, &canvas));
        }
        if is_wanted("strokes-100k") {
            pool.install(|| documents(threads, &many_strokes()));
        }
    }
    if !["map-dab", "reshade-dab", "dab", "light", "everything"]
        .into_iter()
        .any(is_wanted)
    {
        return;
    }
    for threads in [1, 2] {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
        let pool = pool.expect("threads");
        for samples in [1, 2] {
            pool.install(|| run(threads, samples, &map));
        }
    }
}
