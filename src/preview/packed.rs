//! The loops of shading over packed fragments, [`CHUNK`] of them at a time: arrays of one number each that stay in the first
//! cache, and no branch, so that every CPU level compiles them to its widest vectors and gives the same bits.

use crate::brdf::kernel;
use crate::filter::{Pyramid, Room};
use crate::map::{ALPHA_MAX, ALPHA_MIN, Texel};
use crate::math::{self, AXIS_MIN_LENGTH, Axis, choose};
use crate::raster::{self, Lanes, Rays};
use fearless_simd::{Simd, dispatch};
use fearless_simd_macros::simd;
use glam::Vec2;
use std::f32::consts::FRAC_1_PI;

/// Fragments that are worked on at once.
pub(super) const CHUNK: usize = 256;
/// One number of each.
pub(super) type Lane = [f32; CHUNK];

/// The least cosine between normal and view of a fragment that is seen.
const GRAZING_MIN: f32 = 1e-4;
/// The most that the change of the normal over the sample may raise it to: triangles seen edge-on change without bound.
const GRAZING_MAX: f32 = 0.2;
/// The most variance that curvature may add: 0.18 of alpha², as Tokuyoshi and Kaplanyan (2019) limit it.
const CURVATURE_MAX: f32 = 0.09;

/// A chunk on its way from fragments to light.
pub(super) struct Chunk {
    position: [Lane; 3],
    /// Tangent, bitangent, and the normal of the side that is seen.
    frame: [[Lane; 3]; 3],
    /// 1 where the mesh gives a tangent, else 0.
    usable: Lane,
    /// 1/q where attributes are to be divided by it.
    inverse: Lane,
    /// Texture coordinate, v up, and its change to the right and downward.
    uv: [Lane; 2],
    uv_change: [[Lane; 2]; 2],
    /// The unit vector to the viewer in the frame.
    pub(super) view: [Lane; 3],
    /// 1/distance to the nearest lamp; 0 without one.
    closeness: Lane,
    /// The variance of the half vector inside a sample, in the tangent frame: uu, uv, vv.
    bend: [Lane; 3],
    /// alpha_x, alpha_y, cos 2θ, sin 2θ: blended, not yet of unit length.
    pub(super) texel: [Lane; 4],
    room: Room,
    /// How different the lobes under the footprint are, see [`Pyramid::varieties`]; infinite where it is to be sampled anyway.
    variety: Lane,
    /// The share of the specular light that the lobe stands for.
    pub(super) share: Lane,
    /// The prepared lobe.
    pub(super) lobe: [Lane; 4],
    /// The unit vector to a light in the frame, and the share of its irradiance that arrives.
    pub(super) light: [Lane; 3],
    falloff: Lane,
    /// f_r n.l of that light.
    pub(super) reflected: Lane,
    /// Light toward the viewer so far: red, green, blue.
    pub(super) radiance: [Lane; 3],
}

/// The fragments of a chunk: up to [`CHUNK`] of those of a tile.
#[derive(Clone, Copy)]
pub(super) struct Given<'a> {
    pub(super) lanes: &'a Lanes,
    pub(super) rays: &'a Rays,
    pub(super) start: usize,
    pub(super) count: usize,
}

impl<'a> Given<'a> {
    #[inline(always)]
    fn of(&self, lane: &'a raster::Lane) -> &'a [f32] {
        &lane[self.start..][..self.count.min(CHUNK)]
    }

    #[inline(always)]
    fn of2(&self, lanes: &'a [raster::Lane; 2]) -> [&'a [f32]; 2] {
        [self.of(&lanes[0]), self.of(&lanes[1])]
    }

    #[inline(always)]
    fn of3(&self, lanes: &'a [raster::Lane; 3]) -> [&'a [f32]; 3] {
        [self.of(&lanes[0]), self.of(&lanes[1]), self.of(&lanes[2])]
    }
}

impl Chunk {
    pub(super) fn new() -> Self {
        let zero = [0.0; CHUNK];
        Self {
            position: [zero; 3],
            frame: [[zero; 3]; 3],
            usable: zero,
            inverse: zero,
            uv: [zero; 2],
            uv_change: [[zero; 2]; 2],
            view: [zero; 3],
            closeness: zero,
            bend: [zero; 3],
            texel: [zero; 4],
            room: Room::new(),
            variety: zero,
            share: [1.0; CHUNK],
            lobe: [zero; 4],
            light: [zero; 3],
            falloff: [1.0; CHUNK],
            reflected: zero,
            radiance: [zero; 3],
        }
    }
}

#[inline(always)]
fn dot(a: [f32; 3], b: [f32; 3]) -> f32 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

#[inline(always)]
fn scaled(a: [f32; 3], f: f32) -> [f32; 3] {
    [a[0] * f, a[1] * f, a[2] * f]
}

#[inline(always)]
fn cross(a: [f32; 3], b: [f32; 3]) -> [f32; 3] {
    [
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    ]
}

#[inline(always)]
fn get(lanes: &[Lane; 3], i: usize) -> [f32; 3] {
    [lanes[0][i], lanes[1][i], lanes[2][i]]
}

#[inline(always)]
fn put(lanes: &mut [Lane; 3], i: usize, [x, y, z]: [f32; 3]) {
    lanes[0][i] = x;
    lanes[1][i] = y;
    lanes[2][i] = z;
}

#[inline(always)]
fn four(lanes: &[Lane; 4], i: usize) -> [f32; 4] {
    [lanes[0][i], lanes[1][i], lanes[2][i], lanes[3][i]]
}

#[inline(always)]
fn put4(lanes: &mut [Lane; 4], i: usize, [a, b, c, d]: [f32; 4]) {
    lanes[0][i] = a;
    lanes[1][i] = b;
    lanes[2][i] = c;
    lanes[3][i] = d;
}

/// The part of `a` at right angles to the unit vector `n`.
#[inline(always)]
fn beside(a: [f32; 3], n: [f32; 3]) -> [f32; 3] {
    let along = dot(n, a);
    [
        a[0] - n[0] * along,
        a[1] - n[1] * along,
        a[2] - n[2] * along,
    ]
}

#[inline(always)]
fn at_least(x: f32, low: f32) -> f32 {
    if x < low { low } else { x }
}

#[inline(always)]
fn at_most(x: f32, high: f32) -> f32 {
    if x > high { high } else { x }
}

/// Frame, view, position and texture coordinate of each fragment. The rules are those of [`Frame::new`](crate::math::Frame::new).
#[simd]
pub(super) fn frames<S: Simd>(_: S, chunk: &mut Chunk, given: Given<'_>) {
    let n = given.count.min(CHUNK);
    let (lanes, rays) = (given.lanes, given.rays);
    let (column, row, q) = (
        given.of(&lanes.column),
        given.of(&lanes.row),
        given.of(&lanes.q),
    );
    let (facing, hand) = (given.of(&lanes.facing), given.of(&lanes.hand));
    let (normal, tangent, uv) = (
        given.of3(&lanes.normal),
        given.of3(&lanes.tangent),
        given.of2(&lanes.uv),
    );
    let (right, up, back) = (
        rays.right.to_array(),
        rays.up.to_array(),
        rays.back.to_array(),
    );
    let eye = rays.eye.to_array();
    // One of each pair is 0, so that one loop serves both kinds of view.
    let (near, flat) = if rays.perspective {
        (1.0, 0.0)
    } else {
        (0.0, 1.0)
    };
    for i in 0..n {
        let (nx, ny, nz) = (normal[0][i], normal[1][i], normal[2][i]);
        let n = [nx, ny, nz];
        let n = scaled(n, 1.0 / dot(n, n).sqrt());
        let given = [tangent[0][i], tangent[1][i], tangent[2][i]];
        let t = beside(given, n);
        let (length, whole) = (dot(t, t).sqrt(), dot(given, given).sqrt());
        // A tangent closer to the normal than about 0.006 degrees has no digits left; NaN fails the test too.
        let usable = (length > 1e-4 * whole) & (length > 1e-18) & (length < 1e18);
        let t = scaled(t, 1.0 / length);
        // Any perpendicular instead (Duff et al. 2017): such a point is lit as isotropic.
        let sign = choose(n[2] < 0.0, -1.0, 1.0);
        let a = -1.0 / (sign + n[2]);
        let t = [
            choose(usable, t[0], 1.0 + sign * n[0] * n[0] * a),
            choose(usable, t[1], sign * n[0] * n[1] * a),
            choose(usable, t[2], -sign * n[0]),
        ];
        let b = scaled(cross(n, t), hand[i]);
        let n = scaled(n, facing[i]);
        let inverse = near / q[i] + flat;
        let distance = rays.unit * (near * inverse + flat * q[i]);
        let (x, y) = (
            (column[i] - rays.centre[0]) * rays.per_sample,
            (rays.centre[1] - row[i]) * rays.per_sample,
        );
        let aside = [
            right[0] * x + up[0] * y,
            right[1] * x + up[1] * y,
            right[2] * x + up[2] * y,
        ];
        let e = [
            back[0] - near * aside[0],
            back[1] - near * aside[1],
            back[2] - near * aside[2],
        ];
        let reach = near * distance + flat;
        let position = [
            eye[0] + (aside[0] * reach - back[0] * distance),
            eye[1] + (aside[1] * reach - back[1] * distance),
            eye[2] + (aside[2] * reach - back[2] * distance),
        ];
        let e = scaled(e, 1.0 / dot(e, e).sqrt());
        chunk.usable[i] = choose(usable, 1.0, 0.0);
        chunk.inverse[i] = inverse;
        chunk.uv[0][i] = uv[0][i] * inverse;
        chunk.uv[1][i] = uv[1][i] * inverse;
        put(&mut chunk.position, i, position);
        put(&mut chunk.frame[0], i, t);
        put(&mut chunk.frame[1], i, b);
        put(&mut chunk.frame[2], i, n);
        put(&mut chunk.view, i, [dot(e, t), dot(e, b), dot(e, n)]);
    }
}

/// The change of each fragment's texture coordinate.
#[simd]
pub(super) fn uv_changes<S: Simd>(_: S, chunk: &mut Chunk, given: Given<'_>) {
    for k in 0..2 {
        let change = given.of2(&given.lanes.uv_change[k]);
        let q = given.of(&given.lanes.q_change[k]);
        for c in 0..2 {
            let out = &mut chunk.uv_change[k][c];
            for i in 0..given.count.min(CHUNK) {
                out[i] = (change[c][i] - chunk.uv[c][i] * q[i]) * chunk.inverse[i];
            }
        }
    }
}

/// How a place is seen, in its frame.
struct Seen {
    /// The unit vector to the viewer.
    view: [f32; 3],
    /// World units between the lines of sight of two samples.
    apart: f32,
    /// 1/distance to the eye and to the nearest lamp; 0 for those that are far.
    nearness: f32,
    closeness: f32,
}

impl Seen {
    /// How the half vector turns from a sample to the next `to` a side of the picture, along tangent and bitangent.
    #[inline(always)]
    fn turned(&self, to: [f32; 3]) -> [f32; 2] {
        let v = self.view;
        let upright = 1.0 / v[2];
        let step = scaled(beside(to, v), self.apart);
        let deeper = step[2] * upright;
        let place = [
            step[0] - v[0] * deeper,
            step[1] - v[1] * deeper,
            step[2] - v[2] * deeper,
        ];
        let aside = beside(place, [-v[0], -v[1], v[2]]);
        let half = 0.5 * upright;
        [
            (step[0] * self.nearness + aside[0] * self.closeness) * half,
            (step[1] * self.nearness + aside[1] * self.closeness) * half,
        ]
    }
}

/// The bend of each fragment, and its view raised to what a sample at the outline shows on the mean.
///
/// From one sample to the next the normal turns; and the place moves, which turns v, and l toward a lamp, and with them H = l + v by
/// their sum over |H|. l is taken as at the peak of a highlight, where it mirrors v, so that one lobe serves all lights.
#[simd]
pub(super) fn bends<S: Simd>(_: S, chunk: &mut Chunk, given: Given<'_>, lamps: &[[f32; 3]]) {
    let n = given.count.min(CHUNK);
    chunk.closeness[..n].fill(0.0);
    for lamp in lamps {
        for i in 0..n {
            let p = get(&chunk.position, i);
            let d = [lamp[0] - p[0], lamp[1] - p[1], lamp[2] - p[2]];
            let inverse = 1.0 / at_least(dot(d, d), f32::MIN_POSITIVE).sqrt();
            chunk.closeness[i] = at_least(inverse, chunk.closeness[i]);
        }
    }
    let rays = given.rays;
    let (eye, back) = (rays.eye.to_array(), rays.back.to_array());
    let (right, down) = (rays.right.to_array(), (-rays.up).to_array());
    let (near, flat) = if rays.perspective {
        (1.0, 0.0)
    } else {
        (0.0, 1.0)
    };
    let normal = given.of3(&given.lanes.normal);
    let [dx, dy] = given.lanes.normal_change.each_ref().map(|d| given.of3(d));
    for i in 0..given.count.min(CHUNK) {
        let at = |lanes: [&[f32]; 3]| [lanes[0][i], lanes[1][i], lanes[2][i]];
        let normal = at(normal);
        let inverse = 1.0 / dot(normal, normal).sqrt();
        let (t, b) = (get(&chunk.frame[0], i), get(&chunk.frame[1], i));
        let n = get(&chunk.frame[2], i);
        let (dx, dy) = (bent(at(dx), inverse, n), bent(at(dy), inverse, n));
        let (tx, ty, bx, by) = (dot(t, dx), dot(t, dy), dot(b, dx), dot(b, dy));
        // The mean of |x| over an interval of width w around 0 is w / 4.
        let v = get(&chunk.view, i);
        let across = (v[0] * tx + v[1] * bx).abs() + (v[0] * ty + v[1] * by).abs();
        let grazing = at_most(at_least(0.25 * across, GRAZING_MIN), GRAZING_MAX);
        let v = [v[0], v[1], at_least(v[2], grazing)];
        let v = scaled(v, 1.0 / dot(v, v).sqrt());
        put(&mut chunk.view, i, v);
        let p = get(&chunk.position, i);
        let e = [eye[0] - p[0], eye[1] - p[1], eye[2] - p[2]];
        let nearness = near / at_least(dot(e, e), f32::MIN_POSITIVE).sqrt();
        let apart = rays.per_sample * (near * dot(e, back) + flat);
        let place = Seen {
            view: v,
            apart,
            nearness,
            closeness: chunk.closeness[i],
        };
        let across = place.turned([dot(right, t), dot(right, b), dot(right, n)]);
        let along = place.turned([dot(down, t), dot(down, b), dot(down, n)]);
        let (xu, xv) = (tx + across[0], bx + across[1]);
        let (yu, yv) = (ty + along[0], by + along[1]);
        let bend = [xu * xu + yu * yu, xu * xv + yu * yv, xv * xv + yv * yv];
        let trace = (bend[0] + bend[2]) * (1.0 / 12.0);
        // A lamp that touches the surface bends without bound.
        let finite = trace < f32::INFINITY;
        let bend = [
            choose(finite, bend[0], 0.0),
            choose(finite, bend[1], 0.0),
            choose(finite, bend[2], 0.0),
        ];
        let share = CURVATURE_MAX / at_least(trace, CURVATURE_MAX);
        put(&mut chunk.bend, i, scaled(bend, (1.0 / 12.0) * share));
    }
}

/// The change of the unit normal `n` at right angles to it; one that is not finite bends nothing.
#[inline(always)]
fn bent(change: [f32; 3], inverse: f32, n: [f32; 3]) -> [f32; 3] {
    let d = beside(scaled(change, inverse), n);
    let finite = dot(d, d) < f32::INFINITY;
    [
        choose(finite, d[0], 0.0),
        choose(finite, d[1], 0.0),
        choose(finite, d[2], 0.0),
    ]
}

/// Lobes from blended texels: a direction of unit length, none where the blend or the mesh has none, wider by the bend where
/// `widen` says so, and prepared for the kernels.
#[simd]
pub(super) fn lobes<S: Simd>(_: S, chunk: &mut Chunk, n: usize, widen: bool) {
    let n = n.min(CHUNK);
    if widen {
        for i in 0..n {
            let texel = settled(four(&chunk.texel, i), chunk.usable[i]);
            let [x, y, c, s] = widened(texel, get(&chunk.bend, i));
            let lobe = kernel::prepare(x, y, c, s);
            put4(&mut chunk.lobe, i, lobe);
        }
    } else {
        let mut any_odd = 0;
        for i in 0..n {
            let [x, y, cos2, sin2] = four(&chunk.texel, i);
            put4(&mut chunk.lobe, i, kernel::prepare_blend(x, y, cos2, sin2));
            any_odd |= u32::from(is_odd(cos2, sin2, chunk.usable[i]));
        }
        for i in 0..if any_odd == 0 { 0 } else { n } {
            let [x, y, cos2, sin2] = four(&chunk.texel, i);
            if is_odd(cos2, sin2, chunk.usable[i]) {
                let [x, y, c, s] = settled([x, y, cos2, sin2], chunk.usable[i]);
                put4(&mut chunk.lobe, i, kernel::prepare(x, y, c, s));
            }
        }
    }
}

/// Whether a blend or the mesh has no direction; few fragments are so.
#[inline(always)]
fn is_odd(cos2: f32, sin2: f32, usable: f32) -> bool {
    let directed = cos2 * cos2 + sin2 * sin2 >= AXIS_MIN_LENGTH * AXIS_MIN_LENGTH;
    !(directed & (usable > 0.5))
}

/// The same from one texel everywhere, not widened: a lobe where the mesh has a tangent, another where it has none.
#[simd]
pub(super) fn lobes_alike<S: Simd>(_: S, chunk: &mut Chunk, n: usize, texel: [f32; 4]) {
    let [x, y, c, s] = settled(texel, 1.0);
    let directed = kernel::prepare(x, y, c, s);
    let [x, y, c, s] = settled(texel, 0.0);
    let round = kernel::prepare(x, y, c, s);
    for k in 0..4 {
        let (directed, round) = (directed[k], round[k]);
        for i in 0..n.min(CHUNK) {
            chunk.lobe[k][i] = choose(chunk.usable[i] > 0.5, directed, round);
        }
    }
}

/// As [`settle`](crate::map::settle), and of the same variance in every direction where the mesh has no tangent.
#[inline(always)]
fn settled([x, y, cos2, sin2]: [f32; 4], usable: f32) -> [f32; 4] {
    let length = (cos2 * cos2 + sin2 * sin2).sqrt();
    let settled = length >= AXIS_MIN_LENGTH;
    let inverse = 1.0 / length;
    let area = (x * y).sqrt();
    let (x, y) = (choose(settled, x, area), choose(settled, y, area));
    let round = (0.5 * (x * x + y * y)).sqrt();
    let usable = usable > 0.5;
    let directed = settled & usable;
    [
        choose(usable, x, round),
        choose(usable, y, round),
        choose(directed, cos2 * inverse, 1.0),
        choose(directed, sin2 * inverse, 0.0),
    ]
}

/// The lobe with more variance of slope; see [`SlopeCovariance::to_texel`](crate::map::SlopeCovariance::to_texel).
#[inline(always)]
fn widened([x, y, c, s]: [f32; 4], by: [f32; 3]) -> [f32; 4] {
    let x_is_wide = x > y;
    let narrow = choose(x_is_wide, y, x);
    let (xx, yy) = (0.5 * x * x, 0.5 * y * y);
    let (mean, half) = (0.5 * (xx + yy), 0.5 * (xx - yy));
    let (uu, vv) = (mean + half * c + by[0], mean - half * c + by[2]);
    let uv = half * s + by[1];
    let (dx, dy) = (uu - vv, 2.0 * uv);
    let (length, trace) = ((dx * dx + dy * dy).sqrt(), uu + vv);
    let wide = 0.5 * (trace + length);
    // The small eigenvalue as determinant over the large one: no cancellation at ratios of 1000.
    let small = at_least(uu * vv - uv * uv, 0.0) / wide;
    let (wide, small) = (width(wide), width(small));
    let turned = length > 1e-6 * trace;
    let inverse = choose(x_is_wide, 1.0, -1.0) / length;
    // Under a thousandth of the variance it cannot be seen, and a ratio of 1000 would lose digits in the covariance.
    let unseen = by[0] + by[2] < 0.5e-3 * narrow * narrow;
    let kept = unseen | !turned;
    [
        choose(unseen, x, choose(x_is_wide, wide, small)),
        choose(unseen, y, choose(x_is_wide, small, wide)),
        choose(kept, c, dx * inverse),
        choose(kept, s, dy * inverse),
    ]
}

#[inline(always)]
fn width(variance: f32) -> f32 {
    at_most(at_least((2.0 * variance).sqrt(), ALPHA_MIN), ALPHA_MAX)
}

/// Light from one direction everywhere.
#[simd]
pub(super) fn toward_direction<S: Simd>(_: S, chunk: &mut Chunk, n: usize, toward: [f32; 3]) {
    for i in 0..n.min(CHUNK) {
        let t = dot(toward, get(&chunk.frame[0], i));
        let b = dot(toward, get(&chunk.frame[1], i));
        let n = dot(toward, get(&chunk.frame[2], i));
        put(&mut chunk.light, i, [t, b, n]);
        chunk.falloff[i] = 1.0;
    }
}

/// Light from a place; a fragment that stands there gets none, since the vector to it is 0.
#[simd]
pub(super) fn toward_place<S: Simd>(_: S, chunk: &mut Chunk, n: usize, place: [f32; 3]) {
    for i in 0..n.min(CHUNK) {
        let p = get(&chunk.position, i);
        let d = [place[0] - p[0], place[1] - p[1], place[2] - p[2]];
        let square = dot(d, d);
        let inverse = 1.0 / at_least(square, f32::MIN_POSITIVE).sqrt();
        let t = dot(d, get(&chunk.frame[0], i));
        let b = dot(d, get(&chunk.frame[1], i));
        let n = dot(d, get(&chunk.frame[2], i));
        put(&mut chunk.light, i, scaled([t, b, n], inverse));
        chunk.falloff[i] = choose(square > 1e-12, inverse * inverse, 1e12);
    }
}

/// Adds a light: `diffuse` and `specular` are its irradiance times the surface's colours. With `seen_only`, nothing where the
/// normal is bent away from the viewer.
#[simd]
pub(super) fn gather<S: Simd>(
    _: S,
    chunk: &mut Chunk,
    n: usize,
    (diffuse, specular): ([f32; 3], [f32; 3]),
    seen_only: bool,
) {
    let diffuse = scaled(diffuse, FRAC_1_PI);
    let least = if seen_only { 0.0 } else { -2.0 };
    for i in 0..n.min(CHUNK) {
        let lit = (chunk.light[2][i] > 0.0) & (chunk.view[2][i] > least);
        let cosine = choose(lit, chunk.light[2][i], 0.0) * chunk.falloff[i];
        let reflected = chunk.reflected[i] * chunk.falloff[i] * chunk.share[i];
        let light = get(&chunk.radiance, i);
        let light = [
            light[0] + (diffuse[0] * cosine + specular[0] * reflected),
            light[1] + (diffuse[1] * cosine + specular[1] * reflected),
            light[2] + (diffuse[2] * cosine + specular[2] * reflected),
        ];
        put(&mut chunk.radiance, i, light);
    }
}

/// The map at each fragment's texture coordinate.
pub(super) fn fetch(pyramid: &Pyramid<'_>, chunk: &mut Chunk, n: usize) {
    let [u, v] = &chunk.uv;
    let out = chunk.texel.each_mut().map(|c| &mut c[..n]);
    pyramid.fetch_plain(&mut chunk.room, &u[..n], &v[..n], out);
}

/// The map at texture coordinates as the loops that light pictures have it, in the mesh's tangent frame and without any bend of
/// the surface: with `widening` as [`Quality::widening`](super::Quality::widening) has it, where lobes are made by another loop.
pub(crate) fn texels_seen(pyramid: &Pyramid<'_>, uvs: &[Vec2], widening: bool) -> Vec<Texel> {
    let mut chunk = Chunk::new();
    chunk.usable = [1.0; CHUNK];
    let mut seen = Vec::new();
    for uvs in uvs.chunks(CHUNK) {
        let n = uvs.len();
        for (i, uv) in uvs.iter().enumerate() {
            [chunk.uv[0][i], chunk.uv[1][i]] = uv.to_array();
        }
        fetch(pyramid, &mut chunk, n);
        dispatch!(math::level(), simd => lobes(simd, &mut chunk, n, widening));
        seen.extend((0..n).map(|i| {
            let [c, s, rx, ry] = four(&chunk.lobe, i);
            Texel {
                alpha_x: 1.0 / rx,
                alpha_y: 1.0 / ry,
                axis: Axis {
                    cos2: c * c - s * s,
                    sin2: 2.0 * c * s,
                },
            }
        }));
    }
    seen
}

/// Footprints whose lobes differ less than this are told by any of them.
const ALIKE: f32 = 1.000_01;
/// Footprints whose lobes differ more are not told by one lobe, their mean. Measured on discs and pots of 4096 texels at 128
/// pixels with 4x4 samples: at 1.09 the pictures' FLIP from the truth is 1.3 to 4.3 times what sampling every footprint gives,
/// at 1.01 1.2 to 2 times, here 1 to 1.2.
const VARIED: f32 = 1.001;
/// Footprints up to so many texels long are sampled even where one lobe would tell them: taps are fetched in vectors, a mean is
/// not, and they are no less right (near views took 1.3 to 6 times as long with means, and up to twice the FLIP).
const SHORT: f32 = 8.0;

/// The mean of the map over each fragment's footprint where one lobe tells it and the footprint is long, in place of what
/// [`fetch`] found. Fragments whose footprint is to be sampled are marked; says whether there are any.
pub(super) fn average(pyramid: &Pyramid<'_>, chunk: &mut Chunk, n: usize) -> bool {
    let [u, v] = chunk.uv.each_ref().map(|c| &c[..n]);
    let change = chunk
        .uv_change
        .each_ref()
        .map(|d| d.each_ref().map(|c| &c[..n]));
    pyramid.varieties([u, v], change, &mut chunk.variety[..n]);
    let base = pyramid.base();
    let size = Vec2::new(base.width() as f32, base.height() as f32);
    let mut any = false;
    for i in 0..n {
        let variety = &mut chunk.variety[i];
        if *variety > ALIKE && *variety <= VARIED {
            let [dx, dy] = change.map(|[u, v]| Vec2::new(u[i], v[i]));
            if (dx * size).length_squared() + (dy * size).length_squared() <= SHORT * SHORT {
                *variety = f32::INFINITY;
            } else {
                let t = pyramid.sample(Vec2::new(u[i], v[i]), dx, dy);
                let texel = [t.alpha_x, t.alpha_y, t.axis.cos2, t.axis.sin2];
                put4(&mut chunk.texel, i, texel);
            }
        }
        any |= *variety > VARIED;
    }
    any
}

/// Sets what part of the light tap number `tap` of `taps` stands for: of a fragment that needs no taps, the first is all.
pub(super) fn share_taps(chunk: &mut Chunk, n: usize, tap: usize, taps: usize) {
    let (each, other) = (1.0 / taps as f32, if tap == 0 { 1.0 } else { 0.0 });
    for i in 0..n {
        chunk.share[i] = choose(chunk.variety[i] > VARIED, each, other);
    }
}

/// One of several places in the footprints of the fragments that [`average`] marked: the map there takes the place of what was
/// fetched.
pub(super) fn fetch_tap(pyramid: &Pyramid<'_>, chunk: &mut Chunk, n: usize, [x, y]: [f32; 2]) {
    let mut uv = [[0.0; CHUNK]; 2];
    for c in 0..2 {
        for i in 0..n {
            uv[c][i] =
                chunk.uv[c][i] + (chunk.uv_change[0][c][i] * x + chunk.uv_change[1][c][i] * y);
        }
    }
    let mut texels = [[0.0; CHUNK]; 4];
    let out = texels.each_mut().map(|c| &mut c[..n]);
    pyramid.fetch_plain(&mut chunk.room, &uv[0][..n], &uv[1][..n], out);
    for (old, new) in chunk.texel.iter_mut().zip(&texels) {
        for i in 0..n {
            old[i] = choose(chunk.variety[i] > VARIED, new[i], old[i]);
        }
    }
}
