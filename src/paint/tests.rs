use super::*;
use crate::map::{AnisoMap, DEFAULT_TEXEL, Rect, Region, Size, Texel, Wrap, blend};
use crate::math::Axis;
use crate::pattern::Surface;
use crate::progress::Progress;
use glam::Vec2;
use proptest::prelude::*;
use std::sync::Arc;

const BELOW: Texel = Texel {
    alpha_x: 0.2,
    alpha_y: 0.4,
    axis: Axis {
        cos2: 0.6,
        sin2: 0.8,
    },
};

fn surface(width: u32, height: u32, wrap: Wrap) -> Surface {
    Surface {
        size: Size::new(width, height).unwrap(),
        aspect: width as f32 / height as f32,
        wrap,
        seed: 0,
    }
}

fn stroke(brush: &Brush, points: &[(f32, f32, f32)]) -> Arc<Stroke> {
    let points = points
        .iter()
        .map(|(u, v, p)| Point::new(Vec2::new(*u, *v), *p).unwrap());
    Arc::new(Stroke::new(Arc::new(brush.clone()), 7, points).unwrap())
}

fn painting(surface: &Surface, strokes: &[Arc<Stroke>]) -> Painting {
    let strokes = Strokes {
        strokes: strokes.to_vec(),
        mesh: None,
    };
    Painting::new(surface, &strokes, None, &Progress::none()).unwrap()
}

/// What lies below in the tests: not the same anywhere.
fn ground(size: Size) -> AnisoMap {
    let mut map = AnisoMap::constant(size, Wrap::Repeat, BELOW);
    for i in 0..size.texels() {
        let (x, y) = (
            (i % size.width() as usize) as f32,
            (i / size.width() as usize) as f32,
        );
        let texel = Texel {
            alpha_x: 0.1 + 0.001 * (x % 50.0),
            alpha_y: 0.3 + 0.002 * (y % 30.0),
            axis: Axis::from_degrees(3.0 * x + 7.0 * y),
        };
        map.region_mut().set(i, texel);
    }
    map
}

/// A rectangle of a painted map and its coverage.
fn painted(painting: &Painting, below: &AnisoMap, rect: Rect) -> (Region, Vec<f32>) {
    let needs = painting.needs(rect);
    let under = below.region(needs);
    let (mut now, mut coverage) = (under.clone(), vec![0.0; needs.texels()]);
    let nobody = Progress::none();
    let all = 0..painting.len();
    let done = painting.paint(all, rect, &under, &mut now, &mut coverage, &nobody);
    done.expect("nobody cancels");
    let mut part = Region::constant(rect, DEFAULT_TEXEL);
    part.copy_from(&now);
    let covered = (rect.y..rect.y + rect.height)
        .flat_map(|y| (rect.x..rect.x + rect.width).map(move |x| (x, y)))
        .map(|(x, y)| coverage[needs.index(x, y)])
        .collect();
    (part, covered)
}

fn whole(surface: &Surface, strokes: &[Arc<Stroke>], below: &AnisoMap) -> (Region, Vec<f32>) {
    painted(&painting(surface, strokes), below, surface.size.rect())
}

fn tools() -> Vec<Tool> {
    vec![
        Tool::Groove(Groove::default()),
        Tool::Comb,
        Tool::Smooth(Smooth { reach: 0.03 }),
        Tool::Roughen(Roughen {
            factor: 1.7,
            keep: Keep::Ratio,
        }),
        Tool::Roughen(Roughen {
            factor: 1.7,
            keep: Keep::Area,
        }),
        Tool::SetAlpha(SetAlpha {
            alpha_x: Some(0.7),
            alpha_y: None,
        }),
        Tool::SetDirection(SetDirection { angle: 40.0 }),
        Tool::Erase,
        Tool::Fill(FillWith {
            alpha_x: Some(0.2),
            alpha_y: None,
            angle: Some(20.0),
        }),
        Tool::Scratch(Scratch::default()),
    ]
}

fn brush(tool: Tool) -> Brush {
    Brush {
        tool,
        radius: 0.1,
        ..Brush::default()
    }
}

prop_compose! {
    fn any_brush()(
        tool in prop::sample::select(tools()),
        radius in 0.002f32..0.3,
        hardness in 0.0f32..=1.0,
        flow in 0.0f32..=1.0,
        spacing in prop_oneof![Just(0.0f32), 0.1f32..2.0],
        jitter in 0.0f32..1.0,
        size in 0.0f32..=1.0,
        symmetry in prop_oneof![
            3 => Just(Symmetry::None),
            1 => Just(Symmetry::MirrorU { at: 0.5 }),
            1 => Just(Symmetry::MirrorBoth { at: [0.4, 0.7] }),
            1 => Just(Symmetry::Radial { count: 5, center: [0.5, 0.4] }),
        ],
    ) -> Brush {
        let pressure = Pressure { size, flow: 0.3 };
        Brush { tool, radius, hardness, flow, spacing, jitter, pressure, symmetry }
    }
}

prop_compose! {
    fn any_stroke()(
        brush in any_brush(),
        seed in any::<u32>(),
        start in (-0.5f32..1.5, -0.5f32..1.5),
        steps in prop::collection::vec((-0.2f32..0.2, -0.2f32..0.2, 0.0f32..=1.0), 0..8),
    ) -> Arc<Stroke> {
        let mut at = Vec2::from(start);
        let mut points = vec![Point::new(at, 0.7).unwrap()];
        for (x, y, pressure) in steps {
            at += Vec2::new(x, y);
            points.push(Point::new(at, pressure).unwrap());
        }
        Arc::new(Stroke::new(Arc::new(brush), seed, points).unwrap())
    }
}

fn any_wrap() -> impl Strategy<Value = Wrap> {
    prop::sample::select(vec![Wrap::Repeat, Wrap::RepeatU, Wrap::Clamp])
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(60))]

    #[test]
    fn any_piece_is_what_the_whole_is_there(
        strokes in prop::collection::vec(any_stroke(), 1..6),
        wrap in any_wrap(),
        side in 17u32..100,
    ) {
        let surface = surface(150, 110, wrap);
        let below = ground(surface.size);
        let painting = painting(&surface, &strokes);
        let (all, coverage) = painted(&painting, &below, surface.size.rect());
        for rect in surface.size.rect().tiles(side) {
            let (part, covered) = painted(&painting, &below, rect);
            for y in rect.y..rect.y + rect.height {
                for x in rect.x..rect.x + rect.width {
                    let (i, j) = (rect.index(x, y), surface.size.rect().index(x, y));
                    prop_assert_eq!(part.texel(i), all.texel(j), "at ({}, {})", x, y);
                    prop_assert_eq!(covered[i], coverage[j]);
                }
            }
        }
    }

    #[test]
    fn a_live_stroke_is_the_finished_one(one in any_stroke(), wrap in any_wrap()) {
        let surface = surface(150, 110, wrap);
        let below = ground(surface.size);
        let rect = surface.size.rect();
        let under = below.region(rect);
        let mut live = Live::new(one.brush().clone(), one.seed(), &surface).unwrap();
        let Points::Uv(points) = one.points() else { panic!() };
        let (mut now, mut coverage) = (under.clone(), vec![0.0; rect.texels()]);
        for (i, point) in points.iter().enumerate() {
            // What is ahead counts for as long as nothing else is.
            let ahead = &points[i + 1..points.len().min(i + 1 + i % 4)];
            for dirty in live.go_on(&[*point], ahead) {
                for y in dirty.y..dirty.y + dirty.height {
                    let (at, n) = (rect.index(dirty.x, y), dirty.width as usize);
                    coverage[at..at + n].fill(0.0);
                }
                live.apply(&below.region(live.needs(dirty)), &under, dirty, (&mut now, &mut coverage));
            }
            // What lies outside the dirty rectangles is right as well.
            let mut anew = Region::constant(rect, DEFAULT_TEXEL);
            live.apply(&under, &under, rect, (&mut anew, &mut vec![0.0; rect.texels()]));
            prop_assert!(anew == now);
        }
        let (want, covered) = whole(&surface, std::slice::from_ref(&one), &below);
        prop_assert!(now == want);
        prop_assert!(coverage == covered);
        match live.finish() {
            Some(finished) => prop_assert_eq!(&finished, &*one),
            None => prop_assert!(want == under),
        }
        let mut ahead = Live::new(one.brush().clone(), one.seed(), &surface).unwrap();
        ahead.go_on(&points[..1], &points[points.len() / 2..]);
        ahead.go_on(&[], &points[1..]);
        if let (Some(finished), false) = (ahead.finish(), one.brush().tool.is_everywhere()) {
            prop_assert_eq!(&finished, &*one);
        }
    }

    #[test]
    fn texels_stay_in_range(strokes in prop::collection::vec(any_stroke(), 1..8), wrap in any_wrap()) {
        let surface = surface(90, 70, wrap);
        let (all, coverage) = whole(&surface, &strokes, &ground(surface.size));
        let planes = [all.alpha_x, all.alpha_y, all.cos2, all.sin2];
        let (_, mended) = AnisoMap::from_planes(surface.size, wrap, planes).unwrap();
        prop_assert_eq!((mended.faults(), mended.not_unit), (0, 0));
        prop_assert!(coverage.iter().all(|c| (0.0..=1.0).contains(c)));
    }

    #[test]
    fn strokes_taken_away_were_never_there(strokes in prop::collection::vec(any_stroke(), 2..6), wrap in any_wrap()) {
        let surface = surface(90, 70, wrap);
        let below = ground(surface.size);
        let mut grown = painting(&surface, &strokes[..1]);
        for stroke in &strokes[1..] {
            grown.push(stroke).unwrap();
        }
        let rect = surface.size.rect();
        prop_assert!(painted(&grown, &below, rect) == whole(&surface, &strokes, &below));
        for _ in &strokes[1..] {
            grown.pop();
        }
        prop_assert!(painted(&grown, &below, rect) == whole(&surface, &strokes[..1], &below));
    }

    #[test]
    fn a_layer_writes_what_it_reads(strokes in prop::collection::vec(any_stroke(), 0..9)) {
        let strokes = Strokes { strokes, mesh: Some("torus".to_owned()) };
        let text = toml::to_string(&strokes).unwrap();
        let back: Strokes = toml::from_str(&text).unwrap();
        prop_assert_eq!(&back, &strokes);
        prop_assert_eq!(toml::to_string(&back).unwrap(), text);
    }

    #[test]
    fn hostile_bytes_are_an_error_or_strokes(bytes in prop::collection::vec(any::<u8>(), 0..60)) {
        use base64::Engine as _;
        let packed = base64::engine::general_purpose::STANDARD_NO_PAD.encode(bytes);
        let text = format!("packed = [\"{packed}\"]\n[[brushes]]\n");
        if let Ok(strokes) = toml::from_str::<Strokes>(&text) {
            let surface = surface(40, 30, Wrap::Repeat);
            whole(&surface, &strokes.strokes, &ground(surface.size));
        }
    }
}

#[test]
fn a_groove_lies_along_its_stroke() {
    let surface = surface(128, 128, Wrap::Clamp);
    let below = AnisoMap::constant(surface.size, Wrap::Clamp, BELOW);
    let groove = stroke(&brush(Tool::default()), &[(0.2, 0.3, 1.0), (0.8, 0.6, 1.0)]);
    let (all, coverage) = whole(&surface, &[groove], &below);
    let middle = all.texel(surface.size.rect().index(64, 70));
    let want = Axis::from_vector(Vec2::new(0.6, 0.3)).unwrap();
    assert!(middle.axis.angle_to(want).to_degrees() < 1e-3);
    assert_eq!((middle.alpha_x, middle.alpha_y), (0.08, 0.35));
    assert_eq!(coverage[surface.size.rect().index(64, 70)], 1.0);
    assert_eq!(all.texel(0), BELOW, "to the bit where no stroke reaches");
}

#[test]
fn a_curve_turns_without_facets() {
    let surface = surface(256, 256, Wrap::Clamp);
    let below = AnisoMap::constant(surface.size, Wrap::Clamp, BELOW);
    let points: Vec<_> = (0..=48)
        .map(|i| {
            let p = Vec2::splat(0.5) + 0.3 * Vec2::from_angle(i as f32 * 0.1);
            (p.x, p.y, 1.0)
        })
        .collect();
    let (all, coverage) = whole(
        &surface,
        &[stroke(&brush(Tool::default()), &points)],
        &below,
    );
    let mut worst = 0.0f32;
    for i in 0..surface.size.texels() {
        let p = surface.position((i % 256) as u32, (i / 256) as u32) - 0.5;
        let angle = p.y.atan2(p.x).rem_euclid(std::f32::consts::TAU);
        if coverage[i] == 1.0 && (0.2..4.5).contains(&angle) {
            let tangent = Axis::from_vector(p.perp()).unwrap();
            worst = worst.max(all.texel(i).axis.angle_to(tangent).to_degrees());
        }
    }
    // The path itself turns by 5.7 degrees at each point.
    assert!(worst < 0.3, "{worst}");
}

#[test]
fn a_stroke_that_crosses_itself_is_no_denser_there() {
    let surface = surface(128, 128, Wrap::Clamp);
    let below = AnisoMap::constant(surface.size, Wrap::Clamp, BELOW);
    let soft = Brush {
        flow: 0.4,
        ..brush(Tool::default())
    };
    let cross = [
        (0.2, 0.5, 1.0),
        (0.9, 0.5, 1.0),
        (0.9, 0.9, 1.0),
        (0.5, 0.9, 1.0),
        (0.5, 0.1, 1.0),
    ];
    let (_, coverage) = whole(&surface, &[stroke(&soft, &cross)], &below);
    let most = coverage.iter().fold(0.0f32, |m, c| m.max(*c));
    assert!((most - 0.4).abs() < 1e-6, "{most}");
    let at = |x: u32, y: u32| coverage[surface.size.rect().index(x, y)];
    assert!((at(64, 64) - at(64, 100)).abs() < 1e-6 && (at(64, 64) - at(30, 64)).abs() < 1e-6);
}

#[test]
fn a_thousand_faint_strokes_build_up_to_what_they_should() {
    let surface = surface(96, 96, Wrap::Clamp);
    let below = AnisoMap::constant(surface.size, Wrap::Clamp, BELOW);
    let faint = Brush {
        flow: 0.001,
        hardness: 0.0,
        ..brush(Tool::SetAlpha(SetAlpha {
            alpha_x: Some(1.0),
            alpha_y: None,
        }))
    };
    let one = stroke(&faint, &[(0.2, 0.5, 1.0), (0.8, 0.5, 1.0)]);
    let once = whole(&surface, std::slice::from_ref(&one), &below).1;
    let (all, coverage) = whole(&surface, &vec![one; 1000], &below);
    let mut distinct = std::collections::BTreeSet::new();
    for i in 0..surface.size.texels() {
        let part = 1.0 - (1.0 - f64::from(once[i])).powi(1000);
        let want = 0.2 + 0.8 * part;
        assert!(
            (f64::from(all.alpha_x[i]) - want).abs() < 2e-5,
            "{} {want}",
            all.alpha_x[i]
        );
        assert!((f64::from(coverage[i]) - part).abs() < 2e-5);
        distinct.insert(coverage[i].to_bits());
    }
    assert!((all.alpha_x[surface.size.rect().index(48, 48)] - (1.0 - 0.8 * 0.3677)).abs() < 5e-3);
    assert!(distinct.len() > 150, "bands: {} levels", distinct.len());
}

#[test]
fn no_flow_changes_nothing_and_erasing_brings_back_what_lies_below() {
    let surface = surface(100, 80, Wrap::Repeat);
    let below = ground(surface.size);
    let path = [(0.1, 0.2, 1.0), (0.9, 0.8, 0.5), (0.3, 0.9, 1.0)];
    for tool in tools() {
        let none = Brush {
            flow: 0.0,
            ..brush(tool)
        };
        let (all, coverage) = whole(&surface, &[stroke(&none, &path)], &below);
        assert!(all == below.region(surface.size.rect()), "{}", tool.name());
        assert!(coverage.iter().all(|c| *c == 0.0));
        let eraser = Brush {
            radius: 3.0,
            hardness: 1.0,
            ..brush(Tool::Erase)
        };
        let strokes = [stroke(&brush(tool), &path), stroke(&eraser, &path)];
        let (all, coverage) = whole(&surface, &strokes, &below);
        assert!(all == below.region(surface.size.rect()), "{}", tool.name());
        assert!(coverage.iter().all(|c| *c == 0.0));
    }
}

#[test]
fn the_first_dab_waits_for_a_direction() {
    let surface = surface(64, 64, Wrap::Repeat);
    let below = ground(surface.size);
    for tool in tools() {
        let click = stroke(&brush(tool), &[(0.5, 0.5, 1.0)]);
        let (all, _) = whole(&surface, &[click], &below);
        let same = all == below.region(surface.size.rect());
        assert_eq!(
            same,
            tool.follows_stroke() || tool == Tool::Erase,
            "{}",
            tool.name()
        );
    }
}

#[test]
fn the_order_of_strokes_matters_and_the_last_wins() {
    let surface = surface(64, 64, Wrap::Repeat);
    let below = ground(surface.size);
    let across = stroke(&brush(Tool::default()), &[(0.1, 0.5, 1.0), (0.9, 0.5, 1.0)]);
    let up = stroke(&brush(Tool::default()), &[(0.5, 0.1, 1.0), (0.5, 0.9, 1.0)]);
    let at = |strokes: &[Arc<Stroke>]| {
        let (all, _) = whole(&surface, strokes, &below);
        all.texel(surface.size.rect().index(32, 32)).axis.degrees()
    };
    assert!((at(&[across.clone(), up.clone()]) - 90.0).abs() < 1e-3);
    assert!(at(&[up, across]) < 1e-3);
}

#[test]
fn strokes_go_on_over_the_edge_where_the_map_repeats() {
    for (wrap, left, top) in [
        (Wrap::Repeat, true, true),
        (Wrap::RepeatU, true, false),
        (Wrap::Clamp, false, false),
    ] {
        let surface = surface(64, 64, wrap);
        let below = ground(surface.size);
        let path = stroke(
            &brush(Tool::default()),
            &[(0.5, 0.5, 1.0), (1.02, 1.02, 1.0)],
        );
        let (_, coverage) = whole(&surface, &[path], &below);
        let at = |x: u32, y: u32| coverage[surface.size.rect().index(x, y)] > 0.5;
        assert!(at(63, 0));
        assert_eq!((at(0, 0), at(63, 63)), (left, top), "{wrap:?}");
    }
}

#[test]
fn a_stroke_moved_by_a_period_is_the_same_stroke() {
    let surface = surface(64, 64, Wrap::Repeat);
    let below = ground(surface.size);
    let path = |by: f32| {
        let points = [
            (0.25 + by, 0.5, 1.0),
            (0.75 + by, 0.625, 1.0),
            (0.9375 + by, 0.25, 0.5),
        ];
        whole(
            &surface,
            &[stroke(&brush(Tool::default()), &points)],
            &below,
        )
    };
    assert!(path(0.0) == path(1.0) && path(0.0) == path(-2.0));
}

#[test]
fn mirrored_strokes_are_mirrored_to_the_bit() {
    let surface = surface(128, 64, Wrap::Clamp);
    let below = AnisoMap::constant(surface.size, Wrap::Clamp, BELOW);
    let rect = surface.size.rect();
    for (symmetry, u, v) in [
        (Symmetry::MirrorU { at: 0.5 }, true, false),
        (Symmetry::MirrorV { at: 0.5 }, false, true),
        (Symmetry::MirrorBoth { at: [0.5; 2] }, true, true),
    ] {
        let brush = Brush {
            symmetry,
            radius: 0.06,
            ..brush(Tool::default())
        };
        let path = [(0.1, 0.2, 1.0), (0.3, 0.4, 1.0), (0.41, 0.35, 1.0)];
        let (all, coverage) = whole(&surface, &[stroke(&brush, &path)], &below);
        for y in 0..64 {
            for x in 0..128 {
                let other = rect.index(if u { 127 - x } else { x }, if v { 63 - y } else { y });
                let i = rect.index(x, y);
                assert_eq!(coverage[i], coverage[other], "({x}, {y})");
                if coverage[i] == 1.0 {
                    let sign = if u == v { 1.0 } else { -1.0 };
                    assert_eq!(
                        (all.cos2[i], all.sin2[i]),
                        (all.cos2[other], sign * all.sin2[other])
                    );
                }
            }
        }
    }
}

#[test]
fn radial_copies_stand_evenly_around_their_centre() {
    let surface = surface(101, 101, Wrap::Clamp);
    let below = AnisoMap::constant(surface.size, Wrap::Clamp, BELOW);
    let brush = Brush {
        symmetry: Symmetry::Radial {
            count: 4,
            center: [0.5; 2],
        },
        radius: 0.05,
        ..brush(Tool::default())
    };
    let (_, coverage) = whole(
        &surface,
        &[stroke(&brush, &[(0.6, 0.6, 1.0), (0.8, 0.65, 1.0)])],
        &below,
    );
    let rect = surface.size.rect();
    for y in 0..101u32 {
        for x in 0..101 {
            let turned = rect.index(y, 100 - x);
            assert!((coverage[rect.index(x, y)] - coverage[turned]).abs() < 1e-3);
        }
    }
}

#[test]
fn laying_blends_as_the_map_does() {
    let surface = surface(64, 64, Wrap::Clamp);
    let below = ground(surface.size);
    let soft = Brush {
        hardness: 0.0,
        flow: 0.7,
        ..brush(Tool::Groove(Groove {
            along: 0.05,
            across: 0.5,
        }))
    };
    let (all, coverage) = whole(
        &surface,
        &[stroke(&soft, &[(0.2, 0.5, 1.0), (0.8, 0.5, 1.0)])],
        &below,
    );
    for i in 0..surface.size.texels() {
        let laid = Texel {
            alpha_x: 0.05,
            alpha_y: 0.5,
            axis: Axis::U,
        };
        let want = blend(below.texel_at(i), laid, coverage[i]);
        let got = all.texel(i);
        assert!(
            (got.alpha_x - want.alpha_x).abs() < 1e-6 && (got.alpha_y - want.alpha_y).abs() < 1e-6
        );
        let off = (got.axis.double_angle() - want.axis.double_angle()).length();
        assert!(off < 1e-4, "{off}");
    }
}

#[test]
fn combing_turns_grooves_and_keeps_widths() {
    let surface = surface(64, 64, Wrap::Clamp);
    let wide = Texel {
        alpha_x: 0.5,
        alpha_y: 0.1,
        axis: Axis::from_degrees(20.0),
    };
    let below = AnisoMap::constant(surface.size, Wrap::Clamp, wide);
    let path = [(0.2, 0.5, 1.0), (0.8, 0.5, 1.0)];
    let (all, _) = whole(&surface, &[stroke(&brush(Tool::Comb), &path)], &below);
    let texel = all.texel(surface.size.rect().index(32, 32));
    assert_eq!((texel.alpha_x, texel.alpha_y), (0.5, 0.1));
    assert!(texel.groove().angle_to(Axis::U).to_degrees() < 1e-3);
    let half = Brush {
        flow: 0.5,
        ..brush(Tool::Comb)
    };
    let (all, _) = whole(&surface, &[stroke(&half, &path)], &below);
    // The groove stood at 110 degrees: half of the 70 to 180 are left.
    let groove = all.texel(surface.size.rect().index(32, 32)).groove();
    assert!(
        (groove.degrees() - 145.0).abs() < 1e-2,
        "{}",
        groove.degrees()
    );
}

#[test]
fn roughening_keeps_what_it_says() {
    let surface = surface(32, 32, Wrap::Clamp);
    let below = AnisoMap::constant(surface.size, Wrap::Clamp, BELOW);
    for (factor, keep) in [
        (1.5, Keep::Ratio),
        (0.01, Keep::Ratio),
        (100.0, Keep::Ratio),
        (1.5, Keep::Area),
        (100.0, Keep::Area),
        (0.1, Keep::Area),
    ] {
        let rough = Brush {
            radius: 4.0,
            ..brush(Tool::Roughen(Roughen { factor, keep }))
        };
        let (all, _) = whole(&surface, &[stroke(&rough, &[(0.5, 0.5, 1.0)])], &below);
        let texel = all.texel(500);
        let (kept, was) = match keep {
            Keep::Ratio => (texel.ratio(), BELOW.ratio()),
            Keep::Area => (texel.alpha_x * texel.alpha_y, BELOW.alpha_x * BELOW.alpha_y),
        };
        assert!(
            (kept / was - 1.0).abs() < 1e-4,
            "{factor} {keep:?}: {kept} {was}"
        );
        assert!(texel.alpha_x != BELOW.alpha_x);
    }
}

#[test]
fn smoothing_evens_out_a_step_and_leaves_flat_ground_alone() {
    let surface = surface(128, 64, Wrap::Clamp);
    let mut below = AnisoMap::constant(surface.size, Wrap::Clamp, BELOW);
    for i in 0..surface.size.texels() {
        if i % 128 >= 64 {
            let other = Texel {
                alpha_x: 0.6,
                alpha_y: 0.4,
                axis: BELOW.axis,
            };
            below.region_mut().set(i, other);
        }
    }
    let smooth = Brush {
        radius: 0.3,
        hardness: 1.0,
        ..brush(Tool::Smooth(Smooth { reach: 0.1 }))
    };
    let (all, _) = whole(
        &surface,
        &[stroke(&smooth, &[(0.1, 0.5, 1.0), (0.9, 0.5, 1.0)])],
        &below,
    );
    let at = |x: u32| all.alpha_x[surface.size.rect().index(x, 32)];
    assert!((at(20) - 0.2).abs() < 1e-6 && (at(110) - 0.6).abs() < 1e-6);
    assert!((at(63) + at(64) - 0.8).abs() < 1e-4);
    let steepest = (50..78).map(|x| at(x + 1) - at(x)).fold(0.0f32, f32::max);
    assert!(steepest < 0.08, "{steepest}");
}

#[test]
fn scratches_lie_within_their_stroke_and_lean_no_more_than_they_may() {
    let surface = surface(256, 256, Wrap::Clamp);
    let below = AnisoMap::constant(surface.size, Wrap::Clamp, BELOW);
    let scratch = Scratch {
        spread: 10.0,
        width: 0.01,
        ..Scratch::default()
    };
    let (all, coverage) = whole(
        &surface,
        &[stroke(
            &brush(Tool::Scratch(scratch)),
            &[(0.1, 0.5, 1.0), (0.9, 0.5, 1.0)],
        )],
        &below,
    );
    let mut covered = 0;
    for i in 0..surface.size.texels() {
        let p = surface.position((i % 256) as u32, (i / 256) as u32);
        if coverage[i] > 0.99 {
            covered += 1;
            assert!(all.texel(i).axis.angle_to(Axis::U).to_degrees() < 10.1);
        }
        assert!(coverage[i] == 0.0 || (p.y - 0.5).abs() < 0.12);
    }
    assert!((300..6000).contains(&covered), "{covered}");
}

#[test]
fn mistakes_in_packed_strokes_name_what_is_wrong() {
    let fails = |text: &str, words: &[&str]| {
        let e = toml::from_str::<Strokes>(text).unwrap_err().to_string();
        for word in words {
            assert!(e.contains(word), "no `{word}` in: {e}");
        }
    };
    fails("packed = ['*']", &["base64"]);
    fails(
        "packed = ['AAAAAA']",
        &["number of points is 0", "1 to 100000"],
    );
    fails("packed = ['AAAA']", &["ends in the middle"]);
    fails("packed = ['AAAAAYAgAAA']", &["brush 0", "`brushes`"]);
    fails("packed = ['AAQAAYAgAAA']", &["the flags", "0 to 3"]);
    fails("packed = ['//////////////8']", &["has no end"]);
    fails(
        "[[brushes]]\nradius = 0.0",
        &["radius is 0", "0.00001 to 10"],
    );
    fails(
        "[[brushes]]\nspacing = 0.001",
        &["spacing is 0.001", "0.01 to 10", "0 is a line"],
    );
    fails("[[brushes]]\ntool = 'comp'", &["unknown variant"]);
    fails(
        "[[brushes]]\n[brushes.tool.groove]\nalong = 7.0",
        &["tool.groove.along is 7"],
    );
    fails("packd = []", &["packd"]);
}

#[test]
fn strokes_of_too_many_pieces_are_refused() {
    let surface = surface(64, 64, Wrap::Clamp);
    let dotted = Arc::new(Brush {
        spacing: 0.25,
        radius: 0.01,
        symmetry: Symmetry::MirrorU { at: 0.5 },
        ..brush(Tool::Comb)
    });
    let ends = [Vec2::new(0.1, 0.5), Vec2::new(0.9, 0.5)].map(|at| Point::new(at, 1.0).unwrap());
    let one = Arc::new(Stroke::new(dotted, 1, ends).unwrap());
    let strokes = |n: usize| Strokes {
        strokes: vec![one.clone(); n],
        mesh: None,
    };
    // 0.8 in steps of 0.25 x 0.02 are 161 dabs, and as many on the other side.
    let most = painting::Limits {
        pieces: 1000,
        entries: 1000,
    };
    let laid = |n| Painting::within(most, &surface, &strokes(n), None, &Progress::none());
    assert_eq!(laid(3).unwrap().len(), 3);
    let wrong = laid(4).err().expect("too many").to_string();
    assert!(
        wrong.contains("more than 1000") && wrong.contains("Space the dabs wider"),
        "{wrong}"
    );
    refuses_one_more(laid(3).unwrap(), &one);
}

/// A full painting is as it was after a stroke that it refuses, and takes one again when one has gone.
fn refuses_one_more(mut full: Painting, stroke: &Arc<Stroke>) {
    let (strokes, entries) = (full.len(), full.entries());
    for _ in 0..2 {
        assert!(full.push(stroke).is_err());
        assert_eq!((full.len(), full.entries()), (strokes, entries));
        full.pop().expect("a stroke");
        assert!(full.entries() < entries);
        full.push(stroke).expect("room for one");
        assert_eq!((full.len(), full.entries()), (strokes, entries));
    }
}

/// A dab that is far broader than the map, which repeats.
fn broad(surface: &Surface) -> Arc<Stroke> {
    assert_eq!(surface.wrap, Wrap::Repeat);
    let one = Brush {
        radius: 10.0,
        ..brush(Tool::Erase)
    };
    stroke(&one, &[(0.5, 0.5, 1.0)])
}

#[test]
fn strokes_that_reach_too_many_tiles_are_refused() {
    let surface = surface(128, 128, Wrap::Repeat);
    let one = broad(&surface);
    let entries = painting(&surface, std::slice::from_ref(&one)).entries();
    // In each of four tiles about as many turns as a circle of that radius has.
    assert!((4 * 250..4 * 500).contains(&entries), "{entries}");
    let strokes = |n: usize| Strokes {
        strokes: vec![one.clone(); n],
        mesh: None,
    };
    let most = painting::Limits {
        pieces: 1000,
        entries: 3 * entries,
    };
    let laid = |n| Painting::within(most, &surface, &strokes(n), None, &Progress::none());
    assert_eq!(laid(3).unwrap().entries(), 3 * entries);
    let wrong = laid(4).err().expect("too many").to_string();
    let said = format!("more than {} tiles", 3 * entries);
    assert!(
        wrong.contains(&said) && wrong.contains("brushes narrower"),
        "{wrong}"
    );
    refuses_one_more(laid(3).unwrap(), &one);
}

#[test]
fn a_stroke_that_reaches_over_many_turns_has_one_entry_for_each() {
    let surface = surface(128, 128, Wrap::Repeat);
    let dab = painting(&surface, &[broad(&surface)]).entries();
    let path: Vec<_> = (0..30)
        .map(|n| (0.5 + 0.001 * n as f32, 0.5, 1.0))
        .collect();
    let line = stroke(broad(&surface).brush(), &path);
    let line = painting(&surface, &[line]).entries();
    assert!((dab..dab + dab / 8).contains(&line), "{line} and {dab}");
}

#[test]
fn laying_strokes_asks_whether_to_go_on() {
    let surface = surface(512, 512, Wrap::Repeat);
    let few = Strokes {
        strokes: vec![broad(&surface); 20],
        mesh: None,
    };
    let asked = std::sync::atomic::AtomicUsize::new(0);
    let stop = |_, _| asked.fetch_add(1, std::sync::atomic::Ordering::Relaxed) < 3;
    let laid = Painting::new(&surface, &few, None, &Progress::new(&stop));
    assert!(matches!(laid, Err(crate::error::Error::Cancelled)));
    assert_eq!(asked.into_inner(), 4);
}

#[test]
fn strokes_that_work_everywhere_take_their_turn_and_no_room_in_tiles() {
    let surface = surface(200, 130, Wrap::Repeat);
    let below = ground(surface.size);
    let dab = |u: f32| stroke(&brush(Tool::Erase), &[(u, 0.4, 1.0)]);
    let fill = |alpha: f32, flow: f32| {
        let tool = Tool::Fill(FillWith {
            alpha_x: Some(alpha),
            ..FillWith::default()
        });
        let one = Brush {
            flow,
            ..brush(tool)
        };
        stroke(&one, &[(0.5, 0.5, 1.0)])
    };
    let strokes = [
        fill(0.9, 0.4),
        dab(0.3),
        fill(0.01, 0.7),
        fill(0.3, 0.2),
        dab(0.35),
        dab(0.9),
        fill(0.5, 0.1),
    ];
    let all = painting(&surface, &strokes);
    let dabs: Vec<_> = [1, 4, 5].map(|n: usize| strokes[n].clone()).to_vec();
    assert_eq!(all.entries(), painting(&surface, &dabs).entries());
    // One at a time, each over what those before it left.
    let rect = surface.size.rect();
    let under = below.region(rect);
    let (mut now, mut coverage) = (under.clone(), vec![0.0; rect.texels()]);
    let nobody = Progress::none();
    for n in 0..strokes.len() {
        let done = all.paint(n..n + 1, rect, &under, &mut now, &mut coverage, &nobody);
        done.unwrap();
    }
    assert!(painted(&all, &below, rect) == (now, coverage.clone()));
    let mut covered = vec![0.0; rect.texels()];
    all.cover(rect, &mut covered, &nobody).unwrap();
    assert!(covered == coverage);
    let far = Rect {
        x: 100,
        y: 0,
        width: 20,
        height: 20,
    };
    assert_eq!([0, 1].map(|n| all.touches(n, far)), [false, true]);
    assert_eq!(all.reached(2).len(), 12);
    // Taken away and done again.
    let mut again = painting(&surface, &strokes);
    while again.pop().is_some() {}
    assert!(!again.touches(9, far) && again.entries() == 0);
    strokes.iter().for_each(|s| again.push(s).unwrap());
    assert!(painted(&again, &below, rect) == painted(&all, &below, rect));
}

#[test]
fn numbers_that_are_none_are_no_points() {
    assert_eq!(Point::new(Vec2::new(f32::NAN, 0.0), 1.0), None);
    assert_eq!(Point::new(Vec2::ZERO, f32::INFINITY), None);
    let far = Point::new(Vec2::splat(1e9), 9.0).unwrap();
    assert_eq!((far.uv(), far.pressure()), (Vec2::splat(UV_REACH), 1.0));
    let brush = Arc::new(Brush::default());
    assert!(Stroke::new(brush.clone(), 0, []).is_err());
    let broken = Brush {
        hardness: f32::NAN,
        ..Brush::default()
    };
    assert!(Stroke::new(Arc::new(broken), 0, [far]).is_err());
    let mut points = MeshPoints::new(1.0);
    assert!(!points.push(glam::Vec3::NAN, glam::Vec3::Z, 1.0));
    assert!(!points.push(glam::Vec3::ZERO, glam::Vec3::ZERO, 1.0));
    assert!(points.is_empty() && Stroke::on_mesh(brush, 0, points).is_err());
}

#[test]
fn boxes_hold_all_that_is_covered_however_far_it_was_moved() {
    let surface = surface(16384, 16100, Wrap::Repeat);
    let ground = laid::Ground::new(&surface);
    let round = Brush {
        hardness: 1.0,
        ..brush(Tool::Erase)
    };
    let shape = ground.shape(&round);
    let mut cover = cover::Cover::new(glam::IVec2::ZERO, false);
    let row = 8192;
    let mut found = 0;
    for n in 0..40_000u32 {
        let part = |n: u32| (n.wrapping_mul(2_654_435_761) >> 8) as f32 / (1u32 << 24) as f32;
        // As far as copies lie, and with their rim in the farthest turn that is looked for.
        let side = if n % 2 == 0 { 15.0 } else { -14.0 };
        let node = trail::Node {
            at: Vec2::new(side + 0.3 * part(2 * n), ground.grid.y(row)),
            side: (),
            radius: 1.3 + 0.4 * part(2 * n + 1),
            flow: 1.0,
        };
        let piece = trail::Piece {
            ends: [node; 2],
            start: Vec2::X,
            along: Vec2::X,
            end: Vec2::X,
        };
        ground.rects(&piece, &shape, |rect, period| {
            let beside = [rect.x.checked_sub(1), Some(rect.x + rect.width)];
            for column in beside.into_iter().flatten().filter(|x| *x < 16384) {
                let tile = Rect {
                    x: column / cover::TILE * cover::TILE,
                    y: row,
                    width: cover::TILE,
                    height: 1,
                };
                cover.clear(glam::IVec2::new(tile.x as i32, row as i32));
                let shift = ground.shift(period);
                cover.add(&piece, shift, &shape, &ground.grid, tile);
                let weight = cover.weight[(column - tile.x) as usize];
                assert_eq!(weight, 0.0, "{column} beside {rect:?} of {node:?}");
                found += 1;
            }
        });
    }
    assert!(found > 40_000, "{found}");
}

/// Strokes on meshes.
mod on_mesh {
    use super::*;
    use crate::mesh::{self, Body, Mesh, Projection, pot};
    use glam::{Mat3, Vec3, Vec4};

    fn skin(mesh: Mesh, width: u32, height: u32, wrap: Wrap) -> (Surface, Arc<Skin>) {
        let surface = Surface {
            size: Size::new(width, height).unwrap(),
            aspect: mesh.aspect,
            wrap,
            seed: 0,
        };
        let skin = Skin::new(Arc::new(Body::new(Arc::new(mesh)).unwrap()), &surface);
        (surface, Arc::new(skin))
    }

    /// Positions and normals of the vertices nearest to places of the layout, each once.
    fn on_vertices(mesh: &Mesh, uvs: impl Iterator<Item = Vec2>) -> Vec<(Vec3, Vec3)> {
        let mut path: Vec<(Vec3, Vec3)> = Vec::new();
        for uv in uvs {
            let uv = uv - uv.floor();
            let off = |i: &usize| mesh.uvs[*i].distance(uv);
            let i = (0..mesh.uvs.len())
                .min_by(|a, b| off(a).total_cmp(&off(b)))
                .unwrap();
            if path.last().is_none_or(|p| p.0 != mesh.positions[i]) {
                path.push((mesh.positions[i], mesh.normals[i]));
            }
        }
        path
    }

    /// The place of the surface that the layout shows at each of some places.
    fn on_surface(mesh: &Mesh, uvs: impl Iterator<Item = Vec2>) -> Vec<(Vec3, Vec3)> {
        let at = |uv: Vec2| {
            let uv = uv - uv.floor();
            let hit = mesh.triangles.iter().find_map(|t| {
                let [a, b, c] = t.map(|i| mesh.uvs[i as usize]);
                let area = (b - a).perp_dot(c - a);
                let v = (uv - a).perp_dot(c - a) / area;
                let w = (b - a).perp_dot(uv - a) / area;
                let inside = v >= -1e-4 && w >= -1e-4 && v + w <= 1.0001;
                inside.then_some((*t, [1.0 - v - w, v, w]))
            });
            let (t, at) = hit.expect("the layout covers all");
            let mix = |from: &[Vec3]| (0..3).map(|k| from[t[k] as usize] * at[k]).sum::<Vec3>();
            (mix(&mesh.positions), mix(&mesh.normals))
        };
        uvs.map(at).collect()
    }

    /// A stroke of a brush whose lengths are the mesh's.
    fn stroke_of(brush: &Brush, skin: &Skin, path: &[(Vec3, Vec3)]) -> Arc<Stroke> {
        let brush = brush.scaled(1.0 / skin.scale());
        let mut points = MeshPoints::new(skin.extent());
        for (position, normal) in path {
            assert!(points.push(*position, *normal, 1.0));
        }
        Arc::new(Stroke::on_mesh(Arc::new(brush), 3, points).unwrap())
    }

    fn painting(surface: &Surface, skin: &Arc<Skin>, strokes: &[Arc<Stroke>]) -> Painting {
        let strokes = Strokes {
            strokes: strokes.to_vec(),
            mesh: None,
        };
        Painting::new(surface, &strokes, Some(Arc::clone(skin)), &Progress::none()).unwrap()
    }

    /// Every place of the surface that a texel shows: the texel, position, normal, and a direction of the frame in space.
    fn each_place(
        surface: &Surface,
        skin: &Skin,
        mut visit: impl FnMut(usize, Vec3, Vec3, [Vec3; 2]),
    ) {
        let rect = surface.size.rect();
        for (n, tile) in rect.tiles(cover::TILE).enumerate() {
            let columns = surface.size.width().div_ceil(cover::TILE);
            for some in skin.places((n as u32 % columns, n as u32 / columns)).iter() {
                for i in (0..cover::LANES).filter(|i| some.texel[*i] != skin::NOWHERE) {
                    let (x, y) = (
                        some.texel[i] as u32 % cover::TILE,
                        some.texel[i] as u32 / cover::TILE,
                    );
                    if x < tile.width && y < tile.height {
                        let at = |v: &[cover::Lane; 3]| Vec3::new(v[0][i], v[1][i], v[2][i]);
                        let frame = [at(&some.tangent), at(&some.bitangent)];
                        visit(
                            rect.index(tile.x + x, tile.y + y),
                            at(&some.at),
                            at(&some.normal),
                            frame,
                        );
                    }
                }
            }
        }
    }

    fn in_space(texel: Texel, frame: [Vec3; 2]) -> Vec3 {
        let d = texel.axis.direction();
        frame[0] * d.x + frame[1] * d.y
    }

    fn between(a: Vec3, b: Vec3) -> f32 {
        a.normalize()
            .cross(b.normalize())
            .length()
            .min(1.0)
            .asin()
            .to_degrees()
    }

    #[test]
    fn a_stroke_goes_straight_over_the_seams_of_a_torus() {
        let (surface, skin) = skin(mesh::torus(), 1024, 512, Wrap::Repeat);
        let groove = Brush {
            radius: 0.08,
            hardness: 0.9,
            ..Brush::default()
        };
        // Over the seam of u at the top, and over that of v at the inner equator.
        for (from, to) in [((-0.04, 0.72), (0.04, 0.78)), ((0.46, -0.06), (0.54, 0.06))] {
            let (from, to) = (Vec2::from(from), Vec2::from(to));
            let path = on_surface(
                skin.mesh(),
                (0..=40).map(|i| from.lerp(to, i as f32 / 40.0)),
            );
            let one = stroke_of(&groove, &skin, &path);
            let below = ground(surface.size);
            let (all, coverage) = painted(
                &painting(&surface, &skin, &[one]),
                &below,
                surface.size.rect(),
            );
            let mut frames = vec![None; surface.size.texels()];
            each_place(&surface, &skin, |i, at, _, frame| {
                frames[i] = Some((at, frame));
            });
            let (mut met, mut worst) = (0, 0.0f32);
            let rect = surface.size.rect();
            let seam = |k: u32| {
                if from.x < 0.0 {
                    (rect.index(0, k), rect.index(1023, k))
                } else {
                    (rect.index(k, 0), rect.index(k, 511))
                }
            };
            for k in 0..512 {
                let (a, b) = seam(k);
                if coverage[a] == 1.0 && coverage[b] == 1.0 {
                    let (Some((p, f)), Some((q, g))) = (frames[a], frames[b]) else {
                        panic!()
                    };
                    assert!(p.distance(q) < 0.03, "{p} {q}");
                    met += 1;
                    worst = worst.max(between(
                        in_space(all.texel(a), f),
                        in_space(all.texel(b), g),
                    ));
                }
            }
            assert!(met > 4, "{met} texels at the seam");
            assert!(worst <= 1.0, "{worst} degrees");
            println!("torus: {met} pairs, {worst} degrees");
        }
    }

    #[test]
    fn a_stroke_goes_straight_over_the_charts_of_a_projection() {
        let mut sphere = mesh::sphere();
        Projection::Box.lay(&mut sphere);
        let (surface, skin) = skin(sphere, 1024, 1024, Wrap::Repeat);
        let groove = Brush {
            radius: 0.1,
            hardness: 0.9,
            ..Brush::default()
        };
        // Around a great circle aslant, over all six sides and their corners.
        let axis = Vec3::new(1.0, -1.0, 0.2).normalize();
        let (a, b) = axis.any_orthonormal_pair();
        let radius = skin.mesh().positions[0].length();
        let path = (0..=360).map(|i| {
            let (sin, cos) = (i as f32).to_radians().sin_cos();
            let out = a * cos + b * sin;
            (out * radius, out)
        });
        let one = stroke_of(&groove, &skin, &path.collect::<Vec<_>>());
        let strokes = painting(&surface, &skin, &[one]);
        let (all, coverage) = painted(&strokes, &ground(surface.size), surface.size.rect());
        let (mut sides, mut worst) = ([0; 6], 0.0f32);
        each_place(&surface, &skin, |i, at, normal, frame| {
            if coverage[i] < 1.0 {
                return;
            }
            let along = axis.cross(at);
            worst = worst.max(between(in_space(all.texel(i), frame), along));
            let [x, y, z] = normal.abs().to_array();
            let side = if x >= y.max(z) {
                usize::from(normal.x < 0.0)
            } else if y >= z {
                2 + usize::from(normal.y < 0.0)
            } else {
                4 + usize::from(normal.z < 0.0)
            };
            sides[side] += 1;
        });
        println!("projected sphere: {sides:?} texels, {worst} degrees");
        assert!(sides.iter().all(|n| *n > 300), "{sides:?}");
        // Two texels beside a seam differ by no more than both are off.
        assert!(worst <= 0.5, "{worst} degrees");
    }

    #[test]
    fn a_stroke_keeps_its_direction_over_the_joint_of_a_pots_handle() {
        let (surface, skin) = skin(pot(), 2048, 1707, Wrap::RepeatU);
        let groove = Brush {
            radius: 0.03,
            hardness: 0.9,
            ..Brush::default()
        };
        // Along the wall, up to the handle's leg at +x, and on along it: z = 0.3 is its middle.
        let y = {
            let top = skin
                .mesh()
                .positions
                .iter()
                .filter(|p| p.x > 1.15 && p.z > 0.0);
            let (low, high) = top.fold((f32::MAX, f32::MIN), |m, p| (m.0.min(p.y), m.1.max(p.y)));
            0.5 * (low + high)
        };
        let up = y + 0.04; // the top of the tube
        let wall = |z: f32, y: f32| Vec3::new((1.0 - z * z).sqrt(), y, z);
        let mut path: Vec<(Vec3, Vec3)> = Vec::new();
        for i in 0..=20 {
            let at = wall(0.3, up + 0.1 * (1.0 - i as f32 / 20.0));
            path.push((at, Vec3::new(at.x, 0.0, at.z)));
        }
        for i in 1..=10 {
            path.push((Vec3::new(path[0].0.x + 0.005 * i as f32, up, 0.3), Vec3::Y));
        }
        let one = stroke_of(&groove, &skin, &path);
        let strokes = painting(&surface, &skin, &[one]);
        let (all, coverage) = painted(&strokes, &ground(surface.size), surface.size.rect());
        let (mut on_wall, mut on_handle, mut worst) = (0, 0, 0.0f32);
        let size = Vec2::new(2048.0, 1707.0);
        each_place(&surface, &skin, |i, _, normal, frame| {
            if coverage[i] < 1.0 {
                return;
            }
            let uv = Vec2::new((i % 2048) as f32 + 0.5, 1707.0 - (i / 2048) as f32 - 0.5) / size;
            let (count, direction) = if pot::BODY.contains(uv) {
                (&mut on_wall, Vec3::NEG_Y)
            } else {
                (&mut on_handle, Vec3::X)
            };
            *count += 1;
            let flat = direction - normal * direction.dot(normal);
            worst = worst.max(between(in_space(all.texel(i), frame), flat));
        });
        println!("pot: {on_wall} texels of the wall, {on_handle} of the handle, {worst} degrees");
        assert!(on_wall > 500 && on_handle > 50, "{on_wall} {on_handle}");
        assert!(worst <= 1.0, "{worst} degrees");
    }

    #[test]
    fn a_brush_is_as_broad_on_a_mesh_of_any_size() {
        let covered = [0.001, 1.0, 1000.0].map(|size| {
            let mut mesh = mesh::torus();
            mesh.positions.iter_mut().for_each(|p| *p *= size);
            let (surface, skin) = skin(mesh, 256, 128, Wrap::Repeat);
            let groove = Brush {
                radius: 0.08 * skin.scale(),
                ..Brush::default()
            };
            let path = on_surface(
                skin.mesh(),
                (0..=20).map(|i| Vec2::new(0.2 + 0.02 * i as f32, 0.7)),
            );
            let one = stroke_of(&groove, &skin, &path);
            assert!(one.brush().check().is_ok());
            let all = painting(&surface, &skin, &[one]);
            let (_, coverage) = painted(&all, &ground(surface.size), surface.size.rect());
            coverage.iter().sum::<f32>()
        });
        println!("covered: {covered:?} texels");
        for sum in covered {
            assert!(
                sum > 1000.0 && (sum / covered[1] - 1.0).abs() < 1e-3,
                "{covered:?}"
            );
        }
    }

    #[test]
    fn a_mesh_of_more_triangles_than_texels_is_painted_as_any_other() {
        let (surface, skin) = skin(mesh::torus(), 200, 100, Wrap::Repeat);
        let all = surface.size.rect();
        let (mut small, mut whole) = (0, 0);
        for n in 0..40 {
            let at = skin.mesh().positions[n * 800];
            let (low, high) = (at - 0.1, at + 0.1);
            let mut near = Vec::new();
            skin.near(low, high, |n| near.push(n));
            let touched = skin.touched(low, high);
            for n in near {
                skin.rects(n, |rect, _| {
                    for y in rect.y..rect.y + rect.height {
                        for x in rect.x..rect.x + rect.width {
                            let there = |r: &Rect| {
                                (r.x..r.x + r.width).contains(&x)
                                    && (r.y..r.y + r.height).contains(&y)
                            };
                            assert!(touched.iter().any(|(_, r)| there(r)), "{x}, {y}");
                        }
                    }
                });
            }
            small += touched.iter().map(|(_, r)| r.texels()).sum::<usize>();
            whole += all.texels();
        }
        assert!(small * 4 < whole, "{small} of {whole}");
    }

    #[test]
    fn copies_lie_over_the_middle_of_the_mesh() {
        let (surface, skin) = skin(mesh::torus(), 512, 256, Wrap::Repeat);
        let path = on_surface(
            skin.mesh(),
            (0..=10).map(|i| Vec2::new(0.05 + 0.008 * i as f32, 0.2 + 0.01 * i as f32)),
        );
        let paint = |symmetry: Symmetry, turns: &[Mat3]| {
            let groove = Brush {
                radius: 0.06,
                symmetry,
                ..Brush::default()
            };
            let strokes: Vec<Arc<Stroke>> = turns
                .iter()
                .map(|turn| {
                    let path: Vec<(Vec3, Vec3)> =
                        path.iter().map(|(p, n)| (*turn * *p, *turn * *n)).collect();
                    stroke_of(&groove, &skin, &path)
                })
                .collect();
            let all = painting(&surface, &skin, &strokes);
            painted(&all, &ground(surface.size), surface.size.rect())
        };
        let flip = |x: f32, y: f32| Mat3::from_diagonal(Vec3::new(x, y, 1.0));
        let both = [
            Mat3::IDENTITY,
            flip(-1.0, 1.0),
            flip(1.0, -1.0),
            flip(-1.0, -1.0),
        ];
        let third = |n: u32| Mat3::from_rotation_y(std::f32::consts::TAU / 3.0 * n as f32);
        let at = [0.1, 0.9]; // means nothing on a mesh
        for (symmetry, turns) in [
            (Symmetry::MirrorU { at: 0.1 }, &both[..2]),
            (Symmetry::MirrorV { at: 0.1 }, &[both[0], both[2]]),
            (Symmetry::MirrorBoth { at }, &both),
            (
                Symmetry::Radial {
                    count: 3,
                    center: at,
                },
                &[third(0), third(1), third(2)],
            ),
        ] {
            let (one, covered) = paint(symmetry, &[Mat3::IDENTITY]);
            let (many, wanted) = paint(Symmetry::None, turns);
            let alone = paint(Symmetry::None, &turns[..1]).1.iter().sum::<f32>();
            let sum = covered.iter().sum::<f32>();
            assert!(
                sum > 0.9 * alone * turns.len() as f32,
                "{symmetry:?}: {sum}"
            );
            for i in 0..covered.len() {
                assert!((covered[i] - wanted[i]).abs() < 2e-3, "{symmetry:?}, {i}");
                if covered[i] == 1.0 {
                    let (a, b) = (one.texel(i).axis, many.texel(i).axis);
                    assert!(a.angle_to(b).to_degrees().abs() < 0.5, "{symmetry:?}, {i}");
                }
            }
        }
    }

    #[test]
    fn smoothing_sees_nothing_of_another_chart() {
        // Two squares that lie side by side in the layout, and far from each other in space.
        let mut two = mesh::plane();
        two.uvs.iter_mut().for_each(|uv| uv.x *= 0.5);
        let n = two.positions.len() as u32;
        for i in 0..n as usize {
            two.positions
                .push(two.positions[i] + Vec3::new(9.0, 0.0, 0.0));
            two.normals.push(two.normals[i]);
            two.tangents.push(two.tangents[i]);
            two.uvs.push(two.uvs[i] + Vec2::new(0.5, 0.0));
        }
        let more: Vec<[u32; 3]> = two.triangles.iter().map(|t| t.map(|i| i + n)).collect();
        two.triangles.extend(more);
        let (surface, skin) = skin(two, 128, 64, Wrap::Clamp);
        let mut below = AnisoMap::constant(surface.size, Wrap::Clamp, BELOW);
        for i in 0..surface.size.texels() {
            let (x, y) = (i % 128, i / 128);
            let texel = Texel {
                alpha_x: if x < 64 { 0.1 } else { 0.9 },
                alpha_y: if y % 2 == 0 { 0.2 } else { 0.4 },
                axis: Axis::U,
            };
            below.region_mut().set(i, texel);
        }
        let smooth = Brush {
            tool: Tool::Smooth(Smooth { reach: 0.1 }),
            radius: 0.4,
            ..Brush::default()
        };
        let path = on_surface(
            skin.mesh(),
            (1..=9).map(|i| Vec2::new(0.45, 0.1 * i as f32)),
        );
        let one = stroke_of(&smooth, &skin, &path);
        let all = painting(&surface, &skin, &[one]);
        let (now, coverage) = painted(&all, &below, surface.size.rect());
        let mut evened = 0;
        for i in (0..coverage.len()).filter(|i| coverage[*i] > 0.99) {
            let texel = now.texel(i);
            assert!((texel.alpha_x - if i % 128 < 64 { 0.1 } else { 0.9 }).abs() < 1e-5);
            evened += u32::from((texel.alpha_y - 0.3).abs() < 0.02);
        }
        assert!(evened > 300, "{evened} texels");
    }

    #[test]
    fn a_layout_many_turns_away_is_painted_where_the_map_repeats() {
        let painted_at = |turns: Vec2, wrap: Wrap| {
            let mut mesh = mesh::builtin("plane").unwrap();
            // In steps that f32 holds as well so far away.
            let snapped = |uv: Vec2| (uv * 1024.0).round() / 1024.0;
            mesh.uvs
                .iter_mut()
                .for_each(|uv| *uv = snapped(*uv) + turns);
            let (surface, skin) = skin(mesh, 96, 96, wrap);
            let corners = [skin.mesh().positions[0], -skin.mesh().positions[0]];
            let path = corners.map(|p| (0.5 * p, skin.mesh().normals[0]));
            let one = Brush {
                radius: 0.2 * skin.scale(),
                ..brush(Tool::Groove(Groove::default()))
            };
            let painting = painting(&surface, &skin, &[stroke_of(&one, &skin, &path)]);
            painted(&painting, &ground(surface.size), surface.size.rect())
        };
        let here = painted_at(Vec2::ZERO, Wrap::Repeat);
        assert!(here.1.contains(&1.0) && here.1.contains(&0.0));
        for turns in [
            Vec2::new(15.0, -15.0),
            Vec2::new(16.0, -16.0),
            Vec2::new(17.0, 18.0),
            Vec2::new(-40.0, 1000.0),
        ] {
            assert!(painted_at(turns, Wrap::Repeat) == here, "{turns}");
        }
        let beyond = painted_at(Vec2::new(0.0, 20.0), Wrap::RepeatU);
        assert!(beyond.1.iter().all(|c| *c == 0.0), "v does not repeat");
    }

    #[test]
    fn what_faces_away_keeps_its_own_paint() {
        let (surface, skin) = skin(pot(), 512, 427, Wrap::RepeatU);
        let wide = Brush {
            radius: 0.2,
            ..Brush::default()
        };
        let path: Vec<(Vec3, Vec3)> = (0..10)
            .map(|i| (Vec3::new(0.05 * i as f32 - 0.25, 0.0, 1.0), Vec3::Z))
            .collect();
        let (_, coverage) = painted(
            &painting(&surface, &skin, &[stroke_of(&wide, &skin, &path)]),
            &ground(surface.size),
            surface.size.rect(),
        );
        let (mut outside, mut inside) = (0, 0);
        each_place(&surface, &skin, |i, at, normal, _| {
            if coverage[i] > 0.5 {
                let out = normal.dot(Vec3::new(at.x, 0.0, at.z)) > 0.0;
                if out { outside += 1 } else { inside += 1 }
            }
        });
        assert!(outside > 500 && inside == 0, "{outside} {inside}");
    }

    #[test]
    fn paint_goes_on_beyond_the_edge_of_a_chart() {
        let mut plane = mesh::plane();
        for uv in &mut plane.uvs {
            *uv = 0.25 + *uv * 0.5;
        }
        let (surface, skin) = skin(plane, 128, 128, Wrap::Clamp);
        let mut shown = vec![0; surface.size.texels()];
        each_place(&surface, &skin, |i, _, _, _| shown[i] += 1);
        let at = |x: u32, y: u32| shown[surface.size.rect().index(x, y)];
        assert!(at(64, 64) >= 1 && at(29, 64) == 1 && at(64, 98) == 1);
        assert_eq!((at(26, 64), at(2, 2)), (0, 0));
    }

    prop_compose! {
        fn any_walk()(
            tool in prop::sample::select(tools()),
            radius in 0.02f32..0.3,
            hardness in 0.0f32..=1.0,
            spacing in prop_oneof![Just(0.0f32), 0.1f32..1.0],
            symmetry in prop::sample::select(vec![
                Symmetry::None,
                Symmetry::MirrorBoth { at: [0.5; 2] },
                Symmetry::Radial { count: 3, center: [0.5; 2] },
            ]),
            start in (0.0f32..1.0, 0.0f32..1.0),
            steps in prop::collection::vec((-0.05f32..0.05, -0.05f32..0.05), 0..6),
        ) -> (Brush, Vec<Vec2>) {
            let mut at = Vec2::from(start);
            let mut walk = vec![at];
            for step in steps {
                at += Vec2::from(step);
                walk.push(at);
            }
            (Brush { tool, radius, hardness, spacing, symmetry, jitter: 0.3, flow: 0.8, ..Brush::default() }, walk)
        }
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(20))]

        #[test]
        fn pieces_live_strokes_and_files_all_agree(walks in prop::collection::vec(any_walk(), 1..3)) {
            let (surface, skin) = skin(mesh::torus(), 180, 100, Wrap::Repeat);
            let rect = surface.size.rect();
            let below = ground(surface.size);
            let strokes: Vec<Arc<Stroke>> = walks
                .iter()
                .map(|(brush, walk)| stroke_of(brush, &skin, &on_vertices(skin.mesh(), walk.iter().copied())))
                .collect();
            let all = Strokes { strokes: strokes.clone(), mesh: None };
            let text = toml::to_string(&all).unwrap();
            prop_assert_eq!(&toml::from_str::<Strokes>(&text).unwrap(), &all);
            let painting = painting(&surface, &skin, &strokes);
            let (want, coverage) = painted(&painting, &below, rect);
            for part in rect.tiles(47) {
                let (piece, _) = painted(&painting, &below, part);
                for y in part.y..part.y + part.height {
                    for x in part.x..part.x + part.width {
                        prop_assert_eq!(piece.texel(part.index(x, y)), want.texel(rect.index(x, y)));
                    }
                }
            }
            let under = below.region(rect);
            let (mut now, mut covered) = (under.clone(), vec![0.0; rect.texels()]);
            for one in &strokes {
                let before = (now.clone(), covered.clone());
                let mut live = Live::on_mesh(one.brush().clone(), one.seed(), Arc::clone(&skin)).unwrap();
                let Points::Mesh(points) = one.points() else { panic!() };
                for n in 0..points.len() {
                    let (position, normal, pressure) = points.get(n);
                    let end = points.len().min(n + 1 + n % 3);
                    let ahead: Vec<_> = (n + 1..end).map(|i| points.get(i)).collect();
                    for dirty in live.go_on_mesh(&[(position, normal, pressure)], &ahead) {
                        for y in dirty.y..dirty.y + dirty.height {
                            let start = rect.index(dirty.x, y);
                            let row = start..start + dirty.width as usize;
                            covered[row.clone()].copy_from_slice(&before.1[row]);
                        }
                        live.apply(&before.0, &under, dirty, (&mut now, &mut covered));
                    }
                }
                if let Some(finished) = live.finish() {
                    prop_assert_eq!(finished.points().len(), points.len());
                }
            }
            prop_assert!(now == want && covered == coverage);
        }
    }

    #[test]
    fn a_mesh_of_nothing_but_odd_triangles_is_no_trouble() {
        let mesh = Mesh {
            name: "odd".to_owned(),
            positions: vec![
                Vec3::ZERO,
                Vec3::X,
                Vec3::X * 2.0,
                Vec3::new(1e30, 0.0, 1.0),
            ],
            normals: vec![Vec3::Z; 4],
            tangents: vec![Vec4::new(1.0, 0.0, 0.0, 1.0); 4],
            uvs: vec![
                Vec2::ZERO,
                Vec2::ONE,
                Vec2::splat(1e20),
                Vec2::new(-1e20, 3.0),
            ],
            triangles: vec![[0, 1, 2], [0, 0, 0], [0, 1, 3], [1, 2, 3]],
            aspect: 1.0,
        };
        let (surface, skin) = skin(mesh, 64, 64, Wrap::Repeat);
        let one = stroke_of(
            &Brush::default(),
            &skin,
            &[(Vec3::ZERO, Vec3::Z), (Vec3::X, Vec3::Z)],
        );
        let (all, _) = painted(
            &painting(&surface, &skin, &[one]),
            &ground(surface.size),
            surface.size.rect(),
        );
        let planes = [all.alpha_x, all.alpha_y, all.cos2, all.sin2];
        let (_, mended) = AnisoMap::from_planes(surface.size, Wrap::Repeat, planes).unwrap();
        assert_eq!(mended.faults(), 0);
    }
}
