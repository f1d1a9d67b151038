//! Texture coordinates for a mesh that has none: each part of it is looked at from the one of six sides that it faces, and the
//! pictures are laid beside each other.
//!
//! A chart is a connected part that faces one side and does not hide itself; nothing of a layout lies on anything else, so every
//! place of the surface can be painted alone. All charts have one scale, none is turned or mirrored: +U runs to the right and
//! +V up as the side is seen from outside, so that a finish has one direction all over a side. Between charts there is room
//! for paint to reach over their edges ([`gap`]).

use super::{Mesh, tangents};
use glam::{DVec2, DVec3, Vec2, Vec3, Vec4};
use rayon::prelude::*;
use std::collections::HashMap;

/// How a mesh is given texture coordinates. In the word for a mesh it stands after a `#`: `statue.glb#box`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Projection {
    /// From six sides, in charts that do not overlap.
    Box,
}

impl Projection {
    /// Every projection.
    pub const ALL: [Self; 1] = [Self::Box];

    /// What it is called in the word for a mesh.
    pub fn name(self) -> &'static str {
        match self {
            Self::Box => "box",
        }
    }

    /// The word of a mesh with its projection taken off it. No file that is read as a mesh has a name that ends as a
    /// projection does.
    pub fn split(word: &str) -> (&str, Option<Self>) {
        let split = word.rsplit_once('#').and_then(|(file, name)| {
            let found = Self::ALL.into_iter().find(|p| p.name() == name)?;
            Some((file, found))
        });
        split.map_or((word, None), |(file, found)| (file, Some(found)))
    }

    /// The word for a mesh that is read with a projection.
    pub fn join(file: &str, projection: Option<Self>) -> String {
        match projection {
            Some(projection) => format!("{file}#{}", projection.name()),
            None => file.to_owned(),
        }
    }

    /// Gives a mesh texture coordinates and tangents in the place of those that it has. Vertices on the edge of a chart are doubled.
    pub fn lay(self, mesh: &mut Mesh) {
        let sides = sides(mesh);
        let charts = charts(mesh, &sides);
        let boxes: Vec<Frame> = charts.par_iter().map(|c| Frame::of(mesh, c)).collect();
        let (scale, places) = pack(&boxes);
        write(mesh, &charts, &boxes, scale, &places);
        mesh.aspect = 1.0;
    }
}

/// The six sides: what a chart's +U and +V are, and the side itself.
const SIDES: [[DVec3; 3]; 6] = [
    [DVec3::NEG_Z, DVec3::Y, DVec3::X],
    [DVec3::Z, DVec3::Y, DVec3::NEG_X],
    [DVec3::X, DVec3::NEG_Z, DVec3::Y],
    [DVec3::X, DVec3::Z, DVec3::NEG_Y],
    [DVec3::X, DVec3::Y, DVec3::Z],
    [DVec3::NEG_X, DVec3::Y, DVec3::NEG_Z],
];
/// No triangle, no chart.
const NONE: u32 = u32::MAX;
/// A triangle may follow its neighbours to a side that it faces by this cosine: seen from there it is not a third as narrow as it is.
const LEAST_FACING: f64 = 0.35;
/// How often triangles follow their neighbours.
const PASSES: usize = 4;
/// How far triangles of a chart may reach into each other, in parts of their size: rounding.
const TOUCHING: f64 = 1e-6;

/// The room between charts, in UV: 8 texels of a map of 1024, less where there are thousands of charts.
fn gap(charts: usize) -> f64 {
    (1.0 / 128.0f64).min(0.2 / (charts as f64).sqrt())
}

/// What is known of a triangle.
struct Triangles {
    /// The side that it is seen from.
    side: Vec<u8>,
    /// The triangles beyond its edges.
    beyond: Vec<[u32; 3]>,
}

fn corners(mesh: &Mesh, triangle: u32) -> [DVec3; 3] {
    let corners = mesh.corners(mesh.triangles[triangle as usize]);
    corners.map(|p| p.as_dvec3())
}

/// The side that each triangle is seen from: the one that it faces, or that its neighbours do.
fn sides(mesh: &Mesh) -> Triangles {
    let n = mesh.triangles.len() as u32;
    let normals: Vec<DVec3> = (0..n)
        .into_par_iter()
        .map(|t| {
            let [a, b, c] = corners(mesh, t);
            (b - a).cross(c - a).normalize_or_zero()
        })
        .collect();
    let facing = |normal: &DVec3| {
        let order = (0..6).fold(0, |best, k| {
            let more = normal.dot(SIDES[k][2]) > normal.dot(SIDES[best][2]);
            if more { k } else { best }
        });
        order as u8
    };
    let beyond = beyond(mesh);
    let mut side: Vec<u8> = normals.par_iter().map(facing).collect();
    for _ in 0..PASSES {
        let next = |t: usize| {
            let others = beyond[t].map(|o| (o != NONE).then(|| side[o as usize]));
            let flat = normals[t] == DVec3::ZERO;
            let wanted = others.into_iter().flatten().find(|s| {
                let alike = others.iter().filter(|o| **o == Some(*s)).count();
                let faces = normals[t].dot(SIDES[*s as usize][2]) >= LEAST_FACING;
                flat || (alike >= 2 && faces)
            });
            wanted.unwrap_or(side[t])
        };
        side = (0..side.len()).into_par_iter().map(next).collect();
    }
    Triangles { side, beyond }
}

/// The triangle beyond each edge of each triangle; none where three or more meet, or where the other one winds against it.
fn beyond(mesh: &Mesh) -> Vec<[u32; 3]> {
    let mut places: HashMap<[u32; 3], u32> = HashMap::with_capacity(mesh.positions.len());
    let place = mesh.positions.iter().map(|p| {
        let next = places.len() as u32;
        // Adding 0 makes -0 and 0 one place.
        *places
            .entry(p.to_array().map(|x| (x + 0.0).to_bits()))
            .or_insert(next)
    });
    let place: Vec<u32> = place.collect();
    drop(places);
    let mut edges: Vec<(u32, u32, u32, bool)> = Vec::with_capacity(3 * mesh.triangles.len());
    for (t, triangle) in mesh.triangles.iter().enumerate() {
        let p = triangle.map(|v| place[v as usize]);
        for k in 0..3 {
            let (a, b) = (p[k], p[(k + 1) % 3]);
            edges.push((a.min(b), a.max(b), (3 * t + k) as u32, a < b));
        }
    }
    edges.par_sort_unstable();
    let mut beyond = vec![[NONE; 3]; mesh.triangles.len()];
    for group in edges.chunk_by(|a, b| (a.0, a.1) == (b.0, b.1)) {
        if let [(.., a, up), (.., b, down)] = *group
            && up != down
        {
            beyond[a as usize / 3][a as usize % 3] = b / 3;
            beyond[b as usize / 3][b as usize % 3] = a / 3;
        }
    }
    beyond
}

/// Triangles that are seen from one side.
struct Chart {
    side: u8,
    triangles: Vec<u32>,
}

/// Connected parts of one side, cut where they would lie over themselves.
fn charts(mesh: &Mesh, known: &Triangles) -> Vec<Chart> {
    let n = mesh.triangles.len();
    let mut seen = vec![false; n];
    let mut parts = Vec::new();
    for first in 0..n as u32 {
        if std::mem::replace(&mut seen[first as usize], true) {
            continue;
        }
        let side = known.side[first as usize];
        let mut part = vec![first];
        let mut next = 0;
        while let Some(t) = part.get(next).copied() {
            next += 1;
            for o in known.beyond[t as usize] {
                if o != NONE && known.side[o as usize] == side && !seen[o as usize] {
                    seen[o as usize] = true;
                    part.push(o);
                }
            }
        }
        parts.push(Chart {
            side,
            triangles: part,
        });
    }
    let cut = |part: Chart| Sheet::new(mesh, &part).cut(known, &part);
    parts.into_par_iter().flat_map_iter(cut).collect()
}

/// Cells, and later comparisons, that a triangle may take on the mean; a surface that is not wound up takes a few.
const CROWD: usize = 64;
/// The same of a part at all.
const CROWD_LEAST: usize = 1 << 20;

/// A connected part as it is seen from its side, with the triangles that lie in each cell of a grid.
struct Sheet {
    side: u8,
    flat: Vec<[DVec2; 3]>,
    low: DVec2,
    cell: f64,
    columns: usize,
    rows: usize,
    /// Where each cell's triangles begin in `held`.
    starts: Vec<u32>,
    held: Vec<u32>,
}

fn flattened(p: DVec3, side: u8) -> DVec2 {
    let [u, v, _] = SIDES[side as usize];
    DVec2::new(p.dot(u), p.dot(v))
}

fn bounds(corners: &[DVec2; 3]) -> (DVec2, DVec2) {
    let [a, b, c] = *corners;
    (a.min(b).min(c), a.max(b).max(c))
}

impl Sheet {
    fn new(mesh: &Mesh, part: &Chart) -> Self {
        let side = part.side;
        let flatten = |t: &u32| corners(mesh, *t).map(|p| flattened(p, side));
        let flat: Vec<[DVec2; 3]> = part.triangles.iter().map(flatten).collect();
        let far = (DVec2::INFINITY, DVec2::NEG_INFINITY);
        let (low, high) = flat
            .iter()
            .map(bounds)
            .fold(far, |(low, high), (a, b)| (low.min(a), high.max(b)));
        let sides = (high - low).max(DVec2::splat(1e-30));
        let cell = (sides.x * sides.y / flat.len() as f64)
            .sqrt()
            .max(sides.max_element() / 4096.0);
        let across = |side: f64| (side / cell) as usize + 1;
        let (columns, rows) = (across(sides.x), across(sides.y));
        let mut sheet = Self {
            side,
            flat,
            low,
            cell,
            columns,
            rows,
            starts: vec![0; columns * rows + 1],
            held: Vec::new(),
        };
        if sheet.flat.len() > 1 {
            sheet.fill_cells();
        }
        sheet
    }

    /// Leaves the grid empty where the triangles lie over each other by the hundred.
    fn fill_cells(&mut self) {
        let mut counts = vec![0u32; self.columns * self.rows + 1];
        let mut left = (CROWD * self.flat.len() + CROWD_LEAST).min(u32::MAX as usize);
        for t in 0..self.flat.len() {
            let has_room = self.each_cell(t, |cell| {
                counts[cell + 1] += 1;
                left -= 1;
                left > 0
            });
            if !has_room {
                self.starts.clear();
                return;
            }
        }
        for i in 1..counts.len() {
            counts[i] += counts[i - 1];
        }
        let mut held = vec![0; counts[counts.len() - 1] as usize];
        let mut next = counts.clone();
        for t in 0..self.flat.len() {
            self.each_cell(t, |cell| {
                held[next[cell] as usize] = t as u32;
                next[cell] += 1;
                true
            });
        }
        (self.starts, self.held) = (counts, held);
    }

    /// Calls `visit` with the cells that a triangle may touch, row by row the part that its edges span, until it says false;
    /// whether it never did.
    fn each_cell(&self, t: usize, mut visit: impl FnMut(usize) -> bool) -> bool {
        let corners = self.flat[t].map(|p| (p - self.low) / self.cell);
        let (low, high) = bounds(&corners);
        let clamp = |x: f64, most: usize| (x.max(0.0) as usize).min(most - 1);
        for row in clamp(low.y, self.rows)..=clamp(high.y, self.rows) {
            let (bottom, top) = (row as f64 - 1e-6, row as f64 + 1.0 + 1e-6);
            let (mut left, mut right) = (f64::INFINITY, f64::NEG_INFINITY);
            for k in 0..3 {
                let (a, b) = (corners[k], corners[(k + 1) % 3]);
                let step = b.y - a.y;
                let at = |y: f64| {
                    let t = if step == 0.0 { 0.0 } else { (y - a.y) / step };
                    a.x + (b.x - a.x) * t.clamp(0.0, 1.0)
                };
                if a.y.min(b.y) > top || a.y.max(b.y) < bottom {
                    continue;
                }
                let ends = if step == 0.0 {
                    [a.x, b.x]
                } else {
                    [at(bottom), at(top)]
                };
                left = left.min(ends[0]).min(ends[1]);
                right = right.max(ends[0]).max(ends[1]);
            }
            let (left, right) = (left.max(low.x) - 1e-6, right.min(high.x) + 1e-6);
            for column in clamp(left, self.columns)..=clamp(right, self.columns) {
                if !visit(row * self.columns + column) {
                    return false;
                }
            }
        }
        true
    }

    /// Charts that do not lie over themselves: each grows from triangle to triangle as long as the next one lies beside all that
    /// it has. Where too many lie over each other to be compared, every further triangle is a chart of its own.
    fn cut(&self, known: &Triangles, part: &Chart) -> Vec<Chart> {
        if part.triangles.len() == 1 || self.starts.is_empty() {
            let alone = |t: &u32| Chart {
                side: part.side,
                triangles: vec![*t],
            };
            return part.triangles.iter().map(alone).collect();
        }
        let mut left = CROWD * part.triangles.len() + CROWD_LEAST;
        let numbers: HashMap<u32, u32> = part.triangles.iter().copied().zip(0..).collect();
        let mut chart_of = vec![NONE; part.triangles.len()];
        let mut refused_by = vec![NONE; part.triangles.len()];
        let mut charts: Vec<Chart> = Vec::new();
        for first in 0..part.triangles.len() {
            if chart_of[first] != NONE {
                continue;
            }
            let chart = charts.len() as u32;
            chart_of[first] = chart;
            let mut mine = vec![first as u32];
            let mut next = 0;
            while let Some(t) = mine.get(next).copied() {
                next += 1;
                for o in known.beyond[part.triangles[t as usize] as usize] {
                    let Some(&o) = numbers.get(&o) else { continue };
                    let n = o as usize;
                    if chart_of[n] != NONE || refused_by[n] == chart {
                        continue;
                    }
                    if self.overlaps(n, (chart, &chart_of), &mut left) {
                        refused_by[n] = chart;
                    } else {
                        chart_of[n] = chart;
                        mine.push(o);
                    }
                }
            }
            charts.push(Chart {
                side: self.side,
                triangles: mine.iter().map(|t| part.triangles[*t as usize]).collect(),
            });
        }
        charts
    }

    /// Whether a triangle lies over any of a chart; of that one may compare as many as are `left`.
    fn overlaps(&self, t: usize, (chart, chart_of): (u32, &[u32]), left: &mut usize) -> bool {
        let is_free = self.each_cell(t, |cell| {
            let held = self.starts[cell] as usize..self.starts[cell + 1] as usize;
            self.held[held].iter().all(|o| {
                let o = *o as usize;
                *left = left.saturating_sub(1);
                *left > 0 && !(chart_of[o] == chart && overlap(&self.flat[t], &self.flat[o]))
            })
        });
        !is_free
    }
}

/// Whether two triangles that wind counter-clockwise share more than an edge: no side of either parts them.
fn overlap(a: &[DVec2; 3], b: &[DVec2; 3]) -> bool {
    let (la, ha) = bounds(a);
    let (lb, hb) = bounds(b);
    if la.cmpge(hb).any() || lb.cmpge(ha).any() {
        return false;
    }
    let parts = |a: &[DVec2; 3], b: &[DVec2; 3]| {
        (0..3).any(|k| {
            let side = a[(k + 1) % 3] - a[k];
            let room = TOUCHING * side.length() * (ha - la).min(hb - lb).max_element();
            b.iter().all(|p| side.perp_dot(*p - a[k]) <= room)
        })
    };
    !parts(a, b) && !parts(b, a)
}

/// A chart's box as it is seen from its side, in the mesh's units.
#[derive(Clone, Copy)]
struct Frame {
    low: DVec2,
    sides: DVec2,
}

impl Frame {
    fn of(mesh: &Mesh, chart: &Chart) -> Self {
        let far = (DVec2::INFINITY, DVec2::NEG_INFINITY);
        let all = chart.triangles.iter().flat_map(|t| corners(mesh, *t));
        let (low, high) = all.fold(far, |(low, high), p| {
            let p = flattened(p, chart.side);
            (low.min(p), high.max(p))
        });
        Self {
            low,
            sides: high - low,
        }
    }
}

/// The largest scale at which all boxes fit into the unit square, and where each then lies: on shelves, the highest first.
fn pack(boxes: &[Frame]) -> (f64, Vec<DVec2>) {
    let mut order: Vec<usize> = (0..boxes.len()).collect();
    order.sort_by(|a, b| {
        let [a_box, b_box] = [a, b].map(|i| boxes[*i].sides);
        b_box.y.total_cmp(&a_box.y).then(a.cmp(b))
    });
    let room = gap(boxes.len());
    let largest = boxes
        .iter()
        .fold(0.0f64, |m, b| m.max(b.sides.max_element()));
    let mut places = vec![DVec2::ZERO; boxes.len()];
    let (mut fits, mut fails) = (0.0, 1.0 / largest.max(1e-30));
    for _ in 0..48 {
        let scale = 0.5 * (fits + fails);
        if shelve(boxes, &order, scale, room, &mut places) {
            fits = scale;
        } else {
            fails = scale;
        }
    }
    shelve(boxes, &order, fits, room, &mut places);
    (fits, places)
}

/// Lays boxes on shelves from below, half the room around each; `false` where they reach over the top.
fn shelve(boxes: &[Frame], order: &[usize], scale: f64, room: f64, places: &mut [DVec2]) -> bool {
    let (mut at, mut height) = (DVec2::ZERO, 0.0f64);
    for i in order {
        let sides = boxes[*i].sides * scale + room;
        if at.x > 0.0 && at.x + sides.x > 1.0 {
            at = DVec2::new(0.0, at.y + height);
            height = 0.0;
        }
        places[*i] = at + 0.5 * room;
        at.x += sides.x;
        height = height.max(sides.y);
        if at.x > 1.0 || at.y + height > 1.0 {
            return false;
        }
    }
    true
}

/// Gives each chart vertices of its own.
fn write(mesh: &mut Mesh, charts: &[Chart], boxes: &[Frame], scale: f64, places: &[DVec2]) {
    let old = std::mem::replace(mesh, Mesh::empty(&mesh.name, 1.0));
    mesh.triangles = vec![[0; 3]; old.triangles.len()];
    let mut copies = vec![(NONE, 0u32); old.positions.len()];
    for (n, chart) in charts.iter().enumerate() {
        for t in &chart.triangles {
            let triangle = old.triangles[*t as usize].map(|v| {
                let copy = &mut copies[v as usize];
                if copy.0 != n as u32 {
                    *copy = (n as u32, mesh.positions.len() as u32);
                    let (p, normal) = (old.positions[v as usize], old.normals[v as usize]);
                    let flat = flattened(p.as_dvec3(), chart.side) - boxes[n].low;
                    let uv: Vec2 = (places[n] + flat * scale).as_vec2();
                    mesh.positions.push(p);
                    mesh.normals.push(normal);
                    mesh.tangents.push(tangent(normal, chart.side));
                    mesh.uvs.push(uv.clamp(Vec2::ZERO, Vec2::ONE));
                }
                copy.1
            });
            mesh.triangles[*t as usize] = triangle;
        }
    }
}

/// Along the surface where v of a side stays the same.
fn tangent(normal: Vec3, side: u8) -> Vec4 {
    let [u, _, out] = SIDES[side as usize].map(|v| v.as_vec3());
    let facing = normal.dot(out);
    let along = if facing > 0.1 {
        u - out * (normal.dot(u) / facing)
    } else {
        u // a normal that leans away from the side that its triangle faces
    };
    tangents::fitted(normal, along.extend(1.0))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::{BUILTIN_NAMES, builtin};

    fn without_uvs(name: &str) -> Mesh {
        let mut mesh = builtin(name).unwrap();
        mesh.uvs.fill(Vec2::ZERO);
        mesh
    }

    /// A ramp that winds up three times: seen from above it lies over itself.
    fn spiral() -> Mesh {
        wound(90, 0.2)
    }

    /// The same of so many steps of so many radians.
    fn wound(steps: u32, step: f32) -> Mesh {
        let mut mesh = Mesh::empty("spiral", 1.0);
        for i in 0..=steps {
            let angle = i as f32 * step;
            for r in [0.5, 1.0] {
                mesh.positions.push(Vec3::new(
                    r * angle.cos(),
                    0.01 * i as f32,
                    -r * angle.sin(),
                ));
                mesh.normals.push(Vec3::Y);
            }
        }
        for i in 0..steps {
            let (a, b, c, d) = (2 * i, 2 * i + 1, 2 * i + 2, 2 * i + 3);
            mesh.triangles.extend([[a, b, d], [a, d, c]]);
        }
        mesh.uvs = vec![Vec2::ZERO; mesh.positions.len()];
        mesh.tangents = vec![Vec4::W; mesh.positions.len()];
        mesh
    }

    /// Which chart each texel's middle lies in, of a map of 512; panics where it lies in two triangles.
    fn assert_apart(mesh: &Mesh) {
        const SIDE: usize = 512;
        let islands = mesh.islands();
        let mut owners = vec![NONE; SIDE * SIDE];
        for (t, triangle) in mesh.triangles.iter().enumerate() {
            let corners = mesh
                .corner_uvs(*triangle)
                .map(|p| p.as_dvec2() * SIDE as f64);
            let (low, high) = bounds(&corners);
            for y in low.y as usize..=(high.y as usize).min(SIDE - 1) {
                for x in low.x as usize..=(high.x as usize).min(SIDE - 1) {
                    let p = DVec2::new(x as f64 + 0.5, y as f64 + 0.5);
                    let depth = (0..3).map(|k| {
                        let side = corners[(k + 1) % 3] - corners[k];
                        side.perp_dot(p - corners[k]) / side.length().max(1e-9)
                    });
                    if depth.fold(f64::INFINITY, f64::min) > 1e-3 {
                        let owner = &mut owners[y * SIDE + x];
                        assert_eq!(*owner, NONE, "{}: {t} lies over another", mesh.name);
                        *owner = islands.of_triangle[t];
                    }
                }
            }
        }
        // The room between charts: at least 3 of the 4 texels that a 128th is here.
        for (i, owner) in owners.iter().enumerate().filter(|(_, o)| **o != NONE) {
            let (x, y) = (i % SIDE, i / SIDE);
            for (dx, dy) in [(1, 0), (0, 1), (2, 0), (0, 2), (2, 2)] {
                if x + dx < SIDE && y + dy < SIDE {
                    let other = owners[(y + dy) * SIDE + x + dx];
                    assert!(
                        other == NONE || other == *owner,
                        "{}: charts touch at {x}, {y}",
                        mesh.name
                    );
                }
            }
        }
    }

    #[test]
    fn nothing_lies_over_anything_and_all_has_one_scale() {
        let mut meshes: Vec<Mesh> = BUILTIN_NAMES.iter().map(|n| without_uvs(n)).collect();
        meshes.push(spiral());
        for mut mesh in meshes {
            let before = mesh.clone();
            Projection::Box.lay(&mut mesh);
            mesh.validate().unwrap();
            assert_eq!(mesh.triangles.len(), before.triangles.len());
            assert_eq!(mesh.handedness_conflicts(), 0, "{}", mesh.name);
            for (old, new) in before.triangles.iter().zip(&mesh.triangles) {
                assert_eq!(before.corners(*old), mesh.corners(*new));
            }
            assert_apart(&mesh);
            let (mut least, mut used) = (f32::INFINITY, 0.0);
            for t in &mesh.triangles {
                let [a, b, c] = mesh.corner_uvs(*t);
                let [p, q, r] = mesh.corners(*t);
                let (flat, area) = ((b - a).perp_dot(c - a), (q - p).cross(r - p).length());
                assert!(flat >= -1e-9, "{}: mirrored", mesh.name);
                used += 0.5 * flat;
                if area > 1e-6 {
                    least = least.min(flat / area);
                }
            }
            // A place is seen at a third of its size or more.
            let most = mesh.triangles.iter().map(|t| {
                let [a, b, c] = mesh.corner_uvs(*t);
                let [p, q, r] = mesh.corners(*t);
                (b - a).perp_dot(c - a) / (q - p).cross(r - p).length().max(1e-6)
            });
            let most = most.fold(0.0, f32::max);
            assert!(least > 0.3 * most, "{}: {least} of {most}", mesh.name);
            assert!(used > 0.2, "{}: {used} of the map is used", mesh.name);
        }
    }

    #[test]
    fn a_ramp_that_winds_over_itself_is_cut() {
        let mut mesh = spiral();
        Projection::Box.lay(&mut mesh);
        let charts = mesh.islands().mirrored.len();
        assert!((3..8).contains(&charts), "{charts} charts");
    }

    #[test]
    fn what_has_no_area_is_laid_as_well() {
        let mut mesh = without_uvs("sphere");
        mesh.positions.extend([Vec3::ZERO, Vec3::X, Vec3::X * 2.0]);
        for _ in 0..3 {
            mesh.normals.push(Vec3::Y);
            mesh.tangents.push(Vec4::W);
            mesh.uvs.push(Vec2::ZERO);
        }
        let n = mesh.positions.len() as u32;
        mesh.triangles.extend([[n - 3, n - 2, n - 1], [0, 0, 1]]);
        Projection::Box.lay(&mut mesh);
        mesh.validate().unwrap();
        let mut empty = Mesh::empty("nothing", 1.0);
        Projection::Box.lay(&mut empty);
        assert!(empty.triangles.is_empty());
    }

    #[test]
    fn a_surface_that_is_wound_up_without_end_is_laid_all_the_same() {
        // Every cell holds every fourth triangle: comparing all of them would take minutes.
        let mut mesh = wound(20_000, 1.571);
        Projection::Box.lay(&mut mesh);
        assert_eq!(mesh.triangles.len(), 40_000);
        let inside = |uv: &Vec2| (0.0..=1.0).contains(&uv.x) && (0.0..=1.0).contains(&uv.y);
        assert!(mesh.uvs.iter().all(inside));
    }

    #[test]
    fn words_have_a_projection_at_their_end_alone() {
        for (word, file, projection) in [
            ("a.glb#box", "a.glb", Some(Projection::Box)),
            ("a#box.glb", "a#box.glb", None),
            ("a.glb#cone", "a.glb#cone", None),
            ("torus", "torus", None),
        ] {
            assert_eq!(Projection::split(word), (file, projection));
            assert_eq!(Projection::join(file, projection), word);
        }
    }
}
