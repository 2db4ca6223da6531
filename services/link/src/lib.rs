//! The link: messages of a robot in, samples out, commands to it, and the one place that stops it. A [`common::driver::Driver`] speaks
//! the protocol of its kind of robot.
//!
//! | module | holds |
//! |---|---|
//! | [`drivers`] | THE table of drivers |
//! | [`step`] | the pure step of the link: bytes and commands in, samples and bytes out |
//! | [`failsafe`] | THE table of causes for which the link slows or stops the robot or ends the mission; in `failsafe/` their monitors |
//! | [`transport`] | datagrams, a connection or a serial line |
//! | [`backoff`] | pauses between attempts |
//! | [`stage`] | the link as a stage: the entries of a recording, and the samples that it publishes |
//! | [`shell`] | the process of the link: the wire and the topics that it reads |
//! | [`stop_guard`] | the process that stops a moving robot when the link's process ended |

pub mod backoff;
mod clock_rate;
pub mod drivers;
pub mod failsafe;
mod polls;
pub mod shell;
mod speed_trim;
pub mod stage;
pub mod step;
pub mod stop_guard;
pub mod transport;
mod wheel_speeds;
