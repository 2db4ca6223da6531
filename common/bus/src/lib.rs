//! Bus between the processes on one machine: writers, readers and wakeups of topics. Only this
//! crate depends on the middleware (iceoryx2).
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
pub mod machine;
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
    any::{AnyReader, AnyTopic, AnyWriter},
    authors::{Admitted, Author, Ignored, Names, Writers},
    bus_instance::VERSION,
    close_on_exec::close_all_on_exec,
    error::BusError,
    layout::{Field, Kind, Layout, Structure, Value, kind_of, unpadded},
    make::{Bus, Services},
    payload::{
        Payload, Stamp, Stamped, ZeroCopySend, decode_sample, decode_slice, encode_sample,
        encode_slice,
    },
    ports::{Memory, OpenedBy, Slice},
    read::{Reader, Wakeup},
    spec::{EVERY_STAGE, Limits, Logged, OPERATOR, Rate, SUPERVISOR, Spec},
    topic::Topic,
    write::Writer,
};
