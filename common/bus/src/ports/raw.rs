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
    os::fd::BorrowedFd,
    ptr,
    rc::Rc,
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

use super::memory::{self, Memory, alive};
use crate::{
    bus_instance::BusInstance,
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
    SharedNotifier(notifier::Notifier<ipc::Service>);
    SharedListener(listener::Listener<ipc::Service>);
    SharedService(PortFactory<ipc::Service, Bytes, CustomHeaderMarker>);
    PublisherPort(publisher::Publisher<ipc::Service, Bytes, CustomHeaderMarker>);
    SharedSubscriber(subscriber::Subscriber<ipc::Service, Bytes, CustomHeaderMarker>);
    SharedSample(sample::Sample<ipc::Service, Bytes, CustomHeaderMarker>);
}

/// Where the topics of a bus are.
#[derive(Debug)]
pub(crate) enum Medium {
    Shared { node: BusNode, instance: BusInstance },
    Memory(Rc<Memory>),
}

#[derive(Debug)]
pub(super) enum RawService {
    Shared(SharedService),
    Memory(Rc<memory::Topic>, Carried),
}

#[derive(Debug)]
pub(super) enum RawSubscriber {
    Shared(SharedSubscriber),
    Memory(Rc<memory::Queue>),
}

#[derive(Debug)]
pub(super) enum RawSample {
    Shared(SharedSample),
    Memory(Rc<memory::Sample>),
}

/// Wakes the readers of a topic.
#[derive(Debug)]
#[allow(clippy::large_enum_variant, reason = "a simulation may waste the space")]
pub(crate) enum Notifier {
    Shared(SharedNotifier),
    Memory(Rc<memory::Topic>),
}

#[derive(Debug)]
#[allow(clippy::large_enum_variant, reason = "a simulation may waste the space")]
pub(crate) enum Listener {
    Shared(SharedListener),
    Memory(Rc<memory::Listener>),
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
        let (header, element, elements) = if has_slice::<E>() {
            (Type::of::<H>(), Type::of::<E>(), TypeVariant::Dynamic)
        } else {
            (Type::of::<E>(), Type::of::<H>(), TypeVariant::FixedSize)
        };
        let layout = crc32fast::hash(format!("{:?}", (H::kind(), E::kind())).as_bytes());
        Self { header, element, elements, layout }
    }

    /// Returns the bytes of a sample's header, and of `count` elements.
    pub(super) const fn sizes(&self, count: usize) -> (usize, usize) {
        (self.header.size, self.element.size * count)
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
    const { assert!(Limits::WRITERS <= Limits::NODES && Limits::LISTENERS <= Limits::NODES) };
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

/// The services exist while the result is held.
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

pub(crate) fn opened_by(medium: &Medium, spec: &Spec, carried: &Carried) -> Result<OpenedBy> {
    let Medium::Shared { node, .. } = medium else {
        return Err(refused("list the processes of", spec.name)("a simulated machine has none"));
    };
    let service = SharedService::open(node, spec, carried)?;
    let event = event(node, spec)?;
    let mut writers = BTreeSet::new();
    let mut woken = BTreeSet::new();
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

impl SharedService {
    fn open(node: &BusNode, spec: &Spec, carried: &Carried) -> Result<Self> {
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

    fn publisher(&self, spec: &Spec, longest: usize) -> Result<RawPublisher> {
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
        Ok(RawPublisher::Shared { places: Places::of_segment(first), port })
    }

    fn readers(&self) -> HashSet<u128> {
        let mut readers = HashSet::new();
        self.dynamic_config().list_subscribers(|reader| {
            readers.insert(reader.subscriber_id.value());
            CallbackProgression::Continue
        });
        readers
    }
}

impl RawService {
    pub(super) fn open(medium: &Medium, spec: &Spec, carried: &Carried) -> Result<Self> {
        Ok(match medium {
            Medium::Shared { node, .. } => Self::Shared(SharedService::open(node, spec, carried)?),
            Medium::Memory(memory) => {
                alive(spec.name)?;
                Self::Memory(memory.topic(spec), *carried)
            }
        })
    }

    pub(super) fn publisher(&self, spec: &Spec, longest: usize) -> Result<RawPublisher> {
        Ok(match self {
            Self::Shared(service) => service.publisher(spec, longest)?,
            Self::Memory(topic, carried) => {
                RawPublisher::Memory(Rc::clone(topic), topic.write(), *carried)
            }
        })
    }

    pub(super) fn subscriber(&self, spec: &Spec, buffer: usize) -> Result<RawSubscriber> {
        Ok(match self {
            Self::Shared(service) => {
                let subscriber = service.subscriber_builder().buffer_size(buffer).create();
                RawSubscriber::Shared(subscriber.map_err(reading(spec))?.into())
            }
            Self::Memory(topic, _) => RawSubscriber::Memory(topic.read(buffer)),
        })
    }

    pub(super) fn readers(&self) -> HashSet<u128> {
        match self {
            Self::Shared(service) => service.readers(),
            Self::Memory(topic, _) => topic.reader_numbers(),
        }
    }
}

pub(super) struct Loan<'a> {
    pub header: *mut CustomHeaderMarker,
    pub elements: &'a mut [MaybeUninit<CustomPayloadMarker>],
}

#[derive(Debug)]
pub(super) enum RawPublisher {
    Shared { port: PublisherPort, places: Places },
    Memory(Rc<memory::Topic>, Rc<memory::Writer>, Carried),
}

impl RawPublisher {
    /// Publishes a sample. `fill` writes the header and all elements, or returns false if they do
    /// not fit.
    pub(super) fn send(
        &self,
        topic: &'static str,
        elements: usize,
        fill: &mut dyn FnMut(Loan<'_>) -> bool,
    ) -> Result {
        let (port, places) = match self {
            Self::Shared { port, places } => (port, places),
            Self::Memory(memory, writer, carried) => {
                alive(topic)?;
                let sent = memory.send(writer, carried, elements, fill);
                return if sent { Ok(()) } else { Err(BusError::Incompatible { topic }) };
            }
        };
        // SAFETY: `elements` is 1 where samples have no slice.
        let sample = unsafe { port.loan_custom_payload(elements) };
        let mut sample = sample.map_err(refused("publish on", topic))?;
        if !places.reserve_behind(ptr::from_ref(sample.header()).expose_provenance()) {
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
        Ok(match self {
            Self::Shared(subscriber) => {
                let sample = subscriber.receive().map_err(taking(spec))?;
                sample.map(|sample| RawSample::Shared(sample.into()))
            }
            Self::Memory(queue) => {
                alive(spec.name)?;
                queue.receive().map(RawSample::Memory)
            }
        })
    }
}

impl RawSample {
    #[inline(never)]
    pub(super) fn header(&self) -> *const CustomHeaderMarker {
        match self {
            Self::Shared(sample) => sample.user_header(),
            Self::Memory(sample) => sample.header(),
        }
    }

    #[inline(never)]
    pub(super) fn elements(&self) -> &Bytes {
        match self {
            Self::Shared(sample) => sample.payload(),
            Self::Memory(sample) => sample.elements(),
        }
    }

    #[inline(never)]
    pub(super) fn process(&self) -> u32 {
        match self {
            Self::Shared(sample) => process_of(sample.origin().value()),
            Self::Memory(sample) => sample.process,
        }
    }
}

fn event(node: &BusNode, spec: &Spec) -> Result<event::PortFactory<ipc::Service>> {
    node.service_builder(&service_name(spec)?).event().open().map_err(refused("open", spec.name))
}

impl Notifier {
    pub(crate) fn open(medium: &Medium, spec: &Spec) -> Result<Self> {
        Ok(match medium {
            Medium::Shared { node, .. } => {
                let notifier = event(node, spec)?.notifier_builder().create();
                Self::Shared(notifier.map_err(refused("write", spec.name))?.into())
            }
            Medium::Memory(memory) => Self::Memory(memory.topic(spec)),
        })
    }

    #[inline(never)]
    pub(crate) fn wake(&self, topic: &'static str) -> Result {
        match self {
            Self::Shared(notifier) => {
                notifier.notify().map(drop).map_err(refused("wake the readers of", topic))
            }
            Self::Memory(memory) => {
                alive(topic)?;
                memory.wake();
                Ok(())
            }
        }
    }
}

impl Listener {
    /// Listens to a topic if `admit` accepts the number of present listeners.
    pub(crate) fn open(
        medium: &Medium,
        spec: &Spec,
        admit: impl FnOnce(usize) -> Result,
    ) -> Result<Self> {
        let node = match medium {
            Medium::Shared { node, .. } => node,
            Medium::Memory(memory) => return Ok(Self::Memory(memory.topic(spec).listen())),
        };
        let service = event(node, spec)?;
        admit(service.dynamic_config().number_of_listeners())?;
        let listener = service.listener_builder().create();
        Ok(Self::Shared(listener.map_err(refused("listen to", spec.name))?.into()))
    }

    /// Returns whether there is a notification; always false in shared memory, where a descriptor
    /// shows it.
    pub(crate) fn is_woken(&self) -> bool {
        matches!(self, Self::Memory(listener) if listener.get())
    }

    /// Returns whether there were any.
    pub(crate) fn drain(&self) -> Result<bool> {
        match self {
            Self::Shared(listener) => {
                let events = listener.try_wait(|_| {});
                events.map(|events| events > 0).map_err(refused("listen to", "a topic"))
            }
            Self::Memory(listener) => Ok(listener.replace(false)),
        }
    }

    /// Returns the descriptor that a notification makes readable; none in memory.
    pub(crate) fn descriptor(&self) -> Option<BorrowedFd<'_>> {
        match self {
            Self::Shared(listener) => {
                let descriptor = listener.file_descriptor();
                // SAFETY: the descriptor stays open until the listener is dropped, after the
                // borrow has ended.
                Some(unsafe { BorrowedFd::borrow_raw(descriptor.native_handle()) })
            }
            Self::Memory(_) => None,
        }
    }
}
