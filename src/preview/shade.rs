//! Light on fragments.
//!
//! What is done to each fragment before the formula, and why:
//! - the frame is made orthonormal at the fragment ([`Frame::new`]): interpolated vectors are neither, and a tangent that
//!   leans half a degree toward the normal costs a third of a lobe of width 0.1;
//! - where the surface has no direction, the lobe is isotropic with the same variance, as Radiance does;
//! - the lobe grows by the change of the half vector over the sample, Sigma + J Jᵀ / 12 (the variance of a box of one sample;
//!   Kaplanyan et al. 2016 filter in the same domain): a highlight narrower than a sample keeps its energy instead of
//!   flickering;
//! - the cosine between normal and view is at least its mean over the sample: at the outline interpolated normals bend away
//!   from the eye, and models that divide by that cosine would put single white samples there.

use super::Material;
use super::look::Look;
use super::outline::Field;
use super::packed::{self, CHUNK, Chunk, Given};
use super::scene::{Light, SAMPLES_MAX, Scene};
use super::timings::{Stage, Timings};
use crate::brdf::Model;
use crate::brdf::kernel::{self, Batch};
use crate::filter::Pyramid;
use crate::map::Rect;
use crate::math;
use crate::raster::{Depths, Fragments, Tile};
use fearless_simd::dispatch;
use glam::Vec3;

/// Lights the fragments of tiles with one look.
pub(super) struct Shader<'a> {
    pyramid: &'a Pyramid<'a>,
    material: &'a Material,
    scene: &'a Scene,
    /// Pixels of the picture, from top to bottom.
    height: u32,
    model: Model,
    /// The one texel of all fragments: the map's mean along the mesh's tangent where the look asks for it, or that of a map that
    /// has no other.
    alike: Option<[f32; 4]>,
    /// Where footprints are sampled that one lobe does not tell, in samples from the middle of one.
    taps: &'static [[f32; 2]],
    /// Where lights stand that are not far.
    lamps: Vec<[f32; 3]>,
    gain: f32,
}

/// Places in a footprint, for 1 to 4 samples along a pixel's side: together 16 or 18 a pixel. Two and four stand so that no two
/// share a row or a column.
const TAPS: [&[[f32; 2]]; SAMPLES_MAX as usize] = [
    &grid::<16>(4),
    &[
        [-0.125, -0.375],
        [0.375, -0.125],
        [0.125, 0.375],
        [-0.375, 0.125],
    ],
    &[[-0.25, -0.25], [0.25, 0.25]],
    &[[0.0, 0.0]],
];

/// A grid of `side` x `side` places, each row moved by a part of a column.
const fn grid<const N: usize>(side: usize) -> [[f32; 2]; N] {
    let mut places = [[0.0; 2]; N];
    let mut i = 0;
    while i < N {
        let (x, y) = ((i % side) as f32, (i / side) as f32);
        let side = side as f32;
        places[i] = [
            (x + (y + 0.5) / side) / side - 0.5,
            (y + (x + 0.5) / side) / side - 0.5,
        ];
        i += 1;
    }
    places
}

/// What one thread works in.
pub(super) struct Desk {
    pub(super) depths: Depths,
    pub(super) tile: Tile,
    pub(super) fragments: Fragments,
    chunk: Box<Chunk>,
    /// Where outlines are looked for.
    pub(super) field: Box<Field>,
    /// Light and number of samples of each pixel of a tile, when a pixel has several.
    sums: Vec<([f32; 3], u32)>,
}

impl Desk {
    pub(super) fn new() -> Self {
        Self {
            depths: Depths::new(),
            tile: Tile::default(),
            fragments: Fragments::new(),
            chunk: Box::new(Chunk::new()),
            field: Box::new(Field::new()),
            sums: Vec::new(),
        }
    }
}

/// The pixels of a tile, row by row.
pub(super) type Lines<'a> = Vec<&'a mut [[f32; 3]]>;

impl<'a> Shader<'a> {
    /// For a picture of `height` pixels from top to bottom.
    pub(super) fn new(
        pyramid: &'a Pyramid<'a>,
        material: &'a Material,
        scene: &'a Scene,
        height: u32,
        look: Look,
    ) -> Self {
        let map = pyramid.base();
        let alike = if look.mean {
            let mean = pyramid.mean();
            Some([(2.0 * mean.uu).sqrt(), (2.0 * mean.vv).sqrt(), 1.0, 0.0])
        } else if map.size().texels() == 1 {
            let t = map.texel_at(0);
            Some([t.alpha_x, t.alpha_y, t.axis.cos2, t.axis.sin2])
        } else {
            None
        };
        Self {
            pyramid,
            material,
            scene,
            height,
            model: look.model,
            alike,
            taps: TAPS[scene.samples as usize - 1],
            lamps: scene.lights.iter().filter_map(lamp).collect(),
            gain: math::exp2(scene.exposure),
        }
    }

    /// Lights a tile of `samples`, which the desk's fragments are of, into its lines of the picture.
    pub(super) fn tile(
        &self,
        samples: Rect,
        desk: &mut Desk,
        lines: &mut Lines<'_>,
        timings: &Timings,
    ) {
        if desk.fragments.len() < samples.texels() {
            let rect = self.pixels(samples);
            timings.time(Stage::Gather, || self.fill_background(rect, lines));
        }
        self.pixels_of_fragments(samples, desk, lines, timings);
    }

    /// Lights those pixels of a tile that the desk's fragments are in; of each, all that see something must be there.
    pub(super) fn pixels_of_fragments(
        &self,
        samples: Rect,
        desk: &mut Desk,
        lines: &mut Lines<'_>,
        timings: &Timings,
    ) {
        let rect = self.pixels(samples);
        let Desk {
            fragments,
            chunk,
            sums,
            ..
        } = desk;
        if fragments.is_empty() {
            return;
        }
        let several = self.scene.samples > 1;
        if several {
            sums.clear();
            sums.resize(rect.texels(), ([0.0; 3], 0));
        }
        for start in (0..fragments.len()).step_by(CHUNK) {
            let given = Given {
                lanes: fragments.lanes(),
                rays: fragments.rays(),
                start,
                count: CHUNK.min(fragments.len() - start),
            };
            self.light(given, chunk, timings);
            timings.time(Stage::Gather, || {
                let places = (
                    &fragments.columns()[start..][..given.count],
                    &fragments.rows()[start..][..given.count],
                );
                if several {
                    self.add(places, rect.width, chunk, sums);
                } else {
                    self.write(places, chunk, lines);
                }
            });
        }
        if several {
            timings.time(Stage::Gather, || self.average(rect, sums, lines));
        }
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

    /// What is seen behind pixels of row `y`.
    fn behind(&self, y: u32) -> Vec3 {
        self.scene
            .background
            .at((y as f32 + 0.5) / self.height as f32)
    }

    fn fill_background(&self, rect: Rect, lines: &mut Lines<'_>) {
        for (y, line) in (rect.y..).zip(lines) {
            // Sixteen pixels at a time are whole vectors of any width.
            let sixteen = [self.behind(y).to_array(); 16];
            let mut all = line.chunks_exact_mut(16);
            for pixels in &mut all {
                pixels.copy_from_slice(&sixteen);
            }
            let rest = all.into_remainder();
            rest.copy_from_slice(&sixteen[..rest.len()]);
        }
    }

    /// One sample a pixel: its light is the pixel. The places are those of the chunk's fragments.
    fn write(&self, (columns, rows): (&[u8], &[u8]), chunk: &Chunk, lines: &mut Lines<'_>) {
        let n = columns.len();
        let [r, g, b] = chunk.radiance.each_ref().map(|c| &c[..n]);
        for (i, (column, row)) in columns.iter().zip(rows).enumerate() {
            lines[usize::from(*row)][usize::from(*column)] =
                [r[i] * self.gain, g[i] * self.gain, b[i] * self.gain];
        }
    }

    /// Several samples a pixel: their light is added up.
    fn add(
        &self,
        (columns, rows): (&[u8], &[u8]),
        width: u32,
        chunk: &Chunk,
        sums: &mut [([f32; 3], u32)],
    ) {
        let samples = self.scene.samples;
        for (i, (column, row)) in columns.iter().zip(rows).enumerate() {
            let pixel = u32::from(*row) / samples * width + u32::from(*column) / samples;
            let (light, count) = &mut sums[pixel as usize];
            for c in 0..3 {
                light[c] += chunk.radiance[c][i];
            }
            *count += 1;
        }
    }

    fn average(&self, rect: Rect, sums: &[([f32; 3], u32)], lines: &mut Lines<'_>) {
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
    fn light(&self, given: Given<'_>, chunk: &mut Chunk, timings: &Timings) {
        let level = math::level();
        let quality = self.scene.quality;
        let n = given.count;
        timings.time(Stage::Frame, || {
            dispatch!(level, simd => packed::frames(simd, chunk, given));
            if quality.widening {
                dispatch!(level, simd => packed::bends(simd, chunk, given, &self.lamps));
            }
        });
        let ambient = Vec3::from(self.material.ambient) * Vec3::from(self.scene.ambient);
        for (lane, c) in chunk.radiance.iter_mut().zip(ambient.to_array()) {
            lane[..n].fill(c);
        }
        let varied = timings.time(Stage::Fetch, || match self.alike {
            Some(texel) => {
                if quality.widening {
                    for (lane, number) in chunk.texel.iter_mut().zip(texel) {
                        lane[..n].fill(number);
                    }
                }
                false
            }
            None => {
                packed::fetch(self.pyramid, chunk, n);
                quality.mips && {
                    dispatch!(level, simd => packed::uv_changes(simd, chunk, given));
                    packed::average(self.pyramid, chunk, n)
                }
            }
        });
        let taps = if varied { self.taps } else { &[[0.0; 2]] };
        for (i, tap) in taps.iter().enumerate() {
            timings.time(Stage::Fetch, || {
                if varied {
                    packed::fetch_tap(self.pyramid, chunk, n, *tap);
                    packed::share_taps(chunk, n, i, taps.len());
                } else {
                    chunk.share[..n].fill(1.0);
                }
                match self.alike {
                    Some(texel) if !quality.widening => {
                        dispatch!(level, simd => packed::lobes_alike(simd, chunk, n, texel));
                    }
                    _ => dispatch!(level, simd => packed::lobes(simd, chunk, n, quality.widening)),
                }
            });
            timings.time(Stage::Shade, || {
                for light in &self.scene.lights {
                    self.add_light(light, chunk, n, i == 0);
                }
            });
        }
    }

    /// Adds the specular reflection of a light, and with `diffuse` also that.
    fn add_light(&self, light: &Light, chunk: &mut Chunk, n: usize, diffuse: bool) {
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
            (power * Vec3::from(self.material.diffuse) * f32::from(u8::from(diffuse))).to_array(),
            (power * Vec3::from(self.material.specular)).to_array(),
        );
        let seen_only = !self.scene.quality.widening;
        dispatch!(level, simd => packed::gather(simd, chunk, n, colours, seen_only));
    }
}

/// Where a light stands; `None` for one that is far.
fn lamp(light: &Light) -> Option<[f32; 3]> {
    match light {
        Light::Point { position, .. } => Some(position.to_array()),
        Light::Directional { .. } => None,
    }
}

/// Splits whole rows of pixels into the lines of their tiles.
pub(super) fn split(
    rows: &mut [[f32; 3]],
    width: usize,
    window: std::ops::Range<usize>,
    side: usize,
) -> Vec<Lines<'_>> {
    let tiles = window.len().div_ceil(side);
    let mut lines: Vec<Lines<'_>> = (0..tiles).map(|_| Vec::with_capacity(side)).collect();
    for row in rows.chunks_mut(width) {
        for (tile, line) in lines.iter_mut().zip(row[window.clone()].chunks_mut(side)) {
            tile.push(line);
        }
    }
    lines
}
