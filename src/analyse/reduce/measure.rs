//! How far a reduced map's picture is from the full one's, in the user's own scenes.

use super::{Metric, Request, Setting};
use crate::analyse::flip::{mean, quantile};
use crate::analyse::{ColourDifference, Flip, PIXELS_PER_DEGREE};
use crate::brdf::Model;
use crate::error::{Error, Result};
use crate::map::{AnisoMap, Size};
use crate::preview::{
    Background, Look, Picture, Quality, REFERENCE_SAMPLES, SAMPLES_MAX, Scene, Subject, Timings,
    render, render_reference,
};
use crate::progress::Progress;
use rayon::prelude::*;
use serde::Serialize;
use std::time::Instant;

/// The luminance below which errors count as if the pixel had it: 1 % of white, since nobody sees relative errors in black.
const DARK: f32 = 0.01;
/// Pictures that a time is the best of.
const TIMED: usize = 5;

/// How far two pictures are apart, over the pixels where the mesh is seen.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct PictureError {
    /// The mean.
    pub mean: f64,
    /// What 99.9 % of the pixels do not exceed.
    pub p999: f32,
    /// The largest.
    pub max: f32,
}

impl PictureError {
    /// Whether it looks the same: mean at most the tolerance, 99.9th percentile at most three times it.
    pub fn is_within(&self, tolerance: f32) -> bool {
        self.mean <= f64::from(tolerance) && f64::from(self.p999) <= 3.0 * f64::from(tolerance)
    }

    /// Its share of the tolerance, whichever limit is nearer: at most 1 when it looks the same.
    pub fn share(&self, tolerance: f32) -> f64 {
        let tolerance = f64::from(tolerance);
        (self.mean / tolerance).max(f64::from(self.p999) / (3.0 * tolerance))
    }

    fn of(values: &[f32], seen: &[bool]) -> Self {
        let values: Vec<f32> = values
            .iter()
            .zip(seen)
            .filter_map(|(v, seen)| seen.then_some(*v))
            .collect();
        Self {
            mean: mean(&values),
            p999: quantile(&values, 0.999),
            max: values.iter().copied().fold(0.0, f32::max),
        }
    }
}

/// The error of `second` against `first` at every pixel.
fn errors(metric: Metric, first: &Picture, second: &Picture) -> Result<Vec<f32>> {
    Ok(match metric {
        Metric::Flip => Flip::new(first, second, PIXELS_PER_DEGREE)?
            .values()
            .to_vec(),
        Metric::De => ColourDifference::new(first, second)?.values().to_vec(),
        Metric::Luminance => {
            let y = |[r, g, b]: [f32; 3]| 0.2126 * r + 0.7152 * g + 0.0722 * b;
            let pairs = first.pixels().par_iter().zip(second.pixels());
            pairs
                .map(|(&a, &b)| (y(b) - y(a)).abs() / y(a).max(DARK))
                .collect()
        }
    })
}

/// The full map's pictures, and the means to draw others beside them.
pub(super) struct Studio<'a> {
    request: &'a Request<'a>,
    /// Of each setting: the full map's picture with each look, and where the mesh is.
    drawn: Vec<(Vec<Picture>, Vec<bool>)>,
    /// The full map's reference pictures of each setting, drawn when the first is asked for.
    references: Vec<Vec<Picture>>,
    /// Milliseconds of drawing every setting with the full map.
    pub(super) milliseconds: f64,
}

impl<'a> Studio<'a> {
    /// # Errors
    /// When a scene or its mesh cannot be drawn or shows nothing of the mesh, and when `progress` cancels.
    pub(super) fn new(request: &'a Request<'a>, progress: &Progress<'_>) -> Result<Self> {
        let mut studio = Self {
            request,
            drawn: Vec::new(),
            references: Vec::new(),
            milliseconds: 0.0,
        };
        for setting in request.settings {
            let pictures = studio.draw(setting, request.map, request.looks, progress)?;
            let seen = studio.seen(setting, progress)?;
            studio.drawn.push((pictures, seen));
        }
        studio.milliseconds = studio.time(request.map, request.looks, progress)?;
        Ok(studio)
    }

    fn subject<'b>(&'b self, setting: &'b Setting, map: &'b AnisoMap) -> Subject<'b> {
        Subject {
            mesh: &setting.mesh,
            map,
            material: self.request.material,
        }
    }

    fn draw(
        &self,
        setting: &Setting,
        map: &AnisoMap,
        looks: &[Look],
        progress: &Progress<'_>,
    ) -> Result<Vec<Picture>> {
        let subject = self.subject(setting, map);
        let scene = self.scene_of_search(&setting.scene);
        let size = self.request.size;
        render(subject, &scene, looks, size, progress)
    }

    /// The scene with as many samples as there may be, and as close to the reference as that allows: levels of a map take part
    /// only where its texels are finer than the samples. A level is chosen by the map's shape, and would tell a strip from the
    /// map that it is equal to.
    fn scene_of_search(&self, scene: &Scene) -> Scene {
        Scene {
            samples: SAMPLES_MAX,
            quality: Quality {
                mips: self.texels_a_pixel() > SAMPLES_MAX,
                ..scene.quality
            },
            ..scene.clone()
        }
    }

    fn draw_reference(
        &self,
        setting: &Setting,
        map: &AnisoMap,
        looks: &[Look],
        progress: &Progress<'_>,
    ) -> Result<Vec<Picture>> {
        let subject = self.subject(setting, map);
        let (size, samples) = (self.request.size, self.reference_samples());
        let scene = &setting.scene;
        render_reference(subject, scene, looks, size, samples, progress)
    }

    /// A map of N texels across a picture of n pixels wants N/n samples along a pixel's side; it has fewer where no more can be
    /// drawn.
    pub(super) fn reference_samples(&self) -> u32 {
        samples_for(self.texels_a_pixel(), self.request.size)
    }

    /// Texels along a pixel's side where one turn of the map fills the picture.
    pub(super) fn texels_a_pixel(&self) -> u32 {
        let (map, size) = (self.request.map.size(), self.request.size);
        let across = map.width().div_ceil(size.width());
        across.max(map.height().div_ceil(size.height()))
    }

    /// Pixels that the mesh covers by half or more: where the colour behind it does not show.
    fn seen(&self, setting: &Setting, progress: &Progress<'_>) -> Result<Vec<bool>> {
        let against = |grey: f32| -> Result<Picture> {
            let scene = Scene {
                lights: Vec::new(),
                background: Background {
                    top: [grey; 3],
                    bottom: [grey; 3],
                },
                ..setting.scene.clone()
            };
            let bare = Setting {
                scene,
                ..setting.clone()
            };
            let lambert = Look {
                model: Model::Lambert,
                mean: false,
            };
            Ok(self
                .draw(&bare, self.request.map, &[lambert], progress)?
                .swap_remove(0))
        };
        let (black, white) = (against(0.0)?, against(1.0)?);
        let pairs = black.pixels().iter().zip(white.pixels());
        let seen: Vec<bool> = pairs.map(|(a, b)| b[1] - a[1] < 0.5).collect();
        if seen.contains(&true) {
            return Ok(seen);
        }
        Err(Error::invalid(
            "the picture",
            format!("empty: no pixel of it is covered by {}", setting.name()),
            "allowed: scenes that show the mesh",
        )
        .with_hint("Make the picture larger, or turn the camera toward the mesh"))
    }

    /// The error of a map and looks in the setting and with the look where it is worst, as the search draws them. One look
    /// may stand in place of the only one asked for.
    pub(super) fn error(
        &self,
        map: &AnisoMap,
        looks: &[Look],
        progress: &Progress<'_>,
    ) -> Result<PictureError> {
        let mut worst = PictureError::default();
        for (setting, (full, seen)) in self.request.settings.iter().zip(&self.drawn) {
            let pictures = self.draw(setting, map, looks, progress)?;
            for (full, picture) in full.iter().zip(&pictures) {
                let found = PictureError::of(&errors(self.request.metric, full, picture)?, seen);
                worst = self.worse(worst, found);
            }
            // One setting that fails is enough.
            if !worst.is_within(self.request.tolerance) {
                break;
            }
        }
        Ok(worst)
    }

    /// The error in every setting with every look, the looks of the first setting first, as the reference draws them.
    pub(super) fn reference_errors(
        &mut self,
        map: &AnisoMap,
        looks: &[Look],
        progress: &Progress<'_>,
    ) -> Result<Vec<PictureError>> {
        let (request, settings) = (self.request, self.request.settings);
        if self.references.is_empty() {
            self.references = settings
                .iter()
                .map(|s| self.draw_reference(s, request.map, request.looks, progress))
                .collect::<Result<_>>()?;
        }
        let mut measured = Vec::new();
        for (i, setting) in settings.iter().enumerate() {
            let pictures = self.draw_reference(setting, map, looks, progress)?;
            for (full, picture) in self.references[i].iter().zip(&pictures) {
                let values = errors(request.metric, full, picture)?;
                measured.push(PictureError::of(&values, &self.drawn[i].1));
            }
        }
        Ok(measured)
    }

    fn worse(&self, a: PictureError, b: PictureError) -> PictureError {
        let tolerance = self.request.limit();
        if b.share(tolerance) >= a.share(tolerance) {
            b
        } else {
            a
        }
    }

    /// Milliseconds of drawing every setting once, the map being prepared: the best of a few.
    pub(super) fn time(
        &self,
        map: &AnisoMap,
        looks: &[Look],
        progress: &Progress<'_>,
    ) -> Result<f64> {
        let off = Timings::off();
        let mut sum = 0.0;
        for setting in self.request.settings {
            let prepared = self.subject(setting, map).prepare(&off)?;
            let mut pictures = vec![Picture::new(self.request.size, [0.0; 3]); looks.len()];
            let mut best = f64::INFINITY;
            for _ in 0..TIMED {
                let started = Instant::now();
                prepared.draw(&setting.scene, looks, &mut pictures, &off, progress)?;
                best = best.min(started.elapsed().as_secs_f64());
            }
            sum += 1e3 * best;
        }
        Ok(sum)
    }
}

/// The fewest samples along a pixel's side that are as many as `wanted`, or the most that a picture of `size` can be drawn with.
fn samples_for(wanted: u32, size: Size) -> u32 {
    let side = |n: u32, pixels: u32| n.saturating_mul(pixels);
    let mut samples = REFERENCE_SAMPLES;
    for more in [12, 16, 24, 48] {
        let grid = Size::new(side(more, size.width()), side(more, size.height()));
        if samples < wanted && grid.is_ok() {
            samples = more;
        }
    }
    samples
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_reference_has_a_sample_for_every_texel_where_it_can() {
        let samples = |wanted, side| samples_for(wanted, Size::new(side, side).unwrap());
        let small = [1, 8, 9, 16, 17, 25, 99].map(|wanted| samples(wanted, 64));
        assert_eq!(small, [8, 8, 12, 16, 24, 48, 48]);
        assert_eq!(samples(48, 384), 24); // 384 * 48 samples a side are too many
        assert_eq!(samples(48, 2000), REFERENCE_SAMPLES);
    }

    #[test]
    fn luminance_errors_are_relative_down_to_one_percent_of_white() {
        let grey = |v| Picture::new(Size::new(2, 1).unwrap(), [v; 3]);
        let error = |a, b| errors(Metric::Luminance, &grey(a), &grey(b)).unwrap()[0];
        assert!((error(0.5, 0.4) - 0.2).abs() < 1e-6);
        assert!((error(0.001, 0.002) - 0.1).abs() < 1e-6);
    }

    #[test]
    fn what_lies_beside_the_mesh_does_not_count() {
        let e = PictureError::of(&[0.1, 9.0, 0.3], &[true, false, true]);
        assert!((e.mean - 0.2).abs() < 1e-6 && e.max == 0.3);
        assert!(e.is_within(0.2 + 1e-6) && !e.is_within(0.19) && !e.is_within(0.09));
        assert!((e.share(0.1) - 2.0).abs() < 1e-6);
    }
}
