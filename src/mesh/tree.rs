//! Boxes in boxes around the triangles of a mesh: which lie near a place, and which a line of sight meets first.

use super::{Islands, Mesh};
use crate::error::Result;
use glam::{DVec3, Vec3};
use rayon::prelude::*;
use std::sync::{Arc, OnceLock};

/// Triangles of a leaf.
const LEAF: usize = 8;
/// Triangles from which on both halves of a box are sorted at once.
const APART: usize = 1 << 14;

/// A mesh that was checked, with the tree over its triangles: made once, and shared by all who look for places on it.
#[derive(Debug)]
pub struct Body {
    mesh: Arc<Mesh>,
    nodes: Vec<Node>,
    /// Triangles in the order of the leaves.
    order: Vec<u32>,
    islands: OnceLock<Islands>,
}

/// A box: a leaf holds triangles, any other two boxes, the first of which follows it.
#[derive(Debug)]
struct Node {
    low: Vec3,
    high: Vec3,
    /// First triangle of a leaf, or how many boxes further the second one is.
    next: u32,
    /// Triangles of a leaf; 0 for any other.
    count: u32,
}

/// Where a ray meets a triangle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Met {
    /// The triangle's number.
    pub triangle: u32,
    /// How far from the ray's origin, in lengths of its direction.
    pub distance: f32,
    /// The weights of the triangle's corners there.
    pub weights: [f32; 3],
}

type Box3 = (Vec3, Vec3);

impl Body {
    /// Grows the tree of a mesh.
    ///
    /// # Errors
    /// Those of [`Mesh::validate`].
    pub fn new(mesh: Arc<Mesh>) -> Result<Self> {
        mesh.validate()?;
        let triangles = mesh.triangles.par_iter().with_min_len(4096);
        let boxes: Vec<Box3> = triangles
            .map(|t| {
                let [a, b, c] = mesh.corners(*t);
                (a.min(b).min(c), a.max(b).max(c))
            })
            .collect();
        let mut order: Vec<u32> = (0..boxes.len() as u32).collect();
        let nodes = grow(&boxes, &mut order, 0);
        Ok(Self {
            mesh,
            nodes,
            order,
            islands: OnceLock::new(),
        })
    }

    /// The mesh.
    pub fn mesh(&self) -> &Arc<Mesh> {
        &self.mesh
    }

    /// The islands of its layout, found when they are first asked for.
    pub fn islands(&self) -> &Islands {
        self.islands.get_or_init(|| self.mesh.islands())
    }

    /// Calls `visit` with every triangle whose box meets another.
    pub fn near(&self, low: Vec3, high: Vec3, mut visit: impl FnMut(u32)) {
        self.near_leaves(low, high, |_, triangles| {
            for triangle in triangles {
                let [a, b, c] = self.corners(*triangle);
                if meets((a.min(b).min(c), a.max(b).max(c)), (low, high)) {
                    visit(*triangle);
                }
            }
        });
    }

    /// Calls `visit` with the leaves whose boxes meet another: the number of each, and its triangles.
    pub fn near_leaves(&self, low: Vec3, high: Vec3, mut visit: impl FnMut(u32, &[u32])) {
        let mut open = vec![0u32];
        while let Some(n) = open.pop() {
            let Some(node) = self.nodes.get(n as usize) else {
                continue;
            };
            if !meets((node.low, node.high), (low, high)) {
                continue;
            }
            if node.count == 0 {
                open.extend([n + node.next, n + 1]);
            } else {
                visit(n, self.leaf(node));
            }
        }
    }

    /// The triangles of every leaf by its number; none where there is no leaf of that number.
    pub fn leaves(&self) -> impl IndexedParallelIterator<Item = &[u32]> {
        let nodes = self.nodes.par_iter().with_min_len(4096);
        nodes.map(|node| {
            if node.count == 0 {
                &[]
            } else {
                self.leaf(node)
            }
        })
    }

    /// The nearest triangle that a ray meets, from whichever side; of several at one distance the one whose corners have the
    /// smallest numbers.
    pub fn first_met(&self, origin: Vec3, direction: Vec3) -> Option<Met> {
        let ray = Ray::new(origin, direction);
        let mut best: Option<Met> = None;
        let mut open = vec![(0u32, f64::NEG_INFINITY)];
        while let Some((n, enters)) = open.pop() {
            // As distances are told in f32, one that is a rounding farther may be the same.
            let most = best.map_or(f64::INFINITY, |b| f64::from(b.distance) * (1.0 + 1e-6));
            let node = &self.nodes[n as usize];
            if enters > most {
                continue;
            }
            if node.count == 0 {
                let children = [n + 1, n + node.next];
                let [a, b] = children.map(|c| (c, ray.enters(&self.nodes[c as usize])));
                let far_first = if a.1 <= b.1 { [b, a] } else { [a, b] };
                let met = far_first.into_iter();
                open.extend(met.filter_map(|(c, at)| Some((c, at.filter(|at| *at <= most)?))));
                continue;
            }
            for &triangle in self.leaf(node) {
                let key = |m: &Met| self.mesh.triangles[m.triangle as usize];
                let Some(met) = ray.meet(self.corners(triangle), triangle) else {
                    continue;
                };
                let nearer = best.as_ref().is_none_or(|b| {
                    let order = met.distance.total_cmp(&b.distance);
                    order.then_with(|| key(&met).cmp(&key(b))).is_lt()
                });
                if nearer {
                    best = Some(met);
                }
            }
        }
        best
    }

    fn leaf(&self, node: &Node) -> &[u32] {
        &self.order[node.next as usize..(node.next + node.count) as usize]
    }

    fn corners(&self, triangle: u32) -> [Vec3; 3] {
        self.mesh.corners(self.mesh.triangles[triangle as usize])
    }
}

fn meets(a: Box3, b: Box3) -> bool {
    a.0.cmple(b.1).all() && a.1.cmpge(b.0).all()
}

/// The tree of some triangles, at most 32 boxes deep; `first` is the place of the first of them in the whole order.
fn grow(boxes: &[Box3], order: &mut [u32], first: u32) -> Vec<Node> {
    let bounds = order
        .iter()
        .fold((Vec3::INFINITY, Vec3::NEG_INFINITY), |(low, high), n| {
            let (a, b) = boxes[*n as usize];
            (low.min(a), high.max(b))
        });
    let (low, high) = bounds;
    let mut nodes = vec![Node {
        low,
        high,
        next: first,
        count: order.len() as u32,
    }];
    if order.len() <= LEAF {
        return nodes;
    }
    let sides = (high - low).to_array();
    let axis = (0..3).fold(0, |m, k| if sides[k] > sides[m] { k } else { m });
    let middle = |n: &u32| {
        let (a, b) = boxes[*n as usize];
        a[axis] + b[axis]
    };
    let half = order.len() / 2;
    // Equal places are told apart by number: the same tree on every machine.
    order.select_nth_unstable_by(half, |a, b| middle(a).total_cmp(&middle(b)).then(a.cmp(b)));
    let large = order.len() >= APART;
    let (left, right) = order.split_at_mut(half);
    let second = first + half as u32;
    let (left, right) = if large {
        rayon::join(|| grow(boxes, left, first), || grow(boxes, right, second))
    } else {
        (grow(boxes, left, first), grow(boxes, right, second))
    };
    nodes[0].next = 1 + left.len() as u32;
    nodes[0].count = 0;
    nodes.extend(left);
    nodes.extend(right);
    nodes
}

/// A line of sight. All in f64: near the edge of a mesh f32 would see through it.
struct Ray {
    origin: DVec3,
    direction: DVec3,
}

impl Ray {
    fn new(origin: Vec3, direction: Vec3) -> Self {
        Self {
            origin: origin.as_dvec3(),
            direction: direction.as_dvec3(),
        }
    }

    /// Where it enters a box, with room for rounding; `None` where it passes by, or the box lies behind.
    fn enters(&self, node: &Node) -> Option<f64> {
        let (mut near, mut far) = (f64::NEG_INFINITY, f64::INFINITY);
        for k in 0..3 {
            let (o, d) = (self.origin[k], self.direction[k]);
            let (low, high) = (f64::from(node.low[k]), f64::from(node.high[k]));
            let room = 1e-9 * (low.abs().max(high.abs()) + o.abs()) + f64::MIN_POSITIVE;
            let (low, high) = (low - room - o, high + room - o);
            if d == 0.0 {
                if low > 0.0 || high < 0.0 {
                    return None;
                }
                continue;
            }
            let (a, b) = (low / d, high / d);
            near = near.max(a.min(b));
            far = far.min(a.max(b));
        }
        (near <= far && far >= 0.0).then_some(near)
    }

    /// Where it meets a triangle before its origin (Möller and Trumbore 1997).
    fn meet(&self, corners: [Vec3; 3], triangle: u32) -> Option<Met> {
        let [a, b, c] = corners.map(|p| p.as_dvec3());
        let (ab, ac) = (b - a, c - a);
        let p = self.direction.cross(ac);
        let determinant = ab.dot(p);
        if determinant == 0.0 {
            return None;
        }
        let s = (self.origin - a) / determinant;
        let u = s.dot(p);
        let q = s.cross(ab);
        let (v, distance) = (self.direction.dot(q), ac.dot(q));
        let inside = u >= 0.0 && v >= 0.0 && u + v <= 1.0 && distance > 0.0;
        inside.then_some(Met {
            triangle,
            distance: distance as f32,
            weights: [1.0 - u - v, u, v].map(|w| w as f32),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::{BUILTIN_NAMES, builtin};

    /// Numbers from -1 to 1.
    fn random(n: u32) -> f32 {
        let mixed = (n ^ 0x9e37).wrapping_mul(2_654_435_761);
        (mixed ^ (mixed >> 15)).wrapping_mul(0x2c1b_3c6d) as i32 as f32 / 2_147_483_648.0
    }

    fn place(n: u32) -> Vec3 {
        Vec3::new(random(3 * n), random(3 * n + 1), random(3 * n + 2))
    }

    #[test]
    fn what_is_met_first_is_what_looking_at_all_finds() {
        let mut hits = 0;
        for name in BUILTIN_NAMES {
            let body = Body::new(Arc::new(builtin(name).unwrap())).unwrap();
            for n in 0..300 {
                let origin = place(n) * 3.0;
                let direction = match n % 3 {
                    0 => place(n + 5000) - origin,
                    1 => Vec3::NEG_Y,
                    _ => -origin,
                };
                let ray = Ray::new(origin, direction);
                let triangles = &body.mesh.triangles;
                let all = (0..triangles.len() as u32).filter_map(|t| ray.meet(body.corners(t), t));
                let first = all.min_by(|a, b| {
                    let key = |m: &Met| triangles[m.triangle as usize];
                    a.distance
                        .total_cmp(&b.distance)
                        .then_with(|| key(a).cmp(&key(b)))
                });
                let met = body.first_met(origin, direction);
                assert_eq!(
                    met.map(|m| (m.distance, m.weights)),
                    first.map(|m| (m.distance, m.weights)),
                    "{name}, ray {n}"
                );
                hits += u32::from(met.is_some());
            }
        }
        assert!(hits > 300, "{hits} hits");
    }

    #[test]
    fn what_is_near_is_what_looking_at_all_finds() {
        let body = Body::new(Arc::new(builtin("pot").unwrap())).unwrap();
        for n in 0..50 {
            let (a, b) = (place(n), place(n) + Vec3::splat(0.2));
            let mut near = Vec::new();
            body.near(a, b, |t| near.push(t));
            near.sort_unstable();
            let all = (0..body.mesh.triangles.len() as u32).filter(|t| {
                let [p, q, r] = body.corners(*t);
                p.min(q).min(r).cmple(b).all() && p.max(q).max(r).cmpge(a).all()
            });
            assert_eq!(near, all.collect::<Vec<_>>());
        }
    }

    #[test]
    fn a_mesh_that_does_not_check_grows_no_tree() {
        let mut mesh = builtin("plane").unwrap();
        mesh.triangles.push([0, 1, 1_000_000]);
        let error = Body::new(Arc::new(mesh)).unwrap_err().to_string();
        assert!(error.contains("allowed"), "{error}");
    }
}
