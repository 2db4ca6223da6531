//! What a table of topics is made of, and the services of one topic.

use std::{any::Any, marker::PhantomData, time::Duration};

use iceoryx2::{
    node::Node,
    prelude::{ServiceName, ipc},
    service::{builder::publish_subscribe::Builder, port_factory::event},
};

use super::{
    error::{BusError, refused},
    layout::{Kind, Layout},
    payload::{Payload, type_name},
    spec::{Limits, Rate, Spec},
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
        Self {
            spec,
            payload: PhantomData,
        }
    }
}

impl<H, T> SliceTopic<H, T> {
    /// A row of the table.
    #[must_use]
    pub const fn new(spec: &'static Spec) -> Self {
        Self {
            spec,
            payload: PhantomData,
        }
    }
}

/// A process's place in the middleware.
pub(super) type BusNode = Node<ipc::Service>;

/// A row of the table, whatever it carries.
pub trait AnyTopic: Sync + CreateServices {
    /// What the table says.
    fn spec(&self) -> &'static Spec;
    /// The name of its payload, for every language: a struct, or a header and a slice of elements.
    fn payload(&self) -> String;
    /// What each sample is: a struct; or a header, and what a slice is made of.
    fn layout(&self) -> (Kind, Option<Kind>);
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

/// What only [`Bus::make`](crate::Bus::make) does with a topic: the trait has no name outside this crate.
pub trait CreateServices {
    /// Create its services; they exist as long as the result is held.
    ///
    /// # Errors
    /// When the middleware refuses.
    fn create(&self, node: &BusNode) -> Result<Box<dyn Any>, BusError>;
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
}

impl<P: Payload> CreateServices for Topic<P> {
    fn create(&self, node: &BusNode) -> Result<Box<dyn Any>, BusError> {
        let samples = struct_service::<P>(node, self.spec)?
            .create()
            .map_err(refused("create", self.spec.name))?;
        Ok(Box::new((samples, create_event(node, self.spec)?)))
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
}

impl<H: Payload, T: Payload> CreateServices for SliceTopic<H, T> {
    fn create(&self, node: &BusNode) -> Result<Box<dyn Any>, BusError> {
        let samples = slice_service::<H, T>(node, self.spec)?
            .create()
            .map_err(refused("create", self.spec.name))?;
        Ok(Box::new((samples, create_event(node, self.spec)?)))
    }
}

/// A macro, since no bound of the middleware that can be named covers both structs and slices.
macro_rules! samples_service {
    ($node:expr, $spec:expr, $payload:ty, $header:ty) => {
        $node
            .service_builder(&service_name($spec)?)
            .publish_subscribe::<$payload>()
            .user_header::<$header>()
            .subscriber_max_buffer_size($spec.limits.recorder_buffer)
            .subscriber_max_borrowed_samples($spec.limits.borrowed)
            .max_subscribers($spec.limits.readers)
            .max_publishers(Limits::WRITERS)
            .max_nodes(Limits::NODES)
            .history_size(1)
            .enable_safe_overflow(true)
    };
}

/// The service that carries the structs of a topic, to be created or opened.
pub(super) fn struct_service<P: Payload>(
    node: &BusNode,
    spec: &Spec,
) -> Result<Builder<P, (), ipc::Service>, BusError> {
    Ok(samples_service!(node, spec, P, ()))
}

/// The service that carries the headers and slices of a topic, to be created or opened.
pub(super) fn slice_service<H: Payload, T: Payload>(
    node: &BusNode,
    spec: &Spec,
) -> Result<Builder<[T], H, ipc::Service>, BusError> {
    Ok(samples_service!(node, spec, [T], H))
}

fn create_event(node: &BusNode, spec: &Spec) -> Result<event::PortFactory<ipc::Service>, BusError> {
    node.service_builder(&service_name(spec)?)
        .event()
        .max_notifiers(Limits::WRITERS)
        .max_listeners(Limits::LISTENERS)
        .max_nodes(Limits::NODES)
        .create()
        .map_err(refused("create", spec.name))
}

/// The service that wakes the readers of a topic.
pub(super) fn open_event(
    node: &BusNode,
    spec: &Spec,
) -> Result<event::PortFactory<ipc::Service>, BusError> {
    node.service_builder(&service_name(spec)?)
        .event()
        .open()
        .map_err(refused("open", spec.name))
}

fn service_name(spec: &Spec) -> Result<ServiceName, BusError> {
    spec.name.try_into().map_err(refused("name", spec.name))
}
