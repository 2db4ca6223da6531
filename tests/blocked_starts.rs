//! Tests of recovery from middleware file states that block further processes from joining.

use std::{
    fs,
    path::{Path, PathBuf},
};

use crate::support::{
    Run, STAGES, assert_each_restarted, bus_instance, half_make, in_own_process, pid,
    shared_memory, signal_process, wait_until,
};
use common::{
    bus::{Bus, BusError},
    bus_instance::BusInstance,
    topics,
};
use rustix::process::Signal;
use serde_json::Value;

const PACE: &str = "--pace 4";

fn process_of(number: u128) -> u32 {
    (number >> 64) as u32
}

fn nodes_of(bus: &BusInstance, pid: u32) -> Vec<PathBuf> {
    let nodes = fs::read_dir(bus.root().join("nodes")).unwrap();
    let nodes = nodes.map(|entry| entry.unwrap().path()).filter(|path| {
        let name = path.file_name().unwrap().to_str().unwrap();
        name.parse().is_ok_and(|id| process_of(id) == pid)
    });
    nodes.collect()
}

fn shared(bus: &BusInstance, suffix: &str) -> Vec<String> {
    let paths = shared_memory(&bus.shared_memory_prefix()).into_iter();
    let names = paths.map(|path| path.file_name().unwrap().to_str().unwrap().to_owned());
    names.filter(|name| name.ends_with(suffix)).collect()
}

fn half_make_connection(bus: &BusInstance, port: u128) {
    let made = shared(bus, ".connection");
    // The common part is the prefix and the type's hash, before the first port's number.
    let start = made[0].rsplitn(3, '_').last().unwrap();
    half_make(Path::new(&format!("/dev/shm/{start}_{port}_{port}.connection")));
}

fn assert_arrives(run: Run) -> Value {
    let summary = run.arrives();
    // A lost pose would have an error of metres.
    assert!(summary["pose_error_m"].as_f64() < Some(0.05), "{summary}");
    summary
}

#[test]
fn what_a_killed_stage_left_half_made_blocks_no_start_and_is_removed() {
    let slow = format!("{PACE} --set controller.speed_m_s=0.1");
    let mut run = Run::start("block-own", "open-room", &slow);
    let status = run.wait_until_under_way(1.0);
    let bus = bus_instance("block-own");
    let mapper = pid(&status, "mapper");
    let ports = shared(&bus, ".data");
    let port = ports.iter().find_map(|name| {
        let id = name.strip_suffix(".data")?.rsplit('_').next()?;
        id.parse().ok().filter(|id| process_of(*id) == mapper)
    });
    half_make_connection(&bus, port.unwrap());
    let nodes = bus.root().join("nodes");
    // Hundreds of processes killed while joining leave such files. Only the process in an id
    // matters.
    for counter in 1_000..1_300_u128 {
        let id = (counter << 96) | (u128::from(mapper) << 64);
        fs::create_dir(nodes.join(id.to_string())).unwrap();
        let monitor = format!("{}{id}.node_monitor_context", bus.shared_memory_prefix());
        fs::write(nodes.join(monitor), [0; 16]).unwrap();
    }
    // State of a generation killed after it created its node's directory and before it registered
    // the node.
    let cut_off = nodes.join(((1_u128 << 96) | (u128::from(mapper) << 64) | 1).to_string());
    fs::create_dir(&cut_off).unwrap();
    fs::write(cut_off.join(format!("{}node.details", bus.shared_memory_prefix())), "").unwrap();
    let status = run.kill_and_await("mapper", Signal::KILL, &status);
    wait_until("node files are removed", || {
        run.status();
        nodes_of(&bus, mapper).is_empty() && !cut_off.exists()
    });
    for stage in STAGES {
        let process = pid(&status, stage);
        assert_eq!(nodes_of(&bus, process).len(), 1, "of a running process");
    }
    let summary = assert_arrives(run);
    // A blocked start would have been aborted and repeated.
    assert_eq!(summary["restarts"]["mapper"], 1, "{summary}");
    assert_eq!(summary["restarts"]["planner"], 0, "{summary}");
}

#[test]
fn a_connection_half_made_by_an_unknown_process_blocks_one_start_at_most() {
    let mut run = Run::start("block-other", "open-room", PACE);
    let status = run.wait_until_under_way(1.0);
    let bus = bus_instance("block-other");
    // By its tags the port belongs to the mapper, but its id has another process number.
    let port = 7;
    let node = nodes_of(&bus, pid(&status, "mapper")).remove(0);
    let tag = format!("{}{port}.port_tag", bus.shared_memory_prefix());
    fs::write(node.join(tag), "").unwrap();
    half_make_connection(&bus, port);
    run.kill_and_await("mapper", Signal::KILL, &status);
    wait_until("it is removed", || {
        run.status();
        shared(&bus, "_7.connection").is_empty()
    });
    let summary = assert_arrives(run);
    let restarts = summary["restarts"]["mapper"].as_u64().unwrap();
    assert!((1..=2).contains(&restarts), "{summary}");
    assert_eq!(summary["restarts"]["planner"], 0, "{summary}");
}

#[test]
fn places_in_a_topic_that_are_never_given_back_block_starts_until_the_bus_is_recreated() {
    in_own_process(|| {
        let mut run = Run::start("block-places", "open-room", PACE);
        let status = run.wait_until_under_way(1.0);
        let joined = Bus::join(&bus_instance("block-places").domain, "greedy").unwrap();
        let mut places = Vec::new();
        let mut take_all = || {
            loop {
                match joined.writer(&topics::POSE, 0) {
                    Ok(place) => places.push(place),
                    Err(BusError::Refused { detail, .. }) if detail.contains("ExceedsMax") => {
                        return places.len();
                    }
                    Err(error) => panic!("{error}"),
                }
            }
        };
        let all_but_one = take_all();
        // The supervisor is frozen until the last place is taken, so that it cannot start a
        // successor.
        run.signal(Signal::STOP);
        signal_process(pid(&status, "dead-reckoning"), Signal::KILL);
        wait_until("the bus gives the place of the killed stage", || {
            joined.clear_up(&[]).unwrap();
            take_all() > all_but_one
        });
        run.signal(Signal::CONT);
        // The places are leaked, as if their owners had been killed.
        std::mem::forget((places, joined));
        assert_each_restarted(&assert_arrives(run));
    });
}
