//! Replays every generation of every stage of a recording: from its checkpoint, through the same step, with the recorded
//! inputs. The outputs are compared with the recorded ones to the bit.
//!
//! A generation is replayed only from its beginning, because its state follows from all its inputs. The report says why a
//! generation was not replayed.
//!
//! | module | holds |
//! |---|---|
//! | [`report`] | the result of a replay |
//! | `generation` | one generation, replayed while its inputs are read |
//! | `pieces` | the entries of a generation's inputs, from their pieces |
//! | [`driver`] | the replay of a recording |
//! | `values` | the fields of a message as text |
//! | [`diff`] | where two recordings part |
//! | `samples` | recorded samples of a tick, and where two of them differ |

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
