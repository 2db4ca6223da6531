//! Tests of recordings played on a bus, with stages in processes of their own.

use std::{
    io::{BufRead as _, BufReader, Lines},
    process::{ChildStderr, Stdio},
};

use recording::{Recording, replay::diff::diff};
use rustix::process::Signal;
use serde_json::Value;

use crate::support::{
    assert_nothing_left, firsthand, golden, json_of, output, refused, signal_process,
};

/// The first line of `said` with `words`.
fn wait_for(said: &mut Lines<BufReader<ChildStderr>>, words: &str) -> String {
    let mut lines = said.map(Result::unwrap);
    lines.find(|line| line.contains(words)).unwrap()
}

/// The process that is reported as that of `stage`.
fn process_of(stage: &str, said: &mut Lines<BufReader<ChildStderr>>) -> u32 {
    let line = wait_for(said, &format!("{stage}: process"));
    let (_, process) = line.rsplit_once(' ').unwrap();
    process.parse().unwrap()
}

/// Assert that `stage` answered every tick that the recorded one did, with the same values.
fn assert_as_recorded(report: &Value, stage: &str) {
    let found = &report["stages"][stage];
    assert_eq!(found["equal"], found["answered"], "{report}");
    assert_eq!(found["unanswered"], 0, "{report}");
}

#[test]
fn live_stages_answer_a_played_recording_as_it_was_recorded() {
    let golden = golden();
    let file = golden.path.to_str().unwrap();
    let played = output(&["replay", file, "--live", "--robot", "live-equal", "--json"]);
    assert_eq!(played.status.code(), Some(0), "{played:?}");
    let report: Value = serde_json::from_slice(&played.stdout).unwrap();
    for stage in ["dead-reckoning", "mapper", "planner", "controller"] {
        let found = &report["stages"][stage];
        assert!(found["answered"].as_u64().unwrap() > 20, "{report}");
        assert_as_recorded(&report, stage);
    }
    assert_nothing_left("live-equal");
}

#[test]
fn another_constant_or_planner_is_tried_on_a_played_recording_and_the_first_difference_told() {
    let golden = golden();
    let file = golden.path.to_str().unwrap();
    for (stage, topic, set) in [
        ("controller", "command", "controller.speed_m_s=0.3"),
        ("planner", "guidance", "planner.executable=\"bug\""),
    ] {
        let arguments = ["replay", file, "--live", "--robot", "live-other", "--json"];
        let arguments = [&arguments[..], &["--stage", stage, "--set", set]].concat();
        let played = output(&arguments);
        assert_eq!(played.status.code(), Some(1), "{played:?}");
        let report: Value = serde_json::from_slice(&played.stdout).unwrap();
        assert_eq!(report["first"]["topic"], topic, "{report}");
        assert_eq!(report["stages"].as_object().unwrap().len(), 1, "{report}");
    }
    assert_nothing_left("live-other");
}

#[test]
fn a_consumer_reads_a_played_recording_as_it_reads_a_robot() {
    let directory = tempfile::tempdir().unwrap();
    let copy = directory.path().join("copy.mcap");
    let mut recorder =
        firsthand(&["record", "--robot", "live-read", "--out"]).arg(&copy).spawn().unwrap();
    let golden = golden();
    let file = golden.path.to_str().unwrap();
    let arguments = ["--robot", "live-read", "--stage", "planner", "--pace", "4"];
    let played = output(&[&["replay", file, "--live"], &arguments[..]].concat());
    assert_eq!(played.status.code(), Some(0), "{played:?}");
    signal_process(recorder.id(), Signal::TERM);
    recorder.wait().unwrap();
    let parting = diff(&golden, &Recording::open(&copy).unwrap()).unwrap();
    assert_eq!(parting.first, None, "{parting}");
    assert!(parting.ticks > 20, "{parting}");
    assert_nothing_left("live-read");
}

#[test]
fn time_waits_for_a_live_stage_that_stands_still() {
    let golden = golden();
    let file = golden.path.to_str().unwrap();
    let mut played = firsthand(&["replay", file, "--live", "--robot", "live-wait"])
        .args(["--stage", "planner", "--json"])
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let mut said = BufReader::new(played.stderr.take().unwrap()).lines();
    let planner = process_of("planner", &mut said);
    signal_process(planner, Signal::STOP);
    wait_for(&mut said, "waiting for planner in tick");
    signal_process(planner, Signal::CONT);
    let (_, report) = json_of(&played.wait_with_output().unwrap());
    assert_as_recorded(&report[0], "planner");
    assert_nothing_left("live-wait");
}

#[test]
fn a_live_stage_that_is_killed_ends_the_replay_by_its_name_and_leaves_nothing() {
    let golden = golden();
    let file = golden.path.to_str().unwrap();
    let mut played = firsthand(&["replay", file, "--live", "--robot", "live-killed"])
        .args(["--stage", "mapper", "--pace", "0.1"])
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let mut said = BufReader::new(played.stderr.take().unwrap()).lines();
    signal_process(process_of("mapper", &mut said), Signal::KILL);
    wait_for(&mut said, "mapper ended in tick");
    assert_eq!(played.wait().unwrap().code(), Some(1));
    assert_nothing_left("live-killed");
    let link = ["replay", file, "--live", "--stage", "link"];
    refused(&link, "never-live", &["link"]);
}
