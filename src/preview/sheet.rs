//! Panels side by side, each over its caption.

use super::caption::{Align, write_text};
use super::picture::Picture;
use crate::error::{Error, Result};
use crate::map::{Rect, Size};

/// What lies between and under panels: a quiet grey, a little darker than the background's lower edge.
const PAPER: [f32; 3] = [0.026, 0.0265, 0.028];
const INK: [f32; 3] = [0.72, 0.72, 0.72];

/// Height of the strip under the panels; 0 where a caption could not be read.
fn strip(size: Size, panels: u32) -> u32 {
    let side = size.height().min(size.width() / panels);
    if size.height() < 40 {
        0
    } else {
        (side * 3 / 40).clamp(12, 72)
    }
}

/// The size of each of `panels` panels of a sheet of `size` pixels: its share of the width, less a gap, over the strip for
/// captions.
///
/// # Errors
/// When there is no panel, or the sheet is too narrow for as many.
pub fn panel_size(size: Size, panels: usize) -> Result<Size> {
    let too_many = || {
        Error::invalid(
            "number of pictures side by side",
            panels,
            format!(
                "allowed: 1 to {} in a width of {}",
                size.width(),
                size.width()
            ),
        )
    };
    let n = u32::try_from(panels).map_err(|_| too_many())?;
    if n == 0 || n > size.width() {
        return Err(too_many());
    }
    let gaps = gap(size, n) * (n - 1);
    Size::new((size.width() - gaps) / n, size.height() - strip(size, n))
}

fn gap(size: Size, panels: u32) -> u32 {
    if size.width() / panels >= 64 { 2 } else { 0 }
}

/// Lays out panels of the size that [`panel_size`] says, with a caption under each.
///
/// # Errors
/// As [`panel_size`].
pub fn side_by_side(panels: &[Picture], captions: &[String], size: Size) -> Result<Picture> {
    let panel = panel_size(size, panels.len())?;
    let n = panels.len() as u32;
    let strip = strip(size, n);
    let mut sheet = Picture::new(size, PAPER);
    // Columns that do not divide evenly stay outside, half on each side.
    let gap = gap(size, n);
    let spare = size.width() - panel.width() * n - gap * (n - 1);
    for (i, picture) in panels.iter().enumerate() {
        let x = spare / 2 + i as u32 * (panel.width() + gap);
        sheet.paste(picture, x, 0);
        if let (Some(text), 1..) = (captions.get(i), strip) {
            let area = Rect {
                x,
                y: panel.height(),
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
        assert_eq!(panel_size(size(3, 39), 3).unwrap(), size(1, 39));
        assert!(panel_size(size(2, 2), 3).is_err());
        assert!(panel_size(size(2, 2), 0).is_err());
    }
}
