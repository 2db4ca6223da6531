use std::{fs, path::PathBuf};

use clap::Args;
use common::{
    clock::Pace,
    domain::RobotName,
    file::{FileError, replace},
    mission::{CalibrationPlan, Mission, Procedure, Sensors},
    samples::PoseSample,
};
use glam::DVec2;
use mission_control::{Options, Progress, outcome::Outcome, recovery::SUMMARY};
use processes::Starter;
use serde_json::json;

use console::{
    failure::{Result, refuse},
    logging, missions,
    output::write_stderr,
    progress_line::{LINE_EVERY, ProgressLine},
    runs,
};

use crate::commands::run::recorder::RunRecorder;

const COMPLETED: &str = "completed";

/// Options that every calibration procedure takes.
#[derive(Debug, Args)]
pub struct Setting {
    /// Name of the robot and of its shared memory.
    #[arg(long, default_value_t)]
    pub robot: RobotName,
    /// Pace of a simulated robot: `max`, or R times wall-clock time.
    #[arg(long)]
    pace: Option<Pace>,
    /// Seed of the simulation, instead of the mission's.
    #[arg(long)]
    seed: Option<u64>,
    /// Set a key of the mission; may be repeated.
    #[arg(long, value_name = "KEY=VALUE")]
    pub set: Vec<String>,
    /// Directory that holds the directories of runs.
    #[arg(long, value_name = "DIR", default_value = "runs")]
    runs: PathBuf,
    /// Print only one line of JSON on standard output.
    #[arg(long)]
    pub json: bool,
}

impl Setting {
    pub fn log(&self, name: &str) -> Result {
        fs::create_dir_all(&self.runs).map_err(FileError::of("make", &self.runs))?;
        Ok(logging::to_file(&self.runs.join(name))?)
    }

    /// Returns a mission with only the robot of `named`, ended only by the procedure, at most at
    /// the body's top speed.
    pub fn procedure(
        &self,
        named: &Mission,
        plan: CalibrationPlan,
        speed_m_s: f64,
    ) -> Result<Mission> {
        let body = named.body();
        if body.steering.is_some() {
            return Err("the procedure turns on the spot, which a car cannot do".into());
        }
        let name = if plan.procedure == Procedure::BringUp { "bring-up" } else { "calibration" };
        let mut mission = missions::parsed("target = [0.3, 0]", name, &[])?;
        mission.robot = named.robot.clone();
        mission.sonar = named.sonar.clone();
        mission.simulation = named.simulation.clone();
        mission.seed = self.seed.unwrap_or(named.seed);
        mission.sensors = Some(Sensors::Front);
        mission.arrival_tolerance_m = 0.05;
        // Sonars can only be judged in front of a wall, where echoes are certain.
        mission.sensing = plan.procedure == Procedure::Wall;
        mission.planner.executable = Some(calibration::PLANNER.into());
        mission.planner.calibration = Some(plan);
        mission.controller.speed_m_s = Some(speed_m_s.min(body.top_speed_m_s));
        // Repeated turns in one place are no stall.
        mission.controller.turn_rad_s = Some(0.1);
        mission.controller.look_rad_s = Some(1.5);
        mission.controller.slow_radius_m = 0.01;
        Ok(mission)
    }

    /// Fails if the procedure does not complete.
    pub fn carry_out(&self, mission: &Mission, title: &str) -> Result<Carried> {
        // Applies the checks of a handwritten mission.
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
                    let said = said.to_string();
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
            return Err("THE ROBOT MOVES although every stop method was tried".into());
        }
        let truth = finished.truth.last().map(|truth| truth.pose().position);
        let (ending, seconds) = (&finished.ending, finished.duration_s);
        let outcome = match ending.outcome {
            // Uncalibrated wheels may end anywhere. A failed planner stores the reason in its
            // checkpoint.
            Outcome::Reached
            | Outcome::WrongPlace
            | Outcome::ReachedUnsure
            | Outcome::Unreachable => COMPLETED,
            outcome => outcome.as_str(),
        };
        // Without a summary, the run counts as cut off.
        let summary = options.directory.join(SUMMARY);
        replace(&summary, json!({ "outcome": outcome, "mission_time_s": seconds }).to_string())
            .map_err(FileError::of("write", &summary))?;
        if outcome != COMPLETED {
            let reason = &ending.reason;
            let message =
                format!("nothing was written: the run ended in {outcome}, {reason}; see {place}");
            return refuse("not-calibrated", message);
        }
        let counts = |pose: &PoseSample| [pose.left_counts, pose.right_counts];
        let counts = finished.record.poses.iter().map(counts).collect();
        Ok(Carried { directory: options.directory, seconds, counts, truth })
    }
}

pub struct Carried {
    pub directory: PathBuf,
    pub seconds: f64,
    pub counts: Vec<[u16; 2]>,
    /// End position of a simulated robot, metres.
    pub truth: Option<DVec2>,
}

fn shown(progress: &Progress<'_>) -> String {
    let pose = progress.record.pose.unwrap_or_default();
    let state = if progress.driving { "" } else { ", starting" };
    format!("{:6.1} s  {:5.1} m driven{state}", pose.stamp.seconds(), pose.travelled_m)
}
