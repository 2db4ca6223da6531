//! The X80 link: frames in, samples out, commands to the robot, and the one place that stops it.
//!
//! | module | holds |
//! |---|---|
//! | [`step`] | the link itself, pure: bytes and commands in, samples and bytes out |
//! | [`drive`] | the two wheels on the wire: channels and signs, counts in, timed commands out |
//! | [`failsafe`] | THE table of what slows, stops or ends, and why |
//! | [`transport`] | datagrams, a connection or a serial line |
//! | [`presence`] | whether the robot answers, and how it is looked for |
//! | [`restart`] | whether the robot restarted its counts |
//! | [`telemetry`] | batteries, infrared and the rest, in the units of the topics |
//! | [`backoff`] | pauses between attempts |
//! | `writers` | whose commands and orders are obeyed |
//! | [`shell`] | wires them to the topics |

pub mod backoff;
pub mod drive;
pub mod failsafe;
pub mod presence;
pub mod restart;
pub mod shell;
pub mod step;
pub mod telemetry;
pub mod transport;
mod writers;
