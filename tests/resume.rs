//! A run whose supervisor was killed, and everything else with it, goes on.

use std::{path::Path, process::Stdio};

use crate::support::{self, Run, assert_nothing_left, firsthand, pids_of, run, signal_process};
use rustix::process::Signal;
use serde_json::Value;

/// Go on with the run in `directory` to its end.
fn resume(directory: &Path) -> (Option<i32>, Value) {
    let output = firsthand(&["run", "--json", "--resume"])
        .arg(directory)
        .stderr(Stdio::inherit())
        .output()
        .unwrap();
    let summary = serde_json::from_slice(&output.stdout).unwrap_or_default();
    (output.status.code(), summary)
}

fn pose_error(summary: &Value) -> f64 {
    summary["pose_error_m"].as_f64().unwrap()
}

#[test]
fn a_run_whose_supervisor_was_killed_again_and_again_is_resumed_and_loses_no_pose() {
    const PACE: [&str; 2] = ["--pace", "4"];
    let (_, undisturbed) = run("res-calm", "obstacle-course", &PACE);
    let mut first = Run::start("res-again", "obstacle-course", &PACE);
    first.wait_until_under_way(6.0);
    first.signal(Signal::KILL);
    first.reap();
    let directory = first.directory();
    for seconds in [12.0, 18.0] {
        let mut next = firsthand(&["run", "--json", "--resume"])
            .arg(&directory)
            .stdout(Stdio::null())
            .spawn()
            .unwrap();
        support::wait_for_status("res-again", |status| {
            status["order"] == "driving" && status["mission_time_s"].as_f64().unwrap() > seconds
        });
        signal_process(next.id(), Signal::KILL);
        next.wait().unwrap();
    }
    let (code, summary) = resume(&directory);
    assert_eq!((code, &summary["outcome"]), (Some(0), &"reached".into()));
    assert_eq!(summary["resumes"], 3, "{summary}");
    assert_eq!(summary["collisions"], 0, "{summary}");
    // Another way round reads the wheels at other fractions of a count: 9 mm across at the target.
    assert!(
        pose_error(&summary) <= pose_error(&undisturbed) + 0.015,
        "{summary} against {undisturbed}"
    );
    assert_nothing_left("res-again");
}

#[test]
fn a_run_goes_on_after_everything_was_killed_at_once() {
    // A mission of tens of thousands of ticks, in lockstep.
    let slow = ["--set", "controller.speed_m_s=0.004", "--timeout", "20000"];
    let mut all = Run::start("res-all", "open-room", &slow);
    all.wait_until_under_way(1.0);
    for pid in pids_of("res-all") {
        signal_process(pid, Signal::KILL);
    }
    all.reap();
    support::wait_until_all_ended("res-all");
    let (code, summary) = resume(&all.directory());
    assert_eq!((code, &summary["outcome"]), (Some(0), &"reached".into()));
    assert_eq!(
        (&summary["resumes"], &summary["collisions"]),
        (&1.into(), &0.into())
    );
    assert!(pose_error(&summary) < 0.01, "{summary}");
    assert_nothing_left("res-all");
}

#[test]
fn a_robot_that_was_told_to_stand_still_stands_when_its_run_goes_on() {
    let mut run = Run::start("res-stand", "open-room", &["--pace", "1"]);
    run.wait_until_under_way(0.5);
    let stop = support::output(&["stop", "--robot", "res-stand"]);
    assert!(stop.status.success(), "{stop:?}");
    run.signal(Signal::KILL);
    run.reap();
    let mut next = firsthand(&["run", "--json", "--resume"])
        .arg(run.directory())
        .stdout(Stdio::piped())
        .spawn()
        .unwrap();
    support::wait_for_status("res-stand", |status| {
        let stages = status["stages"].as_array().unwrap();
        assert_ne!(status["order"], "driving", "{status}");
        status["order"] == "stopped by an operator"
            && stages.iter().all(|stage| stage["state"] == "running")
    });
    let go = support::output(&["resume", "--robot", "res-stand"]);
    assert!(go.status.success(), "{go:?}");
    assert_eq!(next.wait().unwrap().code(), Some(0));
    assert_nothing_left("res-stand");
}

#[test]
fn a_run_that_came_to_its_end_is_not_resumed() {
    let (_, _, kept) = Run::start("res-end", "open-room", &[]).finish_in();
    let output = firsthand(&["run", "--resume"])
        .arg(kept.path().join("run"))
        .output()
        .unwrap();
    assert_eq!(output.status.code(), Some(1));
    let said = String::from_utf8(output.stderr).unwrap();
    assert!(said.contains("came to its end"), "{said}");
}
