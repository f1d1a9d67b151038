//! The panel under the layers: the brush, the selected layer, the document, the history.

use super::about;
use super::desk::{Desk, Large, LargeThing, Redraw, Wanted};
use super::theme::Palette;
use super::tools::{brush_panel, shown, tips};
use super::widgets::{Bar, body, caption, choices, left_label};
use anisomap::guide::Guides;
use anisomap::map::{Size, Wrap};
use anisomap::mesh::Projection;
use anisomap::pattern::Pattern;
use anisomap::recipe::{Mask, MaskSource, Material, Recipe, SEED_MAX, Source};
use anisomap::studio::action::Action;
use anisomap::studio::hand::ToolKind;
use anisomap::studio::parameters::{Row, Setting, Word, default_pattern, rows, with_value};
use anisomap::studio::{Header, LayerHead, bytes_free, bytes_needed, memory_warning};
use eframe::egui::{self, Ui, vec2};

/// The leaves of the panel.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) enum Leaf {
    Brush,
    #[default]
    Layer,
    Document,
    History,
}

/// Each with its name and what it shows.
const LEAVES: [(Leaf, &str, &str); 4] = [
    (
        Leaf::Brush,
        "Brush",
        "Spacing, jitter, pressure, stabiliser and symmetry of strokes.",
    ),
    (
        Leaf::Layer,
        "Layer",
        "Opacity, channels, mask and numbers of the selected layer.",
    ),
    (
        Leaf::Document,
        "Document",
        "Size, edges, material and seed of the whole map.",
    ),
    (
        Leaf::History,
        "History",
        "Every change that can be taken back or made again.",
    ),
];

/// The panel and what it remembers.
#[derive(Default)]
pub(crate) struct PropertiesPanel {
    pub(crate) leaf: Leaf,
}

impl PropertiesPanel {
    pub(crate) fn show(&mut self, ui: &mut Ui, desk: &mut Desk) {
        super::pane::strip(ui, |ui| {
            for (leaf, name, shows) in LEAVES {
                let tab = super::pane::tab(ui, name, leaf == self.leaf);
                let tip = match leaf {
                    Leaf::History => tips(desk, shows, &[Action::ToggleHistory]),
                    _ => shows.to_owned(),
                };
                if tab.on_hover_text(tip).clicked() {
                    self.leaf = leaf;
                }
            }
        });
        egui::ScrollArea::vertical()
            .auto_shrink(false)
            .show(ui, |ui| {
                body(ui, |ui| match self.leaf {
                    Leaf::Brush => brush_panel(ui, desk),
                    Leaf::Layer => layer_panel(ui, desk),
                    Leaf::Document => document_panel(ui, desk),
                    Leaf::History => history_panel(ui, desk),
                });
            });
    }
}

/// What a bar did to a number.
struct Turned {
    value: Option<f64>,
    finished: bool,
}

fn turn(ui: &mut Ui, bar: Bar<'_>, tip: &str, value: f64) -> Turned {
    let mut now = value;
    let shown = bar.show(ui, &mut now);
    let changed = shown.response.changed() && now != value;
    shown.response.on_hover_text(tip);
    Turned {
        value: changed.then_some(now),
        finished: shown.finished,
    }
}

fn layer_panel(ui: &mut Ui, desk: &mut Desk) {
    let at = desk.studio.selected();
    let Some(layer) = desk.studio.recipe().layers.get(at) else {
        ui.label(egui::RichText::new("No layer is selected.").color(Palette::of(ui).weak));
        return;
    };
    let (layer, inside) = (LayerHead::of(layer), Inside::of(&layer.source));
    head(ui, desk, at, &layer);
    source(ui, desk, at, &inside);
    mask(ui, desk, at, &layer);
}

fn head(ui: &mut Ui, desk: &mut Desk, at: usize, layer: &LayerHead) {
    let bar = Bar::new("Opacity", 0.0..=1.0).percent().default(1.0);
    let opacity = turn(
        ui,
        bar,
        "How much of the layer shows.",
        shown(layer.opacity),
    );
    if let Some(value) = opacity.value {
        set_head(desk, at, "Opacity", |h| h.opacity = value as f32);
    }
    seal(desk, opacity.finished);
    caption(ui, "Touches");
    ui.horizontal(|ui| {
        let mut channels = layer.channels;
        for (name, on) in [
            ("alpha_x", &mut channels.alpha_x),
            ("alpha_y", &mut channels.alpha_y),
            ("direction", &mut channels.direction),
        ] {
            ui.checkbox(on, name)
                .on_hover_text(format!("Whether the layer changes {name}."));
        }
        let some = channels.alpha_x || channels.alpha_y || channels.direction;
        if some && channels != layer.channels {
            set_head(desk, at, "Channels", |h| h.channels = channels);
            desk.studio.seal();
        }
    });
    ui.horizontal(|ui| {
        ui.label("Seed");
        let mut own = layer.seed.is_some();
        if ui.checkbox(&mut own, "its own").on_hover_text("Whether the layer has a seed of its own, and not one of the document's seed and its name.").changed() {
            set_head(desk, at, "Seed", |h| h.seed = own.then_some(1));
            desk.studio.seal();
        }
        if let Some(seed) = layer.seed {
            let mut now = seed;
            let field = egui::DragValue::new(&mut now).range(0..=SEED_MAX).speed(1.0);
            let response = ui.add(field).accessible_name("Seed of the layer").on_hover_text("Another number gives another surface of the same kind.");
            if now != seed {
                set_head(desk, at, "Seed", |h| h.seed = Some(now));
            }
            seal(desk, response.drag_stopped() || response.lost_focus());
        }
    });
}

fn set_head(desk: &mut Desk, at: usize, label: &str, change: impl FnOnce(&mut LayerHead)) {
    let Some(layer) = desk.studio.recipe().layers.get(at) else {
        return;
    };
    let mut head = LayerHead::of(layer);
    change(&mut head);
    let done = desk.studio.set_head(at, label, head);
    desk.told(done);
}

/// A change is complete: the next one is another step of the history.
fn seal(desk: &mut Desk, finished: bool) {
    if finished {
        desk.studio.seal();
    }
}

/// What the panel shows of a layer's source: the source itself may hold a hundred thousand strokes.
enum Inside {
    Pattern(Pattern),
    /// Its files, and what textures mean.
    Image(String, Option<&'static str>),
    Strokes(usize),
    Guides(Guides),
    Stored,
}

impl Inside {
    fn of(source: &Source) -> Self {
        match source {
            Source::Pattern(pattern) => Self::Pattern(pattern.clone()),
            Source::Image(image) => {
                let mut names: Vec<&str> = image.files().map(String::as_str).collect();
                names.dedup();
                let textures = image.textures.as_ref();
                let convention = textures.map(|t| super::import::convention_name(&t.convention));
                Self::Image(names.join(", "), convention)
            }
            Source::Strokes(strokes) => Self::Strokes(strokes.strokes.len()),
            Source::Guides(guides) => Self::Guides(guides.clone()),
            Source::Stored(_) => Self::Stored,
        }
    }
}

/// What is said of a file that is missing, and a button that finds it again.
fn missing(ui: &mut Ui, desk: &mut Desk, text: &str, file: Option<&str>) {
    let text = egui::RichText::new(text).color(Palette::of(ui).warning);
    ui.add(egui::Label::new(text).wrap());
    let Some(file) = file else { return };
    if desk.studio.is_outside(file) {
        let allow = ui.button("Allow\u{2026}");
        let tip = "Asks once more whether files outside the recipe's folder may be read.";
        desk.ask_outside |= allow.on_hover_text(tip).clicked();
    }
    let tip = "Takes another file in its place wherever the recipe names it; it is copied beside the recipe.";
    let find = ui.button("Find the file\u{2026}").on_hover_text(tip);
    if find.clicked() {
        desk.wanted = Some(Wanted::Find(file.to_owned()));
    }
}

fn source(ui: &mut Ui, desk: &mut Desk, at: usize, inside: &Inside) {
    let layer = desk.studio.recipe().layers.get(at);
    if let Some(left) = layer.and_then(|l| desk.studio.left_out(l.name())).cloned() {
        let text = format!("Not shown: {}.", left.reason);
        missing(ui, desk, &text, left.file.as_deref());
    }
    match inside {
        Inside::Pattern(pattern) => {
            caption(ui, &format!("Pattern: {}", pattern.name()));
            if let Some((changed, name)) = pattern_rows(ui, desk, pattern) {
                let done = desk.studio.set_source(at, &name, Source::Pattern(changed));
                desk.told(done);
            }
        }
        Inside::Image(files, None) => {
            caption(ui, "Map from a file");
            let file = egui::Label::new(files).wrap();
            ui.add(file)
                .on_hover_text("The file that the layer lays over the map.");
        }
        Inside::Image(files, Some(convention)) => {
            caption(ui, "Textures");
            let files = egui::Label::new(files).wrap();
            ui.add(files)
                .on_hover_text("The files that the layer reads its map from.");
            ui.horizontal(|ui| {
                ui.label(*convention);
                let button = ui.button("Convention\u{2026}");
                let tip =
                    "Says anew what the numbers in the textures mean, and which of them are read.";
                if button.on_hover_text(tip).clicked() {
                    desk.wanted = Some(Wanted::Convention(at));
                }
            });
        }
        Inside::Strokes(count) => {
            caption(ui, "Strokes");
            ui.label(match *count {
                0 => "None yet: paint on the canvas.".to_owned(),
                n => super::messages::count(n, "stroke"),
            });
        }
        Inside::Guides(guides) => {
            let mut hand = std::mem::take(&mut desk.guides);
            super::guides::panel(ui, desk, &mut hand, at, guides);
            desk.guides = hand;
        }
        Inside::Stored => caption(ui, "A reduced map"),
    }
}

/// A row for each value of a pattern. Gives the pattern with what was changed, and the name of that.
fn pattern_rows(ui: &mut Ui, desk: &mut Desk, pattern: &Pattern) -> Option<(Pattern, String)> {
    let mut changed = None;
    for row in rows(pattern) {
        let value = match row.value {
            Setting::Number {
                value,
                integer,
                ref parameter,
            } => {
                let default = default_pattern(pattern.name())
                    .ok()
                    .and_then(|p| number_of(&p, &row.key));
                let mut bar = Bar::new(&row.name, parameter.range.clone())
                    .integer(integer)
                    .unit(parameter.unit);
                if let Some(default) = default {
                    bar = bar.default(default);
                }
                let tip = parameter_tip(parameter, &row.key);
                let turned = turn(ui, bar, &tip, value);
                seal(desk, turned.finished);
                turned.value.map(toml_number(integer))
            }
            Setting::Word { ref value, words } => word_row(ui, &row, value, words),
            Setting::Flag(flag) => {
                let mut now = flag;
                let tip = format!("{}; in the recipe: {}", row.name, row.key);
                let changed = ui
                    .checkbox(&mut now, &row.name)
                    .on_hover_text(tip)
                    .changed();
                seal(desk, changed);
                changed.then_some(toml::Value::Boolean(now))
            }
        };
        if let Some(value) = value {
            let with = with_value(pattern, &row.key, value);
            changed = desk.told(with).map(|p| (p, row.name)).or(changed);
        }
    }
    changed
}

fn toml_number(integer: bool) -> impl Fn(f64) -> toml::Value {
    move |n| {
        if integer {
            toml::Value::Integer(n as i64)
        } else {
            toml::Value::Float(n)
        }
    }
}

fn number_of(pattern: &Pattern, key: &str) -> Option<f64> {
    rows(pattern)
        .into_iter()
        .find(|r| r.key == key)
        .and_then(|r| match r.value {
            Setting::Number { value, .. } => Some(value),
            _ => None,
        })
}

/// What a parameter means, what it may be, and its key in the recipe.
fn parameter_tip(parameter: &anisomap::pattern::Parameter, key: &str) -> String {
    let doc = sentence(parameter.doc);
    let unit = if parameter.unit.is_empty() {
        String::new()
    } else {
        format!(" {}", parameter.unit)
    };
    format!(
        "{doc}.\n{} to {}{unit}; in the recipe: {key}\nDrag, or click to type; a middle click brings the default back.",
        parameter.range.start(),
        parameter.range.end()
    )
}

fn word_row(ui: &mut Ui, row: &Row, value: &str, words: &[Word]) -> Option<toml::Value> {
    let now = words.iter().position(|w| w.word == value).unwrap_or(0);
    let tip = format!("In the recipe: {}", row.key);
    let told: Vec<String> = words.iter().map(|w| sentence(w.doc) + ".").collect();
    let shown: Vec<(&str, &str)> = words
        .iter()
        .map(|w| w.word)
        .zip(told.iter().map(String::as_str))
        .collect();
    let chosen = choices(ui, (&row.name, &tip), &shown, now);
    chosen.map(|i| toml::Value::from(words[i].word))
}

fn mask(ui: &mut Ui, desk: &mut Desk, at: usize, layer: &LayerHead) {
    caption(ui, "Mask");
    ui.horizontal(|ui| {
        let now = layer.mask.as_ref().map_or("none", |m| match m.source {
            MaskSource::Strokes(_) if m.start.unwrap_or(0.0) > 0.5 => "painted, was all shown",
            MaskSource::Strokes(_) => "painted, was all hidden",
            _ => m.source.name(),
        });
        egui::ComboBox::from_id_salt("mask")
            .width(140.0)
            .selected_text(now)
            .show_ui(ui, |ui| {
                let none = ui.selectable_label(layer.mask.is_none(), "none");
                let tip = "The layer shows everywhere.";
                if none.on_hover_text(tip).clicked() {
                    set_mask(desk, at, None);
                    desk.studio.seal();
                }
                for (name, shows, tip) in [
                    (
                        "painted, all shown",
                        true,
                        "The layer shows everywhere at first: the eraser hides it.",
                    ),
                    (
                        "painted, all hidden",
                        false,
                        "The layer is hidden everywhere at first: brushes show it.",
                    ),
                ] {
                    let painted = ui.selectable_label(false, name);
                    if painted.on_hover_text(tip).clicked() {
                        let added = desk.studio.add_painted_mask(at, shows);
                        // The first stroke is to do something: what all shows, or hides, is to be taken away from.
                        let erases = desk.hand.kind() == ToolKind::Erase;
                        if desk.told(added).is_some() && erases != shows {
                            desk.ask(if shows {
                                Action::ToolErase
                            } else {
                                Action::ToolGroove
                            });
                        }
                    }
                }
                for name in Pattern::NAMES {
                    let tip = format!(
                        "The layer shows where this pattern's value is large: {}.",
                        about::pattern(name)
                    );
                    let by = ui.selectable_label(now == name, name);
                    if by.on_hover_text(tip).clicked()
                        && let Ok(pattern) = default_pattern(name)
                    {
                        set_mask(desk, at, Some(Mask::new(MaskSource::Pattern(pattern))));
                        desk.studio.seal();
                    }
                }
            })
            .response
            .accessible_name("Mask")
            .on_hover_text(
                "Where the layer shows: everywhere, where a pattern has large values, or where you paint it.",
            );
        if let Some(mask) = &layer.mask {
            let mut invert = mask.invert;
            if ui
                .checkbox(&mut invert, "Invert")
                .on_hover_text("Shows the layer where the mask hides it.")
                .changed()
            {
                set_mask(
                    desk,
                    at,
                    Some(Mask {
                        invert,
                        ..mask.clone()
                    }),
                );
                desk.studio.seal();
            }
        }
    });
    let Some(mask) = &layer.mask else { return };
    if let MaskSource::Strokes(_) = &mask.source {
        let mut on_mask = desk.studio.is_mask_selected();
        let view = desk.keymap.keys_text(Action::View8);
        let tip = format!(
            "Strokes then show the layer, and the eraser hides it. The coverage view ({view}) shows the mask."
        );
        if ui
            .checkbox(&mut on_mask, "Paint on the mask")
            .on_hover_text(tip)
            .changed()
        {
            desk.studio.select_mask(on_mask);
        }
        return;
    }
    if let MaskSource::Pattern(pattern) = &mask.source {
        thresholds(ui, desk, at, mask);
        if let Some((changed, _)) = pattern_rows(ui, desk, pattern) {
            set_mask(
                desk,
                at,
                Some(Mask {
                    source: MaskSource::Pattern(changed),
                    ..mask.clone()
                }),
            );
        }
    } else {
        let bar = Bar::new("Feather", 0.0..=1.0)
            .default(0.0)
            .unit("surface units");
        let feather = turn(
            ui,
            bar,
            "How wide the edge fades, surface units.",
            shown(mask.feather.unwrap_or(0.0)),
        );
        if let Some(value) = feather.value {
            set_mask(
                desk,
                at,
                Some(Mask {
                    feather: Some(value as f32),
                    ..mask.clone()
                }),
            );
        }
        seal(desk, feather.finished);
    }
}

fn thresholds(ui: &mut Ui, desk: &mut Desk, at: usize, mask: &Mask) {
    let (low, high) = (mask.low.unwrap_or(0.0), mask.high.unwrap_or(1.0));
    let bar = Bar::new("Hidden below", 0.0..=0.99).default(0.0);
    let turned = turn(
        ui,
        bar,
        "The pattern's value at and below which the layer is hidden.",
        shown(low),
    );
    seal(desk, turned.finished);
    if let Some(value) = turned.value {
        let low = value as f32;
        set_mask(
            desk,
            at,
            Some(Mask {
                low: Some(low),
                high: Some(high.max(low + 0.01)),
                ..mask.clone()
            }),
        );
    }
    let bar = Bar::new("Whole from", 0.01..=1.0).default(1.0);
    let turned = turn(
        ui,
        bar,
        "The pattern's value from which on the layer shows wholly.",
        shown(high),
    );
    seal(desk, turned.finished);
    if let Some(value) = turned.value {
        let high = value as f32;
        set_mask(
            desk,
            at,
            Some(Mask {
                low: Some(low.min(high - 0.01)),
                high: Some(high),
                ..mask.clone()
            }),
        );
    }
}

fn set_mask(desk: &mut Desk, at: usize, mask: Option<Mask>) {
    set_head(desk, at, "Mask", |h| h.mask = mask);
}

// ----- The document. -----

fn document_panel(ui: &mut Ui, desk: &mut Desk) {
    let before = Header::of(desk.studio.recipe());
    let mut header = before.clone();
    let mut finished = false;
    if let Some(why) = desk.studio.no_mesh() {
        let text = format!("The mesh is not shown: {why}.");
        let word = desk.studio.recipe().mesh.clone().unwrap_or_default();
        missing(ui, desk, &text, Some(Projection::split(&word).0));
    }
    size_rows(ui, desk, &mut header);
    caption(ui, "Beyond the edge");
    let wraps = [Wrap::Repeat, Wrap::RepeatU, Wrap::Clamp];
    let now = wraps.iter().position(|w| *w == header.wrap).unwrap_or(0);
    if let Some(i) = choices(
        ui,
        ("Wrap", ""),
        &[
            ("Repeats", "Beyond every edge the map begins again."),
            (
                "Repeats in u",
                "To the left and the right the map begins again; above and below it ends.",
            ),
            ("Ends", "Beyond the edges there is nothing."),
        ],
        now,
    ) {
        header.wrap = wraps[i];
        finished = true;
    }
    caption(ui, "Adjust the whole map");
    for (name, range, value, default, tip) in [
        (
            "alpha_x factor",
            0.01..=100.0,
            &mut header.adjust.alpha_x,
            1.0,
            "Multiplies every alpha_x.",
        ),
        (
            "alpha_y factor",
            0.01..=100.0,
            &mut header.adjust.alpha_y,
            1.0,
            "Multiplies every alpha_y.",
        ),
        (
            "Turn",
            -180.0..=180.0,
            &mut header.adjust.turn,
            0.0,
            "Turns every direction, degrees counter-clockwise.",
        ),
    ] {
        let unit = if name == "Turn" { "degrees" } else { "" };
        let bar = Bar::new(name, range).default(default).unit(unit);
        let turned = turn(ui, bar, tip, shown(*value));
        if let Some(new) = turned.value {
            *value = new as f32;
        }
        finished |= turned.finished;
    }
    finished |= material_rows(ui, &mut header.material);
    ui.horizontal(|ui| {
        ui.label("Seed");
        let field = egui::DragValue::new(&mut header.seed)
            .range(0..=SEED_MAX)
            .speed(1.0);
        let response = ui
            .add(field)
            .accessible_name("Seed of the document")
            .on_hover_text("What all randomness comes from.");
        finished |= response.drag_stopped() || response.lost_focus();
    });
    let [width, height] = header.size;
    let resized = Size::new(width, height)
        .ok()
        .filter(|_| header.size != before.size);
    let warning = resized.and_then(|size| too_large(desk.studio.recipe(), size));
    if let Some(warning) = warning {
        let what = LargeThing::Header(Box::new(header));
        desk.large = Some(Large { warning, what });
    } else if header != before {
        let done = desk.studio.set_header("Document", header);
        desk.redraw = desk.redraw.or(Redraw::Sharp);
        desk.told(done);
    }
    seal(desk, finished);
}

fn size_rows(ui: &mut Ui, desk: &Desk, header: &mut Header) {
    let recipe = desk.studio.recipe();
    let takes = |[w, h]: [u32; 2]| {
        Size::new(w, h).map_or_else(|_| String::new(), |size| memory(recipe, size))
    };
    caption(ui, "Size in texels");
    ui.horizontal(|ui| {
        let [w, h] = header.size;
        egui::ComboBox::from_id_salt("size")
            .width(120.0)
            .selected_text(format!("{w} x {h}"))
            .show_ui(ui, |ui| {
                for side in [256u32, 512, 1024, 2048, 4096, 8192, 16384] {
                    let size = [
                        side,
                        (u64::from(side) * u64::from(h) / u64::from(w)).clamp(1, 16384) as u32,
                    ];
                    let text = format!("{} x {}  ({})", size[0], size[1], takes(size));
                    let tip = format!(
                        "Makes the map {} texels wide and {} high, which takes about {}.",
                        size[0],
                        size[1],
                        takes(size)
                    );
                    let label = ui.selectable_label(size == header.size, text);
                    if label.on_hover_text(tip).clicked() {
                        header.size = size;
                    }
                }
            })
            .response
            .accessible_name("Size in texels")
            .on_hover_text(
                "The map's size. Patterns and strokes are drawn anew: nothing gets blurred.",
            );
        ui.label(egui::RichText::new(takes(header.size)).color(Palette::of(ui).weak));
    });
    let ratio = f64::from(header.size[0]) / f64::from(header.size[1]);
    let mut own = header.aspect.is_some();
    ui.horizontal(|ui| {
        if ui.checkbox(&mut own, "Aspect of its own").on_hover_text("Width over height of one turn of UV on the surface, where it is not that of the texels.").changed() {
            header.aspect = own.then_some(ratio as f32);
        }
    });
    if let Some(aspect) = &mut header.aspect {
        let turned = turn(
            ui,
            Bar::new("Aspect", 0.1..=10.0),
            "Width over height of one turn of UV on the surface.",
            shown(*aspect),
        );
        if let Some(value) = turned.value {
            *aspect = value as f32;
        }
    }
    let mesh = desk.studio.mesh();
    let wanted = (mesh.aspect * 1000.0).round() / 1000.0;
    let now = header.aspect.unwrap_or(ratio as f32);
    if (now / wanted - 1.0).abs() > 0.01 {
        let text = format!("As the {}: {wanted}", mesh.name);
        let tip = "Gives the map the width over height that it has on the mesh, so that strokes keep their shape there.";
        if ui.button(text).on_hover_text(tip).clicked() {
            header.aspect = Some(wanted);
        }
    }
}

/// About what a recipe's map of a size takes while it is worked on.
pub(crate) fn memory(recipe: &Recipe, size: Size) -> String {
    bytes_text(bytes_needed(recipe, size))
}

/// What is to be said before a recipe's map is made at a size; `None` where there is room for it.
pub(crate) fn too_large(recipe: &Recipe, size: Size) -> Option<String> {
    memory_warning(recipe, size, bytes_free())
}

/// Bytes as people read them.
pub(crate) fn bytes_text(bytes: u64) -> String {
    let mib = bytes as f64 / (1u64 << 20) as f64;
    if mib >= 1024.0 {
        format!("{:.1} GiB", mib / 1024.0)
    } else {
        format!("{mib:.0} MiB")
    }
}

/// `true` when a change is complete.
fn material_rows(ui: &mut Ui, material: &mut Material) -> bool {
    caption(ui, "Colours");
    let mut finished = false;
    for (name, colour, tip) in [
        (
            "Specular",
            &mut material.specular,
            "Ward's rho_s: how much the gloss reflects, red, green, blue.",
        ),
        (
            "Diffuse",
            &mut material.diffuse,
            "Ward's rho_d: how much is scattered every way.",
        ),
        (
            "Ambient",
            &mut material.ambient,
            "How much of the light from all around comes back.",
        ),
    ] {
        ui.horizontal(|ui| {
            let (rect, _) = ui.allocate_exact_size(vec2(18.0, 18.0), egui::Sense::hover());
            let srgb =
                colour.map(|c| (anisomap::preview::srgb_from_linear(c) * 255.0).round() as u8);
            ui.painter()
                .rect_filled(rect, 3, egui::Color32::from_rgb(srgb[0], srgb[1], srgb[2]));
            left_label(ui, 58.0, egui::RichText::new(name));
            let width = (ui.available_width() - 8.0) / 3.0;
            ui.spacing_mut().item_spacing.x = 4.0;
            for (i, letter) in ["R", "G", "B"].into_iter().enumerate() {
                let mut value = shown(colour[i]);
                let bar = Bar::new(letter, 0.0..=1.0)
                    .width(width)
                    .show(ui, &mut value);
                if bar.response.changed() {
                    colour[i] = value as f32;
                }
                finished |= bar.finished;
                bar.response
                    .accessible_name(format!("{name} {letter}"))
                    .on_hover_text(tip);
            }
        });
    }
    finished
}

// ----- The history. -----

/// With a capital first letter.
pub(crate) fn sentence(text: &str) -> String {
    let mut letters = text.chars();
    letters
        .next()
        .map_or(String::new(), |f| f.to_uppercase().chain(letters).collect())
}

fn history_panel(ui: &mut Ui, desk: &mut Desk) {
    let (undone, redone) = desk.studio.history().labels();
    let undone: Vec<String> = undone.map(sentence).collect();
    let redone: Vec<String> = redone.map(sentence).collect();
    ui.label(
        egui::RichText::new(format!(
            "{}: {}    {}: {}",
            Action::Undo.name(),
            desk.keymap.keys_text(Action::Undo),
            Action::Redo.name(),
            desk.keymap.keys_text(Action::Redo)
        ))
        .small()
        .color(Palette::of(ui).weak),
    );
    let (mut back, mut forth) = (0, 0);
    // The latest on top: what was taken back last is done again first.
    for (i, label) in redone.iter().enumerate().rev() {
        let text = egui::RichText::new(label)
            .color(Palette::of(ui).weak)
            .italics();
        if ui
            .selectable_label(false, text)
            .on_hover_text("Does everything up to here again.")
            .clicked()
        {
            forth = i + 1;
        }
    }
    for (i, label) in undone.iter().rev().enumerate() {
        if ui
            .selectable_label(i == 0, label)
            .on_hover_text("Takes back everything that came after.")
            .clicked()
        {
            back = i;
        }
    }
    let (first, tip) = if desk.studio.history().is_whole() {
        (
            "Opened",
            "Takes everything back, to the document as it was opened.",
        )
    } else {
        (
            "Oldest step that is kept",
            "Takes back everything that is kept; the memory for undo is set in Edit > Settings.",
        )
    };
    let begins = ui.selectable_label(undone.is_empty(), first);
    if begins.on_hover_text(tip).clicked() {
        back = undone.len();
    }
    for _ in 0..back {
        let done = desk.studio.undo();
        desk.told(done);
    }
    for _ in 0..forth {
        let done = desk.studio.redo();
        desk.told(done);
    }
}
