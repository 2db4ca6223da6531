//! What a link to a robot of ROS 2 and the bridge to ROS 2 share. This folder alone names the library that speaks DDS.
//!
//! | module | holds |
//! |---|---|
//! | [`topic`] | a topic as DDS knows it |
//! | [`cdr`] | the encoding of messages |
//! | [`parts`] | what many messages are made of |
//! | `participant` | a participant of a DDS domain, its readers and writers, with the feature `dds` |

pub mod cdr;
#[cfg(feature = "dds")]
pub mod participant;
pub mod parts;
pub mod topic;
