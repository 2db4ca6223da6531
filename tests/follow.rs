//! A robot that follows another robot. `simulation` lets one follow a beacon.

use serde_json::Value;

use crate::support::{
    Run, assert_nothing_left, firsthand, operate, refused, replayed_in, start_piped,
};
use rustix::process::Signal;

#[test]
fn a_robot_follows_the_pose_of_another_robot_until_that_ends_and_replays_to_the_bit() {
    let (first, second) = ("follow-first", "follow-second");
    let mission = "--stay --pace 2";
    let mut leads = Run::start(first, "open-room", mission);
    let mut follows = Run::start(second, "open-room", mission);
    leads.wait_until_driving();
    follows.wait_until_driving();
    for (leader, distance, code) in
        [(first, "0.2", "too-near"), (first, "nan", "too-near"), (second, "1", "follows-itself")]
    {
        let words = ["goto", "--robot", second, "--follow", leader, "--distance", distance];
        refused(&words, code, &[]);
    }
    // The first robot's mission frame is 1 m ahead of the second's, turned to its left.
    operate(first, "goto 1.2 0");
    let mut command = firsthand(&["goto", "--robot", second, "--follow", first]);
    let command = start_piped(command.args(["--frame", "1", "0", "90", "--distance", "0.8"]));
    let off_m = |status: &Value| {
        let at = |key: &str| status["pose"][key].as_f64().unwrap_or(9.0);
        (at("x_m") - 1.0).hypot(at("y_m") - 1.2)
    };
    let status = follows.wait_until("it is beside the first robot", |status| {
        off_m(status) < 1.2 && status["order"] == "driving" && status["link"]["at_rest"] == true
    });
    assert!(off_m(&status) > 0.6, "{status}");
    leads.stop();
    follows.wait_until("it lost the first robot", |status| {
        status["order"] == "lost what it follows" && status["link"]["at_rest"] == true
    });
    operate(second, "goto 0 0");
    let output = command.wait_with_output().unwrap();
    let said = String::from_utf8(output.stdout).unwrap();
    // A starved machine may lose the first robot more than once: its pose is late after 0.5 s.
    assert!(output.status.success(), "{said}");
    assert!(said.contains(", lost ") && !said.ends_with("lost never\n"), "{said}");
    follows.wait_until_driving();
    follows.signal(Signal::INT);
    let (_, summary, directory) = follows.finish_in();
    assert_eq!(summary["targets"][1]["outcome"], "followed", "{summary}");
    replayed_in(&directory);
    assert_nothing_left(second);
}
