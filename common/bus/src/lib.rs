//! The bus between processes on one machine: writers, readers and wakeups of the topics. This crate alone names
//! the middleware (iceoryx2).
//!
//! | file | holds |
//! |---|---|
//! | [`clock`] | mission time, pace, the monotonic clock |
//! | [`domain`] | a robot's directory, locks and shared memory on this machine |
//! | [`lock_holders`] | who holds a lock on a file |
//! | [`bus_instance`] | the names of one instance of its bus |
//! | [`poll`], [`waiter`] | waiting for descriptors; one wait for topics, sockets, signals, processes |
//! | `payload` | what may lie in shared memory, and the stamp that every sample begins with |
//! | `layout` | how payloads lie in memory, for other languages; what they hold; how they are written elsewhere |
//! | [`cdr`] | the encoding they are written in elsewhere |
//! | `encoded` | readers of any topic, whose samples come encoded |
//! | `spec` | what a table of topics says of one topic |
//! | `topic` | what a table of topics is made of |
//! | `ports` | the middleware's services and ports, compiled once for all payloads |
//! | `make` | making and joining a bus, and removing what killed processes leave on it |
//! | `leftovers` | the files such processes leave |
//! | `ownership` | whose the files are, and who may write them |
//! | `write`, `read` | writers; readers and wakeups |
//! | `any` | readers of any topic |
//! | `open` | writers of any topic, and who has opened it |
//! | `error` | what can go wrong |
//!
//! Rules it follows, each found by experiment:
//! - a bus made anew has names of its own, and its configuration goes with the node: the process-wide one, which is set
//!   once, is that of the first bus a process joins;
//! - services are created by the supervisor alone ([`Bus::make`]) and opened by everyone else, so that no stage
//!   killed while starting leaves one half made;
//! - limits have slack, so authorship is checked here: readers drop samples of a writer's older generations, and of
//!   processes that should not write;
//! - events only wake; data come from receiving until there is none.

mod any;
pub mod bus_instance;
pub mod cdr;
pub mod clock;
pub mod domain;
mod encoded;
mod error;
mod layout;
mod leftovers;
pub mod lock_holders;
mod make;
mod open;
mod ownership;
mod payload;
pub mod poll;
mod ports;
mod read;
mod spec;
mod topic;
pub mod waiter;
mod write;

pub use self::{
    any::{AnyReader, AnySample, ReadableTopic},
    encoded::{EncodedReader, EncodedTopic, EncodedWriter},
    error::BusError,
    layout::{
        Field, Kind, Layout, Structure, Value, decode_sample, decode_slice, encode_sample,
        encode_slice, kind_of,
    },
    make::{Bus, Services},
    open::OpenTopic,
    payload::{Payload, Stamp, Stamped, ZeroCopySend},
    ports::OpenedBy,
    read::{Author, Ignored, Reader, Slice, SliceReader, Wakeup},
    spec::{EVERY_STAGE, Limits, Logged, OPERATOR, Rate, SUPERVISOR, Spec},
    topic::{AnyTopic, SliceTopic, Topic},
    write::{SliceWriter, Writer},
};
