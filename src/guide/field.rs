//! Guides on a surface, solved: from a place to its direction.

use super::hold::{Hold, Row};
use super::multigrid::{Levels, Solved};
use super::{Guides, grid_size};
use crate::error::Result;
use crate::map::{Singularity, Size, Wrap, singularities};
use crate::math::Axis;
use crate::pattern::{Fill, Patch, Surface};
use crate::progress::Progress;
use rayon::prelude::*;

/// How finely a field is solved.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Detail {
    /// On the grid that the guides state.
    #[default]
    Full,
    /// On a quarter of it each way, to a tenth of a degree: while a guide is being dragged.
    Draft,
}

impl Detail {
    fn cells(self, grid: u32) -> u32 {
        match self {
            Self::Full => grid,
            Self::Draft => (grid / 4).max(16).min(grid),
        }
    }

    fn tolerance(self, stated: f32) -> f32 {
        match self {
            Self::Full => stated,
            Self::Draft => stated.max(0.1),
        }
    }
}

/// Solves guides, and keeps what it solved: the next solve on the same grid starts from there, so that a guide moved a
/// little costs a few cycles.
#[derive(Default)]
pub struct Solver {
    kept: Option<Kept>,
}

struct Kept {
    grid: Size,
    aspect: f32,
    wrap: Wrap,
    levels: Levels,
    /// Whether the levels hold the field of an earlier solve.
    warm: bool,
}

impl Solver {
    /// Levels for this grid: those kept, where they fit.
    fn levels(&mut self, grid: Size, surface: &Surface) -> &mut Kept {
        let fits =
            |k: &Kept| k.grid == grid && k.aspect == surface.aspect && k.wrap == surface.wrap;
        let kept = self.kept.take().filter(fits).unwrap_or_else(|| Kept {
            grid,
            aspect: surface.aspect,
            wrap: surface.wrap,
            levels: Levels::new(grid, surface.aspect, surface.wrap),
            warm: false,
        });
        self.kept.insert(kept)
    }
}

/// The field of solved guides: the direction at any place of a surface.
pub struct LineField {
    surface: Surface,
    grid: Size,
    hold: Hold,
    /// The part of the solved field that the guides' own directions leave, rows of the grid from the top.
    cos2: Vec<f32>,
    sin2: Vec<f32>,
    widths: (f32, f32),
    only_near: bool,
    solved: Solved,
}

impl Guides {
    /// Solves the field for a surface. Only its aspect and wrap decide the field; its size, the places that are filled.
    ///
    /// # Errors
    /// As [`Guides::check`]; when a guide reaches over more than eight turns of UV where the map repeats; and
    /// [`crate::Error::Cancelled`] when `progress`, asked once a cycle, says so.
    pub fn prepare(&self, surface: &Surface, progress: &Progress<'_>) -> Result<LineField> {
        self.prepare_with(surface, Detail::Full, &mut Solver::default(), progress)
    }

    /// The same with a solver that is kept from solve to solve. What it solved before changes the result by no more than the
    /// tolerance; a result that must not depend on it comes from [`Guides::prepare`].
    ///
    /// # Errors
    /// As [`Guides::prepare`].
    pub fn prepare_with(
        &self,
        surface: &Surface,
        detail: Detail,
        solver: &mut Solver,
        progress: &Progress<'_>,
    ) -> Result<LineField> {
        self.check()?;
        let grid = grid_size(detail.cells(self.grid), surface.aspect)?;
        let cells = Surface {
            size: grid,
            ..*surface
        };
        let cell = cells.texel().max_element();
        let hold = Hold::new(self, surface.aspect, surface.wrap, cell)?;
        let mut field = LineField {
            surface: *surface,
            grid,
            hold,
            cos2: Vec::new(),
            sin2: Vec::new(),
            widths: self.widths(),
            only_near: self.only_near,
            solved: Solved {
                cycles: 0,
                change: 0.0,
                settled: true,
            },
        };
        if field.hold.is_empty() {
            return Ok(field);
        }
        let kept = solver.levels(grid, surface);
        let left = pose(&field.hold, &cells, &mut kept.levels, progress)?;
        let tolerance = detail.tolerance(self.tolerance);
        let warm = std::mem::replace(&mut kept.warm, true);
        field.solved = kept.levels.solve(tolerance, warm, progress)?;
        let [cos2, sin2] = kept.levels.field().map(|plane| scaled(plane, &left));
        (field.cos2, field.sin2) = (cos2, sin2);
        Ok(field)
    }
}

fn scaled(plane: &[f32], by: &[f32]) -> Vec<f32> {
    let mut out = vec![0.0; plane.len()];
    let chunks = out.par_chunks_mut(1 << 15).zip(plane.par_chunks(1 << 15));
    chunks
        .zip(by.par_chunks(1 << 15))
        .for_each(|((out, plane), by)| {
            for ((o, p), b) in out.iter_mut().zip(plane).zip(by) {
                *o = p * b;
            }
        });
    out
}

/// Writes the equation of the guides into the finest level. Returns how much of each cell is left to the solved field.
fn pose(
    hold: &Hold,
    cells: &Surface,
    levels: &mut Levels,
    progress: &Progress<'_>,
) -> Result<Vec<f32>> {
    let width = cells.size.width();
    let xs: Vec<f32> = (0..width).map(|x| cells.position(x, 0).x).collect();
    let mut left = vec![0.0; cells.size.texels()];
    let (weight, cos2, sin2) = levels.equation_mut();
    let n = width as usize;
    weight
        .par_chunks_mut(n)
        .zip(cos2.par_chunks_mut(n))
        .zip(sin2.par_chunks_mut(n).zip(left.par_chunks_mut(n)))
        .enumerate()
        .try_for_each_init(Row::default, |row, (y, ((weight, cos2), (sin2, left)))| {
            if y % 64 == 0 {
                progress.check()?;
            }
            hold.row(cells.position(0, y as u32).y, &xs, row);
            for i in 0..n {
                let a = row.hold[i];
                let w = hold.weight(a, row.odds[i]);
                let per = if a > 0.0 { w / a } else { 0.0 };
                weight[i] = w;
                cos2[i] = per * row.cos2[i];
                sin2[i] = per * row.sin2[i];
                left[i] = 1.0 - Hold::exactness(a);
            }
            Ok(())
        })?;
    Ok(left)
}

/// Two neighbouring columns (or rows) of the grid, and the part of the second.
#[derive(Clone, Copy)]
struct Between {
    pair: [usize; 2],
    part: f32,
}

impl Between {
    /// Around the centre of texel `i` of `texels` along an axis with `cells` cells.
    fn new(i: u32, texels: u32, cells: u32, repeats: bool) -> Self {
        let at = (f64::from(i) + 0.5) / f64::from(texels) * f64::from(cells) - 0.5;
        let first = at.floor();
        let n = i64::from(cells);
        let fold = |c: i64| {
            let c = if repeats {
                c.rem_euclid(n)
            } else {
                c.clamp(0, n - 1)
            };
            usize::try_from(c).expect("folded into the grid")
        };
        Self {
            pair: [fold(first as i64), fold(first as i64 + 1)],
            part: (at - first) as f32,
        }
    }
}

impl LineField {
    /// How the solve ended.
    pub fn solved(&self) -> Solved {
        self.solved
    }

    /// The grid it was solved on.
    pub fn grid(&self) -> Size {
        self.grid
    }

    /// Whether no guide holds anything, so that there is no direction to lay.
    pub fn is_empty(&self) -> bool {
        self.cos2.is_empty()
    }

    /// The singular points of the field on its own grid: where the direction turns by whole half turns around a place.
    /// `None` where they are too many to be points of a smooth field.
    pub fn singularities(&self) -> Option<Vec<Singularity>> {
        if self.is_empty() {
            return Some(Vec::new());
        }
        let on_grid = Surface {
            size: self.grid,
            ..self.surface
        };
        let n = self.grid.width() as usize;
        let mut planes = [vec![0.0; self.grid.texels()], vec![0.0; self.grid.texels()]];
        let columns = self.columns(&on_grid, 0, self.grid.width());
        let [cos2, sin2] = &mut planes;
        let rows = cos2.par_chunks_mut(n).zip(sin2.par_chunks_mut(n));
        rows.enumerate()
            .for_each_init(Row::default, |row, (y, (cos2, sin2))| {
                self.directions(&on_grid, y as u32, &columns, row, cos2, sin2);
            });
        singularities(self.grid, self.surface.wrap, &planes[0], &planes[1])
    }

    fn columns(&self, surface: &Surface, x: u32, n: u32) -> Columns {
        let repeats = surface.wrap.repeats_u();
        let (texels, cells) = (surface.size.width(), self.grid.width());
        Columns {
            xs: (x..x + n).map(|x| surface.position(x, 0).x).collect(),
            between: (x..x + n)
                .map(|x| Between::new(x, texels, cells, repeats))
                .collect(),
        }
    }

    /// The directions of a row of texels, of unit length; leaves in `row` what the guides hold there.
    fn directions(
        &self,
        surface: &Surface,
        y: u32,
        columns: &Columns,
        row: &mut Row,
        cos2: &mut [f32],
        sin2: &mut [f32],
    ) {
        self.hold.row(surface.position(0, y).y, &columns.xs, row);
        let repeats = surface.wrap.repeats_v();
        let lines = Between::new(y, surface.size.height(), self.grid.height(), repeats);
        let n = self.grid.width() as usize;
        let [a, b] = lines.pair.map(|j| j * n..(j + 1) * n);
        let (upper, lower) = (
            [&self.cos2[a.clone()], &self.sin2[a]],
            [&self.cos2[b.clone()], &self.sin2[b]],
        );
        let t = lines.part;
        for (i, at) in columns.between.iter().enumerate() {
            let [l, r] = at.pair;
            let (wr, wl) = (at.part, 1.0 - at.part);
            let mix = |part: usize| {
                (upper[part][l] * wl + upper[part][r] * wr) * (1.0 - t)
                    + (lower[part][l] * wl + lower[part][r] * wr) * t
            };
            let a = row.hold[i];
            let exact = Hold::exactness(a) / a.max(1e-6);
            let c = mix(0) + exact * row.cos2[i];
            let s = mix(1) + exact * row.sin2[i];
            let length = (c * c + s * s).sqrt();
            // The very middle of a singular point has to point somewhere.
            let known = length > 1e-18;
            cos2[i] = if known { c / length } else { Axis::U.cos2 };
            sin2[i] = if known { s / length } else { Axis::U.sin2 };
        }
    }
}

/// The columns of a run of texels.
struct Columns {
    xs: Vec<f32>,
    between: Vec<Between>,
}

impl Fill for LineField {
    fn fill(&self, patch: &mut Patch<'_>) {
        let rect = patch.region.rect;
        if self.is_empty() {
            patch.coverage.fill(0.0);
            patch.value.fill(0.0);
            patch.region.cos2.fill(Axis::U.cos2);
            patch.region.sin2.fill(Axis::U.sin2);
        } else {
            let columns = self.columns(&self.surface, rect.x, rect.width);
            let mut row = Row::default();
            let n = rect.width as usize;
            for j in 0..rect.height as usize {
                let run = j * n..(j + 1) * n;
                let (cos2, sin2) = (
                    &mut patch.region.cos2[run.clone()],
                    &mut patch.region.sin2[run.clone()],
                );
                self.directions(
                    &self.surface,
                    rect.y + j as u32,
                    &columns,
                    &mut row,
                    cos2,
                    sin2,
                );
                patch.value[run.clone()].copy_from_slice(&row.hold);
                let coverage = &mut patch.coverage[run];
                if self.only_near {
                    coverage.copy_from_slice(&row.hold);
                } else {
                    coverage.fill(1.0);
                }
            }
        }
        patch.region.alpha_x.fill(self.widths.0);
        patch.region.alpha_y.fill(self.widths.1);
    }
}
