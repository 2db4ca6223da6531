//! What firsthand's processes share: only what two of them must agree on.
//!
//! Layout, lowest layer first: a module uses modules above it in this table only.
//!
//! | module | holds |
//! |---|---|
//! | [`clock`] | mission time, pace, the monotonic clock |
//! | [`geometry`], [`grid`] | shapes; cells and metres, windows, versions |
//! | [`kinematics`] | equations (1)-(3) and their inverses |
//! | [`infrared`], [`sonar`] | THE mounting of the infrared rangers; of an ultrasonic one, (19) |
//! | [`latency`] | a histogram that fits in a sample |
//! | [`latency_budget`] | what a stage's process does with its part of a tick |
//! | [`address`] | where a robot answers, and over which transport |
//! | [`wire`] | the X80's protocol: frames and messages |
//! | [`ground_truth`] | what a simulated robot writes about itself |
//! | [`mission`] | the mission file, validated |
//! | [`poll`] | waiting for descriptors |
//! | [`signals`] | signals as something to wait for |
//! | [`lock_holders`] | who holds a lock on a file |
//! | [`domain`] | a robot's directory, locks and shared memory on this machine |
//! | [`bus_instance`] | the names of one making of its bus |
//! | [`checkpoint`], [`journal`] | state that outlives a SIGKILL: small, and large with few changes |
//! | [`bus`] | writers, readers and wakeups; the one folder that names the middleware |
//! | [`samples`] | the payloads of the topics |
//! | [`topics`] | THE table of topics |
//! | [`faults`] | THE table of what can be broken in a stage on purpose |
//! | [`waiter`] | one wait for topics, sockets, signals, processes |
//! | [`follower`] | a consumer that follows a robot from run to run |
//! | [`run`] | what the supervisor gives the stages of a run |
//! | [`start`] | how a stage's process takes its place in a run |
//! | [`external`] | the same for a stage that the supervisor did not start |
//! | [`stage_command`] | the command line of a stage's process |
//! | [`shell`] | the process shell every stage runs in |
//! | [`step`] | what a stage computes: the trait of every stage's pure step |
//! | [`inputs`], [`replay`] | what every step took, published; what a replay makes of it |

pub mod address;
pub mod bus;
pub mod bus_instance;
pub mod checkpoint;
pub mod clock;
pub mod domain;
pub mod external;
pub mod faults;
pub mod follower;
pub mod geometry;
pub mod grid;
pub mod ground_truth;
pub mod infrared;
pub mod inputs;
pub mod journal;
pub mod kinematics;
pub mod latency;
pub mod latency_budget;
pub mod lock_holders;
pub mod mission;
pub mod poll;
pub mod process_status;
pub mod replay;
pub mod roster;
pub mod run;
pub mod samples;
pub mod shell;
pub mod signals;
pub mod sonar;
pub mod stage_command;
pub mod start;
pub mod step;
pub mod topics;
pub mod waiter;
pub mod wire;

/// The guide's Rust is compiled with the doc tests.
#[cfg(doctest)]
#[doc = include_str!("../../supervisor/guide/attach.md")]
pub struct Attach;
