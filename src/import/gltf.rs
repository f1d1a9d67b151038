//! The map of a glTF material with `KHR_materials_anisotropy`, ours or another's, back as Ward widths and directions.
//!
//! Only the material and its two textures are read, by our own walk through the JSON: nothing in the file is trusted. The
//! lobe fit is undone when the file's `extras` say which it was; a foreign file's GGX widths are taken for fitted ones.

use super::Imported;
use crate::convention::{LobeFit, MapInfo, MapRecord, Stretched, gltf};
use crate::error::{Error, Result};
use crate::map::{AnisoMap, Size, Wrap};
use crate::math::{Axis, sin_cos};
use crate::mesh::container::{path_beside, split_glb};
use base64::Engine;
use glam::Vec2;
use image::codecs::png::PngDecoder;
use image::{ImageDecoder, Limits, RgbImage};
use rayon::prelude::*;
use serde_json::Value;
use std::borrow::Cow;
use std::io::Cursor;
use std::path::Path;

/// Reads the first material with the extension from a `.glb` or `.gltf`.
///
/// # Errors
/// [`Error::Read`] when a file cannot be opened, [`Error::File`] when it is no glTF, has no such material, or something in
/// it is damaged, out of range or not supported (JPEG and KTX2 textures, `KHR_texture_transform`, textures of different
/// sizes, other texture coordinates than `TEXCOORD_0`).
pub fn read_gltf(path: &Path) -> Result<Imported> {
    let bytes = super::read_file(path)?;
    let file = Document::parse(path, &bytes)?;
    let material = file.material()?;
    let anisotropy = &material["extensions"]["KHR_materials_anisotropy"];
    let pbr = &material["pbrMetallicRoughness"];
    let roughness_texture = file.texture(&pbr["metallicRoughnessTexture"])?;
    let direction_texture = file.texture(&anisotropy["anisotropyTexture"])?;
    let size = file.common_size(roughness_texture.as_ref(), direction_texture.as_ref())?;
    let record: Option<MapRecord> =
        serde_json::from_value(material["extras"][MapRecord::NAME].clone()).ok();
    let factors = Factors {
        roughness: file.factor(&pbr["roughnessFactor"], 1.0)?,
        strength: file.factor(&anisotropy["anisotropyStrength"], 0.0)?,
        rotation: file.number(&anisotropy["anisotropyRotation"], 0.0)? as f32,
        fit: record.as_ref().and_then(|r| r.lobe_fit).unwrap_or_default(),
    };
    let widths = factors.widths();
    let planes = factors.planes(
        size,
        roughness_texture.as_ref(),
        direction_texture.as_ref(),
        &widths,
    );
    let wrap = match &record {
        Some(record) => record.wrap,
        None => file.wrap(&anisotropy["anisotropyTexture"]),
    };
    let (map, mended) = AnisoMap::from_planes(size, wrap, planes)?;
    let info = record.as_ref().map(MapRecord::info);
    Ok(Imported {
        map,
        mended,
        info: info.unwrap_or_else(|| MapInfo {
            name: super::stem(path),
            aspect: size.width() as f32 / size.height() as f32,
            ..MapInfo::default()
        }),
    })
}

/// The most values a document may have: each takes up to 100 bytes of memory, and materials need few.
const JSON_PARTS_MAX: usize = 2_000_000;

/// The material's numbers.
struct Factors {
    roughness: f32,
    strength: f32,
    rotation: f32,
    fit: LobeFit,
}

impl Factors {
    /// Ward (alpha_t, alpha_b) for each pair of roughness and strength bytes, at `r * 256 + s`.
    fn widths(&self) -> Vec<(f32, f32)> {
        (0..1 << 16)
            .into_par_iter()
            .map(|i: u32| {
                let part = |byte: u32| byte as f32 * (1.0 / 255.0);
                let r = part(i >> 8) * self.roughness;
                let (t, b) = gltf::decode(r, part(i & 255) * self.strength);
                let ward = |alpha: f32| self.fit.invert(alpha.max(1e-7));
                (ward(t), ward(b))
            })
            .collect()
    }

    fn planes(
        &self,
        size: Size,
        roughness: Option<&RgbImage>,
        direction: Option<&RgbImage>,
        widths: &[(f32, f32)],
    ) -> [Vec<f32>; 4] {
        let (sin, cos) = sin_cos(self.rotation.rem_euclid(std::f32::consts::TAU));
        let turn = Vec2::new(cos, sin);
        let pixel = |image: Option<&RgbImage>, i: usize, absent: [u8; 3]| {
            image.map_or(absent, |image| image.as_raw().as_chunks().0[i])
        };
        let texel = |i: usize| {
            let [_, r, _] = pixel(roughness, i, [255; 3]);
            // Without a texture the specification's value is (1, 0.5, 1).
            let [x, y, s] = pixel(direction, i, [255, 128, 255]);
            let (alpha_t, alpha_b) = widths[usize::from(r) << 8 | usize::from(s)];
            let vector = match direction {
                Some(_) => Vec2::new(f32::from(x), f32::from(y)) / 127.5 - Vec2::ONE,
                None => Vec2::X,
            };
            let axis = Axis::from_vector(turn.rotate(vector)).unwrap_or_default();
            Stretched {
                alpha_t,
                alpha_b,
                axis,
            }
            .to_texel(false)
        };
        let plane = |of: &(dyn Fn(usize) -> f32 + Sync)| {
            (0..size.texels())
                .into_par_iter()
                .with_min_len(1 << 14)
                .map(of)
                .collect()
        };
        [
            plane(&|i| texel(i).alpha_x),
            plane(&|i| texel(i).alpha_y),
            plane(&|i| texel(i).axis.cos2),
            plane(&|i| texel(i).axis.sin2),
        ]
    }
}

/// A parsed file.
struct Document<'a> {
    path: &'a Path,
    json: Value,
    /// The binary chunk of a GLB.
    chunk: Option<&'a [u8]>,
}

impl<'a> Document<'a> {
    fn parse(path: &'a Path, bytes: &'a [u8]) -> Result<Self> {
        let (text, chunk) = if bytes.starts_with(b"glTF") {
            split_glb(bytes).map_err(|problem| {
                Error::file(path, format!("it is damaged or cut short ({problem})"))
                    .with_hint("Make or copy the file again")
            })?
        } else {
            (bytes, None)
        };
        let parts = text.iter().filter(|b| matches!(b, b',' | b'[' | b'{'));
        let parts = parts.take(JSON_PARTS_MAX + 1).count();
        if parts > JSON_PARTS_MAX {
            return Err(Error::file(
                path,
                format!("its JSON has over {JSON_PARTS_MAX} values; that many are not read"),
            ));
        }
        let json: Value = serde_json::from_slice(text)
            .map_err(|e| Error::file(path, format!("it is not glTF: {e}")))?;
        Ok(Self { path, json, chunk })
    }

    fn bad(&self, problem: impl Into<String>) -> Error {
        Error::file(self.path, problem)
    }

    fn material(&self) -> Result<&Value> {
        let materials = self.json["materials"].as_array().map(Vec::as_slice);
        materials
            .unwrap_or_default()
            .iter()
            .find(|m| m["extensions"]["KHR_materials_anisotropy"].is_object())
            .ok_or_else(|| {
                self.bad("no material in it has KHR_materials_anisotropy")
                    .with_hint("Only a glTF file with that extension holds an anisotropy map")
            })
    }

    fn number(&self, value: &Value, absent: f64) -> Result<f64> {
        match value {
            Value::Null => Ok(absent),
            other => other
                .as_f64()
                .filter(|n| n.abs() < 1e6)
                .ok_or_else(|| self.bad(format!("{other} stands where a number is needed"))),
        }
    }

    fn factor(&self, value: &Value, absent: f64) -> Result<f32> {
        let number = self.number(value, absent)?;
        if (0.0..=1.0).contains(&number) {
            Ok(number as f32)
        } else {
            Err(self.bad(format!("a material factor is {number}; allowed: 0 to 1")))
        }
    }

    /// The `index`th entry of one of the document's lists.
    fn entry(&self, list: &str, index: &Value) -> Result<&Value> {
        index
            .as_u64()
            .and_then(|i| self.json[list].get(usize::try_from(i).ok()?))
            .ok_or_else(|| self.bad(format!("{list} has no entry {index}")))
    }

    /// What lies beyond the edges of a texture, by its sampler.
    fn wrap(&self, info: &Value) -> Wrap {
        let texture = self.entry("textures", &info["index"]);
        let sampler = texture.and_then(|t| self.entry("samplers", &t["sampler"]));
        let repeats = |mode: &str| {
            let mode = sampler.as_ref().ok().and_then(|s| s[mode].as_u64());
            mode.is_none_or(|m| m == 10_497)
        };
        match (repeats("wrapS"), repeats("wrapT")) {
            (true, true) => Wrap::Repeat,
            (true, false) => Wrap::RepeatU,
            (false, _) => Wrap::Clamp,
        }
    }

    fn texture(&self, info: &Value) -> Result<Option<RgbImage>> {
        if info.is_null() {
            return Ok(None);
        }
        if info["extensions"]["KHR_texture_transform"].is_object() {
            return Err(self
                .bad("a texture has KHR_texture_transform, which is not supported")
                .with_hint("Bake the transform into the texture or the UVs"));
        }
        if info["texCoord"].as_u64().unwrap_or(0) != 0 {
            return Err(self.bad("a texture uses other coordinates than TEXCOORD_0"));
        }
        let texture = self.entry("textures", &info["index"])?;
        let image = self.entry("images", &texture["source"])?;
        let bytes = match &image["uri"] {
            Value::String(uri) => self.resource(uri)?,
            _ => Cow::Borrowed(self.view(&image["bufferView"])?),
        };
        self.decode(&bytes).map(Some)
    }

    /// The bytes of a buffer view, which in a GLB lie in its binary chunk.
    fn view(&self, index: &Value) -> Result<&'a [u8]> {
        let view = self.entry("bufferViews", index)?;
        let outside = || self.bad(format!("bufferView {index} lies outside its buffer"));
        let offset = |key: &str| match &view[key] {
            Value::Null => Some(0),
            n => n.as_u64().and_then(|n| usize::try_from(n).ok()),
        };
        let is_chunk =
            view["buffer"].as_u64() == Some(0) && self.json["buffers"][0]["uri"].is_null();
        let chunk = self.chunk.filter(|_| is_chunk).ok_or_else(|| {
            self.bad("its pictures lie in a buffer that is not the binary chunk")
                .with_hint("Save it as .glb, or with the pictures as PNG files")
        })?;
        let start = offset("byteOffset").ok_or_else(outside)?;
        let length = offset("byteLength").ok_or_else(outside)?;
        let end = start.checked_add(length).ok_or_else(outside)?;
        chunk.get(start..end).ok_or_else(outside)
    }

    /// A data URI, or a file in the document's own folder or below it.
    fn resource(&self, uri: &str) -> Result<Cow<'a, [u8]>> {
        if let Some(data) = uri.strip_prefix("data:") {
            let coded = data.split_once(";base64,").map(|(_, coded)| coded);
            return coded
                .and_then(|c| base64::engine::general_purpose::STANDARD.decode(c).ok())
                .map(Cow::Owned)
                .ok_or_else(|| self.bad("a data URI in it is not base64"));
        }
        let name = path_beside(uri).ok_or_else(|| {
            self.bad(format!("it names `{uri}`, outside its own folder"))
                .with_hint("Put the file beside the glTF file")
        })?;
        super::read_file(&self.path.with_file_name(name)).map(Cow::Owned)
    }

    fn decode(&self, bytes: &[u8]) -> Result<RgbImage> {
        let broken =
            |e: image::ImageError| self.bad(format!("a picture in it is no usable PNG: {e}"));
        let mut decoder = open_png(bytes).map_err(broken)?;
        let (width, height) = decoder.dimensions();
        Size::new(width, height).map_err(|e| self.bad(format!("a picture in it: {e}")))?;
        // Deflate packs at most 1032 to 1: a small file that claims more is not worth the memory.
        if decoder.total_bytes() > 1100 * bytes.len() as u64 {
            return Err(self.bad(format!(
                "a picture claims {width}x{height} texels in {} bytes",
                bytes.len()
            )));
        }
        let mut limits = Limits::default();
        limits.max_alloc = Some(8 * decoder.total_bytes() + (64 << 20));
        decoder.set_limits(limits).map_err(broken)?;
        let picture = image::DynamicImage::from_decoder(decoder).map_err(broken)?;
        Ok(picture.into_rgb8())
    }

    fn common_size(&self, a: Option<&RgbImage>, b: Option<&RgbImage>) -> Result<Size> {
        let (w, h) = match (a, b) {
            (Some(a), Some(b)) if a.dimensions() != b.dimensions() => {
                return Err(self
                    .bad(format!(
                        "its textures are {}x{} and {}x{}",
                        a.width(),
                        a.height(),
                        b.width(),
                        b.height()
                    ))
                    .with_hint("Resize one to the size of the other"));
            }
            (Some(i), _) | (_, Some(i)) => i.dimensions(),
            (None, None) => (1, 1),
        };
        Size::new(w, h)
    }
}

/// The most memory that a PNG's colour profile and texts may take together.
const PNG_EXTRAS_MAX: u64 = 16 << 20;

/// Reads a PNG up to its pixels. The limit must stand from the start: the colour profile, which may unpack to a thousand
/// times its size, comes before them.
fn open_png(bytes: &[u8]) -> image::ImageResult<PngDecoder<Cursor<&[u8]>>> {
    let mut limits = Limits::default();
    limits.max_alloc = Some(PNG_EXTRAS_MAX);
    PngDecoder::with_limits(Cursor::new(bytes), limits)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::Write;

    /// A PNG of one texel with a colour profile of `length` zeros.
    fn png_with_profile(length: usize) -> Vec<u8> {
        let mut packed = flate2::write::ZlibEncoder::new(vec![], flate2::Compression::best());
        packed.write_all(&vec![0; length]).unwrap();
        let mut chunk = b"iCCPx\0\0".to_vec();
        chunk.extend(packed.finish().unwrap());
        let mut crc = flate2::Crc::new();
        crc.update(&chunk);
        let mut framed = (chunk.len() as u32 - 4).to_be_bytes().to_vec();
        framed.extend(chunk);
        framed.extend(crc.sum().to_be_bytes());
        let mut png = vec![];
        let texel = RgbImage::new(1, 1);
        texel
            .write_to(&mut Cursor::new(&mut png), image::ImageFormat::Png)
            .unwrap();
        // After the signature, 8 bytes, and the header chunk, 25.
        png.splice(33..33, framed);
        png
    }

    #[test]
    fn a_colour_profile_is_unpacked_only_up_to_the_limit() {
        let profile = |length| {
            let png = png_with_profile(length);
            let unpacked = open_png(&png).unwrap().icc_profile().unwrap();
            unpacked.map(|profile| profile.len())
        };
        assert_eq!(profile(1 << 20), Some(1 << 20));
        assert_eq!(profile(PNG_EXTRAS_MAX as usize + 1), None);
    }

    #[test]
    fn pictures_are_read_from_the_folder_only() {
        let path = Path::new("/somewhere/a.gltf");
        let document = Document::parse(path, b"{}").unwrap();
        for uri in ["../x.png", "/etc/x.png", "%2e%2e/x.png", "file:///x.png"] {
            let e = document.resource(uri).unwrap_err().to_string();
            assert!(e.contains("outside its own folder"), "{e}");
        }
        let e = document.material().unwrap_err().to_string();
        assert!(e.contains("KHR_materials_anisotropy"));
    }
}
