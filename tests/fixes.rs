//! External pose sources as real processes on the robot's bus.

use std::process::Stdio;

use common::topics;
use rustix::process::Signal;

use crate::support::{Run, firsthand, recording_in, replayed};

#[test]
fn by_fixes_and_a_gyro_unequal_wheels_arrive_though_dead_reckoning_is_killed_between_them() {
    let robot = "fix-killed";
    // A right wheel 1 % larger than the left leads 0.7 m past the target after 6 m.
    let keys = "--set simulation.realism='laboratory' --set controller.speed_m_s=0.4 \
                --set simulation.wheels.diameter_ratio=1.01 \
                --set robot.odometry.diameter_ratio_sd=0.005 \
                --set robot.odometry.track_scale_sd=0.015 --set sure_within_m=0.5";
    // A source must not stall for 2 s of mission time while a loaded machine replaces a stage.
    let mut run = Run::start(robot, "obstacle-course", &format!("--pace 2 {keys}"));
    let mut sources = firsthand(&["bench", "sources", "--robot", robot])
        .arg(run.directory())
        // Some fixes are off by a metre.
        .args(["--jumps", "0.05", "--fixes", "2", "--gyro", "0.015"])
        .stdout(Stdio::null())
        .spawn()
        .unwrap();
    for under_way_s in [3.0, 6.0] {
        run.wait_until_under_way(under_way_s);
        run.kill_and_await_successor("dead-reckoning", Signal::KILL);
    }
    assert!(sources.wait().unwrap().success());
    let (summary, directory) = run.arrives_in();
    assert!(summary["true_distance_m"].as_f64() < Some(0.35), "{summary}");
    assert!(summary["pose_error_m"].as_f64() < Some(0.2), "{summary}");
    assert_eq!(summary["restarts"]["dead-reckoning"], 2, "{summary}");
    let recording = recording_in(&directory);
    let last = recording.samples(&topics::POSE).unwrap().last().unwrap().unwrap();
    assert!(last.fixes > 10 && last.relocations == 0, "{last:?}");
    let report = replayed(&recording);
    assert!(report.stages["dead-reckoning"].compared > 50, "{report}");
}
