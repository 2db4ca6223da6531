//! A consumer built against other payload types is refused with the reason, and does no harm.

use crate::support::{self, Run, in_own_process};
use common::{
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
