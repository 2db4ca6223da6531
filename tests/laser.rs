//! Tests of robots with a simulated laser, through real processes.

use std::sync::{
    Arc,
    atomic::{AtomicBool, Ordering},
};

use common::json_wire::{Lines, Report, line, parse};
use recording::Recording;
use rustix::process::Signal;

use crate::support::{
    Run, STAGES, printed, replayed, run,
    wire::{Proxy, Robot},
};

#[test]
fn a_robot_with_a_laser_arrives_though_each_stage_is_killed_and_replays_to_the_bit() {
    let robot = ["--pace", "1", "--set", "robot.model='kobuki'", "--set", "robot.rate_hz=20"];
    // The robot arrives only after the last kill.
    let slow = ["--set", "controller.speed_m_s=0.35"];
    let mut run =
        Run::under_way("laser-kills", "obstacle-course", &[&robot[..], &slow].concat(), 0.3);
    for topic in ["scan", "scan_fix"] {
        printed(&["topic", "echo", topic, "--robot", "laser-kills", "-n", "1"]);
    }
    run.kill_each(Signal::KILL);
    let (_, directory) = run.arrives_in();
    let recording = Recording::open(&directory.path().join("run/recording.mcap")).unwrap();
    assert!(recording.counts["scan"] > 100, "{:?}", recording.counts);
    assert!(recording.counts["foxglove/scan/laser"] > 100, "{:?}", recording.counts);
    let report = replayed(&recording);
    assert!(report.equal() >= 2 * STAGES.len() as u64, "{report}");
}

/// Two lasers of half a circle each.
const TWO_LASERS: [&str; 8] = [
    "--set",
    "robot.model='kobuki'",
    "--set",
    "robot.rate_hz=10",
    "--set",
    "robot.sensor=[{name='front', kind='scan', forward_m=0.1, bearing_deg=0, field_of_view_deg=180, beams=91}, {name='back', kind='scan', forward_m=0.1, bearing_deg=180, field_of_view_deg=180, beams=91}]",
    "--set",
    "controller.speed_m_s=0.4",
];

#[test]
fn a_robot_with_a_laser_in_front_and_one_behind_arrives_and_replays_to_the_bit() {
    let run = Run::start("two-lasers", "obstacle-course", &TWO_LASERS);
    let (summary, directory) = run.arrives_in();
    assert_eq!(summary["collisions"], 0, "{summary}");
    let recording = Recording::open(&directory.path().join("run/recording.mcap")).unwrap();
    for laser in ["front", "back"] {
        assert!(recording.counts[&format!("foxglove/scan/{laser}")] > 50, "{:?}", recording.counts);
    }
    replayed(&recording);
}

#[test]
fn a_robot_of_json_one_of_whose_two_lasers_dies_stands_by_its_name_and_goes_on_when_it_is_back() {
    let robot = Robot::start_with(
        "obstacle-course",
        &[&["--transport", "udp", "--listen", "127.0.0.1:0"], &TWO_LASERS[..]].concat(),
    );
    let dead = Arc::new(AtomicBool::new(false));
    let (is_dead, mut lines) = (Arc::clone(&dead), Lines::default());
    let pass = move |bytes: &[u8]| {
        let without = |said: Vec<u8>| {
            let mut report: Report = parse(&said).unwrap();
            if is_dead.load(Ordering::Relaxed) {
                report.scans.remove("back");
            }
            line(&report)
        };
        lines.push(bytes).into_iter().flat_map(without).collect()
    };
    let proxy = Proxy::before(&robot, Box::new(<[u8]>::to_vec), Box::new(pass));
    let address = proxy.as_robot();
    let arguments = [&["--set", &*address], &TWO_LASERS[..]].concat();
    let mut run = Run::under_way("laser-dies", "obstacle-course", &arguments, 1.0);
    dead.store(true, Ordering::Relaxed);
    run.wait_until("it stands", |status| status["link"]["cause"] == "ranging sensor silent");
    assert!(run.link_logged(&["WARN", "no valid reading from back;"]));
    dead.store(false, Ordering::Relaxed);
    run.arrives();
}

#[test]
fn by_its_laser_a_robot_whose_wheels_are_not_what_they_should_be_knows_where_it_is() {
    for seed in ["1", "2", "3"] {
        let robot = ["--set", "robot.model='kobuki'", "--set", "robot.rate_hz=10", "--seed", seed];
        let harsh = ["--set", "simulation.realism='harsh'", "--set", "controller.speed_m_s=0.5"];
        let (code, summary) = run("laser-harsh", "obstacle-course", &[&robot[..], &harsh].concat());
        assert_eq!(code, Some(0), "{summary}");
        assert!(summary["pose_error_m"].as_f64().unwrap() < 0.12, "seed {seed}: {summary}");
    }
}

#[test]
fn a_laser_that_is_late_and_turns_slowly_and_says_so_places_the_robot_like_a_prompt_one() {
    for late in [["0.2", "0"], ["0", "0.2"], ["0.3", "0.2"]] {
        let [delay, sweep] = late;
        let times = [
            format!("simulation.laser.delay_s={delay}"),
            format!("simulation.laser.sweep_s={sweep}"),
        ];
        let robot = ["--set", "robot.model='kobuki'", "--seed", "2"];
        let arguments = [&robot[..], &["--set", &times[0], "--set", &times[1]]].concat();
        let (code, summary) = run("laser-late", "obstacle-course", &arguments);
        assert_eq!(code, Some(0), "{summary}");
        assert!(summary["pose_error_m"].as_f64().unwrap() < 0.1, "{late:?}: {summary}");
    }
}

/// Runs a robot of 0.9 by 0.4 m with a laser in a room of 8 m, with these targets and walls.
fn long_robot(robot: &str, targets: &str, walls: &str) -> (Option<i32>, serde_json::Value) {
    let text = format!(
        "targets = {targets}\nperimeter = {{ width_m = 8, centre = [1.5, 0] }}\nworld.wall = {walls}\n\
         [robot]\nmodel = 'jackal'\n\
         footprint = [[-0.45, -0.2], [0.45, -0.2], [0.45, 0.2], [-0.45, 0.2]]"
    );
    let directory = tempfile::tempdir().unwrap();
    let file = directory.path().join("long.toml");
    std::fs::write(&file, text).unwrap();
    run(robot, file.to_str().unwrap(), &["--seed", "3"])
}

#[test]
fn a_long_robot_passes_a_gap_narrower_than_its_length_and_turns_behind_it() {
    let wall = "[{ points = [[1, -4], [1, -0.35]] }, { points = [[1, 0.35], [1, 4]] }]";
    let (code, summary) = long_robot("long-gap", "[[2.5, 0.5, 90]]", wall);
    assert_eq!((code, &summary["collisions"]), (Some(0), &0.into()), "{summary}");
}

#[test]
fn a_heavy_rectangle_passes_the_loose_end_of_a_wall_untouched_as_stated_and_as_found() {
    let text = "target = [7.05, -0.44]\nstart.heading_deg = -76.5\ntimeout_s = 144\n\
        perimeter = { width_m = 10.7, centre = [3.53, 0.12] }\nrobot.model = 'jackal'\n\
        simulation.wheels = { acceleration_m_s2 = 0.3, delay_s = 0.1 }\n\
        [world]\ndrum = [{ at = [2.604, -0.51], radius_m = 0.254 }, { at = [3.682, -0.471], radius_m = 0.234 }]\n\
        wall = [{ points = [[-1.2, -1.897], [8.25, -1.897], [8.25, 1.897], [-1.2, 1.897], [-1.2, -1.897]] },\n\
                { points = [[1.894, 0.466], [2.344, 2.141]] }]";
    let directory = tempfile::tempdir().unwrap();
    let file = directory.path().join("heavy.toml");
    std::fs::write(&file, text).unwrap();
    let stated = ["--set", "robot.response={delay_s=0.1,acceleration_m_s2=0.3}"];
    for (robot, more) in [("heavy-stated", &stated[..]), ("heavy-found", &[])] {
        let arguments = [&["--seed", "3"], more].concat();
        let (code, summary) = run(robot, file.to_str().unwrap(), &arguments);
        assert_eq!((code, &summary["collisions"]), (Some(0), &0.into()), "{summary}");
    }
}

#[test]
fn a_long_robot_refuses_to_turn_to_its_heading_in_a_corridor_and_touches_nothing() {
    let walls = "[{ points = [[0.8, 0.4], [3.2, 0.4], [3.2, -0.4], [0.8, -0.4]] }]";
    let (_, summary) = long_robot("long-corridor", "[[2.2, 0, 90]]", walls);
    assert_eq!(summary["outcome"], "unreachable", "{summary}");
    assert_eq!(summary["collisions"], 0, "{summary}");
    let (code, summary) = long_robot("long-return", "[[2.2, 0], [-0.5, 0, 180]]", walls);
    assert_eq!((code, &summary["collisions"]), (Some(0), &0.into()), "{summary}");
}
