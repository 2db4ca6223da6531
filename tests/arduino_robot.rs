//! Simulated robots with ROSArduinoBridge: the guide's mission over each wire.

use std::sync::{
    Arc,
    atomic::{AtomicBool, Ordering},
};

use rustix::process::Signal;

use crate::support::{
    Run, assert_nothing_left, assert_reached, replayed_in,
    wire::{Proxy, Robot},
};

const MISSION: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../guide/example-arduino/robot.toml");
const TARGET_M: f64 = 4.0;

const WITH_LASER: &str =
    concat!(env!("CARGO_MANIFEST_DIR"), "/../guide/example-arduino/laser.toml");

/// Asserts that `run` arrives with its robot, and that its recording replays bit by bit.
#[track_caller]
fn assert_arrives(run: Run, robot: Robot) {
    let name = run.robot.clone();
    let (code, summary, directory) = run.finish_in();
    assert_reached(code, &summary);
    let went = robot.kill();
    assert!((went - TARGET_M).abs() < 0.5, "{went} m");
    replayed_in(&directory);
    assert_nothing_left(&name);
}

fn over(transport: &str, name: &str) -> (Robot, Run) {
    let robot = Robot::start(MISSION, transport, "127.0.0.1:0");
    let scheme = if transport == "pty" { "serial" } else { transport };
    let address = format!("robot.address='{scheme}://{}'", robot.listening);
    (robot, Run::at_own_speed(name, MISSION, &["--set", &address]))
}

#[test]
fn a_robot_with_an_arduino_arrives_in_lockstep_on_the_same_way_each_time() {
    let [first, second] = ["arduino-max", "arduino-again"].map(|name| {
        let summary = Run::start(name, MISSION, &["--pace", "max"]).arrives();
        // The mission ends with the tick of the arrival, before the robot stands.
        let last_tick = summary["ticks"].as_f64().unwrap() - 1.0;
        assert_eq!(summary["mission_time_s"], last_tick / 10.0, "{summary}");
        let keys = ["ticks", "mission_time_s", "path_length_m", "pose_error_m"];
        keys.map(|key| summary[key].to_string())
    });
    assert_eq!(first, second);
}

#[test]
fn the_gyro_of_an_arduino_keeps_the_heading_of_wheels_that_nobody_calibrated() {
    let keys = ["robot.gyro=true", "simulation.realism='measured'"].map(|key| ["--set", key]);
    for seed in ["1", "2", "3", "4", "5", "6"] {
        let arguments = [&keys.concat()[..], &["--pace", "max", "--seed", seed]].concat();
        let summary = Run::start("arduino-gyro", MISSION, &arguments).arrives();
        assert!(summary["pose_error_m"].as_f64().unwrap() < 0.15, "{seed}: {summary}");
    }
}

#[test]
fn a_simulated_robot_with_an_arduino_arrives_and_replays_to_the_bit() {
    let (_, directory) = Run::start("arduino-sim", MISSION, &["--pace", "4"]).arrives_in();
    replayed_in(&directory);
}

#[test]
fn a_robot_with_an_arduino_whose_link_is_killed_arrives_over_a_serial_line() {
    let (mut robot, mut run) = over("pty", "arduino-pty");
    robot.wait_until_driven(1.0);
    let later = run.kill_and_await_successor("link", Signal::KILL);
    assert_eq!(later["order"], "driving", "{later}");
    let status = run.wait_until("the robot drives on", |status| {
        status["link"]["connected"] == true && status["link"]["stopped"] == false
    });
    // The successor finds the board as the killed link left it.
    assert_eq!((&status["link"]["losses"], &status["link"]["reboots"]), (&0.into(), &0.into()));
    assert_arrives(run, robot);
}

#[test]
fn a_robot_with_an_arduino_that_restarts_with_each_connection_arrives_though_its_link_is_killed() {
    let (mut robot, mut run) = over("tcp", "arduino-tcp");
    robot.wait_until_driven(1.0);
    run.kill_and_await_successor("link", Signal::KILL);
    assert_arrives(run, robot);
}

#[test]
fn a_robot_with_an_arduino_that_falls_silent_stands_and_drives_on_when_it_answers_again() {
    let mut robot = Robot::start(MISSION, "udp", "127.0.0.1:0");
    let silent = Arc::new(AtomicBool::new(false));
    let is_silent = Arc::clone(&silent);
    let to_link = move |bytes: &[u8]| match is_silent.load(Ordering::Relaxed) {
        true => Vec::new(),
        false => bytes.to_vec(),
    };
    let proxy = Proxy::before(&robot, Box::new(<[u8]>::to_vec), Box::new(to_link));
    let mut run = Run::at_own_speed("arduino-mute", MISSION, &["--set", &proxy.as_robot()]);
    robot.wait_until_driven(1.0);
    silent.store(true, Ordering::Relaxed);
    run.wait_until("the silent robot is lost", |status| {
        status["link"]["connected"] == false && status["link"]["stopped"] == true
    });
    robot.wait_until_at_rest();
    silent.store(false, Ordering::Relaxed);
    run.wait_until("the robot is found", |status| status["link"]["connected"] == true);
    assert_arrives(run, robot);
}

#[test]
fn a_robot_of_an_arduino_and_an_rplidar_goes_the_same_way_each_time_in_lockstep() {
    let [first, second] = ["rplidar-max", "rplidar-again"].map(|name| {
        let summary = Run::start(name, WITH_LASER, &["--pace", "max"]).arrives();
        ["ticks", "path_length_m", "pose_error_m"].map(|key| summary[key].to_string())
    });
    assert_eq!(first, second);
}

#[test]
fn a_robot_of_an_arduino_and_an_rplidar_on_a_serial_line_each_arrives_and_replays_to_the_bit() {
    let robot = Robot::start(WITH_LASER, "pty", "127.0.0.1:0");
    let lines = [&*robot.listening, robot.laser.as_deref().unwrap()];
    let [base, laser] = lines.map(|line| format!("address = \"serial://{line}\"\n"));
    let text = std::fs::read_to_string(WITH_LASER).unwrap();
    let (protocol, model) = ("protocol = \"arduino\"\n", "model = \"rplidar-a1\"\n");
    let real = text.replace(protocol, &(base + protocol)).replace(model, &(laser + model));
    let directory = tempfile::tempdir().unwrap();
    let mission = directory.path().join("real.toml");
    std::fs::write(&mission, real).unwrap();
    assert_arrives(Run::start("rplidar-pty", mission.to_str().unwrap(), &[]), robot);
}
