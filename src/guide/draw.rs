//! Guides drawn by hand: what a drag over the map becomes, as a shape with its centre in its own middle.

use super::handles::SNAP_DEGREES;
use super::shape::Shape;
use super::{Guide, Modifiers};
use glam::Vec2;

/// The most pieces of a curve that is drawn by hand.
const PIECES_MAX: usize = 64;
/// A spiral is drawn with so many turns.
const TURNS: f32 = 5.0;
/// A path that ends so near its beginning, as a part of its length, is closed.
const CLOSES: f32 = 0.06;
/// How often the places along a piece are brought nearer to the path.
const REFINED: u32 = 16;
/// The least side of a shape, surface units.
const LEAST: f32 = 1e-3;

impl Guide {
    /// The guide that a drag along `path` (places in UV units) draws on a surface of this aspect: of the shape that `name`, one of
    /// [`Shape::NAMES`], says, ellipses and rectangles from corner to corner, spirals from their middle, lines from end to end, a
    /// curve along all places, within `tremble` surface units. `None` where the path goes nowhere, or there is no such shape.
    pub fn drawn(
        name: &str,
        path: &[Vec2],
        modifiers: Modifiers,
        tremble: f32,
        aspect: f32,
    ) -> Option<Self> {
        let extent = Vec2::new(aspect, 1.0);
        let path: Vec<Vec2> = path
            .iter()
            .filter(|p| p.is_finite())
            .map(|p| p.clamp(Vec2::splat(-8.0), Vec2::splat(8.0)) * extent)
            .collect();
        let (from, to) = (*path.first()?, *path.last()?);
        let long = path.iter().map(|p| p.distance(from)).fold(0.0, f32::max);
        if long < LEAST {
            return None;
        }
        let (shape, centre) = match name {
            "line" => line(from, to, modifiers, extent),
            "curve" => curve(&path, tremble, extent),
            "spiral" => {
                let radius = (to - from).length().clamp(LEAST, 10.0);
                let pitch = radius / TURNS;
                (Shape::Spiral { radius, pitch }, from)
            }
            "ellipse" => {
                let (centre, half) = frame(from, to, modifiers);
                (Shape::Ellipse { radii: half.into() }, centre)
            }
            "rectangle" => {
                let (centre, half) = frame(from, to, modifiers);
                let size = (2.0 * half).min(Vec2::splat(10.0)).into();
                (Shape::Rectangle { size, corner: 0.0 }, centre)
            }
            _ => return None,
        };
        Some(Self {
            center: Some((centre / extent).into()),
            ..Self::new(shape)
        })
    }
}

/// Middle and half the sides of what a drag from corner to corner spans, or from the middle to a corner.
fn frame(from: Vec2, to: Vec2, modifiers: Modifiers) -> (Vec2, Vec2) {
    let mut way = to - from;
    if modifiers.proportional {
        way = Vec2::splat(way.abs().max_element()).copysign(way);
    }
    let (centre, half) = if modifiers.centered {
        (from, way.abs())
    } else {
        (from + 0.5 * way, 0.5 * way.abs())
    };
    (centre, half.clamp(Vec2::splat(LEAST), Vec2::splat(10.0)))
}

fn line(from: Vec2, to: Vec2, modifiers: Modifiers, extent: Vec2) -> (Shape, Vec2) {
    let mut way = to - from;
    if modifiers.snap || modifiers.proportional {
        let step = SNAP_DEGREES.to_radians();
        let turn = (way.to_angle() / step).round() * step;
        let along = Vec2::from_angle(turn);
        way = along * way.dot(along);
    }
    let (centre, half) = if modifiers.centered {
        (from, way)
    } else {
        (from + 0.5 * way, 0.5 * way)
    };
    let end = half / extent;
    let points = vec![(-end).into(), end.into()];
    let shape = Shape::Line {
        points,
        closed: false,
    };
    (shape, centre)
}

/// The fewest cubic pieces that come within a tremble of a path.
fn curve(path: &[Vec2], tremble: f32, extent: Vec2) -> (Shape, Vec2) {
    let long: f32 = path.windows(2).map(|p| p[0].distance(p[1])).sum();
    let mut path = path.to_vec();
    path.dedup_by(|b, a| a.distance(*b) < 1e-5);
    let last = path.len() - 1;
    let closed = path.len() > 3 && path[0].distance(path[last]) < CLOSES * long;
    if closed {
        path[last] = path[0];
    }
    let mut tremble = tremble.max(1e-4);
    let mut points = fitted(&path, closed, tremble);
    while points.len() > 3 * PIECES_MAX + 1 {
        tremble *= 1.5;
        points = fitted(&path, closed, tremble);
    }
    let knots = || points.iter().step_by(3).copied();
    let low = knots().fold(path[0], Vec2::min);
    let high = knots().fold(path[0], Vec2::max);
    let centre = 0.5 * (low + high);
    if closed {
        points.pop(); // the first one
    }
    let points = points
        .iter()
        .map(|p| ((*p - centre) / extent).into())
        .collect();
    (Shape::Curve { points, closed }, centre)
}

/// The points of cubic pieces within `error` of a path (Schneider 1990, "An Algorithm for Automatically Fitting Digitized
/// Curves", Graphics Gems I).
fn fitted(path: &[Vec2], closed: bool, error: f32) -> Vec<Vec2> {
    let last = path.len() - 1;
    let ends = if closed {
        let through = (toward(path, 0, error) - backward(path, last, error)).normalize_or_zero();
        [through, -through]
    } else {
        [toward(path, 0, error), backward(path, last, error)]
    };
    let mut points = vec![path[0]];
    let (mut from, mut leaves) = (0, ends[0]);
    while from < last {
        let back = |to: usize| {
            if to == last {
                ends[1]
            } else {
                (backward(path, to, error) - toward(path, to, error)).normalize_or_zero()
            }
        };
        let piece = |to: usize| piece(&path[from..=to], [leaves, back(to)], error);
        // As far as one piece goes.
        let (mut to, mut past) = (from + 1, last + 1);
        let mut longest = piece(to);
        if let Some(whole) = piece(last) {
            (to, longest) = (last, Some(whole));
        } else {
            past = last;
        }
        while past - to > 1 {
            let middle = to.midpoint(past);
            match piece(middle) {
                Some(found) => (to, longest) = (middle, Some(found)),
                None => past = middle,
            }
        }
        points.extend(longest.iter().flat_map(|p| &p[1..]));
        (from, leaves) = (to, -back(to));
    }
    points
}

/// The direction in which a path leaves a place: that of what lies a few errors away.
fn toward(path: &[Vec2], i: usize, error: f32) -> Vec2 {
    leaving(path[i], path[i + 1..].iter(), error)
}

/// The direction back from where a path arrives at a place.
fn backward(path: &[Vec2], i: usize, error: f32) -> Vec2 {
    leaving(path[i], path[..i].iter().rev(), error)
}

fn leaving<'a>(from: Vec2, mut places: impl Iterator<Item = &'a Vec2> + Clone, error: f32) -> Vec2 {
    let nearest = places.clone().next();
    let far = places.find(|p| p.distance(from) >= 4.0 * error);
    let to = far.or(nearest).copied().unwrap_or(from);
    (to - from).normalize_or_zero()
}

/// The piece that leaves the ends of a path in the directions `ends`, when it comes within `error` of the path. There is always
/// one of two places.
fn piece(path: &[Vec2], ends: [Vec2; 2], error: f32) -> Option<[Vec2; 4]> {
    let last = path.len() - 1;
    if last < 2 {
        let third = path[0].distance(path[last]) / 3.0;
        let inner = [path[0] + ends[0] * third, path[last] + ends[1] * third];
        return Some([path[0], inner[0], inner[1], path[last]]);
    }
    let mut places = chord_lengths(path);
    for _ in 0..REFINED {
        let piece = best_piece(path, &places, ends);
        let off = |(t, p): (&f32, &Vec2)| cubic(&piece, *t).distance(*p);
        let worst = places.iter().zip(path).map(off).fold(0.0, f32::max);
        if worst <= error {
            return Some(piece);
        }
        if worst > 4.0 * error {
            return None;
        }
        for (t, p) in places.iter_mut().zip(path) {
            *t = nearer(&piece, *t, *p);
        }
    }
    None
}

/// How far along a path each of its places is, from 0 to 1.
fn chord_lengths(path: &[Vec2]) -> Vec<f32> {
    let mut along = vec![0.0f32];
    for pair in path.windows(2) {
        along.push(along[along.len() - 1] + pair[0].distance(pair[1]));
    }
    let long = along[along.len() - 1].max(f32::MIN_POSITIVE);
    along.iter().map(|s| s / long).collect()
}

/// The piece that leaves its ends in those directions and comes nearest to a path, by least squares.
fn best_piece(path: &[Vec2], places: &[f32], ends: [Vec2; 2]) -> [Vec2; 4] {
    let (from, to) = (path[0], path[path.len() - 1]);
    let (mut a, mut b, mut c) = (0.0, 0.0, 0.0);
    let mut x = [0.0f32; 2];
    for (t, p) in places.iter().zip(path) {
        let s = 1.0 - t;
        let (first, second) = (ends[0] * (3.0 * t * s * s), ends[1] * (3.0 * t * t * s));
        a += first.dot(first);
        b += first.dot(second);
        c += second.dot(second);
        let rest = *p - from * (s * s * (1.0 + 2.0 * t)) - to * (t * t * (1.0 + 2.0 * s));
        x[0] += first.dot(rest);
        x[1] += second.dot(rest);
    }
    let apart = from.distance(to);
    let whole = a * c - b * b;
    let mut lengths = [x[0] * c - x[1] * b, x[1] * a - x[0] * b].map(|l| l / whole);
    // Where the squares tell none, a third of the way: the heuristic of Wu and Barsky that Schneider takes.
    if whole.abs() < 1e-12 || lengths.iter().any(|l| !l.is_finite() || *l < 1e-3 * apart) {
        lengths = [apart / 3.0; 2];
    }
    [
        from,
        from + ends[0] * lengths[0],
        to + ends[1] * lengths[1],
        to,
    ]
}

fn cubic(piece: &[Vec2; 4], t: f32) -> Vec2 {
    let s = 1.0 - t;
    piece[0] * (s * s * s)
        + piece[1] * (3.0 * s * s * t)
        + piece[2] * (3.0 * s * t * t)
        + piece[3] * (t * t * t)
}

/// A step of Newton's toward where a piece comes nearest to a place.
fn nearer(piece: &[Vec2; 4], t: f32, place: Vec2) -> f32 {
    let s = 1.0 - t;
    let sides = [0, 1, 2].map(|i| (piece[i + 1] - piece[i]) * 3.0);
    let first = sides[0] * (s * s) + sides[1] * (2.0 * s * t) + sides[2] * (t * t);
    let second = ((sides[1] - sides[0]) * s + (sides[2] - sides[1]) * t) * 2.0;
    let away = cubic(piece, t) - place;
    let slope = first.dot(first) + away.dot(second);
    if slope.abs() < 1e-12 {
        return t;
    }
    (t - away.dot(first) / slope).clamp(0.0, 1.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f32::consts::TAU;

    fn drawn(name: &str, path: &[Vec2], modifiers: Modifiers) -> Guide {
        let guide = Guide::drawn(name, path, modifiers, 2e-3, 2.0).expect("it goes somewhere");
        guide.check().expect("what a hand draws is allowed");
        guide
    }

    const PATH: [Vec2; 2] = [Vec2::new(0.2, 0.3), Vec2::new(0.4, 0.5)];

    #[test]
    fn every_shape_spans_its_drag() {
        for name in Shape::NAMES {
            let guide = drawn(name, &PATH, Modifiers::default());
            assert_eq!(guide.shape.name(), name);
            let outline = guide.outline(2.0);
            let near = |p: Vec2| {
                let places = outline.iter().flatten();
                let away = places.map(|q| ((*q - p) * Vec2::new(2.0, 1.0)).length());
                away.fold(f32::MAX, f32::min)
            };
            let to = match name {
                // Its corners lie outside of it: the middle of a side does not.
                "ellipse" => Vec2::new(0.4, 0.4),
                _ => PATH[1],
            };
            assert!(near(to) < 0.02, "{name}: {}", near(to));
        }
        assert_eq!(
            Guide::drawn("line", &PATH[..1], Modifiers::default(), 0.0, 1.0),
            None
        );
        assert_eq!(
            Guide::drawn("star", &PATH, Modifiers::default(), 0.0, 1.0),
            None
        );
    }

    #[test]
    fn held_keys_constrain_the_shape() {
        let keys = Modifiers {
            proportional: true,
            centered: true,
            ..Modifiers::default()
        };
        let circle = drawn("ellipse", &PATH, keys);
        assert_eq!(circle.center(), PATH[0].to_array());
        let Shape::Ellipse { radii } = circle.shape else {
            panic!()
        };
        assert!((radii[0] - 0.4).abs() < 1e-6 && radii[0] == radii[1]);
        let snapped = drawn(
            "line",
            &[Vec2::ZERO, Vec2::new(0.2, 0.03)],
            Modifiers {
                snap: true,
                ..Modifiers::default()
            },
        );
        let [[from, to]] = snapped.outline(2.0)[..] else {
            panic!()
        };
        assert!((to - from).y.abs() < 1e-6, "{from} {to}");
    }

    #[test]
    fn a_curve_follows_the_hand_and_closes_where_it_comes_back() {
        let wave = |t: f32| Vec2::new(0.1 + 0.8 * t, 0.5 + 0.2 * (TAU * t).sin());
        let path: Vec<Vec2> = (0..=200).map(|i| wave(i as f32 / 200.0)).collect();
        let guide = drawn("curve", &path, Modifiers::default());
        for place in &path {
            let away = guide.distance(*place, 2.0);
            assert!(away < 6e-3, "{place}: {away}");
        }
        let Shape::Curve { points, closed } = &guide.shape else {
            panic!()
        };
        assert!(!closed && points.len() <= 16, "{}", points.len());
        let ring = |t: f32| Vec2::new(0.5, 0.5) + Vec2::from_angle(TAU * t) * 0.2;
        let path: Vec<Vec2> = (0..99).map(|i| ring(i as f32 / 100.0)).collect();
        let guide = drawn("curve", &path, Modifiers::default());
        assert!(guide.contains(Vec2::splat(0.5), 2.0));
        assert!(guide.distance(ring(0.99), 2.0) < 0.01);
    }

    #[test]
    fn a_simple_bow_takes_few_points_even_of_a_rough_hand() {
        // Whole pixels of a map that is 400 high, and few of them.
        for n in [9, 40, 160] {
            let bow = |i: i32| {
                let t = i as f32 / n as f32;
                let at = Vec2::new(60.0 + 200.0 * t, 100.0 + 240.0 * t * (1.0 - t));
                at.round() / Vec2::new(800.0, 400.0)
            };
            let path: Vec<Vec2> = (0..=n).map(bow).collect();
            let Shape::Curve { points, closed } =
                Guide::drawn("curve", &path, Modifiers::default(), 2.0 / 400.0, 2.0)
                    .unwrap()
                    .shape
            else {
                panic!()
            };
            assert!(!closed && points.len() <= 7, "{n}: {}", points.len());
        }
        let ring = |i: i32| Vec2::new(0.5, 0.5) + Vec2::from_angle(TAU * i as f32 / 60.0) * 0.2;
        let path: Vec<Vec2> = (0..60).map(ring).collect();
        let Shape::Curve { points, closed } = drawn("curve", &path, Modifiers::default()).shape
        else {
            panic!()
        };
        assert!(closed && points.len() <= 15, "{points:?}");
        assert_eq!(points.len() % 3, 0);
        let knots: Vec<Vec2> = points.iter().step_by(3).map(|p| Vec2::from(*p)).collect();
        for (i, a) in knots.iter().enumerate() {
            assert!(
                knots[..i].iter().all(|b| a.distance(*b) > 0.05),
                "{knots:?}"
            );
        }
    }
}
