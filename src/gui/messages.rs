//! What the window tells: errors stay until they are closed, news go away by themselves.

use super::icons::Icon;
use super::theme::Palette;
use super::widgets::icon_button;
use eframe::egui::{
    self, Align2, Area, Context, CornerRadius, Frame, Id, Margin, RichText, Stroke, vec2,
};
use std::time::{Duration, Instant};

/// A number of things, as people say it: `1 change`, `2 changes`.
pub(crate) fn count(n: usize, one: &str) -> String {
    match n {
        1 => format!("1 {one}"),
        _ => format!("{n} {one}s"),
    }
}

/// A message without the numbers that systems give their errors beside the words.
fn without_numbers(text: &str) -> String {
    let mut told = String::new();
    let mut rest = text;
    while let Some((before, after)) = rest.split_once(" (os error ") {
        told += before;
        rest = after.split_once(')').map_or("", |(_, rest)| rest);
    }
    told + rest
}

/// How long news stay.
const NEWS: Duration = Duration::from_secs(6);
/// The most messages that are shown.
const MOST: usize = 4;

/// What an error is about: it goes by itself once that is over.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum About {
    /// It stays until it is closed, or another document is opened.
    Anything,
    /// The document could not be saved.
    Saving,
    /// Something of the document is not shown.
    LeftOut,
}

struct Message {
    /// As it was told.
    whole: String,
    about: About,
    text: String,
    is_error: bool,
    since: Instant,
    id: u64,
}

/// The messages that are shown, oldest first.
#[derive(Default)]
pub(crate) struct Messages {
    shown: Vec<Message>,
    count: u64,
}

impl Messages {
    /// Something went wrong, and what to do.
    pub(crate) fn error(&mut self, error: impl ToString) {
        self.error_about(About::Anything, error);
    }

    /// Something went wrong that may be over by itself.
    pub(crate) fn error_about(&mut self, about: About, error: impl ToString) {
        self.add(error.to_string(), true, about);
    }

    /// Takes away the errors about something, but for those that still hold.
    pub(crate) fn retain_about(&mut self, about: About, still: impl Fn(&str) -> bool) {
        self.shown
            .retain(|m| !m.is_error || m.about != about || still(&m.whole));
    }

    /// Takes away every error: they were about another document.
    pub(crate) fn forget_errors(&mut self) {
        self.shown.retain(|m| !m.is_error);
    }

    /// Something was done.
    pub(crate) fn news(&mut self, text: impl Into<String>) {
        self.add(text.into(), false, About::Anything);
    }

    fn add(&mut self, whole: String, is_error: bool, about: About) {
        let text = without_numbers(&whole);
        // The same twice is one message: a full disk would fill the window with them.
        self.shown.retain(|m| m.text != text);
        self.count += 1;
        self.shown.push(Message {
            whole,
            about,
            text,
            is_error,
            since: Instant::now(),
            id: self.count,
        });
        if self.shown.len() > MOST {
            self.shown.remove(0);
        }
    }

    /// The texts that are shown, oldest first.
    #[cfg(test)]
    pub(crate) fn texts(&self) -> Vec<&str> {
        self.shown.iter().map(|m| m.text.as_str()).collect()
    }

    /// Shows them over everything, in the lower right.
    pub(crate) fn show(&mut self, ctx: &Context) {
        self.shown
            .retain(|m| m.is_error || m.since.elapsed() < NEWS);
        if let Some(next) = self
            .shown
            .iter()
            .filter(|m| !m.is_error)
            .map(|m| NEWS.saturating_sub(m.since.elapsed()))
            .min()
        {
            ctx.request_repaint_after(next + Duration::from_millis(20));
        }
        let mut closed = None;
        let mut up = 40.0;
        for message in self.shown.iter().rev() {
            let area = Area::new(Id::unique(("message", message.id)))
                .order(egui::Order::Foreground)
                .anchor(Align2::RIGHT_BOTTOM, vec2(-14.0, -up));
            let shown = area.show(ctx, |ui| {
                if row(ui, message) {
                    closed = Some(message.id);
                }
            });
            up += shown.response.rect.height() + 8.0;
        }
        if let Some(id) = closed {
            self.shown.retain(|m| m.id != id);
        }
    }
}

/// One message; `true` when it was closed.
fn row(ui: &mut egui::Ui, message: &Message) -> bool {
    let palette = Palette::of(ui);
    let colour = if message.is_error {
        palette.error
    } else {
        palette.accent
    };
    let frame = Frame::new()
        .fill(ui.visuals().window_fill)
        .stroke(Stroke::new(1.0, colour.gamma_multiply(0.6)))
        .corner_radius(CornerRadius::same(6))
        .shadow(ui.visuals().popup_shadow)
        .inner_margin(Margin::symmetric(10, 8));
    frame
        .show(ui, |ui| {
            ui.set_max_width(420.0);
            ui.horizontal_top(|ui| {
                let (rect, _) = ui.allocate_exact_size(vec2(18.0, 18.0), egui::Sense::hover());
                let icon = if message.is_error {
                    Icon::Warning
                } else {
                    Icon::Info
                };
                icon.paint(ui.painter(), rect, colour);
                ui.scope(|ui| {
                    ui.set_max_width(350.0);
                    ui.add(
                        egui::Label::new(RichText::new(&message.text).color(palette.text)).wrap(),
                    );
                });
                icon_button(ui, Icon::Close, "Close message", 20.0, false)
                    .on_hover_text("Closes this message.")
                    .clicked()
            })
            .inner
        })
        .inner
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn errors_go_when_what_they_are_about_is_over() {
        let mut messages = Messages::default();
        messages.error("a");
        messages.error_about(About::Saving, "cannot write b (os error 2)");
        messages.error_about(About::LeftOut, "c (os error 2)");
        messages.news("saved");
        messages.retain_about(About::Saving, |_| false);
        assert_eq!(messages.texts(), ["a", "c", "saved"]);
        messages.retain_about(About::LeftOut, |text| text == "c (os error 2)");
        assert_eq!(messages.texts(), ["a", "c", "saved"]);
        messages.forget_errors();
        assert_eq!(messages.texts(), ["saved"]);
    }

    #[test]
    fn numbers_of_errors_are_for_programs() {
        let text = "cannot read a: No such file (os error 2). Try b: gone (os error 32)";
        assert_eq!(
            without_numbers(text),
            "cannot read a: No such file. Try b: gone"
        );
        assert_eq!(without_numbers("as it is"), "as it is");
    }
}
