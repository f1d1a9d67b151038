//! A stroke while it is being made: each point costs what it touches, and what is seen is what the finished stroke gives.

use super::composite::{Planes, View, Work, apply};
use super::course::{Course, Plane, Space, origin, tiles_of};
use super::cover::Cover;
use super::laid::{Copies, Ground};
use super::skin::Skin;
use super::smooth::Kernel;
use super::stroke::Added;
use super::trail::{Node, Step, Trail, Vector};
use super::{Brush, MeshPoints, POINTS_MAX, Point, Points, Stroke, solid};
use crate::error::Result;
use crate::map::{Rect, Region};
use crate::pattern::Surface;
use glam::{IVec2, Vec2, Vec3};
use rayon::prelude::*;
use std::borrow::Cow;
use std::sync::Arc;

/// A stroke in the making.
///
/// Where the end of the path may still change, as that of one that is being steadied ([`super::path::Steady`]), its last points
/// are only *ahead*: those of the next call take their place, and the last ones are the stroke's end.
///
/// An editor keeps the texels as they were before the stroke. After each [`Live::push`] it calls [`Live::apply`] for the
/// rectangles that the push returned; all others stay as they are. [`Live::finish`] gives the stroke for the document.
pub struct Live {
    ground: Ground,
    brush: Arc<Brush>,
    seed: u32,
    path: Path,
}

/// A place on a mesh, the surface's normal there, and the pen's pressure, 0 to 1.
pub type SurfacePoint = (Vec3, Vec3, f32);

enum Path {
    Uv {
        points: Vec<Point>,
        ahead: Vec<Point>,
        copies: Copies,
        course: Course<Vec2>,
    },
    Mesh {
        points: MeshPoints,
        ahead: Vec<SurfacePoint>,
        /// The brush in the mesh's units.
        scaled: Brush,
        skin: Arc<Skin>,
        copies: solid::Copies,
        course: Course<Vec3>,
    },
}

impl Path {
    fn cover(&self, place: (u32, u32)) -> Option<&Cover> {
        match self {
            Self::Uv { course, .. } => course.cover(place),
            Self::Mesh { course, .. } => course.cover(place),
        }
    }
}

impl Live {
    /// A stroke in UV without points yet.
    ///
    /// # Errors
    /// When the brush does not check.
    pub fn new(brush: Arc<Brush>, seed: u32, surface: &Surface) -> Result<Self> {
        brush.check()?;
        let ground = Ground::new(surface);
        Ok(Self {
            path: Path::Uv {
                points: Vec::new(),
                ahead: Vec::new(),
                copies: Copies::new(&brush.symmetry, ground.grid.extent),
                course: Course::new(
                    Trail::new(&brush, seed),
                    ground.shape(&brush),
                    brush.tool.follows_stroke(),
                ),
            },
            ground,
            brush,
            seed,
        })
    }

    /// A stroke on a mesh without points yet.
    ///
    /// # Errors
    /// When the brush does not check.
    pub fn on_mesh(brush: Arc<Brush>, seed: u32, skin: Arc<Skin>) -> Result<Self> {
        brush.check()?;
        let scaled = brush.scaled(skin.scale());
        let shape = solid::shape(&scaled, &skin);
        Ok(Self {
            ground: skin.ground,
            path: Path::Mesh {
                points: MeshPoints::new(skin.extent()),
                ahead: Vec::new(),
                course: Course::new(
                    Trail::new(&scaled, seed),
                    shape,
                    brush.tool.follows_stroke(),
                ),
                copies: solid::Copies::new(&scaled.symmetry, skin.middle()),
                scaled,
                skin,
            },
            brush,
            seed,
        })
    }

    /// What it paints with.
    pub fn brush(&self) -> &Arc<Brush> {
        &self.brush
    }

    /// Of jitter and scratches.
    pub fn seed(&self) -> u32 {
        self.seed
    }

    /// How many points it has, without those that are ahead.
    pub fn len(&self) -> usize {
        match &self.path {
            Path::Uv { points, .. } => points.len(),
            Path::Mesh { points, .. } => points.len(),
        }
    }

    /// Whether it has no point yet.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Whether it takes no more points ([`POINTS_MAX`]): time to finish it and begin another at the same place.
    pub fn is_full(&self) -> bool {
        self.len() >= POINTS_MAX
    }

    /// The stroke goes on to a point in UV. The rectangles in which something changes; they may overlap. None for a stroke on a
    /// mesh.
    pub fn push(&mut self, point: Point) -> Vec<Rect> {
        self.go_on(&[point], &[])
    }

    /// The same with several points, and with those that are ahead for now.
    pub fn go_on(&mut self, more: &[Point], end: &[Point]) -> Vec<Rect> {
        let (everywhere, whole) = (self.brush.tool.is_everywhere(), self.whole());
        let Path::Uv {
            points,
            ahead,
            copies,
            course,
        } = &mut self.path
        else {
            return Vec::new();
        };
        let was_empty = points.is_empty();
        let (ground, brush) = (&self.ground, &self.brush);
        let add = |points: &mut Vec<Point>, point: &Point| {
            let added = Points::add_uv(points, *point);
            step_of(added, || ground.node(brush, points[points.len() - 1]))
        };
        let steps: Vec<_> = more.iter().filter_map(|p| add(points, p)).collect();
        if everywhere {
            return first_only(was_empty && !points.is_empty(), whole);
        }
        let mut last: Vec<Point> = points.last().copied().into_iter().collect();
        let provisional: Vec<_> = end.iter().filter_map(|p| add(&mut last, p)).collect();
        if steps.is_empty() && ahead == end {
            return Vec::new();
        }
        *ahead = end.to_vec();
        let plane = Plane { ground, copies };
        course.go_on(&steps, &provisional, &plane, whole)
    }

    /// The stroke goes on to a point of its mesh, with the surface's normal there. The rectangles in which something changes;
    /// none for a stroke in UV, and for numbers that are none.
    pub fn push_on_mesh(&mut self, position: Vec3, normal: Vec3, pressure: f32) -> Vec<Rect> {
        self.go_on_mesh(&[(position, normal, pressure)], &[])
    }

    /// The same with several points, and with those that are ahead for now.
    pub fn go_on_mesh(&mut self, more: &[SurfacePoint], end: &[SurfacePoint]) -> Vec<Rect> {
        let (everywhere, whole) = (self.brush.tool.is_everywhere(), self.whole());
        let Path::Mesh {
            points,
            ahead,
            scaled,
            skin,
            copies,
            course,
        } = &mut self.path
        else {
            return Vec::new();
        };
        let was_empty = points.is_empty();
        let add = |points: &mut MeshPoints, (at, normal, pressure): &SurfacePoint| {
            let added = points.add(*at, *normal, *pressure);
            step_of(added, || solid::node(scaled, points, points.len() - 1))
        };
        let steps: Vec<_> = more.iter().filter_map(|p| add(points, p)).collect();
        if everywhere {
            return first_only(was_empty && !points.is_empty(), whole);
        }
        let mut last = points.last_only();
        let provisional: Vec<_> = end.iter().filter_map(|p| add(&mut last, p)).collect();
        if steps.is_empty() && ahead == end {
            return Vec::new();
        }
        *ahead = end.to_vec();
        let space = Space { skin, copies };
        course.go_on(&steps, &provisional, &space, whole)
    }

    fn whole(&self) -> Rect {
        self.ground.grid.whole()
    }

    /// The rectangle of the texels before the stroke that [`Live::apply`] needs for `rect`: larger for a brush that looks around
    /// itself; past an edge where the map repeats, all there is.
    pub fn needs(&self, rect: Rect) -> Rect {
        match self.kernel() {
            Some(kernel) => rect.hull(kernel.grown(rect)),
            None => rect,
        }
    }

    fn kernel(&self) -> Option<Kernel> {
        let reach = self.brush.tool.reach();
        (reach > 0.0).then(|| Kernel::new(reach, &self.ground))
    }

    /// The texels of `rect`, which lies in `now`, with the stroke so far over those of `before`, which holds [`Live::needs`] of it.
    /// `below` is what lies below the layer, and holds `rect` too. `coverage` belongs to `now`: in `rect` it is that before the
    /// stroke, and becomes that with it. All else stays.
    ///
    /// # Panics
    /// When a region does not hold what it must, or coverage is of another length.
    pub fn apply(
        &self,
        before: &Region,
        below: &Region,
        rect: Rect,
        (now, coverage): (&mut Region, &mut [f32]),
    ) {
        let needs = self.needs(rect);
        let holds = |region: &Region, rect: Rect| region.rect().intersection(rect) == Some(rect);
        assert!(
            holds(before, needs) && holds(below, rect) && holds(now, rect),
            "{:?}, {:?} and {:?} must hold {needs:?}, {rect:?} and {rect:?}",
            before.rect(),
            below.rect(),
            now.rect()
        );
        let all = now.rect().texels();
        assert_eq!(coverage.len(), all, "a number for each texel");
        now.view_mut().copy_part(before, rect);
        let mean = self.kernel().map(|kernel| match &self.path {
            Path::Uv { .. } => kernel.mean(rect, &Planes::of(before)),
            Path::Mesh { skin, .. } => {
                kernel.mean_apart(rect, &Planes::of(before), |rect| skin.charts(rect))
            }
        });
        let toward = mean.as_ref().map_or(Planes::of(below), |m| m.planes());
        let work_of = Work::of(&self.brush.tool);
        let bands = View::of(now, below, coverage).bands(rect);
        let everywhere = self.everywhere();
        let work = |(band, mut view): (Rect, View<'_>)| {
            for (place, part) in tiles_of(band) {
                let cover = match &everywhere {
                    Some(all) => {
                        let mut all = all.clone();
                        all.origin = origin(place);
                        Some(Cow::Owned(all))
                    }
                    None => self.path.cover(place).map(Cow::Borrowed),
                };
                if let Some(cover) = cover {
                    apply(work_of, &cover, part, &mut view, toward);
                }
            }
        };
        bands.into_par_iter().for_each(work);
    }

    /// What a tool that works everywhere covers of any tile, once it has begun.
    fn everywhere(&self) -> Option<Cover> {
        (self.brush.tool.is_everywhere() && !self.is_empty()).then(|| {
            let mut cover = Cover::new(IVec2::ZERO, false);
            cover.fill(self.brush.flow);
            cover
        })
    }

    /// The finished stroke; `None` when it paints nothing: there was no point, or only one of a tool that follows the stroke.
    pub fn finish(mut self) -> Option<Stroke> {
        match &mut self.path {
            Path::Uv { points, ahead, .. } => {
                for point in ahead {
                    Points::add_uv(points, *point);
                }
            }
            Path::Mesh { points, ahead, .. } => {
                for (at, normal, pressure) in ahead {
                    points.add(*at, *normal, *pressure);
                }
            }
        }
        let least = if self.brush.tool.follows_stroke() {
            2
        } else {
            1
        };
        if self.len() < least {
            return None;
        }
        let points = match self.path {
            Path::Uv { points, .. } => Points::Uv(points),
            Path::Mesh { points, .. } => Points::Mesh(points),
        };
        Some(Stroke::from_parts(self.brush, self.seed, points).expect("within the limits by push"))
    }
}

/// What a point that was added, or not, does to the path.
fn step_of<V: Vector>(added: Added, node: impl FnOnce() -> Node<V>) -> Option<Step<V>> {
    match added {
        Added::Nothing => None,
        Added::Pressure => Some(Step::Press(node())),
        Added::Point => Some(Step::To(node())),
    }
}

/// What points change for a tool that works everywhere: the first does all.
fn first_only(is_first: bool, whole: Rect) -> Vec<Rect> {
    if is_first { vec![whole] } else { Vec::new() }
}
