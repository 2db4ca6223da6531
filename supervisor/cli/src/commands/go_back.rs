use clap::Args;
use common::domain::RobotName;
use mission_control::operator;

use console::failure::Failure;

/// Send a robot that drives back to its start.
#[derive(Debug, Args)]
pub(crate) struct Arguments {
    /// Name of the robot.
    #[arg(long, default_value = "x80")]
    robot: RobotName,
}

pub(crate) fn main(arguments: &Arguments) -> Result<(), Failure> {
    Ok(operator::send_back(&arguments.robot)?)
}
