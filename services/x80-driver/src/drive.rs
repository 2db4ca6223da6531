//! Counts from motor frames and timed commands, with the mission's channels and signs, for two
//! wheels or a car's wheel and steering.

use std::time::Duration;

use common::{
    mission::{Channel, Mission, RobotConfig},
    samples::WheelSample,
    wire::{
        Addressing, CHANNELS, COUNT_CYCLE, Command, Encoder, Feedback, Mode, Motion, MotorSensors,
        Parameter, Quantity, Request, Stream, Targets,
    },
};

/// Largest command, counts/s: -32768 and -32767 leave the channel unchanged.
const FASTEST: i16 = 32_766;

/// Pulse width at which a wheel stands.
const PWM_STANDS: i16 = 16_384;

#[derive(Debug)]
pub struct Drive {
    robot: RobotConfig,
}

impl Drive {
    pub fn new(mission: &Mission) -> Self {
        Self { robot: mission.robot.clone() }
    }

    /// Returns the setup: encoder feedback, velocity mode, enabled motors, running streams.
    pub fn greeting(&self) -> Vec<u8> {
        let settings = [self.robot.left.channel, self.robot.right.channel].map(|channel| {
            [
                Command::Parameter { channel, parameter: Parameter::Feedback(Feedback::Encoder) },
                Command::Parameter { channel, parameter: Parameter::Mode(Mode::Velocity) },
                Command::Enable { on: true, channel: Some(channel) },
            ]
        });
        [settings.concat().into_iter().flat_map(encoded).collect(), self.streams()].concat()
    }

    pub fn streams(&self) -> Vec<u8> {
        let start = |stream| encoded(Command::Stream { stream, request: Request::Start });
        [Stream::Motor, Stream::Custom, Stream::Standard].map(start).concat()
    }

    /// Returns counts that grow forward.
    pub fn wheels(&self, sensors: &MotorSensors) -> WheelSample {
        let left = self.wheel(sensors, self.robot.left);
        let right = self.wheel(sensors, self.robot.right);
        WheelSample {
            left_counts: left.position,
            right_counts: right.position,
            left_counts_per_s: left.velocity(),
            right_counts_per_s: right.velocity(),
            ..WheelSample::default()
        }
    }

    pub fn currents(&self, sensors: &MotorSensors) -> [u16; 2] {
        let channels = [self.robot.left, self.robot.right];
        channels.map(|wheel| sensors.currents[usize::from(wheel.channel.min(1))])
    }

    fn wheel(&self, sensors: &MotorSensors, channel: Channel) -> Encoder {
        let encoder = sensors.encoders[usize::from(channel.channel.min(1))];
        if !channel.reversed {
            return encoder;
        }
        Encoder {
            position: (COUNT_CYCLE - encoder.position % COUNT_CYCLE) % COUNT_CYCLE,
            positive: !encoder.positive,
            ..encoder
        }
    }

    /// Encodes a velocity. A robot that respects the limit stops by itself after the link ended.
    pub fn velocity(&self, [left, right]: [i16; 2], limit: Duration) -> Vec<u8> {
        let mut channels = [None; 2];
        for (channel, counts) in [(self.robot.left, left), (self.robot.right, right)] {
            let within = counts.clamp(-FASTEST, FASTEST);
            let signed = if channel.reversed { -within } else { within };
            channels[usize::from(channel.channel.min(1))] = Some(signed);
        }
        let limit_ms = limit.as_millis().min(u128::from(u16::MAX)) as u16;
        encoded(Command::velocity(channels, limit_ms))
    }

    pub fn disable(&self) -> Vec<u8> {
        let channels = [self.robot.left.channel, self.robot.right.channel].map(Some);
        channels.map(|channel| encoded(Command::Enable { on: false, channel })).concat()
    }

    pub fn still_pulses(&self) -> Vec<u8> {
        let mut targets = [None; CHANNELS];
        for wheel in [self.robot.left.channel, self.robot.right.channel] {
            targets[usize::from(wheel.min(1))] = Some(PWM_STANDS);
        }
        encoded(Command::Motion(Motion {
            quantity: Quantity::Pwm,
            targets: Targets::All(targets),
            limit_ms: None,
        }))
    }
}

pub fn encoded(command: Command) -> Vec<u8> {
    let mut bytes = Vec::new();
    command.encode(Addressing::default(), &mut bytes);
    bytes
}
