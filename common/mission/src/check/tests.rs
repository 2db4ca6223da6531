use super::*;
use crate::testing::{assert_refused, close, mission, parse, read_back};

#[test]
fn a_target_is_all_a_mission_needs() {
    let mission = Mission::parse("target = [3, 0.5]", "dir/short.toml").unwrap();
    assert_eq!(mission.name, "short");
    assert_eq!(mission.grid_frame().resolution_m, 0.05);
    assert_eq!(mission.body().counts_per_turn, 1200.0);
    let wall = "[[world.wall]]\npoints = [[1, 2], [2, 2]]\nlight = 'glass'";
    let drum = "[[world.drum]]\nat = [1.5, 1]\nradius_m = 0.3";
    read_back(&format!("{wall}\n{drum}\n[robot]\nmodel = 'x80sv'"));
}

#[test]
fn a_list_of_targets_is_written_in_place_of_one_and_reads_back_the_same() {
    let mission = read_back("targets = [[3, 0.5], [1, -1, 90]]");
    assert_eq!(mission.target, DVec2::new(3.0, 0.5));
    let last = Waypoint { at: DVec2::new(1.0, -1.0), heading_deg: Some(90.0) };
    assert_eq!(mission.waypoints()[1..], [last]);
    assert_refused([(format!("targets = [{}]", "[1, 1],".repeat(17)), "1 to 16")]);
}

#[test]
fn a_start_is_a_place_with_or_without_a_heading_or_a_heading_at_the_origin() {
    for (keys, at, heading_deg) in [
        ("start = [1, 2, 90]", [1.0, 2.0], 90.0),
        ("start = [1, -0.5]", [1.0, -0.5], 0.0),
        ("start.heading_deg = 45", [0.0; 2], 45.0),
        ("[[world.drum]]\nat = [1, 1]\nradius_m = 0.3", [0.0; 2], 0.0),
    ] {
        let start = read_back(keys).start;
        assert_eq!((start.at, start.heading_deg), (at.into(), heading_deg), "{keys}");
    }
}

#[test]
fn a_zone_is_a_polygon_without_the_start_and_the_targets() {
    let zone = |points: &str| format!("[[zone]]\npoints = {points}\n");
    let triangle = zone("[[1, 1], [2, 1], [2, 2]]");
    let mission = read_back(&triangle);
    assert_eq!(mission.zones.len(), 1);
    // It stands nowhere.
    assert!(mission.obstacles().is_empty());
    assert_refused([
        (zone("[[1, 1], [2, 1]]"), "m.toml:2: zone: a zone has 2 corners"),
        (zone("[[-1, -1], [1, -1], [0, 1]]"), "m.toml:2: zone: the robot starts in a zone"),
        (zone("[[2, -1], [4, -1], [4, 1], [2, 1]]"), "the target [3, 0] lies inside a zone"),
        (zone("[[1, 1], [2, nan], [2, 2]]"), "is not a position"),
        (
            zone("[[1, 1], [2, 2], [2, 1], [1, 2]]"),
            "two edges of a zone cross; give its corners in order",
        ),
        (triangle.repeat(17), "17 zones are too many"),
    ]);
}

#[test]
fn the_papers_map_forgets_nothing_with_time() {
    let set = "mapper.forget_after_s = 600";
    assert_eq!(mission(set).mapper.forget_after_s, Some(600.0));
    assert_refused([(format!("{set}\nmethod = 'paper'"), "only grows")]);
}

#[test]
fn every_refusal_names_line_and_key() {
    assert_refused([
        ("target = [30, 0]", "m.toml:1: target: "),
        ("target = [nan, 0]", "m.toml:1: target: "),
        ("[perimeter]\ncells = 4", "m.toml:3: perimeter.cells: "),
        ("[perimeter]\ncells = 100000", "m.toml:3: perimeter.cells: "),
        ("speeed = 3", "m.toml:2: unknown field `speeed`"),
        ("\n[controller]\nspeed_m_s = nan", "m.toml:4: controller.speed_m_s: "),
        ("target = 3", "m.toml:1: invalid type"),
        ("target = [3, 0", "m.toml:1: "),
        (
            "[[world.drum]]\nat = [0.3, 0]\nradius_m = 0.2",
            "m.toml:2: world: a shape stands 0.10 m from the start",
        ),
        (
            "start = [2, 0.2]\n[[world.drum]]\nat = [2, 0]\nradius_m = 0.3",
            "move it away from [2, 0.2]",
        ),
        ("[robot]\nleft = { channel = 1, reversed = true }", "m.toml:3: robot.left: "),
        ("[robot]\naddress = 'http://x80:80'", "m.toml:3: robot.address: "),
        (
            "[robot]\nwheelbase_m = 0.2",
            "m.toml:3: robot.wheelbase_m: this robot has two driven wheels",
        ),
        ("[robot]\nmodel = 'car'\nsteering_limit_deg = 90", "m.toml:4: robot.steering_limit_deg: "),
        ("[robot]\nmodel = 'jackal'\nradius_m = 5", "m.toml:4: robot.radius_m: "),
        ("[robot.odometry]\ntrack_scale = 3", "m.toml:3: robot.odometry.track_scale: "),
        ("method = 'paper'\nsensors = 'front+infrared'", "m.toml:3: sensors: "),
        ("method = 'paper'\nsensors = 'front+infrared'", "evidential"),
        ("sensors = 'infrared'", "front+infrared"),
        ("target = [3, 0]\ntargets = [[2, 0]]", "m.toml:2: targets: target and targets"),
        ("targets = [[2, 0], [30, 0]]", "m.toml:1: targets: "),
        ("targets = [[2, 0], [nan, 0]]", "m.toml:1: targets: "),
        ("targets = [[2, 0], [3]]", "m.toml:1: a place is [x, y]"),
        ("start = [9, 0]", "m.toml:1: perimeter.centre: the robot's start [9, 0]"),
        ("start = [9]", "m.toml:2: start is [x, y]"),
        ("start.headin = 3", "m.toml:2: start is [x, y]"),
        ("targets = [[2, 0, 400]]", "m.toml:1: targets: "),
        ("targets = [[2, 0, 90]]\nrobot.model = 'car'", "m.toml:1: targets: a car"),
        ("targets = []", "m.toml:1: missing field `target`, or `stay = true` to wait for one"),
        ("description = ''", "m.toml:1: missing field `target`, or `stay = true` to wait for one"),
        (
            "targets = [[2, 0], [3, 0]]\n[[known.drum]]\nat = [3, 0]\nradius_m = 0.2",
            "m.toml:2: known: the target [3, 0] lies inside",
        ),
        // No number of a list that is too long is dropped in silence.
        ("target = [1, 2, 3]", "target: the list has 3 values instead of 2"),
        ("perimeter.centre = [0, 0, 1]", "perimeter.centre: the list has 3 values instead of 2"),
        (
            "[[world.wall]]\npoints = [[1, 1], [2, 2, 0]]",
            "world.wall.points: the list has 3 values instead of 2",
        ),
    ]);
}

#[test]
fn a_car_has_the_presets_of_its_model_and_what_the_mission_overrides() {
    let mission = read_back(
        "method = 'paper'\n[robot]\nmodel = 'car'\nsteering_limit_deg = 45\nwheelbase_m = 0.3",
    );
    let car = mission.body().ackermann().unwrap();
    close(car.least_turning_radius(), 0.3);
    // The preset's.
    assert_eq!(mission.body().steering.unwrap().counts_per_turn, 3600.0);
}

#[test]
fn no_robot_is_faster_than_it_rests_within_its_sight_and_one_that_is_to_be_is_remarked_on() {
    let heavy = "robot.response = { delay_s = 0.2, acceleration_m_s2 = 0.2 }\ncontroller.speed_m_s";
    let fast = mission(&format!("{heavy} = 1"));
    let (speed, radius_m) = (fast.speed_m_s(), fast.body().radius_m);
    // A sonar of 2.55 m, silent after 0.75 s.
    let way_m = fast.body().response.way_to_stop_m(speed, 0.75 + 0.2 + fast.body().response.lag_s);
    assert!((way_m - (2.55 - radius_m)).abs() < 1e-9 && speed > 0.5, "{speed} {way_m}");
    assert!(fast.remarks[0].starts_with("m.toml:3: controller.speed_m_s: 1 is more than"));
    for (keys, speed_m_s) in [
        (&*format!("{heavy} = 0.4"), 0.4),
        ("sensing = false\nmethod = 'paper'\ncontroller.speed_m_s = 1", 1.0),
        ("robot.model = 'jackal'", 2.0),
    ] {
        let mission = mission(keys);
        assert_eq!((mission.speed_m_s(), mission.remarks.len()), (speed_m_s, 0), "{keys}");
    }
    let blind = "robot.radius_m = 3\nrobot.track_m = 1\ncontroller.speed_m_s = 0.2";
    assert_refused([(blind, "looks beyond the body")]);
    assert_refused([(format!("{heavy} = 2"), "2 m/s is out of range")]);
}

#[test]
fn a_footprint_makes_the_radius_that_covers_it_and_a_radius_alone_makes_a_disc() {
    let body = |robot: &str| mission(&format!("[robot]\n{robot}")).body();
    let long = "[robot]\nfootprint = [[-0.3, -0.1], [0.4, -0.1], [0.4, 0.1], [-0.3, 0.1]]";
    let covered = mission(long).body();
    close(covered.radius_m, 0.4_f64.hypot(0.1));
    assert!(covered.footprint.is_some());
    for model in ["jackal", "turtlebot3-waffle"] {
        let preset = body(&format!("model = '{model}'"));
        assert!(preset.footprint.unwrap().circumscribed_m() <= preset.radius_m, "{model}");
        let disc = body(&format!("model = '{model}'\nradius_m = 0.3"));
        assert_eq!((disc.footprint, disc.radius_m), (None, 0.3));
    }
    assert_eq!(body("model = 'x80'").footprint, None);
    assert_refused([
        (&*format!("{long}\nradius_m = 0.4"), "does not cover robot.footprint"),
        ("robot.footprint = [[1, 0], [2, 0], [2, 1]]", "robot.footprint"),
    ]);
}

#[test]
fn what_is_allowed_and_seldom_meant_is_remarked_with_its_keys() {
    let shut = "[[known.wall]]\npoints = [[2, -1], [4, -1], [4, 1], [2, 1], [2, -1]]";
    let battery = "robot.low_battery_v.motor = 8.5";
    let heights = "simulation.heights.body_top_m = 0.02";
    for (text, words) in [
        (shut, ["m.toml:1: target: ", ""]),
        (
            "robot.model = 'car'",
            ["m.toml:2: robot.model: a car's turning radius is at least 0.31 m", ""],
        ),
        ("robot.calibration = 'c.toml'\nrobot.odometry.slip = 0.002", ["robot.calibration", ""]),
        (
            "controller.slow_radius_m = 0.1",
            ["arrival_tolerance_m: 0.15", "controller.slow_radius_m = 0.1"],
        ),
        (battery, ["m.toml:2: robot.low_battery_v: 8.5", "simulation.battery.start_v = 7.8"]),
        (heights, ["simulation.heights.ground_clearance_m", "body_top_m = 0.02"]),
        (
            "simulation.radio.outage_max_s = 0.2",
            ["simulation.radio.outage_mean_s: 0.5", "outage_max_s = 0.2"],
        ),
    ] {
        let remarks = mission(text).remarks;
        let [remark] = &remarks[..] else { panic!("{text}: {remarks:?}") };
        assert!(words.iter().all(|it| remark.contains(it)), "{remark}");
    }
    let gap = shut.replace("[2, -1]]", "[2, 0.2]]");
    for text in ["", &gap, "robot.model = 'car'\nmethod = 'paper'"] {
        assert_eq!(parse(text).unwrap().remarks, Vec::<String>::new(), "{text}");
    }
}
