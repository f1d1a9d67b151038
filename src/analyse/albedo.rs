//! Directional albedo: the share of light that a lobe gives back in all directions together, and where a material gives back
//! more than it got.

use super::lint::texels;
use super::{Finding, Place, Severity, by_stretches};
use crate::brdf::{Model, evaluate_f64};
use crate::map::AnisoMap;
use crate::math;
use crate::recipe::Material;
use glam::{DVec2, DVec3};
use rayon::prelude::*;
use std::f32::consts::LOG2_E;
use std::f64::consts::{FRAC_PI_2, PI, TAU};

/// Past this angle from the normal a lobe is not judged: a sphere shows 0.03 % of itself there, and Ward's norms are without
/// bound.
pub const ALBEDO_DEGREES_MAX: f64 = 89.0;

/// A material is told of when it gives back more than this: the rest is for rounding and for norms that are customary.
const SHARE_MAX: f64 = 1.005;
/// Angles from the normal at which it is judged. All albedos are largest near one end.
const DEGREES: [f64; 5] = [0.0, 60.0, 80.0, 85.0, ALBEDO_DEGREES_MAX];
/// Widths nearer than 2^(1/4) are judged by the first of them.
const STEPS_PER_OCTAVE: f32 = 4.0;

/// Works out directional albedos.
///
/// The integral of f_r n.l over all l above the surface is taken over half-vector slopes (p, q) = (alpha_x r cos a,
/// alpha_y r sin a). l is above the surface inside the circle |s - t|² < 1 + |t|², t the slope of v, which holds the origin:
/// per azimuth one stretch of r from 0. It is walked in asinh r, for the long tails, squared at the far end, where f_r n.l
/// may fall as a root.
#[derive(Clone, Debug)]
pub struct Albedo {
    azimuths: usize,
    nodes: Vec<(f64, f64)>,
}

impl Albedo {
    /// To 2e-5 of itself up to 89 degrees, with alphas of 0.01 and more and ratios to 5; some milliseconds each.
    pub fn fine() -> Self {
        Self::new(768, 64)
    }

    /// To 0.2 % there; a quarter of a millisecond each.
    pub fn quick() -> Self {
        Self::new(128, 32)
    }

    fn new(azimuths: usize, nodes: usize) -> Self {
        Self {
            azimuths,
            nodes: gauss_legendre(nodes),
        }
    }

    /// The albedo of a lobe seen from `v`, a unit vector above the surface, for rho_s = 1. 0 for `lambert`, which has none.
    pub fn of(&self, model: Model, v: DVec3, alpha: DVec2) -> f64 {
        let t = v.truncate() / v.z;
        let step = TAU / self.azimuths as f64;
        let sum: f64 = (0..self.azimuths)
            .map(|i| {
                let (sin, cos) = (step * (i as f64 + 0.5)).sin_cos();
                self.along(model, v, alpha, t, DVec2::new(alpha.x * cos, alpha.y * sin))
            })
            .sum();
        sum * step
    }

    /// The integral over r at one azimuth.
    fn along(&self, model: Model, v: DVec3, alpha: DVec2, t: DVec2, unit: DVec2) -> f64 {
        // The positive root of |unit|² r² - 2 (unit.t) r - 1 = 0.
        let (a, b) = (unit.length_squared(), unit.dot(t));
        let root = (b * b + a).sqrt();
        let reach = if b > 0.0 {
            (b + root) / a
        } else {
            1.0 / (root - b)
        };
        let end = reach.asinh();
        let part = |&(x, weight): &(f64, f64)| {
            let w = end * x * (2.0 - x);
            let dw = 2.0 * end * (1.0 - x) * weight;
            let r = w.sinh();
            let h = (unit * r).extend(1.0).normalize();
            let cosine = v.dot(h);
            let l = 2.0 * cosine * h - v;
            if l.z <= 0.0 {
                return 0.0; // the rounding of the far end
            }
            // dl = 4 (v.h) dh, dh = hz³ dp dq, dp dq = alpha_x alpha_y r dr da, dr = cosh w dw.
            let measure = 4.0 * cosine * h.z.powi(3) * alpha.x * alpha.y * r * w.cosh();
            evaluate_f64(model, l, v, alpha) * l.z * measure * dw
        };
        self.nodes.iter().map(part).sum()
    }
}

/// Nodes and weights of Gauss-Legendre quadrature on [0, 1], by Newton's method on the Legendre polynomial.
fn gauss_legendre(n: usize) -> Vec<(f64, f64)> {
    (0..n)
        .map(|i| {
            let mut x = (PI * (i as f64 + 0.75) / (n as f64 + 0.5)).cos();
            let mut slope = 1.0;
            for _ in 0..100 {
                let (mut p0, mut p1) = (1.0, x);
                for k in 2..=n {
                    let k = k as f64;
                    (p0, p1) = (p1, ((2.0 * k - 1.0) * x * p1 - (k - 1.0) * p0) / k);
                }
                slope = n as f64 * (x * p1 - p0) / (x * x - 1.0);
                x -= p1 / slope;
            }
            (0.5 * (1.0 + x), 1.0 / ((1.0 - x * x) * slope * slope))
        })
        .collect()
}

/// The unit vector at `degrees` from the normal and `azimuth` radians from the x axis.
fn viewer(degrees: f64, azimuth: f64) -> DVec3 {
    let (sin, cos) = degrees.to_radians().sin_cos();
    DVec3::new(sin * azimuth.cos(), sin * azimuth.sin(), cos)
}

/// Where a lobe's albedo is largest up to [`ALBEDO_DEGREES_MAX`], seen along either axis: the albedo, and the angle from the
/// normal in degrees.
pub fn largest_albedo(albedo: &Albedo, model: Model, alpha: DVec2) -> (f64, f64) {
    let views = DEGREES.into_iter().flat_map(|d| [(d, 0.0), (d, FRAC_PI_2)]);
    views
        .map(|(degrees, azimuth)| (albedo.of(model, viewer(degrees, azimuth), alpha), degrees))
        .fold((0.0, 0.0), |a, b| if b.0 > a.0 { b } else { a })
}

/// Texels of about the same widths.
#[derive(Clone, Copy)]
struct Group {
    count: u64,
    first: usize,
}

/// Steps of [`STEPS_PER_OCTAVE`] that hold every width of a map.
const STEPS: usize = 64;

/// The map's texels by their widths on a logarithmic grid, whichever of the two is called x.
fn groups(map: &AnisoMap) -> Vec<Group> {
    let step = |alpha: f32| ((math::ln(alpha) * LOG2_E + 12.0) * STEPS_PER_OCTAVE) as usize % STEPS;
    let parts = by_stretches(map.size().texels(), |stretch| {
        let mut grid = vec![None::<Group>; STEPS * STEPS];
        for first in stretch {
            let (a, b) = (step(map.alpha_x()[first]), step(map.alpha_y()[first]));
            let group = &mut grid[a.min(b) * STEPS + a.max(b)];
            group.get_or_insert(Group { count: 0, first }).count += 1;
        }
        grid
    });
    let mut sum = vec![None::<Group>; STEPS * STEPS];
    for part in parts {
        for (sum, group) in sum.iter_mut().zip(part) {
            match (sum, group) {
                (Some(sum), Some(group)) => sum.count += group.count,
                (sum, group) => *sum = sum.or(group),
            }
        }
    }
    sum.into_iter().flatten().collect()
}

/// The worst that a model makes of a map.
struct Excess {
    count: u64,
    first: usize,
    worst: usize,
    albedo: f64,
    degrees: f64,
}

/// Looks for texels whose lobe gives back more than `albedo_max`.
fn excess(map: &AnisoMap, model: Model, albedo_max: f64) -> Option<Excess> {
    let albedo = Albedo::quick();
    let groups: Vec<Group> = groups(map);
    let over: Vec<Excess> = groups
        .into_par_iter()
        .filter_map(|group| {
            let texel = map.texel_at(group.first);
            let alpha = DVec2::new(texel.alpha_x.into(), texel.alpha_y.into());
            let (albedo, degrees) = largest_albedo(&albedo, model, alpha);
            (albedo > albedo_max).then_some(Excess {
                count: group.count,
                first: group.first,
                worst: group.first,
                albedo,
                degrees,
            })
        })
        .collect();
    over.into_iter().reduce(|a, b| {
        let (count, first) = (a.count + b.count, a.first.min(b.first));
        let worst = if b.albedo > a.albedo { b } else { a };
        Excess {
            count,
            first,
            ..worst
        }
    })
}

/// The two numbers of the colour channel that gives back most: diffuse and specular reflectance.
fn brightest(material: &Material, albedo: f64) -> (f64, f64) {
    let channels = material.diffuse.into_iter().zip(material.specular);
    channels
        .map(|(d, s)| (f64::from(d), f64::from(s)))
        .fold((0.0, 0.0), |a, b| {
            if b.0 + b.1 * albedo > a.0 + a.1 * albedo {
                b
            } else {
                a
            }
        })
}

/// Warns of a material that reflects more light than it gets with one of `models` and the map's widths, at views up to
/// [`ALBEDO_DEGREES_MAX`]. Without a material only a lobe that does so by itself is noted, with the specular reflectance that
/// it still allows.
pub fn lint_energy(map: &AnisoMap, material: Option<&Material>, models: &[Model]) -> Vec<Finding> {
    let mut models = models.to_vec();
    models.sort_by_key(|m| m.name());
    models.dedup();
    models
        .into_iter()
        .filter_map(|model| match material {
            Some(material) => material_finding(map, material, model),
            None => lobe_finding(map, model),
        })
        .collect()
}

fn material_finding(map: &AnisoMap, material: &Material, model: Model) -> Option<Finding> {
    // The least albedo at which some channel gives back too much.
    let channels = material.diffuse.into_iter().zip(material.specular);
    let albedo_max = channels
        .map(|(d, s)| (SHARE_MAX - f64::from(d)) / f64::from(s))
        .fold(f64::INFINITY, f64::min);
    let found = excess(map, model, albedo_max)?;
    let (diffuse, specular) = brightest(material, found.albedo);
    let share = diffuse + specular * found.albedo;
    let texel = map.texel_at(found.worst);
    let message = format!(
        "{}: with {model} the material gives back up to {share:.2} of the light it gets (alphas {:.3} and {:.3}, seen {:.0} degrees \
         from the normal: diffuse {diffuse:.3} and specular {specular:.3} times the lobe's albedo of {:.2}; {})",
        texels(found.count),
        texel.alpha_x,
        texel.alpha_y,
        found.degrees,
        found.albedo,
        others(map, found.worst, material, model)
    );
    let room = (1.0 - diffuse) / found.albedo;
    let bounded = matches!(model, Model::WardBounded | Model::Beckmann | Model::Ggx);
    let advice = if diffuse >= 1.0 {
        "Lower the diffuse reflectance".to_owned()
    } else if bounded {
        format!("Lower the specular reflectance to {}", floored(room))
    } else {
        format!(
            "Lower the specular reflectance to {}, or light it with ward-bounded, whose albedo is at most 1",
            floored(room)
        )
    };
    Some(finding(Severity::Warning, map, &found, message, advice))
}

/// Which other models would give back too much there, as a clause.
fn others(map: &AnisoMap, texel: usize, material: &Material, model: Model) -> String {
    let albedo = Albedo::quick();
    let texel = map.texel_at(texel);
    let alpha = DVec2::new(texel.alpha_x.into(), texel.alpha_y.into());
    let list: Vec<String> = Model::ALL
        .into_iter()
        .filter(|m| *m != model)
        .filter_map(|m| {
            let albedo = largest_albedo(&albedo, m, alpha).0;
            let (diffuse, specular) = brightest(material, albedo);
            let share = diffuse + specular * albedo;
            (share > SHARE_MAX).then(|| format!("{m} {share:.2}"))
        })
        .collect();
    if list.is_empty() {
        "no other model too much".to_owned()
    } else {
        format!("other models: {}", list.join(", "))
    }
}

fn lobe_finding(map: &AnisoMap, model: Model) -> Option<Finding> {
    let found = excess(map, model, SHARE_MAX)?;
    let texel = map.texel_at(found.worst);
    let message = format!(
        "{}: with {model} the lobe alone has an albedo of up to {:.2} (alphas {:.3} and {:.3}, seen {:.0} degrees from the normal)",
        texels(found.count),
        found.albedo,
        texel.alpha_x,
        texel.alpha_y,
        found.degrees
    );
    let advice = format!(
        "Keep the specular reflectance under {} where energy counts, or use ward-bounded",
        floored(1.0 / found.albedo)
    );
    Some(finding(Severity::Note, map, &found, message, advice))
}

/// Two digits, never rounded up.
fn floored(x: f64) -> String {
    format!("{:.2}", (100.0 * x).floor() / 100.0)
}

fn finding(
    severity: Severity,
    map: &AnisoMap,
    found: &Excess,
    message: String,
    advice: String,
) -> Finding {
    Finding {
        severity,
        code: "energy",
        count: found.count,
        first: Some(Place::of(found.first, map.width())),
        message,
        advice,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::map::{Size, Texel, Wrap};
    use crate::math::Axis;
    use crate::recipe::PRESETS;

    fn constant(alpha_x: f32, alpha_y: f32) -> AnisoMap {
        let axis = Axis::from_degrees(20.0);
        let texel = Texel {
            alpha_x,
            alpha_y,
            axis,
        };
        AnisoMap::constant(Size::new(16, 8).unwrap(), Wrap::Repeat, texel)
    }

    fn material(diffuse: f32, specular: f32) -> Material {
        Material {
            diffuse: [0.0, diffuse, 0.0],
            specular: [specular; 3],
            ambient: [0.0; 3],
        }
    }

    #[test]
    fn the_quick_quadrature_is_as_good_as_it_says() {
        let (fine, quick) = (Albedo::fine(), Albedo::quick());
        let mut worst = 0.0f64;
        for alpha in [
            (0.01, 0.01),
            (0.05, 0.2),
            (0.1, 0.5),
            (0.5, 1.0),
            (1.0, 1.0),
            (1.4, 0.3),
        ] {
            for degrees in DEGREES {
                for azimuth in [0.0, 0.8, FRAC_PI_2] {
                    let v = viewer(degrees, azimuth);
                    for model in [Model::Ward, Model::WardDuer, Model::WardBounded, Model::Ggx] {
                        let alpha = DVec2::from(alpha);
                        let want = fine.of(model, v, alpha);
                        worst = worst.max((quick.of(model, v, alpha) / want - 1.0).abs());
                    }
                }
            }
        }
        assert!(worst < 2e-3, "{worst}");
    }

    #[test]
    fn wide_ward_lobes_are_told_and_bounded_ones_are_not() {
        let map = constant(0.5, 1.0);
        let found = lint_energy(&map, Some(&material(0.2, 0.8)), &[Model::Ward]);
        assert_eq!(found.len(), 1);
        let f = &found[0];
        assert_eq!(
            (f.severity, f.code, f.count),
            (Severity::Warning, "energy", 128)
        );
        assert_eq!(f.first, Some(Place { x: 0, y: 0 }));
        // 0.2 + 0.8 x 1.34.
        for words in [
            "with ward the",
            "1.27 of the light",
            "89 degrees",
            "albedo of 1.34",
            "ward-duer",
        ] {
            assert!(f.message.contains(words), "{words}: {f}");
        }
        assert!(
            f.advice.contains("to 0.59") && f.advice.contains("ward-bounded"),
            "{f}"
        );
        for quiet in [Model::WardBounded, Model::Ggx, Model::Beckmann] {
            assert_eq!(lint_energy(&map, Some(&material(0.0, 1.0)), &[quiet]), []);
        }
        assert_eq!(
            lint_energy(&map, Some(&material(0.2, 0.5)), &[Model::Ward]),
            []
        );
        let both = [Model::WardDuer, Model::Ward, Model::Ward];
        assert_eq!(lint_energy(&map, Some(&material(0.2, 0.8)), &both).len(), 2);
    }

    #[test]
    fn a_bare_map_is_only_noted() {
        let found = lint_energy(&constant(0.5, 1.0), None, &[Model::Ward]);
        assert_eq!(found[0].severity, Severity::Note);
        assert!(found[0].advice.contains("0.74"), "{}", found[0]);
        assert_eq!(lint_energy(&constant(0.1, 0.4), None, &[Model::Ward]), []);
    }

    #[test]
    fn too_much_diffuse_is_no_fault_of_the_lobe() {
        let found = lint_energy(
            &constant(0.1, 0.4),
            Some(&material(1.1, 0.0)),
            &[Model::Ward],
        );
        assert_eq!(found.len(), 1);
        assert_eq!(found[0].advice, "Lower the diffuse reflectance");
    }

    #[test]
    fn one_rough_texel_is_found() {
        let mut map = constant(0.1, 0.2);
        map.region_mut().set(
            21,
            Texel {
                alpha_x: 1.0,
                alpha_y: 0.5,
                axis: Axis::U,
            },
        );
        let found = lint_energy(&map, Some(&material(0.0, 1.0)), &[Model::Ward]);
        assert_eq!(found[0].count, 1);
        assert_eq!(found[0].first, Some(Place { x: 5, y: 1 }));
    }

    #[test]
    fn every_preset_is_clean() {
        for preset in PRESETS {
            let mut file = preset.recipe().unwrap();
            file.set(&[("size".to_owned(), "[64, 64]".to_owned())])
                .unwrap();
            let recipe = file.recipe();
            let progress = crate::progress::Progress::none();
            let map = recipe
                .prepare(recipe.size, &file.files(false), &progress)
                .unwrap()
                .map(&progress)
                .unwrap();
            let found = lint_energy(&map, Some(&recipe.material), &[Model::Ward]);
            assert_eq!(found, [], "{}", preset.name);
        }
    }
}
