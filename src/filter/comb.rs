//! Signs for directions: which of the two unit vectors along each texel's axis to write where a format wants an arrow.
//!
//! A renderer that filters vectors lets opposite ones cancel, so neighbours must agree in sign wherever the field allows.
//! It does not allow it everywhere: around a half-index singularity an axis turns by pi, and some seam must run out from it.
//! A full turn (a turned disc) needs none.
//!
//! Every row is cut into runs along which the axis turns by less than 22 degrees a step and that pass no pole, so that
//! inside a run each sign follows from the one before. Runs then become the nodes of a graph; two that touch are joined by
//! an edge that says whether they agree as they stand, and how much light says so: the sum over their common border of
//! eccentricity x cos²(turn). Round texels, whose direction light does not show, keep a floor of it: renderers filter their
//! vectors with those beside them, so they follow once everything else has found its sign. In rounds, every node joins the neighbour with the weightiest edge, and the edges of what has
//! become one node are summed up (Boruvka's spanning tree, with votes), so that large patches meet by the vote of their
//! whole border and not by that of its loudest texel. What contradictions remain lie on the lightest borders: along round
//! texels, sharp turns, or out of singularities. Deciding on a reduced copy of the field instead would be simpler, but where
//! threads or scratches cross at right angles the mean has no direction to ask.

use crate::map::AnisoMap;
use crate::math::half_angle;
use rayon::prelude::*;

/// Which of a texel's two axes the arrows lie along.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Line {
    /// The x axis.
    X,
    /// The axis of the larger width, along which highlights stretch.
    Stretched,
}

/// Below this eccentricity (widths 0.2 % apart) a texel is round: its direction shows in no light.
pub(super) const ROUND: f32 = 1e-3;

/// cos² of the sharpest turn inside a run, 22 degrees.
const STRAIGHT: f32 = 0.86;

/// Rows one task looks at.
const BAND: u32 = 64;

/// The signs of a map's directions.
#[derive(Clone, Debug)]
pub struct Combed<'a> {
    map: &'a AnisoMap,
    line: Line,
    /// One bit a texel, rows padded to whole words: set where the direction is the opposite of [`half_angle`]'s.
    flips: Vec<u64>,
}

/// Chooses the sign of every direction so that neighbours agree wherever the field allows, across the wrap as well. The
/// result is the same for any number of threads.
pub fn comb(map: &AnisoMap, line: Line) -> Combed<'_> {
    let mut combed = Combed {
        map,
        line,
        flips: vec![0; words(map.width()) * map.height() as usize],
    };
    let bands: Vec<Band> = combed
        .flips
        .par_chunks_mut(words(map.width()) * BAND as usize)
        .enumerate()
        .map(|(i, flips)| Band::new(map, line, i as u32 * BAND, flips))
        .collect();
    let turned = decide(&bands);
    let stride = words(map.width());
    combed
        .flips
        .par_chunks_mut(stride * BAND as usize)
        .zip(&bands)
        .zip(turned)
        .for_each(|((flips, band), turned)| {
            let mut turned = turned.iter();
            for (row, runs) in flips.chunks_mut(stride).zip(&band.rows) {
                turn_runs(row, runs, map.width(), &mut turned);
            }
        });
    combed
}

impl Combed<'_> {
    /// The unit vectors (cos θ, sin θ) of row `y`, signs chosen.
    ///
    /// # Panics
    /// When `y` lies outside the map or a slice is not as long as the map is wide.
    pub fn row(&self, y: u32, cos: &mut [f32], sin: &mut [f32]) {
        let width = self.map.width() as usize;
        assert!(cos.len() == width && sin.len() == width, "a row of the map");
        let row = AxisRow::new(self.map, self.line, y);
        let flips = &self.flips[y as usize * words(self.map.width())..];
        for x in 0..width {
            let sign = if bit(flips, x) { -1.0 } else { 1.0 };
            cos[x] = sign * row.cos[x];
            sin[x] = sign * row.sin[x];
        }
    }

    /// The map the signs belong to.
    pub fn map(&self) -> &AnisoMap {
        self.map
    }
}

fn words(width: u32) -> usize {
    (width as usize).div_ceil(64)
}

fn bit(words: &[u64], i: usize) -> bool {
    words[i / 64] >> (i % 64) & 1 != 0
}

/// The directions of one row before signs are chosen.
struct AxisRow {
    cos: Vec<f32>,
    sin: Vec<f32>,
    eccentricity: Vec<f32>,
}

impl AxisRow {
    fn new(map: &AnisoMap, line: Line, y: u32) -> Self {
        let width = map.width() as usize;
        let range = y as usize * width..(y as usize + 1) * width;
        let (ax, ay) = (&map.alpha_x()[range.clone()], &map.alpha_y()[range.clone()]);
        let (c2, s2) = (&map.cos2()[range.clone()], &map.sin2()[range]);
        let mut row = Self {
            cos: vec![0.0; width],
            sin: vec![0.0; width],
            eccentricity: vec![0.0; width],
        };
        for x in 0..width {
            let turn = if line == Line::Stretched && ax[x] < ay[x] {
                -1.0
            } else {
                1.0
            };
            (row.cos[x], row.sin[x]) = half_angle(turn * c2[x], turn * s2[x]);
            row.eccentricity[x] = (ax[x] - ay[x]).abs() / (ax[x] + ay[x]);
        }
        row
    }

    /// cos of the angle between the vectors at `a` of this row and `b` of another.
    fn cos_between(&self, a: usize, other: &Self, b: usize) -> f32 {
        self.cos[a] * other.cos[b] + self.sin[a] * other.sin[b]
    }

    /// Whether the axis turns by an odd number of half turns on the way round the four texels up and left of `x` > 0.
    fn encloses_pole(&self, above: &Self, x: usize) -> bool {
        let opposed = |cos: f32| cos < 0.0;
        opposed(self.cos_between(x - 1, self, x))
            ^ opposed(above.cos_between(x - 1, above, x))
            ^ opposed(self.cos_between(x - 1, above, x - 1))
            ^ opposed(self.cos_between(x, above, x))
    }

    /// How much light says that the two should agree; the sign is that of their agreement as they stand.
    fn support(&self, a: usize, other: &Self, b: usize) -> f32 {
        let cos = self.cos_between(a, other, b);
        let eccentricity = self.eccentricity[a].min(other.eccentricity[b]);
        cos * cos.abs() * eccentricity.max(ROUND)
    }
}

/// One row cut into runs.
struct Runs {
    /// The column where each run starts; the first is 0.
    starts: Vec<u32>,
    /// Per run, the eccentricity-weighted lean of its vectors toward +U (and a little toward up): which way round it looks
    /// tidy.
    lean: Vec<f32>,
}

impl Runs {
    /// Cuts the row and writes into `flips` the signs that make each run agree with its first texel.
    fn new(row: &AxisRow, above: Option<&AxisRow>, flips: &mut [u64]) -> Self {
        let mut runs = Self {
            starts: vec![0],
            lean: vec![],
        };
        let (mut flip, mut lean) = (false, 0.0);
        flips.fill(0);
        for x in 0..row.cos.len() {
            if x > 0 {
                let cos = row.cos_between(x - 1, row, x);
                let was_round = row.eccentricity[x - 1] < ROUND;
                let is_round = row.eccentricity[x] < ROUND;
                let pole = above.is_some_and(|above| row.encloses_pole(above, x));
                if was_round != is_round || (!is_round && (pole || cos * cos < STRAIGHT)) {
                    runs.starts.push(x as u32);
                    runs.lean.push(lean);
                    (flip, lean) = (false, 0.0);
                } else {
                    flip ^= cos < 0.0;
                }
            }
            flips[x / 64] |= u64::from(flip) << (x % 64);
            let toward = (row.cos[x] + 0.25 * row.sin[x]) * row.eccentricity[x];
            lean += if flip { -toward } else { toward };
        }
        runs.lean.push(lean);
        runs
    }

    fn len(&self) -> usize {
        self.starts.len()
    }

    fn end(&self, run: usize, width: usize) -> usize {
        self.starts.get(run + 1).map_or(width, |s| *s as usize)
    }
}

/// Two runs that touch.
#[derive(Clone, Copy)]
struct Edge {
    a: u32,
    b: u32,
    /// How strongly the border says what its sign says: positive, they agree as they stand.
    support: f32,
    /// Pairs of texels along the border.
    length: f32,
}

impl Edge {
    /// What decides who joins first: long borders before short ones, but straight and unanimous ones before long ones.
    fn weight(&self) -> f32 {
        let mean = self.support / self.length;
        self.support.abs() * mean * mean
    }
}

/// The runs of up to [`BAND`] rows, and their edges to each other and to the row above the band.
struct Band {
    rows: Vec<Runs>,
    /// Per row, the edges to the row above (`a` in that row, `b` in this) and then those inside the row; numbers count runs
    /// within a row.
    above: Vec<Vec<Edge>>,
    inside: Vec<Vec<Edge>>,
}

impl Band {
    fn new(map: &AnisoMap, line: Line, top: u32, flips: &mut [u64]) -> Self {
        let mut band = Self {
            rows: vec![],
            above: vec![],
            inside: vec![],
        };
        let mut previous = row_above(map, top).map(|y| {
            let mut flips = vec![0; words(map.width())];
            let row = AxisRow::new(map, line, y);
            let above = row_above(map, y).map(|y| AxisRow::new(map, line, y));
            let runs = Runs::new(&row, above.as_ref(), &mut flips);
            (row, runs.starts, flips)
        });
        for (flips, y) in flips.chunks_mut(words(map.width())).zip(top..) {
            let row = AxisRow::new(map, line, y);
            let runs = Runs::new(&row, previous.as_ref().map(|p| &p.0), flips);
            let current = (row, runs.starts.clone(), flips.to_vec());
            band.above.push(match &previous {
                Some(previous) => edges_between(previous, &current),
                None => vec![],
            });
            band.inside
                .push(edges_inside(&current, map.wrap().repeats_u()));
            band.rows.push(runs);
            previous = Some(current);
        }
        band
    }
}

/// The row that stands above row `y`, across the wrap as well.
fn row_above(map: &AnisoMap, y: u32) -> Option<u32> {
    match y {
        0 if map.wrap().repeats_v() && map.height() > 1 => Some(map.height() - 1),
        0 => None,
        _ => Some(y - 1),
    }
}

type RunRow = (AxisRow, Vec<u32>, Vec<u64>);

fn signed(support: f32, flipped: bool) -> f32 {
    if flipped { -support } else { support }
}

/// One edge for every pair of runs of two rows that have columns in common.
fn edges_between(
    (row_a, starts_a, flips_a): &RunRow,
    (row_b, starts_b, flips_b): &RunRow,
) -> Vec<Edge> {
    let width = row_a.cos.len();
    let end = |starts: &[u32], run: usize| starts.get(run + 1).map_or(width, |s| *s as usize);
    let mut edges = Vec::with_capacity(starts_a.len() + starts_b.len());
    let (mut a, mut b, mut x) = (0, 0, 0);
    while x < width {
        let (end_a, end_b) = (end(starts_a, a), end(starts_b, b));
        let until = end_a.min(end_b);
        let support = (x..until)
            .map(|x| {
                signed(
                    row_a.support(x, row_b, x),
                    bit(flips_a, x) != bit(flips_b, x),
                )
            })
            .sum();
        edges.push(Edge {
            a: a as u32,
            b: b as u32,
            support,
            length: (until - x) as f32,
        });
        a += usize::from(end_a == until);
        b += usize::from(end_b == until);
        x = until;
    }
    edges
}

/// Edges between runs that follow each other, and from the last to the first where the map repeats.
fn edges_inside((row, starts, flips): &RunRow, repeats: bool) -> Vec<Edge> {
    let edge = |(a, at): (usize, usize), (b, to): (usize, usize)| Edge {
        a: a as u32,
        b: b as u32,
        support: signed(row.support(at, row, to), bit(flips, at) != bit(flips, to)),
        length: 1.0,
    };
    let mut edges: Vec<_> = (1..starts.len())
        .map(|run| {
            let x = starts[run] as usize;
            edge((run - 1, x - 1), (run, x))
        })
        .collect();
    if repeats && starts.len() > 1 {
        edges.push(edge((starts.len() - 1, row.cos.len() - 1), (0, 0)));
    }
    edges
}

/// Per band and run, whether it must be turned round.
fn decide(bands: &[Band]) -> Vec<Vec<bool>> {
    let runs = bands.iter().flat_map(|b| &b.rows).map(Runs::len).sum();
    let mut forest = Forest::new(runs);
    let mut edges = summed(numbered_edges(bands));
    while !edges.is_empty() {
        for edge in heaviest(&edges, runs) {
            forest.join(edge.a, edge.b, edge.support < 0.0);
        }
        for edge in &mut edges {
            let ((a, turned_a), (b, turned_b)) = (forest.root(edge.a), forest.root(edge.b));
            *edge = Edge {
                a,
                b,
                support: signed(edge.support, turned_a != turned_b),
                length: edge.length,
            };
        }
        edges = summed(edges);
    }
    let mut lean = vec![0.0f32; runs];
    let leans = bands.iter().flat_map(|b| &b.rows).flat_map(|r| &r.lean);
    for (run, own) in (0..).zip(leans) {
        let (root, turned) = forest.root(run);
        lean[root as usize] += signed(*own, turned);
    }
    let mut next = 0..;
    bands
        .iter()
        .map(|band| {
            let own = band.rows.iter().map(Runs::len).sum();
            next.by_ref()
                .take(own)
                .map(|run| {
                    let (root, turned) = forest.root(run);
                    turned != (lean[root as usize] < 0.0)
                })
                .collect()
        })
        .collect()
}

/// All edges with runs numbered through the whole map.
fn numbered_edges(bands: &[Band]) -> Vec<Edge> {
    let mut first = 0;
    let bases: Vec<u32> = bands
        .iter()
        .flat_map(|b| &b.rows)
        .map(|r| {
            first += r.len() as u32;
            first - r.len() as u32
        })
        .collect();
    let rows: Vec<_> = bands
        .iter()
        .flat_map(|b| b.above.iter().zip(&b.inside))
        .collect();
    rows.par_iter()
        .enumerate()
        .flat_map_iter(|(y, (above, inside))| {
            let (own, upper) = (bases[y], bases[(y + bases.len() - 1) % bases.len()]);
            let renumber = move |e: &Edge, a: u32| Edge {
                a: e.a + a,
                b: e.b + own,
                ..*e
            };
            let above = above.iter().map(move |e| renumber(e, upper));
            above.chain(inside.iter().map(move |e| renumber(e, own)))
        })
        .collect()
}

/// Edges from the lower to the higher number, each pair once with the sum of its support; edges of a node to itself are gone.
fn summed(mut edges: Vec<Edge>) -> Vec<Edge> {
    edges.retain_mut(|e| {
        if e.a > e.b {
            std::mem::swap(&mut e.a, &mut e.b);
        }
        e.a != e.b
    });
    // Stable, so that sums do not depend on the number of threads.
    edges.par_sort_by_key(|e| (e.a, e.b));
    edges.dedup_by(|next, kept| {
        let same = (next.a, next.b) == (kept.a, kept.b);
        if same {
            kept.support += next.support;
            kept.length += next.length;
        }
        same
    });
    edges
}

/// For every node that has any, its heaviest edge; of equal ones the first.
fn heaviest(edges: &[Edge], nodes: usize) -> Vec<Edge> {
    const NONE: u32 = u32::MAX;
    let mut best = vec![NONE; nodes];
    for (i, edge) in (0u32..).zip(edges) {
        for node in [edge.a, edge.b] {
            let slot = &mut best[node as usize];
            if *slot == NONE || edge.weight() > edges[*slot as usize].weight() {
                *slot = i;
            }
        }
    }
    best.retain(|i| *i != NONE);
    best.into_iter().map(|i| edges[i as usize]).collect()
}

/// Union-find in which every node knows whether it is turned against its parent.
struct Forest {
    /// Parent in the upper bits, turned or not in the lowest.
    parent: Vec<u32>,
}

impl Forest {
    fn new(nodes: usize) -> Self {
        Self {
            // A map has at most 2^28 texels, and no more runs than that.
            parent: (0..nodes as u32).map(|i| i << 1).collect(),
        }
    }

    /// The root of a node, and whether the node is turned against it.
    fn root(&mut self, mut node: u32) -> (u32, bool) {
        let mut turned = 0;
        loop {
            let up = self.parent[node as usize];
            let upper = self.parent[(up >> 1) as usize];
            if upper >> 1 == up >> 1 {
                return (up >> 1, (turned ^ up) & 1 != 0);
            }
            // Halve the way for whoever comes next.
            self.parent[node as usize] = upper ^ (up & 1);
            turned ^= upper ^ up;
            node = upper >> 1;
        }
    }

    fn join(&mut self, a: u32, b: u32, turned: bool) {
        let (root_a, turned_a) = self.root(a);
        let (root_b, turned_b) = self.root(b);
        if root_a != root_b {
            let (low, high) = (root_a.min(root_b), root_a.max(root_b));
            self.parent[high as usize] = low << 1 | u32::from(turned_a ^ turned_b ^ turned);
        }
    }
}

fn turn_runs<'a>(
    row: &mut [u64],
    runs: &Runs,
    width: u32,
    turned: &mut impl Iterator<Item = &'a bool>,
) {
    for run in 0..runs.len() {
        if *turned.next().expect("one answer a run") {
            let range = runs.starts[run] as usize..runs.end(run, width as usize);
            range.for_each(|x| row[x / 64] ^= 1 << (x % 64));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::convention::Stretched;
    use crate::map::{DEFAULT_TEXEL, Size, Texel, Wrap};
    use crate::math::Axis;
    use glam::Vec2;

    /// A map of (u, v) -> degrees, alphas 0.1 along and 0.3 across.
    fn field(side: u32, wrap: Wrap, degrees: impl Fn(f32, f32) -> f32) -> AnisoMap {
        let mut map = AnisoMap::constant(Size::new(side, side).unwrap(), wrap, DEFAULT_TEXEL);
        let mut region = map.region_mut();
        for i in 0..(side * side) as usize {
            let u = (i % side as usize) as f32 + 0.5;
            let v = (i / side as usize) as f32 + 0.5;
            region.set(
                i,
                Texel {
                    alpha_x: 0.1,
                    alpha_y: 0.3,
                    axis: Axis::from_degrees(degrees(u / side as f32, 1.0 - v / side as f32)),
                },
            );
        }
        map
    }

    fn rows(combed: &Combed<'_>) -> Vec<Vec<Vec2>> {
        let width = combed.map().width() as usize;
        (0..combed.map().height())
            .map(|y| {
                let (mut cos, mut sin) = (vec![0.0; width], vec![0.0; width]);
                combed.row(y, &mut cos, &mut sin);
                cos.into_iter().zip(sin).map(Vec2::from).collect()
            })
            .collect()
    }

    /// Pairs of neighbours, across the wrap as well, whose axes differ by less than 30 degrees and whose signs oppose.
    fn seams(combed: &Combed<'_>) -> Vec<(usize, usize)> {
        let (rows, map) = (rows(combed), combed.map());
        let (w, h) = (map.width(), map.height());
        let mut found = vec![];
        for y in 0..h {
            for x in 0..w {
                let right = (map.wrap().column(i64::from(x) + 1, w), y);
                let below = (x, map.wrap().row(i64::from(y) + 1, h));
                for (x2, y2) in [right, below] {
                    let p = rows[y as usize][x as usize];
                    if p.dot(rows[y2 as usize][x2 as usize]) < -(30f32.to_radians().cos()) {
                        found.push((x as usize, y as usize));
                    }
                }
            }
        }
        found
    }

    fn angle_about(u: f32, v: f32, index: f32) -> f32 {
        index * (v - 0.5).atan2(u - 0.5).to_degrees()
    }

    #[test]
    fn a_turned_disc_and_its_spokes_need_no_seam() {
        for offset in [0.0, 37.0, 90.0] {
            let map = field(129, Wrap::Clamp, |u, v| angle_about(u, v, 1.0) + offset);
            for line in [Line::X, Line::Stretched] {
                let mut found = seams(&comb(&map, line));
                // The texel on the pole itself has no right sign.
                found.retain(|(x, y)| x.abs_diff(64) > 1 || y.abs_diff(64) > 1);
                assert_eq!(found, [], "{offset} {line:?}");
            }
        }
        let saddle = field(128, Wrap::Clamp, |u, v| angle_about(u, v, -1.0));
        assert_eq!(seams(&comb(&saddle, Line::X)), []);
    }

    #[test]
    fn a_half_turn_has_one_seam_from_its_pole_to_the_border() {
        let map = field(128, Wrap::Clamp, |u, v| angle_about(u, v, 0.5));
        let n = seams(&comb(&map, Line::X)).len();
        assert!(
            (60..=70).contains(&n),
            "{n} pairs; the way out is 64 texels"
        );
    }

    #[test]
    fn seams_avoid_what_can_be_seen() {
        // A half-index pole with a round sector to its upper left: the seam must run through it.
        let mut map = field(64, Wrap::Clamp, |u, v| angle_about(u, v, 0.5));
        let mut region = map.region_mut();
        for i in 0..64 * 64 {
            let (x, y) = (i % 64, i / 64);
            if x < 32 && y < 34 && y + 4 > x {
                let axis = region.texel(i).axis;
                region.set(
                    i,
                    Texel {
                        alpha_x: 0.2,
                        alpha_y: 0.2,
                        axis,
                    },
                );
            }
        }
        for (x, y) in seams(&comb(&map, Line::X)) {
            let near_pole = x.abs_diff(32) <= 2 && y.abs_diff(32) <= 2;
            assert!(near_pole || map.texel(x as u32, y as u32).ratio() < 1.01);
        }
    }

    #[test]
    fn round_texels_follow_those_around_them() {
        let ring = |x: usize, y: usize| {
            let (x, y) = (x as f32 - 63.5, y as f32 - 63.5);
            let r = x.hypot(y);
            r < 9.0 || (30.0..40.0).contains(&r)
        };
        let mut map = field(128, Wrap::Clamp, |u, v| angle_about(u, v, 1.0) + 20.0);
        let mut region = map.region_mut();
        for i in (0..128 * 128).filter(|i| ring(i % 128, i / 128)) {
            let axis = region.texel(i).axis;
            region.set(
                i,
                Texel {
                    alpha_x: 0.2,
                    alpha_y: 0.2,
                    axis,
                },
            );
        }
        let mut found = seams(&comb(&map, Line::X));
        found.retain(|(x, y)| x.abs_diff(63) > 1 || y.abs_diff(63) > 1);
        assert_eq!(found, []);
    }

    #[test]
    fn crossing_threads_are_each_combed() {
        // Squares of 5 texels at about 0 and 90 degrees: the mean field has no direction at all.
        let noise = |u: f32, v: f32| 12.0 * ((u * 911.0).sin() + (v * 733.0).cos());
        let square = |t: f32| (t * 120.0) as u32 / 5;
        let map = field(120, Wrap::Repeat, |u, v| {
            let warp = (square(u) + square(v)) % 2 == 0;
            (if warp { 90.0 } else { 0.0 }) + noise(u, v)
        });
        assert_eq!(seams(&comb(&map, Line::X)), []);
    }

    #[test]
    fn islands_meet_along_their_borders() {
        // Two turned discs in a plate brushed along u: some seam must be, and the border of a disc is its place.
        let disc = |u: f32, v: f32| (v < 0.4 && u < 0.66).then_some((u % 0.33 - 0.165, v - 0.2));
        let map = field(256, Wrap::Repeat, |u, v| {
            disc(u, v).map_or(0.0, |(x, y)| y.atan2(x).to_degrees() + 90.0)
        });
        let border = |x: usize, y: usize| {
            let here = |x: usize, y: usize| {
                let (u, v) = ((x as f32 + 0.5) / 256.0, 1.0 - (y as f32 + 0.5) / 256.0);
                disc(u, v).map(|_| (u / 0.33) as u32)
            };
            here(x, y) != here((x + 1) % 256, y) || here(x, y) != here(x, (y + 1) % 256)
        };
        let pole = |x: usize, y: usize| {
            let near = |c: f32| (x as f32 - c * 256.0).abs() < 3.0;
            (near(0.165) || near(0.495)) && (y as f32 - 0.8 * 256.0).abs() < 3.0
        };
        let mut found = seams(&comb(&map, Line::X));
        found.retain(|(x, y)| !border(*x, *y) && !pole(*x, *y));
        assert_eq!(found, []);
    }

    #[test]
    fn the_wrap_counts_as_neighbourhood_and_the_result_looks_tidy() {
        // One full turn around the cylinder: continuous as an arrow across u = 0.
        let map = field(96, Wrap::RepeatU, |u, _| 360.0 * u + 10.0);
        assert_eq!(seams(&comb(&map, Line::X)), []);
        // Half a turn: one column of seams, no more.
        let map = field(96, Wrap::RepeatU, |u, _| 180.0 * u + 10.0);
        assert_eq!(seams(&comb(&map, Line::X)).len(), 96);
        // Brushed about 0 and about 90 degrees: along +U, and upward.
        for (mean, want) in [(0.0, Vec2::X), (90.0, Vec2::Y)] {
            let map = field(50, Wrap::Repeat, |u, v| {
                mean + 20.0 * (u * 70.0 + v * 911.0).sin()
            });
            let combed = comb(&map, Line::X);
            assert!(rows(&combed).iter().flatten().all(|d| d.dot(want) > 0.9));
        }
    }

    #[test]
    fn directions_lie_along_their_axes_for_any_size_and_number_of_threads() {
        let noise = |u: f32, v: f32| 1e5 * ((u * 9e4).sin() + (v * 7e4).cos());
        for (w, h) in [(1, 1), (1, 70), (65, 1), (2, 2), (200, 150)] {
            let mut map = AnisoMap::constant(Size::new(w, h).unwrap(), Wrap::Repeat, DEFAULT_TEXEL);
            let mut region = map.region_mut();
            for i in 0..(w * h) as usize {
                let axis = Axis::from_degrees(noise(i as f32, 0.3));
                region.set(
                    i,
                    Texel {
                        alpha_x: 0.1,
                        alpha_y: 0.2,
                        axis,
                    },
                );
            }
            let combed = comb(&map, Line::X);
            for (i, d) in rows(&combed).iter().flatten().enumerate() {
                let axis = Axis::from_vector(*d).unwrap();
                assert!(axis.angle_to(map.texel_at(i).axis) < 1e-6);
            }
            let single = rayon::ThreadPoolBuilder::new()
                .num_threads(1)
                .build()
                .unwrap()
                .install(|| comb(&map, Line::X).flips.clone());
            assert_eq!(single, combed.flips);
        }
    }

    #[test]
    fn stretched_lines_follow_the_larger_width() {
        let mut map = field(40, Wrap::Clamp, |u, v| angle_about(u, v, 1.0));
        let mut region = map.region_mut();
        // The same ellipses, every other column named the other way round.
        for i in (0..1600).step_by(2) {
            let turned = Stretched::from(region.texel(i)).to_texel(true);
            region.set(i, turned);
        }
        let combed = comb(&map, Line::Stretched);
        assert_eq!(seams(&combed), []);
        for (i, d) in rows(&combed).iter().flatten().enumerate() {
            let axis = Stretched::from(map.texel_at(i)).axis;
            assert!(Axis::from_vector(*d).unwrap().angle_to(axis) < 1e-6);
        }
    }
}
