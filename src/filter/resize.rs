//! Making a map smaller without changing the light it reflects.
//!
//! Seen from afar, many texels reflect as one lobe whose slope covariance is the mean of theirs (Olano and Baker 2010), so
//! that is what is averaged, with exact area weights. Averaging widths and angles instead keeps the peak and gets the shape
//! wrong wherever directions differ.

use crate::error::{Error, Result};
use crate::map::{AnisoMap, DEFAULT_TEXEL, RegionMut, Size, SlopeCovariance, Texel};
use crate::math::Axis;
use glam::Vec2;
use rayon::prelude::*;
use std::ops::Range;

/// The map at a smaller size (or the same), each new texel the mean lobe of the area it covers.
///
/// The x axis keeps its name: it is the one along which the averaged texels have the variance of their own x axes.
///
/// # Errors
/// When `size` is larger than the map in either direction.
pub fn reduce(map: &AnisoMap, size: Size) -> Result<AnisoMap> {
    if size == map.size() {
        return Ok(map.clone());
    }
    if size.width() > map.width() || size.height() > map.height() {
        return Err(Error::invalid(
            "the reduced size",
            size,
            format!("allowed: at most the map's own {}", map.size()),
        ));
    }
    let mut out = AnisoMap::constant(size, map.wrap(), DEFAULT_TEXEL);
    let columns = spans(map.width(), size.width());
    let rows = spans(map.height(), size.height());
    out.bands_mut(1)
        .into_par_iter()
        .zip(rows)
        .for_each(|(band, span)| reduce_row(map, band, &span, &columns));
    Ok(out)
}

/// The source cells one target cell covers, and how much of the first and the last.
struct Span {
    cells: Range<u32>,
    first: f32,
    last: f32,
}

impl Span {
    /// In source cells.
    fn length(&self) -> f32 {
        self.cells.clone().map(|c| self.weight(c)).sum()
    }

    fn weight(&self, cell: u32) -> f32 {
        if cell == self.cells.start {
            self.first
        } else if cell + 1 == self.cells.end {
            self.last
        } else {
            1.0
        }
    }
}

/// Which of `from` cells each of `to` <= `from` cells covers; in whole numbers, so that integer factors are exact.
fn spans(from: u32, to: u32) -> Vec<Span> {
    let (from, to) = (u64::from(from), u64::from(to));
    (0..to)
        .map(|i| {
            let (start, end) = (i * from, (i + 1) * from); // in units of 1/to of a source cell
            let (first_cell, end_cell) = (start / to, end.div_ceil(to));
            let part = |n: u64| n as f32 / to as f32;
            let first = part(((first_cell + 1) * to).min(end) - start);
            let last = part(end - ((end_cell - 1) * to).max(start));
            let cell = |n: u64| u32::try_from(n).expect("inside the source");
            Span {
                cells: cell(first_cell)..cell(end_cell),
                first,
                last,
            }
        })
        .collect()
}

/// What is summed over an area.
#[derive(Clone, Copy, Default)]
struct Sum {
    lobe: SlopeCovariance,
    /// alpha_x² - alpha_y²: whose sign says which axis is x.
    x_excess: f32,
    axis: Vec2,
}

impl Sum {
    fn add(&mut self, other: Self, weight: f32) {
        self.lobe += other.lobe * weight;
        self.x_excess += other.x_excess * weight;
        self.axis += other.axis * weight;
    }
}

impl From<Texel> for Sum {
    fn from(t: Texel) -> Self {
        Self {
            lobe: t.into(),
            x_excess: t.alpha_x * t.alpha_x - t.alpha_y * t.alpha_y,
            axis: t.axis.double_angle(),
        }
    }
}

fn reduce_row(map: &AnisoMap, mut band: RegionMut<'_>, rows: &Span, columns: &[Span]) {
    let mut sums = vec![Sum::default(); columns.len()];
    for y in rows.cells.clone() {
        let start = y as usize * map.width() as usize;
        for (sum, column) in sums.iter_mut().zip(columns) {
            // A row at a time: in one sum of a million texels f32 loses a percent of a narrow width.
            let mut row = Sum::default();
            for x in column.cells.clone() {
                let texel = map.texel_at(start + x as usize);
                row.add(texel.into(), column.weight(x));
            }
            sum.add(row, rows.weight(y));
        }
    }
    for (i, (sum, column)) in sums.iter().zip(columns).enumerate() {
        let share = 1.0 / (rows.length() * column.length());
        let axis = Axis::from_double_angle(sum.axis * share).unwrap_or_default();
        band.set(i, (sum.lobe * share).to_texel(sum.x_excess > 0.0, axis));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::map::Wrap;
    use proptest::prelude::*;

    fn brushed(width: u32, height: u32) -> AnisoMap {
        let mut map = AnisoMap::constant(
            Size::new(width, height).unwrap(),
            Wrap::Repeat,
            DEFAULT_TEXEL,
        );
        let mut region = map.region_mut();
        for i in 0..(width * height) as usize {
            let t = i as f32;
            region.set(
                i,
                Texel {
                    alpha_x: 0.05 + 0.03 * (t * 0.7).sin(),
                    alpha_y: 0.3 + 0.1 * (t * 1.3).cos(),
                    axis: Axis::from_degrees(175.0 + 9.0 * (t * 2.1).sin()),
                },
            );
        }
        map
    }

    fn mean(map: &AnisoMap) -> SlopeCovariance {
        let n = map.size().texels();
        let mut sum = SlopeCovariance::default();
        (0..n).for_each(|i| sum += SlopeCovariance::from(map.texel_at(i)) * (1.0 / n as f32));
        sum
    }

    #[test]
    fn crossed_grooves_become_round_and_parallel_ones_stay() {
        let mut map = brushed(4, 2);
        let mut region = map.region_mut();
        for i in 0..8 {
            // The left half crossed, the right half parallel at 30 degrees.
            let degrees = if i % 4 < 2 { [0.0, 90.0][i % 2] } else { 30.0 };
            region.set(
                i,
                Texel {
                    alpha_x: 0.1,
                    alpha_y: 0.4,
                    axis: Axis::from_degrees(degrees),
                },
            );
        }
        let small = reduce(&map, Size::new(2, 1).unwrap()).unwrap();
        let round = small.texel(0, 0);
        assert!((round.alpha_x - 0.085f32.sqrt()).abs() < 1e-5 && round.ratio() < 1.0001);
        let kept = small.texel(1, 0);
        assert!((kept.alpha_x - 0.1).abs() < 1e-5 && (kept.alpha_y - 0.4).abs() < 1e-5);
        assert!((kept.axis.degrees() - 30.0).abs() < 1e-3);
    }

    #[test]
    fn a_large_area_keeps_its_digits() {
        let texel = Texel {
            alpha_x: 0.1,
            alpha_y: 0.3,
            axis: Axis::from_degrees(20.0),
        };
        let map = AnisoMap::constant(Size::new(1024, 1024).unwrap(), Wrap::Repeat, texel);
        let one = reduce(&map, Size::new(1, 1).unwrap()).unwrap().texel(0, 0);
        assert!((one.alpha_x / 0.1 - 1.0).abs() < 1e-3, "{one:?}");
        assert!(one.axis.angle_to(texel.axis).to_degrees() < 0.01, "{one:?}");
    }

    #[test]
    fn the_same_size_is_the_same_map_and_larger_is_refused() {
        let map = brushed(5, 3);
        assert_eq!(reduce(&map, map.size()).unwrap(), map);
        let e = reduce(&map, Size::new(6, 3).unwrap()).unwrap_err();
        assert!(e.to_string().contains("6x3") && e.to_string().contains("5x3"));
    }

    proptest! {
        #[test]
        fn the_mean_lobe_of_the_whole_is_kept(w in 1u32..40, h in 1u32..40, a in 0.0f64..1.0, b in 0.0f64..1.0) {
            let map = brushed(w, h);
            let side = |n: u32, t: f64| 1 + (f64::from(n - 1) * t) as u32;
            let small = reduce(&map, Size::new(side(w, a), side(h, b)).unwrap()).unwrap();
            let (want, got) = (mean(&map), mean(&small));
            prop_assert!((want.uu / got.uu - 1.0).abs() < 1e-4);
            prop_assert!((want.vv / got.vv - 1.0).abs() < 1e-4);
            prop_assert!((want.uv - got.uv).abs() < 1e-4 * want.vv);
            // Names are kept: the grooves still run along x.
            prop_assert!((0..small.size().texels()).all(|i| small.texel_at(i).alpha_x < small.texel_at(i).alpha_y));
        }

        #[test]
        fn spans_cover_every_cell_once(from in 1u32..200, t in 0.0f64..1.0) {
            let to = 1 + (f64::from(from - 1) * t) as u32;
            let mut covered = vec![0.0; from as usize];
            for span in spans(from, to) {
                prop_assert!((span.length() - from as f32 / to as f32).abs() < 1e-3);
                span.cells.clone().for_each(|c| covered[c as usize] += span.weight(c));
            }
            prop_assert!(covered.iter().all(|c| (c - 1.0f32).abs() < 1e-4));
        }
    }
}
