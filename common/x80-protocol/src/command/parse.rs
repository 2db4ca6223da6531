use super::{
    ALONE, ALSO_ALONE, CHANNELS, Command, Feedback, Gains, Mode, Motion, Parameter, Quantity,
    Request, Stream, TIME_FOLLOWS, Targets,
};
use crate::{
    did,
    frame::{Frame, MessageError, SystemSignal, length},
};

impl Command {
    /// # Errors
    /// The DID is unknown, the length is wrong, or a byte has no meaning.
    pub fn parse(frame: &Frame<'_>) -> Result<Self, MessageError> {
        let (did, data) = (frame.did, frame.data);
        for quantity in Quantity::ALL {
            match quantity.dids() {
                [of_one, _] if of_one == did => return one(frame, quantity),
                [_, of_all] if of_all == did => return all(frame, quantity),
                _ => {}
            }
        }
        let stream = |stream| Ok(Self::Stream { stream, request: request(data) });
        match did {
            did::PARAMETER => parameter(data),
            did::ENABLE => match *data {
                [on] => Ok(Self::Enable { on: on != 0, channel: None }),
                [on, number, ..] => {
                    Ok(Self::Enable { on: on != 0, channel: Some(channel(did, number)?) })
                }
                [] => Err(length(did, data, "1 or 2")),
            },
            did::MOTOR => stream(Stream::Motor),
            did::CUSTOM => stream(Stream::Custom),
            did::STANDARD => stream(Stream::Standard),
            did::ALL_SENSORS => stream(Stream::All),
            did::SYSTEM => SystemSignal::parse(data).map(Self::System),
            did => Err(MessageError::UnknownDid { did }),
        }
    }
}

fn channel(did: u8, number: u8) -> Result<u8, MessageError> {
    if usize::from(number) < CHANNELS {
        return Ok(number);
    }
    Err(MessageError::Value { did, what: "channel", value: number })
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
        // One client leaves out the byte before the time.
        [number, low, high, first, second] | [number, low, high, _, first, second] => {
            (number, low, high, Some(u16::from_le_bytes([first, second])))
        }
        _ => return Err(length(did, frame.data, "3, 5 or 6")),
    };
    let channel = channel(did, number)?;
    let targets = match target(low, high) {
        Some(value) => Targets::One { channel, value },
        None => Targets::All([None; CHANNELS]),
    };
    Ok(Command::Motion(Motion { quantity, targets, limit_ms }))
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
    Ok(Command::Motion(Motion { quantity, targets: Targets::All(targets), limit_ms }))
}

fn parameter(data: &[u8]) -> Result<Command, MessageError> {
    let invalid = |what, value| MessageError::Value { did: did::PARAMETER, what, value };
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
        // The byte is not checked, because not every parameter has a channel in second place.
        (sub, _) => {
            return Ok(Command::Parameter { channel: number, parameter: Parameter::Other { sub } });
        }
    };
    Ok(Command::Parameter { channel: channel(did::PARAMETER, number)?, parameter })
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
                return Err(MessageError::Value { did: did::PARAMETER, what: "gain", value });
            }
        };
        *slot = Some(u16::from_le_bytes([low, high]));
    }
    Ok(gains)
}

fn request(data: &[u8]) -> Request {
    match data.first() {
        None | Some(255) => Request::Start,
        Some(0) => Request::Stop,
        Some(&count) => Request::Count(count),
    }
}
