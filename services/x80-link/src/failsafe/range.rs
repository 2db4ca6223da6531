//! The range monitor: whether the front sonar's reading changes as the motion says it must.
//!
//! An echo of something that stands comes nearer as the robot drives, and another thing answers when it turns. A reading that stays
//! the same to the centimetre meanwhile is stuck: at one value, or at the last one. In 240 recorded missions, 150 of them with
//! measured realism, [`READINGS`] and more equal readings never came with more than 0.53 of the motion that is needed here.
//!
//! 255 means that nothing was heard. In the open, and before smooth walls that stand askew, it stays for long, so it is not judged.

use std::time::Duration;

use common::{
    mission::Mission,
    samples::{Cause, RangeReading},
    wire::counts_between,
};

use super::monitor::{Condition, Counts, Moment, Monitor, Observation};

/// Readings are equal if they differ from the first by no more than this, centimetres.
const EQUAL_CM: u16 = 1;
/// The least number of equal readings, 1.1 s at 7 Hz: fewer may be alike by chance.
const READINGS: u32 = 8;
/// The way after which the reading must have changed, metres, or the turn, radians. Parts of both add up.
const WAY_M: f64 = 0.4;
const TURN_RAD: f64 = std::f64::consts::FRAC_PI_2;
/// The readings that are judged, centimetres. Those at the ends of the scale are limits, not distances.
const JUDGED_CM: std::ops::RangeInclusive<u16> = 5..=249;
/// The cause clears after so long with readings that change.
pub(crate) const CHANGES: Duration = Duration::from_secs(2);

/// Equal readings in a row.
#[derive(Clone, Copy, Debug, Default)]
struct Equal {
    first_cm: u16,
    readings: u32,
    way_m: f64,
    turn_rad: f64,
}

impl Equal {
    fn are_implausible(&self) -> bool {
        self.readings >= READINGS && self.way_m / WAY_M + self.turn_rad / TURN_RAD >= 1.0
    }
}

/// The front sonar of one robot.
#[derive(Clone, Debug)]
pub struct Range {
    sensing: bool,
    front: u8,
    metres_per_count: f64,
    /// None for a car, whose second encoder is that of the steering.
    track_m: Option<f64>,
    counts: Option<[u16; 2]>,
    equal: Equal,
    implausible: Option<(Equal, Moment)>,
}

impl Range {
    fn take(&mut self, cm: u16, now: Moment) {
        let same = cm.abs_diff(self.equal.first_cm) <= EQUAL_CM;
        if JUDGED_CM.contains(&cm) && same {
            self.equal.readings += 1;
        } else {
            self.equal = Equal { first_cm: cm, readings: 1, ..Equal::default() };
        }
        if self.equal.are_implausible() {
            self.implausible = Some((self.equal, now));
        }
    }

    fn turn(&mut self, counts: [u16; 2]) {
        let Some(before) = self.counts.replace(counts) else {
            return;
        };
        let [left, right] = [0, 1].map(|wheel| {
            f64::from(counts_between(before[wheel], counts[wheel])) * self.metres_per_count
        });
        match self.track_m {
            Some(track_m) => {
                self.equal.way_m += (left + right).abs() / 2.0;
                self.equal.turn_rad += (right - left).abs() / track_m;
            }
            None => self.equal.way_m += left.abs(),
        }
    }
}

/// The reading of the sensor of row `front`.
pub(super) fn front(readings: &[RangeReading], front: u8) -> Option<&RangeReading> {
    readings.iter().find(|reading| reading.sensor == front)
}

impl Monitor for Range {
    fn new(mission: &Mission) -> Self {
        let body = mission.body();
        Self {
            sensing: mission.sensing,
            front: mission.front_row() as u8,
            metres_per_count: body.metres_per_count(),
            track_m: body.steering.is_none().then_some(body.track_m),
            counts: None,
            equal: Equal::default(),
            implausible: None,
        }
    }

    fn observe(&mut self, what: &Observation<'_>, now: Moment) {
        match *what {
            Observation::Readings(readings) => {
                if let Some(front) = front(readings, self.front) {
                    self.take(front.raw, now);
                }
            }
            Observation::Motor(counts, Counts::Follow) => self.turn(counts),
            Observation::Motor(..) => self.counts = None,
            Observation::Lost | Observation::Resumed => {
                (self.counts, self.equal, self.implausible) = (None, Equal::default(), None);
            }
            _ => {}
        }
    }

    fn condition(&self, _: Cause, now: Moment) -> Condition {
        match self.implausible {
            Some(_) if self.sensing && self.equal.are_implausible() => Condition::Holds,
            Some((_, at)) if self.sensing => Condition::OverFor(now.time.since(at.time)),
            _ => false.into(),
        }
    }

    fn explain(&self, _: Cause, _: Moment) -> Option<String> {
        let (Equal { first_cm, readings, way_m, turn_rad }, _) = self.implausible?;
        Some(format!(
            "the front sonar says {first_cm} cm in {readings} frames although the robot drove {way_m:.2} m and turned {:.0} degrees: check the sensor, then `firsthand stop` and `resume`",
            turn_rad.to_degrees()
        ))
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use common::clock::MissionTime;

    use super::*;

    /// The first tick at which a sonar with these readings is implausible, on a robot whose wheels turn so many metres a tick.
    fn implausible_at(wheels_m: [f64; 2], reading: impl Fn(u32) -> u16) -> Option<u32> {
        let mission = Mission::parse("target = [3, 0]", Path::new("test.toml")).unwrap();
        let mut monitor = Range::new(&mission);
        let per_count = mission.body().metres_per_count();
        (0..200).find(|&tick| {
            let time = MissionTime::from_seconds(f64::from(tick) / 7.0);
            let now = Moment { time, machine_ns: time.0 };
            let turned = wheels_m.map(|way| (way * f64::from(tick) / per_count).round() as i32);
            let counts = turned.map(|counts| counts.rem_euclid(32_768) as u16);
            monitor.observe(&Observation::Motor(counts, Counts::Follow), now);
            let beside = RangeReading { sensor: 1, raw: 77, ..RangeReading::default() };
            let front = RangeReading { raw: reading(tick), ..RangeReading::default() };
            monitor.observe(&Observation::Readings(&[beside, front]), now);
            monitor.condition(Cause::RangeImplausible, now) == Condition::Holds
        })
    }

    #[test]
    fn a_reading_that_stays_while_the_robot_drives_0_4_m_or_turns_by_a_right_angle_is_implausible()
    {
        // 0.05 m a tick: 0.4 m in 8 ticks. A turn of a right angle rolls each wheel 0.204 m.
        assert_eq!(implausible_at([0.05; 2], |_| 100), Some(8));
        assert_eq!(implausible_at([-0.02, 0.02], |tick| 100 + (tick % 2) as u16), Some(11));
        assert_eq!(implausible_at([0.1; 2], |_| 100), Some(7), "no fewer readings");
        let frozen_at = |tick: u32| if tick < 30 { 200 - 5 * tick as u16 } else { 55 };
        assert_eq!(implausible_at([0.05; 2], frozen_at), Some(37));
    }

    #[test]
    fn readings_of_a_robot_that_stands_that_change_or_that_are_no_distances_are_plausible() {
        assert_eq!(implausible_at([0.0; 2], |_| 100), None);
        assert_eq!(implausible_at([0.05; 2], |tick| 100 + 2 * (tick % 2) as u16), None);
        assert_eq!(implausible_at([0.05; 2], |_| 255), None);
        assert_eq!(implausible_at([0.05; 2], |_| 254), None);
        assert_eq!(implausible_at([0.05; 2], |tick| 90 - (tick / 8) as u16 * 2), None);
    }
}
