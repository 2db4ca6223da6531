//! Writers, which stamp their samples and wake the readers.

use std::{collections::HashSet, iter};

use super::{
    clock::MissionTime,
    error::BusError,
    make::Bus,
    payload::{Payload, Stamp, Stamped},
    ports::{Notifier, Publisher, Service},
    spec::Spec,
    topic::{SliceTopic, Topic},
};

impl Bus {
    /// Write `topic` as the `generation`-th process of its stage. It fails if the topic is missing, carries another payload, or has no
    /// place left.
    pub fn writer<P: Payload + Stamped>(
        &self,
        topic: &Topic<P>,
        generation: u32,
    ) -> Result<Writer<P>, BusError> {
        let _held = self.hold()?;
        let service = Service::of_structs(&self.node, topic.spec)?;
        Ok(Writer { publisher: service.publisher(1)?, turn: self.turn(topic.spec, generation)? })
    }

    /// [`Bus::writer`] for slices of at most `longest` elements.
    pub fn slice_writer<H: Payload + Stamped, T: Payload>(
        &self,
        topic: &SliceTopic<H, T>,
        generation: u32,
        longest: usize,
    ) -> Result<SliceWriter<H, T>, BusError> {
        let _held = self.hold()?;
        let service = Service::of_slices(&self.node, topic.spec)?;
        Ok(SliceWriter {
            publisher: service.publisher(longest)?,
            service,
            known: HashSet::new(),
            turn: self.turn(topic.spec, generation)?,
        })
    }

    fn turn(&self, spec: &Spec, generation: u32) -> Result<Turn, BusError> {
        Ok(Turn {
            notifier: Notifier::open(&self.node, spec)?,
            generation,
            sequence: 0,
            topic: spec.name,
        })
    }
}

/// The stamp of a writer's next sample, and the notifier of its readers.
#[derive(Debug)]
struct Turn {
    notifier: Notifier,
    generation: u32,
    sequence: u32,
    topic: &'static str,
}

impl Turn {
    const fn stamp(&mut self, tick: u64, time: MissionTime) -> Stamp {
        let stamp =
            Stamp { tick, stamp_ns: time.0, generation: self.generation, sequence: self.sequence };
        self.sequence = self.sequence.wrapping_add(1);
        stamp
    }

    fn wake(&self) -> Result<(), BusError> {
        self.notifier.wake(self.topic)
    }
}

/// Publishes one struct a sample.
#[derive(Debug)]
pub struct Writer<P: Payload> {
    publisher: Publisher<(), P>,
    turn: Turn,
}

impl<P: Payload + Stamped> Writer<P> {
    /// Stamp `payload` with `tick` and the mission time `time`, publish it, and wake the readers. It fails if no memory is left for the
    /// sample; the limits prevent that unless a reader holds more than it may.
    pub fn publish(&mut self, tick: u64, time: MissionTime, payload: P) -> Result<(), BusError> {
        self.publish_quietly(tick, time, payload)?;
        self.wake()
    }

    /// [`Writer::publish`] without waking the readers; [`Writer::wake`] does that.
    pub fn publish_quietly(
        &mut self,
        tick: u64,
        time: MissionTime,
        mut payload: P,
    ) -> Result<(), BusError> {
        *payload.stamp_mut() = self.turn.stamp(tick, time);
        self.send(payload)
    }

    /// Publish `payload` with the stamp that it has, and wake the readers.
    pub(super) fn publish_as_stamped(&self, payload: P) -> Result<(), BusError> {
        self.send(payload)?;
        self.wake()
    }

    fn send(&self, payload: P) -> Result<(), BusError> {
        self.publisher.send_all((), iter::once(payload))
    }

    /// Wake the readers after quiet publications.
    pub fn wake(&self) -> Result<(), BusError> {
        self.turn.wake()
    }
}

/// Publishes a header and a slice a sample.
#[derive(Debug)]
pub struct SliceWriter<H: Payload, T: Payload> {
    publisher: Publisher<H, T>,
    service: Service<H, T>,
    known: HashSet<u128>,
    turn: Turn,
}

impl<H: Payload + Stamped, T: Payload> SliceWriter<H, T> {
    /// [`Writer::publish`] for a header and `cells`. It also fails if there are more cells than the writer was opened for.
    pub fn publish(
        &mut self,
        tick: u64,
        time: MissionTime,
        header: H,
        cells: impl ExactSizeIterator<Item = T>,
    ) -> Result<(), BusError> {
        self.publish_quietly(tick, time, header, cells)?;
        self.turn.wake()
    }

    /// [`SliceWriter::publish`] without waking the readers, for readers that another topic wakes.
    pub fn publish_quietly(
        &mut self,
        tick: u64,
        time: MissionTime,
        mut header: H,
        cells: impl ExactSizeIterator<Item = T>,
    ) -> Result<(), BusError> {
        *header.stamp_mut() = self.turn.stamp(tick, time);
        self.publisher.send_all(header, cells)
    }

    /// Publish `header`, with the stamp that it has, and `cells`, and wake the readers.
    pub(super) fn publish_as_stamped(
        &self,
        header: H,
        cells: impl ExactSizeIterator<Item = T>,
    ) -> Result<(), BusError> {
        self.publisher.send_all(header, cells)?;
        self.wake()
    }

    /// [`SliceWriter::publish_quietly`] that copies `cells` in one piece.
    pub fn publish_slice_quietly(
        &mut self,
        tick: u64,
        time: MissionTime,
        mut header: H,
        cells: &[T],
    ) -> Result<(), BusError> {
        *header.stamp_mut() = self.turn.stamp(tick, time);
        self.publisher.send_slice(header, cells)
    }

    /// Wake the readers after quiet publications.
    pub fn wake(&self) -> Result<(), BusError> {
        self.turn.wake()
    }

    /// Whether a reader joined since the last call. It needs a keyframe.
    pub fn has_new_reader(&mut self) -> bool {
        let now = self.service.readers();
        let new = !now.is_subset(&self.known);
        self.known = now;
        new
    }
}
