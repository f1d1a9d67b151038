//! A finished map as a layer's source.

use super::Files;
use super::layer::below;
use super::shelf::{Read, within};
use crate::error::{Error, Result};
use crate::filter::reduce;
use crate::import::Imported;
use crate::import::exr::read_master;
use crate::import::textures::Textures;
use crate::map::{AnisoMap, Mended, RegionMut, Size, Wrap};
use crate::pattern::{Fill, Patch};
use serde::{Deserialize, Serialize};
use std::sync::Arc;

/// A finished map, laid over the whole map: a master EXR, or the textures of another program. One of the two is there.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Image {
    /// The master EXR, from the recipe's folder.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub file: Option<String>,
    /// Textures, and what their numbers mean.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub textures: Option<Textures>,
}

impl Image {
    /// A master EXR.
    pub fn master(file: impl Into<String>) -> Self {
        Self {
            file: Some(file.into()),
            textures: None,
        }
    }

    /// Textures with what they mean.
    pub fn of(textures: Textures) -> Self {
        Self {
            file: None,
            textures: Some(textures),
        }
    }

    /// Whether it tells the direction and no widths.
    pub fn is_direction_alone(&self) -> bool {
        let textures = self.textures.as_ref();
        textures.is_some_and(|t| t.first.is_none() && t.direction.is_some())
    }

    /// The names of its files.
    pub fn files(&self) -> impl Iterator<Item = &String> {
        let textures = self.textures.iter();
        let of_textures = textures.flat_map(|t| t.channels().map(|(_, c)| &c.file));
        self.file.iter().chain(of_textures)
    }

    /// The names of its files, to be changed when the recipe moves.
    pub(crate) fn files_mut(&mut self) -> impl Iterator<Item = &mut String> {
        let textures = self.textures.iter_mut();
        let of_textures = textures.flat_map(|t| t.channels_mut().map(|c| &mut c.file));
        self.file.iter_mut().chain(of_textures)
    }

    /// Whether it says what it is; names a key of its own table alone. Whether its files can be read is known when they are.
    pub(super) fn check(&self) -> Result<()> {
        match (&self.file, &self.textures) {
            (Some(_), None) => Ok(()),
            (None, Some(textures)) => textures.check().map_err(below("textures".to_owned())),
            (None, None) => Err(Error::invalid(
                "file",
                "missing",
                "allowed: only where `textures` is there",
            )),
            (Some(file), Some(_)) => Err(Error::invalid(
                "file",
                format!("`{file}`"),
                "allowed: only without `textures`",
            )),
        }
    }

    /// Reads the files, which `key` names as the layer's table.
    pub(super) fn read(&self, key: &str, wrap: Wrap, files: &Files) -> Result<(AnisoMap, Mended)> {
        match (&self.file, &self.textures) {
            (None, Some(textures)) => {
                let key = format!("{key}.textures");
                let find = |of: &str, name: &str| files.resolve(&format!("{key}.{of}"), name);
                textures.read(wrap, find)
            }
            (file, _) => {
                let name = file.as_deref().unwrap_or_default();
                let path = files.resolve(&format!("{key}.file"), name)?;
                let Imported { map, mended, .. } = read_master(&path)?;
                Ok((map, mended))
            }
        }
    }
}

/// An [`Image`] that was read, as a map of the surface's size, or smaller.
pub(super) struct Laid {
    read: Arc<Read>,
    /// The mean lobes of what its texels cover, where the surface is smaller.
    reduced: Option<AnisoMap>,
    size: Size,
}

impl Laid {
    /// Makes it fit: a smaller map gets the mean lobes of what its texels cover, a larger one blends between the file's texels.
    pub(super) fn new(read: &Arc<Read>, size: Size) -> Result<Self> {
        let kept = within(read.map.size(), size)?;
        let reduced = (kept != read.map.size()).then(|| reduce(&read.map, kept));
        Ok(Self {
            read: Arc::clone(read),
            reduced: reduced.transpose()?,
            size,
        })
    }

    fn map(&self) -> &AnisoMap {
        self.reduced.as_ref().unwrap_or(&self.read.map)
    }
}

impl Fill for Laid {
    fn fill(&self, patch: &mut Patch<'_>) {
        patch.coverage.fill(1.0);
        patch.value.fill(1.0);
        if self.map().size() == self.size {
            copy(self.map(), &mut patch.region);
        } else {
            self.sample(&mut patch.region);
        }
    }
}

fn copy(map: &AnisoMap, region: &mut RegionMut<'_>) {
    let rect = region.rect;
    let n = rect.width as usize;
    for y in rect.y..rect.y + rect.height {
        let (to, from) = (rect.index(rect.x, y), map.size().rect().index(rect.x, y));
        region.alpha_x[to..to + n].copy_from_slice(&map.alpha_x()[from..from + n]);
        region.alpha_y[to..to + n].copy_from_slice(&map.alpha_y()[from..from + n]);
        region.cos2[to..to + n].copy_from_slice(&map.cos2()[from..from + n]);
        region.sin2[to..to + n].copy_from_slice(&map.sin2()[from..from + n]);
    }
}

impl Laid {
    fn sample(&self, region: &mut RegionMut<'_>) {
        let rect = region.rect;
        let (w, h) = (self.size.width() as f32, self.size.height() as f32);
        for y in rect.y..rect.y + rect.height {
            for x in rect.x..rect.x + rect.width {
                let texel = self
                    .map()
                    .sample((x as f32 + 0.5) / w, 1.0 - (y as f32 + 0.5) / h);
                region.set(rect.index(x, y), texel);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::map::{DEFAULT_TEXEL, Texel};
    use crate::math::Axis;

    /// Two columns: narrow and turned left, wide and straight right.
    fn halves() -> AnisoMap {
        let mut map = AnisoMap::constant(Size::new(4, 4).unwrap(), Wrap::Clamp, DEFAULT_TEXEL);
        for i in (0..16).filter(|i| i % 4 < 2) {
            let axis = Axis::from_degrees(40.0);
            map.region_mut().set(
                i,
                Texel {
                    alpha_x: 0.05,
                    alpha_y: 0.4,
                    axis,
                },
            );
        }
        map
    }

    fn laid(map: AnisoMap, size: Size) -> AnisoMap {
        let mended = Mended::default();
        let laid = Laid::new(&Arc::new(Read { map, mended }), size).unwrap();
        let mut out = AnisoMap::constant(size, Wrap::Clamp, DEFAULT_TEXEL);
        let (mut coverage, mut value) = (vec![0.0; size.texels()], vec![0.0; size.texels()]);
        laid.fill(&mut Patch {
            region: out.region_mut(),
            coverage: &mut coverage,
            value: &mut value,
        });
        assert!(coverage.iter().all(|c| *c == 1.0));
        out
    }

    #[test]
    fn a_file_is_laid_over_a_map_of_any_size() {
        let map = halves();
        assert_eq!(laid(map.clone(), map.size()), map);
        for side in [2, 16] {
            let size = Size::new(side, side).unwrap();
            let out = laid(map.clone(), size);
            let (left, right) = (out.texel(0, 0), out.texel(side - 1, 0));
            assert!((left.alpha_x - 0.05).abs() < 1e-4 && (left.alpha_y - 0.4).abs() < 1e-4);
            assert!((left.axis.degrees() - 40.0).abs() < 0.01);
            assert!((right.alpha_y - 0.2).abs() < 1e-4);
        }
    }
}
