//! How soon a line field follows its guides. One line per case:
//! `case=solve-mixed grid=1024 threads=2 cycles=… settled=… ms_min=… ms_median=…`.
//!
//! Run with `cargo bench --bench guide`. `solve` is a whole solve from nothing on a grid; `drag` what a window does when a
//! guide has moved by a texel and a map of 1024x1024 shows it anew: a draft solved from the last one, and the map filled.
//! `drag-full` solves the full grid instead, from the last field, and `fill` fills a map from a solved field.

use anisomap::guide::{Detail, Guide, Guides, LineField, Mode, Shape, Solver};
use anisomap::map::{AnisoMap, DEFAULT_TEXEL, Size, Wrap};
use anisomap::pattern::{Fill, Patch, Surface};
use anisomap::progress::Progress;
use rayon::prelude::*;
use std::time::Instant;

fn at(u: f32, v: f32, shape: Shape) -> Guide {
    Guide {
        center: Some([u, v]),
        ..Guide::new(shape)
    }
}

/// A guide of every shape, a line and a curve of either kind.
fn mixed(grid: u32) -> Guides {
    let circle = at(0.3, 0.3, Shape::Ellipse { radii: [0.15; 2] });
    let spiral = at(
        0.75,
        0.25,
        Shape::Spiral {
            radius: 0.12,
            pitch: 0.05,
        },
    );
    let frame = Guide {
        rotation: 20.0,
        ..at(
            0.72,
            0.7,
            Shape::Rectangle {
                size: [0.3, 0.2],
                corner: 0.03,
            },
        )
    };
    let curve = Guide {
        strength: 0.8,
        ..Guide::new(Shape::Curve {
            points: vec![
                [0.05, 0.55],
                [0.2, 0.9],
                [0.3, 0.5],
                [0.45, 0.9],
                [0.5, 1.0],
                [0.6, 0.9],
                [0.9, 0.95],
            ],
            closed: false,
        })
    };
    let line = Guide {
        mode: Mode::Radial,
        ..Guide::new(Shape::Line {
            points: vec![[0.5, 0.05], [0.55, 0.5], [0.4, 0.6]],
            closed: false,
        })
    };
    let leaf = Guide {
        rotation: 30.0,
        ..at(
            0.2,
            0.75,
            Shape::Curve {
                points: vec![
                    [0.15, 0.0],
                    [0.1, 0.1],
                    [-0.1, 0.1],
                    [-0.15, 0.0],
                    [-0.1, -0.1],
                    [0.1, -0.1],
                ],
                closed: true,
            },
        )
    };
    Guides {
        grid,
        guide: vec![circle, spiral, frame, curve, line, leaf],
        ..Guides::default()
    }
}

/// One circle that holds alone, far from everything: the longest ways for the field to go.
fn circle(grid: u32) -> Guides {
    Guides {
        grid,
        guide: vec![at(0.5, 0.5, Shape::Ellipse { radii: [0.3; 2] })],
        ..Guides::default()
    }
}

fn surface(side: u32, wrap: Wrap) -> Surface {
    Surface {
        size: Size::new(side, side).expect("a size"),
        aspect: 1.0,
        wrap,
        seed: 0,
    }
}

fn fill(field: &LineField, map: &mut AnisoMap) {
    let n = 16 * map.width() as usize;
    map.bands_mut(16).into_par_iter().for_each_init(
        || (vec![0.0; n], vec![0.0; n]),
        |(coverage, value), region| {
            let texels = region.rect.texels();
            field.fill(&mut Patch {
                region,
                coverage: &mut coverage[..texels],
                value: &mut value[..texels],
            });
        },
    );
}

fn report(case: &str, side: u32, runs: u32, mut work: impl FnMut(u32) -> Option<LineField>) {
    let mut last = None;
    let mut times: Vec<f64> = (0..runs)
        .map(|i| {
            let start = Instant::now();
            let field = work(i);
            let time = start.elapsed().as_secs_f64() * 1e3;
            last = field.or(last.take());
            time
        })
        .collect();
    times.sort_by(f64::total_cmp);
    let solved = last.map(|f| f.solved());
    println!(
        "case={case} grid={side} threads={} cycles={} settled={} ms_min={:.1} ms_median={:.1}",
        rayon::current_num_threads(),
        solved.map_or(0, |s| s.cycles),
        solved.is_none_or(|s| s.settled),
        times[0],
        times[times.len() / 2]
    );
}

fn main() {
    let silent = Progress::none();
    for grid in [512, 1024, 2048, 4096] {
        let runs = if grid > 2048 { 2 } else { 5 };
        for (name, guides, wrap) in [
            ("solve-mixed", mixed(grid), Wrap::Repeat),
            ("solve-circle", circle(grid), Wrap::Clamp),
        ] {
            let surface = surface(grid, wrap);
            report(name, grid, runs, |_| {
                Some(guides.prepare(&surface, &silent).expect("allowed"))
            });
        }
    }
    let surface = surface(1024, Wrap::Repeat);
    let mut map = AnisoMap::constant(surface.size, surface.wrap, DEFAULT_TEXEL);
    for (name, detail) in [("drag", Detail::Draft), ("drag-full", Detail::Full)] {
        let mut guides = mixed(1024);
        let mut solver = Solver::default();
        let mut solve = |guides: &Guides| {
            let field = guides.prepare_with(&surface, detail, &mut solver, &silent);
            field.expect("allowed")
        };
        solve(&guides);
        report(name, 1024, 40, |i| {
            guides.guide[0].center = Some([0.3 + (i + 1) as f32 / 1024.0, 0.3]);
            let field = solve(&guides);
            fill(&field, &mut map);
            Some(field)
        });
    }
    for side in [1024, 4096] {
        let size = Size::new(side, side).expect("a size");
        let sized = Surface { size, ..surface };
        let field = mixed(1024).prepare(&sized, &silent).expect("allowed");
        let mut map = AnisoMap::constant(size, sized.wrap, DEFAULT_TEXEL);
        report("fill", side, 5, |_| {
            fill(&field, &mut map);
            None
        });
    }
}
