//! Topic `inputs`: the initial state of each generation of a stage, and the inputs of its step, in
//! order. The same step with the same inputs gives the same outputs, so a replay can recompute
//! them.
//!
//! A generation's samples are pieces of one byte stream, ordered by sequence. Its entries are
//! `length u32 | body`, little-endian: first the start of the process, then the input of each step.
//! A body is the `postcard` encoding of the stage's [`Entry`](crate::stage::Stage::Entry).
//!
//! An entry is published before the first sample that depends on it. A kill can therefore lose only
//! entries without effects.

use std::cell::RefCell;

use serde::{Serialize, Serializer};

use crate::{
    bus::{BusError, Writer},
    samples::{InputsHeader, name},
    shell::{Context, Progress},
    start::{Result, StageError},
    topics,
};

const PIECE: usize = 16_384;
/// Cells per byte of a piece; keyframes of a large map need longer pieces.
const CELLS_FOR_A_BYTE: usize = 8;
/// Most bytes of an entry: more than the whole belief of the largest map.
pub const LONGEST_ENTRY: usize = 1 << 30;

#[derive(Debug)]
pub(crate) struct InputLog {
    writer: Writer<InputsHeader, u8>,
    header: InputsHeader,
    piece: usize,
    unpublished: Vec<u8>,
}

impl InputLog {
    pub(crate) fn begin(context: &Context, start: &impl Serialize) -> Result<Self> {
        let generation = &context.generation;
        let piece = PIECE.max(context.run.mission.grid_frame().area() / CELLS_FOR_A_BYTE);
        let mut log = Self {
            writer: context.bus.slice_writer(&topics::INPUTS, generation.number, piece)?,
            header: InputsHeader { stage: name(generation.stage), ..InputsHeader::default() },
            piece,
            unpublished: Vec::new(),
        };
        log.append(start)?;
        log.publish(Progress::default())?;
        // The wakeup lets a recorder connect before this process can be killed.
        log.writer.wake()?;
        Ok(log)
    }

    pub(crate) fn note(&mut self, input: &impl Serialize, at: Progress) -> Result {
        self.append(input)?;
        if self.unpublished.len() >= self.piece {
            self.publish(at)?;
        }
        assert!(self.unpublished.len() < self.piece);
        Ok(())
    }

    fn append(&mut self, entry: &impl Serialize) -> Result {
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

    pub(crate) fn publish(&mut self, at: Progress) -> Result<(), BusError> {
        for piece in self.unpublished.chunks(self.piece) {
            self.writer.publish_quietly(at.tick, at.time, self.header, piece)?;
        }
        self.unpublished.clear();
        Ok(())
    }
}

thread_local! {
    /// Buffer reused for every sample.
    static ENCODED: RefCell<Vec<u8>> = const { RefCell::new(Vec::new()) };
}

fn serialize_encoded<S: Serializer>(
    encode: impl FnOnce(&mut Vec<u8>),
    to: S,
) -> Result<S::Ok, S::Error> {
    ENCODED.with_borrow_mut(|bytes| {
        bytes.clear();
        encode(bytes);
        to.serialize_bytes(bytes)
    })
}

pub mod sample {
    use serde::{Deserializer, Serializer, de::Error as _};

    use crate::bus::{Layout, decode_sample, encode_sample};

    pub fn serialize<P: Layout, S: Serializer>(sample: &P, to: S) -> Result<S::Ok, S::Error> {
        super::serialize_encoded(|bytes| encode_sample(sample, bytes), to)
    }

    pub fn deserialize<'de, P: Layout, D: Deserializer<'de>>(from: D) -> Result<P, D::Error> {
        let bytes: &[u8] = serde_bytes::deserialize(from)?;
        decode_sample(bytes).ok_or_else(|| D::Error::custom("not a sample of this topic"))
    }
}

pub mod slice {
    use std::borrow::Cow;

    use serde::{Deserializer, Serializer, de::Error as _};

    use crate::bus::{Layout, decode_slice, encode_slice};

    pub fn serialize<H: Layout, T: Layout + Clone, S: Serializer>(
        (header, slice): &(H, Cow<'_, [T]>),
        to: S,
    ) -> Result<S::Ok, S::Error> {
        super::serialize_encoded(|bytes| encode_slice(header, slice, bytes), to)
    }

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
