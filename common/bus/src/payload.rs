//! What may lie in shared memory, and the stamp that every sample begins with.
//!
//! Why `unsafe` is allowed here: deriving `ZeroCopySend` writes an `unsafe impl` that promises a self-contained type
//! of uniform layout; [`Stamp`] is plain numbers in a `repr(C)` struct, so the promise holds. And a payload's name
//! can only be asked for through an `unsafe` call, which does nothing but return it.
#![allow(unsafe_code)]

use std::fmt::Debug;

pub use iceoryx2::prelude::ZeroCopySend;
use serde::{Deserialize, Serialize};

use crate::clock::MissionTime;

/// What a payload must be to lie in shared memory.
pub trait Payload: ZeroCopySend + Copy + Debug + Default + 'static {}
impl<P: ZeroCopySend + Copy + Debug + Default + 'static> Payload for P {}

/// The name of a payload, for every language.
pub(super) fn type_name<P: Payload>() -> &'static str {
    // SAFETY: the name is only shown; that the layout is the same everywhere is promised where each payload
    // derives the trait.
    unsafe { <P as ZeroCopySend>::type_name() }
}

/// Which sample this is, who wrote it and when: the first field of every payload and header.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, ZeroCopySend)]
#[type_name("firsthand.Stamp")]
#[repr(C)]
pub struct Stamp {
    /// The tick it belongs to: one tick runs from a motor frame to its command.
    pub tick: u64,
    /// Mission time, nanoseconds.
    pub stamp_ns: u64,
    /// Which generation of its writer: grows by one each time the stage is started.
    pub generation: u32,
    /// Counts the samples of this generation on this topic, from 0.
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
    /// The stamp.
    fn stamp(&self) -> &Stamp;
    /// The stamp, to be filled in by the writer.
    fn stamp_mut(&mut self) -> &mut Stamp;
}
