//! What comes from outside while the window is open: dropped files, those on their way in, files that other programs change.

use super::App;
use super::documents::tell_read_only;
use crate::gui::desk::{Large, LargeThing, Redraw};
use crate::gui::dialogs::{Dialog, Then};
use crate::gui::files::Purpose;
use crate::gui::import::ImportDialog;
use crate::gui::intake::{Intake, Part, Taken};
use crate::gui::viewport::set_mesh;
use crate::gui::widgets::overlay_text;
use anisomap::mesh;
use anisomap::recipe::{Layer, RecipeFile, Source};
use anisomap::studio::Header;
use anisomap::studio::keymap::Keymap;
use anisomap::studio::settings::Folders;
use eframe::egui::{self, Context, Id};
use std::path::{Path, PathBuf};
use std::time::Duration;

impl App {
    pub(super) fn take_dropped(&mut self, ctx: &Context) {
        let dropped = ctx.input(|i| i.raw.dropped_files.clone());
        self.waiting
            .extend(dropped.iter().map(|f| f.path().to_owned()));
        // One after the other: each may ask, or take its time.
        if self.intake.is_none() && self.dialog.is_none() && !self.waiting.is_empty() {
            let path = self.waiting.remove(0);
            self.open_path(ctx, &path);
            ctx.request_repaint();
        }
        if ctx.input(|i| !i.raw.hovered_files.is_empty()) {
            let painter = ctx.layer_painter(egui::LayerId::new(
                egui::Order::Foreground,
                Id::unique("drop"),
            ));
            let at = self.canvas.rect.center();
            let text = "drop it: recipes open, maps become a layer, meshes show the map";
            overlay_text(&painter, at, egui::Align2::CENTER_CENTER, text);
        }
    }

    /// A mesh or a map from a file. It lies beside the recipe from then on: a recipe without a file is saved first.
    pub(crate) fn take_in(&mut self, ctx: &Context, part: Part, path: &Path) {
        self.take_in_if(ctx, part, path, false);
    }

    /// The same, even a mesh that takes much memory where that is wanted.
    pub(super) fn take_in_if(
        &mut self,
        ctx: &Context,
        part: Part,
        path: &Path,
        even_if_large: bool,
    ) {
        if self.desk.studio.document().is_read_only() {
            tell_read_only(&mut self.desk);
            return;
        }
        let Some(folder) = self.own_folder() else {
            self.after_saving = Some(Then::TakeIn(part, path.to_owned()));
            self.ask_where_to_save(Purpose::SaveThen);
            let name = path.file_name().unwrap_or_default().to_string_lossy();
            if let Some(Dialog::File(file)) = self.dialog.take() {
                let note = format!(
                    "{name} will lie beside the recipe, which has no file yet: where is the recipe to be? {name} comes in then."
                );
                self.dialog = Some(Dialog::File(file.with_note(note)));
            }
            return;
        };
        let begun = Intake::begin(part, path, &folder, even_if_large, ctx);
        self.intake = self.desk.told(begun);
    }

    /// The folder of the document's file, if it has one.
    pub(super) fn own_folder(&self) -> Option<PathBuf> {
        let folder = self.desk.studio.document().path()?.parent()?;
        let here = folder.as_os_str().is_empty();
        Some(if here { ".".into() } else { folder.to_owned() })
    }

    /// Gives a document that was begun for a mesh the aspect of that, as long as nothing is painted; any other is told how.
    fn follow_aspect(&mut self, file: &str, aspect: f32, is_first: bool) {
        let studio = &mut self.desk.studio;
        let recipe = studio.recipe();
        let now = recipe.aspect_at(recipe.size);
        if (now / aspect - 1.0).abs() <= 0.01 {
            return;
        }
        let is_painted = recipe.layers.iter().any(|l| {
            let of = |mask| l.strokes(mask).is_some_and(|s| !s.strokes.is_empty());
            of(false) || of(true)
        });
        if is_first && recipe.aspect.is_none() && !is_painted {
            let header = Header {
                aspect: Some(aspect),
                ..Header::of(recipe)
            };
            let set = studio.set_header("Aspect of the mesh", header);
            self.desk.told(set);
        } else {
            let text = format!(
                "Width over height is {aspect} on {file}, {now} on the map: Document has a button that gives the map the mesh's, so that strokes keep their shape"
            );
            self.desk.messages.news(text);
        }
    }

    /// Whether a file is on its way.
    #[cfg(test)]
    pub(crate) fn is_reading(&self) -> bool {
        self.intake.is_some() || (!self.waiting.is_empty() && self.dialog.is_none())
    }

    /// Takes over the file that was read in the background.
    pub(super) fn follow_intake(&mut self, ctx: &Context) {
        let Some(intake) = &self.intake else { return };
        if self.dialog.is_some() {
            return; // what came may have to ask, too
        }
        let Some(taken) = intake.now() else {
            ctx.request_repaint_after(Duration::from_millis(80));
            let name = intake.path.file_name().unwrap_or_default();
            self.desk.reading = Some(format!("reading {}", name.to_string_lossy()));
            return;
        };
        let (path, part) = (intake.path.clone(), intake.part);
        let is_here = self.own_folder() == Some(intake.folder.clone());
        self.intake = None;
        self.desk.reading = None;
        if !is_here {
            let name = path.file_name().unwrap_or_default().to_string_lossy();
            let text = format!(
                "{name} came in beside the recipe where that was before: take it in once more"
            );
            return self.desk.messages.error(text);
        }
        let Some((taken, news)) = self.desk.told(taken) else {
            return;
        };
        for news in news {
            self.desk.messages.news(news);
        }
        match taken {
            Taken::Mesh { file, body } => {
                let aspect = (body.mesh().aspect * 1000.0).round() / 1000.0;
                let is_first = self.desk.studio.recipe().mesh.is_none();
                self.desk.studio.know_mesh(&file, body);
                set_mesh(&mut self.desk, &file);
                self.follow_aspect(&file, aspect, is_first);
            }
            Taken::NoUvs => self.dialog = Some(Dialog::NoUvs(path)),
            Taken::Found { old, new } => {
                let done = self.desk.studio.replace_file(&old, &new);
                self.desk.told(done);
            }
            Taken::Large(warning) => {
                let what = LargeThing::File(part, path);
                self.dialog = Some(Dialog::Large(Large { warning, what }));
            }
            Taken::Textures(seen) => {
                self.dialog = Some(Dialog::Import(Box::new(ImportDialog::new(seen))));
            }
            Taken::Layer { name, image } => {
                let layer = Layer {
                    name,
                    ..Layer::new(Source::Image(*image))
                };
                let added = self.desk.studio.add_layer(layer);
                self.desk.told(added);
            }
        }
        ctx.request_repaint();
    }

    /// Shows what another program made of the document's file, unless there is work that the file does not have.
    pub(super) fn follow_file(&mut self, ctx: &Context) {
        self.to_reload |= self.watch.changed();
        // A stroke in flight is ended first.
        if !self.to_reload || self.desk.studio.is_drawing() {
            return;
        }
        self.to_reload = false;
        let document = self.desk.studio.document();
        let Some(path) = document.path().map(Path::to_owned) else {
            return;
        };
        if document.is_read_only() {
            // Nothing was done to it here: it is shown as it is now.
            let file = RecipeFile::read(&path);
            if let Some(file) = self.desk.told(file) {
                self.begin(ctx, file, Some(path));
            }
            return;
        }
        if document.is_changed() {
            let text = format!(
                "{} was changed by another program. Your work is as it was; save it under another name, or open the file again",
                path.display()
            );
            self.desk.messages.error(text);
            return;
        }
        let file = RecipeFile::read(&path);
        let Some(file) = self.desk.told(file) else {
            return;
        };
        let taken = self.desk.studio.reload(file);
        if self.desk.told(taken) == Some(true) {
            self.desk.redraw = self.desk.redraw.or(Redraw::Sharp);
            // It may name other files than it did.
            self.desk.ask_outside = true;
            self.desk
                .messages
                .news("The file was changed by another program, and read again");
        }
    }

    /// Shows what other programs made of the files that the recipe reads.
    pub(super) fn follow_files(&mut self, ctx: &Context) {
        let document = self.desk.studio.document();
        let path = document.path().map(Path::to_owned);
        let is_allowed = document.files().allow_outside;
        let now = Some((path, document.revision(), is_allowed));
        if self.watched != now {
            self.watched = now;
            let files = self.desk.studio.files_to_watch();
            self.watch_files.look_after(files, ctx);
        }
        if self.watch_files.changed() {
            self.desk.studio.read_files_again();
            // One that names others may name new ones.
            self.watched = None;
            self.desk.redraw = self.desk.redraw.or(Redraw::Sharp);
            // Of one that is gone the layer tells; a .gltf may well have no buffers beside it.
            let watched = self.desk.studio.files_to_watch();
            let buffers: Vec<PathBuf> = watched
                .iter()
                .flat_map(|path| mesh::buffers_of(path))
                .collect();
            let mut named = watched.iter().filter(|path| !buffers.contains(path));
            if named.all(|path| path.exists()) {
                let text = "A file of the recipe was changed by another program, and read again";
                self.desk.messages.news(text);
            }
        }
    }

    /// Takes the keys that the user gave their file.
    pub(super) fn follow_keys(&mut self) {
        if !self.watch_keys.changed() {
            return;
        }
        let Some(path) = self.desk.folders.as_ref().map(Folders::keymap) else {
            return;
        };
        let keymap = Keymap::load(&path);
        if let Some(keymap) = self.desk.told(keymap)
            && keymap != self.desk.keymap
        {
            self.desk.keymap = keymap;
            self.desk.messages.news("The keys were read again");
        }
    }
}
