//! Shared code of the system tests: commands of the real executable, runs, and the state of robots.
//!
//! Every test names its own robots. Each process gets SIGKILL when its test ends in any way, so a
//! killed suite does not hinder the next.
#![allow(
    dead_code,
    unused_imports,
    clippy::unwrap_used,
    clippy::panic,
    missing_docs,
    unreachable_pub,
    reason = "each of the two test executables uses a part"
)]

mod browser;
mod commands;
mod own_process;
mod recorded_page;
mod robot;
mod run;
pub mod wire;

pub use self::{browser::*, commands::*, own_process::*, recorded_page::*, robot::*, run::*};
