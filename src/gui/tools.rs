//! The column of tools on the left, and the bar above with the numbers of the tool in the hand.

use super::desk::Desk;
use super::icons::Icon;
use super::theme::Palette;
use super::widgets::{Bar, Tip, choices, icon_button, left_label};
use anisomap::map::{ALPHA_MAX, ALPHA_MIN};
use anisomap::paint::{Keep, Tool};
use anisomap::studio::action::Action;
use anisomap::studio::hand::{Mirror, RADIUS_RANGE, SCREEN_POINTS, ToolKind};
use eframe::egui::{self, Ui, vec2};

/// The icon of a tool.
pub(crate) fn icon(kind: ToolKind) -> Icon {
    match kind {
        ToolKind::Groove => Icon::Groove,
        ToolKind::Comb => Icon::Comb,
        ToolKind::Smooth => Icon::Smooth,
        ToolKind::Roughen => Icon::Roughen,
        ToolKind::Polish => Icon::Polish,
        ToolKind::SetAlpha => Icon::SetAlpha,
        ToolKind::SetDirection => Icon::SetDirection,
        ToolKind::Erase => Icon::Erase,
        ToolKind::Fill => Icon::Fill,
        ToolKind::Scratch => Icon::Scratch,
        ToolKind::Pick => Icon::Pick,
        ToolKind::Guide => Icon::Guide,
    }
}

/// The column.
pub(crate) fn column(ui: &mut Ui, desk: &mut Desk) {
    ui.spacing_mut().item_spacing = vec2(0.0, 3.0);
    ui.add_space(6.0);
    // In a low window the buttons are smaller, and none is cut off.
    let room = ui.available_height() - 3.0 * 7.0 - 6.0;
    let side = (room / ToolKind::ALL.len() as f32 - 3.0).clamp(22.0, 34.0);
    ui.vertical_centered(|ui| {
        for kind in ToolKind::ALL {
            if matches!(kind, ToolKind::SetAlpha | ToolKind::Erase | ToolKind::Pick) {
                ui.add_space(7.0);
            }
            let action = kind.action();
            let button = icon_button(ui, icon(kind), kind.name(), side, desk.hand.kind() == kind);
            let tip = format!("{}\n{}", kind.name(), desk.tip(action));
            if kind == ToolKind::ALL[0] {
                desk.first_control = Some(button.id);
            }
            if button.on_hover_text(tip).clicked() {
                desk.ask(action);
            }
        }
    });
}

/// The bar.
pub(crate) fn bar(ui: &mut Ui, desk: &mut Desk) {
    ui.spacing_mut().item_spacing.x = 6.0;
    ui.set_min_height(26.0); // as high with every tool: the pictures below stay as large
    let kind = desk.hand.kind();
    let (rect, _) = ui.allocate_exact_size(vec2(22.0, 22.0), egui::Sense::hover());
    icon(kind).paint(ui.painter(), rect, Palette::of(ui).accent);
    let on_mask = desk.studio.is_mask_selected();
    let fit = fit_bars(ui, &desk.hand.brush().tool, kind, on_mask);
    if !kind.paints() || fit.has_name {
        left_label(ui, NAME, egui::RichText::new(kind.name()).strong());
    }
    if kind == ToolKind::Guide {
        let mut guides = std::mem::take(&mut desk.guides);
        super::guides::bar(ui, desk, &mut guides);
        desk.guides = guides;
        return;
    }
    if !kind.paints() {
        let text =
            "Click the canvas: every tool takes the widths and the direction that are there.";
        let text = egui::RichText::new(text).color(Palette::of(ui).weak);
        ui.add(egui::Label::new(text).truncate());
        return;
    }
    if on_mask {
        of_mask(ui, desk);
    }
    if kind != ToolKind::Fill {
        size_and_flow(ui, desk, fit);
        ui.add_space(6.0);
    }
    if !on_mask {
        of_tool(ui, desk, fit);
    }
    ui.with_layout(egui::Layout::right_to_left(egui::Align::Center), |ui| {
        symmetry(ui, desk);
    });
}

/// Widths of bars where there is room for them, points.
const SIZE: f32 = 126.0;
const HARDNESS: f32 = 118.0;
const FLOW: f32 = 96.0;
const ALPHA: f32 = 124.0;
const NUMBER: f32 = 116.0;
/// Width of the tool's name before them.
const NAME: f32 = 84.0;

/// How the row above the pictures is made to fit into the window.
#[derive(Clone, Copy)]
struct Fit {
    /// Whether the tool's name has room, too.
    has_name: bool,
    /// What the widths of bars are multiplied by.
    factor: f32,
}

impl Fit {
    /// The width of a bar.
    fn width(self, width: f32) -> f32 {
        (width * self.factor).floor()
    }
}

/// Makes the bars of this row narrower where they would not fit into the window.
fn fit_bars(ui: &Ui, tool: &Tool, kind: ToolKind, on_mask: bool) -> Fit {
    // Bars, and how broad what stands between them is.
    let (bars, others): (&[f32], f32) = match tool {
        _ if on_mask => (&[], 150.0),
        Tool::Groove(_) => (&[ALPHA; 2], 22.0),
        Tool::Scratch(_) => (&[ALPHA, ALPHA, NUMBER, NUMBER, NUMBER, NUMBER], 22.0),
        Tool::SetAlpha(_) => (&[ALPHA; 2], 80.0),
        Tool::Fill(_) => (&[ALPHA, ALPHA, NUMBER], 116.0),
        Tool::SetDirection(_) | Tool::Smooth(_) => (&[NUMBER], 0.0),
        Tool::Roughen(_) => (&[NUMBER], 140.0),
        Tool::Comb | Tool::Erase => (&[], 0.0),
    };
    let of_brush: &[f32] = match kind {
        ToolKind::Fill => &[],
        _ => &[SIZE, HARDNESS, FLOW],
    };
    let wanted: f32 = bars.iter().chain(of_brush).sum();
    let gap = ui.spacing().item_spacing.x;
    let gaps = gap * (bars.len() + of_brush.len() + 5) as f32;
    let symmetry = 3.0 * 26.0;
    let room = ui.available_width() - others - gaps - symmetry;
    let has_name = room - NAME >= wanted;
    let factor = match has_name {
        true => 1.0,
        false => (room / wanted.max(1.0)).clamp(0.3, 1.0),
    };
    Fit { has_name, factor }
}

/// What a stroke on a mask does: of the brush its size, hardness and flow alone count there.
fn of_mask(ui: &mut Ui, desk: &mut Desk) {
    let layer = desk.studio.recipe().layers.get(desk.studio.selected());
    let mask = layer.and_then(|l| l.mask.as_ref());
    let inverted = mask.is_some_and(|m| m.invert);
    let erases = desk.hand.kind() == ToolKind::Erase;
    let now = usize::from(erases != inverted);
    ui.label("Mask");
    let row = vec2(110.0, super::theme::ROW);
    let swap = desk.keymap.keys_text(Action::SwapAlphas);
    let tip = format!("{swap} changes between them, and Ctrl does the opposite while it is held.");
    let words = [
        ("Show", "Brushes show the layer where they paint."),
        ("Hide", "The eraser hides the layer where it paints."),
    ];
    let chosen = ui.allocate_ui(row, |ui| choices(ui, ("Mask", &tip), &words, now));
    if let Some(hide) = chosen.inner {
        let erase = (hide == 1) != inverted;
        desk.ask(if erase {
            Action::ToolErase
        } else {
            Action::ToolGroove
        });
    }
}

fn size_and_flow(ui: &mut Ui, desk: &mut Desk, fit: Fit) {
    let (breadth, unit, text) = if desk.hand.on_screen {
        let text = "Breadth of the brush in points of the screen, whatever is zoomed to.";
        (2.0 * f64::from(SCREEN_POINTS), "pt", text)
    } else {
        let text = "Breadth of the brush in surface units: 1 is the height of the map.";
        (2.0, "surface units", text)
    };
    let mut size = f64::from(desk.hand.brush().radius) * breadth;
    let range = f64::from(RADIUS_RANGE[0]) * breadth..=f64::from(RADIUS_RANGE[1]) * breadth;
    let text = format!("{text} What it is measured by is chosen under Brush.");
    let tip = tips(
        desk,
        &text,
        &[Action::SizeDown, Action::SizeUp, Action::DragSize],
    );
    let bar = Bar::new("Size", range).unit(unit).width(fit.width(SIZE));
    let bar = bar.show(ui, &mut size);
    if bar.response.changed() {
        desk.hand.set_radius((size / breadth) as f32);
    }
    bar.response.on_hover_text(tip);
    let tip = tips(
        desk,
        "Where the fall toward the rim begins.",
        &[Action::HardnessDown, Action::HardnessUp],
    );
    part_bar(
        ui,
        "Hardness",
        fit.width(HARDNESS),
        tip,
        &mut desk.hand.brush_mut().hardness,
    );
    let tip = tips(
        desk,
        "How much of its work one stroke does.",
        &[Action::FlowDown, Action::FlowUp, Action::DragFlow],
    );
    part_bar(
        ui,
        "Flow",
        fit.width(FLOW),
        tip,
        &mut desk.hand.brush_mut().flow,
    );
}

/// A sentence, and the actions that do the same with their keys.
pub(crate) fn tips(desk: &Desk, text: &str, actions: &[Action]) -> String {
    let keys = actions.iter().filter_map(|a| {
        let keys = desk.keymap.keys_text(*a);
        (!keys.is_empty()).then(|| format!("{}: {keys}", a.name()))
    });
    let text = (!text.is_empty()).then(|| text.to_owned());
    text.into_iter().chain(keys).collect::<Vec<_>>().join("\n")
}

fn part_bar(ui: &mut Ui, name: &str, width: f32, tip: String, value: &mut f32) {
    let mut number = f64::from(*value);
    let bar = Bar::new(name, 0.0..=1.0)
        .percent()
        .width(width)
        .show(ui, &mut number);
    if bar.response.changed() {
        *value = number as f32;
    }
    bar.response.on_hover_text(tip);
}

fn alpha_bar(ui: &mut Ui, fit: Fit, name: &str, tip: &str, value: &mut f32) {
    let mut number = shown(*value);
    let range = f64::from(ALPHA_MIN)..=f64::from(ALPHA_MAX);
    let bar = Bar::new(name, range)
        .unit("slope width")
        .width(fit.width(ALPHA))
        .show(ui, &mut number);
    if bar.response.changed() {
        *value = number as f32;
    }
    bar.response.tip(tip);
}

/// An f32 as it was written.
pub(crate) fn shown(value: f32) -> f64 {
    value.to_string().parse().unwrap_or(f64::from(value))
}

/// A width that may be left alone.
fn optional_alpha(
    ui: &mut Ui,
    fit: Fit,
    name: &str,
    tip: &str,
    value: &mut Option<f32>,
    default: f32,
) {
    let mut on = value.is_some();
    if ui
        .checkbox(&mut on, "")
        .accessible_name(format!("Paint {name}"))
        .on_hover_text(format!(
            "Whether {name} is painted; else it stays as it is."
        ))
        .changed()
    {
        *value = on.then_some(default);
    }
    match value {
        Some(value) => alpha_bar(ui, fit, name, tip, value),
        None => {
            ui.add_enabled_ui(false, |ui| {
                alpha_bar(ui, fit, name, tip, &mut default.clone());
            });
        }
    }
}

fn swap(ui: &mut Ui, desk_tip: String) -> bool {
    icon_button(ui, Icon::Swap, Action::SwapAlphas.name(), 22.0, false)
        .on_hover_text(desk_tip)
        .clicked()
}

const ALONG: &str = "Slope width along the stroke, which becomes alpha_x. Small is smooth: the highlight is narrow this way.";
const ACROSS: &str = "Slope width across the stroke, which becomes alpha_y. Large is rough: the highlight stretches this way.";

fn of_tool(ui: &mut Ui, desk: &mut Desk, fit: Fit) {
    let swap_tip = desk.tip(Action::SwapAlphas);
    let mut swapped = false;
    let angle_tip = "Angle of the x axis in degrees, counter-clockwise from +U.";
    match &mut desk.hand.brush_mut().tool {
        Tool::Groove(g) => {
            alpha_bar(ui, fit, "Along", ALONG, &mut g.along);
            swapped = swap(ui, swap_tip);
            alpha_bar(ui, fit, "Across", ACROSS, &mut g.across);
        }
        Tool::Scratch(s) => {
            alpha_bar(ui, fit, "Along", ALONG, &mut s.along);
            swapped = swap(ui, swap_tip);
            alpha_bar(ui, fit, "Across", ACROSS, &mut s.across);
            number_bar(
                ui,
                fit,
                "Density",
                1.0..=200.0,
                "How many scratches on a way as long as the brush is broad.",
                &mut s.density,
            );
            number_bar(
                ui,
                fit,
                "Length",
                0.001..=1.0,
                "Mean length of a scratch, surface units.",
                &mut s.length,
            );
            number_bar(
                ui,
                fit,
                "Width",
                0.00001..=0.1,
                "Breadth of a scratch, surface units. Thinner than a texel is fainter, not broader.",
                &mut s.width,
            );
            number_bar(
                ui,
                fit,
                "Lean",
                0.0..=90.0,
                "How far scratches lean from the stroke at most, to either side.",
                &mut s.spread,
            );
        }
        Tool::SetAlpha(s) => {
            optional_alpha(
                ui,
                fit,
                "alpha_x",
                "Slope width along the x axis.",
                &mut s.alpha_x,
                0.08,
            );
            swapped = swap(ui, swap_tip);
            optional_alpha(
                ui,
                fit,
                "alpha_y",
                "Slope width across the x axis.",
                &mut s.alpha_y,
                0.35,
            );
        }
        Tool::Fill(f) => {
            optional_alpha(
                ui,
                fit,
                "alpha_x",
                "Slope width along the x axis.",
                &mut f.alpha_x,
                0.08,
            );
            swapped = swap(ui, swap_tip);
            optional_alpha(
                ui,
                fit,
                "alpha_y",
                "Slope width across the x axis.",
                &mut f.alpha_y,
                0.35,
            );
            let mut on = f.angle.is_some();
            if ui
                .checkbox(&mut on, "")
                .accessible_name("Paint the direction")
                .on_hover_text("Whether the direction is filled; else it stays as it is.")
                .changed()
            {
                f.angle = on.then_some(0.0);
            }
            if let Some(angle) = &mut f.angle {
                number_bar(ui, fit, "Angle", -180.0..=180.0, angle_tip, angle);
            }
        }
        Tool::SetDirection(s) => {
            number_bar(ui, fit, "Angle", -180.0..=180.0, angle_tip, &mut s.angle);
        }
        Tool::Smooth(s) => number_bar(
            ui,
            fit,
            "Reach",
            0.0005..=0.1,
            "How far around itself a texel looks, surface units.",
            &mut s.reach,
        ),
        Tool::Roughen(r) => {
            number_bar(
                ui,
                fit,
                "Factor",
                0.1..=10.0,
                "What both widths are multiplied by.",
                &mut r.factor,
            );
            let keep = [("ratio", Keep::Ratio), ("area", Keep::Area)];
            ui.label("keeps");
            for (word, value) in keep {
                let tip = match value {
                    Keep::Ratio => "Both widths grow or shrink: the lobe keeps its shape.",
                    Keep::Area => {
                        "One grows as the other shrinks: the lobe is stretched or made round."
                    }
                };
                ui.selectable_value(&mut r.keep, value, word)
                    .on_hover_text(tip);
            }
        }
        Tool::Comb | Tool::Erase => {}
    }
    if swapped {
        desk.hand.swap_alphas();
    }
}

fn number_bar(
    ui: &mut Ui,
    fit: Fit,
    name: &str,
    range: std::ops::RangeInclusive<f64>,
    tip: &str,
    value: &mut f32,
) {
    let mut number = shown(*value);
    let unit = match name {
        "Angle" | "Lean" => "degrees",
        "Length" | "Width" | "Reach" => "surface units",
        _ => "",
    };
    let bar = Bar::new(name, range)
        .unit(unit)
        .width(fit.width(NUMBER))
        .show(ui, &mut number);
    if bar.response.changed() {
        *value = number as f32;
    }
    bar.response.on_hover_text(tip);
}

fn symmetry(ui: &mut Ui, desk: &mut Desk) {
    for (icon, action, on) in [
        (
            Icon::Hand,
            Action::ToggleStabiliser,
            desk.hand.stabiliser > 0.0,
        ),
        (Icon::Radial, Action::ToggleRadial, desk.hand.copies >= 2),
        (
            Icon::Mirror,
            Action::ToggleMirror,
            desk.hand.mirror != Mirror::Off,
        ),
    ] {
        let button = icon_button(ui, icon, action.name(), 26.0, on);
        if button.on_hover_text(desk.tip(action)).clicked() {
            desk.ask(action);
        }
    }
}

/// The rest of the brush: what is set once and then left.
pub(crate) fn brush_panel(ui: &mut Ui, desk: &mut Desk) {
    super::widgets::caption(ui, "Size is measured");
    let on = usize::from(desk.hand.on_screen);
    if let Some(i) = choices(
        ui,
        ("Size", ""),
        &[
            (
                "On the surface",
                "The brush keeps its size on the surface when the view is zoomed.",
            ),
            (
                "On the screen",
                "The brush keeps its size on the screen when the view is zoomed.",
            ),
        ],
        on,
    ) {
        desk.hand.on_screen = i == 1;
    }
    let brush = desk.hand.brush_mut();
    let row = |ui: &mut Ui,
               name: &str,
               range: std::ops::RangeInclusive<f64>,
               tip: &str,
               value: &mut f32| {
        let mut number = shown(*value);
        let bar = Bar::new(name, range).percent().show(ui, &mut number);
        if bar.response.changed() {
            *value = number as f32;
        }
        bar.response.on_hover_text(tip);
    };
    super::widgets::caption(ui, "Stroke");
    row(
        ui,
        "Spacing",
        0.0..=3.0,
        "The way from dab to dab as a part of the brush's breadth; 0 is a line without gaps.",
        &mut brush.spacing,
    );
    row(
        ui,
        "Jitter",
        0.0..=3.0,
        "How far dabs stray from the path, as a part of the radius. Needs spacing.",
        &mut brush.jitter,
    );
    row(
        ui,
        "Size at no pressure",
        0.0..=1.0,
        "What is left of the size when the pen hardly presses; 100% means that pressure does not change it.",
        &mut brush.pressure.size,
    );
    row(
        ui,
        "Flow at no pressure",
        0.0..=1.0,
        "What is left of the flow when the pen hardly presses; 100% means that pressure does not change it.",
        &mut brush.pressure.flow,
    );
    let tip = tips(
        desk,
        "The pointer pulls the brush by a string: a trembling hand draws a calm line. 100% is a string of six radii.",
        &[Action::ToggleStabiliser],
    );
    let mut calm = f64::from(desk.hand.stabiliser);
    let bar = Bar::new("Stabiliser", 0.0..=1.0)
        .percent()
        .show(ui, &mut calm);
    if bar.response.changed() {
        desk.hand.stabiliser = calm as f32;
    }
    bar.response.on_hover_text(tip);
    super::widgets::caption(ui, "Symmetry");
    let modes = [Mirror::Off, Mirror::U, Mirror::V, Mirror::Both];
    let now = modes
        .iter()
        .position(|m| *m == desk.hand.mirror)
        .unwrap_or(0);
    let tip = tips(
        desk,
        "On the mesh the mirrors go through its middle.",
        &[Action::ToggleMirror],
    );
    let words = [
        ("Off", "Strokes are painted once."),
        (
            "Left/right",
            "Every stroke on the other side of an upright line as well.",
        ),
        (
            "Up/down",
            "Every stroke on the other side of a level line as well.",
        ),
        ("Both", "Every stroke in all four quarters."),
    ];
    if let Some(i) = choices(ui, ("Mirror", &tip), &words, now) {
        desk.hand.mirror = modes[i];
    }
    let mut copies = f64::from(desk.hand.copies.max(1));
    let bar = Bar::new("Copies around the middle", 1.0..=64.0)
        .integer(true)
        .show(ui, &mut copies);
    if bar.response.changed() {
        desk.hand.copies = if copies < 2.0 { 0 } else { copies as u32 };
    }
    let tip = tips(
        desk,
        "Every stroke so many times around the middle; on the mesh around its upright axis.",
        &[Action::ToggleRadial],
    );
    bar.response.on_hover_text(tip);
    for (i, name) in ["Middle u", "Middle v"].into_iter().enumerate() {
        let mut at = shown(desk.hand.symmetry_center[i]);
        let bar = Bar::new(name, 0.0..=1.0).default(0.5).unit("UV units");
        let bar = bar.show(ui, &mut at);
        if bar.response.changed() {
            desk.hand.symmetry_center[i] = at as f32;
        }
        bar.response
            .on_hover_text("Where the mirrors stand and what copies go around, in UV. On the mesh that is its own middle.");
    }
}
