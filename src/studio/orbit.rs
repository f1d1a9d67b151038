//! The hand on the camera: a turntable around what is looked at, and the hand on the light.
//!
//! The camera is kept as heading and elevation around its target, so that up stays up, however long it is turned; the
//! elevation stops short of the poles, where a turntable would flip over.

use crate::preview::Light;
use crate::raster::{Camera, Projection};
use glam::{Quat, Vec2, Vec3};
use serde::{Deserialize, Serialize};

/// How far up and down the eye may go, radians.
const ELEVATION_MAX: f32 = 1.553; // 89 degrees
/// How much closer or farther than its first distance the eye may come.
const ZOOM_RANGE: f32 = 200.0;

/// Which mouse buttons move the camera.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Preset {
    /// Alt with the left, middle and right button: turn, move, zoom.
    #[default]
    Alt,
    /// The middle button alone, with Shift, with Ctrl: turn, move, zoom.
    Middle,
}

/// A mouse button.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Button {
    /// The left one, or the pen's tip.
    Left,
    /// The middle one, or the wheel pressed.
    Middle,
    /// The right one.
    Right,
}

/// What a drag over the 3D view does.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Drag {
    /// Turns the camera around its target.
    Turn,
    /// Moves camera and target sideways.
    Pan,
    /// Moves the camera toward its target and away.
    Zoom,
    /// Turns the lights.
    Light,
    /// The tool's own: a stroke.
    Tool,
}

impl Preset {
    /// Every preset.
    pub const ALL: [Self; 2] = [Self::Alt, Self::Middle];

    /// What the settings call it.
    pub fn name(self) -> &'static str {
        match self {
            Self::Alt => "Alt and left, middle, right button",
            Self::Middle => "Middle button, with Shift and Ctrl",
        }
    }

    /// What a drag with a button and the modifiers Ctrl, Alt, Shift does; `None` for nothing.
    ///
    /// Both presets know what is free in the other: a hand that has learned one finds its way.
    pub fn drag(self, button: Button, ctrl: bool, alt: bool, shift: bool) -> Option<Drag> {
        match (button, alt) {
            (Button::Right, false) if shift => Some(Drag::Light),
            (Button::Left, true) => Some(Drag::Turn),
            (Button::Middle, true) => Some(Drag::Pan),
            (Button::Right, true) => Some(Drag::Zoom),
            (Button::Left, false) => Some(Drag::Tool),
            (Button::Middle, false) => Some(match self {
                Self::Middle if ctrl => Drag::Zoom,
                Self::Middle if !shift => Drag::Turn,
                _ => Drag::Pan,
            }),
            (Button::Right, false) => None,
        }
    }
}

/// A camera held by hand.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Orbit {
    /// What it turns around.
    target: Vec3,
    /// Radians around the vertical, 0 where the eye is on +z.
    heading: f32,
    /// Radians above the horizon.
    elevation: f32,
    distance: f32,
    /// The distance it began with, which bounds the zoom.
    home_distance: f32,
    projection: Projection,
}

impl Orbit {
    /// Takes hold of a camera. Its `up` is taken to be +y.
    pub fn of(camera: &Camera) -> Self {
        let back = camera.eye - camera.target;
        let distance = back.length().max(1e-6);
        let elevation = (back.y / distance).clamp(-1.0, 1.0).asin();
        let flat = Vec2::new(back.x, back.z);
        // Straight above, the heading is in what is up in the picture.
        let heading = if flat.length() > 1e-4 * distance {
            back.x.atan2(back.z)
        } else {
            (-camera.up.x * back.y.signum()).atan2(-camera.up.z * back.y.signum())
        };
        Self {
            target: camera.target,
            heading,
            elevation: elevation.clamp(-ELEVATION_MAX, ELEVATION_MAX),
            distance,
            home_distance: distance,
            projection: camera.projection,
        }
    }

    /// The camera that it holds.
    pub fn camera(&self) -> Camera {
        Camera {
            eye: self.target + self.back() * self.distance,
            target: self.target,
            up: Vec3::Y,
            projection: self.projection_now(),
        }
    }

    /// Degrees around the vertical, 0 to 360, 0 where the eye is on +z.
    pub fn heading_degrees(&self) -> f32 {
        self.heading.to_degrees().rem_euclid(360.0)
    }

    /// Degrees above the horizon, -89 to 89.
    pub fn elevation_degrees(&self) -> f32 {
        self.elevation.to_degrees()
    }

    /// How far the eye is from what it turns around, in the mesh's units.
    pub fn distance(&self) -> f32 {
        self.distance
    }

    fn projection_now(&self) -> Projection {
        match self.projection {
            // Of an orthographic camera the zoom is in its extent.
            Projection::Orthographic { extent } => Projection::Orthographic {
                extent: extent * self.distance / self.home_distance,
            },
            perspective @ Projection::Perspective { .. } => perspective,
        }
    }

    fn back(&self) -> Vec3 {
        let (sin, cos) = self.elevation.sin_cos();
        Vec3::new(cos * self.heading.sin(), sin, cos * self.heading.cos())
    }

    /// Turns by a drag of so many heights of the picture, x to the right and y down: the surface follows the pointer. One
    /// height is half a turn.
    pub fn turn(&mut self, drag: Vec2) {
        let (x, y) = finite(drag);
        let turn = std::f32::consts::PI;
        self.heading = (self.heading - x * turn).rem_euclid(2.0 * turn);
        self.elevation = (self.elevation + y * turn).clamp(-ELEVATION_MAX, ELEVATION_MAX);
    }

    /// Moves target and eye by a drag of so many heights of the picture; what is at the target's distance follows the pointer.
    pub fn pan(&mut self, drag: Vec2) {
        let (x, y) = finite(drag);
        let [right, up, _] = self.camera().basis();
        let height = match self.projection_now() {
            Projection::Perspective { fov } => 2.0 * self.distance * (0.5 * fov.to_radians()).tan(),
            Projection::Orthographic { extent } => extent,
        };
        let moved = self.target + (up * y - right * x) * height;
        if moved.length() < 1e6 * self.home_distance {
            self.target = moved;
        }
    }

    /// Comes closer by so many steps of the wheel (negative: farther), each a tenth of the way.
    pub fn zoom(&mut self, steps: f32) {
        let steps = if steps.is_finite() {
            steps.clamp(-50.0, 50.0)
        } else {
            0.0
        };
        let (near, far) = (
            self.home_distance / ZOOM_RANGE,
            self.home_distance * ZOOM_RANGE,
        );
        self.distance = (self.distance * 0.9f32.powf(steps)).clamp(near, far);
    }
}

fn finite(drag: Vec2) -> (f32, f32) {
    if drag.is_finite() {
        (drag.x, drag.y)
    } else {
        (0.0, 0.0)
    }
}

/// Turns every light by a drag of so many heights of the picture around the camera's own axes: light from the upper left goes
/// to the right with the pointer. Lamps turn around the target.
pub fn turn_lights(lights: &mut [Light], camera: &Camera, drag: Vec2) {
    let (x, y) = finite(drag);
    let [right, up, _] = camera.basis();
    let pi = std::f32::consts::PI;
    let turn = Quat::from_axis_angle(up, x * pi) * Quat::from_axis_angle(right, y * pi);
    for light in lights {
        match light {
            Light::Directional { toward, .. } => *toward = turn * *toward,
            Light::Point { position, .. } => {
                *position = camera.target + turn * (*position - camera.target);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn camera() -> Camera {
        Camera {
            eye: Vec3::new(1.0, 2.0, 4.0),
            target: Vec3::new(0.0, 0.5, 0.0),
            up: Vec3::Y,
            projection: Projection::default(),
        }
    }

    #[test]
    fn taking_hold_moves_nothing() {
        let held = Orbit::of(&camera()).camera();
        assert!((held.eye - camera().eye).length() < 1e-5, "{held:?}");
        assert_eq!(held.target, camera().target);
        for eye in [Vec3::new(0.0, 3.0, 0.0), Vec3::new(0.0, -3.0, 0.0)] {
            let up = Vec3::new(0.6, 0.0, -0.8);
            let above = Camera {
                eye,
                target: Vec3::ZERO,
                up,
                ..camera()
            };
            let before = above.basis();
            let after = Orbit::of(&above).camera().basis();
            assert!(before[0].dot(after[0]) > 0.999, "{before:?} {after:?}");
        }
    }

    #[test]
    fn turning_keeps_the_distance_and_up_stays_up() {
        let mut orbit = Orbit::of(&camera());
        let distance = camera().eye.distance(camera().target);
        for i in 0..1000 {
            orbit.turn(Vec2::new(0.37, if i % 300 < 150 { 0.1 } else { -0.1 }));
            let now = orbit.camera();
            assert!((now.eye.distance(now.target) - distance).abs() < 1e-4);
            assert!(now.basis()[1].y > 0.0, "never upside down");
            assert!(now.check().is_ok());
        }
    }

    #[test]
    fn the_surface_follows_the_pointer() {
        let mut orbit = Orbit::of(&camera());
        let [right, up, _] = orbit.camera().basis();
        orbit.turn(Vec2::new(0.01, 0.0));
        assert!((orbit.camera().eye - camera().eye).dot(right) < 0.0);
        let mut orbit = Orbit::of(&camera());
        orbit.turn(Vec2::new(0.0, 0.01));
        assert!((orbit.camera().eye - camera().eye).dot(up) > 0.0);
        let mut orbit = Orbit::of(&camera());
        orbit.pan(Vec2::new(0.5, 0.25));
        let moved = orbit.camera().target - camera().target;
        assert!(moved.dot(right) < 0.0 && moved.dot(up) > 0.0, "{moved}");
    }

    #[test]
    fn zoom_has_ends_and_rubbish_does_nothing() {
        let mut orbit = Orbit::of(&camera());
        (0..100).for_each(|_| orbit.zoom(50.0));
        assert!(orbit.camera().check().is_ok());
        (0..200).for_each(|_| orbit.zoom(-50.0));
        assert!(orbit.camera().check().is_ok());
        let before = Orbit::of(&camera());
        let mut after = before;
        after.turn(Vec2::new(f32::NAN, 1.0));
        after.pan(Vec2::new(f32::INFINITY, 0.0));
        after.zoom(f32::NAN);
        assert_eq!(before, after);
    }

    #[test]
    fn an_orthographic_camera_zooms_by_its_extent() {
        let flat = Camera {
            projection: Projection::Orthographic { extent: 2.0 },
            ..camera()
        };
        let mut orbit = Orbit::of(&flat);
        orbit.zoom(1.0);
        let Projection::Orthographic { extent } = orbit.camera().projection else {
            panic!()
        };
        assert!((extent - 1.8).abs() < 1e-4);
    }

    #[test]
    fn lights_turn_with_the_pointer_and_keep_their_distance() {
        let (camera, mut lights) = (
            camera(),
            vec![
                Light::Directional {
                    toward: Vec3::new(1.0, 2.0, 4.0),
                    irradiance: [1.0; 3],
                },
                Light::Point {
                    position: Vec3::new(0.0, 0.5, 2.0),
                    intensity: [1.0; 3],
                },
            ],
        );
        turn_lights(&mut lights, &camera, Vec2::new(0.1, 0.0));
        let right = camera.basis()[0];
        let Light::Directional { toward, .. } = lights[0] else {
            panic!()
        };
        let Light::Point { position, .. } = lights[1] else {
            panic!()
        };
        assert!(toward.dot(right) > Vec3::new(1.0, 2.0, 4.0).dot(right));
        assert!((position.distance(camera.target) - 2.0).abs() < 1e-5);
    }

    #[test]
    fn both_presets_turn_move_zoom_and_light() {
        let alt = |b| Preset::Alt.drag(b, false, true, false);
        assert_eq!(alt(Button::Left), Some(Drag::Turn));
        assert_eq!(alt(Button::Middle), Some(Drag::Pan));
        assert_eq!(alt(Button::Right), Some(Drag::Zoom));
        let middle = |ctrl, shift| Preset::Middle.drag(Button::Middle, ctrl, false, shift);
        assert_eq!(middle(false, false), Some(Drag::Turn));
        assert_eq!(middle(false, true), Some(Drag::Pan));
        assert_eq!(middle(true, false), Some(Drag::Zoom));
        for preset in Preset::ALL {
            assert_eq!(
                preset.drag(Button::Right, false, false, true),
                Some(Drag::Light)
            );
            assert_eq!(
                preset.drag(Button::Left, true, false, false),
                Some(Drag::Tool)
            );
        }
    }
}
