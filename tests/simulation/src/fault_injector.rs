//! Changes the bytes between robot and link as a faulty robot would.

use std::{collections::VecDeque, time::Duration};

use common::{json_wire::Report, mission::Mission, wire::COUNT_CYCLE};

use self::{
    lie::{Change, Lie, Stream},
    words::{COUNT_RAD, Effect, Said, Words},
};
use crate::{random::Random, robot_fault::RobotFault};

pub mod lie;
mod words;

const LATE: Duration = Duration::from_secs(2);
/// Delays of late but received frames, seconds; each mission draws one from such a range.
const A_LITTLE_LATE_S: [f64; 2] = [0.25, 1.0];
const RANGE_LATE_S: [f64; 2] = [0.3, 2.0];
const OLD: Duration = Duration::from_secs(3);
const AGAIN_EVERY: Duration = Duration::from_secs(2);
const SLOW: Duration = Duration::from_millis(333);
/// Share of its counts that an encoder reports.
const LOW: [f64; 2] = [0.97, 0.90];
const LOWER: [f64; 2] = [0.90, 0.65];
const RUNS_COUNTS_S: [f64; 2] = [50.0, 300.0];
/// Noise of readings near a frozen one.
const NEAR_M: [f64; 2] = [0.005, 0.05];
const DRIFTS_DEG_S: [f64; 2] = [1.0, 6.0];
const SATURATES_DEG_S: [f64; 2] = [40.0, 10.0];
const JUMPS_RAD_S: f64 = 1.0;
const RANDOM_COUNTS_S: f64 = 1000.0;
const RANDOM_M: [f64; 2] = [0.2, 2.5];
const WIDE_M: [f64; 2] = [1.9, 2.4];
const NO_READING: f64 = -1.0;
/// Maximum stored messages: those of [`OLD`] at ten times the usual rate.
const MOST_KEPT: usize = 1024;

pub struct Late {
    pub at: Duration,
    pub bytes: Vec<u8>,
}

/// Passes bytes unchanged while no fault acts.
#[derive(Default)]
pub struct FaultInjector {
    fault: Option<RobotFault>,
    chance: Random,
    channel: usize,
    size: f64,
    words: Words,
    base: Option<Said>,
    newest: Report,
    kept: VecDeque<(Duration, Said)>,
    next_again: Duration,
    next_slow: [Duration; 4],
    /// Newest moving command; none once the link stopped the robot other than by speed 0.
    moving: Option<Vec<u8>>,
    pushes: bool,
    /// Lie of the mission's seed, and the present one.
    drawn: Option<Lie>,
    lie: Option<Lie>,
}

impl FaultInjector {
    pub fn new(mission: &Mission, seed: u64) -> Self {
        let words = Words::of(mission.robot.protocol());
        let drawn = Some(Lie::draw(mission));
        Self { chance: Random::new(seed, 13), words, drawn, ..Self::default() }
    }

    /// Draws the size of `fault` and the wheel that it affects. The fault acts until the next one
    /// or, without a fault, ends.
    pub fn set(&mut self, fault: Option<RobotFault>) {
        self.fault = fault;
        (self.channel, self.size) = (self.chance.below(2), self.chance.share());
        self.lie = fault.and_then(|fault| self.lie_of(fault));
    }

    fn lie_of(&mut self, fault: RobotFault) -> Option<Lie> {
        use Change::*;
        use RobotFault::*;
        use Stream::*;
        let wheel = Wheel(self.channel);
        let (stream, change) = match fault {
            EncoderDead => (wheel, Scaled(0.0)),
            EncoderReversed => (wheel, Scaled(-1.0)),
            EncoderLow => (wheel, Scaled(self.drawn(LOW))),
            EncoderLower => (wheel, Scaled(self.drawn(LOWER))),
            EncoderRuns => (wheel, Drifts(self.drawn(RUNS_COUNTS_S) * COUNT_RAD)),
            CountsJump => (wheel, Jumps(JUMPS_RAD_S)),
            GyroStops => (Gyro, Stuck),
            GyroDrifts => (Gyro, Drifts(self.drawn(DRIFTS_DEG_S).to_radians())),
            GyroSaturates => (Gyro, Capped(self.drawn(SATURATES_DEG_S).to_radians())),
            RangeInvalid => (AllRanges, Wild(1.0, [NO_READING; 2])),
            RangeStuck => (AllRanges, Wild(1.0, [self.words.stuck_m(); 2])),
            RangeFrozen => (AllRanges, Stuck),
            RangeNear => (AllRanges, Near(self.drawn(NEAR_M))),
            RangeRandom => (AllRanges, Wild(1.0, RANDOM_M)),
            RangeSilent | RangeDeaf => (AllRanges, Deaf(1.0)),
            SonarsDeaf => (HalfOfRanges(self.channel), Deaf(1.0)),
            FrontStuck => (Range(0), Stuck),
            FrontWide => (Range(0), Wild(1.0, WIDE_M)),
            Drawn => return self.drawn.clone(),
            _ => return None,
        };
        Some(Lie::new(stream, change, self.chance.bits()))
    }

    /// Converts the robot's bytes into those for the host.
    pub fn report(&mut self, bytes: &[u8], now: Duration) -> Vec<Late> {
        let mut out = Vec::new();
        for said in self.words.said(bytes) {
            if said.stream().is_some() {
                self.kept.push_back((now, said.clone()));
                self.kept.drain(..self.kept.len().saturating_sub(MOST_KEPT));
            }
            match self.fault {
                Some(fault) => out.extend(self.changed(fault, said, now)),
                None => self.note(said),
            }
        }
        let Some(fault) = self.fault else {
            return vec![Late { at: now, bytes: bytes.to_vec() }];
        };
        let late = match fault {
            RobotFault::FramesLate => LATE,
            RobotFault::LateFromBoot | RobotFault::LateMidway => {
                Duration::from_secs_f64(self.drawn(A_LITTLE_LATE_S))
            }
            _ => Duration::ZERO,
        };
        let mut passed = vec![Late { at: now + late, bytes: out }];
        if fault == RobotFault::OldFrames && now >= self.next_again {
            self.next_again = now + AGAIN_EVERY;
            let old = self.old(now, OLD, |said| said.report.wheels.is_some());
            passed.extend(old.map(|old| Late { at: now, bytes: old.bytes() }));
        }
        passed.retain(|late| !late.bytes.is_empty());
        passed
    }

    fn drawn(&self, [least, greatest]: [f64; 2]) -> f64 {
        least + self.size * (greatest - least)
    }

    fn old(&self, now: Duration, age: Duration, of_kind: impl Fn(&Said) -> bool) -> Option<&Said> {
        let old = self.kept.iter().rfind(|(at, said)| *at + age <= now && of_kind(said));
        old.map(|(_, said)| said)
    }

    /// Converts the host's bytes into those for the robot.
    pub fn order(&mut self, bytes: &[u8]) -> Vec<u8> {
        let holds_wheels = self.fault == Some(RobotFault::HeldWheels);
        // A robot at rest has no speed to keep.
        let rests = self.newest_speeds() == Some([0.0; 2]);
        let keeps_speed = !rests && self.fault.is_some_and(RobotFault::keeps_speed);
        let mut out = Vec::new();
        for (mut bytes, effect) in self.words.ordered(bytes) {
            match effect {
                Effect::Moves { stand } => {
                    (self.moving, self.pushes) = (Some(bytes.clone()), true);
                    if holds_wheels {
                        bytes = stand;
                    }
                }
                Effect::Stands => {
                    self.pushes = false;
                    bytes = self.moving.clone().filter(|_| keeps_speed).unwrap_or(bytes);
                }
                Effect::Disables => self.moving = None,
                Effect::Other => {}
            }
            out.extend(bytes);
        }
        out
    }

    fn note(&mut self, said: Said) {
        let Report { ranges, scan, scans, wheels, gyro, .. } = &said.report;
        (self.newest.wheels, self.newest.gyro) =
            (wheels.or(self.newest.wheels), gyro.or(self.newest.gyro));
        let distances = ranges.iter().filter(|(_, range)| range.is_some_and(|range| range >= 0.0));
        self.newest.ranges.extend(distances.map(|(name, range)| (name.clone(), *range)));
        self.newest.scans.extend(scans.clone());
        self.newest.scan = scan.clone().or(self.newest.scan.take());
        if said.report.wheels.is_some() {
            self.base = Some(said);
        }
    }

    fn changed(&mut self, fault: RobotFault, mut said: Said, now: Duration) -> Vec<u8> {
        use RobotFault::*;
        match fault {
            Silence => return Vec::new(),
            StreamsStop if said.stream().is_some() => return Vec::new(),
            FramesSlow => {
                if let Some(stream) = said.stream() {
                    let next = &mut self.next_slow[stream];
                    if now < *next {
                        return Vec::new();
                    }
                    *next = now + SLOW;
                }
            }
            Garbage => {
                let bytes = said.bytes();
                return [&bytes[..bytes.len() / 2], b"\n"].concat();
            }
            MotorOnes => return said.with_data(0xff),
            MotorZeros => return said.with_data(0),
            RangeMissing if said.is_frame() && !said.report.ranges.is_empty() => {
                return Vec::new();
            }
            RangeMissing => {
                let Report { ranges, scan, scans, .. } = &mut said.report;
                (*ranges, *scan, *scans) = Default::default();
            }
            RangeLate => {
                let kind = said.readings();
                let age = Duration::from_secs_f64(self.drawn(RANGE_LATE_S));
                let old = self.old(now, age, |old| old.readings() == kind);
                if let Some(old) = old.filter(|_| kind.contains(&true)) {
                    said = said.with_readings_of(old.clone());
                }
            }
            RangeDeaf if self.newest_speeds().is_none_or(|speeds| speeds == [0.0; 2]) => {}
            _ if self.lie.is_some() => {
                let lie = self.lie.iter_mut();
                lie.for_each(|lie| lie.change(&mut said.report, &self.newest, now));
            }
            _ => self.miscount(fault, &mut said),
        }
        said.bytes()
    }

    fn newest_speeds(&self) -> Option<[f64; 2]> {
        self.kept.iter().rev().find_map(|(_, said)| said.report.speeds)
    }

    /// Changes the wheels of `said`, relative to those before the fault.
    fn miscount(&mut self, fault: RobotFault, said: &mut Said) {
        use RobotFault::*;
        let Some(mut angles) = said.report.wheels else { return };
        let mut speeds = said.report.speeds.unwrap_or_default();
        let base = self.base.get_or_insert_with(|| said.clone());
        if fault == MotorRepeated {
            *said = base.clone();
            return;
        }
        let before = base.report.wheels.unwrap_or(angles);
        let turned = [0, 1].map(|wheel| angles[wheel] - before[wheel]);
        match fault {
            EncodersSwapped => {
                angles = [0, 1].map(|wheel| before[wheel] + turned[1 - wheel]);
                speeds.reverse();
            }
            CountsRandom => {
                let mut random = |least, most| self.chance.within(least, most) * COUNT_RAD;
                angles = [(); 2].map(|()| random(0.0, COUNT_CYCLE.into()));
                speeds = [(); 2].map(|()| random(-RANDOM_COUNTS_S, RANDOM_COUNTS_S));
            }
            CountsReset => angles = turned,
            HeldWheels if self.pushes => said.report.held = Some([true; 2]),
            _ => {}
        }
        (said.report.wheels, said.report.speeds) = (Some(angles), Some(speeds));
    }
}

#[cfg(test)]
mod tests;
