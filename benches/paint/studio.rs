//! What somebody at the window waits for, without the window.
//!
//! - `dab-128`, `dab-1024`: from a point of the pen to new pixels, on a 4096x4096 map of a brushed layer, a layer of strokes and a
//!   scratched one above, with the torus at 1024x1024 beside it: the stroke grows, the map and its levels change, the picture is
//!   drawn where it shows the change, and becomes eight-bit. Texels are the diameter of the brush.
//! - `end-stroke`, `undo`, `redo`: of such a stroke.
//! - `document`: ten layers at 4096x4096, each half of them painted on: bytes that are held.
//! - `open-many`, `undo-many`, `redo-many`: a document of 100,000 strokes.

use super::common::{is_wanted, milliseconds};
use anisomap::map::Size;
use anisomap::paint::{Brush, Groove, Point, Stroke, Strokes, Tool};
use anisomap::recipe::{Layer, Recipe, RecipeFile, Source};
use anisomap::studio::{Options, Studio};
use glam::Vec2;
use std::sync::Arc;

const BASE: &str = "version = 1\nsize = 4096\n[[layers]]\nname = 'steel'\n[layers.brushed]\n\
    [[layers]]\nname = 'paint'\n[layers.strokes]\npacked = []\nbrushes = []\n\
    [[layers]]\nname = 'top'\nopacity = 0.3\n[layers.radial]\n";

fn report(name: &str, mut times: Vec<f64>) {
    times.sort_by(f64::total_cmp);
    let at = |q: f64| times[((times.len() - 1) as f64 * q).round() as usize];
    println!(
        "case={name} n={} ms_min={:.3} ms_median={:.3} ms_p99={:.3}",
        times.len(),
        at(0.0),
        at(0.5),
        at(0.99)
    );
}

fn open(text: &str) -> Studio {
    let file = RecipeFile::parse(text, "bench.toml", None).expect("a recipe");
    let mut studio = Studio::new(file, None, Options::default()).expect("a studio");
    studio.settle();
    assert!(studio.take_trouble().is_empty());
    studio.select(1);
    studio
        .viewport_mut()
        .resize(Size::new(1024, 1024).expect("a size"));
    studio.draw(false).expect("a picture");
    studio
}

fn groove(texels: f32) -> Arc<Brush> {
    Arc::new(Brush {
        tool: Tool::Groove(Groove::default()),
        radius: 0.5 * texels / 4096.0,
        ..Brush::default()
    })
}

/// Strokes of 25 points each, a quarter of the brush apart, over all the map; a first one prepares the layer and is not counted.
fn dabs(name: &str, texels: f32, points: usize) {
    if !is_wanted(name) {
        return;
    }
    let mut studio = open(BASE);
    let (mut times, mut ends, mut undos, mut redos) = (vec![], vec![], vec![], vec![]);
    let (mut maps, mut left) = (vec![], 0);
    let step = 0.25 * texels / 4096.0;
    for n in 0..=points.div_ceil(25) {
        let (sin, cos) = (n as f32 * 0.7).sin_cos();
        let middle = Vec2::new((n as f32 * 0.618).fract(), (n as f32 * 0.382).fract());
        studio
            .begin_stroke(groove(texels), n as u32)
            .expect("a layer of strokes");
        for i in 0..25 {
            let at = middle + Vec2::new(cos, sin) * (step * i as f32);
            let point = Point::new(at, 0.5 + 0.02 * i as f32).expect("finite");
            let (map, ()) = milliseconds(|| {
                studio.tick(); // as each frame of the window begins
                studio.stroke_to(point);
            });
            let (rest, waits) = milliseconds(|| {
                studio.draw(false).expect("a picture");
                studio.is_behind()
            });
            if n > 0 {
                times.push(map + rest);
                maps.push(map);
                left += u32::from(waits);
            }
            studio.settle();
        }
        ends.push(milliseconds(|| studio.end_stroke().expect("room")).0);
        if n % 4 == 1 {
            undos.push(milliseconds(|| studio.undo().expect("a step")).0);
            redos.push(milliseconds(|| studio.redo().expect("a step")).0);
        }
    }
    report(name, times);
    report(&format!("{name}-map-alone"), maps);
    println!("case={name}-not-all-at-once n={left}");
    report(&format!("{name}-end-stroke"), ends);
    report(&format!("{name}-undo"), undos);
    report(&format!("{name}-redo"), redos);
}

/// Ten layers, half of them of strokes.
fn document() {
    if !is_wanted("document") {
        return;
    }
    let mut text = "version = 1\nsize = 4096\n".to_owned();
    for i in 0..5 {
        text += &format!(
            "[[layers]]\nname = 'a{i}'\nopacity = 0.5\n[layers.brushed]\n[[layers]]\nname = 'b{i}'\n[layers.strokes]\npacked = []\nbrushes = []\n"
        );
    }
    let mut studio = open(&text);
    for layer in [1, 3, 5, 7, 9] {
        studio.select(layer);
        for n in 0..20 {
            studio
                .begin_stroke(groove(128.0), n)
                .expect("a layer of strokes");
            for i in 0..30 {
                let at = Vec2::new(0.03 * i as f32, 0.05 * n as f32 + 0.01 * layer as f32);
                studio.stroke_to(Point::new(at, 1.0).expect("finite"));
            }
            studio.end_stroke().expect("room");
        }
    }
    let held = studio.bytes() as f64 / f64::from(1 << 20);
    println!(
        "case=document layers=10 held_mib={held:.0} peak_resident_mib={:.0}",
        peak()
    );
}

/// Peak resident memory in MiB, where the system tells it.
fn peak() -> f64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let line = status.lines().find_map(|l| l.strip_prefix("VmHWM:"));
    let kib = line.and_then(|l| l.trim().trim_end_matches("kB").trim().parse::<f64>().ok());
    kib.unwrap_or(f64::NAN) / 1024.0
}

fn many() {
    if !is_wanted("open-many") {
        return;
    }
    let brush = groove(16.0);
    let random = |n: u32| (n.wrapping_mul(2_654_435_761) >> 8) as f32 / (1 << 24) as f32;
    let strokes = (0..100_000u32).map(|n| {
        let at = Vec2::new(random(2 * n), random(2 * n + 1));
        let (sin, cos) = (random(n ^ 0x5555) * 6.3).sin_cos();
        let points = (0..8).map(|i| at + Vec2::new(cos, sin) * (0.0025 * i as f32));
        let points = points.map(|p| Point::new(p, 1.0).expect("finite"));
        Arc::new(Stroke::new(brush.clone(), n, points).expect("a stroke"))
    });
    let mut layer = Layer::new(Source::Strokes(Strokes {
        strokes: strokes.collect(),
        mesh: None,
    }));
    layer.name = "paint".to_owned();
    let base = RecipeFile::parse(BASE, "bench.toml", None).expect("a recipe");
    let mut recipe: Recipe = base.recipe().clone();
    recipe.layers[1] = layer;
    let text = RecipeFile::new(recipe, "many.toml")
        .expect("it checks")
        .to_toml();
    println!(
        "case=many-file mib={:.1}",
        text.len() as f64 / f64::from(1 << 20)
    );
    let (time, mut studio) = milliseconds(|| open(&text));
    report("open-many", vec![time]);
    let (mut undos, mut redos) = (vec![], vec![]);
    for n in 0..40 {
        studio
            .begin_stroke(groove(64.0), n)
            .expect("a layer of strokes");
        for i in 0..20 {
            let at = Vec2::splat(0.1 + 0.01 * i as f32 + 0.01 * n as f32);
            studio.stroke_to(Point::new(at, 1.0).expect("finite"));
        }
        studio.end_stroke().expect("room");
    }
    for _ in 0..20 {
        undos.push(milliseconds(|| studio.undo().expect("a step")).0);
    }
    for _ in 0..20 {
        redos.push(milliseconds(|| studio.redo().expect("a step")).0);
    }
    report("undo-many", undos);
    report("redo-many", redos);
}

pub(super) fn run() {
    document(); // first, as its peak is that of the process
    dabs("dab-128", 128.0, 1000);
    dabs("dab-1024", 1024.0, 250);
    many();
}
