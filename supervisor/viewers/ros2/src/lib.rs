//! `firsthand ros2`: the topics of a robot for RViz and other nodes of ROS 2, and the requests that nodes may make. It is a consumer,
//! which anyone may kill.
//!
//! | module | holds |
//! |---|---|
//! | `topics` | THE table of topics |
//! | `shown` | samples of the robot's bus to messages, pure |
//! | `asked` | messages that ask for something to what they ask, pure |
//! | `drift` | the covariances of odometry, pure |
//! | `frames` | the frames of `/tf`, pure |
//! | `goals` | the goals of any action, pure |
//! | `action` | the server of the action `navigate_to_pose`, pure |
//! | `messages` | the messages that are written |
//! | `bag` | a bag of rosbag2 from a recording |
//! | `bridge` | the bridge itself |
//! | `endpoints` | its readers and writers |
//! | `node` | readers, writers and servers of actions as a node that `ros2 node list` shows |
//! | `planner` | Nav2's planner server, which is no bridge |
//! | `parameters` | the options as parameters, for `ros2 param`, pure |
//! | `overlap` | whether it would publish what the robot's own link reads |
//! | `orders` | what was asked is done, without holding up the bridge |

// No other crate uses these modules: `pub` means another module; what none uses is reported.
#![allow(unreachable_pub)]

mod action;
mod asked;
mod bag;
mod bridge;
mod drift;
mod endpoints;
mod frames;
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

use std::{net::Ipv4Addr, process::ExitCode};

use clap::{CommandFactory as _, Parser, Subcommand};
use common::{address::domain_of_environment, domain::RobotName, signals::Signals};

use console::{
    executable, failure::Failure, item::item, output::print_text, stream::let_stages_go_first,
};

use self::{
    bridge::{Options, serve},
    topics::{Accept, Frames, Spec, TABLE},
};

/// Show a robot in ROS 2: to RViz, to other nodes, to other machines. `--topics` lists its topics.
///
/// It is a consumer: it may be killed, and started again. Nobody may ask anything of the robot unless --accept says what. DDS has
/// no authentication here: whoever reaches the domain may do it. The robot's link is no part of it.
#[derive(Debug, Parser)]
#[command(name = "firsthand-ros2", version)]
pub struct Arguments {
    /// Name of the robot; it need not run yet.
    #[arg(long, default_value = "x80")]
    robot: RobotName,
    /// The domain of ROS, 0 to 232, instead of that which `ROS_DOMAIN_ID` names.
    #[arg(long, global = true, value_parser = clap::value_parser!(u16).range(0..=232))]
    domain: Option<u16>,
    /// The address of the only network interface to use. Without it, this machine's own with `ROS_LOCALHOST_ONLY=1`, else all.
    #[arg(long, global = true, value_name = "ADDRESS")]
    interface: Option<Ipv4Addr>,
    /// The namespace of all topics, `tf` too. A robot that speaks ROS 2 itself publishes `/tf` and `/odom`, so give it one.
    #[arg(long, global = true, default_value = "", value_parser = namespace)]
    namespace: String,
    /// What `tf` has: all frames, or that of the map alone where another node publishes `odom` to `base_link`. Topics that the robot's
    /// own link reads are then left to the robot.
    #[arg(long, value_enum, default_value_t)]
    frames: Frames,
    /// Stamp all messages with mission time, and publish it as `/clock`: for nodes with `use_sim_time` beside a simulated robot.
    #[arg(long)]
    clock: bool,
    /// Print the table of its topics, and nothing else.
    #[arg(long)]
    topics: bool,
    /// Print a configuration for RViz, and nothing else; the topics there have no namespace.
    #[arg(long)]
    rviz: bool,
    /// What others may do.
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

/// A namespace of ROS: names of letters, digits and `_` between slashes.
fn namespace(text: &str) -> Result<String, String> {
    let is_letter = |letter: char| letter.is_ascii_alphanumeric() || letter == '_';
    let is_name = |name: &str| !name.is_empty() && name.chars().all(is_letter);
    let path = text.trim_matches('/');
    if path.is_empty() || path.split('/').all(is_name) {
        Ok(path.to_owned())
    } else {
        Err("no namespace of ROS; give letters, digits and _, such as robots/one".to_owned())
    }
}

pub fn main() -> ExitCode {
    // Refused requests of other nodes are logged.
    executable::run("warn,rustdds=off", show)
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

fn show(arguments: &Arguments) -> Result<ExitCode, Failure> {
    if arguments.topics {
        print_text(&topics())?;
        return Ok(ExitCode::SUCCESS);
    }
    if arguments.rviz {
        print_text(RVIZ)?;
        return Ok(ExitCode::SUCCESS);
    }
    if let Some(Command::Bag(options)) = &arguments.command {
        let_stages_go_first();
        print_text(&bag::make(&arguments.namespace, options)?)?;
        return Ok(ExitCode::SUCCESS);
    }
    let mut signals = Signals::that_end()?;
    let domain = arguments.domain.map_or_else(domain_of_environment, Ok)?;
    let mut command = Arguments::command();
    let matches = command.get_matches_mut();
    let parameters = parameters::of_options(&command, &matches);
    if let Some(Command::Planner(options)) = &arguments.command {
        let network = (domain, arguments.interface, arguments.namespace.as_str());
        planner::serve(network, (options, parameters), &mut || signals.came())?;
        return Ok(ExitCode::SUCCESS);
    }
    let_stages_go_first();
    let options = Options {
        robot: arguments.robot.clone(),
        domain,
        interface: arguments.interface,
        namespace: arguments.namespace.clone(),
        accepted: arguments.accept.clone(),
        frames: arguments.frames,
        clock: arguments.clock,
        parameters,
    };
    serve(&options, &mut || signals.came())?;
    Ok(ExitCode::SUCCESS)
}
