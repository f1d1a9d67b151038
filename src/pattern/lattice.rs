//! Streak noise: value noise on a lattice stretched along the grooves, each row of cells shifted by a random amount so
//! that streaks begin and end independently. It closes exactly over the edges of a surface that repeats.

use crate::map::Wrap;
use crate::math::floor_fast;
use glam::Vec2;

/// Variance of one octave of smoothly interpolated uniform noise in [-1, 1]: 1/3 (uniform) times 0.743² (two cubic blends).
pub(super) const OCTAVE_VARIANCE: f32 = 0.184;

/// What an endless axis is folded by: further than any lattice coordinate reaches. No surface has more cells than that.
const ENDLESS: i32 = 1 << 30;
/// Cells across a surface at the most: coordinates stay whole numbers to the last in f32.
const ACROSS_MAX: f32 = (1 << 21) as f32;
/// Cells along a surface at the most: with [`WINDINGS_MAX`], products of cell numbers stay below 2^31.
const ALONG_MAX: f32 = (1 << 17) as f32;
/// How often a row of cells may wind around the surface before it closes.
const WINDINGS_MAX: u32 = 64;
/// How far rows are turned at the most to close after fewer windings, radians.
const TURN_MAX: f32 = 0.004;

/// Cells over a plane (a, b): the lattice coordinates of a point are (along · p, across · p). Coordinates that differ by a
/// period of the surface fall on cells with the same random numbers.
#[derive(Clone, Copy, Debug)]
pub(super) struct Lattice {
    along: Vec2,
    across: Vec2,
    /// Cells repeat under (cells_along, 0) and (skew, cells_across).
    cells_along: i32,
    cells_across: i32,
    skew: i32,
    seed: u32,
}

impl Lattice {
    /// Cells of `length` along `direction` (a unit vector) and of `width` across it, in the units of the plane. Its periods
    /// are `extent`'s, as far as `wrap` says so. On a plane that repeats, the cells are turned and stretched by the least that
    /// makes them close: a whole number of cells over each period.
    ///
    /// `twist` is how much lower one turn along a comes back, as on the thread of a screw: the period is (extent.x, -twist).
    pub(super) fn new(
        direction: Vec2,
        length: f32,
        width: f32,
        extent: Vec2,
        twist: f32,
        wrap: Wrap,
        seed: u32,
    ) -> Self {
        // Cells finer than that are far under any texel: make them as fine as can be.
        let span = extent.x + extent.y + twist.abs();
        let (length, width) = (length.max(span / ALONG_MAX), width.max(span / ACROSS_MAX));
        let along = direction / length;
        let across = direction.perp() / width;
        // Column by column: how many cells one period of the plane spans.
        let mut u = [along, across].map(|row| row.dot(Vec2::new(extent.x, -twist)));
        let mut v = [along.y * extent.y, across.y * extent.y];
        if wrap.repeats_u() && wrap.repeats_v() {
            (u[1], v[1]) = closing(u[1], v[1]);
        }
        if wrap.repeats_u() {
            u = u.map(f32::round);
        }
        if wrap.repeats_v() {
            v = v.map(f32::round);
        }
        // A period must span at least one cell, or the noise would be constant along it.
        if wrap.repeats_u() && u == [0.0, 0.0] {
            u[usize::from(direction.x.abs() < direction.y.abs())] = 1.0;
        }
        if wrap.repeats_v() && v == [0.0, 0.0] {
            v[usize::from(direction.x.abs() >= direction.y.abs())] = 1.0;
        }
        if wrap.repeats_u() && wrap.repeats_v() && u[0] * v[1] == u[1] * v[0] {
            // Rounding made both periods parallel: one more cell along parts them.
            if u[1] == 0.0 {
                v[1] += 1.0;
            } else {
                v[0] += 1.0;
            }
            if u[0] * v[1] == u[1] * v[0] {
                u[0] += 1.0;
            }
        }
        let lean = twist / extent.y;
        let row = |n: usize| Vec2::new(u[n] + lean * v[n], v[n]) / extent;
        let lattice = Self {
            along: row(0),
            across: row(1),
            cells_along: ENDLESS,
            cells_across: ENDLESS,
            skew: 0,
            seed,
        };
        match (wrap.repeats_u(), wrap.repeats_v()) {
            (true, true) => lattice.folded_by(whole(u), whole(v)),
            (true, false) => lattice.folded_by(whole(u), [0, 0]),
            (false, _) => lattice,
        }
    }

    /// Makes cells repeat under two whole vectors (either may be zero): their sublattice in Hermite normal form.
    fn folded_by(mut self, mut p: [i64; 2], mut q: [i64; 2]) -> Self {
        // Euclid on the second components, until only q has one.
        while p[1] != 0 {
            let times = q[1].div_euclid(p[1]);
            (p, q) = ([q[0] - times * p[0], q[1] - times * p[1]], p);
        }
        if q[1] < 0 {
            q = [-q[0], -q[1]];
        }
        if p[0] != 0 {
            self.cells_along = whole_cells(p[0].abs());
        }
        if q[1] != 0 {
            self.cells_across = whole_cells(q[1]);
            self.skew = whole_cells(if p[0] == 0 {
                q[0]
            } else {
                q[0].rem_euclid(p[0].abs())
            });
        } else if q[0] != 0 {
            self.cells_along = whole_cells(q[0].abs());
        }
        self
    }

    /// How many cells a step of the plane covers, along and across.
    pub(super) fn cells(&self, step: Vec2) -> Vec2 {
        Vec2::new(self.along.dot(step), self.across.dot(step)).abs()
    }

    /// Two independent noises in [-1, 1] at (a, b).
    #[inline(always)]
    pub(super) fn noise(&self, a: f32, b: f32) -> (f32, f32) {
        let s = self.along.x * a + self.along.y * b;
        let t = self.across.x * a + self.across.y * b;
        let j = floor_fast(t);
        let f = ease(t - j);
        let (lower, upper) = (self.row(s, j), self.row(s, j + 1.0));
        (
            lower.0 + (upper.0 - lower.0) * f,
            lower.1 + (upper.1 - lower.1) * f,
        )
    }

    /// The noise along row `j` of cells.
    #[inline(always)]
    fn row(&self, s: f32, j: f32) -> (f32, f32) {
        let (j, turns) = fold(to_int(j), self.cells_across);
        let row = hash(j as u32, self.seed);
        let x = s + unit(row >> 8);
        let i = floor_fast(x);
        let f = ease(x - i);
        // After the fraction is taken: the skew may be large, and whole numbers stay exact.
        let i = to_int(i).wrapping_sub(turns.wrapping_mul(self.skew));
        let (p, q) = (self.cell(i, row), self.cell(i.wrapping_add(1), row));
        (p.0 + (q.0 - p.0) * f, p.1 + (q.1 - p.1) * f)
    }

    /// The two random numbers of a cell, in [-1, 1).
    #[inline(always)]
    fn cell(&self, i: i32, row: u32) -> (f32, f32) {
        let h = hash(fold(i, self.cells_along).0 as u32, row);
        let half = |bits: u32| bits as i32 as f32 * (2.0 / 65_536.0) - 1.0;
        (half(h >> 16), half(h & 0xffff))
    }
}

/// `i` modulo `n`, and how many times `n` went into it; for quotients of a few hundred. Branch-free.
#[inline(always)]
fn fold(i: i32, n: i32) -> (i32, i32) {
    let turns = to_int(floor_fast(i as f32 * (1.0 / n as f32)));
    let r = i.wrapping_sub(turns.wrapping_mul(n));
    // The quotient is rounded: it may be one off.
    let low = i32::from(r < 0);
    let high = i32::from(r >= n);
    (
        r.wrapping_add((low - high).wrapping_mul(n)),
        turns - low + high,
    )
}

/// A count of cells, which [`Lattice::new`] keeps within range.
fn whole_cells(n: i64) -> i32 {
    i32::try_from(n.clamp(-i64::from(ENDLESS), i64::from(ENDLESS))).expect("clamped")
}

/// Whole numbers of rows over the two periods, near `u` and `v`, with a large common factor: rows that are told apart by their
/// number modulo that factor. Without one, a slanting row would wind over the whole surface and be every other row as well,
/// and all would begin their cells at the same places.
fn closing(u: f32, v: f32) -> (f32, f32) {
    let (large, small) = if u.abs() > v.abs() { (u, v) } else { (v, u) };
    let windings = (1..=WINDINGS_MAX)
        .map(|q| q as f32)
        .take_while(|q| 4.0 * q <= large.abs());
    let near = windings
        .map(|q| (q, (q * small / large).round()))
        .find(|(q, p)| ((p / q).atan() - (small / large).atan()).abs() < TURN_MAX);
    let (large, small) = match near {
        Some((q, p)) => {
            let factor = (large / q).round();
            (factor * q, factor * p)
        }
        None => (large.round(), small.round()),
    };
    if u.abs() > v.abs() {
        (large, small)
    } else {
        (small, large)
    }
}

fn whole(v: [f32; 2]) -> [i64; 2] {
    v.map(|x| x as i64)
}

/// A cubic blend weight.
#[inline(always)]
fn ease(f: f32) -> f32 {
    f * f * (3.0 - 2.0 * f)
}

/// A whole f32 as an integer, for |x| < 2^22; vectorises everywhere, which a saturating cast does not.
#[inline(always)]
fn to_int(x: f32) -> i32 {
    const SHIFT: f32 = 12_582_912.0;
    (x + SHIFT).to_bits().wrapping_sub(SHIFT.to_bits()) as i32
}

/// 24 random bits to [0, 1).
#[inline(always)]
pub(crate) fn unit(bits: u32) -> f32 {
    (bits & 0x00ff_ffff) as i32 as f32 * (1.0 / 16_777_216.0)
}

/// An integer hash with full avalanche (the two-multiply "lowbias32" of Chris Wellons, with the seed added between).
#[inline(always)]
pub(crate) fn hash(x: u32, seed: u32) -> u32 {
    let mut h = x.wrapping_mul(0x9e37_79b1) ^ seed;
    h ^= h >> 16;
    h = h.wrapping_mul(0x7feb_352d);
    h ^= h >> 15;
    h = h.wrapping_mul(0x846c_a68b);
    h ^ (h >> 16)
}

/// A 32-bit seed out of a 64-bit one and a number that tells uses apart.
pub(crate) fn seed32(seed: u64, purpose: u32) -> u32 {
    hash(
        seed as u32,
        hash((seed >> 32) as u32, hash(purpose, 0x616e_6973)),
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn noise_closes_over_the_edges(
            degrees in 0.0f32..180.0, length in 0.02f32..3.0, width in 0.004f32..0.3, aspect in 0.3f32..4.0,
            a in 0.0f32..1.0, b in 0.0f32..1.0, seed: u32,
        ) {
            let extent = Vec2::new(aspect, 1.0);
            let d = Vec2::from_angle(degrees.to_radians());
            let p = Vec2::new(a, b) * extent;
            let both = Lattice::new(d, length, width, extent, 0.0, Wrap::Repeat, seed);
            let u_only = Lattice::new(d, length, width, extent, 0.0, Wrap::RepeatU, seed);
            let near = |l: &Lattice, q: Vec2| {
                let (x, y) = (l.noise(p.x, p.y), l.noise(q.x, q.y));
                // A cell is at least 0.004 wide and 0.02 long: f32 positions leave about 1e-3 of it.
                (x.0 - y.0).abs() < 0.03 && (x.1 - y.1).abs() < 0.03
            };
            prop_assert!(near(&both, p + Vec2::new(aspect, 0.0)));
            prop_assert!(near(&both, p - Vec2::new(0.0, 1.0)));
            prop_assert!(near(&both, p + Vec2::new(-aspect, 1.0)));
            prop_assert!(near(&u_only, p + Vec2::new(aspect, 0.0)));
        }
    }

    #[test]
    fn the_finest_cells_close_too() {
        // So many cells that f32 positions cannot tell their corners: the cells' own numbers are compared.
        let l = Lattice::new(
            Vec2::from_angle(0.576),
            7.5e-4,
            7.5e-5,
            Vec2::ONE,
            0.0,
            Wrap::Repeat,
            3,
        );
        assert!(
            l.cells_along > 1 << 12 && l.cells_across > 30,
            "{} {}",
            l.cells_along,
            l.cells_across
        );
        let periods = [Vec2::X, Vec2::Y, Vec2::ONE];
        for (n, period) in periods.iter().cycle().take(300).enumerate() {
            let (i, j) = (7 * n as i32 - 900, 1000 - 13 * n as i32);
            let step = Vec2::new(l.along.dot(*period).round(), l.across.dot(*period).round());
            let at = |i: i32, j: i32| {
                let (row, turns) = fold(j, l.cells_across);
                let row = hash(row as u32, l.seed);
                (row, l.cell(i.wrapping_sub(turns.wrapping_mul(l.skew)), row))
            };
            assert!(
                at(i, j) == at(i + step.x as i32, j + step.y as i32),
                "{period} at {i}, {j}"
            );
        }
    }

    #[test]
    fn a_twisted_plane_closes_one_turn_lower() {
        let pitch = 0.07;
        let l = Lattice::new(Vec2::X, 0.3, 0.02, Vec2::ONE, pitch, Wrap::RepeatU, 3);
        for i in 0..100 {
            let (a, b) = (0.0131 * i as f32, 0.5 + 0.0037 * i as f32);
            let (p, q) = (l.noise(a, b), l.noise(a + 1.0, b - pitch));
            assert!((p.0 - q.0).abs() < 0.01 && (p.1 - q.1).abs() < 0.01, "{i}");
        }
    }

    #[test]
    fn an_octave_has_the_variance_it_states_and_two_independent_halves() {
        let l = Lattice::new(Vec2::X, 0.1, 0.01, Vec2::ONE, 0.0, Wrap::Repeat, 7);
        let n = 400;
        let mut sums = [0.0f64; 5];
        for y in 0..n {
            for x in 0..n {
                let (p, q) = l.noise((x as f32 + 0.5) / n as f32, (y as f32 + 0.5) / n as f32);
                let (p, q) = (f64::from(p), f64::from(q));
                for (sum, term) in sums.iter_mut().zip([p, q, p * p, q * q, p * q]) {
                    *sum += term / f64::from(n * n);
                }
            }
        }
        let want = f64::from(OCTAVE_VARIANCE);
        assert!(sums[0].abs() < 0.05 && sums[1].abs() < 0.05);
        assert!(
            (sums[2] / want - 1.0).abs() < 0.12 && (sums[3] / want - 1.0).abs() < 0.12,
            "{sums:?}"
        );
        assert!(sums[4].abs() < 0.02);
    }

    #[test]
    fn the_cells_stay_close_to_the_direction_asked_for() {
        for degrees in [0.0f32, 10.0, 33.0, 90.0, 135.0] {
            let d = Vec2::from_angle(degrees.to_radians());
            let l = Lattice::new(d, 0.5, 0.005, Vec2::new(1.5, 1.0), 0.0, Wrap::Repeat, 1);
            let along = l.across.perp().normalize();
            assert!(
                along.dot(d).abs() > 0.5f32.to_radians().cos(),
                "{degrees}: {along}"
            );
        }
    }
}
