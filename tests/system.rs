//! System tests: whole runs through real processes, without access to a stage's internals.
//!
//! They are one executable, because each takes long to link. `freezes` is separate and runs alone,
//! because it measures time.
#![allow(clippy::unwrap_used, clippy::panic, clippy::print_stdout)]

mod support;

mod arduino_robot;
mod bad_input;
mod blocked_starts;
mod calibration;
mod chaos;
mod console;
mod consumers;
mod evaluation;
mod failsafe;
mod faults;
mod field;
mod fixes;
mod follow;
mod goto;
mod init;
mod json_robot;
mod kills_and_freezes;
mod laser;
mod machine;
mod missions;
mod neighbours;
mod operators;
mod page;
mod planners;
mod recording;
mod repeatability;
mod replaced_bus;
mod screen;
mod services;
mod starting;
mod stopping;
mod structure;
mod transports;
mod wiring;
