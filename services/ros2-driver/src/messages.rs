//! Messages, as far as the driver needs them. Fields that a newer release of ROS appends are ignored.

use common::mission::MOST_BEAMS;
use ros2::{
    cdr::{Malformed, Reader, Writer},
    parts::heading,
};

const COVARIANCE: usize = 36;
const MOST_HAZARDS: usize = 64;

/// A rotation's or a turn rate's; the first number is [`NOT_STATED`] if the quantity is not stated.
const COVARIANCE_3: usize = 9;
const NOT_STATED: f64 = -1.0;
const FASTEST_TURN: f64 = 50.0;

/// A stamp that goes back farther says that the robot's clock was set anew.
const SET_ANEW_NS: i64 = 1_000_000_000;
pub const NO_GROWTH: &str =
    "a stamp that does not grow; let one node alone publish it, and stamp each";

/// A stamp no newer than the newest, unless a clock was set anew.
pub fn is_repeated(newest_ns: i64, stamp_ns: i64) -> bool {
    (newest_ns - SET_ANEW_NS..=newest_ns).contains(&stamp_ns)
}

#[derive(Clone, Copy, Debug)]
pub struct Odometry {
    /// The robot's clock gives it.
    pub stamp_ns: i64,
    /// x, y and heading.
    pub pose: [f64; 3],
    /// The speed ahead, m/s, and the turn rate, rad/s.
    pub twist: [f64; 2],
}

impl Odometry {
    /// The error says why there is none.
    pub fn read(payload: &[u8]) -> Result<Self, String> {
        let odometry = Self::decode(payload).map_err(|error| error.to_string())?;
        if odometry.pose[2].is_nan() {
            return Err("an orientation that is no rotation; fill pose.pose.orientation".to_owned());
        }
        if !odometry.twist.iter().all(|speed| speed.is_finite()) {
            return Err("a speed that is no number; fill twist.twist".to_owned());
        }
        Ok(odometry)
    }

    /// A heading that is no rotation is no number.
    fn decode(payload: &[u8]) -> Result<Self, Malformed> {
        let mut reader = Reader::new(payload)?;
        let (stamp_ns, _frame) = reader.header()?;
        let _child_frame = reader.text()?;
        let ([x, y], heading) = reader.pose()?;
        reader.f64s::<COVARIANCE>()?;
        let [ahead, _, _, _, _, turn] = reader.f64s()?;
        let pose = [x, y, heading.unwrap_or(f64::NAN)];
        Ok(Self { stamp_ns, pose, twist: [ahead, turn] })
    }
}

#[derive(Clone, Copy, Debug)]
pub struct Imu {
    pub stamp_ns: i64,
    pub turn: ImuTurn,
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ImuTurn {
    /// Rad/s, and the variance of its error if that is stated.
    Rate(f64, Option<f64>),
    /// Radians.
    Heading(f64),
}

impl Imu {
    /// The turn rate if it is stated, else the orientation. The error says why there is none.
    pub fn read(payload: &[u8]) -> Result<Self, String> {
        let (stamp_ns, heading, rate) = Self::decode(payload).map_err(|error| error.to_string())?;
        let turn = match (rate, heading) {
            (Some((rate, variance)), _) if rate.abs() <= FASTEST_TURN => {
                // A variance greater than that of any rate means that it is unknown.
                let most = FASTEST_TURN * FASTEST_TURN;
                ImuTurn::Rate(rate, Some(variance.min(most)).filter(|_| variance > 0.0))
            }
            (Some((rate, _)), _) => {
                return Err(format!("a turn rate of {rate}; fill angular_velocity in rad/s"));
            }
            (None, Some(heading)) if heading.is_nan() => {
                return Err("an orientation that is no rotation; fill orientation".to_owned());
            }
            (None, Some(heading)) => ImuTurn::Heading(heading),
            (None, None) => {
                let why = "neither a turn rate nor an orientation is stated; publish one, or remove robot.ros2.imu";
                return Err(why.to_owned());
            }
        };
        Ok(Self { stamp_ns, turn })
    }

    /// Stamp, heading, and turn rate with its variance, as far as they are stated. A heading that is no rotation is
    /// no number.
    #[expect(clippy::type_complexity, reason = "it is taken apart at once")]
    fn decode(payload: &[u8]) -> Result<(i64, Option<f64>, Option<(f64, f64)>), Malformed> {
        let mut reader = Reader::new(payload)?;
        let (stamp_ns, _frame) = reader.header()?;
        let rotation = heading(reader.f64s()?).unwrap_or(f64::NAN);
        let [first, ..] = reader.f64s::<COVARIANCE_3>()?;
        let [_, _, rate] = reader.f64s()?;
        let [rate_first, .., variance] = reader.f64s::<COVARIANCE_3>()?;
        let heading = (first != NOT_STATED).then_some(rotation);
        Ok((stamp_ns, heading, (rate_first != NOT_STATED).then_some((rate, variance))))
    }
}

#[derive(Clone, Debug, PartialEq)]
pub struct Scan {
    /// Of the first beam; the robot's clock gives it.
    pub stamp_ns: i64,
    /// Time from beam to beam.
    pub beam_s: f32,
    /// Bearing of the first beam, and the angle from beam to beam, radians counter-clockwise.
    pub fan: (f64, f64),
    /// Other ranges are none.
    pub least_m: f32,
    pub most_m: f32,
    pub ranges: Vec<f32>,
    /// The last beam was measured first.
    pub is_reversed: bool,
}

impl Scan {
    /// Fails if `payload` is no `sensor_msgs/LaserScan`.
    pub fn read(payload: &[u8]) -> Result<Self, Malformed> {
        let mut reader = Reader::new(payload)?;
        let (stamp_ns, _frame) = reader.header()?;
        let (first, _last, step) = (reader.f32()?, reader.f32()?, reader.f32()?);
        let (beam_s, _scan_s) = (reader.f32()?, reader.f32()?);
        let (least_m, most_m) = (reader.f32()?, reader.f32()?);
        let ranges = reader.list(MOST_BEAMS)?;
        let fan = (first.into(), step.into());
        Ok(Self { stamp_ns, beam_s, fan, least_m, most_m, ranges, is_reversed: false })
    }

    /// Its laser is mounted upside down: give the beams the order and the bearings that they have in the robot's frame.
    pub fn turn_over(&mut self) {
        let (first, step) = self.fan;
        self.fan.0 = -(first + step * self.ranges.len().saturating_sub(1) as f64);
        self.ranges.reverse();
        self.is_reversed = !self.is_reversed;
    }
}

/// Metres of a `sensor_msgs/Range`: infinite for nothing, no number for no reading. Fails if `payload` is none.
pub fn read_range(payload: &[u8]) -> Result<f64, Malformed> {
    let mut reader = Reader::new(payload)?;
    reader.header()?;
    let _radiation = reader.u8()?;
    let _field_of_view = reader.f32()?;
    let (least_m, most_m, range) = (reader.f32()?, reader.f32()?, reader.f32()?);
    // A sensor with a single range says by an infinite one whether it is empty to there.
    Ok(match range {
        range if range == f32::NEG_INFINITY => 0.0,
        f32::INFINITY => f64::INFINITY,
        range if range < least_m || range > 2.0 * most_m => f64::NAN,
        range if range > most_m => f64::INFINITY,
        range => range.into(),
    })
}

/// Fails if `payload` is no `std_msgs/Bool`.
pub fn read_bool(payload: &[u8]) -> Result<bool, Malformed> {
    Ok(Reader::new(payload)?.u8()? != 0)
}

/// The frames of the bumpers and cliff sensors that feel something. Fails if `payload` is no
/// `irobot_create_msgs/HazardDetectionVector`.
pub fn read_hazards(payload: &[u8]) -> Result<Vec<String>, Malformed> {
    const BUMP_AND_CLIFF: [u8; 2] = [1, 2];
    let mut reader = Reader::new(payload)?;
    reader.header()?;
    let mut frames = Vec::new();
    for _ in 0..reader.length(MOST_HAZARDS)? {
        let (_, frame) = reader.header()?;
        let frame = frame.to_owned();
        if BUMP_AND_CLIFF.contains(&reader.u8()?) {
            frames.push(frame);
        }
    }
    Ok(frames)
}

/// No number if a `sensor_msgs/BatteryState` does not measure it. Fails if `payload` is none.
pub fn read_voltage(payload: &[u8]) -> Result<f32, Malformed> {
    let mut reader = Reader::new(payload)?;
    reader.header()?;
    reader.f32()
}

/// The `geometry_msgs/Twist` or, if `stamped`, `TwistStamped` moves a robot. A speed that is no number counts as
/// motion. Fails if `payload` is none.
pub fn read_moves(payload: &[u8], stamped: bool) -> Result<bool, Malformed> {
    let mut reader = Reader::new(payload)?;
    if stamped {
        reader.header()?;
    }
    Ok(reader.f64s::<6>()? != [0.0; 6])
}

/// The stamp is 0, which receivers take for their own time: the driver has no clock, and a stop must never be too
/// old.
pub fn write_twist(ahead: f64, turn: f64, stamped: bool) -> Vec<u8> {
    let mut writer = Writer::default();
    if stamped {
        writer.header(0, "");
    }
    writer.f64s(&[ahead, 0.0, 0.0, 0.0, 0.0, turn]).take()
}
