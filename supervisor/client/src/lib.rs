#![doc = include_str!("../README.md")]
//!
//! # Example
//!
//! This program follows a robot through restarts and prints its pose:
//!
//! ```no_run
//! use std::time::Duration;
//!
//! use firsthand_client::{
//!     Feed, RobotState,
//!     domain::Domain,
//!     follower::{Event, Follower},
//!     robot_state::TOPICS,
//!     topics,
//! };
//!
//! fn main() -> Result<(), Box<dyn std::error::Error>> {
//!     let domain = Domain::of("x80".parse()?);
//!     let mut robot =
//!         Follower::new(domain, "my-logger", &topics::LINK, |bus| Feed::open(bus, TOPICS));
//!     let mut state = RobotState::default();
//!     loop {
//!         match robot.wait(Duration::from_secs(1))? {
//!             Event::Connected => state = RobotState::default(),
//!             Event::Disconnected | Event::Nothing => {}
//!             Event::Samples(feed) => {
//!                 feed.read(&mut |sample| {
//!                     state.apply(&sample);
//!                 })?;
//!                 if let Some(pose) = &state.pose {
//!                     println!("{:.3} m, {:.3} m", pose.x_m, pose.y_m);
//!                 }
//!             }
//!         }
//!     }
//! }
//! ```
//!
//! # Contents
//!
//! - [`domain::Domain`]: the robot's name, directories and shared memory on this machine.
//! - [`follower::Follower`]: joins the bus of each run and reports when the robot comes and goes.
//! - [`topics`]: the table of topics, with payload, writer and rate.
//! - [`Feed`]: reads the samples of many topics from a bus.
//! - [`RobotState`]: the newest samples as one value.
//! - [`bus`]: readers, writers and wakeups.
//! - [`common`], [`robot_state`]: the complete crates behind these names.
//! - [`VERSION`]: the version of this library.
//!
//! # Units and frames
//!
//! Most field names end in their unit: `x_m` is metres, `v_m_s` m/s, `heading_rad` radians,
//! `stamp_ns` nanoseconds. Poses and maps are in the mission frame. Headings are counter-clockwise
//! from x and not wrapped. Stamps count from the start of the mission.
//!
//! # Errors
//!
//! - [`domain::RobotNameError`]: the text cannot name a robot.
//! - [`bus::BusError`]: the robot runs another version, a topic has another payload or no free
//!   reader place, or the connection to a writer breaks. Each message names its remedy.
//!
//! While the robot is absent, [`follower::Follower::wait`] succeeds with
//! [`follower::Event::Nothing`].

pub use common::{self, VERSION, bus, domain, follower, topics};
pub use robot_state::{self, Feed, RobotState};
