//! Map, mesh, model, camera and lights to a picture.
//!
//! A picture is drawn tile by tile: which triangle each sample sees, then one shading pass per [`Look`] while the tile is in
//! the cache, so that looks side by side share their geometry. A [`Frame`] keeps what was seen, and later pictures of it cost
//! only what changed. Light is linear until [`Picture::to_srgb8`]; supersampling is a box filter in
//! linear light, and pixels at outlines take 4x4 samples. The same input gives the same bytes with any number of threads.
//!
//! The sum is the paper's: I = k_a I_a + sum of E_i (rho_d / pi (n.l) + rho_s f(l, v) (n.l)), where a light contributes
//! nothing from behind the surface.

mod caption;
mod difference;
mod frame;
mod look;
mod outline;
mod packed;
mod picture;
mod prepared;
mod reference;
mod scene;
mod shade;
mod sheet;
mod timings;

pub use caption::{Align, write_text};
pub use difference::{Difference, Measure};
pub use frame::{Frame, Redrawn};
pub use look::Look;
pub(crate) use packed::texels_seen;
pub use picture::{Picture, linear_from_srgb, srgb_from_linear};
pub use prepared::Prepared;
pub use reference::{REFERENCE_SAMPLES, render_reference};
pub use scene::{Background, Light, Quality, Rig, SAMPLES_MAX, Scene};

pub use crate::recipe::Material;
pub use sheet::{panel_size, side_by_side};
pub use timings::{Stage, Timings};

use crate::error::{Error, Result};
use crate::map::{AnisoMap, Size};
use crate::mesh::Mesh;
use crate::progress::Progress;

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

impl<'a> Subject<'a> {
    /// Works out what does not change while mesh, map and material stay: see [`Prepared`].
    ///
    /// # Errors
    /// When the mesh's arrays do not fit together, or the material holds numbers that are not allowed.
    pub fn prepare(self, timings: &Timings) -> Result<Prepared<'a>> {
        Prepared::new(self.mesh, self.map, *self.material, timings)
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
        .prepare(&off)?
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

#[cfg(test)]
mod tests;
