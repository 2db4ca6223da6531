//! Process control of one robot: starts, watches, kills and restarts its stages.
//!
//! Each stage is a process, judged by its heartbeats and outputs. A stage that ends, stops beating
//! or leaves inputs unanswered gets a successor, a new generation, which continues from its
//! checkpoint. The link stops the robot meanwhile. Failures of code that only reports (logs,
//! records, published deaths) never end a mission.
//!
//! # Reading order
//!
//! Start with [`stages`], the table of stages, and the pure [`policy`].

pub mod activity;
pub mod cleanup;
pub mod death;
mod descriptors;
pub mod domain;
mod domain_error;
pub mod executable;
pub mod host;
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
