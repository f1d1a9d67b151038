//! Where on the map the canvas looks.

use crate::map::{Rect, Size, Wrap};
use glam::DVec2;

/// The least and the most canvas pixels that a texel may be high.
pub const ZOOM_RANGE: [f64; 2] = [1.0 / 32_768.0, 1024.0];

/// The part of a map that a canvas shows. Canvas pixels and texels both count from the upper left, x to the right, y down;
/// pixel (i, j) covers the square from (i, j) to (i + 1, j + 1).
///
/// Directions in a map belong to the surface. A texel that is `texel_aspect` times as wide as high on the surface is drawn so,
/// and then every direction stands on the canvas at its own angle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Camera2d {
    /// The texture coordinate in the middle of the canvas, v up.
    pub centre: DVec2,
    /// Canvas pixels per texel, downward. Taken to the nearest of [`ZOOM_RANGE`].
    pub zoom: f64,
    /// A texel's width over its height on the surface: the recipe's aspect over the map's; 1 for square texels.
    pub texel_aspect: f64,
    /// The canvas, in pixels.
    pub size: Size,
    /// Whether the map is shown again beyond those edges where it repeats; else nothing is.
    pub repeat: bool,
}

impl Camera2d {
    /// The whole map in the middle of the canvas, as large as it can be.
    pub fn fit(map: Size, canvas: Size, texel_aspect: f64) -> Self {
        let mut camera = Self {
            centre: DVec2::splat(0.5),
            zoom: 1.0,
            texel_aspect,
            size: canvas,
            repeat: false,
        };
        let room = extent(canvas) / (extent(map) * camera.pixels_per_texel());
        camera.zoom = room.min_element();
        camera
    }

    /// Canvas pixels per texel, to the right and downward: the zoom with hostile numbers taken out.
    pub fn pixels_per_texel(&self) -> DVec2 {
        let [least, most] = ZOOM_RANGE;
        let zoom = if self.zoom.is_finite() {
            self.zoom.clamp(least, most)
        } else {
            1.0
        };
        let aspect = if self.texel_aspect.is_finite() && self.texel_aspect > 0.0 {
            self.texel_aspect.clamp(1e-3, 1e3)
        } else {
            1.0
        };
        DVec2::new(zoom * aspect, zoom)
    }

    /// The place in texels that stands at a place on the canvas.
    pub fn texel_at(&self, map: Size, pixel: DVec2) -> DVec2 {
        self.middle(map) + (pixel - 0.5 * extent(self.size)) / self.pixels_per_texel()
    }

    /// The place on the canvas where a place in texels stands: of its copies in a repeating map the map's own.
    pub fn pixel_at(&self, map: Size, texel: DVec2) -> DVec2 {
        0.5 * extent(self.size) + (texel - self.middle(map)) * self.pixels_per_texel()
    }

    /// The texture coordinate, v up, that stands at a place on the canvas.
    pub fn uv_at(&self, map: Size, pixel: DVec2) -> DVec2 {
        let texel = self.texel_at(map, pixel) / extent(map);
        DVec2::new(texel.x, 1.0 - texel.y)
    }

    /// The place on the canvas of a texture coordinate.
    pub fn pixel_of_uv(&self, map: Size, uv: DVec2) -> DVec2 {
        self.pixel_at(map, DVec2::new(uv.x, 1.0 - uv.y) * extent(map))
    }

    /// The camera whose picture is moved by so many pixels.
    #[must_use]
    pub fn panned(self, map: Size, by: DVec2) -> Self {
        Self {
            centre: self.uv_at(map, 0.5 * extent(self.size) - by),
            ..self
        }
    }

    /// The camera that shows a texel `factor` times as large; what is at `pixel` stays there.
    #[must_use]
    pub fn zoomed(self, map: Size, pixel: DVec2, factor: f64) -> Self {
        let held = self.texel_at(map, pixel);
        let [least, most] = ZOOM_RANGE;
        let zoom = self.pixels_per_texel().y * factor;
        let zoom = if zoom.is_finite() {
            zoom.clamp(least, most)
        } else {
            self.zoom
        };
        let zoomed = Self { zoom, ..self };
        zoomed.panned(map, pixel - zoomed.pixel_at(map, held))
    }

    /// The canvas pixels that change with a rectangle of texels, where each shows what lies up to `reach` pixels from it: one
    /// rectangle for each copy of the map that is shown, and the whole canvas once there would be many.
    pub fn pixels_of(&self, map: Size, wrap: Wrap, texels: Rect, reach: u32) -> Vec<Rect> {
        let (low, high) = (
            DVec2::new(f64::from(texels.x), f64::from(texels.y)),
            DVec2::new(
                f64::from(texels.x + texels.width),
                f64::from(texels.y + texels.height),
            ),
        );
        // A pixel more on every side: neighbours share the texel at their border.
        let margin = DVec2::splat(f64::from(reach) + 1.0);
        let (low, high) = (
            self.pixel_at(map, low) - margin,
            self.pixel_at(map, high) + margin,
        );
        let period = extent(map) * self.pixels_per_texel();
        let canvas = extent(self.size);
        let copies = |low: f64, high: f64, period: f64, canvas: f64, repeats: bool| {
            let first = if repeats {
                (-high / period).ceil()
            } else {
                0.0
            };
            let last = if repeats {
                ((canvas - low) / period).floor()
            } else {
                0.0
            };
            (first as i64, last as i64)
        };
        let (left, right) = copies(
            low.x,
            high.x,
            period.x,
            canvas.x,
            self.repeat && wrap.repeats_u(),
        );
        let (top, bottom) = copies(
            low.y,
            high.y,
            period.y,
            canvas.y,
            self.repeat && wrap.repeats_v(),
        );
        let count = (right - left + 1).max(0) as i128 * (bottom - top + 1).max(0) as i128;
        if count > 64 {
            return vec![self.size.rect()];
        }
        let mut rects = Vec::new();
        for j in top..=bottom {
            for i in left..=right {
                let by = DVec2::new(i as f64, j as f64) * period;
                rects.extend(whole_pixels(low + by, high + by, canvas));
            }
        }
        rects
    }

    fn middle(&self, map: Size) -> DVec2 {
        let centre = if self.centre.is_finite() {
            self.centre
        } else {
            DVec2::splat(0.5)
        };
        DVec2::new(centre.x, 1.0 - centre.y) * extent(map)
    }
}

/// A size as a vector.
pub(super) fn extent(size: Size) -> DVec2 {
    DVec2::new(f64::from(size.width()), f64::from(size.height()))
}

/// The pixels of a canvas that a rectangle touches.
fn whole_pixels(low: DVec2, high: DVec2, canvas: DVec2) -> Option<Rect> {
    let low = low.floor().clamp(DVec2::ZERO, canvas);
    let high = high.ceil().clamp(DVec2::ZERO, canvas);
    (high.x > low.x && high.y > low.y).then_some(Rect {
        x: low.x as u32,
        y: low.y as u32,
        width: (high.x - low.x) as u32,
        height: (high.y - low.y) as u32,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn size(w: u32, h: u32) -> Size {
        Size::new(w, h).unwrap()
    }

    #[test]
    fn a_fitted_map_touches_two_edges() {
        let camera = Camera2d::fit(size(512, 256), size(900, 900), 1.0);
        assert!((camera.zoom - 900.0 / 512.0).abs() < 1e-12);
        let corner = camera.pixel_at(size(512, 256), DVec2::ZERO);
        assert!((corner - DVec2::new(0.0, 225.0)).length() < 1e-9);
        // Texels twice as wide as high make the same map four times as wide as high.
        let wide = Camera2d::fit(size(512, 256), size(900, 900), 2.0);
        assert!((wide.zoom - 900.0 / 1024.0).abs() < 1e-12);
    }

    #[test]
    fn places_go_there_and_back_and_zooming_holds_its_pixel() {
        let map = size(300, 200);
        let camera = Camera2d {
            centre: DVec2::new(0.3, 0.8),
            zoom: 3.7,
            texel_aspect: 1.5,
            size: size(640, 480),
            repeat: true,
        };
        let pixel = DVec2::new(100.25, 17.0);
        let back = camera.pixel_of_uv(map, camera.uv_at(map, pixel));
        assert!((back - pixel).length() < 1e-9);
        let held = camera.texel_at(map, pixel);
        let zoomed = camera.zoomed(map, pixel, 2.5);
        assert!((zoomed.texel_at(map, pixel) - held).length() < 1e-9);
        assert!((zoomed.zoom / camera.zoom - 2.5).abs() < 1e-12);
        let panned = camera.panned(map, DVec2::new(5.0, -3.0));
        assert!((panned.texel_at(map, pixel + DVec2::new(5.0, -3.0)) - held).length() < 1e-9);
    }

    #[test]
    fn hostile_numbers_make_a_camera_still() {
        for zoom in [f64::NAN, f64::INFINITY, -1.0, 0.0, 1e300] {
            let camera = Camera2d {
                centre: DVec2::NAN,
                zoom,
                texel_aspect: zoom,
                size: size(10, 10),
                repeat: true,
            };
            assert!(camera.texel_at(size(8, 8), DVec2::ONE).is_finite());
            let zoomed = camera.zoomed(size(8, 8), DVec2::ONE, f64::NAN);
            assert!(zoomed.texel_at(size(8, 8), DVec2::ONE).is_finite());
            let whole = size(8, 8).rect();
            assert!(
                !camera
                    .pixels_of(size(8, 8), Wrap::Repeat, whole, 3)
                    .is_empty()
            );
        }
    }

    #[test]
    fn a_changed_texel_is_redrawn_in_every_copy() {
        let map = size(10, 10);
        let mut camera = Camera2d::fit(map, size(100, 100), 1.0);
        let texel = Rect {
            x: 0,
            y: 9,
            width: 1,
            height: 1,
        };
        let own = Rect {
            x: 0,
            y: 89,
            width: 11,
            height: 11,
        };
        assert_eq!(camera.pixels_of(map, Wrap::Repeat, texel, 0), [own]);
        camera.repeat = true;
        // The margin of the copies on the left, above, below and on the right reaches into the canvas too.
        let all = camera.pixels_of(map, Wrap::Repeat, texel, 0);
        assert!(all.contains(&own));
        assert_eq!(all.len(), 4, "{all:?}");
        camera.zoom = 0.01;
        let all = camera.pixels_of(map, Wrap::Repeat, texel, 0);
        assert_eq!(all, [camera.size.rect()]);
    }
}
