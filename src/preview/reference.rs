//! The picture that every error is measured from: f64 throughout, many samples a pixel, and nothing approximated.
//!
//! No levels of the map, no widened lobes, no prepared texels: each sample fetches the map between its four nearest texels, is
//! lit with the f64 form of the model, and the mean of the samples is the pixel. What is smaller than a sample therefore still
//! aliases, as noise that falls with their number; a map of N texels across a picture of n pixels wants N/n samples along a
//! pixel's side or more. Where an interpolated normal is bent away from the eye the sum in the [module's](super) docs gives
//! nothing but ambient light, and so does this.

use super::prepared::{bands, cull};
use super::scene::{Light, Scene};
use super::{Look, Picture, Subject, sample_grid};
use crate::brdf::shade_f64;
use crate::error::{Error, Result};
use crate::filter::Pyramid;
use crate::map::{AnisoMap, Size};
use crate::progress::Progress;
use crate::raster::{self, Exact, GBuffer, Geometry, TILE, View};
use glam::{DVec2, DVec3, Vec3};
use rayon::prelude::*;
use std::f64::consts::FRAC_1_PI;

/// Samples along a pixel's side where the caller has no reason for another number: 64 a pixel.
pub const REFERENCE_SAMPLES: u32 = 8;
/// Samples that are drawn at a time, five bytes each.
const BAND_SAMPLES: u64 = 1 << 23;

/// Draws one picture of `size` pixels per look with `samples` x `samples` samples a pixel, in place of the scene's own number
/// and quality.
///
/// # Errors
/// As [`render`](super::render), and when a tile of 48 samples does not hold whole pixels: `samples` is one of 1, 2, 3, 4, 6,
/// 8, 12, 16, 24, 48.
pub fn render_reference(
    subject: Subject<'_>,
    scene: &Scene,
    looks: &[Look],
    size: Size,
    samples: u32,
    progress: &Progress<'_>,
) -> Result<Vec<Picture>> {
    scene.check()?;
    subject.material.check()?;
    if samples == 0 || !TILE.is_multiple_of(samples) {
        let allowed = "allowed: 1, 2, 3, 4, 6, 8, 12, 16, 24 or 48 along a pixel's side";
        return Err(Error::invalid("samples of a reference", samples, allowed));
    }
    let grid = sample_grid(size, samples)?;
    let view = View::new(&scene.camera, grid)?;
    let geometry = Geometry::new(subject.mesh)?;
    let lamps = Lamps::new(subject, scene, &view);
    let fetches: Vec<Fetch<'_>> = looks.iter().map(|l| Fetch::new(l, subject.map)).collect();
    let mut pictures = vec![Picture::new(size, [0.0; 3]); looks.len()];
    let bands: Vec<_> = bands(grid, BAND_SAMPLES).collect();
    progress.expect(bands.len() as u64);
    for band in bands {
        let buffer = GBuffer::draw(&geometry, &view, band, cull(scene), progress)?;
        let tiles: Vec<Tile> = (0..buffer.tiles().len())
            .into_par_iter()
            .map(|tile| {
                progress.check()?;
                let seen = (&buffer.tiles()[tile], &geometry, &view);
                Ok(Tile::new(seen, samples, (looks, &fetches), &lamps))
            })
            .collect::<Result<_>>()?;
        for tile in &tiles {
            tile.write(scene, size, samples, &mut pictures);
        }
        progress.step()?;
    }
    Ok(pictures)
}

/// Where a look takes its lobes from.
enum Fetch<'a> {
    Map(&'a AnisoMap),
    /// alpha_x, alpha_y along the mesh's tangent.
    Mean(DVec2),
}

impl<'a> Fetch<'a> {
    fn new(look: &Look, map: &'a AnisoMap) -> Self {
        if look.mean {
            let mean = Pyramid::new(map).mean();
            Self::Mean((2.0 * DVec2::new(f64::from(mean.uu), f64::from(mean.vv))).map(f64::sqrt))
        } else {
            Self::Map(map)
        }
    }

    /// Widths, and the cosine and sine of the x axis.
    fn at(&self, uv: DVec2) -> (DVec2, DVec2) {
        match self {
            Self::Mean(alpha) => (*alpha, DVec2::X),
            Self::Map(map) => between_texels(map, uv),
        }
    }
}

/// [`AnisoMap::sample`] in f64.
fn between_texels(map: &AnisoMap, uv: DVec2) -> (DVec2, DVec2) {
    let place = |t: f64, n: u32, repeats: bool| {
        let t = if t.is_finite() { t } else { 0.0 };
        let t = if repeats {
            t - t.floor()
        } else {
            t.clamp(0.0, 1.0)
        };
        let x = t * f64::from(n) - 0.5;
        (x.floor() as i64, x - x.floor())
    };
    let (wrap, width) = (map.wrap(), map.width());
    let (x, fx) = place(uv.x, width, wrap.repeats_u());
    let (y, fy) = place(1.0 - uv.y, map.height(), wrap.repeats_v());
    let mut sum = [0.0; 4];
    for (dy, wy) in [(0, 1.0 - fy), (1, fy)] {
        for (dx, wx) in [(0, 1.0 - fx), (1, fx)] {
            let row = wrap.row(y + dy, map.height()) as usize;
            let i = row * width as usize + wrap.column(x + dx, width) as usize;
            let planes = [map.alpha_x(), map.alpha_y(), map.cos2(), map.sin2()];
            for (s, plane) in sum.iter_mut().zip(planes) {
                *s += wx * wy * f64::from(plane[i]);
            }
        }
    }
    let [x, y, cos2, sin2] = sum;
    if cos2.hypot(sin2) < f64::from(crate::math::AXIS_MIN_LENGTH) {
        return (DVec2::splat((x * y).sqrt()), DVec2::X);
    }
    (DVec2::new(x, y), DVec2::from_angle(0.5 * sin2.atan2(cos2)))
}

/// The lights and colours of a scene in f64.
struct Lamps {
    viewer: DVec3,
    /// 1 for a viewer at a place, 0 for one in a direction.
    viewer_w: f64,
    lamps: Vec<Lamp>,
    ambient: DVec3,
}

struct Lamp {
    /// Position, or direction with w = 0.
    at: DVec3,
    w: f64,
    /// Its power times the surface's colours, the first over pi.
    diffuse: DVec3,
    specular: DVec3,
}

impl Lamps {
    fn new(subject: Subject<'_>, scene: &Scene, view: &View) -> Self {
        let rays = view.rays();
        let (viewer, viewer_w) = if rays.perspective {
            (rays.eye, 1.0)
        } else {
            (rays.back, 0.0)
        };
        let colour = |c: [f32; 3]| Vec3::from(c).as_dvec3();
        let material = subject.material;
        let lamps = scene.lights.iter().map(|light| {
            let (at, w, power) = match *light {
                Light::Directional { toward, irradiance } => (toward, 0.0, irradiance),
                Light::Point {
                    position,
                    intensity,
                } => (position, 1.0, intensity),
            };
            Lamp {
                at: at.as_dvec3(),
                w,
                diffuse: colour(power) * colour(material.diffuse) * FRAC_1_PI,
                specular: colour(power) * colour(material.specular),
            }
        });
        Self {
            viewer: viewer.as_dvec3(),
            viewer_w,
            lamps: lamps.collect(),
            ambient: colour(material.ambient) * colour(scene.ambient),
        }
    }

    /// Radiance of a sample toward the viewer, before exposure.
    fn light(&self, sample: &Exact, look: &Look, fetch: &Fetch<'_>) -> DVec3 {
        let outside = sample.normal;
        let tangent = sample.tangent - outside * outside.dot(sample.tangent);
        let (mut alpha, turn) = fetch.at(sample.uv);
        let t = tangent.try_normalize().unwrap_or_else(|| {
            // No direction: the same variance in all.
            alpha = DVec2::splat((0.5 * alpha.length_squared()).sqrt());
            outside.any_orthonormal_vector()
        });
        let b = outside.cross(t) * sample.handedness;
        let (x, y) = (t * turn.x + b * turn.y, b * turn.x - t * turn.y);
        let n = outside * sample.facing;
        let local = |d: DVec3| DVec3::new(d.dot(x), d.dot(y), d.dot(n));
        let v = local((self.viewer - sample.position * self.viewer_w).normalize_or_zero());
        let mut light = self.ambient;
        for lamp in &self.lamps {
            let d = lamp.at - sample.position * lamp.w;
            let falloff = if lamp.w > 0.0 {
                d.length_squared().max(1e-12).recip()
            } else {
                1.0
            };
            let l = local(d.normalize_or_zero());
            if l.z > 0.0 && v.z > 0.0 {
                let reflected = shade_f64(look.model, l, v, alpha);
                light += (lamp.diffuse * l.z + lamp.specular * reflected) * falloff;
            }
        }
        light
    }
}

/// The light of a tile's pixels, look by look, and how many of their samples see the mesh.
struct Tile {
    /// In pixels.
    x: usize,
    y: usize,
    width: usize,
    counts: Vec<u32>,
    sums: Vec<Vec<DVec3>>,
}

impl Tile {
    fn new(
        (seen, geometry, view): (&raster::Tile, &Geometry<'_>, &View),
        samples: u32,
        (looks, fetches): (&[Look], &[Fetch<'_>]),
        lamps: &Lamps,
    ) -> Self {
        let rect = seen.rect;
        let pixels = |n: u32| (n / samples) as usize;
        let (x, y, width) = (pixels(rect.x), pixels(rect.y), pixels(rect.width));
        let all = width * pixels(rect.height);
        let mut counts = vec![0; all];
        let mut sums = vec![vec![DVec3::ZERO; all]; looks.len()];
        for sample in seen.exact(geometry, view) {
            let i = (pixels(sample.row) - y) * width + pixels(sample.column) - x;
            counts[i] += 1;
            for ((look, fetch), sums) in looks.iter().zip(fetches).zip(&mut sums) {
                sums[i] += lamps.light(&sample, look, fetch);
            }
        }
        Self {
            x,
            y,
            width,
            counts,
            sums,
        }
    }

    fn write(&self, scene: &Scene, size: Size, samples: u32, pictures: &mut [Picture]) {
        let gain = f64::from(scene.exposure).exp2();
        let all = f64::from(samples * samples);
        for (i, &count) in self.counts.iter().enumerate() {
            let (x, y) = (self.x + i % self.width, self.y + i / self.width);
            let height = (y as f32 + 0.5) / size.height() as f32;
            let behind = scene.background.at(height).as_dvec3() * (all - f64::from(count));
            for (sums, picture) in self.sums.iter().zip(pictures.iter_mut()) {
                let light = (sums[i] * gain + behind) / all;
                picture.row_mut(y as u32)[x] = light.as_vec3().to_array();
            }
        }
    }
}
