//! Declaration of a stage's topics and persistence. The table of stages refers to it, and the
//! process opens it: [`readers`](crate::readers) names a topic, its reader and its field in one
//! line.

use crate::{
    bus::{AnyTopic, Bus, BusError},
    topics::{COMPLAINTS, FAULTS, HEALTH, INPUTS, ROSTER},
};

pub type Topics = &'static [&'static dyn AnyTopic];

/// Additional inputs of every stage's process; the roster names the authorised processes.
pub static EVERY_STAGE_READS: Topics = &[&FAULTS, &ROSTER];
/// Additional outputs of every stage's process.
pub static EVERY_STAGE_WRITES: Topics = &[&HEALTH, &COMPLAINTS, &INPUTS];

/// Topics and persisted state of a stage.
pub struct Wiring {
    /// Name of the stage: of the process, of `firsthand stage NAME`, of the folder under
    /// `services/`.
    pub stage: &'static str,
    /// Input topics whose writers start before it.
    pub inputs: Topics,
    /// Input topics whose writers start after it: those that close the loop, and those that
    /// consumers write.
    pub feedback: Topics,
    pub wakes: Topics,
    /// Topics that it alone writes. The last one published in each tick answers the tick. Topics
    /// that follow each robot frame are opened after the first ready heartbeat.
    pub outputs: Topics,
    pub persists: Persists,
}

/// Persisted state for the stage's next process, in the file `STAGE.checkpoint` of the run's
/// directory.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Persists {
    /// None: the next inputs restore everything.
    Nothing,
    /// State of at most this many bytes, saved after each step.
    State(usize),
    /// Inputs since a snapshot. The mission determines a snapshot's size.
    Journal,
}

pub trait Readers: Sized {
    const INPUTS: Topics = &[];
    const FEEDBACK: Topics = &[];

    fn open_readers(bus: &Bus) -> Result<Self, BusError>;
}

impl Readers for () {
    fn open_readers(_: &Bus) -> Result<Self, BusError> {
        Ok(())
    }
}

#[macro_export]
macro_rules! readers {
    ($(#[$meta:meta])* $vis:vis struct $name:ident {
        $(inputs { $($input:ident: $input_reader:ty = $input_topic:path,)* })?
        $(feedback { $($feedback:ident: $feedback_reader:ty = $feedback_topic:path,)* })?
    }) => {
        $(#[$meta])*
        $vis struct $name {
            $($($input: $input_reader,)*)?
            $($($feedback: $feedback_reader,)*)?
        }

        impl $crate::wiring::Readers for $name {
            $(const INPUTS: $crate::wiring::Topics = &[$(&$input_topic),*];)?
            $(const FEEDBACK: $crate::wiring::Topics = &[$(&$feedback_topic),*];)?

            fn open_readers(bus: &$crate::bus::Bus) -> Result<Self, $crate::bus::BusError> {
                Ok(Self {
                    $($($input: bus.reader(&$input_topic)?.into(),)*)?
                    $($($feedback: bus.reader(&$feedback_topic)?.into(),)*)?
                })
            }
        }
    };
}
