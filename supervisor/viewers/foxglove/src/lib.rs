//! `firsthand foxglove`: the robot in Foxglove or Lichtblick.
//!
//! | module | holds |
//! |---|---|
//! | `gate` | which web pages may open it |
//! | `live` | the channels of a recording ([`recording::viewers`]), live |

// No other crate uses these modules: `pub` means another module; what none uses is reported.
#![allow(unreachable_pub)]

mod gate;
mod live;
#[cfg(test)]
mod tests;

use std::{net::SocketAddr, process::ExitCode};

use self::live::Live;
use clap::Parser;
use common::{
    domain::{Domain, RobotName},
    signals::Signals,
};
use console::{executable, failure::Failure, output::print_text, stream::let_stages_go_first};

/// Serve a robot to Foxglove or Lichtblick, live: what a recording has, by a websocket.
///
/// It prints the address to open there. Viewers only watch.
#[derive(Debug, Parser)]
#[command(name = "firsthand-foxglove", version)]
pub struct Arguments {
    /// Name of the robot; it need not run yet.
    #[arg(long, default_value = "x80")]
    robot: RobotName,
    /// Where to listen. The protocol has no authentication: whoever reaches the address can watch the robot. Nobody can send it anything.
    #[arg(long, value_name = "ADDRESS:PORT", default_value = "127.0.0.1:8765")]
    listen: SocketAddr,
    /// The origin of a viewer's web page, such as `https://lichtblick.example`. Pages of other origins are refused; programs that are no
    /// browsers are not.
    #[arg(long = "origin", value_name = "ORIGIN", default_value = gate::FOXGLOVE)]
    origins: Vec<String>,
    /// Print a layout for Foxglove or Lichtblick, to be imported there, and nothing else: map, field, speeds, log.
    #[arg(long)]
    layout: bool,
}

const LAYOUT: &str = include_str!("../layout.json");

pub fn main() -> ExitCode {
    // A client could fill the log with its own errors.
    executable::run("error,firsthand_foxglove=warn,foxglove=off", serve)
}

fn serve(arguments: &Arguments) -> Result<ExitCode, Failure> {
    if arguments.layout {
        print_text(LAYOUT)?;
        return Ok(ExitCode::SUCCESS);
    }
    let_stages_go_first();
    let mut signals = Signals::that_end()?;
    let listen = arguments.listen;
    let (live, address) = Live::open(&arguments.robot, listen, &arguments.origins)?;
    if !listen.ip().is_loopback() {
        tracing::warn!(%listen, "the protocol has no authentication: whoever reaches this address can watch the robot");
    }
    print_text(&format!("ws://{address}\n"))?;
    live.serve(&Domain::of(arguments.robot.clone()), &mut || signals.came());
    Ok(ExitCode::SUCCESS)
}
