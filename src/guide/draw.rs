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
/// The least side of a shape, surface units.
const LEAST: f32 = 1e-3;

impl Guide {
    /// The guide that a drag along `path` (places in UV units) draws on a surface of this aspect: of the shape that `name`, one of
    /// [`Shape::NAMES`], says, ellipses and rectangles from corner to corner, spirals from their middle, lines from end to end, a
    /// curve through all places, within `tremble` surface units. `None` where the path goes nowhere, or there is no such shape.
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

/// Cubic pieces through the corners that a path has beyond its tremble, with the tangents of its neighbours.
fn curve(path: &[Vec2], tremble: f32, extent: Vec2) -> (Shape, Vec2) {
    let long: f32 = path.windows(2).map(|p| p[0].distance(p[1])).sum();
    let mut tremble = tremble.max(1e-4);
    let mut knots = knots(path, tremble);
    while knots.len() > PIECES_MAX {
        tremble *= 1.5;
        knots = self::knots(path, tremble);
    }
    let gap = path[0].distance(path[path.len() - 1]);
    let closed = knots.len() > 3 && gap < CLOSES * long;
    if closed {
        knots.pop();
    }
    let (low, high) = knots.iter().fold((knots[0], knots[0]), |(low, high), k| {
        (low.min(*k), high.max(*k))
    });
    let centre = 0.5 * (low + high);
    let n = knots.len();
    let pieces = if closed { n } else { n - 1 };
    let mut points = vec![knots[0]];
    for i in 0..pieces {
        let (a, b) = (knots[i], knots[(i + 1) % n]);
        let third = a.distance(b) / 3.0;
        points.push(a + tangent(&knots, i, closed) * third);
        points.push(b - tangent(&knots, (i + 1) % n, closed) * third);
        points.push(b);
    }
    if closed {
        points.pop(); // the first one
    }
    let points = points
        .iter()
        .map(|p| ((*p - centre) / extent).into())
        .collect();
    (Shape::Curve { points, closed }, centre)
}

/// The unit tangent at a knot: of the circle through it and its neighbours, or the one toward its only neighbour.
fn tangent(knots: &[Vec2], i: usize, closed: bool) -> Vec2 {
    let n = knots.len();
    let (before, after) = if closed {
        (knots[(i + n - 1) % n], knots[(i + 1) % n])
    } else {
        (knots[i.saturating_sub(1)], knots[(i + 1).min(n - 1)])
    };
    let (back, forth) = (knots[i] - before, after - knots[i]);
    let (b, f) = (back.length(), forth.length());
    if b < 1e-9 || f < 1e-9 {
        return (after - before).normalize_or_zero();
    }
    (back * (f / b) + forth * (b / f)).normalize_or_zero()
}

/// The places of a path that it cannot be told without (Ramer 1972; Douglas and Peucker 1973).
fn knots(path: &[Vec2], tolerance: f32) -> Vec<Vec2> {
    let last = path.len() - 1;
    let mut keep = vec![false; path.len()];
    (keep[0], keep[last]) = (true, true);
    let mut parts = vec![(0, last)];
    while let Some((a, b)) = parts.pop() {
        let along = path[b] - path[a];
        let off = |p: Vec2| {
            let t = ((p - path[a]).dot(along) / along.length_squared().max(1e-12)).clamp(0.0, 1.0);
            (p - path[a] - along * t).length()
        };
        let far = (a + 1..b).max_by(|i, j| off(path[*i]).total_cmp(&off(path[*j])));
        if let Some(far) = far.filter(|i| off(path[*i]) > tolerance) {
            keep[far] = true;
            parts.extend([(a, far), (far, b)]);
        }
    }
    let kept = path.iter().zip(keep).filter(|(_, keep)| *keep);
    kept.map(|(p, _)| *p).collect()
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
        assert!(!closed && points.len() < 100, "{}", points.len());
        let ring = |t: f32| Vec2::new(0.5, 0.5) + Vec2::from_angle(TAU * t) * 0.2;
        let path: Vec<Vec2> = (0..99).map(|i| ring(i as f32 / 100.0)).collect();
        let guide = drawn("curve", &path, Modifiers::default());
        assert!(guide.contains(Vec2::splat(0.5), 2.0));
        assert!(guide.distance(ring(0.99), 2.0) < 0.01);
    }
}
