//! What every shape keeps, the pot's layout, OBJ files, and names.

use super::*;
use std::collections::{HashMap, HashSet};

fn shapes() -> Vec<Mesh> {
    BUILTIN_NAMES
        .iter()
        .map(|n| builtin(n).expect("a built-in shape"))
        .collect()
}

fn bits(p: Vec3) -> [u32; 3] {
    p.to_array().map(|x| (x + 0.0).to_bits())
}

/// Directed edges between positions that have no partner running the other way.
fn open_edges(mesh: &Mesh) -> Vec<(Vec3, Vec3)> {
    let mut edges = HashMap::new();
    for t in &mesh.triangles {
        let p = mesh.corners(*t);
        for k in 0..3 {
            let (a, b) = (p[k], p[(k + 1) % 3]);
            edges.insert((bits(a), bits(b)), (a, b));
        }
    }
    let mut open = Vec::new();
    for ((from, to), edge) in &edges {
        if !edges.contains_key(&(*to, *from)) {
            open.push(*edge);
        }
    }
    open
}

#[test]
fn shapes_are_valid_and_carry_their_names() {
    for (mesh, name) in shapes().iter().zip(BUILTIN_NAMES) {
        mesh.validate().expect(name);
        assert_eq!(mesh.name, name);
    }
    assert!(builtin("teapot").is_none());
}

#[test]
fn triangles_face_where_their_normals_point() {
    for mesh in shapes() {
        for t in &mesh.triangles {
            let [a, b, c] = mesh.corners(*t);
            let face = (b - a).cross(c - a);
            assert!(face.length() > 0.0, "{}: {t:?} has no area", mesh.name);
            for i in t {
                let cos = face.normalize().dot(mesh.normals[*i as usize]);
                assert!(cos > 0.95, "{}: {t:?} cos {cos}", mesh.name);
            }
        }
    }
}

/// Volume by the divergence theorem: positive only where the winding looks outward as a whole.
fn volume(mesh: &Mesh) -> f64 {
    let six: f64 = mesh
        .triangles
        .iter()
        .map(|t| {
            let [a, b, c] = mesh.corners(*t).map(|p| p.as_dvec3());
            a.dot(b.cross(c))
        })
        .sum();
    six / 6.0
}

#[test]
fn closed_shapes_are_closed_bit_for_bit_and_hold_their_volume() {
    let pi = std::f64::consts::PI;
    let torus_volume = 2.0 * pi * pi * 0.42f64.powi(2);
    for (name, expected) in [
        ("torus", torus_volume),
        ("sphere", 4.0 / 3.0 * pi),
        ("cylinder", 2.0 * pi),
    ] {
        let mesh = builtin(name).unwrap();
        assert_eq!(open_edges(&mesh), [], "{name}");
        let volume = volume(&mesh);
        assert!(
            (volume / expected - 1.0).abs() < 2e-3,
            "{name}: {volume} for {expected}"
        );
    }
}

#[test]
fn the_pot_is_closed_except_for_handle_ends_inside_its_wall() {
    let edges = open_edges(&pot());
    assert_eq!(edges.len(), 4 * 32, "two ends of two tubes");
    for (a, b) in edges {
        for p in [a, b] {
            let radius = p.x.hypot(p.z);
            assert!(
                radius > 1.0 - 0.025 && radius < 1.0,
                "{p} is {radius} from the axis"
            );
        }
    }
}

#[test]
fn tangents_are_the_surface_derivative_along_u() {
    for mesh in shapes() {
        for t in &mesh.triangles {
            let (du, dv) =
                derivatives(mesh.corners(*t), mesh.corner_uvs(*t)).expect("an area in UV");
            for i in t {
                let tangent = mesh.tangents[*i as usize];
                if tangent.truncate() == Vec3::ZERO {
                    continue;
                }
                let normal = mesh.normals[*i as usize];
                let cos = tangent.truncate().dot(du.normalize());
                // The last ring of the sphere's triangles is three degrees off between its corners.
                assert!(cos > 0.998, "{}: {t:?} cos {cos}", mesh.name);
                let bitangent = normal.cross(tangent.truncate()) * tangent.w;
                let up = bitangent.dot(dv.normalize());
                assert!(up > 0.95, "{}: {t:?} up {up}", mesh.name);
            }
        }
        assert_eq!(mesh.handedness_conflicts(), 0, "{}", mesh.name);
        assert!(mesh.islands().mirrored.iter().all(|m| !m), "{}", mesh.name);
    }
}

#[test]
fn only_poles_have_no_tangent() {
    for mesh in shapes() {
        let without = mesh
            .tangents
            .iter()
            .filter(|t| t.truncate() == Vec3::ZERO)
            .count();
        let expected = if mesh.name == "sphere" { 512 } else { 0 };
        assert_eq!(without, expected, "{}", mesh.name);
    }
}

#[test]
fn layouts_stay_in_the_unit_square_and_the_middle_faces_the_viewer() {
    for mesh in shapes() {
        let unit = |uv: &Vec2| uv.cmpge(Vec2::ZERO).all() && uv.cmple(Vec2::ONE).all();
        assert!(mesh.uvs.iter().all(unit), "{}", mesh.name);
        let (centre, radius) = mesh.bounding_sphere();
        assert!(
            centre.length() < 1e-3 && (0.9..2.0).contains(&radius),
            "{}: {centre} {radius}",
            mesh.name
        );
    }
    for mesh in [torus(), cylinder(), sphere(), pot()] {
        let front = mesh
            .positions
            .iter()
            .zip(&mesh.uvs)
            .max_by(|a, b| a.0.z.total_cmp(&b.0.z));
        assert!((front.unwrap().1.x - 0.5).abs() < 1e-6, "{}", mesh.name);
    }
}

#[test]
fn aspects_agree_with_the_layout() {
    for mut mesh in [plane(), disc(), torus()] {
        let stated = mesh.aspect;
        mesh.measure_aspect();
        // The torus states its middle circle; its area lies a little further out.
        let allowed = if mesh.name == "torus" { 0.06 } else { 1e-3 };
        assert!(
            (mesh.aspect / stated - 1.0).abs() < allowed,
            "{}: {} {stated}",
            mesh.name,
            mesh.aspect
        );
    }
}

fn island_of(uv: Vec2) -> usize {
    let grown = |island: &pot::Island| pot::Island {
        min: island.min - 1e-5,
        max: island.max + 1e-5,
    };
    let inside: Vec<usize> = (0..pot::ISLANDS.len())
        .filter(|i| grown(&pot::ISLANDS[*i].1).contains(uv))
        .collect();
    assert_eq!(inside.len(), 1, "{uv} lies in {inside:?}");
    inside[0]
}

#[test]
fn the_pots_islands_lie_apart_and_hold_its_triangles() {
    let gap = Vec2::new(0.011, 0.0135);
    for (i, (a_name, a)) in pot::ISLANDS.iter().enumerate() {
        for (b_name, b) in &pot::ISLANDS[i + 1..] {
            let apart = (a.min - b.max).cmpgt(gap) | (b.min - a.max).cmpgt(gap);
            assert!(apart.any(), "{a_name} and {b_name}");
        }
    }
    let pot = pot();
    let islands = pot.islands();
    assert_eq!(islands.mirrored.len(), pot::ISLANDS.len());
    let mut extents = [(Vec2::ONE, Vec2::ZERO); 7];
    for (t, id) in pot.triangles.iter().zip(&islands.of_triangle) {
        for uv in pot.corner_uvs(*t) {
            assert_eq!(
                island_of(uv),
                *id as usize,
                "the islands come in the order of the list"
            );
            let (low, high) = &mut extents[*id as usize];
            (*low, *high) = (low.min(uv), high.max(uv));
        }
    }
    for ((low, high), (name, island)) in extents.iter().zip(pot::ISLANDS) {
        assert!(
            low.abs_diff_eq(island.min, 1e-5),
            "{name}: {low} {island:?}"
        );
        assert!(
            high.abs_diff_eq(island.max, 1e-5),
            "{name}: {high} {island:?}"
        );
    }
}

#[test]
fn the_pots_documented_numbers_are_its_numbers() {
    let rounded = |v: Vec2| v.to_array().map(|x| format!("{x:.4}"));
    let text = include_str!("pot.rs");
    for (name, island) in pot::ISLANDS {
        let [u0, v0] = rounded(island.min);
        let [u1, v1] = rounded(island.max);
        let u = if u1 == "1.0000" {
            "0 to 1".to_owned()
        } else {
            format!("{u0} to {u1}")
        };
        let row = format!("//! | [`{}`] | {u} | {v0} to {v1} |", name.to_uppercase());
        assert!(text.contains(&row), "{row}");
    }
}

#[test]
fn a_texel_of_the_pot_is_square_on_the_surface() {
    let pot = pot();
    for t in &pot.triangles {
        let uv = pot.corner_uvs(*t);
        let (du, dv) = derivatives(pot.corners(*t), uv).unwrap();
        let name = pot::ISLANDS[island_of(uv[0])].0;
        // Rounded edges narrow toward their discs, the lip widens: there U cannot keep its scale.
        let wall = pot
            .corners(*t)
            .iter()
            .all(|p| (p.x.hypot(p.z) - 1.0).abs() < 1e-4);
        let strict = match name {
            "bottom" | "floor" => true,
            "body" => wall,
            _ => false,
        };
        // The handles' bends are a third shorter inside than in the middle, a third longer outside.
        let bend = name.starts_with("handle");
        let ratio = du.length() / dv.length() / pot::ASPECT;
        let allowed = if strict {
            2e-3
        } else if bend {
            0.34
        } else {
            0.2
        };
        assert!((ratio - 1.0).abs() < allowed, "{name}: {ratio}");
    }
}

#[test]
fn the_wall_is_nearly_the_whole_height_of_the_pot() {
    let (low, high) = pot()
        .positions
        .iter()
        .fold((f32::MAX, f32::MIN), |(low, high), p| {
            (low.min(p.y), high.max(p.y))
        });
    assert!((high - low - pot::HEIGHT).abs() < 1e-5);
    assert!(pot::WALL_HEIGHT / (high - low) >= 0.95);
}

#[test]
fn islands_split_at_seams_and_mirrors_but_not_at_normals() {
    // Two quads side by side, the second one folded back over the first in UV.
    let mut mesh = plane();
    for (p, uv) in [([3.0, -1.0], [0.0, 0.0]), ([3.0, 1.0], [0.0, 1.0])] {
        mesh.push_vertex(grid::Vertex {
            position: Vec3::new(p[0], p[1], 0.0),
            normal: Vec3::Z,
            tangent: Vec3::NEG_X,
            uv: uv.into(),
        });
    }
    mesh.triangles.extend([[1, 4, 5], [1, 5, 3]]);
    let islands = mesh.islands();
    assert_eq!(islands.of_triangle, [0, 0, 1, 1]);
    assert_eq!(islands.mirrored, [false, true]);
    assert_eq!(
        mesh.handedness_conflicts(),
        2,
        "w is +1 on the mirrored half"
    );

    let mut creased = cylinder();
    creased.normals[0] = Vec3::Y;
    assert_eq!(creased.islands().mirrored.len(), 3, "side and two ends");
    let distinct: HashSet<u32> = creased.islands().of_triangle.into_iter().collect();
    assert_eq!(distinct.len(), 3);
}

#[test]
fn validate_names_what_is_wrong() {
    let mut mesh = plane();
    mesh.normals[2] = Vec3::ZERO;
    let text = mesh.validate().unwrap_err().to_string();
    assert!(text.contains("normal 2 of mesh plane"), "{text}");
    let mut mesh = plane();
    mesh.triangles[1][0] = 4;
    let text = mesh.validate().unwrap_err().to_string();
    assert!(
        text.contains("triangle 1") && text.contains("0 to 3"),
        "{text}"
    );
    let mut mesh = plane();
    mesh.tangents[0].z = 0.1;
    assert!(mesh.validate().is_err());
    let mut mesh = plane();
    mesh.uvs.pop();
    assert!(mesh.validate().is_err());
}

#[test]
fn words_are_shapes_or_paths() {
    assert_eq!(open("pot").unwrap().name, "pot");
    let text = open("tours").unwrap_err().to_string();
    assert!(text.contains("`torus`?"), "{text}");
    assert!(matches!(open("./pot"), Err(Error::File { .. })));
    assert!(matches!(
        open("nowhere/missing.glb"),
        Err(Error::Read { .. })
    ));
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("folder.obj");
    std::fs::create_dir(&path).unwrap();
    let text = load(&path).unwrap_err().to_string();
    assert!(text.contains("is a folder"), "{text}");
}

const QUAD_OBJ: &str = "o quad\nv 0 0 0\nv 2 0 0\nv 2 1 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\nf 1/1 2/2 3/3 4/4\n";

fn obj(text: &str) -> Result<Mesh> {
    obj::parse(Path::new("test.obj"), text.as_bytes(), None)
}

#[test]
fn an_obj_keeps_v_and_gets_normals_tangents_and_an_aspect() {
    let mesh = obj(QUAD_OBJ).unwrap();
    mesh.validate().unwrap();
    assert_eq!(mesh.triangles.len(), 2);
    assert_eq!(mesh.aspect, 2.0);
    for i in 0..4 {
        assert_eq!(mesh.normals[i], Vec3::Z);
        assert_eq!(mesh.tangents[i], Vec4::new(1.0, 0.0, 0.0, 1.0));
        assert_eq!(
            mesh.uvs[i],
            mesh.positions[i].truncate() / Vec2::new(2.0, 1.0)
        );
    }
}

#[test]
fn an_obj_mirrored_in_u_has_w_minus_one_and_a_tangent_along_u() {
    let mirrored = QUAD_OBJ.replace(
        "vt 0 0\nvt 1 0\nvt 1 1\nvt 0 1",
        "vt 1 0\nvt 0 0\nvt 0 1\nvt 1 1",
    );
    let mesh = obj(&mirrored).unwrap();
    assert!(
        mesh.tangents
            .iter()
            .all(|t| *t == Vec4::new(-1.0, 0.0, 0.0, -1.0))
    );
    assert_eq!(mesh.islands().mirrored, [true]);
    assert_eq!(mesh.handedness_conflicts(), 0);
}

#[test]
fn smooth_normals_cross_uv_seams() {
    // Two faces of a roof; the ridge is doubled in UV only.
    let roof = "v -1 0 0\nv 0 .5 0\nv 0 .5 2\nv -1 0 2\nv 1 0 0\nv 1 0 2\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\n\
                f 1/1 4/2 3/3 2/4\nf 2/1 3/2 6/3 5/4\n";
    let mesh = obj(roof).unwrap();
    let ridge: Vec<Vec3> = (0..mesh.positions.len())
        .filter(|i| mesh.positions[*i].y == 0.5)
        .map(|i| mesh.normals[i])
        .collect();
    assert_eq!(ridge.len(), 4);
    assert!(
        ridge.iter().all(|n| n.abs_diff_eq(Vec3::Y, 1e-6)),
        "{ridge:?}"
    );
}

#[test]
fn edges_that_turn_by_more_than_60_degrees_are_sharp_without_normals() {
    // The corners of a cube by their bits, shared by all faces; one place of the layout is enough.
    let corner = |i: u32| format!("v {} {} {}\n", i & 1, i >> 1 & 1, i >> 2 & 1);
    let faces = [
        "1 3 4 2", "5 6 8 7", "1 2 6 5", "3 7 8 4", "1 5 7 3", "2 4 8 6",
    ];
    let face = |f: &str| {
        let corners = f.split(' ').zip(1..).map(|(v, t)| format!(" {v}/{t}"));
        format!("f{}\n", corners.collect::<String>())
    };
    let mut text: String = (0..8).map(corner).collect();
    text += "vt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\n";
    text += &faces.map(face).concat();
    let cube = obj(&text).unwrap();
    for triangle in &cube.triangles {
        let [a, b, c] = cube.corners(*triangle);
        let flat = (b - a).cross(c - a).normalize();
        for i in triangle {
            assert!(cube.normals[*i as usize].abs_diff_eq(flat, 1e-6));
        }
    }
    // A sphere stays smooth, and takes no vertex more.
    let sphere = builtin("sphere").unwrap();
    let mut text = String::new();
    for (p, uv) in sphere.positions.iter().zip(&sphere.uvs) {
        text += &format!("v {} {} {}\nvt {} {}\n", p.x, p.y, p.z, uv.x, uv.y);
    }
    for t in &sphere.triangles {
        let [a, b, c] = t.map(|i| i + 1);
        text += &format!("f {a}/{a} {b}/{b} {c}/{c}\n");
    }
    let read = obj(&text).unwrap();
    assert!(read.positions.len() <= sphere.positions.len());
    let off = |i: usize| {
        read.normals[i]
            .angle_between(read.positions[i])
            .to_degrees()
    };
    let worst = (0..read.positions.len()).map(off).fold(0.0, f32::max);
    assert!(worst < 1.0, "{worst}");
}

#[test]
fn triangles_flat_in_uv_have_no_tangent_and_flat_triangles_are_left_out() {
    let text = format!("{QUAD_OBJ}v 5 0 0\nv 6 0 0\nv 6 1 0\nf 5/1 6/1 7/1\nf 1/1 1/1 2/2\n");
    let mesh = obj(&text).unwrap();
    assert_eq!(mesh.triangles.len(), 3);
    for i in mesh.triangles[2] {
        assert_eq!(mesh.tangents[i as usize].truncate(), Vec3::ZERO);
    }
    mesh.validate().unwrap();
}

#[test]
fn an_obj_without_uvs_is_told_so() {
    let all = obj("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
        .unwrap_err()
        .to_string();
    assert!(
        all.contains("has no texture coordinates") && all.contains("Unwrap"),
        "{all}"
    );
    assert!(all.contains("line 4"), "{all}");
    let some = obj(&format!("{QUAD_OBJ}f 1 2 3\n"))
        .unwrap_err()
        .to_string();
    assert!(
        some.contains("line 11") && some.contains("no texture"),
        "{some}"
    );
}

#[test]
fn an_obj_says_which_line_is_wrong() {
    for (line, says) in [
        ("v 0 1,5 0", "line 11: `v`: `1,5` is no finite number"),
        ("v 0 1", "line 11: `v` needs 3 numbers"),
        ("vn nan 0 0", "line 11: `vn`: `nan` is no finite number"),
        ("f 1/1 2/2", "line 11: a face of 2 corners"),
        (
            "f 1/1 2/2 5/3",
            "line 11: the face names position (`v`) 5, but there are 4 so far",
        ),
        (
            "f 1/1 2/2 3/-5",
            "line 11: the face names texture coordinates (`vt`) -5, but there are 4",
        ),
        (
            "f 1/1/1 2/2/1 3/3/1",
            "line 11: the face names normal (`vn`) 1, but there are 0",
        ),
        ("f 1/1 2/2 0/1", "position (`v`) 0"),
        ("f 1/1 2/2 99999999999999999999/1", "is no whole number"),
        ("f /1 2/2 3/3", "names no position"),
    ] {
        let text = obj(&format!("{QUAD_OBJ}{line}\n")).unwrap_err().to_string();
        assert!(text.contains(says), "{line}: {text}");
    }
    assert!(obj("hello").unwrap_err().to_string().contains("no faces"));
}

#[test]
fn an_obj_may_count_backward_continue_lines_and_bring_normals() {
    let text = QUAD_OBJ.replace(
        "f 1/1 2/2 3/3 4/4",
        "vn 0 0 2 # long\r\nf 1/1/1 2/2/1 \\\r\n -2/-2/-1 -1/-1/-1",
    );
    assert_eq!(obj(&text).unwrap(), obj(QUAD_OBJ).unwrap());
}

#[test]
fn a_point_with_too_many_triangles_is_refused_instead_of_overflowing_the_stack() {
    let mut text = "v 0 0 1\nvt 0 0\n".to_owned();
    let count = 5000;
    for i in 0..count {
        let (sin, cos) = (i as f32 * std::f32::consts::TAU / count as f32).sin_cos();
        text += &format!("v {cos} {sin} 0\nvt {cos} {sin}\n");
    }
    for i in 0..count {
        let (a, b) = (i + 2, (i + 1) % count + 2);
        text += &format!("f 1/1 {a}/{a} {b}/{b}\n");
    }
    let text = obj(&text).unwrap_err().to_string();
    assert!(text.contains("4096 triangles meet"), "{text}");
}

#[test]
fn made_tangents_agree_with_the_analytic_ones() {
    for analytic in [torus(), pot()] {
        let mut made = Mesh {
            tangents: Vec::new(),
            ..analytic.clone()
        };
        tangents::generate(&mut made).unwrap();
        for (a, m) in analytic.triangles.iter().zip(&made.triangles) {
            for (a, m) in a.iter().zip(m) {
                let (a, m) = (analytic.tangents[*a as usize], made.tangents[*m as usize]);
                assert_eq!(a.w, m.w);
                assert!(
                    a.truncate().dot(m.truncate()) > 0.9998,
                    "{}: {a} {m}",
                    analytic.name
                );
            }
        }
    }
}

/// A stream of numbers that is the same in every run.
pub(super) fn numbers(mut state: u64) -> impl FnMut(usize) -> usize {
    move |below| {
        state = state
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        (state >> 33) as usize % below
    }
}

#[test]
fn damaged_objs_never_panic() {
    let seed =
        format!("mtllib a.mtl\n{QUAD_OBJ}vn 0 0 1\nf 1/1/1 -1/2/1 3/3/1\ng b\nf 1/1 3/3 2/2\n");
    let words = [
        "-1",
        "0",
        "1e39",
        "nan",
        "/",
        "//",
        "99999999999",
        "f",
        "v",
        "\n",
        "\u{e9}",
        " ",
        "l 1 2\n",
        "p 1\n",
    ];
    let mut next = numbers(7);
    let (mut good, mut bad) = (0, 0);
    for _ in 0..2000 {
        let mut bytes = seed.clone().into_bytes();
        for _ in 0..=next(3) {
            let at = next(bytes.len());
            match next(4) {
                0 => bytes[at] = next(256) as u8,
                1 => bytes.truncate(at.max(1)),
                2 => {
                    bytes.remove(at);
                    bytes.push(b'\n');
                }
                _ => {
                    bytes.splice(at..at, words[next(words.len())].bytes());
                }
            }
        }
        match obj::parse(Path::new("test.obj"), &bytes, None) {
            Ok(mesh) => {
                mesh.validate().unwrap();
                good += 1;
            }
            Err(_) => bad += 1,
        }
    }
    assert!(good > 100 && bad > 100, "{good} read, {bad} refused");
}

#[test]
fn what_an_obj_says_of_itself_is_counted_over_continued_lines() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.obj");
    let say = |faces: &str| {
        std::fs::write(&path, faces).unwrap();
        let About { triangles, has_uvs } = about(&path).unwrap();
        (triangles, has_uvs)
    };
    assert_eq!(
        say("f 1/1 2/2 \\\r\n 3/3\nf 1/1 2/2 3/3 4/4 # \\ in a remark\n"),
        (3, true)
    );
    assert_eq!(say("f 1/1 2/2 3/3\nf 1 2 3\n"), (2, false));
    assert_eq!(say("vn 0 0 1\n"), (0, true));
}
