//! A recipe to a map, in two steps: [`Recipe::prepare`] does once what needs the whole; [`Prepared::fill`] is pure and
//! gives for any rectangle exactly what the whole would.

use super::blend::{Scratch, Sheet, TILE_HEIGHT, Weight, composite, cover, painted_over};
use super::prepare::{Prepared, PreparedLayer, PreparedSource, Turned};
use super::{Channels, Files, LeftOut, Stamp};
use crate::error::Result;
use crate::map::{
    ALPHA_MAX, ALPHA_MIN, AnisoMap, DEFAULT_TEXEL, Mended, Rect, Region, RegionMut, Size,
};
use crate::math::Axis;
use crate::mesh::Body;
use crate::paint::Skin;
use crate::pattern::{Fill, Patch, Surface};
use crate::progress::Progress;
use rayon::prelude::*;
use std::sync::Arc;

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

impl Prepared {
    /// The size it was prepared for.
    pub fn size(&self) -> Size {
        self.surface.size
    }

    /// The layers that were left out because of their files: see [`Recipe::prepare_readable`](super::Recipe::prepare_readable).
    pub fn left_out(&self) -> &[LeftOut] {
        &self.left_out
    }

    /// The same, which has what another one read of files: [`Recipe::prepare_after`](super::Recipe::prepare_after) does not read that again.
    #[must_use]
    pub fn with_files_of(mut self, other: &Self) -> Self {
        self.shelf = other.shelf.clone();
        self
    }

    /// The same, which knows a mesh of the recipe by the word for it, as its file was with that stamp: [`Recipe::prepare_after`](super::Recipe::prepare_after)
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
                    texels: painted_over(painting, rect, &under, &Progress::none()).crop(rect),
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

    /// How much the mask of the layer with the number `at` lets through in a rectangle, texel by texel in its row order; `None`
    /// of a layer without a mask, or that is not there.
    ///
    /// # Panics
    /// When `rect` reaches outside the map.
    pub fn mask(&self, at: usize, rect: Rect) -> Option<Vec<f32>> {
        self.assert_inside(rect);
        let layer = self.layers.iter().find(|layer| layer.at == at)?;
        let mask = layer.mask.as_ref()?;
        let mut scratch = Scratch::default();
        mask.fill_alone(rect, &mut scratch);
        Some(scratch.weight)
    }

    /// How much of the layer with the number `at` is seen in each texel of a rectangle, 0 to 1 in its row order: what its source
    /// covers, times its mask, times its opacity; that of each channel it touches, before what lies above. `None` of a layer that
    /// is not there or does not show.
    ///
    /// # Errors
    /// [`crate::Error::Cancelled`] when `progress`, which is asked before each of many strokes, says so.
    ///
    /// # Panics
    /// When `rect` reaches outside the map.
    pub fn coverage(
        &self,
        at: usize,
        rect: Rect,
        progress: &Progress<'_>,
    ) -> Result<Option<Vec<f32>>> {
        self.assert_inside(rect);
        let Some(layer) = self.layers.iter().find(|layer| layer.at == at) else {
            return Ok(None);
        };
        let covered = match &layer.source {
            PreparedSource::Fill(source) => {
                let mut scratch = Scratch::asking(progress);
                scratch.resize(rect.texels());
                source.fill(&mut scratch.patch(rect));
                scratch.coverage
            }
            PreparedSource::Strokes(painting) => {
                let mut covered = vec![0.0; rect.texels()];
                painting.cover(rect, &mut covered, progress)?;
                covered
            }
        };
        Ok(Some(self.covered(at, rect, covered)))
    }

    /// As [`Prepared::coverage`], of a layer whose source covers so much of each texel; that itself of a layer that is not there.
    ///
    /// # Panics
    /// When `rect` reaches outside the map, or does not have as many texels.
    pub fn covered(&self, at: usize, rect: Rect, mut covered: Vec<f32>) -> Vec<f32> {
        self.assert_inside(rect);
        assert_eq!(covered.len(), rect.texels(), "a number for each texel");
        let Some(layer) = self.layers.iter().find(|layer| layer.at == at) else {
            return covered;
        };
        let rows = TILE_HEIGHT.min(rect.height.max(1));
        let band = (rect.width * rows).max(1) as usize;
        let bands = covered.par_chunks_mut(band).enumerate();
        bands.for_each_init(Scratch::default, |scratch, (n, covered)| {
            let y = n as u32 * rows;
            let part = Rect {
                y: rect.y + y,
                height: rows.min(rect.height - y),
                ..rect
            };
            layer.weigh_coverage(part, covered, scratch);
        });
        covered
    }

    /// The layers above the layer `at`, and the recipe's adjustment, over a region.
    fn go_above(
        &self,
        at: usize,
        rect: Rect,
        region: &mut Region,
        above: Option<&Above>,
        scratch: &mut Scratch<'_>,
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
        bands.into_par_iter().try_for_each_init(
            || Scratch::asking(progress),
            |scratch, band| {
                progress.check()?;
                self.fill_with(band, scratch);
                progress.step()
            },
        )?;
        Ok(map)
    }

    /// The whole map in large squares: what strokes see around themselves would otherwise be made anew for every small tile.
    fn map_in_squares(&self, progress: &Progress<'_>) -> Result<AnisoMap> {
        let mut map = AnisoMap::constant(self.surface.size, self.surface.wrap, DEFAULT_TEXEL);
        let squares: Vec<Rect> = self.surface.size.rect().tiles(SQUARE).collect();
        progress.expect(squares.len() as u64);
        for square in squares {
            progress.check()?;
            let mut region = Region::constant(square, DEFAULT_TEXEL);
            self.fill_with(region.view_mut(), &mut Scratch::asking(progress));
            map.write_region(&region);
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

    fn fill_with(&self, mut region: RegionMut<'_>, scratch: &mut Scratch<'_>) {
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

/// The pattern writes into the map itself; only what it does not cover is blended, with the default below it.
fn fill_straight(source: &dyn Fill, region: RegionMut<'_>, scratch: &mut Scratch<'_>) {
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
    use super::*;
    use crate::error::Error;
    use crate::paint::{Brush, FillWith, Point, Smooth, Stroke, Strokes, Tool};
    use crate::pattern::{Constant, Pattern};
    use crate::recipe::{Layer, Mask, MaskSource, Recipe, RecipeFile, Source};
    use glam::Vec2;
    use std::sync::atomic::{AtomicUsize, Ordering};

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
    fn many_strokes_ask_whether_to_go_on() {
        let strokes = |tool: Tool, n: usize| {
            let brush = Arc::new(Brush {
                tool,
                radius: 0.4,
                ..Brush::default()
            });
            let point = Point::new(Vec2::splat(0.5), 1.0).unwrap();
            let one = Arc::new(Stroke::new(brush, 1, [point]).unwrap());
            Strokes {
                strokes: vec![one; n],
                mesh: None,
            }
        };
        let fill = strokes(Tool::Fill(FillWith::default()), 2000);
        let mut masked = Layer::new(Source::Pattern(Pattern::Constant(Constant::default())));
        masked.mask = Some(Mask::new(MaskSource::Strokes(fill.clone())));
        let smooth = strokes(Tool::Smooth(Smooth::default()), 30);
        for layer in [
            Layer::new(Source::Strokes(fill)),
            masked,
            Layer::new(Source::Strokes(smooth)),
        ] {
            // One tile: asked before and after it alone, that would be twice.
            let size = Size::new(64, 32).unwrap();
            let recipe = Recipe {
                size,
                layers: vec![layer],
                ..Recipe::default()
            };
            let prepared = recipe
                .prepare(size, &Files::default(), &Progress::none())
                .unwrap();
            let asked = AtomicUsize::new(0);
            let stop = |_, _| asked.fetch_add(1, Ordering::Relaxed) != 10;
            let map = prepared.map(&Progress::new(&stop));
            assert!(matches!(map, Err(Error::Cancelled)));
            assert_eq!(asked.into_inner(), 11, "not asked again");
        }
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
