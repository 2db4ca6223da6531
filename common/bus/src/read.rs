//! Readers and wakeups. A reader returns only samples of the authors that `authors` admits.

use std::{
    cell::Cell,
    os::fd::BorrowedFd,
    thread,
    time::{Duration, Instant},
};

use super::{
    any::AnyTopic,
    authors::Admitted,
    error::{BusError, Result},
    make::Bus,
    payload::{Payload, Stamped},
    ports::{Listener, Slice, Subscriber},
    spec::{Limits, Spec},
    topic::Topic,
};

/// A busy supervisor needs several rounds.
const PLACES_FREED_WITHIN: Duration = Duration::from_secs(4);
const LOOK_EVERY: Duration = Duration::from_millis(50);

impl Bus {
    pub fn reader<H: Stamped, E: Payload>(&self, topic: &Topic<H, E>) -> Result<Reader<H, E>> {
        self.reader_that_keeps(topic, topic.spec.limits.buffer)
    }

    /// [`Bus::reader`] with the buffer of a recorder, for a process that must have every sample although it may wait seconds for a
    /// processor.
    pub fn recorder_reader<H: Stamped, E: Payload>(
        &self,
        topic: &Topic<H, E>,
    ) -> Result<Reader<H, E>> {
        self.reader_that_keeps(topic, topic.spec.limits.recorder_buffer)
    }

    fn reader_that_keeps<H: Stamped, E: Payload>(
        &self,
        topic: &Topic<H, E>,
        buffer: usize,
    ) -> Result<Reader<H, E>> {
        assert!(buffer > 0 && buffer <= topic.spec.limits.recorder_buffer);
        let spec = topic.spec;
        let admit = |taken| self.leave_places(spec, spec.limits.readers, taken);
        let subscriber = self.once_freed(|| Subscriber::open(&self.medium, spec, buffer, admit))?;
        Ok(Reader { subscriber, admitted: Admitted::of(spec, self.writers.as_ref()) })
    }

    pub fn wakeup(&self, topic: &dyn AnyTopic) -> Result<Wakeup> {
        let spec = topic.spec();
        let admit = |taken| self.leave_places(spec, Limits::LISTENERS, taken);
        let listener = self.once_freed(|| Listener::open(&self.medium, spec, admit))?;
        Ok(Wakeup { listener, had_events: Cell::new(false) })
    }

    /// Opens an endpoint. A consumer waits for places of killed processes, which the supervisor
    /// frees about once a second if it is asked to.
    fn once_freed<T>(&self, open: impl Fn() -> Result<T>) -> Result<T> {
        const { assert!(LOOK_EVERY.as_millis() < PLACES_FREED_WITHIN.as_millis()) };
        let began = Instant::now();
        loop {
            let held = self.hold()?;
            match open() {
                Err(BusError::NoPlace { .. })
                    if !self.is_stage && began.elapsed() < PLACES_FREED_WITHIN =>
                {
                    // Without this, a killed process is noticed later than the wait lasts.
                    let _ = self.ask_to_clear_up();
                }
                opened => return opened,
            }
            drop(held);
            thread::park_timeout(LOOK_EVERY);
        }
    }

    /// Denies a consumer the last places, which stages may need.
    fn leave_places(&self, spec: &Spec, places: usize, taken: usize) -> Result {
        assert!(Limits::KEPT_FREE < places);
        if !self.is_stage && taken + Limits::KEPT_FREE >= places {
            return Err(BusError::NoPlace { topic: spec.name, places });
        }
        Ok(())
    }
}

#[derive(Debug)]
pub struct Reader<H, E = ()> {
    subscriber: Subscriber<H, E>,
    admitted: Admitted,
}

impl<H: Stamped, E: Payload> Reader<H, E> {
    /// Returns the next sample in order of publication, if any. An error means a broken connection
    /// to the writer.
    pub fn next_slice(&mut self) -> Result<Option<Slice<H, E>>> {
        if self.admitted.hold_samples()? {
            return Ok(None);
        }
        while let Some(sample) = self.subscriber.receive()? {
            if self.admitted.admits(sample.author())? {
                return Ok(Some(sample));
            }
        }
        Ok(None)
    }

    /// Samples of an older generation may arrive after the first of the next.
    pub fn of_all_generations(mut self) -> Self {
        self.admitted = self.admitted.of_all_generations();
        self
    }
}

impl<H: Stamped> Reader<H> {
    /// Copies the [next](Self::next_slice) sample, which has no slice.
    pub fn next_sample(&mut self) -> Result<Option<H>> {
        Ok(self.next_slice()?.map(|sample| *sample.header()))
    }

    /// Takes all samples.
    pub fn newest(&mut self) -> Result<Option<H>> {
        let mut newest = None;
        while let Some(sample) = self.next_sample()? {
            newest = Some(sample);
        }
        Ok(newest)
    }
}

/// Becomes readable after a publication on a topic.
#[derive(Debug)]
pub struct Wakeup {
    listener: Listener,
    had_events: Cell<bool>,
}

impl Wakeup {
    /// Clears the wakeup and returns whether it had an event. Call it before taking the samples.
    pub(crate) fn drain(&self) -> Result<bool> {
        let had_events = self.listener.drain()?;
        self.had_events.set(had_events);
        Ok(had_events)
    }

    /// Drains again if the last drain found an event.
    ///
    /// The middleware marks a listener as not notified, and then empties its socket. If this loses
    /// a notification's datagram, the listener stays marked as notified, and its socket receives no
    /// more. Only a drain with an event can cause this.
    pub(crate) fn drain_what_came_meanwhile(&self) -> Result<bool> {
        Ok(self.had_events.get() && self.drain()?)
    }

    pub(crate) fn is_woken(&self) -> bool {
        self.listener.is_woken()
    }

    pub(crate) fn descriptor(&self) -> Option<BorrowedFd<'_>> {
        self.listener.descriptor()
    }
}
