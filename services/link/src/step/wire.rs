//! The part of the step that hears the robot and follows its presence.

use std::time::Duration;

use common::{
    driver::{Heard, Motion, counts::WheelCounts},
    samples::PowerSample,
    wire::COUNT_CYCLE,
};

use super::{Effect, Link, PING_EVERY, passed};
use crate::failsafe::monitor::{Counts, Monitor as _, Observation};

/// Pause between logs of refused messages, and the letters of a reason that are logged.
const REFUSED_AGAIN: Duration = Duration::from_secs(1);
const LONGEST_REFUSAL: usize = 200;

impl Link {
    pub(super) fn take_wire(&mut self, open: bool, now_ns: u64, effects: &mut Vec<Effect>) {
        self.failsafe.monitors.presence.wire(open);
        self.driver.reset();
        // Stops sent to a closed wire are lost.
        self.stop_sent_ns = None;
        if !open {
            self.lose(now_ns, effects);
        }
    }

    pub(super) fn take_heard(&mut self, now_ns: u64, effects: &mut Vec<Effect>) {
        let mut heard = self.driver.heard();
        if let Some(why) = heard.refused.take()
            && passed(self.refused_ns, now_ns, REFUSED_AGAIN)
        {
            self.refused_ns = Some(now_ns);
            // The reason may quote the robot, which may send any text.
            let why = why.escape_debug().take(LONGEST_REFUSAL).collect();
            effects.push(Effect::Refused(why));
        }
        let rate = heard.stamp_ns.and_then(|stamp_ns| self.clock_rate.take(stamp_ns, self.now));
        effects.extend(rate.map(Effect::ClockRate));
        if let Some(commander) = heard.commander {
            self.observe(Observation::Commander(commander), now_ns);
            // The robot obeys the newest command: at another commander's first one the failsafe stops it, below.
            if commander.moves && self.decision.stops() && !self.in_ticks() {
                effects.push(Effect::Send(self.stop()));
            }
        }
        if let Some(words) = heard.two_publishers.take() {
            self.observe(Observation::TwoPublishers(&words), now_ns);
        }
        for _ in 0..heard.acknowledged {
            self.observe(Observation::Acknowledged, now_ns);
        }
        if heard.pinged {
            effects.push(Effect::Send(self.driver.acknowledge()));
        }
        if heard.jumped {
            self.restart.jumped();
        }
        let motion = heard.motion;
        let counts = motion.map(|motion| self.judge_counts(&motion, now_ns));
        if counts == Some(Counts::Elsewhere) {
            effects.push(Effect::CountsElsewhere);
        }
        if matches!(counts, Some(Counts::Restarted { .. })) {
            effects.push(Effect::Restarted);
            if self.connected() {
                // A restarted robot has its default settings.
                effects.push(Effect::Send(self.driver.greeting()));
            }
        }
        self.take_sensors(&heard, now_ns, effects);
        if heard.anything && self.failsafe.monitors.presence.heard(now_ns) {
            let again = self.losses() > 0;
            self.observe(Observation::Found { again }, now_ns);
            effects.push(Effect::Connected(true));
            effects.push(Effect::Send(self.driver.greeting()));
            // The robot may still drive by a command of an earlier link.
            self.stop_sent_ns = None;
            if self.in_ticks() {
                // These frames answer the greeting, and their number depends on the robot's start. Ticks begin with those that answer
                // the order.
                if motion.is_some() {
                    self.due = self.due.saturating_sub(1);
                }
                if self.ordered_to_drive() {
                    self.ping(now_ns, effects);
                }
                return;
            }
        }
        if counts == Some(Counts::Implausible) {
            // These counts start no tick: the robot stands until its motion is known again, so that little of it is lost.
            self.repeat = None;
            self.tell([0, 0], self.limit, now_ns, effects);
        } else if let Some(motion) = motion {
            self.begin_tick(motion, now_ns, effects);
        }
    }

    /// All counts are plausible in lockstep, because a simulated robot does not restart; only contacts are noticed.
    fn judge_counts(&mut self, motion: &Motion, now_ns: u64) -> Counts {
        let wheels = motion.wheels;
        let counts = match WheelCounts::of(&wheels, motion.endless.as_ref()) {
            WheelCounts::Cyclic(counts) => counts.map(|count| count % COUNT_CYCLE).into(),
            endless @ WheelCounts::Endless(_) => endless,
        };
        let currents = Observation::Currents(motion.currents);
        if self.in_ticks() {
            let now = self.moment(now_ns);
            let odometry = &mut self.failsafe.monitors.odometry;
            odometry.observe(&currents, now);
            odometry.observe(&Observation::Motor(counts, Counts::Follow), now);
            return Counts::Follow;
        }
        self.observe(currents, now_ns);
        let speeds = [wheels.left_counts_per_s, wheels.right_counts_per_s];
        let was_away = !self.connected();
        let are = self.restart.step(counts, speeds, was_away, self.now);
        self.observe(Observation::Motor(counts, are), now_ns);
        if let Some(response) = self.failsafe.monitors.odometry.take_found() {
            self.observe(Observation::Responds(response), now_ns);
        }
        are
    }

    fn take_sensors(&mut self, heard: &Heard, now_ns: u64, effects: &mut Vec<Effect>) {
        if let Some(power) = heard.power {
            let volts = [power.board_v, power.motor_v, power.servo_v];
            self.observe(Observation::Batteries(volts), now_ns);
            let battery = &mut self.failsafe.monitors.battery;
            let [board_low, motor_low, servo_low] = battery.low().map(u8::from);
            effects.push(Effect::Power(PowerSample { board_low, motor_low, servo_low, ..power }));
            effects.extend(battery.take_changes().into_iter().map(Effect::Battery));
        }
        effects.extend(heard.surroundings.map(Effect::Surroundings));
        effects.extend(heard.infrared.map(Effect::Infrared));
        if !heard.readings.is_empty() {
            self.observe(Observation::Readings(&heard.readings), now_ns);
        }
    }

    pub(super) fn ping(&mut self, now_ns: u64, effects: &mut Vec<Effect>) {
        self.pinged_ns = Some(now_ns);
        self.failsafe.monitors.presence.pinged(now_ns);
        if self.ordered_to_drive() {
            self.due += 1;
        }
        effects.push(Effect::Send(self.driver.ping()));
        self.poll_in_ticks(effects);
    }

    pub(super) fn keep_connected(&mut self, now_ns: u64, effects: &mut Vec<Effect>) {
        let silent = self.monitors().presence.is_silent(now_ns);
        // A robot that waits for a command is not lost: if its next motor frame is missing, a datagram was lost.
        let owes = self.ordered_to_drive() && self.open.is_none();
        if silent && !self.in_ticks() {
            self.lose(now_ns, effects);
        }
        if !self.in_ticks()
            && self.connected()
            && !self.monitors().latency.is_testing()
            && self.other_stop().is_none()
            && self.failsafe.monitors.streams.wants_request(now_ns)
        {
            effects.push(Effect::Send(self.driver.ask_for_sensors()));
            effects.push(Effect::AskedForStreams);
        }
        let owing = self.in_ticks() && owes && silent && self.connected();
        if self.failsafe.monitors.presence.wants_ping(now_ns) {
            self.ping(now_ns, effects);
        } else if owing && passed(self.pinged_ns, now_ns, PING_EVERY) {
            self.due = 0;
            self.ping(now_ns, effects);
        }
    }

    pub(super) fn lose(&mut self, now_ns: u64, effects: &mut Vec<Effect>) {
        if !self.failsafe.monitors.presence.lose(now_ns) {
            return;
        }
        self.restart.lost();
        self.observe(Observation::Lost, now_ns);
        effects.push(Effect::Connected(false));
    }
}
