//! Messages of each protocol, in JSON terms.

use std::f64::consts::TAU;

use common::{
    json_wire::{self, Lines, line, parse},
    mission::Protocol,
    wire::{
        Addressing, COUNT_CYCLE, Command, Decoder, Echo, Encoder, Frame, Motion, MotorSensors,
        Quantity, Report, counts_between, did,
    },
};

/// Current of a held motor, as in the simulated robot, AD counts.
const HELD_AD: u16 = 1520;
const LONGEST_ECHO_M: f64 = 2.54;
const MOTOR_BYTES: usize = 33;
pub const COUNT_RAD: f64 = TAU / 1200.0;

#[derive(Default)]
pub struct Words {
    /// All but an X80 say lines.
    protocol: Protocol,
    robot_frames: Decoder,
    host_frames: Decoder,
    encoders: [Encoder; 2],
    counts: [f64; 2],
    robot_lines: Lines,
    host_lines: Lines,
}

impl Words {
    pub fn of(protocol: Protocol) -> Self {
        Self { protocol, ..Self::default() }
    }

    /// Returns the range of a stuck sensor, metres.
    pub fn stuck_m(&self) -> f64 {
        if self.protocol == Protocol::X80 { 0.08 } else { 0.3 }
    }

    pub fn said(&mut self, bytes: &[u8]) -> Vec<Said> {
        if self.protocol == Protocol::X80 {
            let said = frames(&mut self.robot_frames, bytes, |frame| {
                Said::of_frame(frame, &mut self.encoders, &mut self.counts)
            });
            return said.into_iter().flatten().collect();
        }
        let lines = self.robot_lines.push(bytes).into_iter().filter_map(|line| parse(&line).ok());
        lines.map(|report| Said { report, frame: None }).collect()
    }

    pub fn ordered(&mut self, bytes: &[u8]) -> Vec<(Vec<u8>, Effect)> {
        if self.protocol == Protocol::X80 {
            return frames(&mut self.host_frames, bytes, |frame| {
                let mut bytes = Vec::new();
                frame.encode(&mut bytes);
                (bytes, Effect::of_frame(frame))
            });
        }
        let lines = self.host_lines.push(bytes).into_iter();
        lines.map(|order| ([&*order, b"\n"].concat(), Effect::of_line(&order))).collect()
    }
}

fn frames<T>(decoder: &mut Decoder, bytes: &[u8], mut of: impl FnMut(&Frame<'_>) -> T) -> Vec<T> {
    decoder.push(bytes);
    let mut all = Vec::new();
    while let Some(frame) = decoder.next_frame() {
        all.push(of(&frame));
    }
    all
}

/// Message of the robot, in JSON terms for every protocol.
#[derive(Clone)]
pub struct Said {
    /// Report; an X80's wheels are its channels, its ranges those of its sonars by number.
    pub report: json_wire::Report,
    frame: Option<(Addressing, Report)>,
}

impl Said {
    /// Continues `counts` from the previous `encoders`. Returns `None` for an unknown frame.
    fn of_frame(
        frame: &Frame<'_>,
        encoders: &mut [Encoder; 2],
        counts: &mut [f64; 2],
    ) -> Option<Self> {
        let mut report = json_wire::Report::default();
        let parsed = Report::parse(frame).ok()?;
        match &parsed {
            Report::Motor(sensors) => {
                for (channel, now) in sensors.encoders.iter().enumerate() {
                    let rolled = counts_between(encoders[channel].position, now.position);
                    counts[channel] += f64::from(rolled);
                }
                *encoders = sensors.encoders;
                report.wheels = Some(counts.map(|count| count * COUNT_RAD));
                let speed = |encoder: Encoder| f64::from(encoder.velocity()) * COUNT_RAD;
                report.speeds = Some(encoders.map(speed));
            }
            Report::Standard(sensors) => {
                let metres = |byte: &u8| Echo::from_byte(*byte).map_or(Some(-1.0), Echo::metres);
                let ranges = sensors.ultrasonic.iter().map(metres).enumerate();
                report.ranges = ranges.map(|(sonar, range)| (sonar.to_string(), range)).collect();
            }
            Report::Custom(_) | Report::System(_) => {}
        }
        Some(Self { report, frame: Some((Addressing::of_host(frame.rid)?, parsed)) })
    }

    pub fn bytes(&self) -> Vec<u8> {
        let Some((addressing, mut frame)) = self.frame else { return line(&self.report) };
        let json_wire::Report { wheels, speeds, held, ranges, .. } = &self.report;
        match &mut frame {
            Report::Motor(MotorSensors { encoders, currents, .. }) => {
                let counts = |angles: &Option<[f64; 2]>, channel: usize| {
                    (angles.unwrap_or_default()[channel] / COUNT_RAD).round()
                };
                *encoders = [0, 1].map(|channel| {
                    let speed = counts(speeds, channel);
                    Encoder {
                        position: counts(wheels, channel).rem_euclid(COUNT_CYCLE.into()) as u16,
                        speed: speed.abs() as u16,
                        positive: speed > 0.0,
                    }
                });
                if held.is_some() {
                    currents[..2].fill(HELD_AD);
                }
            }
            Report::Standard(sensors) => {
                for (byte, range) in sensors.ultrasonic.iter_mut().zip(ranges.values()) {
                    *byte = match *range {
                        None => u8::MAX,
                        Some(no_reading) if no_reading < 0.0 => 0,
                        Some(range) => Echo::byte_at(range.min(LONGEST_ECHO_M)),
                    };
                }
            }
            Report::Custom(_) | Report::System(_) => {}
        }
        let mut bytes = Vec::new();
        frame.encode(addressing, &mut bytes);
        bytes
    }

    pub const fn is_frame(&self) -> bool {
        self.frame.is_some()
    }

    pub fn readings(&self) -> [bool; 3] {
        let json_wire::Report { ranges, scan, scans, .. } = &self.report;
        let has_further = matches!(self.frame, Some((_, Report::Custom(_))));
        [!ranges.is_empty(), scan.is_some() || !scans.is_empty(), has_further]
    }

    pub fn stream(&self) -> Option<usize> {
        let has_wheels = self.report.wheels.is_some();
        std::iter::once(has_wheels).chain(self.readings()).position(|has| has)
    }

    pub fn with_readings_of(self, other: Self) -> Self {
        let json_wire::Report { ranges, scan, scans, .. } = other.report;
        let report = json_wire::Report { ranges, scan, scans, ..self.report };
        Self { report, frame: other.frame }
    }

    /// Sets every data byte of a wheel message to `byte`; in JSON, the wheels become 0.
    pub fn with_data(mut self, byte: u8) -> Vec<u8> {
        if self.report.wheels.is_some() {
            if let Some((addressing, _)) = self.frame {
                let (rid, mut bytes) = (addressing.host(), Vec::new());
                let data = &[byte; MOTOR_BYTES];
                Frame { rid, sn: 0, did: did::MOTOR, data }.encode(&mut bytes);
                return bytes;
            }
            (self.report.wheels, self.report.speeds) = (Some([0.0; 2]), Some([0.0; 2]));
        }
        self.bytes()
    }
}

pub enum Effect {
    /// Turning wheels; the bytes make them stand instead.
    Moves {
        stand: Vec<u8>,
    },
    Stands,
    Disables,
    Other,
}

impl Effect {
    fn of_frame(frame: &Frame<'_>) -> Self {
        match Command::parse(frame) {
            Ok(Command::Motion(motion)) if is_moving(&motion) => {
                let addressing = Addressing::of_robot(frame.rid).unwrap_or_default();
                let mut stand = Vec::new();
                Command::velocity([Some(0); 2], motion.limit_ms).encode(addressing, &mut stand);
                Self::Moves { stand }
            }
            Ok(Command::Motion(motion)) if motion.quantity == Quantity::Velocity => Self::Stands,
            Ok(Command::Motion(_) | Command::Enable { on: false, .. }) => Self::Disables,
            _ => Self::Other,
        }
    }

    fn of_line(order: &[u8]) -> Self {
        use json_wire::Order;
        match parse(order) {
            Ok(Order::Drive { wheels, for_s, .. }) if wheels != [0.0; 2] => {
                let stand = line(&Order::Drive { wheels: [0.0; 2], twist: [0.0; 2], for_s });
                Self::Moves { stand }
            }
            Ok(Order::Drive { .. }) => Self::Stands,
            Ok(Order::Brake {}) => Self::Disables,
            _ => Self::Other,
        }
    }
}

fn is_moving(motion: &Motion) -> bool {
    let target = |channel| motion.targets.of(channel).unwrap_or_default();
    motion.quantity == Quantity::Velocity && [0, 1].into_iter().any(|channel| target(channel) != 0)
}
