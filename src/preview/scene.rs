//! Camera, lights, exposure, background and the colours of the surface: everything a picture needs besides mesh and map.

use crate::error::{Error, Result};
use crate::mesh::Mesh;
use crate::raster::{Camera, Projection};
use glam::Vec3;
use serde::{Deserialize, Serialize};

/// The most samples along a pixel's side.
pub const SAMPLES_MAX: u32 = 4;
/// The most lights in a scene: each costs a pass over every sample.
const LIGHTS_MAX: usize = 64;
/// Empty room around a mesh that is framed, as a factor on its extent.
const MARGIN: f32 = 1.1;

/// A light.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "snake_case", deny_unknown_fields)]
pub enum Light {
    /// Light from one direction everywhere, as from the sun.
    Directional {
        /// Toward the light, any length but 0.
        toward: Vec3,
        /// Irradiance of a surface that faces it, linear RGB, 0 to 1e6 each.
        irradiance: [f32; 3],
    },
    /// Light from a place, weaker with the square of the distance.
    Point {
        /// Where it stands.
        position: Vec3,
        /// Irradiance at distance 1, linear RGB, 0 to 1e24 each.
        intensity: [f32; 3],
    },
}

impl Light {
    fn check(&self, i: usize) -> Result<()> {
        let (name, vector, usable, power_name, power) = match *self {
            Self::Directional { toward, irradiance } => {
                let usable = toward.try_normalize().is_some();
                ("toward", toward, usable, "irradiance", irradiance)
            }
            Self::Point {
                position,
                intensity,
            } => (
                "position",
                position,
                position.is_finite(),
                "intensity",
                intensity,
            ),
        };
        if !usable {
            return Err(Error::invalid(
                format!("lights.{i}.{name}"),
                vector,
                "allowed: three finite numbers, for a direction not all 0",
            ));
        }
        // A lamp's intensity grows with the square of the scene: a sheet in millimetres needs millions.
        let most = if matches!(self, Self::Point { .. }) {
            1e24
        } else {
            1e6
        };
        colour(&format!("lights.{i}.{power_name}"), power, most)
    }
}

/// What is seen past the mesh: linear display values from the upper edge to the lower, untouched by light and exposure.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Background {
    /// At the upper edge, linear RGB, 0 to 1 each.
    pub top: [f32; 3],
    /// At the lower edge.
    pub bottom: [f32; 3],
}

impl Default for Background {
    fn default() -> Self {
        Self {
            top: [0.014, 0.0145, 0.016],
            bottom: [0.052, 0.053, 0.056],
        }
    }
}

impl Background {
    /// The colour at a height of the picture, 0 at its upper edge, 1 at the lower.
    pub(super) fn at(&self, t: f32) -> Vec3 {
        Vec3::from(self.top).lerp(self.bottom.into(), t)
    }
}

/// Ready-made lights, placed as the camera sees the subject.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Rig {
    /// A key light from the upper left, a weaker one from the right, and one from behind along the edges.
    #[default]
    Studio,
    /// The key light alone: one highlight, to be measured or compared.
    Key,
    /// A lamp near the subject, at the upper left.
    Lamp,
}

impl Rig {
    /// Its lights for a subject at `camera.target` of about `radius`.
    pub fn lights(self, camera: &Camera, radius: f32) -> Vec<Light> {
        let [right, up, back] = camera.basis();
        let toward = |x: f32, y: f32, z: f32| (right * x + up * y + back * z).normalize_or(up);
        let directional = |x, y, z, irradiance: f32| Light::Directional {
            toward: toward(x, y, z),
            irradiance: [irradiance; 3],
        };
        let key = directional(-0.45, 0.40, 0.80, 2.6);
        match self {
            Self::Studio => vec![
                key,
                directional(0.85, 0.15, 0.5, 0.9),
                directional(0.25, 0.75, -0.6, 1.2),
            ],
            Self::Key => vec![key],
            Self::Lamp => {
                let distance = 2.5 * radius;
                vec![Light::Point {
                    position: camera.target + toward(-0.5, 0.6, 0.75) * distance,
                    intensity: [2.8 * distance * distance; 3],
                }]
            }
        }
    }
}

/// What is spent on a picture beyond one plain fetch and one formula per sample. All of it is on by default; without it the
/// picture is what a bare shader draws, aliased where the map or a highlight is finer than a sample.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Quality {
    /// Footprints larger than a texel are averaged.
    pub mips: bool,
    /// Lobes grow by the surface's bend inside a sample, and samples at the outline are lit although their interpolated
    /// normal is bent away from the eye.
    pub widening: bool,
    /// Surfaces that wind clockwise as seen from the eye are drawn too, as open surfaces need.
    pub back_faces: bool,
    /// Pixels in which a surface ends, breaks off or turns sharply are drawn with 4x4 samples, whatever the others have. Pictures
    /// of more than 2^26 samples, or 2^24 pixels, are drawn without.
    pub outlines: bool,
}

impl Quality {
    /// Everything off.
    pub const PLAIN: Self = Self {
        mips: false,
        widening: false,
        back_faces: false,
        outlines: false,
    };

    /// Whether it takes the change of attributes from sample to sample.
    pub(super) fn needs_changes(self) -> bool {
        self.mips || self.widening
    }
}

impl Default for Quality {
    fn default() -> Self {
        Self {
            mips: true,
            widening: true,
            back_faces: true,
            outlines: true,
        }
    }
}

/// Everything a picture needs besides mesh, map and material.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Scene {
    /// Where it is seen from.
    pub camera: Camera,
    /// At most 64.
    #[serde(default)]
    pub lights: Vec<Light>,
    /// Ambient light I_a, linear RGB, 0 to 1e6 each. Default 1.
    #[serde(default = "one")]
    pub ambient: [f32; 3],
    /// Exposure in stops, -16 to 16: light is multiplied by 2 to this power. Default 0.
    #[serde(default)]
    pub exposure: f32,
    /// What is seen past the mesh.
    #[serde(default)]
    pub background: Background,
    /// Samples along a pixel's side, 1 to 4: 2 means 2x2. Default 2.
    #[serde(default = "two")]
    pub samples: u32,
    /// What is spent on each sample.
    #[serde(default)]
    pub quality: Quality,
}

fn one() -> [f32; 3] {
    [1.0; 3]
}

fn two() -> u32 {
    2
}

impl Scene {
    /// The mesh whole in the picture, seen from where its kind is best seen, under the studio lights.
    pub fn for_mesh(mesh: &Mesh) -> Self {
        Self::with_rig(mesh, Rig::default())
    }

    /// The same with other lights.
    pub fn with_rig(mesh: &Mesh, rig: Rig) -> Self {
        let (camera, radius) = frame(mesh);
        let mut lights = rig.lights(&camera, radius);
        if let (Some(normal), Some(key)) = (flat(mesh), lights.first_mut()) {
            *key = near_lamp(&camera, normal, mesh.name == "disc", radius);
        }
        Self {
            lights,
            camera,
            ambient: one(),
            exposure: 0.0,
            background: Background::default(),
            samples: two(),
            quality: Quality::default(),
        }
    }

    /// Replaces every light by directional ones toward which `directions` point, the first as strong as a key light.
    pub fn set_directions(&mut self, directions: &[Vec3]) {
        self.lights = directions
            .iter()
            .enumerate()
            .map(|(i, &toward)| Light::Directional {
                toward,
                irradiance: [if i == 0 { 2.4 } else { 1.2 }; 3],
            })
            .collect();
    }

    /// Checks every number.
    ///
    /// # Errors
    /// With the name of the first that is not allowed.
    pub fn check(&self) -> Result<()> {
        self.camera.check()?;
        if self.lights.len() > LIGHTS_MAX {
            let allowed = format!("allowed: at most {LIGHTS_MAX} lights");
            return Err(Error::invalid("lights", self.lights.len(), allowed));
        }
        for (i, light) in self.lights.iter().enumerate() {
            light.check(i)?;
        }
        colour("ambient", self.ambient, 1e6)?;
        colour("background.top", self.background.top, 1.0)?;
        colour("background.bottom", self.background.bottom, 1.0)?;
        if !(-16.0..=16.0).contains(&self.exposure) {
            return Err(Error::invalid(
                "exposure",
                self.exposure,
                "allowed: -16 to 16 stops",
            ));
        }
        if !(1..=SAMPLES_MAX).contains(&self.samples) {
            let allowed = format!("allowed: 1 to {SAMPLES_MAX} along a pixel's side");
            return Err(Error::invalid("samples", self.samples, allowed));
        }
        Ok(())
    }
}

/// Azimuth toward +x and elevation in degrees from which a shape shows itself: a torus is seen from the front and above, a pot
/// from a little above its rim, flat things (which face +z) a little from the side.
fn best_side(mesh: &Mesh) -> (f32, f32) {
    match mesh.name.as_str() {
        "torus" => (0.0, 42.0),
        "pot" | "cylinder" => (0.0, 14.0),
        "plane" | "disc" => (20.0, 20.0),
        "sphere" => (0.0, 10.0),
        _ => (25.0, 20.0),
    }
}

/// The smallest box around the mesh's finite vertices.
fn bounds(mesh: &Mesh) -> (Vec3, Vec3) {
    let points = || mesh.positions.iter().filter(|p| p.is_finite());
    (
        points().copied().reduce(Vec3::min).unwrap_or(Vec3::ZERO),
        points().copied().reduce(Vec3::max).unwrap_or(Vec3::ZERO),
    )
}

/// The normal of a mesh that is flat along a world axis.
fn flat(mesh: &Mesh) -> Option<Vec3> {
    let (low, high) = bounds(mesh);
    let extent = high - low;
    Vec3::AXES
        .into_iter()
        .find(|axis| extent.dot(*axis) < 0.02 * extent.max_element())
}

/// A lamp for a flat surface, which distant light would hit everywhere or nowhere. Its mirror image stands in the middle of
/// straight grooves, so that they show a band; over `rings` it leans upward, since at their normal all of them answer alike
/// and only beside it do they show a fan.
fn near_lamp(camera: &Camera, normal: Vec3, rings: bool, radius: f32) -> Light {
    let [_, up, back] = camera.basis();
    let normal = normal * if normal.dot(back) < 0.0 { -1.0 } else { 1.0 };
    let upward = (up - normal * normal.dot(up)).normalize_or_zero();
    let (lean, irradiance) = if rings { (0.22, 0.7) } else { (0.0, 0.5) };
    let half = (normal + upward * lean).normalize_or(normal);
    let distance = 2.2 * radius;
    Light::Point {
        position: camera.target + (half * (2.0 * half.dot(back)) - back) * distance,
        intensity: [irradiance * distance * distance; 3],
    }
}

/// A camera that just holds every vertex, and how large the mesh is.
fn frame(mesh: &Mesh) -> (Camera, f32) {
    let points = || mesh.positions.iter().filter(|p| p.is_finite());
    let (low, high) = bounds(mesh);
    let target = 0.5 * low + 0.5 * high;
    let radius = 0.5 * (high - low).length();
    let radius = if radius.is_finite() && radius > 0.0 {
        radius
    } else {
        1.0
    };
    let (azimuth, elevation) = best_side(mesh);
    let (sin_a, cos_a) = crate::math::sin_cos(azimuth.to_radians());
    let (sin_e, cos_e) = crate::math::sin_cos(elevation.to_radians());
    let back = Vec3::new(sin_a * cos_e, sin_e, cos_a * cos_e);
    let fov = 28.0f32;
    let mut camera = Camera {
        eye: target + back * radius,
        target,
        up: Vec3::Y,
        projection: Projection::Perspective { fov },
    };
    let [right, up, _] = camera.basis();
    let (sin, cos) = crate::math::sin_cos(0.5 * fov.to_radians());
    let distance = points().fold(radius, |d, &p| {
        let p = p - target;
        let aside = p.dot(right).abs().max(p.dot(up).abs()) * MARGIN;
        d.max(p.dot(back) + aside * cos / sin)
    });
    camera.eye = target + back * distance;
    (camera, radius)
}

/// Holds a colour against its range; NaN is in none.
fn colour(what: &str, value: [f32; 3], highest: f32) -> Result<()> {
    if value.iter().all(|c| (0.0..=highest).contains(c)) {
        return Ok(());
    }
    Err(Error::invalid(
        what,
        format!("{value:?}"),
        format!("allowed: three numbers from 0 to {highest}"),
    ))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn scene() -> Scene {
        Scene {
            camera: Camera {
                eye: Vec3::Z,
                target: Vec3::ZERO,
                up: Vec3::Y,
                projection: Projection::default(),
            },
            lights: vec![
                Light::Directional {
                    toward: Vec3::X,
                    irradiance: [1.0; 3],
                },
                Light::Point {
                    position: Vec3::Y,
                    intensity: [1.0; 3],
                },
            ],
            ambient: one(),
            exposure: 0.0,
            background: Background::default(),
            samples: 2,
            quality: Quality::default(),
        }
    }

    #[test]
    fn flat_meshes_of_every_size_can_be_lit() {
        for scale in [1e-4f32, 1.0, 1e3, 1e6, 1e9] {
            for mut mesh in [crate::mesh::plane(), crate::mesh::disc()] {
                mesh.positions.iter_mut().for_each(|p| *p *= scale);
                for rig in [Rig::Studio, Rig::Key, Rig::Lamp] {
                    let scene = Scene::with_rig(&mesh, rig);
                    assert!(
                        scene.check().is_ok(),
                        "{} at {scale}: {:?}",
                        mesh.name,
                        scene.check()
                    );
                }
            }
        }
    }

    #[test]
    fn a_scene_is_plain_data() {
        let text = toml::to_string(&scene()).unwrap();
        assert_eq!(toml::from_str::<Scene>(&text).unwrap(), scene(), "{text}");
        let short = "camera = { eye = [0, 1, 2], target = [0, 0, 0] }";
        assert_eq!(toml::from_str::<Scene>(short).unwrap().samples, 2);
        assert!(toml::from_str::<Scene>(&format!("{short}\nlihgts = []")).is_err());
    }

    #[test]
    fn every_number_is_held_against_its_range() {
        let wrong = |change: fn(&mut Scene)| {
            let mut s = scene();
            change(&mut s);
            s.check().unwrap_err().to_string()
        };
        assert!(scene().check().is_ok());
        assert!(wrong(|s| s.exposure = f32::NAN).contains("exposure"));
        assert!(wrong(|s| s.samples = 5).contains("1 to 4"));
        assert!(wrong(|s| s.ambient[1] = -1.0).contains("ambient"));
        assert!(wrong(|s| s.camera.eye = Vec3::ZERO).contains("camera.eye"));
        assert!(
            wrong(|s| s.lights[0] = Light::Directional {
                toward: Vec3::ZERO,
                irradiance: [1.0; 3]
            })
            .contains("lights.0.toward")
        );
        assert!(
            wrong(|s| s.lights[1] = Light::Point {
                position: Vec3::ZERO,
                intensity: [f32::INFINITY; 3]
            })
            .contains("lights.1.intensity")
        );
    }
}
