//! Opening the writer of a topic from a list, and asking the bus which processes have a topic open.

use std::any::Any;

use super::{
    error::BusError,
    layout::Layout,
    make::Bus,
    payload::{Payload, Stamped},
    ports::{self, OpenedBy},
    topic::{AnyTopic, SliceTopic, Topic},
};

/// A topic whose writer a process can open without knowing the payload.
pub trait OpenTopic: AnyTopic {
    /// Open a [`Writer`](super::Writer), or a [`SliceWriter`](super::SliceWriter) of slices of at most `longest` elements.
    fn open_writer(
        &self,
        bus: &Bus,
        generation: u32,
        longest: usize,
    ) -> Result<Box<dyn Any>, BusError>;

    /// The processes that have the topic open.
    fn opened_by(&self, bus: &Bus) -> Result<OpenedBy, BusError> {
        ports::opened_by(&bus.node, self.spec(), &self.carried())
    }
}

impl<P: Payload + Layout + Stamped> OpenTopic for Topic<P> {
    fn open_writer(&self, bus: &Bus, generation: u32, _: usize) -> Result<Box<dyn Any>, BusError> {
        Ok(Box::new(bus.writer(self, generation)?))
    }
}

impl<H: Payload + Layout + Stamped, T: Payload + Layout> OpenTopic for SliceTopic<H, T> {
    fn open_writer(
        &self,
        bus: &Bus,
        generation: u32,
        longest: usize,
    ) -> Result<Box<dyn Any>, BusError> {
        let longest = longest.min(self.spec.limits.longest);
        Ok(Box::new(bus.slice_writer(self, generation, longest)?))
    }
}
