//! Guides by hand: the points an editor shows, what dragging one does, and how far a click lies from a guide.
//!
//! All functions are pure: a guide in, a guide out. Where the map repeats, an editor brings the pointer to the image that it
//! shows. Whatever is dragged wherever, the result passes [`Guide::check`].

use super::shape::{Placement, Shape, double_angle};
use super::{Guide, Mode};
use glam::Vec2;
use std::f32::consts::TAU;

/// What a handle changes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum HandleKind {
    /// `center`.
    Center,
    /// `rotation`; it lies on the guide's own y axis.
    Rotation,
    /// `scale`.
    Scale,
    /// The size along the guide's own x axis: a radius, or half a width.
    Width,
    /// The size along its y axis.
    Height,
    /// A rectangle's `corner`.
    Corner,
    /// A spiral's `pitch`.
    Pitch,
    /// A point of a line or curve.
    Point(usize),
    /// `falloff`.
    Falloff,
}

/// A point to be dragged.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Handle {
    /// What it changes.
    pub kind: HandleKind,
    /// Where it is shown, UV units, v up.
    pub at: Vec2,
}

/// The keys that are held while a handle is dragged.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Modifiers {
    /// Turns by whole steps of 15 degrees.
    pub snap: bool,
    /// Width and height keep their ratio; of a new shape they are equal.
    pub proportional: bool,
    /// A new shape grows from its middle, and not from corner to corner.
    pub centered: bool,
}

pub(super) const SNAP_DEGREES: f32 = 15.0;
/// Pieces that a rim or a turn is drawn with, and the most turns of a spiral that are drawn.
const RIM: u32 = 72;
const TURNS_MAX: f32 = 64.0;
/// How far beyond the shape its rotation handle lies, as a factor.
const ROTATION_BEYOND: f32 = 1.25;

impl Guide {
    /// Its handles on a surface of this aspect, those that lie over others last.
    pub fn handles(&self, aspect: f32) -> Vec<Handle> {
        let place = self.placement(aspect);
        let to_uv = |p: Vec2| p / place.extent;
        let local = |kind, p: Vec2| Handle {
            kind,
            at: to_uv(place.outward(p)),
        };
        let half = self.half();
        let mut handles = vec![
            local(
                HandleKind::Rotation,
                Vec2::new(0.0, half.y * ROTATION_BEYOND),
            ),
            local(HandleKind::Scale, half),
            Handle {
                kind: HandleKind::Falloff,
                at: to_uv(self.falloff_place(&place)),
            },
        ];
        match &self.shape {
            Shape::Ellipse { .. } => {
                handles.push(local(HandleKind::Width, Vec2::new(half.x, 0.0)));
                handles.push(local(HandleKind::Height, Vec2::new(0.0, half.y)));
            }
            Shape::Rectangle { corner, .. } => {
                handles.push(local(HandleKind::Width, Vec2::new(half.x, 0.0)));
                handles.push(local(HandleKind::Height, Vec2::new(0.0, half.y)));
                let at = Vec2::new(half.x - corner.min(half.min_element()), -half.y);
                handles.push(local(HandleKind::Corner, at));
            }
            Shape::Spiral { pitch, .. } => {
                handles.push(local(HandleKind::Width, Vec2::new(half.x, 0.0)));
                handles.push(local(HandleKind::Pitch, Vec2::new(0.0, -pitch)));
            }
            Shape::Line { points, .. } | Shape::Curve { points, .. } => {
                for (i, &point) in points.iter().enumerate() {
                    let at = to_uv(self.placed(point, &place));
                    let kind = HandleKind::Point(i);
                    handles.push(Handle { kind, at });
                }
            }
        }
        handles.push(local(HandleKind::Center, Vec2::ZERO));
        handles
    }

    /// The guide after one of its handles was dragged to `to`, UV units. A handle that it does not have changes nothing.
    #[must_use]
    pub fn drag(&self, kind: HandleKind, to: Vec2, modifiers: Modifiers, aspect: f32) -> Self {
        let mut guide = self.clone();
        if !to.is_finite() {
            return guide;
        }
        let place = self.placement(aspect);
        let at = to * place.extent;
        let local = place.inward(at);
        match kind {
            HandleKind::Center => {
                guide.center = Some(to.clamp(Vec2::splat(-10.0), Vec2::splat(10.0)).into());
            }
            HandleKind::Rotation => guide.turn_toward(at - place.center, modifiers),
            HandleKind::Scale => {
                let factor = local.length() / self.half().length().max(1e-6);
                guide.scale = (self.scale * factor).clamp(0.01, 100.0);
            }
            HandleKind::Falloff => guide.falloff = self.distance(to, aspect).clamp(0.0, 10.0),
            HandleKind::Point(i) => guide.move_point(i, local / place.extent),
            HandleKind::Width => guide.resize(Some(local.x.abs()), None, modifiers),
            HandleKind::Height => guide.resize(None, Some(local.y.abs()), modifiers),
            HandleKind::Corner => {
                if let Shape::Rectangle { size, corner } = &mut guide.shape {
                    let most = 0.5 * size[0].min(size[1]);
                    *corner = (0.5 * size[0] - local.x).clamp(0.0, most);
                }
            }
            HandleKind::Pitch => {
                if let Shape::Spiral { pitch, .. } = &mut guide.shape {
                    *pitch = (-local.y).clamp(-10.0, 10.0);
                }
            }
        }
        guide
    }

    /// Its outline or path as straight pieces from place to place (UV units), for an editor to draw; of a spiral its rim and
    /// its turns.
    pub fn outline(&self, aspect: f32) -> Vec<[Vec2; 2]> {
        let place = self.placement(aspect);
        let to_uv = |p: Vec2| p / place.extent;
        if self.shape.points().is_some() {
            let segments = self.segments(aspect, 1e-3, 0.0);
            return segments
                .iter()
                .map(|s| [to_uv(s.from), to_uv(s.to)])
                .collect();
        }
        let local = |p: Vec2| to_uv(place.outward(p));
        let closed = self
            .rim()
            .windows(2)
            .map(|p| [local(p[0]), local(p[1])])
            .collect::<Vec<_>>();
        let turns = self.turns();
        let turns = turns.windows(2).map(|p| [local(p[0]), local(p[1])]);
        closed.into_iter().chain(turns).collect()
    }

    /// The rim of an ellipse, rectangle or spiral in its own coordinates, closed.
    fn rim(&self) -> Vec<Vec2> {
        let around = |i: u32| Vec2::from_angle(TAU * i as f32 / RIM as f32);
        match &self.shape {
            Shape::Rectangle { size, corner } => {
                let half = 0.5 * Vec2::from(*size);
                let corner = corner.min(half.min_element());
                let round = |i: u32| {
                    // Each quarter turn stands at its own corner.
                    let quarter = [
                        Vec2::ONE,
                        Vec2::new(-1.0, 1.0),
                        -Vec2::ONE,
                        Vec2::new(1.0, -1.0),
                    ];
                    let at = quarter[(4 * i / RIM) as usize % 4];
                    at * (half - corner) + around(i) * corner
                };
                (0..=RIM).map(|i| round(i % RIM)).collect()
            }
            _ => (0..=RIM).map(|i| around(i % RIM) * self.half()).collect(),
        }
    }

    /// The groove of a spiral from its middle outward, in its own coordinates; at most [`TURNS_MAX`] turns.
    fn turns(&self) -> Vec<Vec2> {
        let Shape::Spiral { radius, pitch } = self.shape else {
            return Vec::new();
        };
        let turns = (radius / pitch.abs().max(1e-6)).min(TURNS_MAX);
        let points = (turns * RIM as f32) as u32;
        let at = |i: u32| {
            let turn = i as f32 / RIM as f32;
            Vec2::from_angle(TAU * turn * pitch.signum()) * (turn * pitch.abs()).min(radius)
        };
        (0..=points).map(at).collect()
    }

    /// How far a place (UV units) lies from the guide's outline or path, in surface units: exact but for an ellipse, where
    /// it is so to first order near the outline. Images beyond the map's edge are not looked at.
    pub fn distance(&self, uv: Vec2, aspect: f32) -> f32 {
        let place = self.placement(aspect);
        self.signed_distance(uv, &place).abs()
    }

    /// Whether a place (UV units) lies inside the shape; an open path has no inside.
    pub fn contains(&self, uv: Vec2, aspect: f32) -> bool {
        self.signed_distance(uv, &self.placement(aspect)) < 0.0
    }

    /// Negative inside.
    fn signed_distance(&self, uv: Vec2, place: &Placement) -> f32 {
        let p = uv * place.extent;
        let local = place.inward(p);
        match self.shape {
            Shape::Ellipse { radii } => {
                let radii = Vec2::from(radii);
                let scaled = local / radii;
                let (g, slope) = (scaled.length(), (scaled / radii).length());
                if slope > 1e-6 {
                    g * (g - 1.0) / slope * self.scale
                } else {
                    -radii.min_element() * self.scale
                }
            }
            Shape::Spiral { radius, .. } => (local.length() - radius) * self.scale,
            Shape::Rectangle { size, corner } => {
                let half = 0.5 * Vec2::from(size);
                let corner = corner.min(half.min_element());
                let q = local.abs() - half + corner;
                let outside = q.max(Vec2::ZERO).length();
                (outside + q.max_element().min(0.0) - corner) * self.scale
            }
            Shape::Line { .. } | Shape::Curve { .. } => self.distance_to_path(p, place),
        }
    }

    fn distance_to_path(&self, p: Vec2, place: &Placement) -> f32 {
        let accuracy = 1e-3 * self.scale * self.half().max_element();
        let segments = self.segments(place.extent.x, accuracy.max(1e-6), 0.0);
        let (mut square, mut winding) = (f32::MAX, 0);
        for s in &segments {
            let along = s.to - s.from;
            let t = ((p - s.from).dot(along) / along.length_squared()).clamp(0.0, 1.0);
            square = square.min((p - s.from - t * along).length_squared());
            if (s.from.y <= p.y) != (s.to.y <= p.y) {
                let crossing = s.from.x + along.x * ((p.y - s.from.y) / along.y);
                winding += i32::from(p.x < crossing) * if along.y > 0.0 { 1 } else { -1 };
            }
        }
        let closed = self.shape.points().is_some_and(|(_, closed)| closed);
        let sign = if closed && winding != 0 { -1.0 } else { 1.0 };
        sign * square.sqrt()
    }

    /// Half its size along its own axes, in its own coordinates.
    fn half(&self) -> Vec2 {
        match &self.shape {
            Shape::Ellipse { radii } => Vec2::from(*radii),
            Shape::Rectangle { size, .. } => 0.5 * Vec2::from(*size),
            Shape::Spiral { radius, .. } => Vec2::splat(*radius),
            Shape::Line { points, .. } | Shape::Curve { points, .. } => {
                let points = points.iter().map(|&p| Vec2::from(p).abs());
                points.fold(Vec2::splat(0.05), Vec2::max)
            }
        }
    }

    /// Where the falloff ends on the side away from the rotation handle, or beside a path's first piece.
    fn falloff_place(&self, place: &Placement) -> Vec2 {
        let away = |from: Vec2, along: Vec2| from + along.normalize_or_zero() * self.falloff;
        match self.segments(place.extent.x, 1e-3, 0.0).first() {
            Some(s) => away(0.5 * (s.from + s.to), (s.to - s.from).perp()),
            None => {
                let side = place.outward(Vec2::new(-self.half().x, 0.0));
                away(side, side - place.center)
            }
        }
    }

    /// Turns the guide so that its y axis points along `v`.
    fn turn_toward(&mut self, v: Vec2, modifiers: Modifiers) {
        if v.length() < 1e-6 {
            return;
        }
        let degrees = (-v.x).atan2(v.y).to_degrees();
        self.rotation = if modifiers.snap {
            (degrees / SNAP_DEGREES).round() * SNAP_DEGREES
        } else {
            degrees
        };
    }

    fn move_point(&mut self, i: usize, to: Vec2) {
        if let Shape::Line { points, .. } | Shape::Curve { points, .. } = &mut self.shape
            && let Some(point) = points.get_mut(i)
        {
            *point = to.clamp(Vec2::splat(-10.0), Vec2::splat(10.0)).into();
        }
    }

    /// Sets half a size; the other one follows where the ratio is kept.
    fn resize(&mut self, x: Option<f32>, y: Option<f32>, modifiers: Modifiers) {
        let old = self.half();
        let both = match (x, y) {
            _ if !modifiers.proportional => [x.unwrap_or(old.x), y.unwrap_or(old.y)],
            (Some(x), _) => [x, old.y * x / old.x],
            (None, Some(y)) => [old.x * y / old.y, y],
            (None, None) => old.into(),
        };
        let within = |size: f32| size.clamp(1e-3, 10.0);
        match &mut self.shape {
            Shape::Ellipse { radii } => *radii = both.map(within),
            Shape::Rectangle { size, .. } => *size = both.map(|half| within(2.0 * half)),
            Shape::Spiral { radius, .. } => *radius = within(both[0]),
            Shape::Line { .. } | Shape::Curve { .. } => {}
        }
    }

    /// The direction of a `constant` guide on the surface, as (cos 2θ, sin 2θ), for an editor to draw; none in other modes.
    pub fn constant_axis(&self, aspect: f32) -> Option<Vec2> {
        let own = crate::math::Axis::from_degrees(self.angle).double_angle();
        let turned = double_angle(self.placement(aspect).x_axis);
        (self.mode == Mode::Constant).then(|| own.rotate(turned))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn shapes() -> Vec<Shape> {
        vec![
            Shape::Line {
                points: vec![[0.1, 0.2], [0.7, 0.4], [0.6, 0.9]],
                closed: false,
            },
            Shape::Curve {
                points: vec![[0.1, 0.2], [0.3, 0.4], [0.5, 0.1], [0.9, 0.5]],
                closed: false,
            },
            Shape::Rectangle {
                size: [0.5, 0.3],
                corner: 0.05,
            },
            Shape::Ellipse { radii: [0.3, 0.2] },
            Shape::Spiral {
                radius: 0.3,
                pitch: 0.05,
            },
        ]
    }

    fn placed(shape: Shape) -> Guide {
        Guide {
            rotation: 25.0,
            scale: 1.2,
            center: Some([0.4, 0.6]),
            ..Guide::new(shape)
        }
    }

    fn at(guide: &Guide, kind: HandleKind) -> Vec2 {
        let handles = guide.handles(1.5);
        handles
            .iter()
            .find(|h| h.kind == kind)
            .expect("it has it")
            .at
    }

    #[test]
    fn a_handle_dragged_nowhere_changes_nothing_and_elsewhere_follows() {
        for guide in shapes().into_iter().map(placed) {
            for Handle { kind, at: from } in guide.handles(1.5) {
                let same = guide.drag(kind, from, Modifiers::default(), 1.5);
                for (a, b) in guide.handles(1.5).iter().zip(same.handles(1.5)) {
                    assert!((a.at - b.at).length() < 1e-4, "{kind:?}: {a:?} {b:?}");
                }
                let to = from + Vec2::new(0.02, -0.03);
                let moved = guide.drag(kind, to, Modifiers::default(), 1.5);
                assert!(moved != guide, "{kind:?} of {}", guide.shape.name());
                assert!(moved.check().is_ok());
                // Handles that follow the pointer wholly.
                if matches!(kind, HandleKind::Center | HandleKind::Point(_)) {
                    assert!((at(&moved, kind) - to).length() < 1e-5, "{kind:?}");
                }
            }
        }
    }

    #[test]
    fn turning_snaps_and_sizing_keeps_its_ratio() {
        let guide = placed(Shape::Ellipse { radii: [0.3, 0.2] });
        let keys = Modifiers {
            snap: true,
            proportional: true,
            ..Modifiers::default()
        };
        let up = guide.drag(HandleKind::Rotation, Vec2::new(0.41, 0.9), keys, 1.0);
        assert_eq!(up.rotation, 0.0);
        let Shape::Ellipse { radii } = guide
            .drag(HandleKind::Width, Vec2::new(0.9, 0.9), keys, 1.0)
            .shape
        else {
            panic!("still an ellipse");
        };
        assert!((radii[0] / radii[1] - 1.5).abs() < 1e-5);
    }

    #[test]
    fn the_outline_lies_where_the_distance_is_nothing() {
        for guide in shapes().into_iter().map(placed) {
            let outline = guide.outline(1.5);
            assert!(!outline.is_empty());
            if matches!(guide.shape, Shape::Spiral { .. }) {
                continue; // its turns lie inside
            }
            for [from, to] in outline {
                assert!(
                    guide.distance(from, 1.5) < 4e-3,
                    "{} {from}",
                    guide.shape.name()
                );
                assert!(
                    guide.distance(to, 1.5) < 4e-3,
                    "{} {to}",
                    guide.shape.name()
                );
            }
        }
    }

    #[test]
    fn distances_are_those_of_the_shapes() {
        let circle = Guide::new(Shape::Ellipse { radii: [0.25; 2] });
        let uv = Vec2::new(0.25 + 0.4 / 2.0, 0.5); // 0.1 surface units left of the middle at aspect 2
        assert!((circle.distance(uv, 2.0) - 0.15).abs() < 1e-6);
        assert!(circle.contains(uv, 2.0) && !circle.contains(Vec2::new(0.9, 0.5), 2.0));
        let square = Guide::new(Shape::Rectangle {
            size: [0.4; 2],
            corner: 0.0,
        });
        let corner = Vec2::new(0.7 + 0.03, 0.7 + 0.04);
        assert!((square.distance(corner, 1.0) - 0.05).abs() < 1e-6);
        let line = |closed| {
            Guide::new(Shape::Line {
                points: vec![[0.2, 0.2], [0.8, 0.2], [0.8, 0.8], [0.2, 0.8]],
                closed,
            })
        };
        let inside = Vec2::new(0.3, 0.5);
        assert!((line(true).distance(inside, 1.0) - 0.1).abs() < 1e-6);
        assert!(line(true).contains(inside, 1.0) && !line(false).contains(inside, 1.0));
    }

    proptest! {
        #[test]
        fn wherever_a_handle_is_dragged_the_guide_is_allowed(
            which in 0usize..5,
            handle in 0usize..16,
            x in -1e6f32..1e6,
            y in -30.0f32..30.0,
            aspect in 0.01f32..100.0,
        ) {
            let guide = placed(shapes()[which].clone());
            let handles = guide.handles(aspect);
            let kind = handles[handle % handles.len()].kind;
            let moved = guide.drag(kind, Vec2::new(x, y), Modifiers::default(), aspect);
            prop_assert!(moved.check().is_ok(), "{:?}: {:?}", kind, moved.check());
            prop_assert!(moved.handles(aspect).iter().all(|h| h.at.is_finite()));
        }
    }
}
