//! Types of samples in shared memory, the stamp of every sample, and samples as messages.
//!
//! Why `unsafe` is allowed here: deriving `ZeroCopySend` writes an `unsafe impl`, which promises a
//! self-contained type of uniform layout. [`Stamp`] is a `repr(C)` struct of numbers, so the
//! promise holds.
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

pub trait Payload: ZeroCopySend + Layout + Debug + Default + 'static {}
impl<P: ZeroCopySend + Layout + Debug + Default + 'static> Payload for P {}

pub(super) const fn has_slice<E>() -> bool {
    size_of::<E>() > 0
}

/// Tick, time and origin of a sample: the first field of every payload and header.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, ZeroCopySend)]
#[type_name("firsthand.Stamp")]
#[repr(C)]
pub struct Stamp {
    /// Tick of the sample, from a motor frame to its command.
    pub tick: u64,
    pub stamp_ns: u64,
    /// Writer's generation, which grows by one with each start of the stage.
    pub generation: u32,
    /// Number of earlier samples of this generation on this topic.
    pub sequence: u32,
}

layouts! { Stamp { tick stamp_ns generation sequence } }

impl Stamp {
    pub const fn time(&self) -> MissionTime {
        MissionTime(self.stamp_ns)
    }

    pub fn seconds(&self) -> f64 {
        self.time().seconds()
    }
}

/// Header of a sample: a payload that starts with a [`Stamp`].
pub trait Stamped: Payload {
    fn stamp(&self) -> &Stamp;
    fn stamp_mut(&mut self) -> &mut Stamp;
}

pub fn encode_slice<H: Layout, E: Layout>(header: &H, slice: &[E], bytes: &mut Vec<u8>) {
    let mut to = Encoder::new(bytes);
    header.encode(&mut to);
    if has_slice::<E>() {
        debug_assert!(u32::try_from(slice.len()).is_ok());
        (slice.len() as u32).encode(&mut to);
        E::encode_all(slice, &mut to);
    }
}

pub fn encode_sample<H: Layout>(sample: &H, bytes: &mut Vec<u8>) {
    encode_slice::<H, ()>(sample, &[], bytes);
}

pub fn decode_slice<H: Layout, E: Layout + Default>(message: &[u8]) -> Option<(H, Vec<E>)> {
    let mut from = Decoder::new(message)?;
    let header = H::decode(&mut from)?;
    if !has_slice::<E>() {
        return Some((header, Vec::new()));
    }
    let count = u32::decode(&mut from)? as usize;
    // The stated length is untrusted; an element takes at least one byte and half of its size in
    // memory.
    let least = size_of::<E>().div_ceil(2);
    let count = (count <= from.left() / least).then_some(count)?;
    let mut slice = vec![E::default(); count];
    E::decode_all(&mut slice, &mut from)?;
    Some((header, slice))
}

pub fn decode_sample<H: Layout>(message: &[u8]) -> Option<H> {
    Some(decode_slice::<H, ()>(message)?.0)
}
