//! Targets that change every few seconds, and the check of their outcomes.

use std::{
    collections::BTreeMap,
    f64::consts::TAU,
    process::Stdio,
    sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel},
    thread::JoinHandle,
    time::Duration,
};

use common::{domain::RobotName, ground_truth::GroundTruthTick, mission::Mission};
use mission_control::target_list::{TargetOutcome, TargetResult};
use serde::Serialize;
use summary::Summary;

use simulation::Random;

use crate::robot::firsthand;

const MOST_CHANGES: usize = 6;
const PAUSE_S: [f64; 2] = [0.8, 3.0];
/// Maximum distance of a target from the start.
const WITHIN_M: f64 = 2.5;
/// Free ground between a target and obstacles, beside the body.
const CLEARANCE_M: f64 = 0.45;
/// Maximum true distance from a reached target.
const REACHED_WITHIN_M: f64 = 0.5;

#[derive(Default, Serialize)]
pub struct Changes {
    /// Requests: taken (the supervisor confirmed them), refused, unanswered (the supervisor was
    /// hit). Targets: reached, replaced.
    #[serde(flatten)]
    counts: Counts,
}

type Counts = BTreeMap<&'static str, u64>;

pub struct Operator {
    stop: Sender<()>,
    thread: JoinHandle<Sent>,
}

#[derive(Debug, Default)]
struct Sent {
    counts: Counts,
    taken: Vec<[f64; 2]>,
}

impl Operator {
    pub fn start(robot: RobotName, mission: &Mission, seed: u64) -> Self {
        let (stop, stopped) = channel();
        let mission = mission.clone();
        let thread = std::thread::spawn(move || send(&robot, &mission, seed, &stopped));
        Self { stop, thread }
    }

    fn end(self) -> Sent {
        drop(self.stop);
        self.thread.join().unwrap_or_default()
    }
}

fn send(robot: &RobotName, mission: &Mission, seed: u64, stopped: &Receiver<()>) -> Sent {
    let mut random = Random::new(seed, 11);
    let mut sent = Sent::default();
    let mut changes = 0;
    while changes < MOST_CHANGES {
        let pause = Duration::from_secs_f64(random.in_range(PAUSE_S));
        if stopped.recv_timeout(pause) != Err(RecvTimeoutError::Timeout) {
            break;
        }
        let count = 1 + usize::from(random.share() < 0.4);
        let places: Vec<_> = (0..count).map(|_| place(mission, &mut random)).collect();
        let words: Vec<_> = places.iter().flatten().map(f64::to_string).collect();
        let mut command = firsthand(&["goto", "--robot", &robot.to_string()]);
        if random.share() < 0.5 {
            command.arg("--append");
        }
        let output = command.args(words).stdin(Stdio::null()).output();
        let Ok(output) = output else {
            continue;
        };
        let said = String::from_utf8_lossy(&output.stderr);
        if said.contains("[not-running]") {
            continue;
        }
        let answer = match output.status.success() {
            true => "taken",
            false if said.contains("refuses") => "refused",
            false => "unanswered",
        };
        *sent.counts.entry(answer).or_default() += 1;
        if answer == "taken" {
            changes += 1;
            sent.taken.extend(places);
        }
    }
    sent
}

/// Draws a free place in whole centimetres.
fn place(mission: &Mission, random: &mut Random) -> [f64; 2] {
    let (world, frame) = (mission.obstacles(), mission.grid_frame());
    let clear_m = mission.body().radius_m + CLEARANCE_M;
    for _ in 0..1000 {
        let (angle, far) = (TAU * random.share(), WITHIN_M * random.share().sqrt());
        let at = glam::DVec2::from_angle(angle) * far;
        let at = (at * 100.0).round() / 100.0;
        let to_rim = frame.resolution_m * f64::from(frame.cells) / 2.0
            - (at - frame.centre).abs().max_element();
        if world.clearance(at) > clear_m && to_rim > clear_m {
            return [at.x, at.y];
        }
    }
    [0.0, 0.0]
}

impl Changes {
    /// Counts a mission's changes. Adds accepted targets that were unreported, or not reached in
    /// truth, to `wrong`.
    pub fn add(
        &mut self,
        operator: Operator,
        summary: &Summary,
        truth: &[GroundTruthTick],
        wrong: &mut Vec<String>,
    ) {
        let sent = operator.end();
        for (what, count) in sent.counts {
            *self.counts.entry(what).or_default() += count;
        }
        for [x, y] in sent.taken {
            if !summary.targets.iter().any(|told| (told.x_m, told.y_m) == (x, y)) {
                wrong.push(format!("({x}, {y}) was accepted, but the summary lacks it"));
            }
        }
        for (nth, target) in (1..).zip(&summary.targets) {
            let TargetResult { number, x_m, y_m, outcome, .. } = *target;
            if number != nth {
                wrong.push(format!("target {nth} has number {number}"));
            }
            let was_there = || {
                let off = |tick: &GroundTruthTick| (tick.x - x_m).hypot(tick.y - y_m);
                truth.is_empty() || truth.iter().any(|tick| off(tick) <= REACHED_WITHIN_M)
            };
            let came = match outcome {
                TargetOutcome::Replaced => "replaced",
                TargetOutcome::Reached | TargetOutcome::ReachedUnsure if was_there() => "reached",
                _ => {
                    wrong.push(format!("target {number}: {outcome:?}"));
                    continue;
                }
            };
            *self.counts.entry(came).or_default() += 1;
        }
    }
}
