//! Missions of robots with a fault, each in one process.

use std::time::Duration;

use clap::ValueEnum as _;
use common::{ground_truth::GroundTruthTick, mission::Mission};
use console::output::write_stderr;
use mission_control::outcome::{Outcome, RIGHT_PLACE_M};
use simulation::{Disturbance, Lie, Ran, Random, Request, RobotFault, Scenario, What};
use summary::Summary;

use super::stop_time_table::{Entry, StopTimeTable};
use crate::{error::Result, simulate::quietly};

/// Range of the time from the departure to the fault.
const FAULT_AFTER_S: [f64; 2] = [1.0, 5.0];
/// Watch time of a faulty robot: several times as long as it may move.
const WATCHED: Duration = Duration::from_secs(10);
/// Watch time of a faulty robot that may go on: until arrival, when it can report a wrong place.
const WATCHED_ON_ITS_WAY: Duration = Duration::from_secs(90);

/// Runs each of the `named` faults, or all, with seeds from `seed` on.
///
/// # Errors
/// Fails if the mission's robot can have none of the faults.
pub fn run(
    mission: &Mission,
    named: &[RobotFault],
    seed: u64,
    missions: u32,
) -> Result<StopTimeTable> {
    let asked = if named.is_empty() { RobotFault::value_variants() } else { named };
    let (faults, left_out): (Vec<RobotFault>, Vec<_>) =
        asked.iter().copied().partition(|fault| fault.has_meaning(mission));
    if !left_out.is_empty() {
        let names: Vec<_> = left_out.iter().map(|fault| &*fault.row().name).collect();
        let left_out = format!("this robot has no such faults: {}", names.join(", "));
        if faults.is_empty() {
            return Err(left_out.into());
        }
        write_stderr(&format!("skipped: {left_out}\n"));
    }
    let _quiet = quietly();
    // Until its fault, each robot drives as the healthy one of its seed.
    let healthy: Vec<_> = (seed..)
        .take(missions as usize)
        .map(|seed| {
            let scenario = Scenario::calm(&Mission { seed, ..mission.clone() });
            let truth = scenario.run().truth;
            (scenario, truth)
        })
        .collect();
    let mut table = StopTimeTable::default();
    for fault in faults {
        table.entries.extend(healthy.iter().map(|(scenario, truth)| one(scenario, truth, fault)));
    }
    Ok(table)
}

/// Runs the scenario of a healthy robot again, with a fault.
fn one(healthy: &Scenario, healthy_truth: &[GroundTruthTick], fault: RobotFault) -> Entry {
    let mission = &healthy.mission;
    let at = onset(healthy, healthy_truth, fault);
    let promised_s = fault.row().rest_within_s(mission);
    let watched = if promised_s.is_some() { WATCHED } else { WATCHED_ON_ITS_WAY };
    let mut scenario = healthy.clone();
    if let Some(at) = at {
        let mut add = |at, what| scenario.disturbances.push(Disturbance { at, what });
        add(at, What::Fault(Some(fault)));
        if fault == RobotFault::DoesNotStop {
            add(at, What::Ask(Request::Stop));
        }
        add(at + watched, What::End);
    }
    let Ran { summary, broken, simulated, truth, moved, causes, .. } = scenario.run();
    let off_m = from_target_m(mission, &truth);
    let (outcome, mut reason) = match (broken, summary) {
        (Some(broken), _) => ("broken", broken.to_string()),
        (None, Some(Summary { mut outcome, reason, pose_within_m, .. })) => {
            if outcome == Outcome::Reached && off_m > RIGHT_PLACE_M {
                // A robot that does not trust its pose has not said where it is.
                let is_unsure = pose_within_m > Some(mission.sure_within_m);
                outcome = if is_unsure { Outcome::ReachedUnsure } else { Outcome::WrongPlace };
            }
            (outcome.as_str(), reason)
        }
        (None, None) => {
            let cause = causes.last().and_then(|(_, cause)| *cause);
            ("goes on", cause.map_or("", |cause| cause.name()).to_owned())
        }
    };
    if fault == RobotFault::Drawn {
        // Uncalibrated wheels alone may lead that far.
        let healthy_m = from_target_m(mission, healthy_truth);
        let lie = Lie::draw(mission);
        reason = format!("{lie}: {off_m:.2} m off, {healthy_m:.2} m without it: {reason}");
    }
    let began_s = at.unwrap_or(simulated).as_secs_f64();
    let since = |then_s: f64| (then_s - began_s).max(0.0);
    // The tick before the fault counts as its start.
    let first = truth.partition_point(|tick| tick.time_s < began_s);
    let watched = &truth[first.saturating_sub(1)..];
    let [start, end] =
        [watched.first(), watched.last()].map(|tick| tick.copied().unwrap_or_default());
    let track_m = mission.body().track_m;
    let turns = |tick: &&GroundTruthTick| tick.rim_m_s(track_m) >= GroundTruthTick::AT_REST_M_S;
    let turned_s = watched.iter().skip(1).rfind(turns).map_or(0.0, |tick| tick.time_s);
    Entry {
        fault,
        seed: scenario.seed,
        promised_s,
        last_moving_s: at.map(|_| since(moved.unwrap_or_default().as_secs_f64())),
        rest_s: at.map(|_| since(turned_s)),
        way_m: summary::path_length(watched),
        watched_s: since(end.time_s),
        collisions: end.contacts.saturating_sub(start.contacts),
        outcome,
        reason,
    }
}

/// Returns the distance of the last place from the target.
fn from_target_m(mission: &Mission, truth: &[GroundTruthTick]) -> f64 {
    truth.last().map_or(0.0, |tick| mission.target.distance(tick.pose().position))
}

/// Draws the time of the fault, a while after the departure. Returns `None` if the mission of the
/// healthy robot ends before.
fn onset(healthy: &Scenario, truth: &[GroundTruthTick], fault: RobotFault) -> Option<Duration> {
    if fault == RobotFault::LateFromBoot {
        return Some(Duration::ZERO);
    }
    let after_s = Random::new(healthy.seed, 17 + fault as u128).in_range(FAULT_AFTER_S);
    let at_s = summary::departed_s(&healthy.mission, truth)? + after_s;
    (at_s < truth.last()?.time_s).then(|| Duration::from_secs_f64(at_s))
}

#[cfg(test)]
mod tests {
    use console::missions;

    use super::*;

    /// `.ci/lab` tries every fault.
    #[test]
    fn robots_with_a_fault_keep_their_promise() {
        use RobotFault::{DoesNotStop, EncoderReversed, RangeMissing, Silence};
        for robot in ["robot.model='x80'", "robot={model='kobuki',rate_hz=10}"] {
            let mission = missions::load("obstacle-course", &[robot.to_owned()]).unwrap();
            let faults = [DoesNotStop, EncoderReversed, RangeMissing, Silence];
            let table = run(&mission, &faults, 1, 1).unwrap();
            let broken: Vec<_> = table.entries.iter().filter(|entry| !entry.is_kept()).collect();
            assert!(broken.is_empty(), "{robot}: {broken:#?}");
        }
    }
}
