//! Shared by the link to a robot of ROS 2 and the bridge. This folder alone names the library that speaks DDS.
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
