//! Table of drivers.

use arduino_driver::Arduino;
use common::{
    address::Address,
    driver::{Base, Driver},
    mission::{Mission, Protocol, Rplidar, Sensor},
};
use json_driver::Json;
use ros2_driver::Ros2;
use x80_driver::X80;

use crate::transport::{BAUD, Line};

#[derive(Debug)]
pub struct SensorWire {
    /// None for the simulated robot's wire, which also receives the sensor's requests.
    pub address: Option<Address<String>>,
    pub line: Line,
    pub driver: Box<dyn Driver>,
}

pub fn base(mission: &Mission) -> (Box<dyn Base>, u32) {
    match mission.robot.protocol() {
        Protocol::X80 => (Box::new(X80::new(mission)), BAUD),
        Protocol::Json => (Box::new(Json::new(mission)), BAUD),
        Protocol::Arduino => (Box::new(Arduino::new(mission)), mission.robot.arduino.baud),
        Protocol::Ros2 => (Box::new(Ros2::new(mission)), BAUD),
    }
}

/// Returns the sensors with their own wires, in the order of their numbers in events and effects.
pub fn sensors(mission: &Mission) -> Vec<SensorWire> {
    let wire = |(row, sensor, product): (usize, Sensor, Rplidar)| SensorWire {
        address: mission.robot.sensors.get(row).and_then(|row| row.address.as_ref()?.parse().ok()),
        line: Line { baud: product.baud, lowers_dtr: product.stands_by_dtr },
        driver: Box::new(rplidar_driver::Rplidar::new(row, sensor, product)),
    };
    mission.rplidars().into_iter().map(wire).collect()
}
