//! Straight brushing: streaks of limited length, all one way.

use super::grooves::{Chunk, Grooves, Plane, Streaks, for_chunks, with_grooves};
use super::{Fill, Parameter, Patch, Surface};
use crate::math::Axis;
use glam::Vec2;
use serde::{Deserialize, Serialize};

/// Straight brushing. Its value, for masks, is the streak noise that varies `alpha_across`.
///
/// On a surface that repeats, the streaks are turned by the small angle (under half a streak's width over the surface) that
/// makes them close over the edges; the direction that is written is the one asked for.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Brushed {
    /// Direction of the grooves, degrees counter-clockwise from +U.
    pub angle: f32,
    /// Length of the longest streaks, surface units.
    pub streak_length: f32,
    /// Width of the broadest streaks, surface units; finer ones, down to a quarter of it, lie within.
    pub streak_width: f32,
    /// Slope width along the grooves (the narrow way of the lobe), root mean square.
    pub alpha_along: f32,
    /// Slope width across the grooves, root mean square.
    pub alpha_across: f32,
    /// Relative spread of `alpha_along` from streak to streak.
    pub spread_along: f32,
    /// Relative spread of `alpha_across` from streak to streak.
    pub spread_across: f32,
    /// Wander of the direction, degrees (standard deviation).
    pub wander: f32,
    /// Share of the surface where a groove is broken off.
    pub breaks: f32,
}

impl Default for Brushed {
    fn default() -> Self {
        let Grooves {
            alpha_along,
            alpha_across,
            spread_along,
            spread_across,
            wander,
            breaks,
        } = Grooves::default();
        Self {
            angle: 0.0,
            streak_length: 0.4,
            streak_width: 0.008,
            alpha_along,
            alpha_across,
            spread_along,
            spread_across,
            wander,
            breaks,
        }
    }
}

impl Brushed {
    pub(super) const PARAMETERS: &[Parameter] = with_grooves!("";
        Parameter::angle("angle", "direction of the grooves"),
        Parameter::new("streak_length", "surface units", 1e-3..=100.0, "length of the longest streaks"),
        Parameter::new("streak_width", "surface units", 1e-4..=1.0, "width of the broadest streaks"),
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

    pub(super) fn prepare(&self, surface: &Surface) -> Straight {
        let axis = Axis::from_degrees(self.angle);
        let direction = axis.direction();
        let plane = Plane {
            direction,
            length: self.streak_length,
            width: self.streak_width,
            extent: surface.extent(),
            twist: 0.0,
            wrap: surface.wrap,
            texel: [direction.perp(), direction].map(|way| (surface.texel() * way).length()),
        };
        Straight {
            surface: *surface,
            axis,
            streaks: Streaks::new(&self.grooves(), &plane, surface, 1),
        }
    }
}

/// A prepared [`Brushed`].
pub(super) struct Straight {
    surface: Surface,
    axis: Axis,
    streaks: Streaks,
}

impl Fill for Straight {
    fn fill(&self, patch: &mut Patch<'_>) {
        patch.coverage.fill(1.0);
        let rect = patch.region.rect;
        let mut chunk = Chunk::new();
        chunk.cos2.fill(self.axis.cos2);
        chunk.sin2.fill(self.axis.sin2);
        let step = self.surface.texel().x;
        for_chunks(rect.width, rect.height, |column, row, n, at| {
            let Vec2 { y, .. } = self.surface.position(0, rect.y + row);
            for i in 0..n {
                chunk.a[i] = ((rect.x + column + i as u32) as f32 + 0.5) * step;
            }
            chunk.b.fill(y);
            self.streaks
                .fill(&chunk, n, &mut patch.region, patch.value, at);
        });
    }
}
