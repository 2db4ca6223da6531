//! Shared code of firsthand's processes: only what two of them must agree on.
//!
//! This crate re-exports four lower ones:
//! - [`bus`]: writers, readers and wakeups; the only user of the middleware
//! - [`mission`]: mission file, geometry, kinematics
//! - [`x80_protocol`], here [`wire`]
//! - [`json_protocol`], here [`json_wire`]
//!
//! Modules, lowest layer first; a module uses only modules before it in this list.
//!
//! [`grid`], [`latency`], [`least_squares`], [`ground_truth`], [`signals`], [`checkpoint`],
//! [`journal`], [`process_status`], [`process_usage`], [`samples`], [`motion_law`], [`topics`],
//! [`faults`], [`follower`], [`run`], [`start`], [`external`], [`stage_command`], [`wiring`],
//! [`stop_socket`], [`shell`], [`target`], [`driver`], [`inputs`], [`replay`], [`outputs`],
//! [`stage`], [`found_response`].

pub mod checkpoint;
pub mod driver;
#[cfg(feature = "stage")]
pub mod external;
pub mod faults;
pub mod file;
pub mod follower;
#[cfg(feature = "stage")]
pub mod found_response;
pub mod grid;
pub mod ground_truth;
#[cfg(feature = "stage")]
pub mod inputs;
pub mod journal;
pub mod latency;
pub mod least_squares;
#[cfg(feature = "stage")]
pub mod motion_law;
#[cfg(feature = "stage")]
pub mod outputs;
pub mod process_status;
pub mod process_usage;
pub mod replay;
pub mod roster;
pub mod run;
pub mod samples;
#[cfg(feature = "stage")]
pub mod shell;
#[cfg(feature = "stage")]
pub mod signals;
#[cfg(feature = "stage")]
pub mod stage;
#[cfg(feature = "stage")]
pub mod stage_command;
#[cfg(feature = "stage")]
pub mod start;
pub mod stop_socket;
#[cfg(feature = "stage")]
pub mod target;
pub mod topics;
pub mod wiring;

pub use bus::{
    self, VERSION, bus_instance, claim, clock, domain, lock_holders, machine, poll, waiter,
};
#[cfg(feature = "stage")]
pub use json_protocol as json_wire;
pub use mission::{self, address, geometry, kinematics, sonar};
pub use x80_protocol as wire;
