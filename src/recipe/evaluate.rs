//! A recipe to a map, in two steps: [`Recipe::prepare`] does once what needs the whole; [`Prepared::fill`] is pure and
//! gives for any rectangle exactly what the whole would.

use super::image::Laid;
use super::layer::{Blend, below, derived_seed};
use super::shelf::Shelf;
use super::{
    Channels, Files, Layer, LeftOut, Mask, MaskSource, Recipe, Source, Stamp, file_of_mesh,
};
use crate::coverage::DrawnMask;
use crate::error::{Error, Result};
use crate::map::{
    ALPHA_MAX, ALPHA_MIN, AnisoMap, DEFAULT_TEXEL, Mended, Rect, Region, RegionMut, Size,
    SlopeCovariance, Texel, blend, blend_numbers,
};
use crate::math::{self, AXIS_MIN_LENGTH, Axis, choose, smoothstep};
use crate::mesh::Body;
use crate::paint::{Painting, Skin, Strokes};
use crate::pattern::{Fill, Patch, Surface};
use crate::progress::Progress;
use fearless_simd::{Simd, dispatch};
use fearless_simd_macros::simd;
use glam::Vec2;
use rayon::prelude::*;
use std::sync::Arc;

/// Texels of a tile: its planes, about 30 bytes a texel, stay in a core's second cache.
const TILE_WIDTH: u32 = 256;
const TILE_HEIGHT: u32 = 32;
/// Texels of a band that one pattern fills straight into the map.
const BAND_TEXELS: u32 = 32_768;

/// Side of the squares that a map is made in where strokes look around themselves.
const SQUARE: u32 = 2048;

/// What layers lay in a rectangle; see [`Prepared::above`].
pub struct Above {
    rect: Rect,
    /// `None` of strokes, which depend on what lies below them.
    sheets: Vec<Option<Sheet>>,
}

impl Above {
    /// Bytes that it holds, about.
    pub fn bytes(&self) -> usize {
        self.sheets
            .iter()
            .flatten()
            .map(Sheet::bytes)
            .sum::<usize>()
            + 64
    }
}

/// What one layer lays in a rectangle.
struct Sheet {
    texels: Region,
    /// `None` where all is covered.
    coverage: Option<Vec<f32>>,
    weight: Weight,
}

/// Coverage times mask times opacity.
enum Weight {
    Even(f32),
    Each(Vec<f32>),
}

impl Sheet {
    fn bytes(&self) -> usize {
        let numbers = 4 * self.texels.rect().texels();
        let more = self.coverage.as_ref().map_or(0, Vec::len);
        let weight = match &self.weight {
            Weight::Even(_) => 0,
            Weight::Each(weight) => weight.len(),
        };
        4 * (numbers + more + weight)
    }
}

/// A layer without its mask, and what lies below it; see [`Prepared::unmasked`].
pub struct Unmasked {
    below: Region,
    sheet: Sheet,
}

impl Unmasked {
    /// Bytes that it holds, about.
    pub fn bytes(&self) -> usize {
        16 * self.below.rect().texels() + self.sheet.bytes()
    }
}

/// A recipe prepared for one size. Cloning copies references only.
#[derive(Clone)]
pub struct Prepared {
    surface: Surface,
    layers: Vec<PreparedLayer>,
    adjust: Option<Turned>,
    shelf: Shelf,
    /// What of the recipe is not there.
    left_out: Vec<LeftOut>,
}

#[derive(Clone)]
struct PreparedLayer {
    /// Its number in the recipe.
    at: usize,
    opacity: f32,
    channels: Channels,
    source: PreparedSource,
    mask: Option<Arc<PreparedMask>>,
    of: Origin,
    /// What reading its image had to change.
    mended: Mended,
}

/// What a source and a mask were made of.
#[derive(Clone)]
struct Origin {
    source: Source,
    mask: Option<Mask>,
    surface: Surface,
    /// The recipe's mesh, where strokes lie on it.
    mesh: Option<String>,
    /// Those of all files that it is made of.
    stamps: Vec<Option<Stamp>>,
}

impl Origin {
    /// Whether it has the mesh and the files, as they are, of another one.
    fn is_made_of(&self, other: &Self) -> bool {
        self.mesh == other.mesh && self.stamps == other.stamps
    }

    /// Whether it has strokes on the mesh of that word.
    fn lies_on(&self, word: &str) -> bool {
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
enum PreparedSource {
    /// What does not know what lies below it.
    Fill(Arc<dyn Fill>),
    /// What was painted over what lies below.
    Strokes(Arc<Painting>),
}

struct PreparedMask {
    invert: bool,
    source: Weights,
}

enum Weights {
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
struct Turned {
    alpha_x: f32,
    alpha_y: f32,
    axis: Axis,
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
    fn check_masks(&self, surface: &Surface) -> Result<()> {
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
            let skin = skin(&format!("{at}.strokes"), strokes, surface, around)?;
            Weights::Painted {
                painting: Painting::new(surface, strokes, skin, around.progress)?,
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

/// Room for one tile's work, kept from tile to tile.
#[derive(Default)]
struct Scratch {
    layer: [Vec<f32>; 4],
    coverage: Vec<f32>,
    value: Vec<f32>,
    weight: Vec<f32>,
}

impl Scratch {
    fn resize(&mut self, texels: usize) {
        let vectors = [&mut self.coverage, &mut self.value, &mut self.weight];
        for v in self.layer.iter_mut().chain(vectors) {
            v.resize(texels, 0.0);
        }
    }

    /// A tile of a layer of strokes, of which none looks around itself here, over the region below it.
    fn paint(&mut self, painting: &Painting, region: &mut RegionMut<'_>, tile: Rect) {
        let mut below = Region::constant(tile, DEFAULT_TEXEL);
        let n = tile.width as usize;
        for (j, y) in (tile.y..tile.y + tile.height).enumerate() {
            let (to, from) = (j * n, region.rect.index(tile.x, y));
            below.alpha_x[to..to + n].copy_from_slice(&region.alpha_x[from..from + n]);
            below.alpha_y[to..to + n].copy_from_slice(&region.alpha_y[from..from + n]);
            below.cos2[to..to + n].copy_from_slice(&region.cos2[from..from + n]);
            below.sin2[to..to + n].copy_from_slice(&region.sin2[from..from + n]);
        }
        let mut now = below.clone();
        self.coverage.fill(0.0);
        painting.paint(
            0..painting.len(),
            tile,
            &below,
            &mut now,
            &mut self.coverage,
        );
        copy(&now, &mut self.patch(tile).region);
        // What was painted holds what lies below it.
        self.coverage.fill(1.0);
    }

    /// The layer's planes as a region that lies at `rect`, and what a patch needs beside it.
    fn patch(&mut self, rect: Rect) -> Patch<'_> {
        let [alpha_x, alpha_y, cos2, sin2] = &mut self.layer;
        Patch {
            region: RegionMut {
                rect,
                alpha_x,
                alpha_y,
                cos2,
                sin2,
            },
            coverage: &mut self.coverage,
            value: &mut self.value,
        }
    }
}

/// Copies a rectangle's texels from a region that holds it.
fn copy(from: &Region, to: &mut RegionMut<'_>) {
    let n = to.rect.width as usize;
    for y in to.rect.y..to.rect.y + to.rect.height {
        let (a, b) = (from.rect().index(to.rect.x, y), to.rect.index(to.rect.x, y));
        to.alpha_x[b..b + n].copy_from_slice(&from.alpha_x[a..a + n]);
        to.alpha_y[b..b + n].copy_from_slice(&from.alpha_y[a..a + n]);
        to.cos2[b..b + n].copy_from_slice(&from.cos2[a..a + n]);
        to.sin2[b..b + n].copy_from_slice(&from.sin2[a..a + n]);
    }
}

impl Prepared {
    /// The size it was prepared for.
    pub fn size(&self) -> Size {
        self.surface.size
    }

    /// The layers that were left out because of their files: see [`Recipe::prepare_readable`].
    pub fn left_out(&self) -> &[LeftOut] {
        &self.left_out
    }

    /// The same, which has what another one read of files: [`Recipe::prepare_after`] does not read that again.
    #[must_use]
    pub fn with_files_of(mut self, other: &Self) -> Self {
        self.shelf = other.shelf.clone();
        self
    }

    /// The same, which knows a mesh of the recipe by the word for it, as its file was with that stamp: [`Recipe::prepare_after`]
    /// does not read it again.
    #[must_use]
    pub fn with_mesh(mut self, word: &str, stamp: Option<Stamp>, body: &Arc<Body>) -> Self {
        let old = self.shelf.any(word);
        if old.is_some_and(|old| !Arc::ptr_eq(old, body)) {
            // Its file was read anew: what lies on the old one is to be made anew.
            self.layers.retain(|layer| !layer.of.lies_on(word));
        }
        self.shelf.keep(word, stamp, body);
        self
    }

    /// The mesh of that word, where it is known as its file was with that stamp.
    pub fn mesh(&self, word: &str, stamp: Option<Stamp>) -> Option<&Arc<Body>> {
        self.shelf.known(word, stamp)
    }

    /// A mesh as this map lies on it, for strokes that are to be painted there; kept for those that come after.
    ///
    /// # Errors
    /// As [`Files::mesh`], the mesh being named under `key`.
    pub fn skin(&mut self, key: &str, word: &str, files: &Files) -> Result<Arc<Skin>> {
        let surface = self.surface;
        self.shelf.skin(key, word, &surface, files)
    }

    /// What its layers are filled onto; the seed is the recipe's.
    pub fn surface(&self) -> Surface {
        self.surface
    }

    /// Fills any rectangle with what lies below the layer that has the number `at` in the recipe.
    ///
    /// # Panics
    /// When the rectangle reaches outside the map.
    pub fn fill_below(&self, at: usize, mut region: RegionMut<'_>) {
        self.assert_inside(region.rect);
        let below = self.layers.partition_point(|l| l.at < at);
        composite(&self.layers[..below], &mut region, &mut Scratch::default());
    }

    /// The rectangle that [`Prepared::fill_over`] needs for `rect`: larger where strokes above the layer `at` look around
    /// themselves.
    pub fn needs_over(&self, at: usize, rect: Rect) -> Rect {
        let above = self.layers.iter().rev().take_while(|l| l.at > at);
        above.fold(rect, |rect, layer| layer.needs(rect))
    }

    /// Whether strokes above the layer `at` look around themselves anywhere.
    pub fn looks_over(&self, at: usize) -> bool {
        let map = self.surface.size.rect();
        self.layers.iter().any(|l| l.at > at && l.looks(map))
    }

    /// What the layers above the layer `at` lay in a rectangle, made once for many [`Prepared::fill_over`].
    ///
    /// # Panics
    /// When the rectangle reaches outside the map.
    pub fn above(&self, at: usize, rect: Rect) -> Above {
        self.assert_inside(rect);
        let mut scratch = Scratch::default();
        let above = self.layers.iter().filter(|l| l.at > at);
        Above {
            rect,
            sheets: above.map(|l| l.sheet(rect, &mut scratch)).collect(),
        }
    }

    /// Bytes of [`Prepared::above`] a texel, at most.
    pub fn bytes_above(&self, at: usize) -> usize {
        let fills = |l: &&PreparedLayer| l.at > at && matches!(l.source, PreparedSource::Fill(_));
        self.layers.iter().filter(fills).count() * 24
    }

    /// Makes the composite of what lies below the layer `at`, which is in `region`, and what strokes made of that: the layer
    /// itself with its opacity, mask and channels, the layers above it, and the recipe's adjustment. Where `at` does not show,
    /// the others do. What is right afterwards is `rect`; `region` is of its [`Prepared::needs_over`], and `painted` holds that.
    /// `above` may be what the layers above lay there.
    ///
    /// # Panics
    /// When the regions do not hold what `rect` needs.
    pub fn fill_over(
        &self,
        at: usize,
        painted: &Region,
        rect: Rect,
        region: &mut Region,
        above: Option<&Above>,
    ) {
        let needed = self.needs_over(at, rect);
        let holds = |r: Rect| r.intersection(needed) == Some(needed);
        assert!(
            region.rect() == needed && holds(painted.rect()) && above.is_none_or(|a| holds(a.rect)),
            "{:?} must be and {:?} hold {needed:?}",
            region.rect(),
            painted.rect()
        );
        let mut scratch = Scratch::default();
        let painted_on = self.layers.iter().find(|l| l.at == at);
        match painted_on {
            Some(layer) if layer.is_plain() => region.copy_from(painted),
            Some(layer) => layer.lay(painted, &mut region.view_mut(), &mut scratch),
            None => {}
        }
        self.go_above(at, rect, region, above, &mut scratch);
    }

    /// The layer `at` without its mask and what lies below it, in a rectangle, made once for many [`Prepared::fill_masked`].
    /// Where it does not show there is nothing of it.
    ///
    /// # Panics
    /// When the rectangle reaches outside the map.
    pub fn unmasked(&self, at: usize, rect: Rect) -> Unmasked {
        self.assert_inside(rect);
        let mut scratch = Scratch::default();
        let n = self.layers.partition_point(|l| l.at < at);
        let layer = self.layers.get(n).filter(|l| l.at == at);
        let needs = layer.map_or(rect, |l| l.needs(rect));
        let mut under = Region::constant(needs, DEFAULT_TEXEL);
        composite(&self.layers[..n], &mut under.view_mut(), &mut scratch);
        let sheet = match layer {
            None => Sheet {
                texels: under.crop(rect),
                coverage: None,
                weight: Weight::Even(0.0),
            },
            Some(layer) => match &layer.source {
                PreparedSource::Fill(source) => layer.own_sheet(&**source, rect, &mut scratch),
                PreparedSource::Strokes(painting) => Sheet {
                    texels: painted_over(painting, rect, &under).crop(rect),
                    coverage: None,
                    weight: Weight::Even(layer.opacity),
                },
            },
        };
        Unmasked {
            below: under.crop(rect),
            sheet,
        }
    }

    /// The composite of a rectangle with another mask of the layer `at`, given in row order before it is inverted: as
    /// [`Prepared::fill`] of a recipe with that mask, but for layers of strokes above that look around themselves: they are left
    /// out. `layer` holds the rectangle.
    ///
    /// # Panics
    /// When `layer` does not hold the rectangle, or the mask is of another length.
    pub fn fill_masked(
        &self,
        at: usize,
        layer: &Unmasked,
        mask: &[f32],
        rect: Rect,
        above: Option<&Above>,
    ) -> Region {
        assert_eq!(mask.len(), rect.texels(), "a number for each texel");
        let mut region = layer.below.crop(rect);
        let mut scratch = Scratch::default();
        if let Some(prepared) = self.layers.iter().find(|l| l.at == at) {
            prepared.lay_masked(&layer.sheet, mask, &mut region, &mut scratch);
        }
        self.go_above(at, rect, &mut region, above, &mut scratch);
        region
    }

    /// The layers above the layer `at`, and the recipe's adjustment, over a region.
    fn go_above(
        &self,
        at: usize,
        rect: Rect,
        region: &mut Region,
        above: Option<&Above>,
        scratch: &mut Scratch,
    ) {
        let mut sheets = above.map(|a| a.sheets.iter());
        let first = self.layers.partition_point(|l| l.at <= at);
        for (i, layer) in self.layers.iter().enumerate().skip(first) {
            let sheet = sheets.as_mut().and_then(|s| s.next()?.as_ref());
            if let Some(sheet) = sheet {
                layer.lay_sheet(sheet, &mut region.view_mut(), scratch);
                continue;
            }
            let above = self.layers[i + 1..].iter().rev();
            let part = above.fold(rect, |rect, layer| layer.needs(rect));
            let needs = layer.needs(part);
            if region.rect().intersection(needs) == Some(needs) {
                layer.go_over(part, region, scratch);
            }
        }
        if let Some(adjust) = &self.adjust {
            adjust.apply(&mut region.view_mut());
        }
    }

    fn assert_inside(&self, rect: Rect) {
        let size = self.surface.size;
        let inside = size.rect().intersection(rect) == Some(rect);
        assert!(inside, "{rect:?} reaches outside {size}");
    }

    /// What reading the layers' images had to change for them to be usable.
    pub fn mended(&self) -> Mended {
        let all = self.layers.iter().map(|layer| layer.mended);
        all.fold(Mended::default(), Mended::plus)
    }

    /// Fills any rectangle of the map, exactly as the whole would be there.
    ///
    /// # Panics
    /// When the rectangle reaches outside the map.
    pub fn fill(&self, region: RegionMut<'_>) {
        self.assert_inside(region.rect);
        self.fill_with(region, &mut Scratch::default());
    }

    /// A rectangle of the map, exactly as the whole would be there.
    ///
    /// # Panics
    /// When the rectangle reaches outside the map.
    pub fn region(&self, rect: Rect) -> Region {
        let mut region = Region::constant(rect, DEFAULT_TEXEL);
        self.fill(region.view_mut());
        region
    }

    /// The whole map, on all threads of the current pool.
    ///
    /// # Errors
    /// [`crate::Error::Cancelled`] when `progress` says so.
    pub fn map(&self, progress: &Progress<'_>) -> Result<AnisoMap> {
        if self
            .layers
            .iter()
            .any(|l| l.looks(self.surface.size.rect()))
        {
            return self.map_in_squares(progress);
        }
        let mut map = AnisoMap::unfilled(self.surface.size, self.surface.wrap);
        let rows = match self.only_layer() {
            Some(_) => (BAND_TEXELS / self.surface.size.width()).max(1),
            None => TILE_HEIGHT,
        };
        let bands = map.bands_mut(rows);
        progress.expect(bands.len() as u64);
        bands
            .into_par_iter()
            .try_for_each_init(Scratch::default, |scratch, band| {
                progress.check()?;
                self.fill_with(band, scratch);
                progress.step()
            })?;
        Ok(map)
    }

    /// The whole map in large squares: what strokes see around themselves would otherwise be made anew for every small tile.
    fn map_in_squares(&self, progress: &Progress<'_>) -> Result<AnisoMap> {
        let mut map = AnisoMap::constant(self.surface.size, self.surface.wrap, DEFAULT_TEXEL);
        let squares: Vec<Rect> = self.surface.size.rect().tiles(SQUARE).collect();
        progress.expect(squares.len() as u64);
        for square in squares {
            progress.check()?;
            map.write_region(&self.region(square));
            progress.step()?;
        }
        Ok(map)
    }

    /// The source that can be filled straight into the map: of the only layer, opaque, unmasked, of every channel.
    fn only_layer(&self) -> Option<&dyn Fill> {
        match &self.layers[..] {
            [
                PreparedLayer {
                    source: PreparedSource::Fill(source),
                    mask: None,
                    opacity: 1.0,
                    channels: Channels::ALL,
                    ..
                },
            ] => Some(&**source),
            _ => None,
        }
    }

    fn fill_with(&self, mut region: RegionMut<'_>, scratch: &mut Scratch) {
        if let Some(layer) = self.only_layer() {
            fill_straight(layer, region.reborrow(), scratch);
        } else {
            composite(&self.layers, &mut region, scratch);
        }
        if let Some(adjust) = &self.adjust {
            adjust.apply(&mut region);
        }
    }
}

/// Layers one over the other, the first at the bottom.
fn composite(layers: &[PreparedLayer], region: &mut RegionMut<'_>, scratch: &mut Scratch) {
    // A stroke that looks around itself sees more of what lies below than the rectangle: all below it comes first, and larger.
    let looking = layers.iter().rposition(|l| l.looks(region.rect));
    let above = match looking {
        Some(n) => {
            layers[n].paint_over(&layers[..n], region, scratch);
            &layers[n + 1..]
        }
        None => {
            set_default(region);
            layers
        }
    };
    each_tile(region, scratch, |region, tile, scratch| {
        for layer in above {
            layer.blend_over(region, tile, scratch);
        }
    });
}

/// Calls `work` with every tile of a region and room for its work; bands of tiles side by side where there are several.
fn each_tile(
    region: &mut RegionMut<'_>,
    scratch: &mut Scratch,
    work: impl Fn(&mut RegionMut<'_>, Rect, &mut Scratch) + Sync,
) {
    let width = region.rect.width.min(TILE_WIDTH);
    let height = (TILE_WIDTH * TILE_HEIGHT / width).min(region.rect.height);
    let band = |mut band: RegionMut<'_>, scratch: &mut Scratch| {
        for tile in tiles(band.rect, width, height) {
            scratch.resize(tile.texels());
            work(&mut band, tile, scratch);
        }
    };
    if region.rect.height == height {
        return band(region.reborrow(), scratch);
    }
    let bands = region.reborrow().into_bands(height);
    bands
        .into_par_iter()
        .for_each_init(Scratch::default, |scratch, part| band(part, scratch));
}

fn set_default(region: &mut RegionMut<'_>) {
    region.alpha_x.fill(DEFAULT_TEXEL.alpha_x);
    region.alpha_y.fill(DEFAULT_TEXEL.alpha_y);
    region.cos2.fill(DEFAULT_TEXEL.axis.cos2);
    region.sin2.fill(DEFAULT_TEXEL.axis.sin2);
}

/// Tiles of `width` x `height` texels that cover a rectangle; those at its right and lower edge may be smaller.
fn tiles(rect: Rect, width: u32, height: u32) -> impl Iterator<Item = Rect> {
    let rows = (rect.y..rect.y + rect.height).step_by(height as usize);
    rows.flat_map(move |y| {
        let columns = (rect.x..rect.x + rect.width).step_by(width as usize);
        columns.map(move |x| Rect {
            x,
            y,
            width: width.min(rect.x + rect.width - x),
            height: height.min(rect.y + rect.height - y),
        })
    })
}

/// The pattern writes into the map itself; only what it does not cover is blended, with the default below it.
fn fill_straight(source: &dyn Fill, region: RegionMut<'_>, scratch: &mut Scratch) {
    let texels = region.rect.texels();
    scratch.coverage.resize(texels, 0.0);
    scratch.value.resize(texels, 0.0);
    let mut patch = Patch {
        region,
        coverage: &mut scratch.coverage,
        value: &mut scratch.value,
    };
    source.fill(&mut patch);
    let mut region = patch.region;
    for (i, c) in patch.coverage.iter().enumerate() {
        if *c < 1.0 {
            region.set(i, cover(DEFAULT_TEXEL, region.texel(i), *c));
        }
    }
}

/// A texel of which `over` covers the part `coverage` and `below` shows in the rest: both lobes are seen side by side, so
/// their slope covariances are averaged, as a map reduced from a larger one would have them.
fn cover(below: Texel, over: Texel, coverage: f32) -> Texel {
    if coverage <= 0.0 {
        return below;
    }
    let sum =
        SlopeCovariance::from(below) * (1.0 - coverage) + SlopeCovariance::from(over) * coverage;
    let named = if coverage < 0.5 { below } else { over };
    sum.to_texel(named.alpha_x > named.alpha_y, named.axis)
}

/// What all strokes make of a region; right in `rect`.
fn painted_over(painting: &Painting, rect: Rect, under: &Region) -> Region {
    let mut painted = under.clone();
    let mut coverage = vec![0.0; under.rect().texels()];
    let all = 0..painting.len();
    painting.paint(all, rect, under, &mut painted, &mut coverage);
    painted
}

impl PreparedLayer {
    /// Fills a tile of the layer and blends it over the region below.
    fn blend_over(&self, region: &mut RegionMut<'_>, tile: Rect, scratch: &mut Scratch) {
        if let Some(mask) = &self.mask {
            mask.fill(tile, scratch);
            if scratch.weight.iter().all(|w| *w == 0.0) {
                return; // nothing of the layer shows here
            }
        }
        match &self.source {
            PreparedSource::Fill(source) => source.fill(&mut scratch.patch(tile)),
            PreparedSource::Strokes(painting) => scratch.paint(painting, region, tile),
        }
        self.blend_tile(region, tile, scratch);
    }

    /// Whether the layer shows its source as it is.
    fn is_plain(&self) -> bool {
        self.opacity == 1.0 && self.mask.is_none() && self.channels == Channels::ALL
    }

    /// Whether a stroke of the layer looks around itself in a rectangle.
    fn looks(&self, rect: Rect) -> bool {
        match &self.source {
            PreparedSource::Fill(_) => false,
            PreparedSource::Strokes(painting) => painting.looks(rect),
        }
    }

    /// Fills a region with the layers below and this one over them, a layer of strokes of which some look around themselves.
    fn paint_over(&self, below: &[Self], region: &mut RegionMut<'_>, scratch: &mut Scratch) {
        let PreparedSource::Strokes(painting) = &self.source else {
            return composite(below, region, scratch);
        };
        let rect = region.rect;
        let mut under = Region::constant(painting.needs(rect), DEFAULT_TEXEL);
        composite(below, &mut under.view_mut(), scratch);
        let painted = painted_over(painting, rect, &under);
        copy(&under, region);
        self.lay(&painted, region, scratch);
    }

    /// What the layer lays in a rectangle, if that does not depend on what lies below.
    fn sheet(&self, rect: Rect, scratch: &mut Scratch) -> Option<Sheet> {
        let PreparedSource::Fill(source) = &self.source else {
            return None;
        };
        scratch.resize(rect.texels());
        if let Some(mask) = &self.mask {
            mask.fill(rect, scratch);
        }
        let hidden = self.mask.is_some() && scratch.weight.iter().all(|w| *w == 0.0);
        if hidden {
            let nothing = Rect { height: 0, ..rect };
            return Some(Sheet {
                texels: Region::constant(nothing, DEFAULT_TEXEL),
                coverage: None,
                weight: Weight::Even(0.0),
            });
        }
        source.fill(&mut scratch.patch(rect));
        self.weigh(scratch, self.mask.is_some());
        Some(made(rect, scratch))
    }

    /// What the layer of such a source lays without its mask.
    fn own_sheet(&self, source: &dyn Fill, rect: Rect, scratch: &mut Scratch) -> Sheet {
        scratch.resize(rect.texels());
        source.fill(&mut scratch.patch(rect));
        self.weigh(scratch, false);
        made(rect, scratch)
    }

    /// Blends what was made of the layer without its mask over a region, which it holds, with another mask.
    fn lay_masked(&self, sheet: &Sheet, mask: &[f32], region: &mut Region, scratch: &mut Scratch) {
        let (rect, all) = (region.rect(), sheet.texels.rect());
        let n = rect.width as usize;
        let invert = self.mask.as_ref().is_some_and(|m| m.invert);
        let t = &sheet.texels;
        for (j, y) in (rect.y..rect.y + rect.height).enumerate() {
            let (to, from) = (rect.index(rect.x, y), all.index(rect.x, y));
            let from = from..from + n;
            let shows = |w: f32| if invert { 1.0 - w } else { w };
            let mask = mask[j * n..(j + 1) * n].iter().map(|w| shows(*w));
            scratch.weight.clear();
            match &sheet.weight {
                Weight::Even(weight) => scratch.weight.extend(mask.map(|w| w * weight)),
                Weight::Each(weight) => {
                    let weights = weight[from.clone()].iter().zip(mask);
                    scratch.weight.extend(weights.map(|(weight, w)| w * weight));
                }
            }
            let row = Row {
                planes: [&t.alpha_x, &t.alpha_y, &t.cos2, &t.sin2].map(|p| &p[from.clone()]),
                coverage: sheet.coverage.as_ref().map(|c| &c[from.clone()]),
                weight: &scratch.weight,
            };
            self.blend_row(&mut region.view_mut(), to, &row);
        }
    }

    /// Blends what was made of the layer over a region, which it holds.
    fn lay_sheet(&self, sheet: &Sheet, region: &mut RegionMut<'_>, scratch: &mut Scratch) {
        if matches!(sheet.weight, Weight::Even(0.0)) {
            return;
        }
        let (rect, all) = (region.rect, sheet.texels.rect());
        let n = rect.width as usize;
        if let Weight::Even(weight) = sheet.weight {
            scratch.weight.clear();
            scratch.weight.resize(n, weight);
        }
        let t = &sheet.texels;
        for y in rect.y..rect.y + rect.height {
            let (to, from) = (rect.index(rect.x, y), all.index(rect.x, y));
            let from = from..from + n;
            let row = Row {
                planes: [&t.alpha_x, &t.alpha_y, &t.cos2, &t.sin2].map(|p| &p[from.clone()]),
                coverage: sheet.coverage.as_ref().map(|c| &c[from.clone()]),
                weight: match &sheet.weight {
                    Weight::Even(_) => &scratch.weight,
                    Weight::Each(weight) => &weight[from],
                },
            };
            self.blend_row(region, to, &row);
        }
    }

    /// Blends what strokes made of a region, or of more than that, over it.
    fn lay(&self, painted: &Region, region: &mut RegionMut<'_>, scratch: &mut Scratch) {
        each_tile(region, scratch, |region, tile, scratch| {
            if let Some(mask) = &self.mask {
                mask.fill(tile, scratch);
            }
            copy(painted, &mut scratch.patch(tile).region);
            scratch.coverage.fill(1.0);
            self.blend_tile(region, tile, scratch);
        });
    }

    /// The rectangle below it that the layer needs for `rect`.
    fn needs(&self, rect: Rect) -> Rect {
        match &self.source {
            PreparedSource::Fill(_) => rect,
            PreparedSource::Strokes(painting) => painting.needs(rect),
        }
    }

    /// Goes over the part `rect` of a region that holds what lies below it there, and as far around as the layer needs.
    fn go_over(&self, rect: Rect, region: &mut Region, scratch: &mut Scratch) {
        match &self.source {
            PreparedSource::Strokes(painting) if painting.looks(rect) => {
                let painted = painted_over(painting, rect, region);
                let mut part = Region::constant(rect, DEFAULT_TEXEL);
                part.copy_from(region);
                self.lay(&painted, &mut part.view_mut(), scratch);
                region.copy_from(&part);
            }
            _ => each_tile(&mut region.view_mut(), scratch, |region, tile, scratch| {
                self.blend_over(region, tile, scratch);
            }),
        }
    }

    /// Makes coverage times mask times opacity of the mask's weights in the scratch.
    fn weigh(&self, scratch: &mut Scratch, is_masked: bool) {
        if is_masked {
            for (w, c) in scratch.weight.iter_mut().zip(&scratch.coverage) {
                *w *= c * self.opacity;
            }
        } else {
            for (w, c) in scratch.weight.iter_mut().zip(&scratch.coverage) {
                *w = c * self.opacity;
            }
        }
    }

    /// Blends what the scratch holds of the layer over a tile of the region below.
    fn blend_tile(&self, region: &mut RegionMut<'_>, tile: Rect, scratch: &mut Scratch) {
        self.weigh(scratch, self.mask.is_some());
        let n = tile.width as usize;
        for (j, y) in (tile.y..tile.y + tile.height).enumerate() {
            let (to, from) = (region.rect.index(tile.x, y), j * n..(j + 1) * n);
            let row = Row {
                planes: scratch.layer.each_ref().map(|p| &p[from.clone()]),
                coverage: Some(&scratch.coverage[from.clone()]),
                weight: &scratch.weight[from],
            };
            self.blend_row(region, to, &row);
        }
    }

    fn blend_row(&self, region: &mut RegionMut<'_>, to: usize, row: &Row<'_>) {
        let partly = match row.coverage {
            Some(coverage) if self.channels == Channels::ALL => {
                blend_partly(region, to, row, coverage)
            }
            _ => Vec::new(),
        };
        let n = row.weight.len();
        let planes = [
            &mut region.alpha_x[to..to + n],
            &mut region.alpha_y[to..to + n],
            &mut region.cos2[to..to + n],
            &mut region.sin2[to..to + n],
        ];
        dispatch!(math::level(), simd => blend_whole(simd, self.channels, row, planes));
        for (i, texel) in partly {
            region.set(to + i, texel);
        }
    }
}

/// The sheet of what the scratch holds of a layer.
fn made(rect: Rect, scratch: &Scratch) -> Sheet {
    let mut texels = Region::constant(rect, DEFAULT_TEXEL);
    let planes = [
        &mut texels.alpha_x,
        &mut texels.alpha_y,
        &mut texels.cos2,
        &mut texels.sin2,
    ];
    for (to, from) in planes.into_iter().zip(&scratch.layer) {
        to.copy_from_slice(from);
    }
    let first = scratch.weight[0];
    let even = scratch.weight.iter().all(|w| *w == first);
    let whole = scratch.coverage.iter().all(|c| *c == 1.0);
    Sheet {
        texels,
        coverage: (!whole).then(|| scratch.coverage.clone()),
        weight: if even {
            Weight::Even(first)
        } else {
            Weight::Each(scratch.weight.clone())
        },
    }
}

/// A row of a layer.
struct Row<'a> {
    planes: [&'a [f32]; 4],
    /// `None` where all is covered.
    coverage: Option<&'a [f32]>,
    /// Coverage times mask times opacity.
    weight: &'a [f32],
}

/// The texels of a row that are covered in part: opacity and mask blend the layer with what lies below, and the blend covers
/// its part of the texel.
fn blend_partly(
    region: &RegionMut<'_>,
    to: usize,
    row: &Row<'_>,
    coverage: &[f32],
) -> Vec<(usize, Texel)> {
    let mut found = Vec::new();
    for (i, (&coverage, &weight)) in coverage.iter().zip(row.weight).enumerate() {
        if coverage <= 0.0 || coverage >= 1.0 || weight <= 0.0 {
            continue;
        }
        let below = region.texel(to + i);
        let [alpha_x, alpha_y, cos2, sin2] = row.planes.map(|p| p[i]);
        let layer = Texel {
            alpha_x,
            alpha_y,
            axis: Axis { cos2, sin2 },
        };
        let share = weight / coverage;
        let over = if share >= 1.0 {
            layer
        } else {
            blend(below, layer, share)
        };
        found.push((i, cover(below, over, coverage)));
    }
    found
}

/// Texels that are blended at a time.
const LANES: usize = 16;

/// A part of a row, filled up where it is shorter.
#[inline(always)]
fn lane(from: &[f32]) -> [f32; LANES] {
    from.try_into().unwrap_or_else(|_| {
        let mut lane = [1.0; LANES];
        lane[..from.len()].copy_from_slice(from);
        lane
    })
}

#[inline(always)]
fn blend_lane(
    [x, y, c, s]: &mut [[f32; LANES]; 4],
    new: &[[f32; LANES]; 4],
    weight: &[f32; LANES],
) {
    for i in 0..LANES {
        let w = weight[i];
        let old = [x[i], y[i], c[i], s[i]];
        let new = [new[0][i], new[1][i], new[2][i], new[3][i]];
        let blended = blend_numbers(old, new, w);
        let chosen = |k: usize| choose(w >= 1.0, new[k], choose(w > 0.0, blended[k], old[k]));
        (x[i], y[i], c[i], s[i]) = (chosen(0), chosen(1), chosen(2), chosen(3));
    }
}

/// A row of which every texel is blended by its weight, as [`blend`] does it; exact at weights 0 and 1. With some channels only,
/// each is blended alone and it ends as [`crate::map::settle`] ends; where the weight is 0 or 1 nothing was blended, and the axis
/// is left as it came.
#[simd]
fn blend_whole<S: Simd>(_: S, channels: Channels, row: &Row<'_>, planes: [&mut [f32]; 4]) {
    let n = row.weight.len();
    let weight = row.weight;
    let [ax, ay, c, s] = planes.map(|p| &mut p[..n]);
    let [ox, oy, oc, os] = row.planes.map(|p| &p[..n]);
    if channels == Channels::ALL {
        // Copies of known length: of slices the compiler would have to ask which overlap.
        for start in (0..n).step_by(LANES) {
            let part = start..n.min(start + LANES);
            let w = lane(&weight[part.clone()]);
            let mut old = [&*ax, &*ay, &*c, &*s].map(|p| lane(&p[part.clone()]));
            let new = [ox, oy, oc, os].map(|p| lane(&p[part.clone()]));
            blend_lane(&mut old, &new, &w);
            for (plane, lane) in [&mut *ax, &mut *ay, &mut *c, &mut *s].into_iter().zip(&old) {
                plane[part.clone()].copy_from_slice(&lane[..part.len()]);
            }
        }
        return;
    }
    let mix = |p: f32, o: f32, w: f32| p * (1.0 - w) + o * w;
    if channels.alpha_x {
        for i in 0..n {
            ax[i] = mix(ax[i], ox[i], weight[i]);
        }
    }
    if channels.alpha_y {
        for i in 0..n {
            ay[i] = mix(ay[i], oy[i], weight[i]);
        }
    }
    if !channels.direction {
        return;
    }
    for i in 0..n {
        let w = weight[i];
        let (x, y) = (mix(c[i], oc[i], w), mix(s[i], os[i], w));
        let length = (x * x + y * y).sqrt();
        let blended = (w > 0.0) & (w < 1.0);
        let lost = blended & (length < AXIS_MIN_LENGTH);
        let scale = 1.0 / length.max(AXIS_MIN_LENGTH);
        let scale = if blended { scale } else { 1.0 };
        let round = (ax[i] * ay[i]).sqrt();
        ax[i] = if lost { round } else { ax[i] };
        ay[i] = if lost { round } else { ay[i] };
        c[i] = if lost { 1.0 } else { x * scale };
        s[i] = if lost { 0.0 } else { y * scale };
    }
}

impl PreparedMask {
    /// The weights of a tile, into the scratch's `weight`.
    fn fill(&self, tile: Rect, scratch: &mut Scratch) {
        match &self.source {
            Weights::Drawn(mask) => mask.fill(tile, &mut scratch.weight),
            Weights::Painted { painting, start } => {
                scratch.weight.fill(*start);
                painting.cover(tile, &mut scratch.weight);
            }
            Weights::Value { source, low, high } => {
                source.fill(&mut scratch.patch(tile));
                for (w, v) in scratch.weight.iter_mut().zip(&scratch.value) {
                    *w = smoothstep(*low, *high, *v);
                }
            }
        }
        if self.invert {
            scratch.weight.iter_mut().for_each(|w| *w = 1.0 - *w);
        }
    }
}

impl Turned {
    fn apply(&self, region: &mut RegionMut<'_>) {
        let scale = |plane: &mut [f32], factor: f32| {
            if factor != 1.0 {
                for a in plane {
                    *a = (*a * factor).clamp(ALPHA_MIN, ALPHA_MAX);
                }
            }
        };
        scale(region.alpha_x, self.alpha_x);
        scale(region.alpha_y, self.alpha_y);
        if self.axis == Axis::U {
            return;
        }
        for (c, s) in region.cos2.iter_mut().zip(region.sin2.iter_mut()) {
            let turned = Axis { cos2: *c, sin2: *s }.turned(self.axis);
            (*c, *s) = (turned.cos2, turned.sin2);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::RecipeFile;
    use super::*;

    /// Every preset at 2048, reduced by slope covariance, against the same preset at 512.
    #[test]
    fn presets_are_the_same_at_every_size() {
        for preset in crate::recipe::PRESETS {
            let file = preset.recipe().unwrap();
            let at = |side: u32| {
                let size = Size::new(side, side).unwrap();
                file.recipe()
                    .prepare(size, &Files::default(), &Progress::none())
                    .unwrap()
                    .map(&Progress::none())
                    .unwrap()
            };
            let (large, small) = (at(2048), at(512));
            let reduced = crate::filter::reduce(&large, small.size()).unwrap();
            let (mut alpha, mut angle) = (Vec::new(), Vec::new());
            for i in 0..small.size().texels() {
                let (a, b) = (small.texel_at(i), reduced.texel_at(i));
                let sides = |t: Texel| [t.alpha_x.min(t.alpha_y), t.alpha_x.max(t.alpha_y)];
                let off = |k: usize| (sides(a)[k] / sides(b)[k] - 1.0).abs();
                alpha.push(off(0).max(off(1)));
                if a.ratio() > 1.1 && b.ratio() > 1.1 {
                    angle.push(a.groove().angle_to(b.groove()).to_degrees());
                }
            }
            alpha.sort_by(f32::total_cmp);
            angle.sort_by(f32::total_cmp);
            let middle = |v: &[f32]| v.get(v.len() / 2).copied().unwrap_or_default();
            println!(
                "{}: alpha {}, angle {}",
                preset.name,
                middle(&alpha),
                middle(&angle)
            );
            assert!(middle(&alpha) < 0.05, "{}: {}", preset.name, middle(&alpha));
            assert!(middle(&angle) < 2.0, "{}: {}", preset.name, middle(&angle));
        }
    }
    use crate::map::{Texel, Wrap, blend};

    fn map(text: &str) -> AnisoMap {
        let file = RecipeFile::parse(&format!("version = 1\n{text}"), "t.toml", None).unwrap();
        let recipe = file.recipe();
        let prepared = recipe
            .prepare(recipe.size, &Files::default(), &Progress::none())
            .unwrap();
        prepared.map(&Progress::none()).unwrap()
    }

    fn texel(alpha_x: f32, alpha_y: f32, degrees: f32) -> Texel {
        Texel {
            alpha_x,
            alpha_y,
            axis: Axis::from_degrees(degrees),
        }
    }

    fn near(a: Texel, b: Texel) -> bool {
        (a.alpha_x - b.alpha_x).abs() < 1e-6
            && (a.alpha_y - b.alpha_y).abs() < 1e-6
            && a.axis.angle_to(b.axis) < 1e-6
    }

    const MANY: &str = "size = [700, 130]\naspect = 2.0\n[adjust]\nalpha_x = 1.1\nturn = 20\n\
        [[layers]]\nname = 'a'\nconstant = { alpha_x = 0.1, alpha_y = 0.4, angle = 30.0 }\n\
        [[layers]]\nname = 'b'\nopacity = 0.7\nconstant = { alpha_x = 0.3, alpha_y = 0.05, angle = 100.0 }\n\
        [layers.mask]\npath = 'M 0.1 0.1 C 0.9 0.2 0.8 1.2 0.3 0.9 Z'\nfeather = 0.3\n\
        [[layers]]\nname = 'c'\nchannels = ['direction']\nconstant.angle = 60.0\n\
        [layers.mask]\ninvert = true\npolygon = [[0.5, 0.5], [1.2, 0.4], [0.9, 0.9]]\n\
        [[layers]]\nopacity = 0.8\nguides = { grid = 64, only_near = true, guide = [{ shape.line.points = [[0.2, 0.1], [0.9, 0.8]], falloff = 0.3 }] }\n";

    #[test]
    fn no_layers_give_the_default_and_the_top_layer_wins() {
        assert!(near(map("size = 3").texel(1, 1), DEFAULT_TEXEL));
        let two = "size = 2\n[[layers]]\nname = 'a'\n[layers.constant]\n[[layers]]\n[layers.constant]\nalpha_x = 0.1\nalpha_y = 0.4\nangle = 45.0";
        assert_eq!(map(two).texel(0, 0), texel(0.1, 0.4, 45.0), "to the bit");
    }

    #[test]
    fn opacity_blends_as_the_map_does() {
        let text = "size = 2\n[[layers]]\nname = 'a'\nconstant = { alpha_x = 0.1, alpha_y = 0.4, angle = 1.0 }\n\
            [[layers]]\nopacity = 0.3\nconstant = { alpha_x = 0.3, alpha_y = 0.2, angle = 179.0 }";
        let want = blend(texel(0.1, 0.4, 1.0), texel(0.3, 0.2, 179.0), 0.3);
        assert!(near(map(text).texel(1, 0), want));
        let crossed = text
            .replace("179.0", "91.0")
            .replace("opacity = 0.3", "opacity = 0.5");
        let got = map(&crossed).texel(0, 0);
        // Widths of the other order on a line across it stretch the same way.
        assert!(near(got, texel(0.15, 0.35, 1.0)), "{got:?}");
        let round = crossed.replace(
            "alpha_x = 0.3, alpha_y = 0.2",
            "alpha_x = 0.1, alpha_y = 0.4",
        );
        let got = map(&round).texel(0, 0);
        assert!((got.alpha_x - 0.2).abs() < 1e-4 && (got.alpha_y - 0.2).abs() < 1e-4);
    }

    #[test]
    fn a_layer_touches_only_its_channels() {
        let text = "size = 2\n[[layers]]\nname = 'a'\nconstant = { alpha_x = 0.1, alpha_y = 0.4, angle = 10.0 }\n\
            [[layers]]\nchannels = ['alpha_y']\nconstant = { alpha_x = 0.3, alpha_y = 0.2, angle = 50.0 }";
        assert!(near(map(text).texel(0, 0), texel(0.1, 0.2, 10.0)));
        let direction = text.replace("'alpha_y'", "'direction'");
        assert!(near(map(&direction).texel(0, 0), texel(0.1, 0.4, 50.0)));
    }

    #[test]
    fn a_direction_outlives_equal_alphas() {
        // The middle layer makes the texel round; the upper one brings the alphas back, and the direction is still there.
        let text = "size = 2\n[[layers]]\nname = 'a'\nconstant = { alpha_x = 0.1, alpha_y = 0.4, angle = 70.0 }\n\
            [[layers]]\nname = 'b'\nchannels = ['alpha_x', 'alpha_y']\nconstant = { alpha_x = 0.2, alpha_y = 0.2 }\n\
            [[layers]]\nname = 'c'\nchannels = ['alpha_x', 'alpha_y']\nconstant = { alpha_x = 0.1, alpha_y = 0.3 }";
        assert!(near(map(text).texel(0, 0), texel(0.1, 0.3, 70.0)));
    }

    #[test]
    fn hidden_layers_do_not_exist() {
        let text = "size = 2\n[[layers]]\nvisible = false\nconstant.alpha_x = 1.0";
        assert!(near(map(text).texel(0, 0), DEFAULT_TEXEL));
    }

    #[test]
    fn adjust_scales_turns_and_stays_in_range() {
        let text = "size = 2\n[adjust]\nalpha_x = 2\nalpha_y = 100\nturn = 100\n[[layers]]\nconstant = { alpha_x = 0.1, alpha_y = 0.4, angle = 100.0 }";
        assert!(near(map(text).texel(1, 1), texel(0.2, ALPHA_MAX, 20.0)));
    }

    #[test]
    fn a_mask_shows_a_layer_inside_its_shape_only() {
        let text = "size = 8\n[[layers]]\nconstant.alpha_x = 1.0\nmask.polygon = [[0, 0], [0.5, 0], [0.5, 1], [0, 1]]";
        let plain = map(text);
        assert_eq!(
            (plain.texel(0, 0).alpha_x, plain.texel(7, 0).alpha_x),
            (1.0, 0.2)
        );
        let inverted = map(&format!("{text}\nmask.invert = true"));
        assert_eq!(
            (inverted.texel(0, 0).alpha_x, inverted.texel(7, 0).alpha_x),
            (0.2, 1.0)
        );
    }

    #[test]
    fn any_cut_and_any_number_of_threads_give_the_same_bytes() {
        let file = RecipeFile::parse(&format!("version = 1\n{MANY}"), "t.toml", None).unwrap();
        let size = file.recipe().size;
        let prepared = file
            .recipe()
            .prepare(size, &Files::default(), &Progress::none())
            .unwrap();
        let whole = prepared.map(&Progress::none()).unwrap();
        for side in [64, 61] {
            for rect in size.rect().tiles(side) {
                assert_eq!(prepared.region(rect), whole.region(rect));
            }
        }
        for threads in [1, 3] {
            let pool = rayon::ThreadPoolBuilder::new()
                .num_threads(threads)
                .build()
                .unwrap();
            assert!(pool.install(|| prepared.map(&Progress::none()).unwrap()) == whole);
        }
        for i in 0..size.texels() {
            let t = whole.texel_at(i);
            assert!((t.axis.double_angle().length() - 1.0).abs() < 1e-5);
        }
    }

    /// A layer of strokes that look around themselves, over another, under a third, with a mask of its own.
    fn painted() -> RecipeFile {
        use crate::paint::{Brush, Point, Smooth, Stroke, Strokes, Tool};
        let mut file = RecipeFile::parse(&format!("version = 1\n{MANY}"), "t.toml", None).unwrap();
        let mut recipe = file.recipe().clone();
        let stroke = |tool: Tool, points: &[(f32, f32)]| {
            let brush = Brush {
                tool,
                radius: 0.2,
                ..Brush::default()
            };
            let points = points
                .iter()
                .map(|(u, v)| Point::new(Vec2::new(*u, *v), 0.8).unwrap());
            Arc::new(Stroke::new(Arc::new(brush), 1, points).unwrap())
        };
        let smooth = Tool::Smooth(Smooth { reach: 0.05 });
        let strokes = Strokes {
            strokes: vec![
                stroke(Tool::default(), &[(0.2, 0.2), (0.5, 0.6), (1.1, 0.7)]),
                stroke(smooth, &[(0.1, 0.4), (0.9, 0.5)]),
                stroke(Tool::Comb, &[(0.3, 0.9), (0.4, 0.1)]),
                stroke(Tool::Erase, &[(0.8, 0.2)]),
            ],
            mesh: None,
        };
        let mut layer = Layer::new(Source::Strokes(strokes));
        layer.opacity = 0.8;
        layer.mask = recipe.layers[1].mask.clone();
        recipe.layers.insert(2, layer);
        file.update(recipe).unwrap();
        file
    }

    #[test]
    fn what_was_painted_is_the_same_in_pieces_and_after_saving() {
        let file = painted();
        let size = file.recipe().size;
        let prepare = |file: &RecipeFile| {
            let files = Files::default();
            let recipe = file.recipe();
            recipe.prepare(size, &files, &Progress::none()).unwrap()
        };
        let prepared = prepare(&file);
        let whole = prepared.map(&Progress::none()).unwrap();
        for rect in size.rect().tiles(61) {
            assert_eq!(prepared.region(rect), whole.region(rect));
        }
        let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build();
        let one = pool
            .unwrap()
            .install(|| prepared.map(&Progress::none()).unwrap());
        assert!(one == whole);
        let text = file.to_toml();
        assert!(
            text.contains("[layers.strokes]") && text.contains("[[layers.strokes.brushes]]"),
            "{text}"
        );
        let back = RecipeFile::parse(&text, "t.toml", None).unwrap();
        assert_eq!(back.recipe(), file.recipe());
        assert!(prepare(&back).map(&Progress::none()).unwrap() == whole);
        let mut plain = file.recipe().clone();
        plain.layers.remove(2);
        let plain = plain
            .prepare(size, &Files::default(), &Progress::none())
            .unwrap();
        assert!(plain.map(&Progress::none()).unwrap() != whole);
    }

    #[test]
    fn mistakes_in_strokes_name_their_place() {
        let fails = |text: &str, words: &[&str]| {
            let text = format!("version = 1\n[[layers]]\n[layers.strokes]\n{text}");
            let file = RecipeFile::parse(&text, "t.toml", None);
            let result = file.and_then(|f| {
                let recipe = f.recipe();
                recipe
                    .prepare(recipe.size, &Files::default(), &Progress::none())
                    .map(|_| ())
            });
            let e = result.unwrap_err().to_string();
            for word in words {
                assert!(e.contains(word), "no `{word}` in: {e}");
            }
        };
        fails(
            "packed = ['AAAAAA']",
            &[
                "line 3",
                "layers.0.strokes",
                "packed.0",
                "number of points is 0",
            ],
        );
        fails(
            "packed = ['AAAAAYAgAAA']",
            &["layers.0.strokes", "packed.0", "brush 0"],
        );
        fails(
            "packed = []\n[[layers.strokes.brushes]]\nradius = -1.0",
            &["layers.0.strokes", "radius is -1", "0.00001 to 10"],
        );
        fails(
            "packed = []\n[[layers.strokes.brushes]]\ntool = 'groov'",
            &["line 6", "Did you mean `groove`"],
        );
        // One stroke on a mesh, and no mesh.
        fails(
            "packed = ['AAEAAS+AIAAAAAAA']\n[[layers.strokes.brushes]]",
            &["layers.0.strokes.mesh is missing"],
        );
        fails(
            "mesh = 'tours'\npacked = ['AAEAAS+AIAAAAAAA']\n[[layers.strokes.brushes]]",
            &["layers.0.strokes.mesh", "Did you mean `torus`"],
        );
        fails(
            "mesh = 'a.obj'\npacked = ['AAEAAS+AIAAAAAAA']\n[[layers.strokes.brushes]]",
            &["layers.0.strokes.mesh is `a.obj`"],
        );
    }

    #[test]
    fn what_was_prepared_before_serves_again_where_it_is_the_same() {
        let file = RecipeFile::parse(&format!("version = 1\n{MANY}"), "t.toml", None).unwrap();
        let (none, files) = (Progress::none(), Files::default());
        let size = file.recipe().size;
        let before = file.recipe().prepare(size, &files, &none).unwrap();
        let mut recipe = file.recipe().clone();
        recipe.layers[1].opacity = 0.25;
        recipe.layers.swap(0, 1);
        let after = recipe.prepare_after(&before, size, &files, &none).unwrap();
        let is_shared = |layer: &PreparedLayer| {
            let same = |old: &PreparedLayer| match (&old.source, &layer.source) {
                (PreparedSource::Fill(a), PreparedSource::Fill(b)) => Arc::ptr_eq(a, b),
                (PreparedSource::Strokes(a), PreparedSource::Strokes(b)) => Arc::ptr_eq(a, b),
                _ => false,
            };
            before.layers.iter().any(same)
        };
        assert!(after.layers.iter().all(is_shared));
        let anew = recipe.prepare(size, &files, &none).unwrap();
        assert!(after.map(&none).unwrap() == anew.map(&none).unwrap());
        recipe.seed += 1;
        let other = recipe.prepare_after(&before, size, &files, &none).unwrap();
        assert!(!other.layers.iter().any(is_shared), "its seed changed");
    }

    #[test]
    fn guides_lead_a_layer_and_leave_its_widths() {
        let text = "size = [96, 64]\nwrap = 'clamp'\n[[layers]]\nconstant = { alpha_x = 0.1, alpha_y = 0.4 }\n\
            [[layers]]\n[layers.guides]\ngrid = 64\n[[layers.guides.guide]]\nshape.ellipse.radii = [0.4, 0.4]\n";
        let one = map(text);
        let right = one.sample(0.7, 0.5);
        assert!(right.axis.angle_to(Axis::V).to_degrees() < 1.0);
        assert!((right.alpha_x, right.alpha_y) == (0.1, 0.4));
        let wide = map(&text.replace("grid = 64", "grid = 64\nalpha_across = 0.5"));
        let right = wide.sample(0.7, 0.5);
        assert!((right.alpha_x - 0.06).abs() < 1e-6 && (right.alpha_y - 0.5).abs() < 1e-6);
        let near = map(&text.replace("grid = 64", "grid = 64\nonly_near = true"));
        assert!(near.sample(0.02, 0.5).axis.angle_to(Axis::U).to_degrees() < 0.01);
        let file = text
            .replace("0.4, 0.4]", "9.0, 0.4]")
            .replace("clamp", "repeat");
        let file = RecipeFile::parse(&format!("version = 1\n{file}"), "t.toml", None).unwrap();
        let size = Size::new(64, 64).unwrap();
        let refused = file
            .recipe()
            .prepare(size, &Files::default(), &Progress::none());
        let e = refused.err().expect("too wide").to_string();
        assert!(e.starts_with("layers.1.guides.guide.0 is"), "{e}");
    }

    #[test]
    fn more_masks_than_memory_are_refused_before_the_first_is_drawn() {
        let layers = |feather: &str| -> String {
            let layer = |i: i32| {
                format!(
                    "[[layers]]\nname = 'l{i}'\nconstant = {{}}\nmask.path = 'M 0 0 L 1 0 L 1 1 Z'\n{feather}\n"
                )
            };
            (0..256).map(layer).collect()
        };
        let check = |side: u32, feather: &str| {
            let text = format!("version = 1\nsize = {side}\n{}", layers(feather));
            let file = RecipeFile::parse(&text, "t.toml", None).unwrap();
            let size = file.recipe().size;
            file.recipe().check_masks(&Surface {
                size,
                aspect: 1.0,
                wrap: Wrap::Clamp,
                seed: 0,
            })
        };
        let e = check(4096, "").unwrap_err().to_string();
        assert!(e.contains("8.0 GiB for 256") && e.contains("2 GiB"), "{e}");
        assert!(check(2048, "").is_ok());
        assert!(
            check(4096, "mask.feather = 0.1").is_ok(),
            "kept at fewer texels"
        );
    }

    #[test]
    fn a_cancelled_map_is_an_error() {
        let file = RecipeFile::parse("version = 1\nsize = 256\n", "t.toml", None).unwrap();
        let prepared = file
            .recipe()
            .prepare(file.recipe().size, &Files::default(), &Progress::none())
            .unwrap();
        let no = |_: u64, _: u64| false;
        assert!(matches!(
            prepared.map(&Progress::new(&no)),
            Err(Error::Cancelled)
        ));
        let file = RecipeFile::parse(&format!("version = 1\n{MANY}"), "t.toml", None).unwrap();
        let prepared =
            file.recipe()
                .prepare(file.recipe().size, &Files::default(), &Progress::new(&no));
        assert!(matches!(prepared, Err(Error::Cancelled)));
    }
}
