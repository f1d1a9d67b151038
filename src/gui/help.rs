//! Every key and mouse gesture, with a field to look for one.

use super::desk::Desk;
use super::theme::Palette;
use super::widgets::left_label;
use anisomap::studio::action::{Action, Group};
use anisomap::studio::orbit::Preset;
use eframe::egui::{self, RichText, Ui};

/// What is done with the pointer: (where, how, what).
const GESTURES: [(&str, &str); 15] = [
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
        "Drag with the guide tool",
        "Draws a guide; Shift makes it even, Alt begins at its middle",
    ),
    ("Wheel over the canvas", "Zooms at the pointer"),
    ("Space + drag, Alt + drag, middle drag", "Moves the canvas"),
    ("Alt + right drag", "Zooms the canvas"),
    (
        "Drag the ball on the lit canvas",
        "Moves the light; Shift and the right button do so from anywhere",
    ),
    (
        "Shift + right drag in 3D",
        "Turns the lights; so does a drag of their ball",
    ),
    (
        "Go to the controls, then arrow keys",
        "Move the map and the lights and turn the 3D view; Ctrl moves it, Alt zooms, Shift is fine",
    ),
    ("Wheel in 3D", "Comes closer"),
    ("Drag a bar", "Sets its number, with Shift finely"),
    ("Click a bar", "Types its number"),
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
        let screen = ui.ctx().content_rect().size();
        let room = screen.x - 80.0;
        let count = ((room / COLUMN) as usize).clamp(1, 4);
        ui.set_width(room.min(COLUMN * count as f32));
        let mut close = false;
        ui.horizontal(|ui| {
            ui.heading("Shortcuts");
            ui.with_layout(egui::Layout::right_to_left(egui::Align::Center), |ui| {
                close = ui
                    .button("Close")
                    .on_hover_text("Closes the list (Escape).")
                    .clicked();
                let field = egui::TextEdit::singleline(&mut self.wanted)
                    .hint_text("Search")
                    .desired_width(200.0);
                ui.add(field)
                    .accessible_name("Search shortcuts")
                    .on_hover_text("Words of an action's name, or a key.");
            });
        });
        let wanted = self.wanted.to_lowercase();
        let mut parts: Vec<Part> = Group::ALL
            .into_iter()
            .map(|group| group_part(desk, group, &wanted))
            .collect();
        parts.push(gestures(desk, &wanted));
        parts.retain(|part| !part.rows.is_empty());
        // As high as the window has room for, and no higher than the list is.
        let lines: usize = parts.iter().map(Part::height).sum();
        let high = 17.5 * (lines / count + 8) as f32;
        let room = (screen.y - 190.0).max(120.0).min(high);
        egui::ScrollArea::vertical()
            .max_height(room)
            .min_scrolled_height(room)
            .auto_shrink([false, true])
            .show(ui, |ui| {
                ui.columns(count, |columns| {
                    for (ui, parts) in columns.iter_mut().zip(spread(parts, count)) {
                        ui.set_max_width(COLUMN - 28.0);
                        for part in parts {
                            ui.vertical(|ui| part.show(ui));
                        }
                    }
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

/// Width of a column, points.
const COLUMN: f32 = 320.0;

/// A heading with its rows: what is done, how, and more about it.
struct Part {
    title: &'static str,
    rows: Vec<[String; 3]>,
    /// Whether what is done stands below how, for want of room beside it.
    is_long: bool,
}

impl Part {
    /// Lines that it takes, about.
    fn height(&self) -> usize {
        2 + self.rows.len() * if self.is_long { 2 } else { 1 }
    }

    fn show(&self, ui: &mut Ui) {
        let palette = Palette::of(ui);
        ui.spacing_mut().item_spacing.y = 2.0;
        ui.spacing_mut().interact_size.y = 15.0;
        ui.add_space(7.0);
        ui.label(RichText::new(self.title).strong());
        for [what, how, more] in &self.rows {
            let text = |text: &str| RichText::new(text).size(12.0);
            if self.is_long {
                ui.add(egui::Label::new(text(how).color(palette.accent)).wrap());
                ui.add(egui::Label::new(text(what)).wrap());
                ui.add_space(2.0);
                continue;
            }
            ui.horizontal(|ui| {
                left_label(ui, 150.0, text(what)).on_hover_text(more);
                ui.label(text(how).color(palette.accent));
            });
        }
    }
}

/// The parts in columns of about the same height: the highest first, each into what is lowest by then.
fn spread(mut parts: Vec<Part>, count: usize) -> Vec<Vec<Part>> {
    parts.sort_by_key(|part| std::cmp::Reverse(part.height()));
    let mut columns: Vec<(usize, Vec<Part>)> = (0..count).map(|_| (0, Vec::new())).collect();
    for part in parts {
        if let Some(lowest) = columns.iter_mut().min_by_key(|(height, _)| *height) {
            lowest.0 += part.height();
            lowest.1.push(part);
        }
    }
    columns.into_iter().map(|(_, parts)| parts).collect()
}

fn group_part(desk: &Desk, group: Group, wanted: &str) -> Part {
    let of_group = Action::ALL.iter().filter(|a| a.group() == group);
    let rows = of_group.map(|a| {
        let name = a.name().trim_end_matches('\u{2026}').to_owned();
        [name, desk.keymap.keys_text(*a), a.doc().to_owned()]
    });
    Part {
        title: group.name(),
        rows: rows.filter(|row| has(row, wanted)).collect(),
        is_long: false,
    }
}

fn has(row: &[String; 3], wanted: &str) -> bool {
    row.iter().any(|text| text.to_lowercase().contains(wanted))
}

fn gestures(desk: &Desk, wanted: &str) -> Part {
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
    let drag_size = format!(
        "{}, then move, then click",
        desk.keymap.keys_text(Action::DragSize)
    );
    let drag_size = (
        &*drag_size,
        "Size sideways, hardness up and down; the right button puts it back",
    );
    let all = GESTURES.iter().copied().chain([drag_size, orbit]);
    let rows = all.map(|(how, what)| [what.to_owned(), how.to_owned(), String::new()]);
    Part {
        title: "Pointer",
        rows: rows.filter(|row| has(row, wanted)).collect(),
        is_long: true,
    }
}
