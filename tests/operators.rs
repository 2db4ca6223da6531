//! What an operator does to a robot that runs: stop and resume, kill and freeze, hold and release.

use rustix::process::Signal;
use serde_json::Value;

use crate::support::{self, Run, assert_nothing_left, find, operate, output, pid};

/// Mission time runs so many times as fast as the wall's.
const PACE: [&str; 2] = ["--pace", "4"];

#[test]
fn a_robot_told_to_stop_stands_until_it_is_told_to_go_on() {
    let mut run = Run::start("halt", "open-room", &PACE);
    run.wait_until_under_way(2.0);
    operate("halt", &["stop"]);
    let stopped = run.wait_until("it is stopped", |status| {
        status["order"] == "stopped by an operator"
    });
    // Its ticks go on: it may be carried.
    let tick = stopped["tick"].as_u64().unwrap();
    let later = run.wait_until("some ticks have passed", |status| {
        status["tick"].as_u64().unwrap() > tick + 10
    });
    assert_eq!(later["link"]["stopped"], true, "{later}");
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
fn an_operators_stop_uses_up_no_mission_time_and_is_no_stall() {
    let (pace, timeout_s) = (8.0, 45.0);
    let set = format!("timeout_s={timeout_s}");
    let arguments = ["--pace", "8", "--set", &set];
    let mut run = Run::start("stop-time", "open-room", &arguments);
    run.wait_until_under_way(2.0);
    operate("stop-time", &["stop"]);
    let stopped = std::time::Instant::now();
    run.wait_until("the stop has lasted as long as the mission may", |_| {
        stopped.elapsed().as_secs_f64() * pace > timeout_s
    });
    operate("stop-time", &["resume"]);
    let (code, summary) = run.finish();
    let ended = (code, &summary["outcome"], &summary["replans"]);
    assert_eq!(ended, (Some(0), &"reached".into(), &0.into()), "{summary}");
    assert_nothing_left("stop-time");
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
    let words = last["log_tail"].as_str().unwrap();
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
    // At this speed the mission outlasts as many freezes as it takes.
    let slow = [
        &PACE[..],
        &["--set", "controller.speed_m_s=0.02", "--timeout", "2000"],
    ]
    .concat();
    let mut run = Run::start("thawed", "open-room", &slow);
    run.wait_until_under_way(1.0);
    let beats = |status: &Value| {
        let controller = find(status, "controller");
        controller["state"] == "running" && controller["beat_age_s"].as_f64() < Some(0.1)
    };
    // On a busy machine the second command may come after the controller was replaced: then again.
    let goes_on = || {
        let before = run.wait_until("the controller beats", beats);
        operate("thawed", &["freeze", "controller"]);
        let thaw = output(&["thaw", "controller", "--robot", "thawed"]);
        let after = run.wait_until("the controller beats again", beats);
        let same = pid(&before, "controller") == pid(&after, "controller");
        assert!(!same || thaw.status.success(), "{thaw:?}");
        same.then_some(after)
    };
    let thawed = std::iter::repeat_with(goes_on)
        .take(20)
        .flatten()
        .next()
        .unwrap();
    operate("thawed", &["freeze", "mapper"]);
    let status = run.wait_until("it is replaced", |status| {
        find(status, "mapper")["generation"] == 2 && find(status, "mapper")["state"] == "running"
    });
    assert_eq!(
        pid(&status, "controller"),
        pid(&thawed, "controller"),
        "{status}"
    );
    let mut deaths = run.records("deaths.jsonl");
    deaths.retain(|death| death["stage"] == "mapper");
    assert_eq!(deaths.len(), 1, "{deaths:?}");
    assert_eq!(deaths[0]["hung"], true, "{deaths:?}");
    assert!(
        deaths[0]["beat_age_s"].as_f64().unwrap() >= 0.5,
        "{deaths:?}"
    );
    assert!(
        deaths[0]["log_tail"].as_str().unwrap().contains("ready"),
        "{deaths:?}"
    );
    run.signal(Signal::TERM);
    assert_eq!(run.finish().0, Some(0));
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
