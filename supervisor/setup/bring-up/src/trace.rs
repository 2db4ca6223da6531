//! Commands, counts and readings of the procedure.

use std::{collections::BTreeMap, iter::zip};

use common::{
    driver::counts::WheelCounts,
    mission::Mission,
    samples::{CountsSample, RangeReading, ScanHeader, WheelSample},
    topics::{COMMAND, COUNTS, IMU_TURN, LINK, RANGES, SCAN, WHEELS},
};
use recording::{Recording, RecordingError};

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Told {
    Stand,
    TurnLeft,
    TurnRight,
    Drive,
}

/// Recorded data. Times are mission time, seconds.
#[derive(Debug, Default)]
pub struct Trace {
    /// Rim distances left and right since the beginning by the counts, metres, with nominal wheels.
    pub rolled: Vec<(f64, [f64; 2])>,
    /// Commanded speeds of the rims, m/s.
    pub told: Vec<(f64, [f64; 2])>,
    /// Commands that the link sent, at the time of sending.
    pub sent: Vec<(f64, [f64; 2])>,
    /// Gyro turn since the previous tick, radians counter-clockwise, where known.
    pub gyro: Vec<(f64, f64)>,
    /// Readings of a tick, one per row of the mission's table.
    pub ranges: Vec<(f64, Vec<RangeReading>)>,
    pub scans: Vec<Scan>,
}

pub type Scan = (f64, ScanHeader, Vec<f32>);

/// Stretch of time with one command.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Leg {
    pub told: Told,
    pub from_s: f64,
    pub until_s: f64,
}

impl Leg {
    pub fn seconds(&self) -> f64 {
        self.until_s - self.from_s
    }

    pub fn contains(&self, at_s: f64) -> bool {
        (self.from_s..self.until_s).contains(&at_s)
    }
}

/// Distance below which a wheel rests, metres.
const RESTS_M: f64 = 0.02;
/// Rim speed below which the command is to stand, m/s.
const STANDS_M_S: f64 = 0.005;

impl Told {
    fn of([left, right]: [f64; 2]) -> Self {
        match (left.abs().max(right.abs()) < STANDS_M_S, left * right > 0.0, right > left) {
            (true, ..) => Self::Stand,
            (_, true, _) => Self::Drive,
            (_, _, true) => Self::TurnLeft,
            _ => Self::TurnRight,
        }
    }
}

impl Trace {
    /// Reads `recording` with the sizes stated by `mission`.
    pub fn read(mission: &Mission, recording: &Recording) -> Result<Self, RecordingError> {
        let body = mission.body();
        let scales = mission.robot.odometry.wheel_scales();
        let mut endless = BTreeMap::<u64, CountsSample>::new();
        for counts in recording.samples(&COUNTS)? {
            let counts = counts?;
            endless.insert(counts.stamp.tick, counts);
        }
        let mut trace = Self::default();
        let (mut before, mut rolled): (Option<(WheelSample, WheelCounts)>, _) = (None, [0.0; 2]);
        for wheels in recording.samples(&WHEELS)? {
            let wheels = wheels?;
            // In lockstep, an unanswered tick is published again.
            if before.is_some_and(|(old, _)| old.stamp.tick == wheels.stamp.tick) {
                continue;
            }
            let counts = WheelCounts::of(&wheels, endless.get(&wheels.stamp.tick));
            if let Some((old, earlier)) = before
                && old.restarts == wheels.restarts
            {
                let went = counts.since(earlier);
                rolled =
                    [0, 1].map(|it| rolled[it] + went[it] * body.metres_per_count() * scales[it]);
            }
            before = Some((wheels, counts));
            trace.rolled.push((wheels.stamp.seconds(), rolled));
        }
        for command in recording.samples(&COMMAND)? {
            let command = command?;
            let rims = [command.left_rad_s, command.right_rad_s].map(|it| it * body.wheel_radius_m);
            trace.told.push((command.stamp.seconds(), rims));
        }
        let mut newest = None;
        for link in recording.samples(&LINK)? {
            let link = link?;
            let at = link.stamp.seconds();
            let told = trace.told.partition_point(|it| it.0 <= at).checked_sub(1);
            let Some((_, rims)) = told.and_then(|it| trace.told.get(it)) else { continue };
            if newest.replace((told, link.action)) == Some((told, link.action)) {
                continue;
            }
            let wanted = rims.map(|it| link.action().speed_share() * it);
            let before = trace.sent.last().map_or([0.0; 2], |it| it.1);
            let wheels = |rims: [f64; 2]| rims.map(|it| it / body.wheel_radius_m);
            let sent = body.reached(wheels(before), wheels(wanted), mission.robot.rate_hz);
            let sent_s = at + 1e-9 * link.latency_ns as f64;
            trace.sent.push((sent_s, sent.map(|it| it * body.wheel_radius_m)));
        }
        let mut before = None;
        for turn in recording.samples(&IMU_TURN)? {
            let turn = turn?;
            // A gap in the sequence numbers means an unknown turn.
            if before.replace(turn.sequence) == turn.sequence.checked_sub(1) {
                trace.gyro.push((turn.stamp.seconds(), turn.turn_rad));
            }
        }
        for ranges in recording.slices(&RANGES)? {
            let (header, readings) = ranges?;
            trace.ranges.push((header.stamp.seconds(), readings));
        }
        for scan in recording.slices(&SCAN)? {
            let (header, beams) = scan?;
            trace.scans.push((header.stamp.seconds(), header, beams));
        }
        Ok(trace)
    }

    /// The first begins with the trace.
    pub fn legs(&self) -> Vec<Leg> {
        let begins = self.rolled.first().map_or(0.0, |(at, _)| *at);
        let ends = self.rolled.last().map_or(0.0, |(at, _)| *at);
        let mut legs = vec![Leg { told: Told::Stand, from_s: begins, until_s: ends }];
        for (at, told) in &self.told {
            let told = Told::of(*told);
            if let Some(last) = legs.last_mut()
                && last.told != told
            {
                last.until_s = *at;
                legs.push(Leg { told, from_s: *at, until_s: ends });
            }
        }
        legs
    }

    pub fn begins_at_rest(&self) -> bool {
        let until = self.rest_until_s();
        let (first, last) = (self.rolled.first(), self.rolled.iter().rfind(|it| it.0 < until));
        first.zip(last).is_none_or(|(first, last)| {
            zip(first.1, last.1).all(|(from, to)| (to - from).abs() < RESTS_M)
        })
    }

    pub fn rest_until_s(&self) -> f64 {
        self.legs()[0].until_s
    }
}

/// Interpolates at `at_s`, or takes the nearest value.
pub(crate) fn between<const N: usize>(values: &[(f64, [f64; N])], at_s: f64) -> Option<[f64; N]> {
    let after = values.partition_point(|(at, _)| *at < at_s);
    let (later, earlier) = (values.get(after).or(values.last())?, values.get(after.max(1) - 1)?);
    let gap = later.0 - earlier.0;
    let share = if gap > 0.0 { ((at_s - earlier.0) / gap).clamp(0.0, 1.0) } else { 1.0 };
    Some(std::array::from_fn(|i| earlier.1[i] + share * (later.1[i] - earlier.1[i])))
}
