//! Whether what the robot streams comes, and often enough. Silence is timed by the machine's clock as that of the robot
//! is ([`crate::presence`]), intervals by mission time.

use std::{collections::VecDeque, time::Duration};

use common::{clock::MissionTime, mission::Mission};

use crate::backoff::Backoff;

/// Intervals that are looked at: the robot is slow when all but the two shortest are too long, which those of a radio
/// that is out half of the time are not.
const INTERVALS: usize = 9;
const SHORT_ONES: usize = 2;
/// Between the first two requests for streams that do not come.
const FIRST_PAUSE: Duration = Duration::from_secs(1);
/// Between requests at most.
const LONGEST_PAUSE: Duration = Duration::from_secs(8);

/// How the motor frames come.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Motor {
    /// Often enough.
    #[default]
    Regular,
    /// The robot answers, but none comes.
    Silent,
    /// So many a second, which is fewer than commands last for.
    Slow(f64),
}

/// The streams of one robot.
#[derive(Clone, Debug)]
pub struct Streams {
    limit: Duration,
    sensing: bool,
    found_ns: u64,
    motor_ns: u64,
    range_ns: u64,
    newest: Option<MissionTime>,
    intervals: VecDeque<Duration>,
    requests: Backoff,
}

impl Streams {
    /// Of the robot of `mission`, which was not heard yet.
    #[must_use]
    pub fn new(mission: &Mission) -> Self {
        Self {
            limit: Duration::from_secs_f64(mission.robot.command_limit_s),
            sensing: mission.sensing,
            found_ns: 0,
            motor_ns: 0,
            range_ns: 0,
            newest: None,
            intervals: VecDeque::new(),
            requests: Backoff::new(FIRST_PAUSE, LONGEST_PAUSE),
        }
    }

    /// The robot answers since `now_ns`; it was asked for its streams.
    pub fn found(&mut self, now_ns: u64) {
        self.found_ns = now_ns;
        self.newest = None;
        self.intervals.clear();
        self.requests.reset();
        self.requests.attempted(now_ns);
    }

    /// A motor frame came.
    pub fn motor(&mut self, now: MissionTime, now_ns: u64) {
        self.motor_ns = now_ns;
        if let Some(before) = self.newest.replace(now) {
            self.intervals.push_back(now.since(before));
        }
        if self.intervals.len() > INTERVALS {
            self.intervals.pop_front();
        }
    }

    /// The front sonar's byte came, and is a reading. 255 is: nothing is in range.
    pub const fn range(&mut self, now_ns: u64) {
        self.range_ns = now_ns;
    }

    /// How the motor frames of a robot that answers come; `silence` is how long none may.
    #[must_use]
    pub fn motor_frames(&self, now_ns: u64, silence: Duration) -> Motor {
        let since = self.motor_ns.max(self.found_ns);
        if now_ns.saturating_sub(since) >= silence.as_nanos() as u64 {
            return Motor::Silent;
        }
        let mut sorted: Vec<_> = self.intervals.iter().copied().collect();
        sorted.sort_unstable();
        match sorted.get(SHORT_ONES) {
            Some(&interval) if sorted.len() == INTERVALS && interval > self.limit => {
                Motor::Slow(1.0 / interval.as_secs_f64())
            }
            _ => Motor::Regular,
        }
    }

    /// Whether a mission that senses gets no readings of its front sonar; `silence` is how long none may come.
    #[must_use]
    pub fn range_is_silent(&self, now_ns: u64, silence: Duration) -> bool {
        // One that was found a moment ago must be heard first: what stood ahead before says nothing.
        self.sensing && now_ns.saturating_sub(self.range_ns) >= silence.as_nanos() as u64
    }

    /// Whether to ask for the streams again, now. The pauses between requests grow.
    pub fn wants_request(&mut self, now_ns: u64, silence: Duration) -> bool {
        let well = self.motor_frames(now_ns, silence) == Motor::Regular
            && !self.range_is_silent(now_ns, silence);
        if well {
            // A robot that streams only while it is asked is asked no faster.
            return false;
        }
        let due = self.requests.is_due(now_ns);
        if due {
            self.requests.attempted(now_ns);
        }
        due
    }
}

#[cfg(test)]
mod tests;
