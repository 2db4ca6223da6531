//! The messages of robot and host in either protocol, as far as faults change them.

use std::{collections::BTreeMap, f64::consts::TAU};

use common::{
    json_wire::{self, Lines, line, parse},
    mission::Protocol,
    wire::{
        Addressing, COUNT_CYCLE, Command, Decoder, Frame, Motion, MotorSensors, Quantity, Report,
        did,
    },
};

use crate::{chaos::robot_fault::RobotFault, random::Random};

/// The stuck echo of a sonar, centimetres, and the stuck range of a robot that speaks lines of JSON, metres.
pub const STUCK_CM: u8 = 8;
pub const STUCK_M: f64 = 0.3;
/// The frozen echo of a sonar that has heard nothing yet, centimetres.
const FROZEN_CM: u8 = 150;
const NOTHING: u8 = 255;
/// The value for no reading of a robot that speaks lines of JSON.
const NO_READING: f64 = -1.0;
/// The current of a held motor, as that of the simulated robot, AD counts.
const HELD_AD: u16 = 1520;
/// Ultrasonic bytes at the front of a standard frame's data.
const ULTRASONIC: usize = 6;
/// The angle of a count, radians, in messages with angles: that of an X80.
const COUNT_RAD: f64 = TAU / 1200.0;

/// Converts bytes to the messages of one protocol.
#[derive(Debug)]
pub enum Words {
    X80 { robot: Decoder, host: Decoder },
    Json { robot: Lines, host: Lines },
}

impl Words {
    pub fn of(protocol: Protocol) -> Self {
        match protocol {
            Protocol::X80 => Self::X80 { robot: Decoder::default(), host: Decoder::default() },
            // Robots of ROS 2 are simulated with JSON, and those with an Arduino have no fault on a wire.
            Protocol::Json | Protocol::Arduino | Protocol::Ros2 => {
                Self::Json { robot: Lines::default(), host: Lines::default() }
            }
        }
    }

    pub fn said(&mut self, bytes: &[u8]) -> Vec<Said> {
        match self {
            Self::X80 { robot, .. } => frames(robot, bytes, |frame| {
                let Frame { rid, did, data, .. } = *frame;
                Said::Frame { rid, did, data: data.to_vec() }
            }),
            Self::Json { robot, .. } => {
                let lines = robot.push(bytes).into_iter();
                lines.filter_map(|line| parse(&line).ok()).map(Said::Line).collect()
            }
        }
    }

    pub fn ordered(&mut self, bytes: &[u8]) -> Vec<Ordered> {
        match self {
            Self::X80 { host, .. } => frames(host, bytes, Ordered::of_frame),
            Self::Json { host, .. } => host.push(bytes).into_iter().map(Ordered::of_line).collect(),
        }
    }
}

fn frames<T>(decoder: &mut Decoder, bytes: &[u8], of: impl Fn(&Frame<'_>) -> T) -> Vec<T> {
    decoder.push(bytes);
    let mut all = Vec::new();
    while let Some(frame) = decoder.next_frame() {
        all.push(of(&frame));
    }
    all
}

#[allow(clippy::large_enum_variant, reason = "one is held at a time")]
#[derive(Clone, Debug)]
pub enum Said {
    Frame { rid: u8, did: u8, data: Vec<u8> },
    Line(json_wire::Report),
}

/// The left and the right wheel, or the two channels of an X80: counts and counts/s.
#[derive(Clone, Copy, Debug, Default)]
pub struct Wheels {
    pub counts: [f64; 2],
    pub speeds: [f64; 2],
}

/// The newest readings of a robot that are distances.
#[derive(Debug)]
pub struct Readings {
    ultrasonic: [u8; ULTRASONIC],
    ranges: BTreeMap<String, Option<f64>>,
    scan: Option<Vec<Option<f32>>>,
    scans: BTreeMap<String, json_wire::Scan>,
}

impl Default for Readings {
    fn default() -> Self {
        let (ranges, scans) = Default::default();
        Self { ultrasonic: [FROZEN_CM; ULTRASONIC], ranges, scan: None, scans }
    }
}

impl Readings {
    pub fn take(&mut self, said: &Said) {
        match said {
            Said::Frame { did: did::STANDARD, data, .. } => {
                for (newest, &byte) in self.ultrasonic.iter_mut().zip(data) {
                    if !matches!(byte, 0 | NOTHING) {
                        *newest = byte;
                    }
                }
            }
            Said::Frame { .. } => {}
            Said::Line(report) => {
                let distances = report.ranges.iter().filter(|(_, range)| range.is_some());
                self.ranges.extend(distances.map(|(name, range)| (name.clone(), *range)));
                self.scans.extend(report.scans.clone());
                self.scan = report.scan.clone().or(self.scan.take());
            }
        }
    }
}

impl Said {
    pub fn bytes(&self) -> Vec<u8> {
        match self {
            Self::Frame { rid, did, data } => {
                let mut bytes = Vec::new();
                Frame { rid: *rid, sn: 0, did: *did, data }.encode(&mut bytes);
                bytes
            }
            Self::Line(report) => line(report),
        }
    }

    /// The kind of message by its readings; none without any.
    pub fn readings(&self) -> Option<u8> {
        match self {
            Self::Frame { did, .. } => {
                Some(*did).filter(|did| matches!(*did, did::CUSTOM | did::STANDARD))
            }
            Self::Line(report) => {
                let kind =
                    u8::from(report.scan.is_some()) + 2 * u8::from(!report.ranges.is_empty());
                Some(kind).filter(|kind| *kind > 0)
            }
        }
    }

    /// The message with the readings of `old`, of the same kind.
    pub fn with_readings_of(self, old: &Self) -> Vec<u8> {
        match (self, old) {
            (Self::Line(report), Self::Line(old)) => {
                let (ranges, scan) = (old.ranges.clone(), old.scan.clone());
                line(&json_wire::Report { ranges, scan, ..report })
            }
            (_, old) => old.bytes(),
        }
    }

    /// The sensor stream to which the message belongs; none for an answer.
    pub fn stream(&self) -> Option<u8> {
        match self {
            Self::Frame { did, .. } => {
                Some(*did).filter(|did| matches!(*did, did::MOTOR | did::CUSTOM | did::STANDARD))
            }
            Self::Line(report) if report.wheels.is_some() => Some(0),
            Self::Line(report) => {
                let scans = report.scan.is_some() || !report.scans.is_empty();
                (scans || !report.ranges.is_empty()).then_some(1)
            }
        }
    }

    fn motor(&self) -> Option<MotorSensors> {
        let Self::Frame { rid, did: did::MOTOR, data } = self else {
            return None;
        };
        match Report::parse(&Frame { rid: *rid, sn: 0, did: did::MOTOR, data }) {
            Ok(Report::Motor(sensors)) => Some(sensors),
            _ => None,
        }
    }

    /// The wheels of the message, counted on from those of `base`.
    pub fn wheels(&self, base: &Self) -> Option<Wheels> {
        if let Self::Line(report) = self {
            let counts = |angles: [f64; 2]| angles.map(|angle| angle / COUNT_RAD);
            let speeds = counts(report.speeds.unwrap_or_default());
            return Some(Wheels { counts: counts(report.wheels?), speeds });
        }
        let (now, base) = (self.motor()?.encoders, base.motor()?.encoders);
        let counts = |channel: usize| {
            let turned = now[channel].counts_since(&base[channel]);
            f64::from(i32::from(base[channel].position) + turned)
        };
        Some(Wheels {
            counts: [0, 1].map(counts),
            speeds: now.map(|encoder| encoder.velocity().into()),
        })
    }

    /// The message with other `wheels`; `held` if something holds both.
    pub fn with_wheels(mut self, wheels: &Wheels, held: bool) -> Vec<u8> {
        if let Some(mut sensors) = self.motor() {
            for (channel, encoder) in sensors.encoders.iter_mut().enumerate() {
                let speed = wheels.speeds[channel];
                encoder.position = wheels.counts[channel].rem_euclid(COUNT_CYCLE.into()) as u16;
                encoder.speed = speed.abs() as u16;
                encoder.positive = speed > 0.0;
            }
            if held {
                sensors.currents[..2].fill(HELD_AD);
            }
            return report(&self, sensors);
        }
        if let Self::Line(report) = &mut self {
            let angles = |counts: [f64; 2]| Some(counts.map(|count| count * COUNT_RAD));
            (report.wheels, report.speeds) = (angles(wheels.counts), angles(wheels.speeds));
            report.held = if held { Some([true; 2]) } else { report.held };
        }
        self.bytes()
    }

    /// The message with data that are all `byte`, if it has wheels; in lines of JSON the wheels are 0.
    pub fn with_data(mut self, byte: u8) -> Vec<u8> {
        match &mut self {
            Self::Frame { did: did::MOTOR, data, .. } => data.fill(byte),
            Self::Frame { .. } => {}
            Self::Line(json_wire::Report { wheels: Some(_), .. }) => {
                return self.with_wheels(&Wheels::default(), false);
            }
            Self::Line(_) => {}
        }
        self.bytes()
    }

    /// The message with the readings of `fault`, whose robot read `newest` before; none if no readings come.
    pub fn with_readings(
        mut self,
        fault: RobotFault,
        newest: &Readings,
        chance: &mut Random,
    ) -> Vec<u8> {
        let (echo, range) = match fault {
            RobotFault::RangeStuck => (STUCK_CM, Some(STUCK_M)),
            RobotFault::RangeSilent | RobotFault::RangeDeaf => (NOTHING, None),
            _ => (0, Some(NO_READING)),
        };
        match (&mut self, fault) {
            (Self::Frame { did: did::STANDARD, .. }, RobotFault::RangeMissing) => {
                return Vec::new();
            }
            (Self::Frame { did: did::STANDARD, data, .. }, _) => {
                let told = newest.ultrasonic.map(|newest| match fault {
                    RobotFault::RangeFrozen => newest,
                    RobotFault::RangeNear => (newest + chance.below(7) as u8).clamp(6, 253) - 3,
                    RobotFault::RangeRandom => 3 + chance.below(252) as u8,
                    _ => echo,
                });
                data.iter_mut().zip(told).for_each(|(byte, told)| *byte = told);
            }
            (Self::Frame { .. }, _) => {}
            (Self::Line(report), RobotFault::RangeMissing) => {
                (report.ranges, report.scan) = (BTreeMap::new(), None);
                report.scans.clear();
            }
            (Self::Line(report), _) => {
                if matches!(fault, RobotFault::RangeFrozen | RobotFault::RangeNear) {
                    for (name, range) in &mut report.ranges {
                        *range = newest.ranges.get(name).copied().unwrap_or(*range);
                    }
                    report.scan = report.scan.take().and(newest.scan.clone());
                    if !report.scans.is_empty() {
                        report.scans.clone_from(&newest.scans);
                    }
                }
                let mut told = |read: Option<f64>, is_beam: bool| match fault {
                    RobotFault::RangeFrozen => read,
                    RobotFault::RangeNear if is_beam => {
                        read.map(|beam| beam * chance.within(0.995, 1.005))
                    }
                    RobotFault::RangeNear => read.map(|range| range + chance.within(-0.03, 0.03)),
                    RobotFault::RangeRandom => Some(chance.within(0.2, 2.5)),
                    _ => range,
                };
                report.ranges.values_mut().for_each(|range| *range = told(*range, false));
                let named = report.scans.values_mut().flat_map(|scan| &mut scan.ranges);
                for beam in report.scan.iter_mut().flatten().chain(named) {
                    *beam = told(beam.map(f64::from), true).map(|beam| beam as f32);
                }
            }
        }
        self.bytes()
    }
}

/// A motor frame with `sensors`, from the device of `said`.
fn report(said: &Said, sensors: MotorSensors) -> Vec<u8> {
    let mut bytes = Vec::new();
    if let Said::Frame { rid, .. } = said {
        let addressing = Addressing::of_host(*rid).unwrap_or_default();
        Report::Motor(sensors).encode(addressing, &mut bytes);
    }
    bytes
}

#[derive(Clone, Debug)]
pub struct Ordered {
    pub bytes: Vec<u8>,
    pub effect: Effect,
}

#[derive(Clone, Debug)]
pub enum Effect {
    /// The wheels turn; these bytes in place of the order make them stand.
    Moves {
        stand: Vec<u8>,
    },
    /// The wheels stand by a speed of 0.
    Stands,
    /// The wheels stand by other means.
    Disables,
    Other,
}

impl Ordered {
    fn of_frame(frame: &Frame<'_>) -> Self {
        let mut bytes = Vec::new();
        frame.encode(&mut bytes);
        let effect = match Command::parse(frame) {
            Ok(Command::Motion(motion)) if is_moving(&motion) => {
                let addressing = Addressing::of_robot(frame.rid).unwrap_or_default();
                let mut stand = Vec::new();
                Command::velocity([Some(0); 2], motion.limit_ms).encode(addressing, &mut stand);
                Effect::Moves { stand }
            }
            Ok(Command::Motion(motion)) if motion.quantity == Quantity::Velocity => Effect::Stands,
            Ok(Command::Motion(_) | Command::Enable { on: false, .. }) => Effect::Disables,
            _ => Effect::Other,
        };
        Self { bytes, effect }
    }

    fn of_line(mut bytes: Vec<u8>) -> Self {
        use json_wire::Order;
        let effect = match parse(&bytes) {
            Ok(Order::Drive { wheels, for_s, .. }) if wheels != [0.0; 2] => {
                let stand = line(&Order::Drive { wheels: [0.0; 2], twist: [0.0; 2], for_s });
                Effect::Moves { stand }
            }
            Ok(Order::Drive { .. }) => Effect::Stands,
            Ok(Order::Brake {}) => Effect::Disables,
            _ => Effect::Other,
        };
        bytes.push(b'\n');
        Self { bytes, effect }
    }
}

fn is_moving(motion: &Motion) -> bool {
    let target = |channel| motion.targets.of(channel).unwrap_or_default();
    motion.quantity == Quantity::Velocity && [0, 1].into_iter().any(|channel| target(channel) != 0)
}
