//! Colours, sizes and fonts: a dark and a light theme with one accent, the colour of brass.

use anisomap::studio::settings::Theme as Choice;
use eframe::egui::{
    self, Color32, Context, CornerRadius, FontFamily, FontId, Margin, Shadow, Stroke, Style,
    TextStyle, Theme, ThemePreference, Visuals, vec2,
};

/// Height of a row of controls, points.
pub(crate) const ROW: f32 = 24.0;
/// Width of the column of tools.
pub(crate) const TOOLS: f32 = 48.0;
/// Width of the panels on the right when the window opens.
pub(crate) const SIDE: f32 = 316.0;

/// What the stock visuals have no place for.
#[derive(Clone, Copy)]
pub(crate) struct Palette {
    /// The one colour that stands out.
    pub(crate) accent: Color32,
    /// The accent as a ground that text stands on.
    pub(crate) accent_ground: Color32,
    /// Behind pictures.
    pub(crate) backdrop: Color32,
    /// Headers of panels.
    pub(crate) header: Color32,
    /// The empty part of a bar.
    pub(crate) track: Color32,
    /// Lines between panels.
    pub(crate) line: Color32,
    /// Text.
    pub(crate) text: Color32,
    /// Text of less weight.
    pub(crate) weak: Color32,
    /// What went wrong.
    pub(crate) error: Color32,
    /// What asks for attention.
    pub(crate) warning: Color32,
    /// What is selected, hovered.
    pub(crate) hover: Color32,
}

const DARK: Palette = Palette {
    accent: Color32::from_rgb(0xe2, 0xa8, 0x57),
    accent_ground: Color32::from_rgb(0x5a, 0x44, 0x26),
    backdrop: Color32::from_rgb(0x13, 0x14, 0x16),
    header: Color32::from_rgb(0x27, 0x29, 0x2d),
    track: Color32::from_rgb(0x16, 0x18, 0x1a),
    line: Color32::from_rgb(0x11, 0x12, 0x14),
    text: Color32::from_rgb(0xd4, 0xd6, 0xd9),
    weak: Color32::from_rgb(0x8f, 0x94, 0x9b),
    error: Color32::from_rgb(0xf0, 0x71, 0x68),
    warning: Color32::from_rgb(0xe8, 0xb5, 0x4a),
    hover: Color32::from_rgb(0x38, 0x3b, 0x41),
};

const LIGHT: Palette = Palette {
    accent: Color32::from_rgb(0xa8, 0x6a, 0x12),
    accent_ground: Color32::from_rgb(0xf0, 0xd5, 0xa6),
    backdrop: Color32::from_rgb(0xb9, 0xbc, 0xc1),
    header: Color32::from_rgb(0xe4, 0xe6, 0xe9),
    track: Color32::from_rgb(0xff, 0xff, 0xff),
    line: Color32::from_rgb(0xb4, 0xb8, 0xbe),
    text: Color32::from_rgb(0x24, 0x27, 0x2b),
    weak: Color32::from_rgb(0x62, 0x68, 0x70),
    error: Color32::from_rgb(0xb8, 0x2c, 0x22),
    warning: Color32::from_rgb(0x8f, 0x62, 0x00),
    hover: Color32::from_rgb(0xd9, 0xdc, 0xe1),
};

impl Palette {
    /// The palette of the theme that is shown.
    pub(crate) fn of(ui: &egui::Ui) -> Self {
        Self::of_visuals(ui.visuals())
    }

    /// The palette that goes with visuals.
    pub(crate) fn of_visuals(visuals: &Visuals) -> Self {
        if visuals.dark_mode { DARK } else { LIGHT }
    }
}

/// Gives a context both themes, and the one that was chosen.
pub(crate) fn install(ctx: &Context) {
    ctx.set_style_of(
        Theme::Dark,
        style(
            Visuals::dark(),
            &DARK,
            [0x1e, 0x20, 0x23],
            [0x2d, 0x30, 0x35],
        ),
    );
    ctx.set_style_of(
        Theme::Light,
        style(
            Visuals::light(),
            &LIGHT,
            [0xee, 0xef, 0xf1],
            [0xfb, 0xfb, 0xfc],
        ),
    );
}

/// Light, dark, or as the system says.
pub(crate) fn choose(ctx: &Context, choice: Choice) {
    ctx.set_theme(match choice {
        Choice::Dark => ThemePreference::Dark,
        Choice::Light => ThemePreference::Light,
        Choice::System => ThemePreference::System,
    });
}

fn style(visuals: Visuals, palette: &Palette, panel: [u8; 3], control: [u8; 3]) -> Style {
    let mut style = Style {
        visuals: colours(visuals, palette, rgb(panel), rgb(control)),
        ..Style::default()
    };
    let proportional = |size| FontId::new(size, FontFamily::Proportional);
    style.text_styles = [
        (TextStyle::Small, proportional(11.0)),
        (TextStyle::Body, proportional(13.0)),
        (TextStyle::Button, proportional(13.0)),
        (TextStyle::Heading, proportional(17.0)),
        (
            TextStyle::Monospace,
            FontId::new(12.0, FontFamily::Monospace),
        ),
    ]
    .into();
    let spacing = &mut style.spacing;
    spacing.item_spacing = vec2(6.0, 4.0);
    spacing.button_padding = vec2(8.0, 3.0);
    spacing.interact_size = vec2(28.0, ROW);
    spacing.menu_margin = Margin::same(6);
    spacing.window_margin = Margin::same(14);
    spacing.icon_width = 15.0;
    spacing.icon_width_inner = 9.0;
    spacing.tooltip_width = 320.0;
    spacing.combo_width = 60.0;
    // Seen without being looked for: what is cut off says so.
    spacing.scroll = egui::style::ScrollStyle {
        bar_width: 8.0,
        ..egui::style::ScrollStyle::thin()
    };
    style.interaction.tooltip_delay = 0.45;
    style.animation_time = 0.0; // an animation repaints a window that a software renderer draws
    style
}

const fn rgb(c: [u8; 3]) -> Color32 {
    Color32::from_rgb(c[0], c[1], c[2])
}

fn colours(mut v: Visuals, palette: &Palette, panel: Color32, control: Color32) -> Visuals {
    v.panel_fill = panel;
    v.window_fill = panel;
    v.window_stroke = Stroke::new(1.0, palette.line);
    v.window_corner_radius = CornerRadius::same(8);
    v.menu_corner_radius = CornerRadius::same(6);
    v.extreme_bg_color = palette.track;
    v.faint_bg_color = palette.header;
    v.error_fg_color = palette.error;
    v.warn_fg_color = palette.warning;
    v.hyperlink_color = palette.accent;
    v.weak_text_color = Some(palette.weak);
    v.selection.bg_fill = palette.accent_ground;
    v.selection.stroke = Stroke::new(1.0, palette.text);
    v.text_cursor.stroke = Stroke::new(1.5, palette.accent);
    v.slider_trailing_fill = true;
    v.popup_shadow = Shadow {
        offset: [0, 4],
        blur: 14,
        spread: 0,
        color: Color32::from_black_alpha(90),
    };
    v.window_shadow = v.popup_shadow;
    let rounded = CornerRadius::same(4);
    let states = [
        (
            &mut v.widgets.noninteractive,
            panel,
            palette.line,
            palette.text,
        ),
        (
            &mut v.widgets.inactive,
            control,
            // On light panels an empty box would not be seen without.
            if v.dark_mode {
                Color32::TRANSPARENT
            } else {
                palette.line
            },
            palette.text,
        ),
        (
            &mut v.widgets.hovered,
            palette.hover,
            Color32::TRANSPARENT,
            palette.text,
        ),
        (
            &mut v.widgets.active,
            palette.accent_ground,
            palette.accent,
            palette.text,
        ),
        (
            &mut v.widgets.open,
            palette.hover,
            Color32::TRANSPARENT,
            palette.text,
        ),
    ];
    for (widget, fill, stroke, text) in states {
        widget.bg_fill = fill;
        widget.weak_bg_fill = fill;
        widget.bg_stroke = Stroke::new(1.0, stroke);
        widget.fg_stroke = Stroke::new(1.0, text);
        widget.corner_radius = rounded;
        widget.expansion = 0.0;
    }
    v
}
