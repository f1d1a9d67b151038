//! Grooves around a centre: turned rings, spokes, or one spiral.

use super::grooves::{Chunk, Grooves, Plane, Streaks, for_chunks, with_grooves};
use super::{Fill, Parameter, Patch, Surface};
use crate::map::{Rect, RegionMut, Wrap};
use crate::math::{atan2, floor_fast, smoothstep};
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
    /// How far a ring runs before it changes, degrees of turn; for spokes, a length in hundredths of a surface unit.
    pub arc: f32,
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
        Parameter::new("arc", "degrees", 1.0..=3600.0, "how far a ring runs before it changes"),
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
        self.prepare_around(Vec2::from(self.center) * surface.extent(), surface, 2)
    }

    /// The same around a centre given in surface units; `purpose` tells the uses of one seed apart.
    pub(super) fn prepare_around(&self, center: Vec2, surface: &Surface, purpose: u32) -> Rings {
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
            texel,
        };
        if self.style == RadialStyle::Spokes {
            plane.direction = Vec2::Y;
            plane.length = self.arc / 100.0;
            plane.width = self.ring_spacing / (0.5 * TAU);
            plane.texel = texel / (0.5 * TAU);
        }
        // Under a texel there is no direction to tell.
        let cap = self.cap_radius.max(1.5 * texel);
        Rings {
            surface: *surface,
            center,
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

/// A prepared [`Radial`].
pub(super) struct Rings {
    surface: Surface,
    center: Vec2,
    style: RadialStyle,
    pitch: f32,
    feed_marks: f32,
    ridge_seen: f32,
    cap: f32,
    fade: f32,
    streaks: Streaks,
}

impl Rings {
    /// Puts the nth texel of a chunk at `p` (surface units) from the centre.
    fn place(&self, chunk: &mut Chunk, i: usize, p: Vec2) {
        let r = p.length();
        let turns = atan2(p.y, p.x) / TAU;
        chunk.a[i] = turns;
        chunk.b[i] = r;
        chunk.ln_gain[i] = 0.0;
        chunk.anisotropy[i] = smoothstep(self.cap, self.cap + self.fade, r);
        // Double angle of the radius; of the tangent, its opposite.
        let q = 1.0 / (r * r).max(1e-20);
        let (c, s) = if r > 0.0 {
            ((p.x * p.x - p.y * p.y) * q, 2.0 * p.x * p.y * q)
        } else {
            (1.0, 0.0)
        };
        (chunk.cos2[i], chunk.sin2[i]) = match self.style {
            RadialStyle::Spokes => (c, s),
            RadialStyle::Turned => (-c, -s),
            RadialStyle::Spiral => {
                // Outward by the pitch on the way around: the groove leans from the tangent toward the radius, so it turns
                // clockwise by atan(pitch / circumference).
                let slope = self.pitch / (TAU * r.max(1e-6));
                let k = 1.0 / (1.0 + slope * slope);
                let (lc, ls) = ((1.0 - slope * slope) * k, -2.0 * slope * k);
                // Phase of the ridge; the streaks follow the groove.
                let phase = r / self.pitch - turns;
                chunk.b[i] = r - self.pitch * turns;
                chunk.ln_gain[i] =
                    self.feed_marks * self.ridge_seen * (4.0 * triangle(phase) - 1.0);
                (-c * lc + s * ls, -s * lc - c * ls)
            }
        };
    }
}

/// 0 to 0.5 and back over each whole number.
fn triangle(x: f32) -> f32 {
    let f = x - floor_fast(x);
    f.min(1.0 - f)
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
        for_chunks(run.width, run.height, |column, row, n, offset| {
            for i in 0..n {
                let p = self
                    .surface
                    .position(run.x + column + i as u32, run.y + row);
                self.place(chunk, i, p - self.center);
            }
            self.streaks.fill(chunk, n, out, value, at + offset);
        });
    }
}

impl Fill for Rings {
    fn fill(&self, patch: &mut Patch<'_>) {
        patch.coverage.fill(1.0);
        let rect = patch.region.rect;
        self.fill_run(rect, 0, &mut Chunk::new(), &mut patch.region, patch.value);
    }
}
