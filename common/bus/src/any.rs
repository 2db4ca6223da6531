//! Topics of a table, and their readers and writers, without their sample types.

use std::any::Any;

use super::{
    authors::Author,
    error::Result,
    layout::{Kind, Value, type_name},
    make::Bus,
    payload::{Payload, Stamp, Stamped, decode_slice, encode_slice, has_slice},
    ports::{self, Carried, OpenedBy},
    read::Reader,
    spec::Spec,
    topic::Topic,
    write::Writer,
};

pub trait AnyTopic: Sync {
    fn spec(&self) -> &'static Spec;
    /// Returns the payload's name in all languages.
    fn payload(&self) -> String;
    fn layout(&self) -> (Kind, Option<Kind>);
    fn decoded(&self, message: &[u8]) -> Option<(Value, Option<Vec<Value>>)>;
    /// Returns the sample types for the middleware; the result is private to this crate.
    #[doc(hidden)]
    fn carried(&self) -> Carried;
    fn any_reader(&self, bus: &Bus) -> Result<Box<dyn AnyReader>>;
    /// With a recorder's buffer, of all generations.
    fn recorder_reader(&self, bus: &Bus) -> Result<Box<dyn AnyReader>>;
    fn any_writer(&self, bus: &Bus, generation: u32, longest: usize) -> Result<Box<dyn AnyWriter>>;
    fn opened_by(&self, bus: &Bus) -> Result<OpenedBy> {
        ports::opened_by(&bus.medium, self.spec(), &self.carried())
    }
}

pub trait AnyReader {
    fn next_stamp(&mut self) -> Result<Option<(Author, Stamp)>>;
    /// Replaces `message` by the next sample (see [`super::cdr`]) and returns its stamp, if any.
    fn next_message(&mut self, message: &mut Vec<u8>) -> Result<Option<Stamp>>;
}

pub trait AnyWriter: Any {
    /// Publishes the sample in `message` with its own stamp and wakes the readers. Returns whether
    /// `message` belongs to this topic.
    fn publish_message(&mut self, message: &[u8]) -> Result<bool>;
}

impl<H: Stamped, E: Payload> AnyTopic for Topic<H, E> {
    fn spec(&self) -> &'static Spec {
        self.spec
    }

    fn payload(&self) -> String {
        if has_slice::<E>() {
            format!("{} + [{}]", type_name::<H>(), type_name::<E>())
        } else {
            type_name::<H>().to_owned()
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
    fn next_stamp(&mut self) -> Result<Option<(Author, Stamp)>> {
        Ok(self.next_slice()?.map(|sample| (sample.author(), *sample.header().stamp())))
    }

    fn next_message(&mut self, message: &mut Vec<u8>) -> Result<Option<Stamp>> {
        message.clear();
        Ok(self.next_slice()?.map(|sample| {
            encode_slice(sample.header(), &sample, message);
            *sample.header().stamp()
        }))
    }
}

impl<H: Stamped, E: Payload> AnyWriter for Writer<H, E> {
    fn publish_message(&mut self, message: &[u8]) -> Result<bool> {
        let Some((header, slice)) = decode_slice(message) else { return Ok(false) };
        self.publisher.send(header, &slice)?;
        self.wake()?;
        Ok(true)
    }
}
