//! The link: messages of a robot in, samples out, commands to it, and the one place that stops it. The table [`drivers`] gives it one
//! [`common::driver::Base`], which speaks the protocol of its kind of robot, and a [`common::driver::Driver`] for each sensor that has a wire
//! of its own; what they say of the surroundings meets in `sensors`. [`failsafe`] is THE table of causes for which the link slows or stops the
//! robot or ends the mission. [`step`] is pure, [`stage`] records and publishes it, [`shell`] is the process, [`transport`] its wire, and
//! [`stop_guard`] the process that stops a moving robot when the link ended.

pub mod backoff;
mod clock_rate;
pub mod drivers;
pub mod failsafe;
mod polls;
mod sensors;
pub mod shell;
mod speed_trim;
pub mod stage;
pub mod step;
pub mod stop_guard;
pub mod transport;
mod wheel_speeds;
pub mod wire_owner;
