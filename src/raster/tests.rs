use super::*;
use crate::error::Error;
use crate::map::Size;
use crate::mesh::Mesh;
use glam::{DVec3, Vec2, Vec3, Vec4};
use proptest::prelude::*;
use std::collections::{HashMap, HashSet};
use std::f32::consts::TAU;

/// A grid of quads over (u, v) in [0, 1]², positions, normals and tangents from `at`.
fn surface(nu: u32, nv: u32, at: impl Fn(f32, f32) -> (Vec3, Vec3, Vec3)) -> Mesh {
    let mut mesh = Mesh {
        name: "test".into(),
        positions: vec![],
        normals: vec![],
        tangents: vec![],
        uvs: vec![],
        triangles: vec![],
        aspect: 1.0,
    };
    for j in 0..=nv {
        for i in 0..=nu {
            let (u, v) = (i as f32 / nu as f32, j as f32 / nv as f32);
            let (p, n, t) = at(u, v);
            mesh.positions.push(p);
            mesh.normals.push(n);
            mesh.tangents.push(t.extend(1.0));
            mesh.uvs.push(Vec2::new(u, v));
        }
    }
    let row = nu + 1;
    for j in 0..nv {
        for i in 0..nu {
            let a = j * row + i;
            mesh.triangles.push([a, a + 1, a + row + 1]);
            mesh.triangles.push([a, a + row + 1, a + row]);
        }
    }
    mesh
}

fn torus(nu: u32, nv: u32) -> Mesh {
    surface(nu, nv, |u, v| {
        let (su, cu) = (u * TAU).sin_cos();
        let (sv, cv) = (v * TAU).sin_cos();
        let n = Vec3::new(cv * su, sv, cv * cu);
        let p = Vec3::new(su, 0.0, cu) + n * 0.4;
        (p, n, Vec3::new(cu, 0.0, -su))
    })
}

fn sphere(nu: u32, nv: u32) -> Mesh {
    surface(nu, nv, |u, v| {
        let (su, cu) = (u * TAU).sin_cos();
        let (sv, cv) = ((v - 0.5) * TAU / 2.0).sin_cos();
        let n = Vec3::new(cv * su, sv, cv * cu);
        (n, n, Vec3::new(cu, 0.0, -su))
    })
}

fn one_triangle(corners: [Vec3; 3]) -> Mesh {
    let n = (corners[1] - corners[0])
        .cross(corners[2] - corners[0])
        .normalize_or(Vec3::Z);
    Mesh {
        name: "triangle".into(),
        positions: corners.to_vec(),
        normals: vec![n; 3],
        tangents: vec![Vec4::X; 3],
        uvs: vec![Vec2::ZERO, Vec2::X, Vec2::Y],
        triangles: vec![[0, 1, 2]],
        aspect: 1.0,
    }
}

fn camera(eye: Vec3) -> Camera {
    Camera {
        eye,
        target: Vec3::ZERO,
        up: Vec3::Y,
        projection: Projection::Perspective { fov: 35.0 },
    }
}

fn draw(mesh: &Mesh, camera: &Camera, width: u32, height: u32) -> (View, GBuffer) {
    let view = View::new(camera, Size::new(width, height).unwrap()).unwrap();
    let geometry = Geometry::new(mesh).unwrap();
    let window = view.size().rect();
    let buffer = GBuffer::draw(&geometry, &view, window, Cull::None, &Progress::none()).unwrap();
    (view, buffer)
}

/// Every fragment with its column and row.
fn each(mesh: &Mesh, buffer: &GBuffer, mut visit: impl FnMut(u32, u32, &Fragments, usize)) {
    let geometry = Geometry::new(mesh).unwrap();
    let mut fragments = Fragments::new();
    for tile in buffer.tiles() {
        tile.resolve(&geometry, buffer.corners(), true, &mut fragments);
        assert_eq!(tile.covered(), fragments.len());
        let places = fragments.columns().iter().zip(fragments.rows());
        let mut before = HashSet::new();
        for (i, (x, y)) in places.enumerate() {
            assert!(before.insert((x, y)), "each sample once");
            let place = (tile.rect.x + u32::from(*x), tile.rect.y + u32::from(*y));
            assert_eq!(place, fragments.place(i));
            visit(place.0, place.1, &fragments, i);
        }
    }
}

/// Distance along the ray to the nearest point where `field`, a distance bound, is zero.
fn march(eye: Vec3, ray: Vec3, field: impl Fn(DVec3) -> f64) -> Option<f64> {
    let (eye, ray) = (eye.as_dvec3(), ray.as_dvec3());
    let mut t = 0.0;
    for _ in 0..2000 {
        let d = field(eye + ray * t);
        if d < 1e-9 {
            return Some(t);
        }
        t += d;
        if t > 100.0 {
            return None;
        }
    }
    None
}

fn torus_field(p: DVec3) -> f64 {
    let ring = (p.x * p.x + p.z * p.z).sqrt() - 1.0;
    (ring * ring + p.y * p.y).sqrt() - 0.4
}

struct Reference {
    field: fn(DVec3) -> f64,
    normal: fn(Vec3) -> Vec3,
}

/// Largest errors of position, normal (radians) and tangent (radians) where a ray meets the true surface, and how many
/// samples one sees and the other does not.
fn against_rays(mesh: &Mesh, reference: &Reference) -> (f32, f32, f32, u32) {
    let (width, height) = (200, 150);
    let (view, buffer) = draw(mesh, &camera(Vec3::new(0.7, 2.4, 3.6)), width, height);
    let mut seen = vec![None; (width * height) as usize];
    each(mesh, &buffer, |x, y, f, i| {
        seen[(y * width + x) as usize] =
            Some((f.position(i), f.normal(i), f.tangent(i), f.facing(i)));
    });
    let (mut dp, mut dn, mut dt, mut misses) = (0f32, 0f32, 0f32, 0);
    for y in 0..height {
        for x in 0..width {
            let (eye, ray) = view.ray(x, y);
            let hit = march(eye, ray, reference.field);
            let seen = seen[(y * width + x) as usize];
            let (Some(t), Some((p, n, tangent, facing))) = (hit, seen) else {
                misses += u32::from(hit.is_some() != seen.is_some());
                continue;
            };
            let want_p = eye + ray * t as f32;
            let want_n = (reference.normal)(want_p);
            // Edge-on, a hair of the surface is a mile of depth.
            if want_n.dot(ray) > -0.15 {
                continue;
            }
            assert_eq!(facing, 1.0);
            dp = dp.max(p.distance(want_p));
            dn = dn.max(n.angle_between(want_n));
            let want_t = Vec3::new(want_p.z, 0.0, -want_p.x);
            if want_t.length() > 0.2 {
                dt = dt.max(tangent.truncate().angle_between(want_t));
            }
        }
    }
    (dp, dn, dt, misses)
}

#[test]
fn a_ray_cast_torus_agrees() {
    let reference = Reference {
        field: torus_field,
        normal: |p| {
            let ring = Vec3::new(p.x, 0.0, p.z).normalize();
            (p - ring).normalize()
        },
    };
    // The chord of 1/192 and 1/96 turn lies 1.4 (1 - cos(pi/192)) + 0.4 (1 - cos(pi/96)) = 4.0e-4 below the surface at
    // most; seen at a slant of asin 0.15 that is 2.7e-3 along the ray, and 2.7e-3 / 0.4 rad of turned normal.
    let (dp, dn, dt, misses) = against_rays(&torus(192, 96), &reference);
    assert!(dp < 2.7e-3, "position {dp}");
    assert!(dn < 7e-3, "normal {dn}");
    assert!(dt < 3e-3, "tangent {dt}");
    assert!(misses < 40, "{misses} samples on the outline differ");
}

#[test]
fn a_ray_cast_sphere_agrees() {
    let reference = Reference {
        field: |p| p.length() - 1.0,
        normal: |p| p.normalize(),
    };
    let (dp, dn, dt, misses) = against_rays(&sphere(192, 96), &reference);
    assert!(dp < 4.5e-3, "position {dp}");
    assert!(dn < 4.5e-3, "normal {dn}");
    assert!(dt < 5e-3, "tangent {dt}");
    assert!(misses < 30, "{misses} samples on the outline differ");
}

#[test]
fn derivatives_are_the_differences_between_neighbours() {
    // One triangle: uv is the same function over all of it, so the middle of three neighbours has the slope between them.
    let mesh = one_triangle([
        Vec3::new(-2.0, -1.0, 1.5),
        Vec3::new(2.5, -1.2, 0.0),
        Vec3::new(-0.3, 2.0, -4.0),
    ]);
    let (_, buffer) = draw(&mesh, &camera(Vec3::new(0.3, 0.4, 5.0)), 300, 300);
    let mut uv = vec![None; 300 * 300];
    each(&mesh, &buffer, |x, y, f, i| {
        uv[(y * 300 + x) as usize] = {
            let [dx, dy] = f.uv_change(i);
            Some((f.uv(i), dx, dy))
        };
    });
    let mut compared = 0;
    for y in 1..299 {
        for x in 1..299 {
            let at = |x: usize, y: usize| uv[y * 300 + x];
            let (Some(c), Some(l), Some(r), Some(t), Some(b)) = (
                at(x, y),
                at(x - 1, y),
                at(x + 1, y),
                at(x, y - 1),
                at(x, y + 1),
            ) else {
                continue;
            };
            assert!(((r.0 - l.0) * 0.5 - c.1).length() < 2e-5);
            assert!(((b.0 - t.0) * 0.5 - c.2).length() < 2e-5);
            compared += 1;
        }
    }
    assert!(compared > 5000, "{compared}");
}

#[test]
fn normals_change_as_their_derivatives_say() {
    let mesh = sphere(96, 48);
    let (_, buffer) = draw(&mesh, &camera(Vec3::new(0.0, 0.0, 4.0)), 201, 201);
    let mut visited = 0;
    each(&mesh, &buffer, |x, y, f, i| {
        if (x, y) == (100, 100) {
            visited += 1;
            // Seen head on, a step of one sample on the unit sphere turns the normal by its own length; the facet makes
            // it a chord.
            let step = 2.0 * 3.0 * 17.5f32.to_radians().tan() / 201.0;
            assert!((f.normal_change(i)[0] - Vec3::X * step).length() < 0.03 * step);
            assert!((f.normal_change(i)[1] + Vec3::Y * step).length() < 0.03 * step);
        }
    });
    assert_eq!(visited, 1);
}

#[test]
fn any_window_and_any_number_of_threads_give_the_same_samples() {
    let mesh = torus(64, 32);
    let view = View::new(
        &camera(Vec3::new(0.0, 2.0, 3.0)),
        Size::new(160, 120).unwrap(),
    )
    .unwrap();
    let run = |threads: usize, window: Rect| {
        rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .unwrap()
            .install(|| {
                let geometry = Geometry::new(&mesh).unwrap();
                GBuffer::draw(&geometry, &view, window, Cull::None, &Progress::none())
            })
            .unwrap()
    };
    let whole = view.size().rect();
    let one = run(1, whole);
    assert!(one.tiles() == run(2, whole).tiles());
    assert!(one.tiles() == run(5, whole).tiles());
    let window = Rect {
        x: 48,
        y: 48,
        width: 70,
        height: 60,
    };
    let mut expected = std::collections::BTreeMap::new();
    each(&mesh, &one, |x, y, f, i| {
        if window
            .intersection(Rect {
                x,
                y,
                width: 1,
                height: 1,
            })
            .is_some()
        {
            expected.insert((x, y), (f.normal(i), f.position(i), f.uv(i)));
        }
    });
    let mut found = std::collections::BTreeMap::new();
    each(&mesh, &run(2, window), |x, y, f, i| {
        found.insert((x, y), (f.normal(i), f.position(i), f.uv(i)));
    });
    assert!(expected.len() > 500 && expected == found);
}

#[test]
fn culling_back_faces_changes_nothing_on_a_closed_surface() {
    let mesh = torus(64, 32);
    let (view, all) = draw(&mesh, &camera(Vec3::new(0.0, 2.0, 3.0)), 120, 90);
    let culled = |mesh: &Mesh| {
        let window = view.size().rect();
        let geometry = Geometry::new(mesh).unwrap();
        GBuffer::draw(&geometry, &view, window, Cull::Back, &Progress::none()).unwrap()
    };
    assert!(all.tiles() == culled(&mesh).tiles());
    // Turned inside out it shows its far sides, whose normals point away.
    let mut inverted = mesh.clone();
    inverted.triangles.iter_mut().for_each(|t| t.swap(1, 2));
    let (mut far, mut near) = (0, 0);
    each(&inverted, &culled(&inverted), |_, _, f, i| {
        assert_eq!(f.facing(i), -1.0, "the normals decide, not the winding");
        far += 1;
    });
    each(&mesh, &all, |_, _, f, i| {
        assert_eq!(f.facing(i), 1.0);
        near += 1;
    });
    // Both cover the same samples but for those on the outline.
    assert!(near > 1000 && far > near * 95 / 100, "{far} of {near}");
}

#[test]
fn an_open_surface_knows_which_side_is_seen() {
    let mesh = one_triangle([Vec3::NEG_X, Vec3::X, Vec3::Y]);
    for (z, facing) in [(5.0, 1.0), (-5.0, -1.0)] {
        let (_, buffer) = draw(&mesh, &camera(Vec3::new(0.0, 0.5, z)), 50, 50);
        let mut count = 0;
        each(&mesh, &buffer, |_, _, f, i| {
            assert_eq!(f.facing(i), facing);
            count += 1;
        });
        assert!(count > 100);
    }
}

/// An orthographic camera under which world (x, y) is sample (x, size - y).
fn flat(size: u32) -> Camera {
    let middle = size as f32 / 2.0;
    Camera {
        eye: Vec3::new(middle, middle, 10.0),
        target: Vec3::new(middle, middle, 0.0),
        up: Vec3::Y,
        projection: Projection::Orthographic {
            extent: size as f32,
        },
    }
}

/// How many triangles own each sample, each drawn alone.
fn owners(points: &[Vec2], triangles: &[[u32; 3]], size: u32) -> Vec<u32> {
    let mut count = vec![0; (size * size) as usize];
    for t in triangles {
        let mesh = one_triangle(t.map(|i| points[i as usize].extend(0.0)));
        let (_, buffer) = draw(&mesh, &flat(size), size, size);
        each(&mesh, &buffer, |x, y, _, _| {
            count[(y * size + x) as usize] += 1;
        });
    }
    count
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]

    #[test]
    fn triangles_that_share_edges_own_each_sample_once(
        jitter in prop::collection::vec((-0.3f32..0.3, -0.3f32..0.3), 36),
        snap in prop::bool::ANY,
        inner in prop::collection::vec((0usize..50, 0.05f32..0.9, 0.05f32..0.9), 0..12),
    ) {
        // A jittered grid that reaches past the picture, some triangles split again at a point inside; snapped to half
        // samples, corners and edges fall exactly on sample centres.
        let n = 6;
        let mut points: Vec<Vec2> = (0..n * n)
            .map(|k| {
                let (i, j) = ((k % n) as f32, (k / n) as f32);
                let p = Vec2::new(i + jitter[k].0, j + jitter[k].1) * 8.0 - 4.0;
                if snap { (p * 2.0).round() / 2.0 } else { p }
            })
            .collect();
        let mut triangles = vec![];
        for j in 0..n - 1 {
            for i in 0..n - 1 {
                let a = (j * n + i) as u32;
                triangles.push([a, a + 1, a + 7]);
                triangles.push([a, a + 7, a + 6]);
            }
        }
        for (k, s, t) in inner {
            let [a, b, c] = triangles[k % triangles.len()];
            let (s, t) = if s + t > 0.95 { (0.5 * s, 0.5 * t) } else { (s, t) };
            let [pa, pb, pc] = [a, b, c].map(|i| points[i as usize]);
            let m = points.len() as u32;
            points.push(pa + (pb - pa) * s + (pc - pa) * t);
            let k = k % triangles.len();
            triangles[k] = [a, b, m];
            triangles.push([b, c, m]);
            triangles.push([c, a, m]);
        }
        let count = owners(&points, &triangles, 32);
        // The grid's rim is jittered by up to 2.4 samples around -4 and 36: the picture lies inside.
        prop_assert!(count.iter().all(|&c| c == 1), "{count:?}");
    }

    #[test]
    fn triangles_through_the_eye_plane_are_what_rays_meet(
        c in prop::collection::vec((-4.0f32..4.0, -4.0f32..4.0, -6.0f32..12.0), 3),
    ) {
        let corners = [0, 1, 2].map(|i| Vec3::new(c[i].0, c[i].1, c[i].2));
        let mesh = one_triangle(corners);
        let (view, buffer) = draw(&mesh, &camera(Vec3::new(0.0, 0.0, 5.0)), 48, 48);
        let mut seen = vec![None; 48 * 48];
        each(&mesh, &buffer, |x, y, f, i| seen[(y * 48 + x) as usize] = Some(f.position(i)));
        let [a, b, c] = corners.map(|p| p.as_dvec3());
        let normal = (b - a).cross(c - a);
        for y in 0..48 {
            for x in 0..48 {
                let (eye, ray) = view.ray(x, y);
                let (eye, ray) = (eye.as_dvec3(), ray.as_dvec3());
                let slant = normal.normalize().dot(ray).abs();
                if slant < 0.02 {
                    continue;
                }
                let t = normal.dot(a - eye) / normal.dot(ray);
                let p = eye + ray * t;
                // Distance of the ray's point from the nearest edge, in samples.
                let inside = [(a, b), (b, c), (c, a)]
                    .map(|(s, e)| normal.normalize().cross((e - s).normalize()).dot(p - s))
                    .into_iter()
                    .fold(f64::INFINITY, f64::min);
                let sample = t.abs() * 2.0 * 0.315 / 48.0 / slant;
                if inside.abs() < 0.05 * sample || t.abs() < 0.01 {
                    continue;
                }
                let hit = inside > 0.0 && t > 0.0;
                let seen = seen[(y * 48 + x) as usize];
                prop_assert_eq!(seen.is_some(), hit, "sample {} {}, {} from the edge", x, y, inside);
                if let Some(q) = seen {
                    prop_assert!(q.as_dvec3().distance(p) < 1e-4 * (1.0 + t) / slant, "{q} {p}");
                }
            }
        }
    }

    #[test]
    fn no_triangle_is_too_strange(
        c in prop::collection::vec(proptest::num::f32::ANY, 9),
        mild in prop::bool::ANY,
    ) {
        let scale = |v: f32| if mild { v % 10.0 } else { v };
        let corners = [0, 3, 6].map(|i| Vec3::new(scale(c[i]), scale(c[i + 1]), scale(c[i + 2])));
        for eye in [Vec3::new(0.0, 0.0, 5.0), Vec3::new(1e-3, 1e-4, 0.0)] {
            let mesh = one_triangle(corners);
            let (_, buffer) = draw(&mesh, &camera(eye), 16, 16);
            each(&mesh, &buffer, |_, _, f, i| {
                assert!(f.normal(i).is_normalized());
                assert!(!f.uv(i).is_nan());
            });
        }
    }
}

#[test]
fn needles_points_and_unreadable_corners_are_skipped() {
    let nan = Vec3::splat(f32::NAN);
    for corners in [
        [Vec3::ZERO; 3],
        [Vec3::ZERO, Vec3::X, Vec3::X * 2.0],
        [nan, Vec3::X, Vec3::Y],
        [Vec3::ZERO, Vec3::X, Vec3::new(f32::INFINITY, 0.0, 0.0)],
    ] {
        let mesh = one_triangle(corners);
        let (_, buffer) = draw(&mesh, &camera(Vec3::new(0.0, 0.0, 5.0)), 64, 64);
        each(&mesh, &buffer, |_, _, _, _| panic!("{corners:?}"));
    }
    // A fan of needles, each thinner than a sample, still covers what it covers, once.
    let mut points = vec![Vec2::new(16.0, 16.0)];
    points.extend((0..=400).map(|i| {
        let (s, c) = (i as f32 / 400.0 * TAU).sin_cos();
        Vec2::new(16.0, 16.0) + Vec2::new(c, s) * 30.0
    }));
    points[401] = points[1];
    let triangles: Vec<_> = (1..=400).map(|i| [0, i, i + 1]).collect();
    assert!(owners(&points, &triangles, 32).iter().all(|&c| c == 1));
}

#[test]
fn broken_meshes_are_refused_and_cancelling_cancels() {
    let view = View::new(&camera(Vec3::Z), Size::new(8, 8).unwrap()).unwrap();
    let draw = |mesh: &Mesh, progress: &Progress<'_>| {
        let geometry = Geometry::new(mesh)?;
        GBuffer::draw(&geometry, &view, view.size().rect(), Cull::None, progress)
    };
    let mut mesh = one_triangle([Vec3::ZERO, Vec3::X, Vec3::Y]);
    let stop = |_: u64, _: u64| false;
    assert!(matches!(
        draw(&mesh, &Progress::new(&stop)),
        Err(Error::Cancelled)
    ));
    mesh.triangles.push([0, 1, 3]);
    let e = draw(&mesh, &Progress::none()).unwrap_err().to_string();
    assert!(e.contains("below 3"), "{e}");
    mesh.uvs.pop();
    assert!(draw(&mesh, &Progress::none()).is_err());
}

#[test]
fn attributes_in_f64_are_the_same_attributes() {
    let mesh = torus(64, 32);
    let (view, buffer) = draw(&mesh, &camera(Vec3::new(0.0, 2.0, 3.0)), 200, 150);
    let geometry = Geometry::new(&mesh).unwrap();
    let mut exact: HashMap<(u32, u32), Exact> = buffer
        .tiles()
        .iter()
        .flat_map(|t| t.exact(&geometry, &view))
        .map(|e| ((e.column, e.row), e))
        .collect();
    each(&mesh, &buffer, |x, y, f, i| {
        let e = exact.remove(&(x, y)).expect("the same samples");
        assert!(e.position.distance(f.position(i).as_dvec3()) < 1e-4);
        assert!(e.normal.distance(f.normal(i).as_dvec3()) < 1e-4);
        assert!(
            e.tangent
                .normalize()
                .dot(f.tangent(i).truncate().as_dvec3().normalize())
                > 1.0 - 1e-7
        );
        assert!(e.uv.distance(f.uv(i).as_dvec2()) < 1e-4);
        assert_eq!((e.handedness, e.facing), (1.0, f64::from(f.facing(i))));
    });
    assert!(exact.is_empty());
}

#[test]
fn batches_of_triangles_draw_what_all_at_once_do() {
    // More triangles than are binned at a time, in front of each other.
    let mut mesh = torus(64, 32);
    let once = mesh.triangles.clone();
    while mesh.triangles.len() <= 1 << 17 {
        mesh.triangles.extend_from_slice(&once);
    }
    let (view, many) = draw(&mesh, &camera(Vec3::new(0.0, 2.0, 3.0)), 160, 120);
    mesh.triangles = once;
    let (_, few) = draw(&mesh, &camera(Vec3::new(0.0, 2.0, 3.0)), 160, 120);
    // Of two at one depth the first drawn stays.
    assert!(many.tiles() == few.tiles() && view.size().texels() == 160 * 120);
}
