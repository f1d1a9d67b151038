//! What is done once before a recipe's map is filled: files are read, masks drawn, the patterns' own tables made.

use super::image::Laid;
use super::layer::{Blend, below, derived_seed};
use super::shelf::Shelf;
use super::{
    Channels, Files, Layer, LeftOut, Mask, MaskSource, Recipe, Source, Stamp, file_of_mesh,
};
use crate::coverage::DrawnMask;
use crate::error::{Error, Result};
use crate::map::{Mended, Size};
use crate::math::Axis;
use crate::paint::{Painting, Skin, Strokes};
use crate::pattern::{Fill, Surface};
use crate::progress::Progress;
use glam::Vec2;
use std::sync::Arc;

/// A recipe prepared for one size. Cloning copies references only.
#[derive(Clone)]
pub struct Prepared {
    pub(super) surface: Surface,
    pub(super) layers: Vec<PreparedLayer>,
    pub(super) adjust: Option<Turned>,
    pub(super) shelf: Shelf,
    /// What of the recipe is not there.
    pub(super) left_out: Vec<LeftOut>,
}

#[derive(Clone)]
pub(super) struct PreparedLayer {
    /// Its number in the recipe.
    pub(super) at: usize,
    pub(super) opacity: f32,
    pub(super) channels: Channels,
    pub(super) source: PreparedSource,
    pub(super) mask: Option<Arc<PreparedMask>>,
    pub(super) of: Origin,
    /// What reading its image had to change.
    pub(super) mended: Mended,
}

/// What a source and a mask were made of.
#[derive(Clone)]
pub(super) struct Origin {
    pub(super) source: Source,
    pub(super) mask: Option<Mask>,
    pub(super) surface: Surface,
    /// The recipe's mesh, where strokes lie on it.
    pub(super) mesh: Option<String>,
    /// Those of all files that it is made of.
    stamps: Vec<Option<Stamp>>,
}

impl Origin {
    /// Whether it has the mesh and the files, as they are, of another one.
    fn is_made_of(&self, other: &Self) -> bool {
        self.mesh == other.mesh && self.stamps == other.stamps
    }

    /// Whether it has strokes on the mesh of that word.
    pub(super) fn lies_on(&self, word: &str) -> bool {
        let own = match &self.source {
            Source::Strokes(strokes) => strokes.mesh.as_deref(),
            _ => None,
        };
        let of_mask = match self.mask.as_ref().map(|m| &m.source) {
            Some(MaskSource::Strokes(strokes)) => strokes.mesh.as_deref(),
            _ => None,
        };
        [self.mesh.as_deref(), own, of_mask].contains(&Some(word))
    }
}

#[derive(Clone)]
pub(super) enum PreparedSource {
    /// What does not know what lies below it.
    Fill(Arc<dyn Fill>),
    /// What was painted over what lies below.
    Strokes(Arc<Painting>),
}

pub(super) struct PreparedMask {
    pub(super) invert: bool,
    pub(super) source: Weights,
}

pub(super) enum Weights {
    Painted {
        painting: Painting,
        start: f32,
    },
    Value {
        source: Box<dyn Fill>,
        low: f32,
        high: f32,
    },
    Drawn(DrawnMask),
}

/// [`super::Adjust`] with its angle taken apart.
#[derive(Clone)]
pub(super) struct Turned {
    pub(super) alpha_x: f32,
    pub(super) alpha_y: f32,
    pub(super) axis: Axis,
}

impl Recipe {
    /// Does once what needs the whole: checks, drawn masks, the patterns' own tables. Hidden layers are left out.
    ///
    /// # Errors
    /// As [`Recipe::check`], when a file that it names may not or cannot be read, and [`crate::Error::Cancelled`] when
    /// `progress`, which is asked before each layer and mask, says so.
    pub fn prepare(&self, size: Size, files: &Files, progress: &Progress<'_>) -> Result<Prepared> {
        self.prepare_from(None, false, size, files, progress)
    }

    /// As [`Recipe::prepare`], with the sources and masks taken over from `before` that are as they were there: after a change
    /// of one layer only that one is prepared. Files that were written anew since are read anew.
    ///
    /// # Errors
    /// As [`Recipe::prepare`].
    pub fn prepare_after(
        &self,
        before: &Prepared,
        size: Size,
        files: &Files,
        progress: &Progress<'_>,
    ) -> Result<Prepared> {
        self.prepare_from(Some(before), false, size, files, progress)
    }

    /// As [`Recipe::prepare_after`], without the layers of which a file is missing or cannot be read: those are told by
    /// [`Prepared::left_out`]. To be looked at, not to be written to files.
    ///
    /// # Errors
    /// As [`Recipe::prepare`], but for files of layers.
    pub fn prepare_readable(
        &self,
        before: &Prepared,
        size: Size,
        files: &Files,
        progress: &Progress<'_>,
    ) -> Result<Prepared> {
        self.prepare_from(Some(before), true, size, files, progress)
    }

    fn prepare_from(
        &self,
        before: Option<&Prepared>,
        is_lenient: bool,
        size: Size,
        files: &Files,
        progress: &Progress<'_>,
    ) -> Result<Prepared> {
        self.check()?;
        let surface = Surface {
            size,
            aspect: self.aspect_at(size),
            wrap: self.wrap,
            seed: self.seed,
        };
        self.check_masks(&surface)?;
        let layers = (0..).zip(&self.layers);
        let shown = layers.filter(|(_, l)| l.visible && l.opacity > 0.0);
        let adjust = self.adjust;
        let mut shelf = before.map_or_else(Shelf::default, |b| b.shelf.clone());
        shelf.tidy(self);
        let before = before.map_or(&[][..], |b| &b.layers);
        let mut around = Around {
            before,
            mesh: self.mesh.as_deref(),
            most: Size::new(
                size.width().max(self.size.width()),
                size.height().max(self.size.height()),
            )?,
            shelf: &mut shelf,
            files,
            progress,
        };
        let (mut layers, mut left_out) = (Vec::new(), Vec::new());
        for (i, layer) in shown {
            match prepare_layer((i, layer), &surface, &mut around) {
                Ok(prepared) => layers.push(prepared),
                Err(error) if is_lenient => {
                    left_out.push(LeftOut::because(layer, around.mesh, files, error)?);
                }
                Err(error) => return Err(error),
            }
        }
        Ok(Prepared {
            surface,
            layers,
            shelf,
            left_out,
            adjust: (adjust != super::Adjust::default()).then(|| Turned {
                alpha_x: adjust.alpha_x,
                alpha_y: adjust.alpha_y,
                axis: Axis::from_degrees(adjust.turn),
            }),
        })
    }
}

/// The most bytes that a recipe's drawn masks may hold.
const MASK_BYTES_MAX: u64 = 2 << 30;

impl Recipe {
    /// Drawn masks are kept whole until the map is filled: refuses more than memory is likely to hold.
    pub(super) fn check_masks(&self, surface: &Surface) -> Result<()> {
        let shown = self.layers.iter().filter(|l| l.visible && l.opacity > 0.0);
        let drawn = shown
            .filter_map(|l| l.mask.as_ref())
            .filter(|m| m.source.is_drawn());
        let sizes: Vec<u64> = drawn
            .map(|m| DrawnMask::bytes(surface.size, feather_texels(m, surface)))
            .collect();
        let bytes: u64 = sizes.iter().sum();
        if bytes <= MASK_BYTES_MAX {
            return Ok(());
        }
        Err(Error::invalid(
            "the memory of masks",
            format!(
                "{:.1} GiB for {} polygons and paths at {}",
                bytes as f64 / f64::from(1 << 30),
                sizes.len(),
                surface.size
            ),
            format!("allowed: {} GiB", MASK_BYTES_MAX >> 30),
        )
        .with_hint("Make the map smaller, or one path of several shapes"))
    }
}

/// How far a mask's edge fades, in texels.
fn feather_texels(mask: &Mask, surface: &Surface) -> Vec2 {
    Vec2::splat(mask.feather.unwrap_or(0.0)) / surface.texel()
}

/// The mesh that the strokes of the table `at` lie on, where any does.
fn skin(
    at: &str,
    strokes: &Strokes,
    surface: &Surface,
    around: &mut Around<'_>,
) -> Result<Option<Arc<Skin>>> {
    if !strokes.need_mesh() {
        return Ok(None);
    }
    let key = format!("{at}.mesh");
    let (key, word) = match (&strokes.mesh, around.mesh) {
        (Some(word), _) => (key, word.as_str()),
        (None, Some(word)) => ("mesh".to_owned(), word),
        (None, None) => {
            let allowed = "allowed: a mesh for the strokes that were painted on one";
            return Err(Error::invalid(key, "missing", allowed)
                .with_hint("Name it there, or as the recipe's own `mesh`"));
        }
    };
    let skin = around.shelf.skin(&key, word, surface, around.files)?;
    Ok(Some(skin))
}

/// What layers are prepared from, beside themselves.
struct Around<'a> {
    before: &'a [PreparedLayer],
    /// The recipe's mesh.
    mesh: Option<&'a str>,
    /// The largest map that is made of the recipe, for what is read once for all.
    most: Size,
    shelf: &'a mut Shelf,
    files: &'a Files,
    progress: &'a Progress<'a>,
}

impl Around<'_> {
    /// Those of the files that a layer is made of.
    fn stamps(&self, layer: &Layer) -> Vec<Option<Stamp>> {
        let mesh = self.mesh.filter(|_| layer.needs_mesh());
        let names = layer.files().into_iter().chain(mesh.and_then(file_of_mesh));
        names.map(|name| self.files.stamp(name)).collect()
    }
}

fn prepare_layer(
    (at, layer): (usize, &Layer),
    surface: &Surface,
    around: &mut Around<'_>,
) -> Result<PreparedLayer> {
    around.progress.check()?;
    let own = Surface {
        seed: layer.seed_in(surface.seed),
        ..*surface
    };
    let Blend::Mix = layer.blend;
    let of = Origin {
        source: layer.source.clone(),
        mask: layer.mask.clone(),
        surface: own,
        mesh: around
            .mesh
            .filter(|_| layer.needs_mesh())
            .map(str::to_owned),
        stamps: around.stamps(layer),
    };
    let before = around.before;
    let alike = || before.iter().filter(|old| old.of.surface == own);
    let source = alike().find(|old| old.of.source == of.source && old.of.is_made_of(&of));
    let mask = alike().find(|old| old.of.mask == of.mask && old.of.is_made_of(&of));
    let (source, mended) = match source {
        Some(old) => (old.source.clone(), old.mended),
        None => prepare_source(at, &layer.source, &own, around)?,
    };
    let mask = match (mask, &layer.mask) {
        (Some(old), _) => old.mask.clone(),
        (None, None) => None,
        (None, Some(mask)) => {
            around.progress.check()?;
            let key = format!("layers.{at}.mask");
            Some(Arc::new(prepare_mask(&key, mask, &own, around)?))
        }
    };
    Ok(PreparedLayer {
        at,
        opacity: layer.opacity,
        channels: layer.channels,
        source,
        mask,
        of,
        mended,
    })
}

/// The source of the layer with the number `at`, and what reading its image had to change.
fn prepare_source(
    at: usize,
    source: &Source,
    own: &Surface,
    around: &mut Around<'_>,
) -> Result<(PreparedSource, Mended)> {
    let key = format!("layers.{at}");
    let mut mended = Mended::default();
    let fill: Arc<dyn Fill> = match source {
        Source::Pattern(p) => p.prepare(own)?.into(),
        Source::Image(image) => {
            let key = format!("{key}.image");
            let size = (own.wrap, around.most);
            let read = around.shelf.picture(&key, image, size, around.files)?;
            mended = read.mended;
            Arc::new(Laid::new(&read, own.size)?)
        }
        Source::Stored(stored) => {
            Arc::new(stored.prepare(&format!("{key}.stored"), own, around.files)?)
        }
        Source::Guides(guides) => {
            let at = below(format!("{key}.guides"));
            Arc::new(guides.prepare(own, around.progress).map_err(at)?)
        }
        Source::Strokes(strokes) => {
            let key = format!("{key}.strokes");
            let skin = skin(&key, strokes, own, around)?;
            let painting =
                Painting::new(own, strokes, skin, around.progress).map_err(below(key))?;
            return Ok((PreparedSource::Strokes(Arc::new(painting)), mended));
        }
    };
    Ok((PreparedSource::Fill(fill), mended))
}

fn prepare_mask(
    at: &str,
    mask: &Mask,
    surface: &Surface,
    around: &mut Around<'_>,
) -> Result<PreparedMask> {
    let source = match &mask.source {
        MaskSource::Strokes(strokes) => {
            let key = format!("{at}.strokes");
            let skin = skin(&key, strokes, surface, around)?;
            Weights::Painted {
                painting: Painting::new(surface, strokes, skin, around.progress)
                    .map_err(below(key))?,
                start: mask.start.unwrap_or(0.0),
            }
        }
        MaskSource::Pattern(p) => {
            let seed = mask
                .seed
                .unwrap_or_else(|| derived_seed(surface.seed, "mask"));
            let (low, high) = mask.thresholds();
            Weights::Value {
                source: p.prepare(&Surface { seed, ..*surface })?,
                low,
                high,
            }
        }
        shape => {
            let outline = shape.outline().expect("a shape")?;
            Weights::Drawn(DrawnMask::draw(
                &outline,
                surface.size,
                surface.wrap,
                feather_texels(mask, surface),
            ))
        }
    };
    Ok(PreparedMask {
        invert: mask.invert,
        source,
    })
}
