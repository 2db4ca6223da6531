//! Replay of one generation of a stage: recorded inputs reproduce the samples that it must have
//! published.

use serde::Deserialize;
use thiserror::Error;

use crate::{
    bus::{Payload, Stamp, Stamped, Topic, encode_slice},
    clock::MissionTime,
    run::Run,
};

#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Output {
    pub topic: &'static str,
    /// Sample as a message (see [`crate::bus::cdr`]), with generation and sequence 0 in its stamp.
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
    #[error(
        "the entry belongs to another version of the stage ({0}); replay with the version that ran"
    )]
    Foreign(#[from] postcard::Error),
    #[error("the stage cannot take an entry: {0}")]
    Stage(String),
}

pub trait Replay {
    /// Takes the body of the next input entry. Returns the resulting samples of the process, in
    /// order.
    fn take(&mut self, entry: &[u8]) -> Result<Vec<Output>, ReplayError>;

    /// Describes the entry, to help find the cause of a difference.
    fn describe(&self, entry: &[u8]) -> Result<String, ReplayError>;
}

#[derive(Clone, Copy, Debug)]
pub struct Beginning<'a> {
    pub run: &'a Run,
    pub start: &'a [u8],
    /// Whether `field` samples are compared, which takes longer than all else.
    pub fields: bool,
}

pub type Begin = fn(Beginning<'_>) -> Result<Box<dyn Replay>, ReplayError>;

pub fn entry<'a, E: Deserialize<'a>>(body: &'a [u8]) -> Result<E, ReplayError> {
    Ok(postcard::from_bytes(body)?)
}
