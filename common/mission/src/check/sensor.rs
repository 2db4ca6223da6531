use super::objection::{Result, all_within, objection, refuse_if};
use crate::{
    INFRARED_RANGERS, MOST_BEAMS, MOST_LASERS, MOST_SENSORS, Method, Mission, Protocol, SONARS,
    SensorKind, SensorRow, Sensors, SonarConfig, address::Address,
};

const KEY: &str = "robot.sensor";
const LONGEST_NAME: usize = 23;

pub(super) fn check(mission: &Mission) -> Result {
    let sonar = &mission.sonar;
    channel("sonar.index", SensorKind::Cone, sonar.index)?;
    all_within([
        ("sonar.forward_m", sonar.forward_m, -5.0..=5.0, "m"),
        ("sonar.bearing_deg", sonar.bearing_deg, -180.0..=180.0, "degrees"),
    ])?;
    let rows = &mission.robot.sensors;
    let problem = format!("{} rows exceed the limit of {MOST_SENSORS}", rows.len());
    refuse_if(rows.len() > MOST_SENSORS, KEY, problem, "remove some")?;
    let speaks_x80 = mission.robot.protocol() == Protocol::X80;
    let is_simulated = mission.robot.address.is_none();
    for (index, row) in rows.iter().enumerate() {
        let SensorRow { name, kind, .. } = row;
        self::row(row, mission.robot.rate_hz)?;
        let has_channel = speaks_x80 || is_simulated && row.channel.is_some();
        if has_channel && *kind != SensorKind::Scan {
            its_channel(row)?;
        }
        let mut earlier = rows[..index].iter();
        let is_called_so = earlier.clone().any(|other| other.name == *name);
        refuse_if(is_called_so, KEY, format!("two rows are named {name:?}"), "rename one")?;
        let is_shared =
            has_channel && earlier.any(|it| (it.kind, it.channel) == (*kind, row.channel));
        let problem = format!("{name:?} shares its channel with another {kind:?}");
        refuse_if(is_shared, KEY, problem, "give each its own channel")?;
    }
    let written = |kind| rows.iter().filter(|row| row.kind == kind).count();
    let sonars = written(SensorKind::Cone);
    let rays = written(SensorKind::Ray);
    refuse_if(
        is_simulated && (sonars > SONARS || rays > INFRARED_RANGERS),
        KEY,
        format!("{sonars} cones and {rays} rays exceed what the simulator has"),
        format!("give at most {SONARS} cones and {INFRARED_RANGERS} rays, or robot.address"),
    )?;
    let lasers = written(SensorKind::Scan);
    let problem = format!("{lasers} lasers exceed the limit of {MOST_LASERS}");
    refuse_if(lasers > MOST_LASERS, KEY, problem, "remove some")?;
    let beams: usize = mission.lasers().iter().map(|(_, laser)| laser.beams).sum();
    let problem = format!("the lasers have {beams} beams in total, and the limit is {MOST_BEAMS}");
    refuse_if(beams > MOST_BEAMS, KEY, problem, "give some of them fewer beams")?;
    refuse_if(
        speaks_x80 && !mission.lasers_of_base().is_empty(),
        KEY,
        "an X80 supports only RPLIDARs as lasers",
        "remove it, give it the model rplidar-a1 or rplidar-c1, or give robot.protocol = \"json\" or \"ros2\"",
    )?;
    wire(mission)?;
    let is_blind = !rows.is_empty() && lasers + written(SensorKind::Cone) == 0;
    refuse_if(is_blind, KEY, "no row is a cone or a laser", "add the front sonar")?;
    refuse_if(
        !rows.is_empty() && *sonar != SonarConfig::default(),
        "sonar",
        "it conflicts with robot.sensor",
        "remove it: the rows of robot.sensor place the front sonar",
    )?;
    let used = |kind| mission.used(kind);
    let lacks = match mission.sensors {
        _ if mission.method == Method::Paper && used(SensorKind::Cone) == 0 => "a sonar",
        Some(Sensors::Laser) if used(SensorKind::Scan) == 0 => "a laser",
        Some(Sensors::FrontInfrared) if used(SensorKind::Ray) == 0 => "a ray",
        Some(Sensors::ThreeFront) if used(SensorKind::Cone) < 2 => "a cone beside the front one",
        _ => return Ok(()),
    };
    Err(objection("sensors", format!("robot.sensor lacks {lacks}"), "add a row, or give \"all\""))
}

pub(super) fn name(key: &'static str, name: &str) -> Result {
    let plain = |c: char| c.is_ascii_alphanumeric() || c == '-';
    refuse_if(
        name.is_empty() || name.len() > LONGEST_NAME || !name.chars().all(plain),
        key,
        format!("{name:?} is invalid as a sensor name"),
        format!("use at most {LONGEST_NAME} letters, digits and '-'"),
    )
}

fn row(row: &SensorRow, rate_hz: f64) -> Result {
    let SensorRow { name, kind, roll_deg, .. } = row;
    let is_scan = *kind == SensorKind::Scan;
    self::name(KEY, name)?;
    all_within([
        (KEY, row.forward_m, -5.0..=5.0, "m of forward_m"),
        (KEY, row.bearing_deg, -180.0..=180.0, "degrees of bearing_deg"),
        (KEY, row.turned_deg, -180.0..=180.0, "degrees of turned_deg"),
    ])?;
    refuse_if(
        row.turned_deg != 0.0 && !is_scan,
        KEY,
        "turned_deg applies only to a laser",
        "remove turned_deg",
    )?;
    refuse_if(
        *roll_deg != 0.0 && (*roll_deg != 180.0 || !is_scan),
        KEY,
        format!("{name:?} has roll_deg = {roll_deg}"),
        "give 180 for a laser that is mounted upside down, and remove the key for other sensors",
    )?;
    all_within([(KEY, row.height_m.unwrap_or_default(), 0.0..=5.0, "m of height_m")])?;
    let has_height = row.height_m.is_some();
    refuse_if(has_height && !is_scan, KEY, "height_m applies only to a laser", "remove it")?;
    if let Some(model) = row.model {
        let problem = format!("model {model:?} is not of kind {kind:?}");
        refuse_if(model.product().kind != *kind, KEY, problem, "remove model, or change kind")?;
    }
    let has_view = row.field_of_view_deg.is_some();
    let (reach, view, most) = match kind {
        SensorKind::Cone => (0.3..=2.55, 5.0..=60.0, 1),
        SensorKind::Ray => (0.2..=0.81, 0.0..=0.0, 1),
        SensorKind::Scan => (0.5..=30.0, 10.0..=360.0, MOST_BEAMS),
    };
    let reach_m = row.reach_m.unwrap_or(*reach.end());
    all_within([
        (KEY, reach_m, reach, "m of reach_m"),
        (KEY, row.beams.map_or(1.0, f64::from), 1.0..=most as f64, "beams"),
    ])?;
    let is_ray = *kind == SensorKind::Ray;
    refuse_if(is_ray && has_view, KEY, "a ray has no field of view", "remove field_of_view_deg")?;
    let view_deg = row.field_of_view_deg.unwrap_or(*view.end());
    all_within([
        (KEY, view_deg, view, "degrees of field_of_view_deg"),
        (KEY, row.rate_hz.unwrap_or(rate_hz), 0.1..=rate_hz, "Hz of rate_hz"),
    ])
}

fn wire(mission: &Mission) -> Result {
    let is_real = mission.robot.address.is_some();
    let rplidars = mission.rplidars();
    refuse_if(
        rplidars.len() > 1 && !is_real,
        KEY,
        format!(
            "{} lasers have their own wires, and a simulated robot supports one",
            rplidars.len()
        ),
        "keep one, or set robot.protocol = \"json\", with which the robot sends the others",
    )?;
    for row in &mission.robot.sensors {
        let own = rplidars.iter().find(|(_, sensor, _)| sensor.name == row.name);
        let name = &row.name;
        let has_address = row.address.is_some();
        refuse_if(
            has_address && own.is_none(),
            KEY,
            format!("{name:?} has an address, but only RPLIDARs have their own wires"),
            "remove it, or give model = \"rplidar-a1\" or \"rplidar-c1\"",
        )?;
        if let Some(address) = &row.address {
            let parsed = address.parse::<Address<String>>();
            let is_wire = parsed.is_ok_and(|address| !matches!(address, Address::Ros2(_)));
            let problem = format!("{address:?} is invalid as the address of a laser");
            refuse_if(
                !is_wire,
                KEY,
                problem,
                "give a serial line such as \"serial:///dev/ttyUSB1\"",
            )?;
        }
        refuse_if(
            own.is_some() && is_real != has_address,
            KEY,
            format!("of the laser {name:?} and the robot, one is real and the other simulated"),
            "give both address and robot.address, or neither",
        )?;
        refuse_if(
            own.is_some_and(|(_, sensor, _)| sensor.field_of_view_deg < 360.0),
            KEY,
            format!("{name:?} always has a field of view of 360 degrees"),
            "remove field_of_view_deg",
        )?;
    }
    Ok(())
}

fn its_channel(row: &SensorRow) -> Result {
    let number = row.channel.ok_or_else(|| {
        objection(
            KEY,
            format!("{:?} has no channel, and an X80 sends readings by channel", row.name),
            "give channel: 0 to 5 for a sonar, 0 to 6 for an infrared ranger",
        )
    })?;
    channel(KEY, row.kind, number)
}

fn channel(key: &'static str, kind: SensorKind, channel: u8) -> Result {
    let (channels, remedy) = match kind {
        SensorKind::Cone => (SONARS, "give 0 to 5 for a sonar; 1 is the front one of an X80"),
        SensorKind::Ray => (INFRARED_RANGERS, "give 0 to 6 for an infrared ranger"),
        // The boards have no laser.
        SensorKind::Scan => return Ok(()),
    };
    let problem = format!("the robot has no {kind:?} on channel {channel}");
    refuse_if(usize::from(channel) >= channels, key, problem, remedy)
}

#[cfg(test)]
mod tests {
    use crate::testing::{assert_refused, laser, mission};

    const FRONT: &str = "[[robot.sensor]]\nname = 'front'\nkind = 'cone'\nchannel = 1\nforward_m = 0.19\nbearing_deg = 0\n";

    #[test]
    fn a_row_that_the_robot_cannot_have_is_refused_with_its_key() {
        let second = |set: &str| format!("{FRONT}{}{set}", FRONT.replace("'front'", "'second'"));
        let rows = |count: u32, row: &str| -> String {
            (0..count).map(|index| row.replace("front", &format!("s{index}"))).collect()
        };
        let json = rows(7, &FRONT.replace("channel = 1\n", ""));
        assert_refused([
            (FRONT.replace("= 1", "= 6"), "channel 6"),
            (FRONT.replace("cone", "ray").replace("= 1", "= 7"), "channel 7"),
            (FRONT.replace("cone", "ray"), "no row is a cone"),
            (FRONT.replace("'front'", "'a b'"), "invalid as a sensor name"),
            (FRONT.replace("bearing_deg = 0", "bearing_deg = 200"), "bearing_deg"),
            (FRONT.replace("0.19", "nan"), "forward_m"),
            (FRONT.replace("channel = 1\n", ""), "\"front\" has no channel"),
            (format!("{FRONT}roll_deg = 180"), "\"front\" has roll_deg = 180"),
            (format!("{FRONT}reach_m = 3"), "reach_m"),
            (format!("{FRONT}field_of_view_deg = 90"), "field_of_view_deg"),
            (format!("{FRONT}rate_hz = 100"), "rate_hz"),
            (format!("{FRONT}turned_deg = 90"), "only to a laser"),
            (format!("{FRONT}turned_deg = 200"), "turned_deg"),
            (format!("{FRONT}model = 'x80-infrared'"), "X80Infrared"),
            (second("").replace("'second'", "'front'"), "two rows are named"),
            (second(""), "shares its channel"),
            (rows(17, FRONT), "17 rows"),
            (format!("robot.protocol = 'json'\n{json}"), "7 cones and 0 rays exceed"),
            (second(""), "m.toml:2: robot.sensor: "),
            (format!("sonar.index = 2\n{FRONT}"), "m.toml:2: sonar: "),
            (format!("sensors = 'front+infrared'\n{FRONT}"), "m.toml:2: sensors: "),
            (format!("sensors = 'three-front'\n{FRONT}"), "m.toml:2: sensors: "),
        ]);
    }

    #[test]
    fn lasers_roll_by_180_degrees_or_not_and_up_to_4_have_16384_beams_together_and_one_simulated_line()
     {
        let many = |count: usize, protocol: &str, keys: &str| {
            let rows: String = (0..count).map(|nth| laser(&format!("l{nth}"), keys)).collect();
            format!("robot.counts_per_turn = 1320\nrobot.protocol = '{protocol}'\n{rows}")
        };
        for good in ["roll_deg = 180\nbeams = 16384", "roll_deg = 0", "beams = 1440"] {
            mission(&many(1, "json", good));
        }
        mission(&many(4, "json", "height_m = 0.1"));
        mission(&many(1, "arduino", "model = 'rplidar-a1'"));
        assert_refused([
            (many(1, "json", "roll_deg = 90"), "upside down"),
            (many(1, "json", "roll_deg = -180"), "upside down"),
            (many(1, "json", "roll_deg = nan"), "upside down"),
            (many(1, "json", "roll_deg = 181"), "upside down"),
            (many(1, "json", "beams = 16385"), "beams"),
            (many(5, "json", ""), "5 lasers exceed"),
            (many(2, "json", "beams = 9000"), "18000 beams"),
            (many(2, "arduino", "model = 'rplidar-a1'"), "2 lasers have their own wires"),
            (many(1, "json", "height_m = -1"), "height_m"),
        ]);
    }

    #[test]
    fn an_rplidar_has_an_address_of_its_own_beside_a_real_robot_and_none_beside_a_simulated_one() {
        let with = |robot: &str, keys: &str| {
            let counts = if robot.contains("x80") { "" } else { "robot.counts_per_turn = 1320\n" };
            let front = match robot {
                _ if robot.contains("x80") => FRONT.to_owned(),
                _ if robot.contains("arduino") => String::new(),
                _ => FRONT.replace("channel = 1\n", ""),
            };
            format!("robot.protocol = {robot}\n{counts}{front}") + &laser("laser", keys)
        };
        let (real, a1) = ("'arduino'\nrobot.address = 'serial:///dev/a'", "model = 'rplidar-a1'\n");
        let at = |address: &str| format!("model = 'rplidar-c1'\naddress = '{address}'\n");
        for (robot, keys, own) in [
            ("'arduino'", a1, true),
            ("'x80'", a1, true),
            (real, &*at("serial:///dev/b"), true),
            ("'json'", a1, false),
            ("'json'\nrobot.address = '1.2.3.4:5'", &*at("tcp://host:6"), true),
        ] {
            assert_eq!(!mission(&with(robot, keys)).rplidars().is_empty(), own, "{robot} {keys}");
        }
        assert_refused([
            (with("'x80'", ""), "only RPLIDARs"),
            (with(real, a1), "one is real"),
            (with("'arduino'", &at("serial:///dev/b")), "one is real"),
            (with(real, &at("ros2")), "invalid as the address"),
            (with(real, &at("dev")), "invalid as the address"),
            (
                with("'arduino'", "model = 'rplidar-a1'\nfield_of_view_deg = 90"),
                "view of 360 degrees",
            ),
            (with("'json'", "address = 'serial:///dev/b'"), "only RPLIDARs"),
        ]);
    }
}
