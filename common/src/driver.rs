//! The interface between the link and a robot's protocol.

pub mod counts;
pub mod laser;
pub mod odometry;

use std::{fmt, time::Duration};

use crate::mission::{Mission, Sensor};
use crate::samples::{
    CountsSample, InfraredSample, PowerSample, RangeReading, RangeStatus, SurroundingsSample,
    Sweep, WheelSample,
};

/// The protocol of one kind of robot, without wire or clock: bytes from the robot to their meaning, orders to bytes for the robot.
pub trait Driver: fmt::Debug {
    fn push(&mut self, bytes: &[u8]);

    /// Drop the beginning of a message, whose rest does not follow in the next connection.
    fn reset(&mut self);

    fn heard(&mut self) -> Heard;

    fn tally(&self) -> WireTally;

    /// The newest reading of each sensor, in the order of the mission's table; a reading counts for one tick.
    fn readings_for_tick(&mut self) -> Vec<RangeReading>;

    fn scan_for_tick(&mut self) -> LaserScan {
        LaserScan::default()
    }

    /// The turn since the tick before by the robot's own gyro, for a tick that begins now.
    fn turn_for_tick(&mut self) -> Option<Turn> {
        None
    }

    /// The bytes for a robot that was found: settings, and the order to send its sensors.
    fn greeting(&self) -> Vec<u8> {
        Vec::new()
    }

    /// The request to send the sensors, for a robot that neither publishes them nor is polled.
    fn ask_for_sensors(&self) -> Vec<u8> {
        Vec::new()
    }

    /// The request to answer, for a robot that neither publishes nor is polled.
    fn ping(&self) -> Vec<u8> {
        Vec::new()
    }

    fn is_polled(&self) -> bool {
        false
    }

    /// The bytes that poll the robot now. The link calls this once a period of `robot.rate_hz`, a clock for the driver; in lockstep
    /// after each command and ping.
    fn poll(&mut self) -> Vec<u8> {
        Vec::new()
    }

    fn acknowledge(&self) -> Vec<u8> {
        Vec::new()
    }

    /// A command for the speeds of the two wheels, or of a car's wheel and steering, counts/s, forward positive; the robot itself stops
    /// after `limit`.
    fn velocity(&self, counts: [i16; 2], limit: Duration) -> Vec<u8>;

    /// Continues the wheels' counts in the next driver; none if the robot counts.
    fn memory(&self) -> Option<Memory> {
        None
    }

    fn remember(&mut self, _memory: &Memory) {}

    /// Methods that stop a robot which does not obey a velocity of 0, in the order of their use. After one the robot must be greeted
    /// before it drives.
    fn other_stops(&self) -> Vec<StopMethod> {
        Vec::new()
    }
}

/// The state of a robot that says its pose: x, y and heading by its odometry, and the angles that its wheels have turned by then.
pub type Memory = [f64; 5];

#[derive(Clone, Debug, PartialEq, Eq)]
pub struct StopMethod {
    pub name: &'static str,
    pub bytes: Vec<u8>,
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct WireTally {
    pub messages: u64,
    /// Bytes that belong to no message, or were dropped unread.
    pub bytes_dropped: u64,
}

impl WireTally {
    /// Count `piece`, a whole or broken message, and note in `heard` why it was refused. Returns whether it was `taken`.
    pub fn count(&mut self, piece: &[u8], taken: Result<(), String>, heard: &mut Heard) -> bool {
        let is_taken = taken.is_ok();
        match taken {
            Ok(()) => self.messages += 1,
            Err(why) => {
                self.bytes_dropped += piece.len() as u64;
                heard.refused = Some(why);
            }
        }
        is_taken
    }

    /// Adds bytes that were dropped before they could be a message.
    pub const fn with_dropped(self, bytes: u64) -> Self {
        Self { bytes_dropped: self.bytes_dropped + bytes, ..self }
    }
}

#[derive(Clone, Debug, Default, PartialEq)]
pub struct Heard {
    pub anything: bool,
    pub pinged: bool,
    pub acknowledged: usize,
    /// A tick begins with it.
    pub motion: Option<Motion>,
    pub readings: Vec<RangeReading>,
    /// The link says which batteries are low.
    pub power: Option<PowerSample>,
    pub surroundings: Option<SurroundingsSample>,
    pub infrared: Option<InfraredSample>,
    /// Whether its odometry jumped farther than the robot can move. The wheels' counts leave the jump out.
    pub jumped: bool,
    /// Its newest odometry by its own clock, if it says that.
    pub stamp_ns: Option<i64>,
    pub commander: Option<Commander>,
    /// Two nodes publish its odometry: their numbers, and the remedy.
    pub two_publishers: Option<String>,
    /// Why the newest refused message is none of the protocol.
    pub refused: Option<String>,
}

/// A sender, other than the link, of commands to the robot.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Commander {
    pub number: [u8; 16],
    pub moves: bool,
}

/// Beams as the topic `scan` has them, none if none came, and their times.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct LaserScan {
    pub beams: Vec<f32>,
    pub sweep: Sweep,
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Turn {
    /// One more than the number of the turn at whose end this one begins; another number if one between is missing.
    pub sequence: u64,
    pub turn_rad: f64,
    pub variance_rad2: f64,
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Motion {
    pub wheels: WheelSample,
    /// Of a robot that says angles or its odometry: the counts of `wheels` without their cycle.
    pub endless: Option<CountsSample>,
    /// AD counts of the left and the right wheel.
    pub currents: [u16; 2],
}

#[derive(Clone, Debug)]
pub struct Readings {
    table: Vec<Sensor>,
    newest: Vec<RangeReading>,
    fresh: Vec<RangeReading>,
    ticks: u64,
}

impl Readings {
    pub fn new(mission: &Mission) -> Self {
        let table = mission.sensor_table();
        Self { newest: absent(&table).collect(), table, fresh: Vec::new(), ticks: 0 }
    }

    pub fn table(&self) -> &[Sensor] {
        &self.table
    }

    /// Takes a reading; one of a row that does not exist is dropped.
    pub fn take(&mut self, row: usize, reading: RangeReading) {
        if let Some(newest) = self.newest.get_mut(row) {
            *newest = RangeReading { sensor: row as u8, ..reading };
            self.fresh.push(*newest);
        }
    }

    pub fn take_fresh(&mut self) -> Vec<RangeReading> {
        std::mem::take(&mut self.fresh)
    }

    /// Takes a range, metres: infinite or beyond reach is nothing, negative or no number is no reading.
    pub fn take_range(&mut self, row: usize, range: f64) {
        let reach_m = self.table.get(row).map_or(0.0, |sensor| sensor.reach_m);
        let (status, range_m) = match range {
            range if range < 0.0 || range.is_nan() => (RangeStatus::Invalid, 0.0),
            range if range <= reach_m => (RangeStatus::Measured, range),
            _ => (RangeStatus::Nothing, 0.0),
        };
        let (raw, status) = ((range_m * 100.0).round() as u16, status.into());
        self.take(row, RangeReading { range_m, raw, status, ..RangeReading::default() });
    }

    /// The readings for a tick, one for each row. Each is given once.
    pub fn for_tick(&mut self) -> Vec<RangeReading> {
        let tick = self.ticks;
        self.ticks += 1;
        let absent = absent(&self.table).collect();
        let mut readings = std::mem::replace(&mut self.newest, absent);
        for (reading, sensor) in readings.iter_mut().zip(&self.table) {
            if !tick.is_multiple_of(sensor.every_ticks) {
                *reading = RangeReading { sensor: reading.sensor, ..RangeReading::default() };
            }
        }
        readings
    }
}

fn absent(table: &[Sensor]) -> impl Iterator<Item = RangeReading> {
    (0..).zip(table).map(|(sensor, _)| RangeReading { sensor, ..RangeReading::default() })
}
