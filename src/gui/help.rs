//! Every key and mouse gesture, with a field to look for one.

use super::desk::Desk;
use super::theme::Palette;
use super::widgets::left_label;
use anisomap::studio::action::{Action, Group};
use anisomap::studio::orbit::Preset;
use eframe::egui::{self, RichText, Ui};

/// What is done with the pointer: (where, how, what).
const GESTURES: [(&str, &str); 14] = [
    (
        "Drag on the canvas",
        "Paints; the first dab waits for a direction",
    ),
    ("Ctrl + drag", "The opposite of the tool"),
    (
        "Shift + click",
        "A straight line from the end of the last stroke",
    ),
    ("Ctrl + Shift + click", "The same in steps of 15 degrees"),
    (
        "F, then move, then click",
        "Size sideways, hardness up and down; the right button puts it back",
    ),
    ("Wheel over the canvas", "Zooms at the pointer"),
    ("Space + drag, Alt + drag, middle drag", "Moves the canvas"),
    ("Alt + right drag", "Zooms the canvas"),
    (
        "Drag the ball on the lit canvas",
        "Moves the light; Shift and the right button do so from anywhere",
    ),
    ("Shift + right drag in 3D", "Turns the lights"),
    ("Wheel in 3D", "Comes closer"),
    ("Drag a bar", "Sets its number, with Shift finely"),
    ("Double click a bar", "Types its number"),
    ("Middle click a bar", "Brings its default back"),
];

/// The list and what is looked for in it.
#[derive(Default)]
pub(crate) struct Help {
    wanted: String,
}

impl Help {
    /// Shows it; `true` when it is to be closed.
    pub(crate) fn show(&mut self, ui: &mut Ui, desk: &Desk) -> bool {
        let palette = Palette::of(ui);
        ui.set_width(760.0);
        let mut close = false;
        ui.horizontal(|ui| {
            ui.heading("Shortcuts");
            ui.with_layout(egui::Layout::right_to_left(egui::Align::Center), |ui| {
                close = ui.button("Close").clicked();
                let field = egui::TextEdit::singleline(&mut self.wanted)
                    .hint_text("Search")
                    .desired_width(200.0);
                ui.add(field).accessible_name("Search shortcuts");
            });
        });
        ui.add_space(6.0);
        let wanted = self.wanted.to_lowercase();
        // As high as the window has room for.
        let room = (ui.ctx().content_rect().height() - 220.0).clamp(160.0, 900.0);
        egui::ScrollArea::vertical()
            .max_height(room)
            .min_scrolled_height(room)
            .auto_shrink(false)
            .show(ui, |ui| {
                ui.columns(2, |columns| {
                    let middle = [Group::File, Group::Edit, Group::Layer, Group::Window];
                    for group in Group::ALL {
                        let ui = &mut columns[usize::from(!middle.contains(&group))];
                        group_rows(ui, desk, group, &wanted);
                    }
                    gestures(&mut columns[0], desk, &wanted);
                });
            });
        if let Some(folders) = &desk.folders {
            ui.add_space(6.0);
            let text = format!(
                "Keys can be changed in {}; Edit > Settings opens that file.",
                folders.keymap().display()
            );
            ui.add(egui::Label::new(RichText::new(text).small().color(palette.weak)).wrap());
        }
        close
    }
}

fn group_rows(ui: &mut Ui, desk: &Desk, group: Group, wanted: &str) {
    let of_group = Action::ALL.iter().filter(|a| a.group() == group);
    let rows: Vec<(String, String, &str)> = of_group
        .map(|a| {
            (
                desk.keymap.keys_text(*a),
                a.name().trim_end_matches('\u{2026}').to_owned(),
                a.doc(),
            )
        })
        .filter(|(keys, name, doc)| {
            wanted.is_empty()
                || [keys.as_str(), name, doc]
                    .iter()
                    .any(|t| t.to_lowercase().contains(wanted))
        })
        .collect();
    heading(ui, group.name(), rows.is_empty());
    for (keys, name, doc) in rows {
        row(ui, &keys, &name, doc);
    }
}

fn gestures(ui: &mut Ui, desk: &Desk, wanted: &str) {
    let orbit = match desk.settings.navigation {
        Preset::Alt => (
            "Alt + left, middle, right drag in 3D",
            "Turns, moves, zooms the camera",
        ),
        Preset::Middle => (
            "Middle drag in 3D, with Shift, Ctrl",
            "Turns, moves, zooms the camera",
        ),
    };
    let all: Vec<_> = GESTURES.iter().copied().chain([orbit]).collect();
    let found: Vec<_> = all
        .into_iter()
        .filter(|(how, what)| {
            wanted.is_empty()
                || how.to_lowercase().contains(wanted)
                || what.to_lowercase().contains(wanted)
        })
        .collect();
    heading(ui, "Pointer", found.is_empty());
    for (how, what) in found {
        let palette = Palette::of(ui);
        ui.add(egui::Label::new(RichText::new(how).color(palette.accent).size(12.0)).wrap());
        ui.add(egui::Label::new(RichText::new(what).size(12.0)).wrap());
        ui.add_space(3.0);
    }
}

fn heading(ui: &mut Ui, text: &str, is_empty: bool) {
    if !is_empty {
        ui.add_space(6.0);
        ui.label(RichText::new(text).strong());
    }
}

fn row(ui: &mut Ui, keys: &str, name: &str, doc: &str) {
    let palette = Palette::of(ui);
    ui.horizontal(|ui| {
        ui.spacing_mut().interact_size.y = 18.0;
        left_label(ui, 170.0, RichText::new(name).size(12.5)).on_hover_text(doc);
        ui.label(RichText::new(keys).size(12.5).color(palette.accent));
    });
}
