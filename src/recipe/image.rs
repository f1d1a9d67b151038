//! A finished map as a layer's source.

use super::Files;
use crate::error::Result;
use crate::filter::reduce;
use crate::import::Imported;
use crate::import::exr::read_master;
use crate::map::{AnisoMap, Mended, RegionMut, Size};
use crate::pattern::{Fill, Patch, Surface};
use serde::{Deserialize, Serialize};

/// A master EXR, laid over the whole map.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Image {
    /// The file, from the recipe's folder.
    pub file: String,
}

impl Image {
    /// Reads the file and makes it fit: a smaller map gets the mean lobes of what its texels cover, a larger one blends
    /// between the file's texels.
    pub(super) fn prepare(&self, key: &str, surface: &Surface, files: &Files) -> Result<Laid> {
        let path = files.resolve(key, &self.file)?;
        let Imported { map, mended, .. } = read_master(&path)?;
        let kept = Size::new(
            map.width().min(surface.size.width()),
            map.height().min(surface.size.height()),
        )?;
        Ok(Laid {
            map: if kept == map.size() {
                map
            } else {
                reduce(&map, kept)?
            },
            size: surface.size,
            mended,
        })
    }
}

/// A prepared [`Image`]: a map of the surface's size, or smaller.
pub(super) struct Laid {
    map: AnisoMap,
    size: Size,
    /// What reading the file had to change.
    pub(super) mended: Mended,
}

impl Fill for Laid {
    fn fill(&self, patch: &mut Patch<'_>) {
        patch.coverage.fill(1.0);
        patch.value.fill(1.0);
        if self.map.size() == self.size {
            copy(&self.map, &mut patch.region);
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
                    .map
                    .sample((x as f32 + 0.5) / w, 1.0 - (y as f32 + 0.5) / h);
                region.set(rect.index(x, y), texel);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::map::{DEFAULT_TEXEL, Texel, Wrap};
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
        let laid = Laid {
            map: if size.width() < map.width() {
                reduce(&map, size).unwrap()
            } else {
                map
            },
            size,
            mended: Mended::default(),
        };
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
