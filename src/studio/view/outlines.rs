//! The borders of a mesh's charts over the map: fine lines, drawn into pixels, since there may be a million.

use super::camera::{Camera2d, extent};
use super::marks::copies;
use crate::map::{Size, Wrap};
use crate::mesh::Mesh;
use glam::{DVec2, Vec2};

/// The most lines that are kept: of more the longest.
const LINES_MAX: usize = 1 << 20;
/// What a line is drawn with, and the ground beside it that lets it show on light maps too.
const INK: [f32; 3] = [255.0, 255.0, 255.0];
const OPACITY: f32 = 0.55;
const SHADE: f32 = 0.3;

/// Where the charts of a mesh end, in UV.
#[derive(Clone, Debug)]
pub struct Outlines {
    lines: Vec<[Vec2; 2]>,
}

impl Outlines {
    /// Finds them; takes seconds for meshes of many million triangles.
    pub fn new(mesh: &Mesh) -> Self {
        let mut lines = mesh.chart_borders();
        if lines.len() > LINES_MAX {
            let long = |l: &[Vec2; 2]| l[0].distance_squared(l[1]);
            lines.select_nth_unstable_by(LINES_MAX, |a, b| long(b).total_cmp(&long(a)));
            lines.truncate(LINES_MAX);
        }
        Self { lines }
    }

    /// How many lines there are.
    pub fn len(&self) -> usize {
        self.lines.len()
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.lines.is_empty()
    }

    /// Draws them over the whole canvas, in every copy of the map that it shows: RGBA, alpha premultiplied.
    ///
    /// # Panics
    /// When `rgba` does not hold four bytes a pixel of the canvas.
    pub fn draw(&self, map: Size, wrap: Wrap, camera: &Camera2d, rgba: &mut [u8]) {
        let size = camera.size;
        assert!(rgba.len() == 4 * size.texels(), "four bytes a pixel");
        rgba.fill(0);
        let mut covered = vec![0u8; size.texels()];
        // Without copies lines end with the map.
        let whole = [DVec2::new(0.0, 1.0), DVec2::new(1.0, 0.0)];
        let frame = whole.map(|uv| camera.pixel_of_uv(map, uv).as_vec2());
        let canvas = [Vec2::ZERO, extent(size).as_vec2()];
        let [u, v] = [wrap.repeats_u(), wrap.repeats_v()].map(|r| r && camera.repeat);
        let low = Vec2::new(
            if u { canvas[0].x } else { frame[0].x - 0.5 },
            if v { canvas[0].y } else { frame[0].y - 0.5 },
        );
        let high = Vec2::new(
            if u { canvas[1].x } else { frame[1].x + 0.5 },
            if v { canvas[1].y } else { frame[1].y + 0.5 },
        );
        let bounds = [low.max(canvas[0]), high.min(canvas[1])];
        let copies = copies(camera, map, wrap);
        for line in &self.lines {
            for by in images(*line, wrap) {
                for copy in &copies {
                    let at = |uv: Vec2| {
                        let uv = (uv + by).as_dvec2() + *copy;
                        camera.pixel_of_uv(map, uv).as_vec2()
                    };
                    if let Some(ends) = clipped(line.map(at), bounds) {
                        trace(ends, size, &mut covered);
                    }
                }
            }
        }
        ink(&covered, size, rgba);
    }
}

/// By how many turns of UV a line is moved to be seen on the map: all ways that it lies on it, where it repeats.
fn images(line: [Vec2; 2], wrap: Wrap) -> impl Iterator<Item = Vec2> {
    let (low, high) = (line[0].min(line[1]), line[0].max(line[1]));
    // One on an edge is seen at both.
    let turns = |low: f32, high: f32, repeats: bool| {
        let (first, last) = if repeats {
            ((low - 1e-5).floor(), (high + 1e-5).floor())
        } else {
            (0.0, 0.0)
        };
        // A chart of many turns is no layout to be read.
        (0..=(last - first).clamp(0.0, 3.0) as i32).map(move |n| -(first + n as f32))
    };
    let across = turns(low.x, high.x, wrap.repeats_u());
    across.flat_map(move |x| turns(low.y, high.y, wrap.repeats_v()).map(move |y| Vec2::new(x, y)))
}

/// The part of a line within a box (Liang and Barsky 1984).
fn clipped([a, b]: [Vec2; 2], [low, high]: [Vec2; 2]) -> Option<[Vec2; 2]> {
    let way = b - a;
    let (mut from, mut to) = (0.0f32, 1.0f32);
    for k in 0..2 {
        for (step, room) in [(-way[k], a[k] - low[k]), (way[k], high[k] - a[k])] {
            if step == 0.0 && room < 0.0 {
                return None;
            }
            let t = room / step;
            if step < 0.0 {
                from = from.max(t);
            } else if step > 0.0 {
                to = to.min(t);
            }
        }
    }
    (from <= to && a.is_finite() && b.is_finite()).then(|| [a + way * from, a + way * to])
}

/// Covers the pixels along a line, each step by the two pixels that it lies between.
fn trace([a, b]: [Vec2; 2], size: Size, covered: &mut [u8]) {
    let way = b - a;
    let steep = way.y.abs() > way.x.abs();
    let steps = way.abs().max_element().ceil().max(1.0) as u32;
    let (width, height) = (size.width() as i32, size.height() as i32);
    let mut put = |x: i32, y: i32, share: f32| {
        if (0..width).contains(&x) && (0..height).contains(&y) {
            let pixel = &mut covered[(y * width + x) as usize];
            *pixel = (*pixel).max((share * 255.0) as u8);
        }
    };
    for n in 0..=steps {
        // Pixels have their places in their middles.
        let at = a + way * (n as f32 / steps as f32) - 0.5;
        let (x, y) = (at.x.round() as i32, at.y.round() as i32);
        if steep {
            let part = at.x - at.x.floor();
            put(at.x.floor() as i32, y, 1.0 - part);
            put(at.x.floor() as i32 + 1, y, part);
        } else {
            let part = at.y - at.y.floor();
            put(x, at.y.floor() as i32, 1.0 - part);
            put(x, at.y.floor() as i32 + 1, part);
        }
    }
}

/// Lines in white over a shade on their lower right.
fn ink(covered: &[u8], size: Size, rgba: &mut [u8]) {
    let width = size.width() as usize;
    for (i, out) in rgba.chunks_exact_mut(4).enumerate() {
        let line = f32::from(covered[i]) / 255.0 * OPACITY;
        let beside = if i > width && i % width > 0 {
            f32::from(covered[i - width - 1]) / 255.0 * SHADE
        } else {
            0.0
        };
        let alpha = line + beside * (1.0 - line);
        if alpha > 0.0 {
            for (out, ink) in out.iter_mut().zip(INK) {
                *out = (ink * line) as u8;
            }
            out[3] = (255.0 * alpha) as u8;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh;

    fn drawn(wrap: Wrap, change: impl Fn(&mut Camera2d)) -> (Vec<u8>, usize) {
        let outlines = Outlines::new(&mesh::builtin("torus").unwrap());
        assert!(!outlines.is_empty());
        let (map, canvas) = (Size::new(64, 64).unwrap(), Size::new(200, 200).unwrap());
        let mut camera = Camera2d::fit(map, canvas, 1.0);
        camera.zoom *= 0.5;
        change(&mut camera);
        let mut rgba = vec![1; 4 * canvas.texels()];
        outlines.draw(map, wrap, &camera, &mut rgba);
        let inked = rgba.chunks_exact(4).filter(|p| p[0] > 60).count();
        (rgba, inked)
    }

    #[test]
    fn a_torus_is_framed_by_its_cut_in_every_copy() {
        let (rgba, alone) = drawn(Wrap::Repeat, |_| {});
        // A square of 100 pixels.
        assert!((300..=900).contains(&alone), "{alone}");
        let at = |x: usize, y: usize| rgba[4 * (y * 200 + x)];
        assert!(at(100, 49).max(at(100, 50)) > 60 && at(100, 100) == 0);
        let (_, copies) = drawn(Wrap::Repeat, |c| c.repeat = true);
        assert!(2 * copies > 3 * alone, "{copies} of {alone}");
    }

    #[test]
    fn any_zoom_and_any_place_draw_without_harm() {
        for zoom in [1e-4, 1e3] {
            for centre in [-1e6, 0.3, 1e6] {
                drawn(Wrap::Clamp, |c| {
                    (c.zoom, c.centre, c.repeat) = (zoom, DVec2::splat(centre), true);
                });
            }
        }
    }
}
