//! A mesh as strokes see it: for each texel the places of the surface that show it, and which texels lie near a place in space.
//!
//! A texel inside a triangle of the layout takes that place (several, where parts of the layout lie on each other); one beside a
//! chart takes the nearest place of it, up to [`GUTTER`] texels away, so that filtering at a seam finds the same paint on both
//! sides.

use super::cover::{LANES, Lane, TILE};
use super::laid::Ground;
use crate::map::Rect;
use crate::math::Frame;
use crate::mesh::{Body, Mesh};
use crate::pattern::Surface;
use glam::{Vec2, Vec3};
use rayon::prelude::*;
use std::collections::HashMap;
use std::sync::{Arc, Mutex, PoisonError};

/// How far paint reaches beyond the edge of a chart, texels.
const GUTTER: f32 = 4.0;
/// A mesh with more than a triangle for so many texels is looked through by leaves of its tree.
const DENSE: usize = 4;
const _: () = assert!(TILE <= 255, "sides up to a tile's are told in a byte");
/// Tiles whose places are kept.
const KEPT: usize = 256;

/// A mesh prepared to be painted on at one size of map.
pub struct Skin {
    body: Arc<Body>,
    pub(super) ground: Ground,
    columns: u32,
    /// For each tile the triangles that may show in it, with the periods they are moved by.
    tiles: Vec<Vec<(u32, (i8, i8))>>,
    scale: f32,
    /// Where each leaf of the mesh's tree shows, when that is in one place; for a mesh of about as many triangles as the map has
    /// texels, and otherwise empty.
    leaves: Vec<Option<Spot>>,
    /// The middle of the mesh's bounding box.
    middle: Vec3,
    kept: Mutex<HashMap<u32, Arc<Vec<Places>>>>,
    kept_charts: Mutex<HashMap<u32, Arc<Vec<u32>>>>,
}

/// A small rectangle of the map.
#[derive(Clone, Copy)]
struct Spot {
    at: [u16; 2],
    sides: [u8; 2],
}

impl Spot {
    fn rect(&self) -> Rect {
        Rect {
            x: self.at[0].into(),
            y: self.at[1].into(),
            width: self.sides[0].into(),
            height: self.sides[1].into(),
        }
    }
}

/// Places of the surface, [`LANES`] side by side.
#[derive(Clone)]
pub(super) struct Places {
    /// Where in the tile; [`NOWHERE`] for the unused.
    pub(super) texel: [u16; LANES],
    pub(super) at: [Lane; 3],
    pub(super) normal: [Lane; 3],
    pub(super) tangent: [Lane; 3],
    pub(super) bitangent: [Lane; 3],
    /// The length of a texel in the mesh's units.
    pub(super) size: Lane,
    /// A ball that holds them all.
    pub(super) center: Vec3,
    pub(super) radius: f32,
}

pub(super) const NOWHERE: u16 = u16::MAX;
/// The chart of a texel that shows none.
pub(super) const NO_CHART: u32 = u32::MAX;

impl Skin {
    /// A mesh as a map of this surface lies on it.
    pub fn new(body: Arc<Body>, surface: &Surface) -> Self {
        let ground = Ground::new(surface);
        let size = surface.size;
        let (columns, rows) = (size.width().div_ceil(TILE), size.height().div_ceil(TILE));
        let mut skin = Self {
            scale: surface_scale(body.mesh(), ground.grid.extent),
            middle: body.mesh().bounding_sphere().0,
            body,
            ground,
            columns,
            tiles: vec![Vec::new(); (columns * rows) as usize],
            leaves: Vec::new(),
            kept: Mutex::default(),
            kept_charts: Mutex::default(),
        };
        for n in 0..skin.mesh().triangles.len() as u32 {
            skin.sort_in(n);
        }
        if skin.mesh().triangles.len() * DENSE > size.texels() {
            skin.leaves = skin.body.leaves().map(|leaf| skin.spot(leaf)).collect();
        }
        skin
    }

    /// Where triangles show, when each shows once and all no farther from each other than a tile is long.
    fn spot(&self, triangles: &[u32]) -> Option<Spot> {
        let (mut all, mut times) = (None::<Rect>, 0);
        for n in triangles {
            self.rects(*n, |rect, _| {
                all = Some(all.map_or(rect, |all| all.hull(rect)));
                times += 1;
            });
        }
        let rect = all.filter(|r| times == triangles.len() && r.width.max(r.height) <= TILE)?;
        Some(Spot {
            at: [rect.x, rect.y].map(|n| n as u16),
            sides: [rect.width, rect.height].map(|n| n as u8),
        })
    }

    /// The mesh.
    pub fn mesh(&self) -> &Mesh {
        self.body.mesh()
    }

    /// The mesh.
    pub(crate) fn body(&self) -> &Arc<Body> {
        &self.body
    }

    /// Whether this is that mesh as a map of that surface lies on it.
    pub fn is_of(&self, body: &Arc<Body>, surface: &Surface) -> bool {
        Arc::ptr_eq(&self.body, body) && self.ground == Ground::new(surface)
    }

    /// How long one surface unit is in the mesh's units, on the whole: the lengths of a brush on the mesh are this times its own.
    pub fn scale(&self) -> f32 {
        self.scale
    }

    /// The middle of the mesh, about which copies of strokes lie.
    pub(super) fn middle(&self) -> Vec3 {
        self.middle
    }

    /// The largest coordinate of the mesh, for [`super::MeshPoints::new`].
    pub fn extent(&self) -> f32 {
        let all = self.mesh().positions.iter();
        all.fold(0.0, |m, p| m.max(p.abs().max_element()))
    }

    /// The length of a texel in the mesh's units, on the whole.
    pub(super) fn texel(&self) -> f32 {
        self.scale * self.ground.grid.texel.max_element()
    }

    /// The corners of a triangle in the layout, surface units: moved by whole turns near the map where it repeats and they lie
    /// farther from it than is looked.
    fn layout(&self, n: u32) -> [Vec2; 3] {
        let uvs = self.mesh().triangles[n as usize].map(|i| self.mesh().uvs[i as usize]);
        let away = self.ground.turns_away(&uvs);
        uvs.map(|uv| (uv - away) * self.ground.grid.extent)
    }

    fn corners(&self, n: u32) -> [Vec3; 3] {
        self.mesh().triangles[n as usize].map(|i| self.mesh().positions[i as usize])
    }

    /// Calls `visit` with the texels that a triangle may show in or beside, and the periods it is moved by.
    pub(super) fn rects(&self, n: u32, mut visit: impl FnMut(Rect, (i8, i8))) {
        let [a, b, c] = self.layout(n);
        let reach = self.ground.grid.texel * (GUTTER + 0.5);
        let (low, high) = (a.min(b).min(c) - reach, a.max(b).max(c) + reach);
        for period in self.ground.periods(low, high) {
            let shift = self.ground.shift(period);
            if let Some(rect) = self.ground.grid.cover(low + shift, high + shift) {
                visit(rect, period);
            }
        }
    }

    fn sort_in(&mut self, n: u32) {
        let mut found = Vec::new();
        self.rects(n, |rect, period| found.push((rect, period)));
        for (rect, period) in found {
            for (tile, _) in tiles_of(rect, self.columns) {
                self.tiles[tile as usize].push((n, period));
            }
        }
    }

    #[cfg(test)]
    pub(super) fn near(&self, low: Vec3, high: Vec3, visit: impl FnMut(u32)) {
        assert!(!self.leaves.is_empty(), "a dense mesh");
        self.body.near(low, high, visit);
    }

    /// The texels that may show anything in a box of space: for each tile one rectangle, in the order of tiles.
    pub(super) fn touched(&self, low: Vec3, high: Vec3) -> Vec<(u32, Rect)> {
        let mut found: HashMap<u32, Rect> = HashMap::new();
        let (mut near, mut spots) = (Vec::new(), Vec::new());
        if self.leaves.is_empty() {
            self.body.near(low, high, |n| near.push(n));
        } else {
            self.body.near_leaves(low, high, |leaf, triangles| {
                match self.leaves[leaf as usize] {
                    Some(spot) => spots.push(spot),
                    None => near.extend_from_slice(triangles),
                }
            });
        }
        let mut add = |rect: Rect| {
            for (tile, square) in tiles_of(rect, self.columns) {
                if let Some(part) = square.intersection(rect) {
                    let all = found.entry(tile).or_insert(part);
                    *all = all.hull(part);
                }
            }
        };
        spots.iter().map(Spot::rect).for_each(&mut add);
        for n in near {
            self.rects(n, |rect, _| add(rect));
        }
        let mut found: Vec<(u32, Rect)> = found.into_iter().collect();
        found.sort_unstable_by_key(|(tile, _)| *tile);
        found
    }

    /// The places of the tile in a column and row.
    pub(super) fn places(&self, (x, y): (u32, u32)) -> Arc<Vec<Places>> {
        let tile = y * self.columns + x;
        let kept = || self.kept.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(places) = kept().get(&tile) {
            return Arc::clone(places);
        }
        let places = Arc::new(self.find_places(tile));
        let mut kept = kept();
        if kept.len() >= KEPT {
            kept.clear();
        }
        kept.insert(tile, Arc::clone(&places));
        places
    }

    fn find_places(&self, tile: u32) -> Vec<Places> {
        let mut gather = Gather::default();
        self.each_place(tile, |laid, i, at| gather.add(self, laid, i, at));
        gather.done()
    }

    /// The chart that each texel of a rectangle shows or lies beside, in row order; [`NO_CHART`] far from any. Where charts lie
    /// over each other it is that of the first triangle.
    pub(super) fn charts(&self, rect: Rect) -> Vec<u32> {
        let mut charts = vec![NO_CHART; rect.texels()];
        for (tile, square) in tiles_of(rect, self.columns) {
            let Some(part) = square.intersection(rect) else {
                continue;
            };
            let known = self.charts_of(tile);
            let n = part.width as usize;
            for row in part.y..part.y + part.height {
                let (from, to) = (square.index(part.x, row), rect.index(part.x, row));
                charts[to..to + n].copy_from_slice(&known[from..from + n]);
            }
        }
        charts
    }

    fn charts_of(&self, tile: u32) -> Arc<Vec<u32>> {
        let kept = || {
            self.kept_charts
                .lock()
                .unwrap_or_else(PoisonError::into_inner)
        };
        if let Some(charts) = kept().get(&tile) {
            return Arc::clone(charts);
        }
        let islands = &self.body.islands().of_triangle;
        let mut charts = vec![NO_CHART; (TILE * TILE) as usize];
        self.each_place(tile, |laid, i, _| {
            if charts[i] == NO_CHART {
                charts[i] = islands[laid.triangle as usize];
            }
        });
        let charts = Arc::new(charts);
        let mut kept = kept();
        if kept.len() >= 4 * KEPT {
            kept.clear();
        }
        kept.insert(tile, Arc::clone(&charts));
        charts
    }

    /// Calls `visit` with every place that a tile's texels show, and the nearest beside a chart: the triangle, the place in the
    /// tile, the weights of the triangle's corners.
    fn each_place(&self, tile: u32, mut visit: impl FnMut(&Laid, usize, [f32; 3])) {
        let (x, y) = (tile % self.columns * TILE, tile / self.columns * TILE);
        let triangles: Vec<Laid> = self.tiles[tile as usize]
            .iter()
            .filter_map(|(n, period)| self.laid(*n, *period, (x, y)))
            .collect();
        let side = TILE as usize;
        let mut inside = vec![false; side * side];
        for laid in &triangles {
            laid.each_texel(0.0, |i, p| {
                let at = laid.weights(p);
                if at.iter().all(|w| *w >= -1e-5) {
                    inside[i] = true;
                    visit(laid, i, at);
                }
            });
        }
        if inside.iter().all(|i| *i) {
            return;
        }
        let mut nearest: Vec<(f32, usize, [f32; 3])> =
            vec![(GUTTER * GUTTER, usize::MAX, [0.0; 3]); side * side];
        for (n, laid) in triangles.iter().enumerate() {
            laid.each_texel(GUTTER, |i, p| {
                if !inside[i] {
                    let (square, at) = laid.nearest(p);
                    if square < nearest[i].0 {
                        nearest[i] = (square, n, at);
                    }
                }
            });
        }
        for (i, (_, n, at)) in nearest.into_iter().enumerate() {
            if let Some(laid) = triangles.get(n) {
                visit(laid, i, at);
            }
        }
    }

    /// A triangle in the texels of a tile; `None` where its layout spans no area.
    fn laid(&self, n: u32, period: (i8, i8), (x, y): (u32, u32)) -> Option<Laid> {
        let grid = &self.ground.grid;
        let shift = self.ground.shift(period);
        let corners = self.layout(n).map(|p| {
            let p = p + shift;
            Vec2::new(
                p.x / grid.texel.x - 0.5 - x as f32,
                (grid.extent.y - p.y) / grid.texel.y - 0.5 - y as f32,
            )
        });
        let [a, b, c] = corners;
        let area = (b - a).perp_dot(c - a);
        let [p, q, r] = self.corners(n);
        let surface = (q - p).cross(r - p).length();
        (area.abs() > 1e-9).then(|| Laid {
            triangle: n,
            corners,
            inverse: 1.0 / area,
            size: (surface / area.abs())
                .sqrt()
                .clamp(0.25 * self.texel(), 4.0 * self.texel()),
        })
    }
}

/// The tiles that a rectangle meets, of so many a row, in their order: each with its place.
fn tiles_of(rect: Rect, columns: u32) -> impl Iterator<Item = (u32, Rect)> {
    let rows = rect.y / TILE..(rect.y + rect.height).div_ceil(TILE);
    rows.flat_map(move |y| {
        let across = rect.x / TILE..(rect.x + rect.width).div_ceil(TILE);
        across.map(move |x| {
            let square = Rect {
                x: x * TILE,
                y: y * TILE,
                width: TILE,
                height: TILE,
            };
            (y * columns + x, square)
        })
    })
}

/// How long one surface unit is on the mesh: the root of all its area over that of its layout.
pub fn surface_scale(mesh: &Mesh, extent: Vec2) -> f32 {
    let (mut space, mut layout) = (0.0f64, 0.0f64);
    for t in &mesh.triangles {
        let [p, q, r] = t.map(|i| mesh.positions[i as usize]);
        let [a, b, c] = t.map(|i| mesh.uvs[i as usize] * extent);
        space += f64::from((q - p).cross(r - p).length());
        layout += f64::from((b - a).perp_dot(c - a).abs());
    }
    let scale = (space / layout).sqrt() as f32;
    if scale.is_normal() { scale } else { 1.0 }
}

/// A triangle of the layout in the texels of a tile, whose centres have whole coordinates.
struct Laid {
    triangle: u32,
    corners: [Vec2; 3],
    inverse: f32,
    size: f32,
}

impl Laid {
    /// Calls `visit` with the texels of the tile within a distance of its box: the place in the tile, and where that is.
    fn each_texel(&self, reach: f32, mut visit: impl FnMut(usize, Vec2)) {
        let [a, b, c] = self.corners;
        let most = TILE as f32 - 1.0;
        let low = (a.min(b).min(c) - reach).ceil().max(Vec2::ZERO);
        let high = (a.max(b).max(c) + reach).floor().min(Vec2::splat(most));
        if low.x > high.x || low.y > high.y {
            return;
        }
        for y in low.y as usize..=high.y as usize {
            for x in low.x as usize..=high.x as usize {
                visit(y * TILE as usize + x, Vec2::new(x as f32, y as f32));
            }
        }
    }

    /// The weights of the corners at a place.
    fn weights(&self, p: Vec2) -> [f32; 3] {
        let [a, b, c] = self.corners;
        let v = (p - a).perp_dot(c - a) * self.inverse;
        let w = (b - a).perp_dot(p - a) * self.inverse;
        [1.0 - v - w, v, w]
    }

    /// The nearest place of its edges: the square of the distance, and the weights there.
    fn nearest(&self, p: Vec2) -> (f32, [f32; 3]) {
        let mut best = (f32::INFINITY, [1.0, 0.0, 0.0]);
        for k in 0..3 {
            let (a, b) = (self.corners[k], self.corners[(k + 1) % 3]);
            let side = b - a;
            let t =
                ((p - a).dot(side) / side.length_squared().max(f32::MIN_POSITIVE)).clamp(0.0, 1.0);
            let square = (a + side * t).distance_squared(p);
            if square < best.0 {
                let mut at = [0.0; 3];
                (at[k], at[(k + 1) % 3]) = (1.0 - t, t);
                best = (square, at);
            }
        }
        best
    }
}

/// Collects places lane by lane.
#[derive(Default)]
struct Gather {
    full: Vec<Places>,
    used: usize,
}

impl Gather {
    fn add(&mut self, skin: &Skin, laid: &Laid, texel: usize, at: [f32; 3]) {
        let mesh = skin.mesh();
        let corners = mesh.triangles[laid.triangle as usize].map(|i| i as usize);
        let mix = |values: [Vec3; 3]| values[0] * at[0] + values[1] * at[1] + values[2] * at[2];
        let place = mix(corners.map(|i| mesh.positions[i]));
        let normal = mix(corners.map(|i| mesh.normals[i]));
        let tangent = mix(corners.map(|i| mesh.tangents[i].truncate()));
        let sign = mesh.tangents[corners[0]].w;
        let Some((frame, _)) = Frame::new(normal, tangent.extend(sign)) else {
            return;
        };
        if self.used.is_multiple_of(LANES) {
            self.full.push(Places {
                texel: [NOWHERE; LANES],
                at: [[0.0; LANES]; 3],
                normal: [[0.0; LANES]; 3],
                tangent: [[0.0; LANES]; 3],
                bitangent: [[0.0; LANES]; 3],
                size: [1.0; LANES],
                center: Vec3::ZERO,
                radius: 0.0,
            });
        }
        let lane = self.used % LANES;
        let last = self.full.last_mut().expect("pushed when none was left");
        last.texel[lane] = texel as u16;
        let set = |to: &mut [Lane; 3], from: Vec3| {
            for (k, to) in to.iter_mut().enumerate() {
                to[lane] = from[k];
            }
        };
        set(&mut last.at, place);
        set(&mut last.normal, frame.normal);
        set(&mut last.tangent, frame.tangent);
        set(&mut last.bitangent, frame.bitangent);
        last.size[lane] = laid.size;
        self.used += 1;
    }

    fn done(mut self) -> Vec<Places> {
        for places in &mut self.full {
            let all: Vec<Vec3> = (0..LANES)
                .filter(|i| places.texel[*i] != NOWHERE)
                .map(|i| Vec3::new(places.at[0][i], places.at[1][i], places.at[2][i]))
                .collect();
            let low = all.iter().fold(Vec3::INFINITY, |m, p| m.min(*p));
            let high = all.iter().fold(Vec3::NEG_INFINITY, |m, p| m.max(*p));
            places.center = 0.5 * (low + high);
            places.radius = all
                .iter()
                .fold(0.0, |r: f32, p| r.max(p.distance(places.center)))
                * 1.0001;
        }
        self.full
    }
}
