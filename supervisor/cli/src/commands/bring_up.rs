//! `firsthand bring-up`: a new robot against its mission file, a verdict a line.

mod written;

use std::{fs, path::PathBuf};

use bring_up::{Finding, Placed, Trace, Verdict, findings};
use clap::{Args, ValueEnum};
use common::{
    clock::Pace,
    domain::RobotName,
    file::{FileError, replace},
    mission::{CalibrationPlan, Mission, Procedure, Protocol},
    samples::{CountsSample, WheelSample},
    topics::{COMMAND, COUNTS, IMU_TURN, RANGES, SCAN, WHEELS},
};
use console::{
    consent,
    failure::{Failure, Refused},
    logging, missions,
    output::{print_text, write_stderr},
};
use picture::{Chart, Mark, Series};
use recording::{Recording, RecordingError};
use serde_json::json;

use super::calibrate::drive::{Carried, Setting, carry_out};
use common::driver::counts::WheelCounts;

/// Compare a new robot with its mission file: wheels, gyro, laser, rangers, response. Says what to mend, and the keys to change.
///
/// Put the robot on a free floor, 1 to 2 m before a wall, with walls or things around it. It stands, turns one and a half times to each
/// side, drives 0.3 m there and back, and turns to and fro: about a minute.
#[derive(Debug, Args)]
pub(crate) struct Arguments {
    /// A mission file with the robot. By default the simulated X80, or one that is written for --protocol.
    mission: Option<String>,
    /// Write a mission for a new robot that speaks this protocol to --out, and bring that up.
    #[arg(long, value_enum, conflicts_with = "mission", requires = "address")]
    protocol: Option<Spoken>,
    /// The address of the robot, as robot.address has it.
    #[arg(long, requires = "protocol")]
    address: Option<String>,
    /// The mission that --protocol writes.
    #[arg(long, value_name = "FILE", default_value = "robot.toml")]
    out: PathBuf,
    /// The wheels are in the air: look at motors and encoders alone.
    #[arg(long)]
    lifted: bool,
    /// Write the keys that were found into the mission file.
    #[arg(long, requires = "mission")]
    write: bool,
    /// Let the robot move without asking.
    #[arg(long, short)]
    yes: bool,
    /// Name of the robot, which also names its shared memory.
    #[arg(long, default_value = "x80")]
    robot: RobotName,
    /// Mission time of a simulated robot: `max`, or R times wall-clock.
    #[arg(long)]
    pace: Option<Pace>,
    /// Seed of everything random in the simulation, instead of the mission's.
    #[arg(long)]
    seed: Option<u64>,
    /// Set a key of the mission, as often as needed.
    #[arg(long, value_name = "KEY=VALUE")]
    set: Vec<String>,
    /// The directory in which the directories of runs are.
    #[arg(long, value_name = "DIR", default_value = "runs")]
    runs: PathBuf,
    /// Print one line of JSON, and nothing else on standard output.
    #[arg(long)]
    json: bool,
}

#[derive(Clone, Copy, Debug, ValueEnum)]
enum Spoken {
    X80,
    Json,
    Arduino,
    Ros2,
}

impl From<Spoken> for Protocol {
    fn from(spoken: Spoken) -> Self {
        match spoken {
            Spoken::X80 => Self::X80,
            Spoken::Json => Self::Json,
            Spoken::Arduino => Self::Arduino,
            Spoken::Ros2 => Self::Ros2,
        }
    }
}

const SIMULATED: &str = "target = [1.5, 0]\nsimulation.realism = 'measured'\nsensors = 'all'\n[perimeter]\nwidth_m = 6.0\ncentre = [0.0, 0.0]\n[[world.wall]]\npoints = [[1.3, -1.6], [1.3, 1.2], [-0.4, 1.6], [-1.5, 0.4], [-1.2, -1.6], [1.3, -1.6]]\n";

pub(crate) fn main(arguments: &Arguments) -> Result<(), Failure> {
    fs::create_dir_all(&arguments.runs)
        .map_err(|error| format!("cannot make {}: {error}", arguments.runs.display()))?;
    logging::to_file(&arguments.runs.join("bring-up.log"), "info")?;
    let named = arguments.named()?;
    if named.body().steering.is_some() {
        return Err("a car does not turn on the spot, which a bring-up is made of".into());
    }
    let is_real = named.robot.address.is_some();
    if is_real && !arguments.yes {
        consent::ask(
            "the robot will turn on the spot and drive 0.3 m there and back",
            "Is the floor free for 1 m around it?",
        )?;
    }
    let mission = arguments.procedure(&named)?;
    let pace = arguments.pace.unwrap_or(if is_real { Pace::Rate(1.0) } else { Pace::Max });
    let setting = Setting { robot: &arguments.robot, pace, runs: &arguments.runs };
    let Carried { directory, .. } = carry_out(setting, mission, "bring-up")?;
    let trace = read(&named, &Recording::open(&directory.join("recording.mcap"))?)?;
    let (found, placed) = findings(&named, &trace, arguments.lifted);
    let picture = directory.join("bring-up.svg");
    fs::write(&picture, drawn(placed.as_ref())).map_err(FileError::of("write", &picture))?;
    if arguments.json {
        let object = json!({
            "findings": found.iter().map(as_json).collect::<Vec<_>>(),
            "picture": picture,
            "directory": directory,
        });
        print_text(&format!("{object}\n"))?;
    } else {
        for finding in &found {
            print_text(&line(finding))?;
        }
        print_text(&format!("picture: {}\n", picture.display()))?;
    }
    let file = arguments.mission.as_deref().filter(|_| arguments.write);
    let keys: Vec<_> = found.iter().flat_map(|finding| finding.keys.iter()).collect();
    if let Some(file) = file
        && !keys.is_empty()
    {
        let text = written::with_keys(&Mission::read(file.as_ref())?, &keys)?;
        replace(file.as_ref(), text).map_err(FileError::of("write", file.as_ref()))?;
        write_stderr(&format!("firsthand: {} keys were written to {file}\n", keys.len()));
    }
    let wrong = found.iter().filter(|finding| finding.verdict == Verdict::Wrong).count();
    match wrong {
        0 => Ok(()),
        _ => Err(Refused::new(
            "not-as-stated",
            format!("{wrong} things are not as the mission states; mend them or change the keys, then repeat"),
        )
        .into()),
    }
}

impl Arguments {
    fn named(&self) -> Result<Mission, Failure> {
        let mut named = match (&self.mission, self.protocol, &self.address) {
            (Some(name), ..) => missions::load(name, &self.set)?,
            (None, Some(protocol), Some(address)) => {
                let text = written::new_robot(protocol.into(), address);
                let mission = missions::parsed(&text, "bring-up", &self.set)?;
                if self.out.exists() {
                    let out = self.out.display();
                    return Err(
                        format!("{out} exists; bring it up: firsthand bring-up {out}").into()
                    );
                }
                replace(&self.out, text).map_err(FileError::of("write", &self.out))?;
                write_stderr(&format!(
                    "firsthand: wrote {}; correct its sizes and sensors\n",
                    self.out.display()
                ));
                mission
            }
            _ => missions::parsed(SIMULATED, "bring-up", &self.set)?,
        };
        named.seed = self.seed.unwrap_or(named.seed);
        Ok(named)
    }

    /// The robot of `named` in the procedure.
    fn procedure(&self, named: &Mission) -> Result<Mission, Failure> {
        let mut mission = named.clone();
        mission.name = "bring-up".into();
        // Only the procedure ends the run; the target is where it never comes.
        mission.target = missions::parsed("target = [0.3, 0]", "bring-up", &[])?.target;
        mission.targets.clear();
        mission.sensing = false;
        mission.arrival_tolerance_m = 0.05;
        mission.timeout_s = 240.0;
        mission.planner.executable = Some(calibration::PLANNER.into());
        mission.planner.calibration =
            Some(CalibrationPlan { procedure: Procedure::BringUp, ..CalibrationPlan::default() });
        mission.controller.speed_m_s = Some(named.body().top_speed_m_s.min(0.2));
        mission.controller.turn_rad_s = Some(0.1);
        mission.controller.look_rad_s = Some(1.5);
        mission.controller.slow_radius_m = 0.01;
        Ok(missions::parsed(&toml::to_string(&mission)?, "bring-up", &[])?)
    }
}

/// The trace in `recording`, by the sizes that `mission` states.
fn read(mission: &Mission, recording: &Recording) -> Result<Trace, RecordingError> {
    let body = mission.body();
    let scales = mission.robot.odometry.wheel_scales();
    let mut endless = std::collections::BTreeMap::<u64, CountsSample>::new();
    for counts in recording.samples(&COUNTS)? {
        let counts = counts?.sample;
        endless.insert(counts.stamp.tick, counts);
    }
    let mut trace = Trace::default();
    let (mut before, mut rolled): (Option<(WheelSample, WheelCounts)>, _) = (None, [0.0; 2]);
    for wheels in recording.samples(&WHEELS)? {
        let wheels = wheels?.sample;
        let counts = WheelCounts::of(&wheels, endless.get(&wheels.stamp.tick));
        if let Some((old, earlier)) = before
            && old.restarts == wheels.restarts
        {
            let went = counts.since(earlier);
            rolled = [0, 1].map(|it| rolled[it] + went[it] * body.metres_per_count() * scales[it]);
        }
        before = Some((wheels, counts));
        trace.rolled.push((wheels.stamp.time().seconds(), rolled));
    }
    for command in recording.samples(&COMMAND)? {
        let command = command?.sample;
        let rims = [command.left_rad_s, command.right_rad_s].map(|it| it * body.wheel_radius_m);
        trace.told.push((command.stamp.time().seconds(), rims));
    }
    let mut angle = 0.0;
    for turn in recording.samples(&IMU_TURN)? {
        let turn = turn?.sample;
        angle += turn.turn_rad;
        trace.gyro.push((turn.stamp.time().seconds(), angle));
    }
    for ranges in recording.slices(&RANGES)? {
        let ranges = ranges?;
        trace.ranges.push((ranges.header.stamp.time().seconds(), ranges.elements));
    }
    for scan in recording.slices(&SCAN)? {
        let scan = scan?;
        trace.scans.push((scan.header.stamp.time().seconds(), scan.header, scan.elements));
    }
    Ok(trace)
}

fn line(finding: &Finding) -> String {
    let Finding { part, verdict, text, keys } = finding;
    let mut line = format!("{:<10} {part}: {text}\n", verdict.word());
    for (key, value) in keys {
        line += &format!("{:10} {key} = {value}\n", "");
    }
    line
}

fn as_json(finding: &Finding) -> serde_json::Value {
    let Finding { part, verdict, text, keys } = finding;
    let keys: serde_json::Map<_, _> =
        keys.iter().map(|(key, value)| (key.clone(), json!(value))).collect();
    json!({ "part": part, "verdict": verdict.word(), "text": text, "keys": keys })
}

/// Where the beams of all scans ended, by what was found.
fn drawn(placed: Option<&Placed>) -> String {
    let points = placed.map_or(&[][..], |placed| &placed.points);
    Chart {
        title: "What the laser saw, placed by the motion that was found",
        description: "Where the beams of all scans ended: one sharp outline if everything is as found.",
        axes: ["ahead of the robot's first place, m", "to its left, m"],
        series: vec![Series {
            name: "ends of beams",
            mark: Mark::Crosses,
            points: points.iter().map(|it| [it.x, it.y]).collect(),
        }],
    }
    .svg()
}
