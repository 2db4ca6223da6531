//! Host to robot.

mod parse;

use super::{
    did,
    frame::{Addressing, Frame, SystemSignal},
};

/// Channels of the motor board. The wheels are on two of them.
pub const CHANNELS: usize = 6;
/// The value for a channel that a command does not change.
const ALONE: i16 = i16::MIN;
/// The value that one client sends for such a channel.
const ALSO_ALONE: i16 = i16::MIN + 1;
/// The byte before the time limit of a command.
const TIME_FOLLOWS: u8 = 28;

/// The quantity that a motion command sets.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Quantity {
    /// Counts, cyclic 0..32767 with an encoder as feedback.
    Position,
    /// Pulse width: 0..32767 is full backward to full forward, 16384 stands still.
    Pwm,
    /// Counts per second.
    Velocity,
}

/// The channels that a motion command sets, and their values.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Targets {
    /// A single channel, 0 to 5.
    One {
        channel: u8,
        /// The target.
        value: i16,
    },
    /// Every channel that is not left alone.
    All([Option<i16>; CHANNELS]),
}

impl Targets {
    /// The target of `channel`; none if the command leaves it alone.
    #[must_use]
    pub fn of(&self, channel: u8) -> Option<i16> {
        match self {
            Self::One { channel: set, value } => (*set == channel).then_some(*value),
            Self::All(values) => values.get(usize::from(channel)).copied().flatten(),
        }
    }
}

/// A motion command.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Motion {
    /// The quantity that it sets.
    pub quantity: Quantity,
    /// The channels and their values.
    pub targets: Targets,
    /// The time after which the motion ends, milliseconds; none if it does not end. Not all robots respect it.
    pub limit_ms: Option<u16>,
}

/// The sensor from which a channel's loop gets its feedback.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Feedback {
    /// A single potentiometer.
    #[default]
    OnePot,
    /// Two potentiometers.
    TwoPots,
    /// The wheel's encoder.
    Encoder,
}

/// The quantity that a channel's loop controls.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Mode {
    /// The pulse width, without a loop.
    #[default]
    Pwm,
    Position,
    Velocity,
}

/// PID gains, as many as a command brings.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Gains {
    /// Proportional.
    pub kp: Option<u16>,
    /// Derivative.
    pub kd: Option<u16>,
    /// Integral, times 100.
    pub ki_x100: Option<u16>,
}

/// A parameter of one channel.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Parameter {
    /// Gains of the position loop.
    PositionPid(Gains),
    /// Gains of the velocity loop.
    VelocityPid(Gains),
    /// The sensor that gives the loop's feedback.
    Feedback(Feedback),
    /// The quantity that the loop controls.
    Mode(Mode),
    /// Polarity, bumper protection and other parameters, which are accepted and ignored.
    Other {
        /// The number of the parameter.
        sub: u8,
    },
}

/// A sensor stream.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stream {
    /// 123.
    Motor,
    /// 124.
    Custom,
    /// 125.
    Standard,
    /// All three.
    All,
}

/// A request about a stream.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Request {
    /// Send for ever.
    Start,
    /// Send no more.
    Stop,
    /// Send so many frames, 1 to 254, and then no more.
    Count(u8),
}

/// Host to robot.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Command {
    /// Move.
    Motion(Motion),
    /// Set a parameter of a channel.
    Parameter {
        /// 0 to 5.
        channel: u8,
        /// The parameter and its value.
        parameter: Parameter,
    },
    /// Let motors run, or suspend them.
    Enable {
        /// Whether they may run.
        on: bool,
        /// The channel; none for all channels.
        channel: Option<u8>,
    },
    /// Start or stop a sensor stream.
    Stream { stream: Stream, request: Request },
    /// Ping or acknowledge.
    System(SystemSignal),
}

impl Command {
    /// Velocities of channels 0 and 1, counts per second, for `limit_ms` if it is given. The other channels are left
    /// alone.
    #[must_use]
    pub fn velocity(wheels: [Option<i16>; 2], limit_ms: impl Into<Option<u16>>) -> Self {
        Self::Motion(Motion {
            quantity: Quantity::Velocity,
            targets: Targets::All([wheels[0], wheels[1], None, None, None, None]),
            limit_ms: limit_ms.into(),
        })
    }

    /// Append the frame of this command to `out`.
    pub fn encode(&self, addressing: Addressing, out: &mut Vec<u8>) {
        let mut data = Vec::with_capacity(16);
        let did = match *self {
            Self::Motion(motion) => motion.write(&mut data),
            Self::Parameter { channel, parameter } => parameter.write(channel, &mut data),
            Self::Enable { on, channel } => {
                data.push(u8::from(on));
                data.extend(channel);
                did::ENABLE
            }
            Self::Stream { stream, request } => {
                match request {
                    Request::Start => {}
                    Request::Stop => data.push(0),
                    Request::Count(count) => data.push(count),
                }
                match stream {
                    Stream::Motor => did::MOTOR,
                    Stream::Custom => did::CUSTOM,
                    Stream::Standard => did::STANDARD,
                    Stream::All => did::ALL_SENSORS,
                }
            }
            Self::System(signal) => {
                data.push(signal.byte());
                did::SYSTEM
            }
        };
        Frame { rid: addressing.robot(), sn: 0, did, data: &data }.encode(out);
    }
}

impl Motion {
    fn write(self, data: &mut Vec<u8>) -> u8 {
        match self.targets {
            Targets::One { channel, value } => {
                data.push(channel);
                data.extend_from_slice(&value.to_le_bytes());
                if let Some(limit) = self.limit_ms {
                    data.push(TIME_FOLLOWS);
                    data.extend_from_slice(&limit.to_le_bytes());
                }
                match self.quantity {
                    Quantity::Position => did::POSITION,
                    Quantity::Pwm => did::PWM,
                    Quantity::Velocity => did::VELOCITY,
                }
            }
            Targets::All(values) => {
                for value in values {
                    data.extend_from_slice(&value.unwrap_or(ALONE).to_le_bytes());
                }
                if let Some(limit) = self.limit_ms {
                    data.extend_from_slice(&limit.to_le_bytes());
                }
                match self.quantity {
                    Quantity::Position => did::POSITION_ALL,
                    Quantity::Pwm => did::PWM_ALL,
                    Quantity::Velocity => did::VELOCITY_ALL,
                }
            }
        }
    }
}

impl Parameter {
    fn write(self, channel: u8, data: &mut Vec<u8>) -> u8 {
        match self {
            Self::PositionPid(gains) => gains.write(7, channel, data),
            Self::VelocityPid(gains) => gains.write(8, channel, data),
            Self::Feedback(feedback) => data.extend([13, channel, feedback as u8]),
            Self::Mode(mode) => data.extend([14, channel, mode as u8]),
            Self::Other { sub } => data.extend([sub, channel]),
        }
        did::PARAMETER
    }
}

impl Gains {
    fn write(self, sub: u8, channel: u8, data: &mut Vec<u8>) {
        data.extend([sub, channel]);
        for (number, gain) in [(1, self.kp), (2, self.kd), (3, self.ki_x100)] {
            if let Some(gain) = gain {
                data.push(number);
                data.extend_from_slice(&gain.to_le_bytes());
            }
        }
    }
}
