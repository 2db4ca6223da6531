//! One mission, undisturbed and attacked.

use std::{
    fs,
    time::{Duration, Instant},
};

use common::mission::Mission;

use crate::chaos::{attack::Attack, consumers::Consumers, options::Arguments, report::Series};
use crate::{
    error::{OrCannot as _, Result},
    robot::{self, Run, firsthand},
};
use mission_control::{outcome::Outcome, recovery, surroundings::SimulatedRobot as _};
use processes::DEATHS;
use serde::Deserialize;
use simulation::Scenario;
use summary::Summary;

/// A mission takes half a minute of wall-clock time.
const PATIENCE: Duration = Duration::from_secs(600);

/// Death in the record of a run.
#[derive(Deserialize)]
struct Death {
    stage: String,
    generation: u32,
    hung: bool,
}

/// Runs the next mission of `series` undisturbed, attacks it, and reports. Keeps its files after a
/// failure.
pub fn attack(series: &mut Series) -> Result {
    let seed = series.asked.seed + series.report.missions;
    let mission = Mission { seed, ..series.loaded.clone() };
    let undisturbed = Scenario::lockstep(&mission).run().summary.unwrap_or_default();
    let before = series.report.kills();
    let files = series.directory.join(format!("seed-{seed}"));
    fs::create_dir(&files).or_cannot("make a directory")?;
    let directory = files.join("run");
    let simulated = || robot::simulated(&files.join("robot"), &mission);
    let Arguments { mission: name, robot: robot_name, set, .. } = &series.asked;
    let Arguments { replay, include_consumers, include_supervisor, .. } = series.asked;
    let mut robot = include_supervisor.then(simulated).transpose()?;
    // A robot in its own process needs real time.
    let pace = if robot.is_some() { "1" } else { "4" };
    let mut start = robot::mission("run", name, robot_name, set);
    start.args(["--pace", pace, "--seed", &seed.to_string(), "--out"]).arg(&directory);
    if let Some(robot) = &robot {
        let address = robot.address();
        start.args(["--set", &format!("robot.address='udp://{address}'")]);
    }
    let others = files.join("consumers");
    let consumers = Consumers::start(&series.asked, &others, &mut series.report)?;
    let mut attack = Attack::new(seed, consumers);
    let began = Instant::now();
    let summary = loop {
        let mut run = Run::start(start, &directory, replay || include_consumers)?;
        let attacked = attack.run(series, &mut run.process, robot.as_mut(), PATIENCE);
        run.process.end(Duration::from_secs(2));
        attacked?;
        let summary = run.summary();
        // A hit supervisor leaves a summary only if the run had just ended.
        if !attack.supervisor_is_down() || summary.is_ok() || began.elapsed() >= PATIENCE {
            break summary?;
        }
        start = firsthand(&["run", "--json", "--resume"]);
        start.arg(&directory);
    };
    attack.end(series)?;
    let report = &mut series.report;
    let kills = report.kills() - before;
    let mut collisions = summary.collisions.unwrap_or_default();
    let mut excess_m = summary.pose_error_m.unwrap_or_default();
    if let Some(robot) = &mut robot {
        robot.stop()?;
        let truth = robot.truth().last().copied().unwrap_or_default();
        collisions = truth.contacts;
        let place = recovery::last_place(&directory, &mission);
        excess_m = place
            .map_or(f64::INFINITY, |(place, _)| (place.x_m - truth.x).hypot(place.y_m - truth.y));
    }
    excess_m -= undisturbed.pose_error_m.unwrap_or_default();
    report.missions += 1;
    report.collisions += collisions;
    report.worst_pose_excess_m = report.worst_pose_excess_m.max(excess_m);
    let mut wrong = Vec::new();
    match summary.outcome {
        Outcome::Reached | Outcome::ReachedUnsure => report.reached += 1,
        outcome => wrong.push(format!("{}: {}", outcome.as_str(), summary.reason)),
    }
    if collisions > 0 {
        wrong.push(format!("{collisions} collisions"));
    }
    let deaths = fs::read_to_string(directory.join(DEATHS)).unwrap_or_default();
    let deaths = deaths.lines().filter_map(|line| serde_json::from_str::<Death>(line).ok());
    let aborted = deaths.filter(|it| it.hung && !attack.was_frozen(&it.stage, it.generation));
    wrong.extend(aborted.map(|Death { stage, generation, .. }| {
        format!("healthy stage aborted: {stage} generation {generation}")
    }));
    let allowance_m = pose_allowance_m(&mission, kills, &summary);
    if excess_m > allowance_m {
        wrong.push(format!(
            "pose error {excess_m:.4} m above the undisturbed run; the allowance is {allowance_m:.4} m"
        ));
    }
    if replay {
        let replays = report.replays.get_or_insert_default();
        replays.add(&directory, include_consumers, &others, &mut wrong);
    }
    if wrong.is_empty() {
        fs::remove_dir_all(&files).or_cannot("remove its directory")?;
    }
    report.wrong.extend(wrong.iter().map(|what| format!("seed {seed}: {what}")));
    Ok(())
}

/// Returns the allowed final pose error beyond that of the undisturbed run, metres.
///
/// Each signal may cost one wheel count of travel, and another path another count. One count
/// between the wheels turns the heading by `count / track` and displaces the robot by that fraction
/// of the distance to the target. Slip may add three standard deviations of the stated pose error.
fn pose_allowance_m(mission: &Mission, kills: u32, summary: &Summary) -> f64 {
    let body = mission.body();
    let target = mission.start_pose().position.distance(mission.target);
    let slips = mission.simulation.physics().wheels.slip_noise > 0.0;
    let slip_m = if slips { 1.5 * summary.pose_within_m.unwrap_or_default() } else { 0.0 };
    body.metres_per_count() * (f64::from(kills) + target / body.track_m) + slip_m
}
