//! Messages about a robot that a command waits for, one each time.

use common::domain::RobotName;

use super::output::write_stderr;

#[derive(Default)]
pub struct Waiting {
    connected: bool,
    reported: bool,
}

impl Waiting {
    pub const fn on_connected(&mut self) {
        (self.connected, self.reported) = (true, false);
    }

    pub fn on_disconnected(&mut self, robot: &RobotName) {
        self.connected = false;
        self.report(robot, ENDED);
    }

    pub fn on_nothing(&mut self, robot: &RobotName) {
        if !self.connected {
            self.report(robot, NOT_RUNNING);
        }
    }

    fn report(&mut self, robot: &RobotName, state: &str) {
        if !std::mem::replace(&mut self.reported, true) {
            write_stderr(&format!("firsthand: robot {robot} {state}\n"));
        }
    }
}

/// The robot was not there yet.
pub const NOT_RUNNING: &str = "is not running here; waiting for it";
/// The robot was there.
pub const ENDED: &str = "has ended its run; waiting for it";
