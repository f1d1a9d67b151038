//! The line at the bottom: what is under the pointer, and how the picture does.

use super::desk::Desk;
use super::properties::bytes_text;
use super::theme::Palette;
use anisomap::studio::view::Probe;
use eframe::egui::{self, Color32, FontId, RichText, Sense, Shape, Stroke, Ui, vec2};

const FONT: FontId = FontId::monospace(11.5);
const POINT: &str = "point at the map to read a texel";

pub(crate) fn show(ui: &mut Ui, desk: &Desk, zoom: f64, probe: Option<&Probe>) {
    let palette = Palette::of(ui);
    ui.spacing_mut().item_spacing.x = 14.0;
    let text = |ui: &mut Ui, text: String, colour: Color32, tip: &str| {
        ui.label(RichText::new(text).font(FONT).color(colour))
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
            // Where work that goes on needs the room, it has it.
            let room = ui.available_width() - wide(ui, POINT);
            let needed = of_picture(ui, desk, f32::INFINITY);
            let needed: f32 = needed.iter().map(|s| wide(ui, &s.text)).sum();
            if desk.working.is_none() && needed <= room {
                let tip = "Shows the texel under the pointer.";
                let colour = palette.weak.gamma_multiply(0.7);
                text(ui, POINT.to_owned(), colour, tip);
            }
        }
    }
    let of_picture = of_picture(ui, desk, ui.available_width());
    ui.with_layout(egui::Layout::right_to_left(egui::Align::Center), |ui| {
        for said in of_picture {
            text(ui, said.text, said.colour, said.tip);
        }
        if let Some(part) = desk.working {
            let bar = egui::ProgressBar::new(part);
            ui.add(bar.desired_width(WORKING).desired_height(8.0));
            let tip = "The map is worked out in the background; you can go on.";
            text(ui, MAKING.to_owned(), palette.accent, tip);
        }
    });
}

/// The width of the bar that says how far the map is, and what stands beside it.
const WORKING: f32 = 90.0;
const MAKING: &str = "making the map";

/// Something that the line says.
struct Said {
    text: String,
    colour: Color32,
    tip: &'static str,
    /// What has the least weight goes first where there is no room for all.
    weight: u8,
}

fn wide(ui: &Ui, text: &str) -> f32 {
    let galley = ui
        .painter()
        .layout_no_wrap(text.to_owned(), FONT, Color32::WHITE);
    galley.size().x + ui.spacing().item_spacing.x
}

/// What is said of the 3D picture and of work that goes on, from the right, as far as it fits into `room`.
fn of_picture(ui: &Ui, desk: &Desk, room: f32) -> Vec<Said> {
    let palette = Palette::of(ui);
    let viewport = desk.studio.viewport();
    let (size, quality) = (viewport.size(), viewport.quality());
    let samples = match quality.samples {
        0 => "moving".to_owned(),
        _ if quality.is_reference => "reference".to_owned(),
        n => format!("{n}x{n} samples"),
    };
    let next = quality.next.map_or(String::new(), |part| {
        format!(", next {:>2.0}%", part * 100.0)
    });
    let weak = |text: String, tip: &'static str, weight: u8| Said {
        text,
        colour: palette.weak,
        tip,
        weight,
    };
    let mut all = vec![
        weak(
            bytes_text(desk.studio.bytes() as u64),
            "Memory of the map, its caches and the history.",
            2,
        ),
        weak(
            format!("{} x {}", size.width(), size.height()),
            "Size of the 3D picture in pixels.",
            0,
        ),
    ];
    if let Some(time) = desk.draw_time {
        all.push(weak(
            format!("{:>5.1} ms", time.as_secs_f64() * 1e3),
            "How long the last drawing of the 3D picture took that somebody waited for.",
            1,
        ));
    }
    all.push(weak(
        samples + &next,
        "How good the 3D picture is; it gets better while nothing changes, up to the f64 reference.",
        3,
    ));
    if let Some(reading) = &desk.reading {
        all.push(Said {
            text: reading.clone(),
            colour: palette.accent,
            tip: "A file is read and checked in the background; you can go on.",
            weight: 4,
        });
    }
    let working = match desk.working {
        Some(_) => WORKING + wide(ui, MAKING) + ui.spacing().item_spacing.x,
        None => 0.0,
    };
    let width = |all: &[Said]| working + all.iter().map(|s| wide(ui, &s.text)).sum::<f32>();
    while width(&all) > room
        && let Some(least) = all.iter().map(|s| s.weight).min()
    {
        all.retain(|s| s.weight != least);
    }
    all
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
