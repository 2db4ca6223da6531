//! A robot's supervisor: starts its stages, lets the robot drive, watches, restarts, stops.
//!
//! Each stage is a process of its own. The supervisor owns the robot's directory and shared memory, starts the stages in the
//! order of their inputs, and reads their heartbeats and outputs from the bus. A stage that ends, stops beating or leaves its
//! inputs unanswered is replaced by a new generation, which goes on from its checkpoint; the link stops the robot meanwhile.
//! The supervisor orders the robot to drive or to stand, looks for stalls, and judges when the mission is over. Code that only
//! reports (logs, records, published deaths) may fail; it never ends a mission.
//!
//! # The loop
//!
//! ```text
//! loop {                                    // Supervisor::drive
//!     read heartbeats, outputs, requests    // observer, bus_endpoints
//!     reap stages, start successors         // stage_processes: policy decides
//!     abort stages that do not answer       // output_watchdog decides
//!     may the robot drive?                  // order decides
//!     publish order and roster if changed
//!     is the mission over?                  // judge decides
//!     does the robot stall?                 // stall decides
//!     clean the bus if due                  // cleanup
//!     wait for bus, child, signal, deadline
//! }
//! ```
//!
//! # The files, in reading order
//!
//! | module | holds |
//! |---|---|
//! | [`stages`] | THE table of stages: inputs, outputs, deadlines |
//! | [`policy`] | what to do with one stage, pure |
//! | `output_watchdog` | whether each stage answers what it reads, pure |
//! | `order` | whether the robot may drive, pure |
//! | `judge` | whether the mission is over, pure; [`outcome`] is its result |
//! | `decisive` | which of the things that end a mission came first, and at which tick, pure |
//! | `stall` | whether the robot stalls, and the next recovery step, pure |
//! | `supervisor`, `stall_recovery` | the loop, which asks these; what it does about stalls |
//! | `run`, `shutdown` | a run from start to end; the robot to rest and the stages stopped |
//! | [`target_list`], `requests` | the robot's targets, pure; operators' requests, and the next target |
//! | [`operator`] | requests of an operator, in any process |
//! | [`planner_executable`] | the executable that a mission names for the planner, checked |
//! | [`process`] | a process that is watched, signalled, reaped |
//! | `descriptors` | the limit of this process's descriptors |
//! | `stage_process`, `stage_processes` | one stage with its policy and process; all of them |
//! | `bus_endpoints`, [`observer`], [`totals`] | what the supervisor reads from and writes to the bus; totals of it |
//! | `observed_time` | time that the supervisor was there to see: what deadlines count |
//! | `cleanup` | when the bus is cleaned of what ended processes held |
//! | `run_clock` | mission time of a run, and its first tick that is not made yet |
//! | `death`, `records` | the record of a death; files of records in the run directory |
//! | [`recovery`] | what another supervisor needs to go on with a run |
//! | [`domain`], `orphans` | the robot's directory and shared memory, locked and wiped; stages that outlive their supervisor |
//! | [`simulator`] | the simulated robot as a child process |
//! | `service_manager` | notifications to systemd |
//! | `progress` | how far a run has come, as shown to its user |
//! | [`summary`] | the outcome and the numbers of a run |
//! | `long_record` | records of each tick that stay bounded, pure |
//! | `lockstep` | in lockstep: how far the link may go, and from which tick a recovery step holds, pure |
//! | `last_resort` | the end of a run whose supervisor hangs |
//! | `error`, `domain_error` | why a run could not be carried out |

mod bus_endpoints;
mod cleanup;
mod death;
mod decisive;
mod descriptors;
pub mod domain;
mod domain_error;
mod error;
pub mod executable;
mod judge;
mod last_resort;
mod lockstep;
mod long_record;
mod observed_time;
pub mod observer;
pub mod operator;
mod order;
mod orphans;
pub mod outcome;
mod output_watchdog;
pub mod planner_executable;
pub mod policy;
pub mod process;
mod progress;
mod records;
pub mod recovery;
mod requests;
mod run;
mod run_clock;
mod service_manager;
mod shutdown;
pub mod simulator;
mod stage_process;
mod stage_processes;
pub mod stages;
mod stall;
mod stall_recovery;
pub mod summary;
mod supervisor;
pub mod target_list;
pub mod totals;

pub use domain_error::DomainError;
pub use error::SupervisorError;
pub use link::stop_guard::{NAME as STOP_GUARD, run as guard};
pub use progress::Progress;
pub use records::DEATHS;
pub use run::{Finished, StillMoving, run};
pub use stage_processes::Starter;
pub use supervisor::Options;
