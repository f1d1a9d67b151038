//! Methods timed and measured on the machine at hand: what each costs, and how far its result is from the truth.

mod energy;
mod envelope;
mod stability;
mod svg;

pub use envelope::{Cell, Envelope, LEVELS, VIEW_DEGREES, envelope};
pub use stability::{Row, Stability, envelope_table, stability};
