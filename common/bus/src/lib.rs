//! The bus between processes on one machine: writers, readers and wakeups of the topics. This crate alone names
//! the middleware (iceoryx2).
//!
//! | file | holds |
//! |---|---|
//! | [`clock`] | mission time, pace, the monotonic clock |
//! | [`domain`] | a robot's directory, locks and shared memory on this machine |
//! | [`claim`] | a supervisor's claim on its robot, without a file |
//! | [`lock_holders`] | the processes that hold a lock on a file |
//! | [`bus_instance`] | the names of one bus instance |
//! | [`poll`], [`waiter`] | waiting for descriptors; one wait for topics, sockets, signals, processes |
//! | [`cdr`] | the encoding of payloads outside shared memory |
//! | `layout` | the layout of payloads in memory, for other languages; their values; their encoding |
//! | `payload` | the types that samples may have, the stamp that every sample begins with, and samples as messages |
//! | `spec` | the description of a topic |
//! | `topic` | the rows of a table of topics |
//! | `ports` | typed publishers and subscribers; in `ports/raw.rs` the middleware's ports, compiled once for all payloads |
//! | `make` | creating and joining a bus, and removing what killed processes leave on it |
//! | `leftovers` | the files that killed processes leave |
//! | `ownership` | checks of the owner and the permissions of a bus's files |
//! | `reserve` | the memory of segments, reserved when they are made |
//! | `close_on_exec` | descriptors that a child must not inherit |
//! | `authors` | the processes whose samples a reader returns |
//! | `write`, `read` | writers; readers and wakeups |
//! | `any` | topics of a table, and their readers and writers, without the types of their samples |
//! | `error` | errors of the bus |
//!
//! The crate follows these rules, each found by experiment:
//! - A recreated bus has its own names, and each node is created with the configuration of its bus. The middleware's process-wide
//!   configuration can be set only once, so it stays that of the first bus that a process joins.
//! - Only the supervisor creates services ([`Bus::make`]); everyone else opens them. So a stage that is killed while it starts leaves
//!   no incomplete service.
//! - The limits on writers are larger than needed, so readers check the author of each sample. They drop samples of older
//!   generations, and of processes that should not write.
//! - An event only wakes a reader. The reader then takes samples until there are none.

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
