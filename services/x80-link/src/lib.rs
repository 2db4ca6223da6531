//! The X80 link: frames in, samples out, commands to the robot, and the one place that stops it.
//!
//! | module | holds |
//! |---|---|
//! | [`step`] | the pure step of the link: bytes and commands in, samples and bytes out |
//! | [`drive`] | the wheels: counts of motor frames in, timed commands out |
//! | [`failsafe`] | THE table of causes for which the link slows or stops the robot or ends the mission; in `failsafe/` their monitors |
//! | [`transport`] | datagrams, a connection or a serial line |
//! | `rangers` | the readings of a tick that go into the map |
//! | [`telemetry`] | batteries and the other sensors, in the units of the topics |
//! | [`backoff`] | pauses between attempts |
//! | [`stage`] | the link as a stage: the entries of a recording, and the samples that it publishes |
//! | [`shell`] | the process of the link: the wire and the topics that it reads |
//! | [`stop_guard`] | the process that stops a moving robot when the link's process ended |

pub mod backoff;
pub mod drive;
pub mod failsafe;
mod rangers;
pub mod shell;
mod speed_trim;
pub mod stage;
pub mod step;
pub mod stop_guard;
pub mod telemetry;
pub mod transport;
