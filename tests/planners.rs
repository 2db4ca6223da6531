//! Tests of planners as separate executables: a mission names them, and they are supervised like
//! every stage.

use std::{fs, os::unix::fs::PermissionsExt as _, path::Path, process::Stdio};

use rustix::process::Signal;

use crate::support::{
    self, Run, assert_nothing_left, assert_reached, directory_of, find, firsthand, json_of, pid,
    printed, refused, signal_process, start_quietly,
};

/// Drum known beforehand, so the path around it is the same in every run.
const DRUM: [&str; 6] = [
    "--set",
    "known.drum=[{at=[1.8, 0.1], radius_m=0.3}]",
    "--set",
    "world.drum=[{at=[1.8, 0.1], radius_m=0.3}]",
    "--set",
    "mapper.clearance_m=0.1",
];

/// Makes an executable at `path` that becomes a baseline.
fn own_planner(path: &Path) {
    let text = format!(
        "#!/bin/sh\nshift 2\nexec {} stage wavefront \"$@\"\n",
        env!("CARGO_BIN_EXE_firsthand")
    );
    fs::write(path, text).unwrap();
    fs::set_permissions(path, fs::Permissions::from_mode(0o755)).unwrap();
}

fn planner(executable: &str) -> String {
    format!("planner.executable='{executable}'")
}

#[test]
fn a_mission_with_a_planner_of_its_own_arrives_though_the_planner_is_killed_on_the_way() {
    let set = planner("wavefront");
    let arguments = [&DRUM[..], &["--pace", "4", "--set", &set]].concat();
    let mut run = Run::start("wavefront", "open-room", &arguments);
    // At 0.25 m/s the robot is then on its way around the drum.
    let status = run.wait_until_under_way(6.0);
    // The summary counts the restart even if the run ends early.
    signal_process(pid(&status, "planner"), Signal::KILL);
    let summary = run.arrives();
    assert_eq!(summary["restarts"]["planner"], 1, "{summary}");
    // The harmonic planner would have solved its field.
    assert_eq!(summary["full_solves"], 0, "{summary}");
}

#[test]
fn a_run_with_a_planner_named_by_a_relative_path_is_resumed_from_elsewhere() {
    let robot = "elsewhere";
    let directory = directory_of(robot);
    let folder = directory.path();
    own_planner(&folder.join("planner"));
    let mut first = firsthand(&["run", "open-room", "--robot", robot, "--pace", "4"]);
    first.args(["--out", "run", "--set", &planner("./planner")]);
    let mut first = start_quietly(first.current_dir(folder));
    support::wait_for_status(robot, |status| {
        status["order"] == "driving" && find(status, "planner")["state"] == "running"
    });
    first.kill().unwrap();
    first.wait().unwrap();
    let resumed = firsthand(&["run", "--json", "--resume"])
        .arg(folder.join("run"))
        .current_dir("/")
        .output()
        .unwrap();
    let (exit, summary) = json_of(&resumed);
    assert_reached(exit.code(), &summary[0]);
    assert_eq!(summary[0]["full_solves"], 0, "{summary:?}");
    assert_nothing_left(robot);
}

#[test]
fn a_stage_started_by_another_becomes_the_planner_that_the_mission_names() {
    let folder = tempfile::tempdir().unwrap();
    let own = folder.path().join("planner");
    own_planner(&own);
    for (robot, named) in [("own-units", own.to_str().unwrap()), ("base-units", "wavefront")] {
        becomes_the_planner(robot, named);
    }
}

fn becomes_the_planner(robot: &str, named: &str) {
    let set = planner(named);
    let arguments = ["--pace", "4", "--watch-only", "--set", &set];
    let mut run = Run::start(robot, "open-room", &arguments);
    run.wait_until("there is a bus", |status| status["order"] == "starting");
    let start = |stage: &&str| {
        let mut command = firsthand(&["stage", stage, "--robot", robot]);
        command.stderr(Stdio::null()).spawn().unwrap()
    };
    let stages: Vec<_> = support::STAGES.iter().map(start).collect();
    let status = run.wait_until_driving();
    let pid = pid(&status, "planner");
    let words = fs::read_to_string(format!("/proc/{pid}/cmdline")).unwrap();
    assert!(words.contains("stage\0wavefront\0"), "{words:?}");
    run.signal(Signal::TERM);
    assert_eq!(run.finish().0, Some(0));
    for mut stage in stages {
        stage.wait().unwrap();
    }
    assert_nothing_left(robot);
}

#[test]
fn a_planner_that_cannot_be_started_is_refused_by_name_before_anything_starts() {
    let directory = tempfile::tempdir().unwrap();
    let runs = directory.path().to_str().unwrap();
    let plain = directory.path().join("plain");
    fs::write(&plain, "").unwrap();
    let plain = plain.to_str().unwrap();
    for named in ["./no-such-planner", plain] {
        let set = planner(named);
        let run = ["run", "--robot", "no-plan", "--runs", runs, "--set", &set];
        let evaluate = ["evaluate", "--planner", named, "--out", runs];
        for arguments in [&run[..], &evaluate] {
            let exit = refused(arguments, "planner-executable", &[named]);
            assert_eq!(exit, Some(78), "{arguments:?}");
        }
    }
    let left = fs::read_dir(directory.path()).unwrap();
    assert_eq!(left.count(), 1, "only the plain file is left");
    assert_nothing_left("no-plan");
}

#[test]
fn planners_are_compared_on_the_same_worlds_and_every_row_names_its_planner() {
    let directory = tempfile::tempdir().unwrap();
    let out = directory.path().join("out");
    let out = out.to_str().unwrap();
    let planners = ["--planner", "harmonic,wavefront", "--count", "1", "--out", out];
    let compared = printed(&[&["evaluate", "--json"], &planners[..]].concat());
    let object: serde_json::Value = serde_json::from_str(&compared).unwrap();
    assert_eq!(object["setting"], "harmonic", "{object}");
    assert_eq!(object["versus"][0]["totals"]["setting"], "wavefront", "{object}");
    assert_eq!(object["versus"][0]["pairs"], 1, "{object}");
    let rows = fs::read_to_string(format!("{out}/rows.csv")).unwrap();
    let column = rows.lines().map(|row| row.split(',').nth(3).unwrap());
    let mut column: Vec<_> = column.collect();
    column.sort_unstable();
    assert_eq!(column, ["harmonic", "planner", "wavefront"]);
    let other = ["evaluate", "--planner", "wavefront", "--count", "1", "--out", out, "--resume"];
    refused(&other, "other-results", &[out]);
}
