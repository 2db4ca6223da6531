//! A source of fixes: `detector | fixes`, where each line of the detector is a position, `x y`, metres. The mission time of a line is
//! that of the newest pose and the time since it came.

use common::{
    domain::Domain,
    follower::{Event, Follower},
    samples::{FixSample, name},
    topics,
};
use std::{
    io::stdin,
    time::{Duration, Instant},
};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let (lines, seen) = std::sync::mpsc::channel();
    std::thread::spawn(move || {
        stdin()
            .lines()
            .map_while(Result::ok)
            .try_for_each(|line| lines.send((Instant::now(), line)))
    });
    let mut robot = Follower::new(Domain::of("x80".parse()?), "camera", &topics::POSE, |bus| {
        Ok((bus.reader(&topics::POSE)?, bus.writer(&topics::FIX, 1)?))
    });
    loop {
        let Event::Samples((poses, fixes)) = robot.wait(Duration::from_secs(1))? else { continue };
        let (Some(pose), now) = (poses.newest()?, Instant::now()) else { continue };
        for (at, line) in seen.try_iter() {
            let numbers: Vec<f64> =
                line.split_whitespace().filter_map(|word| word.parse().ok()).collect();
            let [x_m, y_m] = numbers[..] else { continue };
            let capture_ns = pose.stamp.stamp_ns.saturating_sub((now - at).as_nanos() as u64);
            let covariance = [25e-4, 0.0, 0.0, 25e-4, 0.0, 0.0];
            let fix = FixSample {
                capture_ns,
                source: name("camera"),
                x_m,
                y_m,
                heading_rad: f64::NAN,
                covariance,
                ..Default::default()
            };
            fixes.publish(pose.stamp.tick, pose.stamp.time(), fix)?;
        }
    }
}
