//! Part of the loop that handles operators' requests and the next target.

use common::{
    clock::{Instant, monotonic_ns},
    geometry::Zone,
    mission::{MOST_CORNERS, MOST_ZONES},
    samples::{
        Cause, DEAD_MAN, HoldReason, MOST_TARGETS, PlaceSample, RequestAnswer, RequestKind,
        RequestSample, Rest, TargetPoint, TargetSample, name_str,
    },
};

use glam::DVec2;
use processes::records;

use crate::{
    bus_endpoints::warn_if_failed,
    error::Result,
    order::Decision,
    outcome::{Ending, Outcome, allowed_m},
    supervisor::Supervisor,
    target_list::{self, TargetOutcome},
};

/// Distance of a hand-driven target beyond the slow-down radius, metres; it moves with each
/// request.
const HAND_AHEAD_M: f64 = 0.3;

impl Supervisor<'_> {
    /// Returns whether there was a request.
    pub(crate) fn take_requests(&mut self) -> Result<bool> {
        let mut asked = false;
        while let Some(request) = self.bus.requests.next_sample()? {
            asked = true;
            let answer = self.carry_out_request(&request);
            let (kind, reason) = (request.kind(), answer.text());
            if answer != RequestAnswer::Taken {
                tracing::warn!(?kind, reason, "an operator's request is refused");
            }
            self.last_request = (request.id, answer);
            let (tick, time) = (self.record.newest_tick(), self.mission_time());
            let order = RequestSample { answer: answer.into(), ..request };
            warn_if_failed(self.bus.orders.publish(tick.unwrap_or_default(), time, order));
            // The roster holds one answer, so each is published separately.
            self.publish_state()?;
        }
        Ok(asked)
    }

    fn carry_out_request(&mut self, request: &RequestSample) -> RequestAnswer {
        match request.kind() {
            // A run that ends takes only stops.
            kind if kind != RequestKind::Stop && self.decision == Decision::ENDING => {
                return RequestAnswer::NotRunning;
            }
            RequestKind::Nothing => return RequestAnswer::Unknown,
            RequestKind::Restart => {
                let stage = name_str(&request.stage);
                tracing::warn!(stage, "an operator asks for a new generation");
                self.stages.replace(stage, self.first_tick());
            }
            // This stop came late: the link obeyed at once, and an operator has resumed since.
            RequestKind::Stop if request.asked_ns < self.resumed_ns => {
                tracing::warn!("an operator's stop ends, because the robot was resumed since");
            }
            RequestKind::Stop => {
                tracing::warn!("an operator stops the robot");
                self.state.operator_stop = true;
            }
            RequestKind::Resume => {
                tracing::warn!("an operator resumes the robot");
                self.state.operator_stop = false;
                // A future time would void all stops until then.
                self.resumed_ns = request.asked_ns.min(monotonic_ns());
            }
            kind @ (RequestKind::Goto | RequestKind::Append) => {
                return self.send_robot(request, kind == RequestKind::Append);
            }
            RequestKind::Place => return self.place_robot(request),
            RequestKind::Follow => return self.follow(request),
            RequestKind::EndFollow => return self.end_follow(),
            RequestKind::Hand => return self.drive_by_hand(request),
            kind @ (RequestKind::AddZone | RequestKind::RemoveZone) => {
                return self.change_zones(request, kind == RequestKind::AddZone);
            }
        }
        RequestAnswer::Taken
    }

    /// Dead reckoning takes the place with the next tick, which resets the map.
    fn place_robot(&mut self, request: &RequestSample) -> RequestAnswer {
        let Some([point]) = request.targets() else { return RequestAnswer::Malformed };
        let [sigma_m, sigma_rad] = request.deviations;
        let is_sane = |sigma: f64| (0.005..=10.0).contains(&sigma);
        if !(point.heading_rad.is_finite() && is_sane(sigma_m) && is_sane(sigma_rad)) {
            return RequestAnswer::Malformed;
        }
        if !self.options.mission.contains(point.position()) {
            return RequestAnswer::Outside;
        }
        let stands_by = matches!(
            self.decision.reason,
            HoldReason::Operator | HoldReason::Waiting | HoldReason::Lost
        );
        let link = self.record.link;
        if !stands_by || link.is_none_or(|link| link.at_rest() != Rest::AtRest) {
            return RequestAnswer::Moves;
        }
        let number = self.state.place.number + 1;
        let TargetPoint { x_m, y_m, heading_rad, .. } = *point;
        tracing::warn!(x_m, y_m, heading_rad, "an operator places the robot");
        let stamp = Default::default();
        self.state.place = PlaceSample { stamp, number, x_m, y_m, heading_rad, sigma_m, sigma_rad };
        RequestAnswer::Taken
    }

    fn change_zones(&mut self, request: &RequestSample, adds: bool) -> RequestAnswer {
        const { assert!(MOST_TARGETS <= MOST_CORNERS) };
        let mission = &self.options.mission;
        let points: Vec<_> =
            request.targets().unwrap_or_default().iter().map(TargetPoint::position).collect();
        if !points.iter().all(|point| point.is_finite()) {
            return RequestAnswer::Malformed;
        }
        let state = &mut self.state;
        let (number, mut zones) = state.zones.clone().unwrap_or((0, mission.zones.clone()));
        let before = zones.len();
        match points[..] {
            [at] if !adds => zones.retain(|zone| zone.clearance(at) > 0.0),
            [_, _, _, ..] if adds && before < MOST_ZONES => zones.push(Zone { points }),
            _ => return RequestAnswer::NoZone,
        }
        if zones.len() == before {
            return RequestAnswer::NotInZone;
        }
        let here = self.record.pose.map_or(mission.start.at, |pose| pose.pose().position);
        let new = zones.last().filter(|_| adds);
        if new.is_some_and(|zone| zone.clearance(here) <= mission.body().radius_m) {
            return RequestAnswer::ZoneHere;
        }
        tracing::warn!(zones = zones.len(), "an operator changes the zones");
        state.zones = Some((number + 1, zones));
        RequestAnswer::Taken
    }

    fn send_robot(&mut self, request: &RequestSample, appends: bool) -> RequestAnswer {
        let mission = &self.options.mission;
        let points = request.targets();
        if let Some(answer) = target_list::refusal(points, self.why_held(), mission, &self.record) {
            return answer;
        }
        let points = points.unwrap_or_default();
        if appends && self.targets.has_target() {
            return if self.targets.append(points) {
                RequestAnswer::Taken
            } else {
                RequestAnswer::TooMany
            };
        }
        self.replace_targets(points);
        self.log_target();
        RequestAnswer::Taken
    }

    fn replace_targets(&mut self, points: &[TargetPoint]) {
        self.end_following(TargetOutcome::Followed);
        // In lockstep no tick begins while the robot waits.
        let waits = self.decision.reason == HoldReason::Waiting;
        let limit = self.recovery_steps.limit.filter(|_| !waits);
        let since_tick = limit.map_or_else(|| self.first_tick(), |limit| limit.last_tick + 1);
        let arrival = self.record.sure_arrival(&self.options.mission);
        self.targets.replace(points, (since_tick, self.pose_time().seconds()), arrival);
        self.on_new_target();
    }

    /// Moves the target ahead over free ground.
    fn drive_by_hand(&mut self, request: &RequestSample) -> RequestAnswer {
        let mission = &self.options.mission;
        if !mission.stay {
            return RequestAnswer::NotStaying;
        }
        let record = &self.record;
        let (Some([stick]), Some(pose)) = (request.targets(), record.pose) else {
            return RequestAnswer::Malformed;
        };
        // This target is too far for a slow-down at full speed.
        let reach_m = HAND_AHEAD_M + mission.controller.slow_radius_m;
        let here = pose.pose().position;
        let way = pose.pose().axis().rotate(stick.position().clamp_length_max(1.0)) * reach_m;
        let steps = (way.length() / mission.grid_frame().resolution_m).ceil();
        let points = (1..=steps as u32).map(|step| here + way * (f64::from(step) / steps));
        let is_free = |at: &DVec2| !record.grid.is_hazard(*at);
        let free = points.take_while(is_free).last().unwrap_or(here + way);
        let point = [TargetPoint::at(free)];
        if let Some(answer) = target_list::refusal(Some(&point), self.why_held(), mission, record) {
            return answer;
        }
        self.replace_targets(&point);
        self.targets.by_hand = true;
        self.hand_until = Some(Instant::now() + DEAD_MAN);
        RequestAnswer::Taken
    }

    /// Stops a hand-driven robot without recent requests. Returns whether it did.
    pub(crate) fn miss_hand(&mut self) -> bool {
        let is_gone = self.hand_until.take_if(|until| *until <= Instant::now()).is_some();
        let released = is_gone && self.targets.release();
        if released {
            self.await_target();
        }
        released
    }

    /// Returns the hold reason. The link may obey an operator before the supervisor does.
    pub(crate) fn why_held(&self) -> HoldReason {
        let link = self.record.link;
        let stopped = self.state.operator_stop
            || link.is_some_and(|link| link.cause() == Cause::OperatorStop);
        if stopped { HoldReason::Operator } else { self.decision.reason }
    }

    /// Lets the robot wait for its next target if the run stays after `ending`. Returns whether it
    /// waits.
    pub(crate) fn settle(&mut self, ending: &Ending) -> bool {
        let ends =
            matches!(ending.outcome, Outcome::Reached | Outcome::Timeout | Outcome::Unreachable);
        if !self.options.mission.stay || !ends {
            return false;
        }
        let now_s = self.pose_time().seconds();
        let arrival = self.record.sure_arrival(&self.options.mission);
        tracing::info!(
            number = self.targets.number,
            outcome = ending.outcome.as_str(),
            reason = ending.reason,
            "the robot waits for its next target"
        );
        if !self.end_following(TargetOutcome::Unreachable) {
            self.targets.settle(ending.outcome, now_s, arrival);
        }
        assert!(self.targets.waits);
        self.stall_watch.settle(self.record.pose.map(|pose| pose.stamp.tick));
        self.await_target();
        true
    }

    /// Voids arrivals until there is a target.
    pub(crate) fn await_target(&mut self) {
        (self.record.target_number, self.record.arrival) = (u64::MAX, None);
    }

    pub(crate) fn take_arrival(&mut self) -> bool {
        let mission = &self.options.mission;
        let record = &self.record;
        let truth = self.robot.truth();
        self.targets.compare(record, truth, allowed_m(mission));
        for result in self.targets.take_known(!truth.is_empty()) {
            records::append(&self.options.directory, records::TARGETS, &result);
        }
        let arrival = record.sure_arrival(mission).filter(|_| !self.targets.is_last());
        let Some(arrival) = arrival else { return false };
        let stamp = arrival.0.stamp;
        if stamp.seconds() >= self.deadline().at_s() {
            return false;
        }
        // In lockstep no tick follows an arrival.
        let since_tick = if self.clock.in_ticks() { stamp.tick + 1 } else { self.first_tick() };
        self.targets.advance(arrival, since_tick);
        self.on_new_target();
        self.log_target();
        true
    }

    fn log_target(&self) {
        let TargetSample { number, last, target: TargetPoint { x_m, y_m, .. }, .. } =
            self.targets.sample();
        tracing::info!(number, last, x_m, y_m, "the robot is sent to its next target");
    }

    pub(crate) fn on_new_target(&mut self) {
        (self.record.target_number, self.record.arrival) = (self.targets.number, None);
        // Each target has its own deadline.
        self.state.operator_stopped_s = 0.0;
    }
}
