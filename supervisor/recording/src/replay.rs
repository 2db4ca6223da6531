//! Replays: every generation of every stage of a recording, fed with what its step took, through the same step, started from
//! the checkpoint it was started from. What comes out is compared to what was recorded, to the bit.
//!
//! A generation is replayed from its beginning, since its state follows from all it took. What was recorded of it in part
//! is not replayed in part: the report says why it was not.
//!
//! | module | holds |
//! |---|---|
//! | [`report`] | what a replay found |
//! | `generation` | one generation, replayed while its inputs come |
//! | `pieces` | the entries of a generation's inputs, from their pieces |
//! | [`driver`] | a recording, replayed |
//! | [`values`] | the fields of a message, for words about a difference |
//! | [`diff`] | where two recordings part |
//! | `samples` | samples of a tick, and where two of them differ |
//! | [`live`] | a recording played on a bus, with stages in processes of their own |

pub mod diff;
pub mod driver;
mod generation;
pub mod live;
mod pieces;
pub mod report;
mod samples;
pub mod values;

pub use self::{
    driver::{Options, replay},
    report::{Difference, Report, StageReport, Verdict},
};
