//! glTF 2.0 with `KHR_materials_anisotropy`: a mesh with its tangents, and the map as two 8-bit textures.
//!
//! The extension's lobe is GGX, so Ward widths are exchanged for the nearest GGX ones first ([`LobeFit`]); its widths end
//! at 1, and wider ones are clamped. Every file states the fit in its `extras`, and every writer returns a [`GltfReport`] of
//! what was lost. [`crate::import::gltf`] reads the map back.
//!
//! **Material.** glTF has one base colour for the diffuse and the metallic part, and how much of it is metal. Where the
//! specular reflectance rho_s is the larger, the metalness m and base colour c are solved from
//! `(1 - m) c = rho_d` and `0.04 (1 - m) + m c = rho_s`, which for rho_d = 0 is a pure metal of colour rho_s. Where the
//! diffuse is the larger, or both are so dark that the 4 % of the non-metallic part are too much and nothing solves the
//! equations, the surface is a dielectric of colour rho_d with `KHR_materials_specular` scaling those 4 % to rho_s. A viewer adds Fresnel's rise at grazing angles, which Ward's model has not.

mod geometry;
mod texture;

use super::{Export, Written, beside, write_atomic};
use crate::convention::{Content, LobeFit, MapRecord};
use crate::error::{Error, Result};
use crate::filter::reduce;
use crate::map::{AnisoMap, Size, Wrap};
use crate::mesh::Mesh;
use crate::recipe::Material;
use geometry::Buffer;
use serde::Serialize;
use serde_json::{Value, json};
use std::borrow::Cow;
use std::io::Write;
use std::path::Path;
use texture::{Textures, textures};

/// How a map becomes glTF textures.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct GltfOptions {
    /// How Ward widths become GGX widths.
    pub lobe_fit: LobeFit,
    /// Size of the textures, at most the map's in each direction; `None` is the map's own size.
    pub texture_size: Option<Size>,
}

/// What a glTF file holds and what the conversion lost. The 8-bit errors are those of a reader that undoes the fit, against
/// the map at the size of the textures.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct GltfReport {
    /// How Ward widths became GGX widths. The GGX lobe itself differs from Ward's by 14 to 24 % in shape, whatever the fit.
    pub lobe_fit: LobeFit,
    /// Width and height of the textures in texels.
    pub size: [u32; 2],
    /// roughnessFactor, by which the roughness texture is scaled.
    pub roughness_factor: f32,
    /// anisotropyStrength, by which the strength texture is scaled.
    pub strength_factor: f32,
    /// Texels whose larger width became 1 because glTF has no larger one.
    pub clamped: u64,
    /// Largest relative error of a width among those texels.
    pub clamp_error: f32,
    /// Largest relative error of a width where the smaller one is at least 4 % of its largest value in the map: under 2 %,
    /// unless the larger width is over four times that largest value somewhere. Then it may be up to
    /// strength_factor / (510 sqrt(alpha_b)), where a texel has a smaller width alpha_b and a larger one about twice that.
    pub alpha_error: f32,
    /// Largest relative error of a width in the other texels.
    pub alpha_error_elsewhere: f32,
    /// Largest error of the direction in degrees, round texels left out.
    pub angle_error: f32,
}

/// Writes one binary file with everything in it.
///
/// # Errors
/// [`crate::Error::Write`], see [`write_atomic`]; [`crate::Error::Invalid`] for an empty or broken mesh or textures larger
/// than the map.
pub fn write_glb(
    path: &Path,
    export: &Export<'_>,
    mesh: &Mesh,
    material: &Material,
    options: GltfOptions,
) -> Result<(Written, GltfReport)> {
    let mut buffer = Buffer::default();
    let primitive = buffer.add_mesh(mesh)?;
    let (pictures, report) = draw(export, options)?;
    let images: Vec<Value> = pictures
        .iter()
        .map(|p| json!({ "name": p.name, "mimeType": "image/png", "bufferView": buffer.add_view(&p.png, None) }))
        .collect();
    let material = material_of(export, material, &report);
    let mut document = document(mesh, primitive, export.map().wrap(), material, images);
    document["buffers"] = json!([{ "byteLength": buffer.bytes.len() }]);
    document["bufferViews"] = json!(buffer.views);
    document["accessors"] = json!(buffer.accessors);
    let bytes = glb(&document, &buffer.bytes)?;
    let written = write_atomic(path, |file| file.write_all(&bytes))?;
    Ok((written, report))
}

/// Writes `STEM.gltf` with everything beside it: `STEM.bin`, `STEM_roughness.png`, `STEM_anisotropy.png`.
///
/// # Errors
/// As [`write_glb`].
pub fn write_gltf(
    stem: &Path,
    export: &Export<'_>,
    mesh: &Mesh,
    material: &Material,
    options: GltfOptions,
) -> Result<(Vec<Written>, GltfReport)> {
    let mut buffer = Buffer::default();
    let primitive = buffer.add_mesh(mesh)?;
    let (pictures, report) = draw(export, options)?;
    let mut written = vec![];
    let mut images = vec![];
    for picture in &pictures {
        let path = beside(stem, &format!("_{}.png", picture.name));
        images.push(json!({ "name": picture.name, "uri": uri(&path) }));
        written.push(write_atomic(&path, |file| file.write_all(&picture.png))?);
    }
    let bin = beside(stem, ".bin");
    written.push(write_atomic(&bin, |file| file.write_all(&buffer.bytes))?);
    let material = material_of(export, material, &report);
    let mut document = document(mesh, primitive, export.map().wrap(), material, images);
    document["buffers"] = json!([{ "byteLength": buffer.bytes.len(), "uri": uri(&bin) }]);
    document["bufferViews"] = json!(buffer.views);
    document["accessors"] = json!(buffer.accessors);
    // The document last: whoever sees it finds what it names.
    let text = format!("{document:#}\n");
    written.insert(
        0,
        write_atomic(&beside(stem, ".gltf"), |file| {
            file.write_all(text.as_bytes())
        })?,
    );
    Ok((written, report))
}

/// A texture, encoded.
struct Picture {
    name: &'static str,
    png: Vec<u8>,
}

fn draw(export: &Export<'_>, options: GltfOptions) -> Result<([Picture; 2], GltfReport)> {
    let map: Cow<'_, AnisoMap> = match options.texture_size {
        Some(size) if size != export.map().size() => Cow::Owned(reduce(export.map(), size)?),
        _ => Cow::Borrowed(export.map()),
    };
    let Textures {
        roughness,
        anisotropy,
        report,
    } = textures(&map, options.lobe_fit);
    let encode = |name, pixels: super::png::Pixels| {
        let mut png = vec![];
        pixels
            .encode(&mut png)
            .expect("memory takes any number of bytes, and the size was checked");
        Picture { name, png }
    };
    let (roughness, anisotropy) = rayon::join(
        || encode("roughness", roughness),
        || encode("anisotropy", anisotropy),
    );
    Ok(([roughness, anisotropy], report))
}

/// The reflectance of a dielectric at normal incidence, where no extension says otherwise.
const DIELECTRIC: f32 = 0.04;

/// Metalness and base colour of a surface with more specular than diffuse reflectance, if there are any that give both; see
/// the head of the module.
fn metal(material: &Material) -> Option<(f32, [f32; 3])> {
    let luminance = |c: [f32; 3]| 0.2126 * c[0] + 0.7152 * c[1] + 0.0722 * c[2];
    let (d, s) = (luminance(material.diffuse), luminance(material.specular));
    // c = d + s - 0.04 (1 - m) and (1 - m) c = d: a quadratic in q = 1 - m.
    let sum = d + s;
    let discriminant = sum * sum - 4.0 * DIELECTRIC * d;
    if s <= d || discriminant < 0.0 {
        return None;
    }
    let q = 2.0 * d / (sum + discriminant.sqrt());
    let color: [f32; 3] =
        std::array::from_fn(|i| material.diffuse[i] + material.specular[i] - DIELECTRIC * q);
    // Above 1 is what reflects more than all light; no other material could do that either.
    let exists = color.iter().all(|c| *c >= 0.0);
    exists.then(|| ((1.0 - q).clamp(0.0, 1.0), color.map(|c| c.min(1.0))))
}

fn material_of(export: &Export<'_>, colors: &Material, report: &GltfReport) -> Value {
    let metal = metal(colors);
    let (metallic, color) = metal.unwrap_or((0.0, colors.diffuse.map(|c| c.clamp(0.0, 1.0))));
    let mut record = MapRecord::new(Content::Gltf, export.info(), export.map().wrap());
    record.lobe_fit = Some(report.lobe_fit);
    let mut material = json!({
        "name": export.info().name,
        "pbrMetallicRoughness": {
            "baseColorFactor": [color[0], color[1], color[2], 1.0],
            "metallicFactor": metallic,
            "roughnessFactor": report.roughness_factor,
            "metallicRoughnessTexture": { "index": 0 },
        },
        "extensions": {
            "KHR_materials_anisotropy": {
                "anisotropyStrength": report.strength_factor,
                "anisotropyRotation": 0.0,
                "anisotropyTexture": { "index": 1 },
            },
        },
        "extras": { MapRecord::NAME: record },
    });
    if metal.is_none() {
        material["extensions"]["KHR_materials_specular"] =
            json!({ "specularColorFactor": colors.specular.map(|c| c.max(0.0) / DIELECTRIC) });
    }
    material
}

fn document(
    mesh: &Mesh,
    primitive: Value,
    wrap: Wrap,
    material: Value,
    images: Vec<Value>,
) -> Value {
    const LINEAR: u32 = 9729;
    const LINEAR_MIPMAP_LINEAR: u32 = 9987;
    let mode = |repeats| if repeats { 10497 } else { 33071 };
    let extensions: Vec<&String> = material["extensions"]
        .as_object()
        .map(|e| e.keys().collect())
        .unwrap_or_default();
    json!({
        "asset": { "version": "2.0", "generator": crate::convention::generator() },
        "extensionsUsed": extensions,
        "scene": 0,
        "scenes": [{ "nodes": [0] }],
        "nodes": [{ "name": mesh.name, "mesh": 0 }],
        "meshes": [{ "name": mesh.name, "primitives": [primitive] }],
        "samplers": [{
            "magFilter": LINEAR,
            "minFilter": LINEAR_MIPMAP_LINEAR,
            "wrapS": mode(wrap.repeats_u()),
            "wrapT": mode(wrap.repeats_v()),
        }],
        "textures": [{ "sampler": 0, "source": 0 }, { "sampler": 0, "source": 1 }],
        "images": images,
        "materials": [material],
    })
}

/// The binary container: a header and two chunks, each padded to four bytes.
fn glb(document: &Value, buffer: &[u8]) -> Result<Vec<u8>> {
    let mut json = document.to_string().into_bytes();
    json.resize(json.len().next_multiple_of(4), b' ');
    let chunks = [(json.as_slice(), b"JSON"), (buffer, b"BIN\0")];
    let total = 12 + chunks.iter().map(|(c, _)| 8 + c.len()).sum::<usize>();
    if u32::try_from(total).is_err() {
        return Err(Error::invalid(
            "the GLB",
            format!("{total} bytes long"),
            "allowed: under 4 GiB",
        )
        .with_hint("Choose smaller textures, or .gltf"));
    }
    let mut bytes = Vec::with_capacity(total);
    let number = |bytes: &mut Vec<u8>, n: usize| bytes.extend((n as u32).to_le_bytes());
    bytes.extend(b"glTF");
    number(&mut bytes, 2);
    number(&mut bytes, total);
    for (chunk, kind) in chunks {
        number(&mut bytes, chunk.len());
        bytes.extend(kind);
        bytes.extend(chunk);
    }
    Ok(bytes)
}

/// A file's name as a relative URI.
fn uri(path: &Path) -> String {
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    name.bytes()
        .map(|b| match b {
            b'a'..=b'z' | b'A'..=b'Z' | b'0'..=b'9' | b'-' | b'.' | b'_' | b'~' => {
                char::from(b).to_string()
            }
            _ => format!("%{b:02X}"),
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::super::samples;
    use super::*;
    use crate::convention::{MapInfo, Stretched};
    use crate::import::gltf::read_gltf;
    use crate::map::{DEFAULT_TEXEL, Mended, Texel};
    use crate::math::Axis;
    use glam::{Vec2, Vec3, Vec4};
    use proptest::prelude::*;
    use std::fs;

    const STEEL: Material = material([0.1; 3], [0.3, 0.29, 0.28]);

    const fn material(diffuse: [f32; 3], specular: [f32; 3]) -> Material {
        Material {
            diffuse,
            specular,
            ambient: [0.0; 3],
        }
    }

    fn quad() -> Mesh {
        let corners = [Vec2::ZERO, Vec2::X, Vec2::ONE, Vec2::Y];
        Mesh {
            name: "quad".to_owned(),
            positions: corners.iter().map(|c| c.extend(0.1)).collect(),
            normals: vec![Vec3::Z; 4],
            // The last has none, as a pole has.
            tangents: [Vec4::new(1.0, 0.0, 0.0, 1.0); 3]
                .into_iter()
                .chain([Vec4::W])
                .collect(),
            uvs: corners.to_vec(),
            triangles: vec![[0, 1, 2], [0, 2, 3]],
            aspect: 1.0,
        }
    }

    /// What a comparison by eye would call the errors: (widths where 8 bits are fine, widths elsewhere, degrees).
    fn errors(map: &AnisoMap, back: &AnisoMap, report: &GltfReport) -> (f32, f32, f32) {
        assert_eq!(map.size(), back.size());
        let texels = || (0..map.size().texels()).map(|i| Stretched::from(map.texel_at(i)));
        let largest = texels().map(|t| t.alpha_b).fold(0.0, f32::max);
        let mut worst = (0.0f32, 0.0f32, 0.0f32);
        for (i, is) in texels().enumerate() {
            // Which way round a nearly round texel is read does not matter: its widths are compared by size.
            let read = back.texel_at(i);
            let axis = read.axis.perpendicular();
            let read = Stretched::from(read);
            let off = |r: f32, i: f32| (r / i - 1.0).abs();
            let alpha = off(read.alpha_t, is.alpha_t).max(off(read.alpha_b, is.alpha_b));
            if report.lobe_fit.apply(is.alpha_t) > 1.0 {
                continue;
            } else if is.alpha_b >= 0.04 * largest {
                worst.0 = worst.0.max(alpha);
            } else {
                worst.1 = worst.1.max(alpha);
            }
            if is.eccentricity() > 1e-3 {
                worst.2 = worst.2.max(axis.angle_to(is.axis).to_degrees());
            }
        }
        worst
    }

    fn there_and_back(map: &AnisoMap, fit: LobeFit) -> (GltfReport, (f32, f32, f32)) {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.glb");
        let info = MapInfo {
            name: "there and back".to_owned(),
            aspect: 2.0,
            ..MapInfo::default()
        };
        let options = GltfOptions {
            lobe_fit: fit,
            texture_size: None,
        };
        let export = Export::new(map, &info);
        let (_, report) = write_glb(&path, &export, &quad(), &STEEL, options).unwrap();
        let back = read_gltf(&path).unwrap();
        assert_eq!(back.mended, Mended::default());
        assert_eq!((&back.info, back.map.wrap()), (&info, map.wrap()));
        (report, errors(map, &back.map, &report))
    }

    #[test]
    fn a_disc_comes_back_within_the_promised_errors() {
        let map = samples::disc((120, 70), Wrap::RepeatU);
        for fit in LobeFit::ALL {
            let (report, (fine, elsewhere, degrees)) = there_and_back(&map, fit);
            assert!(fine < 0.02 && degrees < 0.35, "{fine} {degrees}");
            assert_eq!((elsewhere, report.clamped), (0.0, 0));
            // The report says what a reader then measures.
            assert!(
                (report.alpha_error - fine).abs() < 1e-5,
                "{report:?} {fine}"
            );
            assert!(
                (report.angle_error - degrees).abs() < 1e-3,
                "{report:?} {degrees}"
            );
        }
    }

    #[test]
    fn widths_above_what_gltf_knows_are_clamped_and_counted() {
        let mut map = samples::disc((16, 16), Wrap::Clamp);
        let wide = Texel {
            alpha_x: 1.4,
            alpha_y: 0.1,
            axis: Axis::U,
        };
        map.region_mut().set(5, wide);
        let (report, (fine, ..)) = there_and_back(&map, LobeFit::Identity);
        assert_eq!(report.clamped, 1);
        assert!((report.clamp_error - 0.4 / 1.4).abs() < 0.01);
        assert!(fine < 0.02);
        // The GGX fit makes 1.4 a width below 1.
        assert_eq!(there_and_back(&map, LobeFit::WardToGgx).0.clamped, 0);
    }

    #[test]
    fn round_texels_point_where_their_neighbours_do() {
        let mut map = samples::disc((64, 64), Wrap::Clamp);
        let mut region = map.region_mut();
        for i in (0..64 * 64).filter(|i| i % 64 > 40 && i / 64 < 20) {
            region.set(i, DEFAULT_TEXEL);
        }
        let textures = textures(&map, LobeFit::WardToGgx);
        let mut png = vec![];
        textures.anisotropy.encode(&mut png).unwrap();
        let image = image::load_from_memory(&png).unwrap().into_rgb8();
        let (filled, beside) = (image.get_pixel(41, 10).0, image.get_pixel(40, 10).0);
        assert_eq!(filled[2], 0, "no strength");
        for c in 0..2 {
            assert!(filled[c].abs_diff(beside[c]) < 16, "{filled:?} {beside:?}");
        }
        let length = (0..2).map(|c| (f32::from(filled[c]) / 127.5 - 1.0).powi(2));
        assert!((length.sum::<f32>() - 1.0).abs() < 0.02, "{filled:?}");
    }

    #[test]
    fn an_isotropic_map_and_a_single_texel_are_fine() {
        for size in [(1, 1), (5, 3)] {
            let size = Size::new(size.0, size.1).unwrap();
            let map = AnisoMap::constant(size, Wrap::Clamp, DEFAULT_TEXEL);
            let (report, (fine, ..)) = there_and_back(&map, LobeFit::WardToGgx);
            assert!(fine < 0.001 && report.strength_factor == 0.0);
        }
    }

    #[test]
    fn textures_may_be_smaller_than_the_map_but_not_larger() {
        let folder = tempfile::tempdir().unwrap();
        let map = samples::disc((64, 32), Wrap::Repeat);
        let info = MapInfo::default();
        let write = |w, h| {
            let options = GltfOptions {
                texture_size: Some(Size::new(w, h).unwrap()),
                ..GltfOptions::default()
            };
            let stem = folder.path().join("map 1");
            write_gltf(&stem, &Export::new(&map, &info), &quad(), &STEEL, options)
        };
        let (written, report) = write(32, 16).unwrap();
        assert_eq!((written.len(), report.size), (4, [32, 16]));
        let back = read_gltf(&written[0].path).unwrap();
        assert_eq!(back.map.size(), Size::new(32, 16).unwrap());
        let small = reduce(&map, back.map.size()).unwrap();
        let (fine, _, degrees) = errors(&small, &back.map, &report);
        assert!(fine < 0.02 && degrees < 0.35);
        assert!(write(65, 32).is_err());
        // Without the picture beside it the file names what is missing.
        fs::remove_file(folder.path().join("map 1_roughness.png")).unwrap();
        let e = read_gltf(&written[0].path).unwrap_err();
        assert!(e.to_string().contains("map 1_roughness.png"), "{e}");
    }

    #[test]
    fn bytes_do_not_change_with_the_threads() {
        let folder = tempfile::tempdir().unwrap();
        let map = samples::disc((40, 300), Wrap::Repeat);
        let info = MapInfo::default();
        let bytes = |threads: usize| {
            let pool = rayon::ThreadPoolBuilder::new()
                .num_threads(threads)
                .build()
                .unwrap();
            let path = folder.path().join("a.glb");
            let export = Export::new(&map, &info);
            pool.install(|| write_glb(&path, &export, &quad(), &STEEL, GltfOptions::default()))
                .unwrap();
            fs::read(path).unwrap()
        };
        assert!(bytes(1) == bytes(2));
    }

    #[test]
    fn colours_keep_both_reflectances() {
        let map = samples::disc((4, 4), Wrap::Repeat);
        let (info, folder) = (MapInfo::default(), tempfile::tempdir().unwrap());
        let written = |colors: &Material| {
            let stem = folder.path().join("a");
            let export = Export::new(&map, &info);
            let options = GltfOptions::default();
            let (files, _) = write_gltf(&stem, &export, &quad(), colors, options).unwrap();
            let document: Value =
                serde_json::from_slice(&fs::read(&files[0].path).unwrap()).unwrap();
            document["materials"][0].clone()
        };
        // The diffuse and the specular reflectance of one channel at normal incidence, as the specification has them.
        let reflectances = |written: &Value, channel: usize| {
            let pbr = &written["pbrMetallicRoughness"];
            let m = pbr["metallicFactor"].as_f64().unwrap();
            let c = pbr["baseColorFactor"][channel].as_f64().unwrap();
            let specular = &written["extensions"]["KHR_materials_specular"];
            let scale = specular["specularColorFactor"][channel].as_f64();
            let f0 = 0.04 * scale.unwrap_or(1.0);
            ((1.0 - m) * c, f0 * (1.0 - m) + m * c)
        };
        for (d, s, is_metal) in [
            ([0.0; 3], [0.6; 3], true),
            ([0.1; 3], [0.3; 3], true),
            ([0.15; 3], [0.19; 3], true),
            ([0.0; 3], [0.9, 0.6, 0.2], true),
            ([0.3; 3], [0.05; 3], false),
            // Too dark to be part metal, part 4 %.
            ([0.02; 3], [0.021; 3], false),
            ([0.02; 3], [0.03; 3], false),
            ([0.0; 3], [0.0; 3], false),
            // On the whole there is a solution, but not for blue.
            ([0.1, 0.1, 0.0], [0.2, 0.2, 0.0], false),
        ] {
            let written = written(&material(d, s));
            let has_metal = written["pbrMetallicRoughness"]["metallicFactor"] != 0.0;
            assert_eq!(has_metal, is_metal, "{d:?} {s:?}");
            for i in 0..3 {
                let (diffuse, specular) = reflectances(&written, i);
                assert!((diffuse - f64::from(d[i])).abs() < 1e-6, "{d:?} {s:?}");
                assert!((specular - f64::from(s[i])).abs() < 1e-6, "{d:?} {s:?}");
            }
        }
        let (_, bright) = metal(&material([0.2; 3], [0.9; 3])).unwrap();
        assert_eq!(bright, [1.0; 3]);
    }

    #[test]
    fn meshes_that_cannot_be_written_are_named() {
        let map = samples::disc((4, 4), Wrap::Repeat);
        let info = MapInfo::default();
        let folder = tempfile::tempdir().unwrap();
        let write = |mesh: &Mesh| {
            let path = folder.path().join("a.glb");
            write_glb(
                &path,
                &Export::new(&map, &info),
                mesh,
                &STEEL,
                GltfOptions::default(),
            )
        };
        let mut mesh = quad();
        mesh.triangles[1][2] = 4;
        assert!(write(&mesh).unwrap_err().to_string().contains("triangle 1"));
        mesh.triangles.clear();
        assert!(
            write(&mesh)
                .unwrap_err()
                .to_string()
                .contains("at least one triangle")
        );
        let mut mesh = quad();
        mesh.positions[0].x = f32::NAN;
        assert!(write(&mesh).unwrap_err().to_string().contains("finite"));
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 0);
    }

    /// Random texels: widths even in the logarithm, each axis in its own range, directions anywhere.
    fn noise(seed: u32, x: (f32, f32), y: (f32, f32)) -> AnisoMap {
        let hash = |i: u32| {
            let h = (i ^ seed.wrapping_mul(0x9e37_79b1)).wrapping_mul(0x85eb_ca77);
            let h = (h ^ (h >> 13)).wrapping_mul(0xc2b2_ae3d);
            ((h ^ (h >> 16)) & 0xffff) as f32 / 65535.0
        };
        let size = Size::new(64, 64).unwrap();
        let mut map = AnisoMap::constant(size, Wrap::Repeat, DEFAULT_TEXEL);
        let mut region = map.region_mut();
        for i in 0..4096u32 {
            let alpha = |(low, high): (f32, f32), t: f32| low * (high / low).powf(t);
            let texel = Texel {
                alpha_x: alpha(x, hash(3 * i)),
                alpha_y: alpha(y, hash(3 * i + 1)),
                axis: Axis::from_degrees(180.0 * hash(3 * i + 2)),
            };
            region.set(i as usize, texel);
        }
        map
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(48))]
        #[test]
        fn eight_bits_keep_their_promise(seed in 0u32..1000, low in 1e-3f32..0.3, times in 1.0f32..1500.0) {
            let range = (low, (low * times).min(1.5));
            let map = noise(seed, range, range);
            for fit in LobeFit::ALL {
                let (report, (fine, elsewhere, degrees)) = there_and_back(&map, fit);
                prop_assert!((report.alpha_error - fine).abs() < 2e-4, "{report:?} {fine}");
                prop_assert!((report.alpha_error_elsewhere - elsewhere).abs() < 2e-4 * (1.0 + elsewhere));
                prop_assert!(degrees < 0.35, "{degrees}");
                prop_assert!(fine <= 0.02, "{low} {times} {fine}");
            }
        }

        #[test]
        fn where_one_axis_is_much_rougher_the_strength_sets_the_bound(
            seed in 0u32..1000,
            smooth in 1e-3f32..0.05,
            rough in 0.1f32..1.4,
        ) {
            // From equal widths to ratios of 1400 in one map.
            let map = noise(seed, (smooth, 2.0 * smooth), (smooth, rough));
            let (report, (fine, _, degrees)) = there_and_back(&map, LobeFit::Identity);
            let bound = report.strength_factor / (510.0 * smooth.sqrt());
            prop_assert!(degrees < 0.35);
            prop_assert!(fine <= 1.03 * bound.max(0.02), "{smooth} {rough} {fine} {bound}");
        }
    }
}
