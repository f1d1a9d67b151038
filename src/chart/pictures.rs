//! What a picture costs and how far it is from the reference: models, storage of the map, levels of the map, samples.
//!
//! Three subjects under the stock lights, each in its preset's finish. One thing at a time is changed from the base, which is
//! what `preview` does by default: `ward` on the f32 map, filtered in slope covariance, 2x2 samples a pixel. The truth is `ward` at
//! reference quality ([`render_reference`]): the map says what is meant, and the other models show how far they are from it.
//!
//! A map in another storage is decoded before it is drawn, as the preview does with every map: its picture takes as long as the
//! base's, and what storage changes is the picture and the bytes. What decoding itself costs, the kernels' charts tell.
//!
//! Naive averaging, which exists here only, averages widths and double angles, not covariance, down to a smaller map: that at
//! which the middle pixel's samples have about a texel each.

use super::kernels::Effort;
use crate::analyse::{ColourDifference, Flip, PIXELS_PER_DEGREE};
use crate::convention::storage::Storage;
use crate::error::Result;
use crate::map::{AnisoMap, Size, Texel};
use crate::mesh::{self, Mesh};
use crate::preview::{
    Look, Picture, Quality, Scene, Subject, Timings, linear_from_srgb, render_reference,
};
use crate::progress::Progress;
use crate::raster::{Cull, GBuffer, Geometry, View};
use crate::recipe::{Material, preset};
use glam::DVec2;
use serde::Serialize;
use std::time::Instant;

/// A way to draw a picture, and what was measured of it. A line of `pictures.csv`.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct PictureRow {
    /// The subject: a mesh, and whether it is seen from afar.
    pub scene: &'static str,
    /// What is changed from the base: `base`, `model`, `storage`, `filter` or `samples`.
    pub group: &'static str,
    /// The way, in a few words.
    pub method: String,
    /// As `--model` names it.
    pub look: String,
    /// How the map is stored.
    pub storage: String,
    /// Bytes of a stored texel; 0 where the map is not read.
    pub bytes: usize,
    /// Samples a pixel.
    pub samples: u32,
    /// Least milliseconds a frame; of the decoded map, whatever its storage.
    pub ms_min: f64,
    /// The median of all rounds.
    pub ms_median: f64,
    /// Mean FLIP from the reference.
    pub flip_mean: f64,
    /// Its 99.9th percentile.
    pub flip_p999: f32,
    /// Its largest value.
    pub flip_max: f32,
    /// Mean CIEDE2000 from the reference.
    pub de_mean: f64,
    /// Its 99.9th percentile.
    pub de_p999: f32,
    /// Its largest value.
    pub de_max: f32,
    /// Mean FLIP from the base's picture: what the change alone does.
    pub flip_base: f64,
    /// Mean CIEDE2000 from the base's picture.
    pub de_base: f64,
    /// The PNG file of the picture, where pictures are written.
    pub png: Option<String>,
    /// Mean FLIP between the 8-bit PNGs of the reference and of this.
    pub png_flip_mean: Option<f64>,
}

/// What is to be seen.
struct Stage {
    name: &'static str,
    mesh: &'static str,
    preset: &'static str,
    map: u32,
    picture: (u32, u32),
    reference: u32,
    /// Seen from afar only filters and samples are of interest.
    is_far: bool,
}

/// The subjects. A quick run is for seeing that all works.
fn stages(is_quick: bool) -> Vec<Stage> {
    let near = |name, preset| Stage {
        name,
        mesh: name,
        preset,
        map: if is_quick { 256 } else { 2048 },
        picture: if is_quick { (96, 72) } else { (640, 480) },
        reference: if is_quick { 4 } else { 8 },
        is_far: false,
    };
    let far = |name, mesh, preset| Stage {
        name,
        map: if is_quick { 256 } else { 4096 },
        picture: if is_quick { (32, 24) } else { (128, 96) },
        reference: if is_quick { 8 } else { 48 },
        is_far: true,
        ..near(mesh, preset)
    };
    vec![
        near("torus", "brushed_aluminium"),
        near("pot", "pot"),
        near("disc", "turned_disc"),
        far("pot from afar", "pot", "pot"),
        far("disc from afar", "disc", "turned_disc"),
    ]
}

/// Storage that is worth a look in a picture.
const STORAGES: [&str; 7] = [
    "u8-linear",
    "u8-sqrt",
    "u8-sqrt/u8-vector",
    "u8-log",
    "u8-log/u8-angle",
    "u16-linear",
    "f16",
];
const MODELS: [&str; 7] = [
    "phong:mean",
    "ward:mean",
    "ward-exact",
    "ward-duer",
    "ward-bounded",
    "beckmann",
    "ggx",
];

/// One way to draw.
struct Method {
    group: &'static str,
    name: String,
    look: Look,
    samples: u32,
    quality: Quality,
    map: MapUse,
}

#[derive(Clone, Copy, PartialEq)]
enum MapUse {
    Plain,
    Stored(Storage),
    Averaged,
}

/// Every way to draw a subject: the base first.
fn methods(is_far: bool) -> Result<Vec<Method>> {
    // So many samples everywhere: otherwise no other way could show at outlines what it is worth.
    let quality = Quality {
        outlines: false,
        ..Quality::default()
    };
    let base = |group, name: &str| Method {
        group,
        name: name.to_owned(),
        look: Look::default(),
        samples: 2,
        quality,
        map: MapUse::Plain,
    };
    let mut all = vec![base("base", "base: ward, f32, 2x2")];
    if !is_far {
        for word in MODELS {
            all.push(Method {
                look: word.parse()?,
                ..base("model", word)
            });
        }
        for word in STORAGES {
            all.push(Method {
                map: MapUse::Stored(word.parse()?),
                ..base("storage", &format!("{word}, decoded"))
            });
        }
    }
    let no_mips = Quality {
        mips: false,
        ..quality
    };
    let no_widening = Quality {
        widening: false,
        ..quality
    };
    for samples in if is_far { 1..=4 } else { 2..=2 } {
        let grid = if is_far {
            format!(", {samples}x{samples}")
        } else {
            String::new()
        };
        all.push(Method {
            quality: no_mips,
            samples,
            ..base("filter", &format!("no filter{grid}"))
        });
        all.push(Method {
            map: MapUse::Averaged,
            quality: no_mips,
            samples,
            ..base("filter", &format!("naive averaging{grid}"))
        });
    }
    if !is_far {
        all.push(Method {
            quality: no_widening,
            ..base("filter", "no widening")
        });
        all.push(Method {
            quality: Quality {
                mips: false,
                ..no_widening
            },
            ..base("filter", "no filter, no widening")
        });
    }
    for samples in [1, 3, 4] {
        all.push(Method {
            samples,
            ..base("samples", &format!("{samples}x{samples} samples"))
        });
    }
    for samples in [1, 2] {
        all.push(Method {
            samples,
            quality: Quality::default(),
            ..base("samples", &format!("{samples}x{samples}, outlines 4x4"))
        });
    }
    Ok(all)
}

/// A picture, and the milliseconds of each time it was drawn.
type Drawn = (Picture, Vec<f64>);

/// Visits to each way to draw: whatever else the machine does for a while then hits all of them alike.
const VISITS: usize = 3;

/// A subject with its map and its reference.
struct Studio {
    stage: Stage,
    mesh: Mesh,
    map: AnisoMap,
    material: Material,
    scene: Scene,
    size: Size,
    reference: Picture,
    /// Texels in a pixel, by the median.
    footprint: f64,
}

impl Studio {
    fn new(stage: Stage, progress: &Progress<'_>) -> Result<Self> {
        let file = preset(stage.preset)?.recipe()?;
        let recipe = file.recipe();
        let texels = Size::new(stage.map, stage.map)?;
        let map = recipe
            .prepare(texels, &file.files(false), progress)?
            .map(progress)?;
        let mesh = mesh::open(stage.mesh)?;
        let scene = Scene::for_mesh(&mesh);
        let size = Size::new(stage.picture.0, stage.picture.1)?;
        let subject = Subject {
            mesh: &mesh,
            map: &map,
            material: &recipe.material,
        };
        let looks = [Look::default()];
        let reference = render_reference(subject, &scene, &looks, size, stage.reference, progress)?
            .swap_remove(0);
        Ok(Self {
            footprint: footprint(&mesh, map.size(), &scene, size, progress)?,
            material: recipe.material,
            stage,
            mesh,
            map,
            scene,
            size,
            reference,
        })
    }

    /// Draws with a map until the effort is spent: the picture, and the milliseconds of each round.
    fn draw(
        &self,
        map: &AnisoMap,
        method: &Method,
        effort: Effort,
        progress: &Progress<'_>,
    ) -> Result<Drawn> {
        let off = Timings::off();
        let subject = Subject {
            mesh: &self.mesh,
            map,
            material: &self.material,
        };
        let prepared = subject.prepare(&off)?;
        let scene = Scene {
            samples: method.samples,
            quality: method.quality,
            ..self.scene.clone()
        };
        let mut pictures = [Picture::new(self.size, [0.0; 3])];
        let mut draw = || {
            let silent = Progress::none();
            let start = Instant::now();
            prepared.draw(&scene, &[method.look], &mut pictures, &off, &silent)?;
            Ok(start.elapsed().as_secs_f64() * 1e3)
        };
        draw()?;
        let started = Instant::now();
        let mut times: Vec<f64> = Vec::new();
        while times.len() < effort.rounds.max(1)
            && (times.len() < 3 || started.elapsed() < effort.time)
        {
            times.push(draw()?);
            progress.check()?;
        }
        let [picture] = pictures;
        Ok((picture, times))
    }

    /// The picture of a method, with its times.
    fn picture(&self, method: &Method, effort: Effort, progress: &Progress<'_>) -> Result<Drawn> {
        match method.map {
            MapUse::Plain => self.draw(&self.map, method, effort, progress),
            MapUse::Stored(storage) => {
                self.draw(&storage.quantise(&self.map), method, effort, progress)
            }
            MapUse::Averaged => self.averaged(method, effort, progress),
        }
    }

    /// With the map averaged down to about one texel a sample, as a mip level is chosen; the same for the whole picture.
    fn averaged(&self, method: &Method, effort: Effort, progress: &Progress<'_>) -> Result<Drawn> {
        let halvings = (0.5 * self.footprint.log2() - f64::from(method.samples).log2()).round();
        let mut level = None;
        for _ in 0..halvings.clamp(0.0, 15.0) as u32 {
            level = averaged(level.as_ref().unwrap_or(&self.map)).or(level);
        }
        let map = level.as_ref().unwrap_or(&self.map);
        self.draw(map, method, effort, progress)
    }
}

/// Texels that half of the pixels see more of, and half less.
fn footprint(
    mesh: &Mesh,
    map: Size,
    scene: &Scene,
    size: Size,
    progress: &Progress<'_>,
) -> Result<f64> {
    let view = View::new(&scene.camera, size)?;
    let geometry = Geometry::new(mesh)?;
    let buffer = GBuffer::draw(&geometry, &view, size.rect(), Cull::None, progress)?;
    let width = size.width() as usize;
    let mut uvs = vec![None; size.texels()];
    for tile in buffer.tiles().iter().filter(|t| !t.is_empty()) {
        for sample in tile.exact(&geometry, &view) {
            uvs[sample.row as usize * width + sample.column as usize] = Some(sample.uv);
        }
    }
    let texels = DVec2::new(f64::from(map.width()), f64::from(map.height()));
    let area = |i: usize| {
        let here = uvs[i]?;
        let (right, below) = ((*uvs.get(i + 1)?)? - here, (*uvs.get(i + width)?)? - here);
        Some((right * texels).perp_dot(below * texels).abs())
    };
    let mut areas: Vec<f64> = (0..uvs.len()).filter_map(area).collect();
    if areas.is_empty() {
        return Ok(1.0);
    }
    let middle = areas.len() / 2;
    Ok(*areas.select_nth_unstable_by(middle, f64::total_cmp).1)
}

/// The map at half its size, widths and double angles averaged over 2x2 texels; `None` for one that has no half.
fn averaged(map: &AnisoMap) -> Option<AnisoMap> {
    let size = Size::new(map.width() / 2, map.height() / 2).ok()?;
    let mut half = AnisoMap::unfilled(size, map.wrap());
    let (width, across) = (map.width() as usize, size.width() as usize);
    let mut region = half.region_mut();
    for i in 0..size.texels() {
        let first = 2 * (i / across) * width + 2 * (i % across);
        let four = [first, first + 1, first + width, first + width + 1];
        let mean = |plane: &[f32]| 0.25 * four.iter().map(|&j| plane[j]).sum::<f32>();
        let texel: Texel = crate::map::settle(
            mean(map.alpha_x()),
            mean(map.alpha_y()),
            mean(map.cos2()),
            mean(map.sin2()),
        );
        region.set(i, texel);
    }
    Some(half)
}

/// What becomes of a picture besides its numbers.
pub(super) trait Keep {
    /// Keeps a picture under a name, and gives the name of its file.
    fn picture(&mut self, name: &str, picture: &Picture) -> Result<Option<String>>;
    /// Keeps a map of differences of what the files hold.
    fn difference(&mut self, name: &str, flip: &Flip) -> Result<()>;
}

/// Measures every way to draw. One step of `progress` for each, and those of the references.
///
/// # Errors
/// When `progress` cancels or `keep` fails.
pub(super) fn measure(
    effort: Effort,
    is_quick: bool,
    keep: &mut dyn Keep,
    progress: &Progress<'_>,
) -> Result<Vec<PictureRow>> {
    let mut rows = Vec::new();
    let later_visits = if is_quick { 0 } else { VISITS - 1 };
    for stage in stages(is_quick) {
        let methods = methods(stage.is_far)?;
        progress.expect((methods.len() * (1 + later_visits)) as u64);
        let studio = Studio::new(stage, progress)?;
        let first = rows.len();
        let mut times = measure_stage(&studio, &methods, effort, keep, &mut rows, progress)?;
        for _ in 0..later_visits {
            for (method, times) in methods.iter().zip(&mut times) {
                times.extend(studio.picture(method, effort, progress)?.1);
                progress.step()?;
            }
        }
        for (row, mut times) in rows[first..].iter_mut().zip(times) {
            times.sort_by(f64::total_cmp);
            row.ms_min = times[0];
            row.ms_median = times[times.len() / 2];
        }
    }
    Ok(rows)
}

/// The first visit to every way to draw a subject: adds rows with all but their times, which it returns.
fn measure_stage(
    studio: &Studio,
    methods: &[Method],
    effort: Effort,
    keep: &mut dyn Keep,
    rows: &mut Vec<PictureRow>,
    progress: &Progress<'_>,
) -> Result<Vec<Vec<f64>>> {
    let name = |method: &str| format!("{} {method}", studio.stage.name);
    let kept = keep.picture(&name("reference"), &studio.reference)?;
    let shown = kept.is_some().then(|| as_displayed(&studio.reference));
    let mut base: Option<Picture> = None;
    let mut all_times = Vec::new();
    for method in methods {
        let (picture, times) = studio.picture(method, effort, progress)?;
        all_times.push(times);
        let mut row = studio.row(
            method,
            base.get_or_insert_with(|| picture.clone()),
            &picture,
        )?;
        row.png = keep.picture(&name(&method.name), &picture)?;
        if let Some(reference) = &shown {
            let flip = Flip::new(reference, &as_displayed(&picture), PIXELS_PER_DEGREE)?;
            row.png_flip_mean = Some(flip.mean());
            keep.difference(&name(&method.name), &flip)?;
        }
        rows.push(row);
        progress.step()?;
    }
    Ok(all_times)
}

impl Studio {
    /// All about a picture but its times and its file.
    fn row(&self, method: &Method, base: &Picture, picture: &Picture) -> Result<PictureRow> {
        let flip = Flip::new(&self.reference, picture, PIXELS_PER_DEGREE)?;
        let colour = ColourDifference::new(&self.reference, picture)?;
        let storage = match method.map {
            MapUse::Stored(storage) => storage,
            MapUse::Plain | MapUse::Averaged => Storage::FULL,
        };
        Ok(PictureRow {
            scene: self.stage.name,
            group: method.group,
            method: method.name.clone(),
            look: method.look.to_string(),
            storage: storage.to_string(),
            bytes: if method.look.mean {
                0
            } else {
                storage.bytes_per_texel()
            },
            samples: method.samples * method.samples,
            ms_min: 0.0,
            ms_median: 0.0,
            flip_mean: flip.mean(),
            flip_p999: flip.quantile(0.999),
            flip_max: flip.largest(),
            de_mean: colour.mean(),
            de_p999: colour.quantile(0.999),
            de_max: colour.largest(),
            flip_base: Flip::new(base, picture, PIXELS_PER_DEGREE)?.mean(),
            de_base: ColourDifference::new(base, picture)?.mean(),
            png: None,
            png_flip_mean: None,
        })
    }
}

/// What an 8-bit file of the picture holds, as light.
fn as_displayed(picture: &Picture) -> Picture {
    let mut shown = Picture::new(picture.size(), [0.0; 3]);
    let bytes = picture.to_srgb8();
    for (pixel, bytes) in shown.pixels_mut().iter_mut().zip(bytes.as_chunks().0) {
        let bytes: &[u8; 3] = bytes;
        *pixel = bytes.map(|b| linear_from_srgb(f32::from(b) / 255.0));
    }
    shown
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::map::Wrap;
    use crate::math::Axis;

    #[test]
    fn naive_averaging_is_naive() {
        let size = Size::new(5, 4).unwrap();
        let texel = |degrees, alpha_x| Texel {
            alpha_x,
            alpha_y: 0.5,
            axis: Axis::from_degrees(degrees),
        };
        let mut map = AnisoMap::constant(size, Wrap::Repeat, texel(10.0, 0.1));
        map.region_mut().set(1, texel(30.0, 0.3));
        map.region_mut().set(6, texel(30.0, 0.3));
        let half = averaged(&map).unwrap();
        assert_eq!((half.width(), half.height()), (2, 2));
        let first = half.texel(0, 0);
        assert!(
            (first.alpha_x - 0.2).abs() < 1e-6,
            "not the root of a mean square"
        );
        assert!((first.axis.degrees() - 20.0).abs() < 1e-3);
        let last = half.texel(1, 1);
        assert!(last.alpha_x == 0.1 && (last.axis.degrees() - 10.0).abs() < 1e-3);
        let row = AnisoMap::constant(Size::new(9, 1).unwrap(), Wrap::Repeat, texel(0.0, 0.1));
        assert!(averaged(&row).is_none());
    }

    #[test]
    fn every_method_can_be_named() {
        for is_far in [false, true] {
            let all = methods(is_far).unwrap();
            let mut names: Vec<&str> = all.iter().map(|m| m.name.as_str()).collect();
            assert!(names.len() >= 12);
            names.sort_unstable();
            names.dedup();
            assert_eq!(names.len(), all.len());
        }
    }
}
