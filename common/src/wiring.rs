//! The declaration of what a stage's process opens on the bus and what it persists. The table of stages refers to it, and the
//! process opens what it declares: [`readers`](crate::readers) names a topic, its reader and the field that holds it in one line.

use crate::{
    bus::{AnyTopic, Bus, BusError},
    topics::{COMPLAINTS, FAULTS, HEALTH, INPUTS, ROSTER},
};

pub type Topics = &'static [&'static dyn AnyTopic];

/// Every stage's process also reads the requests of faults, and the roster, which names the processes that it admits.
pub static EVERY_STAGE_READS: Topics = &[&FAULTS, &ROSTER];
/// Every stage's process also writes its heartbeats, its trouble, and the inputs of its step.
pub static EVERY_STAGE_WRITES: Topics = &[&HEALTH, &COMPLAINTS, &INPUTS];

/// The topics that a stage reads, is woken by and writes, and the state that it persists.
pub struct Wiring {
    /// The stage's name: of the process, of `firsthand stage NAME`, of the folder under `services/`.
    pub stage: &'static str,
    /// Topics it reads, whose writers start before it.
    pub inputs: Topics,
    /// Topics it reads whose writers start after it: those that close the loop, and those that consumers write.
    pub feedback: Topics,
    /// Topics that start a turn of its work loop.
    pub wakes: Topics,
    /// Topics that it alone writes. The last one that is published each tick answers the tick. Topics that follow each frame
    /// of the robot are opened after the first heartbeat that says ready.
    pub outputs: Topics,
    pub persists: Persists,
}

/// The state that a stage's next process goes on from, in the file `STAGE.checkpoint` of the run's directory.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Persists {
    /// Nothing is persisted: the next inputs bring everything.
    Nothing,
    /// The state, of at most so many bytes, is saved after each step.
    State(usize),
    /// The inputs since a snapshot are saved. The mission says how large a snapshot is.
    Journal,
}

pub trait Readers: Sized {
    const INPUTS: Topics = &[];
    const FEEDBACK: Topics = &[];

    /// Opens a reader of each topic of both lists.
    fn open_readers(bus: &Bus) -> Result<Self, BusError>;
}

impl Readers for () {
    fn open_readers(_: &Bus) -> Result<Self, BusError> {
        Ok(())
    }
}

/// A struct of readers, or of what is made from one, each with its topic.
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
