//! Times writing and reading: `cargo bench --bench export [-- CASE]` prints `case=... ms_min=... ms_median=... bytes=...`.

use anisomap::convention::MapInfo;
use anisomap::export::exr::{Precision, write_master, write_rgb_pair};
use anisomap::export::gltf::{GltfOptions, write_glb};
use anisomap::export::png::{Depth, write_set};
use anisomap::export::{Export, Written};
use anisomap::filter::{Line, comb, reduce};
use anisomap::import::exr::read_master;
use anisomap::map::{AnisoMap, DEFAULT_TEXEL, Size, Texel, Wrap};
use anisomap::math::Axis;
use anisomap::mesh::builtin;
use anisomap::recipe::Material;
use std::path::Path;
use std::time::Instant;

/// Brushed metal: streaks 64 texels long whose width and direction change from row to row.
fn brushed(side: u32) -> AnisoMap {
    let hash = |x: u32, y: u32| {
        let h =
            (x.wrapping_mul(0x9e37_79b1) ^ y.wrapping_mul(0x85eb_ca77)).wrapping_mul(0xc2b2_ae3d);
        ((h ^ (h >> 15)) & 0xffff) as f32 / 65536.0
    };
    fill(side, |x, y| {
        let (cell, t) = (x / 64, (x % 64) as f32 / 64.0);
        let streak = hash(cell, y) * (1.0 - t) + hash(cell + 1, y) * t;
        Texel {
            alpha_x: 0.05 + 0.03 * streak,
            alpha_y: 0.3 + 0.1 * hash(y, cell),
            axis: Axis::from_degrees(4.0 * (streak - 0.5)),
        }
    })
}

fn disc(side: u32) -> AnisoMap {
    fill(side, |x, y| Texel {
        alpha_x: 0.08,
        alpha_y: 0.3,
        axis: Axis::from_radians(
            (0.5 * side as f32 - y as f32).atan2(x as f32 - 0.5 * side as f32) + 1.57,
        ),
    })
}

/// Crossing threads of 8 texels.
fn weave(side: u32) -> AnisoMap {
    fill(side, |x, y| Texel {
        alpha_x: 0.1,
        alpha_y: 0.3,
        axis: Axis::from_degrees(90.0 * ((x / 8 + y / 8) % 2) as f32 + (x % 7) as f32 - 3.0),
    })
}

fn fill(side: u32, texel: impl Fn(u32, u32) -> Texel) -> AnisoMap {
    let mut map = AnisoMap::constant(
        Size::new(side, side).expect("a size"),
        Wrap::Repeat,
        DEFAULT_TEXEL,
    );
    let mut region = map.region_mut();
    for i in 0..side * side {
        region.set(i as usize, texel(i % side, i / side));
    }
    map
}

fn time(case: &str, rounds: usize, mut work: impl FnMut() -> u64) {
    let wanted = std::env::args().skip(1).find(|a| !a.starts_with('-'));
    if wanted.is_some_and(|w| !case.contains(&w)) {
        return;
    }
    let mut bytes = 0;
    let mut ms: Vec<f64> = (0..rounds)
        .map(|_| {
            let start = Instant::now();
            bytes = work();
            start.elapsed().as_secs_f64() * 1e3
        })
        .collect();
    ms.sort_by(f64::total_cmp);
    println!(
        "case={case} ms_min={:.1} ms_median={:.1} bytes={bytes}",
        ms[0],
        ms[rounds / 2]
    );
}

fn sum(written: &[Written]) -> u64 {
    written.iter().map(|w| w.bytes).sum()
}

fn formats(name: &str, map: &AnisoMap, folder: &Path, rounds: usize) {
    let info = MapInfo::default();
    let stem = folder.join(name);
    let master = folder.join(format!("{name}.exr"));
    time(&format!("comb_{name}"), rounds, || {
        std::hint::black_box(comb(map, Line::X));
        0
    });
    time(&format!("exr_half_{name}"), rounds, || {
        let export = Export::new(map, &info);
        sum(&[write_master(&master, &export, Precision::Half).expect("written")])
    });
    time(&format!("exr_read_{name}"), rounds, || {
        read_master(&master).expect("read").map.size().texels() as u64
    });
    time(&format!("exr_pair_{name}"), rounds, || {
        let export = Export::new(map, &info);
        sum(&write_rgb_pair(&stem, &export, Precision::Half).expect("written"))
    });
    for (bits, depth) in [(8, Depth::Eight), (16, Depth::Sixteen)] {
        time(&format!("png{bits}_{name}"), rounds, || {
            let export = Export::new(map, &info);
            sum(&write_set(&stem, &export, depth).expect("written"))
        });
    }
    let mesh = builtin("plane").expect("a built-in shape");
    let glb = folder.join(format!("{name}.glb"));
    time(&format!("glb_{name}"), rounds, || {
        let export = Export::new(map, &info);
        let options = GltfOptions::default();
        let (written, report) =
            write_glb(&glb, &export, &mesh, &Material::default(), options).expect("written");
        assert!(report.alpha_error < 0.02 && report.angle_error < 0.35);
        written.bytes
    });
    time(&format!("exr_float_{name}"), rounds, || {
        let export = Export::new(map, &info);
        sum(&[write_master(&master, &export, Precision::Float).expect("written")])
    });
}

fn main() {
    let folder = tempfile::tempdir().expect("a folder for results");
    let small = brushed(1024);
    formats("brushed_1024", &small, folder.path(), 9);
    let large = brushed(4096);
    formats("brushed_4096", &large, folder.path(), 3);
    time("reduce_4096_512", 3, || {
        let size = Size::new(512, 512).expect("a size");
        reduce(&large, size).expect("smaller").size().texels() as u64
    });
    drop(large);
    for (name, map) in [("disc_4096", disc(4096)), ("weave_4096", weave(4096))] {
        time(&format!("comb_{name}"), 3, || {
            std::hint::black_box(comb(&map, Line::X));
            0
        });
    }
    let noise = fill(4096, |x, y| Texel {
        alpha_x: 0.1,
        alpha_y: 0.3,
        axis: Axis::from_degrees(
            ((x.wrapping_mul(0x9e37_79b1) ^ y.wrapping_mul(0x85eb_ca77)) >> 13) as f32,
        ),
    });
    time("comb_noise_4096", 1, || {
        std::hint::black_box(comb(&noise, Line::X));
        0
    });
}
