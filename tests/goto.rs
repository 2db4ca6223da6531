//! Tests of a robot that gets other targets while it drives.

use std::{path::Path, time::Duration};

use common::{
    bus::{Bus, decode_sample},
    geometry::wrap_angle,
    samples::{CommandSample, CommandState, PoseSample, RequestKind, RequestSample, TargetPoint},
    topics,
    waiter::Waiter,
};
use recording::{
    Recording,
    replay::{Options, replay},
};
use rustix::process::Signal;
use serde_json::Value;

use crate::support::{self, Run, json_of, operate, output, records, refused};

const PACE: [&str; 2] = ["--pace", "2"];

fn outcomes(summary: &Value) -> Vec<&str> {
    let targets = summary["targets"].as_array().unwrap();
    targets.iter().map(|target| target["outcome"].as_str().unwrap()).collect()
}

fn follow(robot: &str, mut is_enough: impl FnMut(&CommandSample) -> bool) {
    let bus = Bus::join(&support::domain(robot), "follower").unwrap();
    let mut commands = bus.reader(&topics::COMMAND).unwrap();
    let mut waiter = Waiter::default();
    waiter.on(bus.wakeup(&topics::COMMAND).unwrap());
    let began = std::time::Instant::now();
    loop {
        while let Some(command) = commands.next_sample().unwrap() {
            if is_enough(&command) {
                return;
            }
        }
        assert!(began.elapsed() < support::PATIENCE, "the awaited command did not arrive");
        waiter.wait(Duration::from_millis(100)).unwrap();
    }
}

#[track_caller]
fn assert_replays(run: &Path) {
    let mut files: Vec<_> =
        std::fs::read_dir(run).unwrap().map(|file| file.unwrap().path()).collect();
    files.retain(|file| file.extension().is_some_and(|extension| extension == "mcap"));
    assert!(!files.is_empty());
    for file in files {
        let report = replay(&Recording::open(&file).unwrap(), &Options::default()).unwrap();
        assert!(report.difference.is_none() && report.equal() > 0, "{report}");
    }
}

#[test]
fn a_robot_that_is_sent_elsewhere_in_flight_goes_on_without_a_stop() {
    let run = Run::under_way("goto-flight", "open-room", &PACE, 3.0);
    operate("goto-flight", &["goto", "1.0", "-1.0"]);
    let mut number = 0;
    follow("goto-flight", |command| {
        number = number.max(command.target_number);
        let state = command.state();
        assert!(number == 0 || state != CommandState::Halt, "{command:?}");
        number == 2 && command.v_m_s > 0.1
    });
    let (summary, directory) = run.arrives_in();
    assert_eq!(outcomes(&summary), ["replaced", "reached"]);
    let last = &summary["targets"][1];
    assert_eq!((&last["x_m"], &last["y_m"]), (&1.0.into(), &(-1.0).into()));
    assert!(summary["true_distance_m"].as_f64().unwrap() < 0.5, "{summary}");
    assert_replays(&directory.path().join("run"));
}

#[test]
fn a_list_is_driven_to_its_end_although_planner_and_supervisor_are_killed_in_between() {
    let mut run = Run::under_way("goto-list", "open-room", &PACE, 2.0);
    operate("goto-list", &["goto", "1.0", "-0.8", "1.6", "0.4"]);
    operate("goto-list", &["goto", "0.8", "0.8", "--heading", "-90", "--append"]);
    run.kill_and_await_successor("planner", Signal::KILL);
    run.wait_until("the second target of the list is reached", |status| {
        status["target"]["number"].as_u64() == Some(4)
    });
    run.kill();
    let directory = run.directory();
    let resumed = output(&["run", "--resume", directory.to_str().unwrap(), "--json"]);
    let (code, summary) = json_of(&resumed);
    let summary = summary.last().unwrap();
    assert_eq!(code.code(), Some(0), "{summary}");
    assert_eq!(outcomes(summary), ["replaced", "reached", "reached", "reached"]);
    assert_eq!(summary["resumes"], 1, "{summary}");
    let facing = records_of_pose(&directory);
    assert!((facing + std::f64::consts::FRAC_PI_2).abs() < 0.2, "it faces {facing}");
    support::assert_nothing_left("goto-list");
    assert_replays(&directory);
}

/// Returns the heading of a run's last recorded pose, radians in (-pi, pi].
fn records_of_pose(run: &Path) -> f64 {
    let mut newest = None;
    for file in std::fs::read_dir(run).unwrap().map(|file| file.unwrap().path()) {
        if file.extension().is_some_and(|extension| extension == "mcap") {
            let recording = Recording::open(&file).unwrap();
            for message in recording.messages(&["pose"]).unwrap() {
                let pose: PoseSample = decode_sample(&message.unwrap().data).unwrap();
                newest = newest.filter(|(tick, _)| *tick > pose.stamp.tick);
                newest = newest.or(Some((pose.stamp.tick, pose.heading_rad)));
            }
        }
    }
    wrap_angle(newest.unwrap().1)
}

#[test]
fn a_target_is_refused_with_the_reason_and_the_robot_keeps_the_one_it_has() {
    let robot = "goto-refused";
    let to = |words: &[&'static str], code: &str, names: &[&str]| {
        refused(&[&["goto", "--robot", robot], words].concat(), code, names);
    };
    to(&["1", "1"], "not-running", &[robot]);
    let drum = "known.drum=[{at=[2.0, 2.0], radius_m=0.3}]";
    let mut run = Run::under_way(robot, "open-room", &["--pace", "2", "--set", drum], 1.0);
    to(&["1"], "usage", &[]);
    to(&["1", "1", "2"], "no-target", &["2"]);
    to(&["inf", "1"], "no-target", &[robot]);
    to(&["9", "0"], "target-outside", &["perimeter"]);
    to(&["1", "1", "2", "2"], "target-in-hazard", &["hazard"]);
    to(&["0"; 34], "too-many-targets", &["16"]);
    operate(robot, &["stop"]);
    to(&["1", "1"], "robot-stopped", &["resume"]);
    refused(&["return", "--robot", robot], "robot-stopped", &["resume"]);
    operate(robot, &["resume"]);
    run.wait_until_driving();
    operate(robot, &["return"]);
    let summary = run.arrives();
    assert_eq!(outcomes(&summary), ["replaced", "reached"]);
    assert!(summary["true_distance_m"].as_f64().unwrap() < 0.5, "{summary}");
    assert_eq!(summary["targets"][1]["x_m"], 0.0, "{summary}");
}

#[test]
fn a_list_of_the_mission_file_gives_the_same_summary_and_replay_to_the_bit_in_lockstep() {
    let text = "targets = [[1.5, -1.0], [2.5, 0.5, 180], [0.5, 0.8]]\n\
                [[world.drum]]\nat = [2.0, 0.0]\nradius_m = 0.2";
    let directory = tempfile::tempdir().unwrap();
    let file = directory.path().join("list.toml");
    std::fs::write(&file, text).unwrap();
    let runs = ["goto-bits-1", "goto-bits-2"].map(|robot| {
        let run = Run::start(robot, file.to_str().unwrap(), &["--seed", "3"]);
        let (mut summary, directory) = run.arrives_in();
        assert_eq!(outcomes(&summary), ["reached"; 3]);
        assert_replays(&directory.path().join("run"));
        for wall_clock in ["tick_latency_us", "full_solve_us"] {
            summary.as_object_mut().unwrap().remove(wall_clock);
        }
        summary
    });
    assert_eq!(runs[0], runs[1]);
    let targets = runs[0]["targets"].as_array().unwrap();
    let times = targets.iter().map(|target| target["at_s"].as_f64().unwrap());
    assert!(times.is_sorted() && targets.iter().all(|it| it["truth_m"].as_f64() < Some(0.5)));
    let straight_m = runs[0]["straight_m"].as_f64().unwrap();
    let legs = 1.5_f64.hypot(1.0) + 1.0_f64.hypot(1.5) + 2.0_f64.hypot(0.3);
    assert!((straight_m - legs).abs() < 1e-9, "{straight_m} m");
}

#[test]
fn a_mission_starts_from_the_map_that_an_earlier_run_saved_and_a_damaged_map_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
    let (first, second, map) = (path("first"), path("second"), path("course.yaml"));
    let set = format!("map='{map}'");
    let drive = |out: &str, more: &[&str]| {
        let common = ["run", "obstacle-course", "--robot", "prior-map", "--json", "--out", out];
        let (status, summary) = json_of(&output(&[&common, more].concat()));
        assert!(status.success(), "{summary:?}");
        assert_eq!(summary[0]["outcome"], "reached");
    };
    drive(&first, &[]);
    support::printed(&["map", "save", &first, "--out", &map]);
    drive(&second, &["--set", &set]);
    let mission = std::fs::read_to_string(path("second/mission.toml")).unwrap();
    assert!(mission.contains("[[known.box]]") && !mission.contains("course.yaml"), "{mission}");
    std::fs::write(path("course.pgm"), "P5 9 9 255 ").unwrap();
    refused(&["run", "obstacle-course", "--set", &set], "mission", &["course.pgm"]);
}

#[test]
fn each_of_fifty_commands_in_a_row_finds_a_place_on_the_bus() {
    let robot = "goto-many";
    let slowly = ["--pace", "1", "--set", "controller.speed_m_s=0.1"];
    let _run = Run::under_way(robot, "open-room", &slowly, 0.2);
    for _ in 0..50 {
        refused(&["goto", "--robot", robot, "9", "0"], "target-outside", &["perimeter"]);
    }
}

/// Mission without a target, with a place enclosed by walls.
const STAYS: &str = "
timeout_s = 1000.0
perimeter.width_m = 8.0
robot.odometry = { diameter_ratio_sd = 0.0, track_scale_sd = 0.0 }
simulation.realism = 'laboratory'
[[world.wall]]
points = [[2.2, -0.4], [3.0, -0.4], [3.0, 0.4], [2.2, 0.4], [2.2, -0.4]]
";

#[test]
fn a_run_that_stays_waits_before_between_and_after_its_targets_and_none_ends_it() {
    let directory = tempfile::tempdir().unwrap();
    let mission = directory.path().join("stays.toml");
    std::fs::write(&mission, STAYS).unwrap();
    let mut run = Run::start("goto-stay", mission.to_str().unwrap(), &["--stay", "--pace", "4"]);
    let waits = |status: &Value| status["order"] == "waiting for a target";
    run.wait_until("it waits for its first target", waits);
    operate("goto-stay", &["goto", "1.0", "-1.0", "1.5", "0.0"]);
    run.wait_until("it drives", |status| status["order"] == "driving");
    run.wait_until("it waits again", waits);
    operate("goto-stay", &["stop"]);
    operate("goto-stay", &["resume"]);
    run.wait_until("it waits after a stop", waits);
    let given_up = output(&["goto", "--robot", "goto-stay", "2.6", "0.0", "--wait"]);
    assert_eq!(given_up.status.code(), Some(3), "{given_up:?}");
    run.wait_until("it waits after it has given up", waits);
    run.kill_and_await_successor("planner", Signal::KILL);
    operate("goto-stay", &["goto", "0.5", "-1.0"]);
    run.wait_until("it drives again", |status| status["order"] == "driving");
    run.wait_until("it waits at last", waits);
    // A record waits for the ground truth of its tick.
    support::wait_until("each has its record while the run goes on", || {
        run.records("targets.jsonl").len() == 4
    });
    run.signal(Signal::INT);
    let (code, summary, directory) = run.finish_in();
    assert_eq!(outcomes(&summary), ["reached", "reached", "unreachable", "reached"], "{summary}");
    assert_eq!(code, Some(0), "{summary}");
    let recorded = records(&directory.path().join("run/targets.jsonl"));
    assert_eq!(summary["targets"].as_array(), Some(&recorded), "each once");
    support::assert_nothing_left("goto-stay");
}

#[test]
fn a_run_that_is_ended_while_it_waits_for_its_first_target_has_waited() {
    let mission = ["--stay", "--pace", "4"];
    let mut run = Run::start("goto-waits", "open-room", &mission);
    run.wait_until("it drives", |status| status["order"] == "driving");
    run.signal(Signal::INT);
    assert_eq!(run.finish().1["outcome"], "aborted");
    let directory = tempfile::tempdir().unwrap();
    let mission_file = directory.path().join("waits.toml");
    std::fs::write(&mission_file, "perimeter.width_m = 8.0").unwrap();
    let mut run = Run::start("goto-waits", mission_file.to_str().unwrap(), &mission);
    run.wait_until("it waits", |status| status["order"] == "waiting for a target");
    run.signal(Signal::INT);
    let (code, summary) = run.finish();
    assert_eq!((code, &summary["outcome"]), (Some(0), &"waited".into()), "{summary}");
    assert_eq!(outcomes(&summary), [""; 0]);
}

#[test]
fn a_standing_robot_is_told_where_it_is_goes_on_from_there_and_replays_to_the_bit() {
    let robot = "goto-place";
    let directory = tempfile::tempdir().unwrap();
    let mission = directory.path().join("placed.toml");
    let text = "start = [-2, 0.5, 90]\nperimeter.width_m = 8.0\nsimulation.realism = 'laboratory'\n\
                [[world.drum]]\nat = [-2.0, 1.6]\nradius_m = 0.2";
    std::fs::write(&mission, text).unwrap();
    let mut run = Run::start(robot, mission.to_str().unwrap(), &["--stay", "--pace", "2"]);
    let is_at = |status: &Value, x: f64, y: f64| {
        let at =
            |key: &str, is: f64| (status["pose"][key].as_f64().unwrap_or(99.0) - is).abs() < 0.2;
        status["order"] == "waiting for a target"
            && status["link"]["at_rest"] == true
            && at("x_m", x)
            && at("y_m", y)
    };
    run.wait_until("it waits at its start", |status| is_at(status, -2.0, 0.5));
    let place = |numbers: [&'static str; 3]| [&["place", "--robot", robot], &numbers[..]].concat();
    refused(&place(["9", "0", "0"]), "target-outside", &["perimeter"]);
    // It stands there, and believes it is one metre farther.
    operate(robot, &["place", "-1", "0.5", "90", "--sigma", "0.1"]);
    run.wait_until("it believes so", |status| is_at(status, -1.0, 0.5));
    let mut stalls = Vec::new();
    support::wait_until("the recovery is recorded", || {
        stalls = run.records("stalls.jsonl");
        !stalls.is_empty()
    });
    assert_eq!(stalls.len(), 1, "{stalls:?}");
    assert_eq!(
        (&stalls[0]["cause"], &stalls[0]["recovery"]),
        (&"relocated".into(), &"reset".into())
    );
    operate(robot, &["goto", "1.0", "0.5"]);
    run.wait_until("it drives", |status| status["order"] == "driving");
    refused(&place(["0", "0", "0"]), "robot-moves", &["stop"]);
    run.wait_until("it is there", |status| is_at(status, 1.0, 0.5));
    operate(robot, &["place", "0", "0.5", "0"]);
    operate(robot, &["return"]);
    run.wait_until("it is back", |status| is_at(status, -2.0, 0.5));
    run.signal(Signal::INT);
    let (_, summary, directory) = run.finish_in();
    assert_eq!(outcomes(&summary), ["wrong_place", "reached"], "{summary}");
    let off_m = summary["targets"][0]["truth_m"].as_f64().unwrap();
    assert!((off_m - 1.0).abs() < 0.3, "{summary}");
    assert_replays(&directory.path().join("run"));
    support::assert_nothing_left(robot);
}

#[test]
fn zones_that_an_operator_adds_and_removes_hold_for_the_robot_alone_and_replay_to_the_bit() {
    let robot = "goto-zones";
    let directory = tempfile::tempdir().unwrap();
    let mission = directory.path().join("zones.toml");
    let text = "perimeter.width_m = 8.0\nsimulation.realism = 'laboratory'\n\
                [[zone]]\npoints = [[1.0, -3.9], [1.4, -3.9], [1.4, 1.5], [1.0, 1.5]]";
    std::fs::write(&mission, text).unwrap();
    let mut run = Run::start(robot, mission.to_str().unwrap(), &["--stay", "--pace", "4"]);
    let waits = |status: &Value| status["order"] == "waiting for a target";
    let zone = |words: &[&'static str], code: &str| {
        refused(&[&["zone", "--robot", robot], words].concat(), code, &[]);
    };
    run.wait_until("it waits", waits);
    refused(&["goto", "--robot", robot, "1.2", "0"], "target-in-hazard", &["hazard"]);
    zone(&["-1", "-1", "1", "-1", "1", "1", "-1", "1"], "zone-here");
    zone(&["2", "2", "3", "3"], "no-zone");
    zone(&["3", "3", "--remove"], "not-in-zone");
    operate(robot, &["goto", "2.2", "0"]);
    run.wait_until("it drives", |status| status["order"] == "driving");
    run.wait_until("it is there", waits);
    // The zone moves to the other side, which frees its old place.
    operate(robot, &["zone", "1", "-1", "1.4", "-1", "1.4", "3.9", "1", "3.9"]);
    operate(robot, &["zone", "1.2", "-2", "--remove"]);
    refused(&["goto", "--robot", robot, "1.2", "2"], "target-in-hazard", &["hazard"]);
    operate(robot, &["goto", "1.2", "-2", "0", "0"]);
    run.kill_and_await_successor("mapper", Signal::KILL);
    run.wait_until("it is back", waits);
    refused(&["goto", "--robot", robot, "1.2", "2"], "target-in-hazard", &["hazard"]);
    run.signal(Signal::INT);
    let (code, summary, directory) = run.finish_in();
    assert_eq!(code, Some(0), "{summary}");
    assert_eq!(outcomes(&summary), ["reached"; 3], "{summary}");
    assert_replays(&directory.path().join("run"));
    for file in std::fs::read_dir(directory.path().join("run")).unwrap() {
        let file = file.unwrap().path();
        if file.extension().is_some_and(|extension| extension == "mcap") {
            for pose in Recording::open(&file).unwrap().samples(&topics::POSE).unwrap() {
                let PoseSample { stamp, x_m, y_m, .. } = pose.unwrap().sample;
                let [first, second] = [y_m < 1.5, y_m > -1.0];
                let is_in = (1.0..1.4).contains(&x_m) && first && second;
                assert!(!is_in, "tick {} at ({x_m}, {y_m})", stamp.tick);
            }
        }
    }
    support::assert_nothing_left(robot);
}

/// Pushes the joystick to `[ahead, left]` at 10 Hz, until `is_enough` returns true.
fn push(robot: &str, stick: [f64; 2], mut is_enough: impl FnMut() -> bool) {
    let bus = Bus::join(&support::domain(robot), "hand").unwrap();
    let mut requests = bus.writer(&topics::REQUESTS, 1).unwrap();
    let began = std::time::Instant::now();
    for id in 1.. {
        let mut request = RequestSample {
            id,
            kind: RequestKind::Hand.into(),
            target_count: 1,
            ..RequestSample::default()
        };
        request.targets[0] = TargetPoint { x_m: stick[0], y_m: stick[1], ..TargetPoint::default() };
        requests.publish(0, Default::default(), request).unwrap();
        if is_enough() {
            return;
        }
        assert!(began.elapsed() < support::PATIENCE, "the hand-driven robot is late");
        std::thread::sleep(Duration::from_millis(100));
    }
}

#[test]
fn a_hand_drives_a_robot_that_stays_past_no_hazard_and_it_stands_when_the_hand_goes() {
    let robot = "goto-hand";
    let directory = tempfile::tempdir().unwrap();
    let mission = directory.path().join("hand.toml");
    let text = "perimeter.width_m = 8.0\nsimulation.realism = 'laboratory'\n\
                [[world.wall]]\npoints = [[1.5, -3.0], [1.5, 3.0]]";
    std::fs::write(&mission, text).unwrap();
    let mut run = Run::start(robot, mission.to_str().unwrap(), &["--stay", "--pace", "1"]);
    let waits = |status: &Value| status["order"] == "waiting for a target";
    let at = |status: &Value, key: &str| status["pose"][key].as_f64().unwrap_or(f64::NAN);
    let status = || support::status_of(robot).unwrap();
    run.wait_until("it waits", waits);
    push(robot, [0.0, 1.0], || at(&status(), "heading_deg") > 60.0);
    run.wait_until("it stands without the hand", |status| {
        waits(status) && status["link"]["at_rest"] == true
    });
    push(robot, [0.0, -1.0], || at(&status(), "heading_deg").abs() < 20.0);
    // The joystick points at the wall, and the robot stops before it.
    let began = std::time::Instant::now();
    push(robot, [1.0, 0.0], || {
        at(&status(), "x_m") > 0.5 && began.elapsed() > Duration::from_secs(8)
    });
    let status = run.wait_until("it waits again", waits);
    assert!((0.5..1.3).contains(&at(&status, "x_m")), "{status}");
    operate(robot, &["goto", "0", "0"]);
    run.wait_until("it drives", |status| status["order"] == "driving");
    run.wait_until("it is back", waits);
    run.signal(Signal::INT);
    let (code, summary, directory) = run.finish_in();
    assert_eq!(code, Some(0), "{summary}");
    assert_eq!(outcomes(&summary), ["reached"], "{summary}");
    assert_eq!(summary["collisions"], 0, "{summary}");
    assert_replays(&directory.path().join("run"));
    support::assert_nothing_left(robot);
}
