//! Readers and wakeups. A reader gives the samples of the newest generation of the writer only.
//!
//! Why `unsafe` is allowed here: the listener's file descriptor can only be had through an `unsafe` call, and polling
//! it needs a borrow of it. It is sound because the borrow never outlives the listener, which the same struct owns,
//! and nobody closes the descriptor.
#![allow(unsafe_code)]

use std::{
    ops::Deref,
    os::fd::{AsFd, BorrowedFd},
};

use iceoryx2::{
    port::{listener::Listener, subscriber::Subscriber},
    prelude::{FileDescriptorBased, ipc},
    sample::Sample,
};

use super::{
    error::{BusError, opening, refused},
    make::Bus,
    payload::{Payload, Stamped},
    topic::{AnyTopic, SliceTopic, Spec, Topic, open_event, slice_service, struct_service},
};

impl Bus {
    /// Read `topic`.
    ///
    /// # Errors
    /// As [`Bus::writer`].
    pub fn reader<P: Payload + Stamped>(&self, topic: &Topic<P>) -> Result<Reader<P>, BusError> {
        let spec = topic.spec;
        let subscriber = struct_service::<P>(&self.node, spec)?
            .open()
            .map_err(opening(spec.name))?
            .subscriber_builder()
            .create()
            .map_err(refused("read", spec.name))?;
        Ok(Reader {
            subscriber,
            authorship: Authorship::of(spec),
        })
    }

    /// Read the slices of `topic`.
    ///
    /// # Errors
    /// As [`Bus::writer`].
    pub fn slice_reader<H: Payload + Stamped, T: Payload>(
        &self,
        topic: &SliceTopic<H, T>,
    ) -> Result<SliceReader<H, T>, BusError> {
        let spec = topic.spec;
        let subscriber = slice_service::<H, T>(&self.node, spec)?
            .open()
            .map_err(opening(spec.name))?
            .subscriber_builder()
            .create()
            .map_err(refused("read", spec.name))?;
        Ok(SliceReader {
            subscriber,
            authorship: Authorship::of(spec),
        })
    }

    /// Be woken when something is published on `topic`.
    ///
    /// # Errors
    /// When the topic is missing or has no place left.
    pub fn wakeup(&self, topic: &dyn AnyTopic) -> Result<Wakeup, BusError> {
        let spec = topic.spec();
        open_event(&self.node, spec)?
            .listener_builder()
            .create()
            .map(|listener| Wakeup { listener })
            .map_err(refused("listen to", spec.name))
    }
}

/// Which generation of the writer a reader listens to.
#[derive(Debug)]
struct Authorship {
    /// None where more than one process writes at a time.
    newest: Option<u32>,
}

impl Authorship {
    fn of(spec: &Spec) -> Self {
        Self {
            newest: spec.has_one_writer().then_some(0),
        }
    }

    /// Whether no newer generation than `generation` was seen: samples of older ones are dropped.
    fn admits(&mut self, generation: u32) -> bool {
        match &mut self.newest {
            Some(newest) if generation < *newest => false,
            Some(newest) => {
                *newest = generation;
                true
            }
            None => true,
        }
    }
}

/// Receives structs.
#[derive(Debug)]
pub struct Reader<P: Payload> {
    subscriber: Subscriber<ipc::Service, P, ()>,
    authorship: Authorship,
}

impl<P: Payload + Stamped> Reader<P> {
    /// The next sample in order of publication; none when all were taken.
    ///
    /// # Errors
    /// When a connection to the writer broke.
    pub fn take(&mut self) -> Result<Option<P>, BusError> {
        while let Some(sample) = self
            .subscriber
            .receive()
            .map_err(refused("read", "a topic"))?
        {
            if self.authorship.admits(sample.stamp().generation) {
                return Ok(Some(*sample));
            }
        }
        Ok(None)
    }

    /// The newest sample; those before it are dropped.
    ///
    /// # Errors
    /// As [`Reader::take`].
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
    subscriber: Subscriber<ipc::Service, [T], H>,
    authorship: Authorship,
}

/// A header with its slice, still in shared memory; the writer cannot reuse it while this is held.
#[derive(Debug)]
pub struct Slice<H: Payload, T: Payload> {
    sample: Sample<ipc::Service, [T], H>,
}

impl<H: Payload, T: Payload> Slice<H, T> {
    /// The header.
    #[must_use]
    pub fn header(&self) -> &H {
        self.sample.user_header()
    }
}

impl<H: Payload, T: Payload> Deref for Slice<H, T> {
    type Target = [T];

    fn deref(&self) -> &[T] {
        self.sample.payload()
    }
}

impl<H: Payload + Stamped, T: Payload> SliceReader<H, T> {
    /// The next sample; as [`Reader::take`].
    ///
    /// # Errors
    /// As [`Reader::take`].
    pub fn take(&mut self) -> Result<Option<Slice<H, T>>, BusError> {
        while let Some(sample) = self
            .subscriber
            .receive()
            .map_err(refused("read", "a topic"))?
        {
            if self
                .authorship
                .admits(sample.user_header().stamp().generation)
            {
                return Ok(Some(Slice { sample }));
            }
        }
        Ok(None)
    }
}

/// Becomes readable when something is published on a topic.
#[derive(Debug)]
pub struct Wakeup {
    listener: Listener<ipc::Service>,
}

impl Wakeup {
    /// Level-triggered: drain it before looking at the data, or waiting never waits again.
    pub(crate) fn drain(&self) -> Result<(), BusError> {
        self.listener
            .try_wait(|_| {})
            .map(drop)
            .map_err(refused("listen to", "a topic"))
    }
}

impl AsFd for Wakeup {
    fn as_fd(&self) -> BorrowedFd<'_> {
        // SAFETY: the descriptor belongs to the listener that `self` owns and stays open until it is
        // dropped; the borrow ends before that, and nobody closes it.
        unsafe { BorrowedFd::borrow_raw(self.listener.file_descriptor().native_handle()) }
    }
}
