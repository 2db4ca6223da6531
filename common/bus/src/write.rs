//! Writers, which stamp their samples and wake the readers.

use std::{cell::Cell, collections::HashSet, rc::Rc};

use super::{
    clock::MissionTime,
    error::{BusError, Result},
    make::Bus,
    payload::{Payload, Stamp, Stamped},
    ports::{Notifier, Publisher},
    spec::Limits,
    topic::Topic,
};

/// Eighth of a recorder's smallest buffer, published without a wakeup.
const MOST_UNNOTICED: u32 = 128;

impl Bus {
    /// Opens a writer for the `generation`-th process of a stage.
    pub fn writer<H: Stamped>(&self, topic: &Topic<H>, generation: u32) -> Result<Writer<H>> {
        self.slice_writer(topic, generation, 0)
    }

    /// Opens a [`Bus::writer`] of slices of at most `longest` elements, or of the table's lower
    /// limit.
    pub fn slice_writer<H: Stamped, E: Payload>(
        &self,
        topic: &Topic<H, E>,
        generation: u32,
        longest: usize,
    ) -> Result<Writer<H, E>> {
        let _held = self.hold()?;
        let longest = longest.min(topic.spec.limits.longest);
        Ok(Writer {
            publisher: Publisher::open(&self.medium, topic.spec, longest)?,
            known: HashSet::new(),
            notifier: Notifier::open(&self.medium, topic.spec)?,
            generation,
            sequence: 0,
            lost: Rc::clone(&self.lost),
        })
    }
}

#[derive(Debug)]
pub struct Writer<H, E = ()> {
    pub(super) publisher: Publisher<H, E>,
    known: HashSet<u128>,
    notifier: Notifier,
    generation: u32,
    sequence: u32,
    lost: Rc<Cell<u64>>,
}

impl<H: Stamped> Writer<H> {
    /// Stamps and publishes `sample`, and wakes the readers. Fails if shared memory is full and
    /// readers hold all of the topic's memory.
    pub fn publish(&mut self, tick: u64, time: MissionTime, sample: H) -> Result {
        self.publish_slice(tick, time, sample, &[])
    }
}

impl<H: Stamped, E: Payload> Writer<H, E> {
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

    /// Publishes like [`Writer::publish_slice`], without the wakeup of [`Writer::wake`].
    ///
    /// Each [`MOST_UNNOTICED`]th sample wakes the readers, so a sleeping recorder's buffer never
    /// overruns. Without memory the sample is lost: the sequence has a gap, and [`Bus::lost`]
    /// counts it.
    pub fn publish_quietly(
        &mut self,
        tick: u64,
        time: MissionTime,
        header: H,
        slice: &[E],
    ) -> Result {
        const { assert!(8 * MOST_UNNOTICED as usize <= Limits::SMALL.recorder_buffer) };
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

    pub fn wake(&self) -> Result {
        self.notifier.wake(self.publisher.topic())
    }

    pub fn has_new_reader(&mut self) -> bool {
        let now = self.publisher.readers();
        let new = !now.is_subset(&self.known);
        self.known = now;
        new
    }
}
