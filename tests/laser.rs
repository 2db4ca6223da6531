//! Tests of robots with a simulated laser, through real processes.

use std::sync::{
    Arc,
    atomic::{AtomicBool, Ordering},
};

use common::json_wire::{Lines, Report, line, parse};
use recording::Recording;
use rustix::process::Signal;

use crate::support::{
    Run, STAGES, printed, replayed,
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
