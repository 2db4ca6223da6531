//! Robots that lie to their link, through real processes (`firsthand chaos --robot-faults`).

use serde_json::Value;

use crate::support::{assert_nothing_left, output};

#[test]
fn a_robot_that_falls_silent_is_at_rest_in_time_and_the_ledger_says_so() {
    let arguments = ["chaos", "open-room", "--robot-faults=silence", "--json"];
    let output = output(&[&arguments[..], &["--robot", "ledger-silent"]].concat());
    let text = String::from_utf8_lossy(&output.stdout);
    let ledger: Value = serde_json::from_str(&text).unwrap_or_else(|_| panic!("{output:?}"));
    let entry = &ledger["entries"][0];
    assert_eq!(output.status.code(), Some(0), "{ledger}");
    assert_eq!(
        (&entry["fault"], &entry["fault_began"]),
        (&"silence".into(), &true.into())
    );
    assert_eq!(entry["reason"], "robot lost", "{ledger}");
    assert!(entry["rest_s"].as_f64().unwrap() < 2.0, "{ledger}");
    assert!(entry["last_moving_s"].as_f64().unwrap() < 2.0, "{ledger}");
    assert_nothing_left("ledger-silent");
}

#[test]
fn a_robot_that_does_not_stop_is_told_as_long_as_it_moves() {
    let arguments = [
        "chaos",
        "open-room",
        "--robot-faults=does-not-stop",
        "--json",
    ];
    let output = output(&[&arguments[..], &["--robot", "ledger-deaf"]].concat());
    let text = String::from_utf8_lossy(&output.stdout);
    let ledger: Value = serde_json::from_str(&text).unwrap_or_else(|_| panic!("{output:?}"));
    // Whether it is brought to rest or not, the exit code and the ledger agree.
    let rest_s = ledger["entries"][0]["rest_s"].as_f64().unwrap();
    let want = if rest_s > 2.0 { 8 } else { 0 };
    assert_eq!(output.status.code(), Some(want), "{ledger}");
}

#[test]
fn a_robot_fault_that_is_not_known_is_refused_with_those_that_are() {
    let output = output(&["chaos", "--robot-faults=honest"]);
    let said = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(2), "{said}");
    assert!(
        said.contains("honest") && said.contains("encoder-dead"),
        "{said}"
    );
}
