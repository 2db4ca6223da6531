use std::collections::BTreeMap;

keys! {
    /// The defaults are the names that ROS robots have. A relative name is taken from the root.
    Ros2Topics {
        /// `nav_msgs/Odometry`.
        odom: String = "/odom".to_owned(),
        /// `sensor_msgs/LaserScan` of a robot with one laser.
        scan: String = "/scan".to_owned(),
        /// `geometry_msgs/Twist`.
        cmd_vel: String = "/cmd_vel".to_owned(),
        /// Commands are `geometry_msgs/TwistStamped` instead.
        stamped: bool,
        /// `sensor_msgs/BatteryState`.
        battery: String = "/battery_state".to_owned(),
        /// `sensor_msgs/Imu`; none by default.
        imu: Option<String>,
        /// `irobot_create_msgs/HazardDetectionVector`, whose frames are the names of the rows of `robot.touch`; by default that of a
        /// Create 3.
        hazards: Option<String>,
        /// `sensor_msgs/Range` of sonars and infrared rangers, `sensor_msgs/LaserScan` of lasers, and
        /// `std_msgs/Bool` of bumpers and cliff sensors, by the names of their rows.
        ranges: BTreeMap<String, String>,
    }
}

impl Ros2Topics {
    pub(crate) fn is_default(&self) -> bool {
        *self == Self::default()
    }
}
