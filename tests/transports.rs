//! Tests of missions over every wire, with robots that may leave and return.

use std::path::{Path, PathBuf};

use crate::support::{Run, assert_nothing_left, assert_reached, wire::Robot};
use tempfile::TempDir;

/// Distance of a few seconds straight ahead, metres.
const TARGET_M: f64 = 0.6;
const TOLERANCE_M: f64 = 0.1;

fn mission() -> (TempDir, PathBuf) {
    let directory = tempfile::tempdir().unwrap();
    let file = directory.path().join("short.toml");
    let text = format!("target = [{TARGET_M}, 0]\narrival_tolerance_m = {TOLERANCE_M}");
    std::fs::write(&file, text).unwrap();
    (directory, file)
}

fn drive(name: &str, mission: &Path, address: &str) -> Run {
    let assignment = format!("robot.address=\"{address}\"");
    Run::start(name, mission.to_str().unwrap(), &["--set", &assignment])
}

fn arrives_over(transport: &str, scheme: &str) {
    let (_directory, mission) = mission();
    let robot = Robot::start(mission.to_str().unwrap(), transport, "127.0.0.1:0");
    let address = format!("{scheme}{}", robot.listening);
    let name = format!("over-{transport}");
    let (code, summary) = drive(&name, &mission, &address).finish();
    assert_reached(code, &summary);
    let went = robot.kill();
    assert!((went - TARGET_M).abs() <= TOLERANCE_M + 0.02, "{went} m");
    assert_nothing_left(&name);
}

#[test]
fn a_mission_arrives_over_datagrams() {
    arrives_over("udp", "");
}

#[test]
fn a_mission_arrives_over_a_connection() {
    arrives_over("tcp", "tcp://");
}

#[test]
fn a_mission_arrives_over_a_serial_line() {
    arrives_over("pty", "serial://");
}

/// Longest distance of a robot after its last received tick, metres.
const UNRECEIVED_M: f64 = 0.12;

/// Power-cycles the robot halfway. Its counts and place restart.
fn goes_away_and_comes_back(transport: &str) {
    let (_directory, mission) = mission();
    let mut robot = Robot::start(mission.to_str().unwrap(), transport, "127.0.0.1:0");
    let listened = robot.listening.clone();
    let name = format!("away-{transport}");
    let mut run = drive(&name, &mission, &format!("{transport}://{listened}"));
    robot.wait_until_driven(0.15);
    let first_part = robot.kill();
    let lost = run.wait_until("the robot is lost and looked for", |status| {
        status["link"]["connected"] == false && status["link"]["attempts"].as_u64() >= Some(3)
    });
    assert_eq!(lost["link"]["stopped"], true, "{lost}");
    let later = run.wait_until("it is still looked for", |status| {
        status["link"]["attempts"].as_u64() >= Some(4)
    });
    assert_eq!(later["order"], "driving", "the mission pauses only");
    assert_eq!(later["tick"], lost["tick"], "{later}");
    assert!(later["link"]["lost_s"].as_f64() > lost["link"]["lost_s"].as_f64());

    let robot = Robot::start(mission.to_str().unwrap(), transport, &listened);
    let back = run.wait_until("the robot is back and known to have restarted", |status| {
        status["link"]["connected"] == true && status["link"]["reboots"] == 1
    });
    assert_eq!(back["link"]["losses"], 1, "{back}");
    let (code, summary) = run.finish();
    // The distance rolled during the absence is unknown: a longer absence makes the pose less sure.
    let outcome = summary["outcome"].as_str().unwrap();
    assert!(
        [("reached", Some(0)), ("reached_unsure", Some(11))].contains(&(outcome, code)),
        "{summary}"
    );
    assert_eq!(summary["restarts"]["link"], 0, "{summary}");
    // Each robot counts from its own start, so the run's path length is the sum of both.
    let went = first_part + robot.kill();
    let path_m = summary["path_length_m"].as_f64().unwrap();
    // The first robot's distance after its last received tick is missing: up to two ticks at 0.5
    // m/s.
    assert!((went - path_m).abs() < UNRECEIVED_M, "{went} m: {summary}");
    assert!((went - TARGET_M).abs() < TOLERANCE_M + UNRECEIVED_M, "{went} m");
    assert_nothing_left(&name);
}

#[test]
fn a_robot_that_restarts_mid_mission_is_waited_for_and_arrives_over_datagrams() {
    goes_away_and_comes_back("udp");
}

#[test]
fn a_robot_that_restarts_mid_mission_is_waited_for_and_arrives_over_a_connection() {
    goes_away_and_comes_back("tcp");
}
