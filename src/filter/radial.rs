//! A map that looks the same all around a centre, as a table along the radius: turned parts, discs, records.
//!
//! The table is a map of one row from the centre outward whose axes are told against the outward direction. Laid back, each texel
//! blends its two neighbours in the table and turns the axis by its own azimuth, so directions are exact at any size where a
//! small map's would bend between texels.

use crate::map::{ALPHA_MAX, ALPHA_MIN, AnisoMap, DEFAULT_TEXEL, Size, Texel, Wrap};
use crate::math::{self, Axis};
use glam::{DVec2, Vec2};
use rayon::prelude::*;

/// Bands of rows that threads take; fixed, since the sums depend on where the cuts lie.
const BANDS: u32 = 32;

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

    /// What is typical of a map in `samples` rings of equal width, as a map of one row.
    ///
    /// # Errors
    /// When there are no samples, or more than a map may have columns.
    pub fn table(&self, map: &AnisoMap, samples: u32) -> crate::error::Result<AnisoMap> {
        let size = Size::new(samples, 1)?;
        let mut table = AnisoMap::constant(size, Wrap::Clamp, DEFAULT_TEXEL);
        let rings = self.rings(map, samples as usize);
        let mut region = table.region_mut();
        for (i, texel) in settled(&rings).into_iter().enumerate() {
            region.set(i, texel);
        }
        Ok(table)
    }

    /// What lies in each ring. A texel counts where its centre lies, so that nothing is blurred but inside a ring.
    fn rings(&self, map: &AnisoMap, samples: usize) -> Vec<Ring> {
        let rows = map.height().div_ceil(BANDS);
        let bands: Vec<Vec<Ring>> = (0..BANDS)
            .into_par_iter()
            .map(|band| {
                let mut rings = vec![Ring::default(); samples];
                let end = ((band + 1) * rows).min(map.height());
                for y in (band * rows).min(end)..end {
                    self.add_row(map, y, &mut rings);
                }
                rings
            })
            .collect();
        let mut sum = vec![Ring::default(); samples];
        for band in bands {
            sum.iter_mut().zip(band).for_each(|(s, b)| s.merge(b));
        }
        sum
    }

    fn add_row(&self, map: &AnisoMap, y: u32, rings: &mut [Ring]) {
        for x in 0..map.width() {
            let (u, v) = center_of(map.size(), x, y);
            let (outward, place) = self.polar(u, v);
            let ring = (place * rings.len() as f32) as usize;
            if let Some(ring) = rings.get_mut(ring) {
                let texel = map.texel(x, y);
                let back = Axis {
                    sin2: -outward.sin2,
                    ..outward
                };
                ring.add(texel, texel.axis.turned(back));
            }
        }
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

/// Sums over the texels of a ring.
#[derive(Clone, Copy, Default)]
struct Ring {
    texels: f64,
    ln_x: f64,
    ln_y: f64,
    /// Double angles against the outward direction, each counted by how far its texel is from round.
    axis: DVec2,
}

impl Ring {
    fn add(&mut self, texel: Texel, axis: Axis) {
        self.texels += 1.0;
        self.ln_x += f64::from(math::ln(texel.alpha_x));
        self.ln_y += f64::from(math::ln(texel.alpha_y));
        let weight = (texel.alpha_x - texel.alpha_y).abs();
        self.axis += (axis.double_angle() * weight).as_dvec2();
    }

    fn merge(&mut self, other: Self) {
        self.texels += other.texels;
        self.ln_x += other.ln_x;
        self.ln_y += other.ln_y;
        self.axis += other.axis;
    }

    /// The common axis, where the texels have one.
    fn axis(&self) -> Option<Axis> {
        let mean = self.axis / self.texels.max(1.0);
        (mean.length() > 1e-4).then(|| Axis::from_double_angle(mean.normalize().as_vec2()))?
    }
}

/// A texel for each ring. The widths are geometric means: an edge that is drawn around the centre stays as sharp as it is, where
/// a mean lobe would take in the blends of directions across it. Rings that have no direction take that of the nearest which
/// has, since a table is blended between its samples; those outside the map, which nothing asks for, go on as the last inside.
fn settled(rings: &[Ring]) -> Vec<Texel> {
    let directed: Vec<usize> = (0..rings.len())
        .filter(|i| rings[*i].axis().is_some())
        .collect();
    let axis_near = |i: usize| {
        let after = directed.partition_point(|d| *d < i);
        let near = [after.checked_sub(1), Some(after)].into_iter().flatten();
        near.filter_map(|n| directed.get(n))
            .min_by_key(|d| d.abs_diff(i))
            .and_then(|d| rings[*d].axis())
    };
    let inside = rings.iter().find(|r| r.texels > 0.0).copied();
    let mut last = inside.unwrap_or_default();
    let mut texels = Vec::with_capacity(rings.len());
    for (i, ring) in rings.iter().enumerate() {
        if ring.texels > 0.0 {
            last = *ring;
        }
        let width = |ln: f64| math::exp((ln / last.texels) as f32).clamp(ALPHA_MIN, ALPHA_MAX);
        texels.push(if last.texels > 0.0 {
            Texel {
                alpha_x: width(last.ln_x),
                alpha_y: width(last.ln_y),
                axis: axis_near(i).unwrap_or_default(),
            }
        } else {
            DEFAULT_TEXEL
        });
    }
    texels
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
