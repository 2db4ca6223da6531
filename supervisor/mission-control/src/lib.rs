//! Mission control of one robot: its order to drive, stalls, targets, and the end of the mission.
//!
//! The supervisor owns the robot's directory and shared memory. It reads the stages' outputs from
//! the bus and orders the robot to drive or to stand. The crate `processes` starts and restarts the
//! stages. Failures of code that only reports never end a mission.
//!
//! # The loop
//!
//! ```text
//! loop {                                    // Supervisor::drive
//!     read heartbeats, outputs, requests    // observer, bus_endpoints
//!     reap stages, start successors         // processes: policy decides
//!     abort stages that do not answer       // processes: output_watchdog decides
//!     may the robot drive?                  // order decides
//!     publish order and roster if changed
//!     is the mission over?                  // judge decides
//!     does the robot stall?                 // stall decides
//!     clean the bus if due                  // processes: cleanup
//!     wait for bus, child, signal, deadline
//! }
//! ```
//!
//! # Reading order
//!
//! The pure modules `order`, `judge`, `decisive`, `stall`, `recovery_step`, `target_list` and
//! `following` do no I/O and read no clock. `supervisor` has the loop that asks them.

mod bus_endpoints;
mod decisive;
mod error;
mod follow;
mod following;
mod judge;
mod long_record;
mod observer;
pub mod operator;
mod order;
pub mod outcome;
mod progress;
pub mod recovery;
mod recovery_step;
mod requests;
mod run;
mod run_clock;
mod shutdown;
pub mod simulator;
mod stall;
mod stall_recovery;
mod supervisor;
pub mod surroundings;
pub mod target_list;
#[cfg(test)]
mod testing;

pub use error::{Refused, SupervisorError, refuse};
pub use observer::{Heard, Listener, Record};
pub use progress::Progress;
pub use run::{Consumer, EndSignals, Finished, StillMoving, end_signals, run, simulate};
pub use supervisor::Options;
