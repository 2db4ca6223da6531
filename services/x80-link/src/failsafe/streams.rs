//! The monitor of the robot's streams: whether their frames come, and often enough. Silence is measured by the machine's clock, like
//! that of [`super::presence`], and intervals by mission time.

use std::{collections::VecDeque, time::Duration};

use common::{
    clock::MissionTime,
    mission::Mission,
    samples::{Cause, RangeStatus},
};

use super::{
    monitor::{Condition, Moment, Monitor, Observation},
    presence::Silence,
};
use crate::backoff::Backoff;

/// The robot is slow if all but the two shortest of so many intervals are too long. With a radio that is out half of the time, more
/// than two intervals are short enough.
const INTERVALS: usize = 9;
const SHORT_ONES: usize = 2;
/// The pause between the first two requests for streams that do not come.
const FIRST_PAUSE: Duration = Duration::from_secs(1);
/// The longest pause between requests.
const LONGEST_PAUSE: Duration = Duration::from_secs(8);

/// The rate of the motor frames.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Motor {
    /// They come often enough.
    #[default]
    Regular,
    /// No motor frame comes although the robot answers.
    Silent,
    /// Only so many come a second that a command expires before the next frame.
    Slow(f64),
}

/// The streams of one robot.
#[derive(Clone, Debug)]
pub struct Streams {
    limit: Duration,
    silence: Silence,
    sensing: bool,
    front: u8,
    found_ns: u64,
    motor_ns: u64,
    range_ns: u64,
    newest: Option<MissionTime>,
    intervals: VecDeque<Duration>,
    requests: Backoff,
}

impl Streams {
    fn motor(&mut self, now: MissionTime, now_ns: u64) {
        self.motor_ns = now_ns;
        if let Some(before) = self.newest.replace(now) {
            self.intervals.push_back(now.since(before));
        }
        if self.intervals.len() > INTERVALS {
            self.intervals.pop_front();
        }
    }

    /// The rate of the motor frames of a robot that answers.
    pub fn motor_frames(&self, now_ns: u64) -> Motor {
        let since = self.motor_ns.max(self.found_ns);
        if self.silence.is_over(since, now_ns) {
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

    fn range_is_silent(&self, now_ns: u64) -> bool {
        // A robot that was just found must send a new reading first. Older readings do not show the obstacles that are ahead now.
        self.sensing && self.silence.is_over(self.range_ns, now_ns)
    }

    /// Whether the next request for the streams is due. The pauses between requests grow.
    pub fn wants_request(&mut self, now_ns: u64) -> bool {
        if self.motor_frames(now_ns) == Motor::Regular && !self.range_is_silent(now_ns) {
            // A robot that sends frames only when it is asked is not asked more often.
            return false;
        }
        let due = self.requests.is_due(now_ns);
        if due {
            self.requests.attempted(now_ns);
        }
        due
    }
}

impl Monitor for Streams {
    fn new(mission: &Mission) -> Self {
        Self {
            limit: Duration::from_secs_f64(mission.robot.command_limit_s),
            silence: Silence::new(mission),
            sensing: mission.sensing,
            front: mission.front_row() as u8,
            found_ns: 0,
            motor_ns: 0,
            range_ns: 0,
            newest: None,
            intervals: VecDeque::new(),
            requests: Backoff::new(FIRST_PAUSE, LONGEST_PAUSE),
        }
    }

    fn observe(&mut self, what: &Observation<'_>, now: Moment) {
        match *what {
            Observation::Pace(pace) => self.silence.set_pace(pace),
            Observation::Motor(..) => self.motor(now.time, now.machine_ns),
            Observation::Readings(readings) => {
                let front = super::range::front(readings, self.front);
                if front.is_some_and(|reading| reading.status() != RangeStatus::Invalid) {
                    self.range_ns = now.machine_ns;
                }
            }
            Observation::Found { .. } => {
                self.found_ns = now.machine_ns;
                self.newest = None;
                self.intervals.clear();
                self.requests.reset();
                self.requests.attempted(now.machine_ns);
            }
            _ => {}
        }
    }

    fn condition(&self, cause: Cause, now: Moment) -> Condition {
        let holds = match cause {
            Cause::RangeSilent => self.range_is_silent(now.machine_ns),
            Cause::FramesSilent => self.motor_frames(now.machine_ns) == Motor::Silent,
            _ => matches!(self.motor_frames(now.machine_ns), Motor::Slow(_)),
        };
        holds.into()
    }

    fn explain(&self, cause: Cause, now: Moment) -> Option<String> {
        match (cause, self.motor_frames(now.machine_ns)) {
            (Cause::RangeSilent, _) => Some("the front sonar is missing or 0".to_owned()),
            (Cause::FramesSilent, _) => {
                Some("the robot answers and sends no motor frames; they are asked for".to_owned())
            }
            (_, Motor::Slow(hz)) => Some(format!(
                "the robot sends {hz:.1} motor frames a second, one in {:.2} s, and a command lasts {:.2} s: let it send faster, or raise robot.command_limit_s",
                1.0 / hz,
                self.limit.as_secs_f64()
            )),
            _ => None,
        }
    }
}

#[cfg(test)]
mod tests;
