//! Tests of an operator's actions on a running robot: stop and resume, kill, hold and release.

use common::clock::monotonic_ns;

use crate::support::{Run, find, operate};

const PACE: [&str; 2] = ["--pace", "4"];

#[test]
fn a_robot_told_to_stop_stands_until_it_is_told_to_go_on() {
    let mut run = Run::under_way("halt", "open-room", &PACE, 2.0);
    operate("halt", &["stop"]);
    let stopped =
        run.wait_until("it is stopped", |status| status["order"] == "stopped by an operator");
    // A stopped robot continues its ticks, because it may be carried.
    let tick = stopped["tick"].as_u64().unwrap();
    let later = run.wait_until("some ticks have passed", |status| {
        status["tick"].as_u64().unwrap() > tick + 10
    });
    assert_eq!(later["link"]["stopped"], true, "{later}");
    operate("halt", &["resume"]);
    run.arrives();
}

#[test]
fn a_stop_of_which_the_supervisor_hears_after_the_resume_does_not_stop_the_robot_again() {
    let run = Run::under_way("late-stop", "open-room", &PACE, 2.0);
    let asked_ns = monotonic_ns().to_string();
    operate("late-stop", &["stop"]);
    operate("late-stop", &["resume"]);
    operate("late-stop", &["stop", "--through-supervisor", &asked_ns]);
    run.arrives();
}

#[test]
fn an_operators_stop_uses_up_no_mission_time_and_is_no_stall() {
    // Time in which a busy machine starts the stages.
    let (pace, timeout_s) = (4.0, 100.0);
    let set = format!("timeout_s={timeout_s}");
    let arguments = ["--pace", "4", "--set", &set, "--set", "controller.speed_m_s=0.5"];
    let mut run = Run::under_way("stop-time", "open-room", &arguments, 2.0);
    operate("stop-time", &["stop"]);
    let stopped = std::time::Instant::now();
    run.wait_until("the stop has lasted for the mission's time limit", |_| {
        stopped.elapsed().as_secs_f64() * pace > timeout_s
    });
    operate("stop-time", &["resume"]);
    assert_eq!(run.arrives()["replans"], 0);
}

#[test]
fn a_stage_that_dies_again_and_again_is_held_until_an_operator_releases_it() {
    let mut run = Run::under_way("held", "open-room", &PACE, 1.0);
    // The next generation fails at its start.
    let checkpoint = run.directory().join("mapper.checkpoint");
    std::fs::remove_file(&checkpoint).unwrap();
    std::fs::create_dir(&checkpoint).unwrap();
    operate("held", &["stage", "kill", "mapper"]);
    run.wait_until("it is held", |status| find(status, "mapper")["state"] == "held");
    let status = run
        .wait_until("the robot is stopped", |status| status["order"] == "stopped, a stage is held");
    for stage in status["stages"].as_array().unwrap() {
        let others = stage["name"] != "mapper";
        assert!(!others || stage["restarts"] == 0, "a sibling was touched: {status}");
    }
    let deaths = run.records("deaths.jsonl");
    assert_eq!(deaths[0]["cause"]["signalled"]["signal"], 9, "{deaths:?}");
    assert_eq!(deaths[0]["next"], "start_now", "{deaths:?}");
    let last = deaths.last().unwrap();
    assert_eq!((&last["cause"]["exited"], &last["next"]), (&1.into(), &"hold".into()));
    let log_tail = last["log_tail"].as_str().unwrap();
    assert!(log_tail.contains("mapper.checkpoint"), "{log_tail}");
    std::fs::remove_dir(&checkpoint).unwrap();
    operate("held", &["stage", "restart", "mapper"]);
    run.arrives();
}
