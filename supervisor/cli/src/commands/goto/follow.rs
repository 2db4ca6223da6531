//! Follows a beacon in the foreground, which may be another robot's published pose.

use std::time::Duration;

use common::{
    bus::{Bus, BusError, Reader, Writer},
    domain::RobotName,
    follower::{Event, Follower},
    kinematics::Pose2,
    samples::{BeaconSample, FollowState, FollowingSample, PoseSample, name},
    signals::Signals,
    topics,
};
use console::{
    failure::{Result, refuse},
    output::print_line,
    stream::LOOK_EVERY,
};
use glam::DVec2;
use mission_control::operator;

use super::Arguments;

struct Own {
    following: Reader<FollowingSample>,
    poses: Reader<PoseSample>,
    beacon: Writer<BeaconSample>,
}

fn open(bus: &Bus) -> Result<Own, BusError> {
    Ok(Own {
        following: bus.reader(&topics::FOLLOWING)?,
        poses: bus.reader(&topics::POSE)?,
        beacon: bus.writer(&topics::BEACON, 1)?,
    })
}

pub fn main(arguments: &Arguments, followed: Option<&RobotName>) -> Result {
    let robot = &arguments.robot;
    let frame = frame(&arguments.frame)?;
    let distance_m = arguments.distance.unwrap_or(0.0);
    if !(distance_m > 0.0 || arguments.distance.is_none()) {
        return refuse(
            "too-near",
            format!("--distance {distance_m} is not a distance; give metres above 0"),
        );
    }
    if followed == Some(robot) {
        return refuse(
            "follows-itself",
            format!("robot {robot} cannot follow itself; name another with --robot"),
        );
    }
    let mut signals = Signals::that_end()?;
    operator::follow(robot, distance_m)?;
    let mut other = followed.map(|other| {
        Follower::new(other.domain(), "follow", &topics::POSE, |bus| bus.reader(&topics::POSE))
    });
    let mut own = Follower::new(robot.domain(), "follow", &topics::FOLLOWING, open);
    let (mut newest, mut pose) = (None::<FollowingSample>, PoseSample::default());
    while !signals.came() {
        let mut seen = None;
        if let Some(other) = &mut other
            && let Event::Samples(poses) = other.wait(LOOK_EVERY)?
        {
            seen = poses.newest()?;
        }
        // Wakes on the other robot's pose, or else on the own supervisor.
        let patience = if other.is_some() { Duration::ZERO } else { LOOK_EVERY };
        if matches!(own.wait(patience)?, Event::Disconnected) {
            break;
        }
        let Some(Own { following, poses, beacon }) = own.topics() else { continue };
        pose = poses.newest()?.unwrap_or(pose);
        if let Some(seen) = seen {
            beacon.publish(pose.stamp.tick, pose.stamp.time(), sample(&pose, &seen, frame))?;
        }
        newest = following.newest()?.or(newest);
        if newest.is_some_and(|newest| newest.state() == FollowState::Ended) {
            break;
        }
    }
    let ended = newest.is_some_and(|newest| newest.state() == FollowState::Ended);
    if !ended && let Some(Own { following, .. }) = own.topics() {
        operator::end_follow(robot)?;
        newest = following.newest()?.or(newest);
    }
    print_line(newest.unwrap_or_default().result())
}

/// Returns the beacon, stamped with the time of `own`.
fn sample(own: &PoseSample, seen: &PoseSample, frame: Pose2) -> BeaconSample {
    let place = frame.position + frame.axis().rotate(seen.pose().position);
    BeaconSample {
        capture_ns: own.stamp.stamp_ns,
        source: name("robot"),
        x_m: place.x,
        y_m: place.y,
        deviation_m: seen.position_within_m() / 2.0,
        ..BeaconSample::default()
    }
}

fn frame(numbers: &[f64]) -> Result<Pose2> {
    match *numbers {
        [] => Ok(Pose2::default()),
        [x, y, heading] if [x, y, heading].iter().all(|number| number.is_finite()) => {
            Ok(Pose2 { position: DVec2::new(x, y), heading: heading.to_radians() })
        }
        _ => refuse("no-frame", "--frame is not a pose; give three finite numbers"),
    }
}
