//! What a table of topics is made of.

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

/// A row of the table, whatever it carries.
pub trait AnyTopic: Sync {
    /// What the table says.
    fn spec(&self) -> &'static Spec;
    /// The name of its payload, for every language: a struct, or a header and a slice of elements.
    fn payload(&self) -> String;
    /// What each sample is: a struct; or a header, and what a slice is made of.
    fn layout(&self) -> (Kind, Option<Kind>);
    /// What it is to the middleware; the result has no name outside this crate.
    #[doc(hidden)]
    fn carried(&self) -> Carried;
    /// After how long its writer publishes it again when nothing changes; zero where the table does not say.
    fn restated_every(&self) -> Duration {
        match self.spec().rate {
            Rate::EachTick | Rate::EachFrame | Rate::WhenItHappens => Duration::ZERO,
            Rate::OnChange { again_after, .. } => again_after,
        }
    }
    /// How long its writer waits from one change to the next; zero where the table does not say.
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
