//! Grooves around a centre: turned rings, spokes, or one spiral.

use super::grooves::{CHUNK, Chunk, Grooves, Plane, Streaks, for_chunks, with_grooves};
use super::{Fill, Parameter, Patch, Surface};
use crate::map::{Rect, RegionMut, Wrap};
use crate::math::{atan2, floor_fast, level, smoothstep};
use fearless_simd::{Simd, dispatch};
use fearless_simd_macros::simd;
use glam::Vec2;
use serde::{Deserialize, Serialize};
use std::f32::consts::TAU;

/// Which way the grooves run.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum RadialStyle {
    /// Circles around the centre, as a lathe leaves them.
    #[default]
    Turned,
    /// Straight lines out from the centre: a sunburst.
    Spokes,
    /// One groove that winds outward by `pitch` a turn.
    Spiral,
}

/// Grooves around a centre. Its value, for masks, is the noise from ring to ring (or spoke to spoke).
///
/// The direction is analytic everywhere. At the centre, where it is undefined, a round cap replaces it; the cap is never
/// smaller than 1.5 texels.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Radial {
    /// Which way the grooves run.
    pub style: RadialStyle,
    /// The centre, (u, v) in UV units.
    pub center: [f32; 2],
    /// Spacing of the broadest rings, surface units; for spokes, their width at radius 0.5.
    pub ring_spacing: f32,
    /// How far a ring runs before it changes, degrees of turn. Not for spokes.
    pub arc: f32,
    /// Length of the longest streaks of a spoke, surface units. Only for spokes.
    pub spoke_length: f32,
    /// Outward step of a spiral for one turn, surface units. Only for the spiral.
    pub pitch: f32,
    /// How strongly the spiral's ridge shows: relative swing of both widths over one pitch. Only for the spiral.
    pub feed_marks: f32,
    /// Radius of the round cap at the centre, surface units.
    pub cap_radius: f32,
    /// Width of the ring in which the cap fades into the grooves, surface units.
    pub cap_fade: f32,
    /// Slope width along the grooves (the narrow way of the lobe), root mean square.
    pub alpha_along: f32,
    /// Slope width across the grooves, root mean square.
    pub alpha_across: f32,
    /// Relative spread of `alpha_along` from ring to ring.
    pub spread_along: f32,
    /// Relative spread of `alpha_across` from ring to ring.
    pub spread_across: f32,
    /// Wander of the direction, degrees (standard deviation).
    pub wander: f32,
    /// Share of the surface where a groove is broken off.
    pub breaks: f32,
}

impl Default for Radial {
    fn default() -> Self {
        Self {
            style: RadialStyle::Turned,
            center: [0.5, 0.5],
            ring_spacing: 0.01,
            arc: 120.0,
            spoke_length: 0.8,
            pitch: 0.02,
            feed_marks: 0.2,
            cap_radius: 0.01,
            cap_fade: 0.02,
            alpha_along: 0.06,
            alpha_across: 0.25,
            spread_along: 0.1,
            spread_across: 0.25,
            wander: 0.5,
            breaks: 0.05,
        }
    }
}

impl Radial {
    pub(super) const PARAMETERS: &[Parameter] = with_grooves!("";
        Parameter::new("center", "UV units", -10.0..=10.0, "the centre"),
        Parameter::new("ring_spacing", "surface units", 1e-4..=10.0, "spacing of the broadest rings; of spokes, their width at radius 0.5"),
        Parameter::new("arc", "degrees", 1.0..=3600.0, "how far a ring runs before it changes; not for spokes"),
        Parameter::new("spoke_length", "surface units", 1e-3..=100.0, "length of the longest streaks of a spoke"),
        Parameter::new("pitch", "surface units", 1e-4..=10.0, "outward step of a spiral for one turn"),
        Parameter::fraction("feed_marks", "relative swing of both widths over one pitch of a spiral"),
        Parameter::new("cap_radius", "surface units", 0.0..=10.0, "radius of the round cap at the centre"),
        Parameter::new("cap_fade", "surface units", 0.0..=10.0, "width in which the cap fades into the grooves"),
    );

    fn grooves(&self) -> Grooves {
        Grooves {
            alpha_along: self.alpha_along,
            alpha_across: self.alpha_across,
            spread_along: self.spread_along,
            spread_across: self.spread_across,
            wander: self.wander,
            breaks: self.breaks,
        }
    }

    pub(super) fn prepare(&self, surface: &Surface) -> Rings {
        self.prepare_around(
            Vec2::from(self.center) * surface.extent(),
            f32::MAX,
            surface,
            2,
        )
    }

    /// The same around a centre given in surface units, seen again every `period` to the left and right; `purpose` tells the
    /// uses of one seed apart.
    pub(super) fn prepare_around(
        &self,
        center: Vec2,
        period: f32,
        surface: &Surface,
        purpose: u32,
    ) -> Rings {
        let texel = surface.texel().max_element();
        // The plane of the streaks is (turns, radius); it closes after one turn.
        let mut plane = Plane {
            direction: Vec2::X,
            length: self.arc / 360.0,
            width: self.ring_spacing,
            extent: Vec2::ONE,
            twist: if self.style == RadialStyle::Spiral {
                self.pitch
            } else {
                0.0
            },
            wrap: Wrap::RepeatU,
            // A turn is worth its circumference at radius 0.5.
            texel: [texel, texel / (0.5 * TAU)],
        };
        if self.style == RadialStyle::Spokes {
            plane.direction = Vec2::Y;
            plane.length = self.spoke_length;
            plane.width = self.ring_spacing / (0.5 * TAU);
            // Toward the centre spokes crowd: points enough for a third of that radius, set closer outside it.
            plane.texel = [texel / (SPOKES_RADIUS * TAU), texel];
        }
        // Under a texel there is no direction to tell.
        let cap = self.cap_radius.max(1.5 * texel);
        Rings {
            surface: *surface,
            center,
            period,
            style: self.style,
            pitch: self.pitch,
            feed_marks: self.feed_marks,
            // A ridge finer than two texels cannot be drawn; it fades into the mean.
            ridge_seen: smoothstep(1.5, 4.0, self.pitch / texel),
            cap,
            fade: self.cap_fade.max(texel),
            streaks: Streaks::new(&self.grooves(), &plane, surface, purpose),
        }
    }
}

/// The radius that spokes are met finely enough at.
const SPOKES_RADIUS: f32 = 0.17;

/// A prepared [`Radial`].
pub(super) struct Rings {
    surface: Surface,
    center: Vec2,
    period: f32,
    style: RadialStyle,
    pitch: f32,
    feed_marks: f32,
    ridge_seen: f32,
    cap: f32,
    fade: f32,
    streaks: Streaks,
}

impl Rings {
    /// Fills the rectangle `run`, whose texels begin at place `at` of `out` and follow one another.
    pub(super) fn fill_run(
        &self,
        run: Rect,
        at: usize,
        chunk: &mut Chunk,
        out: &mut RegionMut<'_>,
        value: &mut [f32],
    ) {
        let level = level();
        let (extent, size) = (self.surface.extent(), self.surface.size);
        let (w, h) = (size.width() as f32, size.height() as f32);
        let once = self.period == f32::MAX;
        for_chunks(run.width, run.height, |column, row, n, offset| {
            let first = (run.x + column) as i32;
            let y = (1.0 - ((run.y + row) as f32 + 0.5) / h) * extent.y - self.center.y;
            for (i, a) in chunk.a[..n].iter_mut().enumerate() {
                *a = ((first + i as i32) as f32 + 0.5) / w * extent.x - self.center.x;
            }
            chunk.b[..n].fill(y);
            for a in chunk.a[..n].iter_mut().filter(|_| !once) {
                *a -= self.period * (*a / self.period).round();
            }
            dispatch!(level, simd => to_polar(simd, self, chunk, n));
            self.streaks.fill(chunk, n, out, value, at + offset);
        });
    }
}

/// Turns the first `n` places of a chunk, given in surface units from the centre, into (turns, radius) and the direction
/// that the grooves have there.
#[simd]
fn to_polar<S: Simd>(_: S, rings: &Rings, chunk: &mut Chunk, n: usize) {
    // One formula for the three styles: a ring is a spiral without pitch, a spoke the ring's perpendicular.
    let (pitch, ridge) = match rings.style {
        RadialStyle::Spiral => (rings.pitch, rings.feed_marks * rings.ridge_seen),
        RadialStyle::Turned | RadialStyle::Spokes => (0.0, 0.0),
    };
    let along = if rings.style == RadialStyle::Spokes {
        1.0
    } else {
        -1.0
    };
    let turns_per_unit = 1.0 / rings.pitch;
    // The mean square of e^gain over a ridge, a gain that is even from -ridge to ridge: taken off, so that widths stay what
    // they are said to be, seen or not.
    let level = 0.5
        * ((2.0 * ridge).sinh() / (2.0 * ridge).max(1e-6))
            .max(1.0)
            .ln();
    let spokes = rings.style == RadialStyle::Spokes;
    for i in 0..n.min(CHUNK) {
        let (x, y) = (chunk.a[i], chunk.b[i]);
        // The very centre has to lie somewhere: a little to the right of itself.
        let x = if x * x + y * y < 1e-18 { 1e-9 } else { x };
        let square = x * x + y * y;
        let r = square.sqrt();
        let turns = atan2(y, x) * (1.0 / TAU);
        // Double angle of the radius; of the tangent, its opposite.
        let (c, s) = (
            along * (x * x - y * y) / square,
            along * 2.0 * x * y / square,
        );
        // Outward by the pitch on the way around: the groove leans from the tangent toward the radius, so it turns
        // clockwise by atan(pitch / circumference).
        let slope = pitch / (TAU * r);
        let k = 1.0 / (1.0 + slope * slope);
        let (lc, ls) = ((1.0 - slope * slope) * k, -2.0 * slope * k);
        chunk.a[i] = turns;
        chunk.b[i] = r - pitch * turns; // the streaks follow the groove
        chunk.cos2[i] = c * lc - s * ls;
        chunk.sin2[i] = s * lc + c * ls;
        chunk.anisotropy[i] = smoothstep(rings.cap, rings.cap + rings.fade, r);
        chunk.ln_gain[i] = ridge * (4.0 * triangle(r * turns_per_unit - turns) - 1.0) - level;
        chunk.reach[i] = if spokes {
            (SPOKES_RADIUS / r).min(20.0)
        } else {
            1.0
        };
    }
}

/// 0 to 0.5 and back over each whole number.
#[inline(always)]
fn triangle(x: f32) -> f32 {
    let f = x - floor_fast(x);
    f.min(1.0 - f)
}

impl Fill for Rings {
    fn fill(&self, patch: &mut Patch<'_>) {
        patch.coverage.fill(1.0);
        let rect = patch.region.rect;
        self.fill_run(rect, 0, &mut Chunk::new(), &mut patch.region, patch.value);
    }
}

#[cfg(test)]
mod tests {
    use super::super::tests::filled;
    use super::super::{Pattern, Surface};
    use super::*;
    use crate::map::{AnisoMap, Size};
    use crate::math::Axis;

    fn map(radial: Radial) -> AnisoMap {
        let surface = Surface {
            size: Size::new(256, 128).unwrap(),
            aspect: 2.0,
            wrap: Wrap::Clamp,
            seed: 1,
        };
        filled(&Pattern::Radial(radial), &surface, 4096).0
    }

    fn still(style: RadialStyle) -> Radial {
        Radial {
            style,
            wander: 0.0,
            breaks: 0.0,
            ..Default::default()
        }
    }

    /// The largest angle between the map's grooves and `want` at 60 places on a circle of the surface.
    fn off(map: &AnisoMap, radius: f32, want: impl Fn(f32) -> f32) -> f32 {
        (0..60)
            .map(|i| {
                let angle = i as f32 * TAU / 60.0;
                let p = Vec2::new(1.0, 0.5) + radius * Vec2::from_angle(angle);
                let groove = map.sample(p.x / 2.0, p.y).groove();
                groove
                    .angle_to(Axis::from_radians(want(angle)))
                    .to_degrees()
            })
            .fold(0.0, f32::max)
    }

    #[test]
    fn grooves_are_circles_spokes_or_a_winding_out_line_on_the_surface() {
        let quarter = TAU / 4.0;
        assert!(off(&map(still(RadialStyle::Turned)), 0.3, |a| a + quarter) < 0.5);
        assert!(off(&map(still(RadialStyle::Spokes)), 0.3, |a| a) < 0.5);
        let pitch = 0.2;
        let spiral = map(Radial {
            pitch,
            feed_marks: 0.0,
            ..still(RadialStyle::Spiral)
        });
        let lean = (pitch / (TAU * 0.3)).atan();
        assert!(off(&spiral, 0.3, |a| a + quarter - lean) < 0.5);
    }

    #[test]
    fn the_centre_is_round_and_the_cap_fades() {
        let map = map(Radial {
            cap_radius: 0.1,
            cap_fade: 0.1,
            ..still(RadialStyle::Turned)
        });
        assert!(map.sample(0.5, 0.5).ratio() < 1.01);
        assert!(
            map.sample(0.5 + 0.04, 0.5).ratio() < 1.01,
            "0.08 from the centre"
        );
        assert!(
            map.sample(0.5 + 0.125, 0.5).ratio() > 2.0,
            "0.25 from the centre"
        );
    }

    #[test]
    fn nothing_shows_where_the_turn_closes() {
        for style in [
            RadialStyle::Turned,
            RadialStyle::Spokes,
            RadialStyle::Spiral,
        ] {
            let map = map(Radial {
                ring_spacing: 0.05,
                pitch: 0.1,
                ..still(style)
            });
            // Left of the centre the angle jumps from -180 to 180 degrees.
            let jump = |y: f32, x: f32| {
                let (a, b) = (map.sample(x, y - 0.004), map.sample(x, y + 0.004));
                (a.alpha_y / b.alpha_y).ln().abs()
            };
            let along = |y: f32| {
                (0..40)
                    .map(|i| jump(y, 0.3 + 0.003 * i as f32))
                    .sum::<f32>()
            };
            let elsewhere = (1..12)
                .map(|k| along(0.5 + 0.02 * k as f32))
                .fold(0.0, f32::max);
            assert!(
                along(0.5) <= 1.5 * elsewhere + 1e-3,
                "{style:?}: {} against {elsewhere}",
                along(0.5)
            );
        }
    }
}
