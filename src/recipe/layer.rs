//! A layer and its mask as they stand in a recipe.
//!
//! A layer is a table of plain keys and one table more, named after its source: `[layers.brushed]`. Serde has no derive
//! for "these keys, or the name of a variant" that keeps the place of a mistake in the file, so the reading is by hand.

use super::files::file_of_mesh;
use super::{Image, Stored, check_seed, number};
use crate::coverage::Outline;
use crate::error::{Error, Result};
use crate::guide::Guides;
use crate::map::Size;
use crate::paint::Strokes;
use crate::pattern::Pattern;
use glam::Vec2;
use serde::de::{
    DeserializeSeed, EnumAccess, Error as _, IntoDeserializer, MapAccess, Unexpected,
    VariantAccess, Visitor,
};
use serde::{Deserialize, Deserializer, Serialize, Serializer};
use std::fmt;
use std::sync::LazyLock;

/// One layer.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Layer {
    /// What it is called; no two layers share a name. Default: the name of its source.
    #[serde(skip_serializing_if = "String::is_empty")]
    pub name: String,
    /// Whether it takes part. Default true.
    pub visible: bool,
    /// How much of it shows, 0 to 1. Default 1.
    pub opacity: f32,
    /// How it goes over what lies below. Default `mix`.
    pub blend: Blend,
    /// Which channels it touches. Default: [`Source::channels`].
    pub channels: Channels,
    /// Its own seed. Default: one made of the recipe's seed and the layer's name, so that moving a layer up or down does
    /// not change what it looks like.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub seed: Option<u64>,
    /// The name that its randomness follows, as after it was given another: `steel`. Default: its own.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub seed_of: Option<String>,
    /// Where it shows. Default: everywhere.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub mask: Option<Mask>,
    /// What it shows.
    #[serde(flatten)]
    pub source: Source,
}

/// What a layer shows.
#[derive(Clone, Debug, PartialEq)]
pub enum Source {
    /// A pattern, in a table of its own name.
    Pattern(Pattern),
    /// A finished map from a file.
    Image(Image),
    /// A reduced map.
    Stored(Stored),
    /// What was painted: strokes over the composite below the layer.
    Strokes(Strokes),
    /// Guides and the field between them.
    Guides(Guides),
}

impl Source {
    /// The name of its table.
    pub fn name(&self) -> &'static str {
        match self {
            Self::Pattern(p) => p.name(),
            Self::Image(_) => "image",
            Self::Stored(_) => "stored",
            Self::Strokes(_) => "strokes",
            Self::Guides(_) => "guides",
        }
    }

    /// The channels that a layer of it touches when it does not say: all; of guides and textures that state no widths, the direction alone.
    pub fn channels(&self) -> Channels {
        match self {
            Self::Guides(g) if !g.has_widths() => Channels::DIRECTION,
            Self::Image(i) if i.is_direction_alone() => Channels::DIRECTION,
            _ => Channels::ALL,
        }
    }
}

impl Serialize for Source {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match self {
            Self::Pattern(p) => p.serialize(serializer),
            Self::Image(i) => serializer.serialize_newtype_variant("Source", 1, "image", i),
            Self::Stored(s) => serializer.serialize_newtype_variant("Source", 2, "stored", s),
            Self::Strokes(s) => serializer.serialize_newtype_variant("Source", 3, "strokes", s),
            Self::Guides(g) => serializer.serialize_newtype_variant("Source", 4, "guides", g),
        }
    }
}

/// How a layer goes over what lies below.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Blend {
    /// What is below, little by little, toward the layer; see [`crate::map::blend`].
    #[default]
    Mix,
}

/// Which channels a layer touches: in a recipe a list of the words `alpha_x`, `alpha_y`, `direction`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Channels {
    /// The width along the x axis.
    pub alpha_x: bool,
    /// The width across it.
    pub alpha_y: bool,
    /// The x axis.
    pub direction: bool,
}

impl Channels {
    /// All of them.
    pub const ALL: Self = Self {
        alpha_x: true,
        alpha_y: true,
        direction: true,
    };
    /// The direction alone.
    pub const DIRECTION: Self = Self {
        alpha_x: false,
        alpha_y: false,
        direction: true,
    };
}

#[derive(Clone, Copy, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
enum Channel {
    AlphaX,
    AlphaY,
    Direction,
}

impl Serialize for Channels {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let all = [
            (self.alpha_x, Channel::AlphaX),
            (self.alpha_y, Channel::AlphaY),
            (self.direction, Channel::Direction),
        ];
        serializer.collect_seq(all.into_iter().filter(|(on, _)| *on).map(|(_, c)| c))
    }
}

impl<'de> Deserialize<'de> for Channels {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let words = Vec::<Channel>::deserialize(deserializer)?;
        if words.is_empty() {
            return Err(D::Error::invalid_value(
                Unexpected::Other("an empty list"),
                &"at least one of alpha_x, alpha_y, direction",
            ));
        }
        let has = |f: fn(&Channel) -> bool| words.iter().any(f);
        Ok(Self {
            alpha_x: has(|c| matches!(c, Channel::AlphaX)),
            alpha_y: has(|c| matches!(c, Channel::AlphaY)),
            direction: has(|c| matches!(c, Channel::Direction)),
        })
    }
}

/// Where a layer shows, as a weight from 0 to 1.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Mask {
    /// Takes one minus the weight. Default false.
    pub invert: bool,
    /// The pattern's value at and below which the weight is 0; 0 to 1. Default 0. Patterns only.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub low: Option<f32>,
    /// The pattern's value from which on the weight is 1, with a smooth step between; 0 to 1, over `low`. Default 1.
    /// Patterns only.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub high: Option<f32>,
    /// How wide the edge of a polygon or path fades, in surface units; 0 to 1. Default 0. Shapes only.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub feather: Option<f32>,
    /// The weight before the first stroke, 0 to 1. Default 0. Strokes only.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub start: Option<f32>,
    /// The pattern's own seed. Default: made of the layer's.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub seed: Option<u64>,
    /// What is drawn or read.
    #[serde(flatten)]
    pub source: MaskSource,
}

/// What a mask is made of.
#[derive(Clone, Debug, PartialEq)]
pub enum MaskSource {
    /// A pattern's value.
    Pattern(Pattern),
    /// The inside of a polygon, [u, v] each, v up; -1 to 2. Where the map repeats, so does the polygon.
    Polygon(Vec<Vec2>),
    /// The inside (nonzero rule) of SVG path data in UV units, v up.
    Path(String),
    /// What strokes cover: each adds its coverage, erasing takes it away.
    Strokes(Strokes),
}

impl Serialize for MaskSource {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match self {
            Self::Pattern(p) => p.serialize(serializer),
            Self::Polygon(points) => {
                serializer.serialize_newtype_variant("MaskSource", 1, "polygon", points)
            }
            Self::Path(data) => serializer.serialize_newtype_variant("MaskSource", 2, "path", data),
            Self::Strokes(strokes) => {
                serializer.serialize_newtype_variant("MaskSource", 3, "strokes", strokes)
            }
        }
    }
}

impl MaskSource {
    /// The key it stands under.
    pub fn name(&self) -> &'static str {
        match self {
            Self::Pattern(p) => p.name(),
            Self::Polygon(_) => "polygon",
            Self::Path(_) => "path",
            Self::Strokes(_) => "strokes",
        }
    }

    /// Whether it is the inside of a shape.
    pub(super) fn is_drawn(&self) -> bool {
        matches!(self, Self::Polygon(_) | Self::Path(_))
    }

    /// The outline of a polygon or path; `None` for anything else.
    pub(super) fn outline(&self) -> Option<Result<Outline>> {
        match self {
            Self::Pattern(_) | Self::Strokes(_) => None,
            Self::Polygon(points) => Some(Outline::from_polygon(points)),
            Self::Path(data) => Some(Outline::from_svg(data)),
        }
    }
}

impl Layer {
    /// A layer of everything by default but its source.
    pub fn new(source: Source) -> Self {
        Self {
            name: String::new(),
            visible: true,
            opacity: 1.0,
            blend: Blend::Mix,
            channels: source.channels(),
            seed: None,
            seed_of: None,
            mask: None,
            source,
        }
    }

    /// Its name, or that of its source where it has none.
    pub fn name(&self) -> &str {
        if self.name.is_empty() {
            self.source.name()
        } else {
            &self.name
        }
    }

    /// The seed of its source in a recipe with `seed`.
    pub(super) fn seed_in(&self, seed: u64) -> u64 {
        self.seed
            .unwrap_or_else(|| derived_seed(seed, self.random_name()))
    }

    /// Whether any of it was painted on a mesh.
    pub fn needs_mesh(&self) -> bool {
        self.all_strokes().any(Strokes::need_mesh)
    }

    /// Its strokes, where it holds such, or those of its mask, where that is painted.
    pub fn strokes(&self, of_mask: bool) -> Option<&Strokes> {
        match (&self.source, self.mask.as_ref().map(|m| &m.source)) {
            (_, Some(MaskSource::Strokes(strokes))) if of_mask => Some(strokes),
            (Source::Strokes(strokes), _) if !of_mask => Some(strokes),
            _ => None,
        }
    }

    /// As [`Layer::strokes`], to be changed.
    pub fn strokes_mut(&mut self, of_mask: bool) -> Option<&mut Strokes> {
        match (&mut self.source, self.mask.as_mut().map(|m| &mut m.source)) {
            (_, Some(MaskSource::Strokes(strokes))) if of_mask => Some(strokes),
            (Source::Strokes(strokes), _) if !of_mask => Some(strokes),
            _ => None,
        }
    }

    /// Its own strokes and those of its mask.
    pub(super) fn all_strokes(&self) -> impl Iterator<Item = &Strokes> {
        [self.strokes(false), self.strokes(true)]
            .into_iter()
            .flatten()
    }

    /// As [`Layer::all_strokes`], to be changed.
    pub(crate) fn all_strokes_mut(&mut self) -> impl Iterator<Item = &mut Strokes> {
        let own = match &mut self.source {
            Source::Strokes(strokes) => Some(strokes),
            _ => None,
        };
        let of_mask = match self.mask.as_mut().map(|m| &mut m.source) {
            Some(MaskSource::Strokes(strokes)) => Some(strokes),
            _ => None,
        };
        own.into_iter().chain(of_mask)
    }

    /// Every file that it names: images, stored maps and meshes.
    pub(crate) fn files(&self) -> Vec<&str> {
        let mut files: Vec<&str> = match &self.source {
            Source::Image(image) => image.files().map(String::as_str).collect(),
            Source::Stored(stored) => stored.files().map(String::as_str).collect(),
            Source::Strokes(_) | Source::Pattern(_) | Source::Guides(_) => vec![],
        };
        let meshes = self.all_strokes().filter_map(|s| s.mesh.as_ref());
        files.extend(meshes.filter_map(|m| file_of_mesh(m)));
        files
    }

    /// The name that its randomness follows.
    pub fn random_name(&self) -> &str {
        self.seed_of.as_deref().unwrap_or_else(|| self.name())
    }

    pub(super) fn check(&self, at: &str) -> Result<()> {
        number(format!("{at}.opacity"), self.opacity, 0.0..=1.0)?;
        check_seed(format!("{at}.seed"), self.seed.unwrap_or(0))?;
        if let Some(mask) = &self.mask {
            mask.check(&format!("{at}.mask"))?;
        }
        match &self.source {
            Source::Pattern(p) => p.validate().map_err(below(format!("{at}.{}", p.name()))),
            Source::Stored(s) => s.check().map_err(below(format!("{at}.stored"))),
            Source::Strokes(s) => s.check().map_err(below(format!("{at}.strokes"))),
            Source::Guides(g) => g.check().map_err(below(format!("{at}.guides"))),
            Source::Image(i) => i.check().map_err(below(format!("{at}.image"))),
        }
    }
}

impl Mask {
    /// A mask of everything by default but its source.
    pub fn new(source: MaskSource) -> Self {
        Self {
            invert: false,
            low: None,
            high: None,
            feather: None,
            start: None,
            seed: None,
            source,
        }
    }

    /// `low` and `high`, or their defaults.
    pub(super) fn thresholds(&self) -> (f32, f32) {
        (self.low.unwrap_or(0.0), self.high.unwrap_or(1.0))
    }

    fn check(&self, at: &str) -> Result<()> {
        let (low, high) = self.thresholds();
        number(format!("{at}.low"), low, 0.0..=1.0)?;
        number(format!("{at}.high"), high, 0.0..=1.0)?;
        number(
            format!("{at}.feather"),
            self.feather.unwrap_or(0.0),
            0.0..=1.0,
        )?;
        check_seed(format!("{at}.seed"), self.seed.unwrap_or(0))?;
        if low >= high {
            return Err(Error::invalid(
                format!("{at}.low"),
                low,
                format!("allowed: less than `high`, which is {high}"),
            ));
        }
        number(format!("{at}.start"), self.start.unwrap_or(0.0), 0.0..=1.0)?;
        let key = format!("{at}.{}", self.source.name());
        if !matches!(self.source, MaskSource::Strokes(_)) {
            self.refuse(at, [("start", self.start)], "strokes")?;
        }
        if !self.source.is_drawn() {
            self.refuse(at, [("feather", self.feather)], "a polygon or path")?;
        }
        if !matches!(self.source, MaskSource::Pattern(_)) {
            let thresholds = [("low", self.low), ("high", self.high)];
            self.refuse(at, thresholds, "a pattern")?;
        }
        match &self.source {
            MaskSource::Pattern(p) => p.validate().map_err(below(key)),
            MaskSource::Strokes(s) => s.check().map_err(below(key)),
            shape => {
                let outline = shape.outline().expect("no pattern");
                outline.map(drop).map_err(below(key))
            }
        }
    }

    /// A key that means nothing here would be ignored in silence: refuse it.
    fn refuse<const N: usize>(
        &self,
        at: &str,
        keys: [(&str, Option<f32>); N],
        belongs_to: &str,
    ) -> Result<()> {
        for (key, value) in keys {
            if let Some(value) = value {
                return Err(Error::invalid(
                    format!("{at}.{key}"),
                    value,
                    format!(
                        "allowed: only in a mask of {belongs_to}, and this one is of `{}`",
                        self.source.name()
                    ),
                ));
            }
        }
        Ok(())
    }
}

/// Puts `at` before the key that an error names; an error that names no key gets `at` alone.
pub(crate) fn below(at: String) -> impl FnOnce(Error) -> Error {
    move |error| match error {
        Error::Invalid {
            what,
            value,
            allowed,
            hint,
        } => Error::Invalid {
            what: if what.is_empty() {
                at
            } else {
                format!("{at}.{what}")
            },
            value,
            allowed,
            hint,
        },
        other => other,
    }
}

/// A seed made of another and a name: FNV-1a of the name, then the mixing step of SplitMix64 (Steele, Lea and Flood 2014),
/// so that neighbouring seeds and similar names share nothing.
pub(super) fn derived_seed(seed: u64, name: &str) -> u64 {
    let hash = name.bytes().fold(0xcbf2_9ce4_8422_2325, |h: u64, b| {
        (h ^ u64::from(b)).wrapping_mul(0x0100_0000_01b3)
    });
    let z = seed.wrapping_mul(0x9e37_79b9_7f4a_7c15).wrapping_add(hash);
    let z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}

/// A whole number that may be a seed.
pub(super) fn seed<'de, D: Deserializer<'de>>(deserializer: D) -> Result<u64, D::Error> {
    let value = i64::deserialize(deserializer)?;
    u64::try_from(value).map_err(|_| {
        D::Error::invalid_value(
            Unexpected::Signed(value),
            &"a whole number from 0 to 9223372036854775807",
        )
    })
}

/// A [`Seed`] is a `u64` that reads with [`seed`].
#[derive(Deserialize)]
#[serde(transparent)]
struct Seed(#[serde(deserialize_with = "seed")] u64);

/// `1024` or `[2048, 512]`.
pub(super) mod size {
    use super::*;

    pub(crate) fn serialize<S: Serializer>(size: &Size, serializer: S) -> Result<S::Ok, S::Error> {
        if size.width() == size.height() {
            serializer.serialize_u32(size.width())
        } else {
            serializer.collect_seq([size.width(), size.height()])
        }
    }

    pub(crate) fn deserialize<'de, D: Deserializer<'de>>(d: D) -> Result<Size, D::Error> {
        struct Sides;
        impl<'de> Visitor<'de> for Sides {
            type Value = [i64; 2];
            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("N or [W, H], in texels, as in 1024 or [1000, 600]")
            }
            fn visit_i64<E: serde::de::Error>(self, n: i64) -> Result<Self::Value, E> {
                Ok([n, n])
            }
            fn visit_u64<E: serde::de::Error>(self, n: u64) -> Result<Self::Value, E> {
                Ok([i64::try_from(n).unwrap_or(i64::MAX); 2])
            }
            fn visit_seq<A: serde::de::SeqAccess<'de>>(
                self,
                mut seq: A,
            ) -> Result<Self::Value, A::Error> {
                let mut sides = Vec::new();
                while let Some(side) = seq.next_element()? {
                    sides.push(side);
                }
                match sides[..] {
                    [w, h] => Ok([w, h]),
                    _ => Err(A::Error::invalid_length(sides.len(), &self)),
                }
            }
        }
        let [w, h] = d.deserialize_any(Sides)?;
        // Numbers past u32 are still numbers: let the range check speak.
        let side = |n: i64| u32::try_from(n).unwrap_or(if n < 0 { 0 } else { u32::MAX });
        Size::new(side(w), side(h)).map_err(|e| match e {
            Error::Invalid { allowed, .. } => {
                D::Error::custom(format!("{w}x{h} is no size; {allowed}"))
            }
            other => D::Error::custom(other),
        })
    }
}

const LAYER_FIELDS: [&str; 8] = [
    "name", "visible", "opacity", "blend", "channels", "seed", "seed_of", "mask",
];
pub(super) const LAYER_SOURCES: [&str; 4] = ["image", "stored", "strokes", "guides"];
const MASK_FIELDS: [&str; 6] = ["invert", "low", "high", "feather", "start", "seed"];
const MASK_SOURCES: [&str; 3] = ["polygon", "path", "strokes"];

static LAYER_KEYS: LazyLock<Vec<&str>> =
    LazyLock::new(|| [&LAYER_FIELDS[..], &Pattern::NAMES, &LAYER_SOURCES].concat());
static MASK_KEYS: LazyLock<Vec<&str>> =
    LazyLock::new(|| [&MASK_FIELDS[..], &Pattern::NAMES, &MASK_SOURCES].concat());

/// What a layer or mask without its source says; a lenient reader knows it by these words.
pub(super) const NO_SOURCE: &str = "has no source";

fn no_source<E: serde::de::Error>(whose: &str, others: &[&str]) -> E {
    let names = [&Pattern::NAMES[..], others].concat();
    E::custom(format!(
        "the {whose} {NO_SOURCE}; allowed: exactly one of {}",
        names.join(", ")
    ))
}

fn two_sources<E: serde::de::Error>(whose: &str, first: &str, second: &str) -> E {
    E::custom(format!(
        "the {whose} has both `{first}` and `{second}`; allowed: one source, so make a layer of each"
    ))
}

impl<'de> Deserialize<'de> for Layer {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_map(LayerVisitor)
    }
}

struct LayerVisitor;

impl<'de> Visitor<'de> for LayerVisitor {
    type Value = Layer;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a table: a layer with one source")
    }

    fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<Layer, A::Error> {
        let blank = Source::Pattern(Pattern::Constant(crate::pattern::Constant::default()));
        let mut layer = Layer::new(blank);
        let mut source: Option<Source> = None;
        let mut channels = None;
        while let Some(key) = map.next_key_seed(OneOf(&LAYER_KEYS))? {
            match key {
                "name" => layer.name = map.next_value()?,
                "visible" => layer.visible = map.next_value()?,
                "opacity" => layer.opacity = map.next_value()?,
                "blend" => layer.blend = map.next_value()?,
                "channels" => channels = Some(map.next_value()?),
                "seed" => layer.seed = Some(map.next_value::<Seed>()?.0),
                "seed_of" => layer.seed_of = Some(map.next_value()?),
                "mask" => layer.mask = Some(map.next_value()?),
                name => {
                    if let Some(first) = &source {
                        return Err(two_sources("layer", first.name(), name));
                    }
                    source = Some(match name {
                        "image" => Source::Image(map.next_value()?),
                        "stored" => Source::Stored(map.next_value()?),
                        "strokes" => Source::Strokes(map.next_value()?),
                        "guides" => Source::Guides(map.next_value()?),
                        pattern => Source::Pattern(pattern_of(pattern, &mut map)?),
                    });
                }
            }
        }
        layer.source = source.ok_or_else(|| no_source("layer", &LAYER_SOURCES))?;
        layer.channels = channels.unwrap_or(layer.source.channels());
        Ok(layer)
    }
}

impl<'de> Deserialize<'de> for Mask {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_map(MaskVisitor)
    }
}

struct MaskVisitor;

impl<'de> Visitor<'de> for MaskVisitor {
    type Value = Mask;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a table: a mask with one source")
    }

    fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<Mask, A::Error> {
        let mut mask = Mask::new(MaskSource::Polygon(Vec::new()));
        let mut source: Option<MaskSource> = None;
        while let Some(key) = map.next_key_seed(OneOf(&MASK_KEYS))? {
            match key {
                "invert" => mask.invert = map.next_value()?,
                "low" => mask.low = Some(map.next_value()?),
                "high" => mask.high = Some(map.next_value()?),
                "feather" => mask.feather = Some(map.next_value()?),
                "start" => mask.start = Some(map.next_value()?),
                "seed" => mask.seed = Some(map.next_value::<Seed>()?.0),
                name => {
                    if let Some(first) = &source {
                        return Err(two_sources("mask", first.name(), name));
                    }
                    source = Some(match name {
                        "polygon" => MaskSource::Polygon(map.next_value()?),
                        "path" => MaskSource::Path(map.next_value()?),
                        "strokes" => MaskSource::Strokes(map.next_value()?),
                        pattern => MaskSource::Pattern(pattern_of(pattern, &mut map)?),
                    });
                }
            }
        }
        mask.source = source.ok_or_else(|| no_source("mask", &MASK_SOURCES))?;
        Ok(mask)
    }
}

/// Reads a key that must be one of these words; the error stands at the key.
struct OneOf(&'static [&'static str]);

impl<'de> DeserializeSeed<'de> for OneOf {
    type Value = &'static str;
    fn deserialize<D: Deserializer<'de>>(self, deserializer: D) -> Result<Self::Value, D::Error> {
        deserializer.deserialize_identifier(self)
    }
}

impl Visitor<'_> for OneOf {
    type Value = &'static str;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a key")
    }

    fn visit_str<E: serde::de::Error>(self, word: &str) -> Result<Self::Value, E> {
        let known = self.0.iter().find(|k| **k == word);
        known.copied().ok_or_else(|| E::unknown_field(word, self.0))
    }
}

/// The pattern called `name` whose table is the map's next value.
fn pattern_of<'de, A: MapAccess<'de>>(
    name: &'static str,
    map: &mut A,
) -> Result<Pattern, A::Error> {
    Pattern::deserialize(Entry { name, map })
}

/// One entry of a map, its key read already, as an enum whose variant is the key.
struct Entry<'a, A> {
    name: &'static str,
    map: &'a mut A,
}

impl<'de, A: MapAccess<'de>> Deserializer<'de> for Entry<'_, A> {
    type Error = A::Error;

    fn deserialize_any<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, A::Error> {
        visitor.visit_enum(self)
    }

    serde::forward_to_deserialize_any! {
        bool i8 i16 i32 i64 i128 u8 u16 u32 u64 u128 f32 f64 char str string bytes byte_buf option unit unit_struct
        newtype_struct seq tuple tuple_struct map struct enum identifier ignored_any
    }
}

impl<'de, A: MapAccess<'de>> EnumAccess<'de> for Entry<'_, A> {
    type Error = A::Error;
    type Variant = Self;

    fn variant_seed<V: DeserializeSeed<'de>>(self, seed: V) -> Result<(V::Value, Self), A::Error> {
        let name: serde::de::value::StrDeserializer<'_, A::Error> = self.name.into_deserializer();
        Ok((seed.deserialize(name)?, self))
    }
}

impl<'de, A: MapAccess<'de>> VariantAccess<'de> for Entry<'_, A> {
    type Error = A::Error;

    fn newtype_variant_seed<T: DeserializeSeed<'de>>(self, seed: T) -> Result<T::Value, A::Error> {
        self.map.next_value_seed(seed)
    }

    fn unit_variant(self) -> Result<(), A::Error> {
        Err(not_a_table(self.name))
    }

    fn tuple_variant<V: Visitor<'de>>(self, _: usize, _: V) -> Result<V::Value, A::Error> {
        Err(not_a_table(self.name))
    }

    fn struct_variant<V: Visitor<'de>>(
        self,
        _: &'static [&'static str],
        _: V,
    ) -> Result<V::Value, A::Error> {
        Err(not_a_table(self.name))
    }
}

fn not_a_table<E: serde::de::Error>(name: &str) -> E {
    E::custom(format!("`{name}` must be a table"))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn layer(text: &str) -> Result<Layer, String> {
        toml::from_str(text).map_err(|e| e.message().to_owned())
    }

    #[test]
    fn a_layer_has_exactly_one_source() {
        let one = layer("opacity = 0.5\nseed = 3\n[constant]\nalpha_x = 0.1").unwrap();
        assert_eq!(
            (one.opacity, one.seed, one.name()),
            (0.5, Some(3), "constant")
        );
        assert!(layer("opacity = 0.5").unwrap_err().contains(NO_SOURCE));
        let both = layer("[mask]\npolygon = []\npath = ''\n[constant]").unwrap_err();
        assert!(
            both.contains("`polygon`") && both.contains("`path`"),
            "{both}"
        );
    }

    #[test]
    fn unknown_keys_channels_and_negative_seeds_are_refused() {
        assert!(
            layer("opactiy = 1\n[constant]")
                .unwrap_err()
                .contains("unknown field `opactiy`")
        );
        assert!(
            layer("[constnat]")
                .unwrap_err()
                .contains("unknown field `constnat`")
        );
        assert!(
            layer("[constant]\nalpha = 1")
                .unwrap_err()
                .contains("unknown field `alpha`")
        );
        assert!(layer("channels = []\n[constant]").is_err());
        assert!(layer("channels = ['alpha_z']\n[constant]").is_err());
        assert!(
            layer("seed = -1\n[constant]")
                .unwrap_err()
                .contains("from 0 to")
        );
    }

    #[test]
    fn a_layer_writes_what_it_reads() {
        let text = "name = 'top'\nchannels = ['direction']\n[mask]\nfeather = 0.1\npolygon = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0]]\n[constant]\nangle = 30.0";
        let one = layer(text).unwrap();
        let back = layer(&toml::to_string(&one).unwrap()).unwrap();
        assert_eq!(one, back);
        assert!(!one.channels.alpha_x && one.channels.direction);
    }

    #[test]
    fn what_means_nothing_in_a_mask_is_refused() {
        let check = |mask: &str| {
            let text = format!("[mask]\n{mask}\n[constant]");
            layer(&text)
                .unwrap()
                .check("layers.0")
                .map_err(|e| e.to_string())
        };
        assert!(check("polygon = [[0, 0], [1, 0], [1, 1]]\nfeather = 0.1").is_ok());
        let e = check("polygon = [[0, 0], [1, 0], [1, 1]]\nlow = 0.1").unwrap_err();
        assert!(
            e.contains("layers.0.mask.low") && e.contains("polygon"),
            "{e}"
        );
        let e = check("feather = 0.1\n[mask.constant]").unwrap_err();
        assert!(e.contains("layers.0.mask.feather"), "{e}");
        let e = check("low = 0.5\nhigh = 0.5\n[mask.constant]").unwrap_err();
        assert!(e.contains("less than `high`"), "{e}");
        let e = check("[mask.constant]\nalpha_x = 0.0").unwrap_err();
        assert!(e.contains("layers.0.mask.constant.alpha_x"), "{e}");
        assert!(
            check("path = 'M 0 0 L 1'")
                .unwrap_err()
                .contains("layers.0.mask.path")
        );
    }

    #[test]
    fn guides_touch_the_direction_unless_they_state_widths() {
        let guides = |keys: &str| {
            let text = format!("{keys}\n[[guides.guide]]\nshape.ellipse.radii = [0.3, 0.3]");
            let one = layer(&text).unwrap();
            let back = layer(&toml::to_string(&one).unwrap()).unwrap();
            assert_eq!(one, back);
            one.check("layers.0").unwrap();
            one.channels
        };
        assert_eq!(guides(""), Channels::DIRECTION);
        assert_eq!(guides("guides.alpha_along = 0.05"), Channels::ALL);
        let stated = "channels = ['alpha_x', 'direction']\nguides.alpha_along = 0.05";
        assert!(!guides(stated).alpha_y);
        assert_eq!(
            guides("channels = ['alpha_x', 'alpha_y', 'direction']"),
            Channels::ALL
        );
    }

    #[test]
    fn mistakes_in_guides_are_named() {
        let refused = |text: &str| match layer(text) {
            Err(message) => message,
            Ok(one) => one.check("layers.0").unwrap_err().to_string(),
        };
        for (text, parts) in [
            ("[guides]\ngird = 3", ["unknown field `gird`", "grid"]),
            (
                "[guides]\ngrid = 8",
                ["layers.0.guides.grid is 8", "16 to 4096"],
            ),
            (
                "[[guides.guide]]\nfalloff = 1",
                ["missing field `shape`", ""],
            ),
            (
                "[[guides.guide]]\nshape.oval = 1",
                ["unknown variant `oval`", "ellipse"],
            ),
            (
                "[[guides.guide]]\nshape.ellipse = {}",
                ["missing field `radii`", ""],
            ),
            (
                "[[guides.guide]]\nshape.ellipse.radii = [0.1, 0.1]\nmode = 'along'",
                ["unknown variant `along`", "concentric"],
            ),
            (
                "[[guides.guide]]\nshape.line.points = [[0, 0]]",
                ["layers.0.guides.guide.0.shape.line.points", "2 or more"],
            ),
            (
                "[[guides.guide]]\nshape.ellipse.radii = [0.1, nan]",
                [
                    "layers.0.guides.guide.0.shape.ellipse.radii is NaN",
                    "0.001 to 10",
                ],
            ),
        ] {
            let message = refused(text);
            assert!(
                parts.iter().all(|p| message.contains(p)),
                "{text}: {message}"
            );
        }
    }

    #[test]
    fn seeds_follow_names_not_places() {
        assert_ne!(derived_seed(1, "a"), derived_seed(1, "b"));
        assert_ne!(derived_seed(1, "a"), derived_seed(2, "a"));
        let mut named = layer("name = 'x'\n[constant]").unwrap();
        assert_eq!(named.seed_in(7), derived_seed(7, "x"));
        named.seed_of = Some("y".to_owned());
        assert_eq!(named.seed_in(7), derived_seed(7, "y"));
        named.seed = Some(5);
        assert_eq!(named.seed_in(7), 5);
    }
}
