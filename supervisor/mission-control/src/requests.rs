//! The part of the loop that takes operators' requests, and sends the robot to its next target.

use common::{
    clock::monotonic_ns,
    samples::{Cause, HoldReason, RequestAnswer, RequestKind, RequestSample, name_str},
};

use crate::{
    error::SupervisorError,
    outcome::{Ending, Outcome, allowed_m},
    supervisor::Supervisor,
    target_list,
};

impl Supervisor<'_> {
    /// Carry out and answer the requests of operators. Returns whether there was one.
    pub(crate) fn take_requests(&mut self, first_tick: u64) -> Result<bool, SupervisorError> {
        let mut asked = false;
        while let Some(request) = self.bus.requests.next_sample()? {
            asked = true;
            let answer = self.carry_out_request(&request, first_tick);
            let (kind, reason) = (RequestKind::from_byte(request.kind), answer.text());
            if answer != RequestAnswer::Taken {
                tracing::warn!(?kind, reason, "an operator's request is refused");
            }
            self.bus.last_request = (request.id, answer);
            self.bus.publish_order(self.mission_time(), request, answer);
            // Each answer is published, because the roster has one.
            self.publish_state()?;
        }
        Ok(asked)
    }

    fn carry_out_request(&mut self, request: &RequestSample, first_tick: u64) -> RequestAnswer {
        match RequestKind::from_byte(request.kind) {
            RequestKind::Nothing => return RequestAnswer::Unknown,
            RequestKind::Restart => {
                let stage = name_str(&request.stage);
                tracing::warn!(stage, "an operator asks for a new generation");
                self.stages.replace(stage, first_tick);
            }
            // The process that told of this stop was slow: the link obeyed at once, and an operator has resumed since.
            RequestKind::Stop if request.asked_ns < self.resumed_ns => {
                tracing::warn!("an operator's stop is over, because the robot was resumed since");
            }
            RequestKind::Stop => {
                tracing::warn!("an operator stops the robot");
                self.state_file.state.operator_stop = true;
            }
            RequestKind::Resume => {
                tracing::warn!("an operator lets the robot go on");
                self.state_file.state.operator_stop = false;
                // A future time would void all stops until then.
                self.resumed_ns = request.asked_ns.min(monotonic_ns());
            }
            kind @ (RequestKind::Goto | RequestKind::Append) => {
                return self.send_robot(request, kind == RequestKind::Append, first_tick);
            }
        }
        RequestAnswer::Taken
    }

    fn send_robot(
        &mut self,
        request: &RequestSample,
        appends: bool,
        first_tick: u64,
    ) -> RequestAnswer {
        let record = &self.bus.observer.record;
        let mission = &self.options.mission;
        // The link may obey an operator before the supervisor does.
        let stopped = self.state_file.state.operator_stop
            || record.link.is_some_and(|link| link.cause() == Cause::OperatorStop);
        let reason = if stopped { HoldReason::Operator } else { self.decision.reason };
        let points = request.targets();
        if let Some(answer) = target_list::refusal(points, reason, mission, record) {
            return answer;
        }
        let points = points.unwrap_or_default();
        if appends && !self.targets.waits() {
            return match self.targets.append(points) {
                true => RequestAnswer::Taken,
                false => RequestAnswer::TooMany,
            };
        }
        let limit = self.recovery_steps.limit();
        let since_tick = limit.map_or(first_tick, |limit| limit.last_tick + 1);
        let (arrival, now_s) = (record.sure_arrival(mission), self.mission_time().seconds());
        self.targets.replace(points, (since_tick, now_s), arrival);
        self.on_new_target();
        RequestAnswer::Taken
    }

    /// Let the robot wait for its next target if the run stays, and `ending` is that of its target. Returns whether it waits.
    pub(crate) fn settle(&mut self, ending: &Ending) -> bool {
        let ends =
            matches!(ending.outcome, Outcome::Reached | Outcome::Timeout | Outcome::Unreachable);
        if !self.options.mission.stay || !ends {
            return false;
        }
        let now_s = self.mission_time().seconds();
        let arrival = self.bus.observer.record.sure_arrival(&self.options.mission);
        tracing::info!(
            number = self.targets.number(),
            outcome = ending.outcome.as_str(),
            reason = ending.reason,
            "the robot waits for its next target"
        );
        self.targets.settle(ending.outcome, now_s, arrival);
        self.stall_watch.settle();
        self.await_target();
        true
    }

    /// No command is an arrival before there is a target.
    pub(crate) fn await_target(&mut self) {
        let record = &mut self.bus.observer.record;
        (record.target_number, record.arrival) = (u64::MAX, None);
        self.arrived = None;
    }

    /// Send the robot to its next target if it has arrived at one that is not the last. Returns whether it is sent.
    pub(crate) fn take_arrival(&mut self) -> bool {
        let mission = &self.options.mission;
        let record = &self.bus.observer.record;
        self.targets.compare(record, self.robot.truth(), allowed_m(mission));
        let arrival = record.sure_arrival(mission).filter(|_| !self.targets.is_last());
        let Some(arrival) = arrival else { return false };
        let stamp = arrival.0.stamp;
        if stamp.time().seconds() >= self.deadline().at_s() {
            return false;
        }
        let since_tick = match self.clock.in_ticks() {
            // No tick follows an arrival in lockstep.
            true => stamp.tick + 1,
            false => self.first_tick(),
        };
        self.targets.advance(arrival, since_tick);
        self.on_new_target();
        true
    }

    fn on_new_target(&mut self) {
        let sample = self.targets.sample();
        tracing::info!(
            number = sample.number,
            last = sample.last,
            x_m = sample.target.x_m,
            y_m = sample.target.y_m,
            "the robot is sent to its next target"
        );
        self.bus.observer.record.target_number = sample.number;
        self.bus.observer.record.arrival = None;
        self.arrived = None;
        // The deadline counts anew for each target.
        self.state_file.state.operator_stopped_s = 0.0;
    }
}
