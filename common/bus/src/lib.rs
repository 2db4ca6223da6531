//! Bus between the processes on one machine: writers, readers and wakeups of topics. Only this
//! crate depends on the middleware (iceoryx2).
//!
//! | file | holds |
//! |---|---|
//! | [`clock`] | mission time, pace, the monotonic clock |
//! | [`domain`] | a robot's directory, locks and shared memory |
//! | [`claim`] | a supervisor's claim on its robot, without a file |
//! | [`lock_holders`] | processes that hold a lock on a file |
//! | [`bus_instance`] | names of one bus instance |
//! | [`poll`], [`waiter`] | waiting for descriptors; one wait for topics, sockets, signals, processes |
//! | [`cdr`] | encoding of payloads outside shared memory |
//! | `layout` | memory layout, values and encoding of payloads, for other languages |
//! | `payload` | types of samples, the stamp of every sample, samples as messages |
//! | `spec` | description of a topic |
//! | `topic` | rows of a table of topics |
//! | `ports` | typed publishers and subscribers; `ports/raw.rs` compiles the middleware's ports once |
//! | `make` | creating and joining a bus, and cleaning up after killed processes |
//! | `leftovers` | files that killed processes leave |
//! | `ownership` | owner and permission checks of a bus's files |
//! | `reserve` | memory of segments, reserved at creation |
//! | `close_on_exec` | descriptors that children must not inherit |
//! | `authors` | processes whose samples a reader returns |
//! | `write`, `read` | writers; readers and wakeups |
//! | `any` | topics, readers and writers without sample types |
//! | `error` | errors of the bus |
//!
//! Experiments led to these rules:
//! - A recreated bus has its own names, and each node uses its bus's configuration. The
//!   middleware's process-wide configuration can be set only once: it stays that of the first
//!   joined bus.
//! - Only the supervisor creates services ([`Bus::make`]); all others open them. A stage killed
//!   during its start therefore leaves no incomplete service.
//! - The limits on writers exceed the need, so readers check the author of each sample. They drop
//!   samples of older generations and of unauthorised processes.
//! - An event only wakes a reader, which then takes samples until none are left.

mod any;
mod authors;
pub mod bus_instance;
pub mod cdr;
pub mod claim;
pub mod clock;
mod close_on_exec;
pub mod domain;
mod error;
mod layout;
mod leftovers;
pub mod lock_holders;
mod make;
mod ownership;
mod payload;
pub mod poll;
mod ports;
mod read;
mod reserve;
mod spec;
mod topic;
pub mod waiter;
mod write;

pub use self::{
    any::{AnyReader, AnySample, AnyTopic, AnyWriter},
    authors::{Admitted, Author, Ignored, Names, Writers},
    bus_instance::VERSION,
    close_on_exec::close_all_on_exec,
    error::BusError,
    layout::{Field, Kind, Layout, Structure, Value, kind_of},
    make::{Bus, Services},
    payload::{
        Payload, Stamp, Stamped, ZeroCopySend, decode_sample, decode_slice, encode_sample,
        encode_slice,
    },
    ports::{OpenedBy, Slice},
    read::{Reader, Wakeup},
    spec::{EVERY_STAGE, Limits, Logged, OPERATOR, Rate, SUPERVISOR, Spec},
    topic::Topic,
    write::Writer,
};
