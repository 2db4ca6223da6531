//! The rows of a table of topics.

use std::{marker::PhantomData, time::Duration};

use super::{
    layout::{Kind, Layout},
    payload::{Payload, type_name},
    ports::Carried,
    spec::{Rate, Spec},
};

/// A topic whose samples are one struct.
#[derive(Debug)]
pub struct Topic<P> {
    pub(super) spec: &'static Spec,
    payload: PhantomData<fn() -> P>,
}

/// A topic whose samples are a header and a slice.
#[derive(Debug)]
pub struct SliceTopic<H, T> {
    pub(super) spec: &'static Spec,
    payload: PhantomData<fn() -> (H, T)>,
}

impl<P> Topic<P> {
    /// A row of the table.
    #[must_use]
    pub const fn new(spec: &'static Spec) -> Self {
        Self { spec, payload: PhantomData }
    }
}

impl<H, T> SliceTopic<H, T> {
    /// A row of the table.
    #[must_use]
    pub const fn new(spec: &'static Spec) -> Self {
        Self { spec, payload: PhantomData }
    }
}

/// A row of the table, without the type of its payload.
pub trait AnyTopic: Sync {
    /// The topic's description.
    fn spec(&self) -> &'static Spec;
    /// The name of its payload in all languages: a struct, or a header and a slice of elements.
    fn payload(&self) -> String;
    /// The kind of a sample: a struct, or a header and the kind of a slice's elements.
    fn layout(&self) -> (Kind, Option<Kind>);
    /// The types of its samples for the middleware. The result has no name outside this crate.
    #[doc(hidden)]
    fn carried(&self) -> Carried;
    /// The time after which its writer publishes it again if nothing changes; zero if it does not.
    fn restated_every(&self) -> Duration {
        match self.spec().rate {
            Rate::EachTick | Rate::EachFrame | Rate::WhenItHappens => Duration::ZERO,
            Rate::OnChange { again_after, .. } => again_after,
        }
    }
    /// The least time between two changes that its writer publishes; zero if there is none.
    fn changes_at_most_every(&self) -> Duration {
        match self.spec().rate {
            Rate::EachTick | Rate::EachFrame | Rate::WhenItHappens => Duration::ZERO,
            Rate::OnChange { at_most_every, .. } => at_most_every,
        }
    }
}

impl<P: Payload + Layout> AnyTopic for Topic<P> {
    fn spec(&self) -> &'static Spec {
        self.spec
    }

    fn payload(&self) -> String {
        type_name::<P>().to_owned()
    }

    fn layout(&self) -> (Kind, Option<Kind>) {
        (P::kind(), None)
    }

    fn carried(&self) -> Carried {
        Carried::one::<P>()
    }
}

impl<H: Payload + Layout, T: Payload + Layout> AnyTopic for SliceTopic<H, T> {
    fn spec(&self) -> &'static Spec {
        self.spec
    }

    fn payload(&self) -> String {
        format!("{} + [{}]", type_name::<H>(), type_name::<T>())
    }

    fn layout(&self) -> (Kind, Option<Kind>) {
        (H::kind(), Some(T::kind()))
    }

    fn carried(&self) -> Carried {
        Carried::slice::<H, T>()
    }
}
