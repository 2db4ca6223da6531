//! The types that samples in shared memory may have, the stamp that every sample begins with, and samples as messages.
//!
//! Why `unsafe` is allowed here: deriving `ZeroCopySend` writes an `unsafe impl`, which promises a self-contained type of uniform
//! layout. [`Stamp`] is a `repr(C)` struct of numbers, so the promise holds.
#![allow(unsafe_code)]

use std::fmt::Debug;

pub use iceoryx2::prelude::ZeroCopySend;
use serde::{Deserialize, Serialize};

use crate::{
    cdr::{Decoder, Encoder},
    clock::MissionTime,
    layout::Layout,
    layouts,
};

/// A type that may lie in shared memory.
pub trait Payload: ZeroCopySend + Layout + Debug + Default + 'static {}
impl<P: ZeroCopySend + Layout + Debug + Default + 'static> Payload for P {}

/// Whether a sample of elements `E` has a slice: it has none if `E` is `()`.
pub(super) const fn has_slice<E>() -> bool {
    size_of::<E>() > 0
}

/// The tick, the time and the origin of a sample: the first field of every payload and header.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, ZeroCopySend)]
#[type_name("firsthand.Stamp")]
#[repr(C)]
pub struct Stamp {
    /// The tick it belongs to: one tick runs from a motor frame to its command.
    pub tick: u64,
    pub stamp_ns: u64,
    /// The generation of the writer, which grows by one each time the stage is started.
    pub generation: u32,
    /// The number of samples that this generation published on this topic before.
    pub sequence: u32,
}

layouts! { Stamp { tick stamp_ns generation sequence } }

impl Stamp {
    pub const fn time(&self) -> MissionTime {
        MissionTime(self.stamp_ns)
    }
}

/// The header of a sample: a payload that starts with a [`Stamp`].
pub trait Stamped: Payload {
    fn stamp(&self) -> &Stamp;
    fn stamp_mut(&mut self) -> &mut Stamp;
}

/// `header` and `slice` as a message of their own (see [`super::cdr`]).
pub fn encode_slice<H: Layout, E: Layout>(header: &H, slice: &[E], bytes: &mut Vec<u8>) {
    let mut to = Encoder::new(bytes);
    header.encode(&mut to);
    if has_slice::<E>() {
        (slice.len() as u32).encode(&mut to);
        E::encode_all(slice, &mut to);
    }
}

pub fn encode_sample<H: Layout>(sample: &H, bytes: &mut Vec<u8>) {
    encode_slice::<H, ()>(sample, &[], bytes);
}

/// The header and slice in a message; none if the message holds others.
pub fn decode_slice<H: Layout, E: Layout + Default>(message: &[u8]) -> Option<(H, Vec<E>)> {
    let mut from = Decoder::new(message)?;
    let header = H::decode(&mut from)?;
    if !has_slice::<E>() {
        return Some((header, Vec::new()));
    }
    let count = u32::decode(&mut from)? as usize;
    // The message may state any length, but an element takes a byte or more, and at least half of its size in memory.
    let least = size_of::<E>().div_ceil(2);
    let count = (count <= from.left() / least).then_some(count)?;
    let mut slice = vec![E::default(); count];
    E::decode_all(&mut slice, &mut from)?;
    Some((header, slice))
}

/// The header in a message; none if the message holds another.
pub fn decode_sample<H: Layout>(message: &[u8]) -> Option<H> {
    Some(decode_slice::<H, ()>(message)?.0)
}
