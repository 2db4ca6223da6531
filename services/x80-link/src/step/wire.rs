//! The part of the step that takes the robot's frames and follows its presence.

use common::wire::{
    COUNT_CYCLE, Command, CustomSensors, MotorSensors, Report, StandardSensors, SystemSignal,
};

use super::{Effect, Link, PING_EVERY, passed};
use crate::{
    drive::encoded,
    failsafe::monitor::{Counts, Monitor as _, Observation},
};

impl Link {
    pub(super) fn take_wire(&mut self, open: bool, now_ns: u64, effects: &mut Vec<Effect>) {
        self.failsafe.monitors.presence.wire(open);
        // The rest of a frame does not follow in the next connection.
        self.decoder.reset();
        // What was sent while the wire was closed is lost.
        self.stop_sent_ns = None;
        if !open {
            self.lose(now_ns, effects);
        }
    }

    pub(super) fn take_frames(&mut self, now_ns: u64, effects: &mut Vec<Effect>) {
        let (mut motor, mut standard, mut custom) = (None, None, None);
        let (mut heard, mut ping) = (false, false);
        while let Some(frame) = self.decoder.next_frame() {
            match Report::parse(&frame) {
                Ok(Report::Standard(sensors)) => standard = Some(sensors),
                Ok(Report::Custom(sensors)) => custom = Some(sensors),
                Ok(Report::Motor(sensors)) => motor = Some(sensors),
                Ok(Report::System(SystemSignal::Ping)) => ping = true,
                Ok(Report::System(SystemSignal::Ack)) => {
                    self.observe(Observation::Acknowledged, now_ns);
                }
                // Any other frame only shows that the robot answers.
                Err(_) => {}
            }
            heard = true;
        }
        if ping {
            effects.push(Effect::Send(encoded(Command::System(SystemSignal::Ack))));
        }
        let counts = motor.map(|sensors| self.judge_counts(&sensors, now_ns));
        if counts == Some(Counts::Elsewhere) {
            effects.push(Effect::CountsElsewhere);
        }
        if matches!(counts, Some(Counts::Restarted { .. })) {
            effects.push(Effect::Restarted);
            if self.connected() {
                // A restarted robot has its default settings.
                effects.push(Effect::Send(self.drive.greeting()));
            }
        }
        if let Some(standard) = &standard {
            self.observe(Observation::Standard(standard), now_ns);
        }
        self.take_telemetry(motor.as_ref(), standard.as_ref(), custom.as_ref(), effects);
        let readings = self.rangers.take_fresh();
        if !readings.is_empty() {
            self.observe(Observation::Readings(&readings), now_ns);
        }
        if heard && self.failsafe.monitors.presence.heard(now_ns) {
            let again = self.losses() > 0;
            self.observe(Observation::Found { again }, now_ns);
            effects.push(Effect::Connected(true));
            effects.push(Effect::Send(self.drive.greeting()));
            // The robot may still drive by a command of an earlier link.
            self.stop_sent_ns = None;
            if self.in_ticks() {
                // These frames answer the greeting, and their number depends on the time that the robot took to start. Ticks begin with the
                // frames that answer the order.
                if motor.is_some() {
                    self.due = self.due.saturating_sub(1);
                }
                if self.ordered_to_drive() {
                    self.ping(now_ns, effects);
                }
                return;
            }
        }
        if counts == Some(Counts::Implausible) {
            // They start no tick. The robot stands until its motion is known again, so that little of it is lost.
            self.repeat = None;
            self.tell([0, 0], self.drive.limit(), now_ns, effects);
        } else if let Some(sensors) = motor {
            self.begin_tick(&sensors, now_ns, effects);
        }
    }

    /// Classify the counts of a frame. In lockstep all counts are plausible, because the robot is a simulated one that does not restart.
    /// Only its contacts are noticed then.
    pub(super) fn judge_counts(&mut self, sensors: &MotorSensors, now_ns: u64) -> Counts {
        let wheels = self.drive.wheels(sensors);
        let counts = [wheels.left_counts, wheels.right_counts];
        let counts = counts.map(|count| count % COUNT_CYCLE);
        let currents = Observation::Currents(self.drive.currents(sensors));
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
        are
    }

    /// Take the sensors that do not belong to the tick.
    pub(super) fn take_telemetry(
        &mut self,
        motor: Option<&MotorSensors>,
        standard: Option<&StandardSensors>,
        custom: Option<&CustomSensors>,
        effects: &mut Vec<Effect>,
    ) {
        if let Some(motor) = motor {
            self.telemetry.take_motor(motor);
        }
        if let Some(standard) = standard {
            self.rangers.take_standard(standard);
            let battery = &mut self.failsafe.monitors.battery;
            let (power, surroundings) = self.telemetry.take_standard(standard, battery.low());
            effects.push(Effect::Power(power));
            effects.push(Effect::Surroundings(surroundings));
            effects.extend(battery.take_changes().into_iter().map(Effect::Battery));
        }
        if let Some(infrared) = custom.and_then(|custom| self.rangers.take_custom(custom)) {
            effects.push(Effect::Infrared(infrared));
        }
    }

    pub(super) fn ping(&mut self, now_ns: u64, effects: &mut Vec<Effect>) {
        self.pinged_ns = Some(now_ns);
        self.failsafe.monitors.presence.pinged(now_ns);
        if self.ordered_to_drive() {
            self.due += 1;
        }
        effects.push(Effect::Send(encoded(Command::System(SystemSignal::Ping))));
    }

    pub(super) fn keep_connected(&mut self, now_ns: u64, effects: &mut Vec<Effect>) {
        let silent = self.monitors().presence.is_silent(now_ns);
        // A robot that waits for a command is not lost. If its next motor frame is missing, a datagram was lost.
        let owes = self.ordered_to_drive() && self.open.is_none();
        if silent && !self.in_ticks() {
            self.lose(now_ns, effects);
        }
        if !self.in_ticks()
            && self.connected()
            && !self.monitors().latency.is_testing()
            && self.failsafe.monitors.streams.wants_request(now_ns)
        {
            effects.push(Effect::Send(self.drive.streams()));
            effects.push(Effect::AskedForStreams);
        }
        let owing = self.in_ticks() && owes && silent && self.connected();
        if self.failsafe.monitors.presence.wants_ping(now_ns) {
            self.ping(now_ns, effects);
        } else if owing && passed(self.pinged_ns, now_ns, PING_EVERY) {
            // The frames that the robot still had to send are lost.
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
