//! A set of textures that another program reads, back as Ward widths and directions.

use super::numbers::{Numbers, Plane};
use crate::convention::textures::{Convention, Encoding, Leads, Widths};
use crate::error::{Error, Result};
use crate::map::{AnisoMap, DEFAULT_TEXEL, Mended, Size, Texel, Wrap};
use glam::Vec2;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use std::collections::HashMap;
use std::path::{Path, PathBuf};

/// One channel of a file.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Channel {
    /// The file, from the recipe's folder.
    pub file: String,
    /// `r`, `g`, `b` or `a`; of an OpenEXR file any name it has. Default `r`, which is also what a grey picture has.
    #[serde(default = "red")]
    pub channel: String,
}

fn red() -> String {
    "r".to_owned()
}

impl Channel {
    /// A channel of a file.
    pub fn new(file: impl Into<String>, channel: impl Into<String>) -> Self {
        Self {
            file: file.into(),
            channel: channel.into(),
        }
    }
}

/// Channels of textures and what they mean.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Textures {
    /// The first number of the widths: a roughness, or the width along. Without it the textures tell the direction alone.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub first: Option<Channel>,
    /// The second number of the widths: an anisotropy, or the width across. Without it the widths are alike.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub second: Option<Channel>,
    /// The angle, or a vector's part along +U. Without it every direction is +U.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub direction: Option<Channel>,
    /// A vector's part toward image-up. Without it an angle is expected.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub direction_v: Option<Channel>,
    /// What the numbers mean.
    #[serde(default)]
    pub convention: Convention,
}

/// Texels that one thread converts at once.
const PART: usize = 1 << 14;

/// The longest name of a file or channel, in bytes.
const NAME_MAX: usize = 1024;

impl Textures {
    /// Its channels with their keys.
    pub fn channels(&self) -> impl Iterator<Item = (&'static str, &Channel)> {
        [
            ("first", &self.first),
            ("second", &self.second),
            ("direction", &self.direction),
            ("direction_v", &self.direction_v),
        ]
        .into_iter()
        .filter_map(|(key, channel)| Some((key, channel.as_ref()?)))
    }

    /// Its channels, to be changed.
    pub fn channels_mut(&mut self) -> impl Iterator<Item = &mut Channel> {
        let all = [
            &mut self.first,
            &mut self.second,
            &mut self.direction,
            &mut self.direction_v,
        ];
        all.into_iter().flatten()
    }

    /// Whether the textures can be read as they say, but for their files. Names a key of its own table alone.
    ///
    /// # Errors
    /// [`Error::Invalid`] for a number out of range, or a channel that is missing or means nothing.
    pub fn check(&self) -> Result<()> {
        let c = &self.convention;
        for (key, value, low, high) in [
            ("scale", c.scale, 1e-3, 100.0),
            ("strength", c.strength, 0.0, 1.0),
            ("angle_range", c.angle_range, 1.0, 720.0),
            ("rotation", c.rotation, -360.0, 360.0),
        ] {
            if !(low..=high).contains(&value) {
                let allowed = format!("allowed: {low} to {high}");
                return Err(Error::invalid(format!("convention.{key}"), value, allowed));
            }
        }
        let absent = |key: &str, allowed: &str| Err(Error::invalid(key, "missing", allowed));
        if self.first.is_none() && self.direction.is_none() {
            return absent("first", "allowed: only where `direction` names a channel");
        }
        if self.first.is_none() && self.second.is_some() {
            return absent("first", "allowed: only without `second`");
        }
        let two = c.encoding != Encoding::Angle;
        match (&self.direction, &self.direction_v) {
            (Some(_), None) if two => absent(
                "direction_v",
                "allowed: only with the encoding `angle`; a vector has two channels",
            ),
            (_, Some(v)) if !two || self.direction.is_none() => Err(Error::invalid(
                "direction_v",
                format!("`{}`", v.file),
                "allowed: only beside `direction`, with the encoding `vector` or `double`",
            )),
            _ => self.check_names(),
        }
    }

    fn check_names(&self) -> Result<()> {
        let too_long = |c: &Channel| c.file.len().max(c.channel.len()) > NAME_MAX;
        match self
            .channels()
            .find(|(_, c)| too_long(c) || c.file.is_empty())
        {
            None => Ok(()),
            Some((key, _)) => Err(Error::invalid(
                key,
                "no name of a file and channel",
                format!("allowed: 1 to {NAME_MAX} bytes"),
            )),
        }
    }

    /// Reads the files, which `find` finds by key and name, and makes them one map.
    ///
    /// # Errors
    /// As `find`, [`Textures::check`] and [`Numbers::open`], and when the files differ in size.
    pub fn read(
        &self,
        wrap: Wrap,
        mut find: impl FnMut(&str, &str) -> Result<PathBuf>,
    ) -> Result<(AnisoMap, Mended)> {
        self.check()?;
        let slots = [
            ("first.file", &self.first),
            ("second.file", &self.second),
            ("direction.file", &self.direction),
            ("direction_v.file", &self.direction_v),
        ];
        let mut paths = Vec::new();
        let mut open: HashMap<PathBuf, Numbers> = HashMap::new();
        for (key, channel) in slots {
            let path = channel.as_ref().map(|c| find(key, &c.file)).transpose()?;
            if let Some(path) = path.as_ref().filter(|path| !open.contains_key(*path)) {
                let numbers = Numbers::open(path)?;
                open.insert(path.clone(), numbers);
            }
            paths.push(path);
        }
        let mut common: Option<(Size, &Path)> = None;
        for path in paths.iter().flatten() {
            let size = open[path].size();
            let (want, other) = *common.get_or_insert((size, path));
            if size != want {
                return Err(differ(path, size, other, want));
            }
        }
        let plane = |n: usize| -> Result<Option<Plane<'_>>> {
            match (&paths[n], slots[n].1) {
                (Some(path), Some(c)) => open[path].channel(path, &c.channel).map(Some),
                _ => Ok(None),
            }
        };
        let planes = [plane(0)?, plane(1)?, plane(2)?, plane(3)?];
        let (size, _) = common.expect("a checked set has a file");
        AnisoMap::from_planes(size, wrap, self.convert(size, &planes))
    }

    /// Part by part, so that no number is held twice but those of the map and of the pictures.
    fn convert(&self, size: Size, planes: &[Option<Plane<'_>>; 4]) -> [Vec<f32>; 4] {
        let texels = size.texels();
        let mut made = [(); 4].map(|()| vec![0.0f32; texels]);
        let [x, y, cos2, sin2] = made.each_mut().map(|plane| plane.par_chunks_mut(PART));
        let parts = x.zip(y).zip(cos2).zip(sin2);
        parts.enumerate().for_each(|(n, (((x, y), cos2), sin2))| {
            for j in 0..x.len() {
                let i = n * PART + j;
                let of = |plane: &Option<Plane<'_>>| plane.as_ref().map(|p| p.number(i));
                let texel = self.texel(planes.each_ref().map(of));
                (x[j], y[j]) = (texel.alpha_x, texel.alpha_y);
                (cos2[j], sin2[j]) = (texel.axis.cos2, texel.axis.sin2);
            }
        });
        made
    }

    /// The texel that stored numbers tell: first, second, and the direction's two.
    pub fn texel(&self, [first, second, u, v]: [Option<f32>; 4]) -> Texel {
        let c = &self.convention;
        let none = match c.widths {
            Widths::Alpha => first.unwrap_or(0.0),
            _ if c.second_from_middle => 0.5,
            _ => 0.0,
        };
        let along_u = match (c.encoding, c.direction_from_middle) {
            (Encoding::Angle, _) => Vec2::ZERO,
            (_, true) => Vec2::new(1.0, 0.5),
            (_, false) => Vec2::X,
        };
        let direction = u.map_or(along_u, |u| Vec2::new(u, v.unwrap_or(0.0)));
        let told = c.texel(first.unwrap_or(0.0), second.unwrap_or(none), direction);
        match first {
            Some(_) => told,
            None => self.direction_alone(direction),
        }
    }

    /// The widths of a map that nothing was said of; highlights are across the x axis then, grooves along it.
    fn direction_alone(&self, direction: Vec2) -> Texel {
        let c = &self.convention;
        let along = Convention {
            widths: Widths::Alpha,
            leads: Leads::Along,
            ..*c
        };
        let axis = along.texel(0.5, 0.5, direction).axis;
        let x_leads = match c.leads {
            Leads::Grooves => true,
            Leads::Highlight => false,
            // Of these the x axis is the narrow one where nothing else is said: along of the width that is not stretched.
            Leads::Along => matches!(c.widths, Widths::Alpha | Widths::Substance | Widths::Glossy),
        };
        Texel {
            axis: if x_leads { axis } else { axis.perpendicular() },
            ..DEFAULT_TEXEL
        }
    }
}

fn differ(path: &Path, size: Size, other: &Path, want: Size) -> Error {
    let problem = format!("it is {size}, but {} is {want}", other.display());
    Error::file(path, problem).with_hint("Resize one to the size of the other")
}
