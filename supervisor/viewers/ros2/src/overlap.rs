//! Topics of the bridge that the robot's own link reads, and would take for its robot's.

use common::{
    address::Address,
    mission::{Mission, Sensor},
    run::Run,
};
use ros2::topic::Topic;

use crate::{endpoints::published, topics::Id};

pub fn overlap<'a>(
    (domain, namespace): (u16, &str),
    run: &Run,
    sensors: impl Iterator<Item = (Id, &'a str)>,
) -> Vec<(Id, String)> {
    let reads = match run.address {
        Address::Ros2(read_in) => read_in.unwrap_or_default() == domain,
        _ => false,
    };
    let read: Vec<_> = read(&run.mission).filter(|_| reads).collect();
    published(namespace, sensors)
        .map(|(_, id, name)| (id, name))
        .filter(|(_, name)| read.contains(name))
        .collect()
}

fn read(mission: &Mission) -> impl Iterator<Item = String> {
    let topics = &mission.robot.ros2;
    let is_unnamed = |(_, laser): &(usize, Sensor)| !topics.ranges.contains_key(&laser.name);
    let scan = mission.lasers_of_base().iter().any(is_unnamed).then_some(&topics.scan);
    let further = topics.imu.iter().chain(scan).chain(topics.ranges.values());
    [&topics.odom, &topics.battery].into_iter().chain(further).map(|name| Topic::new(name, "").name)
}

#[cfg(test)]
mod tests {

    use super::*;
    use common::clock::MissionClock;

    fn found(domain: u16, namespace: &str, keys: &str) -> Option<String> {
        let text = format!(
            "target = [3, 0]\nrobot.model = 'turtlebot3-burger'\nrobot.protocol = 'ros2'\nrobot.address = 'ros2:7'\n{keys}"
        );
        let mission = Mission::parse(&text, "m.toml").unwrap();
        let sensors = [(Id::Scan(0), ""), (Id::Range(1), "nose-1")];
        let run = Run {
            robot: "x80".parse().unwrap(),
            address: Address::Ros2(Some(7)),
            clock: MissionClock::Ticks { period_ns: 1 },
            mission,
        };
        overlap((domain, namespace), &run, sensors.into_iter()).into_iter().next().map(|it| it.1)
    }

    #[test]
    fn a_bridge_that_would_publish_what_the_robots_link_reads_in_its_domain_is_found_by_the_topic()
    {
        assert_eq!(found(7, "", ""), Some("/odom".to_owned()));
        assert_eq!(found(7, "/a/", "robot.ros2.odom = 'a/odom'"), Some("/a/odom".to_owned()));
        let odom = "robot.ros2.odom = '/wheels'\n";
        assert_eq!(found(7, "", odom), Some("/battery_state".to_owned()));
        let both = format!("{odom}robot.ros2.battery = '/volts'\n");
        assert_eq!(found(7, "", &both), Some("/scan".to_owned()));
        let imu = format!("{both}robot.ros2.scan = '/s'\nrobot.ros2.imu = '/range/nose_1'\n");
        assert_eq!(found(7, "", &imu), Some("/range/nose_1".to_owned()));
        assert_eq!([found(8, "", ""), found(7, "firsthand", "")], [None, None]);
    }
}
