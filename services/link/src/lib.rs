//! The link: messages of a robot in, samples out, commands to it, and the one place that stops it. A [`common::driver::Driver`] speaks
//! the protocol of its kind of robot.
//! [`drivers`] is THE table of drivers, and [`failsafe`] THE table of causes for which the link slows or stops the robot or ends the
//! mission, with their monitors. [`step`] is pure: bytes and commands to samples and bytes. [`stage`] records and publishes it, and
//! [`shell`] is the process, which owns a wire ([`transport`]). [`stop_guard`] is the process that stops a moving robot when the link
//! ended; [`backoff`] has the pauses between attempts.

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
