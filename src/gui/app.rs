//! The window: its layout, its menus, and what actions do.

mod actions;
mod arrivals;
mod documents;
mod layout;

use super::canvas::CanvasPane;
use super::desk::{Desk, Large, LargeThing, Redraw};
use super::dialogs::{self, Dialog, NewDocument, Then};
use super::intake::Intake;
use super::keys;
use super::layers::LayersPanel;
use super::properties::PropertiesPanel;
use super::theme;
use super::turns::Turns;
use super::viewport::ViewportPane;
use super::watch::{Watch, WatchAll};
use super::work::Work;
use anisomap::Error;
use anisomap::recipe::{self, RecipeFile};
use anisomap::studio::keymap::Keymap;
use anisomap::studio::settings::{Folders, Settings};
use anisomap::studio::{
    Copied, Options, Studio, bytes_free, document_warning, left_behind, welcome,
};
use documents::tell_read_only;
use eframe::egui::{self, Context, Ui, ViewportCommand};
use std::path::{Path, PathBuf};
use std::time::Duration;

/// How long the pen may be kept waiting for its layer, before its stroke is painted later.
const PATIENCE: Duration = Duration::from_millis(20);

/// The window.
pub(crate) struct App {
    pub(crate) desk: Desk,
    pub(crate) canvas: CanvasPane,
    viewport: ViewportPane,
    pub(crate) layers: LayersPanel,
    pub(crate) properties: PropertiesPanel,
    title: String,
    pub(crate) dialog: Option<Dialog>,
    dressed: bool,
    watch: Watch,
    watch_keys: Watch,
    /// The files that the recipe reads, and the document and revision that they were asked of.
    watch_files: WatchAll,
    watched: Option<(Option<PathBuf>, u64, bool)>,
    /// What is copied before the document is saved there.
    saving: Option<(PathBuf, Work<Result<Copied, Error>>)>,
    /// A file that is being taken in, and those that come after it.
    intake: Option<Intake>,
    waiting: Vec<PathBuf>,
    /// The document's file was changed, and is to be read again.
    to_reload: bool,
    /// Set once the work at hand is out of danger and the window may close.
    may_close: bool,
    /// What waits until the work was saved.
    after_saving: Option<Then>,
    /// The name of a file that another one is chosen for.
    finding: Option<String>,
    pub(crate) turns: Turns,
}

/// Opens the window with a recipe, or with the scene of the first start, and shows it until it is closed.
///
/// # Errors
/// When the recipe cannot be read, or no window can be opened.
pub(crate) fn run(word: Option<String>) -> Result<(), Error> {
    let folders = Folders::find();
    let (settings, trouble) = match &folders {
        Some(folders) => Settings::load(&folders.settings()),
        None => (Settings::default(), None),
    };
    let document = open(word.as_deref())?;
    let viewport = egui::ViewportBuilder::default()
        .with_title("anisomap")
        .with_app_id("anisomap")
        .with_inner_size(settings.window)
        .with_min_inner_size([860.0, 560.0])
        .with_drag_and_drop(true);
    let options = eframe::NativeOptions {
        viewport,
        ..Default::default()
    };
    let shown = eframe::run_native(
        "anisomap",
        options,
        Box::new(move |creation| {
            let mut app = App::new(document, settings, folders)?;
            app.dress(&creation.egui_ctx);
            if let Some(error) = trouble {
                app.desk.messages.error(error);
            }
            Ok(Box::new(app))
        }),
    );
    shown.map_err(|e| {
        let text = e.to_string();
        // Without the place in the library's source that some begin with.
        let after = text
            .split_once(".rs:")
            .and_then(|(_, rest)| rest.split_once(": "));
        let told = after.map_or(text.as_str(), |(_, told)| told);
        Error::machine("no window can be opened")(told.trim_end_matches('.'))
            .with_hint("Every other command works without one; `anisomap --help` lists them")
    })
}

/// A recipe's file and its place, from a preset's name or a path.
fn open(word: Option<&str>) -> Result<(RecipeFile, Option<PathBuf>), Error> {
    let Some(word) = word else {
        return Ok((welcome()?, None));
    };
    let file = recipe::open(word)?;
    let path = word.contains(['/', '\\', '.']).then(|| PathBuf::from(word));
    Ok((file, path))
}

impl App {
    pub(crate) fn new(
        (file, path): (RecipeFile, Option<PathBuf>),
        settings: Settings,
        folders: Option<Folders>,
    ) -> Result<Self, Error> {
        let options = Options {
            journals: folders.as_ref().map(|f| f.recovery.clone()),
            undo_bytes: settings.undo_bytes(),
            patience: PATIENCE,
        };
        let mut large = None;
        let files = file.files(false);
        let warning = document_warning(file.recipe(), &files, bytes_free());
        let (file, path) = if let Some(warning) = warning {
            let what = LargeThing::Document(Box::new(file), path);
            large = Some(Large { warning, what });
            (welcome()?, None)
        } else {
            (file, path)
        };
        let studio = Studio::new(file, path, options)?;
        let (keymap, trouble) = match folders.as_ref().map(Folders::keymap).filter(|p| p.exists()) {
            Some(path) => match Keymap::load(&path) {
                Ok(keymap) => (keymap, None),
                Err(error) => (Keymap::default(), Some(error)),
            },
            None => (Keymap::default(), None),
        };
        let mut desk = Desk::new(studio, settings, keymap, folders);
        desk.large = large;
        tell_read_only(&mut desk);
        if let Some(error) = trouble {
            desk.messages.error(error);
        }
        let dialog = desk.folders.as_ref().and_then(|folders| {
            let (left, troubles) = left_behind(&folders.recovery);
            for trouble in troubles {
                desk.messages.error(trouble);
            }
            (!left.is_empty()).then_some(Dialog::Recover(left))
        });
        desk.ask_outside = true;
        if let Some(path) = desk.studio.document().path().map(Path::to_owned) {
            desk.settings.remember(&path);
            desk.save_settings();
        }
        Ok(Self {
            desk,
            canvas: CanvasPane::default(),
            viewport: ViewportPane::default(),
            layers: LayersPanel::default(),
            properties: PropertiesPanel::default(),
            title: String::new(),
            dialog,
            may_close: false,
            dressed: false,
            watch: Watch::default(),
            watch_keys: Watch::default(),
            watch_files: WatchAll::default(),
            watched: None,
            saving: None,
            intake: None,
            waiting: Vec::new(),
            to_reload: false,
            after_saving: None,
            finding: None,
            turns: Turns::default(),
        })
    }

    /// Gives the window its colours and sizes.
    fn dress(&mut self, ctx: &Context) {
        theme::install(ctx);
        theme::choose(ctx, self.desk.settings.theme);
        ctx.set_zoom_factor(self.desk.settings.scale);
        // Ctrl with plus and minus are keys of the canvas.
        ctx.options_mut(|o| o.zoom_with_keyboard = false);
        self.dressed = true;
        self.watch
            .look_after(self.desk.studio.document().path(), ctx);
        let keys = self.desk.folders.as_ref().map(Folders::keymap);
        self.watch_keys.look_after(keys.as_deref(), ctx);
    }

    /// One frame of the window.
    pub(crate) fn frame(&mut self, ui: &mut Ui) {
        let ctx = ui.ctx().clone();
        if !self.dressed {
            self.dress(&ctx);
        }
        let had_focus = ctx.memory(|m| m.focused().is_some());
        self.desk.tick(&ctx);
        self.desk.adjust(&ctx);
        if self.dialog.is_none() {
            self.dialog = self.desk.large.take().map(Dialog::Large);
        }
        if self.dialog.is_none() && std::mem::take(&mut self.desk.ask_outside) {
            let files = self.desk.studio.outside_files();
            self.dialog = (!files.is_empty()).then_some(Dialog::Outside(files));
        }
        if self.dialog.is_none() {
            for action in keys::pressed(&ctx, &self.desk.keymap) {
                self.desk.ask(action);
            }
        }
        self.take_dropped(&ctx);
        self.follow_intake(&ctx);
        self.follow_file(&ctx);
        self.follow_files(&ctx);
        self.follow_saving(&ctx);
        self.follow_keys();
        self.menu_bar(ui);
        if self.desk.panels {
            self.panels(ui);
        }
        self.panes(ui);
        self.hint(ui);
        self.follow_wanted(&ctx);
        if let Some(wish) = dialogs::show(&ctx, &mut self.dialog, &mut self.desk) {
            self.grant(&ctx, wish);
            ctx.request_repaint();
        }
        self.desk.messages.show(&ctx);
        for action in self.desk.take_asked() {
            self.perform(ui, action);
            // What it changed was drawn already: once more, or it would show with the next event.
            ctx.request_repaint();
        }
        // Tab hides the panels where no control has the focus; it must not give it to one then.
        if !had_focus && ctx.input(|i| i.key_pressed(egui::Key::Tab)) {
            ctx.memory_mut(|m| {
                if let Some(id) = m.focused() {
                    m.surrender_focus(id);
                }
            });
        }
        self.ask_before_closing(&ctx);
        self.remember_size(&ctx);
        self.tell_title(&ctx);
        if self.desk.redraw != Redraw::Nothing || self.turns.waits() {
            ctx.request_repaint();
        }
    }

    fn tell_title(&mut self, ctx: &Context) {
        let document = self.desk.studio.document();
        let mark = if document.is_changed() { "*" } else { "" };
        let title = format!("{}{mark} \u{2013} anisomap", document.title());
        if title != self.title {
            ctx.send_viewport_cmd(ViewportCommand::Title(title.clone()));
            self.title = title;
        }
    }
}

impl App {
    /// Whether the window is about to close.
    #[cfg(test)]
    pub(crate) fn is_closing(&self) -> bool {
        self.may_close
    }

    /// Whether what a document needs is being copied before it is saved.
    #[cfg(test)]
    pub(crate) fn is_saving(&self) -> bool {
        self.saving.is_some()
    }

    /// The next window is as large as this one.
    fn remember_size(&mut self, ctx: &Context) {
        let (size, large) = ctx.input(|i| {
            let viewport = i.viewport();
            let large = viewport.maximized.unwrap_or(false) || viewport.fullscreen.unwrap_or(false);
            (viewport.inner_rect.map(|r| r.size()), large)
        });
        if let Some(size) = size.filter(|s| !large && s.x > 1.0 && s.y > 1.0) {
            self.desk.settings.window = (size * ctx.zoom_factor()).into();
        }
    }

    /// Holds the window open while work is not saved.
    fn ask_before_closing(&mut self, ctx: &Context) {
        if !ctx.input(|i| i.viewport().close_requested()) || self.may_close {
            return;
        }
        if self.saving.is_some() {
            ctx.send_viewport_cmd(ViewportCommand::CancelClose);
            self.after_saving = Some(Then::Quit);
        } else if self.desk.studio.document().is_changed() {
            ctx.send_viewport_cmd(ViewportCommand::CancelClose);
            self.dialog = Some(Dialog::Unsaved(Then::Quit));
        } else {
            self.may_close = true;
        }
    }
}

impl eframe::App for App {
    fn ui(&mut self, ui: &mut Ui, _frame: &mut eframe::Frame) {
        self.frame(ui);
    }

    fn raw_input_hook(&mut self, _ctx: &Context, input: &mut egui::RawInput) {
        self.turns.take(&mut input.events);
    }

    fn on_exit(&mut self, _gl: Option<&eframe::glow::Context>) {
        self.desk.save_settings();
        // Closed with leave: nothing is left to recover.
        if self.may_close
            && let Ok(empty) = NewDocument::empty_studio()
        {
            std::mem::replace(&mut self.desk.studio, empty).close();
        }
    }
}
