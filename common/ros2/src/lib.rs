//! Shared by the link to a robot of ROS 2 and the bridge. This folder alone names the library that speaks DDS.
//!
//! Messages and actions are written here and not by the crate `ros2-client` 0.12 (on the same rustdds; 99 crates for 64 here): it would
//! replace `cdr`, `topic`, and the bridge's `node` and `goals`, some 5,000 tokens, by a Rust type for each message, and a task that spins. A
//! server of an action there knows one way to name a request, so it answers clients of Fast DDS or of Cyclone DDS; keeps one client that waits
//! for the result of a goal; and does not go on with the goals of the process before it.
//!
//! | module | holds |
//! |---|---|
//! | [`topic`] | topics as DDS knows them |
//! | [`cdr`] | the encoding of messages |
//! | [`parts`] | what many messages are made of |
//! | [`messages`] | messages that a robot publishes |
//! | `participant` | a DDS domain's readers and writers, with the feature `dds` |

pub mod cdr;
pub mod messages;
#[cfg(feature = "dds")]
pub mod participant;
pub mod parts;
pub mod topic;
