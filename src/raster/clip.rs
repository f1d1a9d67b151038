//! Cutting a triangle to what fixed point can hold: the near plane and a guard band far outside the picture.

use super::camera::{Vertex, View};

/// Half the width of the guard band in samples, around the middle of the picture. Triangles inside it need no side clipping;
/// it is wider than half of the largest picture, and an edge that crosses a tile fits 32 bits there.
pub(super) const GUARD: f64 = 20_480.0;

/// A polygon of up to 3 + 5 corners.
#[derive(Clone, Copy)]
pub(super) struct Polygon {
    corners: [Vertex; 8],
    count: usize,
}

impl Polygon {
    fn new(triangle: [Vertex; 3]) -> Self {
        let mut corners = [triangle[0]; 8];
        corners[..3].copy_from_slice(&triangle);
        Self { corners, count: 3 }
    }

    pub(super) fn corners(&self) -> &[Vertex] {
        &self.corners[..self.count]
    }

    /// Keeps the part where `side` is not negative (Sutherland and Hodgman 1974).
    fn cut(&self, side: impl Fn(&Vertex) -> f64) -> Self {
        let mut kept = Self { count: 0, ..*self };
        let mut push = |v: Vertex| {
            if kept.count < kept.corners.len() {
                kept.corners[kept.count] = v;
                kept.count += 1;
            }
        };
        let corners = self.corners();
        for (i, a) in corners.iter().enumerate() {
            let b = &corners[(i + 1) % corners.len()];
            let (da, db) = (side(a), side(b));
            if da >= 0.0 {
                push(*a);
            }
            if (da >= 0.0) != (db >= 0.0) {
                // Always from the inner corner to the outer: the neighbour over this edge computes the same bits.
                let (inner, outer, di, d_o) = if da >= 0.0 {
                    (a, b, da, db)
                } else {
                    (b, a, db, da)
                };
                let t = di / (di - d_o);
                push(Vertex {
                    h: inner.h + (outer.h - inner.h) * t,
                    distance: inner.distance + (outer.distance - inner.distance) * t,
                });
            }
        }
        kept
    }
}

/// The part of a triangle that lies behind the near plane and in the guard band; `None` where nothing of it can be seen.
pub(super) fn clip(view: &View, triangle: [Vertex; 3]) -> Option<Polygon> {
    let (near, (cx, cy)) = (view.near(), view.centre());
    let planes: [&dyn Fn(&Vertex) -> f64; 5] = [
        &|v| v.distance - near,
        &|v| GUARD * v.h.z - (v.h.x - cx * v.h.z),
        &|v| GUARD * v.h.z + (v.h.x - cx * v.h.z),
        &|v| GUARD * v.h.z - (v.h.y - cy * v.h.z),
        &|v| GUARD * v.h.z + (v.h.y - cy * v.h.z),
    ];
    let mut polygon = Polygon::new(triangle);
    for side in planes {
        if polygon.corners().iter().all(|v| side(v) >= 0.0) {
            continue;
        }
        polygon = polygon.cut(side);
        if polygon.count < 3 {
            return None;
        }
    }
    Some(polygon)
}
