//! How far a reduced map's picture is from the full one's, in the user's own scenes.

use super::{Metric, Request, Setting};
use crate::analyse::flip::{mean, quantile};
use crate::analyse::{ColourDifference, Flip, PIXELS_PER_DEGREE};
use crate::brdf::Model;
use crate::error::{Error, Result};
use crate::filter::Pyramid;
use crate::map::{AnisoMap, Size};
use crate::mesh::Mesh;
use crate::preview::{
    Background, Frame, Look, Material, Picture, Prepared, Quality, REFERENCE_SAMPLES, SAMPLES_MAX,
    Scene, Subject, Timings, render, render_reference,
};
use crate::progress::Progress;
use rayon::prelude::*;
use serde::Serialize;
use std::sync::Arc;
use std::time::Instant;

/// The luminance below which errors count as if the pixel had it: 1 % of white, since nobody sees relative errors in black.
const DARK: f32 = 0.01;
/// What is left of white where the mesh hides no sample: one of 48x48 is more than this and rounding together.
const UNTOUCHED: f32 = 1.0 - 2e-4;
/// Pictures that a time is the best of.
const TIMED: usize = 5;

/// How far two pictures are apart, over the pixels that the mesh touches.
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
    /// Of each setting, as the search draws it.
    views: Vec<View>,
    /// Of each mesh.
    tables: Vec<Table<'a>>,
    /// The full map's reference pictures of each setting and where the mesh is, drawn when the first is asked for.
    references: Vec<(Vec<Picture>, Vec<bool>)>,
    /// Milliseconds of drawing every setting with the full map.
    pub(super) milliseconds: f64,
}

/// A setting as the search draws it.
struct View {
    scene: Scene,
    /// The number of the mesh's table.
    table: usize,
    /// The full map's picture with each look.
    full: Vec<Picture>,
    /// The pixels that the mesh touches.
    seen: Vec<bool>,
}

/// A mesh, and what its pictures keep from map to map and from light to light.
struct Table<'a> {
    mesh: &'a Arc<Mesh>,
    prepared: Prepared<'a>,
    frame: Frame,
}

impl<'a> Studio<'a> {
    /// # Errors
    /// When a scene or its mesh cannot be drawn or shows nothing of the mesh, and when `progress` cancels.
    pub(super) fn new(request: &'a Request<'a>, progress: &Progress<'_>) -> Result<Self> {
        let mut studio = Self {
            request,
            views: Vec::new(),
            tables: Vec::new(),
            references: Vec::new(),
            milliseconds: 0.0,
        };
        for setting in request.settings {
            let table = studio.table(&setting.mesh)?;
            let scene = studio.scene_of_search(&setting.scene);
            let Table {
                prepared, frame, ..
            } = &mut studio.tables[table];
            let mut full = Vec::new();
            for look in request.looks {
                frame.draw(prepared, &scene, *look, &Timings::off(), progress)?;
                full.push(frame.picture().clone());
            }
            let seen = studio.seen(setting, |subject, silhouette, look| {
                render(subject, silhouette, &[look], request.size, progress)
            })?;
            if !seen.contains(&true) {
                return Err(shows_nothing(setting));
            }
            studio.views.push(View {
                scene,
                table,
                full,
                seen,
            });
        }
        studio.milliseconds = studio.time(request.map, request.looks, progress)?;
        Ok(studio)
    }

    /// The table of a mesh, with the full map on it.
    fn table(&mut self, mesh: &'a Arc<Mesh>) -> Result<usize> {
        if let Some(known) = self.tables.iter().position(|t| Arc::ptr_eq(t.mesh, mesh)) {
            return Ok(known);
        }
        let Request {
            map,
            material,
            size,
            ..
        } = *self.request;
        self.tables.push(Table {
            mesh,
            prepared: Prepared::new(Arc::clone(mesh), map, *material, &Timings::off())?,
            frame: Frame::new(size),
        });
        Ok(self.tables.len() - 1)
    }

    fn subject<'b>(&'b self, setting: &'b Setting, map: &'b AnisoMap) -> Subject<'b> {
        Subject {
            mesh: &setting.mesh,
            map,
            material: self.request.material,
        }
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

    /// Pixels that the mesh touches, if only with one sample, in a picture that `draw` draws of the setting's mesh: black before
    /// white.
    fn seen(
        &self,
        setting: &Setting,
        draw: impl FnOnce(Subject<'_>, &Scene, Look) -> Result<Vec<Picture>>,
    ) -> Result<Vec<bool>> {
        let silhouette = Scene {
            lights: Vec::new(),
            background: Background {
                top: [1.0; 3],
                bottom: [1.0; 3],
            },
            samples: SAMPLES_MAX,
            ..setting.scene.clone()
        };
        let black = Material {
            diffuse: [0.0; 3],
            specular: [0.0; 3],
            ambient: [0.0; 3],
        };
        let subject = Subject {
            material: &black,
            ..self.subject(setting, self.request.map)
        };
        let lambert = Look {
            model: Model::Lambert,
            mean: false,
        };
        let picture = draw(subject, &silhouette, lambert)?.swap_remove(0);
        Ok(picture.pixels().iter().map(|p| p[1] < UNTOUCHED).collect())
    }

    /// The error of a map and looks in the setting and with the look where it is worst, as the search draws them. One look
    /// may stand in place of the only one asked for.
    pub(super) fn error(
        &mut self,
        map: &AnisoMap,
        looks: &[Look],
        progress: &Progress<'_>,
    ) -> Result<PictureError> {
        let (request, off) = (self.request, Timings::off());
        let mut worst = PictureError::default();
        let mut laid = None;
        for view in &self.views {
            let Table {
                prepared, frame, ..
            } = &mut self.tables[view.table];
            if laid != Some(view.table) {
                prepared.set_map(Pyramid::new(map.clone()));
                laid = Some(view.table);
            }
            for (look, full) in looks.iter().zip(&view.full) {
                frame.draw(prepared, &view.scene, *look, &off, progress)?;
                let values = errors(request.metric, full, frame.picture())?;
                let found = PictureError::of(&values, &view.seen);
                worst = worse(worst, found, request.limit());
                // One picture that fails is enough.
                if !worst.is_within(request.tolerance) {
                    return Ok(worst);
                }
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
            let samples = self.reference_samples();
            let drawn = settings.iter().map(|setting| {
                let full = self.draw_reference(setting, request.map, request.looks, progress)?;
                let seen = self.seen(setting, |subject, silhouette, look| {
                    render_reference(
                        subject,
                        silhouette,
                        &[look],
                        request.size,
                        samples,
                        progress,
                    )
                })?;
                Ok((full, seen))
            });
            self.references = drawn.collect::<Result<_>>()?;
        }
        let mut measured = Vec::new();
        for (setting, (full, seen)) in settings.iter().zip(&self.references) {
            let pictures = self.draw_reference(setting, map, looks, progress)?;
            for (full, picture) in full.iter().zip(&pictures) {
                let values = errors(request.metric, full, picture)?;
                measured.push(PictureError::of(&values, seen));
            }
        }
        Ok(measured)
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

/// The one of two errors that takes more of the tolerance.
fn worse(a: PictureError, b: PictureError, tolerance: f32) -> PictureError {
    if b.share(tolerance) >= a.share(tolerance) {
        b
    } else {
        a
    }
}

fn shows_nothing(setting: &Setting) -> Error {
    Error::invalid(
        "the picture",
        format!("empty: no pixel of it is covered by {}", setting.name()),
        "allowed: scenes that show the mesh",
    )
    .with_hint("Make the picture larger, or turn the camera toward the mesh")
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
    fn every_pixel_that_the_mesh_touches_counts() {
        let mesh = Arc::new(crate::mesh::builtin("torus").unwrap());
        let grey = [0.25; 3];
        let scene = Scene {
            background: Background {
                top: grey,
                bottom: grey,
            },
            exposure: -2.0,
            ..Scene::for_mesh(&mesh)
        };
        let settings = [Setting {
            mesh_name: "torus".to_owned(),
            light_name: "studio".to_owned(),
            mesh,
            scene,
        }];
        let map = AnisoMap::constant(
            Size::new(2, 2).unwrap(),
            crate::map::Wrap::Repeat,
            crate::map::DEFAULT_TEXEL,
        );
        let request = Request {
            map: &map,
            aspect: 1.0,
            material: &Material::default(),
            looks: &[Look::default()],
            settings: &settings,
            metric: Metric::Flip,
            tolerance: 0.1,
            size: Size::new(64, 64).unwrap(),
            formats: &[],
        };
        let none = Progress::none();
        let mut studio = Studio::new(&request, &none).unwrap();
        studio.reference_errors(&map, request.looks, &none).unwrap();
        let (full, seen) = &studio.references[0];
        let search = &studio.views[0];
        for (picture, seen) in [(&full[0], seen), (&search.full[0], &search.seen)] {
            let differs = |p: &[f32; 3]| p.iter().any(|c| (c - 0.25).abs() > 1e-6);
            let pixels = picture.pixels().iter().zip(seen);
            // Light never happens to be just the background's, and no pixel of the background is counted.
            assert!(pixels.clone().all(|(p, seen)| differs(p) == *seen));
        }
        // The reference looks with more samples: it finds pixels of which the mesh covers less.
        let count = |seen: &[bool]| seen.iter().filter(|s| **s).count();
        assert!(count(seen) > count(&search.seen));
    }

    #[test]
    fn what_lies_beside_the_mesh_does_not_count() {
        let e = PictureError::of(&[0.1, 9.0, 0.3], &[true, false, true]);
        assert!((e.mean - 0.2).abs() < 1e-6 && e.max == 0.3);
        assert!(e.is_within(0.2 + 1e-6) && !e.is_within(0.19) && !e.is_within(0.09));
        assert!((e.share(0.1) - 2.0).abs() < 1e-6);
    }
}
