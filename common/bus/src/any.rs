//! Readers of any topic, for consumers that count or show samples without knowing their payload.

use super::{
    authors::Author,
    error::BusError,
    layout::{Layout, Value},
    make::Bus,
    payload::{Payload, Stamp, Stamped},
    read::{Reader, Slice, SliceReader},
    topic::{AnyTopic, SliceTopic, Topic},
};

/// A row of the table that can be read without knowing its payload.
pub trait ReadableTopic: AnyTopic {
    /// Opens a reader with [`Bus::reader`] or [`Bus::slice_reader`].
    fn any_reader(&self, bus: &Bus) -> Result<Box<dyn AnyReader>, BusError>;
}

/// Receives samples of a topic.
pub trait AnyReader {
    /// The next sample in order of publication; none when all were taken. An error means that the connection to the writer broke.
    fn take(&mut self) -> Result<Option<Box<dyn AnySample>>, BusError>;
}

/// A sample of a topic. A sample with a slice stays in shared memory, and its writer cannot reuse that memory while the sample is
/// held.
pub trait AnySample {
    fn stamp(&self) -> &Stamp;
    /// The process that wrote the sample.
    fn author(&self) -> Author;
    /// The fields of the struct, or of the header.
    fn value(&self) -> Value;
    /// The elements of the slice; none where the topic carries structs.
    fn elements(&self) -> Option<Vec<Value>>;
}

impl<P: Payload + Layout + Stamped> ReadableTopic for Topic<P> {
    fn any_reader(&self, bus: &Bus) -> Result<Box<dyn AnyReader>, BusError> {
        Ok(Box::new(bus.reader(self)?))
    }
}

impl<H: Payload + Layout + Stamped, T: Payload + Layout> ReadableTopic for SliceTopic<H, T> {
    fn any_reader(&self, bus: &Bus) -> Result<Box<dyn AnyReader>, BusError> {
        Ok(Box::new(bus.slice_reader(self)?))
    }
}

impl<P: Payload + Layout + Stamped> AnyReader for Reader<P> {
    fn take(&mut self) -> Result<Option<Box<dyn AnySample>>, BusError> {
        let taken = self.take_with_author()?;
        Ok(taken.map(|sample| Box::new(sample) as Box<dyn AnySample>))
    }
}

impl<H: Payload + Layout + Stamped, T: Payload + Layout> AnyReader for SliceReader<H, T> {
    fn take(&mut self) -> Result<Option<Box<dyn AnySample>>, BusError> {
        let taken = Self::take(self)?;
        Ok(taken.map(|sample| Box::new(sample) as Box<dyn AnySample>))
    }
}

impl<P: Payload + Layout + Stamped> AnySample for (Author, P) {
    fn stamp(&self) -> &Stamp {
        self.1.stamp()
    }

    fn author(&self) -> Author {
        self.0
    }

    fn value(&self) -> Value {
        self.1.value()
    }

    fn elements(&self) -> Option<Vec<Value>> {
        None
    }
}

impl<H: Payload + Layout + Stamped, T: Payload + Layout> AnySample for Slice<H, T> {
    fn stamp(&self) -> &Stamp {
        self.header().stamp()
    }

    fn author(&self) -> Author {
        Self::author(self)
    }

    fn value(&self) -> Value {
        self.header().value()
    }

    fn elements(&self) -> Option<Vec<Value>> {
        Some(self.iter().map(T::value).collect())
    }
}
