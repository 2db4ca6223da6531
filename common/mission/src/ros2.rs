use std::collections::BTreeMap;

keys! {
    /// ROS 2 topics; defaults are the usual names. Relative names are resolved against the root.
    Ros2Topics {
        /// `nav_msgs/Odometry`.
        odom: String = "/odom".to_owned(),
        /// `sensor_msgs/LaserScan` of a robot with one laser.
        scan: String = "/scan".to_owned(),
        /// `geometry_msgs/Twist`.
        cmd_vel: String = "/cmd_vel".to_owned(),
        /// Sends commands as `geometry_msgs/TwistStamped`.
        stamped: bool,
        /// `sensor_msgs/BatteryState`.
        battery: String = "/battery_state".to_owned(),
        /// `sensor_msgs/Imu`; none by default.
        imu: Option<String>,
        /// `irobot_create_msgs/HazardDetectionVector`, with names of `robot.touch` rows as frames;
        /// by default that of a Create 3.
        hazards: Option<String>,
        /// Topics by row name: `sensor_msgs/Range` of sonars and infrared rangers,
        /// `sensor_msgs/LaserScan` of lasers, `std_msgs/Bool` of bumpers and cliff sensors.
        ranges: BTreeMap<String, String>,
    }
}
