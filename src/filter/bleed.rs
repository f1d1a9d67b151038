//! Directions for round texels, from what surrounds them.
//!
//! The direction of a round texel shows in no light, but a renderer's filter blends it into its neighbours; so what is
//! written there should point where they do.

use super::comb::{Combed, ROUND};
use crate::map::AnisoMap;
use glam::Vec2;
use rayon::prelude::*;

/// Texels a cell of the finest level is wide and high.
const CELL: usize = 8;

/// Sums of signed directions, weighted by eccentricity, over cells of 8, 16, 32 ... texels a side.
pub struct Surroundings {
    levels: Vec<Level>,
}

struct Level {
    width: usize,
    cells: Vec<Vec2>,
}

impl Surroundings {
    /// Sums up the whole map; `None` when no texel is round and nothing needs filling.
    pub fn new(combed: &Combed<'_>) -> Option<Self> {
        let map = combed.map();
        let (w, h) = (map.width() as usize, map.height() as usize);
        let any_round = map
            .alpha_x()
            .par_iter()
            .zip(map.alpha_y())
            .any(|(x, y)| is_round(*x, *y));
        if !any_round {
            return None;
        }
        let width = w.div_ceil(CELL);
        let mut cells = vec![Vec2::ZERO; width * h.div_ceil(CELL)];
        cells
            .par_chunks_mut(width)
            .enumerate()
            .for_each(|(j, row)| {
                let (mut cos, mut sin) = (vec![0.0; w], vec![0.0; w]);
                for y in j * CELL..(j * CELL + CELL).min(h) {
                    combed.row(y as u32, &mut cos, &mut sin);
                    for x in 0..w {
                        row[x / CELL] += Vec2::new(cos[x], sin[x]) * weight(map, y * w + x);
                    }
                }
            });
        let mut levels = vec![Level { width, cells }];
        while let Some(coarser) = levels.last().and_then(Level::coarser) {
            levels.push(coarser);
        }
        Some(Self { levels })
    }

    /// The mean direction in the smallest cell around the texel that has one, as a unit vector; `None` in a map without any.
    pub fn direction(&self, x: u32, y: u32) -> Option<Vec2> {
        self.levels.iter().enumerate().find_map(|(i, level)| {
            let cell = CELL << i;
            let sum = level.cells[y as usize / cell * level.width + x as usize / cell];
            // A cell whose arrows cancel asks the next larger one.
            (sum.length() > 1e-4).then(|| sum.normalize())
        })
    }
}

/// Whether a texel's direction shows in no light.
pub fn is_round(alpha_x: f32, alpha_y: f32) -> bool {
    (alpha_x - alpha_y).abs() < ROUND * (alpha_x + alpha_y)
}

fn weight(map: &AnisoMap, i: usize) -> f32 {
    let (x, y) = (map.alpha_x()[i], map.alpha_y()[i]);
    if is_round(x, y) {
        0.0
    } else {
        (x - y).abs() / (x + y)
    }
}

impl Level {
    fn coarser(&self) -> Option<Self> {
        let height = self.cells.len() / self.width;
        if self.width == 1 && height == 1 {
            return None;
        }
        let width = self.width.div_ceil(2);
        let mut cells = vec![Vec2::ZERO; width * height.div_ceil(2)];
        for (i, cell) in self.cells.iter().enumerate() {
            cells[i / self.width / 2 * width + i % self.width / 2] += *cell;
        }
        Some(Self { width, cells })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::filter::{Line, comb};
    use crate::map::{DEFAULT_TEXEL, Size, Texel, Wrap};
    use crate::math::Axis;

    #[test]
    fn a_round_hole_takes_the_direction_around_it() {
        let groove = Texel {
            alpha_x: 0.1,
            alpha_y: 0.3,
            axis: Axis::from_degrees(70.0),
        };
        let mut map = AnisoMap::constant(Size::new(70, 45).unwrap(), Wrap::Clamp, groove);
        assert!(Surroundings::new(&comb(&map, Line::X)).is_none());
        let mut region = map.region_mut();
        for i in (0..70 * 45).filter(|i| i % 70 > 20 && i / 70 > 11) {
            region.set(i, DEFAULT_TEXEL);
        }
        let combed = comb(&map, Line::X);
        let around = Surroundings::new(&combed).unwrap();
        for (x, y) in [(21, 12), (69, 44), (40, 30)] {
            let d = around.direction(x, y).unwrap();
            assert!(d.dot(groove.axis.direction()) > 0.9999, "{x} {y} {d}");
        }
    }

    #[test]
    fn a_map_without_directions_has_none() {
        let map = AnisoMap::constant(Size::new(9, 1).unwrap(), Wrap::Clamp, DEFAULT_TEXEL);
        let combed = comb(&map, Line::Stretched);
        assert_eq!(Surroundings::new(&combed).unwrap().direction(8, 0), None);
    }
}
