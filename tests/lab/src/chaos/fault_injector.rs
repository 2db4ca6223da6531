//! Changes the bytes between robot and link as a robot fault demands. Pure: bytes and times in, bytes and times out.

use std::{collections::VecDeque, time::Duration};

use common::{mission::Protocol, wire::COUNT_CYCLE};

use self::words::{Effect, Readings, Said, Wheels, Words};
use crate::{chaos::robot_fault::RobotFault, random::Random};

mod words;

pub(super) const LATE: Duration = Duration::from_secs(2);
const LATE_FROM_BOOT: Duration = Duration::from_millis(500);
const RANGE_LATE: Duration = Duration::from_secs(1);
const OLD: Duration = Duration::from_secs(3);
const AGAIN_EVERY: Duration = Duration::from_secs(2);
/// Period of slow messages: three a second.
const SLOW: Duration = Duration::from_millis(333);
const RUNS_COUNTS_S: f64 = 150.0;
/// Messages that are stored: as many as come in [`OLD`] at ten times the usual rate.
const MOST_KEPT: usize = 1024;

/// Bytes for the host, and their time.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Late {
    /// Time on the clock of the incoming bytes.
    pub at: Duration,
    pub bytes: Vec<u8>,
}

/// Passes bytes unchanged until its fault begins.
#[derive(Debug)]
pub struct FaultInjector {
    fault: RobotFault,
    faulty: bool,
    /// Of the first message that the fault changed.
    began: Option<Duration>,
    chance: Random,
    channel: usize,
    words: Words,
    base: Option<Said>,
    readings: Readings,
    /// Whether the newest message with wheels says that one turns.
    turns: bool,
    /// Messages with wheels or readings of the last seconds, oldest first.
    kept: VecDeque<(Duration, Said)>,
    next_again: Duration,
    next_slow: [Duration; 256],
    moving: Option<Vec<u8>>,
    /// Whether the newest command of a speed moves the wheels.
    pushes: bool,
    /// Whether the link stopped the robot by other means than speed 0.
    disabled: bool,
}

impl FaultInjector {
    pub fn new(fault: RobotFault, protocol: Protocol, seed: u64) -> Self {
        let mut chance = Random::new(seed, 13);
        let channel = (chance.bits() % 2) as usize;
        Self {
            fault,
            faulty: false,
            began: None,
            chance,
            channel,
            words: Words::of(protocol),
            base: None,
            readings: Readings::default(),
            turns: false,
            kept: VecDeque::new(),
            next_again: Duration::ZERO,
            next_slow: [Duration::ZERO; 256],
            moving: None,
            pushes: false,
            disabled: false,
        }
    }

    pub const fn begin(&mut self) {
        self.faulty = true;
    }

    /// Convert bytes that the robot sent at `now` into those for the host.
    pub fn report(&mut self, bytes: &[u8], now: Duration) -> Vec<Late> {
        let (mut out, mut more) = (Vec::new(), Vec::new());
        for said in self.words.said(bytes) {
            self.keep(&said, now);
            if let Some(wheels) = said.wheels(&said) {
                self.turns = wheels.speeds != [0.0; 2];
                if !self.faulty {
                    self.base = Some(said.clone());
                }
            }
            if self.faulty {
                out.extend(self.changed(said, now));
            } else {
                self.readings.take(&said);
            }
        }
        if !self.faulty {
            out = bytes.to_vec();
        }
        if self.faulty && self.fault == RobotFault::OldFrames && now >= self.next_again {
            self.next_again = now + AGAIN_EVERY;
            let is_old =
                |(at, said): &&(Duration, Said)| *at + OLD <= now && said.wheels(said).is_some();
            let old = self.kept.iter().rfind(is_old);
            more.extend(old.map(|(_, old)| Late { at: now, bytes: old.bytes() }));
        }
        let at = match self.fault {
            RobotFault::FramesLate if self.faulty => now + LATE,
            RobotFault::LateFromBoot | RobotFault::LateMidway if self.faulty => {
                now + LATE_FROM_BOOT
            }
            _ => now,
        };
        let first = (!out.is_empty()).then_some(Late { at, bytes: out });
        first.into_iter().chain(more).collect()
    }

    /// Convert bytes of the host into those for the robot. `moves` is called for each command that moves the wheels.
    pub fn order(&mut self, bytes: &[u8], moves: &mut dyn FnMut()) -> Vec<u8> {
        let mut out = Vec::new();
        for ordered in self.words.ordered(bytes) {
            let mut bytes = ordered.bytes;
            match ordered.effect {
                Effect::Moves { stand } => {
                    (self.disabled, self.pushes) = (false, true);
                    self.moving = Some(bytes.clone());
                    moves();
                    if self.holds_wheels() {
                        bytes = stand;
                    }
                }
                Effect::Stands => {
                    self.pushes = false;
                    if let (true, false, Some(moving)) =
                        (self.keeps_speed(), self.disabled, &self.moving)
                    {
                        bytes.clone_from(moving);
                    }
                }
                Effect::Disables => self.disabled = true,
                Effect::Other => {}
            }
            out.extend(bytes);
        }
        out
    }

    fn holds_wheels(&self) -> bool {
        self.faulty && self.fault == RobotFault::HeldWheels
    }

    fn keeps_speed(&self) -> bool {
        self.faulty && matches!(self.fault, RobotFault::DoesNotStop | RobotFault::IgnoresZero)
    }

    fn keep(&mut self, said: &Said, now: Duration) {
        if said.stream().is_none() {
            return;
        }
        self.kept.push_back((now, said.clone()));
        if self.kept.len() > MOST_KEPT {
            self.kept.pop_front();
        }
    }

    /// The bytes into which the fault changes the message `said`.
    fn changed(&mut self, said: Said, now: Duration) -> Vec<u8> {
        use RobotFault as F;
        match self.fault {
            F::Silence => Vec::new(),
            F::StreamsStop if said.stream().is_some() => Vec::new(),
            F::FramesSlow => {
                if let Some(stream) = said.stream() {
                    let next = &mut self.next_slow[usize::from(stream)];
                    if now < *next {
                        return Vec::new();
                    }
                    *next = now + SLOW;
                }
                said.bytes()
            }
            F::Garbage => {
                let mut bytes = said.bytes();
                bytes.truncate(bytes.len() / 2);
                bytes.push(b'\n');
                bytes
            }
            F::MotorOnes => said.with_data(0xff),
            F::MotorZeros => said.with_data(0),
            F::RangeLate => {
                let is_old = |(at, old): &&(Duration, Said)| {
                    *at + RANGE_LATE <= now && old.readings() == said.readings()
                };
                let old = self.kept.iter().rfind(is_old).filter(|_| said.readings().is_some());
                match old {
                    Some((_, old)) => said.with_readings_of(old),
                    None => said.bytes(),
                }
            }
            F::RangeDeaf if !self.turns => said.bytes(),
            F::RangeInvalid
            | F::RangeMissing
            | F::RangeStuck
            | F::RangeSilent
            | F::RangeFrozen
            | F::RangeNear
            | F::RangeRandom
            | F::RangeDeaf => said.with_readings(self.fault, &self.readings, &mut self.chance),
            fault => {
                let base = self.base.get_or_insert_with(|| said.clone());
                self.began.get_or_insert(now);
                let (Some(wheels), Some(before)) = (said.wheels(base), base.wheels(base)) else {
                    return said.bytes();
                };
                if fault == F::MotorRepeated {
                    return base.bytes();
                }
                let told = self.counted(fault, wheels, before, now);
                said.with_wheels(&told, self.holds_wheels() && self.pushes)
            }
        }
    }

    /// The wheels into which the fault changes `true_ones`, which were at `base` when it began.
    fn counted(
        &mut self,
        fault: RobotFault,
        true_ones: Wheels,
        base: Wheels,
        now: Duration,
    ) -> Wheels {
        let mut told = true_ones;
        let channel = self.channel;
        let turned = [0, 1].map(|wheel| true_ones.counts[wheel] - base.counts[wheel]);
        match fault {
            RobotFault::EncoderDead => {
                told.counts[channel] = base.counts[channel];
                told.speeds[channel] = 0.0;
            }
            RobotFault::EncodersSwapped => {
                for channel in [0, 1] {
                    told.counts[channel] = base.counts[channel] + turned[1 - channel];
                    told.speeds[channel] = true_ones.speeds[1 - channel];
                }
            }
            RobotFault::EncoderReversed => {
                told.counts[channel] = base.counts[channel] - turned[channel];
                told.speeds[channel] = -true_ones.speeds[channel];
            }
            RobotFault::EncoderLow | RobotFault::EncoderLower => {
                let share = if fault == RobotFault::EncoderLow { 0.95 } else { 0.8 };
                told.counts[channel] = base.counts[channel] + share * turned[channel];
                told.speeds[channel] *= share;
            }
            RobotFault::EncoderRuns => {
                let since_s = now.saturating_sub(self.began.unwrap_or(now)).as_secs_f64();
                told.counts[channel] += RUNS_COUNTS_S * since_s;
                told.speeds[channel] += RUNS_COUNTS_S;
            }
            RobotFault::CountsRandom => {
                for wheel in [0, 1] {
                    let chance = self.chance.bits();
                    let speed = f64::from((chance >> 16) as u16 % 1000);
                    told.counts[wheel] = f64::from(chance as u16 % COUNT_CYCLE);
                    told.speeds[wheel] = if chance >> 32 & 1 == 1 { speed } else { -speed };
                }
            }
            RobotFault::CountsReset => told.counts = turned,
            _ => {}
        }
        told
    }
}

#[cfg(test)]
mod tests;
