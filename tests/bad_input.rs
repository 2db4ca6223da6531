//! One clear sentence with cause and remedy, a non-zero exit, nothing left running.

use std::net::UdpSocket;

use crate::support::{Run, assert_nothing_left, firsthand, output};
use rustix::process::Signal;

/// The sentence on standard error of a command that must fail.
fn refusal(arguments: &[&str]) -> String {
    let output = output(arguments);
    assert!(!output.status.success(), "{arguments:?} succeeded");
    let text = String::from_utf8(output.stderr).unwrap();
    assert!(!text.contains("panicked"), "{text}");
    text
}

fn refused_mission(content: &str) -> String {
    let directory = tempfile::tempdir().unwrap();
    let file = directory.path().join("bad.toml");
    std::fs::write(&file, content).unwrap();
    let text = refusal(&["check", file.to_str().unwrap()]);
    let run = refusal(&["run", file.to_str().unwrap(), "--robot", "bad"]);
    assert_eq!(text, run, "check and run disagree");
    assert_nothing_left("bad");
    text
}

#[test]
fn a_bad_mission_is_refused_with_line_key_and_remedy() {
    let cases = [
        (
            "target = [99, 0]",
            "bad.toml:1: target: ",
            "widen perimeter.width_m",
        ),
        (
            "target = [3, 0]\n[perimeter]\ncells = 3",
            "bad.toml:3: perimeter.cells: ",
            "give 10 to 4096",
        ),
        (
            "target = [3, 0]\n[perimeter]\ncells = 99999",
            "bad.toml:3: perimeter.cells: ",
            "give 10 to 4096",
        ),
        ("target = [3, nan]", "bad.toml:1: target: ", "finite"),
        (
            "target = [3, 0]\nspeed = 1",
            "bad.toml:2: ",
            "unknown field `speed`",
        ),
        (
            "target = [3, 0]\n[[world.drum]]\nat = [0, 0.1]\nradius_m = 0.3",
            "bad.toml:2: world: ",
            "move it away",
        ),
    ];
    for (content, place, remedy) in cases {
        let text = refused_mission(content);
        assert!(
            text.contains(place) && text.contains(remedy),
            "{content:?} gave {text:?}"
        );
    }
}

#[test]
fn an_unknown_mission_is_answered_with_those_there_are() {
    let text = refusal(&["run", "moon"]);
    assert!(
        text.contains("moon") && text.contains("obstacle-course"),
        "{text}"
    );
    let text = refusal(&["check", "/no/such/file.toml"]);
    assert!(text.contains("/no/such/file.toml"), "{text}");
}

#[test]
fn an_unknown_stage_is_answered_with_those_there_are() {
    let text = refusal(&["stage", "warp", "--run", "/tmp", "--supervisor", "1"]);
    assert!(
        text.contains("warp") && text.contains("dead-reckoning"),
        "{text}"
    );
}

#[test]
fn a_second_supervisor_of_a_robot_is_refused_and_the_first_goes_on() {
    let mut first = Run::start("second", "obstacle-course", &["--pace", "1"]);
    first.wait_until_under_way(0.3);
    let runs = tempfile::tempdir().unwrap();
    let runs = runs.path().to_str().unwrap();
    let text = refusal(&["run", "--robot", "second", "--runs", runs]);
    let pid = first.pid().to_string();
    assert!(text.contains(&pid) && text.contains("--robot"), "{text}");
    assert!(first.status().is_some());
    first.signal(Signal::TERM);
    first.finish();
    assert_nothing_left("second");
}

#[test]
fn a_port_in_use_is_named() {
    let taken = UdpSocket::bind("127.0.0.1:0").unwrap();
    let address = taken.local_addr().unwrap().to_string();
    let text = refusal(&["sim", "open-room", "--listen", &address]);
    assert!(text.contains(&address), "{text}");
}

#[test]
fn a_robot_address_that_is_none_is_named() {
    let runs = tempfile::tempdir().unwrap();
    let runs = runs.path().to_str().unwrap();
    let text = refusal(&[
        "run",
        "--robot",
        "nowhere",
        "--runs",
        runs,
        "--set",
        "robot.address='not an address'",
    ]);
    assert!(
        text.contains("not an address") && text.contains("robot.address"),
        "{text}"
    );
    assert_nothing_left("nowhere");
}

#[test]
fn status_of_a_robot_that_does_not_run_says_so() {
    let text = refusal(&["status", "--robot", "ghost"]);
    assert!(
        text.contains("ghost") && text.contains("firsthand run"),
        "{text}"
    );
}

#[test]
fn a_bad_pace_or_robot_name_is_refused_by_the_command_line() {
    assert!(refusal(&["run", "--pace", "warp"]).contains("warp"));
    assert!(refusal(&["run", "--robot", "../x"]).contains("../x"));
}

#[test]
fn results_of_an_earlier_run_are_not_overwritten() {
    let directory = tempfile::tempdir().unwrap();
    let out = directory.path().join("out");
    let out = out.to_str().unwrap();
    let first = firsthand(&["run", "open-room", "--robot", "again", "--out", out])
        .output()
        .unwrap();
    assert!(first.status.success());
    let text = refusal(&["run", "open-room", "--robot", "again", "--out", out]);
    assert!(text.contains(out), "{text}");
}
