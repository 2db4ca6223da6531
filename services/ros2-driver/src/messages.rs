//! The messages, as far as the driver needs them. What a newer release of ROS appends to one is passed over.

use common::mission::MOST_BEAMS;

use ros2::cdr::{Malformed, Reader, Writer};

/// The covariance of a pose or a twist has so many numbers.
const COVARIANCE: usize = 36;
/// A rotation whose quaternion is shorter or longer by so much is none.
const UNIT_WITHIN: f64 = 0.1;

/// `nav_msgs/Odometry`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Odometry {
    /// Its stamp by the robot's clock, nanoseconds.
    pub stamp_ns: i64,
    /// x, y and heading, metres and radians.
    pub pose: [f64; 3],
    /// The speed ahead and the turn rate, m/s and rad/s.
    pub twist: [f64; 2],
}

impl Odometry {
    /// The odometry of `payload`, or why it has none.
    pub fn read(payload: &[u8]) -> Result<Self, String> {
        let (stamp_ns, [x, y, _], [i, j, k, w], twist) =
            Self::parts(payload).map_err(|error| error.to_string())?;
        let length = [i, j, k, w].iter().map(|part| part * part).sum::<f64>().sqrt();
        if length.is_nan() || (length - 1.0).abs() > UNIT_WITHIN {
            return Err("an orientation that is no rotation; fill pose.pose.orientation".to_owned());
        }
        let heading = (2.0 * (w * k + i * j)).atan2(1.0 - 2.0 * (j * j + k * k));
        let [ahead, _, _, _, _, turn] = twist;
        if !(ahead.is_finite() && turn.is_finite()) {
            return Err("a speed that is no number; fill twist.twist".to_owned());
        }
        Ok(Self { stamp_ns, pose: [x, y, heading], twist: [ahead, turn] })
    }

    #[allow(clippy::type_complexity)]
    fn parts(payload: &[u8]) -> Result<(i64, [f64; 3], [f64; 4], [f64; 6]), Malformed> {
        let mut reader = Reader::new(payload)?;
        let stamp_ns = header(&mut reader)?;
        reader.text()?;
        let (position, orientation) = (reader.f64s()?, reader.f64s()?);
        reader.f64s::<COVARIANCE>()?;
        Ok((stamp_ns, position, orientation, reader.f64s()?))
    }
}

/// `sensor_msgs/LaserScan`.
#[derive(Clone, Debug, PartialEq)]
pub struct Scan {
    /// The bearing of the first beam and the angle from beam to beam, radians counter-clockwise.
    pub fan: (f64, f64),
    /// Ranges below the least or above the greatest are none, metres.
    pub least_m: f32,
    pub most_m: f32,
    pub ranges: Vec<f32>,
}

impl Scan {
    /// The scan of `payload`.
    pub fn read(payload: &[u8]) -> Result<Self, Malformed> {
        let mut reader = Reader::new(payload)?;
        header(&mut reader)?;
        let (first, _last, step) = (reader.f32()?, reader.f32()?, reader.f32()?);
        let (_between_beams_s, _scan_s) = (reader.f32()?, reader.f32()?);
        let (least_m, most_m) = (reader.f32()?, reader.f32()?);
        let ranges = reader.list(MOST_BEAMS)?;
        Ok(Self { fan: (first.into(), step.into()), least_m, most_m, ranges })
    }
}

/// The range of a `sensor_msgs/Range`, metres: infinite for nothing, no number for no reading.
pub fn read_range(payload: &[u8]) -> Result<f64, Malformed> {
    let mut reader = Reader::new(payload)?;
    header(&mut reader)?;
    let _radiation = reader.u8()?;
    let _field_of_view = reader.f32()?;
    let (least_m, most_m, range) = (reader.f32()?, reader.f32()?, reader.f32()?);
    // A sensor that has one range only says by an infinite one whether it is empty to there.
    Ok(match range {
        range if range == f32::NEG_INFINITY => 0.0,
        range if range > most_m => f64::INFINITY,
        range if range < least_m => f64::NAN,
        range => range.into(),
    })
}

/// The voltage of a `sensor_msgs/BatteryState`; no number if it is not measured.
pub fn read_voltage(payload: &[u8]) -> Result<f32, Malformed> {
    let mut reader = Reader::new(payload)?;
    header(&mut reader)?;
    reader.f32()
}

/// Whether a `geometry_msgs/Twist` or, if `stamped`, a `TwistStamped` is to move a robot. A speed that is no number is none of standing.
pub fn read_moves(payload: &[u8], stamped: bool) -> Result<bool, Malformed> {
    let mut reader = Reader::new(payload)?;
    if stamped {
        header(&mut reader)?;
    }
    Ok(reader.f64s::<6>()? != [0.0; 6])
}

/// The stamp of a header, nanoseconds.
fn header(reader: &mut Reader<'_>) -> Result<i64, Malformed> {
    let (seconds, nanoseconds) = (reader.i32()?, reader.u32()?);
    reader.text()?;
    Ok(i64::from(seconds) * 1_000_000_000 + i64::from(nanoseconds))
}

/// A `geometry_msgs/Twist` or, if `stamped`, a `TwistStamped`. Its stamp is 0, which receivers take for their own time: the driver has
/// no clock, and a stop must never be too old.
pub fn write_twist(ahead: f64, turn: f64, stamped: bool) -> Vec<u8> {
    let mut writer = Writer::default();
    if stamped {
        writer.u32(0).u32(0).text("");
    }
    writer.f64s(&[ahead, 0.0, 0.0, 0.0, 0.0, turn]).take()
}
