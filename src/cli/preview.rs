//! `anisomap preview`

use super::args::{PreviewArgs, QualityWord};
use super::{Outcome, Result, console, input};
use anisomap::Error;
use anisomap::export::png::write_picture;
use anisomap::generate::{looks, scene};
use anisomap::map::{AnisoMap, Size};
use anisomap::mesh::Mesh;
use anisomap::preview::{
    Difference, Look, Material, Measure, Picture, Quality, REFERENCE_SAMPLES, Scene, Stage,
    Subject, Timings, panel_size, render_reference, side_by_side,
};
use serde_json::json;

/// The picture's size for one look. Several have squares of two thirds of the width, up to [`WIDEST`] of them in one row.
const WIDTH: u32 = 960;
const HEIGHT: u32 = 720;
const WIDEST: usize = 4;

pub(super) fn run(args: PreviewArgs) -> Result {
    console::catch_interrupts();
    if args.difference && args.model.len() != 2 {
        return Err(Error::invalid(
            "--difference",
            match args.model.len() {
                0 => "given without --model".to_owned(),
                1 => "given with one model".to_owned(),
                n => format!("given with {n} models"),
            },
            "allowed: with two, as in --model ward,ggx --difference",
        ));
    }
    if args.timings && args.quality == QualityWord::Reference {
        return Err(Error::invalid(
            "--timings",
            "given with --quality reference",
            "allowed: with the other qualities; a reference has no stages to time",
        ));
    }
    // The small things first: a wrong word should not cost the time of a map.
    let is_png = args
        .output
        .extension()
        .is_some_and(|e| e.eq_ignore_ascii_case("png"));
    if !is_png {
        return Err(Error::invalid(
            "--output",
            args.output.display(),
            "allowed: a file whose name ends in .png",
        ));
    }
    let named = args.mesh.as_deref().map(anisomap::mesh::open).transpose()?;
    let source = input::source(&args.input, &args.recipe_args, args.map_size)?;
    if let Some(note) = input::mended_note(source.mended) {
        console::complain(&note);
    }
    let recipe = source.recipe.as_ref().map(|(file, _)| file.recipe());
    let mesh = named.map_or_else(|| source.mesh(), Ok)?;
    let material = source.material();
    let mut scene = scene(&mesh, recipe);
    if !args.light.is_empty() {
        scene.set_directions(&args.light);
    }
    scene.exposure = args.exposure.unwrap_or(scene.exposure);
    let reference = args.quality == QualityWord::Reference;
    let reference = reference.then(|| args.samples.unwrap_or(REFERENCE_SAMPLES));
    if reference.is_none() {
        scene.samples = args.samples.unwrap_or(scene.samples);
    }
    if args.quality == QualityWord::Plain {
        scene.quality = Quality {
            back_faces: true,
            ..Quality::PLAIN
        };
    }
    let looks = looks(&args.model, recipe)?;
    let timings = if args.timings {
        Timings::on()
    } else {
        Timings::off()
    };
    let shown = Shown {
        timings: &timings,
        reference,
        mesh: &mesh,
        map: &source.map,
        material: &material,
        scene: &scene,
    };
    let size = args
        .size
        .map_or_else(|| default_size(looks.len(), args.difference), Ok)?;
    let (picture, difference) = if args.difference {
        let (picture, numbers) = shown.difference(&looks, size)?;
        (picture, Some(numbers))
    } else {
        (shown.sheet(&looks, size)?, None)
    };
    if args.timings {
        timings.time(Stage::Tone, || drop(picture.to_srgb8()));
    }
    let written = write_picture(&args.output, &picture)?;
    if args.json {
        console::print_json(&json!({
            "path": written.path,
            "bytes": written.bytes,
            "size": [picture.width(), picture.height()],
            "models": looks.iter().map(Look::to_string).collect::<Vec<_>>(),
            "difference": difference,
            "mended": source.mended,
            "timings": args.timings.then(|| stages(&timings)),
        }))?;
    } else {
        let path = written.path.display();
        let mut text = format!(
            "{path}  {}  {}\n",
            picture.size(),
            console::bytes(written.bytes)
        );
        if let Some(numbers) = difference {
            text += &format!(
                "difference in luminance: largest {:.4}, mean {:.4}\n",
                numbers["largest"].as_f64().unwrap_or(0.0),
                numbers["mean"].as_f64().unwrap_or(0.0)
            );
        }
        if args.timings {
            for stage in Stage::ALL {
                let time = timings.milliseconds(stage);
                text += &format!("{:<8}{time:>10.2} ms\n", stage.name());
            }
        }
        console::print(&text)?;
    }
    Ok(Outcome::Fine)
}

/// Milliseconds by stage.
fn stages(timings: &Timings) -> serde_json::Value {
    let all = Stage::ALL.map(|s| (s.name().to_owned(), json!(timings.milliseconds(s))));
    serde_json::Value::Object(all.into_iter().collect())
}

fn default_size(looks: usize, difference: bool) -> Result<Size> {
    let panels = if difference { 1 } else { looks };
    if panels == 1 {
        return Size::new(WIDTH, HEIGHT);
    }
    let rows = if panels <= WIDEST { 1 } else { panels.isqrt() };
    let columns = panels.div_ceil(rows);
    let side = |panels: usize| WIDTH * 2 / 3 * u32::try_from(panels).unwrap_or(u32::MAX).min(64);
    Size::new(side(columns), side(panels.div_ceil(columns)))
}

/// What is drawn.
pub(super) struct Shown<'a> {
    pub(super) mesh: &'a Mesh,
    pub(super) map: &'a AnisoMap,
    pub(super) material: &'a Material,
    pub(super) scene: &'a Scene,
    pub(super) timings: &'a Timings,
    /// Samples along a pixel's side of a reference, when it shall be one.
    pub(super) reference: Option<u32>,
}

impl Shown<'_> {
    fn subject(&self) -> Subject<'_> {
        Subject {
            mesh: self.mesh,
            map: self.map,
            material: self.material,
        }
    }

    /// One picture per look.
    fn pictures(&self, looks: &[Look], size: Size) -> Result<Vec<Picture>> {
        console::with_progress("drawing", |progress| {
            if let Some(samples) = self.reference {
                let subject = self.subject();
                return render_reference(subject, self.scene, looks, size, samples, progress);
            }
            let prepared = self.subject().prepare(self.timings)?;
            prepared.render(self.scene, looks, size, self.timings, progress)
        })
    }

    /// One picture with a panel for each look; a single look has no caption.
    pub(super) fn sheet(&self, looks: &[Look], size: Size) -> Result<Picture> {
        if looks.len() == 1 {
            return Ok(self.pictures(looks, size)?.swap_remove(0));
        }
        let panels = self.pictures(looks, panel_size(size, looks.len())?)?;
        let captions: Vec<String> = looks.iter().map(Look::caption).collect();
        side_by_side(&panels, &captions, size)
    }

    /// How two looks differ, as a picture and as numbers.
    fn difference(&self, looks: &[Look], size: Size) -> Result<(Picture, serde_json::Value)> {
        let pictures = self.pictures(looks, size)?;
        let difference = Difference::new(&pictures[0], &pictures[1], Measure::Signed)?
            .named([looks[0].caption(), looks[1].caption()]);
        let numbers = json!({ "largest": difference.largest(), "mean": difference.mean() });
        Ok((difference.picture()?, numbers))
    }
}
