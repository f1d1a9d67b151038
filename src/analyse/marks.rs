//! Where in a map something is that [`lint`](super::lint) tells of: poles, seams and texels, with their places, to be drawn.

use super::field::{self, Poles, degrees, groove};
use super::lint::{index_name, is_seen, noted, warned};
use crate::error::Result;
use crate::map::{AnisoMap, Size, turn};
use crate::math::{Axis, Frame};
use crate::mesh::Mesh;
use crate::progress::Progress;
use glam::{Vec2, Vec3};
use rayon::prelude::*;
use std::collections::HashMap;

/// Jumps below this are no marks, in degrees.
const LEAST_DEGREES: f32 = 0.5;
/// Pairs at the edge of the map whose jumps differ by less than this are one mark, in degrees.
const ALIKE_DEGREES: f32 = 1.0;
/// Places along an edge of the mesh are so many texels apart, and at the most so many.
const PLACES_APART: f32 = 4.0;
const PLACES_MAX: f32 = 256.0;
/// Seams or rows that one thread takes at a time.
const STRETCH: usize = 64;

/// A point that the direction turns around.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pole {
    /// Its texture coordinate, v up.
    pub uv: Vec2,
    /// Twice its index: 2 the centre of circles or spokes, 1 the end of a fold, -1 a star of three arms.
    pub halves: i32,
}

impl Pole {
    /// Its index with its sign: `+1`, `-1/2`.
    pub fn index(&self) -> String {
        index_name(self.halves)
    }
}

/// Where a seam comes from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Border {
    /// An edge of the map, where it repeats.
    Map,
    /// An edge of a chart of the mesh's layout.
    Chart,
}

/// A line in the map across which the direction jumps, on the map or on the surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Seam {
    /// Its ends, as texture coordinates, v up.
    pub ends: [Vec2; 2],
    /// The largest jump along it in degrees, up to 90.
    pub degrees: f32,
    /// What it is.
    pub border: Border,
}

/// What a texel is marked for.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum TexelMark {
    /// Nothing.
    #[default]
    None,
    /// Some file format holds its widths badly.
    Note,
    /// Its widths are out of the range of some format and will be clamped there.
    Warning,
}

/// Everything that can be marked in a map.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Marks {
    /// The poles of the smooth field, from the top; none where the field is rough, none at corners of edges between directions.
    pub poles: Vec<Pole>,
    /// How many loops of texels turn, where these are too many for poles.
    pub rough: Option<u64>,
    /// The seams that jump by half a degree or more; each has a mark on both sides.
    pub seams: Vec<Seam>,
    /// A mark for every texel in row order, top row first; empty when there is none at all.
    pub texels: Vec<TexelMark>,
}

impl Marks {
    /// Looks a map over, and with a mesh the borders of its charts.
    ///
    /// # Errors
    /// [`Error::Cancelled`](crate::error::Error::Cancelled) when `progress` says so.
    pub fn find(map: &AnisoMap, mesh: Option<&Mesh>, progress: &Progress<'_>) -> Result<Self> {
        let field = field::walk(map, progress)?;
        let (poles, rough) = match field.poles {
            Poles::Rough(count, _) => (Vec::new(), Some(count)),
            Poles::Each(poles) => (poles, None),
        };
        // Where every texel turns, what the edges do tells nothing by itself.
        let counts =
            |seam: &Option<field::Seam>| rough.is_none() || seam.as_ref().is_some_and(is_seen);
        let reached = mesh.map(|mesh| Reached::new(map.size(), mesh));
        let counts = [counts(&field.seam_u), counts(&field.seam_v)];
        let mut seams = map_seams(map, counts, reached.as_ref());
        if let Some(mesh) = mesh {
            seams.extend(chart_seams(map, mesh, progress)?);
        }
        Ok(Self {
            poles: poles
                .into_iter()
                .filter(|p| !p.is_at_edge)
                .map(|p| Pole {
                    uv: from_texels(map.size(), p.middle),
                    halves: p.halves,
                })
                .collect(),
            rough,
            seams,
            texels: texel_marks(map, progress)?,
        })
    }
}

/// A place in texels from the upper left as a texture coordinate.
fn from_texels(size: Size, texels: Vec2) -> Vec2 {
    let uv = texels / Vec2::new(size.width() as f32, size.height() as f32);
    Vec2::new(uv.x, 1.0 - uv.y)
}

fn texel_marks(map: &AnisoMap, progress: &Progress<'_>) -> Result<Vec<TexelMark>> {
    let mut marks = vec![TexelMark::None; map.size().texels()];
    let stretch = STRETCH * map.width() as usize;
    progress.expect(marks.len().div_ceil(stretch) as u64);
    let parts = marks
        .par_chunks_mut(stretch)
        .enumerate()
        .map(|(k, marks)| {
            progress.step()?;
            let mut any = false;
            for (i, mark) in marks.iter_mut().enumerate() {
                let texel = map.texel_at(k * stretch + i);
                if warned(texel) {
                    *mark = TexelMark::Warning;
                } else if noted(texel) {
                    *mark = TexelMark::Note;
                }
                any |= *mark != TexelMark::None;
            }
            Ok(any)
        })
        .collect::<Result<Vec<bool>>>()?;
    Ok(if parts.contains(&true) {
        marks
    } else {
        Vec::new()
    })
}

/// How far around a place of an edge the map is looked at for jumps as large, in texels.
const AROUND: i32 = 4;
/// So many times the largest turn beside it a jump must be, or the field only turns fast there.
const EXCESS: f32 = 1.25;

/// The angle between two grooves in degrees; `None` where one has no direction.
fn angle(a: Vec2, b: Vec2) -> Option<f32> {
    let turn = turn(a, b);
    (!turn.is_nan()).then(|| degrees(turn))
}

/// Whether a jump over an edge is more than what the field does beside it: where grooves of two directions meet, the line
/// between them goes on over the edge. `at` gives the groove so many rows inside and so many texels along, on either side.
fn stands_out(jump: f32, sides: [&dyn Fn(i32, i32) -> Vec2; 2]) -> bool {
    let most = jump / EXCESS;
    let along = 2 * AROUND + 1;
    let columns = along as usize;
    sides.into_iter().all(|at| {
        let grooves: Vec<Vec2> = (0..=AROUND)
            .flat_map(|depth| (0..along).map(move |k| at(depth, k - AROUND)))
            .collect();
        let less = |a: Vec2, b: Vec2| angle(a, b).is_none_or(|turn| turn < most);
        let inward = grooves.iter().zip(&grooves[columns..]);
        inward.into_iter().all(|(a, b)| less(*a, *b))
            && grooves
                .chunks(columns)
                .all(|row| row.windows(2).all(|pair| less(pair[0], pair[1])))
    })
}

/// The rows that a mesh's layout comes near the left or right edge of the map in, and the columns in which it comes near the
/// upper or lower one: elsewhere nothing of the surface lies at the edge.
struct Reached {
    rows: Vec<bool>,
    columns: Vec<bool>,
}

/// How near to an edge of the map a triangle must come to reach it, in texels: what is looked up between texels.
const REACH: f32 = 1.0;
/// Turns of a map that a triangle may span and be followed edge by edge.
const TURNS_MAX: f32 = 64.0;

impl Reached {
    fn new(size: Size, mesh: &Mesh) -> Self {
        let mut reached = Self {
            rows: vec![false; size.height() as usize],
            columns: vec![false; size.width() as usize],
        };
        let texels = Vec2::new(size.width() as f32, size.height() as f32);
        for triangle in &mesh.triangles {
            let corners = triangle.map(|v| {
                let uv = mesh.uvs[v as usize];
                Vec2::new(uv.x, 1.0 - uv.y) * texels
            });
            let turned = corners.map(|p| Vec2::new(p.y, p.x));
            mark_reached(&mut reached.rows, corners, texels.x);
            mark_reached(&mut reached.columns, turned, texels.y);
        }
        reached
    }
}

/// Marks the rows in which a triangle, in texels, comes near a multiple of `side` in x.
fn mark_reached(rows: &mut [bool], corners: [Vec2; 3], side: f32) {
    let xs = corners.map(|p| p.x);
    let (low, high) = (xs[0].min(xs[1]).min(xs[2]), xs[0].max(xs[1]).max(xs[2]));
    let first = ((low - REACH) / side).ceil();
    let last = ((high + REACH) / side).floor();
    if last - first > TURNS_MAX {
        rows.fill(true);
        return;
    }
    for edge in first as i64..=last as i64 {
        let strip = [-REACH, REACH].map(|by| edge as f32 * side + by);
        let (mut top, mut bottom) = (f32::MAX, f32::MIN);
        for k in 0..3 {
            if let Some([a, b]) = rows_in_strip(corners[k], corners[(k + 1) % 3], strip) {
                (top, bottom) = (top.min(a.min(b)), bottom.max(a.max(b)));
            }
        }
        mark_span(rows, top - REACH, bottom + REACH);
    }
}

/// Where a line comes into a strip of x and leaves it, as y.
fn rows_in_strip(from: Vec2, to: Vec2, [low, high]: [f32; 2]) -> Option<[f32; 2]> {
    let along = to - from;
    if along.x == 0.0 {
        return (low..=high).contains(&from.x).then_some([from.y, to.y]);
    }
    let ends = [low, high].map(|x| ((x - from.x) / along.x).clamp(0.0, 1.0));
    let meets = from.x.min(to.x) <= high && from.x.max(to.x) >= low;
    meets.then(|| ends.map(|t| from.y + t * along.y))
}

/// Marks the rows from one place to another, in every turn of the map.
fn mark_span(rows: &mut [bool], top: f32, bottom: f32) {
    let n = rows.len() as f32;
    if bottom - top >= n {
        rows.fill(true);
    } else if top <= bottom {
        let count = rows.len() as i64;
        for row in top.floor() as i64..=bottom.floor() as i64 {
            rows[row.rem_euclid(count) as usize] = true;
        }
    }
}

/// The jumps over the edges where the map repeats, as marks on both edges; on a mesh where something of it lies there.
fn map_seams(map: &AnisoMap, counts: [bool; 2], reached: Option<&Reached>) -> Vec<Seam> {
    let (w, h) = (map.width(), map.height());
    // The jump at a place along the edge between the last and the first texel of so many.
    let over_edge = |side: u32, length: u32, at: &dyn Fn(u32, u32) -> (u32, u32), place: u32| {
        let groove = |x: u32, y: u32| {
            let (x, y) = at(x, y);
            groove(map.texel(x, y))
        };
        let jump = angle(groove(side - 1, place), groove(0, place)).unwrap_or(0.0);
        let along = |k: i32| place.saturating_add_signed(k).min(length - 1);
        let inside = |depth: i32| depth.unsigned_abs().min(side - 1);
        let left = |depth: i32, k: i32| groove(inside(depth), along(k));
        let right = |depth: i32, k: i32| groove(side - 1 - inside(depth), along(k));
        let counts = jump >= LEAST_DEGREES && stands_out(jump, [&left, &right]);
        if counts { jump } else { 0.0 }
    };
    let is_reached = |edge: fn(&Reached) -> &[bool], place: u32| {
        reached.is_none_or(|reached| edge(reached)[place as usize])
    };
    let mut seams = Vec::new();
    let mut mark = |from: u32, to: u32, degrees: f32, place: &dyn Fn(u32, f32) -> Vec2| {
        for edge in [0.0, 1.0] {
            seams.push(Seam {
                ends: [from, to].map(|i| place(i, edge)),
                degrees,
                border: Border::Map,
            });
        }
    };
    if counts[0] && map.wrap().repeats_u() && w > 1 {
        let place = |i: u32, edge: f32| Vec2::new(edge, 1.0 - i as f32 / h as f32);
        let jump = |y: u32| match is_reached(|r| &r.rows, y) {
            true => over_edge(w, h, &|x, y| (x, y), y),
            false => 0.0,
        };
        let jumps: Vec<f32> = (0..h).map(jump).collect();
        each_run(&jumps, |from, to, degrees| mark(from, to, degrees, &place));
    }
    if counts[1] && map.wrap().repeats_v() && h > 1 {
        let place = |i: u32, edge: f32| Vec2::new(i as f32 / w as f32, edge);
        let jump = |x: u32| match is_reached(|r| &r.columns, x) {
            true => over_edge(h, w, &|y, x| (x, y), x),
            false => 0.0,
        };
        let jumps: Vec<f32> = (0..w).map(jump).collect();
        each_run(&jumps, |from, to, degrees| mark(from, to, degrees, &place));
    }
    seams
}

/// Calls `run` with the ends and the largest jump of each run of jumps that are alike and large enough.
fn each_run(jumps: &[f32], mut run: impl FnMut(u32, u32, f32)) {
    let mut start = 0;
    let place = |i: usize| u32::try_from(i).expect("a side of a map fits 32 bits");
    for i in 1..=jumps.len() {
        let ends = i == jumps.len()
            || (jumps[i] - jumps[start]).abs() >= ALIKE_DEGREES
            || (jumps[i] < LEAST_DEGREES) != (jumps[start] < LEAST_DEGREES);
        if ends {
            let largest = jumps[start..i].iter().fold(0.0f32, |m, j| m.max(*j));
            if largest >= LEAST_DEGREES {
                run(place(start), place(i), largest);
            }
            start = i;
        }
    }
}

/// The cosine of the angle, 40 degrees, beyond which charts meet at a crease, which is no seam: parts of a thing meet there.
const CREASE_COS: f32 = 0.766;

/// An edge of a triangle: number of the triangle and of its corner where the edge starts.
type HalfEdge = (u32, u8);

/// The edges where two triangles meet on the surface and not in the layout.
fn chart_borders(mesh: &Mesh) -> Vec<[HalfEdge; 2]> {
    let mut numbers: HashMap<[u32; 3], u32> = HashMap::new();
    let places: Vec<u32> = mesh
        .positions
        .iter()
        .map(|p| {
            let next = numbers.len() as u32;
            // Adding 0 makes -0 and 0 one place.
            let key = p.to_array().map(|x| (x + 0.0).to_bits());
            *numbers.entry(key).or_insert(next)
        })
        .collect();
    drop(numbers);
    let mut edges: Vec<(u64, u32, u8)> = Vec::with_capacity(3 * mesh.triangles.len());
    for (t, triangle) in (0u32..).zip(&mesh.triangles) {
        for k in 0..3u8 {
            let [a, b] = ends((t, k), triangle).map(|v| places[v]);
            let (low, high) = (a.min(b), a.max(b));
            edges.push(((u64::from(low) << 32) | u64::from(high), t, k));
        }
    }
    edges.par_sort_unstable();
    let together = |v: usize, w: usize| mesh.uvs[v] == mesh.uvs[w];
    edges
        .chunk_by(|a, b| a.0 == b.0)
        .filter(|pair| pair.len() == 2)
        .map(|pair| [(pair[0].1, pair[0].2), (pair[1].1, pair[1].2)])
        .filter(|[first, second]| {
            let [a, b] = ends(*first, &mesh.triangles[first.0 as usize]);
            let [c, d] = ends(*second, &mesh.triangles[second.0 as usize]);
            let (c, d) = if places[a] == places[c] {
                (c, d)
            } else {
                (d, c)
            };
            places[a] != places[b] && !(together(a, c) && together(b, d))
        })
        .collect()
}

fn ends((_, k): HalfEdge, triangle: &[u32; 3]) -> [usize; 2] {
    let k = usize::from(k);
    [triangle[k] as usize, triangle[(k + 1) % 3] as usize]
}

/// The jumps on the surface over the borders of charts, as marks on both sides.
fn chart_seams(map: &AnisoMap, mesh: &Mesh, progress: &Progress<'_>) -> Result<Vec<Seam>> {
    progress.check()?;
    let borders = chart_borders(mesh);
    progress.expect(borders.len().div_ceil(STRETCH) as u64);
    let parts = borders
        .par_chunks(STRETCH)
        .map(|borders| {
            progress.step()?;
            let marks = borders.iter().flat_map(|b| border_marks(map, mesh, *b));
            Ok(marks.collect())
        })
        .collect::<Result<Vec<Vec<Seam>>>>()?;
    Ok(parts.concat())
}

fn border_marks(map: &AnisoMap, mesh: &Mesh, [first, second]: [HalfEdge; 2]) -> Vec<Seam> {
    let a = Side::new(map.size(), mesh, first);
    let mut b = Side::new(map.size(), mesh, second);
    if a.normal(mesh).dot(b.normal(mesh)) < CREASE_COS {
        return Vec::new(); // the light breaks there whatever the grooves do
    }
    // Both from the same end.
    if a.ends[0].0.distance_squared(b.ends[0].0) > a.ends[0].0.distance_squared(b.ends[1].0) {
        b.ends.reverse();
    }
    let texels = a.texels(map.size()).max(b.texels(map.size()));
    let count = (texels / PLACES_APART).ceil().clamp(1.0, PLACES_MAX);
    let jump = |i: u32| {
        let t = (i as f32 + 0.5) / count;
        let here = angle(a.groove(map, mesh, t)?, b.groove(map, mesh, t)?)?;
        // As at the edges of the map.
        let beside = |side: &Side, depth: i32, k: i32| side.groove_in_map(map, t, depth, k);
        let (in_a, in_b) = (|d, k| beside(&a, d, k), |d, k| beside(&b, d, k));
        (here >= LEAST_DEGREES && stands_out(here, [&in_a, &in_b])).then_some(here)
    };
    let jumps: Vec<f32> = (0..count as u32).map(|i| jump(i).unwrap_or(0.0)).collect();
    let mut marks = Vec::new();
    each_run(&jumps, |from, to, degrees| {
        marks.extend([&a, &b].map(|side| {
            let [(_, start, _), (_, end, _)] = side.ends;
            Seam {
                ends: [from, to].map(|i| start.lerp(end, i as f32 / count)),
                degrees,
                border: Border::Chart,
            }
        }));
    });
    marks
}

/// One side of a border: its ends as position, texture coordinate and vertex, and the steps of a texel along it and into the
/// triangle.
struct Side {
    ends: [(Vec3, Vec2, usize); 2],
    along: Vec2,
    inward: Vec2,
}

impl Side {
    fn new(size: Size, mesh: &Mesh, edge: HalfEdge) -> Self {
        let triangle = &mesh.triangles[edge.0 as usize];
        let ends = ends(edge, triangle).map(|v| (mesh.positions[v], mesh.uvs[v], v));
        let texels = Vec2::new(size.width() as f32, size.height() as f32);
        let along = (ends[1].1 - ends[0].1) * texels;
        let apex = mesh.uvs[triangle[(usize::from(edge.1) + 2) % 3] as usize];
        let across = along.perp().normalize_or_zero();
        let sign = across.dot((apex - ends[0].1) * texels).signum();
        Self {
            ends,
            along: along.normalize_or_zero() / texels,
            inward: sign * across / texels,
        }
    }

    /// The unit normal in its middle.
    fn normal(&self, mesh: &Mesh) -> Vec3 {
        let [v, w] = self.ends.map(|(_, _, vertex)| mesh.normals[vertex]);
        (v + w).normalize_or_zero()
    }

    /// Its length in texels.
    fn texels(&self, size: Size) -> f32 {
        let texels = Vec2::new(size.width() as f32, size.height() as f32);
        ((self.ends[1].1 - self.ends[0].1) * texels).length()
    }

    /// The double-angle vector of the groove part of the way along, `depth` rows of texels inside the first and `k` texels
    /// farther along, as it stands in the map.
    fn groove_in_map(&self, map: &AnisoMap, t: f32, depth: i32, k: i32) -> Vec2 {
        let [(_, from, _), (_, to, _)] = self.ends;
        let inward = self.inward * (depth as f32 + 0.5);
        let uv = from.lerp(to, t) + inward + self.along * k as f32;
        groove(map.sample(uv.x, uv.y))
    }

    /// The double-angle vector of the groove part of the way along, in the first row of texels, measured from the edge in the plane
    /// of the surface: charts that meet at a crease are folded flat. `None` without a direction.
    fn groove(&self, map: &AnisoMap, mesh: &Mesh, t: f32) -> Option<Vec2> {
        let [(from, _, v), (to, _, w)] = self.ends;
        let normal = mesh.normals[v].lerp(mesh.normals[w], t);
        let tangent = mesh.tangents[v].lerp(mesh.tangents[w], t);
        let tangent = tangent.truncate().extend(mesh.tangents[v].w);
        let (frame, usable) = Frame::new(normal, tangent)?;
        let edge = frame.to_local(to - from).truncate();
        let edge = Axis::from_vector(edge)?;
        let groove = self.groove_in_map(map, t, 0, 0);
        // The difference of the angles; a mirrored layout turns the other way round.
        let (cross, dot) = (
            edge.cos2 * groove.y - edge.sin2 * groove.x,
            edge.cos2 * groove.x + edge.sin2 * groove.y,
        );
        let hand = if mesh.tangents[v].w < 0.0 { -1.0 } else { 1.0 };
        usable.then(|| Vec2::new(dot, hand * cross))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::map::{DEFAULT_TEXEL, Texel, Wrap};
    use std::f32::consts::TAU;

    fn map(w: u32, h: u32, wrap: Wrap, angle: impl Fn(f32, f32) -> f32) -> AnisoMap {
        let mut map = AnisoMap::constant(Size::new(w, h).unwrap(), wrap, DEFAULT_TEXEL);
        for i in 0..map.size().texels() {
            let (x, y) = (i as u32 % w, i as u32 / w);
            let (u, v) = (
                (x as f32 + 0.5) / w as f32,
                1.0 - (y as f32 + 0.5) / h as f32,
            );
            let axis = Axis::from_radians(angle(u, v));
            let texel = Texel {
                alpha_x: 0.05,
                alpha_y: 0.4,
                axis,
            };
            map.region_mut().set(i, texel);
        }
        map
    }

    fn marks(map: &AnisoMap, mesh: Option<&Mesh>) -> Marks {
        Marks::find(map, mesh, &Progress::none()).unwrap()
    }

    #[test]
    fn a_pole_is_marked_at_its_place_with_its_index() {
        for (factor, index) in [(1.0, "+1"), (0.5, "+1/2"), (-0.5, "-1/2"), (-1.0, "-1")] {
            let m = map(200, 160, Wrap::Clamp, |u, v| {
                factor * (v - 0.3).atan2((u - 0.6) * 1.25) + 0.2
            });
            let found = marks(&m, None).poles;
            assert_eq!(found.len(), 1);
            assert_eq!(found[0].index(), index);
            assert!(
                (found[0].uv - Vec2::new(0.6, 0.3)).length() < 0.01,
                "{found:?}"
            );
        }
    }

    #[test]
    fn the_indices_of_a_repeating_map_sum_to_zero() {
        // Half the angle of a vector field that repeats: its zeros are poles of both signs.
        for k in 1..4u8 {
            let k = f32::from(k);
            let m = map(128, 96, Wrap::Repeat, |u, v| {
                let x = (TAU * k * u).sin() + 0.4 * (TAU * v + 0.7).cos();
                let y = (TAU * v).sin() - 0.3 * (TAU * u).cos();
                0.5 * y.atan2(x)
            });
            let poles = marks(&m, None).poles;
            assert!(poles.len() >= 4, "{poles:?}");
            assert_eq!(poles.iter().map(|p| p.halves).sum::<i32>(), 0, "{poles:?}");
        }
    }

    #[test]
    fn seams_of_the_map_are_marked_on_both_edges() {
        // The direction climbs by 60 degrees from left to right in the upper half.
        let ramp = |u: f32, v: f32| {
            if v > 0.5 {
                (60.0 * u).to_radians()
            } else {
                0.3
            }
        };
        let found = marks(&map(120, 40, Wrap::RepeatU, ramp), None).seams;
        assert_eq!(found.len(), 2, "{found:?}");
        for (seam, u) in found.iter().zip([0.0, 1.0]) {
            assert!((seam.degrees - 59.5).abs() < 0.01, "{seam:?}");
            assert_eq!(seam.ends, [Vec2::new(u, 1.0), Vec2::new(u, 0.5)]);
        }
        assert_eq!(marks(&map(120, 40, Wrap::Clamp, ramp), None).seams, []);
    }

    #[test]
    fn an_edge_between_directions_that_crosses_the_edge_of_the_map_is_no_seam() {
        // A band of other grooves that climbs and falls around the map, steepest at the edge.
        let band = |u: f32, v: f32| {
            let middle = 0.5 + 0.3 * (TAU * u).sin();
            if (v - middle).abs() < 0.1 { 1.0 } else { 0.2 }
        };
        let torus = crate::mesh::torus();
        let m = map(150, 110, Wrap::Repeat, band);
        assert_eq!(marks(&m, None).seams, []);
        assert_eq!(marks(&m, Some(&torus)).seams, []);
        // A jump of its own is told beside it all the same, but for the texels where the band meets the edge.
        let cut = map(150, 110, Wrap::Repeat, |u, v| band(u, v) + 0.3 * u);
        for mesh in [None, Some(&torus)] {
            let found = marks(&cut, mesh).seams;
            // Where the band meets the edge both jumps come together.
            let is_own = |s: &&Seam| (s.degrees - 17.1).abs() < 0.6;
            let lines = found
                .iter()
                .filter(|s| s.border == Border::Map && s.ends[0].x == 0.0)
                .filter(is_own);
            let long: f32 = lines.map(|s| (s.ends[0].y - s.ends[1].y).abs()).sum();
            assert!((0.5..1.0).contains(&long), "{long}: {found:?}");
        }
    }

    #[test]
    fn beside_the_charts_of_a_mesh_the_edge_of_the_map_is_no_seam() {
        let jump = map(100, 80, Wrap::Repeat, |u, _| (50.0 * u).to_radians());
        let half = |low: f32, high: f32| {
            let mut mesh = crate::mesh::plane();
            let span = |uv: &mut Vec2| uv.y = low + (high - low) * uv.y;
            mesh.uvs.iter_mut().for_each(span);
            marks(&jump, Some(&mesh)).seams
        };
        for seam in half(0.25, 0.75) {
            let inside = |end: &Vec2| (0.2..=0.8).contains(&end.y);
            assert!(seam.ends.iter().all(inside), "{seam:?}");
        }
        assert_eq!(half(0.25, 0.75).len(), 2);
        let whole = half(0.0, 1.0);
        assert_eq!(whole[0].ends, [Vec2::new(0.0, 1.0), Vec2::new(0.0, 0.0)]);
        // A layout that keeps away from the edge, and one of many turns.
        let mut mesh = crate::mesh::plane();
        mesh.uvs.iter_mut().for_each(|uv| *uv = 0.1 + 0.8 * *uv);
        assert_eq!(marks(&jump, Some(&mesh)).seams, []);
        mesh.uvs.iter_mut().for_each(|uv| *uv *= 1e9);
        assert_eq!(marks(&jump, Some(&mesh)).seams.len(), 2);
        mesh.uvs.iter_mut().for_each(|uv| *uv = Vec2::NAN);
        assert_eq!(marks(&jump, Some(&mesh)).seams, []);
    }

    #[test]
    fn charts_of_a_mesh_meet_without_a_jump_where_the_field_goes_on() {
        let torus = crate::mesh::torus();
        let even = map(256, 128, Wrap::Repeat, |_, _| 0.4);
        assert_eq!(marks(&even, Some(&torus)).seams, []);
        // 40 degrees more around the torus: the jump is at the edge where the turn closes.
        let ramp = map(256, 128, Wrap::Clamp, |u, _| (40.0 * u).to_radians());
        let found = marks(&ramp, Some(&torus)).seams;
        assert!(!found.is_empty());
        for seam in &found {
            assert!((seam.degrees - 40.0).abs() < 0.5, "{seam:?}");
            assert!(
                seam.ends.iter().all(|e| e.x == 0.0 || e.x == 1.0),
                "{seam:?}"
            );
        }
    }

    #[test]
    fn charts_that_lie_turned_in_the_layout_are_compared_on_the_surface() {
        // Two squares side by side on the surface; the layout of the second is turned by 90 degrees.
        let p = |x: f32, y: f32| Vec3::new(x, y, 0.0);
        let square = [p(0.0, 0.0), p(1.0, 0.0), p(1.0, 1.0), p(0.0, 1.0)];
        let positions: Vec<Vec3> = square
            .into_iter()
            .chain(square.map(|q| q + Vec3::X))
            .collect();
        let uv = |q: Vec3| Vec2::new(0.05 + 0.4 * q.x, 0.3 + 0.4 * q.y);
        let turned = |q: Vec3| Vec2::new(0.55 + 0.4 * q.y, 0.7 - 0.4 * (q.x - 1.0));
        let mesh = Mesh {
            name: "squares".to_owned(),
            uvs: (0..8)
                .map(|i| {
                    if i < 4 {
                        uv(positions[i])
                    } else {
                        turned(positions[i])
                    }
                })
                .collect(),
            normals: vec![Vec3::Z; 8],
            // Along +U: to the right in the first, up in the second.
            tangents: (0..8)
                .map(|i| if i < 4 { Vec3::X } else { Vec3::Y }.extend(1.0))
                .collect(),
            triangles: vec![[0, 1, 2], [0, 2, 3], [4, 5, 6], [4, 6, 7]],
            positions,
            aspect: 1.0,
        };
        mesh.validate().unwrap();
        let jump = |second: f32| {
            let m = map(100, 100, Wrap::Clamp, |u, _| {
                if u < 0.5 { 30f32 } else { second }.to_radians()
            });
            let seams = marks(&m, Some(&mesh)).seams;
            seams.iter().fold(0.0f32, |most, s| most.max(s.degrees))
        };
        // 30 degrees on the surface are -60 from the second chart's axis.
        assert!(jump(-60.0) < 0.5, "{}", jump(-60.0));
        assert!((jump(-50.0) - 10.0).abs() < 0.1, "{}", jump(-50.0));
        assert!((jump(30.0) - 90.0).abs() < 0.1);
    }

    #[test]
    fn texels_are_marked_by_what_formats_hold() {
        let mut m = map(70, 90, Wrap::Clamp, |_, _| 0.0);
        assert_eq!(marks(&m, None).texels, []);
        let with = |alpha_x, alpha_y| Texel {
            alpha_x,
            alpha_y,
            axis: Axis::U,
        };
        m.region_mut().set(5, with(0.3, 1.45));
        m.region_mut().set(6000, with(0.002, 0.01));
        let texels = marks(&m, None).texels;
        assert_eq!(texels.len(), 6300);
        assert_eq!(
            (texels[5], texels[6000]),
            (TexelMark::Warning, TexelMark::Note)
        );
        assert_eq!(texels.iter().filter(|t| **t != TexelMark::None).count(), 2);
    }

    #[test]
    fn the_search_can_be_stopped() {
        let m = map(64, 256, Wrap::Repeat, |u, _| u);
        let stop = |done: u64, _: u64| done < 3;
        assert!(Marks::find(&m, None, &Progress::new(&stop)).is_err());
    }
}
