//! Map, mesh, model, camera and lights to a picture.
//!
//! A picture is drawn in bands of bounded memory: triangles to a [`GBuffer`] once, then one shading pass per [`Look`], so that
//! looks side by side share their geometry. Light is linear until [`Picture::to_srgb8`]; supersampling is a box filter in
//! linear light. The same input gives the same bytes with any number of threads.
//!
//! The sum is the paper's: I = k_a I_a + sum of E_i (rho_d / pi (n.l) + rho_s f(l, v) (n.l)), where a light contributes
//! nothing from behind the surface.

mod caption;
mod difference;
mod look;
mod packed;
mod picture;
mod reference;
mod scene;
mod shade;
mod sheet;
mod timings;

pub use caption::{Align, write_text};
pub use difference::{Difference, Measure};
pub use look::Look;
pub use picture::{Picture, linear_from_srgb, srgb_from_linear};
pub use reference::{REFERENCE_SAMPLES, render_reference};
pub use scene::{Background, Light, Quality, Rig, SAMPLES_MAX, Scene};

pub use crate::recipe::Material;
pub use shade::Shader;
pub use sheet::{panel_size, side_by_side};
pub use timings::{Stage, Timings};

use crate::error::{Error, Result};
use crate::filter::Pyramid;
use crate::map::{AnisoMap, Rect, Size};
use crate::mesh::Mesh;
use crate::progress::Progress;
use crate::raster::{Cull, GBuffer, TILE, View};

/// Samples in a band: what is seen takes about 12 bytes each while it is drawn.
const BAND_SAMPLES: u64 = 1 << 21;

/// What is looked at.
#[derive(Clone, Copy)]
pub struct Subject<'a> {
    /// The shape.
    pub mesh: &'a Mesh,
    /// Its map, laid over the mesh's texture coordinates.
    pub map: &'a AnisoMap,
    /// Its colours.
    pub material: &'a Material,
}

/// A [`Subject`] made ready to be drawn again and again.
pub struct Prepared<'a> {
    mesh: &'a Mesh,
    pyramid: Pyramid<'a>,
    material: &'a Material,
}

impl<'a> Subject<'a> {
    /// Works out what does not change while mesh, map and material stay: the map's levels, and its texels side by side.
    pub fn prepare(self, timings: &Timings) -> Prepared<'a> {
        Prepared {
            mesh: self.mesh,
            pyramid: timings.time(Stage::Prepare, || Pyramid::new(self.map)),
            material: self.material,
        }
    }
}

impl Prepared<'_> {
    /// Draws one picture of `size` pixels per look: [`render`] without preparing again.
    ///
    /// # Errors
    /// As [`render`].
    pub fn render(
        &self,
        scene: &Scene,
        looks: &[Look],
        size: Size,
        timings: &Timings,
        progress: &Progress<'_>,
    ) -> Result<Vec<Picture>> {
        // Before memory is asked for.
        scene.check()?;
        sample_grid(size, scene.samples)?;
        let mut pictures = vec![Picture::new(size, [0.0; 3]); looks.len()];
        self.draw(scene, looks, &mut pictures, timings, progress)?;
        Ok(pictures)
    }

    /// Draws one picture per look into `pictures`, all from one visibility pass; what they held is gone.
    ///
    /// # Errors
    /// As [`render`].
    ///
    /// # Panics
    /// When there are not as many pictures as looks, or they are not of one size.
    pub fn draw(
        &self,
        scene: &Scene,
        looks: &[Look],
        pictures: &mut [Picture],
        timings: &Timings,
        progress: &Progress<'_>,
    ) -> Result<()> {
        assert_eq!(looks.len(), pictures.len(), "a picture for each look");
        scene.check()?;
        self.material.check()?;
        let Some(size) = pictures.first().map(Picture::size) else {
            return Ok(());
        };
        assert!(pictures.iter().all(|p| p.size() == size), "one size");
        let view = View::new(&scene.camera, sample_grid(size, scene.samples)?)?;
        let cull = if scene.quality.back_faces {
            Cull::None
        } else {
            Cull::Back
        };
        let bands: Vec<Rect> = bands(view.size()).collect();
        progress.expect(bands.len() as u64 * (1 + looks.len() as u64));
        for band in bands {
            let buffer = timings.time(Stage::Raster, || {
                GBuffer::draw(self.mesh, &view, band, cull, progress)
            })?;
            progress.step()?;
            for (&look, picture) in looks.iter().zip(pictures.iter_mut()) {
                Shader::new(self.mesh, &self.pyramid, self.material, scene, view, look)
                    .shade(&buffer, picture, timings, progress)?;
                progress.step()?;
            }
        }
        Ok(())
    }
}

/// Draws one picture of `size` pixels per look, all from one visibility pass.
///
/// # Errors
/// When the scene, the material or the mesh holds numbers that are not allowed, when the picture times the supersampling is
/// larger than 32768 samples a side or 2^28 in all, or when `progress` cancels.
pub fn render(
    subject: Subject<'_>,
    scene: &Scene,
    looks: &[Look],
    size: Size,
    progress: &Progress<'_>,
) -> Result<Vec<Picture>> {
    scene.check()?;
    subject.material.check()?;
    sample_grid(size, scene.samples)?;
    let off = Timings::off();
    subject
        .prepare(&off)
        .render(scene, looks, size, &off, progress)
}

/// Several looks side by side in one picture of `size` pixels, each with its caption: [`render`] and [`side_by_side`].
///
/// # Errors
/// As [`render`], and when the picture is narrower than its panels are many.
pub fn render_sheet(
    subject: Subject<'_>,
    scene: &Scene,
    looks: &[Look],
    size: Size,
    progress: &Progress<'_>,
) -> Result<Picture> {
    let panel = panel_size(size, looks.len())?;
    let panels = render(subject, scene, looks, panel, progress)?;
    let captions: Vec<String> = looks.iter().map(Look::caption).collect();
    side_by_side(&panels, &captions, size)
}

/// The picture's size in samples.
fn sample_grid(size: Size, samples: u32) -> Result<Size> {
    let side = |n: u32| n.saturating_mul(samples);
    Size::new(side(size.width()), side(size.height())).map_err(|_| {
        Error::invalid(
            "picture size",
            format!("{size} with {samples}x{samples} samples a pixel"),
            "allowed: at most 32768 samples a side and 16384x16384 in all",
        )
        .with_hint("Ask for a smaller picture or fewer samples")
    })
}

fn bands(size: Size) -> impl Iterator<Item = Rect> {
    let tile_row = u64::from(size.width()) * u64::from(TILE);
    let rows = (BAND_SAMPLES / tile_row).max(1) as u32 * TILE;
    (0..size.height().div_ceil(rows)).map(move |i| Rect {
        x: 0,
        y: i * rows,
        width: size.width(),
        height: rows.min(size.height() - i * rows),
    })
}

#[cfg(test)]
mod tests;
