//! Map to map: what minifies and reworks whole maps.

mod pyramid;

pub use pyramid::Pyramid;
