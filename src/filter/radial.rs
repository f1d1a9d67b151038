//! A map that looks the same all around a centre, as a table along the radius: turned parts, discs, records.
//!
//! The table is a map of one row from the centre outward whose axes are told against the outward direction. Laid back, each texel
//! blends its two neighbours in the table and turns the axis by its own azimuth, so directions are exact at any size where a
//! small map's would bend between texels.

use crate::map::{AnisoMap, DEFAULT_TEXEL, Size, SlopeCovariance, Texel, Wrap};
use crate::math::{self, Axis};
use glam::Vec2;
use rayon::prelude::*;
use std::f32::consts::TAU;

/// The fewest and the most directions in which a sample of the table looks.
const AROUND: (f32, f32) = (16.0, 720.0);

/// Where a table lies on the surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Disc {
    /// The centre, in UV units.
    pub center: Vec2,
    /// How far the table's end lies from the centre, in surface units (the height of one turn of UV is 1), over 0. Beyond it
    /// the last sample goes on.
    pub reach: f32,
    /// The surface's width over its height for one turn of UV, over 0.
    pub aspect: f32,
}

impl Disc {
    /// The disc around a centre that holds the whole map.
    pub fn around(center: Vec2, aspect: f32) -> Self {
        let corners = [Vec2::ZERO, Vec2::X, Vec2::Y, Vec2::ONE];
        let away = |corner: Vec2| ((corner - center) * Vec2::new(aspect, 1.0)).length();
        Self {
            center,
            reach: corners
                .into_iter()
                .map(away)
                .fold(f32::MIN_POSITIVE, f32::max),
            aspect,
        }
    }

    /// The outward direction at (u, v), v up, and the place in the table, 0 at the centre and 1 at its end. At the centre
    /// itself the direction is +U.
    fn polar(&self, u: f32, v: f32) -> (Axis, f32) {
        let p = (Vec2::new(u, v) - self.center) * Vec2::new(self.aspect, 1.0);
        (
            Axis::from_vector(p).unwrap_or_default(),
            p.length() / self.reach,
        )
    }

    /// The mean lobes of a map in `samples` rings of equal width, as a map of one row.
    ///
    /// # Errors
    /// When there are no samples, or more than a map may have columns.
    pub fn table(&self, map: &AnisoMap, samples: u32) -> crate::error::Result<AnisoMap> {
        let size = Size::new(samples, 1)?;
        let mut table = AnisoMap::constant(size, Wrap::Clamp, DEFAULT_TEXEL);
        let rings: Vec<Option<Texel>> = (0..samples)
            .into_par_iter()
            .map(|i| self.ring(map, (i as f32 + 0.5) / samples as f32))
            .collect();
        let mut region = table.region_mut();
        // Rings outside the map, which nothing will ask for, go on as the last one inside.
        let mut last = rings
            .iter()
            .flatten()
            .next()
            .copied()
            .unwrap_or(DEFAULT_TEXEL);
        for (i, ring) in rings.into_iter().enumerate() {
            last = ring.unwrap_or(last);
            region.set(i, last);
        }
        Ok(table)
    }

    /// The mean lobe all around at a place of the table; `None` where that is nowhere inside the map.
    fn ring(&self, map: &AnisoMap, place: f32) -> Option<Texel> {
        let radius = place * self.reach;
        let around = (TAU * radius * map.height() as f32).clamp(AROUND.0, AROUND.1) as u32;
        let (mut sum, mut excess, mut axis, mut inside) =
            (SlopeCovariance::default(), 0.0, Vec2::ZERO, 0.0);
        for i in 0..around {
            // Half a step aside: no direction along an edge of the texels.
            let (sin, cos) = math::sin_cos(TAU * (i as f32 + 0.5) / around as f32);
            let p = self.center + radius * Vec2::new(cos / self.aspect, sin);
            if p.cmplt(Vec2::ZERO).any() || p.cmpgt(Vec2::ONE).any() {
                continue;
            }
            let texel = map.sample(p.x, p.y);
            let back = Axis {
                cos2: cos * cos - sin * sin,
                sin2: -2.0 * sin * cos,
            };
            let turned = Texel {
                axis: texel.axis.turned(back),
                ..texel
            };
            sum += turned.into();
            excess += texel.alpha_x * texel.alpha_x - texel.alpha_y * texel.alpha_y;
            axis += turned.axis.double_angle();
            inside += 1.0;
        }
        let fallback = Axis::from_double_angle(axis / inside).unwrap_or_default();
        (inside > 0.0).then(|| (sum * (1.0 / inside)).to_texel(excess > 0.0, fallback))
    }

    /// The texel at (u, v), v up.
    pub fn texel(&self, table: &AnisoMap, u: f32, v: f32) -> Texel {
        let (outward, place) = self.polar(u, v);
        let texel = table.sample(place, 0.5);
        Texel {
            axis: texel.axis.turned(outward),
            ..texel
        }
    }

    /// The whole map again, of any size.
    pub fn lay(&self, table: &AnisoMap, size: Size, wrap: Wrap) -> AnisoMap {
        let mut map = AnisoMap::unfilled(size, wrap);
        map.bands_mut(16).into_par_iter().for_each(|mut band| {
            let rect = band.rect;
            for y in rect.y..rect.y + rect.height {
                for x in 0..rect.width {
                    let (u, v) = center_of(size, x, y);
                    band.set(rect.index(x, y), self.texel(table, u, v));
                }
            }
        });
        map
    }
}

/// (u, v) of a texel's centre, v up.
pub(crate) fn center_of(size: Size, x: u32, y: u32) -> (f32, f32) {
    (
        (x as f32 + 0.5) / size.width() as f32,
        1.0 - (y as f32 + 0.5) / size.height() as f32,
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    fn turned(size: Size, aspect: f32) -> AnisoMap {
        let mut map = AnisoMap::constant(size, Wrap::Clamp, DEFAULT_TEXEL);
        let mut region = map.region_mut();
        for y in 0..size.height() {
            for x in 0..size.width() {
                let (u, v) = center_of(size, x, y);
                let p = Vec2::new((u - 0.4) * aspect, v - 0.5);
                let outward = Axis::from_vector(p).unwrap_or_default();
                let texel = Texel {
                    alpha_x: 0.05 + 0.02 * (20.0 * p.length()).sin(),
                    alpha_y: 0.3,
                    axis: outward.turned(Axis::from_degrees(70.0)),
                };
                region.set((y * size.width() + x) as usize, texel);
            }
        }
        map
    }

    #[test]
    fn a_turned_map_is_its_table() {
        for aspect in [1.0, 2.0] {
            let size = Size::new(200, 160).unwrap();
            let map = turned(size, aspect);
            let disc = Disc::around(Vec2::new(0.4, 0.5), aspect);
            let table = disc.table(&map, 256).unwrap();
            let t = table.texel(100, 0);
            assert!(
                (t.axis.degrees() - 70.0).abs() < 0.2,
                "{}",
                t.axis.degrees()
            );
            let back = disc.lay(&table, size, Wrap::Clamp);
            for i in 0..size.texels() {
                let (x, y) = (i as u32 % 200, i as u32 / 200);
                let (a, b) = (map.texel(x, y), back.texel(x, y));
                let (u, v) = center_of(size, x, y);
                let radius = Vec2::new((u - 0.4) * aspect, v - 0.5).length();
                // Near the centre texels are coarser than the field is.
                if radius > 0.05 {
                    assert!((a.alpha_x / b.alpha_x - 1.0).abs() < 0.02, "{a:?} {b:?}");
                    assert!(a.axis.angle_to(b.axis).to_degrees() < 0.5, "{a:?} {b:?}");
                }
            }
        }
    }

    #[test]
    fn a_centre_outside_the_map_and_tiny_maps_are_fine() {
        let map = turned(Size::new(1, 1).unwrap(), 1.0);
        for center in [Vec2::new(-3.0, 0.5), Vec2::new(0.5, 9.0), Vec2::ZERO] {
            let disc = Disc::around(center, 1.0);
            for samples in [1, 7] {
                let table = disc.table(&map, samples).unwrap();
                let back = disc.lay(&table, Size::new(5, 4).unwrap(), Wrap::Repeat);
                assert!(back.alpha_x().iter().all(|a| a.is_finite()));
                assert!(back.cos2().iter().all(|c| c.abs() <= 1.0));
            }
        }
        assert!(Disc::around(Vec2::ZERO, 1.0).table(&map, 0).is_err());
    }
}
