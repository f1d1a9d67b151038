//! Shapes to coverage, with the direction in which they run. The one module that knows tiny-skia.

mod stroke;

pub use stroke::{Grid, Stroke};
