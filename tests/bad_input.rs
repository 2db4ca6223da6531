//! Tests that bad input gives an error code, the input's name, a remedy and a non-zero exit, and
//! leaves no process.

use std::{fs, net::UdpSocket, path::Path, process::Command};

use crate::support::{
    Run, assert_nothing_left, assert_refused, json_of, mission_file, output, refused,
    wait_for_status, words,
};

#[test]
fn an_invalid_mission_is_refused_with_line_key_and_remedy_by_check_and_run_and_not_tried_again() {
    let cases = [
        ("target = [99, 0]", "1: target: ", "perimeter.width_m"),
        ("target = [3, 0]\n[perimeter]\ncells = 3", "3: perimeter.cells: ", "10 to 2048"),
        ("target = [3, 0]\n[perimeter]\ncells = 99999", "3: perimeter.cells: ", "10 to 2048"),
        ("target = [3, nan]", "1: target: ", "finite"),
        ("target = [3, 0]\nspeed = 1", "2: ", "`speed`"),
        ("target = [3, 0]\n[[world.drum]]\nat = [0, 0.1]\nradius_m = 0.3", "2: world: ", "move it"),
    ];
    let directory = tempfile::tempdir().unwrap();
    let file = directory.path().join("bad.toml");
    let path = file.to_str().unwrap();
    for (content, place, remedy) in cases {
        fs::write(&file, content).unwrap();
        let place = format!("{path}:{place}");
        let check = output(&["check", path]);
        let exit = assert_refused(&check, "mission", &[&place, remedy]);
        assert_eq!(exit, Some(78), "{content:?}");
        let run = output(&["run", path, "--robot", "bad"]);
        assert_eq!(check, run, "{content:?}");
    }
    let pipe = directory.path().join("pipe.toml");
    assert!(Command::new("mkfifo").arg(&pipe).status().unwrap().success());
    refused(&["check", pipe.to_str().unwrap()], "mission", &["pipe.toml"]);
    let run = ["run", "open-room", "--robot", "bad", "--set"];
    for (setting, code, names) in [
        ("robot.address='not an address'", "mission", ["not an address", "robot.address"]),
        ("planner.executable='/no/such/planner'", "planner-executable", ["/no/such/planner"; 2]),
    ] {
        assert_eq!(refused(&[&run[..], &[setting]].concat(), code, &names), Some(78));
    }
    for unit in ["firsthand", "firsthand-watch"] {
        let file = format!("{}/../systemd/{unit}.service", env!("CARGO_MANIFEST_DIR"));
        let unit = fs::read_to_string(&file).unwrap();
        let setting = |key: &str| unit.lines().find_map(|line| line.strip_prefix(key));
        let never = setting("RestartPreventExitStatus=").unwrap();
        assert!(never.split(' ').any(|code| code == "78"), "{file}: {never}");
        assert!(setting("ExecStopPost=").unwrap().contains(" stop --robot "), "{file}");
        assert!(setting("ExecStart=").unwrap().contains(" --keep "), "{file}");
        assert_eq!(setting("LimitCORE="), None, "{file}");
    }
    assert_nothing_left("bad");
}

#[test]
fn status_names_the_trouble_of_a_stage_that_cannot_start() {
    let laser = concat!(env!("CARGO_MANIFEST_DIR"), "/../guide/example-arduino/laser.toml");
    let text = fs::read_to_string(laser).unwrap();
    let model = "model = \"rplidar-a1\"";
    let nowhere = format!("{model}\naddress = \"tcp://no-such-host.invalid:1\"");
    let (_directory, mission) = mission_file(&text.replace(model, &nowhere));
    let silent = UdpSocket::bind("127.0.0.1:0").unwrap();
    let address = format!("--set robot.address='udp://{}'", silent.local_addr().unwrap());
    let run = Run::start("no-host", &mission, &address);
    let named = |status: &serde_json::Value| {
        status["complaint"].to_string().contains("no-such-host.invalid")
    };
    wait_for_status("no-host", named);
    let (_, once) = json_of(&output(&["status", "--robot", "no-host", "--json"]));
    assert!(named(&once[0]), "{once:?}");
    let summary = run.ends(6, "aborted");
    assert!(summary["reason"].to_string().contains("no-such-host.invalid"), "{summary}");
}

#[test]
fn what_is_not_there_or_cannot_be_is_named_with_what_there_is() {
    let taken = UdpSocket::bind("127.0.0.1:0").unwrap();
    let taken = taken.local_addr().unwrap().to_string();
    let on_taken = format!("sim open-room --listen {taken}");
    let cases: [(&str, _, &[&str]); 20] = [
        ("run moon", "unknown-mission", &["moon", "obstacle-course"]),
        ("record --robot bad --out /proc/x", "", &["cannot write /proc/x"]),
        ("check /no/such/file.toml", "mission", &["/no/such/file.toml"]),
        ("stage warp --run /tmp --supervisor 1", "unknown-stage", &["warp", "dead-reckoning"]),
        ("stage kil", "unknown-stage", &["kil", "did you mean `stage kill`", "mapper"]),
        (
            "run trap --set robot.address='serial:///dev/no-such-tty'",
            "no-device",
            &["/dev/no-such-tty", "/dev/serial/by-id"],
        ),
        (&on_taken, "address-in-use", &[&taken]),
        ("stage restart wheel", "unknown-stage", &["dead-reckoning"]),
        ("stage fault wheel spin", "unknown-stage", &["dead-reckoning"]),
        ("stage fault mapper saddle", "unknown-fault", &["hazard-around-robot", "spin"]),
        ("stage fault mapper spin --robot ghost", "not-running", &["ghost"]),
        ("stage mapper --robot ghost", "", &["ghost", "--watch-only"]),
        ("stop --robot ghost", "not-running", &["ghost"]),
        ("status --robot ghost", "not-running", &["ghost", "firsthand run"]),
        ("run --pace warp", "usage", &["warp"]),
        ("run --robot ../x", "usage", &["../x"]),
        ("bench chaos --robot-faults=honest", "usage", &["honest", "encoder-dead"]),
        ("evaluate --set robot={model", "mission", &["robot={model", "inline table"]),
        ("evaluate --planner ./no-planner --out /proc/x", "planner-executable", &["./no-planner"]),
        ("experiments --only 6", "unknown-experiment", &["5-modulated"]),
    ];
    for (line, code, names) in cases {
        refused(&words(line), code, names);
    }
    if cfg!(not(feature = "ros2")) {
        let robot = concat!(env!("CARGO_MANIFEST_DIR"), "/../guide/example-ros2-robot/robot.toml");
        refused(&["run", robot, "--robot", "bad"], "mission", &["--features ros2"]);
    }
    // File with the name of this user's bus, except for the user's number.
    let bus = Path::new("/dev/shm/fh54321_bad-whose_bus");
    fs::create_dir_all(bus).unwrap();
    refused(&["status", "--robot", "bad-whose"], "not-running", &["54321"]);
    fs::remove_dir(bus).unwrap();
    assert_nothing_left("bad");
}

#[test]
fn a_second_supervisor_or_stage_of_a_robot_is_refused_and_the_first_goes_on() {
    let first = Run::under_way("second", "obstacle-course", "--pace 1", 0.3);
    let runs = tempfile::tempdir().unwrap();
    let runs = runs.path().to_str().unwrap();
    let pid = first.pid().to_string();
    let second = ["run", "--robot", "second", "--runs", runs];
    refused(&second, "supervised", &[&pid, "--robot"]);
    let mapper = ["stage", "mapper", "--robot", "second"];
    assert_eq!(refused(&mapper, "", &["second", "--watch-only"]), Some(1));
    assert!(first.status().is_some());
    first.stop();
}

#[test]
fn results_of_an_earlier_run_are_not_overwritten_and_a_run_that_ended_is_not_resumed() {
    let (_, directory) = Run::start("bi-again", "open-room", "--no-record").arrives_in();
    let out = directory.path().join("run");
    assert!(!out.join("report").exists());
    let out = out.to_str().unwrap();
    let second = ["run", "open-room", "--robot", "bi-again", "--out", out];
    refused(&second, "results-there", &[out]);
    refused(&["run", "--resume", out], "ended", &[out]);
    refused(&["run", "--resume", "/no/such/run"], "no-run", &["/no/such/run"]);
    // A run without a recording has no report.
    refused(&["report", out], "no-recording", &[]);
}
