//! Painting: strokes of a brush over a map.
//!
//! A [`Stroke`] is a [`Brush`] and the points it went through. A texel takes from it a coverage, from 0 to 1, and the direction
//! of the nearest part of the path; where parts overlap the largest coverage counts, and the stroke acts on the texel once: a
//! stroke that crosses itself has no dark joint. Strokes act one after the other, each on what the ones before it left.
//!
//! Everything is plain arithmetic on f32 in a fixed order, so any rectangle comes out exactly as the whole would, at any number
//! of threads and at any CPU level.

mod brush;
mod composite;
mod course;
mod cover;
mod laid;
mod live;
mod packed;
mod painting;
pub mod path;
mod skin;
mod smooth;
mod solid;
mod stroke;
mod trail;

pub use brush::{
    Brush, COPIES_MAX, FillWith, Groove, Keep, Pressure, Roughen, Scratch, SetAlpha, SetDirection,
    Smooth, Symmetry, Tool,
};
pub use live::{Live, SurfacePoint};
pub use painting::Painting;
pub use skin::{Skin, surface_scale};
pub use stroke::{MeshPoints, POINTS_MAX, Point, Points, STROKES_MAX, Stroke, Strokes, UV_REACH};

#[cfg(test)]
mod tests;
