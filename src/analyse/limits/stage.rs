//! A picture of one light on one map, drawn by the preview as it draws any.

use crate::brdf::Model;
use crate::error::Result;
use crate::map::{AnisoMap, Size};
use crate::mesh::Mesh;
use crate::preview::{self, Background, Light, Look, Material, Picture, Scene, Subject};
use crate::progress::Progress;
use crate::raster::{Camera, Projection};
use glam::Vec3;

/// What is drawn: seen along -z without perspective, nothing but specular light of irradiance
/// and reflectance 1, before black.
pub(super) struct Stage<'a> {
    pub(super) mesh: &'a Mesh,
    pub(super) map: &'a AnisoMap,
    pub(super) model: Model,
    /// What the picture's height shows.
    pub(super) extent: f32,
    /// To the light.
    pub(super) toward: Vec3,
}

impl Stage<'_> {
    /// A picture of `side` x `side` pixels, one sample each.
    pub(super) fn draw(&self, side: u32) -> Result<Picture> {
        let scene = Scene {
            camera: Camera {
                eye: Vec3::new(0.0, 0.0, 5.0),
                target: Vec3::ZERO,
                up: Vec3::Y,
                projection: Projection::Orthographic {
                    extent: self.extent,
                },
            },
            lights: vec![Light::Directional {
                toward: self.toward,
                irradiance: [1.0; 3],
            }],
            background: Background {
                top: [0.0; 3],
                bottom: [0.0; 3],
            },
            samples: 1,
            ..Scene::for_mesh(self.mesh)
        };
        let material = Material {
            diffuse: [0.0; 3],
            specular: [1.0; 3],
            ambient: [0.0; 3],
        };
        let subject = Subject {
            mesh: self.mesh,
            map: self.map,
            material: &material,
        };
        let look = Look {
            model: self.model,
            mean: false,
        };
        let size = Size::new(side, side)?;
        let mut pictures = preview::render(subject, &scene, &[look], size, &Progress::none())?;
        Ok(pictures.swap_remove(0))
    }
}
