//! Panels side by side, in rows, each over its caption.

use super::caption::{Align, write_text};
use super::picture::Picture;
use crate::error::{Error, Result};
use crate::map::{Rect, Size};

/// What lies between and under panels: a quiet grey, a little darker than the background's lower edge.
const PAPER: [f32; 3] = [0.026, 0.0265, 0.028];
const INK: [f32; 3] = [0.72, 0.72, 0.72];

/// Another row is begun only where the panels' smaller side grows by this factor: a row is easier to compare along.
const WORTH_A_ROW: f32 = 1.15;

/// Panels in rows, every row over a strip for its captions.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Grid {
    columns: u32,
    rows: u32,
    /// Between columns, and between a strip and the row under it.
    gap: u32,
    /// Height of a strip; 0 where a caption could not be read.
    strip: u32,
    panel: Size,
}

impl Grid {
    fn new(size: Size, columns: u32, rows: u32) -> Option<Self> {
        let (width, height) = (size.width() / columns, size.height() / rows);
        let gap = if width >= 64 { 2 } else { 0 };
        let strip = if height < 40 {
            0
        } else {
            (height.min(width) * 3 / 40).clamp(12, 72)
        };
        let width = size.width().checked_sub(gap * (columns - 1))? / columns;
        let height = size.height().checked_sub(gap * (rows - 1))? / rows;
        let panel = Size::new(width, height.checked_sub(strip)?).ok()?;
        Some(Self {
            columns,
            rows,
            gap,
            strip,
            panel,
        })
    }

    /// As many rows as make the panels large.
    fn best(size: Size, panels: usize) -> Option<Self> {
        let n = u32::try_from(panels)
            .ok()
            .filter(|n| *n > 0 && *n <= PANELS_MAX)?;
        let side = |grid: &Self| grid.panel.width().min(grid.panel.height()) as f32;
        let mut best: Option<Self> = None;
        for columns in (1..=n).rev() {
            let grid = Self::new(size, columns, n.div_ceil(columns));
            if let Some(grid) = grid
                && best.is_none_or(|best| side(&grid) >= WORTH_A_ROW * side(&best))
            {
                best = Some(grid);
            }
        }
        best
    }
}

/// More panels than this are no picture to be looked at.
const PANELS_MAX: u32 = 64;

/// The size of each of `panels` panels of a sheet of `size` pixels: side by side in one row, or in several where that makes
/// them a seventh larger, with gaps between them and a strip for captions under each row.
///
/// # Errors
/// When there is no panel, more than 64, or the sheet is too small for as many.
pub fn panel_size(size: Size, panels: usize) -> Result<Size> {
    grid(size, panels).map(|g| g.panel)
}

fn grid(size: Size, panels: usize) -> Result<Grid> {
    Grid::best(size, panels).ok_or_else(|| {
        Error::invalid(
            "number of pictures side by side",
            panels,
            format!("allowed: 1 to {PANELS_MAX}, and a pixel for each in {size}"),
        )
    })
}

/// Lays out panels of the size that [`panel_size`] says, row by row, with a caption under each.
///
/// # Errors
/// As [`panel_size`].
pub fn side_by_side(panels: &[Picture], captions: &[String], size: Size) -> Result<Picture> {
    let grid = grid(size, panels.len())?;
    let Grid {
        columns,
        rows,
        gap,
        strip,
        panel,
    } = grid;
    let mut sheet = Picture::new(size, PAPER);
    // What does not divide evenly stays outside: columns half on each side, rows below.
    let row_height = panel.height() + strip + gap;
    let spare = |in_row: u32| size.width() - panel.width() * in_row - gap * (in_row - 1);
    let full = panels.len() as u32 - columns * (rows - 1);
    for (i, picture) in (0..).zip(panels) {
        let (column, row) = (i % columns, i / columns);
        let in_row = if row + 1 == rows { full } else { columns };
        let x = spare(in_row) / 2 + column * (panel.width() + gap);
        let y = row * row_height;
        sheet.paste(picture, x, y);
        if let (Some(text), 1..) = (captions.get(i as usize), strip) {
            let area = Rect {
                x,
                y: y + panel.height(),
                width: panel.width(),
                height: strip,
            };
            let height = (strip as f32 * 0.72).max(11.0);
            write_text(&mut sheet, area, text, height, Align::Centre, INK);
        }
    }
    Ok(sheet)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn panels_fill_the_sheet_and_captions_stand_under_them() {
        let size = Size::new(301, 100).unwrap();
        let panel = panel_size(size, 3).unwrap();
        assert_eq!((panel.width(), panel.height()), (99, 88));
        let panels = vec![Picture::new(panel, [1.0, 0.0, 0.0]); 3];
        let captions = ["Phong", "Ward", "Ward + map"].map(str::to_owned);
        let sheet = side_by_side(&panels, &captions, size).unwrap();
        let red = sheet.pixels().iter().filter(|p| p[0] == 1.0).count();
        assert_eq!(red, 3 * panel.texels(), "no caption reaches into a panel");
        let inked = (88..100)
            .flat_map(|y| sheet.row(y).to_vec())
            .filter(|p| p[1] > 0.3)
            .count();
        assert!(inked > 60, "{inked}");
    }

    #[test]
    fn the_smallest_sheets_work_and_impossible_ones_are_refused() {
        let size = |w, h| Size::new(w, h).unwrap();
        assert_eq!(panel_size(size(1, 1), 1).unwrap(), size(1, 1));
        assert_eq!(panel_size(size(3, 39), 3).unwrap(), size(3, 13));
        assert!(panel_size(size(2, 2), 5).is_err());
        assert!(panel_size(size(2, 2), 0).is_err());
        assert!(panel_size(size(4096, 4096), 65).is_err());
    }

    #[test]
    fn many_panels_stand_in_rows_and_the_last_row_in_the_middle() {
        let size = Size::new(600, 600).unwrap();
        let panel = panel_size(size, 8).unwrap();
        assert!(
            panel.width() > 190 && panel.height() > 170,
            "three in a row: {panel}"
        );
        let panels = vec![Picture::new(panel, [1.0, 0.0, 0.0]); 8];
        let sheet = side_by_side(&panels, &[], size).unwrap();
        let red = |y: u32| sheet.row(y).iter().filter(|p| p[0] == 1.0).count() as u32;
        assert_eq!(
            (red(10), red(210), red(410)),
            (3 * panel.width(), 3 * panel.width(), 2 * panel.width())
        );
        assert_ne!(sheet.pixel(20, 410)[0], 1.0);
        assert_eq!(sheet.pixel(300 - 20, 410)[0], 1.0);
        let row = panel_size(Size::new(1800, 600).unwrap(), 3).unwrap();
        assert_eq!(row.width(), 598, "one row");
    }
}
