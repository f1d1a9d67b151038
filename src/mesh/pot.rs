//! A stock pot: straight wall, rolled rim, inner wall and floor, bottom, two loop handles; one layout without overlaps.
//!
//! The wall is one straight cylinder over more than 95 % of the pot's height, so that a highlight along it can be seen over
//! its whole length. All pieces but the inner wall (2.5 % narrower than its island) are laid out at one scale,
//! [`SURFACE_PER_U`] surface units for a turn of U and [`SURFACE_PER_V`] for a turn of V. With a map of [`ASPECT`] a texel
//! is square on the surface, and a circle of the layout's metric is a circle on the pot.
//!
//! ```text
//! v = 1 ┌──────────────────────────────────────────────┐
//!       │                     BODY                     │  outer wall, wraps around
//!       ├──────────────────────────────────────────────┤
//!       │                     RIM                      │  lip, outside to inside, wraps around
//!       ├──────────────────────────────────────────────┤
//!       │                    INSIDE                    │  inner wall, wraps around
//!       ├───────────────┬─────────────┬────────────────┤
//!       │ ╭───────────╮ │ ╭─────────╮ │  HANDLE_RIGHT  │
//!       │ │  BOTTOM   │ │ │  FLOOR  │ │  HANDLE_LEFT   │
//!       │ ╰───────────╯ │ ╰─────────╯ │                │
//! v = 0 └───────────────┴─────────────┴────────────────┘
//!      u = 0                                         u = 1
//! ```
//!
//! | island | u | v | what lies there |
//! |---|---|---|---|
//! | [`BODY`] | 0 to 1 | 0.7197 to 0.9931 | the rounded lower edge and the wall, v up; u = 1/2 faces +z |
//! | [`RIM`] | 0 to 1 | 0.6810 to 0.7060 | the lip, v from the outer wall over the top to the inner wall |
//! | [`INSIDE`] | 0 to 1 | 0.3952 to 0.6672 | the rounded inner edge and the inner wall, v up; u = 1/2 at the back (-z), where one looks in |
//! | [`BOTTOM`] | 0.0080 to 0.3199 | 0.0071 to 0.3815 | circle, seen from below: U = +x, V = +z |
//! | [`FLOOR`] | 0.3390 to 0.6303 | 0.0071 to 0.3567 | circle, seen from above: U = +x, V = -z |
//! | [`HANDLE_RIGHT`] | 0.6525 to 0.8080 | 0.3335 to 0.3815 | the tube at +x: u along it, front to back; v around, 1/2 outside |
//! | [`HANDLE_LEFT`] | 0.6525 to 0.8080 | 0.2717 to 0.3197 | the tube at -x: u along it, back to front |
//!
//! Every island is unmirrored: seen from the side the light falls on, B = N x T is image-up.

use super::Mesh;
use super::grid::{AROUND, Vertex, along_u, ring, step};
use crate::math;
use glam::{Vec2, Vec3};
use std::f32::consts::{FRAC_PI_2, FRAC_PI_3, PI, TAU};

/// Outer radius of the wall.
pub const RADIUS: f32 = 1.0;
/// Height of the straight outer wall.
pub const WALL_HEIGHT: f32 = 1.4;
/// Height of the whole pot, centred on the origin.
pub const HEIGHT: f32 = LOWER_EDGE + WALL_HEIGHT + RIM_RADIUS * (1.0 + SIN_60);
/// What a recipe's `aspect` should be on the pot: the surface's width over its height for one turn of UV.
pub const ASPECT: f32 = 1.2;
/// Surface units for one turn of U: the wall's circumference.
pub const SURFACE_PER_U: f32 = TAU * RADIUS;
/// Surface units for one turn of V.
pub const SURFACE_PER_V: f32 = SURFACE_PER_U / ASPECT;

/// Radius of the rounding between wall and bottom.
const LOWER_EDGE: f32 = 0.02;
/// Radius of the rolled lip and thickness of the wall: the lip's circle meets the outer and the inner wall at 60 degrees
/// below its middle.
const RIM_RADIUS: f32 = 0.025;
const SIN_60: f32 = 0.866_025_4;
/// Angle of the lip's arc.
const RIM_ARC: f32 = 5.0 * FRAC_PI_3;
const INNER_RADIUS: f32 = RADIUS - RIM_RADIUS;
/// Thickness of the floor.
const FLOOR_THICKNESS: f32 = 0.03;
/// Radius of the rounding between inner wall and floor.
const INNER_EDGE: f32 = 0.06;
const INNER_WALL_HEIGHT: f32 = LOWER_EDGE + WALL_HEIGHT - FLOOR_THICKNESS - INNER_EDGE;

/// The handle's centre line starts and ends inside the wall, here from the axis and to each side.
const HANDLE_START: f32 = 0.94;
const HANDLE_HALF_WIDTH: f32 = 0.3;
const HANDLE_LEG: f32 = 0.12;
const HANDLE_CORNER: f32 = 0.12;
const HANDLE_BAR: f32 = 2.0 * (HANDLE_HALF_WIDTH - HANDLE_CORNER);
const HANDLE_LENGTH: f32 = 2.0 * HANDLE_LEG + PI * HANDLE_CORNER + HANDLE_BAR;
const HANDLE_TUBE: f32 = 0.04;
/// How far below the top of the wall.
const HANDLE_DROP: f32 = 0.25;

/// Room between islands, in surface units: 14 texels of a map 1024 texels high.
const GAP: f32 = 0.072;

/// A rectangle of the layout in UV.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Island {
    /// Lower left corner.
    pub min: Vec2,
    /// Upper right corner.
    pub max: Vec2,
}

impl Island {
    /// The middle.
    pub fn centre(&self) -> Vec2 {
        0.5 * (self.min + self.max)
    }

    /// Whether `uv` lies inside or on the border.
    pub fn contains(&self, uv: Vec2) -> bool {
        uv.cmpge(self.min).all() && uv.cmple(self.max).all()
    }

    /// From the upper left corner and the size in surface units.
    const fn from_surface(left: f32, top: f32, width: f32, height: f32) -> Self {
        Self {
            min: Vec2::new(left / SURFACE_PER_U, (top - height) / SURFACE_PER_V),
            max: Vec2::new((left + width) / SURFACE_PER_U, top / SURFACE_PER_V),
        }
    }

    /// Once around the pot, below `top`.
    const fn around(top: f32, height: f32) -> Self {
        Self {
            min: Vec2::new(0.0, (top - height) / SURFACE_PER_V),
            max: Vec2::new(1.0, top / SURFACE_PER_V),
        }
    }
}

const BODY_TOP: f32 = SURFACE_PER_V - 0.5 * GAP;
const BODY_LENGTH: f32 = LOWER_EDGE * FRAC_PI_2 + WALL_HEIGHT;
const RIM_TOP: f32 = BODY_TOP - BODY_LENGTH - GAP;
const RIM_LENGTH: f32 = RIM_RADIUS * RIM_ARC;
const INSIDE_TOP: f32 = RIM_TOP - RIM_LENGTH - GAP;
const INSIDE_LENGTH: f32 = INNER_EDGE * FRAC_PI_2 + INNER_WALL_HEIGHT;
const DISCS_TOP: f32 = INSIDE_TOP - INSIDE_LENGTH - GAP;
const BOTTOM_RADIUS: f32 = RADIUS - LOWER_EDGE;
const FLOOR_RADIUS: f32 = INNER_RADIUS - INNER_EDGE;
const DISCS_BOTTOM: f32 = DISCS_TOP - 2.0 * BOTTOM_RADIUS;
const HANDLES_LEFT: f32 = 4.1;
const TUBE_LENGTH: f32 = TAU * HANDLE_TUBE;

/// The outer wall with the rounded edge below it, once around.
pub const BODY: Island = Island::around(BODY_TOP, BODY_LENGTH);
/// The rolled lip, once around.
pub const RIM: Island = Island::around(RIM_TOP, RIM_LENGTH);
/// The inner wall with the rounded edge below it, once around.
pub const INSIDE: Island = Island::around(INSIDE_TOP, INSIDE_LENGTH);
/// The square around the outer bottom's circle; a square on the surface, not in UV.
pub const BOTTOM: Island =
    Island::from_surface(0.05, DISCS_TOP, 2.0 * BOTTOM_RADIUS, 2.0 * BOTTOM_RADIUS);
/// The square around the inner floor's circle; a square on the surface, not in UV.
pub const FLOOR: Island = Island::from_surface(
    2.13,
    DISCS_BOTTOM + 2.0 * FLOOR_RADIUS,
    2.0 * FLOOR_RADIUS,
    2.0 * FLOOR_RADIUS,
);
/// The handle at +x.
pub const HANDLE_RIGHT: Island =
    Island::from_surface(HANDLES_LEFT, DISCS_TOP, HANDLE_LENGTH, TUBE_LENGTH);
/// The handle at -x.
pub const HANDLE_LEFT: Island = Island::from_surface(
    HANDLES_LEFT,
    DISCS_TOP - TUBE_LENGTH - GAP,
    HANDLE_LENGTH,
    TUBE_LENGTH,
);
/// Every island, by name.
pub const ISLANDS: [(&str, Island); 7] = [
    ("body", BODY),
    ("rim", RIM),
    ("inside", INSIDE),
    ("bottom", BOTTOM),
    ("floor", FLOOR),
    ("handle_right", HANDLE_RIGHT),
    ("handle_left", HANDLE_LEFT),
];

/// The pot: [`HEIGHT`] high and 2 [`RADIUS`] wide without its handles at +x and -x, centred on the origin.
pub fn pot() -> Mesh {
    let ring = ring();
    let mut mesh = Mesh::empty("pot", ASPECT);
    push_turned(&mut mesh, &ring, &outside(), BODY, Facing::Out);
    push_turned(&mut mesh, &ring, &lip(), RIM, Facing::Out);
    push_turned(&mut mesh, &ring, &inside(), INSIDE, Facing::In);
    push_discs(&mut mesh, &ring[..AROUND as usize]);
    push_handle(&mut mesh, HANDLE_RIGHT, 1.0);
    push_handle(&mut mesh, HANDLE_LEFT, -1.0);
    mesh
}

const BOTTOM_Y: f32 = -0.5 * HEIGHT;
const FLOOR_Y: f32 = BOTTOM_Y + FLOOR_THICKNESS;
const WALL_TOP_Y: f32 = BOTTOM_Y + LOWER_EDGE + WALL_HEIGHT;

/// A point of the outline that is turned around the axis.
#[derive(Clone, Copy)]
struct Outline {
    /// Distance from the axis, height.
    at: Vec2,
    /// Outward from the axis, up.
    normal: Vec2,
    /// Surface units along the outline.
    along: f32,
}

/// A quarter circle or more of the outline: `steps` + 1 points on the circle around `centre`, from the angle `start`
/// (0 points away from the axis) over `sweep`. `side` is -1 where the surface looks toward the centre.
fn arc(centre: Vec2, radius: f32, start: f32, sweep: f32, side: f32, steps: u32) -> Vec<Outline> {
    (0..=steps)
        .map(|i| {
            let part = step(i as usize, steps);
            let (sin, cos) = math::sin_cos(start + sweep * part);
            let direction = Vec2::new(cos, sin);
            Outline {
                at: centre + radius * direction,
                normal: side * direction,
                along: radius * sweep.abs() * part,
            }
        })
        .collect()
}

/// The rounded lower edge, then the wall, upward.
fn outside() -> Vec<Outline> {
    let centre = Vec2::new(BOTTOM_RADIUS, BOTTOM_Y + LOWER_EDGE);
    let mut line = arc(centre, LOWER_EDGE, -FRAC_PI_2, FRAC_PI_2, 1.0, 8);
    // Where two pieces meet their points are equal bit for bit, so that no picture shows a crack.
    line[0].at = Vec2::new(BOTTOM_RADIUS, BOTTOM_Y);
    line.push(Outline {
        at: Vec2::new(RADIUS, WALL_TOP_Y),
        normal: Vec2::X,
        along: BODY_LENGTH,
    });
    line
}

/// From the outer wall over the top to the inner wall.
fn lip() -> Vec<Outline> {
    let centre = Vec2::new(RADIUS - 0.5 * RIM_RADIUS, WALL_TOP_Y + SIN_60 * RIM_RADIUS);
    let mut line = arc(centre, RIM_RADIUS, -FRAC_PI_3, RIM_ARC, 1.0, 32);
    line[0].at = Vec2::new(RADIUS, WALL_TOP_Y);
    line[32].at = Vec2::new(INNER_RADIUS, WALL_TOP_Y);
    line
}

/// The rounded inner edge, then the inner wall, upward.
fn inside() -> Vec<Outline> {
    let centre = Vec2::new(FLOOR_RADIUS, FLOOR_Y + INNER_EDGE);
    let mut line = arc(centre, INNER_EDGE, -FRAC_PI_2, FRAC_PI_2, -1.0, 12);
    line[0].at = Vec2::new(FLOOR_RADIUS, FLOOR_Y);
    line.push(Outline {
        at: Vec2::new(INNER_RADIUS, WALL_TOP_Y),
        normal: Vec2::NEG_X,
        along: INSIDE_LENGTH,
    });
    line
}

/// Which way a wall looks.
#[derive(Clone, Copy, PartialEq)]
enum Facing {
    /// Away from the axis: u runs counter-clockwise seen from above, u = 1/2 at +z.
    Out,
    /// Toward the axis: u runs clockwise, u = 1/2 at -z, where one looks in.
    In,
}

/// Turns an outline around the axis.
fn push_turned(mesh: &mut Mesh, ring: &[Vec3], line: &[Outline], island: Island, facing: Facing) {
    const N: usize = AROUND as usize;
    mesh.push_grid(AROUND, line.len() as u32 - 1, |i, j| {
        let (radial, sense) = match facing {
            Facing::Out => (ring[i], 1.0),
            Facing::In => (ring[(N + N / 2 - i) % N], -1.0),
        };
        let point = line[j];
        Vertex {
            position: radial * point.at.x + Vec3::Y * point.at.y,
            normal: radial * point.normal.x + Vec3::Y * point.normal.y,
            tangent: along_u(radial) * sense,
            uv: Vec2::new(step(i, AROUND), island.min.y + point.along / SURFACE_PER_V),
        }
    });
}

/// The outer bottom and the inner floor.
fn push_discs(mesh: &mut Mesh, ring: &[Vec3]) {
    let planar = Vec2::new(SURFACE_PER_U, SURFACE_PER_V).recip();
    let bottom = Vec3::Y * BOTTOM_Y;
    mesh.push_fan(
        bottom,
        ring.iter().rev().map(|d| *d * BOTTOM_RADIUS + bottom),
        (Vec3::X, Vec3::Z),
        BOTTOM.centre(),
        planar,
    );
    let floor = Vec3::Y * FLOOR_Y;
    mesh.push_fan(
        floor,
        ring.iter().map(|d| *d * FLOOR_RADIUS + floor),
        (Vec3::X, Vec3::NEG_Z),
        FLOOR.centre(),
        planar,
    );
}

/// A point of the handle's centre line in the xz plane: position, direction, surface units from its start.
type PathPoint = (Vec2, Vec2, f32);

/// Out of the wall, around a corner, along the bar, around a corner, into the wall; front (+z) to back.
fn handle_path() -> Vec<PathPoint> {
    const CORNER_STEPS: u32 = 24;
    let corner_x = HANDLE_START + HANDLE_LEG;
    let corner_z = 0.5 * HANDLE_BAR;
    let corner = |z: f32, from: f32, along: f32| {
        (0..=CORNER_STEPS).map(move |i| {
            let turned = FRAC_PI_2 * step(i as usize, CORNER_STEPS);
            let (sin, cos) = math::sin_cos(from - turned);
            let out = Vec2::new(cos, sin);
            (
                Vec2::new(corner_x, z) + HANDLE_CORNER * out,
                Vec2::new(sin, -cos),
                along + HANDLE_CORNER * turned,
            )
        })
    };
    let quarter = HANDLE_CORNER * FRAC_PI_2;
    let mut path = vec![(Vec2::new(HANDLE_START, HANDLE_HALF_WIDTH), Vec2::X, 0.0)];
    path.extend(corner(corner_z, FRAC_PI_2, HANDLE_LEG));
    path.extend(corner(-corner_z, 0.0, HANDLE_LEG + quarter + HANDLE_BAR));
    path.push((
        Vec2::new(HANDLE_START, -HANDLE_HALF_WIDTH),
        Vec2::NEG_X,
        HANDLE_LENGTH,
    ));
    path
}

/// A tube along the path; `side` is +1 for the handle at +x, -1 for its twin half a turn around the axis.
fn push_handle(mesh: &mut Mesh, island: Island, side: f32) {
    const TUBE_STEPS: u32 = 32;
    let path = handle_path();
    let y = WALL_TOP_Y - HANDLE_DROP;
    let place = |p: Vec2| Vec3::new(side * p.x, 0.0, side * p.y);
    mesh.push_grid(path.len() as u32 - 1, TUBE_STEPS, |i, j| {
        let (at, direction, along) = path[i];
        let tangent = place(direction);
        let around = step(j, TUBE_STEPS);
        // The last row repeats the first bit for bit.
        let (sin, cos) = math::sin_cos(TAU * step(j % TUBE_STEPS as usize, TUBE_STEPS) - PI);
        let normal = tangent.cross(Vec3::Y) * cos + Vec3::Y * sin;
        Vertex {
            position: place(at) + Vec3::Y * y + HANDLE_TUBE * normal,
            normal,
            tangent,
            uv: Vec2::new(
                island.min.x + along / SURFACE_PER_U,
                island.min.y + around * TUBE_LENGTH / SURFACE_PER_V,
            ),
        }
    });
}
