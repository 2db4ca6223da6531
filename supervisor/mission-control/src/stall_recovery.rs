//! Part of the loop that detects stalls and carries out recovery steps.

use common::{
    clock::Instant,
    samples::{Cause, Order, RecoveryStep, StallSample, TickLimitSample},
};
use processes::{records, stages};

use crate::{
    bus_endpoints::warn_if_failed,
    error::Result,
    outcome::{Ending, Outcome},
    recovery_step::Next,
    stall,
    supervisor::Supervisor,
};

impl Supervisor<'_> {
    /// The last recovery step ends the mission.
    pub(crate) fn watch_for_stalls(&mut self) -> Result<Option<Ending>> {
        if self.decision.order() != Order::Drive {
            // In lockstep mission time stands still meanwhile.
            let record = &self.record;
            let pose = record.pose.filter(|_| !self.clock.in_ticks());
            let epoch = record.published.grid_epoch;
            if let Some(stall) = pose.and_then(|pose| self.stall_watch.stand(&pose, epoch)) {
                self.tell(&stall);
                // The directive carries the new epoch.
                self.publish_state()?;
            }
            return Ok(None);
        }
        loop {
            let published = self.record.published;
            match self.recovery_steps.next(published, Instant::now()) {
                Next::Wait => break,
                Next::Begin(RecoveryStep::Replan) => {
                    self.stages.replace(stages::PLANNER, self.first_tick());
                }
                Next::Begin(RecoveryStep::Reset) => self.publish_state()?,
                Next::Begin(RecoveryStep::GiveUp) => {
                    if let Some((_, ending)) = self.given_up() {
                        return Ok(Some(ending));
                    }
                }
                Next::Check => match self.next_stall() {
                    Some(stall) => self.recovery_steps.on_stall(stall),
                    None => {
                        if let Some(tick) = published.tick {
                            self.recovery_steps.on_checked(tick);
                        }
                        break;
                    }
                },
            }
        }
        self.publish_tick_limit()?;
        Ok(None)
    }

    fn next_stall(&mut self) -> Option<StallSample> {
        let record = &self.record;
        let in_ticks = self.clock.in_ticks();
        // The link stops a robot with held wheels, and only the supervisor can free it.
        let stopped =
            record.link.is_none_or(|link| link.stopped() && link.cause() != Cause::WheelsHeld);
        // The robot waits beside its beacon.
        let waits = self.targets.follows && record.arrival.is_some();
        // In lockstep mission time stands still while something holds the robot.
        let held = !in_ticks && (stopped || !self.stages.all_running()) || waits;
        if held {
            self.stall_watch.forget_motion();
        }
        // A tick without its command may be incomplete here.
        let newest = record.published.tick.filter(|_| in_ticks);
        let stall = record
            .ticks_since(self.stall_watch.tick())
            .take_while(|(pose, _)| newest.is_none_or(|newest| pose.stamp.tick <= newest))
            .find_map(|(pose, guidance)| {
                let contact = record.has_contact(self.stall_watch.tick(), pose.stamp.tick);
                self.stall_watch.step(pose, guidance, held, contact)
            })?;
        self.tell(&stall);
        Some(stall)
    }

    fn tell(&mut self, stall: &StallSample) {
        stall::log(stall);
        let stamp = stall.stamp;
        warn_if_failed(self.bus.stalls.publish(stamp.tick, stamp.time(), *stall));
        records::append(&self.options.directory, records::STALLS, stall);
    }

    /// Returns the tick and ending of the stall without a remaining recovery step.
    fn given_up(&self) -> Option<(u64, Ending)> {
        let stall = self.stall_watch.gave_up()?;
        let words = stall::words(stall.cause(), &self.options.mission.body());
        Some((
            stall.stamp.tick,
            Ending::failed(Outcome::Unreachable, format!("target unreachable: {words}")),
        ))
    }

    /// Like [`Self::given_up`], and in lockstep checks the ticks that the loop left unchecked;
    /// their number depends on the machine.
    pub(crate) fn end_by_stall(&mut self) -> Option<(u64, Ending)> {
        while self.clock.in_ticks()
            && self.stall_watch.gave_up().is_none()
            && self.next_stall().is_some()
        {}
        self.given_up()
    }

    pub(crate) fn publish_tick_limit(&mut self) -> Result {
        let target_number = self.targets.number;
        let limit = self.recovery_steps.limit;
        let beacon = self.state.following.map_or(u64::MAX, |_| self.beacon.last_tick);
        let limit = limit.map(|limit| TickLimitSample {
            target_number,
            last_tick: limit.last_tick.min(beacon),
            ..limit
        });
        if std::mem::replace(&mut self.published_limit, limit) != limit
            && let Some(limit) = limit
        {
            let (tick, time) = self.published_as_of();
            self.bus.tick_limit.publish(tick, time, limit)?;
        }
        Ok(())
    }
}
