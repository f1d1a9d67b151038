//! Light on fragments.
//!
//! What is done to each fragment before the formula, and why:
//! - the frame is made orthonormal at the fragment ([`Frame::new`]): interpolated vectors are neither, and a tangent that
//!   leans half a degree toward the normal costs a third of a lobe of width 0.1;
//! - where the surface has no direction, the lobe is isotropic with the same variance, as Radiance does;
//! - the lobe grows by the change of the normal over the sample, Sigma + J Jᵀ / 12 (the variance of a box of one sample;
//!   Kaplanyan et al. 2016 filter in the same domain): a highlight narrower than a sample keeps its energy instead of
//!   flickering. The change of the half vector by view and light alone is left out; it is far smaller on curved metal;
//! - the cosine between normal and view is at least its mean over the sample: at the outline interpolated normals bend away
//!   from the eye, and models that divide by that cosine would put single white samples there.

use super::Material;
use super::look::Look;
use super::picture::Picture;
use super::scene::{Light, Scene};
use crate::brdf::{self, Model};
use crate::error::Result;
use crate::filter::Pyramid;
use crate::map::{Rect, SlopeCovariance, Texel};
use crate::math::{self, Axis, Frame};
use crate::progress::Progress;
use crate::raster::{Fragments, GBuffer, Tile, View};
use glam::{Vec2, Vec3};
use rayon::prelude::*;
use std::f32::consts::FRAC_1_PI;

/// The least cosine between normal and view of a fragment that is seen.
const GRAZING_MIN: f32 = 1e-4;
/// The most that the change of the normal over the sample may raise it to: triangles seen edge-on change without bound.
const GRAZING_MAX: f32 = 0.2;
/// The most variance that curvature may add: 0.18 of alpha², as Tokuyoshi and Kaplanyan (2019) limit it.
const CURVATURE_MAX: f32 = 0.09;

/// Lights the fragments of a [`GBuffer`] with one look.
pub struct Shader<'a> {
    pyramid: &'a Pyramid<'a>,
    material: &'a Material,
    scene: &'a Scene,
    view: View,
    model: Model,
    /// The one lobe along the mesh's tangent, when the map itself is not read.
    mean: Option<Texel>,
    gain: f32,
}

impl<'a> Shader<'a> {
    /// `view` is the one that the buffer will have been drawn with.
    pub fn new(
        pyramid: &'a Pyramid<'a>,
        material: &'a Material,
        scene: &'a Scene,
        view: View,
        look: Look,
    ) -> Self {
        let mean = look.mean.then(|| {
            let mean = pyramid.mean();
            Texel {
                alpha_x: (2.0 * mean.uu).sqrt(),
                alpha_y: (2.0 * mean.vv).sqrt(),
                axis: Axis::U,
            }
        });
        Self {
            pyramid,
            material,
            scene,
            view,
            model: look.model,
            mean,
            gain: math::exp2(scene.exposure),
        }
    }

    /// Lights the buffer's window and writes it into the picture, whose size times `scene.samples` is that of the view.
    /// One check per tile; no steps are counted.
    ///
    /// # Errors
    /// When `progress` cancels.
    ///
    /// # Panics
    /// When the window does not begin at whole pixels or reaches outside the picture.
    pub fn shade(
        &self,
        buffer: &GBuffer,
        picture: &mut Picture,
        progress: &Progress<'_>,
    ) -> Result<()> {
        let lit: Vec<(Rect, Vec<[f32; 3]>)> = buffer
            .tiles()
            .par_iter()
            .map(|tile| {
                progress.check()?;
                Ok(self.tile(tile))
            })
            .collect::<Result<_>>()?;
        for (rect, pixels) in lit {
            for (i, line) in pixels.chunks(rect.width as usize).enumerate() {
                let row = picture.row_mut(rect.y + i as u32);
                row[rect.x as usize..][..line.len()].copy_from_slice(line);
            }
        }
        Ok(())
    }

    /// The pixels of one tile: where they lie in the picture, and their display values in row order.
    ///
    /// # Panics
    /// When the tile does not begin at a whole pixel.
    pub fn tile(&self, tile: &Tile) -> (Rect, Vec<[f32; 3]>) {
        let samples = self.scene.samples;
        let r = tile.rect;
        assert!(
            [r.x, r.y, r.width, r.height]
                .iter()
                .all(|n| n % samples == 0),
            "tiles hold whole pixels"
        );
        let rect = Rect {
            x: r.x / samples,
            y: r.y / samples,
            width: r.width / samples,
            height: r.height / samples,
        };
        let mut sum = vec![(Vec3::ZERO, 0u32); rect.texels()];
        for i in 0..tile.fragments.len() {
            let place = u32::from(tile.fragments.place[i]);
            let (x, y) = (place % r.width / samples, place / r.width / samples);
            let (light, count) = &mut sum[(y * rect.width + x) as usize];
            *light += self.fragment(&tile.fragments, i);
            *count += 1;
        }
        let height = (self.view.size().height() / samples) as f32;
        let all = (samples * samples) as f32;
        let pixels = sum
            .into_iter()
            .enumerate()
            .map(|(i, (light, count))| {
                let y = rect.y + i as u32 / rect.width;
                let behind = self.scene.background.at((y as f32 + 0.5) / height);
                ((light * self.gain + behind * (all - count as f32)) / all).to_array()
            })
            .collect();
        (rect, pixels)
    }

    /// Radiance toward the eye, before exposure.
    fn fragment(&self, f: &Fragments, i: usize) -> Vec3 {
        let ambient = Vec3::from(self.material.ambient) * Vec3::from(self.scene.ambient);
        let Some((mut frame, usable)) = Frame::new(f.normal[i], f.tangent[i]) else {
            return ambient;
        };
        let texel = match self.mean {
            Some(texel) => texel,
            None => self.pyramid.sample(f.uv[i], f.duv_dx[i], f.duv_dy[i]),
        };
        let texel = if usable { texel } else { isotropic(texel) };
        let texel = widened(texel, curvature(&frame, f.dn_dx[i], f.dn_dy[i]));
        if f.back[i] {
            frame.normal = -frame.normal;
        }
        let eye = self.view.toward(f.position[i]);
        // The mean of |x| over an interval of width w around 0 is w / 4.
        let grazing = 0.25 * (f.dn_dx[i].dot(eye).abs() + f.dn_dy[i].dot(eye).abs());
        let grazing = grazing.clamp(GRAZING_MIN, GRAZING_MAX);
        let lobe = Lobe::new(self.model, frame, texel, eye, grazing);
        let (mut diffuse, mut specular) = (Vec3::ZERO, Vec3::ZERO);
        for light in &self.scene.lights {
            let (toward, irradiance) = arriving(light, f.position[i]);
            let (cosine, reflected) = lobe.reflect(toward);
            diffuse += irradiance * (FRAC_1_PI * cosine);
            specular += irradiance * reflected;
        }
        ambient
            + Vec3::from(self.material.diffuse) * diffuse
            + Vec3::from(self.material.specular) * specular
    }
}

/// The lobe of one fragment: its frame turned to the texel's x axis.
struct Lobe {
    model: Model,
    frame: Frame,
    axis: Vec2,
    alpha: Vec2,
    view: Vec3,
}

impl Lobe {
    fn new(model: Model, frame: Frame, texel: Texel, toward_eye: Vec3, grazing: f32) -> Self {
        let mut lobe = Self {
            model,
            frame,
            axis: texel.axis.direction(),
            alpha: Vec2::new(texel.alpha_x, texel.alpha_y),
            view: Vec3::Z,
        };
        let view = lobe.local(toward_eye);
        lobe.view = view.with_z(view.z.max(grazing)).normalize();
        lobe
    }

    /// World to the lobe's own frame: x along the texel's x axis, z along the normal.
    fn local(&self, v: Vec3) -> Vec3 {
        let v = self.frame.to_local(v);
        Vec3::new(
            self.axis.x * v.x + self.axis.y * v.y,
            self.axis.x * v.y - self.axis.y * v.x,
            v.z,
        )
    }

    /// (n.l, f(l, v) n.l) for a unit vector toward a light; both 0 from behind.
    fn reflect(&self, toward: Vec3) -> (f32, f32) {
        let light = self.local(toward);
        if light.z > 0.0 {
            (
                light.z,
                brdf::shade(self.model, light, self.view, self.alpha),
            )
        } else {
            (0.0, 0.0)
        }
    }
}

/// The unit vector toward a light from a point, and the irradiance of a surface there that faces it.
fn arriving(light: &Light, at: Vec3) -> (Vec3, Vec3) {
    match *light {
        Light::Directional { toward, irradiance } => {
            (toward.normalize_or_zero(), irradiance.into())
        }
        Light::Point {
            position,
            intensity,
        } => {
            let d = position - at;
            match d.try_normalize() {
                Some(toward) => (
                    toward,
                    Vec3::from(intensity) / d.length_squared().max(1e-12),
                ),
                None => (Vec3::ZERO, Vec3::ZERO),
            }
        }
    }
}

/// The same variance in every direction.
fn isotropic(texel: Texel) -> Texel {
    let (x, y) = (texel.alpha_x, texel.alpha_y);
    let alpha = (0.5 * (x * x + y * y)).sqrt();
    Texel {
        alpha_x: alpha,
        alpha_y: alpha,
        axis: Axis::U,
    }
}

/// The variance of slope inside a sample, in the tangent frame, that the surface's bend alone makes.
fn curvature(frame: &Frame, dn_dx: Vec3, dn_dy: Vec3) -> SlopeCovariance {
    let (t, b) = (frame.tangent, frame.bitangent);
    let (tx, ty) = (t.dot(dn_dx), t.dot(dn_dy));
    let (bx, by) = (b.dot(dn_dx), b.dot(dn_dy));
    let sum = SlopeCovariance {
        uu: tx * tx + ty * ty,
        uv: tx * bx + ty * by,
        vv: bx * bx + by * by,
    } * (1.0 / 12.0);
    let trace = sum.uu + sum.vv;
    if trace > CURVATURE_MAX {
        sum * (CURVATURE_MAX / trace)
    } else {
        sum
    }
}

fn widened(texel: Texel, by: SlopeCovariance) -> Texel {
    let narrow = texel.alpha_x.min(texel.alpha_y);
    // Under a thousandth of the variance it cannot be seen, and a ratio of 1000 would lose digits in the covariance.
    if by.uu + by.vv < 0.5e-3 * narrow * narrow {
        return texel;
    }
    (SlopeCovariance::from(texel) + by).to_texel(texel.alpha_x > texel.alpha_y, texel.axis)
}
