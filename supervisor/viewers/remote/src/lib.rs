//! `firsthand remote`: a robot's topics on another machine, read-only.
//!
//! `serve` reads the robot's bus as any consumer does and puts each sample, as a recording has it, under
//! `firsthand/ROBOT/topic/NAME` of a zenoh session. `show` makes a bus of its own with these samples, a mirror, to which viewers
//! attach as to a robot.
//!
//! | file | holds |
//! |---|---|
//! | `session` | zenoh sessions: certificates, and what whoever connects may do |
//! | `wire` | what goes with the samples; the clock of the other machine |
//! | `serve` | from the robot's bus to the session |
//! | `show` | from the session to a mirror's writers |
//! | `list` | the robots of several machines |
//!
//! Why this does not use iceoryx2's own tunnel over zenoh: the tunnel carries each service in both directions, so that the other machine
//! writes on the robot's bus; its filter knows names and no directions.

// No other crate uses these modules: `pub` means another module; what none uses is reported.
#![allow(unreachable_pub)]

mod list;
mod serve;
mod session;
mod show;
#[cfg(test)]
mod tests;
mod wire;

use std::process::ExitCode;

use clap::{Parser, Subcommand};

use console::{executable, failure::Result};

/// Show a robot of another machine on this one, to all viewers: `serve` on the robot's machine, `show` on the other.
#[derive(Debug, Parser)]
#[command(name = "firsthand-remote", version)]
pub struct Arguments {
    #[command(subcommand)]
    what: What,
}

#[derive(Debug, Subcommand)]
enum What {
    /// Let other machines read a robot of this one, from run to run, until Ctrl-C.
    Serve(serve::Arguments),
    /// Show a robot of another machine here: `status`, `top`, `page` and consumers attach to it as to a robot, until Ctrl-C.
    Show(show::Arguments),
    /// List the robots that machines serve.
    List(list::Arguments),
}

pub fn main() -> ExitCode {
    executable::run("error", execute)
}

fn execute(arguments: &Arguments) -> Result<ExitCode> {
    match &arguments.what {
        What::Serve(arguments) => serve::serve(arguments)?,
        What::Show(arguments) => show::show(arguments)?,
        What::List(arguments) => list::list(arguments)?,
    }
    Ok(ExitCode::SUCCESS)
}
