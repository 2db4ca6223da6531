//! Table of the topics that the link reads and writes.

use common::mission::{Mission, SensorKind};
use ros2::topic::Topic;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Content {
    Odometry,
    Scan(usize),
    Battery,
    Range(usize),
    Imu,
    Touch(usize),
    /// All triggered bumpers and cliff sensors.
    Hazards,
    /// Command of another sender, after its writer's number.
    Command,
}

#[derive(Clone, Debug)]
pub struct Topics {
    pub command: Topic,
    /// Subscriptions. Wire pieces begin with the row here.
    pub heard: Vec<(Content, Topic)>,
}

impl Topics {
    pub fn of(mission: &Mission) -> Self {
        let topics = &mission.robot.ros2;
        let mut heard = Vec::new();
        let mut hear =
            |content, name: &str, kind: &str| heard.push((content, Topic::new(name, kind)));
        hear(Content::Odometry, &topics.odom, "nav_msgs::msg::dds_::Odometry_");
        for (row, laser) in mission.lasers_of_base() {
            let name = topics.ranges.get(&laser.name).unwrap_or(&topics.scan);
            hear(Content::Scan(row), name, "sensor_msgs::msg::dds_::LaserScan_");
        }
        hear(Content::Battery, &topics.battery, "sensor_msgs::msg::dds_::BatteryState_");
        for (row, sensor) in mission.sensor_table().iter().enumerate() {
            if sensor.kind != SensorKind::Scan
                && let Some(name) = topics.ranges.get(&sensor.name)
            {
                hear(Content::Range(row), name, "sensor_msgs::msg::dds_::Range_");
            }
        }
        if let Some(imu) = &topics.imu {
            hear(Content::Imu, imu, "sensor_msgs::msg::dds_::Imu_");
        }
        for (row, touch) in mission.touches().iter().enumerate() {
            if let Some(name) = topics.ranges.get(&touch.name) {
                hear(Content::Touch(row), name, "std_msgs::msg::dds_::Bool_");
            }
        }
        if let Some(hazards) = mission.hazards_topic() {
            let kind = "irobot_create_msgs::msg::dds_::HazardDetectionVector_";
            hear(Content::Hazards, &hazards, kind);
        }
        let command = if topics.stamped {
            "geometry_msgs::msg::dds_::TwistStamped_"
        } else {
            "geometry_msgs::msg::dds_::Twist_"
        };
        let command = Topic::new(&topics.cmd_vel, command);
        heard.push((Content::Command, command.clone()));
        Self { command, heard }
    }
}
