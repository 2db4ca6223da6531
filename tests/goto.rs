//! Targets, places and zones that operators give on the command line. `simulation` drives others.

use common::samples::PoseSample;
use rustix::process::Signal;
use serde_json::Value;

use crate::support::{
    Run, assert_nothing_left, mission_file, operate, outcomes, output, printed, reached, records,
    refused, replayed_poses, wait_until, words,
};

#[test]
fn a_target_is_refused_with_the_reason_and_the_robot_keeps_the_one_it_has() {
    let robot = "goto-refused";
    let to = |line: &str, code: &str, names: &[&str]| {
        refused(&words(&format!("goto --robot {robot} {line}")), code, names);
    };
    to("1 1", "not-running", &[robot]);
    // It arrives only when it returns, on a starved machine too.
    let slow = "--pace 2 --set known.drum=[{at=[2.0,2.0],radius_m=0.3}] \
                --set controller.speed_m_s=0.005 --set timeout_s=2000";
    let mut run = Run::under_way(robot, "open-room", slow, 1.0);
    to("1", "usage", &[]);
    to("1 1 2", "no-target", &["2"]);
    to("inf 1", "no-target", &[robot]);
    to("1 1 2 2", "target-in-hazard", &["hazard"]);
    to(&["0"; 34].join(" "), "too-many-targets", &["16"]);
    to("--follow", "not-staying", &[]);
    // Each command in a row finds a place on the bus.
    for _ in 0..50 {
        to("9 0", "target-outside", &["perimeter"]);
    }
    operate(robot, "stop");
    to("1 1", "robot-stopped", &["resume"]);
    refused(&["return", "--robot", robot], "robot-stopped", &["resume"]);
    operate(robot, "resume");
    run.wait_until_driving();
    operate(robot, "return");
    let summary = run.arrives();
    assert_eq!(outcomes(&summary), ["replaced", "reached"]);
    assert!(summary["true_distance_m"].as_f64().unwrap() < 0.5, "{summary}");
    assert_eq!(summary["targets"][1]["x_m"], 0.0, "{summary}");
}

#[test]
fn a_mission_starts_from_the_map_that_an_earlier_run_saved_and_a_damaged_map_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
    let (first, second, map) = (path("first"), path("second"), path("course.yaml"));
    let set = format!("map='{map}'");
    let drive = |out: &str, more: &[&str]| {
        let common = ["run", "obstacle-course", "--robot", "prior-map", "--json", "--out", out];
        reached(&output(&[&common, more].concat()));
    };
    drive(&first, &[]);
    printed(&["map", "save", &first, "--out", &map]);
    drive(&second, &["--set", &set]);
    let mission = std::fs::read_to_string(path("second/mission.toml")).unwrap();
    assert!(mission.contains("[[known.box]]") && !mission.contains("course.yaml"), "{mission}");
    std::fs::write(path("course.pgm"), "P5 9 9 255 ").unwrap();
    refused(&["run", "obstacle-course", "--set", &set], "mission", &["course.pgm"]);
}

fn waits(status: &Value) -> bool {
    status["order"] == "waiting for a target"
}

/// Mission without a target, with a zone and a place enclosed by walls.
const STAYS: &str = "
stay = true
perimeter.width_m = 8.0
simulation.realism = 'laboratory'
[[zone]]
points = [[1.0, -3.9], [1.4, -3.9], [1.4, 1.5], [1.0, 1.5]]
[[world.wall]]
points = [[-2.2, -0.4], [-3.0, -0.4], [-3.0, 0.4], [-2.2, 0.4], [-2.2, -0.4]]
";

#[test]
fn a_robot_that_stays_takes_targets_zones_and_its_place_until_it_is_ended_and_replays_to_the_bit() {
    let robot = "goto-stay";
    let (_directory, mission) = mission_file(STAYS);
    let mut run = Run::start(robot, &mission, "--pace 4");
    let say = |line: &str, code: &str| {
        refused(&words(&format!("{line} --robot {robot}")), code, &[]);
    };
    run.wait_until("it waits for its first target", waits);
    say("goto 1.2 0", "target-in-hazard");
    say("zone -1 -1 1 -1 1 1 -1 1", "zone-here");
    say("zone 2 2 3 3", "no-zone");
    say("zone 3 3 --remove", "not-in-zone");
    operate(robot, "goto 2.2 0");
    run.wait_until_driving();
    say("place 0 0 0", "robot-moves");
    run.wait_until("it is there", waits);
    // The zone moves to the other side, which frees its old place.
    operate(robot, "zone 1 -1 1.4 -1 1.4 3.9 1 3.9");
    operate(robot, "zone 1.2 -2 --remove");
    // The supervisor judges a target by the map, which shows the change in its next part.
    let there = format!("goto 1.2 -2 0 0 --robot {robot}");
    wait_until("its old place is free", || output(&words(&there)).status.success());
    run.kill_and_await_successor("mapper", Signal::KILL);
    run.wait_until("it is back", waits);
    say("goto 1.2 2", "target-in-hazard");
    let given_up = output(&words(&format!("goto --robot {robot} -2.6 0.0 --wait")));
    assert_eq!(given_up.status.code(), Some(3), "{given_up:?}");
    let status = run.wait_until("it waits after it has given up", |status| {
        waits(status) && status["link"]["at_rest"] == true
    });
    say("place 9 0 0", "target-outside");
    operate(robot, "place 0 -2 90 --sigma 0.1");
    run.wait_until("it believes so", |after| {
        after["pose"]["x_m"].as_f64().is_some_and(|x| x.abs() < 0.1) && *after != status
    });
    wait_until("the recovery is recorded", || {
        run.records("stalls.jsonl").iter().any(|stall| stall["cause"] == "relocated")
    });
    // A record waits for the ground truth of its tick.
    wait_until("each has its record while the run goes on", || {
        run.records("targets.jsonl").len() == 4
    });
    run.signal(Signal::INT);
    let (code, summary, directory) = run.finish_in();
    assert_eq!(outcomes(&summary), ["reached", "reached", "reached", "unreachable"], "{summary}");
    assert_eq!(code, Some(0), "{summary}");
    let directory = directory.path().join("run");
    let recorded = records(&directory.join("targets.jsonl"));
    assert_eq!(summary["targets"].as_array(), Some(&recorded), "each once");
    for PoseSample { stamp, x_m, y_m, .. } in replayed_poses(&directory) {
        let is_in = (1.0..1.4).contains(&x_m) && y_m < 1.5 && y_m > -1.0;
        assert!(!is_in, "tick {} at ({x_m}, {y_m})", stamp.tick);
    }
    assert_nothing_left(robot);
}
