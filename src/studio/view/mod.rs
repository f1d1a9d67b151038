//! What the canvas shows: pure functions from a map to pixels, legends and marks.
//!
//! A [`View`] draws any rectangle of canvas pixels exactly as it draws the whole canvas, so a dab redraws what it changed and no
//! more. Shown smaller, a pixel is the mean of what it covers, taken from [`Averages`], which a dab updates where it painted.
//! Pixels are RGBA, 8 bits each, sRGB-encoded, alpha premultiplied; row 0 is the top.

mod camera;
mod coverage;
mod direction;
mod grain;
mod legend;
mod levels;
mod lit;
mod marks;
mod needles;
mod outlines;
mod palette;
mod probe;
mod sampler;
mod scale;

pub use camera::{Camera2d, ZOOM_RANGE};
pub use coverage::Coverage;
pub use legend::{Legend, LegendShape, Tick};
pub use lit::Lighting;
pub use marks::{JUMP_SCALE, LintMarks, MarkedPole, MarkedSeam, seam_colour};
pub use needles::{Needle, needles};
pub use outlines::Outlines;
pub use probe::Probe;
pub use scale::{AlphaRange, RatioRange};

use crate::map::{AnisoMap, Rect};
use levels::{Averaged, Levels, Rows};
use sampler::Sampler;
use std::ops::Range;

/// Lines between texels appear from so many pixels per texel on, and are whole at the second.
const BORDERS: [f32; 2] = [7.0, 14.0];
/// What a line between texels is drawn with, and how much of it.
const BORDER: (f32, f32) = (128.0, 0.35);

/// The means of a map over squares of 2, 4, 8 ... texels: what views of it from afar are made of. A third of the map's texels
/// at 16 bytes.
#[derive(Clone, Debug, PartialEq)]
pub struct Averages {
    levels: Levels<4>,
}

impl Averages {
    /// Averages a whole map.
    pub fn new(map: &AnisoMap) -> Self {
        Self {
            levels: Levels::new(map),
        }
    }

    /// Averages again what lies over a rectangle of texels that changed: afterwards all is as if made anew.
    ///
    /// # Panics
    /// When the map has another size than the first one.
    pub fn update(&mut self, map: &AnisoMap, rect: Rect) {
        self.levels.update(map, rect);
    }

    /// A level of some thousand texels.
    fn coarse(&self) -> &[Averaged] {
        self.levels.at_most(1 << 16).unwrap_or_default()
    }
}

/// A way to look at a map.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum View {
    /// A flat surface under a light.
    Lit(Lighting),
    /// alpha_x in false colour.
    AlphaX(AlphaRange),
    /// alpha_y in false colour.
    AlphaY(AlphaRange),
    /// alpha_x / alpha_y in false colour.
    Ratio(RatioRange),
    /// The direction of the x axis as hue, dark where the texel is nearly isotropic.
    Direction,
    /// The grooves as grain: a line integral convolution along the axis of the smaller width.
    Grain,
}

impl View {
    /// How many pixels beside a pixel it may depend on: a changed rectangle is to be redrawn with so much around it.
    pub fn reach(&self) -> u32 {
        match self {
            Self::Grain => grain::REACH,
            _ => 0,
        }
    }

    /// Draws the pixels of `rect`, which lies on the camera's canvas, in row order. Beside the map they are transparent.
    ///
    /// # Panics
    /// When `rgba` does not hold four bytes a pixel, or `averages` are of a map of another size.
    pub fn draw(
        &self,
        map: &AnisoMap,
        averages: &Averages,
        camera: &Camera2d,
        rect: Rect,
        rgba: &mut [u8],
    ) {
        let canvas = Canvas {
            map,
            averages,
            camera,
            rect,
        };
        assert!(rgba.len() == 4 * rect.texels(), "four bytes a pixel");
        if rgba.is_empty() {
            return;
        }
        match self {
            Self::Lit(lighting) => {
                let lit = lit::Lit::new(lighting);
                canvas.rows(rgba, |seen, out| lit.row(seen, out));
            }
            Self::AlphaX(range) => canvas.rows(rgba, |s, out| scale::alphas(s, 0, *range, out)),
            Self::AlphaY(range) => canvas.rows(rgba, |s, out| scale::alphas(s, 1, *range, out)),
            Self::Ratio(range) => canvas.rows(rgba, |s, out| scale::ratios(s, *range, out)),
            Self::Direction => canvas.rows(rgba, direction::directions),
            Self::Grain => grain::draw(&canvas, rgba),
        }
    }
}

/// A rectangle of a canvas over a map.
struct Canvas<'a> {
    map: &'a AnisoMap,
    averages: &'a Averages,
    camera: &'a Camera2d,
    rect: Rect,
}

impl<'a> Canvas<'a> {
    /// For the rectangle and `around` pixels more on every side.
    fn sampler(&self, around: u32, smooth: bool) -> Sampler<'a, AnisoMap, 4> {
        Sampler::new(
            self.map,
            &self.averages.levels,
            self.map.wrap(),
            self.camera,
            pixel_ranges(self.rect, around),
            smooth,
        )
    }

    /// Draws each row with `colour`, and what is common to all views: nothing beside the map, lines between large texels.
    fn rows(&self, rgba: &mut [u8], colour: impl Fn(&[Averaged], &mut [u8]) + Sync) {
        let sampler = self.sampler(0, false);
        sampler.draw(rgba, |j, seen, out| {
            colour(seen, out);
            finish(&sampler, self.camera, j, out);
        });
    }
}

/// The columns and rows of a rectangle and of `around` pixels on every side.
fn pixel_ranges(rect: Rect, around: u32) -> [Range<i64>; 2] {
    let side = |start: u32, length: u32| {
        let (start, length) = (i64::from(start), i64::from(length));
        start - i64::from(around)..start + length + i64::from(around)
    };
    [side(rect.x, rect.width), side(rect.y, rect.height)]
}

/// Clears what is beside the map, and draws the lines between texels where these are large.
fn finish<R: Rows<N>, const N: usize>(
    sampler: &Sampler<'_, R, N>,
    camera: &Camera2d,
    j: usize,
    line: &mut [u8],
) {
    if !sampler.sees_row(j) {
        line.fill(0);
        return;
    }
    let per_texel = camera.pixels_per_texel().min_element() as f32;
    let ink = BORDER.1 * crate::math::smoothstep(BORDERS[0], BORDERS[1], per_texel);
    for (i, pixel) in line.chunks_exact_mut(4).enumerate() {
        if !sampler.sees_column(i) {
            pixel.fill(0);
        } else if ink > 0.0 && (sampler.row_border(j) || sampler.column_border(i)) {
            for c in &mut pixel[..3] {
                *c = (f32::from(*c) + (BORDER.0 - f32::from(*c)) * ink + 0.5) as u8;
            }
        }
    }
}

#[cfg(test)]
mod tests;
