//! The monitor of the robot's streams: whether their frames come, and often enough. Silence is measured by the machine's clock, like
//! that of [`super::presence`], and intervals by mission time.

use std::{collections::VecDeque, time::Duration};

use common::{
    clock::MissionTime,
    mission::Mission,
    samples::{Cause, RangeReading, RangeStatus},
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

/// The newest valid reading of a sensor.
#[derive(Clone, Debug)]
struct Newest {
    row: u8,
    name: String,
    /// When it came by the machine's clock.
    ns: u64,
}

/// The streams of one robot.
#[derive(Clone, Debug)]
pub struct Streams {
    limit: Duration,
    silence: Silence,
    sensing: bool,
    /// The sensors that the mission uses.
    sensors: Vec<Newest>,
    found_ns: u64,
    motor_ns: u64,
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

    /// A sensor without a valid reading.
    fn silent_sensor(&self, now_ns: u64) -> Option<&Newest> {
        // A robot that was just found must send a new reading first. Older readings do not show the obstacles that are ahead now.
        let is_silent = |sensor: &&Newest| self.silence.is_over(sensor.ns, now_ns);
        self.sensors.iter().filter(|_| self.sensing).find(is_silent)
    }

    /// Whether the next request for the streams is due. The pauses between requests grow.
    pub fn wants_request(&mut self, now_ns: u64) -> bool {
        if self.motor_frames(now_ns) == Motor::Regular && self.silent_sensor(now_ns).is_none() {
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
        let used = (0..).zip(mission.sensor_table()).filter(|(_, sensor)| sensor.used);
        Self {
            limit: Duration::from_secs_f64(mission.robot.command_limit_s),
            silence: Silence::new(mission),
            sensing: mission.sensing,
            sensors: used.map(|(row, sensor)| Newest { row, name: sensor.name, ns: 0 }).collect(),
            found_ns: 0,
            motor_ns: 0,
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
                for sensor in &mut self.sensors {
                    let is_valid = |reading: &&RangeReading| {
                        reading.sensor == sensor.row && reading.status() != RangeStatus::Invalid
                    };
                    if readings.iter().any(|reading| is_valid(&reading)) {
                        sensor.ns = now.machine_ns;
                    }
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
            Cause::RangeSilent => self.silent_sensor(now.machine_ns).is_some(),
            Cause::FramesSilent => self.motor_frames(now.machine_ns) == Motor::Silent,
            _ => matches!(self.motor_frames(now.machine_ns), Motor::Slow(_)),
        };
        holds.into()
    }

    fn explain(&self, cause: Cause, now: Moment) -> Option<String> {
        match (cause, self.motor_frames(now.machine_ns)) {
            (Cause::RangeSilent, _) => self.silent_sensor(now.machine_ns).map(|sensor| {
                format!(
                    "the sensor {} gives no valid reading: check it, or leave it out of robot.sensor or of sensors",
                    sensor.name
                )
            }),
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
