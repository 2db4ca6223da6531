//! Shared code of firsthand's processes: only what two of them must agree on.
//!
//! This crate re-exports four lower ones:
//! - [`bus`]: writers, readers and wakeups; the only user of the middleware
//! - [`mission`]: mission file, geometry, kinematics
//! - [`x80_protocol`], here [`wire`]
//! - [`json_protocol`], here [`json_wire`]
//!
//! Modules, lowest layer first; a module uses only modules above it in this table.
//!
//! | module | holds |
//! |---|---|
//! | [`grid`] | cells and metres; parts and versions of a map |
//! | [`latency`] | a histogram that fits in a sample |
//! | [`least_squares`] | a fit of one factor to the newest pairs |
//! | [`ground_truth`] | a simulated robot's record of itself |
//! | [`signals`] | signals as a waitable descriptor |
//! | [`checkpoint`], [`journal`] | state that survives a SIGKILL: small, and large with few changes |
//! | [`process_status`], [`process_usage`] | kernel facts on a process; its processor and memory |
//! | [`samples`] | payloads of the topics |
//! | [`topics`] | table of topics |
//! | [`faults`] | table of injectable faults |
//! | [`follower`] | a consumer that follows a robot from run to run |
//! | [`run`] | the supervisor's input to the stages of a run |
//! | [`start`] | joining a run as the supervisor's child |
//! | [`external`] | joining a run otherwise |
//! | [`stage_command`] | command line of a stage's process |
//! | [`wiring`] | declared topics and persistence of a stage |
//! | [`stop_socket`] | operator's stop without middleware |
//! | [`shell`] | process shell of every stage |
//! | [`target`] | current target, as a stage follows it |
//! | [`driver`] | the link's interface to a robot's protocol |
//! | [`inputs`], [`replay`] | published inputs of every step; their replay |
//! | [`outputs`], [`stage`] | destinations of a stage's outputs; its runner for process and replay |
//! | [`found_response`] | identified response of the base, as stages take it |

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

pub use bus::{self, VERSION, bus_instance, claim, clock, domain, lock_holders, poll, waiter};
#[cfg(feature = "stage")]
pub use json_protocol as json_wire;
pub use mission::{self, address, geometry, kinematics, sonar};
pub use x80_protocol as wire;
