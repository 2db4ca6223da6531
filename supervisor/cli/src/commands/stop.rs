//! `firsthand stop`.

use clap::Args;
use common::domain::RobotName;

use crate::console::{failure::Failure, operator};

/// Let the robot stand until `firsthand resume`; the mission goes on then. Fails unless the encoders confirm that it rests.
#[derive(Debug, Args)]
pub(crate) struct Arguments {
    /// Name of the robot.
    #[arg(long, default_value = "x80")]
    robot: RobotName,
}

pub(crate) fn main(arguments: &Arguments) -> Result<(), Failure> {
    operator::stand(&arguments.robot)
}
