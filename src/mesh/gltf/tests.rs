//! Hand-made GLBs: whole, placed, compressed into small integers, and damaged.

use super::*;
use crate::mesh::tests::numbers;
use serde_json::{Value, json};
use std::path::PathBuf;

/// A square of side 2 facing +z, its texture upright: two triangles, four vertices, 16-bit indices.
fn quad(with_tangents: bool) -> (Value, Vec<u8>) {
    let corners = [[-1.0f32, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]];
    let mut data: Vec<f32> = corners.iter().flat_map(|[x, y]| [*x, *y, 0.0]).collect();
    data.extend([0.0f32, 0.0, 1.0].repeat(4));
    data.extend(
        corners
            .iter()
            .flat_map(|[x, y]| [0.5 + 0.5 * x, 0.5 - 0.5 * y]),
    );
    data.extend([0.0f32, 1.0, 0.0, -1.0].repeat(4));
    let mut bytes: Vec<u8> = data.iter().flat_map(|x| x.to_le_bytes()).collect();
    bytes.extend([0u16, 1, 2, 0, 2, 3].iter().flat_map(|i| i.to_le_bytes()));
    let mut attributes = json!({"POSITION": 0, "NORMAL": 1, "TEXCOORD_0": 2});
    if with_tangents {
        attributes["TANGENT"] = json!(3);
    }
    let float = |view: u32, kind: &str| json!({"bufferView": view, "componentType": 5126, "count": 4, "type": kind});
    let mut position = float(0, "VEC3");
    position["min"] = json!([-1, -1, 0]);
    position["max"] = json!([1, 1, 0]);
    let document = json!({
        "asset": {"version": "2.0"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0}],
        "meshes": [{"name": "quad", "primitives": [{"attributes": attributes, "indices": 4}]}],
        "accessors": [position, float(1, "VEC3"), float(2, "VEC2"), float(3, "VEC4"),
            {"bufferView": 4, "componentType": 5123, "count": 6, "type": "SCALAR"}],
        "bufferViews": [
            {"buffer": 0, "byteOffset": 0, "byteLength": 48},
            {"buffer": 0, "byteOffset": 48, "byteLength": 48},
            {"buffer": 0, "byteOffset": 96, "byteLength": 32},
            {"buffer": 0, "byteOffset": 128, "byteLength": 64},
            {"buffer": 0, "byteOffset": 192, "byteLength": 12}],
        "buffers": [{"byteLength": 204}],
    });
    (document, bytes)
}

fn glb(document: &Value, data: &[u8]) -> Vec<u8> {
    let mut json = document.to_string().into_bytes();
    json.resize(json.len().next_multiple_of(4), b' ');
    let mut data = data.to_vec();
    data.resize(data.len().next_multiple_of(4), 0);
    let mut bytes = b"glTF".to_vec();
    for word in [2, 28 + json.len() + data.len(), json.len()] {
        bytes.extend((word as u32).to_le_bytes());
    }
    bytes.extend(b"JSON");
    bytes.extend(json);
    bytes.extend((data.len() as u32).to_le_bytes());
    bytes.extend(b"BIN\0");
    bytes.extend(data);
    bytes
}

fn read(document: &Value, data: &[u8]) -> Result<Mesh> {
    let mesh = parse(Path::new("test.glb"), &glb(document, data), None)?;
    mesh.validate()?;
    Ok(mesh)
}

fn refusal(change: impl FnOnce(&mut Value)) -> String {
    let (mut document, data) = quad(true);
    change(&mut document);
    let error = read(&document, &data).expect_err("this must be refused");
    assert_eq!(error.exit_code(), 2);
    error.to_string()
}

#[test]
fn a_quad_comes_in_upright_with_the_tangents_it_has() {
    let (document, data) = quad(true);
    let mesh = read(&document, &data).unwrap();
    assert_eq!(mesh.triangles, [[0, 1, 2], [0, 2, 3]]);
    for i in 0..4 {
        assert_eq!(mesh.uvs[i], 0.5 + 0.5 * mesh.positions[i].truncate());
        assert_eq!(
            mesh.tangents[i],
            Vec4::new(0.0, 1.0, 0.0, -1.0),
            "kept as the file has them"
        );
    }
    assert_eq!(mesh.aspect, 1.0);
}

#[test]
fn missing_tangents_point_along_u_and_b_to_image_up() {
    let (document, data) = quad(false);
    let mesh = read(&document, &data).unwrap();
    assert!(
        mesh.tangents
            .iter()
            .all(|t| *t == Vec4::new(1.0, 0.0, 0.0, 1.0)),
        "{:?}",
        mesh.tangents
    );
    assert_eq!(mesh.handedness_conflicts(), 0);
}

#[test]
fn missing_normals_are_flat_and_drop_the_tangents() {
    let (mut document, data) = quad(true);
    document["meshes"][0]["primitives"][0]["attributes"]
        .as_object_mut()
        .unwrap()
        .remove("NORMAL");
    let mesh = read(&document, &data).unwrap();
    assert_eq!(mesh.positions.len(), 6, "no vertex is shared");
    assert!(mesh.normals.iter().all(|n| *n == Vec3::Z));
    assert!(
        mesh.tangents
            .iter()
            .all(|t| *t == Vec4::new(1.0, 0.0, 0.0, 1.0))
    );
}

#[test]
fn nodes_place_turn_and_mirror() {
    let (mut document, data) = quad(false);
    document["nodes"] = json!([
        {"children": [1, 2], "translation": [10, 0, 0]},
        {"mesh": 0, "scale": [2, 1, 1]},
        {"mesh": 0, "scale": [-1, 1, 1], "rotation": [0, 0, 0, 2]},
    ]);
    let mesh = read(&document, &data).unwrap();
    assert_eq!(mesh.positions[1], Vec3::new(12.0, -1.0, 0.0));
    assert_eq!(mesh.tangents[1], Vec4::new(1.0, 0.0, 0.0, 1.0));
    // The mirrored one still faces +z; its tangent follows U to the left, and w turns around.
    assert_eq!(mesh.positions[5], Vec3::new(9.0, -1.0, 0.0));
    assert_eq!(mesh.normals[5], Vec3::Z);
    assert_eq!(mesh.tangents[5], Vec4::new(-1.0, 0.0, 0.0, -1.0));
    let [a, b, c] = mesh.corners(mesh.triangles[2]);
    assert!((b - a).cross(c - a).z > 0.0);
    assert_eq!(mesh.handedness_conflicts(), 0);
    assert_eq!(mesh.islands().mirrored, [false, true]);
}

#[test]
fn normals_follow_an_uneven_scale() {
    let (mut document, data) = quad(false);
    // 45 degrees around x, then 3 times as high: the normal leans back toward z.
    let h = std::f64::consts::FRAC_PI_8;
    document["nodes"] = json!([
        {"children": [1], "scale": [1, 3, 1]},
        {"mesh": 0, "rotation": [h.sin(), 0, 0, h.cos()]},
    ]);
    let mesh = read(&document, &data).unwrap();
    let [a, b, c] = mesh.corners(mesh.triangles[0]);
    let face = (b - a).cross(c - a).normalize();
    assert!(
        mesh.normals[0].abs_diff_eq(face, 1e-6),
        "{} {face}",
        mesh.normals[0]
    );
}

#[test]
fn a_node_scaled_to_nothing_is_hidden() {
    let (mut document, data) = quad(true);
    document["nodes"] = json!([{"mesh": 0, "children": [1]}, {"mesh": 0, "scale": [0, 0, 0]}]);
    assert_eq!(read(&document, &data).unwrap().triangles.len(), 2);
}

#[test]
fn strips_fans_and_unindexed_triangles_are_read() {
    for (mode, order) in [(5, [0u16, 1, 3, 2]), (6, [0, 1, 2, 3])] {
        let (mut document, mut data) = quad(true);
        data.truncate(192);
        data.extend(order.iter().flat_map(|i| i.to_le_bytes()));
        data.extend([0; 4]);
        document["accessors"][4]["count"] = json!(4);
        document["meshes"][0]["primitives"][0]["mode"] = json!(mode);
        let mesh = read(&document, &data).unwrap();
        assert_eq!(mesh.triangles.len(), 2);
        for t in &mesh.triangles {
            let [a, b, c] = mesh.corners(*t);
            assert!((b - a).cross(c - a).z > 0.0, "mode {mode} winds wrongly");
        }
    }
    let (mut document, data) = quad(true);
    let primitive = &mut document["meshes"][0]["primitives"][0];
    primitive.as_object_mut().unwrap().remove("indices");
    primitive["mode"] = json!(6);
    assert_eq!(read(&document, &data).unwrap().triangles.len(), 2);
}

#[test]
fn quantised_attributes_are_read() {
    let (mut document, mut data) = quad(false);
    document["extensionsRequired"] = json!(["KHR_mesh_quantization"]);
    // Normalised 16-bit texture coordinates with a stride of 8.
    for (i, uv) in [[0u16, 65535], [65535, 65535], [65535, 0], [0, 0]]
        .iter()
        .enumerate()
    {
        for (k, x) in uv.iter().enumerate() {
            data[96 + 8 * i + 2 * k..][..2].copy_from_slice(&x.to_le_bytes());
        }
    }
    document["accessors"][2]["componentType"] = json!(5123);
    document["accessors"][2]["normalized"] = json!(true);
    document["bufferViews"][2]["byteStride"] = json!(8);
    let mesh = read(&document, &data).unwrap();
    assert_eq!(mesh.uvs[0], Vec2::ZERO);
    assert_eq!(mesh.uvs[2], Vec2::ONE);
}

#[test]
fn a_gltf_finds_its_data_in_a_uri_and_beside_itself_only() {
    let (mut document, data) = quad(true);
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("quad.gltf");
    let mut load = |uri: &str| {
        document["buffers"][0]["uri"] = json!(uri);
        std::fs::write(&path, document.to_string()).unwrap();
        crate::mesh::load(&path)
    };
    let inline = load(&format!(
        "data:application/octet-stream;base64,{}",
        BASE64.encode(&data)
    ))
    .unwrap();
    assert_eq!(inline.name, "quad");
    std::fs::create_dir(folder.path().join("a b")).unwrap();
    std::fs::write(folder.path().join("a b/quad.bin"), &data).unwrap();
    assert_eq!(load("a%20b/quad.bin").unwrap(), inline);
    assert!(matches!(load("missing.bin"), Err(Error::Read { .. })));
    for outside in [
        "../quad.bin",
        "/etc/passwd",
        "a/../../b",
        "file:///etc/passwd",
        "https://a/b",
        "..%2fb",
        "c:\\b",
        "",
    ] {
        let text = load(outside).unwrap_err().to_string();
        assert!(
            text.contains("not in the file's own folder"),
            "{outside}: {text}"
        );
    }
    let text = load("data:application/octet-stream;base64,@@@")
        .unwrap_err()
        .to_string();
    assert!(text.contains("not base64"), "{text}");
}

#[test]
fn what_is_wrong_is_said() {
    let primitive = "/meshes/0/primitives/0";
    let set = |pointer: &str, value: Value| {
        let pointer = pointer.to_owned();
        refusal(move |d| *d.pointer_mut(&pointer).unwrap() = value)
    };
    let attributes = format!("{primitive}/attributes");
    for (pointer, value, says) in [
        (
            attributes.as_str(),
            json!({"TEXCOORD_0": 2}),
            "has no POSITION",
        ),
        (
            &attributes,
            json!({"POSITION": 99, "TEXCOORD_0": 2}),
            "POSITION names accessor 99, but the file has 5",
        ),
        (
            &attributes,
            json!({"POSITION": 0}),
            "has no texture coordinates (TEXCOORD_0)",
        ),
        (&attributes, json!({"POSITION": -1}), "no glTF 2.0"),
        (
            &attributes,
            json!({"POSITION": 0, "TEXCOORD_0": 4}),
            "type SCALAR; allowed: VEC2",
        ),
        (
            "/accessors/2/count",
            json!(3),
            "3 elements of TEXCOORD_0 for 4 positions",
        ),
        ("/accessors/0/count", json!(5), "5 elements reach beyond"),
        ("/accessors/0/count", json!(u64::MAX), "reach beyond"),
        ("/accessors/4/count", json!(5), "no multiple of 3"),
        (
            "/accessors/4/componentType",
            json!(5122),
            "not unsigned whole numbers",
        ),
        ("/accessors/4/componentType", json!(1), "component type 1"),
        ("/accessors/0/bufferView", json!(9), "buffer view 9"),
        ("/accessors/0/bufferView", json!(null), "sparse"),
        ("/bufferViews/0/byteLength", json!(u64::MAX), "reach beyond"),
        ("/bufferViews/0/byteOffset", json!(u64::MAX), "reach beyond"),
        (
            "/buffers/0/byteLength",
            json!(1_000_000_000_000u64),
            "instead of 1000000000000",
        ),
        ("/scene", json!(3), "scene 3"),
        ("/scenes/0/nodes", json!([7]), "node 7"),
        ("/scenes/0/nodes", json!([]), "no triangles"),
        ("/scenes/0/nodes", json!([0, 0]), "more than one parent"),
        (
            "/nodes/0",
            json!({"mesh": 0, "children": [0]}),
            "more than one parent",
        ),
        ("/nodes/0", json!({"mesh": 4}), "mesh 4"),
        (
            "/nodes/0",
            json!({"mesh": 0, "scale": [1e30, 1, 1]}),
            "transform takes a vertex",
        ),
        ("/asset/version", json!("1.0"), "glTF version 1.0"),
    ] {
        let text = set(pointer, value.clone());
        assert!(text.contains(says), "{pointer} {value}: {text}");
    }
    let text = refusal(|d| d["extensionsRequired"] = json!(["KHR_draco_mesh_compression"]));
    assert!(text.contains("KHR_draco_mesh_compression"), "{text}");
    let text = refusal(|d| d["meshes"][0]["primitives"][0]["mode"] = json!(9));
    assert!(text.contains("mode 9"), "{text}");
    let text = refusal(|d| {
        let primitive = d["meshes"][0]["primitives"][0].clone();
        d["meshes"][0]["primitives"] = json!(vec![primitive; 1001]);
        d["nodes"] = json!(vec![json!({"mesh": 0}); 1000]);
        d["scenes"][0]["nodes"] = json!((0..1000).collect::<Vec<_>>());
    });
    assert!(text.contains("1001000 parts"), "{text}");
    let text = refusal(|d| d["meshes"][0]["primitives"][0]["mode"] = json!(1));
    assert!(text.contains("no triangles"), "{text}");
}

#[test]
fn numbers_that_are_none_are_refused() {
    for (at, says) in [(0, "vertex 0 lies at"), (96, "texture coordinates")] {
        for bad in [f32::NAN, f32::INFINITY, 1e30] {
            let (document, mut data) = quad(true);
            data[at..at + 4].copy_from_slice(&bad.to_le_bytes());
            let text = read(&document, &data).unwrap_err().to_string();
            assert!(text.contains(says), "{text}");
        }
    }
    // Normals and tangents without a direction are repaired: they are wrong in many exporters' files.
    let (document, mut data) = quad(true);
    data[48..60].fill(0);
    data[128..132].copy_from_slice(&f32::NAN.to_le_bytes());
    let mesh = read(&document, &data).unwrap();
    assert_eq!(mesh.normals[0], Vec3::Z);
    assert_eq!(mesh.tangents[0].truncate(), Vec3::ZERO);
}

#[test]
fn every_truncation_is_refused() {
    let (document, data) = quad(true);
    let bytes = glb(&document, &data);
    for length in 0..bytes.len() {
        assert!(
            parse(Path::new("t.glb"), &bytes[..length], None).is_err(),
            "{length} bytes"
        );
    }
}

#[test]
fn damaged_glbs_never_panic() {
    let mut next = numbers(11);
    let (mut good, mut bad) = (0, 0);
    let words: [u32; 8] = [
        0,
        1,
        2,
        0x7fff_ffff,
        0xffff_ffff,
        0x7fc0_0000,
        0x7f80_0000,
        0x4b00_0000,
    ];
    for round in 0..2000 {
        let (document, data) = quad(round % 2 == 0);
        let mut bytes = glb(&document, &data);
        for _ in 0..=next(3) {
            let at = next(bytes.len());
            match next(5) {
                0 => bytes[at] = next(256) as u8,
                1 => bytes[at] ^= 1 << next(8),
                2 if next(8) == 0 => bytes.truncate(at),
                3 => {
                    // A digit of the JSON.
                    if let Some(d) = bytes[at..].iter().position(u8::is_ascii_digit) {
                        bytes[at + d] = b'0' + next(10) as u8;
                    }
                }
                _ => {
                    let at = at / 4 * 4;
                    if at + 4 <= bytes.len() {
                        bytes[at..at + 4].copy_from_slice(&words[next(8)].to_le_bytes());
                    }
                }
            }
            if bytes.is_empty() {
                break;
            }
        }
        match parse(Path::new("t.glb"), &bytes, None) {
            Ok(mesh) => {
                mesh.validate().unwrap();
                good += 1;
            }
            Err(_) => bad += 1,
        }
    }
    assert!(good > 100 && bad > 100, "{good} read, {bad} refused");
}

/// The files of `tests/broken` that are made from the quad.
fn broken_files() -> Vec<(&'static str, Vec<u8>)> {
    let (document, data) = quad(true);
    let whole = glb(&document, &data);
    let mut no_position = document.clone();
    no_position["meshes"][0]["primitives"][0]["attributes"]["POSITION"] = json!(99);
    let mut out_of_range = data.clone();
    out_of_range[192..194].copy_from_slice(&900u16.to_le_bytes());
    vec![
        ("no_position.glb", glb(&no_position, &data)),
        ("truncated.glb", whole[..whole.len() / 2].to_vec()),
        ("index_out_of_range.glb", glb(&document, &out_of_range)),
    ]
}

#[test]
fn what_has_no_texture_coordinates_is_told_beforehand_and_given_some() {
    let (mut document, data) = quad(true);
    let whole = about(&serde_json::to_vec(&document).unwrap()).unwrap();
    assert_eq!(whole, (2, true));
    let primitive = &mut document["meshes"][0]["primitives"][0];
    primitive["attributes"]
        .as_object_mut()
        .unwrap()
        .remove("TEXCOORD_0");
    let without = about(&serde_json::to_vec(&document).unwrap()).unwrap();
    assert_eq!(without, (2, false));
    let refused = read(&document, &data).unwrap_err().to_string();
    assert!(refused.contains("#box"), "{refused}");
    let bytes = glb(&document, &data);
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("quad.glb"), &bytes).unwrap();
    let mesh = crate::mesh::load(&folder.path().join("quad.glb#box")).unwrap();
    mesh.validate().unwrap();
    assert_eq!((mesh.triangles.len(), mesh.name.as_str()), (2, "quad"));
    assert_eq!(mesh.islands().mirrored, [false]);
    let told = crate::mesh::about(&folder.path().join("quad.glb#box")).unwrap();
    assert!(told.triangles == 2 && !told.has_uvs);
    // What is damaged is told as without a projection.
    for (name, bytes) in broken_files() {
        assert!(parse(Path::new(name), &bytes, Some(Projection::Box)).is_err());
    }
}

fn broken_folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/broken")
}

#[test]
fn the_broken_files_are_as_described_and_refused() {
    for (name, bytes) in broken_files() {
        let path = broken_folder().join(name);
        assert_eq!(
            std::fs::read(&path).unwrap(),
            bytes,
            "{name}; run the ignored test that writes it"
        );
    }
    for (name, says) in [
        (
            "no_position.glb",
            "POSITION names accessor 99, but the file has 5",
        ),
        ("truncated.glb", "bytes long, but only"),
        (
            "index_out_of_range.glb",
            "names vertex 900, but there are 4",
        ),
        (
            "index_out_of_range.obj",
            "line 9: the face names position (`v`) 900, but there are 3",
        ),
        ("no_uvs.obj", "has no texture coordinates"),
    ] {
        let error = crate::mesh::load(&broken_folder().join(name)).unwrap_err();
        let text = error.to_string();
        assert!(text.contains(says) && text.contains(name), "{text}");
        assert_eq!(error.exit_code(), 2);
    }
}

#[test]
#[ignore = "writes tests/broken/*.glb; run after changing the quad"]
fn write_broken_files() {
    for (name, bytes) in broken_files() {
        std::fs::write(broken_folder().join(name), bytes).unwrap();
    }
}

#[test]
fn a_mesh_that_stands_in_too_many_places_is_refused_before_it_is_read() {
    let (mut document, mut data) = quad(true);
    let (corners, start) = (66_000, data.len());
    data.resize(start + corners, 0);
    document["buffers"][0]["byteLength"] = json!(data.len());
    document["bufferViews"][4] = json!({ "buffer": 0, "byteOffset": start, "byteLength": corners });
    document["accessors"][4] =
        json!({ "bufferView": 4, "componentType": 5121, "count": corners, "type": "SCALAR" });
    let mut standing = |places: usize| {
        // What is wrong with the first place would be told if it were read.
        let mut nodes = vec![json!({ "mesh": 0, "scale": [1e30, 1, 1] })];
        nodes.resize(places, json!({ "mesh": 0 }));
        document["nodes"] = json!(nodes);
        document["scenes"][0]["nodes"] = json!((0..places).collect::<Vec<_>>());
        read(&document, &data).unwrap_err().to_string()
    };
    let e = standing(455);
    assert!(
        e.contains("more than 10000000") && e.contains("Decimate"),
        "{e}"
    );
    let e = standing(454);
    assert!(e.contains("takes a vertex"), "{e}");
}

#[test]
fn too_many_triangles_are_no_damage() {
    let corners = crate::mesh::MAX_TRIANGLES + 3;
    let (mut document, mut data) = quad(true);
    let start = data.len();
    data.resize(start + corners, 0);
    let push = |list: &mut Value, entry: Value| {
        let list = list.as_array_mut().unwrap();
        list.push(entry);
        list.len() - 1
    };
    document["buffers"][0]["byteLength"] = json!(data.len());
    let view = json!({ "buffer": 0, "byteOffset": start, "byteLength": corners });
    let view = push(&mut document["bufferViews"], view);
    let indices =
        json!({ "bufferView": view, "componentType": 5121, "count": corners, "type": "SCALAR" });
    let indices = push(&mut document["accessors"], indices);
    let primitive = &mut document["meshes"][0]["primitives"][0];
    primitive["indices"] = json!(indices);
    primitive["mode"] = json!(5);
    let e = read(&document, &data).unwrap_err().to_string();
    assert!(e.contains("triangles") && e.contains("Decimate"), "{e}");
    assert!(!e.contains("damaged"), "{e}");
}
