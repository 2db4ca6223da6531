//! How late processes run.

use std::time::Duration;

#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Load {
    /// Mean time from a wakeup to the turn.
    pub latency: Duration,
    /// Time of a turn.
    pub work: Duration,
    /// Share of turns that wait for a processor, and the mean wait.
    pub starved: (f64, Duration),
}

impl Load {
    /// Processes run at once.
    pub const NONE: Self = Self {
        latency: Duration::ZERO,
        work: Duration::from_micros(20),
        starved: (0.0, Duration::ZERO),
    };
    /// An idle machine of two cores.
    pub const IDLE: Self =
        Self { latency: Duration::from_micros(60), work: Duration::from_micros(200), ..Self::NONE };
    /// A machine that compiles beside the robot.
    pub const BUSY: Self = Self {
        latency: Duration::from_micros(500),
        work: Duration::from_micros(400),
        starved: (0.05, Duration::from_millis(8)),
    };
    /// A machine with dozens of busy processes for each core.
    pub const OVERLOADED: Self = Self {
        latency: Duration::from_millis(3),
        work: Duration::from_millis(1),
        starved: (0.2, Duration::from_millis(40)),
    };
    /// A machine on which processes wait for a processor for longer than a stage's deadline.
    pub const STARVED: Self =
        Self { starved: (0.1, Duration::from_millis(300)), ..Self::OVERLOADED };
}
