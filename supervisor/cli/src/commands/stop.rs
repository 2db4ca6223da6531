//! `firsthand stop`.

use clap::Args;
use common::{domain::RobotName, samples::RequestKind};

use crate::console::{failure::Failure, operator};

/// Let the robot stand until `firsthand resume`; the mission goes on then. Fails unless the encoders confirm that it rests.
#[derive(Debug, Args)]
pub(crate) struct Arguments {
    /// Name of the robot.
    #[arg(long, default_value = "x80")]
    robot: RobotName,
    /// Only tell the supervisor, and do not wait for rest.
    #[arg(long, hide = true)]
    through_supervisor: bool,
}

pub(crate) fn main(arguments: &Arguments) -> Result<(), Failure> {
    if arguments.through_supervisor {
        return operator::ask(&arguments.robot, RequestKind::Stop, "");
    }
    operator::stand(&arguments.robot)
}
