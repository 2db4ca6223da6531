//! The two wheels on the wire: their channels and signs, counts in, timed commands out.

use std::time::Duration;

use common::{
    mission::{Body, Channel, Mission, RobotConfig},
    samples::WheelSample,
    wire::{
        Addressing, COUNT_CYCLE, Command, Encoder, Feedback, Mode, MotorSensors, Parameter,
        Request, Stream,
    },
};

/// The drive of one robot.
#[derive(Clone, Debug)]
pub struct Drive {
    robot: RobotConfig,
    body: Body,
    limit: Duration,
}

impl Drive {
    /// Of the robot of `mission`.
    #[must_use]
    pub fn new(mission: &Mission) -> Self {
        Self {
            robot: mission.robot.clone(),
            body: mission.body(),
            limit: Duration::from_secs_f64(mission.robot.command_limit_s),
        }
    }

    /// How long a command holds.
    #[must_use]
    pub const fn limit(&self) -> Duration {
        self.limit
    }

    /// Encoders as feedback, velocity mode, motors enabled, sensors streaming.
    #[must_use]
    pub fn greeting(&self) -> Vec<u8> {
        let mut bytes = Vec::new();
        let mut say = |command: Command| command.encode(Addressing::default(), &mut bytes);
        for channel in [self.robot.left.channel, self.robot.right.channel] {
            for parameter in [
                Parameter::Feedback(Feedback::Encoder),
                Parameter::Mode(Mode::Velocity),
            ] {
                say(Command::Parameter { channel, parameter });
            }
            say(Command::Enable {
                on: true,
                channel: Some(channel),
            });
        }
        for stream in [Stream::Motor, Stream::Custom, Stream::Standard] {
            say(Command::Stream {
                stream,
                request: Request::Start,
            });
        }
        bytes
    }

    /// What a motor frame says of the wheels, growing forward.
    #[must_use]
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

    /// A channel's encoder, turned so that it grows forward.
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

    /// rad/s to counts/s, limited to what the wheel can do; what is no number stands.
    #[must_use]
    pub fn counts_per_second(&self, speed: f64) -> i16 {
        let per_radian = self.body.counts_per_turn / std::f64::consts::TAU;
        let top = self.body.top_speed_m_s / self.body.metres_per_count();
        let counts = (speed * per_radian).clamp(-top, top).round();
        // -32768 and -32767 mean "leave alone".
        counts.clamp(-32_766.0, 32_766.0) as i16
    }

    /// A timed velocity command: a robot that obeys the time stops by itself when we fall silent.
    #[must_use]
    pub fn velocity(&self, [left, right]: [i16; 2], limit: Duration) -> Vec<u8> {
        let mut channels = [None; 2];
        for (channel, counts) in [(self.robot.left, left), (self.robot.right, right)] {
            let signed = if channel.reversed { -counts } else { counts };
            channels[usize::from(channel.channel.min(1))] = Some(signed);
        }
        let limit_ms = limit.as_millis().min(u128::from(u16::MAX)) as u16;
        encoded(Command::velocity(channels, limit_ms))
    }

    /// The wheels to rest, for as long as a command holds.
    #[must_use]
    pub fn stop(&self) -> Vec<u8> {
        self.velocity([0, 0], self.limit)
    }
}

/// The frame of a command.
#[must_use]
pub fn encoded(command: Command) -> Vec<u8> {
    let mut bytes = Vec::new();
    command.encode(Addressing::default(), &mut bytes);
    bytes
}
