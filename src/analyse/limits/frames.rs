//! Rows 17 and 18: frames that a mesh gives wrongly, drawn by the preview.

use super::shading::{direction, mirrored, truth};
use super::stage::Stage;
use super::{Evidence, relative, worst};
use crate::brdf::{self, Model};
use crate::error::Result;
use crate::map::{AnisoMap, Size, Texel, Wrap};
use crate::math::Axis;
use crate::mesh::{self, Mesh};
use glam::{DVec2, DVec3, Vec2, Vec3, Vec4};

/// The light that a flat square shows of one light, seen head on.
fn seen(mesh: &Mesh, alpha: Vec2, toward: Vec3) -> Result<f32> {
    let texel = Texel {
        alpha_x: alpha.x,
        alpha_y: alpha.y,
        axis: Axis::U,
    };
    let map = AnisoMap::constant(Size::new(4, 4)?, Wrap::Repeat, texel);
    let stage = Stage {
        mesh,
        map: &map,
        model: Model::WardExact,
        extent: 1.0,
        toward,
    };
    Ok(stage.draw(3)?.pixel(1, 1)[0])
}

/// Row 17. Normals and tangents as interpolation along a coarse edge leaves them: short, and the tangent leaning to the normal.
pub(super) fn loose_frames() -> Result<Evidence> {
    let mut evidence = Evidence::NONE;
    let alpha = Vec2::new(0.1, 0.3);
    for slope in [
        DVec2::new(0.2, 0.0),
        DVec2::new(0.0, 0.6),
        DVec2::new(-0.14, 0.42),
    ] {
        let Some(l) = mirrored(DVec3::Z, slope).map(|l| l.as_vec3()) else {
            continue;
        };
        let want = truth(Model::WardExact, (l, Vec3::Z), alpha);
        for (length, lean) in [(0.966, 0.0), (1.0, 1.0), (0.99, 0.5)] {
            let n = Vec3::Z * length;
            let t = direction(90.0 - lean, 0.0).as_vec3() * length;
            let mut mesh = mesh::plane();
            mesh.normals.fill(n);
            mesh.tangents.fill(t.extend(1.0));
            let local = |w: Vec3| Vec3::new(w.dot(t), w.dot(n.cross(t)), w.dot(n));
            let naive = brdf::shade(Model::WardExact, local(l), local(Vec3::Z), alpha);
            worst(&mut evidence.naive, relative(naive, want));
            worst(&mut evidence.ours, relative(seen(&mesh, alpha, l)?, want));
        }
    }
    Ok(evidence)
}

/// Row 18. Tangents that are zero, along the normal, or not finite. Ours is the light of the round lobe with the same variance.
pub(super) fn no_tangent() -> Result<Evidence> {
    let mut evidence = Evidence::NONE;
    let alpha = Vec2::new(0.1, 0.3);
    let round = Vec2::splat((0.5 * alpha.length_squared()).sqrt());
    for tangent in [
        Vec3::ZERO,
        Vec3::Z,
        Vec3::NAN,
        Vec3::new(f32::INFINITY, 0.0, 0.0),
    ] {
        let mut mesh = mesh::plane();
        mesh.tangents.fill(Vec4::from((tangent, 1.0)));
        for degrees in [0.0, 15.0] {
            let l = direction(degrees, 0.6).as_vec3();
            let t = (tangent - Vec3::Z * tangent.z).normalize();
            let local = |w: Vec3| Vec3::new(w.dot(t), w.dot(Vec3::Z.cross(t)), w.z);
            let naive = brdf::evaluate(Model::WardExact, local(l), local(Vec3::Z), alpha) * l.z;
            let want = truth(Model::WardExact, (l, Vec3::Z), round);
            worst(&mut evidence.naive, relative(naive, want));
            worst(&mut evidence.ours, relative(seen(&mesh, alpha, l)?, want));
        }
    }
    Ok(evidence)
}
