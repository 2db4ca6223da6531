//! The link: messages of a robot in, samples out, commands to it, and the one place that stops it. A [`common::driver::Driver`] from the
//! table [`drivers`] speaks the protocol of its kind of robot. [`failsafe`] is THE table of causes for which the link slows or stops the
//! robot or ends the mission. [`step`] is pure, [`stage`] records and publishes it, [`shell`] is the process, [`transport`] its wire, and
//! [`stop_guard`] the process that stops a moving robot when the link ended.

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
