//! Middleware services and ports, compiled once: each payload is bytes here, with its name, size
//! and alignment declared when a service is created or opened.
//!
//! Why `unsafe` is allowed here, and why it is sound:
//! - [`samples`] declares the types of a topic's samples. The middleware refuses to open a service
//!   of other types, and [`RawService::open`] compares them again.
//! - [`RawPublisher::send`] sends a sample only after its header and all its elements were written.
//! - The descriptor of a listener is borrowed, and the borrow ends before the listener is dropped.
//!   Only the listener closes it.
//! - A port is dropped exactly once, by its [`Drop`].
#![allow(unsafe_code)]

use std::{
    any::Any,
    collections::{BTreeSet, HashSet},
    fmt,
    mem::{ManuallyDrop, MaybeUninit},
    ops::Deref,
    os::fd::{AsFd, BorrowedFd},
    ptr,
};

use iceoryx2::{
    node::Node,
    port::{listener, notifier, publisher, subscriber},
    prelude::{
        AllocationStrategy, AttributeSpecifier, AttributeVerifier, CallbackProgression,
        FileDescriptorBased, ServiceName, ipc,
    },
    sample,
    service::{
        attribute::{AttributeKey, AttributeValue},
        builder::publish_subscribe::Builder,
        marker::{CustomHeaderMarker, CustomPayloadMarker},
        port_factory::{PortFactory as _, event, publish_subscribe::PortFactory},
        static_config::message_type_details::{TypeDetail, TypeVariant},
    },
};

use crate::{
    error::{BusError, Result, opening, reading, refused, taking},
    layout::type_name,
    leftovers::process_of,
    payload::{Payload, has_slice},
    reserve::Places,
    spec::{Limits, Spec},
};

/// Wraps types to compile their destructors only here.
macro_rules! dropped_here {
    ($($(#[$doc:meta])* $name:ident($port:ty);)*) => {$(
        $(#[$doc])*
        pub(crate) struct $name(ManuallyDrop<$port>);

        impl From<$port> for $name {
            fn from(port: $port) -> Self {
                Self(ManuallyDrop::new(port))
            }
        }

        impl Deref for $name {
            type Target = $port;

            fn deref(&self) -> &$port {
                &self.0
            }
        }

        impl Drop for $name {
            #[inline(never)]
            fn drop(&mut self) {
                // SAFETY: nothing else drops the port, and nothing uses it afterwards.
                unsafe { ManuallyDrop::drop(&mut self.0) }
            }
        }

        impl fmt::Debug for $name {
            fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str(stringify!($name))
            }
        }
    )*};
}

type Bytes = [CustomPayloadMarker];

dropped_here! {
    BusNode(Node<ipc::Service>);
    /// Wakes the readers of a topic.
    Notifier(notifier::Notifier<ipc::Service>);
    Listener(listener::Listener<ipc::Service>);
    RawService(PortFactory<ipc::Service, Bytes, CustomHeaderMarker>);
    PublisherPort(publisher::Publisher<ipc::Service, Bytes, CustomHeaderMarker>);
    RawSubscriber(subscriber::Subscriber<ipc::Service, Bytes, CustomHeaderMarker>);
    RawSample(sample::Sample<ipc::Service, Bytes, CustomHeaderMarker>);
}

#[derive(Clone, Copy, Debug)]
struct Type {
    name: &'static str,
    size: usize,
    alignment: usize,
}

impl Type {
    fn of<P: Payload>() -> Self {
        Self { name: type_name::<P>(), size: size_of::<P>(), alignment: align_of::<P>() }
    }

    fn detail(self, variant: TypeVariant, spec: &Spec) -> Result<TypeDetail> {
        TypeDetail::__internal_new_from_parts(variant, self.name, self.size, self.alignment)
            .map_err(refused("name the payload of", spec.name))
    }

    fn is_that_of(self, detail: &TypeDetail) -> bool {
        self.size == detail.size() && detail.alignment().is_multiple_of(self.alignment)
    }
}

/// Sample types of a topic for the middleware. A sample without a slice is one element without a
/// header.
#[derive(Clone, Copy, Debug)]
pub struct Carried {
    header: Type,
    element: Type,
    elements: TypeVariant,
    /// Checksum of the fields' names, kinds and places.
    layout: u32,
}

impl Carried {
    pub(crate) fn of<H: Payload, E: Payload>() -> Self {
        let (header, element, elements) = match has_slice::<E>() {
            true => (Type::of::<H>(), Type::of::<E>(), TypeVariant::Dynamic),
            false => (Type::of::<E>(), Type::of::<H>(), TypeVariant::FixedSize),
        };
        let layout = crc32fast::hash(format!("{:?}", (H::kind(), E::kind())).as_bytes());
        Self { header, element, elements, layout }
    }

    fn layout(&self, spec: &Spec) -> Result<(AttributeKey, AttributeValue)> {
        let refused = || refused("describe the layout of", spec.name);
        let key = "layout".try_into().map_err(refused())?;
        let value = format!("{:08x}", self.layout);
        Ok((key, value.as_str().try_into().map_err(refused())?))
    }
}

fn samples(
    node: &BusNode,
    spec: &Spec,
    carried: &Carried,
) -> Result<Builder<Bytes, CustomHeaderMarker, ipc::Service>> {
    let header = carried.header.detail(TypeVariant::FixedSize, spec)?;
    let element = carried.element.detail(carried.elements, spec)?;
    let builder = node
        .service_builder(&service_name(spec)?)
        .publish_subscribe::<Bytes>()
        .user_header::<CustomHeaderMarker>();
    // SAFETY: only this module and its parent read and write samples, and they use these types.
    let builder = unsafe {
        builder
            .__internal_set_payload_type_details(&element)
            .__internal_set_user_header_type_details(&header)
    };
    Ok(builder
        .subscriber_max_buffer_size(spec.limits.recorder_buffer)
        .subscriber_max_borrowed_samples(spec.limits.borrowed)
        .max_subscribers(spec.limits.readers)
        .max_publishers(Limits::WRITERS)
        .max_nodes(Limits::NODES)
        .history_size(1)
        .enable_safe_overflow(true))
}

fn service_name(spec: &Spec) -> Result<ServiceName> {
    spec.name.try_into().map_err(refused("name", spec.name))
}

/// Creates the services of a topic, which exist while the result is held.
pub(crate) fn create(node: &BusNode, spec: &Spec, carried: &Carried) -> Result<Box<dyn Any>> {
    let (key, layout) = carried.layout(spec)?;
    let layout = AttributeSpecifier::new().define(&key, &layout);
    let layout = layout.map_err(refused("describe the layout of", spec.name))?;
    let samples = samples(node, spec, carried)?.create_with_attributes(&layout);
    let samples = samples.map_err(refused("create", spec.name))?;
    let event = node
        .service_builder(&service_name(spec)?)
        .event()
        .max_notifiers(Limits::WRITERS)
        .max_listeners(Limits::LISTENERS)
        .max_nodes(Limits::NODES)
        .create()
        .map_err(refused("create", spec.name))?;
    Ok(Box::new((samples, event)))
}

#[derive(Clone, Debug, PartialEq, Eq)]
pub struct OpenedBy {
    pub readers: BTreeSet<u32>,
    pub writers: BTreeSet<u32>,
    pub woken: BTreeSet<u32>,
}

pub(crate) fn opened_by(node: &BusNode, spec: &Spec, carried: &Carried) -> Result<OpenedBy> {
    let service = RawService::open(node, spec, carried)?;
    let event = event(node, spec)?;
    let (mut writers, mut woken) = (BTreeSet::new(), BTreeSet::new());
    service.dynamic_config().list_publishers(|writer| {
        writers.insert(process_of(writer.publisher_id.value()));
        CallbackProgression::Continue
    });
    event.dynamic_config().list_listeners(|listener| {
        woken.insert(process_of(listener.listener_id.value()));
        CallbackProgression::Continue
    });
    Ok(OpenedBy {
        readers: service.readers().into_iter().map(process_of).collect(),
        writers,
        woken,
    })
}

impl RawService {
    pub(super) fn open(node: &BusNode, spec: &Spec, carried: &Carried) -> Result<Self> {
        let (key, layout) = carried.layout(spec)?;
        let layout = AttributeVerifier::new().require(&key, &layout);
        let layout = layout.map_err(refused("describe the layout of", spec.name))?;
        let service = samples(node, spec, carried)?.open_with_attributes(&layout);
        let service = service.map_err(opening(spec.name))?;
        let there = service.static_config().message_type_details();
        let fits = carried.header.is_that_of(&there.user_header)
            && carried.element.is_that_of(&there.payload)
            && there.payload.variant() == carried.elements;
        if !fits {
            return Err(BusError::Incompatible { topic: spec.name });
        }
        Ok(service.into())
    }

    pub(super) fn publisher(&self, spec: &Spec, longest: usize) -> Result<RawPublisher> {
        let port: PublisherPort = self
            .publisher_builder()
            .initial_max_slice_len(longest)
            .allocation_strategy(AllocationStrategy::Static)
            .create()
            .map_err(refused("write", spec.name))?
            .into();
        // SAFETY: `longest` is 1 where samples have no slice.
        let loan =
            || unsafe { port.loan_custom_payload(longest) }.map_err(refused("write", spec.name));
        let first = [loan()?, loan()?];
        let first = first.each_ref().map(|sample| ptr::from_ref(sample.header()).addr());
        Ok(RawPublisher { places: Places::of_segment(first), port, topic: spec.name })
    }

    pub(super) fn subscriber(&self, spec: &Spec, buffer: usize) -> Result<RawSubscriber> {
        let subscriber =
            self.subscriber_builder().buffer_size(buffer).create().map_err(reading(spec))?;
        Ok(subscriber.into())
    }

    pub(super) fn readers(&self) -> HashSet<u128> {
        let mut readers = HashSet::new();
        self.dynamic_config().list_subscribers(|reader| {
            readers.insert(reader.subscriber_id.value());
            CallbackProgression::Continue
        });
        readers
    }
}

pub(super) struct Loan<'a> {
    pub header: *mut CustomHeaderMarker,
    pub elements: &'a mut [MaybeUninit<CustomPayloadMarker>],
}

#[derive(Debug)]
pub(super) struct RawPublisher {
    port: PublisherPort,
    places: Places,
    pub topic: &'static str,
}

impl RawPublisher {
    /// Publishes a sample. `fill` writes the header and all elements, or returns false if they do
    /// not fit.
    pub(super) fn send(&self, elements: usize, fill: &mut dyn FnMut(Loan<'_>) -> bool) -> Result {
        let topic = self.topic;
        // SAFETY: `elements` is 1 where samples have no slice.
        let sample = unsafe { self.port.loan_custom_payload(elements) };
        let mut sample = sample.map_err(refused("publish on", topic))?;
        if !self.places.reserve_behind(ptr::from_ref(sample.header()).expose_provenance()) {
            return Err(BusError::NoMemory { topic });
        }
        let header = ptr::from_mut(sample.user_header_mut());
        let elements = sample.payload_mut();
        if !fill(Loan { header, elements }) {
            return Err(BusError::Incompatible { topic });
        }
        // SAFETY: `fill` has written the header and all elements.
        unsafe { sample.assume_init() }.send().map(drop).map_err(refused("publish on", topic))
    }
}

impl RawSubscriber {
    #[inline(never)]
    pub(super) fn receive_sample(&self, spec: &Spec) -> Result<Option<RawSample>> {
        let sample = self.receive().map_err(taking(spec))?;
        Ok(sample.map(RawSample::from))
    }
}

impl RawSample {
    #[inline(never)]
    pub(super) fn header(&self) -> *const CustomHeaderMarker {
        self.user_header()
    }

    #[inline(never)]
    pub(super) fn elements(&self) -> &Bytes {
        self.payload()
    }

    #[inline(never)]
    pub(super) fn process(&self) -> u32 {
        process_of(self.origin().value())
    }
}
fn event(node: &BusNode, spec: &Spec) -> Result<event::PortFactory<ipc::Service>> {
    node.service_builder(&service_name(spec)?).event().open().map_err(refused("open", spec.name))
}

impl Notifier {
    pub(crate) fn open(node: &BusNode, spec: &Spec) -> Result<Self> {
        let notifier = event(node, spec)?.notifier_builder().create();
        Ok(notifier.map_err(refused("write", spec.name))?.into())
    }

    #[inline(never)]
    pub(crate) fn wake(&self, topic: &'static str) -> Result {
        self.notify().map(drop).map_err(refused("wake the readers of", topic))
    }
}

impl Listener {
    /// Listens to a topic if `admit` accepts the number of present listeners.
    pub(crate) fn open(
        node: &BusNode,
        spec: &Spec,
        admit: impl FnOnce(usize) -> Result,
    ) -> Result<Self> {
        let service = event(node, spec)?;
        admit(service.dynamic_config().number_of_listeners())?;
        let listener = service.listener_builder().create();
        Ok(listener.map_err(refused("listen to", spec.name))?.into())
    }

    /// Clears the notifications; returns whether there were any.
    pub(crate) fn drain(&self) -> Result<bool> {
        self.try_wait(|_| {}).map(|events| events > 0).map_err(refused("listen to", "a topic"))
    }
}

impl AsFd for Listener {
    fn as_fd(&self) -> BorrowedFd<'_> {
        // SAFETY: the descriptor stays open until the listener is dropped, after the borrow has
        // ended.
        unsafe { BorrowedFd::borrow_raw(self.file_descriptor().native_handle()) }
    }
}
