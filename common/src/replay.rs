//! The replay of one generation of a stage: the step gets the recorded inputs, and gives the samples that the generation must
//! have published.

use serde::Deserialize;
use thiserror::Error;

use crate::{
    bus::{Payload, Stamp, Stamped, Topic, encode_slice},
    clock::MissionTime,
    run::Run,
};

/// A sample that a generation published, or must have published.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Output {
    pub topic: &'static str,
    /// The sample as a message of its own (see [`crate::bus::cdr`]), the stamp's generation and sequence 0.
    pub message: Vec<u8>,
}

impl Output {
    pub fn of<H: Stamped, E: Payload>(
        topic: &Topic<H, E>,
        tick: u64,
        time: MissionTime,
        mut header: H,
        slice: &[E],
    ) -> Self {
        *header.stamp_mut() = Stamp { tick, stamp_ns: time.0, generation: 0, sequence: 0 };
        let mut message = Vec::new();
        encode_slice(&header, slice, &mut message);
        Self { topic: topic.spec().name, message }
    }
}

#[derive(Debug, Error)]
pub enum ReplayError {
    #[error("not an entry of this version of the stage ({0}); replay with the version that ran")]
    Foreign(#[from] postcard::Error),
    #[error("the stage cannot take an entry: {0}")]
    Stage(String),
}

pub trait Replay {
    /// Take the body of the next entry of its inputs. Gives what the process published because of it, in order.
    fn take(&mut self, entry: &[u8]) -> Result<Vec<Output>, ReplayError>;

    /// The entry in words, for a reader who looks for the cause of a difference.
    fn describe(&self, entry: &[u8]) -> Result<String, ReplayError>;
}

#[derive(Clone, Copy, Debug)]
pub struct Beginning<'a> {
    pub run: &'a Run,
    /// The body of the first entry of its inputs.
    pub start: &'a [u8],
    /// Whether `field` samples are compared: they take longer than all else.
    pub fields: bool,
}

pub type Begin = fn(Beginning<'_>) -> Result<Box<dyn Replay>, ReplayError>;

pub fn entry<'a, E: Deserialize<'a>>(body: &'a [u8]) -> Result<E, ReplayError> {
    Ok(postcard::from_bytes(body)?)
}
