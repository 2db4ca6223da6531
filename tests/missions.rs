use serde_json::Value;

use crate::support::{self, Run, assert_ended, assert_nothing_left, printed, run};

#[track_caller]
fn ends(robot: &str, mission: &str, arguments: &[&str], code: i32, outcome: &str) -> Value {
    let (found, summary) = run(robot, mission, arguments);
    assert_ended(found, &summary, code, outcome);
    assert_nothing_left(robot);
    summary
}

const PAPER: [&str; 2] = ["--set", "method=\"paper\""];

#[test]
fn a_mission_that_takes_too_long_ends_in_time() {
    ends("late", "obstacle-course", &["--timeout", "5"], 4, "timeout");
}

#[test]
fn a_touch_ends_the_mission_as_a_collision() {
    // The robot is blind, because hits beyond 5 cm are not mapped.
    let blind = [&PAPER[..], &["--set", "mapper.map_within_m=0.05"]].concat();
    let summary = ends("blind", "obstacle-course", &blind, 5, "collision");
    assert!(summary["collisions"].as_u64() > Some(0));
}

#[test]
fn every_run_leaves_a_picture_a_summary_and_logs() {
    let (summary, directory) = Run::start("picture", "open-room", &[]).arrives_in();
    let directory = directory.path().join("run");
    let picture = std::fs::read_to_string(directory.join("picture.svg")).unwrap();
    assert!(picture.starts_with("<svg") && picture.ends_with("</svg>\n"));
    let written = support::records(&directory.join("summary.json"));
    assert_eq!(written, [summary]);
    for process in support::STAGES.iter().copied().chain(["x80-sim"]) {
        assert!(support::logged(&directory, process, &[]) > 0, "{process}");
    }
}

/// Returns the reports of `bench tick` with these arguments, one per regime. The mission lasts a
/// few seconds.
fn latency(robot: &str, arguments: &[&str]) -> Vec<Value> {
    let short = ["bench", "tick", "--rounds", "1", "--set", "timeout_s=5", "--json"];
    let printed = printed(&[&short[..], &["--robot", robot], arguments].concat());
    assert_nothing_left(robot);
    printed.lines().map(|line| serde_json::from_str(line).unwrap()).collect()
}

#[test]
fn latency_measures_ticks_beside_hops_in_both_regimes_and_leaves_nothing() {
    let reports = latency("hops", &["--busy", "1", "--set", "robot.rate_hz=20"]);
    let regimes: Vec<_> = reports.iter().map(|report| &report["regime"]).collect();
    assert_eq!(regimes, ["back to back", "at 20 Hz"]);
    for report in &reports {
        let times = report["times"].as_array().unwrap();
        assert_eq!(times.len(), 2, "{report}");
        for (row, key) in times.iter().flat_map(|row| ["p50_us", "p99_us"].map(|key| (row, key))) {
            assert!(row[key].as_f64() > Some(0.0), "{key}: {report}");
        }
        assert!(report["ratio"].as_f64() > Some(0.0), "{report}");
    }
}

#[test]
fn latency_at_a_rate_is_measured_at_that_rate_alone() {
    let reports = latency(
        "hops-30hz",
        &["--rate", "30", "--set", "timeout_s=12", "--no-record", "--consumers", "0"],
    );
    assert_eq!(reports.len(), 1, "{reports:?}");
    assert_eq!(reports[0]["regime"], "at 30 Hz");
}
