//! The range monitor: whether readings change with motion as they must, and the front sonar hears what the infrared rangers see
//! ([`super::undetected_surface`]).
//!
//! A standing thing's echo comes nearer as the robot drives, and another thing answers when it turns: a reading that stays the same to
//! the centimetre is stuck. In 240 recorded missions, 150 with measured realism, [`READINGS`] and more equal readings never came with
//! more than 0.53 of the motion needed here. A sensor that looks aside reads the same along a wall, so only turns on the spot count for
//! it. Motion does not judge a reading of nothing, which stays long in the open, and before smooth slanted walls.

use std::{ops::RangeInclusive, time::Duration};

use common::{
    driver::counts::WheelCounts,
    mission::{Mission, Sensor, SensorKind},
    samples::{Cause, RangeReading, RangeStatus},
};

use super::{
    monitor::{Condition, Counts, Moment, Monitor, Observation},
    undetected_surface::UndetectedSurface,
};

/// Readings are equal within this, metres: a centimetre, and rounding.
const EQUAL_M: f64 = 0.0101;
/// Equal readings, 1.1 s at 7 Hz: fewer may be chance.
const READINGS: u32 = 8;
/// Way, metres, or turn, radians, that must change a reading. Fractions of both add up.
const WAY_M: f64 = 0.4;
const TURN_RAD: f64 = std::f64::consts::FRAC_PI_2;
/// Metres. The ends of a sensor's scale are limits, not distances.
const JUDGED_SONAR_M: RangeInclusive<f64> = 0.05..=2.49;
const JUDGED_INFRARED_M: RangeInclusive<f64> = 0.10..=0.70;
/// The wheels' mean way is less than this share of half their difference.
const ON_THE_SPOT: f64 = 0.25;
/// The cause clears after readings changed for so long.
pub(crate) const CHANGES: Duration = Duration::from_secs(2);

#[derive(Clone, Copy, Debug, Default)]
struct Equal {
    first_m: f64,
    readings: u32,
    way_m: f64,
    turn_rad: f64,
}

impl Equal {
    fn are_implausible(&self) -> bool {
        self.readings >= READINGS && self.way_m / WAY_M + self.turn_rad / TURN_RAD >= 1.0
    }
}

#[derive(Clone, Debug)]
struct Row {
    row: u8,
    name: String,
    looks_ahead: bool,
    judged_m: RangeInclusive<f64>,
    equal: Equal,
    implausible: Option<(Equal, Moment)>,
}

impl Row {
    fn of(row: usize, sensor: Sensor, front: usize) -> Self {
        Self {
            row: row as u8,
            name: sensor.name,
            looks_ahead: row == front,
            judged_m: match sensor.kind {
                SensorKind::Cone => JUDGED_SONAR_M,
                SensorKind::Ray => JUDGED_INFRARED_M,
                // The nearest of many beams may stay equal for long.
                SensorKind::Scan => 0.0..=0.0,
            },
            equal: Equal::default(),
            implausible: None,
        }
    }

    fn take(&mut self, reading: &RangeReading, now: Moment) {
        let range_m = reading.range_m;
        let is_same = (range_m - self.equal.first_m).abs() <= EQUAL_M;
        let is_judged =
            reading.status() == RangeStatus::Measured && self.judged_m.contains(&range_m);
        if is_judged && is_same {
            self.equal.readings += 1;
        } else {
            self.equal = Equal { first_m: range_m, readings: 1, ..Equal::default() };
        }
        if self.equal.are_implausible() {
            self.implausible = Some((self.equal, now));
        }
    }

    fn moved(&mut self, way_m: f64, turn_rad: f64, is_on_the_spot: bool) {
        if self.looks_ahead {
            self.equal.way_m += way_m;
        }
        if self.looks_ahead || is_on_the_spot {
            self.equal.turn_rad += turn_rad;
        }
    }

    fn condition(&self, now: Moment) -> Condition {
        match self.implausible {
            Some(_) if self.equal.are_implausible() => Condition::Holds,
            Some((_, at)) => Condition::OverFor(now.time.since(at.time)),
            None => false.into(),
        }
    }
}

#[derive(Clone, Debug)]
pub struct Range {
    sensing: bool,
    metres_per_count: f64,
    /// None for a car, whose second encoder is the steering's.
    track_m: Option<f64>,
    counts: Option<WheelCounts>,
    rows: Vec<Row>,
    undetected: Option<UndetectedSurface>,
}

impl Range {
    fn turn(&mut self, counts: WheelCounts) {
        let Some(before) = self.counts.replace(counts) else {
            return;
        };
        let [left, right] = counts.since(before).map(|counts| counts * self.metres_per_count);
        let (way_m, turn_m) = match self.track_m {
            Some(_) => ((left + right).abs() / 2.0, (right - left).abs() / 2.0),
            None => (left.abs(), 0.0),
        };
        let turn_rad = self.track_m.map_or(0.0, |track_m| 2.0 * turn_m / track_m);
        for row in &mut self.rows {
            row.moved(way_m, turn_rad, way_m < ON_THE_SPOT * turn_m);
        }
    }
}

impl Monitor for Range {
    fn new(mission: &Mission) -> Self {
        let (body, front) = (mission.body(), mission.front_row());
        let table = mission.sensor_table().into_iter().enumerate();
        Self {
            sensing: mission.sensing,
            metres_per_count: body.metres_per_count(),
            track_m: body.steering.is_none().then_some(body.track_m),
            counts: None,
            rows: table
                .filter(|(_, sensor)| sensor.used)
                .map(|(row, sensor)| Row::of(row, sensor, front))
                .collect(),
            undetected: UndetectedSurface::of(mission),
        }
    }

    fn observe(&mut self, what: &Observation<'_>, now: Moment) {
        match *what {
            Observation::Readings(readings) => {
                for row in &mut self.rows {
                    if let Some(reading) = readings.iter().find(|reading| reading.sensor == row.row)
                    {
                        row.take(reading, now);
                    }
                }
                if let Some(undetected) = &mut self.undetected {
                    undetected.take(readings);
                }
            }
            Observation::Motor(counts, Counts::Follow) => self.turn(counts),
            Observation::Motor(..) => self.counts = None,
            Observation::Lost | Observation::Resumed => {
                self.counts = None;
                for row in &mut self.rows {
                    (row.equal, row.implausible) = (Equal::default(), None);
                }
                if let Some(undetected) = &mut self.undetected {
                    undetected.reset();
                }
            }
            _ => {}
        }
    }

    fn condition(&self, _: Cause, now: Moment) -> Condition {
        if !self.sensing {
            return false.into();
        }
        if self.undetected.as_ref().is_some_and(UndetectedSurface::is_implausible) {
            return Condition::Holds;
        }
        let over_for = |row: &Row| match row.condition(now) {
            Condition::Holds => None,
            Condition::OverFor(over) => Some(over),
        };
        let least =
            self.rows.iter().try_fold(Duration::MAX, |least, row| Some(least.min(over_for(row)?)));
        least.map_or(Condition::Holds, Condition::OverFor)
    }

    fn explain(&self, _: Cause, now: Moment) -> Option<String> {
        if let Some(undetected) =
            self.undetected.as_ref().filter(|undetected| undetected.is_implausible())
        {
            let front = self.rows.iter().find(|row| row.looks_ahead)?;
            return Some(undetected.explain(&front.name));
        }
        let newest = |row: &&Row| row.implausible.map(|(_, at)| now.time.since(at.time));
        let implausible = self.rows.iter().filter(|row| row.implausible.is_some());
        let row = implausible.min_by_key(newest)?;
        let (Equal { first_m, readings, way_m, turn_rad }, _) = row.implausible?;
        Some(format!(
            "the sensor {} says {first_m:.2} m in {readings} frames although the robot drove {way_m:.2} m and turned {:.0} degrees: check it, then `firsthand stop` and `resume`",
            row.name,
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
        sensor_implausible_at(0, wheels_m, reading)
    }

    /// [`implausible_at`] for the sensor of row `sensor`, which gives centimetres.
    fn sensor_implausible_at(
        sensor: u8,
        wheels_m: [f64; 2],
        reading: impl Fn(u32) -> u16,
    ) -> Option<u32> {
        let mission = Mission::parse("target = [3, 0]", Path::new("test.toml")).unwrap();
        let mut monitor = Range::new(&mission);
        let per_count = mission.body().metres_per_count();
        (0..200).find(|&tick| {
            let time = MissionTime::from_seconds(f64::from(tick) / 7.0);
            let now = Moment { time, machine_ns: time.0 };
            let turned = wheels_m.map(|way| (way * f64::from(tick) / per_count).round() as i32);
            let counts = turned.map(|counts| counts.rem_euclid(32_768) as u16);
            monitor.observe(&Observation::Motor(counts.into(), Counts::Follow), now);
            let of = |sensor: u8, cm: u16| {
                let status = if cm == 255 { RangeStatus::Nothing } else { RangeStatus::Measured };
                RangeReading {
                    range_m: f64::from(cm) / 100.0,
                    raw: cm,
                    sensor,
                    status: status.into(),
                }
            };
            let beside = of((sensor + 1) % 3, 20 + 3 * (tick % 2) as u16);
            monitor.observe(&Observation::Readings(&[beside, of(sensor, reading(tick))]), now);
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

    #[test]
    fn a_sensor_that_looks_aside_is_stuck_if_its_reading_stays_while_the_robot_turns_on_the_spot() {
        for sensor in [1, 2, 3, 9] {
            assert_eq!(sensor_implausible_at(sensor, [-0.02, 0.02], |_| 50), Some(11), "{sensor}");
            // The robot drives along a wall, or around a drum.
            assert_eq!(sensor_implausible_at(sensor, [0.05; 2], |_| 50), None);
            assert_eq!(sensor_implausible_at(sensor, [0.03, 0.05], |_| 50), None);
        }
        // An infrared ranger that sees nothing says so at each heading.
        assert_eq!(sensor_implausible_at(3, [-0.02, 0.02], |_| 255), None);
    }
}
