//! Rows 22 to 24: the rasteriser's own edges.

use super::Evidence;
use crate::error::Result;
use crate::map::Size;
use crate::mesh::Mesh;
use crate::progress::Progress;
use crate::raster::{Camera, Cull, Fragments, GBuffer, Geometry, Projection, View};
use glam::{DVec3, Vec2, Vec3, Vec4};

/// Samples along a side of the little pictures.
const SIDE: u32 = 32;

/// Which samples of a picture a triangle alone is seen in.
fn drawn(corners: [Vec3; 3], view: &View) -> Result<Vec<bool>> {
    let mesh = Mesh {
        name: "triangle".to_owned(),
        positions: corners.to_vec(),
        normals: vec![Vec3::Z; 3],
        tangents: vec![Vec4::X; 3],
        uvs: vec![Vec2::ZERO, Vec2::X, Vec2::Y],
        triangles: vec![[0, 1, 2]],
        aspect: 1.0,
    };
    let window = view.size().rect();
    let geometry = Geometry::new(&mesh)?;
    let buffer = GBuffer::draw(&geometry, view, window, Cull::None, &Progress::none())?;
    let mut seen = vec![false; view.size().texels()];
    let mut fragments = Fragments::new();
    for tile in buffer.tiles() {
        tile.resolve(&geometry, buffer.corners(), false, &mut fragments);
        for i in 0..fragments.len() {
            let (x, y) = fragments.place(i);
            seen[window.index(x, y)] = true;
        }
    }
    Ok(seen)
}

/// A camera under which world (x, y) is sample (x, SIDE - y).
fn flat_view() -> Result<View> {
    let middle = 0.5 * SIDE as f32;
    let camera = Camera {
        eye: Vec3::new(middle, middle, 10.0),
        target: Vec3::new(middle, middle, 0.0),
        up: Vec3::Y,
        projection: Projection::Orthographic {
            extent: SIDE as f32,
        },
    };
    View::new(&camera, Size::new(SIDE, SIDE)?)
}

/// The textbook's test: a sample is inside where no edge function is negative.
fn inside(corners: [Vec2; 3], p: Vec2) -> bool {
    let edge = |i: usize| {
        let (a, b) = (corners[i], corners[(i + 1) % 3]);
        (b - a).perp_dot(p - a)
    };
    let signs = [edge(0), edge(1), edge(2)];
    signs.iter().all(|e| *e >= 0.0) || signs.iter().all(|e| *e <= 0.0)
}

/// How many samples are not owned by exactly one of triangles that tile the picture.
fn ownership(triangles: &[[Vec2; 3]]) -> Result<Evidence> {
    let view = flat_view()?;
    let mut naive = vec![0; view.size().texels()];
    let mut ours = naive.clone();
    for &corners in triangles {
        let seen = drawn(corners.map(|p| p.extend(0.0)), &view)?;
        for (i, seen) in seen.into_iter().enumerate() {
            let (x, y) = (i as u32 % SIDE, i as u32 / SIDE);
            let centre = Vec2::new(x as f32 + 0.5, (SIDE - y) as f32 - 0.5);
            naive[i] += u32::from(inside(corners, centre));
            ours[i] += u32::from(seen);
        }
    }
    let wrong = |owners: &[u32]| owners.iter().filter(|n| **n != 1).count() as f64;
    Ok(Evidence {
        naive: wrong(&naive),
        ours: wrong(&ours),
    })
}

/// Row 22. A fan of needles, each thinner than a sample, around a sample's centre.
pub(super) fn needles() -> Result<Evidence> {
    let middle = Vec2::splat(16.5);
    let rim = |i: u32| {
        let turn = std::f32::consts::TAU * (i % 300) as f32 / 300.0;
        middle + Vec2::new(turn.cos(), turn.sin()) * 40.0
    };
    let fan: Vec<_> = (0..300).map(|i| [middle, rim(i), rim(i + 1)]).collect();
    ownership(&fan)
}

/// Row 23. A grid whose corners and edges lie on the centres of samples.
pub(super) fn shared_edges() -> Result<Evidence> {
    let mut triangles = Vec::new();
    for (i, j) in (0..81).map(|k| (k % 9, k / 9)) {
        let at = |i: u16, j: u16| {
            let wobble = f32::from((i * 3 + j * 5) % 3);
            Vec2::new(f32::from(i) * 5.0 - 4.5 + wobble, f32::from(j) * 5.0 - 4.5)
        };
        let [a, b, c, d] = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
        triangles.extend([[a, b, c], [a, c, d]]);
    }
    ownership(&triangles)
}

/// Row 24. Triangles that reach from before the eye to behind it; which samples they cover, by rays. The naive form divides by
/// w and draws what comes out: what is behind the eye, turned over. Ours cuts at the near plane and takes attributes from
/// homogeneous edge functions.
pub(super) fn behind_the_eye() -> Result<Evidence> {
    let eye = Vec3::new(0.0, 0.0, 5.0);
    let camera = Camera {
        eye,
        target: Vec3::ZERO,
        up: Vec3::Y,
        projection: Projection::Perspective { fov: 35.0 },
    };
    let view = View::new(&camera, Size::new(SIDE, SIDE)?)?;
    let scale = 0.5 * SIDE as f32 / 17.5f32.to_radians().tan();
    let project = |p: Vec3| {
        let w = eye.z - p.z;
        Vec2::new(p.x, -p.y) * (scale / w) + Vec2::splat(0.5 * SIDE as f32)
    };
    let mut evidence = Evidence::NONE;
    for i in 0..24u16 {
        let s = f32::from(i);
        let corners = [
            Vec3::new(-2.0 + 0.1 * s, -1.0, -3.0),
            Vec3::new(1.5, -1.2 + 0.09 * s, 2.0 + 0.3 * s),
            Vec3::new(0.3 - 0.05 * s, 0.8, 4.5 + 0.2 * s),
        ];
        for (k, seen) in drawn(corners, &view)?.into_iter().enumerate() {
            let (x, y) = (k as u32 % SIDE, k as u32 / SIDE);
            let (start, ray) = view.ray(x, y);
            let Some(hit) = meets(corners, start, ray) else {
                continue;
            };
            let centre = Vec2::new(x as f32 + 0.5, y as f32 + 0.5);
            evidence.naive += f64::from(inside(corners.map(project), centre) != hit);
            evidence.ours += f64::from(seen != hit);
        }
    }
    Ok(evidence)
}

/// Whether a ray meets a triangle; none where it passes an edge too near to say.
fn meets(corners: [Vec3; 3], start: Vec3, ray: Vec3) -> Option<bool> {
    let [a, b, c] = corners.map(|p| p.as_dvec3());
    let (start, ray): (DVec3, DVec3) = (start.as_dvec3(), ray.as_dvec3());
    let normal = (b - a).cross(c - a);
    let t = normal.dot(a - start) / normal.dot(ray);
    let p = start + ray * t;
    let share = |s: DVec3, e: DVec3| normal.dot((e - s).cross(p - s)) / normal.length_squared();
    let least = share(a, b).min(share(b, c)).min(share(c, a));
    // A few thousandths of the triangle are less than the 1/256 of a sample that corners are rounded to; before the near
    // plane nothing is drawn.
    (least.abs() > 3e-3 && t.abs() > 0.02).then_some(least > 0.0 && t > 0.0)
}
