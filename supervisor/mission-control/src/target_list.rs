//! Targets of a run with their outcomes. Pure.

use common::{
    ground_truth::GroundTruthTick,
    mission::Mission,
    samples::{CommandSample, HoldReason, MOST_TARGETS, RequestAnswer, TargetPoint, TargetSample},
};
use glam::DVec2;
use serde::{Deserialize, Serialize};

use crate::{
    decisive::truth_of,
    observer::Record,
    outcome::{Ending, Outcome},
};

/// Maximum number of stored results. Older ones are only in the records file.
const MOST_RESULTS: usize = 128;

#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum TargetOutcome {
    Reached,
    /// The ground truth contradicts the reported arrival.
    WrongPlace,
    /// The robot is unsure of its reported arrival, as in [`Outcome::ReachedUnsure`].
    ReachedUnsure,
    /// An operator named another target first.
    Replaced,
    /// The robot stalled, and no recovery step was left.
    Unreachable,
    TimedOut,
    Missed,
    /// The run ended before the robot was sent there.
    NotTried,
    /// The robot followed a beacon, last seen there.
    Followed,
}

/// First command at a target, and how the robot arrived there.
pub(crate) type Arrived = (CommandSample, TargetOutcome);

#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
pub struct Followed {
    pub way_m: f64,
    pub time_s: f64,
    /// Times that the robot lost the beacon.
    pub lost: u64,
}

#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
pub struct TargetResult {
    pub number: u64,
    pub x_m: f64,
    pub y_m: f64,
    pub outcome: TargetOutcome,
    /// `None` for an untried target.
    pub at_s: Option<f64>,
    /// Distance from the target on arrival by the own pose.
    pub distance_m: Option<f64>,
    /// Distance by a simulated robot's ground truth.
    pub truth_m: Option<f64>,
    /// Present for beacons only.
    pub followed: Option<Followed>,
}

#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
struct Stored {
    result: TargetResult,
    /// Tick of the arrival; `None` without one.
    tick: Option<u64>,
}

#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub struct TargetList {
    pub(crate) number: u64,
    pub(crate) current: TargetPoint,
    since_tick: u64,
    pub(crate) began_s: f64,
    ahead: Vec<TargetPoint>,
    results: Vec<Stored>,
    /// Results in the records file, oldest first.
    pub(crate) recorded: usize,
    /// Whether the current target is finished, and the robot waits.
    pub(crate) waits: bool,
    pub(crate) by_hand: bool,
    /// Whether the target moves with a beacon; one result covers all places.
    pub(crate) follows: bool,
}

impl TargetList {
    pub(crate) fn of(mission: &Mission) -> Self {
        let mut points = mission.waypoints().into_iter().map(TargetPoint::from);
        let waits =
            mission.stay && mission.target == mission.start.at && mission.targets.is_empty();
        Self {
            // The start is no target.
            number: u64::from(!waits),
            current: points.next().unwrap_or_default(),
            ahead: points.collect(),
            waits,
            ..Self::default()
        }
    }

    /// Returns whether the current target gets a result when it ends.
    pub(crate) const fn has_target(&self) -> bool {
        !self.waits && !self.by_hand && !self.follows
    }

    /// Follows a beacon. The first sample gives the first target.
    pub(crate) fn follow(&mut self, now_s: f64, arrival: Option<Arrived>) {
        self.replace(&[], (0, now_s), arrival);
        // A beacon that is never heard has a result too.
        self.number += 1;
        (self.waits, self.by_hand, self.follows) = (true, false, true);
    }

    pub(crate) fn move_to(&mut self, place: DVec2, since_tick: u64) {
        self.number += 1;
        (self.current, self.since_tick) = (TargetPoint::at(place), since_tick);
        self.waits = false;
    }

    /// The beacon was last seen at `place`.
    pub(crate) fn end_following(
        &mut self,
        (outcome, followed): (TargetOutcome, Followed),
        place: DVec2,
        now_s: f64,
    ) {
        let result = self.result_of(&TargetPoint::at(place), outcome);
        let (at_s, followed) = (Some(now_s), Some(followed));
        self.store(TargetResult { at_s, followed, ..result }, None);
        (self.waits, self.follows) = (true, false);
    }

    /// Lets the robot wait without its hand. Returns whether a hand drove it.
    pub(crate) const fn release(&mut self) -> bool {
        let was = self.by_hand;
        self.waits |= was;
        self.by_hand = false;
        was
    }

    /// Returns the outcome of a run that ends while the robot waits: the newest target's.
    pub(crate) fn outcome_while_waiting(&self) -> Option<Outcome> {
        let tried = |it: &&Stored| it.result.outcome != TargetOutcome::NotTried;
        // A hand's target is the current one and has no result.
        let newest =
            self.results.iter().rfind(tried).filter(|_| !self.by_hand).map(|it| it.result.outcome);
        (self.waits || self.by_hand).then_some(match newest {
            Some(TargetOutcome::Unreachable) => Outcome::Unreachable,
            Some(TargetOutcome::TimedOut) => Outcome::Timeout,
            // `of_all` says how the arrival was.
            Some(
                TargetOutcome::Reached | TargetOutcome::WrongPlace | TargetOutcome::ReachedUnsure,
            ) => Outcome::Reached,
            _ => Outcome::Waited,
        })
    }

    pub(crate) const fn is_last(&self) -> bool {
        self.ahead.is_empty()
    }

    pub(crate) fn sample(&self) -> TargetSample {
        let mut sample = TargetSample {
            number: self.number,
            last: self.number + self.ahead.len() as u64,
            since_tick: self.since_tick,
            target: self.current,
            ..TargetSample::default()
        };
        for (place, point) in sample.ahead.iter_mut().zip(&self.ahead) {
            *place = *point;
        }
        sample
    }

    pub(crate) fn append(&mut self, points: &[TargetPoint]) -> bool {
        let fits = self.ahead.len() + points.len() < MOST_TARGETS;
        if fits {
            self.ahead.extend_from_slice(points);
        }
        fits
    }

    /// Sends the robot to `points` instead, from `since_tick` at `now_s` on. `arrival` belongs to
    /// the current target.
    pub(crate) fn replace(
        &mut self,
        points: &[TargetPoint],
        (since_tick, now_s): (u64, f64),
        arrival: Option<Arrived>,
    ) {
        if self.has_target() {
            self.end_current(TargetOutcome::Replaced, now_s, arrival);
        }
        self.drop_ahead(TargetOutcome::Replaced);
        if let Some((first, ahead)) = points.split_first() {
            self.number += 1;
            (self.current, self.ahead) = (*first, ahead.to_vec());
            (self.since_tick, self.began_s) = (since_tick, now_s);
            (self.waits, self.by_hand, self.follows) = (false, false, false);
        }
    }

    /// Later targets are not tried. The robot waits.
    pub(crate) fn settle(&mut self, outcome: Outcome, now_s: f64, arrival: Option<Arrived>) {
        if self.release() {
            return;
        }
        let given_up = match outcome {
            Outcome::Timeout => TargetOutcome::TimedOut,
            _ => TargetOutcome::Unreachable,
        };
        self.end_current(given_up, now_s, arrival.filter(|_| outcome == Outcome::Reached));
        self.drop_ahead(TargetOutcome::NotTried);
        self.waits = true;
    }

    fn end_current(&mut self, outcome: TargetOutcome, now_s: f64, arrival: Option<Arrived>) {
        if let Some(arrival) = arrival {
            return self.store_arrival(arrival);
        }
        let result = self.result_of(&self.current, outcome);
        self.store(TargetResult { at_s: Some(now_s), ..result }, None);
    }

    fn drop_ahead(&mut self, outcome: TargetOutcome) {
        for point in std::mem::take(&mut self.ahead) {
            self.number += 1;
            self.store(self.result_of(&point, outcome), None);
        }
    }

    pub(crate) fn advance(&mut self, arrival: Arrived, since_tick: u64) {
        if self.ahead.is_empty() {
            return;
        }
        self.store_arrival(arrival);
        self.current = self.ahead.remove(0);
        self.number += 1;
        (self.since_tick, self.began_s) = (since_tick, arrival.0.stamp.seconds());
    }

    fn result_of(&self, point: &TargetPoint, outcome: TargetOutcome) -> TargetResult {
        TargetResult {
            number: self.number,
            x_m: point.x_m,
            y_m: point.y_m,
            outcome,
            at_s: None,
            distance_m: None,
            truth_m: None,
            followed: None,
        }
    }

    fn store_arrival(&mut self, (command, outcome): Arrived) {
        let result = TargetResult {
            at_s: Some(command.stamp.seconds()),
            distance_m: Some(command.distance_m),
            ..self.result_of(&self.current, outcome)
        };
        self.store(result, Some(command.stamp.tick));
    }

    fn store(&mut self, result: TargetResult, tick: Option<u64>) {
        if self.results.len() == MOST_RESULTS {
            self.results.remove(0);
            self.recorded = self.recorded.saturating_sub(1);
        }
        self.results.push(Stored { result, tick });
    }

    /// Returns the results to record now, in order. If there `is_truth`, arrivals wait for it.
    pub(crate) fn take_known(&mut self, is_truth: bool) -> Vec<TargetResult> {
        let is_known = |it: &&Stored| !is_truth || it.tick.is_none() || it.result.truth_m.is_some();
        let known: Vec<_> = self
            .results
            .iter()
            .skip(self.recorded)
            .take_while(is_known)
            .map(|stored| stored.result)
            .collect();
        self.recorded += known.len();
        known
    }

    /// Completes arrivals' results by the ground truth; `allowed_m` is the maximum error.
    pub(crate) fn compare(&mut self, record: &Record, truth: &[GroundTruthTick], allowed_m: f64) {
        for Stored { result, tick } in &mut self.results {
            let Some(tick) = tick.filter(|_| result.truth_m.is_none()) else {
                continue;
            };
            let pose = record.pose_at(tick).filter(|pose| pose.stamp.tick == tick);
            // The ground truth of an unfinished tick may be missing.
            let known = truth.last().is_some_and(|last| last.heard_tick() >= tick);
            if let Some(index) = pose.filter(|_| known).and_then(|pose| truth_of(pose, truth)) {
                let distance_m = apart_m(&truth[index], result);
                result.truth_m = Some(distance_m);
                if distance_m > allowed_m {
                    result.outcome = TargetOutcome::WrongPlace;
                }
            }
        }
    }

    /// `ended` is the final ground truth.
    pub(crate) fn results(
        &self,
        ending: &Ending,
        last_tick: Option<u64>,
        arrival: Option<&CommandSample>,
        ended: Option<&GroundTruthTick>,
    ) -> Vec<TargetResult> {
        let mut results: Vec<_> = self.results.iter().map(|stored| stored.result).collect();
        let over = self.results.iter().position(|stored| {
            stored.tick.zip(last_tick).is_some_and(|(arrived, last)| arrived > last)
        });
        let outcome = match ending.outcome {
            Outcome::Reached => TargetOutcome::Reached,
            Outcome::WrongPlace => TargetOutcome::WrongPlace,
            Outcome::ReachedUnsure => TargetOutcome::ReachedUnsure,
            _ => TargetOutcome::Missed,
        };
        let mut current = self.result_of(&self.current, outcome);
        if let Some(arrival) = arrival.filter(|_| outcome != TargetOutcome::Missed) {
            current.at_s = Some(arrival.stamp.seconds());
            current.distance_m = Some(arrival.distance_m);
            current.truth_m = ended.map(|ended| apart_m(ended, &current));
        }
        if self.has_target() {
            results.push(current);
        }
        let ahead = (self.number + 1..).zip(&self.ahead);
        results.extend(ahead.map(|(number, it)| TargetResult {
            number,
            ..self.result_of(it, TargetOutcome::NotTried)
        }));
        for (nth, result) in results.iter_mut().enumerate().skip(over.unwrap_or(usize::MAX)) {
            let is_first = over == Some(nth);
            result.outcome = if is_first { TargetOutcome::Missed } else { TargetOutcome::NotTried };
            (result.at_s, result.distance_m, result.truth_m) = (None, None, None);
        }
        results
    }
}

fn apart_m(truth: &GroundTruthTick, target: &TargetResult) -> f64 {
    (truth.x - target.x_m).hypot(truth.y - target.y_m)
}

/// Returns the ending of a run whose last target ended with `ending`, or of a worse earlier
/// arrival.
pub(crate) fn of_all(ending: Ending, results: &[TargetResult]) -> Ending {
    if ending.outcome != Outcome::Reached {
        return ending;
    }
    let worse = [
        (TargetOutcome::WrongPlace, Outcome::WrongPlace, "was in the wrong place"),
        (
            TargetOutcome::Unreachable,
            Outcome::Unreachable,
            "was beside a hazard, outside the tolerance",
        ),
        (TargetOutcome::ReachedUnsure, Outcome::ReachedUnsure, "was unsure"),
    ];
    worse
        .into_iter()
        .find_map(|(of_target, outcome, words)| {
            let is_so = |it: &&TargetResult| it.outcome == of_target && it.distance_m.is_some();
            let result = results.iter().find(is_so)?;
            let reason =
                format!("{}; the arrival at target {} {words}", ending.reason, result.number);
            Some(Ending::failed(outcome, reason))
        })
        .unwrap_or(ending)
}

pub(crate) const fn held_refusal(reason: HoldReason) -> Option<RequestAnswer> {
    match reason {
        HoldReason::Starting | HoldReason::Ending => Some(RequestAnswer::NotRunning),
        HoldReason::Operator => Some(RequestAnswer::Stopped),
        HoldReason::None | HoldReason::StageHeld | HoldReason::Waiting | HoldReason::Lost => None,
    }
}

/// Returns the refusal to send the robot to `points`, if any.
pub(crate) fn refusal(
    points: Option<&[TargetPoint]>,
    reason: HoldReason,
    mission: &Mission,
    record: &Record,
) -> Option<RequestAnswer> {
    if let Some(answer) = held_refusal(reason) {
        return Some(answer);
    }
    let Some(points) = points else {
        return Some(RequestAnswer::Malformed);
    };
    if mission.planner.calibration.is_some() {
        return Some(RequestAnswer::FixedTarget);
    }
    if record.grid.frame().is_none() {
        return Some(RequestAnswer::NotRunning);
    }
    points.iter().find_map(|point| {
        let place = point.position();
        if !(place.is_finite() && point.heading_rad.is_finite()) {
            return Some(RequestAnswer::Malformed);
        }
        if point.heading().is_some() && mission.body().steering.is_some() {
            return Some(RequestAnswer::NoHeading);
        }
        if !mission.contains(place) {
            return Some(RequestAnswer::Outside);
        }
        record.grid.is_hazard(place).then_some(RequestAnswer::InHazard)
    })
}

#[cfg(test)]
mod tests;
