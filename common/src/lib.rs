//! The ground every firsthand process stands on: only what two processes must agree on.
//!
//! Layout, from the idea to the machine:
//!
//! | module | holds |
//! |---|---|
//! | [`mission`] | the mission file, validated |
//! | [`address`] | where a robot answers, and over what |
//! | [`geometry`], [`grid`] | shapes; cells and metres, windows, versions |
//! | [`kinematics`] | (1)-(3) and their inverses |
//! | [`clock`] | mission time, pace, the monotonic clock |
//! | [`latency`] | a histogram that fits in a sample |
//! | [`topics`] | THE table of topics |
//! | [`samples`] | their payloads |
//! | [`domain`] | where a robot lives on this machine |
//! | [`bus`] | writers and readers: the one file that names the middleware |
//! | [`waiter`] | one wait for topics, sockets, signals, processes |
//! | [`checkpoint`] | state that outlives a SIGKILL |
//! | [`faults`] | THE table of what can be broken in a stage on purpose |
//! | [`run`] | what the supervisor tells the stages of a run |
//! | [`signals`] | signals as something to wait for |
//! | [`step`] | what a stage computes: the trait of every stage's pure step |
//! | [`shell`] | the process shell every stage runs in |
//! | `external` | how a stage that the supervisor did not start finds its place |
//! | [`wire`] | the X80's protocol: frames and messages |
//! | [`truth`] | what a simulated robot tells of itself |

pub mod address;
pub mod bus;
pub mod checkpoint;
pub mod clock;
pub mod domain;
mod external;
pub mod faults;
pub mod geometry;
pub mod grid;
pub mod journal;
pub mod kinematics;
pub mod latency;
pub mod mission;
pub mod run;
pub mod samples;
pub mod shell;
pub mod signals;
pub mod step;
pub mod topics;
pub mod truth;
pub mod waiter;
pub mod wire;

/// The README's Rust is compiled with the doc tests.
#[cfg(doctest)]
#[doc = include_str!("../../README.md")]
pub struct Readme;
