//! External pose sources as real processes on the robot's bus.

use std::{f64::consts::TAU, path::Path, thread, time::Duration};

use common::{
    follower::{Event, Follower},
    ground_truth::{GROUND_TRUTH, GroundTruthTick},
    samples::{FixSample, PoseSample, TurnSample, name},
    topics,
};
use recording::log_files::Tail;
use rustix::process::Signal;

use crate::support::{Run, domain, in_own_process, recording_in, replayed};

/// Maximum poses and ground-truth ticks that wait for each other.
const WAITING: usize = 64;
/// Errors: of a fix in x and in y, metres; of the gyro, radians per square root of a second, its
/// bias, rad/s, and its scale.
const FIX_M: f64 = 0.05;
const GYRO: [f64; 3] = [0.00026, 0.00035, 1.005];

/// Publishes the measurements of a camera, some off by a metre, and of a gyro, by the ground truth
/// of the run in `directory`, until the robot is gone.
fn observe(robot: &str, directory: &Path) {
    let mut follower = Follower::new(domain(robot), "sources", &topics::POSE, |bus| {
        let writers = (bus.writer(&topics::FIX, 1)?, bus.writer(&topics::TURN, 1)?);
        Ok((bus.reader(&topics::POSE)?, writers))
    });
    let (mut file, mut truth) = (Tail::default(), Vec::new());
    let mut poses = Vec::<PoseSample>::new();
    let (mut turned, mut turns, mut fixes) = (None, 0, 0);
    loop {
        let (reader, (fix, turn)) = match follower.wait(Duration::from_secs(1)).unwrap() {
            Event::Samples((reader, writers)) => (reader, writers),
            Event::Disconnected => break,
            Event::Connected | Event::Nothing => continue,
        };
        poses.extend(std::iter::from_fn(|| reader.next_sample().unwrap()));
        let lines = file.lines(&directory.join(GROUND_TRUTH));
        truth.extend(lines.lines().flat_map(serde_json::from_str::<GroundTruthTick>));
        for pose in std::mem::take(&mut poses) {
            // Equal counts match a pose with the ground truth's mission time.
            let Some(at) = truth.iter().position(|truth| truth.is_of(&pose)) else {
                poses.push(pose);
                continue;
            };
            let GroundTruthTick { x, y, heading, .. } = truth[at];
            truth.drain(..=at);
            poses.clear();
            let (tick, time) = (pose.stamp.tick, pose.stamp.time());
            let now_s = time.seconds();
            // Spread evenly, with a deviation of 1.
            let noise = |of: f64| 2_f64.sqrt() * (of * now_s).sin();
            let (before_s, before) = turned.replace((now_s, heading)).unwrap_or((now_s, heading));
            let seconds = now_s - before_s;
            let [deviation, bias, scale] = GYRO;
            let deviation = deviation * seconds.max(0.0).sqrt();
            let measured = TurnSample {
                capture_ns: time.0,
                sequence: turns,
                turn_rad: (heading - before) * scale + bias * seconds + deviation * noise(997.0),
                variance_rad2: deviation * deviation,
                ..TurnSample::default()
            };
            turn.publish(tick, time, measured).unwrap();
            turns += 1;
            if now_s >= f64::from(fixes) / 2.0 {
                fixes += 1;
                let off_m = if fixes % 20 == 7 { 1.0 } else { 0.0 };
                let direction = TAU * f64::from(fixes) / 7.0;
                let measured = FixSample {
                    capture_ns: time.0,
                    source: name("simulated"),
                    x_m: x + FIX_M * noise(641.0) + off_m * direction.cos(),
                    y_m: y + FIX_M * noise(773.0) + off_m * direction.sin(),
                    heading_rad: f64::NAN,
                    covariance: [FIX_M * FIX_M, 0.0, 0.0, FIX_M * FIX_M, 0.0, 0.0],
                    ..FixSample::default()
                };
                fix.publish(tick, time, measured).unwrap();
            }
        }
        poses.drain(..poses.len().saturating_sub(WAITING));
        truth.drain(..truth.len().saturating_sub(WAITING));
    }
    assert!(fixes > 10, "{fixes}");
}

#[test]
fn by_fixes_and_a_gyro_unequal_wheels_arrive_though_dead_reckoning_is_killed_between_them() {
    in_own_process(|| {
        let robot = "fix-killed";
        // A right wheel 1 % larger than the left leads 0.7 m past the target after 6 m.
        let keys = "--set simulation.realism='laboratory' --set controller.speed_m_s=0.4 \
                    --set simulation.wheels.diameter_ratio=1.01 \
                    --set robot.odometry.diameter_ratio_sd=0.005 \
                    --set robot.odometry.track_scale_sd=0.015 --set sure_within_m=0.5";
        // A source must not stall for 2 s of mission time while a loaded machine replaces a stage.
        let mut run = Run::start(robot, "obstacle-course", &format!("--pace 2 {keys}"));
        let directory = run.directory();
        let sources = thread::spawn(move || observe(robot, &directory));
        for under_way_s in [3.0, 6.0] {
            run.wait_until_under_way(under_way_s);
            run.kill_and_await_successor("dead-reckoning", Signal::KILL);
        }
        let (summary, directory) = run.arrives_in();
        sources.join().unwrap();
        assert!(summary["true_distance_m"].as_f64() < Some(0.35), "{summary}");
        assert!(summary["pose_error_m"].as_f64() < Some(0.2), "{summary}");
        assert_eq!(summary["restarts"]["dead-reckoning"], 2, "{summary}");
        let recording = recording_in(&directory);
        let last = recording.samples(&topics::POSE).unwrap().last().unwrap().unwrap();
        assert!(last.fixes > 10 && last.relocations == 0, "{last:?}");
        let report = replayed(&recording);
        assert!(report.stages["dead-reckoning"].compared > 50, "{report}");
    });
}
