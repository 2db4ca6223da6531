use std::{fs, path::PathBuf};

use clap::Args;
use common::{
    clock::Pace,
    domain::RobotName,
    mission::{CalibrationPlan, Mission, Procedure, Sensors},
    samples::PoseSample,
};
use glam::DVec2;
use mission_control::{Options, Progress, outcome::Outcome};
use processes::Starter;

use console::{
    failure::{Refused, Result},
    logging, missions,
    output::write_stderr,
    progress_line::{LINE_EVERY, ProgressLine},
    runs,
};

use crate::commands::run::recorder::RunRecorder;

/// What every procedure of a robot is told.
#[derive(Debug, Args)]
pub struct Setting {
    /// Name of the robot, which also names its shared memory.
    #[arg(long, default_value = "x80")]
    pub robot: RobotName,
    /// Mission time of a simulated robot: `max`, or R times wall-clock.
    #[arg(long)]
    pace: Option<Pace>,
    /// Seed of everything random in the simulation, instead of the mission's.
    #[arg(long)]
    seed: Option<u64>,
    /// Set a key of the mission, as often as needed.
    #[arg(long, value_name = "KEY=VALUE")]
    pub set: Vec<String>,
    /// The directory in which the directories of runs are.
    #[arg(long, value_name = "DIR", default_value = "runs")]
    runs: PathBuf,
    /// Print one line of JSON, and nothing else on standard output.
    #[arg(long)]
    pub json: bool,
}

impl Setting {
    /// One log for all runs of a command.
    pub fn log(&self, name: &str) -> Result {
        fs::create_dir_all(&self.runs)
            .map_err(|error| format!("cannot make {}: {error}", self.runs.display()))?;
        Ok(logging::to_file(&self.runs.join(name))?)
    }

    /// The robot of `named`, and nothing else of it, in a procedure that alone ends the run. The controller drives it at `speed_m_s` or as
    /// fast as it can.
    pub fn procedure(
        &self,
        named: &Mission,
        plan: CalibrationPlan,
        speed_m_s: f64,
    ) -> Result<Mission> {
        let body = named.body();
        if body.steering.is_some() {
            return Err("a car does not turn on the spot, which the procedure is made of".into());
        }
        let name = if plan.procedure == Procedure::BringUp { "bring-up" } else { "calibration" };
        // The target is beside the place where the robot turns.
        let mut mission = missions::parsed("target = [0.3, 0]", name, &[])?;
        mission.robot = named.robot.clone();
        mission.sonar = named.sonar.clone();
        mission.simulation = named.simulation.clone();
        mission.seed = self.seed.unwrap_or(named.seed);
        mission.sensors = Some(Sensors::Front);
        mission.arrival_tolerance_m = 0.05;
        // Only before a wall does something answer for certain, so that sonars are judged.
        mission.sensing = plan.procedure == Procedure::Wall;
        mission.planner.executable = Some(calibration::PLANNER.into());
        mission.planner.calibration = Some(plan);
        mission.controller.speed_m_s = Some(speed_m_s.min(body.top_speed_m_s));
        // The robot turns many times at one place, which is no stall.
        mission.controller.turn_rad_s = Some(0.1);
        mission.controller.look_rad_s = Some(1.5);
        mission.controller.slow_radius_m = 0.01;
        Ok(mission)
    }

    /// Fails if the procedure does not come to its end.
    pub fn carry_out(&self, mission: &Mission, title: &str) -> Result<Carried> {
        // It is checked like one that a person wrote.
        let mission = missions::parsed(&toml::to_string(mission)?, &mission.name, &[])?;
        let directory = runs::numbered(&self.runs, &mission.name)?;
        let real = mission.robot.address.is_some();
        let options = Options {
            mission,
            robot: self.robot.clone(),
            pace: self.pace.unwrap_or(if real { Pace::Rate(1.0) } else { Pace::Max }),
            directory,
            starter: Starter::Supervisor,
            recovered: None,
            stands: false,
            place: None,
        };
        let place = options.directory.display();
        let title = format!("{title}: everything of this run is in {place}");
        let mut line = ProgressLine::new(LINE_EVERY);
        let mut complained = Vec::new();
        let mut lock = None;
        let mut recorder = RunRecorder::new(&options, None);
        let ran = mission_control::run(
            &options,
            mission_control::end_signals()?,
            &mut lock,
            &mut recorder,
            Box::new(|_| {}),
            &mut |progress| {
                line.update(&title, || shown(progress), true);
                if let Some(said) = progress.record.complaint() {
                    // Numbers in it may differ each time.
                    let words: String = said.chars().filter(|it| !it.is_numeric()).collect();
                    if !complained.contains(&words) {
                        write_stderr(&format!("\nfirsthand: {said}\n"));
                        complained.push(words);
                    }
                }
            },
        );
        drop(recorder);
        drop(lock);
        line.end();
        let (finished, still_moving) = ran?;
        if still_moving.is_some() {
            return Err("THE ROBOT MOVES although it was told to stand by every method".into());
        }
        let truth = finished.truth.last().map(|truth| DVec2::new(truth.x, truth.y));
        let ending = &finished.ending;
        match ending.outcome {
            // The end by wheels that are not calibrated does not matter. A planner that gave up says why in its checkpoint.
            Outcome::Reached
            | Outcome::WrongPlace
            | Outcome::ReachedUnsure
            | Outcome::Unreachable => {
                let counts = |pose: &PoseSample| [pose.left_counts, pose.right_counts];
                let counts = finished.record.poses.iter().map(counts).collect();
                let seconds = finished.duration_s;
                Ok(Carried { directory: options.directory, seconds, counts, truth })
            }
            outcome => {
                let (outcome, reason) = (outcome.as_str(), &ending.reason);
                let message = format!(
                    "nothing was written: the run ended in {outcome}, {reason}; see {place}"
                );
                Err(Refused::new("not-calibrated", message).into())
            }
        }
    }
}

pub struct Carried {
    pub directory: PathBuf,
    pub seconds: f64,
    pub counts: Vec<[u16; 2]>,
    /// The end of a simulated robot, metres.
    pub truth: Option<DVec2>,
}

fn shown(progress: &Progress<'_>) -> String {
    let pose = progress.record.pose.unwrap_or_default();
    let state = if progress.driving { "" } else { ", starting" };
    format!("{:6.1} s  {:5.1} m driven{state}", pose.stamp.time().seconds(), pose.travelled_m)
}
