//! Messages about a robot that a command waits for, one each time.

use common::{domain::RobotName, follower::Event};

use super::output::write_stderr;

#[derive(Default)]
pub struct Waiting {
    connected: bool,
    reported: bool,
}

impl Waiting {
    /// Say where the robot is, if an `event` of its follower changes that.
    pub fn tell<Topics>(&mut self, event: &Event<'_, Topics>, robot: &RobotName) {
        match event {
            Event::Connected => (self.connected, self.reported) = (true, false),
            Event::Disconnected => {
                self.connected = false;
                self.report(robot, ENDED);
            }
            Event::Nothing if !self.connected => self.report(robot, NOT_RUNNING),
            Event::Nothing | Event::Samples(_) => {}
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
