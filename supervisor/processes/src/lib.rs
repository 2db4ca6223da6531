//! A robot's processes: starts its stages, watches them, kills and restarts them. Nothing here computes, draws or judges.
//!
//! Each stage is a process of its own, known by its heartbeats and outputs. A stage that ends, stops beating or leaves its inputs
//! unanswered is replaced by a new generation, which goes on from its checkpoint; the link stops the robot meanwhile. Code that
//! only reports (logs, records, published deaths) may fail; it never ends a mission.
//!
//! # The files, in reading order
//!
//! | module | holds |
//! |---|---|
//! | [`stages`] | THE table of stages: inputs, outputs, deadlines |
//! | [`policy`] | what to do with one stage, pure |
//! | `output_watchdog` | whether each stage answers what it reads, pure |
//! | [`activity`] | whether a process hangs, is blocked or only waits for a processor |
//! | `observed_time` | time that the supervisor was there to see: what deadlines count |
//! | [`process`] | a process that is watched, signalled, reaped |
//! | `stage_process`, [`stage_processes`] | one stage with its policy and process; all of them |
//! | [`death`], [`records`] | the record of a death; files of records in the run directory |
//! | [`cleanup`] | when the bus is cleaned of what ended processes held |
//! | [`domain`], `orphans`, `descriptors` | the robot's directory and shared memory, locked and wiped; stages that outlive their supervisor; the limit of descriptors |
//! | [`service_manager`] | notifications to systemd |
//! | [`last_resort`] | the end of a run whose supervisor hangs |
//! | [`executable`], [`planner_executable`] | a named executable, checked before anything starts; the one for the planner |

pub mod activity;
pub mod cleanup;
pub mod death;
mod descriptors;
pub mod domain;
mod domain_error;
pub mod executable;
pub mod last_resort;
mod observed_time;
mod orphans;
mod output_watchdog;
pub mod planner_executable;
pub mod policy;
pub mod process;
pub mod records;
pub mod service_manager;
mod stage_process;
pub mod stage_processes;
pub mod stages;

pub use domain_error::DomainError;
pub use link::stop_guard::{NAME as STOP_GUARD, run as guard};
pub use records::DEATHS;
pub use stage_process::StageProcessError;
pub use stage_processes::Starter;
