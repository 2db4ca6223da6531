mod parse;

use super::{
    did,
    frame::{Addressing, Frame, SystemSignal},
};

/// Channels of the motor board; the wheels use two.
pub const CHANNELS: usize = 6;
/// Value that leaves a channel unchanged.
const ALONE: i16 = i16::MIN;
/// Alternative value, sent by one client.
const ALSO_ALONE: i16 = i16::MIN + 1;
/// Byte before the time limit of a command.
const TIME_FOLLOWS: u8 = 28;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Quantity {
    /// Counts, cyclic 0..32767 with encoder feedback.
    Position,
    /// Pulse width: 0..32767 is full backward to full forward, 16384 is standstill.
    Pwm,
    /// Counts per second.
    Velocity,
}

impl Quantity {
    const fn dids(self) -> [u8; 2] {
        match self {
            Self::Position => [did::POSITION, did::POSITION_ALL],
            Self::Pwm => [did::PWM, did::PWM_ALL],
            Self::Velocity => [did::VELOCITY, did::VELOCITY_ALL],
        }
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Targets {
    /// 0 to 5.
    One { channel: u8, value: i16 },
    /// `None` leaves a channel unchanged.
    All([Option<i16>; CHANNELS]),
}

impl Targets {
    pub fn of(&self, channel: u8) -> Option<i16> {
        match self {
            Self::One { channel: set, value } => (*set == channel).then_some(*value),
            Self::All(values) => values.get(usize::from(channel)).copied().flatten(),
        }
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Motion {
    pub quantity: Quantity,
    pub targets: Targets,
    /// Duration of the motion. Some robots ignore it.
    pub limit_ms: Option<u16>,
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Feedback {
    #[default]
    OnePot,
    TwoPots,
    Encoder,
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Mode {
    /// Pulse width, open loop.
    #[default]
    Pwm,
    Position,
    Velocity,
}

/// Gains; a command carries up to three.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Gains {
    pub kp: Option<u16>,
    pub kd: Option<u16>,
    /// Gain times 100.
    pub ki_x100: Option<u16>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Parameter {
    PositionPid(Gains),
    VelocityPid(Gains),
    Feedback(Feedback),
    Mode(Mode),
    /// Polarity, bumper protection and others, which are accepted and ignored.
    Other {
        sub: u8,
    },
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum Stream {
    Motor = did::MOTOR,
    Custom = did::CUSTOM,
    Standard = did::STANDARD,
    All = did::ALL_SENSORS,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Request {
    Start,
    Stop,
    /// Sends 1 to 254 frames, then stops.
    Count(u8),
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Command {
    Motion(Motion),
    Parameter {
        channel: u8,
        parameter: Parameter,
    },
    Enable {
        on: bool,
        /// `None` is all channels.
        channel: Option<u8>,
    },
    Stream {
        stream: Stream,
        request: Request,
    },
    System(SystemSignal),
}

impl Command {
    /// Commands channels 0 and 1, counts per second, and leaves the others unchanged.
    pub fn velocity(wheels: [Option<i16>; 2], limit_ms: impl Into<Option<u16>>) -> Self {
        Self::Motion(Motion {
            quantity: Quantity::Velocity,
            targets: Targets::All([wheels[0], wheels[1], None, None, None, None]),
            limit_ms: limit_ms.into(),
        })
    }

    /// Returns the setup of a wheel's channel: encoder feedback, velocity mode, enabled motor.
    pub const fn drives(channel: u8) -> [Self; 3] {
        [
            Self::Parameter { channel, parameter: Parameter::Feedback(Feedback::Encoder) },
            Self::Parameter { channel, parameter: Parameter::Mode(Mode::Velocity) },
            Self::Enable { on: true, channel: Some(channel) },
        ]
    }

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
                stream as u8
            }
            Self::System(signal) => {
                data.push(signal as u8);
                did::SYSTEM
            }
        };
        assert!(data.len() <= usize::from(u8::MAX));
        Frame { rid: addressing.robot(), sn: 0, did, data: &data }.encode(out);
    }
}

impl Motion {
    fn write(self, data: &mut Vec<u8>) -> u8 {
        let [of_one, of_all] = self.quantity.dids();
        let (did, before_limit) = match self.targets {
            Targets::One { channel, value } => {
                data.push(channel);
                data.extend(value.to_le_bytes());
                (of_one, Some(TIME_FOLLOWS))
            }
            Targets::All(values) => {
                data.extend(values.iter().flat_map(|value| value.unwrap_or(ALONE).to_le_bytes()));
                (of_all, None)
            }
        };
        if let Some(limit) = self.limit_ms {
            data.extend(before_limit);
            data.extend(limit.to_le_bytes());
        }
        did
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
