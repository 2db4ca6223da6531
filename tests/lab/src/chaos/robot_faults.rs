//! Missions of robots with a fault, each in one process.

use std::time::Duration;

use clap::ValueEnum as _;
use common::{ground_truth::GroundTruthTick, mission::Mission};
use console::output::write_stderr;
use mission_control::outcome::RIGHT_PLACE_M;
use simulation::{Disturbance, Lie, Random, Request, RobotFault, Scenario, What};
use summary::Summary;

use super::stop_time_table::{Entry, StopTimeTable};
use crate::{error::Result, simulate::quietly};

/// Least time from the departure to the fault, and width of the random range.
const FAULT_AFTER_S: (f64, f64) = (1.0, 4.0);
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
    let mut table = StopTimeTable::default();
    // Until its fault, each robot drives as the healthy one of its seed.
    let seeds = (0..u64::from(missions)).map(|number| seed + number);
    let healthy: Vec<_> = seeds.map(|seed| Healthy::drive(mission, seed)).collect();
    for fault in faults {
        table.entries.extend(healthy.iter().map(|healthy| one(healthy, fault)));
    }
    Ok(table)
}

fn one(healthy: &Healthy, fault: RobotFault) -> Entry {
    let mut scenario = healthy.scenario.clone();
    let at = match fault {
        RobotFault::LateFromBoot => Some(Duration::ZERO),
        _ => healthy.onset(fault),
    };
    let promised_s = fault.row().rest_within_s(&scenario.mission);
    let watched = if promised_s.is_some() { WATCHED } else { WATCHED_ON_ITS_WAY };
    if let Some(at) = at {
        let mut add = |at, what| scenario.disturbances.push(Disturbance { at, what });
        add(at, What::Fault(Some(fault)));
        if fault == RobotFault::DoesNotStop {
            add(at, What::Ask(Request::Stop));
        }
        add(at + watched, What::End);
    }
    let ran = scenario.run();
    let Scenario { seed, mission, .. } = &scenario;
    let truth = &ran.truth;
    let (mut outcome, mut reason) = match ran.finished {
        Some(finished) => (finished.ending.outcome.as_str(), finished.ending.reason),
        None => {
            let cause = ran.causes.last().and_then(|(_, cause)| *cause);
            ("goes on", cause.map_or("", |cause| cause.name()).to_owned())
        }
    };
    let off_m = off_m(mission, truth);
    if outcome == "reached" && off_m > Some(RIGHT_PLACE_M) {
        outcome = "wrong_place";
    }
    // A robot that does not trust its pose has not said where it is.
    let is_unsure = |summary: Summary| summary.pose_within_m > Some(mission.sure_within_m);
    if outcome == "wrong_place" && ran.summary.is_some_and(is_unsure) {
        outcome = "reached_unsure";
    }
    if let Some(broken) = ran.broken {
        (outcome, reason) = ("broken", broken.to_string());
    }
    let began_s = at.unwrap_or(ran.simulated).as_secs_f64();
    // The tick before the fault counts as its start.
    let first = truth.partition_point(|tick| tick.time_s < began_s);
    let watched = &truth[first.saturating_sub(1)..];
    let ways = watched.windows(2).map(|two| (two[1].x - two[0].x).hypot(two[1].y - two[0].y));
    let track_m = mission.body().track_m;
    let is_at_rest = |tick: &GroundTruthTick| {
        tick.v.abs() + tick.omega.abs() * track_m / 2.0 < GroundTruthTick::AT_REST_M_S
    };
    let turning = watched.iter().skip(1).rfind(|tick| !is_at_rest(tick));
    let contacts = |tick: Option<&GroundTruthTick>| tick.map_or(0, |tick| tick.contacts);
    let since = |then: Option<f64>| then.map_or(0.0, |then_s| (then_s - began_s).max(0.0));
    if fault == RobotFault::Drawn {
        // Uncalibrated wheels alone may lead that far.
        let [off_m, healthy_m] = [off_m, healthy.off_m].map(Option::unwrap_or_default);
        let lie = Lie::draw(mission);
        reason = format!("{lie}: {off_m:.2} m off, {healthy_m:.2} m without it: {reason}");
    }
    Entry {
        fault,
        seed: *seed,
        promised_s,
        fault_began: at.is_some(),
        last_moving_s: at.map(|_| since(ran.moved.map(|moved| moved.as_secs_f64()))),
        rest_s: at.map(|_| since(turning.map(|tick| tick.time_s))),
        way_m: ways.sum(),
        watched_s: since(watched.last().map(|tick| tick.time_s)),
        collisions: contacts(watched.last()).saturating_sub(contacts(watched.first())),
        outcome,
        reason,
    }
}

/// Returns the distance of the last place from the target.
fn off_m(mission: &Mission, truth: &[GroundTruthTick]) -> Option<f64> {
    let last = truth.last()?;
    Some((last.x - mission.target.x).hypot(last.y - mission.target.y))
}

struct Healthy {
    scenario: Scenario,
    departed_s: Option<f64>,
    ended_s: f64,
    off_m: Option<f64>,
}

impl Healthy {
    fn drive(mission: &Mission, seed: u64) -> Self {
        let scenario = Scenario::calm(&Mission { seed, ..mission.clone() });
        let truth = scenario.run().truth;
        let departed_s = summary::departed_s(mission, &truth);
        let ended_s = truth.last().map_or(0.0, |tick| tick.time_s);
        let off_m = off_m(mission, &truth);
        Self { scenario, departed_s, ended_s, off_m }
    }

    /// Draws the time of the fault, a while after the departure. Returns `None` if the mission ends
    /// before.
    fn onset(&self, fault: RobotFault) -> Option<Duration> {
        let (least, more) = FAULT_AFTER_S;
        let after_s = least + more * Random::new(self.scenario.seed, 17 + fault as u128).share();
        let at_s = self.departed_s? + after_s;
        (at_s < self.ended_s).then(|| Duration::from_secs_f64(at_s))
    }
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
