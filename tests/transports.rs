//! Tests of missions of robots that leave and return.

use std::thread;

use crate::support::{Run, assert_nothing_left, mission_file, wire::Robot};

/// Distance of a few seconds straight ahead, metres.
const TARGET_M: f64 = 0.6;
const TOLERANCE_M: f64 = 0.1;
/// Longest distance of a robot after its last received tick, metres.
const UNRECEIVED_M: f64 = 0.12;

/// Power-cycles the robot halfway. Its counts and place restart.
fn goes_away_and_comes_back(transport: &str) {
    let text = format!("target = [{TARGET_M}, 0]\narrival_tolerance_m = {TOLERANCE_M}");
    let (_directory, mission) = mission_file(&text);
    let mut robot = Robot::start(&mission, transport, "127.0.0.1:0");
    let listened = robot.listening.clone();
    let name = format!("away-{transport}");
    let mut run = Run::start(&name, &mission, &robot.as_robot());
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

    let robot = Robot::start(&mission, transport, &listened);
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
    assert!((went - path_m).abs() < UNRECEIVED_M, "{went} m: {summary}");
    assert!((went - TARGET_M).abs() < TOLERANCE_M + UNRECEIVED_M, "{went} m");
    assert_nothing_left(&name);
}

#[test]
fn a_robot_that_restarts_mid_mission_is_waited_for_and_arrives_over_datagrams_and_a_connection() {
    thread::scope(|scope| {
        scope.spawn(|| goes_away_and_comes_back("udp"));
        scope.spawn(|| goes_away_and_comes_back("tcp"));
    });
}
