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
    use crate::testing::{assert_refused, laser, mission};

    #[test]
    fn a_robot_of_ros_has_a_domain_and_topics_with_names_of_ros_and_other_robots_have_none() {
        let robot = "robot.model = 'turtlebot3-burger'\nrobot.protocol = 'ros2'\n";
        let with = |keys: &str| format!("{robot}robot.address = 'ros2:3'\n{keys}\n");
        let two = |keys: &str| with(keys) + &laser("front", "") + &laser("back", "");
        mission(&format!("{robot}robot.address = 'ros2'"));
        mission(&two("robot.ros2.ranges = { front = '/f', back = '/b' }"));
        assert_refused([
            (robot, "ros2:0"),
            (&format!("{robot}robot.address = '1.2.3.4:5'"), "ROS_DOMAIN_ID"),
            ("robot.address = 'ros2'", "robot.protocol"),
            ("robot.ros2.odom = '/o'", "robot.protocol"),
            (&with("robot.ros2.ranges = { nose = '/nose' }"), "\"nose\""),
            (&two("robot.ros2.ranges = { front = '/f' }"), "sensor \"back\""),
            (
                &with("").replace("turtlebot3-burger", "x80"),
                "no topic is set for the sensor \"front\"",
            ),
        ]);
        for bad in ["", "/", "/a//b", "/odom/", "/7", "/a b", &"x".repeat(201)] {
            assert_refused(
                ["odom", "imu"].map(|key| {
                    (with(&format!("robot.ros2.{key} = '{bad}'")), "not a ROS topic name")
                }),
            );
        }
    }
}
