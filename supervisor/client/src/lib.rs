#![doc = include_str!("../README.md")]

pub use common::{self, VERSION, bus, domain, follower, topics};
pub use robot_state::{self, Feed, RobotState};
