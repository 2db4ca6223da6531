//! The link without its process: the same step, fed with what it took, telemetry and the bytes of the wire included.

use common::{
    clock::MissionTime,
    inputs,
    replay::{Beginning, Output, Replay, ReplayError, entry},
    samples::{
        CommandSample, Direction, HoldReason, InfraredSample, Order, PowerSample,
        SurroundingsSample, WireHeader,
    },
    shell::Progress,
    step::Step as _,
    topics,
};
use serde::{Deserialize, Serialize};

use crate::step::{Effect, Event, Input, Link, State};

/// A sample of `wire` has at most so many bytes; what is longer takes several.
pub(crate) const WIRE_PIECE: usize = 2048;

/// What the link does. A generation starts from a [`State`].
#[derive(Debug, Serialize, Deserialize)]
pub enum Entry<'a> {
    /// The step takes this at this reading of the monotonic clock, nanoseconds, and this mission time.
    Step(#[serde(borrow)] Taken<'a>, u64, MissionTime),
    /// The newest telemetry is published.
    Telemetry,
    /// The stage stops, at this reading of the monotonic clock.
    Stop(u64),
}

/// An [`Event`], as it is kept.
#[derive(Debug, Serialize, Deserialize)]
pub enum Taken<'a> {
    /// As [`Event::Datagram`].
    Datagram(#[serde(with = "serde_bytes")] &'a [u8]),
    /// As [`Event::Wire`].
    Wire(bool),
    /// As [`Event::Command`].
    Command(#[serde(with = "inputs::sample")] CommandSample),
    /// As [`Event::Order`], a byte each.
    Order(u8, u8),
    /// As [`Event::TickLimit`].
    TickLimit(u64),
    /// As [`Event::Quiet`].
    Quiet,
}

impl<'a> Taken<'a> {
    /// Of `event`.
    pub(crate) fn of(event: &Event<'a>) -> Self {
        match *event {
            Event::Datagram(bytes) => Self::Datagram(bytes),
            Event::Wire(open) => Self::Wire(open),
            Event::Command(command) => Self::Command(*command),
            Event::Order(order, reason) => Self::Order(order.into(), reason.into()),
            Event::TickLimit(last) => Self::TickLimit(last),
            Event::Quiet => Self::Quiet,
        }
    }

    fn event(&self) -> Event<'_> {
        match self {
            Self::Datagram(bytes) => Event::Datagram(bytes),
            Self::Wire(open) => Event::Wire(*open),
            Self::Command(command) => Event::Command(command),
            Self::Order(order, reason) => {
                Event::Order(Order::from_byte(*order), HoldReason::from_byte(*reason))
            }
            Self::TickLimit(last) => Event::TickLimit(*last),
            Self::Quiet => Event::Quiet,
        }
    }
}

/// What the step's effects leave to be published later, and the tick it is at.
#[derive(Debug, Default)]
pub(crate) struct Carried {
    pub(crate) progress: Progress,
    pub(crate) infrared: Option<InfraredSample>,
    pub(crate) power: Option<PowerSample>,
    pub(crate) surroundings: Option<SurroundingsSample>,
    /// Bytes that came and went, oldest first.
    pub(crate) wire: Vec<(Progress, WireHeader, Vec<u8>)>,
}

impl Carried {
    /// The robot sent `bytes`.
    pub(crate) fn received(&mut self, bytes: &[u8], machine_ns: u64) {
        self.carry(bytes, machine_ns, Direction::Received);
    }

    /// The robot was sent `bytes`.
    pub(crate) fn sent(&mut self, bytes: &[u8], machine_ns: u64) {
        self.carry(bytes, machine_ns, Direction::Sent);
    }

    fn carry(&mut self, bytes: &[u8], machine_ns: u64, direction: Direction) {
        let header = WireHeader {
            machine_ns,
            direction: direction.into(),
            ..WireHeader::default()
        };
        self.wire.push((self.progress, header, bytes.to_vec()));
    }

    /// Whether telemetry waits to be published.
    pub(crate) const fn has_telemetry(&self) -> bool {
        self.infrared.is_some() || self.power.is_some() || self.surroundings.is_some()
    }
}

struct Generation {
    link: Link,
    carried: Carried,
}

/// Begin the replay of a generation.
///
/// # Errors
/// Those of [`common::replay::Begin`].
pub fn begin(beginning: Beginning<'_>) -> Result<Box<dyn Replay>, ReplayError> {
    let mut link = Link::new(&beginning.run.mission);
    // It takes any.
    let _ = link.restore(entry::<State>(beginning.start)?);
    let carried = Carried::default();
    Ok(Box::new(Generation { link, carried }))
}

impl Generation {
    fn carry_out(&mut self, effect: Effect, machine_ns: u64, outputs: &mut Vec<Output>) {
        let carried = &mut self.carried;
        match effect {
            Effect::Send(bytes) => carried.sent(&bytes, machine_ns),
            Effect::Tick {
                tick,
                time,
                range,
                wheels,
            } => {
                carried.progress = Progress { tick, time };
                outputs.push(Output::of(&topics::RANGE, tick, time, range));
                outputs.push(Output::of(&topics::WHEELS, tick, time, wheels));
            }
            Effect::Infrared(sample) => carried.infrared = Some(sample),
            Effect::Power(sample) => carried.power = Some(sample),
            Effect::Surroundings(sample) => carried.surroundings = Some(sample),
            // Published in words, or in `link`, which counts what the process did, too.
            _ => {}
        }
    }

    fn publish_telemetry(&mut self, outputs: &mut Vec<Output>) {
        let Progress { tick, time } = self.carried.progress;
        if let Some(sample) = self.carried.infrared.take() {
            outputs.push(Output::of(&topics::INFRARED, tick, time, sample));
        }
        if let Some(sample) = self.carried.power.take() {
            outputs.push(Output::of(&topics::POWER, tick, time, sample));
        }
        if let Some(sample) = self.carried.surroundings.take() {
            outputs.push(Output::of(&topics::SURROUNDINGS, tick, time, sample));
        }
    }
}

impl Replay for Generation {
    fn take(&mut self, body: &[u8]) -> Result<Vec<Output>, ReplayError> {
        let mut outputs = Vec::new();
        match entry(body)? {
            Entry::Step(taken, machine_ns, now) => {
                if let Taken::Datagram(bytes) = taken {
                    self.carried.received(bytes, machine_ns);
                }
                let event = taken.event();
                for effect in self.link.step(Input { event, machine_ns }, now) {
                    self.carry_out(effect, machine_ns, &mut outputs);
                }
            }
            Entry::Telemetry => self.publish_telemetry(&mut outputs),
            Entry::Stop(machine_ns) => {
                for bytes in self.link.final_stops() {
                    self.carried.sent(&bytes, machine_ns);
                }
            }
        }
        for (at, header, bytes) in self.carried.wire.drain(..) {
            for piece in bytes.chunks(WIRE_PIECE) {
                outputs.push(Output::of_slice(
                    &topics::WIRE,
                    at.tick,
                    at.time,
                    header,
                    piece,
                ));
            }
        }
        Ok(outputs)
    }

    fn describe(&self, body: &[u8]) -> Result<String, ReplayError> {
        Ok(format!("{:?}", entry::<Entry<'_>>(body)?))
    }
}
