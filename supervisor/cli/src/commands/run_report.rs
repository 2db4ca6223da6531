//! Picture and report of a run.

use std::{fs, path::PathBuf, time::SystemTime};

use common::{
    ground_truth::GroundTruthTick, kinematics::Pose2, mission::Mission, samples::PoseSample,
};
use glam::DVec2;
use mission_control::{
    Finished, Options,
    outcome::Outcome,
    target_list::{TargetOutcome, TargetResult},
};
use picture::{Facts, Scene, Trail};
use summary::{Hearer, Summary};

/// Name and file, or the error.
pub type Written = Result<(&'static str, PathBuf), String>;

pub fn report(options: &Options) -> Written {
    let page = report::write(&options.directory, None);
    Ok(("report", page.map_err(|error| format!("no report of this run: {error}"))?))
}

pub fn picture(
    options: &Options,
    finished: &Finished,
    heard: &Hearer,
    summary: &Summary,
) -> Written {
    let picture = options.directory.join("picture.svg");
    let svg = svg(&options.mission, finished, heard, summary);
    if let Err(error) = fs::write(&picture, svg) {
        // An incomplete picture is useless.
        let _ = fs::remove_file(&picture);
        return Err(format!("cannot write {}: {error}", picture.display()));
    }
    Ok(("picture", picture))
}

fn svg(mission: &Mission, finished: &Finished, heard: &Hearer, summary: &Summary) -> String {
    let record = &finished.record;
    let believed: Vec<Pose2> = record.poses.iter().map(PoseSample::pose).collect();
    let mut captions = summary.captions();
    if summary.outcome != Outcome::Reached {
        captions.insert(0, summary.reason.clone());
    }
    if let Some(last) = captions.last_mut() {
        *last += &format!(" · {}", httpdate::fmt_http_date(SystemTime::now()));
    }
    let tried = |target: &&TargetResult| target.outcome != TargetOutcome::NotTried;
    let targets: Vec<_> = finished
        .targets
        .iter()
        .filter(tried)
        .map(|target| DVec2::new(target.x_m, target.y_m))
        .collect();
    let trails: Vec<_> = heard
        .trails()
        .iter()
        .map(|it| Trail { places: &it.places, radius_m: it.radius_m })
        .collect();
    picture::svg(&Scene {
        mission,
        grid: record.grid.frame().map(|frame| (frame, record.grid.cells())),
        field: heard.field.frame().map(|frame| (frame, heard.field.cells())),
        believed: &believed,
        covariance: record.poses.last().map(|pose| {
            let [xx, xy, _, yy, ..] = pose.covariance;
            [xx, xy, yy]
        }),
        truth: &finished.truth.iter().map(GroundTruthTick::pose).collect::<Vec<_>>(),
        targets: &targets,
        trails: &trails,
        facts: Facts {
            outcome: summary.outcome.as_str(),
            reached: summary.outcome == Outcome::Reached,
            mission_time_s: summary.mission_time_s,
            path_length_m: summary.path_length_m,
            straight_m: summary.straight_m,
            safety_events: summary.safety_events,
            seed: mission.robot.address.is_none().then_some(mission.seed),
        },
        captions: &captions,
    })
}
