//! Map to map: what minifies and reworks whole maps, and the choice of signs for formats that hold directions as arrows.

mod bleed;
mod comb;
mod pyramid;
mod resize;

pub use bleed::{Surroundings, is_round};
pub use comb::{Combed, Line, comb};
pub use pyramid::Pyramid;
pub use resize::reduce;
