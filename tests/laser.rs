//! A robot with simulated lasers, through real processes.

use rustix::process::Signal;

use crate::support::{Run, STAGES, printed, recording_in, replayed};

#[test]
fn a_robot_with_two_lasers_arrives_though_each_stage_is_killed_and_replays_to_the_bit() {
    let lasers = [("front", 0), ("back", 180)].map(|(name, bearing_deg)| {
        format!(
            "{{name='{name}',kind='scan',forward_m=0.1,bearing_deg={bearing_deg},\
             field_of_view_deg=180,beams=91}}"
        )
    });
    let lasers = format!("--set robot.sensor=[{}]", lasers.join(","));
    // The robot arrives only after the last kill.
    let slow = "--pace 1 --set controller.speed_m_s=0.35";
    let line = format!("{slow} --set robot.model='kobuki' --set robot.rate_hz=20 {lasers}");
    let mut run = Run::under_way("laser-kills", "obstacle-course", &line, 0.3);
    for topic in ["scan", "scan_fix"] {
        printed(&["topic", "echo", topic, "--robot", "laser-kills", "-n", "1"]);
    }
    run.kill_each(Signal::KILL);
    let (_, directory) = run.arrives_in();
    let recording = recording_in(&directory);
    for topic in ["scan", "foxglove/scan/front", "foxglove/scan/back"] {
        assert!(recording.counts[topic] > 50, "{:?}", recording.counts);
    }
    let report = replayed(&recording);
    assert!(report.equal() >= 2 * STAGES.len() as u64, "{report}");
}
