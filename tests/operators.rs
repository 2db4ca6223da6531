//! What an operator does to a robot that runs: stop and resume, kill and freeze, hold and release.

use crate::support::{self, Run, assert_nothing_left, find, operate, output};
use std::time::{Duration, Instant};

/// Mission time runs so many times as fast as the wall's.
const PACE: [&str; 2] = ["--pace", "4"];

#[test]
fn a_robot_told_to_stop_stands_until_it_is_told_to_go_on() {
    let mut run = Run::start("halt", "obstacle-course", &PACE);
    run.wait_until_under_way(2.0);
    operate("halt", &["stop"]);
    let stopped = run.wait_until("it is stopped", |status| {
        status["order"] == "stopped by an operator"
    });
    let tick = stopped["tick"].as_u64().unwrap();
    // Ticks begin only under the order to drive.
    let later = run.wait_until("some beats have passed", |_| true);
    assert!(later["tick"].as_u64().unwrap() <= tick + 1, "{later}");
    operate("halt", &["resume"]);
    let (code, summary) = run.finish();
    assert_eq!(
        (code, &summary["outcome"]),
        (Some(0), &"reached".into()),
        "{summary}"
    );
    assert_nothing_left("halt");
}

#[test]
fn a_stage_that_dies_again_and_again_is_held_until_an_operator_releases_it() {
    let mut run = Run::start("held", "open-room", &["--pace", "1"]);
    run.wait_until_under_way(1.0);
    // From its next generation on it fails when it starts.
    let checkpoint = run.directory().join("mapper.checkpoint");
    std::fs::remove_file(&checkpoint).unwrap();
    std::fs::create_dir(&checkpoint).unwrap();
    operate("held", &["kill", "mapper"]);
    run.wait_until("it is held", |status| {
        find(status, "mapper")["state"] == "held"
    });
    let status = run.wait_until("the robot is stopped", |status| {
        status["order"] == "stopped, a stage is held"
    });
    for stage in status["stages"].as_array().unwrap() {
        let others = stage["name"] != "mapper";
        assert!(
            !others || stage["restarts"] == 0,
            "a sibling was touched: {status}"
        );
    }
    let deaths = run.records("deaths.jsonl");
    assert_eq!(deaths[0]["cause"]["signalled"]["signal"], 9, "{deaths:?}");
    assert_eq!(deaths[0]["next"], "start_now", "{deaths:?}");
    let last = deaths.last().unwrap();
    assert_eq!(
        (&last["cause"]["exited"], &last["next"]),
        (&1.into(), &"hold".into())
    );
    let words = last["last_words"].as_str().unwrap();
    assert!(words.contains("mapper.checkpoint"), "{words}");
    std::fs::remove_dir(&checkpoint).unwrap();
    operate("held", &["restart", "mapper"]);
    let (code, summary) = run.finish();
    assert_eq!(
        (code, &summary["outcome"]),
        (Some(0), &"reached".into()),
        "{summary}"
    );
    assert_nothing_left("held");
}

#[test]
fn a_frozen_stage_is_recorded_as_hung_and_a_thawed_one_goes_on() {
    let mut run = Run::start("thawed", "obstacle-course", &PACE);
    run.wait_until_under_way(1.0);
    // Two commands must start and end before the controller is overdue: again, where the machine was too slow.
    let thawed = loop {
        let status = run.wait_until("the controller runs", |status| {
            find(status, "controller")["state"] == "running"
        });
        let froze = Instant::now();
        operate("thawed", &["freeze", "controller"]);
        operate("thawed", &["thaw", "controller"]);
        if froze.elapsed() < Duration::from_millis(250) {
            break find(&status, "controller")["pid"].clone();
        }
    };
    operate("thawed", &["freeze", "mapper"]);
    let status = run.wait_until("it is replaced", |status| {
        find(status, "mapper")["generation"] == 2 && find(status, "mapper")["state"] == "running"
    });
    assert_eq!(find(&status, "controller")["pid"], thawed, "{status}");
    let mut deaths = run.records("deaths.jsonl");
    deaths.retain(|death| death["stage"] == "mapper");
    assert_eq!(deaths.len(), 1, "{deaths:?}");
    assert_eq!(deaths[0]["hung"], true, "{deaths:?}");
    assert!(
        deaths[0]["beat_age_s"].as_f64().unwrap() >= 0.5,
        "{deaths:?}"
    );
    assert!(
        deaths[0]["last_words"].as_str().unwrap().contains("ready"),
        "{deaths:?}"
    );
    let (_, summary) = run.finish();
    assert_eq!(summary["outcome"], "reached", "{summary}");
    assert_nothing_left("thawed");
}

#[test]
fn a_command_for_a_robot_or_stage_that_is_not_there_is_refused_with_the_reason() {
    let output = output(&["stop", "--robot", "nobody"]);
    assert!(!output.status.success());
    let said = String::from_utf8(output.stderr).unwrap();
    assert!(said.contains("nobody"), "{said}");
    let output = support::output(&["restart", "wheel"]);
    let said = String::from_utf8(output.stderr).unwrap();
    assert!(said.contains("dead-reckoning"), "{said}");
}
