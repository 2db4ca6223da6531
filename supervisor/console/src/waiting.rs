//! Messages about an absent robot, one per change.

use common::{domain::RobotName, follower::Event};

use super::output::say;

#[derive(Default)]
pub struct Waiting {
    connected: bool,
    reported: bool,
}

impl Waiting {
    /// Reports the robot's state if `event` changes it.
    pub fn tell<Topics>(&mut self, event: &Event<'_, Topics>, robot: &RobotName) {
        match event {
            Event::Connected => (self.connected, self.reported) = (true, false),
            Event::Disconnected => {
                self.connected = false;
                self.report(robot, ENDED);
            }
            Event::Nothing if !self.connected => self.report(robot, NOT_RUNNING),
            _ => {}
        }
    }

    fn report(&mut self, robot: &RobotName, state: &str) {
        if !std::mem::replace(&mut self.reported, true) {
            say(format_args!("robot {robot} {state}"));
        }
    }
}

/// Message before the first connection.
pub const NOT_RUNNING: &str = "is not running here; waiting for it";
/// Message after a lost connection.
pub const ENDED: &str = "has ended its run; waiting for it";
