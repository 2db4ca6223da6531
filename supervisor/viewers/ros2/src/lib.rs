//! `firsthand ros2`: a robot's topics and requests for RViz and other ROS 2 nodes. It is a
//! consumer, which may be killed.

// `pub` marks use by another module.
#![allow(unreachable_pub)]

mod action;
mod asked;
mod bag;
mod bridge;
mod drift;
mod endpoints;
mod goals;
mod messages;
mod node;
mod orders;
mod overlap;
mod parameters;
mod planner;
mod shown;
#[cfg(test)]
mod tests;
mod topics;

use std::net::Ipv4Addr;

use clap::{CommandFactory as _, Parser, Subcommand};
use common::{address::domain_of_environment, domain::RobotName, signals::Signals};

use console::{failure::Result, item::item, output::print_text, stream::let_stages_go_first};

use self::topics::{Accept, Frames, Spec, TABLE};

/// Show a robot in ROS 2, to RViz and other nodes.
///
/// `--topics` lists its topics. You may kill and restart the bridge at any time. Nodes may only
/// request what --accept permits. DDS has no authentication here: everyone who reaches the domain
/// may make these requests. The robot's link is outside the domain.
#[derive(Debug, Parser)]
#[command(name = "firsthand-ros2", version)]
pub struct Arguments {
    /// Name of the robot, which may start later.
    #[arg(long, default_value = "x80")]
    robot: RobotName,
    /// ROS domain, 0 to 232. Default: `ROS_DOMAIN_ID`.
    #[arg(long, global = true, value_parser = clap::value_parser!(u16).range(0..=232))]
    domain: Option<u16>,
    /// Address of the only network interface to use. Default: loopback with `ROS_LOCALHOST_ONLY=1`,
    /// else all.
    #[arg(long, global = true, value_name = "ADDRESS")]
    interface: Option<Ipv4Addr>,
    /// Namespace of all topics, including `tf`. A robot that speaks ROS 2 publishes `/tf` and
    /// `/odom`, so give it one.
    #[arg(long, global = true, default_value = "", value_parser = namespace)]
    namespace: String,
    /// Frames in `tf`. Choose `map` if another node publishes `odom` to `base_link`; the bridge
    /// then omits topics that the robot's own link reads.
    #[arg(long, value_enum, default_value_t)]
    frames: Frames,
    /// Stamp messages with mission time, and publish it as `/clock`. For nodes with `use_sim_time`.
    #[arg(long)]
    clock: bool,
    /// Only print the table of topics.
    #[arg(long)]
    topics: bool,
    /// Only print a configuration for RViz, without a namespace.
    #[arg(long)]
    rviz: bool,
    /// Requests that other nodes may make, separated by commas.
    #[arg(long, value_delimiter = ',', value_name = "LIST")]
    accept: Vec<Accept>,
    #[command(subcommand)]
    command: Option<Command>,
}

const RVIZ: &str = include_str!("../firsthand.rviz");

#[derive(Debug, Subcommand)]
enum Command {
    Planner(planner::Arguments),
    Bag(bag::Arguments),
}

/// Parses a ROS namespace: names of letters, digits and `_` between slashes.
fn namespace(text: &str) -> Result<String, String> {
    let is_letter = |letter: char| letter.is_ascii_alphanumeric() || letter == '_';
    let is_name = |name: &str| !name.is_empty() && name.chars().all(is_letter);
    let path = text.trim_matches('/');
    if path.is_empty() || path.split('/').all(is_name) {
        Ok(path.to_owned())
    } else {
        Err("not a ROS namespace; give letters, digits and _, such as robots/one".to_owned())
    }
}

pub fn topics() -> String {
    let row = |spec: &Spec| {
        let [package, message] = spec.message;
        let way = match spec.accepted_by {
            None => String::new(),
            Some(by) => format!("taken with `--accept {}`; ", format!("{by:?}").to_lowercase()),
        };
        item(&format!("`{}` (`{package}/{message}`): {way}{}", spec.name, spec.meaning))
    };
    TABLE.iter().map(row).collect()
}

pub fn show(arguments: &Arguments) -> Result {
    let text = match &arguments.command {
        _ if arguments.topics => topics(),
        _ if arguments.rviz => RVIZ.to_owned(),
        Some(Command::Bag(options)) => {
            let_stages_go_first();
            bag::make(&arguments.namespace, options)?
        }
        Some(Command::Planner(_)) | None => return join(arguments),
    };
    print_text(text)
}

fn join(arguments: &Arguments) -> Result {
    let mut signals = Signals::that_end()?;
    let domain = arguments.domain.map_or_else(domain_of_environment, Ok)?;
    let mut command = Arguments::command();
    let matches = command.get_matches_mut();
    let parameters = parameters::of_options(&command, &matches);
    let network = (domain, arguments.interface, arguments.namespace.as_str());
    let mut ended = || signals.came();
    if let Some(Command::Planner(options)) = &arguments.command {
        planner::serve(network, (options, parameters), &mut ended)?;
    } else {
        let_stages_go_first();
        bridge::serve(network, (arguments, parameters), &mut ended)?;
    }
    Ok(())
}
