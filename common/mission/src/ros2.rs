//! The topics of a robot that speaks ROS 2.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

/// The names of the topics, by default those that ROS robots have. A relative name is taken from the root.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Ros2Topics {
    /// The robot's odometry, `nav_msgs/Odometry`.
    pub odom: String,
    /// The beams of its laser, `sensor_msgs/LaserScan`.
    pub scan: String,
    /// The robot's velocity commands, `geometry_msgs/Twist`.
    pub cmd_vel: String,
    /// Whether velocity commands are `geometry_msgs/TwistStamped` instead.
    pub stamped: bool,
    /// The battery, `sensor_msgs/BatteryState`.
    pub battery: String,
    /// The gyro, `sensor_msgs/Imu`; none by default.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub imu: Option<String>,
    /// The topics of its sonars and infrared rangers, `sensor_msgs/Range`, by the names of their rows.
    pub ranges: BTreeMap<String, String>,
}

impl Default for Ros2Topics {
    fn default() -> Self {
        Self {
            odom: "/odom".to_owned(),
            scan: "/scan".to_owned(),
            cmd_vel: "/cmd_vel".to_owned(),
            stamped: false,
            battery: "/battery_state".to_owned(),
            imu: None,
            ranges: BTreeMap::new(),
        }
    }
}

impl Ros2Topics {
    /// Whether the mission names no topics.
    pub(crate) fn is_default(&self) -> bool {
        *self == Self::default()
    }
}
