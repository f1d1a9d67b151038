//! A metal pot's finish: the wall brushed around or drawn along, the rim polished, bottom and floor turned, the handles drawn
//! along their length. One map for the whole layout of the built-in pot ([`crate::mesh::pot`]).

use super::grooves::{Chunk, Grooves, Plane, Streaks, for_chunks, with_grooves};
use super::lattice::{Lattice, seed32};
use super::radial::{Radial, Rings};
use super::{Fill, Parameter, Patch, Surface};
use crate::map::{Rect, RegionMut, Wrap};
use crate::math::{Axis, smoothstep};
use crate::mesh::pot::{BODY, BOTTOM, FLOOR, HANDLE_LEFT, HANDLE_RIGHT, INSIDE, Island, RIM};
use glam::Vec2;
use serde::{Deserialize, Serialize};
use std::f32::consts::TAU;

/// Which way the wall's grooves run.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum PotStyle {
    /// Around the pot: the highlight is drawn vertically over the whole height.
    #[default]
    Around,
    /// Up and down: the highlight is drawn around the pot.
    Along,
}

/// The turned bottom and floor.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Turned {
    /// Spacing of the broadest rings, surface units.
    pub ring_spacing: f32,
    /// Radius of the round cap at the centre, surface units.
    pub cap_radius: f32,
    /// Slope width along the rings.
    pub alpha_along: f32,
    /// Slope width across the rings.
    pub alpha_across: f32,
    /// Relative spread of the widths from ring to ring.
    pub spread: f32,
}

impl Default for Turned {
    fn default() -> Self {
        Self {
            ring_spacing: 0.008,
            cap_radius: 0.006,
            alpha_along: 0.05,
            alpha_across: 0.25,
            spread: 0.2,
        }
    }
}

/// A metal pot, for the layout of the pot mesh. Its value, for masks, is the streak noise.
///
/// Texels between the islands carry on the nearest one, so that no fetch at an island's border sees a foreign finish.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Pot {
    /// Which way the wall's grooves run.
    pub style: PotStyle,
    /// Length of the longest streaks on the wall, surface units.
    pub streak_length: f32,
    /// Width of the broadest streaks on the wall, surface units.
    pub streak_width: f32,
    /// Slope width along the wall's grooves, root mean square.
    pub alpha_along: f32,
    /// Slope width across the wall's grooves, root mean square.
    pub alpha_across: f32,
    /// Relative spread of `alpha_along` from streak to streak.
    pub spread_along: f32,
    /// Relative spread of `alpha_across` from streak to streak.
    pub spread_across: f32,
    /// Wander of the direction, degrees (standard deviation).
    pub wander: f32,
    /// Share of the wall where a groove is broken off.
    pub breaks: f32,
    /// Bands around the wall, one under the other, as passes of the brush leave them.
    pub bands: u32,
    /// Relative swing of both widths from band to band.
    pub band_depth: f32,
    /// Wear, 0 to 1: blotches, most of all at the foot and under the rim, where the brushing is rubbed rounder.
    pub wear: f32,
    /// Slope width along the rim's and the handles' grooves.
    pub fittings_alpha_along: f32,
    /// Slope width across the rim's and the handles' grooves.
    pub fittings_alpha_across: f32,
    /// The turned bottom and floor.
    pub bottom: Turned,
}

impl Default for Pot {
    fn default() -> Self {
        Self {
            style: PotStyle::Around,
            streak_length: 0.5,
            streak_width: 0.004,
            alpha_along: 0.06,
            alpha_across: 0.4,
            spread_along: 0.12,
            spread_across: 0.15,
            wander: 0.8,
            breaks: 0.06,
            bands: 3,
            band_depth: 0.06,
            wear: 0.15,
            fittings_alpha_along: 0.08,
            fittings_alpha_across: 0.16,
            bottom: Turned::default(),
        }
    }
}

impl Pot {
    pub(super) const PARAMETERS: &[Parameter] = with_grooves!("";
        Parameter::new("streak_length", "surface units", 1e-3..=100.0, "length of the longest streaks on the wall"),
        Parameter::new("streak_width", "surface units", 1e-4..=1.0, "width of the broadest streaks on the wall"),
        Parameter::new("bands", "", 0.0..=200.0, "bands around the wall, one under the other"),
        Parameter::fraction("band_depth", "relative swing of both widths from band to band"),
        Parameter::fraction("wear", "how much of the brushing is rubbed rounder, in blotches"),
        Parameter::alpha("fittings_alpha_along", "width along the rim's and the handles' grooves"),
        Parameter::alpha("fittings_alpha_across", "width across the rim's and the handles' grooves"),
        Parameter::new("bottom.ring_spacing", "surface units", 1e-4..=10.0, "spacing of the broadest rings of bottom and floor"),
        Parameter::new("bottom.cap_radius", "surface units", 0.0..=10.0, "radius of the round cap at their centre"),
        Parameter::alpha("bottom.alpha_along", "width along the rings"),
        Parameter::alpha("bottom.alpha_across", "width across the rings"),
        Parameter::fraction("bottom.spread", "relative spread of the widths from ring to ring"),
    );

    pub(super) fn prepare(&self, surface: &Surface) -> Finish {
        let wall =
            |island: Island, purpose: u32| Finished::Wall(self.wall(island, surface, purpose));
        let disc = |island: Island, purpose: u32| {
            Finished::Disc(self.disc().prepare_around(
                island.centre() * surface.extent(),
                surface.extent().x,
                surface,
                purpose,
            ))
        };
        let fitting =
            |island: Island, purpose: u32| Finished::Wall(self.fitting(island, surface, purpose));
        Finish {
            surface: *surface,
            parts: [
                (BODY, wall(BODY, 10)),
                (RIM, fitting(RIM, 11)),
                (INSIDE, wall(INSIDE, 12)),
                (BOTTOM, disc(BOTTOM, 13)),
                (FLOOR, disc(FLOOR, 14)),
                (HANDLE_RIGHT, fitting(HANDLE_RIGHT, 15)),
                (HANDLE_LEFT, fitting(HANDLE_LEFT, 16)),
            ],
        }
    }

    fn wall(&self, island: Island, surface: &Surface, purpose: u32) -> Wall {
        let grooves = Grooves {
            alpha_along: self.alpha_along,
            alpha_across: self.alpha_across,
            spread_along: self.spread_along,
            spread_across: self.spread_across,
            wander: self.wander,
            breaks: self.breaks,
        };
        let direction = match self.style {
            PotStyle::Around => Vec2::X,
            PotStyle::Along => Vec2::Y,
        };
        Wall {
            bands: self.bands as f32,
            band_depth: self.band_depth,
            wear: self.wear,
            ..Wall::new(
                &grooves,
                direction,
                (self.streak_length, self.streak_width),
                island,
                surface,
                purpose,
            )
        }
    }

    fn fitting(&self, island: Island, surface: &Surface, purpose: u32) -> Wall {
        let grooves = Grooves {
            alpha_along: self.fittings_alpha_along,
            alpha_across: self.fittings_alpha_across,
            spread_along: 0.1,
            spread_across: 0.1,
            wander: 0.5,
            breaks: 0.0,
        };
        Wall::new(
            &grooves,
            Vec2::X,
            (0.2, 0.5 * self.streak_width),
            island,
            surface,
            purpose,
        )
    }

    fn disc(&self) -> Radial {
        Radial {
            ring_spacing: self.bottom.ring_spacing,
            cap_radius: self.bottom.cap_radius,
            cap_fade: 2.0 * self.bottom.cap_radius,
            alpha_along: self.bottom.alpha_along,
            alpha_across: self.bottom.alpha_across,
            spread_along: 0.5 * self.bottom.spread,
            spread_across: self.bottom.spread,
            wander: 0.3,
            breaks: 0.03,
            ..Radial::default()
        }
    }
}

/// A prepared [`Pot`].
pub(super) struct Finish {
    surface: Surface,
    parts: [(Island, Finished); 7],
}

enum Finished {
    Wall(Wall),
    Disc(Rings),
}

impl Finish {
    /// The part whose island is nearest to a point of the layout, which goes around.
    fn nearest(&self, uv: Vec2) -> usize {
        let extent = self.surface.extent();
        let distance = |island: &Island| {
            let outside = (island.min - uv).max(uv - island.max).max(Vec2::ZERO);
            let around = outside
                .x
                .min((1.0 - outside.x - (island.max.x - island.min.x)).max(0.0));
            // From the left and the right at once, the shorter way counts.
            let x = if outside.x > 0.0 { around } else { 0.0 };
            (Vec2::new(x, outside.y) * extent).length_squared()
        };
        (0..self.parts.len())
            .min_by(|a, b| distance(&self.parts[*a].0).total_cmp(&distance(&self.parts[*b].0)))
            .expect("a pot has parts")
    }
}

impl Fill for Finish {
    fn fill(&self, patch: &mut Patch<'_>) {
        patch.coverage.fill(1.0);
        let rect = patch.region.rect;
        let mut chunk = Chunk::new();
        for row in 0..rect.height {
            let part = |x: u32| {
                self.nearest(
                    self.surface.position(rect.x + x, rect.y + row) / self.surface.extent(),
                )
            };
            let mut from = 0;
            while from < rect.width {
                let here = part(from);
                // An island that goes once around has its rows to itself; elsewhere the run ends where the nearest changes.
                let uv = self.surface.position(0, rect.y + row) / self.surface.extent();
                let island = &self.parts[here].0;
                let around =
                    island.contains(Vec2::new(0.0, uv.y)) && island.contains(Vec2::new(1.0, uv.y));
                let to = if around {
                    rect.width
                } else {
                    (from + 1..rect.width)
                        .find(|x| part(*x) != here)
                        .unwrap_or(rect.width)
                };
                let run = Rect {
                    x: rect.x + from,
                    y: rect.y + row,
                    width: to - from,
                    height: 1,
                };
                let at = (row * rect.width + from) as usize;
                match &self.parts[here].1 {
                    Finished::Wall(wall) => {
                        wall.fill(run, at, &mut chunk, &mut patch.region, patch.value);
                    }
                    Finished::Disc(rings) => {
                        rings.fill_run(run, at, &mut chunk, &mut patch.region, patch.value);
                    }
                }
                from = to;
            }
        }
    }
}

/// A part whose grooves run straight in the layout.
struct Wall {
    surface: Surface,
    island: Island,
    axis: Axis,
    streaks: Streaks,
    blotches: Lattice,
    bands: f32,
    band_depth: f32,
    wear: f32,
}

impl Wall {
    fn new(
        grooves: &Grooves,
        direction: Vec2,
        streak: (f32, f32),
        island: Island,
        surface: &Surface,
        purpose: u32,
    ) -> Self {
        let plane = Plane {
            direction,
            length: streak.0,
            width: streak.1,
            extent: surface.extent(),
            twist: 0.0,
            wrap: Wrap::RepeatU, // once around, whatever the map's edges do
            texel: [direction.perp(), direction].map(|way| (surface.texel() * way).length()),
        };
        let seed = seed32(surface.seed, 1000 + purpose);
        Self {
            surface: *surface,
            island,
            axis: Axis::from_vector(direction).unwrap_or_default(),
            streaks: Streaks::new(grooves, &plane, surface, purpose),
            blotches: Lattice::new(
                Vec2::X,
                0.12,
                0.05,
                surface.extent(),
                0.0,
                Wrap::RepeatU,
                seed,
            ),
            bands: 0.0,
            band_depth: 0.0,
            wear: 0.0,
        }
    }

    fn fill(
        &self,
        run: Rect,
        at: usize,
        chunk: &mut Chunk,
        out: &mut RegionMut<'_>,
        value: &mut [f32],
    ) {
        chunk.cos2.fill(self.axis.cos2);
        chunk.sin2.fill(self.axis.sin2);
        let y = self.surface.position(0, run.y).y;
        // How far up the island, 0 to 1.
        let height =
            ((y - self.island.min.y) / (self.island.max.y - self.island.min.y)).clamp(0.0, 1.0);
        let band = self.band_depth * (TAU * self.bands * height).sin();
        // Rubbed most near the foot and the rim.
        let edge = 1.0 - smoothstep(0.0, 0.12, height.min(1.0 - height));
        for_chunks(run.width, 1, |column, _, n, offset| {
            for i in 0..n {
                let x = self.surface.position(run.x + column + i as u32, run.y).x;
                let blotch = smoothstep(-0.1, 0.7, self.blotches.noise(x, y).0);
                let worn = self.wear * (0.35 * blotch + edge * (0.3 + 0.7 * blotch)).min(1.0);
                chunk.a[i] = x;
                chunk.b[i] = y;
                chunk.anisotropy[i] = 1.0 - 0.8 * worn;
                chunk.ln_gain[i] = band + 0.25 * worn;
                chunk.reach[i] = 1.0;
            }
            self.streaks.fill(chunk, n, out, value, at + offset);
        });
    }
}

#[cfg(test)]
mod tests {
    use super::super::Pattern;
    use super::super::tests::filled;
    use super::*;
    use crate::map::Size;
    use crate::mesh::pot::ASPECT;

    fn surface() -> Surface {
        Surface {
            size: Size::new(240, 200).unwrap(),
            aspect: ASPECT,
            wrap: Wrap::RepeatU,
            seed: 2,
        }
    }

    #[test]
    fn grooves_run_around_the_wall_or_along_it_and_around_the_bottoms_centre() {
        for (style, want) in [(PotStyle::Around, Axis::U), (PotStyle::Along, Axis::V)] {
            let pot = Pot {
                style,
                wander: 0.0,
                wear: 0.0,
                breaks: 0.0,
                ..Default::default()
            };
            let (map, ..) = filled(&Pattern::Pot(pot), &surface(), 4096);
            let at = |uv: Vec2| map.sample(uv.x, uv.y).groove();
            for u in [0.0, 0.3, 0.77] {
                assert!(
                    at(Vec2::new(u, BODY.centre().y)).angle_to(want) < 0.02,
                    "{style:?}"
                );
            }
            let radius = 0.35 * (BOTTOM.max - BOTTOM.min);
            assert!(at(BOTTOM.centre() + Vec2::new(radius.x, 0.0)).angle_to(Axis::V) < 0.05);
            assert!(at(BOTTOM.centre() + Vec2::new(0.0, radius.y)).angle_to(Axis::U) < 0.05);
            let diagonal = BOTTOM.centre() + radius * std::f32::consts::FRAC_1_SQRT_2;
            assert!(at(diagonal).angle_to(Axis::from_degrees(135.0)) < 0.05);
        }
    }

    #[test]
    fn the_wall_closes_around_the_pot() {
        let (map, ..) = filled(&Pattern::Pot(Pot::default()), &surface(), 4096);
        let rows = 5..50; // the wall
        let jump = |a: u32, b: u32| {
            rows.clone()
                .map(|y| {
                    (map.texel(a, y).alpha_y / map.texel(b, y).alpha_y)
                        .ln()
                        .abs()
                })
                .sum::<f32>()
        };
        let inside = (0..239).map(|x| jump(x, x + 1)).fold(0.0, f32::max);
        assert!(
            jump(239, 0) <= 1.2 * inside,
            "{} against {inside}",
            jump(239, 0)
        );
    }

    #[test]
    fn wear_makes_the_wall_rounder() {
        let ratio = |wear: f32| {
            let (map, ..) = filled(
                &Pattern::Pot(Pot {
                    wear,
                    ..Default::default()
                }),
                &surface(),
                4096,
            );
            (0..240 * 54).map(|i| map.texel_at(i).ratio()).sum::<f32>()
        };
        assert!(ratio(0.8) < 0.9 * ratio(0.0));
    }
}
