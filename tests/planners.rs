//! Tests of planners as separate executables: a mission names them, and they are supervised like
//! every stage.

use std::{fs, os::unix::fs::PermissionsExt as _, path::Path};

use crate::support::{
    Run, STAGES, firsthand, json_lines, pid, printed, refused, signal_process, start_quietly, words,
};

/// Drum known beforehand, so the path around it is the same in every run.
const DRUM: &str = "--set known.drum=[{at=[1.8,0.1],radius_m=0.3}] \
    --set world.drum=[{at=[1.8,0.1],radius_m=0.3}] --set mapper.clearance_m=0.1";

/// Makes an executable at `path` that becomes a baseline.
fn own_planner(path: &Path) {
    let text = format!(
        "#!/bin/sh\nshift 2\nexec {} stage wavefront \"$@\"\n",
        env!("CARGO_BIN_EXE_firsthand")
    );
    fs::write(path, text).unwrap();
    fs::set_permissions(path, fs::Permissions::from_mode(0o755)).unwrap();
}

#[test]
fn a_mission_with_a_planner_of_its_own_arrives_though_the_planner_is_killed_on_the_way() {
    let line = format!("{DRUM} --pace 4 --set planner.executable='wavefront'");
    let mut run = Run::start("wavefront", "open-room", &line);
    // At 0.25 m/s the robot is then on its way around the drum.
    let status = run.wait_until_under_way(6.0);
    // The summary counts the restart even if the run ends early.
    signal_process(pid(&status, "planner"), rustix::process::Signal::KILL);
    let summary = run.arrives();
    assert_eq!(summary["restarts"]["planner"], 1, "{summary}");
    // The harmonic planner would have solved its field.
    assert_eq!(summary["full_solves"], 0, "{summary}");
}

#[test]
fn a_stage_started_by_another_becomes_the_planner_that_the_mission_names() {
    let folder = tempfile::tempdir().unwrap();
    let own = folder.path().join("planner");
    own_planner(&own);
    for (robot, named) in [("own-units", own.to_str().unwrap()), ("base-units", "wavefront")] {
        let line = format!("--pace 4 --watch-only --set planner.executable='{named}'");
        let mut run = Run::start(robot, "open-room", &line);
        run.wait_until("there is a bus", |status| status["order"] == "starting");
        let stages =
            STAGES.map(|stage| start_quietly(&mut firsthand(&["stage", stage, "--robot", robot])));
        let status = run.wait_until_driving();
        let pid = pid(&status, "planner");
        let words = fs::read_to_string(format!("/proc/{pid}/cmdline")).unwrap();
        assert!(words.contains("stage\0wavefront\0"), "{words:?}");
        run.arrives();
        for mut stage in stages {
            stage.wait().unwrap();
        }
    }
}

#[test]
fn planners_are_compared_on_the_same_worlds_and_every_row_names_its_planner() {
    let directory = tempfile::tempdir().unwrap();
    let out = directory.path().join("out");
    let out = out.to_str().unwrap();
    let line = format!("evaluate --json --planner harmonic,wavefront --count 1 --out {out}");
    let object = &json_lines(&printed(&words(&line)))[0];
    assert_eq!(object["setting"], "harmonic", "{object}");
    assert_eq!(object["versus"][0]["totals"]["setting"], "wavefront", "{object}");
    assert_eq!(object["versus"][0]["pairs"], 1, "{object}");
    let rows = fs::read_to_string(format!("{out}/rows.csv")).unwrap();
    let column = rows.lines().map(|row| row.split(',').nth(3).unwrap());
    let mut column: Vec<_> = column.collect();
    column.sort_unstable();
    assert_eq!(column, ["harmonic", "planner", "wavefront"]);
    let other = format!("evaluate --planner wavefront --count 1 --out {out} --resume");
    refused(&words(&other), "other-results", &[out]);
}
