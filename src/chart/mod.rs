//! Methods timed and measured on the machine at hand: what each costs, and how far its result is from the truth.

pub mod energy;
pub mod stability;
mod svg;
