//! Readers and writers of any topic that take and give encoded samples. They serve programs that record, forward or replay samples
//! without knowing their payload.

use super::{
    error::BusError,
    layout::{Layout, decode_sample, decode_slice, encode_sample, encode_slice},
    make::Bus,
    payload::{Payload, Stamp, Stamped},
    read::{Reader, SliceReader},
    topic::{AnyTopic, SliceTopic, Topic},
    write::{SliceWriter, Writer},
};

/// A topic that can be read and written without knowing what it carries.
pub trait EncodedTopic: AnyTopic {
    /// A reader of the samples of all generations, opened as by [`Bus::reader`].
    fn encoded_reader(&self, bus: &Bus) -> Result<Box<dyn EncodedReader>, BusError>;

    /// A writer of samples that were published before, opened as by [`Bus::writer`]. A slice has at most `longest` elements.
    fn encoded_writer(&self, bus: &Bus, longest: usize)
    -> Result<Box<dyn EncodedWriter>, BusError>;
}

impl<P: Payload + Stamped + Layout> EncodedTopic for Topic<P> {
    fn encoded_reader(&self, bus: &Bus) -> Result<Box<dyn EncodedReader>, BusError> {
        let reader = bus.reader_that_keeps(self, self.spec().limits.recorder_buffer)?;
        Ok(Box::new(SampleReader(reader.of_all_generations())))
    }

    fn encoded_writer(&self, bus: &Bus, _: usize) -> Result<Box<dyn EncodedWriter>, BusError> {
        Ok(Box::new(SampleWriter(bus.writer(self, 0)?)))
    }
}

impl<H: Payload + Stamped + Layout, T: Payload + Layout> EncodedTopic for SliceTopic<H, T> {
    fn encoded_reader(&self, bus: &Bus) -> Result<Box<dyn EncodedReader>, BusError> {
        let reader = bus.slice_reader_that_keeps(self, self.spec().limits.recorder_buffer)?;
        Ok(Box::new(SliceSampleReader(reader.of_all_generations())))
    }

    fn encoded_writer(
        &self,
        bus: &Bus,
        longest: usize,
    ) -> Result<Box<dyn EncodedWriter>, BusError> {
        Ok(Box::new(SliceSampleWriter(bus.slice_writer(self, 0, longest)?)))
    }
}

/// Reads samples of a topic as encoded messages.
pub trait EncodedReader {
    /// Take the next sample into `message` (see [`super::cdr`]), in place of what is there. Returns its stamp; none when all samples
    /// were taken.
    fn take(&mut self, message: &mut Vec<u8>) -> Result<Option<Stamp>, BusError>;
}

struct SampleReader<P: Payload>(Reader<P>);

impl<P: Payload + Stamped + Layout> EncodedReader for SampleReader<P> {
    fn take(&mut self, message: &mut Vec<u8>) -> Result<Option<Stamp>, BusError> {
        message.clear();
        let sample = self.0.take()?;
        Ok(sample.map(|sample| {
            encode_sample(&sample, message);
            *sample.stamp()
        }))
    }
}

struct SliceSampleReader<H: Payload, T: Payload>(SliceReader<H, T>);

impl<H: Payload + Stamped + Layout, T: Payload + Layout> EncodedReader for SliceSampleReader<H, T> {
    fn take(&mut self, message: &mut Vec<u8>) -> Result<Option<Stamp>, BusError> {
        message.clear();
        let sample = self.0.take()?;
        Ok(sample.map(|sample| {
            encode_slice(sample.header(), &sample, message);
            *sample.header().stamp()
        }))
    }
}

/// Publishes encoded messages on a topic.
pub trait EncodedWriter {
    /// Publish the sample in `message` with the stamp that it has, and wake the readers. Returns whether `message` is of this topic.
    fn publish(&mut self, message: &[u8]) -> Result<bool, BusError>;
}

struct SampleWriter<P: Payload>(Writer<P>);

impl<P: Payload + Stamped + Layout> EncodedWriter for SampleWriter<P> {
    fn publish(&mut self, message: &[u8]) -> Result<bool, BusError> {
        let sample = decode_sample(message).map(|sample| self.0.publish_as_stamped(sample));
        Ok(sample.transpose()?.is_some())
    }
}

struct SliceSampleWriter<H: Payload, T: Payload>(SliceWriter<H, T>);

impl<H: Payload + Stamped + Layout, T: Payload + Layout> EncodedWriter for SliceSampleWriter<H, T> {
    fn publish(&mut self, message: &[u8]) -> Result<bool, BusError> {
        let Some((header, elements)) = decode_slice(message) else {
            return Ok(false);
        };
        let elements: Vec<T> = elements;
        self.0.publish_as_stamped(header, elements.into_iter()).map(|()| true)
    }
}
