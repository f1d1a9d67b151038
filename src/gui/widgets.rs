//! Controls that the toolkit has not: a bar that is slider, label and number in one, icon buttons, choices in a row.

use super::icons::Icon;
use super::theme::{Palette, ROW};
use eframe::egui::{
    self, Align2, Color32, CornerRadius, FontId, Id, Key, Rect, Response, Role, Sense, Stroke,
    StrokeKind, TextEdit, TextStyle, Ui, WidgetInfo, pos2, vec2,
};
use std::ops::RangeInclusive;

/// What a control tells of itself: where the pointer rests on it, and to screen readers.
pub(crate) trait Tip {
    /// Says what the control does, whether it can be used now or not.
    fn tip(self, text: impl Into<String>) -> Self;
}

impl Tip for Response {
    fn tip(self, text: impl Into<String>) -> Self {
        let text: String = text.into();
        self.on_hover_text(&text).on_disabled_hover_text(text)
    }
}

/// A number in a range: a bar with its name on the left and the number on the right. Dragging sets it, with Shift finely; a
/// click or Enter types it; the arrow keys move it.
pub(crate) struct Bar<'a> {
    label: &'a str,
    range: RangeInclusive<f64>,
    unit: &'a str,
    integer: bool,
    default: Option<f64>,
    width: Option<f32>,
    /// What the number is multiplied by where it is shown and typed: 100 for percent.
    factor: f64,
}

/// What was done with a [`Bar`].
pub(crate) struct BarResponse {
    pub(crate) response: Response,
    /// A change is complete: the drag ended, a number was typed.
    pub(crate) finished: bool,
}

impl<'a> Bar<'a> {
    pub(crate) fn new(label: &'a str, range: RangeInclusive<f64>) -> Self {
        Self {
            label,
            range,
            unit: "",
            integer: false,
            default: None,
            width: None,
            factor: 1.0,
        }
    }

    /// The unit that stands after the number: in full, shorter or not at all, as there is room.
    pub(crate) fn unit(mut self, unit: &'a str) -> Self {
        self.unit = unit;
        self
    }

    /// Shown and typed in hundredths.
    pub(crate) fn percent(mut self) -> Self {
        self.factor = 100.0;
        self.unit = "%";
        self
    }

    /// Whole numbers only.
    pub(crate) fn integer(mut self, integer: bool) -> Self {
        self.integer = integer;
        self
    }

    /// What a middle click brings back.
    pub(crate) fn default(mut self, value: f64) -> Self {
        self.default = Some(value);
        self
    }

    /// Its width; else all there is.
    pub(crate) fn width(mut self, width: f32) -> Self {
        self.width = Some(width);
        self
    }

    /// Whether equal ways along the bar are equal factors: where the range is wide and positive.
    fn is_logarithmic(&self) -> bool {
        *self.range.start() > 0.0 && self.range.end() / self.range.start() >= 50.0
    }

    fn fraction(&self, value: f64) -> f64 {
        let (low, high) = (*self.range.start(), *self.range.end());
        let t = if self.is_logarithmic() {
            (value.max(low) / low).ln() / (high / low).ln()
        } else {
            (value - low) / (high - low)
        };
        if t.is_finite() {
            t.clamp(0.0, 1.0)
        } else {
            0.0
        }
    }

    fn value_at(&self, fraction: f64) -> f64 {
        let (low, high) = (*self.range.start(), *self.range.end());
        let t = fraction.clamp(0.0, 1.0);
        let value = if self.is_logarithmic() {
            low * (high / low).powf(t)
        } else {
            low + (high - low) * t
        };
        self.tidy(value)
    }

    /// The nearest number that is worth writing: three digits of the range, or of the value where the bar is logarithmic.
    fn tidy(&self, value: f64) -> f64 {
        let (low, high) = (*self.range.start(), *self.range.end());
        if self.integer {
            return value.round().clamp(low, high);
        }
        let size = if self.is_logarithmic() {
            value.abs()
        } else {
            high - low
        };
        let step = 10f64.powf((size.max(1e-12) / 500.0).log10().floor());
        let steps = (value / step).round();
        // Dividing by a whole number keeps 0.35 from becoming 0.35000000000000003.
        let tidy = if step < 1.0 {
            steps / (1.0 / step).round()
        } else {
            steps * step
        };
        tidy.clamp(low, high)
    }

    /// The number as it is shown and typed, without its unit.
    fn number(&self, value: f64) -> String {
        let shown = value * self.factor;
        if self.integer || shown == 0.0 {
            return format!("{shown:.0}");
        }
        let decimals = decimals(shown.abs().log10().floor() as i32);
        let text = format!("{shown:.decimals$}");
        if text.contains('.') {
            text.trim_end_matches('0').trim_end_matches('.').to_owned()
        } else {
            text
        }
    }

    /// Numbers of which one is as wide as any that can be shown or typed: the ends, and one with all its decimals of each power
    /// of ten between them.
    fn widest(&self) -> Vec<String> {
        let ends = [*self.range.start(), *self.range.end()];
        let mut numbers = ends.map(|end| self.number(end)).to_vec();
        if self.integer {
            return numbers;
        }
        let [low, high] = ends.map(|end| end * self.factor);
        for (sign, from, to) in [("", low, high), ("-", -high, -low)] {
            let within = |power: &i32| from < 10f64.powi(power + 1) && to > 10f64.powi(*power);
            let all = (DECIMALS.0..=DECIMALS.1).filter(within);
            let text = |power| format!("{sign}{:.*}", decimals(power), 8.0 * 10f64.powi(power));
            numbers.extend(all.map(text));
        }
        numbers
    }

    /// The longest form of the unit that has room beside label and number, whatever the number will be.
    fn unit_in(&self, ui: &Ui, font: &FontId, width: f32) -> &'a str {
        let wide = |text: String| {
            let galley = ui
                .painter()
                .layout_no_wrap(text, font.clone(), Color32::WHITE);
            galley.size().x
        };
        let number = self.widest().into_iter().map(wide).fold(0.0, f32::max);
        let room = width - MARGINS - wide(self.label.to_owned()) - number;
        let forms = forms(self.unit);
        let mut fitting = forms
            .iter()
            .filter(|form| wide(with_unit("", form)) <= room);
        fitting.next().copied().unwrap_or(forms[forms.len() - 1])
    }

    /// Shows it; the number changes as it is dragged.
    pub(crate) fn show(self, ui: &mut Ui, value: &mut f64) -> BarResponse {
        let width = self.width.unwrap_or_else(|| ui.available_width());
        let editing = ui.next_auto_id().with("typed");
        let typed: Option<String> = ui.data(|d| d.get_temp(editing));
        let sense = match typed {
            Some(_) => Sense::hover(), // the field is the control now
            None => Sense::click_and_drag(),
        };
        let (rect, mut response) = ui.allocate_exact_size(vec2(width, ROW - 2.0), sense);
        if let Some(text) = typed {
            let (set, finished) = self.edit(ui, rect, editing, text);
            if let Some(new) = set {
                *value = new;
                response.mark_changed();
            }
            return BarResponse { response, finished };
        }
        let finished = self.handle(ui, rect, &mut response, value);
        // Before the tip that says what it does.
        if self.paint(ui, rect, &response, *value) {
            response = response.on_hover_text(self.label);
        }
        let (label, shown) = (self.label, *value * self.factor);
        response.widget_info(|| WidgetInfo::slider(true, shown, label));
        if response.clicked() || (response.has_focus() && ui.input(|i| i.key_pressed(Key::Enter))) {
            let number = self.number(*value);
            ui.data_mut(|d| d.insert_temp(editing, number));
            ui.ctx().request_repaint();
        }
        BarResponse { response, finished }
    }

    fn handle(&self, ui: &Ui, rect: Rect, response: &mut Response, value: &mut f64) -> bool {
        let before = *value;
        let mut finished = false;
        if response.dragged_by(egui::PointerButton::Primary)
            && let Some(pointer) = response.interact_pointer_pos()
        {
            let along = (pointer.x - rect.left() - 2.0) / (rect.width() - 4.0);
            if ui.input(|i| i.modifiers.shift) {
                let step = f64::from(response.drag_delta().x / rect.width()) * 0.1;
                *value = self.value_at(self.fraction(*value) + step);
            } else if response.drag_delta() != egui::Vec2::ZERO || response.drag_started() {
                *value = self.value_at(f64::from(along));
            }
        }
        if response.drag_stopped() {
            finished = true;
        }
        if response.middle_clicked()
            && let Some(default) = self.default
        {
            *value = default;
            finished = true;
        }
        if response.has_focus() {
            let (less, more, fine) = ui.input(|i| {
                (
                    i.num_presses(Key::ArrowLeft),
                    i.num_presses(Key::ArrowRight),
                    i.modifiers.shift,
                )
            });
            let steps = more as f64 - less as f64;
            if steps != 0.0 {
                *value = if self.integer {
                    self.tidy(*value + steps)
                } else {
                    self.value_at(self.fraction(*value) + steps * if fine { 0.002 } else { 0.02 })
                };
                finished = true;
            }
            // The arrows are the bar's: they must not take the focus elsewhere.
            let filter = egui::EventFilter {
                horizontal_arrows: true,
                ..Default::default()
            };
            ui.memory_mut(|m| m.set_focus_lock_filter(response.id, filter));
        }
        if *value != before {
            response.mark_changed();
        }
        finished
    }

    fn edit(&self, ui: &mut Ui, rect: Rect, editing: Id, mut text: String) -> (Option<f64>, bool) {
        let id = editing.with("field");
        let field = TextEdit::singleline(&mut text)
            .id(id)
            .margin(vec2(6.0, 3.0))
            .align(Align2::RIGHT_CENTER);
        let tip = match self.unit {
            "" => "A number; Enter takes it, Escape leaves it.".to_owned(),
            unit => format!("A number, {unit}; Enter takes it, Escape leaves it."),
        };
        let response = ui.put(rect, field).accessible_name(self.label).tip(tip);
        let first = !ui.data(|d| d.get_temp::<bool>(id).unwrap_or(false));
        if first {
            response.request_focus();
            ui.data_mut(|d| d.insert_temp(id, true));
            select_all(ui, id, &text);
        }
        let escaped = ui.input(|i| i.key_pressed(Key::Escape));
        if response.lost_focus() || escaped {
            ui.data_mut(|d| {
                d.remove::<String>(editing);
                d.remove::<bool>(id);
            });
            let number = parse_number(&text).map(|n| n / self.factor);
            let set = number.filter(|_| !escaped).map(|n| {
                let n = if self.integer { n.round() } else { n };
                n.clamp(*self.range.start(), *self.range.end())
            });
            return (set, true);
        }
        ui.data_mut(|d| d.insert_temp(editing, text));
        (None, false)
    }

    /// Gives whether the label has no room to be shown whole.
    fn paint(&self, ui: &Ui, rect: Rect, response: &Response, value: f64) -> bool {
        let palette = Palette::of(ui);
        let painter = ui.painter();
        let round = CornerRadius::same(3);
        painter.rect_filled(rect, round, palette.track);
        let mut filled = rect;
        filled.set_width(rect.width() * self.fraction(value) as f32);
        let hot = response.hovered() || response.dragged();
        let fill = if hot {
            palette.accent.gamma_multiply(0.55)
        } else {
            palette.accent_ground
        };
        if filled.width() > 0.5 {
            painter
                .with_clip_rect(filled.intersect(ui.clip_rect()))
                .rect_filled(rect, round, fill);
        }
        if response.has_focus() {
            painter.rect_stroke(
                rect,
                round,
                Stroke::new(1.0, palette.accent),
                StrokeKind::Inside,
            );
        } else if hot {
            painter.rect_stroke(
                rect,
                round,
                Stroke::new(1.0, palette.hover),
                StrokeKind::Inside,
            );
        }
        let font = TextStyle::Body.resolve(ui.style());
        let small = FontId::new(font.size - 0.5, font.family.clone());
        let unit = self.unit_in(ui, &small, rect.width());
        let text = with_unit(&self.number(value), unit);
        let number = painter.layout_no_wrap(text, small.clone(), palette.text);
        let room = rect.width() - number.size().x - MARGINS;
        let mut job = egui::text::LayoutJob::simple_singleline(
            self.label.to_owned(),
            small,
            palette.text.gamma_multiply(0.85),
        );
        job.wrap = egui::text::TextWrapping::truncate_at_width(room.max(0.0));
        let label = painter.layout_job(job);
        let is_elided = label.elided;
        let top = |height: f32| rect.center().y - 0.5 * height;
        painter.galley(
            pos2(rect.left() + 7.0, top(label.size().y)),
            label,
            palette.text,
        );
        let at = pos2(rect.right() - 7.0 - number.size().x, top(number.size().y));
        if response.hovered() && !response.dragged() {
            // A field to type into, as far as the hand is near.
            let field = Rect::from_min_size(at, number.size()).expand2(vec2(4.0, 1.0));
            painter.rect_filled(field, CornerRadius::same(2), palette.track);
            let line = Stroke::new(1.0, palette.accent);
            painter.hline(field.x_range(), field.bottom(), line);
            let over = ui.input(|i| i.pointer.hover_pos().is_some_and(|p| p.x > field.left()));
            ui.ctx().set_cursor_icon(if over {
                egui::CursorIcon::Text
            } else {
                egui::CursorIcon::ResizeHorizontal
            });
        }
        painter.galley(at, number, palette.text);
        is_elided
    }
}

/// Powers of ten of numbers whose decimals are shown.
const DECIMALS: (i32, i32) = (-5, 1);

/// How many decimals a number of this power of ten is shown with: three digits, five decimals at most.
fn decimals(power: i32) -> usize {
    (2 - power).clamp(0, 5) as usize
}

/// What stands on a bar beside label, number and unit: the margins and the gap between them.
const MARGINS: f32 = 20.0;

/// A unit in full, and shorter for where there is less room, the last of them in any case.
fn forms(unit: &str) -> Vec<&str> {
    match unit {
        "degrees" => vec!["\u{b0}"],
        "surface units" => vec![unit, "units", ""],
        "slope width" => vec![unit, "slope", ""],
        "UV units" => vec![unit, "UV", ""],
        "threads per surface unit" => vec![unit, "per unit", ""],
        _ => vec![unit],
    }
}

fn with_unit(number: &str, unit: &str) -> String {
    match unit {
        "" | "%" | "\u{b0}" => format!("{number}{unit}"),
        unit => format!("{number} {unit}"),
    }
}

/// Selects the whole text of a field.
pub(crate) fn select_all(ui: &Ui, id: Id, text: &str) {
    let mut state = egui::text_edit::TextEditState::load(ui.ctx(), id).unwrap_or_default();
    let end = egui::text::CCursor::new(text.chars().count());
    state
        .cursor
        .set_char_range(Some(egui::text::CCursorRange::two(
            egui::text::CCursor::new(0),
            end,
        )));
    state.store(ui.ctx(), id);
}

/// A number as somebody types it: a comma for the point, a unit behind.
fn parse_number(text: &str) -> Option<f64> {
    let text = text.trim().replace(',', ".");
    let end = text
        .find(|c: char| !(c.is_ascii_digit() || "+-.eE".contains(c)))
        .unwrap_or(text.len());
    text[..end].parse::<f64>().ok().filter(|n| n.is_finite())
}

/// A square button with an icon. `label` names it for screen readers and tests.
pub(crate) fn icon_button(
    ui: &mut Ui,
    icon: Icon,
    label: &str,
    side: f32,
    selected: bool,
) -> Response {
    let (rect, response) = ui.allocate_exact_size(vec2(side, side), Sense::click());
    let enabled = ui.is_enabled();
    response.widget_info(|| WidgetInfo::selected(Role::Button, enabled, selected, label));
    let palette = Palette::of(ui);
    let round = CornerRadius::same(4);
    let colour = if selected {
        ui.painter().rect_filled(rect, round, palette.accent_ground);
        if ui.visuals().dark_mode {
            palette.accent
        } else {
            palette.text
        }
    } else if response.hovered() && enabled {
        ui.painter().rect_filled(rect, round, palette.hover);
        palette.text
    } else {
        palette.text.gamma_multiply(0.85)
    };
    if response.has_focus() {
        ui.painter().rect_stroke(
            rect,
            round,
            Stroke::new(1.0, palette.accent),
            StrokeKind::Inside,
        );
    }
    let colour = if enabled {
        colour
    } else {
        palette.weak.gamma_multiply(0.5)
    };
    let inner = rect.shrink((side * 0.17).max(3.0));
    icon.paint(ui.painter(), inner, colour);
    response
}

/// One of a few words in a row, each with what it does; `tip` says what all of them are about. Gives the index of the word that
/// was clicked.
pub(crate) fn choices(
    ui: &mut Ui,
    (name, tip): (&str, &str),
    words: &[(&str, &str)],
    chosen: usize,
) -> Option<usize> {
    let width = (ui.available_width() / words.len() as f32).floor();
    let mut clicked = None;
    ui.horizontal(|ui| {
        ui.spacing_mut().item_spacing.x = 0.0;
        for (i, (word, does)) in words.iter().enumerate() {
            let choice = choice(ui, name, word, i == chosen, width);
            let told = format!("{name}: {word}. {does}");
            let lines = [told.trim_end(), tip].join("\n");
            if choice.tip(lines.trim_end()).clicked() {
                clicked = Some(i);
            }
        }
    });
    clicked.filter(|i| *i != chosen)
}

fn choice(ui: &mut Ui, name: &str, word: &str, chosen: bool, width: f32) -> Response {
    let (rect, response) = ui.allocate_exact_size(vec2(width, ROW - 2.0), Sense::click());
    response.widget_info(|| {
        WidgetInfo::selected(Role::RadioButton, true, chosen, format!("{name} {word}"))
    });
    let palette = Palette::of(ui);
    let fill = if chosen {
        palette.accent_ground
    } else if response.hovered() {
        palette.hover
    } else {
        palette.track
    };
    ui.painter()
        .rect_filled(rect.shrink2(vec2(0.5, 0.0)), CornerRadius::same(3), fill);
    if response.has_focus() {
        ui.painter().rect_stroke(
            rect,
            CornerRadius::same(3),
            Stroke::new(1.0, palette.accent),
            StrokeKind::Inside,
        );
    }
    let colour = if chosen { palette.text } else { palette.weak };
    let font = FontId::proportional(12.0);
    ui.painter()
        .text(rect.center(), Align2::CENTER_CENTER, word, font, colour);
    response
}

/// Height of a panel's heading.
pub(crate) const HEADING: f32 = 28.0;

/// The heading of a panel's part.
pub(crate) fn heading(ui: &mut Ui, text: &str, buttons: impl FnOnce(&mut Ui)) {
    let palette = Palette::of(ui);
    let (rect, _) = ui.allocate_exact_size(vec2(ui.available_width(), HEADING), Sense::hover());
    ui.painter()
        .rect_filled(rect, CornerRadius::ZERO, palette.header);
    ui.painter().text(
        pos2(rect.left() + 10.0, rect.center().y),
        Align2::LEFT_CENTER,
        text,
        FontId::proportional(13.0),
        palette.text,
    );
    let mut child = ui.new_child(
        egui::UiBuilder::new()
            .max_rect(rect.shrink2(vec2(6.0, 2.0)))
            .layout(egui::Layout::right_to_left(egui::Align::Center)),
    );
    child.spacing_mut().item_spacing.x = 2.0;
    buttons(&mut child);
}

/// Text that begins at the left of a column of this width.
pub(crate) fn left_label(ui: &mut Ui, width: f32, text: egui::RichText) -> Response {
    let size = vec2(width, ui.spacing().interact_size.y);
    let layout = egui::Layout::left_to_right(egui::Align::Center);
    let add = |ui: &mut Ui| {
        ui.set_min_width(width);
        ui.add(egui::Label::new(text).truncate())
    };
    ui.allocate_ui_with_layout(size, layout, add).inner
}

/// A frame for the rows of a panel's part.
pub(crate) fn body(ui: &mut Ui, contents: impl FnOnce(&mut Ui)) {
    egui::Frame::new()
        .inner_margin(egui::Margin::symmetric(10, 8))
        .show(ui, |ui| {
            ui.spacing_mut().item_spacing.y = 4.0;
            contents(ui);
        });
}

/// A small heading between rows.
pub(crate) fn caption(ui: &mut Ui, text: &str) {
    ui.add_space(4.0);
    ui.label(
        egui::RichText::new(text)
            .small()
            .color(Palette::of(ui).weak),
    );
}

/// Text over a picture, on a ground that keeps it readable.
pub(crate) fn overlay_text(
    painter: &egui::Painter,
    at: egui::Pos2,
    align: Align2,
    text: &str,
) -> Rect {
    let font = FontId::proportional(12.0);
    // Longer than the picture is wide it goes on in another line.
    let width = (painter.clip_rect().width() - 36.0).max(120.0);
    let ink = Color32::from_rgb(0xe8, 0xe9, 0xea);
    let galley = painter.layout(text.to_owned(), font, ink, width);
    let rect = align.anchor_size(at, galley.size() + vec2(12.0, 6.0));
    painter.rect_filled(
        rect,
        CornerRadius::same(4),
        Color32::from_rgba_unmultiplied(12, 13, 15, 190),
    );
    painter.galley(rect.min + vec2(6.0, 3.0), galley, Color32::WHITE);
    rect
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_read_as_people_type_them() {
        assert_eq!(parse_number(" 0,35 "), Some(0.35));
        assert_eq!(parse_number("12.5 degrees"), Some(12.5));
        assert_eq!(parse_number("1e-3"), Some(1e-3));
        assert_eq!(parse_number("x"), None);
        assert_eq!(parse_number("1e999"), None);
    }

    #[test]
    fn a_bar_goes_from_end_to_end_and_back() {
        for (low, high) in [
            (0.0, 1.0),
            (1e-3, 1.5),
            (-360.0, 360.0),
            (1e-4, 1.0),
            (1.0, 8.0),
        ] {
            let bar = Bar::new("x", low..=high);
            assert_eq!(bar.value_at(0.0), low);
            assert_eq!(bar.value_at(1.0), high);
            for i in 0..=20 {
                let t = f64::from(i) / 20.0;
                assert!(
                    (bar.fraction(bar.value_at(t)) - t).abs() < 0.02,
                    "{low} {high} {t}"
                );
            }
        }
        assert_eq!(Bar::new("x", 0.0..=1.0).number(0.35), "0.35");
        assert_eq!(Bar::new("x", 0.0..=1.0).percent().number(0.355), "35.5");
        assert_eq!(Bar::new("x", 1.0..=9.0).integer(true).number(4.0), "4");
    }

    #[test]
    fn a_unit_is_as_long_as_there_is_room() {
        let mut forms = Vec::new();
        let show = |ui: &mut Ui| {
            let font = FontId::proportional(12.5);
            let length = Bar::new("Length", 0.001..=10.0).unit("surface units");
            let angle = Bar::new("Angle", -180.0..=180.0).unit("degrees");
            let widths = [300.0, 150.0, 60.0];
            forms = widths.map(|w| length.unit_in(ui, &font, w)).to_vec();
            forms.push(angle.unit_in(ui, &font, 20.0));
            let wide = |text: &str| {
                let text = text.to_owned();
                let galley = ui
                    .painter()
                    .layout_no_wrap(text, font.clone(), Color32::WHITE);
                galley.size().x
            };
            for (low, high) in [
                (0.1, 1.0),
                (0.001, 1.5),
                (-2.0, 0.5),
                (0.0, 1.0),
                (5.0, 90.0),
            ] {
                let bar = Bar::new("Width", low..=high).unit("slope width");
                for width in 80..200 {
                    let width = width as f32;
                    let unit = bar.unit_in(ui, &font, width);
                    for i in 0..=1000 {
                        let value = low + (high - low) * f64::from(i) / 1000.0;
                        let text = with_unit(&bar.number(value), unit);
                        let fits = wide(&text) + wide("Width") + MARGINS <= width + 0.01;
                        assert!(unit.is_empty() || fits, "{text} in {width}");
                    }
                }
            }
        };
        drop(egui_kittest::Harness::new_ui(show));
        assert_eq!(forms, ["surface units", "units", "", "\u{b0}"]);
        assert_eq!(with_unit("4", "mm"), "4 mm");
        assert_eq!(with_unit("35.5", "%"), "35.5%");
    }
}
