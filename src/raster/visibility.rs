//! Which triangle each sample sees: fixed-point edge functions over tiles, nearest depth wins.

use super::camera::{Vertex, View};
use super::clip::clip;
use super::{Cull, TILE};
use crate::error::Result;
use crate::map::Rect;
use crate::mesh::Mesh;
use crate::progress::Progress;
use rayon::prelude::*;

/// Fractional bits of a screen coordinate.
const SUBPIXEL: i64 = 1 << 8;
/// Farther out than the guard band reaches: a corner that rounding threw there (planet-sized triangles) is not drawn.
const FAR_OUT: i64 = 1 << 29;
/// No triangle.
pub(super) const NOTHING: u32 = u32::MAX;
/// Triangles that are set up and binned at a time: bounds the memory of the bins.
const BATCH: usize = 1 << 15;

/// What the samples of one tile see so far, in row order.
pub(super) struct Seen {
    pub(super) rect: Rect,
    /// Index of the mesh's triangle, or [`NOTHING`].
    pub(super) triangle: Vec<u32>,
    /// See [`View::depth`].
    pub(super) depth: Vec<f32>,
}

/// A triangle ready to be drawn, turned so that its inside is where the edge functions are positive.
#[derive(Clone, Copy)]
struct Setup {
    x: [i64; 3],
    y: [i64; 3],
    depth: [f64; 3],
    /// First and last column and row whose centre may be inside, in samples; may lie outside the window.
    columns: (i64, i64),
    rows: (i64, i64),
    triangle: u32,
}

/// A linear function over samples: `value + dx column + dy row`, inside where it is at least 0.
#[derive(Clone, Copy)]
struct Edge {
    value: i64,
    dx: i64,
    dy: i64,
    /// 0 when samples exactly on the edge belong to the triangle (a top or left edge), else -1.
    bias: i64,
}

impl Edge {
    fn at(&self, column: i64, row: i64) -> i64 {
        self.value + self.dx * column + self.dy * row
    }
}

impl Setup {
    fn new(view: &View, corners: [&Vertex; 3], triangle: u32, cull: Cull) -> Option<Self> {
        let fixed = |v: f64| (v * SUBPIXEL as f64).round() as i64;
        let mut x = corners.map(|v| fixed(v.h.x / v.h.z));
        let mut y = corners.map(|v| fixed(v.h.y / v.h.z));
        if x.iter()
            .chain(&y)
            .any(|c| !(-FAR_OUT..=FAR_OUT).contains(c))
        {
            return None;
        }
        let mut depth = corners.map(|v| view.depth(v));
        let area = (x[1] - x[0]) * (y[2] - y[0]) - (x[2] - x[0]) * (y[1] - y[0]);
        // Rows run downward, so a counter-clockwise triangle has a negative area here.
        if area == 0 || (area > 0 && cull == Cull::Back) {
            return None;
        }
        if area < 0 {
            x.swap(1, 2);
            y.swap(1, 2);
            depth.swap(1, 2);
        }
        // Centres lie at half samples.
        let range = |c: [i64; 3]| {
            let low = c.into_iter().min().unwrap_or(0) - SUBPIXEL / 2;
            let high = c.into_iter().max().unwrap_or(0) - SUBPIXEL / 2;
            (-(-low).div_euclid(SUBPIXEL), high.div_euclid(SUBPIXEL))
        };
        let (columns, rows) = (range(x), range(y));
        (columns.0 <= columns.1 && rows.0 <= rows.1).then_some(Self {
            x,
            y,
            depth,
            columns,
            rows,
            triangle,
        })
    }

    /// The edge opposite corner `i`, as a function of (column, row) of sample centres.
    fn edge(&self, i: usize) -> Edge {
        let (a, b) = ((i + 1) % 3, (i + 2) % 3);
        let (ex, ey) = (self.x[b] - self.x[a], self.y[b] - self.y[a]);
        let half = SUBPIXEL / 2;
        let top_left = ey < 0 || (ey == 0 && ex > 0);
        Edge {
            value: ex * (half - self.y[a]) - ey * (half - self.x[a]),
            dx: -ey * SUBPIXEL,
            dy: ex * SUBPIXEL,
            bias: if top_left { 0 } else { -1 },
        }
    }

    fn draw(&self, seen: &mut Seen) {
        let rect = seen.rect;
        let (left, top) = (i64::from(rect.x), i64::from(rect.y));
        let columns = (
            self.columns.0.max(left),
            self.columns.1.min(left + i64::from(rect.width) - 1),
        );
        let rows = (
            self.rows.0.max(top),
            self.rows.1.min(top + i64::from(rect.height) - 1),
        );
        let edges = [self.edge(0), self.edge(1), self.edge(2)];
        // A tile that lies wholly outside one edge needs no loop.
        let largest = |e: &Edge| {
            e.at(
                if e.dx > 0 { columns.1 } else { columns.0 },
                if e.dy > 0 { rows.1 } else { rows.0 },
            ) + e.bias
        };
        if edges.iter().any(|e| largest(e) < 0) {
            return;
        }
        let area: i64 = edges.iter().map(|e| e.at(0, 0)).sum();
        let depth = self.depth.map(|d| d / area as f64);
        for row in rows.0..=rows.1 {
            let mut e = edges.map(|e| e.at(columns.0, row));
            let line = (row - top) as usize * rect.width as usize;
            for column in columns.0..=columns.1 {
                if ((e[0] + edges[0].bias) | (e[1] + edges[1].bias) | (e[2] + edges[2].bias)) >= 0 {
                    let d =
                        e[0] as f64 * depth[0] + e[1] as f64 * depth[1] + e[2] as f64 * depth[2];
                    let place = line + (column - left) as usize;
                    // Of two at one depth the first drawn stays.
                    if d as f32 > seen.depth[place] {
                        seen.depth[place] = d as f32;
                        seen.triangle[place] = self.triangle;
                    }
                }
                for (value, edge) in e.iter_mut().zip(&edges) {
                    *value += edge.dx;
                }
            }
        }
    }
}

/// Draws every triangle of the mesh into the tiles of the window.
pub(super) fn draw(
    mesh: &Mesh,
    view: &View,
    window: Rect,
    cull: Cull,
    progress: &Progress<'_>,
) -> Result<Vec<Seen>> {
    let vertices: Vec<Option<Vertex>> = mesh
        .positions
        .par_iter()
        .map(|p| view.project(*p))
        .collect();
    let mut tiles: Vec<Seen> = window
        .tiles(TILE)
        .map(|rect| Seen {
            rect,
            triangle: vec![NOTHING; rect.texels()],
            depth: vec![f32::NEG_INFINITY; rect.texels()],
        })
        .collect();
    for (batch, triangles) in mesh.triangles.chunks(BATCH).enumerate() {
        progress.check()?;
        let first = batch * BATCH;
        let setups: Vec<Setup> = triangles
            .par_chunks(1024)
            .enumerate()
            .flat_map_iter(|(chunk, some)| {
                let mut setups = Vec::with_capacity(some.len());
                for (i, triangle) in some.iter().enumerate() {
                    let index = (first + chunk * 1024 + i) as u32;
                    set_up(view, &vertices, *triangle, index, cull, &mut setups);
                }
                setups
            })
            .collect();
        let bins = bin(&setups, window);
        tiles.par_iter_mut().zip(&bins).for_each(|(tile, bin)| {
            for &i in bin {
                setups[i as usize].draw(tile);
            }
        });
    }
    Ok(tiles)
}

fn set_up(
    view: &View,
    vertices: &[Option<Vertex>],
    triangle: [u32; 3],
    index: u32,
    cull: Cull,
    setups: &mut Vec<Setup>,
) {
    let [Some(a), Some(b), Some(c)] = triangle.map(|i| vertices[i as usize]) else {
        return;
    };
    let Some(polygon) = clip(view, [a, b, c]) else {
        return;
    };
    let corners = polygon.corners();
    for pair in corners[1..].windows(2) {
        setups.extend(Setup::new(
            view,
            [&corners[0], &pair[0], &pair[1]],
            index,
            cull,
        ));
    }
}

/// For each tile of the window the setups whose bounds touch it, in order.
fn bin(setups: &[Setup], window: Rect) -> Vec<Vec<u32>> {
    let across = window.width.div_ceil(TILE) as usize;
    let down = window.height.div_ceil(TILE) as usize;
    let mut bins = vec![Vec::new(); across * down];
    let tiles = |(low, high): (i64, i64), start: u32, length: u32| {
        let start = i64::from(start);
        let low = (low - start).max(0);
        let high = (high - start).min(i64::from(length) - 1);
        let tile = i64::from(TILE);
        if low > high {
            0..0
        } else {
            (low / tile) as usize..(high / tile) as usize + 1
        }
    };
    for (i, setup) in setups.iter().enumerate() {
        let columns = tiles(setup.columns, window.x, window.width);
        for row in tiles(setup.rows, window.y, window.height) {
            for column in columns.clone() {
                bins[row * across + column].push(i as u32);
            }
        }
    }
    bins
}
