use clap::Args;
use common::domain::RobotName;
use mission_control::operator;

use console::failure::Result;

/// Send a driving robot back to its start.
#[derive(Debug, Args)]
pub struct Arguments {
    /// Name of the robot.
    #[arg(long, default_value_t)]
    robot: RobotName,
}

pub fn main(arguments: &Arguments) -> Result {
    Ok(operator::send_back(&arguments.robot)?)
}
