//! Where a layer lies, as a see-through colour over any view.

use super::camera::Camera2d;
use super::levels::{Levels, Plane};
use super::pixel_ranges;
use super::sampler::Sampler;
use crate::error::{Error, Result};
use crate::map::{Rect, Size, Wrap};

/// The coverage of a layer or mask, 0 to 1 a texel, with its means over larger squares.
#[derive(Clone, Debug, PartialEq)]
pub struct Coverage {
    size: Size,
    values: Vec<f32>,
    levels: Levels<1>,
}

impl Coverage {
    /// From a plane in row order, top row first.
    ///
    /// # Errors
    /// When the plane is not as long as the size says.
    pub fn new(size: Size, values: Vec<f32>) -> Result<Self> {
        if values.len() != size.texels() {
            let allowed = format!("allowed: {} for {size}", size.texels());
            return Err(Error::invalid(
                "texels of a coverage",
                values.len(),
                allowed,
            ));
        }
        let levels = Levels::new(&Plane {
            size,
            values: &values,
        });
        Ok(Self {
            size,
            values,
            levels,
        })
    }

    /// The size of its map.
    pub fn size(&self) -> Size {
        self.size
    }

    /// Replaces a rectangle, given in row order; what lies outside is left out.
    ///
    /// # Panics
    /// When `values` are not as many as the rectangle has texels.
    pub fn change(&mut self, rect: Rect, values: &[f32]) {
        assert!(values.len() == rect.texels(), "a value for each texel");
        let Some(common) = rect.intersection(self.size.rect()) else {
            return;
        };
        let n = common.width as usize;
        for y in common.y..common.y + common.height {
            let (from, to) = (rect.index(common.x, y), self.size.rect().index(common.x, y));
            self.values[to..to + n].copy_from_slice(&values[from..from + n]);
        }
        let plane = Plane {
            size: self.size,
            values: &self.values,
        };
        self.levels.update(&plane, common);
    }

    /// Draws the pixels of `rect` in row order: the colour, where all is covered with this opacity and elsewhere with as much of
    /// it as there is coverage, alpha premultiplied.
    ///
    /// # Panics
    /// When `rgba` does not hold four bytes a pixel.
    pub fn draw(
        &self,
        wrap: Wrap,
        camera: &Camera2d,
        colour: [u8; 3],
        opacity: f32,
        rect: Rect,
        rgba: &mut [u8],
    ) {
        assert!(rgba.len() == 4 * rect.texels(), "four bytes a pixel");
        if rgba.is_empty() {
            return;
        }
        let plane = Plane {
            size: self.size,
            values: &self.values,
        };
        let pixels = pixel_ranges(rect, 0);
        let sampler = Sampler::new(&plane, &self.levels, wrap, camera, pixels, false);
        sampler.draw(rgba, |_, seen, out| {
            for (out, [covered]) in out.chunks_exact_mut(4).zip(seen) {
                out.copy_from_slice(&veil(colour, opacity * covered.clamp(0.0, 1.0)));
            }
        });
    }
}

/// A colour at some opacity, premultiplied.
pub(super) fn veil(colour: [u8; 3], opacity: f32) -> [u8; 4] {
    let part = |c: u8| (f32::from(c) * opacity + 0.5) as u8;
    [part(colour[0]), part(colour[1]), part(colour[2]), part(255)]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn coverage_is_averaged_changed_and_drawn_in_parts() {
        let size = Size::new(64, 64).unwrap();
        let values = |k: usize| (0..64 * 64).map(|i| ((i * k) % 7) as f32 / 6.0).collect();
        let mut coverage = Coverage::new(size, values(3)).unwrap();
        let camera = Camera2d::fit(size, Size::new(25, 25).unwrap(), 1.0);
        let draw = |c: &Coverage, rect: Rect| {
            let mut rgba = vec![0; 4 * rect.texels()];
            c.draw(Wrap::Repeat, &camera, [255, 100, 0], 0.62, rect, &mut rgba);
            rgba
        };
        let all = draw(&coverage, camera.size.rect());
        let part = draw(
            &coverage,
            Rect {
                x: 5,
                y: 9,
                width: 20,
                height: 1,
            },
        );
        assert_eq!(part, all[4 * (9 * 25 + 5)..][..80]);
        assert!(
            all.chunks(4)
                .all(|p| p[0] == p[3] && p[2] == 0 && p[3] <= 159)
        );
        let dab = Rect {
            x: 60,
            y: 3,
            width: 9,
            height: 2,
        };
        coverage.change(dab, &[0.25; 18]);
        let mut want: Vec<f32> = values(3);
        for y in 3..5 {
            want[y * 64 + 60..(y + 1) * 64].fill(0.25);
        }
        assert_eq!(coverage, Coverage::new(size, want).unwrap());
        assert!(Coverage::new(size, vec![0.0; 3]).is_err());
    }
}
