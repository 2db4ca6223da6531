//! The X80 link: frames in, samples out, commands to the robot, and the one place that stops it.
//!
//! | module | holds |
//! |---|---|
//! | [`step`] | the link itself, pure: bytes and commands in, samples and bytes out |
//! | [`drive`] | the two wheels on the wire: channels and signs, counts in, timed commands out |
//! | [`failsafe`] | THE table of what slows, stops or ends, and why; in `failsafe/` a monitor for each row or several |
//! | [`transport`] | datagrams, a connection or a serial line |
//! | `rangers` | the readings of a tick that go into the map |
//! | [`telemetry`] | batteries and the other sensors, in the units of the topics |
//! | [`backoff`] | pauses between attempts |
//! | `writers` | whose commands and orders are obeyed |
//! | [`stage`] | what a recording holds of it, and what it publishes |
//! | [`shell`] | its process: the wire and the topics it reads |

pub mod backoff;
pub mod drive;
pub mod failsafe;
mod rangers;
pub mod shell;
pub mod stage;
pub mod step;
pub mod telemetry;
pub mod transport;
mod writers;
