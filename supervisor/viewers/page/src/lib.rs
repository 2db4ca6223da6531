//! `firsthand page`: the robot in a browser. It is a consumer of one robot, and a small web server beside it.
//!
//! One thread reads the bus and fills the data that browsers are shown; a second one runs the server. A browser takes the new data
//! ten times a second, so a slow one delays nobody: it gets the newest maps, fields and states, and those rows and events that are
//! still stored. What it gets and the page itself are in the crate [`page`].
//!
//! | module | holds |
//! |---|---|
//! | `serving` | a page that is served: its threads, its options, its errors |
//! | `access` | who may: addresses, names, tokens |
//! | `context` | what every connection needs |
//! | `shared` | what browsers are shown |
//! | `robot` | the thread that reads the bus |
//! | `server` | connections, requests, checks |
//! | `places` | how many clients there are at a time |
//! | `session` | one browser: authentication, messages, orders |
//! | `orders` | what an operator may ask for |
//! | `operator` | how that is done |

// No other crate uses these modules: `pub` means another module; what none uses is reported.
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

use std::{net::SocketAddr, process::ExitCode, sync::Arc};

use clap::Parser;
use common::{domain::RobotName, signals::Signals};

use console::{executable, failure::Failure, output::print_text, stream::let_stages_go_first};

use self::{
    access::host_name,
    serving::{Options, Page},
};

/// Show a robot in a browser: map, field, charts, stages, events; orders for whoever has the token to drive.
///
/// It prints two addresses, and keeps them in a file that only you can read. The part behind # is a token, without which the page shows
/// nothing: keep it to those who may watch or drive.
#[derive(Debug, Parser)]
#[command(name = "firsthand-page", version)]
pub struct Arguments {
    /// Name of the robot; it need not run yet.
    #[arg(long, default_value = "x80")]
    robot: RobotName,
    /// Where to listen, on this machine only. Others come through a tunnel of SSH, or a proxy.
    #[arg(long, value_name = "ADDRESS:PORT", default_value = "127.0.0.1:8080")]
    listen: SocketAddr,
    /// A proxy on this machine encrypts for others, who know the page as https://NAME/. The page answers to no other name.
    #[arg(long, value_name = "NAME", value_parser = host_name)]
    behind_proxy: Option<String>,
}

pub fn main() -> ExitCode {
    executable::run("error", serve)
}

fn serve(arguments: &Arguments) -> Result<ExitCode, Failure> {
    let_stages_go_first();
    let mut signals = Signals::that_end()?;
    let Arguments { robot, listen, behind_proxy } = arguments;
    let options = Options { robot: robot.clone(), listen: *listen, proxy: behind_proxy.clone() };
    let driven = robot.clone();
    let page = Page::open(&options, Arc::new(move |order| operator::perform(&driven, order)))?;
    print_text(&format!("{}kept in {}\n", page.access.addresses(), page.kept.display()))?;
    page.show(&mut || signals.came());
    Ok(ExitCode::SUCCESS)
}
