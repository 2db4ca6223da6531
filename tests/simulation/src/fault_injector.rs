//! Changes the bytes between robot and link as a faulty robot would.

use std::{collections::VecDeque, time::Duration};

use common::{json_wire::Report, mission::Protocol, wire::COUNT_CYCLE};

use self::words::{COUNT_RAD, Effect, Said, Words};
use crate::{random::Random, robot_fault::RobotFault};

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
/// Noise of readings near a frozen one. A tenth of it is the relative noise of beams.
const NEAR_M: [f64; 2] = [0.005, 0.05];
const DRIFTS_DEG_S: [f64; 2] = [1.0, 6.0];
const SATURATES_DEG_S: [f64; 2] = [40.0, 10.0];
const JUMPS_RAD_S: f64 = 1.0;
const RANDOM_COUNTS_S: f64 = 1000.0;
const RANDOM_M: f64 = 2.5;
const WIDE_M: [f64; 2] = [1.9, 2.4];
const NO_READING: f64 = -1.0;
/// Frozen range of a sensor without earlier readings.
const FROZEN_M: f64 = 1.5;
/// Maximum stored messages: those of [`OLD`] at ten times the usual rate.
const MOST_KEPT: usize = 1024;

#[derive(Debug)]
pub(crate) struct Late {
    pub at: Duration,
    pub bytes: Vec<u8>,
}

/// Passes bytes unchanged while no fault acts.
#[derive(Default)]
pub(crate) struct FaultInjector {
    fault: Option<RobotFault>,
    /// Time of the first wheel message that the fault changed.
    began: Option<Duration>,
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
    /// Angle of the gyro and the one told, before.
    gyro: Option<[f64; 2]>,
}

impl FaultInjector {
    pub(crate) fn new(protocol: Protocol, seed: u64) -> Self {
        let chance = Random::new(seed, 13);
        Self { chance, words: Words::of(protocol), ..Self::default() }
    }

    /// Draws the size of `fault` and the wheel that it affects. The fault acts until the next one
    /// or, without a fault, ends.
    pub(crate) fn set(&mut self, fault: Option<RobotFault>) {
        (self.fault, self.began) = (fault, None);
        (self.channel, self.size) = (self.chance.below(2), self.chance.share());
    }

    /// Converts the robot's bytes into those for the host.
    pub(crate) fn report(&mut self, bytes: &[u8], now: Duration) -> Vec<Late> {
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
    pub(crate) fn order(&mut self, bytes: &[u8]) -> Vec<u8> {
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
        let Report { ranges, scan, scans, .. } = &said.report;
        let distances = ranges.iter().filter(|(_, range)| range.is_some_and(|range| range >= 0.0));
        self.newest.ranges.extend(distances.map(|(name, range)| (name.clone(), *range)));
        self.newest.scans.extend(scans.clone());
        self.newest.scan = scan.clone().or(self.newest.scan.take());
        if said.report.wheels.is_some() {
            self.base = Some(said);
        }
    }

    fn changed(&mut self, fault: RobotFault, mut said: Said, now: Duration) -> Vec<u8> {
        use RobotFault as F;
        match fault {
            F::Silence => return Vec::new(),
            F::StreamsStop if said.stream().is_some() => return Vec::new(),
            F::FramesSlow => {
                if let Some(stream) = said.stream() {
                    let next = &mut self.next_slow[stream];
                    if now < *next {
                        return Vec::new();
                    }
                    *next = now + SLOW;
                }
            }
            F::Garbage => {
                let bytes = said.bytes();
                return [&bytes[..bytes.len() / 2], b"\n"].concat();
            }
            F::MotorOnes => return said.with_data(0xff),
            F::MotorZeros => return said.with_data(0),
            F::RangeMissing if said.is_frame() && !said.report.ranges.is_empty() => {
                return Vec::new();
            }
            F::RangeMissing => {
                let Report { ranges, scan, scans, .. } = &mut said.report;
                (*ranges, *scan, *scans) = Default::default();
            }
            F::RangeLate => {
                let kind = said.readings();
                let age = Duration::from_secs_f64(self.drawn(RANGE_LATE_S));
                let old = self.old(now, age, |old| old.readings() == kind);
                if let Some(old) = old.filter(|_| kind.contains(&true)) {
                    said = said.with_readings_of(old.clone());
                }
            }
            F::RangeDeaf if self.newest_speeds().is_none_or(|speeds| speeds == [0.0; 2]) => {}
            F::RangeInvalid
            | F::RangeStuck
            | F::RangeSilent
            | F::RangeFrozen
            | F::RangeNear
            | F::RangeRandom
            | F::RangeDeaf => self.misread(fault, &mut said),
            F::SonarsDeaf => {
                let sonars = said.report.ranges.values_mut();
                sonars.skip(self.channel).step_by(2).for_each(|range| *range = None);
            }
            F::FrontStuck | F::FrontWide => {
                if let Some((name, range)) = said.report.ranges.iter_mut().next() {
                    let before = self.newest.ranges.get(name).copied().flatten();
                    let stuck = before.or(*range).unwrap_or(FROZEN_M);
                    let wide = self.chance.within(WIDE_M[0], WIDE_M[1]);
                    *range = Some(if fault == F::FrontStuck { stuck } else { wide });
                }
            }
            F::GyroStops | F::GyroDrifts | F::GyroSaturates => {
                self.misturn(fault, &mut said.report, now);
            }
            _ => self.miscount(fault, &mut said, now),
        }
        said.bytes()
    }

    fn newest_speeds(&self) -> Option<[f64; 2]> {
        self.kept.iter().rev().find_map(|(_, said)| said.report.speeds)
    }

    fn misread(&mut self, fault: RobotFault, said: &mut Said) {
        use RobotFault as F;
        let near_m = self.drawn(NEAR_M);
        let chance = &mut self.chance;
        let [stuck_m, least_m] = said.stuck_and_least_m();
        let Report { ranges, scan, scans, .. } = &mut said.report;
        if matches!(fault, F::RangeFrozen | F::RangeNear) {
            for (name, range) in &mut *ranges {
                *range = self.newest.ranges.get(name).copied().unwrap_or(Some(FROZEN_M));
            }
            *scan = scan.take().and(self.newest.scan.clone());
            if !scans.is_empty() {
                scans.clone_from(&self.newest.scans);
            }
        }
        let mut told = |read: Option<f64>, is_beam: bool| match fault {
            F::RangeFrozen => read,
            F::RangeNear if is_beam => {
                read.map(|beam| beam * (1.0 + chance.within(-near_m, near_m) / 10.0))
            }
            F::RangeNear => read.map(|range| range + chance.within(-near_m, near_m)),
            F::RangeRandom => Some(chance.within(least_m, RANDOM_M)),
            F::RangeStuck => Some(stuck_m),
            F::RangeInvalid => Some(NO_READING),
            _ => None,
        };
        ranges.values_mut().for_each(|range| *range = told(*range, false));
        let named = scans.values_mut().flat_map(|scan| &mut scan.ranges);
        for beam in scan.iter_mut().flatten().chain(named) {
            *beam = told(beam.map(f64::from), true).map(|beam| beam as f32);
        }
    }

    /// Changes the turn of the gyro since its last report.
    fn misturn(&mut self, fault: RobotFault, report: &mut Report, now: Duration) {
        let Some(angle) = &mut report.gyro else { return };
        let for_s = now.saturating_sub(self.began.replace(now).unwrap_or(now)).as_secs_f64();
        let [before, told] = self.gyro.unwrap_or([*angle; 2]);
        let turn = *angle - before;
        let turn = match fault {
            RobotFault::GyroStops => 0.0,
            RobotFault::GyroDrifts => turn + self.drawn(DRIFTS_DEG_S).to_radians() * for_s,
            _ => {
                let most = self.drawn(SATURATES_DEG_S).to_radians() * for_s;
                turn.clamp(-most, most)
            }
        };
        self.gyro = Some([*angle, told + turn]);
        *angle = told + turn;
    }

    /// Changes the wheels of `said`, relative to those before the fault.
    fn miscount(&mut self, fault: RobotFault, said: &mut Said, now: Duration) {
        use RobotFault as F;
        let Some(mut angles) = said.report.wheels else { return };
        let mut speeds = said.report.speeds.unwrap_or_default();
        let base = self.base.get_or_insert_with(|| said.clone());
        if fault == F::MotorRepeated {
            *said = base.clone();
            return;
        }
        let before = base.report.wheels.unwrap_or(angles);
        let since_s = now.saturating_sub(*self.began.get_or_insert(now)).as_secs_f64();
        let [low, lower, runs] = [LOW, LOWER, RUNS_COUNTS_S].map(|range| self.drawn(range));
        let (channel, chance) = (self.channel, &mut self.chance);
        let turned = [0, 1].map(|wheel| angles[wheel] - before[wheel]);
        let mut counts_share = |share: f64| {
            angles[channel] = before[channel] + share * turned[channel];
            speeds[channel] *= share;
        };
        match fault {
            F::EncoderDead => counts_share(0.0),
            F::EncoderReversed => counts_share(-1.0),
            F::EncoderLow => counts_share(low),
            F::EncoderLower => counts_share(lower),
            F::EncodersSwapped => {
                angles = [0, 1].map(|wheel| before[wheel] + turned[1 - wheel]);
                speeds.reverse();
            }
            F::EncoderRuns => {
                angles[channel] += runs * COUNT_RAD * since_s;
                speeds[channel] += runs * COUNT_RAD;
            }
            F::CountsRandom => {
                let mut random = |least, most| chance.within(least, most) * COUNT_RAD;
                angles = [(); 2].map(|()| random(0.0, COUNT_CYCLE.into()));
                speeds = [(); 2].map(|()| random(-RANDOM_COUNTS_S, RANDOM_COUNTS_S));
            }
            F::CountsReset => angles = turned,
            F::CountsJump => angles[channel] += JUMPS_RAD_S * since_s.floor(),
            F::HeldWheels if self.pushes => said.report.held = Some([true; 2]),
            _ => {}
        }
        (said.report.wheels, said.report.speeds) = (Some(angles), Some(speeds));
    }
}

#[cfg(test)]
mod tests;
