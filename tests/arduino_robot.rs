//! Robots with ROSArduinoBridge over a connection and serial lines. `simulation` drives others.

use rustix::process::Signal;

use crate::support::{Run, mission_file, replayed_in, wire::Robot};

const GUIDE: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../guide/example-arduino/");

/// Kills the link on the way. Asserts that the robot arrives and replays to the bit.
fn arrives_after_a_kill(mut robot: Robot, mut run: Run, loses_robot: bool) {
    robot.wait_until_driven(1.0);
    run.kill_and_await_successor("link", Signal::KILL);
    let status = run.wait_until("the robot drives on", |status| {
        status["link"]["connected"] == true && status["link"]["stopped"] == false
    });
    if !loses_robot {
        // The successor finds the board as the killed link left it.
        assert_eq!((&status["link"]["losses"], &status["link"]["reboots"]), (&0.into(), &0.into()));
    }
    let (_, directory) = run.arrives_in();
    let went = robot.kill();
    assert!((went - 4.0).abs() < 0.5, "{went} m");
    replayed_in(&directory);
}

#[test]
fn a_robot_with_an_arduino_that_restarts_with_each_connection_arrives_though_its_link_is_killed() {
    let mission = format!("{GUIDE}robot.toml");
    let robot = Robot::start(&mission, "tcp", "127.0.0.1:0");
    let run = Run::at_own_speed("arduino-tcp", &mission, &robot.as_robot());
    arrives_after_a_kill(robot, run, true);
}

#[test]
fn an_arduino_and_an_rplidar_on_a_serial_line_each_arrive_though_the_link_is_killed() {
    let mission = format!("{GUIDE}laser.toml");
    let robot = Robot::start(&mission, "pty", "127.0.0.1:0");
    let lines = [&*robot.listening, robot.laser.as_deref().unwrap()];
    let [base, laser] = lines.map(|line| format!("address = \"serial://{line}\"\n"));
    let text = std::fs::read_to_string(mission).unwrap();
    let (protocol, model) = ("protocol = \"arduino\"\n", "model = \"rplidar-a1\"\n");
    let real = text.replace(protocol, &(base + protocol)).replace(model, &(laser + model));
    let (_directory, mission) = mission_file(&real);
    let run = Run::start("rplidar-pty", &mission, "");
    arrives_after_a_kill(robot, run, false);
}
