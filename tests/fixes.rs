//! Tests of external pose sources as real processes on the robot's bus.

use std::process::{Child, Stdio};

use common::topics;
use recording::Recording;
use rustix::process::Signal;
use serde_json::Value;

use tempfile::TempDir;

use crate::support::{Run, assert_nothing_left, firsthand, replayed};

/// An uncalibrated right wheel, 1 % larger than the left, leads 0.7 m past the target after 6 m.
const UNEQUAL: [&str; 12] = [
    "--set",
    "simulation.realism='laboratory'",
    "--set",
    "controller.speed_m_s=0.4",
    // A source must not stall for 2 s of mission time while a loaded machine replaces a stage.
    "--pace",
    "2",
    "--set",
    "simulation.wheels.diameter_ratio=1.01",
    "--set",
    "robot.odometry.diameter_ratio_sd=0.005",
    "--set",
    "robot.odometry.track_scale_sd=0.015",
];
/// Pose error within which an arrival is sure.
const SURE: [&str; 2] = ["--set", "sure_within_m=0.5"];

fn sources(run: &Run, arguments: &[&str]) -> Child {
    let directory = run.directory();
    let mut command = firsthand(&["bench", "sources", "--robot", &run.robot]);
    command.arg(directory).args(arguments).stdout(Stdio::null()).spawn().unwrap()
}

/// Drives with unequal wheels, `sources` and `meanwhile`. Returns summary, recording and directory.
fn driven(
    robot: &str,
    arguments: &[&str],
    meanwhile: impl FnOnce(&mut Run),
) -> (Value, Recording, TempDir) {
    let mut run = Run::start(robot, "obstacle-course", &[&UNEQUAL[..], &SURE].concat());
    let mut sources = sources(&run, arguments);
    meanwhile(&mut run);
    let (_, summary, directory) = run.finish_in();
    assert!(sources.wait().unwrap().success());
    let recording = Recording::open(&directory.path().join("run/recording.mcap")).unwrap();
    assert_nothing_left(robot);
    (summary, recording, directory)
}

fn assert_there(summary: &Value) {
    assert_eq!(summary["outcome"], "reached", "{summary}");
    assert_near(summary);
}

fn assert_near(summary: &Value) {
    assert!(summary["true_distance_m"].as_f64() < Some(0.35), "{summary}");
    assert!(summary["pose_error_m"].as_f64() < Some(0.2), "{summary}");
}

#[test]
fn a_robot_with_unequal_wheels_arrives_with_fixes_and_not_without() {
    let without = Run::start("fix-none", "obstacle-course", &[&UNEQUAL[..], &SURE].concat());
    // Some fixes are off by a metre.
    let (summary, recording, _directory) =
        driven("fix-jumps", &["--jumps", "0.05", "--fixes", "2"], |_| {});
    assert_there(&summary);
    let poses = recording.samples(&topics::POSE).unwrap();
    let last = poses.last().unwrap().unwrap().sample;
    assert!(last.fixes > 10 && last.relocations == 0, "{last:?}");
    let (_, summary) = without.finish();
    assert_eq!(summary["outcome"], "wrong_place", "{summary}");
}

#[test]
fn a_gyro_keeps_the_heading_of_a_robot_with_unequal_wheels() {
    let gyro = ["--fixes", "0", "--gyro", "0.015"];
    let (summary, ..) = driven("fix-gyro", &gyro, |_| {});
    // The robot drives before the first gyro sample, so its pose may be less sure than the mission
    // demands.
    assert_near(&summary);
}

#[test]
fn dead_reckoning_killed_between_fixes_goes_on_from_them_and_replays_to_the_bit() {
    let (summary, recording, _directory) = driven("fix-killed", &["--gyro", "0.015"], |run| {
        for under_way_s in [3.0, 6.0] {
            run.wait_until_under_way(under_way_s);
            run.kill_and_await_successor("dead-reckoning", Signal::KILL);
        }
    });
    assert_there(&summary);
    assert_eq!(summary["restarts"]["dead-reckoning"], 2, "{summary}");
    let report = replayed(&recording);
    assert!(report.stages["dead-reckoning"].compared > 50, "{report}");
}
