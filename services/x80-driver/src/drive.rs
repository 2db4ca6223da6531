//! Counts from motor frames and timed commands, with the mission's channels and signs, for two
//! wheels or a car's wheel and steering.

use std::time::Duration;

use common::{
    driver::{Base, StopMethod},
    mission::Channel,
    wire::{
        Addressing, CHANNELS, COUNT_CYCLE, Command, Decoder, Encoder, Motion, MotorSensors,
        Quantity, Request, Stream, SystemSignal, Targets,
    },
};

use crate::X80;

/// Largest command, counts/s: -32768 and -32767 leave the channel unchanged.
const FASTEST: i16 = 32_766;

/// Pulse width at which a wheel stands.
const PWM_STANDS: i16 = 16_384;

impl Base for X80 {
    fn ask_for_sensors(&self) -> Vec<u8> {
        let start = |stream| encoded(Command::Stream { stream, request: Request::Start });
        [Stream::Motor, Stream::Custom, Stream::Standard].map(start).concat()
    }

    fn ping(&self) -> Vec<u8> {
        encoded(Command::System(SystemSignal::Ping))
    }

    fn acknowledge(&self) -> Vec<u8> {
        encoded(Command::System(SystemSignal::Ack))
    }

    fn owed(&self, sent: &[u8]) -> usize {
        let mut decoder = Decoder::default();
        decoder.push(sent);
        std::iter::from_fn(|| decoder.next_frame().map(drop)).count()
    }

    /// Encodes a velocity. A robot that respects the limit stops by itself after the link ended.
    fn velocity(&self, counts: [i16; 2], limit: Duration) -> Vec<u8> {
        let mut speeds = [None; 2];
        for (channel, counts) in self.channels.into_iter().zip(counts) {
            let within = counts.clamp(-FASTEST, FASTEST);
            speeds[index(channel)] = Some(if channel.reversed { -within } else { within });
        }
        let limit_ms = limit.as_millis().min(u128::from(u16::MAX)) as u16;
        encoded(Command::velocity(speeds, limit_ms))
    }

    fn other_stops(&self) -> Vec<StopMethod> {
        let disabled = |channel| encoded(Command::Enable { on: false, channel });
        let mut targets = [None; CHANNELS];
        for channel in self.channels {
            targets[index(channel)] = Some(PWM_STANDS);
        }
        let still = Command::Motion(Motion {
            quantity: Quantity::Pwm,
            targets: Targets::All(targets),
            limit_ms: None,
        });
        let both = self.channels.map(|wheel| disabled(Some(wheel.channel))).concat();
        vec![
            StopMethod { name: "disable", bytes: both },
            StopMethod { name: "pulse width 0", bytes: encoded(still) },
            StopMethod { name: "suspend", bytes: disabled(None) },
        ]
    }
}

/// Returns the place in a motor frame; the mission check limits channels to 0 and 1.
pub(crate) fn index(channel: Channel) -> usize {
    usize::from(channel.channel.min(1))
}

/// Returns counts that grow forward.
pub(crate) fn wheel(sensors: &MotorSensors, channel: Channel) -> Encoder {
    let encoder = sensors.encoders[index(channel)];
    if !channel.reversed {
        return encoder;
    }
    Encoder {
        position: (COUNT_CYCLE - encoder.position % COUNT_CYCLE) % COUNT_CYCLE,
        positive: !encoder.positive,
        ..encoder
    }
}

pub(crate) fn encoded(command: Command) -> Vec<u8> {
    let mut bytes = Vec::new();
    command.encode(Addressing::default(), &mut bytes);
    bytes
}
