//! Replay of every generation of every stage in a recording, from its checkpoint, through the same
//! step, with the recorded inputs. Outputs are compared with the recorded ones to the bit.
//!
//! A generation's state follows from all its inputs, so it is replayed only from its beginning.

pub mod diff;
pub mod driver;
mod generation;
mod pieces;
pub mod report;
mod samples;
mod values;

pub use self::{
    driver::{Options, replay},
    report::{Difference, Report, StageReport},
    values::first_difference,
};
