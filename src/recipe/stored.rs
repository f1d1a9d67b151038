//! A reduced map as a layer's source: stored numbers with what they mean, laid over the whole map.
//!
//! What does not change over the surface stands as a number in the recipe, what does lies in a file. A file of one row or one
//! column is a strip along u or v; with `radial` it is a table from a centre outward.

use super::{Files, number};
use crate::convention::storage::{
    AxisEncoding, AxisStorage, Codes, Depth, WidthEncoding, WidthStorage,
};
use crate::error::{Error, Result};
use crate::filter::{Disc, center_of, reduce};
use crate::import::codes::{Picture, read_codes};
use crate::map::{ALPHA_MAX, ALPHA_MIN, AnisoMap, DEFAULT_TEXEL, Size, Texel, Wrap};
use crate::math::Axis;
use crate::pattern::{Fill, Patch, Surface};
use glam::Vec2;
use serde::{Deserialize, Serialize};
use std::path::Path;

/// Texels that a stored file may have whatever the map's size: 256 MiB as a map.
const TEXELS_ALWAYS: u64 = 1 << 24;
/// Texels that it may have for each of its bytes: more than surfaces pack to, far fewer than the 1032 of an empty picture.
const TEXELS_A_BYTE: u64 = 64;

/// Widths and axis, each from a file or the same everywhere.
///
/// A file is a PNG of codes, or an OpenEXR of halves or floats, whose numbers are what the encoding makes of a width: `linear`
/// the width itself.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Stored {
    /// The file of both widths, from the recipe's folder: grey where both are alike, else grey for alpha_x with a second channel
    /// for alpha_y.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub widths: Option<String>,
    /// What the codes of the widths are even steps of.
    pub encoding: WidthEncoding,
    /// The width of the code 0, from 0; over 0 for `log`.
    pub low: f32,
    /// The width of the largest code, over `low`, to 2.
    pub high: f32,
    /// alpha_x without a file of widths or one of its own.
    pub alpha_x: f32,
    /// alpha_y without a file of widths or one of its own.
    pub alpha_y: f32,
    /// The file of the axis.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub axis: Option<String>,
    /// What the codes of the axis mean: `double` and `vector` have two channels, `angle` one.
    pub axis_encoding: AxisEncoding,
    /// The angle of the x axis without a file of axes, in degrees counter-clockwise from +U; with `radial`, from the outward
    /// direction.
    pub angle: f32,
    /// A file of alpha_x alone; only without `widths`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub x: Option<StoredWidth>,
    /// A file of alpha_y alone; only without `widths`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub y: Option<StoredWidth>,
    /// The files are tables from a centre outward.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub radial: Option<Radius>,
}

/// One width in a file of its own.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct StoredWidth {
    /// The file, from the recipe's folder, one number a texel.
    pub file: String,
    /// What the codes are even steps of.
    pub encoding: WidthEncoding,
    /// The width of the code 0, from 0; over 0 for `log`. Floats do not use it.
    #[serde(default = "least")]
    pub low: f32,
    /// The width of the largest code, over `low`, to 2. Floats do not use it.
    #[serde(default = "most")]
    pub high: f32,
}

fn least() -> f32 {
    ALPHA_MIN
}

fn most() -> f32 {
    ALPHA_MAX
}

/// Where a table from a centre outward lies.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Radius {
    /// The centre in UV units, -10 to 10.
    pub center: [f32; 2],
    /// The radius where the table ends, in surface units; 0.0001 to 1000.
    pub reach: f32,
}

impl Radius {
    /// On a surface of this aspect.
    pub fn disc(&self, aspect: f32) -> Disc {
        Disc {
            center: Vec2::from(self.center),
            reach: self.reach,
            aspect,
        }
    }
}

impl Default for Stored {
    fn default() -> Self {
        Self {
            widths: None,
            encoding: WidthEncoding::Log,
            low: ALPHA_MIN,
            high: ALPHA_MAX,
            alpha_x: DEFAULT_TEXEL.alpha_x,
            alpha_y: DEFAULT_TEXEL.alpha_y,
            axis: None,
            axis_encoding: AxisEncoding::Double,
            angle: 0.0,
            x: None,
            y: None,
            radial: None,
        }
    }
}

impl Stored {
    /// The names of its files, to be changed when the recipe moves.
    pub(super) fn files_mut(&mut self) -> impl Iterator<Item = &mut String> {
        let alone = [&mut self.x, &mut self.y].into_iter().flatten();
        let alone = alone.map(|width| &mut width.file);
        self.widths.iter_mut().chain(alone).chain(&mut self.axis)
    }

    /// The names of its files.
    pub(super) fn files(&self) -> impl Iterator<Item = &String> {
        let alone = [&self.x, &self.y].into_iter().flatten();
        let alone = alone.map(|width| &width.file);
        self.widths.iter().chain(alone).chain(&self.axis)
    }

    /// Names a key of its own table alone.
    pub(super) fn check(&self) -> Result<()> {
        number("alpha_x", self.alpha_x, ALPHA_MIN..=ALPHA_MAX)?;
        number("alpha_y", self.alpha_y, ALPHA_MIN..=ALPHA_MAX)?;
        number("angle", self.angle, -360.0..=360.0)?;
        check_range("", self.width_storage(Depth::U8))?;
        for (key, width) in [("x", &self.x), ("y", &self.y)] {
            let Some(width) = width else { continue };
            if self.widths.is_some() {
                let allowed = "allowed: only without `widths`, which is a file of both";
                return Err(Error::invalid(key, format!("`{}`", width.file), allowed));
            }
            check_range(&format!("{key}."), width.storage(Depth::U8))?;
        }
        if let Some(radial) = &self.radial {
            number("radial.center.0", radial.center[0], -10.0..=10.0)?;
            number("radial.center.1", radial.center[1], -10.0..=10.0)?;
            number("radial.reach", radial.reach, 1e-4..=1e3)?;
        }
        Ok(())
    }

    fn width_storage(&self, depth: Depth) -> WidthStorage {
        WidthStorage {
            depth,
            encoding: self.encoding,
            low: self.low,
            high: self.high,
        }
    }

    /// Reads the files, which `at` names as the layer's table, and makes them one map.
    pub(super) fn prepare(&self, at: &str, surface: &Surface, files: &Files) -> Result<Table> {
        let read = |key: &str, name: Option<&String>| {
            name.map_or(Ok(None), |name| {
                let path = files.resolve(&format!("{at}.{key}"), name)?;
                Ok(Some((read_codes(&path)?, path)))
            })
        };
        let alone = |width: &'_ Option<StoredWidth>| width.as_ref().map(|w| w.file.clone());
        let pictures = [
            read("widths", self.widths.as_ref())?,
            read("x.file", alone(&self.x).as_ref())?,
            read("y.file", alone(&self.y).as_ref())?,
            read("axis", self.axis.as_ref())?,
        ];
        let mut first: Option<(Size, &Path)> = None;
        for (picture, path) in pictures.iter().flatten() {
            let (size, other) = *first.get_or_insert((picture.size, path));
            if picture.size != size {
                let problem = format!("it is {}, but {} is {size}", picture.size, other.display());
                return Err(Error::file(path, problem));
            }
            self.check_size(picture.size, path, surface.size)?;
        }
        for (picture, path) in pictures[1..3].iter().flatten() {
            if picture.numbers != 1 {
                let problem = format!("it has {} numbers a texel; needed: one", picture.numbers);
                return Err(Error::file(path, problem));
            }
        }
        if let Some((picture, path)) = &pictures[3]
            && picture.numbers != self.axis_encoding.numbers()
        {
            let problem = format!(
                "it has {} numbers a texel, but the encoding `{}` takes {}",
                picture.numbers,
                self.axis_encoding.name(),
                self.axis_encoding.numbers()
            );
            return Err(Error::file(path, problem));
        }
        let pictures = pictures.map(|read| read.map(|(picture, _)| picture));
        let map = |wrap| self.map(&pictures, wrap);
        let (map, laid) = match &self.radial {
            Some(radial) => (map(Wrap::Clamp)?, Laid::Around(radial.disc(surface.aspect))),
            None => (fitted(map(surface.wrap)?, surface.size)?, Laid::Over),
        };
        Ok(Table {
            map,
            laid,
            size: surface.size,
        })
    }

    /// Whether a file of this size serves a map of that one: a table has one row, and a small file must not take much memory.
    fn check_size(&self, size: Size, path: &Path, map: Size) -> Result<()> {
        if self.radial.is_some() && size.height() != 1 {
            let problem = format!("it is {size}, but with `radial` a file is a table of one row");
            return Err(Error::file(path, problem)
                .with_hint("Name a file of height 1, or leave out `radial`"));
        }
        let bytes = path.metadata().map_err(Error::read(path))?.len();
        let texels = |n: usize| n as u64;
        let most = [
            TEXELS_ALWAYS,
            4 * texels(map.texels()),
            TEXELS_A_BYTE * bytes,
        ];
        if most.iter().any(|most| texels(size.texels()) <= *most) {
            return Ok(());
        }
        let problem = format!(
            "it is {size} in {bytes} bytes, far larger than the map of {map}; allowed: 4096x4096 texels, 4 times the map's, or {TEXELS_A_BYTE} for each byte of the file"
        );
        Err(Error::file(path, problem).with_hint("Make the file smaller or the map larger"))
    }

    /// The numbers of the files (of both widths, alpha_x, alpha_y, the axis), or the same ones everywhere, as a map of the files'
    /// size.
    fn map(&self, pictures: &[Option<Picture>; 4], wrap: Wrap) -> Result<AnisoMap> {
        let size = match pictures.iter().flatten().next() {
            Some(picture) => picture.size,
            None => Size::new(1, 1)?,
        };
        let [widths, x, y, axis] = pictures;
        let constant = Texel {
            alpha_x: self.alpha_x,
            alpha_y: self.alpha_y,
            axis: Axis::from_degrees(self.angle),
        };
        let mut map = AnisoMap::constant(size, wrap, constant);
        let region = map.region_mut();
        if let Some(picture) = widths {
            let codec = self.width_storage(depth(&picture.codes)).codec();
            for i in 0..size.texels() {
                let at = |n: usize| codec.decode(picture.codes.number(n));
                let n = picture.numbers;
                region.alpha_x[i] = at(n * i);
                region.alpha_y[i] = at(n * i + n - 1);
            }
        }
        for (width, picture, plane) in [
            (&self.x, x, &mut *region.alpha_x),
            (&self.y, y, &mut *region.alpha_y),
        ] {
            if let (Some(width), Some(picture)) = (width, picture) {
                let storage = width.storage(depth(&picture.codes));
                storage.unpack(&picture.codes, plane);
            }
        }
        if let Some(picture) = axis {
            let storage = AxisStorage::new(depth(&picture.codes), self.axis_encoding);
            storage.unpack(&picture.codes, region.cos2, region.sin2);
        }
        Ok(map)
    }
}

impl StoredWidth {
    fn storage(&self, depth: Depth) -> WidthStorage {
        WidthStorage {
            depth,
            encoding: self.encoding,
            low: self.low,
            high: self.high,
        }
    }
}

/// Whether the range of a file of widths can be used; `table` is what its keys are in, with a dot.
fn check_range(table: &str, range: WidthStorage) -> Result<()> {
    number(format!("{table}low"), range.low, 0.0..=2.0)?;
    number(format!("{table}high"), range.high, 0.0..=2.0)?;
    if range.is_sound() {
        return Ok(());
    }
    let allowed = format!(
        "allowed: less than `high`, which is {}, and over 0 for the encoding `log`",
        range.high
    );
    Err(Error::invalid(format!("{table}low"), range.low, allowed))
}

/// A map that is nowhere larger than the surface's: its texels' mean lobes where it was.
fn fitted(map: AnisoMap, size: Size) -> Result<AnisoMap> {
    let kept = Size::new(
        map.width().min(size.width()),
        map.height().min(size.height()),
    )?;
    if kept == map.size() {
        Ok(map)
    } else {
        reduce(&map, kept)
    }
}

fn depth(codes: &Codes) -> Depth {
    match codes {
        Codes::U8(_) => Depth::U8,
        Codes::U16(_) => Depth::U16,
        Codes::F16(_) => Depth::F16,
        Codes::F32(_) => Depth::F32,
    }
}

/// How the files lie on the surface.
enum Laid {
    Over,
    Around(Disc),
}

/// A prepared [`Stored`].
pub(super) struct Table {
    map: AnisoMap,
    laid: Laid,
    size: Size,
}

impl Fill for Table {
    fn fill(&self, patch: &mut Patch<'_>) {
        patch.coverage.fill(1.0);
        patch.value.fill(1.0);
        let rect = patch.region.rect;
        for y in rect.y..rect.y + rect.height {
            for x in rect.x..rect.x + rect.width {
                patch.region.set(rect.index(x, y), self.texel(x, y));
            }
        }
    }
}

impl Table {
    fn texel(&self, x: u32, y: u32) -> Texel {
        let (u, v) = center_of(self.size, x, y);
        match &self.laid {
            Laid::Around(disc) => disc.texel(&self.map, u, v),
            Laid::Over if self.size == self.map.size() => self.map.texel(x, y),
            Laid::Over => self.map.sample(u, v),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::convention::storage::Storage;
    use image::ColorType;

    #[test]
    fn numbers_are_held_against_their_ranges() {
        let check = |change: fn(&mut Stored)| {
            let mut stored = Stored::default();
            change(&mut stored);
            stored.check().map_err(|e| e.to_string())
        };
        assert!(check(|_| ()).is_ok());
        assert!(check(|s| s.low = 0.0).unwrap_err().contains("log"));
        assert!(check(|s| s.high = f32::NAN).unwrap_err().contains("high"));
        assert!(check(|s| s.low = 1.6).unwrap_err().contains("less than"));
        assert!(check(|s| s.alpha_x = 0.0).unwrap_err().contains("alpha_x"));
        assert!(
            check(|s| s.radial = Some(Radius {
                center: [0.5; 2],
                reach: 0.0
            }))
            .is_err()
        );
        assert!(
            check(|s| s.radial = Some(Radius {
                center: [f32::NAN; 2],
                reach: 1.0
            }))
            .is_err()
        );
    }

    fn surface(size: Size) -> Surface {
        Surface {
            size,
            aspect: 1.0,
            wrap: Wrap::Clamp,
            seed: 0,
        }
    }

    #[test]
    fn a_file_has_a_size_that_serves_the_map() {
        let folder = tempfile::tempdir().unwrap();
        let files = Files {
            folder: Some(folder.path().to_owned()),
            allow_outside: false,
        };
        let save = |width: u32, height: u32| {
            let zeros = vec![0; width as usize * height as usize];
            let path = folder.path().join("w.png");
            image::save_buffer(path, &zeros, width, height, ColorType::L8).unwrap();
        };
        let prepare = |radial: bool, side: u32| {
            let stored = Stored {
                widths: Some("w.png".to_owned()),
                radial: radial.then_some(Radius {
                    center: [0.5; 2],
                    reach: 1.0,
                }),
                ..Stored::default()
            };
            let size = Size::new(side, side).unwrap();
            let table = stored.prepare("at", &surface(size), &files);
            table.map(|_| ()).map_err(|e| e.to_string())
        };
        save(32768, 1);
        assert_eq!(prepare(true, 4), Ok(()));
        save(64, 64);
        assert_eq!(prepare(false, 4), Ok(()));
        let e = prepare(true, 4).unwrap_err();
        assert!(e.contains("w.png") && e.contains("64x64") && e.contains("one row"));
        save(8192, 4096);
        let e = prepare(false, 4).unwrap_err();
        assert!(e.contains("w.png") && e.contains("8192x4096") && e.contains("4096x4096"));
        assert_eq!(prepare(false, 2900), Ok(()));
    }

    #[test]
    fn files_and_numbers_become_one_map() {
        let folder = tempfile::tempdir().unwrap();
        let files = Files {
            folder: Some(folder.path().to_owned()),
            allow_outside: false,
        };
        let size = Size::new(6, 1).unwrap();
        let mut map = AnisoMap::constant(size, Wrap::Clamp, DEFAULT_TEXEL);
        for i in 0..6 {
            let texel = Texel {
                alpha_x: 0.1 + 0.02 * i as f32,
                alpha_y: 0.4,
                axis: Axis::from_degrees(30.0 * i as f32),
            };
            map.region_mut().set(i, texel);
        }
        let storage: Storage = "u16-log/u8-double".parse().unwrap();
        let packed = storage.pack(&map);
        let path = |name: &str| folder.path().join(name);
        let (Codes::U16(widths), Codes::U8(axis)) = (&packed.widths, &packed.axis) else {
            panic!("{packed:?}");
        };
        let save = |name: &str, bytes: &[u8], width, color| {
            image::save_buffer(path(name), bytes, width, 1, color).unwrap();
        };
        save("w.png", bytemuck::cast_slice(widths), 6, ColorType::La16);
        save("a.png", axis, 6, ColorType::La8);
        let stored = Stored {
            widths: Some("w.png".to_owned()),
            axis: Some("a.png".to_owned()),
            ..Stored::default()
        };
        let table = stored.prepare("at", &surface(size), &files).unwrap();
        assert_eq!(table.map, storage.quantise(&map));
        assert_eq!(table.texel(3, 0), table.map.texel(3, 0));
        let axis_alone = Stored {
            widths: None,
            ..stored.clone()
        };
        let table = axis_alone.prepare("at", &surface(size), &files).unwrap();
        assert_eq!(table.texel(2, 0).alpha_x, DEFAULT_TEXEL.alpha_x);
        let wrong = Stored {
            axis_encoding: AxisEncoding::Angle,
            ..stored.clone()
        };
        let e = wrong.prepare("at", &surface(size), &files);
        assert!(e.err().unwrap().to_string().contains("a.png"));
        save("a.png", &[9; 6], 3, ColorType::La8);
        let e = stored.prepare("at", &surface(size), &files).err().unwrap();
        assert!(e.to_string().contains("6x1"), "{e}");
        let gone = Stored {
            widths: Some("../w.png".to_owned()),
            ..Stored::default()
        };
        let e = gone
            .prepare("layers.0.stored", &surface(size), &files)
            .err()
            .unwrap();
        assert!(e.to_string().contains("layers.0.stored.widths"), "{e}");
    }
}
