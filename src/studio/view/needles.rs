//! The grooves as short lines on a grid, to be drawn over any view. They have no arrow heads: directions have no sign.

use super::Averages;
use super::camera::{Camera2d, extent};
use super::sampler::Sampler;
use crate::map::AnisoMap;
use crate::math;
use glam::{DVec2, Vec2};

/// How long a line is of a cell's side, when the texels under it are isotropic and at their most anisotropic.
const LENGTHS: [f32; 2] = [0.12, 0.86];
/// Cells on a canvas at the most.
const CELLS_MAX: f64 = 1e6;

/// A short line along the grooves.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Needle {
    /// Its ends in canvas pixels, y down.
    pub ends: [Vec2; 2],
    /// How anisotropic the mean lobe of its cell is: (a² - b²) / (a² + b²), 0 to 1. The longer the line.
    pub anisotropy: f32,
}

/// Lines for the whole canvas, one for each cell of about `spacing` pixels (8 to 1000), and each the mean of its cell. The cells are
/// fixed to the map, so that panning moves them along; where texels are larger than cells, each texel is one.
pub fn needles(
    map: &AnisoMap,
    averages: &Averages,
    camera: &Camera2d,
    spacing: f64,
) -> Vec<Needle> {
    let spacing = if spacing.is_finite() {
        spacing.clamp(8.0, 1000.0)
    } else {
        24.0
    };
    let per_texel = camera.pixels_per_texel();
    let cell = (spacing / per_texel).max(DVec2::ONE);
    let size = map.size();
    let (upper, lower) = (
        camera.texel_at(size, DVec2::ZERO) / cell,
        camera.texel_at(size, extent(camera.size)) / cell,
    );
    let mut first = upper.floor();
    let mut last = lower.ceil();
    if !camera.repeat {
        first = first.max(DVec2::ZERO);
        last = last.min((extent(size) / cell).ceil());
    }
    let count = (last - first).max(DVec2::ZERO);
    if count.x * count.y > CELLS_MAX {
        return Vec::new();
    }
    let columns = first.x as i64..last.x as i64;
    let rows = first.y as i64..last.y as i64;
    let cells = Camera2d {
        // A camera whose pixels are the cells, with cell (0, 0) at the map's corner.
        centre: {
            let middle = 0.5 * extent(camera.size) * cell / extent(size);
            DVec2::new(middle.x, 1.0 - middle.y)
        },
        zoom: 1.0 / cell.y,
        texel_aspect: cell.y / cell.x,
        ..*camera
    };
    let grid = [columns.clone(), rows.clone()];
    let sampler = Sampler::new(map, &averages.levels, map.wrap(), &cells, grid, false);
    let mut needles = Vec::new();
    let room = (cell * per_texel).min_element() as f32;
    let height = rows.clone().count();
    sampler.each_row(0..height, |j, seen| {
        if !sampler.sees_row(j) {
            return;
        }
        for (i, &[xx, yy, c, s]) in seen.iter().enumerate() {
            if !sampler.sees_column(i) {
                continue;
            }
            let place = DVec2::new(
                (columns.start + i as i64) as f64,
                (rows.start + j as i64) as f64,
            );
            let middle = camera.pixel_at(size, (place + 0.5) * cell).as_vec2();
            let length = (c * c + s * s).sqrt();
            let anisotropy = (length / (0.25 * (xx + yy)).max(1e-12)).clamp(0.0, 1.0);
            let (x, y) = if length > 0.0 {
                math::half_angle(-c / length, -s / length)
            } else {
                (1.0, 0.0)
            };
            let long =
                LENGTHS[0] + (LENGTHS[1] - LENGTHS[0]) * math::smoothstep(0.0, 0.8, anisotropy);
            let half = Vec2::new(x, -y) * (0.5 * long * room);
            needles.push(Needle {
                ends: [middle - half, middle + half],
                anisotropy,
            });
        }
    });
    needles
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::map::{Size, Texel, Wrap};
    use crate::math::Axis;

    fn map(n: u32, degrees: f32, alpha_y: f32) -> AnisoMap {
        let texel = Texel {
            alpha_x: 0.05,
            alpha_y,
            axis: Axis::from_degrees(degrees),
        };
        AnisoMap::constant(Size::new(n, n).unwrap(), Wrap::Repeat, texel)
    }

    #[test]
    fn lines_lie_along_the_grooves_and_their_length_tells_the_anisotropy() {
        let length = |alpha_y| {
            let map = map(64, 30.0, alpha_y);
            let camera = Camera2d::fit(map.size(), Size::new(240, 240).unwrap(), 1.0);
            let all = needles(&map, &Averages::new(&map), &camera, 24.0);
            assert_eq!(all.len(), 100);
            let along = all[37].ends[1] - all[37].ends[0];
            assert!((-along.y).atan2(along.x).to_degrees() - 30.0 < 0.1);
            along.length()
        };
        assert!(length(0.4) > 18.0 && length(0.4) > length(0.08));
        assert!(length(0.08) > length(0.05));
        assert!(length(0.05) > 2.0);
    }

    #[test]
    fn lines_move_with_the_map() {
        let map = map(64, 30.0, 0.4);
        let averages = Averages::new(&map);
        let mut camera = Camera2d::fit(map.size(), Size::new(300, 200).unwrap(), 1.0);
        camera.repeat = true;
        for zoom in [0.3, 3.0, 60.0] {
            camera.zoom = zoom;
            let by = Vec2::new(5.0, 3.0);
            let moved = camera.panned(map.size(), by.as_dvec2());
            let (a, b) = (
                needles(&map, &averages, &camera, 24.0),
                needles(&map, &averages, &moved, 24.0),
            );
            let near = |n: &&Needle| {
                let p = n.ends[0];
                p.x > 40.0 && p.x < 250.0 && p.y > 40.0 && p.y < 150.0
            };
            for needle in a.iter().filter(near) {
                let there = b
                    .iter()
                    .any(|m| (m.ends[0] - needle.ends[0] - by).length() < 1e-2);
                assert!(there, "zoom {zoom} {needle:?}");
            }
        }
    }

    #[test]
    fn a_map_far_away_has_few_lines_and_hostile_numbers_make_some() {
        let map = map(8, 0.0, 0.2);
        let averages = Averages::new(&map);
        let mut camera = Camera2d::fit(map.size(), Size::new(100, 100).unwrap(), 1.0);
        camera.zoom = 1e-9;
        assert!(needles(&map, &averages, &camera, 24.0).len() <= 1);
        camera.repeat = true;
        assert!(needles(&map, &averages, &camera, f64::NAN).len() < 100);
    }
}
