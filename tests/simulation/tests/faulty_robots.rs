//! Robots with a fault for some time, in one process.

#![allow(clippy::unwrap_used)]

use std::{path::Path, time::Duration};

use common::{mission::Mission, samples::Cause};
use simulation::{Disturbance, Ran, Request, RobotFault, Scenario, What};

fn at(seconds: f64, what: What) -> Disturbance {
    Disturbance { at: Duration::from_secs_f64(seconds), what }
}

/// Runs a mission to a target 4 m ahead, with further keys.
fn ran(keys: &str, disturbances: &[Disturbance]) -> Ran {
    let text = format!("target = [4, 0]\ntimeout_s = 120\n{keys}");
    let mission = Mission::parse(&text, Path::new("faulty.toml")).unwrap();
    let ran = Scenario { disturbances: disturbances.to_vec(), ..Scenario::calm(&mission) }.run();
    assert!(ran.broken.is_none(), "{:?}", ran.broken);
    ran
}

#[test]
fn a_robot_whose_encoders_cannot_be_true_stands_and_its_mission_ends_with_the_reason() {
    for fault in [
        RobotFault::MotorRepeated,
        RobotFault::EncoderDead,
        RobotFault::EncoderReversed,
        RobotFault::CountsRandom,
    ] {
        let ran = ran("", &[at(3.0, What::Fault(Some(fault)))]);
        let ending = ran.finished.unwrap().ending;
        assert_eq!(ending.outcome.as_str(), "aborted", "{fault:?}: {ending:?}");
        assert_eq!(ending.cause, Some("odometry implausible for long"), "{fault:?}");
        let moved_s = ran.moved.unwrap().as_secs_f64() - 3.0;
        assert!(moved_s < 1.5, "{fault:?}: told to move for {moved_s} s");
    }
}

#[test]
fn a_robot_stands_for_the_time_of_its_fault_and_then_goes_on() {
    for (fault, cause) in [
        (RobotFault::RangeInvalid, Cause::RangeSilent),
        (RobotFault::StreamsStop, Cause::FramesSilent),
        (RobotFault::Silence, Cause::RobotLost),
        (RobotFault::FramesSlow, Cause::FramesSlow),
    ] {
        let times = [(3.0, Some(fault)), (8.0, None)];
        let ran =
            ran("sure_within_m = 9", &times.map(|(time_s, fault)| at(time_s, What::Fault(fault))));
        let stood = ran.causes.iter().find(|(_, it)| *it == Some(cause));
        assert!(stood.is_some_and(|(at, _)| *at < Duration::from_secs(8)), "{:?}", ran.causes);
        let ending = ran.finished.unwrap().ending;
        assert_eq!(ending.outcome.as_str(), "reached", "{fault:?}: {ending:?}");
    }
}

#[test]
fn a_robot_whose_counts_jump_in_motion_stands_and_its_arrival_is_unsure() {
    let ran = ran("sure_within_m = 0.5", &[at(4.0, What::Fault(Some(RobotFault::CountsReset)))]);
    let stood = ran.causes.iter().any(|(_, it)| *it == Some(Cause::OdometryImplausible));
    assert!(stood, "{:?}", ran.causes);
    let ending = ran.finished.unwrap().ending;
    assert_eq!(ending.outcome.as_str(), "reached_unsure", "{ending:?}");
}

#[test]
fn a_robot_that_ignores_velocity_0_is_made_to_stand_by_other_means() {
    let ran = ran(
        "",
        &[
            at(3.0, What::Fault(Some(RobotFault::IgnoresZero))),
            at(3.5, What::Ask(Request::Stop)),
            at(8.0, What::End),
        ],
    );
    let last = ran.truth.last().unwrap();
    assert!(last.v.abs() < 0.01, "{} m/s", last.v);
}
