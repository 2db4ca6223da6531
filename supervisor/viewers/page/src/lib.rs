//! `firsthand page`: a consumer of one robot, and a small web server for browsers.
//!
//! One thread reads the bus, and another runs the server. Browsers take new data at 10 Hz. A slow
//! one gets only the newest maps, fields and states, and the stored rows and events. The crate
//! [`page`] has the messages and the page.

// `pub` marks use by another module.
#![allow(unreachable_pub)]

mod access;
mod context;
mod operator;
mod orders;
mod places;
mod robot;
mod server;
mod serving;
mod session;
mod shared;
#[cfg(test)]
mod tests;

use std::{net::SocketAddr, sync::Arc};

use clap::Parser;
use common::{domain::RobotName, signals::Signals};

use console::{addresses, failure::Result, output::print_line, stream::let_stages_go_first};

use self::{access::host_name, serving::Page};

/// Show a robot in a browser: map, field, charts, stages, events.
///
/// Prints two addresses, one to watch and one to drive, and stores them in a file that only you can
/// read. The part after # is a token, without which the page shows nothing. Share it only with
/// those who may watch or drive.
#[derive(Debug, Parser)]
#[command(name = "firsthand-page", version)]
pub struct Arguments {
    /// Name of the robot, which may start later.
    #[arg(long, default_value = "x80")]
    robot: RobotName,
    /// Loopback address and port to listen on.
    ///
    /// Other machines connect through an SSH tunnel or a proxy.
    #[arg(long, value_name = "ADDRESS:PORT", default_value = addresses::PAGE)]
    listen: SocketAddr,
    /// Host name of a local proxy, for https://NAME/.
    ///
    /// The proxy encrypts for other machines. The page answers to no other name.
    #[arg(long, value_name = "NAME", value_parser = host_name)]
    behind_proxy: Option<String>,
}

pub fn serve(arguments: &Arguments) -> Result {
    let_stages_go_first();
    let mut signals = Signals::that_end()?;
    let driven = arguments.robot.clone();
    let page = Page::open(arguments, Arc::new(move |order| operator::perform(&driven, order)))?;
    print_line(format_args!("{}kept in {}", page.access.addresses(), page.kept.display()))?;
    robot::follow(&arguments.robot.domain(), &page.shared, &mut || signals.came());
    Ok(())
}
