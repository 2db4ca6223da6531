//! Whether the robot may move, and how it is made to stand.

use std::time::Duration;

use common::{
    clock::MissionTime,
    samples::{Cause, CommandSample},
};

use super::{Effect, Link, NewestDirective, STOP_AGAIN, passed};
use crate::{
    failsafe::{self, Ages, Decision, Directive, Flags},
    odometry::Plausibility,
    stop_monitor::StopMethod,
};

impl Link {
    pub(super) fn decide(&self, now_ns: u64) -> Decision {
        let directive = |newest: NewestDirective| Directive {
            order: newest.order,
            reason: newest.reason,
            age: Duration::from_nanos(now_ns.saturating_sub(newest.heard_ns)),
        };
        let flags = Flags {
            directive: self.directive.map(directive),
            connected: self.presence.connected(),
            command: self.newest_command.map(|command| self.ages(&command)),
            battery: self.telemetry.charge(),
            health: self.health_flags(now_ns),
        };
        failsafe::decide(&flags, self.drive.limit())
    }

    /// What the failsafe decides by. A robot that does not answer says nothing.
    fn health_flags(&self, now_ns: u64) -> failsafe::HealthFlags {
        if self.in_ticks() || !self.presence.connected() {
            return failsafe::HealthFlags::default();
        }
        let said = self.health.flags(self.now, now_ns, self.presence.silence());
        let odometry = match said.odometry {
            // Nobody waits for a robot that is not to drive.
            Plausibility::GivenUp if !self.ordered_to_drive() => Plausibility::Suspected,
            odometry => odometry,
        };
        failsafe::HealthFlags { odometry, ..said }
    }

    pub(super) fn ages(&self, command: &CommandSample) -> Ages {
        let stamp = command.stamp.time();
        // in lockstep no time passes until the command has come.
        let now = if self.in_ticks() { stamp } else { self.now };
        // A stamp from the future would never grow old.
        let age = |then: MissionTime| {
            if then <= now {
                now.since(then)
            } else {
                Duration::MAX
            }
        };
        Ages {
            command: age(stamp),
            pose: age(MissionTime(command.pose_ns)),
            guidance: age(MissionTime(command.guidance_ns)),
        }
    }

    /// Stop the robot when it must not move. in lockstep it waits for commands, and to let none pass
    /// stops its time, too: a run that was held goes on as if it had not been.
    pub(super) fn guard(&mut self, now_ns: u64, effects: &mut Vec<Effect>) {
        self.health.pass(now_ns);
        let now = self.decide(now_ns);
        let before = std::mem::replace(&mut self.decision, now);
        if now.stops() {
            self.repeat = None;
            if !self.in_ticks() {
                self.send_stop(!before.stops(), now_ns, effects);
            }
        }
        if now != before {
            effects.push(Effect::Decided { before, now });
        }
    }

    /// Tell the wheels these counts/s.
    pub(super) fn tell(&mut self, counts: [i16; 2], limit: Duration, effects: &mut Vec<Effect>) {
        if self.health.stop_method() != StopMethod::Velocity && counts != [0, 0] {
            // It was made to stand by other means than those it drives by.
            effects.push(Effect::Send(self.drive.greeting()));
        }
        self.health.commanded(counts, self.now);
        effects.push(Effect::Send(self.drive.velocity(counts, limit)));
    }

    /// Several times when the stop is new, then again now and then.
    pub(super) fn send_stop(&mut self, new: bool, now_ns: u64, effects: &mut Vec<Effect>) {
        if new {
            effects.extend(self.final_stops().into_iter().map(Effect::Send));
        } else if self.health.awaits_late_ones() && self.stop_sent_ns.is_some() {
            // Whatever is acknowledged now was sent long ago.
            return;
        } else if let Some(method) = self.health.next_stop_method(self.now) {
            effects.push(Effect::Send(self.drive.stop_by(method)));
            effects.push(Effect::StopBy(method));
        } else if self.decision.cause == Cause::RobotDoesNotStop {
            // What was tried is given time.
            return;
        } else if self.presence.connected() && passed(self.stop_sent_ns, now_ns, STOP_AGAIN) {
            effects.push(Effect::Send(self.drive.stop_by(self.health.stop_method())));
        } else {
            return;
        }
        self.health.commanded([0, 0], self.now);
        self.stop_sent_ns = Some(now_ns);
    }
}
