//! ROS 2 code shared by the link and the bridge. Only this crate depends on the DDS library.

pub mod cdr;
pub mod frames;
pub mod messages;
pub mod msg;
#[cfg(feature = "dds")]
pub mod participant;
pub mod parts;
pub mod topic;
