//! A robot's supervisor: starts its stages, lets it drive, watches, restarts, stops.
//!
//! | module | holds |
//! |---|---|
//! | [`stages`] | THE table of stages |
//! | [`policy`] | what to do with one stage, pure |
//! | [`output_watchdog`] | whether each stage answers what it reads, pure |
//! | [`stall`] | what to do when the robot does not get on, pure, and the record of it |
//! | [`process`], [`stage_processes`] | child processes; those of the stages, each under its policy |
//! | [`domain`], [`orphans`] | the robot's directory and shared memory, locked and wiped; stages that outlive their supervisor |
//! | [`simulator`] | the simulated robot as a child |
//! | [`observer`] | what is heard on the bus |
//! | [`recovery`] | what another supervisor needs to go on with a run |
//! | [`death`], [`json_lines`] | the record of a death; files of such records |
//! | [`outcome`] | how a run ended |
//! | [`supervisor`] | the loop |
//! | [`service_manager`] | systemd told how it goes |

mod death;
pub mod domain;
mod json_lines;
pub mod observer;
mod orphans;
pub mod outcome;
mod output_watchdog;
pub mod policy;
pub mod process;
pub mod recovery;
mod service_manager;
pub mod simulator;
mod stage_processes;
pub mod stages;
mod stall;
mod supervisor;

pub use stage_processes::Starter;
pub use supervisor::{Finished, Options, Progress, SupervisorError, run};
