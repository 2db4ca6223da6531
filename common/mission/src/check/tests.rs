use super::*;

#[track_caller]
pub(super) fn refusal(text: &str) -> String {
    match Mission::parse(text, Path::new("m.toml")) {
        Ok(_) => panic!("accepted: {text}"),
        Err(error) => error.to_string(),
    }
}

#[test]
fn a_target_is_all_a_mission_needs() {
    let mission = Mission::parse("target = [3, 0.5]", Path::new("dir/short.toml")).unwrap();
    assert_eq!(mission.name, "short");
    assert_eq!(mission.grid_frame().resolution_m, 0.05);
    assert_eq!(mission.body().counts_per_turn, 1200.0);
}

#[test]
fn a_mission_written_out_reads_back_the_same() {
    let text = "target = [3, 0.5]\n[[world.drum]]\nat = [1.5, 1]\nradius_m = 0.3\n[robot]\nmodel = 'x80sv'";
    let mission = Mission::parse(text, Path::new("m.toml")).unwrap();
    let written = toml::to_string(&mission).unwrap();
    assert_eq!(Mission::parse(&written, Path::new("x")).unwrap(), mission);
}

#[test]
fn a_list_of_targets_is_written_in_place_of_one_and_reads_back_the_same() {
    let mission = Mission::parse("targets = [[3, 0.5], [1, -1, 90]]", Path::new("m.toml")).unwrap();
    assert_eq!(mission.target, DVec2::new(3.0, 0.5));
    let last = Waypoint { at: DVec2::new(1.0, -1.0), heading_deg: Some(90.0) };
    assert_eq!(mission.waypoints()[1..], [last]);
    let written = toml::to_string(&mission).unwrap();
    assert_eq!(Mission::parse(&written, Path::new("m.toml")).unwrap(), mission);
    let seventeen = format!("targets = [{}]", "[1, 1],".repeat(17));
    assert!(refusal(&seventeen).contains("1 to 16"));
}

#[test]
fn a_start_is_a_place_with_or_without_a_heading_or_a_heading_at_the_origin() {
    let start = |keys: &str| {
        let text = format!("target = [3, 0.5]\n{keys}");
        let mission = Mission::parse(&text, Path::new("m.toml")).unwrap();
        let written = toml::to_string(&mission).unwrap();
        assert_eq!(Mission::parse(&written, Path::new("m.toml")).unwrap(), mission);
        (mission.start.at, mission.start.heading_deg)
    };
    assert_eq!(start("start = [1, 2, 90]"), (DVec2::new(1.0, 2.0), 90.0));
    assert_eq!(start("start = [1, -0.5]"), (DVec2::new(1.0, -0.5), 0.0));
    assert_eq!(start("start.heading_deg = 45"), (DVec2::ZERO, 45.0));
    assert_eq!(start(""), (DVec2::ZERO, 0.0));
    let drum = "[[world.drum]]\nat = [3, 0]\nradius_m = 0.3";
    start(drum);
    let text = format!("target = [1, 0]\nstart = [3, 0.2]\n{drum}");
    assert!(refusal(&text).contains("move it away from [3, 0.2]"));
}

#[test]
fn a_target_that_known_walls_shut_in_is_remarked_and_one_behind_a_gap_is_not() {
    let remarks = |last: &str| {
        let room = format!("points = [[2, -1], [4, -1], [4, 1], [2, 1], [2, {last}]]");
        let text = format!("target = [3, 0]\n[[known.wall]]\n{room}");
        Mission::parse(&text, Path::new("m.toml")).unwrap().remarks
    };
    assert!(remarks("-1")[0].starts_with("m.toml:1: target: "), "{:?}", remarks("-1"));
    assert!(remarks("0.2").is_empty(), "{:?}", remarks("0.2"));
}

#[test]
fn a_zone_whose_edges_cross_and_a_body_far_larger_than_its_wheels_are_refused() {
    let zone = "target = [3, 0]\n[[zone]]\npoints = [[1, 1], [2, 2], [2, 1], [1, 2]]";
    assert!(refusal(zone).contains("two edges of a zone cross; give its corners in order"));
    let body = "target = [3, 0]\n[robot]\nmodel = 'jackal'\nradius_m = 5";
    assert!(refusal(body).starts_with("m.toml:4: robot.radius_m: "), "{}", refusal(body));
}

#[test]
fn a_zone_is_a_polygon_without_the_start_and_the_targets() {
    let zone = |points: &str| format!("target = [3, 0.5]\n[[zone]]\npoints = {points}");
    let mission = Mission::parse(&zone("[[1, 1], [2, 1], [2, 2]]"), Path::new("m.toml")).unwrap();
    assert_eq!(mission.zones.len(), 1);
    let written = toml::to_string(&mission).unwrap();
    assert_eq!(Mission::parse(&written, Path::new("m.toml")).unwrap(), mission);
    assert!(mission.obstacles().is_empty(), "it stands nowhere");
    for (points, problem) in [
        ("[[1, 1], [2, 1]]", "a zone has 2 corners"),
        ("[[-1, -1], [1, -1], [0, 1]]", "the robot starts in a zone"),
        ("[[2, 0], [4, 0], [4, 1], [2, 1]]", "the target [3, 0.5] lies inside a zone"),
        ("[[1, 1], [2, nan], [2, 2]]", "is not a position"),
    ] {
        let said = refusal(&zone(points));
        assert!(said.starts_with("m.toml:2: zone: ") && said.contains(problem), "{said}");
    }
    let many = format!(
        "target = [3, 0.5]\n{}",
        "[[zone]]\npoints = [[1, 1], [2, 1], [2, 2]]\n".repeat(17)
    );
    assert!(refusal(&many).contains("17 zones are too many"));
}

#[test]
fn the_papers_map_forgets_nothing_with_time() {
    let set = "target = [3, 0]\nmapper.forget_after_s = 600";
    let mission = Mission::parse(set, Path::new("m.toml")).unwrap();
    assert_eq!(mission.mapper.forget_after_s, Some(600.0));
    assert!(refusal(&format!("{set}\nmethod = 'paper'")).contains("only grows"));
}

#[test]
fn every_refusal_names_line_and_key() {
    let cases = [
        ("target = [30, 0]", "m.toml:1: target: "),
        ("target = [nan, 0]", "m.toml:1: target: "),
        ("target = [3, 0]\n[perimeter]\ncells = 4", "m.toml:3: perimeter.cells: "),
        ("target = [3, 0]\n[perimeter]\ncells = 100000", "m.toml:3: perimeter.cells: "),
        ("target = [3, 0]\nspeeed = 3", "m.toml:2: unknown field `speeed`"),
        ("target = [3, 0]\n\n[controller]\nspeed_m_s = nan", "m.toml:4: controller.speed_m_s: "),
        ("target = 3", "m.toml:1: invalid type"),
        ("target = [3, 0", "m.toml:1: "),
        (
            "target = [3, 0]\n[[world.drum]]\nat = [0.3, 0]\nradius_m = 0.2",
            "m.toml:2: world: a shape stands 0.10 m from the start",
        ),
        (
            "target = [3, 0]\n[robot]\nleft = { channel = 1, reversed = true }",
            "m.toml:3: robot.left: ",
        ),
        ("target = [3, 0]\n[robot]\naddress = 'http://x80:80'", "m.toml:3: robot.address: "),
        (
            "target = [3, 0]\n[robot]\nwheelbase_m = 0.2",
            "m.toml:3: robot.wheelbase_m: this robot has two driven wheels",
        ),
        (
            "target = [3, 0]\n[robot]\nmodel = 'car'\nsteering_limit_deg = 90",
            "m.toml:4: robot.steering_limit_deg: ",
        ),
        ("target = [3, 0]\ntargets = [[2, 0]]", "m.toml:2: targets: target and targets"),
        ("targets = [[2, 0], [30, 0]]", "m.toml:1: targets: "),
        ("targets = [[2, 0], [nan, 0]]", "m.toml:1: targets: "),
        ("targets = [[2, 0], [3]]", "m.toml:1: a place is [x, y]"),
        ("target = [3, 0]\nstart = [9, 0]", "m.toml:1: perimeter.centre: the robot's start [9, 0]"),
        ("target = [3, 0]\nstart = [9]", "m.toml:2: start is [x, y]"),
        ("target = [3, 0]\nstart.headin = 3", "m.toml:2: start is [x, y]"),
        ("targets = [[2, 0, 400]]", "m.toml:1: targets: "),
        ("targets = [[2, 0, 90]]\nrobot.model = 'car'", "m.toml:1: targets: a car"),
        ("targets = []", "m.toml:1: missing field `target`, or `stay = true` to wait for one"),
        (
            "targets = [[2, 0], [3, 0]]\n[[known.drum]]\nat = [3, 0]\nradius_m = 0.2",
            "m.toml:2: known: the target [3, 0] lies inside",
        ),
        (
            "description = 'no target'",
            "m.toml:1: missing field `target`, or `stay = true` to wait for one",
        ),
    ];
    for (text, start) in cases {
        let refusal = refusal(text);
        assert!(refusal.starts_with(start), "{text:?} gave {refusal:?}");
    }
}

#[test]
fn a_car_has_the_presets_of_its_model_and_what_the_mission_overrides() {
    let text =
        "target = [3, 0]\n[robot]\nmodel = 'car'\nsteering_limit_deg = 45\nwheelbase_m = 0.3";
    let mission = Mission::parse(text, Path::new("m.toml")).unwrap();
    let car = mission.body().ackermann().unwrap();
    assert!((car.least_turning_radius() - 0.3).abs() < 1e-12);
    assert_eq!(mission.body().steering.unwrap().counts_per_turn, 3600.0, "the preset's");
    let written = toml::to_string(&mission).unwrap();
    assert_eq!(Mission::parse(&written, Path::new("m.toml")).unwrap().robot, mission.robot);
}

#[test]
fn a_car_that_is_to_look_first_is_remarked_on_with_its_turning_radius() {
    let car = "target = [3, 0]\nrobot.model = 'car'";
    let remarks = |text: &str| Mission::parse(text, Path::new("m.toml")).unwrap().remarks;
    let remark = &remarks(car)[0];
    assert!(
        remark.starts_with("m.toml:2: robot.model: a car's turning radius is at least 0.31 m"),
        "{remark}"
    );
    assert!(remarks(&format!("{car}\nmethod = 'paper'")).is_empty());
    assert!(remarks("target = [3, 0]").is_empty());
}

#[test]
fn no_robot_is_faster_than_it_rests_within_its_sight_and_one_that_is_to_be_is_remarked_on() {
    let mission = |text: &str| {
        let text = format!("target = [3, 0]\n{text}");
        Mission::parse(&text, Path::new("m.toml")).unwrap()
    };
    let heavy = "robot.response = { delay_s = 0.2, acceleration_m_s2 = 0.2 }\n";
    let fast = mission(&format!("{heavy}controller.speed_m_s = 1"));
    let (speed, radius_m) = (fast.speed_m_s(), fast.body().radius_m);
    // A sonar of 2.55 m, silent after 0.75 s.
    let way_m = fast.body().response.way_to_stop_m(speed, 0.75 + 0.2 + fast.body().response.lag_s);
    assert!((way_m - (2.55 - radius_m)).abs() < 1e-9 && speed > 0.5, "{speed} {way_m}");
    assert!(fast.remarks[0].starts_with("m.toml:3: controller.speed_m_s: 1 is more than"));
    let slow = mission(&format!("{heavy}controller.speed_m_s = 0.4"));
    assert_eq!((slow.speed_m_s(), slow.remarks.len()), (0.4, 0));
    let blind = mission("sensing = false\nmethod = 'paper'\ncontroller.speed_m_s = 1");
    assert_eq!(blind.speed_m_s(), 1.0);
    let laser = mission("robot.model = 'jackal'");
    assert_eq!(laser.speed_m_s(), 2.0);
    let text = format!("target = [3, 0]\n{heavy}controller.speed_m_s = 2");
    let beyond_top = Mission::parse(&text, Path::new("m.toml")).unwrap_err().to_string();
    assert!(beyond_top.contains("2 m/s is out of range"), "{beyond_top}");
}

#[test]
fn a_footprint_makes_the_radius_that_covers_it_and_a_radius_alone_makes_a_disc() {
    let parse = |robot: &str| {
        let text = format!("target = [3, 0]\n[robot]\n{robot}");
        Mission::parse(&text, Path::new("m.toml")).map(|mission| mission.body())
    };
    let long = "footprint = [[-0.3, -0.1], [0.4, -0.1], [0.4, 0.1], [-0.3, 0.1]]";
    let body = parse(long).unwrap();
    assert!((body.radius_m - 0.4_f64.hypot(0.1)).abs() < 1e-12 && body.footprint.is_some());
    for model in ["jackal", "turtlebot3-waffle"] {
        let body = parse(&format!("model = '{model}'")).unwrap();
        assert!(body.footprint.unwrap().circumscribed_m() <= body.radius_m, "{model}");
        let disc = parse(&format!("model = '{model}'\nradius_m = 0.3")).unwrap();
        assert_eq!((disc.footprint, disc.radius_m), (None, 0.3));
    }
    assert_eq!(parse("model = 'x80'").unwrap().footprint, None);
    let small = parse(&format!("{long}\nradius_m = 0.4")).unwrap_err().to_string();
    assert!(small.contains("does not cover robot.footprint"), "{small}");
    let outline = parse("footprint = [[1, 0], [2, 0], [2, 1]]").unwrap_err().to_string();
    assert!(outline.contains("robot.footprint"), "{outline}");
}

#[test]
fn no_number_of_a_list_that_is_too_long_is_dropped_in_silence() {
    for (text, key) in [
        ("target = [1, 2, 3]", "target"),
        ("target = [1, 2]\nperimeter.centre = [0, 0, 1]", "perimeter.centre"),
        ("target = [1, 2]\n[[world.wall]]\npoints = [[1, 1], [2, 2, 0]]", "world.wall.points"),
    ] {
        let refused = Mission::parse(text, Path::new("m.toml")).unwrap_err().to_string();
        assert!(
            refused.contains(&format!("{key}: the list has 3 values instead of 2")),
            "{refused}"
        );
    }
}

#[test]
fn thresholds_in_the_wrong_order_are_remarked_with_both_keys() {
    let remarks = |text: &str| {
        Mission::parse(&format!("target = [3, 0]\n{text}"), Path::new("m.toml")).unwrap().remarks
    };
    assert_eq!(remarks(""), Vec::<String>::new());
    for (text, key, other) in [
        (
            "controller.slow_radius_m = 0.1",
            "arrival_tolerance_m: 0.15",
            "controller.slow_radius_m = 0.1",
        ),
        (
            "robot.low_battery_v.motor = 8.5",
            "m.toml:2: robot.low_battery_v: 8.5",
            "simulation.battery.start_v = 7.8",
        ),
        (
            "simulation.heights.body_top_m = 0.02",
            "simulation.heights.ground_clearance_m",
            "body_top_m = 0.02",
        ),
        (
            "simulation.radio.outage_max_s = 0.2",
            "simulation.radio.outage_mean_s: 0.5",
            "outage_max_s = 0.2",
        ),
    ] {
        let [remark] = &remarks(text)[..] else { panic!("{text}") };
        assert!(remark.contains(key) && remark.contains(other), "{remark}");
    }
}
