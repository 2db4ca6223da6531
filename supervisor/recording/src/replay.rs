//! Replay of every generation of every stage in a recording, from its checkpoint, through the same
//! step, with the recorded inputs. Outputs are compared with the recorded ones to the bit.
//!
//! A generation's state follows from all its inputs, so it is replayed only from its beginning. The
//! report explains why a generation was not replayed.
//!
//! | module | holds |
//! |---|---|
//! | [`report`] | result of a replay |
//! | `generation` | one generation, replayed while its inputs are read |
//! | `pieces` | entries of a generation's inputs, from their pieces |
//! | [`driver`] | replay of a recording |
//! | `values` | fields of a message as text |
//! | [`diff`] | first difference of two recordings |
//! | `samples` | recorded samples of a tick and their differences |

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
};
