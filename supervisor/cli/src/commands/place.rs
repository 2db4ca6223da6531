use clap::Args;
use common::{domain::RobotName, samples::TargetPoint};
use mission_control::operator;

use console::failure::Result;

/// Set the pose of a standing robot.
///
/// The robot forgets earlier sensor data. Fails unless the robot stands, or if the place is outside
/// the perimeter.
#[derive(Debug, Args)]
pub struct Arguments {
    /// X in the mission frame, metres.
    #[arg(allow_negative_numbers = true)]
    x: f64,
    /// Y in the mission frame, metres.
    #[arg(allow_negative_numbers = true)]
    y: f64,
    /// Heading, degrees counter-clockwise from x.
    #[arg(allow_negative_numbers = true)]
    heading: f64,
    /// Standard deviation of X and of Y, metres.
    #[arg(long, value_name = "M", default_value = "0.05")]
    sigma: f64,
    /// Standard deviation of HEADING, degrees.
    #[arg(long, value_name = "DEG", default_value = "3")]
    sigma_heading: f64,
    /// Name of the robot.
    #[arg(long, default_value_t)]
    robot: RobotName,
}

pub fn main(arguments: &Arguments) -> Result {
    let Arguments { x, y, heading, sigma, sigma_heading, robot } = arguments;
    let heading_rad = heading.to_radians();
    let point = TargetPoint { x_m: *x, y_m: *y, heading_rad, has_heading: 1 };
    Ok(operator::place(robot, point, [*sigma, sigma_heading.to_radians()])?)
}
