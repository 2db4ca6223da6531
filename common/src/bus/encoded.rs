//! Readers of any topic, whose samples come encoded: for what keeps or passes samples on without knowing what they are.

use super::{
    error::BusError,
    layout::{Layout, encode_sample, encode_slice},
    make::Bus,
    payload::{Payload, Stamp, Stamped},
    read::{Reader, SliceReader},
    topic::{AnyTopic, SliceTopic, Topic},
};

/// A topic that can be read without knowing what it carries.
pub trait EncodedTopic: AnyTopic {
    /// Read it, every generation's samples.
    ///
    /// # Errors
    /// As [`Bus::reader`].
    fn encoded_reader(&self, bus: &Bus) -> Result<Box<dyn EncodedReader>, BusError>;
}

impl<P: Payload + Stamped + Layout> EncodedTopic for Topic<P> {
    fn encoded_reader(&self, bus: &Bus) -> Result<Box<dyn EncodedReader>, BusError> {
        let reader = bus.reader_that_keeps(self, self.spec().limits.recorder_buffer)?;
        Ok(Box::new(SampleReader(reader.of_all_generations())))
    }
}

impl<H: Payload + Stamped + Layout, T: Payload + Layout> EncodedTopic for SliceTopic<H, T> {
    fn encoded_reader(&self, bus: &Bus) -> Result<Box<dyn EncodedReader>, BusError> {
        let reader = bus.slice_reader_that_keeps(self, self.spec().limits.recorder_buffer)?;
        Ok(Box::new(SliceSampleReader(reader.of_all_generations())))
    }
}

/// Reads a topic, whatever it carries.
pub trait EncodedReader {
    /// Append the next sample to `bytes` as a message of its own (see [`super::cdr`]) and give its stamp; none when all
    /// were taken.
    ///
    /// # Errors
    /// As [`Reader::take`].
    fn take(&mut self, bytes: &mut Vec<u8>) -> Result<Option<Stamp>, BusError>;
}

/// Of structs.
struct SampleReader<P: Payload>(Reader<P>);

impl<P: Payload + Stamped + Layout> EncodedReader for SampleReader<P> {
    fn take(&mut self, bytes: &mut Vec<u8>) -> Result<Option<Stamp>, BusError> {
        let sample = self.0.take()?;
        Ok(sample.map(|sample| {
            encode_sample(&sample, bytes);
            *sample.stamp()
        }))
    }
}

/// Of headers with slices.
struct SliceSampleReader<H: Payload, T: Payload>(SliceReader<H, T>);

impl<H: Payload + Stamped + Layout, T: Payload + Layout> EncodedReader for SliceSampleReader<H, T> {
    fn take(&mut self, bytes: &mut Vec<u8>) -> Result<Option<Stamp>, BusError> {
        let sample = self.0.take()?;
        Ok(sample.map(|sample| {
            encode_slice(sample.header(), &sample, bytes);
            *sample.header().stamp()
        }))
    }
}
