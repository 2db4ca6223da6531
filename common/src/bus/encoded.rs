//! Readers of any topic, whose samples come encoded: for what keeps or passes samples on without knowing what they are.

use super::{
    error::BusError,
    layout::{Layout, encode_sample, encode_slice},
    payload::{Payload, Stamp, Stamped},
    read::{Reader, SliceReader},
};

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
pub(super) struct SampleReader<P: Payload>(pub(super) Reader<P>);

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
pub(super) struct SliceSampleReader<H: Payload, T: Payload>(pub(super) SliceReader<H, T>);

impl<H: Payload + Stamped + Layout, T: Payload + Layout> EncodedReader for SliceSampleReader<H, T> {
    fn take(&mut self, bytes: &mut Vec<u8>) -> Result<Option<Stamp>, BusError> {
        let sample = self.0.take()?;
        Ok(sample.map(|sample| {
            encode_slice(sample.header(), &sample, bytes);
            *sample.header().stamp()
        }))
    }
}
