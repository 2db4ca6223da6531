//! Tests of robot faults that their link must notice, through real processes
//! (`firsthand bench chaos --robot-faults`).

use serde_json::Value;

use crate::support::{Run, assert_nothing_left, json_of, output};

/// Returns the exit code, and the entry of the stop-time table for a robot with `fault`.
fn stop_time(robot: &str, fault: &str) -> (Option<i32>, Value) {
    let fault = format!("--robot-faults={fault}");
    let arguments = ["bench", "chaos", "open-room", &fault, "--json", "--robot", robot];
    let (exit, table) = json_of(&output(&arguments));
    assert_nothing_left(robot);
    (exit.code(), table[0]["entries"][0].clone())
}

#[test]
fn a_robot_that_falls_silent_is_at_rest_in_time_and_the_stop_time_table_says_so() {
    let (code, entry) = stop_time("rf-silent", "silence");
    assert_eq!(code, Some(0), "{entry}");
    assert_eq!(entry["fault"], "silence", "{entry}");
    assert_eq!(entry["fault_began"], true, "{entry}");
    assert_eq!(entry["reason"], "robot lost", "{entry}");
    assert!(entry["promised_s"].as_f64() < Some(2.0), "{entry}");
    assert!(entry["rest_s"].as_f64() < entry["promised_s"].as_f64(), "{entry}");
    assert!(entry["last_moving_s"].as_f64() < entry["promised_s"].as_f64(), "{entry}");
}

#[test]
fn a_robot_that_rests_has_a_reason_although_a_killed_mission_left_its_bus() {
    let mut killed = Run::start("rf-bus", "open-room", &["--pace", "1"]);
    killed.wait_until_under_way(0.1);
    killed.kill();
    let (code, entry) = stop_time("rf-bus", "silence");
    assert_eq!((code, &entry["reason"]), (Some(0), &"robot lost".into()), "{entry}");
}

#[test]
fn a_robot_that_does_not_stop_is_told_as_long_as_it_moves() {
    // Exit code and table agree whether the robot stops or not.
    let (code, entry) = stop_time("rf-moves", "does-not-stop");
    let in_time = entry["rest_s"].as_f64() <= entry["promised_s"].as_f64();
    assert_eq!(code, Some(if in_time { 0 } else { 8 }), "{entry}");
}

#[test]
fn a_robot_whose_wheels_are_held_on_the_way_is_unreachable_and_reports_no_arrival() {
    let (code, entry) = stop_time("rf-held", "held-wheels");
    assert_eq!(code, Some(0), "{entry}");
    assert_eq!(entry["fault_began"], true, "{entry}");
    assert_eq!(entry["outcome"], "unreachable", "{entry}");
}
