//! Robots whose bumpers and cliff sensors detect obstacles below their lasers.

use crate::support::{Run, assert_ended, replayed_in, wire::Robot};

const KOBUKI: [&str; 6] = [
    "--set",
    "robot.model='kobuki'",
    "--set",
    "robot.rate_hz=10",
    "--set",
    "controller.speed_m_s=0.4",
];
/// Board below the laser's plane.
const BOARD: &str = "world.box=[{at=[2,0],size_m=[0.3,0.8],top_m=0.1}]";

#[test]
fn a_robot_that_bumps_into_a_low_board_or_comes_to_a_hole_marks_it_and_goes_around() {
    let hole = "simulation.hole=[{at=[2,0],size_m=[0.4,0.8]}]";
    // The cliff sensors are only slightly ahead of the wheels.
    let slow = "controller.speed_m_s=0.2";
    for (name, world) in [("bumps-board", BOARD), ("bumps-hole", hole)] {
        let goes_on = "simulation.goes_on_after_contact=true";
        let own = ["--set", world, "--set", goes_on, "--set", slow];
        let set = [&KOBUKI[..], &own].concat();
        let (code, summary, directory) = Run::start(name, "open-room", &set).finish_in();
        assert_ended(code, &summary, 0, "reached");
        let touched = summary["collisions"].as_u64().unwrap() > 0;
        assert_eq!(touched, world == BOARD, "no wheel goes over the hole: {summary}");
        assert_eq!((&summary["replans"], &summary["resets"]), (&0.into(), &0.into()), "{summary}");
        replayed_in(&directory);
    }
}

#[test]
fn on_a_wall_clock_the_link_stops_a_robot_at_a_bump_names_the_bumper_and_lets_it_go_on() {
    let robot = Robot::start_with("open-room", &[&["--set", BOARD], &KOBUKI[..]].concat());
    let address = format!("robot.address='udp://{}'", robot.listening);
    let set = [&["--set", &*address], &KOBUKI[..]].concat();
    let mut run = Run::start("bumps-wall", "open-room", &set);
    run.wait_until("it bumps", |status| status["link"]["cause"] == "bumper or cliff sensor");
    let (code, summary, directory) = run.finish_in();
    assert_ended(code, &summary, 0, "reached");
    let log = std::fs::read_to_string(directory.path().join("run/link.log")).unwrap();
    assert!(log.contains("detects a contact or a cliff"), "{log}");
}
