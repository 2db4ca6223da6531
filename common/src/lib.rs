//! The code that firsthand's processes share: only what two of them must agree on.
//!
//! Four crates lie below this one, and their modules are found under its name too: [`bus`] (writers, readers and wakeups; it alone
//! names the middleware), [`mission`] (the mission file, geometry, kinematics) [`x80_protocol`] (here [`wire`]) and [`json_protocol`]
//! (here [`json_wire`]).
//!
//! Layout, lowest layer first: a module uses modules above it in this table only.
//!
//! | module | holds |
//! |---|---|
//! | [`grid`] | cells and metres; parts and versions of a map |
//! | [`latency`] | a histogram that fits in a sample |
//! | [`least_squares`] | a fit of one factor to the newest pairs |
//! | [`ground_truth`] | what a simulated robot writes about itself |
//! | [`signals`] | signals as something to wait for |
//! | [`checkpoint`], [`journal`] | state that outlives a SIGKILL: small, and large with few changes |
//! | [`process_status`], [`process_usage`] | what the kernel says of a process; its processor and memory |
//! | [`samples`] | the payloads of the topics |
//! | [`topics`] | THE table of topics |
//! | [`faults`] | THE table of what can be broken in a stage on purpose |
//! | [`follower`] | a consumer that follows a robot from run to run |
//! | [`run`] | what the supervisor gives the stages of a run |
//! | [`start`] | how a stage's process takes its place in a run |
//! | [`external`] | how a stage that the supervisor did not start takes its place |
//! | [`stage_command`] | the command line of a stage's process |
//! | [`wiring`] | what a stage's process opens and persists, declared |
//! | [`stop_socket`] | the operator's stop without middleware |
//! | [`shell`] | the process shell every stage runs in |
//! | [`target`] | the target, as a stage follows it |
//! | [`driver`] | what the link needs of a robot's protocol |
//! | [`inputs`], [`replay`] | the inputs of every step, published; their replay |
//! | [`outputs`], [`stage`] | where a stage's outputs go; its runner: process and replay of every stage, once |
//! | [`found_response`] | what the link found of the base's response, as stages take it |

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
