//! Where the picture is seen from, and the projection to homogeneous sample coordinates.

use crate::error::{Error, Result};
use crate::map::Size;
use crate::math;
use glam::{DVec3, Vec2, Vec3};
use serde::{Deserialize, Serialize};

/// The near plane's distance as a fraction of the distance to the target. Depth is kept as 1/distance, so a near plane this
/// close costs no precision.
const NEAR: f64 = 1e-4;

/// A camera in world space (y up, right-handed).
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Camera {
    /// Where the eye is.
    pub eye: Vec3,
    /// What it looks at; lies in the middle of the picture.
    pub target: Vec3,
    /// What is up in the picture, any length. Where it is parallel to the line of sight another direction is taken.
    #[serde(default = "up")]
    pub up: Vec3,
    /// How distance shrinks things.
    #[serde(default)]
    pub projection: Projection,
}

fn up() -> Vec3 {
    Vec3::Y
}

/// How a camera projects. Extents are taken across the shorter side of the picture, so what fits stays whole in tall and in
/// wide pictures.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum Projection {
    /// Things shrink with distance.
    Perspective {
        /// Full angle across the shorter side, in degrees, 1 to 170. Default 30.
        fov: f32,
    },
    /// Things keep their size.
    Orthographic {
        /// World units across the shorter side, positive.
        extent: f32,
    },
}

impl Default for Projection {
    fn default() -> Self {
        Self::Perspective { fov: 30.0 }
    }
}

impl Camera {
    /// Checks every number.
    ///
    /// # Errors
    /// When a number is not finite or out of its range, or the eye stands on the target.
    pub fn check(&self) -> Result<()> {
        for (what, v) in [("eye", self.eye), ("target", self.target), ("up", self.up)] {
            if !v.is_finite() {
                let allowed = "allowed: three finite numbers";
                return Err(Error::invalid(format!("camera.{what}"), v, allowed));
            }
        }
        let distance = self.eye.as_dvec3().distance(self.target.as_dvec3());
        if distance < 1e-9 {
            let allowed = "allowed: any place other than camera.target";
            return Err(Error::invalid("camera.eye", self.eye, allowed));
        }
        match self.projection {
            Projection::Perspective { fov } if !(1.0..=170.0).contains(&fov) => {
                Err(Error::invalid(
                    "camera.projection.perspective.fov",
                    fov,
                    "allowed: 1 to 170 degrees",
                ))
            }
            Projection::Orthographic { extent } if !(extent.is_finite() && extent > 0.0) => {
                Err(Error::invalid(
                    "camera.projection.orthographic.extent",
                    extent,
                    "allowed: a positive number of world units",
                ))
            }
            _ => Ok(()),
        }
    }

    /// Right, up and backward (toward the viewer) as unit vectors.
    pub fn basis(&self) -> [Vec3; 3] {
        self.basis_f64().map(|v| v.as_vec3())
    }

    fn basis_f64(&self) -> [DVec3; 3] {
        let back = (self.eye.as_dvec3() - self.target.as_dvec3())
            .try_normalize()
            .unwrap_or(DVec3::Z);
        let up = self.up.as_dvec3().normalize_or(DVec3::Y);
        let right = up.cross(back);
        let right = if right.length() > 1e-6 {
            right.normalize()
        } else {
            back.any_orthonormal_vector()
        };
        [right, back.cross(right), back]
    }
}

/// A vertex in homogeneous sample coordinates: the sample at column x has its centre at x + 0.5, row 0 is the top.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Vertex {
    /// (x w, y w, w).
    pub(super) h: DVec3,
    /// Distance from the eye along the line of sight.
    pub(super) distance: f64,
}

/// A checked camera with a picture's size: takes world points to samples.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct View {
    size: Size,
    eye: DVec3,
    basis: [DVec3; 3],
    /// Samples per unit of x/w.
    scale: f64,
    near: f64,
    /// Distance between eye and target.
    unit: f64,
    perspective: bool,
}

impl View {
    /// `size` counts samples: the picture's size times the supersampling factor.
    ///
    /// # Errors
    /// When the camera's numbers are not allowed; see [`Camera::check`].
    pub fn new(camera: &Camera, size: Size) -> Result<Self> {
        camera.check()?;
        let half = 0.5 * f64::from(size.width().min(size.height()));
        let eye = camera.eye.as_dvec3();
        let unit = eye.distance(camera.target.as_dvec3());
        let (scale, perspective) = match camera.projection {
            Projection::Perspective { fov } => {
                let (sin, cos) = math::sin_cos(0.5 * fov.to_radians());
                (half * f64::from(cos) / f64::from(sin), true)
            }
            Projection::Orthographic { extent } => (half / (0.5 * f64::from(extent)), false),
        };
        Ok(Self {
            size,
            eye,
            basis: camera.basis_f64(),
            scale,
            near: NEAR * unit,
            unit,
            perspective,
        })
    }

    /// Width and height in samples.
    pub fn size(&self) -> Size {
        self.size
    }

    /// The unit vector from a point toward the viewer; for an orthographic camera the same everywhere.
    pub fn toward(&self, point: Vec3) -> Vec3 {
        if self.perspective {
            (self.eye - point.as_dvec3())
                .normalize_or(self.basis[2])
                .as_vec3()
        } else {
            self.basis[2].as_vec3()
        }
    }

    /// Toward the viewer, of any length.
    pub(super) fn toward_any_length(&self, point: Vec3) -> Vec3 {
        if self.perspective {
            (self.eye - point.as_dvec3()).as_vec3()
        } else {
            self.basis[2].as_vec3()
        }
    }

    /// The ray through the centre of a sample: where it starts and its unit direction.
    pub fn ray(&self, column: u32, row: u32) -> (Vec3, Vec3) {
        self.ray_at(f64::from(column) + 0.5, f64::from(row) + 0.5)
    }

    /// The ray through a place of the picture, in samples from its upper left corner.
    pub fn ray_at(&self, x: f64, y: f64) -> (Vec3, Vec3) {
        let [right, up, back] = self.basis;
        let x = (x - 0.5 * f64::from(self.size.width())) / self.scale;
        let y = (0.5 * f64::from(self.size.height()) - y) / self.scale;
        let aside = right * x + up * y;
        if self.perspective {
            (self.eye.as_vec3(), (aside - back).normalize().as_vec3())
        } else {
            ((self.eye + aside).as_vec3(), (-back).as_vec3())
        }
    }

    /// The place of the picture where a point stands, in samples from the upper left corner: the way back of [`View::ray_at`].
    /// `None` for one that is not before the eye.
    pub fn place(&self, point: Vec3) -> Option<Vec2> {
        let vertex = self.project(point)?;
        let place = vertex.h.truncate() / vertex.h.z;
        (vertex.distance > self.near && place.is_finite()).then(|| place.as_vec2())
    }

    /// Distance of the plane that everything nearer is cut off at.
    pub(super) fn near(&self) -> f64 {
        self.near
    }

    /// The middle of the picture, in samples.
    pub(super) fn centre(&self) -> (f64, f64) {
        (
            0.5 * f64::from(self.size.width()),
            0.5 * f64::from(self.size.height()),
        )
    }

    /// `None` for a point that is not finite.
    pub(super) fn project(&self, point: Vec3) -> Option<Vertex> {
        if !point.is_finite() {
            return None;
        }
        let p = point.as_dvec3() - self.eye;
        let [right, up, back] = self.basis;
        let distance = -back.dot(p);
        let w = if self.perspective { distance } else { 1.0 };
        let (cx, cy) = self.centre();
        Some(Vertex {
            h: DVec3::new(
                cx * w + self.scale * right.dot(p),
                cy * w - self.scale * up.dot(p),
                w,
            ),
            distance,
        })
    }

    /// What is linear over the screen and tells distance: for a perspective view 1/w, else the distance itself, in units of the
    /// distance between eye and target. Positive before the eye.
    #[inline(always)]
    pub(super) fn slant(&self, vertex: &Vertex) -> f64 {
        if self.perspective {
            self.unit / vertex.distance
        } else {
            vertex.distance / self.unit
        }
    }

    /// [`View::slant`] at a distance, and what attributes are multiplied by there to be numerators.
    pub(super) fn slant_at(&self, distance: f64) -> (f64, f64) {
        if self.perspective {
            (self.unit / distance, self.unit / distance)
        } else {
            (distance / self.unit, 1.0)
        }
    }

    pub(super) fn is_perspective(&self) -> bool {
        self.perspective
    }

    /// The sign that makes [`View::slant`] larger for what is nearer.
    pub(super) fn nearer(&self) -> f64 {
        if self.perspective { 1.0 } else { -1.0 }
    }

    /// How positions are found again from samples and slants.
    pub fn rays(&self) -> Rays {
        let [right, up, back] = self.basis.map(|v| v.as_vec3());
        let (cx, cy) = self.centre();
        Rays {
            eye: self.eye.as_vec3(),
            right,
            up,
            back,
            centre: [(cx - 0.5) as f32, (cy - 0.5) as f32],
            per_sample: (1.0 / self.scale) as f32,
            unit: self.unit as f32,
            perspective: self.perspective,
        }
    }
}

/// A view as fragments take it: with (x, y) a sample's offset from the middle, to the right and upward, times `per_sample`, a
/// perspective view sees along right x + up y - back.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Rays {
    /// Where the eye is.
    pub eye: Vec3,
    /// To the right, of unit length; so are the next two.
    pub right: Vec3,
    /// Upward in the picture.
    pub up: Vec3,
    /// Toward the viewer.
    pub back: Vec3,
    /// Column and row of the middle of the picture: half a sample for even sizes.
    pub centre: [f32; 2],
    /// World units a sample at distance 1; for an orthographic view at any.
    pub per_sample: f32,
    /// Distance between eye and target.
    pub unit: f32,
    /// Whether things shrink with distance.
    pub perspective: bool,
}

impl Rays {
    /// The distance along the line of sight of what has this [`q`](super::Lanes::q).
    #[inline(always)]
    pub fn distance(&self, q: f32) -> f32 {
        if self.perspective {
            self.unit / q
        } else {
            self.unit * q
        }
    }

    /// The world position of a sample at a distance along the line of sight.
    pub fn position(&self, column: f32, row: f32, distance: f32) -> Vec3 {
        let aside = if self.perspective { distance } else { 1.0 } * self.per_sample;
        let x = (column - self.centre[0]) * aside;
        let y = (self.centre[1] - row) * aside;
        self.eye + self.right * x + self.up * y - self.back * distance
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn camera() -> Camera {
        Camera {
            eye: Vec3::new(0.0, 0.0, 5.0),
            target: Vec3::ZERO,
            up: Vec3::Y,
            projection: Projection::default(),
        }
    }

    #[test]
    fn the_target_is_in_the_middle_and_right_is_right() {
        let view = View::new(&camera(), Size::new(200, 100).unwrap()).unwrap();
        let at = |p| {
            let v = view.project(p).unwrap();
            (v.h.x / v.h.z, v.h.y / v.h.z)
        };
        assert_eq!(at(Vec3::ZERO), (100.0, 50.0));
        assert!(at(Vec3::X).0 > 100.0 && at(Vec3::Y).1 < 50.0);
        let (eye, ray) = view.ray(150, 20);
        let p = view.project(eye + ray * 3.0).unwrap();
        assert!((p.h.x / p.h.z - 150.5).abs() < 1e-3 && (p.h.y / p.h.z - 20.5).abs() < 1e-3);
    }

    #[test]
    fn the_field_of_view_spans_the_shorter_side() {
        for (w, h) in [(200, 100), (100, 200)] {
            let view = View::new(&camera(), Size::new(w, h).unwrap()).unwrap();
            let edge = 5.0 * 15f32.to_radians().tan();
            let v = view.project(Vec3::new(edge, edge, 0.0)).unwrap();
            let short = if w > h {
                v.h.y / v.h.z
            } else {
                100.0 - v.h.x / v.h.z
            };
            assert!(short.abs() < 1e-3, "{w}x{h}: {short}");
        }
    }

    #[test]
    fn impossible_cameras_are_refused_and_looking_straight_down_is_not() {
        let size = Size::new(10, 10).unwrap();
        let refused = |change: fn(&mut Camera)| {
            let mut c = camera();
            change(&mut c);
            View::new(&c, size).unwrap_err().to_string()
        };
        assert!(refused(|c| c.eye = Vec3::NAN).contains("camera.eye"));
        assert!(refused(|c| c.eye = c.target).contains("camera.target"));
        assert!(
            refused(|c| c.projection = Projection::Perspective { fov: 0.0 }).contains("1 to 170")
        );
        assert!(
            refused(|c| c.projection = Projection::Orthographic { extent: -1.0 })
                .contains("positive")
        );
        let mut down = camera();
        down.up = Vec3::Z;
        let view = View::new(&down, size).unwrap();
        assert!(view.project(Vec3::X).unwrap().h.is_finite());
    }
}
