//! The window: its layout, its menus, and what actions do.

use super::canvas::{CanvasPane, Kind};
use super::desk::{Desk, Large, LargeThing, Panes, Redraw};
use super::dialogs::{self, Dialog, NewDocument, Then, Wish};
use super::export::ExportDialog;
use super::files::{FileDialog, Purpose};
use super::help::Help;
use super::icons::Icon;
use super::import::ImportDialog;
use super::intake::{self, Intake, Part, Taken};
use super::keys;
use super::layers::{LayersPanel, menu_item};
use super::messages::count;
use super::presets::PresetBrowser;
use super::properties::{Leaf, PropertiesPanel, too_large};
use super::theme::{self, Palette};
use super::viewport::{MESHES, ViewportPane, set_exposure, set_lights, set_mesh};
use super::watch::Watch;
use super::widgets::{icon_button, overlay_text};
use super::{guides, status, tools};
use anisomap::Error;
use anisomap::preview::Rig;
use anisomap::recipe::{self, Layer, RecipeFile, Source};
use anisomap::studio::action::{Action, Group};
use anisomap::studio::hand::{Mirror, ToolKind};
use anisomap::studio::keymap::Keymap;
use anisomap::studio::orbit;
use anisomap::studio::settings::{Folders, Settings, Theme};
use anisomap::studio::{Options, Studio, left_behind, welcome};
use eframe::egui::{
    self, CentralPanel, Context, CornerRadius, Frame, Id, Margin, Panel, Rect, Sense, Ui,
    ViewportCommand, pos2, vec2,
};
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
    /// A file that is being taken in, and those that come after it.
    intake: Option<Intake>,
    waiting: Vec<PathBuf>,
    /// The document's file was changed, and is to be read again.
    to_reload: bool,
    /// Set once the work at hand is out of danger and the window may close.
    may_close: bool,
    /// What waits until the work was saved.
    after_saving: Option<Then>,
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
        let (file, path) = if let Some(warning) = too_large(file.recipe(), file.recipe().size) {
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
            intake: None,
            waiting: Vec::new(),
            to_reload: false,
            after_saving: None,
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
        if self.dialog.is_none() {
            self.dialog = self.desk.large.take().map(Dialog::Large);
        }
        if self.dialog.is_none() {
            for action in keys::pressed(&ctx, &self.desk.keymap) {
                self.desk.ask(action);
            }
        }
        self.take_dropped(&ctx);
        self.follow_intake(&ctx);
        self.follow_file(&ctx);
        self.follow_keys();
        self.menu_bar(ui);
        if self.desk.panels {
            self.panels(ui);
        }
        self.panes(ui);
        self.hint(ui);
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
        if self.desk.redraw != Redraw::Nothing {
            ctx.request_repaint();
        }
    }

    fn menu_bar(&mut self, ui: &mut Ui) {
        let frame = Frame::new()
            .fill(Palette::of(ui).header)
            .inner_margin(Margin::symmetric(8, 3));
        Panel::top("menu")
            .frame(frame)
            .show_separator_line(false)
            .show(ui, |ui| {
                egui::MenuBar::new().ui(ui, |ui| {
                    let mut recent = None;
                    for (name, group) in [
                        ("File", Group::File),
                        ("Edit", Group::Edit),
                        ("Layer", Group::Layer),
                        ("View", Group::View),
                        ("3D view", Group::Viewport),
                        ("Window", Group::Window),
                    ] {
                        ui.menu_button(name, |ui| {
                            ui.set_min_width(230.0);
                            for action in Action::ALL.iter().filter(|a| a.group() == group) {
                                menu_item(ui, &mut self.desk, *action);
                                if *action == Action::Open {
                                    recent = recent.take().or(recent_menu(ui, &self.desk));
                                }
                            }
                        });
                    }
                    if let Some(path) = recent {
                        self.open_path(ui.ctx(), &path);
                    }
                    let palette = Palette::of(ui);
                    ui.with_layout(egui::Layout::right_to_left(egui::Align::Center), |ui| {
                        let document = self.desk.studio.document();
                        let mark = if document.is_read_only() {
                            " (only to look at)"
                        } else if document.is_changed() {
                            " \u{2022}"
                        } else {
                            ""
                        };
                        ui.label(
                            egui::RichText::new(format!("{}{mark}", document.title()))
                                .color(palette.weak),
                        );
                        ui.add_space(8.0);
                        ui.spacing_mut().item_spacing.x = 2.0;
                        let (undo, redo) = self.desk.studio.history().len();
                        for (icon, action, steps) in [
                            (Icon::Redo, Action::Redo, redo),
                            (Icon::Undo, Action::Undo, undo),
                        ] {
                            let tip = self.desk.tip(action);
                            ui.add_enabled_ui(steps > 0, |ui| {
                                let button = icon_button(ui, icon, action.name(), 22.0, false);
                                if button.on_hover_text(tip).clicked() {
                                    self.desk.ask(action);
                                }
                            });
                        }
                    });
                });
            });
    }

    fn panels(&mut self, ui: &mut Ui) {
        let palette = Palette::of(ui);
        let fill = ui.visuals().panel_fill;
        let bar = Frame::new()
            .fill(fill)
            .inner_margin(Margin::symmetric(12, 5));
        Panel::top("tool")
            .frame(bar)
            .show_separator_line(true)
            .show(ui, |ui| {
                ui.horizontal(|ui| tools::bar(ui, &mut self.desk));
            });
        let line = Frame::new()
            .fill(palette.header)
            .inner_margin(Margin::symmetric(12, 3));
        Panel::bottom("status")
            .frame(line)
            .show_separator_line(false)
            .show(ui, |ui| {
                ui.horizontal(|ui| {
                    status::show(
                        ui,
                        &self.desk,
                        self.canvas.zoom(),
                        self.canvas.probe.as_ref().or(self.viewport.probe.as_ref()),
                    );
                });
            });
        let plain = Frame::new().fill(fill);
        Panel::left("tools")
            .frame(plain)
            .resizable(false)
            .exact_size(theme::TOOLS)
            .show(ui, |ui| {
                tools::column(ui, &mut self.desk);
            });
        Panel::right("side")
            .frame(plain)
            .default_size(theme::SIDE)
            .size_range(240.0..=520.0)
            .show(ui, |ui| {
                ui.spacing_mut().item_spacing.y = 0.0;
                let room = ui.available_height();
                Panel::top("layers")
                    .frame(plain)
                    .resizable(true)
                    .default_size(room * 0.36)
                    .size_range(96.0..=(room - 140.0).max(120.0))
                    .show(ui, |ui| {
                        egui::ScrollArea::vertical()
                            .auto_shrink(false)
                            .show(ui, |ui| self.layers.show(ui, &mut self.desk));
                    });
                self.properties.show(ui, &mut self.desk);
            });
    }

    /// Canvas and 3D view, with a line between them that can be dragged.
    fn panes(&mut self, ui: &mut Ui) {
        let frame = Frame::new().fill(Palette::of(ui).line);
        CentralPanel::default().frame(frame).show(ui, |ui| {
            ui.spacing_mut().item_spacing = vec2(0.0, 0.0);
            let rect = ui.available_rect_before_wrap();
            match self.desk.panes {
                Panes::Canvas => self.canvas.show(ui, &mut self.desk),
                Panes::Viewport => self.viewport.show(ui, &mut self.desk),
                Panes::Both => {
                    let middle = self.divider(ui, rect);
                    let left = Rect::from_min_max(rect.min, pos2(middle - 2.0, rect.bottom()));
                    let right = Rect::from_min_max(pos2(middle + 2.0, rect.top()), rect.max);
                    let mut child =
                        ui.new_child(egui::UiBuilder::new().id_salt("canvas").max_rect(left));
                    child.set_clip_rect(left);
                    self.canvas.show(&mut child, &mut self.desk);
                    let mut child =
                        ui.new_child(egui::UiBuilder::new().id_salt("viewport").max_rect(right));
                    child.set_clip_rect(right);
                    self.viewport.show(&mut child, &mut self.desk);
                }
            }
        });
    }

    fn divider(&mut self, ui: &mut Ui, rect: Rect) -> f32 {
        let middle = (rect.left() + rect.width() * self.desk.split).round();
        let handle = Rect::from_x_y_ranges((middle - 4.0)..=(middle + 4.0), rect.y_range());
        let response = ui.interact(handle, Id::unique("divider"), Sense::drag());
        if response.dragged() {
            let moved = response.drag_delta().x / rect.width().max(1.0);
            self.desk.split = (self.desk.split + moved).clamp(0.2, 0.8);
        }
        if response.hovered() || response.dragged() {
            ui.ctx().set_cursor_icon(egui::CursorIcon::ResizeHorizontal);
            let line = Rect::from_x_y_ranges((middle - 2.0)..=(middle + 2.0), rect.y_range());
            ui.painter().rect_filled(
                line,
                CornerRadius::ZERO,
                Palette::of(ui).accent.gamma_multiply(0.6),
            );
        }
        middle
    }

    /// The line that explains the first scene, until it is closed.
    fn hint(&mut self, ui: &Ui) {
        // Over other views it would hide what they show.
        let in_place = self.canvas.kind == Kind::Lit && self.desk.panes != Panes::Viewport;
        if self.desk.settings.hint_closed || !in_place {
            return;
        }
        let keys = |a: Action| self.desk.keymap.keys_text(a);
        let thing = match self.desk.studio.mesh().name.as_str() {
            name if MESHES.contains(&name) => name,
            _ => "mesh",
        };
        let text = format!(
            "Drag over the map or the {thing} to brush it: the light follows the grooves. Turn the {thing} with {}, its light with Shift and the right button. {} lists all keys, {} has more surfaces.",
            if self.desk.settings.navigation == orbit::Preset::Alt {
                "Alt and a drag (or the middle button: Edit > Settings)"
            } else {
                "the middle button (or Alt and a drag: Edit > Settings)"
            },
            keys(Action::Shortcuts),
            keys(Action::Presets),
        );
        let at = self.canvas.rect.left_top() + vec2(12.0, 12.0);
        // The ball of the light is in the upper right corner.
        let width = (self.canvas.rect.width() - 150.0).clamp(200.0, 480.0);
        let area = egui::Area::new(Id::unique("hint"))
            .order(egui::Order::Middle)
            .pivot(egui::Align2::LEFT_TOP)
            .fixed_pos(at);
        area.show(ui.ctx(), |ui| {
            let palette = Palette::of(ui);
            let frame = Frame::new()
                .fill(ui.visuals().window_fill)
                .corner_radius(6)
                .inner_margin(Margin::symmetric(12, 8))
                .shadow(ui.visuals().popup_shadow);
            frame.show(ui, |ui| {
                ui.set_max_width(width);
                ui.horizontal_top(|ui| {
                    ui.scope(|ui| {
                        ui.set_max_width(width - 40.0);
                        ui.add(
                            egui::Label::new(egui::RichText::new(text).color(palette.text)).wrap(),
                        );
                    });
                    if icon_button(ui, Icon::Close, "Close hint", 20.0, false)
                        .on_hover_text("Closes the hint for good.")
                        .clicked()
                    {
                        self.desk.close_hint();
                    }
                });
            });
        });
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

    /// Does what an action says.
    pub(crate) fn perform(&mut self, ui: &Ui, action: Action) {
        let desk = &mut self.desk;
        if let Some(kind) = ToolKind::ALL.into_iter().find(|k| k.action() == action) {
            self.canvas.cancel(desk);
            desk.hand.take(kind);
            if kind == ToolKind::Guide {
                guides::find_layer(desk);
            }
            return;
        }
        if let Some(kind) = Kind::ALL.into_iter().find(|k| k.action() == action) {
            self.canvas.kind = kind;
            return;
        }
        match action.group() {
            Group::Brush => self.perform_brush(ui, action),
            Group::Layer => self.perform_layer(action),
            Group::View => self.perform_view(action),
            Group::Viewport => self.perform_viewport(action),
            Group::Window => self.perform_window(ui.ctx(), action),
            Group::Edit => self.perform_edit(action),
            Group::File => self.perform_file(ui, action),
            Group::Tool => {}
        }
    }

    fn perform_edit(&mut self, action: Action) {
        let desk = &mut self.desk;
        match action {
            Action::Undo | Action::Redo => {
                if self.canvas.cancel(desk) || self.viewport.cancel(desk) {
                    return; // the stroke in flight is what is taken back
                }
                let done = if action == Action::Undo {
                    desk.studio.undo()
                } else {
                    desk.studio.redo()
                };
                if desk.told(done) == Some(false) {
                    desk.messages
                        .news(format!("Nothing to {}", action.name().to_lowercase()));
                }
                desk.redraw = desk.redraw.or(Redraw::Sharp);
            }
            Action::Cancel => {
                let called_off = self.canvas.cancel(desk) || self.viewport.cancel(desk);
                // Where nothing is on its way it is the selection that is left.
                desk.guides.selected = desk.guides.selected.filter(|_| called_off);
            }
            Action::Settings => self.dialog = Some(Dialog::Settings),
            _ => {}
        }
    }

    fn perform_brush(&mut self, ui: &Ui, action: Action) {
        let hand = &mut self.desk.hand;
        match action {
            Action::SizeDown => hand.resize(-1.0),
            Action::SizeUp => hand.resize(1.0),
            Action::HardnessDown => hand.harden(-1.0),
            Action::HardnessUp => hand.harden(1.0),
            Action::FlowDown => hand.change_flow(-1.0),
            Action::FlowUp => hand.change_flow(1.0),
            Action::SwapAlphas => hand.swap_alphas(),
            Action::ToggleMirror => {
                hand.mirror = if hand.mirror == Mirror::Off {
                    Mirror::U
                } else {
                    Mirror::Off
                };
            }
            Action::ToggleRadial => hand.copies = if hand.copies >= 2 { 0 } else { 6 },
            Action::ToggleStabiliser => {
                hand.stabiliser = if hand.stabiliser > 0.0 { 0.0 } else { 0.4 }
            }
            Action::DragSize => self.canvas.begin_adjusting(ui, &self.desk, false),
            Action::DragFlow => self.canvas.begin_adjusting(ui, &self.desk, true),
            _ => {}
        }
    }

    fn perform_layer(&mut self, action: Action) {
        let desk = &mut self.desk;
        let at = desk.studio.selected();
        let count = desk.studio.recipe().layers.len();
        let done = match action {
            Action::NewPaintLayer => desk.studio.add_paint_layer(),
            Action::DuplicateLayer => desk.studio.duplicate_layer(at),
            Action::MergeDown => desk.studio.merge_down(at),
            Action::NewGuideLayer => {
                desk.hand.take(ToolKind::Guide);
                let layer = guides::layer(desk);
                desk.studio.add_layer(layer)
            }
            Action::DeleteLayer => {
                let mut hand = std::mem::take(&mut desk.guides);
                // With the guide tool in the hand it is the guide that is meant.
                let guide = desk.hand.kind() == ToolKind::Guide && hand.delete(desk);
                desk.guides = hand;
                if guide {
                    Ok(())
                } else {
                    desk.studio.remove_layer(at)
                }
            }
            Action::RaiseLayer if at + 1 < count => desk.studio.move_layer(at, at + 1),
            Action::LowerLayer if at > 0 => desk.studio.move_layer(at, at - 1),
            Action::RenameLayer => {
                self.layers.rename(desk);
                Ok(())
            }
            Action::SelectAbove => {
                desk.studio.select(at + 1);
                Ok(())
            }
            Action::SelectBelow => {
                desk.studio.select(at.saturating_sub(1));
                Ok(())
            }
            Action::ToggleLayer => {
                let shown = desk
                    .studio
                    .recipe()
                    .layers
                    .get(at)
                    .is_some_and(|l| l.visible);
                let label = if shown { "Hide layer" } else { "Show layer" };
                desk.edit_head(at, label, |h| h.visible = !h.visible);
                Ok(())
            }
            Action::SoloLayer => {
                desk.toggle_solo();
                Ok(())
            }
            _ => Ok(()),
        };
        desk.told(done);
        desk.redraw = desk.redraw.or(Redraw::Sharp);
    }

    fn perform_view(&mut self, action: Action) {
        match action {
            Action::CycleView => {
                let at = Kind::ALL
                    .iter()
                    .position(|k| *k == self.canvas.kind)
                    .unwrap_or(0);
                self.canvas.kind = Kind::ALL[(at + 1) % Kind::ALL.len()];
            }
            Action::ViewLit => self.canvas.kind = Kind::Lit,
            Action::ToggleWrap => self.canvas.wrap = !self.canvas.wrap,
            Action::CanvasFit => self.canvas.fit(),
            Action::ActualTexels => self.canvas.actual_texels(),
            Action::ZoomIn => self.canvas.zoom_by(1.25),
            Action::ZoomOut => self.canvas.zoom_by(0.8),
            _ => {}
        }
    }

    fn perform_viewport(&mut self, action: Action) {
        let desk = &mut self.desk;
        let exposure = desk.studio.scene().exposure;
        match action {
            Action::FrameAll => {
                desk.studio.frame_all();
                self.canvas.fit();
            }
            Action::NextMesh => {
                let at = MESHES
                    .iter()
                    .position(|m| *m == desk.studio.mesh().name)
                    .unwrap_or(MESHES.len() - 1);
                set_mesh(desk, MESHES[(at + 1) % MESHES.len()]);
            }
            Action::NextModel => self.viewport.next_model(desk),
            Action::Compare => self.viewport.toggle_compare(desk, false),
            Action::Difference => self.viewport.toggle_compare(desk, true),
            Action::ResetLight => set_lights(desk, Rig::Studio),
            Action::ExposureDown => set_exposure(desk, exposure - 1.0 / 3.0),
            Action::ExposureUp => set_exposure(desk, exposure + 1.0 / 3.0),
            _ => {}
        }
        desk.redraw = desk.redraw.or(Redraw::Sharp);
    }

    fn perform_window(&mut self, ctx: &Context, action: Action) {
        let desk = &mut self.desk;
        match action {
            Action::Shortcuts => self.dialog = Some(Dialog::Shortcuts(Help::default())),
            Action::ShowBoth => desk.panes = Panes::Both,
            Action::ShowCanvas => desk.panes = Panes::Canvas,
            Action::ShowViewport => desk.panes = Panes::Viewport,
            Action::FocusControls => {
                desk.panels = true;
                if let Some(id) = desk.first_control {
                    ctx.memory_mut(|m| m.request_focus(id));
                }
            }
            Action::TogglePanels => desk.panels = !desk.panels,
            Action::ToggleHistory => self.properties.leaf = Leaf::History,
            Action::ToggleTheme => {
                desk.settings.theme = match ctx.theme() {
                    egui::Theme::Dark => Theme::Light,
                    egui::Theme::Light => Theme::Dark,
                };
                theme::choose(ctx, desk.settings.theme);
                desk.save_settings();
            }
            Action::FullScreen => {
                let full = ctx.input(|i| i.viewport().fullscreen.unwrap_or(false));
                ctx.send_viewport_cmd(ViewportCommand::Fullscreen(!full));
            }
            Action::ScaleUp | Action::ScaleDown => {
                let factor = if action == Action::ScaleUp {
                    1.1
                } else {
                    1.0 / 1.1
                };
                desk.settings.scale = (desk.settings.scale * factor).clamp(0.5, 4.0);
                ctx.set_zoom_factor(desk.settings.scale);
                desk.save_settings();
            }
            _ => {}
        }
    }
}

/// Documents and files.
impl App {
    fn perform_file(&mut self, ui: &Ui, action: Action) {
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
                self.dialog = Some(Dialog::File(FileDialog::new(Purpose::Import, here)));
            }
            Action::LoadMesh => {
                self.dialog = Some(Dialog::File(FileDialog::new(Purpose::Mesh, here)));
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
    fn here(&self) -> PathBuf {
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

    fn ask_where_to_save(&mut self, purpose: Purpose) {
        let document = self.desk.studio.document();
        if document.is_read_only() {
            self.dialog = Some(Dialog::Newer(document.ignored().to_vec()));
        } else {
            self.ask_for_name(purpose);
        }
    }

    fn ask_for_name(&mut self, purpose: Purpose) {
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

    /// Whether the window is about to close.
    #[cfg(test)]
    pub(crate) fn is_closing(&self) -> bool {
        self.may_close
    }

    /// Saves, whatever the file holds.
    fn save_over(&mut self, ctx: &Context, path: &Path) {
        let saved = self.desk.studio.save(path);
        if self.desk.told(saved).is_none() {
            self.after_saving = None;
            return;
        }
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
    fn leave_for(&mut self, ctx: &Context, then: Then) {
        self.canvas.cancel(&mut self.desk);
        if self.desk.studio.document().is_changed() {
            self.dialog = Some(Dialog::Unsaved(then));
        } else {
            self.go(ctx, then);
        }
    }

    fn grant(&mut self, ctx: &Context, wish: Wish) {
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
            Wish::AddPreset(preset) => {
                let label = format!("Add {}", preset.name.replace('_', " "));
                let added = preset
                    .recipe()
                    .and_then(|file| self.desk.studio.add_layers_of(&label, file.recipe()));
                self.desk.told(added);
                self.desk.redraw = self.desk.redraw.or(Redraw::Sharp);
            }
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
            Wish::Large(LargeThing::Mesh(path)) => self.take_in_if(ctx, Part::Mesh, &path, true),
            Wish::EditKeys => self.edit_keys(),
        }
    }

    fn take_path(&mut self, ctx: &Context, purpose: Purpose, path: &Path) {
        match purpose {
            Purpose::Open => self.open_path(ctx, path),
            Purpose::SaveAs | Purpose::SaveThen => self.save(ctx, path),
            Purpose::Import => self.take_in(ctx, Part::Map, path),
            Purpose::Mesh => self.take_in(ctx, Part::Mesh, path),
            Purpose::ExportFolder => {}
        }
    }

    /// A recipe takes the place of the document, a map becomes a layer, a mesh is shown.
    fn open_path(&mut self, ctx: &Context, path: &Path) {
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

    fn take_dropped(&mut self, ctx: &Context) {
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

    /// Does what had to wait.
    fn go(&mut self, ctx: &Context, then: Then) {
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

    /// Shows what another program made of the document's file, unless there is work that the file does not have.
    fn follow_file(&mut self, ctx: &Context) {
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
            self.desk
                .messages
                .news("The file was changed by another program, and read again");
        }
    }

    /// Takes the keys that the user gave their file.
    fn follow_keys(&mut self) {
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

    /// Opens the file of keys with what the system opens it with; writes it first where it is not there.
    fn edit_keys(&mut self) {
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

    fn options(&self) -> Options {
        Options {
            journals: self.desk.folders.as_ref().map(|f| f.recovery.clone()),
            undo_bytes: self.desk.settings.undo_bytes(),
            patience: PATIENCE,
        }
    }

    /// Shows a recipe; asks first where its map takes more memory than there is.
    fn begin(&mut self, ctx: &Context, file: RecipeFile, path: Option<PathBuf>) {
        if let Some(warning) = too_large(file.recipe(), file.recipe().size) {
            let what = LargeThing::Document(Box::new(file), path);
            self.desk.large = Some(Large { warning, what });
            ctx.request_repaint();
        } else {
            self.show_file(ctx, file, path);
        }
    }

    fn show_file(&mut self, ctx: &Context, file: RecipeFile, path: Option<PathBuf>) {
        self.watch.look_after(path.as_deref(), ctx);
        let studio = Studio::new(file, path, self.options());
        if let Some(studio) = self.desk.told(studio) {
            self.show_studio(studio);
            tell_read_only(&mut self.desk);
        }
    }

    /// Puts another document in the place of this one, whose changes are saved or not wanted.
    fn show_studio(&mut self, studio: Studio) {
        let show = self.desk.studio.viewport().show();
        let size = self.desk.studio.viewport().size();
        let before = std::mem::replace(&mut self.desk.studio, studio);
        before.close();
        // What was on its way to the other document is none of this one's.
        self.intake = None;
        self.desk.reading = None;
        self.desk.exported.clear();
        let viewport = self.desk.studio.viewport_mut();
        viewport.resize(size);
        viewport.set_show(show);
        self.canvas.forget();
        self.desk.redraw = Redraw::Sharp;
    }

    /// A mesh or a map from a file. It lies beside the recipe from then on: a recipe without a file is saved first.
    fn take_in(&mut self, ctx: &Context, part: Part, path: &Path) {
        self.take_in_if(ctx, part, path, false);
    }

    /// The same, even a mesh that takes much memory where that is wanted.
    fn take_in_if(&mut self, ctx: &Context, part: Part, path: &Path, even_if_large: bool) {
        if self.desk.studio.document().is_read_only() {
            tell_read_only(&mut self.desk);
            return;
        }
        let Some(folder) = self.own_folder() else {
            self.desk.messages.news(
                "A recipe's own files lie beside it: say where the recipe is to be, and the file comes in",
            );
            self.after_saving = Some(Then::TakeIn(part, path.to_owned()));
            self.ask_where_to_save(Purpose::SaveThen);
            return;
        };
        let begun = Intake::begin(part, path, &folder, even_if_large, ctx);
        self.intake = self.desk.told(begun);
    }

    /// The folder of the document's file, if it has one.
    fn own_folder(&self) -> Option<PathBuf> {
        let folder = self.desk.studio.document().path()?.parent()?;
        let here = folder.as_os_str().is_empty();
        Some(if here { ".".into() } else { folder.to_owned() })
    }

    /// Whether a file is on its way.
    #[cfg(test)]
    pub(crate) fn is_reading(&self) -> bool {
        self.intake.is_some() || (!self.waiting.is_empty() && self.dialog.is_none())
    }

    /// Takes over the file that was read in the background.
    fn follow_intake(&mut self, ctx: &Context) {
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
        let path = intake.path.clone();
        self.intake = None;
        self.desk.reading = None;
        let Some((taken, news)) = self.desk.told(taken) else {
            return;
        };
        for news in news {
            self.desk.messages.news(news);
        }
        match taken {
            Taken::Mesh { file, body } => {
                self.desk.studio.know_mesh(&file, body);
                set_mesh(&mut self.desk, &file);
            }
            Taken::NoUvs => self.dialog = Some(Dialog::NoUvs(path)),
            Taken::Large(warning) => {
                let what = LargeThing::Mesh(path);
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
        if self.desk.studio.document().is_changed() {
            ctx.send_viewport_cmd(ViewportCommand::CancelClose);
            self.dialog = Some(Dialog::Unsaved(Then::Quit));
        } else {
            self.may_close = true;
        }
    }
}

/// Says of a recipe of a newer version that it can only be looked at, and what of it is not shown.
fn tell_read_only(desk: &mut Desk) {
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

/// The files of late; gives the one that was chosen.
fn recent_menu(ui: &mut Ui, desk: &Desk) -> Option<PathBuf> {
    let mut chosen = None;
    let recent: Vec<&PathBuf> = desk.settings.recent.iter().filter(|p| p.exists()).collect();
    ui.add_enabled_ui(!recent.is_empty(), |ui| {
        ui.menu_button("Open recent", |ui| {
            for path in recent {
                let name = path.file_name().unwrap_or_default().to_string_lossy();
                let button = ui.button(name);
                if button.on_hover_text(path.display().to_string()).clicked() {
                    chosen = Some(path.clone());
                    ui.close();
                }
            }
        });
    });
    chosen
}

impl eframe::App for App {
    fn ui(&mut self, ui: &mut Ui, _frame: &mut eframe::Frame) {
        self.frame(ui);
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
