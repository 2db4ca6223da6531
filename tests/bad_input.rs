//! Bad input is answered with the code of the error, the input's name and a remedy, a non-zero exit, and nothing left running.

use std::net::UdpSocket;

use crate::support::{Run, assert_nothing_left, assert_refused, output, refused};

#[test]
fn an_invalid_mission_is_refused_with_line_key_and_remedy_by_check_and_run_alike() {
    let cases = [
        ("target = [99, 0]", "1: target: ", "perimeter.width_m"),
        ("target = [3, 0]\n[perimeter]\ncells = 3", "3: perimeter.cells: ", "10 to 4096"),
        ("target = [3, 0]\n[perimeter]\ncells = 99999", "3: perimeter.cells: ", "10 to 4096"),
        ("target = [3, nan]", "1: target: ", "finite"),
        ("target = [3, 0]\nspeed = 1", "2: ", "`speed`"),
        ("target = [3, 0]\n[[world.drum]]\nat = [0, 0.1]\nradius_m = 0.3", "2: world: ", "move it"),
    ];
    let directory = tempfile::tempdir().unwrap();
    let file = directory.path().join("bad.toml");
    let path = file.to_str().unwrap();
    for (content, place, remedy) in cases {
        std::fs::write(&file, content).unwrap();
        let place = format!("{path}:{place}");
        let check = output(&["check", path]);
        let exit = assert_refused(&check, "mission", &[&place, remedy]);
        assert_eq!(exit, Some(78), "{content:?}");
        let run = output(&["run", path, "--robot", "bad"]);
        assert_eq!(check, run, "{content:?}");
    }
    assert_nothing_left("bad");
}

#[test]
fn an_unknown_mission_is_answered_with_those_there_are() {
    let names = ["moon", "obstacle-course"];
    refused(&["run", "moon"], "unknown-mission", &names);
    let missing = "/no/such/file.toml";
    refused(&["check", missing], "mission", &[missing]);
}

#[test]
fn an_unknown_stage_is_answered_with_those_there_are() {
    let stage = ["stage", "warp", "--run", "/tmp", "--supervisor", "1"];
    refused(&stage, "unknown-stage", &["warp", "dead-reckoning"]);
}

#[test]
fn a_second_supervisor_of_a_robot_is_refused_and_the_first_goes_on() {
    let mut first = Run::start("second", "obstacle-course", &["--pace", "1"]);
    first.wait_until_under_way(0.3);
    let runs = tempfile::tempdir().unwrap();
    let runs = runs.path().to_str().unwrap();
    let pid = first.pid().to_string();
    let second = ["run", "--robot", "second", "--runs", runs];
    refused(&second, "supervised", &[&pid, "--robot"]);
    assert!(first.status().is_some());
    first.stop();
}

#[test]
fn a_port_in_use_is_named() {
    let taken = UdpSocket::bind("127.0.0.1:0").unwrap();
    let address = taken.local_addr().unwrap().to_string();
    let sim = ["sim", "open-room", "--listen", &address];
    refused(&sim, "address-in-use", &[&address]);
}

#[test]
fn a_malformed_robot_address_is_named() {
    let runs = tempfile::tempdir().unwrap();
    let runs = runs.path().to_str().unwrap();
    let set = "robot.address='not an address'";
    let run = ["run", "--robot", "nowhere", "--runs", runs, "--set", set];
    let names = ["not an address", "robot.address"];
    assert_eq!(refused(&run, "mission", &names), Some(78));
    assert_nothing_left("nowhere");
}

#[test]
fn a_robot_that_does_not_run_is_named_with_how_to_start_it() {
    let status = ["status", "--robot", "ghost"];
    refused(&status, "not-running", &["ghost", "firsthand run"]);
}

#[test]
fn a_bad_pace_or_robot_name_is_refused_by_the_command_line() {
    refused(&["run", "--pace", "warp"], "usage", &["warp"]);
    refused(&["run", "--robot", "../x"], "usage", &["../x"]);
}

#[test]
fn results_of_an_earlier_run_are_not_overwritten() {
    let (_, directory) = Run::start("bi-again", "open-room", &[]).arrives_in();
    let out = directory.path().join("run");
    let out = out.to_str().unwrap();
    let second = ["run", "open-room", "--robot", "bi-again", "--out", out];
    refused(&second, "results-there", &[out]);
}
