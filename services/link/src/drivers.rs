//! THE table of drivers.

use arduino_driver::Arduino;
use common::{
    driver::Driver,
    mission::{Mission, Protocol},
};
use json_driver::Json;
use ros2_driver::Ros2;
use x80_driver::X80;

pub fn of(mission: &Mission) -> Box<dyn Driver> {
    match mission.robot.protocol() {
        Protocol::X80 => Box::new(X80::new(mission)),
        Protocol::Json => Box::new(Json::new(mission)),
        Protocol::Arduino => Box::new(Arduino::new(mission)),
        Protocol::Ros2 => Box::new(Ros2::new(mission)),
    }
}
