//! The X80 link: frames in, samples out, commands to the robot, and the one place that stops it.
//!
//! | module | holds |
//! |---|---|
//! | [`step`] | the link itself, pure: bytes and commands in, samples and bytes out |
//! | [`drive`] | the two wheels on the wire: channels and signs, counts in, timed commands out |
//! | [`failsafe`] | THE table of what slows, stops or ends, and why |
//! | [`transport`] | datagrams, a connection or a serial line |
//! | [`presence`] | whether the robot answers, and how it is looked for |
//! | [`latency_monitor`] | whether what the robot sends is old |
//! | [`restart`] | whether counts can follow those before, or began anew |
//! | [`odometry`] | whether the wheels turn as told, by their encoders |
//! | [`stop_monitor`] | whether the robot comes to rest when told, and what else it is told |
//! | [`robot_health`] | these together: what the robot says of itself, held against what it was told |
//! | [`streams`] | whether what the robot streams comes, and often enough |
//! | [`telemetry`] | batteries, infrared and the rest, in the units of the topics |
//! | [`backoff`] | pauses between attempts |
//! | `writers` | whose commands and orders are obeyed |
//! | [`shell`] | wires them to the topics |

pub mod backoff;
pub mod drive;
pub mod failsafe;
pub mod latency_monitor;
pub mod odometry;
pub mod presence;
pub mod replay;
pub mod restart;
pub mod robot_health;
pub mod shell;
pub mod step;
pub mod stop_monitor;
pub mod streams;
pub mod telemetry;
pub mod transport;
mod writers;
