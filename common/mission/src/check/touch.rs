use super::objection::{Result, all_within, refuse_if};
use crate::{MOST_TOUCHES, Mission, Protocol};

const KEY: &str = "robot.touch";

pub(super) fn check(mission: &Mission) -> Result {
    let robot = &mission.robot;
    let rows = &robot.touches;
    let problem = format!("{} rows exceed the limit of {MOST_TOUCHES}", rows.len());
    refuse_if(rows.len() > MOST_TOUCHES, KEY, problem, "remove some")?;
    refuse_if(
        !rows.is_empty() && !robot.protocol().has_scans(),
        KEY,
        "the robot's protocol does not carry touch sensors",
        "remove them, or give robot.protocol = \"json\" or \"ros2\"",
    )?;
    let sensors = mission.sensor_table();
    for (index, row) in rows.iter().enumerate() {
        let name = &row.name;
        super::sensor::name(KEY, name)?;
        all_within([
            (KEY, row.bearing_deg, -180.0..=180.0, "degrees of bearing_deg"),
            (KEY, row.wide_deg, 5.0..=180.0, "degrees of wide_deg"),
            (KEY, row.forward_m.unwrap_or_default(), 0.0..=5.0, "m of forward_m"),
        ])?;
        let is_taken = rows[..index].iter().any(|other| other.name == *name)
            || sensors.iter().any(|sensor| sensor.name == *name);
        refuse_if(is_taken, KEY, format!("two rows are named {name:?}"), "rename one")?;
        let is_heard = robot.ros2.hazards.is_some() || robot.ros2.ranges.contains_key(name);
        refuse_if(
            robot.protocol() == Protocol::Ros2 && !is_heard,
            KEY,
            format!("no topic is set for {name:?}"),
            "name a std_msgs/Bool topic in robot.ros2.ranges, or set robot.ros2.hazards",
        )?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use crate::testing::{assert_refused, mission};

    #[test]
    fn a_bumper_that_nobody_reports_or_that_no_body_has_is_refused() {
        let row = "[[robot.touch]]\nname = 'nose'\nkind = 'bumper'\nbearing_deg = 0\n";
        let kobuki = |rows: &str| format!("robot.model = 'kobuki'\n{rows}");
        let ros2 = |rows: &str| kobuki("robot.protocol = 'ros2'\nrobot.address = 'ros2'\n") + rows;
        mission(&ros2(&format!("robot.ros2.ranges = {{ nose = '/bump' }}\n{row}")));
        assert_refused([
            (row.to_owned(), "does not carry touch sensors"),
            (ros2(row), "no topic is set"),
            (kobuki(&row.repeat(2)), "two rows are named"),
            (kobuki(&row.replace("nose", "laser")), "two rows are named"),
            (kobuki(&row.replace("nose", "a b")), "invalid as a sensor name"),
            (kobuki(&format!("{row}wide_deg = 190")), "wide_deg"),
            (kobuki(&row.repeat(17)), "17 rows"),
        ]);
    }
}
