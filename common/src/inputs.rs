//! What each generation of a stage was started from and what its step took, in order, published before anything that
//! follows from it: the same step, fed with the same, gives the same outputs, in another process and another year.
//!
//! A generation's samples of topic `inputs` are pieces of one stream of bytes, in the order of their sequence. The stream is
//! entries, each `length u32 | body`, little-endian. The first is what the process was started from, each other one is what
//! one call of the step took; a body is the `postcard` encoding of the stage's own type, named in its `replay` module.
//!
//! An entry is published before the first sample that follows from it. Of a process that is killed, entries from
//! which nothing followed may be missing, and no others.

use serde::Serialize;

use crate::{
    bus::{BusError, SliceWriter},
    samples::{InputsHeader, name},
    shell::{Context, Progress},
    start::StageError,
    topics,
};

/// A piece has at most so many bytes.
const PIECE: usize = 16_384;
/// On a large map that is too little for its keyframes: then one byte for so many cells.
const CELLS_FOR_A_BYTE: usize = 8;
/// An entry has at most so many bytes: the whole belief of the largest map, and more.
pub const LONGEST_ENTRY: usize = 1 << 30;

/// Publishes what a step takes.
#[derive(Debug)]
pub struct InputLog {
    writer: SliceWriter<InputsHeader, u8>,
    header: InputsHeader,
    piece: usize,
    unpublished: Vec<u8>,
}

impl InputLog {
    /// Of the process of `context`, which starts from `start`. Published at once.
    ///
    /// # Errors
    /// When the topic cannot be opened.
    pub fn begin(context: &Context, start: &impl Serialize) -> Result<Self, StageError> {
        let generation = &context.generation;
        let cells = context.run.mission.grid_frame().area();
        let piece = PIECE.max(cells / CELLS_FOR_A_BYTE);
        let mut log = Self {
            writer: context.bus.slice_writer(&topics::INPUTS, generation.number, piece)?,
            header: InputsHeader { stage: name(generation.stage), ..InputsHeader::default() },
            piece,
            unpublished: Vec::new(),
        };
        log.append(start)?;
        log.publish(Progress::default())?;
        // A recorder connects to the new writer now: one that is killed soon is gone soon.
        log.writer.wake()?;
        Ok(log)
    }

    /// The step is about to take `input`, at `at`.
    ///
    /// # Errors
    /// When it cannot be published.
    pub fn note(&mut self, input: &impl Serialize, at: Progress) -> Result<(), StageError> {
        self.append(input)?;
        if self.unpublished.len() >= self.piece {
            self.publish(at)?;
        }
        Ok(())
    }

    fn append(&mut self, entry: &impl Serialize) -> Result<(), StageError> {
        let start = self.unpublished.len();
        let mut bytes = std::mem::take(&mut self.unpublished);
        bytes.extend_from_slice(&[0; 4]);
        let mut bytes = postcard::to_extend(entry, bytes)
            .map_err(|error| StageError::Other(format!("cannot encode an input: {error}")))?;
        let length = (bytes.len() - start - 4) as u32;
        bytes[start..start + 4].copy_from_slice(&length.to_le_bytes());
        self.unpublished = bytes;
        Ok(())
    }

    /// Publish what was noted: something follows from it.
    ///
    /// # Errors
    /// When it cannot be published.
    pub fn publish(&mut self, at: Progress) -> Result<(), BusError> {
        for piece in self.unpublished.chunks(self.piece) {
            self.writer.publish_slice_quietly(at.tick, at.time, self.header, piece)?;
        }
        self.unpublished.clear();
        Ok(())
    }
}

/// Samples as fields of an input: `#[serde(with = "inputs::sample")]`.
pub mod sample {
    use serde::{Deserializer, Serializer, de::Error as _};

    use crate::bus::{Layout, decode_sample, encode_sample};

    /// Write it.
    pub fn serialize<P: Layout, S: Serializer>(sample: &P, to: S) -> Result<S::Ok, S::Error> {
        let mut bytes = Vec::with_capacity(size_of::<P>() + 8);
        encode_sample(sample, &mut bytes);
        to.serialize_bytes(&bytes)
    }

    /// Read it.
    pub fn deserialize<'de, P: Layout, D: Deserializer<'de>>(from: D) -> Result<P, D::Error> {
        let bytes: &[u8] = serde_bytes::deserialize(from)?;
        decode_sample(bytes).ok_or_else(|| D::Error::custom("not a sample of this topic"))
    }
}

/// A header with a slice as a field of an input: `#[serde(with = "inputs::slice")]`.
pub mod slice {
    use std::borrow::Cow;

    use serde::{Deserializer, Serializer, de::Error as _};

    use crate::bus::{Layout, decode_slice, encode_slice};

    /// Write it.
    pub fn serialize<H: Layout, T: Layout + Clone, S: Serializer>(
        (header, slice): &(H, Cow<'_, [T]>),
        to: S,
    ) -> Result<S::Ok, S::Error> {
        let mut bytes = Vec::with_capacity(size_of::<H>() + size_of_val(&**slice) + 16);
        encode_slice(header, slice, &mut bytes);
        to.serialize_bytes(&bytes)
    }

    /// Read it.
    pub fn deserialize<'de, H, T, D>(from: D) -> Result<(H, Cow<'static, [T]>), D::Error>
    where
        H: Layout,
        T: Layout + Clone + Default,
        D: Deserializer<'de>,
    {
        let bytes: &[u8] = serde_bytes::deserialize(from)?;
        let (header, slice) =
            decode_slice(bytes).ok_or_else(|| D::Error::custom("not a sample of this topic"))?;
        Ok((header, Cow::Owned(slice)))
    }
}
