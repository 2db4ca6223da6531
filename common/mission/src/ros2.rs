use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

/// The defaults are the names that ROS robots have. A relative name is taken from the root.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Ros2Topics {
    /// `nav_msgs/Odometry`.
    pub odom: String,
    /// `sensor_msgs/LaserScan`.
    pub scan: String,
    /// `geometry_msgs/Twist`.
    pub cmd_vel: String,
    /// Commands are `geometry_msgs/TwistStamped` instead.
    pub stamped: bool,
    /// `sensor_msgs/BatteryState`.
    pub battery: String,
    /// `sensor_msgs/Imu`; none by default.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub imu: Option<String>,
    /// `sensor_msgs/Range` of sonars and infrared rangers, by the names of their rows.
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
    pub(crate) fn is_default(&self) -> bool {
        *self == Self::default()
    }
}
