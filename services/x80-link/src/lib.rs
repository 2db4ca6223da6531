//! The X80 link: frames in, samples out, commands to the robot, and the one place that stops it.
//!
//! | module | holds |
//! |---|---|
//! | [`step`] | the link itself, pure: bytes and commands in, samples and bytes out |
//! | [`failsafe`] | whether a command may move the robot, and why not |
//! | [`transport`] | datagrams, a connection or a serial line |
//! | [`backoff`] | pauses between attempts |
//! | [`shell`] | wires them to the topics |

pub mod backoff;
pub mod failsafe;
pub mod shell;
pub mod step;
pub mod transport;
