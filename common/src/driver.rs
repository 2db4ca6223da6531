//! The interface between the link and a robot's protocol.
//!
//! | module | holds |
//! |---|---|
//! | [`odometry`] | the way of a robot as angles of its wheels |
//! | [`laser`] | the newest beams of a laser, and whether it is stuck or blind |

pub mod laser;
pub mod odometry;

use std::{fmt, time::Duration};

use crate::mission::{Mission, Sensor};
use crate::samples::{
    InfraredSample, PowerSample, RangeReading, RangeStatus, SurroundingsSample, WheelSample,
};

/// The protocol of one kind of robot, without a wire and without a clock: bytes of the robot in and their meaning out, orders in and
/// bytes for the robot out.
pub trait Driver: fmt::Debug {
    /// Take bytes from the robot.
    fn push(&mut self, bytes: &[u8]);

    /// Forget the beginning of a message, because its rest does not follow in the next connection.
    fn reset(&mut self);

    /// The meaning of the bytes that came since the last call.
    fn heard(&mut self) -> Heard;

    /// Counts of what came.
    fn tally(&self) -> WireTally;

    /// The newest reading of each sensor of the mission, in the order of its table. The next tick has none until new ones come.
    fn readings_for_tick(&mut self) -> Vec<RangeReading>;

    /// The newest beams of the mission's laser, as the topic `scan` has them, if some came since the last tick.
    fn scan_for_tick(&mut self) -> Vec<f32> {
        Vec::new()
    }

    /// How far the robot turned since the tick before by its own gyro, for a tick that begins now.
    fn turn_for_tick(&mut self) -> Option<Turn> {
        None
    }

    /// The bytes that a found robot is sent: its settings, and the order to send its sensors. Some protocols have none.
    fn greeting(&self) -> Vec<u8> {
        Vec::new()
    }

    /// Ask the robot to send its sensors. A robot that publishes them, or is polled for them, is not asked.
    fn ask_for_sensors(&self) -> Vec<u8> {
        Vec::new()
    }

    /// Ask the robot to answer. A robot that publishes, or is polled, is not asked.
    fn ping(&self) -> Vec<u8> {
        Vec::new()
    }

    /// Whether the robot says nothing unasked, so that it is polled.
    fn is_polled(&self) -> bool {
        false
    }

    /// The bytes that poll the robot now. The link calls this once a period of `robot.rate_hz`, by which the driver may measure time; in
    /// lockstep after each command and each ping.
    fn poll(&mut self) -> Vec<u8> {
        Vec::new()
    }

    /// Answer a ping of the robot. A robot that sends no pings is answered nothing.
    fn acknowledge(&self) -> Vec<u8> {
        Vec::new()
    }

    /// A command for the speeds of the two wheels, or of a car's wheel and steering, counts/s, forward positive. After `limit` the robot
    /// stops by itself.
    fn velocity(&self, counts: [i16; 2], limit: Duration) -> Vec<u8>;

    /// The state with which the next link's driver continues the counts of the wheels; none if the robot itself counts.
    fn memory(&self) -> Option<Memory> {
        None
    }

    /// Go on from the state of an earlier link's driver.
    fn remember(&mut self, _memory: &Memory) {}

    /// The methods that stop a robot which does not obey a velocity of 0, in the order in which they are tried. After one of them the
    /// robot must be greeted before it drives. Not each protocol has such methods.
    fn other_stops(&self) -> Vec<StopMethod> {
        Vec::new()
    }
}

/// The state that continues the counts of a robot that says its pose: x, y and heading by its odometry, and the angles by which its wheels
/// count as turned at that pose.
pub type Memory = [f64; 5];

/// A method that stops a robot, besides a velocity of 0.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct StopMethod {
    /// The name in logs.
    pub name: &'static str,
    /// The bytes that the robot is sent.
    pub bytes: Vec<u8>,
}

/// Counts of what came from a robot.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct WireTally {
    pub messages: u64,
    /// The bytes that belong to no message, or were dropped unread.
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

    /// These counts and the bytes that were dropped before they could be a message.
    #[must_use]
    pub const fn with_dropped(self, bytes: u64) -> Self {
        Self { bytes_dropped: self.bytes_dropped + bytes, ..self }
    }
}

/// The messages of a robot, the newest of each kind.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Heard {
    /// Whether the robot said anything.
    pub anything: bool,
    /// Whether the robot wants an answer.
    pub pinged: bool,
    /// The number of the robot's acknowledgements.
    pub acknowledged: usize,
    /// The state of its encoders and motors; a tick begins with it.
    pub motion: Option<Motion>,
    /// The readings of its ranging sensors.
    pub readings: Vec<RangeReading>,
    /// The batteries and motor currents; the link says which batteries are low.
    pub power: Option<PowerSample>,
    pub surroundings: Option<SurroundingsSample>,
    pub infrared: Option<InfraredSample>,
    /// Whether its odometry jumped farther than it moves. The counts of its wheels leave the jump out.
    pub jumped: bool,
    /// The time of its newest odometry by its own clock, nanoseconds, if it says that.
    pub stamp_ns: Option<i64>,
    /// A sender other than the link that commands the robot.
    pub commander: Option<Commander>,
    /// Why the newest refused message is none of the protocol, if any was refused.
    pub refused: Option<String>,
}

/// A sender other than the link that told the robot something.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Commander {
    /// The number that the network knows it by.
    pub number: [u8; 16],
    /// Whether the sender told the robot to move.
    pub moves: bool,
}

/// The turn of a robot by its own gyro.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Turn {
    /// One more than the number of the turn at whose end this one begins; any other number if a turn between is missing.
    pub sequence: u64,
    /// Radians counter-clockwise.
    pub turn_rad: f64,
    /// The variance of its error, rad^2.
    pub variance_rad2: f64,
}

/// The state of the encoders and motors.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Motion {
    /// The encoder counts, growing forward.
    pub wheels: WheelSample,
    /// The motor currents of the left and the right wheel, AD counts.
    pub currents: [u16; 2],
}

/// The newest reading of each sensor of a mission since the last tick.
#[derive(Clone, Debug)]
pub struct Readings {
    table: Vec<Sensor>,
    newest: Vec<RangeReading>,
    /// The readings that came since [`Readings::take_fresh`].
    fresh: Vec<RangeReading>,
    ticks: u64,
}

impl Readings {
    /// The readings before any sensor of `mission` has read anything.
    pub fn new(mission: &Mission) -> Self {
        let table = mission.sensor_table();
        Self { newest: absent(&table).collect(), table, fresh: Vec::new(), ticks: 0 }
    }

    /// The sensors, by rows.
    pub fn table(&self) -> &[Sensor] {
        &self.table
    }

    /// Take a reading of the sensor in `row`; a reading of a row that does not exist is dropped.
    pub fn take(&mut self, row: usize, reading: RangeReading) {
        if let Some(newest) = self.newest.get_mut(row) {
            *newest = RangeReading { sensor: row as u8, ..reading };
            self.fresh.push(*newest);
        }
    }

    /// The readings since the last call.
    pub fn take_fresh(&mut self) -> Vec<RangeReading> {
        std::mem::take(&mut self.fresh)
    }

    /// Take the range of the sensor in `row`, metres: infinite or beyond its reach for nothing, less than 0 or no number for no reading.
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

    /// Take the readings for a tick, one for each row. The next tick has none until new ones come.
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
