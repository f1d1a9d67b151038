//! Says what the numbers of textures mean: a guess by their names, what it makes of them, and everything to be changed.

use super::intake::Told;
use super::theme::Palette;
use super::widgets::{Tip, caption};
use super::work::{Now, Reins, Work};
use anisomap::Error;
use anisomap::convention::LobeFit;
use anisomap::convention::textures::{Convention, Curve, Encoding, Leads, Widths};
use anisomap::import::guess::{Guess, guess, pictures_beside};
use anisomap::import::numbers::{About, Numbers, about};
use anisomap::import::textures::{Channel, Textures};
use anisomap::map::{AnisoMap, Size, Wrap};
use anisomap::recipe::Files;
use anisomap::studio::apart;
use anisomap::studio::view::{Averages, Camera2d, Lighting, View};
use eframe::egui::{self, ColorImage, ComboBox, DragValue, RichText, TextureHandle, Ui, vec2};
use std::path::{Path, PathBuf};

/// Every picture is looked at in so many places a side.
const PLACES: u32 = 96;
/// The most pictures of a folder that are offered.
const PICTURES: usize = 16;

/// A channel of a picture, at some places of it.
struct Sampled {
    channel: Channel,
    values: Vec<f32>,
}

/// Textures before it is said what they mean.
pub(crate) struct Seen {
    folder: PathBuf,
    pub(crate) guess: Guess,
    /// The pictures that may be chosen from, and what they say of themselves.
    files: Vec<(String, About)>,
    /// Of the pictures that were chosen.
    channels: Vec<Sampled>,
    /// The layer that the textures are of already.
    layer: Option<String>,
}

/// Looks at a picture and at those beside it: those that seem to belong to it are read, of the others what they say of
/// themselves.
///
/// # Errors
/// When the picture itself cannot be read.
pub(crate) fn look_at(path: &Path) -> Result<Seen, Error> {
    let guess = guess(path)?;
    let folder = path.parent().unwrap_or(Path::new("")).to_owned();
    let own = path.file_name().unwrap_or_default().to_string_lossy();
    let of_guess = guess.textures.channels().map(|(_, c)| c.file.clone());
    let files: Vec<String> = of_guess.chain(pictures_beside(path)).collect();
    let mut seen = Seen::of(folder, guess, files);
    seen.read_chosen(Some(&*own))?;
    Ok(seen)
}

/// Looks at the textures of a layer again, whose files are named from `folder`, and at those beside them, as far as `may` says that
/// the recipe may name them.
pub(crate) fn look_again(layer: String, textures: Textures, folder: &Path, may: &Files) -> Seen {
    let files: Vec<String> = textures.channels().map(|(_, c)| c.file.clone()).collect();
    let first = files.first().cloned().unwrap_or_default();
    let way = first.rsplit_once('/').map_or("", |(way, _)| way);
    let is_allowed = |name: &String| may.resolve("file", name).is_ok();
    let beside = match is_allowed(&first) {
        true => pictures_beside(&folder.join(&first)),
        false => vec![],
    };
    let beside = beside.into_iter().map(|name| match way {
        "" => name,
        way => format!("{way}/{name}"),
    });
    let guess = Guess {
        convention: convention_name(&textures.convention),
        name: layer.clone(),
        textures,
    };
    let all = files.into_iter().chain(beside).filter(is_allowed).collect();
    let mut seen = Seen::of(folder.to_owned(), guess, all);
    seen.layer = Some(layer);
    // What of it cannot be read is not drawn; what it means can be said all the same.
    let _ = seen.read_chosen(None);
    seen
}

/// What a convention is called.
pub(crate) fn convention_name(convention: &Convention) -> &'static str {
    let named = Convention::NAMED.iter();
    let mut same = named.filter(|n| n.convention == *convention);
    same.next().map_or("Its own convention", |n| n.name)
}

/// The channels of a picture, at some places of it.
fn sample(folder: &Path, file: &str) -> Result<Vec<Sampled>, Error> {
    let path = folder.join(file);
    let numbers = Numbers::open(&path)?;
    let size = numbers.size();
    let at = |i: u32, side: u32| {
        ((u64::from(2 * i + 1) * u64::from(side)) / u64::from(2 * PLACES)) as usize
    };
    let of_channel = |name: String| {
        let plane = numbers.channel(&path, &name)?;
        let place = |x, y| at(y, size.height()) * size.width() as usize + at(x, size.width());
        let all = (0..PLACES).flat_map(|y| (0..PLACES).map(move |x| (x, y)));
        Ok(Sampled {
            channel: Channel::new(file, name),
            values: all.map(|(x, y)| plane.number(place(x, y))).collect(),
        })
    };
    numbers.channels().into_iter().map(of_channel).collect()
}

impl Seen {
    fn of(folder: PathBuf, guess: Guess, names: Vec<String>) -> Self {
        let mut files: Vec<(String, About)> = Vec::new();
        for name in names {
            let is_new = files.iter().all(|(known, _)| *known != name);
            // One that is no picture is not offered.
            if is_new
                && files.len() < PICTURES
                && let Ok(about) = about(&folder.join(&name))
            {
                files.push((name, about));
            }
        }
        Self {
            folder,
            guess,
            files,
            channels: Vec::new(),
            layer: None,
        }
    }

    /// Reads the pictures that the guess is about.
    ///
    /// # Errors
    /// When `needed` cannot be read; any other is left out.
    fn read_chosen(&mut self, needed: Option<&str>) -> Result<(), Error> {
        while let Some(file) = self.unread(&self.guess.textures) {
            match sample(&self.folder, &file) {
                Ok(channels) => self.channels.extend(channels),
                Err(error) if needed == Some(&*file) => return Err(error),
                Err(_) => self.files.retain(|(name, _)| *name != file),
            }
        }
        Ok(())
    }

    /// A picture that textures are made of and that was not read yet.
    fn unread(&self, textures: &Textures) -> Option<String> {
        let is_offered = |file: &str| self.files.iter().any(|(name, _)| name == file);
        let is_read = |file: &str| self.channels.iter().any(|s| s.channel.file == file);
        let mut files = textures.channels().map(|(_, c)| &c.file);
        files.find(|f| is_offered(f) && !is_read(f)).cloned()
    }

    fn values(&self, channel: Option<&Channel>) -> Option<&[f32]> {
        let channel = channel?;
        let same = |s: &&Sampled| {
            let named = &s.channel;
            named.file == channel.file && named.channel.eq_ignore_ascii_case(&channel.channel)
        };
        self.channels.iter().find(same).map(|s| &*s.values)
    }

    /// What the textures make at the places that were looked at.
    fn map(&self, textures: &Textures) -> Result<AnisoMap, Error> {
        let slots = [
            &textures.first,
            &textures.second,
            &textures.direction,
            &textures.direction_v,
        ];
        let values = slots.map(|slot| self.values(slot.as_ref()));
        let mut planes = [const { Vec::new() }; 4];
        for i in 0..(PLACES * PLACES) as usize {
            let t = textures.texel(values.map(|v| v.map(|v| v[i])));
            let numbers = [t.alpha_x, t.alpha_y, t.axis.cos2, t.axis.sin2];
            for (plane, number) in planes.iter_mut().zip(numbers) {
                plane.push(number);
            }
        }
        let size = Size::new(PLACES, PLACES)?;
        Ok(AnisoMap::from_planes(size, Wrap::Clamp, planes)?.0)
    }
}

/// The dialog.
pub(crate) struct ImportDialog {
    seen: Box<Seen>,
    textures: Textures,
    name: String,
    shown: Option<Shown>,
    /// A picture that is being read since it was chosen.
    reading: Option<Reading>,
}

/// Pictures that were chosen, by their names, as they are read.
type Reading = Work<(String, Result<Vec<Sampled>, Error>)>;

/// What the textures make as they are told now.
struct Shown {
    of: Textures,
    lit: TextureHandle,
    direction: TextureHandle,
    says: Vec<String>,
}

/// What the dialog wants done.
pub(crate) enum Wish {
    Stay,
    Close,
    Import(Box<Told>),
}

/// The side of the small pictures.
const SIDE: u32 = 168;

impl ImportDialog {
    pub(crate) fn new(seen: Box<Seen>) -> Self {
        Self {
            textures: seen.guess.textures.clone(),
            name: seen.guess.name.clone(),
            seen,
            shown: None,
            reading: None,
        }
    }

    pub(crate) fn show(&mut self, ui: &mut Ui) -> Wish {
        let palette = Palette::of(ui);
        ui.set_width(620.0);
        self.follow(ui);
        match &self.seen.layer {
            None => {
                ui.heading("Import textures");
                ui.label(
                    "What do the numbers in these pictures mean? This is a guess by their names.",
                );
            }
            Some(layer) => {
                ui.heading(format!("Convention of {layer}"));
                ui.label("What do the numbers in these pictures mean?");
            }
        }
        self.convention(ui);
        ui.horizontal_top(|ui| {
            ui.vertical(|ui| {
                ui.set_width(620.0 - f32::from(SIDE as u16) - 20.0);
                self.slots(ui);
                self.meaning(ui);
            });
            ui.vertical(|ui| self.preview(ui));
        });
        if self.seen.layer.is_none() {
            ui.horizontal(|ui| {
                ui.label("Name of the layer");
                ui.add(egui::TextEdit::singleline(&mut self.name).desired_width(200.0))
                    .accessible_name("Name of the layer")
                    .on_hover_text("What the layer and the file beside the recipe are called.");
            });
        }
        let problem = self.problem();
        if let Some(problem) = &problem {
            ui.add(egui::Label::new(RichText::new(problem).color(palette.error)).wrap());
        }
        ui.add_space(8.0);
        let mut wish = Wish::Stay;
        ui.horizontal(|ui| {
            let (text, tip) = match self.seen.layer {
                None => (
                    "Import",
                    "Lays the pictures beside the recipe, and makes a layer of them.",
                ),
                Some(_) => ("Apply", "The layer is read so from now on."),
            };
            let go = egui::Button::new(RichText::new(text).color(palette.text))
                .fill(palette.accent_ground);
            if ui.add_enabled(problem.is_none(), go).tip(tip).clicked() {
                let name = self.name.trim();
                wish = Wish::Import(Box::new(Told {
                    name: if name.is_empty() { "map" } else { name }.to_owned(),
                    from: self.seen.folder.clone(),
                    textures: self.textures.clone(),
                    layer: self.seen.layer.clone(),
                }));
            }
            let cancel = ui.button("Cancel");
            if cancel.on_hover_text("Imports nothing (Escape).").clicked() {
                wish = Wish::Close;
            }
        });
        wish
    }

    /// Why it cannot be imported so.
    fn problem(&self) -> Option<String> {
        if let Err(error) = self.textures.check() {
            return Some(error.to_string());
        }
        let known = |c: &Channel| self.seen.files.iter().find(|(f, _)| *f == c.file);
        let size = |c: &Channel| known(c).map(|(file, about)| (file, about.size));
        let mut sizes = self.textures.channels().filter_map(|(_, c)| size(c));
        let (first, want) = sizes.next()?;
        let other = sizes.find(|(_, s)| *s != want);
        other.map(|(file, size)| {
            format!("{file} is {size}, but {first} is {want}. Resize one to the size of the other")
        })
    }

    /// Whether something was chosen that a click beside the dialog must not throw away.
    pub(crate) fn is_touched(&self) -> bool {
        self.textures != self.seen.guess.textures || self.name != self.seen.guess.name
    }

    /// Takes over a picture that was read, and has the next one read that was chosen.
    fn follow(&mut self, ui: &Ui) {
        if let Some(work) = &self.reading {
            match work.now() {
                Now::Going => return,
                Now::Over => {}
                Now::Came((_, Ok(channels))) => {
                    self.seen.channels.extend(channels);
                    self.shown = None;
                }
                // One that cannot be read is not offered any more.
                Now::Came((file, Err(_))) => self.seen.files.retain(|(name, _)| *name != file),
            }
            self.reading = None;
        }
        if let Some(file) = self.seen.unread(&self.textures) {
            let folder = self.seen.folder.clone();
            let read = move |_: &Reins, give: &dyn Fn(_) -> bool| {
                let sampled = apart(|| sample(&folder, &file));
                give((file, sampled));
            };
            self.reading = Work::begin("picture", ui.ctx(), read).ok();
        }
    }

    fn convention(&mut self, ui: &mut Ui) {
        let now = Convention::NAMED
            .iter()
            .find(|n| n.convention == self.textures.convention);
        caption(ui, "Convention");
        ComboBox::from_id_salt("convention")
            .width(240.0)
            .selected_text(now.map_or("As below", |n| n.name))
            .show_ui(ui, |ui| {
                for named in Convention::NAMED {
                    let chosen = now.is_some_and(|n| n.name == named.name);
                    if ui
                        .selectable_label(chosen, named.name)
                        .on_hover_text(named.about)
                        .clicked()
                    {
                        self.textures.convention = named.convention;
                        if named.convention.encoding == Encoding::Angle {
                            self.textures.direction_v = None;
                        }
                    }
                }
            })
            .response
            .accessible_name("Convention")
            .on_hover_text("The program whose textures these are: sets all that stands below.");
        let about = now.map_or(
            "None of the conventions that have a name: the rows below say what the textures mean.",
            |n| n.about,
        );
        ui.add(egui::Label::new(RichText::new(about).color(Palette::of(ui).weak)).wrap());
    }

    fn slots(&mut self, ui: &mut Ui) {
        let c = self.textures.convention;
        let (first, second) = match (c.widths, c.curve, c.inverted) {
            (Widths::Alpha, ..) => ("Width along", "Width across"),
            (Widths::Gltf, ..) => ("Roughness", "Strength"),
            (_, _, true) => ("Smoothness", "Anisotropy"),
            (_, Curve::Square, _) => ("Roughness", "Anisotropy"),
            _ => ("Width", "Anisotropy"),
        };
        let two = c.encoding != Encoding::Angle;
        let (u, v) = match c.encoding {
            Encoding::Angle => ("Angle", ""),
            Encoding::Vector => ("Direction, right", "Direction, up"),
            Encoding::Double => ("cos 2\u{3b8}", "sin 2\u{3b8}"),
        };
        caption(ui, "Channels");
        let Self { seen, textures, .. } = self;
        egui::Grid::new("channels").num_columns(2).show(ui, |ui| {
            let slots = [
                (first, &mut textures.first),
                (second, &mut textures.second),
                (u, &mut textures.direction),
            ];
            for (label, slot) in slots {
                channel(ui, label, seen, slot);
            }
            if two {
                channel(ui, v, seen, &mut textures.direction_v);
            }
        });
        if !two || textures.direction.is_none() {
            textures.direction_v = None;
        }
    }

    fn meaning(&mut self, ui: &mut Ui) {
        let c = &mut self.textures.convention;
        egui::CollapsingHeader::new("What the numbers mean")
            .id_salt("meaning")
            .show(ui, |ui| {
                let scroll = egui::ScrollArea::vertical().max_height(220.0);
                scroll.show(ui, |ui| {
                    egui::Grid::new("meaning")
                        .num_columns(2)
                        .show(ui, |ui| meaning_rows(ui, c));
                });
            })
            .header_response
            .on_hover_text("Shows or hides every part of the convention, to be changed.");
    }

    fn preview(&mut self, ui: &mut Ui) {
        if self.reading.is_some() {
            ui.label("Reading\u{2026}");
            return;
        }
        if self.shown.as_ref().is_none_or(|s| s.of != self.textures) {
            self.shown = Shown::draw(ui, &self.seen, &self.textures).ok();
        }
        let Some(shown) = &self.shown else { return };
        for (texture, about) in [
            (&shown.lit, "The map in flat light."),
            (
                &shown.direction,
                "The direction of the x axis as hue; dark where widths are alike.",
            ),
        ] {
            let size = vec2(f32::from(SIDE as u16), f32::from(SIDE as u16));
            ui.add(egui::Image::new((texture.id(), size)).alt_text(about))
                .on_hover_text(about);
        }
        for line in &shown.says {
            ui.label(RichText::new(line).small());
        }
    }
}

impl Shown {
    fn draw(ui: &Ui, seen: &Seen, textures: &Textures) -> Result<Self, Error> {
        let map = seen.map(textures)?;
        let averages = Averages::new(&map);
        let canvas = Size::new(SIDE, SIDE)?;
        let camera = Camera2d::fit(map.size(), canvas, 1.0);
        let draw = |name: &str, view: View| {
            let mut rgba = vec![0; 4 * canvas.texels()];
            let all = canvas.rect();
            view.draw(&map, &averages, &camera, all, &mut rgba);
            let image = ColorImage::from_rgba_premultiplied([SIDE as usize; 2], &rgba);
            ui.ctx()
                .load_texture(name, image, egui::TextureOptions::LINEAR)
        };
        let range = |plane: &[f32]| {
            let low = plane.iter().copied().fold(f32::INFINITY, f32::min);
            let high = plane.iter().copied().fold(0.0, f32::max);
            format!("{low:.3} to {high:.3}")
        };
        let middle = map.texel(PLACES / 2, PLACES / 2);
        Ok(Self {
            of: textures.clone(),
            lit: draw("import lit", View::Lit(Lighting::default())),
            direction: draw("import direction", View::Direction),
            says: vec![
                format!("alpha_x {}", range(map.alpha_x())),
                format!("alpha_y {}", range(map.alpha_y())),
                format!(
                    "in the middle {:.3}, {:.3} at {:.1}\u{b0}",
                    middle.alpha_x,
                    middle.alpha_y,
                    middle.axis.degrees()
                ),
            ],
        })
    }
}

fn channel(ui: &mut Ui, label: &str, seen: &Seen, slot: &mut Option<Channel>) {
    ui.label(label);
    let text = |c: &Channel| format!("{}  {}", c.file, c.channel.to_uppercase());
    ComboBox::from_id_salt(("channel", label))
        .width(270.0)
        .truncate()
        .selected_text(slot.as_ref().map_or("none".to_owned(), text))
        .show_ui(ui, |ui| {
            ui.selectable_value(slot, None, "none")
                .on_hover_text("No picture holds it.");
            for (file, about) in &seen.files {
                for name in &about.channels {
                    let channel = Channel::new(&**file, &**name);
                    let words = text(&channel);
                    let tip = format!(
                        "Channel {} of {file}, {} texels.",
                        name.to_uppercase(),
                        about.size
                    );
                    ui.selectable_value(slot, Some(channel), words)
                        .on_hover_text(tip);
                }
            }
        })
        .response
        .accessible_name(label)
        .on_hover_text(format!("Which channel of which picture holds it: {label}."));
    ui.end_row();
}

/// One of a few meanings, each with its words and what they say.
fn pick<T: Copy + PartialEq>(
    ui: &mut Ui,
    (label, tip): (&str, &str),
    value: &mut T,
    all: &[(T, &str, &str)],
) {
    ui.label(label);
    let now = all.iter().find(|(v, ..)| v == value);
    let now = now.map_or("", |(_, text, _)| text);
    ComboBox::from_id_salt(label)
        .width(230.0)
        .truncate()
        .selected_text(now)
        .show_ui(ui, |ui| {
            for (one, text, says) in all {
                ui.selectable_value(value, *one, *text).on_hover_text(*says);
            }
        })
        .response
        .accessible_name(label)
        .on_hover_text(tip);
    ui.end_row();
}

fn tick(ui: &mut Ui, label: &str, value: &mut bool, tip: &str) {
    ui.label(label);
    let text = if *value { "yes" } else { "no" };
    ui.checkbox(value, text)
        .accessible_name(label)
        .on_hover_text(tip);
    ui.end_row();
}

fn number(
    ui: &mut Ui,
    (label, tip): (&str, &str),
    value: &mut f32,
    range: std::ops::RangeInclusive<f32>,
) {
    ui.label(label);
    let tip = format!(
        "{tip}\n{} to {}; drag, or click to type.",
        range.start(),
        range.end()
    );
    ui.add(
        DragValue::new(value)
            .range(range)
            .speed(0.01)
            .max_decimals(5),
    )
    .accessible_name(label)
    .on_hover_text(tip);
    ui.end_row();
}

/// A row for each part of a convention.
fn meaning_rows(ui: &mut Ui, c: &mut Convention) {
    let ways = Widths::ALL.map(|w| {
        let (text, says) = formula(w);
        (w, text, says)
    });
    let tip = "How two numbers tell the widths: a is the width of the first, s the second.";
    pick(ui, ("Widths by", tip), &mut c.widths, &ways);
    let curves = [
        (Curve::Linear, "a width", "It is taken as it is."),
        (
            Curve::Square,
            "a roughness: its square is the width",
            "As most programs store it.",
        ),
    ];
    let tip = "What the first number is; of two widths, the second too.";
    pick(ui, ("First number is", tip), &mut c.curve, &curves);
    let tip = "1 minus it is stored: smoothness, glossiness.";
    tick(ui, "Inverted", &mut c.inverted, tip);
    let tip = "The width that a stored 1 stands for.";
    number(ui, ("Width of a 1", tip), &mut c.scale, 1e-3..=100.0);
    let tip = "What the second number is multiplied by.";
    number(
        ui,
        ("Factor of the second", tip),
        &mut c.strength,
        0.0..=1.0,
    );
    let tip = "Of the second number a stored 0 is -1, a stored 0.5 is 0.";
    tick(ui, "Second from the middle", &mut c.second_from_middle, tip);
    let fits = [
        (
            LobeFit::Identity,
            "Ward or Beckmann",
            "The widths are taken as they are.",
        ),
        (
            LobeFit::WardToGgx,
            "GGX: the nearest Ward lobe",
            "Each width becomes that of the Ward lobe which comes nearest to the GGX lobe.",
        ),
    ];
    let tip = "The model that the widths were made for.";
    pick(ui, ("Lobe", tip), &mut c.lobe_fit, &fits);
    let encodings = [
        (
            Encoding::Angle,
            "an angle",
            "One number, a part of the degrees below. It must not be filtered.",
        ),
        (
            Encoding::Vector,
            "a vector",
            "Two numbers, cos \u{3b8} and sin \u{3b8}, of any length.",
        ),
        (
            Encoding::Double,
            "a vector of the doubled angle",
            "Two numbers, cos 2\u{3b8} and sin 2\u{3b8}, of any length.",
        ),
    ];
    let tip = "How numbers tell the direction.";
    pick(ui, ("Direction is", tip), &mut c.encoding, &encodings);
    let tip = "Of the direction's vector a stored 0 is -1, a stored 0.5 is 0.";
    tick(
        ui,
        "Vector from the middle",
        &mut c.direction_from_middle,
        tip,
    );
    let tip = "The degrees that a stored 1 of an angle stands for.";
    number(ui, ("Degrees of a 1", tip), &mut c.angle_range, 1.0..=720.0);
    let tip = "Angles grow clockwise; the second part of a vector points down the picture.";
    tick(ui, "Clockwise", &mut c.clockwise, tip);
    let tip = "Turned further by so much, counter-clockwise.";
    number(ui, ("Degrees added", tip), &mut c.rotation, -360.0..=360.0);
    let axes = [
        (
            Leads::Along,
            "the axis called along",
            "Of two widths, the axis of the first: the one that the widths' formula calls along.",
        ),
        (
            Leads::Highlight,
            "the highlight",
            "The axis with the larger width, along which highlights stretch.",
        ),
        (
            Leads::Grooves,
            "the grooves",
            "The axis with the smaller width, along which grooves run.",
        ),
    ];
    let tip = "Which axis the direction is of.";
    pick(ui, ("Direction of", tip), &mut c.leads, &axes);
}

/// What a way to tell the widths is called, and its formula: `a` is the width of the first number, `s` the second number.
fn formula(widths: Widths) -> (&'static str, &'static str) {
    match widths {
        Widths::Alpha => (
            "two widths",
            "Each number is a width: along = a, across = the second.",
        ),
        Widths::Gltf => (
            "glTF: mix(a, 1, s\u{b2})",
            "along = mix(a, 1, s\u{b2}), across = a.",
        ),
        Widths::Disney => (
            "Disney, Blender: 1 to 10 at most",
            "aspect = \u{221a}(1 - 0.9 s); along = a / aspect, across = a \u{b7} aspect.",
        ),
        Widths::StandardSurface => (
            "Standard Surface: 1 to 50 at most",
            "aspect = \u{221a}(1 - s), s at most 0.98; along = a / aspect, at most 1, across = a \u{b7} aspect.",
        ),
        Widths::OpenPbr => (
            "OpenPBR",
            "along = a \u{221a}(2 / (1 + (1 - s)\u{b2})), across = (1 - s) \u{b7} along.",
        ),
        Widths::KullaConty => (
            "Unreal, Unity: a (1 \u{b1} s)",
            "along = a (1 + s), across = a (1 - s), s from -1 to 1.",
        ),
        Widths::Glossy => (
            "Blender's glossy node",
            "s from -0.99 to 0.99. Over 0: along = a (1 - s), across = a / (1 - s); else along = a / (1 + s), across = a (1 + s).",
        ),
        Widths::Substance => (
            "Substance Painter: a / (1 - s)",
            "along = a, across = a / (1 - s).",
        ),
    }
}
