//! The bridge to ROS 2: the topics of a robot for RViz and other nodes, and the requests that nodes may make. It is a consumer, which
//! anyone may kill.
//!
//! | module | holds |
//! |---|---|
//! | [`topics`] | THE table of topics |
//! | [`shown`] | samples of the robot's bus to messages, pure |
//! | [`asked`] | messages that ask for something to what they ask, pure |
//! | [`action`] | the server of the action `navigate_to_pose`, pure |
//! | [`messages`] | the messages that are written |
//! | `bridge` | the bridge itself, with the feature `dds` |
//! | `endpoints` | its readers and writers, and the node that `ros2 node list` shows |
//! | `orders` | what was asked is done, without holding up the bridge |

pub mod action;
pub mod asked;
pub mod messages;
pub mod shown;
pub mod topics;

#[cfg(feature = "dds")]
pub mod bridge;
#[cfg(feature = "dds")]
mod endpoints;
#[cfg(feature = "dds")]
mod orders;

#[cfg(test)]
mod tests;
