//! Rows 1 to 8, 20 and 21: the formulas of light.

use super::stage::Stage;
use super::{Evidence, bad, relative, worst};
use crate::brdf::kernel::{self, Batch};
use crate::brdf::{self, Model};
use crate::error::Result;
use crate::map::{AnisoMap, Size, Texel, Wrap};
use crate::math::{self, Axis};
use crate::mesh;
use glam::{DVec2, DVec3, Quat, Vec2, Vec3};
use std::f32::consts::PI;

/// Every model with a highlight.
pub(crate) const SPECULAR: [Model; 8] = [
    Model::Ward,
    Model::WardExact,
    Model::WardDuer,
    Model::WardBounded,
    Model::Beckmann,
    Model::Ggx,
    Model::Phong,
    Model::BlinnPhong,
];

/// The unit vector at `degrees` from the normal and `azimuth` radians from the tangent.
pub(crate) fn direction(degrees: f64, azimuth: f64) -> DVec3 {
    let (sin, cos) = degrees.to_radians().sin_cos();
    DVec3::new(sin * azimuth.cos(), sin * azimuth.sin(), cos)
}

/// The light that `v` mirrors at the half vector of this slope; none where it would stand under the surface.
pub(crate) fn mirrored(v: DVec3, slope: DVec2) -> Option<DVec3> {
    let h = slope.extend(1.0).normalize();
    let l = 2.0 * v.dot(h) * h - v;
    (l.z > 0.0).then_some(l)
}

/// Views from the normal to 80 degrees, and for each the lights up to `widths` widths off its mirror direction, in the
/// texel's axes.
pub(super) fn lobe_pairs(alpha: DVec2, widths: f64) -> Vec<(Vec3, Vec3)> {
    let mut pairs = Vec::new();
    for theta in [0.0, 30.0, 60.0, 80.0] {
        for (turn, step) in (0..7 * 32).map(|i| (i / 7, i % 7)) {
            let azimuth = 0.01 + f64::from(turn) * std::f64::consts::PI / 16.0;
            let v = direction(theta, 0.7 * azimuth);
            let reach = widths * f64::from(step) / 6.0;
            let slope = DVec2::new(azimuth.cos(), azimuth.sin()) * reach * alpha;
            pairs.extend(mirrored(v, slope).map(|l| (l.as_vec3(), v.as_vec3())));
        }
    }
    pairs
}

/// What the vectorised loop of a model makes of pixels of one texel.
pub(crate) fn through_kernel(model: Model, pairs: &[(Vec3, Vec3)], texel: Texel) -> Vec<f32> {
    let lane =
        |component: fn(&(Vec3, Vec3)) -> f32| pairs.iter().map(component).collect::<Vec<_>>();
    let light = [lane(|p| p.0.x), lane(|p| p.0.y), lane(|p| p.0.z)];
    let view = [lane(|p| p.1.x), lane(|p| p.1.y), lane(|p| p.1.z)];
    let Texel {
        alpha_x,
        alpha_y,
        axis,
    } = texel;
    let lobe =
        kernel::prepare(alpha_x, alpha_y, axis.cos2, axis.sin2).map(|x| vec![x; pairs.len()]);
    let batch = Batch {
        light: light.each_ref().map(Vec::as_slice),
        view: view.each_ref().map(Vec::as_slice),
        lobe: lobe.each_ref().map(Vec::as_slice),
    };
    let mut out = vec![f32::NAN; pairs.len()];
    kernel::shade(math::level(), model, &batch, &mut out);
    out
}

/// The f64 form at the very numbers that the f32 form is given.
pub(super) fn truth(model: Model, (l, v): (Vec3, Vec3), alpha: Vec2) -> f64 {
    brdf::shade_f64(model, l.as_dvec3(), v.as_dvec3(), alpha.as_dvec2())
}

fn along_u(alpha: Vec2) -> Texel {
    Texel {
        alpha_x: alpha.x,
        alpha_y: alpha.y,
        axis: Axis::U,
    }
}

/// One light, one viewer, one texel, in the texel's axes.
pub(super) type Point = (Vec3, Vec3, Vec2);

/// f_r n.l in the two ways in which the program has it: by one call, and by the loop that lights pictures.
fn lit(model: Model, (l, v, alpha): Point) -> [f32; 2] {
    let vectorised = through_kernel(model, &[(l, v)], along_u(alpha));
    [brdf::shade(model, l, v, alpha), vectorised[0]]
}

/// How far light may be off f64 where a row counts values and not digits: a part of it, or less than any picture holds.
const LIGHT_ERROR: f64 = 1e-4;
const NO_LIGHT: f64 = 1e-20;

/// How many values are NaN, infinite, negative, or another light than that of f64: the form that is shaded with must not only
/// be safe, it must also be there.
pub(super) fn wrong_light<const N: usize>(
    models: &[Model],
    points: &[Point],
    shaded: impl Fn(Model, Point) -> [f32; N],
) -> usize {
    let mut wrong = 0;
    for &model in models {
        for &point in points {
            let want = truth(model, (point.0, point.1), point.2);
            let is_wrong = |got: f32| {
                let error = (f64::from(got) - want).abs();
                bad(got) || error > LIGHT_ERROR * want + NO_LIGHT
            };
            wrong += shaded(model, point)
                .into_iter()
                .filter(|x| is_wrong(*x))
                .count();
        }
    }
    wrong
}

/// Bad values of the bare formula times n.l, and wrong ones of what lights pictures.
fn light(models: &[Model], points: &[Point]) -> Evidence {
    let bare = |model: &Model| {
        let value = |&(l, v, alpha): &Point| brdf::evaluate(*model, l, v, alpha) * l.z;
        points.iter().map(value).filter(|x| bad(*x)).count()
    };
    Evidence {
        naive: models.iter().map(bare).sum::<usize>() as f64,
        ours: wrong_light(models, points, lit) as f64,
    }
}

/// Row 1. The naive form is the textbook's: angles from acos and atan2, then tan². Near the normal h.n holds nothing but its
/// rounding: a quarter of the light is off inside three widths at alpha 0.001. So is 1 - (h.n)², which ours never forms either.
pub(super) fn near_the_normal() -> Result<Evidence> {
    let naive = |(l, v): (Vec3, Vec3), alpha: Vec2| {
        let h = (l + v).normalize();
        let (tan, (sin, cos)) = (h.z.acos().tan(), h.y.atan2(h.x).sin_cos());
        let k = tan * tan * ((cos / alpha.x).powi(2) + (sin / alpha.y).powi(2));
        (-k).exp() / (4.0 * PI * alpha.x * alpha.y * (l.z * v.z).sqrt()) * l.z
    };
    let mut evidence = Evidence::NONE;
    for alpha in [0.1, 0.02, 0.01, 0.003, 0.001] {
        let alpha = Vec2::splat(alpha);
        for pair in lobe_pairs(alpha.as_dvec2(), 3.0) {
            let want = truth(Model::WardExact, pair, alpha);
            worst(&mut evidence.naive, relative(naive(pair, alpha), want));
            for model in SPECULAR {
                let want = truth(model, pair, alpha);
                for got in lit(model, (pair.0, pair.1, alpha)) {
                    worst(&mut evidence.ours, relative(got, want));
                }
            }
        }
    }
    Ok(evidence)
}

/// Light and viewer that sink to the horizon and through it, together, apart, and opposite.
pub(super) fn horizon_points() -> Vec<Point> {
    let cosines = [
        -0.1, -1e-45, 0.0, 1e-45, 1e-40, 1e-38, 1e-30, 1e-26, 1e-20, 1e-10, 1e-5, 1e-3, 0.1, 1.0,
    ];
    let low = |z: f32, x: f32| Vec3::new(x * (1.0 - z * z).sqrt(), 0.0, z);
    let mut points = Vec::new();
    for nl in cosines {
        for nv in cosines {
            for x in [1.0, -1.0] {
                points.push((low(nl, 1.0), low(nv, x), Vec2::new(0.1, 0.4)));
            }
        }
    }
    points
}

/// Row 2. The product n.l n.v underflows long before n.l does, and 1/sqrt(n.l n.v) or 1/(n.l n.v) is then infinite; at the
/// horizon itself infinity times n.l is NaN.
pub(super) fn at_the_horizon() -> Result<Evidence> {
    Ok(light(&SPECULAR, &horizon_points()))
}

/// The axis that shading normals are turned around by 30 degrees in row 3: from it the surface is seen.
fn bent(normal: Vec3) -> Vec3 {
    Quat::from_rotation_x(30f32.to_radians()) * normal
}

/// The half of a sphere that is seen from +z, lit from where its bent normals are seen: the light is above every one of them,
/// the viewer under those of a crescent.
pub(super) fn bent_points() -> Vec<Point> {
    let lamp = bent(Vec3::Z);
    let mut points = Vec::new();
    for i in 0..400 {
        let (degrees, turn) = (89.9 * f64::from(i) / 400.0, f64::from(i) * 0.61);
        let shading = bent(direction(degrees, turn).as_vec3());
        if let Some((frame, _)) = math::Frame::new(shading, Vec3::X.extend(1.0)) {
            let (l, v) = (frame.to_local(lamp), frame.to_local(Vec3::Z));
            points.push((l, v, Vec2::new(0.1, 0.3)));
        }
    }
    points
}

/// Row 3. The root of a negative n.l n.v is NaN. Behind the surface ours is 0, as f64's is; but a point that is in sight and whose
/// normal alone is bent away must not be black, so the preview raises n.v there: the sphere is drawn, and no pixel of it may
/// be black, nor none at all.
pub(super) fn bent_normals() -> Result<Evidence> {
    let mut evidence = light(&SPECULAR, &bent_points());
    let mut sphere = mesh::sphere();
    for normal in &mut sphere.normals {
        *normal = bent(*normal);
    }
    let texel = along_u(Vec2::new(0.3, 0.6));
    let map = AnisoMap::constant(Size::new(4, 4)?, Wrap::Repeat, texel);
    let radius = sphere.bounding_sphere().1;
    let side = 32u32;
    let stage = Stage {
        mesh: &sphere,
        map: &map,
        model: Model::Ggx,
        extent: 2.0 * radius,
        toward: bent(Vec3::Z),
    };
    let picture = stage.draw(side)?;
    for (x, y) in (0..side * side).map(|i| (i % side, i / side)) {
        let middle = |i: u32| (i as f32 + 0.5) / side as f32 - 0.5;
        // Well inside of the outline, whatever the triangles are.
        if Vec2::new(middle(x), middle(y)).length() < 0.48 {
            let seen = picture.pixel(x, y)[0];
            evidence.ours += f64::from(bad(seen) || seen == 0.0);
        }
    }
    Ok(evidence)
}

/// Light and viewer opposite at the horizon and above it, and mirrored over the normal at the same heights.
pub(super) fn opposite_points() -> Vec<Point> {
    let mut points = Vec::new();
    for i in 0..64u16 {
        let tilt = [0.0, 1e-30, 1e-12, 0.3][usize::from(i % 4)];
        let l = direction(90.0, f64::from(i) * 0.1).as_vec3();
        let l = l.with_z(tilt).normalize();
        for v in [-l, Vec3::new(-l.x, -l.y, l.z)] {
            points.push((l, v, Vec2::new(0.05, 0.5)));
        }
    }
    points
}

/// Row 4. |H| is 0, which happens only with n.l = -n.v. The naive form normalises H.
pub(super) fn opposite_directions() -> Result<Evidence> {
    let naive = |&(l, v, alpha): &Point| {
        let h = (l + v).normalize();
        let k = 2.0 * ((h.x / alpha.x).powi(2) + (h.y / alpha.y).powi(2)) / (1.0 + h.z);
        (-k).exp() * l.z
    };
    let points = opposite_points();
    Ok(Evidence {
        naive: points.iter().filter(|p| bad(naive(p))).count() as f64,
        ours: light(&SPECULAR, &points).ours,
    })
}

/// Half vectors from half a right angle above the horizon down to nothing.
pub(super) fn grazing_points() -> Vec<Point> {
    let mut points = Vec::new();
    for exponent in 0..40 {
        let z = 0.5 * 10f32.powi(-exponent);
        let l = Vec3::new(1.0, 0.0, z).normalize();
        for v in [Vec3::new(-l.x, 0.0, l.z), Vec3::new(0.0, l.x, l.z), l] {
            points.push((l, v, Vec2::new(0.1, 0.4)));
        }
    }
    points
}

/// Row 5. H sinks to the horizon, and the bounded form divides by its height to the fourth power, which underflows at 1e-11:
/// infinity, times an exponential that is 0.
pub(super) fn grazing_half_vector() -> Result<Evidence> {
    let naive = |&(l, v, alpha): &Point| {
        let h = l + v;
        let k = ((h.x / alpha.x).powi(2) + (h.y / alpha.y).powi(2)) / (h.z * h.z);
        h.length_squared() * (-k).exp() / (PI * alpha.x * alpha.y * h.z.powi(4)) * l.z
    };
    let points = grazing_points();
    Ok(Evidence {
        naive: points.iter().filter(|p| bad(naive(p))).count() as f64,
        ours: light(&SPECULAR, &points).ours,
    })
}

/// Widths that no surface has.
pub(super) fn extreme_points() -> Vec<Point> {
    let widths = [
        0.0, -0.0, -1.0, 1e-45, 1e-40, 1e-30, 1e-20, 1e-10, 1e-5, 1e-4, 1e-3, 0.1, 1.0, 10.0, 1e30,
    ];
    let tilted = Vec3::new(0.01, 0.02, 1.0).normalize();
    let mut points = Vec::new();
    for ax in widths {
        for ay in widths {
            for l in [Vec3::Z, tilted, Vec3::new(0.6, 0.0, 0.8)] {
                points.push((l, Vec3::Z, Vec2::new(ax, ay)));
            }
        }
    }
    points
}

/// Row 6. 1/(4 pi alpha²) is infinite at 1e-20, and times an exponential that is 0 a NaN; a negative width gives negative light.
/// Ours has its least width, 0.001, for all of them, as f64's has.
pub(super) fn extreme_widths() -> Result<Evidence> {
    Ok(light(&SPECULAR, &extreme_points()))
}

/// From the peak of a lobe down its tail, to exponents that no f32 holds, along a way that only `k` tells of.
fn tail() -> impl Iterator<Item = (f64, Point)> {
    let alpha = Vec2::new(0.02, 0.05);
    let v = direction(20.0, 1.0);
    (0..2400).filter_map(move |i| {
        let k = 0.05 * f64::from(i);
        let slope = DVec2::new(f64::from(alpha.x) * k.sqrt(), 0.0);
        Some((k, (mirrored(v, slope)?.as_vec3(), v.as_vec3(), alpha)))
    })
}

pub(super) fn tail_points() -> Vec<Point> {
    tail().map(|(_, point)| point).collect()
}

/// Row 7. How much of a lobe's tail is denormal numbers, which many processors take much longer over: e^-k is one from 87.4 to 103.
/// Ours is light as f64 has it up to k = 80 and 0 beyond, under 2e-35 of the peak.
pub(super) fn underflow() -> Result<Evidence> {
    let count = |values: &mut dyn Iterator<Item = f32>| values.filter(|x| x.is_subnormal()).count();
    let points = tail_points();
    let slow = SPECULAR.map(|m| count(&mut points.iter().flat_map(|p| lit(m, *p))));
    let wrong = wrong_light(&SPECULAR, &points, lit);
    Ok(Evidence {
        naive: count(&mut tail().map(|(k, _)| (-(k as f32)).exp())) as f64,
        ours: (slow.iter().sum::<usize>() + wrong) as f64,
    })
}

/// Row 8. The naive form keeps the lobe as a matrix of three numbers, R diag(1/alpha²) Rᵀ, whose terms cancel: a fifth of the
/// light is off inside two widths at (0.001, 1).
pub(super) fn extreme_ratios() -> Result<Evidence> {
    let mut evidence = Evidence::NONE;
    let widths = [(0.01, 0.1), (0.01, 1.0), (0.001, 0.1), (0.001, 1.0)];
    for (alpha, turn) in widths
        .into_iter()
        .flat_map(|a| (0..8u8).map(move |i| (a, i)))
    {
        let texel = Texel {
            alpha_x: alpha.0,
            alpha_y: alpha.1,
            axis: Axis::from_degrees(22.0 * f32::from(turn) + 3.0),
        };
        let turned = Turned::new(texel);
        let local = lobe_pairs(Vec2::from(alpha).as_dvec2(), 2.0);
        let out = |w: Vec3| turned.out(w.as_dvec3()).as_vec3();
        let pairs: Vec<_> = local.iter().map(|p| (out(p.0), out(p.1))).collect();
        let got = through_kernel(Model::WardExact, &pairs, texel);
        for (&pair, got) in pairs.iter().zip(got) {
            let want = turned.truth(Model::WardExact, pair.0.as_dvec3(), pair.1.as_dvec3());
            worst(&mut evidence.naive, relative(by_matrix(texel, pair), want));
            worst(&mut evidence.ours, relative(got, want));
        }
    }
    Ok(evidence)
}

fn by_matrix(texel: Texel, (l, v): (Vec3, Vec3)) -> f32 {
    let (c, s) = math::half_angle(texel.axis.cos2, texel.axis.sin2);
    let (x, y) = (texel.alpha_x.powi(-2), texel.alpha_y.powi(-2));
    let (m00, m01, m11) = (
        c * c * x + s * s * y,
        c * s * (x - y),
        s * s * x + c * c * y,
    );
    let h = l + v;
    let (p, q) = (h.x / h.z, h.y / h.z);
    let k = m00 * p * p + 2.0 * m01 * p * q + m11 * q * q;
    (m00 * m11 - m01 * m01).sqrt() * (-k).exp() * (l.z / v.z).sqrt() / (4.0 * PI)
}

/// A texel's axes in f64, from its own f32 numbers.
pub(crate) struct Turned {
    c: f64,
    s: f64,
    alpha: DVec2,
}

impl Turned {
    pub(crate) fn new(texel: Texel) -> Self {
        let double = DVec2::new(texel.axis.cos2.into(), texel.axis.sin2.into());
        let (s, c) = (0.5 * double.y.atan2(double.x)).sin_cos();
        Self {
            c,
            s,
            alpha: DVec2::new(texel.alpha_x.into(), texel.alpha_y.into()),
        }
    }

    /// From the texel's axes to the surface's.
    pub(crate) fn out(&self, w: DVec3) -> DVec3 {
        DVec3::new(
            self.c * w.x - self.s * w.y,
            self.s * w.x + self.c * w.y,
            w.z,
        )
    }

    /// From the surface's axes to the texel's.
    fn within(&self, w: DVec3) -> DVec3 {
        DVec3::new(
            self.c * w.x + self.s * w.y,
            self.c * w.y - self.s * w.x,
            w.z,
        )
    }

    /// The f64 form of f_r n.l, for directions in the surface's axes.
    pub(crate) fn truth(&self, model: Model, l: DVec3, v: DVec3) -> f64 {
        brdf::shade_f64(model, self.within(l), self.within(v), self.alpha)
    }
}

/// Row 20. h.n to a power: Ashikhmin and Shirley's exponent (nu hx² + nv hy²)/(1 - hz²) is 0/0 at the peak, and hz holds
/// nothing but its rounding near it. Their limit form in f64 is what the naive one is measured against; it meets the reference
/// table (see the tests). Ours is what the program has of the kind, Blinn-Phong, against its definition: the plain power of a
/// normalised h.n in f64.
pub(super) fn power_of_the_half_vector() -> Result<Evidence> {
    let mut evidence = Evidence::NONE;
    for alpha in [0.1, 0.01, 0.001] {
        let alpha = Vec2::splat(alpha);
        for pair in lobe_pairs(alpha.as_dvec2(), 3.0) {
            let h = (pair.0 + pair.1).normalize();
            let n = 2.0 / (alpha * alpha) - 2.0;
            let exponent = (n.x * h.x * h.x + n.y * h.y * h.y) / (1.0 - h.z * h.z);
            let naive = (exponent * h.z.ln()).exp();
            let want = power_f64((pair.0 + pair.1).as_dvec3(), n.as_dvec2());
            worst(&mut evidence.naive, relative(naive, want));
            let want = blinn_phong_by_definition(pair, alpha.x.into());
            for ours in lit(Model::BlinnPhong, (pair.0, pair.1, alpha)) {
                worst(&mut evidence.ours, relative(ours, want));
            }
        }
    }
    Ok(evidence)
}

/// (n + 8)/(8 pi) (h.n)^n n.l. f64 has digits enough for the power as it is printed: one rounding of h.n is 2e-10 of it at
/// alpha 0.001.
fn blinn_phong_by_definition((l, v): (Vec3, Vec3), alpha: f64) -> f64 {
    let (l, v) = (l.as_dvec3(), v.as_dvec3());
    let n = 2.0 / (alpha * alpha) - 2.0;
    (n + 8.0) / (8.0 * std::f64::consts::PI) * (l + v).normalize().z.powf(n) * l.z
}

/// hz^((nu hx² + nv hy²)/(1 - hz²)) for H of any length, in the form that has a limit: with t = tan², ln hz = -ln(1 + t)/2 and
/// 1 - hz² = t/(1 + t), so the exponent of e is -(nu hx² + nv hy²)/Hz² · ln(1 + t)/(2 t), whose last factor is 1/2 at t = 0.
pub(super) fn power_f64(h: DVec3, n: DVec2) -> f64 {
    let t = (h.x * h.x + h.y * h.y) / (h.z * h.z);
    let share = if t > 0.0 { t.ln_1p() / t } else { 1.0 };
    (-0.5 * share * (n.x * h.x * h.x + n.y * h.y * h.y) / (h.z * h.z)).exp()
}

/// Row 21. The glTF sample viewer clamps V = G/(4 n.l n.v) to 1, which it passes from some 60 degrees on in the mirror direction:
/// at alpha 0.1 that keeps 0.73 of the light at 65 degrees, 0.29 at 75, 0.05 at 85. So that viewer is darker at outlines.
pub(super) fn clamped_visibility() -> Result<Evidence> {
    let alpha = Vec2::splat(0.1);
    let mut evidence = Evidence::NONE;
    for degrees in [0.0, 45.0, 60.0, 65.0, 75.0, 85.0] {
        let v = direction(degrees, 0.0).as_vec3();
        let l = Vec3::new(-v.x, v.y, v.z);
        let want = truth(Model::Ggx, (l, v), alpha);
        // At the mirror direction D is 1/(pi alpha²) whatever the angle.
        let distribution = 1.0 / (PI * alpha.x * alpha.y);
        let visibility = brdf::evaluate(Model::Ggx, l, v, alpha) / distribution;
        let naive = distribution * visibility.min(1.0) * l.z;
        worst(&mut evidence.naive, relative(naive, want));
        for ours in lit(Model::Ggx, (l, v, alpha)) {
            worst(&mut evidence.ours, relative(ours, want));
        }
    }
    Ok(evidence)
}
