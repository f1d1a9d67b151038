//! What actions do, but for those on files.

use super::App;
use crate::gui::canvas::Kind;
use crate::gui::desk::{Panes, Redraw};
use crate::gui::dialogs::Dialog;
use crate::gui::guides;
use crate::gui::help::Help;
use crate::gui::properties::Leaf;
use crate::gui::theme;
use crate::gui::viewport::{MESHES, set_exposure, set_lights, set_mesh};
use anisomap::preview::Rig;
use anisomap::studio::action::{Action, Group};
use anisomap::studio::hand::{Mirror, ToolKind};
use anisomap::studio::settings::Theme;
use anisomap::studio::view::Lighting;
use eframe::egui::{self, Context, Ui, ViewportCommand};

impl App {
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

    pub(super) fn perform_edit(&mut self, action: Action) {
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

    pub(super) fn perform_brush(&mut self, ui: &Ui, action: Action) {
        let on_mask = self.desk.studio.is_mask_selected();
        let hand = &mut self.desk.hand;
        match action {
            // Of a brush on a mask the widths do not count: what shows and what hides change places.
            Action::SwapAlphas if on_mask => hand.take(match hand.kind() {
                ToolKind::Erase => ToolKind::Groove,
                _ => ToolKind::Erase,
            }),
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
            Action::DragSize | Action::DragFlow => {
                let pane = match self.desk.panes {
                    Panes::Viewport => self.viewport.rect(),
                    _ => self.canvas.rect,
                };
                let flow = action == Action::DragFlow;
                self.desk.begin_adjusting(ui.ctx(), pane.center(), flow);
            }
            _ => {}
        }
    }

    pub(super) fn perform_layer(&mut self, action: Action) {
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

    pub(super) fn perform_view(&mut self, action: Action) {
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
            Action::ToggleOutlines => self.canvas.toggle_outlines(&self.desk),
            Action::CanvasFit => self.canvas.fit(),
            Action::ActualTexels => self.canvas.actual_texels(),
            Action::ZoomIn => self.canvas.zoom_by(1.25),
            Action::ZoomOut => self.canvas.zoom_by(0.8),
            _ => {}
        }
    }

    pub(super) fn perform_viewport(&mut self, action: Action) {
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
            Action::ResetLight => {
                set_lights(desk, Rig::Studio);
                self.canvas.light = Lighting::default().toward;
            }
            Action::ToggleTimings => desk.stages.shown = !desk.stages.shown,
            Action::ExposureDown => set_exposure(desk, exposure - 1.0 / 3.0),
            Action::ExposureUp => set_exposure(desk, exposure + 1.0 / 3.0),
            _ => {}
        }
        desk.redraw = desk.redraw.or(Redraw::Sharp);
    }

    pub(super) fn perform_window(&mut self, ctx: &Context, action: Action) {
        let desk = &mut self.desk;
        match action {
            Action::Shortcuts => self.dialog = Some(Dialog::Shortcuts(Help::default())),
            Action::ShowBoth => desk.panes = Panes::Both,
            Action::ShowCanvas => desk.panes = Panes::Canvas,
            Action::ShowViewport => desk.panes = Panes::Viewport,
            Action::FocusControls => {
                desk.panels = true;
                let stops: Vec<_> = desk.first_control.iter().chain(&desk.steered).collect();
                let now = ctx.memory(|m| m.focused());
                let at = stops.iter().position(|id| Some(**id) == now);
                let next = at.map_or(0, |at| (at + 1) % stops.len());
                if let Some(id) = stops.get(next) {
                    ctx.memory_mut(|m| m.request_focus(**id));
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
