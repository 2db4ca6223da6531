use clap::Args;
use common::domain::{Domain, RobotName};

use console::{failure::Result, operator};

/// Let the robot stand until `firsthand resume`; the mission goes on then. Fails unless the encoders confirm that it rests.
///
/// The link obeys directly, whatever is wrong with the supervisor or with shared memory. Where no link is left, this command
/// tells the robot of the last run to stand.
#[derive(Debug, Args)]
pub struct Arguments {
    /// Name of the robot.
    #[arg(long, default_value = "x80")]
    robot: RobotName,
    /// Do nothing where no run was cut off. This is for services of systemd.
    #[arg(long)]
    cut_off: bool,
    /// Only tell the supervisor of a stop that was asked at this time of the monotonic clock, and do not wait for rest.
    #[arg(long, hide = true, value_name = "NS")]
    through_supervisor: Option<u64>,
}

pub fn main(arguments: &Arguments) -> Result {
    if arguments.cut_off && !Domain::of(arguments.robot.clone()).run_directory().exists() {
        return Ok(());
    }
    if let Some(asked_ns) = arguments.through_supervisor {
        return Ok(mission_control::operator::request_stop(&arguments.robot, asked_ns)?);
    }
    operator::stand(&arguments.robot)
}
