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
//! # The files, in reading order
//!
//! Pure modules do no I/O and read no clock.
//!
//! | module | holds |
//! |---|---|
//! | `order` | permission to drive, pure |
//! | `judge` | end of the mission, pure; [`outcome`] is its result |
//! | `decisive` | the first event that ended a mission, and its tick, pure |
//! | `stall` | stalls and their next recovery step, pure |
//! | `supervisor`, `stall_recovery` | the loop that asks these; its reaction to stalls |
//! | `recovery_step` | time of a recovery step, tick limit of the link in lockstep, pure |
//! | `run`, `shutdown` | a run from start to end; robot and stages stopped |
//! | [`target_list`], `requests` | targets, pure; operators' requests, the next target |
//! | `following`, `follow` | place beside a beacon, pure; its samples, the moving target |
//! | [`operator`] | requests of an operator, in any process |
//! | `bus_endpoints`, `observer` | writers and readers on the bus |
//! | `long_record` | bounded records of each tick, pure |
//! | `run_clock` | mission time, first new tick |
//! | [`recovery`] | saved state from which another supervisor resumes |
//! | [`simulator`] | the simulated robot as a child process |
//! | `progress` | progress shown to the user |
//! | `error` | reasons why a run failed |

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
pub mod target_list;

pub use error::SupervisorError;
pub use observer::{Heard, Listener, Record};
pub use progress::Progress;
pub use run::{Consumer, EndSignals, Finished, StillMoving, end_signals, run};
pub use supervisor::Options;
