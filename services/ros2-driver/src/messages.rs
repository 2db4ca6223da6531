//! Required fields of messages. Fields appended by newer ROS releases are ignored.

use ros2::{
    cdr::{Cdr as _, Malformed},
    messages::twist,
    msg::{self, HazardDetection, HazardDetectionVector, LaserScan, Range, Twist, TwistStamped},
};

/// First covariance entry of unstated quantities.
const NOT_STATED: f64 = -1.0;
const FASTEST_TURN: f64 = 50.0;

/// Largest backward step of a stamp on a clock that was not reset.
const SET_ANEW_NS: i64 = 1_000_000_000;
pub const NO_GROWTH: &str =
    "the stamp does not increase; let only one node publish it, and stamp each message";

/// Returns whether a stamp does not grow, unless a clock was set.
pub fn is_repeated(newest_ns: i64, stamp_ns: i64) -> bool {
    (newest_ns - SET_ANEW_NS..=newest_ns).contains(&stamp_ns)
}

#[derive(Clone, Copy, Debug)]
pub struct Odometry {
    /// Stamp by the robot's clock.
    pub stamp_ns: i64,
    /// x, y and heading.
    pub pose: [f64; 3],
    /// Forward speed, m/s, and turn rate, rad/s.
    pub twist: [f64; 2],
}

impl Odometry {
    /// Reads odometry, or fails with the reason.
    pub fn read(payload: &[u8]) -> Result<Self, String> {
        let msg::Odometry { header, pose, twist, .. } = msg::Odometry::decode(payload)?;
        let heading = pose.pose.orientation.heading();
        let heading =
            heading.ok_or("the orientation is not a rotation; set pose.pose.orientation")?;
        let [x, y] = pose.pose.at();
        let twist = [twist.twist.linear.x, twist.twist.angular.z];
        if !twist.iter().all(|speed| speed.is_finite()) {
            return Err("a speed is not finite; set twist.twist".to_owned());
        }
        Ok(Self { stamp_ns: header.stamp.ns(), pose: [x, y, heading], twist })
    }
}

#[derive(Clone, Copy, Debug)]
pub struct Imu {
    pub stamp_ns: i64,
    pub turn: ImuTurn,
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ImuTurn {
    /// Rad/s, with its variance if stated.
    Rate(f64, Option<f64>),
    /// Radians.
    Heading(f64),
}

impl Imu {
    /// Reads the turn rate if stated, else the orientation. The error says why there is neither.
    pub fn read(payload: &[u8]) -> Result<Self, String> {
        let imu = msg::Imu::decode(payload)?;
        let rate = imu.angular_velocity.z;
        let turn = match (imu.angular_velocity_covariance, imu.orientation_covariance) {
            ([NOT_STATED, ..], [NOT_STATED, ..]) => {
                let why = "turn rate and orientation are both missing; publish one, or remove robot.ros2.imu";
                return Err(why.to_owned());
            }
            ([NOT_STATED, ..], _) => {
                let heading = imu.orientation.heading();
                let why = "the orientation is not a rotation; set orientation";
                ImuTurn::Heading(heading.ok_or(why)?)
            }
            ([.., variance], _) if rate.abs() <= FASTEST_TURN => {
                // Variances beyond that of any rate mean unknown.
                let most = FASTEST_TURN * FASTEST_TURN;
                ImuTurn::Rate(rate, Some(variance.min(most)).filter(|_| variance > 0.0))
            }
            _ => return Err(format!("the turn rate is {rate}; set angular_velocity in rad/s")),
        };
        Ok(Self { stamp_ns: imu.header.stamp.ns(), turn })
    }
}

#[derive(Clone, Debug, PartialEq)]
pub struct Scan {
    /// Stamp of the first beam, by the robot's clock.
    pub stamp_ns: i64,
    /// Time from beam to beam.
    pub beam_s: f32,
    /// Bearing of the first beam, and beam step, radians counter-clockwise.
    pub fan: (f64, f64),
    /// Valid ranges.
    pub least_m: f32,
    pub most_m: f32,
    pub ranges: Vec<f32>,
    /// Whether the last beam was measured first.
    pub is_reversed: bool,
}

impl Scan {
    /// Reads a scan. Fails if `payload` is no `sensor_msgs/LaserScan`.
    pub fn read(payload: &[u8]) -> Result<Self, Malformed> {
        let scan = LaserScan::decode(payload)?;
        Ok(Self {
            stamp_ns: scan.header.stamp.ns(),
            beam_s: scan.time_increment,
            fan: (scan.angle_min.into(), scan.angle_increment.into()),
            least_m: scan.range_min,
            most_m: scan.range_max,
            ranges: scan.ranges,
            is_reversed: false,
        })
    }

    /// Orders an upside-down laser's beams as in the robot's frame.
    pub fn turn_over(&mut self) {
        let (first, step) = self.fan;
        self.fan.0 = -(first + step * self.ranges.len().saturating_sub(1) as f64);
        self.ranges.reverse();
        self.is_reversed = !self.is_reversed;
    }
}

/// Reads a `sensor_msgs/Range` in metres: infinite for nothing, NaN for no reading. Fails
/// otherwise.
pub fn read_range(payload: &[u8]) -> Result<f64, Malformed> {
    let Range { min_range: least_m, max_range: most_m, range, .. } = Range::decode(payload)?;
    // Fixed-distance rangers report -inf for an object and +inf for none.
    Ok(match range {
        range if range == f32::NEG_INFINITY => 0.0,
        f32::INFINITY => f64::INFINITY,
        range if range < least_m || range > 2.0 * most_m => f64::NAN,
        range if range > most_m => f64::INFINITY,
        range => range.into(),
    })
}

/// Returns the frames of triggered bumpers and cliff sensors. Fails if `payload` is no
/// `irobot_create_msgs/HazardDetectionVector`.
pub fn read_hazards(payload: &[u8]) -> Result<Vec<String>, Malformed> {
    let felt = HazardDetectionVector::decode(payload)?
        .detections
        .into_iter()
        .filter(|hazard| matches!(hazard.r#type, HazardDetection::BUMP | HazardDetection::CLIFF));
    Ok(felt.map(|hazard| hazard.header.frame_id).collect())
}

/// Returns whether a `geometry_msgs/Twist` or, if `stamped`, `TwistStamped` moves a robot, as NaN
/// does. Fails otherwise.
pub fn read_moves(payload: &[u8], stamped: bool) -> Result<bool, Malformed> {
    let twist =
        if stamped { TwistStamped::decode(payload)?.twist } else { Twist::decode(payload)? };
    Ok(twist != Twist::default())
}

/// Encodes a command. Receivers take stamp 0 for their own time: the driver has no clock, and a
/// stop must never expire.
pub fn write_twist(ahead: f64, turn: f64, stamped: bool) -> Vec<u8> {
    let twist = twist([ahead, turn]);
    if stamped {
        TwistStamped { twist, ..TwistStamped::default() }.encode()
    } else {
        twist.encode()
    }
}
