//! Test that a consumer built with other payload types is refused with the reason, and does no
//! harm.

use std::fs;

use crate::support::{self, Run, bus_instance, in_own_process, output, printed, refused};
use common::{
    VERSION,
    bus::{Bus, BusError, Topic},
    samples::WheelSample,
    topics,
};
use rustix::process::Signal;

#[test]
fn a_consumer_built_against_another_payload_is_refused_with_the_reason() {
    in_own_process(|| {
        let mut run = Run::under_way("foreign", "obstacle-course", &["--pace", "1"], 0.3);
        let bus = Bus::join(&support::domain("foreign"), "foreigner").unwrap();
        let pose_as_wheels = Topic::<WheelSample>::new(topics::POSE.spec());
        let error = bus.reader(&pose_as_wheels).unwrap_err();
        assert!(matches!(error, BusError::Incompatible { topic: "pose" }), "{error}");
        drop(bus);
        run.wait_until_under_way(1.0);
        run.signal(Signal::TERM);
        let (_, summary) = run.finish();
        assert_eq!(summary["restarts"]["dead-reckoning"], 0, "{summary}");
    });
}

#[test]
fn a_robot_of_another_version_is_named_and_can_be_stopped() {
    let robot = "foreign-vers";
    let run = Run::under_way(robot, "obstacle-course", &["--pace", "1"], 0.3);
    let file = bus_instance(robot).config();
    let config = fs::read_to_string(&file).unwrap();
    fs::write(&file, config.replacen(VERSION, "99.0.0", 1)).unwrap();
    for command in [&["status"][..], &["goto", "1", "1"], &["stage", "kill", "planner"]] {
        let command = [command, &["--robot", robot]].concat();
        refused(&command, "other-version", &["99.0.0", VERSION]);
    }
    assert!(printed(&["status", "--all"]).contains("it runs another version"));
    let stopped = output(&["stop", "--robot", robot]);
    assert!(stopped.status.success(), "{stopped:?}");
    fs::write(&file, config).unwrap();
    run.stop();
}
