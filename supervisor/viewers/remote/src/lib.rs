//! `firsthand remote`: a robot's topics on another machine, read-only.
//!
//! `serve` reads the robot's bus as a consumer, and puts each sample under
//! `firsthand/ROBOT/topic/NAME` of a zenoh session, encoded as in recordings. `show` republishes
//! these samples on its own bus, a mirror to which viewers attach.
//!
//! iceoryx2's own zenoh tunnel is unsuitable: it carries services in both directions, so the other
//! machine could write on the robot's bus. Its filter knows names, but no directions.

// `pub` marks use by another module.
#![allow(unreachable_pub)]

mod list;
mod serve;
mod session;
mod show;
#[cfg(test)]
mod tests;
mod wire;

use clap::{Parser, Subcommand};

use console::failure::Result;

/// Show a robot of another machine to all local viewers.
///
/// Run `serve` on the robot's machine, and `show` on the other.
#[derive(Debug, Parser)]
#[command(name = "firsthand-remote", version)]
pub struct Arguments {
    #[command(subcommand)]
    what: What,
}

#[derive(Debug, Subcommand)]
enum What {
    /// Let other machines read a local robot until Ctrl-C, across runs.
    Serve(serve::Arguments),
    /// Show a robot of another machine here until Ctrl-C.
    ///
    /// `status`, `top`, `page` and consumers attach to it as to a local robot.
    Show(show::Arguments),
    /// List the robots that machines serve.
    List(list::Arguments),
}

pub fn execute(arguments: &Arguments) -> Result {
    match &arguments.what {
        What::Serve(arguments) => serve::serve(arguments),
        What::Show(arguments) => show::show(arguments),
        What::List(arguments) => list::list(arguments),
    }
}
