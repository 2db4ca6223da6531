use super::{
    ALONE, ALSO_ALONE, CHANNELS, Command, Feedback, Gains, Mode, Motion, Parameter, Quantity,
    Request, Stream, TIME_FOLLOWS, Targets,
};
use crate::{
    did,
    frame::{Frame, MessageError, SystemSignal},
};

impl Command {
    /// # Errors
    /// If the DID is unknown, the length is wrong, or a byte has no meaning.
    pub fn parse(&Frame { did, data, .. }: &Frame<'_>) -> Result<Self, MessageError> {
        let stream = |stream| Some(Self::Stream { stream, request: request(data) });
        let command = match did {
            did::POSITION => one(data, Quantity::Position),
            did::PWM => one(data, Quantity::Pwm),
            did::VELOCITY => one(data, Quantity::Velocity),
            did::POSITION_ALL => all(data, Quantity::Position),
            did::PWM_ALL => all(data, Quantity::Pwm),
            did::VELOCITY_ALL => all(data, Quantity::Velocity),
            did::PARAMETER => parameter(data),
            did::ENABLE => enable(data),
            did::MOTOR => stream(Stream::Motor),
            did::CUSTOM => stream(Stream::Custom),
            did::STANDARD => stream(Stream::Standard),
            did::ALL_SENSORS => stream(Stream::All),
            did::SYSTEM => SystemSignal::parse(data).map(Self::System),
            _ => None,
        };
        command.ok_or(MessageError { did })
    }
}

fn enable(data: &[u8]) -> Option<Command> {
    let (on, channel) = match *data {
        [on] => (on, None),
        [on, number, ..] => (on, Some(channel(number)?)),
        [] => return None,
    };
    Some(Command::Enable { on: on != 0, channel })
}

fn channel(number: u8) -> Option<u8> {
    (usize::from(number) < CHANNELS).then_some(number)
}

fn target(low: u8, high: u8) -> Option<i16> {
    match i16::from_le_bytes([low, high]) {
        ALONE | ALSO_ALONE => None,
        value => Some(value),
    }
}

fn one(data: &[u8], quantity: Quantity) -> Option<Command> {
    let (number, low, high, limit_ms) = match *data {
        [number, low, high] => (number, low, high, None),
        // One client omits the byte before the time.
        [number, low, high, first, second] | [number, low, high, _, first, second] => {
            (number, low, high, Some(u16::from_le_bytes([first, second])))
        }
        _ => return None,
    };
    let channel = channel(number)?;
    let targets = match target(low, high) {
        Some(value) => Targets::One { channel, value },
        None => Targets::All([None; CHANNELS]),
    };
    Some(Command::Motion(Motion { quantity, targets, limit_ms }))
}

fn all(data: &[u8], quantity: Quantity) -> Option<Command> {
    let (values, time) = data.split_at_checked(2 * CHANNELS)?;
    let limit_ms = match *time {
        [] => None,
        [low, high] | [TIME_FOLLOWS, low, high] | [low, high, _] => {
            Some(u16::from_le_bytes([low, high]))
        }
        _ => return None,
    };
    let mut targets = [None; CHANNELS];
    for (slot, pair) in targets.iter_mut().zip(values.chunks_exact(2)) {
        *slot = target(pair[0], pair[1]);
    }
    Some(Command::Motion(Motion { quantity, targets: Targets::All(targets), limit_ms }))
}

fn parameter(data: &[u8]) -> Option<Command> {
    let &[sub, number, ref rest @ ..] = data else {
        return None;
    };
    let parameter = match (sub, rest) {
        (7, terms) => Parameter::PositionPid(gains(terms)?),
        (8, terms) => Parameter::VelocityPid(gains(terms)?),
        (13, [source, ..]) => {
            let sources = [Feedback::OnePot, Feedback::TwoPots, Feedback::Encoder];
            Parameter::Feedback(*sources.get(usize::from(*source))?)
        }
        (14, [mode, ..]) => {
            let modes = [Mode::Pwm, Mode::Position, Mode::Velocity];
            Parameter::Mode(*modes.get(usize::from(*mode))?)
        }
        (13 | 14, []) => return None,
        // The byte is not checked, because some parameters have no channel in second place.
        (sub, _) => {
            return Some(Command::Parameter {
                channel: number,
                parameter: Parameter::Other { sub },
            });
        }
    };
    Some(Command::Parameter { channel: channel(number)?, parameter })
}

fn gains(terms: &[u8]) -> Option<Gains> {
    let mut gains = Gains::default();
    for term in terms.chunks(3) {
        let &[number, low, high] = term else {
            return None;
        };
        let slot = match number {
            1 => &mut gains.kp,
            2 => &mut gains.kd,
            3 => &mut gains.ki_x100,
            _ => return None,
        };
        *slot = Some(u16::from_le_bytes([low, high]));
    }
    Some(gains)
}

fn request(data: &[u8]) -> Request {
    match data.first() {
        None | Some(255) => Request::Start,
        Some(0) => Request::Stop,
        Some(&count) => Request::Count(count),
    }
}
