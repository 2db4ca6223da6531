use clap::Args;
use common::domain::RobotName;
use mission_control::operator;

use super::goto::points;
use console::failure::Result;

/// Add a keep-out zone to a running robot, or remove zones.
///
/// A zone is a polygon that the body may not enter. Sensors do not see it, and the mission file
/// does not change. Fails if the robot's body touches the zone.
#[derive(Debug, Args)]
pub struct Arguments {
    /// X and Y of each corner, metres in the mission frame.
    #[arg(required = true, value_names = ["X", "Y"], num_args = 2.., allow_negative_numbers = true)]
    places: Vec<f64>,
    /// Remove the zones that contain the point X Y instead.
    #[arg(long)]
    remove: bool,
    /// Name of the robot.
    #[arg(long, default_value_t)]
    robot: RobotName,
}

pub fn main(arguments: &Arguments) -> Result {
    let Arguments { places, remove, robot } = arguments;
    Ok(operator::change_zones(robot, &points(places)?, *remove)?)
}
