//! What the field between guides is held to.

use super::hold::{Hold, Row};
use super::*;
use crate::map::{AnisoMap, DEFAULT_TEXEL, Singularity, Size, Wrap, singularities};
use crate::math::Axis;
use crate::pattern::{Fill, Patch, Surface};
use crate::progress::Progress;
use glam::Vec2;
use proptest::prelude::*;

fn surface(width: u32, height: u32, wrap: Wrap) -> Surface {
    Surface {
        size: Size::new(width, height).unwrap(),
        aspect: width as f32 / height as f32,
        wrap,
        seed: 0,
    }
}

fn at(u: f32, v: f32, shape: Shape) -> Guide {
    Guide {
        center: Some([u, v]),
        ..Guide::new(shape)
    }
}

fn circle(u: f32, v: f32, radius: f32) -> Guide {
    at(u, v, Shape::Ellipse { radii: [radius; 2] })
}

fn line(points: &[[f32; 2]]) -> Guide {
    let points = points.to_vec();
    Guide::new(Shape::Line {
        points,
        closed: false,
    })
}

fn guides(grid: u32, guide: Vec<Guide>) -> Guides {
    Guides {
        grid,
        guide,
        ..Guides::default()
    }
}

fn solve(guides: &Guides, surface: &Surface) -> LineField {
    guides.prepare(surface, &Progress::none()).unwrap()
}

/// The field as a map, filled in pieces of `side` texels, and its coverage.
fn filled_in(field: &LineField, surface: &Surface, side: u32) -> (AnisoMap, Vec<f32>) {
    let mut map = AnisoMap::constant(surface.size, surface.wrap, DEFAULT_TEXEL);
    let whole = surface.size.rect();
    let mut coverage = vec![f32::NAN; whole.texels()];
    for rect in whole.tiles(side) {
        let mut region = map.region(rect);
        let (mut c, mut v) = (vec![f32::NAN; rect.texels()], vec![f32::NAN; rect.texels()]);
        field.fill(&mut Patch {
            region: region.view_mut(),
            coverage: &mut c,
            value: &mut v,
        });
        map.write_region(&region);
        for i in 0..rect.texels() {
            let (x, y) = (i as u32 % rect.width, i as u32 / rect.width);
            coverage[whole.index(rect.x + x, rect.y + y)] = c[i];
        }
    }
    (map, coverage)
}

fn filled(field: &LineField, surface: &Surface) -> AnisoMap {
    filled_in(field, surface, 1 << 15).0
}

fn draw(guides: &Guides, surface: &Surface) -> AnisoMap {
    filled(&solve(guides, surface), surface)
}

fn points(map: &AnisoMap) -> Vec<Singularity> {
    singularities(map.size(), map.wrap(), map.cos2(), map.sin2()).expect("a smooth field")
}

/// A guide of every shape and mode, none of them straight or in the middle.
fn mixed() -> Vec<Guide> {
    let frame = Guide {
        rotation: 20.0,
        ..at(
            0.72,
            0.68,
            Shape::Rectangle {
                size: [0.3, 0.2],
                corner: 0.03,
            },
        )
    };
    let spiral = Shape::Spiral {
        radius: 0.12,
        pitch: 0.06,
    };
    let curve = vec![[-0.4, 0.1], [-0.1, 0.3], [0.0, -0.2], [0.3, 0.2]];
    let blob = vec![
        [0.1, 0.0],
        [0.1, 0.1],
        [-0.1, 0.1],
        [-0.1, 0.0],
        [-0.1, -0.1],
        [0.1, -0.1],
    ];
    vec![
        Guide {
            angle: 10.0,
            ..circle(0.3, 0.3, 0.15)
        },
        at(0.78, 0.22, spiral),
        frame,
        Guide {
            strength: 0.7,
            rotation: -15.0,
            ..at(
                0.45,
                0.6,
                Shape::Curve {
                    points: curve,
                    closed: false,
                },
            )
        },
        Guide {
            mode: Mode::Radial,
            falloff: 0.02,
            ..at(
                0.2,
                0.8,
                Shape::Curve {
                    points: blob,
                    closed: true,
                },
            )
        },
        Guide {
            mode: Mode::Constant,
            angle: 30.0,
            rotation: 10.0,
            ..at(0.55, 0.4, Shape::Ellipse { radii: [0.1, 0.05] })
        },
        Guide {
            mode: Mode::Smooth,
            ..circle(0.3, 0.3, 0.05)
        },
        Guide {
            scale: 1.5,
            ..line(&[[0.6, 0.05], [0.55, 0.1], [0.6, 0.15]])
        },
    ]
}

/// The largest error inside a concentric circle in degrees, farther than a texel from its centre, and the singular points
/// that lie inside.
fn inside_circle(map: &AnisoMap, surface: &Surface, guide: &Guide) -> (f32, Vec<Singularity>) {
    let Shape::Ellipse { radii } = guide.shape else {
        panic!("a circle");
    };
    let centre = Vec2::from(guide.center()) * surface.extent();
    let texel = surface.texel().max_element();
    let mut worst = 0.0f32;
    for y in 0..map.height() {
        for x in 0..map.width() {
            let r = surface.position(x, y) - centre;
            if r.length() > texel && r.length() < radii[0] {
                let want = Axis::from_vector(r.perp()).unwrap();
                worst = worst.max(map.texel(x, y).axis.angle_to(want).to_degrees());
            }
        }
    }
    let inside =
        |p: &Singularity| (Vec2::new(p.u, p.v) * surface.extent() - centre).length() < radii[0];
    (worst, points(map).into_iter().filter(inside).collect())
}

#[test]
fn inside_a_circle_the_field_is_the_tangent_with_one_point_of_index_one() {
    for (width, height, grid) in [
        (512, 512, 512),
        (301, 301, 512),
        (257, 391, 128),
        (600, 400, 301),
        (900, 700, 1024),
    ] {
        let surface = surface(width, height, Wrap::Clamp);
        for (u, v) in [
            (0.5, 0.5),
            (0.5 + 0.5 / width as f32, 0.5),
            (0.41, 0.47),
            (0.503, 0.4987),
        ] {
            let circle = circle(u, v, 0.3);
            let all = guides(grid, vec![line(&[[0.0, 0.0], [1.0, 0.05]]), circle.clone()]);
            let map = draw(&all, &surface);
            let (worst, inside) = inside_circle(&map, &surface, &circle);
            println!("{width}x{height}, grid {grid}: {worst} degrees");
            assert!(worst < 0.1, "{width}x{height} at {u}: {worst} degrees");
            assert_eq!(inside.len(), 1, "{inside:?}");
            assert_eq!(inside[0].twice_index, 2, "{inside:?}");
        }
    }
}

#[test]
fn a_weaker_circle_keeps_its_point_and_nearly_its_tangents() {
    let surface = surface(300, 300, Wrap::Clamp);
    let circle = Guide {
        strength: 0.9,
        ..circle(0.45, 0.52, 0.3)
    };
    let map = draw(&guides(256, vec![circle.clone()]), &surface);
    let (worst, inside) = inside_circle(&map, &surface, &circle);
    assert!(worst < 3.0, "{worst}");
    assert_eq!(inside.iter().map(|p| p.twice_index).sum::<i32>(), 2);
}

#[test]
fn where_the_map_repeats_all_indices_add_up_to_nothing() {
    for (width, height) in [(256, 256), (201, 301)] {
        let surface = surface(width, height, Wrap::Repeat);
        let lists = [
            vec![circle(0.5, 0.5, 0.2)],
            vec![circle(0.9, 0.1, 0.2), circle(0.4, 0.5, 0.15)],
            mixed(),
        ];
        for list in lists {
            let field = solve(&guides(256, list), &surface);
            let points = points(&filled(&field, &surface));
            let sum: i32 = points.iter().map(|p| p.twice_index).sum();
            assert!(!points.is_empty() && sum == 0, "{points:?}");
            let own = field.singularities().unwrap();
            assert_eq!(own.iter().map(|p| p.twice_index).sum::<i32>(), 0);
        }
    }
}

/// How far apart two maps are inside a circle of the first, the second read `shift` texels to the right: mean and worst.
fn apart(a: &AnisoMap, b: &AnisoMap, shift: u32, inside: impl Fn(u32, u32) -> bool) -> (f32, f32) {
    let (mut sum, mut worst, mut n) = (0.0, 0.0f32, 0.0);
    for y in 0..a.height() {
        for x in (0..a.width() - shift).filter(|&x| inside(x, y)) {
            let angle = a.texel(x, y).axis.angle_to(b.texel(x + shift, y).axis);
            sum += angle.to_degrees();
            worst = worst.max(angle.to_degrees());
            n += 1.0;
        }
    }
    (sum / n, worst)
}

#[test]
fn moving_a_guide_moves_the_field_inside_it_and_hardly_changes_it() {
    let surface = surface(500, 500, Wrap::Clamp);
    let blob = Shape::Curve {
        points: vec![
            [0.2, 0.0],
            [0.2, 0.15],
            [-0.1, 0.2],
            [-0.2, 0.0],
            [-0.15, -0.15],
            [0.1, -0.2],
        ],
        closed: true,
    };
    let frame = Shape::Rectangle {
        size: [0.4, 0.3],
        corner: 0.0,
    };
    for (shape, strength) in [
        (Shape::Ellipse { radii: [0.2; 2] }, 1.0),
        (Shape::Ellipse { radii: [0.2; 2] }, 0.6),
        (frame, 1.0),
        (blob, 1.0),
    ] {
        let draw_at = |u: f32| {
            let guide = Guide {
                strength,
                ..at(u, 0.5, shape.clone())
            };
            let other = line(&[[0.1, 0.1], [0.9, 0.15]]);
            draw(&guides(512, vec![other, guide]), &surface)
        };
        let inside = |x: u32, y: u32| {
            let guide = at(0.4, 0.5, shape.clone());
            let p = surface.position(x, y) / surface.extent();
            guide.contains(p, surface.aspect)
        };
        let (mean, _) = apart(&draw_at(0.4), &draw_at(0.42), 10, inside);
        println!("{} at {strength}: {mean} degrees", shape.name());
        assert!(mean < 1.0, "{} at {strength}: {mean} degrees", shape.name());
    }
}

#[test]
fn a_guide_moved_by_less_than_a_cell_moves_nothing_by_much() {
    // Away from singular points, which are the only places where a field may turn fast.
    let surface = surface(128, 128, Wrap::Repeat);
    let draw_at = |step: u32| {
        let mut list = mixed();
        list[0].center = Some([0.3 + step as f32 * 1e-3, 0.3]);
        draw(&guides(128, list), &surface)
    };
    let mut before = draw_at(0);
    for step in 1..12 {
        let after = draw_at(step);
        let points = [points(&before), points(&after)].concat();
        let far = |x: u32, y: u32| {
            let p = surface.position(x, y);
            points.iter().all(|s| {
                let d = (p - Vec2::new(s.u, s.v)).abs();
                d.min(Vec2::ONE - d).length() > 0.06
            })
        };
        let (mean, worst) = apart(&before, &after, 0, far);
        assert!(mean < 0.2 && worst < 4.0, "step {step}: {mean}, {worst}");
        before = after;
    }
}

/// The guide seen in a mirror that swaps left and right.
fn mirrored(guide: &Guide) -> Guide {
    let [u, v] = guide.center();
    let flip = |points: &[[f32; 2]]| points.iter().map(|[u, v]| [-u, *v]).collect::<Vec<_>>();
    let shape = match &guide.shape {
        Shape::Line { points, closed } => Shape::Line {
            points: flip(points),
            closed: *closed,
        },
        Shape::Curve { points, closed } => Shape::Curve {
            points: flip(points),
            closed: *closed,
        },
        Shape::Spiral { radius, pitch } => Shape::Spiral {
            radius: *radius,
            pitch: -pitch,
        },
        other => other.clone(),
    };
    Guide {
        shape,
        angle: -guide.angle,
        rotation: -guide.rotation,
        center: Some([1.0 - u, v]),
        ..guide.clone()
    }
}

/// The guide turned by a quarter, counter-clockwise, with the surface, whose old width becomes the unit.
fn turned(guide: &Guide, aspect: f32) -> Guide {
    let [u, v] = guide.center();
    let points = |points: &[[f32; 2]]| {
        let point = |[u, v]: &[f32; 2]| [u * aspect, v / aspect];
        points.iter().map(point).collect::<Vec<_>>()
    };
    let shape = match &guide.shape {
        Shape::Line { points: p, closed } => Shape::Line {
            points: points(p),
            closed: *closed,
        },
        Shape::Curve { points: p, closed } => Shape::Curve {
            points: points(p),
            closed: *closed,
        },
        Shape::Spiral { radius, pitch } => Shape::Spiral {
            radius: radius / aspect,
            pitch: pitch / aspect,
        },
        Shape::Ellipse { radii } => Shape::Ellipse {
            radii: radii.map(|r| r / aspect),
        },
        Shape::Rectangle { size, corner } => Shape::Rectangle {
            size: size.map(|r| r / aspect),
            corner: corner / aspect,
        },
    };
    Guide {
        shape,
        rotation: guide.rotation + 90.0,
        falloff: guide.falloff / aspect,
        center: Some([1.0 - v, u]),
        ..guide.clone()
    }
}

#[test]
fn mirrored_and_quarter_turned_guides_give_the_mirrored_and_turned_field() {
    for (width, height, grid) in [
        (128, 128, 128),
        (101, 101, 75),
        (151, 97, 200),
        (96, 160, 333),
    ] {
        for wrap in [Wrap::Repeat, Wrap::Clamp] {
            let upright = surface(width, height, wrap);
            let map = draw(&guides(grid, mixed()), &upright);
            let list = mixed().iter().map(mirrored).collect();
            let mirror = draw(&guides(grid, list), &upright);
            let lying = surface(height, width, wrap);
            let list = mixed().iter().map(|g| turned(g, upright.aspect)).collect();
            let turn = draw(&guides(grid, list), &lying);
            let mut worst = [0.0f32; 2];
            for y in 0..height {
                for x in 0..width {
                    let axis = map.texel(x, y).axis;
                    let other = mirror.texel(width - 1 - x, y).axis;
                    let back = Axis {
                        sin2: -other.sin2,
                        ..other
                    };
                    worst[0] = worst[0].max(axis.angle_to(back).to_degrees());
                    let other = turn.texel(y, width - 1 - x).axis.perpendicular();
                    worst[1] = worst[1].max(axis.angle_to(other).to_degrees());
                }
            }
            println!("{width}x{height} {wrap:?}: {worst:?} degrees");
            assert!(
                worst.iter().all(|w| *w < 0.05),
                "{width}x{height}: {worst:?}"
            );
        }
    }
}

#[test]
fn the_field_is_that_of_a_tighter_solve_to_its_tolerance() {
    for wrap in [Wrap::Repeat, Wrap::RepeatU, Wrap::Clamp] {
        let surface = surface(200, 140, wrap);
        let loose = solve(&guides(256, mixed()), &surface);
        let tight = Guides {
            tolerance: 1e-4,
            ..guides(256, mixed())
        };
        let tight = solve(&tight, &surface);
        assert!(loose.solved().settled, "{:?}", loose.solved());
        assert!(tight.solved().cycles > loose.solved().cycles);
        let (a, b) = (filled(&loose, &surface), filled(&tight, &surface));
        let (mean, _) = apart(&a, &b, 0, |_, _| true);
        assert!(mean < 0.01, "{wrap:?}: {mean}");
    }
}

#[test]
fn a_draft_is_near_the_whole_and_a_warm_solve_is_the_cold_one() {
    let surface = surface(256, 256, Wrap::Repeat);
    let mut all = guides(256, mixed());
    let mut solver = Solver::default();
    let mut draft = Solver::default();
    let run = |all: &Guides, detail, solver: &mut Solver| {
        let field = all.prepare_with(&surface, detail, solver, &Progress::none());
        filled(&field.unwrap(), &surface)
    };
    for step in 0..4 {
        all.guide[1].center = Some([0.6 + 0.02 * step as f32, 0.25]);
        let cold = draw(&all, &surface);
        let warm = run(&all, Detail::Full, &mut solver);
        let (mean, _) = apart(&cold, &warm, 0, |_, _| true);
        assert!(mean < 0.01, "warm: {mean}");
        let draft = run(&all, Detail::Draft, &mut draft);
        let (mean, _) = apart(&cold, &draft, 0, |_, _| true);
        assert!(mean < 2.0, "draft: {mean}");
    }
}

#[test]
fn pieces_are_the_whole_and_threads_change_nothing() {
    let surface = surface(150, 130, Wrap::Repeat);
    let all = guides(300, mixed());
    let field = solve(&all, &surface);
    let whole = filled_in(&field, &surface, 1 << 15);
    assert!(whole.1.iter().all(|c| *c == 1.0));
    for side in [64, 37] {
        assert!(filled_in(&field, &surface, side) == whole, "{side}");
    }
    for threads in [1, 3] {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
        let again = pool.unwrap().install(|| draw(&all, &surface));
        assert!(again == whole.0, "{threads} threads");
    }
}

/// The axis at (u, v).
fn axis_at(map: &AnisoMap, u: f32, v: f32) -> f32 {
    map.sample(u, v).axis.degrees()
}

fn near(a: f32, b: f32, within: f32) -> bool {
    let d = (a - b).rem_euclid(180.0);
    d.min(180.0 - d) < within
}

#[test]
fn modes_lead_as_they_say() {
    let surface = surface(256, 256, Wrap::Clamp);
    let one = |guide: Guide| draw(&guides(256, vec![guide]), &surface);
    let ellipse = at(0.5, 0.5, Shape::Ellipse { radii: [0.3, 0.2] });
    let with = |mode, angle: f32, rotation: f32| Guide {
        mode,
        angle,
        rotation,
        ..ellipse.clone()
    };
    let map = one(with(Mode::Concentric, 0.0, 0.0));
    assert!(near(axis_at(&map, 0.7, 0.5), 90.0, 0.5));
    assert!(near(axis_at(&map, 0.5, 0.6), 0.0, 0.5));
    let map = one(with(Mode::Radial, 0.0, 0.0));
    assert!(near(axis_at(&map, 0.7, 0.5), 0.0, 0.5));
    let map = one(with(Mode::Concentric, 20.0, 0.0));
    assert!(near(axis_at(&map, 0.7, 0.5), 110.0, 0.5));
    let map = one(with(Mode::Constant, 20.0, 15.0));
    for (u, v) in [(0.5, 0.5), (0.7, 0.5), (0.05, 0.9)] {
        // Nobody else leads: it is so everywhere.
        assert!(near(axis_at(&map, u, v), 35.0, 0.1));
    }
    // A spiral of pitch 2 pi r / 10 at r = 0.2 leans by atan(1/10) from the tangent, clockwise.
    let map = one(at(
        0.5,
        0.5,
        Shape::Spiral {
            radius: 0.3,
            pitch: 0.04 * std::f32::consts::PI,
        },
    ));
    let lean = 0.1f32.atan().to_degrees();
    assert!(near(axis_at(&map, 0.7, 0.5), 90.0 - lean, 0.5));
    let map = one(at(
        0.5,
        0.5,
        Shape::Rectangle {
            size: [0.6, 0.3],
            corner: 0.0,
        },
    ));
    for (u, v, want) in [
        (0.5, 0.63, 0.0),
        (0.5, 0.52, 0.0),
        (0.77, 0.5, 90.0),
        (0.22, 0.55, 90.0),
    ] {
        assert!(near(axis_at(&map, u, v), want, 0.5), "({u}, {v})");
    }
    // Its ridge ends in two half points.
    let found = points(&map);
    assert_eq!(found.iter().map(|p| p.twice_index).sum::<i32>(), 2);
}

#[test]
fn a_line_leads_along_itself_and_a_closed_one_inside_too() {
    let surface = surface(200, 100, Wrap::Clamp);
    let diagonal = line(&[[0.1, 0.1], [0.9, 0.9]]);
    let want = 0.8f32.atan2(1.6).to_degrees();
    let map = draw(&guides(256, vec![diagonal.clone()]), &surface);
    for (u, v) in [(0.5, 0.5), (0.2, 0.2), (0.9, 0.1)] {
        assert!(near(axis_at(&map, u, v), want, 0.1));
    }
    let across = Guide {
        mode: Mode::Radial,
        ..diagonal
    };
    let map = draw(&guides(256, vec![across]), &surface);
    assert!(near(axis_at(&map, 0.5, 0.5), want + 90.0, 0.1));
    let square = Guide {
        mode: Mode::Constant,
        angle: 45.0,
        falloff: 0.0,
        ..Guide::new(Shape::Line {
            points: vec![[0.3, 0.3], [0.7, 0.3], [0.7, 0.7], [0.3, 0.7]],
            closed: true,
        })
    };
    let background = Guide {
        mode: Mode::Constant,
        falloff: 1.0,
        ..at(
            0.5,
            0.5,
            Shape::Rectangle {
                size: [4.0, 4.0],
                corner: 0.0,
            },
        )
    };
    let map = draw(&guides(256, vec![background, square]), &surface);
    assert!(near(axis_at(&map, 0.5, 0.5), 45.0, 0.1));
    assert!(near(axis_at(&map, 0.1, 0.5), 0.0, 0.1));
}

#[test]
fn a_smooth_guide_lets_go_what_lies_before_it() {
    let surface = surface(200, 200, Wrap::Clamp);
    let spokes = Guide {
        mode: Mode::Radial,
        ..circle(0.5, 0.5, 0.1)
    };
    let around = Guide {
        mode: Mode::Constant,
        falloff: 0.02,
        ..line(&[[0.1, 0.5], [0.9, 0.5]])
    };
    let hole = Guide {
        mode: Mode::Smooth,
        falloff: 0.01,
        ..circle(0.5, 0.5, 0.2)
    };
    let with = draw(&guides(256, vec![around.clone(), spokes.clone()]), &surface);
    assert!(near(axis_at(&with, 0.5, 0.55), 90.0, 1.0));
    let without = draw(&guides(256, vec![around, spokes, hole.clone()]), &surface);
    assert!(near(axis_at(&without, 0.5, 0.55), 0.0, 0.1));
    // Alone, and with no guide at all, there is nothing to lay.
    for list in [vec![hole], vec![]] {
        let field = solve(&guides(256, list), &surface);
        assert!(field.is_empty());
        let (map, coverage) = filled_in(&field, &surface, 64);
        assert!(coverage.iter().all(|c| *c == 0.0));
        assert!(map.cos2().iter().all(|c| *c == 1.0));
        assert_eq!(field.singularities(), Some(vec![]));
    }
}

#[test]
fn a_guide_over_another_fades_into_it_over_its_falloff() {
    let surface = surface(400, 400, Wrap::Clamp);
    let flat = Guide {
        mode: Mode::Constant,
        ..at(
            0.5,
            0.5,
            Shape::Rectangle {
                size: [2.0, 2.0],
                corner: 0.0,
            },
        )
    };
    let up = Guide {
        mode: Mode::Constant,
        angle: 60.0,
        falloff: 0.2,
        ..circle(0.5, 0.5, 0.1)
    };
    let map = draw(&guides(400, vec![flat, up]), &surface);
    let along: Vec<f32> = [0.55, 0.65, 0.7, 0.75, 0.85]
        .iter()
        .map(|u| axis_at(&map, *u, 0.5))
        .collect();
    assert!(near(along[0], 60.0, 0.01) && near(along[4], 0.0, 0.01));
    assert!(near(along[2], 30.0, 0.5), "{along:?}");
    assert!(along[1] > along[2] && along[2] > along[3], "{along:?}");
}

#[test]
fn guides_are_seen_over_the_edges_that_repeat() {
    let with = |wrap| {
        let surface = surface(200, 200, wrap);
        draw(
            &guides(
                200,
                vec![circle(1.0, 0.5, 0.2), line(&[[0.5, 0.1], [0.5, 0.9]])],
            ),
            &surface,
        )
    };
    let repeat = with(Wrap::RepeatU);
    // Left and right of the seam lie the halves of one circle.
    assert!(near(axis_at(&repeat, 0.1, 0.5), 90.0, 0.1));
    assert!(near(axis_at(&repeat, 0.9, 0.5), 90.0, 0.1));
    assert!(near(axis_at(&repeat, 0.1, 0.6), 135.0, 0.5));
    assert!(near(axis_at(&repeat, 0.9, 0.6), 45.0, 0.5));
    let clamp = with(Wrap::Clamp);
    assert!(!near(axis_at(&clamp, 0.1, 0.6), 135.0, 5.0));
    // A whole turn more is the same place.
    let surface = surface(150, 150, Wrap::Repeat);
    let once = draw(&guides(150, vec![circle(0.2, 0.3, 0.3)]), &surface);
    let again = draw(&guides(150, vec![circle(2.2, -0.7, 0.3)]), &surface);
    let (_, worst) = apart(&once, &again, 0, |_, _| true);
    assert!(worst < 0.05, "{worst}");
}

#[test]
fn only_near_shows_the_layer_where_guides_hold() {
    let surface = surface(200, 200, Wrap::Clamp);
    let near = Guides {
        only_near: true,
        ..guides(200, vec![circle(0.5, 0.5, 0.2)])
    };
    let (_, coverage) = filled_in(&solve(&near, &surface), &surface, 64);
    let at = |x: usize, y: usize| coverage[y * 200 + x];
    assert_eq!((at(100, 100), at(10, 10)), (1.0, 0.0));
    assert!((0.3..0.7).contains(&at(145, 100)), "{}", at(145, 100));
}

#[test]
fn every_size_of_the_map_shows_the_same_field() {
    let all = guides(256, mixed());
    let small = surface(128, 128, Wrap::Repeat);
    let large = surface(1024, 1024, Wrap::Repeat);
    let (a, b) = (draw(&all, &small), draw(&all, &large));
    let mut angles: Vec<f32> = (0..128 * 128u32)
        .map(|i| {
            let (x, y) = (i % 128, i / 128);
            let there = b.sample((x as f32 + 0.5) / 128.0, 1.0 - (y as f32 + 0.5) / 128.0);
            a.texel(x, y).axis.angle_to(there.axis).to_degrees()
        })
        .collect();
    angles.sort_by(f32::total_cmp);
    assert!(
        angles[angles.len() / 2] < 0.01,
        "{}",
        angles[angles.len() / 2]
    );
    assert!(angles[angles.len() * 99 / 100] < 1.0);
}

#[test]
fn extreme_guides_give_numbers_and_hostile_ones_are_refused() {
    let tiny = Guide {
        scale: 0.01,
        ..circle(0.5, 0.5, 0.001)
    };
    let same = line(&[[0.5, 0.5], [0.5, 0.5]]);
    let far = circle(-10.0, 10.0, 0.2);
    let weak = Guide {
        strength: 1e-6,
        ..circle(0.5, 0.5, 0.2)
    };
    let flat = at(
        0.5,
        0.5,
        Shape::Ellipse {
            radii: [2.0, 0.001],
        },
    );
    for guide in [tiny, same, far, weak, flat] {
        for (w, h, wrap) in [
            (1, 1, Wrap::Repeat),
            (40, 3, Wrap::Clamp),
            (33, 64, Wrap::RepeatU),
        ] {
            let surface = surface(w, h, wrap);
            let grid = guides(17, vec![guide.clone()]);
            // Six turns of a narrow surface are a lot, but allowed; more are refused, not drawn.
            let Ok(field) = grid.prepare(&surface, &Progress::none()) else {
                assert!(wrap != Wrap::Clamp);
                continue;
            };
            let map = filled(&field, &surface);
            for i in 0..map.size().texels() {
                let length = map.texel_at(i).axis.double_angle().length();
                assert!((length - 1.0).abs() < 1e-5, "{guide:?}");
            }
        }
    }
    let wide = guides(
        64,
        vec![Guide {
            falloff: 10.0,
            ..circle(0.5, 0.5, 0.2)
        }],
    );
    let refused = wide.prepare(&surface(64, 64, Wrap::Repeat), &Progress::none());
    let e = refused.err().expect("too wide").to_string();
    assert!(
        e.starts_with("guide.0") && e.contains("turns") && e.contains("clamp"),
        "{e}"
    );
    let points: Vec<[f32; 2]> = (0..1021)
        .map(|i| [i as f32 * 1e-3, (i % 7) as f32 * 0.1])
        .collect();
    let curve = Guide::new(Shape::Curve {
        points,
        closed: false,
    });
    let many = guides(4096, vec![curve; GUIDES_MAX]);
    let e = many.prepare(&surface(64, 64, Wrap::Clamp), &Progress::none());
    let e = e.err().expect("too many").to_string();
    assert!(e.contains("straight pieces"), "{e}");
    let e = guides(15, vec![]).check().unwrap_err().to_string();
    assert!(e.contains("grid is 15; allowed: 16 to 4096"), "{e}");
    let e = guides(64, vec![circle(0.5, 0.5, 0.2); GUIDES_MAX + 1]);
    assert!(e.check().unwrap_err().to_string().contains("at most 256"));
    let bad = guides(64, vec![circle(0.5, 0.5, 0.2), circle(0.5, 0.5, -1.0)]);
    let e = bad.check().unwrap_err().to_string();
    assert!(e.starts_with("guide.1.shape.ellipse.radii"), "{e}");
}

#[test]
fn a_cancelled_solve_is_an_error_and_the_solver_still_serves() {
    let surface = surface(128, 128, Wrap::Clamp);
    let all = guides(128, mixed());
    let mut solver = Solver::default();
    for stop_at in [0u32, 1, 3, 6] {
        let asked = std::sync::atomic::AtomicU32::new(0);
        let no =
            |_: u64, _: u64| asked.fetch_add(1, std::sync::atomic::Ordering::Relaxed) < stop_at;
        let result = all.prepare_with(&surface, Detail::Full, &mut solver, &Progress::new(&no));
        assert!(matches!(result, Err(Error::Cancelled)), "{stop_at}");
    }
    let field = all.prepare_with(&surface, Detail::Full, &mut solver, &Progress::none());
    let (mean, _) = apart(
        &filled(&field.unwrap(), &surface),
        &draw(&all, &surface),
        0,
        |_, _| true,
    );
    assert!(mean < 0.01, "{mean}");
}

/// A guide of any shape and size that fits a square.
fn any_guide() -> impl Strategy<Value = Guide> {
    let shape = (0usize..7, 0.01f32..0.5, 0.003f32..0.5).prop_map(|(kind, a, b)| match kind {
        0 | 1 => Shape::Ellipse { radii: [a, b] },
        2 => Shape::Rectangle {
            size: [a, b],
            corner: 0.2 * a,
        },
        3 => Shape::Spiral {
            radius: a,
            pitch: b - 0.2,
        },
        _ => {
            let points = vec![[-a, 0.0], [0.0, b], [a, 0.0], [b, -a], [0.0, -b], [-a, -a]];
            let closed = kind != 4;
            if kind < 6 {
                Shape::Line { points, closed }
            } else {
                Shape::Curve { points, closed }
            }
        }
    });
    let place = (0.0f32..1.0, 0.0f32..1.0, -180.0f32..180.0);
    (shape, place, 0.02f32..0.4).prop_map(|(shape, (u, v, rotation), falloff)| Guide {
        rotation,
        falloff,
        ..at(u, v, shape)
    })
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]
    #[test]
    fn a_hold_has_no_steps_and_stays_in_range(guide in any_guide(), repeats in any::<bool>()) {
        let wrap = if repeats { Wrap::Repeat } else { Wrap::Clamp };
        let hold = Hold::new(&guides(256, vec![guide.clone()]), 1.0, wrap, 1.0 / 256.0).unwrap();
        let xs: Vec<f32> = (0..512).map(|i| i as f32 / 511.0).collect();
        let mut row = Row::default();
        let mut above: Option<Vec<f32>> = None;
        // The hold falls by at most 3/2 of the way per falloff, times how much faster than the distance its estimate grows.
        let most = 3.0 * 1.5 / (511.0 * guide.falloff);
        for &y in &xs {
            hold.row(y, &xs, &mut row);
            for (i, h) in row.hold.iter().enumerate() {
                prop_assert!((0.0..=1.0).contains(h));
                let left = row.hold[i.saturating_sub(1)];
                let up = above.as_ref().map_or(*h, |a| a[i]);
                prop_assert!((h - left).abs() < most && (h - up).abs() < most, "at {}, {}", xs[i], y);
                let length = row.cos2[i].hypot(row.sin2[i]);
                prop_assert!(length <= h * 1.001 + 1e-6, "{length} of {h}");
            }
            above = Some(row.hold.clone());
        }
    }
}

#[test]
fn holds_lie_over_one_another_as_layers_do() {
    let half = Guide {
        strength: 0.5,
        mode: Mode::Constant,
        ..circle(0.5, 0.5, 0.3)
    };
    let up = Guide {
        angle: 90.0,
        ..half.clone()
    };
    let hold = |list| Hold::new(&guides(64, list), 1.0, Wrap::Clamp, 0.01).unwrap();
    let mut row = Row::default();
    hold(vec![half.clone(), up]).row(0.5, &[0.5, 0.99], &mut row);
    assert_eq!((row.hold[0], row.hold[1]), (0.75, 0.0));
    assert!((row.cos2[0] - (0.25 - 0.5)).abs() < 1e-6);
    let lets_go = Guide {
        mode: Mode::Smooth,
        strength: 0.4,
        ..half.clone()
    };
    let both = hold(vec![half, lets_go]);
    both.row(0.5, &[0.5], &mut row);
    assert!((row.hold[0] - 0.3).abs() < 1e-6 && (row.cos2[0] - 0.3).abs() < 1e-6);
    let weight = both.weight(row.hold[0], row.odds[0]);
    assert!(
        (weight - 0.3 / 0.7 / 0.05f32.powi(2)).abs() < 0.1,
        "{weight}"
    );
    assert!(both.weight(1.0, 400.0) <= 1.01 * WEIGHT_MAX / 1e-4);
}
