//! The built-in recipes with pictures of them, which a thread draws.

use super::theme::Palette;
use super::widgets::Tip;
use super::work::{Now, Work};
use anisomap::Error;
use anisomap::map::Size;
use anisomap::mesh;
use anisomap::preview::{Look, Scene, Subject, render};
use anisomap::progress::Progress;
use anisomap::recipe::{PRESETS, Preset};
use anisomap::studio::apart;
use eframe::egui::{
    self, Align2, Color32, ColorImage, CornerRadius, FontId, Role, Sense, Stroke, StrokeKind,
    TextureHandle, TextureOptions, Ui, WidgetInfo, pos2, vec2,
};

/// Width and height of a picture, pixels.
const PICTURE: [u32; 2] = [176, 132];
/// The most pictures beside each other.
const COLUMNS: usize = 4;

type Drawn = (usize, Result<Vec<u8>, Error>);

/// The browser.
#[derive(Default)]
pub(crate) struct PresetBrowser {
    pictures: Vec<Option<TextureHandle>>,
    work: Option<Work<Drawn>>,
    begun: bool,
    /// What is looked for.
    search: String,
    begun_search: bool,
    /// Enter in the search has chosen one: the next Enter opens it.
    to_open: bool,
    /// The number of the one that was chosen.
    chosen: Option<usize>,
    /// Whether the lowest layer, which hides what lies below it, does not come along.
    without_ground: bool,
}

/// What the browser wants done.
pub(crate) enum Wish {
    Stay,
    Close,
    Open(&'static Preset),
    /// Its layers come into the document, without the lowest one where so wanted.
    Add(&'static Preset, bool),
}

impl PresetBrowser {
    /// Whether something was typed or chosen that a click beside the dialog must not throw away.
    pub(crate) fn is_touched(&self) -> bool {
        self.chosen.is_some() || !self.search.is_empty()
    }

    pub(crate) fn show(&mut self, ui: &mut Ui) -> Wish {
        self.follow(ui);
        let (screen, column) = (ui.ctx().content_rect().size(), PICTURE[0] as f32 + 12.0);
        let columns = (((screen.x - 70.0) / column) as usize).clamp(1, COLUMNS);
        ui.set_width(column * columns as f32 + 10.0);
        ui.heading("Presets");
        let mut entered = false;
        ui.horizontal(|ui| {
            ui.label("Search");
            let field = egui::TextEdit::singleline(&mut self.search).desired_width(220.0);
            let field = ui.add(field).accessible_name("Search");
            let field = field.on_hover_text("Words of a preset's name or description.");
            let first = !self.begun_search && !ui.is_sizing_pass();
            if first {
                self.begun_search = true;
                field.request_focus();
            }
            entered = field.lost_focus() && ui.input(|i| i.key_pressed(egui::Key::Enter));
            if entered && !PRESETS.iter().any(|p| matches(p, &self.search)) {
                field.request_focus();
            }
        });
        ui.add_space(6.0);
        let mut wish = Wish::Stay;
        let found: Vec<usize> = (0..PRESETS.len())
            .filter(|i| matches(&PRESETS[*i], &self.search))
            .collect();
        if let (true, Some(first)) = (entered, found.first()) {
            self.chosen = Some(*first);
            self.to_open = true;
        }
        let room = (screen.y - 300.0).clamp(160.0, 900.0);
        egui::ScrollArea::vertical()
            .max_height(room)
            .min_scrolled_height(room)
            .auto_shrink(false)
            .show(ui, |ui| {
                if found.is_empty() {
                    ui.label("No preset has all these words.");
                }
                egui::Grid::new("presets")
                    .spacing(vec2(10.0, 10.0))
                    .show(ui, |ui| {
                        for (n, i) in found.iter().enumerate() {
                            let card = self.card(ui, *i, &PRESETS[*i]);
                            if card.clicked() {
                                self.chosen = Some(*i);
                            }
                            if card.double_clicked() {
                                wish = Wish::Open(&PRESETS[*i]);
                            }
                            if (n + 1) % columns == 0 {
                                ui.end_row();
                            }
                        }
                    });
            });
        ui.add_space(6.0);
        let chosen = self
            .chosen
            .filter(|i| found.contains(i))
            .map(|i| &PRESETS[i]);
        let about = chosen.map_or("Choose one to read what it is.", Preset::description);
        ui.add(egui::Label::new(egui::RichText::new(about).color(Palette::of(ui).weak)).wrap());
        ui.add_space(6.0);
        ui.horizontal_wrapped(|ui| {
            for (text, tip, make) in [
                (
                    "Open as a new document",
                    "In place of what is open, which is saved first if you like. A double click does the same.",
                    Wish::Open as fn(&'static Preset) -> Wish,
                ),
                (
                    "Add as layers",
                    "Puts its layers above the selected one, as one step that can be undone.",
                    match self.without_ground {
                        true => |preset| Wish::Add(preset, true),
                        false => |preset| Wish::Add(preset, false),
                    },
                ),
            ] {
                let button = ui.add_enabled(chosen.is_some(), egui::Button::new(text));
                if chosen.is_some() && std::mem::take(&mut self.to_open) {
                    button.request_focus();
                }
                if let (true, Some(preset)) = (button.tip(tip).clicked(), chosen) {
                    wish = make(preset);
                }
            }
            ui.checkbox(&mut self.without_ground, "without its ground")
                .on_hover_text(
                    "Leaves out the lowest layer of several, which would hide what is there: for Add as layers.",
                );
            let close = ui.button("Close");
            if close.on_hover_text("Leaves everything as it is (Escape).").clicked() {
                wish = Wish::Close;
            }
        });
        wish
    }

    fn card(&self, ui: &mut Ui, i: usize, preset: &Preset) -> egui::Response {
        let palette = Palette::of(ui);
        let size = vec2(PICTURE[0] as f32, PICTURE[1] as f32 + 24.0);
        let (rect, response) = ui.allocate_exact_size(size, Sense::click());
        let name = preset.name.replace('_', " ");
        response.widget_info(|| WidgetInfo::labeled(Role::Button, true, format!("Preset {name}")));
        let round = CornerRadius::same(5);
        ui.painter().rect_filled(rect, round, palette.header);
        let mut picture = rect;
        picture.set_height(PICTURE[1] as f32);
        if let Some(Some(texture)) = self.pictures.get(i) {
            let uv = egui::Rect::from_min_max(pos2(0.0, 0.0), pos2(1.0, 1.0));
            ui.painter()
                .image(texture.id(), picture.shrink(1.0), uv, Color32::WHITE);
        } else {
            ui.painter().rect_filled(picture, round, palette.backdrop);
        }
        let at = pos2(rect.left() + 8.0, rect.bottom() - 12.0);
        ui.painter().text(
            at,
            Align2::LEFT_CENTER,
            name,
            FontId::proportional(12.5),
            palette.text,
        );
        if response.hovered() || response.has_focus() || self.chosen == Some(i) {
            ui.painter().rect_stroke(
                rect,
                round,
                Stroke::new(1.5, palette.accent),
                StrokeKind::Inside,
            );
        }
        response.on_hover_text(preset.description())
    }

    fn follow(&mut self, ui: &Ui) {
        if !self.begun {
            self.begun = true;
            self.pictures.resize_with(PRESETS.len(), || None);
            let work = |reins: &super::work::Reins, give: &dyn Fn(Drawn) -> bool| {
                for (i, preset) in PRESETS.iter().enumerate() {
                    if !reins.go_on() || !give((i, apart(|| picture_of(preset)))) {
                        return;
                    }
                }
            };
            // Without a thread there are names without pictures.
            self.work = Work::begin("presets", ui.ctx(), work).ok();
        }
        while let Some(work) = &self.work {
            match work.now() {
                Now::Going => return,
                Now::Over => self.work = None,
                Now::Came((i, Ok(rgb))) => {
                    let image =
                        ColorImage::from_rgb([PICTURE[0] as usize, PICTURE[1] as usize], &rgb);
                    let texture =
                        ui.ctx()
                            .load_texture(format!("preset {i}"), image, TextureOptions::LINEAR);
                    self.pictures[i] = Some(texture);
                }
                Now::Came((_, Err(_))) => {} // its name and description are there
            }
        }
    }
}

/// Whether a preset's name or description has every word.
fn matches(preset: &Preset, search: &str) -> bool {
    let text = format!("{} {}", preset.name.replace('_', " "), preset.description()).to_lowercase();
    let words = search.to_lowercase();
    words.split_whitespace().all(|word| text.contains(word))
}

/// A small lit picture of a preset.
fn picture_of(preset: &Preset) -> Result<Vec<u8>, Error> {
    let mut recipe = preset.recipe()?.recipe().clone();
    recipe.aspect = Some(recipe.aspect_at(recipe.size));
    recipe.size = Size::new(384, 384)?;
    let files = anisomap::recipe::Files::default();
    let map = recipe
        .prepare(recipe.size, &files, &Progress::none())?
        .map(&Progress::none())?;
    let word = recipe
        .mesh
        .as_deref()
        .unwrap_or(anisomap::studio::DEFAULT_MESH);
    let mesh = mesh::open(word)?;
    let subject = Subject {
        mesh: &mesh,
        map: &map,
        material: &recipe.material,
    };
    let mut scene = Scene::for_mesh(&mesh);
    scene.exposure = recipe.scene.exposure;
    let size = Size::new(PICTURE[0], PICTURE[1])?;
    let pictures = render(subject, &scene, &[Look::default()], size, &Progress::none())?;
    Ok(pictures[0].to_srgb8())
}
