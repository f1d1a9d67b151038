//! One guide: its shape, where it stands, and which way it leads.

use crate::error::{Error, Result};
use crate::pattern::{Parameter, check};
use glam::Vec2;
use serde::{Deserialize, Serialize};

/// The most points that one guide may have.
pub const POINTS_MAX: usize = 1024;

/// One guide. Positions are in UV units, v up; distances in surface units (the height of one turn of UV is 1); angles in
/// degrees, counter-clockwise.
///
/// A guide stands at `center`, turned by `rotation` about it and sized by `scale`; a shape's own numbers never change by
/// being moved, so every guide stays editable. [`Guide::handles`] and [`Guide::drag`] do the same by hand.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Guide {
    /// Its shape.
    pub shape: Shape,
    /// Which way it leads the direction. Default `concentric`.
    #[serde(default)]
    pub mode: Mode,
    /// Turns the direction that the mode gives; of `constant`, the direction itself, from the guide's own x axis.
    /// Degrees, -360 to 360. Default 0.
    #[serde(default)]
    pub angle: f32,
    /// How firmly it holds: 1 is exact, at 0.5 it yields to its neighbours over about its falloff, 0 is nothing. Default 1.
    #[serde(default = "one")]
    pub strength: f32,
    /// How far outside its shape its hold ends, surface units, 0 to 10; never under two cells of the grid. Default 0.05.
    #[serde(default = "default_falloff")]
    pub falloff: f32,
    /// Where it stands, [u, v], -10 to 10. Default: the middle of the map; of a line or curve [0, 0], so that its points
    /// are plain UV positions.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub center: Option<[f32; 2]>,
    /// How far it is turned about its centre, degrees, -360 to 360. Default 0.
    #[serde(default)]
    pub rotation: f32,
    /// How much larger than its own numbers say it is, 0.01 to 100; the falloff stays. Default 1.
    #[serde(default = "one")]
    pub scale: f32,
}

fn one() -> f32 {
    1.0
}

fn default_falloff() -> f32 {
    0.05
}

/// Which way a guide leads the direction where it holds: inside a rectangle, ellipse, spiral or closed path and out to its
/// falloff; along an open one, to its falloff on both sides.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Mode {
    /// Along the outline and the lines that follow it inward and outward.
    #[default]
    Concentric,
    /// Across them.
    Radial,
    /// One direction, which turns with the guide.
    Constant,
    /// No direction of its own: what guides before it in the list lay is let go here, and the field closes smoothly.
    Smooth,
}

/// What a guide is drawn as.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum Shape {
    /// Straight pieces from point to point.
    Line {
        /// At least two points (closed: three), from the guide's centre, UV units, -10 to 10.
        points: Vec<[f32; 2]>,
        /// Whether the last point joins the first; what lies inside then belongs to the guide. Default false.
        #[serde(default)]
        closed: bool,
    },
    /// A path of cubic Bézier curves.
    Curve {
        /// A point on the path, two that pull it, a point on it, and so on: 4, 7, 10 ... points (closed: 6, 9 ...), from the
        /// guide's centre, UV units, -10 to 10.
        points: Vec<[f32; 2]>,
        /// Whether the last piece ends at the first point; what lies inside then belongs to the guide. Default false.
        #[serde(default)]
        closed: bool,
    },
    /// A rectangle. Its lines keep their distance from its sides, as those of a picture frame do.
    Rectangle {
        /// Width and height, surface units, 0.001 to 10.
        size: [f32; 2],
        /// Radius of its corners, surface units, 0 to 10. Default 0.
        #[serde(default)]
        corner: f32,
    },
    /// An ellipse; a circle where both radii are equal. Its lines are smaller and larger copies of itself.
    Ellipse {
        /// Along its own x and y axis, surface units, 0.001 to 10.
        radii: [f32; 2],
    },
    /// A disc of one groove that winds outward counter-clockwise by the same step every turn (Archimedes).
    Spiral {
        /// Of the disc, surface units, 0.001 to 10.
        radius: f32,
        /// Outward step of one turn, surface units; below 0 it winds the other way; -10 to 10.
        pitch: f32,
    },
}

impl Shape {
    /// The words for the shapes in a recipe.
    pub const NAMES: [&str; 5] = ["line", "curve", "rectangle", "ellipse", "spiral"];

    /// Its word in a recipe.
    pub fn name(&self) -> &'static str {
        match self {
            Self::Line { .. } => "line",
            Self::Curve { .. } => "curve",
            Self::Rectangle { .. } => "rectangle",
            Self::Ellipse { .. } => "ellipse",
            Self::Spiral { .. } => "spiral",
        }
    }

    /// Its points and whether they are closed; none where it has no points.
    pub fn points(&self) -> Option<(&[[f32; 2]], bool)> {
        match self {
            Self::Line { points, closed } | Self::Curve { points, closed } => {
                Some((points, *closed))
            }
            _ => None,
        }
    }

    fn check(&self, at: &str) -> Result<()> {
        let Some((points, closed)) = self.points() else {
            return Ok(());
        };
        let (n, curve) = (points.len(), matches!(self, Self::Curve { .. }));
        let (fits, allowed) = match (curve, closed) {
            (false, false) => (n >= 2, "2 or more"),
            (false, true) => (n >= 3, "3 or more where the line is closed"),
            (true, false) => (n >= 4 && n % 3 == 1, "4, 7, 10 and so on"),
            (true, true) => (
                n >= 6 && n.is_multiple_of(3),
                "6, 9, 12 and so on where the curve is closed",
            ),
        };
        if fits && n <= POINTS_MAX {
            return Ok(());
        }
        Err(Error::invalid(
            format!("{at}.{}.points", self.name()),
            format!("a list of {n}"),
            format!("allowed: {allowed}, at most {POINTS_MAX}"),
        ))
    }
}

impl Guide {
    /// A guide of this shape with every other key at its default.
    pub fn new(shape: Shape) -> Self {
        Self {
            shape,
            mode: Mode::default(),
            angle: 0.0,
            strength: 1.0,
            falloff: default_falloff(),
            center: None,
            rotation: 0.0,
            scale: 1.0,
        }
    }

    /// Where it stands, [u, v]: `center` or its default.
    pub fn center(&self) -> [f32; 2] {
        let middle = match self.shape.points() {
            Some(_) => [0.0; 2],
            None => [0.5; 2],
        };
        self.center.unwrap_or(middle)
    }

    /// Its numbers with units and ranges; those of a shape begin with `shape.` and its word.
    pub const PARAMETERS: &[Parameter] = &[
        Parameter::angle(
            "angle",
            "turns what the mode gives; of `constant`, the direction itself",
        ),
        Parameter::fraction(
            "strength",
            "how firmly it holds: 1 is exact, 0.5 yields over about the falloff",
        ),
        Parameter::new(
            "falloff",
            "surface units",
            0.0..=10.0,
            "how far outside its shape its hold ends; at least two cells of the grid",
        ),
        Parameter::new(
            "center",
            "UV units",
            -10.0..=10.0,
            "where it stands; default [0.5, 0.5], of a line or curve [0, 0]",
        ),
        Parameter::angle("rotation", "turns it about its centre"),
        Parameter::new("scale", "", 0.01..=100.0, "sizes it, without its falloff"),
        Parameter::new(
            "shape.line.points",
            "UV units",
            -10.0..=10.0,
            "corner by corner, from the centre",
        ),
        Parameter::new(
            "shape.curve.points",
            "UV units",
            -10.0..=10.0,
            "cubic Bézier pieces: on the path, two beside it, on it ...",
        ),
        Parameter::new(
            "shape.rectangle.size",
            "surface units",
            1e-3..=10.0,
            "width and height",
        ),
        Parameter::new(
            "shape.rectangle.corner",
            "surface units",
            0.0..=10.0,
            "radius of the corners",
        ),
        Parameter::new(
            "shape.ellipse.radii",
            "surface units",
            1e-3..=10.0,
            "along its own axes; a circle where equal",
        ),
        Parameter::new(
            "shape.spiral.radius",
            "surface units",
            1e-3..=10.0,
            "of its disc",
        ),
        Parameter::new(
            "shape.spiral.pitch",
            "surface units",
            -10.0..=10.0,
            "outward step of a counter-clockwise turn",
        ),
    ];

    /// Checks every number against its range and the points against their shape.
    ///
    /// # Errors
    /// [`Error::Invalid`] whose `what` is the key inside the guide's table.
    pub fn check(&self) -> Result<()> {
        self.shape.check("shape")?;
        check(self, Self::PARAMETERS)?;
        if self.mode == Mode::Smooth && self.angle != 0.0 {
            return Err(Error::invalid(
                "angle",
                self.angle,
                "allowed: none where the mode is `smooth`, which has no direction",
            ));
        }
        Ok(())
    }

    /// How the guide's own coordinates become surface units.
    pub(super) fn placement(&self, aspect: f32) -> Placement {
        let turn = f64::from(self.rotation).rem_euclid(360.0).to_radians();
        // Quarter turns are exact, so that a turned guide gives the turned field.
        let (sin, cos) = match self.rotation.rem_euclid(360.0) {
            0.0 => (0.0, 1.0),
            90.0 => (1.0, 0.0),
            180.0 => (0.0, -1.0),
            270.0 => (-1.0, 0.0),
            _ => (turn.sin() as f32, turn.cos() as f32),
        };
        let extent = Vec2::new(aspect, 1.0);
        Placement {
            center: Vec2::from(self.center()) * extent,
            x_axis: Vec2::new(cos, sin),
            scale: self.scale,
            extent,
        }
    }

    /// A point given from the centre in UV units, in surface units.
    pub(super) fn placed(&self, point: [f32; 2], place: &Placement) -> Vec2 {
        place.outward(Vec2::from(point) * place.extent)
    }
}

/// Where a guide stands: local coordinates are surface units from its centre, before it is turned and sized.
#[derive(Clone, Copy, Debug)]
pub(super) struct Placement {
    /// In surface units.
    pub(super) center: Vec2,
    /// The direction of its own x axis.
    pub(super) x_axis: Vec2,
    pub(super) scale: f32,
    /// Of one turn of UV.
    pub(super) extent: Vec2,
}

impl Placement {
    /// From local coordinates to the surface.
    pub(super) fn outward(&self, local: Vec2) -> Vec2 {
        self.center + self.x_axis.rotate(local * self.scale)
    }

    /// From the surface to local coordinates.
    pub(super) fn inward(&self, p: Vec2) -> Vec2 {
        let back = Vec2::new(self.x_axis.x, -self.x_axis.y);
        back.rotate(p - self.center) / self.scale
    }
}

/// A straight piece of a guide's path, with the directions it has at its ends as double angles.
#[derive(Clone, Copy, Debug)]
pub(super) struct Segment {
    pub(super) from: Vec2,
    pub(super) to: Vec2,
    pub(super) axis_from: Vec2,
    pub(super) axis_to: Vec2,
}

/// (cos 2θ, sin 2θ) of a vector; zero where it has no length.
pub(super) fn double_angle(v: Vec2) -> Vec2 {
    let square = v.length_squared();
    if square > 0.0 {
        Vec2::new(v.x * v.x - v.y * v.y, 2.0 * v.x * v.y) / square
    } else {
        Vec2::ZERO
    }
}

impl Guide {
    /// The pieces of a line or curve on the surface, bent pieces cut so that they stay within `accuracy` surface units of
    /// the curve, and corners of a line cut off by at most `corner` of their sides; none for other shapes.
    pub(super) fn segments(&self, aspect: f32, accuracy: f32, corner: f32) -> Vec<Segment> {
        let Some((points, closed)) = self.shape.points() else {
            return Vec::new();
        };
        let place = self.placement(aspect);
        let mut points: Vec<Vec2> = points.iter().map(|&p| self.placed(p, &place)).collect();
        if closed && let Some(&first) = points.first() {
            points.push(first);
        }
        let mut segments = Vec::new();
        if matches!(self.shape, Shape::Curve { .. }) {
            for i in (0..points.len().saturating_sub(3)).step_by(3) {
                let piece = [points[i], points[i + 1], points[i + 2], points[i + 3]];
                flatten(piece, accuracy, &mut segments);
            }
        } else {
            let points = cut_corners(&points, closed, corner);
            segments.extend(points.windows(2).map(|ends| {
                let axis = double_angle(ends[1] - ends[0]);
                Segment {
                    from: ends[0],
                    to: ends[1],
                    axis_from: axis,
                    axis_to: axis,
                }
            }));
        }
        segments.retain(|s| s.from != s.to);
        segments
    }
}

/// The corners of a line, each as the two points that lie `by` before and behind it, or a quarter of the way to the next.
/// A closed line ends where it begins, here too.
fn cut_corners(points: &[Vec2], closed: bool, by: f32) -> Vec<Vec2> {
    let toward = |from: Vec2, to: Vec2| from + (to - from) * (by / from.distance(to)).min(0.25);
    let n = points.len();
    let mut cut = Vec::with_capacity(2 * n);
    for (i, &point) in points.iter().enumerate() {
        let before = match i {
            0 if closed => Some(points[n - 2]),
            0 => None,
            _ => Some(points[i - 1]),
        };
        let behind = points.get(i + 1).copied();
        if let Some(before) = before.filter(|b| *b != point && (behind.is_some() || closed)) {
            cut.push(toward(point, before));
        } else {
            cut.push(point);
        }
        if let Some(behind) = behind.filter(|b| *b != point && before.is_some()) {
            cut.push(toward(point, behind));
        }
    }
    cut
}

/// The most straight pieces of one cubic.
const PIECES_MAX: f32 = 64.0;

/// Cuts a cubic into as many equal steps of its parameter as keep it within `accuracy` of the curve (Wang 1984: the square
/// root of 3/4 of the largest second difference over the accuracy).
fn flatten(p: [Vec2; 4], accuracy: f32, segments: &mut Vec<Segment>) {
    let bend = (p[0] - 2.0 * p[1] + p[2])
        .length()
        .max((p[1] - 2.0 * p[2] + p[3]).length());
    let n = (0.75 * bend / accuracy)
        .sqrt()
        .ceil()
        .clamp(1.0, PIECES_MAX);
    let at = |t: f32| {
        let s = 1.0 - t;
        s * s * s * p[0] + 3.0 * s * s * t * p[1] + 3.0 * s * t * t * p[2] + t * t * t * p[3]
    };
    let axis = |t: f32| {
        let s = 1.0 - t;
        let d = s * s * (p[1] - p[0]) + 2.0 * s * t * (p[2] - p[1]) + t * t * (p[3] - p[2]);
        // Where a pulling point lies on its end, the next one tells the direction.
        let flat = 1e-6 * bend.max((p[3] - p[0]).length());
        let candidates = if t < 0.5 {
            [d, p[2] - p[0], p[3] - p[0]]
        } else {
            [d, p[3] - p[1], p[3] - p[0]]
        };
        let known = candidates.into_iter().find(|v| v.length() > flat);
        double_angle(known.unwrap_or(Vec2::ZERO))
    };
    let (mut from, mut axis_from) = (p[0], axis(0.0));
    for i in 1..=n as u32 {
        let t = i as f32 / n;
        let (to, axis_to) = (if t == 1.0 { p[3] } else { at(t) }, axis(t));
        segments.push(Segment {
            from,
            to,
            axis_from,
            axis_to,
        });
        (from, axis_from) = (to, axis_to);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_shape_has_as_many_points_as_it_needs() {
        let line = |n: usize, closed| {
            let points = (0..n).map(|i| [i as f32 * 0.1 % 1.0, 0.5]).collect();
            Guide::new(Shape::Line { points, closed }).check()
        };
        assert!(line(2, false).is_ok() && line(1, false).is_err());
        assert!(line(3, true).is_ok() && line(2, true).is_err());
        let e = line(POINTS_MAX + 1, false).unwrap_err().to_string();
        assert!(e.contains("shape.line.points") && e.contains("1024"), "{e}");
        let curve = |n: usize, closed| {
            let points = vec![[0.5, 0.5]; n];
            Guide::new(Shape::Curve { points, closed }).check()
        };
        for n in 0..12 {
            assert_eq!(curve(n, false).is_ok(), [4, 7, 10].contains(&n), "{n}");
            assert_eq!(curve(n, true).is_ok(), [6, 9].contains(&n), "{n}");
        }
    }

    #[test]
    fn numbers_are_held_against_their_ranges() {
        let circle = Guide::new(Shape::Ellipse { radii: [0.3; 2] });
        assert!(circle.check().is_ok());
        let wrong: [(&str, Guide); 5] = [
            (
                "strength",
                Guide {
                    strength: 1.5,
                    ..circle.clone()
                },
            ),
            (
                "falloff",
                Guide {
                    falloff: f32::NAN,
                    ..circle.clone()
                },
            ),
            (
                "center",
                Guide {
                    center: Some([0.0, f32::INFINITY]),
                    ..circle.clone()
                },
            ),
            (
                "shape.ellipse.radii",
                Guide::new(Shape::Ellipse { radii: [0.3, 0.0] }),
            ),
            (
                "angle",
                Guide {
                    mode: Mode::Smooth,
                    angle: 3.0,
                    ..circle.clone()
                },
            ),
        ];
        for (key, guide) in wrong {
            let e = guide.check().unwrap_err().to_string();
            assert!(e.starts_with(key) && e.contains("allowed"), "{e}");
        }
    }

    #[test]
    fn a_flattened_curve_stays_on_the_curve_and_ends_where_it_ends() {
        // A quarter circle to 3e-4 of its radius.
        let k = 0.552_284_8;
        let points = vec![[1.0, 0.0], [1.0, k], [k, 1.0], [0.0, 1.0]];
        let guide = Guide::new(Shape::Curve {
            points,
            closed: false,
        });
        let segments = guide.segments(1.0, 1e-4, 0.0);
        assert!(segments.len() > 8 && segments.len() <= 64);
        assert_eq!(segments[0].from, Vec2::X);
        assert_eq!(segments[segments.len() - 1].to, Vec2::Y);
        for s in &segments {
            let middle = 0.5 * (s.from + s.to);
            assert!((middle.length() - 1.0).abs() < 5e-4, "{middle}");
            let tangent = double_angle(s.from.perp());
            assert!((tangent - s.axis_from).length() < 5e-3);
        }
    }

    #[test]
    fn corners_are_cut_and_a_closed_line_closes() {
        let square = [Vec2::ZERO, Vec2::X, Vec2::ONE, Vec2::Y, Vec2::ZERO];
        let cut = cut_corners(&square, true, 0.1);
        assert_eq!(cut.first().map(|p| p.y), Some(0.1));
        assert!((cut[0] - cut[cut.len() - 1]).length() < 1e-6);
        assert_eq!(cut.len(), 2 * 4 + 1);
        let open = cut_corners(&square[..3], false, 0.9);
        let want = [
            Vec2::ZERO,
            Vec2::new(0.75, 0.0),
            Vec2::new(1.0, 0.25),
            Vec2::ONE,
        ];
        assert_eq!(open, want);
        assert_eq!(cut_corners(&[Vec2::X, Vec2::X], false, 0.1).len(), 2);
        assert_eq!(cut_corners(&square, true, 0.0)[1..3], [Vec2::ZERO, Vec2::X]);
    }

    #[test]
    fn placing_and_its_inverse_agree() {
        let guide = Guide {
            rotation: 33.0,
            scale: 1.7,
            center: Some([0.2, 0.7]),
            ..Guide::new(Shape::Ellipse { radii: [0.3; 2] })
        };
        let place = guide.placement(2.0);
        let p = Vec2::new(0.3, -0.2);
        assert!((place.inward(place.outward(p)) - p).length() < 1e-6);
        assert_eq!(place.outward(Vec2::ZERO), Vec2::new(0.4, 0.7));
    }
}
