mod follow;

use std::{path::Path, process::ExitCode, thread};

use clap::Args;
use common::{domain::RobotName, samples::TargetPoint};
use mission_control::{operator, outcome::Outcome};

use console::{
    failure::{Result, refuse},
    output::print_line,
    robots::Robot,
    runs::{Results, Target},
    stream::LOOK_EVERY,
};

/// Send a driving robot to one or more other targets.
///
/// The robot continues without a stop. Fails if a target is in a mapped hazard or outside the
/// perimeter, or if an operator stopped the robot. With `--follow`, a robot under `run --stay`
/// follows a beacon until Ctrl-C, and stands while the beacon is silent.
#[derive(Debug, Args)]
pub struct Arguments {
    /// X and Y of each target, metres in the mission frame.
    #[arg(required_unless_present = "follow", value_names = ["X", "Y"], num_args = 2.., allow_negative_numbers = true)]
    places: Vec<f64>,
    /// Heading at the last target, degrees counter-clockwise from x.
    #[arg(long, value_name = "DEG", allow_negative_numbers = true)]
    heading: Option<f64>,
    /// Add the targets to those that the robot has.
    #[arg(long)]
    append: bool,
    /// Follow the topic `beacon`, or a robot of this machine.
    #[arg(long, value_name = "ROBOT", num_args = 0..=1, conflicts_with_all = ["places", "heading", "append"])]
    follow: Option<Option<RobotName>>,
    /// Distance between the centres of both robots, metres.
    ///
    /// The default leaves 0.5 m between the robot and a person.
    #[arg(long, value_name = "M", requires = "follow")]
    distance: Option<f64>,
    /// Pose of the followed robot's mission frame in this robot's frame.
    ///
    /// Metres, and degrees counter-clockwise from x.
    #[arg(long, value_names = ["X", "Y", "DEG"], num_args = 3, requires = "follow", allow_negative_numbers = true)]
    frame: Vec<f64>,
    /// Wait for the last target's result and print it.
    ///
    /// Exit codes: 0 reached, 3 unreachable, 4 too late, 9 wrong place, 11 unsure, 1 anything else.
    #[arg(long, conflicts_with = "follow")]
    wait: bool,
    /// Name of the robot.
    #[arg(long, default_value_t)]
    robot: RobotName,
}

pub fn main(arguments: &Arguments) -> Result<ExitCode> {
    if let Some(followed) = &arguments.follow {
        follow::main(arguments, followed.as_ref())?;
        return Ok(ExitCode::SUCCESS);
    }
    let mut points = points(&arguments.places)?;
    if let (Some(last), Some(heading)) = (points.last_mut(), arguments.heading) {
        (last.heading_rad, last.has_heading) = (heading.to_radians(), 1);
    }
    let run = Robot::find(arguments.robot.clone()).run.filter(|_| arguments.wait);
    let results = run.as_deref().map(|run| Results::of(run, 0));
    operator::send_to(&arguments.robot, &points, arguments.append)?;
    match (run, results, points.last()) {
        (Some(run), Some(results), Some(last)) => {
            await_result(&arguments.robot, &run, results, last)
        }
        _ => Ok(ExitCode::SUCCESS),
    }
}

fn await_result(
    robot: &RobotName,
    run: &Path,
    mut results: Results,
    target: &TargetPoint,
) -> Result<ExitCode> {
    loop {
        let goes_on = Robot::find(robot.clone()).run.as_deref() == Some(run);
        let is_its = |it: &Target| (it.x_m, it.y_m) == (target.x_m, target.y_m);
        if let Some(result) = results.take().into_iter().find(is_its) {
            print_line(result.outcome.replace('_', " "))?;
            // Target outcomes share a run's names; others, such as `replaced`, have no exit code.
            let outcome = serde_json::from_value::<Outcome>(result.outcome.into());
            return Ok(outcome.map_or(ExitCode::FAILURE, |outcome| outcome.exit_code().into()));
        }
        if !goes_on {
            return Err(format!("the run of robot {robot} ended without a result").into());
        }
        thread::sleep(LOOK_EVERY);
    }
}

pub fn points(places: &[f64]) -> Result<Vec<TargetPoint>> {
    let (places, rest) = places.as_chunks::<2>();
    if !rest.is_empty() {
        return refuse(
            "no-target",
            format!("{} is an X without a Y; give two numbers for each place", rest[0]),
        );
    }
    Ok(places.iter().map(|&place| TargetPoint::at(place.into())).collect())
}
