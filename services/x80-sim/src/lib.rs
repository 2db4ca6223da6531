//! Simulated X80: the other end of the wire. The stages only see its bytes.
//!
//! Each module depends only on those before it in this list:
//!
//! `world`, `body`, [`wheel_errors`], `motor`, `sonar`, `infrared`, `laser`, `sensors`,
//! `json_words`, `arduino_words`, `rplidar`, `noise`, [`robot`], `radio`, `saved_state`,
//! `shell`.
//!
//! Only `shell` and its transports use sockets and clocks:
//!
//! ```
//! use common::{mission::Mission, wire::{Addressing, Command, Decoder}};
//! use x80_sim::robot::{Heard, Robot};
//!
//! let mission = Mission::parse("target = [3, 0]", "m.toml").unwrap();
//! let mut robot = Robot::new(&mission);
//! let mut bytes = Vec::new();
//! // Forward is negative on channel 0.
//! Command::velocity([Some(-400), Some(400)], 250).encode(Addressing::Numbered, &mut bytes);
//! let mut decoder = Decoder::default();
//! decoder.push(&bytes);
//! let mut replies = Vec::new();
//! let frame = decoder.next_frame().unwrap();
//! assert_eq!(robot.on_frame(&frame, &mut replies), Heard::Motion);
//! robot.advance_to_next_tick();
//! assert!(robot.ground_truth().x > 0.0);
//! ```

#![allow(unreachable_pub)]

mod arduino_words;
mod body;
mod car;
mod drivetrain;
mod error;
mod gyro;
mod infrared;
mod json_words;
mod laser;
mod motor;
mod noise;
mod people;
mod radio;
pub mod robot;
mod rplidar;
mod saved_state;
mod sensors;
mod shell;
mod silence;
mod sonar;
mod streams;
#[cfg(test)]
mod testing;
mod transport;
pub mod wheel_errors;
mod world;

pub use error::SimError;
pub use shell::{InMemory, SimOptions, run};
pub use transport::Transport;
