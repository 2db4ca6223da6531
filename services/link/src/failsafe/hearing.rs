//! Detection of sensors that do not hear what is there. "Nothing in range" is also normal in the
//! open, so something else has to say what a silent sensor should have heard:
//!
//! - Earlier [`Echoes`]: a surface that was heard is still there.
//! - Infrared rangers beside the front sonar: it must hear a near surface seen on both sides whose
//!   line of hits is square to its axis.
//! - Noise: with nothing in reach, infrared rangers still read the end of their scale in a quarter
//!   of the frames.
//!
//! Otherwise deafness looks like an empty hall, which a robot must cross. It then goes slowly once
//! it has driven the reach of its sensors without a reading.

use std::collections::BTreeMap;

use common::{
    kinematics::Pose2,
    mission::{Mission, Sensor, SensorKind},
    samples::{RangeReading, RangeStatus},
};

use super::{
    echoes::{Echoes, Listener},
    motion_bank::motion_m,
};

/// Sums of misses of one sonar, and of all: doubted, and surely deaf.
const ONE: [f64; 2] = [10.0, 16.0];
const ALL: [f64; 2] = [4.5, 8.0];
/// Missing end-of-scale readings for doubt and for certainty.
const ENDS: [f64; 2] = [6.0, 12.0];
/// Share of a sensor's reach beyond which readings are end-of-scale. Fewer than `LEAST_ENDS` per
/// frame prove nothing.
const END_SHARE: f64 = 0.85;
const LEAST_ENDS: f64 = 1.0;
/// Averaging length, frames.
const MEAN_OF: f64 = 30.0;
/// Spells of certain deafness that show sensors deaf in motion.
const SPELLS: u32 = 3;
/// Largest range of a surface between two rangers, metres, angle between its normal and the axis,
/// and angle from the axis of rangers that look into the cone, degrees.
const NEARER_M: f64 = 0.45;
const SQUARE_DEG: f64 = 12.0;
const BESIDE_DEG: f64 = 15.0;
/// Motion after which a missed echo counts again, metres, and metres per radian of turn. From the
/// same pose, the same echo is missed again.
const FRESH_M: f64 = 0.03;
const M_PER_RAD: f64 = 0.6;
/// Silent readings that may be chance.
const SILENCES: u32 = 4;

/// Sum of readings due during a silence.
#[derive(Clone, Copy, Debug, Default)]
struct Missing {
    sum: f64,
    spells: u32,
}

impl Missing {
    fn add(&mut self, more: f64, sure: f64) {
        assert!(more >= 0.0 && sure > 0.0);
        let was_sure = self.sum >= sure;
        self.sum += more;
        self.spells += u32::from(!was_sure && self.sum >= sure);
    }

    fn is(self, least: f64) -> bool {
        self.sum >= least || self.is_in_motion()
    }

    fn doubt(self, sure: f64) -> f64 {
        if self.is_in_motion() { 1.0 } else { self.sum / sure }
    }

    fn is_in_motion(self) -> bool {
        self.spells >= SPELLS
    }
}

#[derive(Clone, Debug)]
pub(super) struct Hearing {
    sensors: BTreeMap<u8, Sensor>,
    /// Rows of the front sonar and of the rangers to its left and right that look into its cone.
    front: Option<[u8; 3]>,
    memory: Memory,
}

#[derive(Clone, Debug, Default)]
struct Memory {
    echoes: Echoes,
    robot: Pose2,
    one: BTreeMap<u8, Missing>,
    all: Missing,
    /// Ranges of the rangers beside the front sonar, and its silences since they see a surface.
    beside_m: [Option<f64>; 2],
    silences: u32,
    frame: Frame,
    mean_ends: f64,
    ends: Missing,
    /// Frames and way since the last reading.
    frames: u32,
    way_m: f64,
}

/// Values of the current frame.
#[derive(Clone, Copy, Debug, Default)]
struct Frame {
    answers: bool,
    hears: bool,
    ends: f64,
}

impl Hearing {
    pub(super) fn of(mission: &Mission) -> Self {
        let table = (0..).zip(mission.sensor_table()).filter(|(_, sensor)| sensor.used);
        let sensors: BTreeMap<u8, Sensor> = table.collect();
        let sonar = mission.front_row() as u8;
        let beside = |side: f64| {
            let ahead = sensors.get(&sonar)?.mount.bearing_rad;
            let off = |sensor: &Sensor| (sensor.mount.bearing_rad - ahead) * side;
            let looks = |(_, it): &(&u8, &Sensor)| {
                it.kind == SensorKind::Ray && (0.0..BESIDE_DEG.to_radians()).contains(&off(it))
            };
            let nearest = sensors.iter().filter(looks);
            nearest.min_by(|(_, a), (_, b)| off(a).total_cmp(&off(b))).map(|(row, _)| *row)
        };
        let beside = beside(1.0).zip(beside(-1.0)).filter(|(left, right)| left != right);
        let front = beside.map(|(left, right)| [sonar, left, right]);
        Self { sensors, front, memory: Memory::default() }
    }

    pub(super) fn reset(&mut self) {
        self.memory = Memory::default();
    }

    /// Takes the pose by the wheels, and seconds.
    pub(super) fn take(&mut self, readings: &[RangeReading], robot: Pose2, at_s: f64) {
        let memory = &mut self.memory;
        memory.echoes.forget(at_s);
        let before = std::mem::replace(&mut memory.robot, robot);
        let share = (motion_m([before, robot], M_PER_RAD) / FRESH_M).min(1.0);
        let is_silent = readings.iter().all(|it| it.status() != RangeStatus::Measured);
        for reading in readings {
            let Some(sensor) = self.sensors.get(&reading.sensor) else { continue };
            let status = reading.status();
            let frame = &mut memory.frame;
            frame.answers |= status != RangeStatus::Invalid;
            if status == RangeStatus::Measured {
                frame.hears = true;
                frame.ends += f64::from(reading.range_m > END_SHARE * sensor.reach_m);
            }
            if sensor.kind != SensorKind::Cone {
                continue;
            }
            let listener = Listener::at(sensor, robot);
            let missing = memory.one.entry(reading.sensor).or_default();
            match status {
                RangeStatus::Measured => {
                    missing.sum = 0.0;
                    memory.all.sum = 0.0;
                    memory.echoes.hear(listener, reading.range_m, at_s);
                }
                RangeStatus::Nothing => {
                    let likely = share * memory.echoes.miss(listener);
                    missing.add(likely, ONE[1]);
                    if is_silent {
                        memory.all.add(likely, ALL[1]);
                    }
                }
                _ => {}
            }
        }
        self.compare_front(readings);
    }

    fn compare_front(&mut self, readings: &[RangeReading]) {
        let Some([front, left, right]) = self.front else { return };
        let of = |row: u8| readings.iter().find(|reading| reading.sensor == row);
        for (row, range_m) in [left, right].into_iter().zip(&mut self.memory.beside_m) {
            if let Some(reading) = of(row) {
                *range_m = (reading.status() == RangeStatus::Measured).then_some(reading.range_m);
            }
        }
        if self.surface_m().is_none() {
            self.memory.silences = 0;
        } else if let Some(front) = of(front) {
            let is_silent = front.status() == RangeStatus::Nothing;
            let more = self.memory.silences.saturating_add(1);
            self.memory.silences = if is_silent { more } else { 0 };
        }
    }

    /// Returns the range of a surface square to the front sonar between the two rangers.
    fn surface_m(&self) -> Option<f64> {
        let [front, left, right] = self.front.map(|rows| rows.map(|row| self.sensors.get(&row)))?;
        let [left_m, right_m] = self.memory.beside_m.map(|it| it.filter(|m| *m < NEARER_M));
        let seen = |sensor: Option<&Sensor>, range_m: Option<f64>| {
            Some(sensor?.mount.hit(Pose2::default(), range_m?))
        };
        let along = seen(left, left_m)? - seen(right, right_m)?;
        let axis = glam::DVec2::from_angle(front?.mount.bearing_rad);
        let slant = along.dot(axis).atan2(along.perp_dot(axis).abs()).abs();
        (slant <= SQUARE_DEG.to_radians()).then_some(f64::midpoint(left_m?, right_m?))
    }

    /// Completes a frame after a motion of `way_m`.
    pub(super) fn went(&mut self, way_m: f64) {
        let memory = &mut self.memory;
        let frame = std::mem::take(&mut memory.frame);
        if frame.hears {
            memory.mean_ends += (frame.ends - memory.mean_ends) / MEAN_OF;
            assert!(memory.mean_ends >= 0.0);
            memory.ends.sum = 0.0;
            memory.frames = 0;
            memory.way_m = 0.0;
        } else if frame.answers {
            memory.frames += 1;
            memory.way_m += way_m.abs();
            if memory.mean_ends >= LEAST_ENDS {
                memory.ends.add(memory.mean_ends, ENDS[1]);
            }
        }
    }

    /// Returns the greatest evidence of a deaf sensor; 1 is sure.
    pub(super) fn doubt(&self) -> f64 {
        let Memory { one, all, ends, silences, .. } = &self.memory;
        let all = if one.len() > 1 { all.doubt(ALL[1]) } else { 0.0 };
        let front = f64::from(*silences) / f64::from(SILENCES + 1);
        let one = one.values().map(|missing| missing.doubt(ONE[1]));
        one.fold(all.max(ends.doubt(ENDS[1])).max(front), f64::max)
    }

    /// Explains doubtful, or surely deaf, sensors.
    pub(super) fn judged(&self, sure: bool) -> Option<String> {
        let check = "is gone, or the sonar is deaf; check its supply and cable, then run `firsthand stop` and `resume`";
        let it = usize::from(sure);
        let memory = &self.memory;
        let name = |row: &u8| self.sensors.get(row).map_or("", |sensor| &*sensor.name);
        if let Some(rows) = self.front.filter(|_| sure && memory.silences > SILENCES) {
            let [front, left, right] = rows.each_ref().map(name);
            return Some(format!(
                "{front} has heard nothing {} times, but {left} and {right} see a surface square ahead at {:.2} m; check the sensor",
                memory.silences,
                self.surface_m().unwrap_or_default()
            ));
        }
        if memory.one.len() > 1 && memory.all.is(ALL[it]) {
            return Some(format!("no sonar hears an obstacle heard before: the obstacle {check}"));
        }
        if let Some((row, _)) = memory.one.iter().find(|(_, missing)| missing.is(ONE[it])) {
            let name = name(row);
            return Some(format!(
                "the sonar {name} does not hear an obstacle heard before: the obstacle {check}"
            ));
        }
        let reach_m = self.sensors.values().map(|sensor| sensor.reach_m).fold(0.0, f64::max);
        let is_open = !sure && memory.way_m > reach_m;
        if !memory.ends.is(ENDS[it]) && !is_open {
            return None;
        }
        let Memory { frames, way_m, .. } = memory;
        let when = if memory.ends.is_in_motion() {
            format!("has heard anything while the robot moved, {SPELLS} times")
        } else {
            format!("has heard anything in {frames} frames and {way_m:.1} m")
        };
        Some(format!(
            "no ranging sensor {when}: the ground is open, or the sensors are deaf; check their supply and cable, then run `firsthand stop` and `resume`"
        ))
    }
}

#[cfg(test)]
mod tests {
    use std::iter::repeat_n;

    use glam::DVec2;

    use super::*;
    use crate::testing::*;

    /// Takes readings, centimetres, of these sensors.
    fn take<const COUNT: usize>(hearing: &mut Hearing, ranges: [(u8, Option<u8>); COUNT]) {
        let metres = |range: Option<u8>| range.map(|range| f64::from(range) / 100.0);
        let readings = ranges.map(|(sensor, range)| reading(sensor, metres(range)));
        hearing.take(&readings, Pose2::default(), 0.0);
    }

    #[test]
    fn sonars_are_judged_deaf_that_do_not_hear_a_post_in_their_cones_as_before() {
        type IsHeard = fn(u32, u8) -> bool;
        // Two sonars approach a post of 0.1 m radius at (1.2, 0.1). The robot drives 2 cm per tick,
        // and turns to and fro by 0.3 rad. `is_heard` selects the ticks and sonars that hear the
        // post.
        let mission = mission(
            "robot.model = 'kobuki'\nrobot.protocol = 'json'\n\
             [[robot.sensor]]\nname = 'a'\nkind = 'cone'\nforward_m = 0.2\nbearing_deg = 10\n\
             [[robot.sensor]]\nname = 'b'\nkind = 'cone'\nforward_m = 0.2\nbearing_deg = -10",
        );
        let all_deaf: IsHeard = |tick, _| tick < 40;
        let one_deaf: IsHeard = |tick, sensor| sensor == 0 || tick < 40;
        let now_and_then: IsHeard = |tick, _| tick < 40 || tick % 40 > 30;
        for (ticks, is_heard, are_deaf) in [
            (150, (|_, _| true) as IsHeard, false),
            (41, all_deaf, false),
            (90, all_deaf, true),
            (45, one_deaf, false),
            (140, one_deaf, true),
            (231, now_and_then, true),
        ] {
            let mut hearing = Hearing::of(&mission);
            for tick in 0..ticks {
                let position = DVec2::new(0.02 * f64::from(tick.min(30)), 0.0);
                let heading = 0.3 * (0.4 * f64::from(tick)).sin();
                let robot = Pose2 { position, heading };
                let readings = [0, 1].map(|sensor| {
                    let from = hearing.sensors[&sensor].mount.on(robot);
                    let half_rad = hearing.sensors[&sensor].field_of_view_deg.to_radians() / 2.0;
                    let way = DVec2::new(1.2, 0.1) - from.position;
                    let is_seen = way.dot(from.axis()) > half_rad.cos() * way.length();
                    let hears = is_seen && is_heard(tick, sensor);
                    reading(sensor, hears.then_some(way.length() - 0.1))
                });
                hearing.take(&readings, robot, 0.1 * f64::from(tick));
            }
            let judged = [false, true].map(|sure| hearing.judged(sure).is_some());
            assert_eq!(judged, [are_deaf; 2], "{ticks}");
        }
    }

    /// Judges a ranger, row 3, with these readings, centimetres, on a robot that drives 0.05 m per
    /// frame.
    fn judged(ranges: impl Iterator<Item = Option<u8>>) -> [bool; 2] {
        let mut hearing = Hearing::of(&mission(""));
        let judgement = judge(&mut hearing, ranges);
        hearing.reset();
        assert_eq!(judge(&mut hearing, std::iter::empty()), [false; 2]);
        judgement
    }

    fn judge(hearing: &mut Hearing, ranges: impl Iterator<Item = Option<u8>>) -> [bool; 2] {
        for range in ranges {
            take(hearing, [(3, range), (4, range)]);
            hearing.went(0.05);
        }
        [false, true].map(|sure| hearing.judged(sure).is_some())
    }

    #[test]
    fn rangers_whose_noise_at_the_end_of_their_scale_is_missing_are_doubted_and_then_surely_deaf() {
        // A robot that leaves what it saw for open ground, or never hears anything, goes slowly after
        // its sensors' reach, and does not stand.
        for (heard, silent, judgement) in [
            (Some(79), 2, [false, false]),
            (Some(79), 4, [true, false]),
            (Some(79), 8, [true, true]),
            (Some(50), 50, [false, false]),
            (Some(50), 500, [true, false]),
            (None, 50, [false, false]),
            (None, 500, [true, false]),
        ] {
            let before = if heard.is_some() { 60 } else { 0 };
            let all = repeat_n(heard, before).chain(repeat_n(None, silent));
            assert_eq!(judged(all), judgement, "{heard:?} {silent}");
        }
    }

    #[test]
    fn sensors_that_hear_only_whenever_the_robot_stands_are_deaf_until_it_is_resumed() {
        let spell = || repeat_n(Some(79), 60).chain(repeat_n(None, 9));
        let hears = || repeat_n(Some(50), 9);
        assert_eq!(judged(spell().chain(spell()).chain(hears())), [false, false]);
        assert_eq!(judged(spell().chain(spell()).chain(spell()).chain(hears())), [true, true]);
    }

    #[test]
    fn a_sonar_that_hears_nothing_of_a_near_surface_square_ahead_is_implausible_after_4_readings_until_an_echo()
     {
        // Sensors 0, 4 and 5 are the front sonar and the rangers at 11.25 and -11.25 degrees, whose
        // points are 0.19 m apart, so 12 degrees are 4 cm in depth. A surface that is far, aslant or
        // not before both proves nothing.
        for (left, right, is_implausible) in [
            (30, Some(30), true),
            (44, Some(44), true),
            (30, Some(33), true),
            (46, Some(44), false),
            (30, Some(36), false),
            (30, None, false),
        ] {
            let mut hearing = Hearing::of(&mission(""));
            let first = (1..50).find(|_| {
                take(&mut hearing, [(0, None), (4, Some(left)), (5, right)]);
                hearing.judged(true).is_some()
            });
            assert_eq!(first, is_implausible.then_some(5), "{left} {right:?}");
            // It is over with an echo, or without the surface.
            let over = if left == 44 { None } else { Some(30) };
            take(&mut hearing, [(0, over), (4, over), (5, Some(30))]);
            assert!(hearing.judged(true).is_none(), "{left} {right:?}");
        }
    }

    #[test]
    fn a_sonar_without_used_infrared_rangers_beside_it_is_not_compared_with_them() {
        for without in ["sensors = 'three-front'", "method = 'paper'"] {
            assert_eq!(Hearing::of(&mission(without)).front, None);
        }
    }
}
