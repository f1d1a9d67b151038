//! Text on pictures: the one file that knows the font crate.
//!
//! The font is DejaVu Sans with Latin, Greek and Cyrillic letters (`font/`, its licence beside it).

use super::picture::Picture;
use crate::map::Rect;
use ab_glyph::{Font, FontRef, Glyph, PxScale, ScaleFont, point};

static FONT: &[u8] = include_bytes!("font/DejaVuSans-subset.ttf");

/// Below this height in pixels text is not drawn: nobody could read it.
const SMALLEST: f32 = 4.0;

/// Where a line stands in its area; always in the middle of its height.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Align {
    /// At the left edge.
    Left,
    /// In the middle.
    #[default]
    Centre,
    /// At the right edge.
    Right,
}

/// Writes one line into `area` of the picture, `height` pixels from descender to ascender or as much less as makes it fit.
/// Returns the height that was used; 0 when the area is too small for anything to be read.
pub fn write_text(
    picture: &mut Picture,
    area: Rect,
    text: &str,
    height: f32,
    align: Align,
    colour: [f32; 3],
) -> f32 {
    let font = FontRef::try_from_slice(FONT).expect("the font is part of the library");
    let Some(area) = area.intersection(picture.size().rect()) else {
        return 0.0;
    };
    let height = height.min(area.height as f32);
    let width = line(&font, text, height).1;
    // Advances grow with the height, so one division makes a line fit; two pixels stay for the smoothed edges.
    let room = (area.width as f32 - 2.0).max(0.0);
    let height = if width > room {
        height * room / width
    } else {
        height
    };
    // Written to refuse NaN as well.
    if !(height >= SMALLEST && width > 0.0) {
        return 0.0;
    }
    let (glyphs, width) = line(&font, text, height);
    let spare = area.width as f32 - width;
    let x = area.x as f32
        + match align {
            Align::Left => 1.0,
            Align::Centre => 0.5 * spare,
            Align::Right => spare - 1.0,
        };
    let ascent = font.as_scaled(PxScale::from(height)).ascent();
    let y = area.y as f32 + 0.5 * (area.height as f32 - height) + ascent;
    for mut glyph in glyphs {
        glyph.position += point(x, y);
        ink(picture, area, &font, glyph, colour);
    }
    height
}

/// The glyphs of a line that begins at the origin, and its width.
fn line(font: &FontRef<'_>, text: &str, height: f32) -> (Vec<Glyph>, f32) {
    let scaled = font.as_scaled(PxScale::from(height));
    let mut x = 0.0;
    let mut last = None;
    let mut glyphs = Vec::new();
    for letter in text.chars().map(|c| if c.is_control() { ' ' } else { c }) {
        let id = font.glyph_id(letter);
        if let Some(last) = last.replace(id) {
            x += scaled.kern(last, id);
        }
        glyphs.push(id.with_scale_and_position(height, point(x, 0.0)));
        x += scaled.h_advance(id);
    }
    (glyphs, x)
}

fn ink(picture: &mut Picture, area: Rect, font: &FontRef<'_>, glyph: Glyph, colour: [f32; 3]) {
    let Some(outline) = font.outline_glyph(glyph) else {
        return;
    };
    let bounds = outline.px_bounds();
    let (left, top) = (bounds.min.x as i64, bounds.min.y as i64);
    let inside = |at: i64, start: u32, length: u32| {
        (i64::from(start)..i64::from(start) + i64::from(length)).contains(&at)
    };
    outline.draw(|x, y, coverage| {
        let (x, y) = (left + i64::from(x), top + i64::from(y));
        if inside(x, area.x, area.width) && inside(y, area.y, area.height) {
            let pixel = &mut picture.row_mut(y as u32)[x as usize];
            for (p, c) in pixel.iter_mut().zip(colour) {
                *p += (c - *p) * coverage.clamp(0.0, 1.0);
            }
        }
    });
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::map::Size;

    fn written(width: u32, height: u32, text: &str, px: f32) -> (Picture, f32) {
        let size = Size::new(width, height).unwrap();
        let mut picture = Picture::new(size, [0.0; 3]);
        let used = write_text(&mut picture, size.rect(), text, px, Align::Centre, [1.0; 3]);
        (picture, used)
    }

    /// First and last column with ink.
    fn extent(picture: &Picture) -> Option<(u32, u32)> {
        let dark = |x: &u32| (0..picture.height()).all(|y| picture.pixel(*x, y)[0] < 0.02);
        let mut inked = (0..picture.width()).filter(|x| !dark(x));
        let first = inked.next()?;
        Some((first, inked.next_back().unwrap_or(first)))
    }

    #[test]
    fn long_text_shrinks_until_it_fits() {
        let long = "Ward\u{2013}D\u{fc}r, a very long caption indeed";
        for (text, width) in [
            ("Ward + map", 60),
            ("Ward + map", 400),
            (long, 120),
            (long, 250),
        ] {
            let (picture, used) = written(width, 40, text, 30.0);
            let (first, last) = extent(&picture).expect("something is drawn");
            assert!(used <= 30.0);
            assert!(
                first >= 1 && last + 2 <= width,
                "{text}: {first} to {last} of {width}"
            );
            // What does not need to shrink does not; what does uses the room it has.
            assert!(
                used == 30.0 || last - first + 6 > width,
                "{first} to {last} of {width}"
            );
        }
    }

    #[test]
    fn every_letter_of_the_captions_has_a_shape() {
        let font = FontRef::try_from_slice(FONT).unwrap();
        for letter in "Ward+–Dür\u{3b1}\u{394}\u{2212}\u{2265}\u{2026}°%0123456789,.:Жї".chars()
        {
            assert!(font.glyph_id(letter).0 != 0, "{letter}");
        }
    }

    #[test]
    fn no_room_and_no_text_are_fine() {
        assert_eq!(written(3, 3, "Ward", 20.0).1, 0.0);
        assert_eq!(written(50, 20, "", 20.0).1, 0.0);
        assert_eq!(written(50, 20, "x", f32::NAN).1, 20.0);
        assert!(extent(&written(50, 20, "line\nbreak\u{1F600}", 12.0).0).is_some());
    }
}
