//! What lies under the cursor.

use crate::analyse::Place;
use crate::map::AnisoMap;
use crate::math;
use glam::{DVec2, Vec2};
use std::f32::consts::TAU;

/// Corners of the ellipse.
const CORNERS: usize = 64;

/// The texel at a place, for the status line.
#[derive(Clone, Debug, PartialEq)]
pub struct Probe {
    /// Which texel.
    pub texel: Place,
    /// Slope width along the x axis.
    pub alpha_x: f32,
    /// Slope width across it.
    pub alpha_y: f32,
    /// alpha_x / alpha_y.
    pub ratio: f32,
    /// Angle of the x axis, counter-clockwise from +U, in [0, 180).
    pub angle_degrees: f32,
    /// The lobe seen from above: a closed polygon around the origin, y up, whose farthest corners are at distance 1. It is wide
    /// where light is spread, so it stands across the grooves.
    pub ellipse: Vec<Vec2>,
}

impl Probe {
    /// The texel at a texture coordinate, v up; beyond the edges what the map's wrap says is there. `None` where the map ends
    /// before, and for coordinates that are not finite.
    pub fn at(map: &AnisoMap, uv: DVec2) -> Option<Self> {
        let place = |t: f64, n: u32, repeats: bool| {
            let t = if repeats { t - t.floor() } else { t };
            // Casts saturate; rounding may leave 1.
            (0.0..=1.0)
                .contains(&t)
                .then(|| ((t * f64::from(n)) as u32).min(n - 1))
        };
        let x = place(uv.x, map.width(), map.wrap().repeats_u())?;
        let y = place(1.0 - uv.y, map.height(), map.wrap().repeats_v())?;
        let texel = map.texel(x, y);
        let (along, across) = (texel.alpha_x, texel.alpha_y);
        let largest = along.max(across);
        let x_axis = texel.axis.direction();
        let ellipse = (0..CORNERS).map(|i| {
            let (sin, cos) = math::sin_cos(TAU * i as f32 / CORNERS as f32);
            (x_axis * (along * cos) + x_axis.perp() * (across * sin)) / largest
        });
        Some(Self {
            texel: Place { x, y },
            alpha_x: along,
            alpha_y: across,
            ratio: along / across,
            angle_degrees: texel.axis.degrees(),
            ellipse: ellipse.collect(),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::map::{Size, Texel, Wrap};
    use crate::math::Axis;

    fn map(wrap: Wrap) -> AnisoMap {
        let texel = Texel {
            alpha_x: 0.1,
            alpha_y: 0.4,
            axis: Axis::from_degrees(30.0),
        };
        let mut map = AnisoMap::constant(Size::new(8, 4).unwrap(), wrap, texel);
        map.region_mut().set(
            8 + 3,
            Texel {
                alpha_y: 0.05,
                ..texel
            },
        );
        map
    }

    #[test]
    fn it_reads_the_texel_under_the_cursor() {
        let probe = Probe::at(&map(Wrap::Clamp), DVec2::new(3.9 / 8.0, 0.6)).unwrap();
        assert_eq!(probe.texel, Place { x: 3, y: 1 });
        assert!((probe.ratio - 2.0).abs() < 1e-6 && (probe.angle_degrees - 30.0).abs() < 1e-3);
        assert!(Probe::at(&map(Wrap::Clamp), DVec2::new(1.01, 0.6)).is_none());
        assert!(Probe::at(&map(Wrap::Repeat), DVec2::NAN).is_none());
        let around = Probe::at(&map(Wrap::Repeat), DVec2::new(-7.0 + 3.5 / 8.0, 5.6)).unwrap();
        assert_eq!(around.texel, Place { x: 3, y: 1 });
        assert!(Probe::at(&map(Wrap::RepeatU), DVec2::new(9.1, 1.1)).is_none());
        assert!(Probe::at(&map(Wrap::Clamp), DVec2::ONE).is_some());
    }

    #[test]
    fn the_ellipse_is_that_of_the_slopes() {
        let map = map(Wrap::Repeat);
        let probe = Probe::at(&map, DVec2::new(0.01, 0.01)).unwrap();
        let farthest = probe
            .ellipse
            .iter()
            .copied()
            .max_by(|a, b| a.length().total_cmp(&b.length()))
            .unwrap();
        assert!((farthest.length() - 1.0).abs() < 1e-5);
        // Across the grooves, which lie at 30 degrees.
        let angle = farthest.y.atan2(farthest.x).to_degrees().rem_euclid(180.0);
        assert!((angle - 120.0).abs() < 1e-2, "{angle}");
        // Every corner has the same value of the covariance's form.
        let covariance = crate::map::SlopeCovariance::from(map.texel(0, 3));
        let (a, b, c) = (covariance.uu, covariance.uv, covariance.vv);
        let form =
            |p: Vec2| (c * p.x * p.x - 2.0 * b * p.x * p.y + a * p.y * p.y) / (a * c - b * b);
        let first = form(probe.ellipse[0]);
        assert!(
            probe
                .ellipse
                .iter()
                .all(|p| (form(*p) / first - 1.0).abs() < 1e-3)
        );
    }
}
