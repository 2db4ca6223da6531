use std::path::{Path, PathBuf};

use common::{clock::Pace, domain::RobotName, mission::Mission, samples::PoseSample};
use glam::DVec2;
use mission_control::{Options, Progress, outcome::Outcome};
use processes::Starter;

use console::{
    failure::{Failure, Refused},
    progress_line::{LINE_EVERY, ProgressLine},
    runs,
};

use crate::commands::run::recorder::RunRecorder;

#[derive(Clone, Copy)]
pub(in crate::commands) struct Setting<'a> {
    pub robot: &'a RobotName,
    pub pace: Pace,
    pub runs: &'a Path,
}

pub(in crate::commands) struct Carried {
    pub directory: PathBuf,
    pub seconds: f64,
    pub counts: Vec<[u16; 2]>,
    /// The end of a simulated robot, metres.
    pub truth: Option<DVec2>,
}

/// Fails if the procedure does not come to its end.
pub(in crate::commands) fn carry_out(
    setting: Setting<'_>,
    mission: Mission,
    title: &str,
) -> Result<Carried, Failure> {
    let directory = runs::numbered(setting.runs, &mission.name)?;
    let options = Options {
        mission,
        robot: setting.robot.clone(),
        pace: setting.pace,
        directory,
        starter: Starter::Supervisor,
        recovered: None,
        stands: false,
        place: None,
    };
    let place = options.directory.display();
    let title = format!("{title}: everything of this run is in {place}");
    let mut line = ProgressLine::new(LINE_EVERY);
    let mut lock = None;
    let mut recorder = None;
    let ran = mission_control::run(
        &options,
        mission_control::end_signals()?,
        &mut lock,
        &mut |signals| recorder = RunRecorder::start(&options, None, signals),
        Box::new(|_| {}),
        &mut |progress| line.update(&title, || shown(progress), true),
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
        Outcome::Reached | Outcome::WrongPlace | Outcome::ReachedUnsure | Outcome::Unreachable => {
            let counts = |pose: &PoseSample| [pose.left_counts, pose.right_counts];
            let counts = finished.record.poses.iter().map(counts).collect();
            let seconds = finished.duration_s;
            Ok(Carried { directory: options.directory, seconds, counts, truth })
        }
        outcome => {
            let (outcome, reason) = (outcome.as_str(), &ending.reason);
            let message =
                format!("nothing was written: the run ended in {outcome}, {reason}; see {place}");
            Err(Refused::new("not-calibrated", message).into())
        }
    }
}

fn shown(progress: &Progress<'_>) -> String {
    let pose = progress.record.pose.unwrap_or_default();
    let state = if progress.driving { "" } else { ", starting" };
    format!("{:6.1} s  {:5.1} m driven{state}", pose.stamp.time().seconds(), pose.travelled_m)
}
