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
use super::packed::{self, CHUNK, Chunk, Given};
use super::picture::Picture;
use super::scene::{Light, Scene};
use super::timings::{Stage, Timings};
use crate::brdf::Model;
use crate::brdf::kernel::{self, Batch};
use crate::error::Result;
use crate::filter::Pyramid;
use crate::map::Rect;
use crate::math;
use crate::mesh::Mesh;
use crate::progress::Progress;
use crate::raster::{Fragments, GBuffer, TILE, View};
use fearless_simd::dispatch;
use glam::Vec3;
use rayon::prelude::*;

/// Lights the fragments of a [`GBuffer`] with one look.
pub struct Shader<'a> {
    mesh: &'a Mesh,
    pyramid: &'a Pyramid<'a>,
    material: &'a Material,
    scene: &'a Scene,
    view: View,
    model: Model,
    /// The one texel along the mesh's tangent, when the map itself is not read.
    mean: Option<[f32; 4]>,
    gain: f32,
}

/// What one thread works in.
struct Desk {
    fragments: Fragments,
    chunk: Box<Chunk>,
    /// Light and number of samples of each pixel of a tile, when a pixel has several.
    sums: Vec<([f32; 3], u32)>,
}

impl Desk {
    fn new() -> Self {
        Self {
            fragments: Fragments::default(),
            chunk: Box::new(Chunk::new()),
            sums: Vec::new(),
        }
    }
}

impl<'a> Shader<'a> {
    /// `view` is the one that the buffer will have been drawn with.
    pub fn new(
        mesh: &'a Mesh,
        pyramid: &'a Pyramid<'a>,
        material: &'a Material,
        scene: &'a Scene,
        view: View,
        look: Look,
    ) -> Self {
        let mean = look.mean.then(|| {
            let mean = pyramid.mean();
            [(2.0 * mean.uu).sqrt(), (2.0 * mean.vv).sqrt(), 1.0, 0.0]
        });
        Self {
            mesh,
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
    /// When the window does not begin at whole pixels or reaches outside the picture, or the buffer is of another mesh.
    pub fn shade(
        &self,
        buffer: &GBuffer,
        picture: &mut Picture,
        timings: &Timings,
        progress: &Progress<'_>,
    ) -> Result<()> {
        let window = self.pixels(buffer.window());
        let across = buffer.window().width.div_ceil(TILE) as usize;
        let width = picture.width() as usize;
        let tile_height = (TILE / self.scene.samples) as usize;
        let first = window.y as usize * width;
        let rows = &mut picture.pixels_mut()[first..][..window.height as usize * width];
        // A row of tiles at a time is split into its tiles, which then are lit side by side.
        rows.par_chunks_mut(tile_height * width)
            .enumerate()
            .try_for_each(|(j, rows)| {
                let window = window.x as usize..(window.x + window.width) as usize;
                let tiles = split(rows, width, window, tile_height);
                tiles.into_par_iter().enumerate().try_for_each_init(
                    Desk::new,
                    |desk, (i, mut lines)| {
                        progress.check()?;
                        self.tile(buffer, j * across + i, desk, &mut lines, timings);
                        Ok(())
                    },
                )
            })
    }

    /// The pixels of a rectangle of samples.
    fn pixels(&self, r: Rect) -> Rect {
        let samples = self.scene.samples;
        assert!(
            [r.x, r.y, r.width, r.height]
                .iter()
                .all(|n| n % samples == 0),
            "tiles hold whole pixels"
        );
        Rect {
            x: r.x / samples,
            y: r.y / samples,
            width: r.width / samples,
            height: r.height / samples,
        }
    }

    /// Lights one tile into its lines of the picture.
    fn tile(
        &self,
        buffer: &GBuffer,
        tile: usize,
        desk: &mut Desk,
        lines: &mut [&mut [[f32; 3]]],
        timings: &Timings,
    ) {
        let samples = buffer.tiles()[tile].rect;
        let rect = self.pixels(samples);
        if buffer.tiles()[tile].is_empty() {
            timings.time(Stage::Gather, || self.fill_background(rect, lines));
            return;
        }
        let Desk {
            fragments,
            chunk,
            sums,
        } = desk;
        let changes = self.scene.quality.needs_changes();
        timings.time(Stage::Resolve, || {
            buffer.resolve(self.mesh, tile, changes, fragments);
        });
        if fragments.len() < samples.texels() {
            timings.time(Stage::Gather, || self.fill_background(rect, lines));
        }
        if self.scene.samples > 1 {
            sums.clear();
            sums.resize(rect.texels(), ([0.0; 3], 0));
        }
        for start in (0..fragments.len()).step_by(CHUNK) {
            let end = (start + CHUNK).min(fragments.len());
            self.light(fragments, start..end, chunk, timings);
            timings.time(Stage::Gather, || {
                let places = &fragments.place[start..end];
                if self.scene.samples == 1 {
                    self.write(places, samples.width, chunk, lines);
                } else {
                    self.add(places, samples.width, chunk, sums);
                }
            });
        }
        if self.scene.samples > 1 {
            timings.time(Stage::Gather, || self.average(rect, sums, lines));
        }
    }

    /// What is seen behind pixels of row `y`.
    fn behind(&self, y: u32) -> Vec3 {
        let height = (self.view.size().height() / self.scene.samples) as f32;
        self.scene.background.at((y as f32 + 0.5) / height)
    }

    fn fill_background(&self, rect: Rect, lines: &mut [&mut [[f32; 3]]]) {
        for (y, line) in (rect.y..).zip(lines) {
            // Sixteen pixels at a time are whole vectors of any width.
            let sixteen = [self.behind(y).to_array(); 16];
            for pixels in line.chunks_mut(16) {
                pixels.copy_from_slice(&sixteen[..pixels.len()]);
            }
        }
    }

    /// One sample a pixel: its light is the pixel.
    fn write(&self, places: &[u16], width: u32, chunk: &Chunk, lines: &mut [&mut [[f32; 3]]]) {
        let width = width as usize;
        let (mut y, mut start) = (0, 0);
        for (i, &place) in places.iter().enumerate() {
            // In row order, so that no division is needed.
            while place as usize >= start + width {
                y += 1;
                start += width;
            }
            lines[y][place as usize - start] = chunk.radiance.each_ref().map(|c| c[i] * self.gain);
        }
    }

    /// Several samples a pixel: their light is added up.
    fn add(&self, places: &[u16], width: u32, chunk: &Chunk, sums: &mut [([f32; 3], u32)]) {
        let samples = self.scene.samples;
        for (i, &place) in places.iter().enumerate() {
            let (x, y) = (u32::from(place) % width, u32::from(place) / width);
            let pixel = y / samples * (width / samples) + x / samples;
            let (light, count) = &mut sums[pixel as usize];
            for c in 0..3 {
                light[c] += chunk.radiance[c][i];
            }
            *count += 1;
        }
    }

    fn average(&self, rect: Rect, sums: &[([f32; 3], u32)], lines: &mut [&mut [[f32; 3]]]) {
        let all = (self.scene.samples * self.scene.samples) as f32;
        let rows = sums.chunks(rect.width as usize).zip(lines);
        for (y, (sums, line)) in (rect.y..).zip(rows) {
            let behind = self.behind(y);
            for (pixel, (light, count)) in line.iter_mut().zip(sums) {
                if *count > 0 {
                    let light = Vec3::from(*light) * self.gain;
                    *pixel = ((light + behind * (all - *count as f32)) / all).to_array();
                }
            }
        }
    }

    /// Radiance toward the eye of some fragments, before exposure.
    fn light(
        &self,
        fragments: &Fragments,
        range: std::ops::Range<usize>,
        chunk: &mut Chunk,
        timings: &Timings,
    ) {
        let level = math::level();
        let quality = self.scene.quality;
        let n = range.len();
        let changed = !fragments.normal_dx.is_empty();
        let given = Given {
            facing: &fragments.facing[range.clone()],
            position: &fragments.position[range.clone()],
            normal: &fragments.normal[range.clone()],
            tangent: &fragments.tangent[range.clone()],
            normal_dx: if changed {
                &fragments.normal_dx[range.clone()]
            } else {
                &[]
            },
            normal_dy: if changed {
                &fragments.normal_dy[range.clone()]
            } else {
                &[]
            },
        };
        timings.time(Stage::Frame, || {
            let (viewer, w) = self.view.viewer();
            let viewer = (viewer.to_array(), w);
            dispatch!(level, simd => packed::frames(simd, chunk, given, viewer));
            if quality.widening {
                dispatch!(level, simd => packed::bends(simd, chunk, given));
            }
        });
        timings.time(Stage::Fetch, || {
            match self.mean {
                Some(texel) => chunk.texel[..n].fill(texel),
                None => {
                    let v_change = quality.mips.then(|| &fragments.v_change[range.clone()]);
                    packed::fetch(self.pyramid, chunk, given, v_change);
                }
            }
            dispatch!(level, simd => packed::lobes(simd, chunk, n, quality.widening));
        });
        timings.time(Stage::Shade, || {
            let ambient = Vec3::from(self.material.ambient) * Vec3::from(self.scene.ambient);
            for (lane, c) in chunk.radiance.iter_mut().zip(ambient.to_array()) {
                lane[..n].fill(c);
            }
            for light in &self.scene.lights {
                self.add_light(light, chunk, n);
            }
        });
    }

    fn add_light(&self, light: &Light, chunk: &mut Chunk, n: usize) {
        let level = math::level();
        let power = match *light {
            Light::Directional { toward, irradiance } => {
                let toward = toward.normalize_or_zero().to_array();
                dispatch!(level, simd => packed::toward_direction(simd, chunk, n, toward));
                irradiance
            }
            Light::Point {
                position,
                intensity,
            } => {
                let place = position.to_array();
                dispatch!(level, simd => packed::toward_place(simd, chunk, n, place));
                intensity
            }
        };
        let batch = Batch {
            light: chunk.light.each_ref().map(|c| &c[..n]),
            view: chunk.view.each_ref().map(|c| &c[..n]),
            lobe: chunk.lobe.each_ref().map(|c| &c[..n]),
        };
        kernel::shade(level, self.model, &batch, &mut chunk.reflected[..n]);
        let power = Vec3::from(power);
        let colours = (
            (power * Vec3::from(self.material.diffuse)).to_array(),
            (power * Vec3::from(self.material.specular)).to_array(),
        );
        let seen_only = !self.scene.quality.widening;
        dispatch!(level, simd => packed::gather(simd, chunk, n, colours, seen_only));
    }
}

/// Splits whole rows of pixels into the lines of their tiles.
fn split(
    rows: &mut [[f32; 3]],
    width: usize,
    window: std::ops::Range<usize>,
    side: usize,
) -> Vec<Vec<&mut [[f32; 3]]>> {
    let tiles = window.len().div_ceil(side);
    let mut lines: Vec<Vec<_>> = (0..tiles).map(|_| Vec::with_capacity(side)).collect();
    for row in rows.chunks_mut(width) {
        for (tile, line) in lines.iter_mut().zip(row[window.clone()].chunks_mut(side)) {
            tile.push(line);
        }
    }
    lines
}
