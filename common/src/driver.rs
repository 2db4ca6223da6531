//! The interface between the link and the devices on its wires: one [`Base`], which drives, and any number of sensors with wires of their
//! own. A driver knows neither wire nor clock: bytes come in, what they say goes out.

pub mod counts;
pub mod gyro;
pub mod odometry;

use std::{fmt, time::Duration};

use crate::mission::Sensor;
use crate::samples::{
    ComplaintSample, CountsSample, InfraredSample, PowerSample, RangeReading, RangeStatus,
    SurroundingsSample, Sweep, WheelSample, name, name_str, words,
};

/// The protocol of one device. A sensor needs no more than this.
pub trait Driver: fmt::Debug {
    /// The meaning of `bytes`, and of those before that they complete.
    fn hear(&mut self, bytes: &[u8]) -> Heard;

    /// Drop the beginning of a message, whose rest does not follow in the next connection.
    fn reset(&mut self);

    fn tally(&self) -> WireTally;

    /// The bytes for a device that was found: settings, and the order to send what it measures. A sensor that fell silent gets them
    /// again.
    fn greeting(&self) -> Vec<u8> {
        Vec::new()
    }
}

/// The driver of what moves the robot. All but [`Base::velocity`] depends on the robot.
pub trait Base: Driver {
    /// A command for the speeds of the two wheels, or of a car's wheel and steering, counts/s, forward positive; the robot itself stops
    /// after `limit`.
    fn velocity(&self, counts: [i16; 2], limit: Duration) -> Vec<u8>;

    /// The turn since the tick before by the robot's own gyro, for a tick that begins now.
    fn turn_for_tick(&mut self) -> Option<Turn> {
        None
    }

    /// The request to send the sensors, for a robot that neither publishes them nor is polled.
    fn ask_for_sensors(&self) -> Vec<u8> {
        Vec::new()
    }

    /// The request to answer, for a robot that neither publishes nor is polled.
    fn ping(&self) -> Vec<u8> {
        Vec::new()
    }

    fn acknowledge(&self) -> Vec<u8> {
        Vec::new()
    }

    /// How many acknowledgements, which [`Heard::acknowledged`] counts, the robot owes for these bytes to it.
    fn owed(&self, _sent: &[u8]) -> usize {
        0
    }

    fn is_polled(&self) -> bool {
        false
    }

    /// The bytes that poll the robot now. The link calls this once a period of `robot.rate_hz`, a clock for the driver; in lockstep
    /// after each command and ping.
    fn poll(&mut self) -> Vec<u8> {
        Vec::new()
    }

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

impl Heard {
    /// One battery feeds all of the robot.
    pub fn take_battery(&mut self, volts: f64) {
        let (board_v, motor_v, servo_v) = (volts, volts, volts);
        self.power = Some(PowerSample { board_v, motor_v, servo_v, ..PowerSample::default() });
    }
}

impl WireTally {
    /// Count `piece`, a whole or broken message, and note in `heard` why it was refused. Returns whether it was `taken`.
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

    /// Adds bytes that were dropped before they could be a message.
    pub const fn with_dropped(self, bytes: u64) -> Self {
        Self { bytes_dropped: self.bytes_dropped + bytes, ..self }
    }
}

/// Why a message is not used, for the user to mend.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Refusal {
    /// The part of the message, as the message names it; empty for the whole.
    pub input: String,
    pub what: String,
    /// Empty where `what` says it.
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
    pub fn of(stage: &str, Refusal { input, what, remedy }: &Refusal) -> Self {
        let (stage, input) = (name(stage), words(input));
        Self { stage, input, what: words(what), remedy: words(remedy), ..Self::default() }
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
    /// A tick begins with it.
    pub motion: Option<Motion>,
    /// The rows of the sensors are those of the mission's table. Others are ignored.
    pub readings: Vec<RangeReading>,
    pub scans: Vec<LaserScan>,
    /// Rows of [`crate::mission::Mission::touches`], and whether they feel something.
    pub touched: Vec<(usize, bool)>,
    /// The link says which batteries are low.
    pub power: Option<PowerSample>,
    pub surroundings: Option<SurroundingsSample>,
    pub infrared: Option<InfraredSample>,
    /// Whether its odometry jumped farther than the robot can move. The wheels' counts leave the jump out.
    pub jumped: bool,
    /// Whether it counts orders from 0 again: it has restarted, and knows no settings.
    pub restarted: bool,
    /// Its newest odometry by its own clock, if it says that.
    pub stamp_ns: Option<i64>,
    pub commander: Option<Commander>,
    /// Two nodes publish its odometry: their numbers, and the remedy.
    pub two_publishers: Option<String>,
    /// Why the newest refused message is none of the protocol.
    pub refused: Option<Refusal>,
}

/// A sender, other than the link, of commands to the robot.
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
    /// When its first beam was measured by the clock of [`Motion::stamp_ns`]. Without it, `sweep` counts from the tick on.
    pub stamp_ns: Option<i64>,
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Turn {
    /// One more than the number of the turn at whose end this one begins; another number if one between is missing.
    pub sequence: u64,
    /// Radians counter-clockwise.
    pub turn_rad: f64,
    pub variance_rad2: f64,
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Motion {
    pub wheels: WheelSample,
    /// Of a robot that says angles or its odometry: the counts of `wheels` without their cycle.
    pub endless: Option<CountsSample>,
    /// When it was measured, by the robot's clock.
    pub stamp_ns: Option<i64>,
    /// AD counts of the left and the right wheel.
    pub currents: [u16; 2],
}

/// The greatest range by which a sensor may say that nothing is in its reach. A greater one is of another unit, or garbage.
fn most_m(sensor: &Sensor) -> f64 {
    2.0 * sensor.reach_m.max(sensor.model.reach_m())
}

/// The reading of the sensor in `row` of the mission's table at a range, metres: none or one beyond reach is nothing; one that is negative,
/// no number, or beyond twice the reach is no reading.
pub fn range_reading(row: usize, sensor: &Sensor, range: Option<f64>) -> RangeReading {
    let (status, range_m) = match range {
        Some(range) if !(0.0..=most_m(sensor)).contains(&range) => (RangeStatus::Invalid, 0.0),
        Some(range) if range <= sensor.reach_m => (RangeStatus::Measured, range),
        _ => (RangeStatus::Nothing, 0.0),
    };
    let raw = (range_m * 100.0).round() as u16;
    RangeReading { sensor: row as u8, range_m, raw, status: status.into() }
}

/// A beam as the topic `scan` has it: infinite for none or one beyond reach, no number for one too short to be a range or beyond twice
/// the reach.
pub fn beam(sensor: &Sensor, range: Option<f32>) -> f32 {
    let (least_m, reach_m) = (sensor.model.least_m() as f32, sensor.reach_m as f32);
    match range {
        Some(range) if !(f64::from(least_m)..=most_m(sensor)).contains(&range.into()) => f32::NAN,
        Some(range) if range <= reach_m => range,
        _ => f32::INFINITY,
    }
}
