//! Tests of the bus as a process that joins it sees it.

use std::{collections::BTreeSet, fs, os::unix::fs::MetadataExt as _};

use common::{
    VERSION,
    bus::{Bus, BusError, OpenedBy, Topic},
    samples::WheelSample,
    topics,
    wiring::{EVERY_STAGE_READS, EVERY_STAGE_WRITES, Topics},
};
use processes::stages;
use serde_json::Value;

use crate::support::{
    Run, assert_no_restart, bus_instance, domain, in_own_process, logged, operate, pid, printed,
    refused, shared_memory, words,
};

fn names(lists: &[Topics]) -> BTreeSet<&'static str> {
    let listed = lists.iter().copied().flatten();
    listed.map(|topic| topic.spec().name).collect()
}

fn assert_each_stage_has_open_what_its_row_lists_and_nothing_else(bus: &Bus, status: &Value) {
    let opened: Vec<_> = topics::TABLE
        .iter()
        .map(|topic| (topic.spec().name, topic.opened_by(bus).unwrap()))
        .collect();
    for stage in stages::TABLE {
        let (name, pid, wiring) = (stage.name, pid(status, stage.name), stage.wiring);
        let found = |has: &dyn Fn(&OpenedBy) -> bool| -> BTreeSet<_> {
            let has = opened.iter().filter(|(_, opened)| has(opened));
            has.map(|(name, _)| *name).collect()
        };
        let reads = names(&[wiring.inputs, wiring.feedback, EVERY_STAGE_READS]);
        let writes = names(&[wiring.outputs, EVERY_STAGE_WRITES]);
        assert_eq!(found(&|opened| opened.readers.contains(&pid)), reads, "{name}");
        assert_eq!(found(&|opened| opened.writers.contains(&pid)), writes, "{name}");
        let woken = found(&|opened| opened.woken.contains(&pid));
        assert_eq!(woken, names(&[wiring.wakes]), "{name}");
    }
}

fn assert_no_file_is_open_to_other_users(robot: &str) {
    let domain = domain(robot);
    let shared = shared_memory(&domain.shared_memory_prefix());
    for path in shared.into_iter().chain([domain.directory().to_owned()]) {
        // A removed file cannot be opened by others.
        if let Ok(found) = fs::symlink_metadata(&path) {
            assert_eq!(found.mode() & 0o077, 0, "{}", path.display());
        }
    }
}

#[test]
fn a_bus_is_wired_as_its_table_says_closed_to_other_users_and_to_other_payloads() {
    in_own_process(|| {
        let low = "--pace 2 --set simulation.battery.start_v=6.4";
        let mut run = Run::start("wiring", "obstacle-course", low);
        let status = run
            .wait_until("the battery is known to be low", |status| status["power"]["low"] == true);
        let volts = status["power"]["motor_v"].as_f64().unwrap();
        assert!((volts - 6.4).abs() < 0.01, "{status}");
        let status = run.wait_until_under_way(1.0);
        let bus = Bus::join(&domain("wiring"), "test").unwrap();
        assert_each_stage_has_open_what_its_row_lists_and_nothing_else(&bus, &status);
        assert_no_file_is_open_to_other_users("wiring");
        let pose_as_wheels = Topic::<WheelSample>::new(topics::POSE.spec());
        let error = bus.reader(&pose_as_wheels).unwrap_err();
        assert!(matches!(error, BusError::Incompatible { topic: "pose" }), "{error}");
        drop(bus);
        run.wait_until_under_way(2.0);
        // Each battery is told once.
        for pack in ["board", "motor", "servo"] {
            let told = ["WARN", &format!("pack=\"{pack}\"")];
            assert_eq!(logged(&run.directory(), "link", &told), 1, "{pack}");
        }
        assert_no_restart(&run.stop());
    });
}

#[test]
fn a_robot_of_another_version_is_named_and_can_be_stopped() {
    let robot = "foreign-vers";
    let run = Run::under_way(robot, "obstacle-course", "--pace 1", 0.3);
    let file = bus_instance(robot).config();
    let config = fs::read_to_string(&file).unwrap();
    fs::write(&file, config.replacen(VERSION, "99.0.0", 1)).unwrap();
    for line in ["status", "goto 1 1", "stage kill planner"] {
        let line = format!("{line} --robot {robot}");
        refused(&words(&line), "other-version", &["99.0.0", VERSION]);
    }
    assert!(printed(&["status", "--all"]).contains("it runs another version"));
    operate(robot, "stop");
    fs::write(&file, config).unwrap();
    run.stop();
}
