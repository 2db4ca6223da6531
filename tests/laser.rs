//! Tests of robots with a simulated laser, through real processes.

use recording::Recording;
use rustix::process::Signal;

use crate::support::{Run, STAGES, printed, replayed, run};

#[test]
fn a_robot_with_a_laser_arrives_though_each_stage_is_killed_and_replays_to_the_bit() {
    let robot = ["--pace", "2", "--set", "robot.model='kobuki'", "--set", "robot.rate_hz=20"];
    // The robot is slow enough not to arrive between two kills.
    let slow = ["--set", "controller.speed_m_s=0.35"];
    let mut run =
        Run::under_way("laser-kills", "obstacle-course", &[&robot[..], &slow].concat(), 0.3);
    for topic in ["scan", "scan_fix"] {
        printed(&["topic", "echo", topic, "--robot", "laser-kills", "-n", "1"]);
    }
    for stage in STAGES {
        run.kill_and_await_successor(stage, Signal::KILL);
    }
    let (_, directory) = run.arrives_in();
    let recording = Recording::open(&directory.path().join("run/recording.mcap")).unwrap();
    assert!(recording.counts["scan"] > 100, "{:?}", recording.counts);
    assert!(recording.counts["foxglove/scan/laser"] > 100, "{:?}", recording.counts);
    let report = replayed(&recording);
    assert!(report.equal() >= 2 * STAGES.len() as u64, "{report}");
}

#[test]
fn by_its_laser_a_robot_whose_wheels_are_not_what_they_should_be_knows_where_it_is() {
    for seed in ["1", "2", "3"] {
        let robot = ["--set", "robot.model='kobuki'", "--set", "robot.rate_hz=10", "--seed", seed];
        let harsh = ["--set", "simulation.realism='harsh'", "--set", "controller.speed_m_s=0.5"];
        let (code, summary) = run("laser-harsh", "obstacle-course", &[&robot[..], &harsh].concat());
        assert_eq!(code, Some(0), "{summary}");
        assert!(summary["pose_error_m"].as_f64().unwrap() < 0.12, "seed {seed}: {summary}");
    }
}

#[test]
fn a_laser_that_is_late_and_turns_slowly_and_says_so_places_the_robot_like_a_prompt_one() {
    for late in [["0.2", "0"], ["0", "0.2"], ["0.3", "0.2"]] {
        let [delay, sweep] = late;
        let times = [
            format!("simulation.laser.delay_s={delay}"),
            format!("simulation.laser.sweep_s={sweep}"),
        ];
        let robot = ["--set", "robot.model='kobuki'", "--seed", "2"];
        let arguments = [&robot[..], &["--set", &times[0], "--set", &times[1]]].concat();
        let (code, summary) = run("laser-late", "obstacle-course", &arguments);
        assert_eq!(code, Some(0), "{summary}");
        assert!(summary["pose_error_m"].as_f64().unwrap() < 0.1, "{late:?}: {summary}");
    }
}
