//! Writers, which stamp their samples and wake the readers.

use std::{cell::Cell, collections::HashSet, rc::Rc};

use super::{
    clock::MissionTime,
    error::{BusError, Result},
    make::Bus,
    payload::{Payload, Stamp, Stamped},
    ports::{Notifier, Publisher, Service},
    topic::Topic,
};

/// An eighth of a recorder's smallest buffer for samples that wake nobody.
const MOST_UNNOTICED: u32 = 128;

impl Bus {
    /// Write `topic` as the `generation`-th process of its stage. It fails if the topic is missing, carries another payload, or has no
    /// place left.
    pub fn writer<H: Stamped>(&self, topic: &Topic<H>, generation: u32) -> Result<Writer<H>> {
        self.slice_writer(topic, generation, 0)
    }

    /// [`Bus::writer`] of slices of at most `longest` elements, or fewer where the table says so.
    pub fn slice_writer<H: Stamped, E: Payload>(
        &self,
        topic: &Topic<H, E>,
        generation: u32,
        longest: usize,
    ) -> Result<Writer<H, E>> {
        let _held = self.hold()?;
        let service = Service::open(&self.node, topic.spec)?;
        Ok(Writer {
            publisher: service.publisher(longest.min(topic.spec.limits.longest))?,
            service,
            known: HashSet::new(),
            notifier: Notifier::open(&self.node, topic.spec)?,
            generation,
            sequence: 0,
            lost: Rc::clone(&self.lost),
        })
    }
}

#[derive(Debug)]
pub struct Writer<H, E = ()> {
    publisher: Publisher<H, E>,
    service: Service<H, E>,
    known: HashSet<u128>,
    notifier: Notifier,
    generation: u32,
    sequence: u32,
    lost: Rc<Cell<u64>>,
}

impl<H: Stamped> Writer<H> {
    /// Stamp `sample` with `tick` and the mission time `time`, publish it, and wake the readers. It fails if no memory is left for the
    /// sample: shared memory is full, and readers hold all that the topic has.
    pub fn publish(&mut self, tick: u64, time: MissionTime, sample: H) -> Result {
        self.publish_slice(tick, time, sample, &[])
    }
}

impl<H: Stamped, E: Payload> Writer<H, E> {
    /// [`Writer::publish`] of a header and its `slice`. It also fails if the slice is longer than the writer was opened for.
    pub fn publish_slice(
        &mut self,
        tick: u64,
        time: MissionTime,
        header: H,
        slice: &[E],
    ) -> Result {
        self.send(tick, time, header, slice)?;
        self.wake()
    }

    /// [`Writer::publish_slice`] without waking the readers; [`Writer::wake`] does that. Each [`MOST_UNNOTICED`]th sample wakes them, so
    /// none overruns the buffer of a recorder that sleeps. If no memory is left for the sample, it is lost, as if its readers had not
    /// taken it in time: the sequence has a gap, and [`Bus::lost`] counts it.
    pub fn publish_quietly(
        &mut self,
        tick: u64,
        time: MissionTime,
        header: H,
        slice: &[E],
    ) -> Result {
        match self.send(tick, time, header, slice) {
            Err(BusError::NoMemory { .. }) => self.lost.set(self.lost.get() + 1),
            sent => sent?,
        }
        if self.sequence.is_multiple_of(MOST_UNNOTICED) { self.wake() } else { Ok(()) }
    }

    fn send(&mut self, tick: u64, time: MissionTime, mut header: H, slice: &[E]) -> Result {
        let Self { generation, sequence, .. } = *self;
        *header.stamp_mut() = Stamp { tick, stamp_ns: time.0, generation, sequence };
        self.sequence = sequence.wrapping_add(1);
        self.publisher.send(header, slice)
    }

    /// Publish `header`, with the stamp that it has, and `slice`, and wake the readers.
    pub(super) fn publish_as_stamped(&self, header: H, slice: &[E]) -> Result {
        self.publisher.send(header, slice)?;
        self.wake()
    }

    pub fn wake(&self) -> Result {
        self.notifier.wake(self.publisher.topic())
    }

    /// Whether a reader joined since the last call. It needs a keyframe.
    pub fn has_new_reader(&mut self) -> bool {
        let now = self.service.readers();
        let new = !now.is_subset(&self.known);
        self.known = now;
        new
    }
}
