use super::objection::{Result, all_within, objection, refuse_if};
use crate::{LEAST_BAUD, Mission, Protocol, SensorKind, is_default};

/// Greatest rim speed of one count per run of the speed loop, m/s. With coarser steps a robot turns
/// past its target.
const GREATEST_STEP_M_S: f64 = 0.1;

pub(super) fn check(mission: &Mission) -> Result {
    let robot = &mission.robot;
    let board = &robot.arduino;
    if robot.protocol() != Protocol::Arduino {
        let remedy = "set robot.protocol = \"arduino\", or remove it";
        let problem = "it applies only to the protocol arduino";
        return refuse_if(!is_default(board), "robot.arduino", problem, remedy);
    }
    let baud = f64::from(LEAST_BAUD)..=2_000_000.0;
    all_within([
        ("robot.arduino.baud", f64::from(board.baud), baud, "bit/s"),
        ("robot.arduino.pid_rate_hz", board.pid_rate_hz, 1.0..=1000.0, "Hz"),
    ])?;
    refuse_if(
        robot.counts_per_turn.is_none(),
        "robot.counts_per_turn",
        "the board reports counts, but the counts per turn of a wheel are missing",
        "measure robot.counts_per_turn: turn a wheel once by hand, and ask the board for `e`",
    )?;
    let step_m_s = board.pid_rate_hz * mission.body().metres_per_count();
    refuse_if(
        step_m_s > GREATEST_STEP_M_S,
        "robot.counts_per_turn",
        format!(
            "the smallest speed step is {step_m_s:.2} m/s: one count in each run of the firmware's speed loop"
        ),
        "use encoders with more counts, or lower the rate of the firmware's loop and robot.arduino.pid_rate_hz",
    )?;
    let mut table = mission.sensor_table();
    table.retain(|sensor| sensor.model.rplidar().is_none());
    if let Some(other) = table.iter().find(|sensor| sensor.kind != SensorKind::Cone) {
        let problem =
            format!("{:?} is not a sonar, the only kind of sensor on the board", other.name);
        let remedy = "give only rows of kind cone, or RPLIDARs, in robot.sensor";
        return Err(objection("robot.sensor", problem, remedy));
    }
    const PINS: &str = "robot.arduino.sonars";
    if let Some(silent) = table.iter().find(|sensor| !board.sonars.contains_key(&sensor.name)) {
        let problem = format!("the sonar {:?} has no pin", silent.name);
        let remedy = format!("add it: robot.arduino.sonars = {{ {} = 4 }}", silent.name);
        return Err(objection(PINS, problem, remedy));
    }
    for (name, pin) in &board.sonars {
        let is_other = !table.iter().any(|sensor| sensor.name == *name);
        let problem = format!("no sonar is named {name:?}");
        refuse_if(is_other, PINS, problem, "give the name of a row of robot.sensor")?;
        let uses = board.sonars.values().filter(|its_pin| *its_pin == pin).count();
        let problem = format!("two sonars share pin {pin}");
        refuse_if(uses > 1, PINS, problem, "give each its own pin")?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use crate::testing::{assert_refused, laser, read_back};

    const ROBOT: &str = "robot.protocol = 'arduino'\nrobot.counts_per_turn = 1320\nrobot.arduino.sonars = { front = 4 }\n";
    const FRONT: &str = "[[robot.sensor]]\nname = 'front'\nkind = 'cone'\nchannel = 1\nforward_m = 0.1\nbearing_deg = 0\n";

    #[test]
    fn a_board_with_counts_and_a_pin_for_each_sonar_is_accepted_and_reads_back_the_same() {
        let robot = read_back(&format!("{ROBOT}{FRONT}")).robot;
        assert_eq!((robot.arduino.baud, robot.arduino.pid_rate_hz), (57_600, 30.0));
    }

    #[test]
    fn what_the_board_cannot_have_is_refused_with_the_remedy() {
        let with = |set: &str| format!("{ROBOT}{set}\n{FRONT}");
        let but = |line: &str, other: &str| with("").replace(line, other);
        let second = FRONT.replace("'front'", "'left'").replace("= 1\n", "= 2\n");
        assert_refused([
            (ROBOT.to_owned(), "\"infrared-0\" is not a sonar"),
            (with("") + &laser("laser", "channel = 0"), "\"laser\" is not a sonar"),
            (with("robot.model = 'car'"), "can steer a car"),
            (but("robot.counts_per_turn = 1320\n", ""), "ask the board for `e`"),
            (but("1320", "20"), "one count in each run"),
            (but("robot.arduino.sonars = { front = 4 }\n", ""), "sonars = { front = 4 }"),
            (but("front = 4", "front = 4, nose = 5"), "\"nose\""),
            (but("front = 4", "front = 4, left = 4") + &second, "two sonars share pin 4"),
            (but("front = 4", "front = 256"), "256"),
            (with("robot.arduino.baud = 9600"), "19200"),
            (with("robot.arduino.pid_rate_hz = nan"), "pid_rate_hz"),
            (with("robot.address = 'ros2'"), "robot.address"),
            (but("'arduino'", "'json'"), "robot.protocol = \"arduino\""),
        ]);
    }
}
