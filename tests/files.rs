//! Files that come from elsewhere: broken ones must end in a clear sentence, never in a panic, whatever their bytes say.

use anisomap::Error;
use anisomap::convention::MapInfo;
use anisomap::export::Export;
use anisomap::export::exr::{Precision, write_master, write_rgb_pair};
use anisomap::export::gltf::{GltfOptions, write_glb, write_gltf};
use anisomap::import::exr::{read_master, read_rgb_pair};
use anisomap::import::gltf::read_gltf;
use anisomap::map::{AnisoMap, DEFAULT_TEXEL, Mended, Size, Texel, Wrap};
use anisomap::math::Axis;
use anisomap::mesh::{BUILTIN_NAMES, Mesh, builtin};
use anisomap::recipe::Material;
use exr::prelude::*;
use glam::{Vec2, Vec3, Vec4};
use std::fs;
use std::path::{Path, PathBuf};

fn broken(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("tests/broken")
        .join(name)
}

/// Straight grooves that change slowly, so that files of it are small.
fn small_map() -> AnisoMap {
    let size = Size::new(24, 40).expect("a size");
    let mut map = AnisoMap::constant(size, Wrap::RepeatU, DEFAULT_TEXEL);
    let mut region = map.region_mut();
    for i in 0..size.texels() {
        let y = (i / 24) as f32;
        region.set(
            i,
            Texel {
                alpha_x: 0.05 + 0.001 * y,
                alpha_y: 0.3,
                axis: Axis::from_degrees(3.0 * y),
            },
        );
    }
    map
}

/// A file with our channels, in the crate's own encoding of choice.
fn foreign(path: &Path, names: [&str; 4], compression: Compression, blocks: Blocks) {
    let map = small_map();
    let planes = [map.alpha_x(), map.alpha_y(), map.cos2(), map.sin2()];
    let channels = names
        .iter()
        .zip(planes)
        .map(|(name, plane)| AnyChannel::new(*name, FlatSamples::F32(plane.to_vec())))
        .collect();
    let layer = Layer::new(
        (24, 40),
        LayerAttributes::named("map"),
        Encoding {
            compression,
            blocks,
            line_order: LineOrder::Increasing,
        },
        AnyChannels::sort(channels),
    );
    Image::from_layer(layer)
        .write()
        .to_file(path)
        .expect("written");
}

const MASTER: [&str; 4] = ["alpha.X", "alpha.Y", "axis.X", "axis.Y"];

fn master_bytes() -> Vec<u8> {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("m.exr");
    let (map, info) = (small_map(), MapInfo::default());
    write_master(&path, &Export::new(&map, &info), Precision::Half).expect("written");
    fs::read(path).expect("read")
}

/// Where the content of a header's attribute starts.
fn attribute(file: &[u8], name_and_kind: &str) -> usize {
    let found = file
        .windows(name_and_kind.len())
        .position(|w| w == name_and_kind.as_bytes());
    found.expect("it has the attribute") + name_and_kind.len() + 4
}

/// A master whose header claims `side` texels a side, in so many blocks.
fn claiming(mut master: Vec<u8>, side: i32, blocks: i32) -> Vec<u8> {
    // The windows are four whole numbers: the first and the last column and row.
    for window in ["dataWindow\0box2i\0", "displayWindow\0box2i\0"] {
        let corner = attribute(&master, window) + 8;
        for n in [corner, corner + 4] {
            master[n..n + 4].copy_from_slice(&(side - 1).to_le_bytes());
        }
    }
    let at = attribute(&master, "chunkCount\0int\0");
    master[at..at + 4].copy_from_slice(&blocks.to_le_bytes());
    master
}

#[test]
#[ignore = "writes tests/broken/*.exr; run after changing the file format"]
fn write_broken_files() {
    let master = master_bytes();
    fs::write(broken("truncated.exr"), &master[..master.len() / 2]).unwrap();
    let huge = claiming(master, 1_000_000, 62_500);
    fs::write(broken("huge_header.exr"), huge).unwrap();
    let names = ["R", "G", "B", "A"];
    foreign(
        &broken("other_channels.exr"),
        names,
        Compression::ZIP16,
        Blocks::ScanLines,
    );
    foreign(
        &broken("dwa.exr"),
        MASTER,
        Compression::DWAA(None),
        Blocks::ScanLines,
    );
}

#[test]
fn broken_exr_files_are_refused_in_words() {
    let refused = |name: &str, words: &[&str]| {
        let e = read_master(&broken(name)).unwrap_err();
        assert_eq!(e.exit_code(), 2);
        let text = e.to_string();
        for word in words.iter().chain([&name]) {
            assert!(text.contains(word), "{name}: `{text}` has no `{word}`");
        }
    };
    refused("truncated.exr", &["damaged or cut short"]);
    refused(
        "other_channels.exr",
        &["A, B, G, R", "alpha.X, alpha.Y, axis.X, axis.Y"],
    );
    refused("huge_header.exr", &["1000000x1000000", "32768"]);
    refused("dwa.exr", &["dwaa", "ZIP"]);
    refused("no_uvs.obj", &["not an OpenEXR file"]);
    refused("no_such.exr", &["cannot read"]);
    let folder = read_master(Path::new(env!("CARGO_MANIFEST_DIR"))).unwrap_err();
    assert!(matches!(folder, Error::Read { .. }));
    assert!(folder.to_string().contains("folder"));
    let glb = read_gltf(&broken("truncated.glb")).unwrap_err().to_string();
    assert!(glb.contains("cut short"), "{glb}");
    let glb = read_gltf(&broken("no_position.glb"))
        .unwrap_err()
        .to_string();
    assert!(glb.contains("KHR_materials_anisotropy"), "{glb}");
}

/// What a file of these bytes is refused with.
fn refusal(bytes: &[u8]) -> String {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("m.exr");
    fs::write(&path, bytes).expect("written");
    read_master(&path).expect_err("refused").to_string()
}

#[test]
fn a_master_that_claims_more_than_its_bytes_can_hold_is_refused_before_memory_is_taken() {
    let mut bomb = claiming(master_bytes(), 16_384, 1024);
    bomb.extend([0; 8 * 1024]);
    let e = refusal(&bomb);
    assert!(e.contains("cannot hold the 16384x16384 texels"), "{e}");
    // What is not compressed takes all the room that it claims.
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("plain.exr");
    foreign(&path, MASTER, Compression::Uncompressed, Blocks::ScanLines);
    let good = fs::read(&path).unwrap();
    let e = refusal(&good[..24 * 40 * 16 - 1]);
    assert!(e.contains("cannot hold the 24x40 texels"), "{e}");
}

#[test]
fn a_block_that_stands_for_several_is_refused() {
    let master = master_bytes();
    // 40 lines are three blocks of 16; their places in the file stand before the first, which starts with its line, 0.
    let words: Vec<u64> = (0..master.len() - 24)
        .map(|i| u64::from_le_bytes(master[i..i + 8].try_into().unwrap()))
        .collect();
    let table = (0..words.len())
        .find(|i| words[*i] == *i as u64 + 24)
        .expect("the first block follows its table");
    let mut repeated = master.clone();
    repeated.copy_within(table..table + 8, table + 8);
    let e = refusal(&repeated);
    assert!(e.contains("a block repeats another"), "{e}");
    let mut misplaced = master;
    let second = words[table + 8] as usize;
    misplaced[second..second + 4].copy_from_slice(&4000i32.to_le_bytes());
    let e = refusal(&misplaced);
    assert!(e.contains("has no place"), "{e}");
}

#[cfg(unix)]
#[test]
fn a_named_pipe_is_refused_instead_of_waiting_for_a_writer() {
    let folder = tempfile::tempdir().unwrap();
    for (name, read) in [
        ("m.exr", (|path| read_master(path).err()) as fn(&Path) -> _),
        ("m.glb", |path| read_gltf(path).err()),
        ("m.obj", |path| anisomap::mesh::load(path).err()),
    ] {
        let path = folder.path().join(name);
        let made = std::process::Command::new("mkfifo").arg(&path).status();
        assert!(made.unwrap().success());
        let (send, answer) = std::sync::mpsc::channel();
        std::thread::spawn(move || send.send(read(&path)));
        let error = answer.recv_timeout(std::time::Duration::from_secs(20));
        let text = error.expect("it waits").expect("an error").to_string();
        assert!(text.contains("not a regular file"), "{text}");
    }
}

#[test]
fn every_lossless_encoding_is_read() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("foreign.exr");
    let tiles = Blocks::Tiles(Vec2(16, 16));
    for compression in [
        Compression::Uncompressed,
        Compression::RLE,
        Compression::ZIP1,
        Compression::ZIP16,
        Compression::PIZ,
        Compression::PXR24,
    ] {
        for blocks in [Blocks::ScanLines, tiles] {
            foreign(&path, MASTER, compression, blocks);
            let back = read_master(&path).unwrap();
            assert_eq!(back.mended, Mended::default());
            let map = small_map();
            for i in 0..map.size().texels() {
                let (want, got) = (map.texel_at(i), back.map.texel_at(i));
                assert!(
                    (want.alpha_x / got.alpha_x - 1.0).abs() < 2e-5,
                    "{compression}"
                );
                assert!(want.axis.angle_to(got.axis) < 1e-4);
            }
            assert_eq!(
                (back.info.name.as_str(), back.info.aspect),
                ("foreign", 0.6)
            );
        }
    }
    for refused in [Compression::B44, Compression::B44A, Compression::DWAB(None)] {
        foreign(&path, MASTER, refused, Blocks::ScanLines);
        assert!(read_master(&path).is_err(), "{refused}");
    }
}

#[test]
fn the_part_with_the_channels_is_found_wherever_it_stands() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("parts.exr");
    let part = |name: &str, channels: &[(&str, f32)], size: (usize, usize)| {
        let channels = channels
            .iter()
            .map(|(name, value)| {
                let samples = vec![f16::from_f32(*value); size.0 * size.1];
                AnyChannel::new(*name, FlatSamples::F16(samples))
            })
            .collect();
        Layer::new(
            size,
            LayerAttributes::named(name),
            Encoding::FAST_LOSSLESS,
            AnyChannels::sort(channels),
        )
    };
    let ours = [
        ("alpha.X", 0.25),
        ("alpha.Y", 0.5),
        ("axis.X", 0.0),
        ("axis.Y", 1.0),
        ("depth", 3.0),
    ];
    let image = Image::from_layers(
        ImageAttributes::with_size((8, 8)),
        vec![
            part("beauty", &[("R", 0.5), ("G", 0.5), ("B", 0.5)], (8, 8)),
            part("map", &ours, (5, 3)),
        ],
    );
    image.write().to_file(&path).unwrap();
    let back = read_master(&path).unwrap();
    assert_eq!(back.map.size(), Size::new(5, 3).unwrap());
    let texel = back.map.texel(4, 2);
    assert_eq!((texel.alpha_x, texel.alpha_y), (0.25, 0.5));
    assert!((texel.axis.degrees() - 45.0).abs() < 1e-3);
}

/// Numbers that are always the same.
struct Dice(u64);

impl Dice {
    fn roll(&mut self, below: usize) -> usize {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        (self.0 >> 11) as usize % below
    }
}

/// A damaged copy: bytes changed, numbers made extreme, pieces cut out, the end cut off.
fn damaged(bytes: &[u8], dice: &mut Dice, near_start: usize) -> Vec<u8> {
    let mut out = bytes.to_vec();
    for _ in 0..1 + dice.roll(4) {
        let place = if dice.roll(3) == 0 {
            out.len()
        } else {
            near_start.min(out.len())
        };
        let at = dice.roll(place.max(1)).min(out.len().saturating_sub(1));
        match dice.roll(6) {
            0 => out[at] ^= 1 << dice.roll(8),
            1 => out[at] = dice.roll(256) as u8,
            2 | 3 => {
                let extreme = [0, 1, -1, i32::MAX, i32::MIN, 65_535, 1 << 20][dice.roll(7)];
                for (to, from) in out[at..].iter_mut().zip(extreme.to_le_bytes()) {
                    *to = from;
                }
            }
            4 => {
                let end = (at + 1 + dice.roll(16)).min(out.len());
                out.drain(at..end);
            }
            _ => out.truncate(at.max(1)),
        }
        if out.is_empty() {
            break;
        }
    }
    out
}

#[test]
fn damaged_masters_are_read_or_refused() {
    let master = master_bytes();
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("damaged.exr");
    let mut dice = Dice(0x2545_f491_4f6c_dd1d);
    let (mut read, mut refused) = (0, 0);
    for _ in 0..800 {
        fs::write(&path, damaged(&master, &mut dice, 1800)).unwrap();
        match read_master(&path) {
            Ok(back) => {
                read += 1;
                assert!(back.map.alpha_x().iter().all(|a| (1e-3..=1.5).contains(a)));
            }
            Err(e) => {
                refused += 1;
                assert_eq!(e.exit_code(), 2, "{e}");
            }
        }
    }
    assert!(read > 10 && refused > 100, "{read} read, {refused} refused");
}

#[test]
fn damaged_glb_files_are_read_or_refused() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("damaged.glb");
    let (map, info) = (small_map(), MapInfo::default());
    let mesh = builtin("plane").unwrap();
    let options = GltfOptions::default();
    write_glb(
        &path,
        &Export::new(&map, &info),
        &mesh,
        &Material::default(),
        options,
    )
    .unwrap();
    let good = fs::read(&path).unwrap();
    let json = 20 + u32::from_le_bytes(good[12..16].try_into().unwrap()) as usize;
    let mut dice = Dice(0x9e37_79b9_7f4a_7c15);
    let (mut read, mut refused) = (0, 0);
    for round in 0..800 {
        let bytes = if round % 2 == 0 {
            damaged(&good, &mut dice, good.len())
        } else {
            // Numbers and names inside the JSON, its length kept.
            let mut bytes = good.clone();
            for _ in 0..1 + dice.roll(3) {
                let at = 20 + dice.roll(json - 20);
                bytes[at] = b"0123456789-{}[]\",:e"[dice.roll(19)];
            }
            bytes
        };
        fs::write(&path, bytes).unwrap();
        match read_gltf(&path) {
            Ok(_) => read += 1,
            Err(e) => {
                refused += 1;
                assert_eq!(e.exit_code(), 2, "{e}");
            }
        }
    }
    assert!(read > 20 && refused > 100, "{read} read, {refused} refused");
}

#[test]
fn a_png_that_claims_too_much_is_refused_before_it_is_decoded() {
    let folder = tempfile::tempdir().unwrap();
    let (map, info) = (small_map(), MapInfo::default());
    let stem = folder.path().join("m");
    let mesh = builtin("plane").unwrap();
    let export = Export::new(&map, &info);
    let (written, _) = write_gltf(
        &stem,
        &export,
        &mesh,
        &Material::default(),
        GltfOptions::default(),
    )
    .unwrap();
    let png = folder.path().join("m_roughness.png");
    let mut bytes = fs::read(&png).unwrap();
    // Width and height of the header chunk, and its checksum, which covers kind and content.
    bytes[16..20].copy_from_slice(&16_384u32.to_be_bytes());
    bytes[20..24].copy_from_slice(&16_384u32.to_be_bytes());
    let mut crc = flate2::Crc::new();
    crc.update(&bytes[12..29]);
    bytes[29..33].copy_from_slice(&crc.sum().to_be_bytes());
    fs::write(&png, bytes).unwrap();
    let e = read_gltf(&written[0].path).unwrap_err().to_string();
    assert!(e.contains("claims 16384x16384"), "{e}");
}

#[test]
fn the_pair_must_be_a_pair() {
    let folder = tempfile::tempdir().unwrap();
    let info = MapInfo::default();
    let write = |name: &str, map: &AnisoMap| {
        let stem = folder.path().join(name);
        write_rgb_pair(&stem, &Export::new(map, &info), Precision::Half).unwrap()
    };
    let [alpha, _] = write("a", &small_map());
    let size = Size::new(3, 3).unwrap();
    let [_, direction] = write("b", &AnisoMap::constant(size, Wrap::Clamp, DEFAULT_TEXEL));
    let e = read_rgb_pair(&alpha.path, &direction.path)
        .unwrap_err()
        .to_string();
    assert!(e.contains("3x3") && e.contains("24x40"), "{e}");
}

#[test]
fn every_built_in_shape_can_be_written() {
    let folder = std::env::var_os("ANISOMAP_KEEP_GLB").map(PathBuf::from);
    let temporary = tempfile::tempdir().unwrap();
    let folder = folder.unwrap_or_else(|| temporary.path().to_owned());
    let (map, info) = (small_map(), MapInfo::default());
    let export = Export::new(&map, &info);
    for name in BUILTIN_NAMES {
        let mesh = builtin(name).unwrap();
        let plastic = Material {
            diffuse: [0.4, 0.1, 0.1],
            specular: [0.05; 3],
            ..Material::default()
        };
        let options = GltfOptions::default();
        let path = folder.join(format!("{name}.glb"));
        write_glb(&path, &export, &mesh, &Material::default(), options).unwrap();
        let (written, _) =
            write_gltf(&folder.join(name), &export, &mesh, &plastic, options).unwrap();
        let [a, b] = [&path, &written[0].path].map(|p| read_gltf(p).unwrap());
        assert_eq!(a.map, b.map);
        agrees_with_its_file(&mesh, &path);
    }
    // Mirrored in u, as a layout that uses a texture for both sides of a shape is.
    let mut mesh = builtin("pot").unwrap();
    for (uv, tangent) in mesh.uvs.iter_mut().zip(&mut mesh.tangents) {
        uv.x = 1.0 - uv.x;
        *tangent = -*tangent;
    }
    let path = temporary.path().join("mirrored.glb");
    let options = GltfOptions::default();
    write_glb(&path, &export, &mesh, &Material::default(), options).unwrap();
    agrees_with_its_file(&mesh, &path);
}

/// The file's own numbers are a mesh as glTF 2.0, section 3.7.2.1, wants it, and our reader makes of them what was written.
fn agrees_with_its_file(mesh: &Mesh, path: &Path) {
    let bytes = fs::read(path).expect("read");
    let uvs = attribute_of_glb::<2>(&bytes, "TEXCOORD_0");
    let tangents = attribute_of_glb::<4>(&bytes, "TANGENT");
    let normals = attribute_of_glb::<3>(&bytes, "NORMAL");
    let back = anisomap::mesh::load(path).expect("a mesh");
    assert_eq!(back.triangles.len(), mesh.triangles.len());
    let mut compared = 0;
    for (corners, read) in mesh.triangles.iter().zip(&back.triangles) {
        let down = along_file_v(mesh, *corners, &uvs);
        for (i, j) in corners.iter().zip(read) {
            let (i, j) = (*i as usize, *j as usize);
            assert_eq!(uvs[i], [mesh.uvs[i].x, 1.0 - mesh.uvs[i].y]);
            assert_eq!(back.positions[j], mesh.positions[i]);
            assert!(back.normals[j].distance(mesh.normals[i].normalize()) < 1e-5);
            assert!(back.uvs[j].distance(mesh.uvs[i]) < 1e-6);
            // A pole has no tangent of its own, and gets any.
            let Some(tangent) = mesh.tangents[i].truncate().try_normalize() else {
                continue;
            };
            assert!(back.tangents[j].distance(tangent.extend(mesh.tangents[i].w)) < 1e-3);
            // The bitangent points up the texture, against the file's v.
            let (n, t) = (Vec3::from(normals[i]), Vec4::from(tangents[i]));
            if let Some(down) = down {
                assert!(n.cross(t.truncate()).dot(-down) * t.w > 0.0, "{i}");
                compared += 1;
            }
        }
    }
    assert!(compared > 2 * mesh.triangles.len(), "{compared}");
}

/// The derivative of the position along the file's v, which runs down; `None` for a triangle without area in the texture.
fn along_file_v(mesh: &Mesh, corners: [u32; 3], uvs: &[[f32; 2]]) -> Option<Vec3> {
    let [a, b, c] = corners.map(|i| (mesh.positions[i as usize], Vec2::from(uvs[i as usize])));
    let (p1, p2) = (b.0 - a.0, c.0 - a.0);
    let (t1, t2) = (b.1 - a.1, c.1 - a.1);
    let area = t1.perp_dot(t2);
    (area.abs() > 1e-12).then(|| (p2 * t1.x - p1 * t2.x) / area)
}

/// A float attribute of a GLB's only primitive, as it stands in the file.
fn attribute_of_glb<const N: usize>(bytes: &[u8], name: &str) -> Vec<[f32; N]> {
    let length = u32::from_le_bytes(bytes[12..16].try_into().expect("a number")) as usize;
    let document: serde_json::Value =
        serde_json::from_slice(&bytes[20..20 + length]).expect("JSON");
    let number = |value: &serde_json::Value| value.as_u64().expect("a number") as usize;
    let primitive = &document["meshes"][0]["primitives"][0];
    let accessor = &document["accessors"][number(&primitive["attributes"][name])];
    let view = &document["bufferViews"][number(&accessor["bufferView"])];
    let start = 28 + length + number(&view["byteOffset"]);
    let content = &bytes[start..start + 4 * N * number(&accessor["count"])];
    let floats: Vec<f32> = content
        .as_chunks()
        .0
        .iter()
        .map(|b| f32::from_le_bytes(*b))
        .collect();
    floats.as_chunks().0.to_vec()
}
