use clap::Args;
use common::domain::RobotName;

use console::{failure::Result, operator};

/// Stop the robot; `firsthand resume` continues the mission.
///
/// Fails unless the encoders confirm rest. The link obeys directly, even if supervisor or shared
/// memory fail. Without a link, the robot's stop guard orders the stop until the encoders show
/// rest. Starts a missing guard.
#[derive(Debug, Args)]
pub struct Arguments {
    /// Name of the robot.
    #[arg(long, default_value_t)]
    robot: RobotName,
    /// End the stop guard: you saw the robot at rest, or off.
    ///
    /// During a run, this is refused.
    #[arg(long, conflicts_with = "cut_off")]
    sign_off: bool,
    /// Do nothing unless a run was cut off.
    ///
    /// For systemd services.
    #[arg(long)]
    cut_off: bool,
    /// Only tell the supervisor of a stop at monotonic time NS.
    ///
    /// Does not wait for rest.
    #[arg(long, hide = true, value_name = "NS")]
    through_supervisor: Option<u64>,
}

pub fn main(arguments: &Arguments) -> Result {
    if arguments.cut_off
        && !arguments.robot.domain().run_directory().exists()
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
