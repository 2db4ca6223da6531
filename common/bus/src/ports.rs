//! The ports of the middleware, compiled once. The middleware sees every payload as bytes whose name, size and alignment it is told
//! when a service is created or opened, so none of its code depends on the type of a payload; a thin typed layer is around it.
//!
//! Why `unsafe` is allowed here, and why it is sound:
//! - A service is created and opened with the names, sizes and alignments of `H` and `T`. The middleware refuses to open one that
//!   differs, and [`Service::open`] compares them once more. So a sample is one `H` and a whole number of `T`, each aligned.
//! - `H` and `T` are [`Payload`]s: self-contained types without a destructor, of which any bytes are a value.
//! - A sample is sent only after its header and all its elements were written, and does not change afterwards.
//! - A reference to a header is made from the address that the middleware gives for it. The middleware computes that address as a
//!   number from the address of the sample, so access through a number is what it relies on itself.
//! - The file descriptor of a listener can be had through an `unsafe` call only. The borrow of it ends before the listener is
//!   dropped, and nobody else closes it.
//! - A port is dropped exactly once, by its [`Drop`].
#![allow(unsafe_code)]

use std::{
    any::Any,
    collections::{BTreeSet, HashSet},
    fmt,
    marker::PhantomData,
    mem::{ManuallyDrop, MaybeUninit},
    ops::Deref,
    os::fd::{AsFd, BorrowedFd},
    ptr,
};

use iceoryx2::{
    node::Node,
    port::{listener, notifier, publisher, subscriber},
    prelude::{AllocationStrategy, CallbackProgression, FileDescriptorBased, ServiceName, ipc},
    sample,
    service::{
        builder::publish_subscribe::Builder,
        marker::{CustomHeaderMarker, CustomPayloadMarker},
        port_factory::{PortFactory as _, event, publish_subscribe::PortFactory},
        static_config::message_type_details::{TypeDetail, TypeVariant},
    },
};

use super::{
    error::{BusError, opening, reading, refused, taking},
    leftovers::process_of,
    payload::{Payload, type_name},
    spec::{Limits, Spec},
};

/// Types whose destructor is compiled here and nowhere else: the destructor of a plain field is compiled again in each crate that
/// drops the struct around it.
macro_rules! dropped_here {
    ($($(#[$doc:meta])* $name:ident($port:ty);)*) => {$(
        $(#[$doc])*
        pub(super) struct $name(ManuallyDrop<$port>);

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
                // SAFETY: nothing else drops it, and nothing uses it afterwards.
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
    /// A process's place in the middleware.
    BusNode(Node<ipc::Service>);
    /// Wakes the readers of a topic.
    Notifier(notifier::Notifier<ipc::Service>);
    /// Is woken when something is published on a topic.
    Listener(listener::Listener<ipc::Service>);
    RawService(PortFactory<ipc::Service, Bytes, CustomHeaderMarker>);
    RawPublisher(publisher::Publisher<ipc::Service, Bytes, CustomHeaderMarker>);
    RawSubscriber(subscriber::Subscriber<ipc::Service, Bytes, CustomHeaderMarker>);
    RawSample(sample::Sample<ipc::Service, Bytes, CustomHeaderMarker>);
}

/// What other processes have to agree on.
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

    fn detail(self, variant: TypeVariant, spec: &Spec) -> Result<TypeDetail, BusError> {
        TypeDetail::__internal_new_from_parts(variant, self.name, self.size, self.alignment)
            .map_err(refused("name the payload of", spec.name))
    }

    fn is_that_of(self, detail: &TypeDetail) -> bool {
        self.size == detail.size() && detail.alignment().is_multiple_of(self.alignment)
    }
}

/// What the samples of a topic are made of: a header, and elements. A topic of structs has no header and one element.
#[derive(Clone, Copy, Debug)]
pub struct Carried {
    header: Type,
    element: Type,
    elements: TypeVariant,
}

impl Carried {
    /// One struct.
    pub(super) fn one<P: Payload>() -> Self {
        Self {
            header: Type::of::<()>(),
            element: Type::of::<P>(),
            elements: TypeVariant::FixedSize,
        }
    }

    /// A header and a slice.
    pub(super) fn slice<H: Payload, T: Payload>() -> Self {
        Self { header: Type::of::<H>(), element: Type::of::<T>(), elements: TypeVariant::Dynamic }
    }
}

/// The service that carries the samples of a topic, to be created or opened.
fn samples(
    node: &BusNode,
    spec: &Spec,
    carried: &Carried,
) -> Result<Builder<Bytes, CustomHeaderMarker, ipc::Service>, BusError> {
    let header = carried.header.detail(TypeVariant::FixedSize, spec)?;
    let element = carried.element.detail(carried.elements, spec)?;
    let builder = node
        .service_builder(&service_name(spec)?)
        .publish_subscribe::<Bytes>()
        .user_header::<CustomHeaderMarker>();
    // SAFETY: only the functions below read and write samples, by these types.
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

fn service_name(spec: &Spec) -> Result<ServiceName, BusError> {
    spec.name.try_into().map_err(refused("name", spec.name))
}

/// Create the services of a topic; they exist as long as the result is held.
///
/// # Errors
/// When the middleware refuses.
pub(super) fn create(
    node: &BusNode,
    spec: &Spec,
    carried: &Carried,
) -> Result<Box<dyn Any>, BusError> {
    let samples = samples(node, spec, carried)?.create().map_err(refused("create", spec.name))?;
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

/// The processes that have a topic open.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct OpenedBy {
    /// They read its samples.
    pub readers: BTreeSet<u32>,
    /// They write them.
    pub writers: BTreeSet<u32>,
    /// They are woken by them.
    pub woken: BTreeSet<u32>,
}

/// The processes that have a topic open.
pub(super) fn opened_by(
    node: &BusNode,
    spec: &Spec,
    carried: &Carried,
) -> Result<OpenedBy, BusError> {
    let service = RawService::open(node, spec, carried)?;
    let event = event(node, spec)?;
    let mut opened = OpenedBy::default();
    service.dynamic_config().list_subscribers(|reader| {
        let process = process_of(reader.subscriber_id.value());
        opened.readers.insert(process);
        CallbackProgression::Continue
    });
    service.dynamic_config().list_publishers(|writer| {
        let process = process_of(writer.publisher_id.value());
        opened.writers.insert(process);
        CallbackProgression::Continue
    });
    event.dynamic_config().list_listeners(|listener| {
        let process = process_of(listener.listener_id.value());
        opened.woken.insert(process);
        CallbackProgression::Continue
    });
    Ok(opened)
}

impl RawService {
    fn open(node: &BusNode, spec: &Spec, carried: &Carried) -> Result<Self, BusError> {
        let service = samples(node, spec, carried)?.open().map_err(opening(spec.name))?;
        let there = service.static_config().message_type_details();
        let fits = carried.header.is_that_of(&there.user_header)
            && carried.element.is_that_of(&there.payload)
            && there.payload.variant() == carried.elements;
        if !fits {
            return Err(BusError::Incompatible { topic: spec.name });
        }
        Ok(service.into())
    }

    fn publisher(&self, spec: &Spec, longest: usize) -> Result<RawPublisher, BusError> {
        let publisher = self
            .publisher_builder()
            .initial_max_slice_len(longest)
            .allocation_strategy(AllocationStrategy::Static)
            .create()
            .map_err(refused("write", spec.name))?;
        Ok(publisher.into())
    }

    fn subscriber(&self, spec: &Spec, buffer: usize) -> Result<RawSubscriber, BusError> {
        let subscriber =
            self.subscriber_builder().buffer_size(buffer).create().map_err(reading(spec))?;
        Ok(subscriber.into())
    }

    fn readers(&self) -> HashSet<u128> {
        let mut readers = HashSet::new();
        self.dynamic_config().list_subscribers(|reader| {
            readers.insert(reader.subscriber_id.value());
            CallbackProgression::Continue
        });
        readers
    }

    fn number_of_readers(&self) -> usize {
        self.dynamic_config().number_of_subscribers()
    }
}

/// A sample that is being written.
struct Loan<'a> {
    header: *mut CustomHeaderMarker,
    elements: &'a mut [MaybeUninit<CustomPayloadMarker>],
}

impl RawPublisher {
    /// Publish `elements` elements. `fill` writes the header and all of them, or says that they do not fit.
    fn send(
        &self,
        topic: &'static str,
        elements: usize,
        fill: &mut dyn FnMut(Loan<'_>) -> bool,
    ) -> Result<(), BusError> {
        // SAFETY: a topic of structs is sent one at a time.
        let mut sample =
            unsafe { self.loan_custom_payload(elements) }.map_err(refused("publish on", topic))?;
        let header = ptr::from_mut(sample.user_header_mut());
        let elements = sample.payload_mut();
        if !fill(Loan { header, elements }) {
            return Err(BusError::Incompatible { topic });
        }
        // SAFETY: `fill` has written all of it.
        unsafe { sample.assume_init() }.send().map(drop).map_err(refused("publish on", topic))
    }
}

impl RawSubscriber {
    #[inline(never)]
    fn take(&self, spec: &Spec) -> Result<Option<RawSample>, BusError> {
        let sample = self.receive().map_err(taking(spec))?;
        Ok(sample.map(RawSample::from))
    }
}

impl RawSample {
    #[inline(never)]
    fn header(&self) -> *const CustomHeaderMarker {
        self.user_header()
    }

    #[inline(never)]
    fn elements(&self) -> &Bytes {
        self.payload()
    }

    #[inline(never)]
    fn process(&self) -> u32 {
        process_of(self.origin().value())
    }
}

/// The service that carries headers `H` with elements `T`.
#[derive(Debug)]
pub(super) struct Service<H, T> {
    raw: RawService,
    spec: &'static Spec,
    carries: PhantomData<fn() -> (H, T)>,
}

impl<P: Payload> Service<(), P> {
    /// Of a topic of structs.
    pub(super) fn of_structs(node: &BusNode, spec: &'static Spec) -> Result<Self, BusError> {
        Self::open(node, spec, &Carried::one::<P>())
    }
}

impl<H: Payload, T: Payload> Service<H, T> {
    /// Of a topic of slices.
    pub(super) fn of_slices(node: &BusNode, spec: &'static Spec) -> Result<Self, BusError> {
        Self::open(node, spec, &Carried::slice::<H, T>())
    }

    /// `carried` is made of `H` and `T`.
    fn open(node: &BusNode, spec: &'static Spec, carried: &Carried) -> Result<Self, BusError> {
        Ok(Self { raw: RawService::open(node, spec, carried)?, spec, carries: PhantomData })
    }

    /// Write it: at most `longest` elements a sample.
    pub(super) fn publisher(&self, longest: usize) -> Result<Publisher<H, T>, BusError> {
        Ok(Publisher {
            raw: self.raw.publisher(self.spec, longest)?,
            topic: self.spec.name,
            carries: PhantomData,
        })
    }

    /// Read it; of samples that are not taken, the newest `buffer` stay.
    pub(super) fn subscriber(&self, buffer: usize) -> Result<Subscriber<H, T>, BusError> {
        Ok(Subscriber {
            raw: self.raw.subscriber(self.spec, buffer)?,
            spec: self.spec,
            carries: PhantomData,
        })
    }

    /// Who reads it.
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
            // SAFETY: bytes that need not be initialised become such of a `T`, where they are aligned for it.
            let (_, elements, _) = unsafe { loan.elements.align_to_mut::<MaybeUninit<T>>() };
            if elements.len() != count {
                return false;
            }
            write(elements);
            // SAFETY: the service's samples have an aligned `H` at this address, which nobody else uses until it is sent.
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
        // SAFETY: the service's samples have an aligned `H` at this address, which stays as it is while the sample is held.
        unsafe { &*ptr::with_exposed_provenance::<H>(self.raw.header().addr()) }
    }

    pub(super) fn elements(&self) -> &[T] {
        // SAFETY: any bytes that are aligned for it are a `T`.
        let (_, elements, _) = unsafe { self.raw.elements().align_to::<T>() };
        elements
    }

    /// The process that wrote it.
    pub(super) fn process(&self) -> u32 {
        self.raw.process()
    }
}

fn event(node: &BusNode, spec: &Spec) -> Result<event::PortFactory<ipc::Service>, BusError> {
    node.service_builder(&service_name(spec)?).event().open().map_err(refused("open", spec.name))
}

impl Notifier {
    pub(super) fn open(node: &BusNode, spec: &Spec) -> Result<Self, BusError> {
        let notifier = event(node, spec)?.notifier_builder().create();
        Ok(notifier.map_err(refused("write", spec.name))?.into())
    }

    #[inline(never)]
    pub(super) fn wake(&self, topic: &'static str) -> Result<(), BusError> {
        self.notify().map(drop).map_err(refused("wake the readers of", topic))
    }
}

impl Listener {
    /// `admit` is told how many others listen.
    pub(super) fn open(
        node: &BusNode,
        spec: &Spec,
        admit: impl FnOnce(usize) -> Result<(), BusError>,
    ) -> Result<Self, BusError> {
        let service = event(node, spec)?;
        admit(service.dynamic_config().number_of_listeners())?;
        let listener = service.listener_builder().create();
        Ok(listener.map_err(refused("listen to", spec.name))?.into())
    }

    pub(super) fn drain(&self) -> Result<(), BusError> {
        self.try_wait(|_| {}).map(drop).map_err(refused("listen to", "a topic"))
    }
}

impl AsFd for Listener {
    fn as_fd(&self) -> BorrowedFd<'_> {
        // SAFETY: the descriptor stays open until the listener is dropped, after the borrow has ended.
        unsafe { BorrowedFd::borrow_raw(self.file_descriptor().native_handle()) }
    }
}

#[cfg(test)]
mod tests;
