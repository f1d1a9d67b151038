//! How far a reduced map's light can be from the full one's, in closed form, before anything is drawn.
//!
//! A lobe is exp(-k) over 4 pi alpha_x alpha_y. As far out as it still shows over the diffuse light, k is at most
//! k_max = ln(peak / 1 % of the diffuse light), 4 to 7 for metals over some diffuse. There a relative change d of a width changes
//! k by 2 k_max d and the norm by d, and a turn by delta changes k by k_max delta (rho - 1/rho), rho the ratio of the widths. So a
//! lobe changes by at most e^dk - 1. That is the error of one lobe seen at its worst; how much of a picture it is depends on the
//! model and the scene, so pictures decide, and the closed form saves drawing what is far under the tolerance even at its worst.

use super::Metric;
use crate::brdf::Model;
use crate::convention::Stretched;
use crate::error::Result;
use crate::filter::reduce;
use crate::map::{AnisoMap, Size, Texel};
use crate::recipe::Material;
use std::borrow::Cow;
use std::f32::consts::PI;

/// Points along a side at which two maps are compared.
const POINTS: u32 = 61;
/// A prediction this many times smaller is clearly under it, at its worst pixel too.
const CLEAR: f32 = 200.0;
/// The largest change of an exponent that is told apart from a larger one.
const DK_MAX: f32 = 20.0;

/// Predicts relative changes of light against one full map.
pub(super) struct Predictor {
    /// The full map as coarse as the picture can show.
    seen: AnisoMap,
    k_max: f32,
    /// The peak of the typical lobe over the diffuse light.
    contrast: f32,
    /// alpha_x alpha_y of the typical lobe.
    area: f32,
}

impl Predictor {
    /// `picture` is the size of the picture in pixels: a map of twice as many texels shows all that it can.
    pub(super) fn new(map: &AnisoMap, material: &Material, picture: Size) -> Result<Self> {
        let twice = Size::new(
            map.width().min(2 * picture.width()),
            map.height().min(2 * picture.height()),
        )?;
        let typical = super::form::typical(map);
        let brightest = |colour: [f32; 3]| colour.into_iter().fold(0.0, f32::max);
        // Black surfaces are seen against the dark of the picture, about 1 % of white.
        let diffuse = brightest(material.diffuse).max(0.01) / PI;
        let peak = brightest(material.specular) / (4.0 * PI * typical.alpha_x * typical.alpha_y);
        let contrast = peak / diffuse;
        Ok(Self {
            seen: as_coarse(map, twice)?.into_owned(),
            k_max: (100.0 * contrast).max(1.0).ln().clamp(0.0, 12.0),
            contrast,
            area: typical.alpha_x * typical.alpha_y,
        })
    }

    /// The exponent at which a lobe still shows.
    pub(super) fn k_max(&self) -> f32 {
        self.k_max
    }

    /// e^dk - 1 of the mean change of the exponent between the maps, measured over a grid of points.
    ///
    /// # Errors
    /// None: both maps are reduced to sizes that they have room for.
    pub(super) fn of_map(&self, map: &AnisoMap) -> Result<f32> {
        if self.contrast == 0.0 {
            return Ok(0.0);
        }
        let map = as_coarse(map, self.seen.size())?;
        let mut sum = 0.0;
        for j in 0..POINTS {
            for i in 0..POINTS {
                let at = |n: u32| (n as f32 + 0.37) / POINTS as f32;
                let (a, b) = (self.seen.sample(at(i), at(j)), map.sample(at(i), at(j)));
                sum += change_of_exponent(a, b, self.k_max);
            }
        }
        Ok((sum / (POINTS * POINTS) as f32).min(DK_MAX).exp_m1())
    }

    /// The same of a model in place of another: for Ward's two forms (3/4) k_max² alpha_x alpha_y; without the specular term, all of it.
    pub(super) fn of_model(&self, from: Model, to: Model) -> Option<f32> {
        match (from, to) {
            (Model::Ward, Model::WardExact) => Some(
                (0.75 * self.k_max * self.k_max * self.area)
                    .min(DK_MAX)
                    .exp_m1(),
            ),
            (_, Model::Lambert) => Some(self.contrast),
            _ => None,
        }
    }
}

/// A map that is nowhere finer than `size`.
fn as_coarse(map: &AnisoMap, size: Size) -> Result<Cow<'_, AnisoMap>> {
    let coarse = Size::new(
        map.width().min(size.width()),
        map.height().min(size.height()),
    )?;
    Ok(if coarse == map.size() {
        Cow::Borrowed(map)
    } else {
        Cow::Owned(reduce(map, coarse)?)
    })
}

fn change_of_exponent(a: Texel, b: Texel, k_max: f32) -> f32 {
    let rho = a.ratio().max(b.ratio());
    let (a, b) = (Stretched::from(a), Stretched::from(b));
    let wide = (b.alpha_t / a.alpha_t).ln();
    let narrow = (b.alpha_b / a.alpha_b).ln();
    let turn = a.axis.angle_to(b.axis) * (rho - 1.0 / rho);
    let dk = k_max * (2.0 * wide.abs().max(narrow.abs()) + turn) + (wide + narrow).abs();
    dk.min(DK_MAX)
}

/// Whether a prediction is so far under the tolerance that drawing it alone tells nothing.
pub(super) fn is_clear(metric: Metric, predicted: f32, tolerance: f32) -> bool {
    CLEAR * usual(metric, predicted) < tolerance
}

/// The mean error that a prediction means: three of four pictures of the presets have at most as much.
fn usual(metric: Metric, predicted: f32) -> f32 {
    match metric {
        Metric::Flip => predicted / 35.0,
        Metric::De => predicted / 8.0,
        Metric::Luminance => predicted / 100.0,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::map::Wrap;
    use crate::math::Axis;

    fn texel(alpha_x: f32, alpha_y: f32, degrees: f32) -> Texel {
        Texel {
            alpha_x,
            alpha_y,
            axis: Axis::from_degrees(degrees),
        }
    }

    fn map(t: Texel) -> AnisoMap {
        AnisoMap::constant(Size::new(16, 16).unwrap(), Wrap::Repeat, t)
    }

    #[test]
    fn changes_are_those_of_the_closed_forms() {
        let material = Material::default();
        let full = map(texel(0.1, 0.4, 20.0));
        let p = Predictor::new(&full, &material, Size::new(64, 64).unwrap()).unwrap();
        // Peak 0.19 / (4 pi 0.04) over 0.15 / pi, times 100.
        assert!((p.k_max() - 792f32.ln()).abs() < 0.01, "{}", p.k_max());
        let of_map = |m: &AnisoMap| p.of_map(m).unwrap();
        assert_eq!(of_map(&full), 0.0);
        assert!(
            of_map(&map(texel(0.4, 0.1, 110.0))) < 1e-4,
            "the same lobe by another name"
        );
        let turned = of_map(&map(texel(0.1, 0.4, 20.5)));
        let want = (p.k_max() * 0.5f32.to_radians() * (4.0 - 0.25)).exp_m1();
        assert!((turned / want - 1.0).abs() < 0.01, "{turned} {want}");
        let wider = of_map(&map(texel(0.101, 0.4, 20.0)));
        let want = ((2.0 * p.k_max() + 1.0) * 1.01f32.ln()).exp_m1();
        assert!((wider / want - 1.0).abs() < 0.01, "{wider} {want}");
        assert!(of_map(&map(texel(0.1, 0.4, 110.0))).is_finite());
        let dull = Material {
            specular: [0.0; 3],
            ..material
        };
        let q = Predictor::new(&full, &dull, Size::new(64, 64).unwrap()).unwrap();
        assert_eq!(q.of_map(&map(texel(0.5, 0.5, 0.0))).unwrap(), 0.0);
        assert_eq!(q.of_model(Model::Ward, Model::Lambert), Some(0.0));
    }

    #[test]
    fn only_what_is_far_under_is_clear() {
        assert!(is_clear(Metric::Flip, 1e-3, 0.01) && !is_clear(Metric::Flip, 1e-2, 0.01));
        assert!(is_clear(Metric::De, 1e-2, 0.5) && !is_clear(Metric::De, 1.0, 0.5));
    }
}
