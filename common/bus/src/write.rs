//! Writers: they stamp what they publish and wake the readers.

use std::collections::HashSet;

use iceoryx2::{
    port::{notifier::Notifier, publisher::Publisher},
    prelude::{AllocationStrategy, CallbackProgression, ipc},
    service::port_factory::{PortFactory as _, publish_subscribe},
};

use super::{
    error::{BusError, opening, refused},
    make::Bus,
    payload::{Payload, Stamp, Stamped},
    spec::Spec,
    topic::{SliceTopic, Topic, open_event, slice_service, struct_service},
};
use crate::clock::MissionTime;

impl Bus {
    /// Write `topic` as the `generation`-th process of its stage.
    ///
    /// # Errors
    /// When the topic is missing, carries another payload, or has no place left.
    pub fn writer<P: Payload + Stamped>(
        &self,
        topic: &Topic<P>,
        generation: u32,
    ) -> Result<Writer<P>, BusError> {
        let spec = topic.spec;
        let service = struct_service::<P>(&self.node, spec)?
            .open()
            .map_err(opening(spec.name))?;
        let publisher = service
            .publisher_builder()
            .create()
            .map_err(refused("write", spec.name))?;
        Ok(Writer {
            publisher,
            notifier: self.event_writer(spec)?,
            generation,
            sequence: 0,
            topic: spec.name,
        })
    }

    /// Write slices of at most `longest` elements on `topic`.
    ///
    /// # Errors
    /// As [`Bus::writer`].
    pub fn slice_writer<H: Payload + Stamped, T: Payload>(
        &self,
        topic: &SliceTopic<H, T>,
        generation: u32,
        longest: usize,
    ) -> Result<SliceWriter<H, T>, BusError> {
        let spec = topic.spec;
        let service = slice_service::<H, T>(&self.node, spec)?
            .open()
            .map_err(opening(spec.name))?;
        let publisher = service
            .publisher_builder()
            .initial_max_slice_len(longest)
            .allocation_strategy(AllocationStrategy::Static)
            .create()
            .map_err(refused("write", spec.name))?;
        Ok(SliceWriter {
            publisher,
            readers: Readers {
                service,
                known: HashSet::new(),
            },
            notifier: self.event_writer(spec)?,
            generation,
            sequence: 0,
            topic: spec.name,
        })
    }

    fn event_writer(&self, spec: &Spec) -> Result<Notifier<ipc::Service>, BusError> {
        open_event(&self.node, spec)?
            .notifier_builder()
            .create()
            .map_err(refused("write", spec.name))
    }
}

/// Publishes one struct a sample.
#[derive(Debug)]
pub struct Writer<P: Payload> {
    publisher: Publisher<ipc::Service, P, ()>,
    notifier: Notifier<ipc::Service>,
    generation: u32,
    sequence: u32,
    topic: &'static str,
}

impl<P: Payload + Stamped> Writer<P> {
    /// Publish `payload` for `tick` at mission `time`, stamped, and wake the readers.
    ///
    /// # Errors
    /// When no memory is left to loan, which slack in the limits rules out unless a reader misbehaves.
    pub fn publish(&mut self, tick: u64, time: MissionTime, payload: P) -> Result<(), BusError> {
        self.publish_quietly(tick, time, payload)?;
        self.wake()
    }

    /// As [`Writer::publish`], and wakes nobody yet: [`Writer::wake`] does.
    ///
    /// # Errors
    /// As [`Writer::publish`].
    pub fn publish_quietly(
        &mut self,
        tick: u64,
        time: MissionTime,
        mut payload: P,
    ) -> Result<(), BusError> {
        *payload.stamp_mut() = next_stamp(tick, time, self.generation, &mut self.sequence);
        self.send(payload)
    }

    /// Publish `payload` with the stamp that it has, and wake the readers.
    pub(super) fn publish_as_stamped(&self, payload: P) -> Result<(), BusError> {
        self.send(payload)?;
        self.wake()
    }

    fn send(&self, payload: P) -> Result<(), BusError> {
        self.publisher
            .send_copy(payload)
            .map(drop)
            .map_err(refused("publish on", self.topic))
    }

    /// Wake the readers of what was published quietly.
    ///
    /// # Errors
    /// When the middleware refuses.
    pub fn wake(&self) -> Result<(), BusError> {
        wake(&self.notifier, self.topic)
    }
}

fn next_stamp(tick: u64, time: MissionTime, generation: u32, sequence: &mut u32) -> Stamp {
    let stamp = Stamp {
        tick,
        stamp_ns: time.0,
        generation,
        sequence: *sequence,
    };
    *sequence = sequence.wrapping_add(1);
    stamp
}

fn wake(notifier: &Notifier<ipc::Service>, topic: &'static str) -> Result<(), BusError> {
    notifier
        .notify()
        .map(drop)
        .map_err(refused("wake the readers of", topic))
}

/// Who reads a topic of slices.
#[derive(Debug)]
struct Readers<H: Payload, T: Payload> {
    service: publish_subscribe::PortFactory<ipc::Service, [T], H>,
    known: HashSet<u128>,
}

/// Publishes a header and a slice a sample.
#[derive(Debug)]
pub struct SliceWriter<H: Payload, T: Payload> {
    publisher: Publisher<ipc::Service, [T], H>,
    readers: Readers<H, T>,
    notifier: Notifier<ipc::Service>,
    generation: u32,
    sequence: u32,
    topic: &'static str,
}

impl<H: Payload + Stamped, T: Payload> SliceWriter<H, T> {
    /// Publish `header` with `cells`, in order; as [`Writer::publish`].
    ///
    /// # Errors
    /// As [`Writer::publish`], and when there are more cells than the writer was made for.
    pub fn publish(
        &mut self,
        tick: u64,
        time: MissionTime,
        header: H,
        cells: impl ExactSizeIterator<Item = T>,
    ) -> Result<(), BusError> {
        self.publish_quietly(tick, time, header, cells)?;
        wake(&self.notifier, self.topic)
    }

    /// As [`SliceWriter::publish`], and wakes nobody: for readers that something else wakes.
    ///
    /// # Errors
    /// As [`SliceWriter::publish`].
    pub fn publish_quietly(
        &mut self,
        tick: u64,
        time: MissionTime,
        mut header: H,
        cells: impl ExactSizeIterator<Item = T>,
    ) -> Result<(), BusError> {
        *header.stamp_mut() = next_stamp(tick, time, self.generation, &mut self.sequence);
        self.send(header, cells)
    }

    /// Publish `header`, with the stamp that it has, and `cells`, and wake the readers.
    pub(super) fn publish_as_stamped(
        &self,
        header: H,
        cells: impl ExactSizeIterator<Item = T>,
    ) -> Result<(), BusError> {
        self.send(header, cells)?;
        self.wake()
    }

    fn send(&self, header: H, mut cells: impl ExactSizeIterator<Item = T>) -> Result<(), BusError> {
        let mut sample = self
            .publisher
            .loan_slice_uninit(cells.len())
            .map_err(refused("publish on", self.topic))?;
        *sample.user_header_mut() = header;
        sample
            .write_from_fn(|_| cells.next().unwrap_or_default())
            .send()
            .map(drop)
            .map_err(refused("publish on", self.topic))
    }

    /// As [`SliceWriter::publish_quietly`], copies `cells` in one piece.
    ///
    /// # Errors
    /// As [`SliceWriter::publish`].
    pub fn publish_slice_quietly(
        &mut self,
        tick: u64,
        time: MissionTime,
        mut header: H,
        cells: &[T],
    ) -> Result<(), BusError> {
        *header.stamp_mut() = next_stamp(tick, time, self.generation, &mut self.sequence);
        let mut sample = self
            .publisher
            .loan_slice_uninit(cells.len())
            .map_err(refused("publish on", self.topic))?;
        *sample.user_header_mut() = header;
        sample
            .write_from_slice(cells)
            .send()
            .map(drop)
            .map_err(refused("publish on", self.topic))
    }

    /// Wake the readers of what was published quietly.
    ///
    /// # Errors
    /// When the middleware refuses.
    pub fn wake(&self) -> Result<(), BusError> {
        wake(&self.notifier, self.topic)
    }

    /// Whether a reader came since this was last asked: it needs a keyframe.
    pub fn has_new_reader(&mut self) -> bool {
        let mut now = HashSet::new();
        self.readers
            .service
            .dynamic_config()
            .list_subscribers(|reader| {
                now.insert(reader.subscriber_id.value());
                CallbackProgression::Continue
            });
        let new = !now.is_subset(&self.readers.known);
        self.readers.known = now;
        new
    }
}
