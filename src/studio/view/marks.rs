//! What is wrong with the map, over any view: poles and seams as marks for the window to draw, texels as a see-through colour.

use super::camera::{Camera2d, extent};
use super::coverage::veil;
use super::levels::{Levels, Rows};
use super::sampler::Sampler;
use super::{palette, pixel_ranges};
use crate::analyse::{Border, Marks, TexelMark, lint};
use crate::error::Result;
use crate::map::{AnisoMap, Mended, Rect, Size, Wrap};
use crate::mesh::Mesh;
use crate::progress::Progress;
use glam::{DVec2, Vec2};
use std::ops::Range;

/// Degrees of the first and the last colour of a seam: what cannot be seen, and what everybody sees.
pub const JUMP_SCALE: [f32; 2] = [1.0, 30.0];
/// Colours of texels with a warning and with a note.
const WARNING: [u8; 3] = [255, 96, 32];
const NOTE: [u8; 3] = [255, 214, 64];
/// How opaque a marked texel is, and the least of a pixel that has one somewhere: a single texel must be found from afar.
const OPACITY: f32 = 0.6;
const LEAST: f32 = 0.25;
/// Copies of a repeating map that marks are drawn in, along each side.
const COPIES_MAX: i64 = 8;

/// What [`Marks::find`] found, ready to be drawn: made in the background, drawn with every picture.
#[derive(Clone, Debug)]
pub struct LintMarks {
    marks: Marks,
    size: Size,
    wrap: Wrap,
    /// Shares of texels with a warning and with a note; none when no texel is marked.
    texels: Option<Levels<2>>,
    unmarked: Vec<String>,
}

/// A pole on the canvas.
#[derive(Clone, Debug, PartialEq)]
pub struct MarkedPole {
    /// Its place in canvas pixels.
    pub at: Vec2,
    /// Twice its index.
    pub halves: i32,
    /// Its index with its sign: `+1`, `-1/2`.
    pub label: String,
}

/// A part of a seam on the canvas.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MarkedSeam {
    /// Its ends in canvas pixels.
    pub ends: [Vec2; 2],
    /// The largest jump along it in degrees.
    pub degrees: f32,
    /// What it is.
    pub border: Border,
    /// Its colour, opaque RGBA; see [`seam_colour`].
    pub colour: [u8; 4],
}

/// The colour of a jump in degrees: from yellow at the first of [`JUMP_SCALE`] to red at the last, on a log scale.
pub fn seam_colour(degrees: f32) -> [u8; 4] {
    let [low, high] = JUMP_SCALE;
    let t = ((degrees / low).ln() / (high / low).ln()).clamp(0.0, 1.0);
    palette::heat()[(t * (palette::COLOURS - 1) as f32) as usize]
}

fn unmarked(map: &AnisoMap, marks: &Marks) -> Vec<String> {
    let is_marked = |code: &str| {
        let of_map = marks.seams.iter().filter(|s| s.border == Border::Map);
        let mut upright = of_map.map(|s| s.ends[0].x == s.ends[1].x);
        upright.any(|upright| upright == (code == "seam-u"))
    };
    let found = lint(map, Mended::default()).into_iter();
    found
        .filter(|f| matches!(f.code, "seam-u" | "seam-v") && !is_marked(f.code))
        .filter_map(|f| f.message.split(',').next().map(str::to_owned))
        .collect()
}

impl LintMarks {
    /// Looks a map over, and with a mesh the borders of its charts; takes as long as a few copies of the map.
    ///
    /// # Errors
    /// [`Error::Cancelled`](crate::error::Error::Cancelled) when `progress` says so.
    pub fn find(map: &AnisoMap, mesh: Option<&Mesh>, progress: &Progress<'_>) -> Result<Self> {
        let marks = Marks::find(map, mesh, progress)?;
        progress.check()?;
        let size = map.size();
        let texels = (!marks.texels.is_empty()).then(|| {
            Levels::new(&Marked {
                size,
                marks: &marks.texels,
            })
        });
        let unmarked = unmarked(map, &marks);
        progress.check()?;
        Ok(Self {
            marks,
            size,
            wrap: map.wrap(),
            texels,
            unmarked,
        })
    }

    /// Jumps of the map's own edges that [`lint`] tells of and that nothing is marked for, because the mesh does not show them:
    /// what it says of each, as a clause.
    pub fn unmarked(&self) -> &[String] {
        &self.unmarked
    }

    /// What was found, with places in the map.
    pub fn marks(&self) -> &Marks {
        &self.marks
    }

    /// The poles that the canvas shows, in every copy of the map.
    pub fn poles(&self, camera: &Camera2d) -> Vec<MarkedPole> {
        let shown = |at: &Vec2| on_canvas(camera, [*at; 2]);
        let copies = copies(camera, self.size, self.wrap);
        let poles = copies
            .iter()
            .flat_map(|by| self.marks.poles.iter().map(move |pole| (pole, *by)));
        poles
            .map(|(pole, by)| (pole, self.pixel(camera, pole.uv, by)))
            .filter(|(_, at)| shown(at))
            .map(|(pole, at)| MarkedPole {
                at,
                halves: pole.halves,
                label: pole.index(),
            })
            .collect()
    }

    /// The seams that the canvas shows, in every copy of the map.
    pub fn seams(&self, camera: &Camera2d) -> Vec<MarkedSeam> {
        let copies = copies(camera, self.size, self.wrap);
        let seams = copies
            .iter()
            .flat_map(|by| self.marks.seams.iter().map(move |seam| (seam, *by)));
        seams
            .map(|(seam, by)| MarkedSeam {
                ends: seam.ends.map(|uv| self.pixel(camera, uv, by)),
                degrees: seam.degrees,
                border: seam.border,
                colour: seam_colour(seam.degrees),
            })
            .filter(|seam| on_canvas(camera, seam.ends))
            .collect()
    }

    /// Draws the marked texels of `rect` in row order, alpha premultiplied; notes only with `notes`.
    ///
    /// # Panics
    /// When `rgba` does not hold four bytes a pixel.
    pub fn draw_texels(&self, camera: &Camera2d, notes: bool, rect: Rect, rgba: &mut [u8]) {
        assert!(rgba.len() == 4 * rect.texels(), "four bytes a pixel");
        let Some(levels) = &self.texels else {
            rgba.fill(0);
            return;
        };
        if rgba.is_empty() {
            return;
        }
        let marked = Marked {
            size: self.size,
            marks: &self.marks.texels,
        };
        let pixels = pixel_ranges(rect, 0);
        let sampler = Sampler::new(&marked, levels, self.wrap, camera, pixels, false);
        sampler.draw(rgba, |_, seen, out| {
            for (out, &shares) in out.chunks_exact_mut(4).zip(seen) {
                out.copy_from_slice(&mark_colour(shares, notes));
            }
        });
    }

    fn pixel(&self, camera: &Camera2d, uv: Vec2, by: DVec2) -> Vec2 {
        // Charts may lie in any copy of a repeating map: the marks belong to the first.
        let fold = |t: f32, repeats: bool| {
            if repeats && !(0.0..=1.0).contains(&t) {
                t - t.floor()
            } else {
                t
            }
        };
        let uv = Vec2::new(
            fold(uv.x, self.wrap.repeats_u()),
            fold(uv.y, self.wrap.repeats_v()),
        );
        camera.pixel_of_uv(self.size, uv.as_dvec2() + by).as_vec2()
    }
}

/// The copies of a map that the canvas shows, as whole steps in UV; the map alone when they would be many.
pub(super) fn copies(camera: &Camera2d, map: Size, wrap: Wrap) -> Vec<DVec2> {
    let corners = [DVec2::ZERO, extent(camera.size)].map(|p| camera.uv_at(map, p));
    let range = |a: f64, b: f64, repeats: bool| -> Range<i64> {
        let (first, end) = (a.min(b).floor(), a.max(b).ceil());
        if camera.repeat && repeats && end - first <= COPIES_MAX as f64 {
            first as i64..end as i64
        } else {
            0..1
        }
    };
    let columns = range(corners[0].x, corners[1].x, wrap.repeats_u());
    let rows = range(corners[0].y, corners[1].y, wrap.repeats_v());
    columns
        .flat_map(|i| rows.clone().map(move |j| DVec2::new(i as f64, j as f64)))
        .collect()
}

/// Whether a line may be seen on the canvas.
fn on_canvas(camera: &Camera2d, [a, b]: [Vec2; 2]) -> bool {
    let size = extent(camera.size).as_vec2();
    // A mark is some pixels large.
    let margin = Vec2::splat(24.0);
    (a.min(b).cmple(size + margin)).all() && (a.max(b).cmpge(-margin)).all()
}

fn mark_colour([warned, noted]: [f32; 2], notes: bool) -> [u8; 4] {
    let (colour, share) = if warned > 0.0 {
        (WARNING, warned)
    } else if notes {
        (NOTE, noted)
    } else {
        (NOTE, 0.0)
    };
    if share > 0.0 {
        veil(colour, OPACITY * share.clamp(LEAST, 1.0))
    } else {
        [0; 4]
    }
}

/// Marks as shares.
struct Marked<'a> {
    size: Size,
    marks: &'a [TexelMark],
}

impl Rows<2> for Marked<'_> {
    fn size(&self) -> Size {
        self.size
    }

    fn row(&self, y: u32, columns: Range<usize>, out: &mut [[f32; 2]]) {
        let row = &self.marks[y as usize * self.size.width() as usize..][columns];
        for (out, mark) in out.iter_mut().zip(row) {
            *out = match mark {
                TexelMark::None => [0.0, 0.0],
                TexelMark::Note => [0.0, 1.0],
                TexelMark::Warning => [1.0, 0.0],
            };
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::map::{DEFAULT_TEXEL, Texel};
    use crate::math::Axis;

    /// Circles around the middle of a map that repeats.
    fn circles() -> AnisoMap {
        let size = Size::new(64, 64).unwrap();
        let mut map = AnisoMap::constant(size, Wrap::Repeat, DEFAULT_TEXEL);
        for i in 0..size.texels() {
            let (x, y) = ((i % 64) as f32 - 31.5, 31.5 - (i / 64) as f32);
            let texel = Texel {
                alpha_x: 0.05,
                alpha_y: if i == 64 * 9 + 9 { 1.45 } else { 0.3 },
                axis: Axis::from_radians(y.atan2(x) + 1.570_796_4),
            };
            map.region_mut().set(i, texel);
        }
        map
    }

    #[test]
    fn marks_stand_at_their_places_in_every_copy() {
        let map = circles();
        let found = LintMarks::find(&map, None, &Progress::none()).unwrap();
        let mut camera = Camera2d::fit(map.size(), Size::new(640, 640).unwrap(), 1.0);
        let middle = found
            .poles(&camera)
            .into_iter()
            .find(|p| p.label == "+1")
            .unwrap();
        assert!((middle.at - Vec2::splat(320.0)).length() < 8.0);
        let alone = found.seams(&camera).len();
        assert!(alone > 0);
        camera.repeat = true;
        camera.zoom /= 2.0;
        let centres = found
            .poles(&camera)
            .iter()
            .filter(|p| p.label == "+1")
            .count();
        // At 0, 320 and 640 pixels both ways.
        assert_eq!(centres, 9);
        assert!(found.seams(&camera).len() > 2 * alone);
    }

    #[test]
    fn edges_that_the_mesh_keeps_away_from_are_told_and_not_marked() {
        // The direction climbs from left to right and jumps back at the edge.
        let size = Size::new(64, 64).unwrap();
        let mut map = AnisoMap::constant(size, Wrap::Repeat, DEFAULT_TEXEL);
        for i in 0..size.texels() {
            let axis = Axis::from_degrees((i % 64) as f32);
            map.region_mut().set(
                i,
                Texel {
                    alpha_x: 0.05,
                    alpha_y: 0.3,
                    axis,
                },
            );
        }
        let plane = crate::mesh::builtin("plane").unwrap();
        let mut inside = plane.clone();
        let middle = Vec2::splat(0.5);
        inside
            .uvs
            .iter_mut()
            .for_each(|uv| *uv = middle + (*uv - middle) * 0.5);
        let find = |mesh| LintMarks::find(&map, Some(mesh), &Progress::none()).unwrap();
        let (whole, kept) = (find(&plane), find(&inside));
        assert!(!whole.marks().seams.is_empty() && whole.unmarked().is_empty());
        assert!(kept.marks().seams.is_empty());
        let told =
            "the direction jumps by 63.0 degrees on average where the left and right edges meet";
        assert_eq!(kept.unmarked(), [told]);
        let inspected = lint(&map, Mended::default());
        assert!(inspected.iter().any(|f| f.message.starts_with(told)));
    }

    #[test]
    fn one_texel_is_found_from_afar() {
        let map = circles();
        let found = LintMarks::find(&map, None, &Progress::none()).unwrap();
        let camera = Camera2d::fit(map.size(), Size::new(16, 16).unwrap(), 1.0);
        let mut rgba = vec![0; 4 * 256];
        found.draw_texels(&camera, false, camera.size.rect(), &mut rgba);
        let marked: Vec<usize> = (0..256).filter(|i| rgba[4 * i + 3] > 30).collect();
        assert_eq!(marked, [2 * 16 + 2]);
        assert!(seam_colour(30.0) != seam_colour(3.0));
    }
}
