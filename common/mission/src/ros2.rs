use std::collections::BTreeMap;

keys! {
    /// ROS 2 topics; defaults are the usual names. Relative names are resolved against the root.
    Ros2Topics {
        odom: String = "/odom".to_owned(),
        scan: String = "/scan".to_owned(),
        cmd_vel: String = "/cmd_vel".to_owned(),
        stamped: bool,
        battery: String = "/battery_state".to_owned(),
        imu: Option<String>,
        hazards: Option<String>,
        ranges: BTreeMap<String, String>,
    }
}
