//! ROS 2 code shared by the link and the bridge. Only this crate depends on the DDS library.
//!
//! The crate `ros2-client` 0.12, on the same rustdds, has 99 crates instead of 64, a spinning task,
//! and types of one release. Its action server identifies requests in one way, and so serves
//! clients of either Fast DDS or Cyclone DDS. It keeps one waiting client per goal, and drops the
//! goals of a previous process.

pub mod cdr;
pub mod frames;
pub mod messages;
pub mod msg;
#[cfg(feature = "dds")]
pub mod participant;
pub mod parts;
pub mod topic;
