//! The line at the bottom: what is under the pointer, and how the picture does.

use super::desk::Desk;
use super::properties::bytes_text;
use super::theme::Palette;
use anisomap::studio::view::Probe;
use eframe::egui::{self, Color32, RichText, Sense, Shape, Stroke, Ui, vec2};

pub(crate) fn show(ui: &mut Ui, desk: &Desk, zoom: f64, probe: Option<&Probe>) {
    let palette = Palette::of(ui);
    ui.spacing_mut().item_spacing.x = 14.0;
    let text = |ui: &mut Ui, text: String, colour: Color32, tip: &str| {
        let font = egui::FontId::monospace(11.5);
        ui.label(RichText::new(text).font(font).color(colour))
            .on_hover_text(tip);
    };
    let (size, shown) = (desk.studio.recipe().size, desk.studio.map().size());
    text(
        ui,
        format!("{} x {}", size.width(), size.height()),
        palette.weak,
        "Size of the map in texels.",
    );
    if desk.studio.is_draft() {
        text(
            ui,
            "draft".to_owned(),
            palette.accent,
            "A smaller map is shown, and can be painted on, until the whole one is made.",
        );
    }
    // In texels of the map that is to be, whatever stands in for it.
    let part = f64::from(shown.height()) / f64::from(size.height());
    let zoom = zoom * 100.0 * part;
    let zoom = if zoom < 10.0 {
        format!("{zoom:.1}%")
    } else {
        format!("{zoom:.0}%")
    };
    text(
        ui,
        format!("{zoom:>6}"),
        palette.weak,
        "Zoom of the canvas: 100% is one texel on one pixel.",
    );
    let whole = |texel: u32| (f64::from(texel) / part).floor() as u32;
    match probe {
        Some(p) => {
            text(
                ui,
                format!("({:>4}, {:>4})", whole(p.texel.x), whole(p.texel.y)),
                palette.weak,
                "Column and row of the texel under the pointer.",
            );
            let values = format!(
                "\u{3b1}x {:.3}  \u{3b1}y {:.3}  {:>5.1}\u{b0}",
                p.alpha_x, p.alpha_y, p.angle_degrees
            );
            text(
                ui,
                values,
                palette.text,
                "alpha_x, alpha_y and the angle of the x axis of the texel under the pointer.",
            );
            lobe(ui, &p.ellipse, palette.accent);
        }
        None => {
            text(
                ui,
                "point at the map to read a texel".to_owned(),
                palette.weak.gamma_multiply(0.7),
                "Shows the texel under the pointer.",
            );
        }
    }
    ui.with_layout(egui::Layout::right_to_left(egui::Align::Center), |ui| {
        text(ui, bytes_text(desk.studio.bytes() as u64), palette.weak, "Memory of the map, its caches and the history.");
        let viewport = desk.studio.viewport();
        let size = viewport.size();
        text(ui, format!("{} x {}", size.width(), size.height()), palette.weak, "Size of the 3D picture in pixels.");
        if let Some(time) = desk.draw_time {
            text(ui, format!("{:>5.1} ms", time.as_secs_f64() * 1e3), palette.weak, "How long the last drawing of the 3D picture took that somebody waited for.");
        }
        let quality = viewport.quality();
        let samples = match quality.samples {
            0 => "moving".to_owned(),
            _ if quality.is_reference => "reference".to_owned(),
            n => format!("{n}x{n} samples"),
        };
        let next = quality.next.map_or(String::new(), |part| format!(", next {:>2.0}%", part * 100.0));
        text(ui, samples + &next, palette.weak, "How good the 3D picture is; it gets better while nothing changes, up to the f64 reference.");
        if let Some(reading) = &desk.reading {
            text(ui, reading.clone(), palette.accent, "A file is read and checked in the background; you can go on.");
        }
        if let Some(part) = desk.working {
            ui.add(egui::ProgressBar::new(part).desired_width(90.0).desired_height(8.0));
            text(ui, "making the map".to_owned(), palette.accent, "The map is worked out in the background; you can go on.");
        }
    });
}

/// The lobe of a texel: an ellipse, wide where the surface is rough.
fn lobe(ui: &mut Ui, ellipse: &[glam::Vec2], colour: Color32) {
    let (rect, response) = ui.allocate_exact_size(vec2(26.0, 20.0), Sense::hover());
    let points = ellipse
        .iter()
        .map(|p| rect.center() + vec2(p.x, -p.y) * 9.0)
        .collect();
    ui.painter()
        .add(Shape::closed_line(points, Stroke::new(1.5, colour)));
    response.on_hover_text("The lobe: the highlight stretches along the long way of the ellipse, grooves run along the short one.");
}
