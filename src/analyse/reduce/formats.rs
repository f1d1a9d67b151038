//! What the files of each format give back of a map: written by its exporter, read by its importer.

use crate::convention::MapInfo;
use crate::error::{Error, Result};
use crate::export::exr::{Precision, write_master, write_rgb_pair};
use crate::export::gltf::{GltfOptions, write_glb};
use crate::export::png::{Depth, write_set};
use crate::export::{Export, beside};
use crate::import::exr::{read_master, read_rgb_pair};
use crate::import::gltf::read_gltf;
use crate::import::guess::guess;
use crate::map::AnisoMap;
use crate::mesh;
use crate::recipe::{Material, Target};
use std::path::Path;

/// The map that a reader of this format gets. EXR files have halves, or floats where `precision` says so. A folder for the files
/// is made where the system keeps what goes again, and goes again.
///
/// # Errors
/// When the files cannot be written or read.
///
/// # Panics
/// For a preview, which is no map.
pub(super) fn given_back(format: Target, precision: Precision, map: &AnisoMap) -> Result<AnisoMap> {
    let folder = tempfile::tempdir().map_err(Error::write(&std::env::temp_dir()))?;
    let stem = folder.path().join("map");
    let info = MapInfo::default();
    let export = Export::new(map, &info);
    match format {
        Target::Exr => {
            let written = write_master(&beside(&stem, ".exr"), &export, precision)?;
            Ok(read_master(&written.path)?.map)
        }
        Target::RgbExr => {
            let [alpha, direction] = write_rgb_pair(&stem, &export, precision)?;
            Ok(read_rgb_pair(&alpha.path, &direction.path)?.map)
        }
        Target::Png8 => png(&stem, &export, Depth::Eight),
        Target::Png16 => png(&stem, &export, Depth::Sixteen),
        // Both hold the same textures, and these nothing of the mesh.
        Target::Glb | Target::Gltf => {
            let plane = mesh::builtin("plane").expect("a built-in");
            let (path, material) = (beside(&stem, ".glb"), Material::default());
            write_glb(&path, &export, &plane, &material, GltfOptions::default())?;
            Ok(read_gltf(&path)?.map)
        }
        Target::Preview => unreachable!("a picture is no map"),
    }
}

fn png(stem: &Path, export: &Export<'_>, depth: Depth) -> Result<AnisoMap> {
    let written = write_set(stem, export, depth)?;
    let found = guess(&written[0].path)?;
    let folder = stem.parent().unwrap_or(Path::new(""));
    let wrap = export.map().wrap();
    let (map, _) = found.textures.read(wrap, |_, file| Ok(folder.join(file)))?;
    Ok(map)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::analyse::compare;
    use crate::map::{Size, Texel, Wrap};
    use crate::math::Axis;

    #[test]
    fn each_format_gives_back_the_map_as_far_as_its_bits_reach() {
        let size = Size::new(24, 16).unwrap();
        let mut map = AnisoMap::constant(size, Wrap::Clamp, crate::map::DEFAULT_TEXEL);
        for i in 0..size.texels() {
            let texel = Texel {
                alpha_x: 0.05 + 0.0005 * i as f32,
                alpha_y: 0.5 - 0.0005 * i as f32,
                axis: Axis::from_degrees(0.4 * i as f32),
            };
            map.region_mut().set(i, texel);
        }
        // Largest relative error of a width, largest turn in degrees.
        for (format, precision, width, degrees) in [
            (Target::Exr, Precision::Half, 5e-4, 0.02),
            (Target::Exr, Precision::Float, 0.0, 1e-3),
            (Target::RgbExr, Precision::Half, 5e-4, 0.04),
            (Target::RgbExr, Precision::Float, 0.0, 1e-3),
            (Target::Png8, Precision::Half, 0.025, 0.25),
            (Target::Png16, Precision::Half, 5e-4, 2e-3),
            (Target::Glb, Precision::Half, 0.03, 0.4),
            (Target::Gltf, Precision::Half, 0.03, 0.4),
        ] {
            let back = given_back(format, precision, &map).unwrap();
            let apart = compare(&map, &back).unwrap();
            let worst = apart.well_held.max.max(apart.elsewhere.max);
            let name = format.name();
            assert!(worst <= width, "{name}: {worst}");
            let turn = apart.angle.max_degrees;
            assert!(turn <= degrees, "{name}: {turn}");
            let coarse = matches!(format, Target::Png8 | Target::Glb | Target::Gltf);
            assert!(!coarse || (worst > 1e-3 && turn > 0.05), "{name}");
        }
    }
}
