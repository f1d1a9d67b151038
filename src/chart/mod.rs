//! Methods timed and measured on the machine at hand: what each costs, and how far its result is from the truth.
//!
//! [`measure`] takes times and errors of kernels and of whole pictures and writes them as CSV, draws them as SVG, and tells of
//! them on a short page; [`stability`] does the same for what fails where.

mod energy;
mod envelope;
mod forms;
mod kernels;
mod labels;
mod machine;
mod pictures;
mod report;
mod scatter;
mod stability;
mod svg;

pub use envelope::{Cell, Envelope, LEVELS, VIEW_DEGREES, envelope};
pub use kernels::KernelRow;
pub use machine::Machine;
pub use pictures::PictureRow;
pub use report::{Measured, Options, Part, measure};
pub use stability::{Row, Stability, envelope_table, stability};
