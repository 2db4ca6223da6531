pub(super) mod drive;
mod ends;
mod response;
mod written;

use std::path::PathBuf;

use calibration::{loops, shell::Drive, squares, wall::State};
use clap::Args;
use common::{
    clock::Pace,
    domain::RobotName,
    mission::{CalibrationPlan, Mission, Procedure, SensorKind, Sensors},
    signals::{SIGHUP, SIGINT, SIGTERM, Signals},
};

use self::{
    drive::{Carried, Setting, carry_out},
    ends::Ends,
    written::{Found, Residual},
};
use console::{
    failure::{Failure, Refused},
    logging, missions,
};

/// Measure the ratio of the wheels' diameters, the track and the slip of a robot, or how its base responds.
///
/// Put the robot 0.5 to 2 m before the middle of a flat wall 3 m wide, facing it, with 3 m of free floor behind it. It drives loops until
/// the values are good enough, and writes them into a file, which a mission names as robot.calibration.
#[derive(Debug, Args)]
pub(crate) struct Arguments {
    /// A mission whose robot is calibrated. By default the simulated one with measured realism.
    mission: Option<String>,
    /// Name of the robot, which also names its shared memory.
    #[arg(long, default_value = "x80")]
    robot: RobotName,
    /// Loops before a wall: the default.
    #[arg(long, conflicts_with = "squares")]
    wall: bool,
    /// Squares to both sides, whose ends are measured by tape. The ends of a simulated robot are known.
    #[arg(long)]
    squares: bool,
    /// The delay and the acceleration of the base, by ten seconds of turns on the spot. Prints the keys of [robot.response].
    #[arg(long, conflicts_with_all = ["wall", "squares"])]
    response: bool,
    /// Read the ends of the squares from FILE instead of standard input: x and y in a line, metres ahead and to the left of the mark.
    #[arg(long, value_name = "FILE", requires = "squares")]
    ends: Option<PathBuf>,
    /// Squares to each side.
    #[arg(long, value_name = "N", default_value_t = 5, value_parser = clap::value_parser!(u32).range(3..=50))]
    count: u32,
    /// Mission time of a simulated robot: `max`, or R times wall-clock.
    #[arg(long, default_value = "max")]
    pace: Pace,
    /// Seed of everything random in the simulation, instead of the mission's.
    #[arg(long)]
    seed: Option<u64>,
    /// Stop when the standard deviation of the ratio is no more than this, and that of the track no more than three times this.
    #[arg(long, value_name = "SHARE", default_value_t = CalibrationPlan::default().ratio_sd)]
    sd: f64,
    /// Stop after so many loops, however good the values are; each takes about a minute.
    #[arg(long, value_name = "N", default_value_t = CalibrationPlan::default().loops)]
    loops: u32,
    /// The way from the wall, or the side of a square, metres.
    #[arg(long, value_name = "M", default_value_t = CalibrationPlan::default().drive_m)]
    drive: f64,
    /// Set a key of the mission, as often as needed.
    #[arg(long, value_name = "KEY=VALUE")]
    set: Vec<String>,
    /// The file to write.
    #[arg(long, value_name = "FILE", default_value = "calibration.toml")]
    out: PathBuf,
    /// The directory in which the directories of runs are.
    #[arg(long, value_name = "DIR", default_value = "runs")]
    runs: PathBuf,
    /// Print one line of JSON, and nothing else on standard output.
    #[arg(long)]
    json: bool,
}

/// One loop or one square, with room for repeated sweeps.
const LOOP_S: f64 = 180.0;
const SQUARE_S: f64 = 120.0;

/// A metre before a wall. The target is beside the place where the robot sweeps: only the planner ends the run.
const SIMULATED: &str = "target = [0.3, 0]\nsimulation.realism = 'measured'";
const WALL: &str = "[[wall]]\npoints = [[1.0, -2.5], [1.0, 2.5]]";

pub(crate) fn main(arguments: &Arguments) -> Result<(), Failure> {
    let plan = CalibrationPlan {
        procedure: match arguments {
            Arguments { response: true, .. } => Procedure::Turns,
            Arguments { squares: true, .. } => Procedure::LeftSquare,
            _ => Procedure::Wall,
        },
        ratio_sd: arguments.sd,
        loops: arguments.loops,
        drive_m: arguments.drive,
    };
    logging::to_file(&arguments.log()?, "info")?;
    if arguments.response {
        return response::measure(arguments, plan);
    }
    let found =
        if arguments.squares { by_squares(arguments, &plan) } else { by_wall(arguments, plan) }?;
    found.write(&arguments.out)?;
    found.print(&arguments.out, arguments.json)
}

impl Arguments {
    fn setting(&self) -> Setting<'_> {
        Setting { robot: &self.robot, pace: self.pace, runs: &self.runs }
    }

    /// One log for all runs of a calibration.
    fn log(&self) -> Result<PathBuf, Failure> {
        std::fs::create_dir_all(&self.runs)
            .map_err(|error| format!("cannot make {}: {error}", self.runs.display()))?;
        Ok(self.runs.join("calibration.log"))
    }

    /// The robot of the named mission, and nothing else of it.
    fn mission(&self, plan: CalibrationPlan) -> Result<Mission, Failure> {
        let named = match &self.mission {
            Some(name) => missions::load(name, &self.set)?,
            None => missions::parsed(SIMULATED, "calibration", &self.set)?,
        };
        if named.body().steering.is_some() {
            return Err(
                "a car has no two driven wheels to calibrate; name a mission of an X80".into()
            );
        }
        if plan.procedure == Procedure::Wall && named.front_sonar().kind != SensorKind::Cone {
            return Err("the wall is measured by a front sonar, and this robot has none: calibrate along squares".into());
        }
        let mut mission = missions::parsed(SIMULATED, "calibration", &[])?;
        mission.robot = named.robot;
        mission.sonar = named.sonar;
        mission.simulation = named.simulation;
        mission.seed = self.seed.unwrap_or(named.seed);
        mission.sensors = Some(Sensors::Front);
        mission.arrival_tolerance_m = 0.05;
        if plan.procedure == Procedure::Wall {
            mission.world = toml::from_str(WALL)?;
            mission.timeout_s = LOOP_S * (f64::from(plan.loops) + 2.0);
        } else {
            // Nothing answers on free floor, so no sonar is judged.
            mission.sensing = false;
            mission.timeout_s = SQUARE_S.max(60.0 * plan.drive_m);
        }
        mission.planner.executable = Some(calibration::PLANNER.into());
        mission.planner.calibration = Some(plan);
        mission.controller.speed_m_s = Some(0.35);
        // The robot turns many times at one place, which is no stall.
        mission.controller.turn_rad_s = Some(0.1);
        mission.controller.look_rad_s = Some(1.5);
        mission.controller.slow_radius_m = 0.01;
        // The mission is checked like one that a person wrote.
        Ok(missions::parsed(&toml::to_string(&mission)?, "calibration", &[])?)
    }
}

fn refused(message: &str) -> Failure {
    Refused::new("not-calibrated", format!("nothing was written: {message}")).into()
}

fn by_wall(arguments: &Arguments, plan: CalibrationPlan) -> Result<Found, Failure> {
    let mission = arguments.mission(plan)?;
    let body = mission.body();
    let before = mission.robot.odometry.clone();
    let Carried { directory, seconds, .. } =
        carry_out(arguments.setting(), mission, "calibration")?;
    let place = directory.display();
    let Some(Drive::Wall(wall)) = Drive::of_run(&directory)? else {
        return Err(refused(&format!(
            "the planner of the run in {place} saved nothing; repeat it"
        )));
    };
    match wall.state() {
        State::Finished => {}
        State::Failed(fault) => return Err(refused(&fault.to_string())),
        State::Running => {
            return Err(refused(&format!("the run in {place} ended too early; repeat it")));
        }
    }
    let (estimate, used) = loops::checked(wall.loops(), wall.normal_sd(), body.track_m)
        .map_err(|refusal| refused(&refusal.to_string()))?;
    let residual = |(it, residual): (&loops::Loop, &f64)| Residual {
        number: it.number,
        to_the_left: it.turns > 0.0,
        deviations: *residual,
    };
    let residuals = used.iter().zip(&estimate.residuals).map(residual).collect();
    let robot = arguments.robot.to_string();
    let metres = wall.metres();
    Ok(Found { robot, method: "wall", before, estimate, metres, seconds, residuals, directory })
}

/// A square has noise of its own, and the wheels of all squares.
fn noise_of_its_own(mission: &mut Mission, number: u32) {
    let errors = x80_sim::wheel_errors::WheelErrors::of(mission);
    let wheels = &mut mission.simulation.wheels;
    wheels.diameter_ratio = Some(errors.diameter.right / errors.diameter.left);
    wheels.track_scale = Some(errors.track);
    wheels.slip_share = Some(errors.slip_share);
    (wheels.diameter_spread, wheels.track_spread) = (Some(0.0), Some(0.0));
    wheels.slip_share_spread = Some(0.0);
    mission.seed = mission.seed.wrapping_add(u64::from(number) << 32);
}

fn by_squares(arguments: &Arguments, plan: &CalibrationPlan) -> Result<Found, Failure> {
    let mut ends = Ends::open(arguments.ends.as_deref())?;
    let mut signals = Signals::catch(&[SIGINT, SIGTERM, SIGHUP])?;
    let mut driven = Vec::new();
    let (mut metres, mut seconds, mut last) = (0.0, 0.0, None);
    let count = 2 * arguments.count;
    for number in 1..=count {
        let to_the_left = number % 2 == 1;
        let procedure = if to_the_left { Procedure::LeftSquare } else { Procedure::RightSquare };
        let mut mission = arguments.mission(CalibrationPlan { procedure, ..plan.clone() })?;
        noise_of_its_own(&mut mission, number);
        let is_simulated = mission.robot.address.is_none() && arguments.ends.is_none();
        let body = mission.body();
        let before = mission.robot.odometry.clone();
        let title = format!(
            "square {number} of {count}, to the {}",
            if to_the_left { "left" } else { "right" }
        );
        if !is_simulated {
            ends.await_robot(&title, &mut signals)?;
        }
        let carried = carry_out(arguments.setting(), mission, &title)?;
        let Carried { directory, counts, truth, .. } = carried;
        seconds += carried.seconds;
        let ways = squares::nominal_ways(&counts, &body);
        metres += ways.iter().map(|[left, right]| left.abs() + right.abs()).sum::<f64>() / 2.0;
        let end = match truth {
            Some(end) if is_simulated => end,
            _ => ends.next(&title, &mut signals)?,
        };
        driven.push(squares::Driven { ways, end });
        last = Some((before, directory, body.track_m));
    }
    let (before, directory, track_m) = last.ok_or("no square was driven")?;
    let estimate =
        squares::checked(&driven, track_m).map_err(|refusal| refused(&refusal.to_string()))?;
    let residual = |(number, deviations): (u32, &f64)| Residual {
        number,
        to_the_left: number % 2 == 1,
        deviations: *deviations,
    };
    let residuals = (1..).zip(&estimate.residuals).map(residual).collect();
    let robot = arguments.robot.to_string();
    Ok(Found { robot, method: "squares", before, estimate, metres, seconds, residuals, directory })
}
