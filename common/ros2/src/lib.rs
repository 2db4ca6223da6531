//! ROS 2 code shared by the link and the bridge. Only this crate depends on the DDS library.
//!
//! The crate `ros2-client` 0.12, on the same rustdds, has 99 crates instead of 64, a spinning task,
//! and types of one release. Its action server identifies requests in one way, and so serves
//! clients of either Fast DDS or Cyclone DDS. It keeps one waiting client per goal, and drops the
//! goals of a previous process.
//!
//! | module | holds |
//! |---|---|
//! | [`topic`] | topics as DDS names them |
//! | [`cdr`] | the encoding of messages |
//! | [`msg`] | messages of the files in `interfaces`, written by `build.rs` |
//! | [`parts`] | common parts of messages |
//! | [`messages`] | messages that a robot publishes |
//! | `participant` | readers and writers of a DDS domain, with the feature `dds` |

pub mod cdr;
pub mod messages;
pub mod msg;
#[cfg(feature = "dds")]
pub mod participant;
pub mod parts;
pub mod topic;
