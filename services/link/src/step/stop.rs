//! Handling of stops.

use std::time::Duration;

use common::{driver::StopMethod, samples::Cause};

use super::{Effect, Link, STOP_AGAIN, STOP_AGAINST_OTHERS};
use crate::failsafe::{
    Decision,
    monitor::{Monitor as _, Observation},
};

impl Link {
    /// Decides on all that is known now. Time alone may add a cause.
    pub(super) fn decide(&mut self) -> Decision {
        self.observe(Observation::Time);
        self.failsafe.decide(self.in_ticks(), self.moment())
    }

    /// Stops the robot when it must not move. In lockstep the link only withholds commands: mission
    /// time stands still, so the run continues as if never held.
    pub(super) fn guard(&mut self) {
        let now = self.decide();
        let before = std::mem::replace(&mut self.decision, now);
        if now.cause == Cause::AnotherCommander {
            // The wheels obey the other commander.
            self.failsafe.odometry.observe(&Observation::Resumed, self.moment());
        }
        if now.stops() {
            self.repeat = None;
            if !self.in_ticks() {
                if self.failsafe.applied(Cause::OperatorStop) {
                    self.stood = Some(self.now);
                }
                // The robot may still obey a command of an earlier link.
                let new = !before.stops()
                    || self.stop_sent_ns.is_none() && self.failsafe.presence.wire_open;
                self.send_stop(new);
            }
        }
        if now != before {
            self.effects.push(Effect::Decided { before, now });
        }
    }

    /// In counts/s.
    pub(super) fn tell(&mut self, counts: [i16; 2], limit: Duration) {
        if self.failsafe.stop.method > 0 && counts != [0, 0] {
            // Another stop method may have changed the robot's settings.
            self.send(self.base.greeting());
        }
        self.commanded(counts);
        self.send(self.base.velocity(counts, limit));
    }

    /// Sends copies of a new stop, then repeats it at intervals.
    pub(super) fn send_stop(&mut self, new: bool) {
        let does_not_stop = self.failsafe.applied(Cause::RobotDoesNotStop);
        if new {
            self.effects.extend(self.final_stops());
        } else if self.failsafe.latency.is_testing() && self.stop_sent_ns.is_some() {
            // The latency monitor waits for late acknowledgements.
            return;
        } else if self.failsafe.stop.takes_next_method(does_not_stop, self.now) {
            self.send(self.stop());
            let method = self.other_stop().map_or("velocity 0", |other| other.name);
            self.effects.push(Effect::StopBy(method));
        } else if !does_not_stop && self.is_stop_due() {
            self.send(self.stop());
        } else {
            // The last method needs time to take effect.
            return;
        }
        self.commanded([0, 0]);
        self.stop_sent_ns = Some(self.now_ns);
    }

    /// Returns whether a stop is due. A silent robot may receive, so it gets one with each ping.
    fn is_stop_due(&self) -> bool {
        const { assert!(STOP_AGAINST_OTHERS.as_millis() < STOP_AGAIN.as_millis()) };
        if self.connected() {
            self.passed(self.stop_sent_ns, STOP_AGAIN)
        } else {
            self.pinged_ns == Some(self.now_ns) && self.stop_sent_ns != Some(self.now_ns)
        }
    }

    fn commanded(&mut self, counts: [i16; 2]) {
        self.speeds.told(counts);
        self.observe(Observation::Commanded(counts));
        self.restart.commanded(counts, self.now);
    }

    /// Returns None for velocity 0, the first method, which also follows the last.
    pub(super) fn other_stop(&self) -> Option<StopMethod> {
        // Usually nothing needs encoding.
        let method = Some(self.failsafe.stop.method).filter(|method| *method > 0)?;
        let mut others = self.base.other_stops();
        let method = method % (others.len() + 1);
        method.checked_sub(1).map(|other| others.swap_remove(other))
    }

    pub(super) fn stop(&self) -> Vec<u8> {
        self.other_stop().map_or_else(|| self.velocity_0(), |other| other.bytes)
    }

    pub(super) fn velocity_0(&self) -> Vec<u8> {
        self.base.velocity([0, 0], self.limit)
    }
}
