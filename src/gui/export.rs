//! The export dialog, and the thread that writes the files.

use super::desk::Desk;
use super::dialogs::{default_button, main_button};
use super::messages::count;
use super::properties::{bytes_text, memory, too_large};
use super::theme::Palette;
use super::widgets::{Tip, caption};
use super::work::{Now, Reins, Work};
use anisomap::Error;
use anisomap::export::Written;
use anisomap::export::exr::Precision;
use anisomap::export::png::README;
use anisomap::generate::{Job, Made, Watch};
use anisomap::map::Size;
use anisomap::progress::Progress;
use anisomap::recipe::{Stamp, Target};
use anisomap::studio::apart;
use eframe::egui::{self, RichText, Ui};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU32, Ordering};

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

/// What was written, and what was lost by it.
#[derive(Debug, Default)]
struct Report {
    folder: PathBuf,
    files: Vec<Written>,
    notes: Vec<String>,
}

/// The dialog.
pub(crate) struct ExportDialog {
    targets: Vec<Target>,
    /// Whether OpenEXR files hold 32-bit floats.
    float: bool,
    size: Size,
    pub(crate) folder: String,
    name: String,
    /// Files that are there and were not written by this document: they are told before they are replaced.
    over: Vec<PathBuf>,
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
        // Where it is is said in full.
        let folder = std::path::absolute(&folder).unwrap_or(folder);
        let title = desk.studio.document().title();
        let stem = title.trim_end_matches(".toml");
        Self {
            targets: if settings.targets.is_empty() {
                of_recipe
            } else {
                settings.targets.clone()
            },
            float: settings.float,
            size: recipe.size,
            folder: folder.display().to_string(),
            name: if stem.is_empty() {
                "map".to_owned()
            } else {
                stem.to_owned()
            },
            over: Vec::new(),
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
        if !self.over.is_empty() {
            return self.ask(ui, desk);
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
        let has_exr = [Target::Exr, Target::RgbExr]
            .iter()
            .any(|t| self.targets.contains(t));
        ui.add_enabled_ui(has_exr, |ui| {
            ui.checkbox(&mut self.float, "32-bit floats in OpenEXR")
                .tip("Nothing is rounded, and files are twice as large. Halves are within 0.05 %.");
        });
        caption(ui, "Size in texels");
        let own = desk.studio.recipe().size;
        egui::ComboBox::from_id_salt("export size")
            .width(200.0)
            .selected_text(self.size.to_string())
            .show_ui(ui, |ui| {
                for size in sizes(own) {
                    let text = format!("{size}  ({})", memory(desk.studio.recipe(), size));
                    let takes = memory(desk.studio.recipe(), size);
                    let tip =
                        format!("Writes the map at {size}, which takes about {takes} meanwhile.");
                    ui.selectable_value(&mut self.size, size, text)
                        .on_hover_text(tip);
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
                .accessible_name("Folder")
                .on_hover_text("Where the files go; made where it is missing.");
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
            let go = if ready {
                default_button(ui, "Export")
            } else {
                ui.add_enabled_ui(false, |ui| main_button(ui, "Export"))
                    .inner
            };
            if go.tip("Writes the files (Enter).").clicked() {
                self.begin(ui, desk);
            }
            let close = ui.button("Close");
            if close.on_hover_text("Writes nothing (Escape).").clicked() {
                wish = Wish::Close;
            }
        });
        wish
    }

    /// Asks about files that would be replaced.
    fn ask(&mut self, ui: &mut Ui, desk: &mut Desk) -> Wish {
        let text = match self.over.len() {
            1 => "A file is there already: it was not written from this document in this session, or changed since."
                .to_owned(),
            n => format!(
                "{n} files are there already: they were not written from this document in this session, or changed since."
            ),
        };
        let replace = if self.over.len() == 1 {
            "Replace it"
        } else {
            "Replace them"
        };
        ui.add(egui::Label::new(text).wrap());
        file_list(ui, self.over.iter().map(|path| (path.as_path(), None)));
        ui.add_space(8.0);
        ui.horizontal(|ui| {
            if default_button(ui, "Back")
                .on_hover_text("To another folder or name; nothing was written.")
                .clicked()
            {
                self.over.clear();
            }
            if ui
                .button(replace)
                .on_hover_text("Writes over these files.")
                .clicked()
            {
                let as_they_are = |path: PathBuf| (path.clone(), Stamp::of(&path));
                desk.exported.extend(self.over.drain(..).map(as_they_are));
                self.begin(ui, desk);
            }
        });
        Wish::Stay
    }

    /// What is to be written.
    fn job(&self, desk: &Desk) -> Result<Job, Error> {
        let typed = Path::new(self.folder.trim());
        let folder = std::path::absolute(typed).unwrap_or_else(|_| typed.to_owned());
        Ok(Job {
            file: desk.studio.document().at_size(self.size)?,
            folder,
            stem: self.name.trim().to_owned(),
            formats: self.targets.clone(),
            precision: match self.float {
                true => Precision::Float,
                false => Precision::Half,
            },
            mesh: None,
            allow_outside: desk.studio.document().files().allow_outside,
            readme: true,
            copies: true,
        })
    }

    /// Begins to write what is chosen, or asks first where that would replace another's files.
    pub(crate) fn begin(&mut self, ui: &Ui, desk: &mut Desk) {
        self.error = None;
        let job = match self.job(desk) {
            Ok(job) => job,
            Err(error) => {
                self.error = Some(error.to_string());
                return;
            }
        };
        let is_ours = |path: &PathBuf| {
            let then = desk.exported.get(path);
            then.is_some_and(|then| *then == Stamp::of(path))
        };
        self.over = job.paths();
        // What stands in the text beside PNG sets is the same for all.
        self.over
            .retain(|p| p.exists() && !p.ends_with(README) && !is_ours(p));
        if !self.over.is_empty() {
            return;
        }
        desk.settings.export.folder = Some(PathBuf::from(self.folder.trim()));
        desk.settings.export.targets.clone_from(&self.targets);
        desk.settings.export.float = self.float;
        desk.save_settings();
        match Work::begin("export", ui.ctx(), move |reins, give| {
            give(apart(|| write(&job, reins)));
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
                    .news(format!("{files} written to {}", report.folder.display()));
                let files = report.files.iter();
                let paths = files.map(|f| (f.path.clone(), Stamp::of(&f.path)));
                desk.exported.extend(paths);
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
    let files = count(report.files.len(), "file");
    let text = format!("{files} in {}", report.folder.display());
    ui.add(egui::Label::new(text).wrap());
    let all = report.files.iter();
    file_list(ui, all.map(|f| (f.path.as_path(), Some(f.bytes))));
    caption(ui, "What was lost");
    for note in &report.notes {
        ui.add(egui::Label::new(note).wrap());
    }
    ui.add_space(8.0);
    let close = default_button(ui, "Close");
    if close
        .on_hover_text("Closes this list (Enter, Escape).")
        .clicked()
    {
        Wish::Close
    } else {
        Wish::Stay
    }
}

/// Files with their sizes, all of them to be reached.
fn file_list<'a>(ui: &mut Ui, files: impl Iterator<Item = (&'a Path, Option<u64>)>) {
    use egui::scroll_area::ScrollBarVisibility::VisibleWhenNeeded;
    let palette = Palette::of(ui);
    ui.spacing_mut().scroll = egui::style::ScrollStyle::solid();
    egui::ScrollArea::vertical()
        .max_height(240.0)
        .auto_shrink([false, true])
        .scroll_bar_visibility(VisibleWhenNeeded)
        .show(ui, |ui| {
            for (path, bytes) in files {
                ui.horizontal(|ui| {
                    let name = path.file_name().unwrap_or_default().to_string_lossy();
                    ui.label(name).on_hover_text(path.display().to_string());
                    if let Some(bytes) = bytes {
                        ui.label(RichText::new(size_text(bytes)).color(palette.weak));
                    }
                });
            }
        });
}

/// A file's size, in KiB where it is small.
fn size_text(bytes: u64) -> String {
    match bytes {
        0..=0x0f_ffff => format!("{} KiB", bytes.div_ceil(1024)),
        _ => bytes_text(bytes),
    }
}

/// A stage after the other as one bar, and Cancel asked for at every step of each.
struct Stages<'a> {
    reins: &'a Reins,
    all: u32,
    done: AtomicU32,
}

impl Watch for Stages<'_> {
    fn stage<T>(
        &self,
        _: &'static str,
        work: impl FnOnce(&Progress<'_>) -> anisomap::Result<T>,
    ) -> anisomap::Result<T> {
        let before = self.done.fetch_add(1, Ordering::Relaxed);
        let report = |done: u64, total: u64| {
            let part = done as f64 / total.max(1) as f64;
            self.reins
                .report((f64::from(before) + part) / f64::from(self.all));
            self.reins.go_on()
        };
        work(&Progress::new(&report))
    }
}

/// Writes all that was asked for, as `generate` does.
fn write(job: &Job, reins: &Reins) -> Result<Report, Error> {
    let stages = Stages {
        reins,
        all: 3 + job.formats.len() as u32,
        done: AtomicU32::new(0),
    };
    let made = job.make(&stages)?;
    Ok(Report {
        folder: job.folder.clone(),
        notes: notes(job, &made),
        files: made.files,
    })
}

/// What was lost, as far as it was measured.
fn notes(job: &Job, made: &Made) -> Vec<String> {
    let mut notes = Vec::new();
    if let Some(r) = &made.round_trip {
        notes.push(format!(
            "glTF, read back: widths within {:.2} %, directions within {:.2} degrees; the smallest widths within {:.1} %.",
            100.0 * r.alpha,
            r.degrees,
            100.0 * r.alpha_elsewhere.max(r.alpha)
        ));
        if r.clamped > 0 {
            let texels = count(r.clamped as usize, "texel");
            notes.push(format!("Rougher than glTF can say: {texels}."));
        }
    }
    if job.formats.contains(&Target::Png8) {
        notes.push(
            "8-bit PNG: directions are off by up to 0.35 degrees, widths by up to 2 % where they are narrow.".to_owned(),
        );
    }
    if made.mended.faults() > 0 {
        let texels = count(made.mended.faults() as usize, "texel");
        notes.push(format!(
            "What the recipe reads held what no map can hold: {texels}."
        ));
    }
    if notes.is_empty() {
        let is_exr = |t: &Target| matches!(t, Target::Exr | Target::RgbExr);
        let is_whole = job.precision == Precision::Float && job.formats.iter().all(is_exr);
        let lost = match is_whole {
            true => "Nothing.",
            false => "Nothing beyond the rounding of half floats or 16 bits.",
        };
        notes.push(lost.to_owned());
    }
    notes
}
