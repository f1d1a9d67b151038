//! The smoothest field by multigrid.
//!
//! Solved is -Δz + w z = f for the two parts of the double angle at once, on cells of one surface: five-point differences
//! in surface units, around the edge where the map repeats and without flow over it where not. Levels are cell-centred and
//! halved, ⌈n/2⌉ of n cells: of an odd number the coarse cells are a little less than two fine ones wide, so that every level
//! covers the surface evenly and is its own mirror image. A residual goes down by the area that cells share, a correction
//! comes up bilinearly; their orders together exceed that of the operator (Briggs, Henson and McCormick 2000, "A Multigrid
//! Tutorial", chapters 3 and 5; Mohr and Wienands 2004 for cell-centred levels). Smoothing is two Jacobi steps whose lengths
//! are the roots of a Chebyshev polynomial over the upper three quarters of the spectrum: unlike Gauss and Seidel's it knows
//! no order of cells, so a mirrored or quarter-turned problem has the mirrored or turned solution, and any number of threads
//! gives the same bits.

use crate::error::Result;
use crate::map::{Size, Wrap};
use crate::math::level as cpu_level;
use crate::progress::Progress;
use fearless_simd::{Level as Cpu, Simd, dispatch};
use fearless_simd_macros::simd;
use rayon::prelude::*;

/// Jacobi steps: 1 / (5/4 ± 3/4 cos 45°).
const STEPS: [f32; 2] = [1.389_193_5, 0.561_777_9];
/// Cells that one thread takes at a time.
const BAND_CELLS: usize = 1 << 15;
/// Numbers whose largest is found side by side.
const LANES: usize = 8;

/// Which rows and columns of one level share area with those of the next coarser one, along one axis.
struct Transfer {
    /// Per coarse cell: its first fine cell, and the parts of it that up to three fine cells make.
    down: Vec<(usize, [f32; 3])>,
    /// Per fine cell: the two coarse cells beside its centre, and the part of the second.
    up: Vec<([usize; 2], f32)>,
}

impl Transfer {
    fn new(fine: usize, repeats: bool) -> Self {
        let coarse = fine.div_ceil(2);
        // Lengths in units of 1 / coarse of a fine cell: a coarse cell is `fine` long, a fine one `coarse`.
        let down = (0..coarse).map(|i| {
            let (from, to) = (i * fine, (i + 1) * fine);
            let first = from / coarse;
            let shared = |k: usize| {
                let (a, b) = ((first + k) * coarse, (first + k + 1) * coarse);
                b.min(to).saturating_sub(a.max(from)) as f32 / fine as f32
            };
            (first, [shared(0), shared(1), shared(2)])
        });
        let up = (0..fine).map(|i| {
            // The centre, in units of half a fine cell's part: (i + 1/2) coarse / fine - 1/2.
            let centre = ((2 * i + 1) * coarse) as i64 - fine as i64;
            let length = 2 * fine as i64;
            let (cell, part) = (centre.div_euclid(length), centre.rem_euclid(length));
            let n = coarse as i64;
            let fold = |c: i64| {
                let c = if repeats {
                    c.rem_euclid(n)
                } else {
                    c.clamp(0, n - 1)
                };
                usize::try_from(c).expect("folded into the level")
            };
            ([fold(cell), fold(cell + 1)], part as f32 / length as f32)
        });
        Self {
            down: down.collect(),
            up: up.collect(),
        }
    }
}

/// One level: the equation, its solution, and room for the next step's.
struct Level {
    width: usize,
    height: usize,
    wrap: Wrap,
    /// One over the squared sides of a cell.
    across: f32,
    upward: f32,
    /// w.
    weight: Vec<f32>,
    /// f, both parts.
    wanted: [Vec<f32>; 2],
    /// z, both parts.
    field: [Vec<f32>; 2],
    next: [Vec<f32>; 2],
    /// To the next coarser level; none from the coarsest.
    columns: Option<Transfer>,
    rows: Option<Transfer>,
}

/// A row and its neighbours above and below.
struct Neighbours<'a> {
    middle: &'a [f32],
    above: &'a [f32],
    below: &'a [f32],
}

impl Level {
    fn new(width: usize, height: usize, extent: [f32; 2], wrap: Wrap) -> Self {
        let n = width * height;
        let planes = || [vec![0.0; n], vec![0.0; n]];
        let per_square = |n: usize, extent: f32| (n as f32 / extent) * (n as f32 / extent);
        let coarsest = width == 1 && height == 1;
        Self {
            width,
            height,
            wrap,
            across: per_square(width, extent[0]),
            upward: per_square(height, extent[1]),
            weight: vec![0.0; n],
            wanted: planes(),
            field: planes(),
            next: planes(),
            columns: (!coarsest).then(|| Transfer::new(width, wrap.repeats_u())),
            rows: (!coarsest).then(|| Transfer::new(height, wrap.repeats_v())),
        }
    }

    /// Rows of a band.
    fn band(&self) -> usize {
        (BAND_CELLS / self.width).max(1)
    }

    fn neighbours<'a>(&self, plane: &'a [f32], y: usize) -> Neighbours<'a> {
        let row = |y: usize| &plane[y * self.width..(y + 1) * self.width];
        let (last, around) = (self.height - 1, self.wrap.repeats_v());
        let above = match y {
            0 if around => last,
            0 => 0,
            _ => y - 1,
        };
        let below = match y {
            _ if y < last => y + 1,
            _ if around => 0,
            _ => last,
        };
        Neighbours {
            middle: row(y),
            above: row(above),
            below: row(below),
        }
    }

    /// The columns to the left of the first and to the right of the last.
    fn edges(&self) -> (usize, usize) {
        if self.wrap.repeats_u() {
            (self.width - 1, 0)
        } else {
            (0, self.width - 1)
        }
    }

    /// One Jacobi step of this length; the most that any number moved.
    fn step(&mut self, length: f32) -> f32 {
        let mut next = std::mem::take(&mut self.next);
        let [first, second] = &mut next;
        let rows = self.band();
        let cells = rows * self.width;
        let this = &*self;
        let cpu = cpu_level();
        let most = first
            .par_chunks_mut(cells)
            .zip(second.par_chunks_mut(cells))
            .enumerate()
            .map(|(band, (first, second))| {
                let parts = [first, second];
                let mut most = 0.0f32;
                for (part, out) in parts.into_iter().enumerate() {
                    for (i, out) in out.chunks_mut(this.width).enumerate() {
                        most = most.max(this.step_row(cpu, part, band * rows + i, length, out));
                    }
                }
                most
            })
            .reduce(|| 0.0, f32::max);
        self.next = std::mem::replace(&mut self.field, next);
        most
    }

    fn equation(&self, part: usize, y: usize) -> Equation<'_> {
        let range = y * self.width..(y + 1) * self.width;
        Equation {
            weight: &self.weight[range.clone()],
            wanted: &self.wanted[part][range],
            across: self.across,
            upward: self.upward,
            edges: self.edges(),
        }
    }

    fn step_row(&self, cpu: Cpu, part: usize, y: usize, length: f32, out: &mut [f32]) -> f32 {
        let near = self.neighbours(&self.field[part], y);
        let row = self.equation(part, y);
        dispatch!(cpu, simd => jacobi(simd, &near, &row, length, out))
    }

    /// The residual of a row.
    fn residual_row(&self, cpu: Cpu, part: usize, y: usize, out: &mut [f32]) {
        let near = self.neighbours(&self.field[part], y);
        let row = self.equation(part, y);
        dispatch!(cpu, simd => residual(simd, &near, &row, out));
    }

    /// Brings rows of this level down to the coarser one: `row(y, out)` writes row y.
    fn restrict(&self, coarse: &mut [f32], row: impl Fn(usize, &mut [f32]) + Sync) {
        let (columns, rows) = match (&self.columns, &self.rows) {
            (Some(c), Some(r)) => (c, r),
            _ => return,
        };
        let width = columns.down.len();
        let lines = (BAND_CELLS / (4 * width)).max(1);
        let bands = coarse.par_chunks_mut(width * lines).enumerate();
        bands.for_each_init(
            || (vec![0.0; self.width], vec![0.0; self.width]),
            |(one, sum), (band, out)| {
                for (j, out) in out.chunks_mut(width).enumerate() {
                    let (first, parts) = &rows.down[band * lines + j];
                    sum.fill(0.0);
                    for (k, part) in parts.iter().enumerate().filter(|(_, p)| **p > 0.0) {
                        row(first + k, one);
                        for (s, r) in sum.iter_mut().zip(one.iter()) {
                            *s += part * r;
                        }
                    }
                    gather(sum, &columns.down, out);
                }
            },
        );
    }

    /// Adds the coarser level's field to this one's, or puts it in its place; the most that any number moved.
    fn prolong(&mut self, coarse: &Self, add: bool) -> f32 {
        let (columns, rows) = match (&self.columns, &self.rows) {
            (Some(c), Some(r)) => (c, r),
            _ => return 0.0,
        };
        let band = (BAND_CELLS / self.width).max(1);
        let width = self.width;
        let mut most = 0.0;
        for (field, source) in self.field.iter_mut().zip(&coarse.field) {
            let bands = field.par_chunks_mut(band * width).enumerate();
            let moved = bands
                .map_init(
                    || vec![0.0; coarse.width],
                    |line, (b, out)| {
                        let mut most = 0.0f32;
                        for (i, out) in out.chunks_mut(width).enumerate() {
                            let ([upper, lower], part) = rows.up[b * band + i];
                            let row = |j: usize| &source[j * coarse.width..(j + 1) * coarse.width];
                            for ((l, a), b) in line.iter_mut().zip(row(upper)).zip(row(lower)) {
                                *l = a * (1.0 - part) + b * part;
                            }
                            most = most.max(spread(line, &columns.up, add, out));
                        }
                        most
                    },
                )
                .reduce(|| 0.0, f32::max);
            most = f32::max(most, moved);
        }
        most
    }

    /// The one cell of the coarsest level: no neighbours, so w z = f.
    fn solve_alone(&mut self) {
        let w = self.weight[0];
        for (z, f) in self.field.iter_mut().zip(&self.wanted) {
            z[0] = if w > 0.0 { f[0] / w } else { 0.0 };
        }
    }
}

/// What a row of the equation says.
struct Equation<'a> {
    weight: &'a [f32],
    wanted: &'a [f32],
    across: f32,
    upward: f32,
    /// The columns beyond the left and right edge.
    edges: (usize, usize),
}

/// The cell at `i` with its neighbours at `l` and `r`: -(differences to the neighbours), and the diagonal.
#[inline(always)]
fn differences(near: &Neighbours<'_>, row: &Equation<'_>, l: usize, i: usize, r: usize) -> f32 {
    let z = near.middle[i];
    let across = (near.middle[l] - z) + (near.middle[r] - z);
    let upward = (near.above[i] - z) + (near.below[i] - z);
    row.across * across + row.upward * upward
}

/// One Jacobi step of a row; the most that any number moved.
#[simd]
fn jacobi<S: Simd>(
    _: S,
    near: &Neighbours<'_>,
    row: &Equation<'_>,
    length: f32,
    out: &mut [f32],
) -> f32 {
    let n = out.len();
    let (middle, above, below) = (&near.middle[..n], &near.above[..n], &near.below[..n]);
    let (weight, wanted) = (&row.weight[..n], &row.wanted[..n]);
    let (across, upward) = (row.across, row.upward);
    let fixed = 2.0 * (across + upward);
    let mut most = [0.0f32; LANES];
    let mut i = 1;
    while i + LANES < n {
        let (left, right) = (&middle[i - 1..][..LANES], &middle[i + 1..][..LANES]);
        let (z, up, down) = (
            &middle[i..][..LANES],
            &above[i..][..LANES],
            &below[i..][..LANES],
        );
        let (w, f) = (&weight[i..][..LANES], &wanted[i..][..LANES]);
        let to = &mut out[i..][..LANES];
        for k in 0..LANES {
            let flow = across * ((left[k] - z[k]) + (right[k] - z[k]))
                + upward * ((up[k] - z[k]) + (down[k] - z[k]));
            let moved = length * ((f[k] - w[k] * z[k]) + flow) / (fixed + w[k]);
            to[k] = z[k] + moved;
            let moved = moved.abs();
            most[k] = if moved > most[k] { moved } else { most[k] };
        }
        i += LANES;
    }
    let mut rest = |l: usize, i: usize, r: usize| {
        let flow = differences(near, row, l, i, r);
        let moved = length * ((wanted[i] - weight[i] * middle[i]) + flow) / (fixed + weight[i]);
        out[i] = middle[i] + moved;
        most[0] = most[0].max(moved.abs());
    };
    for i in i..n.saturating_sub(1) {
        rest(i - 1, i, i + 1);
    }
    let (left, right) = row.edges;
    if n > 1 {
        rest(left, 0, 1);
        rest(n - 2, n - 1, right);
    } else {
        rest(0, 0, 0);
    }
    most.into_iter().fold(0.0, f32::max)
}

/// f - w z + Δz of a row.
#[simd]
fn residual<S: Simd>(_: S, near: &Neighbours<'_>, row: &Equation<'_>, out: &mut [f32]) {
    let n = out.len();
    let (middle, above, below) = (&near.middle[..n], &near.above[..n], &near.below[..n]);
    let (weight, wanted) = (&row.weight[..n], &row.wanted[..n]);
    let (across, upward) = (row.across, row.upward);
    for i in 1..n.saturating_sub(1) {
        let z = middle[i];
        let flow = across * ((middle[i - 1] - z) + (middle[i + 1] - z))
            + upward * ((above[i] - z) + (below[i] - z));
        out[i] = (wanted[i] - weight[i] * z) + flow;
    }
    let mut rest = |l: usize, i: usize, r: usize| {
        out[i] = (wanted[i] - weight[i] * middle[i]) + differences(near, row, l, i, r);
    };
    let (left, right) = row.edges;
    if n > 1 {
        rest(left, 0, 1);
        rest(n - 2, n - 1, right);
    } else {
        rest(0, 0, 0);
    }
}

/// A fine row into a coarse one.
fn gather(fine: &[f32], down: &[(usize, [f32; 3])], out: &mut [f32]) {
    let last = fine.len() - 1;
    for (o, (first, parts)) in out.iter_mut().zip(down) {
        let at = |k: usize| fine[(first + k).min(last)] * parts[k];
        *o = at(0) + at(1) + at(2);
    }
}

/// A coarse row into a fine one; the most that any number moved.
fn spread(coarse: &[f32], up: &[([usize; 2], f32)], add: bool, out: &mut [f32]) -> f32 {
    let mut most = 0.0f32;
    for (o, ([a, b], part)) in out.iter_mut().zip(up) {
        let value = coarse[*a] * (1.0 - part) + coarse[*b] * part;
        most = most.max(value.abs());
        *o = if add { *o + value } else { value };
    }
    most
}

/// All levels of one grid, kept from solve to solve.
pub(super) struct Levels {
    levels: Vec<Level>,
}

/// How a solve ended.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Solved {
    /// Cycles over all levels.
    pub cycles: u32,
    /// The most that the last cycle turned a direction of full length, in degrees.
    pub change: f32,
    /// Whether `change` is within the tolerance; if not, the cycles ran out.
    pub settled: bool,
}

/// The most cycles of one solve. A cycle takes off nine tenths of the error and more, so this is never the end of a sane one.
const CYCLES_MAX: u32 = 60;

impl Levels {
    /// Levels for a grid over a surface of this aspect, holding nothing.
    pub(super) fn new(grid: Size, aspect: f32, wrap: Wrap) -> Self {
        let (mut width, mut height) = (grid.width() as usize, grid.height() as usize);
        let mut levels = vec![Level::new(width, height, [aspect, 1.0], wrap)];
        while width > 1 || height > 1 {
            (width, height) = (width.div_ceil(2), height.div_ceil(2));
            levels.push(Level::new(width, height, [aspect, 1.0], wrap));
        }
        Self { levels }
    }

    /// The finest level's weight and wanted field, rows of the grid from the top, to be filled before a solve.
    pub(super) fn equation_mut(&mut self) -> (&mut [f32], &mut [f32], &mut [f32]) {
        let finest = &mut self.levels[0];
        let [cos2, sin2] = &mut finest.wanted;
        (&mut finest.weight, cos2, sin2)
    }

    /// The solution, (cos 2θ, sin 2θ) of any length, rows from the top.
    pub(super) fn field(&self) -> [&[f32]; 2] {
        let [cos2, sin2] = &self.levels[0].field;
        [cos2, sin2]
    }

    /// Solves from the coarsest level up; or from the last solution, where `warm`.
    ///
    /// # Errors
    /// [`crate::Error::Cancelled`] when `progress`, asked once a cycle, says so; the next solve may still start warm.
    pub(super) fn solve(
        &mut self,
        tolerance: f32,
        warm: bool,
        progress: &Progress<'_>,
    ) -> Result<Solved> {
        self.coarsen_weights();
        if !warm {
            self.start(progress)?;
        }
        let mut solved = Solved {
            cycles: 0,
            change: f32::INFINITY,
            settled: false,
        };
        while !solved.settled && solved.cycles < CYCLES_MAX {
            progress.check()?;
            let moved = cycle(&mut self.levels);
            solved.cycles += 1;
            // Half the double angle.
            solved.change = 0.5 * moved.to_degrees();
            solved.settled = solved.change <= tolerance;
        }
        Ok(solved)
    }

    fn coarsen_weights(&mut self) {
        for i in 1..self.levels.len() {
            let (fine, coarse) = self.levels.split_at_mut(i);
            let (fine, coarse) = (&fine[i - 1], &mut coarse[0]);
            let row = |y: usize| y * fine.width..(y + 1) * fine.width;
            fine.restrict(&mut coarse.weight, |y, out| {
                out.copy_from_slice(&fine.weight[row(y)]);
            });
        }
    }

    /// A first field: every level solved in turn, each from the field of the one below it.
    fn start(&mut self, progress: &Progress<'_>) -> Result<()> {
        for i in 1..self.levels.len() {
            let (fine, coarse) = self.levels.split_at_mut(i);
            let (fine, coarse) = (&fine[i - 1], &mut coarse[0]);
            let row = |y: usize| y * fine.width..(y + 1) * fine.width;
            for part in 0..2 {
                fine.restrict(&mut coarse.wanted[part], |y, out| {
                    out.copy_from_slice(&fine.wanted[part][row(y)]);
                });
            }
        }
        for i in (0..self.levels.len()).rev() {
            progress.check()?;
            if let Some((level, coarser)) = self.levels[i..].split_first_mut()
                && let Some(coarse) = coarser.first()
            {
                level.prolong(coarse, false);
            }
            cycle(&mut self.levels[i..]);
        }
        Ok(())
    }
}

/// One V-cycle over these levels, the finest first; the most that any number of the finest moved.
fn cycle(levels: &mut [Level]) -> f32 {
    let Some((level, coarser)) = levels.split_first_mut() else {
        return 0.0;
    };
    let Some(coarse) = coarser.first_mut() else {
        level.solve_alone();
        return 0.0;
    };
    let mut moved = STEPS
        .map(|length| level.step(length))
        .into_iter()
        .sum::<f32>();
    let cpu = cpu_level();
    for part in 0..2 {
        level.restrict(&mut coarse.wanted[part], |y, out| {
            level.residual_row(cpu, part, y, out);
        });
        coarse.field[part].fill(0.0);
    }
    cycle(coarser);
    moved += level.prolong(&coarser[0], true);
    moved
        + STEPS
            .map(|length| level.step(length))
            .into_iter()
            .sum::<f32>()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A number from 0 to 1 made of two whole ones.
    fn noise(i: usize, j: usize) -> f32 {
        let h = (i as u32)
            .wrapping_mul(0x9e37_79b1)
            .wrapping_add((j as u32).wrapping_mul(0x85eb_ca77));
        let h = (h ^ (h >> 15)).wrapping_mul(0x2c1b_3c6d);
        (h ^ (h >> 13)) as f32 / u32::MAX as f32
    }

    /// The largest error of an equation's rows over their diagonals, in f64.
    fn residual_of(level: &Level) -> f64 {
        let (w, h) = (level.width, level.height);
        let (mut worst, mut largest) = (0.0f64, 0.0f64);
        for part in 0..2 {
            for y in 0..h {
                for x in 0..w {
                    let at = |x: i64, y: i64| {
                        let column = level.wrap.column(x, w as u32) as usize;
                        let row = level.wrap.row(y, h as u32) as usize;
                        f64::from(level.field[part][row * w + column])
                    };
                    let (x, y, i) = (x as i64, y as i64, y * w + x);
                    let z = at(x, y);
                    let (a, b) = (f64::from(level.across), f64::from(level.upward));
                    let flow = a * (at(x - 1, y) + at(x + 1, y) - 2.0 * z)
                        + b * (at(x, y - 1) + at(x, y + 1) - 2.0 * z);
                    let weight = f64::from(level.weight[i]);
                    let r = f64::from(level.wanted[part][i]) - weight * z + flow;
                    worst = worst.max(r.abs() / (2.0 * (a + b) + weight));
                    largest = largest.max(z.abs());
                }
            }
        }
        worst / largest.max(1e-6)
    }

    #[test]
    fn the_equation_is_solved_on_grids_of_every_shape() {
        for (w, h) in [
            (1, 1),
            (7, 1),
            (1, 8),
            (2, 3),
            (5, 3),
            (33, 20),
            (64, 64),
            (127, 255),
            (300, 17),
        ] {
            for wrap in [Wrap::Repeat, Wrap::RepeatU, Wrap::Clamp] {
                let grid = Size::new(w, h).unwrap();
                let mut levels = Levels::new(grid, w as f32 / h as f32, wrap);
                let cell = 1.0 / h as f32;
                let (weight, cos2, sin2) = levels.equation_mut();
                for i in 0..weight.len() {
                    // A few cells held fast, some softly, most not at all.
                    let k = noise(i, 1);
                    weight[i] = match k {
                        k if k < 0.02 => 64.0 / (cell * cell),
                        k if k < 0.1 => 100.0 * k,
                        _ => 0.0,
                    };
                    cos2[i] = weight[i] * (noise(i, 2) - 0.5);
                    sin2[i] = weight[i] * (noise(i, 3) - 0.3);
                }
                weight[0] = 50.0;
                cos2[0] = 50.0;
                let solved = levels.solve(1e-3, false, &Progress::none()).unwrap();
                assert!(solved.settled, "{w}x{h} {wrap:?}: {solved:?}");
                assert!(solved.cycles <= 25, "{w}x{h} {wrap:?}: {solved:?}");
                let left = residual_of(&levels.levels[0]);
                assert!(left < 1e-4, "{w}x{h} {wrap:?}: {left}");
            }
        }
    }

    #[test]
    fn what_goes_down_keeps_its_sum_and_what_comes_up_its_level() {
        for n in [1usize, 2, 3, 5, 8, 9, 31] {
            for repeats in [false, true] {
                let transfer = Transfer::new(n, repeats);
                let mut shares = vec![0.0f32; n + 3];
                for (first, parts) in &transfer.down {
                    assert!((parts.iter().sum::<f32>() - 1.0).abs() < 1e-6);
                    for k in 0..3 {
                        shares[first + k] += parts[k];
                    }
                }
                let each = transfer.down.len() as f32 / n as f32;
                assert!(shares[..n].iter().all(|s| (s - each).abs() < 1e-5), "{n}");
                assert!(shares[n..].iter().all(|s| *s == 0.0));
                assert!(
                    transfer
                        .up
                        .iter()
                        .all(|(_, part)| (0.0..1.0).contains(part))
                );
            }
        }
    }
}
