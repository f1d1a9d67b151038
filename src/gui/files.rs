//! Choosing a file or folder: the desktop's own dialog where there is one, and a field with a list for everywhere else.

use super::desk::Desk;
use super::theme::Palette;
use super::work::{Now, Work};
use anisomap::mesh::split_path;
use eframe::egui::{self, Key, RichText, TextEdit, Ui};
use std::path::{Path, PathBuf};

/// What a path is wanted for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Purpose {
    Open,
    SaveAs,
    /// Saves, and then does what had to wait.
    SaveThen,
    Import,
    Mesh,
    /// Takes the place of a file that the recipe names.
    Find,
    ExportFolder,
}

impl Purpose {
    fn title(self) -> &'static str {
        match self {
            Self::Open => "Open",
            Self::SaveAs | Self::SaveThen => "Save as",
            Self::Import => "Import a map or textures",
            Self::Mesh => "Load mesh",
            Self::Find => "Find the file",
            Self::ExportFolder => "Folder for the files",
        }
    }

    fn button(self) -> &'static str {
        match self {
            Self::Open => "Open",
            Self::SaveAs | Self::SaveThen => "Save",
            Self::Import => "Import",
            Self::Mesh => "Load",
            Self::Find => "Take it",
            Self::ExportFolder => "Choose",
        }
    }

    /// The endings of the files that are offered.
    fn endings(self) -> &'static [&'static str] {
        match self {
            Self::Open => &["toml", "exr", "png", "tif", "tiff", "glb", "gltf", "obj"],
            Self::SaveAs | Self::SaveThen => &["toml"],
            Self::Import => &["exr", "png", "tif", "tiff", "glb", "gltf"],
            Self::Mesh => &["glb", "gltf", "obj"],
            Self::Find => &["exr", "png", "tif", "tiff", "glb", "gltf", "obj"],
            Self::ExportFolder => &[],
        }
    }

    fn saves(self) -> bool {
        matches!(self, Self::SaveAs | Self::SaveThen)
    }
}

/// What came of a frame of the dialog.
pub(crate) enum Answer {
    None,
    Close,
    Path(PathBuf),
}

/// The dialog.
pub(crate) struct FileDialog {
    purpose: Purpose,
    /// What there is to know before choosing.
    note: Option<String>,
    text: String,
    listed: Option<(PathBuf, Vec<Entry>)>,
    native: Option<Work<Option<PathBuf>>>,
    asked: bool,
    fresh: bool,
    /// What a name without a folder is seen from.
    folder: PathBuf,
    /// The file that would be written over.
    over: Option<PathBuf>,
    /// The file that is to be read and is not there.
    missing: Option<PathBuf>,
    /// The folder that is not there, and what went wrong with making it.
    no_folder: Option<(PathBuf, Option<String>)>,
}

#[derive(Clone)]
struct Entry {
    name: String,
    is_folder: bool,
}

impl FileDialog {
    /// A dialog that begins at a path: a file, or a folder.
    pub(crate) fn new(purpose: Purpose, start: PathBuf) -> Self {
        let mut text = start.display().to_string();
        if start.is_dir() && !text.ends_with(std::path::MAIN_SEPARATOR) {
            text.push(std::path::MAIN_SEPARATOR);
        }
        Self {
            purpose,
            note: None,
            text,
            listed: None,
            native: None,
            asked: false,
            fresh: true,
            folder: if start.is_dir() {
                start
            } else {
                start.parent().map_or_else(PathBuf::new, Path::to_owned)
            },
            over: None,
            missing: None,
            no_folder: None,
        }
    }

    /// The same, which says this first.
    #[must_use]
    pub(crate) fn with_note(mut self, note: impl Into<String>) -> Self {
        self.note = Some(note.into());
        self
    }

    pub(crate) fn purpose(&self) -> Purpose {
        self.purpose
    }

    pub(crate) fn show(&mut self, ui: &mut Ui, desk: &Desk) -> Answer {
        if !self.asked {
            self.asked = true;
            if desk.native_dialogs && has_desktop_dialogs() {
                self.ask_desktop(ui);
            }
        }
        if let Some(work) = &self.native {
            match work.now() {
                Now::Came(Some(path)) => return Answer::Path(path),
                Now::Came(None) | Now::Over => self.native = None, // cancelled, or there is none after all
                Now::Going => {}
            }
        }
        self.form(ui, desk)
    }

    fn form(&mut self, ui: &mut Ui, desk: &Desk) -> Answer {
        let palette = Palette::of(ui);
        ui.set_width(520.0);
        ui.heading(self.purpose.title());
        if let Some(note) = &self.note {
            ui.add(egui::Label::new(note).wrap());
        }
        let mut answer = Answer::None;
        if self.purpose == Purpose::Open && !desk.settings.recent.is_empty() {
            super::widgets::caption(ui, "Recent");
            for (path, name) in recent(desk).into_iter().take(6) {
                if ui
                    .selectable_label(false, name)
                    .on_hover_text(format!("Opens {}.", path.display()))
                    .clicked()
                {
                    answer = Answer::Path(path.clone());
                }
            }
        }
        super::widgets::caption(ui, "Path");
        let field = ui
            .add(TextEdit::singleline(&mut self.text).desired_width(f32::INFINITY))
            .accessible_name("Path")
            .on_hover_text("The file's path, whole or from the folder above.");
        // While a dialog is only measured, nothing in it takes the focus.
        if self.fresh && !ui.is_sizing_pass() {
            self.fresh = false;
            field.request_focus();
            super::widgets::select_all(ui, field.id, &self.text);
        }
        if field.changed() {
            (self.over, self.missing, self.no_folder) = (None, None, None);
        }
        let entered = field.lost_focus() && ui.input(|i| i.key_pressed(Key::Enter));
        if entered {
            field.request_focus(); // where there is something to say first, the name may be mended
        }
        self.list(ui);
        let warn = |ui: &mut Ui, text: String| {
            ui.add(egui::Label::new(RichText::new(text).color(palette.warning)).wrap());
        };
        if let Some(missing) = &self.missing {
            warn(ui, format!("There is no file {}.", missing.display()));
        }
        if let Some(over) = &self.over {
            warn(ui, format!("{} is there already.", over.display()));
            // A button of its own: an Enter too many must not cost a file.
            let replace = ui.button("Replace it");
            if replace.on_hover_text("Writes over that file.").clicked() {
                answer = Answer::Path(over.clone());
            }
        }
        if self.offer_folder(ui) {
            answer = self.accept();
        }
        ui.add_space(6.0);
        ui.horizontal(|ui| {
            let accept = super::dialogs::default_button(ui, self.purpose.button());
            let accept = accept.on_hover_text("Takes the path above (Enter).");
            if accept.clicked() || entered {
                answer = self.accept();
            }
            if has_desktop_dialogs()
                && ui
                    .button("Browse\u{2026}")
                    .on_hover_text("Asks the desktop.")
                    .clicked()
            {
                self.ask_desktop(ui);
            }
            let cancel = ui.button("Cancel");
            if cancel
                .on_hover_text("Leaves everything as it is (Escape).")
                .clicked()
            {
                answer = Answer::Close;
            }
        });
        answer
    }

    /// Says that the folder is not there, and makes it where that is wanted; `true` once it is made.
    fn offer_folder(&mut self, ui: &mut Ui) -> bool {
        let Some((folder, failed)) = &mut self.no_folder else {
            return false;
        };
        let palette = Palette::of(ui);
        let text = format!("The folder {} is not there.", folder.display());
        ui.add(egui::Label::new(RichText::new(text).color(palette.warning)).wrap());
        let make = format!("Make it and {}", self.purpose.button().to_lowercase());
        let make = ui.button(make);
        let tip = "Makes it, and those above it that are missing.";
        if make.on_hover_text(tip).clicked() {
            match anisomap::generate::make_folder(folder) {
                Ok(()) => {
                    self.no_folder = None;
                    self.listed = None;
                    return true;
                }
                Err(error) => *failed = Some(error.to_string()),
            }
        }
        if let Some(failed) = failed {
            ui.add(egui::Label::new(RichText::new(&*failed).color(palette.error)).wrap());
        }
        false
    }

    /// What lies in the folder of the path.
    fn list(&mut self, ui: &mut Ui) {
        let path = self.meant();
        let folder = if self.text.ends_with(std::path::MAIN_SEPARATOR) {
            path
        } else {
            path.parent().map_or(PathBuf::new(), Path::to_owned)
        };
        let folder = if folder.as_os_str().is_empty() {
            PathBuf::from(".")
        } else {
            folder
        };
        if self
            .listed
            .as_ref()
            .is_none_or(|(listed, _)| *listed != folder)
        {
            self.listed = Some((folder.clone(), entries(&folder, self.purpose.endings())));
        }
        let Some((_, entries)) = &self.listed else {
            return;
        };
        let mut chosen = None;
        egui::Frame::new()
            .fill(ui.visuals().extreme_bg_color)
            .corner_radius(4)
            .inner_margin(4)
            .show(ui, |ui| {
                egui::ScrollArea::vertical()
                    .auto_shrink(false)
                    .max_height(190.0)
                    .show(ui, |ui| {
                        if folder.parent().is_some()
                            && ui
                                .selectable_label(false, "..")
                                .on_hover_text("Goes to the folder above.")
                                .clicked()
                        {
                            chosen = Some("..".to_owned());
                        }
                        for entry in entries {
                            let text = if entry.is_folder {
                                format!("{}/", entry.name)
                            } else {
                                entry.name.clone()
                            };
                            let tip = if entry.is_folder {
                                "Goes into this folder."
                            } else {
                                "Puts this file's path into the field above."
                            };
                            let label = ui.selectable_label(false, text);
                            if label.on_hover_text(tip).clicked() {
                                chosen = Some(entry.name.clone());
                            }
                        }
                    });
            });
        if let Some(name) = chosen {
            self.choose(&folder, &name);
        }
    }

    fn choose(&mut self, folder: &Path, name: &str) {
        let folder = std::path::absolute(folder).unwrap_or_else(|_| folder.to_owned());
        let path = match name {
            ".." => folder.parent().map_or(folder.clone(), Path::to_owned),
            name => folder.join(name),
        };
        self.text = path.display().to_string();
        if path.is_dir() {
            self.text.push(std::path::MAIN_SEPARATOR);
        }
        self.over = None;
    }

    /// The path as it is meant: what begins with a slash in the middle was typed after the folder that stood there, and a name
    /// alone is one in the folder that the dialog began with.
    fn meant(&self) -> PathBuf {
        let text = self.text.trim();
        let again = text.rfind("//").filter(|_| cfg!(unix));
        self.folder.join(again.map_or(text, |at| &text[at + 1..]))
    }

    /// The path that was chosen, if nothing is to be said first: that a file would be written over, or is not there.
    fn accept(&mut self) -> Answer {
        if self.text.trim().is_empty() {
            return Answer::None;
        }
        let mut path = self.meant();
        if self.purpose.saves() {
            if path.is_dir() {
                return Answer::None;
            }
            if path.extension().is_none() {
                path.set_extension("toml");
            }
            let folder = path.parent().filter(|f| !f.as_os_str().is_empty());
            if let Some(folder) = folder.filter(|f| !f.exists()) {
                self.no_folder = Some((folder.to_owned(), None));
                return Answer::None;
            }
            if path.exists() {
                self.over = Some(path);
                return Answer::None;
            }
        } else if self.purpose != Purpose::ExportFolder && !split_path(&path).0.exists() {
            self.missing = Some(path);
            return Answer::None;
        }
        Answer::Path(path)
    }

    fn ask_desktop(&mut self, ui: &Ui) {
        let (purpose, start) = (self.purpose, PathBuf::from(&self.text));
        let work = move |_: &super::work::Reins, give: &dyn Fn(Option<PathBuf>) -> bool| {
            let mut dialog = rfd::FileDialog::new().set_title(purpose.title());
            let folder = if start.is_dir() {
                Some(start.as_path())
            } else {
                start.parent()
            };
            if let Some(folder) = folder.filter(|f| f.is_dir()) {
                dialog = dialog.set_directory(folder);
            }
            if !purpose.endings().is_empty() {
                dialog = dialog.add_filter(purpose.title(), purpose.endings());
            }
            give(match purpose {
                Purpose::ExportFolder => dialog.pick_folder(),
                p if p.saves() => {
                    let name = start
                        .file_name()
                        .map_or("untitled.toml".into(), |n| n.to_string_lossy().into_owned());
                    dialog.set_file_name(name).save_file()
                }
                _ => dialog.pick_file(),
            });
        };
        self.native = Work::begin("file dialog", ui.ctx(), work).ok();
    }
}

/// Whether the desktop has dialogs of its own: without a bus or zenity asking would end at once, as if cancelled.
fn has_desktop_dialogs() -> bool {
    if cfg!(any(target_os = "windows", target_os = "macos")) {
        return true;
    }
    let in_path = |name: &str| {
        let path = std::env::var_os("PATH").unwrap_or_default();
        std::env::split_paths(&path).any(|p| p.join(name).is_file())
    };
    std::env::var_os("DBUS_SESSION_BUS_ADDRESS").is_some() || in_path("zenity")
}

/// Folders, then files with these endings; hidden ones left out.
fn entries(folder: &Path, endings: &[&str]) -> Vec<Entry> {
    let Ok(found) = std::fs::read_dir(folder) else {
        return Vec::new();
    };
    let mut entries: Vec<Entry> = found
        .flatten()
        .take(5000)
        .map(|e| Entry {
            name: e.file_name().to_string_lossy().into_owned(),
            is_folder: e.path().is_dir(),
        })
        .filter(|e| !e.name.starts_with('.'))
        .filter(|e| {
            e.is_folder
                || endings
                    .iter()
                    .any(|end| e.name.to_lowercase().ends_with(&format!(".{end}")))
        })
        .collect();
    entries.sort_by_key(|e| (!e.is_folder, e.name.to_lowercase()));
    entries
}
/// The files of late that are there, each with its name, and its folder's where another one is called so too.
pub(crate) fn recent(desk: &Desk) -> Vec<(&PathBuf, String)> {
    told_apart(desk.settings.recent.iter().filter(|p| p.exists()).collect())
}

fn told_apart(paths: Vec<&PathBuf>) -> Vec<(&PathBuf, String)> {
    let name = |path: &PathBuf| {
        let name = path.file_name().unwrap_or_default();
        name.to_string_lossy().into_owned()
    };
    let names: Vec<String> = paths.iter().map(|path| name(path)).collect();
    let alike = |name: &String| names.iter().filter(|n| *n == name).count() > 1;
    let told = |(path, name): (&&PathBuf, &String)| match path.parent() {
        Some(folder) if alike(name) => format!("{name} in {}", folder.display()),
        _ => name.clone(),
    };
    let told: Vec<String> = paths.iter().zip(&names).map(told).collect();
    paths.into_iter().zip(told).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn files_of_one_name_are_told_apart_by_their_folders() {
        let paths = ["/a/pot.toml", "/b/pot.toml", "/b/lid.toml"].map(PathBuf::from);
        let told = told_apart(paths.iter().collect());
        let names: Vec<&str> = told.iter().map(|(_, name)| name.as_str()).collect();
        assert_eq!(names, ["pot.toml in /a", "pot.toml in /b", "lid.toml"]);
    }
}
