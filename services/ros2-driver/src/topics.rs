//! THE table of a robot's topics that the link reads and writes.

use common::mission::Mission;
use ros2::topic::Topic;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Content {
    Odometry,
    Scan,
    Battery,
    /// The sensor in this row of the mission.
    Range(usize),
    Imu,
    /// Another sender's. The number of its writer stands before the payload.
    Command,
}

#[derive(Clone, Debug)]
pub struct Topics {
    pub command: Topic,
    /// A piece of the wire begins with the row of its topic here.
    pub heard: Vec<(Content, Topic)>,
}

impl Topics {
    pub fn of(mission: &Mission) -> Self {
        let topics = &mission.robot.ros2;
        let command = match topics.stamped {
            true => "geometry_msgs::msg::dds_::TwistStamped_",
            false => "geometry_msgs::msg::dds_::Twist_",
        };
        let odometry = Topic::new(&topics.odom, "nav_msgs::msg::dds_::Odometry_");
        let mut heard = vec![(Content::Odometry, odometry)];
        if mission.laser().is_some() {
            let scan = Topic::new(&topics.scan, "sensor_msgs::msg::dds_::LaserScan_");
            heard.push((Content::Scan, scan));
        }
        let battery = Topic::new(&topics.battery, "sensor_msgs::msg::dds_::BatteryState_");
        heard.push((Content::Battery, battery));
        for (row, sensor) in mission.sensor_table().iter().enumerate() {
            if let Some(name) = topics.ranges.get(&sensor.name) {
                let range = Topic::new(name, "sensor_msgs::msg::dds_::Range_");
                heard.push((Content::Range(row), range));
            }
        }
        if let Some(imu) = &topics.imu {
            heard.push((Content::Imu, Topic::new(imu, "sensor_msgs::msg::dds_::Imu_")));
        }
        let command = Topic::new(&topics.cmd_vel, command);
        heard.push((Content::Command, command.clone()));
        Self { command, heard }
    }
}
