//! Range monitor: checks that readings change with motion. [`super::hearing`] judges what sensors do
//! not hear, [`super::range_motion`] and [`super::scan_motion`] whether readings fit the motion.
//!
//! A constant reading in motion is stuck. Readings of some walls stay within the wider of
//! [`BANDS_M`], so the robot slows first. For sensors that look aside only turns on the spot count,
//! because walls read constant. Readings of nothing are exempt.
//!
//! Readings must also follow from one another while the robot hardly turns. Healthy sensors break
//! this in up to 0.45 of readings for long, random ones in 0.7 to 0.9. Page's test tells them apart.

use std::{
    f64::consts::{FRAC_PI_2, TAU},
    ops::RangeInclusive,
    time::Duration,
};

use common::{
    clock::MissionTime,
    driver::counts::WheelCounts,
    kinematics::Pose2,
    mission::{Body, Mission, Sensor, SensorKind},
    samples::{Cause, DoubtsSample, RangeReading, RangeStatus},
};

use super::{
    hearing::Hearing,
    monitor::{Condition, Counts, Moment, Monitor, Observation},
    motion_bank::Poses,
    range_motion::RangeMotion,
    scan_motion::ScanMotion,
};

/// Spread of stuck readings, metres: a centimetre to either side plus rounding, and a stuck
/// sensor's noise.
const BANDS_M: [f64; 2] = [0.0202, 0.0702];
/// Least stuck readings, 1.1 s at 7 Hz.
const READINGS: u32 = 8;
/// Distance, metres, or turn, radians, that must change a reading. Fractions add up.
const WAY_M: f64 = 0.4;
const TURN_RAD: f64 = FRAC_PI_2;
/// Multiple of that motion, over twice the readings, that is sure in the wider band.
const SURE: f64 = 1.8;
/// Judged ranges, metres. Ends of a scale are limits, not distances.
const JUDGED_SONAR_M: RangeInclusive<f64> = 0.05..=2.49;
const JUDGED_INFRARED_M: RangeInclusive<f64> = 0.10..=0.70;
/// Largest ratio of mean travel to half the wheels' difference of a turn on the spot.
const ON_THE_SPOT: f64 = 0.25;
/// Tolerance to one of the two readings before, metres, and largest judged turn, radians.
const FOLLOWS_M: f64 = 0.1;
const FOLLOWS_RAD: f64 = 0.12;
/// Logarithms of the likelihood of a reading that follows, and of one that does not, if 0.8 do not,
/// over that if 0.45 do not.
const ODD: [f64; 2] = [-1.012, 0.575];
/// Sums for doubt and for certainty.
const ODD_SUMS: [f64; 2] = [5.0, 11.0];
/// Time of changing readings that clears the cause.
pub(crate) const CHANGES: Duration = Duration::from_secs(2);

/// Returns the time until a stuck reading is known at full speed, seconds.
pub(crate) fn known_within_s(mission: &Mission) -> f64 {
    (WAY_M / mission.speed_m_s()).max(f64::from(READINGS) / mission.robot.rate_hz)
}

/// Reading, distance and heading by the wheels, metres and radians.
type Value = [f64; 3];

#[derive(Clone, Copy, Debug, Default)]
struct Staying {
    readings: u32,
    least: Value,
    most: Value,
}

impl Staying {
    fn take(&mut self, value: Value, band_m: f64) {
        let least = [0, 1, 2].map(|it| self.least[it].min(value[it]));
        let most = [0, 1, 2].map(|it| self.most[it].max(value[it]));
        *self = if self.readings > 0 && most[0] - least[0] <= band_m {
            Self { readings: self.readings + 1, least, most }
        } else {
            Self { readings: 1, least: value, most: value }
        };
    }

    fn spread(&self) -> Value {
        [0, 1, 2].map(|it| self.most[it] - self.least[it])
    }

    fn motion(&self, readings: u32) -> f64 {
        let [_, way_m, turn_rad] = self.spread();
        assert!(way_m >= 0.0 && turn_rad >= 0.0);
        if self.readings < readings { 0.0 } else { way_m / WAY_M + turn_rad / TURN_RAD }
    }
}

#[derive(Clone, Debug, Default)]
struct Past {
    staying: [Staying; 2],
    newest: [Option<Value>; 2],
    odd: f64,
}

#[derive(Clone, Debug)]
struct Row {
    row: u8,
    name: String,
    looks_ahead: bool,
    judged_m: RangeInclusive<f64>,
    past: Past,
    /// Times at which the row was last doubted, and surely implausible.
    implausible: [Option<Moment>; 2],
    words: String,
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
            past: Past::default(),
            implausible: [None; 2],
            words: String::new(),
        }
    }

    fn take(&mut self, reading: &RangeReading, [way_m, heading, spot]: [f64; 3], now: Moment) {
        let range_m = reading.range_m;
        let is_judged =
            reading.status() == RangeStatus::Measured && self.judged_m.contains(&range_m);
        let past = &mut self.past;
        if is_judged {
            let follows = |[range, way, turned]: Value| {
                let went_m = (way_m - way).abs();
                let farther = if self.looks_ahead { 0.0 } else { went_m };
                let is_near =
                    (-went_m - FOLLOWS_M..=farther + FOLLOWS_M).contains(&(range_m - range));
                ((heading - turned).abs() < FOLLOWS_RAD).then_some(is_near)
            };
            let follow = past.newest.into_iter().flatten().filter_map(follows);
            if let Some(one) = follow.reduce(|one, other| one || other) {
                past.odd = (past.odd + ODD[usize::from(!one)]).clamp(0.0, 2.0 * ODD_SUMS[1]);
            }
            past.newest = [past.newest[1], Some([range_m, way_m, heading])];
            let moved = if self.looks_ahead { [way_m, heading] } else { [0.0, spot] };
            for (staying, band_m) in past.staying.iter_mut().zip(BANDS_M) {
                staying.take([range_m, moved[0], moved[1]], band_m);
            }
        } else {
            past.staying = Default::default();
        }
        let is_so = self.is_implausible();
        for (at, is_so) in self.implausible.iter_mut().zip(is_so) {
            if is_so {
                *at = Some(now);
            }
        }
        if is_so[0] {
            self.words = self.words();
        }
    }

    fn is_implausible(&self) -> [bool; 2] {
        let [equal, near] = &self.past.staying;
        [(1.0, 0), (SURE, 1)].map(|(least, it)| {
            let readings = READINGS * (it as u32 + 1);
            let stays = equal.motion(READINGS) >= 1.0 || near.motion(readings) >= least;
            stays || self.past.odd >= ODD_SUMS[it]
        })
    }

    fn words(&self) -> String {
        let Past { staying: [equal, near], .. } = &self.past;
        let near = if equal.motion(READINGS) >= 1.0 { equal } else { near };
        let [spread_m, way_m, turn_rad] = near.spread();
        let said = if near.motion(READINGS) >= 1.0 {
            format!(
                "reads {:.2} m within {:.0} cm in {} frames although the robot drove {way_m:.2} m and turned {:.0} degrees",
                near.least[0],
                spread_m * 100.0,
                near.readings,
                turn_rad.to_degrees()
            )
        } else {
            "gives readings of which most do not follow from those before".to_owned()
        };
        format!("the sensor {} {said}; check it, then run `firsthand stop` and `resume`", self.name)
    }

    fn condition(&self, sure: bool, now: Moment) -> Condition {
        match self.implausible[usize::from(sure)] {
            Some(_) if self.is_implausible()[usize::from(sure)] => Condition::Holds,
            Some(at) => Condition::OverFor(now.time.since(at.time)),
            None => false.into(),
        }
    }
}

#[derive(Clone, Debug)]
pub struct Range {
    sensing: bool,
    body: Body,
    counts: Option<WheelCounts>,
    pose: Pose2,
    poses: Poses,
    way_m: f64,
    spot_rad: f64,
    rows: Vec<Row>,
    scans: Vec<ScanMotion>,
    hearing: Hearing,
    motion: RangeMotion,
    /// Motion by the wheels up to which `untold` is complete.
    told: Option<Pose2>,
    /// Travel and turn that the readings show and the wheels do not count, metres and radians.
    untold: [f64; 2],
}

impl Range {
    fn turn(&mut self, counts: WheelCounts, now: MissionTime) {
        if let Some(before) = self.counts.replace(counts) {
            let wheels = counts.since(before).map(|it| it * TAU / self.body.counts_per_turn);
            let twist = match (self.body.ackermann(), self.body.steering) {
                (Some(car), Some(steers)) => {
                    // The second encoder is the steering's, 0 straight ahead.
                    let [_, angle] = counts.since([0; 2].into());
                    car.twist([wheels[0], steers.angle(angle)])
                }
                _ => self.body.unlimited().twist(wheels),
            };
            self.pose = self.pose.along_arc(twist.v, twist.omega);
            self.way_m += twist.v;
            self.hearing.went(twist.v);
            if twist.v.abs() < ON_THE_SPOT * twist.omega.abs() * self.body.track_m / 2.0 {
                self.spot_rad += twist.omega;
            }
        }
        self.poses.robot_is(self.pose, now);
    }

    /// Returns the travel of the left and the right wheel that the wheels do not count, metres.
    pub(crate) fn untold_m(&self) -> [f64; 2] {
        let [along, turn] = self.untold;
        let half_track_m = self.body.track_m / 2.0;
        [along - turn * half_track_m, along + turn * half_track_m]
    }

    fn tell(&mut self) {
        self.told = self.motion.rolls().map(|(share, since_s)| {
            let from = self.told.unwrap_or_else(|| self.poses.at(since_s));
            self.untold[0] += (share - 1.0) * from.position.distance(self.pose.position);
            self.untold[1] += (share - 1.0) * (self.pose.heading - from.heading);
            self.pose
        });
    }

    fn judged(&self, sure: bool) -> Option<String> {
        let scans = || self.scans.iter().find_map(|scans| scans.judged(sure));
        self.hearing.judged(sure).or_else(scans).or_else(|| self.motion.judged(sure))
    }

    fn forget(&mut self) {
        self.counts = None;
        self.poses = Poses::default();
        for row in &mut self.rows {
            row.past = Past::default();
            row.implausible = [None; 2];
        }
        self.scans.iter_mut().for_each(ScanMotion::reset);
        self.hearing.reset();
        self.motion.reset();
    }
}

impl Monitor for Range {
    fn new(mission: &Mission) -> Self {
        let front = mission.front_row();
        let (lasers, others): (Vec<_>, Vec<_>) = mission
            .sensor_table()
            .into_iter()
            .enumerate()
            .filter(|(_, sensor)| sensor.used)
            .partition(|(_, sensor)| sensor.kind == SensorKind::Scan);
        Self {
            sensing: mission.sensing,
            body: mission.body(),
            counts: None,
            pose: Pose2::default(),
            poses: Poses::default(),
            way_m: 0.0,
            spot_rad: 0.0,
            rows: others.into_iter().map(|(row, sensor)| Row::of(row, sensor, front)).collect(),
            scans: lasers.into_iter().map(|(row, sensor)| ScanMotion::new(row, sensor)).collect(),
            hearing: Hearing::of(mission),
            motion: RangeMotion::of(mission),
            told: None,
            untold: [0.0; 2],
        }
    }

    fn observe(&mut self, what: &Observation<'_>, now: Moment) {
        match *what {
            Observation::Readings(readings) => {
                let moved = [self.way_m, self.pose.heading, self.spot_rad];
                for row in &mut self.rows {
                    if let Some(reading) = readings.iter().find(|reading| reading.sensor == row.row)
                    {
                        row.take(reading, moved, now);
                    }
                }
                self.hearing.take(readings, self.pose, now.time.seconds());
                if !now.is_after_pause {
                    self.motion.take(readings, &self.poses, now.time.seconds());
                    self.tell();
                }
            }
            Observation::Scan(scan, at_s) if !now.is_after_pause => {
                if let Some(scans) = self.scans.iter_mut().find(|scans| scans.row == scan.row) {
                    scans.take(scan, &self.poses, at_s);
                }
            }
            Observation::Motor(counts, Counts::Follow) => self.turn(counts, now.time),
            Observation::Motor(..) => self.counts = None,
            Observation::Lost | Observation::Resumed => self.forget(),
            _ => {}
        }
    }

    fn condition(&self, cause: Cause, now: Moment) -> Condition {
        if !self.sensing {
            return false.into();
        }
        let sure = cause == Cause::RangeImplausible;
        if self.judged(sure).is_some() {
            return Condition::Holds;
        }
        self.rows.iter().map(|row| row.condition(sure, now)).min().unwrap_or(false.into())
    }

    fn doubt(&self, doubts: &mut DoubtsSample) {
        if !self.sensing {
            return;
        }
        for Row { past: Past { staying: [equal, near], odd, .. }, .. } in &self.rows {
            let stuck = equal.motion(READINGS).max(near.motion(2 * READINGS) / SURE);
            doubts.stuck = doubts.stuck.max(stuck);
            doubts.inconsistent = doubts.inconsistent.max(odd / ODD_SUMS[1]);
        }
        doubts.deaf = self.hearing.doubt();
        self.scans.iter().for_each(|scans| scans.doubt(doubts));
        self.motion.doubt(doubts);
    }

    fn explain(&self, cause: Cause, _: Moment) -> Option<String> {
        let sure = cause == Cause::RangeImplausible;
        let doubted =
            |row: &Row| Some((row.implausible[usize::from(sure)]?.time, row.words.clone()));
        self.judged(sure).or_else(|| Some(self.rows.iter().filter_map(doubted).max()?.1))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::*;

    /// Returns the first tick at which a sensor with these readings, centimetres, is implausible,
    /// with wheel travel per tick.
    fn implausible_at(
        sensor: u8,
        wheels_cm: [i16; 2],
        range_cm: impl Fn(u32) -> u16,
    ) -> Option<u32> {
        let mission = mission("");
        let mut monitor = Range::new(&mission);
        let per_count = mission.body().metres_per_count();
        (0..200).find(|&tick| {
            let now = Moment { time: at(f64::from(tick) / 7.0), ..Moment::default() };
            let turned = |cm: i16| 0.01 * f64::from(cm) * f64::from(tick) / per_count;
            let counts = wheels_cm.map(|cm| on_wire(turned(cm).round()));
            monitor.observe(&Observation::Motor(counts.into(), Counts::Follow), now);
            let of =
                |sensor: u8, cm: u16| reading(sensor, (cm != 255).then_some(f64::from(cm) / 100.0));
            let beside = of((sensor + 1) % 3, 20 + 9 * (tick % 2) as u16);
            monitor.observe(&Observation::Readings(&[beside, of(sensor, range_cm(tick))]), now);
            // Together, the readings fit no motion.
            monitor.rows.iter().any(|row| row.condition(true, now) == Condition::Holds)
        })
    }

    type RangeCm = fn(u32) -> u16;

    #[track_caller]
    fn judged(rows: &[(u8, [i16; 2], RangeCm, Option<u32>)]) {
        for (row, &(sensor, wheels_cm, reading, expected)) in rows.iter().enumerate() {
            assert_eq!(implausible_at(sensor, wheels_cm, reading), expected, "row {row}");
        }
    }

    #[test]
    fn a_reading_that_stays_while_the_robot_drives_0_4_m_or_turns_by_a_right_angle_is_implausible()
    {
        // 0.05 m per tick is 0.4 m in 8. A quarter turn rolls each wheel 0.204 m.
        judged(&[
            (0, [5; 2], |_| 100, Some(8)),
            (0, [-2, 2], |tick| 100 + (tick % 2) as u16, Some(11)),
            // Of fewer readings nothing is known.
            (0, [10; 2], |_| 100, Some(7)),
            (0, [5; 2], |tick| 200 - 5 * tick.min(29) as u16, Some(37)),
        ]);
    }

    #[test]
    fn readings_of_a_robot_that_stands_that_change_or_that_are_no_distances_are_plausible() {
        judged(&[
            (0, [0; 2], |_| 100, None),
            (0, [5; 2], |tick| 100 + 8 * (tick % 2) as u16, None),
            (0, [5; 2], |_| 255, None),
            (0, [5; 2], |_| 254, None),
            (0, [5; 2], |tick| 240 - tick as u16, None),
        ]);
    }

    #[test]
    fn a_sensor_that_looks_aside_is_stuck_if_its_reading_stays_while_the_robot_turns_on_the_spot() {
        for sensor in [1, 2, 3, 9] {
            judged(&[
                (sensor, [-2, 2], |_| 50, Some(11)),
                // Along a wall, or around a drum.
                (sensor, [5; 2], |_| 50, None),
                (sensor, [3, 5], |_| 50, None),
            ]);
        }
        // Infrared rangers with nothing in range stay silent at each heading.
        judged(&[(3, [-2, 2], |_| 255, None)]);
    }

    #[test]
    fn a_reading_that_stays_within_3_cm_slows_the_robot_and_then_stops_it() {
        judged(&[
            (0, [5; 2], |tick| 97 + (tick * 5 % 7) as u16, Some(15)),
            (0, [5; 2], |tick| 97 + (tick * 5 % 7 + 2 * tick) as u16, None),
        ]);
    }

    #[test]
    fn the_words_count_the_readings_that_are_equal_and_not_those_that_come_near() {
        let mut row = Row::of(0, mission("").sensor_table().remove(0), 0);
        for tick in 0..12 {
            let reading = reading(0, Some(if tick == 0 { 1.05 } else { 1.0 }));
            row.take(&reading, [0.05 * f64::from(tick), 0.0, 0.0], Moment::default());
        }
        assert!(row.words.contains("within 0 cm in 11 frames"), "{}", row.words);
    }

    #[test]
    fn readings_that_do_not_follow_from_one_another_are_implausible_and_those_of_two_things_are_not()
     {
        let random = |tick: u32| 10 + (tick * tick * 37 % 240) as u16;
        assert!(implausible_at(0, [3; 2], random).is_some_and(|tick| tick < 60));
        judged(&[(0, [0; 2], |tick| if tick % 3 == 0 { 200 } else { 90 }, None)]);
    }

    #[test]
    fn the_explanation_is_that_of_the_judge_that_holds_and_not_of_one_that_only_doubts() {
        let (mut monitor, now) = (Range::new(&mission("")), Moment::default());
        for _ in 0..100 {
            monitor.hearing.take(&[reading(0, None)], Pose2::default(), 0.0);
            monitor.hearing.went(0.05);
        }
        for (row, second) in [Some(now), None].into_iter().enumerate() {
            monitor.rows[row].implausible = [Some(now), second];
            monitor.rows[row].words = format!("sensor {row}");
        }
        let explain = |cause| monitor.explain(cause, now).unwrap();
        assert_eq!(explain(Cause::RangeImplausible), "sensor 0");
        assert!(explain(Cause::RangeDoubtful).contains("the sensors are deaf"));
    }

    #[test]
    fn a_car_turns_by_its_steering() {
        let mut monitor = Range::new(&mission("robot.model = 'car'"));
        // A wheel of 0.04 m rolls half a turn. 300 of 3600 counts are 30 degrees right; the
        // wheelbase is 0.18 m.
        for left in [0, 300] {
            monitor.turn([left, on_wire(-300.0)].into(), at(0.0));
        }
        let way_m = 0.04 * std::f64::consts::PI;
        let turn_rad = -way_m * 30_f64.to_radians().tan() / 0.18;
        near(monitor.way_m, way_m, 1e-9);
        near(monitor.pose.heading, turn_rad, 1e-9);
    }
}
