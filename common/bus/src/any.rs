//! Topics of a table, and their readers and writers, without the types of their samples.

use std::any::Any;

use super::{
    authors::Author,
    error::Result,
    layout::{Kind, Value, type_name},
    make::{Bus, Services},
    payload::{Payload, Stamp, Stamped, decode_slice, encode_slice, has_slice},
    ports::{self, Carried, OpenedBy, Slice},
    read::{Reader, Wakeup},
    spec::Spec,
    topic::Topic,
    write::Writer,
};
use crate::domain::Domain;

/// A row of the table, without the types of its samples.
pub trait AnyTopic: Sync {
    fn spec(&self) -> &'static Spec;
    /// The name of its payload in all languages: of a struct, or of a header and a slice of elements.
    fn payload(&self) -> String;
    /// The kind of a sample's header, and that of its elements where it has a slice.
    fn layout(&self) -> (Kind, Option<Kind>);
    /// The values in a message of the topic, as those of an [`AnySample`]; none if it is no such message.
    fn decoded(&self, message: &[u8]) -> Option<(Value, Option<Vec<Value>>)>;
    /// The types of its samples for the middleware. The result has no name outside this crate.
    #[doc(hidden)]
    fn carried(&self) -> Carried;
    fn any_reader(&self, bus: &Bus) -> Result<Box<dyn AnyReader>>;
    /// Opens a reader of the samples of all generations, with the buffer of a recorder.
    fn recorder_reader(&self, bus: &Bus) -> Result<Box<dyn AnyReader>>;
    fn any_writer(&self, bus: &Bus, generation: u32, longest: usize) -> Result<Box<dyn AnyWriter>>;
    /// The processes that have the topic open. It fails if the topic is missing or carries another payload.
    fn opened_by(&self, bus: &Bus) -> Result<OpenedBy> {
        ports::opened_by(&bus.node, self.spec(), &self.carried())
    }
}

pub trait AnyReader {
    fn next_sample(&mut self) -> Result<Option<Box<dyn AnySample>>>;
    /// Puts the next sample as a message (see [`super::cdr`]) in place of what is in `message`. Returns its stamp; none when all samples
    /// were taken.
    fn next_message(&mut self, message: &mut Vec<u8>) -> Result<Option<Stamp>>;
}

/// A sample of a topic. It stays in shared memory, and its writer cannot reuse that memory while the sample is held.
pub trait AnySample {
    fn stamp(&self) -> &Stamp;
    fn author(&self) -> Author;
    fn value(&self) -> Value;
    fn elements(&self) -> Option<Vec<Value>>;
}

pub trait AnyWriter: Any {
    /// Publish the sample in `message` with the stamp that it has, and wake the readers. Returns whether `message` is of this topic.
    fn publish_message(&mut self, message: &[u8]) -> Result<bool>;
}

impl<H: Stamped, E: Payload> AnyTopic for Topic<H, E> {
    fn spec(&self) -> &'static Spec {
        self.spec
    }

    fn payload(&self) -> String {
        match has_slice::<E>() {
            true => format!("{} + [{}]", type_name::<H>(), type_name::<E>()),
            false => type_name::<H>().to_owned(),
        }
    }

    fn layout(&self) -> (Kind, Option<Kind>) {
        (H::kind(), has_slice::<E>().then(E::kind))
    }

    fn decoded(&self, message: &[u8]) -> Option<(Value, Option<Vec<Value>>)> {
        let (header, slice) = decode_slice::<H, E>(message)?;
        let elements = has_slice::<E>().then(|| slice.iter().map(E::value).collect());
        Some((header.value(), elements))
    }

    fn carried(&self) -> Carried {
        Carried::of::<H, E>()
    }

    fn any_reader(&self, bus: &Bus) -> Result<Box<dyn AnyReader>> {
        Ok(Box::new(bus.reader(self)?))
    }

    fn recorder_reader(&self, bus: &Bus) -> Result<Box<dyn AnyReader>> {
        Ok(Box::new(bus.recorder_reader(self)?.of_all_generations()))
    }

    fn any_writer(&self, bus: &Bus, generation: u32, longest: usize) -> Result<Box<dyn AnyWriter>> {
        Ok(Box::new(bus.slice_writer(self, generation, longest)?))
    }
}

impl<H: Stamped, E: Payload> AnyReader for Reader<H, E> {
    fn next_sample(&mut self) -> Result<Option<Box<dyn AnySample>>> {
        Ok(self.next_slice()?.map(|sample| Box::new(sample) as Box<dyn AnySample>))
    }

    fn next_message(&mut self, message: &mut Vec<u8>) -> Result<Option<Stamp>> {
        message.clear();
        Ok(self.next_slice()?.map(|sample| {
            encode_slice(sample.header(), &sample, message);
            *sample.header().stamp()
        }))
    }
}

impl<H: Stamped, E: Payload> AnySample for Slice<H, E> {
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
        has_slice::<E>().then(|| self.iter().map(E::value).collect())
    }
}

impl<H: Stamped, E: Payload> AnyWriter for Writer<H, E> {
    fn publish_message(&mut self, message: &[u8]) -> Result<bool> {
        let sample = decode_slice(message);
        let sent = sample.map(|(header, slice)| self.publish_as_stamped(header, &slice));
        Ok(sent.transpose()?.is_some())
    }
}

impl Bus {
    /// Create the bus of a robot: its configuration, which consumers in other languages load too, and the services of all topics of
    /// `table`. The new bus replaces an earlier one, and nobody can join it before all services exist. Only the supervisor calls this.
    pub fn make(domain: &Domain, name: &str, table: &[&dyn AnyTopic]) -> Result<(Self, Services)> {
        Self::make_services(domain, name, table.iter().map(|topic| (topic.spec(), topic.carried())))
    }

    /// A wakeup that is readable once a sample was published on `topic`. It fails if the topic is missing or has no place left.
    pub fn wakeup(&self, topic: &dyn AnyTopic) -> Result<Wakeup> {
        Wakeup::open(self, topic.spec())
    }
}
