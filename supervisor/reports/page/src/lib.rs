//! The robot's page in a browser, and a recorded run as one self-contained file. `firsthand-page`
//! serves the same messages live.

mod about;
pub mod assets;
pub mod blob;
mod collector;
mod recorded;

pub use about::{about, result};
pub use collector::Collector;
pub use recorded::Recorded;
