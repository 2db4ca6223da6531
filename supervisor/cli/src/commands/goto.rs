use clap::Args;
use common::{domain::RobotName, samples::TargetPoint};
use mission_control::operator;

use console::failure::{Refused, Result};

/// Send a robot that drives to another target, or to several in turn; it goes on without a stop. Fails if the supervisor
/// refuses: a place in a believed hazard or outside the perimeter, a robot that an operator stopped.
#[derive(Debug, Args)]
pub struct Arguments {
    /// X and Y of each target, metres in the mission frame.
    #[arg(required = true, value_names = ["X", "Y"], num_args = 2.., allow_negative_numbers = true)]
    places: Vec<f64>,
    /// Turn to this heading at the last target, degrees counter-clockwise from x.
    #[arg(long, value_name = "DEG", allow_negative_numbers = true)]
    heading: Option<f64>,
    /// After the targets that the robot has, instead of them.
    #[arg(long)]
    append: bool,
    /// Name of the robot.
    #[arg(long, default_value = "x80")]
    robot: RobotName,
}

pub fn main(arguments: &Arguments) -> Result {
    let mut points = points(&arguments.places)?;
    if let (Some(last), Some(heading)) = (points.last_mut(), arguments.heading) {
        (last.heading_rad, last.has_heading) = (heading.to_radians(), 1);
    }
    Ok(operator::send_to(&arguments.robot, &points, arguments.append)?)
}

/// Of pairs of numbers.
pub fn points(places: &[f64]) -> Result<Vec<TargetPoint>, Refused> {
    let (places, rest) = places.as_chunks::<2>();
    if !rest.is_empty() {
        let message = format!("{} is an X without a Y; give two numbers for each place", rest[0]);
        return Err(Refused::new("no-target", message));
    }
    let point = |&[x_m, y_m]: &[f64; 2]| TargetPoint { x_m, y_m, ..TargetPoint::default() };
    Ok(places.iter().map(point).collect())
}
