//! A prepared layer over what lies below it, tile by tile.

use super::Channels;
use super::prepare::{PreparedLayer, PreparedMask, PreparedSource, Weights};
use crate::map::{
    DEFAULT_TEXEL, Rect, Region, RegionMut, SlopeCovariance, Texel, blend, blend_numbers,
};
use crate::math::{self, AXIS_MIN_LENGTH, Axis, choose, smoothstep};
use crate::paint::Painting;
use crate::pattern::{Fill, Patch};
use crate::progress::Progress;
use fearless_simd::{Simd, dispatch};
use fearless_simd_macros::simd;
use rayon::prelude::*;

/// Texels of a tile: its planes, about 30 bytes a texel, stay in a core's second cache.
const TILE_WIDTH: u32 = 256;
pub(super) const TILE_HEIGHT: u32 = 32;

/// What one layer lays in a rectangle.
pub(super) struct Sheet {
    pub(super) texels: Region,
    /// `None` where all is covered.
    pub(super) coverage: Option<Vec<f32>>,
    pub(super) weight: Weight,
}

/// Coverage times mask times opacity.
pub(super) enum Weight {
    Even(f32),
    Each(Vec<f32>),
}

impl Sheet {
    pub(super) fn bytes(&self) -> usize {
        let numbers = 4 * self.texels.rect().texels();
        let more = self.coverage.as_ref().map_or(0, Vec::len);
        let weight = match &self.weight {
            Weight::Even(_) => 0,
            Weight::Each(weight) => weight.len(),
        };
        4 * (numbers + more + weight)
    }
}

/// Room for one tile's work, kept from tile to tile, and who is asked whether to go on with strokes: when that is denied, what
/// is being filled means nothing, and whoever began it is told the same.
pub(super) struct Scratch<'a> {
    pub(super) layer: [Vec<f32>; 4],
    pub(super) coverage: Vec<f32>,
    pub(super) value: Vec<f32>,
    pub(super) weight: Vec<f32>,
    progress: &'a Progress<'a>,
}

impl Default for Scratch<'_> {
    fn default() -> Self {
        static NOBODY: Progress<'static> = Progress::none();
        Self::asking(&NOBODY)
    }
}

impl<'a> Scratch<'a> {
    pub(super) fn asking(progress: &'a Progress<'a>) -> Self {
        Self {
            layer: Default::default(),
            coverage: Vec::new(),
            value: Vec::new(),
            weight: Vec::new(),
            progress,
        }
    }

    pub(super) fn resize(&mut self, texels: usize) {
        let vectors = [&mut self.coverage, &mut self.value, &mut self.weight];
        for v in self.layer.iter_mut().chain(vectors) {
            v.resize(texels, 0.0);
        }
    }

    /// A tile of a layer of strokes, of which none looks around itself here, over the region below it.
    pub(super) fn paint(&mut self, painting: &Painting, region: &mut RegionMut<'_>, tile: Rect) {
        let below = region.crop(tile);
        let mut now = below.clone();
        self.coverage.fill(0.0);
        let all = 0..painting.len();
        let (coverage, progress) = (&mut self.coverage, self.progress);
        let painted = painting.paint(all, tile, &below, &mut now, coverage, progress);
        if painted.is_err() {
            return; // whoever began is told so
        }
        self.patch(tile).region.copy_from(&now);
        // What was painted holds what lies below it.
        self.coverage.fill(1.0);
    }

    /// The layer's planes as a region that lies at `rect`, and what a patch needs beside it.
    pub(super) fn patch(&mut self, rect: Rect) -> Patch<'_> {
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

/// Layers one over the other, the first at the bottom.
pub(super) fn composite(
    layers: &[PreparedLayer],
    region: &mut RegionMut<'_>,
    scratch: &mut Scratch<'_>,
) {
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
    scratch: &mut Scratch<'_>,
    work: impl Fn(&mut RegionMut<'_>, Rect, &mut Scratch<'_>) + Sync,
) {
    let width = region.rect.width.min(TILE_WIDTH);
    let height = (TILE_WIDTH * TILE_HEIGHT / width).min(region.rect.height);
    let band = |mut band: RegionMut<'_>, scratch: &mut Scratch<'_>| {
        for tile in tiles(band.rect, width, height) {
            scratch.resize(tile.texels());
            work(&mut band, tile, scratch);
        }
    };
    if region.rect.height == height {
        return band(region.reborrow(), scratch);
    }
    let bands = region.reborrow().into_bands(height);
    let progress = scratch.progress;
    bands.into_par_iter().for_each_init(
        || Scratch::asking(progress),
        |scratch, part| band(part, scratch),
    );
}

fn set_default(region: &mut RegionMut<'_>) {
    region.alpha_x.fill(DEFAULT_TEXEL.alpha_x);
    region.alpha_y.fill(DEFAULT_TEXEL.alpha_y);
    region.cos2.fill(DEFAULT_TEXEL.axis.cos2);
    region.sin2.fill(DEFAULT_TEXEL.axis.sin2);
}

/// Tiles of `width` x `height` texels that cover a rectangle; those at its right and lower edge may be smaller.
pub(super) fn tiles(rect: Rect, width: u32, height: u32) -> impl Iterator<Item = Rect> {
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

impl PreparedLayer {
    /// Fills a tile of the layer and blends it over the region below.
    fn blend_over(&self, region: &mut RegionMut<'_>, tile: Rect, scratch: &mut Scratch<'_>) {
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
    pub(super) fn is_plain(&self) -> bool {
        self.opacity == 1.0 && self.mask.is_none() && self.channels == Channels::ALL
    }

    /// Whether a stroke of the layer looks around itself in a rectangle.
    pub(super) fn looks(&self, rect: Rect) -> bool {
        match &self.source {
            PreparedSource::Fill(_) => false,
            PreparedSource::Strokes(painting) => painting.looks(rect),
        }
    }

    /// Fills a region with the layers below and this one over them, a layer of strokes of which some look around themselves.
    fn paint_over(&self, below: &[Self], region: &mut RegionMut<'_>, scratch: &mut Scratch<'_>) {
        let PreparedSource::Strokes(painting) = &self.source else {
            return composite(below, region, scratch);
        };
        let rect = region.rect;
        let mut under = Region::constant(painting.needs(rect), DEFAULT_TEXEL);
        composite(below, &mut under.view_mut(), scratch);
        let painted = painted_over(painting, rect, &under, scratch.progress);
        region.copy_from(&under);
        self.lay(&painted, region, scratch);
    }

    /// What the layer lays in a rectangle, if that does not depend on what lies below.
    pub(super) fn sheet(&self, rect: Rect, scratch: &mut Scratch<'_>) -> Option<Sheet> {
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
    pub(super) fn own_sheet(
        &self,
        source: &dyn Fill,
        rect: Rect,
        scratch: &mut Scratch<'_>,
    ) -> Sheet {
        scratch.resize(rect.texels());
        source.fill(&mut scratch.patch(rect));
        self.weigh(scratch, false);
        made(rect, scratch)
    }

    /// Blends what was made of the layer without its mask over a region, which it holds, with another mask.
    pub(super) fn lay_masked(
        &self,
        sheet: &Sheet,
        mask: &[f32],
        region: &mut Region,
        scratch: &mut Scratch<'_>,
    ) {
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
    pub(super) fn lay_sheet(
        &self,
        sheet: &Sheet,
        region: &mut RegionMut<'_>,
        scratch: &mut Scratch<'_>,
    ) {
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
    pub(super) fn lay(
        &self,
        painted: &Region,
        region: &mut RegionMut<'_>,
        scratch: &mut Scratch<'_>,
    ) {
        each_tile(region, scratch, |region, tile, scratch| {
            if let Some(mask) = &self.mask {
                mask.fill(tile, scratch);
            }
            scratch.patch(tile).region.copy_from(painted);
            scratch.coverage.fill(1.0);
            self.blend_tile(region, tile, scratch);
        });
    }

    /// The rectangle below it that the layer needs for `rect`.
    pub(super) fn needs(&self, rect: Rect) -> Rect {
        match &self.source {
            PreparedSource::Fill(_) => rect,
            PreparedSource::Strokes(painting) => painting.needs(rect),
        }
    }

    /// Goes over the part `rect` of a region that holds what lies below it there, and as far around as the layer needs.
    pub(super) fn go_over(&self, rect: Rect, region: &mut Region, scratch: &mut Scratch<'_>) {
        match &self.source {
            PreparedSource::Strokes(painting) if painting.looks(rect) => {
                let painted = painted_over(painting, rect, region, scratch.progress);
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
    pub(super) fn weigh(&self, scratch: &mut Scratch<'_>, is_masked: bool) {
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

    /// Multiplies the coverage of a rectangle with mask and opacity.
    pub(super) fn weigh_coverage(
        &self,
        rect: Rect,
        covered: &mut [f32],
        scratch: &mut Scratch<'_>,
    ) {
        let opacity = self.opacity;
        match &self.mask {
            None => covered.iter_mut().for_each(|c| *c *= opacity),
            Some(mask) => {
                mask.fill_alone(rect, scratch);
                for (c, w) in covered.iter_mut().zip(&scratch.weight) {
                    *c = w * (*c * opacity);
                }
            }
        }
    }

    /// Blends what the scratch holds of the layer over a tile of the region below.
    fn blend_tile(&self, region: &mut RegionMut<'_>, tile: Rect, scratch: &mut Scratch<'_>) {
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
pub(super) fn made(rect: Rect, scratch: &Scratch<'_>) -> Sheet {
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
    pub(super) coverage: Option<&'a [f32]>,
    /// Coverage times mask times opacity.
    pub(super) weight: &'a [f32],
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
    /// The weights of a rectangle, into the scratch's `weight`; of its other planes only those have room that this takes.
    pub(super) fn fill_alone(&self, rect: Rect, scratch: &mut Scratch<'_>) {
        match self.source {
            Weights::Value { .. } => scratch.resize(rect.texels()),
            Weights::Drawn(_) | Weights::Painted { .. } => {
                scratch.weight.resize(rect.texels(), 0.0);
            }
        }
        self.fill(rect, scratch);
    }

    /// The weights of a tile, into the scratch's `weight`.
    pub(super) fn fill(&self, tile: Rect, scratch: &mut Scratch<'_>) {
        match &self.source {
            Weights::Drawn(mask) => mask.fill(tile, &mut scratch.weight),
            Weights::Painted { painting, start } => {
                scratch.weight.fill(*start);
                // When that is cancelled, whoever began is told so.
                let _ = painting.cover(tile, &mut scratch.weight, scratch.progress);
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

/// A texel of which `over` covers the part `coverage` and `below` shows in the rest: both lobes are seen side by side, so
/// their slope covariances are averaged, as a map reduced from a larger one would have them.
pub(super) fn cover(below: Texel, over: Texel, coverage: f32) -> Texel {
    if coverage <= 0.0 {
        return below;
    }
    let sum =
        SlopeCovariance::from(below) * (1.0 - coverage) + SlopeCovariance::from(over) * coverage;
    let named = if coverage < 0.5 { below } else { over };
    sum.to_texel(named.alpha_x > named.alpha_y, named.axis)
}

/// What all strokes make of a region; right in `rect`, unless `progress` cancels.
pub(super) fn painted_over(
    painting: &Painting,
    rect: Rect,
    under: &Region,
    progress: &Progress<'_>,
) -> Region {
    let mut painted = under.clone();
    let mut coverage = vec![0.0; under.rect().texels()];
    let all = 0..painting.len();
    // When that is cancelled, whoever began is told so.
    let _ = painting.paint(all, rect, under, &mut painted, &mut coverage, progress);
    painted
}
