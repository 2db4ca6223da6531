//! Interface between the link and its devices: one [`Base`], which drives, and sensors with wires
//! of their own. Drivers are independent of wire and clock: they map bytes to measurements.

pub mod counts;
pub mod gyro;
pub mod odometry;

use std::{fmt, time::Duration};

use serde::Serialize;

use crate::mission::{MOST_SENSORS, Sensor};
use crate::samples::{
    ComplaintSample, CountsSample, InfraredSample, PowerSample, RangeReading, RangeStatus,
    SurroundingsSample, Sweep, WheelSample, name, name_str, words,
};

/// Protocol of one device; sufficient for a sensor.
pub trait Driver: fmt::Debug {
    fn hear(&mut self, bytes: &[u8]) -> Heard;

    fn reset(&mut self);

    fn tally(&self) -> WireTally;

    /// Returns the settings and the order to stream for a new device. A silent sensor gets them
    /// again.
    fn greeting(&self) -> Vec<u8> {
        Vec::new()
    }
}

/// Methods other than [`Base::velocity`] depend on the robot.
pub trait Base: Driver {
    /// Encodes a command for the two wheels, or a car's wheel and steering, counts/s, forward
    /// positive. The robot stops by itself after `limit`.
    fn velocity(&self, counts: [i16; 2], limit: Duration) -> Vec<u8>;

    /// By the robot's own gyro.
    fn turn_for_tick(&mut self) -> Option<Turn> {
        None
    }

    /// Returns the request for sensor values, for a robot that neither publishes them nor is
    /// polled.
    fn ask_for_sensors(&self) -> Vec<u8> {
        Vec::new()
    }

    /// For a robot that neither publishes nor is polled.
    fn ping(&self) -> Vec<u8> {
        Vec::new()
    }

    fn acknowledge(&self) -> Vec<u8> {
        Vec::new()
    }

    /// Acknowledgements due for these bytes; [`Heard::acknowledged`] counts them.
    fn owed(&self, _sent: &[u8]) -> usize {
        0
    }

    fn is_polled(&self) -> bool {
        false
    }

    /// Returns the bytes that poll the robot. The link calls this once per period of
    /// `robot.rate_hz`; in lockstep after each command and ping.
    fn poll(&mut self) -> Vec<u8> {
        Vec::new()
    }

    /// Returns the odometry whose memory continues the wheel counts in the next driver; `None` if
    /// the robot counts.
    fn odometry(&mut self) -> Option<&mut odometry::Odometry> {
        None
    }

    /// Returns ways to stop a robot that ignores a velocity of 0, in order of use. Greet the robot
    /// afterwards, before it drives.
    fn other_stops(&self) -> Vec<StopMethod> {
        Vec::new()
    }
}

/// Odometry pose of a robot that reports it, and the matching wheel angles.
pub type Memory = [f64; 5];

#[derive(Clone, Debug, PartialEq, Eq)]
pub struct StopMethod {
    pub name: &'static str,
    pub bytes: Vec<u8>,
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct WireTally {
    pub messages: u64,
    /// Bytes outside any message, or dropped unread.
    pub bytes_dropped: u64,
}

impl Heard {
    pub fn take_battery(&mut self, volts: f64) {
        self.power = Some(PowerSample {
            board_v: volts,
            motor_v: volts,
            servo_v: volts,
            ..PowerSample::default()
        });
    }
}

impl WireTally {
    /// Counts `piece`, a whole or broken message, and notes in `heard` why it was refused; returns
    /// whether it was `taken`.
    pub fn count(
        &mut self,
        piece: &[u8],
        taken: Result<(), impl Into<Refusal>>,
        heard: &mut Heard,
    ) -> bool {
        let is_taken = taken.is_ok();
        match taken {
            Ok(()) => self.messages += 1,
            Err(why) => {
                self.bytes_dropped += piece.len() as u64;
                heard.refused = Some(why.into());
            }
        }
        is_taken
    }

    pub const fn with_dropped(self, bytes: u64) -> Self {
        Self { bytes_dropped: self.bytes_dropped + bytes, ..self }
    }
}

/// Reason why a message is unusable, for the user to correct.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Refusal {
    /// Part of the message; empty for the whole.
    pub input: String,
    pub what: String,
    /// Empty if `what` includes it.
    pub remedy: String,
}

impl From<String> for Refusal {
    fn from(what: String) -> Self {
        Self { what, ..Self::default() }
    }
}

impl From<&str> for Refusal {
    fn from(what: &str) -> Self {
        what.to_owned().into()
    }
}

impl fmt::Display for Refusal {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { input, what, remedy } = self;
        let [colon, semicolon] = [(input, ": "), (remedy, "; ")]
            .map(|(text, mark)| if text.is_empty() { "" } else { mark });
        write!(f, "{input}{colon}{what}{semicolon}{remedy}")
    }
}

impl ComplaintSample {
    /// Age at which a complaint is over. A stage repeats it several times a second, but may wait
    /// seconds for a processor.
    pub const LASTS: Duration = Duration::from_secs(10);

    pub fn of(stage: &str, Refusal { input, what, remedy }: &Refusal) -> Self {
        Self {
            stage: name(stage),
            input: words(input),
            what: words(what),
            remedy: words(remedy),
            ..Self::default()
        }
    }

    pub fn refusal(&self) -> Refusal {
        let [input, what, remedy] =
            [self.input, self.what, self.remedy].map(|words| words.text().into_owned());
        Refusal { input, what, remedy }
    }
}

impl fmt::Display for ComplaintSample {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: {}", name_str(&self.stage), self.refusal())
    }
}

#[derive(Clone, Debug, Default, PartialEq)]
pub struct Heard {
    pub anything: bool,
    pub pinged: bool,
    pub acknowledged: usize,
    /// Begins a tick.
    pub motion: Option<Motion>,
    /// Of the mission's sensor table; others are ignored.
    pub readings: Vec<RangeReading>,
    pub scans: Vec<LaserScan>,
    /// Rows of [`crate::mission::Mission::touches`].
    pub touched: Vec<(usize, bool)>,
    /// Voltages; the link sets the low flags.
    pub power: Option<PowerSample>,
    pub surroundings: Option<SurroundingsSample>,
    pub infrared: Option<InfraredSample>,
    /// Whether its odometry jumped farther than the robot can move. The wheel counts omit the jump.
    pub jumped: bool,
    /// Whether it counts orders from 0 again: it restarted and lost its settings.
    pub restarted: bool,
    /// By its own clock.
    pub stamp_ns: Option<i64>,
    pub commander: Option<Commander>,
    /// Numbers of two nodes that both publish its odometry, and the remedy.
    pub two_publishers: Option<String>,
    pub refused: Option<Refusal>,
}

/// Another sender of commands to the robot.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Commander {
    pub number: [u8; 16],
    pub moves: bool,
}

#[derive(Clone, Debug, Default, PartialEq)]
pub struct LaserScan {
    pub row: usize,
    pub beams: Vec<f32>,
    pub sweep: Sweep,
    /// Time of its first beam by the clock of [`Motion::stamp_ns`]. Without it, `sweep` is relative
    /// to the tick.
    pub stamp_ns: Option<i64>,
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Turn {
    /// Successor of the number of the turn at whose end this one begins; other numbers mark a gap.
    pub sequence: u64,
    /// Radians counter-clockwise.
    pub turn_rad: f64,
    pub variance_rad2: f64,
}

#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Motion {
    pub wheels: WheelSample,
    /// Counts of `wheels` without wraparound, for a robot that reports angles or odometry.
    pub endless: Option<CountsSample>,
    /// By the robot's clock.
    pub stamp_ns: Option<i64>,
    /// AD counts of the left and the right wheel.
    pub currents: [u16; 2],
}

/// Returns the greatest plausible range for nothing in reach; a greater one has another unit or is
/// garbage.
fn most_m(sensor: &Sensor) -> f64 {
    2.0 * sensor.reach_m.max(sensor.model.product().reach_m)
}

/// Returns the reading of the sensor in `row` at a range, metres. Missing or beyond reach means
/// nothing; negative, NaN or beyond twice the reach is invalid.
pub fn range_reading(row: usize, sensor: &Sensor, range: Option<f64>) -> RangeReading {
    let (status, range_m) = match range {
        Some(range) if !(0.0..=most_m(sensor)).contains(&range) => (RangeStatus::Invalid, 0.0),
        Some(range) if range <= sensor.reach_m => (RangeStatus::Measured, range),
        _ => (RangeStatus::Nothing, 0.0),
    };
    const { assert!(MOST_SENSORS <= 1 << u8::BITS) };
    let raw = (range_m * 100.0).round() as u16;
    RangeReading { sensor: row as u8, range_m, raw, status: status.into() }
}

/// Converts a beam for the topic `scan`: infinite if missing or beyond reach, NaN if below the
/// least range or beyond twice the reach.
pub fn beam(sensor: &Sensor, range: Option<f32>) -> f32 {
    let least_m = sensor.model.product().least_m as f32;
    let reach_m = sensor.reach_m as f32;
    match range {
        Some(range) if !(f64::from(least_m)..=most_m(sensor)).contains(&range.into()) => f32::NAN,
        Some(range) if range <= reach_m => range,
        _ => f32::INFINITY,
    }
}
