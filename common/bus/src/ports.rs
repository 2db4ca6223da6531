//! Typed publishers and subscribers: a thin layer over the ports of bytes in [`raw`], so that the middleware's code is not compiled
//! again for each payload.
//!
//! Why `unsafe` is allowed here, and why it is sound:
//! - A sample is one `H` and a whole number of `T`, each aligned: its service is opened with their names, sizes and alignments.
//! - `H` and `T` are [`Payload`]s: self-contained types without a destructor, of which any bytes are a value.
//! - A sample does not change after it was sent.
//! - A reference to a header is made from the address that the middleware gives for it. The middleware computes that address as a
//!   number from the address of the sample, so access through a number is what it relies on itself.
#![allow(unsafe_code)]

mod raw;

use std::{collections::HashSet, marker::PhantomData, mem::MaybeUninit, ptr};

pub use self::raw::OpenedBy;
pub(super) use self::raw::{BusNode, Carried, Listener, Notifier, create, opened_by};
use self::raw::{RawPublisher, RawSample, RawService, RawSubscriber};
use super::{error::BusError, payload::Payload, spec::Spec};

/// The service that carries headers `H` with elements `T`.
#[derive(Debug)]
pub(super) struct Service<H, T> {
    raw: RawService,
    spec: &'static Spec,
    carries: PhantomData<fn() -> (H, T)>,
}

impl<P: Payload> Service<(), P> {
    /// Open a topic of structs.
    pub(super) fn of_structs(node: &BusNode, spec: &'static Spec) -> Result<Self, BusError> {
        Self::open(node, spec, &Carried::one::<P>())
    }
}

impl<H: Payload, T: Payload> Service<H, T> {
    /// Open a topic of slices.
    pub(super) fn of_slices(node: &BusNode, spec: &'static Spec) -> Result<Self, BusError> {
        Self::open(node, spec, &Carried::slice::<H, T>())
    }

    /// Open a topic; `carried` must describe `H` and `T`.
    fn open(node: &BusNode, spec: &'static Spec, carried: &Carried) -> Result<Self, BusError> {
        Ok(Self { raw: RawService::open(node, spec, carried)?, spec, carries: PhantomData })
    }

    /// A publisher of samples of at most `longest` elements.
    pub(super) fn publisher(&self, longest: usize) -> Result<Publisher<H, T>, BusError> {
        Ok(Publisher {
            raw: self.raw.publisher(self.spec, longest)?,
            topic: self.spec.name,
            carries: PhantomData,
        })
    }

    /// A subscriber with a buffer for the newest `buffer` samples that were not taken yet.
    pub(super) fn subscriber(&self, buffer: usize) -> Result<Subscriber<H, T>, BusError> {
        Ok(Subscriber {
            raw: self.raw.subscriber(self.spec, buffer)?,
            spec: self.spec,
            carries: PhantomData,
        })
    }

    /// The ids of the subscribers.
    pub(super) fn readers(&self) -> HashSet<u128> {
        self.raw.readers()
    }

    pub(super) fn number_of_readers(&self) -> usize {
        self.raw.number_of_readers()
    }
}

/// Publishes headers `H` with elements `T`.
#[derive(Debug)]
pub(super) struct Publisher<H, T> {
    raw: RawPublisher,
    topic: &'static str,
    carries: PhantomData<fn() -> (H, T)>,
}

impl<H: Payload, T: Payload> Publisher<H, T> {
    /// Publish `count` elements, which `write` writes in place.
    fn send(
        &self,
        header: H,
        count: usize,
        mut write: impl FnMut(&mut [MaybeUninit<T>]),
    ) -> Result<(), BusError> {
        self.raw.send(self.topic, count, &mut |loan| {
            // SAFETY: uninitialised bytes are viewed as uninitialised `T`s where they are aligned for it.
            let (_, elements, _) = unsafe { loan.elements.align_to_mut::<MaybeUninit<T>>() };
            if elements.len() != count {
                return false;
            }
            write(elements);
            // SAFETY: the sample has an aligned `H` at this address, and nobody else uses the sample until it is sent.
            unsafe { ptr::with_exposed_provenance_mut::<H>(loan.header.addr()).write(header) };
            true
        })
    }

    /// Publish `elements`.
    pub(super) fn send_all(
        &self,
        header: H,
        mut elements: impl ExactSizeIterator<Item = T>,
    ) -> Result<(), BusError> {
        self.send(header, elements.len(), |slots| {
            for slot in slots {
                slot.write(elements.next().unwrap_or_default());
            }
        })
    }

    /// Publish `elements`, copied in one piece.
    pub(super) fn send_slice(&self, header: H, elements: &[T]) -> Result<(), BusError> {
        self.send(header, elements.len(), |slots| {
            slots.write_copy_of_slice(elements);
        })
    }
}

/// Receives headers `H` with elements `T`.
#[derive(Debug)]
pub(super) struct Subscriber<H, T> {
    raw: RawSubscriber,
    spec: &'static Spec,
    carries: PhantomData<fn() -> (H, T)>,
}

impl<H: Payload, T: Payload> Subscriber<H, T> {
    pub(super) fn take(&self) -> Result<Option<Sample<H, T>>, BusError> {
        let raw = self.raw.take(self.spec)?;
        Ok(raw.map(|raw| Sample { raw, carries: PhantomData }))
    }
}

/// A header with its elements, in shared memory.
#[derive(Debug)]
pub(super) struct Sample<H, T> {
    raw: RawSample,
    carries: PhantomData<fn() -> (H, T)>,
}

impl<H: Payload, T: Payload> Sample<H, T> {
    pub(super) fn header(&self) -> &H {
        // SAFETY: the sample has an aligned `H` at this address, which does not change while the sample is held.
        unsafe { &*ptr::with_exposed_provenance::<H>(self.raw.header().addr()) }
    }

    pub(super) fn elements(&self) -> &[T] {
        // SAFETY: any bytes that are aligned for a `T` are a value of it.
        let (_, elements, _) = unsafe { self.raw.elements().align_to::<T>() };
        elements
    }

    /// The process that published the sample.
    pub(super) fn process(&self) -> u32 {
        self.raw.process()
    }
}

#[cfg(test)]
mod tests;
