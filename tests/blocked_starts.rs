//! The states of the middleware's files in which it lets no process join any more, each made by a test in the middle of
//! a mission: the mission goes on by itself.

use std::{
    fs,
    path::{Path, PathBuf},
    time::{Duration, Instant},
};

use crate::support::{
    PATIENCE, Run, STAGES, assert_nothing_left, find, half_make, in_own_process, making, pid,
    signal_process,
};
use common::{bus::Bus, bus_instance::BusInstance, topics};
use rustix::process::Signal;
use serde_json::Value;

/// Mission time runs so many times as fast as the wall's.
const PACE: [&str; 2] = ["--pace", "4"];

/// The process in a port's or a node's number.
fn process_of(number: u128) -> u32 {
    (number >> 64) as u32
}

/// The directories of the node files of process `pid`.
fn nodes_of(making: &BusInstance, pid: u32) -> Vec<PathBuf> {
    let nodes = fs::read_dir(making.root().join("nodes")).unwrap();
    let nodes = nodes.map(|entry| entry.unwrap().path()).filter(|path| {
        let name = path.file_name().unwrap().to_str().unwrap();
        name.parse().is_ok_and(|id| process_of(id) == pid)
    });
    nodes.collect()
}

/// The files in shared memory of `domain` that end so.
fn shared(making: &BusInstance, suffix: &str) -> Vec<String> {
    let names = fs::read_dir("/dev/shm").unwrap().flatten();
    let names = names.filter_map(|entry| entry.file_name().into_string().ok());
    names
        .filter(|name| name.starts_with(&making.shared_memory_prefix()) && name.ends_with(suffix))
        .collect()
}

/// A connection of port `port` to another, half made.
fn half_make_connection(making: &BusInstance, port: u128) {
    let made = shared(making, ".connection");
    // Prefix and hash of the type: up to the first port's number.
    let start = made[0].rsplitn(3, '_').last().unwrap();
    half_make(Path::new(&format!(
        "/dev/shm/{start}_{port}_{port}.connection"
    )));
}

/// The mission is finished as if nothing had happened, and leaves nothing.
fn assert_arrives(robot: &str, run: Run) -> Value {
    let (code, summary) = run.finish();
    assert_eq!(
        (code, &summary["outcome"]),
        (Some(0), &"reached".into()),
        "{summary}"
    );
    assert_eq!(summary["collisions"], 0, "{summary}");
    // A lost pose is metres.
    let error = summary["pose_error_m"].as_f64().unwrap();
    assert!(error < 0.05, "{summary}");
    assert_nothing_left(robot);
    summary
}

/// That the bus was recreated is seen on every stage: each was started again.
fn assert_bus_was_recreated(summary: &Value) {
    for stage in STAGES {
        let restarts = summary["restarts"][stage].as_u64();
        assert!(restarts >= Some(1), "{stage}: {summary}");
    }
}

#[test]
fn a_connection_half_made_by_a_stage_that_was_killed_blocks_no_start() {
    let mut run = Run::start("block-own", "open-room", &PACE);
    let status = run.wait_until_under_way(1.0);
    let making = making("block-own");
    let mapper = pid(&status, "mapper");
    let ports = shared(&making, ".data");
    let port = ports.iter().find_map(|name| {
        let id = name.strip_suffix(".data")?.rsplit('_').next()?;
        id.parse().ok().filter(|id| process_of(*id) == mapper)
    });
    half_make_connection(&making, port.unwrap());
    let began = Instant::now();
    run.kill_and_await_successor("mapper", Signal::KILL);
    // Not after a start-up that was too late.
    assert!(began.elapsed().as_secs() < 3, "{:?}", began.elapsed());
    let summary = assert_arrives("block-own", run);
    assert_eq!(summary["restarts"]["mapper"], 1, "{summary}");
    assert_eq!(summary["restarts"]["planner"], 0, "{summary}");
}

#[test]
fn a_connection_half_made_by_an_unknown_process_blocks_one_start_at_most() {
    let mut run = Run::start("block-other", "open-room", &PACE);
    let status = run.wait_until_under_way(1.0);
    let making = making("block-other");
    // Of the killed mapper, by its tags, but with a number that is not its own.
    let port = 7;
    let node = nodes_of(&making, pid(&status, "mapper")).remove(0);
    let tag = format!("{}{port}.port_tag", making.shared_memory_prefix());
    fs::write(node.join(tag), "").unwrap();
    half_make_connection(&making, port);
    run.kill_and_await_successor("mapper", Signal::KILL);
    let began = Instant::now();
    while !shared(&making, "_7.connection").is_empty() {
        assert!(began.elapsed() < PATIENCE, "it stays");
        run.status();
    }
    let summary = assert_arrives("block-other", run);
    let restarts = summary["restarts"]["mapper"].as_u64().unwrap();
    assert!((1..=2).contains(&restarts), "{summary}");
    assert_eq!(summary["restarts"]["planner"], 0, "{summary}");
}

#[test]
fn a_half_made_service_blocks_starts_until_the_bus_is_recreated() {
    let mut run = Run::start("block-service", "open-room", &PACE);
    let status = run.wait_until_under_way(1.0);
    let services = making("block-service").root().join("services");
    for service in fs::read_dir(services).unwrap() {
        half_make(&service.unwrap().path());
    }
    run.kill_and_await("planner", Signal::KILL, &status);
    assert_bus_was_recreated(&assert_arrives("block-service", run));
}

#[test]
fn places_in_a_topic_that_are_never_given_back_block_starts_until_the_bus_is_recreated() {
    in_own_process(|| {
        let mut run = Run::start("block-places", "open-room", &PACE);
        let status = run.wait_until_under_way(1.0);
        let bus = Bus::join(making("block-places").domain(), "greedy").unwrap();
        let mut places = Vec::new();
        let mut take_all = || {
            loop {
                match bus.writer(&topics::POSE, 0) {
                    Ok(place) => places.push(place),
                    Err(error) if error.to_string().contains("ExceedsMax") => {
                        return Some(places.len());
                    }
                    // Two starts were refused already, and this bus is being removed.
                    Err(_) => return None,
                }
            }
        };
        let all_but_one = take_all().unwrap();
        // The last place, too, before the successor takes it: now and then it is faster.
        let mut status = status;
        'took: loop {
            signal_process(pid(&status, "dead-reckoning"), Signal::KILL);
            let died = Instant::now();
            while died.elapsed() < Duration::from_millis(100) {
                if take_all().is_none_or(|taken| taken > all_but_one) {
                    break 'took;
                }
            }
            let generation = find(&status, "dead-reckoning")["generation"].as_u64();
            status = run.wait_until("its successor runs", |status| {
                let stage = find(status, "dead-reckoning");
                stage["generation"].as_u64() > generation && stage["state"] == "running"
            });
        }
        // Never given back: as when their owners were killed while they held them.
        std::mem::forget((places, bus));
        assert_bus_was_recreated(&assert_arrives("block-places", run));
    });
}

#[test]
fn node_files_of_processes_that_ended_are_removed() {
    let mut run = Run::start("block-nodes", "open-room", &PACE);
    let status = run.wait_until_under_way(1.0);
    let making = making("block-nodes");
    let mapper = pid(&status, "mapper");
    let nodes = making.root().join("nodes");
    // As left by hundreds of processes killed while they joined; of the number, the process alone counts.
    for counter in 1_000..1_300_u128 {
        let id = (counter << 96) | (u128::from(mapper) << 64);
        fs::create_dir(nodes.join(id.to_string())).unwrap();
        let monitor = format!("{}{id}.node_monitor_context", making.shared_memory_prefix());
        fs::write(nodes.join(monitor), [0; 16]).unwrap();
    }
    let status = run.kill_and_await_successor("mapper", Signal::KILL);
    let running: Vec<_> = STAGES.iter().map(|stage| pid(&status, stage)).collect();
    let began = Instant::now();
    while !nodes_of(&making, mapper).is_empty() {
        assert!(began.elapsed() < PATIENCE, "node files stay");
        run.status();
    }
    for pid in running {
        assert_eq!(nodes_of(&making, pid).len(), 1, "of a running process");
    }
    assert_arrives("block-nodes", run);
}
