//! Where the f32 forms leave how much of an error: for each model over the angle of view, the smaller width and the ratio.
//!
//! What is measured is what lights pictures: the texel as a map holds it, turned to 3 directions, prepared, and taken through
//! the vectorised loop, at half vectors up to three widths from the peak. Two errors are told. The arithmetic's is that
//! against f64 at the very f32 directions that the loop was given. The whole one is that against f64 at the directions before
//! they were rounded to f32: it holds the first, and no f32 form can do better.

use crate::analyse::limits::{SPECULAR, Turned, direction, mirrored, through_kernel};
use crate::brdf::Model;
use crate::error::Result;
use crate::export::{Written, write_atomic};
use crate::map::{ALPHA_MAX, ALPHA_MIN, Rect, Size, Texel};
use crate::math::Axis;
use crate::preview::{Align, Picture, linear_from_srgb, write_text};
use crate::progress::Progress;
use glam::{DVec2, DVec3, Vec3};
use image::ImageEncoder;
use rayon::prelude::*;
use std::f64::consts::TAU;
use std::fmt::Write as _;
use std::io;
use std::path::Path;

/// The errors that the envelope is drawn at.
pub const LEVELS: [f64; 2] = [1e-4, 1e-3];
/// Angles of view in degrees from the normal.
pub const VIEW_DEGREES: [f64; 6] = [0.0, 45.0, 75.0, 85.0, 89.0, 89.9];
/// Those that the picture shows.
const SHOWN: [usize; 4] = [0, 2, 3, 5];
/// Steps of the smaller width, and of the ratio.
const STEPS: usize = 37;
/// The largest ratio.
const RATIO_MAX: f64 = 1000.0;
/// Half vectors: up to this many widths from the peak.
const WIDTHS: [f64; 6] = [0.0, 0.5, 1.0, 1.5, 2.0, 3.0];
/// And at as many azimuths around it.
const AZIMUTHS: u32 = 12;
/// Values under this share of the lobe's peak are not judged: models without a Gaussian end in a step.
const LEAST_SHARE: f64 = 1e-6;

/// One place of the envelope.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cell {
    /// The model.
    pub model: Model,
    /// The angle of view in degrees from the normal.
    pub degrees: f64,
    /// The smaller width.
    pub alpha: f64,
    /// The larger width over it.
    pub ratio: f64,
    /// The largest relative error of the arithmetic.
    pub arithmetic: f64,
    /// The largest relative error with the directions' rounding.
    pub whole: f64,
}

/// Where the f32 forms are how far off.
#[derive(Clone, Debug, PartialEq)]
pub struct Envelope {
    /// By model, angle, ratio and width; what no map can hold is left out.
    pub cells: Vec<Cell>,
}

/// Step `i` of a logarithmic axis.
fn step(low: f64, high: f64, i: usize) -> f64 {
    low * (high / low).powf(i as f64 / (STEPS - 1) as f64)
}

fn alpha_of(i: usize) -> f64 {
    step(ALPHA_MIN.into(), ALPHA_MAX.into(), i)
}

fn ratio_of(i: usize) -> f64 {
    step(1.0, RATIO_MAX, i)
}

/// Measures the envelope; some seconds on two cores.
///
/// # Errors
/// When `progress` cancels. One step for each model and angle.
pub fn envelope(progress: &Progress<'_>) -> Result<Envelope> {
    progress.expect((SPECULAR.len() * VIEW_DEGREES.len()) as u64);
    let mut cells = Vec::new();
    for model in SPECULAR {
        for degrees in VIEW_DEGREES {
            let row = |j: usize| (0..STEPS).filter_map(move |i| cell(model, degrees, i, j));
            cells.par_extend((0..STEPS).into_par_iter().flat_map_iter(row));
            progress.step()?;
        }
    }
    Ok(Envelope { cells })
}

/// One place, where a map can hold it.
fn cell(model: Model, degrees: f64, i: usize, j: usize) -> Option<Cell> {
    let (alpha, ratio) = (alpha_of(i), ratio_of(j));
    if alpha * ratio > f64::from(ALPHA_MAX) * 1.001 {
        return None;
    }
    let (mut arithmetic, mut whole) = (0.0f64, 0.0f64);
    for (turn, azimuth) in [(0.0, 0.4), (27.0, 1.3), (68.0, 2.9)] {
        let texel = Texel {
            alpha_x: alpha as f32,
            alpha_y: ((alpha * ratio) as f32).min(ALPHA_MAX),
            axis: Axis::from_degrees(turn),
        };
        let (a, w) = errors(model, texel, direction(degrees, azimuth));
        (arithmetic, whole) = (arithmetic.max(a), whole.max(w));
    }
    Some(Cell {
        model,
        degrees,
        alpha,
        ratio,
        arithmetic,
        whole,
    })
}

/// The two errors of a texel's lobe seen from `v`, which lies in the texel's axes.
fn errors(model: Model, texel: Texel, v: DVec3) -> (f64, f64) {
    let turned = Turned::new(texel);
    let exact = lights(texel, v).map(|l| (turned.out(l), turned.out(v)));
    let exact: Vec<(DVec3, DVec3)> = exact.collect();
    let rounded: Vec<(Vec3, Vec3)> = exact
        .iter()
        .map(|p| (p.0.as_vec3(), p.1.as_vec3()))
        .collect();
    let got = through_kernel(model, &rounded, texel);
    let truth: Vec<f64> = exact
        .iter()
        .map(|p| turned.truth(model, p.0, p.1))
        .collect();
    let peak = truth.iter().copied().fold(0.0, f64::max);
    let judged = |want: f64| want > LEAST_SHARE * peak;
    let (mut arithmetic, mut whole) = (0.0f64, 0.0f64);
    for ((got, pair), truth) in got.into_iter().zip(rounded).zip(truth) {
        let want = turned.truth(model, pair.0.as_dvec3(), pair.1.as_dvec3());
        if judged(want) && judged(truth) {
            arithmetic = arithmetic.max((f64::from(got) / want - 1.0).abs());
            whole = whole.max((f64::from(got) / truth - 1.0).abs());
        }
    }
    (arithmetic, whole)
}

/// Lights whose half vectors with `v` lie up to three widths from the peak.
fn lights(texel: Texel, v: DVec3) -> impl Iterator<Item = DVec3> {
    let alpha = DVec2::new(texel.alpha_x.into(), texel.alpha_y.into());
    WIDTHS
        .into_iter()
        .flat_map(move |w| {
            (0..AZIMUTHS).map(move |i| (w, TAU * (f64::from(i) + 0.1) / f64::from(AZIMUTHS)))
        })
        .filter_map(move |(w, a)| mirrored(v, alpha * DVec2::new(a.cos(), a.sin()) * w))
}

impl Envelope {
    /// The smallest width from which on the whole error stays at or under `level`, at a model, a ratio that the envelope has
    /// (1, 10, 100 and 1000 among them), and every angle up to `degrees`; none where it is over it at the largest.
    pub fn alpha_from(&self, model: Model, ratio: f64, degrees: f64, level: f64) -> Option<f64> {
        let of_row = |c: &Cell| {
            c.model == model && (c.ratio / ratio - 1.0).abs() < 1e-6 && c.degrees <= degrees
        };
        let row: Vec<&Cell> = self.cells.iter().filter(|c| of_row(c)).collect();
        let held = |alpha: f64| {
            row.iter()
                .filter(|c| c.alpha == alpha)
                .all(|c| c.whole <= level)
        };
        let known = |alpha: &f64| row.iter().any(|c| c.alpha == *alpha);
        let widths = (0..STEPS).rev().map(alpha_of).filter(known);
        widths.take_while(|a| held(*a)).last()
    }

    /// One line a place: model, angle, width, ratio, and the two errors.
    pub fn csv(&self) -> String {
        let mut text = String::from(
            "model,view_degrees,alpha,ratio,error_of_arithmetic,error_with_rounded_directions\n",
        );
        for c in &self.cells {
            let _ = writeln!(
                text,
                "{},{},{:.6},{:.3},{:.3e},{:.3e}",
                c.model, c.degrees, c.alpha, c.ratio, c.arithmetic, c.whole
            );
        }
        text
    }

    /// The heat map: a row of panels for each model, the arithmetic's error at the left, the whole error at the right.
    pub fn picture(&self) -> Picture {
        let mut sheet = Sheet::new();
        sheet.frame();
        for (row, model) in SPECULAR.into_iter().enumerate() {
            sheet.model(row, model);
            for (column, place) in SHOWN.into_iter().enumerate() {
                let degrees = VIEW_DEGREES[place];
                let cells = || {
                    let of_panel = |c: &&Cell| c.model == model && c.degrees == degrees;
                    self.cells.iter().filter(of_panel)
                };
                sheet.panel(row, column, cells().map(|c| (c, c.arithmetic)));
                sheet.panel(row, column + SHOWN.len(), cells().map(|c| (c, c.whole)));
            }
        }
        sheet.picture
    }
}

/// Pixels along a side of a cell.
const CELL: u32 = 4;
const PANEL: u32 = CELL * STEPS as u32;
const GAP: u32 = 24;
/// Between the two halves.
const GUTTER: u32 = 56;
const LEFT: u32 = 206;
const TOP: u32 = 104;
const BOTTOM: u32 = 104;
const RIGHT: u32 = 24;

/// Upper bounds of the errors of a colour, in sRGB from pale to dark; the last is for everything above.
const COLOURS: [(f64, [u8; 3], &str); 6] = [
    (1e-6, [255, 255, 217], "up to 1e-6"),
    (1e-5, [199, 233, 180], "1e-5"),
    (LEVELS[0], [127, 205, 187], "1e-4"),
    (LEVELS[1], [46, 158, 193], "1e-3"),
    (1e-2, [34, 94, 168], "1e-2"),
    (f64::INFINITY, [12, 28, 80], "more"),
];

fn linear(rgb: [u8; 3]) -> [f32; 3] {
    rgb.map(|c| linear_from_srgb(f32::from(c) / 255.0))
}

fn colour(error: f64) -> [f32; 3] {
    let found = COLOURS.iter().find(|c| error <= c.0);
    linear(found.map_or(COLOURS[5].1, |c| c.1))
}

const INK: [f32; 3] = [0.01; 3];
/// Where no map has texels.
const OUTSIDE: [f32; 3] = [0.82; 3];

/// The picture of all panels in the making.
struct Sheet {
    picture: Picture,
}

impl Sheet {
    fn new() -> Self {
        let columns = 2 * SHOWN.len() as u32;
        let rows = SPECULAR.len() as u32;
        let width = LEFT + columns * (PANEL + GAP) + GUTTER + RIGHT;
        let size = Size::new(width, TOP + rows * (PANEL + GAP) + BOTTOM);
        Self {
            picture: Picture::new(size.expect("a constant size"), [1.0; 3]),
        }
    }

    /// The left upper corner of a panel.
    fn corner(row: usize, column: usize) -> (u32, u32) {
        let gutter = if column < SHOWN.len() { 0 } else { GUTTER };
        (
            LEFT + gutter + column as u32 * (PANEL + GAP),
            TOP + row as u32 * (PANEL + GAP),
        )
    }

    fn text(&mut self, (x, y): (u32, u32), (width, height): (u32, u32), text: &str, align: Align) {
        let area = Rect {
            x,
            y,
            width,
            height,
        };
        let px = (height as f32 * 0.86).min(22.0);
        write_text(&mut self.picture, area, text, px, align, INK);
    }

    fn fill(&mut self, (x, y): (u32, u32), (width, height): (u32, u32), colour: [f32; 3]) {
        for row in y..y + height {
            self.picture.row_mut(row)[x as usize..][..width as usize].fill(colour);
        }
    }

    /// Heads, axes and the legend.
    fn frame(&mut self) {
        let half = SHOWN.len() as u32 * (PANEL + GAP);
        for (column, title) in [
            (0, "error of the f32 arithmetic alone"),
            (SHOWN.len(), "with the directions rounded to f32"),
        ] {
            let x = Self::corner(0, column).0;
            self.text((x, 14), (half, 32), title, Align::Centre);
        }
        for column in 0..2 * SHOWN.len() {
            let degrees = VIEW_DEGREES[SHOWN[column % SHOWN.len()]];
            let head = format!("seen at {degrees}°");
            let x = Self::corner(0, column).0;
            self.text((x, TOP - 34), (PANEL, 25), &head, Align::Centre);
            self.alphas(column);
        }
        let x = Self::corner(0, 0).0;
        let under = TOP + SPECULAR.len() as u32 * (PANEL + GAP) + 8;
        let words = "across: the smaller alpha, 0.001 to 1.5     upward: the larger over it, 1 to 1000     grey: no map has such texels";
        self.text((x, under), (2 * half + GUTTER, 28), words, Align::Left);
        self.legend((x, under + 40));
    }

    /// The numbers under a column.
    fn alphas(&mut self, column: usize) {
        let (x, y) = Self::corner(SPECULAR.len() - 1, column);
        for (alpha, text) in [(1e-3, ".001"), (1e-2, ".01"), (0.1, ".1"), (1.0, "1")] {
            let share = (alpha / alpha_of(0)).ln() / (alpha_of(STEPS - 1) / alpha_of(0)).ln();
            let at = x + CELL / 2 + (share * f64::from(PANEL - CELL)) as u32;
            self.fill((at, y + PANEL), (1, 5), INK);
            self.text((at - 26, y + PANEL + 5), (53, 20), text, Align::Centre);
        }
    }

    fn legend(&mut self, (x, y): (u32, u32)) {
        self.text((x, y), (250, 28), "largest relative error:", Align::Left);
        for (i, (_, rgb, text)) in COLOURS.into_iter().enumerate() {
            let at = x + 260 + 170 * i as u32;
            self.fill((at, y + 2), (32, 22), INK);
            self.fill((at + 1, y + 3), (30, 20), linear(rgb));
            self.text((at + 40, y), (126, 28), text, Align::Left);
        }
    }

    /// A model's name and the ratios beside its row.
    fn model(&mut self, row: usize, model: Model) {
        let y = Self::corner(row, 0).1;
        self.text(
            (6, y + PANEL / 2 - 13),
            (142, 28),
            model.name(),
            Align::Left,
        );
        for column in [0, SHOWN.len()] {
            let x = Self::corner(row, column).0;
            for (i, text) in ["1", "10", "100", "1000"].into_iter().enumerate() {
                let up = CELL / 2 + i as u32 * (PANEL - CELL) / 3;
                let at = y + PANEL - 1 - up;
                self.fill((x - 5, at), (5, 1), INK);
                if column == 0 || i == 0 || i == 3 {
                    self.text((x - 54, at - 10), (47, 20), text, Align::Right);
                }
            }
        }
    }

    fn panel<'a>(
        &mut self,
        row: usize,
        column: usize,
        cells: impl Iterator<Item = (&'a Cell, f64)>,
    ) {
        let (x, y) = Self::corner(row, column);
        self.fill((x, y), (PANEL, PANEL), OUTSIDE);
        let place = |value: f64, low: f64, high: f64| {
            ((value / low).ln() / (high / low).ln() * (STEPS - 1) as f64).round() as u32
        };
        for (cell, error) in cells {
            let i = place(cell.alpha, alpha_of(0), alpha_of(STEPS - 1));
            let j = place(cell.ratio, 1.0, RATIO_MAX);
            let at = (x + CELL * i, y + PANEL - CELL * (j + 1));
            self.fill(at, (CELL, CELL), colour(error));
        }
    }
}

/// Writes `stability.csv` and `stability.png` into a folder.
///
/// # Errors
/// [`crate::Error::Write`], or when `progress` cancels.
pub(super) fn write(dir: &Path, progress: &Progress<'_>) -> Result<(Envelope, [Written; 2])> {
    let envelope = envelope(progress)?;
    let csv = write_atomic(&dir.join("stability.csv"), |file| {
        io::Write::write_all(file, envelope.csv().as_bytes())
    })?;
    let picture = envelope.picture();
    let png = write_atomic(&dir.join("stability.png"), |file| {
        image::codecs::png::PngEncoder::new(file)
            .write_image(
                &picture.to_srgb8(),
                picture.width(),
                picture.height(),
                image::ExtendedColorType::Rgb8,
            )
            .map_err(io::Error::other)
    })?;
    Ok((envelope, [csv, png]))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_envelope_says_where_f32_holds_and_where_it_does_not() {
        let envelope = envelope(&Progress::none()).unwrap();
        let worst = |model: Model, alpha: f64, ratio: f64, degrees: f64, of: fn(&Cell) -> f64| {
            let inside = |c: &&Cell| {
                c.model == model && c.alpha >= alpha && c.ratio <= ratio && c.degrees <= degrees
            };
            envelope
                .cells
                .iter()
                .filter(inside)
                .map(of)
                .fold(0.0, f64::max)
        };
        for model in SPECULAR {
            // The loops' arithmetic does not mind the angle.
            assert!(
                worst(model, 0.05, 10.0, 90.0, |c| c.arithmetic) < 1.2e-5,
                "{model}"
            );
            assert!(
                worst(model, 1e-3, 1000.0, 90.0, |c| c.arithmetic) < 2e-3,
                "{model}"
            );
            assert!(
                worst(model, 0.05, 10.0, 85.0, |c| c.whole) < LEVELS[1],
                "{model}"
            );
            let cells = envelope.cells.iter().filter(|c| c.model == model);
            assert!(
                cells
                    .clone()
                    .all(|c| c.arithmetic.is_finite() && c.whole.is_finite())
            );
            // Of 37 x 37 places a little over half are of widths up to 1.5.
            assert!((650..800).contains(&(cells.count() / VIEW_DEGREES.len())));
        }
        // No f32 direction is good enough for a lobe of 0.001 at the horizon.
        assert!(worst(Model::Ward, 1e-3, 1.0, 90.0, |c| c.whole) > 1e-2);
        let from = |ratio, level| envelope.alpha_from(Model::Ward, ratio, 85.0, level);
        let (fine, rough) = (from(1.0, LEVELS[0]).unwrap(), from(1.0, LEVELS[1]).unwrap());
        assert!(rough < fine && fine < 0.1, "{rough} {fine}");
        assert_eq!(from(1000.0, 1e-9), None);
        assert_eq!(envelope.csv().lines().count(), envelope.cells.len() + 1);
    }

    #[test]
    fn the_picture_shows_each_error_in_its_place() {
        let cell = |arithmetic, whole| Cell {
            model: Model::Ward,
            degrees: VIEW_DEGREES[SHOWN[0]],
            alpha: alpha_of(3),
            ratio: ratio_of(5),
            arithmetic,
            whole,
        };
        let picture = Envelope {
            cells: vec![cell(1e-7, 0.5)],
        }
        .picture();
        let at = |column: usize, i: u32, j: u32| {
            let (x, y) = Sheet::corner(0, column);
            picture.pixel(x + CELL * i + 1, y + PANEL - CELL * j - 2)
        };
        assert_eq!(at(0, 3, 5), linear(COLOURS[0].1));
        assert_eq!(at(SHOWN.len(), 3, 5), linear(COLOURS[5].1));
        assert_eq!(at(0, 4, 5), OUTSIDE);
    }
}
