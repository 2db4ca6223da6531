use clap::Args;
use common::domain::RobotName;

use mission_control::operator;

use console::failure::Result;

/// Resume a stopped robot.
#[derive(Debug, Args)]
pub struct Arguments {
    /// Name of the robot.
    #[arg(long, default_value_t)]
    robot: RobotName,
}

pub fn main(arguments: &Arguments) -> Result {
    Ok(operator::resume(&arguments.robot)?)
}
