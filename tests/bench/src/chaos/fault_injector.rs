//! Changes the bytes between robot and link as a robot fault says. Pure: bytes and times in, bytes and times out.

use std::{collections::VecDeque, time::Duration};

use common::wire::{
    Addressing, COUNT_CYCLE, Command, Decoder, Frame, Motion, MotorSensors, Quantity, Report, did,
};
use rand_pcg::{Pcg64, rand_core::Rng};

use crate::chaos::robot_fault::RobotFault;

const LATE: Duration = Duration::from_secs(2);
const LATE_FROM_BOOT: Duration = Duration::from_millis(500);
/// Age of an old frame that comes again.
const OLD: Duration = Duration::from_secs(3);
const AGAIN_EVERY: Duration = Duration::from_secs(2);
/// Period of slow frames: three a second.
const SLOW: Duration = Duration::from_millis(333);
/// The stuck echo, centimetres.
const STUCK_CM: u8 = 8;
/// The frozen echo of a ranger that has heard nothing yet, centimetres.
const FROZEN_CM: u8 = 150;
const NOTHING: u8 = 255;
/// The current of a held motor, as that of the simulated robot, AD counts.
const HELD_AD: u16 = 1520;
/// Ultrasonic bytes at the front of a standard frame's data.
const ULTRASONIC: usize = 6;
/// Motor frames that are stored: as many as come in [`OLD`] at ten times the usual rate.
const MOST_KEPT: usize = 1024;

/// Bytes for the host, and their time.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Late {
    /// Time on the clock of the incoming bytes.
    pub(crate) at: Duration,
    pub(crate) bytes: Vec<u8>,
}

/// Passes bytes unchanged until its fault begins.
#[derive(Debug)]
pub(crate) struct FaultInjector {
    fault: RobotFault,
    faulty: bool,
    chance: Pcg64,
    /// The encoder of a fault of one encoder.
    channel: usize,
    from_robot: Decoder,
    from_host: Decoder,
    /// The newest motor frame, and the last one before the fault.
    last: MotorSensors,
    base: MotorSensors,
    base_data: Vec<u8>,
    /// The newest ultrasonic bytes before the fault that are distances.
    heard: [u8; ULTRASONIC],
    /// Motor frames of the last seconds, oldest first.
    kept: VecDeque<Late>,
    next_again: Duration,
    next_slow: [Duration; 256],
    /// The last command that moved the wheels.
    moving: Option<Motion>,
    /// The newest command of a speed moves the wheels.
    pushes: bool,
    /// The link stopped the robot by other means than speed 0.
    disabled: bool,
}

impl FaultInjector {
    pub(crate) fn new(fault: RobotFault, seed: u64) -> Self {
        let mut chance = Pcg64::new(u128::from(seed), 13);
        let channel = (chance.next_u64() % 2) as usize;
        Self {
            fault,
            faulty: false,
            chance,
            channel,
            from_robot: Decoder::default(),
            from_host: Decoder::default(),
            last: MotorSensors::default(),
            base: MotorSensors::default(),
            base_data: Vec::new(),
            heard: [FROZEN_CM; ULTRASONIC],
            kept: VecDeque::new(),
            next_again: Duration::ZERO,
            next_slow: [Duration::ZERO; 256],
            moving: None,
            pushes: false,
            disabled: false,
        }
    }

    pub(crate) fn begin(&mut self) {
        if !self.faulty {
            self.faulty = true;
            self.base = self.last;
        }
    }

    /// Convert bytes that the robot sent at `now` into those for the host.
    pub(crate) fn report(&mut self, bytes: &[u8], now: Duration) -> Vec<Late> {
        let mut decoder = std::mem::take(&mut self.from_robot);
        decoder.push(bytes);
        let (mut out, mut more) = (Vec::new(), Vec::new());
        while let Some(frame) = decoder.next_frame() {
            if let Ok(Report::Motor(sensors)) = Report::parse(&frame) {
                self.last = sensors;
                if !self.faulty {
                    self.base_data = frame.data.to_vec();
                }
                self.keep(&frame, now);
            }
            if frame.did == did::STANDARD && !self.faulty {
                for (heard, &byte) in self.heard.iter_mut().zip(frame.data) {
                    if !matches!(byte, 0 | NOTHING) {
                        *heard = byte;
                    }
                }
            }
            if self.faulty {
                self.pass(&frame, now, &mut out);
            } else {
                frame.encode(&mut out);
            }
        }
        self.from_robot = decoder;
        if self.faulty && self.fault == RobotFault::OldFrames && now >= self.next_again {
            self.next_again = now + AGAIN_EVERY;
            let old = self.kept.iter().rfind(|kept| kept.at + OLD <= now);
            more.extend(old.map(|old| Late { at: now, bytes: old.bytes.clone() }));
        }
        let at = match self.fault {
            RobotFault::FramesLate if self.faulty => now + LATE,
            RobotFault::LateFromBoot if self.faulty => now + LATE_FROM_BOOT,
            _ => now,
        };
        let first = (!out.is_empty()).then_some(Late { at, bytes: out });
        first.into_iter().chain(more).collect()
    }

    /// Convert bytes of the host into those for the robot. `moves` is called for each command that moves the wheels.
    pub(crate) fn order(&mut self, bytes: &[u8], moves: &mut dyn FnMut()) -> Vec<u8> {
        let mut decoder = std::mem::take(&mut self.from_host);
        decoder.push(bytes);
        let mut out = Vec::new();
        while let Some(frame) = decoder.next_frame() {
            let command = Command::parse(&frame);
            match command {
                Ok(Command::Motion(motion)) if is_moving(&motion) => {
                    (self.moving, self.disabled, self.pushes) = (Some(motion), false, true);
                    moves();
                    if self.holds_wheels() {
                        let addressing = Addressing::of_robot(frame.rid).unwrap_or_default();
                        let stand = Command::velocity([Some(0); 2], motion.limit_ms);
                        stand.encode(addressing, &mut out);
                        continue;
                    }
                }
                Ok(Command::Motion(motion)) if motion.quantity == Quantity::Velocity => {
                    self.pushes = false;
                    if let (true, false, Some(moving)) =
                        (self.keeps_speed(), self.disabled, self.moving)
                    {
                        let addressing = Addressing::of_robot(frame.rid).unwrap_or_default();
                        Command::Motion(moving).encode(addressing, &mut out);
                        continue;
                    }
                }
                Ok(Command::Motion(_) | Command::Enable { on: false, .. }) => self.disabled = true,
                _ => {}
            }
            frame.encode(&mut out);
        }
        self.from_host = decoder;
        out
    }

    fn holds_wheels(&self) -> bool {
        self.faulty && self.fault == RobotFault::HeldWheels
    }

    fn keeps_speed(&self) -> bool {
        self.faulty && matches!(self.fault, RobotFault::DoesNotStop | RobotFault::IgnoresZero)
    }

    fn keep(&mut self, frame: &Frame<'_>, now: Duration) {
        let mut bytes = Vec::new();
        frame.encode(&mut bytes);
        self.kept.push_back(Late { at: now, bytes });
        // One frame that is older than [`OLD`] stays.
        while self.kept.len() > MOST_KEPT
            || self.kept.get(1).is_some_and(|next| next.at + OLD <= now)
        {
            self.kept.pop_front();
        }
    }

    /// Append the changed `frame` of the robot.
    fn pass(&mut self, frame: &Frame<'_>, now: Duration, out: &mut Vec<u8>) {
        let is_sensor = matches!(frame.did, did::MOTOR | did::CUSTOM | did::STANDARD);
        let with_data = |data: &[u8], out: &mut Vec<u8>| Frame { data, ..*frame }.encode(out);
        match (self.fault, frame.did) {
            (RobotFault::Silence, _) | (RobotFault::SonarMissing, did::STANDARD) => {}
            (RobotFault::StreamsStop, _) if is_sensor => {}
            (RobotFault::FramesSlow, _) if is_sensor => {
                let next = &mut self.next_slow[usize::from(frame.did)];
                if now >= *next {
                    *next = now + SLOW;
                    frame.encode(out);
                }
            }
            (RobotFault::MotorOnes, did::MOTOR) => with_data(&vec![0xff; frame.data.len()], out),
            (RobotFault::MotorZeros, did::MOTOR) => with_data(&vec![0; frame.data.len()], out),
            (RobotFault::MotorRepeated, did::MOTOR) => with_data(&self.base_data, out),
            (
                RobotFault::SonarZero
                | RobotFault::SonarStuck
                | RobotFault::SonarSilent
                | RobotFault::SonarFrozen,
                did::STANDARD,
            ) => {
                let told = match self.fault {
                    RobotFault::SonarStuck => [STUCK_CM; ULTRASONIC],
                    RobotFault::SonarSilent => [NOTHING; ULTRASONIC],
                    RobotFault::SonarFrozen => self.heard,
                    _ => [0; ULTRASONIC],
                };
                let mut data = frame.data.to_vec();
                for (byte, told) in data.iter_mut().zip(told) {
                    *byte = told;
                }
                with_data(&data, out);
            }
            (fault, did::MOTOR) => {
                let sensors = self.counted(fault, self.last);
                let addressing = Addressing::of_host(frame.rid).unwrap_or_default();
                Report::Motor(sensors).encode(addressing, out);
            }
            _ => frame.encode(out),
        }
    }

    /// The counts that the fault makes of `true_ones`.
    fn counted(&mut self, fault: RobotFault, true_ones: MotorSensors) -> MotorSensors {
        let mut told = true_ones;
        let base = self.base.encoders;
        let channel = self.channel;
        match fault {
            RobotFault::EncoderDead => {
                told.encoders[channel] = base[channel];
                told.encoders[channel].speed = 0;
            }
            RobotFault::EncodersSwapped => {
                for channel in [0, 1] {
                    let other = true_ones.encoders[1 - channel];
                    let turned = other.counts_since(&base[1 - channel]);
                    told.encoders[channel] = other;
                    told.encoders[channel].position = wrapped(base[channel].position, turned);
                }
            }
            RobotFault::EncoderReversed => {
                let turned = true_ones.encoders[channel].counts_since(&base[channel]);
                told.encoders[channel].position = wrapped(base[channel].position, -turned);
                told.encoders[channel].positive = !true_ones.encoders[channel].positive;
            }
            RobotFault::CountsRandom => {
                for encoder in &mut told.encoders {
                    let chance = self.chance.next_u64();
                    encoder.position = chance as u16 % COUNT_CYCLE;
                    encoder.speed = (chance >> 16) as u16 % 1000;
                    encoder.positive = chance >> 32 & 1 == 1;
                }
            }
            RobotFault::CountsReset => {
                for (encoder, base) in told.encoders.iter_mut().zip(&base) {
                    encoder.position = wrapped(0, encoder.counts_since(base));
                }
            }
            RobotFault::HeldWheels if self.pushes => told.currents[..2].fill(HELD_AD),
            _ => {}
        }
        told
    }
}

fn is_moving(motion: &Motion) -> bool {
    let target = |channel| motion.targets.of(channel).unwrap_or_default();
    motion.quantity == Quantity::Velocity && [0, 1].into_iter().any(|channel| target(channel) != 0)
}

/// `position` advanced by `turned` counts.
fn wrapped(position: u16, turned: i32) -> u16 {
    (i32::from(position) + turned).rem_euclid(i32::from(COUNT_CYCLE)) as u16
}

#[cfg(test)]
mod tests;
