//! Strokes: a brush and the points it went through, in numbers that a file keeps to the bit.
//!
//! A point is held as the whole numbers that a recipe stores, so what is painted live and what is read back later are the
//! same. UV positions are multiples of 2^-22 (a 256th of a texel of a 16384 map) from -4 to 4, which f32 holds exactly;
//! pressure is in 4096ths. Positions on a mesh are multiples of a power of two that suits the mesh's size.

use super::Brush;
use crate::error::{Error, Result};
use glam::{Vec2, Vec3};
use std::sync::Arc;

/// The most strokes of a layer.
pub const STROKES_MAX: usize = 1_000_000;
/// The most points of a stroke; an editor ends it there and begins another.
pub const POINTS_MAX: usize = 100_000;
/// How far from the origin a point may lie, in turns of UV.
pub const UV_REACH: f32 = 4.0;

/// UV positions are multiples of this.
const UV_STEP: f32 = 1.0 / 4_194_304.0;
pub(super) const UV_UNITS_MAX: i32 = 4 << 22;
pub(super) const PRESSURE_UNITS: u16 = 4096;
/// The largest coordinate on a mesh in its own steps: what f32 holds exactly.
pub(super) const MESH_UNITS_MAX: i32 = 1 << 24;
/// The powers of two that a step on a mesh may be.
pub(super) const MESH_EXPONENTS: std::ops::RangeInclusive<i8> = -60..=60;
/// Steps of an octahedral coordinate of a normal, to either side of 0.
pub(super) const NORMAL_UNITS: i16 = 511;

/// A place of a stroke in UV.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Point {
    pub(super) x: i32,
    pub(super) y: i32,
    pub(super) pressure: u16,
}

impl Point {
    /// The nearest point that a file can hold: `uv` is clamped to -4 to 4, the pressure to 0 to 1. `None` when a number is
    /// not finite.
    pub fn new(uv: Vec2, pressure: f32) -> Option<Self> {
        if !uv.is_finite() || !pressure.is_finite() {
            return None;
        }
        let whole = |x: f32| (x.clamp(-UV_REACH, UV_REACH) / UV_STEP).round() as i32;
        Some(Self {
            x: whole(uv.x),
            y: whole(uv.y),
            pressure: pressure_units(pressure),
        })
    }

    /// The position, v up.
    pub fn uv(self) -> Vec2 {
        Vec2::new(self.x as f32, self.y as f32) * UV_STEP
    }

    /// The pressure, 0 to 1.
    pub fn pressure(self) -> f32 {
        f32::from(self.pressure) / f32::from(PRESSURE_UNITS)
    }
}

fn pressure_units(pressure: f32) -> u16 {
    (pressure.clamp(0.0, 1.0) * f32::from(PRESSURE_UNITS)).round() as u16
}

/// A place of a stroke on a mesh, in the steps of its [`MeshPoints`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct MeshPoint {
    pub(super) at: [i32; 3],
    pub(super) normal: [i16; 2],
    pub(super) pressure: u16,
}

/// The points of a stroke on a mesh: positions, the surface's normals there, pressures.
#[derive(Clone, Debug, PartialEq)]
pub struct MeshPoints {
    /// A step is 2 to this power.
    pub(super) exponent: i8,
    pub(super) points: Vec<MeshPoint>,
}

impl MeshPoints {
    /// No points yet, on a mesh whose coordinates are at most `extent` from zero: its steps are the finest that reach twice as
    /// far.
    pub fn new(extent: f32) -> Self {
        let exponent = extent.max(f32::MIN_POSITIVE).log2().ceil() as i32 - 23;
        Self {
            exponent: exponent.clamp(
                i32::from(*MESH_EXPONENTS.start()),
                i32::from(*MESH_EXPONENTS.end()),
            ) as i8,
            points: Vec::new(),
        }
    }

    /// Adds the nearest point that a file can hold. `false`, and no change, when a number is not finite, the normal has no
    /// direction, or there are [`POINTS_MAX`].
    pub fn push(&mut self, position: Vec3, normal: Vec3, pressure: f32) -> bool {
        let sound =
            position.is_finite() && pressure.is_finite() && normal.try_normalize().is_some();
        let there = self.points.len();
        sound && (self.add(position, normal, pressure) != Added::Nothing || there < POINTS_MAX)
    }

    pub(super) fn add(&mut self, position: Vec3, normal: Vec3, pressure: f32) -> Added {
        let direction = normal.try_normalize();
        let (true, true, Some(normal)) = (position.is_finite(), pressure.is_finite(), direction)
        else {
            return Added::Nothing;
        };
        let most = MESH_UNITS_MAX as f32;
        let whole = |x: f32| (x / self.step()).clamp(-most, most).round() as i32;
        let point = MeshPoint {
            at: position.to_array().map(whole),
            normal: octahedral(normal),
            pressure: pressure_units(pressure),
        };
        Self::add_point(&mut self.points, point)
    }

    fn add_point(points: &mut Vec<MeshPoint>, point: MeshPoint) -> Added {
        add(points, point, |p| p.at, |p| &mut p.pressure)
    }

    /// The last of them alone, or none.
    pub(super) fn last_only(&self) -> Self {
        Self {
            exponent: self.exponent,
            points: self.points.last().copied().into_iter().collect(),
        }
    }

    /// How many.
    pub fn len(&self) -> usize {
        self.points.len()
    }

    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.points.is_empty()
    }

    fn step(&self) -> f32 {
        f32::from_bits(((127 + i32::from(self.exponent)) as u32) << 23)
    }

    /// Position, normal and pressure of the nth.
    ///
    /// # Panics
    /// When there are not that many.
    pub fn get(&self, n: usize) -> (Vec3, Vec3, f32) {
        let p = self.points[n];
        let position = Vec3::from(p.at.map(|x| x as f32)) * self.step();
        let pressure = f32::from(p.pressure) / f32::from(PRESSURE_UNITS);
        (position, from_octahedral(p.normal), pressure)
    }
}

/// A unit vector folded onto a square (the octahedral map of Meyer et al. 2010).
fn octahedral(n: Vec3) -> [i16; 2] {
    let n = n / (n.x.abs() + n.y.abs() + n.z.abs());
    let sign = |x: f32| if x < 0.0 { -1.0 } else { 1.0 };
    let (x, y) = if n.z < 0.0 {
        ((1.0 - n.y.abs()) * sign(n.x), (1.0 - n.x.abs()) * sign(n.y))
    } else {
        (n.x, n.y)
    };
    [x, y].map(|c| (c * f32::from(NORMAL_UNITS)).round() as i16)
}

fn from_octahedral(units: [i16; 2]) -> Vec3 {
    let [x, y] = units.map(|c| f32::from(c) / f32::from(NORMAL_UNITS));
    let z = 1.0 - x.abs() - y.abs();
    let fold = (-z).max(0.0);
    let toward = |c: f32| if c < 0.0 { c + fold } else { c - fold };
    Vec3::new(toward(x), toward(y), z).normalize_or(Vec3::Z)
}

/// What adding a point changed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Added {
    Nothing,
    /// The pressure of the last point, at whose place it is.
    Pressure,
    Point,
}

/// Adds a point to others. One at the place of the last is no new one: the larger of both pressures stays.
fn add<P: Copy, K: PartialEq>(
    points: &mut Vec<P>,
    point: P,
    place: impl Fn(&P) -> K,
    pressure: impl Fn(&mut P) -> &mut u16,
) -> Added {
    let full = points.len() >= POINTS_MAX;
    match points.last_mut() {
        Some(last) if place(last) == place(&point) => {
            let mut point = point;
            let (new, old) = (*pressure(&mut point), pressure(last));
            if new <= *old {
                return Added::Nothing;
            }
            *old = new;
            Added::Pressure
        }
        _ if full => Added::Nothing,
        _ => {
            points.push(point);
            Added::Point
        }
    }
}

/// Where a stroke's points lie.
#[derive(Clone, Debug, PartialEq)]
pub enum Points {
    /// In UV.
    Uv(Vec<Point>),
    /// On the mesh.
    Mesh(MeshPoints),
}

impl Points {
    /// How many.
    pub fn len(&self) -> usize {
        match self {
            Self::Uv(points) => points.len(),
            Self::Mesh(points) => points.len(),
        }
    }

    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Takes out points at the place of the one before, as adding them one by one does.
    pub(super) fn dedup(&mut self) {
        fn each<P: Copy>(
            points: &mut Vec<P>,
            mut push: impl FnMut(&mut Vec<P>, P) -> Added,
            doubled: bool,
        ) {
            if doubled {
                let old = std::mem::take(points);
                for p in old {
                    push(points, p);
                }
            }
        }
        match self {
            Self::Uv(points) => {
                let doubled = points
                    .windows(2)
                    .any(|p| (p[0].x, p[0].y) == (p[1].x, p[1].y));
                each(points, Self::add_uv, doubled);
            }
            Self::Mesh(mesh) => {
                let doubled = mesh.points.windows(2).any(|p| p[0].at == p[1].at);
                each(&mut mesh.points, MeshPoints::add_point, doubled);
            }
        }
    }

    /// Adds a point of UV as a stroke holds it: one at the place of the last is no new one, the larger of both pressures stays.
    pub(super) fn add_uv(points: &mut Vec<Point>, point: Point) -> Added {
        add(points, point, |p| (p.x, p.y), |p| &mut p.pressure)
    }
}

/// One stroke: a brush, its path, and the seed of what is random about it.
#[derive(Clone, Debug, PartialEq)]
pub struct Stroke {
    brush: Arc<Brush>,
    points: Points,
    seed: u32,
}

impl Stroke {
    /// A stroke in UV. A point at the place of the one before it is no new one: the larger of both pressures stays.
    ///
    /// # Errors
    /// When the brush does not check, or there is no point, or more than [`POINTS_MAX`].
    pub fn new(
        brush: Arc<Brush>,
        seed: u32,
        points: impl IntoIterator<Item = Point>,
    ) -> Result<Self> {
        brush.check()?;
        let given = Points::Uv(points.into_iter().take(POINTS_MAX + 1).collect());
        let mut stroke = Self::from_parts(brush, seed, given)?;
        stroke.points.dedup();
        Ok(stroke)
    }

    /// A stroke on a mesh.
    ///
    /// # Errors
    /// As for [`Stroke::new`].
    pub fn on_mesh(brush: Arc<Brush>, seed: u32, points: MeshPoints) -> Result<Self> {
        brush.check()?;
        Self::from_parts(brush, seed, Points::Mesh(points))
    }

    /// From parts of which the brush is checked elsewhere.
    pub(super) fn from_parts(brush: Arc<Brush>, seed: u32, points: Points) -> Result<Self> {
        if points.is_empty() || points.len() > POINTS_MAX {
            return Err(Error::invalid(
                "points",
                format!("a list of {}", points.len()),
                format!("allowed: 1 to {POINTS_MAX}"),
            ));
        }
        Ok(Self {
            brush,
            points,
            seed,
        })
    }

    /// What it paints with.
    pub fn brush(&self) -> &Arc<Brush> {
        &self.brush
    }

    /// Takes a brush that is equal to its own for it: many strokes with one brush hold it once.
    pub(crate) fn share_brush(&mut self, brush: &Arc<Brush>) {
        if self.brush == *brush {
            self.brush = brush.clone();
        }
    }

    /// Where it goes.
    pub fn points(&self) -> &Points {
        &self.points
    }

    /// Of jitter and scratches.
    pub fn seed(&self) -> u32 {
        self.seed
    }

    /// Whether it lies on the mesh rather than in UV.
    pub fn is_on_mesh(&self) -> bool {
        matches!(self.points, Points::Mesh(_))
    }
}

/// The strokes of a layer, first to last. Cloning copies references only.
#[derive(Clone, Debug, Default)]
pub struct Strokes {
    /// In the order they act.
    pub strokes: Vec<Arc<Stroke>>,
    /// The mesh that strokes on a mesh lie on: a built-in's name or a file. Default: the recipe's.
    pub mesh: Option<String>,
}

impl PartialEq for Strokes {
    fn eq(&self, other: &Self) -> bool {
        self.mesh == other.mesh
            && self.strokes.len() == other.strokes.len()
            && self
                .strokes
                .iter()
                .zip(&other.strokes)
                .all(|(a, b)| Arc::ptr_eq(a, b) || a == b)
    }
}

impl Strokes {
    /// Checks counts and brushes.
    ///
    /// # Errors
    /// [`Error::Invalid`] whose `what` is the key inside the layer's table.
    pub fn check(&self) -> Result<()> {
        if self.strokes.len() > STROKES_MAX {
            return Err(Error::invalid(
                "packed",
                format!("{} strokes", self.strokes.len()),
                format!("allowed: at most {STROKES_MAX} in a layer"),
            ));
        }
        let mut last: Option<&Arc<Brush>> = None;
        for stroke in &self.strokes {
            // Strokes that follow each other mostly share one brush.
            if last.is_none_or(|b| !Arc::ptr_eq(b, stroke.brush())) {
                stroke.brush().check()?;
                last = Some(stroke.brush());
            }
        }
        Ok(())
    }

    /// Whether any stroke lies on the mesh.
    pub fn need_mesh(&self) -> bool {
        self.strokes.iter().any(|s| s.is_on_mesh())
    }
}
