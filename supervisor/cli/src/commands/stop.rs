use clap::Args;
use common::domain::{Domain, RobotName};

use console::{failure::Result, operator};

/// Let the robot stand until `firsthand resume`; the mission goes on then. Fails unless the encoders confirm that it rests.
///
/// The link obeys directly, whatever is wrong with the supervisor or with shared memory. Where no link is left, the robot's stop guard
/// orders the stop until the encoders show rest; this command starts a guard that is missing.
#[derive(Debug, Args)]
pub struct Arguments {
    /// Name of the robot.
    #[arg(long, default_value = "x80")]
    robot: RobotName,
    /// Sign the robot off: you saw that it rests, or it is off. Its stop guard then ends. Refused while a run lasts.
    #[arg(long, conflicts_with = "cut_off")]
    sign_off: bool,
    /// Do nothing where no run was cut off. This is for services of systemd.
    #[arg(long)]
    cut_off: bool,
    /// Only tell the supervisor of a stop that was asked at this time of the monotonic clock, and do not wait for rest.
    #[arg(long, hide = true, value_name = "NS")]
    through_supervisor: Option<u64>,
}

pub fn main(arguments: &Arguments) -> Result {
    if arguments.cut_off
        && !Domain::of(arguments.robot.clone()).run_directory().exists()
        && !mission_control::operator::owes_stop(&arguments.robot)
    {
        return Ok(());
    }
    if arguments.sign_off {
        return Ok(mission_control::operator::sign_off(&arguments.robot)?);
    }
    if let Some(asked_ns) = arguments.through_supervisor {
        return Ok(mission_control::operator::request_stop(&arguments.robot, asked_ns)?);
    }
    operator::stand(&arguments.robot)
}
