//! Typed publishers and subscribers: a thin layer over the byte ports in [`raw`], which keeps the
//! middleware's code from being compiled for each payload.
//!
//! Why `unsafe` is allowed here, and why it is sound:
//! - A sample is one `H` and a whole number of `E`, each aligned: its service is opened with their
//!   names, sizes and alignments. Without a slice, the `H` is the service's one element; otherwise
//!   it is the header.
//! - `H` and `E` are [`Payload`]s: self-contained types without a destructor, of which any bytes
//!   are a value.
//! - A sample does not change after it was sent.
//! - A reference to a header is made from the address that the middleware gives for it. The
//!   middleware computes that address as a number from the sample's address, so it relies on access
//!   through a number itself.
#![allow(unsafe_code)]

mod memory;
mod raw;

use std::{collections::HashSet, marker::PhantomData, mem::MaybeUninit, ops::Deref, ptr};

pub(super) use self::raw::{BusNode, Carried, Listener, Medium, Notifier, create, opened_by};
use self::raw::{RawPublisher, RawSample, RawService, RawSubscriber};
pub use self::{memory::Memory, raw::OpenedBy};
use super::{
    authors::Author,
    error::Result,
    payload::{Payload, Stamped, has_slice},
    spec::Spec,
};

#[derive(Debug)]
pub(super) struct Publisher<H, E> {
    raw: RawPublisher,
    service: RawService,
    spec: &'static Spec,
    carries: PhantomData<fn() -> (H, E)>,
}

impl<H: Payload, E: Payload> Publisher<H, E> {
    pub(super) fn open(medium: &Medium, spec: &'static Spec, longest: usize) -> Result<Self> {
        let service = RawService::open(medium, spec, &Carried::of::<H, E>())?;
        let longest = if has_slice::<E>() { longest } else { 1 };
        Ok(Self { raw: service.publisher(spec, longest)?, service, spec, carries: PhantomData })
    }

    pub(super) fn readers(&self) -> HashSet<u128> {
        self.service.readers()
    }

    pub(super) const fn topic(&self) -> &'static str {
        self.spec.name
    }

    pub(super) fn send(&self, header: H, slice: &[E]) -> Result {
        let count = if has_slice::<E>() { slice.len() } else { 1 };
        self.raw.send(self.spec.name, count, &mut |loan| {
            let place = if has_slice::<E>() {
                loan.header.addr()
            } else {
                loan.elements.as_mut_ptr().expose_provenance()
            };
            // SAFETY: uninitialised bytes are viewed as uninitialised `E`s where they are aligned
            // for it.
            let (_, slots, _) = unsafe { loan.elements.align_to_mut::<MaybeUninit<E>>() };
            if slots.len() != slice.len() {
                return false;
            }
            slots.write_copy_of_slice(slice);
            debug_assert!(place.is_multiple_of(align_of::<H>()));
            // SAFETY: the sample has an aligned `H` at this address, and is exclusive to this call
            // until it is sent.
            unsafe { ptr::with_exposed_provenance_mut::<H>(place).write(header) };
            true
        })
    }
}

#[derive(Debug)]
pub(super) struct Subscriber<H, E> {
    raw: RawSubscriber,
    spec: &'static Spec,
    carries: PhantomData<fn() -> (H, E)>,
}

impl<H: Payload, E: Payload> Subscriber<H, E> {
    /// Reads a topic if `admit` accepts the number of present readers.
    pub(super) fn open(
        medium: &Medium,
        spec: &'static Spec,
        buffer: usize,
        admit: impl FnOnce(usize) -> Result,
    ) -> Result<Self> {
        let service = RawService::open(medium, spec, &Carried::of::<H, E>())?;
        admit(service.readers().len())?;
        Ok(Self { raw: service.subscriber(spec, buffer)?, spec, carries: PhantomData })
    }

    pub(super) fn receive(&self) -> Result<Option<Slice<H, E>>> {
        let raw = self.raw.receive_sample(self.spec)?;
        Ok(raw.map(|raw| Slice { raw, carries: PhantomData }))
    }
}

/// Header and slice in shared memory, which the writer cannot reuse while this is held.
#[derive(Debug)]
pub struct Slice<H, E = ()> {
    raw: RawSample,
    carries: PhantomData<fn() -> (H, E)>,
}

impl<H: Stamped, E: Payload> Slice<H, E> {
    pub fn header(&self) -> &H {
        let place = if has_slice::<E>() {
            self.raw.header().addr()
        } else {
            self.raw.elements().as_ptr().expose_provenance()
        };
        // SAFETY: the sample has an aligned `H` at this address, which does not change while the
        // sample is held.
        unsafe { &*ptr::with_exposed_provenance::<H>(place) }
    }

    /// Returns the writer's process, which is part of its port's id, and generation.
    pub fn author(&self) -> Author {
        Author { process: self.raw.process(), generation: self.header().stamp().generation }
    }
}

impl<H: Payload, E: Payload> Deref for Slice<H, E> {
    type Target = [E];

    fn deref(&self) -> &[E] {
        // SAFETY: any bytes that are aligned for an `E` are a value of it.
        let (_, elements, _) = unsafe { self.raw.elements().align_to::<E>() };
        elements
    }
}

#[cfg(test)]
mod tests;
