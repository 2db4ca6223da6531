//! A mission of a robot: lets it drive, looks for stalls, keeps its targets, judges when the mission is over, stops it.
//!
//! The supervisor owns the robot's directory and shared memory, and has the crate `processes` start and restart the stages. It reads
//! their outputs from the bus and orders the robot to drive or to stand. Code that only reports may fail; it never ends a mission.
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
//! | module | holds |
//! |---|---|
//! | `order` | whether the robot may drive, pure |
//! | `judge` | whether the mission is over, pure; [`outcome`] is its result |
//! | `decisive` | which of the things that end a mission came first, and at which tick, pure |
//! | `stall` | whether the robot stalls, and the next recovery step, pure |
//! | `supervisor`, `stall_recovery` | the loop, which asks these; what it does about stalls |
//! | `recovery_step` | when a recovery step is carried out, and in lockstep how far the link may go meanwhile, pure |
//! | `run`, `shutdown` | a run from start to end; the robot to rest and the stages stopped |
//! | [`target_list`], `requests` | the robot's targets, pure; operators' requests, and the next target |
//! | `following`, `follow` | how a beacon is followed, pure; its samples, and the target that moves with it |
//! | [`operator`] | requests of an operator, in any process |
//! | `bus_endpoints`, `observer` | what the supervisor reads from and writes to the bus |
//! | `long_record` | records of each tick that stay bounded, pure |
//! | `run_clock` | mission time of a run, and its first tick that is not made yet |
//! | [`recovery`] | what another supervisor needs to go on with a run |
//! | [`simulator`] | the simulated robot as a child process |
//! | `progress` | how far a run has come, as shown to its user |
//! | `error` | why a run could not be carried out |

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
