//! Map to map: what minifies and reworks whole maps, and the choice of signs for formats that hold directions as arrows.

mod bleed;
mod comb;
mod fetch;
mod pyramid;
mod radial;
mod resize;

pub use bleed::{Surroundings, is_round};
pub use comb::{Combed, Line, comb};
pub use fetch::Room;
pub use pyramid::Pyramid;
pub use radial::Disc;
pub(crate) use radial::center_of;
pub use resize::reduce;
