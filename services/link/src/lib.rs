//! Link to the robot: turns messages into samples, sends commands, and alone stops the robot.
//!
//! [`drivers`] selects a [`common::driver::Base`] for the robot's protocol and a
//! [`common::driver::Driver`] for each sensor with its own wire. `sensors` merges their readings.
//! [`failsafe`] holds the causes that slow or stop the robot or end the mission. [`step`] is pure,
//! [`stage`] records and publishes it, [`shell`] is the process, and [`transport`] its wire.
//! [`stop_guard`] is the process that stops a moving robot after the link ended.

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
#[cfg(test)]
mod testing;
pub mod transport;
mod wheel_speeds;
pub mod wire_owner;
