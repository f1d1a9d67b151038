//! Shapes to coverage: strokes in f32 with the direction in which they run, filled shapes as masks. The one module that
//! knows tiny-skia.

mod mask;
mod stroke;

pub use mask::{DrawnMask, Outline};
pub use stroke::{Grid, Part, Stroke};
