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
    use crate::check::tests::refusal;

    #[test]
    fn a_bumper_that_nobody_reports_or_that_no_body_has_is_refused() {
        let row = "[[robot.touch]]\nname = 'nose'\nkind = 'bumper'\nbearing_deg = 0\n";
        let robot = "target = [3, 0]\nrobot.model = 'kobuki'\n";
        let ros2 = format!("{robot}robot.protocol = 'ros2'\nrobot.address = 'ros2'\n");
        let good = format!("{ros2}robot.ros2.ranges = {{ nose = '/bump' }}\n{row}");
        crate::Mission::parse(&good, std::path::Path::new("m.toml")).unwrap();
        for (text, problem) in [
            (format!("target = [3, 0]\n{row}"), "does not carry touch sensors"),
            (format!("{ros2}{row}"), "no topic is set"),
            (format!("{robot}{row}{row}"), "two rows are named"),
            (format!("{robot}{}", row.replace("nose", "laser")), "two rows are named"),
            (format!("{robot}{}", row.replace("nose", "a b")), "invalid as a sensor name"),
            (format!("{robot}{row}wide_deg = 190"), "wide_deg"),
            (format!("{robot}{}", row.repeat(17)), "17 rows"),
        ] {
            let refusal = refusal(&text);
            assert!(refusal.contains(problem), "{text}: {refusal}");
        }
    }
}
