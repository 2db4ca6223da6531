//! Opening a topic that a list names, and asking the bus who has opened it.

use std::{any::Any, collections::BTreeSet};

use iceoryx2::{prelude::CallbackProgression, service::port_factory::PortFactory as _};

use super::{
    error::{BusError, opening},
    layout::Layout,
    leftovers::process_of,
    make::Bus,
    payload::{Payload, Stamped},
    topic::{AnyTopic, SliceTopic, Topic, open_event, slice_service, struct_service},
};

/// A row of the table whose writer a process opens from a list, without knowing what it carries.
pub trait OpenTopic: AnyTopic {
    /// The writer: a [`Writer`](super::Writer) or a [`SliceWriter`](super::SliceWriter) of slices of at most `longest` elements.
    fn open_writer(
        &self,
        bus: &Bus,
        generation: u32,
        longest: usize,
    ) -> Result<Box<dyn Any>, BusError>;

    /// The processes that have it open.
    fn opened_by(&self, bus: &Bus) -> Result<OpenedBy, BusError>;
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

macro_rules! opened_by {
    ($self:expr, $bus:expr, $service:expr) => {{
        let mut opened = OpenedBy::default();
        let service = $service.open().map_err(opening($self.spec.name))?;
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
        let events = open_event(&$bus.node, $self.spec)?;
        events.dynamic_config().list_listeners(|listener| {
            let process = process_of(listener.listener_id.value());
            opened.woken.insert(process);
            CallbackProgression::Continue
        });
        Ok(opened)
    }};
}

impl<P: Payload + Layout + Stamped> OpenTopic for Topic<P> {
    fn open_writer(&self, bus: &Bus, generation: u32, _: usize) -> Result<Box<dyn Any>, BusError> {
        Ok(Box::new(bus.writer(self, generation)?))
    }

    fn opened_by(&self, bus: &Bus) -> Result<OpenedBy, BusError> {
        opened_by!(self, bus, struct_service::<P>(&bus.node, self.spec)?)
    }
}

impl<H: Payload + Layout + Stamped, T: Payload + Layout> OpenTopic for SliceTopic<H, T> {
    fn open_writer(
        &self,
        bus: &Bus,
        generation: u32,
        longest: usize,
    ) -> Result<Box<dyn Any>, BusError> {
        Ok(Box::new(bus.slice_writer(self, generation, longest)?))
    }

    fn opened_by(&self, bus: &Bus) -> Result<OpenedBy, BusError> {
        opened_by!(self, bus, slice_service::<H, T>(&bus.node, self.spec)?)
    }
}
