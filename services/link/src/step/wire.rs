//! Handling of the robot's messages and presence.

use std::time::Duration;

use common::{
    clock::MissionTime,
    driver::{Heard, Motion, Refusal, counts::WheelCounts},
    samples::{PowerSample, Sweep},
    wire::COUNT_CYCLE,
};

use super::{Effect, Link, PING_EVERY, STOP_AGAINST_OTHERS};
use crate::failsafe::monitor::{Counts, Monitor as _, Observation};

/// Log interval of refused messages, and logged characters of a reason.
const REFUSED_AGAIN: Duration = Duration::from_secs(1);
const LONGEST_REFUSAL: usize = 200;

impl Link {
    pub(super) fn take_wire(&mut self, open: bool) {
        self.failsafe.presence.wire(open);
        self.base.reset();
        // Bytes for a closed wire are lost.
        self.stop_sent_ns = None;
        self.due = 0;
        if !open {
            self.lose();
        }
    }

    /// Takes a sensor's bytes, which say nothing about the robot's motion or presence.
    pub(super) fn take_sensor(&mut self, number: u8, bytes: &[u8]) {
        let Some(driver) = self.drivers.get_mut(usize::from(number)) else {
            return;
        };
        let mut heard = driver.hear(bytes);
        heard.motion = None;
        self.take_refusal(heard.refused.take());
        self.take_readings(&mut heard, Some(self.now));
    }

    pub(super) fn take_sensor_wire(&mut self, number: u8, open: bool) {
        if let Some(driver) = self.drivers.get_mut(usize::from(number)) {
            driver.reset();
            if open {
                self.effects.push(Effect::SendSensor(number, driver.greeting()));
            }
        }
    }

    fn take_refusal(&mut self, why: Option<Refusal>) {
        if let Some(why) = why
            && self.passed(self.refused_ns, REFUSED_AGAIN)
        {
            self.refused_ns = Some(self.now_ns);
            // The reason may quote arbitrary text.
            let clean = |letter: char| if letter.is_control() { '?' } else { letter };
            let [input, what, remedy] = [why.input, why.what, why.remedy]
                .map(|text| text.chars().take(LONGEST_REFUSAL).map(clean).collect());
            self.effects.push(Effect::Refused(Refusal { input, what, remedy }));
        }
    }

    pub(super) fn take_heard(&mut self, mut heard: Heard) {
        self.take_refusal(heard.refused.take());
        let rate = heard.stamp_ns.and_then(|stamp_ns| self.clock_rate.take(stamp_ns, self.now));
        self.effects.extend(rate.map(Effect::ClockRate));
        if let Some(words) = heard.two_publishers.take() {
            self.observe(Observation::TwoPublishers(&words));
        }
        for _ in 0..heard.acknowledged {
            self.observe(Observation::Acknowledged);
        }
        if let Some(commander) = heard.commander {
            self.observe(Observation::Commander(commander));
        }
        let is_told = std::mem::take(&mut self.failsafe.commander.is_told);
        // The robot obeys the newest command, so each of another commander gets a stop. At the
        // first one, the failsafe stops it below.
        if (is_told || heard.commander.is_some_and(|commander| commander.moves))
            && self.decision.stops()
            && !self.in_ticks()
            && self.passed(self.stop_sent_ns, STOP_AGAINST_OTHERS)
        {
            self.send(self.stop());
            self.stop_sent_ns = Some(self.now_ns);
        }
        if heard.pinged {
            self.send(self.base.acknowledge());
        }
        self.restart.jumped |= heard.jumped;
        let motion = heard.motion;
        let counts = motion.map(|motion| self.judge_counts(&motion));
        if counts == Some(Counts::Elsewhere) {
            self.effects.push(Effect::CountsElsewhere);
        }
        let restarted = heard.restarted || matches!(counts, Some(Counts::Restarted { .. }));
        if restarted {
            self.effects.push(Effect::Restarted);
        }
        if (restarted || counts == Some(Counts::Elsewhere)) && self.connected() && !self.in_ticks()
        {
            // A restarted robot has default settings.
            self.send(self.base.greeting());
        }
        self.take_power(&heard);
        self.take_readings(&mut heard, None);
        if !heard.touched.is_empty() {
            self.observe(Observation::Touched(&heard.touched));
        }
        if heard.anything && self.failsafe.presence.heard(self.now_ns) {
            self.observe(Observation::Found { again: self.losses() > 0 });
            self.effects.push(Effect::Connected(true));
            self.send(self.base.greeting());
            // The robot may still obey an earlier link's command.
            self.stop_sent_ns = None;
            if self.in_ticks() && self.base.is_polled() {
                // Its answer to a ping has no motion, and it was not polled yet.
                self.due = 0;
                if self.ordered_to_drive() {
                    self.ping();
                }
            }
        }
        if counts == Some(Counts::Implausible) {
            // No tick starts here. The robot stands until its motion is known again, to lose little
            // of it.
            self.repeat = None;
            self.tell([0, 0], self.limit);
        } else if let Some(motion) = motion {
            self.begin_tick(motion);
        }
    }

    /// Classifies counts. In lockstep all are plausible, because a simulated robot does not
    /// restart. Its motion is judged as a tick begins, because the number of further frames depends
    /// on the machine.
    fn judge_counts(&mut self, motion: &Motion) -> Counts {
        if self.in_ticks() {
            return Counts::Follow;
        }
        let wheels = motion.wheels;
        let counts = cyclic(motion);
        self.observe(Observation::Currents(motion.currents));
        let speeds = [wheels.left_counts_per_s, wheels.right_counts_per_s];
        let are = self.restart.step(counts, speeds, !self.connected(), self.now);
        self.observe(Observation::Motor(counts, are));
        self.tell_response();
        are
    }

    fn tell_response(&mut self) {
        if let Some(response) = self.failsafe.odometry.found.take() {
            self.observe(Observation::Responds(response));
            self.effects.extend(self.failsafe.base.words().map(Effect::FoundResponse));
        }
    }

    /// Judges a lockstep tick's motion: contacts, wheel shares, and an unstated response.
    pub(super) fn judge_tick(&mut self, motion: &Motion) {
        let now = self.moment();
        let odometry = &mut self.failsafe.odometry;
        odometry.observe(&Observation::Currents(motion.currents), now);
        odometry.observe(&Observation::Motor(cyclic(motion), Counts::Follow), now);
        // A simulated X80 answers as stated.
        if odometry.searches {
            self.tell_response();
        }
    }

    fn take_readings(&mut self, heard: &mut Heard, own_wire: Option<MissionTime>) {
        if let Some(stamp_ns) = heard.motion.and_then(|motion| motion.stamp_ns) {
            self.stamped = Some((stamp_ns, self.now));
        }
        for scan in &heard.scans {
            let (first_s, first_beam_ns) = match (scan.stamp_ns, self.stamped) {
                (Some(scan_ns), Some((motion_ns, at))) => (at.seconds(), scan_ns - motion_ns),
                _ => (own_wire.unwrap_or(self.now).seconds(), scan.sweep.first_beam_ns),
            };
            let middle_ns = Sweep { first_beam_ns, ..scan.sweep }.middle_ns(scan.beams.len());
            self.observe(Observation::Scan(scan, first_s + middle_ns as f64 * 1e-9));
        }
        let readings = self.sensors.take_heard(heard, own_wire);
        if !readings.is_empty() {
            self.observe(Observation::Readings(&readings));
        }
    }

    fn take_power(&mut self, heard: &Heard) {
        if let Some(power) = heard.power {
            self.observe(Observation::Batteries([power.board_v, power.motor_v, power.servo_v]));
            let battery = &mut self.failsafe.battery;
            let [board_low, motor_low, servo_low] = battery.low().map(u8::from);
            self.effects.push(Effect::Power(PowerSample {
                board_low,
                motor_low,
                servo_low,
                ..power
            }));
            self.effects.extend(battery.changes.drain(..).map(Effect::Battery));
        }
        self.effects.extend(heard.surroundings.map(Effect::Surroundings));
        self.effects.extend(heard.infrared.map(Effect::Infrared));
    }

    pub(super) fn ping(&mut self) {
        self.pinged_ns = Some(self.now_ns);
        self.failsafe.presence.pinged(self.now_ns);
        self.due += 1;
        self.send(self.base.ping());
        self.poll_in_ticks();
    }

    pub(super) fn keep_connected(&mut self) {
        let silent = self.failsafe.presence.is_silent(self.now_ns);
        let in_ticks = self.in_ticks();
        if silent && !in_ticks {
            self.lose();
        }
        if !in_ticks
            && self.connected()
            && !self.failsafe.latency.is_testing()
            && self.other_stop().is_none()
            && self.failsafe.streams.wants_request(self.now_ns)
        {
            self.send(self.base.ask_for_sensors());
            let greetings = (0..).zip(&self.drivers);
            let greetings =
                greetings.map(|(number, driver)| Effect::SendSensor(number, driver.greeting()));
            self.effects.extend(greetings);
            self.effects.push(Effect::AskedForStreams);
        }
        // A robot that waits for a command is present: if its next motor frame is missing, a
        // datagram was lost.
        let waits = in_ticks && self.connected() && self.ordered_to_drive() && self.open.is_none();
        if self.failsafe.presence.wants_ping(self.now_ns) {
            self.ping();
        } else if waits && silent && self.passed(self.pinged_ns, PING_EVERY) {
            self.due = 0;
            self.ping();
        }
    }

    pub(super) fn lose(&mut self) {
        if !self.failsafe.presence.lose(self.now_ns) {
            return;
        }
        self.restart.away = true;
        self.observe(Observation::Lost);
        self.effects.push(Effect::Connected(false));
    }
}

/// Returns wire-cyclic counts, or endless ones of reported angles.
fn cyclic(motion: &Motion) -> WheelCounts {
    match WheelCounts::of(&motion.wheels, motion.endless.as_ref()) {
        WheelCounts::Cyclic(counts) => counts.map(|count| count % COUNT_CYCLE).into(),
        endless @ WheelCounts::Endless(_) => endless,
    }
}
