pub mod drive;
mod ends;
mod gyro;
mod response;
mod written;

use std::{fmt::Display, path::PathBuf};

use calibration::{loops, shell::Drive, squares};
use clap::Args;
use common::{
    mission::{CalibrationPlan, Mission, Procedure, SensorKind},
    signals::Signals,
};

use self::{
    drive::{Carried, Setting},
    written::Found,
};
use console::{
    failure::{Failure, Refused, Result},
    missions,
};

/// Measure the ratio of wheel diameters, the track and the slip.
///
/// Put the robot 0.5 to 2 m in front of the middle of a flat wall 3 m wide. It faces the wall, with
/// 3 m of free floor behind it. The robot drives loops until the values are precise enough.
/// `calibrate` writes the values to a file. A mission names the file as robot.calibration.
#[derive(Debug, Args)]
pub struct Arguments {
    /// Mission whose robot to calibrate.
    ///
    /// Default: the simulated X80 with measured realism.
    mission: Option<String>,
    #[command(flatten)]
    setting: Setting,
    /// Drive squares to both sides; you measure where each ends, by tape.
    ///
    /// This needs no wall. With a simulated robot, you measure nothing.
    #[arg(long)]
    squares: bool,
    /// Calibrate by the robot's gyro, in 40 s.
    ///
    /// The robot drives forward, turns, drives back and turns. SHARE is the relative standard
    /// deviation of the gyro's scale, and becomes that of the track.
    #[arg(
        long,
        value_name = "SHARE",
        num_args = 0..=1,
        require_equals = true,
        default_missing_value = "0.01",
        value_parser = share,
        conflicts_with_all = ["squares", "response"]
    )]
    gyro: Option<f64>,
    /// Measure delay and acceleration of the base.
    ///
    /// The robot turns on the spot for 13 seconds. Prints the keys of [robot.response].
    #[arg(long, conflicts_with = "squares")]
    response: bool,
    /// Number of squares to each side.
    #[arg(long, value_name = "N", default_value_t = 5, value_parser = clap::value_parser!(u32).range(3..=50))]
    count: u32,
    /// Stop at this standard deviation of the diameter ratio.
    ///
    /// The track's standard deviation may be three times as large.
    #[arg(long, value_name = "SHARE", default_value_t = CalibrationPlan::default().ratio_sd)]
    sd: f64,
    /// Stop after N loops at the latest, each about a minute.
    #[arg(long, value_name = "N", default_value_t = CalibrationPlan::default().loops)]
    loops: u32,
    /// Distance to drive, metres.
    ///
    /// The robot drives away from the wall, with --gyro forward, with --squares along a side.
    #[arg(long, value_name = "M", default_value_t = CalibrationPlan::default().drive_m)]
    drive: f64,
    /// File to write.
    #[arg(long, value_name = "FILE", default_value = "calibration.toml")]
    out: PathBuf,
}

/// Time for one loop or one square, including repeated sweeps.
const LOOP_S: f64 = 180.0;
const SQUARE_S: f64 = 120.0;

const SIMULATED: &str = "target = [3, 0]\nsimulation.realism = 'measured'";
/// Wall one metre in front of the robot.
const WALL: &str = "[[wall]]\npoints = [[1.0, -2.5], [1.0, 2.5]]";

pub fn main(arguments: &Arguments) -> Result {
    let plan = CalibrationPlan {
        procedure: match arguments {
            Arguments { response: true, .. } => Procedure::Turns,
            Arguments { squares: true, .. } => Procedure::LeftSquare,
            Arguments { gyro: Some(_), .. } => Procedure::Gyro,
            _ => Procedure::Wall,
        },
        ratio_sd: arguments.sd,
        loops: arguments.loops,
        drive_m: arguments.drive,
    };
    arguments.setting.log("calibration.log")?;
    let mission = arguments.mission(plan)?;
    if arguments.response {
        return response::measure(arguments, &mission);
    }
    let found = match arguments.gyro {
        Some(scale_sd) => gyro::measure(arguments, &mission, scale_sd),
        None if arguments.squares => by_squares(arguments, &mission),
        None => by_wall(arguments, &mission),
    }?;
    found.write(arguments, &mission.robot.odometry)
}

impl Arguments {
    fn mission(&self, plan: CalibrationPlan) -> Result<Mission> {
        let named = match &self.mission {
            Some(name) => missions::load(name, &self.setting.set)?,
            None => missions::parsed(SIMULATED, "calibration", &self.setting.set)?,
        };
        let is_wall = plan.procedure == Procedure::Wall;
        if is_wall && named.front_sonar().kind != SensorKind::Cone {
            return Err("the wall procedure needs a front sonar, and this robot has none; calibrate along squares, or with --gyro if it has a gyro".into());
        }
        let (loops, drive_m) = (f64::from(plan.loops), plan.drive_m);
        let mut mission = self.setting.procedure(&named, plan, 0.35)?;
        mission.timeout_s = SQUARE_S.max(60.0 * drive_m);
        if is_wall {
            mission.world = toml::from_str(WALL)?;
            mission.timeout_s = LOOP_S * (loops + 2.0);
        }
        Ok(mission)
    }
}

fn share(text: &str) -> std::result::Result<f64, String> {
    text.parse()
        .ok()
        .filter(|share| (0.0..=0.1).contains(share))
        .ok_or_else(|| "give a share from 0 to 0.1: 0.01 is 1 %".to_owned())
}

fn refused(message: impl Display) -> Failure {
    Refused::new("not-calibrated", format!("nothing was written: {message}")).into()
}

fn by_wall(arguments: &Arguments, mission: &Mission) -> Result<Found> {
    let Carried { directory, seconds, .. } = arguments.setting.carry_out(mission, "calibration")?;
    let place = directory.display();
    let Some(Drive::Wall(wall)) = Drive::of_run(&directory)? else {
        return Err(refused(format_args!(
            "the planner of the run in {place} saved nothing; repeat the calibration"
        )));
    };
    wall.ended()
        .ok_or_else(|| {
            refused(format_args!("the run in {place} ended too early; repeat the calibration"))
        })?
        .map_err(refused)?;
    let estimate =
        loops::checked(&wall.loops, wall.normal_sd(), mission.body().track_m).map_err(refused)?;
    Ok(Found { method: "wall", estimate, metres: wall.metres(), seconds })
}

/// Gives each square its own noise, but the same wheels.
fn noise_of_its_own(mission: &mut Mission, number: u32) {
    let errors = x80_sim::wheel_errors::WheelErrors::of(mission);
    let wheels = &mut mission.simulation.wheels;
    wheels.diameter_ratio = Some(errors.diameter[1] / errors.diameter[0]);
    wheels.track_scale = Some(errors.track);
    wheels.slip_share = Some(errors.slip_share);
    (wheels.diameter_spread, wheels.track_spread) = (Some(0.0), Some(0.0));
    wheels.slip_share_spread = Some(0.0);
    mission.seed = mission.seed.wrapping_add(u64::from(number) << 32);
}

fn by_squares(arguments: &Arguments, base: &Mission) -> Result<Found> {
    let mut signals = Signals::that_end()?;
    let mut driven = Vec::new();
    let (mut metres, mut seconds) = (0.0, 0.0);
    let body = base.body();
    let is_simulated = base.robot.address.is_none();
    let count = 2 * arguments.count;
    for number in 1..=count {
        let (procedure, side) = match number % 2 {
            1 => (Procedure::LeftSquare, "left"),
            _ => (Procedure::RightSquare, "right"),
        };
        let mut mission = base.clone();
        if let Some(plan) = &mut mission.planner.calibration {
            plan.procedure = procedure;
        }
        noise_of_its_own(&mut mission, number);
        let title = format!("square {number} of {count}, to the {side}");
        if !is_simulated {
            ends::await_robot(&title, &mut signals)?;
        }
        let carried = arguments.setting.carry_out(&mission, &title)?;
        seconds += carried.seconds;
        let ways = squares::nominal_ways(&carried.counts, &body);
        metres += ways.iter().map(|[left, right]| left.abs() + right.abs()).sum::<f64>() / 2.0;
        let end = match carried.truth {
            Some(end) if is_simulated => end,
            _ => ends::next(&title, &mut signals)?,
        };
        driven.push(squares::Driven { ways, end });
    }
    let estimate = squares::checked(&driven, body.track_m).map_err(refused)?;
    Ok(Found { method: "squares", estimate, metres, seconds })
}
