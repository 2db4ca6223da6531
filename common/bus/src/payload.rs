//! The types that samples in shared memory may have, and the stamp that every sample begins with.
//!
//! Why `unsafe` is allowed here: deriving `ZeroCopySend` writes an `unsafe impl`, which promises a self-contained type of uniform
//! layout. [`Stamp`] is a `repr(C)` struct of numbers, so the promise holds. The name of a payload can be read only through an
//! `unsafe` call, which does nothing else.
#![allow(unsafe_code)]

use std::fmt::Debug;

pub use iceoryx2::prelude::ZeroCopySend;
use serde::{Deserialize, Serialize};

use crate::clock::MissionTime;

/// A type that may lie in shared memory.
pub trait Payload: ZeroCopySend + Copy + Debug + Default + 'static {}
impl<P: ZeroCopySend + Copy + Debug + Default + 'static> Payload for P {}

/// The name of a payload in all languages.
pub(super) fn type_name<P: Payload>() -> &'static str {
    // SAFETY: the call only returns the name. Each payload promises its uniform layout where it derives the trait.
    unsafe { <P as ZeroCopySend>::type_name() }
}

/// The tick, the time and the origin of a sample: the first field of every payload and header.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, ZeroCopySend)]
#[type_name("firsthand.Stamp")]
#[repr(C)]
pub struct Stamp {
    /// The tick it belongs to: one tick runs from a motor frame to its command.
    pub tick: u64,
    /// Mission time, nanoseconds.
    pub stamp_ns: u64,
    /// The generation of the writer, which grows by one each time the stage is started.
    pub generation: u32,
    /// The number of samples that this generation published on this topic before.
    pub sequence: u32,
}

impl Stamp {
    /// Mission time.
    #[must_use]
    pub const fn time(&self) -> MissionTime {
        MissionTime(self.stamp_ns)
    }
}

/// A payload or header that starts with a [`Stamp`].
pub trait Stamped {
    fn stamp(&self) -> &Stamp;
    /// The stamp, which the writer fills in.
    fn stamp_mut(&mut self) -> &mut Stamp;
}
