//! Documents and their files: opened, saved, left for others.

use super::{App, PATIENCE};
use crate::gui::desk::{Desk, Large, LargeThing, Redraw, Wanted};
use crate::gui::dialogs::{Dialog, NewDocument, Then, Wish};
use crate::gui::export::ExportDialog;
use crate::gui::files::{FileDialog, Purpose};
use crate::gui::intake::{self, Intake, Part, Told};
use crate::gui::messages::{About, count};
use crate::gui::presets::PresetBrowser;
use crate::gui::work::{Now, Reins, Work};
use anisomap::Error;
use anisomap::recipe::{Image, RecipeFile, Source};
use anisomap::studio::action::Action;
use anisomap::studio::settings::Folders;
use anisomap::studio::{Copied, Options, Studio, bytes_free, document_warning};
use eframe::egui::{Context, Ui, ViewportCommand};
use std::path::{Path, PathBuf};
use std::time::Duration;

impl App {
    pub(super) fn perform_file(&mut self, ui: &Ui, action: Action) {
        let here = self.here();
        // What waited for a saving that was called off waits no more.
        self.after_saving = None;
        match action {
            Action::New => self.leave_for(ui.ctx(), Then::New),
            Action::Open => self.dialog = Some(Dialog::File(FileDialog::new(Purpose::Open, here))),
            Action::Presets => self.dialog = Some(Dialog::Presets(PresetBrowser::default())),
            Action::Save => match self.desk.studio.document().path().map(Path::to_owned) {
                Some(_) if self.desk.studio.document().is_read_only() => {
                    self.ask_where_to_save(Purpose::SaveAs);
                }
                Some(path) => self.save(ui.ctx(), &path),
                None => self.ask_where_to_save(Purpose::SaveAs),
            },
            Action::SaveAs => self.ask_where_to_save(Purpose::SaveAs),
            Action::Import => {
                self.dialog = Some(Dialog::File(self.asking(Purpose::Import, here)));
            }
            Action::LoadMesh => {
                self.dialog = Some(Dialog::File(self.asking(Purpose::Mesh, here)));
            }
            Action::Export => {
                self.dialog = Some(Dialog::Export(Box::new(ExportDialog::new(&self.desk))));
            }
            Action::ExportAgain => {
                let mut export = ExportDialog::new(&self.desk);
                // Where nothing was ever written, the dialog asks first.
                if self.desk.settings.export.folder.is_some() {
                    export.begin(ui, &mut self.desk);
                }
                self.dialog = Some(Dialog::Export(Box::new(export)));
            }
            Action::Quit => self.leave_for(ui.ctx(), Then::Quit),
            _ => {}
        }
    }

    /// The folder that dialogs begin in: the document's own, or where the user is.
    pub(super) fn here(&self) -> PathBuf {
        let own = self
            .desk
            .studio
            .document()
            .path()
            .and_then(Path::parent)
            .filter(|p| !p.as_os_str().is_empty());
        let recent = self
            .desk
            .settings
            .recent
            .first()
            .and_then(|p| p.parent())
            .filter(|p| p.is_dir());
        own.or(recent)
            .map(Path::to_owned)
            .or_else(|| std::env::current_dir().ok())
            .unwrap_or_default()
    }

    /// A dialog for a file that comes into the document; where that has no file yet it says so.
    fn asking(&self, purpose: Purpose, here: PathBuf) -> FileDialog {
        let dialog = FileDialog::new(purpose, here);
        match self.desk.studio.document().path() {
            Some(_) => dialog,
            None => dialog.with_note(
                "What a recipe reads lies beside it, and this one has no file yet: after this you are asked where it is to be.",
            ),
        }
    }

    pub(super) fn ask_where_to_save(&mut self, purpose: Purpose) {
        let document = self.desk.studio.document();
        if document.is_read_only() {
            self.dialog = Some(Dialog::Newer(document.ignored().to_vec()));
        } else {
            self.ask_for_name(purpose);
        }
    }

    pub(super) fn ask_for_name(&mut self, purpose: Purpose) {
        let document = self.desk.studio.document();
        // What is understood of a newer file goes beside it, never over it.
        let copy = |path: &Path| {
            let stem = path.file_stem().unwrap_or_default().to_string_lossy();
            path.with_file_name(format!("{stem}_copy.toml"))
        };
        let own = document.path().map(Path::to_owned);
        let own = own.map(|path| {
            if document.is_read_only() {
                copy(&path)
            } else {
                path
            }
        });
        let start = own.unwrap_or_else(|| {
            let title = document.title();
            let name = if title.is_empty() {
                "untitled".to_owned()
            } else {
                title
            };
            self.here()
                .join(format!("{}.toml", name.trim_end_matches(".toml")))
        });
        self.dialog = Some(Dialog::File(FileDialog::new(purpose, start)));
    }

    pub(crate) fn save(&mut self, ctx: &Context, path: &Path) {
        let document = self.desk.studio.document();
        if document.path() == Some(path) && document.changed_on_disk() {
            self.dialog = Some(Dialog::Changed(path.to_owned()));
            return;
        }
        self.save_over(ctx, path);
    }

    /// Saves, whatever the file holds; first copies what has to lie beside it, without keeping anybody waiting.
    fn save_over(&mut self, ctx: &Context, path: &Path) {
        if self.saving.is_some() {
            self.desk
                .messages
                .news("What the recipe reads is still being copied: save again when that is done");
            return;
        }
        let Some(order) = self.desk.studio.copies_for(path) else {
            return self.finish_saving(ctx, path, None);
        };
        let copy = move |reins: &Reins, give: &dyn Fn(Result<Copied, Error>) -> bool| {
            give(order.carry_out(&|| reins.go_on()));
        };
        let begun = Work::begin("copy", ctx, copy);
        self.saving = self.desk.told(begun).map(|work| (path.to_owned(), work));
    }

    /// Saves once what has to lie beside the recipe was copied.
    pub(super) fn follow_saving(&mut self, ctx: &Context) {
        let Some((path, work)) = &self.saving else {
            return;
        };
        let copied = match work.now() {
            Now::Going => {
                ctx.request_repaint_after(Duration::from_millis(80));
                self.desk.reading = Some("copying what the recipe reads".to_owned());
                return;
            }
            Now::Came(copied) => copied,
            Now::Over => Err(Error::file(path, "copying what it needs ended too early")),
        };
        let path = path.clone();
        self.saving = None;
        self.desk.reading = None;
        match copied {
            Ok(copied) => self.finish_saving(ctx, &path, Some(copied)),
            Err(error) => {
                self.after_saving = None;
                self.desk.messages.error_about(About::Saving, error);
            }
        }
    }

    fn finish_saving(&mut self, ctx: &Context, path: &Path, copied: Option<Copied>) {
        if let Err(error) = self.desk.studio.save_after(path, copied) {
            self.after_saving = None;
            self.desk.messages.error_about(About::Saving, error);
            return;
        }
        self.desk.messages.retain_about(About::Saving, |_| false);
        self.watch.look_after(Some(path), ctx);
        let brought = self.desk.studio.document().brought();
        let names: Vec<&str> = brought.values().map(String::as_str).collect();
        let with = match names[..] {
            [] => String::new(),
            _ => format!(
                ", with copies of what it needs beside it: {}",
                names.join(", ")
            ),
        };
        self.desk
            .messages
            .news(format!("Saved {}{with}", path.display()));
        self.desk.settings.remember(path);
        self.desk.save_settings();
        if let Some(then) = self.after_saving.take() {
            self.go(ctx, then);
        }
    }

    /// Does what takes the work at hand away, or asks first where it is not saved.
    pub(super) fn leave_for(&mut self, ctx: &Context, then: Then) {
        self.canvas.cancel(&mut self.desk);
        if self.saving.is_some() {
            self.after_saving = Some(then); // what it needs is being copied
        } else if self.desk.studio.document().is_changed() {
            self.dialog = Some(Dialog::Unsaved(then));
        } else {
            self.go(ctx, then);
        }
    }

    pub(super) fn grant(&mut self, ctx: &Context, wish: Wish) {
        match wish {
            Wish::Go(then) => self.go(ctx, then),
            Wish::Leave(then) => self.leave_for(ctx, then),
            Wish::SaveThen(then) => {
                self.after_saving = Some(then);
                match self.desk.studio.document().path().map(Path::to_owned) {
                    Some(path) => self.save(ctx, &path),
                    None => self.ask_where_to_save(Purpose::SaveThen),
                }
            }
            Wish::SaveOver(path) => self.save_over(ctx, &path),
            Wish::SaveElsewhere => self.ask_where_to_save(Purpose::SaveAs),
            Wish::SaveCopy => self.ask_for_name(Purpose::SaveAs),
            Wish::AddPreset(preset, without_ground) => {
                let label = format!("Add {}", preset.name.replace('_', " "));
                let added = preset.recipe().and_then(|file| {
                    let mut recipe = file.recipe().clone();
                    if without_ground && recipe.layers.len() > 1 {
                        recipe.layers.remove(0);
                    }
                    self.desk.studio.add_layers_of(&label, &recipe)
                });
                self.desk.told(added);
                self.desk.redraw = self.desk.redraw.or(Redraw::Sharp);
            }
            Wish::AllowOutside => self.desk.studio.allow_outside(),
            Wish::Import(told) if told.layer.is_some() => self.say_anew(*told),
            Wish::Import(told) => {
                if let Some(folder) = self.own_folder() {
                    let begun = Intake::begin_textures(*told, &folder, ctx);
                    self.intake = self.desk.told(begun);
                }
            }
            Wish::Chosen(purpose, path) => self.take_path(ctx, purpose, &path),
            Wish::Recover(left) => {
                let options = self.options();
                let recovered = Studio::recover(*left, options);
                if let Some((studio, changes)) = self.desk.told(recovered) {
                    self.show_studio(studio);
                    self.desk.messages.news(format!(
                        "{} recovered; save to keep it",
                        count(changes as usize, "change")
                    ));
                }
            }
            Wish::Begin(file) => self.begin(ctx, *file, None),
            Wish::Large(LargeThing::Document(file, path)) => self.show_file(ctx, *file, path),
            Wish::Large(LargeThing::Header(header)) => {
                let done = self.desk.studio.set_header("Document", *header);
                self.desk.told(done);
                self.desk.studio.seal();
            }
            Wish::Large(LargeThing::File(part, path)) => self.take_in_if(ctx, part, &path, true),
            Wish::EditKeys => self.edit_keys(),
        }
    }

    pub(super) fn take_path(&mut self, ctx: &Context, purpose: Purpose, path: &Path) {
        match purpose {
            Purpose::Open => self.open_path(ctx, path),
            Purpose::SaveAs | Purpose::SaveThen => self.save(ctx, path),
            Purpose::Import => self.take_in(ctx, Part::Map, path),
            Purpose::Mesh => self.take_in(ctx, Part::Mesh, path),
            Purpose::Find => {
                if let (Some(old), Some(folder)) = (self.finding.take(), self.own_folder()) {
                    let begun = Intake::begin_found(old, path, &folder, ctx);
                    self.intake = self.desk.told(begun);
                }
            }
            Purpose::ExportFolder => {}
        }
    }

    /// Opens the dialog that a panel asks for.
    pub(super) fn follow_wanted(&mut self, ctx: &Context) {
        let Some(wanted) = self.desk.wanted.take() else {
            return;
        };
        let Some(folder) = self.own_folder() else {
            return;
        };
        match wanted {
            Wanted::Find(name) => {
                let note = format!("{name} is missing: which file is to take its place?");
                let dialog = FileDialog::new(Purpose::Find, self.here()).with_note(note);
                self.dialog = Some(Dialog::File(dialog));
                self.finding = Some(name);
            }
            Wanted::Convention(at) => {
                let Some(layer) = self.desk.studio.recipe().layers.get(at) else {
                    return;
                };
                if let Source::Image(Image {
                    textures: Some(textures),
                    ..
                }) = &layer.source
                {
                    let (name, textures) = (layer.name().to_owned(), textures.clone());
                    let files = self.desk.studio.document().files();
                    let begun = Intake::begin_again(name, textures, (&folder, files), ctx);
                    self.intake = self.desk.told(begun);
                }
            }
        }
    }

    /// Takes over what was said anew of a layer's textures.
    fn say_anew(&mut self, told: Told) {
        let layers = &self.desk.studio.recipe().layers;
        let at = layers
            .iter()
            .position(|l| Some(l.name()) == told.layer.as_deref());
        let Some(at) = at else {
            let text = "The layer was taken away meanwhile: nothing is changed";
            return self.desk.messages.error(text);
        };
        let done = self.desk.studio.set_textures(at, told.textures);
        self.desk.told(done);
    }

    /// A recipe takes the place of the document, a map becomes a layer, a mesh is shown.
    pub(super) fn open_path(&mut self, ctx: &Context, path: &Path) {
        let is_recipe = path
            .extension()
            .is_some_and(|e| e.eq_ignore_ascii_case("toml"));
        match intake::part_of(path) {
            Some(part) => self.take_in(ctx, part, path),
            None if is_recipe => {
                let file = RecipeFile::read(path);
                if let Some(file) = self.desk.told(file) {
                    self.leave_for(ctx, Then::Open(Box::new(file), path.to_owned()));
                }
            }
            None => self.desk.messages.error(intake::unknown(path)),
        }
    }

    /// Does what had to wait.
    pub(super) fn go(&mut self, ctx: &Context, then: Then) {
        match then {
            Then::Quit => {
                self.may_close = true;
                ctx.send_viewport_cmd(ViewportCommand::Close);
            }
            Then::New => self.dialog = Some(Dialog::New(NewDocument::default())),
            Then::Preset(preset) => {
                let file = preset.recipe();
                if let Some(file) = self.desk.told(file) {
                    self.begin(ctx, file, None);
                }
            }
            Then::TakeIn(part, path) => self.take_in(ctx, part, &path),
            Then::Open(file, path) => {
                self.desk.settings.remember(&path);
                self.desk.save_settings();
                self.begin(ctx, *file, Some(path));
            }
        }
    }

    /// Opens the file of keys with what the system opens it with; writes it first where it is not there.
    pub(super) fn edit_keys(&mut self) {
        let Some(path) = self.desk.folders.as_ref().map(Folders::keymap) else {
            return;
        };
        if !path.exists() {
            let made = path.parent().map_or(Ok(()), |folder| {
                std::fs::create_dir_all(folder).map_err(Error::write(folder))
            });
            let written = made.and_then(|()| self.desk.keymap.save(&path));
            if self.desk.told(written).is_none() {
                return;
            }
        }
        let opener = if cfg!(target_os = "windows") {
            "explorer"
        } else if cfg!(target_os = "macos") {
            "open"
        } else {
            "xdg-open"
        };
        let opened = self.desk.native_dialogs
            && std::process::Command::new(opener)
                .arg(&path)
                .stderr(std::process::Stdio::null())
                .spawn()
                .is_ok();
        self.desk.messages.news(if opened {
            format!("Change {}: it is read when it is saved", path.display())
        } else {
            format!(
                "Open {} with a text editor: it is read when it is saved",
                path.display()
            )
        });
    }

    pub(super) fn options(&self) -> Options {
        Options {
            journals: self.desk.folders.as_ref().map(|f| f.recovery.clone()),
            undo_bytes: self.desk.settings.undo_bytes(),
            patience: PATIENCE,
        }
    }

    /// Shows a recipe; asks first where its map takes more memory than there is.
    pub(super) fn begin(&mut self, ctx: &Context, file: RecipeFile, path: Option<PathBuf>) {
        let files = file.files(false);
        if let Some(warning) = document_warning(file.recipe(), &files, bytes_free()) {
            let what = LargeThing::Document(Box::new(file), path);
            self.desk.large = Some(Large { warning, what });
            ctx.request_repaint();
        } else {
            self.show_file(ctx, file, path);
        }
    }

    pub(super) fn show_file(&mut self, ctx: &Context, file: RecipeFile, path: Option<PathBuf>) {
        self.watch.look_after(path.as_deref(), ctx);
        let studio = Studio::new(file, path, self.options());
        if let Some(studio) = self.desk.told(studio) {
            self.show_studio(studio);
            tell_read_only(&mut self.desk);
        }
    }

    /// Puts another document in the place of this one, whose changes are saved or not wanted.
    pub(super) fn show_studio(&mut self, studio: Studio) {
        let show = self.desk.studio.viewport().show();
        let size = self.desk.studio.viewport().size();
        let before = std::mem::replace(&mut self.desk.studio, studio);
        before.close();
        // What was on its way to the other document is none of this one's.
        self.intake = None;
        self.desk.reading = None;
        self.desk.exported.clear();
        self.desk.messages.forget_errors();
        self.saving = None;
        self.desk.ask_outside = true;
        self.finding = None;
        let viewport = self.desk.studio.viewport_mut();
        viewport.resize(size);
        viewport.set_show(show);
        self.canvas.forget();
        self.desk.redraw = Redraw::Sharp;
    }
}

/// Says of a recipe of a newer version that it can only be looked at, and what of it is not shown.
pub(super) fn tell_read_only(desk: &mut Desk) {
    let document = desk.studio.document();
    if !document.is_read_only() {
        return;
    }
    let ignored = match document.ignored() {
        [] => "Nothing of it is unknown".to_owned(),
        keys => format!(
            "What this version does not know is ignored: {}",
            keys.join(", ")
        ),
    };
    let text = format!(
        "{} is of a newer version: it can be looked at and exported, but not changed. {ignored}",
        document.title()
    );
    desk.messages.error(text);
}
