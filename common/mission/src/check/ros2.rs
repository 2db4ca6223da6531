use super::objection::{Result, objection, refuse_if};
use crate::{Mission, Protocol, Sensor, SensorKind, address::Address, is_default};

const LONGEST_TOPIC: usize = 200;

pub(super) fn check(mission: &Mission) -> Result {
    let robot = &mission.robot;
    let address = robot.address.as_deref().map(str::parse);
    let is_domain = matches!(address, Some(Ok(Address::Ros2(_))));
    if robot.protocol() != Protocol::Ros2 {
        refuse_if(
            is_domain,
            "robot.address",
            "the address is a ROS domain, but robot.protocol is not \"ros2\"",
            "set robot.protocol = \"ros2\", or give another address",
        )?;
        return refuse_if(
            !is_default(&robot.ros2),
            "robot.ros2",
            "it applies only to the protocol ros2",
            "set robot.protocol = \"ros2\", or remove it",
        );
    }
    refuse_if(
        !is_domain,
        "robot.address",
        "a ROS 2 robot needs a domain as its address",
        "give \"ros2\" for the domain in ROS_DOMAIN_ID, or \"ros2:0\"",
    )?;
    let topics = &robot.ros2;
    let named = [&topics.odom, &topics.scan, &topics.cmd_vel, &topics.battery];
    for name in
        named.into_iter().chain(&topics.imu).chain(&topics.hazards).chain(topics.ranges.values())
    {
        let remedy = "use letters, digits and '_' between slashes, as in \"/robot/odom\"";
        refuse_if(
            !is_topic(name),
            "robot.ros2",
            format!("{name:?} is not a ROS topic name"),
            remedy,
        )?;
    }
    let table = mission.sensor_table();
    let lasers = mission.lasers_of_base();
    let is_named = |sensor: &Sensor| topics.ranges.contains_key(&sensor.name);
    // A single laser has `robot.ros2.scan`.
    let lasers = lasers.iter().map(|(_, laser)| laser).filter(|_| lasers.len() > 1);
    let mut rangers = table.iter().filter(|sensor| sensor.kind != SensorKind::Scan).chain(lasers);
    if let Some(silent) = rangers.find(|sensor| !is_named(sensor)) {
        let problem = format!("no topic is set for the sensor {:?}", silent.name);
        let remedy = "name its topic in robot.ros2.ranges, or remove its row from robot.sensor";
        return Err(objection("robot.ros2", problem, remedy));
    }
    for name in topics.ranges.keys() {
        let touches = mission.touches();
        let is_other = !table.iter().any(|row| row.name == *name)
            && !touches.iter().any(|row| row.name == *name);
        let problem = format!("robot.ros2.ranges names {name:?}, but no sensor has that name");
        refuse_if(is_other, "robot.ros2", problem, "give the name of a row of robot.sensor")?;
    }
    Ok(())
}

fn is_topic(name: &str) -> bool {
    let plain = |c: char| c.is_ascii_alphanumeric() || c == '_';
    let token = |token: &str| {
        !token.is_empty()
            && !token.starts_with(|c: char| c.is_ascii_digit())
            && token.chars().all(plain)
    };
    name.len() <= LONGEST_TOPIC && name.strip_prefix('/').unwrap_or(name).split('/').all(token)
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;
    use crate::check::tests::refusal;

    const ROBOT: &str =
        "target = [3, 0]\nrobot.model = 'turtlebot3-burger'\nrobot.protocol = 'ros2'\n";

    #[test]
    fn a_robot_of_ros_needs_a_domain_and_other_robots_have_none() {
        Mission::parse(&format!("{ROBOT}robot.address = 'ros2'"), Path::new("m.toml")).unwrap();
        assert!(refusal(ROBOT).contains("ros2:0"));
        assert!(refusal(&format!("{ROBOT}robot.address = '1.2.3.4:5'")).contains("ROS_DOMAIN_ID"));
        assert!(refusal("target = [3, 0]\nrobot.address = 'ros2'").contains("robot.protocol"));
        assert!(refusal("target = [3, 0]\nrobot.ros2.odom = '/o'").contains("robot.protocol"));
    }

    #[test]
    fn topics_that_ros_does_not_have_and_sensors_without_a_topic_are_refused() {
        let at = format!("{ROBOT}robot.address = 'ros2:3'\n");
        for bad in ["", "/", "/a//b", "/odom/", "/7", "/a b", &"x".repeat(201)] {
            let refusal = refusal(&format!("{at}robot.ros2.odom = '{bad}'"));
            assert!(refusal.contains("not a ROS topic name"), "{refusal}");
            let refusal = self::refusal(&format!("{at}robot.ros2.imu = '{bad}'"));
            assert!(refusal.contains("not a ROS topic name"), "{refusal}");
        }
        let named = refusal(&format!("{at}robot.ros2.ranges = {{ nose = '/nose' }}"));
        assert!(named.contains("\"nose\""), "{named}");
        let laser = |name: &str| {
            format!(
                "[[robot.sensor]]\nname = '{name}'\nkind = 'scan'\nforward_m = 0\nbearing_deg = 0\n"
            )
        };
        let two = |set: &str| format!("{at}{set}\n{}{}", laser("front"), laser("back"));
        assert!(refusal(&two("robot.ros2.ranges = { front = '/f' }")).contains("sensor \"back\""));
        let named = two("robot.ros2.ranges = { front = '/f', back = '/b' }");
        Mission::parse(&named, Path::new("m.toml")).unwrap();
        let x80 = at.replace("turtlebot3-burger", "x80");
        assert!(refusal(&x80).contains("no topic is set for the sensor \"front\""));
    }
}
