//! Readers and wakeups. A reader returns only samples of the authors that `authors` admits.

use std::{
    ops::Deref,
    os::fd::{AsFd, BorrowedFd},
};

use super::{
    authors::{Admitted, Author},
    error::BusError,
    make::Bus,
    payload::{Payload, Stamp, Stamped},
    ports::{Listener, Sample, Service, Subscriber},
    spec::{Limits, Spec},
    topic::{AnyTopic, SliceTopic, Topic},
};

impl Bus {
    /// Read `topic`. It fails if the topic is missing, carries another payload, or has no place left.
    pub fn reader<P: Payload + Stamped>(&self, topic: &Topic<P>) -> Result<Reader<P>, BusError> {
        self.reader_that_keeps(topic, topic.spec.limits.buffer)
    }

    /// [`Bus::reader`] with a buffer for the newest `buffer` samples that were not taken yet.
    pub(super) fn reader_that_keeps<P: Payload + Stamped>(
        &self,
        topic: &Topic<P>,
        buffer: usize,
    ) -> Result<Reader<P>, BusError> {
        let _held = self.hold()?;
        let service = Service::of_structs(&self.node, topic.spec)?;
        self.leave_places(topic.spec, topic.spec.limits.readers, service.number_of_readers())?;
        Ok(Reader {
            subscriber: service.subscriber(buffer)?,
            admitted: Admitted::of(topic.spec, self.writers.as_ref()),
        })
    }

    /// Read the slices of `topic`. It fails if the topic is missing, carries another payload, or has no place left.
    pub fn slice_reader<H: Payload + Stamped, T: Payload>(
        &self,
        topic: &SliceTopic<H, T>,
    ) -> Result<SliceReader<H, T>, BusError> {
        self.slice_reader_that_keeps(topic, topic.spec.limits.buffer)
    }

    /// [`Bus::slice_reader`] with a buffer for the newest `buffer` samples that were not taken yet.
    pub(super) fn slice_reader_that_keeps<H: Payload + Stamped, T: Payload>(
        &self,
        topic: &SliceTopic<H, T>,
        buffer: usize,
    ) -> Result<SliceReader<H, T>, BusError> {
        let _held = self.hold()?;
        let service = Service::of_slices(&self.node, topic.spec)?;
        self.leave_places(topic.spec, topic.spec.limits.readers, service.number_of_readers())?;
        Ok(SliceReader {
            subscriber: service.subscriber(buffer)?,
            admitted: Admitted::of(topic.spec, self.writers.as_ref()),
        })
    }

    /// A wakeup that is readable once a sample was published on `topic`. It fails if the topic is missing or has no place left.
    pub fn wakeup(&self, topic: &dyn AnyTopic) -> Result<Wakeup, BusError> {
        let spec = topic.spec();
        let _held = self.hold()?;
        let listener = Listener::open(&self.node, spec, |taken| {
            self.leave_places(spec, Limits::LISTENERS, taken)
        })?;
        Ok(Wakeup { listener })
    }

    /// Refuse a consumer the last places, which the stages may need.
    fn leave_places(&self, spec: &Spec, places: usize, taken: usize) -> Result<(), BusError> {
        if !self.is_stage && taken + Limits::KEPT_FREE >= places {
            let topic = spec.name;
            return Err(BusError::NoPlace { topic, places });
        }
        Ok(())
    }
}

/// The author of a sample. The process is part of the id of the port that published the sample.
fn author<H: Payload, T: Payload>(sample: &Sample<H, T>, stamp: &Stamp) -> Author {
    Author { process: sample.process(), generation: stamp.generation }
}

/// Receives structs.
#[derive(Debug)]
pub struct Reader<P: Payload> {
    subscriber: Subscriber<(), P>,
    admitted: Admitted,
}

impl<P: Payload + Stamped> Reader<P> {
    /// The next sample in order of publication; none when all were taken. An error means that the connection to the writer broke.
    pub fn take(&mut self) -> Result<Option<P>, BusError> {
        Ok(self.take_with_author()?.map(|(_, sample)| sample))
    }

    /// [`Reader::take`] with the author of the sample.
    pub fn take_with_author(&mut self) -> Result<Option<(Author, P)>, BusError> {
        if self.admitted.hold_samples()? {
            return Ok(None);
        }
        while let Some(sample) = self.subscriber.take()? {
            let Some(&payload) = sample.elements().first() else {
                continue;
            };
            let author = author(&sample, payload.stamp());
            if self.admitted.admits(author)? {
                return Ok(Some((author, payload)));
            }
        }
        Ok(None)
    }

    /// Return the samples of all generations. Samples of an older generation may arrive after the first of the next one.
    #[must_use]
    pub fn of_all_generations(mut self) -> Self {
        self.admitted = self.admitted.of_all_generations();
        self
    }

    /// Take all samples, and return the newest.
    pub fn newest(&mut self) -> Result<Option<P>, BusError> {
        let mut newest = None;
        while let Some(sample) = self.take()? {
            newest = Some(sample);
        }
        Ok(newest)
    }
}

/// Receives headers with slices.
#[derive(Debug)]
pub struct SliceReader<H: Payload, T: Payload> {
    subscriber: Subscriber<H, T>,
    admitted: Admitted,
}

/// A header with its slice in shared memory, which the writer cannot reuse while this is held.
#[derive(Debug)]
pub struct Slice<H: Payload, T: Payload> {
    sample: Sample<H, T>,
}

impl<H: Payload, T: Payload> Slice<H, T> {
    #[must_use]
    pub fn header(&self) -> &H {
        self.sample.header()
    }
}

impl<H: Payload + Stamped, T: Payload> Slice<H, T> {
    /// The process and the generation that wrote the slice.
    #[must_use]
    pub fn author(&self) -> Author {
        author(&self.sample, self.header().stamp())
    }
}

impl<H: Payload, T: Payload> Deref for Slice<H, T> {
    type Target = [T];

    fn deref(&self) -> &[T] {
        self.sample.elements()
    }
}

impl<H: Payload + Stamped, T: Payload> SliceReader<H, T> {
    /// [`Reader::of_all_generations`] for slices.
    #[must_use]
    pub fn of_all_generations(mut self) -> Self {
        self.admitted = self.admitted.of_all_generations();
        self
    }

    /// [`Reader::take`] for slices.
    pub fn take(&mut self) -> Result<Option<Slice<H, T>>, BusError> {
        if self.admitted.hold_samples()? {
            return Ok(None);
        }
        while let Some(sample) = self.subscriber.take()? {
            let author = author(&sample, sample.header().stamp());
            if self.admitted.admits(author)? {
                return Ok(Some(Slice { sample }));
            }
        }
        Ok(None)
    }
}

/// Becomes readable when something is published on a topic.
#[derive(Debug)]
pub struct Wakeup {
    listener: Listener,
}

impl Wakeup {
    /// Clear the wakeup, which stays readable until then. Drain it before taking the samples.
    pub(crate) fn drain(&self) -> Result<(), BusError> {
        self.listener.drain()
    }
}

impl AsFd for Wakeup {
    fn as_fd(&self) -> BorrowedFd<'_> {
        self.listener.as_fd()
    }
}
