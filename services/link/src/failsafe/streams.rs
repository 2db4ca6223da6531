//! Stream monitor: checks that frames come often enough. Silence is by the machine's clock, as in
//! [`super::presence`], and intervals by mission time.
//!
//! Without one infrared ranger that looks aside or into a sonar's cone, the robot drives at half
//! speed. The sonar covers the cone, and unscanned ground is looked at before it is driven on.

use std::time::Duration;

use common::{
    clock::MissionTime,
    mission::{Mission, Sensor, SensorKind},
    samples::{Cause, RangeReading, RangeStatus},
};

use super::{
    monitor::{Condition, Moment, Monitor, Observation},
    presence::Silence,
};
use crate::backoff::Backoff;

/// Judged intervals. All but the `SHORT_ONES` shortest must be too long; a radio in outage half the
/// time gives more short ones.
pub(crate) const INTERVALS: usize = 9;
pub(crate) const SHORT_ONES: usize = 2;
const FIRST_PAUSE: Duration = Duration::from_secs(1);
const LONGEST_PAUSE: Duration = Duration::from_secs(8);

#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Motor {
    Regular,
    Silent,
    /// Frames per second, too few to keep a command alive.
    Slow(f64),
}

/// Bearing from the front sonar within which a sensor looks ahead, degrees.
const AHEAD_DEG: f64 = 60.0;

#[derive(Clone, Debug)]
struct Newest {
    row: u8,
    name: String,
    is_covered: bool,
    /// Machine time of the newest valid reading.
    ns: u64,
}

#[derive(Clone, Debug)]
pub struct Streams {
    limit: Duration,
    silence: Silence,
    sensing: bool,
    sensors: Vec<Newest>,
    found_ns: u64,
    motor_ns: u64,
    newest: Option<MissionTime>,
    /// Oldest first; None before a robot just found has sent so many.
    intervals: [Option<Duration>; INTERVALS],
    requests: Backoff,
}

impl Streams {
    fn motor(&mut self, now: MissionTime, now_ns: u64) {
        self.motor_ns = now_ns;
        if let Some(before) = self.newest.replace(now) {
            self.intervals.rotate_left(1);
            self.intervals[INTERVALS - 1] = Some(now.since(before));
        }
    }

    pub fn motor_frames(&self, now_ns: u64) -> Motor {
        if self.silence.is_over(self.motor_ns.max(self.found_ns), now_ns) {
            return Motor::Silent;
        }
        let mut sorted = self.intervals;
        sorted.sort_unstable();
        const { assert!(SHORT_ONES < INTERVALS) };
        match (sorted[0], sorted[SHORT_ONES]) {
            (Some(_), Some(interval)) if interval > self.limit => {
                Motor::Slow(1.0 / interval.as_secs_f64())
            }
            _ => Motor::Regular,
        }
    }

    fn silent_sensors(&self, now_ns: u64) -> Vec<&Newest> {
        // A robot just found must send a new reading; older ones may be outdated.
        let is_silent = |sensor: &&Newest| self.sensing && self.silence.is_over(sensor.ns, now_ns);
        self.sensors.iter().filter(is_silent).collect()
    }

    fn silent(&self, now_ns: u64) -> Option<Cause> {
        match self.silent_sensors(now_ns)[..] {
            [] => None,
            [one] if one.is_covered => Some(Cause::InfraredSilent),
            _ => Some(Cause::RangeSilent),
        }
    }

    /// Returns whether a request is due, at growing pauses.
    pub fn wants_request(&mut self, now_ns: u64) -> bool {
        let ranges_come = self.silent(now_ns) != Some(Cause::RangeSilent);
        if self.motor_frames(now_ns) == Motor::Regular && ranges_come {
            // A robot that sends on request is asked no more often.
            return false;
        }
        let due = self.requests.is_due(now_ns);
        if due {
            self.requests.attempted(now_ns);
        }
        due
    }
}

/// Returns whether a robot without `sensor` may go on: an infrared ranger that looks aside, back,
/// or into a used sonar's cone.
fn is_covered(sensor: &Sensor, table: &[Sensor], front_deg: f64) -> bool {
    let from = |bearing_deg: f64| {
        ((sensor.bearing_deg() - bearing_deg + 180.0).rem_euclid(360.0) - 180.0).abs()
    };
    let covers = |cone: &Sensor| {
        let is_cone = cone.used && cone.kind == SensorKind::Cone;
        is_cone && from(cone.bearing_deg()) <= cone.field_of_view_deg / 2.0
    };
    sensor.kind == SensorKind::Ray && (from(front_deg) > AHEAD_DEG || table.iter().any(covers))
}

impl Monitor for Streams {
    fn new(mission: &Mission) -> Self {
        let table = mission.sensor_table();
        let front_deg = mission.front_sonar().bearing_deg();
        let used = (0..).zip(&table).filter(|(_, sensor)| sensor.used);
        let sensors = used.map(|(row, sensor)| Newest {
            row,
            name: sensor.name.clone(),
            is_covered: is_covered(sensor, &table, front_deg),
            ns: 0,
        });
        Self {
            limit: Duration::from_secs_f64(mission.robot.command_limit_s),
            silence: Silence::new(mission),
            sensing: mission.sensing,
            sensors: sensors.collect(),
            found_ns: 0,
            motor_ns: 0,
            newest: None,
            intervals: [None; INTERVALS],
            requests: Backoff::new(FIRST_PAUSE, LONGEST_PAUSE),
        }
    }

    fn observe(&mut self, what: &Observation<'_>, now: Moment) {
        match *what {
            Observation::Pace(pace) => self.silence.set_pace(pace),
            Observation::Motor(..) => self.motor(now.time, now.machine_ns),
            Observation::Readings(readings) => {
                for sensor in &mut self.sensors {
                    let is_valid = |reading: &RangeReading| {
                        reading.sensor == sensor.row && reading.status() != RangeStatus::Invalid
                    };
                    if readings.iter().any(is_valid) {
                        sensor.ns = now.machine_ns;
                    }
                }
            }
            Observation::Found { .. } => {
                self.found_ns = now.machine_ns;
                self.newest = None;
                self.intervals = [None; INTERVALS];
                self.requests.reset();
                self.requests.attempted(now.machine_ns);
            }
            _ => {}
        }
    }

    fn condition(&self, cause: Cause, now: Moment) -> Condition {
        let holds = match cause {
            Cause::RangeSilent | Cause::InfraredSilent => {
                self.silent(now.machine_ns) == Some(cause)
            }
            Cause::FramesSilent => self.motor_frames(now.machine_ns) == Motor::Silent,
            _ => matches!(self.motor_frames(now.machine_ns), Motor::Slow(_)),
        };
        holds.into()
    }

    fn explain(&self, cause: Cause, now: Moment) -> Option<String> {
        match (cause, self.motor_frames(now.machine_ns)) {
            (Cause::RangeSilent | Cause::InfraredSilent, _) => {
                let silent = self.silent_sensors(now.machine_ns).into_iter();
                let names: Vec<_> = silent.map(|sensor| &*sensor.name).collect();
                let goes_on = match cause {
                    Cause::InfraredSilent => "the robot continues without it; ",
                    _ => "",
                };
                Some(format!(
                    "no valid reading from {}; {goes_on}check the sensor, or remove it from robot.sensor or from sensors",
                    names.join(", ")
                ))
            }
            (Cause::FramesSilent, _) => {
                Some("the robot answers but sends no motor frames; the link requests them. Over UDP a robot sends frames to the last host that commanded it; check for another host".to_owned())
            }
            (_, Motor::Slow(hz)) => Some(format!(
                "the robot sends {hz:.1} motor frames a second, one in {:.2} s, but a command lasts {:.2} s; let it send faster, raise robot.command_limit_s, or check whether another host takes frames over UDP",
                1.0 / hz,
                self.limit.as_secs_f64()
            )),
            _ => None,
        }
    }
}

#[cfg(test)]
mod tests;
