//! Where the labels of a crowd of points go, so that none lies over another, over a point, or over another's leader line.
//!
//! Points are served one after the other: each takes the cheapest free place on rings around it, near ones first. A label that
//! does not touch its point gets a leader line. In the order of their importance, since the first ones choose.

/// A box with its sides along the axes: left, top, right, bottom.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Rect {
    pub(super) left: f64,
    pub(super) top: f64,
    pub(super) right: f64,
    pub(super) bottom: f64,
}

type Place = (f64, f64);

impl Rect {
    fn around((x, y): Place, (width, height): (f64, f64)) -> Self {
        Self {
            left: x - 0.5 * width,
            top: y - 0.5 * height,
            right: x + 0.5 * width,
            bottom: y + 0.5 * height,
        }
    }

    fn grown(self, by: f64) -> Self {
        Self {
            left: self.left - by,
            top: self.top - by,
            right: self.right + by,
            bottom: self.bottom + by,
        }
    }

    pub(super) fn meets(self, other: Self) -> bool {
        self.left < other.right
            && other.left < self.right
            && self.top < other.bottom
            && other.top < self.bottom
    }

    fn holds(self, other: Self) -> bool {
        self.left <= other.left
            && self.top <= other.top
            && self.right >= other.right
            && self.bottom >= other.bottom
    }

    /// The place in it that is nearest to another.
    fn nearest(self, (x, y): Place) -> Place {
        (
            x.clamp(self.left, self.right),
            y.clamp(self.top, self.bottom),
        )
    }

    /// Whether a line from `a` to `b` passes through it (Liang and Barsky).
    pub(super) fn is_crossed(self, a: Place, b: Place) -> bool {
        let (dx, dy) = (b.0 - a.0, b.1 - a.1);
        let (mut from, mut to) = (0.0f64, 1.0f64);
        for (p, q) in [
            (-dx, a.0 - self.left),
            (dx, self.right - a.0),
            (-dy, a.1 - self.top),
            (dy, self.bottom - a.1),
        ] {
            if p == 0.0 {
                if q <= 0.0 {
                    return false;
                }
            } else if p < 0.0 {
                from = from.max(q / p);
            } else {
                to = to.min(q / p);
            }
        }
        from < to
    }
}

/// Whether the lines from `a` to `b` and from `c` to `d` cross.
fn cross(a: Place, b: Place, c: Place, d: Place) -> bool {
    let side = |p: Place, q: Place, r: Place| (q.0 - p.0) * (r.1 - p.1) - (q.1 - p.1) * (r.0 - p.0);
    side(a, b, c) * side(a, b, d) < 0.0 && side(c, d, a) * side(c, d, b) < 0.0
}

/// A label that is wanted.
#[derive(Clone, Copy, Debug)]
pub(super) struct Wanted {
    /// The point that it names.
    pub(super) at: Place,
    /// Width and height of its text.
    pub(super) size: (f64, f64),
}

/// Where a label is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Placed {
    /// Its box.
    pub(super) text: Rect,
    /// From its point to its box, where they are apart.
    pub(super) leader: Option<(Place, Place)>,
}

impl Placed {
    /// How far it is from its point; 0 where it needs no leader line.
    pub(super) fn reach(&self) -> f64 {
        self.leader
            .map_or(0.0, |(a, b)| (b.0 - a.0).hypot(b.1 - a.1))
    }
}

/// What labels must keep clear of.
#[derive(Clone, Copy, Debug)]
pub(super) struct Obstacles<'a> {
    /// They stay inside.
    pub(super) area: Rect,
    /// Half the side of a point's marker.
    pub(super) marker: f64,
    /// All points, labelled or not.
    pub(super) points: &'a [Place],
    /// A line that labels would rather not cover.
    pub(super) line: &'a [Place],
}

/// Distances between marker and label; past the third a leader line is needed.
const RINGS: [f64; 22] = [
    1.0, 3.0, 5.0, 9.0, 13.0, 18.0, 24.0, 31.0, 39.0, 48.0, 58.0, 70.0, 84.0, 100.0, 120.0, 140.0,
    165.0, 190.0, 220.0, 260.0, 310.0, 370.0,
];
const TOUCHING: f64 = 5.0;
/// Room around a label.
const GAP: f64 = 1.5;

/// Labels whose points are nearer to each other than this share their room.
const CROWD: f64 = 60.0;
/// How often a crowd is sent farther out before a label is given up.
const ATTEMPTS: usize = 40;

/// Places the labels; `None` where there is no room at all.
///
/// Near places go to those who come first, and in a crowd they close the way for the others' leader lines. Then everybody
/// around the one that found no place starts one ring farther out, where more labels fit side by side, and all are placed
/// anew.
pub(super) fn place(wanted: &[Wanted], around: Obstacles<'_>) -> Vec<Option<Placed>> {
    let mut innermost = vec![0; wanted.len()];
    let mut best = Vec::new();
    for _ in 0..ATTEMPTS {
        let placed = attempt(wanted, &innermost, around);
        let lost = placed.iter().position(Option::is_none);
        if best.is_empty() || count(&placed) > count(&best) {
            best = placed;
        }
        let Some(lost) = lost else { break };
        for (other, ring) in wanted.iter().zip(&mut innermost) {
            let apart = (other.at.0 - wanted[lost].at.0).hypot(other.at.1 - wanted[lost].at.1);
            if apart < CROWD && *ring + 1 < RINGS.len() {
                *ring += 1;
            }
        }
    }
    best
}

fn count(placed: &[Option<Placed>]) -> usize {
    placed.iter().flatten().count()
}

/// Places each label in turn on its innermost ring or beyond.
fn attempt(wanted: &[Wanted], innermost: &[usize], around: Obstacles<'_>) -> Vec<Option<Placed>> {
    let mut placed: Vec<Placed> = Vec::new();
    wanted
        .iter()
        .zip(innermost)
        .map(|(wanted, &innermost)| {
            if !(wanted.at.0.is_finite() && wanted.at.1.is_finite()) {
                return None;
            }
            let outward = outward(wanted.at, around.points);
            let best = candidates(*wanted, around.marker, innermost, outward)
                .filter(|(label, _)| is_free(*label, &placed, around))
                .map(|(label, cost)| (label, cost + bother(label, wanted.at, &placed, around)))
                .min_by(|a, b| a.1.total_cmp(&b.1))
                .map(|(label, _)| label);
            placed.extend(best);
            best
        })
        .collect()
}

/// Every place on the rings, with the cost of being there: `outward` is where the label had best go.
fn candidates(
    wanted: Wanted,
    marker: f64,
    innermost: usize,
    outward: Place,
) -> impl Iterator<Item = (Placed, f64)> {
    let Wanted { at, size } = wanted;
    RINGS.into_iter().skip(innermost).flat_map(move |ring| {
        let directions = 24 + ring as usize;
        (0..directions).map(move |i| {
            let turn = std::f64::consts::TAU * i as f64 / directions as f64;
            let (dx, dy) = (turn.cos(), -turn.sin());
            // On a box around the point, so that wide labels are as near above as beside.
            let (half_width, half_height) =
                (0.5 * size.0 + marker + ring, 0.5 * size.1 + marker + ring);
            let reach = (half_width / dx.abs().max(1e-9)).min(half_height / dy.abs().max(1e-9));
            let text = Rect::around((at.0 + dx * reach, at.1 + dy * reach), size);
            let leader = (ring > TOUCHING).then(|| (at, text.nearest(at)));
            // To the right and upward reads best, where nothing else counts.
            let taste = 1.0 - 0.6 * dx + 0.4 * dy - dx * outward.0 - dy * outward.1;
            (Placed { text, leader }, ring + 2.0 * taste)
        })
    })
}

/// Away from the other points of its crowd: 0 for a point on its own, of length 8 at a crowd's edge.
fn outward(at: Place, points: &[Place]) -> Place {
    let (mut x, mut y, mut all) = (0.0, 0.0, 0.0);
    for p in points {
        let (dx, dy) = (at.0 - p.0, at.1 - p.1);
        let distance = dx.hypot(dy);
        if distance > 0.0 && distance < CROWD {
            let weight = 1.0 - distance / CROWD;
            x += weight * dx / distance;
            y += weight * dy / distance;
            all += weight;
        }
    }
    let scale = 8.0 / f64::max(all, 1.0);
    (x * scale, y * scale)
}

fn is_free(label: Placed, placed: &[Placed], around: Obstacles<'_>) -> bool {
    let room = label.text.grown(GAP);
    let marker = |p: &Place| Rect::around(*p, (2.0 * around.marker, 2.0 * around.marker));
    around.area.holds(label.text)
        && !around.points.iter().any(|p| room.meets(marker(p)))
        && placed.iter().all(|other| {
            let crossed = |room: Rect, leader: Option<(Place, Place)>| {
                leader.is_some_and(|(a, b)| room.is_crossed(a, b))
            };
            !room.meets(other.text)
                && !crossed(room, other.leader)
                && !crossed(other.text.grown(GAP), label.leader)
        })
}

/// What a free place spoils: the line that it covers, points and leader lines that its own passes over.
fn bother(label: Placed, own: Place, placed: &[Placed], around: Obstacles<'_>) -> f64 {
    let covered = around
        .line
        .windows(2)
        .filter(|w| label.text.is_crossed(w[0], w[1]))
        .count();
    let Some((a, b)) = label.leader else {
        return 12.0 * covered as f64;
    };
    let near = |p: &&Place| **p != own && Rect::around(**p, (4.0, 4.0)).is_crossed(a, b);
    let passed = around.points.iter().filter(near).count();
    let crossed = placed
        .iter()
        .filter(|other| other.leader.is_some_and(|(c, d)| cross(a, b, c, d)))
        .count();
    12.0 * covered as f64 + 9.0 * passed as f64 + 30.0 * crossed as f64
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const AREA: Rect = Rect {
        left: 0.0,
        top: 0.0,
        right: 620.0,
        bottom: 380.0,
    };

    fn check(points: &[Place], width: f64) -> usize {
        let wanted: Vec<Wanted> = points
            .iter()
            .map(|at| Wanted {
                at: *at,
                size: (width, 12.0),
            })
            .collect();
        let around = Obstacles {
            area: AREA,
            marker: 4.0,
            points,
            line: points,
        };
        let placed = place(&wanted, around);
        for (i, a) in placed.iter().enumerate() {
            let Some(a) = a else { continue };
            assert!(AREA.holds(a.text));
            let marker = |p: Place| Rect::around(p, (8.0, 8.0));
            assert!(points.iter().all(|p| !a.text.meets(marker(*p))));
            for b in placed[i + 1..].iter().flatten() {
                assert!(!a.text.meets(b.text), "{a:?} {b:?}");
                for (one, other) in [(a, b), (b, a)] {
                    if let Some((from, to)) = one.leader {
                        assert!(!other.text.is_crossed(from, to), "{one:?} {other:?}");
                    }
                }
            }
        }
        placed.iter().flatten().count()
    }

    #[test]
    fn a_crowd_in_one_place_is_labelled_without_overlap() {
        let crowd: Vec<Place> = (0..40)
            .map(|i| (300.0 + f64::from(i % 8) * 2.0, 200.0 + f64::from(i / 8)))
            .collect();
        assert_eq!(check(&crowd, 16.0), 40);
        let same = [(310.0, 190.0); 24];
        assert_eq!(check(&same, 16.0), 24);
    }

    #[test]
    fn what_has_no_room_has_no_label() {
        assert_eq!(check(&[(300.0, 200.0)], 700.0), 0);
        assert_eq!(check(&[(f64::NAN, 200.0), (10.0, 10.0)], 20.0), 1);
    }

    #[test]
    fn lines_and_boxes_meet_where_they_do() {
        let r = AREA;
        assert!(r.is_crossed((-10.0, 10.0), (10.0, -5.0)));
        assert!(r.is_crossed((10.0, 10.0), (20.0, 20.0)));
        assert!(!r.is_crossed((-10.0, 10.0), (5.0, -50.0)));
        assert!(!r.is_crossed((-5.0, 0.0), (-5.0, 100.0)));
        assert!(cross((0.0, 0.0), (2.0, 2.0), (0.0, 2.0), (2.0, 0.0)));
        assert!(!cross((0.0, 0.0), (1.0, 1.0), (2.0, 0.0), (3.0, 1.0)));
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(12))]
        #[test]
        fn no_crowd_makes_labels_overlap(points in prop::collection::vec((0.0f64..620.0, 0.0f64..380.0), 1..60), width in 10.0f64..150.0) {
            check(&points, width);
        }
    }
}
