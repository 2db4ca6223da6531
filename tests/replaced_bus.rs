//! Tests that a consumer of a recreated bus notices, joins again, and leaves the old bus without
//! harm.

use std::time::{Duration, Instant};

use crate::support::{
    ENDLESS, PATIENCE, Run, assert_each_restarted, bus_instance, domain, generation, half_make,
    in_own_process, pid, signal_process, wait_until,
};
use common::{bus::Bus, samples::PoseSample, topics, waiter::Waiter};
use rustix::process::Signal;

const ROBOT: &str = "recreated";

/// Returns the next pose on `bus`, received as the guide's consumer does.
fn next_pose(bus: &Bus) -> PoseSample {
    let mut poses = bus.reader(&topics::POSE).unwrap();
    let mut waiter = Waiter::default();
    waiter.on(bus.wakeup(&topics::POSE).unwrap());
    let began = Instant::now();
    loop {
        if let Some(pose) = poses.next_sample().unwrap() {
            return pose;
        }
        assert!(began.elapsed() < PATIENCE, "no pose");
        waiter.wait(Duration::from_secs(1)).unwrap();
    }
}

#[test]
fn a_consumer_of_a_bus_that_was_replaced_joins_again_and_leaves_the_old_one_without_harm() {
    in_own_process(|| {
        let mut run = Run::start(ROBOT, "open-room", ENDLESS);
        let status = run.wait_until_under_way(1.0);
        let domain = domain(ROBOT);
        let old = Bus::join(&domain, "logger").unwrap();
        let old_poses = old.reader(&topics::POSE).unwrap();
        let heard = next_pose(&old);
        assert!(!old.is_replaced());

        let services = bus_instance(ROBOT).root().join("services");
        for service in std::fs::read_dir(services).unwrap() {
            half_make(&service.unwrap().path());
        }
        // The link neither reads nor writes poses. A killed process still counts as a user of its
        // topics.
        signal_process(pid(&status, "link"), Signal::KILL);
        wait_until("the bus is recreated", || {
            run.status();
            old.is_replaced()
        });
        let mut new = None;
        // There may be no bus between the two.
        wait_until("the new bus is joined", || {
            new = Bus::join(&domain, "logger").ok();
            new.is_some()
        });
        let new = new.unwrap();
        assert!(!new.is_replaced());
        assert!(next_pose(&new).stamp.tick > heard.stamp.tick);

        // This consumer is the last to leave the old bus.
        drop((old_poses, old));
        let before = run.wait_until_driving();
        let after = run.kill_and_await_successor("dead-reckoning", Signal::KILL);
        // The stage must start once. Two refused starts would recreate the bus again.
        for (stage, more) in [("dead-reckoning", 1), ("planner", 0)] {
            assert_eq!(generation(&after, stage), generation(&before, stage) + more, "{stage}");
        }
        drop(new);
        assert_each_restarted(&run.stop());
    });
}
