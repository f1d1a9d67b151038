//! The dialogs: files, unsaved work, recovered work, a new document, settings. One is open at a time.

use super::desk::{Desk, Large, LargeThing};
use super::export::{ExportDialog, Wish as ExportWish};
use super::files::{FileDialog, Purpose};
use super::help::Help;
use super::import::{ImportDialog, Wish as ImportWish};
use super::intake::{Part, Told};
use super::messages::count;
use super::presets::{PresetBrowser, Wish as PresetWish};
use super::properties::memory;
use super::theme::{self, Palette};
use super::tools::tips;
use super::widgets::{Bar, caption, choices};
use anisomap::Error;
use anisomap::map::Size;
use anisomap::mesh::Projection;
use anisomap::recipe::{Preset, Recipe, RecipeFile};
use anisomap::studio::action::Action;
use anisomap::studio::orbit;
use anisomap::studio::settings::Theme;
use anisomap::studio::{LeftBehind, Options, Studio};
use eframe::egui::{self, Context, Id, Modal, RichText, Ui};
use std::path::{Path, PathBuf};

/// What is done once the work at hand is out of danger.
#[derive(Clone, Debug)]
pub(crate) enum Then {
    /// The window closes.
    Quit,
    /// Another document takes its place, which was read already.
    Open(Box<RecipeFile>, PathBuf),
    /// A preset takes its place.
    Preset(&'static Preset),
    /// An empty document takes its place.
    New,
    /// A mesh or a map comes into the document, which has a folder now.
    TakeIn(Part, PathBuf),
}

/// The dialog that is open.
pub(crate) enum Dialog {
    File(FileDialog),
    Export(Box<ExportDialog>),
    /// The folder of an export is being chosen; the export waits.
    ExportFolder(Box<ExportDialog>, FileDialog),
    Unsaved(Then),
    /// The document's file says something else than when it was read or saved.
    Changed(PathBuf),
    /// The document is of a newer version; what of it would not be saved.
    Newer(Vec<String>),
    Recover(Vec<LeftBehind>),
    New(NewDocument),
    Settings,
    Presets(PresetBrowser),
    /// What textures mean is being said.
    Import(Box<ImportDialog>),
    Shortcuts(Help),
    Large(Large),
    /// A mesh has no texture coordinates.
    NoUvs(PathBuf),
    /// The recipe names files outside its folder.
    Outside(Vec<String>),
}

/// What a dialog asks the window to do.
pub(crate) enum Wish {
    /// Saves, and then goes on.
    SaveThen(Then),
    /// Saves over what another program wrote.
    SaveOver(PathBuf),
    /// Asks for another name to save under.
    SaveElsewhere,
    /// Asks for a name for what is understood of a newer file.
    SaveCopy,
    /// Goes on without saving.
    Go(Then),
    /// Goes on, or asks first where work is not saved.
    Leave(Then),
    /// A preset's layers come into the document, without the lowest one where so wanted.
    AddPreset(&'static Preset, bool),
    /// Textures come in, now that it is said what they mean.
    Import(Box<Told>),
    /// A path was chosen.
    Chosen(Purpose, PathBuf),
    /// A journal's work is taken up.
    Recover(Box<LeftBehind>),
    /// A document is begun.
    Begin(Box<RecipeFile>),
    /// What is large is made all the same.
    Large(LargeThing),
    /// The document may read files outside its folder.
    AllowOutside,
    /// The file of keys is opened with what the system opens it with.
    EditKeys,
}

/// What a new document is to be.
#[derive(PartialEq)]
pub(crate) struct NewDocument {
    side: u32,
    aspect: f64,
    /// Of the built-in ones; past them one of the user's own, asked for next.
    mesh: usize,
}

impl Default for NewDocument {
    fn default() -> Self {
        Self {
            side: 1024,
            aspect: aspect_of(0),
            mesh: 0,
        }
    }
}

impl Dialog {
    /// A name for the part of the screen it has.
    fn id(&self) -> &'static str {
        match self {
            Self::File(_) | Self::ExportFolder(..) => "file dialog",
            Self::Export(_) => "export dialog",
            Self::Unsaved(_) => "unsaved dialog",
            Self::Changed(_) => "changed dialog",
            Self::Newer(_) => "newer dialog",
            Self::Recover(_) => "recover dialog",
            Self::New(_) => "new dialog",
            Self::Settings => "settings dialog",
            Self::Presets(_) => "presets dialog",
            Self::Import(_) => "import dialog",
            Self::Shortcuts(_) => "shortcuts dialog",
            Self::Large(_) => "large dialog",
            Self::NoUvs(_) => "layout dialog",
            Self::Outside(_) => "outside dialog",
        }
    }

    /// Whether Escape closes it.
    fn may_close(&self) -> bool {
        match self {
            Self::Export(export) => !export.is_working(),
            Self::Recover(_) => false,
            _ => true,
        }
    }

    /// Whether a click beside it closes it: not where something was typed or chosen, or has to be answered.
    fn may_click_away(&self) -> bool {
        match self {
            Self::File(_) | Self::ExportFolder(..) | Self::Export(_) => false,
            Self::New(new) => *new == NewDocument::default(),
            Self::Presets(presets) => !presets.is_touched(),
            Self::Import(import) => !import.is_touched(),
            Self::Unsaved(_) | Self::Changed(_) | Self::Newer(_) => false,
            Self::Large(_) | Self::NoUvs(_) | Self::Outside(_) => false,
            Self::Recover(_) | Self::Settings | Self::Shortcuts(_) => true,
        }
    }
}

/// Around what a dialog shows, points.
const MARGIN: f32 = 18.0;

/// Shows the dialog that is open, if one is; gives what it asks for.
pub(crate) fn show(ctx: &Context, open: &mut Option<Dialog>, desk: &mut Desk) -> Option<Wish> {
    let mut dialog = open.take()?;
    let visuals = ctx.global_style().visuals.clone();
    let frame = egui::Frame::new()
        .fill(visuals.window_fill)
        .stroke(visuals.window_stroke)
        .corner_radius(visuals.window_corner_radius)
        .shadow(visuals.window_shadow)
        .inner_margin(MARGIN);
    let id = Id::unique(dialog.id());
    let modal = Modal::new(id).frame(frame);
    // Escape closes a list that is open in the dialog, and the dialog only when none is.
    let has_list = egui::Popup::is_any_open(ctx);
    // What a small window, or one with large text, has no room for is scrolled to.
    let room = ctx.content_rect().size() - egui::Vec2::splat(2.0 * MARGIN + 16.0);
    let wanted: egui::Vec2 = ctx.data(|d| d.get_temp(id)).unwrap_or_default();
    let scrolls = [wanted.x > room.x, wanted.y > room.y];
    let shown = modal.show(ctx, |ui| {
        ui.spacing_mut().item_spacing.y = 6.0;
        let (answer, size) = if scrolls.contains(&true) {
            let area = egui::ScrollArea::new(scrolls)
                .id_salt("dialog") // its own: a list inside would scroll with it otherwise
                .max_width(room.x)
                .max_height(room.y)
                .show(ui, |ui| contents(ui, &mut dialog, desk));
            (area.inner, area.content_size)
        } else {
            let whole = ui.scope(|ui| contents(ui, &mut dialog, desk));
            (whole.inner, whole.response.rect.size())
        };
        ui.ctx().data_mut(|d| d.insert_temp(id, size));
        answer
    });
    let (next, mut wish) = shown.inner;
    let closed = (shown.backdrop_response.clicked() && dialog.may_click_away())
        || (shown.is_top_modal && !has_list && ctx.input(|i| i.key_pressed(egui::Key::Escape)));
    *open = match next {
        Next::Stay if closed && matches!(dialog, Dialog::ExportFolder(..)) => {
            Some(back_to_export(dialog))
        }
        Next::Stay if closed && dialog.may_close() => None,
        Next::Stay => Some(dialog),
        Next::Close => None,
        Next::Other(build) => Some(build(dialog)),
        Next::Grant => {
            if let Dialog::Large(large) = dialog {
                wish = Some(Wish::Large(large.what));
            }
            None
        }
    };
    wish
}

/// What comes after a dialog.
enum Next {
    Stay,
    Close,
    Other(fn(Dialog) -> Dialog),
    /// What the dialog holds is done.
    Grant,
}

fn contents(ui: &mut Ui, dialog: &mut Dialog, desk: &mut Desk) -> (Next, Option<Wish>) {
    match dialog {
        Dialog::File(file) => match file.show(ui, desk) {
            super::files::Answer::None => (Next::Stay, None),
            super::files::Answer::Close => (Next::Close, None),
            super::files::Answer::Path(path) => {
                (Next::Close, Some(Wish::Chosen(file.purpose(), path)))
            }
        },
        Dialog::ExportFolder(export, file) => match file.show(ui, desk) {
            super::files::Answer::None => (Next::Stay, None),
            super::files::Answer::Close => (Next::Other(back_to_export), None),
            super::files::Answer::Path(path) => {
                export.folder = path.display().to_string();
                (Next::Other(back_to_export), None)
            }
        },
        Dialog::Export(export) => match export.show(ui, desk) {
            ExportWish::Stay => (Next::Stay, None),
            ExportWish::Close => (Next::Close, None),
            ExportWish::Browse => (Next::Other(on_to_folder), None),
        },
        Dialog::Unsaved(then) => unsaved(ui, desk, then),
        Dialog::Changed(path) => changed_on_disk(ui, path),
        Dialog::Newer(ignored) => newer(ui, ignored),
        Dialog::Recover(left) => recover(ui, left),
        Dialog::New(new) => new_document(ui, desk, new),
        Dialog::Settings => settings(ui, desk),
        Dialog::Large(large) => ask_for_room(ui, large),
        Dialog::Import(import) => match import.show(ui) {
            ImportWish::Stay => (Next::Stay, None),
            ImportWish::Close => (Next::Close, None),
            ImportWish::Import(told) => (Next::Close, Some(Wish::Import(told))),
        },
        Dialog::NoUvs(path) => no_uvs(ui, path),
        Dialog::Outside(files) => outside(ui, files),
        Dialog::Presets(browser) => match browser.show(ui) {
            PresetWish::Stay => (Next::Stay, None),
            PresetWish::Close => (Next::Close, None),
            PresetWish::Add(preset, without_ground) => {
                let wish = Wish::AddPreset(preset, without_ground);
                (Next::Close, Some(wish))
            }
            PresetWish::Open(preset) => (Next::Close, Some(Wish::Leave(Then::Preset(preset)))),
        },
        Dialog::Shortcuts(help) => {
            let next = if help.show(ui, desk) {
                Next::Close
            } else {
                Next::Stay
            };
            (next, None)
        }
    }
}

fn back_to_export(dialog: Dialog) -> Dialog {
    match dialog {
        Dialog::ExportFolder(export, _) => Dialog::Export(export),
        other => other,
    }
}

fn on_to_folder(dialog: Dialog) -> Dialog {
    match dialog {
        Dialog::Export(export) => {
            let file = FileDialog::new(Purpose::ExportFolder, PathBuf::from(&export.folder));
            Dialog::ExportFolder(export, file)
        }
        other => other,
    }
}

/// A button that stands out: what most people will want.
pub(crate) fn main_button(ui: &mut Ui, text: &str) -> egui::Response {
    let palette = Palette::of(ui);
    ui.add(egui::Button::new(RichText::new(text).color(palette.text)).fill(palette.accent_ground))
}

/// The same, and what Enter does as long as no other control has the keyboard.
pub(crate) fn default_button(ui: &mut Ui, text: &str) -> egui::Response {
    let button = main_button(ui, text);
    if ui.memory(|m| m.focused().is_none()) {
        button.request_focus();
    }
    button
}

fn cancel_button(ui: &mut Ui) -> egui::Response {
    ui.button("Cancel")
        .on_hover_text("Leaves everything as it is (Escape).")
}

fn changed_on_disk(ui: &mut Ui, path: &Path) -> (Next, Option<Wish>) {
    ui.set_width(380.0);
    ui.heading("The file was changed by another program");
    ui.label(format!(
        "{} is not as it was when it was read or saved here. Saving writes over that.",
        path.display()
    ));
    ui.add_space(8.0);
    let mut answer = (Next::Stay, None);
    ui.horizontal(|ui| {
        let elsewhere = main_button(ui, "Save under another name");
        let tip = "Asks for the name; the other program's file stays.";
        if elsewhere.on_hover_text(tip).clicked() {
            answer = (Next::Close, Some(Wish::SaveElsewhere));
        }
        let over = ui.button("Save over it");
        let tip = "What the other program wrote is lost.";
        if over.on_hover_text(tip).clicked() {
            answer = (Next::Close, Some(Wish::SaveOver(path.to_owned())));
        }
        if cancel_button(ui).clicked() {
            answer = (Next::Close, None);
        }
    });
    answer
}

/// Asks whether files may be read that lie outside the recipe's folder.
fn outside(ui: &mut Ui, files: &[String]) -> (Next, Option<Wish>) {
    ui.set_width(420.0);
    ui.heading("This recipe reads files outside its folder");
    egui::ScrollArea::vertical()
        .max_height(160.0)
        .auto_shrink([false, true])
        .show(ui, |ui| {
            for file in files {
                ui.add(egui::Label::new(file).wrap());
            }
        });
    ui.label(
        "A recipe from a stranger could make your own pictures part of a map that is passed on. Without these files their \
         layers are not shown. Saved into another folder, the recipe has copies of them.",
    );
    ui.add_space(8.0);
    let mut answer = (Next::Stay, None);
    ui.horizontal(|ui| {
        let allow = ui.button("Allow for this document");
        let tip = "Reads them for as long as the document is open.";
        if allow.on_hover_text(tip).clicked() {
            answer = (Next::Close, Some(Wish::AllowOutside));
        }
        let refuse = default_button(ui, "Do not read them");
        let tip = "Shows the document without them (Enter, Escape).";
        if refuse.on_hover_text(tip).clicked() {
            answer = (Next::Close, None);
        }
    });
    answer
}

/// What a mesh without texture coordinates may be given.
fn no_uvs(ui: &mut Ui, path: &Path) -> (Next, Option<Wish>) {
    ui.set_width(420.0);
    ui.heading("The mesh has no texture coordinates");
    ui.label(format!(
        "No map can lie on {} as it is. It can be looked at from six sides, and its parts laid beside each other on the map: \
         then all of it can be painted on, each place alone. The recipe calls it by the file's name with {} after it, and an \
         exported mesh carries the new coordinates.",
        path.display(),
        "#box"
    ));
    ui.add_space(8.0);
    let mut answer = (Next::Stay, None);
    ui.horizontal(|ui| {
        let lay = default_button(ui, "Project from six sides");
        let tip =
            "Gives the mesh a layout of its own: each side's parts beside each other (Enter).";
        if lay.on_hover_text(tip).clicked() {
            let file = path.to_string_lossy();
            let word = Projection::join(&file, Some(Projection::Box));
            let wish = Wish::Chosen(Purpose::Mesh, word.into());
            answer = (Next::Close, Some(wish));
        }
        let cancel = ui.button("Cancel");
        let tip = "Unwrap it in a modelling program for a layout of your own.";
        if cancel.on_hover_text(tip).clicked() {
            answer = (Next::Close, None);
        }
    });
    answer
}

fn newer(ui: &mut Ui, ignored: &[String]) -> (Next, Option<Wish>) {
    ui.set_width(420.0);
    ui.heading("The file is of a newer version");
    ui.label("It stays as it is. What this version understands of it can be saved under another name, and changed there.");
    let lost = match ignored {
        [] => "Its comments are lost by that.".to_owned(),
        keys => format!(
            "Lost by that are its comments, and what is not known here: {}.",
            keys.join(", ")
        ),
    };
    egui::ScrollArea::vertical()
        .max_height(200.0)
        .show(ui, |ui| {
            ui.add(egui::Label::new(lost).wrap());
        });
    ui.add_space(8.0);
    let mut answer = (Next::Stay, None);
    ui.horizontal(|ui| {
        let copy = main_button(ui, "Save a copy");
        let tip = "Under another name, in this version; this file stays as it is.";
        if copy.on_hover_text(tip).clicked() {
            answer = (Next::Close, Some(Wish::SaveCopy));
        }
        if cancel_button(ui).clicked() {
            answer = (Next::Close, None);
        }
    });
    answer
}

fn unsaved(ui: &mut Ui, desk: &Desk, then: &Then) -> (Next, Option<Wish>) {
    ui.set_width(380.0);
    let title = desk.studio.document().title();
    ui.heading(format!("Save the changes to {title}?"));
    ui.label("They are lost when they are not saved.");
    ui.add_space(8.0);
    let mut answer = (Next::Stay, None);
    ui.horizontal(|ui| {
        let save = default_button(ui, "Save");
        if save.on_hover_text("Saves, and goes on (Enter).").clicked() {
            answer = (Next::Close, Some(Wish::SaveThen(then.clone())));
        }
        let lose = ui.button("Do not save");
        let tip = "Goes on; the changes are lost.";
        if lose.on_hover_text(tip).clicked() {
            answer = (Next::Close, Some(Wish::Go(then.clone())));
        }
        if cancel_button(ui).clicked() {
            answer = (Next::Close, None);
        }
    });
    answer
}

fn recover(ui: &mut Ui, left: &mut Vec<LeftBehind>) -> (Next, Option<Wish>) {
    ui.set_width(460.0);
    ui.heading("Work was left behind");
    ui.label(
        "The studio did not end in the usual way. What was done until then can be taken up again.",
    );
    ui.add_space(4.0);
    let palette = Palette::of(ui);
    let (mut taken, mut discarded) = (None, None);
    for (i, one) in left.iter().enumerate() {
        ui.separator();
        ui.horizontal(|ui| {
            let when = one
                .time
                .and_then(|t| t.elapsed().ok())
                .map_or(String::new(), |t| format!(", {}", ago(t.as_secs())));
            let title = if one.base.title.is_empty() {
                "Unnamed"
            } else {
                &one.base.title
            };
            let changes = usize::try_from(one.changes()).unwrap_or(usize::MAX);
            let what = format!("{}{when}", count(changes, "change"));
            ui.with_layout(egui::Layout::right_to_left(egui::Align::Center), |ui| {
                if ui
                    .button("Discard")
                    .on_hover_text("Removes this work for good.")
                    .clicked()
                {
                    discarded = Some(i);
                }
                let recover = match i {
                    0 => default_button(ui, "Recover"),
                    _ => main_button(ui, "Recover"),
                };
                if recover
                    .on_hover_text("Opens this work; save it to keep it.")
                    .clicked()
                {
                    taken = Some(i);
                }
                ui.with_layout(egui::Layout::left_to_right(egui::Align::Center), |ui| {
                    // The name yields to what is said of it.
                    let font = egui::TextStyle::Body.resolve(ui.style());
                    let said = ui
                        .painter()
                        .layout_no_wrap(what.clone(), font, palette.text);
                    ui.set_max_width(ui.available_width());
                    let room = ui.available_width() - said.size().x - 16.0;
                    ui.scope(|ui| {
                        ui.set_max_width(room.max(60.0));
                        let name = egui::Label::new(RichText::new(title).strong()).truncate();
                        ui.add(name).on_hover_text(title);
                    });
                    ui.label(what);
                });
            });
        });
        if let Some(damage) = &one.damage {
            ui.add(egui::Label::new(RichText::new(damage).small()).wrap());
        }
    }
    if let Some(i) = taken {
        return (Next::Close, Some(Wish::Recover(Box::new(left.remove(i)))));
    }
    if let Some(i) = discarded {
        left.remove(i).discard();
    }
    ui.add_space(8.0);
    let later = ui
        .button("Later")
        .on_hover_text("Keeps it, and asks again at the next start.")
        .clicked();
    let next = if later || left.is_empty() {
        Next::Close
    } else {
        Next::Stay
    };
    (next, None)
}

/// How long ago something was.
fn ago(seconds: u64) -> String {
    match seconds {
        0..90 => "just now".to_owned(),
        90..5400 => format!("{} ago", count(seconds as usize / 60, "minute")),
        5400..129_600 => format!("{} ago", count((seconds as usize + 1800) / 3600, "hour")),
        _ => format!("{} ago", count(seconds as usize / 86_400, "day")),
    }
}

/// Asks before more is taken than the machine has to give.
fn ask_for_room(ui: &mut Ui, large: &Large) -> (Next, Option<Wish>) {
    ui.set_width(420.0);
    ui.heading("This takes much memory");
    ui.add(egui::Label::new(&large.warning).wrap());
    ui.label(match large.what {
        LargeThing::Document(..) => "The document at hand stays open when you cancel.",
        LargeThing::Header(_) => "The document keeps its size when you cancel.",
        LargeThing::File(Part::Mesh, _) => "The mesh that is shown stays when you cancel.",
        LargeThing::File(Part::Map, _) => "The layers stay as they are when you cancel.",
    });
    ui.add_space(8.0);
    let mut answer = (Next::Stay, None);
    ui.horizontal(|ui| {
        let cancel = main_button(ui, "Cancel");
        if cancel
            .on_hover_text("Leaves everything as it is (Escape).")
            .clicked()
        {
            answer = (Next::Close, None);
        }
        if ui
            .button("Make it anyway")
            .on_hover_text("What is open should be saved first.")
            .clicked()
        {
            answer = (Next::Grant, None);
        }
    });
    answer
}

fn new_document(ui: &mut Ui, desk: &mut Desk, new: &mut NewDocument) -> (Next, Option<Wish>) {
    ui.set_width(380.0);
    ui.heading("New document");
    caption(ui, "Width and height in texels");
    let sides = [512u32, 1024, 2048, 4096, 8192, 16384];
    let words: Vec<String> = sides.iter().map(u32::to_string).collect();
    let words: Vec<(&str, &str)> = words.iter().map(|word| (word.as_str(), "")).collect();
    let now = sides.iter().position(|s| *s == new.side).unwrap_or(1);
    if let Some(i) = choices(
        ui,
        ("Side", "Texels along both sides of the map."),
        &words,
        now,
    ) {
        new.side = sides[i];
    }
    if let Ok(file) = new.recipe() {
        let recipe = file.recipe();
        let text = format!(
            "{} texels, about {} while you work",
            recipe.size,
            memory(recipe, recipe.size)
        );
        ui.label(RichText::new(text).color(Palette::of(ui).weak));
    }
    caption(ui, "Mesh");
    let meshes = super::viewport::MESHES.map(super::properties::sentence);
    let mut words: Vec<(&str, &str)> = meshes.iter().map(|mesh| (mesh.as_str(), "")).collect();
    words.push(("Own\u{2026}", "A GLB, glTF or OBJ file, asked for next."));
    if let Some(i) = choices(
        ui,
        ("Mesh", "What the map is shown on, and painted on."),
        &words,
        new.mesh,
    ) {
        new.mesh = i;
        new.aspect = aspect_of(i);
    }
    if new.mesh >= meshes.len() {
        let text = "Asked for next: a GLB, glTF or OBJ file, whose width over height becomes the map's. It lies beside the recipe, which is saved before.";
        let text = RichText::new(text).small().color(Palette::of(ui).weak);
        ui.add(egui::Label::new(text).wrap());
    } else {
        let bar =
            Bar::new("Width over height on the mesh", 0.1..=10.0).default(aspect_of(new.mesh));
        bar.show(ui, &mut new.aspect).response.on_hover_text(
            "Of the surface, for one turn of UV: strokes keep their shape on the mesh. Follows the mesh; click to type.",
        );
    }
    ui.add_space(8.0);
    let mut answer = (Next::Stay, None);
    ui.horizontal(|ui| {
        let begin = default_button(ui, "Begin");
        if begin
            .on_hover_text("Begins the document (Enter).")
            .clicked()
        {
            let made = new.recipe();
            answer = match desk.told(made) {
                Some(file) => {
                    if new.mesh >= meshes.len() {
                        desk.ask(Action::LoadMesh);
                    }
                    (Next::Close, Some(Wish::Begin(Box::new(file))))
                }
                None => (Next::Stay, None),
            };
        }
        if cancel_button(ui).clicked() {
            answer = (Next::Close, None);
        }
    });
    answer
}

/// The surface's width over its height on a built-in mesh, to three digits; 1 for any other.
fn aspect_of(mesh: usize) -> f64 {
    let name = super::viewport::MESHES.get(mesh);
    let mesh = name.and_then(|name| anisomap::mesh::builtin(name));
    mesh.map_or(1.0, |m| f64::from((m.aspect * 1000.0).round()) / 1000.0)
}

impl NewDocument {
    /// A studio of nothing, to stand in for one that ends.
    pub(crate) fn empty_studio() -> Result<Studio, Error> {
        let recipe = Recipe {
            size: Size::new(1, 1)?,
            ..Recipe::default()
        };
        Studio::new(
            RecipeFile::new(recipe, "empty.toml")?,
            None,
            Options::default(),
        )
    }

    /// A plain satin ground with a paint layer on it.
    fn recipe(&self) -> Result<RecipeFile, Error> {
        use anisomap::paint::Strokes;
        use anisomap::recipe::{Layer, Source};
        use anisomap::studio::parameters::default_pattern;
        let ground = Layer {
            name: "ground".to_owned(),
            ..Layer::new(Source::Pattern(default_pattern("constant")?))
        };
        let paint = Layer {
            name: "paint".to_owned(),
            ..Layer::new(Source::Strokes(Strokes::default()))
        };
        let recipe = Recipe {
            name: "untitled".to_owned(),
            size: Size::new(self.side, self.side)?,
            // Texels are square in number, as engines like them, and on the surface what the mesh makes of them.
            aspect: Some(self.aspect as f32).filter(|a| *a != 1.0),
            mesh: super::viewport::MESHES
                .get(self.mesh)
                .map(|m| (*m).to_owned()),
            layers: vec![ground, paint],
            ..Recipe::default()
        };
        RecipeFile::new(recipe, "untitled.toml")
    }
}

fn settings(ui: &mut Ui, desk: &mut Desk) -> (Next, Option<Wish>) {
    ui.set_width(420.0);
    ui.heading("Settings");
    let before = desk.settings.clone();
    caption(ui, "Theme");
    let themes = [Theme::Dark, Theme::Light, Theme::System];
    let now = themes
        .iter()
        .position(|t| *t == desk.settings.theme)
        .unwrap_or(0);
    if let Some(i) = choices(
        ui,
        ("Theme", &tips(desk, "", &[Action::ToggleTheme])),
        &[
            ("Dark", "Light text on dark panels."),
            ("Light", "Dark text on light panels."),
            ("As the system", "Light or dark, as the system says."),
        ],
        now,
    ) {
        desk.settings.theme = themes[i];
        theme::choose(ui.ctx(), themes[i]);
    }
    caption(ui, "Size of text and controls");
    let scales = [0.8f32, 1.0, 1.25, 1.5, 2.0];
    let now = scales
        .iter()
        .position(|s| (s - desk.settings.scale).abs() < 0.05)
        .unwrap_or(usize::MAX);
    if let Some(i) = choices(
        ui,
        (
            "Scale",
            &tips(
                desk,
                "The size of text and controls.",
                &[Action::ScaleUp, Action::ScaleDown],
            ),
        ),
        &[
            ("80%", ""),
            ("100%", ""),
            ("125%", ""),
            ("150%", ""),
            ("200%", ""),
        ],
        now,
    ) {
        desk.settings.scale = scales[i];
        ui.ctx().set_zoom_factor(scales[i]);
    }
    caption(ui, "Camera in the 3D view");
    let presets = orbit::Preset::ALL;
    let now = presets
        .iter()
        .position(|p| *p == desk.settings.navigation)
        .unwrap_or(0);
    if let Some(i) = choices(
        ui,
        ("Camera", ""),
        &[
            (
                "Alt + buttons",
                "Alt and the left, middle and right button turn, move and zoom the 3D view.",
            ),
            (
                "Middle button",
                "The middle button alone, with Shift and with Ctrl turns, moves and zooms the 3D view.",
            ),
        ],
        now,
    ) {
        desk.settings.navigation = presets[i];
    }
    ui.label(
        RichText::new(desk.settings.navigation.name())
            .small()
            .color(Palette::of(ui).weak),
    );
    caption(ui, "Memory for undo");
    let mut mib = f64::from(desk.settings.undo_memory);
    let bar = Bar::new("At most", 16.0..=16384.0)
        .integer(true)
        .unit("MiB")
        .default(512.0)
        .show(ui, &mut mib);
    bar.response
        .accessible_name("Memory for undo")
        .on_hover_text("The oldest steps are forgotten beyond this.");
    desk.settings.undo_memory = mib as u32;
    if desk.settings.undo_memory != before.undo_memory {
        desk.studio.set_undo_bytes(desk.settings.undo_bytes());
    }
    caption(ui, "Keys");
    let mut wish = None;
    if let Some(path) = desk.folders.as_ref().map(|f| f.keymap()) {
        ui.horizontal(|ui| {
            if ui
                .button("Open the keys file")
                .on_hover_text(
                    "Opens the file with every action and its keys in a text editor. Saved, it is read at once.",
                )
                .clicked()
            {
                wish = Some(Wish::EditKeys);
            }
        });
        ui.add(
            egui::Label::new(
                RichText::new(path.display().to_string())
                    .small()
                    .color(Palette::of(ui).weak),
            )
            .wrap(),
        );
    }
    ui.add_space(8.0);
    let closed = main_button(ui, "Close")
        .on_hover_text("Closes the settings, which are kept (Escape).")
        .clicked();
    if desk.settings != before {
        desk.save_settings();
    }
    let next = if closed { Next::Close } else { Next::Stay };
    (next, wish)
}
