//! THE table of drivers.

use arduino_driver::Arduino;
use common::{
    address::Address,
    driver::{Base, Driver},
    mission::{Mission, Protocol},
};
use json_driver::Json;
use ros2_driver::Ros2;
use x80_driver::X80;

use crate::transport::BAUD;

/// A sensor with a wire of its own.
#[derive(Debug)]
pub struct SensorWire {
    pub address: Address,
    pub baud: u32,
    pub driver: Box<dyn Driver>,
}

/// The driver of what moves the robot of `mission`, and the baud rate of its serial line.
pub fn base(mission: &Mission) -> (Box<dyn Base>, u32) {
    match mission.robot.protocol() {
        Protocol::X80 => (Box::new(X80::new(mission)), BAUD),
        Protocol::Json => (Box::new(Json::new(mission)), BAUD),
        Protocol::Arduino => (Box::new(Arduino::new(mission)), mission.robot.arduino.baud),
        Protocol::Ros2 => (Box::new(Ros2::new(mission)), BAUD),
    }
}

/// The sensors of `mission` with wires of their own, of which no mission can name one yet. Events and effects number them in this order.
pub const fn sensors(_: &Mission) -> Vec<SensorWire> {
    Vec::new()
}
