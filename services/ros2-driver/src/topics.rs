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
    /// Row of a bumper or cliff sensor.
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
        let command = match topics.stamped {
            true => "geometry_msgs::msg::dds_::TwistStamped_",
            false => "geometry_msgs::msg::dds_::Twist_",
        };
        let odometry = Topic::new(&topics.odom, "nav_msgs::msg::dds_::Odometry_");
        let mut heard = vec![(Content::Odometry, odometry)];
        for (row, laser) in mission.lasers_of_base() {
            let name = topics.ranges.get(&laser.name).unwrap_or(&topics.scan);
            let scan = Topic::new(name, "sensor_msgs::msg::dds_::LaserScan_");
            heard.push((Content::Scan(row), scan));
        }
        let battery = Topic::new(&topics.battery, "sensor_msgs::msg::dds_::BatteryState_");
        heard.push((Content::Battery, battery));
        for (row, sensor) in mission.sensor_table().iter().enumerate() {
            if sensor.kind != SensorKind::Scan
                && let Some(name) = topics.ranges.get(&sensor.name)
            {
                let range = Topic::new(name, "sensor_msgs::msg::dds_::Range_");
                heard.push((Content::Range(row), range));
            }
        }
        if let Some(imu) = &topics.imu {
            heard.push((Content::Imu, Topic::new(imu, "sensor_msgs::msg::dds_::Imu_")));
        }
        for (row, touch) in mission.touches().iter().enumerate() {
            if let Some(name) = topics.ranges.get(&touch.name) {
                heard.push((Content::Touch(row), Topic::new(name, "std_msgs::msg::dds_::Bool_")));
            }
        }
        if let Some(hazards) = mission.hazards_topic() {
            let hazards =
                Topic::new(&hazards, "irobot_create_msgs::msg::dds_::HazardDetectionVector_");
            heard.push((Content::Hazards, hazards));
        }
        let command = Topic::new(&topics.cmd_vel, command);
        heard.push((Content::Command, command.clone()));
        Self { command, heard }
    }
}
