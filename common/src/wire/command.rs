//! Host to robot.

use super::{
    did,
    frame::{Addressing, Frame, MessageError, SystemSignal, length},
};

/// Channels of the motor board. The wheels are on two of them.
pub const CHANNELS: usize = 6;
/// "Leave this channel alone" as it is sent.
const ALONE: i16 = i16::MIN;
/// The same as one client sends it.
const ALSO_ALONE: i16 = i16::MIN + 1;
/// Stands before the time of a timed command.
const TIME_FOLLOWS: u8 = 28;

/// What a motion command sets.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Quantity {
    /// Counts, cyclic 0..32767 with an encoder as feedback.
    Position,
    /// Pulse width: 0..32767 is full backward to full forward, 16384 stands still.
    Pwm,
    /// Counts per second.
    Velocity,
}

/// Which channels a motion command sets, and to what.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Targets {
    /// One channel, 0 to 5.
    One {
        /// The channel.
        channel: u8,
        /// Its target.
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
            Self::One {
                channel: set,
                value,
            } => (*set == channel).then_some(*value),
            Self::All(values) => values.get(usize::from(channel)).copied().flatten(),
        }
    }
}

/// A motion command.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Motion {
    /// What it sets.
    pub quantity: Quantity,
    /// Where, and to what.
    pub targets: Targets,
    /// After how long it ends, milliseconds; without it, it lasts. Not every robot obeys.
    pub limit_ms: Option<u16>,
}

/// What a channel's loop measures itself by.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Feedback {
    /// One potentiometer.
    #[default]
    OnePot,
    /// Two potentiometers.
    TwoPots,
    /// The wheel's encoder.
    Encoder,
}

/// What a channel's loop controls.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Mode {
    /// Nothing: the pulse width is given.
    #[default]
    Pwm,
    /// Position.
    Position,
    /// Velocity.
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
    /// What the loop measures itself by.
    Feedback(Feedback),
    /// What the loop controls.
    Mode(Mode),
    /// Polarity, bumper protection and whatever else: taken, and nothing done.
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

/// What to do with a stream.
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
        /// Which, and to what.
        parameter: Parameter,
    },
    /// Let motors run, or suspend them.
    Enable {
        /// Whether they may run.
        on: bool,
        /// One channel; all without it.
        channel: Option<u8>,
    },
    /// Start or stop a sensor stream.
    Stream {
        /// Which.
        stream: Stream,
        /// What to do with it.
        request: Request,
    },
    /// Ping or acknowledge.
    System(SystemSignal),
}

impl Command {
    /// Velocities of channels 0 and 1, counts per second, for `limit_ms` if it is given. The others are
    /// left alone.
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
        Frame {
            rid: addressing.robot(),
            sn: 0,
            did,
            data: &data,
        }
        .encode(out);
    }

    /// What a frame asks of the robot.
    ///
    /// # Errors
    /// When the frame is sound but no command: unknown DID, odd length, a byte that means nothing.
    pub fn parse(frame: &Frame<'_>) -> Result<Self, MessageError> {
        let data = frame.data;
        match frame.did {
            did::POSITION => one(frame, Quantity::Position),
            did::PWM => one(frame, Quantity::Pwm),
            did::VELOCITY => one(frame, Quantity::Velocity),
            did::POSITION_ALL => all(frame, Quantity::Position),
            did::PWM_ALL => all(frame, Quantity::Pwm),
            did::VELOCITY_ALL => all(frame, Quantity::Velocity),
            did::PARAMETER => parameter(data),
            did::ENABLE => match *data {
                [on] => Ok(Self::Enable {
                    on: on != 0,
                    channel: None,
                }),
                [on, number, ..] => Ok(Self::Enable {
                    on: on != 0,
                    channel: Some(channel(did::ENABLE, number)?),
                }),
                [] => Err(length(did::ENABLE, data, "1 or 2")),
            },
            did::MOTOR => Ok(stream(Stream::Motor, data)),
            did::CUSTOM => Ok(stream(Stream::Custom, data)),
            did::STANDARD => Ok(stream(Stream::Standard, data)),
            did::ALL_SENSORS => Ok(stream(Stream::All, data)),
            did::SYSTEM => SystemSignal::parse(data).map(Self::System),
            did => Err(MessageError::UnknownDid { did }),
        }
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

fn channel(did: u8, number: u8) -> Result<u8, MessageError> {
    if usize::from(number) < CHANNELS {
        return Ok(number);
    }
    Err(MessageError::Value {
        did,
        what: "channel",
        value: number,
    })
}

fn target(low: u8, high: u8) -> Option<i16> {
    match i16::from_le_bytes([low, high]) {
        ALONE | ALSO_ALONE => None,
        value => Some(value),
    }
}

fn one(frame: &Frame<'_>, quantity: Quantity) -> Result<Command, MessageError> {
    let did = frame.did;
    let (number, low, high, limit_ms) = match *frame.data {
        [number, low, high] => (number, low, high, None),
        [number, low, high, _, first, second] => {
            (number, low, high, Some(u16::from_le_bytes([first, second])))
        }
        _ => return Err(length(did, frame.data, "3 or 6")),
    };
    let channel = channel(did, number)?;
    let targets = match target(low, high) {
        Some(value) => Targets::One { channel, value },
        None => Targets::All([None; CHANNELS]),
    };
    Ok(Command::Motion(Motion {
        quantity,
        targets,
        limit_ms,
    }))
}

fn all(frame: &Frame<'_>, quantity: Quantity) -> Result<Command, MessageError> {
    let (values, time) = frame
        .data
        .split_at_checked(2 * CHANNELS)
        .ok_or_else(|| length(frame.did, frame.data, "12, 14 or 15"))?;
    let limit_ms = match *time {
        [] => None,
        [low, high] | [TIME_FOLLOWS, low, high] | [low, high, _] => {
            Some(u16::from_le_bytes([low, high]))
        }
        _ => return Err(length(frame.did, frame.data, "12, 14 or 15")),
    };
    let mut targets = [None; CHANNELS];
    for (slot, pair) in targets.iter_mut().zip(values.chunks_exact(2)) {
        *slot = target(pair[0], pair[1]);
    }
    Ok(Command::Motion(Motion {
        quantity,
        targets: Targets::All(targets),
        limit_ms,
    }))
}

fn parameter(data: &[u8]) -> Result<Command, MessageError> {
    let invalid = |what, value| MessageError::Value {
        did: did::PARAMETER,
        what,
        value,
    };
    let (sub, number, rest) = match data {
        [sub, number, rest @ ..] => (*sub, *number, rest),
        _ => return Err(length(did::PARAMETER, data, "2 or more")),
    };
    let parameter = match (sub, rest) {
        (7, terms) => Parameter::PositionPid(gains(terms)?),
        (8, terms) => Parameter::VelocityPid(gains(terms)?),
        (13, [source, ..]) => Parameter::Feedback(match source {
            0 => Feedback::OnePot,
            1 => Feedback::TwoPots,
            2 => Feedback::Encoder,
            &other => return Err(invalid("feedback source", other)),
        }),
        (14, [mode, ..]) => Parameter::Mode(match mode {
            0 => Mode::Pwm,
            1 => Mode::Position,
            2 => Mode::Velocity,
            &other => return Err(invalid("mode", other)),
        }),
        (13 | 14, []) => return Err(length(did::PARAMETER, data, "3")),
        // Not every parameter has a channel in second place: do not judge the byte.
        (sub, _) => {
            return Ok(Command::Parameter {
                channel: number,
                parameter: Parameter::Other { sub },
            });
        }
    };
    Ok(Command::Parameter {
        channel: channel(did::PARAMETER, number)?,
        parameter,
    })
}

fn gains(terms: &[u8]) -> Result<Gains, MessageError> {
    let mut gains = Gains::default();
    for term in terms.chunks(3) {
        let &[number, low, high] = term else {
            return Err(length(did::PARAMETER, terms, "3 for each gain"));
        };
        let slot = match number {
            1 => &mut gains.kp,
            2 => &mut gains.kd,
            3 => &mut gains.ki_x100,
            value => {
                return Err(MessageError::Value {
                    did: did::PARAMETER,
                    what: "gain",
                    value,
                });
            }
        };
        *slot = Some(u16::from_le_bytes([low, high]));
    }
    Ok(gains)
}

fn stream(stream: Stream, data: &[u8]) -> Command {
    let request = match data.first() {
        None | Some(255) => Request::Start,
        Some(0) => Request::Stop,
        Some(&count) => Request::Count(count),
    };
    Command::Stream { stream, request }
}
