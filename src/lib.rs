//! Per-pixel alpha_x, alpha_y and tangent-direction maps for anisotropic reflection: generated from recipes, lit in a
//! software preview, and written for other renderers without changing their meaning.
//!
//! The modules stand in the order of the data flow, and each imports only from those above it; `tests/layout.rs` keeps it so.

pub mod error;
pub mod progress;

pub mod math;

pub mod brdf;
pub mod mesh;

pub mod map;

pub mod convention;
pub mod coverage;
pub mod pattern;

pub mod guide;
pub mod paint;

pub mod filter;
pub mod import;
pub mod recipe;

pub mod raster;

pub mod preview;

pub mod export;

pub mod analyse;

pub mod generate;

pub mod chart;

pub mod studio;

pub use error::{Error, Result};
