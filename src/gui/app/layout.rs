//! What the window is made of: menus, panels, the two pictures, the hint of the first scene.

use super::App;
use crate::gui::canvas::Kind;
use crate::gui::desk::{Desk, Panes};
use crate::gui::files::recent;
use crate::gui::icons::Icon;
use crate::gui::layers::{list_height, menu_item};
use crate::gui::theme::{self, Palette};
use crate::gui::viewport::MESHES;
use crate::gui::widgets::{Tip, icon_button};
use crate::gui::{status, tools};
use anisomap::studio::action::{Action, Group};
use anisomap::studio::orbit;
use eframe::egui::{
    self, CentralPanel, CornerRadius, Frame, Id, Margin, Panel, Rect, Sense, Ui, WidgetInfo, pos2,
    vec2,
};
use std::path::PathBuf;

impl App {
    pub(super) fn menu_bar(&mut self, ui: &mut Ui) {
        let frame = Frame::new()
            .fill(Palette::of(ui).header)
            .inner_margin(Margin::symmetric(8, 3));
        Panel::top("menu")
            .frame(frame)
            .show_separator_line(false)
            .show(ui, |ui| {
                egui::MenuBar::new().ui(ui, |ui| {
                    let mut recent = None;
                    for (name, group, about) in [
                        ("File", Group::File, "Documents, maps, meshes and exports."),
                        ("Edit", Group::Edit, "Undo, redo and the settings."),
                        ("Layer", Group::Layer, "What is done with layers."),
                        (
                            "View",
                            Group::View,
                            "What the canvas shows of the map, and how large.",
                        ),
                        (
                            "3D view",
                            Group::Viewport,
                            "Mesh, models, exposure and lights of the 3D view.",
                        ),
                        ("Window", Group::Window, "Panels, theme, size and help."),
                    ] {
                        let menu = ui.menu_button(name, |ui| {
                            ui.set_min_width(230.0);
                            for action in Action::ALL.iter().filter(|a| a.group() == group) {
                                menu_item(ui, &mut self.desk, *action);
                                if *action == Action::Open {
                                    recent = recent.take().or(recent_menu(ui, &self.desk));
                                }
                            }
                        });
                        menu.response.on_hover_text(about);
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
                        let title = format!("{}{mark}", document.title());
                        let text = egui::RichText::new(&title).color(palette.weak);
                        ui.scope(|ui| {
                            ui.set_max_width(0.6 * ui.available_width());
                            ui.add(egui::Label::new(text).truncate())
                                .on_hover_text(&title);
                        });
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
                                if button.tip(tip).clicked() {
                                    self.desk.ask(action);
                                }
                            });
                        }
                    });
                });
            });
    }

    pub(super) fn panels(&mut self, ui: &mut Ui) {
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
                // No higher than its layers need: the room below belongs to the numbers.
                let layers = self.desk.studio.recipe().layers.len();
                let needed = list_height(layers).min((room - 140.0).max(120.0));
                let panel = Id::unique(("layers", layers));
                Panel::top(panel)
                    .frame(plain)
                    .resizable(true)
                    .default_size(needed.min(room * 0.36))
                    .size_range(needed.min(96.0)..=needed)
                    .show(ui, |ui| {
                        egui::ScrollArea::vertical()
                            .auto_shrink(false)
                            .show(ui, |ui| self.layers.show(ui, &mut self.desk));
                    });
                handle(ui, panel, Way::Down, "Height of the list of layers");
                self.properties.show(ui, &mut self.desk);
            });
        handle(ui, "side", Way::Left, "Width of the panels");
    }

    /// Canvas and 3D view, with a line between them that can be dragged.
    pub(super) fn panes(&mut self, ui: &mut Ui) {
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

    pub(super) fn divider(&mut self, ui: &mut Ui, rect: Rect) -> f32 {
        let middle = (rect.left() + rect.width() * self.desk.split).round();
        let handle = Rect::from_x_y_ranges((middle - 4.0)..=(middle + 4.0), rect.y_range());
        let id = Id::unique("divider");
        let response = ui.interact(handle, id, Sense::click_and_drag());
        response.widget_info(|| {
            let part = f64::from(self.desk.split);
            WidgetInfo::slider(true, part, "Split between the map and the 3D view")
        });
        let response = response
            .on_hover_text("Drag, or with the focus arrow keys: the map's part of the room");
        let mut moved = response.drag_delta().x / rect.width().max(1.0);
        if response.has_focus() {
            let filter = egui::EventFilter {
                horizontal_arrows: true,
                ..Default::default()
            };
            ui.memory_mut(|m| m.set_focus_lock_filter(id, filter));
            let step = |key| 0.02 * ui.input(|i| i.num_presses(key)) as f32;
            moved += step(egui::Key::ArrowRight) - step(egui::Key::ArrowLeft);
        }
        if moved != 0.0 {
            self.desk.split = (self.desk.split + moved).clamp(0.2, 0.8);
        }
        if response.hovered() || response.dragged() || response.has_focus() {
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
    pub(super) fn hint(&mut self, ui: &Ui) {
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
}

/// Which way the handle of a panel goes to make it larger.
#[derive(Clone, Copy, PartialEq)]
enum Way {
    Left,
    Down,
}

/// How far an arrow key moves the handle of a panel, points.
const HANDLE_STEP: f32 = 16.0;

/// Names the handle by which a panel is made larger, says what it does, and moves it by arrow keys.
fn handle(ui: &Ui, panel: impl egui::AsIdSalt, way: Way, name: &str) {
    let id = ui.scope_id().with(panel);
    let Some(handle) = ui.read_response(id.with("__resize")) else {
        return; // as the toolkit calls it
    };
    let tip = format!("{name}: drag, or with the focus arrow keys.");
    let handle = handle.accessible_name(name).on_hover_text(tip);
    if !handle.has_focus() {
        return;
    }
    let filter = egui::EventFilter {
        horizontal_arrows: way == Way::Left,
        vertical_arrows: way == Way::Down,
        ..Default::default()
    };
    ui.memory_mut(|m| m.set_focus_lock_filter(handle.id, filter));
    let (more, less) = match way {
        Way::Left => (egui::Key::ArrowLeft, egui::Key::ArrowRight),
        Way::Down => (egui::Key::ArrowDown, egui::Key::ArrowUp),
    };
    let presses = |key| ui.input(|i| i.num_presses(key)) as f32;
    let by = HANDLE_STEP * (presses(more) - presses(less));
    if by != 0.0
        && let Some(mut state) = egui::PanelState::load(ui.ctx(), id)
    {
        // The panel keeps its own range.
        let size = state.size();
        match way {
            Way::Left => state.outer_rect.set_width(size.x + by),
            Way::Down => state.outer_rect.set_height(size.y + by),
        }
        ui.data_mut(|d| d.insert_persisted(id, state));
        ui.ctx().request_repaint();
    }
    let line = match way {
        Way::Left => handle
            .rect
            .shrink2(vec2(0.5 * handle.rect.width() - 1.0, 0.0)),
        Way::Down => handle
            .rect
            .shrink2(vec2(0.0, 0.5 * handle.rect.height() - 1.0)),
    };
    let colour = Palette::of(ui).accent.gamma_multiply(0.6);
    ui.painter().rect_filled(line, CornerRadius::ZERO, colour);
}

/// The files of late; gives the one that was chosen.
fn recent_menu(ui: &mut Ui, desk: &Desk) -> Option<PathBuf> {
    let mut chosen = None;
    let recent = recent(desk);
    ui.add_enabled_ui(!recent.is_empty(), |ui| {
        let menu = ui.menu_button("Open recent", |ui| {
            for (path, name) in recent {
                let button = ui.button(name);
                let tip = format!("Opens {}.", path.display());
                if button.on_hover_text(tip).clicked() {
                    chosen = Some(path.clone());
                    ui.close();
                }
            }
        });
        menu.response
            .tip("The recipes that were opened or saved last.");
    });
    chosen
}
