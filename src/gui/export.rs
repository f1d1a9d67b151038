//! The export dialog, and the thread that writes the files.

use super::desk::Desk;
use super::messages::count;
use super::properties::{bytes_text, memory, too_large};
use super::theme::Palette;
use super::widgets::caption;
use super::work::{Now, Reins, Work};
use anisomap::Error;
use anisomap::analyse::compare;
use anisomap::convention::{MapInfo, Reflectance};
use anisomap::export::exr::{Precision, write_master, write_rgb_pair};
use anisomap::export::gltf::{GltfOptions, write_glb, write_gltf};
use anisomap::export::png::{Depth, write_picture, write_set};
use anisomap::export::{Export, Written, beside};
use anisomap::import::gltf::read_gltf;
use anisomap::map::Size;
use anisomap::mesh::{self, Mesh};
use anisomap::preview::{Look, Scene, Subject, render_sheet};
use anisomap::progress::Progress;
use anisomap::recipe::{Files, Recipe, Target};
use anisomap::studio::apart;
use eframe::egui::{self, RichText, Ui};
use std::path::{Path, PathBuf};

/// The sizes that are offered beside the document's own.
const SIDES: [u32; 6] = [512, 1024, 2048, 4096, 8192, 16384];

/// What a target is, for people.
fn describe(target: Target) -> (&'static str, &'static str) {
    match target {
        Target::Exr => (
            "Master EXR",
            "The map itself, half floats: alpha_x, alpha_y and the doubled direction. Lossless to read back.",
        ),
        Target::RgbExr => (
            "Two RGB EXR",
            "For programs that know only R, G, B: widths in one, direction in the other.",
        ),
        Target::Png8 => (
            "PNG set, 8 bit",
            "For programs that read no more. Directions are off by up to 0.3 degrees.",
        ),
        Target::Png16 => ("PNG set, 16 bit", "Directions within 0.003 degrees."),
        Target::Glb => (
            "GLB",
            "The mesh with KHR_materials_anisotropy, in one file.",
        ),
        Target::Gltf => ("glTF", "The same with its parts beside it."),
        Target::Preview => ("Picture", "A lit picture of the mesh, 960 x 720."),
    }
}

/// What is to be written.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Order {
    pub(crate) recipe: Recipe,
    pub(crate) files: Files,
    pub(crate) targets: Vec<Target>,
    pub(crate) size: Size,
    pub(crate) folder: PathBuf,
    pub(crate) stem: String,
}

/// What was written, and what was lost by it.
#[derive(Debug, Default)]
pub(crate) struct Report {
    pub(crate) files: Vec<(PathBuf, u64)>,
    pub(crate) notes: Vec<String>,
}

/// The dialog.
pub(crate) struct ExportDialog {
    targets: Vec<Target>,
    size: Size,
    pub(crate) folder: String,
    name: String,
    work: Option<Work<Result<Report, Error>>>,
    report: Option<Report>,
    error: Option<String>,
}

/// What the dialog wants done.
pub(crate) enum Wish {
    Stay,
    Close,
    /// A folder is to be chosen.
    Browse,
}

impl ExportDialog {
    pub(crate) fn new(desk: &Desk) -> Self {
        let recipe = desk.studio.recipe();
        let settings = &desk.settings.export;
        let of_recipe = if recipe.targets.is_empty() {
            Target::DEFAULT.to_vec()
        } else {
            recipe.targets.clone()
        };
        let beside = desk
            .studio
            .document()
            .path()
            .and_then(Path::parent)
            .map(|p| p.join("export"));
        let folder = settings
            .folder
            .clone()
            .or(beside)
            .unwrap_or_else(|| PathBuf::from("export"));
        let title = desk.studio.document().title();
        let stem = title.trim_end_matches(".toml");
        Self {
            targets: if settings.targets.is_empty() {
                of_recipe
            } else {
                settings.targets.clone()
            },
            size: recipe.size,
            folder: folder.display().to_string(),
            name: if stem.is_empty() {
                "map".to_owned()
            } else {
                stem.to_owned()
            },
            work: None,
            report: None,
            error: None,
        }
    }

    /// Shows it, and looks after the work.
    pub(crate) fn show(&mut self, ui: &mut Ui, desk: &mut Desk) -> Wish {
        self.follow(desk);
        ui.set_width(460.0);
        ui.heading("Export");
        ui.add_space(6.0);
        if let Some(work) = &self.work {
            ui.label("Writing files\u{2026}");
            ui.add(egui::ProgressBar::new(work.part()).show_percentage());
            ui.ctx()
                .request_repaint_after(std::time::Duration::from_millis(80));
            if ui
                .button("Cancel")
                .on_hover_text("Stops; files that are not finished are not left behind.")
                .clicked()
            {
                work.cancel();
            }
            return Wish::Stay;
        }
        if let Some(report) = &self.report {
            return show_report(ui, report);
        }
        self.form(ui, desk)
    }

    fn form(&mut self, ui: &mut Ui, desk: &mut Desk) -> Wish {
        let palette = Palette::of(ui);
        caption(ui, "What to write");
        for target in Target::ALL {
            let (name, about) = describe(target);
            let mut on = self.targets.contains(&target);
            ui.horizontal(|ui| {
                ui.set_min_height(22.0);
                if ui.checkbox(&mut on, name).on_hover_text(about).changed() {
                    self.targets.retain(|t| *t != target);
                    if on {
                        self.targets.push(target);
                        self.targets.sort_unstable();
                    }
                }
            });
        }
        caption(ui, "Size in texels");
        let own = desk.studio.recipe().size;
        egui::ComboBox::from_id_salt("export size")
            .width(200.0)
            .selected_text(self.size.to_string())
            .show_ui(ui, |ui| {
                for size in sizes(own) {
                    let text = format!("{size}  ({})", memory(desk.studio.recipe(), size));
                    ui.selectable_value(&mut self.size, size, text);
                }
            })
            .response
            .accessible_name("Size of the files in texels")
            .on_hover_text("The map is made anew at this size: nothing gets blurred.");
        if let Some(much) = too_large(desk.studio.recipe(), self.size) {
            ui.add(egui::Label::new(RichText::new(much).color(palette.warning)).wrap());
        }
        caption(ui, "Folder and name");
        let mut wish = Wish::Stay;
        ui.horizontal(|ui| {
            let width = ui.available_width() - 90.0;
            ui.add(egui::TextEdit::singleline(&mut self.folder).desired_width(width))
                .accessible_name("Folder");
            if ui
                .button("Browse\u{2026}")
                .on_hover_text("Asks the desktop for a folder.")
                .clicked()
            {
                wish = Wish::Browse;
            }
        });
        ui.add(egui::TextEdit::singleline(&mut self.name).desired_width(200.0))
            .accessible_name("Name of the files")
            .on_hover_text("What every file's name begins with.");
        if let Some(error) = &self.error {
            ui.add(egui::Label::new(RichText::new(error).color(palette.error)).wrap());
        }
        ui.add_space(10.0);
        ui.horizontal(|ui| {
            let ready =
                !self.targets.is_empty() && !self.folder.trim().is_empty() && is_name(&self.name);
            let go = egui::Button::new(RichText::new("Export").color(palette.text))
                .fill(palette.accent_ground);
            if ui
                .add_enabled(ready, go)
                .on_hover_text("Writes the files.")
                .clicked()
            {
                self.begin(ui, desk);
            }
            if ui.button("Close").clicked() {
                wish = Wish::Close;
            }
        });
        wish
    }

    /// Begins to write with what is chosen.
    pub(crate) fn begin(&mut self, ui: &Ui, desk: &mut Desk) {
        desk.settings.export.folder = Some(PathBuf::from(self.folder.trim()));
        desk.settings.export.targets.clone_from(&self.targets);
        desk.save_settings();
        let order = Order {
            recipe: desk.studio.recipe().clone(),
            files: desk.studio.document().files(),
            targets: self.targets.clone(),
            size: self.size,
            folder: PathBuf::from(self.folder.trim()),
            stem: self.name.clone(),
        };
        self.error = None;
        match Work::begin("export", ui.ctx(), move |reins, give| {
            give(apart(|| write(&order, reins)));
        }) {
            Ok(work) => self.work = Some(work),
            Err(error) => self.error = Some(error.to_string()),
        }
    }

    fn follow(&mut self, desk: &mut Desk) {
        let Some(work) = &self.work else { return };
        match work.now() {
            Now::Going => return,
            Now::Came(Ok(report)) => {
                let files = count(report.files.len(), "file");
                desk.messages
                    .news(format!("{files} written to {}", self.folder));
                self.report = Some(report);
            }
            Now::Came(Err(Error::Cancelled)) => self.error = Some(Error::Cancelled.to_string()),
            Now::Came(Err(error)) => self.error = Some(error.to_string()),
            Now::Over => self.error = Some("The work ended without a result; try again".to_owned()),
        }
        self.work = None;
    }

    /// Whether files are being written.
    pub(crate) fn is_working(&self) -> bool {
        self.work.is_some()
    }
}

fn is_name(name: &str) -> bool {
    let name = name.trim();
    !name.is_empty() && !name.starts_with('.') && !name.contains(['/', '\\', '\0'])
}

/// The document's size, and the same shape in others.
fn sizes(own: Size) -> Vec<Size> {
    let ratio = f64::from(own.height()) / f64::from(own.width());
    let others = SIDES
        .iter()
        .filter_map(|side| Size::new(*side, (f64::from(*side) * ratio).round() as u32).ok());
    let mut sizes: Vec<Size> = std::iter::once(own).chain(others).collect();
    sizes.sort_by_key(|s| s.texels());
    sizes.dedup();
    sizes
}

fn show_report(ui: &mut Ui, report: &Report) -> Wish {
    let palette = Palette::of(ui);
    egui::ScrollArea::vertical()
        .max_height(240.0)
        .show(ui, |ui| {
            for (path, bytes) in &report.files {
                ui.horizontal(|ui| {
                    let name = path
                        .file_name()
                        .map_or(String::new(), |n| n.to_string_lossy().into_owned());
                    ui.label(name).on_hover_text(path.display().to_string());
                    ui.label(RichText::new(bytes_text(*bytes)).color(palette.weak));
                });
            }
        });
    caption(ui, "What was lost");
    if report.notes.is_empty() {
        ui.label("Nothing beyond the rounding of half floats.");
    }
    for note in &report.notes {
        ui.add(egui::Label::new(note).wrap());
    }
    ui.add_space(8.0);
    if ui.button("Close").clicked() {
        Wish::Close
    } else {
        Wish::Stay
    }
}

/// Makes the map anew at its size and writes all that was asked for.
pub(crate) fn write(order: &Order, reins: &Reins) -> Result<Report, Error> {
    std::fs::create_dir_all(&order.folder).map_err(Error::write(&order.folder))?;
    let steps = order.targets.len() as f64 + 2.0;
    let filling = |done: u64, all: u64| {
        reins.report(2.0 / steps * done as f64 / all.max(1) as f64);
        reins.go_on()
    };
    let progress = Progress::new(&filling);
    let mut recipe = order.recipe.clone();
    recipe.aspect = Some(recipe.aspect_at(recipe.size));
    recipe.size = order.size;
    let map = recipe
        .prepare(order.size, &order.files, &progress)?
        .map(&progress)?;
    let mesh = mesh_of(&recipe, &order.files)?;
    let info = info(&recipe, &order.stem);
    let export = Export::new(&map, &info);
    let mut report = Report::default();
    for (i, target) in order.targets.iter().enumerate() {
        if !reins.go_on() {
            return Err(Error::Cancelled);
        }
        reins.report((i as f64 + 2.0) / steps);
        write_target(order, *target, &export, (&recipe, &mesh), &mut report)?;
    }
    Ok(report)
}

fn mesh_of(recipe: &Recipe, files: &Files) -> Result<Mesh, Error> {
    let word = recipe
        .mesh
        .as_deref()
        .unwrap_or(anisomap::studio::DEFAULT_MESH);
    files.mesh("mesh", word)
}

fn info(recipe: &Recipe, stem: &str) -> MapInfo {
    let material = recipe.material;
    MapInfo {
        name: if recipe.name.is_empty() {
            stem.to_owned()
        } else {
            recipe.name.clone()
        },
        aspect: recipe.aspect_at(recipe.size),
        mesh: recipe.mesh.clone().filter(|m| mesh::builtin(m).is_some()),
        material: Some(Reflectance {
            diffuse: material.diffuse,
            specular: material.specular,
            ambient: material.ambient,
        }),
    }
}

fn write_target(
    order: &Order,
    target: Target,
    export: &Export<'_>,
    (recipe, mesh): (&Recipe, &Mesh),
    report: &mut Report,
) -> Result<(), Error> {
    let stem = order.folder.join(&order.stem);
    let written: Vec<Written> = match target {
        Target::Exr => vec![write_master(
            &beside(&stem, ".exr"),
            export,
            Precision::Half,
        )?],
        Target::RgbExr => write_rgb_pair(&stem, export, Precision::Half)?.into(),
        Target::Png8 => write_set(&stem, export, Depth::Eight)?,
        Target::Png16 => write_set(&stem, export, Depth::Sixteen)?,
        Target::Glb | Target::Gltf => gltf(&stem, target, export, (recipe, mesh), report)?,
        Target::Preview => {
            let mut scene = Scene::for_mesh(mesh);
            scene.exposure = recipe.scene.exposure;
            let subject = Subject {
                mesh,
                map: export.map(),
                material: &recipe.material,
            };
            let looks = if recipe.scene.models.is_empty() {
                vec![Look::default()]
            } else {
                Look::list(&recipe.scene.models.join(","))?
            };
            let picture = render_sheet(
                subject,
                &scene,
                &looks,
                Size::new(960, 720)?,
                &Progress::none(),
            )?;
            vec![write_picture(&beside(&stem, "_preview.png"), &picture)?]
        }
    };
    if target == Target::Png8 {
        report.notes.push(
            "8-bit PNG: directions are off by up to 0.3 degrees, widths by up to 1/510.".to_owned(),
        );
    }
    for file in written {
        if !report.files.iter().any(|(path, _)| *path == file.path) {
            report.files.push((file.path, file.bytes));
        }
    }
    Ok(())
}

/// A glTF, and how far it is from the map when it is read back.
fn gltf(
    stem: &Path,
    target: Target,
    export: &Export<'_>,
    (recipe, mesh): (&Recipe, &Mesh),
    report: &mut Report,
) -> Result<Vec<Written>, Error> {
    let options = GltfOptions::default();
    let (written, told) = if target == Target::Glb {
        write_glb(
            &beside(stem, ".glb"),
            export,
            mesh,
            &recipe.material,
            options,
        )
        .map(|(w, r)| (vec![w], r))?
    } else {
        write_gltf(stem, export, mesh, &recipe.material, options)?
    };
    let back = read_gltf(&written[0].path)?;
    let apart = compare(export.map(), &back.map)?;
    report.notes.push(format!(
        "{}, read back: widths within {:.2} %, directions within {:.2} degrees.",
        describe(target).0,
        100.0 * apart.well_held.max,
        apart.angle.max_degrees
    ));
    if told.clamped > 0 {
        let texels = count(told.clamped as usize, "texel");
        report
            .notes
            .push(format!("Rougher than glTF can say: {texels}."));
    }
    Ok(written)
}
