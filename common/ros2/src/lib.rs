//! Shared by the link to a robot of ROS 2 and the bridge. This folder alone names the library that speaks DDS.
//!
//! The crate `ros2-client` 0.12 (on the same rustdds; 99 crates for 64 here) is not used: it has a task that spins, and its types are of one
//! release. A server of an action there knows one way to name a request, so it answers clients of Fast DDS or of Cyclone DDS; keeps one
//! client that waits for the result of a goal; and does not go on with the goals of the process before it.
//!
//! | module | holds |
//! |---|---|
//! | [`topic`] | topics as DDS knows them |
//! | [`cdr`] | the encoding of messages |
//! | [`msg`] | the messages of the files in `interfaces`, which `build.rs` writes |
//! | [`parts`] | what many messages are made of |
//! | [`messages`] | messages that a robot publishes |
//! | `participant` | a DDS domain's readers and writers, with the feature `dds` |

pub mod cdr;
pub mod messages;
pub mod msg;
#[cfg(feature = "dds")]
pub mod participant;
pub mod parts;
pub mod topic;
