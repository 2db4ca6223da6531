//! Tests of a laser beside a sonar.

use super::*;

/// The robot's laser has 360 beams around its centre, its sonar looks ahead from 0.2 m.
fn mapper() -> Mapper {
    let text = "target = [2, 0]\nrobot.model = 'kobuki'\nperimeter = { width_m = 5, cells = 50 }\n\
        [[robot.sensor]]\nname = 'laser'\nkind = 'scan'\nchannel = 0\nforward_m = 0\nbearing_deg = 0\nmodel = 'rplidar-a1'\n\
        [[robot.sensor]]\nname = 'sonar'\nkind = 'cone'\nchannel = 0\nforward_m = 0.2\nbearing_deg = 0\n";
    Mapper::new(&Mission::parse(text, Path::new("test.toml")).unwrap())
}

/// A robot at the origin facing along x whose laser sees a wall across its way at `wall` metres, and whose sonar hears an echo.
fn sense(mapper: &mut Mapper, tick: u64, wall: f64, echo: f64) {
    let beam = |degrees: u32| {
        let ahead = (f64::from(degrees) - 180.0).to_radians().cos();
        if ahead > 0.1 { (wall / ahead) as f32 } else { f32::INFINITY }
    };
    let sonar = RangeReading { sensor: 1, ..reading(RangeStatus::Measured, echo) };
    let input = Input::Tick {
        pose: at(tick, 0.0, 0.0, 0.0),
        ranges: vec![sonar],
        scan: (0..360).map(beam).collect(),
        contact: None,
        target: None,
    };
    mapper.step(input, MissionTime(0));
}

fn is_hazard(mapper: &Mapper, x: f64, y: f64) -> bool {
    let cell = mapper.frame().cell_at(DVec2::new(x, y)).unwrap();
    CellState::from_byte(mapper.state().cells()[mapper.frame().index(cell)]).is_hazard()
}

#[test]
fn a_thing_that_the_laser_looks_over_is_hazard_while_the_sonar_hears_it_and_after_a_restart() {
    let mut mapper = mapper();
    for tick in 0..20 {
        sense(&mut mapper, tick, 2.0, 0.4);
    }
    assert!(is_hazard(&mapper, 0.6, 0.0));
    let mut restarted = self::mapper();
    restarted.restore(mapper.state().clone()).unwrap();
    for mapper in [&mut mapper, &mut restarted] {
        sense(mapper, 20, 2.0, 0.4);
    }
    assert_eq!(mapper.state(), restarted.state());
    for tick in 21..40 {
        sense(&mut mapper, tick, 2.0, 1.8);
    }
    assert!(!is_hazard(&mapper, 0.6, 0.0), "the sonar hears that it is gone");
}

#[test]
fn an_echo_of_what_the_laser_sees_marks_nothing_beside_it() {
    let mut mapper = mapper();
    let hazards = |mapper: &Mapper| {
        let cells = mapper.state().cells().iter();
        cells.filter(|cell| CellState::from_byte(**cell).is_hazard()).count()
    };
    sense(&mut mapper, 0, 1.0, 0.8);
    let by_scan = hazards(&mapper);
    for tick in 1..5 {
        // The range has the noise of the sonar.
        sense(&mut mapper, tick, 1.0, 0.78 + 0.01 * tick as f64);
    }
    assert_eq!(hazards(&mapper), by_scan);
    sense(&mut mapper, 5, 1.0, 0.5);
    assert!(hazards(&mapper) > by_scan, "another echo does");
}

#[test]
fn a_pane_of_glass_stays_though_the_laser_looks_through_it_at_a_slant() {
    let mut mapper = mapper();
    for tick in 0..5 {
        sense(&mut mapper, tick, 0.7, 0.5);
    }
    for tick in 5..15 {
        sense(&mut mapper, tick, 2.0, 0.5);
    }
    assert!(is_hazard(&mapper, 0.6, 0.0));
}

/// The least y that is hazard before the wall y = 1.25, for several x, by a laser with this row that is mounted at `at`, metres ahead
/// of and to the left of the robot's centre, and whose middle beam looks to `looks_deg`.
fn wall_of(row: &str, at: DVec2, looks_deg: f64) -> Vec<f64> {
    let text = format!(
        "target = [2, 0]\nrobot.model = 'create3'\nperimeter = {{ width_m = 5, cells = 100 }}\n\
        [[robot.sensor]]\nname = 'laser'\nkind = 'scan'\nchannel = 0\nmodel = 'rplidar-a1'\n{row}\n"
    );
    let mut mapper = Mapper::new(&Mission::parse(&text, Path::new("test.toml")).unwrap());
    let robot = Pose2 { position: DVec2::new(0.3, -0.2), heading: 0.5 };
    let origin = robot.position + DVec2::from_angle(robot.heading).rotate(at);
    let beam = |degrees: u32| {
        let along = robot.heading + (looks_deg - 180.0 + f64::from(degrees)).to_radians();
        let range = (1.25 - origin.y) / along.sin();
        if (0.0..3.0).contains(&range) { range as f32 } else { f32::INFINITY }
    };
    for tick in 0..5 {
        let input = Input::Tick {
            pose: super::at(tick, robot.position.x, robot.position.y, robot.heading),
            ranges: Vec::new(),
            scan: (0..360).map(beam).collect(),
            contact: None,
            target: None,
        };
        mapper.step(input, MissionTime(0));
    }
    let before = |x: f64| {
        let mut ys = (0..70).map(|step| 0.525 + 0.05 * f64::from(step) / 2.0);
        ys.find(|y| is_hazard(&mapper, x, *y)).unwrap_or(f64::INFINITY)
    };
    [-0.5, 0.0, 0.3, 0.8, 1.2].map(before).to_vec()
}

#[test]
fn a_laser_that_is_turned_and_off_the_centre_maps_a_wall_where_it_is() {
    let centred = wall_of("forward_m = 0\nbearing_deg = 0", DVec2::ZERO, 0.0);
    assert!(centred.iter().all(|y| (0.95..=1.25).contains(y)), "{centred:?}");
    for (row, at, looks_deg) in [
        ("forward_m = -0.04\nbearing_deg = 0\nturned_deg = 90", DVec2::new(-0.04, 0.0), 90.0),
        ("forward_m = 0.3\nbearing_deg = 90\nturned_deg = -120", DVec2::new(0.0, 0.3), -30.0),
    ] {
        let wall = wall_of(row, at, looks_deg);
        let is_there = centred.iter().zip(&wall).all(|(one, other)| (one - other).abs() < 0.06);
        assert!(is_there, "{row}: {wall:?} instead of {centred:?}");
    }
}
