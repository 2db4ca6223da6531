//! `firsthand foxglove`: the robot in Foxglove or Lichtblick.

// `pub` marks use by another module.
#![allow(unreachable_pub)]

mod gate;
mod live;
#[cfg(test)]
mod tests;

use std::net::SocketAddr;

use self::live::Live;
use clap::Parser;
use common::{domain::RobotName, signals::Signals};
use console::{addresses, failure::Result, output::print_text, stream::let_stages_go_first};

/// Serve a robot live to Foxglove or Lichtblick.
///
/// Sends the channels of a recording by websocket, and prints the address to open. Viewers only
/// watch.
#[derive(Debug, Parser)]
#[command(name = "firsthand-foxglove", version)]
pub struct Arguments {
    /// Name of the robot, which may start later.
    #[arg(long, default_value = "x80")]
    robot: RobotName,
    /// Address and port to listen on.
    ///
    /// Everyone who reaches the address can watch the robot without authentication. Clients cannot
    /// send it anything.
    #[arg(long, value_name = "ADDRESS:PORT", default_value = addresses::FOXGLOVE)]
    listen: SocketAddr,
    /// Allowed origin of a web page, such as `https://lichtblick.example`.
    ///
    /// Other origins are refused. Programs other than browsers are accepted.
    #[arg(long = "origin", value_name = "ORIGIN", default_value = gate::FOXGLOVE)]
    origins: Vec<String>,
    /// Only print a layout to import there: map, field, speeds, log.
    #[arg(long)]
    layout: bool,
}

const LAYOUT: &str = include_str!("../layout.json");

pub fn serve(arguments: &Arguments) -> Result {
    if arguments.layout {
        return print_text(LAYOUT);
    }
    let_stages_go_first();
    let mut signals = Signals::that_end()?;
    let listen = arguments.listen;
    let (live, address) = Live::open(&arguments.robot, listen, &arguments.origins)?;
    if !listen.ip().is_loopback() {
        tracing::warn!(%listen, "the protocol has no authentication: every client that reaches this address can watch the robot");
    }
    print_text(format!("ws://{address}\n"))?;
    live.serve(&arguments.robot.domain(), &mut || signals.came());
    Ok(())
}
